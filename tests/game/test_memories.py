"""What agents remember, alone and together."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gamms.core.copies import copy_deep
from gamms.game.team_memory import merge_memory as merged
from gamms.scenario import Scenario


def test_nested_values_of_a_teams_memory_are_copies_too(ctx):
    def tell(state):
        state["team_memory"].setdefault("seen", {"nodes": []})["nodes"].append(state["name"])
        state["action"] = state["curr_pos"]
        seen.append(state["team_memory"]["seen"]["nodes"])

    seen = []
    for name in "ab":
        ctx.agent.create_agent(name, start_node_id=0, team="red", strategy=tell)
    ctx.game.run(2)
    assert seen == [["a"], ["b"], ["a", "b", "a"], ["a", "b", "b"]]


@pytest.mark.parametrize(
    ("before", "copies", "after"),
    [
        ({"x": 1}, [{"x": 1}, {"x": 1}], {"x": 1}),
        ({"x": 1}, [{"x": 2}, {"x": 1}], {"x": 2}),
        ({"x": 1}, [{"x": 2}, {"x": 3}], {"x": 3}),
        ({"x": 1}, [{}, {"x": 1}], {}),
        ({"x": 1}, [{}, {"x": 4}], {"x": 4}),
        ({}, [{"x": {1}}, {"x": {2}}], {"x": {1, 2}}),
        ({"x": [0]}, [{"x": [0, 1]}, {"x": [0, 2]}, {"x": [0]}], {"x": [0, 1, 2]}),
        ({"x": [0]}, [{"x": [1]}, {"x": [0, 2]}], {"x": [0, 2]}),
        ({"x": {"a": 1}}, [{"x": {"a": 1, "b": 2}}, {"x": {"a": 1, "c": [3]}}], {"x": {"a": 1, "b": 2, "c": [3]}}),
        ({"x": {"a": {1}}}, [{"x": {"a": {1, 2}}}, {"x": {"a": {1, 3}}}], {"x": {"a": {1, 2, 3}}}),
    ],
)
def test_how_copies_become_one(before, copies, after):
    assert merged(before, copies) == after


VALUES = st.integers(0, 2) | st.sets(st.integers(0, 3)) | st.lists(st.integers(0, 3), max_size=3)
MEMORIES = st.dictionaries(st.sampled_from("xyz"), VALUES | st.dictionaries(st.sampled_from("ab"), VALUES))


@given(MEMORIES, MEMORIES)
def test_one_writer_alone_has_its_way(before, copy):
    assert merged(before, [copy]) == copy


@given(MEMORIES, MEMORIES)
def test_who_writes_nothing_changes_nothing(before, copy):
    assert merged(before, [before, copy, before]) == copy


NUMBERS = st.integers(0, 2) | st.just(float("nan"))
OBJECTS = st.builds(np.arange, st.integers(0, 2)) | st.builds(SimpleNamespace, x=NUMBERS)
PARTS = NUMBERS | st.tuples(st.integers(0, 2)) | OBJECTS
NESTED = st.recursive(
    PARTS,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.sampled_from("ab"), inner) | st.tuples(inner),
    max_leaves=8,
)


@given(st.dictionaries(st.sampled_from("xyz"), NESTED, min_size=1))
def test_copies_are_equal_and_independent(memory):
    def containers(value):
        parts = [*value.values()] if isinstance(value, dict) else [*value] if isinstance(value, (list, tuple)) else []
        own = [value] if isinstance(value, (dict, list, np.ndarray, SimpleNamespace)) else []
        return own + [one for part in parts for one in containers(part)]

    copies = [copy_deep(memory), copy_deep(memory)]
    assert repr(copies) == repr([memory, memory])
    kept = [one for given in (memory, *copies) for one in containers(given)]  # so that no id is used again
    assert len({*map(id, kept)}) == len(kept)


@given(
    st.dictionaries(st.sampled_from("wxyz"), NUMBERS),
    st.lists(st.dictionaries(st.sampled_from("vwxyz"), NUMBERS | st.none()), max_size=4),
    st.booleans(),
)
def test_the_last_of_those_that_changed_a_key_counts(before, writes, in_another_order):
    """Those that write None remove the key; copies have their keys in the same order, or in another."""
    copies, after = [], dict(before)
    for written in writes:
        copy = {**written, **before} if in_another_order else dict(before)
        copies.append({key: one for key, one in (copy | written).items() if one is not None})
    for key in "vwxyz":
        old, new = before.get(key), [copy.get(key) for copy in copies]
        changed = [one for one in new if one is not old and one != old]
        values = [one for one in changed if one is not None]
        if values:
            after[key] = values[-1]
        elif changed:
            del after[key]
    assert merged(before, copies) == after


def test_arrays_in_a_memory_are_taken_as_changed_where_they_are_others():
    old, new = np.arange(3), np.arange(3)
    before = {"map": old, "at": 1}
    assert merged(before, [{"map": old, "at": 1}, {"map": old, "at": 1}]) is before
    after = merged(before, [{"map": new, "at": 1}, {"map": old, "at": 2}])
    assert (after["map"].tolist(), after["at"]) == ([0, 1, 2], 2)
    assert after["map"] is not new


def test_a_copy_has_containers_of_its_own_which_are_the_same_where_those_before_were():
    places, pairs, ways = {1, 2}, {(3, 4)}, {"a": (1, [2]), "b": (3, 4)}
    memory = {"here": places, "there": places, "board": {"visited": {5}, "seen": places}, "pairs": pairs, "ways": ways}
    memory["board"]["itself"] = memory["board"]
    copy = copy_deep(memory)
    assert copy["here"] is copy["there"] is copy["board"]["seen"]
    assert copy["board"]["itself"] is copy["board"]
    copy["here"].add(9)
    copy["board"]["visited"].add(9)
    copy["pairs"].clear()
    copy["ways"]["a"][1].append(9)
    assert (places, memory["board"]["visited"], pairs, ways["a"]) == ({1, 2}, {5}, {(3, 4)}, (1, [2]))


def test_facts_cannot_be_written_to_however_deep(ctx):
    ctx.game.publish(flags={"red": {"at": [1, 2]}}, teams={"red"})
    facts = ctx.game.facts
    for write in (
        lambda: facts.__setitem__("x", 1),
        lambda: facts["flags"].__setitem__("x", 1),
        lambda: facts["flags"]["red"].__setitem__("at", 1),
        lambda: facts["flags"]["red"]["at"].append(3),
        lambda: facts["teams"].add("blue"),
    ):
        with pytest.raises((TypeError, AttributeError)):
            write()


class Planner:
    def __init__(self, ctx):
        self.ctx = ctx


@pytest.mark.parametrize("on_error", ["raise", "stay"])
def test_an_object_with_the_context_in_a_teams_memory_is_an_error_of_its_writer_alone(ctx, on_error):
    def share_planner(state):
        state["team_memory"]["planner"] = Planner(ctx)
        state["action"] = 1

    def share_number(state):
        state["team_memory"]["turn"] = state["turn"]
        state["action"] = 1

    ctx.game.on_error = on_error
    ctx.agent.create_agent("planner", start_node_id=0, team="red", strategy=share_planner)
    ctx.agent.create_agent("number", start_node_id=0, team="red", strategy=share_number)
    if on_error == "raise":
        with pytest.raises(
            ValueError, match=r"Agent 'planner' in turn 0: What .* keep objects .* in state\['memory'\]"
        ):
            ctx.game.run(1)
        return
    played = ctx.game.run(1)
    assert [(one["agent"], one["kind"]) for one in played.errors] == [("planner", "error")]
    assert ctx.game.team_memories == {"red": {"turn": 0}}
    assert [ctx.agent.get_agent(name).current_node_id for name in ("planner", "number")] == [1, 1]


def test_a_rule_before_the_first_turn_sees_the_same_memories_in_a_new_game_and_after_a_reset():
    def note(ctx):
        ctx.game.emit("known", memories={name: dict(one) for name, one in ctx.game.memories.items()})

    with Scenario(map={"grid": {"rows": 3, "columns": 3}}, teams={"red": {"count": 2}}).build(seed=1) as ctx:
        for agent in ctx.agent.create_iter():
            agent.strategy = lambda state: state["memory"].update(turn=state["turn"]) or state.update(action=0)
        ctx.game.add(note, phase="before")
        ctx.game.on_illegal = "stay"
        new = ctx.game.run(2).events
        ctx.game.reset(seed=2)
        assert ctx.game.run(2).events == new


def test_an_agent_that_is_created_again_under_its_name_remembers_alone_and_in_a_batch():
    def again(ctx):
        if ctx.game.turn == 2:
            ctx.agent.delete_agent("red_0")
        if ctx.game.turn == 4:
            ctx.agent.create_agent("red_0", team="red", start_node_id=0, strategy=ctx.agent.get_agent("red_1").strategy)

    def count(state):
        state["memory"]["turns"] = state["memory"].get("turns", 0) + 1
        state["action"] = state["legal"][state["memory"]["turns"] % len(state["legal"])]

    game = Scenario(map={"grid": {"rows": 3, "columns": 3}}, teams={"red": {"count": 2}}, max_turns=6)
    with game.build(seed=1) as ctx:
        for agent in ctx.agent.create_iter():
            agent.strategy = count
        ctx.game.add(again)
        with ctx.game.batch(2) as games, ctx.game.fork(0).ctx as alone:
            games.run()
            alone.game.reset(seed=0)
            assert games.result(0).agents == alone.game.run().agents
            assert alone.game.memories["red_0"] == {"turns": 4}
