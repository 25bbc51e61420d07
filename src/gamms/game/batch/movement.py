"""Where actions lead in many games at once: to nodes one edge away, or anywhere; see also `by_edges` and `travel`."""
# ruff: noqa: ARG002 - a movement reads no arguments that only others need

from collections.abc import Iterable
from copy import copy
from functools import cached_property
from typing import Any, NamedTuple, Self

import numpy as np

from gamms.arguments import as_key
from gamms.errors import BadValue
from gamms.game.batch.columns import some_rows
from gamms.game.batch.flights import Flights
from gamms.game.batch.roads import OpenRoads, RoadMap
from gamms.game.batch.routes import RouteTable, shared_routes
from gamms.game.batch.routes_of_maps import RoutesOfMaps
from gamms.game.streets import Streets
from gamms.ir.graph import ClosedEdges, FloatArray, GraphColumns, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.ir.progress import Motion, Progress
from gamms.typing.on_edges import Lines

NO_ACTION = -1  # of agents for which the scalar form of a strategy sets none
STOP = (1 << 32) - 1  # the action of stopping where one is, in games by metres
AIMS = 1 << 32  # actions from here on are no numbers of legal nodes, but lead towards nodes; see `towards`
ENDLESS = AIMS  # edges or nodes: more than any way has
LIMITED = 2  # how many `AIMS` an action has from where on the rest says how many nodes of the way are gone to
BY_HOPS = 1 << 61  # actions from here on lead towards nodes by as few edges as possible
_MOST_ACTIONS = 4096  # that masks and vectors have


Which = tuple[IntArray | slice, IntArray]  # games and agents, as an index


class Places(NamedTuple):
    """Where agents are that may be on edges; arrays begin with the games and the agents."""

    edge: IntArray  # (games, agents, 3)  ids of the nodes that it leads from and to, and its own; -1 on a node
    offset_m: FloatArray  # (games, agents)  metres along it
    xy: FloatArray  # (games, agents, 2)  map units


class Legs(NamedTuple):
    """What agents cover of edges in a turn, one part after the other, (games, agents, most); see `typing.game.Leg`.

    Attributes:
        edge: rows of edges; -1: there is no such leg.
        back: rows of the edges by which one turned round on each when the turn was played; -1: by none.
        begin, end: shares of the edge.
        since, until: of the turn.
    """

    edge: IntArray
    back: IntArray
    begin: FloatArray
    end: FloatArray
    since: FloatArray
    until: FloatArray

    def between(self, number: int, parts: int, rests: BoolArray) -> "Legs":
        """Return them in one of several equal parts of the turn, before and after which agents on edges stand.

        Args:
            number: of the part, from 0.
            parts: how many there are.
            rests: (games, agents) who is on a node at the end.
        """
        count, waits = (self.edge >= 0).sum(axis=-1), (self.begin[..., 0] > 0.0) & (number > 0)
        steps, stays = np.arange(self.edge.shape[-1] + 2), (count > 0) & ~rests & (number + 1 < parts)
        last = (waits + count)[..., None]
        is_first, is_last = (steps == 0) & waits[..., None], (steps == last) & stays[..., None]
        which = np.clip(steps - waits[..., None], 0, np.maximum(count - 1, 0)[..., None])
        begin, end, since, until = (np.take_along_axis(column, which, axis=-1) for column in self[2:])
        counts = (steps < last) | is_last
        columns = [
            np.where(is_last, end, begin),
            np.where(is_first, begin, end),
            np.where(is_first, 0.0, np.where(is_last, (number + 1) / parts, (number + since) / parts)),
            np.where(is_first, number / parts, np.where(is_last, 1.0, (number + until) / parts)),
        ]
        edge, back = (np.where(counts, np.take_along_axis(column, which, axis=-1), -1) for column in self[:2])
        return Legs(edge, back, *(np.where(counts, column, 0.0) for column in columns))


def last_motion(legs: Legs) -> IntArray:
    """Return how agents move on the last of their legs, (games, agents)."""
    last = np.maximum((legs.edge >= 0).sum(axis=-1) - 1, 0)[..., None]
    if not legs.edge.shape[-1]:
        return np.full(last.shape[:-1], Motion.STOPPED)
    return motion_along(np.take_along_axis(legs.end - legs.begin, last, axis=-1)[..., 0])


def motion_along(way: FloatArray) -> IntArray:
    """Return how agents move that cover such shares of an edge; see `ir.progress.Motion`."""
    return np.where(way > 0.0, Motion.FORWARD, np.where(way < 0.0, Motion.BACK, Motion.STOPPED))


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
        motion: likewise, how it moves there, see `ir.progress.Motion`.
    """

    nodes: IntArray
    times: FloatArray
    lengths: IntArray
    stays: BoolArray
    waits: BoolArray
    rests: BoolArray
    legs: Legs | None = None
    edge: IntArray | None = None
    motion: IntArray | None = None

    @property
    def arrives(self) -> BoolArray:
        """At which times agents come to another node, or leave the one where they have waited; the first is none."""
        steps = np.arange(self.nodes.shape[-1])
        comes = np.concatenate((self.waits[..., None], self.nodes[..., 1:] != self.nodes[..., :-1]), axis=-1)
        comes[..., 1:2] |= self.waits[..., None]
        comes[..., 0] = False
        return comes & (steps < self.lengths[..., None])

    @property
    def edges(self) -> IntArray:
        """How many edges agents go to the end of, (games, agents)."""
        found: IntArray = (self.nodes[..., 1:] != self.nodes[..., :-1]).sum(axis=-1)
        return found

    def of(self, games: IntArray) -> "Paths":
        """Return those of some games."""
        return some_rows(self, games)

    def _columns(self) -> list[Any]:
        """Return all arrays, those of the legs behind the others."""
        return [*self[:6]] if self.legs is None else [*self[:6], self.edge, self.motion, *self.legs]

    def _made(self, columns: list[Any]) -> "Paths":
        """Return paths of other arrays, in the order of `_columns`."""
        return Paths(*columns[:6], *((Legs(*columns[8:]), *columns[6:8]) if columns[6:] else ()))

    def between(self, number: int, parts: int) -> "Paths":
        """Return the same paths, gone in that one of several equal parts of the turn."""
        goes, legs = self.lengths > 1, self.legs
        if legs is not None and legs.edge.shape[-1]:
            goes = (legs.edge[..., 0] >= 0) & (legs.begin[..., 0] == 0.0)  # those on an edge wait there
            legs = legs.between(number, parts, self.rests)
        found = self._replace(times=(number + self.times) / parts, legs=legs)
        if not number:
            return found
        steps = np.arange(self.nodes.shape[-1] + 1)
        which, padded = steps - (goes[..., None] & (steps > 0)), found._padded(len(steps))
        nodes, times = (
            np.take_along_axis(padded.nodes, which, axis=-1),
            np.take_along_axis(padded.times, which, axis=-1),
        )
        times[..., 0] = 0.0
        return found._replace(nodes=nodes, times=times, lengths=self.lengths + goes, waits=goes)

    def joined(self, others: "Paths", agents: IntArray) -> "Paths":
        """Return these paths, but of some agents others."""
        return self.put((np.s_[:], agents), others._made([column[:, agents] for column in others._columns()]))

    def put(self, which: Which, others: "Paths") -> "Paths":
        """Return these paths, but those of some agents, by the index `which`, are others."""
        most = max(self.nodes.shape[-1], others.nodes.shape[-1])
        most_legs = max(0 if one.legs is None else one.legs.edge.shape[-1] for one in (self, others))
        own, new = (one._padded(most, most_legs) for one in (self, others))
        for column, values in zip(own._columns(), new._columns(), strict=True):
            column[which] = values
        return own

    def _padded(self, most: int, most_legs: int = 0) -> "Paths":
        """Return copies with so many nodes and legs."""
        at_front, own = [(0, 0)] * (self.nodes.ndim - 1), self._columns()
        more = [*at_front, (0, most - self.nodes.shape[-1])]
        columns: list[Any] = [np.pad(self.nodes, more, "edge"), np.pad(self.times, more, constant_values=np.inf)]
        columns += [column.copy() for column in own[2:8]]
        if self.legs is not None:
            more[-1] = 0, max(0, most_legs - self.legs.edge.shape[-1])
            columns += [np.pad(one, more, constant_values=-1 if one.dtype.kind == "i" else 0) for one in self.legs]
        return self._made(columns)

    def staying(self, which: BoolArray, node: IntArray) -> "Paths":
        """Return these paths, but of agents that stay, (games, agents), on these nodes."""
        nodes, times = np.where(which[..., None], node[..., None], self.nodes), self.times.copy()
        times[which, 0], times[which, 1:] = 0.0, np.inf
        lengths = np.where(which, 1, self.lengths)
        stays, waits, rests = self.stays | which, self.waits & ~which, self.rests | which
        found = self._replace(nodes=nodes, times=times, lengths=lengths, stays=stays, waits=waits, rests=rests)
        if self.legs is None or self.edge is None:
            return found
        edge, back, *others = self.legs
        of_stay = which[..., None]
        legs = Legs(np.where(of_stay, -1, edge), back, *(np.where(of_stay, 0.0, column) for column in others))
        return found._replace(legs=legs, edge=np.where(which, -1, self.edge))

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

    def without_legs(self) -> "Paths":
        """Return these paths in games by metres, of agents that are on no edge."""
        none, on_node = np.zeros((*self.lengths.shape, 0)), np.full(self.lengths.shape, -1)
        rows = none.astype(np.int64)
        return self._replace(legs=Legs(rows, rows, none, none, none, none), edge=on_node, motion=on_node * 0)

    def spread(self, games: IntArray, number: int) -> "Paths":
        """Return them as those of so many games, of which they are some; those of the others mean nothing."""
        at = np.zeros(number, np.int64)
        at[games] = np.arange(len(games))
        return self.of(at)


class Moves(NamedTuple):
    """What agents are going to do, (games, agents).

    Attributes:
        starts, ends: rows of nodes.
        goes: which agents on the ground do not just stay.
        paths: how they go; None: along one edge, or none.
        progress: where agents are on edges at the end; see the movement that made it.
        before: the same at the beginning; of those that stay.
        illegal: actions that could not be done.
        flights: what agents do that fly, which stay on their nodes here; None: none flies.
    """

    starts: IntArray
    ends: IntArray
    goes: BoolArray
    paths: Paths | None = None
    progress: tuple[Any, ...] = ()
    before: tuple[Any, ...] = ()
    illegal: tuple[Illegal, ...] = ()
    flights: Flights | None = None

    @property
    def acts(self) -> BoolArray:
        """Which agents go, or fly, somewhere."""
        if self.flights is None:
            return self.goes
        acts = self.goes.copy()
        acts[:, self.flights.agents] |= self.flights.goes
        return acts

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
        flights = self.flights and self.flights.without(stopped)
        return self._replace(ends=ends, goes=goes, paths=paths, progress=progress, flights=flights)

    def _standing(self, paths: Paths, legs: Legs, stopped: BoolArray) -> Paths:
        """Return paths of which some are those of agents that stand where they were when the turn began."""
        edge, share = self.before
        on_edge = edge >= 0
        stands = [np.where(on_edge, values, 0.0) for values in (share, share, 0.0, 1.0)]
        if legs.edge.shape[-1]:
            for column, values in zip((legs.edge, *legs[2:]), (edge, *stands), strict=True):
                column[..., 0] = np.where(stopped, values, column[..., 0])
        ends_on: IntArray = np.where(stopped, edge, -1 if paths.edge is None else paths.edge)
        stays, rests = paths.stays & ~(stopped & on_edge), paths.rests & ~(stopped & on_edge)
        motion: IntArray = np.where(stopped, Motion.STOPPED, Motion.STOPPED if paths.motion is None else paths.motion)
        return paths._replace(edge=ends_on, motion=motion, stays=stays, rests=rests)

    def put(self, which: Which, others: "Moves") -> "Moves":
        """Return these moves, but those of some agents, by the index `which`, are others."""
        ends, goes, progress = self.ends.copy(), self.goes.copy(), tuple(column.copy() for column in self.progress)
        for column, values in zip((ends, goes, *progress), (others.ends, others.goes, *others.progress), strict=True):
            column[which] = values
        paths = self.as_paths().put(which, others.as_paths())
        return self._replace(ends=ends, goes=goes, paths=paths, progress=progress)

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
        whole: of the map on which closed roads are open, too, behind all others; None: none is closed.
        closed: these roads.

    Attributes:
        streets, whole, closed: as given.
        all_roads: which are open in each game.
        idle: the action of agents that decide nothing.
        is_plain: whether legal are the own node and its neighbours, as `streets` has them, whatever the game.
        leaves_nodes: whether agents may be elsewhere than on nodes.
        has_aims: whether actions may also lead towards nodes that are not legal, see `towards`.
        turn_seconds: how long a turn lasts, in the time of speeds by metres; None: speeds count edges.
        remembers: the names of arrays (games, agents) that say what agents have covered of an edge.
        roads: of the games; None: in all of them those are open that are in `streets`.
    """

    idle = 0
    is_plain, leaves_nodes, has_aims = True, False, False
    all_roads: OpenRoads
    turn_seconds: float | None = None
    remembers: tuple[str, ...] = ()
    roads: OpenRoads | None = None
    _at_start: "Movement | None" = None  # on the map of the start, where this is on another one

    def __init__(self, streets: Streets, whole: Streets | None = None, closed: ClosedEdges | None = None) -> None:
        self.streets, self.whole, self.closed = streets, streets if whole is None else whole, closed or {}
        self.edge = np.zeros((0, 0), np.int64)  # in games by metres, see `ByMetres`
        self.share, self.motion, self.now = np.zeros((0, 0)), np.zeros((0, 0), np.int64), np.zeros(0)
        self._tables: dict[str | None, RouteTable] = {}

    @property
    def columns(self) -> GraphColumns:
        """The graph whose edges have the rows of `edge`: all that may be open in a game."""
        return self.whole.columns

    @cached_property
    def lines(self) -> Lines:
        """The polylines of these edges."""
        return Lines(self.columns)

    def on_edge(self, which: tuple[IntArray, IntArray]) -> IntArray:
        """Return the rows of the edges that agents are on, in games by metres; -1: on a node, or a closed edge."""
        if not len(self.edge):
            return np.full(np.broadcast_shapes(which[0].shape, which[1].shape), -1)
        edge: IntArray = self.edge[which]
        if self.all_roads.are_all_open:
            return edge
        return np.where(self.all_roads.states(edge, which[0]) > 0, -1, edge)

    @cached_property
    def width(self) -> int:
        """How many actions there are: as many as nodes are legal at most, for any agent of the game, wherever it is.

        Raises:
            BadValue: more than 4096.
        """
        if self._at_start is not None:
            return self._at_start.width
        most = self.most_legal(_MOST_ACTIONS)
        if most > _MOST_ACTIONS:
            raise BadValue(
                f"An agent may go to {most} nodes or more in a turn, and {_MOST_ACTIONS} actions are the most that "
                "masks and vectors have: give agents lower speeds, a smaller map, or leave legal='edges'."
            )
        return most

    def on(self, roads: RoadMap) -> Self:
        """Return how the same agents go in games that have a map of their own."""
        own = copy(self)
        own.roads, own.streets, own._tables, own._at_start = None, roads.streets, {}, self
        vars(own).pop("width", None)
        return own

    def most_legal(self, limit: int) -> int:
        """Return how many nodes are legal at most; a number above the limit where there are more than that."""
        return int(self.streets.counts.max(initial=1))

    def begin(self, shape: tuple[int, int]) -> None:
        """Reserve memory for so many games and agents, all of which are on nodes."""
        self.all_roads = OpenRoads(self.streets, self.whole, self.closed, shape[0])

    def clear(self, games: Any, agents: Any = np.s_[:]) -> None:
        """Let agents have covered nothing of an edge."""

    def put_on(self, games: IntArray, agent: int, place: Progress) -> None:
        """Let an agent have covered part of an edge in some games."""

    def take_out(self, games: IntArray, agents: IntArray) -> None:
        """Let agents that are out of the game be where they count as being."""
        self.clear(games, agents)

    def choices(self, node: IntArray, which: tuple[IntArray, IntArray]) -> IntArray:
        """Return the numbers of the choices of agents that are on these nodes.

        Args:
            node: rows.
            which: the games and the agents, by their numbers in the batch and in the roster, that broadcast with them.
        """
        return node if self.roads is None else self.roads.choices(node, which[0])

    def are_plain(self, agents: IntArray) -> bool:
        """Whether to some agents, by their numbers in the roster, what `streets` has is legal, whatever the game."""
        return self.is_plain and self.roads is None

    def ends(self, moves: Moves) -> tuple[IntArray | None, IntArray]:
        """Return the places where moves begin and end, as conflicts compare them; None: at the nodes of the agents."""
        return None, moves.ends

    def places(self, node: IntArray, which: tuple[IntArray, IntArray]) -> Places:
        """Return where agents are whose last nodes these are."""
        return Places(np.full((*node.shape, 3), -1), np.zeros(node.shape), self.streets.columns.xy[node])

    def counts(self, choices: IntArray) -> IntArray:
        """Return how many nodes are legal."""
        return self.streets.counts_of(choices).astype(np.int64) if self.roads is None else self.roads.counts(choices)

    def nodes(self, choices: IntArray, actions: IntArray) -> IntArray:
        """Return the rows of legal nodes by their numbers."""
        return self.streets.ends_of(choices, actions) if self.roads is None else self.roads.ends(choices, actions)

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
        return self.ways("length").actions(node, targets, allowed, at=which[0])

    def first_nodes(self, node: IntArray, actions: IntArray, which: tuple[IntArray, IntArray]) -> IntArray:
        """Return the nodes that agents name first who decide such actions; -1: none.

        Args:
            node: rows, where they are.
            actions: what forms of strategies give, of the same shape.
            which: see `towards`.
        """
        return self.nodes(self.choices(node, which), actions)

    def ways(self, weight: str | None) -> RouteTable | RoutesOfMaps:
        """Return the tables of ways in all games, by their numbers in the batch."""
        return self.routes(weight) if self.roads is None else RoutesOfMaps(self.roads, weight, None)

    def routes(self, weight: str | None) -> RouteTable:
        """Return the tables of ways along `streets`, by a weight of edges."""
        if as_key(weight, "weight") not in self._tables:
            self._tables[weight] = shared_routes(self.streets, weight)
        return self._tables[weight]

    def moves(self, node: IntArray, actions: IntArray, games: IntArray) -> Moves:
        """Return where actions lead, of all agents of some games."""
        ends = self.nodes(self.choices(node, (games[:, None], np.arange(node.shape[1]))), actions)
        return Moves(node, ends, ends != node)

    def left_of(self, moves: Moves) -> Iterable[tuple[Any, Any]]:
        """Return what is left of moves for the next turn: the columns of all games, and the values of some."""
        return ()

    def keep(self, moves: Moves, games: IntArray, agents: IntArray | None = None) -> None:
        """Note what is left of moves for the next turn, of some agents; None: of all."""
        for column, values in self.left_of(moves):
            if agents is None:
                column[games] = values
            else:
                column[np.ix_(games, agents)] = values[:, agents]


class Anywhere(Movement):
    """Agents that go to any node in a turn; in games by metres, rules find them on no edge."""

    is_plain = False

    def begin(self, shape: tuple[int, int]) -> None:
        """Reserve memory for so many games and agents."""
        super().begin(shape)
        if self.turn_seconds is not None:
            self.edge = np.full(shape, -1)

    def moves(self, node: IntArray, actions: IntArray, games: IntArray) -> Moves:
        """Return where actions lead, of all agents of some games."""
        return self._without_legs(super().moves(node, actions, games))

    def _without_legs(self, moves: Moves) -> Moves:
        if self.turn_seconds is None:
            return moves
        place = np.full(moves.ends.shape, -1), np.zeros(moves.ends.shape)
        return moves._replace(paths=moves.as_paths().without_legs(), progress=place, before=place)

    def choices(self, node: IntArray, which: tuple[IntArray, IntArray]) -> IntArray:
        """Return the numbers of the choices of agents: those of their nodes, whatever roads are open."""
        return node

    def most_legal(self, limit: int) -> int:
        """Return how many nodes there are."""
        return len(self.streets.counts)

    def counts(self, choices: IntArray) -> IntArray:
        """Return how many nodes are legal."""
        return np.full(choices.shape, len(self.streets.counts))

    def nodes(self, choices: IntArray, actions: IntArray) -> IntArray:
        """Return the rows of legal nodes: the own one, then the others."""
        return np.where(actions == 0, choices, actions - (actions <= choices))

    def action_to(self, choices: IntArray, targets: IntArray) -> IntArray:
        """Return the numbers of legal nodes, by rows."""
        return np.where(targets == choices, 0, targets + (targets < choices))

    def towards(
        self, node: IntArray, targets: IntArray, which: tuple[IntArray, IntArray], allowed: BoolArray | None = None
    ) -> IntArray:
        """Return the actions that lead to nodes, which are all legal."""
        return self.action_to(node, targets)
