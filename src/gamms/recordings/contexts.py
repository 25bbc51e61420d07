"""A context to replay a recording in, when there is nothing but the recording."""

import os
from collections.abc import Iterator
from typing import Any

from gamms.arguments import as_path
from gamms.context import Context, create_context
from gamms.ir import events as kinds
from gamms.recorder import RecordingError
from gamms.recorder.formats import version2
from gamms.typing.opcodes import MAGIC_NUMBER
from gamms.visual import Engine

_QUIET = {"level": "CRITICAL"}  # what a recording cannot say, such as the sensors of version 2, is no news
_NODES = {kinds.AGENT_CURRENT_NODE, kinds.AGENT_PREV_NODE}


def version_of(path: str | os.PathLike[str]) -> int:
    """The format version of a recording.

    Raises:
        RecordingError (ValueError): it is none.
        OSError: it cannot be read.
    """
    with as_path(path, "The path of a recording").open("rb") as file:
        head = file.read(8)
    if len(head) < 8 or not head.startswith(MAGIC_NUMBER):
        raise RecordingError(f"{str(path)!r} is no recording: it does not begin with 'MMGR' and a version.")
    return int.from_bytes(head[4:], "big")


def fresh(vis_engine: Engine = Engine.NO_VIS) -> Context:
    """A context with nothing in it, which says nothing."""
    return create_context(seed=0, logger_config=_QUIET, vis_engine=vis_engine)


def context_for(
    path: str | os.PathLike[str], map: str | os.PathLike[str] | None = None, vis_engine: Engine = Engine.NO_VIS
) -> Context:
    """A fresh context to replay a recording of any version in; the map is for one that holds none, see below.

    Raises:
        BadFile, RecordingError (ValueError): a file is damaged at its beginning.
        OSError: one cannot be read.
    """
    return with_nodes_made_up(path, map, vis_engine) if version_of(path) < 3 else with_map(map, vis_engine)


def with_map(map: str | os.PathLike[str] | None, vis_engine: Engine = Engine.NO_VIS) -> Context:
    """A fresh context with the map in a file that `ctx.graph.save` wrote; None: without one.

    Raises:
        BadFile (ValueError): the file is damaged.
        OSError: it cannot be read.
    """
    ctx = fresh(vis_engine)
    try:
        if map is not None:
            ctx.graph.load(map)
    except BaseException:
        ctx.terminate()
        raise
    return ctx


def with_nodes_made_up(
    path: str | os.PathLike[str], map: str | os.PathLike[str] | None = None, vis_engine: Engine = Engine.NO_VIS
) -> Context:
    """A fresh context for a recording of version 2, which has no map.

    Args:
        path: of the recording.
        map: a file that `ctx.graph.save` wrote; None makes up a node at (0, 0) for each node id in the recording.
        vis_engine: see `create_context`.

    Raises:
        BadFile, RecordingError (ValueError): a file is damaged at its beginning.
        OSError: one cannot be read.
    """
    ctx = fresh(vis_engine)
    try:
        if map is not None:
            ctx.graph.load(map)
        else:
            ids = sorted(set(_node_ids(path)))
            ctx.graph.add_nodes(ids, x=[0.0] * len(ids), y=[0.0] * len(ids))
    except BaseException:
        ctx.terminate()
        raise
    return ctx


def records_of(path: str | os.PathLike[str]) -> Iterator[dict[str, Any]]:
    """The records of a recording of version 2.

    Raises:
        RecordingError (ValueError): it is damaged, or ends too early; the records before that were yielded.
    """
    with as_path(path, "The path of a recording").open("rb") as file:
        yield from version2.read(file)


def _node_ids(path: str | os.PathLike[str]) -> Iterator[int]:
    """The node ids in a recording of version 2, as far as it is whole."""
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
