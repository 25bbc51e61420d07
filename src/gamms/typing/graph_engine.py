"""Contract of the graph room, and its values: Node, OSMEdge, ObsFace."""

import os
from abc import ABC, abstractmethod
from collections import namedtuple
from collections.abc import Iterator, Mapping, Sequence
from enum import Enum
from math import inf, pi
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import numpy as np

from gamms import kernels
from gamms.errors import BadValue
from gamms.ir import geometry
from gamms.ir.graph import FloatArray, GraphColumns

if TYPE_CHECKING:
    import networkx as nx
    from shapely import LineString

Corner = tuple[float, float, float]


class Engine(Enum):
    """Where a graph lives besides memory: nowhere, or in a database file."""

    MEMORY = 0
    SQLITE = 1


class Node(NamedTuple):
    """A node: an immutable value."""

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

else:  # a plain namedtuple may be subclassed with a `__new__` of its own
    _EdgeFields = namedtuple("_EdgeFields", "id source target length first last")  # noqa: PYI024


class OSMEdge(_EdgeFields):
    """A directed edge: an immutable value with `id`, `source`, `target`, `length` and `linestring`.

    A straight edge keeps its end nodes in `first` and `last`; any other keeps its polyline, flat, in `first`, and
    None in `last`. Use `points` or `linestring`, which hide the difference.
    """

    # NOTE: a tuple of what is there already, because sensing makes hundreds of them (benchmarks/README.md, w3).

    def __new__(cls, id: int, source: int, target: int, length: float, linestring: Any) -> Self:
        """Take the polyline as a LineString or as a sequence of (x, y) pairs."""
        points = geometry.points_of(linestring, f"The linestring of edge {id}")
        return tuple.__new__(cls, (id, source, target, length, tuple(points.ravel().tolist()), None))

    @property
    def points(self) -> tuple[float, ...]:
        """The polyline, flat: `(x0, y0, x1, y1, …)`."""
        if self.last is None:
            flat: tuple[float, ...] = self.first
            return flat
        return (self.first.x, self.first.y, self.last.x, self.last.y)

    @property
    def linestring(self) -> "LineString":
        """The polyline as a shapely LineString, made on first access."""
        made = self.__dict__.get("linestring")
        if made is None:
            made = self.__dict__["linestring"] = geometry.line_string(np.reshape(self.points, (-1, 2)))
        return made

    def __eq__(self, other: object) -> bool:
        """Compare by value."""
        return isinstance(other, OSMEdge) and self[:4] == other[:4] and self.points == other.points

    def __ne__(self, other: object) -> bool:
        """Compare by value."""
        return not self == other

    def __hash__(self) -> int:
        return hash(self[:4])

    def __repr__(self) -> str:
        """Show the fields under their published names."""
        return (
            f"OSMEdge(id={self.id!r}, source={self.source!r}, target={self.target!r}, "
            f"length={self.length!r}, linestring={self.linestring!r})"
        )

    def __getnewargs__(self) -> tuple[Any, ...]:
        """Pickle and copy through the constructor."""
        return (self.id, self.source, self.target, self.length, np.reshape(self.points, (-1, 2)))


class ObsFace(NamedTuple):
    """An obstacle: a quadrangle in space, an immutable value."""

    id: int
    tr: Corner
    tl: Corner
    br: Corner
    bl: Corner
    type: int


class Surroundings(NamedTuple):
    """Nodes in a disc by id, and the edges that have both ends among them; both in insertion order."""

    nodes: dict[int, Node]
    edges: list[OSMEdge]


class IGraph(ABC):
    """A directed graph in the plane; parallel edges and self-loops are allowed.

    Ids are integers (NumPy's too, normalised to `int`), coordinates and lengths finite floats. A caller's dict is
    never changed and never kept. A call that raises has changed nothing.
    """

    # -- must write ---------------------------------------------------------------------------------------------

    @abstractmethod
    def add_node(self, node_data: dict[str, Any]) -> None:
        """Add a node: `id`, `x`, `y`; any other key is kept as an attribute.

        Raises:
            KeyError: the id is taken.
            ValueError: a missing key, or a coordinate that is not finite.
            TypeError: an id that is no integer, a coordinate that is no number.
        """

    @abstractmethod
    def add_edge(self, edge_data: dict[str, Any]) -> None:
        """Add an edge: `id`, `source`, `target`, `length`, optionally `linestring`; other keys are attributes.

        Raises:
            KeyError: the id is taken, `source` or `target` is not given or no node.
            ValueError: a missing `id` or `length`, a bad length or linestring.
            TypeError: an id that is no integer, a length that is no number.
        """

    @abstractmethod
    def get_node(self, node_id: int) -> Node:
        """The node with that id (KeyError)."""

    @abstractmethod
    def get_edge(self, edge_id: int) -> OSMEdge:
        """The edge with that id (KeyError)."""

    @abstractmethod
    def get_nodes(self, d: float = -1.0, x: float = 0.0, y: float = 0.0) -> Iterator[int]:
        """Ids of the nodes whose Euclidean distance to (x, y) is <= d, in insertion order; all for `d < 0`."""

    @abstractmethod
    def get_edges(self, d: float = -1.0, x: float = 0.0, y: float = 0.0) -> Iterator[int]:
        """Ids of the edges with at least one end node within d of (x, y), in insertion order; all for `d < 0`."""

    @abstractmethod
    def update_node(self, node_data: dict[str, Any]) -> None:
        """Change the given keys of the node `id` (ValueError without `id`, KeyError for an unknown one)."""

    @abstractmethod
    def update_edge(self, edge_data: dict[str, Any]) -> None:
        """Change the given keys of the edge `id` (ValueError without `id`, KeyError for an unknown id or node)."""

    @abstractmethod
    def remove_node(self, node_id: int) -> None:
        """Remove a node and the edges at it; a missing node is no error."""

    @abstractmethod
    def remove_edge(self, edge_id: int) -> None:
        """Remove an edge (KeyError)."""

    @abstractmethod
    def get_neighbors(self, node_id: int) -> Iterator[int]:
        """Unique targets of the edges leaving a node, in edge insertion order; KeyError at the call."""

    # -- may override for speed ---------------------------------------------------------------------------------

    @property
    def revision(self) -> int | None:
        """A number that changes with every change of the graph; None means: never remember anything."""
        return None

    def has_node(self, node_id: int) -> bool:
        """Whether there is a node with that id."""
        try:
            self.get_node(node_id)
        except KeyError:
            return False
        return True

    @property
    def neighborhoods(self) -> Mapping[int, Sequence[int]]:
        """Live and read-only: node id -> the node itself, then its neighbours (KeyError).

        Only `[id]` is promised; whatever `in` or iteration answer, a graph may hold more.
        """
        return _Neighborhoods(self)

    def within(
        self, node_id: int, radius: float, fov: float = 2.0 * pi, heading: tuple[float, float] = (0.0, 0.0)
    ) -> Surroundings:
        """What lies within `radius` (may be infinite) of a node and inside its field of view, the rims included.

        Args:
            node_id: where the observer stands; its own node is always seen.
            radius: map units.
            fov: full opening angle in radians; exactly 2 pi sees all around.
            heading: `(cos, sin)` of the direction of view; (0.0, 0.0) sees all around.

        Raises:
            UnknownName (KeyError): there is no such node.
            BadValue (ValueError): the radius is negative or NaN.
        """
        here = self.get_node(node_id)
        if not radius >= 0.0:
            raise BadValue(f"The radius must not be negative, not {radius}.")
        disc = (-1.0,) if radius == inf else (radius, here.x, here.y)
        nodes = {id: self.get_node(id) for id in self.get_nodes(*disc)}
        if fov != 2.0 * pi and heading != (0.0, 0.0):
            offsets = np.array([(node.x - here.x, node.y - here.y) for node in nodes.values()])
            seen = kernels.in_cone(offsets[:, 0], offsets[:, 1], heading, fov)
            nodes = {node.id: node for node, is_seen in zip(nodes.values(), seen.tolist(), strict=True) if is_seen}
        edges = (self.get_edge(id) for id in self.get_edges(*disc))
        return Surroundings(nodes, [edge for edge in edges if edge.source in nodes and edge.target in nodes])

    def clear(self) -> None:
        """Remove every node and edge."""
        for node_id in list(self.get_nodes()):
            self.remove_node(node_id)

    def positions(self, node_ids: Sequence[int] | np.ndarray[Any, Any]) -> FloatArray:
        """Coordinates (nodes, 2) of several nodes (KeyError)."""
        nodes = [self.get_node(int(id)) for id in node_ids]
        return np.array([(node.x, node.y) for node in nodes], np.float64).reshape(-1, 2)


class _Neighborhoods(dict[int, Sequence[int]]):
    """The slow default: asks the graph every time."""

    def __init__(self, graph: IGraph) -> None:
        self._graph = graph

    def __missing__(self, node_id: int) -> Sequence[int]:
        return [node_id, *(other for other in self._graph.get_neighbors(node_id) if other != node_id)]


class IGraphEngine(ABC):
    """Owns the graph and its obstacles."""

    @property
    @abstractmethod
    def graph(self) -> IGraph:
        """The graph (ContextTerminated after the end)."""

    @abstractmethod
    def columns(self) -> GraphColumns:
        """The graph as read-only arrays, one revision of it."""

    @abstractmethod
    def attach_networkx_graph(self, G: "nx.Graph[Any]") -> IGraph:  # noqa: N803 - published name
        """Add any networkx graph to what is there, all or nothing (ValueError)."""

    @abstractmethod
    def save(self, path: str | os.PathLike[str] | None = None) -> None:
        """Write graph, obstacles, CRS and attributes into one file, or into the engine's own database."""

    @abstractmethod
    def load(self, path: str | os.PathLike[str]) -> IGraph:
        """Replace graph and obstacles by those in a file that `save` wrote (BadFile, a ValueError)."""

    @abstractmethod
    def add_obstacle_face(self, face_id: int, tr: Corner, tl: Corner, br: Corner, bl: Corner, type: int) -> None:
        """Add a quadrangle (KeyError for a taken id, ValueError for a bad corner)."""

    @abstractmethod
    def remove_obstacle_face(self, face_id: int) -> None:
        """Remove a quadrangle (KeyError)."""

    @abstractmethod
    def get_obstacle_face(self, face_id: int) -> ObsFace:
        """A quadrangle by id (KeyError)."""

    @abstractmethod
    def get_obstacle_faces(self, d: float = -1.0, x: float = 0.0, y: float = 0.0) -> Iterator[int]:
        """Ids of the faces whose bounding box meets the square of half side d around (x, y); all for `d < 0`."""

    @abstractmethod
    def terminate(self) -> None:
        """Close the room."""
