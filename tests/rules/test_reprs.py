"""What the shipped rules, resolvers and strategies print as."""

import pytest

import gamms
from gamms import rules, strategies


def is_near(agent):
    return True


CALLS = {  # exported name -> how it is called with `ctx`, and what is printed of that
    "tag": (lambda ctx: rules.tag("red", "blue", metres=40), "tag('red', 'blue', metres=40)"),
    "capture_flag": (lambda ctx: rules.capture_flag({"red": 0}, goal=3), "capture_flag({'red': 0}, goal=3)"),
    "last_team": (lambda _: rules.last_team(), "last_team()"),
    "arrive": (lambda ctx: rules.arrive("red", [1, 2], score=3), "arrive('red', [1, 2], score=3)"),
    "none_left": (lambda ctx: rules.none_left("red", "blue"), "none_left('red', 'blue')"),
    "reach": (lambda ctx: rules.reach("red", [1, 2], winner=None), "reach('red', [1, 2], winner=None)"),
    "idleness": (lambda ctx: rules.idleness([3, 4], teams="blue"), "idleness([3, 4], teams='blue')"),
    "hold": (lambda ctx: rules.hold([3, 4], 5, ends=False), "hold([3, 4], 5, ends=False)"),
    "discover": (lambda ctx: rules.discover({3: "decoy"}), "discover({3: 'decoy'})"),
    "resource": (lambda ctx: rules.resource("fuel", 9, per_turn=1), "resource('fuel', 9, per_turn=1)"),
    "cooldown": (lambda ctx: rules.cooldown("shoot", turns=2), "cooldown('shoot', turns=2)"),
    "respawn": (lambda ctx: rules.respawn(3), "respawn(3)"),
    "payoff": (lambda ctx: rules.payoff({"tag": {"agent": 1}}), "payoff({'tag': {'agent': 1}})"),
    "time_limit": (lambda ctx: rules.time_limit(9), "time_limit(9)"),
    "territory.published": (lambda ctx: rules.territory.published({0: "red"}), "published({0: 'red'})"),
    "by_priority": (lambda ctx: rules.by_priority(["red", "blue"]), "by_priority(['red', 'blue'])"),
    "by_rank": (lambda ctx: rules.by_rank(is_near), "by_rank(is_near)"),
    "at_random": (lambda ctx: rules.at_random(), "at_random()"),
    "nobody": (lambda ctx: rules.nobody(), "nobody()"),
    "goto": (lambda ctx: strategies.goto(ctx, 3), "goto(ctx, 3)"),
    "follow_path": (lambda ctx: strategies.follow_path(ctx, [1], repeat=True), "follow_path(ctx, [1], repeat=True)"),
    "patrol": (lambda ctx: strategies.patrol(ctx=ctx, nodes=[1, 2]), "patrol(ctx=ctx, nodes=[1, 2])"),
    "chase": (lambda ctx: strategies.chase(ctx, otherwise=strategies.stay), "chase(ctx, otherwise=stay)"),
    "flee": (strategies.flee, "flee(ctx)"),
    "intercept": (lambda ctx: strategies.intercept(ctx, [3]), "intercept(ctx, [3])"),
    "assign": (lambda ctx: strategies.assign(ctx, patience=3), "assign(ctx, patience=3)"),
    "safest_exit": (lambda ctx: strategies.safest_exit(ctx, [3]), "safest_exit(ctx, [3])"),
    "follow_belief": (strategies.follow_belief, "follow_belief(ctx)"),
    "random_waypoints": (lambda ctx: strategies.random_waypoints(ctx, pause=2), "random_waypoints(ctx, pause=2)"),
    "sweep": (lambda ctx: strategies.sweep(ctx, repeat=True), "sweep(ctx, repeat=True)"),
    "unblock": (lambda _: strategies.unblock(strategies.stay, after=3), "unblock(stay, after=3)"),
    "guard": (lambda ctx: strategies.guard(ctx, 1, 5.0), "guard(ctx, 1, 5.0)"),
    "first": (
        lambda ctx: strategies.first(strategies.chase(ctx, otherwise=None), strategies.patrol(ctx, [0, 2, 1])),
        "first(chase(ctx, otherwise=None), patrol(ctx, [0, 2, 1]))",
    ),
    "mix": (lambda ctx: strategies.mix(0.5, strategies.stay, strategies.flee(ctx)), "mix(0.5, stay, flee(ctx))"),
    "human": (lambda ctx: strategies.human(is_near), "human(is_near)"),
}
MAKE_NONE = {
    "Conflicts",
    "Contact",
    "Contest",
    "contacts",
    "idleness_table",
    "one_to_one",
    "territory",
    "stay",
    "random_walk",
    "pool",
}
MAKE_NONE |= {"territory.by_distance", "territory.halves"}


@pytest.fixture
def ctx():
    with gamms.create_context(seed=1) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(2, 2))
        ctx.agent.create_agent("red_0", start_node_id=0, team="red", strategy=strategies.random_walk)
        ctx.agent.create_agent("blue_0", start_node_id=3, team="blue", strategy=strategies.random_walk)
        yield ctx


def test_all_that_is_exported_is_in_the_table():
    exported = {*rules.__all__, *strategies.__all__, *(f"territory.{name}" for name in rules.territory.__all__)}
    assert exported == CALLS.keys() | MAKE_NONE


@pytest.mark.parametrize("name", CALLS)
def test_the_result_of_a_factory_prints_as_the_call(ctx, name):
    make, printed = CALLS[name]
    made = make(ctx)
    assert repr(made) == printed
    assert made.__name__ in (name.rpartition(".")[2], "strategy")


def test_the_rules_of_a_game_and_of_its_fork_show_how_they_were_made(ctx):
    tag = rules.tag("red", "blue", then=is_near)
    ctx.game.add(tag)
    ctx.game.add(rules.time_limit(9), name="end")
    printed = (
        "(NamedRule('tag', tag('red', 'blue', then=is_near), phase='after'), "
        "NamedRule('end', time_limit(9), phase='after'))"
    )
    assert repr(ctx.game.rules) == printed
    with ctx.game.fork(seed=2).ctx as fork:
        assert repr(fork.game.rules) == printed
        fork.game.remove(tag)
        assert repr(fork.game.rules) == "(NamedRule('end', time_limit(9), phase='after'),)"
    ctx.game.remove(tag)
    assert [one.name for one in ctx.game.rules] == ["end"]


def test_long_arguments_are_shortened():
    printed = repr(rules.territory.published(dict.fromkeys(range(1000), "red")))
    assert printed == "published({0: 'red', 1: 'red', 2: 'red', 3: 'red', ...})"


def test_a_function_that_makes_rules_is_still_refused_where_a_rule_is_wanted(ctx):
    for make in (rules.tag, rules.last_team, rules.time_limit):
        with pytest.raises(TypeError, match=f"{make.__name__} makes such a function: call it"):
            ctx.game.add(make)
