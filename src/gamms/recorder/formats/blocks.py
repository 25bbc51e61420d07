"""Blocks: what a recording is a list of. Each has a head with sizes and checksums, and a body.

All numbers are little-endian. A file: `MAGIC`, a header block, other blocks, an index block, `FOOTER`.
"""

import zlib
from struct import Struct
from typing import Any, NamedTuple

from gamms.errors import BadFile, BadValue
from gamms.limits import PER_BYTE
from gamms.recorder.formats import columns, values

MAGIC = b"MMGR\0\0\0\3"  # the last four bytes are the format version, which is big-endian as in older versions
SYNC = b"\xd3GB"
HEADER, KEYFRAME, TURNS, INDEX = b"HKTI"

MOST_BODY = (1 << 32) - 1
MOST_MOVES = 1 << 22  # in one block
MOST_EVENTS = 1 << 20
MOST_TURNS = 1 << 16

# Bytes of memory, or as much time as these would take: what is counted in heads is charged before it is read.
_OF_TURN, _OF_MOVE, _OF_EVENT = 512, 32, 64

_HEAD = Struct("<3sBIIIIIIII")
_FOOTER = Struct("<QI4s")
HEAD_SIZE = _HEAD.size
FOOTER_SIZE = _FOOTER.size
_END = b"MMGE"


class Head(NamedTuple):
    """What the head of a block says."""

    type: int
    size: int  # of the body in bytes
    crc: int  # CRC-32 of the body
    key: int  # CRC-32 of the body of the header of the file; 0 in its own head
    first: int  # turns before this block
    turns: int
    moves: int
    events: int

    @property
    def total(self) -> int:
        """Size of the block in bytes."""
        return HEAD_SIZE + self.size


class Counts(NamedTuple):
    """How much a block of turns holds."""

    first: int = 0
    turns: int = 0
    moves: int = 0
    events: int = 0


def cost_of(turns: int, moves: int, events: int) -> int:
    """How much memory turns take, without the values of events, in bytes."""
    return _OF_TURN * turns + _OF_MOVE * moves + _OF_EVENT * events


def padded(body: bytes, cost: int) -> bytes:
    """A body, with zeros behind it where it would be smaller than readers believe of what takes so much memory."""
    return body + bytes(max(0, -(-cost // PER_BYTE) - HEAD_SIZE - len(body)))


def block(type: int, body: bytes, key: int, counts: Counts) -> bytes:
    """The bytes of a block."""
    if len(body) > MOST_BODY:
        raise BadValue(f"{len(body)} bytes cannot be recorded at once; at most {MOST_BODY} can.")
    front = _HEAD.pack(SYNC, type, len(body), zlib.crc32(body), key, *counts, 0)[:-4]
    return b"".join((front, zlib.crc32(front).to_bytes(4, "little"), body))


def head_of(data: bytes) -> Head:
    """What the first `HEAD_SIZE` bytes of a block say.

    Raises:
        BadFile: this is no head.
    """
    if len(data) < HEAD_SIZE or not data.startswith(SYNC):
        raise BadFile("no block begins here")
    _, *parts, crc = _HEAD.unpack_from(data)
    if zlib.crc32(data[: HEAD_SIZE - 4]) != crc:
        raise BadFile("the head of this block is damaged")
    head = Head(*parts)
    if head.turns > MOST_TURNS or head.moves > MOST_MOVES or head.events > MOST_EVENTS:
        raise BadFile(f"this block has {head.turns} turns, {head.moves} moves and {head.events} events: too many")
    return head


def check_body(head: Head, body: bytes) -> None:
    """Refuse a body that is not the one which the head speaks of."""
    if len(body) != head.size:
        raise BadFile("this block is cut off")
    if zlib.crc32(body) != head.crc:
        raise BadFile("this block is damaged")


def footer(index_at: int) -> bytes:
    """The last bytes of a finished file."""
    crc = zlib.crc32(index_at.to_bytes(8, "little"))
    return _FOOTER.pack(index_at, crc, _END)


def index_at(data: bytes) -> int | None:
    """Where the index begins, if these are the last bytes of a finished file."""
    if len(data) != FOOTER_SIZE:
        return None
    at, crc, end = _FOOTER.unpack(data)
    return int(at) if end == _END and zlib.crc32(data[:8]) == crc else None


# -- values -----------------------------------------------------------------------------------------------------


def put_bytes(data: bytes) -> bytes:
    """Bytes, packed."""
    return columns.varint(len(data)) + columns.packed(data)


def take_bytes(cursor: columns.Cursor, most: int) -> bytes:
    """The next packed bytes.

    Raises:
        BadFile: they are damaged, or more than `most`.
    """
    size = cursor.varint()
    if size > most:
        raise BadFile(f"{size} bytes of memory are far more than the size of the file explains")
    return columns.unpacked(cursor, size)


def put_value(value: Any, where: str) -> bytes:
    """A plain value as the body of a block."""
    data = values.to_bytes(value, where)
    body = put_bytes(data)
    return body if PER_BYTE * len(body) >= values.most_cost_of(data) else padded(body, values.cost_of(data))


def take_value(body: bytes, decoder: values.Decoder, place: object) -> Any:
    """The plain value in the body of a block.

    Args:
        body: of the block.
        decoder: of the file.
        place: of the block in the file.

    Raises:
        BadFile: it is damaged, or takes far more memory than its size explains.
    """
    cursor = columns.Cursor(body)
    data = take_bytes(cursor, decoder.most_bytes)
    cursor.finish()
    return decoder.value(data, place)
