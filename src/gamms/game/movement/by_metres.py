"""Travel by metres in many games at once: the positions of agents on edges, and their legal nodes.

`gamms.core.travel` moves each agent; this module has the columns of games.
"""

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from gamms.core import travel as core
from gamms.game.block.columns import PlayedGame
from gamms.game.movement.one_edge import PacedMovement, Places
from gamms.game.movement.streets import StreetGraph
from gamms.game.movement.travel import ReachableNodes, map_of
from gamms.ir.graph import ClosedEdges, FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.ir.progress import Progress
from gamms.kernels import buffer

_AT_ONCE = 1 << 12  # nodes at which the most legal ones are looked for


class TravelTerms(NamedTuple):
    """The costs and times by which agents travel.

    Attributes:
        weight: the edge weight by which agents choose paths.
        costs: (edges,) the costs by this weight.
        seconds: (edges,) the minimum travel time of each edge; None: edges have no speed limits.
        turn_seconds: the duration of a turn, in the time unit of speeds.
        decides_at_arrivals: whether agents decide on arrival; see `arrivals`.
    """

    weight: str
    costs: FloatArray
    seconds: FloatArray | None
    turn_seconds: float
    decides_at_arrivals: bool = False

    @classmethod
    def of(cls, game: PlayedGame, streets: StreetGraph) -> "TravelTerms":
        """Return the terms of a game by metres; `streets` has all roads that may be open."""
        settings = game.settings()
        weight = settings["weight"]
        is_by_seconds = settings["speed_unit"] == "metres_per_second"
        costs = np.asarray(streets.weights(weight), np.float64)
        seconds = costs if weight == "travel_time" and is_by_seconds else None
        return cls(weight, costs, seconds, seconds_of_turn(settings) or 1.0, settings["decide"] == "arrival")


def seconds_of_turn(settings: Mapping[str, Any]) -> float | None:
    """Return the duration of a turn of a game, in the time unit of speeds; None: speeds count edges."""
    lasts: dict[str, float | None] = {"edges": None, "metres": 1.0, "metres_per_second": settings["turn_seconds"]}
    return lasts[settings["speed_unit"]]


class MetricMovement(PacedMovement):
    """Agents that may be anywhere on edges, and move by speeds in metres.

    Args:
        streets: the graph of the map.
        speeds: the speeds of agents in the order of the roster; None: one edge per turn.
        terms: the costs and times of travel.
        whole, closed: see `Movement`.

    Attributes:
        paces: (agents,) the speeds; NaN: one edge per turn.
        edge: (games, agents) the rows of the edges that agents are on; -1: they are on their nodes.
        share: (games, agents) the share of the edge behind each agent.
        motion: (games, agents) the motion on the edge, see `ir.progress.Motion`.
        now: (games,) the time in the turn, from 0 to 1, at which the asked agents decide.
    """

    leaves_nodes = True
    remembers = ("edge", "share", "motion")

    def __init__(
        self,
        streets: StreetGraph,
        speeds: Sequence[float | None],
        terms: TravelTerms,
        whole: StreetGraph | None = None,
        closed: ClosedEdges | None = None,
    ) -> None:
        paces = [np.nan if speed is None else speed for speed in speeds]
        super().__init__(streets, np.array(paces, np.float64), whole, closed)
        self.terms = terms
        self.turn_seconds = terms.turn_seconds

    @cached_property
    def map(self) -> core.RoadEdges:
        """The map in the form of the core."""
        return self.new_map()

    def new_map(self) -> core.RoadEdges:
        """Return the map in the form of the core, for one thread."""
        terms = self.terms
        leaving, _ = self.all_roads.edges_at([self._on])
        return map_of(self.columns, terms.costs, terms.seconds, terms.turn_seconds, leaving)

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

    @cached_property
    def _reach(self) -> ReachableNodes:
        return ReachableNodes(self.streets.num_nodes)

    def begin(self, shape: tuple[int, int]) -> None:
        """Reserve memory for these numbers of games and agents, with all agents on nodes."""
        super().begin(shape)
        self.edge = np.full(shape, -1)
        self.share = np.zeros(shape)
        self.motion = np.zeros(shape, np.int64)
        self.now = np.zeros(shape[0])

    def clear(self, games: Any, agents: Any = np.s_[:]) -> None:
        """Put agents on their nodes."""
        self.edge[games, agents] = -1
        self.share[games, agents] = 0.0

    def put_on(self, games: IntArray, agent: int, place: Progress) -> None:
        """Put an agent on an edge in some games."""
        rows = np.flatnonzero(self.columns.edge_ids == place.edge)
        if not len(rows):  # the edge was removed
            return
        self.edge[games, agent] = rows[0]
        self.share[games, agent] = place.share
        self.motion[games, agent] = place.motion

    def on_edges(self, game: int, node: IntArray) -> dict[int, Progress]:  # noqa: ARG002 - as `Movement`
        """Return the positions on edges of a game's agents, by their numbers."""
        return self.progress(self.edge[game], self.share[game], self.motion[game])

    def progress(self, edge: IntArray, share: FloatArray, motion: IntArray) -> dict[int, Progress]:
        """Return the positions of agents on edges, by their places; edges of -1 are nodes."""
        places = np.flatnonzero(edge >= 0)
        columns = self.columns
        edges = edge[places]
        ends = columns.node_ids[columns.sources[edges]], columns.node_ids[columns.targets[edges]]
        each = (*ends, share[places], columns.edge_ids[edges], motion[places])
        found = zip(*(one.tolist() for one in each), strict=True)
        return {place: Progress(*one) for place, one in zip(places.tolist(), found, strict=True)}

    def take_out(self, games: IntArray, agents: IntArray) -> None:
        """Do nothing: eliminated agents keep their positions on edges."""

    def backs(self, edges: IntArray, games: IntArray) -> IntArray:
        """Return the rows of the edges by which agents turn around on edges in these games, (edges,); -1: none."""
        found = np.full(len(edges), -1)
        for movement, places in self._each_map(games):
            backs = found[places]
            core.backs(movement.map, buffer(edges[places]), backs.data)
            found[places] = backs
        return found

    @property
    def is_endless(self) -> bool:
        """Whether an agent goes any distance in a turn."""
        return self.terms.seconds is None and bool(np.isinf(self.paces).any())

    # -- legal nodes ----------------------------------------------------------------------------------------------

    def _of(self, node: IntArray, which: tuple[IntArray, IntArray]) -> tuple[IntArray, IntArray]:
        games, agents = which
        columns = self.on_edge(which), self.share[which], self.motion[which], self.paces[agents], self.now[games]
        return self._legal_at(node, *columns)

    def _legal_at(
        self, node: IntArray, edge: IntArray, share: FloatArray, motion: IntArray, speed: FloatArray, now: FloatArray
    ) -> tuple[IntArray, IntArray]:
        """Return the legal nodes of agents by their positions and speeds, as `_listed` does; see `core.reachable`."""
        columns = [buffer(column) for column in (node, edge, share, motion, speed, now)]
        roads = self.map
        reach = self._reach.core
        goes_on = self.terms.decides_at_arrivals

        def list_from(first: int, rows: memoryview, counts: memoryview) -> int:
            return core.reach_each(*[roads, reach, first, *columns, goes_on, rows, counts])

        return self._listed(len(node), list_from)

    def most_legal(self, limit: int) -> int:
        """Return the maximum number of legal nodes; on an edge, there are fewer than from both its ends together."""
        columns = self.streets.columns
        most = 1
        nodes = self.streets.num_nodes
        for speed in np.unique(self.paces).tolist():
            reached = list[set[int]]()
            for first in range(0, nodes, _AT_ONCE):
                here = np.arange(first, min(first + _AT_ONCE, nodes))
                nothing = np.zeros(len(here))
                edge = np.full(len(here), -1)
                speeds = np.full(len(here), speed)
                counts, listed = self._legal_at(here, edge, nothing, nothing.astype(np.int64), speeds, nothing)
                reached += [{*rows.tolist()} for rows in np.split(listed, np.cumsum(counts)[:-1])]
                most = max(most, int(counts.max()))
                if most > limit:
                    return most
            for source, target in zip(columns.sources.tolist(), columns.targets.tolist(), strict=True):
                most = max(most, len(reached[source] | reached[target]))
        return most

    # -- positions ------------------------------------------------------------------------------------------------

    def places(self, node: IntArray, which: tuple[IntArray, IntArray]) -> Places:
        """Return the positions of agents."""
        columns = self.columns
        edge = self.on_edge(which)
        share = self.share[which]
        xy = columns.xy[node].copy()
        ids = np.full((*node.shape, 3), -1)
        on = np.nonzero(edge >= 0)
        rows = edge[on]
        ends = columns.node_ids[columns.sources[rows]], columns.node_ids[columns.targets[rows]]
        ids[on] = np.column_stack((*ends, columns.edge_ids[rows]))
        xy[on] = np.column_stack(self.lines.at(rows, share[on])[:2])
        return Places(ids, self.offsets(which), xy)

    def offsets(self, which: tuple[IntArray, IntArray]) -> FloatArray:
        """Return the distances of agents along their edges, map units."""
        edge = self.on_edge(which)
        is_on_edge = edge >= 0
        found = np.zeros(edge.shape)
        found[is_on_edge] = self.share[which][is_on_edge] * self.columns.lengths[edge[is_on_edge]]
        return found
