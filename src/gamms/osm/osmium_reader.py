"""Read OpenStreetMap files with osmium, in any format and order of their parts; refuse decompression bombs."""

import bz2
import gzip
import zlib
from array import array
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, cast

import numpy as np

from gamms.arguments import as_path
from gamms.errors import BadFile, GammsError
from gamms.ir.geometry import are_inside
from gamms.ir.graph import FloatArray
from gamms.limits import MemoryBudget, refuse_above
from gamms.osm.areas import open_squares, rims_of, with_areas
from gamms.osm.footprints import (
    RING_ROLES,
    BuildingIndex,
    Outlines,
    Shapes,
    WallRules,
    footprints_of,
    is_in_the_way,
    known_parts,
    outlines_of_ways,
)
from gamms.osm.network import OsmRoads, Rule, Stops, classic_rule
from gamms.osm.tags import node_keys, node_tags
from gamms.plugins import needing
from gamms.progress import Show
from gamms.text import shown

if TYPE_CHECKING:
    from osmium import io, osm
    from shapely import Polygon

_CHUNK = 1 << 20
_MEMORY_PER_XML = 5  # bytes that osmium takes at most for one of XML; map data shrinks 10 to 30 times
_MEMORY_PER_PBF = 16  # … for one of PBF, where a reference to a node may take one; it shrinks 2 to 5 times
WAY_OUT = (
    "Give an .osm, .xml, .osm.gz, .osm.bz2 or .osm.pbf file, "
    "such as an export from openstreetmap.org, the Overpass API or Geofabrik."
)
_MOST_HEADER = 64 << 10  # bytes, by the format
_MOST_BLOB = 32 << 20
_DATA_SIZE = 3  # field numbers in BlobHeader and in Blob
_RAW_SIZE = 2


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


def file_format(file: Path) -> str:
    """Return the format of a map file by osmium's name, judged by its first bytes.

    Raises:
        BadFile: the file is empty, of another kind, damaged, or expands absurdly.
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
        # osmium unpacks a block to at most its stated size, and refuses more than 32 MiB: the sum of sizes is a bound.
        allowance_of(file).charge(_MEMORY_PER_PBF * unpacked_size(file))
        return "pbf"
    if head.removeprefix(b"\xef\xbb\xbf").lstrip().startswith(b"<"):
        return "osm"
    raise BadFile(f"{str(file)!r} is not an OpenStreetMap file: it starts with {shown(head[:16])}. {WAY_OUT}")


def allowance_of(file: Path) -> MemoryBudget:
    """Return the memory allowance for reading a map file; it is released before the next processing step."""
    return MemoryBudget(file.stat().st_size, repr(str(file)), is_streamed=True)


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
    """Return the unpacked bytes of all blocks. A damaged frame ends the count; its reader reports it."""
    total = 0
    with file.open("rb") as stream:
        while len(start := stream.read(4)) == 4:
            size = int.from_bytes(start, "big")
            blob_size = _fields(stream.read(size)).get(_DATA_SIZE, 0) if size <= _MOST_HEADER else _MOST_BLOB + 1
            if blob_size > _MOST_BLOB:
                break
            total += _fields(stream.read(blob_size)).get(_RAW_SIZE, 0)
    return total


def _fields(message: bytes) -> dict[int, int]:
    """Return the integers in a protobuf message, by field."""
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


_DEGREE = 10_000_000  # osmium counts in units of 1e-7 degrees
_NOWHERE = 2**31 - 1
_BYTES_PER_POINT = 1_000  # of memory, from the file to the graph
_MOST_NODES = 2000  # of a way, the limit of OpenStreetMap; far longer outlines take minutes to repair
_BYTES_PER_CORNER = 100  # of a building of which only the outline is kept
_SHOW_EVERY = 4096  # ways


class _WayVertices:
    """The vertices of ways while they are being read, each way once.

    Args:
        allowance: the memory that reading may take.
        bytes_per_point: of memory, from the file to the result; None: that of roads.
    """

    def __init__(self, allowance: MemoryBudget, bytes_per_point: int | None = None) -> None:
        self.allowance = allowance
        self.bytes_per_point = bytes_per_point or _BYTES_PER_POINT
        self.offsets = array("q", (0,))
        self.refs = array("q")
        self.x = array("q")
        self.y = array("q")
        self.row_of: dict[int, int] = {}  # way id -> row

    def add(self, way: "osm.Way", clip: "_ClippedNodes | None" = None) -> None:
        nodes = list(way.nodes)
        self.allowance.charge(self.bytes_per_point * len(nodes))
        refs = [node.ref for node in nodes]
        self.refs.extend(refs)
        if clip is None:
            places = [node.location for node in nodes]
            self.x.extend([place.x for place in places])
            self.y.extend([place.y for place in places])
        else:
            found = [clip.place_of.get(ref, _OUTSIDE) for ref in refs]
            self.x.extend([x for x, _ in found])
            self.y.extend([y for _, y in found])
        self.row_of[way.id] = len(self.offsets) - 1
        self.offsets.append(len(self.refs))

    def complete(self, source: "io.File", report: Callable[[int], None]) -> None:
        """Find the nodes that osmium itself does not find: nodes after their way, and nodes with negative ids."""
        from osmium import FileProcessor, osm

        missing = {ref for ref, x in zip(self.refs, self.x, strict=True) if x == _NOWHERE}
        if not missing:
            return
        report(len(missing))
        nodes: Iterator[Any] = iter(FileProcessor(source, osm.NODE))
        places = {node.id: (node.location.x, node.location.y) for node in nodes if node.id in missing}
        for position, (ref, x) in enumerate(zip(self.refs, self.x, strict=True)):
            if x == _NOWHERE and ref in places:
                self.x[position], self.y[position] = places[ref]

    def lonlat(self) -> FloatArray:
        """Return the vertices in degrees (positions, 2), NaN where the file lacks the node."""
        units = np.column_stack((np.array(self.x, np.int64), np.array(self.y, np.int64)))
        lonlat = units / _DEGREE
        lonlat[np.any(np.abs(units) > (180 * _DEGREE, 90 * _DEGREE), axis=1)] = np.nan
        return lonlat


_OUTSIDE = (_NOWHERE, _NOWHERE)
_BYTES_PER_NODE = 250  # of memory, of a node in an area


class _ClippedNodes:
    """The nodes of a map file in an area; only these take memory, however large the file is.

    Args:
        source: the file.
        region: the polygon, in degrees of longitude and latitude.

    Attributes:
        place_of: id of a node -> longitude and latitude in osmium's units.
    """

    def __init__(self, source: "io.File", region: "Polygon") -> None:
        from osmium import FileProcessor, osm

        west, south, east, north = (round(one * _DEGREE) for one in region.bounds)
        ids = array("q")
        x = array("q")
        y = array("q")
        for one in FileProcessor(source, osm.NODE):
            place = cast("osm.Node", one).location
            if west <= place.x <= east and south <= place.y <= north:
                ids.append(one.id)
                x.append(place.x)
                y.append(place.y)
                if not len(ids) % _SHOW_EVERY:
                    refuse_above(_BYTES_PER_NODE * len(ids), f"A part of a map with {len(ids):,} nodes and more")
        units = np.column_stack((np.array(x, np.int64), np.array(y, np.int64)))
        rows = np.flatnonzero(are_inside(region, units / _DEGREE)).tolist()
        self.place_of = {ids[row]: (x[row], y[row]) for row in rows}

    def has_part_of(self, one: "osm.Node | osm.Way | osm.Relation") -> bool:
        """Return whether a node, or a node of a way, lies in the area; True for relations."""
        if not one.is_way():
            return one.is_relation() or one.id in self.place_of
        return any(node.ref in self.place_of for node in cast("osm.Way", one).nodes)


def read_ways(
    file: Path,
    show: Show,
    rule: Rule | None = None,
    tags: Sequence[str] = (),
    *,
    areas: bool = False,
    stops: Stops | None = None,
    clip: "Polygon | None" = None,
    around_buildings: bool = False,
) -> OsmRoads:
    """Return the ways of a map file that a rule accepts, by default all roads, in file order; possibly none.

    Args:
        file: the map file.
        show: shows the progress.
        rule: the rule for ways.
        tags: tags of nodes to keep besides their `highway`, such as "crossing"; a node with one of them stays a node.
        areas: mark ways that are areas, and include the ways around multipolygons that the rule accepts.
        stops: whether a node with these tags is a barrier.
        clip: an area in degrees; nodes outside count as missing.
        around_buildings: attach the buildings of the file, which are read when they are needed.

    Raises:
        BadFile: the file is not OpenStreetMap data, is damaged, or too large.
        MissingExtra: osmium is not installed.
    """
    source = _source_of(file)
    lines = _WayVertices(allowance_of(file))
    rule = rule or classic_rule(None)
    kept: list[tuple[dict[str, Any], bool]] = []
    marked = dict[int, dict[str, str]]()
    texts = dict[str, str]()
    barriers = set[int]()
    relations: list[tuple[int, dict[str, str], list[int]]] = []
    show(f"Reading {file.name}")
    with _errors_of(file):
        part = None if clip is None else _ClippedNodes(source, clip)
        roads = _roads(source, tags if stops is None else [*tags, "barrier"], has_places=part is None)
        for count, one in enumerate(roads, 1):
            if part is not None and not part.has_part_of(one):
                continue
            given = {tag.k: tag.v for tag in one.tags}
            if one.is_relation():
                relations.append((one.id, given, _rings(cast("osm.Relation", one))))
                continue
            if one.is_node():
                lines.allowance.charge(_BYTES_PER_POINT)
                marked[one.id] = _shared({name: given[name] for name in node_keys(tags) if name in given}, texts)
                barriers.update([one.id] if stops is not None and stops(given) else [])
                continue
            way = cast("osm.Way", one)
            found = None if way.deleted or way.id in lines.row_of else rule(way.id, given)
            if found is not None:
                lines.add(way, part)
                kept.append((_shared(found[0], texts), found[1]))
            if count % _SHOW_EVERY == 0:
                show(f"Reading {file.name}: {count} roads")
        squares = open_squares(relations, rule) if areas else {}
        rims = rims_of(squares)
        missing = rims.keys() - lines.row_of.keys()
        for way in _ways(source, ids=missing, part=part) if missing else ():
            if not way.deleted and way.id not in lines.row_of:
                lines.add(way, part)
                kept.append((rims[way.id], False))
        if part is None:
            lines.complete(source, lambda missing: show(f"Reading {file.name}: looking for {missing} nodes"))
    refs = np.array(lines.refs, np.int64)
    offsets = np.array(lines.offsets, np.int64)
    against = np.array([is_against for _, is_against in kept], np.bool_)
    ways = OsmRoads(
        offsets,
        refs,
        lines.lonlat(),
        against,
        [of_way for of_way, _ in kept],
        nodes=node_tags(marked, set(lines.refs), tags),
        barriers=barriers & set(lines.refs),
        buildings=BuildingIndex(lambda: _read_buildings(file, source, part)) if around_buildings else None,
        ids=[*lines.row_of],
    )
    return with_areas(ways, lines.row_of, squares) if areas else ways


def count_turn_restrictions(file: Path) -> int:
    """Return the number of turn restrictions in a map file.

    Raises:
        BadFile: the file is not OpenStreetMap data, is damaged, or too large.
        MissingExtra: osmium is not installed.
    """
    source = _source_of(file)
    from osmium import FileProcessor, osm
    from osmium.filter import TagFilter

    with _errors_of(file):
        found = FileProcessor(source, osm.RELATION).with_filter(TagFilter(("type", "restriction")))
        return sum(not cast("osm.Relation", one).deleted for one in found)


def _rings(relation: "osm.Relation") -> list[int]:
    """Return the ids of the ways around a multipolygon."""
    return [part.ref for part in relation.members if part.type == "w" and part.role in RING_ROLES]


def _shared(given: dict[str, Any], texts: dict[str, str]) -> dict[str, Any]:
    """Return the tags with equal texts shared: a file may repeat one long text."""
    return {name: texts.setdefault(one, one) if isinstance(one, str) else one for name, one in given.items()}


def _roads(
    source: "io.File", tags: Sequence[str], *, has_places: bool
) -> "Iterator[osm.Node | osm.Way | osm.Relation]":
    """Read the ways and relations with a `highway`, and the nodes with a `highway` or one of these tags."""
    from osmium import FileProcessor, osm
    from osmium.filter import KeyFilter

    ways = KeyFilter("highway")
    nodes = KeyFilter(*node_keys(tags))
    ways.enable_for(osm.WAY | osm.RELATION)
    nodes.enable_for(osm.NODE)
    objects = FileProcessor(source, osm.NODE | osm.WAY | osm.RELATION)
    objects = objects.with_locations() if has_places else objects  # takes memory for all nodes of the file
    return cast("Iterator[osm.Node | osm.Way | osm.Relation]", iter(objects.with_filter(ways).with_filter(nodes)))


def _source_of(file: Path) -> "io.File":
    """Return a map file for osmium to open.

    Raises:
        BadFile: the file is empty, of another kind, damaged, or expands absurdly.
        MissingExtra: osmium is not installed.
    """
    with needing("Reading OpenStreetMap files", "osm"):
        import osmium
    return osmium.io.File(str(file), file_format(file))


@contextmanager
def _errors_of(file: Path) -> Iterator[None]:
    """Turn osmium's errors into a `BadFile` with the name of the file and advice."""
    from osmium import InvalidLocationError

    try:
        yield
    except GammsError:
        raise
    except (RuntimeError, ValueError, MemoryError, OverflowError, InvalidLocationError) as error:
        raise BadFile(f"{str(file)!r} cannot be read as OpenStreetMap data: {error}. {WAY_OUT}") from error


_AboutOf = Callable[[Mapping[str, str]], object | None]  # from tags to the object that they describe, or None


class AreaRules(Protocol):
    """Rules that turn areas of a map file into objects, such as walls.

    Attributes:
        keys: an area needs a tag with one of these keys.
    """

    keys: list[str]

    def wall_of(self, tags: Mapping[str, str]) -> object | None:
        """Return the object for an area with these tags; None: ignore the area."""


def read_footprints(file: Path, rules: AreaRules) -> Outlines:
    """Read the areas of a map file that `rules` accept: relations in file order, then ways in file order.

    Raises:
        BadFile: the file is not OpenStreetMap data, is damaged, or too large.
        MissingExtra: osmium is not installed.
    """
    source = _source_of(file)
    found = _FootprintReader(rules, _WayVertices(allowance_of(file)))
    with _errors_of(file):
        if rules.keys:
            found.read(source)
    return found.outlines()


def read_barriers(file: Path, rules: WallRules) -> Outlines:
    """Read the lines of a map file that `rules` turn into walls, in file order; raises like `read_footprints`."""
    lines, walls = _read_lines(file, ("barrier",) if rules.has_barriers else (), rules.barrier_of, but=rules)
    ways = [[id] for id in lines.row_of]
    return outlines_of_ways(np.array(lines.offsets, np.int64), lines.lonlat(), lines.row_of, ways, walls)


def read_lines(file: Path, keys: Sequence[str], about_of: _AboutOf) -> Outlines:
    """Read the lines of a map file that a function accepts, without parts whose nodes the file lacks.

    Args:
        file: the map file.
        keys: a line needs a tag with one of these keys.
        about_of: returns the object for a line with these tags; None: ignore the line.

    Raises:
        BadFile, MissingExtra: see `read_footprints`.
    """
    lines, about = _read_lines(file, keys, about_of)
    return known_parts(np.array(lines.offsets, np.int64), lines.lonlat(), about)


def _read_lines(
    file: Path, keys: Sequence[str], about_of: _AboutOf, but: AreaRules | None = None
) -> tuple["_WayVertices", list[object]]:
    """Read the ways that a function accepts, without areas that the rules `but` accept."""
    source = _source_of(file)
    lines = _WayVertices(allowance_of(file))
    about: list[object] = []
    with _errors_of(file):
        for way in _ways(source, *keys) if keys else ():
            tags = {tag.k: tag.v for tag in way.tags}
            is_other = but is not None and _is_area(way, tags) and but.wall_of(tags)
            found = None if way.deleted or way.id in lines.row_of or is_other else about_of(tags)
            if found is not None:
                about.append(found)
                lines.add(way)
        lines.complete(source, lambda _: None)
    return lines, about


def _is_area(way: "osm.Way", tags: Mapping[str, str]) -> bool:
    return 4 <= len(way.nodes) <= _MOST_NODES and way.ends_have_same_id() and tags.get("area") != "no"


class _FootprintReader:
    """Reads footprints: collects the lines around them while a file is being read."""

    def __init__(self, rules: AreaRules, lines: _WayVertices, part: _ClippedNodes | None = None) -> None:
        self.rules = rules
        self.part = part
        self.lines = lines
        self.walls: list[object] = []
        self.ways_of: list[list[int]] = []  # ids of the ways around each footprint
        self.relations: set[int] = set()

    def read(self, source: "io.File") -> None:
        from osmium import FileProcessor, osm
        from osmium.filter import KeyFilter

        for relation in FileProcessor(source, osm.RELATION).with_filter(KeyFilter(*self.rules.keys)):
            self._add_relation(cast("osm.Relation", relation))
        members = set(chain.from_iterable(self.ways_of))
        for way in _ways(source, *self.rules.keys, part=self.part):
            self._add_way(way)
        for way in _ways(source, ids=members, part=self.part) if members else ():
            if not way.deleted and way.id not in self.lines.row_of:
                self.lines.add(way, self.part)
        if self.part is None:
            self.lines.complete(source, lambda _: None)

    def _add_relation(self, relation: "osm.Relation") -> None:
        if relation.deleted or relation.id in self.relations:
            return
        self.relations.add(relation.id)
        tags = {tag.k: tag.v for tag in relation.tags}
        wall = self.rules.wall_of(tags) if tags.get("type") == "multipolygon" else None
        if wall is not None:
            self.walls.append(wall)
            self.ways_of.append(_rings(relation))

    def _add_way(self, way: "osm.Way") -> None:
        if way.deleted or way.id in self.lines.row_of:
            return
        tags = {tag.k: tag.v for tag in way.tags}
        wall = self.rules.wall_of(tags) if _is_area(way, tags) else None
        if wall is not None:
            self.walls.append(wall)
            self.ways_of.append([way.id])
            self.lines.add(way, self.part)

    def outlines(self) -> Outlines:
        offsets = np.array(self.lines.offsets, np.int64)
        row_of = self.lines.row_of
        # Several relations may share a way.
        points = sum(
            int(offsets[row_of[id] + 1] - offsets[row_of[id]])
            for id in chain.from_iterable(self.ways_of)
            if id in row_of
        )
        self.lines.allowance.charge(self.lines.bytes_per_point * points)
        return outlines_of_ways(offsets, self.lines.lonlat(), row_of, self.ways_of, self.walls)


def _ways(
    source: "io.File", *keys: str, ids: Collection[int] = (), part: _ClippedNodes | None = None
) -> "Iterator[osm.Way]":
    """Read the ways with one of these tags, or these ids, in an area."""
    from osmium import FileProcessor, osm
    from osmium.filter import EntityFilter, IdFilter, KeyFilter

    objects = FileProcessor(source, osm.WAY if part is not None else osm.NODE | osm.WAY)
    objects = objects.with_locations() if part is None else objects  # takes memory for all nodes of the file
    objects = objects.with_filter(EntityFilter(osm.WAY)).with_filter(KeyFilter(*keys) if keys else IdFilter(ids))
    return (way for way in cast("Iterable[osm.Way]", objects) if part is None or part.has_part_of(way))


def _read_buildings(file: Path, source: "io.File", part: _ClippedNodes | None) -> Shapes:
    """Read the buildings of a map file that block roads, in degrees and in any order."""
    found = _FootprintReader(_BuildingRules(), _WayVertices(allowance_of(file), _BYTES_PER_CORNER), part)
    with _errors_of(file):
        found.read(source)
    return footprints_of(found.outlines())


class _BuildingRules:
    """The rules for areas that block ways."""

    def __init__(self) -> None:
        self.keys = ["building"]

    def wall_of(self, tags: Mapping[str, str]) -> object | None:
        """Return True for an area that blocks ways, else None."""
        return is_in_the_way(tags) or None
