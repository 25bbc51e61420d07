"""Pursuit in turns: which positions end in a capture or an escape under exact play, and after how many moves.

Two sides move one after the other, each on a graph of its own: the pursuers together, by formations, and the evader, by
nodes. A position is a side to move, a formation and a node; its number is `(side * formations + formation) * nodes +
node`. Outcomes are found backward from the ends (retrograde analysis; Berarducci and Intrigila 1993 for cops and
robbers), so that each position and each move is looked at once.
"""

from __future__ import annotations

PURSUERS = 0  # the sides
EVADER = 1
CAUGHT = 1  # the code of a position in which the evader is caught
ESCAPED = -1  # and of one in which it has escaped
# names for callers in Python, which do not see constants with a C type
SIDES = (PURSUERS, EVADER)
ENDS = (CAUGHT, ESCAPED)


class Moves:
    """The moves of one side, grouped by the place where they end.

    Attributes:
        offsets: (places + 1,) where the moves to each place begin in `before`.
        before: (moves,) the places where moves begin.
        counts: (places,) the number of moves from each place.
    """

    def __init__(self, offsets: memoryview[int], before: memoryview[int], counts: memoryview[int]) -> None:
        self.offsets = offsets
        self.before = before
        self.counts = counts


class Positions:
    """The positions of a pursuit, and how they end.

    Attributes:
        pursuers: the moves between formations.
        evader: the moves between nodes.
        codes: (2 * formations * nodes,) how each position ends: n + 1 is a capture after n moves, -n - 1 an escape
            after n moves, 0 neither.
        queue: (2 * formations * nodes,) working memory.
        left: (formations * nodes,) working memory.
    """

    def __init__(
        self, pursuers: Moves, evader: Moves, codes: memoryview[int], queue: memoryview[int], left: memoryview[int]
    ) -> None:
        self.pursuers = pursuers
        self.evader = evader
        self.codes = codes
        self.queue = queue
        self.left = left


def find_forced(positions: Positions, end: int) -> int:
    """Find all positions from which the side that wants an end can force it; return their number.

    The other side delays it as long as possible. Positions that have a code already keep it.

    Args:
        positions: the positions; those of this end itself have its code.
        end: `CAUGHT`, which the pursuers want, or `ESCAPED`, which the evader wants.
    """
    nodes = len(positions.evader.counts)
    size = len(positions.left)
    count_moves(positions, end)
    count = 0
    for position in range(2 * size):
        if positions.codes[position] == end:
            positions.queue[count] = position
            count += 1
    first = 0
    while first < count:
        position = positions.queue[first]
        first += 1
        code = positions.codes[position] + end
        if position >= size:  # the pursuers have moved before
            formation = (position - size) // nodes
            node = position - size - formation * nodes
            for arc in range(positions.pursuers.offsets[formation], positions.pursuers.offsets[formation + 1]):
                before = positions.pursuers.before[arc] * nodes + node
                if is_forced(positions, before, before, end == CAUGHT):
                    positions.codes[before] = code
                    positions.queue[count] = before
                    count += 1
        else:
            formation = position // nodes
            node = position - formation * nodes
            for arc in range(positions.evader.offsets[node], positions.evader.offsets[node + 1]):
                before = formation * nodes + positions.evader.before[arc]
                if is_forced(positions, size + before, before, end == ESCAPED):
                    positions.codes[size + before] = code
                    positions.queue[count] = size + before
                    count += 1
    return count


def count_moves(positions: Positions, end: int) -> int:
    """Write the number of moves of the side that does not want an end into `left`, for each formation and node."""
    nodes = len(positions.evader.counts)
    for formation in range(len(positions.pursuers.counts)):
        for node in range(nodes):
            if end == CAUGHT:
                positions.left[formation * nodes + node] = positions.evader.counts[node]
            else:
                positions.left[formation * nodes + node] = positions.pursuers.counts[formation]
    return 0


def is_forced(positions: Positions, position: int, place: int, is_free: bool) -> bool:
    """Return whether a position is new, and its side to move wants the end or has no other move left."""
    if positions.codes[position] != 0:
        return False
    if is_free:
        return True
    positions.left[place] -= 1
    return positions.left[place] == 0
