"""What agents observe as numbers: one vector of the same length for each agent, as learners take them.

Lengths and offsets are shares of the map: of half of the longer side of the box around its nodes.
"""

from typing import NamedTuple

import numpy as np

from gamms.game.batch.sight import Seen
from gamms.game.streets import Streets
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
    """

    values: Vectors32
    names: tuple[str, ...]
    mask: BoolArray
    legal: BoolArray


class Encoder:
    """Makes vectors for agents on some streets; what does not change is worked out once, 4 bytes for a node and entry.

    Args:
        streets: the graph.
        others: how many of the agents that one sees are in a vector: the nearest.
        actions: how many actions are in a vector.
        is_plain: whether agents may go along one edge; else what is legal is given with where they are.
    """

    def __init__(self, streets: Streets, others: int, actions: int, *, is_plain: bool) -> None:
        xy = streets.columns.xy
        low, high = (xy.min(axis=0), xy.max(axis=0)) if len(xy) else (np.zeros(2), np.zeros(2))
        self._scale, self._centre = float((high - low).max()) / 2.0 or 1.0, (low + high) / 2.0
        self._others, self._actions = others, actions
        refuse_above(200.0 * (actions + others), f"Vectors of {others} others")  # of their names
        self._places = self._placed(xy)  # (nodes, 2)
        self.names = (
            *OWN,
            *(f"action_{number}.{name}" for number in range(actions) for name in MOVE),
            *(f"other_{number}.{name}" for number in range(others) for name in OTHER),
        )
        if is_plain:
            self._refuse_too_many(len(xy))
            is_legal = np.arange(streets.legal.shape[1]) < streets.counts[:, None]
            self._of_node = self._moving(self._places, streets.legal, is_legal)
            self._is_legal: BoolArray = self._of_node[:, self._legal_entries] > 0.0

    def encode(
        self,
        node: IntArray,
        mask: BoolArray,
        seen: Seen,
        is_mate: BoolArray,
        legal: tuple[IntArray, BoolArray] | None = None,
        xy: FloatArray | None = None,
    ) -> Vectors:
        """Return the vectors of some agents.

        Args:
            node: rows, (games, agents).
            mask: (games, agents) which are alive.
            seen: by them.
            is_mate: (pairs,) which of those that are seen are of the team of the agent that sees them.
            legal: rows of the nodes where they may go, (games, agents, most), and which of them count; None: along one
                edge.
            xy: (games, agents, 2) where they are; None: on their nodes.
        """
        self._refuse_too_many(node.size)
        own = None if xy is None else self._placed(xy)
        if legal is None:
            values, is_legal = self._of_node[node], self._is_legal[node]
        else:
            values = self._moving(self._places[node] if own is None else own, *legal)
            is_legal = values[..., self._legal_entries] > 0.0
        if self._others and len(seen.at):
            here = self._places[node[seen.at, seen.viewers]] if own is None else own[seen.at, seen.viewers]
            dx, dy = (axis[seen.nodes] - start for axis, start in zip(self._places.T, here.T, strict=True))
            pairs, rank = _nearest(seen, dx * dx + dy * dy, self._others)
            rows = seen.at[pairs] * node.shape[1] + seen.viewers[pairs]
            first = (rows + 1) * len(self.names) + (rank - self._others) * len(OTHER)
            flat = values.reshape(-1)
            for place, entry in enumerate((1.0, is_mate[pairs], dx[pairs], dy[pairs])):
                flat[first + place] = entry
        if not mask.all():
            values[~mask] = 0.0
            is_legal[..., 1:] &= mask[..., None]
        return Vectors(values, self.names, mask, is_legal)

    def _refuse_too_many(self, vectors: int) -> None:
        """Refuse vectors that would not fit into memory."""
        bytes_ = 4.0 * vectors * len(self.names)
        if bytes_ > max_memory():
            refuse_above(bytes_, f"{vectors} vectors of {self._others} others")

    @property
    def _legal_entries(self) -> slice:
        """The entries that say which actions are legal."""
        return slice(len(OWN), len(OWN) + self._actions * len(MOVE), len(MOVE))

    def _placed(self, xy: FloatArray) -> FloatArray:
        return (xy - self._centre) / self._scale

    def _moving(self, own: FloatArray, rows: IntArray, is_legal: BoolArray) -> Vectors32:
        """Return vectors of agents that are there, (…, 2), and may go to nodes, (…, most); they see no others."""
        wide, shape = min(rows.shape[-1], self._actions), own.shape[:-1]
        moves = np.zeros((*shape, self._actions, len(MOVE)), np.float32)
        offsets, counts = self._places[rows[..., :wide]] - own[..., None, :], is_legal[..., :wide]
        moves[..., :wide, 0], moves[..., :wide, 1:] = counts, np.where(counts[..., None], offsets, 0.0)
        empty = np.zeros((*shape, self._others * len(OTHER)), np.float32)
        return np.concatenate((own.astype(np.float32), moves.reshape(*shape, -1), empty), axis=-1)


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
