"""Where actions lead in many games at once: to nodes one edge away, or anywhere; see also `by_edges` and `travel`."""
# ruff: noqa: ARG002 - a movement reads no arguments that only others need

from collections.abc import Callable, Iterator, Sequence
from copy import copy
from functools import cached_property, partial
from typing import Any, NamedTuple, Self

import numpy as np

from gamms import kernels
from gamms.arguments import as_key
from gamms.errors import BadValue
from gamms.game.block.columns import kept_in
from gamms.game.movement.roads import OpenRoads, RoadMap, refuse_several_maps
from gamms.game.movement.routes import RouteTable, shared_routes
from gamms.game.movement.streets import StreetGraph
from gamms.ir.graph import ClosedEdges, FloatArray, GraphColumns, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.ir.progress import Progress
from gamms.typing.on_edges import Lines

_MOST_ACTIONS = 4096  # that masks and vectors have
_OF_MAP = ("width", "map", "_hops")  # computed attributes that depend on the open roads
_ROOM = 1 << 12  # nodes that the core lists at once, besides those of one agent


class Places(NamedTuple):
    """Positions of agents that may be on edges; the first axes of arrays are games and agents."""

    edge: IntArray  # (games, agents, 3)  ids of the nodes that it leads from and to, and its own; -1 on a node
    offset_m: FloatArray  # (games, agents)  metres along it
    xy: FloatArray  # (games, agents, 2)  map units


class Legs(NamedTuple):
    """The parts of edges that agents cover in a turn, in order, (games, agents, most); see `typing.game.Leg`.

    Attributes:
        edge: rows of edges; -1: there is no such leg.
        back: rows of the edges for turning around on each edge, when the turn was played; -1: none.
        begin, end: shares of the edge.
        since, until: times in the turn.
    """

    edge: IntArray
    back: IntArray
    begin: FloatArray
    end: FloatArray
    since: FloatArray
    until: FloatArray


class Paths(NamedTuple):
    """The nodes that agents pass in a turn, and when; of the shape (games, agents, most).

    Attributes:
        nodes: rows of nodes, beginning with the start node; after the last node, it is repeated.
        times: the times at these nodes, from 0 to 1; infinite after the last node.
        lengths: (games, agents) the number of nodes.
        stays: (games, agents) whether the agent is on the first node from 0 to 1.
        waits: (games, agents) whether the agent is on the first node until the second time, and leaves it then.
        rests: (games, agents) whether the agent is on the last node from its arrival to 1.
        legs: the legs, in games by metres.
        edge: in games by metres, (games, agents): the row of the edge that an agent is on at the end; -1: on its node.
        motion: in games by metres, (games, agents): its motion on the edge, see `ir.progress.Motion`.
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


class Movement:
    """Agents that go along one edge in a turn, or stay.

    Args:
        streets: the graph of the map.
        whole: the graph with all roads open, closed ones after all others; None: no road is closed.
        closed: the closed roads.

    Attributes:
        streets, whole, closed: the arguments of these names.
        all_roads: the open roads of each game.
        is_plain: whether the legal nodes are the own node and its neighbors in `streets`, in every game.
        leaves_nodes: whether agents may be off the nodes.
        turn_seconds: the duration of a turn, in the time unit of speeds by metres; None: speeds count edges.
        remembers: the names of the arrays (games, agents) with the covered parts of edges.
        roads: the open roads of the games; None: the roads in `streets` are open in all games.
    """

    is_plain = True
    leaves_nodes = False
    all_roads: OpenRoads
    turn_seconds: float | None = None
    remembers: tuple[str, ...] = ()
    roads: OpenRoads | None = None
    _on: RoadMap | None = None  # the map, if it is not that of the start
    _at_start: "Movement | None" = None  # on the map of the start, where this is on another one

    def __init__(
        self, streets: StreetGraph, whole: StreetGraph | None = None, closed: ClosedEdges | None = None
    ) -> None:
        self.streets = streets
        self.whole = streets if whole is None else whole
        self.closed = closed or {}
        self.edge = np.zeros((0, 0), np.int64)  # in games by metres, see `MetricMovement`
        self.share = np.zeros((0, 0))
        self.motion = np.zeros((0, 0), np.int64)
        self.now = np.zeros(0)
        self._tables: dict[str | None, RouteTable] = {}

    @property
    def columns(self) -> GraphColumns:
        """The graph that numbers the edges in `edge`: all edges that may be open in a game."""
        return self.whole.columns

    @cached_property
    def lines(self) -> Lines:
        """The polylines of the edges of `columns`."""
        return Lines(self.columns)

    def on_edge(self, which: tuple[IntArray, IntArray]) -> IntArray:
        """Return the rows of the edges that agents are on, in games by metres; -1: on a node, or a closed edge."""
        shape = np.broadcast_shapes(which[0].shape, which[1].shape)
        if not len(self.edge):
            return np.full(shape, -1)
        edge: IntArray = self.edge[which]
        is_open = self.all_roads.are_open_rows(edge.ravel(), np.broadcast_to(which[0], shape).ravel())
        return np.where(is_open.reshape(shape), edge, -1)

    @cached_property
    def width(self) -> int:
        """The number of actions: the maximum number of legal nodes of any agent, at any place.

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
        """Return the movement of the same agents on another map."""
        own = copy(self)
        own.roads = None
        own.streets = roads.streets
        own._on = roads
        own._tables = {}
        own._at_start = self
        for name in _OF_MAP:
            vars(own).pop(name, None)
        return own

    def at_start(self) -> Self:
        """Return the movement of the same agents on the map of the start."""
        own = copy(self)
        own.roads = None
        return own

    def most_legal(self, limit: int) -> int:
        """Return the maximum number of legal nodes; above the limit, any number above it."""
        return int(self.streets.counts.max(initial=1))

    def begin(self, shape: tuple[int, int]) -> None:
        """Reserve memory for these numbers of games and agents, with all agents on nodes."""
        self.all_roads = OpenRoads(self.streets, self.whole, self.closed, shape[0])

    def clear(self, games: Any, agents: Any = np.s_[:]) -> None:
        """Reset the covered parts of edges."""

    def put_on(self, games: IntArray, agent: int, place: Progress) -> None:
        """Set the covered part of an agent's edge in some games."""

    def on_edges(self, game: int, node: IntArray) -> dict[int, Progress]:
        """Return the covered parts of edges of a game's agents on these nodes, (agents,), by their numbers."""
        return {}

    def take_out(self, games: IntArray, agents: IntArray) -> None:
        """Let agents that are out of the game be where they count as being."""
        self.clear(games, agents)

    def are_plain(self, agents: IntArray) -> bool:
        """Return whether the legal moves of agents, by their numbers, are those of `streets` in all games."""
        return self.is_plain and self.roads is None

    def places(self, node: IntArray, which: tuple[IntArray, IntArray]) -> Places:
        """Return the positions of agents with these last nodes."""
        return Places(np.full((*node.shape, 3), -1), np.zeros(node.shape), self.streets.columns.xy[node])

    def counts(self, node: IntArray, which: tuple[IntArray, IntArray]) -> IntArray:
        """Return the number of legal nodes of agents.

        Args:
            node: the rows of their nodes.
            which: the numbers of their games and their numbers in the roster, which broadcast with `node`.
        """
        if self.roads is None:
            return self.streets.counts_of(node).astype(np.int64)
        tables = self.roads.tables
        places = tables.first[which[0]] + node
        found: IntArray = tables.offsets[places + 1] - tables.offsets[places]
        return found

    def legal(self, node: IntArray, which: tuple[IntArray, IntArray]) -> tuple[IntArray, BoolArray]:
        """Return the rows of the legal nodes of agents, with one axis more, and a mask of valid entries; see `counts`.

        Other entries are the nodes of the agents.
        """
        counts = self.counts(node, which)[..., None]
        columns = np.arange(int(counts.max(initial=1)))
        is_legal = columns < counts
        actions = np.where(is_legal, columns, 0)
        if self.roads is None:
            return self.streets.ends_of(node[..., None], actions), is_legal
        tables = self.roads.tables
        first = tables.offsets[tables.first[which[0]] + node]
        return tables.targets[first[..., None] + actions], is_legal

    def action_to(self, node: IntArray, which: tuple[IntArray, IntArray], targets: IntArray) -> IntArray:
        """Return the numbers of the legal nodes with the rows `targets`; -1 if one is not legal."""
        nodes, is_legal = self.legal(node, which)
        matches = (nodes == targets[..., None]) & is_legal
        return np.where(matches.any(axis=-1), matches.argmax(axis=-1), -1)

    def towards(
        self, node: IntArray, targets: IntArray, which: tuple[IntArray, IntArray], allowed: BoolArray | None = None
    ) -> IntArray:
        """Return the actions that lead agents toward nodes, as strategies do; -1: no path.

        Args:
            node: the rows of their nodes.
            targets: the rows of the targets, of the same shape.
            which: the games and the agents, by their numbers in the batch and in the roster, of the same shape.
            allowed: (nodes,) a mask of the nodes that may be entered; None: all.
        """
        return self.routes("length").actions(node, targets, allowed)

    def routes(self, weight: str | None) -> RouteTable:
        """Return the tables of paths along `streets`, by an edge weight.

        Raises:
            NeedsOneMap: the games have several maps.
        """
        if self.roads is not None:
            refuse_several_maps("what routes say")
        if as_key(weight, "weight") not in self._tables:
            self._tables[weight] = shared_routes(self.streets, weight)
        return self._tables[weight]


class MovementOnMaps(Movement):
    """The legal moves along one edge in games on several maps.

    Args:
        movements: the movement on each map.
        map_of: (games,) the number of the map of each game; it may change.
    """

    def __init__(self, movements: Sequence[Movement], map_of: IntArray) -> None:
        super().__init__(movements[0].streets)
        self._map_of = map_of
        self._counts = np.concatenate([one.streets.counts for one in movements])
        self._first = np.cumsum([0, *(one.streets.num_nodes for one in movements)])

    def counts(self, node: IntArray, which: tuple[IntArray, IntArray]) -> IntArray:
        """Return the number of legal nodes of agents."""
        found: IntArray = self._counts[self._first[self._map_of[which[0]]] + node]
        return found


class AnyNodeMovement(Movement):
    """Agents that may move to any node in a turn; in games by metres, they are never on edges."""

    is_plain = False

    def most_legal(self, limit: int) -> int:
        """Return the number of nodes."""
        return len(self.streets.counts)

    def counts(self, node: IntArray, which: tuple[IntArray, IntArray]) -> IntArray:
        """Return the number of legal nodes of agents: of all nodes."""
        return np.full(node.shape, len(self.streets.counts))

    def legal(self, node: IntArray, which: tuple[IntArray, IntArray]) -> tuple[IntArray, BoolArray]:
        """Return the rows of the legal nodes of agents: their own node, then the others."""
        actions = np.arange(len(self.streets.counts))
        here = node[..., None]
        found = np.where(actions == 0, here, actions - (actions <= here))
        return found, np.ones(found.shape, np.bool_)

    def action_to(self, node: IntArray, which: tuple[IntArray, IntArray], targets: IntArray) -> IntArray:
        """Return the numbers of the legal nodes with the rows `targets`."""
        return np.where(targets == node, 0, targets + (targets < node))

    def towards(
        self, node: IntArray, targets: IntArray, which: tuple[IntArray, IntArray], allowed: BoolArray | None = None
    ) -> IntArray:
        """Return the actions that lead to nodes, which are all legal."""
        return self.action_to(node, which, targets)


ListLegal = Callable[[int, memoryview, memoryview], int]
"""Lists legal nodes in the core; see `PacedMovement._listed`."""


class PacedMovement(Movement):
    """Agents whose legal nodes depend on their speeds and their positions on edges; the core lists these nodes.

    Args:
        streets, whole, closed: see `Movement`.
        paces: (agents,) the speeds of the agents of the roster; NaN: along one edge.

    Attributes:
        paces: see the argument.
        is_paced: (agents,) whether each agent has a speed.
    """

    is_plain = False

    def __init__(
        self, streets: StreetGraph, paces: FloatArray, whole: StreetGraph | None, closed: ClosedEdges | None
    ) -> None:
        super().__init__(streets, whole, closed)
        self.paces = paces
        self.is_paced = ~np.isnan(paces)
        self._room = np.empty(streets.num_nodes + _ROOM, np.int64)
        self.begin((0, len(paces)))

    def _listed(
        self, number: int, list_from: Callable[[int, memoryview, memoryview], int]
    ) -> tuple[IntArray, IntArray]:
        """Return legal nodes of `number` agents, as their number for each agent, and rows in sequence.

        `list_from(first, rows, counts)` writes both from an agent on, and returns the first one whose nodes did not
        fit.
        """
        counts = np.zeros(number, np.int64)
        parts = [np.zeros(0, np.int64)]
        first = 0
        while first < number:
            last = list_from(first, self._room.data, counts.data)
            parts.append(self._room[: counts[first:last].sum()].copy())
            first = last
        return counts, np.concatenate(parts)

    def _of(self, node: IntArray, which: tuple[IntArray, IntArray]) -> tuple[IntArray, IntArray]:
        """Return the legal nodes of agents as `_listed` does; the arguments are as in `counts`, and flat."""
        raise NotImplementedError

    def _flat(self, node: IntArray, which: tuple[IntArray, IntArray]) -> tuple[IntArray, IntArray]:
        games, agents = (np.broadcast_to(one, node.shape).ravel() for one in which)
        here = node.ravel()
        if self.roads is None:
            return self._of(here, (games, agents))
        parts = [(np.zeros(0, np.int64), np.zeros(0, np.int64))]
        order = [np.zeros(0, np.int64)]
        for movement, places in self._each_map(games):
            parts.append(movement._of(here[places], (games[places], agents[places])))
            order.append(places)
        back = np.argsort(np.concatenate(order), kind="stable")
        counts = np.concatenate([one for one, _ in parts])
        listed, _ = kernels.chosen_runs(np.concatenate(([0], np.cumsum(counts))), back)
        return counts[back], np.concatenate([rows for _, rows in parts])[listed]

    def _each_map(self, games: IntArray) -> Iterator[tuple[Self, IntArray]]:
        """Yield the movement on each map of some games, and the indices of its games."""
        for roads, places in self.all_roads.by_map(games):
            if roads is None:
                yield self.at_start(), places
            else:
                yield kept_in(roads.shared, "movement", partial(self.on, roads)), places

    def counts(self, node: IntArray, which: tuple[IntArray, IntArray]) -> IntArray:
        """Return the number of legal nodes of agents."""
        return self._flat(node, which)[0].reshape(node.shape)

    def legal(self, node: IntArray, which: tuple[IntArray, IntArray]) -> tuple[IntArray, BoolArray]:
        """Return the rows of the legal nodes of agents, and a mask of valid entries."""
        counts, listed = self._flat(node, which)
        columns = np.arange(int(counts.max(initial=1)))
        is_legal = columns < counts.reshape(*node.shape, 1)
        found = np.repeat(node[..., None], len(columns), axis=-1)
        found[is_legal] = listed
        return found, is_legal

    def are_plain(self, agents: IntArray) -> bool:
        """Return whether agents have no speed, and are always on nodes."""
        return not (self.leaves_nodes or self.is_paced[agents].any())
