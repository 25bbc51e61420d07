"""The road network as columns, for kernels and drawers; and ids of its nodes that callers pass."""

import json
from abc import abstractmethod
from collections.abc import Callable, Hashable, ItemsView, Iterator, Mapping, Sequence, ValuesView
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any, Protocol, Self, TypeVar

import numpy as np

from gamms.arguments import as_ids, as_int, as_items, as_range
from gamms.errors import BadType, BadValue, UnknownName, nearest
from gamms.readonly import ReadOnlyMapping, copy_locked
from gamms.text import shown

IntArray = np.ndarray[Any, np.dtype[np.int64]]
FloatArray = np.ndarray[Any, np.dtype[np.float64]]
RowArray = np.ndarray[Any, np.dtype[np.integer[Any]]]  # row numbers of any width
ClosedEdges = Mapping[int, Mapping[str, Any]]  # id -> edge, see `make_edge_arguments`
V = TypeVar("V")

A = TypeVar("A", bound=np.ndarray[Any, Any])


def read_only(array: A) -> A:
    """Make an array read-only, and return it."""
    array.setflags(write=False)
    return array


class NodeFinder(Protocol):
    """The part of a graph that finds the nodes below flying agents."""

    @property
    def revision(self) -> int | None:
        """A number that changes with every change of the graph; None if unknown."""

    def get_nodes(self) -> Iterator[int]:
        """Return the ids of all nodes."""

    def nearest_node(self, x: float, y: float) -> int:
        """Return the id of the nearest node."""


class RowMapping(Mapping[int, V]):
    """Values of some rows of a table, as arrays: immutable, and cheap to create for a million rows.

    Attributes:
        rows: rows that have a value, ascending.
    """

    __slots__ = ("_are_all", "rows")

    def __init__(self, rows: IntArray) -> None:
        self.rows = rows
        self._are_all = len(rows) > 0 and int(rows[-1]) == len(rows) - 1

    @abstractmethod
    def get_at(self, place: int) -> V:
        """Return the value of `rows[place]`."""

    @abstractmethod
    def list_all(self) -> list[V]:
        """Return all values, in the order of the rows."""

    @abstractmethod
    def select_rows(self, places: IntArray, rows: IntArray) -> Self:
        """Return the values of `self.rows[places]` under other, ascending row numbers (places,)."""

    def get(self, row: object, default: Any = None) -> Any:
        """Return the value of a row, or the default."""
        place = self._find_index(row)
        return default if place < 0 else self.get_at(place)

    def items(self) -> ItemsView[int, V]:
        """Return (row, value) pairs."""
        return dict(zip(self.rows.tolist(), self.list_all(), strict=True)).items()

    def values(self) -> ValuesView[V]:
        """Return all values, in the order of the rows."""
        return dict(enumerate(self.list_all())).values()

    def __getitem__(self, row: int) -> V:
        place = self._find_index(row)
        if place < 0:
            raise KeyError(row)
        return self.get_at(place)

    def __contains__(self, row: object) -> bool:
        return self._find_index(row) >= 0

    def __iter__(self) -> Iterator[int]:
        return iter(self.rows.tolist())

    def __len__(self) -> int:
        return len(self.rows)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({len(self)} rows)"

    def _find_index(self, row: object) -> int:
        """Return the index of a row in `rows`, or -1."""
        if not isinstance(row, (int, np.integer)):
            return -1
        if self._are_all:
            return int(row) if 0 <= row < len(self.rows) else -1
        place = int(self.rows.searchsorted(row))
        return place if place < len(self.rows) and self.rows[place] == row else -1


class CodedValues(RowMapping[Any]):
    """An attribute of some rows; rows with equal values share one object.

    Args:
        rows: rows that have the attribute, ascending.
        codes: (rows,) index of the value of each row.
        choices: the distinct values.
    """

    __slots__ = ("choices", "codes")

    def __init__(self, rows: IntArray, codes: IntArray, choices: Sequence[Any]) -> None:
        super().__init__(rows)
        self.codes = codes
        self.choices = choices

    def get_at(self, place: int) -> Any:
        """Return the value of `rows[place]`."""
        return self.choices[self.codes[place]]

    def list_all(self) -> list[Any]:
        """Return all values, in the order of the rows."""
        return list(map(self.choices.__getitem__, self.codes.tolist()))

    def select_rows(self, places: IntArray, rows: IntArray) -> Self:
        """Return the values of `self.rows[places]` under other row numbers."""
        return type(self)(rows, self.codes[places], self.choices)

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.rows, self.codes, self.choices)


class Polylines(RowMapping[FloatArray]):
    """The shapes of edges that are not straight, in one array.

    Args:
        rows: rows of these edges, ascending.
        starts: (rows,) the first edge has the points `points[starts[0] : ends[0]]`.
        ends: (rows,)
        points: (points, 2), read-only.
    """

    __slots__ = ("ends", "points", "starts")

    def __init__(self, rows: IntArray, starts: IntArray, ends: IntArray, points: FloatArray) -> None:
        super().__init__(rows)
        self.starts = starts
        self.ends = ends
        self.points = points

    def get_at(self, place: int) -> FloatArray:
        """Return the points of `rows[place]`."""
        return self.points[self.starts[place] : self.ends[place]]

    def list_all(self) -> list[FloatArray]:
        """Return the points of all rows, in the order of the rows."""
        points = self.points
        return [points[start:end] for start, end in zip(self.starts.tolist(), self.ends.tolist(), strict=True)]

    def find_among(self, rows: RowArray) -> list[tuple[int, FloatArray]]:
        """Return (index in `rows`, polyline) of the rows (rows,) that have a polyline."""
        if not len(self.rows):
            return []
        places = np.minimum(np.searchsorted(self.rows, rows), len(self.rows) - 1)
        found = np.flatnonzero(self.rows[places] == rows)
        return [(i, self.get_at(place)) for i, place in zip(found.tolist(), places[found].tolist(), strict=True)]

    def select_rows(self, places: IntArray, rows: IntArray) -> Self:
        """Return the polylines of `self.rows[places]` under other row numbers."""
        return type(self)(rows, self.starts[places], self.ends[places], self.points)

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.rows, self.starts, self.ends, self.points)


@dataclass(frozen=True, eq=False)
class GraphColumns:
    """One revision of a graph; all arrays are read-only.

    Rows are in insertion order. The edges leaving node row `i` are the edge rows
    `out_edges[offsets[i]:offsets[i + 1]]`, in insertion order.
    """

    node_ids: IntArray  # (nodes,)
    xy: FloatArray  # (nodes, 2)  map units, metres for road networks
    edge_ids: IntArray  # (edges,)
    sources: IntArray  # (edges,)  node rows
    targets: IntArray  # (edges,)  node rows
    lengths: FloatArray  # (edges,)
    offsets: IntArray  # (nodes + 1,)
    out_edges: IntArray  # (edges,)  edge rows, grouped by source
    polylines: Mapping[int, FloatArray]  # edge row -> (points, 2), for the edges that are not straight
    node_attributes: Mapping[str, Mapping[int, Any]]  # name -> node row -> value
    edge_attributes: Mapping[str, Mapping[int, Any]]  # name -> edge row -> value
    revision: int
    crs: str | None

    @cached_property
    def node_order(self) -> IntArray:
        """The rows of nodes by ascending id, for `kernels.rows_of`."""
        return read_only(np.argsort(self.node_ids, kind="stable"))

    @cached_property
    def edge_order(self) -> IntArray:
        """The rows of edges by ascending id, for `kernels.rows_of`."""
        return read_only(np.argsort(self.edge_ids, kind="stable"))


def lock_columns(columns: GraphColumns) -> GraphColumns:
    """Return columns for strategies, which cannot write to their memory."""
    changed: dict[str, Any] = {
        field.name: copy_locked(value)
        for field in fields(columns)
        if isinstance(value := getattr(columns, field.name), np.ndarray)
    }
    for name in ("node_attributes", "edge_attributes"):
        changed[name] = ReadOnlyMapping({key: _lock_rows(one) for key, one in getattr(columns, name).items()})
    found = replace(columns, **changed, polylines=_lock_rows(columns.polylines))
    for name in ("node_order", "edge_order"):
        vars(found)[name] = copy_locked(getattr(columns, name))
    return found


def _lock_rows(values: Mapping[int, Any]) -> Mapping[int, Any]:
    if isinstance(values, Polylines):
        return Polylines(
            copy_locked(values.rows), copy_locked(values.starts), copy_locked(values.ends), copy_locked(values.points)
        )
    if isinstance(values, CodedValues):
        return CodedValues(copy_locked(values.rows), copy_locked(values.codes), tuple(values.choices))
    return values if isinstance(values, RowMapping) else ReadOnlyMapping(values)


def make_edge_arguments(
    id: int, ends: tuple[int, int], length: float, line: FloatArray | None, attributes: Mapping[str, Any]
) -> dict[str, Any]:
    """Return an edge in the form of `add_edge`: with the ids of its ends, a polyline or None, and other attributes."""
    shape = {} if line is None else {"linestring": line}
    return {**attributes, "id": id, "source": ends[0], "target": ends[1], "length": length, **shape}


def pick_edges(columns: GraphColumns, rows: IntArray, offsets: IntArray, out_edges: IntArray) -> GraphColumns:
    """Return a graph with a selection of its edges, in another order.

    Args:
        columns: columns of the graph.
        rows: (chosen,) rows of the selected edges.
        offsets: (nodes + 1,) see `GraphColumns`.
        out_edges: (chosen,) see `GraphColumns`.
    """
    moved = np.full(len(columns.edge_ids), -1)
    moved[rows] = np.arange(len(rows))
    of_edges = {name: _renumber_rows(values, moved) for name, values in columns.edge_attributes.items()}
    return replace(
        columns,
        edge_ids=read_only(columns.edge_ids[rows]),
        sources=read_only(columns.sources[rows]),
        targets=read_only(columns.targets[rows]),
        lengths=read_only(columns.lengths[rows]),
        offsets=read_only(offsets),
        out_edges=read_only(out_edges),
        polylines=_renumber_rows(columns.polylines, moved),
        edge_attributes={name: values for name, values in of_edges.items() if values},
    )


def as_mode(value: object) -> str | None:
    """Return the name of the edge attribute that says which edges a mode may use; None for no mode: all edges.

    Args:
        value: the name of a mode of the map, or `{"attribute": name}`, or None. With `"turns": True` beside the
            attribute, agents of the mode obey the turn restrictions of the map; the name then says so, see
            `split_mode`.

    Raises:
        BadType: the value has another form.
    """
    if value is None:
        return None
    name = value
    ending = ""
    if isinstance(value, Mapping) and "attribute" in value and {*value} <= {"attribute", "turns"}:
        name = value["attribute"]
        turns = value.get("turns", False)
        if not isinstance(turns, bool):
            raise BadType(f"'turns' of mode= must be True or False, not {shown(turns)}.")
        ending = _WITH_TURNS if turns else ""
    if isinstance(name, str):
        return name + ending
    raise BadType(
        f"mode= is the name of a mode of the map, such as 'drive', or {{'attribute': name}} of an edge attribute, also "
        f"with 'turns': True, not {shown(value)}."
    )


_WITH_TURNS = " with turns"


def split_mode(mode: str) -> tuple[str, bool]:
    """Return the edge attribute of a mode, and whether its agents obey turn restrictions: "drive with turns"."""
    attribute = mode.removesuffix(_WITH_TURNS)
    return attribute, attribute != mode


def find_usable_edges(columns: GraphColumns, mode: str) -> "np.ndarray[Any, np.dtype[np.bool_]]":
    """Return which edges the agents of a mode may use, (edges,): where the attribute is true, or a number above 0.

    This is the one place that says so; edges without the attribute may not be used.

    Args:
        columns: the graph.
        mode: the name of an edge attribute with booleans or numbers, such as the speeds of a mode in km/h; turn
            restrictions change nothing.

    Raises:
        BadValue: a value of the attribute is neither a boolean nor a number.
    """
    mode, _ = split_mode(mode)
    found = np.zeros(len(columns.edge_ids), np.bool_)
    for row, value in columns.edge_attributes.get(mode, {}).items():
        if not isinstance(value, _MAY_PASS):
            raise BadValue(
                f"The edge attribute {mode!r} is no mode: of edge {columns.edge_ids[row]} it is {shown(value)}, and a "
                "mode has true or false, or speeds; 0 means that the edge may not be used."
            )
        found[row] = value is not None and value > 0
    return found


def check_mode(columns: GraphColumns, closed: ClosedEdges, mode: str) -> None:
    """Refuse a mode that is an attribute of no edge of a graph, closed ones included.

    Raises:
        UnknownName (KeyError): no edge has the attribute; the message has the attributes that may be modes.
    """
    if mode in columns.edge_attributes or any(mode in edge for edge in closed.values() if mode not in _OWN_KEYS):
        return
    known = [name for name in columns.edge_attributes if may_be_mode(columns, name)]
    of_streets = _MODES_OF_STREETS if "highway" in columns.edge_attributes else ""
    raise UnknownName("mode", mode, sorted(known), _MODES + of_streets)


_OWN_KEYS = ("id", "source", "target", "length", "linestring")  # of closed edges, beside their attributes
_MODES = " A mode is an edge attribute with true or false, or with speeds."
_MODES_OF_STREETS = " Streets that are loaded with osm_type=['walk', 'drive'] have the modes 'walk' and 'drive'."
_MAY_PASS = (bool, int, float, np.bool_, np.number, type(None))


def may_be_mode(columns: GraphColumns, name: str) -> bool:
    """Return whether an edge attribute may be a mode, judged by its first value."""
    return isinstance(next(iter(columns.edge_attributes[name].values()), ""), _MAY_PASS)


def select_edges(columns: GraphColumns, is_chosen: "np.ndarray[Any, np.dtype[np.bool_]]") -> GraphColumns:
    """Return a graph with the edges of a mask (edges,), in the same order."""
    rows = np.flatnonzero(is_chosen)
    is_out = is_chosen[columns.out_edges]
    number = np.cumsum(is_chosen) - 1
    offsets = np.concatenate(([0], np.cumsum(is_out)))[columns.offsets]
    return pick_edges(columns, rows, offsets, number[columns.out_edges[is_out]])


def _renumber_rows(values: Mapping[int, V], moved: IntArray) -> Mapping[int, V]:
    """Renumber values by row: `moved` (rows,) has the new row, in any order; -1 for rows that are dropped."""
    old = values.rows if isinstance(values, RowMapping) else np.fromiter(values, np.int64, len(values))
    rows = moved[old]
    places = np.flatnonzero(rows >= 0)
    places = places[np.argsort(rows[places])]
    if isinstance(values, RowMapping):
        return values.select_rows(places, rows[places])
    return {row: values[one] for row, one in zip(rows[places].tolist(), old[places].tolist(), strict=True)}


def name_mode_time(mode: str) -> str:
    """Return the name of the edge attribute with the travel times of a mode, on maps for several modes."""
    return f"travel_time:{mode}"


def apply_mode(columns: GraphColumns, mode: str) -> GraphColumns:
    """Return a graph whose edges have the attributes of a mode, so that it reads as a map for this mode alone.

    The attribute `travel_time:drive` replaces `travel_time` for the mode `drive`, on the edges that have it; any other
    attribute of the form `name:mode` does the same. On maps for several modes, whose edges have the travel times of
    modes, the speeds of the mode replace `speed_kph`, too.

    Args:
        columns: the graph, with all its edges or with those of the mode.
        mode: the name of an edge attribute; turn restrictions, see `split_mode`, change nothing here.
    """
    mode, _ = split_mode(mode)
    given = columns.edge_attributes
    ending = f":{mode}"
    own = {name.removesuffix(ending): values for name, values in given.items() if name.endswith(ending)}
    if name_mode_time(mode) in given and "speed_kph" in given and mode in given:
        own["speed_kph"] = given[mode]
    replaced = {name: _put(given.get(name, {}), values) for name, values in own.items() if name not in _OWN_KEYS}
    return replace(columns, edge_attributes={**given, **replaced}) if replaced else columns


def _put(values: Mapping[int, Any], others: Mapping[int, Any]) -> Mapping[int, Any]:
    """Return the values of rows, replaced by other values where there are some, by ascending row."""
    if len(others) >= len(values) and set(values).issubset(others):
        return others
    return _sort_rows(dict(values.items()) | dict(others.items()))


def _sort_rows(values: Mapping[int, Any]) -> Mapping[int, Any]:
    return {row: values[row] for row in sorted(values)}


# -- weights --------------------------------------------------------------------------------------------------------


def check_weight(weight: str | None) -> None:
    """Refuse a value that cannot name a weight (BadType)."""
    if weight is not None and not isinstance(weight, str):
        raise BadType(
            f"weight must be 'length', the name of an edge attribute, or None for steps, not {shown(weight)}."
        )


def find_edge_weights(columns: GraphColumns, weight: str | None) -> FloatArray:
    """Return the weight of every edge: its length, 1, or one of its attributes.

    Args:
        columns: a graph.
        weight: "length", the name of an attribute (1 for edges without it), or None (1 for every edge).

    Returns:
        (edges,) not negative; infinite for closed edges.

    Raises:
        BadType: `weight` is not a name, or an attribute value is not a number.
        BadValue: an attribute value is negative or NaN.
        UnknownName (KeyError): no edge has this attribute.
    """
    check_weight(weight)
    if weight == "length":
        return columns.lengths
    known = ("length", *columns.edge_attributes)
    if weight is not None and weight not in known and len(columns.edge_ids):
        raise UnknownName("weight", weight, known)
    weights = np.ones(len(columns.edge_ids))
    given = {} if weight is None else columns.edge_attributes.get(weight, {})
    numbers = [_read_number(value, columns, row, weight) for row, value in given.items()]
    weights[list(given)] = numbers
    return weights


def _read_number(value: object, columns: GraphColumns, row: int, weight: str | None) -> float:
    if type(value) is float and value >= 0.0:
        return value
    try:
        return as_range(value, f"The weight {weight!r} of edge {columns.edge_ids[row]}")
    except (BadType, BadValue) as error:
        of_modes = [name for name in columns.edge_attributes if name.startswith(f"{weight}:")]
        if of_modes:
            error.add_note(f"For agents of a mode, {' or '.join(map(repr, of_modes))} replaces {weight!r}.")
        raise


# -- turns ----------------------------------------------------------------------------------------------------------

FORBIDDEN_TURNS = "forbidden_turns"  # attribute of edges: mode of travel -> lists of the ids of edges not to take next


def list_forbidden_paths(columns: GraphColumns, *, with_closed: bool = False) -> dict[str, list[tuple[int, ...]]]:
    """Return mode of travel -> the sequences of edges, by id, that are forbidden to it, from attributes of edges.

    Args:
        columns: the graph.
        with_closed: whether to return also sequences whose later edges are not all on the graph, which may be opened.

    Raises:
        BadValue: an attribute has another form.
    """
    given = columns.edge_attributes.get(FORBIDDEN_TURNS, {})
    ids = columns.edge_ids.tolist()
    known = frozenset(ids)
    found: dict[str, list[tuple[int, ...]]] = {}
    for row, value in given.items():
        for mode, rests in read_forbidden_turns(value, ids[row]).items():
            paths = found.setdefault(mode, [])
            paths += [(ids[row], *rest) for rest in rests if with_closed or known.issuperset(rest)]
    return found


def read_forbidden_turns(value: object, edge_id: object) -> Mapping[str, Sequence[Sequence[int]]]:
    """Return the value of `FORBIDDEN_TURNS` of an edge, which may be JSON text, as GraphML files have it.

    Raises:
        BadValue: it has another form.
    """
    try:
        plain = json.loads(value) if isinstance(value, str) else value
    except ValueError:
        plain = None
    if isinstance(plain, Mapping) and all(isinstance(mode, str) and _are_paths(rests) for mode, rests in plain.items()):
        return plain
    raise BadValue(
        f"{FORBIDDEN_TURNS!r} of edge {shown(edge_id)} must name, for each mode of travel, lists of ids of edges that "
        f"must not follow, such as {{'drive': [[7], [8, 9]]}}, not be {shown(value)}."
    )


def _are_paths(rests: object) -> bool:
    """Return whether a value is a list of lists of whole numbers, none empty."""
    return isinstance(rests, (list, tuple)) and all(
        isinstance(rest, (list, tuple)) and len(rest) > 0 and all(type(id) is int for id in rest) for rest in rests
    )


def find_shortest_edges(columns: GraphColumns) -> dict[tuple[int, int], float]:
    """Return (source id, target id) -> length of the shortest edge between the two nodes."""
    lengths: dict[tuple[int, int], float] = {}
    ends = columns.node_ids[columns.sources].tolist(), columns.node_ids[columns.targets].tolist()
    for source, target, length in zip(*ends, columns.lengths.tolist(), strict=True):
        known = lengths.get((source, target))
        lengths[source, target] = length if known is None else min(known, length)
    return lengths


# -- ids of nodes passed by callers ---------------------------------------------------------------------------------

LABEL = "networkx_label"  # attribute with the networkx label of a node, if the label could not be its id
_WAY_OUT = "ctx.graph.networkx_labels() gives the id of each networkx label."


def list_labels(columns: GraphColumns) -> dict[Hashable, int]:
    """Return networkx label -> id, for every node whose label could not be its id."""
    return {label: int(columns.node_ids[row]) for row, label in columns.node_attributes.get(LABEL, {}).items()}


def as_node_id(value: object, name: str, graph: object = None) -> int:
    """Return the id of a node as a plain int; the error for a networkx label says where its id is.

    Args:
        value: the value.
        name: its name in messages.
        graph: the graph of the node, its engine or its store, which may have `columns()`; None: it is not known here.

    Raises:
        BadType: `value` is not an integer.
        BadValue: it does not fit into 64 bits.
    """
    try:
        return as_int(value, name)
    except BadType as error:
        raise BadType(f"{error}{label_hint(value, graph)}") from None


def as_node_ids(values: object, name: str, graph: object = None) -> list[int]:
    """Return a list of node ids, as `as_ids` does; errors are those of `as_node_id`.

    Raises:
        BadType: the value is not an iterable, or an item is not an integer.
        BadValue: an item does not fit into 64 bits.
    """
    try:
        return as_ids(values, name)
    except BadType:
        for one in as_items(values, name, "integers"):
            as_node_id(one, f"Each of {name}", graph)
        raise


def label_hint(value: object, graph: object = None) -> str:
    """Return the hint of an error message for a networkx label that was given as a node id; nothing for other values.

    Args:
        value: the value that was given.
        graph: as for `as_node_id`.
    """
    if graph is None:
        return f" {_WAY_OUT}" if isinstance(value, (str, tuple)) else ""
    columns: Callable[[], GraphColumns] | None = getattr(graph, "columns", None)
    known = {} if columns is None else list_labels(columns())
    try:
        id = known.get(value)
    except TypeError:  # not hashable
        return ""
    if id is not None:
        return f" {shown(value)} is node {id}: {_WAY_OUT}"
    return nearest(value, known) if isinstance(value, str) else ""
