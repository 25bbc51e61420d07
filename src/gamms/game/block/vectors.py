"""Observation vectors for learners: one float vector of fixed length for each agent.

Positions and offsets are in units of half the longer side of the bounding box of the map's nodes.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from gamms.core import observe
from gamms.game.block.columns import in_threads
from gamms.game.conflicts import flat
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.limits import max_memory, refuse_above

OWN = ("x", "y")  # relative to the center of the map
OTHER = ("is_seen", "is_mate", "dx", "dy")  # for each other agent; offsets from the agent to the other's node
MOVE = ("is_legal", "dx", "dy")  # for each action; offsets from the agent to the action's node


Vectors32 = np.ndarray[tuple[int, ...], np.dtype[np.float32]]


class Vectors(NamedTuple):
    """Observation vectors of the agents of a view.

    Attributes:
        values: (games, agents, entries) float32; all 0 for dead agents.
        names: (entries,) the names of the entries, such as `other_0.dx`.
        mask: (games, agents) whether each agent is alive.
        legal: (games, agents, actions) whether each action is legal; dead agents can only stay.
        counts: (games, agents) the number of legal actions.
    """

    values: Vectors32
    names: tuple[str, ...]
    mask: BoolArray
    legal: BoolArray
    counts: IntArray


class Encoder:
    """Builds observation vectors for agents on one or several maps.

    Args:
        xy: for each map, the positions of its nodes, (nodes, 2).
        agents: the number of agents in a game.
        others: the number of other agents in a vector: the nearest visible ones.
        actions: the number of actions in a vector.
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
        """Return uninitialized vectors with `more` additional entries at the end.

        Args:
            mask: (games, agents) whether each agent is alive.
            more: the number of additional entries: all 0 except the last one, which is n / (n + 100) after n turns.
        """
        entries = len(self.names) + more
        bytes_ = 4.0 * mask.size * entries
        if bytes_ > max_memory():
            refuse_above(bytes_, f"{mask.size} vectors of {self._others} others")
        values = np.empty((*mask.shape, entries), np.float32)
        is_legal = np.empty((*mask.shape, self._actions), np.bool_)
        return Vectors(values, self.names, mask, is_legal, np.empty(mask.shape, np.int64))

    def output(self, vectors: Vectors, xy: FloatArray | None = None) -> observe.VectorObservations:
        """Return the buffers of vectors that the core writes to.

        Args:
            vectors: the vectors to write.
            xy: (games, agents, 2) the positions of the agents, on a single map; None: the positions of their nodes.
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

    def rooms(self, threads: int) -> list[observe.NearestAgents]:
        """Return new scratch buffers, in which each thread collects the agents that an agent sees."""
        return [room_for(self._agents, self._others) for _ in range(threads)]


def _box_of(xy: FloatArray) -> tuple[FloatArray, float]:
    """Return the center of the bounding box of nodes, (2,), and half of its longer side; 1 if that is 0."""
    low, high = (xy.min(axis=0), xy.max(axis=0)) if len(xy) else (np.zeros(2), np.zeros(2))
    return (low + high) / 2.0, float((high - low).max()) / 2.0 or 1.0


def legal_of(offsets: IntArray, targets: IntArray) -> tuple[Any, Any]:
    """Return offsets and rows of legal nodes as int32 buffers; see `core.observe.Observers`."""
    return flat(offsets, np.int32), flat(targets, np.int32)


def room_for(agents: int, others: int) -> observe.NearestAgents:
    """Return scratch buffers for one thread: the agents that an agent sees, and the nearest `others` of them."""
    seen: Any = np.zeros(agents, np.int64).data, np.zeros(agents, np.uint8).data
    nearest: Any = np.zeros(others + 1).data, np.zeros(others + 1, np.int64).data
    return observe.NearestAgents(*seen, *nearest)


def write_vectors(
    observers: observe.Observers,
    output: observe.VectorObservations,
    places: IntArray,
    rooms: Sequence[observe.NearestAgents],
) -> None:
    """Write the observation vectors of agents.

    Args:
        observers: the agents.
        output: the buffers of the vectors; see `Encoder.output`.
        places: the games to write, as indices into the games of the observers.
        rooms: scratch buffers; for each, a thread writes a part of the games.
    """
    chosen = flat(places, np.int64)

    def observe_part(thread: int, begin: int, end: int) -> None:
        observe.observe_aside(observers, output, rooms[thread], chosen, begin, end)

    in_threads(observe_part, len(places), len(rooms))
