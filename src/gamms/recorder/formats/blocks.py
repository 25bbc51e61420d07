"""Blocks: what a recording is a list of. Each has a head with sizes and checksums, and a body of packed bytes.

All numbers are little-endian. A file: `MAGIC`, a header block, other blocks, an end block. In an unfinished one, which
has no end block, the last block may have a longer copy behind it, which then counts.
"""

import os
import zlib
from collections.abc import Iterator
from struct import Struct
from typing import BinaryIO, NamedTuple

from gamms.errors import BadFile, BadValue
from gamms.ir import packing
from gamms.plain import Plain
from gamms.recorder.errors import DAMAGES, RecordingError, refusing
from gamms.text import shown

MAGIC = b"MMGR\0\0\0\3"  # the last four bytes are the format version, which is big-endian as in older versions
SYNC = b"\xd3GB"
HEADER, KEYFRAME, TURNS, END = b"HKTE"

MOST_BODY = (1 << 32) - 1
MOST_MOVES = 1 << 22  # in one block
MOST_EVENTS = 1 << 20
MOST_TURNS = 1 << 16
_MOST_COPIES = 8  # heads of copies that are looked into; an honest file has one

# Bytes of memory, or as much time as these would take: what is counted in heads is charged before it is read.
_OF_TURN, _OF_MOVE, _OF_EVENT = 512, 32, 64

_HEAD = Struct("<3sBIIIIIIII")
HEAD_SIZE = _HEAD.size
_PIECE = 1 << 20


class Head(NamedTuple):
    """The head of a block, and where it is."""

    type: int
    size: int  # of the body in bytes
    crc: int  # CRC-32 of the body
    key: int  # CRC-32 of the body of the header of the file; 0 in its own head
    first: int  # turns before this block
    turns: int
    moves: int
    events: int
    at: int

    @property
    def end(self) -> int:
        """Where the block ends."""
        return self.at + HEAD_SIZE + self.size


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


def head_of(data: bytes, at: int = 0) -> Head:
    """Return what the first `HEAD_SIZE` bytes of a block say, which is at this byte.

    Raises:
        BadFile: this is no head.
    """
    if len(data) < HEAD_SIZE or not data.startswith(SYNC):
        raise BadFile("no block begins here")
    _, *parts, crc = _HEAD.unpack_from(data)
    if zlib.crc32(data[: HEAD_SIZE - 4]) != crc:
        raise BadFile("the head of this block is damaged")
    head = Head._make((*parts, at))
    if head.turns > MOST_TURNS or head.moves > MOST_MOVES or head.events > MOST_EVENTS:
        raise BadFile(f"this block has {head.turns} turns, {head.moves} moves and {head.events} events: too many")
    return head


# -- the blocks of a file ---------------------------------------------------------------------------------------


class Contents(NamedTuple):
    """The header and the blocks of a recording."""

    header: dict[str, Plain]
    found: list[Head]
    warning: str | None  # None of a finished one


def at_byte(at: int) -> refusing:
    """Name the byte of a block in the errors that it causes."""
    return refusing(f"This recording is damaged at byte {at}", (*DAMAGES, MemoryError, RecursionError))


class Input:
    """Bytes of a stream by their place, counted from where it stands at first."""

    def __init__(self, stream: BinaryIO) -> None:
        try:
            stream.read(0) + b""  # text would not do
            self._begin = stream.tell()
            self.size = stream.seek(0, os.SEEK_END) - self._begin
        except (OSError, AttributeError, TypeError) as error:
            raise RecordingError(
                f"A recording is read from a path, or from a binary stream that can seek ({error}). Copy this one "
                f"into an io.BytesIO."
            ) from error
        self._stream = stream

    def read(self, at: int, size: int) -> bytes:
        """Return bytes.

        Raises:
            BadFile: they are not there.
            RecordingError: the file was closed.
        """
        if self._stream.closed:
            raise RecordingError("This recording was closed: open it again, or read it within `with`.")
        if not 0 <= at <= at + size <= self.size:
            raise BadFile(f"{size} bytes are promised and {max(self.size - at, 0)} are there")
        self._stream.seek(self._begin + at)
        data = self._stream.read(size)
        if len(data) != size:
            raise BadFile("the file became shorter while it was read")
        return data

    def head(self, at: int) -> Head:
        """Return the head of the block at a byte (BadFile)."""
        return head_of(self.read(at, min(HEAD_SIZE, self.size - at)), at)

    def body(self, head: Head) -> bytes:
        """Return the body of a block.

        Raises:
            BadFile: it is damaged, or the head is another by now.
        """
        if self.head(head.at) != head:
            raise BadFile("this block and what is known of it do not fit")
        body = self.read(head.at + HEAD_SIZE, head.size)
        if zlib.crc32(body) != head.crc:
            raise BadFile("this block is damaged")
        return body


def contents_of(source: Input, decoder: packing.Decoder) -> Contents:
    """Return the header of a recording, and which blocks it has.

    Raises:
        RecordingError: it is none, or its header is damaged or cut off.
    """
    _check_magic(source.read(0, min(len(MAGIC), source.size)))
    with at_byte(len(MAGIC)):
        head = source.head(len(MAGIC))
        header = packing.unpack(source.body(head), decoder)
        if head.type != HEADER or head.key or not isinstance(header, dict):
            raise BadFile("the header is not here")
    return Contents(header, *_Blocks(source, head).read(head.end))


def _check_magic(data: bytes) -> None:
    if data == MAGIC:
        return
    if data.startswith(MAGIC[:4]) and len(data) == len(MAGIC):
        version = int.from_bytes(data[4:], "big")
        raise RecordingError(f"This recording has format version {version} at byte 4; only version 3 is read here.")
    if not data:
        raise RecordingError(
            "This is no recording: nothing is at byte 0. A stream is read from where it stands; try seek(0)."
        )
    raise RecordingError(f"This is no recording: at byte 0 it begins with {shown(data)}, and not with {shown(MAGIC)}.")


def turns_of(found: list[Head]) -> int:
    """Return how many turns there are in blocks that follow each other."""
    return found[-1].first + found[-1].turns if found else 0


class _Blocks:
    """The blocks that follow each other behind the header of a file."""

    def __init__(self, source: Input, header: Head) -> None:
        self._source, self._key = source, header.crc
        self._found: list[Head] = []

    def read(self, at: int) -> tuple[list[Head], str | None]:
        """Return the blocks from a byte on, and what is missing of an unfinished file."""
        source, found = self._source, self._found
        while (block := self._at(at)) is not None and self._joins(block):
            at = block.end
            if block.type == END and at == source.size:
                return found, None
        if found and not self._is_sound(found[-1]):
            at = found.pop().at
        if (copy := self._copy_behind(at)) is not None:
            self._join(copy)
            at = copy.end
        turns, rest = turns_of(found), f" {source.size - at} bytes behind them are lost." if source.size > at else ""
        return found, f"This recording was not finished: its first {turns} turns, up to byte {at}, are there.{rest}"

    def _at(self, at: int) -> Head | None:
        try:
            head = self._source.head(at)
        except BadFile:
            return None
        return head if head.key == self._key and head.end <= self._source.size else None

    def _joins(self, block: Head) -> bool:
        """Return whether a block continues what was found; if so, it is added."""
        if block.type == END:
            return block.first == turns_of(self._found)
        if block.type not in (TURNS, KEYFRAME):
            return True  # of a later version
        is_next = block.first == turns_of(self._found)
        if (block.type == TURNS) != (block.turns > 0) or not (
            is_next or (self._replaces(block) and self._is_sound(block))
        ):
            return False
        self._join(block)
        return True

    def _join(self, block: Head) -> None:
        if self._replaces(block):
            self._found.pop()
        self._found.append(block)

    def _replaces(self, block: Head) -> bool:
        last = self._found[-1] if self._found else block._replace(first=-1)
        return last.type == block.type == TURNS and last.first == block.first and last.turns <= block.turns

    def _is_sound(self, block: Head) -> bool:
        try:
            self._source.body(block)
        except BadFile:
            return False
        return True

    def _copy_behind(self, at: int) -> Head | None:
        """Return the first sound block behind a damaged place that replaces the last block of turns or continues it."""
        tries = 0
        for place in self._places_of(SYNC + bytes([TURNS]), at + 1):
            block = self._at(place)
            if block is not None and block.turns and (self._replaces(block) or block.first == turns_of(self._found)):
                if self._is_sound(block):
                    return block
                tries += 1
            if tries == _MOST_COPIES:
                return None
        return None

    def _places_of(self, mark: bytes, at: int) -> Iterator[int]:
        """Yield where these bytes are, from a place on."""
        while at < self._source.size:
            piece = self._source.read(at, min(_PIECE, self._source.size - at))
            place = piece.find(mark)
            while place >= 0:
                yield at + place
                place = piece.find(mark, place + 1)
            at += max(len(piece) - len(mark) + 1, 1)
