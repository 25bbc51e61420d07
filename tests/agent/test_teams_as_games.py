"""A game with a team is the game of the same agents created one by one: in results, states, recordings and forks."""

import io
from contextlib import ExitStack

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

import gamms
from gamms.recordings import first_difference
from gamms.rules import Conflicts, tag


def plan_of_numbers(arrays):
    return arrays.choose(arrays.draw.below(arrays.counts))


def plan_of_nodes(arrays):
    return arrays.targets[arrays.offsets[:-1] + arrays.draw.below(np.diff(arrays.offsets))]


def plan_of_states(states):
    for state in states.values():
        gamms.strategies.random_walk(state)


def jump(arrays):
    """An illegal node for some."""
    return np.where(arrays.draw.below(3) > 0, arrays.nodes, 24 - arrays.nodes)


PLANS = {"numbers": plan_of_numbers, "nodes": plan_of_nodes, "states": plan_of_states, "jump": jump}


def world(case, make):
    ctx = gamms.create_context(seed=case["seed"], logger_config={"level": "CRITICAL"})
    ctx.graph.attach_networkx_graph(gamms.graph.grid(5, 5))
    ctx.agent.create_agent("blue_hunter", start_node_id=12, team="blue", strategy=gamms.strategies.random_walk)
    make(ctx, "red", case["nodes"], {"fuel": case["fuel"]} if case["fuel"] else {})
    for i, speed in enumerate(case["speed"] or ()):
        ctx.agent.get_agent(f"red_{i}").speed = speed
    if case["late"]:
        ctx.agent.create_agent("red_late", start_node_id=3, team="red", strategy=gamms.strategies.random_walk)
    if case["plan"] is not None:
        ctx.game.command("red", PLANS[case["plan"]], arrays=case["plan"] != "states")
    if case["conflicts"]:
        ctx.game.conflicts = Conflicts(2)
    if case["tag"]:
        ctx.game.add(tag("blue", "red", then=case["tag"]))
    if case["order"]:
        ctx.game.order = [["blue"], ["red"]]
    return ctx


def as_team(ctx, name, nodes, columns):
    ctx.agent.create_team(name, nodes, columns=columns, strategy=gamms.strategies.random_walk)


def one_by_one(ctx, name, nodes, columns):
    for i, node in enumerate(nodes):
        own = {key: values[i] for key, values in columns.items()}
        ctx.agent.create_agent(
            f"{name}_{i}", start_node_id=node, team=name, strategy=gamms.strategies.random_walk, **own
        )


CASES = st.integers(2, 12).flatmap(
    lambda count: st.fixed_dictionaries(
        {
            "seed": st.integers(0, 5),
            "nodes": st.lists(st.integers(0, 24), min_size=count, max_size=count),
            "fuel": st.none() | st.lists(st.sampled_from([1, 2.5, True, "full"]), min_size=count, max_size=count),
            "speed": st.none() | st.lists(st.none() | st.integers(1, 3), min_size=count, max_size=count),
            "late": st.booleans(),
            "plan": st.none() | st.sampled_from(list(PLANS)),
            "conflicts": st.booleans(),
            "tag": st.none() | st.sampled_from(["eliminate", None]),
            "order": st.booleans(),
        }
    )
)


def described(ctx):
    fields = ("name", "team", "type", "current_node_id", "prev_node_id", "alive", "speed", "orientation", "state")
    agents = [[getattr(agent, field) for field in fields[:-1]] for agent in ctx.agent.create_iter()]
    return agents, [vars(agent) for agent in ctx.agent.create_iter()], dict(ctx.game.counts)


def summary(result):
    return {
        name: getattr(result, name) for name in ("turns", "scores", "events", "agents", "errors", "reason", "winner")
    }


@settings(max_examples=8)
@given(case=CASES)
def test_a_game_with_a_team_is_that_of_the_same_agents_one_by_one(case):
    with ExitStack() as stack:
        contexts = [stack.enter_context(world(case, make)) for make in (as_team, one_by_one)]
        files = [io.BytesIO(), io.BytesIO()]
        for ctx, file in zip(contexts, files, strict=True):
            ctx.game.step()
            ctx.record.start(file)
        results = [summary(ctx.game.run(4)) for ctx in contexts]
        assert results[0] == results[1]
        assert described(contexts[0]) == described(contexts[1])
        for ctx in contexts:
            ctx.record.stop()
        recordings = [stack.enter_context(gamms.recorder.open(io.BytesIO(file.getvalue()))) for file in files]
        assert first_difference(*recordings) is None
        forks = [stack.enter_context(ctx.game.fork(7).ctx) for ctx in contexts]
        assert summary(forks[0].game.run(2)) == summary(forks[1].game.run(2))
        for ctx in contexts:
            ctx.game.reset()
        assert described(contexts[0]) == described(contexts[1])
        assert summary(contexts[0].game.run(3)) == summary(contexts[1].game.run(3))
