"""The legal nodes and positions of agents in games of a batch that are played in contexts of their own."""

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from gamms.game.movement.one_edge import Movement, Places
from gamms.game.movement.routes import RouteTable
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray


class NotedMoves:
    """The legal nodes and positions of the agents of some games, as their contexts have them.

    Attributes:
        are_noted: (games,) whether the agents of a game were noted.
        counts: (games, agents) the number of legal nodes.
        nodes: (games, agents, most) their rows.
        places: the positions.
    """

    def __init__(self, shape: tuple[int, ...]) -> None:
        self.are_noted = np.zeros(shape[0], np.bool_)
        self.counts = np.ones(shape, np.int64)
        self.nodes = np.zeros((*shape, 1), np.int64)
        self.places = Places(np.full((*shape, 3), -1), np.zeros(shape), np.zeros((*shape, 2)))

    def note(self, game: int, agent: int, legal: IntArray) -> None:
        """Note the legal nodes of an agent, by their rows."""
        more = len(legal) - self.nodes.shape[-1]
        if more > 0:
            self.nodes = np.pad(self.nodes, ((0, 0), (0, 0), (0, more)))
        self.are_noted[game] = True
        self.counts[game, agent] = len(legal)
        self.nodes[game, agent, : len(legal)] = legal

    def place(
        self, game: int, agent: int, edge: tuple[int, int, int], offset_m: float, xy: Sequence[float] | FloatArray
    ) -> None:
        """Note the position of an agent; see `Places`."""
        for column, value in zip(self.places, (edge, offset_m, xy), strict=True):
            column[game, agent] = value


class MovementWithNotes(Movement):
    """The movement of agents in games of which some are noted.

    Args:
        movement: the movement of agents in the other games.
        noted: the moves in the noted games.
    """

    is_plain = False
    leaves_nodes = True

    def __init__(self, movement: Movement, noted: NotedMoves) -> None:
        super().__init__(movement.streets, movement.whole, movement.closed)
        self._movement = movement
        self._noted = noted
        self.turn_seconds = movement.turn_seconds
        self.roads = movement.roads
        self.now = movement.now

    @cached_property
    def width(self) -> int:
        """The number of actions; see `Movement`."""
        return self._movement.width

    def _those(self, node: IntArray, which: tuple[IntArray, IntArray]) -> tuple[BoolArray, tuple[IntArray, IntArray]]:
        """Return which agents are in noted games, and the numbers of their games and their own."""
        games, agents = (np.broadcast_to(one, node.shape) for one in which)
        those = self._noted.are_noted[games]
        return those, (games[those], agents[those])

    def counts(self, node: IntArray, which: tuple[IntArray, IntArray]) -> IntArray:
        """Return the number of legal nodes of agents."""
        those, numbers = self._those(node, which)
        found = np.array(self._movement.counts(node, which))
        found[those] = self._noted.counts[numbers]
        return found

    def legal(self, node: IntArray, which: tuple[IntArray, IntArray]) -> tuple[IntArray, BoolArray]:
        """Return the rows of the legal nodes of agents, and a mask of valid entries."""
        those, numbers = self._those(node, which)
        nodes, is_legal = self._movement.legal(node, which)
        counts = self._noted.counts[numbers]
        most = int(counts.max(initial=nodes.shape[-1]))
        more = [(0, 0)] * node.ndim + [(0, most - nodes.shape[-1])]
        nodes = np.pad(nodes, more)
        is_legal = np.pad(is_legal, more)
        columns = np.arange(most)
        is_legal[those] = columns < counts[:, None]
        last = np.minimum(columns, counts[:, None] - 1)
        nodes[those] = np.take_along_axis(self._noted.nodes[numbers], last, axis=-1)
        return nodes, is_legal

    def places(self, node: IntArray, which: tuple[IntArray, IntArray]) -> Places:
        """Return the positions of agents."""
        those, numbers = self._those(node, which)
        edge, offset_m, xy = self._movement.places(node, which)
        found = Places(edge.copy(), offset_m.copy(), xy.copy())
        for column, noted in zip(found, self._noted.places, strict=True):
            column[those] = noted[numbers]
        return found

    def towards(
        self, node: IntArray, targets: IntArray, which: tuple[IntArray, IntArray], allowed: BoolArray | None = None
    ) -> IntArray:
        """Return the actions that lead agents toward nodes."""
        return self._movement.towards(node, targets, which, allowed)

    def routes(self, weight: str | None) -> RouteTable:
        """Return the tables of routes along `streets`, by a weight of edges."""
        return self._movement.routes(weight)

    def are_plain(self, agents: IntArray) -> bool:  # noqa: ARG002 - no agent is
        """Return False: legal nodes differ between games."""
        return False
