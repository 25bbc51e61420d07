"""Paths of agents that do not move along one edge per turn, for functions that are called between phases."""

from collections.abc import Iterable
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from gamms.core import moves
from gamms.game.decisions import Decisions
from gamms.game.movement.legal_moves import Movement
from gamms.game.movement.travel import STAYS, GamePaths, RoadIds, TurnPaths
from gamms.ir.graph import FloatArray, GraphColumns, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.ir.progress import Motion, Progress

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
        room: the number of nodes of a route for which memory is reserved.
        longest: the maximum number of nodes of a route.

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
        self._ids: list[int] = []  # of the nodes, one way after the other

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
        nodes: Iterable[int] = ()
        if decisions.paths is not None and decisions.paths.maps[i] is not None:
            count, motion, nodes = decisions.paths.route(i)
        elif decisions.ends[i] != decisions.starts[i]:
            nodes = (decisions.ends[i],)
        before = len(self._ids)
        self._ids += nodes
        count = (len(self._ids) - before) or count
        if count > self._longest:
            del self._ids[before:]
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
        self._nodes[places] = self._by.streets.rows(self._ids)
        self.forget()

    def forget(self) -> None:
        """Drop the chosen actions."""
        self._chosen.clear()
        self._ids.clear()


class Courses:
    """The routes of agents in all games, and their paths in the last turns, for functions that ask for them.

    Args:
        by: the movement of the agents.
        shape: the numbers of games and agents.
        most: the maximum number of legs of an agent in a turn; by edges, of nodes.
        part_of: (agents,) the part of the turn in which each agent moves.

    Attributes:
        trips: the paths, in the memory to which the core writes them; by edges, see `core.by_edges.EdgePaths`.
        routes: the chosen routes.
    """

    def __init__(self, by: Movement, shape: tuple[int, int], most: int, part_of: IntArray) -> None:
        self._by = by
        self._part_of = part_of
        self._shape = shape
        self._here: tuple[IntArray, FloatArray, IntArray, IntArray] = by.edge, by.share, by.motion, by.edge
        self.note_places(are_open=False)
        self.trips = TurnPaths(shape[0] * shape[1], most if by.by_metres else most - 1, 0)
        self.trips.passed[:] = 1
        self.trips.edge[:] = -1
        longest = most - _MORE_LEGS - 2 * int(part_of.any()) if by.by_metres else most
        self.routes = Routes(by, shape, most, longest)

    @cached_property
    def _ids(self) -> RoadIds:
        columns = self._by.columns
        return RoadIds(columns, columns.node_ids.tolist(), self._by.map, None)

    def columns(self) -> list[np.ndarray[Any, Any]]:
        """Return the stored columns of the last turns."""
        trips = self.trips
        legs = int(trips.legs.max(initial=0))
        passed = int(trips.passed.max(initial=1))
        of_legs = [
            one[:, :legs] for one in (trips.edges, trips.backs, trips.begins, trips.ends, trips.since, trips.until)
        ]
        each = [trips.node, trips.edge, trips.share, trips.motion, trips.legs, trips.passed]
        return [*each, *of_legs, trips.nodes[:, :passed], trips.times[:, :passed]]

    def stand(self, game: int, agent: int, node: int) -> None:
        """Let an agent stay on a node for the whole turn."""
        trips = self.trips
        row = game * self._shape[1] + agent
        trips.node[row] = node
        trips.edge[row] = -1
        trips.share[row] = 0.0
        trips.motion[row] = Motion.STOPPED
        trips.legs[row] = 0
        trips.passed[row] = 1
        trips.nodes[row, 0] = node
        trips.times[row, 0] = 0.0

    def note_places(self, *, are_open: bool) -> None:
        """Store the positions on edges, by metres, of agents that are about to move; edges that are closed are nodes.

        `are_open` says that the edges stored last are open, even if functions have closed them since.
        """
        by = self._by
        if not by.by_metres:
            return
        if are_open:
            edge = np.where(by.edge == self._here[0], by.edge, -1)
            back = self._here[3]
        else:
            games, agents = self._shape
            edge = by.on_edge((np.arange(games)[:, None], np.arange(agents)))
            on = np.nonzero(edge >= 0)
            back = np.full(self._shape, -1)
            back[on] = by.backs(edge[on], on[0])
        self._here = edge, by.share.copy(), by.motion.copy(), back

    def game_paths(self, game: int, agents: IntArray, others: IntArray, nodes: IntArray) -> GamePaths:
        """Return the paths of agents of a game, and of others that stand on edges at their noted positions.

        By edges, these are the paths of agents that did more than move along one edge at once.

        Args:
            game: the number of the game.
            agents: the numbers of the agents; -1: no agent.
            others: the numbers of the others; -1: no agent.
            nodes: the rows of the nodes that the others have passed last.
        """
        trips = self.trips
        rows = game * self._shape[1] + agents
        if not self._by.by_metres:
            return self._game_paths_by_edges(agents >= 0, rows)
        found = GamePaths(len(agents), int(trips.legs.max(initial=0)) + _MORE_LEGS)
        for place in np.flatnonzero((agents >= 0) & (trips.legs[rows] > 0)).tolist():
            found.take(place, trips.core, int(rows[place]), int(trips.legs[rows[place]]), self._ids)
        edge, share, _, back = (column[game, others] for column in self._here)
        for place in np.flatnonzero((others >= 0) & (edge >= 0)).tolist():
            found.stand(place, (int(nodes[place]), int(edge[place]), float(share[place])), int(back[place]), self._ids)
        return found

    def _game_paths_by_edges(self, is_acting: BoolArray, rows: IntArray) -> GamePaths:
        trips = self.trips
        lengths = trips.passed[rows]
        ahead = trips.edge[rows]
        has_gone_far = lengths > 1
        if not self._part_of.any():
            has_gone_far = (lengths > 2) | ((lengths == 2) & (trips.nodes[rows, 0] == trips.nodes[rows, 1]))  # a loop
        ids = self._by.streets.ids
        found = GamePaths(len(rows))
        for place in np.flatnonzero(is_acting & (has_gone_far | (ahead >= 0))).tolist():
            row = rows[place]
            path = ids(trips.nodes[row, : lengths[place]]).tolist()
            progress = None
            if ahead[place] >= 0:
                progress = Progress(path[-1], int(ids(ahead[place])), float(trips.share[row]))
            found.walk(place, path, progress, trips.times[row, : lengths[place]].tolist())
        return found

    def paths(
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
            return paths_over(trips.nodes[rows, :most], trips.times[rows, :most], lengths, starts)
        stands = np.zeros_like(took_part) if standing is None else standing & (self._here[0][games] >= 0)
        place, share, _, noted_back = (column[games][stands] for column in self._here)
        counts = np.where(stands, 1, np.where(took_part, trips.legs[rows], 0))
        most = int(counts.max(initial=0))
        is_leg = np.arange(most) < counts[..., None]
        edge = np.where(is_leg, trips.edges[rows, :most], -1)
        edge[stands, :1] = place[:, None]
        back = np.where(is_leg, trips.backs[rows, :most], -1)
        back[stands, :1] = noted_back[:, None]
        parts = [
            np.where(is_leg, one[rows, :most], 0.0) for one in (trips.begins, trips.ends, trips.since, trips.until)
        ]
        for part, values in zip(parts, (share, share, 0.0, 1.0), strict=True):
            part[stands, 0:1] = np.reshape(values, (-1, 1))
        legs = Legs(edge, back, *parts)
        waits = (self._part_of > 0) & (edge >= 0).any(axis=-1) & (standing is None)
        if most:
            waits &= (legs.begin[..., 0] == 0.0) | (legs.begin[..., 0] == 1.0)
        end = np.where(took_part, trips.edge[rows], -1)
        end[stands] = place
        motion = np.where(took_part & (end >= 0), trips.motion[rows], int(Motion.STOPPED))
        return paths_along(legs, self._by.columns, starts, waits)._replace(edge=end, motion=motion, rests=end < 0)


def paths_along(legs: Legs, columns: GraphColumns, starts: IntArray, waits: BoolArray) -> Paths:
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
    found = paths_over(nodes, times, lengths, starts)
    return found._replace(legs=legs, stays=np.asarray(~is_leg.any(axis=-1)), waits=waits)


def paths_in_parts(starts: IntArray, ends: IntArray, part_of: IntArray, parts: int) -> Paths:
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
    return paths_over(nodes, times, lengths, starts)


def paths_over(nodes: IntArray, times: FloatArray, lengths: IntArray, starts: IntArray) -> Paths:
    """Return paths over nodes, of which so many count; the agent may wait on the first one, which then comes twice."""
    counts = np.arange(nodes.shape[-1]) < lengths[..., None]
    last = np.take_along_axis(nodes, lengths[..., None] - 1, -1)
    nodes = np.where(counts, nodes, last)
    nodes = np.where((lengths == 1)[..., None], starts[..., None], nodes)
    times = np.where(counts, times, np.inf)
    times[..., 0] = 0.0
    waits = (lengths > 1) & (nodes[..., 0] == nodes[..., min(1, nodes.shape[-1] - 1)])
    return Paths(nodes, times, lengths, lengths == 1, waits, np.ones_like(waits))
