"""Between which agents obstacles are, in all games of a view at once."""

from typing import NamedTuple

import numpy as np

from gamms.game.batch.columns import some_rows
from gamms.game.streets import Streets
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.ir.sensed import AgentLook

_MOST_KNOWN = 1 << 22  # pairs of nodes of which it is known whether something is between them


class Spots(NamedTuple):
    """Where agents are, (agents,): rows of the nodes that they have passed last, who is on an edge, and x and y."""

    node: IntArray
    on_edge: BoolArray
    x: FloatArray
    y: FloatArray


class SightLines:
    """What obstacles hide from one kind of sensor; between nodes that is kept, of those that were asked for.

    Args:
        streets: of the map.
        look: of the sensor.
    """

    def __init__(self, streets: Streets, look: AgentLook) -> None:
        self._streets, self._look = streets, look
        self._keys, self._is_hidden = np.zeros(0, np.int64), np.zeros(0, np.bool_)

    def hidden(self, viewers: Spots, others: Spots) -> BoolArray:
        """Return which agents are hidden from those that look, unless these look from a fixed place, (pairs,)."""
        if self._look.place is not None:
            viewers = viewers._replace(node=np.zeros_like(viewers.node), on_edge=np.zeros_like(viewers.on_edge))
        is_beside = viewers.on_edge | others.on_edge
        if not is_beside.any():
            return self._between_nodes(viewers.node, others.node)
        found, on_nodes = np.zeros(len(is_beside), np.bool_), ~is_beside
        found[on_nodes] = self._between_nodes(viewers.node[on_nodes], others.node[on_nodes])
        looks, seen = (some_rows(spots, is_beside) for spots in (viewers, others))
        ids, hides = self._streets.ids, self._look.hides_pairs
        if hides is not None:
            places = [np.column_stack((spots.x, spots.y)) for spots in (looks, seen)]
            found[is_beside] = hides(ids(looks.node), places[0], looks.on_edge, ids(seen.node), places[1])
        return found

    def _between_nodes(self, starts: IntArray, ends: IntArray) -> BoolArray:
        """Return which nodes are hidden from others, by rows, (pairs,)."""
        pairs, which = np.unique(starts * len(self._streets.counts) + ends, return_inverse=True)
        new = pairs[~np.isin(pairs, self._keys, assume_unique=True)]
        if len(new):
            if len(self._keys) + len(new) > _MOST_KNOWN:
                self._keys, self._is_hidden, new = np.zeros(0, np.int64), np.zeros(0, np.bool_), pairs
            keys = np.concatenate((self._keys, new))
            order = np.argsort(keys, kind="stable")
            self._keys, self._is_hidden = keys[order], np.concatenate((self._is_hidden, self._looked(new)))[order]
        found: BoolArray = self._is_hidden[np.searchsorted(self._keys, pairs)][which]
        return found

    def _looked(self, pairs: IntArray) -> BoolArray:
        ids, hides = self._streets.columns.node_ids, self._look.hides
        first, last = np.divmod(pairs, len(ids))
        runs = np.split(np.arange(len(pairs)), np.flatnonzero(np.diff(first)) + 1)
        parts = [] if hides is None else [hides(int(ids[first[run[0]]]), ids[last[run]]) for run in runs]
        return np.concatenate(parts)
