"""The open roads of the games of a batch: the legal nodes in each game, and the maps that result from closed roads.

A rule closes or opens roads in its own game only. Legal nodes are looked up for all games at once. Data that depend on
a whole map, such as routes, are computed on demand for each map, and shared by the games on it.
"""

from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from functools import cached_property
from typing import Any, NamedTuple, NoReturn
from weakref import WeakValueDictionary

import numpy as np

from gamms import kernels
from gamms.core.by_edges import TrafficStates, find_places
from gamms.core.contacts import NearNodes
from gamms.errors import BadValue
from gamms.game.conflicts import flatten
from gamms.game.movement.streets import StreetGraph
from gamms.game.movement.travel import EdgesAt, FollowingStates, TrafficTable, bind_states
from gamms.ir.graph import (
    ClosedEdges,
    FloatArray,
    GraphColumns,
    IntArray,
    apply_mode,
    find_edge_weights,
    find_usable_edges,
    lock_columns,
    pick_edges,
    split_mode,
)
from gamms.ir.obstacles import BoolArray

_MOST_BYTES = 1 << 28  # of data computed for maps, except route tables, which batches share
_EDGE_BYTES = 200  # of these data for an edge of one map; 74 measured on a grid, 200 on streets with names
_OF_NODES = ("node_ids", "xy", "node_attributes", "crs")  # columns that do not depend on closed roads


class DifferingRoads(BadValue):
    """A query has no single answer, because the games differ in their closed roads."""


class RoadTables(NamedTuple):
    """The legal nodes on all maps of the games, concatenated.

    Attributes:
        maps: the map of the start, which is None, then the other maps of the games; then, for each mode, the same maps
            with the edges that it may use.
        first: (games,) the index of the first node of each game's map.
        offsets: (maps * nodes + 1,) the legal nodes at index `i` are `targets[offsets[i]:offsets[i + 1]]`.
        targets: rows of nodes.
        stride: the number of nodes of the maps for one mode, or for agents without a mode.
    """

    maps: list["RoadMap | None"]
    first: IntArray
    offsets: IntArray
    targets: IntArray
    stride: int

    def find_first_costs(self, edges: int) -> IntArray:
        """Return the index of the cost of the first edge on each map, (maps,), if the costs of modes follow each other.

        Args:
            edges: the number of edges of all maps.
        """
        nodes = (len(self.offsets) - 1) // len(self.maps)
        return np.arange(len(self.maps)) * nodes // max(1, self.stride) * edges

    def find_first_nodes(self, before: Sequence["RoadMap | None"]) -> IntArray:
        """Return the index of the first node of each of some other maps, (maps,); -1: it is not among the maps."""
        nodes = (len(self.offsets) - 1) // len(self.maps)
        first = {id(one): nodes * slot for slot, one in enumerate(self.maps)}
        return np.array([first.get(id(one), -1) for one in before], np.int64)


def join_streets(maps: Sequence[StreetGraph]) -> RoadTables:
    """Return the legal nodes on several maps, each of which may have other nodes; `first` is (maps,)."""
    first = np.cumsum([0, *(one.num_nodes for one in maps[:-1])])
    offsets, targets = _join_rows([(one.offsets, one.targets) for one in maps])
    return RoadTables([None] * len(maps), first, offsets, targets, len(offsets) - 1)


class RoadMap:
    """A map whose open roads differ from the start.

    Args:
        roads: the roads of all games.
        number: the number of the map in its batch; 0 is the map of the start.
        gone: the rows of edges of the start that are missing, or have moved to `opened`, ascending.
        opened: the rows of edges that were opened, including reopened edges of the start; they follow all others.
        closed: id -> edge, for all closed edges.

    Attributes:
        mode: the number of the mode whose edges the map has, from 1; 0: all open edges.
        shared: data computed for this map; see `GameArrays`.
        of_modes: this map with the edges that each mode may use, as far as they were asked for.
        snapshot: the map of a context, as `ctx.graph.storage.snapshot` returns it; None: no rule has made it.
    """

    def __init__(self, roads: "OpenRoads", number: int, gone: IntArray, opened: IntArray, closed: ClosedEdges) -> None:
        self._whole: StreetGraph | ModeEdges = roads.whole
        self._at_start = len(roads.streets.columns.edge_ids)
        self.number = number
        self.mode = 0
        self.gone = gone
        self.opened = opened
        self.closed = closed
        self._arcs: dict[tuple[str | None, bool], kernels.Arcs] = {}
        self.shared: dict[Hashable, Any] = {}
        self.world: Any = None  # of the games on this map; see `GameArrays.make_map_data`
        self.snapshot: Any = None
        self.of_modes: dict[int, RoadMap] = {}

    def forget(self) -> None:
        """Drop the computed data; they are computed again on demand."""
        self.shared.clear()
        self.world = None
        vars(self).pop("streets", None)

    @property
    def key(self) -> Hashable:
        """A key that is equal for equal maps."""
        return self.gone.tobytes(), self.opened.tobytes(), tuple(self.closed)

    @property
    def rows(self) -> IntArray:
        """The rows of the open edges, in order."""
        return np.append(_find_other_rows(self.gone, self._at_start), self.opened)

    @cached_property
    def edges_at(self) -> EdgesAt:
        """The open edges out of each node and into each node, as offsets (nodes + 1,) and rows."""
        columns = self._whole.columns
        rows = self.rows
        nodes = len(columns.node_ids)
        leaving, entering = (kernels.group_rows(ends[rows], nodes) for ends in (columns.sources, columns.targets))
        return (leaving[0], rows[leaving[1]]), (entering[0], rows[entering[1]])

    @cached_property
    def is_open(self) -> BoolArray:
        """Whether each edge is open, (edges,)."""
        found = np.zeros(len(self._whole.columns.edge_ids), np.bool_)
        found[self.rows] = True
        return found

    @cached_property
    def is_removed(self) -> BoolArray:
        """Whether each edge is neither open nor closed, (edges,)."""
        return ~self.is_open & ~np.isin(self._whole.columns.edge_ids, [*self.closed])

    @cached_property
    def legal(self) -> tuple[IntArray, IntArray]:
        """The legal nodes of each node, as offsets (nodes + 1,) and rows."""
        return _OpenRoutes(self._whole, self).neighborhoods()

    def arcs(self, weight: str | None, *, reverse: bool) -> kernels.Arcs:
        """Return the weighted outgoing edges of each node, or the incoming ones if `reverse`; computed once."""
        key = weight, reverse
        if key not in self._arcs:
            self._arcs[key] = _OpenRoutes(self._whole, self).arcs(weight, reverse=reverse)
        return self._arcs[key]

    @cached_property
    def streets(self) -> StreetGraph:
        """The graph of this map."""
        return StreetGraph(lock_columns(self.columns()), _OpenRoutes(self._whole, self))

    def columns(self) -> GraphColumns:
        """Return the columns of this map's graph."""
        columns = self._whole.columns
        rows = self.rows
        offsets, out_edges = kernels.group_rows(columns.sources[rows], len(columns.node_ids))
        return pick_edges(columns, rows, offsets, out_edges)


class ModeEdges:
    """All edges that may be open, with the attributes of a mode.

    Args:
        columns: the graph with all roads open.
        mode: the mode.

    Attributes:
        columns: the graph with the attributes of the mode.
        may_use: (edges,) whether the mode may use each edge.
        traffic: the states of traffic, if agents of the mode obey turn restrictions; else None.
    """

    def __init__(self, columns: GraphColumns, mode: str) -> None:
        self.traffic = TrafficTable(columns, mode) if split_mode(mode)[1] else None
        self.columns = apply_mode(columns, mode)
        self.may_use = find_usable_edges(columns, mode)
        self._weights: dict[str | None, FloatArray] = {}

    def weights(self, weight: str | None) -> FloatArray:
        """Return the weight of each edge, (edges,)."""
        if weight not in self._weights:
            self._weights[weight] = find_edge_weights(self.columns, weight)
        return self._weights[weight]


class ModeMap(RoadMap):
    """A map with the edges that a mode may use, and their weights for this mode.

    Args:
        roads: the roads of all games.
        base: the map with all open edges; None: the map of the start.
        mode: the number of the mode, from 1.
    """

    def __init__(self, roads: "OpenRoads", base: RoadMap | None, mode: int) -> None:
        edges = roads.modes[mode - 1]
        may_use = edges.may_use
        at_start = len(roads.streets.columns.edge_ids)
        gone = np.zeros(0, np.int64) if base is None else base.gone
        opened = np.zeros(0, np.int64) if base is None else base.opened
        unused = np.union1d(gone, np.flatnonzero(~may_use[:at_start]))
        closed = roads.closed_at_start if base is None else base.closed
        super().__init__(roads, 0 if base is None else base.number, unused, opened[may_use[opened]], closed)
        self._whole: ModeEdges = edges
        self._base = base
        self.mode = mode

    def find_following(self, weight: str | None) -> FollowingStates:
        """Return what may follow each state of traffic; of parallel edges the cheapest by a weight comes first."""
        traffic = self._whole.traffic
        assert traffic is not None  # noqa: S101 - the agents of the mode obey turns
        key = "following", weight
        if key not in self.shared:
            self.shared[key] = traffic.find_following(self.rows, self._whole.weights(weight))
        found: FollowingStates = self.shared[key]
        return found

    @cached_property
    def is_removed(self) -> BoolArray:
        """Whether each edge is neither open nor closed, (edges,), whatever the mode may use."""
        return np.zeros(len(self._whole.columns.edge_ids), np.bool_) if self._base is None else self._base.is_removed


class TrafficOnMaps:
    """The states of traffic of the modes whose agents obey turn restrictions by edges, on the maps of all games.

    Args:
        roads: the roads of all games.
        mode_of: (agents,) the number of each agent's mode, from 1; 0: it may use all edges.
        weight: the weight by which agents choose among parallel edges.
        driven: (games, agents) see `core.by_edges.TrafficStates`.

    Attributes:
        begin_of_agent: see there.
        obeys: (agents,) whether each agent obeys turn restrictions.
        num_states: the number of states of all modes.
    """

    def __init__(self, roads: "OpenRoads", mode_of: IntArray, weight: str | None, driven: IntArray) -> None:
        self._roads = roads
        self._weight = weight
        self.driven = driven
        self._driving = driven.copy()
        self._modes = [number for number, one in enumerate(roads.modes, 1) if one.traffic is not None]
        self._tables = [one.traffic for one in roads.modes if one.traffic is not None]
        counts = [len(one.nodes) for one in self._tables]
        self.num_states = sum(counts)
        self._first = dict(zip(self._modes, np.cumsum([0, *counts[:-1]]).tolist(), strict=True))
        begins = {mode: self._first[mode] + one.begin for mode, one in zip(self._modes, self._tables, strict=True)}
        self.begin_of_agent = np.array([begins.get(mode, -1) for mode in mode_of.tolist()], np.int64)
        self.obeys: BoolArray = self.begin_of_agent >= 0
        self._mode_of = mode_of
        self._maps: tuple[RoadTables, list[memoryview]] | None = None

    def bind(self) -> TrafficStates:
        """Return the states in the form of the core, for one thread; `take_maps` has to be called."""
        return bind_states(self._tables, self.begin_of_agent, self.driven, self._driving)

    def take_maps(self, states: TrafficStates) -> None:
        """Set the legal moves on the present maps of the games."""
        tables = self._roads.tables
        if self._maps is None or self._maps[0] is not tables:
            self._maps = tables, self._join_maps(tables)
        states.take_maps(*self._maps[1])

    def _join_maps(self, tables: RoadTables) -> list[memoryview]:
        """Return what may follow states on all maps, see `TrafficStates`."""
        nodes = self._roads.streets.num_nodes
        parts: list[tuple[FollowingStates, int]] = []
        for base in tables.maps[: tables.stride // nodes]:
            for mode in self._modes:
                one = self._roads.get_mode_map(base, mode)
                assert isinstance(one, ModeMap)  # noqa: S101 - it is the map of a mode
                parts.append((one.find_following(self._weight), self._first[mode]))
        offsets, after = _join_rows([(one.offsets, one.after + first) for one, first in parts])
        kept = np.concatenate([np.where(one.kept >= 0, one.kept + first, -1) for one, first in parts])
        first_of_game = tables.first // nodes * self.num_states
        return [*map(kernels.as_buffer, (offsets, after, kept, first_of_game))]

    @cached_property
    def _states(self) -> TrafficStates:
        """The states for views."""
        return self.bind()

    @property
    def states(self) -> TrafficStates:
        """The states on the present maps, for views."""
        self.take_maps(self._states)
        return self._states

    def list_edges(
        self, which: tuple[IntArray, IntArray], node: IntArray, previous: IntArray
    ) -> tuple[IntArray, IntArray]:
        """Return the edges that agents may take next that obey turns: indices of the agents, and rows.

        All arguments are flat, see `core.by_edges.find_places`. Edges to the same node follow each other.
        """
        places = np.zeros(len(node), np.int64)
        columns = [kernels.as_buffer(one) for one in (*which, node, previous)]
        find_places(*[self.states, *columns, places.data])
        assert self._maps is not None  # noqa: S101 - `states` has taken them
        offsets, after = (np.asarray(one) for one in self._maps[1][:2])
        edges = np.concatenate([one.edges for one in self._tables])
        number, place = kernels.expand_ranges(offsets[places], offsets[places + 1])
        return number, edges[after[place]]

    def list_driven(self, game: int, agent: int) -> tuple[int, ...]:
        """Return the ids of the edges that an agent has driven, as `GameState.driven` has them; (): none."""
        driven = int(self.driven[game, agent])
        if driven < 0:
            return ()
        mode = int(self._mode_of[agent])
        rows = self._tables[self._modes.index(mode)].list_edges(driven - self._first[mode])
        return tuple(self._roads.whole.columns.edge_ids[[*rows]].tolist())

    def put_driven(self, names: Sequence[str], driven: Mapping[str, Sequence[int]]) -> None:
        """Set the edges that the agents with these names have driven in a block of one game; see `GameState.driven`."""
        for agent in np.flatnonzero(self.obeys).tolist():
            self.driven[0, agent] = self._find_driven(agent, driven.get(names[agent], ()))

    def _find_driven(self, agent: int, edges: Sequence[int]) -> int:
        """Return the edges that an agent has driven in the form of the column."""
        columns = self._roads.whole.columns
        rows = kernels.find_rows(columns.edge_ids, np.array(edges, np.int64), columns.edge_order)
        mode = int(self._mode_of[agent])
        missing = np.flatnonzero(rows < 0)
        rest = rows[missing[-1] + 1 :] if len(missing) else rows
        if not len(rest):
            return -1
        first: int = self._first[mode]
        return first + self._tables[self._modes.index(mode)].find_state(rest.tolist())


def _find_other_rows(rows: IntArray, size: int) -> IntArray:
    """Return the numbers below `size` that are not in `rows`, ascending."""
    is_other = np.ones(size, np.bool_)
    is_other[rows] = False
    return np.flatnonzero(is_other)


def _join_rows(each: Sequence[tuple[IntArray, IntArray]]) -> tuple[IntArray, IntArray]:
    """Return lists of rows, given by their offsets and rows, one after the other."""
    counts = np.concatenate([np.diff(offsets) for offsets, _ in each])
    return np.concatenate(([0], np.cumsum(counts))), np.concatenate([rows for _, rows in each])


class _OpenRoutes:
    """The weighted edges of a map whose open roads differ from the start."""

    def __init__(self, whole: StreetGraph | ModeEdges, roads: RoadMap) -> None:
        self._whole = whole
        self._roads = roads

    def weights(self, weight: str | None) -> FloatArray:
        """Return the weight of each edge, (edges,)."""
        return self._whole.weights(weight)[self._roads.rows]

    def arcs(self, weight: str | None = "length", *, reverse: bool = False) -> kernels.Arcs:
        """Return the weighted outgoing edges of each node, or the incoming ones if `reverse`."""
        columns = self._whole.columns
        rows = self._roads.rows
        ends = (columns.targets, columns.sources) if reverse else (columns.sources, columns.targets)
        return kernels.make_arcs(ends[0][rows], ends[1][rows], self.weights(weight), len(columns.node_ids))

    def neighborhoods(self) -> tuple[IntArray, IntArray]:
        """Return each node and its neighbors by open edges, itself first, as offsets (nodes + 1,) and rows."""
        columns = self._whole.columns
        rows = self._roads.rows
        return kernels.list_neighborhoods(columns.sources[rows], columns.targets[rows], len(columns.node_ids))


class OpenRoads:
    """The open roads of all games of a batch.

    Edges are rows of `whole`; edges that were open at the start have the same rows there.

    Args:
        streets: the graph at the start.
        whole: the graph with all roads open; edges that were closed at the start follow all others.
        closed: the edges that were closed at the start.
        games: the number of games.
        modes: the edges of `whole` for each mode.

    Attributes:
        streets, whole, modes: as given.
        closed_at_start: the argument `closed`.
        number: (games,) the number of each game's map; 0: the map of the start.
        are_closed: whether the map of any game differs from the start.
        differ: whether agents may use different edges, because roads are closed or agents have modes.
        shared: data computed for all maps together.
        searches: the searches by which rules in the core find distances along roads, each with its weight.
    """

    def __init__(
        self,
        streets: StreetGraph,
        whole: StreetGraph,
        closed: ClosedEdges,
        games: int,
        modes: Sequence[ModeEdges] = (),
    ) -> None:
        self.streets = streets
        self.whole = whole
        self.closed_at_start = closed
        self.modes = modes
        self._of_modes: dict[int, RoadMap] = {}  # of the map of the start; see `RoadMap.of_modes`
        self.are_closed = False
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
        """Mark a map as recently used; drop the data of the least recently used maps above the memory limit."""
        self._used[roads.number] = roads
        self._used.move_to_end(roads.number)
        while len(self._used) > max(1, _MOST_BYTES // (_EDGE_BYTES * (1 + len(self.streets.columns.edge_ids)))):
            self._used.popitem(last=False)[1].forget()

    def get_map(self, game: int) -> RoadMap | None:
        """Return the map of a game; None: the map of the start."""
        return self._maps[game]

    @property
    def differ(self) -> bool:
        """Whether agents may use different edges."""
        return self.are_closed or len(self.modes) > 0

    def get_mode_map(self, base: RoadMap | None, mode: int) -> RoadMap | None:
        """Return a map with the edges that a mode may use, by its number from 1; 0: all."""
        if mode == 0:
            return base
        known = self._of_modes if base is None else base.of_modes
        if mode not in known:
            known[mode] = ModeMap(self, base, mode)
        return known[mode]

    def put(self, games: IntArray, roads: RoadMap | None) -> None:
        """Set the map of games; None: the map of the start."""
        if roads is None and not self.are_closed:
            return
        for game in games.tolist():
            self._maps[game] = roads
        self.number[games] = 0 if roads is None else roads.number
        self.are_closed = bool(self.number.any())
        self._tables = None

    def checkpoint(self) -> Callable[[], None]:
        """Return a function that undoes all later changes of roads."""
        known = self.number.copy(), [*self._maps], self.are_closed

        def undo() -> None:
            if self.are_closed or known[2]:
                self.number[:], self._maps[:], self.are_closed = known
                self._tables = None

        return undo

    @cached_property
    def edges_at_start(self) -> EdgesAt:
        """The edges out of each node and into each node on the map of the start; see `RoadMap.edges_at`."""
        columns = self.streets.columns
        return (columns.offsets, columns.out_edges), kernels.group_rows(columns.targets, len(columns.node_ids))

    def get_edges(self, maps: Sequence[RoadMap | None]) -> EdgesAt:
        """Return the open edges out of each node and into each node, of one map after the other."""
        each = [self.edges_at_start if one is None else one.edges_at for one in maps]
        leaving, entering = (_join_rows([one[way] for one in each]) for way in (0, 1))
        return leaving, entering

    def find_removed(self, maps: Sequence[RoadMap | None]) -> np.ndarray[Any, np.dtype[np.uint8]]:
        """Return whether each edge was removed from each map, (maps * edges,); empty: none was."""
        edges = len(self.whole.columns.edge_ids)
        each = [np.zeros(edges, np.bool_) if one is None else one.is_removed for one in maps]
        found = np.concatenate(each).view(np.uint8)
        return found if found.any() else found[:0]

    def are_open_rows(self, rows: IntArray, games: IntArray) -> BoolArray:
        """Return whether each edge, given by its row in `whole`, is open in the game at the same index; not -1."""
        found = (rows >= 0) & (rows < self._at_start)
        for roads, places in self.group_by_map(games) if self.are_closed else ():
            if roads is not None:
                found[places] = (rows[places] >= 0) & roads.is_open[rows[places]]
        return found

    def join_arcs(self, maps: Sequence[RoadMap | None], weight: str | None, *, reverse: bool) -> tuple[Any, Any, Any]:
        """Return the edges of maps, concatenated: offsets, rows of nodes, and weights.

        Args:
            maps: the maps; None: the map of the start.
            weight: the edge weight.
            reverse: whether to return the incoming edges of each node instead of the outgoing ones.
        """
        at_start = self.streets.get_reversed_ways if reverse else self.streets.get_ways
        each = [at_start(weight) if one is None else one.arcs(weight, reverse=reverse) for one in maps]
        counts = np.concatenate([np.diff(arcs.offsets) for arcs in each])
        offsets: Any = np.concatenate(([0], np.cumsum(counts)))
        tails, weights = (
            np.concatenate(columns) for columns in zip(*((one.ends, one.weights) for one in each), strict=True)
        )
        return flatten(offsets, np.int64), flatten(tails, np.int64), flatten(weights, np.float64)

    @property
    def tables(self) -> RoadTables:
        """The legal nodes in all games."""
        if self._tables is None:
            numbers, slots = np.unique(np.append(0, self.number), return_inverse=True)
            maps = dict(zip(self.number.tolist(), self._maps, strict=True)) | {0: None}
            several = [maps[number] for number in numbers.tolist()]
            every = [self.get_mode_map(one, mode) for mode in range(len(self.modes) + 1) for one in several]
            legal = [(self.streets.offsets, self.streets.targets) if one is None else one.legal for one in every]
            nodes = self.streets.num_nodes
            self._tables = RoadTables(every, slots[1:] * nodes, *_join_rows(legal), len(several) * nodes)
        return self._tables

    def group_by_map(self, games: IntArray) -> Iterator[tuple[RoadMap | None, IntArray]]:
        """Yield each map of the games, and the indices of its games in `games`."""
        number = self.number[games]
        for one in np.unique(number).tolist():
            places = np.flatnonzero(number == one)
            yield self._maps[int(games[places[0]])], places

    # -- maps -------------------------------------------------------------------------------------------------------

    def are_open(self, edges: IntArray, games: IntArray) -> BoolArray:
        """Return whether each edge, given by its id, is open in the game at the same index, (edges,)."""
        found = np.zeros(edges.shape, np.bool_)
        for roads, places in self.group_by_map(games):
            columns = self.streets.columns if roads is None else roads.columns()
            found[places] = np.isin(edges[places], columns.edge_ids)
        return found

    def map_with(self, edge_ids: IntArray, closed: ClosedEdges) -> RoadMap | None:
        """Return the map with these open edges, in this order; None: the map of the start.

        Raises:
            BadValue: an edge is opened that was closed at the start, while another edge had its id; or an edge is new.
        """
        rows = self._find_rows(edge_ids)
        if (rows < 0).any():
            raise BadValue(f"edge {edge_ids[rows < 0][0]} was on no map of the games that the batch began with")
        return self._make_map(rows, closed)

    def _make_map(self, rows: IntArray, closed: ClosedEdges) -> RoadMap | None:
        opened = np.array([id for id in self.closed_at_start if id not in closed], np.int64)
        if (self._find_rows(opened) < self._at_start).any():
            raise BadValue("it opens roads that were closed at the start, and whose ids other edges had")
        is_later = (np.diff(rows, prepend=-1) < 0) | (rows >= self._at_start)
        in_place = int(is_later.argmax()) if is_later.any() else len(rows)
        return self._map(_find_other_rows(rows[:in_place], self._at_start), rows[in_place:], closed)

    def _map(self, gone: IntArray, opened: IntArray, closed: ClosedEdges) -> RoadMap | None:
        if not len(gone) and not len(opened) and [*closed] == [*self.closed_at_start]:
            return None
        roads = RoadMap(self, self._last + 1, gone, opened, closed)
        known = self._known.get(roads.key)
        if known is None:
            self._last += 1
            known = roads
            self._known[roads.key] = roads
        return known

    def _find_rows(self, edge_ids: IntArray) -> IntArray:
        known = self.whole.columns.edge_ids
        if self._order is None:
            self._order = np.argsort(known, kind="stable")
        return kernels.find_rows(known, edge_ids, self._order)


# -- where maps differ ------------------------------------------------------------------------------------------------


def refuse_several_maps(what: str) -> NoReturn:
    """Raise an error for a query whose answer differs between maps."""
    raise DifferingRoads(
        f"{what} differs between these games, in which other roads are closed, or between these agents, which have "
        "several modes: ask for games with the same roads, by view.in_games(which), and for agents of one mode."
    )


class _NodeColumns:
    """The columns of nodes of maps that differ in their edges."""

    def __init__(self, columns: GraphColumns) -> None:
        self._columns = columns

    def __getattr__(self, name: str) -> Any:
        if name not in _OF_NODES:
            refuse_several_maps(f"streets.columns.{name}")
        return getattr(self._columns, name)


class MultiMapStreets(StreetGraph):
    """The nodes of maps that differ in their open roads; queries of edges raise `DifferingRoads`.

    Attributes:
        whole: the graph at the start.
    """

    def __init__(self, whole: StreetGraph) -> None:
        self.whole = whole
        vars(self).update({name: value for name, value in vars(whole).items() if name not in _OF_ROADS})
        self.columns: Any = _NodeColumns(whole.columns)


_OF_ROADS = {
    *("counts", "offsets", "targets", "legal", "count_legal", "get_legal", "step", "find_ends", "action_to", "_narrow"),
    *("get_ways", "get_reversed_ways", "weights", "copy_without_graph"),
}


def _make_refusing_property(name: str) -> property:
    return property(lambda _: refuse_several_maps(f"streets.{name}"))


for _name in _OF_ROADS:
    setattr(MultiMapStreets, _name, _make_refusing_property(_name))
