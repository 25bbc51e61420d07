"""Travel by metres in many games at once: where agents are on edges, and what they cover in a turn.

`gamms.core.travel` says how each agent goes; here is what strategies of arrays decide, and the columns of games.
"""

from collections.abc import Iterable, Sequence
from functools import cached_property
from typing import Any, Self

import numpy as np

from gamms.core import travel as core
from gamms.game.batch import reach
from gamms.game.batch.movement import (
    AIMS,
    ENDLESS,
    LIMITED,
    STOP,
    Illegal,
    Legs,
    Movement,
    Moves,
    Paths,
    Places,
)
from gamms.game.batch.reach import Choices, Maps, TravelTerms
from gamms.game.batch.roads import RoadMap
from gamms.game.moves import SHORT
from gamms.game.streets import Streets
from gamms.game.travel import Trips, no_way, one_way
from gamms.ir.graph import ClosedEdges, FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.ir.progress import Motion, Progress

_FIRST_ROOM = 4  # legs of an agent in a turn
_ALONG = 1 << 62  # actions from here on lead to an end of an edge, and along it; see `ByMetres.along`


class ByMetres(Movement):
    """Agents that are anywhere on edges, and go as far in a turn as their speeds in metres say.

    Args:
        streets: of the map.
        speeds: of the agents in the order of the roster; None: along one edge in a turn.
        terms: by what they travel.
        whole, closed: see `Movement`.

    Attributes:
        paces: (agents,) speeds; NaN: along one edge in a turn.
        edge: (games, agents) the rows of the edges that agents are on; -1: they are on their nodes.
        share: (games, agents) of the edge that is behind them.
        motion: (games, agents) how they move there, see `ir.progress.Motion`.
        now: (games,) of the turn, from 0 to 1: when the agents that are asked decide.
        room: for how many legs of an agent there is room in a turn.
    """

    is_plain, leaves_nodes, has_aims = False, True, True
    remembers = ("edge", "share", "motion")
    idle = STOP

    def __init__(
        self,
        streets: Streets,
        speeds: Sequence[float | None],
        terms: TravelTerms,
        whole: Streets | None = None,
        closed: ClosedEdges | None = None,
    ) -> None:
        super().__init__(streets, whole, closed)
        self.terms, self.turn_seconds = terms, terms.turn_seconds
        self._is_paced = np.array([speed is not None for speed in speeds], np.bool_)
        self._speeds = np.array([1.0 if speed is None else speed for speed in speeds])
        self.paces = np.where(self._is_paced, self._speeds, np.nan)
        self._kinds, self._kind_of = np.unique(self.paces, return_inverse=True)
        self._is_endless = np.isinf(self._kinds) & (terms.seconds is None)  # by which they go any distance in a turn
        self.room = _FIRST_ROOM
        self.begin((0, len(speeds)))

    @cached_property
    def maps(self) -> Maps:
        """The maps of the games."""
        return Maps(self.all_roads, self.terms)

    @cached_property
    def _choices(self) -> Choices:
        return Choices(self.maps, self._kinds, goes_on=self.terms.decides_at_arrivals)

    def on(self, roads: RoadMap) -> Self:
        """Return how the same agents go in games that have a map of their own."""
        _ = self._choices, self.lines  # which all maps share
        return super().on(roads)

    def begin(self, shape: tuple[int, int]) -> None:
        """Reserve memory for so many games and agents, all of which are on nodes."""
        super().begin(shape)
        for name in ("maps", "_choices"):
            vars(self).pop(name, None)
        self.edge, self.share, self.motion = np.full(shape, -1), np.zeros(shape), np.zeros(shape, np.int64)
        self.now = np.zeros(shape[0])

    def clear(self, games: Any, agents: Any = np.s_[:]) -> None:
        """Let agents be on their nodes."""
        self.edge[games, agents], self.share[games, agents] = -1, 0.0

    def put_on(self, games: IntArray, agent: int, place: Progress) -> None:
        """Let an agent be on an edge in some games."""
        self.edge[games, agent] = np.flatnonzero(self.columns.edge_ids == place.edge)[0]
        self.share[games, agent], self.motion[games, agent] = place.share, place.motion

    def take_out(self, games: IntArray, agents: IntArray) -> None:
        """Let agents that are out of the game be where they are."""

    def left_of(self, moves: Moves) -> Iterable[tuple[Any, Any]]:
        """Return where on edges agents are, and how they move there."""
        columns = self.edge, self.share, self.motion
        return zip(columns, (*moves.progress, moves.as_paths().motion), strict=True)

    def is_going(self, games: IntArray) -> BoolArray:
        """Return which agents of games where agents decide at arrivals are on their way, and are not asked now."""
        which = games[:, None], np.arange(self.edge.shape[1])
        edge, motion = self.on_edge(which), self.motion[which]
        may_go = (motion != Motion.BACK) | (self.backs(edge, which[0]) >= 0)
        going: BoolArray = (edge >= 0) & (motion != Motion.STOPPED) & may_go & self.terms.decides_at_arrivals
        return going

    def ends(self, moves: Moves) -> tuple[IntArray | None, IntArray]:
        """Return the places where moves begin and end: nodes, and behind them edges."""
        nodes, paths = self.streets.num_nodes, moves.as_paths()
        begun, ended = moves.before[0], moves.progress[0]
        if paths.legs is not None and paths.edge is not None:  # those on closed edges that are not asked stay off them
            begun, ended = np.where((paths.legs.edge >= 0).any(axis=-1), begun, -1), paths.edge
        pairs = (moves.starts, begun), (moves.ends, ended)
        starts, ends = (np.where(edge >= 0, nodes + edge, node) for node, edge in pairs)
        return starts, ends

    def backs(self, edges: IntArray, games: IntArray) -> IntArray:
        """Return the rows of the edges by which one turns round on others, -1 among them, in games; -1: none."""
        return self.maps.backs(edges, games)

    @property
    def is_endless(self) -> bool:
        """Whether an agent goes any distance in a turn."""
        return bool(self._is_endless.any())

    # -- legal nodes ----------------------------------------------------------------------------------------------

    def choices(self, node: IntArray, which: tuple[IntArray, IntArray]) -> IntArray:
        """Return the numbers of the choices of agents."""
        edge, games = np.broadcast_to(self.on_edge(which), node.shape), np.broadcast_to(which[0], node.shape)
        kind = np.broadcast_to(self._kind_of[which[1]], node.shape)
        left = np.broadcast_to(1.0 - self.now[which[0]], node.shape)
        found, on_node = np.zeros(node.shape, np.int64), np.nonzero(edge < 0)
        found[on_node] = self._choices.on_nodes(node[on_node], kind[on_node], left[on_node], games[on_node])
        on = np.nonzero(edge >= 0)
        if len(on[0]):
            which = games[on], np.broadcast_to(which[1], node.shape)[on]
            speed, now = self._kinds[kind[on]], self.now[which[0]]
            places = reach.Places(node[on], edge[on], self.share[which], self.motion[which], speed, now)
            found[on] = self._choices.on_edges(places, which[0])
        return found

    def counts(self, choices: IntArray) -> IntArray:
        """Return how many nodes are legal."""
        return self._choices.counts(choices)

    def nodes(self, choices: IntArray, actions: IntArray) -> IntArray:
        """Return the rows of legal nodes by their numbers."""
        return self._choices.nodes(choices, actions)

    def most_legal(self, limit: int) -> int:
        """Return how many nodes are legal at most."""
        return self._choices.most(limit)

    # -- what strategies decide -----------------------------------------------------------------------------------

    def towards(
        self, node: IntArray, targets: IntArray, which: tuple[IntArray, IntArray], allowed: BoolArray | None = None
    ) -> IntArray:
        """Return the actions that lead agents towards nodes; -1: no path."""
        games, agents = which
        has_speed, table, edge = self._is_paced[agents], self.ways("length"), self.on_edge(which)
        found = np.full(node.shape, -1)
        found[~has_speed] = table.actions(node[~has_speed], targets[~has_speed], allowed, at=games[~has_speed])
        stopped = np.flatnonzero(~has_speed & (edge >= 0) & (found >= 0))  # just before a node, by a conflict
        if len(stopped):
            those = games[stopped], agents[stopped]
            found[stopped] = AIMS + self._next_legal(node[stopped], targets[stopped], those, allowed)
        has_path, on = np.isfinite(table.distances(node, targets, at=games)), edge >= 0
        if allowed is not None:
            some = np.flatnonzero(has_speed & has_path)
            found[some] = self._as_far_as_allowed(node[some], targets[some], (games[some], agents[some]), allowed)
            return found
        has_path[on] |= np.isfinite(table.distances(self.columns.targets[edge[on]], targets[on], at=games[on]))
        return np.where(has_speed, np.where(has_path, AIMS + targets, -1), found)

    def _next_legal(
        self, node: IntArray, targets: IntArray, which: tuple[IntArray, IntArray], allowed: BoolArray | None
    ) -> IntArray:
        """Return targets that are legal, and of the others as far as the nodes of the shortest path are legal."""
        choices, table, goes_on = self.choices(node, which), self.ways("length"), np.ones(len(node), np.bool_)
        found = np.where(self.action_to(choices, targets) >= 0, targets, node)
        while goes_on.any():
            ahead = table.following(found, targets, at=which[0])
            goes_on &= (found != targets) & (self.action_to(choices, ahead) >= 0)
            goes_on &= True if allowed is None else allowed[ahead]
            found = np.where(goes_on, ahead, found)
        return found

    def _as_far_as_allowed(
        self, node: IntArray, targets: IntArray, which: tuple[IntArray, IntArray], allowed: BoolArray
    ) -> IntArray:
        """Return the actions that lead to targets that are legal, and to others along nodes of the shortest path."""
        table, limit, at = self.ways("length"), np.zeros(len(node), np.int64), node
        is_legal = self.action_to(self.choices(node, which), targets) >= 0
        goes_on = ~is_legal & (node != targets)
        while goes_on.any():
            at = np.where(goes_on, table.following(at, targets, at=which[0]), at)
            goes_on &= allowed[at]
            limit += goes_on
            goes_on &= at != targets
        return np.where(is_legal, AIMS + targets, np.where(limit > 0, AIMS * (LIMITED + limit) + targets, AIMS + node))

    def first_nodes(self, node: IntArray, actions: IntArray, which: tuple[IntArray, IntArray]) -> IntArray:
        """Return the nodes that agents name first who decide such actions; -1: none."""
        edge, ends = self.on_edge(which), self.columns.targets
        named = np.where(actions == STOP, np.where(edge < 0, node, -1), actions % AIMS)
        found = np.where(actions < _ALONG, named, np.where(actions % 2 > 0, node, ends[edge]))
        some = np.flatnonzero((actions >= AIMS * LIMITED) & (actions < _ALONG))
        found[some] = self.ways("length").following(node[some], found[some], at=which[0][some])
        some = np.flatnonzero(actions < STOP)
        found[some] = self.nodes(self.choices(node[some], (which[0][some], which[1][some])), actions[some])
        return found

    def places(self, node: IntArray, which: tuple[IntArray, IntArray]) -> Places:
        """Return where agents are."""
        columns, edge, share = self.columns, self.on_edge(which), self.share[which]
        xy, ids = columns.xy[node].copy(), np.full((*node.shape, 3), -1)
        on = np.nonzero(edge >= 0)
        rows = edge[on]
        ends = columns.node_ids[columns.sources[rows]], columns.node_ids[columns.targets[rows]]
        ids[on] = np.column_stack((*ends, columns.edge_ids[rows]))
        xy[on] = np.column_stack(self.lines.at(rows, share[on])[:2])
        return Places(ids, self.offsets(which), xy)

    def offsets(self, which: tuple[IntArray, IntArray]) -> FloatArray:
        """Return how far along their edges agents are, map units."""
        edge = self.on_edge(which)
        return np.where(edge >= 0, self.share[which] * self.columns.lengths[edge], 0.0)

    def along(self, starts: IntArray, ends: IntArray, is_from_node: BoolArray) -> IntArray:
        """Return the actions that lead to the start of an edge, and along it.

        Args:
            starts: rows of the nodes that the edges lead from.
            ends: likewise, to.
            is_from_node: whether the way begins at the node that was passed last; else at the end of the agent's edge.
                None of them is that of the agent's edge, or the one back: there it goes towards one of its ends.
        """
        return _ALONG + 2 * (starts * self.streets.num_nodes + ends) + is_from_node

    # -- moves ----------------------------------------------------------------------------------------------------

    def moves(self, node: IntArray, actions: IntArray, games: IntArray) -> Moves:
        """Return where actions lead, of all agents of some games."""
        trip = Trip(self, node, games)
        trip.decide(np.arange(node.size), actions.ravel())
        rows = np.flatnonzero(trip.goes)
        trip.travel(rows, trip.first_nodes(rows))
        return trip.moves()


class Trip:
    """The ways of all agents of some games through a turn.

    Agents are numbered from 0, game by game. Each goes from node to node until the turn is over or it is at its goal.

    Args:
        by: how they go.
        node: rows, (games, agents).
        games: the numbers of the games.

    Attributes:
        columns: where the agents are, and what they cover.
        goes: which agents set off.
        illegal: actions that could not be done.
    """

    def __init__(self, by: ByMetres, node: IntArray, games: IntArray) -> None:
        self._by, self._shape, self._games = by, node.shape, np.repeat(games, node.shape[1])
        self._agents = np.tile(np.arange(node.shape[1]), len(games))
        self._starts, self._before = node.ravel(), by.edge[games].ravel()
        self._begun, self._from = by.on_edge((self._games, self._agents)), by.share[games].ravel()
        self._is_paced, number = by._is_paced[self._agents], len(self._starts)
        self._is_endless = by._is_endless[by._kind_of[self._agents]]
        self.columns = columns = Trips(number, by.room)
        columns.node[:], columns.edge[:], columns.motion[:] = self._starts, self._begun, by.motion[games].ravel()
        columns.share[:] = np.where(self._begun >= 0, self._from, 0.0)
        columns.speed[:] = np.where(self._is_paced, by._speeds[self._agents], np.nan)
        columns.passed[:], columns.nodes[:, 0] = 1, self._starts
        self._goal, self._last = np.full((2, number), -1)  # nodes; the last one is next to the goal
        self._by_length = np.zeros(number, np.bool_)  # whether the way is the shortest by length
        self._motion = np.full(number, int(Motion.FORWARD))  # on the edges where the agents are
        self.goes = np.zeros(number, np.bool_)
        self.illegal: list[Illegal] = []

    # -- where to -------------------------------------------------------------------------------------------------

    def decide(self, rows: IntArray, actions: IntArray) -> None:
        """Work out which way some agents set off, by what they have decided."""
        by = self._by
        self._goal[rows] = self._last[rows] = -1
        self._set_out(rows, np.full(len(rows), int(Motion.FORWARD)), ENDLESS)
        self.goes[rows] = self._by_length[rows] = False
        some = actions < STOP
        chosen = rows[some]
        if len(chosen):
            who = self._games[chosen], self._agents[chosen]
            self._aim(chosen, by.nodes(by.choices(self.columns.node[chosen], who), actions[some]))
        some = (actions >= AIMS) & (actions < AIMS * LIMITED)
        self._aim(rows[some], actions[some] - AIMS)
        some = (actions >= AIMS * LIMITED) & (actions < _ALONG)
        self._follow_for(rows[some], *np.divmod(actions[some] - AIMS * LIMITED, AIMS))
        some = actions >= _ALONG
        self._follow(rows[some], actions[some] - _ALONG)

    def go_on(self, rows: IntArray, motion: IntArray) -> None:
        """Let agents go on along their edges, whose motion this is."""
        self.goes[rows] = True
        self._set_out(rows, motion, ENDLESS)

    def _set_out(self, rows: IntArray, motion: IntArray, most: IntArray | int) -> None:
        """Let agents set out so on the edges where they are, to go along so many edges at most."""
        goes_on = self._is_paced[rows] & (not self._by.terms.decides_at_arrivals)
        self._motion[rows], self.columns.pace[rows] = motion, -1.0
        self.columns.left[rows] = np.where(goes_on, most, 1)

    def _aim(self, rows: IntArray, targets: IntArray) -> None:
        """Let agents go towards nodes; those on an edge by the shorter way."""
        by, edge, node = self._by, self.columns.edge[rows], self.columns.node[rows]
        self._goal[rows], self.goes[rows] = targets, targets != node
        on = np.flatnonzero(edge >= 0)
        if not len(on):
            return
        rows, targets, here, end, games = (
            rows[on],
            targets[on],
            node[on],
            by.columns.targets[edge[on]],
            self._games[rows[on]],
        )
        table, motion = by.ways(by.terms.weight), np.empty(len(on), np.int64)
        far = [table.distances(start, targets, at=games) for start in (end, here)]
        for roads, some in by.maps.each(games):
            found = np.empty(len(rows[some]), np.int64)
            given: Any = [np.ascontiguousarray(column[some]).data for column in (rows, targets, *far)]
            core.head_each(*[roads, self.columns.core, *given, found.data])
            motion[some] = found
        self.goes[rows], self._motion[rows] = motion > 0, motion
        lost = np.flatnonzero(motion == 0)
        may_turn, ids = by.backs(edge[on[lost]], games[lost]) >= 0, by.columns.node_ids
        for i, turns in zip(lost.tolist(), may_turn.tolist(), strict=True):
            known = ids[[here[i], end[i], targets[i]]].tolist()
            self._refuse(int(rows[i]), str(no_way(*known, is_paced=bool(self._is_paced[rows[i]]), may_turn=turns)))

    def _follow(self, rows: IntArray, ways: IntArray) -> None:
        """Let agents go to an edge by the shortest way by length, and along it."""
        by, here, games = self._by, self.columns.node[rows], self._games[rows]
        pair, is_from_node = np.divmod(ways, 2)
        first, last = np.divmod(pair, by.streets.num_nodes)
        self._last[rows] = last
        ahead = np.where(first == here, last, by.ways("length").following(here, first, at=games))
        self._set_off(rows, first, ahead, is_from_node > 0, ENDLESS)

    def _follow_for(self, rows: IntArray, most: IntArray, targets: IntArray) -> None:
        """Let agents go along the shortest ways by length from their nodes, to so many nodes."""
        ahead = self._by.ways("length").following(self.columns.node[rows], targets, at=self._games[rows])
        self._set_off(rows, targets, ahead, np.ones(len(rows), np.bool_), most)

    def _set_off(
        self, rows: IntArray, goals: IntArray, ahead: IntArray, are_from_nodes: BoolArray, most: IntArray | int
    ) -> None:
        """Let agents go by length to nodes; those on an edge turn back whose ways lead from their nodes elsewhere."""
        by, columns, here, games = self._by, self._by.columns, self.columns.node[rows], self._games[rows]
        self._goal[rows], self._by_length[rows] = goals, True
        edge = self.columns.edge[rows]
        end, on_edge = columns.targets[edge], edge >= 0
        is_back = on_edge & are_from_nodes & (ahead != end)
        self._set_out(rows, np.where(is_back, int(Motion.BACK), int(Motion.FORWARD)), most + is_back)
        is_illegal = is_back & (by.backs(edge, games) < 0)
        self.goes[rows[~is_illegal]] = True
        for i in np.flatnonzero(is_illegal).tolist():
            source, target = columns.node_ids[[here[i], end[i]]].tolist()
            self._refuse(int(rows[i]), str(one_way(source, target)))

    def _refuse(self, row: int, message: str) -> None:
        game, agent = divmod(row, self._shape[1])
        self.illegal.append(Illegal(game, agent, f"BadValue: {message}"))

    # -- through the turn -----------------------------------------------------------------------------------------

    def first_nodes(self, rows: IntArray) -> IntArray:
        """Return the nodes to which agents on nodes go first; -1: they go along their edges, or nowhere."""
        nodes, off = np.full(len(rows), -1), np.flatnonzero(self.columns.edge[rows] < 0)
        at, following = self._next_nodes(rows[off], self.columns.node[rows[off]])
        nodes[off[at]] = following
        return nodes

    def first_edges(self, rows: IntArray, nodes: IntArray) -> IntArray:
        """Return the edges of which agents cover a part in what is left of the turn; -1: they cover nothing."""
        edges = np.full(len(rows), -1)
        some = np.flatnonzero((self.columns.edge[rows] >= 0) | (nodes >= 0))
        edges[some] = self._ask(core.first_edges, rows[some], nodes[some])
        return edges

    def travel(self, rows: IntArray, nodes: IntArray) -> None:
        """Follow the ways of agents until the turn is over, or, where they decide at arrivals, to the next node.

        Args:
            rows: of the agents.
            nodes: what `first_nodes` returns.
        """
        sets_off = (self.columns.edge[rows] >= 0) | (nodes >= 0)
        rows, nodes = rows[sets_off], nodes[sets_off]
        if not self._by.terms.decides_at_arrivals and self._is_endless[rows].any():
            some = self._is_endless[rows]
            self._travel_all(rows[some], nodes[some])
            rows, nodes = rows[~some], nodes[~some]
        while len(rows):
            if int(self.columns.legs[rows].max()) + 3 > self.columns.most:
                self._by.room = 2 * self.columns.most
                self.columns = self.columns.with_room(self._by.room)
            rows = rows[self._ask(core.go_each, rows, nodes) > 0]
            at, nodes = self._next_nodes(rows, self.columns.node[rows])
            rows = rows[at]

    def _ask(self, ask: Any, rows: IntArray, nodes: IntArray) -> IntArray:
        """Return what a function of the core writes for agents that go along their edges, or to these nodes."""
        answers = np.zeros(len(rows), np.int64)
        for roads, some in self._by.maps.each(self._games[rows]):
            found = np.zeros(len(rows[some]), np.int64)
            given = (np.ascontiguousarray(column).data for column in (rows[some], self._motion, nodes[some], found))
            ask(roads, self.columns.core, *given)
            answers[some] = found
        return answers

    def _travel_all(self, rows: IntArray, nodes: IntArray) -> None:
        """Let agents go the whole of their ways, however long these are."""
        routes, columns = [[node] if node >= 0 else [] for node in nodes.tolist()], self._by.columns
        is_ahead = (nodes < 0) & (self._motion[rows] != Motion.BACK)
        last = np.where(nodes >= 0, nodes, self.columns.node[rows])
        last[is_ahead] = columns.targets[self.columns.edge[rows[is_ahead]]]
        left, which = self.columns.left[rows] - 1, np.arange(len(rows))
        while len(which):
            which = which[left[which] > 0]
            at, nodes = self._next_nodes(rows[which], last[which])
            which = which[at]
            last[which] = nodes
            left[which] -= 1
            for place, node in zip(which.tolist(), nodes.tolist(), strict=True):
                routes[place].append(node)
        most = max(map(len, routes)) + 3
        if most > self.columns.most:
            self.columns = self.columns.with_room(most)
        for row, route in zip(rows.tolist(), routes, strict=True):
            self.columns.route[: len(route)] = route
            roads = self._by.maps.of(self._by.all_roads.of(int(self._games[row])))
            core.go(roads, self.columns.core, row, int(self._motion[row]), len(route))

    def _next_nodes(self, rows: IntArray, node: IntArray) -> tuple[IntArray, IntArray]:
        """Return which agents that are on nodes go on, by their places in `rows`, and to which nodes next."""
        is_there = node == self._goal[rows]
        at_last = is_there & (self._last[rows] >= 0)
        following = np.where(at_last, self._last[rows], node)
        self._goal[rows[at_last]], self._last[rows[at_last]] = self._last[rows[at_last]], -1
        for by_length, weight in ((True, "length"), (False, self._by.terms.weight)):
            some = np.flatnonzero(~is_there & (self._by_length[rows] == by_length))
            if len(some):
                goals, games = self._goal[rows[some]], self._games[rows[some]]
                following[some] = self._by.ways(weight).following(node[some], goals, at=games)
        at = np.flatnonzero(following != node)
        return at, following[at]

    def stop_short(self, rows: IntArray, leg: Legs) -> None:
        """Let agents that have come to the ends of their legs, (agents,), stand just before that from then on."""
        columns = self.columns
        columns.edge[rows], columns.share[rows] = leg.edge, np.where(leg.end == 1.0, 1.0 - SHORT, SHORT)
        columns.ends[rows, columns.legs[rows] - 1] = columns.share[rows]
        columns.passed[rows] -= 1
        core.stand_each(columns.core, rows.data)

    def last_legs(self, rows: IntArray) -> tuple[Any, ...]:
        """Return the last legs of agents: edges, begins, ends, since and until."""
        columns, last = self.columns, self.columns.legs[rows] - 1
        legs = columns.edges, columns.begins, columns.ends, columns.since, columns.until
        return tuple(column[rows, last] for column in legs)

    def moves(self) -> Moves:
        """Return the ways as moves; agents that were on edges and did not set off stand there."""
        columns, shape = self.columns, self._shape
        core.stand_each(columns.core, np.flatnonzero((self._begun >= 0) & (columns.legs == 0)).data)
        wide, most = int(columns.legs.max(initial=0)), int(columns.passed.max(initial=1))
        edge = np.where(np.arange(wide) < columns.legs[:, None], columns.edges[:, :wide], -1)
        back = self._by.backs(edge, self._games[:, None])
        written: Any = edge, back, columns.begins, columns.ends, columns.since, columns.until
        legs = Legs(*(column[:, :wide].reshape(*shape, wide) for column in written))
        behind, last = np.arange(most) >= columns.passed[:, None], columns.node
        nodes = np.where(behind, last[:, None], columns.nodes[:, :most]).reshape(*shape, most)
        times = np.where(behind, np.inf, columns.times[:, :most]).reshape(*shape, most)
        lengths, waits = columns.passed.reshape(shape), np.zeros(shape, np.bool_)
        stays, rests = (columns.legs == 0).reshape(shape), (columns.edge < 0).reshape(shape)
        end, motion = columns.edge.reshape(shape), columns.motion.reshape(shape)
        paths = Paths(nodes, times, lengths, stays, waits, rests, legs, end, motion)
        before = self._before.reshape(shape), self._from.reshape(shape)
        is_closed = (before[0] >= 0) & (self._begun.reshape(shape) < 0)  # of those that are not asked: they keep it
        share = np.where(is_closed, before[1], columns.share.reshape(shape))
        after = np.where(is_closed, before[0], end), share
        goes = (legs.begin != legs.end).any(axis=-1)
        ends = last.reshape(shape)
        return Moves(self._starts.reshape(shape), ends, goes, paths, after, before, tuple(self.illegal))
