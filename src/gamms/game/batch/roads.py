"""Which roads are open in the games of a batch: what is legal from nodes in each, and the maps that games have.

Rules close and open roads in their games alone. What is legal is looked up for all games at once; what follows from a
whole map, such as ways, is worked out for each map that is asked for, and shared by the games that have it.
"""

from collections import OrderedDict
from collections.abc import Hashable, Iterator, Mapping, Sequence
from functools import cached_property
from typing import Any, NoReturn
from weakref import WeakValueDictionary

import numpy as np

from gamms import kernels
from gamms.arguments import as_ids
from gamms.errors import BadValue, UnknownName
from gamms.game.streets import Streets
from gamms.ir.graph import FloatArray, GraphColumns, IntArray, with_edges

_MOST_BYTES = 1 << 28  # of what is worked out for maps, but for tables of ways, which are shared among batches
_EDGE_BYTES = 200  # of that for an edge of one map; 74 measured on a grid, 200 on streets with names
_OF_NODES = ("node_ids", "xy", "node_attributes", "crs")  # columns that are the same where roads are closed
ClosedEdges = Mapping[int, Mapping[str, Any]]


class NeedsOneMap(BadValue):
    """Something was asked for that differs between maps, where games have other roads closed."""


class RoadMap:
    """A map on which roads are closed, or were and are open again.

    Args:
        whole: the streets of the map on which all roads are open that were at the start.
        number: of the map in its batch; 0 is the whole one.
        gone: the rows of edges there that are not in their place here, ascending.
        opened: the rows of those of them that were opened again, which come after all others.
        closed: id -> edge, of all that are closed.

    Attributes:
        shared: what was worked out for this map; see `GameArrays`.
        nodes, choices: (patched,) the rows of the nodes from which others are legal than on the whole map, ascending,
            and the numbers of what is legal there; see `OpenRoads`.
    """

    nodes: IntArray
    choices: IntArray

    def __init__(
        self, whole: Streets, number: int, gone: Sequence[int], opened: Sequence[int], closed: ClosedEdges
    ) -> None:
        self._whole, self.number, self.gone, self.opened, self.closed = whole, number, gone, opened, closed
        self.shared: dict[Hashable, Any] = {}
        self.world: Any = None  # of the games that have it; see `GameArrays.world`

    def forget(self) -> None:
        """Forget what was worked out; it is worked out again when it is asked for."""
        self.shared.clear()
        self.world = None
        vars(self).pop("streets", None)

    @property
    def key(self) -> Hashable:
        """What is equal for equal maps."""
        return tuple(self.gone), tuple(self.opened), tuple(self.closed)

    @property
    def rows(self) -> IntArray:
        """The rows on the whole map of the edges that are open here, in their order."""
        is_there = np.ones(len(self._whole.columns.edge_ids), np.bool_)
        is_there[list(self.gone)] = False
        return np.append(np.flatnonzero(is_there), np.array(self.opened, np.int64))

    @cached_property
    def streets(self) -> Streets:
        """Where agents may go here."""
        return Streets(self.columns(), _OpenWays(self._whole, self))

    def columns(self) -> GraphColumns:
        """Return the graph."""
        columns, rows = self._whole.columns, self.rows
        offsets, out_edges = kernels.group_rows(columns.sources[rows], len(columns.node_ids))
        return with_edges(columns, rows, offsets, out_edges)

    def find_legal(self) -> dict[int, tuple[int, ...]]:
        """Return the nodes from which others are legal than on the whole map, ascending, and what is legal there."""
        columns, streets = self._whole.columns, self._whole
        gone, later, found = set(self.gone), dict[int, list[int]](), dict[int, tuple[int, ...]]()
        for edge in self.opened:
            later.setdefault(int(columns.sources[edge]), []).append(edge)
        for node in np.unique(columns.sources[list(self.gone)]).tolist():
            edges = columns.out_edges[columns.offsets[node] : columns.offsets[node + 1]].tolist()
            ways = [edge for edge in edges if edge not in gone] + later.get(node, [])
            legal = tuple(dict.fromkeys([node, *columns.targets[ways].tolist()]))
            if legal != tuple(streets.targets[streets.offsets[node] : streets.offsets[node + 1]].tolist()):
                found[node] = legal
        return found


class _OpenWays:
    """The ways of a map on which roads are closed."""

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


class OpenRoads:
    """The roads of all games of a batch.

    What is legal for agents on nodes has a number, a *choice*: that of the node where the map is as it is at the start,
    and one above where other nodes are legal.

    Args:
        streets: of the map at the start.
        closed: the edges that are closed there.
        games: how many there are.

    Attributes:
        streets: as given.
        number: (games,) the number of the map of each; 0: all roads are open that were at the start.
        are_closed: whether that is not so in all games.
        shared: what was worked out for all maps, and follows from none alone.
    """

    def __init__(self, streets: Streets, closed: ClosedEdges, games: int) -> None:
        self.streets, self._closed, self.are_closed = streets, closed, False
        self.number = np.zeros(games, np.int64)
        self._maps: list[RoadMap | None] = [None] * games
        self._known: WeakValueDictionary[Hashable, RoadMap] = WeakValueDictionary()
        self._used: OrderedDict[int, RoadMap] = OrderedDict()
        self._last = 0  # the number of the last map that was made
        self._nodes = len(streets.columns.node_ids)
        self._numbers: dict[tuple[int, ...], int] = {}  # what is legal, the own node first -> the choice
        self._first, self._count = list[int](), list[int]()  # of these choices, in `_flat`
        self._flat: list[int] = []
        self._arrays: tuple[IntArray, IntArray, IntArray] | None = None
        self._keys: IntArray | None = None  # of games and nodes from which others are legal, ascending
        self._choice_of = np.zeros(0, np.int64)  # of these
        self._order: IntArray | None = None
        self.shared: dict[Hashable, Any] = {}

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
        for game in games.tolist():
            self._maps[game] = roads
        self.number[games], self._keys = 0 if roads is None else roads.number, None
        self.are_closed = bool(self.number.any())

    def by_map(self, games: IntArray) -> Iterator[tuple[RoadMap | None, IntArray]]:
        """Yield the maps that some games have, and the places of those that have each."""
        number = self.number[games]
        for one in np.unique(number).tolist():
            places = np.flatnonzero(number == one)
            yield self._maps[int(games[places[0]])], places

    # -- maps -------------------------------------------------------------------------------------------------------

    def map_with(self, edge_ids: IntArray, closed: ClosedEdges) -> RoadMap | None:
        """Return the map with these edges, in their order, of those that are there at the start; None: that is it.

        Raises:
            BadValue: there are others.
        """
        rows, ids = self._rows_of(edge_ids), self.streets.columns.edge_ids
        if (rows < 0).any():
            raise BadValue("it opens roads that were closed at the start")
        falls = np.flatnonzero(np.diff(rows) < 0)
        in_place = int(falls[0]) + 1 if len(falls) else len(rows)
        is_gone = np.ones(len(ids), np.bool_)
        is_gone[rows[:in_place]] = False
        return self._made(np.flatnonzero(is_gone).tolist(), rows[in_place:].tolist(), closed)

    def changed(self, roads: RoadMap | None, edges: Sequence[int], *, is_open: bool) -> RoadMap | None:
        """Return a map on which roads, ids of edges, are closed or opened, too, as `ctx.graph` does it.

        Raises:
            UnknownName (KeyError): there is no such edge, or it is not closed.
            BadValue: it was closed at the start.
        """
        ids = [*dict.fromkeys(as_ids(edges, "edges"))]
        closed = dict(self._closed if roads is None else roads.closed)
        gone, opened = ([], []) if roads is None else ([*roads.gone], [*roads.opened])
        columns = self.streets.columns
        rows: list[int] = self._rows_of(np.array(ids, np.int64)).tolist()
        if is_open:
            for id, row in zip(ids, rows, strict=True):
                if id not in closed:
                    raise UnknownName("closed edge", id, tuple(closed))
                if row < 0:
                    raise BadValue("it opens roads that were closed at the start: open those that were closed later.")
                del closed[id]
            return self._made(gone, opened + rows, closed)
        there, closing = {row: place for place, row in enumerate(opened)}, set(rows)
        are_closed = set(gone).difference(opened)
        for id, row in zip(ids, rows, strict=True):
            if row < 0 or row in are_closed:
                raise UnknownName("edge", id)
        in_order = sorted(rows, key=lambda row: (row in there, there.get(row, row)))
        closed |= {int(columns.edge_ids[row]): _edge_of(columns, row) for row in in_order}
        left = [row for row in opened if row not in closing]
        return self._made(sorted({*gone, *rows}), left, closed)

    def _rows_of(self, edge_ids: IntArray) -> IntArray:
        known = self.streets.columns.edge_ids
        if self._order is None:
            self._order = np.argsort(known, kind="stable")
        return kernels.rows_of(known, edge_ids, self._order)

    def _made(self, gone: list[int], opened: list[int], closed: ClosedEdges) -> RoadMap | None:
        """Return a map, the same object for the same."""
        if not gone and not opened:
            return None
        roads = RoadMap(self.streets, self._last + 1, gone, opened, closed)
        known = self._known.get(roads.key)
        if known is None:
            self._last += 1
            known = self._known[roads.key] = roads
            legal = roads.find_legal()
            roads.nodes = np.array([*legal], np.int64)
            roads.choices = np.array([self._choice(one) for one in legal.values()], np.int64)
        return known

    # -- what is legal ----------------------------------------------------------------------------------------------

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
        if self._keys is None:
            maps = [(game, roads) for game, roads in enumerate(self._maps) if roads is not None and len(roads.nodes)]
            self._keys = np.concatenate(
                [np.zeros(0, np.int64), *(game * self._nodes + one.nodes for game, one in maps)]
            )
            self._choice_of = np.concatenate([np.zeros(0, np.int64), *(one.choices for _, one in maps)])
        if not len(self._keys):
            return node
        keys = games * self._nodes + node
        places = np.minimum(np.searchsorted(self._keys, keys), len(self._keys) - 1)
        return np.where(self._keys[places] == keys, self._choice_of[places], node)

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
    """Return an edge as `add_edge` takes it."""
    node_ids, given = columns.node_ids, {name: of[row] for name, of in columns.edge_attributes.items() if row in of}
    ends = {"source": node_ids.item(columns.sources[row]), "target": node_ids.item(columns.targets[row])}
    shape = {"linestring": columns.polylines[row]} if row in columns.polylines else {}
    return given | {"id": columns.edge_ids.item(row), **ends, "length": columns.lengths.item(row), **shape}


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
