"""Routing queries of one graph, based on the ids, ends and weights that each implementation provides."""
# ruff: noqa: ARG002 - some arguments are only used by faster overrides

from abc import ABC, abstractmethod
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from itertools import islice
from math import inf
from typing import Any, NamedTuple, TypeVar

import numpy as np

from gamms import kernels
from gamms.arguments import as_count, as_float, as_ids, as_items, as_range
from gamms.core.strategies import is_nearer
from gamms.deciding import DecidePhase
from gamms.errors import BadType, BadValue, NoPath, NotOffered, UnknownName, nearest
from gamms.ir import geometry
from gamms.ir.graph import (
    FloatArray,
    GraphColumns,
    IntArray,
    apply_mode,
    as_mode,
    as_node_id,
    find_edge_weights,
    find_usable_edges,
    list_forbidden_paths,
    split_mode,
)
from gamms.ir.obstacles import BoolArray
from gamms.readonly import copy_locked
from gamms.text import shown
from gamms.typing.graph_values import NodeIds

_EVERY = 1 << 62  # vertices: more than any graph has
_FARTHEST = 1e150  # largest coordinate; the squares of greater distances overflow
RememberedT = TypeVar("RememberedT", bound=tuple["np.ndarray[Any, Any] | memoryview", ...])
MadeT = TypeVar("MadeT")


class Routes(ABC):
    """Answers routing queries of one graph; `IGraph` documents each query."""

    @abstractmethod
    def ids(self) -> IntArray:
        """Return the ids of all nodes (nodes,), by row; called before rows are used."""

    @abstractmethod
    def ends(self) -> tuple[IntArray, IntArray]:
        """Return the rows of sources and targets, (edges,) each."""

    @abstractmethod
    def weights(self, weight: str | None) -> FloatArray:
        """Return the weight of each edge, (edges,)."""

    @abstractmethod
    def rows(self, nodes: NodeIds, name: str) -> IntArray:
        """Return the rows of one node or of several (KeyError)."""

    def row(self, node_id: int) -> int:
        """Return the row of a node (KeyError); override for speed."""
        return int(self.rows(node_id, "a node")[0])

    def remember(self, key: Hashable, make: Callable[[], RememberedT]) -> RememberedT:
        """Return the result of `make`; override to cache it."""
        return make()

    def next_rows(self, row: int, end: int, weight: str | None) -> "Mapping[int, int] | memoryview":
        """Return a mapping row -> next row on the path to row `end`, -1 if there is no path.

        Requires: callers look up only `row` and the rows on its path. Override for speed.
        """
        _, steps = self._get_table(end, weight)
        return steps

    def distance_between(self, row: int, end: int, weight: str | None, within: float = inf) -> float:
        """Return the distance from a row to row `end`, infinite if there is no path; override for speed.

        A distance greater than `within` may be returned as infinite.
        """
        return self.distances_to(end, weight)[row]

    def search(self, weight: str | None, *, reverse: bool = True) -> kernels.Search:
        """Return a search along the edges, or along the reversed edges; override to cache it."""
        return kernels.Search(self.arcs(weight, reverse=reverse), self.ids())

    def matrix_lines(self, roots: IntArray, others: IntArray, weight: str | None, *, reverse: bool) -> FloatArray:
        """Return the distances (roots, others) from roots to others; with `reverse`, from others to roots."""
        search = self.search(weight, reverse=reverse)
        found = np.empty((len(roots), len(others)))
        for at in range(len(roots)):
            found[at], _ = search.compute_distances(roots[at : at + 1], others)
        return found

    def nearest_end(self, row: int, ends: IntArray, weight: str | None, within: float) -> int | None:
        """Return the index in `ends` of the nearest row; see `RouteQueries.nearest`."""
        places = np.arange(len(ends))
        if len(ends) > 1:  # only the first ones reached, up to rounding, can be nearest
            far, _ = self.search(weight, reverse=False).compute_distances(np.array([row]), ends, is_nearest=True)
            places = np.flatnonzero(far <= kernels.widen_distance(far.min()))
        least = within
        found = len(ends)
        for at in places.tolist():
            far_at = self.distance_between(row, ends.item(at), weight, least)
            if is_nearer(far_at, at, least, found):
                least = far_at
                found = at
        return found if found < len(ends) else None

    def near_end(self, rows: IntArray, end: int, weight: str | None, *, is_nearest: bool) -> FloatArray:
        """Return the distances (rows,) from some rows to row `end`; override for speed.

        With `is_nearest`, the distances of rows that are not nearest may be infinite.
        """
        found, _ = self.search(weight).compute_distances(np.array([end]), rows, is_nearest=is_nearest)
        return found

    def shortest_path(self, source: int, target: int, weight: str | None, most_edges: int | None) -> list[int]:
        """Return the ids of the nodes on the shortest path, both ends included; `most_edges` limits its length."""
        most = len(self.ids()) if most_edges is None else as_count(most_edges, "most_edges")
        ids = self.ids().data
        row = self.row(source)
        end = self.row(target)
        next_of = self.next_rows(row, end, weight)
        path = [ids[row]]
        while row != end and len(path) <= most:
            row = next_of[row]
            if row < 0:
                raise NoPath(source, target)
            path.append(ids[row])
        return path

    def distance(self, source: int, target: int, weight: str | None) -> float:
        """Return the length of the shortest path between two nodes; infinite if there is no path."""
        self.ids()
        return self.distance_between(self.row(source), self.row(target), weight)

    def distances(
        self, source: NodeIds | None, target: NodeIds | None, weight: str | None, cutoff: float | None
    ) -> dict[int, float]:
        """Return the distances from the nearest source to each node, or from each node to the nearest target."""
        rows, limit = self.one_side(source, target, cutoff)
        key = "distances", weight, source is None, limit, np.unique(rows).tobytes()
        near, far = self.remember(key, lambda: self.reached(rows, weight, limit, reverse=source is None))
        return dict(zip(self.ids()[near].tolist(), far.tolist(), strict=True))

    def one_side(self, source: NodeIds | None, target: NodeIds | None, cutoff: float | None) -> tuple[IntArray, float]:
        """Return the rows of the given side of `distances`, and the limit."""
        given = [nodes for nodes in (source, target) if nodes is not None]
        if len(given) != 1:
            raise BadValue(
                "Give distances exactly one of source= and target=. For two nodes use graph.distance(source, target)."
            )
        rows = self.rows(given[0], "target" if source is None else "source")
        return rows, inf if cutoff is None else as_range(cutoff, "cutoff")

    def reached(
        self, rows: IntArray, weight: str | None, limit: float, *, reverse: bool
    ) -> tuple[IntArray, FloatArray]:
        """Return the rows, ascending, within a limit of (or to) the nearest of some rows, and the distances."""
        if reverse and limit == inf and len(rows) == 1:
            table = np.asarray(self.distances_to(rows.item(), weight))
            near = np.flatnonzero(np.isfinite(table))
            return near, table[near]
        found = self.search(weight, reverse=reverse).find(rows, within=limit)
        order = np.argsort(found.rows)
        return found.rows[order], found.far[order]

    def distance_matrix(self, sources: NodeIds, targets: NodeIds, weight: str | None) -> FloatArray:
        """Return the distances (sources, targets), searched from the side with fewer different nodes."""
        starts = self.rows(sources, "sources")
        ends = self.rows(targets, "targets")
        (from_starts, start_of), (from_ends, end_of) = (np.unique(side, return_inverse=True) for side in (starts, ends))
        reverse = len(from_ends) <= len(from_starts)
        roots, others = (from_ends, starts) if reverse else (from_starts, ends)
        found = self.matrix_lines(roots, others, weight, reverse=reverse)
        return found[end_of].T.copy() if reverse else found[start_of]

    def _get_table(self, end: int, weight: str | None) -> tuple[memoryview, memoryview]:
        """Return the distance from every row to row `end`, and the next row on the path; -1 if there is none."""

        def make() -> tuple[memoryview, memoryview]:
            (far,), (steps,) = kernels.compute_route_tables(
                self.arcs(weight, reverse=True), np.array([end]), self.ids()
            )
            return far.data, steps.data

        return self.remember((weight, self.ids().item(end)), make)

    def distances_to(self, end: int, weight: str | None) -> memoryview:
        """Return the distances to row `end` from every row."""
        return self._get_table(end, weight)[0]

    def arcs(self, weight: str | None, *, reverse: bool) -> kernels.Arcs:
        """Return the edges, or the reversed edges, with their weights."""

        def make() -> kernels.Arcs:
            ends = self.ends()[::-1] if reverse else self.ends()
            return kernels.make_arcs(*ends, self.weights(weight), len(self.ids()))

        return self.remember(("arcs", weight, reverse), make)

    def select_mode(self, mode: str) -> Any:  # Any: `IGraph` imports this module
        """Return the graph with the edges that a mode may use; override to offer modes."""
        raise NotOffered(self, "select_mode, by which agents have a mode")

    def neighborhoods(self) -> tuple[IntArray, IntArray]:
        """Return offsets (nodes + 1,) and rows: each node, then its neighbors; see `kernels.list_neighborhoods`."""
        return self.remember(("neighborhoods",), lambda: kernels.list_neighborhoods(*self.ends(), len(self.ids())))


class EdgeRoutes(Routes):
    """The default implementation of routing, from lists of ids; rebuilt for each query.

    Args:
        ids: ids of the nodes.
        ends: source id and target id of each edge.
        weights: function from the name of a weight to the weights (edges,).
    """

    def __init__(
        self, ids: list[int], ends: list[tuple[int, int]], weights: Callable[[str | None], FloatArray]
    ) -> None:
        self._row_of = {id: row for row, id in enumerate(ids)}
        self._ends = self.rows([pair[0] for pair in ends], "source"), self.rows([pair[1] for pair in ends], "target")
        self._weights = weights

    def ids(self) -> IntArray:
        """Return the ids of all nodes (nodes,), by row."""
        return np.array([*self._row_of], np.int64)

    def ends(self) -> tuple[IntArray, IntArray]:
        """Return the rows of sources and targets, (edges,) each."""
        return self._ends

    def weights(self, weight: str | None) -> FloatArray:
        """Return the weight of each edge, (edges,)."""
        return self._weights(weight)

    def rows(self, nodes: NodeIds, name: str) -> IntArray:
        """Return the rows of one or several nodes (KeyError)."""
        ids = [as_node_id(id, "The id of a node") for id in (nodes if isinstance(nodes, Iterable) else [nodes])]
        for id in ids:
            if id not in self._row_of:
                raise UnknownName("node", id, self._row_of)
        return np.array([self._row_of[id] for id in ids], np.int64)


class NearestEdge(NamedTuple):
    """The point on an edge that is nearest to a place.

    Attributes:
        edge_id: id of the edge.
        offset: distance of the point from the source of the edge, in the unit of its `length`, from 0 to `length`.
        distance: straight-line distance from the place, map units.
    """

    edge_id: int
    offset: float
    distance: float


class RouteTables(NamedTuple):
    """Routing tables from all nodes to some targets; rows are those of `ctx.graph.columns()`.

    Attributes:
        distances: (targets, nodes) infinite if there is no path.
        next_rows: (targets, nodes) the next node on the shortest path; -1 at the target, and if there is no path.
    """

    distances: FloatArray
    next_rows: IntArray


class TurnRoutes:
    """Routes of traffic that obeys the forbidden turns of a mode of travel, on one revision of a graph.

    The vertices of the searched graph are the states of traffic, see `kernels.make_turn_states`; after them, for each
    node, one vertex for traffic that begins there, and one for traffic that ends there.

    Args:
        columns: the graph.
        weights: (edges,) infinite: the edge is closed.
        is_open: (edges,) the edges that traffic may use.
        paths: the forbidden sequences of edges, by id.

    Attributes:
        costs: (edges,) the weights; infinite also if traffic may not use the edge.
    """

    def __init__(
        self, columns: GraphColumns, weights: FloatArray, is_open: BoolArray, paths: Sequence[tuple[int, ...]]
    ) -> None:
        self._columns = columns
        self._row_of = {id: row for row, id in enumerate(columns.edge_ids.tolist())} if paths else {}
        self._forbidden = kernels.ForbiddenPaths(tuple(self._row_of[id] for id in path) for path in paths)
        ends = columns.sources, columns.targets
        states = kernels.make_turn_states(*ends, columns.lengths, is_open & np.isfinite(weights), self._forbidden)
        edges = len(columns.edge_ids)
        nodes = len(columns.node_ids)
        self._edges = states.edges
        self._begin = len(states.edges)
        self._end = self._begin + nodes
        every = np.arange(edges)
        starts = (states.starts, self._begin + columns.sources, np.arange(self._begin), self._begin + np.arange(nodes))
        stops = (states.ends, every, self._end + columns.targets[states.edges], self._end + np.arange(nodes))
        costs = np.where(is_open & (columns.sources != columns.targets), weights, inf)
        lengths = (costs[states.edges[states.ends]], costs, np.zeros(self._begin + nodes))
        self._arcs = np.concatenate(starts), np.concatenate(stops), np.concatenate(lengths)
        self.costs = costs
        self._searches: dict[bool, kernels.Search] = {}

    def path(self, row: int, end: int, driven: Sequence[int]) -> list[int] | None:
        """Return the rows of the edges on the shortest path between two nodes; None if there is no path.

        Args:
            row: the first node.
            end: the last node.
            driven: rows of the edges on which traffic has come to the first node; empty: it begins there.
        """
        return self.path_from(self.find_vertex(row, driven), end)

    def path_from(self, vertex: int, end: int) -> list[int] | None:
        """Return the rows of the edges on the shortest path from a vertex to a node; None if there is no path."""
        found = self._search(reverse=True).find_path(vertex, self._end + end, _EVERY, inf)
        return self._edges[found.rows[1:-1]].tolist() if found.rows else None

    def list_arcs(self) -> tuple[IntArray, IntArray, IntArray, IntArray]:
        """Return the arcs along edges: vertices at both ends, and rows of edges; then the node of each vertex.

        The last vertices, one for each node, are those of traffic that begins there.
        """
        starts, ends, lengths = self._arcs
        is_edge = (ends < self._begin) & np.isfinite(lengths)
        nodes = np.concatenate((self._columns.targets[self._edges], np.arange(len(self._columns.node_ids))))
        return starts[is_edge], ends[is_edge], self._edges[ends[is_edge]], nodes

    def distance(self, row: int, end: int) -> float:
        """Return the length of the shortest path between two nodes; infinite if there is no path."""
        far, _ = self._search(reverse=True).compute_distances(
            np.array([self._end + end]), np.array([self._begin + row])
        )
        return far.item()

    def reached(
        self, rows: IntArray, limit: float, *, reverse: bool, driven: Sequence[int]
    ) -> tuple[IntArray, FloatArray]:
        """Return the nodes, ascending, within a limit of (or to) the nearest of some rows, and the distances.

        With the rows of the edges on which traffic has come to the only row, see `path`, it goes on from there.
        """
        roots, goals = (self._end, self._begin) if reverse else (self._begin, self._end)
        begun = np.array([self.find_vertex(rows.item(), driven)]) if driven else roots + rows
        found = self._search(reverse=reverse).find(begun, within=limit)
        order = np.argsort(found.rows)
        near = found.rows[order] - goals
        are_nodes = (near >= 0) & (near < len(self._columns.node_ids))
        return near[are_nodes], found.far[order][are_nodes]

    def onward(self, row: int, driven: Sequence[int]) -> list[int]:
        """Return the rows of the edges that traffic at a node may take next, in insertion order."""
        starts, ends, lengths = self._arcs
        after = ends[(starts == self.find_vertex(row, driven)) & np.isfinite(lengths)]
        return sorted(self._edges[after[after < self._begin]].tolist())

    def find_vertex(self, row: int, driven: Sequence[int]) -> int:
        """Return the vertex of traffic at a node, given the edges on which it came."""
        if not driven:
            return self._begin + row
        state: tuple[int, ...] = (driven[0],)
        for edge in driven[1:]:
            state = self._forbidden.step(state, edge) or (edge,)
        place = [*self._forbidden.begins].index(state) if len(state) > 1 else 0
        return len(self._columns.edge_ids) + place if len(state) > 1 else state[0]

    def _search(self, *, reverse: bool) -> kernels.Search:
        if reverse not in self._searches:
            starts, ends, lengths = self._arcs
            sides = (ends, starts) if reverse else (starts, ends)
            size = self._end + len(self._columns.node_ids)
            self._searches[reverse] = kernels.Search(kernels.make_arcs(*sides, lengths, size), np.arange(size))
        return self._searches[reverse]


class RouteQueries:
    """Routing queries about several paths or nodes: `ctx.graph.routes`.

    `IGraph` defines shortest paths, distances and the argument `weight`.

    Args:
        routes: routes of the graph.
        columns: returns the graph.
    """

    def __init__(self, routes: Routes, columns: Callable[[], GraphColumns]) -> None:
        self._routes = routes
        self._columns = columns
        self._tree: tuple[int, geometry.LineTree] | None = None
        self._latest: dict[Hashable, tuple[object, Any]] = {}  # Any: results of callers

    def k_shortest_paths(self, source: int, target: int, k: int, weight: str | None = "length") -> list[list[int]]:
        """Return up to `k` shortest simple paths between two nodes, the shortest first.

        Yen's algorithm (1971) with Lawler's improvement (1972); each detour is found by A* with the distances to the
        target, a table that is computed once for each target. Of parallel edges the cheapest counts.

        Args:
            source: id of the first node.
            target: id of the last node.
            k: number of paths, at least 1.
            weight: see `IGraph`.

        Returns:
            The node ids of each path; fewer than `k` paths if there are no more. The first is `shortest_path`. Equally
            long paths, up to rounding, are ordered by the number of edges.

        Raises:
            UnknownName (KeyError): a node does not exist.
            BadValue (ValueError): `k` is less than 1.
        """
        most = as_count(k, "k")
        routes = self._routes
        ids = routes.ids().data
        row = routes.row(source)
        end = routes.row(target)
        rests = routes.distances_to(end, weight)
        if rests[row] == inf:
            return []
        next_of = routes.next_rows(row, end, weight)
        first = [row]
        while first[-1] != end:
            first.append(next_of[first[-1]])
        found = kernels.find_simple_paths(routes.arcs(weight, reverse=False), rests, first)
        return [[ids[one] for one in path] for path in islice(found, most)]

    def isochrones(self, sources: NodeIds, limits: Sequence[float], weight: str | None = "length") -> list[IntArray]:
        """Return the nodes within each of several limits of the nearest of some nodes, by path length.

        Runs Dijkstra's algorithm once, up to the greatest limit.

        Args:
            sources: one node id, or several.
            limits: in the unit of the weight, for example metres or seconds; in any order.
            weight: see `IGraph`.

        Returns:
            For each limit an array (nodes,) of the ids of the nodes within this distance, in insertion order.

        Raises:
            UnknownName (KeyError): a node does not exist.
            BadValue (ValueError): a limit is negative or NaN.
        """
        reach = [as_range(limit, "A limit") for limit in as_items(limits, "limits", "numbers")]
        found = self._routes.distances(sources, None, weight, max(reach)) if reach else {}
        ids = np.array([*found], np.int64)
        far = np.array([*found.values()], np.float64)
        return [ids[far <= limit] for limit in reach]

    def nearest(
        self, source: int, targets: Iterable[int], weight: str | None = "length", within: float = inf
    ) -> int | None:
        """Return the node of several that is nearest to a node by path; None if no path leads to any.

        The search stops when it has reached a target, so the cost depends on the distance of the nearest one.

        Args:
            source: node id.
            targets: node ids.
            weight: see `IGraph`.
            within: greater distances count as no path.

        Returns:
            The id; ties, by `distance`, go to the first target in the argument.

        Raises:
            UnknownName (KeyError): a node does not exist.
            BadValue (ValueError): `within` is negative or NaN.
        """
        routes = self._routes
        most = as_range(within, "within")
        ids = routes.ids()
        row = routes.row(source)
        ends = routes.rows(targets, "targets")
        found = routes.nearest_end(row, ends, weight, most)
        return None if found is None else ids.item(ends.item(found))

    # -- with turns ------------------------------------------------------------------------------------------------

    def shortest_path_edges(
        self,
        source: int,
        target: int,
        weight: str | None = "length",
        *,
        turns: str | bool = True,
        driven: Sequence[int] = (),
    ) -> list[int]:
        """Return the ids of the edges on the shortest path of traffic that obeys the turn restrictions of the map.

        docs/maps.md says what such a path is: it may come to a node twice, and turns back only at dead ends.

        Args:
            source: id of the first node.
            target: id of the last node.
            weight: see `IGraph`.
            turns: the mode of travel whose restrictions hold, such as "drive"; True: the only one with restrictions.
            driven: ids of the edges on which traffic has come to the first node, the latest last; one edge is enough
                unless a restriction has ways between. Empty: it begins here, and may take any edge.

        Raises:
            UnknownName (KeyError): a node, an edge or the mode does not exist.
            BadValue (ValueError): `driven` is no path to the first node.
            NoPath (ValueError): there is no path.
        """
        found = self._get_turn_routes(weight, turns)
        row = self._routes.row(source)
        edges = found.path(row, self._routes.row(target), self._find_driven_rows(row, driven))
        if edges is None:
            raise NoPath(source, target)
        return [*map(int, self._columns().edge_ids[edges])]

    def path_with_turns(
        self, source: int, target: int, weight: str | None, most_edges: int | None, turns: str | bool
    ) -> list[int]:
        """Return the ids of the nodes on `shortest_path_edges`, both ends included; `most_edges` cuts it off."""
        columns = self._columns()
        edges = self.shortest_path_edges(source, target, weight, turns=turns)
        kept = edges if most_edges is None else edges[: as_count(most_edges, "most_edges")]
        rows = kernels.find_rows(columns.edge_ids, np.array(kept, np.int64), columns.edge_order)
        return [source, *columns.node_ids[columns.targets[rows]].tolist()]

    def distance_with_turns(self, source: int, target: int, weight: str | None, turns: str | bool) -> float:
        """Return the length of `shortest_path_edges`; infinite if there is no path."""
        found = self._get_turn_routes(weight, turns)
        return found.distance(self._routes.row(source), self._routes.row(target))

    def distances_with_turns(
        self,
        source: NodeIds | None,
        target: NodeIds | None,
        weight: str | None,
        cutoff: float | None,
        turns: str | bool,
        driven: Sequence[int] = (),
    ) -> dict[int, float]:
        """Return the lengths of paths that obey turn restrictions; see `IGraph.distances`.

        With `driven`, see `shortest_path_edges`, traffic goes on from the only source.
        """
        rows, limit = self._routes.one_side(source, target, cutoff)
        known = self._find_driven_rows(rows.item(), driven) if driven else ()
        near, far = self._get_turn_routes(weight, turns).reached(rows, limit, reverse=source is None, driven=known)
        return dict(zip(self._routes.ids()[near].tolist(), far.tolist(), strict=True))

    def edges_onward(self, node_id: int, driven: Sequence[int] = (), *, turns: str | bool = True) -> list[int]:
        """Return the ids of the edges that traffic at a node may take next, in insertion order.

        Args:
            node_id: id of the node.
            driven: see `shortest_path_edges`.
            turns: see `shortest_path_edges`.

        Raises:
            UnknownName (KeyError): the node, an edge or the mode does not exist.
            BadValue (ValueError): `driven` is no path to the node.
        """
        row = self._routes.row(node_id)
        edges = self._get_turn_routes("length", turns).onward(row, self._find_driven_rows(row, driven))
        return [*map(int, self._columns().edge_ids[edges])]

    def _get_turn_routes(self, weight: str | None, turns: str | bool) -> TurnRoutes:
        """Return the routes of traffic that obeys turn restrictions; see `shortest_path_edges`."""
        columns = self._columns()
        paths = get_cached(self, "forbidden turns", None, lambda: list_forbidden_paths(columns))
        mode = _find_mode_of_turns(columns, paths, turns)

        def make() -> TurnRoutes:
            every = np.ones(len(columns.edge_ids), np.bool_)
            is_open = find_usable_edges(columns, mode) if mode in columns.edge_attributes else every
            own = apply_mode(columns, mode)
            weights = self.weights(weight) if own is columns else find_edge_weights(own, weight)
            return TurnRoutes(columns, weights, is_open, paths.get(mode, []))

        return get_cached(self, ("turns", weight, mode), None, make)

    def _find_driven_rows(self, row: int, driven: Sequence[int]) -> list[int]:
        """Return the rows of edges that were driven to a node."""
        columns = self._columns()
        ids = as_ids(driven, "driven")
        rows: list[int] = kernels.find_rows(columns.edge_ids, np.array(ids, np.int64), columns.edge_order).tolist()
        if -1 in rows:
            raise UnknownName("edge", ids[rows.index(-1)])
        ends = columns.targets[rows].tolist()
        if ends and [*columns.sources[rows[1:]].tolist(), row] != ends:
            raise BadValue(
                f"driven must be edges that follow each other to node {columns.node_ids[row]}, not {shown(ids)}."
            )
        return rows

    def _find_rows(self, sources: NodeIds, targets: NodeIds) -> tuple[IntArray, IntArray]:
        self._routes.ids()
        return self._routes.rows(sources, "sources"), self._routes.rows(targets, "targets")

    def distances(self, sources: NodeIds, targets: NodeIds, weight: str | None = "length") -> FloatArray:
        """Return the distance of each pair, (sources, targets); see `distance`.

        Args:
            sources: node ids.
            targets: node ids.
            weight: see `IGraph`.

        Raises:
            UnknownName (KeyError): a node does not exist.
        """
        routes = self._routes
        rows, ends = self._find_rows(sources, targets)
        different, place = np.unique(ends, return_inverse=True)
        found = np.empty((len(different), len(rows)))
        for line, end in zip(found, different.tolist(), strict=True):
            line[:] = routes.near_end(rows, end, weight, is_nearest=False)
        return found[place].T

    def distances_from_nearest(
        self, sources: Iterable[int], targets: Iterable[int], weight: str | None = "length"
    ) -> list[float]:
        """Return the path length to each target from the nearest source; infinite if there is no path.

        The numbers are those of `distance`. It searches backward from each target until it has reached a source.

        Args:
            sources: node ids.
            targets: node ids.
            weight: see `IGraph`.

        Raises:
            UnknownName (KeyError): a node does not exist.
        """
        routes = self._routes
        rows, ends = self._find_rows(sources, targets)
        near = [routes.near_end(rows, end, weight, is_nearest=True) for end in ends.tolist()]
        return [float(far.min(initial=inf)) for far in near]

    def tables(self, targets: NodeIds, weight: str | None = "length", cutoff: float = inf) -> RouteTables:
        """Return the distances from all nodes to some targets, and the first steps of the shortest paths.

        The results of `distance` and `shortest_path` for all nodes at once: 16 bytes for each node and target.

        Args:
            targets: distinct node ids.
            weight: see `IGraph`.
            cutoff: nodes farther than this are treated as having no path.

        Raises:
            UnknownName (KeyError): a node does not exist.
            BadValue (ValueError): `cutoff` is negative or NaN.
        """
        routes = self._routes
        limit = as_range(cutoff, "cutoff")
        ids = routes.ids()
        ends = routes.rows(targets, "targets")
        return RouteTables(*kernels.compute_route_tables(routes.arcs(weight, reverse=True), ends, ids, limit))

    def arcs(self, weight: str | None = "length", *, reverse: bool = False) -> kernels.Arcs:
        """Return the edges, or reversed edges, with weights as compressed sparse rows; parallel edges are merged."""
        arcs = self._routes.arcs(weight, reverse=reverse)
        return self._get_cached(
            ("arcs", weight, reverse),
            lambda: kernels.Arcs(copy_locked(arcs.offsets), copy_locked(arcs.ends), copy_locked(arcs.weights)),
        )

    def neighborhoods(self) -> tuple[IntArray, IntArray]:
        """Return read-only offsets (nodes + 1,) and rows of nodes: each node itself, then its neighbors."""
        found = self._routes.neighborhoods()
        return self._get_cached(("neighborhoods",), lambda: (copy_locked(found[0]), copy_locked(found[1])))

    def select_mode(self, mode: str | Mapping[str, str]) -> Any:  # Any: an `IGraph`, as above
        """Return the graph of a mode: all nodes, and the edges that agents of the mode may use.

        It is for reading, and has the neighbors, paths, distances and travel times of these agents: an attribute such
        as `travel_time:drive` replaces `travel_time` in the graph of the mode `drive`. Closed roads are missing, as in
        the whole graph.

        Args:
            mode: the name of an edge attribute: a mode of the map, such as `"drive"`, whose values are speeds, or any
                attribute with true and false. Edges where it is true or above 0 may be used.

        Raises:
            UnknownName (KeyError): no edge has this attribute, closed ones included, nor had it when the mode was asked
                for before.
            BadType, BadValue: the mode is no name, or the attribute has other values.
        """
        name = as_mode(mode)
        if name is None:
            raise BadType("select_mode needs the name of a mode; without a mode, the graph is ctx.graph.graph.")
        if split_mode(name)[1]:
            raise BadValue(
                "select_mode takes no 'turns': a graph has all edges, whatever edge traffic comes by. Ask it for "
                "routes with turns, such as select_mode('drive').shortest_path(a, b, turns='drive')."
            )
        return self._routes.select_mode(name)

    def rows(self, nodes: NodeIds) -> IntArray:
        """Return the rows of nodes.

        Raises:
            UnknownName (KeyError): a node is not on the map.
        """
        return self._routes.rows(nodes, "nodes")

    def weights(self, weight: str | None) -> FloatArray:
        """Return the weight of each edge, (edges,)."""
        found = self._routes.weights(weight)
        return self._get_cached(("weights", weight), lambda: (copy_locked(found),))[0]

    def _get_cached(self, key: tuple[Any, ...], make: Callable[[], RememberedT]) -> RememberedT:
        """Return the cached result of `make`, for callers that include strategies."""
        return self._routes.remember(("locked", *key), make)

    def nearest_edge(self, x: float, y: float, within: float | None = None) -> NearestEdge | None:
        """Return the edge nearest to a place by straight-line distance, and the nearest point on it.

        The polylines of the edges count. They are indexed by an R-tree (shapely's `STRtree`, packed as by Leutenegger,
        Lopez and Edgington, 1997), once for each revision of the graph.

        Args:
            x: map units.
            y: map units.
            within: edges farther than this do not count, map units; None: no limit.

        Returns:
            Ties up to rounding, for example both directions of a street, go to the first edge in insertion order; None
            if no edge is within the distance.

        Raises:
            BadValue (ValueError): the place or the distance is invalid, or there are no edges and no `within`.
        """
        place = as_float(x, "x"), as_float(y, "y")
        if max(map(abs, place)) > _FARTHEST:
            raise BadValue(f"x and y of a place are {_FARTHEST:g} at most, not {shown(place)}.")
        limit = inf if within is None else as_range(within, "within")
        columns = self._columns()
        if not len(columns.edge_ids) and within is None:
            raise BadValue("The graph has no edges, so none is nearest. Add edges first.")
        if not len(columns.edge_ids):
            return None
        row = self._get_line_tree(columns).find_nearest(place)
        ends = columns.xy[[columns.sources[row], columns.targets[row]]]
        share, distance = geometry.find_nearest_point(columns.polylines.get(row, ends), place)
        if distance > limit:
            return None
        return NearestEdge(columns.edge_ids.item(row), share * columns.lengths.item(row), distance)

    def _get_line_tree(self, columns: GraphColumns) -> geometry.LineTree:
        """Return the R-tree of the edges; built once for each revision of the graph."""
        if self._tree is None or self._tree[0] != columns.revision:
            ends = np.stack((columns.xy[columns.sources], columns.xy[columns.targets]), axis=1)
            self._tree = columns.revision, geometry.LineTree(ends, columns.polylines)
        return self._tree[1]


def _find_mode_of_turns(columns: GraphColumns, known: Mapping[str, object], turns: str | bool) -> str:
    """Return the mode of travel whose turn restrictions hold; "" if the map has none.

    Args:
        columns: the graph.
        known: the modes with forbidden turns.
        turns: the argument of the caller.

    Raises:
        BadType: it is neither a name nor True.
        BadValue: True, and the map has several modes.
        UnknownName: the map has restrictions for other modes only, and no edge attribute of this name; or it has none
            at all, and the name resembles that of an edge attribute or a mode that comes with GAMMS.
    """
    if turns is True:
        if len(known) > 1:
            raise BadValue(f"The map has turn restrictions of several modes: name one, such as turns={min(known)!r}.")
        return next(iter(known), "")
    if not isinstance(turns, str):
        raise BadType(f"turns must be the name of a mode of travel, such as 'drive', or True, not {shown(turns)}.")
    if turns in known or turns in columns.edge_attributes:
        return turns
    if known:
        raise UnknownName("mode of travel with turn restrictions", turns, known)
    names = {*_SHIPPED_MODES, *columns.edge_attributes}
    if turns not in names and nearest(turns, names):
        raise UnknownName(
            "mode of travel", turns, names, " The map has no turn restrictions: turns=True asks for those of any mode."
        )
    return turns


_SHIPPED_MODES = ("bike", "drive", "drive_service", "robot", "walk")  # with tables in `data/modes.toml`


def get_cached(queries: RouteQueries, slot: Hashable, key: object, make: Callable[[], MadeT]) -> MadeT:
    """Return the result of `make`, cached in a slot for the present graph and the last key.

    For shipped strategies and sensors, for results that many agents need in a turn. The result must depend only on the
    graph and the key.

    Args:
        queries: queries of the graph, which hold the cache.
        slot: identifies the kind of result and its owner, for example the names of the strategy and the team.
        key: the inputs of the result.
        make: computes the result, which is read-only.
    """
    now = (queries._columns().revision, key)
    known, made = queries._latest.get(slot, (None, None))
    if known != now:
        made = make()
        queries._latest[slot] = now, made
    found: MadeT = made
    return found


def get_cached_in_moment(
    queries: RouteQueries, phase: DecidePhase, slot: Hashable, make: Callable[[], MadeT], key: object = None
) -> MadeT:
    """Return the result of `make` about the agents, cached while all agents decide and nothing changes.

    In a custom loop, which has no such phase, it is computed each time.

    Args:
        queries: see `get_cached`.
        phase: phase of the context.
        slot: see `get_cached`.
        make: makes it; it is not to be changed.
        key: a key for its other inputs.
    """
    moment = phase.moment
    if moment is None:
        return make()
    return get_cached(queries, slot, (moment, key), make)
