"""The mutable graph: every change and every query of nodes and edges goes through here."""

import logging
from collections.abc import Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import fields
from math import inf, pi
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from gamms import kernels
from gamms.arguments import as_bool, as_float, as_numbers, as_range
from gamms.compat import Surface
from gamms.core.agents import NodeNumbers
from gamms.deciding import UNDECIDED, DecidePhase, Guarded, refuse_to_judges
from gamms.errors import BadValue, DuplicateId, MissingKey, UnknownName
from gamms.graph import positions, records
from gamms.graph.routes import CachedRoutes
from gamms.graph.store import GraphStore, Neighborhoods
from gamms.ir.graph import FloatArray, GraphColumns, IntArray, as_mode, find_edge_weights, split_mode
from gamms.ir.projection import format_crs, scale_fault
from gamms.ir.scenery import Scenery
from gamms.readonly import ReadOnlyMapping, freeze
from gamms.text import shown
from gamms.typing.graph_engine import (
    IGraph,
    IPackedGraph,
    Node,
    NodeColumns,
    NodeGround,
    Numbers,
    OSMEdge,
    Surroundings,
)
from gamms.typing.graph_values import NodeIds
from gamms.typing.map_storage import IGraphSource
from gamms.typing.routes import RouteQueries

if TYPE_CHECKING:
    import networkx as nx
    from numpy.random import Generator
    from numpy.typing import ArrayLike


class Graph(Surface, Guarded, IGraph):
    """A graph over columns; `IGraph` documents each call.

    Args:
        store: the rows of the graph; None: an empty graph.
        phase: the phase of the context.
    """

    _called = "ctx.graph.graph"

    def __init__(self, store: GraphStore | None = None, phase: DecidePhase = UNDECIDED) -> None:
        self._phase = phase
        self._store = GraphStore() if store is None else store
        self._routes = CachedRoutes(self._store, type(self))
        self._queries = RouteQueries(self._routes, self.columns)
        self._shown: GraphColumns | None = None  # read-only including all attributes, for strategies

    @property
    def revision(self) -> int:
        """A number that changes with every change of the graph."""
        return self._store.revision

    @property
    def revised(self) -> GraphStore:
        """The object that counts the changes, whose `revision` is faster to read; not for strategies."""
        self._phase.refuse_look("use graph.revised")
        return self._store

    @property
    def node_numbers(self) -> NodeNumbers:
        """The numbers that agents have for the nodes; not for strategies."""
        self._phase.refuse_look("use graph.node_numbers")
        return self._store.node_numbers

    @property
    def edge_numbers(self) -> NodeNumbers:
        """The numbers that agents, rules and conflicts have for the edges; not for strategies."""
        self._phase.refuse_look("use graph.edge_numbers")
        return self._store.edge_numbers

    @property
    def crs(self) -> str | None:
        """The coordinate reference system of x and y, for example 'EPSG:32635'; None if unknown.

        Setting one whose lengths are not metres at the nodes, such as Web Mercator, logs a warning.
        """
        return self._store.crs

    @crs.setter
    def crs(self, crs: str | None) -> None:
        text = records.as_text(crs, "graph.crs")
        nodes = self._store.nodes
        self._store.crs = None if text is None else format_crs(text)
        self._store.revision += 1
        if fault := scale_fault(text, nodes.get_array("xy")[nodes.list_living()]):
            logging.getLogger("gamms").warning(f"graph.crs: {fault}.")

    @property
    def attribution(self) -> str | None:
        """The authors of the data, to be shown with the graph; None if they do not require it."""
        return self._store.attribution

    @attribution.setter
    def attribution(self, attribution: str | None) -> None:
        self._store.attribution = records.as_text(attribution, "graph.attribution")
        self._store.revision += 1

    @property
    def scenery(self) -> str | Scenery | None:
        """The base map, which is drawn and blocks no sight, or the name of a base map included in GAMMS."""
        return self._store.scenery

    @scenery.setter
    def scenery(self, scenery: str | Scenery | None) -> None:
        if not isinstance(scenery, Scenery):
            scenery = records.as_text(scenery, "graph.scenery")
        self._store.scenery = scenery
        self._store.revision += 1

    def __len__(self) -> int:
        return len(self._store.nodes)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({len(self._store.nodes)} nodes, {len(self._store.edges)} edges)"

    def __bool__(self) -> bool:
        """Return True, even for an empty graph."""
        return True

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the contents of the graph; while a strategy runs, pickle a copy."""
        return type(self), (deepcopy(self._store) if self._phase.is_deciding else self._store,)

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        """Copy the graph, for simulations by a strategy."""
        copied = type(self)(deepcopy(self._store, memo), deepcopy(self._phase, memo))
        memo[id(self)] = copied
        return copied

    def _fork(self, store: GraphStore, phase: DecidePhase) -> "Graph":
        """Return a graph for another context, on a fork of the store."""
        graph = Graph(store, phase)
        graph._routes.cache.take_over(self._routes.cache)
        return graph

    # -- single changes -----------------------------------------------------------------------------------------

    def add_node(self, node_data: dict[str, Any]) -> None:
        """Add a node."""
        phase = self._phase  # NOTE: a decorator would cost a fifth of this call (w1, one by one)
        if phase.agent is not None or phase.player is not None:
            phase.refuse("call ctx.graph.graph.add_node", changes_game=True)
        self._store.unshare_tables()
        id = records.as_id(records.get_required(node_data, "id", "A node"), "a node")
        x = records.as_coordinate(records.get_required(node_data, "x", "A node"), "x", id)
        y = records.as_coordinate(records.get_required(node_data, "y", "A node"), "y", id)
        store = self._store
        nodes = self._store.nodes
        if nodes.index.find_row(id) >= 0:
            raise DuplicateId("a node", id)
        given = records.select_extras(node_data, records.NODE_KEYS) if len(node_data) > 3 else None
        row = nodes.append(id, x, y)
        if given:
            nodes.set_attributes(row, given)
        if store.indexes.is_built:
            store.indexes.record_added_node(row)
        store.revision += 1

    def add_edge(self, edge_data: dict[str, Any]) -> None:
        """Add an edge."""
        phase = self._phase  # NOTE: a decorator would cost a fifth of this call (w1, one by one)
        if phase.agent is not None or phase.player is not None:
            phase.refuse("call ctx.graph.graph.add_edge", changes_game=True)
        self._store.unshare_tables()
        id = records.as_id(records.get_required(edge_data, "id", "An edge"), "an edge")
        length = records.as_length(records.get_required(edge_data, "length", "An edge"), id)
        source, target = self._end_rows(edge_data, id)
        store = self._store
        edges = self._store.edges
        if edges.index.find_row(id) >= 0:
            raise DuplicateId("an edge", id)
        polyline = None
        given = None
        if len(edge_data) > 4:
            polyline = records.check_polyline(edge_data.get("linestring"), id, self._find_straight_line(source, target))
            given = records.select_extras(edge_data, records.EDGE_KEYS)
        row = edges.append(id, source, target, length)
        if polyline is not None:
            edges.set_polyline(row, polyline)
        if given:
            edges.set_attributes(row, given)
        if store.indexes.is_built:
            store.indexes.record_added_edge(row, source, target)
        store.revision += 1

    def get_node(self, node_id: int) -> Node:
        """Return the node with that id."""
        nodes = self._store.nodes
        row = (
            nodes.index.find_row(node_id) if type(node_id) is int else -1
        )  # NOTE: saves 0.6 of 1.9 us for each look-up
        if row < 0:
            row = nodes.find(records.as_id(node_id, "a node", self._store))
        xy = nodes.xy
        return Node(nodes.ids[row], xy[2 * row], xy[2 * row + 1])

    def get_edge(self, edge_id: int) -> OSMEdge:
        """Return the edge with that id."""
        row = self._store.edges.find(records.as_id(edge_id, "an edge"))
        return self._store.indexes.get_edge(row)

    @refuse_to_judges
    def update_node(self, node_data: dict[str, Any]) -> None:
        """Change the given keys of a node."""
        self._store.unshare_tables()
        id = records.as_id(records.get_required(node_data, "id", "An update of a node"), "a node", self._store)
        nodes = self._store.nodes
        row = self._store.nodes.find(id)
        x = nodes.xy[2 * row]
        y = nodes.xy[2 * row + 1]
        new_x = records.as_coordinate(node_data.get("x", x), "x", id)
        new_y = records.as_coordinate(node_data.get("y", y), "y", id)
        given = records.select_extras(node_data, records.NODE_KEYS)
        nodes.set_attributes(row, given)
        if (new_x, new_y) != (x, y):
            nodes.prepare_writing()
            nodes.xy[2 * row] = new_x
            nodes.xy[2 * row + 1] = new_y
            self._store.indexes.record_moved_node(row)
        self._store.revision += 1

    @refuse_to_judges
    def update_edge(self, edge_data: dict[str, Any]) -> None:
        """Change the given keys of an edge."""
        self._store.unshare_tables()
        id = records.as_id(records.get_required(edge_data, "id", "An update of an edge"), "an edge")
        edges = self._store.edges
        row = self._store.edges.find(id)
        old_ends = (edges.sources[row], edges.targets[row])
        ids = self._store.nodes.ids
        full = {
            "source": ids[old_ends[0]],
            "target": ids[old_ends[1]],
            "length": edges.lengths[row],
            **edge_data,
        }
        ends = self._end_rows(full, id)
        length = records.as_length(full["length"], id)
        given = records.select_extras(edge_data, records.EDGE_KEYS)
        polyline = records.check_polyline(full.get("linestring"), id, self._find_straight_line(*ends))
        edges.prepare_writing()
        edges.lengths[row] = length
        edges.sources[row], edges.targets[row] = ends
        if "linestring" in edge_data or ends != old_ends:  # the old polyline does not end at the new node
            edges.straighten(row)
        if polyline is not None:
            edges.set_polyline(row, polyline)
        edges.set_attributes(row, given)
        self._store.indexes.record_changed_edge(row, old_ends, ends)
        self._store.revision += 1

    @refuse_to_judges
    def remove_node(self, node_id: int) -> None:
        """Remove a node and its edges."""
        self._store.remove_node(records.as_id(node_id, "a node", self._store))

    @refuse_to_judges
    def remove_edge(self, edge_id: int) -> None:
        """Remove an edge."""
        self._store.remove_edge(records.as_id(edge_id, "an edge"))

    # -- queries ------------------------------------------------------------------------------------------------

    def get_nodes(self, d: float = -1.0, x: float = 0.0, y: float = 0.0) -> Iterator[int]:
        """Return ids of the nodes within d of (x, y), in insertion order; all for `d < 0`."""
        store = self._store
        is_all = records.is_everywhere(d, x, y)
        return store.nodes.iterate_ids(None if is_all else store.indexes.find_nodes_within(x, y, d))

    def get_edges(self, d: float = -1.0, x: float = 0.0, y: float = 0.0) -> Iterator[int]:
        """Return the ids of the edges with an end node within d of (x, y), in insertion order; all for `d < 0`."""
        store = self._store
        is_all = records.is_everywhere(d, x, y)
        return store.edges.iterate_ids(
            None if is_all else store.indexes.find_edges_at(store.indexes.find_nodes_within(x, y, d))
        )

    def get_neighbors(self, node_id: int) -> Iterator[int]:
        """Return unique targets of the edges leaving a node, in edge insertion order."""
        return iter(self._store.indexes.list_neighbors(records.as_id(node_id, "a node", self._store)))

    @property
    def neighborhoods(self) -> Neighborhoods:
        """A live read-only mapping: node id -> the node itself, then its neighbors."""
        found = self._store.neighborhoods
        return ReadOnlyMapping(found) if self._phase.is_deciding else found  # type: ignore[return-value] # it reads like them

    def has_node(self, node_id: int) -> bool:
        """Return whether a node with this id exists."""
        return self._store.nodes.index.find_row(records.as_id(node_id, "a node", self._store)) >= 0

    def within(
        self, node_id: int, radius: float, fov: float = 2.0 * pi, heading: tuple[float, float] = (0.0, 0.0)
    ) -> Surroundings:
        """Return the nodes and edges within `radius` of a node and inside its field of view."""
        nodes = self._store.nodes
        row = nodes.find(records.as_id(node_id, "a node", self._store))
        x = nodes.xy[2 * row]
        y = nodes.xy[2 * row + 1]
        rows = self._find_rows_near(x, y, radius)
        if as_range(fov, "fov") != 2.0 * pi:
            cos, sin = as_numbers(heading, "heading", "(cos, sin)")
            if (cos, sin) != (0.0, 0.0):
                dx, dy = (nodes.get_array("xy")[rows] - (x, y)).T
                rows = rows[kernels.find_in_cone(dx, dy, (cos, sin), fov)]
        return self._make_surroundings(rows)

    def nodes_near(self, x: float, y: float, radius: float) -> NodeColumns:
        """Return the nodes within `radius` of (x, y), as arrays."""
        nodes = self._store.nodes
        rows = self._find_rows_near(as_float(x, "x"), as_float(y, "y"), radius)
        return NodeColumns(nodes.get_array("ids")[rows], nodes.get_array("xy")[rows])

    def among(self, node_ids: Sequence[int] | np.ndarray[Any, Any]) -> Surroundings:
        """Return some nodes, and the edges with both ends among them, in insertion order."""
        return self._make_surroundings(np.unique(self._find_rows(node_ids)))

    def positions(self, node_ids: Sequence[int] | np.ndarray[Any, Any]) -> FloatArray:
        """Return the coordinates (nodes, 2) of several nodes."""
        return self._store.nodes.get_array("xy")[self._find_rows(node_ids)]

    def ground(self, node_ids: Sequence[int] | np.ndarray[Any, Any]) -> NodeGround | None:
        """Return the ground at several nodes, from their attributes `z` and `underground`; None for a flat map."""
        ground = self._store.get_ground()
        if ground is None:
            return None
        z, tunnels = ground[self._find_rows(node_ids)].T
        return NodeGround(z, tunnels.astype(np.int64))

    def node_attributes(self, node_id: int) -> dict[str, Any]:
        """Return the attributes of a node that are not `id`, `x` or `y`; a fresh dict (KeyError)."""
        nodes = self._store.nodes
        return self._phase.protect_value(
            nodes.copy_attributes(nodes.find(records.as_id(node_id, "a node", self._store)))
        )

    def edge_attributes(self, edge_id: int) -> dict[str, Any]:
        """Return the attributes of an edge beyond ends, length and linestring; a fresh dict (KeyError)."""
        edges = self._store.edges
        return self._phase.protect_value(edges.copy_attributes(edges.find(records.as_id(edge_id, "an edge"))))

    # -- routing ------------------------------------------------------------------------------------------------

    def weights(self, weight: str | None = "length") -> FloatArray:
        """Return the weight of each edge, (edges,) in insertion order."""
        return find_edge_weights(self._store.columns(), weight)

    @property
    def routes(self) -> RouteQueries:
        """Routing queries about several paths or nodes."""
        return self._queries

    def shortest_path(
        self,
        source: int,
        target: int,
        weight: str | None = "length",
        most_edges: int | None = None,
        *,
        turns: str | bool | None = None,
    ) -> list[int]:
        """Return the ids of the nodes on the shortest path between two nodes, both included."""
        if turns is not None:
            return self._queries.path_with_turns(source, target, weight, most_edges, turns)
        # NOTE: no further call, because strategies ask this every turn (benchmarks: Paths).
        return self._routes.shortest_path(source, target, weight, most_edges)

    def distance(
        self, source: int, target: int, weight: str | None = "length", *, turns: str | bool | None = None
    ) -> float:
        """Return the length of the shortest path between two nodes; infinite if there is no path."""
        if turns is not None:
            return self._queries.distance_with_turns(source, target, weight, turns)
        # NOTE: many strategies ask this every turn about the same targets (benchmarks: Paths).
        cache = self._routes.cache
        store = self._store
        if cache.revision == store.revision and type(source) is int and type(target) is int:
            try:
                known = cache.entries.get((weight, target))
            except TypeError:  # the weight is not hashable
                known = None
            if known is not None and (row := store.nodes.index.find_row(source)) >= 0:
                far: float = known[0][row]
                return far
        return self._routes.distance(source, target, weight)

    def distances(
        self,
        source: NodeIds | None = None,
        target: NodeIds | None = None,
        weight: str | None = "length",
        cutoff: float | None = None,
        *,
        turns: str | bool | None = None,
    ) -> dict[int, float]:
        """Return the path lengths from a node to all nodes, or from all nodes to a node."""
        if turns is not None:
            return self._queries.distances_with_turns(source, target, weight, cutoff, turns)
        return self._routes.distances(source, target, weight, cutoff)

    def _get_routes(self) -> CachedRoutes:
        return self._routes

    # -- coordinates --------------------------------------------------------------------------------------------

    def to_latlon(self, x: Numbers, y: Numbers) -> tuple[Any, Any]:
        """Return the latitude and longitude of (x, y), in degrees."""
        return positions.to_latlon(self.crs, x, y)

    def from_latlon(self, *, lat: Numbers, lon: Numbers) -> tuple[Any, Any]:
        """Return (x, y) of a latitude and longitude in degrees."""
        return positions.from_latlon(self.crs, lat, lon)

    def nearest_node(
        self,
        x: Numbers | None = None,
        y: Numbers | None = None,
        *,
        lat: Numbers | None = None,
        lon: Numbers | None = None,
        within: float | None = None,
    ) -> Any:
        """Return the id of the node nearest to a place, or the nearest ids (places,) for several places."""
        return positions.nearest_node(self._store, (x, y), (lat, lon), within)

    def place(
        self,
        n: int,
        near: int | tuple[float, float] | None = None,
        radius: float | None = None,
        apart: float = 0.0,
        rng: "Generator | int | None" = None,
        mode: "str | Mapping[str, str] | None" = None,
    ) -> list[int]:
        """Return the ids of `n` different random nodes."""
        name = as_mode(mode)
        graph = self if name is None else self._routes.select_mode(split_mode(name)[0])
        return positions.place(self._store, n, near, radius, apart, rng, None if graph is self else graph)

    # -- bulk operations ----------------------------------------------------------------------------------------

    @refuse_to_judges
    def add_nodes(self, ids: "ArrayLike", x: "ArrayLike", y: "ArrayLike") -> None:
        """Add many nodes at once.

        Args:
            ids: (nodes,) new integers.
            x: (nodes,) finite, map units.
            y: (nodes,) finite, map units.

        Raises:
            DuplicateId (KeyError), BadValue (ValueError), BadType (TypeError): nothing has changed.
        """
        new_ids = records.check_ids(ids, "ids")
        xy = np.column_stack([records.check_numbers(axis, len(new_ids), name) for axis, name in ((x, "x"), (y, "y"))])
        self._store.unshare_tables()
        self._store.nodes.extend(new_ids, xy=xy)
        self._store.record_added_rows()

    @refuse_to_judges
    def add_edges(
        self, ids: "ArrayLike", sources: "ArrayLike", targets: "ArrayLike", lengths: "ArrayLike | None" = None
    ) -> None:
        """Add many straight edges at once.

        Args:
            ids: (edges,) new integers.
            sources: (edges,) ids of nodes.
            targets: (edges,) ids of nodes.
            lengths: (edges,) in map units, not negative; None: the straight-line distances.

        Raises:
            UnknownName, DuplicateId (KeyError), BadValue (ValueError), BadType (TypeError): nothing has changed.
        """
        self._store.unshare_tables()
        self._store.edges.extend(**records.check_edges(self._store.nodes, ids, sources, targets, lengths))
        self._store.record_added_rows()

    def columns(self) -> GraphColumns:
        """Return the graph as read-only arrays that never change."""
        columns = self._store.columns()
        if not self._phase.is_deciding:
            return columns
        shown = self._shown
        if shown is None or shown.revision != columns.revision:
            parts = {field.name: freeze(getattr(columns, field.name)) for field in fields(columns)}
            shown = GraphColumns(**parts)
            self._shown = shown
        return shown

    @refuse_to_judges
    def clear(self) -> None:
        """Remove every node and edge."""
        self._store.clear()

    @refuse_to_judges
    def attach_networkx_graph(self, G: "nx.Graph[Any] | IGraphSource") -> "Graph":  # noqa: N803 - published name
        """Add a networkx graph, or the map of a recording, to the current graph; on an error nothing is added."""
        if not isinstance(G, IGraphSource):
            from gamms.graph.networkx_bridge import attach

            attach(self._store, G)
            return self
        try:
            self._store.append(*G.as_columns())
        except (ValueError, KeyError) as error:
            kind = "the" if isinstance(G, IPackedGraph) else "NetworkX"
            raise BadValue(f"Failed to attach {kind} graph: {error}") from error
        return self

    def to_networkx(self, *, plain: bool = False) -> "nx.MultiDiGraph[int] | nx.DiGraph[int]":
        """Return the graph as a networkx graph: a DiGraph, or a MultiDiGraph if there are parallel edges.

        Args:
            plain: whether to convert all attributes to numbers, texts and bools, for networkx's file writers: polylines
                become well-known text, other values JSON.
        """
        from gamms.graph.networkx_bridge import export

        return export(self.columns(), self.attribution, plain=as_bool(plain, "plain"))

    # -- inside -------------------------------------------------------------------------------------------------

    def _find_rows(self, node_ids: Sequence[int] | np.ndarray[Any, Any]) -> IntArray:
        return self._store.nodes.index.find_rows(records.check_ids(node_ids, "node_ids", self._store), "node")

    def _find_rows_near(self, x: float, y: float, radius: float) -> IntArray:
        radius = as_range(radius, "The radius")
        store = self._store
        return store.nodes.list_living() if radius == inf else store.indexes.find_nodes_within(x, y, radius)

    def _make_surroundings(self, rows: IntArray) -> Surroundings:
        indexes = self._store.indexes
        nodes = {node[0]: node for node in indexes.get_nodes(rows)}
        return Surroundings(nodes, indexes.get_edges(indexes.find_edges_among(rows)))

    def _end_rows(self, edge: dict[str, Any], id: int) -> tuple[int, int]:
        row_of = self._store.nodes.index.find_row
        try:
            source = edge["source"]
            target = edge["target"]
        except KeyError as error:  # 1.0.0 raises KeyError here, and ValueError for other missing values
            raise MissingKey(f"Edge {id} needs the key {error}; got only {', '.join(map(shown, edge))}.") from None
        of = self._store
        ends = row_of(records.as_id(source, "a node", of)), row_of(records.as_id(target, "a node", of))
        if ends[0] < 0 or ends[1] < 0:
            raise UnknownName(f"node at the end of edge {id}:", source if ends[0] < 0 else target)
        return ends

    def _find_straight_line(self, source: int, target: int) -> tuple[float, float, float, float]:
        xy = self._store.nodes.xy
        return (xy[2 * source], xy[2 * source + 1], xy[2 * target], xy[2 * target + 1])
