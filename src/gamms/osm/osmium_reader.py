"""Read OpenStreetMap files with osmium, in any format and order of their parts; refuse decompression bombs.

`objects.py` says which objects of a file count. Before osmium reads a file, one look finds out whether it has objects
that are deleted or given several times (`survey.py`); only then all its objects are compared.
"""

import bz2
import gzip
import zlib
from array import array
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import chain
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, Protocol, TypeAlias, cast
from xml.parsers import expat

import numpy as np

from gamms.arguments import as_path
from gamms.errors import BadFile, GammsError
from gamms.ir.geometry import are_inside, bounds_by_side
from gamms.ir.graph import FloatArray
from gamms.ir.projection import unrolled
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
    rows_around,
)
from gamms.osm.network import ROADS, OsmRoads, Rule, Stops, classic_rule
from gamms.osm.objects import (
    Member,
    ObjectVersions,
    WayRules,
    check_members,
    is_one_way_street,
    node_keys,
    node_tags,
    nodes_at_two_places,
)
from gamms.osm.survey import CHUNK, pbf_has_repeats, rewritten_xml, survey_xml, unpacked_size_of_pbf
from gamms.osm.turns import TurnRelation, is_restriction
from gamms.plugins import needing
from gamms.progress import Show
from gamms.text import shown

if TYPE_CHECKING:
    from osmium import FileProcessor, io, osm
    from shapely import MultiPolygon, Polygon

_MapObject: TypeAlias = "osm.Node | osm.Way | osm.Relation"
_NODE = "n"  # osmium's name of the kind
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
        allowance_of(file).charge(_MEMORY_PER_PBF * unpacked_size_of_pbf(file))
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


def allowance_of(file: Path) -> MemoryBudget:
    """Return the memory allowance for reading a map file; it is released before the next processing step."""
    return MemoryBudget(file.stat().st_size, repr(str(file)), is_streamed=True)


def _opened(file: Path, format: str) -> IO[bytes]:
    """Open a file of XML to read its unpacked text."""
    if format == "osm.gz":
        return cast("IO[bytes]", gzip.GzipFile(file))
    if format == "osm.bz2":
        return bz2.BZ2File(file)
    return file.open("rb")


def _text_of(file: Path, format: str) -> Iterator[bytes]:
    """Yield the unpacked text of a file in chunks.

    Raises:
        BadFile: it is damaged, or expands absurdly.
    """
    allowance = allowance_of(file)
    cost = 0 if format == "osm" else _MEMORY_PER_XML  # a file that is not packed is as large as it is
    try:
        with _opened(file, format) as stream:
            while chunk := stream.read(CHUNK):
                allowance.charge(cost * len(chunk))
                if len(chunk) == CHUNK and b">" not in chunk:  # a single tag, which a parser has to keep
                    raise BadFile(f"{str(file)!r} is damaged: it has a tag of more than {CHUNK} bytes.")
                yield chunk
    except (EOFError, OSError, zlib.error) as error:
        raise BadFile(f"{str(file)!r} is damaged: {error}. Download it again.") from error


_DEGREE = 10_000_000  # osmium counts in units of 1e-7 degrees
_NOWHERE = 2**31 - 1
_BYTES_PER_POINT = 1_000  # of memory, from the file to the graph
_MOST_NODES = 2000  # of a way, the limit of OpenStreetMap; far longer outlines take minutes to repair
_BYTES_PER_CORNER = 100  # of a building of which only the outline is kept
_SHOW_EVERY = 4096  # ways
_MOST_ID = 1 << 40  # greater ids are not of OpenStreetMap


class MapSource:
    """A map file for osmium to open, with the objects in it that count.

    Attributes:
        file: the file.
        opened: the file, or its text rewritten.
        has_repeats: whether objects may be deleted or given several times.
        unclear: ids of nodes that are at two places.

    Raises:
        BadFile: the file is empty, of another kind, damaged, no map but edits, or incomplete.
        TooLarge: it expands absurdly.
        MissingExtra: osmium is not installed.
    """

    def __init__(self, file: Path) -> None:
        with needing("Reading OpenStreetMap files", "osm"):
            import osmium
        self.file = file
        format = file_format(file)
        self.opened: io.File | io.FileBuffer = osmium.io.File(str(file), format)
        if format == "pbf":
            self.has_repeats = pbf_has_repeats(file)
        else:
            found = survey_xml(_text_of(file, format))
            self.has_repeats = found.has_repeats
            if found.is_foreign:
                self.opened = osmium.io.FileBuffer(_as_osmium_reads(file, format), "osm")
        self._versions: dict[str, ObjectVersions] = {}
        self.unclear = frozenset[int]()
        if self.has_repeats:
            with _errors_of(file):
                self._compare()

    def counting(self, objects: "FileProcessor") -> "Iterator[_MapObject]":
        """Yield the objects that are not deleted, in the version that counts."""
        for one in cast("Iterator[_MapObject]", iter(objects)):
            is_last = not self._versions or self._versions[one.type_str()].counts(one.id, one.version)
            if is_last and not one.deleted:
                yield one

    def _compare(self) -> None:
        """Find the versions that count of objects that are deleted or given several times."""
        from osmium import FileProcessor, osm

        columns: dict[str, tuple[array[int], array[int], array[int]]] = {}
        x = array("q")
        y = array("q")
        every = FileProcessor(self.opened, osm.NODE | osm.WAY | osm.RELATION)
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
            if kind == _NODE:
                rows = self._versions[kind].are_counting(numbers, versions_of)
                places = np.column_stack((np.array(x, np.int64), np.array(y, np.int64)))
                self.unclear = nodes_at_two_places(numbers[rows], places[rows])


def _as_osmium_reads(file: Path, format: str) -> bytes:
    """Return the text of a map file as osmium reads it.

    Raises:
        BadFile: it is no XML, or no complete map.
        TooLarge: it expands absurdly.
    """
    try:
        return rewritten_xml(_text_of(file, format), allowance_of(file).charge)
    except GammsError:
        raise
    except expat.ExpatError as error:
        raise BadFile(f"{str(file)!r} cannot be read as OpenStreetMap data: {error}. {WAY_OUT}") from error
    except ValueError as error:
        raise BadFile(f"{str(file)!r} cannot be used: {error}. {WAY_OUT}") from None


class _WayVertices:
    """The vertices of ways while they are being read, each piece of a way once.

    Args:
        source: the map.
        bytes_per_point: of memory, from the file to the result; None: that of roads.
    """

    def __init__(self, source: MapSource, bytes_per_point: int | None = None) -> None:
        self.source = source
        self.allowance = allowance_of(source.file)
        self.bytes_per_point = bytes_per_point or _BYTES_PER_POINT
        self.offsets = array("q", (0,))
        self.refs = array("q")
        self.x = array("q")
        self.y = array("q")
        self.ids = array("q")
        self.one_way = array("b")
        self.rows_of: dict[int, list[int]] = {}  # way id -> rows
        self.rules = WayRules(self._first, source.unclear)

    def add(self, way: "osm.Way", tags: Mapping[str, str], clip: "_ClippedNodes | None" = None) -> bool:
        """Add a way with these tags, if it counts by the rules of `objects.py`; return whether it does.

        Raises:
            ValueError: the way contradicts an earlier one.
        """
        nodes = list(way.nodes)
        self.allowance.charge(self.bytes_per_point * len(nodes))
        refs = [node.ref for node in nodes]
        if not self.rules.take(way.id, refs, tags):
            return False
        self.rows_of.setdefault(way.id, []).append(len(self.ids))
        self.one_way.append(is_one_way_street(tags))
        self.ids.append(way.id)
        self.refs.extend(refs)
        if clip is None:
            places = [node.location for node in nodes]
            self.x.extend([place.x for place in places])
            self.y.extend([place.y for place in places])
        else:
            found = [clip.place_of.get(ref, _OUTSIDE) for ref in refs]
            self.x.extend([x for x, _ in found])
            self.y.extend([y for _, y in found])
        self.offsets.append(len(self.refs))
        return True

    def _first(self, id: int) -> tuple[Sequence[int], bool] | None:
        """Return the nodes of the first way with an id, and whether it is one-way."""
        if id not in self.rows_of:
            return None
        row = self.rows_of[id][0]
        return self.refs[self.offsets[row] : self.offsets[row + 1]], bool(self.one_way[row])

    def complete(self, report: Callable[[int], None]) -> None:
        """Find the nodes that osmium itself does not find.

        These are nodes after their way, nodes with negative ids, and all nodes of a file with repeats.
        """
        from osmium import FileProcessor, osm

        missing = {ref for ref, x in zip(self.refs, self.x, strict=True) if x == _NOWHERE}
        if not missing:
            return
        report(len(missing))
        nodes: Iterator[Any] = self.source.counting(FileProcessor(self.source.opened, osm.NODE))
        places = {node.id: (node.location.x, node.location.y) for node in nodes if node.id in missing}
        for position, (ref, x) in enumerate(zip(self.refs, self.x, strict=True)):
            if x == _NOWHERE and ref in places:
                self.x[position], self.y[position] = places[ref]

    def lonlat(self) -> FloatArray:
        """Return the vertices in degrees (positions, 2), NaN where the file lacks the node.

        On a map across 180 degrees, longitudes in the west are above 180.
        """
        units = np.column_stack((np.array(self.x, np.int64), np.array(self.y, np.int64)))
        lonlat = units / _DEGREE
        lonlat[np.any(np.abs(units) > (180 * _DEGREE, 90 * _DEGREE), axis=1)] = np.nan
        return unrolled(lonlat)


_OUTSIDE = (_NOWHERE, _NOWHERE)
_BYTES_PER_NODE = 250  # of memory, of a node in an area


class _ClippedNodes:
    """The nodes of a map file in an area; only these take memory, however large the file is.

    Args:
        source: the map.
        region: the polygon, in degrees of longitude and latitude.

    Attributes:
        place_of: id of a node -> longitude and latitude in osmium's units.
    """

    def __init__(self, source: MapSource, region: "Polygon | MultiPolygon") -> None:
        from osmium import FileProcessor, osm

        boxes = [tuple(round(one * _DEGREE) for one in part) for part in bounds_by_side(region)]
        ids = array("q")
        x = array("q")
        y = array("q")
        for one in source.counting(FileProcessor(source.opened, osm.NODE)):
            place = cast("osm.Node", one).location
            if any(west <= place.x <= east and south <= place.y <= north for west, south, east, north in boxes):
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


def read_ways(  # noqa: PLR0913 # the options of a selection of roads
    file: Path,
    show: Show,
    rule: Rule | None = None,
    tags: Sequence[str] = (),
    *,
    areas: bool = False,
    stops: Stops | None = None,
    clip: "Polygon | MultiPolygon | None" = None,
    around_buildings: bool = False,
    keys: Sequence[str] = ROADS,
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
        keys: a way needs a tag with one of these keys.

    Raises:
        BadFile: the file is not OpenStreetMap data, is damaged, or too large.
        MissingExtra: osmium is not installed.
    """
    source = MapSource(file)
    lines = _WayVertices(source)
    rule = rule or classic_rule(None)
    kept: list[tuple[dict[str, Any], bool]] = []
    marked = dict[int, dict[str, str]]()
    texts = dict[str, str]()
    barriers = set[int]()
    relations = _Relations()
    show(f"Reading {file.name}")
    with _errors_of(file):
        part = None if clip is None else _ClippedNodes(source, clip)
        roads = _roads(source, keys, tags if stops is None else [*tags, "barrier"], has_places=part is None)
        for count, one in enumerate(roads, 1):
            if part is not None and not part.has_part_of(one):
                continue
            given = {tag.k: tag.v for tag in one.tags}
            if one.is_relation():
                if "highway" in given or is_restriction(given):
                    lines.allowance.charge(_BYTES_PER_CORNER * len(cast("osm.Relation", one).members))
                    relations.add(cast("osm.Relation", one), given)
                continue
            if one.is_node():
                lines.allowance.charge(_BYTES_PER_POINT)
                marked[one.id] = _shared({name: given[name] for name in node_keys(tags) if name in given}, texts)
                barriers.update([one.id] if stops is not None and stops(given) else [])
                continue
            way = cast("osm.Way", one)
            found = rule(way.id, given)
            if found is not None and lines.add(way, given, part):
                kept.append((_shared(found[0], texts), found[1]))
            if count % _SHOW_EVERY == 0:
                show(f"Reading {file.name}: {count} roads")
        squares = open_squares(relations.with_rings(), rule) if areas else {}
        rims = rims_of(squares)
        missing = rims.keys() - lines.rows_of.keys()
        around = _ways(source, ids=missing, part=part) if missing else ()
        kept += [(rims[way.id], False) for way in around if lines.add(way, {}, part)]
        if part is None:
            lines.complete(lambda missing: show(f"Reading {file.name}: looking for {missing} nodes"))
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
        buildings=BuildingIndex(lambda: _read_buildings(source, part)) if around_buildings else None,
        ids=lines.ids.tolist(),
        without_nodes=lines.rules.without_nodes,
        signs=relations.restrictions(),
    )
    return with_areas(ways, lines.rows_of, squares) if areas else ways


class _Relations:
    """The relations of a map while they are being read, each once."""

    def __init__(self) -> None:
        self._tags: dict[int, dict[str, str]] = {}
        self._members: dict[int, list[Member]] = {}

    def add(self, relation: "osm.Relation", tags: dict[str, str]) -> None:
        """Add a relation with these tags, unless it is already there.

        Raises:
            ValueError: the relation contradicts an earlier one.
        """
        members = [(one.type, one.ref, one.role) for one in relation.members]
        check_members(relation.id, members, self._members.setdefault(relation.id, members))
        self._tags.setdefault(relation.id, tags)

    def restrictions(self) -> list[TurnRelation]:
        """Return the tags and members of the turn restrictions."""
        return [(tags, self._members[id]) for id, tags in self._tags.items() if is_restriction(tags)]

    def with_rings(self) -> Iterator[tuple[int, dict[str, str], list[int]]]:
        """Yield the ids and tags of relations, and the ids of the ways around them."""
        for id, tags in self._tags.items():
            rings = [ref for kind, ref, role in self._members[id] if kind == "w" and role in RING_ROLES]
            yield id, tags, rings


def _shared(given: dict[str, Any], texts: dict[str, str]) -> dict[str, Any]:
    """Return the tags with equal texts shared: a file may repeat one long text."""
    return {name: texts.setdefault(one, one) if isinstance(one, str) else one for name, one in given.items()}


def _roads(source: MapSource, keys: Sequence[str], tags: Sequence[str], *, has_places: bool) -> Iterator[_MapObject]:
    """Read the ways with one of these keys, typed relations, and the nodes with a `highway` or one of these tags."""
    from osmium import FileProcessor, osm
    from osmium.filter import KeyFilter

    ways = KeyFilter(*keys)
    nodes = KeyFilter(*node_keys(tags))
    relations = KeyFilter("type")
    ways.enable_for(osm.WAY)
    nodes.enable_for(osm.NODE)
    relations.enable_for(osm.RELATION)
    objects = FileProcessor(source.opened, osm.NODE | osm.WAY | osm.RELATION)
    objects = _with_places(objects, source) if has_places else objects
    return source.counting(objects.with_filter(ways).with_filter(nodes).with_filter(relations))


def _with_places(objects: "FileProcessor", source: MapSource) -> "FileProcessor":
    """Let osmium give ways the places of their nodes; it does not know which one of several counts."""
    return objects if source.has_repeats else objects.with_locations()  # takes memory for all nodes of the file


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
    found = _FootprintReader(rules, _WayVertices(MapSource(file)))
    with _errors_of(file):
        if rules.keys:
            found.read()
    return found.outlines()


def read_barriers(file: Path, rules: WallRules) -> Outlines:
    """Read the lines of a map file that `rules` turn into walls, in file order; raises like `read_footprints`."""
    lines, walls = _read_lines(file, ("barrier",) if rules.has_barriers else (), rules.barrier_of, but=rules)
    rows = [[row] for row in range(len(walls))]
    return outlines_of_ways(np.array(lines.offsets, np.int64), lines.lonlat(), rows, walls)


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
    source = MapSource(file)
    lines = _WayVertices(source)
    about: list[object] = []
    with _errors_of(file):
        for way in _ways(source, *keys) if keys else ():
            tags = {tag.k: tag.v for tag in way.tags}
            is_other = but is not None and _is_area(way, tags) and but.wall_of(tags)
            found = None if is_other else about_of(tags)
            if found is not None and lines.add(way, tags):
                about.append(found)
        lines.complete(lambda _: None)
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
        self.rows_of: list[list[int]] = []  # of the lines around each footprint

    def read(self) -> None:
        from osmium import FileProcessor, osm
        from osmium.filter import KeyFilter

        source = self.lines.source
        relations = _Relations()
        for relation in source.counting(
            FileProcessor(source.opened, osm.RELATION).with_filter(KeyFilter(*self.rules.keys))
        ):
            relations.add(cast("osm.Relation", relation), {tag.k: tag.v for tag in relation.tags})
        ways_of = self._multipolygons(relations)
        members = set(chain.from_iterable(ways_of))
        own = list[int]()
        for way in _ways(source, *self.rules.keys, part=self.part):
            tags = {tag.k: tag.v for tag in way.tags}
            wall = self.rules.wall_of(tags) if _is_area(way, tags) else None
            if wall is not None and self.lines.add(way, tags, self.part):
                self.walls.append(wall)
                own.append(len(self.lines.ids) - 1)
        known = self.lines.rows_of.keys()
        for way in _ways(source, ids=members - known, part=self.part) if members - known else ():
            self.lines.add(way, {}, self.part)
        if self.part is None:
            self.lines.complete(lambda _: None)
        self.rows_of = [rows_around(ids, self.lines.rows_of) for ids in ways_of] + [[row] for row in own]

    def _multipolygons(self, relations: _Relations) -> list[list[int]]:
        """Add the walls of relations, and return the ids of the ways around each."""
        ways_of: list[list[int]] = []
        for _, tags, rings in relations.with_rings():
            wall = self.rules.wall_of(tags) if tags.get("type") == "multipolygon" else None
            if wall is not None:
                self.walls.append(wall)
                ways_of.append(rings)
        return ways_of

    def outlines(self) -> Outlines:
        offsets = np.array(self.lines.offsets, np.int64)
        # Several relations may share a way.
        points = sum(int(offsets[row + 1] - offsets[row]) for row in chain.from_iterable(self.rows_of))
        self.lines.allowance.charge(self.lines.bytes_per_point * points)
        return outlines_of_ways(offsets, self.lines.lonlat(), self.rows_of, self.walls)


def _ways(
    source: MapSource, *keys: str, ids: Collection[int] = (), part: _ClippedNodes | None = None
) -> "Iterator[osm.Way]":
    """Read the ways with one of these tags, or these ids, in an area."""
    from osmium import FileProcessor, osm
    from osmium.filter import EntityFilter, IdFilter, KeyFilter

    objects = FileProcessor(source.opened, osm.WAY if part is not None else osm.NODE | osm.WAY)
    objects = _with_places(objects, source) if part is None else objects
    objects = objects.with_filter(EntityFilter(osm.WAY))
    if keys:
        objects = objects.with_filter(KeyFilter(*keys))
    elif min(ids) >= 0 and max(ids) < _MOST_ID:  # osmium's filter takes no others
        objects = objects.with_filter(IdFilter(ids))
    for way in cast("Iterator[osm.Way]", source.counting(objects)):
        if (keys or way.id in ids) and (part is None or part.has_part_of(way)):
            yield way


def _read_buildings(source: MapSource, part: _ClippedNodes | None) -> Shapes:
    """Read the buildings of a map file that block roads, in degrees and in any order."""
    found = _FootprintReader(_BuildingRules(), _WayVertices(source, _BYTES_PER_CORNER), part)
    with _errors_of(source.file):
        found.read()
    return footprints_of(found.outlines())


class _BuildingRules:
    """The rules for areas that block ways."""

    def __init__(self) -> None:
        self.keys = ["building"]

    def wall_of(self, tags: Mapping[str, str]) -> object | None:
        """Return True for an area that blocks ways, else None."""
        return is_in_the_way(tags) or None
