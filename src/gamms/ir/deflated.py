"""Packed bytes, and columns of integers: what saved graphs, sight tables and recordings are made of.

Packed bytes are deflated, and inflated to a promised size. A column has differences or the integers themselves, by
zigzag: the bytes of each place side by side, or a table and numbers of its entries. `packing.py` puts plain values into
packed bytes. docs/recording-format.md describes all of it byte by byte.
"""

import zlib
from collections.abc import Iterable, Iterator, Sequence
from functools import cached_property
from itertools import groupby, pairwise
from operator import itemgetter
from typing import Any

import numpy as np
import numpy.typing as npt

from gamms.errors import BadFile
from gamms.ir.graph import IntArray

Array = npt.NDArray[Any]
"""An array of any numbers."""

_LARGE = 1 << 23  # bytes; more are deflated with less effort
_END = b"\3\0"  # of a stream that has whole bytes
_NOTHING = b"\0" + _END  # no bytes, as `packed` returns them

_TABLE = 9  # instead of how many bytes the integers of a column need: it has a table
_MOST_ENTRIES, _MOST_IN_BYTE = 256, 8  # of a table; numbers of them in a byte
_ITEMS_AT_ONCE = 16_800  # no power of two, by which columns of a table share lines of the cache
_MOST_COUNTED = 1 << 21  # of larger integers no table is made
_EVEN_BITS = range(3, 8)  # of codes that all have as many: those of 8 are no shorter than bytes
_BYTES_OF_COUNTED = 7  # of so many one is counted to see which are how frequent
_MOST_OF_TABLE = 1 << 10  # bytes in front of numbers, which are not like them
LARGE_COLUMN = 1 << 15  # bytes, as far back as deflate looks: from here on it pays to ask how a column is packed best

# -- packed bytes -----------------------------------------------------------------------------------------------


def varint(value: int) -> bytes:
    """Return a number that is not negative, as LEB128: seven bits a byte, lowest first."""
    out = bytearray()
    while value > 127:
        out.append(value & 127 | 128)
        value >>= 7
    out.append(value)
    return bytes(out)


def packed(data: bytes) -> bytes:
    """Return the size of bytes, and the bytes deflated."""
    if not data:
        return _NOTHING
    # NOTE: half the time and 1 % more bytes for a city (benchmarks: city scale).
    deflate = zlib.compressobj(4 if len(data) > _LARGE else 6, zlib.DEFLATED, -15)
    return b"".join((varint(len(data)), deflate.compress(data), deflate.flush()))


class Lasting(bytes):
    """A column that is written in many blocks."""

    @cached_property
    def stream(self) -> bytes:
        """What `deflated` returns of it."""
        return deflated(self)


def packed_columns(columns: Sequence[bytes]) -> bytes:
    """Return columns as packed bytes: small ones deflated together, each large one in the way that suits it."""
    groups = groupby(enumerate(columns), lambda one: one[0] if len(one[1]) >= LARGE_COLUMN else -1)
    *others, last = ([column for _, column in some] for _, some in groups)
    size = varint(sum(map(len, columns)))
    streams = (
        some[0].stream if isinstance(some[0], Lasting) and len(some[0]) >= LARGE_COLUMN else deflated(b"".join(some))
        for some in others
    )
    return b"".join((size, *streams, deflated(b"".join(last), zlib.Z_FINISH)))


def joined(size: int, parts: Iterable[bytes], are_deflated: Iterable[bool]) -> bytes:
    """Return parts as packed bytes.

    Args:
        size: of all of them, in bytes.
        parts: as they are, or as `deflated` returns them.
        are_deflated: which of them are.
    """
    groups = groupby(zip(are_deflated, parts, strict=True), itemgetter(0))
    streams = ((is_done, b"".join(part for _, part in some)) for is_done, some in groups)
    return b"".join((varint(size), *(one if is_done else deflated(one) for is_done, one in streams), _END))


def deflated(columns: bytes, flush: int = zlib.Z_SYNC_FLUSH) -> bytes:
    """Return bytes deflated in the way that suits them; the stream ends for good, or with a whole byte, and goes on."""
    if len(columns) < LARGE_COLUMN or (plain := _sampled(columns, zlib.Z_RLE)) > 1.08 * _sampled(columns):
        return _deflate(columns, zlib.Z_FILTERED, flush)
    # NOTE: where few patterns are found it takes a fifth of the time to look for none, and a fifth of that again where
    # codes of different lengths save nothing (benchmarks: teams).
    table, numbers = columns[:_MOST_OF_TABLE], columns[_MOST_OF_TABLE:]
    bits = _even_bits(numbers)
    if bits and bits * LARGE_COLUMN // 32 <= 1.01 * plain:
        return _deflate(table, zlib.Z_FILTERED, zlib.Z_SYNC_FLUSH) + _evenly_coded(numbers, bits, flush)
    return _deflate(columns, zlib.Z_RLE, flush)


def _even_bits(data: bytes) -> int:
    """Return how many bits codes have that all have as many, and take no more than others would; 0: there are none."""
    array = np.frombuffer(data, np.uint8)
    bits = (int(array.max()) + 1).bit_length()
    counts = np.bincount(array[::_BYTES_OF_COUNTED])
    shares = counts[counts > 0] / counts.sum()
    return bits if bits in _EVEN_BITS and bits <= -1.02 * float((shares * np.log2(shares)).sum()) else 0


def _evenly_coded(data: bytes, bits: int, flush: int) -> bytes:
    """Return bytes below 2**bits - 1 deflated by a Huffman code of so many bits for each of them, and for the end."""
    end = (1 << bits) - 1  # the code of the end: the greatest
    # A dynamic block of 257 codes for bytes and one for distances. The length of each, `bits` or 0, takes a bit; the 15
    # codes of lengths stand in front of that, in the first 62 bits.
    lengths = (1 << end) - 1 | 1 << 256
    head = 4 | 11 << 13 | 1 << 26 | 1 << 17 + 3 * (19 - 2 * bits) | lengths << 62
    codes = bytes(int(f"{byte:0{bits}b}"[::-1], 2) for byte in range(end)).ljust(256, b"\0")
    whole = len(data) & -8
    eights = np.frombuffer(data[:whole].translate(codes), "<u8")
    for size in (8, 16, 32):  # the second of two codes is moved to the end of the first
        firsts = np.uint64(sum((1 << size) - 1 << at for at in range(0, 64, 2 * size)))
        eights = eights & firsts | (eights & ~firsts) >> np.uint64(size * (8 - bits) // 8)
    body = eights.view(np.uint8).reshape(-1, 8)[:, :bits].tobytes()
    aligned = end.to_bytes((bits + 10) // 8, "little") + b"\0\0\xff\xff"  # by a stored block of nothing
    return b"".join((head.to_bytes(40, "little"), body, aligned, _deflate(data[whole:], zlib.Z_FILTERED, flush)))


def _sampled(column: bytes, strategy: int = zlib.Z_FILTERED) -> int:
    """Return how many bytes the last quarter of the first 32 KiB takes, deflated after those before it."""
    begin = min(len(column), LARGE_COLUMN) * 3 // 4
    return len(_deflate(column[begin:LARGE_COLUMN], strategy, before=column[:begin]))


def _deflate(data: bytes, strategy: int, flush: int = zlib.Z_FINISH, before: bytes = b"") -> bytes:
    deflate = zlib.compressobj(4, zlib.DEFLATED, -15, 8, strategy, before)
    return deflate.compress(data) + deflate.flush(flush)


def unpacked(data: bytes, most: int) -> tuple[bytes, bytes]:
    """Return what `packed` got, and the bytes that follow it.

    Raises:
        BadFile: the bytes are damaged, or would inflate to more than `most`.
    """
    reader = ByteReader(data)
    size = reader.varint()
    if size > most:
        raise BadFile(f"{size} bytes of memory are far more than the size of the file explains")
    inflate = zlib.decompressobj(-15)
    try:
        raw = inflate.decompress(memoryview(data)[reader.at :], size + 1)
    except zlib.error as error:
        raise BadFile(f"it cannot be decompressed ({error})") from error
    if len(raw) != size or not inflate.eof:
        raise BadFile(f"it does not decompress to the {size} bytes that are promised")
    return raw, inflate.unused_data


class ByteReader:
    """Reads bytes from front to back, never past their end.

    Attributes:
        at: where the next one is.
    """

    __slots__ = ("at", "data")

    def __init__(self, data: bytes) -> None:
        self.data, self.at = data, 0

    def take(self, size: int) -> bytes:
        """Return the next `size` bytes.

        Raises:
            BadFile: they are not there; so do the other methods.
        """
        if size > len(self.data) - self.at:
            raise BadFile(f"{size} bytes are promised and {len(self.data) - self.at} are there")
        self.at += size
        return self.data[self.at - size : self.at]

    def varint(self) -> int:
        """Return the next number."""
        value = 0
        for shift in range(0, 63, 7):
            (byte,) = self.take(1)
            value |= (byte & 127) << shift
            if byte < 128:
                return value
        raise BadFile("a number is too long")

    def column(self, size: int) -> IntArray:
        """Return the next column, which must have `size` items."""
        (count,) = self.take(1)
        if count != _TABLE:
            return self._integers(count, size)
        last, count = self.take(2)
        entries = np.cumsum(self._integers(count, base := last + 1))
        (each,) = self.take(1)
        if not 1 <= each <= _MOST_IN_BYTE or base**each > 256:
            raise BadFile(f"a byte cannot have {each} of {base} entries")
        groups = np.frombuffer(self.take(-(-size // each)), np.uint8)
        if not size or int(groups.max()) >= base**each:
            raise BadFile(f"a column of {size} numbers does not fit its table of {base} entries")
        of_byte: IntArray = entries[np.arange(256)[:, None] // base ** np.arange(each) % base]  # (256, each)
        return of_byte[groups].reshape(-1)[:size]

    def _integers(self, count: int, size: int) -> IntArray:
        """Return integers that are there by `count` bytes each."""
        if count > 8 or (count == 0) != (size == 0):
            raise BadFile(f"a column of {size} numbers cannot have the form {count}")
        planes = np.frombuffer(self.take(count * size), np.uint8).reshape(count, size)
        width = 1 << max(count - 1, 0).bit_length()  # NOTE: narrow numbers take half the time of wide ones
        wide = np.zeros((size, width), np.uint8)
        wide[:, :count] = planes.T
        zigzag = wide.view(f"<u{width}").reshape(-1)
        return ((zigzag >> 1) ^ -(zigzag & 1)).astype(f"u{width}").view(f"i{width}").astype(np.int64)

    def sums(self, size: int) -> IntArray:
        """Return the next column, which holds differences, as what they are differences of."""
        return np.cumsum(self.column(size), dtype=np.int64)

    def finish(self) -> None:
        """Refuse bytes that were not read."""
        if self.at != len(self.data):
            raise BadFile(f"{len(self.data) - self.at} bytes are left over")


# -- columns ----------------------------------------------------------------------------------------------------


def steps(numbers: IntArray) -> IntArray:
    """Return differences from the number before, the first from 0; they wrap around at 64 bits."""
    differences = numbers.copy()
    differences[1:] -= numbers[:-1]
    return differences


def column(numbers: IntArray) -> bytes:
    """Return integers as bytes: many by a table of those that occur, if that is shorter, else each by itself."""
    if not len(numbers):
        return b"\0"
    low, high = int(numbers.min()), int(numbers.max())
    if _may_have_table(low, high, len(numbers)) and (found := _numbered(numbers, low, high)) is not None:
        return _by_table(*found)
    largest = _zigzag(low, high)
    count = max(1, (largest.bit_length() + 7) // 8)
    bits = 32 if largest < 1 << 32 else 64  # NOTE: narrow numbers take half the time of wide ones
    wide = numbers.astype(f"i{bits >> 3}", copy=False)
    zigzag = ((wide << 1) ^ (wide >> (bits - 1))).view(f"u{bits >> 3}")
    # NOTE: a shift for each byte takes a fifth of a copy of every eighth byte (benchmarks: teams).
    shifted = ((zigzag >> zigzag.dtype.type(8 * place)).astype(np.uint8) for place in range(count))
    return b"".join([bytes([count]), *(part.tobytes() for part in shifted)])


def _numbered(numbers: IntArray, low: int, high: int) -> tuple[IntArray, Array] | None:
    """Return which integers occur, ascending, and which of them each is; None if there are too many for a table.

    What the first of them are is what nearly all are; where others occur all are numbered again.
    """
    occurs, number_of = np.zeros(high - low + 1, np.bool_), np.empty(high - low + 1, np.uint8)
    chosen, news = np.empty(len(numbers), np.uint8), numbers[:LARGE_COLUMN]
    while len(news):
        occurs[news - low] = True
        found = np.flatnonzero(occurs)
        if len(found) > _MOST_ENTRIES:
            return None
        number_of.fill(_MOST_ENTRIES - 1)
        number_of[found] = np.arange(len(found))
        # NOTE: some at a time, for `take` makes wide indices of them (benchmarks: teams, recorded).
        for begin in range(0, len(numbers), LARGE_COLUMN):
            some = slice(begin, begin + LARGE_COLUMN)
            number_of.take(numbers[some] - low, out=chosen[some], mode="clip")
        last = numbers[chosen == _MOST_ENTRIES - 1]
        news = last[~occurs[last - low]]
    return found + low, chosen


def column_of_changes(arrays: Sequence[IntArray]) -> bytes:
    """Return the column of how much each item of an array differs from that in the one before, item by item.

    Args:
        arrays: (items,) each, at least one.
    """
    found = _numbered_changes(arrays) if len(arrays) > 1 else None
    if found is not None:
        return _by_table(*found)
    changes = np.empty((len(arrays[0]), len(arrays) - 1), np.result_type(*arrays))
    for some in _some_at_once(len(changes)):
        changes[some] = np.diff([one[some] for one in arrays], axis=0).T
    return column(changes.reshape(-1))


def _numbered_changes(arrays: Sequence[IntArray]) -> tuple[IntArray, Array] | None:
    """Return what `_numbered` returns of such a column, or None where others than the first items change otherwise."""
    # NOTE: what the cache holds, and bytes of it, take a third of the time of all differences (benchmarks: teams).
    pairs = list(pairwise(arrays))
    found = np.unique(arrays[1][:_ITEMS_AT_ONCE] - arrays[0][:_ITEMS_AT_ONCE])
    low, high, unknown = int(found[0]), int(found[-1]), _MOST_ENTRIES - 1
    if len(found) > unknown or not _may_have_table(low, high, len(pairs) * len(arrays[0])):
        return None
    number_of = np.full(high - low + 3, unknown, np.uint8)  # at both ends what is beyond them
    number_of[found - (low - 1)] = np.arange(len(found))
    chosen = np.empty((len(arrays[0]), len(pairs)), np.uint8)
    rows = np.empty((len(pairs), _ITEMS_AT_ONCE), np.uint8)
    for some in _some_at_once(len(chosen)):
        numbers = rows[:, : len(chosen[some])]
        for (before, after), row in zip(pairs, numbers, strict=True):
            number_of.take(after[some] - before[some] - (low - 1), out=row, mode="clip")
        if numbers.max() == unknown:
            return None
        chosen[some] = numbers.T
    return found, chosen.reshape(-1)


def _some_at_once(size: int) -> Iterator[slice]:
    return (slice(begin, begin + _ITEMS_AT_ONCE) for begin in range(0, size, _ITEMS_AT_ONCE))


def _zigzag(low: int, high: int) -> int:
    """Return the largest of the unsigned integers by which these and all between them are written."""
    return max(2 * high, -2 * low - 1)


def _may_have_table(low: int, high: int, size: int) -> bool:
    """Return whether it may pay for so many integers within these bounds."""
    largest = _zigzag(low, high)
    count = (largest.bit_length() + 7) // 8
    return count > 1 and count * size >= LARGE_COLUMN and largest < _MOST_COUNTED


def _by_table(found: IntArray, chosen: Array) -> bytes:
    """Return integers as bytes, of which only some occur."""
    table = column(steps(found))  # too short to have one itself
    return b"".join((bytes([_TABLE, len(found) - 1]), table, _grouped(chosen, len(found))))


def _grouped(numbers: Array, base: int) -> bytes:
    """Return how many numbers below a base are in each byte, and the bytes: several, unless deflate saves less then."""
    each = next(each for each in range(_MOST_IN_BYTE, 0, -1) if base**each <= 256)
    if each > 1 and len(numbers) >= LARGE_COLUMN:
        sample = numbers[:LARGE_COLUMN]
        if _sampled(_groups(sample, base, each)) <= 1.05 * _sampled(sample.tobytes()):
            return bytes([each]) + _groups(numbers, base, each)
    return b"\1" + numbers.tobytes()


def _groups(numbers: Array, base: int, each: int) -> bytes:
    """Return bytes of so many numbers each, the first of them in the lowest place; the last is filled with zeros."""
    # NOTE: a group from each number on, and then every third: half the time of every third number (benchmarks: teams).
    size = len(numbers) - each + 1
    groups = np.zeros(size, np.uint8)
    for place in reversed(range(each)):
        groups *= np.uint8(base)
        groups += numbers[place : place + size]
    rest = numbers[len(numbers) // each * each :].tolist()
    last = bytes([sum(number * base**place for place, number in enumerate(rest))]) if rest else b""
    return groups[::each].tobytes() + last
