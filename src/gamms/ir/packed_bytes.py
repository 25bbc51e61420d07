"""Packed bytes and columns of integers: the parts of saved graphs, visibility tables and recordings.

Packed bytes are a size and a raw deflate stream of zlib. A column stores integers as unsigned ones (zigzag): the lowest
byte of each, then the second byte of each, and so on. `packing.py` converts plain values to packed bytes.
docs/recording-format.md describes both byte by byte.
"""

import zlib

import numpy as np

from gamms.errors import BadFile
from gamms.ir.graph import IntArray

# zlib levels: for files written once, for files written during a game
BEST = 6
FAST = 4
_LARGE = 1 << 23  # bytes; larger data are compressed with less effort
_TABLE = 9  # form of a column with a table; earlier versions wrote it for large columns
_MOST_IN_BYTE = 8  # entries of a table that fit into one byte


# -- packed bytes -----------------------------------------------------------------------------------------------


def encode_varint(value: int) -> bytes:
    """Return a non-negative number as LEB128: seven bits per byte, lowest first."""
    out = bytearray()
    while value > 127:
        out.append(value & 127 | 128)
        value >>= 7
    out.append(value)
    return bytes(out)


def pack_bytes(data: bytes, level: int = BEST) -> bytes:
    """Return the size of the data, followed by the data as a raw deflate stream."""
    # NOTE: for a city, the lower level takes half the time for 1 % more bytes (benchmarks: city scale).
    level = min(level, FAST) if len(data) > _LARGE else level
    deflate = zlib.compressobj(level, zlib.DEFLATED, -15)
    return b"".join((encode_varint(len(data)), deflate.compress(data), deflate.flush()))


def unpack_bytes(data: bytes, most: int) -> tuple[bytes, bytes]:
    """Unpack the data of `pack_bytes`; return it, and the bytes that follow it.

    Raises:
        BadFile: the bytes are damaged, or would decompress to more than `most` bytes.
    """
    reader = ByteReader(data)
    size = reader.read_varint()
    if size > most:
        raise BadFile(f"{size} bytes of memory are too many for the size of the file")
    inflate = zlib.decompressobj(-15)
    try:
        raw = inflate.decompress(memoryview(data)[reader.at :], size + 1)
    except zlib.error as error:
        raise BadFile(f"it cannot be decompressed ({error})") from error
    if len(raw) != size or not inflate.eof:
        raise BadFile(f"it does not decompress to the stated {size} bytes")
    return raw, inflate.unused_data


class ByteReader:
    """Reads bytes sequentially, never past their end.

    Attributes:
        data: all bytes.
        at: position of the next byte.
    """

    __slots__ = ("at", "data")

    def __init__(self, data: bytes) -> None:
        self.data = data
        self.at = 0

    def take(self, size: int) -> bytes:
        """Return the next `size` bytes.

        Raises:
            BadFile: there are fewer bytes; all methods may raise this.
        """
        if size > len(self.data) - self.at:
            raise BadFile(f"{size} bytes are stated, but only {len(self.data) - self.at} exist")
        self.at += size
        return self.data[self.at - size : self.at]

    def read_varint(self) -> int:
        """Return the next number."""
        value = 0
        for shift in range(0, 63, 7):
            (byte,) = self.take(1)
            value |= (byte & 127) << shift
            if byte < 128:
                return value
        raise BadFile("a number is too long")

    def read_column(self, size: int) -> IntArray:
        """Return the next column, which must have `size` items."""
        (count,) = self.take(1)
        if count != _TABLE:
            return self._read_integers(count, size)
        last, count = self.take(2)
        base = last + 1
        entries = np.cumsum(self._read_integers(count, base))
        (each,) = self.take(1)
        if not 1 <= each <= _MOST_IN_BYTE or base**each > 256:
            raise BadFile(f"a byte cannot have {each} of {base} entries")
        groups = np.frombuffer(self.take(-(-size // each)), np.uint8)
        if not size or int(groups.max()) >= base**each:
            raise BadFile(f"a column of {size} numbers does not fit its table of {base} entries")
        of_byte: IntArray = entries[np.arange(256)[:, None] // base ** np.arange(each) % base]  # (256, each)
        return of_byte[groups].reshape(-1)[:size]

    def _read_integers(self, count: int, size: int) -> IntArray:
        """Return integers of `count` bytes each."""
        if count > 8 or (count == 0) != (size == 0):
            raise BadFile(f"a column of {size} numbers cannot have the form {count}")
        planes = np.frombuffer(self.take(count * size), np.uint8).reshape(count, size)
        width = 1 << max(count - 1, 0).bit_length()  # NOTE: narrow integers take half the time of wide ones
        wide = np.zeros((size, width), np.uint8)
        wide[:, :count] = planes.T
        zigzag = wide.view(f"<u{width}").reshape(-1)
        return ((zigzag >> 1) ^ -(zigzag & 1)).astype(f"u{width}").view(f"i{width}").astype(np.int64)

    def read_sums(self, size: int) -> IntArray:
        """Return the running sums of the next column, which holds differences."""
        return np.cumsum(self.read_column(size), dtype=np.int64)

    def finish(self) -> None:
        """Raise BadFile if bytes are left over."""
        if self.at != len(self.data):
            raise BadFile(f"{len(self.data) - self.at} bytes are left over")


# -- columns ----------------------------------------------------------------------------------------------------


def compute_differences(numbers: IntArray) -> IntArray:
    """Return the differences of consecutive numbers, the first from 0, with wraparound at 64 bits."""
    differences = numbers.copy()
    differences[1:] -= numbers[:-1]
    return differences


def encode_column(numbers: IntArray) -> bytes:
    """Encode integers as a column."""
    if not len(numbers):
        return b"\0"
    low = int(numbers.min())
    high = int(numbers.max())
    largest = max(2 * high, -2 * low - 1)  # after zigzag
    count = max(1, (largest.bit_length() + 7) // 8)
    bits = 32 if largest < 1 << 32 else 64  # NOTE: narrow integers take half the time (benchmarks: teams, recorded).
    wide = numbers.astype(f"i{bits >> 3}", copy=False)
    zigzag = ((wide << 1) ^ (wide >> (bits - 1))).view(f"u{bits >> 3}")
    # NOTE: a shift for each byte takes a fifth of the time of a copy of every eighth byte (benchmarks: teams).
    planes = ((zigzag >> zigzag.dtype.type(8 * place)).astype(np.uint8) for place in range(count))
    return b"".join([bytes([count]), *(plane.tobytes() for plane in planes)])
