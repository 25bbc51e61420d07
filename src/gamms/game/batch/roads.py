"""Which roads are open in the games of a batch: what is legal from nodes in each, and the maps that games have.

Rules close and open roads in their games alone. What is legal is looked up for all games at once; what follows from a
whole map, such as ways, is worked out for each map that is asked for, and shared by the games that have it.
"""

from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterator, Sequence
from functools import cached_property
from typing import Any, NamedTuple, NoReturn
from weakref import WeakValueDictionary

import numpy as np

from gamms import kernels
from gamms.core.contacts import NearNodes
from gamms.errors import BadValue
from gamms.game.conflicts import flat
from gamms.game.streets import StreetGraph
from gamms.ir.graph import ClosedEdges, FloatArray, GraphColumns, IntArray, locked_columns, with_edges
from gamms.ir.obstacles import BoolArray

_MOST_BYTES = 1 << 28  # of what is worked out for maps, but for tables of ways, which are shared among batches
_EDGE_BYTES = 200  # of that for an edge of one map; 74 measured on a grid, 200 on streets with names
_OF_NODES = ("node_ids", "xy", "node_attributes", "crs")  # columns that are the same where roads are closed


class NeedsOneMap(BadValue):
    """Something was asked for that differs between maps, where games have other roads closed."""


class RoadTables(NamedTuple):
    """Where agents may go in games that have several maps, one map after the other.

    Attributes:
        maps: that of the start, which is None, then those of the games.
        first: (games,) the place of the first node of the map of each.
        offsets: (maps * nodes + 1,) the legal nodes of the node at place `i` are `targets[offsets[i]:offsets[i + 1]]`.
        targets: rows of nodes.
    """

    maps: list["RoadMap | None"]
    first: IntArray
    offsets: IntArray
    targets: IntArray


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
        snapshot: the map of a context, as `ctx.graph.storage.snapshot` returns it; None: no rule has made it.
    """

    def __init__(self, roads: "OpenRoads", number: int, gone: IntArray, opened: IntArray, closed: ClosedEdges) -> None:
        self._whole, self._at_start, self.number = roads.whole, len(roads.streets.columns.edge_ids), number
        self.gone, self.opened, self.closed = gone, opened, closed
        self._arcs: dict[tuple[str | None, bool], kernels.Arcs] = {}
        self.shared: dict[Hashable, Any] = {}
        self.world: Any = None  # of the games that have it; see `GameArrays.world`
        self.snapshot: Any = None

    def forget(self) -> None:
        """Forget what was worked out; it is worked out again when it is asked for."""
        self.shared.clear()
        self.world = None
        vars(self).pop("streets", None)

    @property
    def key(self) -> Hashable:
        """What is equal for equal maps."""
        return self.gone.tobytes(), self.opened.tobytes(), tuple(self.closed)

    @property
    def rows(self) -> IntArray:
        """The rows of the edges that are open here, in their order."""
        return np.append(_others(self.gone, self._at_start), self.opened)

    @cached_property
    def legal(self) -> tuple[IntArray, IntArray]:
        """The legal nodes of each node, as offsets (nodes + 1,) and rows."""
        return _OpenRoutes(self._whole, self).neighborhoods()

    def arcs(self, weight: str | None, *, reverse: bool) -> kernels.Arcs:
        """Return the edges with their weights, those that lead to each node if `reverse`; computed once."""
        key = weight, reverse
        if key not in self._arcs:
            self._arcs[key] = _OpenRoutes(self._whole, self).arcs(weight, reverse=reverse)
        return self._arcs[key]

    @cached_property
    def streets(self) -> StreetGraph:
        """Where agents may go here."""
        return StreetGraph(locked_columns(self.columns()), _OpenRoutes(self._whole, self))

    def columns(self) -> GraphColumns:
        """Return the graph."""
        columns, rows = self._whole.columns, self.rows
        offsets, out_edges = kernels.group_rows(columns.sources[rows], len(columns.node_ids))
        return with_edges(columns, rows, offsets, out_edges)


def _others(rows: IntArray, size: int) -> IntArray:
    """Return the rows below `size` that are not among some, ascending."""
    is_other = np.ones(size, np.bool_)
    is_other[rows] = False
    return np.flatnonzero(is_other)


class _OpenRoutes:
    """The ways of a map on which other roads are open."""

    def __init__(self, whole: StreetGraph, roads: RoadMap) -> None:
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

    Edges have the rows of `whole`, which are those of the start where they were open then.

    Args:
        streets: of the map at the start.
        whole: of the map on which those are open, too, that were closed then, behind all others.
        closed: the edges that were.
        games: how many there are.

    Attributes:
        streets, whole: as given.
        number: (games,) the number of the map of each; 0: that of the start.
        are_closed: whether that is not so in all games.
        shared: what was worked out for all maps, and follows from none alone.
        searches: the searches by which rules in the core find distances along roads, each with its weight.
    """

    def __init__(self, streets: StreetGraph, whole: StreetGraph, closed: ClosedEdges, games: int) -> None:
        self.streets, self.whole, self._closed, self.are_closed = streets, whole, closed, False
        self.number = np.zeros(games, np.int64)
        self._maps: list[RoadMap | None] = [None] * games
        self._known: WeakValueDictionary[Hashable, RoadMap] = WeakValueDictionary()
        self._used: OrderedDict[int, RoadMap] = OrderedDict()
        self._last = 0  # the number of the last map that was made
        self._at_start = len(streets.columns.edge_ids)
        self._order: IntArray | None = None
        self._tables: RoadTables | None = None
        self.shared: dict[Hashable, Any] = {}
        self.searches: list[tuple[str | None, NearNodes]] = []

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
        if roads is None and not self.are_closed:
            return
        for game in games.tolist():
            self._maps[game] = roads
        self.number[games] = 0 if roads is None else roads.number
        self.are_closed = bool(self.number.any())
        self._tables = None

    def checkpoint(self) -> Callable[[], None]:
        """Return a function that takes back what rules change from now on."""
        known = self.number.copy(), [*self._maps], self.are_closed

        def undo() -> None:
            if self.are_closed or known[2]:
                self.number[:], self._maps[:], self.are_closed = known
                self._tables = None

        return undo

    def arcs_of(self, maps: Sequence[RoadMap | None], weight: str | None, *, reverse: bool) -> tuple[Any, Any, Any]:
        """Return the edges of some maps, one map after the other: offsets, rows of nodes, and weights.

        Args:
            maps: the maps.
            weight: of the edges.
            reverse: whether to return the edges that lead to each node, and not those that lead away.
        """
        at_start = self.streets.ways_to if reverse else self.streets.ways
        each = [at_start(weight) if one is None else one.arcs(weight, reverse=reverse) for one in maps]
        counts = np.concatenate([np.diff(arcs.offsets) for arcs in each])
        offsets: Any = np.concatenate(([0], np.cumsum(counts)))
        tails, weights = (
            np.concatenate(columns) for columns in zip(*((one.ends, one.weights) for one in each), strict=True)
        )
        return flat(offsets, np.int64), flat(tails, np.int64), flat(weights, np.float64)

    @property
    def tables(self) -> RoadTables:
        """Where agents may go in all games."""
        if self._tables is None:
            numbers, slots = np.unique(np.append(0, self.number), return_inverse=True)
            maps = dict(zip(self.number.tolist(), self._maps, strict=True)) | {0: None}
            several = [maps[number] for number in numbers.tolist()]
            legal = [(self.streets.offsets, self.streets.targets) if one is None else one.legal for one in several]
            counts = np.concatenate([np.diff(offsets) for offsets, _ in legal])
            offsets = np.concatenate(([0], np.cumsum(counts)))
            targets = np.concatenate([targets for _, targets in legal])
            self._tables = RoadTables(several, slots[1:] * self.streets.num_nodes, offsets, targets)
        return self._tables

    def by_map(self, games: IntArray) -> Iterator[tuple[RoadMap | None, IntArray]]:
        """Yield the maps that some games have, and the places of those that have each."""
        number = self.number[games]
        for one in np.unique(number).tolist():
            places = np.flatnonzero(number == one)
            yield self._maps[int(games[places[0]])], places

    # -- maps -------------------------------------------------------------------------------------------------------

    def are_open(self, edges: IntArray, games: IntArray) -> BoolArray:
        """Return which edges, by their ids, are open in games of these numbers, one of each for each."""
        found = np.zeros(edges.shape, np.bool_)
        for roads, places in self.by_map(games):
            columns = self.streets.columns if roads is None else roads.columns()
            found[places] = np.isin(edges[places], columns.edge_ids)
        return found

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
        return known

    def _rows_of(self, edge_ids: IntArray) -> IntArray:
        known = self.whole.columns.edge_ids
        if self._order is None:
            self._order = np.argsort(known, kind="stable")
        return kernels.rows_of(known, edge_ids, self._order)


# -- where maps differ ------------------------------------------------------------------------------------------------


def refuse_several_maps(what: str) -> NoReturn:
    """Refuse to say what differs between maps."""
    raise NeedsOneMap(
        f"{what} differs between these games, in which other roads are closed: ask for games with the same roads, by "
        "view.in_games(which)."
    )


class _NodeColumns:
    """The columns of maps that differ in their edges."""

    def __init__(self, columns: GraphColumns) -> None:
        self._columns = columns

    def __getattr__(self, name: str) -> Any:
        if name not in _OF_NODES:
            refuse_several_maps(f"streets.columns.{name}")
        return getattr(self._columns, name)


class StreetsOfMaps(StreetGraph):
    """The nodes of maps that differ in the roads that are open; it refuses to say where these lead.

    Attributes:
        whole: the streets of the map on which all roads are open that were at the start.
    """

    def __init__(self, whole: StreetGraph) -> None:
        self.whole = whole
        vars(self).update({name: value for name, value in vars(whole).items() if name not in _OF_ROADS})
        self.columns: Any = _NodeColumns(whole.columns)


_OF_ROADS = {
    *("counts", "offsets", "targets", "legal", "counts_of", "legal_of", "step", "ends_of", "action_to", "_narrow"),
    *("ways", "ways_to", "weights", "apart"),
}


def _refusing(name: str) -> property:
    return property(lambda _: refuse_several_maps(f"streets.{name}"))


for _name in _OF_ROADS:
    setattr(StreetsOfMaps, _name, _refusing(_name))
