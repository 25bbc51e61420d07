"""Columns of integers as bytes, and back: zigzag, byte planes, deflate. Reading takes no more than it was promised.

A column is one byte, how many planes it has; then the planes, lowest byte of all items first. A plane is a varint,
twice its stored size, plus one if it is deflated; then its bytes. Varints are LEB128: seven bits a byte, lowest first.
"""

import zlib
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from gamms.errors import BadFile

IntArray = npt.NDArray[np.int64]
"""Integers of a column, (items,)."""

_FEW = 4096
_TINY = 24  # bytes, of which deflating takes more time than it could save space
_SAMPLE = 4096  # bytes that show which way of deflating a plane fits
_PIECES = 8
_OF_PATTERNS = (6, zlib.Z_DEFAULT_STRATEGY)
_TRIED_EVERY = 16
_STRATEGIES = ((1, zlib.Z_RLE), _OF_PATTERNS)  # the first for numbers without a pattern


class Cursor:
    """A place in bytes that moves on as they are read, never past their end."""

    def __init__(self, data: bytes) -> None:
        self.data = data
        self.at = 0

    def take(self, size: int) -> bytes:
        """The next `size` bytes."""
        if size > len(self.data) - self.at:
            raise BadFile(f"{size} bytes are promised and {len(self.data) - self.at} are there")
        self.at += size
        return self.data[self.at - size : self.at]

    def varint(self) -> int:
        """The next number."""
        value = 0
        for shift in range(0, 63, 7):
            (byte,) = self.take(1)
            value |= (byte & 127) << shift
            if byte < 128:
                return value
        raise BadFile("a number is too long")

    def finish(self) -> None:
        """Refuse bytes that were not read, unless they are zeros (see `blocks.padded`)."""
        rest = self.data[self.at :]
        if rest.count(0) != len(rest):
            raise BadFile(f"{len(rest)} bytes are left over")


def varint(value: int) -> bytes:
    """A number that is not negative, as bytes."""
    out = bytearray()
    while value > 127:
        out.append(value & 127 | 128)
        value >>= 7
    out.append(value)
    return bytes(out)


# -- one stretch of bytes ---------------------------------------------------------------------------------------


def packed(data: bytes) -> bytes:
    """Bytes, deflated if that is shorter."""
    return _shorter(data, min(_attempts(data), key=len) if len(data) > _TINY else data)


def _shorter(data: bytes, deflated: bytes) -> bytes:
    if len(deflated) < len(data):
        return varint(2 * len(deflated) + 1) + deflated
    return varint(2 * len(data)) + data


class Habit:
    """How a column is deflated that is much the same in every block: the other ways are tried in every 16th of them.

    Requires: what was put before is all that it depends on; what is put for now only is put by a `copy`.
    """

    # NOTE: a second way costs a tenth of all that recording ten agents costs (benchmarks/README.md, w4).
    def __init__(self) -> None:
        self._way, self._blocks = _STRATEGIES[0], 0

    def copy(self) -> "Habit":
        """Another one, of the same experience."""
        other = Habit()
        other._way, other._blocks = self._way, self._blocks
        return other

    def packed(self, data: bytes) -> bytes:
        """Bytes, deflated if that is shorter; see the function of this name."""
        if not _TINY < len(data) <= 2 * _SAMPLE:
            return packed(data)
        if self._blocks % _TRIED_EVERY == 0:
            self._way = min(_STRATEGIES, key=lambda way: len(_deflated(data, *way)))
        self._blocks += 1
        return _shorter(data, _deflated(data, *self._way))


def unpacked(cursor: Cursor, size: int) -> bytes:
    """The next packed bytes, which must be `size`.

    Raises:
        BadFile: they are not.
    """
    mark = cursor.varint()
    data = cursor.take(mark >> 1)
    if mark & 1:
        data = _inflated(data, size)
    if len(data) != size:
        raise BadFile(f"{len(data)} bytes came out where {size} are promised")
    return data


def _attempts(data: bytes) -> list[bytes]:
    if 8 * data.count(data[:1]) > 7 * len(data):
        return [_deflated(data, *_OF_PATTERNS)]  # NOTE: whose turns are alike, which saves half the time
    if len(data) <= 2 * _SAMPLE:
        return [_deflated(data, *strategy) for strategy in _STRATEGIES]
    pieces = (data[at : at + _SAMPLE // _PIECES] for at in range(0, len(data), len(data) // _PIECES))
    sample = b"".join(pieces)  # from all over, for a value is not alike everywhere
    best = min(_STRATEGIES, key=lambda strategy: len(_deflated(sample, *strategy)))
    return [_deflated(data, *best)]


def _deflated(data: bytes, level: int, strategy: int) -> bytes:
    # NOTE: what zlib sets up for a whole file takes longer than all else for a few bytes (benchmarks/README.md, w4).
    window, memory = (-15, 9) if len(data) > _FEW else (-12, 4)
    deflate = zlib.compressobj(level, zlib.DEFLATED, window, memory, strategy)
    return deflate.compress(data) + deflate.flush()


def _inflated(data: bytes, size: int) -> bytes:
    inflate = zlib.decompressobj(-15)
    try:
        raw = inflate.decompress(data, size + 1)
    except zlib.error as error:
        raise BadFile(f"it cannot be decompressed ({error})") from error
    if not inflate.eof or inflate.unused_data:
        raise BadFile(f"it does not decompress to the {size} bytes that are promised")
    return raw


# -- planes -----------------------------------------------------------------------------------------------------


def planes_of(array: np.ndarray[Any, Any]) -> bytes:
    """The first bytes of all items, then all second bytes, and so on; little-endian."""
    flat = np.ascontiguousarray(array.reshape(-1).astype(array.dtype.newbyteorder("<"), copy=False))
    return flat.view(np.uint8).reshape(-1, array.dtype.itemsize).T.tobytes()


def from_planes(planes: bytes, dtype: np.dtype[Any]) -> np.ndarray[Any, Any]:
    """The items again, (items,)."""
    items = np.frombuffer(planes, np.uint8).reshape(dtype.itemsize, -1).T.copy()
    return items.view(dtype.newbyteorder("<")).reshape(-1).astype(dtype, copy=False)


# -- columns ----------------------------------------------------------------------------------------------------


def put(column: IntArray, pack: Callable[[bytes], bytes] = packed) -> bytes:
    """A column as bytes; `pack` deflates its lowest bytes."""
    if not len(column):
        return b"\0"
    zigzag = ((column << 1) ^ (column >> 63)).view(np.uint64)
    count = max(1, (int(zigzag.max()).bit_length() + 7) // 8)
    if count == 1:
        return b"\1" + pack(zigzag.astype(np.uint8).tobytes())
    planes = zigzag.astype("<u8", copy=False).view(np.uint8).reshape(-1, 8)
    packs = (pack, *[packed] * (count - 1))
    return bytes([count]) + b"".join(one(planes[:, i].tobytes()) for i, one in enumerate(packs))


def put_list(numbers: list[int]) -> bytes:
    """A column from a list, as bytes."""
    if numbers and min(numbers) == max(numbers):
        return _put_equal(numbers[0], len(numbers))
    return put(np.array(numbers, np.int64))


@lru_cache(maxsize=64)
def _put_equal(number: int, count: int) -> bytes:
    # NOTE: most blocks have as many moves in each of their turns as the one before (benchmarks/README.md, w4).
    return put(np.full(count, number, np.int64))


def take(cursor: Cursor, size: int) -> IntArray:
    """The next column, which must have `size` items.

    Raises:
        BadFile: it has not.
    """
    (count,) = cursor.take(1)
    if count > 8 or (count == 0) != (size == 0):
        raise BadFile(f"a column of {size} numbers cannot have {count} planes")
    width = 1 << max(count - 1, 0).bit_length()  # NOTE: narrow numbers take half the time of wide ones
    wide = np.zeros((size, width), np.uint8)
    for i in range(count):
        wide[:, i] = np.frombuffer(unpacked(cursor, size), np.uint8)
    whole = wide.view(f"<u{width}").reshape(-1)
    numbers: IntArray = ((whole >> 1) ^ -(whole & 1)).astype(f"u{width}").view(f"i{width}").astype(np.int64)
    return numbers
