"""How large the blocks of a PBF file say they are, unpacked: read from its frame, without unpacking anything.

https://wiki.openstreetmap.org/wiki/PBF_Format: four bytes of length, a BlobHeader, a Blob, and again.
"""

from collections.abc import Iterator
from pathlib import Path

_MOST_HEADER = 64 << 10  # bytes, as the format says
_MOST_BLOB = 32 << 20
_DATA_SIZE, _RAW_SIZE = 3, 2  # numbers of fields in BlobHeader and in Blob


def unpacked_size(file: Path) -> int:
    """The bytes of all blocks together. A damaged frame ends the count: its reader will say so."""
    return sum(_block_sizes(file))


def _block_sizes(file: Path) -> Iterator[int]:
    with file.open("rb") as stream:
        while len(start := stream.read(4)) == 4:
            size = int.from_bytes(start, "big")
            if size > _MOST_HEADER:
                return
            blob_size = _fields(stream.read(size)).get(_DATA_SIZE, 0)
            if blob_size > _MOST_BLOB:
                return
            yield _fields(stream.read(blob_size)).get(_RAW_SIZE, 0)


def _fields(message: bytes) -> dict[int, int]:
    """The whole numbers of a protobuf message, by field."""
    found: dict[int, int] = {}
    at = 0
    while at < len(message):
        key, at = _varint(message, at)
        value, at = _varint(message, at)
        if key & 7 == 0:
            found[key >> 3] = value
        elif key & 7 == 2:
            at += value
        else:
            return found
    return found


def _varint(message: bytes, at: int) -> tuple[int, int]:
    value = 0
    for shift, byte in enumerate(message[at : at + 10]):
        value |= (byte & 127) << (7 * shift)
        if byte < 128:
            return value, at + shift + 1
    return value, len(message)
