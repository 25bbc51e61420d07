"""Where actions lead in many games at once, and how much of their edges agents have covered.

The core finds the legal nodes of agents with speeds; see `core.by_edges` and `core.travel`.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from copy import copy
from functools import cached_property, partial
from typing import Any, NamedTuple, Self

import numpy as np

from gamms import kernels
from gamms.arguments import as_key
from gamms.core import travel as core
from gamms.core.by_edges import LegalByEdges
from gamms.errors import BadValue
from gamms.game.block.columns import PlayedGame, get_or_make
from gamms.game.movement.roads import (
    ModeEdges,
    OpenRoads,
    RoadMap,
    RoadTables,
    TrafficOnMaps,
    refuse_several_maps,
)
from gamms.game.movement.routes import RouteTable, get_shared_routes
from gamms.game.movement.streets import StreetGraph, as_table
from gamms.game.movement.travel import ReachableNodes, make_map
from gamms.ir.graph import ClosedEdges, FloatArray, GraphColumns, IntArray, split_mode
from gamms.ir.obstacles import BoolArray
from gamms.ir.progress import Progress
from gamms.kernels import as_buffer
from gamms.typing.context import HostContext
from gamms.typing.on_edges import Lines, locate

_MOST_ACTIONS = 4096  # that masks and vectors have
_OF_MAP = ("map", "_legal_nodes")  # computed attributes that depend on the open roads
_ROOM = 1 << 12  # nodes that the core lists at once, besides those of one agent
_AT_ONCE = 1 << 12  # positions at which the most legal nodes are looked for


class Places(NamedTuple):
    """Positions of agents that may be on edges; the first axes of arrays are games and agents."""

    edge: IntArray  # (games, agents, 3)  ids of the nodes that it leads from and to, and its own; -1 on a node
    offset_m: FloatArray  # (games, agents)  metres along it
    xy: FloatArray  # (games, agents, 2)  map units


class TravelTerms(NamedTuple):
    """How agents travel by metres.

    Attributes:
        weight: the edge weight by which agents choose paths.
        are_limited: whether the weights are the minimum travel times of edges, in seconds.
        turn_seconds: the duration of a turn, in the time unit of speeds.
        decides_at_arrivals: whether agents decide on arrival; see `arrivals`.
    """

    weight: str
    are_limited: bool
    turn_seconds: float
    decides_at_arrivals: bool = False

    @classmethod
    def from_game(cls, game: PlayedGame) -> "TravelTerms":
        """Return the terms of a game by metres."""
        settings = game.settings()
        weight = settings["weight"]
        is_by_seconds = settings["speed_unit"] == "metres_per_second"
        are_limited = weight == "travel_time" and is_by_seconds
        turn_seconds = settings["turn_seconds"] if is_by_seconds else 1.0
        return cls(weight, are_limited, turn_seconds, settings["decide"] == "arrival")


class Movement:
    """The legal nodes of the agents of many games, and the parts of edges that they have covered.

    Args:
        streets: the graph of the map.
        whole: the graph with all roads open, closed ones after all others; None: no road is closed.
        closed: the closed roads.
        speeds: the speeds of agents in the order of the roster, None for one edge in a turn; None instead: legal nodes
            do not depend on speeds.
        terms: how agents travel by metres; None: speeds count edges.
        modes: the mode of each agent, by which it may use edges; None: all edges.
        are_all_legal: whether agents may move to any node in a turn; by metres, they are never on edges.
        weight: the weight by which agents that obey turns choose among parallel edges.

    Attributes:
        streets, whole, closed, are_all_legal: the arguments of these names.
        depends_on_speeds: whether legal nodes depend on speeds and on the positions of agents on edges.
        paces: (agents,) the speeds, in edges at most the number of nodes; NaN: along one edge.
        is_paced: (agents,) whether each agent has a speed.
        modes: the modes of agents.
        mode_edges: the edges of `whole` for each mode.
        mode_of: (agents,) the number of each agent's mode, from 1; 0: it may use all edges.
        by_metres: whether agents may be anywhere on edges, and move by speeds in metres.
        leaves_nodes: whether agents may be off the nodes.
        all_roads: the open roads of each game.
        tables: the legal nodes of games along one edge on several maps; None: they are on one.
        apart: the legal nodes and positions in games of which only contexts know them; None: in none.
        traffic: the states of agents by edges that obey turn restrictions; None: there are none.
        previous: (games, agents) the column of this name.
        edge: (games, agents) the column `edge` or `begun` of the games; see `BatchColumns`.
        share: (games, agents) the column `share` or `covered`.
        motion, time: the columns of these names.
    """

    all_roads: OpenRoads
    edge: IntArray
    share: FloatArray
    motion: IntArray
    time: FloatArray
    previous: IntArray
    traffic: TrafficOnMaps | None = None
    tables: RoadTables | None = None
    apart: "MovesInContexts | None" = None
    _on: RoadMap | None = None  # the map, if it is not that of the start
    _is_on_one_map = False  # whether all games that it is asked for are on `_on`

    def __init__(
        self,
        streets: StreetGraph,
        whole: StreetGraph | None = None,
        closed: ClosedEdges | None = None,
        *,
        speeds: Sequence[float | None] | None = None,
        terms: TravelTerms | None = None,
        modes: Sequence[str | None] = (),
        are_all_legal: bool = False,
        weight: str | None = "length",
    ) -> None:
        self.streets = streets
        self.whole = streets if whole is None else whole
        self.closed = closed or {}
        self.are_all_legal = are_all_legal
        self.depends_on_speeds = speeds is not None
        self.by_metres = terms is not None
        self.leaves_nodes = self.by_metres
        # No path to a node has more edges than there are nodes.
        most = np.inf if self.by_metres else streets.num_nodes
        self.paces = np.array([np.nan if speed is None else min(speed, most) for speed in speeds or ()], np.float64)
        self.is_paced = ~np.isnan(self.paces)
        self.modes = [*dict.fromkeys(mode for mode in modes if mode is not None)]
        number_of: dict[str | None, int] = {mode: number for number, mode in enumerate(self.modes, 1)}
        of_each = modes or [None] * len(self.paces)
        self.mode_of = np.array([number_of.get(mode, 0) for mode in of_each], np.int64)
        self.mode_edges = [ModeEdges(self.whole.columns, mode) for mode in self.modes]
        self._weight = weight
        self._terms = terms
        self._costs = None if terms is None else self._weigh(terms.weight)
        self._tables: dict[str | None, RouteTable] = {}

    # -- the map --------------------------------------------------------------------------------------------------

    @property
    def roads(self) -> OpenRoads | None:
        """The open roads of each game; None: the roads in `streets` are open in all games."""
        return None if self._is_on_one_map or not self.all_roads.differ else self.all_roads

    @property
    def columns(self) -> GraphColumns:
        """The graph that numbers the edges in `edge`: all edges that may be open in a game."""
        return self.whole.columns

    @cached_property
    def lines(self) -> Lines:
        """The polylines of the edges of `columns`."""
        return Lines(self.columns)

    @property
    def terms(self) -> TravelTerms:
        """How agents travel by metres."""
        assert self._terms is not None  # noqa: S101 - asked by metres only
        return self._terms

    def _weigh(self, weight: str) -> FloatArray:
        """Return the weights (modes + 1, edges) of all edges, without a mode and for each mode."""
        return np.array([self.whole.weights(weight), *[one.weights(weight) for one in self.mode_edges]], np.float64)

    @property
    def costs(self) -> FloatArray:
        """The costs (modes + 1, edges) by which agents choose paths by metres, without a mode and for each mode."""
        assert self._costs is not None  # noqa: S101 - asked by metres only
        return self._costs

    @property
    def is_plain(self) -> bool:
        """Whether the legal nodes are the own node and its neighbors in `streets`, in every game."""
        return not (self.are_all_legal or self.depends_on_speeds or self.apart is not None)

    @property
    def acts_by_paths(self) -> bool:
        """Whether actions toward nodes may be paths, which are not numbers of legal nodes."""
        return self.depends_on_speeds and self.apart is None

    @property
    def is_endless(self) -> bool:
        """Whether an agent goes any distance in a turn, by metres."""
        return not self.terms.are_limited and bool(np.isinf(self.paces).any())

    @cached_property
    def map(self) -> core.RoadEdges:
        """The map in the form of the core."""
        return self.make_map()

    def make_map(self) -> core.RoadEdges:
        """Return the map in the form of the core, for one thread."""
        terms = self.terms
        leaving, _ = self.all_roads.get_edges([self._on])
        costs = self.costs if self._on is None else self.costs[self._on.mode]
        return make_map(self.columns, costs, costs if terms.are_limited else None, terms.turn_seconds, leaving)

    def get_for_map(self, roads: RoadMap) -> Self:
        """Return the movement of the same agents on another map."""
        own = self.get_for_start()
        own.streets = roads.streets
        own._on = roads
        own._tables = {}
        for name in _OF_MAP:
            vars(own).pop(name, None)
        return own

    def get_for_start(self) -> Self:
        """Return the movement of the same agents on the map of the start."""
        own = copy(self)
        own._is_on_one_map = True
        return own

    def add_contexts(self, apart: "MovesInContexts") -> Self:
        """Return the movement in which legal nodes and positions of some games are those of their contexts."""
        own = copy(self)
        own.apart = apart
        own.leaves_nodes = True
        return own

    def _select_maps(self, games: IntArray, modes: IntArray | None = None) -> Iterator[tuple[Self, IntArray]]:
        """Yield the movement on each map of some games, for each mode, and the indices of its games.

        Args:
            games: the numbers of the games.
            modes: the numbers of the modes of an agent of each; None: agents may use all edges.
        """
        for roads, places in self.all_roads.group_by_map(games):
            of_each = np.zeros(len(places), np.int64) if modes is None else modes[places]
            for mode in np.unique(of_each).tolist():
                one = self.all_roads.get_mode_map(roads, mode)
                chosen = places[of_each == mode]
                if one is None:
                    yield self.get_for_start(), chosen
                else:
                    yield get_or_make(one.shared, "movement", partial(self.get_for_map, one)), chosen

    def get_routes(self, weight: str | None) -> RouteTable:
        """Return the tables of paths along `streets`, by an edge weight.

        Raises:
            NeedsOneMap: the games have several maps.
        """
        if self.roads is not None:
            refuse_several_maps("what routes say")
        if as_key(weight, "weight") not in self._tables:
            self._tables[weight] = get_shared_routes(self.streets, weight)
        return self._tables[weight]

    # -- parts of edges -------------------------------------------------------------------------------------------

    def begin(
        self,
        edge: IntArray,
        share: FloatArray,
        motion: IntArray,
        time: FloatArray,
        previous: IntArray,
        driven: IntArray,
    ) -> None:
        """Begin games with the roads of the map open, given the columns that say where agents are, and came from."""
        self.all_roads = OpenRoads(self.streets, self.whole, self.closed, len(time), self.mode_edges)
        self.edge = edge
        self.share = share
        self.motion = motion
        self.time = time
        self.previous = previous
        if driven.size and any(one.traffic is not None for one in self.mode_edges):
            self.traffic = TrafficOnMaps(self.all_roads, self.mode_of, self._weight, driven)

    @property
    def has_driven(self) -> bool:
        """Whether games have a column of what agents have driven that obey turns."""
        return not self.by_metres and any(split_mode(mode)[1] for mode in self.modes)

    @property
    def num_states(self) -> int:
        """The number of states of traffic of agents by edges that obey turns."""
        return 0 if self.traffic is None else self.traffic.num_states

    def list_modes(self, agents: IntArray) -> IntArray:
        """Return the numbers of the modes of agents, each once; none in games without modes."""
        return np.unique(self.mode_of[agents]) if self.modes else np.zeros(0, np.int64)

    def obey_turns(self, agents: IntArray) -> bool:
        """Return whether any of some agents obeys turn restrictions."""
        return any(split_mode(self.modes[number - 1])[1] for number in self.list_modes(agents).tolist() if number > 0)

    def find_mode_offset(self, agent: int, tables: RoadTables) -> int:
        """Return the offset from `tables.first` to the edges that an agent may use, by its number."""
        return int(self.mode_of[agent]) * tables.stride if self.modes else 0

    def clear(self, games: Any, agents: Any = np.s_[:]) -> None:
        """Reset the covered parts of edges."""
        if self.depends_on_speeds:
            self.edge[games, agents] = -1
            self.share[games, agents] = 0.0

    def take_out(self, games: IntArray, agents: IntArray) -> None:
        """Reset the covered parts of edges of eliminated agents; by metres, they keep their positions."""
        if not self.by_metres:
            self.clear(games, agents)

    def put_on(self, agent: int, place: Progress) -> None:
        """Set the covered part of an agent's edge in a block of one game."""
        if self.by_metres:
            rows = np.flatnonzero(self.columns.edge_ids == place.edge)
            if not len(rows):  # the edge was removed
                return
            self.motion[0, agent] = place.motion
        elif self.depends_on_speeds:
            rows = self.streets.rows([place.target])
        else:
            return
        self.edge[0, agent] = rows[0]
        self.share[0, agent] = place.share

    def find_edge_positions(self, game: int, node: IntArray) -> dict[int, Progress]:
        """Return the covered parts of edges of a game's agents on these nodes, (agents,), by their numbers."""
        if not self.depends_on_speeds:
            return {}
        if self.by_metres:
            return self.make_progress(self.edge[game], self.share[game], self.motion[game])
        agents = np.flatnonzero(self.edge[game] >= 0)
        ids = self.streets.ids
        each = ids(node[agents]), ids(self.edge[game, agents]), self.share[game, agents]
        found = zip(*(one.tolist() for one in each), strict=True)
        return {agent: Progress(*one) for agent, one in zip(agents.tolist(), found, strict=True)}

    def make_progress(self, edge: IntArray, share: FloatArray, motion: IntArray) -> dict[int, Progress]:
        """Return the positions of agents on edges, by their places; edges of -1 are nodes."""
        places = np.flatnonzero(edge >= 0)
        columns = self.columns
        edges = edge[places]
        ends = columns.node_ids[columns.sources[edges]], columns.node_ids[columns.targets[edges]]
        each = (*ends, share[places], columns.edge_ids[edges], motion[places])
        found = zip(*(one.tolist() for one in each), strict=True)
        return {place: Progress(*one) for place, one in zip(places.tolist(), found, strict=True)}

    def find_edges(self, which: tuple[IntArray, IntArray]) -> IntArray:
        """Return the rows of the edges that agents are on, in games by metres; -1: on a node, or a closed edge."""
        shape = np.broadcast_shapes(which[0].shape, which[1].shape)
        if not (self.by_metres):
            return np.full(shape, -1)
        edge: IntArray = self.edge[which]
        is_open = self.all_roads.are_open_rows(edge.ravel(), np.broadcast_to(which[0], shape).ravel())
        return np.where(is_open.reshape(shape), edge, -1)

    def leave_closed_edges(self, games: IntArray, members: BoolArray) -> tuple[IntArray, IntArray, IntArray]:
        """Put agents on closed edges back on the nodes that they passed last; return their games, numbers and edges.

        Args:
            games: the numbers of the games.
            members: (games, agents) a mask of the agents that leave their edges.
        """
        at, agents = np.nonzero(members & (self.edge[games] >= 0))
        edges = self.edge[games[at], agents]
        is_closed = ~self.all_roads.are_open_rows(edges, games[at])
        those = games[at[is_closed]], agents[is_closed]
        self.clear(*those)
        return (*those, edges[is_closed])

    def find_reverse_edges(self, edges: IntArray, games: IntArray, modes: IntArray | None = None) -> IntArray:
        """Return the rows of the edges by which agents turn around on edges in these games, (edges,); -1: none.

        Args:
            edges: rows.
            games: the number of the game of each edge.
            modes: the number of the mode of an agent on each; None: agents may use all edges.
        """
        found = np.full(len(edges), -1)
        for movement, places in self._select_maps(games, modes):
            backs = found[places]
            core.find_reverse_edges(movement.map, as_buffer(edges[places]), backs.data)
            found[places] = backs
        return found

    def make_places(self, node: IntArray, which: tuple[IntArray, IntArray]) -> Places:
        """Return the positions of agents with these last nodes."""
        columns = self.columns
        edge = self.find_edges(which)
        ids = np.full((*node.shape, 3), -1)
        offset_m = np.zeros(node.shape)
        xy = columns.xy[node]
        on = np.nonzero(edge >= 0)
        if len(on[0]):
            rows = edge[on]
            share = self.share[which][on]
            ends = columns.node_ids[columns.sources[rows]], columns.node_ids[columns.targets[rows]]
            ids[on] = np.column_stack((*ends, columns.edge_ids[rows]))
            offset_m[on] = share * columns.lengths[rows]
            xy[on] = np.column_stack(self.lines.find_points(rows, share)[:2])
        found = Places(ids, offset_m, xy)
        return found if self.apart is None else self.apart.put_places(found, which)

    # -- legal edges ----------------------------------------------------------------------------------------------

    def list_legal_edges(self, node: IntArray, which: tuple[IntArray, IntArray]) -> IntArray:
        """Return the ids of the edges that agents may name, with one axis more, ascending, padded with -1.

        See `count_legal` for the arguments; no agent flies.
        """
        columns = self.columns
        games, agents = (numbers.ravel() for numbers in np.broadcast_arrays(*which))
        on_edge = self.make_places(node, which).edge[..., 2].ravel()
        here = node.ravel()
        obeys = np.zeros(len(here), np.bool_) if self.traffic is None else self.traffic.obeys[agents]
        at: list[IntArray] = [np.flatnonzero(on_edge >= 0)]
        found: list[IntArray] = [on_edge[at[0]]]
        rows = kernels.find_rows(columns.edge_ids, found[0], columns.edge_order)
        backs = self.find_reverse_edges(rows, games[at[0]])
        at.append(at[0][backs >= 0])
        found.append(columns.edge_ids[backs[backs >= 0]])
        modes = self.mode_of[agents] if self.modes else None
        for movement, places in () if self.are_all_legal else self._select_maps(games, modes):
            offsets, edges = movement.all_roads.get_edges([movement._on])[0]
            chosen = places[(on_edge[places] < 0) & ~obeys[places]]
            number, place = kernels.expand_ranges(offsets[here[chosen]], offsets[here[chosen] + 1])
            leaving = edges[place]
            goes = columns.targets[leaving] != here[chosen[number]]
            at.append(chosen[number[goes]])
            found.append(columns.edge_ids[leaving[goes]])
        if self.traffic is not None and obeys.any():
            chosen = np.flatnonzero(obeys)
            number, edges = self._list_edges_onward(here[chosen], games[chosen], agents[chosen])
            at.append(chosen[number])
            found.append(columns.edge_ids[edges])
        ids = as_table(np.concatenate(at), np.concatenate(found), len(here))
        return ids.reshape(*node.shape, -1)

    # -- legal nodes ----------------------------------------------------------------------------------------------

    @cached_property
    def width(self) -> int:
        """The number of actions: the maximum number of legal nodes of any agent, at any place.

        Raises:
            BadValue: more than 4096.
        """
        most = self.count_most_legal(_MOST_ACTIONS)
        if most > _MOST_ACTIONS:
            raise BadValue(
                f"An agent may go to {most} nodes or more in a turn, and {_MOST_ACTIONS} actions are the most that "
                "masks and vectors have: give agents lower speeds, a smaller map, or leave legal='edges'."
            )
        return most

    def count_most_legal(self, limit: int) -> int:
        """Return the maximum number of legal nodes; above the limit, any number above it."""
        if self.are_all_legal:
            return self.streets.num_nodes
        if self.modes and self.roads is not None:
            maps = [self.all_roads.get_mode_map(None, mode) for mode in np.unique(self.mode_of).tolist()]
            each = [self.get_for_start() if one is None else self.get_for_map(one) for one in maps]
            return max(one.count_most_legal(limit) for one in each)
        if not self.depends_on_speeds:
            return int(self.streets.counts.max(initial=1))
        most = 1
        for speed in np.unique(self.paces).tolist():
            if most <= limit:
                most = max(
                    most,
                    self._count_most_by_metres(speed, limit) if self.by_metres else self._count_most_by_edges(speed),
                )
        return most

    def _count_most_by_edges(self, speed: float) -> int:
        """Return the maximum number of legal nodes at a speed; if it is an integer, no agent is on an edge."""
        streets = self.streets
        if speed >= streets.num_nodes:
            return streets.num_nodes
        nodes = np.arange(streets.num_nodes)
        if not speed % 1.0:
            return self._count_most_at_places(nodes, np.full(len(nodes), -1), speed)
        return self._count_most_at_places(np.repeat(nodes, streets.counts), streets.targets, speed)

    def _count_most_at_places(self, node: IntArray, ahead: IntArray, speed: float) -> int:
        """Return the maximum number of legal nodes at positions on edges covered to the end, at a speed in edges."""
        most = 1
        for first in range(0, len(node), _AT_ONCE):
            some = slice(first, first + _AT_ONCE)
            here = node[some]
            nothing = np.zeros(len(here))
            columns = ahead[some], np.ones(len(here)), nothing.astype(np.int64), np.full(len(here), speed), nothing
            most = max(most, int(self._find_at(self._legal_nodes, here, *columns)[0].max(initial=1)))
        return most

    def _count_most_by_metres(self, speed: float, limit: int) -> int:
        """Return the maximum number of legal nodes at a speed; on an edge, both its ends together have more."""
        columns = self.streets.columns
        most = 1
        nodes = self.streets.num_nodes
        reached = list[set[int]]()
        for first in range(0, nodes, _AT_ONCE):
            here = np.arange(first, min(first + _AT_ONCE, nodes))
            nothing = np.zeros(len(here))
            on_nodes = np.full(len(here), -1), nothing, nothing.astype(np.int64)
            counts, listed = self._find_at(self._legal_nodes, here, *on_nodes, np.full(len(here), speed), nothing)
            reached += [{*rows.tolist()} for rows in np.split(listed, np.cumsum(counts)[:-1])]
            most = max(most, int(counts.max()))
            if most > limit:
                return most
        for source, target in zip(columns.sources.tolist(), columns.targets.tolist(), strict=True):
            most = max(most, len(reached[source] | reached[target]))
        return most

    def are_plain(self, agents: IntArray) -> bool:
        """Return whether the legal moves of agents, by their numbers, are those of `streets` in all games."""
        if self.acts_by_paths:
            return self.roads is None and not (self.leaves_nodes or self.is_paced[agents].any())
        return self.is_plain and self.roads is None

    def count_legal(self, node: IntArray, which: tuple[IntArray, IntArray]) -> IntArray:
        """Return the number of legal nodes of agents.

        Args:
            node: the rows of their nodes.
            which: the numbers of their games and their numbers in the roster, which broadcast with `node`.
        """
        found: IntArray
        if self.are_all_legal:
            found = np.full(node.shape, self.streets.num_nodes)
        elif self.depends_on_speeds:
            found = self._find(node, which)[0].reshape(node.shape)
        else:
            found = self._count_on_streets(node, which)
        return found if self.apart is None else self.apart.put_counts(found, which)

    def find_legal(self, node: IntArray, which: tuple[IntArray, IntArray]) -> tuple[IntArray, BoolArray]:
        """Return the rows of the legal nodes of agents, with one axis more, and a mask of them; see `count_legal`.

        Other entries are the nodes of the agents.
        """
        if self.are_all_legal:
            actions = np.arange(self.streets.num_nodes)
            here = node[..., None]
            found = np.where(actions == 0, here, actions - (actions <= here))
            is_legal: BoolArray = np.ones(found.shape, np.bool_)
        elif self.depends_on_speeds:
            counts, listed = self._find(node, which)
            columns = np.arange(int(counts.max(initial=1)))
            is_legal = columns < counts.reshape(*node.shape, 1)
            found = np.repeat(node[..., None], len(columns), axis=-1)
            found[is_legal] = listed
        else:
            counts = self._count_on_streets(node, which)[..., None]
            columns = np.arange(int(counts.max(initial=1)))
            is_legal = columns < counts
            found = self._find_ends_on_streets(node, which, np.where(is_legal, columns, 0))
        return (found, is_legal) if self.apart is None else self.apart.put_legal(found, is_legal, which)

    @property
    def _table(self) -> RoadTables | None:
        """The legal nodes along one edge on all maps of the games; None: they are those of `streets`."""
        return self.tables if self.roads is None else self.roads.tables

    def _count_on_streets(self, node: IntArray, which: tuple[IntArray, IntArray]) -> IntArray:
        """Return the number of legal nodes of agents that move along one edge."""
        tables = self._table
        if tables is None:
            return self.streets.count_legal(node).astype(np.int64)
        places = tables.first[which[0]] + node
        found: IntArray = tables.offsets[places + 1] - tables.offsets[places]
        return found

    def _find_ends_on_streets(self, node: IntArray, which: tuple[IntArray, IntArray], actions: IntArray) -> IntArray:
        """Return the rows of the nodes that actions of such agents lead to; actions have one axis more."""
        tables = self._table
        if tables is None:
            return self.streets.find_ends(node[..., None], actions)
        first = tables.offsets[tables.first[which[0]] + node]
        found: IntArray = tables.targets[first[..., None] + actions]
        return found

    def find_action(self, node: IntArray, which: tuple[IntArray, IntArray], targets: IntArray) -> IntArray:
        """Return the numbers of the legal nodes with the rows `targets`; -1 if one is not legal."""
        if self.are_all_legal and self.apart is None:
            return np.where(targets == node, 0, targets + (targets < node))
        nodes, is_legal = self.find_legal(node, which)
        matches = (nodes == targets[..., None]) & is_legal
        return np.where(matches.any(axis=-1), matches.argmax(axis=-1), -1)

    def find_action_towards(self, node: IntArray, targets: IntArray, allowed: BoolArray | None = None) -> IntArray:
        """Return the actions that lead agents toward nodes, as strategies do; -1: no path.

        Args:
            node: the rows of their nodes.
            targets: the rows of the targets, of the same shape.
            allowed: (nodes,) a mask of the nodes that may be entered; None: all.
        """
        if self.are_all_legal:
            return np.where(targets == node, 0, targets + (targets < node))
        return self.get_routes("length").actions(node, targets, allowed)

    # -- legal nodes that depend on speeds ------------------------------------------------------------------------

    @cached_property
    def _legal_nodes(self) -> core.LegalNodes:
        """The search of the core for the legal nodes of one agent."""
        reach = ReachableNodes(self.streets.num_nodes).core
        if self.by_metres:
            return core.LegalByMetres(self.map, reach, goes_on=self.terms.decides_at_arrivals)
        return LegalByEdges(self.streets.core, reach)

    @cached_property
    def _room(self) -> IntArray:
        """Memory for the nodes that the core lists at once."""
        return np.empty(self.streets.num_nodes + _ROOM, np.int64)

    def _find(self, node: IntArray, which: tuple[IntArray, IntArray]) -> tuple[IntArray, IntArray]:
        """Return the number of legal nodes of each agent, and the rows of these nodes; see `count_legal`."""
        games, agents = (np.broadcast_to(one, node.shape).ravel() for one in which)
        here = node.ravel()
        if self.roads is None:
            return self._find_on_map(here, games, agents)
        parts = [(np.zeros(0, np.int64), np.zeros(0, np.int64))]
        order = [np.zeros(0, np.int64)]
        for movement, places in self._select_maps(games, self.mode_of[agents]):
            parts.append(movement._find_on_map(here[places], games[places], agents[places]))
            order.append(places)
        back = np.argsort(np.concatenate(order), kind="stable")
        counts = np.concatenate([one for one, _ in parts])
        listed, _ = kernels.select_runs(np.concatenate(([0], np.cumsum(counts))), back)
        return counts[back], np.concatenate([rows for _, rows in parts])[listed]

    def _find_on_map(self, node: IntArray, games: IntArray, agents: IntArray) -> tuple[IntArray, IntArray]:
        """Return what `_find` does for agents of one mode in games on this map; all arguments are flat."""
        which = games, agents
        if self.traffic is not None and self.traffic.obeys[agents[:1]].any():
            return self._find_with_turns(node, games, agents)
        edge = self.find_edges(which) if self.by_metres else self.edge[which]
        motion = self.motion[which] if self.by_metres else np.zeros(len(node), np.int64)
        legal = self._legal_nodes
        return self._find_at(legal, node, edge, self.share[which], motion, self.paces[agents], self.time[games])

    def _list_edges_onward(self, node: IntArray, games: IntArray, agents: IntArray) -> tuple[IntArray, IntArray]:
        """Return the edges that agents may take next that obey turns: indices of the agents, and rows; all flat.

        Edges to the same node follow each other, the cheapest first.
        """
        assert self.traffic is not None  # noqa: S101 - they obey turns
        which = games, agents
        return self.traffic.list_edges(which, node, self.previous[which])

    def _find_with_turns(self, node: IntArray, games: IntArray, agents: IntArray) -> tuple[IntArray, IntArray]:
        """Return what `_find_on_map` does for agents that obey turns."""
        number, edges = self._list_edges_onward(node, games, agents)
        ends = self.columns.targets[edges]
        is_new = np.append(True, (number[1:] != number[:-1]) | (ends[1:] != ends[:-1]))[: len(ends)]
        number = np.append(np.arange(len(node)), number[is_new])
        rows = np.append(node, ends[is_new])
        return np.bincount(number), rows[np.argsort(number, kind="stable")]

    def _find_at(
        self,
        legal: core.LegalNodes,
        node: IntArray,
        edge: IntArray,
        share: FloatArray,
        motion: IntArray,
        speed: FloatArray,
        now: FloatArray,
    ) -> tuple[IntArray, IntArray]:
        """Return what `_find` does for agents at these positions; see `core.LegalNodes.find`."""
        columns = [as_buffer(column) for column in (node, edge, share, motion, speed, now)]
        counts = np.zeros(len(node), np.int64)
        parts = [np.zeros(0, np.int64)]
        first = 0
        while first < len(node):
            last = core.find_each(*[legal, first, *columns, as_buffer(self._room), counts.data])
            parts.append(self._room[: counts[first:last].sum()].copy())
            first = last
        return counts, np.concatenate(parts)


class MovesInContexts:
    """The legal nodes and positions of agents in games of which only contexts know them.

    Args:
        games: number of a game -> a function that returns it. Any: the class of games imports this module.
        names: the names of the agents.
        streets: has the rows of the nodes.
        reading: returns a context manager in which contexts are read.
    """

    def __init__(
        self,
        games: Mapping[int, Callable[[], Any]],
        names: Sequence[str],
        streets: StreetGraph,
        reading: Callable[[], AbstractContextManager[None]],
    ) -> None:
        self._games = games
        self._names = names
        self._streets = streets
        self._reading = reading
        self._legal: dict[int, list[IntArray | None]] = {}

    def list_legal(self, number: int) -> list[IntArray | None]:
        """Return the rows of the legal nodes of each agent of a game; None: it has none.

        Raises:
            UnknownName (KeyError): a legal node has no row.
        """
        if number not in self._legal:
            game = self._games[number]()
            with self._reading():
                known = game.ctx.agent.agents
                legal = game.internals.parts.turns.list_legal([name for name in self._names if name in known])
            ids = [legal.get(name) for name in self._names]
            self._legal[number] = [self._streets.rows(one) if one else None for one in ids]
        return self._legal[number]

    def _list_agents(
        self, shape: tuple[int, ...], which: tuple[IntArray, IntArray]
    ) -> Iterator[tuple[tuple[int, ...], int, int]]:
        """Yield the index of each agent in these games, the number of its game, and its own."""
        games, agents = (np.broadcast_to(one, shape) for one in which)
        for index in map(tuple, np.argwhere(np.isin(games, [*self._games])).tolist()):
            yield index, int(games[index]), int(agents[index])

    def put_counts(self, counts: IntArray, which: tuple[IntArray, IntArray]) -> IntArray:
        """Return the number of legal nodes of agents, in these games as in their contexts."""
        found = np.array(counts)
        for index, game, agent in self._list_agents(counts.shape, which):
            legal = self.list_legal(game)[agent]
            found[index] = 1 if legal is None else len(legal)
        return found

    def put_legal(
        self, nodes: IntArray, is_legal: BoolArray, which: tuple[IntArray, IntArray]
    ) -> tuple[IntArray, BoolArray]:
        """Return the rows of the legal nodes of agents, and a mask of valid entries; see `put_counts`."""
        counts = self.put_counts(is_legal.sum(axis=-1), which)
        more = int(counts.max(initial=nodes.shape[-1])) - nodes.shape[-1]
        nodes = np.concatenate((nodes, np.repeat(nodes[..., :1], more, axis=-1)), axis=-1)
        for index, game, agent in self._list_agents(nodes.shape[:-1], which):
            legal = self.list_legal(game)[agent]
            nodes[index] = nodes[index][0]
            if legal is not None:
                nodes[index][: len(legal)] = legal
        return nodes, np.arange(nodes.shape[-1]) < counts[..., None]

    def put_places(self, places: Places, which: tuple[IntArray, IntArray]) -> Places:
        """Return the positions of agents, in these games as in their contexts. `places` is changed."""
        for index, number, agent in self._list_agents(places.offset_m.shape, which):
            ctx = self._games[number]().ctx
            with self._reading():
                progress = _get_progress(ctx, self._names[agent])
                on_edge = None if progress is None else locate(ctx.graph.graph, progress)
            if on_edge is not None:
                places.edge[index], places.offset_m[index], places.xy[index] = on_edge[:3]
        return places


def _get_progress(ctx: HostContext, name: str) -> Progress | None:
    """Return where on an edge an agent is; None: it is on a node, or not in the game."""
    block = ctx.agent.block
    return block.get_edge_position(block.find_row(name)) if name in ctx.agent.agents else None
