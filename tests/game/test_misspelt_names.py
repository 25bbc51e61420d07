from io import BytesIO

import pytest

from gamms.errors import UnknownName
from gamms.rules import Conflicts, capture_flag, last_team, tag, time_limit
from gamms.strategies import first, goto, random_walk, stay


def test_scores_that_look_like_those_of_a_team_or_an_agent_are_warned_about_once(ctx, heard):
    ctx.agent.create_agent("anna", start_node_id=0, team="red", strategy=stay)

    @ctx.game.add
    def score(ctx):
        for key in ("red", "anna", "rde", "ana", "met", 7, (1, 2)):
            ctx.game.scores[key] += 1

    assert ctx.game.run(2).scores["rde"] == 2
    ctx.game.run(2)
    assert heard == [
        "Scores of 'ana' are of no team and no agent. Did you mean 'anna'?",
        "Scores of 'rde' are of no team and no agent. Did you mean 'red'?",
    ]


@pytest.mark.parametrize(
    ("winner", "said"),
    [("rde", ["The winner 'rde' is no team and no agent. Did you mean 'red'?"]), ("red", []), ("draw", [])],
)
def test_a_winner_that_looks_like_a_team_or_an_agent_is_warned_about(ctx, heard, winner, said):
    ctx.agent.create_agent("anna", start_node_id=0, team="red", strategy=stay)
    ctx.game.add(lambda ctx: ctx.game.end("x", winner=winner))
    assert ctx.game.run(2).winner == winner
    assert heard == said


def test_the_result_of_a_rule_is_not_a_rule(ctx):
    with pytest.raises(TypeError, match=r"not None .*; pass a function itself, without calling it"):
        ctx.game.add(None)
    assert ctx.game.rules == ()


@pytest.mark.parametrize("conflicts", [Conflicts, Conflicts(capacity=1)])
def test_a_conflict_resolver_is_not_a_rule(ctx, conflicts):
    with pytest.raises(TypeError, match=r"is not a rule: set it as ctx\.game\.conflicts\."):
        ctx.game.add(conflicts)


def test_a_class_of_conflicts_that_was_not_called_is_refused(ctx):
    with pytest.raises(TypeError, match=r"as the object gamms.rules.Conflicts\(\) has, not <class"):
        ctx.game.conflicts = Conflicts
    assert ctx.game.conflicts is None


@pytest.mark.parametrize("maker", [tag, time_limit, capture_flag, last_team])
def test_a_maker_of_rules_that_was_not_called_is_refused(ctx, maker):
    with pytest.raises(TypeError, match=rf"{maker.__name__} makes such a function: call it, {maker.__name__}\(…\)"):
        ctx.game.add(maker)


@pytest.mark.parametrize("maker", [first, goto])
def test_a_maker_that_needs_more_than_the_context_is_refused(ctx, maker):
    with pytest.raises(TypeError, match=rf"{maker.__name__} makes "):
        ctx.agent.create_agent("b", start_node_id=0, strategy=maker)
    assert "b" not in ctx.agent.agents


class Rules:
    def one(self, ctx):
        pass

    def two(self, ctx, more):
        pass


def of_nothing():
    pass


def with_more(ctx, *, more):
    pass


@pytest.mark.parametrize("function", [of_nothing, with_more, Rules().two, lambda a, b: None])
def test_a_function_that_takes_something_else_is_refused_with_its_signature(ctx, function):
    with pytest.raises(TypeError, match=r"must be a function of the context alone, and .*\(.*\) is not"):
        ctx.game.add(function)


@pytest.mark.parametrize("strategy", [stay, random_walk])
def test_strategies_that_are_functions_of_the_state_are_taken_as_they_are(ctx, strategy):
    ctx.agent.create_agent("b", start_node_id=0, strategy=strategy)
    assert ctx.game.run(1).agents["b"]["illegal"] == 0


@pytest.mark.parametrize("verb", ["eliminate", "respawn", "start_node", "observation"])
@pytest.mark.parametrize("nobody", [5, None, [], {}])
def test_an_unknown_agent_is_named(ctx, verb, nobody):
    with pytest.raises(KeyError, match="Unknown agent"):
        getattr(ctx.game, verb)(nobody)


@pytest.mark.parametrize("name", [{}, [], 5, None])
def test_names_that_are_no_texts_are_refused(ctx, name):
    agent = ctx.agent.create_agent("b", start_node_id=0)
    with pytest.raises(TypeError, match="The name of a sensor must be a string"):
        agent.deregister_sensor(name)
    with pytest.raises(TypeError, match="The name of an agent must be a string"):
        ctx.agent.delete_agent(name)


@pytest.mark.parametrize("strategy", [random_walk, stay])
def test_a_strategy_of_gamms_is_a_plan_that_decides_for_one_agent_after_the_other(ctx, strategy):
    for name in ("b", "c"):
        ctx.agent.create_agent(name, start_node_id=0, team="red")
    ctx.game.command("red", strategy)
    assert ctx.game.run(2).errors == []
    assert ctx.game.plans["red"].function is not strategy


def with_yield(given):
    yield given


async def awaited(given):
    pass


def test_functions_of_which_nothing_would_be_done_are_refused(ctx):
    with pytest.raises(TypeError, match="A rule must not be a generator, and with_yield has a yield"):
        ctx.game.add(with_yield)
    with pytest.raises(TypeError, match="A rule must not be an async def, and awaited is one"):
        ctx.game.add(awaited)
    with pytest.raises(TypeError, match="A strategy must not be a generator"):
        ctx.agent.create_agent("a", start_node_id=0, strategy=with_yield)
    with pytest.raises(
        TypeError, match=r"Collector 'x' must be a function of the context alone, and <lambda>\(\) is not"
    ):
        ctx.game.collect("x", lambda: 1)
    assert (ctx.game.rules, list(ctx.agent.agents)) == ((), [])


def test_an_event_keeps_its_turn(ctx):
    with pytest.raises(ValueError, match="An event has the turn in which it is emitted"):
        ctx.game.emit("met", turn=3)
    assert list(ctx.game.events) == []


def test_an_agent_on_a_node_that_was_removed_is_named(ctx):
    ctx.agent.create_agent("anna", start_node_id=0, strategy=random_walk)
    ctx.graph.graph.remove_node(0)
    with pytest.raises(KeyError, match="Unknown node 0") as caught:
        ctx.game.run(1)
    assert "Agent 'anna' is on node 0, which is not on the map any more" in caught.value.__notes__[0]


def test_an_error_in_a_context_that_a_rule_has_ended_is_unchanged(ctx):
    @ctx.game.add(phase="deeds")
    def end(ctx):
        ctx.terminate()
        raise UnknownName("tower", "north")

    with pytest.raises(UnknownName, match="Unknown tower 'north'"):
        ctx.game.step()


def test_data_that_a_recording_leaves_out_are_warned_about(ctx, heard):
    ctx.record.start(BytesIO())
    ctx.game.data.update(x=object(), y=1)
    ctx.record.stop()
    assert [one for one in heard if "'y'" in one] == []
    assert any(one.startswith("Data of the game has 'x' with something in it that is no plain value") for one in heard)
