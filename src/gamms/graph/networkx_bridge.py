"""Convert networkx graphs to GAMMS and back, and make street grids."""

from collections import defaultdict
from collections.abc import Hashable, Iterable
from itertools import count
from typing import TYPE_CHECKING, Any

import numpy as np

from gamms import kernels
from gamms.arguments import as_int, as_positive, convert_index, explain_call_errors
from gamms.errors import BadType, BadValue
from gamms.graph import records
from gamms.graph.export import format_wkt, list_shapes, make_plain_cell
from gamms.graph.store import GraphStore
from gamms.graph.tables import CONTAINERS, copy_value
from gamms.ir import geometry
from gamms.ir.graph import LABEL, FloatArray, GraphColumns, IntArray
from gamms.ir.projection import format_crs, scale_fault
from gamms.limits import refuse_above
from gamms.text import shown
from gamms.typing.map_storage import IGraphSource

if TYPE_CHECKING:
    import networkx as nx
    from shapely import LineString

_NODE_COLUMNS = frozenset(("x", "y"))  # node data that become columns; all other data become attributes
_EDGE_COLUMNS = frozenset(("id", "length", "linestring", "geometry"))
_NODE_BYTES = 1_000  # bytes per node with its edges, measured: 410 when attached, and 390 or more that games derive
_NETWORKX_BYTES = 3_500  # bytes per node, measured: 2,400 in networkx and attached, 2,800 of the process


def attach(store: GraphStore, G: "nx.Graph[Any]") -> None:  # noqa: N803 - published name
    """Add a networkx graph to a graph; on an error nothing is added.

    Raises:
        BadValue (ValueError): "Failed to attach NetworkX graph: …", with the reason as its cause.
    """
    try:
        made = _NetworkxImport(store, G)
        columns = made.columns()
        _refuse_false_metres(columns.crs or store.crs, columns.xy)
        store.append(columns, made.attribution)
    except Exception as error:
        # Labels and attributes may be of any class, so reading them may raise any error.
        raise BadValue(f"Failed to attach NetworkX graph: {error}") from error


def _refuse_false_metres(crs: str | None, xy: FloatArray) -> None:
    """Refuse a CRS whose lengths are not metres at these positions (points, 2).

    Raises:
        BadValue: a metre in it is off by more than one per cent, or its unit is neither metres nor degrees.
    """
    if fault := scale_fault(crs, xy):
        raise BadValue(
            f"{fault}. gamms.osm.process_osm_graph projects a graph to its UTM zone; without G.graph['crs'], x and y "
            "have units of their own."
        )


def export(
    columns: GraphColumns, attribution: str | None, *, plain: bool = False
) -> "nx.MultiDiGraph[int] | nx.DiGraph[int]":
    """Return a DiGraph with ids as labels; a MultiDiGraph, keyed by edge id, if there are parallel edges.

    With `plain`, all attributes become numbers, texts and bools.
    """
    import networkx as nx

    ids = columns.node_ids.tolist()
    sources, targets = (columns.node_ids[ends].tolist() for ends in (columns.sources, columns.targets))
    is_multi = len(set(zip(sources, targets, strict=True))) < len(sources)
    exported: Any = nx.MultiDiGraph() if is_multi else nx.DiGraph()
    about = {"crs": columns.crs, "attribution": attribution}
    exported.graph.update({key: value for key, value in about.items() if value})
    nodes = [{"x": x, "y": y} for x, y in columns.xy.tolist()]
    lines = list(map(format_wkt, list_shapes(columns))) if plain else _make_lines(columns)
    edges: list[dict[str, Any]] = [
        {"id": id, "length": length, "linestring": line}
        for id, length, line in zip(columns.edge_ids.tolist(), columns.lengths.tolist(), lines, strict=True)
    ]
    for rows, attributes in ((nodes, columns.node_attributes), (edges, columns.edge_attributes)):
        for name, values in attributes.items():
            for row, value in values.items():
                if not plain:
                    rows[row][name] = copy_value(value)
                elif (cell := make_plain_cell(value)) is not None:
                    rows[row][name] = cell
    exported.add_nodes_from(zip(ids, nodes, strict=True))
    keys = [columns.edge_ids.tolist()] if is_multi else []
    exported.add_edges_from(zip(sources, targets, *keys, edges, strict=True))
    return exported  # type: ignore[no-any-return] # one of two classes


def _make_lines(columns: GraphColumns) -> "list[LineString]":
    shapes = list_shapes(columns)
    rows = np.repeat(np.arange(len(shapes)), [len(shape) for shape in shapes])
    return geometry.make_line_strings(np.concatenate([np.zeros((0, 2)), *shapes]), rows)


@explain_call_errors
def grid(rows: int, columns: int, spacing: float = 10.0) -> "nx.DiGraph[int]":
    """Return a street grid; neighbors in a row or column are connected in both directions.

    Args:
        rows: number of rows.
        columns: number of nodes in each row.
        spacing: map units between neighbors.

    Returns:
        A networkx DiGraph. Node `i * columns + j` is at `x = j * spacing, y = i * spacing`; edges have a `length`.

    Raises:
        BadValue (ValueError), BadType (TypeError): a number is invalid.
        TooLarge (BadValue): it would exceed the memory limit.
    """
    _refuse_too_many(_check_side(rows, "rows"), _check_side(columns, "columns"), _NETWORKX_BYTES)
    arrays, _ = Grid(rows, columns, spacing).as_columns()
    import networkx as nx

    made: Any = nx.DiGraph()
    made.add_nodes_from((node, {"x": x, "y": y}) for node, (x, y) in enumerate(arrays.xy.tolist()))
    ends = zip(arrays.sources.tolist(), arrays.targets.tolist(), strict=True)
    made.add_edges_from((*pair, {"length": length}) for pair, length in zip(ends, arrays.lengths.tolist(), strict=True))
    return made  # type: ignore[no-any-return] # as this is Any


class Grid(IGraphSource):
    """A street grid as `grid` describes it, as columns: attached without networkx.

    Raises:
        BadValue (ValueError), BadType (TypeError): a number is invalid.
        TooLarge (BadValue): it would exceed the memory limit.
    """

    def __init__(self, rows: int, columns: int, spacing: float = 10.0) -> None:
        self._rows = _check_side(rows, "rows")
        self._columns = _check_side(columns, "columns")
        self._step = as_positive(spacing, "spacing")
        _refuse_too_many(self._rows, self._columns, _NODE_BYTES)

    def as_columns(self) -> tuple[GraphColumns, None]:
        """Return the nodes row by row, and the edges sorted by their end nodes."""
        ids = np.arange(self._rows * self._columns).reshape(self._rows, self._columns)
        y, x = np.indices(ids.shape).astype(np.float64) * self._step
        one = np.concatenate([ids[:, :-1].ravel(), ids[:-1].ravel()])
        other = np.concatenate([ids[:, 1:].ravel(), ids[1:].ravel()])
        sources = np.concatenate([one, other])
        targets = np.concatenate([other, one])
        order = np.lexsort((targets, sources))
        offsets, out_edges = kernels.group_rows(sources[order], ids.size)
        columns = GraphColumns(
            node_ids=ids.ravel(),
            xy=np.column_stack([x.ravel(), y.ravel()]),
            edge_ids=np.arange(len(order)),
            sources=sources[order],
            targets=targets[order],
            lengths=np.full(len(order), self._step),
            offsets=offsets,
            out_edges=out_edges,
            polylines={},
            node_attributes={},
            edge_attributes={},
            revision=0,
            crs=None,
        )
        return columns, None


def _refuse_too_many(rows: int, columns: int, node_bytes: int) -> None:
    """Raise `TooLarge` if a grid would exceed the memory limit at this many bytes per node."""
    refuse_above(rows * columns * node_bytes, f"A grid of {rows} x {columns} nodes")


def _check_side(value: int, name: str) -> int:
    side = as_int(value, name)
    if side < 1:
        raise BadValue(f"{name} must be at least 1, not {side}.")
    return side


class _NetworkxImport:
    """A networkx graph as columns, with rows counted from 0; the target graph supplies free ids."""

    def __init__(self, store: GraphStore, G: "nx.Graph[Any]") -> None:  # noqa: N803 - published name
        if not (hasattr(G, "nodes") and hasattr(G, "edges") and hasattr(G, "is_directed")):
            raise BadType(f"it must be a networkx graph, not {shown(G)}")
        crs, attribution = (G.graph.get(key) for key in ("crs", "attribution"))
        self.crs = None if crs is None else records.as_text(format_crs(crs), "its crs")
        self.attribution = None if attribution is None else records.as_text(str(attribution), "its attribution")
        self.node_data = [data for _, data in G.nodes(data=True)]
        self.id_of = _find_ids(store, list(G.nodes))
        self.edges = list(G.edges(data=True)) if G.is_directed() else list(_list_both_directions(G))
        self.edge_data = [data for _, _, data in self.edges]
        self.edge_ids = _find_edge_ids(store, [data.get("id") for data in self.edge_data])

    def columns(self) -> GraphColumns:
        node_ids = np.fromiter(self.id_of.values(), np.int64, len(self.id_of))
        xy = np.column_stack([self._read_axis(axis) for axis in ("x", "y")])
        row_of = dict(zip(self.id_of, range(len(node_ids)), strict=True))
        ends = np.array([[row_of[u] for u, _, _ in self.edges], [row_of[v] for _, v, _ in self.edges]], np.int64)
        shapes = ((data.get("linestring"), data.get("geometry")) for data in self.edge_data)
        given = {i: b if a is None else a for i, (a, b) in enumerate(shapes) if a is not None or b is not None}
        polylines = _select_bent(
            geometry.read_polylines(given, lambda i: f"The linestring of edge {self.edge_ids[i]}"), xy[ends.T]
        )
        node_attributes = _group_by_name(self.node_data, _NODE_COLUMNS)
        others = {row: label for row, label in enumerate(self.id_of) if _as_label_id(label) is None}
        if others:
            node_attributes.setdefault(LABEL, {}).update(others)
        offsets, out_edges = kernels.group_rows(ends[0], len(node_ids))
        return GraphColumns(
            node_ids=node_ids,
            xy=xy,
            edge_ids=self.edge_ids,
            sources=ends[0],
            targets=ends[1],
            lengths=self._find_lengths(polylines, np.hypot(*(xy[ends[1]] - xy[ends[0]]).T)),
            offsets=offsets,
            out_edges=out_edges,
            polylines=polylines,
            node_attributes=node_attributes,
            edge_attributes=_group_by_name(self.edge_data, _EDGE_COLUMNS),
            revision=0,
            crs=self.crs,
        )

    def _read_axis(self, axis: str) -> FloatArray:
        given = [data.get(axis, 0.0) for data in self.node_data]
        if set(map(type, given)) <= {float} and np.isfinite(numbers := np.array(given, np.float64)).all():
            return numbers
        ids = self.id_of.values()
        return np.array([records.as_coordinate(one, axis, id) for id, one in zip(ids, given, strict=True)], np.float64)

    def _find_lengths(self, polylines: dict[int, FloatArray], straight: FloatArray) -> FloatArray:
        """Return the length of every edge: as given, or the length of its polyline or of the straight line."""
        given = [data.get("length") for data in self.edge_data]
        if set(map(type, given)) <= {float}:
            lengths = np.array(given, np.float64)
            if np.isfinite(lengths).all() and (lengths >= 0.0).all():
                return lengths
        for i, length in enumerate(given):
            if length is None:
                given[i] = float(np.hypot(*np.diff(polylines[i], axis=0).T).sum() if i in polylines else straight[i])
        ids = self.edge_ids.tolist()
        return np.array([records.as_length(length, id) for length, id in zip(given, ids, strict=True)], np.float64)


def _select_bent(shapes: dict[int, FloatArray], ends: FloatArray) -> dict[int, FloatArray]:
    """Return the polylines that differ from the straight line between the ends (edges, 2, 2) of their edge."""
    pairs = [i for i, shape in shapes.items() if len(shape) == 2]
    if pairs:
        is_straight = (np.stack([shapes[i] for i in pairs]) == ends[pairs]).all(axis=(1, 2))
        straight = {i for i, is_one in zip(pairs, is_straight.tolist(), strict=True) if is_one}
        shapes = {i: shape for i, shape in shapes.items() if i not in straight}
    return shapes


def _find_ids(store: GraphStore, labels: list[Hashable]) -> dict[Hashable, int]:
    """Use integer labels as ids; give other labels the next free integers."""
    ids = {label: _as_label_id(label) for label in labels}
    if None not in ids.values():
        return ids  # type: ignore[return-value] # as the line before says
    taken = [id for id in ids.values() if id is not None]
    free = count(max([-1, *taken, *store.nodes.iterate_ids()]) + 1)
    return {label: next(free) if id is None else id for label, id in ids.items()}


def _as_label_id(label: Hashable) -> int | None:
    if type(label) is int:
        return label if -(2**63) <= label < 2**63 else None
    try:
        id = convert_index(label)
    except TypeError:
        return None
    return id if -(2**63) <= id < 2**63 else None


def _list_both_directions(G: "nx.Graph[Any]") -> Iterable[tuple[Any, Any, dict[str, Any]]]:  # noqa: N803 - networkx's name
    """Yield each edge once per direction; the reverse edge has no id yet and the reversed shape."""
    for u, v, data in G.edges(data=True):
        yield u, v, data
        if u != v:
            back = {key: value for key, value in data.items() if key != "id"}
            for key in ("linestring", "geometry"):
                if back.get(key) is not None:
                    back[key] = geometry.read_points(back[key], f"The {key} of edge {shown(u)}-{shown(v)}")[::-1]
            yield v, u, back


def _find_edge_ids(store: GraphStore, given: list[Any]) -> IntArray:
    ids = [None if id is None else records.as_id(id, "an edge") for id in given]
    if None not in ids:
        return np.array(ids, np.int64)
    free = count(max([-1, *(id for id in ids if id is not None), *store.edges.iterate_ids()]) + 1)
    return np.array([next(free) if id is None else id for id in ids], np.int64)


def _group_by_name(rows: list[dict[Any, Any]], ours: frozenset[str]) -> dict[str, dict[int, Any]]:
    """Return the attributes of rows except `ours`, name -> row -> value."""
    columns: defaultdict[Any, dict[int, Any]] = defaultdict(dict)
    for row, data in enumerate(rows):
        if data.keys() <= ours:
            continue
        for name, value in data.items():
            if name not in ours:
                columns[name][row] = copy_value(value) if type(value) in CONTAINERS else value
    named: dict[str, dict[int, Any]] = {}
    for name, values in columns.items():
        others = named.setdefault(str(name), values)
        if others is not values:
            if not others.keys().isdisjoint(values):
                raise BadValue(f"two of its attributes have the name {str(name)!r}")
            others.update(values)
    return named
