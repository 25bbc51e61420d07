"""Contracts of a graph and of the graph engine; their values are in `graph_values.py` and offered here, too."""
# ruff: noqa: ARG002 - a default that refuses reads no arguments

import os
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from math import inf, pi
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from gamms import kernels
from gamms.errors import BadValue, NotOffered
from gamms.ir.graph import FloatArray, GraphColumns
from gamms.ir.scenery import Scenery
from gamms.text import shown
from gamms.typing.graph_values import (
    Corner,
    Engine,
    Node,
    NodeColumns,
    NodeGround,
    NodeIds,
    Numbers,
    ObsFace,
    OSMEdge,
    Surroundings,
)
from gamms.typing.map_storage import IMapStorage, IPackedGraph
from gamms.typing.obstacles import IObstacles, IVisibility
from gamms.typing.routes import EdgeRoutes, NearestEdge, RouteQueries, Routes

if TYPE_CHECKING:
    import networkx as nx
    from numpy.random import Generator

__all__ = [
    "Corner",
    "Engine",
    "IGraph",
    "IGraphEngine",
    "IMapStorage",
    "IObstacles",
    "IPackedGraph",
    "IVisibility",
    "NearestEdge",
    "Node",
    "NodeColumns",
    "NodeGround",
    "NodeIds",
    "Numbers",
    "OSMEdge",
    "ObsFace",
    "RouteQueries",
    "Routes",
    "Surroundings",
]


class IGraph(ABC):
    """A directed graph in the plane; parallel edges and self-loops are allowed.

    Ids are integers (NumPy's too, normalised to `int`), coordinates and lengths finite floats. A caller's dict is
    never changed and never kept. A call that raises has changed nothing.
    """

    scenery: str | Scenery | None = None
    """What is drawn with the graph and blocks no sight, or the name of one that comes with GAMMS; None: nothing."""

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
        """Return the node with that id (KeyError)."""

    @abstractmethod
    def get_edge(self, edge_id: int) -> OSMEdge:
        """Return the edge with that id (KeyError)."""

    @abstractmethod
    def get_nodes(self, d: float = -1.0, x: float = 0.0, y: float = 0.0) -> Iterator[int]:
        """Return ids of the nodes whose Euclidean distance to (x, y) is <= d, in insertion order; all for `d < 0`."""

    @abstractmethod
    def get_edges(self, d: float = -1.0, x: float = 0.0, y: float = 0.0) -> Iterator[int]:
        """Return the ids of the edges with an end node within d of (x, y), in insertion order; all for `d < 0`."""

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
        """Return unique targets of the edges leaving a node, in edge insertion order; KeyError at the call."""

    # -- may override for speed ---------------------------------------------------------------------------------

    @property
    def revision(self) -> int | None:
        """A number that changes with every change of the graph; None means: never remember anything."""
        return None

    def has_node(self, node_id: int) -> bool:
        """Return whether there is a node with that id."""
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
        """Return what lies within `radius` (may be infinite) of a node and inside its field of view, the rims included.

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
        ids, xy = self.nodes_near(here.x, here.y, radius)
        if fov != 2.0 * pi and heading != (0.0, 0.0):
            ids = ids[kernels.in_cone(xy[:, 0] - here.x, xy[:, 1] - here.y, heading, fov)]
        return self.among(ids)

    def within_many(self, node_ids: Sequence[int] | np.ndarray[Any, Any], radius: float) -> list[Surroundings]:
        """Return what `within` returns all around each of several nodes, which is faster than one by one.

        Raises:
            UnknownName (KeyError): there is no such node.
            BadValue (ValueError): the radius is negative or NaN.
        """
        return [self.within(int(id), radius) for id in node_ids]

    def nodes_near(self, x: float, y: float, radius: float) -> NodeColumns:
        """Return the nodes within `radius` (may be infinite) of (x, y), the rim included, as arrays in insertion order.

        Raises:
            BadValue (ValueError): the radius is negative or NaN.
        """
        if not radius >= 0.0:
            raise BadValue(f"The radius must not be negative, not {radius}.")
        ids = np.fromiter(self.get_nodes() if radius == inf else self.get_nodes(radius, x, y), np.int64)
        return NodeColumns(ids, self.positions(ids))

    def among(self, node_ids: Sequence[int] | np.ndarray[Any, Any]) -> Surroundings:
        """Return some nodes, and the edges with both ends among them, both in insertion order (KeyError)."""
        wanted = {int(id) for id in node_ids}
        found = {id: self.get_node(id) for id in wanted}  # KeyError for those that are not there
        nodes = {id: found[id] for id in self.get_nodes() if id in wanted}
        edges = (self.get_edge(id) for id in self.get_edges())
        return Surroundings(nodes, [edge for edge in edges if edge.source in nodes and edge.target in nodes])

    def clear(self) -> None:
        """Remove every node and edge."""
        for node_id in list(self.get_nodes()):
            self.remove_node(node_id)

    def positions(self, node_ids: Sequence[int] | np.ndarray[Any, Any]) -> FloatArray:
        """Return coordinates (nodes, 2) of several nodes (KeyError)."""
        nodes = [self.get_node(int(id)) for id in node_ids]
        return np.array([(node.x, node.y) for node in nodes], np.float64).reshape(-1, 2)

    def ground(self, node_ids: Sequence[int] | np.ndarray[Any, Any]) -> NodeGround | None:
        """Return the ground at several nodes; None for a map that is flat and has no tunnels.

        It is what the attributes `z`, a height, and `underground`, the number of a tunnel, say of a node. What looks
        past obstacles sees from a node those in the same tunnel, and from the surface those on it.
        """
        return None

    # -- routing: may override for speed ---------------------------------------------------------------------------
    #
    # A `weight` is "length", the name of an edge attribute (an edge without it counts 1), or None (every edge counts
    # 1), as networkx says it. An infinite one closes its edge; of parallel edges the cheapest counts. One that is
    # negative or NaN is a BadValue (ValueError), one that is no number a BadType (TypeError): both name the edge.

    def weights(self, weight: str | None = "length") -> FloatArray:
        """Return what each edge costs, (edges,) in insertion order."""
        if weight not in ("length", None):
            raise BadValue(
                f"{type(self).__name__} reads no attribute {shown(weight)} of its edges: override `weights`."
            )
        edges = [self.get_edge(id) for id in self.get_edges()]
        return np.array([edge.length if weight else 1.0 for edge in edges], np.float64)

    def shortest_path(
        self, source: int, target: int, weight: str | None = "length", most_edges: int | None = None
    ) -> list[int]:
        """Return ids of the nodes on the shortest path from one node to another, both included; `[source]` for itself.

        Of equally long paths, by the numbers that `distance` gives for each node on them, the one with the fewest
        edges counts; of these, the one whose node ids, read from the source, are least at the first difference.
        `most_edges` cuts it off after so many edges: an agent needs no more for its next steps.

        Raises:
            UnknownName (KeyError): there is no such node.
            NoPath (ValueError): there is no path.
        """
        return self._routes_now().shortest_path(source, target, weight, most_edges)

    def distance(self, source: int, target: int, weight: str | None = "length") -> float:
        """Return the distance from one node to another, summed from the target; infinite where there is no path.

        Raises:
            UnknownName (KeyError): there is no such node.
        """
        return self._routes_now().distance(source, target, weight)

    def distances(
        self,
        source: NodeIds | None = None,
        target: NodeIds | None = None,
        weight: str | None = "length",
        cutoff: float | None = None,
    ) -> dict[int, float]:
        """Return the distances by path from a node to every other, or from every other to a node.

        Args:
            source: from here, or from the nearest of several nodes.
            target: to here, or to the nearest of several nodes; give either source or target.
            weight: see above.
            cutoff: leave out what is farther away than this.

        Returns:
            Node id -> distance, summed from the end that was given, for every node with a path; a fresh dict in
            insertion order.

        Raises:
            UnknownName (KeyError): there is no such node.
            BadValue (ValueError): both or neither of source and target, or a negative cutoff.
        """
        return self._routes_now().distances(source, target, weight, cutoff)

    def distance_matrix(self, sources: NodeIds, targets: NodeIds, weight: str | None = "length") -> FloatArray:
        """Return the distances by path from each of some nodes to each of others.

        Returns:
            (sources, targets) infinite where there is no path; summed from the targets, or from the sources where
            fewer different ones are given.

        Raises:
            UnknownName (KeyError): there is no such node.
        """
        return self._routes_now().distance_matrix(sources, targets, weight)

    def _routes_now(self) -> Routes:
        ends = [(edge.source, edge.target) for edge in map(self.get_edge, self.get_edges())]
        return EdgeRoutes(list(self.get_nodes()), ends, self.weights)

    # -- places: may override -----------------------------------------------------------------------------------

    def to_latlon(self, x: Numbers, y: Numbers) -> tuple[Any, Any]:
        """Return degrees of latitude and longitude (WGS84) of map units: floats for numbers, arrays for arrays.

        Raises:
            BadValue (ValueError): the graph has no CRS, or a place lies outside its projection.
            MissingExtra (ImportError): the CRS is no zone of UTM, and the extra `osm` is not installed.
        """
        raise NotOffered(self, "to_latlon")

    def from_latlon(self, *, lat: Numbers, lon: Numbers) -> tuple[Any, Any]:
        """Return (x, y) in map units of degrees of latitude and longitude (WGS84); raises as `to_latlon` does."""
        raise NotOffered(self, "from_latlon")

    def nearest_node(
        self,
        x: Numbers | None = None,
        y: Numbers | None = None,
        *,
        lat: Numbers | None = None,
        lon: Numbers | None = None,
        within: float | None = None,
    ) -> Any:
        """Return the id of the node nearest to (x, y), or to degrees; for arrays of places, an array (places,) of ids.

        The straight line counts. Of several equally near nodes, the first in insertion order is meant.

        Raises:
            BadValue (ValueError): the graph has no nodes, or the place is none; or it is farther from the nearest node
                than `within` map units. Without `within`, degrees are refused that are farther than the map is wide,
                and farther than a kilometre.
            BadType (TypeError): not exactly one of (x, y) and (lat, lon) is given.
        """
        raise NotOffered(self, "nearest_node")

    def place(
        self,
        n: int,
        near: int | tuple[float, float] | None = None,
        radius: float | None = None,
        apart: float = 0.0,
        rng: "Generator | int | None" = None,
    ) -> list[int]:
        """Return ids of `n` different nodes, drawn at random.

        Args:
            n: how many.
            near: a node id or (x, y); None draws from the whole graph.
            radius: map units around `near`, the rim included.
            apart: the least straight distance between two of them, map units.
            rng: the source of random numbers: a generator, such as `ctx.rng`, or a seed; see `GraphEngine.place`.

        Raises:
            BadValue (ValueError): so many do not fit; the message says how many did.
            BadType (TypeError): there is no `rng`, or an argument is of the wrong type.
            UnknownName (KeyError): `near` is no node.
        """
        raise NotOffered(self, "place")


class _Neighborhoods(dict[int, Sequence[int]]):
    """The slow default: asks the graph every time."""

    def __init__(self, graph: IGraph) -> None:
        self._graph = graph

    def __missing__(self, node_id: int) -> Sequence[int]:
        return [node_id, *(other for other in self._graph.get_neighbors(node_id) if other != node_id)]


class IGraphEngine(IObstacles):
    """Owns the graph and its obstacles."""

    @property
    @abstractmethod
    def graph(self) -> IGraph:
        """The graph (ContextTerminated after the end)."""

    @abstractmethod
    def columns(self) -> GraphColumns:
        """Return the graph as read-only arrays, one revision of it."""

    @abstractmethod
    def attach_networkx_graph(self, G: "nx.Graph[Any]") -> IGraph:  # noqa: N803 - published name
        """Add any networkx graph to what is there, all or nothing (ValueError)."""

    @abstractmethod
    def save(self, path: str | os.PathLike[str] | None = None) -> None:
        """Write graph, obstacles, CRS and attributes into one file, or into the engine's own database."""

    @abstractmethod
    def load(self, path: str | os.PathLike[str] | None = None) -> IGraph:
        """Replace graph and obstacles by those in a file that `save` wrote, or in the engine's own database.

        Raises:
            BadFile (ValueError): the file is damaged or foreign.
        """

    @property
    def routes(self) -> RouteQueries:
        """Routing queries that ask of several paths or places: k shortest paths, isochrones, the nearest of many."""
        return RouteQueries(self.graph._routes_now(), self.columns)

    def visibility(
        self,
        radius: float,
        observer_height: float = 1.6,
        *,
        path: str | os.PathLike[str] | Literal[False] | None = None,
        progress: bool = False,
        workers: int | None = None,
    ) -> IVisibility:
        """Return which nodes within `radius` of each node no face hides, computed once and looked up from then on.

        Args:
            radius: map units on the plan, the rim included; may be infinite.
            observer_height: of both ends of every sight line, above the ground of their nodes.
            path: the file or folder where the table is stored. None: in the user's cache folder; False: nowhere.
            progress: show the progress on the terminal.
            workers: how many processes share the work, which changes nothing but the time; None: as many as pay.

        Returns:
            The table, which holds until nodes or obstacles change; then call this again.

        Raises:
            BadValue (ValueError), BadType (TypeError): an impossible argument.
            OSError: `path` cannot be written.
        """
        raise NotOffered(self, "visibility")

    def visibility_table(self, radius: float, observer_height: float = 1.6) -> IVisibility | None:
        """Return a current table that `visibility` made, of that height and at least that radius, if there is one."""
        return None

    @abstractmethod
    def terminate(self) -> None:
        """Release the graph, and write what a database has to hold."""

    @property
    def storage(self) -> IMapStorage:
        """The map as bytes and as snapshots, for recorders and games."""
        raise NotOffered(self, "storage")
