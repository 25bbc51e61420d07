"""Numbers outside an action space are refused, and illegal ones in it count as staying."""

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="Gymnasium is not installed")

from gamms import rl
from gamms.errors import BadValue
from gamms.scenario import Scenario

TAG = {"rule": "tag", "with": {"taggers": "red", "tagged": "blue"}}


def scene():
    teams = {team: {"count": 1, "strategy": "gamms.strategies:random_walk"} for team in ("red", "blue")}
    return Scenario(max_turns=2, map={"grid": {"rows": 5, "columns": 5}}, teams=teams, rules=[TAG])


ACTIONS = [
    (
        {},
        np.array([0, 99]),
        "Action 99 of agent 'red_0' in game 1 is not in the action space, of numbers from 0 to 4",
    ),
    ({}, np.array([-7, 0]), "Action -7 of agent 'red_0' in game 0"),
    ({"deeds": True}, np.array([[0, 0], [5, 0]]), r"Action \[5 0\] of agent 'red_0' in game 1 .* from 0 to \[4 2\]"),
    ({"deeds": True}, np.array([[0, 0], [0, 3]]), r"Action \[0 3\] of agent 'red_0' in game 1 .* from 0 to \[4 2\]"),
    ({"deeds": True, "actions": "discrete"}, np.array([15, 0]), "Action 15 of agent 'red_0' in game 0 .* from 0 to 14"),
    ({"moves": "edges"}, np.array([0, 5]), "Action 5 of agent 'red_0' in game 1 .* from 0 to 4"),
    ({"workers": 2}, np.array([0, 5]), "Action 5 of agent 'red_0' in game 1 .* from 0 to 4"),
]


@pytest.mark.parametrize(("options", "actions", "message"), ACTIONS)
def test_numbers_outside_an_action_space_are_refused(options, actions, message):
    options = {**options}
    game = scene()
    if options.pop("deeds", False):
        game = game.replace(settings={"deeds": {"mark": {"colour": ["red", "blue"]}}})
    env = rl.vector_env(game, num_games=2, team="red", **options)
    env.reset(seed=1)
    with pytest.raises(BadValue, match=message):
        env.step(actions)
    env.step(np.zeros_like(actions))
    env.close()


def test_numbers_outside_the_action_space_of_one_game_are_refused_and_masked_ones_stay():
    both = rl.parallel_env(scene(), team="red"), rl.single_agent_env(scene(), agent="red_0")
    for env in both:
        env.reset(seed=1)
        for wrong in (5, 99, -7):
            with pytest.raises(BadValue, match=f"Action {wrong} of agent 'red_0' in game 0 .* 0 to 4"):
                env.step({"red_0": wrong} if env is both[0] else wrong)
    env = both[1]
    corner = next(seed for seed in range(100) if env.reset(seed=[seed])[0]["action_mask"].sum() == 3)
    env.reset(seed=[corner])
    before = env.learners.games.observe("red").node.copy()
    *_, infos = env.step(4)
    assert not infos["is_legal"]
    assert (env.learners.games.observe("red").node == before).all()
    for one in both:
        one.close()


def test_learners_refuse_numbers_outside_their_actions():
    with rl.Learners(scene(), 2, teams="red") as learners:
        learners.begin_all()
        for wrong in (5, -1):
            with pytest.raises(BadValue, match=f"Action {wrong} of agent 'red_0' in game 1 .* 0 to 4"):
                learners.step(np.array([[0], [wrong]]))
