"""Where actions lead in many games at once: to nodes one edge away, several edges away, or anywhere."""
# ruff: noqa: ARG002 - a movement reads no arguments that only others need

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from gamms import kernels
from gamms.game.batch.routes import RouteTable, shared_routes
from gamms.game.order import SLACK, edges_within
from gamms.game.streets import Streets
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray

STOP = (1 << 32) - 1  # the action of stopping where one is, in games by metres
AIMS = 1 << 32  # actions from here on are no numbers of legal nodes, but lead towards nodes; see `towards`
_MOST_KNOWN = 1 << 25  # legal nodes that are kept


class Places(NamedTuple):
    """Where agents are that may be on edges; arrays begin with the games and the agents."""

    edge: IntArray  # (games, agents, 3)  ids of the nodes that it leads from and to, and its own; -1 on a node
    offset_m: FloatArray  # (games, agents)  metres along it
    xy: FloatArray  # (games, agents, 2)  map units


class Legs(NamedTuple):
    """What agents cover of edges in a turn, one part after the other, (games, agents, most); see `typing.game.Leg`.

    Attributes:
        edge: rows of edges; -1: there is no such leg.
        begin, end: shares of the edge.
        since, until: of the turn.
    """

    edge: IntArray
    begin: FloatArray
    end: FloatArray
    since: FloatArray
    until: FloatArray


class Illegal(NamedTuple):
    """An action that could not be done: the game of the turn, the number of the agent, and why not."""

    at: int
    agent: int
    message: str


class Paths(NamedTuple):
    """The nodes that agents pass in a turn, and when; of the shape (games, agents, most).

    Attributes:
        nodes: rows of nodes, where the agent begins first; behind the last one that again.
        times: of the turn, from 0 to 1, when they are reached; behind the last one infinite.
        lengths: (games, agents) how many nodes there are.
        stays: (games, agents) who is on the first node from 0 to 1.
        waits: (games, agents) who is on the first node until the second time, and leaves it then.
        rests: (games, agents) who is on the last node from when it is reached to 1.
        legs: in games by metres.
        edge: in games by metres, (games, agents): the row of the edge that an agent is on at the end; -1: on its node.
    """

    nodes: IntArray
    times: FloatArray
    lengths: IntArray
    stays: BoolArray
    waits: BoolArray
    rests: BoolArray
    legs: Legs | None = None
    edge: IntArray | None = None

    @property
    def arrives(self) -> BoolArray:
        """At which times agents come to another node, or leave the one where they have waited; the first is none."""
        steps = np.arange(self.nodes.shape[-1])
        comes = np.concatenate((self.waits[..., None], self.nodes[..., 1:] != self.nodes[..., :-1]), axis=-1)
        comes[..., 1:2] |= self.waits[..., None]
        comes[..., 0] = False
        found: BoolArray = comes & (steps < self.lengths[..., None])
        return found

    @property
    def edges(self) -> IntArray:
        """How many edges agents go to the end of, (games, agents)."""
        found: IntArray = (self.nodes[..., 1:] != self.nodes[..., :-1]).sum(axis=-1)
        return found

    def of(self, games: IntArray) -> "Paths":
        """Return those of some games."""
        columns: list[Any] = [column[games] for column in self[:6]]
        if self.legs is not None and self.edge is not None:
            legs: list[Any] = [column[games] for column in self.legs]
            columns += [Legs(*legs), self.edge[games]]
        return Paths(*columns)

    def between(self, number: int, parts: int) -> "Paths":
        """Return the same paths, gone in that one of several equal parts of the turn."""
        goes = (self.lengths > 1)[..., None]
        times = np.where(goes, (number + self.times) / parts, self.times)
        if not number:
            return self._replace(times=times)
        nodes, later = (np.concatenate((column[..., :1], column), axis=-1) for column in (self.nodes, times))
        later = np.where(goes, later, np.concatenate((times, np.full_like(times[..., :1], np.inf)), axis=-1))
        later[..., 0] = 0.0
        lengths, waits = self.lengths + goes[..., 0], goes[..., 0]
        return Paths(nodes, later, lengths, self.stays, waits, self.rests)

    def joined(self, others: "Paths", agents: IntArray) -> "Paths":
        """Return these paths, but of some agents others."""
        most = max(self.nodes.shape[-1], others.nodes.shape[-1])
        own, new = (one._padded(most) for one in (self, others))
        for column, values in zip(own[:6], new[:6], strict=True):
            column[:, agents] = values[:, agents]
        return own

    def _padded(self, most: int) -> "Paths":
        """Return copies with so many nodes."""
        more = [(0, 0), (0, 0), (0, most - self.nodes.shape[-1])]
        columns: list[Any] = [np.pad(self.nodes, more, "edge"), np.pad(self.times, more, constant_values=np.inf)]
        columns += [column.copy() for column in self[2:6]]
        return Paths(*columns)

    def staying(self, which: BoolArray, node: IntArray) -> "Paths":
        """Return these paths, but of agents that stay, (games, agents), on these nodes."""
        nodes, times = np.where(which[..., None], node[..., None], self.nodes), self.times.copy()
        times[which, 0], times[which, 1:] = 0.0, np.inf
        lengths = np.where(which, 1, self.lengths)
        stays, waits, rests = self.stays | which, self.waits & ~which, self.rests | which
        return self._replace(nodes=nodes, times=times, lengths=lengths, stays=stays, waits=waits, rests=rests)

    def without_starts(self, which: BoolArray) -> "Paths":
        """Return these paths, but of some agents, (games, agents), without their first nodes."""
        nodes = np.concatenate((self.nodes[..., 1:], self.nodes[..., -1:]), axis=-1)
        times = np.concatenate((self.times[..., 1:], np.full_like(self.times[..., :1], np.inf)), axis=-1)
        of_some = which[..., None]
        return self._replace(
            nodes=np.where(of_some, nodes, self.nodes),
            times=np.where(of_some, times, self.times),
            lengths=self.lengths - which,
            waits=self.waits & ~which,
        )

    def spread(self, games: IntArray, number: int) -> "Paths":
        """Return them as those of so many games, of which they are some; those of the others mean nothing."""
        at = np.zeros(number, np.int64)
        at[games] = np.arange(len(games))
        return self.of(at)


class Moves(NamedTuple):
    """What agents are going to do, (games, agents).

    Attributes:
        starts, ends: rows of nodes.
        goes: which agents do not just stay.
        paths: how they go; None: along one edge, or none.
        progress: where agents are on edges at the end; see the movement that made it.
        before: the same at the beginning; of those that stay.
        illegal: actions that could not be done.
    """

    starts: IntArray
    ends: IntArray
    goes: BoolArray
    paths: Paths | None = None
    progress: tuple[Any, ...] = ()
    before: tuple[Any, ...] = ()
    illegal: tuple[Illegal, ...] = ()

    def without(self, stopped: BoolArray) -> "Moves":
        """Return the moves of which some are not made."""
        if not stopped.any():
            return self
        ends, goes, paths = np.where(stopped, self.starts, self.ends), self.goes & ~stopped, self.paths
        if paths is not None:
            paths = paths.staying(stopped, self.starts)
            if paths.legs is not None:
                paths = self._standing(paths, paths.legs, stopped)
        columns = zip(self.before, self.progress, strict=True)
        progress = tuple(np.where(stopped, before, after) for before, after in columns)
        return self._replace(ends=ends, goes=goes, paths=paths, progress=progress)

    def _standing(self, paths: Paths, legs: Legs, stopped: BoolArray) -> Paths:
        """Return paths of which some are those of agents that stand where they were when the turn began."""
        edge, share = self.before
        on_edge = edge >= 0
        stands = [np.where(on_edge, values, 0.0) for values in (share, share, 0.0, 1.0)]
        columns: list[Any] = [np.where(stopped[..., None], -1, legs.edge)]
        columns += [np.where(stopped[..., None], 0.0, column) for column in legs[1:]]
        if legs.edge.shape[-1]:
            for column, values in zip(columns, (edge, *stands), strict=True):
                column[..., 0] = np.where(stopped, values, column[..., 0])
        ends_on: IntArray = np.where(stopped, edge, -1 if paths.edge is None else paths.edge)
        stays, rests = paths.stays & ~(stopped & on_edge), paths.rests & ~(stopped & on_edge)
        return paths._replace(legs=Legs(*columns), edge=ends_on, stays=stays, rests=rests)

    def as_paths(self) -> Paths:
        """Return the paths, those along one edge or none too."""
        if self.paths is not None:
            return self.paths
        lengths = 1 + self.goes
        times = np.stack((np.zeros(lengths.shape), np.where(self.goes, 1.0, np.inf)), axis=-1)
        rests = np.ones_like(self.goes)
        return Paths(np.stack((self.starts, self.ends), axis=-1), times, lengths, ~self.goes, ~rests, rests)


class Movement:
    """Agents that go along one edge in a turn, or stay.

    Where agents may go is a *choice* of legal nodes, which has a number: here that of the node where they are. A batch
    asks for the numbers of the choices of agents, and what is in them.

    Args:
        streets: of the map.

    Attributes:
        idle: the action of agents that decide nothing.
        follows_edges: whether the first legal nodes are the own one and its neighbours.
        remembers: the names of arrays (games, agents) that say what agents have covered of an edge.
    """

    idle, follows_edges = 0, True
    remembers: tuple[str, ...] = ()

    def __init__(self, streets: Streets) -> None:
        self.streets = streets
        self.edge = self.street = np.zeros((0, 0), np.int64)  # in games by metres, see `ByMetres`
        self.share = np.zeros((0, 0))
        self.is_ahead: BoolArray = np.zeros(0, np.bool_)
        self._tables: dict[str | None, RouteTable] = {}

    def begin(self, shape: tuple[int, int]) -> None:
        """Reserve memory for so many games and agents, all of which are on nodes."""

    def clear(self, games: Any, agents: Any = np.s_[:]) -> None:
        """Let agents have covered nothing of an edge."""

    def take_out(self, games: IntArray, agents: IntArray) -> None:
        """Let agents that are out of the game be where they count as being."""
        self.clear(games, agents)

    def choices(self, node: IntArray, which: tuple[IntArray, IntArray]) -> IntArray:
        """Return the numbers of the choices of agents that are on these nodes.

        Args:
            node: rows.
            which: the games and the agents, by their numbers in the batch and in the roster, that broadcast with them.
        """
        return node

    def ends(self, moves: Moves) -> tuple[IntArray | None, IntArray]:
        """Return the places where moves begin and end, as conflicts compare them; None: at the nodes of the agents."""
        return None, moves.ends

    def places(self, node: IntArray, which: tuple[IntArray, IntArray]) -> Places:
        """Return where agents are whose last nodes these are."""
        return Places(np.full((*node.shape, 3), -1), np.zeros(node.shape), self.streets.columns.xy[node])

    def counts(self, choices: IntArray) -> IntArray:
        """Return how many nodes are legal."""
        return self.streets.counts[choices]

    def nodes(self, choices: IntArray, actions: IntArray) -> IntArray:
        """Return the rows of legal nodes by their numbers."""
        return self.streets.step(choices, actions)

    def legal(self, choices: IntArray) -> tuple[IntArray, BoolArray]:
        """Return the rows of all legal nodes, with one axis more, and which of them count."""
        counts = self.counts(choices)[..., None]
        columns = np.arange(int(counts.max(initial=1)))
        return self.nodes(choices[..., None], np.minimum(columns, counts - 1)), columns < counts

    def action_to(self, choices: IntArray, targets: IntArray) -> IntArray:
        """Return the numbers of legal nodes, by rows; -1 where one is not legal."""
        nodes, is_legal = self.legal(choices)
        matches = (nodes == targets[..., None]) & is_legal
        return np.where(matches.any(axis=-1), matches.argmax(axis=-1), -1)

    def towards(
        self, node: IntArray, targets: IntArray, which: tuple[IntArray, IntArray], allowed: BoolArray | None = None
    ) -> IntArray:
        """Return the actions that lead agents from nodes towards others, as strategies go a step; -1: no path.

        Args:
            node: rows, where they are.
            targets: rows, of the same shape.
            which: the games and the agents, by their numbers in the batch and in the roster, of the same shape.
            allowed: (nodes,) which may be entered; None: all.
        """
        return self.routes("length").actions(node, targets, allowed)

    def routes(self, weight: str | None) -> RouteTable:
        """Return the tables of ways by a weight of edges."""
        if weight not in self._tables:
            self._tables[weight] = shared_routes(self.streets, weight)
        return self._tables[weight]

    def moves(self, node: IntArray, actions: IntArray, games: IntArray) -> Moves:
        """Return where actions lead, of all agents of some games."""
        ends = self.streets.step(node, actions)
        return Moves(node, ends, ends != node)

    def keep(self, moves: Moves, games: IntArray, agents: IntArray | None = None) -> None:
        """Note what is left of moves for the next turn, of some agents; None: of all."""


class Anywhere(Movement):
    """Agents that go to any node in a turn."""

    follows_edges = False

    def counts(self, choices: IntArray) -> IntArray:
        """Return how many nodes are legal."""
        return np.full(choices.shape, len(self.streets.counts))

    def nodes(self, choices: IntArray, actions: IntArray) -> IntArray:
        """Return the rows of legal nodes: the own one, then the others."""
        found: IntArray = np.where(actions == 0, choices, actions - (actions <= choices))
        return found

    def action_to(self, choices: IntArray, targets: IntArray) -> IntArray:
        """Return the numbers of legal nodes, by rows."""
        found: IntArray = np.where(targets == choices, 0, targets + (targets < choices))
        return found

    def towards(
        self, node: IntArray, targets: IntArray, which: tuple[IntArray, IntArray], allowed: BoolArray | None = None
    ) -> IntArray:
        """Return the actions that lead to nodes, which are all legal."""
        return self.action_to(node, targets)

    def moves(self, node: IntArray, actions: IntArray, games: IntArray) -> Moves:
        """Return where actions lead."""
        ends = self.nodes(node, actions)
        return Moves(node, ends, ends != node)


class ByEdges(Movement):
    """Agents that go along several edges in a turn, or parts of one, by their speeds in edges.

    A choice is what `Legality.reachable` returns: for a speed, an entry of `streets.targets` (where an agent is, and
    the neighbour to which it has covered part of the edge, or itself), and what that part adds. Choices are found
    when they are first asked for.

    Args:
        streets: of the map.
        speeds: of the agents in the order of the roster; None: along one edge.

    Attributes:
        begun: (games, agents) the number of the neighbour to which an agent has covered part of the edge; 0: to none.
        covered: (games, agents) how much of it.
    """

    remembers = ("begun", "covered")

    def __init__(self, streets: Streets, speeds: Sequence[float | None]) -> None:
        super().__init__(streets)
        self._is_paced = np.array([speed is not None for speed in speeds], np.bool_)
        self._speeds = np.array([0.0 if speed is None else speed for speed in speeds])
        self._kinds, self._kind_of = np.unique(self._speeds, return_inverse=True)
        self._sources = np.repeat(np.arange(len(streets.counts)), streets.counts)
        self._number = np.full(len(self._kinds) * _REACHES * len(streets.targets), -1, np.int64)
        self._forget()
        self.begin((0, len(speeds)))

    def begin(self, shape: tuple[int, int]) -> None:
        """Reserve memory for so many games and agents."""
        self.begun, self.covered = np.zeros(shape, np.int64), np.zeros(shape)

    def clear(self, games: Any, agents: Any = np.s_[:]) -> None:
        """Let agents have covered nothing of an edge."""
        self.begun[games, agents] = self.covered[games, agents] = 0

    # -- legal nodes ----------------------------------------------------------------------------------------------

    def choices(self, node: IntArray, which: tuple[IntArray, IntArray]) -> IntArray:
        """Return the numbers of the choices of agents that are on these nodes."""
        agents = which[1]
        speed, begun = self._speeds[agents], self.begun[which]
        more = np.floor(edges_within(speed + self.covered[which])) - np.floor(edges_within(speed))
        kind = self._kind_of[agents] * _REACHES + np.where(begun > 0, more, 0).astype(np.int64)
        keys = kind * len(self.streets.targets) + self.streets.offsets[node] + begun
        found: IntArray = self._number[keys]
        if (found < 0).any():
            if self._used > _MOST_KNOWN:
                self._forget()
            self._learn(np.unique(keys[self._number[keys] < 0]))
            found = self._number[keys]
        return found

    def counts(self, choices: IntArray) -> IntArray:
        """Return how many nodes are legal."""
        return self._count[choices]

    def nodes(self, choices: IntArray, actions: IntArray) -> IntArray:
        """Return the rows of legal nodes by their numbers."""
        found: IntArray = self._flat[self._first[choices] + actions]
        return found

    def _forget(self) -> None:
        self._number[:] = -1
        self._first, self._count = np.zeros(0, np.int64), np.zeros(0, np.int64)
        self._flat, self._used = np.zeros(0, np.int64), 0

    def _learn(self, keys: IntArray) -> None:
        """Find these choices: nodes next to the agent, then those in reach of it, then those along the begun edge."""
        streets, nodes = self.streets, len(self.streets.counts)
        kind, entry = np.divmod(keys, len(streets.targets))
        kind, more = np.divmod(kind, _REACHES)
        here, ahead = self._sources[entry], streets.targets[entry]
        hops = np.floor(edges_within(self._kinds[kind])).astype(np.int64)
        near, runs = kernels.chosen_runs(streets.offsets, here)
        parts = [
            (np.repeat(np.arange(len(keys)), np.diff(runs)), streets.targets[near]),
            self._within(here, hops),
            self._within(ahead, np.where(ahead == here, -1, hops + more - 1)),
        ]
        at, found = (np.concatenate(columns) for columns in zip(*parts, strict=True))
        _, first = np.unique(at * nodes + found, return_index=True)
        first = np.sort(first)
        first = first[np.argsort(at[first], kind="stable")]
        counts = np.bincount(at[first], minlength=len(keys))
        self._number[keys] = len(self._first) + np.arange(len(keys))
        self._first = np.concatenate((self._first, self._used + np.cumsum(counts) - counts))
        self._count = np.concatenate((self._count, counts))
        after = self._used + len(first)
        if after > len(self._flat):
            self._flat = np.concatenate((self._flat[: self._used], np.empty(2 * after - self._used, np.int64)))
        self._flat[self._used : after], self._used = found[first], after

    def _within(self, rows: IntArray, hops: IntArray) -> tuple[IntArray, IntArray]:
        """Return the nodes at most so many edges ahead of nodes: the places in `rows`, ascending, and rows of nodes."""
        nodes, at = len(self.streets.counts), np.flatnonzero(hops >= 0)
        known = fresh = at * nodes + rows[at]
        ring = 0
        while len(fresh):
            ring += 1
            fresh = fresh[hops[fresh // nodes] >= ring]
            entries, runs = kernels.chosen_runs(self.streets.offsets, fresh % nodes)
            ends = np.repeat(fresh // nodes, np.diff(runs)) * nodes + self.streets.targets[entries]
            fresh = np.setdiff1d(ends, known)
            known = np.union1d(known, fresh)
        return known // nodes, known % nodes

    # -- moves ----------------------------------------------------------------------------------------------------

    def towards(
        self, node: IntArray, targets: IntArray, which: tuple[IntArray, IntArray], allowed: BoolArray | None = None
    ) -> IntArray:
        """Return the actions that lead agents from nodes towards others; -1: no path."""
        has_speed = self._is_paced[which[1]]
        found, table = np.full(node.shape, -1), self.routes("length")
        found[~has_speed] = table.actions(node[~has_speed], targets[~has_speed], allowed)
        here, ends = node[has_speed], targets[has_speed]
        limit = np.zeros(len(here), np.int64)
        if allowed is not None:
            limit = 1 + table.allowed_edges(here, ends, allowed, int(self._speeds.max()) + 2)
        found[has_speed] = np.where(np.isfinite(table.distances(here, ends)), AIMS * (1 + limit) + ends, -1)
        return found

    def moves(self, node: IntArray, actions: IntArray, games: IntArray) -> Moves:
        """Return where actions lead, of all agents of some games."""
        agents = np.arange(node.shape[1])
        choices = self.choices(node, (games[:, None], agents))
        is_aim = actions >= AIMS
        targets = np.where(is_aim, actions % AIMS, self.nodes(choices, np.where(is_aim, 0, actions)))
        goes = np.nonzero(targets != node)
        by_hops = ~is_aim[goes]
        aims = np.flatnonzero(~by_hops)
        those = goes[0][aims], goes[1][aims]
        by_hops[aims] = self.action_to(choices[those], targets[those]) >= 0
        limit = np.where(by_hops, _ENDLESS, actions[goes] // AIMS - 2)
        limit[limit < 0] = _ENDLESS
        way = _Way(node[goes], targets[goes], limit, self._is_paced[goes[1]])
        self._set_off(way, by_hops, self.begun[games][goes], self.covered[games][goes], self._speeds[goes[1]])
        return self._gone(node, goes, way)

    def _set_off(
        self, way: "_Way", by_hops: BoolArray, begun: IntArray, covered: FloatArray, speed: FloatArray
    ) -> None:
        """Follow ways for a turn: by the number of edges, or by their lengths."""
        tables = {True: self.routes(None), False: self.routes("length")}
        ahead = np.where(begun > 0, self.streets.step(way.here, begun), -1)
        first = way.targets.copy()  # of those that go along one edge
        for is_short, table in tables.items():
            some = np.flatnonzero(way.is_paced & (by_hops == is_short))
            first[some] = table.following(way.here[some], way.targets[some])
        other = np.flatnonzero(by_hops & (ahead >= 0) & (ahead != first))
        on = 1.0 - covered[other] + tables[True].distances(ahead[other], way.targets[other])
        on_first = other[on <= tables[True].distances(way.here[other], way.targets[other])]
        first[on_first] = ahead[on_first]
        budget = np.where(way.is_paced, speed + np.where(first == ahead, covered, 0.0), 1.0)
        most = np.minimum(np.floor(edges_within(budget)), way.limit).astype(np.int64)
        nodes, node = [way.here], way.here.copy()
        for edge in range(int(most.max(initial=0)) + 1):
            goes_on = np.flatnonzero((node != way.targets) & (edge <= most))
            ahead = node.copy() if edge else first
            for is_short, table in tables.items() if edge else ():
                some = goes_on[by_hops[goes_on] == is_short]
                ahead[some] = table.following(node[some], way.targets[some])
            enters = goes_on[edge < most[goes_on]]
            node = node.copy()
            node[enters] = ahead[enters]
            way.edges[enters] += 1
            nodes.append(node)
            stops = goes_on[edge == most[goes_on]]
            way.ahead[stops] = ahead[stops]
        way.nodes = np.stack(nodes, axis=-1)
        left = budget - way.edges
        way.share = np.where((way.edges < way.limit) & way.is_paced & (left > SLACK) & (left < 1.0), left, 0.0)

    def _gone(self, node: IntArray, goes: tuple[IntArray, ...], way: "_Way") -> Moves:
        """Return ways as moves of all agents."""
        most = way.nodes.shape[-1]
        nodes = np.repeat(node[..., None], most, axis=-1)
        lengths, begun, covered = np.ones(node.shape, np.int64), np.zeros(node.shape, np.int64), np.zeros(node.shape)
        nodes[goes], lengths[goes] = way.nodes, way.edges + 1
        at_end = way.nodes[:, -1]
        on = np.flatnonzero((way.share > 0.0) & (way.ahead >= 0) & (way.ahead != at_end))
        those = goes[0][on], goes[1][on]
        begun[those] = self.streets.action_to(at_end[on], way.ahead[on])
        covered[those] = way.share[on]
        steps = np.arange(most)
        times = np.where(steps < lengths[..., None], steps / np.maximum(lengths - 1, 1)[..., None], np.inf)
        is_moving = (lengths > 1) | (begun > 0)
        stays = lengths == 1
        paths = Paths(nodes, times, lengths, stays, np.zeros_like(stays), np.ones_like(stays))
        return Moves(node, nodes[..., -1], is_moving, paths, (begun, covered), (0, 0.0))

    def keep(self, moves: Moves, games: IntArray, agents: IntArray | None = None) -> None:
        """Note what is left of moves for the next turn, of some agents; None: of all."""
        if agents is None:
            self.begun[games], self.covered[games] = moves.progress
            return
        for column, values in zip((self.begun, self.covered), moves.progress, strict=True):
            column[np.ix_(games, agents)] = values[:, agents]


_REACHES = 3  # by how much more than the speed alone what is covered of an edge may lead: 0, 1, or 2 by rounding
_ENDLESS = AIMS  # edges: more than any way has


class _Way:
    """Where agents go in a turn, (agents,).

    Attributes:
        here, targets: rows of nodes.
        limit: how many edges they go at most.
        is_paced: which have a speed.
        edges: how many edges they go.
        nodes: (agents, most) the rows of the nodes that they pass.
        ahead: the node that comes next on the way; -1: none.
        share: how much of the edge to it they cover.
    """

    def __init__(self, here: IntArray, targets: IntArray, limit: IntArray, is_paced: BoolArray) -> None:
        self.here, self.targets, self.limit, self.is_paced = here, targets, limit, is_paced
        self.edges, self.ahead = np.zeros(len(here), np.int64), np.full(len(here), -1)
        self.nodes, self.share = here[:, None], np.zeros(len(here))
