"""Deeds of array strategies: the same in batches and in games alone, and checked when they are done."""

import pytest
from batch_scenes import scene

import gamms
from gamms.errors import BadType, BadValue, UnknownName

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
