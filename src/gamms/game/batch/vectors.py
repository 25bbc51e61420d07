"""What agents observe as numbers: one vector of the same length for each agent, as learners take them.

Lengths and offsets are shares of the map: of half of the longer side of the box around its nodes.
"""

from typing import NamedTuple

import numpy as np

from gamms.game.batch.sight import Seen
from gamms.game.streets import Streets
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray

OWN = ("x", "y")  # from the centre of the map
OTHER = ("is_seen", "is_mate", "dx", "dy")  # of each other agent; offsets from the agent to the node of the other
MOVE = ("is_legal", "dx", "dy")  # of each action; offsets from the agent to where it leads


class Vectors(NamedTuple):
    """The observations of the agents of a view.

    Attributes:
        values: (games, agents, entries) float32; all 0 of agents that are dead.
        names: (entries,) what they are, such as `other_0.dx`.
        mask: (games, agents) which agents are alive.
        legal: (games, agents, actions) which actions are legal; of dead agents, only to stay.
    """

    values: "np.ndarray[tuple[int, ...], np.dtype[np.float32]]"
    names: tuple[str, ...]
    mask: BoolArray
    legal: BoolArray


class Encoder:
    """Makes vectors for agents on some streets; what does not change is worked out once, 4 bytes for a node and entry.

    Args:
        streets: the graph.
        others: how many of the agents that one sees are in a vector: the nearest.
        actions: how many actions are in a vector; None: the most that are legal anywhere.
    """

    def __init__(self, streets: Streets, others: int, actions: int | None = None) -> None:
        xy = streets.columns.xy
        low, high = (xy.min(axis=0), xy.max(axis=0)) if len(xy) else (np.zeros(2), np.zeros(2))
        scale = float((high - low).max()) / 2.0 or 1.0
        self._places: FloatArray = (xy - (low + high) / 2.0) / scale  # (nodes, 2)
        most, self._others = int(streets.counts.max(initial=1)), others
        actions = most if actions is None else actions
        self._is_legal: BoolArray = np.arange(actions) < streets.counts[:, None]
        moves = np.zeros((len(xy), actions, len(MOVE)), np.float32)
        moves[..., 0] = self._is_legal
        moves[:, :most, 1:] = self._places[streets.legal] - self._places[:, None]
        empty = np.zeros((len(xy), others * len(OTHER)), np.float32)
        self._of_node = np.concatenate((self._places.astype(np.float32), moves.reshape(len(xy), -1), empty), axis=1)
        self.names = (
            *OWN,
            *(f"action_{number}.{name}" for number in range(actions) for name in MOVE),
            *(f"other_{number}.{name}" for number in range(others) for name in OTHER),
        )

    def encode(self, node: IntArray, mask: BoolArray, seen: Seen, is_mate: BoolArray) -> Vectors:
        """Return the vectors of some agents.

        Args:
            node: rows, (games, agents).
            mask: (games, agents) which are alive.
            seen: by them.
            is_mate: (pairs,) which of those that are seen are of the team of the agent that sees them.
        """
        values, legal = self._of_node[node], self._is_legal[node]
        if self._others and len(seen.at):
            here = node[seen.at, seen.viewers]
            dx, dy = (axis[seen.nodes] - axis[here] for axis in self._places.T)
            pairs, rank = _nearest(seen, dx * dx + dy * dy, self._others)
            rows = seen.at[pairs] * node.shape[1] + seen.viewers[pairs]
            first = (rows + 1) * len(self.names) + (rank - self._others) * len(OTHER)
            flat = values.reshape(-1)
            for place, entry in enumerate((1.0, is_mate[pairs], dx[pairs], dy[pairs])):
                flat[first + place] = entry
        if not mask.all():
            values[~mask] = 0.0
            legal[..., 1:] &= mask[..., None]
        return Vectors(values, self.names, mask, legal)


def _nearest(seen: Seen, far: FloatArray, most: int) -> tuple[IntArray, IntArray]:
    """Return the pairs of the nearest of those that each agent sees, so many at most, and how many are nearer.

    Of several that are equally far the first by name is the nearer one.
    """
    is_first = np.ones(len(far), np.bool_)
    is_first[1:] = (seen.at[1:] != seen.at[:-1]) | (seen.viewers[1:] != seen.viewers[:-1])
    starts = np.flatnonzero(is_first)
    viewer, order = np.cumsum(is_first) - 1, np.arange(len(far))
    among = np.flatnonzero(~(is_first & np.append(is_first[1:], True)))  # those that see several
    order[among] = among[np.lexsort((far[among], viewer[among]))]
    rank = np.arange(len(far)) - starts[viewer]
    kept = rank < most
    return order[kept], rank[kept]
