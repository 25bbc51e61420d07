"""Contacts in many games at once: the same as in `contacts.py`, which says what they are.

Where agents go one edge a turn at most, the moments of a turn are 0 and 1; `_met_on_paths` is for all others.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from gamms import kernels
from gamms.game.batch.movement import Paths
from gamms.game.batch.turn import ArrayTurn, part_of
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.kernels.draws import BitArray
from gamms.rules.contacts import Nearness
from gamms.rules.meetings import TIME_SLACK
from gamms.rules.meetings_in_arrays import (
    Met,
    NearNodes,
    Sides,
    dot,
    equal_keys,
    in_air_of,
    near_on_travels,
    of_sides,
    on_streets,
)


class ArrayContacts(NamedTuple):
    """The contacts of a turn of many games, in the order of the games, in each in that of `contacts`.

    Arrays (contacts,): the numbers of the game in the turn and of both agents in the roster, and the rows of the nodes
    where both were.
    """

    at: IntArray
    a: IntArray
    b: IntArray
    a_node: IntArray
    b_node: IntArray


def found_in_arrays(turn: ArrayTurn, ours: IntArray, theirs: IntArray, nearness: Nearness) -> ArrayContacts:
    """Return all contacts, as `found` does; two agents may have several.

    Args:
        turn: of the games.
        ours: (agents,) the numbers of one side in the roster.
        theirs: likewise.
        nearness: what counts as a contact.
    """
    is_searched = _may_meet_on_paths(turn, ours, theirs, nearness)
    games, turn = np.flatnonzero(is_searched), turn if is_searched.all() else part_of(turn, is_searched)
    met = _met_on_edges(turn, ours, theirs, nearness) if turn.paths is None else []
    if turn.paths is not None:
        met = _met_on_paths(turn, turn.paths, (ours, theirs), nearness)
    parts = [np.concatenate(columns) for columns in zip(*met, strict=True)]
    at, a, b, times, far, on_edge = parts[:6]
    draws = turn.draw_bits(at, _pair_keys(turn.roster.names, a, b), "contacts")
    order = np.lexsort((on_edge, draws, far, times, at))
    order = order[(a != b)[order]]
    if turn.paths is not None and turn.paths.legs is not None:
        order = order[_are_first(at[order], a[order], b[order], times[order])]
    return ArrayContacts(games[at[order]], *(part[order] for part in (a, b, *parts[6:])))


def _may_meet_on_paths(turn: ArrayTurn, ours: IntArray, theirs: IntArray, nearness: Nearness) -> BoolArray:
    """Return in which games agents may meet, (games,): where few pass nodes, those where two pass the same one."""
    paths, pairs = turn.paths, len(ours) * len(theirs)
    if paths is None or paths.legs is not None or nearness.unit is not None or not 0 < pairs <= _FEW:
        return np.ones(len(turn.games), np.bool_)
    passed = np.concatenate((paths.nodes, turn.node[..., None]), axis=-1)
    left, right = (passed[:, side].reshape(len(passed), -1) for side in (ours, theirs))
    found: BoolArray = (left[:, :, None] == right[:, None]).any(axis=(1, 2))
    return found


def _met_on_edges(turn: ArrayTurn, ours: IntArray, theirs: IntArray, nearness: Nearness) -> list[Met]:
    """Return the contacts of agents that go along one edge at most."""
    by_move, nodes, passing = turn.is_there_by_move, turn.streets.num_nodes, nearness.passing
    went = turn.starts != turn.ends
    if nearness.unit is None:
        at, a, b = _equal_pairs(turn.node, turn.alive, ours, theirs, nodes)
        far = np.zeros(len(at))
    else:
        at, a, b, far = _near_pairs(turn, turn.node, turn.alive, (ours, theirs), nearness)
    since = np.where(by_move & ~went, 0.0, 1.0) if passing else np.ones(went.shape)
    places = turn.node[at, a], turn.node[at, b]
    met: list[Met] = [(at, a, b, np.maximum(since[at, a], since[at, b]), far, np.zeros(len(at), np.bool_), *places)]
    if nearness.crossing:
        ways, back = turn.starts * nodes + turn.ends, turn.ends * nodes + turn.starts
        at, a, b = _equal_pairs(ways, turn.alive & by_move & went, ours, theirs, nodes**2, back)
        time, source = (0.0, turn.starts) if passing else (1.0, turn.node)
        whole, places = np.ones(len(at)), (source[at, a], source[at, b])
        met.append((at, a, b, whole * time, whole * 0.0, whole > 0, *places))
    return met


def _met_on_paths(turn: ArrayTurn, paths: Paths, sides: Sides, nearness: Nearness) -> list[Met]:
    """Return the contacts of agents that go along several edges."""
    passing, unit, limit = nearness.passing, nearness.unit, nearness.limit
    met = [_on_nodes(turn, sides, passing=passing)] if unit is None else []
    if unit is not None and (unit == "hops" or paths.legs is None):
        met = list(_near_on_paths(turn, paths, sides, nearness))
    elif unit is not None:
        near = None if unit == "euclid" else _near_nodes(turn, nearness)
        met = [_none(), *near_on_travels(turn, paths, sides, limit, near, passing=passing)]
    if nearness.crossing and paths.legs is not None:
        met.append(on_streets(turn, paths, paths.legs, sides, passing=passing))
    elif nearness.crossing:
        met.append(_on_edges(turn, paths, sides, passing=passing))
    return met


def _none() -> Met:
    none: IntArray = np.zeros(0, np.int64)
    nowhere: FloatArray = np.zeros(0)
    return none, none, none, nowhere, nowhere, nowhere < 0.0, none, none


def _are_first(at: IntArray, a: IntArray, b: IntArray, times: FloatArray) -> BoolArray:
    """Return which contacts, in their order, are not right after another one of the same agents.

    Else they were found on the node or the next edge, too.
    """
    order = np.lexsort((np.arange(len(at)), b, a, at))
    is_first = np.ones(len(at), np.bool_)
    before, after = order[:-1], order[1:]
    same = (at[before] == at[after]) & (a[before] == a[after]) & (b[before] == b[after])
    is_first[after] = ~same | (times[after] - times[before] > TIME_SLACK)
    return is_first


def _on_nodes(turn: ArrayTurn, sides: Sides, *, passing: bool) -> Met:
    """Return the pairs that were at one node at one time."""
    visits = turn.visits(turn.alive, passing=passing)
    ours, theirs = (visits.those(rows) for rows in of_sides(turn, visits.agents, sides))
    nodes = turn.streets.num_nodes
    i, j = equal_keys(ours.at * nodes + ours.nodes, theirs.at * nodes + theirs.nodes)
    slack = 0.0 if turn.paths is None or turn.paths.legs is None else TIME_SLACK
    together = (ours.begin[i] <= theirs.end[j] + slack) & (theirs.begin[j] <= ours.end[i] + slack)
    one, other = ours.those(i[together]), theirs.those(j[together])
    times, where = np.maximum(one.begin, other.begin), one.nodes
    return one.at, one.agents, other.agents, times, times * 0.0, times < 0.0, where, where


def _on_edges(turn: ArrayTurn, paths: Paths, sides: Sides, *, passing: bool) -> Met:
    """Return the pairs that were on one edge at one time, or, unless passing counts, at any, in opposite directions."""
    counts = (np.arange(paths.nodes.shape[-1] - 1) + 1 < paths.lengths[..., None]) & (
        turn.is_there_by_move & turn.alive
    )[..., None]
    counts &= paths.nodes[..., 1:] != paths.nodes[..., :-1]
    at, agents, number = np.nonzero(counts)
    ends = [paths.nodes[at, agents, number + k] for k in (0, 1)]
    since, until = ((paths.times[at, agents, number + k] if passing else np.ones(len(at))) for k in (0, 1))
    ours, theirs = of_sides(turn, agents, sides)
    ways, back = ((at * turn.streets.num_nodes + a) * turn.streets.num_nodes + b for a, b in (ends, ends[::-1]))
    i, j = equal_keys(ways[ours], back[theirs])
    i, j = ours[i], theirs[j]
    if passing:  # who enters an edge when the other leaves it meets it on the node
        together = (since[i] < until[j]) & (since[j] < until[i])
        i, j = i[together], j[together]
    times, games, (a, b) = np.maximum(since[i], since[j]), at[i], (agents[i], agents[j])
    where = (ends[0][i], ends[0][j]) if passing else (turn.node[games, a], turn.node[games, b])
    return games, a, b, times, times * 0.0, times >= 0.0, *where


def _near_on_paths(turn: ArrayTurn, paths: Paths, sides: Sides, nearness: Nearness) -> Iterator[Met]:
    """Yield the pairs that were near enough, at each moment at which one of two agents reached a node."""
    goes = turn.is_there_by_move & turn.alive & np.isin(np.arange(turn.alive.shape[1]), np.concatenate(sides))
    times = np.where(goes[..., None] & paths.arrives, paths.times, np.inf)
    moments = np.unique(times[..., 1:]).tolist() if nearness.passing else ()
    for now in [moment for moment in moments if moment < 1.0]:
        came = (times[..., 1:] == now).any(axis=-1)
        last = np.maximum((paths.times <= now).sum(axis=-1) - 1, 0)
        node = np.take_along_axis(paths.nodes, last[..., None], axis=-1)[..., 0]
        counts = goes & came.any(axis=1)[:, None] & ((paths.times[..., 0] == 0.0) | (last > 0))
        at, a, b, far = _near_pairs(turn, node, counts, sides, nearness)
        some = came[at, a] | came[at, b]
        at, a, b, far = at[some], a[some], b[some], far[some]
        yield at, a, b, np.full(len(at), now), far, far < 0.0, node[at, a], node[at, b]
    at, a, b, far = _near_pairs(turn, turn.node, turn.alive, sides, nearness)
    since = np.ones(turn.node.shape)
    if nearness.passing:
        came = np.where(paths.arrives, paths.times, 0.0).max(axis=-1)
        since = np.where(turn.is_there_by_move, came, 1.0)
    together = np.maximum(since[at, a], since[at, b])
    some = (together == 0.0) | (together == 1.0)  # else they were found when the later of both had arrived
    at, a, b, far, together = at[some], a[some], b[some], far[some], together[some]
    yield at, a, b, together, far, far < 0.0, turn.node[at, a], turn.node[at, b]


def one_to_one_in_arrays(met: ArrayContacts, agents: int) -> BoolArray:
    """Return which contacts are those that `one_to_one` takes, (contacts,); `agents` is how many a game has."""
    keys = np.stack((met.at * agents + met.a, met.at * agents + met.b))
    taken, left = np.zeros(len(met.at), np.bool_), np.arange(len(met.at))
    while len(left):  # in each round those that come first for both their agents: one at least
        known, number = np.unique(keys[:, left], return_inverse=True)
        number = number.reshape(2, -1)
        first = np.full(len(known), len(met.at))
        np.minimum.at(first, number.ravel(), np.tile(left, 2))
        is_first = (first[number] == left).all(axis=0)
        taken[left[is_first]] = True
        is_gone = np.zeros(len(known), np.bool_)
        is_gone[number[:, is_first]] = True
        left = left[~is_gone[number].any(axis=0)]
    return taken


_FEW = 64  # pairs of agents of one game: so many are compared with each other


def _equal_pairs(
    keys: IntArray, counts: BoolArray, ours: IntArray, theirs: IntArray, bound: int, their_keys: IntArray | None = None
) -> tuple[IntArray, IntArray, IntArray]:
    """Return the games of pairs of agents that count and have equal keys below `bound`, and the numbers of both."""
    left, right = keys[:, ours], (keys if their_keys is None else their_keys)[:, theirs]
    if len(ours) * len(theirs) <= _FEW:
        equal = (left[:, :, None] == right[:, None]) & counts[:, ours][:, :, None] & counts[:, theirs][:, None]
        found = np.flatnonzero(equal)  # which is faster than to look for three indices, where there are few
        at, i, j = np.unravel_index(found, equal.shape)
        return at, ours[i], theirs[j]
    at, i = np.nonzero(counts[:, ours])
    others, j = np.nonzero(counts[:, theirs])
    rows, places = equal_keys(at * bound + left[at, i], others * bound + right[others, j])
    return at[rows], ours[i[rows]], theirs[j[places]]


def _pair_keys(names: tuple[str, ...], a: IntArray, b: IntArray) -> BitArray:
    """Return the hashes of pairs of names, (pairs,)."""
    keys = [kernels.name_key(repr((names[i], names[j]))) for i, j in zip(a.tolist(), b.tolist(), strict=True)]
    return np.array(keys, np.uint64)


# -- pairs that are near each other -----------------------------------------------------------------------------------

_AT_ONCE = 1 << 20  # pairs of agents that are compared
_MANY = 128  # agents of one side: in straight lines, of so many those that are near are found by cells of the map
_FAR = 1e150  # map units, of which squares are not infinite


def _near_pairs(
    turn: ArrayTurn, nodes: IntArray, counts: BoolArray, sides: Sides, nearness: Nearness
) -> tuple[IntArray, IntArray, IntArray, FloatArray]:
    """Return the games of pairs of agents that count and are on nodes near each other, both agents, and how far."""
    ours, theirs = sides
    near: _Straight | NearNodes
    if nearness.unit == "euclid":
        near, nodes = _straight(turn, nodes, sides, nearness.limit)
        if len(theirs) > _MANY and nearness.limit < _FAR:
            return _near_by_cells(near, (nodes, counts), ours, theirs)
    else:
        near = _near_nodes(turn, nearness)
    size = max(1, _AT_ONCE // max(1, len(ours) * len(theirs)))
    parts = []
    for first in range(0, len(turn.games), size):
        games = slice(first, first + size)
        node, alive = nodes[games], counts[games]
        starts, ends = node[:, ours], node[:, theirs]
        may_meet = near.may_be_near(starts[:, :, None], ends[:, None])
        may_meet &= alive[:, ours][:, :, None] & alive[:, theirs][:, None]
        at, i, j = np.unravel_index(np.flatnonzero(may_meet), may_meet.shape)
        far = near.distances(starts[at, i], ends[at, j])
        parts.append((first + at, ours[i], theirs[j], far))
    at, a, b, far = (np.concatenate(columns) for columns in zip(*parts, strict=True))
    is_near = np.isfinite(far)
    return at[is_near], a[is_near], b[is_near], far[is_near]


def _near_nodes(turn: ArrayTurn, nearness: Nearness) -> NearNodes:
    unit, limit = nearness.unit, nearness.limit
    return turn.shared(("near", unit, limit), lambda: NearNodes(turn.streets, limit, by_length=unit == "metres"))


def _near_by_cells(
    near: "_Straight", where: tuple[IntArray, BoolArray], ours: IntArray, theirs: IntArray
) -> tuple[IntArray, IntArray, IntArray, FloatArray]:
    """Return what `_near_pairs` does in straight lines."""
    (x, y), (nodes, counts) = near.axes[:2], where
    (at, i), (there, j) = (np.nonzero(counts[:, side]) for side in (ours, theirs))
    a, b = ours[i], theirs[j]
    here, beside = nodes[at, a], nodes[there, b]
    areas = kernels.Area(x[here], y[here], at), kernels.Area(x[beside], y[beside], there)
    none = np.zeros(0, np.int64)
    found = [(none, none), *kernels.near_each_other(areas[0], areas[1], near.limit)]
    rows, others = (np.concatenate([part[side] for part in found]) for side in (0, 1))
    is_near = near.may_be_near(here[rows], beside[others])
    rows, others = rows[is_near], others[is_near]
    return at[rows], a[rows], b[others], near.distances(here[rows], beside[others])


def _straight(turn: ArrayTurn, nodes: IntArray, sides: Sides, limit: float) -> tuple["_Straight", IntArray]:
    """Return what measures straight lines, and where agents are there that are on nodes, (games, agents)."""
    axes, in_air = [*turn.streets.axes], in_air_of(turn, sides)
    if in_air is None:
        return _Straight(axes, limit), nodes
    agents, xyz = in_air
    nodes, num_nodes = nodes.copy(), len(axes[0])
    nodes[:, agents] = num_nodes + np.arange(xyz[..., 0].size).reshape(xyz.shape[:2])
    axes.append(np.zeros(num_nodes))
    return _Straight([np.append(axis, xyz[..., i]) for i, axis in enumerate(axes)], limit), nodes


class _Straight:
    """How far places are from each other in a straight line, those of nodes by their rows.

    Attributes:
        axes: (places,) each: x and y, and z where agents fly.
        limit: what is near.
    """

    def __init__(self, axes: Sequence[FloatArray], limit: float) -> None:
        self.axes, self.limit = axes, limit

    def may_be_near(self, starts: IntArray, ends: IntArray) -> BoolArray:
        """Return which pairs of places are near each other; of shapes that are broadcast."""
        return self._squares(starts, ends) <= self.limit * self.limit

    def distances(self, starts: IntArray, ends: IntArray) -> FloatArray:
        """Return how far places are apart."""
        return np.sqrt(self._squares(starts, ends))

    def _squares(self, starts: IntArray, ends: IntArray) -> FloatArray:
        offsets = [axis[starts] - axis[ends] for axis in self.axes]
        return dot(offsets, offsets)
