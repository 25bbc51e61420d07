"""The filter gives exactly what Bayes' rule gives over all paths that a target can have taken."""

from collections import defaultdict
from itertools import pairwise
from math import ceil, dist

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import gamms
from gamms import belief
from gamms.errors import BadType, BadValue, UnknownName
from gamms.sensor import SensorType

PROBABILITIES = st.sampled_from([0.0, 0.2, 0.5, 0.9, 1.0])


def context(nodes, edges):
    ctx = gamms.create_context(seed=1, logger_config={"level": "CRITICAL"})
    ctx.graph.add_nodes([3 * i for i in range(nodes)], [10.0 * i for i in range(nodes)], [0.0] * nodes)
    for id, (source, target) in enumerate(edges):
        ctx.graph.graph.add_edge({"id": id, "source": 3 * source, "target": 3 * target, "length": 1.0 + id})
    return ctx


def walk_by_hand(ctx, stay):
    """Transitions of a random walk: node -> [(node, probability)], of the definition."""
    graph, found = ctx.graph.graph, {}
    for node in graph.get_nodes():
        others = [other for other in graph.get_neighbors(node) if other != node]
        here = 1 / (1 + len(others)) if stay is None else (stay if others else 1.0)
        found[node] = [(node, here), *((other, (1 - here) / len(others)) for other in others)]
    return found


def goal_by_hand(ctx, goal, wander):
    """Transitions of a target that goes to one goal."""
    graph, walk = ctx.graph.graph, walk_by_hand(ctx, None)
    for node in walk:
        if node == goal:
            walk[node] = [(goal, 1.0)]
        elif graph.distance(node, goal) < float("inf"):
            step = graph.shortest_path(node, goal)[1]
            walk[node] = [(step, 1 - wander), *((other, wander * chance) for other, chance in walk[node])]
    return walk


def by_enumeration(hypotheses, nodes, evidence):
    """Posterior of the last node, and the probability of all evidence, over every path by every hypothesis.

    hypotheses: [(prior, transitions)]; evidence: for each turn, node -> how probable what was observed is there.
    """
    masses = defaultdict(float)

    def extend(node, mass, turn, transitions):
        mass *= evidence[turn][node]
        if mass == 0.0:
            return
        if turn == len(evidence) - 1:
            masses[node] += mass
            return
        for other, chance in transitions[node]:
            extend(other, mass * chance, turn + 1, transitions)

    for prior, transitions in hypotheses:
        for node in nodes:
            extend(node, prior / len(nodes), 0, transitions)
    total = sum(masses.values())
    return {node: mass / total for node, mass in masses.items() if mass}, total  # without any, if all are 0


@st.composite
def cases(draw):
    nodes = draw(st.integers(1, 6))
    node = st.integers(0, nodes - 1)
    look = st.one_of(
        st.none(),
        st.tuples(st.just("found"), node),
        st.tuples(st.just("missed"), st.dictionaries(node, PROBABILITIES, max_size=nodes)),
    )
    return {
        "nodes": nodes,
        "edges": draw(st.lists(st.tuples(node, node), max_size=10)),
        "looks": draw(st.lists(st.lists(look, max_size=2), min_size=1, max_size=5)),
        "model": draw(st.sampled_from(["walk", "lazy walk", "goals", "mixture"])),
        "goals": draw(
            st.lists(st.tuples(node, st.integers(1, 3)), min_size=1, max_size=2, unique_by=lambda pair: pair[0])
        ),
        "wander": draw(PROBABILITIES),
    }


def modelled(ctx, case):
    """The model of a case, and its hypotheses by hand."""
    walk = (1.0, walk_by_hand(ctx, None))
    goals = {3 * goal: float(weight) for goal, weight in case["goals"]}
    total, wander = sum(goals.values()), case["wander"]
    by_goals = [(weight / total, goal_by_hand(ctx, goal, wander)) for goal, weight in goals.items()]
    if case["model"] == "walk":
        return belief.random_walk(), [walk]
    if case["model"] == "lazy walk":
        return belief.random_walk(stay=wander), [(1.0, walk_by_hand(ctx, wander))]
    if case["model"] == "goals":
        return belief.to_goals(goals, wander=wander), by_goals
    mixed = belief.mixture({belief.random_walk(): 3, belief.to_goals(goals, wander): 1})
    return mixed, [(0.75, walk[1]), *((0.25 * share, hops) for share, hops in by_goals)]


def likelihood(nodes, looks):
    """How probable the looks of a turn are at each node."""
    found = dict.fromkeys(nodes, 1.0)
    for look in looks:
        for node in nodes:
            if look and look[0] == "found":
                found[node] *= float(node == 3 * look[1])
            elif look:
                found[node] *= 1.0 - look[1].get(node // 3, 0.0)
    return found


def observe(filter, look, names):
    if look and look[0] == "found":
        return filter.update(found=dict.fromkeys(names, 3 * look[1]))
    if look:
        return filter.update([3 * node for node in look[1]], list(look[1].values()))
    return 1.0


@given(case=cases())
def test_it_equals_the_sum_over_all_paths(case):
    with context(case["nodes"], case["edges"]) as ctx:
        motion, hypotheses = modelled(ctx, case)
        nodes = list(ctx.graph.graph.get_nodes())
        expected, total = by_enumeration(hypotheses, nodes, [likelihood(nodes, looks) for looks in case["looks"]])
        filter, product = belief.Filter(ctx, motion, ["prey", "twin"]), 1.0
        for turn, looks in enumerate(case["looks"]):
            if turn:
                filter.predict()
            for look in looks:
                product = product * observe(filter, look, ["prey", "twin"])
        assert np.allclose(filter.probabilities().sum(axis=1), 1.0)
        assert np.allclose(product, total)
        if total:
            assert filter.probability("prey") == pytest.approx(expected, abs=1e-12)
        assert (filter.probabilities()[0] == filter.probabilities()[1]).all()


@settings(max_examples=12)
@given(case=cases(), order=st.permutations(range(3)))
def test_several_targets_at_once_are_those_one_by_one(case, order):
    with context(case["nodes"], case["edges"]) as ctx:
        motion, _ = modelled(ctx, case)
        names = ["a", "b", "c"]
        together, alone = belief.Filter(ctx, motion, names), [belief.Filter(ctx, motion, [name]) for name in names]
        for turn, looks in enumerate(case["looks"]):
            together.predict()
            for filter in alone:
                filter.predict()
            for look in looks:
                of = [names[order[turn % 3]]]
                if look and look[0] == "found":
                    together.update(found=dict.fromkeys(of, 3 * look[1]))
                    alone[names.index(of[0])].update(found=dict.fromkeys(of, 3 * look[1]))
                elif look:
                    seen = [3 * node for node in look[1]]
                    together.update(seen, look[1].values(), not_shown=of)
                    for filter in alone:
                        filter.update(seen, look[1].values(), not_shown=set(of) & set(filter.targets))
        assert (together.probabilities() == np.vstack([filter.probabilities() for filter in alone])).all()


@settings(max_examples=12)
@given(
    seed=st.integers(0, 10_000), sights=st.lists(st.integers(0, 25), min_size=2, max_size=3), detection=PROBABILITIES
)
def test_agents_believe_in_a_game_what_bayes_rule_gives_with_all_that_the_team_has_observed(seed, sights, detection):
    with context(6, [(a, b) for i in range(5) for a, b in ((i, i + 1), (i + 1, i))]) as ctx:
        nodes = list(ctx.graph.graph.get_nodes())
        evidence = [dict.fromkeys(nodes, 1.0) for _ in range(4)]

        def watch(state):
            here, [(_, data)] = state["curr_pos"], state["sensor"].values()
            reach = sights[int(state["name"][1:])]
            now = evidence[state["turn"]]
            for node in nodes:
                distance = abs(node - here) / 3 * 10
                chance = (detection if distance > 0 else 1.0) if distance <= reach else 0.0
                now[node] *= float(data["prey"] == node) if "prey" in data else 1.0 - chance
            belief.observe(ctx, state)
            state["action"] = state["draw"].choice(state["legal"])

        for i, sight in enumerate(sights):
            steps = [(0.0, 1.0), (1e-6, detection)]
            eyes = ctx.sensor.create_sensor(f"eyes {i}", SensorType.AGENT_RANGE, sensor_range=sight, detection=steps)
            start = nodes[(seed // 6**i) % 6]
            ctx.agent.create_agent(f"w{i}", start_node_id=start, team="red", sensors={"e": eyes}, strategy=watch)
        ctx.agent.create_agent(
            "prey", start_node_id=nodes[seed % 6], team="blue", strategy=gamms.strategies.random_walk
        )
        ctx.game.reset(seed)
        ctx.game.run(4)
        expected, _ = by_enumeration([(1.0, walk_by_hand(ctx, None))], nodes, [*evidence, dict.fromkeys(nodes, 1.0)])
        assert belief.belief_of(ctx, "w0").probability("prey") == pytest.approx(expected, abs=1e-9)
        assert belief.belief_of(ctx, "w1").probability("prey") == belief.belief_of(ctx, "w0").probability("prey")


def test_steps_are_edges_in_a_turn():
    with context(5, [(i, i + 1) for i in range(4)]) as ctx:
        slow, fast = (belief.Filter(ctx, belief.random_walk(0.5, steps=steps), ["a"]) for steps in (1, 2))
        slow.predict(4)
        fast.predict(2)
        assert slow.probability("a") == fast.probability("a")


def test_a_walker_is_expected_where_the_shipped_random_walk_goes():
    with context(4, [(0, 1), (0, 2), (0, 3), (0, 3)]) as ctx:
        filter = belief.Filter(ctx, belief.random_walk(), ["a"])
        filter.update(found={"a": 0})
        filter.predict()
        assert filter.probability("a") == {0: 0.25, 3: 0.25, 6: 0.25, 9: 0.25}


@pytest.mark.parametrize(
    ("call", "error", "words"),
    [
        (lambda f: f.update([1]), UnknownName, "node 1"),
        (lambda f: f.update(found={"b": 0}), UnknownName, "target 'b'"),
        (lambda f: f.update([0], 1.5), BadValue, "from 0 to 1, not 1.5"),
        (lambda f: f.weigh(np.full((2, 1), np.inf)), BadValue, "likelihoods must be finite and not negative, not inf"),
        (lambda f: f.weigh(np.ones((1, 2))), BadValue, r"likelihoods need the shape \(2, 1\), not \(1, 2\)"),
        (lambda f: f.probability("b"), UnknownName, "target 'b'"),
        (lambda f: f.predict(-1), BadValue, "turns must not be negative"),
        (lambda f: belief.random_walk(stay=2), BadValue, "stay of random_walk must be a probability"),
        (lambda f: belief.random_walk(steps=0), BadValue, "steps of random_walk"),
        (lambda f: belief.to_goals([]), BadValue, "Goals of to_goals need weights"),
        (lambda f: belief.to_goals({0: -1}), BadValue, "need weights"),
        (lambda f: belief.to_goals({0: 0}), BadValue, "need weights"),
        (lambda f: belief.mixture([belief.random_walk()]), BadType, "models of mixture must be a dict"),
        (lambda f: belief.mixture({"walk": 1}), BadType, "Each of the models of mixture must be a model"),
        (lambda f: belief.mixture({belief.random_walk(): 1, belief.random_walk(0.1, steps=2): 1}), BadValue, "steps"),
    ],
)
def test_errors_name_the_invalid_value(call, error, words):
    with context(2, [(0, 1)]) as ctx, pytest.raises(error, match=words):
        call(belief.Filter(ctx, belief.random_walk(), ["a"]))


def test_states_are_weighed_by_their_likelihoods():
    with context(2, [(0, 1)]) as ctx:
        filter = belief.Filter(ctx, belief.random_walk(), ["a"])
        assert filter.weigh_states(np.array([[0.5], [0.25]])).tolist() == [0.375]
        assert [*filter.probability("a").values()] == pytest.approx([2 / 3, 1 / 3])


def test_by_metres_steps_share_the_metres_of_a_turn():
    with context(4, [(0, 1), (1, 2), (2, 3), (3, 0), (2, 0)]) as ctx:
        whole = belief.Filter(ctx, belief.random_walk(0.2, steps=2), ["a"], metres=3.0)
        half = belief.Filter(ctx, belief.random_walk(0.2), ["a"], metres=1.5)
        for filter, turns in ((whole, 1), (half, 2)):
            filter.update(found={"a": 0})
            filter.predict(turns)
        assert whole.masses.tolist() == half.masses.tolist()


def test_a_walker_that_always_stays_is_where_it_was():
    with context(2, [(0, 1)]) as ctx:
        filter = belief.Filter(ctx, belief.random_walk(stay=1.0), ["a"])
        filter.update(found={"a": 0})
        filter.predict()
        assert filter.probability("a") == {0: 1.0}


def test_a_goal_of_weight_0_is_never_gone_to():
    with context(3, [(1, 0), (1, 2)]) as ctx:
        filter = belief.Filter(ctx, belief.to_goals({0: 0, 6: 2}, wander=0.0), ["a"])
        filter.update(found={"a": 3})
        filter.predict()
        assert filter.probability("a") == {6: 1.0}


def test_a_goal_that_is_not_on_the_map_is_named():
    with context(2, [(0, 1)]) as ctx, pytest.raises(UnknownName, match="node 7"):
        belief.Filter(ctx, belief.to_goals([0, 7]), ["a"])


def test_a_map_without_nodes_is_refused():
    with gamms.create_context() as ctx, pytest.raises(BadValue, match="no nodes"):
        belief.Filter(ctx, belief.random_walk(), ["a"])


# -- by metres: targets are on edges, too -----------------------------------------------------------------------------

NODES, TURNS = 5, 5


def street(speed_unit="metres", bends=()):
    """A context with nodes 0, 1, … ten metres apart on a line; some of its edges are bent."""
    ctx = gamms.create_context(seed=1, logger_config={"level": "CRITICAL"}, game={"speed_unit": speed_unit})
    ctx.graph.add_nodes(range(NODES), [10.0 * i for i in range(NODES)], [0.0] * NODES)
    for id, (a, b) in enumerate(pair for i in range(NODES - 1) for pair in ((i, i + 1), (i + 1, i))):
        line = [(10.0 * a, 0.0), (5.0 * (a + b), 3.0), (10.0 * b, 0.0)] if {a, b} in bends else None
        length = 2 * dist(line[0], line[1]) if line else 10.0
        shape = {"linestring": line} if line else {}
        ctx.graph.graph.add_edge({"id": id, "source": a, "target": b, "length": length, **shape})
    return ctx


def walk_by_metres(ctx, speed):
    """Transitions of a random walk by metres: a node, or (from, to, turns on the way) -> [(the same, probability)]."""
    graph, found = ctx.graph.graph, {}
    for node in graph.get_nodes():
        others = [other for other in graph.get_neighbors(node) if other != node]
        found[node] = [(node, 1 / (1 + len(others)))]
        for other in others:
            turns = ceil(graph.distance(node, other) / speed - 1e-9)
            way = [*((node, other, k) for k in range(1, turns)), other]
            found[node].append((way[0], 1 / (1 + len(others))))
            found.update((one, [(then, 1.0)]) for one, then in pairwise(way))
    return found


def noticed(state, data, chances, speed, bends):
    """How probable what a look shows is for a state; `chances` has that of each node."""
    node = state if isinstance(state, int) else state[0]
    if "prey" in data:
        place = data["prey"]
        edge = getattr(place, "edge", None)
        seen = int(place) if edge is None else (*edge[:2], round(place.offset_m / speed))
        return float(seen == state)
    if state == node:
        return 1.0 - chances[node]
    covers = min(chances[node], chances[state[1]]) if {node, state[1]} not in bends else 0.0
    return 1.0 - covers


@settings(max_examples=12)
@given(
    seed=st.integers(0, 10_000),
    speed=st.sampled_from([3.4, 4.0, 7.0, 10.0]),
    sights=st.lists(st.integers(0, 25), min_size=2, max_size=2),
    detection=st.sampled_from([0.0, 0.4, 1.0]),
    bends=st.sampled_from([(), ({1, 2},), ({0, 1}, {3, 4})]),
)
@example(seed=25, speed=4.0, sights=[0, 0], detection=1.0, bends=())
def test_agents_believe_what_bayes_rule_gives_over_nodes_and_parts_of_edges(seed, speed, sights, detection, bends):
    with street(bends=bends) as ctx:
        walk = walk_by_metres(ctx, speed)
        evidence = [dict.fromkeys(walk, 1.0) for _ in range(TURNS + 1)]

        def watch(state):
            here, [(_, data)] = state["curr_pos"], state["sensor"].values()
            reach = sights[int(state["name"][1:])]
            chances = {
                node: (detection if node != here else 1.0) * (10 * abs(node - here) <= reach) for node in walk_nodes
            }
            now = evidence[state["turn"]]
            for one in now:
                now[one] *= noticed(one, data, chances, speed, bends)
            truth = ctx.agent.get_agent("prey").current_node_id
            assert belief.observe(ctx, state).probability("prey").get(truth, 0.0) > 0.0
            state["action"] = state["draw"].choice(state["legal"])

        walk_nodes = list(ctx.graph.graph.get_nodes())
        for i, sight in enumerate(sights):
            steps = [(0.0, 1.0), (1e-6, detection)]
            eyes = ctx.sensor.create_sensor(f"eyes {i}", SensorType.AGENT_RANGE, sensor_range=sight, detection=steps)
            start = (seed // NODES**i) % NODES
            ctx.agent.create_agent(f"w{i}", start_node_id=start, team="red", sensors={"e": eyes}, strategy=watch)
        prey = {"team": "blue", "speed": speed, "strategy": gamms.strategies.random_walk}
        ctx.agent.create_agent("prey", start_node_id=seed % NODES, **prey)
        ctx.game.reset(seed)
        ctx.game.run(TURNS)
        by_state, _ = by_enumeration([(1.0, walk)], walk_nodes, evidence)
        expected = dict.fromkeys(walk_nodes, 0.0)
        for state, mass in by_state.items():
            expected[state if isinstance(state, int) else state[0]] += mass
        expected = {node: mass for node, mass in expected.items() if mass > 1e-12}
        found = belief.belief_of(ctx, "w0").probability("prey")
        assert found == pytest.approx(expected, abs=1e-9)


def test_a_likelihood_of_nodes_counts_on_an_edge_by_the_greater_one_of_its_ends():
    with street() as ctx:
        filter = belief.Filter(ctx, belief.random_walk(), ["a"], metres=4.0)
        filter.update(found={"a": 0})
        filter.predict()  # half of it has stayed, and half is on the way to node 1
        assert filter.weigh(np.array([[0.2], [0.6], [1.0], [1.0], [1.0]])) == pytest.approx([0.4])
        filter.predict(2)
        assert filter.probability("a") == pytest.approx({0: 0.25, 1: 0.75}, abs=1e-9)


def test_a_target_of_speed_0_stays_and_an_endless_one_is_on_nodes():
    with street() as ctx:
        for metres, expected in ((0.0, {2: 1.0}), (float("inf"), {1: 1 / 3, 2: 1 / 3, 3: 1 / 3})):
            filter = belief.Filter(ctx, belief.random_walk(), ["a"], metres=metres)
            filter.update(found={"a": 2})
            filter.predict()
            assert filter.probability("a") == pytest.approx(expected)
