"""Rules have names, can be removed, may end the game before a turn, and may fail."""

import functools
from io import BytesIO

import pytest

import gamms


def steps(state):
    state["action"] = state["legal"][-1]


def opened(folder):
    return gamms.recorder.open(BytesIO((folder / "game.ggr").read_bytes()))


def names(ctx):
    return [rule.name for rule in ctx.game.rules]


def test_a_rule_is_called_like_its_function_and_a_second_one_gets_a_number(ctx):
    def storm(ctx):
        pass

    class Referee:
        def __call__(self, ctx):
            pass

    for rule in (storm, storm, storm, Referee(), functools.partial(lambda ctx, n: None, n=1)):
        assert ctx.game.add(rule) is rule
    assert names(ctx) == ["storm", "storm_2", "storm_3", "Referee", "<lambda>"]


def test_rules_of_a_higher_rank_are_called_later_whenever_they_were_added(ctx):
    called = []

    def of_rank(name, rank):
        def rule(_):
            called.append(name)

        if rank is not None:
            rule.rank = rank
        return rule

    for name, rank in (("end", 5), ("pay", 2), ("first", None), ("also pay", 2), ("second", 0)):
        ctx.game.add(of_rank(name, rank), name=name)
    ctx.game.step()
    assert called == names(ctx) == ["first", "second", "pay", "also pay", "end"]


def test_rules_with_the_same_key_are_refused_until_one_is_removed(ctx):
    def tide(ctx):
        pass

    tide.key = "water"
    ctx.game.add(tide)
    with pytest.raises(ValueError, match="There is already a rule with a key named 'water'"):
        ctx.game.add(tide, name="flood")
    ctx.game.remove("tide")
    ctx.game.add(tide, name="flood")
    assert names(ctx) == ["flood"]


def test_an_unknown_rule_cannot_be_removed(ctx):
    ctx.game.add(lambda ctx: None, name="storm")
    with pytest.raises(KeyError, match=r"Unknown rule 'strom'\. Did you mean 'storm'\?"):
        ctx.game.remove("strom")
    with pytest.raises(KeyError, match="Unknown rule 'steps'"):
        ctx.game.remove(steps)


def test_a_rule_that_is_added_or_removed_in_a_turn_counts_from_then_on(ctx, play):
    called = []

    def late(ctx):
        called.append(("late", ctx.game.turn))
        if ctx.game.turn == 3:
            ctx.game.remove("late")

    def first(ctx):
        called.append(("first", ctx.game.turn))
        if ctx.game.turn == 2:
            ctx.game.remove("second")
            ctx.game.add(late)

    def second(ctx):
        called.append(("second", ctx.game.turn))

    ctx.game.add(first)
    ctx.game.add(second)
    play("a", 0)
    ctx.game.run(4)
    assert called == [("first", 1), ("second", 1), ("first", 2), ("late", 2), ("first", 3), ("late", 3), ("first", 4)]


def test_an_error_in_a_rule_names_the_rule_and_the_turn(ctx, play):
    play("a", 0)

    def toll(ctx):
        if ctx.game.turn == 2:
            raise ZeroDivisionError("no toll")

    ctx.game.add(toll)
    with pytest.raises(ZeroDivisionError) as caught:
        ctx.game.run(5)
    assert caught.value.__notes__ == ["In the rule 'toll' (phase 'after'), in turn 2."]
    ctx.game.add(lambda ctx: 1 / 0, phase="before", name="gate")
    with pytest.raises(ZeroDivisionError) as caught:
        ctx.game.step()
    assert caught.value.__notes__ == ["In the rule 'gate' (phase 'before'), in turn 2."]


def test_a_turn_after_which_a_rule_fails_is_played_and_recorded(ctx, play, tmp_path):
    agent = play("a", 0, 1, 2, 3)
    followed = []

    @ctx.game.add
    def toll(ctx):
        ctx.game.scores["toll"] += 1
        if ctx.game.turn == 2:
            raise ZeroDivisionError("no toll")

    ctx.game.add(lambda ctx: followed.append(ctx.game.turn))
    ctx.record.start(tmp_path / "game")
    with pytest.raises(ZeroDivisionError):
        ctx.game.run(3)
    assert (ctx.game.turn, agent.current_node_id) == (2, 2)
    result = ctx.game.run(1)
    ctx.record.stop()
    recording = opened(tmp_path)
    assert (result.turns, recording.turns, followed) == (3, 3, [1, 3])
    for turn in range(4):
        state = recording.state(turn)
        nodes = state.agents["node"].tolist()
        assert (nodes, dict(state.scores).get("toll", 0)) == ([turn], turn)


def test_a_turn_before_which_a_rule_fails_is_neither_played_nor_recorded(ctx, play, tmp_path):
    agent = play("a", 0, 1, 2, 3)
    weather = iter([True, False, True, True])

    @ctx.game.add(phase="before")
    def gate(ctx):
        ctx.game.scores["gate"] += 1
        if not next(weather):
            raise ZeroDivisionError("shut")

    ctx.record.start(tmp_path / "game")
    with pytest.raises(ZeroDivisionError):
        ctx.game.run(3)
    assert (ctx.game.turn, agent.current_node_id) == (1, 1)
    result = ctx.game.run(2)
    ctx.record.stop()
    recording = opened(tmp_path)
    assert (result.turns, recording.turns, agent.current_node_id) == (3, 3, 3)
    assert [dict(recording.state(turn).scores).get("gate", 0) for turn in range(4)] == [0, 1, 2, 3]


def test_a_collector_that_fails_leaves_the_turn_played_and_recorded(ctx, play, tmp_path):
    play("a", 0, 1, 2)
    ctx.game.collect("bad", lambda ctx: 1 / (ctx.game.turn - 1))
    ctx.record.start(tmp_path / "game")
    with pytest.raises(ZeroDivisionError):
        ctx.game.run(2)
    ctx.record.stop()
    assert (ctx.game.turn, opened(tmp_path).turns) == (1, 1)
