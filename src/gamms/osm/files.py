"""Look at a map file before anything parses it: which format it has, and whether it is a bomb."""

import bz2
import gzip
import zlib
from collections.abc import Iterator
from pathlib import Path

from gamms.arguments import as_path
from gamms.errors import BadFile
from gamms.limits import Allowance
from gamms.text import shown

_CHUNK = 1 << 20
_MEMORY_PER_XML = 5  # bytes that osmium takes at most for one of XML; map data shrinks 10 to 30 times
_MEMORY_PER_PBF = 16  # … for one of PBF, where a reference to a node may take one; it shrinks 2 to 5 times
WAY_OUT = (
    "Give an .osm, .xml, .osm.gz, .osm.bz2 or .osm.pbf file, "
    "such as an export from openstreetmap.org, the Overpass API or Geofabrik."
)
_MOST_HEADER = 64 << 10  # bytes, as the format says
_MOST_BLOB = 32 << 20
_DATA_SIZE, _RAW_SIZE = 3, 2  # numbers of fields in BlobHeader and in Blob


def as_file(path: object) -> Path:
    """Return `path` as the path of a file that is there.

    Raises:
        BadType: it is not a path.
        FileNotFoundError: there is nothing.
        IsADirectoryError: it is a folder.
        BadFile: it is a pipe or a device.
    """
    file = as_path(path, "filepath")
    if not file.exists():
        raise FileNotFoundError(f"There is no file {str(file)!r} in {str(Path.cwd())!r}. {WAY_OUT}")
    if file.is_dir():
        raise IsADirectoryError(f"{str(file)!r} is a folder, not a map. {WAY_OUT}")
    if not file.is_file():
        raise BadFile(f"{str(file)!r} is not a regular file. {WAY_OUT}")
    return file


def file_format(file: Path) -> str:
    """Return the format of a map file in osmium's words, judged by its first bytes.

    Raises:
        BadFile: it is empty, of another kind, damaged, or expands absurdly.
    """
    with file.open("rb") as stream:
        head = stream.read(64)
    if not head:
        raise BadFile(f"{str(file)!r} is empty. {WAY_OUT}")
    if head.startswith(b"\x1f\x8b"):
        _refuse_bomb(file, gzip.GzipFile)
        return "osm.gz"
    if head.startswith(b"BZh"):
        _refuse_bomb(file, bz2.BZ2File)
        return "osm.bz2"
    if b"OSMHeader" in head[:32]:
        _refuse_pbf_bomb(file)
        return "pbf"
    if head.removeprefix(b"\xef\xbb\xbf").lstrip().startswith(b"<"):
        return "osm"
    raise BadFile(f"{str(file)!r} is not an OpenStreetMap file: it starts with {shown(head[:16])}. {WAY_OUT}")


def allowance_of(file: Path) -> Allowance:
    """Return the memory that what is read of a map file may take; it is let go before the next part is made of it."""
    return Allowance(file.stat().st_size, repr(str(file)), is_streamed=True)


def _refuse_pbf_bomb(file: Path) -> None:
    # osmium unpacks a block to no more than it says it has, and none to more than 32 MiB: their sum is a bound.
    allowance_of(file).charge(_MEMORY_PER_PBF * unpacked_size(file))


def _refuse_bomb(file: Path, unpack: type[gzip.GzipFile] | type[bz2.BZ2File]) -> None:
    allowance = allowance_of(file)
    try:
        with unpack(file) as stream:
            while chunk := stream.read(_CHUNK):
                allowance.charge(_MEMORY_PER_XML * len(chunk))
                if len(chunk) == _CHUNK and b">" not in chunk:  # a single tag, which a parser has to keep
                    raise BadFile(f"{str(file)!r} is damaged: it has a tag of more than {_CHUNK} bytes.")
    except (EOFError, OSError, zlib.error) as error:
        raise BadFile(f"{str(file)!r} is damaged: {error}. Download it again.") from error


def unpacked_size(file: Path) -> int:
    """Return the bytes of all blocks together. A damaged frame ends the count: its reader will say so."""
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
    """Return the whole numbers of a protobuf message, by field."""
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
