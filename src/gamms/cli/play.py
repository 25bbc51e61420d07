"""The commands that play a game: demo and run."""

from collections.abc import Iterator
from contextlib import ExitStack, nullcontext, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gamms.cli import many
from gamms.cli.output import (
    RECORDING,
    describe_missing,
    echo,
    explain_error,
    film_game,
    join_names,
    make_console,
    make_rich_table,
    record_game,
    save_pictures,
    warn,
)
from gamms.errors import GammsError
from gamms.folders import make_folder, remove_link
from gamms.text import make_printable_line, reason

if TYPE_CHECKING:
    from gamms.context import Context
    from gamms.demo import Team
    from gamms.game import Result
    from gamms.scenario import Scenario
    from gamms.typing import PictureOptions
    from gamms.web import ServeOptions

_HELSINKI = "Central Helsinki"
HERE = "127.0.0.1"  # the address at which games are served
_NAMES = ("red", "blue")
_MOST_AGENTS = 1000

ScenarioFile = Annotated[
    Path, typer.Argument(help="A scenario file, YAML or JSON.", metavar="SCENARIO", show_default=False)
]
Allow = Annotated[
    list[str] | None,
    typer.Option("--allow", help="Let the file name what this installed package defines.", metavar="PACKAGE"),
]


KeyVariable = Annotated[
    str | None,
    typer.Option(
        "--key-variable",
        help="With --allow gamms.llm: the environment variable that holds the key of the language model.",
        metavar="NAME",
        show_default=False,
    ),
]


def demo(
    max_turns: Annotated[int, typer.Option(min=1, help="The game ends after this many turns at the latest.")] = 600,
    seed: Annotated[int, typer.Option(help="The same seed plays the same game.")] = 1,
    teams: Annotated[str, typer.Option(help="Agents per team: 5, or 5,3, or with names: cats=5,dogs=3.")] = "5",
    out: Annotated[
        Path, typer.Option(help="The folder for game.html, result.json, game.ggr, game.mp4 and final.png.")
    ] = Path("gamms-demo"),
    map: Annotated[Path | None, typer.Option(help="An OpenStreetMap file to play on instead of Helsinki.")] = None,
    film: Annotated[bool, typer.Option("--film/--no-film", help="Whether to film it.")] = True,
) -> None:
    """Play capture the flag on the streets of a city."""
    from gamms import recorder
    from gamms.demo import capture_the_flag, check_ways

    sides = _parse_teams(teams)
    game = capture_the_flag(sides, max_turns, map)
    map_name = _HELSINKI if map is None else map.name
    page: PictureOptions = {"title": f"Capture the flag, {map_name}", "captions": True, "sensors": False}
    with game.build(seed) as ctx:
        check_ways(ctx)
        with ExitStack() as making:
            recording = making.enter_context(record_game(ctx, out))
            film_file = making.enter_context(film_game(ctx, out, **page) if film else nullcontext())
            played = ctx.game.run(progress=True)
        played.save(remove_link(out / "result.json"))
        with recorder.open(recording) as whole:
            whole.save(remove_link(out / "game.html"), title=page["title"], sensors=page["sensors"])
        pictures = save_pictures(ctx, out, **page)
        _print_demo(ctx, played, sides, map_name)
    named = "" if film_file is None else f", {film_file} (the game as a film)"
    wanted = [out / name for name in ("game.mp4",) * film + ("final.png",)]
    echo(
        f"\nWrote {out / 'game.html'} (the game, to be opened in a browser), {out / 'result.json'} (every event), "
        f"{recording} (every move; gamms replay){named} and {join_names(pictures)} (the last turn)."
        f"{describe_missing(wanted, [film_file, *pictures])}"
    )


def run(  # noqa: PLR0913, PLR0917 - one argument per option
    file: ScenarioFile,
    seed: Annotated[
        int | None,
        typer.Option(help="The same seed plays the same game; by default that of the file.", metavar="SEED"),
    ] = None,
    seeds: Annotated[
        str | None, typer.Option(help="Play a game for each seed, 0:50 or 1,2,5, and compare them.", metavar="SEEDS")
    ] = None,
    max_turns: Annotated[
        int | None, typer.Option(min=0, help="The game ends after this many turns at the latest.", metavar="TURNS")
    ] = None,
    changes: Annotated[
        list[str] | None,
        typer.Option("--set", help="Change the scenario: teams.red.count=8.", metavar="PATH=VALUE"),
    ] = None,
    strategies: Annotated[
        list[str] | None,
        typer.Option(
            "--strategy", help="Play a team by a strategy of yours: red=mine.py:strategy.", metavar="TEAM=CODE"
        ),
    ] = None,
    allow: Allow = None,
    key_variable: KeyVariable = None,
    film: Annotated[
        Path | None, typer.Option(help="Film the game: a file .mp4 or .gif.", metavar="FILE", show_default=False)
    ] = None,
    window: Annotated[
        bool, typer.Option("--window", help="Show the game in a window, which stays open at the end.")
    ] = False,
    web: Annotated[
        bool, typer.Option("--web", help="Show the game to browsers while it is played, and print the links.")
    ] = False,
    port: Annotated[int, typer.Option(help="With --web; 0 takes a free one.", metavar="PORT")] = 0,
    host: Annotated[str, typer.Option(help="With --web: the address to serve at.", metavar="HOST")] = HERE,
    allow_network: Annotated[
        bool, typer.Option("--allow-network", help="With --web: let other machines in, at an address of this one.")
    ] = False,
    watch: Annotated[
        bool, typer.Option("--watch", help="With --web: begin again when the file or its code changes.")
    ] = False,
    out: Annotated[
        Path,
        typer.Option(
            help="The folder for result.json, game.ggr and final.png; with --seeds for results.csv and a result of "
            "each seed.",
            metavar="FOLDER",
        ),
    ] = Path("gamms-run"),
    jobs: Annotated[
        int | None,
        typer.Option(min=1, help="With --seeds: how many games at once. By default as many as cores.", metavar="N"),
    ] = None,
    sensed: Annotated[
        bool,
        typer.Option("--sensed/--no-sensed", help="Whether the recording contains what the sensors of agents saw."),
    ] = True,
) -> None:
    """Play the game in a scenario file."""
    from gamms import scenario

    if web:
        shown = {"--window": window, "--film": film is not None}
        _refuse_given(shown, "a game that is served to browsers has none: leave out --web.")
    else:
        served = {"--port": port != 0, "--host": host != HERE, "--allow-network": allow_network, "--watch": watch}
        _refuse_given(served, "this option needs --web.")
    if web or seeds is not None:
        _refuse_given({"--no-sensed": not sensed}, "this option is for a single game that is not served.")
    given = _parse_changes(changes or []) | ({} if max_turns is None else {"max_turns": max_turns})

    def load() -> "Scenario":
        return scenario.load(file, allow or (), key_variable=key_variable).replace(**given)

    game = load()
    found = _find_strategies(strategies or [])
    for line in find_foreign_code(game, found):
        echo(f"imports {make_printable_line(line)}")
    warn(game)
    if seeds is None:
        if jobs is not None:
            raise typer.BadParameter(f"{jobs} games at once need several seeds: add --seeds 0:20.", param_hint="--jobs")
        if web:
            options: ServeOptions = {"seed": seed, "port": port, "host": host, "allow_network": allow_network}
            played = many.import_strategies(found)

            def load_again() -> "Scenario":
                played.update(many.import_strategies(found))
                return load()

            options |= {"watch": load_again if watch else False, "strategies": played}
            _serve(game, options, out)
        else:
            _play_one(game, seed, found, film, out, is_shown=window, sensed=sensed)
        return
    if seed is not None or film is not None or window or web:
        raise typer.BadParameter("--seed, --film, --window and --web are for a single game.", param_hint="--seeds")
    many.play(game, many.parse_seeds(seeds), found, out, jobs)


def _refuse_given(options: dict[str, bool], why: str) -> None:
    """Raise BadParameter for the first option that is given: name -> whether it is."""
    for name, is_given in options.items():
        if is_given:
            raise typer.BadParameter(why, param_hint=name)


def _play_one(
    game: "Scenario",
    seed: int | None,
    found: many.Strategies,
    film: Path | None,
    out: Path,
    *,
    is_shown: bool,
    sensed: bool,
) -> None:
    from gamms import visual

    engine = visual.Engine.PYGAME if is_shown else visual.Engine.NO_VIS
    name = game.spec.name or (game.file.stem if game.file else "A game")
    with game.build(seed, many.import_strategies(found), engine) as ctx:
        with ExitStack() as making:
            making.enter_context(make_folder(out))  # the film may be there
            if film is not None:  # if refused, then before an earlier recording is replaced
                making.enter_context(ctx.visual.film(film, title=name))
            recording = making.enter_context(record_game(ctx, out, sensed=None if sensed else False))
            result = ctx.game.run(progress=True)
        result.save(remove_link(out / "result.json"))
        _draw_scenery(game, ctx)
        pictures = save_pictures(ctx, out, title=name, captions=True)
        echo(f"\n{name}: {result}")
        made = [f"{out / 'result.json'} (the result)", f"{recording} (every move; gamms replay)"]
        if film is not None:
            made.append(f"{film} (the game as a film)")
        if pictures:
            made.append(f"{join_names(pictures)} (the last turn)")
        missing = describe_missing([out / "final.png"] if pictures else [], pictures)
        echo(f"\nWrote {', '.join(made)}.{missing}")
        if is_shown:
            ctx.visual.stay_open()


def _draw_scenery(game: "Scenario", ctx: "Context") -> None:
    """Draw buildings, parks and water in pictures of a game that has been played and recorded."""
    from gamms.scenario.maps import load_scenery

    if ctx.is_terminated():
        return
    try:
        scenery = load_scenery(game.spec.map, game.to_dict()["map"], game.folder, ctx)
    except (GammsError, OSError) as error:
        echo(f"gamms: The pictures show streets only. {reason(error)}", err=True)
        return
    if scenery is not None:
        ctx.graph.graph.scenery = scenery


def _serve(game: "Scenario", options: "ServeOptions", out: Path) -> None:
    """Serve a game to browsers, and write its result, until Ctrl-C."""
    from gamms import web

    recording = out / RECORDING
    options["record"] = remove_link(recording)
    with make_folder(out), web.serve(game, **options) as live, suppress(KeyboardInterrupt):
        live.when_failed.append(lambda error: echo(explain_error(error), err=True))
        echo("The game is served until Ctrl-C. Open a link in a browser:")
        words = {"admin": "pause and change", "everything": "watch everything"}
        links = {words.get(name, f"watch as {name}"): link for name, link in live.links.items()}
        links |= {f"play {make_printable_line(name)}": link for name, link in live.players.items()}
        for name, link in links.items():
            echo(f"  {name:<18} {link}")
        result = live.wait()
        if result is not None:
            result.save(remove_link(out / "result.json"))
            echo(f"\n{result}\n\nWrote {out / 'result.json'}. The last turn is served until Ctrl-C.")
        live.stay_open()
    echo(f"\nWrote {recording} (every move; gamms replay).")


def _parse_changes(texts: list[str]) -> dict[str, Any]:
    """Parse `--set`: dotted path -> value."""
    from gamms.scenario.documents import name_errors, parse_yaml

    changes = {}
    for text in texts:
        path, sign, value = text.partition("=")
        if not sign or not path:
            raise typer.BadParameter(f"{text!r}: give a path and a value, teams.red.count=8.", param_hint="--set")
        with name_errors(f"--set {path}"):
            changes[path] = parse_yaml(value)
    return changes


def _find_strategies(texts: list[str]) -> many.Strategies:
    """Find the code of `--strategy`: team or agent -> (reference, folder to import it from)."""
    from gamms.scenario.code import find_function

    found = {}
    for text in texts:
        team, sign, reference = text.partition("=")
        if not sign or not team:
            raise typer.BadParameter(f"{text!r}: give red=mine.py:strategy.", param_hint="--strategy")
        found[team] = find_function(reference, f"--strategy {team}")
    return found


def find_foreign_code(game: "Scenario", chosen: many.Strategies) -> Iterator[str]:
    """Yield the code to be imported from outside of GAMMS, the folder of the file and the current folder."""
    replaced = [f"teams.{team}.strategy" for team in chosen]
    named = [(found.path, found) for found in game.code() if found.path not in replaced]
    folders = [folder.resolve() for folder in (game.folder, Path.cwd()) if folder is not None]
    for place, found in [*named, *((f"--strategy {team}", found) for team, (found, _) in chosen.items())]:
        is_near = found.file is not None and any(found.file.resolve().is_relative_to(one) for one in folders)
        if not is_near and found.module.partition(".")[0] != "gamms":
            yield f"{place}: {found}"


def _parse_teams(text: str) -> "tuple[Team, Team]":
    """Parse two teams from `5`, `5,3` or `cats=5,dogs=3`."""
    from gamms.demo import Team

    parts = [part.strip() for part in text.split(",")]
    parts = parts * 2 if len(parts) == 1 else parts
    try:
        pairs = [part.rpartition("=") for part in parts]
        names = [name.strip() or standard for (name, _, _), standard in zip(pairs, _NAMES, strict=True)]
        sizes = [int(size) for _, _, size in pairs]
    except ValueError:
        raise typer.BadParameter(f"{text!r}: give 5, or 5,3, or cats=5,dogs=3.", param_hint="--teams") from None
    if names[0] == names[1] or not all(1 <= size <= _MOST_AGENTS for size in sizes):
        message = f"{text!r}: two names and 1 to {_MOST_AGENTS} agents each, such as cats=5,dogs=3."
        raise typer.BadParameter(message, param_hint="--teams")
    first, second = (Team(*side) for side in zip(names, sizes, strict=True))
    return first, second


def _print_demo(ctx: "Context", played: "Result", sides: "tuple[Team, Team]", map_name: str) -> None:
    """Print the outcome of the demo."""
    from gamms import demo

    out = make_console()
    first, second = sides
    graph = ctx.graph.columns()
    streets = float(graph.lengths.sum()) / 2000.0
    out.print(f"[bold]Capture the flag[/] in {map_name}, seed {played.seed}")
    out.print(f"{first.name} ({first.size} agents) against {second.name} ({second.size} agents)")
    out.print(f"{len(graph.node_ids):,} nodes, {streets:.0f} km of streets; {ctx.graph.attribution or ''}\n")
    for turn, sentence in demo.key_events(ctx, played):
        out.print(f"  turn {turn:>4}  {sentence}")
    out.print(f"\n[bold]{demo.headline(ctx, played)}[/]\n")
    header, *rows = demo.table(ctx, played)
    out.print(make_rich_table(header, rows))
