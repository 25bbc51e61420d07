"""Beliefs of one game: predict targets by a Markov chain, update by observations, and find the nodes they can reach.

A belief about a target is one probability for each state of a chain. `values` holds the beliefs about several targets,
one after the other; `at` is the index where the first belief begins. A state is on a node, or on an edge; a state on an
edge belongs to the node that the target passed last. Sums are taken in a fixed order, so that results are the same bit
for bit on every machine.
"""

from __future__ import annotations

ON_NODES = 0  # a look that covers nodes only
ON_STRAIGHT_EDGES = 1  # and the straight edges between these nodes
ON_ALL_EDGES = 2  # and all edges between them
UNSEEN = -1  # a target that no look has found
UNKNOWN = -2  # a target that was found on a node that no longer exists, so that nothing is known about it
ANY_PLACE = -2  # a target that was found on its node or on an edge behind it
# names for callers in Python, which do not see constants with a C type
LOOKS_AT_NODES = ON_NODES
LOOKS_ALONG_STRAIGHT_EDGES = ON_STRAIGHT_EDGES
LOOKS_ALONG_EDGES = ON_ALL_EDGES
IS_UNSEEN = UNSEEN
IS_UNKNOWN = UNKNOWN
IS_ANYWHERE_ON_NODE = ANY_PLACE


class IncomingArcs:
    """The weighted arcs into each row of a table, for example transitions between the states of a chain.

    Args:
        first: (rows + 1,) 32-bit integers: the arcs into row `i` are `first[i]` to `first[i + 1] - 1`.
        sources: (arcs,) 32-bit integers: the row where each arc begins.
        weights: (arcs,) the probability or the cost of each arc.
    """

    def __init__(self, first: memoryview[int], sources: memoryview[int], weights: memoryview[float]) -> None:
        self.rows = len(first) - 1
        self.first = first
        self.sources = sources
        self.weights = weights


class MarkovChain:
    """The states of a Markov chain on a map.

    Args:
        shares: (states,) the initial probability of each state, given its node.
        first_on: (nodes + 1,) 32-bit integers: the states of node `i` are `first_on[i]` to `first_on[i + 1] - 1` in
            `states_on`.
        states_on: (states,) 32-bit integers: states by node, ascending for each node.
        ends: (states,) the node at the end of the edge of each state; -1: the state is on a node.
        are_bent: (states,) bytes: whether the edge of the state is not straight.
        offsets: (states,) metres from the node of the state.
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


class ChainBuffers:
    """Working memory for a chain.

    Args:
        likelihoods: (states,) of the target that is being updated.
        sums: (states,) partial sums.
        missed: (nodes,) all 1.0; each call leaves it so.
    """

    def __init__(
        self,
        likelihoods: memoryview[float],
        sums: memoryview[float],
        missed: memoryview[float],
    ) -> None:
        self.likelihoods = likelihoods
        self.sums = sums
        self.missed = missed


class Evidence:
    """Observations of targets: the nodes where looks have missed them, and the places where they were found.

    Args:
        targets: the number of targets.
        first: (looks + 1,) the nodes of look `i` are entries `first[i]` to `first[i + 1] - 1` of `rows` and `missed`.
        rows: (entries,) the nodes that looks cover.
        missed: (entries,) the probability that a look misses a target on the node.
        kinds: (looks,) bytes: `ON_NODES`, `ON_STRAIGHT_EDGES` or `ON_ALL_EDGES`.
        shown: (looks * targets,) bytes: whether a look can show the target.
        found: (findings * targets,) the node of each target; `UNSEEN` or `UNKNOWN`.
        found_ends: (findings * targets,) the node at the end of the edge of the target; -1: it is on the node;
            `ANY_PLACE`: it may be in any state of the node.
        found_m: (findings * targets,) metres from the node; not read for `ANY_PLACE`.
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
    ways: IncomingArcs,
    sums: memoryview[float],
    values: memoryview[float],
    at: int,
    out: memoryview[float],
    to: int,
    targets: int,
    steps: int,
) -> int:
    """Predict the beliefs about targets after a number of steps of the chain.

    Contributions to a row are added in the order of its arcs.

    Args:
        ways: the transitions of one step.
        sums: (rows,) working memory.
        values: the beliefs.
        at: the index where they begin.
        out: the predicted beliefs; may be `values`.
        to: the index where they begin.
        targets: the number of targets.
        steps: the number of steps.
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
    c: MarkovChain,
    e: Evidence,
    w: ChainBuffers,
    values: memoryview[float],
    at: int,
    out: memoryview[float],
    to: int,
    begin: int,
    end: int,
    finding: int,
    totals: memoryview[float],
) -> int:
    """Update the beliefs about all targets by looks and one finding, by Bayes' rule.

    Args:
        c: the chain by which the targets move.
        e: the observations.
        w: working memory.
        values: the beliefs before.
        at: the index where they begin.
        out: the beliefs after; may be `values`.
        to: the index where they begin.
        begin: the first look.
        end: one past the last look.
        finding: the number of the finding.
        totals: (targets,) is set to the probability of the observation under the belief before; see `weigh`.
    """
    for target in range(e.targets):
        is_changed = fill_likelihoods(c, e, w, target, begin, end, finding)
        totals[target] = weigh(c, w, is_changed, values, at + target * c.states, out, to + target * c.states)
    return 0


def fill_likelihoods(
    c: MarkovChain, e: Evidence, w: ChainBuffers, target: int, begin: int, end: int, finding: int
) -> bool:
    """Write the likelihood of looks and a finding for each state of a target; return whether one is not 1.0."""
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


def take_look(c: MarkovChain, e: Evidence, w: ChainBuffers, look: int) -> bool:
    """Multiply the likelihoods by the probability that a look misses the target; return whether one of them is not 1.0.

    On a covered edge, the greater probability of its two ends counts. A look does not change other edges.
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


def mark_found(c: MarkovChain, e: Evidence, w: ChainBuffers, found: int) -> int:
    """Set the likelihoods of the states where a target was found to 1.0; on an edge, of the nearest states."""
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
    c: MarkovChain,
    w: ChainBuffers,
    is_changed: bool,
    values: memoryview[float],
    at: int,
    out: memoryview[float],
    to: int,
) -> float:
    """Update the belief about one target by the likelihoods in the working memory.

    Args:
        c: the chain by which the target moves.
        w: working memory with the likelihoods.
        is_changed: whether a likelihood is not 1.0.
        values: the belief before.
        at: the index where it begins.
        out: the belief after; may be `values`.
        to: the index where it begins.

    Returns:
        The probability of the observation under the belief before. If it is 0.0, the belief was wrong, and starts again
        from this observation alone.
    """
    for s in range(c.states):
        out[to + s] = values[at + s] * w.likelihoods[s]
    if not is_changed:
        return 1.0
    total = sum_values(c, w, out, to)
    found = total
    if total == 0.0:
        total = begin_again(c, w, out, to)
    for s in range(c.states):
        out[to + s] /= total
    return found


def begin_again(c: MarkovChain, w: ChainBuffers, out: memoryview[float], to: int) -> float:
    """Write weights of the states from the likelihoods alone; return their sum.

    The initial shares of states on edges are 0.0. If all possible states have a share of 0.0, they get equal weights.
    If no state is possible, the weights are the initial shares.
    """
    for s in range(c.states):
        out[to + s] = c.shares[s] * w.likelihoods[s]
    total = sum_values(c, w, out, to)
    if total == 0.0:
        for s in range(c.states):
            out[to + s] = w.likelihoods[s]
        total = sum_values(c, w, out, to)
    if total == 0.0:
        for s in range(c.states):
            out[to + s] = c.shares[s]
        total = sum_values(c, w, out, to)
    return total


def sum_values(c: MarkovChain, w: ChainBuffers, values: memoryview[float], at: int) -> float:
    """Return the sum over all states by pairwise summation: add the second half to the first until one is left."""
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


def add_to_nodes(c: MarkovChain, values: memoryview[float], at: int, out: memoryview[float], to: int) -> int:
    """Add the probability that a target is on each node to `out`."""
    for node in range(c.nodes):
        total = 0.0
        for j in range(c.first_on[node], c.first_on[node + 1]):
            total += values[at + c.states_on[j]]
        out[to + node] += total
    return 0


def find_likeliest(chances: memoryview[float], turns: memoryview[float], at: int, nodes: int) -> int:
    """Return the node with the greatest chance per turn of travel, the first if several are equal; -1: all are 0.0.

    Args:
        chances: the probability, or the expected number, of targets on each node.
        turns: the turns that the agent takes to reach each node.
        at: the index where the nodes begin in both columns.
        nodes: the number of nodes.
    """
    best = -1
    most = 0.0
    for node in range(nodes):
        gain = chances[at + node] / (1.0 + turns[at + node])
        if gain > most:
            most = gain
            best = node
    return best


def spread(ways: IncomingArcs, labels: memoryview[float], at: int) -> int:
    """Spread a budget over a map: set each label to the greatest budget that is left on a path to the node.

    Only budgets above 0.0 spread (label correcting, as in the Bellman-Ford algorithm).

    Args:
        ways: the cost of each arc from node to node.
        labels: the budget left on each node; -inf: not reached.
        at: the index where they begin.
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
