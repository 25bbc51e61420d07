"""The map of a recording: in its header, or only named there by its SHA-256, and then given by the caller."""

import os
from collections.abc import Callable
from hashlib import sha256
from typing import Any

from gamms.arguments import as_path
from gamms.errors import BadFile, BadType
from gamms.recorder.errors import RecordingError, refusing
from gamms.text import shown
from gamms.typing.context import HostContext

HASH = "world_sha256"  # what a header has instead of "world"


def hash_of(packed: bytes) -> str:
    """Return the name of a map: the SHA-256 of what `ctx.graph.storage.pack` returns, in hexadecimal."""
    return sha256(packed).hexdigest()


def hash_in(header: dict[str, Any]) -> str:
    """Return the name of the map of a recording.

    Raises:
        RecordingError: its header names none.
    """
    world, name = header.get("world"), header.get(HASH)
    if isinstance(world, bytes):
        return hash_of(world)
    if isinstance(name, str) and "world" not in header:
        return name
    raise RecordingError(f"The map at the start is not there: this recording holds {type(world)} instead.")


def has_map(header: dict[str, Any]) -> bool:
    """Whether a recording holds its map; else it only names it, or is damaged."""
    return "world" in header or HASH not in header


def is_map_of(packed: bytes, header: dict[str, Any]) -> bool:
    """Whether this is the map of a recording."""
    return packed == header["world"] if "world" in header else hash_of(packed) == header.get(HASH)


def without_map(header: dict[str, Any]) -> dict[str, Any]:
    """Return the header with the name of the map instead of the map."""
    if "world" not in header:
        return header
    return {**{key: value for key, value in header.items() if key != "world"}, HASH: hash_of(header["world"])}


def packed_of(graph: object) -> bytes:
    """Return the bytes of a map.

    Args:
        graph: a context, the graph of another recording, or the path of a file that `ctx.graph.save` wrote.

    Raises:
        BadType (TypeError): it is none of these.
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


def given_map(graph: object, header: dict[str, Any]) -> bytes:
    """Return the bytes of a map that was given, which must be that of the recording.

    Raises:
        RecordingError: it is another.
        BadType (TypeError), OSError: see `packed_of`.
    """
    packed = packed_of(graph)
    if not is_map_of(packed, header):
        raise RecordingError(
            f"This is not the map of the recording: its SHA-256 is {hash_of(packed)}, and not {hash_in(header)}."
        )
    return packed


def attach(ctx: HostContext, header: dict[str, Any]) -> None:
    """Attach the map of a recording where there is none yet; else it must be the same.

    Raises:
        RecordingError: it is another, or there is none and the recording holds none, either.
    """
    name = hash_in(header)
    if has_map(header):
        become(ctx, name, lambda: header["world"])
    elif hash_of(packed_of(ctx)) != name:
        raise RecordingError(
            "This recording does not hold its map, and the graph of this context is another. Load the map with "
            f"the SHA-256 {name} first: ctx.graph.load('map.gamms')."
        )


def become(ctx: HostContext, name: str, packed: Callable[[], bytes], others: tuple[str, ...] = ()) -> None:
    """Give a context a map, unless it has that already.

    Args:
        ctx: the context, which has no map, or one of the recording.
        name: of the map.
        packed: gives its bytes.
        others: names of maps that it may take the place of.

    Raises:
        RecordingError: the map is damaged, or that of the context is none of these.
    """
    is_empty = next(iter(ctx.graph.graph.get_nodes()), None) is None
    now = None if is_empty else hash_of(packed_of(ctx))
    if now not in (None, name, *others):
        raise RecordingError(
            "The graph or the obstacles of this context are not those of the recording. Give a context without a "
            "graph: the recording brings its own."
        )
    if now != name:
        with refusing("The map of this recording is damaged", (BadFile,)):
            ctx.graph.storage.unpack(packed())
