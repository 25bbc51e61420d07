"""Read the roads and footprints of OpenStreetMap files with osmium, whatever the format and the order of the parts."""

from array import array
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from gamms.errors import BadFile, MissingExtra
from gamms.ir.graph import FloatArray
from gamms.limits import Allowance
from gamms.osm.files import WAY_OUT, allowance_of, file_format
from gamms.osm.heights import Wall, WallRules
from gamms.osm.polygons import RING_ROLES, Outlines, outlines_of_ways
from gamms.osm.ways import OSMType, Ways, is_open_to, kept_tags
from gamms.progress import Show

if TYPE_CHECKING:
    from osmium import io, osm

_DEGREE = 10_000_000  # osmium counts in units of 1e-7 degrees
_NOWHERE = 2**31 - 1
_BYTES_PER_POINT = 1_000  # of memory, from the file to the graph
_SHOW_EVERY = 4096  # ways


class _Lines:
    """The vertices of ways while they are being read, each way once."""

    def __init__(self, allowance: Allowance) -> None:
        self.allowance = allowance
        self.offsets, self.refs = array("q", (0,)), array("q")
        self.x, self.y = array("q"), array("q")
        self.row_of: dict[int, int] = {}  # way id -> row

    def add(self, way: "osm.Way") -> None:
        self.allowance.charge(_BYTES_PER_POINT * len(way.nodes))
        for node in way.nodes:
            place = node.location
            self.refs.append(node.ref)
            self.x.append(place.x)
            self.y.append(place.y)
        self.row_of[way.id] = len(self.offsets) - 1
        self.offsets.append(len(self.refs))

    def complete(self, source: "io.File", tell: Callable[[int], None]) -> None:
        """Look for the nodes that osmium itself does not find: those after their way, and those with negative ids."""
        from osmium import FileProcessor, osm

        missing = {ref for ref, x in zip(self.refs, self.x, strict=True) if x == _NOWHERE}
        if not missing:
            return
        tell(len(missing))
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


def read_ways(file: Path, show: Show, osm_type: OSMType | None = None) -> Ways:
    """Return the roads of a map file for one way of moving, or for any, in its order.

    Raises:
        BadFile: it is not OpenStreetMap data, damaged, too large, or has no roads.
        MissingExtra: osmium is not installed.
    """
    source, lines = _source_of(file), _Lines(allowance_of(file))
    kept: list[tuple[dict[str, Any], bool]] = []
    show(f"Reading {file.name}")
    with _errors_of(file):
        for count, way in enumerate(_ways(source, "highway"), 1):
            given = {tag.k: tag.v for tag in way.tags}
            if not way.deleted and way.id not in lines.row_of and is_open_to(osm_type, given):
                lines.add(way)
                kept.append(kept_tags(way.id, given, osm_type))
            if count % _SHOW_EVERY == 0:
                show(f"Reading {file.name}: {count} roads")
        lines.complete(source, lambda missing: show(f"Reading {file.name}: looking for {missing} nodes"))
    if not kept:
        whose = "" if osm_type is None else f" for {osm_type}"
        raise BadFile(
            f"{str(file)!r} cannot be used: it has no roads{whose}, that is no such ways with a highway tag. "
            "Export the area with its roads."
        )
    refs, offsets = np.array(lines.refs, np.int64), np.array(lines.offsets, np.int64)
    return Ways(
        offsets, refs, lines.lonlat(), np.array([is_against for _, is_against in kept]), [tags for tags, _ in kept]
    )


def _source_of(file: Path) -> "io.File":
    """Return a map file for osmium to open.

    Raises:
        BadFile: it is empty, of another kind, damaged, or expands absurdly.
        MissingExtra: osmium is not installed.
    """
    try:
        import osmium
    except ImportError as error:
        raise MissingExtra("Reading OpenStreetMap files", "osm") from error
    return osmium.io.File(str(file), file_format(file))


@contextmanager
def _errors_of(file: Path) -> Iterator[None]:
    """Whatever osmium says about a file, say it with the name of the file and the way out."""
    from osmium import InvalidLocationError

    try:
        yield
    except BadFile:
        raise
    except (RuntimeError, ValueError, MemoryError, OverflowError, InvalidLocationError) as error:
        raise BadFile(f"{str(file)!r} cannot be read as OpenStreetMap data: {error}. {WAY_OUT}") from error


def read_footprints(file: Path, rules: WallRules) -> Outlines:
    """Read the footprints of a map file that `rules` make walls of: relations in its order, then ways in its order.

    Raises:
        BadFile: it is not OpenStreetMap data, damaged, or too large.
        MissingExtra: osmium is not installed.
    """
    source, found = _source_of(file), _Footprints(rules, allowance_of(file))
    with _errors_of(file):
        if rules.keys:
            found.read(source)
    return found.outlines()


class _Footprints:
    """Which lines enclose what, while a file is being read."""

    def __init__(self, rules: WallRules, allowance: Allowance) -> None:
        self.rules = rules
        self.lines = _Lines(allowance)
        self.walls: list[Wall] = []
        self.ways_of: list[list[int]] = []  # ids of the ways around each footprint
        self.relations: set[int] = set()

    def read(self, source: "io.File") -> None:
        from osmium import FileProcessor, osm
        from osmium.filter import KeyFilter

        for relation in FileProcessor(source, osm.RELATION).with_filter(KeyFilter(*self.rules.keys)):
            self._add_relation(cast("osm.Relation", relation))
        members = {way for ways in self.ways_of for way in ways}
        for way in _ways(source, *self.rules.keys):
            self._add_way(way)
        if members:
            for way in _ways(source):
                if way.id in members and not way.deleted and way.id not in self.lines.row_of:
                    self.lines.add(way)
        self.lines.complete(source, lambda _: None)

    def _add_relation(self, relation: "osm.Relation") -> None:
        if relation.deleted or relation.id in self.relations:
            return
        self.relations.add(relation.id)
        tags = {tag.k: tag.v for tag in relation.tags}
        wall = self.rules.wall_of(tags) if tags.get("type") == "multipolygon" else None
        if wall is not None:
            self.walls.append(wall)
            self.ways_of.append([part.ref for part in relation.members if part.type == "w" and part.role in RING_ROLES])

    def _add_way(self, way: "osm.Way") -> None:
        if way.deleted or len(way.nodes) < 4 or not way.ends_have_same_id() or way.id in self.lines.row_of:
            return
        tags = {tag.k: tag.v for tag in way.tags}
        wall = self.rules.wall_of(tags) if tags.get("area") != "no" else None
        if wall is not None:
            self.walls.append(wall)
            self.ways_of.append([way.id])
            self.lines.add(way)

    def outlines(self) -> Outlines:
        offsets, row_of = np.array(self.lines.offsets, np.int64), self.lines.row_of
        # Several relations may share a way.
        points = sum(
            int(offsets[row_of[id] + 1] - offsets[row_of[id]]) for ways in self.ways_of for id in ways if id in row_of
        )
        self.lines.allowance.charge(_BYTES_PER_POINT * points)
        return outlines_of_ways(offsets, self.lines.lonlat(), row_of, self.ways_of, self.walls)


def _ways(source: "io.File", *keys: str) -> "Iterator[osm.Way]":
    """Read the ways that have one of these tags, if any are given."""
    from osmium import FileProcessor, osm
    from osmium.filter import EntityFilter, KeyFilter

    objects = FileProcessor(source, osm.NODE | osm.WAY).with_locations().with_filter(EntityFilter(osm.WAY))
    return cast("Iterator[osm.Way]", iter(objects.with_filter(KeyFilter(*keys)) if keys else objects))
