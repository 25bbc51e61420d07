"""Routing queries of one graph, from what each implementation of a graph offers: ids, ends and weights of edges."""
# ruff: noqa: ARG002 - a default reads no arguments that only faster ones need

from abc import ABC, abstractmethod
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from itertools import islice
from math import inf
from typing import Any, NamedTuple, TypeVar

import numpy as np

from gamms import kernels
from gamms.arguments import as_count, as_float, as_int, as_items, as_range
from gamms.deciding import DecidePhase
from gamms.errors import BadValue, NoPath, UnknownName
from gamms.ir import geometry
from gamms.ir.graph import FloatArray, GraphColumns, IntArray
from gamms.readonly import locked
from gamms.text import shown
from gamms.typing.graph_values import NodeIds

_FARTHEST = 1e150  # coordinates; the squares of greater distances are beyond floats
RememberedT = TypeVar("RememberedT", bound=tuple["np.ndarray[Any, Any] | memoryview", ...])
MadeT = TypeVar("MadeT")


class Routes(ABC):
    """Answers routing queries of one graph; see `IGraph` for what each call promises."""

    @abstractmethod
    def ids(self) -> IntArray:
        """Return the ids of all nodes (nodes,), by row; called before rows are asked for."""

    @abstractmethod
    def ends(self) -> tuple[IntArray, IntArray]:
        """Return the rows of sources and targets, (edges,) each."""

    @abstractmethod
    def weights(self, weight: str | None) -> FloatArray:
        """Return what each edge costs, (edges,)."""

    @abstractmethod
    def rows(self, nodes: NodeIds, name: str) -> IntArray:
        """Return the rows of one node or of several (KeyError)."""

    def row(self, node_id: int) -> int:
        """Return the row of a node (KeyError); override for speed."""
        return int(self.rows(node_id, "a node")[0])

    def remember(self, key: Hashable, make: Callable[[], RememberedT]) -> RememberedT:
        """Return what `make` gives; override to make it once."""
        return make()

    def next_rows(self, row: int, end: int, weight: str | None) -> "Mapping[int, int] | memoryview":
        """Return the row of the next node on the path to row `end`, -1 where there is none, by row.

        Requires: only `row` and what follows it on the path are looked up. Override for speed.
        """
        _, steps = self._table(end, weight)
        return steps

    def distance_between(self, row: int, end: int, weight: str | None, within: float = inf) -> float:
        """Return the distance from a row to row `end`, infinite where there is no path; override for speed.

        One that is greater than `within` may be infinite as well.
        """
        return self.distances_to(end, weight)[row]

    def search(self, weight: str | None, *, reverse: bool = True) -> kernels.Search:
        """Return what finds paths along the edges, or along the reversed ones; override to make it once."""
        return kernels.Search(self.arcs(weight, reverse=reverse), self.ids())

    def matrix_lines(self, roots: IntArray, others: IntArray, weight: str | None, *, reverse: bool) -> FloatArray:
        """Return the distances (roots, others) from rows to others, or to them where reversed."""
        search = self.search(weight, reverse=reverse)
        found = np.empty((len(roots), len(others)))
        for at in range(len(roots)):
            found[at], _ = search.far(roots[at : at + 1], others)
        return found

    def nearest_end(self, row: int, ends: IntArray, weight: str | None, within: float) -> int | None:
        """Return the place in `ends` of what `RouteQueries.nearest` says."""
        places = np.arange(len(ends))
        if len(ends) > 1:  # only those that are reached first, up to rounding, can be it
            far, _ = self.search(weight, reverse=False).far(np.array([row]), ends, is_nearest=True)
            places = np.flatnonzero(far <= kernels.widened(far.min()))
        best, found = within, None
        for at in places.tolist():
            far_at = self.distance_between(row, ends.item(at), weight, best)
            if far_at < best or (far_at == best < inf and found is None):
                best, found = far_at, at
        return found

    def near_end(self, rows: IntArray, end: int, weight: str | None, *, is_nearest: bool) -> FloatArray:
        """Return the distances (rows,) from some rows to row `end`; override for speed.

        With `is_nearest`, those of rows that are not nearest may be infinite.
        """
        found, _ = self.search(weight).far(np.array([end]), rows, is_nearest=is_nearest)
        return found

    def shortest_path(self, source: int, target: int, weight: str | None, most_edges: int | None) -> list[int]:
        """Return the ids of the nodes on the shortest path, both ends included, or of its first edges."""
        most = len(self.ids()) if most_edges is None else as_count(most_edges, "most_edges")
        ids = self.ids().data
        row, end = self.row(source), self.row(target)
        next_of = self.next_rows(row, end, weight)
        path = [ids[row]]
        while row != end and len(path) <= most:
            row = next_of[row]
            if row < 0:
                raise NoPath(source, target)
            path.append(ids[row])
        return path

    def distance(self, source: int, target: int, weight: str | None) -> float:
        """Return the distance from one node to another; infinite where there is no path."""
        self.ids()
        return self.distance_between(self.row(source), self.row(target), weight)

    def distances(
        self, source: NodeIds | None, target: NodeIds | None, weight: str | None, cutoff: float | None
    ) -> dict[int, float]:
        """Return the distances from the nearest source to each node, or from each node to the nearest target."""
        given = [nodes for nodes in (source, target) if nodes is not None]
        if len(given) != 1:
            raise BadValue(
                "Give distances either source= or target=, not both and not neither. "
                "The way from one node to another is graph.distance(source, target)."
            )
        rows = self.rows(given[0], "target" if source is None else "source")
        limit = inf if cutoff is None else as_range(cutoff, "cutoff")
        key = "distances", weight, source is None, limit, np.unique(rows).tobytes()
        near, far = self.remember(key, lambda: self.reached(rows, weight, limit, reverse=source is None))
        return dict(zip(self.ids()[near].tolist(), far.tolist(), strict=True))

    def reached(
        self, rows: IntArray, weight: str | None, limit: float, *, reverse: bool
    ) -> tuple[IntArray, FloatArray]:
        """Return the rows, ascending, that are at most so far from the nearest of some rows, or to it, and how far."""
        if reverse and limit == inf and len(rows) == 1:
            table = np.asarray(self.distances_to(rows.item(), weight))
            near = np.flatnonzero(np.isfinite(table))
            return near, table[near]
        found = self.search(weight, reverse=reverse).find(rows, within=limit)
        order = np.argsort(found.rows)
        return found.rows[order], found.far[order]

    def distance_matrix(self, sources: NodeIds, targets: NodeIds, weight: str | None) -> FloatArray:
        """Return the distances (sources, targets), searched from the side with fewer different nodes."""
        starts, ends = self.rows(sources, "sources"), self.rows(targets, "targets")
        (from_starts, start_of), (from_ends, end_of) = (np.unique(side, return_inverse=True) for side in (starts, ends))
        reverse = len(from_ends) <= len(from_starts)
        roots, others = (from_ends, starts) if reverse else (from_starts, ends)
        found = self.matrix_lines(roots, others, weight, reverse=reverse)
        return found[end_of].T.copy() if reverse else found[start_of]

    def _table(self, end: int, weight: str | None) -> tuple[memoryview, memoryview]:
        """Return how far it is from every row to row `end`, and the row of the next node; -1 where there is none."""

        def make() -> tuple[memoryview, memoryview]:
            (far,), (steps,) = kernels.route_tables(self.arcs(weight, reverse=True), np.array([end]), self.ids())
            return far.data, steps.data

        return self.remember((weight, self.ids().item(end)), make)

    def distances_to(self, end: int, weight: str | None) -> memoryview:
        """Return the distances to row `end` from every row."""
        return self._table(end, weight)[0]

    def arcs(self, weight: str | None, *, reverse: bool) -> kernels.Arcs:
        """Return the edges, or the reversed ones, with their weights."""

        def make() -> kernels.Arcs:
            ends = self.ends()[::-1] if reverse else self.ends()
            return kernels.make_arcs(*ends, self.weights(weight), len(self.ids()))

        return self.remember(("arcs", weight, reverse), make)

    def neighborhoods(self) -> tuple[IntArray, IntArray]:
        """Return offsets (nodes + 1,) and rows: each node itself, then its neighbours, as `kernels.neighborhoods`."""
        return self.remember(("neighborhoods",), lambda: kernels.neighborhoods(*self.ends(), len(self.ids())))


class EdgeRoutes(Routes):
    """The slow default of routing, made of ids for each query.

    Args:
        ids: of the nodes.
        ends: ids of source and target of each edge.
        weights: returns what each edge costs, (edges,), by the name of a weight.
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
        """Return what each edge costs, (edges,)."""
        return self._weights(weight)

    def rows(self, nodes: NodeIds, name: str) -> IntArray:
        """Return the rows of one node or of several (KeyError)."""
        ids = [as_int(id, "The id of a node") for id in (nodes if isinstance(nodes, Iterable) else [nodes])]
        for id in ids:
            if id not in self._row_of:
                raise UnknownName("node", id, self._row_of)
        return np.array([self._row_of[id] for id in ids], np.int64)


class NearestEdge(NamedTuple):
    """The place on an edge that is nearest to another place.

    Attributes:
        edge_id: of the edge.
        offset: how far from its source the place is, in the unit of its `length`, from 0 to `length`.
        distance: from the other place in a straight line, map units.
    """

    edge_id: int
    offset: float
    distance: float


class RouteTables(NamedTuple):
    """The ways to some nodes from all nodes; rows are those of `ctx.graph.columns()`.

    Attributes:
        distances: (targets, nodes) infinite where there is no path.
        next_rows: (targets, nodes) the next node on the shortest path; -1 at the target, and where there is no path.
    """

    distances: FloatArray
    next_rows: IntArray


class RouteQueries:
    """Routing queries that ask of several paths or places: `ctx.graph.routes`.

    What one path or distance is, and what a `weight` is, `IGraph` says.

    Args:
        routes: of the graph.
        columns: returns the graph.
    """

    def __init__(self, routes: Routes, columns: Callable[[], GraphColumns]) -> None:
        self._routes, self._columns = routes, columns
        self._tree: tuple[int, geometry.LineTree] | None = None
        self._latest: dict[Hashable, tuple[object, Any]] = {}  # Any: what callers make

    def k_shortest_paths(self, source: int, target: int, k: int, weight: str | None = "length") -> list[list[int]]:
        """Return up to `k` shortest paths without circles from one node to another, the shortest first.

        Yen's algorithm (1971) with Lawler's improvement (1972); each detour is found by A* with the distances to the
        target, a table that is made once for each target. Of parallel edges the cheapest counts.

        Args:
            source: id of the first node.
            target: id of the last node.
            k: how many, 1 at least.
            weight: see above.

        Returns:
            Ids of the nodes on each path; fewer than `k` paths where there are no more, none where there is none. The
            first is `shortest_path`. Equally long ones follow by the number of edges, as far as rounding lets them be
            equal.

        Raises:
            UnknownName (KeyError): there is no such node.
            BadValue (ValueError): `k` is less than 1.
        """
        most, routes = as_count(k, "k"), self._routes
        ids = routes.ids().data
        row, end = routes.row(source), routes.row(target)
        rests = routes.distances_to(end, weight)
        if rests[row] == inf:
            return []
        next_of, first = routes.next_rows(row, end, weight), [row]
        while first[-1] != end:
            first.append(next_of[first[-1]])
        found = kernels.simple_paths(routes.arcs(weight, reverse=False), rests, first)
        return [[ids[one] for one in path] for path in islice(found, most)]

    def isochrones(self, sources: NodeIds, limits: Sequence[float], weight: str | None = "length") -> list[IntArray]:
        """Return which nodes are within each of several limits of the nearest of some nodes, by path from there.

        Dijkstra's algorithm, once, up to the greatest limit.

        Args:
            sources: one node id, or several.
            limits: in the unit of the weight, such as metres or seconds; in any order.
            weight: see above.

        Returns:
            For each limit an array (nodes,) of the ids of the nodes whose distance is at most that, in insertion order.

        Raises:
            UnknownName (KeyError): there is no such node.
            BadValue (ValueError): a limit is negative or NaN.
        """
        reach = [as_range(limit, "A limit") for limit in as_items(limits, "limits", "numbers")]
        found = self._routes.distances(sources, None, weight, max(reach)) if reach else {}
        ids, far = np.array([*found], np.int64), np.array([*found.values()], np.float64)
        return [ids[far <= limit] for limit in reach]

    def nearest(
        self, source: int, targets: Iterable[int], weight: str | None = "length", within: float = inf
    ) -> int | None:
        """Return which of several nodes is nearest by path from a node; None where no path leads to any.

        It searches from the node until it has reached one, so that what is far costs nothing where something is near.

        Args:
            source: node id.
            targets: node ids.
            weight: see above.
            within: greater distances count as no path.

        Returns:
            The id; of several that are equally near, by `distance`, the one that was given first.

        Raises:
            UnknownName (KeyError): there is no such node.
            BadValue (ValueError): `within` is negative or NaN.
        """
        routes, most = self._routes, as_range(within, "within")
        ids = routes.ids()
        row, ends = routes.row(source), routes.rows(targets, "targets")
        found = routes.nearest_end(row, ends, weight, most)
        return None if found is None else ids.item(ends.item(found))

    def _rows_of(self, sources: NodeIds, targets: NodeIds) -> tuple[IntArray, IntArray]:
        self._routes.ids()
        return self._routes.rows(sources, "sources"), self._routes.rows(targets, "targets")

    def distances(self, sources: NodeIds, targets: NodeIds, weight: str | None = "length") -> FloatArray:
        """Return what `distance` says of each pair, (sources, targets).

        Args:
            sources: node ids.
            targets: node ids.
            weight: see above.

        Raises:
            UnknownName (KeyError): there is no such node.
        """
        routes, rows, ends = self._routes, *self._rows_of(sources, targets)
        different, place = np.unique(ends, return_inverse=True)
        found = np.empty((len(different), len(rows)))
        for line, end in zip(found, different.tolist(), strict=True):
            line[:] = routes.near_end(rows, end, weight, is_nearest=False)
        return found[place].T

    def distances_from_nearest(
        self, sources: Iterable[int], targets: Iterable[int], weight: str | None = "length"
    ) -> list[float]:
        """Return how far each of some nodes is by path from the nearest of some sources; infinite where none leads.

        The numbers are those of `distance`. It searches back from each target until it has reached a source.

        Args:
            sources: node ids.
            targets: node ids.
            weight: see above.

        Raises:
            UnknownName (KeyError): there is no such node.
        """
        routes, rows, ends = self._routes, *self._rows_of(sources, targets)
        near = [routes.near_end(rows, end, weight, is_nearest=True) for end in ends.tolist()]
        return [float(far.min(initial=inf)) for far in near]

    def tables(self, targets: NodeIds, weight: str | None = "length", cutoff: float = inf) -> RouteTables:
        """Return how far all nodes are from some targets, and where the shortest paths to these begin.

        It is what `distance` and `shortest_path` say, for all nodes at once: 16 bytes for each node and target.

        Args:
            targets: node ids, each once.
            weight: see above.
            cutoff: nodes that are farther away than this count as if no path led from them.

        Raises:
            UnknownName (KeyError): there is no such node.
            BadValue (ValueError): `cutoff` is negative or NaN.
        """
        routes, limit = self._routes, as_range(cutoff, "cutoff")
        ids, ends = routes.ids(), routes.rows(targets, "targets")
        return RouteTables(*kernels.route_tables(routes.arcs(weight, reverse=True), ends, ids, limit))

    def arcs(self, weight: str | None = "length", *, reverse: bool = False) -> kernels.Arcs:
        """Return the edges with their weights as compressed sparse rows, or reversed ones; parallel ones are one."""
        arcs = self._routes.arcs(weight, reverse=reverse)
        return self._locked(
            ("arcs", weight, reverse),
            lambda: kernels.Arcs(locked(arcs.offsets), locked(arcs.ends), locked(arcs.weights)),
        )

    def neighborhoods(self) -> tuple[IntArray, IntArray]:
        """Return offsets (nodes + 1,) and rows of nodes: each node itself, then its neighbours; not to be changed."""
        found = self._routes.neighborhoods()
        return self._locked(("neighborhoods",), lambda: (locked(found[0]), locked(found[1])))

    def rows(self, nodes: NodeIds) -> IntArray:
        """Return the rows of nodes.

        Raises:
            UnknownName (KeyError): one is not on the map.
        """
        return self._routes.rows(nodes, "nodes")

    def weights(self, weight: str | None) -> FloatArray:
        """Return what each edge costs, (edges,)."""
        found = self._routes.weights(weight)
        return self._locked(("weights", weight), lambda: (locked(found),))[0]

    def _locked(self, key: tuple[Any, ...], make: Callable[[], RememberedT]) -> RememberedT:
        """Return what is made once, for callers among which are strategies, of what all paths are found by."""
        return self._routes.remember(("locked", *key), make)

    def nearest_edge(self, x: float, y: float, within: float | None = None) -> NearestEdge | None:
        """Return the edge that is nearest to a place by the straight line, and where on it.

        The polylines of the edges count. They are put into an R-tree (shapely's `STRtree`, packed as by Leutenegger,
        Lopez and Edgington, 1997), once for each revision of the graph.

        Args:
            x: map units.
            y: map units.
            within: edges that are farther away do not count, map units; None: all do.

        Returns:
            Of several that are equally near up to rounding, such as both directions of a street, the first in insertion
            order; None where there is none within the distance.

        Raises:
            BadValue (ValueError): the place or the distance is none, or there are no edges and no `within`.
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
        row = self._line_tree(columns).nearest(place)
        ends = columns.xy[[columns.sources[row], columns.targets[row]]]
        share, distance = geometry.nearest_on(columns.polylines.get(row, ends), place)
        if distance > limit:
            return None
        return NearestEdge(columns.edge_ids.item(row), share * columns.lengths.item(row), distance)

    def _line_tree(self, columns: GraphColumns) -> geometry.LineTree:
        """Return the tree of the edges; built once for each revision of the graph."""
        if self._tree is None or self._tree[0] != columns.revision:
            ends = np.stack((columns.xy[columns.sources], columns.xy[columns.targets]), axis=1)
            self._tree = columns.revision, geometry.LineTree(ends, columns.polylines)
        return self._tree[1]


def made_last(queries: RouteQueries, slot: Hashable, key: object, make: Callable[[], MadeT]) -> MadeT:
    """Return what `make` gives, or what it gave when this slot was asked last, if for this graph and an equal key.

    For shipped strategies and sensors, of what many agents ask for in a turn. It must depend on nothing but the graph
    and the key.

    Args:
        queries: of the graph, with which it is kept.
        slot: what it is and whose, such as the names of the strategy and of the team.
        key: what it is made from.
        make: makes it; it is not to be changed.
    """
    now, (known, made) = (queries._columns().revision, key), queries._latest.get(slot, (None, None))
    if known != now:
        made = make()
        queries._latest[slot] = now, made
    found: MadeT = made
    return found


def made_in_moment(
    queries: RouteQueries, phase: DecidePhase, slot: Hashable, make: Callable[[], MadeT], key: object = None
) -> MadeT:
    """Return what `make` gives of the agents, made once for all that decide in one moment, in which these stay.

    Where there is no such moment, as in a loop of one's own, it is made each time.

    Args:
        queries: as for `made_last`.
        phase: of the context.
        slot: as for `made_last`.
        make: makes it; it is not to be changed.
        key: what else it is made from.
    """
    moment = phase.moment
    if moment is None:
        return make()
    return made_last(queries, slot, (moment, key), make)
