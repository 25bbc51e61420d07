"""Which blocks a recording has, by their heads, as far as these are whole.

A finished file ends with an end block. In an unfinished one the last block may have a longer copy behind it, which then
counts.
"""

import os
from collections.abc import Iterator
from typing import BinaryIO, NamedTuple

from gamms.errors import BadFile
from gamms.ir import packing
from gamms.plain import Plain
from gamms.recorder.errors import RecordingError
from gamms.recorder.formats import blocks
from gamms.text import reason, shown

_PIECE = 1 << 20
_MOST_COPIES = 8  # heads of copies that are looked into; an honest file has one
_DAMAGES = (ValueError, TypeError, KeyError, IndexError, OverflowError, MemoryError, RecursionError)


class Block(NamedTuple):
    """The place of a block, and its head."""

    at: int
    type: int
    size: int  # with its head
    first: int  # turns before it
    turns: int
    moves: int
    events: int


class Contents(NamedTuple):
    """The header and the blocks of a recording."""

    header: dict[str, Plain]
    key: int
    found: list[Block]
    warning: str | None  # None of a finished one


class at_byte:  # noqa: N801  # it reads as a word in `with at_byte(at):`
    """Name the byte of a block in the errors that it causes."""

    __slots__ = ("_at",)

    def __init__(self, at: int) -> None:
        self._at = at

    def __enter__(self) -> None:
        """Nothing to prepare."""

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        if isinstance(error, _DAMAGES) and not isinstance(error, RecordingError):
            raise RecordingError(
                f"This recording is damaged at byte {self._at}: {reason(error).rstrip('.')}."
            ) from error


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
        """
        if not 0 <= at <= at + size <= self.size:
            raise BadFile(f"{size} bytes are promised and {max(self.size - at, 0)} are there")
        self._stream.seek(self._begin + at)
        data = self._stream.read(size)
        if len(data) != size:
            raise BadFile("the file became shorter while it was read")
        return data

    def body(self, block: Block, key: int) -> tuple[blocks.Head, bytes]:
        """Return the head and the body of a block.

        Raises:
            BadFile: they are damaged, or others than it says.
        """
        head = blocks.head_of(self.read(block.at, blocks.HEAD_SIZE))
        if head.key != key or _block(block.at, head) != block:
            raise BadFile("this block and what is known of it do not fit")
        body = self.read(block.at + blocks.HEAD_SIZE, head.size)
        blocks.check_body(head, body)
        return head, body


def contents_of(source: Input, decoder: packing.Decoder) -> Contents:
    """Return the header of a recording, and which blocks it has.

    Raises:
        RecordingError: it is none, or its header is damaged or cut off.
    """
    _check_magic(source.read(0, min(len(blocks.MAGIC), source.size)))
    at = len(blocks.MAGIC)
    with at_byte(at):
        head = blocks.head_of(source.read(at, min(blocks.HEAD_SIZE, source.size - at)))
        _, body = source.body(_block(at, head), 0)
        header = packing.unpack(body, decoder)
        if head.type != blocks.HEADER or not isinstance(header, dict):
            raise BadFile("the header is not here")
    return Contents(header, head.crc, *_blocks_of(source, at + head.total, head.crc))


def _check_magic(data: bytes) -> None:
    if data == blocks.MAGIC:
        return
    if data.startswith(blocks.MAGIC[:4]) and len(data) == len(blocks.MAGIC):
        version = int.from_bytes(data[4:], "big")
        raise RecordingError(f"This recording has format version {version} at byte 4; only version 3 is read here.")
    if not data:
        raise RecordingError(
            "This is no recording: nothing is at byte 0. A stream is read from where it stands; try seek(0)."
        )
    raise RecordingError(
        f"This is no recording: at byte 0 it begins with {shown(data)}, and not with {shown(blocks.MAGIC)}."
    )


def _block(at: int, head: blocks.Head) -> Block:
    return Block(at, head.type, head.total, head.first, head.turns, head.moves, head.events)


def _blocks_of(source: Input, begin: int, key: int) -> tuple[list[Block], str | None]:
    """Return the blocks behind the header, and what is missing of an unfinished file."""
    found: list[Block] = []
    at = begin
    while (block := _block_at(source, at, key)) is not None and _joins(source, found, block, key):
        at += block.size
        if block.type == blocks.END and at == source.size:
            return found, None
    if found and not _is_sound(source, found[-1], key):
        at = found.pop().at
    turns = turns_of(found)
    copy = _copy_behind(source, at, key, found)
    if copy is not None:
        _join(found, copy)
        at, turns = copy.at + copy.size, turns_of(found)
    rest = f" {source.size - at} bytes behind them are lost." if source.size > at else ""
    return found, f"This recording was not finished: its first {turns} turns, up to byte {at}, are there.{rest}"


def turns_of(found: list[Block]) -> int:
    """Return how many turns there are in blocks that follow each other."""
    return found[-1].first + found[-1].turns if found else 0


def _block_at(source: Input, at: int, key: int) -> Block | None:
    try:
        head = blocks.head_of(source.read(at, blocks.HEAD_SIZE))
    except BadFile:
        return None
    return _block(at, head) if head.key == key and at + head.total <= source.size else None


def _joins(source: Input, found: list[Block], block: Block, key: int) -> bool:
    """Return whether a block continues what was found; if so, it is added."""
    if block.type == blocks.END:
        return block.first == turns_of(found)
    if block.type not in (blocks.TURNS, blocks.KEYFRAME):
        return True  # of a later version
    if (block.type == blocks.TURNS) != (block.turns > 0):
        return False
    if block.first == turns_of(found):
        found.append(block)
        return True
    if _replaces(found, block) and _is_sound(source, block, key):
        _join(found, block)
        return True
    return False


def _join(found: list[Block], block: Block) -> None:
    if _replaces(found, block):
        found.pop()
    found.append(block)


def _replaces(found: list[Block], block: Block) -> bool:
    last = found[-1] if found else None
    return (
        last is not None
        and last.type == block.type == blocks.TURNS
        and last.first == block.first
        and last.turns <= block.turns
    )


def _is_sound(source: Input, block: Block, key: int) -> bool:
    try:
        source.body(block, key)
    except BadFile:
        return False
    return True


def _copy_behind(source: Input, at: int, key: int, found: list[Block]) -> Block | None:
    """Return the first sound block behind a damaged place that replaces the last block of turns or continues it."""
    tries = 0
    for place in _places_of(source, blocks.SYNC + bytes([blocks.TURNS]), at + 1):
        block = _block_at(source, place, key)
        if block is not None and (_replaces(found, block) or block.first == turns_of(found)) and block.turns:
            if _is_sound(source, block, key):
                return block
            tries += 1
        if tries == _MOST_COPIES:
            return None
    return None


def _places_of(source: Input, mark: bytes, at: int) -> Iterator[int]:
    """Yield where these bytes are, from a place on."""
    while at < source.size:
        piece = source.read(at, min(_PIECE, source.size - at))
        place = piece.find(mark)
        while place >= 0:
            yield at + place
            place = piece.find(mark, place + 1)
        at += max(len(piece) - len(mark) + 1, 1)
