"""The blocks of a recording. Each has a head with sizes and checksums, and a body of packed bytes.

All numbers are little-endian. A file consists of `MAGIC`, a header block, other blocks, and an end block. In an
unfinished file, without an end block, the last block may be followed by a longer copy, which replaces it.
"""

import os
import zlib
from collections.abc import Iterator
from io import BytesIO
from struct import Struct
from typing import Any, BinaryIO, NamedTuple, SupportsIndex

from gamms.errors import BadFile, BadValue
from gamms.ir import packing
from gamms.plain import Plain
from gamms.readonly import NotPickled
from gamms.recorder.errors import DAMAGES, RecordingError, report_damage
from gamms.recorder.streams import StreamOwner
from gamms.text import shown

MAGIC = b"MMGR\0\0\0\3"  # the last four bytes are the format version, big-endian as in older versions
SYNC = b"\xd3GB"
HEADER, KEYFRAME, TURNS, END = b"HKTE"

MOST_BODY = (1 << 32) - 1
MOST_MOVES = 1 << 22  # in one block
MOST_EVENTS = 1 << 20
MOST_TURNS = 1 << 16
_MOST_COPIES = 8  # heads of copies that are examined; a valid file has one

# Bytes of memory, or the equivalent time: charged by the counts in heads before a block is read.
_OF_TURN = 512
_OF_MOVE = 32
_OF_EVENT = 64

_HEAD = Struct("<3sBIIIIIIII")
HEAD_SIZE = _HEAD.size
_PIECE = 1 << 20


class BlockHead(NamedTuple):
    """The head of a block, and its position."""

    type: int
    size: int  # of the body in bytes
    crc: int  # CRC-32 of the body
    key: int  # CRC-32 of the body of the header of the file; 0 in the header itself
    first: int  # number of turns before this block
    turns: int
    moves: int
    events: int
    at: int

    @property
    def end(self) -> int:
        """The position after the block."""
        return self.at + HEAD_SIZE + self.size


class BlockCounts(NamedTuple):
    """The numbers of turns, moves and events of a block, and the number of turns before it."""

    first: int = 0
    turns: int = 0
    moves: int = 0
    events: int = 0


def compute_cost(turns: int, moves: int, events: int) -> int:
    """Return the memory cost of turns in bytes, without the values of events."""
    return _OF_TURN * turns + _OF_MOVE * moves + _OF_EVENT * events


def make_block(type: int, body: bytes, key: int, counts: BlockCounts) -> bytes:
    """Return the bytes of a block."""
    if len(body) > MOST_BODY:
        raise BadValue(f"{len(body)} bytes cannot be recorded at once; at most {MOST_BODY} can.")
    front = _HEAD.pack(SYNC, type, len(body), zlib.crc32(body), key, *counts, 0)[:-4]
    return b"".join((front, zlib.crc32(front).to_bytes(4, "little"), body))


def decode_head(data: bytes, at: int = 0) -> BlockHead:
    """Decode the head of a block from its first `HEAD_SIZE` bytes.

    Raises:
        BadFile: not a valid head.
    """
    if len(data) < HEAD_SIZE or not data.startswith(SYNC):
        raise BadFile("there is no block here")
    _, *parts, crc = _HEAD.unpack_from(data)
    if zlib.crc32(data[: HEAD_SIZE - 4]) != crc:
        raise BadFile("the head of this block is damaged")
    head = BlockHead._make((*parts, at))
    if head.turns > MOST_TURNS or head.moves > MOST_MOVES or head.events > MOST_EVENTS:
        raise BadFile(f"this block has {head.turns} turns, {head.moves} moves and {head.events} events: too many")
    return head


# -- the blocks of a file ---------------------------------------------------------------------------------------


class FileContents(NamedTuple):
    """The header and the blocks of a recording."""

    header: dict[str, Plain]
    found: list[BlockHead]
    warning: str | None  # None of a finished one


def add_position_to_errors(at: int) -> report_damage:
    """Return a context manager that adds the position of a block to errors."""
    return report_damage(f"This recording is damaged at byte {at}", (*DAMAGES, MemoryError, RecursionError))


class BlockSource(NotPickled):
    """Random access to the bytes of a stream, counted from its initial position."""

    _not_pickled = StreamOwner._not_pickled

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

    def __reduce_ex__(self, protocol: SupportsIndex) -> Any:
        """Refuse to be pickled, unless the stream is in memory."""
        if isinstance(self._stream, BytesIO):
            return object.__reduce_ex__(self, protocol)
        return super().__reduce_ex__(protocol)

    def read(self, at: int, size: int) -> bytes:
        """Return `size` bytes from a position.

        Raises:
            BadFile: there are fewer bytes.
            RecordingError: the file was closed.
        """
        if self._stream.closed:
            raise RecordingError("This recording was closed: open it again, or read it within `with`.")
        if not 0 <= at <= at + size <= self.size:
            raise BadFile(f"{size} bytes are stated, but only {max(self.size - at, 0)} exist")
        self._stream.seek(self._begin + at)
        data = self._stream.read(size)
        if len(data) != size:
            raise BadFile("the file became shorter while it was read")
        return data

    def read_head(self, at: int) -> BlockHead:
        """Return the head of the block at a position (BadFile)."""
        return decode_head(self.read(at, min(HEAD_SIZE, self.size - at)), at)

    def read_body(self, head: BlockHead) -> bytes:
        """Return the body of a block.

        Raises:
            BadFile: the body is damaged, or the head has changed.
        """
        if self.read_head(head.at) != head:
            raise BadFile("this block has changed")
        body = self.read(head.at + HEAD_SIZE, head.size)
        if zlib.crc32(body) != head.crc:
            raise BadFile("this block is damaged")
        return body


def read_contents(source: BlockSource, decoder: packing.Decoder) -> FileContents:
    """Return the header and the list of blocks of a recording.

    Raises:
        RecordingError: not a recording, or its header is damaged or truncated.
    """
    _check_magic(source.read(0, min(len(MAGIC), source.size)))
    with add_position_to_errors(len(MAGIC)):
        head = source.read_head(len(MAGIC))
        header = packing.unpack(source.read_body(head), decoder)
        if head.type != HEADER or head.key or not isinstance(header, dict):
            raise BadFile("there is no header here")
    return FileContents(header, *_Blocks(source, head).read(head.end))


def _check_magic(data: bytes) -> None:
    if data == MAGIC:
        return
    if data.startswith(MAGIC[:4]) and len(data) == len(MAGIC):
        version = int.from_bytes(data[4:], "big")
        raise RecordingError(f"This recording has format version {version} at byte 4; only version 3 is read here.")
    if not data:
        raise RecordingError(
            "This is not a recording: nothing is at byte 0. A stream is read from its present position; try seek(0)."
        )
    raise RecordingError(f"This is not a recording: at byte 0 it begins with {shown(data)}, not with {shown(MAGIC)}.")


def count_turns(found: list[BlockHead]) -> int:
    """Return the number of turns in consecutive blocks."""
    return found[-1].first + found[-1].turns if found else 0


class _Blocks:
    """The consecutive blocks after the header of a file."""

    def __init__(self, source: BlockSource, header: BlockHead) -> None:
        self._source = source
        self._key = header.crc
        self._found: list[BlockHead] = []

    def read(self, at: int) -> tuple[list[BlockHead], str | None]:
        """Return the blocks from a position on, and a warning for an unfinished file."""
        source = self._source
        found = self._found
        while (block := self._read_block(at)) is not None and self._add_next_block(block):
            at = block.end
            if block.type == END and at == source.size:
                return found, None
        if found and not self._is_sound(found[-1]):
            at = found.pop().at
        if (copy := self._copy_behind(at)) is not None:
            self._join(copy)
            at = copy.end
        turns = count_turns(found)
        rest = f" {source.size - at} bytes after them are lost." if source.size > at else ""
        return found, f"This recording was not finished: its first {turns} turns, up to byte {at}, can be read.{rest}"

    def _read_block(self, at: int) -> BlockHead | None:
        try:
            head = self._source.read_head(at)
        except BadFile:
            return None
        return head if head.key == self._key and head.end <= self._source.size else None

    def _add_next_block(self, block: BlockHead) -> bool:
        """Add a block if it continues the blocks found so far; return whether it does."""
        if block.type == END:
            return block.first == count_turns(self._found)
        if block.type not in (TURNS, KEYFRAME):
            return True  # of a later version
        is_next = block.first == count_turns(self._found)
        if (block.type == TURNS) != (block.turns > 0) or not (
            is_next or (self._replace_block(block) and self._is_sound(block))
        ):
            return False
        self._join(block)
        return True

    def _join(self, block: BlockHead) -> None:
        if self._replace_block(block):
            self._found.pop()
        self._found.append(block)

    def _replace_block(self, block: BlockHead) -> bool:
        last = self._found[-1] if self._found else block._replace(first=-1)
        return last.type == block.type == TURNS and last.first == block.first and last.turns <= block.turns

    def _is_sound(self, block: BlockHead) -> bool:
        try:
            self._source.read_body(block)
        except BadFile:
            return False
        return True

    def _copy_behind(self, at: int) -> BlockHead | None:
        """Return the first valid block after a damaged place that replaces or continues the last block of turns."""
        tries = 0
        for place in self._find_positions(SYNC + bytes([TURNS]), at + 1):
            block = self._read_block(place)
            if (
                block is not None
                and block.turns
                and (self._replace_block(block) or block.first == count_turns(self._found))
            ):
                if self._is_sound(block):
                    return block
                tries += 1
            if tries == _MOST_COPIES:
                return None
        return None

    def _find_positions(self, mark: bytes, at: int) -> Iterator[int]:
        """Yield the positions of these bytes, from a position on."""
        while at < self._source.size:
            piece = self._source.read(at, min(_PIECE, self._source.size - at))
            place = piece.find(mark)
            while place >= 0:
                yield at + place
                place = piece.find(mark, place + 1)
            at += max(len(piece) - len(mark) + 1, 1)
