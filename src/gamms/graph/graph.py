"""The mutable graph: every change and every query of nodes and edges goes through here."""

from collections.abc import Iterator, Sequence
from dataclasses import fields
from math import inf, pi
from typing import TYPE_CHECKING, Any

import numpy as np

from gamms import kernels
from gamms.arguments import as_float, as_numbers, as_range
from gamms.deciding import Guarded, refused_while_deciding
from gamms.errors import DuplicateId, MissingKey, UnknownName
from gamms.graph import records
from gamms.graph.bulk import checked_edges, checked_nodes
from gamms.graph.indexes import Indexes, Neighborhoods
from gamms.graph.routes import Routes
from gamms.graph.snapshot import Copied, snapshot
from gamms.graph.tables import Closed, EdgeTable, NodeTable
from gamms.graph.ways import Ways
from gamms.graph.weights import edge_weights
from gamms.ir.graph import FloatArray, GraphColumns, IntArray
from gamms.readonly import ReadOnlyMapping, frozen
from gamms.text import shown
from gamms.typing.graph_engine import Node, NodeColumns, OSMEdge, Surroundings

if TYPE_CHECKING:
    import networkx as nx

    from gamms.graph.packed import PackedGraph


class Graph(Guarded, Copied, Ways):
    """A graph over columns; see `IGraph` for what each call promises."""

    _called = "ctx.graph.graph"

    def __init__(self) -> None:
        self._neighborhoods = Neighborhoods(self)
        self._routes = Routes(self)
        self._changes = [-1]  # how many there were, in a list: setting an attribute asks whether a strategy is running
        self.clear()

    @refused_while_deciding
    def clear(self) -> None:
        """Remove every node and edge."""
        self._nodes = NodeTable()
        self._edges = EdgeTable()
        self._indexes = Indexes(self._nodes, self._edges, self._neighborhoods)
        self._columns: GraphColumns | None = None
        self._shown: GraphColumns | None = None  # read-only all the way down, for strategies
        self._changes[0] += 1
        self._crs: str | None = None
        self._attribution: str | None = None

    @property
    def revision(self) -> int:
        """A number that changes with every change of the graph."""
        return self._changes[0]

    @property
    def crs(self) -> str | None:
        """The coordinate reference system of x and y, such as 'EPSG:32635'; None when unknown."""
        return self._crs

    @crs.setter
    def crs(self, crs: str | None) -> None:
        self._crs = records.as_text(crs, "graph.crs")
        self._changes[0] += 1

    @property
    def attribution(self) -> str | None:
        """Whom the data is by, to be shown where the graph is shown; None when nobody asks for it."""
        return self._attribution

    @attribution.setter
    def attribution(self, attribution: str | None) -> None:
        self._attribution = records.as_text(attribution, "graph.attribution")

    def __len__(self) -> int:
        """How many nodes there are."""
        return len(self._nodes)

    def __bool__(self) -> bool:
        """A graph is a graph, empty or not."""
        return True

    # -- one by one ---------------------------------------------------------------------------------------------

    def add_node(self, node_data: dict[str, Any]) -> None:
        """Add a node."""
        if self._phase.agent is not None:
            self._phase.refuse("call ctx.graph.graph.add_node")
        id = records.as_id(records.required(node_data, "id", "A node"), "a node")
        x = records.as_coordinate(records.required(node_data, "x", "A node"), "x", id)
        y = records.as_coordinate(records.required(node_data, "y", "A node"), "y", id)
        nodes = self._nodes
        if nodes.index.row(id) >= 0:
            raise DuplicateId("a node", id)
        given = records.extras(node_data, records.NODE_KEYS) if len(node_data) > 3 else None
        row = nodes.append(id, x, y)
        if given:
            nodes.set_attributes(row, given)
        if self._indexes.is_built:
            self._indexes.node_added(row)
        self._changes[0] += 1

    def add_edge(self, edge_data: dict[str, Any]) -> None:
        """Add an edge."""
        if self._phase.agent is not None:
            self._phase.refuse("call ctx.graph.graph.add_edge")
        id = records.as_id(records.required(edge_data, "id", "An edge"), "an edge")
        length = records.as_length(records.required(edge_data, "length", "An edge"), id)
        source, target = self._end_rows(edge_data, id)
        edges = self._edges
        if edges.index.row(id) >= 0:
            raise DuplicateId("an edge", id)
        bend, given = None, None
        if len(edge_data) > 4:
            bend = records.bend_of(edge_data.get("linestring"), id, self._straight(source, target))
            given = records.extras(edge_data, records.EDGE_KEYS)
        row = edges.append(id, source, target, length)
        if bend is not None:
            edges.bends[row] = bend
        if given:
            edges.set_attributes(row, given)
        if self._indexes.is_built:
            self._indexes.edge_added(row, source, target)
        self._changes[0] += 1

    def get_node(self, node_id: int) -> Node:
        """The node with that id."""
        row = self._nodes.find(records.as_id(node_id, "a node"))
        xy = self._nodes.xy
        return Node(self._nodes.ids[row], xy[2 * row], xy[2 * row + 1])

    def get_edge(self, edge_id: int) -> OSMEdge:
        """The edge with that id."""
        row = self._edges.find(records.as_id(edge_id, "an edge"))
        return self._indexes.edge_value(row)

    def update_node(self, node_data: dict[str, Any]) -> None:
        """Change the given keys of a node."""
        if self._phase.agent is not None:
            self._phase.refuse("call ctx.graph.graph.update_node")
        id = records.as_id(records.required(node_data, "id", "An update of a node"), "a node")
        nodes, row = self._nodes, self._nodes.find(id)
        x, y = nodes.xy[2 * row], nodes.xy[2 * row + 1]
        new_x = records.as_coordinate(node_data.get("x", x), "x", id)
        new_y = records.as_coordinate(node_data.get("y", y), "y", id)
        given = records.extras(node_data, records.NODE_KEYS)
        nodes.set_attributes(row, given)
        if (new_x, new_y) != (x, y):
            nodes.own()
            nodes.xy[2 * row], nodes.xy[2 * row + 1] = new_x, new_y
            self._indexes.node_moved(row)
        self._changes[0] += 1

    def update_edge(self, edge_data: dict[str, Any]) -> None:
        """Change the given keys of an edge."""
        if self._phase.agent is not None:
            self._phase.refuse("call ctx.graph.graph.update_edge")
        id = records.as_id(records.required(edge_data, "id", "An update of an edge"), "an edge")
        edges, row = self._edges, self._edges.find(id)
        old_ends = (edges.sources[row], edges.targets[row])
        ids = self._nodes.ids
        full = {
            "source": ids[old_ends[0]],
            "target": ids[old_ends[1]],
            "length": edges.lengths[row],
            **edge_data,
        }
        ends = self._end_rows(full, id)
        length = records.as_length(full["length"], id)
        given = records.extras(edge_data, records.EDGE_KEYS)
        bend = records.bend_of(full.get("linestring"), id, self._straight(*ends))
        edges.own()
        edges.lengths[row] = length
        edges.sources[row], edges.targets[row] = ends
        if "linestring" in edge_data or ends != old_ends:  # an old polyline does not lead to a new end
            edges.bends.pop(row, None)
        if bend is not None:
            edges.bends[row] = bend
        edges.set_attributes(row, given)
        self._indexes.edge_changed(row, old_ends, ends)
        self._changes[0] += 1

    def remove_node(self, node_id: int) -> None:
        """Remove a node and the edges at it."""
        if self._phase.agent is not None:
            self._phase.refuse("call ctx.graph.graph.remove_node")
        row = self._nodes.index.row(records.as_id(node_id, "a node"))
        if row < 0:
            return
        for edge in self._indexes.edges_at(np.array([row])).tolist():
            self._drop_edge(edge)
        self._nodes.remove(row)
        self._indexes.node_removed(row)
        self._changes[0] += 1
        self._compact()

    def remove_edge(self, edge_id: int) -> None:
        """Remove an edge."""
        if self._phase.agent is not None:
            self._phase.refuse("call ctx.graph.graph.remove_edge")
        self._drop_edge(self._edges.find(records.as_id(edge_id, "an edge")))
        self._changes[0] += 1
        self._compact()

    # -- queries ------------------------------------------------------------------------------------------------

    def get_nodes(self, d: float = -1.0, x: float = 0.0, y: float = 0.0) -> Iterator[int]:
        """Ids of the nodes within d of (x, y), in insertion order; all for `d < 0`."""
        if records.is_everywhere(d, x, y):
            return self._nodes.iter_ids()
        return self._nodes.iter_ids(self._indexes.nodes_within(x, y, d))

    def get_edges(self, d: float = -1.0, x: float = 0.0, y: float = 0.0) -> Iterator[int]:
        """Ids of the edges with at least one end node within d of (x, y), in insertion order; all for `d < 0`."""
        if records.is_everywhere(d, x, y):
            return self._edges.iter_ids()
        return self._edges.iter_ids(self._indexes.edges_at(self._indexes.nodes_within(x, y, d)))

    def get_neighbors(self, node_id: int) -> Iterator[int]:
        """Unique targets of the edges leaving a node, in edge insertion order."""
        return iter(self._indexes.neighbors(records.as_id(node_id, "a node")))

    @property
    def neighborhoods(self) -> Neighborhoods:
        """Live and read-only: node id -> the node itself, then its neighbours."""
        is_open = self._phase.agent is None
        return self._neighborhoods if is_open else ReadOnlyMapping(self._neighborhoods)  # type: ignore[return-value] # it reads like them

    def has_node(self, node_id: int) -> bool:
        """Whether there is a node with that id."""
        return self._nodes.index.row(records.as_id(node_id, "a node")) >= 0

    def within(
        self, node_id: int, radius: float, fov: float = 2.0 * pi, heading: tuple[float, float] = (0.0, 0.0)
    ) -> Surroundings:
        """What lies within `radius` of a node and inside its field of view."""
        row = self._nodes.find(records.as_id(node_id, "a node"))
        x, y = self._nodes.xy[2 * row], self._nodes.xy[2 * row + 1]
        rows = self._rows_near(x, y, radius)
        if (fov := as_range(fov, "fov")) != 2.0 * pi:
            cos, sin = as_numbers(heading, "heading", "(cos, sin)")
            if (cos, sin) != (0.0, 0.0):
                dx, dy = (self._nodes.array("xy")[rows] - (x, y)).T
                rows = rows[kernels.in_cone(dx, dy, (cos, sin), fov)]
        return self._among(rows)

    def nodes_near(self, x: float, y: float, radius: float) -> NodeColumns:
        """The nodes within `radius` of (x, y), as arrays."""
        rows = self._rows_near(as_float(x, "x"), as_float(y, "y"), radius)
        return NodeColumns(self._nodes.array("ids")[rows], self._nodes.array("xy")[rows])

    def among(self, node_ids: Sequence[int] | np.ndarray[Any, Any]) -> Surroundings:
        """Some nodes, and the edges with both ends among them, in insertion order."""
        return self._among(np.unique(self._nodes.index.rows(records.id_array(node_ids, "node_ids"), "node")))

    def positions(self, node_ids: Sequence[int] | np.ndarray[Any, Any]) -> FloatArray:
        """Coordinates (nodes, 2) of several nodes."""
        rows = self._nodes.index.rows(records.id_array(node_ids, "node_ids"), "node")
        xy: FloatArray = self._nodes.array("xy")[rows]
        return xy

    def node_attributes(self, node_id: int) -> dict[str, Any]:
        """The attributes of a node that are not `id`, `x` or `y`; a fresh dict (KeyError)."""
        found = self._nodes.attributes_of(self._nodes.find(records.as_id(node_id, "a node")))
        return self._phase.shown(found)

    def edge_attributes(self, edge_id: int) -> dict[str, Any]:
        """The attributes of an edge beyond ends, length and linestring; a fresh dict (KeyError)."""
        found = self._edges.attributes_of(self._edges.find(records.as_id(edge_id, "an edge")))
        return self._phase.shown(found)

    # -- as arrays ----------------------------------------------------------------------------------------------

    @refused_while_deciding
    def add_nodes(self, ids: Any, x: Any, y: Any) -> None:
        """Add many nodes at once.

        Args:
            ids: (nodes,) integers, none of them taken.
            x: (nodes,) finite, map units.
            y: (nodes,) finite, map units.

        Raises:
            DuplicateId (KeyError), BadValue (ValueError), BadType (TypeError): nothing has changed then.
        """
        ids, xy = checked_nodes(ids, x, y)
        self._nodes.extend(ids, xy=xy)
        self._forget_indexes()

    @refused_while_deciding
    def add_edges(self, ids: Any, sources: Any, targets: Any, lengths: Any = None) -> None:
        """Add many straight edges at once.

        Args:
            ids: (edges,) integers, none of them taken.
            sources: (edges,) ids of nodes.
            targets: (edges,) ids of nodes.
            lengths: (edges,) in map units, not negative; None measures the straight lines.

        Raises:
            UnknownName, DuplicateId (KeyError), BadValue (ValueError), BadType (TypeError): nothing has changed then.
        """
        self._edges.extend(**checked_edges(self._nodes, ids, sources, targets, lengths))
        self._forget_indexes()

    def weights(self, weight: str | None = "length") -> FloatArray:
        """What each edge costs, (edges,) in insertion order."""
        return edge_weights(self._snapshot(), weight)

    def columns(self) -> GraphColumns:
        """The graph as read-only arrays that stay as they are now."""
        columns = self._snapshot()
        if self._phase.agent is None:
            return columns
        shown = self._shown
        if shown is None or shown.revision != columns.revision:
            parts = {field.name: frozen(getattr(columns, field.name)) for field in fields(columns)}
            shown = self._shown = GraphColumns(**parts)
        return shown

    def _snapshot(self) -> GraphColumns:
        """The columns themselves, whose attributes are not copied."""
        known = self._columns
        if known is None or known.revision != self._changes[0]:
            self._compact(fully=True)
            known = self._columns = snapshot(self._nodes, self._edges, self._changes[0], self.crs)
        return known

    @refused_while_deciding
    def replace(self, columns: GraphColumns) -> None:
        """Become the graph that `columns` describe."""
        self.clear()
        self._nodes.extend(columns.node_ids, xy=columns.xy)
        ends = {"sources": columns.sources, "targets": columns.targets}
        self._edges.extend(columns.edge_ids, lengths=columns.lengths, **ends)
        self._edges.bends = dict(columns.bends)
        self._nodes.attributes = {name: dict(values) for name, values in columns.node_attributes.items()}
        self._edges.attributes = {name: dict(values) for name, values in columns.edge_attributes.items()}
        self._crs = columns.crs

    @refused_while_deciding
    def attach_networkx_graph(self, G: "nx.Graph[Any] | PackedGraph") -> "Graph":  # noqa: N803 - published name
        """Add any networkx graph, or the map of a recording, to what is there, all or nothing."""
        from gamms.graph import networkx, packed

        if isinstance(G, packed.PackedGraph):
            packed.attach(self, G)
        else:
            networkx.attach(self, G)
        return self

    def to_networkx(self) -> "nx.MultiDiGraph[int] | nx.DiGraph[int]":
        """The graph as a networkx graph: a DiGraph, or a MultiDiGraph where edges are parallel."""
        from gamms.graph.networkx import export

        return export(self)

    @refused_while_deciding
    def close(self) -> None:
        """Let go of everything; whatever is asked of the graph from now on raises ContextTerminated."""
        self._neighborhoods.clear()
        self._routes.clear()
        self._nodes = self._edges = self._indexes = self._columns = Closed()  # type: ignore[assignment] # see Closed

    # -- inside -------------------------------------------------------------------------------------------------

    def _rows_near(self, x: float, y: float, radius: float) -> IntArray:
        radius = as_range(radius, "The radius")
        return self._nodes.living() if radius == inf else self._indexes.nodes_within(x, y, radius)

    def _among(self, rows: IntArray) -> Surroundings:
        nodes = self._indexes.node_values(rows)
        return Surroundings({node[0]: node for node in nodes}, self._indexes.edges_among(rows))

    def _end_rows(self, edge: dict[str, Any], id: int) -> tuple[int, int]:
        row_of = self._nodes.index.row
        try:
            source, target = edge["source"], edge["target"]
        except KeyError as error:  # as 1.0.0 has it; for what else is missing it has a ValueError
            raise MissingKey(f"Edge {id} needs the key {error}; got only {', '.join(map(shown, edge))}.") from None
        ends = row_of(records.as_id(source, "a node")), row_of(records.as_id(target, "a node"))
        if ends[0] < 0 or ends[1] < 0:
            raise UnknownName(f"node at the end of edge {id}:", source if ends[0] < 0 else target)
        return ends

    def _straight(self, source: int, target: int) -> tuple[float, float, float, float]:
        xy = self._nodes.xy
        return (xy[2 * source], xy[2 * source + 1], xy[2 * target], xy[2 * target + 1])

    def _drop_edge(self, row: int) -> None:
        ends = (self._edges.sources[row], self._edges.targets[row])
        self._edges.remove(row)
        self._indexes.edge_removed(ends)

    def _forget_indexes(self) -> None:
        self._indexes = Indexes(self._nodes, self._edges, self._neighborhoods)
        self._changes[0] += 1

    def _compact(self, *, fully: bool = False) -> None:
        """Drop the dead rows, as a rule once they outnumber the living: so each costs its share only once."""
        nodes, edges = self._nodes, self._edges
        if nodes.dead > (0 if fully else len(nodes)):
            edges.rename_ends(nodes.compact())
            self._indexes = Indexes(nodes, edges, self._neighborhoods)
        if edges.dead > (0 if fully else len(edges)):
            edges.compact()
            self._indexes = Indexes(nodes, edges, self._neighborhoods)
