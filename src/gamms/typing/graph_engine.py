"""Contracts of graphs and of the graph engine; the values of `graph_values.py` can also be imported from here."""
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

    Ids are integers (also NumPy's, converted to `int`), coordinates and lengths finite floats. A caller's dict is never
    changed or stored. A call that raises has changed nothing.
    """

    scenery: str | Scenery | None = None
    """The base map, which is drawn and blocks no sight, or the name of one included in GAMMS; None: no base map."""

    # -- to implement -------------------------------------------------------------------------------------------

    @abstractmethod
    def add_node(self, node_data: dict[str, Any]) -> None:
        """Add a node: `id`, `x`, `y`; all other keys become attributes.

        Raises:
            KeyError: the id is taken.
            ValueError: a key is missing, or a coordinate is not finite.
            TypeError: the id is not an integer, or a coordinate is not a number.
        """

    @abstractmethod
    def add_edge(self, edge_data: dict[str, Any]) -> None:
        """Add an edge: `id`, `source`, `target`, `length`, optionally `linestring`; other keys are attributes.

        Raises:
            KeyError: the id is taken, or `source` or `target` is missing or not a node.
            ValueError: `id` or `length` is missing, or a length or linestring is invalid.
            TypeError: the id is not an integer, or the length is not a number.
        """

    @abstractmethod
    def get_node(self, node_id: int) -> Node:
        """Return a node by id (KeyError)."""

    @abstractmethod
    def get_edge(self, edge_id: int) -> OSMEdge:
        """Return an edge by id (KeyError)."""

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
        """Remove a node and its edges; a missing node is ignored."""

    @abstractmethod
    def remove_edge(self, edge_id: int) -> None:
        """Remove an edge (KeyError)."""

    @abstractmethod
    def get_neighbors(self, node_id: int) -> Iterator[int]:
        """Return the unique targets of the edges leaving a node, in edge insertion order (KeyError at the call)."""

    # -- to override for speed ----------------------------------------------------------------------------------

    @property
    def revision(self) -> int | None:
        """A number that changes with every change of the graph; None means that nothing may be cached."""
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
        """A live read-only mapping: node id -> the node itself, then its neighbors (KeyError).

        Use only `[id]`: `in` and iteration may be incomplete.
        """
        return _Neighborhoods(self)

    def within(
        self, node_id: int, radius: float, fov: float = 2.0 * pi, heading: tuple[float, float] = (0.0, 0.0)
    ) -> Surroundings:
        """Return the nodes and edges within `radius` (may be infinite) of a node and inside its field of view.

        Args:
            node_id: node of the observer; it is always included.
            radius: map units; the border is included.
            fov: full opening angle in radians, border included; exactly 2 pi looks in all directions.
            heading: the viewing direction `(cos, sin)`; (0.0, 0.0) looks in all directions.

        Raises:
            UnknownName (KeyError): the node does not exist.
            BadValue (ValueError): the radius is negative or NaN.
        """
        here = self.get_node(node_id)
        ids, xy = self.nodes_near(here.x, here.y, radius)
        if fov != 2.0 * pi and heading != (0.0, 0.0):
            ids = ids[kernels.find_in_cone(xy[:, 0] - here.x, xy[:, 1] - here.y, heading, fov)]
        return self.among(ids)

    def nodes_near(self, x: float, y: float, radius: float) -> NodeColumns:
        """Return the nodes within `radius` (may be infinite) of (x, y), border included, as arrays in insertion order.

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
        found = {id: self.get_node(id) for id in wanted}  # KeyError for unknown ids
        nodes = {id: found[id] for id in self.get_nodes() if id in wanted}
        edges = (self.get_edge(id) for id in self.get_edges())
        return Surroundings(nodes, [edge for edge in edges if edge.source in nodes and edge.target in nodes])

    def clear(self) -> None:
        """Remove every node and edge."""
        for node_id in list(self.get_nodes()):
            self.remove_node(node_id)

    def positions(self, node_ids: Sequence[int] | np.ndarray[Any, Any]) -> FloatArray:
        """Return the coordinates (nodes, 2) of several nodes (KeyError)."""
        nodes = [self.get_node(int(id)) for id in node_ids]
        return np.array([(node.x, node.y) for node in nodes], np.float64).reshape(-1, 2)

    def ground(self, node_ids: Sequence[int] | np.ndarray[Any, Any]) -> NodeGround | None:
        """Return the ground at several nodes; None for a flat map without tunnels.

        The ground is given by the node attributes `z`, a height, and `underground`, the number of a tunnel. Occluded
        sensors see from a node the nodes in the same tunnel, and from the surface the nodes on the surface.
        """
        return None

    # -- routing: to override for speed
    # ----------------------------------------------------------------------------
    #
    # A `weight` is "length", the name of an edge attribute (1 for edges without it), or None (1 for every edge),
    # as in networkx. An infinite weight closes an edge; of parallel edges the cheapest counts. A negative weight
    # or NaN is a BadValue (ValueError), a weight that is not a number a BadType (TypeError): both name the edge.

    def weights(self, weight: str | None = "length") -> FloatArray:
        """Return the weight of each edge, (edges,) in insertion order."""
        if weight not in ("length", None):
            raise BadValue(
                f"{type(self).__name__} reads no attribute {shown(weight)} of its edges: override `weights`."
            )
        edges = [self.get_edge(id) for id in self.get_edges()]
        return np.array([edge.length if weight else 1.0 for edge in edges], np.float64)

    def shortest_path(
        self,
        source: int,
        target: int,
        weight: str | None = "length",
        most_edges: int | None = None,
        *,
        turns: str | bool | None = None,
    ) -> list[int]:
        """Return the ids of the nodes on the shortest path between two nodes, both included; `[source]` for itself.

        Of equally long paths, as measured by `distance` for each node on them, the one with the fewest edges is chosen;
        of these, the one whose node ids, read from the source, are smallest at the first difference. `most_edges` cuts
        the path off after this number of edges.

        With `turns`, the path obeys the turn restrictions of the map for a mode of travel, such as "drive"; see
        `ctx.graph.routes.shortest_path_edges`.

        Raises:
            UnknownName (KeyError): a node does not exist.
            NoPath (ValueError): there is no path.
        """
        self._refuse_turns(turns)
        return self._get_routes().shortest_path(source, target, weight, most_edges)

    def distance(
        self, source: int, target: int, weight: str | None = "length", *, turns: str | bool | None = None
    ) -> float:
        """Return the length of the shortest path, summed from the target; infinite if there is no path.

        `turns`: see `shortest_path`.

        Raises:
            UnknownName (KeyError): a node does not exist.
        """
        self._refuse_turns(turns)
        return self._get_routes().distance(source, target, weight)

    def distances(
        self,
        source: NodeIds | None = None,
        target: NodeIds | None = None,
        weight: str | None = "length",
        cutoff: float | None = None,
        *,
        turns: str | bool | None = None,
    ) -> dict[int, float]:
        """Return the path lengths from a node to all nodes, or from all nodes to a node.

        Args:
            source: the start, or several: the nearest counts.
            target: the end, or several: the nearest counts; give either source or target.
            weight: see the comment above.
            cutoff: nodes farther than this are left out.
            turns: see `shortest_path`.

        Returns:
            Node id -> distance, summed from the given end, for every node with a path; a fresh dict in insertion order.

        Raises:
            UnknownName (KeyError): a node does not exist.
            BadValue (ValueError): both or neither of source and target, or a negative cutoff.
        """
        self._refuse_turns(turns)
        return self._get_routes().distances(source, target, weight, cutoff)

    def distance_matrix(self, sources: NodeIds, targets: NodeIds, weight: str | None = "length") -> FloatArray:
        """Return the path lengths between all pairs of sources and targets.

        Returns:
            (sources, targets) infinite if there is no path; summed from the targets, or from the sources if there are
            fewer different sources.

        Raises:
            UnknownName (KeyError): a node does not exist.
        """
        return self._get_routes().distance_matrix(sources, targets, weight)

    def _refuse_turns(self, turns: object) -> None:
        if turns is not None:
            raise BadValue(f"{type(self).__name__} knows no turn restrictions. Omit turns, or override the method.")

    def _get_routes(self) -> Routes:
        ends = [(edge.source, edge.target) for edge in map(self.get_edge, self.get_edges())]
        return EdgeRoutes(list(self.get_nodes()), ends, self.weights)

    # -- places: to override ------------------------------------------------------------------------------------

    def to_latlon(self, x: Numbers, y: Numbers) -> tuple[Any, Any]:
        """Convert map units to latitude and longitude (WGS84) in degrees: floats for numbers, arrays for arrays.

        Raises:
            BadValue (ValueError): the graph has no CRS, or a place lies outside its projection.
            MissingExtra (ImportError): the CRS is not a UTM zone, and the extra `osm` is not installed.
        """
        raise NotOffered(self, "to_latlon")

    def from_latlon(self, *, lat: Numbers, lon: Numbers) -> tuple[Any, Any]:
        """Convert latitude and longitude (WGS84) in degrees to (x, y) in map units; raises as `to_latlon`."""
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
        """Return the id of the node nearest to (x, y) or (lat, lon); for arrays of places, an array (places,) of ids.

        Distances are straight lines. Ties go to the first node in insertion order.

        Raises:
            BadValue (ValueError): the graph has no nodes, or the place is invalid, or farther from the nearest node
                than `within` map units. Without `within`, a place in degrees may be at most as far as the map is wide,
                or a kilometre.
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
        mode: "str | Mapping[str, str] | None" = None,
    ) -> list[int]:
        """Return the ids of `n` different random nodes.

        Args:
            n: number of nodes.
            near: a node id or (x, y); None: the whole graph.
            radius: map units around `near`, border included.
            apart: minimum straight-line distance between two of the nodes, map units.
            rng: the source of random numbers: a generator, for example `ctx.rng`, or a seed; see `GraphEngine.place`.
            mode: the mode of agents that must be able to leave the nodes, as in `create_agent`; None: any node.

        Raises:
            BadValue (ValueError): not enough nodes fit; the message says how many did.
            BadType (TypeError): `rng` is missing, or an argument has the wrong type.
            UnknownName (KeyError): `near` is not a node.
        """
        raise NotOffered(self, "place")


class _Neighborhoods(dict[int, Sequence[int]]):
    """The default of `neighborhoods`, which queries the graph at each access."""

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
        """Add a networkx graph to the current graph; on an error nothing is added (ValueError)."""

    @abstractmethod
    def save(self, path: str | os.PathLike[str] | None = None) -> None:
        """Write graph, obstacles, CRS and attributes to one file, or to the engine's own database."""

    @abstractmethod
    def load(self, path: str | os.PathLike[str] | None = None) -> IGraph:
        """Replace the graph and the obstacles by a file written by `save`, or by the engine's own database.

        Raises:
            BadFile (ValueError): the file is damaged or foreign.
        """

    @property
    def routes(self) -> RouteQueries:
        """Routing queries about several paths or nodes: k shortest paths, isochrones, the nearest of many."""
        return RouteQueries(self.graph._get_routes(), self.columns)

    def visibility(
        self,
        radius: float,
        observer_height: float = 1.6,
        *,
        path: str | os.PathLike[str] | Literal[False] | None = None,
        progress: bool = False,
        workers: int | None = None,
    ) -> IVisibility:
        """Return a table of the nodes within `radius` of each node that no face hides; computed once, then looked up.

        Args:
            radius: map units in the plane, border included; may be infinite.
            observer_height: height of both ends of every sight line above the ground at their nodes.
            path: file or folder where the table is stored. None: the user's cache folder; False: not stored.
            progress: show the progress on the terminal.
            workers: number of processes, which changes only the time; None: as many as pay off.

        Returns:
            The table, valid until nodes or obstacles change; then call this again.

        Raises:
            BadValue (ValueError), BadType (TypeError): an argument is invalid.
            OSError: `path` cannot be written.
        """
        raise NotOffered(self, "visibility")

    def visibility_table(self, radius: float, observer_height: float = 1.6) -> IVisibility | None:
        """Return an up-to-date table of this height and at least this radius, or None."""
        return None

    @abstractmethod
    def terminate(self) -> None:
        """Write pending changes to the database, and release the graph."""

    @property
    def storage(self) -> IMapStorage:
        """The map as bytes and as snapshots, for recorders and games."""
        raise NotOffered(self, "storage")
