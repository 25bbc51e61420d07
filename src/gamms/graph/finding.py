"""Find parts of a graph: streets and junctions by name, nodes and edges in a polygon."""

import unicodedata
from collections.abc import Iterable, Mapping
from itertools import islice
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from gamms.arguments import as_text
from gamms.errors import BadValue, UnknownName
from gamms.graph import positions
from gamms.ir import geometry
from gamms.ir.graph import FloatArray, GraphColumns, IntArray

if TYPE_CHECKING:
    from shapely import Polygon

_LONG = 200  # most characters of a searched name
_MANY = 20_000  # names that are compared with an unknown name for suggestions
_MOST_LISTED = 8
_ONE_JUNCTION = 50.0  # metres: nodes of one junction are at most this far from the next node
_NEAR = 30.0  # metres: gap between streets that are joined by a piece with no name or another name
_AT_ONCE = 256  # nodes


class NamedFeature(NamedTuple):
    """A named part of a graph: a street or a junction.

    Attributes:
        name: name on the map.
        nodes: ids of its nodes, in insertion order.
        edges: ids of its edges, in insertion order.
        xy: (nodes, 2) coordinates of the nodes.
        is_junction: whether this is a junction of streets.
    """

    name: str
    nodes: list[int]
    edges: list[int]
    xy: FloatArray
    is_junction: bool

    @property
    def node(self) -> int:
        """The node nearest to the center.

        Raises:
            BadValue (ValueError): the streets meet at several junctions; the message names one node of each.
        """
        clusters = _find_clusters(self.xy) if self.is_junction else [np.arange(len(self.xy))]
        off = (np.hypot(*(self.xy[rows] - self.xy[rows].mean(axis=0)).T) for rows in clusters)
        middles = [rows.item(far.argmin()) for rows, far in zip(clusters, off, strict=True)]
        if len(middles) > 1:
            places = [f"node {self.nodes[row]} at ({self.xy[row, 0]:.0f}, {self.xy[row, 1]:.0f})" for row in middles]
            raise BadValue(f"{self.name} is at {len(middles)} places: {_join_names(places)}. Use one of these nodes.")
        return self.nodes[middles[0]]


class PolygonContents(NamedTuple):
    """The nodes and edges in a polygon.

    Attributes:
        nodes: ids, in insertion order.
        edges: ids, in insertion order.
    """

    nodes: list[int]
    edges: list[int]


class StreetNames:
    """The streets of a graph by name, ignoring case and accents.

    Args:
        names: edge row -> its `name`: a text, or a list of texts.
    """

    def __init__(self, names: Mapping[int, object]) -> None:
        self._rows: dict[str, list[int]] = {}
        self._spelling: dict[str, str] = {}
        folded: dict[str, str] = {}
        for row, given in names.items():
            several = given if isinstance(given, list | tuple) else [given]
            for name in several:
                if isinstance(name, str):
                    key = folded[name] if name in folded else folded.setdefault(name, _fold_name(name))
                    self._rows.setdefault(key, []).append(row)
                    self._spelling.setdefault(key, name)

    def __contains__(self, name: object) -> bool:
        """Return whether a street has this name."""
        return isinstance(name, str) and _fold_name(name) in self._rows

    def find_rows(self, name: str) -> IntArray:
        """Return the rows of the edges of a street, in insertion order.

        Raises:
            UnknownName (KeyError): no street has this name; the message lists similar names.
            BadValue (ValueError): no edge has a name.
        """
        if not self._rows:
            raise BadValue("No edge of this graph has a name. Streets of OpenStreetMap have the attribute 'name'.")
        key = _fold_name(name)
        if key not in self._rows:
            from difflib import get_close_matches  # imported here because few programs need it

            known = list(islice(self._rows, _MANY))
            alike = get_close_matches(key, known, n=3) or [one for one in known if key and key in one]
            raise UnknownName("street", name, [self._spelling[one] for one in alike or known])
        return np.unique(np.array(self._rows[key], np.int64))

    def find_spelling(self, name: str) -> str:
        """Return a name as the map spells it."""
        return self._spelling[_fold_name(name)]

    def list_names(self, rows: Iterable[int]) -> list[str]:
        """Return the names of the streets of some edges."""
        wanted = set(rows)
        return [self._spelling[key] for key, own in self._rows.items() if not wanted.isdisjoint(own)]


def find(columns: GraphColumns, streets: StreetNames, text: str) -> NamedFeature:
    """Return a street, or the junction of the streets in "A & B"."""
    text = as_text(text, "The name to find", "the name of a street, or 'A & B'")
    if len(text) > _LONG:
        raise BadValue(f"The name of a street has at most {_LONG} characters, not {len(text)}.")
    if text in streets or "&" not in text:
        rows = streets.find_rows(text)
        return _make_feature(columns, streets.find_spelling(text), _find_nodes(columns, rows), rows, is_junction=False)
    names = [part.strip() for part in text.split("&")]
    sides = [_find_nodes(columns, streets.find_rows(name)) for name in names]
    title = " & ".join(streets.find_spelling(name) for name in names)
    shared = sides[0]
    for side in sides[1:]:
        shared = np.intersect1d(shared, side)
    if not len(shared):
        shared = _find_nearly_shared(columns, streets, names, sides)
    is_at = np.zeros(len(columns.node_ids), np.bool_)
    is_at[shared] = True
    of_streets = np.unique(np.concatenate([streets.find_rows(name) for name in names]))
    rows = of_streets[is_at[columns.sources[of_streets]] | is_at[columns.targets[of_streets]]]
    return _make_feature(columns, title, shared, rows, is_junction=True)


def find_inside(columns: GraphColumns, region: "Polygon", *, touching: bool) -> PolygonContents:
    """Return the nodes in a region, and the edges that lie in it completely or partly."""
    nodes = columns.node_ids[geometry.are_inside(region, columns.xy)]
    ends = np.stack((columns.xy[columns.sources], columns.xy[columns.targets]), axis=1)
    rows = geometry.find_lines_inside(region, ends, columns.polylines, touching=touching)
    return PolygonContents(nodes.tolist(), columns.edge_ids[rows].tolist())


def make_region(polygon: object, crs: str | None) -> "Polygon":
    """Return a polygon passed by a caller, in map units.

    Raises:
        BadValue (ValueError): not a polygon, or GeoJSON on a map without a CRS.
    """

    def from_lonlat(lonlat: FloatArray) -> FloatArray:
        return np.column_stack(positions.from_latlon(crs, lonlat[:, 1], lonlat[:, 0]))

    return geometry.make_region(polygon, "The polygon", from_lonlat)


def compute_bounds(columns: GraphColumns) -> tuple[float, float, float, float]:
    """Return (xmin, ymin, xmax, ymax) of all nodes and polylines.

    Raises:
        BadValue (ValueError): there are no nodes.
    """
    if not len(columns.node_ids):
        raise BadValue("The graph has no nodes, so it has no bounds. Add nodes first.")
    points = np.concatenate([columns.xy, *columns.polylines.values()])
    xmin, ymin, xmax, ymax = np.concatenate((points.min(axis=0), points.max(axis=0))).tolist()
    return xmin, ymin, xmax, ymax


def _fold_name(name: str) -> str:
    """Return a name in lower case, without accents and extra spaces."""
    plain = unicodedata.normalize("NFKD", name.casefold())
    return " ".join("".join(one for one in plain if not unicodedata.combining(one)).split())


def _make_feature(
    columns: GraphColumns, name: str, nodes: IntArray, edges: IntArray, *, is_junction: bool
) -> NamedFeature:
    ids = columns.node_ids[nodes].tolist(), columns.edge_ids[edges].tolist()
    return NamedFeature(name, *ids, columns.xy[nodes], is_junction)


def _find_nodes(columns: GraphColumns, rows: IntArray) -> IntArray:
    return np.unique(np.concatenate((columns.sources[rows], columns.targets[rows])))


def _find_nearly_shared(
    columns: GraphColumns, streets: StreetNames, names: list[str], sides: list[IntArray]
) -> IntArray:
    """Return the two nearest nodes of two streets, if they are close enough to form one junction."""
    first, second = names[:2]
    if len(names) == 2:
        xy = columns.xy[sides[0]]
        other = columns.xy[sides[1]]
        best = np.inf
        pair = (0, 0)
        for at in range(0, len(xy), _AT_ONCE):
            off = np.hypot(*(xy[at : at + _AT_ONCE, None] - other[None]).transpose(2, 0, 1))
            row, column = np.unravel_index(off.argmin(), off.shape)
            if off[row, column] < best:
                best = float(off[row, column])
                pair = (int(sides[0][at + row]), int(sides[1][column]))
        if best <= _NEAR:
            return np.unique(pair)
        near = f"{best:,.0f} apart at nodes {columns.node_ids[pair[0]]} and {columns.node_ids[pair[1]]}"
        hint = f"{streets.find_spelling(first)} and {streets.find_spelling(second)} do not meet: they are {near}."
    else:
        hint = f"{' & '.join(map(streets.find_spelling, names))} do not all meet at one node."
    is_at = np.zeros(len(columns.node_ids), np.bool_)
    is_at[sides[0]] = True
    rows = np.flatnonzero(is_at[columns.sources] | is_at[columns.targets])
    others = [name for name in streets.list_names(rows.tolist()) if name != streets.find_spelling(first)]
    raise BadValue(
        f"{hint} {streets.find_spelling(first)} meets {_join_names(others) or 'no other street with a name'}."
    )


def _find_clusters(xy: FloatArray) -> list[IntArray]:
    """Group the rows of places: places that a chain of short steps connects are in one group."""
    left = np.arange(len(xy))
    clusters = []
    while len(left):
        cluster = left[:1]
        left = left[1:]
        new = cluster
        while len(new) and len(left):
            is_near = np.hypot(*(xy[left, None] - xy[None, new]).transpose(2, 0, 1)).min(axis=1) <= _ONE_JUNCTION
            new = left[is_near]
            left = left[~is_near]
            cluster = np.concatenate((cluster, new))
        clusters.append(cluster)
    return clusters


def _join_names(names: list[Any]) -> str:
    rest = len(names) - _MOST_LISTED
    return ", ".join(map(str, names[:_MOST_LISTED])) + (f" and {rest} more" if rest > 0 else "")
