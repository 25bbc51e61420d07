"""Conflicts of moves in one game: find the agents that stay because a node is full or an exchange is not allowed.

A place is a number from 0: the row of a node, or an edge numbered after all nodes. If teams do not block each other,
each team has its own places, numbered after those of the teams before. Agents are rows in the order of names.

Exchanges are decided first, all at once. Then rounds follow: all contests of a round are found before one is decided;
the losers stay on their start place, which may be too full in the next round. `resolve` decides contests by ranks. A
caller with another criterion calls the same functions, and sets `stays` of the losers in between. The winner among
equal agents and the order of contests never depend on the order in which agents were created.
"""

from __future__ import annotations

from gamms.core import draws

NEVER = 1 << 62  # the rank of an agent that wins no contest
UNRANKED = NEVER + 1  # an agent without a rank: in a contest, it stays as `NEEDS_RANK`
GOES = 0
STAYS = 1
NEEDS_RANK = 2
# names for callers in Python, which do not see constants with a C type
RANK_OF_NONE = NEVER
RANK_MISSING = UNRANKED
WINS = GOES
LOSES = STAYS
LOSES_UNRANKED = NEEDS_RANK
FORWARD = 1  # from the smaller of two places to the larger
BOTH_WAYS = 3


class Contests:
    """The contests of a game, and working memory to find them, which is reset after each game.

    Args:
        agents: the number of agents.
        nodes: the number of nodes among the places of a team.
        places: the number of places of a team.
        least: the smallest capacity of a place.
        allow_swaps: whether agents may exchange nodes.
        is_drawn: whether `MoveRequests.ranks` are keys, from which ranks are drawn for each turn.
        tables: (2 * all places,) 32-bit integers: the first half -1, the second half 0.
        rows: (7 * agents,) 32-bit integers, all 0.
        members: (agents,) 32-bit integers: the agents of all contests, contest by contest.
        free: (agents,) 32-bit integers: the number of winners of each contest; 0: all members lose.
        first: (agents + 1,) 32-bit integers: where the members of each contest begin, and where the last ones end.
        value: (agents,) unsigned 64-bit integers.
        stays: (agents,) bytes: `GOES`, `STAYS` or `NEEDS_RANK`.

    Attributes, none of which Python sees:
        head: by place, the first agent that wants to enter; -1: none.
        taken: by place, the number of agents that stay or want to enter.
        start, end: by agent, the places where its move begins and ends; -1: the agent takes no room.
        after: by agent, the next agent that wants to enter the same place; -1: none.
        number: by agent, the number of its pair of nodes; for the first agent that wants to enter a queued place, the
            index of the place in `queue`.
        queue, losers: places to check, and agents or pairs.
        place: by contest, its place.
        value: by agent, its rank in a contest.
    """

    def __init__(
        self,
        agents: int,
        nodes: int,
        places: int,
        least: int,
        allow_swaps: bool,
        is_drawn: bool,
        tables: memoryview[int],
        rows: memoryview[int],
        members: memoryview[int],
        free: memoryview[int],
        first: memoryview[int],
        value: memoryview[int],
        stays: memoryview[int],
    ) -> None:
        self.agents = agents
        self.nodes = nodes
        self.places = places
        self.least = least
        self.allow_swaps = allow_swaps
        self.is_drawn = is_drawn
        half = len(tables) // 2
        self.head = tables[:half]
        self.taken = tables[half:]
        self.start = rows[:agents]
        self.end = rows[agents : 2 * agents]
        self.after = rows[2 * agents : 3 * agents]
        self.number = rows[3 * agents : 4 * agents]
        self.queue = rows[4 * agents : 5 * agents]
        self.losers = rows[5 * agents : 6 * agents]
        self.place = rows[6 * agents :]
        self.members = members
        self.free = free
        self.first = first
        self.value = value
        self.stays = stays


class MoveRequests:
    """The moves that the agents of games want to make; rows are game by game.

    Attributes:
        starts: (rows,) the place, within the team's places, where each move begins.
        ends: (rows,) the place where it ends.
        counts: (rows,) 1: the agent takes room; 0: it does not.
        offsets: (agents,) the first place of the agent's team; -1: it flies, and takes no room.
        limits: (places,) capacities.
        ranks: unsigned 64-bit integers: (agents,) ranks; if ranks are drawn, (rows,) the `first_key`s of the agents.
    """

    def __init__(
        self,
        starts: memoryview[int],
        ends: memoryview[int],
        counts: memoryview[int],
        offsets: memoryview[int],
        limits: memoryview[int],
        ranks: memoryview[int],
    ) -> None:
        self.starts = starts
        self.ends = ends
        self.counts = counts
        self.offsets = offsets
        self.limits = limits
        self.ranks = ranks


def begin(c: Contests, requests: MoveRequests, at: int) -> int:
    """Read the moves of the game that begins at row `at`."""
    for i in range(c.agents):
        c.stays[i] = GOES
        c.start[i] = -1
        c.end[i] = -1
        if requests.counts[at + i] and requests.offsets[i] >= 0:
            c.start[i] = requests.starts[at + i] + requests.offsets[i]
            c.end[i] = requests.ends[at + i] + requests.offsets[i]
    return 0


def find_exchanges(c: Contests) -> int:
    """Find the contests between agents that want to exchange nodes; return the number of contests."""
    for i in range(c.agents - 1, -1, -1):  # lists of moves by the smaller of their nodes, in the order of agents
        if is_between_nodes(c, i):
            low = min(c.start[i], c.end[i])
            c.after[i] = c.head[low]
            c.head[low] = i
    groups = number_pairs(c)
    for i in range(c.agents):
        if is_between_nodes(c, i):
            c.head[min(c.start[i], c.end[i])] = -1
            c.taken[max(c.start[i], c.end[i])] = 0
    found = 0
    for g in range(groups):
        c.losers[g] = -1
        if c.free[g] == BOTH_WAYS:
            c.losers[g] = found
            found += 1
    if found > 0:
        list_members(c, found)
    return found


def is_between_nodes(c: Contests, i: int) -> bool:
    """Return whether an agent moves from one node to another."""
    start = c.start[i]
    end = c.end[i]
    if start < 0 or start == end:
        return False
    return c.nodes == c.places or (start % c.places < c.nodes and end % c.places < c.nodes)


def number_pairs(c: Contests) -> int:
    """Number the pairs of nodes between which agents move; return the number of pairs.

    `number` is set to the pair of each agent. By pair, `place` is set to the smaller node, and `free` to the directions
    of the moves. By node, `taken` is set to the last pair, counted from 1, with this node as the larger one.
    """
    groups = 0
    for i in range(c.agents):
        if not is_between_nodes(c, i):
            continue
        low = min(c.start[i], c.end[i])
        if c.head[low] != i:
            continue
        j = i
        while j >= 0:
            high = max(c.start[j], c.end[j])
            g = c.taken[high] - 1
            if g < 0 or c.place[g] != low:
                g = groups
                groups += 1
                c.taken[high] = groups
                c.place[g] = low
                c.free[g] = 0
            c.free[g] |= FORWARD if c.start[j] == low else BOTH_WAYS - FORWARD
            c.number[j] = g
            j = c.after[j]
    return groups


def list_members(c: Contests, found: int) -> int:
    """List the members of all exchange contests in the order of agents; `losers` holds the contest of each pair."""
    for k in range(found + 1):
        c.first[k] = 0
    for i in range(c.agents):
        if is_between_nodes(c, i) and c.losers[c.number[i]] >= 0:
            c.first[c.losers[c.number[i]] + 1] += 1
    for k in range(found):
        c.queue[k] = c.first[k]
        c.first[k + 1] += c.first[k]
        c.free[k] = 1
    for i in range(c.agents):
        if is_between_nodes(c, i) and c.losers[c.number[i]] >= 0:
            k = c.losers[c.number[i]]
            c.members[c.queue[k]] = i
            c.queue[k] += 1
    return 0


def end_exchanges(c: Contests, found: int) -> int:
    """Allow the moves of all agents that go in the same direction as the winner of their exchange."""
    for k in range(found):
        way = -1
        for m in range(c.first[k], c.first[k + 1]):
            if c.stays[c.members[m]] == GOES:
                way = c.start[c.members[m]]
        for m in range(c.first[k], c.first[k + 1]):
            i = c.members[m]
            if c.stays[i] != NEEDS_RANK:
                c.stays[i] = GOES if c.start[i] == way else STAYS
    return 0


def find_contests(c: Contests, requests: MoveRequests) -> int:
    """Find the places that more agents want to enter than they have room for; return the number of contests."""
    queued = 0
    for i in range(c.agents - 1, -1, -1):
        p = c.end[i]
        if p < 0:
            continue
        if c.stays[i] != GOES:
            p = c.start[i]
        elif c.start[i] != p:
            c.after[i] = c.head[p]
            c.head[p] = i
        c.taken[p] += 1
        if c.taken[p] == c.least + 1:
            c.queue[queued] = p
            queued += 1
    return list_contests(c, requests, queued)


def find_more_contests(c: Contests, requests: MoveRequests, found: int) -> int:
    """Move the losers of `found` contests back to their start places; return the number of new contests there."""
    lost = 0
    for k in range(found):
        p = c.place[k]
        c.head[p] = -1
        for m in range(c.first[k + 1] - 1, c.first[k] - 1, -1):
            i = c.members[m]
            if c.stays[i] == GOES:
                c.after[i] = c.head[p]
                c.head[p] = i
            else:
                c.losers[lost] = i
                lost += 1
                c.taken[p] -= 1
                c.taken[c.start[i]] += 1
    queued = 0
    for k in range(lost):
        p = c.start[c.losers[k]]
        i = c.head[p]
        if i >= 0 and c.taken[p] > c.least:
            known = c.number[i]
            if known >= queued or c.queue[known] != p:
                c.number[i] = queued
                c.queue[queued] = p
                queued += 1
    return list_contests(c, requests, queued)


def list_contests(c: Contests, requests: MoveRequests, queued: int) -> int:
    """List the contests among queued places, with members in the order of agents; return the number of contests."""
    found = 0
    members = 0
    c.first[0] = 0
    for k in range(queued):
        p = c.queue[k]
        coming = 0
        i = c.head[p]
        while i >= 0:
            c.members[members + coming] = i
            coming += 1
            i = c.after[i]
        node = p if p < c.places else p % c.places  # a division costs as much as the rest
        free = requests.limits[node] - (c.taken[p] - coming)
        if coming > 0 and free < coming:
            members += coming
            c.place[found] = p
            c.free[found] = max(free, 0)
            found += 1
            c.first[found] = members
    return found


def clear(c: Contests) -> int:
    """Reset the working memory."""
    for i in range(c.agents):
        if c.end[i] >= 0:
            c.head[c.end[i]] = -1
            c.taken[c.end[i]] = 0
            if c.stays[i] != GOES:
                c.taken[c.start[i]] = 0
    return 0


def decide(c: Contests, requests: MoveRequests, found: int, at: int, turn: int) -> int:
    """Decide contests: members with the smallest ranks win, ties go to the first agents, and all others stay.

    Args:
        c: the contests.
        requests: holds the ranks.
        found: the number of contests.
        at: the index of the first agent in the ranks.
        turn: the number of the turn, for draws.
    """
    for k in range(found):
        begin = c.first[k]
        able = begin
        for m in range(begin, c.first[k + 1]):
            i = c.members[m]
            if c.free[k] == 0:
                c.stays[i] = STAYS
                continue
            if c.is_drawn:
                c.value[i] = draws.compute_bits(draws.compute_turn_key(requests.ranks[at + i], turn), 0)
            else:
                c.value[i] = requests.ranks[at + i]
            if c.is_drawn or requests.ranks[at + i] < NEVER:
                c.members[m] = c.members[able]
                c.members[able] = i
                able += 1
            else:
                c.stays[i] = NEEDS_RANK if requests.ranks[at + i] == UNRANKED else STAYS
        if able - begin > c.free[k]:
            put_best_first(c, begin, able, c.free[k])
            for m in range(begin + c.free[k], able):
                c.stays[c.members[m]] = STAYS
    return 0


def is_ahead(c: Contests, i: int, j: int) -> bool:
    """Return whether an agent wins against another one."""
    return c.value[i] < c.value[j] or (c.value[i] == c.value[j] and i < j)


def put_best_first(c: Contests, begin: int, end: int, number: int) -> int:
    """Move the best `number` members to the front, as a heap with the worst of them at `begin`."""
    for k in range(number // 2 - 1, -1, -1):
        sift(c, begin, number, k)
    if number > 0:
        for m in range(begin + number, end):
            i = c.members[m]
            if is_ahead(c, i, c.members[begin]):
                c.members[m] = c.members[begin]
                c.members[begin] = i
                sift(c, begin, number, 0)
    return 0


def sift(c: Contests, begin: int, number: int, k: int) -> int:
    """Move member `k` of a heap of members down until no child is worse."""
    while 2 * k + 1 < number:
        child = 2 * k + 1
        if child + 1 < number and is_ahead(c, c.members[begin + child], c.members[begin + child + 1]):
            child += 1
        i = c.members[begin + k]
        if not is_ahead(c, i, c.members[begin + child]):
            return 0
        c.members[begin + k] = c.members[begin + child]
        c.members[begin + child] = i
        k = child
    return 0


def resolve(c: Contests, requests: MoveRequests, game: int, turn: int) -> int:
    """Resolve the conflicts of a game: write `c.stays`, and return the number of agents that stay.

    Args:
        c: the contests.
        requests: the moves of all games.
        game: the number of the game.
        turn: the number of turns played, for draws.
    """
    at = game * c.agents
    at_ranks = at if c.is_drawn else 0
    begin(c, requests, at)
    if not c.allow_swaps:
        found = find_exchanges(c)
        decide(c, requests, found, at_ranks, turn)
        end_exchanges(c, found)
    if c.least < c.agents:
        found = find_contests(c, requests)
        while found > 0:
            decide(c, requests, found, at_ranks, turn)
            found = find_more_contests(c, requests, found)
        clear(c)
    stopped = 0
    for i in range(c.agents):
        if c.stays[i] != GOES:
            stopped += 1
    return stopped


def find_losers(c: Contests, out: memoryview[int]) -> int:
    """Write the agents that stay because they have lost a contest to `out`, ascending; return their number."""
    found = 0
    for i in range(c.agents):
        if c.stays[i] != GOES:
            out[found] = i
            found += 1
    return found
