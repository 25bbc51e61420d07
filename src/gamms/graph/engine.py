"""The graph room's front: the graph, its obstacles, and how they are kept."""

import os
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

from gamms.deciding import Guarded, phase_of, refused_while_deciding
from gamms.errors import BadFile, BadType, BadValue, ContextTerminated, UnknownType, WriteConflict
from gamms.graph.cache import Cache
from gamms.graph.contents import Contents
from gamms.graph.graph import Graph
from gamms.graph.obstacles import Obstacles, checked_face, checked_faces
from gamms.graph.packed import PackedGraph
from gamms.ir.graph import FloatArray, GraphColumns
from gamms.ir.obstacles import BoolArray, ObstacleColumns
from gamms.text import shown
from gamms.typing import IContext
from gamms.typing.graph_engine import Corner, Engine, IGraphEngine, NodeIds, Numbers, ObsFace
from gamms.typing.memory_engine import StoreType
from gamms.typing.obstacles import line_ends

if TYPE_CHECKING:
    import networkx as nx
    from numpy.random import Generator

    from gamms.graph.database import GraphDatabase
    from gamms.graph.visibility import Visibility
    from gamms.graph.visibility_tables import TablePath, VisibilityTables
    from gamms.typing.memory_engine import IPathLike


_SIGHT_BYTES = 256 << 20


class WorldSnapshot(NamedTuple):
    """Graph and obstacles at one moment."""

    columns: GraphColumns
    obstacles: ObstacleColumns
    attribution: str | None
    revision: int
    obstacle_revision: int
    sights: Cache
    place_stream: Any  # the state of the stream that `place` draws from; None: nothing was drawn


class GraphEngine(Guarded, IGraphEngine):
    """Owns the graph; with `Engine.SQLITE`, also keeps it in a database file.

    Args:
        ctx: the context.
        engine: MEMORY writes nothing unless asked; SQLITE answers every call alike and keeps a database file.
        path: of the database; an existing one is opened. None: one in memory.

    Raises:
        UnknownType (ValueError): `engine` is no member of `Engine`.
        BadFile (ValueError): there is something else at `path`.
    """

    _called = "ctx.graph"

    def __init__(self, ctx: IContext, engine: Engine = Engine.MEMORY, path: "IPathLike | None" = None) -> None:
        if not isinstance(engine, Engine):
            raise UnknownType(f"Unknown graph engine {shown(engine)}. Use Engine.MEMORY or Engine.SQLITE.")
        self._ctx = ctx
        self._phase = phase_of(ctx)
        self._graph: Graph | None = Graph()
        self._graph._phase = self._phase
        self._obstacles = Obstacles()
        self._tables: VisibilityTables | None = None
        self._sights = Cache(_SIGHT_BYTES)
        self._place_stream: Generator | None = None
        self._restored: dict[int, int] = {}  # revision of a snapshot -> the one that is equal, since it was restored
        self._restored_obstacles: dict[int, int] = {}  # likewise
        self._database: GraphDatabase | None = None
        self._saved: tuple[object, ...] | None = None  # the `_state` that a file has
        if engine is Engine.SQLITE:
            self._open_database(path)

    @property
    def graph(self) -> Graph:
        """The graph."""
        if self._graph is None:
            raise ContextTerminated("ctx.graph")
        return self._graph

    @property
    def sights(self) -> Cache:
        """The rows of visibility tables by what they were made of; engines may share them. Not for strategies."""
        self._phase.refuse("use ctx.graph.sights")
        return self._sights

    @sights.setter
    def sights(self, sights: Cache) -> None:
        self._sights = sights

    # -- obstacles ----------------------------------------------------------------------------------------------

    @refused_while_deciding
    def add_obstacle_face(self, face_id: int, tr: Corner, tl: Corner, br: Corner, bl: Corner, type: int) -> None:
        """Add a quadrangle."""
        self._present().add(checked_face(face_id, tr, tl, br, bl, type))

    @refused_while_deciding
    def add_obstacles(self, faces: Any, ids: Any = None, types: Any = 0) -> list[int]:
        """Add many quadrangles at once, all or none; returns their ids.

        Args:
            faces: an array (faces, 4, 3), the corners tr, tl, br, bl of each; or dicts with `face_id`, `tr`, `tl`,
                `br`, `bl` and `type`, as `gamms.osm.obstacle_from_file` gives them.
            ids: one for each face of an array; None: those after the greatest.
            types: of the faces of an array, one for all or one for each.

        Raises:
            DuplicateId (KeyError): an id is taken, or given twice.
            BadType (TypeError), BadValue (ValueError): a number or a shape is impossible; nothing has changed.
        """
        obstacles = self._present()
        new = checked_faces(faces, ids, types, obstacles)
        obstacles.add_many(new)
        added: list[int] = new.ids.tolist()
        return added

    @refused_while_deciding
    def remove_obstacle_face(self, face_id: int) -> None:
        """Remove a quadrangle."""
        self._present().remove(face_id)

    def get_obstacle_face(self, face_id: int) -> ObsFace:
        """A quadrangle by id."""
        return self._present().get(face_id)

    def get_obstacle_faces(self, d: float = -1.0, x: float = 0.0, y: float = 0.0) -> Iterator[int]:
        """Ids of the faces whose bounding box meets the square of half side d around (x, y); all for `d < 0`."""
        return self._present().near(d, x, y)

    def obstacle_columns(self) -> ObstacleColumns:
        """All quadrangles as read-only arrays that stay as they are now."""
        return self._present().columns()

    @property
    def obstacle_revision(self) -> int:
        """A number that changes with every change of the obstacles."""
        return self._present().revision

    def visible(self, origin: Any, targets: Any) -> BoolArray:
        """Whether no face blocks the straight line from origin (3,) to each of the targets (targets, 3)."""
        return self._present().visible(*line_ends(origin, targets))

    def visibility(
        self,
        radius: float,
        observer_height: float = 1.6,
        *,
        path: "TablePath" = None,
        progress: bool = False,
        workers: int | None = None,
    ) -> "Visibility":
        """Which nodes within `radius` of each node no wall hides; see `IGraphEngine`."""
        if self._tables is None:
            from gamms.graph.visibility_tables import VisibilityTables

            self._tables = VisibilityTables(self.graph, self._present(), self._ctx, self._sights)
        return self._tables.get(radius, observer_height, path, progress=progress, workers=workers)

    def visibility_table(self, observer_height: float, radius: float) -> "Visibility | None":
        """A table that `visibility` made, holds, is of that height and reaches so far; None where there is none."""
        return None if self._tables is None else self._tables.find(observer_height, radius)

    # -- in and out ---------------------------------------------------------------------------------------------

    @refused_while_deciding
    def attach_networkx_graph(self, G: "nx.Graph[Any] | PackedGraph") -> Graph:  # noqa: N803 - published name
        """Add any networkx graph, or the map of a recording, to what is there, all or nothing.

        Integer labels become ids; other labels get the next free integers (`networkx_labels` tells which). An
        undirected graph gives both directions. Missing edge ids are assigned, missing lengths come from
        `linestring` or `geometry`, all other attributes are kept. A map of a recording keeps its ids and its order.

        Raises:
            BadValue (ValueError): it cannot be attached; its cause says why, and nothing has changed.
        """
        graph = self.graph.attach_networkx_graph(G)
        if (
            not isinstance(G, PackedGraph)
            and len(G) > 1
            and not any("x" in data or "y" in data for _, data in G.nodes(data=True))
        ):
            self._ctx.logger.warning(
                f"None of the {len(G)} nodes has an x or y: all are at (0, 0), where edges have no length. "
                "Set G.nodes[n]['x'] and G.nodes[n]['y'] before attaching."
            )
        return graph

    def networkx_labels(self) -> dict[Any, int]:
        """Label in networkx -> id here, for every node whose label was no integer."""
        from gamms.graph.networkx import labels

        return labels(self.graph)

    @refused_while_deciding
    def save(self, path: str | os.PathLike[str] | None = None) -> None:
        """Write graph, obstacles, CRS and attributes into one file.

        Args:
            path: of the file; None writes into the database file of `Engine.SQLITE`, which is written anyway.

        Raises:
            BadValue: no path and no database, or an attribute that is no plain data.
            WriteConflict (RuntimeError): another program has saved to the database since this context read it. The
                file at `path` is written then.
            OSError: the file cannot be written.
        """
        contents, saved = self._contents(), self._state()
        if path is not None:
            from gamms.graph import file

            file.save(path, contents)
            self._saved = saved
        elif self._database is None:
            raise BadValue("A graph in memory needs a path to be saved to: ctx.graph.save('map.gamms').")
        if self._database is not None:
            self._database.write(contents)
            self._saved = saved

    @refused_while_deciding
    def load(self, path: str | os.PathLike[str] | None = None) -> Graph:
        """Replace graph and obstacles by those in a file that `save` wrote.

        Args:
            path: of the file; None reads the database file of `Engine.SQLITE`.

        Raises:
            BadFile (ValueError): the file is damaged or foreign; nothing has changed.
            BadValue: no path and no database.
            OSError: it cannot be read.
        """
        from gamms.graph import file

        graph = self.graph
        if path is not None:
            self._put(file.load(path))
        elif self._database is not None:
            self._put(self._database.read())
            self._saved = self._state()
        else:
            raise BadValue("A graph in memory needs a path to be loaded from: ctx.graph.load('map.gamms').")
        return graph

    def packed(self) -> bytes:
        """Graph, obstacles, CRS and attributes as the bytes that `save` writes.

        Raises:
            BadValue: an attribute is no plain data.
        """
        from gamms.graph import file

        return file.encode(self._contents())

    def packed_part(self) -> tuple[bytes, dict[tuple[str, str], list[int]]]:
        """What `packed` gives, without the attributes that are no plain data.

        Returns:
            The bytes; and whose attributes were left out: ("node" or "edge", name of the attribute) -> ids.
        """
        try:
            return self.packed(), {}
        except BadValue:
            from gamms.graph import file
            from gamms.graph.contents import savable

            contents, left_out = savable(self._contents())
            return file.encode(contents), left_out

    @refused_while_deciding
    def unpack(self, data: bytes) -> None:
        """Replace graph and obstacles by what `packed` gave.

        Raises:
            BadFile (ValueError): the bytes are damaged or foreign; nothing has changed.
            BadType (TypeError): they are no bytes.
        """
        from gamms.graph import file

        if not isinstance(data, (bytes, bytearray, memoryview)):
            raise BadType(f"A packed graph is bytes, not {shown(data)}.")
        self._put(file.decode(data))

    @refused_while_deciding
    def snapshot(self) -> "WorldSnapshot":
        """Graph and obstacles as they are now, for `restore`."""
        attribution = self.graph.attribution
        return WorldSnapshot(
            self.columns(),
            self.obstacle_columns(),
            attribution,
            self.graph.revision,
            self.obstacle_revision,
            self._sights,
            None if self._place_stream is None else self._place_stream.bit_generator.state,
        )

    @refused_while_deciding
    def restore(self, before: "WorldSnapshot") -> None:
        """Let graph and obstacles be as they were; what has not changed is left alone, its indexes too."""
        if self.graph.revision not in (before.revision, self._restored.get(before.revision)):
            self.graph.replace(before.columns)
            self.graph.attribution = before.attribution
            self._restored = {before.revision: self.graph.revision}
        if self.obstacle_revision not in (
            before.obstacle_revision,
            self._restored_obstacles.get(before.obstacle_revision),
        ):
            self._obstacles.replace(())
            self._obstacles.add_many(before.obstacles)
            self._restored_obstacles = {before.obstacle_revision: self.obstacle_revision}
        self._place_stream = None
        if before.place_stream is not None:
            self._place_stream = self._ctx.stream("graph", "place")
            self._place_stream.bit_generator.state = before.place_stream

    @refused_while_deciding
    def terminate(self) -> None:
        """Write what a database has to hold, and let go of the graph."""
        if self._graph is None:
            return
        try:
            if self._database is not None and self._is_kept:
                self._write_finally(self._database)
        finally:
            self._graph.close()
            self._graph = self._tables = None

    # -- the graph's own verbs, for short -----------------------------------------------------------------------

    def columns(self) -> GraphColumns:
        """The graph as read-only arrays that stay as they are now."""
        return self.graph.columns()

    @refused_while_deciding
    def add_nodes(self, ids: Any, x: Any, y: Any) -> None:
        """Add many nodes at once; see `Graph.add_nodes`."""
        self.graph.add_nodes(ids, x, y)

    @refused_while_deciding
    def add_edges(self, ids: Any, sources: Any, targets: Any, lengths: Any = None) -> None:
        """Add many straight edges at once; see `Graph.add_edges`."""
        self.graph.add_edges(ids, sources, targets, lengths)

    def node_attributes(self, node_id: int) -> dict[str, Any]:
        """The attributes of a node that are not `id`, `x` or `y`; a fresh dict (KeyError)."""
        return self.graph.node_attributes(node_id)

    def edge_attributes(self, edge_id: int) -> dict[str, Any]:
        """The attributes of an edge beyond ends, length and linestring; a fresh dict (KeyError)."""
        return self.graph.edge_attributes(edge_id)

    def weights(self, weight: str | None = "length") -> FloatArray:
        """What each edge costs, (edges,) in insertion order; see `IGraph`."""
        return self.graph.weights(weight)

    def shortest_path(self, source: int, target: int, weight: str | None = "length") -> list[int]:
        """Ids of the nodes on the shortest way from one node to another, both included; see `IGraph`."""
        return self.graph.shortest_path(source, target, weight)

    def distance(self, source: int, target: int, weight: str | None = "length") -> float:
        """How far it is from one node to another; infinite where there is no way."""
        graph = self._graph  # NOTE: not by the property, which takes as long as the rest (benchmarks/README.md, Paths)
        return (self.graph if graph is None else graph).distance(source, target, weight)

    def distances(
        self,
        source: NodeIds | None = None,
        target: NodeIds | None = None,
        weight: str | None = "length",
        cutoff: float | None = None,
    ) -> dict[int, float]:
        """How far it is from a node to every other, or from every other to a node; see `IGraph`."""
        return self.graph.distances(source, target, weight, cutoff)

    def distance_matrix(self, sources: NodeIds, targets: NodeIds, weight: str | None = "length") -> FloatArray:
        """How far it is from each of some nodes to each of others, (sources, targets); see `IGraph`."""
        return self.graph.distance_matrix(sources, targets, weight)

    def to_latlon(self, x: Numbers, y: Numbers) -> tuple[Any, Any]:
        """Degrees of latitude and longitude of (x, y); see `IGraph`."""
        return self.graph.to_latlon(x, y)

    def from_latlon(self, *, lat: Numbers, lon: Numbers) -> tuple[Any, Any]:
        """(x, y) of degrees of latitude and longitude; see `IGraph`."""
        return self.graph.from_latlon(lat=lat, lon=lon)

    def nearest_node(
        self,
        x: Numbers | None = None,
        y: Numbers | None = None,
        *,
        lat: Numbers | None = None,
        lon: Numbers | None = None,
    ) -> Any:
        """The id of the node nearest to a place, or the ids (places,) of those nearest to several; see `IGraph`."""
        return self.graph.nearest_node(x, y, lat=lat, lon=lon)

    def place(
        self,
        n: int,
        near: int | tuple[float, float] | None = None,
        radius: float | None = None,
        apart: float = 0.0,
        rng: "Generator | int | None" = None,
    ) -> list[int]:
        """Ids of `n` different nodes, drawn at random; see `IGraph`.

        Without `rng` they come from a stream of their own, which follows from the seed of the context.
        """
        if rng is None:
            self._phase.refuse("call ctx.graph.place without rng=state['rng']")
            rng = self._place_stream = self._place_stream or self._ctx.stream("graph", "place")
        return self.graph.place(n, near, radius, apart, rng)

    @refused_while_deciding
    def restart_stream(self) -> None:
        """Restart the random stream that `place` draws from."""
        self._place_stream = None

    def to_networkx(self) -> "nx.MultiDiGraph[int] | nx.DiGraph[int]":
        """The graph as a networkx graph: a DiGraph, or a MultiDiGraph where edges are parallel."""
        return self.graph.to_networkx()

    @property
    def crs(self) -> str | None:
        """The coordinate reference system of x and y, such as 'EPSG:32635'."""
        return self.graph.crs

    @property
    def attribution(self) -> str | None:
        """Whom the data is by; shown where the graph is shown."""
        return self.graph.attribution

    # -- inside -------------------------------------------------------------------------------------------------

    def _present(self) -> Obstacles:
        if self._graph is None:
            raise ContextTerminated("ctx.graph")
        return self._obstacles

    def _open_database(self, path: "IPathLike | None") -> None:
        from gamms.graph import database

        self._is_kept = path is not None
        path = path or database.NoFile()
        store = self._ctx.ictx.memory.create_store(StoreType.DATABASE, database.STORE, path)
        self._database = database.GraphDatabase(store)
        self._put(self._database.read())
        self._saved = self._state()

    def _write_finally(self, database: "GraphDatabase") -> None:
        """Write what can be written, beside the database if need be: what is not written now is lost."""
        if self._state() == self._saved:
            return
        contents = self._contents()
        try:
            try:
                database.write(contents)
            except BadValue as error:
                from gamms.graph.contents import savable

                self._ctx.logger.error(f"{error} It is left out of the database.")  # noqa: TRY400 - ILogger has no exception()
                contents = savable(contents)[0]
                database.write(contents)
        except (WriteConflict, BadFile) as error:
            from gamms.graph import file

            error.add_note(f"What this context held is in {file.save_beside(database.path, contents)}.")
            raise

    def _state(self) -> tuple[object, ...]:
        """What differs after every change of graph or obstacles."""
        return self.graph.revision, self.obstacle_revision, self.graph.attribution

    def _contents(self) -> Contents:
        return Contents(self.graph.columns(), list(self._obstacles), self.graph.attribution)

    def _put(self, contents: Contents) -> None:
        self.graph.replace(contents.columns)
        self.graph.attribution = contents.attribution
        self._obstacles.replace(contents.faces)
