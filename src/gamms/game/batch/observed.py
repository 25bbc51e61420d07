"""What agents of a batch in the core observe as vectors after each turn, in the games on all maps at once."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from gamms.core import observe
from gamms.game.batch.roads import OpenRoads
from gamms.game.batch.vectors import Encoder, Vectors, write_vectors
from gamms.game.batch.view import ArrayView, alive_in, lasting_in, roads_in
from gamms.ir.graph import IntArray
from gamms.ir.obstacles import BoolArray


class Writers(NamedTuple):
    """The means to write the vectors of agents in all games.

    Attributes:
        alive: (games, all agents)
        agents: numbers in the roster of those that observe, in the order of their rows.
        mask: (games, agents) which of these are alive.
        encoder, observers: see `write_vectors`.
        first: (maps + 1,) the first node of each map, among the nodes of all maps.
        first_node: (games,) the first node of the map of each game.
        roads: the open roads of the games on each map.
        more: how many further entries the vectors have; see `Encoder.made`.
        threads: how many write.
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
        """Whether what agents observe is still what these write: no rule has closed roads."""
        return not any(roads.are_closed for roads in self.roads)

    def move(self, maps: IntArray) -> None:
        """Put games on the maps of these numbers, (games,)."""
        self.first_node[:] = self.first[maps]

    def written(self, known: Vectors | None = None, which: IntArray | None = None) -> Vectors:
        """Return the vectors of all games in new arrays.

        Args:
            known: what they were before some games have begun again.
            which: these games; None: all games have gone on, or nothing is known.
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
) -> Writers | None:
    """Return the means to write the vectors of agents.

    Args:
        views: a view of the games on each map, of which there may be none.
        maps: (games,) the number of the map of each game.
        agents: numbers in the roster of those that observe, in any order.
        others: how many others vectors have.
        more: how many further entries they have; see `Encoder.made`.
        threads: how many write.

    Returns:
        None: what agents observe is not in columns of the core.
    """
    first = np.cumsum([0, *(view.streets.num_nodes for view in views)])
    first_node, mask = first[maps], np.zeros((len(maps), len(agents)), np.bool_)
    found = lasting_in(views, agents, others, mask, first_node)
    if found is None:
        return None
    roads = [roads_in(view) for view in views]
    return Writers(alive_in(views[0]), agents, mask, *found, first, first_node, roads, more, threads)
