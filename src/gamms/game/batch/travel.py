"""Travel by metres in many games at once: where agents are on edges, and what they cover in a turn; see `game.travel`.

All numbers are worked out by the same operations in the same order as there, so that they are the same to the bit.
"""

from collections.abc import Sequence
from heapq import heappop, heappush
from math import isfinite
from typing import Any, NamedTuple

import numpy as np

from gamms.errors import NoPath
from gamms.game.batch.by_edges import ByEdges
from gamms.game.batch.columns import PlayedGame, Roster
from gamms.game.batch.movement import AIMS, STOP, Anywhere, Illegal, Legs, Movement, Moves, Paths, Places
from gamms.game.order import ResolvedAction
from gamms.game.streets import Streets
from gamms.game.travel import ROUNDED, SLACK, one_way
from gamms.ir.agents import Motion, Progress
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.typing import AgentType
from gamms.typing.game import Leg
from gamms.typing.graph_engine import IGraph
from gamms.typing.on_edges import point_along

_ALONG = 1 << 62  # actions from here on lead to an end of an edge, and along it; see `ByMetres.along`
_MOST_KNOWN = 1 << 22  # legal nodes that are kept


class TravelTerms(NamedTuple):
    """By what agents travel.

    Attributes:
        weight: of the edges, by which they choose paths.
        costs: (edges,) by that weight.
        seconds: (edges,) that each takes at least; None: edges have no speed of their own.
        turn_seconds: how long a turn lasts, in the time of speeds.
    """

    weight: str
    costs: FloatArray
    seconds: FloatArray | None
    turn_seconds: float


class ByMetres(Movement):
    """Agents that are anywhere on edges, and go as far in a turn as their speeds in metres say.

    Args:
        graph: of the map.
        streets: likewise.
        speeds: of the agents in the order of the roster; None: along one edge in a turn.
        terms: by what they travel.

    Attributes:
        edge: (games, agents) the rows of the edges that agents are on; -1: they are on their nodes.
        share: (games, agents) of the edge that is behind them.
        motion: (games, agents) how they move there, see `ir.agents.Motion`.
        sources: of the entries of `streets.targets`.
        back: (edges,) the row of the edge by which one turns round on each; -1: none.
        street: (edges,) a number that an edge and the one back have in common.
        is_ahead: (edges,) which edges lead in the direction of their streets.
    """

    is_plain, leaves_nodes = False, True
    remembers = ("edge", "share")

    idle = STOP
    _arrays: tuple[IntArray, ...]

    def __init__(self, graph: IGraph, streets: Streets, speeds: Sequence[float | None], terms: TravelTerms) -> None:
        super().__init__(streets)
        self._graph, self.terms = graph, terms
        self._is_paced = np.array([speed is not None for speed in speeds], np.bool_)
        self._speeds = np.array([1.0 if speed is None else speed for speed in speeds])
        self._kinds, self._kind_of = np.unique(np.where(self._is_paced, self._speeds, np.nan), return_inverse=True)
        columns, nodes = streets.columns, len(streets.counts)
        ways = columns.sources * nodes + columns.targets
        order = np.lexsort((np.arange(len(ways)), terms.costs, ways))
        self._ways, first = np.unique(ways[order], return_index=True)
        self._cheapest = order[first]
        self.back = self._backs(ways)
        has_back = self.back >= 0
        ids = columns.edge_ids
        street = np.where(has_back, np.minimum(ids, ids[self.back]), ids)
        self.street: IntArray = np.unique(street, return_inverse=True)[1]
        self.is_ahead: BoolArray = street == ids
        self.sources = np.repeat(np.arange(nodes), streets.counts)
        self._forget()
        self.begin((0, len(speeds)))

    def _backs(self, ways: IntArray) -> IntArray:
        """Return the first edge from the end of each edge to its start that is as long; -1 where there is none."""
        columns, nodes = self.streets.columns, len(self.streets.counts)
        order = np.argsort(ways, kind="stable")
        wanted = columns.targets * nodes + columns.sources
        first, last = (np.searchsorted(ways[order], wanted, side) for side in ("left", "right"))
        found = np.full(len(ways), -1)
        for number in range(int((last - first).max(initial=0))):
            open_ = np.flatnonzero((first + number < last) & (found < 0))
            others = order[first[open_] + number]
            is_like = np.abs(columns.lengths[others] - columns.lengths[open_]) <= SLACK * columns.lengths[open_]
            found[open_[is_like]] = others[is_like]
        return found

    def begin(self, shape: tuple[int, int]) -> None:
        """Reserve memory for so many games and agents, all of which are on nodes."""
        self.edge, self.share, self.motion = np.full(shape, -1), np.zeros(shape), np.zeros(shape, np.int64)

    def clear(self, games: Any, agents: Any = np.s_[:]) -> None:
        """Let agents be on their nodes."""
        self.edge[games, agents], self.share[games, agents] = -1, 0.0

    def take_out(self, games: IntArray, agents: IntArray) -> None:
        """Let agents that are out of the game be where they are."""

    def keep(self, moves: Moves, games: IntArray, agents: IntArray | None = None) -> None:  # noqa: ARG002 - all move
        """Note where on edges agents are."""
        self.edge[games], self.share[games] = moves.progress
        if moves.paths is not None and moves.paths.legs is not None:
            self.motion[games] = _motion(moves.paths.legs)

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
        if paths.legs is None or paths.edge is None:
            return found
        motion, columns = _motion(paths.legs).tolist(), self.streets.columns
        ids, backs = columns.edge_ids.tolist(), self.back.tolist()
        rows = paths.legs.edge
        for at, agent, number in np.argwhere(rows >= 0).tolist():
            row = int(rows[at, agent, number])
            begin, end, since, until = (column[at, agent, number].item() for column in paths.legs[1:])
            source, target = columns.node_ids[[columns.sources[row], columns.targets[row]]].tolist()
            back = None if backs[row] < 0 else ids[backs[row]]
            leg = Leg(source, target, ids[row], begin, end, since, until, back)
            ended = self._place(row, end, motion[at][agent]) if paths.edge[at, agent] >= 0 else None
            found[at, agent] = [*found.get((at, agent), ([],))[0], leg], ended
        return found

    def _place(self, row: int, share: float, motion: int) -> Progress:
        columns = self.streets.columns
        source, target = columns.node_ids[[columns.sources[row], columns.targets[row]]].tolist()
        return Progress(source, target, share, int(columns.edge_ids[row]), Motion(motion))

    def ends(self, moves: Moves) -> tuple[IntArray | None, IntArray]:
        """Return the places where moves begin and end: nodes, and behind them edges."""
        nodes = len(self.streets.counts)
        pairs = (moves.starts, moves.before[0]), (moves.ends, moves.progress[0])
        starts, ends = (np.where(edge >= 0, nodes + edge, node) for node, edge in pairs)
        return starts, ends

    def takes(self, edges: IntArray, share: Any, speed: Any) -> FloatArray:
        """Return how many turns a share of some edges takes at speeds."""
        terms, metres = self.terms, share * self.streets.columns.lengths[edges]
        with np.errstate(divide="ignore", invalid="ignore"):
            by_speed = np.where(metres == 0.0, 0.0, metres / (speed * terms.turn_seconds))
        by_speed = np.where((speed <= 0.0) & (metres != 0.0), np.inf, by_speed)
        if terms.seconds is None:
            return by_speed
        found: FloatArray = np.maximum(by_speed, share * terms.seconds[edges] / terms.turn_seconds)
        return found

    def cheapest(self, starts: IntArray, ends: IntArray) -> IntArray:
        """Return the rows of the cheapest edges between nodes next to each other."""
        found: IntArray = self._cheapest[np.searchsorted(self._ways, starts * len(self.streets.counts) + ends)]
        return found

    # -- legal nodes ----------------------------------------------------------------------------------------------

    def choices(self, node: IntArray, which: tuple[IntArray, IntArray]) -> IntArray:
        """Return the numbers of the choices of agents; those of agents on edges are found one by one, which is slow."""
        edge, share = self.edge[which], self.share[which]
        kind = np.broadcast_to(self._kind_of[which[1]], node.shape)
        if len(self._flat) > _MOST_KNOWN:
            self._forget()
        keys = kind * len(self.streets.counts) + node
        for key in np.unique(keys[(edge < 0) & (self._number[keys] < 0)]).tolist():
            kind_of, start = divmod(key, len(self.streets.counts))
            self._number[key] = self._add([*self._near(start), *self._around(start, kind_of, 0.0)])
        found: IntArray = self._number[keys]
        for place in np.argwhere(edge >= 0).tolist():
            at = tuple(place)
            found[at] = self._add(self._on_edge(int(node[at]), int(edge[at]), float(share[at]), int(kind[at])))
        return found

    def most_legal(self, limit: int) -> int:
        """Return how many nodes are legal at most: on an edge, fewer than from both its ends together."""
        columns, most = self.streets.columns, 1
        for kind in range(len(self._kinds)):
            reached = []
            for node in range(len(self.streets.counts)):
                reached.append({*self._near(node), *self._around(node, kind, 0.0)})
                most = max(most, len(reached[-1]))
                if most > limit:
                    return most
            for source, target in zip(columns.sources.tolist(), columns.targets.tolist(), strict=True):
                most = max(most, len(reached[source] | reached[target]))
        return most

    def counts(self, choices: IntArray) -> IntArray:
        """Return how many nodes are legal."""
        found: IntArray = self._columns()[1][choices]
        return found

    def nodes(self, choices: IntArray, actions: IntArray) -> IntArray:
        """Return the rows of legal nodes by their numbers."""
        first, _, flat = self._columns()
        found: IntArray = flat[first[choices] + actions]
        return found

    def _columns(self) -> tuple[IntArray, ...]:
        """Return where the nodes of each choice begin, how many there are, and all these nodes."""
        if len(self._arrays[0]) != len(self._first):
            columns = self._first, self._count, self._flat
            self._arrays = tuple(np.array(column, np.int64) for column in columns)
        return self._arrays

    def _forget(self) -> None:
        self._number = np.full(len(self._kinds) * len(self.streets.counts), -1)
        self._first, self._count, self._flat = list[int](), list[int](), list[int]()
        self._arrays = (np.zeros(0, np.int64),) * 3

    def _add(self, nodes: Sequence[int]) -> int:
        different = list(dict.fromkeys(nodes))
        self._first.append(len(self._flat))
        self._count.append(len(different))
        self._flat += different
        return len(self._first) - 1

    def _near(self, node: int) -> list[int]:
        streets = self.streets
        near: list[int] = streets.targets[streets.offsets[node] : streets.offsets[node + 1]].tolist()
        return near

    def _on_edge(self, here: int, edge: int, share: float, kind: int) -> list[int]:
        """Return what is legal for an agent on an edge."""
        columns, may_turn, speed = self.streets.columns, bool(self.back[edge] >= 0), self._kinds[kind]
        row, target = np.array(edge), int(columns.targets[edge])
        found = [here] if may_turn else []
        found += self._near(target)
        found += self._near(here) if may_turn else ()
        found += self._around(target, kind, float(self.takes(row, 1.0 - share, speed)))
        return found + (self._around(here, kind, float(self.takes(row, share, speed))) if may_turn else [])

    def _around(self, node: int, kind: int, begun: float) -> list[int]:
        """Return the nodes within a turn from a node, the first ones first; see `Travel`."""
        speed, columns = self._kinds[kind], self.streets.columns
        if np.isnan(speed) or begun > 1.0 + SLACK:
            return []
        ids, found, heap = columns.node_ids, dict[int, None](), [(begun, int(columns.node_ids[node]), node)]
        while heap:
            now, _, at = heappop(heap)
            if at in found:
                continue
            found[at] = None
            edges = columns.out_edges[columns.offsets[at] : columns.offsets[at + 1]]
            then = (now + self.takes(edges, 1.0, speed)).tolist()
            for time, end in zip(then, columns.targets[edges].tolist(), strict=True):
                if end not in found and time <= 1.0 + SLACK:
                    heappush(heap, (time, int(ids[end]), end))
        return list(found)

    # -- what strategies decide -----------------------------------------------------------------------------------

    def towards(
        self, node: IntArray, targets: IntArray, which: tuple[IntArray, IntArray], allowed: BoolArray | None = None
    ) -> IntArray:
        """Return the actions that lead agents towards nodes; -1: no path."""
        games, agents = which
        has_speed, table = self._is_paced[agents], self.routes("length")
        found = np.full(node.shape, -1)
        found[~has_speed] = table.actions(node[~has_speed], targets[~has_speed], allowed)
        edge = self.edge[games, agents]
        ends = self.streets.columns.targets[edge]
        has_path = np.isfinite(table.distances(node, targets))
        on = edge >= 0
        has_path[on] |= np.isfinite(table.distances(ends[on], targets[on]))
        return np.where(has_speed, np.where(has_path, AIMS + targets, -1), found)

    def places(self, node: IntArray, which: tuple[IntArray, IntArray]) -> Places:
        """Return where agents are; those on edges are found one by one."""
        columns, edge, share = self.streets.columns, self.edge[which], self.share[which]
        xy, ids = columns.xy[node].copy(), np.full((*node.shape, 3), -1)
        on = np.nonzero(edge >= 0)
        rows = edge[on]
        ends = columns.node_ids[columns.sources[rows]], columns.node_ids[columns.targets[rows]]
        ids[on] = np.column_stack((*ends, columns.edge_ids[rows]))
        for at, edge_id, part in zip(
            np.transpose(on).tolist(), ids[on][:, 2].tolist(), share[on].tolist(), strict=True
        ):
            xy[tuple(at)] = point_along(self._graph.get_edge(edge_id).points, part)[:2]
        return Places(ids, self.offsets(which), xy)

    def offsets(self, which: tuple[IntArray, IntArray]) -> FloatArray:
        """Return how far along their edges agents are, map units."""
        edge = self.edge[which]
        return np.where(edge >= 0, self.share[which] * self.streets.columns.lengths[edge], 0.0)

    def along(self, entries: IntArray, is_from_node: BoolArray) -> IntArray:
        """Return the actions that lead to the start of an edge, and along it.

        Args:
            entries: of the edges, in `streets.targets`.
            is_from_node: whether the way begins at the node that was passed last; else at the end of the agent's edge.
        """
        return _ALONG + 2 * entries + is_from_node

    # -- moves ----------------------------------------------------------------------------------------------------

    def moves_of(self, actions: Sequence[ResolvedAction]) -> Moves:
        """Return the moves of agents that go as the turn engine has found, (agents,)."""
        ends = [[leg for leg in action.legs if leg.end in (0.0, 1.0)] for action in actions]  # who turns comes back
        nodes = [tuple([leg.target if leg.end else leg.source for leg in legs]) for legs in ends]
        pairs = zip(actions, nodes, strict=True)
        moves = super().moves_of([action._replace(path=action.path[:1] + passed) for action, passed in pairs])
        row, paths = {one: i for i, one in enumerate(self.streets.columns.edge_ids.tolist())}, moves.as_paths()
        shape = len(actions), max(len(action.legs) for action in actions)
        legs = Legs(np.full(shape, -1), *(np.zeros(shape) for _ in range(4)))
        edge, share = np.full(len(actions), -1), np.zeros(len(actions))
        for i, action in enumerate(actions):
            paths.times[i, 1 : 1 + len(ends[i])] = [leg.until for leg in ends[i]]
            for number, leg in enumerate(action.legs):
                for column, value in zip(legs, (row[leg.edge], *leg[3:7]), strict=True):
                    column[i, number] = value
            if action.progress is not None:
                edge[i], share[i] = row[action.progress.edge], action.progress.share
        stays = np.asarray((legs.edge < 0).all(axis=-1))
        waits = np.zeros_like(stays)
        paths = paths._replace(legs=legs, edge=edge, stays=stays, waits=waits, rests=edge < 0)
        return moves._replace(goes=(legs.begin != legs.end).any(axis=-1), paths=paths, progress=(edge, share))

    def moves(self, node: IntArray, actions: IntArray, games: IntArray) -> Moves:
        """Return where actions lead, of all agents of some games."""
        trip = _Trip(self, node, actions, games)
        trip.decide()
        trip.travel()
        return trip.moves()


class _Trip:
    """The ways of all agents of some games through a turn.

    Agents are numbered from 0, game by game. Each goes along steps: parts of edges, one after the other, until the turn
    is over or it is at its goal.

    Args:
        by: how they go.
        node: rows, (games, agents).
        actions: likewise.
        games: the numbers of the games.
    """

    def __init__(self, by: ByMetres, node: IntArray, actions: IntArray, games: IntArray) -> None:
        self._by, self._shape, self._games = by, node.shape, games
        agents = np.arange(node.shape[1])
        self._agents, self._actions = np.tile(agents, len(games)), actions.ravel()
        self._here, self._begun = node.ravel(), by.edge[games].ravel()
        self._from = by.share[games].ravel()
        self._is_paced = by._is_paced[self._agents]
        self._speed = by._speeds[self._agents]
        number = len(self._here)
        self._goal, self._last = np.full(number, -1), np.full(number, -1)  # nodes; the last one is next to the goal
        self._by_length = np.zeros(number, np.bool_)  # whether the way is the shortest by length
        self._is_back = np.zeros(number, np.bool_)
        self._goes = np.zeros(number, np.bool_)
        self.illegal: list[Illegal] = []
        self._edge, self._share = self._begun.copy(), self._from.copy()  # where agents are at the end
        self._count, self._passed = np.zeros(number, np.int64), np.ones(number, np.int64)  # legs and nodes
        self._legs: list[tuple[Any, ...]] = []
        self._nodes: list[tuple[Any, ...]] = []

    # -- where to -------------------------------------------------------------------------------------------------

    def decide(self) -> None:
        """Work out which way agents set off."""
        by, actions = self._by, self._actions
        chosen = np.flatnonzero(actions < STOP)
        if len(chosen):
            choices = by.choices(
                self._here[chosen], (np.repeat(self._games, self._shape[1])[chosen], self._agents[chosen])
            )
            self._aim(chosen, by.nodes(choices, actions[chosen]))
        aimed = np.flatnonzero((actions >= AIMS) & (actions < _ALONG))
        self._aim(aimed, actions[aimed] - AIMS)
        self._follow(np.flatnonzero(actions >= _ALONG))

    def _aim(self, rows: IntArray, targets: IntArray) -> None:
        """Let agents go towards nodes; those on an edge by the shorter way."""
        by, columns = self._by, self._by.streets.columns
        on_node = self._begun[rows] < 0
        away = rows[on_node & (targets != self._here[rows])]
        self._goal[rows], self._goes[away] = targets, True
        rows, targets = rows[~on_node], targets[~on_node]
        if not len(rows):
            return
        edge, share, here = self._begun[rows], self._from[rows], self._here[rows]
        end, may_turn, table = columns.targets[edge], by.back[edge] >= 0, by.routes(by.terms.weight)
        ahead = (1.0 - share) * by.terms.costs[edge] + table.distances(end, targets)
        behind = np.where(may_turn, share * by.terms.costs[edge] + table.distances(here, targets), np.inf)
        is_end, is_here = targets == end, (targets == here) & may_turn
        self._is_back[rows] = ~is_end & (is_here | (behind < ahead))
        has_way = is_end | is_here | (ahead < np.inf) | (behind < np.inf)
        self._goes[rows[has_way]] = True
        for i in np.flatnonzero(~has_way).tolist():
            known = columns.node_ids[[end[i], targets[i], here[i]]].tolist()
            message = str(NoPath(*known[:2]) if may_turn[i] or known[1] != known[2] else one_way(known[2], known[0]))
            self._refuse(int(rows[i]), message)

    def _follow(self, rows: IntArray) -> None:
        """Let agents go to an edge by the shortest way by length, and along it."""
        if not len(rows):
            return
        by, streets = self._by, self._by.streets
        entry, is_from_node = np.divmod(self._actions[rows] - _ALONG, 2)
        first, last, here = by.sources[entry], streets.targets[entry], self._here[rows]
        self._goal[rows], self._last[rows], self._by_length[rows] = first, last, True
        edge = self._begun[rows]
        end, on_edge = streets.columns.targets[edge], edge >= 0
        ahead = np.where(first == here, last, by.routes("length").following(here, first))
        is_back = on_edge & (is_from_node > 0) & (ahead != end)
        ends_there = on_edge & (is_from_node > 0) & (ahead == end) & (first == here)  # at the end of its own edge
        self._goal[rows[ends_there]], self._last[rows[ends_there]] = end[ends_there], -1
        self._is_back[rows] = is_back
        is_illegal = is_back & (by.back[edge] < 0)
        self._goes[rows[~is_illegal]] = True
        for i in np.flatnonzero(is_illegal).tolist():
            source, target = streets.columns.node_ids[[here[i], end[i]]].tolist()
            self._refuse(int(rows[i]), str(one_way(source, target)))

    def _refuse(self, row: int, message: str) -> None:
        game, agent = divmod(row, self._shape[1])
        self.illegal.append(Illegal(game, agent, f"BadValue: {message}"))

    # -- through the turn -----------------------------------------------------------------------------------------

    def travel(self) -> None:
        """Follow the ways until the turn is over."""
        rows = np.flatnonzero(self._goes)
        edge, begin, end, node = self._first_steps(rows)
        now, lengths = np.zeros(len(rows)), self._by.streets.columns.lengths
        while len(rows):
            share, metres = np.abs(end - begin), lengths[edge]
            with np.errstate(divide="ignore", invalid="ignore"):
                endless = np.where(metres > 0.0, (1.0 - now) / metres, 0.0)
                paced = self._by.takes(edge, share, self._speed[rows])
                takes = np.where(self._is_paced[rows], paced, share * metres * endless)
                part = np.where(takes < np.inf, share * (1.0 - now) / takes, 0.0)
            is_late = now + takes > 1.0 + SLACK
            stop = np.where(end > begin, begin + part, begin - part)
            on = np.flatnonzero(is_late & (part > 0.0) & (stop > 0.0) & (stop < 1.0))
            self._edge[rows[on]], self._share[rows[on]] = edge[on], stop[on]
            self._add_legs(rows[on], edge[on], begin[on], stop[on], now[on], np.ones(len(on)))
            until = np.where(now + takes < 1.0 - ROUNDED, now + takes, 1.0)
            on = np.flatnonzero(~is_late)
            rows, node = rows[on], node[on]
            self._add_legs(rows, edge[on], begin[on], end[on], now[on], until[on])
            now = until[on]
            self._nodes.append((rows, self._passed[rows], node, now))
            self._passed[rows] += 1
            self._edge[rows], self._share[rows] = -1, 0.0
            at, following = self._next_nodes(rows, node)
            rows, now = rows[at], now[at]
            edge, node = self._by.cheapest(node[at], following), following
            begin, end = np.zeros(len(rows)), np.ones(len(rows))
        stands = np.flatnonzero((self._begun >= 0) & (self._count == 0))
        whole, share = np.ones(len(stands)), self._from[stands]
        self._add_legs(stands, self._begun[stands], share, share, whole * 0.0, whole)

    def _first_steps(self, rows: IntArray) -> tuple[IntArray, FloatArray, FloatArray, IntArray]:
        """Return the edges that agents set off along, from which share to which, and the nodes that these lead to."""
        on_edge, is_back, here = self._begun[rows] >= 0, self._is_back[rows], self._here[rows]
        edge, node = self._begun[rows].copy(), here.copy()
        ahead = on_edge & ~is_back
        node[ahead] = self._by.streets.columns.targets[edge[ahead]]
        off = np.flatnonzero(~on_edge)
        at, following = self._next_nodes(rows[off], here[off], is_first=True)
        edge[off[at]], node[off[at]] = self._by.cheapest(here[off[at]], following), following
        begin = np.where(on_edge, self._from[rows], 0.0)
        return edge, begin, np.where(on_edge & is_back, 0.0, 1.0), node

    def _next_nodes(self, rows: IntArray, node: IntArray, *, is_first: bool = False) -> tuple[IntArray, IntArray]:
        """Return which agents that are on nodes go on, by their places in `rows`, and to which nodes next."""
        is_there = node == self._goal[rows]
        at_last = is_there & (self._last[rows] >= 0)
        following = np.where(at_last, self._last[rows], node)
        self._goal[rows[at_last]], self._last[rows[at_last]] = self._last[rows[at_last]], -1
        goes_on = (self._is_paced[rows] | is_first) & (~is_there | at_last)
        for by_length, weight in ((True, "length"), (False, self._by.terms.weight)):
            some = np.flatnonzero(goes_on & ~is_there & (self._by_length[rows] == by_length))
            if len(some):
                following[some] = self._by.routes(weight).following(node[some], self._goal[rows[some]])
        at = np.flatnonzero(goes_on)
        return at, following[at]

    def _add_legs(
        self, rows: IntArray, edge: IntArray, begin: FloatArray, end: FloatArray, since: FloatArray, until: FloatArray
    ) -> None:
        self._legs.append((rows, self._count[rows], edge, begin, end, since, until))
        self._count[rows] += 1

    def moves(self) -> Moves:
        """Return the ways as moves."""
        shape, number = self._shape, len(self._here)
        wide = int(self._count.max(initial=0))
        edge, others = np.full((number, wide), -1), [np.zeros((number, wide)) for _ in range(4)]
        for rows, place, edges, *columns in self._legs:
            edge[rows, place] = edges
            for column, values in zip(others, columns, strict=True):
                column[rows, place] = values
        begin, end, since, until = (column.reshape(*shape, wide) for column in others)
        legs = Legs(edge.reshape(*shape, wide), begin, end, since, until)
        most = int(self._passed.max(initial=1))
        nodes, times = np.repeat(self._here[:, None], most, axis=1), np.full((number, most), np.inf)
        times[:, 0] = 0.0
        for rows, place, node, when in self._nodes:
            nodes[rows, place], times[rows, place] = node, when
        behind = np.arange(most) >= self._passed[:, None]
        last = nodes[np.arange(number), self._passed - 1]
        nodes = np.where(behind, last[:, None], nodes)
        stays, rests = (self._count == 0).reshape(shape), (self._edge < 0).reshape(shape)
        lengths, edge_at_end = self._passed.reshape(shape), self._edge.reshape(shape)
        paths = Paths(
            nodes.reshape(*shape, most),
            times.reshape(*shape, most),
            lengths,
            stays,
            np.zeros(shape, np.bool_),
            rests,
            legs,
            edge_at_end,
        )
        ends, starts = last.reshape(shape), self._here.reshape(shape)
        before = self._begun.reshape(shape), self._from.reshape(shape)
        after = edge_at_end, self._share.reshape(shape)
        goes = (legs.begin != legs.end).any(axis=-1)
        return Moves(starts, ends, goes, paths, after, before, tuple(self.illegal))


def _motion(legs: Legs) -> IntArray:
    """Return how agents move on the last of their legs, (games, agents)."""
    last = np.maximum((legs.edge >= 0).sum(axis=-1) - 1, 0)[..., None]
    if not legs.edge.shape[-1]:
        return np.full(last.shape[:-1], Motion.STOPPED)
    way = np.take_along_axis(legs.end - legs.begin, last, axis=-1)[..., 0]
    return np.where(way > 0.0, Motion.FORWARD, np.where(way < 0.0, Motion.BACK, Motion.STOPPED))


def movement_of(game: PlayedGame, roster: Roster) -> Movement:
    """Return how the agents of a game go."""
    settings, graph = game.settings(), game.ctx.graph
    streets = Streets(graph.columns(), graph.routes)
    speeds = [None if agent.type is AgentType.AERIAL else agent.speed for agent in roster.agents]
    if settings["legal"] == "any":
        return Anywhere(streets)
    unit, weight = settings["speed_unit"], settings["weight"]
    if unit != "edges":
        costs, is_by_seconds = np.asarray(graph.graph.weights(weight), np.float64), unit == "metres_per_second"
        seconds = costs if weight == "travel_time" and is_by_seconds else None
        terms = TravelTerms(weight, costs, seconds, settings["turn_seconds"] if is_by_seconds else 1.0)
        return ByMetres(graph.graph, streets, speeds, terms)
    return Movement(streets) if speeds.count(None) == len(speeds) else ByEdges(streets, speeds)


def why_not_moved(game: PlayedGame) -> str | None:
    """Return what has no array form of how agents move, in words; None: all has."""
    settings = game.settings()
    by_metres = settings["speed_unit"] != "edges"
    reasons = [
        (by_metres and settings["legal"] == "any", f"speed_unit={settings['speed_unit']!r} with legal='any'"),
        (by_metres and settings["decide"] == "arrival", "decide='arrival'"),
        (by_metres and settings["on_illegal"] == "raise", "on_illegal='raise' in a game by metres"),
        (by_metres and len(settings["order"] or ()) > 1, "an order of play in a game by metres"),
    ]
    for agent in game.agents:
        is_endless = agent.speed is not None and not isfinite(agent.speed)
        reasons.append((agent.type is AgentType.AERIAL, f"agent {agent.name!r}, which flies"))
        reasons.append((is_endless, f"agent {agent.name!r}, whose speed is infinite"))
    return next((why for is_so, why in reasons if is_so), None)
