"""Conflicts of many agents of a team: what ranks decide is what a function decides that is asked about each contest."""

import io

import networkx as nx
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import gamms
from gamms.recordings import first_difference
from gamms.rules import Conflicts, at_random, by_priority, by_rank, nobody

SIDE = 8
FORMS = {
    "random": at_random,
    "teams": lambda: by_priority(["blue", "red"]),
    "nobody": nobody,
    "ranks": lambda: by_rank(lambda name, team: None if name.endswith("7") else (len(name), team == "red")),
}
LIMITS = {
    "one": 1,
    "two": 2,
    "one or none": {node: int(node % 5 > 0) for node in range(SIDE * SIDE)},
    "some": {node: node % 4 for node in range(0, SIDE * SIDE, 2)},
    "attribute": "places",
    "none": None,
}


def walk(arrays):
    return arrays.choose(arrays.draw.below(arrays.counts))


def asked(make):
    """Return a function that is asked about each contest, and decides as a resolver by ranks."""
    inner = make()

    def resolve(contest, ctx):
        return inner(contest, ctx)

    return resolve


def hesitate(state):
    """Stay after a turn in which it was blocked."""
    gamms.strategies.random_walk(state)
    if state["blocked"]:
        state["action"] = state["curr_pos"]


def world(case, resolve):
    ctx = gamms.create_context(seed=case["seed"], logger_config={"level": "CRITICAL"})
    graph = gamms.graph.grid(SIDE, SIDE)
    for node in list(graph)[::3]:
        graph.nodes[node]["places"] = node % 3
    ctx.graph.attach_networkx_graph(graph)
    ctx.agent.create_team("red", case["nodes"])
    ctx.game.command("red", walk, arrays=True)
    for i, node in enumerate(case["nodes"][:3]):
        ctx.agent.create_agent(f"blue_{i}", start_node_id=node, team="blue", strategy=hesitate)
    if case["ordered"]:
        ctx.game.order = [["blue"], ["red"]]
    ctx.game.conflicts = Conflicts(
        LIMITS[case["capacity"]], case["among"], allow_swaps=case["allow_swaps"], resolve=resolve
    )
    return ctx


CASES = st.fixed_dictionaries(
    {
        "seed": st.integers(0, 9),
        "nodes": st.lists(st.integers(0, SIDE * SIDE - 1), min_size=32, max_size=40),
        "capacity": st.sampled_from(sorted(LIMITS)),
        "among": st.sampled_from(["all", "team"]),
        "allow_swaps": st.booleans(),
        "resolver": st.sampled_from(sorted(FORMS)),
        "ordered": st.booleans(),
    }
)


def seen(ctx):
    ctx.game.step()
    return {agent.name: agent.current_node_id for agent in ctx.agent.create_iter()}


def recorded(ctx):
    file = io.BytesIO()
    ctx.record.start(file)
    ctx.game.step()
    ctx.record.stop()
    return gamms.recorder.open(io.BytesIO(file.getvalue()))


@settings(max_examples=8)
@given(case=CASES)
def test_ranks_decide_as_a_function_that_is_asked_about_each_contest(case):
    make = FORMS[case["resolver"]]
    with world(case, make()) as ctx, world(case, asked(make)) as plain:
        for _ in range(3):
            assert seen(ctx) == seen(plain)
        assert dict(ctx.game.counts) == dict(plain.game.counts)
        with ctx.game.fork(7).ctx as twin, plain.game.fork(7).ctx as plain_twin:
            assert seen(twin) == seen(plain_twin)
            assert dict(twin.game.counts) == dict(plain_twin.game.counts)
        with recorded(ctx) as recording, recorded(plain) as plain_recording:
            assert first_difference(recording, plain_recording) is None


@pytest.mark.parametrize("edge_capacity", [1, "lanes"])
def test_conflicts_by_metres_do_not_depend_on_the_ids_of_nodes_and_edges(edge_capacity):
    def where(factor):
        graph = nx.relabel_nodes(gamms.graph.grid(9, 9), {node: factor * node for node in range(81)})
        for source, target, edge in graph.edges(data=True):
            edge["lanes"] = 1 + (source + target) // factor % 2
        with gamms.create_context(seed=3, logger_config={"level": "CRITICAL"}) as ctx:
            ctx.graph.attach_networkx_graph(graph)
            ctx.game.speed_unit = "metres"
            ctx.game.conflicts = Conflicts(1, edge_capacity=edge_capacity)
            for i in range(30):
                start = factor * (i * 7 % 81)
                ctx.agent.create_agent(f"a{i}", start_node_id=start, speed=0.7, strategy=gamms.strategies.random_walk)
            ctx.game.run(12)
            places = [(agent.current_node_id // factor, agent.offset_m) for agent in ctx.game.agents]
            return places, ctx.game.counts

    assert where(1) == where(1 << 40)


def test_a_subclass_that_resolves_is_given_all_moves():
    given = []

    class Lenient(Conflicts):
        def resolve(self, moves, ctx):
            given.append(len(moves))
            return set()

    case = {"seed": 1, "nodes": [0] * 40, "capacity": "one", "among": "all", "allow_swaps": True, "ordered": False}
    with world(case, nobody()) as ctx:
        ctx.game.step()
        assert {agent.current_node_id for agent in ctx.agent.create_iter() if agent.team == "red"} == {0}
        ctx.game.conflicts = Lenient(1)
        ctx.game.step()
    assert given == [43]
