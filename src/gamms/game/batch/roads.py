"""Which roads are open in the games of a batch: what is legal from nodes in each, and the maps that games have.

Rules close and open roads in their games alone. What is legal is looked up for all games at once; what follows from a
whole map, such as ways, is worked out for each map that is asked for, and shared by the games that have it.
"""

from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterator, Sequence
from functools import cached_property
from typing import Any, NoReturn
from weakref import WeakValueDictionary

import numpy as np

from gamms import kernels
from gamms.arguments import as_ids, as_known
from gamms.errors import BadValue, UnknownName
from gamms.game.streets import Streets
from gamms.ir.graph import ClosedEdges, FloatArray, GraphColumns, IntArray, edge_as_given, locked_columns, with_edges
from gamms.ir.obstacles import BoolArray

_MOST_BYTES = 1 << 28  # of what is worked out for maps, but for tables of ways, which are shared among batches
_EDGE_BYTES = 200  # of that for an edge of one map; 74 measured on a grid, 200 on streets with names
_OF_NODES = ("node_ids", "xy", "node_attributes", "crs")  # columns that are the same where roads are closed
CLOSED, REMOVED = 1, 2  # edges that are not open
_NOTHING: tuple[frozenset[int], dict[int, list[int]]] = frozenset(), {}  # has changed at the start


class NeedsOneMap(BadValue):
    """Something was asked for that differs between maps, where games have other roads closed."""


class RoadMap:
    """A map on which other roads are open than at the start.

    Args:
        roads: of all games.
        number: of the map in its batch; 0 is that of the start.
        gone: the rows of edges of the start that are not in their place here, ascending.
        opened: the rows of edges that were opened, those of the start again, which come after all others.
        closed: id -> edge, of all that are closed.

    Attributes:
        shared: what was worked out for this map; see `GameArrays`.
        nodes, choices: (patched,) the rows of the nodes from which others are legal than at the start, ascending, and
            the numbers of what is legal there; see `OpenRoads`.
        is_wider: whether roads are open that were closed at the start.
    """

    nodes: IntArray
    choices: IntArray

    def __init__(self, roads: "OpenRoads", number: int, gone: IntArray, opened: IntArray, closed: ClosedEdges) -> None:
        self._whole, self._at_start, self.number = roads.whole, len(roads.streets.columns.edge_ids), number
        self.gone, self.opened, self.closed = gone, opened, closed
        self.is_wider = bool((opened >= self._at_start).any())
        self.shared: dict[Hashable, Any] = {}
        self.world: Any = None  # of the games that have it; see `GameArrays.world`

    def forget(self) -> None:
        """Forget what was worked out; it is worked out again when it is asked for."""
        self.shared.clear()
        self.world = None
        for name in ("streets", "changes_at_nodes"):
            vars(self).pop(name, None)

    @property
    def key(self) -> Hashable:
        """What is equal for equal maps."""
        return self.gone.tobytes(), self.opened.tobytes(), tuple(self.closed)

    @property
    def rows(self) -> IntArray:
        """The rows of the edges that are open here, in their order."""
        return np.append(_others(self.gone, self._at_start), self.opened)

    @property
    def touched(self) -> IntArray:
        """The rows of the edges that are not as at the start: gone from their place, or opened."""
        return np.union1d(self.gone, self.opened) if len(self.opened) else self.gone

    @cached_property
    def streets(self) -> Streets:
        """Where agents may go here."""
        return Streets(locked_columns(self.columns()), _OpenWays(self._whole, self))

    def columns(self) -> GraphColumns:
        """Return the graph."""
        columns, rows = self._whole.columns, self.rows
        offsets, out_edges = kernels.group_rows(columns.sources[rows], len(columns.node_ids))
        return with_edges(columns, rows, offsets, out_edges)

    def ranks(self, rows: IntArray) -> IntArray:
        """Return numbers that ascend as edges follow each other here; -1: an edge is not open."""
        is_there = (rows < self._at_start) & (kernels.rows_of(self.gone, rows) < 0)
        found = np.where(is_there, rows, -1)
        if not len(self.opened):
            return found
        place = kernels.rows_of(self.opened, rows, np.argsort(self.opened, kind="stable"))
        return np.where(place >= 0, len(self._whole.columns.edge_ids) + place, found)

    @cached_property
    def changes_at_nodes(self) -> tuple[frozenset[int], dict[int, list[int]]]:
        """The rows of the edges that are gone, and row of a node -> those that were opened there, in their order."""
        opened = dict[int, list[int]]()
        for edge in self.opened.tolist():
            opened.setdefault(self._whole.columns.sources.item(edge), []).append(edge)
        return frozenset(self.gone.tolist()), opened


def _others(rows: IntArray, size: int) -> IntArray:
    """Return the rows below `size` that are not among some, ascending."""
    is_other = np.ones(size, np.bool_)
    is_other[rows] = False
    return np.flatnonzero(is_other)


class _OpenWays:
    """The ways of a map on which other roads are open."""

    def __init__(self, whole: Streets, roads: RoadMap) -> None:
        self._whole, self._roads = whole, roads

    def weights(self, weight: str | None) -> FloatArray:
        """Return what each edge costs, (edges,)."""
        return self._whole.weights(weight)[self._roads.rows]

    def arcs(self, weight: str | None = "length", *, reverse: bool = False) -> kernels.Arcs:
        """Return the edges with their weights."""
        columns, rows = self._whole.columns, self._roads.rows
        ends = (columns.targets, columns.sources) if reverse else (columns.sources, columns.targets)
        return kernels.make_arcs(ends[0][rows], ends[1][rows], self.weights(weight), len(columns.node_ids))

    def neighborhoods(self) -> tuple[IntArray, IntArray]:
        """Return the nodes that each node has an open edge to, itself first, as offsets (nodes + 1,) and rows."""
        columns, rows = self._whole.columns, self._roads.rows
        return kernels.neighborhoods(columns.sources[rows], columns.targets[rows], len(columns.node_ids))


class OpenRoads:
    """The roads of all games of a batch.

    Edges have the rows of `whole`, which are those of the start where they were open then. What is legal for agents on
    nodes has a number, a *choice*: that of the node where the map is as it is at the start, and one above where other
    nodes are legal.

    Args:
        streets: of the map at the start.
        whole: of the map on which those are open, too, that were closed then, behind all others.
        closed: the edges that were.
        games: how many there are.

    Attributes:
        streets, whole: as given.
        number: (games,) the number of the map of each; 0: that of the start.
        are_closed: whether that is not so in all games.
        are_wider: (games,) whether roads are open that were closed at the start.
        changes: (games,) how often roads were closed or opened.
        shared: what was worked out for all maps, and follows from none alone.
    """

    def __init__(self, streets: Streets, whole: Streets, closed: ClosedEdges, games: int) -> None:
        self.streets, self.whole, self._closed, self.are_closed = streets, whole, closed, False
        self.number, self.changes = np.zeros((2, games), np.int64)
        self.are_wider = np.zeros(games, np.bool_)
        self._maps: list[RoadMap | None] = [None] * games
        self._known: WeakValueDictionary[Hashable, RoadMap] = WeakValueDictionary()
        self._used: OrderedDict[int, RoadMap] = OrderedDict()
        self._last = 0  # the number of the last map that was made
        self._nodes, self._at_start = streets.num_nodes, len(streets.columns.edge_ids)
        self._numbers: dict[tuple[int, ...], int] = {}  # what is legal, the own node first -> the choice
        self._first, self._count = list[int](), list[int]()  # of these choices, in `_flat`
        self._flat: list[int] = []
        self._arrays: tuple[IntArray, IntArray, IntArray] | None = None
        self._order: IntArray | None = None
        self.shared: dict[Hashable, Any] = {}
        self.changes_in_all = 0
        self._choices = ValuesOfMaps(self, self._nodes, _legal_on)
        self._states = ValuesOfMaps(self, len(whole.columns.edge_ids), self._states_on)

    def use(self, roads: RoadMap) -> None:
        """Note that a map is asked for what is worked out for it; those that were not for longest forget it."""
        self._used[roads.number] = roads
        self._used.move_to_end(roads.number)
        while len(self._used) > max(1, _MOST_BYTES // (_EDGE_BYTES * (1 + len(self.streets.columns.edge_ids)))):
            self._used.popitem(last=False)[1].forget()

    def of(self, game: int) -> RoadMap | None:
        """Return the map of a game; None: it is that of the start."""
        return self._maps[game]

    def put(self, games: IntArray, roads: RoadMap | None) -> None:
        """Let games have a map."""
        self.changes[games] += 1
        if roads is None and not self.are_closed:
            return
        for game in games.tolist():
            self._maps[game] = roads
        self.number[games] = 0 if roads is None else roads.number
        self.are_wider[games] = roads is not None and roads.is_wider
        self.changes_in_all += 1
        self.are_closed = bool(self.number.any())

    def checkpoint(self) -> Callable[[], None]:
        """Return what lets all games have again the maps that they have now."""
        maps, columns = [*self._maps], (self.number, self.changes, self.are_wider)
        copies = [column.copy() for column in columns]

        def undo() -> None:
            self._maps[:] = maps
            for column, values in zip(columns, copies, strict=True):
                column[:] = values
            self.are_closed = bool(self.number.any())
            self.changes_in_all += 1

        return undo

    def by_map(self, games: IntArray) -> Iterator[tuple[RoadMap | None, IntArray]]:
        """Yield the maps that some games have, and the places of those that have each."""
        number = self.number[games]
        for one in np.unique(number).tolist():
            places = np.flatnonzero(number == one)
            yield self._maps[int(games[places[0]])], places

    # -- columns ----------------------------------------------------------------------------------------------------

    @property
    def no_columns(self) -> IntArray:
        """What `columns` returns where all games have the map of the start; it takes no memory."""
        return np.broadcast_to(np.int32(0), (len(self.number), len(self.whole.columns.edge_ids)))

    def columns(self) -> IntArray:
        """Return which roads are open, (games, edges): 0 as at the start, 1 closed since, -k the k-th to be opened."""
        found = self.no_columns.copy()
        for roads, games in self.by_map(np.arange(len(self.number))):
            if roads is not None:
                found[games[:, None], roads.gone] = 1
                found[games[:, None], roads.opened] = -1 - np.arange(len(roads.opened))
        return found

    def of_columns(self, columns: IntArray) -> Iterator[tuple[RoadMap | None, IntArray]]:
        """Yield the maps that games have by such columns, and the games that have each."""
        games, ids = dict[bytes, list[int]](), self.whole.columns.edge_ids
        for game, row in enumerate(columns):
            games.setdefault(row.tobytes(), []).append(game)
        for those in games.values():
            row, roads = columns[those[0]], None
            opened = np.flatnonzero(row < 0)
            for edges, is_open in (
                (np.flatnonzero(row[: self._at_start]), False),
                (opened[np.argsort(-row[opened], kind="stable")], True),
            ):
                if len(edges):
                    roads = self.changed(roads, ids[edges].tolist(), is_open=is_open)
            yield roads, np.array(those)

    # -- maps -------------------------------------------------------------------------------------------------------

    def map_with(self, edge_ids: IntArray, closed: ClosedEdges) -> RoadMap | None:
        """Return the map with these edges, in their order; None: it is that of the start.

        Raises:
            BadValue: one is opened that was closed at the start while another edge had its id.
        """
        return self._map_of(self._rows_of(edge_ids), closed)

    def _map_of(self, rows: IntArray, closed: ClosedEdges) -> RoadMap | None:
        opened = np.array([id for id in self._closed if id not in closed], np.int64)
        if (self._rows_of(opened) < self._at_start).any():
            raise BadValue("it opens roads that were closed at the start, and whose ids other edges had")
        is_later = (np.diff(rows, prepend=-1) < 0) | (rows >= self._at_start)
        in_place = int(is_later.argmax()) if is_later.any() else len(rows)
        return self._map(_others(rows[:in_place], self._at_start), rows[in_place:], closed)

    def _map(self, gone: IntArray, opened: IntArray, closed: ClosedEdges) -> RoadMap | None:
        if not len(gone) and not len(opened) and [*closed] == [*self._closed]:
            return None
        roads = RoadMap(self, self._last + 1, gone, opened, closed)
        known = self._known.get(roads.key)
        if known is None:
            self._last += 1
            known = self._known[roads.key] = roads
            legal = self._legal_elsewhere(roads)
            roads.nodes = np.array([*legal], np.int64)
            roads.choices = np.array([self._choice(one) for one in legal.values()], np.int64)
        return known

    def changed(self, roads: RoadMap | None, edges: Sequence[int], *, is_open: bool) -> RoadMap | None:
        """Return a map on which roads, ids of edges, are closed or opened, too, as `ctx.graph` does it.

        Raises:
            UnknownName (KeyError): there is no such edge, or it is not closed.
            BadValue: see `map_with`.
        """
        ids, columns = [*dict.fromkeys(as_ids(edges, "edges"))], self.whole.columns
        closed = dict(self._closed if roads is None else roads.closed)
        rows = self._rows_of(np.array(ids, np.int64))
        if is_open:
            for id in ids:
                closed.pop(as_known(id, "closed edge", closed))
            there = np.arange(self._at_start) if roads is None else roads.rows
            return self._map_of(np.append(there, rows), closed)
        rank = self.ranks_on(roads, rows)
        for id, row, one in zip(ids, rows.tolist(), rank.tolist(), strict=True):
            if row < 0 or one < 0:
                raise UnknownName("edge", id)
        closed |= {int(columns.edge_ids[row]): _edge_of(columns, row) for row in rows[np.argsort(rank)].tolist()}
        if roads is None or not len(roads.opened):
            return self._map(np.union1d(rows if roads is None else roads.gone, rows), rows[:0], closed)
        return self._map_of(roads.rows[np.isin(roads.rows, rows, invert=True)], closed)

    def _rows_of(self, edge_ids: IntArray) -> IntArray:
        known = self.whole.columns.edge_ids
        if self._order is None:
            self._order = np.argsort(known, kind="stable")
        return kernels.rows_of(known, edge_ids, self._order)

    def ranks_on(self, roads: RoadMap | None, rows: IntArray) -> IntArray:
        """Return what `RoadMap.ranks` does; None: on the map of the start."""
        return np.where(rows < self._at_start, rows, -1) if roads is None else roads.ranks(rows)

    # -- edges ------------------------------------------------------------------------------------------------------

    def _states_on(self, roads: RoadMap | None) -> tuple[IntArray, IntArray]:
        """Return the edges that are not open on a map, and of each whether it was closed or removed."""
        rows, closed = self.not_open_on(roads), self._closed if roads is None else roads.closed
        are_closed = [id in closed for id in self.whole.columns.edge_ids[rows].tolist()]
        return rows, np.where(np.array(are_closed, np.bool_), CLOSED, REMOVED)

    def not_open_on(self, roads: RoadMap | None) -> IntArray:
        """Return the rows of the edges that are not open on a map, ascending; None: on that of the start."""
        later = np.arange(self._at_start, len(self.whole.columns.edge_ids))
        return later if roads is None else np.setdiff1d(np.append(roads.gone, later), roads.opened)

    def states(self, edges: IntArray, games: IntArray) -> IntArray:
        """Return whether edges, by rows, are not open in games, which broadcast with them: `CLOSED`, `REMOVED`, or 0.

        That of the row -1, which is none, is 0.
        """
        if self.are_all_open:
            return np.zeros(np.broadcast_shapes(edges.shape, games.shape), np.int64)
        return np.where(edges >= 0, self._states.at(np.maximum(edges, 0), games, 0), 0)

    def are_open(self, edge_ids: IntArray, games: IntArray) -> BoolArray:
        """Return which edges, by their ids, are open in games, of one shape; those that are not on the map are not."""
        rows = self._rows_of(edge_ids)
        found: BoolArray = (rows >= 0) & (self.states(rows, games) == 0)
        return found

    @property
    def are_all_open(self) -> bool:
        """Whether no edge is closed in any game."""
        return not self.are_closed and self.whole is self.streets

    def are_next(self, node: IntArray, targets: IntArray, games: IntArray) -> BoolArray:
        """Return which nodes are legal from others, (pairs,), in games."""
        if not self.are_closed:
            return self.streets.action_to(node, targets) >= 0
        ends, rows = self.legal_of(node, games)
        counts = np.diff(ends)
        is_it = rows == np.repeat(targets, counts)
        return np.bincount(np.repeat(np.arange(len(node)), counts)[is_it], minlength=len(node)) > 0

    # -- what is legal ----------------------------------------------------------------------------------------------

    def open_from(self, node: int, roads: RoadMap | None) -> list[int]:
        """Return the rows of the edges that are open from a node on a map, in order; None: on that of the start."""
        columns, (gone, opened) = self.whole.columns, (_NOTHING if roads is None else roads.changes_at_nodes)
        edges = columns.out_edges[columns.offsets[node] : columns.offsets[node + 1]].tolist()
        return [*(edge for edge in edges if edge < self._at_start and edge not in gone), *opened.get(node, ())]

    def legal_from(self, node: int, roads: RoadMap | None) -> tuple[int, ...]:
        """Return the rows of the legal nodes from a node on a map, the own first; None: on that of the start."""
        targets = self.whole.columns.targets
        return tuple(dict.fromkeys((node, *map(targets.item, self.open_from(node, roads)))))

    def _legal_elsewhere(self, roads: RoadMap) -> dict[int, tuple[int, ...]]:
        """Return the nodes from which others are legal than at the start, ascending, and what is legal there."""
        streets, found = self.streets, dict[int, tuple[int, ...]]()
        for node in np.unique(self.whole.columns.sources[roads.touched]).tolist():
            legal = self.legal_from(node, roads)
            if legal != tuple(streets.targets[streets.offsets[node] : streets.offsets[node + 1]].tolist()):
                found[node] = legal
        return found

    def _choice(self, legal: tuple[int, ...]) -> int:
        """Return the number of what is legal."""
        number = self._numbers.get(legal)
        if number is None:
            number = self._numbers[legal] = self._nodes + len(self._numbers)
            self._first.append(len(self._flat))
            self._count.append(len(legal))
            self._flat += legal
            self._arrays = None
        return number

    def choices(self, node: IntArray, games: IntArray) -> IntArray:
        """Return the choices of agents that are on these nodes, in these games, which broadcast to the nodes."""
        return self._choices.at(node, games, node)

    def _table(self) -> tuple[IntArray, IntArray, IntArray]:
        if self._arrays is None:
            self._arrays = np.array(self._first), np.array(self._count), np.array(self._flat)
        return self._arrays

    def counts(self, choices: IntArray) -> IntArray:
        """Return how many nodes are legal."""
        others = np.nonzero(choices >= self._nodes)
        if not len(others[0]):
            return self.streets.counts_of(choices).astype(np.int64)
        number, choices = choices[others] - self._nodes, choices.copy()
        choices[others] = 0
        found: IntArray = self.streets.counts_of(choices).astype(np.int64)
        found[others] = self._table()[1][number]
        return found

    def ends(self, choices: IntArray, actions: IntArray) -> IntArray:
        """Return the rows of legal nodes by their numbers."""
        choices, actions = np.broadcast_arrays(choices, actions)
        others = np.nonzero(choices >= self._nodes)
        if not len(others[0]):
            return self.streets.ends_of(choices, actions)
        number, chosen, known, steps = choices[others] - self._nodes, actions[others], choices.copy(), actions.copy()
        known[others] = steps[others] = 0
        found = self.streets.ends_of(known, steps)
        first, _, flat = self._table()
        found[others] = flat[first[number] + chosen]
        return found

    def legal_of(self, node: IntArray, games: IntArray) -> tuple[IntArray, IntArray]:
        """Return the legal nodes from some nodes in games as offsets (nodes + 1,) and rows, one after the other."""
        choices = self.choices(node, games)
        counts = self.counts(choices)
        ends = np.concatenate((np.zeros(1, np.int64), np.cumsum(counts)))
        return ends, self.ends(np.repeat(choices, counts), np.arange(ends[-1]) - np.repeat(ends[:-1], counts))


def _edge_of(columns: GraphColumns, row: int) -> dict[str, Any]:
    given = {name: of[row] for name, of in columns.edge_attributes.items() if row in of}
    ends = columns.node_ids.item(columns.sources[row]), columns.node_ids.item(columns.targets[row])
    return edge_as_given(columns.edge_ids.item(row), ends, columns.lengths.item(row), columns.polylines.get(row), given)


def _legal_on(roads: RoadMap | None) -> tuple[IntArray, IntArray]:
    none = np.zeros(0, np.int64)
    return (none, none) if roads is None else (roads.nodes, roads.choices)


class ValuesOfMaps:
    """Numbers of nodes or edges on maps, where they are others than at the start.

    Args:
        roads: of all games.
        size: how many nodes or edges there are.
        find: returns the rows for which a map has others, ascending, and the numbers; None: the map of the start.
    """

    def __init__(
        self, roads: OpenRoads, size: int, find: Callable[[RoadMap | None], tuple[IntArray, IntArray]]
    ) -> None:
        self._roads, self._size, self._find = roads, size, find
        self._made_for = -1
        self._of_map: dict[int, tuple[IntArray, IntArray]] = {}  # of those that games have
        self._keys, self._values = np.zeros((2, 0), np.int64)  # by the number of the map and the row, ascending

    def _make(self) -> None:
        number, first = np.unique(self._roads.number, return_index=True)
        known, self._of_map = self._of_map, {}
        for one, game in zip(number.tolist(), first.tolist(), strict=True):
            self._of_map[one] = known.get(one) or self._find(self._roads.of(game))
        keys = [one * self._size + rows for one, (rows, _) in self._of_map.items()]
        self._keys = np.concatenate([np.zeros(0, np.int64), *keys])
        self._values = np.concatenate([np.zeros(0, np.int64), *(values for _, values in self._of_map.values())])
        self._made_for = self._roads.changes_in_all

    def at(self, rows: IntArray, games: IntArray, otherwise: IntArray | int) -> IntArray:
        """Return the numbers of rows in games, of one shape; `otherwise` where they are as at the start."""
        if self._made_for != self._roads.changes_in_all:
            self._make()
        if not len(self._keys):
            return otherwise if isinstance(otherwise, np.ndarray) else np.full(rows.shape, otherwise)
        keys = self._roads.number[games] * self._size + rows
        places = np.minimum(np.searchsorted(self._keys, keys), len(self._keys) - 1)
        return np.where(self._keys[places] == keys, self._values[places], otherwise)


# -- where maps differ ------------------------------------------------------------------------------------------------


def refuse_several_maps(what: str) -> NoReturn:
    """Refuse to say what differs between maps."""
    raise NeedsOneMap(
        f"{what} differs between these games, in which other roads are closed: ask for games with the same roads, by "
        "view.in_games(which)."
    )


class _NodesAlone:
    """The columns of maps that differ in their edges."""

    def __init__(self, columns: GraphColumns) -> None:
        self._columns = columns

    def __getattr__(self, name: str) -> Any:
        if name not in _OF_NODES:
            refuse_several_maps(f"streets.columns.{name}")
        return getattr(self._columns, name)


class StreetsOfMaps(Streets):
    """The nodes of maps that differ in the roads that are open; it refuses to say where these lead.

    Attributes:
        whole: the streets of the map on which all roads are open that were at the start.
    """

    def __init__(self, whole: Streets) -> None:
        self.whole = whole
        vars(self).update({name: value for name, value in vars(whole).items() if name not in _OF_ROADS})
        self.columns: Any = _NodesAlone(whole.columns)


_OF_ROADS = {
    *("counts", "offsets", "targets", "legal", "counts_of", "legal_of", "step", "ends_of", "action_to", "_narrow"),
    *("ways", "ways_to", "weights", "apart"),
}


def _refusing(name: str) -> property:
    return property(lambda _: refuse_several_maps(f"streets.{name}"))


for _name in _OF_ROADS:
    setattr(StreetsOfMaps, _name, _refusing(_name))
