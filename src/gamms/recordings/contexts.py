"""Contexts to replay a recording in, when there is nothing but the recording."""

import os
from collections.abc import Callable, Iterator
from typing import Any

from gamms.arguments import as_path
from gamms.context import Context, create_context
from gamms.ir import events as kinds
from gamms.recorder import RecordingError
from gamms.recorder.formats import version2
from gamms.recorder.streams import format_of, refuse_other
from gamms.visual import Engine

_QUIET = {"level": "CRITICAL"}  # what a recording cannot say, such as the sensors of version 2, is no news
_NODES = {kinds.AGENT_CURRENT_NODE, kinds.AGENT_PREV_NODE}


def version_of(path: str | os.PathLike[str]) -> int:
    """Return the format version of a recording.

    Raises:
        RecordingError (ValueError): it is not a recording.
        OSError: it cannot be read.
    """
    given = as_path(path, "The path of a recording")
    refuse_other(given)
    with given.open("rb") as file:
        version = format_of(file)
    if version < 0:
        raise RecordingError(f"{str(path)!r} is no recording: it does not begin with 'MMGR' and a version.")
    return version


def context_for(
    path: str | os.PathLike[str], map: str | os.PathLike[str] | None = None, vis_engine: Engine = Engine.NO_VIS
) -> Context:
    """Create a context to replay a recording of any version in.

    Args:
        path: of the recording.
        map: see `with_map`; for a recording of version 2 `with_nodes_made_up`.
        vis_engine: see `create_context`.

    Raises:
        BadFile, RecordingError (ValueError): a file is damaged at its beginning.
        OSError: one cannot be read.
    """
    return with_nodes_made_up(path, map, vis_engine) if version_of(path) < 3 else with_map(map, vis_engine)


def with_map(map: str | os.PathLike[str] | None, vis_engine: Engine = Engine.NO_VIS) -> Context:
    """Create a context with the map in a file that `ctx.graph.save` wrote; None: without one.

    Raises:
        BadFile (ValueError): the file is damaged.
        OSError: it cannot be read.
    """
    return _filled(vis_engine, lambda ctx: None if map is None else ctx.graph.load(map))


def with_nodes_made_up(
    path: str | os.PathLike[str], map: str | os.PathLike[str] | None = None, vis_engine: Engine = Engine.NO_VIS
) -> Context:
    """Create a context for a recording of version 2, which has no map.

    Args:
        path: of the recording.
        map: a file that `ctx.graph.save` wrote; None makes up a node at (0, 0) for each node id in the recording.
        vis_engine: see `create_context`.

    Raises:
        BadFile, RecordingError (ValueError): a file is damaged at its beginning.
        OSError: one cannot be read.
    """
    if map is not None:
        return with_map(map, vis_engine)
    ids = sorted(set(_node_ids(path)))
    return _filled(vis_engine, lambda ctx: ctx.graph.add_nodes(ids, x=[0.0] * len(ids), y=[0.0] * len(ids)))


def _filled(vis_engine: Engine, fill: Callable[[Context], object]) -> Context:
    """Create a context that logs nothing, and fill it."""
    ctx = create_context(seed=0, logger_config=_QUIET, vis_engine=vis_engine)
    try:
        fill(ctx)
    except BaseException:
        ctx.terminate()
        raise
    return ctx


def records_of(path: str | os.PathLike[str]) -> Iterator[dict[str, Any]]:
    """Yield the records of a recording of version 2.

    Raises:
        RecordingError (ValueError): it is damaged, or ends too early; the records before that were yielded.
    """
    with as_path(path, "The path of a recording").open("rb") as file:
        yield from version2.read(file)


def _node_ids(path: str | os.PathLike[str]) -> Iterator[int]:
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
