"""Values that a graph engine takes and returns: nodes, edges, obstacle faces, and the results of range queries."""

from collections import namedtuple
from collections.abc import Iterable, Iterator, Sequence
from enum import Enum
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import numpy as np

from gamms.ir import geometry
from gamms.ir.graph import FloatArray, IntArray

if TYPE_CHECKING:
    from shapely import LineString

Corner = tuple[float, float, float]
NodeIds = int | Iterable[int]  # one id or several, also as a NumPy array
Numbers = float | Sequence[float] | FloatArray  # one number or several


class Engine(Enum):
    """The storage of a graph: memory only, or also a database file."""

    MEMORY = 0
    SQLITE = 1


class Node(NamedTuple):
    """A node: an immutable value; `x` and `y` in map units, metres on maps."""

    id: int
    x: float
    y: float


if TYPE_CHECKING:

    class _EdgeFields(NamedTuple):
        id: int
        source: int
        target: int
        length: float
        first: Any
        last: Any

else:  # a plain namedtuple may be subclassed with its own `__new__`
    _EdgeFields = namedtuple("_EdgeFields", "id source target length first last")  # noqa: PYI024 - the typed one is above


class OSMEdge(_EdgeFields):
    """A directed edge: an immutable value with `id`, `source`, `target`, `length` (map units) and `linestring`.

    A straight edge stores its end nodes in `first` and `last`; any other edge stores its flat polyline in `first`, and
    None in `last`. Use `points` or `linestring`, which hide the difference.
    """

    # NOTE: a tuple of existing values, because sensing makes hundreds of edges (benchmarks: sense).

    __match_args__ = ("id", "source", "target", "length", "linestring")

    def __new__(cls, id: int, source: int, target: int, length: float, linestring: Any = None) -> Self:
        """Make an edge; the polyline is a LineString or a sequence of (x, y) pairs, or None."""
        if linestring is None:
            return tuple.__new__(cls, (id, source, target, length, (), None))
        points = geometry.read_points(linestring, f"The linestring of edge {id}")
        return tuple.__new__(cls, (id, source, target, length, tuple(points.ravel().tolist()), None))

    @property
    def points(self) -> tuple[float, ...]:
        """The polyline, flat: `(x0, y0, x1, y1, …)`."""
        if self.last is None:
            flat: tuple[float, ...] = self.first
            return flat
        return (self.first.x, self.first.y, self.last.x, self.last.y)

    @property
    def linestring(self) -> "LineString | None":
        """The polyline as a shapely LineString, made on first access; None for an edge without a polyline."""
        if not self.points:
            return None
        made = self.__dict__.get("linestring")
        if made is None:
            made = geometry.make_line_string(np.reshape(self.points, (-1, 2)))
            self.__dict__["linestring"] = made
        return made

    def __setattr__(self, name: str, value: Any) -> None:
        """Raise AttributeError: edges are shared, immutable values."""
        raise AttributeError(f"Edges are immutable; use graph.update_edge to set {name!r}.")

    def __iter__(self) -> Iterator[Any]:
        """Iterate over the published fields."""
        return iter((*self[:4], self.linestring))

    def _asdict(self) -> dict[str, Any]:
        """Return the published fields as a dict."""
        return dict(zip(self.__match_args__, self, strict=True))

    def __eq__(self, other: object) -> bool:
        """Compare by value."""
        return isinstance(other, OSMEdge) and self[:4] == other[:4] and self.points == other.points

    def __ne__(self, other: object) -> bool:
        """Compare by value."""
        return not self == other

    def __hash__(self) -> int:
        return hash(self[:4])

    def __repr__(self) -> str:
        """Return a text with the fields under their published names."""
        return (
            f"OSMEdge(id={self.id!r}, source={self.source!r}, target={self.target!r}, "
            f"length={self.length!r}, linestring={self.linestring!r})"
        )

    def __getnewargs__(self) -> tuple[Any, ...]:
        """Return the constructor arguments, for pickle and copy."""
        points = np.reshape(self.points, (-1, 2)) if self.points else None
        return (self.id, self.source, self.target, self.length, points)


class ObsFace(NamedTuple):
    """An obstacle: a quadrangle in space, an immutable value.

    Corners are (x, y, z) in map units: top right and left, bottom right and left.
    """

    id: int
    tr: Corner
    tl: Corner
    br: Corner
    bl: Corner
    type: int  # kind of obstacle, which gives its color: 0 to 31 have one, see `gamms.osm.HEIGHT_ESTIMATES_TYPES`


class NodeColumns(NamedTuple):
    """Some nodes as arrays, in insertion order."""

    ids: IntArray  # (nodes,)
    xy: FloatArray  # (nodes, 2)


class NodeGround(NamedTuple):
    """The height of the ground, and the tunnel, at some nodes."""

    z: FloatArray  # (nodes,)  height of the ground; 0 if unknown
    tunnels: IntArray  # (nodes,)  number of the node's tunnel; 0 on the surface

    def find_eyes(self, xy: FloatArray, height: float) -> FloatArray:
        """Return the points (nodes, 3) at a height above the ground of these nodes."""
        return np.column_stack([xy, self.z + height])


class Surroundings(NamedTuple):
    """Nodes in a disc by id, and the edges with both ends among them; both in insertion order."""

    nodes: dict[int, Node]
    edges: list[OSMEdge]
