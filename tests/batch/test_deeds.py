"""Deeds of array strategies: the same in batches and in games alone, and checked when they are done."""

import numpy as np
import pytest
from batch_scenes import plain, scene

import gamms
from gamms.errors import BadType, BadValue, UnknownName

DEEDS = {
    "scan": {"node": "node"},
    "mark": {"whom": "agent?", "size": "number", "how": ["near", "far"], "note": "value?", "lit": "boolean"},
    "count": {"to": "integer"},
}


def deed_scene(rules=(), **more):
    return scene(rules, settings={"deeds": DEEDS}, **more)


@gamms.array_strategy
def busy(view):
    actions = view.draw.below(view.counts)
    view.do("scan", view.draw.random() < 0.6, node=view.streets.step(view.node, actions))
    is_far = view.draw.random() < 0.5
    notes = np.where(is_far, {"seen": [1]}, None)
    view.do("mark", actions > 0, size=view.draw.random(), how=np.where(is_far, "far", "near"), note=notes, lit=is_far)
    view.do("count", ~is_far, to=actions)
    return actions


def work(state):
    """Do what `busy` does, by lots of the agent."""
    legal, draw, do = state["legal"], state["draw"], {}
    node = legal[draw.below(len(legal))]
    if draw.random() < 0.6:
        do["scan"] = {"node": node}
    if draw.random() < 0.6:
        do["mark"] = {"size": 1, "how": "far", "lit": True, "note": [1, {"a": None}], "whom": "red_1"}
    if draw.random() < 0.3:
        do["count"] = 3
    state["action"] = {"node_id": node, "do": do} if do else node


def judge(ctx):
    """Note what agents do."""
    for deed in ctx.game.performed():
        ctx.game.emit("seen", what=deed.kind, agent=deed.agent, node=deed.at, fields=dict(deed.values))
        ctx.game.scores["red"] += deed.values.get("size", 0)


@gamms.array_rule
def judge_in_arrays(turn):
    """Score by what agents do."""
    for kind in DEEDS:
        done = turn.performed(kind)
        turn.add_scores(done.at, done.agents, 1.0)
        turn.emit("done", done.at, agents={"agent": done.agents}, nodes={"node": done.nodes})


ORDERS = [(judge, None), (judge, [["blue"], ["red"]]), (judge_in_arrays, None)]


@pytest.mark.parametrize("phase", ["before", "after"])
@pytest.mark.parametrize(("rule", "order"), ORDERS)
@pytest.mark.parametrize("does", [work, busy])
def test_games_with_deeds_are_played_in_the_core(does, rule, order, phase):
    scenario = deed_scene(max_turns=6)
    with scenario.build(seed=1, strategies={"red": does, "blue": does}) as ctx:
        ctx.game.add(rule, phase=phase)
        ctx.game.order = order
        with ctx.game.batch(seeds=[3, 4]) as games, ctx.game.fork(0).ctx as alone:
            games.run()
            games.reset([1])
            games.run()
            if (does, rule) != (work, judge_in_arrays):
                assert "played in the core" in repr(games)
            for number, seed in enumerate(games.seeds):
                alone.game.reset(seed=seed)
                assert plain(games.result(number)) == plain(alone.game.run())


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
