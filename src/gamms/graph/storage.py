"""Store a map, which is a graph and its obstacles, as bytes and as snapshots.

Programs use `ctx.graph.save` and `ctx.graph.load`; `ctx.graph.storage` is for engines and clients.
"""

from collections.abc import Iterable
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

from gamms.deciding import DecidePhase, Guarded
from gamms.errors import BadFile, BadType, BadValue
from gamms.graph.obstacles import Obstacles
from gamms.graph.store import Cache, GraphStore
from gamms.ir.graph import ClosedEdges, GraphColumns, IntArray, lock_columns
from gamms.ir.obstacles import ObstacleColumns
from gamms.ir.scenery import Scenery
from gamms.text import shown
from gamms.typing import IContext
from gamms.typing.map_storage import IMapStorage, IPackedGraph, LeftOut, packed_graphs
from gamms.typing.routes import RouteQueries

if TYPE_CHECKING:
    import networkx as nx
    from numpy.random import Generator

    from gamms.graph.map_file import SavedMap

_VISIBILITY_BYTES = 256 << 20


class MapSnapshot(NamedTuple):
    """The graph and the obstacles at one moment."""

    columns: GraphColumns
    obstacles: ObstacleColumns
    attribution: str | None
    scenery: str | Scenery | None
    closed: ClosedEdges
    modes: frozenset[str]
    revision: int
    obstacle_revision: int
    visibility_rows: Cache
    packed: list[bytes]  # the packed map, once one of the contexts that share this list has packed it
    place_state: Any  # state of the random stream of `place`; None: nothing was drawn
    shared: "list[tuple[GraphStore, Obstacles]]"  # tables shared by all contexts with this map, once created

    def get_tables(self) -> "tuple[GraphStore, Obstacles]":
        """Return the read-only tables that all contexts with this map share; made on the first call."""
        if not self.shared:
            store = GraphStore()
            obstacles = Obstacles()
            store.replace(self.columns, self.attribution, self.scenery, self.closed)
            store.modes = self.modes
            obstacles.put(self.obstacles)
            self.shared.append((store, obstacles))
        return self.shared[0]


class MapStorage(Guarded, IMapStorage):
    """Packs, unpacks, snapshots and restores the graph and the obstacles of one context.

    Attributes:
        visibility_rows: rows of visibility tables by a key of their inputs; contexts may share them.
    """

    _called = "ctx.graph.storage"

    def __init__(self, ctx: IContext, store: GraphStore, obstacles: Obstacles, phase: DecidePhase) -> None:
        self._phase = phase
        self._ctx = ctx
        self._store = store
        self._obstacles = obstacles
        self.visibility_rows = Cache(_VISIBILITY_BYTES)
        self._place_stream: Generator | None = None
        self._restored: dict[int, int] = {}  # revision of a snapshot -> equal revision after it was restored
        self._restored_obstacles: dict[int, int] = {}  # the same for obstacles
        self._packed: tuple[tuple[int, int], list[bytes]] = ((-1, -1), [])  # see `_make_key` and `_list_packed_map`
        self._last_snapshot: tuple[tuple[Any, ...], MapSnapshot] | None = None  # (key of its inputs, snapshot)

    def get_contents(self) -> "SavedMap":
        """Return the complete contents of a map file."""
        from gamms.graph.map_file import SavedMap

        store = self._store
        return SavedMap(store.columns(), list(self._obstacles), store.attribution, store.scenery, store.closed)

    def put(self, contents: "SavedMap") -> None:
        """Replace the graph and the obstacles by the contents of a file."""
        self._store.replace(contents.columns, contents.attribution, contents.scenery, contents.closed)
        self._obstacles.replace(contents.faces)

    def pack(self) -> bytes:
        """Return graph, obstacles, CRS and attributes as the bytes that `save` writes; cached until the map changes."""
        from gamms.graph import map_file

        packed = self._list_packed_map()
        if not packed:
            packed.append(map_file.encode(self.get_contents()))
        return packed[0]

    def _list_packed_map(self) -> list[bytes]:
        """Return a list with the packed current map, or an empty list if it has not been packed."""
        if self._packed[0] != (now := self._make_key()):
            self._packed = now, []
        return self._packed[1]

    def _make_key(self) -> tuple[int, int]:
        """Return a key that changes with every change of the map."""
        return self._store.revision, self._obstacles.revision

    def pack_savable(self) -> tuple[bytes, LeftOut]:
        """Pack the map without attributes that are not plain values; also return the names of these attributes."""
        try:
            return self.pack(), {}
        except BadValue:
            from gamms.graph import map_file

            contents, left_out = map_file.select_savable(self.get_contents())
            return map_file.encode(contents), left_out

    def unpack(self, data: bytes) -> None:
        """Replace the graph and the obstacles by a map that `pack` packed."""
        from gamms.graph import map_file

        if not isinstance(data, (bytes, bytearray, memoryview)):
            raise BadType(f"A packed graph is bytes, not {shown(data)}.")
        self.put(map_file.decode(data))

    def snapshot(self) -> MapSnapshot:
        """Return the present graph and obstacles, for `restore` and `copy_from`."""
        store = self._store
        stream = self._place_stream
        packed = self._list_packed_map()
        of = (
            *self._make_key(),
            id(store.closed),
            store.modes,
            store.attribution,
            store.scenery,
            id(self.visibility_rows),
            id(packed),
        )
        if stream is None and self._last_snapshot is not None and self._last_snapshot[0] == of:
            return self._last_snapshot[1]
        snapshot = MapSnapshot(
            store.columns(),
            self._obstacles.columns(),
            store.attribution,
            store.scenery,
            store.closed,
            store.modes,
            store.revision,
            self._obstacles.revision,
            self.visibility_rows,
            packed,
            None if stream is None else stream.bit_generator.state,
            [],
        )
        if stream is None:
            self._last_snapshot = of, snapshot
        return snapshot

    def restore(self, before: MapSnapshot) -> None:
        """Restore a snapshot of this context; unchanged parts keep their indexes."""
        store = self._store
        obstacles = self._obstacles
        if store.revision not in (before.revision, self._restored.get(before.revision)):
            store.share(before.get_tables()[0])
            self._restored = {before.revision: store.revision}
        known = before.obstacle_revision, self._restored_obstacles.get(before.obstacle_revision)
        if obstacles.revision not in known:
            obstacles.share(before.get_tables()[1])
            self._restored_obstacles = {before.obstacle_revision: obstacles.revision}
        self._packed = self._make_key(), before.packed
        self._place_stream = None
        if before.place_state is not None:
            self.get_place_stream().bit_generator.state = before.place_state

    def copy_from(self, snapshot: MapSnapshot) -> None:
        """Share the graph and the obstacles of another context's snapshot, until one of the contexts changes them."""
        store, obstacles = snapshot.get_tables()
        self._store.share(store)
        self._obstacles.share(obstacles)
        self.visibility_rows = snapshot.visibility_rows
        self._packed = self._make_key(), snapshot.packed

    def note_mode(self, mode: str) -> None:
        """Let a mode of agents be known, although no edge may have its attribute any more."""
        self._store.modes |= {mode}

    def list_roads(self) -> tuple[IntArray, ClosedEdges]:
        """Return the ids of all edges in insertion order, and the ids of closed edges."""
        edges = self._store.edges
        return edges.get_array("ids")[edges.list_living()], self._store.closed

    def count_changes(self) -> tuple[int, int, int, bool]:
        """Return the numbers of changes of the graph, of its roads only and of the obstacles, and `has_placed`."""
        store = self._store
        return store.revision, store.road_changes, self._obstacles.revision, self._place_stream is not None

    def find_changed_roads(self, since: tuple[int, int]) -> dict[int, bool] | None:
        """Return which edges were closed, opened or removed since a moment, and whether each of them is open now.

        None: the graph has changed in other ways, too, or so often that they are not known.

        Args:
            since: the first two numbers that `count_changes` returned at that moment.
        """
        store = self._store
        revision, roads = since
        if store.revision - revision != store.road_changes - roads:
            return None
        ids = store.find_changed_roads(roads)
        return None if ids is None else {id: store.edges.index.find_row(id) >= 0 for id in ids}

    def detach_graph(self) -> tuple[GraphColumns, RouteQueries]:
        """Return the present graph and its routes; both stay the same when this graph changes."""
        from gamms.graph.graph import Graph

        graph = Graph(self._store.fork())
        return graph.columns(), graph.routes

    def get_edges_as_given(self, ids: Iterable[int]) -> ClosedEdges:
        """Return edges in the form of `add_edge`, by id."""
        store = self._store.fork()
        chosen = [*ids]
        store.close_edges(chosen)
        return {id: store.closed[id] for id in chosen}

    def extend_graph(self, edges: ClosedEdges) -> tuple[GraphColumns, RouteQueries]:
        """Return the graph with more edges, after all other edges, and its routes; edges with known ids are ignored."""
        from gamms.graph.graph import Graph

        graph = Graph(self._store.fork())
        for id in [id for id in edges if self._store.edges.index.find_row(id) < 0]:
            graph.add_edge(dict(edges[id]))
        return graph.columns(), graph.routes

    def get_place_stream(self) -> "Generator":
        """Return the random stream of `ctx.graph.place`."""
        stream = self._ctx.stream("graph", "place")  # each time, as a use of the seed
        self._place_stream = self._place_stream or stream
        return self._place_stream

    @property
    def has_placed(self) -> bool:
        """Whether `ctx.graph.place` has drawn random numbers since its stream began."""
        return self._place_stream is not None

    def restart_stream(self) -> None:
        """Restart the random stream of `ctx.graph.place`."""
        if self._place_stream is not None:
            self._place_stream = None


@packed_graphs.register("gamms")
class PackedGraph(IPackedGraph):
    """A graph and its obstacles as bytes from `MapStorage.pack`; unpacked on first use.

    Every method raises BadFile (ValueError) if the bytes are damaged.

    Args:
        packed: the bytes.
    """

    def __init__(self, packed: bytes) -> None:
        if not isinstance(packed, bytes):
            raise BadFile(f"A packed graph is bytes, not {type(packed).__name__}")
        self.packed = packed

    def __repr__(self) -> str:
        columns = self.columns()
        return f"{type(self).__name__}({len(columns.node_ids)} nodes, {len(columns.edge_ids)} edges)"

    def columns(self) -> GraphColumns:
        """Return the graph as read-only arrays."""
        return self._columns

    @cached_property
    def _columns(self) -> GraphColumns:
        return lock_columns(self._contents.columns)

    def obstacle_columns(self) -> ObstacleColumns:
        """Return the obstacles as read-only arrays."""
        obstacles = Obstacles()
        obstacles.replace(self._contents.faces)
        return obstacles.columns()

    def to_networkx(self) -> "nx.MultiDiGraph[int] | nx.DiGraph[int]":
        """Return the graph as a networkx graph: a DiGraph, or a MultiDiGraph if there are parallel edges."""
        from gamms.graph.networkx_bridge import export

        return export(self._contents.columns, self._contents.attribution)

    @property
    def crs(self) -> str | None:
        """The coordinate reference system of x and y, for example 'EPSG:32635'."""
        return self._contents.columns.crs

    @property
    def attribution(self) -> str | None:
        """The authors of the data."""
        return self._contents.attribution

    @cached_property
    def _contents(self) -> "SavedMap":
        from gamms.graph import map_file

        return map_file.decode(self.packed)
