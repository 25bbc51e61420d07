"""Create contexts for recordings, and convert recordings to version 3, JSON lines and CSV tables."""

import json
import os
import re
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from io import BytesIO
from itertools import chain, islice
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Literal

from gamms.arguments import as_path
from gamms.context import Context, create_context
from gamms.errors import BadValue
from gamms.folders import open_whole_file, write_csv
from gamms.ir import events as kinds
from gamms.knowledge.looks import ReportWriter
from gamms.plain import Plain, as_json, to_plain
from gamms.recorder import Reader, Recording, RecordingError, Writer
from gamms.recorder import open as opened
from gamms.recorder.formats import version2
from gamms.recorder.maps import HASH
from gamms.recorder.replaying import Replayer
from gamms.recorder.streams import make_path, open_readable, read_format
from gamms.recorder.tracks import check_seconds
from gamms.typing.actions import check_node
from gamms.visual import Engine

_PROVENANCE = {"converted": "from a recording of version 2"}
_Record = dict[str, Any]
_ESCAPED = "backslashreplace"  # lone surrogates, as escaped in JSON
_QUIET = {"level": "CRITICAL"}  # what a recording cannot say, such as the sensors of version 2, is no news
_NODES = {kinds.AGENT_CURRENT_NODE, kinds.AGENT_PREV_NODE}


def version_of(path: str | os.PathLike[str]) -> int:
    """Return the format version of a recording.

    Raises:
        RecordingError (ValueError): it is not a recording.
        OSError: it cannot be read.
    """
    stream, _ = open_readable(as_path(path, "The path of a recording"))
    with stream:
        return read_format(stream)


@contextmanager
def open_as_version_3(path: str | os.PathLike[str], map: str | os.PathLike[str] | None = None) -> Iterator[Recording]:
    """Open a recording of any version for a `with` block; version 2 is converted to a temporary file.

    Args:
        path: the file of the recording.
        map: see `context_for`.

    Raises:
        RecordingError (ValueError): the recording is damaged, or an unfinished one of version 2.
        OSError: a file cannot be read.
    """
    with ExitStack() as made:
        if version_of(path) < 3:
            folder = made.enter_context(TemporaryDirectory())
            converted = Path(folder) / "converted.ggr"
            flaw = to_version_3(path, converted, map)
            if flaw is not None:
                raise RecordingError(flaw)
            path = converted
        yield made.enter_context(opened(path, graph=map))


def context_for(
    path: str | os.PathLike[str],
    map: str | os.PathLike[str] | None = None,
    vis_engine: Engine = Engine.NO_VIS,
    **vis_kwargs: object,
) -> Context:
    """Create a context to replay a recording of any version in.

    Args:
        path: the file of the recording.
        map: a file written by `ctx.graph.save`; None: the recorded map, or for version 2, which stores no map, one node
            at (0, 0) for each node id.
        vis_engine: see `create_context`.
        vis_kwargs: see `create_context`.

    Raises:
        BadFile, RecordingError (ValueError): the beginning of a file is damaged.
        OSError: a file cannot be read.
    """
    version = version_of(path)
    if vis_engine is Engine.PYGAME and version > 2:
        with opened(path) as recording:
            vis_kwargs.setdefault("title", recording.title)
    if version > 2 or map is not None:
        return make_context_with_map(map, vis_engine, **vis_kwargs)
    ids = sorted(set(_read_node_ids(path)))
    return _make_filled_context(
        vis_engine, vis_kwargs, lambda ctx: ctx.graph.add_nodes(ids, x=[0.0] * len(ids), y=[0.0] * len(ids))
    )


def watch(
    path: str | os.PathLike[str],
    map: str | os.PathLike[str] | None = None,
    *,
    start: int = 0,
    seconds: float = 0.5,
    theme: str = "light",
    labels: bool | Literal["auto"] = "auto",
    trails: int = 0,
    captions: bool = True,
) -> None:
    """Replay a recording in a window, until the window is closed.

    Args:
        path: the file of the recording.
        map: see `context_for`.
        start: the number of turns to skip.
        seconds: the display time of a turn.
        theme: "light" or "dark".
        labels: whether to show the names of agents; "auto": while they are few.
        trails: the number of turns for which paths of agents are shown.
        captions: whether to show captions of events.

    Raises:
        BadFile, RecordingError (ValueError): a file is damaged.
        BadValue (ValueError): the turn or the theme does not exist.
        NoDisplay (RuntimeError): there is no display for a window.
        OSError: a file cannot be read.
    """
    look = {"theme": theme, "labels": labels, "trails": trails, "captions": captions}
    with context_for(path, map, Engine.PYGAME, simulation_time_constant=seconds, **look) as ctx:
        for _ in ctx.record.replay(path, start=start):
            pass
        ctx.visual.stay_open()


def make_context_with_map(
    map: str | os.PathLike[str] | None, vis_engine: Engine = Engine.NO_VIS, **vis_kwargs: object
) -> Context:
    """Create a context with a map written by `ctx.graph.save`; None: without a map.

    Raises:
        BadFile (ValueError): the file is damaged.
        OSError: it cannot be read.
    """
    return _make_filled_context(vis_engine, vis_kwargs, lambda ctx: None if map is None else ctx.graph.load(map))


def _make_filled_context(
    vis_engine: Engine, vis_kwargs: dict[str, object], fill: Callable[[Context], object]
) -> Context:
    """Create a context that logs nothing, and fill it."""
    ctx = create_context(seed=0, logger_config=_QUIET, vis_engine=vis_engine, vis_kwargs=vis_kwargs)
    try:
        fill(ctx)
    except BaseException:
        ctx.terminate()
        raise
    return ctx


def records_of(path: str | os.PathLike[str]) -> Iterator[dict[str, Any]]:
    """Yield the records of a recording of version 2.

    Raises:
        RecordingError (ValueError): the recording is damaged or truncated; all records before the error were yielded.
    """
    with as_path(path, "The path of a recording").open("rb") as file:
        yield from version2.read(file)


def _read_node_ids(path: str | os.PathLike[str]) -> Iterator[int]:
    """Yield the node ids in a recording of version 2, as far as it is whole."""
    is_begun = False
    try:
        for record in records_of(path):
            is_begun = True
            data = record.get("data") or {}
            found = data.get("node_id") if record["opCode"] in _NODES else None
            if record["opCode"] == kinds.AGENT_CREATE and isinstance(data["kwargs"], dict):
                found = data["kwargs"].get("start_node_id")
            if type(found) is int and -(1 << 63) <= found < 1 << 63:
                yield found
    except RecordingError:
        if not is_begun:
            raise


# -- version 3 --------------------------------------------------------------------------------------------------


def to_version_3(
    path: str | os.PathLike[str], out: str | os.PathLike[str], map: str | os.PathLike[str] | None = None
) -> str | None:
    """Convert a recording of version 2 to version 3.

    Args:
        path: the file of the recording.
        out: the file of the new recording.
        map: see `context_for`.

    Returns:
        A message about the rest that was not converted, because the recording is damaged or unfinished or contradicts
        the map; None if everything was converted.

    Raises:
        BadValue: the recording has another version.
        RecordingError (ValueError): the recording is empty.
        FileExistsError: there is a file at `out`.
        OSError: one of the files cannot be read or written.
    """
    version = version_of(path)
    if version > 2:
        raise BadValue(
            f"{str(path)!r} is a recording of version {version}, which is not written as {str(out)!r}: give an OUT "
            "that ends in .csv for its tables, .gpx or .geojson for tracks of agents, or .jsonl for all events."
        )
    with context_for(path, map) as ctx:
        ctx.record.start(out, provenance=_PROVENANCE)
        try:
            _replay(ctx, records_of(path))
        except RecordingError as error:
            return str(error)
        except BaseException:
            ctx.record.stop()
            make_path(out).unlink()
            raise
        finally:
            ctx.record.close()
    return None


def _replay(ctx: Context, records: Iterator[_Record]) -> None:
    """Apply and record the records of a recording; two records of one move become one event."""
    replayer = Replayer(ctx, is_version_2=True)
    waiting: _Record | None = None
    for record in chain(records, [{"opCode": kinds.TERMINATE}]):
        kind = record["opCode"]
        data = to_plain(record.get("data"))
        if waiting is not None:
            if _is_move(ctx, waiting, record):
                block = ctx.agent.block
                block.move(block.find_row(data["agent_name"]), check_node(ctx.graph.graph, block, data["node_id"]))
                waiting = None
                continue
            replayer.apply(waiting["opCode"], waiting["data"])
            waiting = None
        if kind == kinds.AGENT_PREV_NODE:
            waiting = record
        elif kind != kinds.TERMINATE:
            replayer.apply(kind, data)


def _is_move(ctx: Context, before: _Record, after: _Record) -> bool:
    """Return whether two records are a move of an agent on the ground from its node."""
    if after["opCode"] != kinds.AGENT_CURRENT_NODE:
        return False
    name = after["data"]["agent_name"]
    there = after["data"]["node_id"]
    agent = ctx.agent.agents.get(name) if isinstance(name, str) else None
    return (
        agent is not None
        and not agent.type
        and before["data"] == {"agent_name": name, "node_id": agent.current_node_id}
        and type(there) is int
        and ctx.graph.graph.has_node(there)
    )


# -- lines of JSON ----------------------------------------------------------------------------------------------


def to_json_lines(path: str | os.PathLike[str], out: str | os.PathLike[str]) -> str | None:
    """Write a recording of version 3 as JSON lines: the header, the first state, then one line for each event.

    Bytes are in base64; NaN is null. Only the size of the map is written. Lone surrogates are escaped.

    Returns:
        A message about the missing end of an unfinished recording; None if it is complete.

    Raises:
        RecordingError (ValueError): the recording is damaged; no file is written.
        FileExistsError: there is a file at `out`.
        OSError: one of the files cannot be read or written.
    """
    target = as_path(out, "out")
    if target.exists():
        raise FileExistsError(f"There is a file {str(out)!r} already; choose another name or delete it first.")
    with opened(path) as recording, open_whole_file(target, through_links=True) as beside:
        with beside.open("w", encoding="utf-8", errors=_ESCAPED) as file:
            lines = (json.dumps(as_json(line), ensure_ascii=False, allow_nan=False) for line in _list_lines(recording))
            file.writelines(f"{line}\n" for line in lines)
        return recording.warning


def _list_lines(recording: Recording) -> Iterator[_Record]:
    size: dict[str, Plain] = {"sha256": recording.map_hash(0)}
    if HASH not in recording.header:
        columns = recording.graph.columns()
        size = {"nodes": len(columns.node_ids), "edges": len(columns.edge_ids), "crs": columns.crs}
    yield {"event": "HEADER", **recording.header, "turns": recording.turns, "map": size}
    start = recording[0]
    names = list(start.agents)
    rows = zip(*(column.tolist() for column in start.agents.values()), strict=True)
    agents = [dict(zip(names, row, strict=True)) for row in rows]
    yield {"turn": 0, "event": "START", "agents": agents, "scores": start.scores, "data": start.data}
    yield from recording.steps()


# -- tables -----------------------------------------------------------------------------------------------------

_TABLES = ("moves", "positions", "scores", "events", "deeds", "messages", "sensed")
_MOST_KINDS = 100  # kinds of events with a separate file
_FILE_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_-]{0,63}")


def to_csv(
    path: str | os.PathLike[str], out: str | os.PathLike[str], *, turn_seconds: float = 1.0
) -> tuple[list[Path], str | None]:
    """Write the nonempty tables of a recording of version 3, and the tracks of its agents, as CSV files.

    `game.csv` gives `game_moves.csv`, `game_scores.csv`, and so on, with one file for each of the first hundred kinds
    of events whose name can be part of a file's name. Values other than numbers and texts are written as JSON.
    `game_tracks.csv`, the positions of agents after each turn, and `game_sensed.csv` need a recording with its map.

    Args:
        path: the file of the recording.
        out: the path from which the names of the files are derived.
        turn_seconds: the duration of a turn, for the times in tracks.

    Returns:
        The files, and a message about the missing end of an unfinished recording.

    Raises:
        RecordingError (ValueError): it is damaged.
        FileExistsError: a file exists; no file is written.
        BadValue: `turn_seconds` is negative or too long; no file is written.
        OSError: a file cannot be read or written.
    """
    target = as_path(out, "out")
    with opened(path) as recording:
        seconds = check_seconds(turn_seconds, recording.turns)
        kinds_of_events = dict.fromkeys(event["kind"] for event in recording.events())
        has_map = HASH not in recording.header
        known = _TABLES if has_map else [name for name in _TABLES if name != "sensed"]
        names = dict.fromkeys((*known, *islice(filter(_FILE_NAME.fullmatch, kinds_of_events), _MOST_KINDS)))
        tables = {name: table for name in names if len((table := recording.table(name))["turn"])}
        with_tracks = ["tracks"] if has_map and "tracks" not in tables else []
        files = {name: target.with_name(f"{target.stem}_{name}.csv") for name in [*tables, *with_tracks]}
        for file in files.values():
            if file.exists():
                raise FileExistsError(f"There is a file {str(file)!r} already; choose another name or delete it first.")
        with ExitStack() as all_or_none:
            for name, table in tables.items():
                beside = all_or_none.enter_context(open_whole_file(files[name], through_links=True))
                columns = [[_make_cell(value) for value in column.tolist()] for column in table.values()]
                write_csv(beside, table, zip(*columns, strict=True))
            for name in with_tracks:
                recording.export(files[name], turn_seconds=seconds)
        return list(files.values()), recording.warning


def _make_cell(value: Plain) -> str | int | float | bool | None:
    """Return a value as a cell of a CSV file."""
    plain = as_json(value)
    return plain if plain is None or isinstance(plain, (str, int, float, bool)) else json.dumps(plain)


def with_sensed(recording: Recording) -> Recording:
    """Return a recording that contains the sensor reports of each turn: the same recording if it has any already.

    Otherwise the sensors sense again in a replay. Sensors with errors or delay draw other errors than in the game, and
    function sensors report nothing.

    Raises:
        RecordingError (ValueError): the recording is damaged, or lacks its map.
    """
    if recording.counts().get("SENSED"):
        return recording
    stream = BytesIO()
    reader = Reader(BytesIO(recording.content()))
    first = reader.keyframe(0)
    if first is None:
        raise RecordingError("This recording does not say how it begins.")
    writer = Writer(stream, reader.header, seconds=None)
    writer.keyframe(first[1])
    with make_context_with_map(None) as ctx:
        ctx.graph.storage.unpack(recording.graph.packed)
        replayer = Replayer(ctx)
        replayer.begin(reader)
        reports = ReportWriter(ctx)
        for turn in range(reader.turns):
            reports.follow_map()
            columns = recording.detached(min(turn, recording.turns)).agents.columns
            number_of = dict(zip(columns["names"], columns["numbers"].tolist(), strict=True))
            numbers = [number_of[name] for name in ctx.agent.block.names]
            agents = [agent for agent in ctx.agent.create_iter() if agent.alive]
            looked = reports.write(agents, [agent.get_state() for agent in agents], numbers, turn)
            writer.add_turn([(kinds.SENSED, looked), *reader.log(turn)])
            for _ in replayer.play_turn(reader):
                pass
    writer.end_block()
    if reader.is_complete:
        writer.close()
    return opened(BytesIO(stream.getvalue()))
