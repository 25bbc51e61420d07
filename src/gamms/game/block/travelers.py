"""Builds the columns with which the core plays games along several edges a turn, or by metres."""

from array import array
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from gamms.core import arrivals, by_edges, by_metres, contacts, moves, rules, travel
from gamms.game.block.state import GameArrays
from gamms.game.conflicts import flatten
from gamms.game.movement.arrivals import MOST_ARRIVALS, ArrivalColumns
from gamms.game.movement.courses import Courses
from gamms.game.movement.legal_moves import Movement
from gamms.game.movement.roads import RoadMap, RoadTables
from gamms.game.movement.travel import NO_ROWS, ReachableNodes, StoredPaths, TurnPaths
from gamms.ir.graph import IntArray
from gamms.kernels import as_buffer
from gamms.limits import refuse_above

_BYTES_PER_LEG = 500  # of the agents of a game
_BYTES_PER_KEPT = 80
_MOST_LEGAL = 1 << 20  # nodes that are remembered as legal
_MOST_REMEMBERED = 1 << 22  # nodes on the ways of agents, 16 bytes each
_MOST_NEAR = 1 << 17  # nodes on short ways, 16 bytes each
_LONGEST = 256  # nodes on the way of an agent that are remembered
_ROUNDED = 1e-6  # by how much more of a way agents may cover than they should
NO_LEGS = contacts.Legs(0, *[memoryview(array("q"))] * 6, *[memoryview(array("d"))] * 5)  # type: ignore[arg-type]


def count_most_legs(by: Movement) -> int:
    """Return the maximum number of legs of an agent in a turn: each edge once, unless it decides on its way."""
    fastest = float(by.paces.max(initial=0.0, where=~np.isnan(by.paces))) * by.terms.turn_seconds * (1.0 + _ROUNDED)
    if by.terms.decides_at_arrivals:
        shortest = float(by.columns.lengths.min(initial=np.inf))
        is_limited = fastest < shortest * MOST_ARRIVALS
        return 5 + (int(fastest // shortest) if is_limited else MOST_ARRIVALS)
    lengths = np.cumsum(np.sort(by.columns.lengths))
    return 3 + min(int(np.searchsorted(lengths, fastest, side="right")), by.streets.num_nodes)


def _refuse_too_long(legs: int, kept: int) -> None:
    """Refuse paths through a turn that would not fit into memory.

    Args:
        legs: the maximum number of legs of a game's agents, or of nodes that they pass.
        kept: the same for all games, if functions may ask for them.

    Raises:
        TooLarge: the paths do not fit.
    """
    refuse_above(
        _BYTES_PER_LEG * legs + _BYTES_PER_KEPT * kept,
        f"A batch whose agents may go along {legs} edges in a turn, all of a game together,",
    )


def count_most_nodes(by: Movement) -> int:
    """Return the maximum number of nodes that an agent passes in a turn, its own included."""
    return 3 + int(by.paces.max(initial=0.0, where=~np.isnan(by.paces)))


class ThreadTravel(NamedTuple):
    """Columns of one thread that plays games by metres, or along several edges a turn.

    Attributes:
        movers: the agents, and how they move.
        arrivals: the movers that decide on arrival, if they do so.
        course: the paths of the agents.
        tracks, legs: the columns of these paths for contacts.
        most: the maximum number of nodes that an agent passes.
        most_legs: the maximum number of legs of an agent.
    """

    movers: moves.OneEdgeMovers
    arrivals: arrivals.Arrivals | None
    course: rules.AgentPaths
    tracks: tuple[Any, Any, Any]
    legs: contacts.Legs
    most: int
    most_legs: int


def make_thread_in_parts(movers: moves.OneEdgeMovers, agents: int) -> ThreadTravel:
    """Return the data of one thread for games along one edge per turn, in several parts."""
    nodes: Any = np.zeros(agents * 3, np.int64).data
    times: Any = np.zeros(agents * 3).data
    lengths: Any = np.zeros(agents, np.int64).data
    course = moves.PartPaths(movers, nodes, times, lengths)
    return ThreadTravel(movers, None, course, (nodes, times, lengths), NO_LEGS, 3, 0)


def _count_remembered_nodes(rows: int) -> int:
    """Return the number of nodes of its path that each agent remembers, for a number of agents."""
    return max(8, min(_LONGEST, _MOST_REMEMBERED // max(rows, 1)))


class TravelColumns:
    """The columns that all threads share in games by metres, or along several edges per turn.

    Args:
        state: the state of all games.
        part_of: (agents,) the part of the turn in which each agent moves.
        go_by_steps: whether some agents decide by strategy steps, whose targets may be far.
        keeps_courses: whether functions are called, which may ask for the paths of agents.
        has_conflicts: whether agents may stop each other.
        before: the columns of games that followed another plan before; None: these begin.

    Attributes:
        arrivals: the columns of decisions on arrival; None: agents do not decide on arrival.
        courses: the paths of agents in all games, if functions are called.
        on_edges: the positions of agents on edges, see `rules.GameColumns`.
        ends: the start and end places of moves, as numbered in conflicts, (games, agents) each; None: nodes.
        drawn: by metres, (games, agents) how often each agent has drawn in the turn.
    """

    def __init__(
        self,
        state: GameArrays,
        part_of: IntArray,
        *,
        go_by_steps: bool,
        keeps_courses: bool,
        has_conflicts: bool,
        before: "TravelColumns | None" = None,
    ) -> None:
        by = state.movement
        self._by = by
        self._has_conflicts = has_conflicts
        self._shape = state.node.shape
        self._agents = self._shape[1]
        self._part_of = part_of
        are_in_parts = int(part_of.any())
        self._most = count_most_legs(by) + 2 * are_in_parts if by.by_metres else count_most_nodes(by) + are_in_parts
        self.on_edges: dict[str, Any] = {"edge": by.edge.reshape(-1).data, "share": by.share.reshape(-1).data}
        decides_at_arrivals = by.by_metres and by.terms.decides_at_arrivals
        self._refuse_too_long((1 + decides_at_arrivals + (by.by_metres and are_in_parts)) * keeps_courses)
        self.arrivals = ArrivalColumns(self._shape) if decides_at_arrivals and before is None else None
        self.courses = Courses(by, self._shape, self._most, part_of) if keeps_courses and before is None else None
        if before is not None:
            self.arrivals = before.arrivals
            self.courses = before.courses
        self._under_way: TurnPaths | None = None  # the paths of a turn with calls on arrival
        self._are_arriving = False
        self._maps: list[RoadMap | None] = [None]  # see `RoadTables`
        self._walks: list[by_edges.EdgePaths] = []  # of each thread, by edges
        self._traffic: list[by_edges.TrafficStates] = []  # of each thread, if agents by edges obey turns
        self._roads: list[travel.RoadEdges] = []  # of each thread, by metres
        self._travelers: list[by_metres.MetreMovers] = []  # of each thread, by metres
        self._at_arrivals: list[arrivals.Arrivals] = []  # of each thread, by metres
        rows = state.node.size
        edges_at = by.all_roads.edges_at_start
        costs = by.costs if by.by_metres else np.asarray(by.whole.weights("length"), np.float64)
        self._ways = StoredPaths(by.columns, costs, rows if go_by_steps else 0, _count_remembered_nodes(rows), edges_at)
        self._paths = [self._ways]  # all that are stored
        self.ends: tuple[IntArray, IntArray] | None = None
        if by.by_metres:
            starts, ends = np.zeros((2, *self._shape), np.int64)
            self.ends = starts, ends
            self.drawn = np.zeros(self._shape, np.int64)
            if before is not None and before.ends is not None:
                self.ends = before.ends
                self.drawn = before.drawn
            self._longest_route = max(self._ways.most, self._most)
            self._longest = max(8, self._most if by.is_endless else 0)
            self._slots = 1 << max(6, (_MOST_NEAR // self._longest).bit_length() - 1)
        else:
            self._hops = StoredPaths(by.columns, np.ones(len(by.columns.edge_ids)), rows, 8, edges_at)
            self._paths.append(self._hops)

    def take_roads(self, tables: RoadTables, streets: moves.LegalMoves) -> None:
        """Set the open roads of each game for moves and paths."""
        moved = tables.find_first_nodes(self._maps)
        self._maps = tables.maps
        all_roads = self._by.all_roads
        edges_at = all_roads.get_edges(self._maps)
        have_costs = self._by.by_metres and len(self._by.modes) > 0
        first_costs = tables.find_first_costs(len(self._by.columns.edge_ids)) if have_costs else NO_ROWS
        for paths in self._paths:
            paths.take_maps(edges_at, moved, first_costs)
        for walks in self._walks:
            walks.take(streets)
        for states in self._traffic:
            self._by.traffic.take_maps(states)  # type: ignore[union-attr] # there are some
        if self._roads:
            removed = as_buffer(all_roads.find_removed(self._maps))
            offsets, edges = map(as_buffer, edges_at[0])
            for roads in self._roads:
                roads.take(offsets, edges, as_buffer(first_costs))
                roads.note_removed(removed)

    def _refuse_too_long(self, kept: int) -> None:
        """Refuse paths that would not fit into memory, given the number of copies for all games."""
        rows = self._shape[0] * self._shape[1]
        _refuse_too_long(self._agents * self._most, rows * self._most * kept)

    def begin_arrivals(self) -> None:
        """Keep the paths of the last turns until those of this part of a turn, with calls on arrival, are finished."""
        if self._under_way is None:
            self._refuse_too_long(2)
            self._under_way = TurnPaths(self._shape[0] * self._shape[1], self._most, 0)
        self.courses = self.courses or Courses(self._by, self._shape, self._most, self._part_of)
        self._are_arriving = True
        self._give_paths()

    def end_arrivals(self) -> None:
        """Write paths to those of the last turns again."""
        self._are_arriving = False
        self._give_paths()

    def _give_paths(self) -> None:
        """Tell all threads to which memory they write paths."""
        last = None if self.courses is None else self.courses.trips
        written = self._under_way if self._are_arriving else last
        for travelers, at_arrivals in zip(self._travelers, self._at_arrivals, strict=True):
            if written is not None:
                travelers.take_paths(written.bind_thread(self._longest_route), has_all=True)
            at_arrivals.keep_last(last.core if self._are_arriving and last is not None else None)

    def _make_legal_cache(self) -> travel.LegalCache:
        """Return memory for the legal nodes that a thread remembers."""
        speeds, kinds = np.unique(self._by.paces, return_inverse=True)
        tables: Any = np.zeros((2, len(speeds) * self._by.streets.num_nodes), np.int64)
        room: Any = np.empty(_MOST_LEGAL, np.int64)
        return travel.LegalCache(flatten(kinds, np.int64), tables[0].data, tables[1].data, room.data)

    def get_thread(self, movers: tuple[Any, ...], columns: Mapping[str, Any], events: rules.Events) -> ThreadTravel:
        """Return the data of one thread.

        Args:
            movers: the positional arguments of `moves.OneEdgeMovers`.
            columns: its keyword arguments.
            events: receives illegal actions.
        """
        if not self._by.by_metres:
            return self._make_thread_by_edges(movers, columns)
        return self._make_thread_by_metres(movers, columns, events)

    def _make_thread_by_edges(self, movers: tuple[Any, ...], columns: Mapping[str, Any]) -> ThreadTravel:
        by = self._by
        most = self._most
        reach = ReachableNodes(by.streets.num_nodes)
        local = TurnPaths(self._agents, most - 1, most)
        trips = local.core if self.courses is None else self.courses.trips.bind_thread(most)
        walks = by_edges.EdgePaths(trips, by.streets.core, self._hops.get_plain_ways(reach))
        self._walks.append(walks)
        long_ways: travel.GoalPaths | None = None
        if columns["by_steps"] is not None:
            long_ways = self._ways.get_plain_ways(reach)
            columns["by_steps"].go_far(long_ways)
        with_turns: by_edges.LegalWithTurns | None = None
        if by.traffic is not None:
            self._traffic.append(by.traffic.bind())
            with_turns = by_edges.LegalWithTurns(self._traffic[-1], reach.core)
        speeds = flatten(by.paces, np.float64)
        has_all = self.courses is not None
        walkers = by_edges.EdgeMovers(walks, long_ways, with_turns, *movers, speeds=speeds, has_all=has_all, **columns)
        tracks = local.core.nodes, local.core.times, local.core.passed
        return ThreadTravel(walkers, None, moves.TripPaths(walkers, local.core), tracks, NO_LEGS, most, 0)

    def _make_thread_by_metres(
        self, movers: tuple[Any, ...], columns: Mapping[str, Any], events: rules.Events
    ) -> ThreadTravel:
        by = self._by
        most = self._most
        assert self.ends is not None  # noqa: S101 - by metres
        roads = by.make_map()
        reach = ReachableNodes(by.streets.num_nodes)
        ways = self._ways.get_ways(roads, reach)
        near = self._ways.copy_with_room(self._slots, self._longest)
        self._roads.append(roads)
        self._paths.append(near)
        if columns["by_steps"] is not None:
            columns["by_steps"].go_far(ways)
        trips = TurnPaths(self._agents, most, self._longest_route)
        courses = self.courses
        travelers = by_metres.MetreMovers(
            ways,
            near.get_ways(roads, reach),
            self._make_legal_cache(),
            events,
            trips.core if courses is None else courses.trips.bind_thread(self._longest_route),
            *movers,
            slots=self._slots,
            nodes=by.streets.num_nodes,
            speeds=flatten(by.paces, np.float64),
            motion=by.motion.reshape(-1).data,
            start_places=self.ends[0].reshape(-1).data,
            end_places=self.ends[1].reshape(-1).data,
            drawn=self.drawn.reshape(-1).data,
            most_edges=1 if by.terms.decides_at_arrivals else travel.UNLIMITED,
            has_all=courses is not None,
            **columns,
        )
        legs: list[Any] = [column.data for column in np.zeros((5, self._agents * most), np.int64)]
        metres: Any = np.zeros(self._agents * most).data
        edge_ids = flatten(by.columns.edge_ids, np.int64)
        tracks: Any = trips.nodes.reshape(-1).data, trips.times.reshape(-1).data, trips.passed.data
        parts: Any = [one.reshape(-1).data for one in (trips.begins, trips.ends, trips.since, trips.until)]
        of_legs = contacts.Legs(most, *[trips.legs.data, *legs, *parts, metres])
        course = by_metres.MetrePaths(travelers, trips.core, roads, edge_ids, of_legs)
        at_arrivals = None
        if self.arrivals is not None:
            at_arrivals = self.arrivals.get_thread(travelers, has_end=self._has_conflicts)
            self._travelers.append(travelers)
            self._at_arrivals.append(at_arrivals)
            self._give_paths()
        return ThreadTravel(travelers, at_arrivals, course, tracks, of_legs, most + 1, most)
