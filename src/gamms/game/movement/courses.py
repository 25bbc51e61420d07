"""Paths of agents that do not move along one edge per turn, for functions that are called between phases."""

from collections.abc import Callable, Sequence
from functools import cached_property
from math import nan
from typing import Any, NamedTuple

import numpy as np

from gamms import kernels
from gamms.core import moves
from gamms.core import travel as core
from gamms.game.decisions import Decisions
from gamms.game.movement.legal_moves import Movement
from gamms.game.movement.travel import STAYS, GamePaths, NodeIds, RoadIds, TurnPaths
from gamms.ir.graph import FloatArray, GraphColumns, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.ir.progress import Motion

_MORE_LEGS = 2  # that a way may have besides those to its nodes


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


class Routes:
    """The routes that plain functions choose for agents in a turn.

    Args:
        by: the movement of the agents.
        shape: the numbers of games and agents.
        room: the number of entries of a route for which memory is reserved; see `core.travel.go`.
        longest: the maximum number of entries of a route.

    Attributes:
        core: the routes in the form of the core.
    """

    def __init__(self, by: Movement, shape: tuple[int, int], room: int, longest: int) -> None:
        self._by = by
        self._longest = longest
        self._agents = shape[1]
        self._room = room
        rows = shape[0] * shape[1]
        self._nodes = np.zeros(rows * room, np.int64)
        self._counts, self._motions = np.zeros((2, rows), np.int64)
        self.core = moves.ChosenRoutes(room, self._nodes.data, self._counts.data, self._motions.data)
        self._chosen: list[tuple[int, int, int]] = []  # row, how many nodes, motion
        self._ids: list[int] = []  # of the nodes or edges, one way after the other
        self._edges: list[int] = []  # the places of edges in it

    def choose(self, game: int, agent: int, decisions: Decisions, i: int) -> bool:
        """Set the action of an agent in this turn; return whether there is room for its path.

        Args:
            game: the number of the game.
            agent: the number of the agent.
            decisions: of the agents of the game.
            i: its slot.
        """
        count = STAYS
        motion = int(Motion.FORWARD)
        nodes: Sequence[int] = ()
        if decisions.paths is not None and decisions.paths.maps[i] is not None:
            obeys = decisions.slots[i].obeys_turns  # not always over the cheapest of parallel edges
            count, motion, nodes = decisions.paths.make_route(i, of_edges=obeys)
            if obeys:
                self._edges += range(len(self._ids), len(self._ids) + len(nodes))
        elif decisions.ends[i] != decisions.starts[i]:
            nodes = (decisions.ends[i],)
        before = len(self._ids)
        self._ids += nodes
        count = (len(self._ids) - before) or count
        if count > self._longest:
            del self._ids[before:]
            self._edges = [place for place in self._edges if place < before]
            return False
        self._chosen.append((game * self._agents + agent, count, motion))
        return True

    def write(self) -> None:
        """Write the chosen actions into the columns of the core."""
        rows, counts, motions = np.array(self._chosen, np.int64).reshape(-1, 3).T
        self._counts[rows] = counts
        self._motions[rows] = motions
        lengths = np.maximum(counts, 0)
        first = np.cumsum(lengths) - lengths
        places = np.repeat(rows * self._room - first, lengths) + np.arange(len(self._ids))
        is_edge = np.zeros(len(self._ids), np.bool_)
        is_edge[self._edges] = True
        ids = np.array(self._ids, np.int64)
        columns = self._by.columns
        self._nodes[places[~is_edge]] = self._by.streets.rows(ids[~is_edge])
        edges = kernels.find_rows(columns.edge_ids, ids[is_edge], columns.edge_order)
        self._nodes[places[is_edge]] = len(columns.node_ids) + edges
        self.forget()

    def forget(self) -> None:
        """Drop the chosen actions."""
        self._chosen.clear()
        self._ids.clear()
        self._edges.clear()


class Courses:
    """The routes of agents in all games, and their paths in the last turns, for functions that ask for them.

    Args:
        by: the movement of the agents.
        shape: the numbers of games and agents.
        most: the maximum number of legs of an agent in a turn; by edges, of nodes.
        part_of: (agents,) the part of the turn in which each agent moves.

    Attributes:
        trips: the paths, in the memory to which the core writes them; by edges, see `core.by_edges.EdgePaths`. By
            metres, if a turn has several parts, the second half of its rows has the agents where they stand before the
            moves of a part.
        routes: the chosen routes.
    """

    def __init__(self, by: Movement, shape: tuple[int, int], most: int, part_of: IntArray) -> None:
        self._by = by
        self._part_of = part_of
        self._shape = shape
        rows = shape[0] * shape[1]
        self._standing = rows if by.by_metres and part_of.any() else 0  # the first row of agents that stand
        self.trips = TurnPaths(rows + self._standing, most if by.by_metres else most - 1, 0)
        self.trips.passed[:] = 1
        self.trips.edge[:] = -1
        self.trips.motion[rows:] = Motion.STOPPED
        self.trips.until[rows:] = 1.0
        longest = most - _MORE_LEGS - 2 * int(part_of.any()) if by.by_metres else most
        self.routes = Routes(by, shape, most, longest)

    @cached_property
    def road_ids(self) -> RoadIds:
        """The ids of the nodes and edges of these paths."""
        columns = self._by.columns
        ids = columns.node_ids.tolist()
        return RoadIds(columns, ids, self._by.map, None) if self._by.by_metres else NodeIds(ids)

    def list_columns(self) -> list[np.ndarray[Any, Any]]:
        """Return the stored columns of the last turns."""
        trips = self.trips
        legs = int(trips.legs.max(initial=0))
        passed = int(trips.passed.max(initial=1))
        of_legs = [
            one[:, :legs] for one in (trips.edges, trips.backs, trips.begins, trips.ends, trips.since, trips.until)
        ]
        each = [trips.node, trips.edge, trips.share, trips.motion, trips.legs, trips.passed]
        return [*each, *of_legs, trips.nodes[:, :passed], trips.times[:, :passed]]

    def take(
        self,
        other: "Courses",
        game: int,
        pairs: IntArray,
        find_nodes: Callable[[IntArray, IntArray], IntArray],
        find_edges: Callable[[IntArray], IntArray],
    ) -> None:
        """Take the paths of a game in other courses to those of this only game.

        Args:
            other: the other courses.
            game: the number of the game there.
            pairs: (2, agents) the numbers of its agents here, and there.
            find_nodes: returns the rows of nodes here, given those there, and others for nodes that are not here.
            find_edges: returns the rows of edges here.
        """
        for standing in range(1 + bool(self._standing and other._standing)):
            mine = pairs[0] + standing * self._standing
            theirs = pairs[1] + game * other._shape[1] + standing * other._standing
            here, there = self.trips, other.trips
            for name in ("share", "motion", "legs", "passed"):
                getattr(here, name)[mine] = getattr(there, name)[theirs]
            here.node[mine] = find_nodes(there.node[theirs], here.node[mine])
            here.edge[mine] = find_edges(there.edge[theirs])
            most = min(here.edges.shape[1], there.edges.shape[1])
            for name in ("edges", "backs"):
                getattr(here, name)[mine, :most] = find_edges(getattr(there, name)[theirs, :most])
            for name in ("begins", "ends", "since", "until"):
                getattr(here, name)[mine, :most] = getattr(there, name)[theirs, :most]
            here.nodes[mine, : most + 1] = find_nodes(there.nodes[theirs, : most + 1], here.nodes[mine, : most + 1])
            here.times[mine, : most + 1] = there.times[theirs, : most + 1]

    def take_steps(self, starts: IntArray, ends: IntArray, took_part: IntArray) -> None:
        """Take paths along one edge each, (1, agents), between the rows of nodes."""
        trips = self.trips
        goes = (took_part[0] > 0) & (starts[0] != ends[0])
        trips.node[: len(goes)] = ends[0]
        trips.passed[: len(goes)] = 1 + goes
        trips.nodes[: len(goes), 0] = starts[0]
        trips.nodes[: len(goes), 1] = ends[0]
        trips.times[: len(goes), :2] = (0.0, 1.0)

    def find_step(self, game: int, agent: int) -> tuple[tuple[int, ...], int | None]:
        """Return the ids of the nodes and of the edge of the move of an agent that obeys turns; None: it stays."""
        trips = self.trips
        columns = self._by.columns
        row = game * self._shape[1] + agent
        nodes = trips.nodes[row, : trips.passed[row]]
        nodes = nodes[np.append(True, nodes[1:] != nodes[:-1])]  # it may wait on the first node
        edge = None if len(nodes) == 1 else int(columns.edge_ids[trips.edges[row, 0]])
        return tuple(columns.node_ids[nodes].tolist()), edge

    def list_driven(self, game: int, agent: int) -> list[int]:
        """Return the ids of the edges that an agent has driven to their ends in its last turn by metres."""
        trips = self.trips
        row = game * self._shape[1] + agent
        legs = trips.legs[row]
        edges: IntArray = trips.edges[row, :legs][trips.ends[row, :legs] == 1.0]
        ids: list[int] = self._by.columns.edge_ids[edges].tolist()
        return ids

    def stand(self, game: int, agent: int, node: int) -> None:
        """Let an agent stay on a node for the whole turn."""
        core.begin(self.trips.core, game * self._shape[1] + agent, node, -1, 0.0, Motion.STOPPED, 0.0, nan, 0)

    def note_places(self, node: IntArray, *, are_open: bool) -> None:
        """Store where agents on edges stand before the moves of a part of a turn; edges that are closed are nodes.

        Args:
            node: (games, agents) the rows of their nodes.
            are_open: whether the edges that were stored last are open, even if functions have closed them since.
        """
        if not self._standing:
            return
        trips = self.trips
        own = slice(self._standing, None)
        now = self._by.edge.ravel()
        if are_open:
            edge = np.where(now == trips.edge[own], now, -1)
        else:
            games, agents = self._shape
            edge = self._by.find_edges((np.arange(games)[:, None], np.arange(agents))).ravel()
            on = np.flatnonzero(edge >= 0)
            trips.backs[self._standing + on, 0] = self._by.find_reverse_edges(
                edge[on], on // agents, self._by.mode_of[on % agents]
            )
        trips.node[own] = node.ravel()
        trips.nodes[own, 0] = trips.node[own]
        trips.edge[own] = edge
        trips.edges[own, 0] = edge
        trips.legs[own] = edge >= 0
        trips.share[own] = np.where(edge >= 0, self._by.share.ravel(), 0.0)
        trips.begins[own, 0] = trips.share[own]
        trips.ends[own, 0] = trips.share[own]

    def get_game_paths(self, game: int, agents: IntArray, others: IntArray) -> GamePaths:
        """Return the paths of agents of a game, and of others that stand on edges.

        By edges, these are the paths of agents that did more than move along one edge at once.

        Args:
            game: the number of the game.
            agents: the numbers of the agents; -1: no agent.
            others: the numbers of the others; -1: no agent.
        """
        trips = self.trips
        rows = game * self._shape[1] + np.where(agents < 0, self._standing + others, agents)
        lengths = trips.passed[rows]
        room = np.maximum(trips.legs[rows], lengths - 1)
        if self._by.by_metres:
            have_paths = ((agents >= 0) | (others >= 0)) & (trips.legs[rows] > 0)
        else:
            is_loop = trips.nodes[rows, 0] == trips.nodes[rows, min(1, trips.nodes.shape[1] - 1)]
            goes_far = (lengths > 2) | ((lengths == 2) & (is_loop | self._part_of.any()))
            have_paths = (agents >= 0) & (goes_far | (trips.edge[rows] >= 0))
        found = GamePaths(len(rows), int(room.max(initial=0)) + _MORE_LEGS)
        for place in np.flatnonzero(have_paths).tolist():
            found.take(place, trips.core, int(rows[place]), int(room[place]), self.road_ids)
        return found

    def get_paths(
        self, games: IntArray, starts: IntArray, took_part: BoolArray, standing: BoolArray | None = None
    ) -> Paths:
        """Return the paths of agents, with nodes to which they came back; agents that did not take part stay.

        Args:
            games: the numbers of the games.
            starts: (games, agents) the nodes before the moves.
            took_part: (games, agents) a mask of the agents whose paths were stored.
            standing: (games, agents) a mask of the agents that stand in this part of the turn, before its moves; None:
                agents have moved.
        """
        trips = self.trips
        rows = games[:, None] * self._shape[1] + np.arange(self._shape[1])
        if not self._by.by_metres:
            lengths = np.where(took_part, trips.passed[rows], 1)
            most = int(lengths.max(initial=1))
            return make_paths_over(trips.nodes[rows, :most], trips.times[rows, :most], lengths, starts)
        have_paths = took_part
        if standing is not None:
            have_paths = took_part | standing
            rows = np.where(standing, self._standing + rows, rows)
        counts = np.where(have_paths, trips.legs[rows], 0)
        most = int(counts.max(initial=0))
        is_leg = np.arange(most) < counts[..., None]
        edge, back = (np.where(is_leg, one[rows, :most], -1) for one in (trips.edges, trips.backs))
        parts = (trips.begins, trips.ends, trips.since, trips.until)
        legs = Legs(edge, back, *(np.where(is_leg, one[rows, :most], 0.0) for one in parts))
        waits = (self._part_of > 0) & (edge >= 0).any(axis=-1) & (standing is None)
        if most:
            waits &= (legs.begin[..., 0] == 0.0) | (legs.begin[..., 0] == 1.0)
        end = np.where(have_paths, trips.edge[rows], -1)
        motion = np.where(end >= 0, trips.motion[rows], int(Motion.STOPPED))
        return make_paths_along(legs, self._by.columns, starts, waits)._replace(edge=end, motion=motion, rests=end < 0)


def make_paths_along(legs: Legs, columns: GraphColumns, starts: IntArray, waits: BoolArray) -> Paths:
    """Return the paths of agents along edges, with nodes to which they came back.

    Args:
        legs: the edges.
        columns: the map with these edges.
        starts: (games, agents) where they begin.
        waits: (games, agents) who waits there first, and leaves later.
    """
    is_leg = legs.edge >= 0
    arrives = is_leg & ((legs.end == 0.0) | (legs.end == 1.0))
    lengths = 1 + waits + arrives.sum(axis=-1)
    width = int(lengths.max(initial=1))
    nodes = np.repeat(starts[..., None], width, axis=-1)
    times = np.zeros((*starts.shape, width))
    at = np.nonzero(arrives)
    number = (np.cumsum(arrives, axis=-1) + waits[..., None])[at]
    edges = legs.edge[at]
    nodes[(*at[:2], number)] = np.where(legs.end[at] > 0.0, columns.targets[edges], columns.sources[edges])
    times[(*at[:2], number)] = legs.until[at]
    if waits.any():
        times[..., 1] = np.where(waits, legs.since[..., 0], times[..., 1])
    found = make_paths_over(nodes, times, lengths, starts)
    return found._replace(legs=legs, stays=np.asarray(~is_leg.any(axis=-1)), waits=waits)


def make_paths_in_parts(starts: IntArray, ends: IntArray, part_of: IntArray, parts: int) -> Paths:
    """Return the paths of agents along one edge, each in its part of the turn, (games, agents).

    Args:
        starts: the starts of the moves.
        ends: the ends of the moves.
        part_of: (agents,) the parts in which they move.
        parts: the number of parts.
    """
    goes = starts != ends
    waits = part_of > 0
    lengths = np.where(goes, 2 + waits, 1)
    nodes = np.stack((starts, np.where(waits, starts, ends), ends), axis=-1)
    begin = part_of / parts
    end = (part_of + 1) / parts
    times = np.broadcast_to(np.stack((begin, np.where(waits, begin, end), end), axis=-1), nodes.shape).copy()
    return make_paths_over(nodes, times, lengths, starts)


def make_paths_over(nodes: IntArray, times: FloatArray, lengths: IntArray, starts: IntArray) -> Paths:
    """Return paths over nodes, of which so many count; the agent may wait on the first one, which then comes twice."""
    counts = np.arange(nodes.shape[-1]) < lengths[..., None]
    last = np.take_along_axis(nodes, lengths[..., None] - 1, -1)
    nodes = np.where(counts, nodes, last)
    nodes = np.where((lengths == 1)[..., None], starts[..., None], nodes)
    times = np.where(counts, times, np.inf)
    times[..., 0] = 0.0
    waits = (lengths > 1) & (nodes[..., 0] == nodes[..., min(1, nodes.shape[-1] - 1)])
    return Paths(nodes, times, lengths, lengths == 1, waits, np.ones_like(waits))
