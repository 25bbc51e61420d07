"""Indexes that are rebuilt from the tables of a graph: nodes by place, edges by end, values by row.

Each index is built on first use; a change is noted in it, or discards the affected part.
"""

from collections.abc import Callable, Sequence
from functools import partial
from math import inf, isqrt
from typing import Any

import numpy as np

from gamms import kernels
from gamms.errors import UnknownName
from gamms.graph.tables import EdgeTable, NodeTable
from gamms.ir.graph import FloatArray, IntArray, RowArray
from gamms.ir.obstacles import BoolArray
from gamms.typing.graph_values import Node, OSMEdge

_LATE_EDGES = 1024
_LATE_NODES = 256
_REACHES = (1, 3)  # half widths in cells, of the squares searched for one place
_REACHES_OF_EACH = (0.5, 1.0, 3.0, 9.0)  # half widths in cells, of the squares searched for several places at once
_SURE = 1.0 - 1e-9  # share of a radius; nodes nearer than this are certainly found in spite of rounding
# distances whose squares neither vanish nor overflow
_LEAST = 1e-150
_MOST = 1e150
_TINY = 5e-324  # replaces a square that would be zero

# NOTE: skips the checking constructors; the tables hold checked values (benchmarks: sense).
_node: Callable[[Any], Node] = partial(tuple.__new__, Node)
_edge: Callable[[Any], OSMEdge] = partial(tuple.__new__, OSMEdge)


class NodeGrid:
    """A cell grid that finds the node rows in a disc in time independent of the size of the graph."""

    def __init__(self, nodes: NodeTable) -> None:
        self._nodes = nodes
        self._cells = kernels.build_cells(nodes.get_array("xy"))
        self._late: set[int] = set()  # rows added or moved since the grid was built

    def note(self, row: int) -> None:
        """Record that a node was added or moved."""
        self._late.add(row)

    @property
    def is_outdated(self) -> bool:
        """Whether the list of changes is so long that a new grid is cheaper."""
        return len(self._late) > _LATE_NODES + 2 * isqrt(len(self._cells.rows))

    def find_within(self, x: float, y: float, d: float) -> IntArray:
        """Return the living node rows with distance <= d to (x, y), ascending."""
        rows = kernels.find_candidate_rows(self._cells, x, y, d)
        if rows is None:
            rows = np.arange(self._nodes.count)
        elif self._late:
            rows = np.union1d(rows, np.fromiter(self._late, np.int64))
        there_x, there_y = self._nodes.get_array("xy")[rows].T
        rows = rows[is_within(there_x, there_y, x, y, d)]
        if self._nodes.dead:
            rows = rows[self._nodes.get_array("alive")[rows] != 0]
        return np.sort(rows)

    def find_around(self, x: float, y: float, reach: int) -> list[int]:
        """Return the node rows, including dead ones, in the cells around (x, y), and the rows changed since."""
        return [*kernels.find_rows_around(self._cells, x, y, reach), *self._late]

    def find_nearest(self, x: float, y: float) -> int:
        """Return the living node row nearest to (x, y), the first of several; the grid must have one.

        Compares squares of distances; distances themselves if squares would vanish or overflow.
        """
        # NOTE: first in plain Python; NumPy takes ten times as long for so few nodes (benchmarks: flyers).
        for reach in _REACHES:
            found, square = self._find_nearest_around(x, y, reach)
            if square == 0.0 or _LEAST**2 < square < min((reach - 0.1) * self._cells.size, _MOST) ** 2:
                return found
        return self._find_nearest(self._nodes.list_living(), x, y)

    def find_nearest_each(self, x: FloatArray, y: FloatArray) -> IntArray:
        """Return the nearest row for each of several places, (places,); see `find_nearest`."""
        found = np.full(len(x), -1)
        open_ = np.arange(len(x))
        for reach in () if self._late else _REACHES_OF_EACH:
            d = reach * self._cells.size
            parts = (
                kernels.find_candidates_of_each(self._cells, x[open_], y[open_], d)
                if d < _MOST and len(open_)
                else None
            )
            for begin, end, at, rows in parts or ():
                places = open_[begin:end]
                which, row = self._find_first_near(x[places], y[places], (at, rows), d * _SURE)
                found[places[which]] = row
            open_ = np.flatnonzero(found < 0)
        found[open_] = [self.find_nearest(*place) for place in zip(x[open_].tolist(), y[open_].tolist(), strict=True)]
        return found

    def _find_first_near(
        self, x: FloatArray, y: FloatArray, pairs: tuple[IntArray, IntArray], d: float
    ) -> tuple[IntArray, IntArray]:
        """Return indices of places and their nearest living rows, if these are certainly closer than d.

        Args:
            x: (places,)
            y: (places,)
            pairs: indices of places, ascending, and candidate rows.
            d: radius around each place within which all rows are among the pairs.
        """
        at, rows = pairs
        if self._nodes.dead:
            at, rows = (column[self._nodes.get_array("alive")[rows] != 0] for column in pairs)
        xy = self._nodes.get_array("xy").take(rows, axis=0)
        dx = xy[:, 0] - x[at]
        dy = xy[:, 1] - y[at]
        squares = dx * dx + dy * dy
        squares[(squares <= _LEAST**2) & ((dx != 0.0) | (dy != 0.0))] = np.nan  # too small to compare by squares
        begins = np.flatnonzero(np.diff(at, prepend=-1))
        if not len(begins):
            return begins, begins
        least = np.minimum.reduceat(squares, begins)
        runs = np.diff(begins, append=len(at))
        is_least = squares == np.repeat(least, runs)
        row = np.minimum.reduceat(np.where(is_least, rows, self._nodes.count), begins)
        is_sure = least < d * d
        return at[begins[is_sure]], row[is_sure]

    def _find_nearest_around(self, x: float, y: float, reach: int) -> tuple[int, float]:
        """Return the first living row at the least distance from (x, y) in the cells around it, and the square."""
        xy = self._nodes.xy
        alive = self._nodes.alive
        least = inf
        found = -1
        for row in self.find_around(x, y, reach):
            dx = xy[2 * row] - x
            dy = xy[2 * row + 1] - y
            square = dx * dx + dy * dy
            if not square and (dx or dy):
                square = _TINY
            if (square < least or (square == least and row < found)) and alive[row]:
                least = square
                found = row
        return found, least

    def _find_nearest(self, rows: IntArray, x: float, y: float) -> int:
        """Return the row nearest to (x, y), the first of equals."""
        with np.errstate(over="ignore", under="ignore"):  # an infinite distance is a valid result
            dx, dy = (self._nodes.get_array("xy")[rows] - (x, y)).T
            squares = dx * dx + dy * dy
            if not _LEAST**2 < squares.min() < _MOST**2:
                squares = np.hypot(dx, dy)
            return int(rows[np.argmin(squares)])


class Adjacency:
    """Edge rows grouped by source (or target) row.

    A grouping is computed once; later changes of edges are noted in addition. Rows from the grouping are checked
    against the table when they are read, so a removed edge needs no note.
    """

    def __init__(self, edges: EdgeTable, end: str, nodes: int) -> None:
        self._edges = edges
        self._end = end
        self._nodes = nodes
        self._offsets, self._rows = kernels.group_rows(edges.get_array(end), nodes)
        self._offset_view = self._offsets.data
        self._row_view = self._rows.data
        self._late: dict[int, list[int]] = {}  # node row -> edge rows added later
        self._late_count = 0
        self._is_exact = edges.dead == 0  # whether all grouped edges are alive and unmoved

    def note_added(self, node: int, edge: int) -> None:
        """Record that an edge now has this end at `node`."""
        self._late.setdefault(node, []).append(edge)
        self._late_count += 1

    def note_changed(self) -> None:
        """Record that an edge was removed or moved away from its node."""
        self._is_exact = False

    @property
    def is_outdated(self) -> bool:
        """Whether the list of changes is so long that a new grouping is cheaper."""
        return self._late_count > _LATE_EDGES + len(self._rows) // 4

    def find_edges_at(self, node: int) -> list[int]:
        """Return the living edge rows whose end is this node row, ascending."""
        rows: list[int] = []
        if node < self._nodes:
            rows = self._row_view[self._offset_view[node] : self._offset_view[node + 1]].tolist()
        late = self._late.get(node)
        if late:
            rows = sorted({*rows, *late})
        if late or not self._is_exact:
            alive = self._edges.alive
            ends = getattr(self._edges, self._end)
            rows = [row for row in rows if alive[row] and ends[row] == node]
        return rows

    def find_edges(self, nodes: IntArray) -> IntArray:
        """Return the living edge rows whose end is one of `nodes` (unique rows), ascending."""
        known = np.minimum(nodes, self._nodes)
        at, places = kernels.expand_ranges(self._offsets[known], self._offsets[np.minimum(nodes + 1, self._nodes)])
        rows = self._rows[places]
        if self._is_exact and not self._late:
            return np.sort(rows)
        late = [(node, edge) for node in nodes.tolist() for edge in self._late.get(node, ())]
        ends, more = np.array(late, np.int64).reshape(-1, 2).T
        rows = np.concatenate((rows, more))
        ends = np.concatenate((nodes[at], ends))
        is_so = (self._edges.get_array("alive")[rows] != 0) & (self._edges.get_array(self._end)[rows] == ends)
        return np.unique(rows[is_so])


def is_within(x: FloatArray, y: FloatArray, at_x: FloatArray | float, at_y: FloatArray | float, d: float) -> BoolArray:
    """Return whether points are at most `d` from a place, or from each of several places (places, 1)."""
    with np.errstate(over="ignore"):  # an infinite distance is a valid result
        dx = x - at_x
        dy = y - at_y
        is_near: BoolArray = dx * dx + dy * dy <= d * d if _LEAST < d < _MOST else np.hypot(dx, dy) <= d
    return is_near


class RowValueCache:
    """A cache of values by row; `make(rows)` computes missing values."""

    def __init__(self, make: Callable[[RowArray], list[Any]]) -> None:
        self._make = make
        self._known: tuple[np.ndarray[Any, Any], BoolArray] = np.empty(0, object), np.zeros(0, np.bool_)

    def take(self, rows: RowArray, count: int) -> list[Any]:
        """Return the values of `rows` in a table of `count` rows."""
        values, is_made = self._known
        if count > len(values):
            more = count + count // 4 - len(values)  # spare room, so that a growing graph is not copied at each read
            values = np.concatenate((values, np.empty(more, object)))
            is_made = np.concatenate((is_made, np.zeros(more, np.bool_)))
            self._known = values, is_made  # together, because other threads may read it
        if not is_made[rows].all():
            missing = rows[~is_made[rows]]
            values[missing] = np.fromiter(self._make(missing), object, len(missing))
            is_made[missing] = True
        taken: list[Any] = values[rows].tolist()
        return taken

    def forget(self, rows: IntArray) -> None:
        """Drop the values of changed rows."""
        _, is_made = self._known
        is_made[rows[rows < len(is_made)]] = False


def make_node_values(nodes: NodeTable, rows: RowArray) -> list[Node]:
    """Return the values of node rows."""
    xy = nodes.get_array("xy")[rows]
    return list(
        map(_node, zip(nodes.get_array("ids")[rows].tolist(), xy[:, 0].tolist(), xy[:, 1].tolist(), strict=True))
    )


def make_edge_values(
    edges: EdgeTable, nodes: NodeTable, rows: RowArray, take_nodes: Callable[[RowArray], list[Node]]
) -> list[OSMEdge]:
    """Return the values of edge rows; use `take_nodes` for node rows."""
    sources = edges.get_array("sources")[rows]
    targets = edges.get_array("targets")[rows]
    ids = nodes.get_array("ids")
    first: list[Any] = take_nodes(sources)
    last: list[Any] = take_nodes(targets)
    if edges.polylines:
        for i, polyline in edges.find_polylines(rows):
            first[i] = tuple(polyline.ravel().tolist())
            last[i] = None
    fields = (edges.get_array("ids")[rows].tolist(), ids[sources].tolist(), ids[targets].tolist())
    return list(map(_edge, zip(*fields, edges.get_array("lengths")[rows].tolist(), first, last, strict=True)))


class Indexes:
    """The indexes of one graph's tables."""

    def __init__(self, nodes: NodeTable, edges: EdgeTable, forget: Callable[[int], None]) -> None:
        self.is_built = False  # whether any index exists that changes must be noted in
        self.forget = forget  # called with the id of a node whose neighbors have changed
        self._nodes = nodes
        self._edges = edges
        self._grid: NodeGrid | None = None
        self._by_end: dict[str, Adjacency] = {}
        self._node_values = RowValueCache(lambda rows: make_node_values(nodes, rows))
        self._edge_values = RowValueCache(lambda rows: make_edge_values(edges, nodes, rows, self.get_nodes))

    # -- queries ------------------------------------------------------------------------------------------------

    def find_nodes_within(self, x: float, y: float, d: float) -> IntArray:
        """Return the node rows with distance <= d to (x, y), ascending."""
        # A NumPy float32 would exclude nodes at distance d by rounding.
        return self._get_node_grid().find_within(float(x), float(y), float(d))

    def find_nearest(self, x: float, y: float) -> int:
        """Return the node row nearest to (x, y), the first of several; the graph must have a node."""
        return self._get_node_grid().find_nearest(x, y)

    def find_nearest_each(self, x: FloatArray, y: FloatArray) -> IntArray:
        """Return the nearest node row for each of several places, (places,); the graph must have a node."""
        return self._get_node_grid().find_nearest_each(x, y)

    def find_edges_at(self, nodes: IntArray) -> IntArray:
        """Return the edge rows with at least one end among the node rows, ascending."""
        return np.union1d(
            self._get_adjacency("sources").find_edges(nodes), self._get_adjacency("targets").find_edges(nodes)
        )

    def find_edges_among(self, nodes: IntArray) -> IntArray:
        """Return the rows of the edges with both ends among the node rows, in insertion order."""
        rows = self._get_adjacency("sources").find_edges(nodes)
        is_seen = np.zeros(self._nodes.count, np.bool_)
        is_seen[nodes] = True
        among: IntArray = rows[is_seen[self._edges.get_array("targets")[rows]]]
        return among

    def get_edges(self, rows: RowArray) -> list[OSMEdge]:
        """Return the edges of these rows."""
        return self._edge_values.take(rows, self._edges.count)

    def get_nodes(self, rows: RowArray) -> list[Node]:
        """Return the nodes of these rows."""
        self.is_built = True
        return self._node_values.take(rows, self._nodes.count)

    def get_edge(self, row: int) -> OSMEdge:
        """Return the edge of a row."""
        # NOTE: without arrays, because agents on edges ask for single edges (benchmarks: travel).
        edges = self._edges
        nodes = self._nodes
        source = edges.sources[row]
        target = edges.targets[row]
        polyline = edges.polylines.get(row)
        if polyline is None:
            ends = ((nodes.ids[one], nodes.xy[2 * one], nodes.xy[2 * one + 1]) for one in (source, target))
            shape: tuple[Any, ...] = tuple(map(_node, ends))
        else:
            shape = tuple(polyline.ravel().tolist()), None
        return _edge((edges.ids[row], nodes.ids[source], nodes.ids[target], edges.lengths[row], *shape))

    def list_neighbors(self, id: int) -> list[int]:
        """Return the unique targets of the edges leaving a node, in edge insertion order.

        Raises:
            UnknownName (KeyError): the node does not exist.
        """
        return list(dict.fromkeys(self.list_targets(id)))

    def list_targets(self, id: int) -> list[int]:
        """Return the target of each edge leaving a node, in edge insertion order; raise as `list_neighbors`."""
        row = self._nodes.index.find_row(id)
        if row < 0:
            raise UnknownName("node", id, self._nodes.ids)
        edges = self._get_adjacency("sources").find_edges_at(row)
        ids = self._nodes.ids
        targets = self._edges.targets
        return [ids[targets[edge]] for edge in edges]

    def list_targets_of_each(self, nodes: Sequence[int]) -> list[list[int]]:
        """Return the targets of the edges leaving each of several node rows, (nodes,) unique, as `list_targets`."""
        rows = np.array(nodes, np.int64)
        edges = self._get_adjacency("sources").find_edges(rows)
        sources = self._edges.get_array("sources")[edges]
        by_source = np.argsort(sources, kind="stable")
        targets = self._edges.get_array("targets")[edges[by_source]]
        ids = self._nodes.get_array("ids")[targets].tolist()
        begins, ends = (np.searchsorted(sources[by_source], rows, side).tolist() for side in ("left", "right"))
        return [ids[begin:end] for begin, end in zip(begins, ends, strict=True)]

    # -- changes ------------------------------------------------------------------------------------------------

    def record_added_node(self, row: int) -> None:
        """Record that a node was appended."""
        if self._grid is not None:
            self._grid.note(row)

    def record_moved_node(self, row: int) -> None:
        """Record that the coordinates of a node changed; straight edges at it changed their shape."""
        if not self.is_built:
            return
        self.record_added_node(row)
        nodes = np.array([row])
        self._node_values.forget(nodes)
        self._edge_values.forget(self.find_edges_at(nodes))

    def record_removed_node(self, row: int) -> None:
        """Record that a node and its edges were removed."""
        self.forget(self._nodes.ids[row])

    def record_added_edge(self, row: int, source: int, target: int) -> None:
        """Record that an edge was appended, or now has these ends."""
        for end, node in (("sources", source), ("targets", target)):
            if end in self._by_end:
                self._by_end[end].note_added(node, row)
        self.forget(self._nodes.ids[source])

    def record_changed_edge(self, row: int, old_ends: tuple[int, int], ends: tuple[int, int]) -> None:
        """Record that the length, shape or ends of an edge changed."""
        if not self.is_built:
            return
        self._edge_values.forget(np.array([row]))
        if ends != old_ends:
            self.record_removed_edge(old_ends)
            self.record_added_edge(row, *ends)

    def record_removed_edge(self, ends: tuple[int, int]) -> None:
        """Record that an edge was removed, or moved away from these ends."""
        for adjacency in self._by_end.values():
            adjacency.note_changed()
        self.forget(self._nodes.ids[ends[0]])

    def _get_node_grid(self) -> NodeGrid:
        if self._grid is None or self._grid.is_outdated:
            self._grid = NodeGrid(self._nodes)
            self.is_built = True
        return self._grid

    def _get_adjacency(self, end: str) -> Adjacency:
        adjacency = self._by_end.get(end)
        if adjacency is None or adjacency.is_outdated:
            adjacency = Adjacency(self._edges, end, self._nodes.count)
            self._by_end[end] = adjacency
            self.is_built = True
        return adjacency
