"""Shipped rules in games in which agents come and leave while they are played."""

from hypothesis import given, settings
from hypothesis import strategies as st

import gamms
from gamms.rules import arrive, capture_flag, reach, respawn, tag
from gamms.strategies import random_walk

NAMES = ["a", "b", "m", "x", "z"]
CHANGES = st.lists(st.lists(st.sampled_from(NAMES), max_size=3), min_size=8, max_size=8)
RULES = {
    "tag": lambda: tag("red", "blue", then="respawn", score=1),
    "near": lambda: tag("blue", "red", hops=1, then="eliminate"),
    "chosen": lambda: tag(lambda agent: agent.team == "red", "blue", then="eliminate"),
    "straight": lambda: tag("red", "blue", euclid=9.0, then="eliminate"),
    "flags": lambda: capture_flag({"red": 0, "blue": 24}),
    "many homes": lambda: capture_flag({"red": 3}, key="other"),
    "respawn": lambda: respawn(after=2, times=3),
    "arrive": lambda: arrive("red", "starts of blue"),
    "reach": lambda: reach({"red": "starts of blue", "blue": "starts of blue"}),
}


def come_and_leave(changes, speed):
    """Return a rule that deletes the agents of a turn that are there, and creates those that are not."""

    def change(ctx):
        for name in changes[ctx.game.turn % len(changes)]:
            if name in ctx.agent.agents:
                ctx.agent.delete_agent(name)
            else:
                team = ("red", "blue")[NAMES.index(name) % 2]
                node = (7 * ctx.game.turn + len(name)) % 25
                ctx.agent.create_agent(name, start_node_id=node, team=team, strategy=random_walk, speed=speed)

    return change


def shown(game):
    """Return what a turn has left of a game."""
    agents = {name: (one.team, one.alive, one.current_node_id) for name, one in game.ctx.agent.agents.items()}
    return agents, [dict(event) for event in game.events], dict(game.scores), game.data, game.over, game.errors


@settings(max_examples=60, deadline=None)
@given(
    changes=CHANGES,
    rules=st.lists(st.sampled_from([*RULES]), min_size=1, max_size=4, unique=True),
    speed=st.sampled_from([None, 4.0, 14.0]),
    comes_first=st.booleans(),
)
def test_each_turn_is_played_as_in_a_fork_which_makes_its_rules_anew(changes, rules, speed, comes_first):
    with gamms.create_context(seed=5, logger_config={"level": "CRITICAL"}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(5, 5))
        if speed is not None:
            ctx.game.speed_unit = "metres"
        for i, name in enumerate(["c", "k", "n", "y"]):
            team = ("red", "blue")[i % 2]
            ctx.agent.create_agent(name, start_node_id=6 * i, team=team, strategy=random_walk, speed=speed)
        come = come_and_leave(changes, speed)
        shipped = [RULES[name]() for name in rules]
        for rule in [come, *shipped] if comes_first else [*shipped, come]:
            ctx.game.add(rule)
        for _ in range(10):
            twin, _ = ctx.game.internals.fork(ctx.seed)  # with the same random numbers
            with twin as fork:
                fork.game.step()
                ctx.game.step()
                assert shown(ctx.game) == shown(fork.game)
            if ctx.game.over is not None:
                break


def test_an_agent_that_comes_with_a_start_on_a_goal_opens_the_goal():
    with gamms.create_context(seed=1) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(1, 3))
        ctx.agent.create_agent("m", start_node_id=0, team="red", strategy=lambda state: None)
        ctx.agent.create_agent("z", start_node_id=2, team="blue", strategy=lambda state: None)
        ctx.game.add(arrive("red", "starts of blue"))
        ctx.game.step()
        ctx.agent.create_agent("a", start_node_id=0, team="blue", strategy=lambda state: None)
        ctx.game.step()
        assert [(event["kind"], event["agent"], event["node"]) for event in ctx.game.events] == [
            ("arrive", "m", 0),
            ("eliminated", "m", 0),
        ]


def test_the_start_of_an_agent_that_has_left_is_no_home_for_flags():
    steps = {"b": [1, 2, 3, 2, 1], "z": [2]}
    with gamms.create_context(seed=1) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(1, 4))

        def follow(state):
            state["action"] = steps[state["name"]][state["turn"]]

        for name, nodes in steps.items():
            ctx.agent.create_agent(name, start_node_id=nodes[0], team="blue", strategy=follow)
        ctx.agent.create_agent("r", start_node_id=0, team="red", strategy=lambda state: None)
        ctx.game.add(capture_flag({"red": 3}))
        ctx.game.step()
        ctx.agent.delete_agent("z")
        for _ in range(4):
            ctx.game.step()
        assert [(event["kind"], event["node"]) for event in ctx.game.events] == [("take", 3), ("capture", 1)]
