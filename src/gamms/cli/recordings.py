"""The commands that take a recording: info, verify, diff, convert, replay, render."""

import json
from collections import Counter
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer
from rich.markup import escape

from gamms.cli.output import echo, join_names, make_console, make_rich_table, write_page
from gamms.errors import BadValue
from gamms.progress import show_progress
from gamms.text import as_text, make_printable_line, shown

if TYPE_CHECKING:
    from gamms.context import Context
    from gamms.recorder import Recording

_LONG = 64  # bits

_File = Annotated[Path, typer.Argument(help="A recording, .ggr.", metavar="FILE", show_default=False)]
_Map = Annotated[
    Path | None,
    typer.Option(
        "--map",
        help="The map, .gamms, of tracks, or of a recording that holds none; for version 2, nodes are made up at "
        "(0, 0) without it.",
        metavar="FILE",
    ),
]


def info(file: _File, as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False) -> None:
    """Show the contents of a recording."""
    from gamms import plain, recordings

    version = recordings.version_of(file)
    found: dict[str, Any] = {"file": file.name, "version": version, "bytes": file.stat().st_size}
    found |= _describe_version_2(file) if version < 3 else _describe_version_3(file)
    if as_json:
        echo(json.dumps(plain.as_json(found), indent=2, default=str))
        return
    rows = [(key, _format_value(value)) for key, value in found.items() if key != "events"]
    rows += [(f"event {kind}", f"{count:,}") for kind, count in found["events"].items()]
    make_console().print(
        make_rich_table(("recording", ""), [(escape(key), escape(text)) for key, text in rows], right=False)
    )


def verify(file: _File, map: _Map = None) -> None:
    """Check a recording, and that its replay records the same."""
    from gamms import recordings

    recordings.verify(file, map)
    echo(f"{file}: all is well. Checked: every block, the index, the keyframes, and that a replay records the same.")


def diff(
    first: Annotated[Path, typer.Argument(help="A recording, .ggr.", metavar="FIRST", show_default=False)],
    second: Annotated[Path, typer.Argument(help="Another one.", metavar="SECOND", show_default=False)],
    html: Annotated[
        Path | None, typer.Option(help="Write a page that replays both side by side.", metavar="FILE")
    ] = None,
) -> None:
    """Print where two games differ; exit code 1 if so."""
    from gamms import recorder, recordings

    with recorder.open(first) as one, recorder.open(second) as other:
        turns = one.turns
        found = recordings.first_difference(one, other)
        for path, recording in ((first, one), (second, other)):
            if recording.warning is not None:
                echo(f"gamms: {path}: {recording.warning}", err=True)
        if html is not None:
            from gamms.web import page_of_two

            write_page(html, page_of_two(one, other, names=(first.stem, second.stem)))
    if found is not None:
        echo(str(found))
        raise typer.Exit(1)
    echo(f"{first} and {second} are the same game of {turns} turns.")


def convert(
    file: Annotated[
        Path, typer.Argument(help="A recording, .ggr, a map, .gamms, or tracks.", metavar="FILE", show_default=False)
    ],
    out: Annotated[
        Path,
        typer.Argument(
            help="What is written: tables, NAME_moves.csv and others for NAME.csv; .gpx or .geojson for the tracks of "
            "agents; .jsonl for all events; .ggr from a recording of version 2.",
            metavar="OUT",
            show_default=False,
        ),
    ],
    map: _Map = None,
    turn_seconds: Annotated[float, typer.Option(help="How long a turn takes, for times of tracks.", min=0.0)] = 1.0,
    team: Annotated[
        str | None, typer.Option(help="Only what this team knew; OUT is a .ggr.", metavar="NAME", show_default=False)
    ] = None,
) -> None:
    """Make tables, tracks, JSON, or one team's part of a recording.

    A map, .gamms, becomes .geojson, .gpkg, .graphml, .csv, .osmnx.graphml (for OSMnx) or .net.xml (for SUMO). Tracks,
    .gpx or .csv, become a recording on a --map.
    """
    from gamms.recordings.conversion import make_context_with_map

    if file.suffix.lower() in (".gpx", ".csv"):
        _record_tracks(file, out, map, turn_seconds)
        return
    if file.suffix.lower() == ".gamms":
        with make_context_with_map(file) as ctx:
            echo(f"Wrote {join_names(ctx.graph.export(out))}.")
        return
    made, warning = _convert_file(file, out, map, turn_seconds) if team is None else _cut(file, out, team)
    echo(f"Wrote {join_names(made) if made else 'nothing: there are no rows'}.")
    if warning:
        echo(f"gamms: {warning} Everything before was converted.", err=True)
        raise typer.Exit(1)


def _convert_file(file: Path, out: Path, map: Path | None, turn_seconds: float) -> tuple[list[Path], str | None]:
    """Convert a recording; return the written files, and a warning if the recording is incomplete."""
    from gamms import recorder, recordings

    is_old = recordings.version_of(file) < 3
    form = out.suffix.lower()
    if is_old and form in (".jsonl", ".csv", ".gpx", ".geojson"):
        raise BadValue(f"{str(file)!r} has format version 2: convert it to a .ggr of version 3 first, then to {form}.")
    if map is not None and not is_old:
        raise BadValue("--map is only for recordings of version 2: later ones contain their map.")
    if form == ".csv":
        return recordings.to_csv(file, out, turn_seconds=turn_seconds)
    if form == ".jsonl":
        return [out], recordings.to_json_lines(file, out)
    if form in (".gpx", ".geojson"):
        if out.exists():
            raise FileExistsError(f"The file {str(out)!r} already exists; choose another name or delete it first.")
        with recorder.open(file) as recording:
            recording.export(out, turn_seconds=turn_seconds)
            return [out], recording.warning
    return [out if form == ".ggr" else Path(f"{out}.ggr")], recordings.to_version_3(file, out, map)


def _cut(file: Path, out: Path, team: str) -> tuple[list[Path], str | None]:
    """Write a team's view of a recording; return the path, and a warning if the recording is incomplete."""
    from gamms import recorder, recordings

    if out.suffix.lower() not in (".ggr", ""):
        raise BadValue(f"--team writes a recording: give a .ggr instead of {str(out)!r}, then convert it.")
    with recorder.open(file) as recording:
        recordings.with_sensed(recording).cut(out, team)
        return [out if out.suffix else Path(f"{out}.ggr")], recording.warning


def _record_tracks(file: Path, out: Path, map: Path | None, turn_seconds: float) -> None:
    """Make a recording from tracks, and print how well they match the roads."""
    from gamms.bridge import recording_from_tracks

    if map is None:
        raise BadValue(f"The tracks in {str(file)!r} are matched to the roads of a map: give --map FILE.gamms.")
    for found in recording_from_tracks([file], map, out, turn_seconds=turn_seconds):
        parts = "" if found.parts == 1 else f" in {found.parts} parts"
        echo(
            f"{make_printable_line(found.agent)}: {found.points} points{parts}, on average {found.off_m:.1f} m "
            f"from their roads; outliers: {found.off_road}."
        )
    echo(f"Wrote {out if out.suffix == '.ggr' else f'{out}.ggr'}.")


def replay(  # noqa: PLR0913, PLR0917 - one argument per option
    file: _File,
    map: _Map = None,
    window: Annotated[bool, typer.Option("--window", help="Show it in a window, which stays open at the end.")] = False,
    seconds: Annotated[float, typer.Option(help="How long a turn is shown.", min=0.0)] = 0.5,
    start: Annotated[int, typer.Option("--from", help="Begin after this turn.", metavar="TURN", min=0)] = 0,
    theme: Annotated[str, typer.Option(help="Of the window: light or dark.", metavar="THEME")] = "light",
    labels: Annotated[
        bool | None,
        typer.Option("--labels/--no-labels", help="Names beside agents in the window; by default while they are few."),
    ] = None,
    trails: Annotated[int, typer.Option(help="Show the ways of the last turns in the window.", min=0)] = 0,
    captions: Annotated[
        bool, typer.Option("--captions/--no-captions", help="Say in the window what happens, such as tags.")
    ] = True,
) -> None:
    """Replay a recording, in a window or not, and say how it ended.

    For a page that replays it in browsers: `gamms render FILE game.html`.
    """
    from gamms import recordings, visual
    from gamms.recorder import RecordingError

    warning = None
    look = {"theme": theme, "labels": "auto" if labels is None else labels, "trails": trails, "captions": captions}
    usual = {"theme": "light", "labels": "auto", "trails": 0, "captions": True}
    if not window and look != usual:
        option = next(name for name, value in usual.items() if look[name] != value)
        hint = f"--{'no-' if look[option] is False else ''}{option}"
        raise typer.BadParameter("this option needs --window.", param_hint=hint)
    ctx = recordings.context_for(
        file, map, visual.Engine.PYGAME if window else visual.Engine.NO_VIS, **(look if window else {})
    )
    ctx.visual.turn_seconds = seconds
    turns: list[None] = []
    ctx.visual.after_turn.append(lambda: turns.append(None))
    with ctx:
        try:
            for _ in ctx.record.replay(file, start=start):
                pass
        except RecordingError as error:
            if not turns:
                raise
            warning = str(error)
        playback = getattr(ctx.visual, "playback", None)  # a person may have shown any turn with it
        if ctx.is_terminated():
            overlay: Any = getattr(ctx.visual, "overlay", None)
            make_console().print(f"[bold]{escape(file.name)}[/]: closed at turn {overlay.turns}")
            return
        _print_agents(ctx, file, start + len(turns) if playback is None else playback.turn)
        if window:
            ctx.visual.stay_open()
    _refuse_unfinished(warning or _find_missing(file))


def render(  # noqa: PLR0913, PLR0917 - one argument per option
    file: Annotated[Path, typer.Argument(help="A recording, .ggr.", metavar="FILE", show_default=False)],
    out: Annotated[
        Path,
        typer.Argument(
            help="What is written: .html, .mp4, .gif, .png, .svg or .pdf.", metavar="OUT", show_default=False
        ),
    ],
    turns: Annotated[
        str, typer.Option(help="Turns to film, 100:200, 100: or :200; a picture shows the last one.", metavar="FROM:TO")
    ] = ":",
    follow: Annotated[
        str | None,
        typer.Option(help="Keep this agent in the middle; auto: the one that most happens to.", metavar="AGENT"),
    ] = None,
    view: Annotated[
        float | None,
        typer.Option(help="With --follow: how much is seen, in metres (map units); by default 400, or 30 edges."),
    ] = None,
    fog: Annotated[str | None, typer.Option(help="Show only what this team's sensors see.", metavar="TEAM")] = None,
    width: Annotated[int | None, typer.Option(help="Pixels; by default as the map needs.")] = None,
    height: Annotated[int | None, typer.Option(help="Pixels; by default as the map needs.")] = None,
    tight: Annotated[
        bool, typer.Option("--tight", help="Make it smaller than that, as tight as the map allows.")
    ] = False,
    scale_bar: Annotated[
        bool | None, typer.Option("--scale-bar/--no-scale-bar", help="By default where the map is in metres.")
    ] = None,
    north: Annotated[bool, typer.Option("--north", help="Show where north is.")] = False,
    captions: Annotated[
        bool, typer.Option("--captions/--no-captions", help="Say below the map which turn it is, and what happens.")
    ] = True,
    fps: Annotated[float, typer.Option(help="Frames per second.")] = 30.0,
    frames_per_turn: Annotated[
        int | None, typer.Option(help="More of them show a turn more slowly; by default 5.")
    ] = None,
    title: Annotated[str, typer.Option(help="A line above the picture.")] = "",
    theme: Annotated[
        Literal["light", "dark", "print"] | None,
        typer.Option(help="Its colors; by default light, and dark with --fog."),
    ] = None,
    labels: Annotated[
        bool | None, typer.Option("--labels/--no-labels", help="Names beside agents; by default while they are few.")
    ] = None,
    trails: Annotated[int, typer.Option(help="Of how many turns the ways of agents are shown.")] = 0,
    sensors: Annotated[
        bool, typer.Option("--sensors/--no-sensors", help="What sensors see; in a page, if the recording has it.")
    ] = True,
    map: Annotated[
        Path | None, typer.Option("--map", help="The map of a recording of version 2, .gamms.", metavar="FILE")
    ] = None,
) -> None:
    """Make a film, a picture or a page for browsers of a recording."""
    first, last = _parse_turns(turns)
    with show_progress() as show:
        from gamms import rendering

        options = rendering.RenderOptions(
            first,
            last,
            follow,
            view,
            fog,
            width,
            height,
            fps,
            frames_per_turn,
            title,
            "tight" if tight else "page",
            scale_bar=scale_bar,
            north=north,
            captions=captions,
            theme=theme,
            labels="auto" if labels is None else labels,
            trails=trails,
            sensors=sensors,
        )
        try:
            shown = rendering.render(file, out, options, map=map, show=show)
        except KeyboardInterrupt:
            echo(f"{out} is unchanged: its earlier file is still there." if out.exists() else f"{out} was not written.")
            raise
    is_film = out.suffix.lower() in (".mp4", ".gif", ".html")
    echo(f"Wrote {out} ({f'{shown} turns' if is_film else f'after turn {shown}'}).")
    _refuse_unfinished(_find_missing(file))


def _find_missing(file: Path) -> str | None:
    """Return what an unfinished recording of version 3 lacks; None if it is complete, or older."""
    from gamms import recorder, recordings

    if recordings.version_of(file) < 3:
        return None
    with recorder.open(file) as recording:
        return recording.warning


def _refuse_unfinished(warning: str | None) -> None:
    """Print what a recording lacks, and exit with code 1; None: it is complete."""
    if warning is not None:
        echo(f"gamms: {warning}", err=True)
        raise typer.Exit(1)


def _describe_version_3(file: Path) -> dict[str, Any]:
    from gamms import recorder

    with recorder.open(file) as recording:
        first = recording[0]
        last = recording[-1]
        names = set(chain.from_iterable(state.agents["name"].tolist() for state in (first, last)))
        return {
            "complete": "yes" if recording.is_complete else recording.warning,
            "made by": f"gamms {as_text(recording.header.get('package'))}",
            "created": recording.header.get("created"),
            "provenance": recording.header.get("provenance"),
            "seed": recording.seed,
            "turns": recording.turns,
            "agents": len(names),
            **_describe_map(recording),
            "moves": recording.count_moves(),
            "events": {**recording.counts(), **_count_game_events(recording)},
        }


def _describe_map(recording: "Recording") -> dict[str, Any]:
    """Return the size of the map; if it is not in the file, its SHA-256."""
    if "world_sha256" in recording.header:
        return {"map": f"not in the file; its SHA-256 is {as_text(recording.header['world_sha256'])}"}
    columns = recording.graph.columns()
    return {"nodes": len(columns.node_ids), "edges": len(columns.edge_ids)}


def _count_game_events(recording: "Recording") -> dict[str, int]:
    """Count the events of rules and programs by kind."""
    return dict(sorted(Counter(event["kind"] for event in recording.events()).items()))


def _describe_version_2(file: Path) -> dict[str, Any]:
    from gamms import recordings
    from gamms.recorder import RecordingError
    from gamms.recorder.tables import KINDS

    counts: Counter[str] = Counter()
    complete = "yes"
    try:
        for record in recordings.records_of(file):
            counts[KINDS[record["opCode"]]] += 1
    except RecordingError as error:
        complete = str(error)
    events = {kind: counts[kind] for kind in sorted(counts) if kind != "TERMINATE"}
    return {
        "complete": complete,
        "turns": counts["SIMULATE"],
        "agents": counts["AGENT_CREATE"] - counts["AGENT_DELETE"],
        "events": events,
    }


def _format_value(value: object) -> str:
    if value is None:
        return "-"
    if type(value) is int:
        return f"{value:,}" if value.bit_length() <= _LONG else shown(value)
    return as_text(value)


def _score(score: object) -> str:
    try:
        return format(score, "g")
    except (OverflowError, TypeError, ValueError):  # rules may write any value as a score
        return _format_value(score)


def _print_agents(ctx: "Context", file: Path, turns: int) -> None:
    """Print the final position of each agent."""
    out = make_console()
    out.print(f"[bold]{escape(file.name)}[/]: {turns} turns\n")
    rows = []
    for agent in ctx.agent.create_iter():
        position = getattr(agent, "position", None)  # of aerial agents
        place = str(agent.current_node_id) if position is None else ", ".join(f"{part:.6g}" for part in position)
        team = _format_value(agent.team)
        rows.append(tuple(map(escape, (agent.name, team, "yes" if agent.alive else "no", place))))
    out.print(make_rich_table(("agent", "team", "alive", "at"), rows, right=False))
    if ctx.game.scores:
        out.print()
        scores = [(escape(_format_value(of)), escape(_score(score))) for of, score in ctx.game.scores.items()]
        out.print(make_rich_table(("", "score"), scores))


def _parse_turns(text: str) -> tuple[int | None, int | None]:
    """Return the first and last turn of `100:200`, `100:`, `:200`, or `100` for that turn alone."""
    first, colon, last = text.partition(":")
    try:
        begin, end = (int(part) if part.strip() else None for part in (first, last if colon else first))
    except ValueError:
        raise typer.BadParameter(f"{text!r}: give 100:200, 100:, :200 or 100.", param_hint="--turns") from None
    return (None if begin == 0 else begin), end
