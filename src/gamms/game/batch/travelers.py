"""Makes what the core plays games by metres with: maps, ways through a turn, and what agents do that roam."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from gamms import kernels
from gamms.core import by_metres, contacts, moves, rules, travel
from gamms.game.batch.columns import Roster
from gamms.game.batch.state import GameArrays
from gamms.game.batch.travel import ByMetres
from gamms.game.conflicts import flat
from gamms.game.travel import Reach, Trips, map_of
from gamms.ir.graph import IntArray

_MOST_LEGS = 1 << 17  # of the agents of a game, 500 bytes each
_MOST_LEGAL = 1 << 20  # nodes that are remembered as legal
_MOST_REMEMBERED = 1 << 22  # nodes on the ways of agents, 16 bytes each
_LONGEST = 256  # nodes on the way of an agent that are remembered
_BACKWARDS, _TURNS = 1, 2  # flags of legs, see `contacts.Legs`
_ROUNDED = 1e-6  # by how much more of a way agents may cover than they should
_WAYPOINTS = "memory", "random_waypoints"  # the key of what agents remember


class Waypoints(NamedTuple):
    """What agents do by `gamms.strategies.random_waypoints`, as the core plays it.

    Attributes:
        nodes: ids to draw from; None: all nodes.
        pause: for how many turns agents stay at each.
    """

    nodes: tuple[int, ...] | None
    pause: int


def most_legs(by: ByMetres) -> int:
    """Return how many legs an agent has in a turn at most: a way has each edge once."""
    lengths = np.cumsum(np.sort(by.columns.lengths))
    fastest = float(by.paces.max(initial=0.0)) * by.terms.turn_seconds * (1.0 + _ROUNDED)
    return 3 + min(int(np.searchsorted(lengths, fastest, side="right")), by.streets.num_nodes)


def why_not_by_metres(by: ByMetres, roster: Roster) -> Iterator[str]:
    """Yield what of games by metres the core cannot play, in words."""
    if by.closed or by.terms.decides_at_arrivals:
        yield "closed roads, or agents that decide at arrivals"
    if not (np.isfinite(by.terms.costs).all() and np.isfinite(by.columns.lengths).all()):
        yield "edges that are infinitely long"
    if len(roster.names) * most_legs(by) > _MOST_LEGS:
        yield "agents that may go along very many edges in a turn"


class ThreadTravel(NamedTuple):
    """What one thread plays games by metres with.

    Attributes:
        agents: as they go.
        course: how they have gone.
        tracks, legs: the columns of that, as contacts take them: nodes, times and lengths of tracks.
        most: legs of an agent.
    """

    agents: by_metres.Travelers
    course: by_metres.Course
    tracks: tuple[Any, Any, Any]
    legs: contacts.Legs
    most: int


class TravelColumns:
    """What is the same for all threads that play games by metres.

    Args:
        state: of all games.
        by: how agents go.
        deciders: what agents decide by: numbers of `gamms.core`, or `Waypoints`.
    """

    def __init__(self, state: GameArrays, by: ByMetres, deciders: list[int | Waypoints]) -> None:
        self.by = by
        self._agents = agents = len(deciders)
        rows = state.node.size
        self.most = most_legs(by)
        self.starts, self.ends = np.zeros((2, *state.node.shape), np.int64)
        roaming = [one if isinstance(one, Waypoints) else None for one in deciders]
        self.roams = np.array([one is not None for one in roaming], np.bool_)
        options = [self._options(one) for one in roaming]
        self._options_of_agents = np.concatenate(options) if options else np.zeros(0, np.int64)
        self._offsets = np.cumsum([0, *map(len, options)])
        self._waits = np.array([0 if one is None else one.pause for one in roaming], np.int64)
        self.targets = self._pauses = np.zeros((0, agents), np.int64)
        if self.roams.any():
            kept = state.keep(_WAYPOINTS, self._begin, is_new=bool(state.takes_up[self.roams].all()))
            self.targets, self._pauses = kept["target"], kept["left"]
        longest = _LONGEST if self.roams.any() else 8
        self._remembered = max(8, min(longest, _MOST_REMEMBERED // max(rows, 1)), self.most if by.is_endless else 0)
        self._goals, self._counts, self._at = np.zeros((3, rows), np.int64)
        self._goals[:] = -1
        self._nodes = np.zeros(rows * self._remembered, np.int64)
        self._far: Any = np.zeros(rows * self._remembered)
        self._back = self._map_back()
        edges = np.arange(len(by.columns.edge_ids))
        backs, ids = by.backs(edges, np.zeros_like(edges)), by.columns.edge_ids
        self._streets = np.where((backs >= 0) & (ids[backs] < ids[edges]), backs, edges)
        self._flags = _BACKWARDS * (self._streets != edges) + _TURNS * (backs >= 0)

    def _options(self, waypoints: Waypoints | None) -> IntArray:
        streets = self.by.streets
        if waypoints is None:
            return np.zeros(0, np.int64)
        return np.arange(streets.num_nodes) if waypoints.nodes is None else streets.rows(waypoints.nodes)

    def _begin(self, games: int) -> dict[str, IntArray]:
        shape = games, self._agents
        return {"target": np.full(shape, -1), "left": np.zeros(shape, np.int64)}

    def _map_back(self) -> travel.Roads:
        """Return the map with all edges turned round."""
        columns = self.by.columns
        leaving = kernels.group_rows(columns.targets, self.by.streets.num_nodes)
        turned = replace(columns, sources=columns.targets, targets=columns.sources)
        return map_of(turned, self.by.terms.costs, None, 1.0, leaving)

    def _known(self) -> travel.KnownReach:
        """Return room to remember what is legal on nodes."""
        speeds, kinds = np.unique(self.by.paces, return_inverse=True)
        tables: Any = np.zeros((2, len(speeds) * self.by.streets.num_nodes), np.int64)
        room: Any = np.empty(_MOST_LEGAL, np.int64)
        return travel.KnownReach(flat(kinds, np.int64), tables[0].data, tables[1].data, room.data)

    def travelers(self, movers: moves.Movers, events: rules.Events) -> ThreadTravel:
        """Return what one thread plays with; events get what agents cannot do."""
        by = self.by
        roads, reach = by.maps.of(None), Reach(by.streets.num_nodes)
        trips = Trips(self._agents, self.most, max(self._remembered, self.most))
        ways = travel.Ways(
            roads,
            self._back,
            reach.core,
            np.zeros(len(by.columns.edge_ids), np.uint8).data,
            self._remembered,
            self._goals.data,
            self._counts.data,
            self._at.data,
            self._nodes.data,
            self._far.data,
        )
        agents = by_metres.Travelers(
            movers,
            ways,
            self._known(),
            trips.core,
            events,
            nodes=by.streets.num_nodes,
            speeds=flat(by.paces, np.float64),
            motion=by.motion.reshape(-1).data,
            starts=self.starts.reshape(-1).data,
            ends=self.ends.reshape(-1).data,
            targets=self.targets.reshape(-1).data,
            pauses=self._pauses.reshape(-1).data,
            options=flat(self._options_of_agents, np.int64),
            offsets=flat(self._offsets, np.int64),
            waits=flat(self._waits, np.int64),
        )
        columns: Any = [*np.zeros((4, self._agents * self.most), np.int64), np.zeros(self._agents * self.most)]
        legs = [column.data for column in columns]
        tables = flat(self._streets, np.int64), flat(self._flags, np.int64)
        tracks: Any = trips.nodes.reshape(-1).data, trips.times.reshape(-1).data, trips.passed.data
        course = by_metres.Course(*[trips.core, roads, *tracks, *tables, *legs])
        parts: Any = [one.reshape(-1).data for one in (trips.begins, trips.ends, trips.since, trips.until)]
        of_legs = contacts.Legs(self.most, *[trips.legs.data, *legs[:4], *parts, legs[4]])
        return ThreadTravel(agents, course, tracks, of_legs, self.most)
