"""Conflicts of many agents of a team are resolved in arrays, with what resolving them by name gives."""

import io

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import gamms
from gamms.recordings import first_difference
from gamms.rules import Conflicts, at_random, by_priority, conflicts_in_arrays, nobody

SIDE = 8
FORMS = {"random": at_random, "teams": lambda: by_priority(["blue", "red"]), "nobody": nobody}
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


def by_name(make):
    """Return the same resolver without its array form."""
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
def test_arrays_decide_as_names_do(case):
    make = FORMS[case["resolver"]]
    with world(case, make()) as ctx, world(case, by_name(make)) as plain:
        for _ in range(3):
            assert seen(ctx) == seen(plain)
        assert dict(ctx.game.counts) == dict(plain.game.counts)
        with ctx.game.fork(7).ctx as twin, plain.game.fork(7).ctx as plain_twin:
            assert seen(twin) == seen(plain_twin)
            assert dict(twin.game.counts) == dict(plain_twin.game.counts)
        with recorded(ctx) as recording, recorded(plain) as plain_recording:
            assert first_difference(recording, plain_recording) is None


def test_arrays_are_asked_where_agents_are_many_and_names_where_a_subclass_resolves():
    asked = []

    class Lenient(Conflicts):
        def resolve(self, moves, ctx):
            asked.append(len(moves))
            return set()

    case = {"seed": 1, "nodes": [0] * 40, "capacity": "one", "among": "all", "allow_swaps": True, "ordered": False}
    with world(case, nobody()) as ctx:
        ctx.game.step()
        assert {agent.current_node_id for agent in ctx.agent.create_iter() if agent.team == "red"} == {0}
        ctx.game.conflicts = Lenient(1)
        ctx.game.step()
    assert asked == [43]


@pytest.mark.parametrize("allow_swaps", [True, False])
def test_many_agents_made_one_by_one_are_decided_in_arrays_while_the_map_stays(allow_swaps):
    asked = set()

    def at_random_by_name(contest, ctx):
        asked.add(ctx.game.turn)
        return at_random()(contest, ctx)

    def either(contest, ctx):
        return at_random_by_name(contest, ctx)

    either.array_form = at_random().array_form

    def crowd(resolve):
        ctx = gamms.create_context(seed=3, logger_config={"level": "CRITICAL"})
        ctx.graph.attach_networkx_graph(gamms.graph.grid(20, 20))
        for i in range(300):
            ctx.agent.create_agent(f"a_{i}", start_node_id=i, strategy=hesitate)
        ctx.game.conflicts = Conflicts(1, allow_swaps=allow_swaps, resolve=resolve)
        return ctx

    with crowd(either) as ctx, crowd(by_name(at_random)) as plain:
        for turn in range(6):
            if turn == 3:
                for one in (ctx, plain):
                    one.graph.graph.remove_edge(0)
            assert seen(ctx) == seen(plain)
        assert dict(ctx.game.counts) == dict(plain.game.counts)
    assert asked == {0, 3}


WAYS = {
    "all agents on all nodes": {"_PLACES_AS_THEY_ARE": 10**9},
    "all agents, by a table of nodes": {"_PLACES_AS_THEY_ARE": 0, "_FEW_INVOLVED": 10**9},
    "all agents, by sorting nodes": {"_PLACES_AS_THEY_ARE": 0, "_PLACES_PER_MOVE": 0},
    "those alone that can be in the way": {"_PLACES_AS_THEY_ARE": 0, "_FEW_INVOLVED": 1},
}


@pytest.mark.parametrize("capacity", ["one", "one or none", "two", "some"])
def test_agents_that_are_in_no_others_way_can_be_left_out(capacity):
    case = {"seed": 1, "nodes": [*range(40), *range(10)], "among": "all", "allow_swaps": True, "ordered": False}
    case["capacity"] = capacity

    def played(way):
        with pytest.MonkeyPatch.context() as patch, world(case, at_random()) as ctx:
            for name, value in WAYS[way].items():
                patch.setattr(conflicts_in_arrays, name, value)
            return [seen(ctx) for _ in range(12)]

    first, *others = map(played, WAYS)
    assert all(one == first for one in others)
