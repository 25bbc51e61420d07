"""The file that a visibility table is kept in: small, bounded, and never evaluated; see docs/save-format.md.

Layout, little-endian: 8 bytes `GAMMSEYE`; uint32 version; uint32 CRC-32 of all that follows; 32 bytes key of the
map; float64 radius and observer height; uint64 nodes, seen, size of the stored counts, size of the stored rows; the
counts, the rows: packed bytes of arrays of int32 (`ir/packing.py`).
"""

import os
import zlib
from pathlib import Path
from struct import Struct

import numpy as np

from gamms.errors import BadFile
from gamms.graph.visibility_workers import RowArray, VisibilityRows
from gamms.ir import packing
from gamms.limits import Allowance

MAGIC = b"GAMMSEYE"
VERSION = 2

_HEAD = Struct("<8sII32sddQQQQ")
_CHECKED = 16  # bytes before those that the CRC-32 is of
_LEAST_BYTES = 1024  # that a file may take beyond 5 for each number


def encode(seen: VisibilityRows, key: bytes, radius: float, observer_height: float) -> bytes:
    """Return a table as the bytes of a file."""
    stored = [packing.packed(packing.array_bytes(column), is_noisy=True) for column in seen]
    sizes = len(seen.counts), len(seen.rows), *map(len, stored)
    head = _HEAD.pack(MAGIC, VERSION, 0, key, radius, observer_height, *sizes)
    body = b"".join((head[_CHECKED:], *stored))
    return head[: _CHECKED - 4] + zlib.crc32(body).to_bytes(4, "little") + body


def read(path: Path, key: bytes, nodes: int) -> VisibilityRows | None:
    """Return the table in a file; None where there is no file, or it is of another map.

    Raises:
        BadFile (ValueError): the file is damaged, foreign or too new.
        OSError: it cannot be read.
    """
    try:
        with path.open("rb") as file:
            head, size = file.read(_HEAD.size), os.fstat(file.fileno()).st_size
            if _is_of_another_map(head, key):
                return None
            _check_head(head, size, nodes)
            return decode(head + file.read(size), key, nodes)
    except FileNotFoundError:
        return None


def is_foreign(path: Path) -> bool:
    """Return whether there is a file of another kind."""
    try:
        with path.open("rb") as file:
            begin = file.read(len(MAGIC))
    except FileNotFoundError:
        return False
    return begin != MAGIC[: len(begin)]


def _is_of_another_map(head: bytes, key: bytes) -> bool:
    """Return whether this is the head of a sound file whose key is another."""
    return head[:12] == MAGIC + VERSION.to_bytes(4, "little") and len(head) == _HEAD.size and head[16:48] != key


def decode(data: bytes, key: bytes, nodes: int) -> VisibilityRows:
    """Return the table of a known map in the bytes of a file.

    Raises:
        BadFile: see `read`.
    """
    _check_head(data, len(data), nodes)
    _, _, crc, found, _, _, _, seen, first, _ = _HEAD.unpack_from(data)
    if found != key or zlib.crc32(data[_CHECKED:]) != crc:
        raise BadFile("it is damaged")
    middle = _HEAD.size + first
    table = VisibilityRows(_unpack(data[_HEAD.size : middle], nodes), _unpack(data[middle:], seen))
    _check(table)
    return table


def _check_head(data: bytes, size: int, nodes: int) -> None:
    """Refuse what does not say what a file of this size may say, before any memory is taken for it."""
    if len(data) < _HEAD.size or not data.startswith(MAGIC):
        raise BadFile("it does not begin like one")
    _, version, _, _, _, _, count, seen, first, second = _HEAD.unpack_from(data)
    if version != VERSION:
        raise BadFile(f"it has format version {version}, this GAMMS reads {VERSION}")
    if count != nodes or seen > nodes * nodes or first + second != size - _HEAD.size:
        raise BadFile("it is damaged or cut off")
    if size > 5 * (nodes + seen) + _LEAST_BYTES:
        raise BadFile("its size and what it says of its contents do not fit")
    Allowance(size, "it").charge(4 * (nodes + seen))


def _check(table: VisibilityRows) -> None:
    """Refuse rows that are no node, or not in order."""
    counts, rows = table.counts.astype(np.int64), table.rows
    if (counts < 1).any() or int(counts.sum()) != len(rows):
        raise BadFile("its counts are damaged")
    is_first = np.zeros(len(rows), np.bool_)
    is_first[np.cumsum(counts) - counts] = True
    is_sound = np.ones(len(rows), np.bool_)
    is_sound[1:] = rows[1:] > rows[:-1]
    if not (is_sound | is_first).all() or (rows < 0).any() or (rows >= len(counts)).any():
        raise BadFile("its rows are damaged")


def _unpack(stored: bytes, count: int) -> RowArray:
    data, rest = packing.unpacked(stored, 4 * count)
    if len(data) != 4 * count or rest:
        raise BadFile("a column has another size than it says")
    return packing.array_of(data, np.dtype(np.int32))
