"""Beliefs of one game in the core: facts, and laws against a plain form over dictionaries and fractions."""

from fractions import Fraction
from math import inf, isclose

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gamms import kernels
from gamms.core import belief

CHANCES = st.sampled_from([0.0, 0.25, 0.5, 1.0])
TARGETS = 2


class Filter:
    """A chain, each of its states on a node or on an edge, and what is believed of two targets.

    Args:
        nodes: how many there are.
        ways: (source, target, chance) of states.
        states: (node, end, is bent, metres) of each; end -1: on the node. None: each node is a state.
    """

    def __init__(self, nodes, ways=(), states=None):
        self.states = [(node, -1, False, 0.0) for node in range(nodes)] if states is None else states
        self.nodes = nodes
        number = len(self.states)
        rows, ends, are_bent, metres = (np.array(column) for column in zip(*self.states, strict=True))
        first_on, states_on = kernels.group_rows(rows, nodes)
        sources, targets, chances = (np.array([way[k] for way in ways], kind) for k, kind in enumerate("qqd"))
        self.ways = belief.IncomingArcs(*kernels.ways_to(sources, targets, chances, number))
        columns = np.ones(number), first_on.astype(np.int32), states_on.astype(np.int32), ends
        self.chain = belief.MarkovChain(
            *map(kernels.buffer, (*columns, are_bent.view(np.uint8), metres.astype(np.float64)))
        )
        self.missed, self.sums = np.ones(nodes), np.empty(number)
        memory = np.empty(number), self.sums, np.empty(number), self.missed
        self.work = belief.ChainBuffers(*map(kernels.buffer, memory))
        self.values = np.full((TARGETS, number), 1.0 / number)

    def predict(self, steps=1):
        """Let targets move."""
        buffer = kernels.buffer(self.values)
        belief.predict(self.ways, kernels.buffer(self.sums), buffer, 0, buffer, 0, TARGETS, steps)

    def evidence(self, looks=(), found=(-1, -1), places=((-2, 0.0), (-2, 0.0))):
        """Return evidence of looks (kind, {node: missed}, shown), and one finding."""
        first = np.cumsum([0, *(len(missed) for _, missed, _ in looks)])
        rows = np.array([row for _, missed, _ in looks for row in missed], np.int64)
        chances = np.array([chance for _, missed, _ in looks for chance in missed.values()], np.float64)
        kinds = np.array([kind for kind, _, _ in looks], np.uint8)
        shown = np.array([shown for _, _, shown in looks], np.uint8)
        ends, metres = (np.array(column) for column in zip(*places, strict=True))
        columns = first, rows, chances, kinds, shown, np.array(found), ends, metres
        return belief.Evidence(TARGETS, *map(kernels.buffer, columns))

    def observe(self, looks=(), **finding):
        """Take in evidence; return how probable it was."""
        totals, buffer = np.empty(TARGETS), kernels.buffer(self.values)
        evidence = self.evidence(looks, **finding)
        belief.observe(self.chain, evidence, self.work, buffer, 0, buffer, 0, 0, len(looks), 0, kernels.buffer(totals))
        assert (self.missed == 1.0).all()
        return totals.tolist()


def street(nodes):
    """The ways of a walker on a line of nodes that goes to either side, or stays, each as likely."""
    near = [[other for other in (node - 1, node, node + 1) if 0 <= other < nodes] for node in range(nodes)]
    return [(node, other, 1.0 / len(others)) for node, others in enumerate(near) for other in others]


def test_a_target_that_was_found_is_there_and_walks_on():
    filter = Filter(4, street(4))
    assert filter.observe(found=(1, -1)) == [0.25, 1.0]
    assert filter.values.tolist() == [[0.0, 1.0, 0.0, 0.0], [0.25] * 4]
    filter.predict()
    assert filter.values[0].tolist() == [1 / 3, 1 / 3, 1 / 3, 0.0]


def test_looks_in_vain_count_for_the_targets_that_they_show():
    filter = Filter(4)
    assert filter.observe([(belief.LOOKS_AT_NODES, {0: 0.0, 2: 0.5}, (1, 0))]) == [0.625, 1.0]
    assert filter.values.tolist() == [[0.0, 0.4, 0.2, 0.4], [0.25] * 4]


def test_a_belief_that_was_wrong_begins_again():
    filter = Filter(3)
    filter.observe(found=(0, 0))
    assert filter.observe([(belief.LOOKS_AT_NODES, {0: 0.0}, (1, 0))], found=(-1, 2)) == [0.0, 0.0]
    assert filter.values.tolist() == [[0.0, 0.5, 0.5], [0.0, 0.0, 1.0]]
    nowhere = [(belief.LOOKS_AT_NODES, {0: 0.0, 1: 0.0, 2: 0.0}, (1, 1))]
    assert filter.observe(nowhere) == [0.0, 0.0]
    assert filter.values.tolist() == [[1 / 3] * 3] * 2


def test_a_finding_on_a_node_that_is_gone_says_nothing_and_hides_what_looks_say():
    filter = Filter(2)
    look = [(belief.LOOKS_AT_NODES, {0: 0.0}, (1, 1))]
    assert filter.observe(look, found=(belief.IS_UNKNOWN, belief.IS_UNSEEN)) == [1.0, 0.5]
    assert filter.values.tolist() == [[0.5, 0.5], [0.0, 1.0]]


@pytest.mark.parametrize(
    ("kind", "expected"),
    [
        (belief.LOOKS_AT_NODES, [0, 0, 1 / 3, 1 / 3, 1 / 3]),
        (belief.LOOKS_ALONG_STRAIGHT_EDGES, [0, 0, 0, 1, 0]),
        (belief.LOOKS_ALONG_EDGES, [1 / 5] * 5),
    ],
)
def test_a_look_rules_out_the_edges_that_it_covers(kind, expected):
    straight, bent, loose = (0, 1, False, 3.0), (0, 1, True, 3.0), (1, 0, False, 3.0)
    filter = Filter(2, states=[(0, -1, False, 0.0), (1, -1, False, 0.0), straight, bent, loose])
    filter.observe([(kind, {0: 0.0, 1: 0.0}, (1, 1))])
    assert filter.values[0].tolist() == pytest.approx(expected)
    filter = Filter(2, states=[(0, -1, False, 0.0), straight])
    filter.observe([(kind, {0: 0.0}, (1, 1))])  # the other end is not in view
    assert filter.values[0].tolist() == [0.0, 1.0]


def test_one_that_was_found_on_an_edge_is_in_the_nearest_part():
    states = [
        (0, -1, False, 0.0),
        (0, 1, False, 4.0),
        (0, 1, False, 8.0),
        (0, 2, False, 4.0),
        *[(n, -1, False, 0.0) for n in (1, 2)],
    ]
    filter = Filter(3, states=states)
    filter.observe(found=(0, 0), places=((1, 5.9), (-1, 0.0)))
    assert filter.values.tolist() == [[0, 1, 0, 0, 0, 0], [1, 0, 0, 0, 0, 0]]
    filter.observe(found=(0, -1))  # in any place there
    assert filter.values[0].tolist() == [0, 1, 0, 0, 0, 0]


def test_of_equally_likely_nodes_the_first_is_gone_to():
    def likeliest(chances, turns):
        buffers = map(kernels.buffer, (np.array(chances), np.array(turns)))
        return belief.likeliest(*buffers, 1, len(chances) - 1)

    assert likeliest([9.0, 0.2, 0.4, 0.2], [0.0, 0.0, 1.0, 0.0]) == 0
    assert likeliest([9.0, 0.1, 0.4, 0.4], [0.0, 0.0, 1.0, 0.5]) == 2
    assert likeliest([9.0, 0.0, 0.4], [0.0, 0.0, inf]) == -1


def sum_of_halves(numbers):
    """The sum in the order of the core."""
    if len(numbers) == 1:
        return numbers[0]
    half = len(numbers) // 2
    added = [one + other for one, other in zip(numbers, numbers[half:], strict=False)][:half]
    if len(numbers) % 2:
        added[0] += numbers[-1]
    return sum_of_halves(added)


@given(st.lists(st.floats(0.0, 1e300, allow_subnormal=True), min_size=1, max_size=9))
def test_sums_are_taken_by_halves(values):
    filter = Filter(len(values))
    filter.values[:] = values
    half = dict.fromkeys(range(len(values)), 0.5)
    total = sum_of_halves([one * 0.5 for one in values])
    assert filter.observe([(belief.LOOKS_AT_NODES, half, (1, 0))])[0] == total
    if total:
        assert filter.values[0].tolist() == [one * 0.5 / total for one in values]


@st.composite
def walks(draw):
    """The number of nodes, ways whose chances add up to 1 from each, and some turns with looks and findings."""
    nodes = draw(st.integers(1, 5))
    node = st.integers(0, nodes - 1)
    ends = [draw(st.lists(node, min_size=1, max_size=4)) for _ in range(nodes)]
    look = st.tuples(st.just(0), st.dictionaries(node, CHANCES, max_size=nodes), st.just((1, 0)))
    turn = st.tuples(st.lists(look, max_size=3), st.integers(-1, nodes - 1), st.integers(0, 2))
    return nodes, ends, draw(st.lists(turn, min_size=1, max_size=5))


@given(walks())
def test_bayes_rule_over_fractions_gives_the_same(case):
    nodes, ends, turns = case
    filter = Filter(nodes, [(one, end, 1.0 / len(its)) for one, its in enumerate(ends) for end in its])
    masses = {node: Fraction(1, nodes) for node in range(nodes)}
    for looks, found, steps in turns:
        likelihood = dict.fromkeys(range(nodes), Fraction(1))
        for _, missed, _ in looks:
            for node, chance in missed.items():
                likelihood[node] *= Fraction(chance)
        if found >= 0:
            likelihood = {node: Fraction(node == found) for node in range(nodes)}
        weighed = {node: mass * likelihood[node] for node, mass in masses.items()}
        total = sum(weighed.values())
        assert isclose(filter.observe(looks, found=(found, -1))[0], total, rel_tol=1e-9, abs_tol=1e-12)
        if not total:
            weighed = likelihood if any(likelihood.values()) else dict.fromkeys(range(nodes), Fraction(1))
        masses = {node: mass / sum(weighed.values()) for node, mass in weighed.items()}
        for _ in range(steps):
            moved = dict.fromkeys(range(nodes), Fraction(0))
            for node, mass in masses.items():
                for end in ends[node]:
                    moved[end] += mass / len(ends[node])
            masses = moved
        filter.predict(steps)
        assert filter.values[0].tolist() == pytest.approx([float(masses[node]) for node in range(nodes)], abs=1e-12)
        assert filter.values[1].sum() == pytest.approx(1.0)


@given(
    ways=st.lists(st.tuples(st.integers(0, 4), st.integers(0, 4), st.sampled_from([0.0, 1.0, 2.5])), max_size=12),
    labels=st.lists(st.sampled_from([-inf, -1.0, 0.0, 2.0, 4.0]), min_size=5, max_size=5),
)
def test_labels_spread_as_far_as_something_is_left(ways, labels):
    sources, targets, costs = (np.array([way[k] for way in ways], kind) for k, kind in enumerate("qqd"))
    found = np.array(labels)
    belief.spread(belief.IncomingArcs(*kernels.ways_to(sources, targets, costs, 5)), kernels.buffer(found), 0)
    expected = list(labels)
    for _ in range(5):  # no way that is worth it has more edges
        for source, target, cost in ways:
            left = expected[source] - cost
            expected[target] = max(expected[target], left) if left > 0.0 else expected[target]
    assert found.tolist() == expected
