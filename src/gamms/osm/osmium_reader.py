"""Open OpenStreetMap files with osmium, in any format and order of their parts; refuse decompression bombs.

`objects.py` says which objects of a file count. Before osmium reads a file, one look finds out whether it has objects
that are deleted or given several times; only then all its objects are compared. For this look, blocks of PBF are
unpacked and XML is searched as text; neither is checked, because osmium does that. Editors mark objects as deleted in a
way of their own, and Overpass adds elements: such XML is rewritten. Files of edits instead of a map, and answers that a
server broke off, are refused.
"""

import bz2
import gzip
import re
import zlib
from array import array
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import IO, TYPE_CHECKING, NamedTuple, TypeAlias, cast
from xml.parsers import expat

import numpy as np

from gamms.arguments import as_path
from gamms.errors import BadFile, GammsError
from gamms.ir.graph import IntArray
from gamms.limits import MemoryBudget
from gamms.osm.objects import (
    NODE,
    RELATION,
    WAY,
    MapElement,
    ObjectIds,
    ObjectVersions,
    Wanted,
    find_nodes_at_two_places,
)
from gamms.plugins import require_extra
from gamms.text import shown

if TYPE_CHECKING:
    from osmium import FileProcessor, io, osm

_MapObject: TypeAlias = "osm.Node | osm.Way | osm.Relation"
_MEMORY_PER_XML = 5  # bytes that osmium takes at most for one of XML; map data shrinks 10 to 30 times
_MEMORY_PER_PBF = 16  # … for one of PBF, where a reference to a node may take one; it shrinks 2 to 5 times
WAY_OUT = (
    "Give an .osm, .xml, .osm.gz, .osm.bz2 or .osm.pbf file, "
    "such as an export from openstreetmap.org, the Overpass API or Geofabrik."
)
_PACKED = {b"\x1f\x8b": "osm.gz", b"BZh": "osm.bz2"}  # first bytes -> format
_OTHERS = {  # first bytes -> what the file is, and the way out
    b"\xff\xe0\x04o5m2": "is in the format o5m. Convert it: osmium cat map.o5m -o map.osm.pbf",
    b"\xff\xe0\x04o5c2": "holds edits of a map (o5c), not a map. Apply them to their map: osmium apply-changes",
    b"PK\x03\x04": "is a zip archive. Unpack it",
    b"\xfd7zXZ\0": "is packed by xz. Unpack it",
    b"\x28\xb5\x2f\xfd": "is packed by zstd. Unpack it",
    b"{": "is in JSON. Ask Overpass for XML ([out:xml]), or give a file of GeoJSON to graph_from_geojson",
}
_MOST_ID = 1 << 40  # greater ids are not of OpenStreetMap


def as_file(path: object) -> Path:
    """Return `path` as the path of an existing file.

    Raises:
        BadType: it is not a path.
        FileNotFoundError: the file does not exist.
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


def find_file_format(file: Path) -> str:
    """Return the format of a map file by osmium's name, judged by its first bytes.

    Raises:
        BadFile: the file is empty or of another kind.
        TooLarge: it expands absurdly.
    """
    with file.open("rb") as stream:
        head = stream.read(64)
    text = head.removeprefix(b"\xef\xbb\xbf").lstrip()
    if not text:
        raise BadFile(f"{str(file)!r} is empty. {WAY_OUT}")
    if b"OSMHeader" in head[:32]:
        # osmium unpacks a block to at most its stated size, and refuses more than 32 MiB: the sum of sizes is a bound.
        find_allowance(file).charge(_MEMORY_PER_PBF * measure_pbf(file))
        return "pbf"
    if text.startswith(b"<"):
        return "osm"
    for start, name in _PACKED.items():
        if head.startswith(start):
            return name
    for start, reason in _OTHERS.items():
        if head.startswith(start) or text.startswith(start):
            raise BadFile(f"{str(file)!r} {reason}. {WAY_OUT}")
    raise BadFile(f"{str(file)!r} is not an OpenStreetMap file: it starts with {shown(head[:16])}. {WAY_OUT}")


def find_allowance(file: Path) -> MemoryBudget:
    """Return the budget of memory for reading a map file, which ends before the next step of processing."""
    return MemoryBudget(file.stat().st_size, repr(str(file)), is_streamed=True)


def _open_file(file: Path, format: str) -> IO[bytes]:
    """Open a file of XML to read its unpacked text."""
    if format == "osm.gz":
        return cast("IO[bytes]", gzip.GzipFile(file))
    if format == "osm.bz2":
        return bz2.BZ2File(file)
    return file.open("rb")


def _unpack_text(file: Path, format: str) -> Iterator[bytes]:
    """Yield the unpacked text of a file in chunks.

    Raises:
        BadFile: it is damaged, or expands absurdly.
    """
    allowance = find_allowance(file)
    cost = 0 if format == "osm" else _MEMORY_PER_XML  # a file that is not packed is as large as it is
    try:
        with _open_file(file, format) as stream:
            while chunk := stream.read(_CHUNK):
                allowance.charge(cost * len(chunk))
                if len(chunk) == _CHUNK and b">" not in chunk:  # a single tag, which a parser has to keep
                    raise BadFile(f"{str(file)!r} is damaged: it has a tag of more than {_CHUNK} bytes.")
                yield chunk
    except (EOFError, OSError, zlib.error) as error:
        raise BadFile(f"{str(file)!r} is damaged: {error}. Download it again.") from error


class MapFile:
    """A map file as the elements in it that count, read with osmium.

    Attributes:
        name: the name of the file.
        unclear: ids of nodes that are at two places.

    Raises:
        BadFile: the file is empty, of another kind, damaged, no map but edits, or incomplete.
        TooLarge: it expands absurdly.
        MissingExtra: osmium is not installed.
    """

    def __init__(self, file: Path) -> None:
        with require_extra("Reading OpenStreetMap files", "osm"):
            import osmium
        self.name = file.name
        self._file = file
        format = find_file_format(file)
        self._opened: io.File | io.FileBuffer = osmium.io.File(str(file), format)
        if format == "pbf":
            self._has_repeats = has_pbf_repeats(file)
        else:
            found = survey_xml(_unpack_text(file, format))
            self._has_repeats = found.has_repeats
            if found.is_foreign:
                self._opened = osmium.io.FileBuffer(_as_osmium_reads(file, format), "osm")
        self._versions: dict[str, ObjectVersions] = {}
        self.unclear = frozenset[int]()
        if self._has_repeats:
            with self.convert_errors():
                self._compare()

    def get_budget(self) -> MemoryBudget:
        """Return the memory that reading may take; it is released before the next processing step."""
        return find_allowance(self._file)

    @contextmanager
    def convert_errors(self) -> Iterator[None]:
        """Turn osmium's errors into a `BadFile` with the name of the file and advice."""
        from osmium import InvalidLocationError

        try:
            yield
        except GammsError:
            raise
        except (RuntimeError, ValueError, MemoryError, OverflowError, InvalidLocationError) as error:
            raise BadFile(f"{str(self._file)!r} cannot be read as OpenStreetMap data: {error}. {WAY_OUT}") from error

    def read_elements(
        self,
        keys: Mapping[str, Collection[str]],
        ids: Collection[int] = (),
        *,
        has_places: bool = False,
        wanted: Wanted | None = None,
    ) -> Iterator[MapElement]:
        """Yield the elements that are asked for; see `MapSource`."""
        from osmium import FileProcessor, osm
        from osmium.filter import EmptyTagFilter, EntityFilter, IdFilter, KeyFilter

        bits = {NODE: osm.NODE, WAY: osm.WAY, RELATION: osm.RELATION}
        kinds = osm.WAY if ids else osm.NOTHING
        for kind in keys:
            kinds |= bits[kind]
        # Places take memory for all nodes of the file; osmium does not know which one of several counts.
        has_places = has_places and not self._has_repeats
        objects = FileProcessor(self._opened, kinds | osm.NODE if has_places else kinds)
        objects = objects.with_locations() if has_places else objects
        objects = objects.with_filter(EntityFilter(kinds))
        for kind, names in keys.items():
            by_keys = KeyFilter(*names) if names else EmptyTagFilter()
            by_keys.enable_for(bits[kind])
            objects = objects.with_filter(by_keys)
        if ids and min(ids) >= 0 and max(ids) < _MOST_ID:  # osmium's filter takes no others
            objects = objects.with_filter(IdFilter(ids))
        for one in self._list_current_objects(objects):
            tags = {tag.k: tag.v for tag in one.tags}
            if (not ids or one.id in ids) and (wanted is None or wanted(one.type_str(), tags)):
                yield _as_element(one, tags, has_places=has_places)

    def read_nodes(self) -> Iterator[tuple[int, int, int]]:
        """Yield all nodes; see `MapSource`."""
        from osmium import FileProcessor, osm

        for one in self._list_current_objects(FileProcessor(self._opened, osm.NODE)):
            place = cast("osm.Node", one).location
            yield one.id, place.x, place.y

    def _list_current_objects(self, objects: "FileProcessor") -> "Iterator[_MapObject]":
        """Yield the objects that are not deleted, in the version that counts."""
        for one in cast("Iterator[_MapObject]", iter(objects)):
            is_last = not self._versions or self._versions[one.type_str()].is_counted(one.id, one.version)
            if is_last and not one.deleted:
                yield one

    def _compare(self) -> None:
        """Find the versions that count of objects that are deleted or given several times."""
        from osmium import FileProcessor, osm

        columns: dict[str, tuple[array[int], array[int], array[int]]] = {}
        x = array("q")
        y = array("q")
        every = FileProcessor(self._opened, osm.NODE | osm.WAY | osm.RELATION)
        for one in cast("Iterator[_MapObject]", iter(every)):
            ids, versions, deleted = columns.setdefault(one.type_str(), (array("q"), array("q"), array("q")))
            ids.append(one.id)
            versions.append(one.version)
            deleted.append(one.deleted)
            if one.is_node():
                place = cast("osm.Node", one).location
                x.append(place.x)
                y.append(place.y)
        for kind, given in columns.items():
            numbers, versions_of, are_deleted = (np.array(one, np.int64) for one in given)
            self._versions[kind] = ObjectVersions(numbers, versions_of, are_deleted.astype(np.bool_))
            if kind == NODE:
                rows = self._versions[kind].are_counting(numbers, versions_of)
                places = np.column_stack((np.array(x, np.int64), np.array(y, np.int64)))
                self.unclear = find_nodes_at_two_places(numbers[rows], places[rows])


def _as_element(one: "_MapObject", tags: dict[str, str], *, has_places: bool) -> MapElement:
    if one.is_node():
        return MapElement(NODE, one.id, tags)
    if one.is_relation():
        members = [(part.type, part.ref, part.role) for part in cast("osm.Relation", one).members]
        return MapElement(RELATION, one.id, tags, members=members)
    nodes = list(cast("osm.Way", one).nodes)
    places = [(node.location.x, node.location.y) for node in nodes] if has_places else ()
    return MapElement(WAY, one.id, tags, [node.ref for node in nodes], places)


def _as_osmium_reads(file: Path, format: str) -> bytes:
    """Return the text of a map file as osmium reads it.

    Raises:
        BadFile: it is no XML, or no complete map.
        TooLarge: it expands absurdly.
    """
    try:
        return rewrite_xml(_unpack_text(file, format), find_allowance(file).charge)
    except GammsError:
        raise
    except expat.ExpatError as error:
        raise BadFile(f"{str(file)!r} cannot be read as OpenStreetMap data: {error}. {WAY_OUT}") from error
    except ValueError as error:
        raise BadFile(f"{str(file)!r} cannot be used: {error}. {WAY_OUT}") from None


# -- the look through a file -------------------------------------------------------------------------------------

_CHUNK = 1 << 20  # bytes; no tag is longer
_VERSION = "0.6"
_OBJECTS = ("node", "way", "relation")
_PARTS = ("nd", "tag", "member")  # of objects
_EDITS = ("osmChange", "create", "modify", "delete", "action")  # elements of files that hold edits
_ATTRIBUTES = ("id", "version", "visible", "lat", "lon")  # of objects, that matter to a map
_BYTES_PER_PLACE = 400  # of memory
_MOST_TEXT = 200  # characters of a server's remark in an error
_FOREIGN_AT_FIRST = re.compile(rb"<(?!(?:osm|bounds|note|meta)[\s/>])[A-Za-z]")
_FOREIGN = re.compile(rb"<(?!(?:node|way|relation|nd|tag|member)[\s/>])[A-Za-z]")
_OBJECT = re.compile(rb"<(?:node|way|relation)[\s/>]")
_ROOT = re.compile(rb"<osm(?=[\s>])[^<>]*>")
_KNOWN_ROOT = re.compile(rb"\sversion\s*=\s*[\"']0\.6[\"']")
_DELETED = re.compile(rb"\s(?:(action)\s*=\s*[\"']delete|visible\s*=\s*[\"']false)")
_IDS = {kind: re.compile(rb"<%b\s[^<>]*?\bid\s*=\s*[\"'](-?\d{1,18})[\"']" % kind.encode()) for kind in _OBJECTS}


class XmlSurvey(NamedTuple):
    """The peculiarities of a file.

    Attributes:
        is_foreign: osmium would refuse or misunderstand it; `rewrite_xml` does not.
        has_repeats: it may have objects that are deleted or given several times.
    """

    is_foreign: bool
    has_repeats: bool


def survey_xml(chunks: Iterable[bytes]) -> XmlSurvey:
    """Look through the text of a file once. Text that only looks peculiar, such as in a comment, counts, too."""
    ids = ObjectIds()
    is_foreign = False
    is_special = False
    root: bytes | None = None
    is_in_head = True
    for chunk in _split_between_tags(chunks):
        if root is None and (found := _ROOT.search(chunk)):
            root = found[0]
            is_foreign = is_foreign or not _KNOWN_ROOT.search(root)
        if b"delete" in chunk or b"false" in chunk:
            marks = {one[1] for one in _DELETED.finditer(chunk)}
            is_special = is_special or bool(marks)
            is_foreign = is_foreign or b"action" in marks
        head = 0
        if is_in_head:
            found = _OBJECT.search(chunk)
            head = found.start() if found else len(chunk)
            is_in_head = found is None
        has_others = _FOREIGN_AT_FIRST.search(chunk, 0, head) or _FOREIGN.search(chunk, head)
        places = chunk.count(b" lat=") - chunk.count(b"<node")
        is_foreign = is_foreign or places > 0 or has_others is not None
        for kind, pattern in _IDS.items():
            numbers = pattern.findall(chunk)
            is_special = is_special or len(numbers) != chunk.count(b"<" + kind.encode())
            ids.add(kind, np.array([*map(int, numbers)], np.int64))
    return XmlSurvey(is_foreign, is_special or ids.has_repeats())


def _split_between_tags(chunks: Iterable[bytes]) -> Iterator[bytes]:
    """Yield the text of a file in chunks that end between tags."""
    rest = b""
    for chunk in chunks:
        text = rest + chunk
        cut = text.rfind(b"<")
        is_whole = cut < 0 or b">" in text[cut:]
        cut = len(text) if is_whole else cut
        rest = text[cut:]
        yield text[:cut]
    yield rest


def rewrite_xml(chunks: Iterable[bytes], charge: Callable[[int], None]) -> bytes:
    """Return the map in a file as osmium reads it.

    Objects that an editor has deleted are marked as OpenStreetMap marks them. A node whose place is given only in its
    ways becomes a node of the map. Elements that are no part of a map are left out.

    Args:
        chunks: the text.
        charge: counts the bytes of memory.

    Raises:
        ValueError: the file holds edits, is incomplete, or of another version.
        expat.ExpatError: it is no XML.
    """
    rewriter = _Rewriter(charge)
    for chunk in chunks:
        rewriter.parser.Parse(chunk, False)
    rewriter.parser.Parse(b"", True)
    return rewriter.get_text()


class _Rewriter:
    """Writes a map while a parser reads it.

    Args:
        charge: counts the bytes of memory.
    """

    def __init__(self, charge: Callable[[int], None]) -> None:
        self._charge = charge
        self._out: list[str] = [f'<osm version="{_VERSION}">']
        self._path: list[str] = []  # names of the open elements
        self._remark = ""
        self._nodes: set[str] = set()
        self._placed: dict[str, tuple[str, str]] = {}  # id of a node -> latitude and longitude
        self.parser = expat.ParserCreate()
        self.parser.StartElementHandler = self._start
        self.parser.EndElementHandler = self._end
        self.parser.CharacterDataHandler = self._read_text
        self.parser.EntityDeclHandler = _refuse_entity

    def get_text(self) -> bytes:
        """Return the whole map."""
        for ref, (lat, lon) in self._placed.items():
            if ref not in self._nodes:
                self._write(_tag("node", {"id": ref, "lat": lat, "lon": lon}) + "</node>")
        return "".join([*self._out, "</osm>"]).encode()

    def _write(self, text: str) -> None:
        self._charge(2 * len(text))
        self._out.append(text)

    def _start(self, name: str, given: dict[str, str]) -> None:
        depth = len(self._path)
        self._path.append(name)
        if depth == 0:
            _check_root(name, given)
        elif depth == 1:
            self._start_object(name, given)
        elif depth == 2 and name in _PARTS and self._path[1] in _OBJECTS:
            self._write_part(name, given)

    def _start_object(self, name: str, given: dict[str, str]) -> None:
        if name in _EDITS:
            raise ValueError(_find_edits(name))
        if name not in _OBJECTS:
            return
        kept = {key: given[key] for key in _ATTRIBUTES if key in given}
        if given.get("action") == "delete":
            kept["visible"] = "false"
        if name == "node":
            self._nodes.add(given.get("id", ""))
        self._write(_tag(name, kept))

    def _write_part(self, name: str, given: dict[str, str]) -> None:
        if name == "nd" and "ref" in given and "lat" in given and "lon" in given:
            self._charge(2 * len(given["ref"]) + _BYTES_PER_PLACE)
            self._placed.setdefault(given["ref"], (given["lat"], given["lon"]))
            given = {"ref": given["ref"]}
        self._write(_tag(name, given) + f"</{name}>")

    def _read_text(self, text: str) -> None:
        if self._path[1:2] == ["remark"]:
            self._remark += text[: _MOST_TEXT - len(self._remark)]

    def _end(self, name: str) -> None:
        self._path.pop()
        if len(self._path) == 1 and name in _OBJECTS:
            self._write(f"</{name}>")
        elif len(self._path) == 1 and name == "remark":
            raise ValueError(make_incomplete_error(self._remark))


def make_incomplete_error(remark: str) -> str:
    """Return the error for an answer that a server broke off, with its remark."""
    return (
        f"it is incomplete; the server reports {remark.strip()[:_MOST_TEXT]!r}. Ask for a smaller area, or with more "
        "time and memory ([timeout:600][maxsize:2000000000])"
    )


def _check_root(name: str, given: dict[str, str]) -> None:
    """Check the outermost element of a file.

    Raises:
        ValueError: it is not that of a map.
    """
    if name in _EDITS:
        raise ValueError(_find_edits(name))
    if name != "osm":
        raise ValueError(f"it begins with the element <{name:.40}>, and maps with <osm>")
    version = given.get("version")
    if version != _VERSION:
        said = "no version" if version is None else f"version={shown(version)}"
        raise ValueError(
            f'its first element, <osm>, has {said}. Change it to <osm version="{_VERSION}"> in a text editor'
        )


def _find_edits(name: str) -> str:
    return (
        f"it holds edits of a map (<{name}>), not a map. Apply them to their map: "
        "osmium apply-changes map.osm.pbf changes.osc -o new.osm.pbf"
    )


def _refuse_entity(*_: object) -> None:
    raise ValueError("it declares entities, which maps do not need")


def _tag(name: str, attributes: dict[str, str]) -> str:
    """Return the start tag of an element."""
    from xml.sax.saxutils import quoteattr  # which loads HTTP

    return "".join([f"<{name}", *(f" {key}={quoteattr(text)}" for key, text in attributes.items()), ">"])


# -- PBF: https://wiki.openstreetmap.org/wiki/PBF_Format ---------------------------------------------------------

_MOST_HEADER = 64 << 10  # bytes, by the format
_MOST_BLOB = 32 << 20
_TYPE = 1  # field numbers: of BlobHeader
_DATA_SIZE = 3
_RAW = 1  # of Blob
_RAW_SIZE = 2
_ZLIB = 3
_GROUP = 2  # of PrimitiveBlock
_NODES = 1  # of PrimitiveGroup
_DENSE = 2
_WAY = 3
_RELATION = 4
_ID = 1  # of objects
_KINDS = {_NODES: "node", _DENSE: "node", _WAY: "way", _RELATION: "relation"}
_BITS = 7  # of a number in each byte
_MOST_SHIFT = 63


class _Blob(NamedTuple):
    type: bytes
    content: bytes


def measure_pbf(file: Path) -> int:
    """Return the unpacked bytes of all blocks."""
    return sum(_read_number(blob.content, _RAW_SIZE) for blob in _read_blobs(file))


def has_pbf_repeats(file: Path) -> bool:
    """Return whether an object is there several times; also True if this cannot be known."""
    ids = ObjectIds()
    try:
        for blob in _read_blobs(file):
            if blob.type == b"OSMData":
                for kind, some in _read_ids(_unpack_block(blob.content)):
                    ids.add(kind, some)
    except (ValueError, IndexError, OverflowError, zlib.error):
        return True
    return ids.has_repeats()


def _read_blobs(file: Path) -> Iterator[_Blob]:
    with file.open("rb") as stream:
        while len(start := stream.read(4)) == 4:
            size = int.from_bytes(start, "big")
            header = stream.read(size) if size <= _MOST_HEADER else b""
            blob_size = _read_number(header, _DATA_SIZE)
            if not header or blob_size > _MOST_BLOB:
                return
            yield _Blob(_read_bytes(header, _TYPE), stream.read(blob_size))


def _unpack_block(blob: bytes) -> bytes:
    """Return the content of a block.

    Raises:
        ValueError: it is packed in another way than zlib.
        zlib.error: it is damaged.
    """
    packed = _read_bytes(blob, _ZLIB)
    if packed:
        return zlib.decompressobj().decompress(packed, _MOST_BLOB)
    raw = _read_bytes(blob, _RAW)
    if not raw:
        raise ValueError("an unknown compression")
    return raw


def _read_ids(block: bytes) -> Iterator[tuple[str, IntArray]]:
    for group in (part for field, part in _read_parts(block) if field == _GROUP):
        single: dict[str, list[int]] = {}
        for field, part in _read_parts(group):
            if field == _DENSE:
                yield _KINDS[field], np.cumsum(_decode_signed(_read_varints(_read_bytes(part, _ID))))
            elif field in _KINDS:
                single.setdefault(_KINDS[field], []).append(next(_read_numbers(part, _ID), 0))
        for kind, numbers in single.items():
            ids = np.array(numbers, np.uint64).astype(np.int64)
            yield kind, _decode_signed(ids) if kind == "node" else ids


def _read_varints(data: bytes) -> IntArray:
    """Return the unsigned numbers in a packed field."""
    given = np.frombuffer(data, np.uint8)
    ends = np.flatnonzero(given < 1 << _BITS)
    starts = np.append(0, ends[:-1] + 1)[: len(ends)]
    sizes = ends - starts + 1
    values = np.zeros(len(ends), np.int64)
    for place in range(sizes.max(initial=0)):
        there = np.flatnonzero(sizes > place)
        digits = given[starts[there] + place].astype(np.int64) & 127
        values[there] |= digits << (_BITS * place)
    return values


def _decode_signed(numbers: IntArray) -> IntArray:
    """Return numbers from the form in which small negative ones are short, too."""
    return ((numbers >> 1) & np.int64(2**63 - 1)) ^ -(numbers & 1)


def _read_number(message: bytes, field: int) -> int:
    """Return the integer in this field of a message, which is the last one; 0 without any."""
    return max(enumerate(_read_numbers(message, field)), default=(0, 0))[1]


def _read_numbers(message: bytes, field: int) -> Iterator[int]:
    return (value for name, value in _read_fields(message) if name == field and isinstance(value, int))


def _read_bytes(message: bytes, field: int) -> bytes:
    """Return all bytes in this field of a message."""
    return b"".join(value for name, value in _read_parts(message) if name == field)


def _read_parts(message: bytes) -> Iterator[tuple[int, bytes]]:
    return ((name, value) for name, value in _read_fields(message) if isinstance(value, bytes))


def _read_fields(message: bytes) -> Iterator[tuple[int, int | bytes]]:
    """Yield the integers and the bytes in a message with their fields, up to a value of another type."""
    at = 0
    while at < len(message):
        key, at = _read_varint(message, at)
        value, at = _read_varint(message, at)
        if key & 7 == 0:
            yield key >> 3, value
        elif key & 7 == 2:
            yield key >> 3, message[at : at + value]
            at += value
        else:
            return


def _read_varint(message: bytes, at: int) -> tuple[int, int]:
    """Return the number that begins here, and where the next field begins."""
    value = 0
    shift = 0
    while at < len(message):
        byte = message[at]
        at += 1
        if byte < 1 << _BITS:
            return value | byte << shift, at
        value |= (byte & 127) << shift
        shift += _BITS
        if shift > _MOST_SHIFT:
            break
    return value, len(message)
