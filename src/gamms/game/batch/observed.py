"""What agents of a batch in the core observe as vectors after each turn, in the games on all maps at once."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from gamms.core import observe
from gamms.game.batch.roads import OpenRoads
from gamms.game.batch.vectors import Encoder, Vectors, write_vectors
from gamms.game.batch.view import ArrayView, lasting_in
from gamms.ir.graph import IntArray
from gamms.ir.obstacles import BoolArray


class Part(NamedTuple):
    """What writes the vectors of the games on one map.

    Attributes:
        games: these games.
        places: all of them, among those of the observers.
        encoder, observers: see `write_vectors`.
        roads: which are open in them.
    """

    games: IntArray
    places: IntArray
    encoder: Encoder
    observers: observe.Observers
    roads: OpenRoads


class Writers(NamedTuple):
    """What writes the vectors of agents in all games, as these are now.

    Attributes:
        alive: (games, all agents)
        agents: numbers in the roster of those that observe, in the order of their rows.
        mask: (games, agents) which of these are alive.
        parts: of each map.
        more: how many further entries the vectors have; see `Encoder.made`.
        threads: how many write.
    """

    alive: BoolArray
    agents: IntArray
    mask: BoolArray
    parts: list[Part]
    more: int
    threads: int

    def hold(self) -> bool:
        """Whether what agents observe is still what these write: no rule has closed roads."""
        return not any(part.roads.are_closed for part in self.parts)

    def written(self, known: Vectors | None = None, which: IntArray | None = None) -> Vectors:
        """Return the vectors of all games in new arrays.

        Args:
            known: what they were before some games have begun again.
            which: these games; None: all games have gone on, or nothing is known.
        """
        mask = self.alive.take(self.agents, axis=1)
        self.mask[:] = mask
        found = self.parts[0].encoder.made(mask, self.more)
        if known is not None and which is not None:
            found.values[:] = known.values
            found.legal[:] = known.legal
            found.counts[:] = known.counts
        parts = []
        for part in self.parts:
            places = part.places if which is None else np.flatnonzero(np.isin(part.games, which))
            parts.append((part.observers, part.encoder.output(found), places))
        write_vectors(self.parts[0].encoder, parts, self.threads)
        return found


def writers_of(views: Sequence[ArrayView], agents: IntArray, others: int, more: int, threads: int) -> Writers | None:
    """Return what writes the vectors of agents.

    Args:
        views: of the games on each map, of all games of a batch.
        agents: numbers in the roster of those that observe, in any order.
        others: how many others vectors have.
        more: how many further entries they have; see `Encoder.made`.
        threads: how many write.

    Returns:
        None: what agents observe is not in columns of the core.
    """
    mask = np.zeros((sum(len(view.games) for view in views), len(agents)), np.bool_)
    parts = []
    for view in views:
        found = lasting_in(view, agents, others, mask)
        if found is None:
            return None
        encoder, observers, alive, roads = found
        parts.append(Part(view.games, np.arange(len(view.games)), encoder, observers, roads))
    return Writers(alive, agents, mask, parts, more, threads)
