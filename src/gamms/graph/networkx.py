"""The bridge to networkx: any of its graphs in, ours out."""

from collections import defaultdict
from collections.abc import Hashable, Iterable
from itertools import count
from operator import index
from typing import TYPE_CHECKING, Any

import numpy as np

from gamms.errors import BadType, BadValue
from gamms.graph import records
from gamms.graph.copies import CONTAINERS, own
from gamms.graph.graph import Graph
from gamms.ir import geometry
from gamms.ir.graph import FloatArray, IntArray
from gamms.text import shown

if TYPE_CHECKING:
    import networkx as nx

LABEL = "networkx_label"  # the attribute that keeps a node's label where it could not be its id

_NODE_COLUMNS = frozenset(("x", "y"))  # what becomes columns; all other data are attributes
_EDGE_COLUMNS = frozenset(("id", "length", "linestring", "geometry"))


def attach(graph: Graph, G: "nx.Graph[Any]") -> None:  # noqa: N803 - published name
    """Add a networkx graph to `graph`, all or nothing.

    Raises:
        BadValue (ValueError): "Failed to attach NetworkX graph: …", with the reason as its cause.
    """
    try:
        _Import(graph, G).commit()
    except Exception as error:
        # Labels and attributes are of any class, and so are the errors of looking at them.
        raise BadValue(f"Failed to attach NetworkX graph: {error}") from error


def export(graph: Graph) -> "nx.MultiDiGraph[int] | nx.DiGraph[int]":
    """A DiGraph with our ids as labels; a MultiDiGraph, keyed by edge id, where edges are parallel."""
    import networkx as nx

    columns = graph.columns()
    pairs = columns.sources * len(columns.node_ids) + columns.targets
    is_multi = len(np.unique(pairs)) < len(pairs)
    exported: Any = nx.MultiDiGraph() if is_multi else nx.DiGraph()
    exported.graph.update({key: value for key in ("crs", "attribution") if (value := getattr(graph, key))})
    for id in graph.get_nodes():
        node = graph.get_node(id)
        exported.add_nodes_from([(id, {"x": node.x, "y": node.y, **graph.node_attributes(id)})])
    for id in graph.get_edges():
        edge = graph.get_edge(id)
        data = {"id": id, "length": edge.length, "linestring": edge.linestring, **graph.edge_attributes(id)}
        exported.add_edges_from(
            [(edge.source, edge.target, id, data) if is_multi else (edge.source, edge.target, data)]
        )
    return exported  # type: ignore[no-any-return] # one of two classes


def labels(graph: Graph) -> dict[Hashable, int]:
    """Label in networkx -> id here, for every node whose label could not be its id."""
    columns = graph.columns()
    return {label: int(columns.node_ids[row]) for row, label in columns.node_attributes.get(LABEL, {}).items()}


def digraph(x: FloatArray, y: FloatArray, ends: IntArray, length: float) -> "nx.DiGraph[int]":
    """A DiGraph of nodes 0, 1, … and of edges of one length.

    Args:
        x: (nodes,)
        y: (nodes,)
        ends: (edges, 2) nodes.
        length: of each edge.
    """
    import networkx as nx

    made: nx.DiGraph[int] = nx.DiGraph()
    made.add_nodes_from(
        (node, {"x": a, "y": b}) for node, (a, b) in enumerate(zip(x.tolist(), y.tolist(), strict=True))
    )
    made.add_edges_from(ends.tolist(), length=length)
    return made


class _Import:
    """A networkx graph on its way in: everything is worked out before the graph changes."""

    def __init__(self, graph: Graph, G: "nx.Graph[Any]") -> None:  # noqa: N803 - published name
        if not (hasattr(G, "nodes") and hasattr(G, "edges") and hasattr(G, "is_directed")):
            raise BadType(f"it must be a networkx graph, not {shown(G)}")
        self.graph, self.about = graph, dict(G.graph)
        crs = self.about.get("crs")
        if len(graph) and None not in (crs, graph.crs) and str(crs) != graph.crs:
            raise BadValue(f"its CRS is {crs}, that of the graph is {graph.crs}; project it first")
        self.node_data = [data for _, data in G.nodes(data=True)]
        self.id_of = _ids_of_labels(graph, list(G.nodes))
        self.edges = list(G.edges(data=True)) if G.is_directed() else list(_both_directions(G))
        self.edge_data = [data for _, _, data in self.edges]
        self.edge_ids = _edge_ids(graph, [data.get("id") for data in self.edge_data])

    def commit(self) -> None:
        nodes, edges = self.graph._nodes, self.graph._edges
        node_ids = np.fromiter(self.id_of.values(), np.int64, len(self.id_of))
        xy = np.column_stack([self._axis(axis) for axis in ("x", "y")])
        row_of = dict(zip(self.id_of, range(len(node_ids)), strict=True))
        ends = np.array([[row_of[u] for u, _, _ in self.edges], [row_of[v] for _, v, _ in self.edges]], np.int64)
        bends = _bends(_polylines(self.edge_data), xy[ends.T])
        lengths = self._lengths(bends, np.hypot(*(xy[ends[1]] - xy[ends[0]]).T))
        nodes.index.refuse_duplicates(node_ids, nodes.kind)
        edges.index.refuse_duplicates(self.edge_ids, edges.kind)
        node_attributes = _by_name(nodes.count, self.node_data, _NODE_COLUMNS)
        edge_attributes = _by_name(edges.count, self.edge_data, _EDGE_COLUMNS)
        given = {key: str(self.about[key]) for key in ("crs", "attribution") if self.about.get(key) is not None}
        about = {key: records.as_text(text, f"its {key}") for key, text in given.items()}
        others = {nodes.count + row: label for row, label in enumerate(self.id_of) if _as_label_id(label) is None}

        first = nodes.extend(node_ids, xy=xy)
        _merge(nodes.attributes, node_attributes)
        for row, label in others.items():
            nodes.set_attributes(row, {LABEL: label})
        source_rows, target_rows = first + ends
        first = edges.extend(self.edge_ids, sources=source_rows, targets=target_rows, lengths=lengths)
        edges.bends.update({first + i: bend for i, bend in bends.items()})
        _merge(edges.attributes, edge_attributes)
        for key, text in about.items():
            setattr(self.graph, key, text)
        self.graph._forget_indexes()

    def _axis(self, axis: str) -> FloatArray:
        given = [data.get(axis, 0.0) for data in self.node_data]
        if set(map(type, given)) <= {float} and np.isfinite(numbers := np.array(given, np.float64)).all():
            return numbers
        ids = self.id_of.values()
        return np.array([records.as_coordinate(one, axis, id) for id, one in zip(ids, given, strict=True)], np.float64)

    def _lengths(self, bends: dict[int, FloatArray], straight: FloatArray) -> FloatArray:
        """Every edge's length: the one given, or else that of its polyline or of the straight line."""
        given = [data.get("length") for data in self.edge_data]
        if set(map(type, given)) <= {float}:
            lengths = np.array(given, np.float64)
            if np.isfinite(lengths).all() and (lengths >= 0.0).all():
                return lengths
        for i, length in enumerate(given):
            if length is None:
                given[i] = float(np.hypot(*np.diff(bends[i], axis=0).T).sum() if i in bends else straight[i])
        ids = self.edge_ids.tolist()
        return np.array([records.as_length(length, id) for length, id in zip(given, ids, strict=True)], np.float64)


def _bends(shapes: dict[int, FloatArray], ends: FloatArray) -> dict[int, FloatArray]:
    """The polylines that are more than the straight line between the ends (edges, 2, 2) of their edge."""
    pairs = [i for i, shape in shapes.items() if len(shape) == 2]
    if pairs:
        is_straight = (np.stack([shapes[i] for i in pairs]) == ends[pairs]).all(axis=(1, 2))
        straight = {i for i, is_one in zip(pairs, is_straight.tolist(), strict=True) if is_one}
        shapes = {i: shape for i, shape in shapes.items() if i not in straight}
    return shapes


def _ids_of_labels(graph: Graph, labels: list[Hashable]) -> dict[Hashable, int]:
    """Integer labels are ids; any other label gets the next free integer."""
    ids = {label: _as_label_id(label) for label in labels}
    if None not in ids.values():
        return ids  # type: ignore[return-value] # as the line before says
    taken = [id for id in ids.values() if id is not None]
    free = count(max([-1, *taken, *graph.get_nodes()]) + 1)
    return {label: next(free) if id is None else id for label, id in ids.items()}


def _as_label_id(label: Hashable) -> int | None:
    if type(label) is int:
        return label if -(2**63) <= label < 2**63 else None
    if isinstance(label, bool):
        return None
    try:
        id = index(label)  # type: ignore[arg-type] # the except is the check
    except TypeError:
        return None
    return id if -(2**63) <= id < 2**63 else None


def _both_directions(G: "nx.Graph[Any]") -> Iterable[tuple[Any, Any, dict[str, Any]]]:  # noqa: N803 - networkx's name
    """Each edge once per direction; the way back has no id yet and the reversed shape."""
    for u, v, data in G.edges(data=True):
        yield u, v, data
        if u != v:
            back = {key: value for key, value in data.items() if key != "id"}
            for key in ("linestring", "geometry"):
                if back.get(key) is not None:
                    back[key] = geometry.points_of(back[key], f"The {key} of edge {shown(u)}-{shown(v)}")[::-1]
            yield v, u, back


def _edge_ids(graph: Graph, given: list[Any]) -> "np.ndarray[Any, np.dtype[np.int64]]":
    ids = [None if id is None else records.as_id(id, "an edge") for id in given]
    if None not in ids:
        return np.array(ids, np.int64)
    free = count(max([-1, *(id for id in ids if id is not None), *graph.get_edges()]) + 1)
    return np.array([next(free) if id is None else id for id in ids], np.int64)


def _polylines(edges: list[dict[str, Any]]) -> dict[int, FloatArray]:
    """`linestring`, else `geometry`, as points (points, 2) by edge, for the edges that have one."""
    given = ((data.get("linestring"), data.get("geometry")) for data in edges)
    shapes = {i: b if a is None else a for i, (a, b) in enumerate(given) if a is not None or b is not None}
    if not shapes:
        return {}
    lines = {i: shape for i, shape in shapes.items() if hasattr(type(shape), "coords")}
    points, offsets = geometry.points_of_many(list(lines.values()))
    bounds = offsets.tolist()
    found = {i: points[a:b] for i, a, b in zip(lines, bounds[:-1], bounds[1:], strict=True)}
    for i, shape in shapes.items():
        if i not in lines:
            found[i] = geometry.points_of(shape, "A linestring")
    if not np.isfinite(points).all():
        raise BadValue("a linestring has a coordinate that is not finite")
    return found


def _by_name(first: int, rows: list[dict[Any, Any]], ours: frozenset[str]) -> dict[str, dict[int, Any]]:
    """The attributes of rows from `first` on but for `ours`, name -> row -> value.

    Raises:
        BadValue: two names are one as text, or a value is nested too deeply.
    """
    columns: defaultdict[Any, dict[int, Any]] = defaultdict(dict)
    for row, data in enumerate(rows, first):
        if data.keys() <= ours:
            continue
        for name, value in data.items():
            if name not in ours:
                columns[name][row] = own(value) if type(value) in CONTAINERS else value
    named: dict[str, dict[int, Any]] = {}
    for name, values in columns.items():
        others = named.setdefault(str(name), values)
        if others is not values:
            if not others.keys().isdisjoint(values):
                raise BadValue(f"two of its attributes are called {str(name)!r}")
            others.update(values)
    return named


def _merge(columns: dict[str, dict[int, Any]], given: dict[str, dict[int, Any]]) -> None:
    for name, values in given.items():
        columns.setdefault(name, {}).update(values)
