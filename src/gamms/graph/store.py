"""The nodes and edges of one graph: tables, derived indexes, and a revision number.

`Cache` stores arrays that other parts derive from one revision.
"""

import dataclasses
from collections import OrderedDict, deque
from collections.abc import Callable, Collection, Hashable, Iterable, Sequence
from copy import deepcopy
from math import isfinite
from typing import Any, TypeVar

import numpy as np

from gamms import kernels
from gamms.core.agents import NodeNumbers, number_nodes
from gamms.errors import BadValue
from gamms.graph import records
from gamms.graph.indexes import Indexes
from gamms.graph.tables import ClosedTable, EdgeTable, NodeTable, TableSharing, freeze_mapping, join_rows
from gamms.ir.graph import ClosedEdges, FloatArray, GraphColumns, make_edge_arguments, read_only
from gamms.ir.scenery import Scenery

_ENTRY_BYTES = 512  # bytes per cache entry in addition to the arrays, estimated
_MOST_CHANGES = 4096  # of roads, that are remembered
_GROUND = ("z", "underground")  # node attributes: height of the ground, and number of a tunnel

Arrays = TypeVar("Arrays", bound=tuple["np.ndarray[Any, Any] | memoryview", ...])


class Neighborhoods(dict[int, tuple[int, ...]]):
    """A mapping from node id to the node itself, then its neighbors; computed on demand.

    Attributes:
        known: those that any store has computed that shares the tables of this one.
    """

    # NOTE: a dict with __missing__ looks up a known node without a Python call (benchmarks: the loop).

    def __init__(self, store: "GraphStore") -> None:
        self._store = store
        self.known: dict[int, tuple[int, ...]] = {}

    def __deepcopy__(self, memo: dict[int, Any]) -> "Neighborhoods":
        return deepcopy(self._store, memo).neighborhoods

    def forget(self, id: int) -> None:
        """Drop the neighborhood of a node whose neighbors have changed; the tables are not shared."""
        self.pop(id, None)
        self.known.pop(id, None)

    def begin_again(self, known: dict[int, tuple[int, ...]]) -> None:
        """Drop all neighborhoods, for other tables, of which these are known."""
        self.clear()
        self.known = known

    def learn(self, ids: Iterable[int]) -> None:
        """Compute the neighborhoods of many nodes at once; unknown nodes are left out."""
        row_of = self._store.nodes.index.find_row
        rows = {id: row for id in ids if id not in self and (row := row_of(id)) >= 0}
        for id, targets in zip(rows, self._store.indexes.list_targets_of_each([*rows.values()]), strict=True):
            self[id] = self.known[id] = tuple(dict.fromkeys([id, *targets]))

    def __missing__(self, id: int) -> tuple[int, ...]:
        made = self.known.get(id)
        if made is None:
            id = records.as_id(id, "a node", self._store)
            made = tuple(dict.fromkeys([id, *self._store.indexes.list_targets(id)]))
            self.known[id] = made
        self[id] = made
        return made


class GraphStore(TableSharing):
    """The data of a graph, for `Graph` and for modules that fill or read it; callers check the arguments.

    Attributes:
        nodes: the table of nodes.
        edges: the table of edges.
        indexes: indexes of both tables.
        neighborhoods: node id -> the node itself, then its neighbors.
        revision: a number that changes with every change of the graph.
        road_changes: the number of these changes that only closed, opened or removed edges; see `note_roads`.
        crs: the coordinate reference system of x and y.
        attribution: the authors of the data.
        scenery: the base map, which blocks no sight, or its name; None: no base map.
        closed: id -> closed edge, as `add_edge` takes it; replaced, never mutated.
        modes: the modes that were asked for; they stay known when their last edge is removed.
    """

    edges: EdgeTable
    indexes: Indexes
    closed: ClosedEdges
    revision: int
    _columns: GraphColumns | None

    def __init__(self) -> None:
        self._begin()
        self.clear()

    def _begin(self) -> None:
        """Set the attributes that do not depend on the tables."""
        self.revision = -1
        self.road_changes = 0
        self._changed_roads: deque[Sequence[int]] = deque(maxlen=_MOST_CHANGES)  # the edges of the last road changes
        self.neighborhoods = Neighborhoods(self)
        self.modes: frozenset[str] = frozenset()
        self._ground: FloatArray | None = None
        self._ground_key: tuple[int, int, int] | None = None

    def clear(self) -> None:
        """Remove every node and edge."""
        self.stop_sharing()
        self.nodes = NodeTable()
        self.edges = EdgeTable()
        self._numbers: dict[str, NodeNumbers] = {}  # of nodes and edges; shared by all stores of the map
        self.crs: str | None = None
        self.attribution: str | None = None
        self.scenery: str | Scenery | None = None
        self.closed = {}
        self._columns = None
        self._ground = None
        self._ground_key = None
        self.record_added_rows()

    @property
    def node_numbers(self) -> NodeNumbers:
        """The numbers of node ids: the rows of the map as it was loaded, unchanged until another map is loaded."""
        return self._numbers.get("nodes") or self._number_table("nodes")

    @property
    def edge_numbers(self) -> NodeNumbers:
        """Numbers of the edges, as of the nodes."""
        return self._numbers.get("edges") or self._number_table("edges")

    def columns(self) -> GraphColumns:
        """Return the graph as columns that never change; attribute values are not copied."""
        known = self._columns
        if known is None or known.revision != self.revision:
            self._compact(fully=True)
            known = self._freeze()
            self._columns = known
        return known

    def get_ground(self) -> FloatArray | None:
        """Return height and tunnel number of each node row, removed nodes included, (rows, 2); None if all are 0."""
        key = self.revision, self.nodes.count, self.nodes.dead
        if key != self._ground_key:
            attributes = self.nodes.attributes
            ground = np.zeros((self.nodes.count, 2))
            for column, name in enumerate(_GROUND):
                for row, value in attributes.get(name, {}).items():
                    # Attributes set by users may have any type.
                    if type(value) in (int, float) and isfinite(value):
                        ground[row, column] = value
            ground[self.nodes.get_array("alive") == 0] = 0.0
            self._ground = ground if ground.any() else None
            self._ground_key = key
        return self._ground

    def replace(
        self, columns: GraphColumns, attribution: str | None, scenery: str | Scenery | None, closed: ClosedEdges
    ) -> None:
        """Replace the graph by the one described by columns."""
        self.clear()
        self.append(columns, attribution)
        self.scenery = scenery
        self.closed = closed

    def append(self, columns: GraphColumns, attribution: str | None) -> None:
        """Append nodes and edges; on an error nothing is added.

        Raises:
            DuplicateId (KeyError): an id is taken, or occurs twice.
            BadValue: the CRS differs.
        """
        self.unshare_tables()
        nodes = self.nodes
        edges = self.edges
        if len(nodes) and None not in (columns.crs, self.crs) and columns.crs != self.crs:
            raise BadValue(f"its CRS is {columns.crs}, but the graph has {self.crs}; project it first")
        nodes.index.refuse_duplicates(columns.node_ids, nodes.kind)
        edges.index.refuse_duplicates(columns.edge_ids, edges.kind)
        first = nodes.extend(columns.node_ids, xy=columns.xy)
        nodes.add_attributes(first, columns.node_attributes)
        ends = {"sources": columns.sources + first, "targets": columns.targets + first}
        first = edges.extend(columns.edge_ids, lengths=columns.lengths, **ends)
        edges.polylines = join_rows(edges.polylines, first, columns.polylines)
        edges.add_attributes(first, columns.edge_attributes)
        self.crs = columns.crs or self.crs
        self.attribution = attribution or self.attribution
        self.record_added_rows()

    def record_added_rows(self) -> None:
        """Record that many rows were added to the tables."""
        self._discard_indexes()
        self.revision += 1

    def remove_node(self, node_id: int) -> None:
        """Remove a node and its edges; a missing node is ignored."""
        self.unshare_tables()
        row = self.nodes.index.find_row(node_id)
        if row < 0:
            return
        for edge in self.indexes.find_edges_at(np.array([row])).tolist():
            self._drop_edge(edge)
        self.closed = {id: edge for id, edge in self.closed.items() if node_id not in (edge["source"], edge["target"])}
        self.nodes.remove(row)
        self.indexes.record_removed_node(row)
        self.revision += 1
        self._compact()

    def remove_edge(self, edge_id: int) -> None:
        """Remove an edge (KeyError)."""
        self.unshare_tables()
        self._drop_edge(self.edges.find(edge_id))
        self.revision += 1
        self.note_roads((edge_id,))
        self._compact()

    def close_edges(self, ids: Collection[int]) -> None:
        """Remove edges, and store them as closed edges."""
        self.unshare_tables()
        edges = self.edges
        node_ids = self.nodes.ids
        closed = dict(self.closed)
        for id in ids:
            row = edges.find(id)
            ends = (node_ids[edges.sources[row]], node_ids[edges.targets[row]])
            line = edges.polylines.get(row)
            closed[id] = make_edge_arguments(id, ends, edges.lengths[row], line, edges.copy_attributes(row))
            self._drop_edge(row)
        self.closed = closed
        self.revision += 1
        self.note_roads([*ids])
        self._compact()

    def note_roads(self, ids: Sequence[int]) -> None:
        """Record that the last change of the graph has only closed, opened or removed these edges."""
        self.road_changes += 1
        self._changed_roads.append(ids)

    def find_changed_roads(self, since: int) -> list[int] | None:
        """Return the ids of edges that were closed, opened or removed since a number of road changes; None: unknown."""
        count = self.road_changes - since
        if not 0 <= count <= len(self._changed_roads):
            return None
        return [id for place in range(-count, 0) for id in self._changed_roads[place]]

    def close(self) -> None:
        """Release all data; later calls on the graph raise ContextTerminated."""
        self.stop_sharing()
        self.neighborhoods.begin_again({})
        closed: Any = ClosedTable()
        self.nodes = closed
        self.edges = closed
        self.indexes = closed
        self._columns = closed

    def fork(self) -> "GraphStore":
        """Return another store of this graph; both share the tables until one of them changes."""
        store = GraphStore.__new__(GraphStore)
        store._begin()
        store.share(self)
        store.revision = self.revision
        store._columns = self._columns
        return store

    def share(self, other: "GraphStore") -> None:
        """Replace the graph by the graph of another store; both share the tables until one of them changes."""
        columns = other.columns()  # this call removes dead rows
        self.stop_sharing()
        self.nodes = other.nodes
        self.edges = other.edges
        self.indexes = other.indexes
        self._numbers = other._numbers
        self.crs = other.crs
        self.attribution = other.attribution
        self.scenery = other.scenery
        self.closed = other.closed
        self.modes |= other.modes
        self.revision = max(self.revision + 1, other.revision)
        is_same = self.revision == other.revision
        self._columns = columns if is_same else dataclasses.replace(columns, revision=self.revision)
        self.neighborhoods.begin_again(other.neighborhoods.known)
        self.share_with(other)

    def unshare_tables(self) -> None:
        """Stop sharing the tables; called before every change."""
        if self._sharers is None:
            return
        self.neighborhoods.known = {}
        if self.stop_sharing():
            columns = self.columns()
            revision = self.revision
            numbers = self._numbers
            self.replace(columns, self.attribution, self.scenery, self.closed)
            self._numbers = numbers
            self.revision = revision
            self._columns = columns
        self.indexes.forget = self.neighborhoods.forget

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the graph; its indexes are rebuilt on loading."""
        return _rebuild_store, (self.columns(), self.attribution, self.scenery, self.closed, self.modes)

    def __deepcopy__(self, memo: dict[int, Any]) -> "GraphStore":
        """Copy the graph, for simulations by a strategy."""
        copied = GraphStore()
        memo[id(self)] = copied
        copied.replace(deepcopy(self.columns(), memo), self.attribution, self.scenery, deepcopy(self.closed, memo))
        copied.modes = self.modes
        return copied

    def _number_table(self, table: str) -> NodeNumbers:
        # NOTE: in one step, because forks that share a map may ask for its numbers in several threads.
        return self._numbers.setdefault(table, number_nodes(getattr(self, table).get_array("ids").data))

    def _discard_indexes(self) -> None:
        self.neighborhoods.begin_again({})
        self.indexes = Indexes(self.nodes, self.edges, self.neighborhoods.forget)

    def _drop_edge(self, row: int) -> None:
        ends = (self.edges.sources[row], self.edges.targets[row])
        self.edges.remove(row)
        self.indexes.record_removed_edge(ends)

    def _compact(self, *, fully: bool = False) -> None:
        """Drop dead rows, by default only if they outnumber the living, so that the cost per removal is constant."""
        nodes = self.nodes
        edges = self.edges
        if nodes.dead > (0 if fully else len(nodes)):
            edges.rename_ends(nodes.compact())
            self._discard_indexes()
        if edges.dead > (0 if fully else len(edges)):
            edges.compact()
            self._discard_indexes()

    def _freeze(self) -> GraphColumns:
        """Return the tables, which must not have dead rows, as columns."""
        nodes = self.nodes
        edges = self.edges
        offsets, out_edges = kernels.group_rows(edges.get_array("sources"), nodes.count)
        return GraphColumns(
            node_ids=nodes.get_frozen("ids"),
            xy=nodes.get_frozen("xy"),
            edge_ids=edges.get_frozen("ids"),
            sources=edges.get_frozen("sources"),
            targets=edges.get_frozen("targets"),
            lengths=edges.get_frozen("lengths"),
            offsets=read_only(offsets),
            out_edges=read_only(out_edges),
            polylines=freeze_mapping(edges.polylines),
            node_attributes={name: freeze_mapping(values) for name, values in nodes.attributes.items() if values},
            edge_attributes={name: freeze_mapping(values) for name, values in edges.attributes.items() if values},
            revision=self.revision,
            crs=self.crs,
        )


def _rebuild_store(
    columns: GraphColumns,
    attribution: str | None,
    scenery: str | Scenery | None,
    closed: ClosedEdges,
    modes: frozenset[str],
) -> GraphStore:
    store = GraphStore()
    store.replace(columns, attribution, scenery, closed)
    store.modes = modes
    return store


class Cache:
    """Caches tuples of arrays by key; the least recently used one is dropped first.

    Args:
        most_bytes: limit of the total size; a larger entry is not cached.

    Attributes:
        revision: the graph revision of the entries.
        entries: key -> arrays, for look-ups without `get`; read-only.
    """

    def __init__(self, most_bytes: int) -> None:
        self._most_bytes = most_bytes
        self.revision: int | None = None
        self.entries: OrderedDict[Hashable, Any] = OrderedDict()
        self.bytes = 0

    def get(self, revision: int, key: Hashable, make: Callable[[], Arrays]) -> Arrays:
        """Return the result of `make`, cached for this revision; entries of other revisions are dropped."""
        if revision != self.revision:
            self.clear()
            self.revision = revision
        try:
            known: Arrays | None = self.entries.get(key)
        except TypeError:  # the weight is not hashable: `make` raises a clear error
            return make()
        if known is not None:
            self.entries.move_to_end(key)
            return known
        made = make()
        self._add(key, made)
        return made

    def take_over(self, other: "Cache") -> None:
        """Replace the entries by the entries of another cache."""
        self.revision = other.revision
        self.entries = other.entries.copy()
        self.bytes = other.bytes

    def clear(self) -> None:
        """Discard all entries."""
        self.entries.clear()
        self.bytes = 0

    def _add(self, key: Hashable, made: "tuple[np.ndarray[Any, Any] | memoryview, ...]") -> None:
        size = _count_bytes(made)
        if size > self._most_bytes:
            return
        while self.bytes + size > self._most_bytes:
            _, oldest = self.entries.popitem(last=False)
            self.bytes -= _count_bytes(oldest)
        self.entries[key] = made
        self.bytes += size


def _count_bytes(arrays: "tuple[np.ndarray[Any, Any] | memoryview, ...]") -> int:
    return _ENTRY_BYTES + sum(array.nbytes for array in arrays)
