"""All commands in the order of the help, and the commands that check scenario files and maps."""

import json
import os
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from io import TextIOWrapper
from itertools import chain, pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup

import gamms
from gamms.cli import experiments, play, recordings
from gamms.cli.gallery import gallery
from gamms.cli.new import new
from gamms.cli.output import (
    INTERRUPTED,
    echo,
    explain_error,
    guard_command,
    make_console,
    make_rich_table,
    warn,
    write_page,
)
from gamms.cli.studies import study
from gamms.errors import BadValue, nearest
from gamms.folders import write_whole
from gamms.text import make_printable_line

if TYPE_CHECKING:
    from gamms.osm import Report


def about(version: Annotated[bool, typer.Option("--version", help="Show the version and exit.")] = False) -> None:
    """Games between teams of agents on graphs and real road networks."""
    if version:
        echo(f"gamms {gamms.__version__}")
        echo("core: compiled" if gamms.core.is_compiled else "core: interpreted (the same games, slower)")
        raise typer.Exit


def check(
    file: play.ScenarioFile,
    build: Annotated[bool, typer.Option("--build", help="Also import the code it names, and build the game.")] = False,
    allow: play.Allow = None,
    key_variable: play.KeyVariable = None,
) -> None:
    """Check a scenario file, without running its code."""
    from gamms import scenario
    from gamms.scenario.documents import describe_path

    game = scenario.load(file, allow or (), key_variable=key_variable)
    done = game.check()
    warn(game)
    for one in game.code() if build else []:
        echo(f"imports {make_printable_line(f'{describe_path(one.path, game.to_dict())}: {one}')}")
    if build:
        game.build().terminate()
        done.append("the whole game, built once")
    echo(f"{file}: all is well. Checked: {'; '.join(done)}.")


def describe(
    file: play.ScenarioFile,
    format: Annotated[str, typer.Option("--format", help="odd: the ODD protocol.", metavar="FORMAT")] = "odd",
    out: Annotated[
        Path | None,
        typer.Option(help="A .md or .html file to write; by default Markdown is printed.", metavar="FILE"),
    ] = None,
    build: Annotated[
        bool, typer.Option("--build", help="Also load maps that code makes, or a server sends: this runs the code.")
    ] = False,
    allow: play.Allow = None,
    key_variable: play.KeyVariable = None,
) -> None:
    """Describe a scenario by the ODD protocol, for papers."""
    from gamms import scenario
    from gamms.scenario.describing import FORMATS, as_page

    if format not in FORMATS:
        raise BadValue(f"There is no format {format!r}.{nearest(format, FORMATS)} Formats are: {', '.join(FORMATS)}.")
    suffix = ".md" if out is None else out.suffix.lower()
    if suffix not in (".md", ".html"):
        raise BadValue(f"A description is a .md or .html file: give such a name instead of {str(out)!r}.")
    game = scenario.load(file, allow or (), key_variable=key_variable)
    text = game.describe(build=build)
    if out is None:
        echo(text.removesuffix("\n"))
        return
    if suffix == ".html":
        text = as_page(text, game.spec.name or file.name)
    write_whole(out, text.encode(), through_links=True)
    echo(f"Wrote {out}.")


def diff(
    first: play.ScenarioFile,
    second: Annotated[Path, typer.Argument(help="Another scenario.", metavar="SECOND", show_default=False)],
    allow: play.Allow = None,
) -> None:
    """Print where two scenario files differ; exit code 1 if so."""
    from gamms import scenario

    found = scenario.load(first, allow or ()).differences(scenario.load(second, allow or ()))
    for line in found:
        echo(make_printable_line(line))
    if found:
        raise typer.Exit(1)
    echo(f"{first} and {second} are the same scenario.")


def playthrough(
    file: play.ScenarioFile,
    turns: Annotated[int, typer.Option(min=0, help="The number of turns.", metavar="TURNS")] = 5,
    seed: Annotated[
        int | None,
        typer.Option(help="The same seed plays the same game; by default that of the file.", metavar="SEED"),
    ] = None,
    agents: Annotated[
        list[str] | None,
        typer.Option("--agent", help="Show only this agent; may be repeated. By default all.", metavar="AGENT"),
    ] = None,
    allow: play.Allow = None,
    key_variable: play.KeyVariable = None,
) -> None:
    """Print turns as text: what agents know, want and do."""
    from gamms import scenario, testing

    game = scenario.load(file, allow or (), key_variable=key_variable)
    for line in play.find_foreign_code(game, {}):
        echo(f"imports {make_printable_line(line)}", err=True)
    warn(game)
    with game.build(seed) as ctx:
        echo(testing.playthrough(ctx, turns, agents).removesuffix("\n"))


def schema() -> None:
    """Print the JSON Schema of scenario files, for editors."""
    from gamms import scenario

    echo(json.dumps(scenario.schema(), indent=2))


def map(
    file: Annotated[
        Path,
        typer.Argument(
            help="A map (OpenStreetMap, GeoJSON, .gamms) or a scenario.", metavar="FILE", show_default=False
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option(help="The page to write; by default FILE's name with .html.", metavar="PAGE", show_default=False),
    ] = None,
    browser: Annotated[bool, typer.Option("--open/--no-open", help="Whether to open it in the browser.")] = True,
    theme: Annotated[
        str | None, typer.Option(help="light or dark; by default as the browser is.", show_default=False)
    ] = None,
) -> None:
    """Write a page on which to choose places of a map."""
    import webbrowser

    from gamms.web import map_page

    page = Path(f"{file.name.partition('.')[0]}.html") if out is None else out
    write_page(page, map_page(file, theme=theme))
    if browser:
        webbrowser.open(page.absolute().as_uri())


def report(
    file: Annotated[Path, typer.Argument(help="An OpenStreetMap or GeoJSON file.", metavar="FILE", show_default=False)],
    resolution: Annotated[float, typer.Option(help="Metres between nodes.", metavar="METRES")] = 10.0,
    tolerance: Annotated[
        float | None,
        typer.Option(
            help="Metres; junctions within twice this become one. By default as the mode of travel says.",
            metavar="METRES",
            show_default=False,
        ),
    ] = None,
    network: Annotated[
        str, typer.Option(help="A mode of travel, or several with commas: leave out the roads that are closed to it.")
    ] = "all",
    retain_all: Annotated[bool, typer.Option("--retain-all", help="Take all parts, not only the largest.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Say how faithful the graph of a map is; exit code 1 if it is not."""
    found = _compute_fidelity(file, network, resolution=resolution, tolerance=tolerance, retain_all=retain_all)
    if as_json:
        echo(json.dumps(found.to_dict(), indent=2))
    else:
        make_console().print(make_rich_table(("fidelity", ""), found.rows(), right=False))
    if not found.is_faithful:
        raise typer.Exit(1)


def _compute_fidelity(
    file: Path, network: str, *, resolution: float, tolerance: float | None, retain_all: bool
) -> "Report":
    from gamms import osm

    kind: str | list[str] | None = network.split(",") if "," in network else network
    kind = None if network == "all" else kind
    options: dict[str, Any] = {"resolution": resolution, "retain_all": retain_all}
    if osm.is_geojson(file):
        graph = osm.graph_from_geojson(file, tolerance=tolerance or 0.0, **options)
    else:
        graph = osm.graph_from_file(file, osm_type=kind, tolerance=tolerance, **options)
    return osm.report(graph, file)


_Commands = Mapping[Callable[..., None], tuple[str, ...]]  # command -> examples, in the order of the help

_COMMANDS: _Commands = {
    play.demo: ("gamms demo", "gamms demo --seed 7 --teams cats=5,dogs=3 --map town.osm.pbf"),
    gallery: ("gamms gallery patrol --seed 7", "gamms gallery patrol --out played", "gamms gallery --page games"),
    new: ("gamms new hunt", "gamms new guards --from patrol"),
    play.run: (
        "gamms run match.yaml --seeds 0:50",
        "gamms run match.yaml --seed 7 --film match.mp4",
        "gamms run match.yaml --web --watch",
        "gamms run match.yaml --set teams.red.count=8 --strategy red=mine.py:strategy --out results",
    ),
    study: ("gamms study visit.yaml", "gamms study visit.yaml --otherwise mine.py:strategy --port 8000"),
    experiments.tournament: ("gamms tournament cup.yaml", "gamms tournament cup.yaml --out cup --workers 4"),
    recordings.replay: ("gamms replay game.ggr", "gamms replay game.ggr --window --seconds 0.2"),
    recordings.render: (
        "gamms render game.ggr game.mp4 --turns 100:200 --follow red_0",
        "gamms render game.ggr turn60.png --turns 60 --fog red",
    ),
    recordings.info: ("gamms info game.ggr", "gamms info game.ggr --json"),
    recordings.verify: ("gamms verify game.ggr",),
    recordings.diff: ("gamms diff before.ggr after.ggr",),
    recordings.convert: (
        "gamms convert game.ggr game.csv",
        "gamms convert game.ggr game.gpx",
        "gamms convert game.ggr game.jsonl",
        "gamms convert game.ggr red.ggr --team red",
        "gamms convert old.ggr new.ggr --map map.gamms",
    ),
    map: ("gamms map match.yaml", "gamms map town.osm.pbf --out town.html --no-open"),
    experiments.suite: ("gamms suite mine.py:strategy", "gamms suite random_walk --only pursuit --out walk"),
}
_ON_SCENARIOS: _Commands = {
    check: ("gamms scenario check match.yaml", "gamms scenario check match.yaml --build"),
    describe: (
        "gamms scenario describe match.yaml --format odd",
        "gamms scenario describe match.yaml --out match.html --build",
    ),
    diff: ("gamms scenario diff match.yaml other.yaml",),
    playthrough: (
        "gamms scenario playthrough match.yaml --turns 3",
        "gamms scenario playthrough match.yaml --agent red_0 > red_0.txt",
    ),
    schema: ("gamms scenario schema > schema.json",),
}
_EXPERIMENTS: _Commands = {
    experiments.run: (
        "gamms experiment hunts.yaml",
        "gamms experiment hunts.yaml --workers 8 --out results",
        "gamms experiment hunts.yaml --shard 3/20",
    ),
    experiments.merge: (
        "gamms experiment merge results",
        "gamms experiment merge results first/shard-1-of-2 second/shard-2-of-2",
    ),
    experiments.verify: (
        "gamms experiment verify results",
        "gamms experiment verify results --root DIGEST --sample 100 --seed 7",
    ),
    experiments.pack: ("gamms experiment pack results study.zip",),
    experiments.unpack: ("gamms experiment unpack study.zip restored",),
}
_ON_MAPS: _Commands = {report: ("gamms osm report town.osm.pbf --network walk",)}


class _Command(TyperCommand):
    """A command whose errors name the invalid value of an option, which typer leaves out."""

    def collect_usage_pieces(self, ctx: typer.Context) -> list[str]:  # type: ignore[override] # a click.Context
        return [piece.strip("{}") for piece in super().collect_usage_pieces(ctx)]

    def parse_args(self, ctx: typer.Context, args: list[str]) -> list[str]:  # type: ignore[override] # a click.Context
        words = list(chain.from_iterable(word.split("=", 1) if word.startswith("--") else [word] for word in args))
        try:
            return super().parse_args(ctx, args)
        except typer.BadParameter as error:
            names = getattr(error.param, "opts", ())
            value = next((repr(value) for name, value in pairwise(words) if name in names), "")
            if value and value not in error.message:
                error.message = f"{value}: {error.message}"
            raise


class _Interruptible(TyperGroup):
    """A group whose commands print a message when they are interrupted."""

    def make_context(self, *args: Any, **options: Any) -> Any:  # Any: of a library inside typer
        with _report_interrupt():
            return super().make_context(*args, **options)

    def invoke(self, ctx: typer.Context) -> Any:  # type: ignore[override] # a click.Context
        with _report_interrupt():
            return super().invoke(ctx)


@contextmanager
def _report_interrupt() -> Iterator[None]:
    try:
        yield
    except KeyboardInterrupt:
        echo("gamms: Interrupted.", err=True)
        raise typer.Exit(INTERRUPTED) from None


class _GroupWithDefault(TyperGroup):
    """A group whose first command is the default: `gamms experiment FILE`."""

    def parse_args(self, ctx: typer.Context, args: list[str]) -> list[str]:  # type: ignore[override] # a click.Context
        usual = next(iter(self.commands))
        if args and args[0] not in (*self.commands, "--help"):
            args = [usual, *args]
        return super().parse_args(ctx, args)


def _group(
    about: str, commands: _Commands, examples: tuple[str, ...] = (), kind: type[TyperGroup] = TyperGroup
) -> typer.Typer:
    """Return a group of commands; its help is plain text, so that flags appear as flags."""
    group = typer.Typer(
        cls=kind,
        help=about,
        epilog=_format_examples(examples),
        no_args_is_help=True,
        add_completion=False,
        pretty_exceptions_enable=False,
        rich_markup_mode=None,
        context_settings={"max_content_width": 100},
    )
    for command, usage in commands.items():
        group.command(cls=_Command, epilog=_format_examples(usage))(guard_command(command))
    return group


def _format_examples(examples: tuple[str, ...]) -> str | None:
    """Return examples as the end of a help text, one per line."""
    return "\n".join(("\b", "Examples:", *(f"  {example}" for example in examples))) if examples else None


app = _group(
    about.__doc__ or "",
    _COMMANDS,
    ("gamms demo", "gamms new hunt", "gamms run hunt/hunt.yaml --window"),
    kind=_Interruptible,
)
app.callback(invoke_without_command=True)(about)
app.add_typer(_group("Look at scenario files.", _ON_SCENARIOS), name="scenario")
app.add_typer(_group("Look at maps.", _ON_MAPS), name="osm")
app.add_typer(
    _group("Play a scenario and its variants with many seeds.", _EXPERIMENTS, kind=_GroupWithDefault), name="experiment"
)


def run() -> None:
    """Run the command named by the arguments of the process."""
    out: object = sys.stdout  # None if it is closed
    if isinstance(out, TextIOWrapper):
        out.reconfigure(errors="backslashreplace")  # for characters that the encoding of the system lacks
    try:
        try:
            app()
        finally:
            if isinstance(out, TextIOWrapper) and out is sys.stdout:  # not if a reader such as `head` has closed it
                out.flush()
    except OSError as error:  # the output is full
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # or Python would report it again at its end
        before = error.__context__
        sys.exit(before.code if isinstance(before, SystemExit) and before.code else explain_error(error))
