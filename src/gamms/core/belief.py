"""Beliefs of one game: where targets are by a Markov chain and by what was observed, and which nodes they can reach.

A belief about a target is a probability for each state of a chain, one after the other; `values` holds those of several
targets, and `at` says where the first of them begins. A state is on a node, or on an edge behind the node that it has
passed last, which counts as its node. Sums are taken in one order, so that the bits depend on nothing else.
"""

from __future__ import annotations

ON_NODES = 0  # a look that covers nodes only
ON_STRAIGHT_EDGES = 1  # and the straight edges between these nodes
ON_ALL_EDGES = 2  # and all edges between them
UNSEEN = -1  # a target that no look has found
UNKNOWN = -2  # one of which nothing is known: it was found on a node that is gone
ANY_PLACE = -2  # a target that was found on its node or on an edge behind it
# names for callers in Python, which do not see constants with a C type
LOOKS_AT_NODES = ON_NODES
LOOKS_ALONG_STRAIGHT_EDGES = ON_STRAIGHT_EDGES
LOOKS_ALONG_EDGES = ON_ALL_EDGES
IS_UNSEEN = UNSEEN
IS_UNKNOWN = UNKNOWN
IS_ANYWHERE_ON_NODE = ANY_PLACE


class Ways:
    """What leads to each of some rows, such as the states of a chain, or the nodes of a map.

    Args:
        first: (rows + 1,) 32-bit integers: where the ways that lead to each row begin, and at last where they end.
        sources: (ways,) 32-bit integers: the row that each way begins at.
        weights: (ways,) how probable each is, or what it costs.
    """

    def __init__(self, first: memoryview[int], sources: memoryview[int], weights: memoryview[float]) -> None:
        self.rows = len(first) - 1
        self.first = first
        self.sources = sources
        self.weights = weights


class Chain:
    """The states of a Markov chain on a map.

    Args:
        shares: (states,) how probable each state is at first among those on its node.
        first_on: (nodes + 1,) 32-bit integers: where the states on each node begin, and at last where they end.
        states_on: (states,) 32-bit integers: these states, ascending for each node.
        ends: (states,) the node at the end of its edge; -1: it is on a node.
        are_bent: (states,) bytes: whether its edge is not straight.
        offsets: (states,) metres from its node.
    """

    def __init__(
        self,
        shares: memoryview[float],
        first_on: memoryview[int],
        states_on: memoryview[int],
        ends: memoryview[int],
        are_bent: memoryview[int],
        offsets: memoryview[float],
    ) -> None:
        self.states = len(shares)
        self.nodes = len(first_on) - 1
        self.shares = shares
        self.first_on = first_on
        self.states_on = states_on
        self.ends = ends
        self.are_bent = are_bent
        self.offsets = offsets


class Work:
    """Working memory for a chain.

    Args:
        likelihoods: (states,) of the target that is looked at.
        sums: (states,)
        weighed: (states,)
        missed: (nodes,) all 1.0, as it is again after each call.
    """

    def __init__(
        self,
        likelihoods: memoryview[float],
        sums: memoryview[float],
        weighed: memoryview[float],
        missed: memoryview[float],
    ) -> None:
        self.likelihoods = likelihoods
        self.sums = sums
        self.weighed = weighed
        self.missed = missed


class Evidence:
    """What was observed of some targets: where looks have missed them, and where they were found.

    Args:
        targets: how many there are.
        first: (looks + 1,) where the nodes of each look begin, and at last where they end.
        rows: of these nodes.
        missed: likewise, how probable it is that a target there is missed.
        kinds: (looks,) bytes: `ON_NODES`, `ON_STRAIGHT_EDGES` or `ON_ALL_EDGES`.
        shown: (looks * targets,) bytes: whether a look says something about a target.
        found: (findings * targets,) the node of each target; `UNSEEN` or `UNKNOWN`.
        found_ends: likewise, the node at the end of its edge; -1: on the node; `ANY_PLACE`: any state on the node.
        found_m: likewise, how many metres it is from the node; not read where it may be in any place.
    """

    def __init__(
        self,
        targets: int,
        first: memoryview[int],
        rows: memoryview[int],
        missed: memoryview[float],
        kinds: memoryview[int],
        shown: memoryview[int],
        found: memoryview[int],
        found_ends: memoryview[int],
        found_m: memoryview[float],
    ) -> None:
        self.targets = targets
        self.first = first
        self.rows = rows
        self.missed = missed
        self.kinds = kinds
        self.shown = shown
        self.found = found
        self.found_ends = found_ends
        self.found_m = found_m


def predict(
    ways: Ways,
    sums: memoryview[float],
    values: memoryview[float],
    at: int,
    out: memoryview[float],
    to: int,
    targets: int,
    steps: int,
) -> int:
    """Write where targets are after some steps.

    What comes to a row is added in the order of its ways.

    Args:
        ways: where a step leads.
        sums: (rows,) working memory.
        values: how probable each row is for each target.
        at: where it begins.
        out: the same after the steps; may be `values`.
        to: where it begins.
        targets: how many there are.
        steps: how many.
    """
    for target in range(targets):
        here = at + target * ways.rows
        there = to + target * ways.rows
        for i in range(ways.rows):
            out[there + i] = values[here + i]
        for _ in range(steps):
            for i in range(ways.rows):
                total = 0.0
                for k in range(ways.first[i], ways.first[i + 1]):
                    total += out[there + ways.sources[k]] * ways.weights[k]
                sums[i] = total
            for i in range(ways.rows):
                out[there + i] = sums[i]
    return 0


def observe(
    c: Chain,
    e: Evidence,
    w: Work,
    values: memoryview[float],
    at: int,
    out: memoryview[float],
    to: int,
    begin: int,
    end: int,
    finding: int,
    totals: memoryview[float],
) -> int:
    """Write where all targets are by some looks and one finding: Bayes' rule.

    Args:
        c: by which the targets move.
        e: what was observed.
        w: working memory.
        values: what was believed.
        at: where it begins.
        out: what is believed now; may be `values`.
        to: where it begins.
        begin: the first of the looks.
        end: the first that does not count any more.
        finding: the number of the finding.
        totals: (targets,) how probable this was by what was believed; see `weigh`.
    """
    for target in range(e.targets):
        is_changed = fill_likelihoods(c, e, w, target, begin, end, finding)
        totals[target] = weigh(c, w, is_changed, values, at + target * c.states, out, to + target * c.states)
    return 0


def fill_likelihoods(c: Chain, e: Evidence, w: Work, target: int, begin: int, end: int, finding: int) -> bool:
    """Write how probable some looks and a finding are for each state of a target; return whether one is not 1.0."""
    found = finding * e.targets + target
    if e.found[found] >= 0:
        for s in range(c.states):
            w.likelihoods[s] = 0.0
        mark_found(c, e, w, found)
        return True
    for s in range(c.states):
        w.likelihoods[s] = 1.0
    is_changed = False
    if e.found[found] == UNSEEN:
        for look in range(begin, end):
            if e.shown[look * e.targets + target]:
                is_changed |= take_look(c, e, w, look)
    return is_changed


def take_look(c: Chain, e: Evidence, w: Work, look: int) -> bool:
    """Multiply the likelihoods by how probable it is that a look misses a target; return whether that is not 1.0.

    On an edge that is covered this is the greater one of both ends; on another edge nothing is ruled out.
    """
    kind = e.kinds[look]
    if kind != ON_NODES:
        for k in range(e.first[look], e.first[look + 1]):
            w.missed[e.rows[k]] = e.missed[k]
    is_changed = False
    for k in range(e.first[look], e.first[look + 1]):
        for j in range(c.first_on[e.rows[k]], c.first_on[e.rows[k] + 1]):
            s = c.states_on[j]
            missed = e.missed[k]
            if c.ends[s] >= 0:
                if kind == ON_NODES or (kind == ON_STRAIGHT_EDGES and c.are_bent[s]):
                    missed = 1.0
                else:
                    missed = max(missed, w.missed[c.ends[s]])
            is_changed |= missed != 1.0
            w.likelihoods[s] *= missed
    if kind != ON_NODES:
        for k in range(e.first[look], e.first[look + 1]):
            w.missed[e.rows[k]] = 1.0
    return is_changed


def mark_found(c: Chain, e: Evidence, w: Work, found: int) -> int:
    """Set the likelihoods of the states that a target was found in to 1.0: of those on an edge, the nearest ones."""
    end = e.found_ends[found]
    node = e.found[found]
    nearest = -1.0
    for j in range(c.first_on[node], c.first_on[node + 1]):
        s = c.states_on[j]
        if end != ANY_PLACE and (c.ends[s] < 0 or c.ends[s] == end):
            far = abs(c.offsets[s] - e.found_m[found])
            if nearest < 0.0 or far < nearest:
                nearest = far
    for j in range(c.first_on[node], c.first_on[node + 1]):
        s = c.states_on[j]
        if end == ANY_PLACE or (
            (c.ends[s] < 0 or c.ends[s] == end) and abs(c.offsets[s] - e.found_m[found]) == nearest
        ):
            w.likelihoods[s] = 1.0
    return 0


def weigh(
    c: Chain, w: Work, is_changed: bool, values: memoryview[float], at: int, out: memoryview[float], to: int
) -> float:
    """Write where one target is by the likelihoods in the working memory; `out` may be `values`.

    Args:
        c: by which the target moves.
        w: where the likelihoods are.
        is_changed: whether one of them is not 1.0.
        values: what was believed.
        at: where it begins.
        out: what is believed now.
        to: where it begins.

    Returns:
        How probable the observation was by what was believed. Where it was 0.0, the belief was wrong, and begins again
        from this observation alone.
    """
    for s in range(c.states):
        out[to + s] = values[at + s] * w.likelihoods[s]
    if not is_changed:
        return 1.0
    total = sum_of(c, w, out, to)
    found = total
    if total == 0.0:
        total = begin_again(c, w, out, to)
    for s in range(c.states):
        out[to + s] /= total
    return found


def begin_again(c: Chain, w: Work, out: memoryview[float], to: int) -> float:
    """Write weights of the states by the likelihoods alone; return their sum.

    At first no target is on an edge, so that all shares of the states that are possible may be 0.0; then these states
    are equal, and if none is possible, all states have their shares.
    """
    for s in range(c.states):
        out[to + s] = c.shares[s] * w.likelihoods[s]
    total = sum_of(c, w, out, to)
    if total == 0.0:
        for s in range(c.states):
            out[to + s] = w.likelihoods[s]
        total = sum_of(c, w, out, to)
    if total == 0.0:
        for s in range(c.states):
            out[to + s] = c.shares[s]
        total = sum_of(c, w, out, to)
    return total


def sum_of(c: Chain, w: Work, values: memoryview[float], at: int) -> float:
    """Return the sum over all states: the second half is added to the first, until one number is left."""
    number = c.states
    if number == 1:
        return values[at]
    half = number // 2
    for i in range(half):
        w.sums[i] = values[at + i] + values[at + half + i]
    if number % 2:
        w.sums[0] += values[at + number - 1]
    number = half
    while number > 1:
        half = number // 2
        for i in range(half):
            w.sums[i] += w.sums[half + i]
        if number % 2:
            w.sums[0] += w.sums[number - 1]
        number = half
    return w.sums[0]


def add_to_nodes(c: Chain, values: memoryview[float], at: int, out: memoryview[float], to: int) -> int:
    """Add to each node how probable it is that a target is there."""
    for node in range(c.nodes):
        total = 0.0
        for j in range(c.first_on[node], c.first_on[node + 1]):
            total += values[at + c.states_on[j]]
        out[to + node] += total
    return 0


def expect(
    c: Chain,
    e: Evidence,
    w: Work,
    values: memoryview[float],
    at: int,
    begin: int,
    end: int,
    finding: int,
    targets: memoryview[int],
    counts: memoryview[int],
    first: int,
    out: memoryview[float],
    to: int,
) -> int:
    """Add to each node how many of some targets are to be expected there, by some looks and one finding; see `observe`.

    Args:
        c: by which the targets move.
        e: what was observed.
        w: working memory.
        values: what was believed.
        at: where it begins.
        begin: the first of the looks.
        end: the first that does not count any more.
        finding: the number of the finding.
        targets: the numbers of the targets.
        counts: bytes, whether each target counts.
        first: where these begin.
        out: of the nodes.
        to: where they begin.
    """
    for i in range(len(targets)):
        target = targets[i]
        if counts[first + target]:
            is_changed = fill_likelihoods(c, e, w, target, begin, end, finding)
            weigh(c, w, is_changed, values, at + target * c.states, w.weighed, 0)
            add_to_nodes(c, w.weighed, 0, out, to)
    return 0


def likeliest(chances: memoryview[float], turns: memoryview[float], at: int, nodes: int) -> int:
    """Return the node with the highest chance for each turn until an agent is there, the first of equals; -1: all 0.0.

    Args:
        chances: of nodes, or how many targets are expected there.
        turns: that the agent takes to these.
        at: where the nodes begin in both.
        nodes: how many there are.
    """
    best = -1
    most = 0.0
    for node in range(nodes):
        gain = chances[at + node] / (1.0 + turns[at + node])
        if gain > most:
            most = gain
            best = node
    return best


def spread(ways: Ways, labels: memoryview[float], at: int) -> int:
    """Raise the labels of nodes to the most that is left on a way that leads there, if that is more than 0.0.

    Args:
        ways: what it costs to go from node to node.
        labels: of the nodes, how much is left there; -inf: none has come.
        at: where they begin.
    """
    is_changed = True
    while is_changed:
        is_changed = False
        for i in range(ways.rows):
            most = labels[at + i]
            for k in range(ways.first[i], ways.first[i + 1]):
                offer = labels[at + ways.sources[k]] - ways.weights[k]
                if offer > most and offer > 0.0:
                    most = offer
                    is_changed = True
            labels[at + i] = most
    return 0
