"""The commands that play a game: demo and run."""

from collections.abc import Iterator
from contextlib import ExitStack, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape

from gamms.cli.output import (
    console,
    echo,
    filmed,
    in_words,
    not_made,
    recorded,
    rich_table,
    save_pictures,
)
from gamms.demo import Team
from gamms.text import printable_line

if TYPE_CHECKING:
    from collections.abc import Callable

    from gamms.context import Context
    from gamms.game import Result
    from gamms.scenario import Scenario
    from gamms.scenario.code import Found

_HELSINKI = "Central Helsinki"
_NAMES = ("red", "blue")
_MOST_AGENTS = 1000

ScenarioFile = Annotated[
    Path, typer.Argument(help="A scenario file, YAML or JSON.", metavar="SCENARIO", show_default=False)
]
Allow = Annotated[
    list[str] | None,
    typer.Option("--allow", help="Let the file name what this installed package defines.", metavar="PACKAGE"),
]


def demo(
    max_turns: Annotated[int, typer.Option(min=1, help="The game ends after this many turns at the latest.")] = 600,
    seed: Annotated[int, typer.Option(help="The same seed plays the same game.")] = 1,
    teams: Annotated[str, typer.Option(help="Agents per team: 5, or 5,3, or with names: cats=5,dogs=3.")] = "5",
    out: Annotated[Path, typer.Option(help="The folder for result.json, game.ggr, game.mp4 and final.png.")] = Path(
        "gamms-demo"
    ),
    map: Annotated[Path | None, typer.Option(help="An OpenStreetMap file to play on instead of Helsinki.")] = None,
    film: Annotated[bool, typer.Option("--film/--no-film", help="Whether to film it.")] = True,
) -> None:
    """Play capture the flag on the streets of a city."""
    from gamms.demo import capture_the_flag, check_ways, report

    sides = _parsed_teams(teams)
    game = capture_the_flag(sides, max_turns, map)
    map_name = _HELSINKI if map is None else map.name
    with game.build(seed) as ctx:
        check_ways(ctx)
        report.declare(ctx)
        with ExitStack() as making:
            recording = making.enter_context(recorded(ctx, out))
            film_file = making.enter_context(filmed(ctx, out, map_name) if film else nullcontext())
            played = ctx.game.run(progress=True)
        data = report.to_json(report.result(ctx, played, map_name, max_turns))
        (out / "result.json").write_text(data, encoding="utf-8")
        pictures = save_pictures(ctx, out, f"{map_name}: {report.headline(ctx, played)}")
        _print_demo(ctx, played, sides, map_name)
    named = "" if film_file is None else f", {film_file} (the game as a film)"
    wanted = [out / name for name in ("game.mp4",) * film + ("final.png",)]
    echo(
        f"\nWrote {out / 'result.json'} (every event), {recording} (every move; gamms replay){named} and "
        f"{in_words(pictures)} (the last turn).{not_made(wanted, [film_file, *pictures])}"
    )


def run(
    file: ScenarioFile,
    seed: Annotated[
        int | None, typer.Option(help="The same seed plays the same game; by default that of the file.")
    ] = None,
    max_turns: Annotated[
        int | None, typer.Option(min=0, help="The game ends after this many turns at the latest.")
    ] = None,
    changes: Annotated[list[str] | None, typer.Option("--set", help="Change the scenario: teams.red.count=8.")] = None,
    strategies: Annotated[
        list[str] | None, typer.Option("--strategy", help="Play a team by a strategy of yours: red=mine.py:strategy.")
    ] = None,
    allow: Allow = None,
    out: Annotated[Path, typer.Option(help="The folder for result.json, game.ggr and final.png.")] = Path("gamms-run"),
) -> None:
    """Play the game in a scenario file."""
    from gamms import scenario

    game = scenario.load(file, allow or ()).replace(**_changes(changes or []))
    if max_turns is not None:
        game = game.replace(max_turns=max_turns)
    found = _found_strategies(strategies or [])
    for line in _code_of(game, found):
        echo(f"imports {printable_line(line)}")
    with game.build(seed, {team: _imported(*one) for team, one in found.items()}) as ctx:
        with recorded(ctx, out) as recording:
            result = ctx.game.run(progress=True)
        result.save(out / "result.json")
        title = f"{game.spec.name or file.stem}: {result.reason} after {result.turns} turns"
        pictures = save_pictures(ctx, out, title)
        _print_result(console(), game, result)
    echo(
        f"\nWrote {out / 'result.json'} (what came of it), {recording} (every move; gamms replay) and "
        f"{in_words(pictures)} (the last turn).{not_made([out / 'final.png'], pictures)}"
    )


def _changes(texts: list[str]) -> dict[str, Any]:
    """Parse `--set`: dotted path -> value."""
    from gamms.scenario.documents import from_yaml

    changes = {}
    for text in texts:
        path, sign, value = text.partition("=")
        if not sign or not path:
            raise typer.BadParameter(f"{text!r}: give a path and a value, teams.red.count=8.", param_hint="--set")
        changes[path] = from_yaml(value)
    return changes


def _found_strategies(texts: list[str]) -> "dict[str, tuple[Found, Path]]":
    """Find the code of `--strategy`: team or agent -> where it is, and the folder to import it from."""
    from gamms.scenario.code import chosen

    found = {}
    for text in texts:
        team, sign, reference = text.partition("=")
        if not sign or not team:
            raise typer.BadParameter(f"{text!r}: give red=mine.py:strategy.", param_hint="--strategy")
        found[team] = chosen(reference, f"--strategy {team}")
    return found


def _imported(found: "Found", folder: Path) -> "Callable[..., Any]":
    from gamms.scenario.code import function_of

    return function_of(found, folder)


def _code_of(game: "Scenario", chosen: "dict[str, tuple[Found, Path]]") -> Iterator[str]:
    """Yield what is about to be imported: where it is named, and where it is."""
    replaced = [f"teams.{team}.strategy" for team in chosen]
    for found in game.code():
        if found.path not in replaced:
            yield f"{found.path}: {found}"
    for team, (found, _) in chosen.items():
        yield f"--strategy {team}: {found}"


def _print_result(out: Console, game: "Scenario", result: "Result") -> None:
    """Print the result of a scenario."""
    out.print(f"\n[bold]{escape(printable_line(game.spec.name or 'A game'))}[/], seed {result.seed}")
    end = f"{result.winner} wins" if result.winner is not None else "no team wins"
    out.print(f"[bold]{escape(printable_line(f'{end} after {result.turns} turns: {result.reason}'))}[/]\n")
    rows = []
    for team in game.spec.teams:
        agents = [agent for agent in result.agents.values() if agent["team"] == team]
        alive, moves = sum(agent["alive"] for agent in agents), sum(agent["moves"] for agent in agents)
        rows.append(
            (escape(printable_line(team)), str(len(agents)), str(alive), str(moves), f"{result.scores.get(team, 0):g}")
        )
    out.print(rich_table(("team", "agents", "alive", "moves", "score"), rows))
    if result.errors:
        out.print(f"\n{len(result.errors)} actions were replaced by staying; errors in result.json says which.")


def _parsed_teams(text: str) -> tuple[Team, Team]:
    """Parse two teams from `5`, `5,3` or `cats=5,dogs=3`."""
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


def _print_demo(ctx: "Context", played: "Result", sides: tuple[Team, Team], map_name: str) -> None:
    """Print what happened in the demo."""
    from gamms.demo import report

    out = console()
    first, second = sides
    graph = ctx.graph.columns()
    streets = float(graph.lengths.sum()) / 2000.0
    out.print(f"[bold]Capture the flag[/] in {map_name}, seed {played.seed}")
    out.print(f"{first.name} ({first.size} agents) against {second.name} ({second.size} agents)")
    out.print(f"{len(graph.node_ids):,} nodes, {streets:.0f} km of streets; {ctx.graph.attribution or ''}\n")
    for turn, sentence in report.story(ctx, played):
        out.print(f"  turn {turn:>4}  {sentence}")
    out.print(f"\n[bold]{report.headline(ctx, played)}[/]\n")
    header, *rows = report.table(ctx, played)
    out.print(rich_table(header, rows))
