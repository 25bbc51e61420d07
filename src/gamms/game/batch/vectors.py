"""What agents observe as numbers: one vector of the same length for each agent, as learners take them.

Lengths and offsets are shares of the map: of half of the longer side of the box around its nodes.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from gamms.core import observe
from gamms.game.batch.columns import in_threads
from gamms.game.conflicts import flat
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.limits import max_memory, refuse_above

OWN = ("x", "y")  # from the centre of the map
OTHER = ("is_seen", "is_mate", "dx", "dy")  # of each other agent; offsets from the agent to the node of the other
MOVE = ("is_legal", "dx", "dy")  # of each action; offsets from the agent to where it leads


Vectors32 = np.ndarray[tuple[int, ...], np.dtype[np.float32]]


class Vectors(NamedTuple):
    """The observations of the agents of a view.

    Attributes:
        values: (games, agents, entries) float32; all 0 of agents that are dead.
        names: (entries,) what they are, such as `other_0.dx`.
        mask: (games, agents) which agents are alive.
        legal: (games, agents, actions) which actions are legal; of dead agents, only to stay.
        counts: (games, agents) how many these are.
    """

    values: Vectors32
    names: tuple[str, ...]
    mask: BoolArray
    legal: BoolArray
    counts: IntArray


class Encoder:
    """Makes vectors for agents on one map, or on several.

    Args:
        xy: (nodes, 2) the positions of the nodes of each map.
        agents: how many agents there are in a game.
        others: how many of those that one sees are in a vector: the nearest.
        actions: how many actions are in a vector.
    """

    def __init__(self, xy: Sequence[FloatArray], agents: int, others: int, actions: int) -> None:
        self._boxes = [_box_of(one) for one in xy]
        self._agents = agents
        self._others = others
        self._actions = actions
        refuse_above(200.0 * (actions + others), f"Vectors of {others} others")  # of their names
        shares = [(one - centre) / scale for one, (centre, scale) in zip(xy, self._boxes, strict=True)]
        self._places = flat(np.concatenate(shares), np.float64)
        self._on_nodes = flat(np.zeros(0), np.float64)
        self.names = (
            *OWN,
            *(f"action_{number}.{name}" for number in range(actions) for name in MOVE),
            *(f"other_{number}.{name}" for number in range(others) for name in OTHER),
        )

    def made(self, mask: BoolArray, more: int) -> Vectors:
        """Return room for the vectors of some agents, with so many further entries.

        Args:
            mask: (games, agents) which are alive.
            more: how many further entries: 0, but the last one the share n / (n + 100) after n turns.
        """
        entries = len(self.names) + more
        bytes_ = 4.0 * mask.size * entries
        if bytes_ > max_memory():
            refuse_above(bytes_, f"{mask.size} vectors of {self._others} others")
        values = np.empty((*mask.shape, entries), np.float32)
        is_legal = np.empty((*mask.shape, self._actions), np.bool_)
        return Vectors(values, self.names, mask, is_legal, np.empty(mask.shape, np.int64))

    def output(self, vectors: Vectors, xy: FloatArray | None = None) -> observe.VectorObservations:
        """Return vectors of some agents as the core writes them.

        Args:
            vectors: that are written.
            xy: (games, agents, 2) where the agents are, on one map; None: on their nodes.
        """
        own = self._on_nodes
        if xy is not None:
            centre, scale = self._boxes[0]
            own = flat((xy - centre) / scale, np.float64)
        written: Any = (
            vectors.values.reshape(-1).data,
            vectors.legal.view(np.uint8).reshape(-1).data,
            vectors.counts.reshape(-1).data,
        )
        return observe.VectorObservations(
            self._places, own, self._actions, self._others, vectors.values.shape[-1], *written
        )

    @property
    def room(self) -> observe.NearestAgents:
        """What a thread notes those in that an agent sees."""
        return room_for(self._agents, self._others)


def _box_of(xy: FloatArray) -> tuple[FloatArray, float]:
    """Return the center of the box around nodes, and half of its longer side; 1 if that is 0."""
    low, high = (xy.min(axis=0), xy.max(axis=0)) if len(xy) else (np.zeros(2), np.zeros(2))
    return (low + high) / 2.0, float((high - low).max()) / 2.0 or 1.0


def legal_of(offsets: IntArray, targets: IntArray) -> tuple[Any, Any]:
    """Return the legal nodes of agents, or of nodes, as the core takes them; see `core.observe.Observers`."""
    return flat(offsets, np.int32), flat(targets, np.int32)


def room_for(agents: int, others: int) -> observe.NearestAgents:
    """Return what a thread notes those in that an agent sees, of so many agents, and so many of them the nearest."""
    seen: Any = np.zeros(agents, np.int64).data, np.zeros(agents, np.uint8).data
    nearest: Any = np.zeros(others + 1).data, np.zeros(others + 1, np.int64).data
    return observe.NearestAgents(*seen, *nearest)


def write_vectors(
    encoder: Encoder, observers: observe.Observers, output: observe.VectorObservations, places: IntArray, threads: int
) -> None:
    """Write the vectors of agents.

    Args:
        encoder: of the vectors.
        observers: the agents.
        output: their vectors; see `Encoder.output`.
        places: the games that are written, as indices in those of the observers.
        threads: how many write them, each those of some games.
    """
    chosen = flat(places, np.int64)

    def observe_part(_: int, begin: int, end: int) -> None:
        observe.observe_aside(observers, output, encoder.room, chosen, begin, end)

    in_threads(observe_part, len(places), threads)
