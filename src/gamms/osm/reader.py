"""Read roads, footprints and lines from the elements of a map: of a file, or of a server's answers.

`osmium_reader.py` and `overpass.py` each have a `MapSource`. `objects.py` says which elements count.
"""

from array import array
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from itertools import chain
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from gamms.ir.geometry import are_inside, find_bounds_by_side
from gamms.ir.graph import FloatArray
from gamms.ir.projection import unroll
from gamms.limits import MemoryBudget, refuse_above
from gamms.osm.areas import add_areas, find_rims, open_squares
from gamms.osm.footprints import (
    RING_ROLES,
    BuildingIndex,
    Outlines,
    Shapes,
    WallRules,
    find_rows_around,
    is_in_the_way,
    make_footprints,
    make_outlines_of_ways,
    split_known_parts,
)
from gamms.osm.network import ROADS, OsmRoads, Rule, Stops, make_classic_rule
from gamms.osm.objects import (
    NODE,
    RELATION,
    WAY,
    MapElement,
    Member,
    Wanted,
    WayRules,
    check_members,
    find_node_keys,
    is_one_way_street,
    select_node_tags,
)
from gamms.osm.turns import TurnRelation, is_restriction
from gamms.progress import Show

if TYPE_CHECKING:
    from shapely import MultiPolygon, Polygon

_DEGREE = 10_000_000  # places are in units of 1e-7 degrees
_NOWHERE = 2**31 - 1  # osmium's mark of a place that it does not know
_BYTES_PER_POINT = 1_000  # of memory, from the file to the graph
_MOST_NODES = 2000  # of a way, the limit of OpenStreetMap; far longer outlines take minutes to repair
_BYTES_PER_CORNER = 100  # of a building of which only the outline is kept
_SHOW_EVERY = 4096  # ways
_AREAS = ("multipolygon", "boundary")  # types of relations that are areas


class MapSource(Protocol):
    """The elements of a map that count.

    Attributes:
        name: the map, for messages.
        unclear: ids of nodes that are at two places.
    """

    name: str
    unclear: frozenset[int]

    def get_budget(self) -> MemoryBudget:
        """Return the memory that one reading may take."""

    def convert_errors(self) -> AbstractContextManager[None]:
        """Return a context in which errors of the map name their source."""

    def read_elements(
        self,
        keys: Mapping[str, Collection[str]],
        ids: Collection[int] = (),
        *,
        has_places: bool = False,
        wanted: Wanted | None = None,
    ) -> Iterator[MapElement]:
        """Yield elements in the order of the map.

        Args:
            keys: kind -> of these, those with one of these keys; of ways, with empty keys, all with any tag.
            ids: the ways with these ids, instead.
            has_places: whether ways shall have the places of their nodes, where the source knows them at once.
            wanted: only elements that it accepts; None: all of them.
        """

    def read_nodes(self) -> Iterator[tuple[int, int, int]]:
        """Yield the id and the place of all nodes, in units of 1e-7 degrees."""


class _WayVertices:
    """The vertices of ways while they are being read, each piece of a way once.

    Args:
        source: the map.
        bytes_per_point: of memory, from the file to the result; None: that of roads.
    """

    def __init__(self, source: MapSource, bytes_per_point: int | None = None) -> None:
        self.source = source
        self.budget = source.get_budget()
        self.bytes_per_point = bytes_per_point or _BYTES_PER_POINT
        self.offsets = array("q", (0,))
        self.refs = array("q")
        self.x = array("q")
        self.y = array("q")
        self.ids = array("q")
        self.one_way = array("b")
        self.rows_of: dict[int, list[int]] = {}  # way id -> rows
        self.rules = WayRules(self._find_first, source.unclear)

    def add(self, way: MapElement, tags: Mapping[str, str], clip: "_ClippedNodes | None" = None) -> bool:
        """Add a way with these tags, if it counts by the rules of `objects.py`; return whether it does.

        Raises:
            ValueError: the way contradicts an earlier one.
        """
        self.budget.charge(self.bytes_per_point * len(way.refs))
        if not self.rules.take(way.id, way.refs, tags):
            return False
        self.rows_of.setdefault(way.id, []).append(len(self.ids))
        self.one_way.append(is_one_way_street(tags))
        self.ids.append(way.id)
        self.refs.extend(way.refs)
        places = way.places or [_OUTSIDE] * len(way.refs)
        if clip is not None:
            places = [clip.place_of.get(ref, _OUTSIDE) for ref in way.refs]
        self.x.extend([x for x, _ in places])
        self.y.extend([y for _, y in places])
        self.offsets.append(len(self.refs))
        return True

    def _find_first(self, id: int) -> tuple[Sequence[int], bool] | None:
        """Return the nodes of the first way with an id, and whether it is one-way."""
        if id not in self.rows_of:
            return None
        row = self.rows_of[id][0]
        return self.refs[self.offsets[row] : self.offsets[row + 1]], bool(self.one_way[row])

    def complete(self, report: Callable[[int], None]) -> None:
        """Find the nodes whose places did not come with their ways, such as nodes after their way in a file."""
        missing = {ref for ref, x in zip(self.refs, self.x, strict=True) if x == _NOWHERE}
        if not missing:
            return
        report(len(missing))
        places = {id: (x, y) for id, x, y in self.source.read_nodes() if id in missing}
        for position, (ref, x) in enumerate(zip(self.refs, self.x, strict=True)):
            if x == _NOWHERE and ref in places:
                self.x[position], self.y[position] = places[ref]

    def get_lonlat(self) -> FloatArray:
        """Return the vertices in degrees (positions, 2), NaN where the file lacks the node.

        On a map across 180 degrees, longitudes in the west are above 180.
        """
        units = np.column_stack((np.array(self.x, np.int64), np.array(self.y, np.int64)))
        lonlat = units / _DEGREE
        lonlat[np.any(np.abs(units) > (180 * _DEGREE, 90 * _DEGREE), axis=1)] = np.nan
        return unroll(lonlat)


_OUTSIDE = (_NOWHERE, _NOWHERE)
_BYTES_PER_NODE = 250  # of memory, of a node in an area


class _ClippedNodes:
    """The nodes of a map file in an area; only these take memory, however large the file is.

    Args:
        source: the map.
        region: the polygon, in degrees of longitude and latitude.

    Attributes:
        place_of: id of a node -> longitude and latitude in units of 1e-7 degrees.
    """

    def __init__(self, source: MapSource, region: "Polygon | MultiPolygon") -> None:
        boxes = [tuple(round(one * _DEGREE) for one in part) for part in find_bounds_by_side(region)]
        ids = array("q")
        places = array("q")
        for id, x, y in source.read_nodes():
            if any(west <= x <= east and south <= y <= north for west, south, east, north in boxes):
                ids.append(id)
                places.extend((x, y))
                if not len(ids) % _SHOW_EVERY:
                    refuse_above(_BYTES_PER_NODE * len(ids), f"A part of a map with {len(ids):,} nodes and more")
        units = np.array(places, np.int64).reshape(-1, 2)
        rows = np.flatnonzero(are_inside(region, units / _DEGREE)).tolist()
        self.place_of = {ids[row]: (places[2 * row], places[2 * row + 1]) for row in rows}

    def has_part_of(self, one: MapElement) -> bool:
        """Return whether a node, or a node of a way, lies in the area; True for relations."""
        if one.kind == WAY:
            return any(ref in self.place_of for ref in one.refs)
        return one.kind == RELATION or one.id in self.place_of


def read_ways(  # noqa: PLR0913 # the options of a selection of roads
    source: MapSource,
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
    """Return the ways of a map that a rule accepts, by default all roads, in their order; possibly none.

    Args:
        source: the map.
        show: shows the progress.
        rule: the rule for ways.
        tags: tags of nodes to keep besides their `highway`, such as "crossing"; a node with one of them stays a node.
        areas: mark ways that are areas, and include the ways around multipolygons that the rule accepts.
        stops: whether a node with these tags is a barrier.
        clip: an area in degrees; nodes outside count as missing.
        around_buildings: attach the buildings of the map, which are read when they are needed.
        keys: a way needs a tag with one of these keys, or any tag if there are none.

    Raises:
        BadFile, NetworkError: the map contradicts itself, is damaged, or too large.
    """
    lines = _WayVertices(source)
    rule = rule or make_classic_rule(None)
    kept: list[tuple[dict[str, Any], bool]] = []
    marked = dict[int, dict[str, str]]()
    texts = dict[str, str]()
    barriers = set[int]()
    relations = _Relations()
    show(f"Reading {source.name}")
    with source.convert_errors():
        part = None if clip is None else _ClippedNodes(source, clip)
        node_names = find_node_keys(tags if stops is None else [*tags, "barrier"])
        of_kinds = {NODE: node_names, WAY: keys, RELATION: ("type",)}
        for count, one in enumerate(source.read_elements(of_kinds, has_places=part is None, wanted=_is_for_roads), 1):
            if part is not None and not part.has_part_of(one):
                continue
            given = one.tags
            if one.kind == RELATION:
                lines.budget.charge(_BYTES_PER_CORNER * len(one.members))
                relations.add(one)
            elif one.kind == NODE:
                lines.budget.charge(_BYTES_PER_POINT)
                marked[one.id] = _share_texts(
                    {name: given[name] for name in find_node_keys(tags) if name in given}, texts
                )
                barriers.update([one.id] if stops is not None and stops(given) else [])
            else:
                found = rule(one.id, given)
                if found is not None and lines.add(one, given, part):
                    kept.append((_share_texts(found[0], texts), found[1]))
            if count % _SHOW_EVERY == 0:
                show(f"Reading {source.name}: {count} roads")
        squares = open_squares(relations.list_rings(), rule) if areas else {}
        rims = find_rims(squares)
        missing = rims.keys() - lines.rows_of.keys()
        around = _read_ids(source, missing, part)
        kept += [(rims[way.id], False) for way in around if lines.add(way, {}, part)]
        if part is None:
            lines.complete(lambda missing: show(f"Reading {source.name}: looking for {missing} nodes"))
    refs = np.array(lines.refs, np.int64)
    offsets = np.array(lines.offsets, np.int64)
    against = np.array([is_against for _, is_against in kept], np.bool_)
    ways = OsmRoads(
        offsets,
        refs,
        lines.get_lonlat(),
        against,
        [of_way for of_way, _ in kept],
        nodes=select_node_tags(marked, set(lines.refs), tags),
        barriers=barriers & set(lines.refs),
        buildings=read_buildings(source, part) if around_buildings else None,
        ids=lines.ids.tolist(),
        without_nodes=lines.rules.without_nodes,
        signs=relations.list_restrictions(),
    )
    return add_areas(ways, lines.rows_of, squares) if areas else ways


def _is_for_roads(kind: str, tags: Mapping[str, str]) -> bool:
    return kind != RELATION or "highway" in tags or is_restriction(tags)


class _Relations:
    """The relations of a map while they are being read, each once."""

    def __init__(self) -> None:
        self._tags: dict[int, dict[str, str]] = {}
        self._members: dict[int, Sequence[Member]] = {}

    def add(self, relation: MapElement) -> None:
        """Add a relation, unless it is already there.

        Raises:
            ValueError: the relation contradicts an earlier one.
        """
        members = self._members.setdefault(relation.id, relation.members)
        check_members(relation.id, relation.members, members)
        self._tags.setdefault(relation.id, relation.tags)

    def list_restrictions(self) -> list[TurnRelation]:
        """Return the tags and members of the turn restrictions."""
        return [(tags, self._members[id]) for id, tags in self._tags.items() if is_restriction(tags)]

    def list_rings(self) -> Iterator[tuple[int, dict[str, str], list[int]]]:
        """Yield the ids and tags of relations, and the ids of the ways around them."""
        for id, tags in self._tags.items():
            rings = [ref for kind, ref, role in self._members[id] if kind == WAY and role in RING_ROLES]
            yield id, tags, rings


def _share_texts(given: dict[str, Any], texts: dict[str, str]) -> dict[str, Any]:
    """Return the tags with equal texts shared: a file may repeat one long text."""
    return {name: texts.setdefault(one, one) if isinstance(one, str) else one for name, one in given.items()}


_AboutOf = Callable[[Mapping[str, str]], object | None]  # from tags to the object that they describe, or None


class AreaRules(Protocol):
    """Rules that turn areas of a map into objects, such as walls.

    Attributes:
        keys: an area needs a tag with one of these keys.
    """

    keys: list[str]

    def find_wall(self, tags: Mapping[str, str]) -> object | None:
        """Return the object for an area with these tags; None: ignore the area."""


def read_footprints(source: MapSource, rules: AreaRules) -> Outlines:
    """Read the areas of a map that `rules` accept: relations in their order, then ways in theirs.

    Raises:
        BadFile, NetworkError: the map contradicts itself, is damaged, or too large.
    """
    found = _FootprintReader(rules, _WayVertices(source))
    with source.convert_errors():
        if rules.keys:
            found.read()
    return found.get_outlines()


def read_barriers(source: MapSource, rules: WallRules) -> Outlines:
    """Read the lines of a map that `rules` turn into walls, in their order; raises like `read_footprints`."""

    def wall_of(way: MapElement) -> object | None:
        is_other = _is_area(way) and rules.find_wall(way.tags)
        return None if is_other else rules.find_barrier(way.tags)

    lines, walls = _read_lines(source, ("barrier",) if rules.has_barriers else (), wall_of)
    return _make_outlines(lines, walls)


def read_lines(source: MapSource, keys: Collection[str], about_of: _AboutOf) -> Outlines:
    """Read the whole lines of a map that a function accepts.

    Args:
        source: the map.
        keys: a line needs a tag with one of these keys.
        about_of: returns the object for a line with these tags; None: ignore the line.

    Raises:
        BadFile, NetworkError: see `read_footprints`.
    """
    return _make_outlines(*_read_lines(source, keys, lambda way: about_of(way.tags)))


def read_line_parts(source: MapSource, keys: Collection[str], about_of: _AboutOf) -> Outlines:
    """Read the lines of a map as `read_lines`, without the parts whose nodes it lacks."""
    lines, about = _read_lines(source, keys, lambda way: about_of(way.tags))
    return split_known_parts(np.array(lines.offsets, np.int64), lines.get_lonlat(), about)


def _make_outlines(lines: "_WayVertices", about: list[object]) -> Outlines:
    rows = [[row] for row in range(len(about))]
    return make_outlines_of_ways(np.array(lines.offsets, np.int64), lines.get_lonlat(), rows, about)


def _read_lines(
    source: MapSource, keys: Collection[str], about_of: Callable[[MapElement], object | None]
) -> tuple["_WayVertices", list[object]]:
    lines = _WayVertices(source)
    about: list[object] = []
    with source.convert_errors():
        for way in source.read_elements({WAY: keys}, has_places=True) if keys else ():
            found = about_of(way)
            if found is not None and lines.add(way, way.tags):
                about.append(found)
        lines.complete(lambda _: None)
    return lines, about


def _is_area(way: MapElement) -> bool:
    is_closed = 4 <= len(way.refs) <= _MOST_NODES and way.refs[0] == way.refs[-1]
    return is_closed and way.tags.get("area") != "no"


def _read_ids(source: MapSource, ids: Collection[int], part: "_ClippedNodes | None") -> Iterator[MapElement]:
    """Read the ways with these ids in an area."""
    for way in source.read_elements({}, ids, has_places=part is None) if ids else ():
        if part is None or part.has_part_of(way):
            yield way


class _FootprintReader:
    """Reads footprints: collects the lines around them while a file is being read."""

    def __init__(self, rules: AreaRules, lines: _WayVertices, part: _ClippedNodes | None = None) -> None:
        self.rules = rules
        self.part = part
        self.lines = lines
        self.walls: list[object] = []
        self.rows_of: list[list[int]] = []  # of the lines around each footprint

    def read(self) -> None:
        source = self.lines.source
        relations = _Relations()
        for relation in source.read_elements(
            {RELATION: self.rules.keys}, wanted=lambda _, tags: tags.get("type") in _AREAS
        ):
            relations.add(relation)
        ways_of = self._add_multipolygons(relations)
        own = list[int]()
        for way in source.read_elements({WAY: self.rules.keys}, has_places=self.part is None):
            wall = self.rules.find_wall(way.tags) if _is_area(way) else None
            is_there = wall is not None and (self.part is None or self.part.has_part_of(way))
            if is_there and self.lines.add(way, way.tags, self.part):
                self.walls.append(wall)
                own.append(len(self.lines.ids) - 1)
        missing = {*chain.from_iterable(ways_of)} - self.lines.rows_of.keys()
        for way in _read_ids(source, missing, self.part):
            self.lines.add(way, {}, self.part)
        if self.part is None:
            self.lines.complete(lambda _: None)
        self.rows_of = [find_rows_around(ids, self.lines.rows_of) for ids in ways_of] + [[row] for row in own]

    def _add_multipolygons(self, relations: _Relations) -> list[list[int]]:
        """Add the walls of relations, and return the ids of the ways around each."""
        ways_of: list[list[int]] = []
        for _, tags, rings in relations.list_rings():
            wall = self.rules.find_wall(tags)
            if wall is not None:
                self.walls.append(wall)
                ways_of.append(rings)
        return ways_of

    def get_outlines(self) -> Outlines:
        offsets = np.array(self.lines.offsets, np.int64)
        # Several relations may share a way.
        points = sum(int(offsets[row + 1] - offsets[row]) for row in chain.from_iterable(self.rows_of))
        self.lines.budget.charge(self.lines.bytes_per_point * points)
        return make_outlines_of_ways(offsets, self.lines.get_lonlat(), self.rows_of, self.walls)


def read_buildings(source: MapSource, part: "_ClippedNodes | None" = None) -> BuildingIndex:
    """Return the buildings of a map that block roads, which are read when they are needed."""
    return BuildingIndex(lambda: _read_shapes(source, part))


def _read_shapes(source: MapSource, part: "_ClippedNodes | None") -> Shapes:
    """Read the buildings that block roads, in degrees and in any order."""
    found = _FootprintReader(_BuildingRules(), _WayVertices(source, _BYTES_PER_CORNER), part)
    with source.convert_errors():
        found.read()
    return make_footprints(found.get_outlines())


class _BuildingRules:
    """The rules for areas that block ways."""

    def __init__(self) -> None:
        self.keys = ["building"]

    def find_wall(self, tags: Mapping[str, str]) -> object | None:
        """Return True for an area that blocks ways, else None."""
        return is_in_the_way(tags) or None
