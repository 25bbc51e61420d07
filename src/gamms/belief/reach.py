"""Where agents can be at most: the nodes that they can have reached since they were seen last.

For each node, a label says more than how far an agent that is there can still go in this turn; -inf says that it cannot
be there. Labels are strict bounds: an agent that needs as much as the label says does not get there. A turn adds the
speed to the label, each edge takes its cost away, and what an agent may have covered of an edge, less than the whole of
it, stays for the next turn.
"""

from functools import lru_cache
from math import inf
from typing import NamedTuple

import numpy as np

from gamms.belief.evidence import Observation
from gamms.belief.ground import Arc, Ground
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray

_LITTLE = 1e-9  # metres: more than nothing, so that edges without a length can be gone along without a speed


class _Edges(NamedTuple):
    """Edges by their targets."""

    sources: IntArray  # (edges,) rows
    targets: IntArray  # (nodes with edges to them,) rows
    starts: IntArray  # likewise: where the edges to a target begin
    costs: FloatArray  # (edges,)
    most_covered: FloatArray  # (nodes,) the most that an agent can have covered of an edge from there


class Reach:
    """Which nodes some targets can have reached: labels (targets, nodes) that are moved from turn to turn.

    Args:
        ground: the map.
        speeds: (targets,) edges or metres in a turn.
        in_metres: which of both.
        is_free: whether agents may go anywhere in a turn.
        closed: edges that are gone, with the turn in which that was seen first.
    """

    def __init__(
        self, ground: Ground, speeds: FloatArray, *, in_metres: bool, is_free: bool, closed: tuple[tuple[int, Arc], ...]
    ) -> None:
        self._ground, self._in_metres, self._is_free, self._closed = ground, in_metres, is_free, closed
        self._speeds = speeds[:, None]

    def anywhere(self, turn: int) -> FloatArray:
        """Return labels of targets that can be on any node."""
        return np.tile(self._edges(turn).most_covered, (len(self._speeds), 1))

    def advance(self, labels: FloatArray, turn: int) -> FloatArray:
        """Return the labels after the moves that lead to a turn."""
        if self._is_free:
            return self.anywhere(turn)
        edges = self._edges(turn)
        left = labels + np.minimum(self._speeds, 1.0 + edges.costs.sum())  # which is finite
        while len(edges.targets):
            offers = np.maximum.reduceat(left[:, edges.sources] - edges.costs, edges.starts, axis=1)
            now = left[:, edges.targets]
            is_more = (offers > now) & (offers > 0.0)
            if not is_more.any():
                break
            left[:, edges.targets] = np.where(is_more, offers, now)
        moved: FloatArray = np.minimum(left, edges.most_covered)
        return moved

    def observe(self, labels: FloatArray, turn: int, seen: list[Observation], targets: tuple[str, ...]) -> FloatArray:
        """Return the labels after what was observed in a turn."""
        anywhere = self.anywhere(turn)
        labels = anywhere.copy() if any(one.closed is None for one in seen) else labels.copy()
        found = {name: node for one in seen for name, node in one.found.items()}
        rows = [self._ground.row(found[name]) if name in found else None for name in targets]
        for line, (name, row) in enumerate(zip(targets, rows, strict=True)):
            if row is None:
                is_clear = self._clear(name, seen)
                labels[line, is_clear] = -inf
                if not (labels[line] > -inf).any():  # something moved it that is not known here
                    labels[line] = np.where(is_clear, -inf, anywhere[line])
            else:
                here = anywhere[line, row]
                labels[line] = anywhere[line] if row < 0 else -inf
                labels[line, row] = here
        return labels

    def _clear(self, name: str, seen: list[Observation]) -> BoolArray:
        """Return on which nodes (nodes,) a target would have been seen."""
        is_clear = np.zeros(self._ground.size, bool)
        for look in (look for one in seen for look in one.looks if name not in look.not_shown):
            if look.node_ids is None:
                is_clear |= look.detection == 1.0
            else:
                rows = self._ground.rows(look.node_ids[np.broadcast_to(look.detection, look.node_ids.shape) == 1.0])
                is_clear[rows[rows >= 0]] = True
        return is_clear

    def _edges(self, turn: int) -> _Edges:
        """Return the edges that may have been open in the moves that lead to a turn."""
        more = tuple(sorted({arc for seen, arc in self._closed if seen >= turn}))
        return _edges_of(self._ground, more, self._in_metres)


@lru_cache(maxsize=8)
def _edges_of(ground: Ground, more: tuple[Arc, ...], in_metres: bool) -> _Edges:
    columns = ground.columns
    ends = ground.rows(np.array([arc[:2] for arc in more], np.int64).reshape(-1)).reshape(-1, 2)
    is_there = (ends >= 0).all(axis=1)
    lengths = np.array([arc[2] for arc in more])[is_there]
    sources = np.concatenate((columns.sources, ends[is_there, 0]))
    targets = np.concatenate((columns.targets, ends[is_there, 1]))
    costs = np.concatenate((columns.lengths, lengths)) if in_metres else np.ones(len(sources))
    most = np.full(ground.size, _LITTLE if in_metres else 1.0)
    if in_metres:
        np.maximum.at(most, sources, costs)
    order = np.argsort(targets, kind="stable")
    reached, starts = np.unique(targets[order], return_index=True)
    return _Edges(sources[order], reached, starts, costs[order], most)
