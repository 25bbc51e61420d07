"""What agents observe as numbers: one vector of the same length for each agent, as learners take them.

Lengths and offsets are shares of the map: of half of the longer side of the box around its nodes.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from gamms.core import observe
from gamms.game.batch.columns import in_threads
from gamms.game.conflicts import flat
from gamms.game.streets import StreetGraph
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
    """Makes vectors for agents on some streets.

    Args:
        streets: the graph.
        agents: how many agents there are in a game.
        others: how many of those that one sees are in a vector: the nearest.
        actions: how many actions are in a vector.
    """

    def __init__(self, streets: StreetGraph, agents: int, others: int, actions: int) -> None:
        xy = streets.columns.xy
        low, high = (xy.min(axis=0), xy.max(axis=0)) if len(xy) else (np.zeros(2), np.zeros(2))
        self._scale = float((high - low).max()) / 2.0 or 1.0
        self._centre = (low + high) / 2.0
        self._agents = agents
        self._others = others
        self._actions = actions
        refuse_above(200.0 * (actions + others), f"Vectors of {others} others")  # of their names
        self._places = self._placed(xy)
        self._on_nodes = self._placed(np.zeros((0, 2)))
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
            xy: (games, agents, 2) where the agents are; None: on their nodes.
        """
        own = self._on_nodes if xy is None else self._placed(xy)
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

    def _placed(self, xy: FloatArray) -> Any:
        """Return places, (…, 2), in shares of the map from its centre, as the core takes them."""
        return flat((xy - self._centre) / self._scale, np.float64)


def legal_of(offsets: IntArray, targets: IntArray) -> tuple[Any, Any]:
    """Return the legal nodes of agents, or of nodes, as the core takes them; see `core.observe.Observers`."""
    return flat(offsets, np.int32), flat(targets, np.int32)


def room_for(agents: int, others: int) -> observe.NearestAgents:
    """Return what a thread notes those in that an agent sees, of so many agents, and so many of them the nearest."""
    seen: Any = np.zeros(agents, np.int64).data, np.zeros(agents, np.uint8).data
    nearest: Any = np.zeros(others + 1).data, np.zeros(others + 1, np.int64).data
    return observe.NearestAgents(*seen, *nearest)


def write_vectors(
    encoder: Encoder, parts: Sequence[tuple[observe.Observers, observe.VectorObservations, IntArray]], threads: int
) -> None:
    """Write the vectors of agents.

    Args:
        encoder: of any of the maps.
        parts: of each map, the agents, their vectors, and the places of the games that are written.
        threads: how many write them, each those of some games.
    """
    each = [(observers, vectors, flat(places, np.int64)) for observers, vectors, places in parts]

    def observe_part(thread: int, _: int, __: int) -> None:
        found = encoder.room
        for observers, vectors, places in each:
            first, last = (len(places) * one // threads for one in (thread, thread + 1))
            observe.observe_aside(observers, vectors, found, places, first, last)

    in_threads(observe_part, threads, threads)
