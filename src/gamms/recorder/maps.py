"""The map of a recording: in its header, or given by the caller and identified by its SHA-256 in the header."""

import os
from collections.abc import Callable
from hashlib import sha256
from typing import Any

from gamms.arguments import as_path
from gamms.errors import BadFile, BadType
from gamms.recorder.errors import RecordingError, report_damage
from gamms.text import shown
from gamms.typing.context import HostContext

HASH = "world_sha256"  # key in a header without "world"


def compute_hash(packed: bytes) -> str:
    """Return the SHA-256 of a packed map, in hexadecimal."""
    return sha256(packed).hexdigest()


def hash_in(header: dict[str, Any]) -> str:
    """Return the SHA-256 of the map of a recording.

    Raises:
        RecordingError: the header has none.
    """
    world = header.get("world")
    name = header.get(HASH)
    if isinstance(world, bytes):
        return compute_hash(world)
    if isinstance(name, str) and "world" not in header:
        return name
    raise RecordingError(f"The map at the start is not there: this recording holds {type(world)} instead.")


def has_map(header: dict[str, Any]) -> bool:
    """Return whether a recording contains its map."""
    return "world" in header or HASH not in header


def is_map_of(packed: bytes, header: dict[str, Any]) -> bool:
    """Return whether a map is that of a recording."""
    return packed == header["world"] if "world" in header else compute_hash(packed) == header.get(HASH)


def remove_map(header: dict[str, Any]) -> dict[str, Any]:
    """Return the header with the SHA-256 of the map instead of the map."""
    if "world" not in header:
        return header
    return {**{key: value for key, value in header.items() if key != "world"}, HASH: compute_hash(header["world"])}


def pack_map(graph: object) -> bytes:
    """Return the packed bytes of a map.

    Args:
        graph: a context, the graph of another recording, or the path of a file written by `ctx.graph.save`.

    Raises:
        BadType (TypeError): not one of these.
        OSError: the file cannot be read.
    """
    if isinstance(graph, str | os.PathLike):
        return as_path(graph, "The path of a map").read_bytes()
    if not (hasattr(graph, "packed") or hasattr(graph, "storage")):
        graph = getattr(graph, "graph", graph)
    packed: Any = graph.storage.pack_savable()[0] if hasattr(graph, "storage") else getattr(graph, "packed", None)
    if not isinstance(packed, bytes):
        raise BadType(
            "graph= is a context, a graph of a recording, or the path of a file that ctx.graph.save wrote, "
            f"not {shown(graph)}."
        )
    return packed


def check_given_map(graph: object, header: dict[str, Any]) -> bytes:
    """Return the packed bytes of a given map, if it is the map of the recording.

    Raises:
        RecordingError: it is another map.
            BadType (TypeError), OSError: see `pack_map`.
    """
    packed = pack_map(graph)
    if not is_map_of(packed, header):
        raise RecordingError(
            f"This is not the map of the recording: its SHA-256 is {compute_hash(packed)}, and not {hash_in(header)}."
        )
    return packed


def attach(ctx: HostContext, header: dict[str, Any]) -> None:
    """Attach the map of a recording to an empty context; otherwise check that the maps are equal.

    Raises:
        RecordingError: the maps differ, or neither the context nor the recording has one.
    """
    name = hash_in(header)
    if has_map(header):
        become(ctx, name, lambda: header["world"])
    elif compute_hash(pack_map(ctx)) != name:
        raise RecordingError(
            "This recording does not contain its map, and the graph of this context is another. Load the map with "
            f"the SHA-256 {name} first: ctx.graph.load('map.gamms')."
        )


def become(ctx: HostContext, name: str, packed: Callable[[], bytes], others: tuple[str, ...] = ()) -> None:
    """Set the map of a context, unless it already has this map.

    Args:
        ctx: a context without a map, or with a map of the recording.
        name: SHA-256 of the map.
        packed: returns its bytes.
        others: SHA-256 of maps that it may replace.

    Raises:
        RecordingError: the map is damaged, or the context has another map.
    """
    is_empty = next(iter(ctx.graph.graph.get_nodes()), None) is None
    now = None if is_empty else compute_hash(pack_map(ctx))
    if now not in (None, name, *others):
        raise RecordingError(
            "The graph or the obstacles of this context are not those of the recording. Give a context without a "
            "graph: the recording brings its own."
        )
    if now != name:
        with report_damage("The map of this recording is damaged", (BadFile,)):
            ctx.graph.storage.unpack(packed())
