"""A team for which nothing decides is named once, wherever its game is played."""

import logging
import pickle

import pytest

from gamms import scenario
from gamms.strategies import random_walk, stay

NOBODY_DECIDES = (
    "No strategy decides for: {}. They stay where they are. "
    "Give them a strategy, or gamms.strategies.stay if this is intended."
)
GAME = {
    "map": {"grid": {"width": 3, "height": 3}},
    "teams": {"red": {"count": 2, "strategy": "gamms.strategies:random_walk"}, "blue": {"count": 1}},
    "max_turns": 3,
}


@pytest.fixture
def said(caplog):
    """The warnings that the program's log has."""
    caplog.set_level(logging.WARNING, "gamms")
    return lambda: [one.getMessage() for one in caplog.records]


def test_a_team_without_a_strategy_is_named_once(ctx, heard):
    ctx.agent.create_agent("anna", start_node_id=0, team="red", strategy=random_walk)
    ctx.agent.create_team("blue", [1, 2])
    ctx.agent.create_agent("carl", start_node_id=3)
    ctx.game.run(2)
    ctx.game.run(2)
    ctx.game.reset(seed=5)
    ctx.game.run(2)
    assert heard == [NOBODY_DECIDES.format("team 'blue', agents without a team")]


def test_a_team_that_comes_later_is_named_by_itself(ctx, heard):
    ctx.agent.create_agent("anna", start_node_id=0, team="red")
    ctx.game.run(1)
    ctx.agent.create_agent("ben", start_node_id=1, team="blue")
    ctx.agent.delete_agent("anna")
    ctx.game.run(1)
    assert heard == [NOBODY_DECIDES.format("team 'red'"), NOBODY_DECIDES.format("team 'blue'")]


def test_turns_of_a_loop_of_ones_own_are_not_warned_about(ctx, heard):
    ctx.agent.create_agent("anna", start_node_id=0, team="red")
    ctx.game.step()
    assert heard == []


def test_a_strategy_of_the_caller_counts(said):
    scenario.Scenario(**GAME).play(seed=1, strategies={"blue": stay})
    scenario.Scenario(**GAME).play(seed=1, strategies={"blue_0": stay})
    assert said() == []


@pytest.mark.parametrize("warn", [True, False])
def test_a_batch_names_the_team_unless_warnings_are_not_wanted(said, warn):
    with scenario.Scenario(**GAME).batch(4) as games:
        games.run(warn=warn)
        games.reset()
        games.run(warn=warn)
    assert said() == [NOBODY_DECIDES.format("team 'blue'")] * warn


def test_a_copy_in_another_process_leaves_it_to_the_one_that_asks(said):
    pickle.loads(pickle.dumps(scenario.Scenario(**GAME))).play(seed=1)
    assert said() == []
