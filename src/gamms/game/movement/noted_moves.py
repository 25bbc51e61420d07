"""The legal nodes and positions of agents in games that are played in contexts of their own."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray


class Places(NamedTuple):
    """Positions of agents that may be on edges; the first axes of arrays are games and agents."""

    edge: IntArray  # (games, agents, 3)  ids of the nodes that it leads from and to, and its own; -1 on a node
    offset_m: FloatArray  # (games, agents)  metres along it
    xy: FloatArray  # (games, agents, 2)  map units


class CachedLegalMoves:
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

    def note_position(
        self, game: int, agent: int, edge: tuple[int, int, int], offset_m: float, xy: Sequence[float] | FloatArray
    ) -> None:
        """Note the position of an agent; see `Places`."""
        for column, value in zip(self.places, (edge, offset_m, xy), strict=True):
            column[game, agent] = value

    def _select_agents(self, shape: tuple[int, ...], which: tuple[IntArray, IntArray]) -> tuple[BoolArray, Any]:
        """Return which agents are in noted games, and the numbers of their games and their own."""
        games, agents = (np.broadcast_to(one, shape) for one in which)
        those = self.are_noted[games]
        return those, (games[those], agents[those])

    def put_counts(self, counts: IntArray, which: tuple[IntArray, IntArray]) -> IntArray:
        """Return the number of legal nodes of agents, as noted where they are in noted games."""
        those, numbers = self._select_agents(counts.shape, which)
        found = np.array(counts)
        found[those] = self.counts[numbers]
        return found

    def put_legal(
        self, nodes: IntArray, is_legal: BoolArray, which: tuple[IntArray, IntArray]
    ) -> tuple[IntArray, BoolArray]:
        """Return the rows of the legal nodes of agents, and a mask of valid entries; those of noted games as noted."""
        those, numbers = self._select_agents(nodes.shape[:-1], which)
        counts = self.counts[numbers]
        most = int(counts.max(initial=nodes.shape[-1]))
        more = [(0, 0)] * (nodes.ndim - 1) + [(0, most - nodes.shape[-1])]
        nodes = np.pad(nodes, more)
        is_legal = np.pad(is_legal, more)
        columns = np.arange(most)
        is_legal[those] = columns < counts[:, None]
        last = np.minimum(columns, counts[:, None] - 1)
        nodes[those] = np.take_along_axis(self.nodes[numbers], last, axis=-1)
        return nodes, is_legal

    def put_places(self, places: Places, which: tuple[IntArray, IntArray]) -> Places:
        """Return the positions of agents; those of noted games as noted. `places` is changed."""
        those, numbers = self._select_agents(places.offset_m.shape, which)
        for column, noted in zip(places, self.places, strict=True):
            column[those] = noted[numbers]
        return places
