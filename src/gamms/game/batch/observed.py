"""Observation vectors of agents after each turn of a batch in the core, for the games on all maps at once."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from gamms.core import observe
from gamms.game.batch.roads import OpenRoads
from gamms.game.batch.vectors import Encoder, Vectors, write_vectors
from gamms.game.batch.view import ArrayView, alive_in, lasting_in, roads_in
from gamms.ir.graph import IntArray
from gamms.ir.obstacles import BoolArray


class VectorWriter(NamedTuple):
    """Writes the observation vectors of agents in all games.

    Attributes:
        alive: (games, all agents) whether each agent of the roster is alive.
        agents: (agents,) the numbers of the observing agents in the roster, in the order of the vectors.
        mask: (games, agents) whether each observing agent is alive.
        encoder, observers: see `write_vectors`.
        first: (maps + 1,) the index of the first node of each map among the nodes of all maps.
        first_node: (games,) the index of the first node of each game's map.
        roads: the open roads of the games on each map.
        more: the number of additional entries; see `Encoder.made`.
        threads: the number of threads that write.
    """

    alive: BoolArray
    agents: IntArray
    mask: BoolArray
    encoder: Encoder
    observers: observe.Observers
    first: IntArray
    first_node: IntArray
    roads: list[OpenRoads]
    more: int
    threads: int

    def hold(self) -> bool:
        """Return whether the writer is still valid: in no game are roads open that differ from the start."""
        return not any(roads.are_closed for roads in self.roads)

    def move(self, maps: IntArray) -> None:
        """Set the map of each game by its number, (games,)."""
        self.first_node[:] = self.first[maps]

    def written(self, known: Vectors | None = None, which: IntArray | None = None) -> Vectors:
        """Return the vectors of all games in new arrays.

        Args:
            known: the vectors before some games were reset; they are copied for the other games.
            which: the numbers of the games to write; None: all games.
        """
        mask = self.alive.take(self.agents, axis=1)
        self.mask[:] = mask
        found = self.encoder.made(mask, self.more)
        if known is not None and which is not None:
            found.values[:] = known.values
            found.legal[:] = known.legal
            found.counts[:] = known.counts
        places = np.arange(len(mask)) if which is None else which
        write_vectors(self.encoder, self.observers, self.encoder.output(found), places, self.threads)
        return found


def writers_of(
    views: Sequence[ArrayView], maps: IntArray, agents: IntArray, others: int, more: int, threads: int
) -> VectorWriter | None:
    """Return a writer of the observation vectors of agents.

    Args:
        views: a view of the games on each map; a view may contain no games.
        maps: (games,) the number of the map of each game.
        agents: the numbers of the observing agents in the roster, in any order.
        others: the number of other agents in a vector.
        more: the number of additional entries; see `Encoder.made`.
        threads: the number of threads that write.

    Returns:
        The writer; None if the core does not hold the observations in columns.
    """
    first = np.cumsum([0, *(view.streets.num_nodes for view in views)])
    first_node = first[maps]
    mask = np.zeros((len(maps), len(agents)), np.bool_)
    found = lasting_in(views, agents, others, mask, first_node)
    if found is None:
        return None
    roads = [roads_in(view) for view in views]
    return VectorWriter(alive_in(views[0]), agents, mask, *found, first, first_node, roads, more, threads)
