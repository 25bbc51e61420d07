"""Blocks: what a recording is a list of. Each has a head with sizes and checksums, and a body of packed bytes.

All numbers are little-endian. A file: `MAGIC`, a header block, other blocks, an end block.
"""

import zlib
from struct import Struct
from typing import NamedTuple

from gamms.errors import BadFile, BadValue

MAGIC = b"MMGR\0\0\0\3"  # the last four bytes are the format version, which is big-endian as in older versions
SYNC = b"\xd3GB"
HEADER, KEYFRAME, TURNS, END = b"HKTE"

MOST_BODY = (1 << 32) - 1
MOST_MOVES = 1 << 22  # in one block
MOST_EVENTS = 1 << 20
MOST_TURNS = 1 << 16

# Bytes of memory, or as much time as these would take: what is counted in heads is charged before it is read.
_OF_TURN, _OF_MOVE, _OF_EVENT = 512, 32, 64

_HEAD = Struct("<3sBIIIIIIII")
HEAD_SIZE = _HEAD.size


class Head(NamedTuple):
    """The head of a block."""

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
    """How many turns, moves and events a block holds, and how many turns come before it."""

    first: int = 0
    turns: int = 0
    moves: int = 0
    events: int = 0


def cost_of(turns: int, moves: int, events: int) -> int:
    """Return how much memory turns take, without the values of events, in bytes."""
    return _OF_TURN * turns + _OF_MOVE * moves + _OF_EVENT * events


def block(type: int, body: bytes, key: int, counts: Counts) -> bytes:
    """Return the bytes of a block."""
    if len(body) > MOST_BODY:
        raise BadValue(f"{len(body)} bytes cannot be recorded at once; at most {MOST_BODY} can.")
    front = _HEAD.pack(SYNC, type, len(body), zlib.crc32(body), key, *counts, 0)[:-4]
    return b"".join((front, zlib.crc32(front).to_bytes(4, "little"), body))


def head_of(data: bytes) -> Head:
    """Return what the first `HEAD_SIZE` bytes of a block say.

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
    """Refuse a body that is not the one of the head."""
    if len(body) != head.size:
        raise BadFile("this block is cut off")
    if zlib.crc32(body) != head.crc:
        raise BadFile("this block is damaged")
