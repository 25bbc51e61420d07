"""Read the footprints of a map file: closed ways and multipolygons with the tags that make walls."""

from array import array
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from gamms import kernels
from gamms.ir.graph import IntArray
from gamms.limits import Allowance
from gamms.osm.files import allowance_of
from gamms.osm.heights import Wall, WallRules
from gamms.osm.osmium import BYTES_PER_POINT, errors_of, places_of, source_of
from gamms.osm.polygons import Outlines

_DEGREE = 10_000_000  # osmium counts in units of 1e-7 degrees
_NOWHERE = 2**31 - 1
_ROLES = ("outer", "inner", "")


class _Lines:
    """Ways while they are being read, each once."""

    def __init__(self, allowance: Allowance) -> None:
        self.allowance = allowance
        self.offsets, self.refs = array("q", (0,)), array("q")
        self.x, self.y = array("q"), array("q")
        self.row_of: dict[int, int] = {}  # way id -> row

    def add(self, way: Any) -> None:
        if way.id in self.row_of:
            return
        self.allowance.charge(BYTES_PER_POINT * len(way.nodes))
        for node in way.nodes:
            place = node.location
            self.refs.append(node.ref)
            self.x.append(place.x)
            self.y.append(place.y)
        self.row_of[way.id] = len(self.offsets) - 1
        self.offsets.append(len(self.refs))

    def missing(self) -> set[int]:
        return {ref for ref, x in zip(self.refs, self.x, strict=True) if x == _NOWHERE}

    def find(self, places: Mapping[int, tuple[int, int]]) -> None:
        for position, (ref, x) in enumerate(zip(self.refs, self.x, strict=True)):
            if x == _NOWHERE and ref in places:
                self.x[position], self.y[position] = places[ref]


class _Footprints:
    """Which lines enclose what, while a file is being read."""

    def __init__(self, rules: WallRules, allowance: Allowance) -> None:
        self.rules = rules
        self.lines = _Lines(allowance)
        self.walls: list[Wall] = []
        self.ways_of: list[list[int]] = []  # ids of the ways around each footprint
        self.relations: set[int] = set()

    def add_relation(self, relation: Any) -> None:
        if relation.deleted or relation.id in self.relations:
            return
        self.relations.add(relation.id)
        tags = {tag.k: tag.v for tag in relation.tags}
        wall = self.rules.wall_of(tags) if tags.get("type") == "multipolygon" else None
        if wall is not None:
            self.walls.append(wall)
            self.ways_of.append([part.ref for part in relation.members if part.type == "w" and part.role in _ROLES])

    def add_way(self, way: Any) -> None:
        if way.deleted or len(way.nodes) < 4 or not way.ends_have_same_id() or way.id in self.lines.row_of:
            return
        tags = {tag.k: tag.v for tag in way.tags}
        wall = self.rules.wall_of(tags) if tags.get("area") != "no" else None
        if wall is not None:
            self.walls.append(wall)
            self.ways_of.append([way.id])
            self.lines.add(way)

    def outlines(self) -> Outlines:
        """What was read; a line that leads through a place that the file lacks is left out."""
        units = np.column_stack((np.array(self.lines.x, np.int64), np.array(self.lines.y, np.int64)))
        bounds = np.array(self.lines.offsets, np.int64)
        inside = np.concatenate(([0], np.cumsum((np.abs(units) <= (180 * _DEGREE, 90 * _DEGREE)).all(axis=1))))
        is_whole = (np.diff(inside[bounds]) == np.diff(bounds)) & (np.diff(bounds) > 1)
        rows, owners = self._rows(is_whole)
        # Several relations may share a way.
        self.lines.allowance.charge(BYTES_PER_POINT * int(np.diff(bounds)[rows].sum()))
        positions, offsets = kernels.chosen_runs(bounds, rows)
        return Outlines(offsets, units[positions] / _DEGREE, owners, self.walls)

    def _rows(self, is_whole: "np.ndarray[Any, np.dtype[np.bool_]]") -> tuple[IntArray, IntArray]:
        """The rows of the whole lines, and the footprint of each."""
        row_of = {way: row for way, row in self.lines.row_of.items() if is_whole[row]}
        rows = [[row_of[way] for way in sorted(set(ways)) if way in row_of] for ways in self.ways_of]
        owners = np.repeat(np.arange(len(rows)), np.array([len(of_one) for of_one in rows], np.int64))
        return np.array([row for of_one in rows for row in of_one], np.int64), owners


def read_footprints(file: Path, rules: WallRules) -> Outlines:
    """The footprints of a map file that `rules` make walls of: relations in its order, then ways in its order.

    Raises:
        BadFile: it is not OpenStreetMap data, damaged, or too large.
        MissingExtra: osmium is not installed.
    """
    source = source_of(file)
    found = _Footprints(rules, allowance_of(file))
    with errors_of(file):
        _read(source, found)
    return found.outlines()


def _read(source: Any, found: _Footprints) -> None:
    from osmium.filter import KeyFilter

    if not found.rules.keys:
        return
    for relation in _relations(source, found.rules.keys):
        found.add_relation(relation)
    members = {way for ways in found.ways_of for way in ways}
    for way in _ways(source, KeyFilter(*found.rules.keys)):
        found.add_way(way)
    if members:
        for way in _ways(source):
            if way.id in members and not way.deleted:
                found.lines.add(way)
    missing = found.lines.missing()
    if missing:
        found.lines.find(places_of(source, missing))


def _relations(source: Any, keys: list[str]) -> Iterator[Any]:
    from osmium import FileProcessor, osm
    from osmium.filter import KeyFilter

    return iter(FileProcessor(source, osm.RELATION).with_filter(KeyFilter(*keys)))


def _ways(source: Any, *chosen: Any) -> Iterator[Any]:
    from osmium import FileProcessor, osm
    from osmium.filter import EntityFilter

    objects = FileProcessor(source, osm.NODE | osm.WAY).with_locations()
    for wanted in (EntityFilter(osm.WAY), *chosen):
        objects.with_filter(wanted)
    return iter(objects)
