"""Travel by metres in many games at once: where agents are on edges, and what they cover in a turn; see `game.travel`.

All numbers are worked out by the same operations in the same order as there, so that they are the same to the bit.
"""

from collections.abc import Iterable, Sequence
from functools import cached_property
from typing import Any, Self

import numpy as np

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
    Steps,
    last_motion,
)
from gamms.game.batch.reach import EdgesBetween, Reach, TravelTerms
from gamms.game.batch.roads import RoadMap
from gamms.game.legality import ResolvedAction
from gamms.game.moves import SHORT
from gamms.game.streets import Streets
from gamms.game.travel import no_way, one_way
from gamms.ir.graph import ClosedEdges, FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.ir.progress import Motion, Progress
from gamms.typing.game import Leg

ROUNDED, SLACK = 1e-12, 1e-9  # of a turn, as `core.travel` has them
_ALONG = 1 << 62  # actions from here on lead to an end of an edge, and along it; see `ByMetres.along`


class ByMetres(Movement):
    """Agents that are anywhere on edges, and go as far in a turn as their speeds in metres say.

    Args:
        streets: of the map.
        speeds: of the agents in the order of the roster; None: along one edge in a turn.
        terms: by what they travel.
        whole, closed: see `Movement`.

    Attributes:
        edge: (games, agents) the rows of the edges that agents are on; -1: they are on their nodes.
        share: (games, agents) of the edge that is behind them.
        motion: (games, agents) how they move there, see `ir.progress.Motion`.
        now: (games,) of the turn, from 0 to 1: when the agents that are asked decide.
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
        self._kinds, self._kind_of = np.unique(np.where(self._is_paced, self._speeds, np.nan), return_inverse=True)
        self._is_endless = np.isinf(self._kinds) & (terms.seconds is None)  # by which they go any distance in a turn
        self.begin((0, len(speeds)))

    @cached_property
    def _between(self) -> EdgesBetween:
        return EdgesBetween(self.all_roads, self.terms.costs)

    @cached_property
    def _reach(self) -> Reach:
        return Reach(self.all_roads, self._kinds, self._is_endless, self.takes)

    def on(self, roads: RoadMap) -> Self:
        """Return how the same agents go in games that have a map of their own."""
        _ = self._between, self._reach, self.lines  # which all maps share
        return super().on(roads)

    def begin(self, shape: tuple[int, int]) -> None:
        """Reserve memory for so many games and agents, all of which are on nodes."""
        super().begin(shape)
        for name in ("_between", "_reach"):
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

    def progress(self, node: IntArray, games: IntArray) -> list[dict[int, Progress]]:
        """Return where on edges agents are."""
        found = super().progress(node, games)
        edge, share, motion = (column[games] for column in (self.edge, self.share, self.motion))
        for at, agent in np.argwhere(edge >= 0).tolist():
            found[at][agent] = self._place(int(edge[at, agent]), share[at, agent].item(), motion[at, agent].item())
        return found

    def legs(self, paths: Paths) -> dict[tuple[int, int], tuple[list[Leg], Progress | None]]:
        """Return what agents cover of edges in a turn, and where they end."""
        found: dict[tuple[int, int], tuple[list[Leg], Progress | None]] = {}
        if paths.legs is None or paths.edge is None or paths.motion is None:
            return found
        motion, columns, ids = paths.motion.tolist(), self.columns, self.columns.edge_ids.tolist()
        for at, agent, number in np.argwhere(paths.legs.edge >= 0).tolist():
            row, back, begin, end, since, until = (column[at, agent, number].item() for column in paths.legs)
            source, target = columns.node_ids[[columns.sources[row], columns.targets[row]]].tolist()
            leg = Leg(source, target, ids[row], begin, end, since, until, None if back < 0 else ids[back])
            ended = self._place(row, end, motion[at][agent]) if paths.edge[at, agent] >= 0 else None
            found[at, agent] = [*found.get((at, agent), ([],))[0], leg], ended
        return found

    def _place(self, row: int, share: float, motion: int) -> Progress:
        columns = self.columns
        source, target = columns.node_ids[[columns.sources[row], columns.targets[row]]].tolist()
        return Progress(source, target, share, int(columns.edge_ids[row]), Motion(motion))

    def ends(self, moves: Moves) -> tuple[IntArray | None, IntArray]:
        """Return the places where moves begin and end: nodes, and behind them edges."""
        nodes, paths = self.streets.num_nodes, moves.as_paths()
        begun, ended = moves.before[0], moves.progress[0]
        if paths.legs is not None and paths.edge is not None:  # those on closed edges that are not asked stay off them
            begun, ended = np.where((paths.legs.edge >= 0).any(axis=-1), begun, -1), paths.edge
        pairs = (moves.starts, begun), (moves.ends, ended)
        starts, ends = (np.where(edge >= 0, nodes + edge, node) for node, edge in pairs)
        return starts, ends

    def takes(self, edges: IntArray, share: Any, speed: Any) -> FloatArray:
        """Return how many turns a share of some edges takes at speeds."""
        terms, metres = self.terms, share * self.columns.lengths[edges]
        with np.errstate(divide="ignore", invalid="ignore"):
            by_speed = np.where(metres == 0.0, 0.0, metres / np.abs(speed * terms.turn_seconds))  # a speed may be -0.0
        if terms.seconds is None:
            return by_speed
        found: FloatArray = np.maximum(by_speed, share * terms.seconds[edges] / terms.turn_seconds)
        return found

    def cheapest(self, starts: IntArray, ends: IntArray, games: IntArray) -> IntArray:
        """Return the rows of the cheapest edges between nodes next to each other in games."""
        return self._between.cheapest(starts, ends, games)

    def backs(self, edges: IntArray, games: IntArray) -> IntArray:
        """Return the rows of the edges by which one turns round on others, -1 among them, in games; -1: none."""
        return self._between.backs(edges, games)

    # -- legal nodes ----------------------------------------------------------------------------------------------

    def choices(self, node: IntArray, which: tuple[IntArray, IntArray]) -> IntArray:
        """Return the numbers of the choices of agents; those of agents on edges are found one by one, which is slow."""
        edge, games = np.broadcast_to(self.on_edge(which), node.shape), np.broadcast_to(which[0], node.shape)
        kind = np.broadcast_to(self._kind_of[which[1]], node.shape)
        left = np.broadcast_to(1.0 - self.now[which[0]], node.shape)
        found, on_node = np.zeros(node.shape, np.int64), np.nonzero(edge < 0)
        found[on_node] = self._reach.from_nodes(node[on_node], kind[on_node], left[on_node], games[on_node])
        on = np.nonzero(edge >= 0)
        if len(on[0]):
            found[on] = self._on_edges(node[on], (games[on], np.broadcast_to(which[1], node.shape)[on]), kind[on])
        return found

    def counts(self, choices: IntArray) -> IntArray:
        """Return how many nodes are legal."""
        return self._reach.counts(choices)

    def nodes(self, choices: IntArray, actions: IntArray) -> IntArray:
        """Return the rows of legal nodes by their numbers."""
        return self._reach.nodes(choices, actions)

    def most_legal(self, limit: int) -> int:
        """Return how many nodes are legal at most."""
        return self._reach.most(limit)

    def _on_edges(self, here: IntArray, which: tuple[IntArray, IntArray], kind: IntArray) -> IntArray:
        """Return the choices of agents that are on open edges; see `Travel.reachable`."""
        edge, share, motion, games = self.edge[which], self.share[which], self.motion[which], which[0]
        near, around, speed = self._reach.near, self._reach.around, self._kinds[kind]
        has_back = self.backs(edge, games) >= 0
        goes_on = (motion != Motion.STOPPED) & ((motion != Motion.BACK) | has_back) & self.terms.decides_at_arrivals
        takes = self.takes(edge, 1.0 - share, speed), self.takes(edge, share, speed)
        ways = self.columns.targets[edge], *takes, has_back, goes_on, motion == Motion.BACK
        rows = (column.tolist() for column in (games, here, kind, ~np.isnan(speed), *ways))
        found = list[dict[int, float]]()
        for game, start, number, is_paced, target, ahead, behind, turns, is_on, is_back in zip(*rows, strict=True):
            ends, roads = [(target, ahead), (start, behind)] if turns else [(target, ahead)], self.all_roads.of(game)
            ends = [ends[-1] if is_back else ends[0]] if is_on else ends
            nodes = [end for end, _ in reversed(ends)]
            if is_on or is_paced:  # else it goes to one of the ends
                nodes += [node for end, _ in ends for node in near(end, roads)]
                nodes += [node for end, begun in ends for node in around(end, number, begun, roads)]
            found.append(dict.fromkeys(nodes, 0.0))
        return self._reach.add(found)

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

    def moves_of(self, actions: Sequence[ResolvedAction]) -> Moves:
        """Return the moves of agents that go as the turn engine has found, (agents,)."""
        ends = [[leg for leg in action.legs if leg.end in (0.0, 1.0)] for action in actions]  # who turns comes back
        nodes = [tuple([leg.target if leg.end else leg.source for leg in legs]) for legs in ends]
        pairs = zip(actions, nodes, strict=True)
        moves = super().moves_of([action._replace(path=action.path[:1] + passed) for action, passed in pairs])
        row, paths = {one: i for i, one in enumerate(self.columns.edge_ids.tolist())}, moves.as_paths()
        shape = len(actions), max(len(action.legs) for action in actions)
        legs = Legs(np.full(shape, -1), np.full(shape, -1), *(np.zeros(shape) for _ in range(4)))
        edge, share = np.full(len(actions), -1), np.zeros(len(actions))
        for i, action in enumerate(actions):
            paths.times[i, 1 : 1 + len(ends[i])] = [leg.until for leg in ends[i]]
            for number, leg in enumerate(action.legs):
                back = -1 if leg.back is None else row[leg.back]
                for column, value in zip(legs, (row[leg.edge], back, *leg[3:7]), strict=True):
                    column[i, number] = value
            if action.progress is not None:
                edge[i], share[i] = row[action.progress.edge], action.progress.share
        stays = np.asarray((legs.edge < 0).all(axis=-1))
        waits = np.zeros_like(stays)
        paths = paths._replace(legs=legs, edge=edge, motion=last_motion(legs), stays=stays, waits=waits, rests=edge < 0)
        return moves._replace(goes=(legs.begin != legs.end).any(axis=-1), paths=paths, progress=(edge, share))

    def moves(self, node: IntArray, actions: IntArray, games: IntArray) -> Moves:
        """Return where actions lead, of all agents of some games."""
        trip = Trip(self, node, games)
        trip.decide(np.arange(node.size), actions.ravel())
        rows = np.flatnonzero(trip.goes)
        trip.travel(rows, trip.first_steps(rows))
        return trip.moves()


class Trip:
    """The ways of all agents of some games through a turn.

    Agents are numbered from 0, game by game. Each goes along steps: parts of edges, one after the other, until the turn
    is over or it is at its goal.

    Args:
        by: how they go.
        node: rows, (games, agents).
        games: the numbers of the games.

    Attributes:
        here: rows of the nodes that agents have passed last.
        edge, share: where on edges they are.
        goes: which agents set off.
        now: when they do.
        legs: what they cover: agents, the numbers of their legs, and the columns of `Legs`.
        illegal: actions that could not be done.
    """

    def __init__(self, by: ByMetres, node: IntArray, games: IntArray) -> None:
        self._by, self._shape, self._games = by, node.shape, np.repeat(games, node.shape[1])
        self._agents = np.tile(np.arange(node.shape[1]), len(games))
        self._starts, self.here, self._before = node.ravel(), node.flatten(), by.edge[games].ravel()
        self._begun, self._from = by.on_edge((self._games, self._agents)), by.share[games].ravel()
        self._is_paced, self._speed = by._is_paced[self._agents], by._speeds[self._agents]
        self._is_endless = ~self._is_paced | by._is_endless[by._kind_of[self._agents]]
        number = len(self.here)
        self._goal, self._last = np.full((2, number), -1)  # nodes; the last one is next to the goal
        self._by_length = np.zeros(number, np.bool_)  # whether the way is the shortest by length
        self._left = np.full(number, ENDLESS)  # to how many nodes more it leads
        self._is_back, self.goes, self._stops_short = np.zeros((3, number), np.bool_)
        self.illegal: list[Illegal] = []
        self.edge, self.share, self.now = self._begun.copy(), self._from.copy(), np.zeros(number)
        self._count, self._passed = np.zeros(number, np.int64), np.ones(number, np.int64)  # legs and nodes
        self.legs, self._nodes = list[tuple[Any, ...]](), list[tuple[Any, ...]]()
        self._turns_per_metre = np.zeros(number)  # of those whose ways take the rest of the turn, however long they are

    # -- where to -------------------------------------------------------------------------------------------------

    def decide(self, rows: IntArray, actions: IntArray) -> None:
        """Work out which way some agents set off, by what they have decided."""
        by = self._by
        self._goal[rows] = self._last[rows] = -1
        self._left[rows] = ENDLESS
        self.goes[rows] = self._is_back[rows] = self._by_length[rows] = False
        some = actions < STOP
        chosen = rows[some]
        if len(chosen):
            who = self._games[chosen], self._agents[chosen]
            self._aim(chosen, by.nodes(by.choices(self.here[chosen], who), actions[some]))
        some = (actions >= AIMS) & (actions < AIMS * LIMITED)
        self._aim(rows[some], actions[some] - AIMS)
        some = (actions >= AIMS * LIMITED) & (actions < _ALONG)
        self._follow_for(rows[some], *np.divmod(actions[some] - AIMS * LIMITED, AIMS))
        some = actions >= _ALONG
        self._follow(rows[some], actions[some] - _ALONG)

    def go_on(self, rows: IntArray, motion: IntArray) -> None:
        """Let agents go on along their edges, whose motion this is."""
        self.goes[rows], self._is_back[rows] = True, motion == Motion.BACK

    def _aim(self, rows: IntArray, targets: IntArray) -> None:
        """Let agents go towards nodes; those on an edge by the shorter way."""
        by, columns = self._by, self._by.columns
        on_node = self.edge[rows] < 0
        away = rows[on_node & (targets != self.here[rows])]
        self._goal[rows], self.goes[away] = targets, True
        rows, targets = rows[~on_node], targets[~on_node]
        if not len(rows):
            return
        edge, share, here, games = self.edge[rows], self.share[rows], self.here[rows], self._games[rows]
        end, may_turn, table = columns.targets[edge], by.backs(edge, games) >= 0, by.ways(by.terms.weight)
        ahead = (1.0 - share) * by.terms.costs[edge] + table.distances(end, targets, at=games)
        behind = share * by.terms.costs[edge] + table.distances(here, targets, at=games)
        behind = np.where(may_turn, behind, np.inf)
        is_end, is_here = targets == end, (targets == here) & may_turn
        self._is_back[rows] = ~is_end & (is_here | (behind < ahead))
        has_way, is_paced = is_end | is_here | (ahead < np.inf) | (behind < np.inf), self._is_paced[rows]
        has_way &= is_end | is_here | is_paced
        self.goes[rows[has_way]] = True
        for i in np.flatnonzero(~has_way).tolist():
            known = columns.node_ids[[end[i], targets[i], here[i]]].tolist()
            why = no_way(known[2], known[0], known[1], is_paced=bool(is_paced[i]), may_turn=bool(may_turn[i]))
            self._refuse(int(rows[i]), str(why))

    def _follow(self, rows: IntArray, ways: IntArray) -> None:
        """Let agents go to an edge by the shortest way by length, and along it."""
        by, here, games = self._by, self.here[rows], self._games[rows]
        pair, is_from_node = np.divmod(ways, 2)
        first, last = np.divmod(pair, by.streets.num_nodes)
        self._last[rows] = last
        ahead = np.where(first == here, last, by.ways("length").following(here, first, at=games))
        self._set_off(rows, first, ahead, is_from_node > 0)

    def _follow_for(self, rows: IntArray, most: IntArray, targets: IntArray) -> None:
        """Let agents go along the shortest ways by length from their nodes, to so many nodes."""
        ahead = self._by.ways("length").following(self.here[rows], targets, at=self._games[rows])
        self._set_off(rows, targets, ahead, np.ones(len(rows), np.bool_))
        self._left[rows] = most - ((self.edge[rows] >= 0) & ~self._is_back[rows])

    def _set_off(self, rows: IntArray, goals: IntArray, ahead: IntArray, are_from_nodes: BoolArray) -> None:
        """Let agents go by length to nodes; those on an edge turn back whose ways lead from their nodes elsewhere."""
        by, columns, here, games = self._by, self._by.columns, self.here[rows], self._games[rows]
        self._goal[rows], self._by_length[rows] = goals, True
        edge = self.edge[rows]
        end, on_edge = columns.targets[edge], edge >= 0
        is_back = on_edge & are_from_nodes & (ahead != end)
        self._is_back[rows] = is_back
        is_illegal = is_back & (by.backs(edge, games) < 0)
        self.goes[rows[~is_illegal]] = True
        for i in np.flatnonzero(is_illegal).tolist():
            source, target = columns.node_ids[[here[i], end[i]]].tolist()
            self._refuse(int(rows[i]), str(one_way(source, target)))

    def _refuse(self, row: int, message: str) -> None:
        game, agent = divmod(row, self._shape[1])
        self.illegal.append(Illegal(game, agent, f"BadValue: {message}"))

    # -- through the turn -----------------------------------------------------------------------------------------

    def travel(self, rows: IntArray, steps: Steps) -> None:
        """Follow the ways of agents until the turn is over, or, where they decide at arrivals, to the next node."""
        while len(rows):
            now, (until, stop) = self.now[rows], self._ends(rows, steps)
            on = np.flatnonzero((until == np.inf) & (stop > 0.0) & (stop < 1.0))
            self.edge[rows[on]], self.share[rows[on]] = steps.edge[on], stop[on]
            self._add_legs(rows[on], steps.those(on)._replace(end=stop[on]), now[on], np.ones(len(on)))
            on = np.flatnonzero(until < np.inf)
            rows, steps = rows[on], steps.those(on)
            self._add_legs(rows, steps, now[on], until[on])
            self.now[rows] = until[on]
            self._nodes.append((rows, self._passed[rows], steps.node, until[on]))
            self._passed[rows] += 1
            self.edge[rows], self.share[rows], self.here[rows] = -1, 0.0, steps.node
            rows, steps = self._next_steps(rows, steps.node)

    def _next_steps(self, rows: IntArray, node: IntArray) -> tuple[IntArray, Steps]:
        """Return which agents that come to nodes go on, and along what."""
        at, following = self._next_nodes(rows, node)
        edge = self._by.cheapest(node[at], following, self._games[rows[at]])
        return rows[at], Steps(edge, np.zeros(len(at)), np.ones(len(at)), following)

    def _set_paces(self, rows: IntArray, steps: Steps) -> None:
        """Work out how fast agents go whose ways take the rest of the turn, however long they are."""
        first, metres, before = rows, np.zeros(len(self.here)), (self._goal, self._last, self._left)
        self._goal, self._last, self._left = (column.copy() for column in before)
        while len(rows):
            metres[rows] += np.abs(steps.end - steps.begin) * self._by.columns.lengths[steps.edge]
            rows, steps = self._next_steps(rows, steps.node)
        self._goal, self._last, self._left = before
        left, far = 1.0 - self.now[first], metres[first]
        self._turns_per_metre[first] = np.divide(left, far, out=np.zeros(len(first)), where=far > 0.0)

    def covers(self, rows: IntArray, steps: Steps) -> BoolArray:
        """Return which agents cover some part of their steps in what is left of the turn."""
        until, stop = self._ends(rows, steps)
        return (until < np.inf) | ((stop > 0.0) & (stop < 1.0))

    def _ends(self, rows: IntArray, steps: Steps) -> tuple[FloatArray, FloatArray]:
        """Return when agents are at the ends of their steps, and where on their edges those are that the turn stops."""
        now, share = self.now[rows], np.abs(steps.end - steps.begin)
        metres = share * self._by.columns.lengths[steps.edge]
        with np.errstate(divide="ignore", invalid="ignore"):
            paced = self._by.takes(steps.edge, share, self._speed[rows])
            takes = np.where(self._is_endless[rows], metres * self._turns_per_metre[rows], paced)
            part = np.where(takes < np.inf, share * (1.0 - now) / takes, 0.0)
        ends = np.where(now + takes < 1.0 - ROUNDED, now + takes, 1.0)
        stop = np.where(steps.end > steps.begin, steps.begin + part, steps.begin - part)
        return np.where(now + takes > 1.0 + SLACK, np.inf, ends), np.where(part > 0.0, stop, np.nan)

    def first_steps(self, rows: IntArray) -> Steps:
        """Return what agents set off along."""
        on_edge, is_back, here = self.edge[rows] >= 0, self._is_back[rows], self.here[rows]
        edge, node = self.edge[rows], here.copy()
        ahead = on_edge & ~is_back
        node[ahead] = self._by.columns.targets[edge[ahead]]
        off = np.flatnonzero(~on_edge)
        at, following = self._next_nodes(rows[off], here[off], is_first=True)
        edge[off[at]] = self._by.cheapest(here[off[at]], following, self._games[rows[off[at]]])
        node[off[at]] = following
        begin = np.where(on_edge, self.share[rows], 0.0)
        steps = Steps(edge, begin, np.where(on_edge & is_back, 0.0, 1.0), node)
        if len(some := np.flatnonzero(self._is_endless[rows])):
            self._set_paces(rows[some], steps.those(some))
        return steps

    def _next_nodes(self, rows: IntArray, node: IntArray, *, is_first: bool = False) -> tuple[IntArray, IntArray]:
        """Return which agents that are on nodes go on, by their places in `rows`, and to which nodes next."""
        is_there = node == self._goal[rows]
        at_last = is_there & (self._last[rows] >= 0)
        following = np.where(at_last, self._last[rows], node)
        self._goal[rows[at_last]], self._last[rows[at_last]] = self._last[rows[at_last]], -1
        may_go_on = self._is_paced[rows] & (not self._by.terms.decides_at_arrivals) | is_first
        goes_on = may_go_on & (~is_there | at_last) & (self._left[rows] > 0)
        for by_length, weight in ((True, "length"), (False, self._by.terms.weight)):
            some = np.flatnonzero(goes_on & ~is_there & (self._by_length[rows] == by_length))
            if len(some):
                goals, games = self._goal[rows[some]], self._games[rows[some]]
                following[some] = self._by.ways(weight).following(node[some], goals, at=games)
        at = np.flatnonzero(goes_on)
        self._left[rows[at]] -= 1
        return at, following[at]

    def _add_legs(self, rows: IntArray, steps: Steps, since: FloatArray, until: FloatArray) -> None:
        self.legs.append((rows, self._count[rows], *steps[:3], since, until))
        self._count[rows] += 1

    def stop_short(self, rows: IntArray, leg: Legs) -> None:
        """Let agents that have come to the ends of their legs, (agents,), stand just before that from then on."""
        short = np.where(leg.end == 1.0, 1.0 - SHORT, SHORT)
        self._count[rows] -= 1
        self._passed[rows] -= 1
        self._add_legs(rows, Steps(leg.edge, leg.begin, short, leg.edge), leg.since, leg.until)
        on = np.flatnonzero(leg.until < 1.0)
        stands = Steps(leg.edge, short, short, leg.edge).those(on)
        self._add_legs(rows[on], stands, leg.until[on], np.ones(len(on)))
        self.edge[rows], self.share[rows], self._stops_short[rows] = leg.edge, short, True

    def moves(self) -> Moves:
        """Return the ways as moves; agents that were on edges and did not set off stand there."""
        stands = np.flatnonzero((self._begun >= 0) & (self._count == 0))
        whole, share = np.ones(len(stands)), self._from[stands]
        self._add_legs(stands, Steps(self._begun[stands], share, share, self.here[stands]), whole * 0.0, whole)
        shape, number = self._shape, len(self.here)
        wide = int(self._count.max(initial=0))
        edge, others = np.full((number, wide), -1), [np.zeros((number, wide)) for _ in range(4)]
        for rows, place, edges, *columns in self.legs:
            edge[rows, place] = edges
            for column, values in zip(others, columns, strict=True):
                column[rows, place] = values
        back = self._by.backs(edge, self._games[:, None])
        legs = Legs(*(column.reshape(*shape, wide) for column in (edge, back, *others)))
        most = int(self._passed.max(initial=1))
        nodes, times = np.repeat(self._starts[:, None], most, axis=1), np.full((number, most), np.inf)
        times[:, 0] = 0.0
        for rows, place, node, when in self._nodes:
            on = place < self._passed[rows]  # else they were stopped short of it
            nodes[rows[on], place[on]], times[rows[on], place[on]] = node[on], when[on]
        behind = np.arange(most) >= self._passed[:, None]
        last = nodes[np.arange(number), self._passed - 1]
        nodes, times = np.where(behind, last[:, None], nodes), np.where(behind, np.inf, times)
        stays, rests = (self._count == 0).reshape(shape), (self.edge < 0).reshape(shape)
        lengths, edge_at_end = self._passed.reshape(shape), self.edge.reshape(shape)
        nodes, times, waits = nodes.reshape(*shape, most), times.reshape(*shape, most), np.zeros(shape, np.bool_)
        motion = np.where(self._stops_short.reshape(shape), Motion.STOPPED, last_motion(legs))
        paths = Paths(nodes, times, lengths, stays, waits, rests, legs, edge_at_end, motion)
        ends, starts = last.reshape(shape), self._starts.reshape(shape)
        before, share = self._before.reshape(shape), self._from.reshape(shape)
        is_closed = (before >= 0) & (self._begun.reshape(shape) < 0)  # of those that are not asked: they keep it
        after = np.where(is_closed, before, edge_at_end), self.share.reshape(shape)
        goes = (legs.begin != legs.end).any(axis=-1)
        return Moves(starts, ends, goes, paths, after, (before, share), tuple(self.illegal))
