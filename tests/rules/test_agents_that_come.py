"""Shipped rules in games in which agents come and leave while they are played."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import gamms
from gamms.errors import IllegalMutation
from gamms.rules import arrive, capture_flag, contacts, none_left, reach, respawn, tag
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


@settings(max_examples=30, deadline=None)
@given(
    changes=CHANGES,
    rules=st.lists(st.sampled_from([*RULES]), min_size=1, max_size=4, unique=True),
    speed=st.sampled_from([None, 4.0, 14.0]),
    comes_first=st.booleans(),
)
def test_each_turn_is_played_as_in_a_fork_with_new_rules(changes, rules, speed, comes_first):
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


def happened(ctx, *fields):
    """Return the kind of each event, and these fields."""
    return [(event["kind"], *(event[field] for field in fields)) for event in ctx.game.events]


@pytest.mark.parametrize("newcomers", [1, 2, 40])  # there is room for some; the others move the columns in memory
def test_an_agent_that_a_rule_creates_is_seen_by_the_next_rule_of_the_turn(road, newcomers):
    ctx = road(z=("red", 4), b=("blue", 4), r=("red", 9), order=lambda names: ["z", "b", "r"])

    def create(ctx):
        if ctx.game.turn == 1:
            for i in range(newcomers):
                ctx.agent.create_agent(f"a{i:02}", start_node_id=7 if i else 3, team="red")

    ctx.game.add(tag("red", "blue", then="eliminate", score=0))
    ctx.game.add(create)
    ctx.game.add(capture_flag({"blue": 3}))
    ctx.game.step()
    assert happened(ctx, "agent", "node") == [("tag", "z", 4), ("eliminated", "b", 4), ("take", "a00", 3)]


def test_the_row_of_an_agent_that_a_rule_deletes_is_not_read_by_the_next_rule(road):
    names = ["y", "k", "x", "b", "c"]
    ctx = road(y=("red", 3), k=("red", 8), x=("blue", 6), b=("blue", 2), c=("green", 8), order=lambda _: names)

    def delete(ctx):
        ctx.agent.delete_agent("y")  # which stands on a flag; the rows of all others move forward

    ctx.game.add(tag("red", "green", then="eliminate", score=0))
    ctx.game.add(delete)
    ctx.game.add(capture_flag({"blue": 3, "green": 6}))
    ctx.game.add(none_left("green", "red"))
    ctx.game.step()
    assert happened(ctx, "agent", "node") == [("tag", "k", 8), ("eliminated", "c", 8), ("take", "x", 6)]
    assert ctx.game.over["winner"] == "red"


def test_a_fork_plays_rules_on_its_own_rows_and_leaves_those_of_the_game_alone(road):
    ctx = road(z=("red", 4, 5), b=("blue", 2, 3, 4, 5), order=lambda names: ["z", "b"])
    ctx.game.add(tag("red", "blue"))
    ctx.game.step()
    before = shown(ctx.game)
    with ctx.game.internals.fork(ctx.seed)[0] as fork:
        fork.agent.create_agent("a", start_node_id=4, team="red")
        fork.game.step()
        fork.game.step()
        assert happened(fork, "agent") == [("tag", "a"), ("respawned", "b")]
        assert shown(ctx.game) == before
        ctx.game.step()
        ctx.game.step()
        assert happened(ctx, "agent") == [("tag", "z"), ("respawned", "b")]
        assert happened(fork, "agent") == [("tag", "a"), ("respawned", "b")]


def test_rules_read_the_rows_that_a_snapshot_has_restored(road):
    ctx = road(z=("red", 4, 5), b=("blue", 2, 3, 4), order=lambda names: ["z", "b"])
    ctx.game.add(tag("red", "blue"))
    ctx.game.step()
    begun = ctx.game.snapshot()
    played = []
    for newcomers in (0, 9, 0):
        for i in range(newcomers):
            ctx.agent.create_agent(f"a{i}", start_node_id=4, team="red")
        ctx.game.step()
        ctx.game.step()
        played.append(shown(ctx.game))
        ctx.game.restore(begun)
    assert played[0] == played[2] != played[1]


@pytest.mark.parametrize("is_earlier", [True, False])
def test_a_function_after_a_tag_sees_the_effects_before_it_and_no_later_ones(road, is_earlier):
    early, late = [("x", 4), ("y", 4)], [("x", 4, 5), ("y", 5)]  # they meet at once, or in the end
    (r, b), (g, w) = (early, late) if is_earlier else (late, early)
    ctx = road(r=("red", *r[1:]), b=("blue", *b[1:]), g=("green", *g[1:]), w=("white", *w[1:]), order=lambda _: "wgbr")
    seen = []

    def look(ctx, tagger, tagged):
        seen.append(ctx.agent.get_agent("b").alive)
        seen.append([contact[:2] for contact in contacts(ctx, "red", "blue")])

    ctx.game.add(tag("red", "blue", then="eliminate"))
    ctx.game.add(tag("green", "white", then=look))
    ctx.game.step()
    assert happened(ctx, "agent")[:2] == [("tag", "r"), ("tag", "g")][:: 1 if is_earlier else -1]
    assert seen == ([False, []] if is_earlier else [True, [("r", "b")]])
    assert [agent.name for agent in ctx.game.agents] == ["g", "r", "w"]


def test_agents_are_respawned_after_a_function_has_deleted_an_agent_and_asked_for_contacts(road):
    ctx = road(g=("green", 4), w=("white", 4), r=("red", 1, 2), z=("blue", 3, 2))

    def delete(ctx, tagger, _):
        ctx.agent.delete_agent(tagger.name)
        assert contacts(ctx, "red", "white") == []

    ctx.game.add(tag("green", "white", then=delete))
    ctx.game.add(tag("red", "blue"))
    ctx.game.step()
    assert happened(ctx, "agent") == [("tag", "g"), ("tag", "r"), ("respawned", "z")]
    assert ctx.agent.get_agent("z").current_node_id == 3


def test_a_function_that_says_who_is_on_a_side_may_not_create_agents(road):
    ctx = road(r=("red", 4), b=("blue", 4))

    def is_red(agent):
        if len(ctx.agent.agents) < 3:
            ctx.agent.create_agent("new", start_node_id=4, team="red")
        return agent.team == "red"

    ctx.game.add(tag(is_red, "blue"))
    with pytest.raises(IllegalMutation, match="created or deleted agents"):
        ctx.game.step()


def test_an_agent_that_comes_again_and_is_put_out_at_once_misses_its_turns(road):
    ctx = road(a=("red", 1, 1), b=("blue", 3, 3))

    def change(ctx):
        turn = ctx.game.turn
        if turn in (1, 4):
            ctx.game.eliminate("a")
        elif turn == 2:
            ctx.agent.delete_agent("a")
        elif turn == 3:
            ctx.agent.create_agent("a", start_node_id=1, team="red")
            ctx.game.eliminate("a")

    ctx.game.add(change)
    ctx.game.add(respawn(after=2))
    with ctx.game.batch(2, most_agents={"red": ["c"]}) as games:
        games.run(6)
        found = [games.result(number).events for number in range(2)]
    ctx.game.run(6)
    assert found == [ctx.game.events] * 2
    assert [(event["turn"], event["kind"]) for event in ctx.game.events] == [
        (1, "eliminated"),
        (3, "eliminated"),
        (5, "respawned"),
    ]
