"""Bounds on the positions of agents: the nodes that they can have reached since they were last seen.

The label of a node is an upper bound of the distance that an agent there can still move in this turn; -inf means that
it cannot be there. Labels are strict bounds: an agent that needs as much as the label does not get there. A turn adds
the speed to the label, each edge subtracts its cost, and the part of an edge that an agent may have covered, less than
the whole edge, stays for the next turn. For an agent seen on an edge this part is known; for an agent seen within a
turn the elapsed time is known: its label is reduced by the distance it covers until then, and may be negative.
"""

from functools import lru_cache
from math import inf
from typing import NamedTuple

import numpy as np

from gamms import kernels
from gamms.belief.evidence import ExactPosition, Observation, ObservedNodes
from gamms.belief.ground import Arc, BeliefMap, map_moves
from gamms.core import belief as core
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray

_ROUNDED = 1e-6  # of metres: tolerance for the distance that an agent was seen to move
_LITTLE = 1e-9  # metres: a positive speed, so that edges of length 0 can be passed without a speed


class _OpenEdges(NamedTuple):
    """Edges that may have been open."""

    ways: core.IncomingArcs  # edges with their costs
    most_covered: FloatArray  # (nodes,) the longest part of an edge that an agent can have covered from there
    enough: float  # a speed that suffices for every path in one turn


class ReachBounds:
    """Labels (targets, nodes) of the nodes that targets can have reached, updated turn by turn.

    Args:
        ground: the map.
        speeds: (targets,) edges or metres per turn.
        in_metres: whether speeds are in metres.
        are_on_edges: whether targets may be on edges, so that an empty node in view excludes nothing.
        is_free: whether agents may go anywhere in a turn.
        closed: removed edges, with the turn in which this was first observed.
    """

    def __init__(
        self,
        ground: BeliefMap,
        speeds: FloatArray,
        *,
        in_metres: bool,
        are_on_edges: bool,
        is_free: bool,
        closed: tuple[tuple[int, Arc], ...],
    ) -> None:
        self._ground = ground
        self._in_metres = in_metres
        self._is_free = is_free
        self._closed = closed
        self._speeds = speeds
        self._are_on_edges = are_on_edges

    def make_full_reach(self, turn: int) -> FloatArray:
        """Return labels of targets that can be on any node."""
        return np.tile(self._list_open_edges(turn).most_covered, (len(self._speeds), 1))

    def advance(self, labels: FloatArray, turn: int, share: float = 1.0) -> FloatArray:
        """Return the labels after the moves of a turn, or after a share of these moves."""
        if self._is_free:
            return self.make_full_reach(turn)
        edges = self._list_open_edges(turn)
        parts = np.where(np.isfinite(self._speeds), share, 1.0) if self._in_metres else 1.0
        left = labels + (np.minimum(self._speeds, edges.enough) * parts)[:, None]
        values = kernels.as_buffer(left)
        for target in range(len(left)):
            core.spread(edges.ways, values, target * left.shape[1])
        return np.minimum(left, edges.most_covered)

    def observe(self, labels: FloatArray, turn: int, seen: list[Observation], targets: tuple[str, ...]) -> FloatArray:
        """Return the labels after the observations of a turn."""
        anywhere = self.make_full_reach(turn)
        labels = anywhere.copy() if any(one.closed is None for one in seen) else labels.copy()
        found = {name: self._ground.find_row(node) for one in seen for name, node in one.found.items()}
        places = {name: one.places.get(name) for one in seen for name in one.found}
        is_clear = np.zeros(labels.shape, bool)
        for look in (look for one in seen for look in one.looks if not self._are_on_edges):
            rows = _find_certain_rows(self._ground, look)
            is_shown = np.flatnonzero([name not in look.not_shown and name not in found for name in targets])
            is_clear[np.ix_(is_shown, rows)] = True
        labels[is_clear] = -inf
        is_lost = ~(labels > -inf).any(axis=1)  # it was moved by something unknown here
        labels[is_lost] = np.where(is_clear, -inf, anywhere)[is_lost]
        for line, name in enumerate(targets):
            row = found.get(name)
            if row is not None:
                labels[line] = anywhere[line] if row < 0 else -inf
                labels[line, row] = anywhere[line, row]
                place = places.get(name)
                if row >= 0 and place is not None and self._in_metres:
                    labels[line, row] = min(anywhere[line, row], self._compute_label(place, self._speeds[line]))
        return labels

    def _compute_label(self, place: ExactPosition, speed: float) -> float:
        """Convert the position of a seen agent to its label at the beginning of this turn."""
        gone = place.time * speed if np.isfinite(speed) else 0.0
        return place.offset_m - gone + _ROUNDED * (1.0 + place.offset_m + gone)

    def _list_open_edges(self, turn: int) -> _OpenEdges:
        """Return the edges that may have been open during the moves of a turn."""
        more = tuple(sorted({arc for seen, arc in self._closed if seen >= turn}))
        return _make_open_edges(self._ground, more, self._in_metres)


@lru_cache(maxsize=8)
def _make_open_edges(ground: BeliefMap, more: tuple[Arc, ...], in_metres: bool) -> _OpenEdges:
    columns = ground.columns
    ends = ground.find_rows(np.array([arc[:2] for arc in more], np.int64).reshape(-1)).reshape(-1, 2)
    is_there = (ends >= 0).all(axis=1)
    lengths = np.array([arc[2] for arc in more])[is_there]
    sources = np.concatenate((columns.sources, ends[is_there, 0]))
    targets = np.concatenate((columns.targets, ends[is_there, 1]))
    costs = np.concatenate((columns.lengths, lengths)) if in_metres else np.ones(len(sources))
    most = np.full(ground.size, _LITTLE if in_metres else 1.0)
    if in_metres:
        np.maximum.at(most, sources, costs)
    ways = core.IncomingArcs(*kernels.group_by_target(sources, targets, costs, ground.size))
    return _OpenEdges(ways, most, 1.0 + float(costs.sum()))


class ReachByTurns:
    """The states of traffic, (targets, states) masks, that targets who obey turn restrictions can be in.

    They move along one edge per turn. The states are the places of `map_moves`. A sighting says on which node a target
    is, and nothing of the edge by which it came.

    Args:
        ground: the map.
        number: the number of targets.
        mode: the edge attribute that says which edges they may use, and the mode whose turn restrictions they obey.
    """

    def __init__(self, ground: BeliefMap, number: int, mode: str) -> None:
        self._ground = ground
        self._number = number
        moves = map_moves(ground, mode)
        self._node_of = moves.nodes
        self._first = moves.begin_on(0)  # the states from this one on are those of traffic that begins on its node
        self._starts, self._ends = moves.arcs

    def make_full_reach(self) -> BoolArray:
        """Return the states of targets that can be on any node."""
        found = np.zeros((self._number, len(self._node_of)), np.bool_)
        found[:, self._first :] = True
        return found

    def advance(self, states: BoolArray) -> BoolArray:
        """Return the states after the moves of a turn."""
        found = states.copy()
        for line in range(len(states)):
            found[line, self._ends[states[line, self._starts]]] = True
        return found

    def observe(self, states: BoolArray, seen: list[Observation], targets: tuple[str, ...]) -> BoolArray:
        """Return the states after the observations of a turn."""
        states = self.make_full_reach() if any(one.closed is None for one in seen) else states.copy()
        found = {name: self._ground.find_row(node) for one in seen for name, node in one.found.items()}
        for line, name in enumerate(targets):
            row = found.get(name)
            is_clear = np.zeros(self._ground.size, np.bool_)
            for look in (look for one in seen for look in one.looks if row is None and name not in look.not_shown):
                is_clear[_find_certain_rows(self._ground, look)] = True
            states[line] &= ~is_clear[self._node_of]
            if row is not None:
                states[line] = False
                states[line, self._first + row if row >= 0 else np.s_[self._first :]] = True
            elif not states[line].any():  # it was moved by something unknown here
                states[line, self._first :] = ~is_clear
        return states

    def find_nodes(self, states: BoolArray) -> BoolArray:
        """Return the nodes where targets can be, (targets, nodes)."""
        found = np.zeros((len(states), self._ground.size), np.bool_)
        lines, places = np.nonzero(states)
        found[lines, self._node_of[places]] = True
        return found


def _find_certain_rows(ground: BeliefMap, look: ObservedNodes) -> IntArray:
    """Return the rows of the nodes on which a target would have been seen for certain."""
    if look.node_ids is None:
        return np.arange(ground.size if look.detection == 1.0 else 0)
    rows = ground.find_rows(look.node_ids[np.broadcast_to(look.detection, look.node_ids.shape) == 1.0])
    return rows[rows >= 0]
