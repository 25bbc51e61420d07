"""The graph engine, `ctx.graph`: the graph, its obstacles, files and databases, and visibility tables."""

import os
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import wraps
from typing import TYPE_CHECKING, Any, Concatenate, ParamSpec, TypeVar

from gamms.arguments import as_ids, as_known, as_positive, explain_call_errors, refuse_call
from gamms.compat import Surface
from gamms.deciding import ContextPart, get_phase, refuse_to_judges, refuse_while_deciding
from gamms.errors import BadFile, BadValue, ContextTerminated, DuplicateId, UnknownType, WriteConflict
from gamms.graph.finding import (
    NamedFeature,
    PolygonContents,
    StreetNames,
    compute_bounds,
    find,
    find_inside,
    make_region,
)
from gamms.graph.graph import Graph
from gamms.graph.obstacles import Obstacles, check_corners, check_faces
from gamms.graph.routes import CachedRoutes
from gamms.graph.storage import MapStorage
from gamms.graph.store import GraphStore
from gamms.ir.graph import list_labels
from gamms.ir.obstacles import BoolArray, ObstacleColumns
from gamms.ir.projection import scale_fault
from gamms.ir.scenery import Scenery
from gamms.text import shown
from gamms.typing import IContext
from gamms.typing.graph_engine import Corner, Engine, IGraphEngine, ObsFace, RouteQueries
from gamms.typing.map_storage import IGraphSource
from gamms.typing.memory_engine import StoreType
from gamms.typing.obstacles import Faces, check_line_ends

if TYPE_CHECKING:
    from pathlib import Path

    import networkx as nx
    from numpy.random import Generator
    from numpy.typing import ArrayLike

    from gamms.graph.export import Frames
    from gamms.graph.isochrones import Isochrones, Source
    from gamms.graph.map_file import MapDatabase, SavedMap
    from gamms.graph.tracks import TrackMatch
    from gamms.graph.visibility import TablePath, Visibility, VisibilityTables
    from gamms.typing.memory_engine import IPathLike

P = ParamSpec("P")
R = TypeVar("R")

_DIGITS = 20  # of a label that may be a 64-bit number


def _forward_to_graph(verb: Callable[Concatenate[Graph, P], R]) -> "Callable[Concatenate[GraphEngine, P], R]":
    """Return a method that calls a method of the graph of an engine."""

    @wraps(verb)
    def forwarded(self: "GraphEngine", /, *args: P.args, **kwargs: P.kwargs) -> R:
        try:
            return verb(self.graph, *args, **kwargs)
        except TypeError as error:
            refuse_call(error, verb, f"ctx.graph.{verb.__name__}", (self, *args), kwargs)
            raise

    return forwarded


class GraphEngine(Surface, ContextPart, IGraphEngine):
    """Owns the graph; with `Engine.SQLITE`, also keeps it in a database file.

    Args:
        ctx: the context.
        engine: MEMORY writes no files unless asked; SQLITE gives the same answers and also keeps a database file.
        path: path of the database; an existing database is opened. None: an in-memory database.

    Raises:
        UnknownType (ValueError): `engine` is not a member of `Engine`.
        BadFile (ValueError): the file at `path` is not a GAMMS database.
    """

    _called = "ctx.graph"

    def __init__(self, ctx: IContext, engine: Engine = Engine.MEMORY, path: "IPathLike | None" = None) -> None:
        if not isinstance(engine, Engine):
            raise UnknownType(f"Unknown graph engine {shown(engine)}. Use Engine.MEMORY or Engine.SQLITE.")
        store = GraphStore()
        self._begin(ctx, store, Obstacles(), Graph(store, get_phase(ctx)))
        if engine is Engine.SQLITE:
            self._open_database(path)

    def _begin(self, ctx: IContext, store: GraphStore, obstacles: Obstacles, graph: Graph) -> None:
        """Set all attributes, for a map in memory."""
        self._ctx = ctx
        self._phase = get_phase(ctx)
        self._store = store
        self._obstacles = obstacles
        self._graph: Graph | None = graph
        self._storage = MapStorage(ctx, store, obstacles, self._phase)
        self._tables: VisibilityTables | None = None
        self._database: MapDatabase | None = None
        self._saved: tuple[object, ...] | None = None  # the `_make_state_key` that was last written to the file
        self._streets: tuple[int, StreetNames] | None = None  # (revision of the graph, its street names)

    @property
    def graph(self) -> Graph:
        """The graph without the engine, as in 1.0.0; the engine has all its methods."""
        if self._graph is None:
            raise ContextTerminated("ctx.graph")
        return self._graph

    def __repr__(self) -> str:
        return "GraphEngine(terminated)" if self._graph is None else f"GraphEngine({self._graph!r})"

    @property
    def storage(self) -> MapStorage:
        """The map as bytes and as snapshots, for engines and clients; not for strategies."""
        self._phase.refuse_look("use ctx.graph.storage")
        return self._storage

    # -- obstacles ----------------------------------------------------------------------------------------------

    @refuse_to_judges
    def add_obstacle_face(self, face_id: int, tr: Corner, tl: Corner, br: Corner, bl: Corner, type: int) -> None:
        """Add a quadrangle."""
        self._get_obstacles().add_corners(*check_corners(face_id, tr, tl, br, bl, type))

    @refuse_to_judges
    def add_obstacles(self, faces: Faces, ids: "ArrayLike | None" = None, types: "ArrayLike" = 0) -> list[int]:
        """Add many quadrangles at once and return their ids; on an error nothing is added.

        Args:
            faces: an array (faces, 4, 3), the corners tr, tl, br, bl of each; or dicts with `face_id`, `tr`, `tl`,
                `br`, `bl` and `type`, as `gamms.osm.obstacle_from_file` gives them.
            ids: one id for each face of an array; None: the ids after the greatest existing id.
            types: the types of the faces of an array, one for all faces or one for each.

        Raises:
            DuplicateId (KeyError): an id is taken, or given twice.
                BadType (TypeError), BadValue (ValueError): a number or a shape is invalid; nothing has changed.
        """
        obstacles = self._get_obstacles()
        new = check_faces(faces, ids, types, obstacles)
        obstacles.add_many(new)
        added: list[int] = new.ids.tolist()
        return added

    @refuse_to_judges
    def remove_obstacle_face(self, face_id: int) -> None:
        """Remove a quadrangle."""
        self._get_obstacles().remove(face_id)

    def get_obstacle_face(self, face_id: int) -> ObsFace:
        """Return a quadrangle by id."""
        return self._get_obstacles().get(face_id)

    def get_obstacle_faces(self, d: float = -1.0, x: float = 0.0, y: float = 0.0) -> Iterator[int]:
        """Return ids of the faces whose bounding box meets the square of half side d around (x, y); all for `d < 0`."""
        return self._get_obstacles().find_near(d, x, y)

    def obstacle_columns(self) -> ObstacleColumns:
        """Return all quadrangles as read-only arrays that never change."""
        return self._get_obstacles().columns()

    @property
    def obstacle_revision(self) -> int:
        """A number that changes with every change of the obstacles."""
        return self._get_obstacles().revision

    def visible(self, origin: "ArrayLike", targets: "ArrayLike") -> BoolArray:
        """Return whether no face blocks the straight line from origin (3,) to each of the targets (targets, 3)."""
        return self._get_obstacles().find_visible(*check_line_ends(origin, targets))

    def visibility(
        self,
        radius: float,
        observer_height: float = 1.6,
        *,
        path: "TablePath" = None,
        progress: bool = False,
        workers: int | None = None,
    ) -> "Visibility":
        """Return a table of the nodes that each node sees within `radius`; see `IGraphEngine`."""
        if self._tables is None:
            from gamms.graph.visibility import VisibilityTables

            obstacles = self._get_obstacles()
            routes = CachedRoutes(self._store, Graph)
            self._tables = VisibilityTables(self._store, routes, obstacles, self._ctx, self._storage)
        return self._tables.get(radius, observer_height, path, progress=progress, workers=workers)

    def visibility_table(self, radius: float, observer_height: float = 1.6) -> "Visibility | None":
        """Return an up-to-date table of this height and at least this radius, or None."""
        return None if self._tables is None else self._tables.find(radius, observer_height)

    # -- parts of the map ---------------------------------------------------------------------------------------

    def find(self, text: str) -> NamedFeature:
        """Return a street by name, or the junction of several streets: `find("Mannerheimintie & Kaivokatu").node`.

        The search ignores case and accents. Streets that share no node meet where they come within 30 map units.

        Returns:
            The `nodes` and `edges` of the match, by id, its `name`, and its `node`: the node nearest to its center.

        Raises:
            UnknownName (KeyError): no street has this name; the message lists similar names.
            BadValue (ValueError): the streets do not meet, or no edge has a name. `node` also raises it if the streets
                meet at several junctions.
        """
        columns = self.graph.columns()
        if self._streets is None or self._streets[0] != columns.revision:
            self._streets = columns.revision, StreetNames(columns.edge_attributes.get("name", {}))
        return find(columns, self._streets[1], text)

    def inside(self, polygon: object, *, touching: bool = False) -> PolygonContents:
        """Return the nodes and edges in a polygon, its border included.

        Args:
            polygon: the outline as (x, y) pairs in map units; a GeoJSON dict, in degrees; or a shapely polygon, in map
                units. GeoJSON and shapely polygons may have holes and several parts.
            touching: whether edges that are only partly inside the polygon are included.

        Raises:
            BadValue (ValueError): not a polygon, or GeoJSON on a map without a CRS.
        """
        return find_inside(self.graph.columns(), make_region(polygon, self.crs), touching=touching)

    def isochrone(
        self,
        source: "Source",
        limits: float | Iterable[float],
        *,
        weight: str | None = "length",
        width: float = 25.0,
        mode: "str | Mapping[str, str] | None" = None,
    ) -> "Isochrones":
        """Return what can be reached from a place within limits, as parts of edges and as polygons.

        Dijkstra's algorithm finds the cost of the way to each node. On each edge the limit ends at an exact point: a
        cost is spent evenly along the edge. The polygon of a limit has all places within `width` of the reached edges
        (the line-based network buffer of Oliver, Schuurman and Hall, 2007).

        Args:
            source: a node id; or a place on an edge, `{"edge": id, "share": 0.25}`, the share of its length behind the
                place, 0 by default. Where the opposite edge exists, the way back is open, too.
            limits: one limit, or several, in the unit of the weight: metres for "length", seconds for "travel_time".
            weight: see `IGraph`.
            width: map units.
            mode: the mode of travel whose edges and times count, see `routes.select_mode`; None: all edges.

        Returns:
            A sequence of one `Isochrone` for each limit, with `polygon`, `parts`, `lines` and `ends`; `export(path)`
            writes it as GeoJSON, and `draw` is a drawer for `ctx.visual.add_artist`.

        Raises:
            UnknownName (KeyError): the node, the edge, the weight or the mode does not exist.
            BadValue (ValueError): a limit is negative or infinite, the share exceeds 1, the width is not positive; or
                the mode may not use the edge.
        """
        from gamms.graph.isochrones import find_isochrones, refuse_closed_edge

        if mode is not None:
            refuse_closed_edge(self.graph, self._select_mode(mode), source, mode)
        return find_isochrones(self._select_mode(mode), source, limits, weight, width, self.attribution)

    def _select_mode(self, mode: "str | Mapping[str, str] | None") -> Graph:
        """Return the graph of a mode; None: the whole graph."""
        found: Graph = self.graph if mode is None else self.routes.select_mode(mode)
        return found

    def match_track(self, source: object, *, noise_m: float = 5.0, within_m: float = 50.0) -> "TrackMatch":
        """Match measured points to the roads as a whole, and return the likeliest route.

        Points that are nearer than two standard deviations to the last one that counts are skipped. Each track, route
        and segment of a file is matched by itself.

        Args:
            source: path of a GPX or CSV file, with or without times; or points (x, y) or (x, y, t), map units.
            noise_m: the standard deviation of the errors of positions.
            within_m: points that are farther from every road do not count.

        Returns:
            The `paths` as node ids, the `edges` and `places` of the points, the `outliers` and `gaps`, and the
            `length` of the route.

        Raises:
            FileNotFoundError: the file does not exist.
            BadFile (ValueError): the file is not GPX or CSV, damaged, or too large.
            BadType (TypeError): `source` is neither a path nor points.
            BadValue (ValueError): the graph has no edges or no CRS, a point lies outside its projection, or a number is
                not positive.
        """
        from gamms.graph.tracks import match_track

        noise = as_positive(noise_m, "noise_m")
        return match_track(source, self.graph, self.routes, self.columns(), noise, as_positive(within_m, "within_m"))

    def track(self, path: str | os.PathLike[str], within: float = 50.0) -> "TrackMatch":
        """Call `match_track`; deprecated."""
        warnings.warn(
            "ctx.graph.track(path, within) is deprecated: use ctx.graph.match_track(path, within_m=within).",
            DeprecationWarning,
            stacklevel=2,
        )
        return self.match_track(path, within_m=within)

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """The bounding box (xmin, ymin, xmax, ymax) of all nodes and polylines (BadValue: the map has no nodes)."""
        return compute_bounds(self.graph.columns())

    @refuse_to_judges
    def close_roads(
        self, edges: Iterable[int] | None = None, *, name: str | None = None, inside: object = None
    ) -> list[int]:
        """Close edges until `open_roads`: agents cannot use them, and paths avoid them.

        A closed edge is removed from the graph and stored separately, also in saved maps, snapshots and recordings. If
        several arguments are given, only edges that match all of them are closed.

        Args:
            edges: ids of edges.
            name: name of a street, or "A & B" for the edges at a junction; see `find`.
            inside: a polygon; edges that are completely or partly inside it are closed.

        Returns:
            The ids of the edges that were closed, in insertion order.

        Raises:
            UnknownName (KeyError): an edge or a street does not exist; nothing has changed.
            BadValue (ValueError): no argument is given, or `inside` is not a polygon.
        """
        chosen = []
        if edges is not None:
            chosen.append([self.graph.get_edge(id).id for id in as_ids(edges, "edges")])
        if name is not None:
            chosen.append(self.find(name).edges)
        if inside is not None:
            chosen.append(self.inside(inside, touching=True).edges)
        if not chosen:
            raise BadValue(
                "Say what to close: close_roads(edges), close_roads(name='…') or close_roads(inside=polygon)."
            )
        both = set(chosen[0]).intersection(*chosen[1:])
        ids = sorted(both, key=self._store.edges.index.find_row)
        if ids:
            self._store.close_edges(ids)
        return ids

    @refuse_to_judges
    def open_roads(self, edges: Iterable[int] | None = None, *, name: str | None = None) -> list[int]:
        """Reopen closed edges by id, by street name, or all of them; return the ids of the reopened edges.

        Reopened edges come after all other edges in insertion order.

        Raises:
            UnknownName (KeyError): no such edge or street is closed; nothing has changed.
            DuplicateId (KeyError): the id of a closed edge has been reused; nothing has changed.
        """
        graph = self.graph
        closed = self._store.closed
        ids = list(closed) if edges is None else as_ids(edges, "edges")
        if name is not None:
            of_street = set(StreetNames({id: edge.get("name") for id, edge in closed.items()}).find_rows(name).tolist())
            ids = [id for id in ids if id in of_street]
        for id in ids:
            as_known(id, "closed edge", closed)
            if self._store.edges.index.find_row(id) >= 0:
                raise DuplicateId("an edge", id)
            graph.positions([closed[id]["source"], closed[id]["target"]])
        for id in dict.fromkeys(ids):
            graph.add_edge(dict(closed[id]))
            self._store.note_roads((id,))
        self._store.closed = {id: edge for id, edge in closed.items() if id not in ids}
        return list(dict.fromkeys(ids))

    @property
    def closed_roads(self) -> list[int]:
        """The ids of the closed edges, in the order in which they were closed."""
        return [] if self._graph is None else list(self._store.closed)

    # -- in and out ---------------------------------------------------------------------------------------------

    @refuse_to_judges
    def attach_networkx_graph(self, G: "nx.Graph[Any] | IGraphSource") -> Graph:  # noqa: N803 - published name
        """Add a networkx graph, or the map of a recording, to the current graph; on an error nothing is added.

        Integer labels become ids; other labels get the next free integers (`networkx_labels` returns the mapping). An
        undirected graph gives both directions. Missing edge ids are assigned, missing lengths are computed from
        `linestring` or `geometry`, and all other attributes are kept. The map of a recording keeps its ids and its
        order.

        Raises:
            BadValue (ValueError): the graph cannot be attached, for example because lengths in its CRS are not metres
                (Web Mercator, or feet); `__cause__` has the reason, and nothing has changed.
        """
        graph = self.graph.attach_networkx_graph(G)
        if isinstance(G, IGraphSource):
            return graph
        if len(G) > 1 and not any("x" in data or "y" in data for _, data in G.nodes(data=True)):
            self._ctx.logger.warning(
                f"None of the {len(G)} nodes has an x or y: all are at (0, 0), where edges have no length. "
                "Set G.nodes[n]['x'] and G.nodes[n]['y'] before attaching."
            )
        numbers = [label for label in G if isinstance(label, str) and label.isdecimal() and len(label) < _DIGITS]
        ids = self.networkx_labels() if numbers else {}
        moved = next((label for label in numbers if ids[label] != int(label)), None)
        if moved is not None:
            self._ctx.logger.warning(
                f"The networkx label {shown(moved)} is a text, and its node has the id {ids[moved]}. To keep the "
                "numbers, attach nx.relabel_nodes(G, int)."
            )
        return graph

    def networkx_labels(self) -> dict[Any, int]:
        """Return a mapping from networkx label to id, for all nodes whose label is not an integer."""
        return list_labels(self.graph.columns())

    @refuse_while_deciding
    def save(self, path: str | os.PathLike[str] | None = None) -> None:
        """Write graph, obstacles, CRS and attributes into one file.

        Args:
            path: path of the file; None: the database file of `Engine.SQLITE`, which is also written automatically.

        Raises:
            BadValue: no path and no database, or an attribute that is not plain data.
            WriteConflict (RuntimeError): another program has saved to the database since this context read it. The file
                at `path` is still written.
            OSError: the file cannot be written.
        """
        contents = self._storage.get_contents()
        saved = self._make_state_key()
        if path is not None:
            from gamms.graph import map_file

            map_file.save(path, contents)
            self._saved = saved
        elif self._database is None:
            raise BadValue("A graph in memory needs a path to be saved to: ctx.graph.save('map.gamms').")
        if self._database is not None:
            self._database.write(contents)
            self._saved = saved

    @refuse_to_judges
    def load(self, path: str | os.PathLike[str] | None = None) -> Graph:
        """Replace the graph and the obstacles by the contents of a file written by `save`.

        Args:
            path: path of the file; None reads the database file of `Engine.SQLITE`.

        Raises:
            BadFile (ValueError): the file is damaged or foreign; nothing has changed.
            BadValue: no path and no database.
            OSError: the file cannot be read.
        """
        from gamms.graph import map_file

        graph = self.graph
        if path is not None:
            self._put(map_file.load(path), str(path))
        elif self._database is not None:
            self._read_database(self._database)
        else:
            raise BadValue("A graph in memory needs a path to be loaded from: ctx.graph.load('map.gamms').")
        return graph

    @refuse_while_deciding
    def export(self, path: str | os.PathLike[str], *, mode: "str | Mapping[str, str] | None" = None) -> "list[Path]":
        """Write nodes and edges for other programs.

        The suffix is the format: `.graphml`, `.geojson`, `.gpkg`, `.csv`, `.osmnx.graphml` for OSMnx, or `.net.xml` for
        SUMO.

        On a map with a CRS geometries are in degrees, and nodes also have `x` and `y`; edges have their polylines.
        `town.csv` gives `town_nodes.csv` and `town_edges.csv`. Attributes other than numbers, texts and bools become
        JSON.

        Args:
            path: the file.
            mode: write the graph of a mode of travel, with its edges, their nodes, its speeds and times; None: the
                whole graph.

        Returns:
            The paths of the files; existing files are replaced.

        Raises:
            UnknownType (ValueError): the suffix names no supported format.
            BadValue (ValueError): GeoJSON or a file for OSMnx of a graph without a CRS.
            UnknownName (KeyError): the mode does not exist.
            MissingExtra (ImportError): the CRS is not a UTM zone, and pyproj is not installed.
            OSError: a file cannot be written.
        """
        from gamms.graph import export

        return export.export(path, self._select_mode(mode).columns(), self.attribution, has_all_nodes=mode is None)

    @property
    def frames(self) -> "Frames":
        """The present nodes and edges as tables, for NumPy, pandas, polars and igraph."""
        from gamms.graph.export import Frames

        return Frames(self.graph.columns())

    @refuse_to_judges
    def terminate(self) -> None:
        """Write pending changes to the database, and release the graph."""
        if self._graph is None:
            return
        try:
            if self._database is not None and self._is_kept:
                self._write_finally(self._database)
        finally:
            self._store.close()
            self._graph = None
            self._tables = None

    # -- methods of the graph -----------------------------------------------------------------------------------

    columns = _forward_to_graph(Graph.columns)
    add_edge = _forward_to_graph(Graph.add_edge)
    add_node = _forward_to_graph(Graph.add_node)
    get_edge = _forward_to_graph(Graph.get_edge)
    get_edges = _forward_to_graph(Graph.get_edges)
    get_neighbors = _forward_to_graph(Graph.get_neighbors)
    get_node = _forward_to_graph(Graph.get_node)
    get_nodes = _forward_to_graph(Graph.get_nodes)
    positions = _forward_to_graph(Graph.positions)
    remove_edge = _forward_to_graph(Graph.remove_edge)
    remove_node = _forward_to_graph(Graph.remove_node)
    update_edge = _forward_to_graph(Graph.update_edge)
    update_node = _forward_to_graph(Graph.update_node)
    add_nodes = _forward_to_graph(Graph.add_nodes)
    add_edges = _forward_to_graph(Graph.add_edges)
    node_attributes = _forward_to_graph(Graph.node_attributes)
    edge_attributes = _forward_to_graph(Graph.edge_attributes)
    shortest_path = _forward_to_graph(Graph.shortest_path)
    distances = _forward_to_graph(Graph.distances)
    distance_matrix = _forward_to_graph(Graph.distance_matrix)
    to_latlon = _forward_to_graph(Graph.to_latlon)
    from_latlon = _forward_to_graph(Graph.from_latlon)
    nearest_node = _forward_to_graph(Graph.nearest_node)
    to_networkx = _forward_to_graph(Graph.to_networkx)

    def distance(
        self, source: int, target: int, weight: str | None = "length", *, turns: str | bool | None = None
    ) -> float:
        """Return the length of the shortest path between two nodes; infinite if there is no path."""
        graph = self._graph  # NOTE: the property would double the time (benchmarks: Paths)
        return (self.graph if graph is None else graph).distance(source, target, weight, turns=turns)

    @explain_call_errors
    def place(
        self,
        n: int,
        near: int | tuple[float, float] | None = None,
        radius: float | None = None,
        apart: float = 0.0,
        rng: "Generator | int | None" = None,
        mode: "str | Mapping[str, str] | None" = None,
    ) -> list[int]:
        """Return the ids of `n` different random nodes; see `IGraph`.

        Without `rng` they are drawn from a separate stream, derived from the seed of the context.
        """
        if rng is None:
            self._phase.refuse("call ctx.graph.place without rng=state['rng']")
            rng = self._storage.get_place_stream()
        return self.graph.place(n, near, radius, apart, rng, mode)

    @property
    def routes(self) -> RouteQueries:
        """Routing queries about several paths or nodes: k shortest paths, isochrones, the nearest of many."""
        return self.graph.routes

    @property
    def crs(self) -> str | None:
        """The coordinate reference system of x and y, for example 'EPSG:32635'."""
        return self.graph.crs

    @property
    def attribution(self) -> str | None:
        """The authors of the data; shown where the graph is shown."""
        return self.graph.attribution

    @property
    def scenery(self) -> Scenery | str | None:
        """The base map around the streets: columns, or the name of installed scenery; settable."""
        return self.graph.scenery

    @scenery.setter
    def scenery(self, scenery: Scenery | str | None) -> None:
        self.graph.scenery = scenery

    def scenery_columns(self) -> Scenery:
        """Return the base map, such as water and parks, that is drawn below the streets and blocks no sight."""
        scenery = self.graph.scenery
        if isinstance(scenery, Scenery):
            return scenery
        from gamms.graph.map_file import load_scenery

        return load_scenery(scenery)

    # -- inside -------------------------------------------------------------------------------------------------

    def _get_obstacles(self) -> Obstacles:
        if self._graph is None:
            raise ContextTerminated("ctx.graph")
        return self._obstacles

    def _open_database(self, path: "IPathLike | None") -> None:
        from gamms.graph.map_file import STORE, InMemoryPath, MapDatabase

        self._is_kept = path is not None
        path = path or InMemoryPath()
        self._database = MapDatabase(self._ctx.ictx.memory.create_store(StoreType.DATABASE, STORE, path))
        self._read_database(self._database)

    def _read_database(self, database: "MapDatabase") -> None:
        self._put(database.read(), database.path)
        self._saved = self._make_state_key()

    def _put(self, contents: "SavedMap", path: str) -> None:
        """Replace the map by the contents of a file; warn if its lengths are not metres, for it has no other copy."""
        self._storage.put(contents)
        if fault := scale_fault(contents.columns.crs, contents.columns.xy):
            self._ctx.logger.warning(f"The map in {path}: {fault}.")

    def _write_finally(self, database: "MapDatabase") -> None:
        """Write the map for the last time, to a second file if the database refuses it: unwritten changes are lost."""
        if self._make_state_key() == self._saved:
            return
        contents = self._storage.get_contents()
        try:
            try:
                database.write(contents)
            except BadValue as error:
                from gamms.graph.map_file import select_savable

                self._ctx.logger.error(f"{error} The attribute is not saved to the database.")  # noqa: TRY400 - ILogger has no exception()
                contents = select_savable(contents)[0]
                database.write(contents)
        except (WriteConflict, BadFile) as error:
            from gamms.graph import map_file

            error.add_note(f"The map of this context was saved to {map_file.save_beside(database.path, contents)}.")
            raise

    def _make_state_key(self) -> tuple[object, ...]:
        """Return a key that changes with every change of the graph or the obstacles."""
        return self.graph.revision, self.obstacle_revision, self.graph.attribution, self.graph.scenery


class SharedMap:
    """The map of a context at a moment, for another context; both share it until one of them changes it.

    Args:
        source: the engine of the context.
    """

    def __init__(self, source: GraphEngine) -> None:
        self._source = source
        self._graph = source.graph
        self.renew()

    def renew(self) -> None:
        """Take the present map again, for one more context."""
        self._store = self._source._store.fork()
        self._obstacles = self._source._obstacles.fork()

    def make_engine(self, ctx: IContext, memo: dict[int, Any]) -> GraphEngine:
        """Return the engine of the other context; call it once after each `renew`.

        Args:
            ctx: that context.
            memo: gets the counterparts of the parts of the source; see `copy.deepcopy`.
        """
        source = self._source
        target = GraphEngine.__new__(GraphEngine)
        target._begin(ctx, self._store, self._obstacles, self._graph._fork(self._store, get_phase(ctx)))
        target._storage.visibility_rows = source._storage.visibility_rows
        memo[id(self._graph)] = target.graph
        for name in ("_store", "_obstacles", "_storage"):
            memo[id(getattr(source, name))] = getattr(target, name)
        memo[id(source)] = target
        memo[id(source._store.neighborhoods)] = target._store.neighborhoods
        return target
