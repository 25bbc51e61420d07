"""When and where agents that travel by metres are near each other in many games at once: the same as in `meetings.py`.

All numbers are worked out by the same operations in the same order as there, so that they are the same to the bit.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from gamms import kernels
from gamms.game.batch.columns import joined_rows, some_rows
from gamms.game.batch.movement import Legs, Paths
from gamms.game.batch.roads import REMOVED
from gamms.game.batch.turn import ArrayTurn, movement_in
from gamms.game.streets import Streets
from gamms.ir.graph import FloatArray, GraphColumns, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.rules.meetings import TIME_SLACK, with_rim

Met = tuple[IntArray, IntArray, IntArray, FloatArray, FloatArray, BoolArray, IntArray, IntArray]
"""Contacts: games, agents of both sides, times, distances, whether on an edge, where both were."""

Sides = tuple[IntArray, IntArray]  # the numbers of agents in the roster
Pairs = tuple[IntArray, IntArray, IntArray]  # games, and agents of both sides
_First = tuple[IntArray, FloatArray, FloatArray]  # rows of pairs; when they are first near each other, and how near
_Change = tuple[IntArray, FloatArray, FloatArray, FloatArray]
"""Rows of pairs; until when the distance between both changes evenly and may fall, and what it is at both times."""
_AT_ONCE = 1 << 20  # pairs of agents, or of the nodes that they pass, that are compared
_PAIRS_AT_ONCE = 1 << 14  # pairs of agents whose ways are compared
_MANY = 128  # agents of one side: of so many those that are near are found by cells of the map
_FAR = 1e150  # map units, of which squares are not infinite
_MOST_KNOWN = 1 << 25  # pairs of nodes that are kept


class _Pieces(NamedTuple):
    """What agents do in a turn, one after the other: parts of edges, and times on nodes.

    Attributes:
        at, agents: the game in the turn, and the number in the roster.
        edge: rows of edges; -1: they are on a node.
        node: rows of nodes; what is there for those on edges means nothing.
        begin, end: shares of the edges.
        since, until: of the turn.
        back: rows of the edges by which one turned round on these; -1: by none.
    """

    at: IntArray
    agents: IntArray
    edge: IntArray
    node: IntArray
    begin: FloatArray
    end: FloatArray
    since: FloatArray
    until: FloatArray
    back: IntArray

    def street(self, columns: GraphColumns) -> IntArray:
        """Return of each edge and the one back the row of that with the lower id, which is that of their street."""
        ids = columns.edge_ids
        return np.where((self.back >= 0) & (ids[self.back] < ids[self.edge]), self.back, self.edge)


def _on_edges(turn: ArrayTurn, legs: Legs, *, passing: bool) -> _Pieces:
    """Return the parts of edges that living agents cover; not `passing`: where on edges they are at the end."""
    counts = (legs.edge >= 0) & (turn.alive & turn.is_there_by_move)[..., None]
    if not passing:  # those that are on an edge at the end: its share is that at the end of the last leg
        is_last = np.arange(legs.edge.shape[-1]) == (legs.edge >= 0).sum(axis=-1)[..., None] - 1
        counts &= is_last & (legs.end > 0.0) & (legs.end < 1.0)
    which = np.nonzero(counts)
    at, agents = which[:2]
    edge, back = legs.edge[which], legs.back[which]
    begin, end, since, until = (column[which] for column in (legs.begin, legs.end, legs.since, legs.until))
    if not passing:
        begin, since, until = end, np.ones(len(at)), np.ones(len(at))
    return _Pieces(at, agents, edge, turn.node[at, agents], begin, end, since, until, back)


def in_air_of(turn: ArrayTurn, sides: Sides) -> tuple[IntArray, FloatArray] | None:
    """Return which agents fly, and where they are, (games, these, 3); None: none is of a side."""
    if not turn.roster.flies[np.concatenate(sides)].any():
        return None
    return turn.in_air()


def _pieces(turn: ArrayTurn, legs: Legs, *, passing: bool) -> _Pieces:
    visits, on_edges = turn.visits(turn.alive, passing=passing), _on_edges(turn, legs, passing=passing)
    none, nothing = np.zeros(len(visits.at)), np.full(len(visits.at), -1)
    on_nodes = _Pieces(*visits[:2], nothing, visits.nodes, none, none, visits.begin, visits.end, nothing)
    states = movement_in(turn).all_roads.states(on_edges.edge, turn.games[on_edges.at])
    return joined_rows([on_nodes, some_rows(on_edges, np.flatnonzero(states != REMOVED))])


def node_at(turn: ArrayTurn, paths: Paths, where: tuple[IntArray, IntArray], time: FloatArray) -> IntArray:
    """Return the nodes that agents, by game and number, have passed last at some times."""
    passed = (paths.times[where] <= time[:, None] + TIME_SLACK).sum(axis=-1) - 1
    found: IntArray = np.where(
        turn.is_there_by_move[where], paths.nodes[*where, np.maximum(passed, 0)], turn.node[where]
    )
    return found


# -- at one place -------------------------------------------------------------------------------------------------


def on_streets(turn: ArrayTurn, paths: Paths, legs: Legs, sides: Sides, *, passing: bool) -> Met:
    """Return the pairs that are at one place of a street at one time, as `meetings.on_edges` does."""
    pieces, columns = _on_edges(turn, legs, passing=passing), movement_in(turn).columns
    at, agents, begin, end = pieces.at, pieces.agents, pieces.begin, pieces.end
    ours, theirs = of_sides(turn, agents, sides)
    street = pieces.street(columns)
    is_ahead, keys = street == pieces.edge, at * len(columns.edge_ids) + street
    i, j = equal_keys(keys[ours], keys[theirs])
    i, j = ours[i], theirs[j]
    first, last = np.maximum(pieces.since[i], pieces.since[j]), np.minimum(pieces.until[i], pieces.until[j])

    def place(rows: IntArray, time: FloatArray) -> FloatArray:
        with np.errstate(divide="ignore", invalid="ignore"):
            way = (end - begin)[rows] * (time - pieces.since[rows]) / (pieces.until - pieces.since)[rows]
        share = np.where(pieces.until[rows] <= pieces.since[rows], end[rows], begin[rows] + way)
        return np.where(is_ahead[rows], share, 1.0 - share)

    gap, later = (place(i, time) - place(j, time) for time in (first, last))
    is_at_once, is_at_end = np.abs(gap) <= TIME_SLACK, np.abs(later) <= TIME_SLACK
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = first + (last - first) * gap / (gap - later)
    time = np.where(is_at_once, first, np.where(gap * later < 0.0, crossing, last))
    meets = np.where(is_at_once, (first > 0.0) | is_at_end, (gap * later < 0.0) | is_at_end) & (first <= last)
    i, j, time = i[meets], j[meets], time[meets]
    games, a, b = at[i], agents[i], agents[j]
    nodes = [node_at(turn, paths, (games, one), time) for one in (a, b)]
    return games, a, b, time, time * 0.0, time >= 0.0, nodes[0], nodes[1]


def of_sides(turn: ArrayTurn, agents: IntArray, sides: Sides) -> list[IntArray]:
    """Return which rows of a column of agents are of each side."""
    is_of = np.zeros((2, len(turn.roster.names)), np.bool_)
    for which, side in zip(is_of, sides, strict=True):
        which[side] = True
    return [np.flatnonzero(which[agents]) for which in is_of]


def equal_keys(keys: IntArray, others: IntArray) -> tuple[IntArray, IntArray]:
    """Return the rows of all pairs of equal keys of two columns."""
    order = np.argsort(others, kind="stable")
    rows, places = kernels.expand_ranges(*(np.searchsorted(others[order], keys, side) for side in ("left", "right")))
    return rows, order[places]


# -- within some distance -------------------------------------------------------------------------------------------


class NearNodes:
    """The nodes that can be reached from others within a distance, found when they are first asked for.

    Args:
        streets: the graph.
        limit: the distance.
        by_length: whether lengths of edges count, rather than their number.
    """

    def __init__(self, streets: Streets, limit: float, *, by_length: bool) -> None:
        columns, self._limit = streets.columns, limit
        weights = columns.lengths if by_length else np.ones(len(columns.lengths))
        self._nodes = len(columns.node_ids)
        self._arcs = kernels.make_arcs(columns.sources, columns.targets, weights, self._nodes)
        self._forget()

    def _forget(self) -> None:
        self._offset = np.full(self._nodes, -1, np.int64)
        self._count = np.zeros(self._nodes, np.int64)
        self._ends, self._far, self._used = np.zeros(0, np.int64), np.zeros(0), 0
        self._open_gate(1 << 12)

    def _open_gate(self, pairs: int) -> None:
        """Make a table that says, by the sum of the hashes of two nodes, whether they may be near; of so many pairs."""
        size = 1 << (8 * pairs).bit_length()
        hashes = kernels.draw_bits_rows(0, np.arange(self._nodes, dtype=np.uint64), 0)
        self._hash: IntArray = (hashes % np.uint64(size)).astype(np.int64)
        self._gate, self._room = np.zeros(2 * size, np.bool_), pairs
        self._admit(np.flatnonzero(self._offset >= 0))

    def _admit(self, rows: IntArray) -> None:
        pairs, entries = kernels.expand_ranges(self._offset[rows], self._offset[rows] + self._count[rows])
        self._gate[self._hash[rows][pairs] + self._hash[self._ends[entries]]] = True

    def _learn(self, rows: IntArray) -> None:
        """Look around these nodes, as far as that was not done before."""
        new = np.unique(rows[self._offset[rows] < 0])
        if not len(new):
            return
        if self._used > _MOST_KNOWN:
            self._forget()
            new = np.unique(rows)
        index, ends, far = self._around(new)
        self._count[new] = np.bincount(index, minlength=len(new))
        self._offset[new] = self._used + np.cumsum(self._count[new]) - self._count[new]
        after = self._used + len(ends)
        if after > len(self._ends):
            self._ends = np.concatenate((self._ends[: self._used], np.empty(2 * after - self._used, np.int64)))
            self._far = np.concatenate((self._far[: self._used], np.empty(2 * after - self._used)))
        self._ends[self._used : after], self._far[self._used : after], self._used = ends, far, after
        if after > self._room:
            self._open_gate(2 * after)
        else:
            self._admit(new)

    def _around(self, rows: IntArray) -> tuple[IntArray, IntArray, FloatArray]:
        """Return what can be reached: the places in `rows`, ascending, rows of nodes, and the distances.

        The weights of a path are added from its start, so that the sums are those of `kernels.shortest_distances`.
        """
        nodes, arcs = self._nodes, self._arcs
        keys, far = np.arange(len(rows)) * nodes + rows, np.zeros(len(rows))
        order = np.argsort(keys)
        keys, far = keys[order], far[order]
        new, new_far = keys, far
        while len(new):
            entries, runs = kernels.chosen_runs(arcs.offsets, new % nodes)
            lines = np.repeat(np.arange(len(new)), np.diff(runs))
            sums = new_far[lines] + arcs.weights[entries]
            reached = (new // nodes)[lines] * nodes + arcs.ends[entries]
            is_near = sums <= self._limit
            reached, sums = reached[is_near], sums[is_near]
            order = np.lexsort((sums, reached))
            new, first = np.unique(reached[order], return_index=True)
            new_far = sums[order][first]
            at = kernels.rows_of(keys, new)
            is_known = at >= 0
            is_better = ~is_known | (new_far < far[at])
            far[at[is_known & is_better]] = new_far[is_known & is_better]
            added = ~is_known
            keys, far = np.concatenate((keys, new[added])), np.concatenate((far, new_far[added]))
            order = np.argsort(keys, kind="stable")
            keys, far = keys[order], far[order]
            new, new_far = new[is_better], new_far[is_better]
        return keys // nodes, keys % nodes, far

    def may_be_near(self, starts: IntArray, ends: IntArray) -> BoolArray:
        """Return which pairs of nodes may be near each other; the others are not. The shapes are broadcast."""
        self._learn(np.concatenate((starts.ravel(), ends.ravel())))
        found: BoolArray = self._gate[self._hash[starts] + self._hash[ends]]
        return found

    def distances(self, starts: IntArray, ends: IntArray) -> FloatArray:
        """Return how far it is there or back, whichever is shorter; infinite where that is too far."""
        return np.minimum(self.ahead(starts, ends), self.ahead(ends, starts))

    def ahead(self, starts: IntArray, ends: IntArray) -> FloatArray:
        """Return how far it is from nodes to others, (pairs,); infinite where that is too far."""
        self._learn(starts)
        if not len(starts):
            return np.zeros(0)
        first = self._offset[starts]
        end = last = first + self._count[starts] - 1  # a node is near itself, so that there is one
        while (first < last).any():  # the nodes around each ascend
            middle = (first + last) // 2
            is_behind = self._ends[middle] < ends
            first, last = np.where(is_behind, np.minimum(middle + 1, end), first), np.where(is_behind, last, middle)
        return np.where(self._ends[first] == ends, self._far[first], np.inf)


def near_on_travels(
    turn: ArrayTurn, paths: Paths, sides: Sides, limit: float, near: NearNodes | None, *, passing: bool
) -> Iterator[Met]:
    """Yield the pairs that are so near, each when it first is: by paths, or in a straight line where `near` is None."""
    assert paths.legs is not None  # noqa: S101 - games by metres have them
    pieces = _pieces(turn, paths.legs, passing=passing)
    ways: _Straight | _ByPaths
    ways = (
        _Straight(turn, pieces, limit, in_air_of(turn, sides)) if near is None else _ByPaths(turn, pieces, limit, near)
    )
    size = len(turn.roster.names)
    for at, a, b in ways.may_be_near(paths, *sides):
        of_pair = at * size + a, at * size + b
        taken = np.zeros(turn.node.size, np.bool_)
        for keys in of_pair:
            taken[keys] = True
        rows = np.flatnonzero(taken[ways.keys])
        rows = rows[np.argsort(ways.keys[rows], kind="stable")]
        found = np.searchsorted(ways.keys[rows], of_pair, "left"), np.searchsorted(ways.keys[rows], of_pair, "right")
        (first_a, first_b), (last_a, last_b) = found
        pair, i = kernels.expand_ranges(first_a, last_a)
        part, j = kernels.expand_ranges(first_b[pair], last_b[pair])
        pair, i, j = pair[part], rows[i[part]], rows[j]
        since, until = np.maximum(ways.since[i], ways.since[j]), np.minimum(ways.until[i], ways.until[j])
        together = np.flatnonzero(since <= until)
        met, times, far = ways.first(i[together], j[together], since[together], until[together])
        which = pair[together[met]]
        order = np.lexsort((far, times, which))
        order = order[np.diff(which[order], prepend=-1) > 0]
        which, times, far = which[order], times[order], far[order]
        games, one, other = at[which], a[which], b[which]
        nodes = [node_at(turn, paths, (games, agents), times) for agents in (one, other)]
        yield games, one, other, times, far, far < 0.0, nodes[0], nodes[1]


class _Straight:
    """The straight parts of ways of agents, by lines on the map; those of agents that fly are where these are.

    Attributes:
        keys: (parts,) numbers of agents, game by game.
        since, until: (parts,) of the turn.
    """

    def __init__(
        self, turn: ArrayTurn, pieces: _Pieces, limit: float, in_air: tuple[IntArray, FloatArray] | None
    ) -> None:
        self._limit, self._shape, size = limit, turn.node.shape, len(turn.roster.names)
        on, off = np.flatnonzero(pieces.edge >= 0), np.flatnonzero(pieces.edge < 0)
        nodes, legs = some_rows(pieces, off), some_rows(pieces, on)
        which, share, x, y = movement_in(turn).lines.corners(legs.edge, legs.begin, legs.end)
        is_last, is_first = np.diff(which, append=-1) != 0, np.diff(which, prepend=-1) != 0
        with np.errstate(divide="ignore", invalid="ignore"):
            pace = np.where(legs.end != legs.begin, (legs.until - legs.since) / (legs.end - legs.begin), 0.0)
        time = legs.since[which] + (share - legs.begin[which]) * pace[which]
        time[is_first], time[is_last] = legs.since, legs.until
        first, last = np.flatnonzero(~is_last), np.flatnonzero(~is_first)
        here, begin, end = [axis[nodes.node] for axis in turn.streets.axes], [x[first], y[first]], [x[last], y[last]]
        if in_air is not None:
            agents, xyz = in_air
            some = np.flatnonzero(np.isin(nodes.agents, agents))
            places = xyz[nodes.at[some], np.searchsorted(agents, nodes.agents[some])]
            here.append(np.zeros(len(off)))
            for axis, values in zip(here, places.T, strict=True):
                axis[some] = values
            begin, end = ([*axes, np.zeros(len(first))] for axes in (begin, end))
        self.keys = np.concatenate((nodes.at, legs.at[which[first]])) * size
        self.keys += np.concatenate((nodes.agents, legs.agents[which[first]]))
        self.since, self.until = np.append(nodes.since, time[first]), np.append(nodes.until, time[last])
        self._begin, self._end = (
            [np.append(*parts) for parts in zip(here, axes, strict=True)] for axes in (begin, end)
        )

    def may_be_near(self, _: Paths, ours: IntArray, theirs: IntArray) -> Iterator[Pairs]:
        """Yield pairs of agents, among which are all that are near each other: by boxes around their ways on maps."""
        low, high = np.full((2, *self._shape), np.inf), np.full((2, *self._shape), -np.inf)
        for axis, ends in enumerate(zip(self._begin[:2], self._end[:2], strict=True)):
            np.minimum.at(low[axis].reshape(-1), self.keys, np.minimum(*ends))
            np.maximum.at(high[axis].reshape(-1), self.keys, np.maximum(*ends))
        is_there = low[0] < np.inf
        farthest = max(float(np.abs(ends[:, is_there]).max(initial=0.0)) for ends in (low, high))
        reach = with_rim(self._limit, farthest)
        if len(theirs) > _MANY and reach < _FAR:
            (at, i), (there, j) = (np.nonzero(is_there[:, side]) for side in (ours, theirs))
            a, b = ours[i], theirs[j]
            spread = float(np.hypot(*(high - low)[:, is_there]).max(initial=0.0))
            middle = [(low[:, game, one] + high[:, game, one]) / 2 for game, one in ((at, a), (there, b))]
            (x, y), (x1, y1) = middle
            areas = kernels.Area(x, y, at), kernels.Area(x1, y1, there)
            found = kernels.near_each_other(*areas, reach + spread) if len(at) and len(there) else ()
            for rows, others in found:
                yield from _in_parts((at[rows], a[rows], b[others]))
            return
        size = max(1, _AT_ONCE // max(1, len(ours) * len(theirs)))
        for first in range(0, self._shape[0], size):
            games = slice(first, first + size)
            gaps = [
                np.maximum(
                    low[axis, games][:, ours, None] - high[axis, games][:, None, theirs],
                    low[axis, games][:, None, theirs] - high[axis, games][:, ours, None],
                ).clip(0.0)
                for axis in (0, 1)
            ]
            is_near = gaps[0] * gaps[0] + gaps[1] * gaps[1] <= reach * reach
            is_near &= is_there[games][:, ours, None] & is_there[games][:, None, theirs]
            at, i, j = np.unravel_index(np.flatnonzero(is_near), is_near.shape)
            yield from _in_parts((first + at, ours[i], theirs[j]))

    def first(self, i: IntArray, j: IntArray, since: FloatArray, until: FloatArray) -> _First:
        """Return which pairs of parts are so near between two times, when they first are, and how near."""
        limit = self._limit * self._limit
        gap = [a - b for a, b in zip(self._at(i, since), self._at(j, since), strict=True)]
        far = dot(gap, gap)
        at_once = np.flatnonzero(far <= limit)
        left = np.flatnonzero(far > limit)
        i, j, begin, last, gap = i[left], j[left], since[left], until[left], [axis[left] for axis in gap]
        then = [a - b for a, b in zip(self._at(i, last), self._at(j, last), strict=True)]
        change = [later - now for later, now in zip(then, gap, strict=True)]
        square, mixed = dot(change, change), dot(gap, change)
        inside = mixed * mixed - square * (far[left] - limit)
        with np.errstate(divide="ignore", invalid="ignore"):
            share = (-mixed - np.sqrt(inside)) / square
        comes = np.flatnonzero((square != 0.0) & (inside >= 0.0) & (share >= 0.0) & (share <= 1.0))
        times = (begin + share * (last - begin))[comes]
        rows = np.concatenate((at_once, left[comes]))
        distances = np.append(np.sqrt(far[at_once]), np.full(len(comes), self._limit))
        return rows, np.append(since[at_once], times), distances

    def _at(self, rows: IntArray, time: FloatArray) -> list[FloatArray]:
        since, until = self.since[rows], self.until[rows]
        with np.errstate(divide="ignore", invalid="ignore"):
            share = (time - since) / (until - since)
        axes = zip(self._begin, self._end, strict=True)
        return [
            np.where(until <= since, begin[rows], begin[rows] + share * (end[rows] - begin[rows]))
            for begin, end in axes
        ]


def dot(a: Sequence[FloatArray], b: Sequence[FloatArray]) -> FloatArray:
    """Return dot products of vectors by their axes, added up from x on."""
    found = a[0] * b[0]
    for one, other in zip(a[1:], b[1:], strict=True):
        found = found + one * other
    return found


class _ByPaths:
    """The same of pieces on which the distances to the ends of their edges change evenly, by paths."""

    def __init__(self, turn: ArrayTurn, pieces: _Pieces, limit: float, near: NearNodes) -> None:
        self._turn, self._limit, self._near = turn, limit, near
        self.keys = pieces.at * len(turn.roster.names) + pieces.agents
        self.since, self.until = pieces.since, pieces.until
        columns, edge, on_edge, street = movement_in(turn).columns, pieces.edge, pieces.edge >= 0, pieces.street
        self._length = np.where(on_edge, columns.lengths[edge], 0.0)
        self._street = np.where(on_edge, street(columns), -1)
        shares = pieces.begin, pieces.end
        self._places = [np.where(self._street == edge, share, 1.0 - share) for share in shares]
        source, target = columns.sources[edge], columns.targets[edge]
        may_turn = on_edge & (pieces.back >= 0) & (source != target)
        # By which node one leaves, and by which one comes, at the source and at the target of an edge; -1: by none.
        self._exits = np.where(may_turn, source, -1), np.where(on_edge, target, pieces.node)
        self._entries = np.where(on_edge, source, pieces.node), np.where(may_turn, target, -1)
        self._metres = [share * self._length for share in shares], [(1.0 - share) * self._length for share in shares]

    def may_be_near(self, paths: Paths, ours: IntArray, theirs: IntArray) -> Iterator[Pairs]:
        """Yield pairs of agents, among which are all that are near each other: by the nodes on their ways."""
        turn, legs = self._turn, paths.legs
        assert legs is not None  # noqa: S101 - see above
        ends = np.where(legs.edge >= 0, movement_in(turn).columns.targets[legs.edge], turn.node[..., None])
        nodes = np.concatenate((turn.node[..., None], paths.nodes, ends), axis=-1)
        size = max(1, _AT_ONCE // max(1, len(ours) * len(theirs) * nodes.shape[-1] ** 2))
        for first in range(0, len(nodes), size):
            part, alive = nodes[first : first + size], turn.alive[first : first + size]
            is_near = self._near.may_be_near(part[:, ours, None, :, None], part[:, None, theirs, None, :])
            are_near = is_near.any(axis=(-2, -1)) & alive[:, ours, None] & alive[:, None, theirs]
            at, i, j = np.unravel_index(np.flatnonzero(are_near), are_near.shape)
            yield from _in_parts((first + at, ours[i], theirs[j]))

    def first(self, i: IntArray, j: IntArray, since: FloatArray, until: FloatArray) -> _First:
        """Return which pairs of pieces are so near between two times, when they first are, and how near."""
        found, limit = list[_First](), self._limit
        for a, b in ((i, j), (j, i)):
            for rows, last, begin, end in (self._on_street(a, b, since, until), *self._by_nodes(a, b, since, until)):
                at_once = begin <= limit
                with np.errstate(divide="ignore", invalid="ignore"):
                    comes = since[rows] + (last - since[rows]) * (begin - limit) / (begin - end)
                met = np.flatnonzero(at_once | (end <= limit))
                times, far = np.where(at_once, since[rows], comes), np.where(at_once, begin, limit)
                found.append((rows[met], times[met], far[met]))
        rows, times, far = (np.concatenate(columns) for columns in zip(*found, strict=True))
        return rows, times, far

    def _on_street(self, a: IntArray, b: IntArray, since: FloatArray, until: FloatArray) -> _Change:
        """Return the changes between pairs on one street, along it."""
        rows = np.flatnonzero((self._street[a] == self._street[b]) & (self._street[a] >= 0))
        a, b, since, until = a[rows], b[rows], since[rows], until[rows]
        first, last = (
            (self._even(a, self._places, time) - self._even(b, self._places, time)) * self._length[a]
            for time in (since, until)
        )
        passes = first * last < 0.0
        with np.errstate(divide="ignore", invalid="ignore"):
            passing = since + (until - since) * first / (first - last)
        return rows, np.where(passes, passing, until), np.abs(first), np.where(passes, 0.0, np.abs(last))

    def _by_nodes(self, a: IntArray, b: IntArray, since: FloatArray, until: FloatArray) -> Iterator[_Change]:
        """Yield the changes between pairs from one of which a path leads to the other."""
        for out, to_exit in zip(self._exits, self._metres, strict=True):
            for into, from_entry in zip(self._entries, self._metres, strict=True):
                rows = np.flatnonzero((out[a] >= 0) & (into[b] >= 0))
                rows = rows[self._near.may_be_near(out[a[rows]], into[b[rows]])]
                between = self._near.ahead(out[a[rows]], into[b[rows]])
                rows, between = rows[between < np.inf], between[between < np.inf]
                begin, final = (
                    between + self._even(a[rows], to_exit, time) + self._even(b[rows], from_entry, time)
                    for time in (since[rows], until[rows])
                )
                yield rows, until[rows], begin, final

    def _even(self, rows: IntArray, values: Sequence[FloatArray], time: FloatArray) -> FloatArray:
        """Return values that change evenly, of some pieces, at times."""
        (begin, end), since, until = (column[rows] for column in values), self.since[rows], self.until[rows]
        with np.errstate(divide="ignore", invalid="ignore"):
            change = (end - begin) * (time - since) / (until - since)
        return np.where(until <= since, end, begin + change)


def _in_parts(pairs: Pairs) -> Iterator[Pairs]:
    """Yield some pairs at a time."""
    for first in range(0, len(pairs[0]), _PAIRS_AT_ONCE):
        at, a, b = (column[first : first + _PAIRS_AT_ONCE] for column in pairs)
        yield at, a, b
