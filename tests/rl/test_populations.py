"""Populations play only new pairs, go on in their folders, and take responses."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from gamms import experiment, rl
from gamms.errors import BadValue, Duplicate, UnknownName
from gamms.scenario import Scenario
from gamms.strategies import chase, flee, random_walk, stay

MAPS = {"square": {"grid": {"rows": 4, "columns": 4}}, "long": {"grid": {"rows": 3, "columns": 9}}}


def scene():
    teams = {
        "red": {"agents": [{"name": "red_0", "node": 0}], "sensors": ["eyes"]},
        "blue": {"agents": [{"name": "blue_0", "node": 5}], "sensors": ["eyes"]},
    }
    rules = [
        {"rule": "tag", "with": {"taggers": "red", "tagged": "blue", "score": 1, "then": "eliminate"}},
        "last_team",
    ]
    eyes = {"eyes": {"type": "AGENT"}}
    return Scenario(map=MAPS["square"], max_turns=8, sensors=eyes, teams=teams, rules=rules)


def population(**options):
    return rl.Population(scene(), {"red": [chase, random_walk], "blue": [flee, stay]}, **{"games": 4, **options})


def always(action):
    """A learner of a network that always prefers one action."""

    def learn(env, start):
        entries, actions = env.single_observation_space["observation"].shape[0], env.single_action_space.n
        learn.starts.append(start)
        bias = np.zeros(actions)
        bias[action] = 1.0
        return [(np.zeros((actions, entries)), bias)]

    learn.starts = []
    return learn


def test_payoffs_are_the_mean_leads_in_the_rows_of_an_experiment():
    found = population(maps=MAPS, seed=3)
    vary = {"map": MAPS, "strategies.red": [chase, random_walk], "strategies.blue": [flee, stay]}
    same = experiment.run(scene(), range(3, 7), vary)
    assert found.rows.sha256() == same.sha256()
    for place, payoff in np.ndenumerate(found.payoffs):
        own, other = (list(found.strategies(team))[number] for team, number in zip(found.teams, place, strict=True))
        rows = [row for row in same if (row["strategies.red"], row["strategies.blue"]) == (own, other)]
        assert payoff == pytest.approx(np.mean([row["score.red"] - (row.get("score.blue") or 0) for row in rows]))
    assert 0.0 < found.payoffs.max() <= 1.0
    wins = population(maps=MAPS, seed=3, metric="wins.red")
    assert wins.payoffs == pytest.approx(found.payoffs)


def test_only_new_pairs_are_played(tmp_path):
    asked = []

    def watched(state):
        asked.append(state["turn"])
        state["action"] = state["legal"][0]

    found = population(out=tmp_path)
    before = found.rows
    found.add("blue", watched)
    assert len(found.rows) == len(before) + 8
    assert found.payoffs.shape == (2, 3)
    played = len(asked)
    assert played
    again = population(out=tmp_path)
    again.add("blue", watched)
    assert again.rows.sha256() == found.rows.sha256()
    assert len(asked) == played, "their rows are in the folder"


def test_mixtures_are_pools_with_the_probabilities_of_an_equilibrium():
    found = population()
    assert found.weights("red", "uniform") == dict.fromkeys(found.strategies("red"), 0.5)
    assert list(found.weights("blue", "last").values()) == [0.0, 1.0]
    rows, columns = (np.array(list(found.weights(team).values())) for team in found.teams)
    value = rows @ found.payoffs @ columns
    assert (rows @ found.payoffs).min() == pytest.approx(value)
    assert (found.payoffs @ columns).max() == pytest.approx(value)
    played = scene().play(1, {"red": found.mixture("red", "last"), "blue": found.mixture("blue", "uniform")})
    assert played.turns <= 8


def test_a_learned_response_is_a_lower_bound_that_is_trained_once(tmp_path):
    learner = always(0)
    found = population(out=tmp_path, learner=learner, env={"num_games": 2})
    first = found.responses("red", "learn")
    assert (first.name, first.bound) == ("learn 2", "lower")
    found.add("red", first)
    shares = list(found.weights("blue").values())
    assert found.payoffs[2] @ shares == pytest.approx(first.value)
    second = found.responses("red", "learn")
    assert second.name == "learn 3"
    assert [None if one is None else one.name for one in learner.starts] == [None, "learn 2.safetensors"]
    again = population(out=tmp_path, learner=None)
    assert again.responses("red", "learn").value == first.value, "its policy is in the folder"
    assert population(out=tmp_path, learner=always(1)).exploitability("learn") >= -1.0


def test_a_population_that_was_killed_goes_on_to_the_same_rows(tmp_path):
    whole = population(games=8)
    program = [sys.executable, str(Path(__file__).with_name("killed_population.py")), str(tmp_path)]
    ended = subprocess.run(program, check=False, cwd=Path(__file__).parent, env=os.environ.copy())
    assert ended.returncode == -signal.SIGKILL
    assert (tmp_path / "games").is_dir()
    assert population(games=8, out=tmp_path).rows.sha256() == whole.rows.sha256()


def test_wrong_arguments_of_a_population_are_refused_by_name():
    found = population()
    with pytest.raises(UnknownName, match=r"Unknown team 'rde'\. Did you mean 'red'"):
        found.weights("rde")
    with pytest.raises(UnknownName, match="'bleu'"):
        rl.Population(scene(), {"red": [chase], "bleu": [flee]})
    with pytest.raises(BadValue, match="strategies of both teams"):
        rl.Population(scene(), {"red": [chase]})
    with pytest.raises(Duplicate, match="chase"):
        found.add("red", chase)
    with pytest.raises(BadValue, match="exact=gamms"):
        found.responses("red")
    with pytest.raises(BadValue, match="learner="):
        found.responses("red", "learn")
    with pytest.raises(BadValue, match="one map, not 2"):
        population(maps=MAPS, exact=stay).responses("red")

    def fails(state):
        raise OSError("no legs")

    found.add("red", fails)
    with pytest.raises(BadValue, match="no legs"):
        found.payoffs  # noqa: B018 - which is computed here
