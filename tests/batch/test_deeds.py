"""Deeds of array strategies: the same in batches and in games alone, and checked when they are done."""

import numpy as np
import pytest
from batch_scenes import assert_as_alone, assert_as_played, check_games, plain, scene
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import gamms
from gamms.errors import BadType, BadValue, UnknownName
from gamms.rules import cooldown, respawn, tag

DEEDS = {
    "scan": {"node": "node"},
    "mark": {"whom": "agent?", "size": "number", "how": ["near", "far"], "note": "value?", "lit": "boolean"},
    "count": {"to": "integer"},
}


def deed_scene(rules=(), **more):
    return scene(rules, settings={"deeds": DEEDS}, **more)


@pytest.mark.parametrize(
    ("deed", "fields", "kind", "message"),
    [
        ("jump", {}, UnknownName, "jump"),
        ("scan", {"nodes": 1}, UnknownName, "nodes"),
        ("scan", {}, BadValue, "'node' of the deed 'scan'"),
        ("scan", {"node": 99}, BadValue, "no node number 99"),
        ("scan", {"node": -1}, BadValue, "no node number -1"),
        ("scan", {"node": "a"}, BadType, "by their numbers"),
        ("count", {"to": 0.5}, BadType, "'integer'"),
        ("mark", {"size": 1, "how": "up", "lit": True}, BadValue, "cannot be 'up'"),
    ],
)
def test_impossible_deeds_are_refused(deed, fields, kind, message):
    @gamms.array_strategy
    def act(view):
        view.do(deed, True, **fields)
        return view.counts * 0

    with deed_scene().batch(2, strategies={"red": act}) as games, pytest.raises(kind, match=message):
        games.step()


def test_an_agent_does_a_deed_once_in_a_turn():
    @gamms.array_strategy
    def act(view):
        view.do("count", view.node % 2 == 0, to=1)
        view.do("count", view.node % 2 == 1, to=2)
        view.do("count", True, to=3)
        return view.counts * 0

    with deed_scene().batch(2, strategies={"red": act}) as games:
        with pytest.raises(BadValue, match="twice"):
            games.step()
        with pytest.raises(BadValue, match="not for games"):
            games.observe("red").do("count", True, to=3)


# -- deeds that last ----------------------------------------------------------------------------------------------


def tinker(state):
    """Fix nodes, rest and walk about at random, and say what the state shows of it."""
    draw = state["draw"]
    do = {"say": {"doing": state["doing"]}}
    if draw.random() < 0.5:
        do["fix"] = {"node": draw.below(3)}
    if draw.random() < 0.2:
        do["rest"] = None
    state["action"] = {"node_id": draw.choice(state["legal"]) if draw.random() < 0.6 else state["curr_pos"], "do": do}


def noise(ctx):
    """Interrupt the agents on node 6, in the middle of the turn."""
    for agent in ctx.game.agents:
        if agent.current_node_id == 6:
            ctx.game.emit("noise", agent=agent.name, time=ctx.game.turn - 0.5)


def count_fixes(ctx):
    for deed in ctx.game.performed("fix"):
        ctx.game.scores[deed.team] += deed.values["time"] - deed.values["since"]


RULES_OF_LASTING = [
    tag("red", "blue"),
    tag("blue", "red", hops=1, then="eliminate"),
    respawn(2),
    noise,
    count_fixes,
    cooldown("rest", 2),
]


@st.composite
def lasting_games(draw):
    """Settings, speeds and rules of a game in which agents do deeds that last."""
    how = {
        "interrupted_by": sorted(draw(st.sets(st.sampled_from(["move", "tag", "noise"])))),
        "on_interrupt": draw(st.sampled_from(["resume", "restart"])),
        "blocks_moving": draw(st.booleans()),
    }
    unit = draw(st.sampled_from(["edges", "metres", "metres_per_second"]))
    fix = {"fields": {"node": "node"}, "seconds": draw(st.sampled_from([0.75, 2.0, 5.0])), **how}
    rest = {"fields": {}, "turns": draw(st.sampled_from([0.3, 1, 2.5])), "interrupted_by": ["tag"]}
    given = {
        "deeds": {"fix": fix, "rest": rest, "say": {"doing": "value?"}},
        "speed_unit": unit,
        "turn_seconds": draw(st.sampled_from([1.0, 2.0])),
        "order": draw(st.sampled_from([None, [["red"], ["blue"]]])),
        "on_illegal": "stay",
    }
    speeds = [None, 2, 0.5] if unit == "edges" else [4, 13, 25]
    rules = draw(st.permutations(RULES_OF_LASTING).map(lambda rules: rules[:4]))
    return given, draw(st.lists(st.sampled_from(speeds), min_size=4, max_size=4)), rules


@given(lasting_games())
@settings(max_examples=12, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])
def test_deeds_that_last_are_the_same_in_batches_and_in_games_alone(drawn):
    given, speeds, rules = drawn
    seen = {"begun": 0, "done": 0, "interrupted": 0}
    with gamms.create_context(seed=1, logger_config={"level": "CRITICAL"}, game=given) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 3))
        for number, speed in enumerate(speeds):
            team = ("red", "blue")[number % 2]
            ctx.agent.create_agent(
                f"{team}_{number}", start_node_id=2 * number, team=team, strategy=tinker, speed=speed
            )
        for rule in rules:
            ctx.game.add(rule)
        ctx.game.max_turns = 8
        with ctx.game.batch(seeds=[3, 4, 5]) as games, ctx.game.fork(0).ctx as alone:
            games.run()
            assert_as_alone(games, alone)
            assert not games.detached
            for number in range(3):
                for event in games.result(number).events:
                    if event["kind"] in seen:
                        seen[event["kind"]] += 1
    assert seen["begun"] >= seen["done"] + seen["interrupted"] > 0


def test_a_deed_that_has_lasted_comes_after_those_that_its_agent_has_done_at_once():
    def act(state):
        kinds = ["say", "fix", "wave"] if state["name"] == "red_0" else ["say"]
        state["action"] = {"do": dict.fromkeys(kinds)}

    def list_deeds(ctx):
        ctx.game.emit("seen", deeds=[[deed.agent, deed.kind] for deed in ctx.game.performed()])

    deeds = {"fix": {"fields": {}, "turns": 1}, "say": {}, "wave": {}}
    with scene(red=1, blue=1, settings={"deeds": deeds}, max_turns=3).build(seed=1) as ctx:
        for agent in ctx.agent.create_iter():
            agent.strategy = act
        ctx.game.add(list_deeds)
        for result in check_games(ctx, 3):
            seen = [event["deeds"] for event in result.events if event["kind"] == "seen"]
            at_once = [["blue_0", "say"], ["red_0", "say"], ["red_0", "wave"]]
            assert seen == [[*at_once, ["red_0", "fix"]]] * 3


@gamms.array_strategy
def tinker_in_arrays(view):
    """Fix nodes and walk about at random; agents that have almost done it stay."""
    doing = view["doing"]
    assert ((doing.kind >= 0) == (doing.left > 0)).all()
    view.do("fix", (view.draw.random() < 0.5) & view.mask, node=view.node)
    view.do("say", (doing.left > 0) & view.mask, left=doing.left, since=doing.since)
    return np.where(doing.left > 1.0, view.draw.below(view.counts), 0)


def tinker_alone(state):
    """Do in plain Python what `tinker_in_arrays` does."""
    doing = state["doing"]
    do = {"fix": state["curr_pos"]} if state["draw"].random() < 0.5 else {}
    if doing is not None:
        do["say"] = {"left": doing["left"], "since": doing["since"]}
    moves = state["draw"].below(len(state["legal"]))
    far = doing is not None and doing["left"] > 1.0
    state["action"] = {"node_id": state["legal"][moves if far else 0], "do": do}


@pytest.mark.parametrize("order", [None, [["blue"], ["red"]]])
def test_array_strategies_begin_deeds_that_last_and_see_them_as_plain_ones_do(order):
    fix = {"fields": {"node": "node"}, "turns": 2.5, "interrupted_by": ["tag", "move"], "on_interrupt": "resume"}
    settings = {"deeds": {"say": {"left": "number", "since": "number"}, "fix": fix}, "order": order}
    rules = [{"rule": "tag", "with": {"taggers": "blue", "tagged": "red"}}]
    scenario = scene(rules, settings=settings)
    found = []
    for strategy in (tinker_in_arrays, tinker_alone):
        with scenario.batch(3, strategies={"red": strategy}) as games:
            games.run()
            assert_as_played(games, scenario, {"red": strategy})
            found.append([plain(games.result(number)) for number in range(3)])
            assert not games.detached
            assert games.observe("red")["doing"].kind.shape == (3, 3)
    for arrays, alone in zip(*found, strict=True):
        assert (arrays["events"], arrays["deeds"]) == (alone["events"], alone["deeds"])
        assert {event["kind"] for event in arrays["events"]} >= {"begun", "done", "interrupted"}


def test_a_view_of_a_game_without_deeds_that_last_shows_none():
    with deed_scene().batch(2) as games, pytest.raises(UnknownName, match="declares no deed that lasts"):
        games.observe("red")["doing"]


def test_array_rules_get_finished_deeds_with_their_times():
    @gamms.array_rule
    def note(turn):
        done = turn.performed("fix")
        turn.emit("noted", done.at, values={key: done.values[key].tolist() for key in ("since", "time")})

    @gamms.array_strategy
    def fix_at_first(view):
        view.do("fix", view.turn[:, None] == 0)
        return view.counts * 0

    settings = {"deeds": {"fix": {"fields": {}, "turns": 1.25}}}
    with scene(settings=settings, red=1).build(seed=1) as ctx:
        ctx.game.add(note)
        for agent in ctx.agent.teams["red"]:
            agent.register_strategy(fix_at_first)
        with ctx.game.batch(2) as games, ctx.game.fork(0).ctx as alone:
            games.run()
            assert_as_alone(games, alone)
            found = [event for event in games.result(1).events if event["kind"] == "noted"]
    assert found == [{"turn": 2, "kind": "noted", "since": 0.0, "time": 1.25}]
