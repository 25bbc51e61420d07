"""Populations play only new pairs, go on in their folders, and take responses."""

import os
import signal
import subprocess
import sys
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import safetensors.numpy

from gamms import experiment, rl
from gamms.errors import BadType, BadValue, Duplicate, MissingExtra, UnknownName
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
    asked = tmp_path / "asked"
    name = str(asked)  # a text, because rows know the content of a path's file

    def watched(state):
        with open(name, "a") as file:  # noqa: PTH123
            file.write("1")
        state["action"] = state["legal"][0]

    found = population(out=tmp_path)
    before = found.rows
    found.add("blue", watched)
    assert len(found.rows) == len(before) + 8
    assert found.payoffs.shape == (2, 3)
    played = asked.read_text()
    assert played
    again = population(out=tmp_path)
    again.add("blue", watched)
    assert again.rows.sha256() == found.rows.sha256()
    assert asked.read_text() == played, "their rows are in the folder"


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
    assert (first.name, first.bound) == ("learn 2 to nash of 2", "lower")
    with pytest.raises(BadValue, match="'learn 2 to nash of 2' is of team 'red', not of 'blue'"):
        found.add("blue", first)
    found.add("red", first)
    shares = list(found.weights("blue").values())
    assert found.payoffs[2] @ shares == pytest.approx(first.value)
    second = found.responses("red", "learn")
    assert second.name == "learn 3 to nash of 2"
    assert [None if one is None else one.stem for one in learner.starts] == [None, first.name]
    again = population(out=tmp_path, learner=None)
    assert again.responses("red", "learn").value == first.value, "its policy is in the folder"
    assert population(out=tmp_path, learner=always(1)).exploitability("learn") >= -1.0


def test_a_response_to_another_mixture_is_another_policy():
    learner = always(0)
    found = population(learner=learner, env={"num_games": 2})
    to_nash, to_last = (found.responses("red", "learn", to=to) for to in ("nash", "last"))
    found.add("blue", random_walk)
    later = found.responses("red", "learn")
    assert len({to_nash.name, to_last.name, later.name}) == 3
    assert learner.starts == [None, None, None], "none of them is a member"


def grown(out):
    """A population that has learned for two rounds."""
    found = population(out=out, learner=always(0), env={"num_games": 2}, games=1)
    for _ in range(2):
        for team, response in [(team, found.responses(team, "learn")) for team in found.teams]:
            found.add(team, response)
    return found


@pytest.mark.parametrize("moment", ["training", "games of a response"])
def test_a_population_that_was_killed_goes_on_to_the_same_rows(moment, tmp_path):
    program = [sys.executable, str(Path(__file__).with_name("killed_population.py")), moment, str(tmp_path / "killed")]
    ended = subprocess.run(program, check=False, cwd=Path(__file__).parent, env=os.environ.copy())
    assert ended.returncode == -signal.SIGKILL
    assert (tmp_path / "killed" / "games").is_dir()
    again, whole = (grown(tmp_path / name) for name in ("killed", "whole"))
    assert again.rows.sha256() == whole.rows.sha256()
    policies = [sorted((tmp_path / name / "policies").rglob("*.safetensors")) for name in ("killed", "whole")]
    assert [file.read_bytes() for file in policies[0]] == [file.read_bytes() for file in policies[1]]


def test_responses_to_wins_are_rewarded_by_wins():
    def learn(env, start):
        env.reset(seed=0)
        for _ in range(20):
            _, rewards, *_ = env.step(np.zeros(2, int))
            found.append(rewards)
        return always(0)(env, start)

    found = []
    both = {"red": [chase], "blue": [stay]}
    played = rl.Population(scene(), both, metric="wins.red", learner=learn, env={"num_games": 2}, games=1)
    played.responses("blue", "learn")
    assert set(np.concatenate(found).tolist()) == {0.0, -1.0}, "red catches who stays, and blue pays"


def test_the_learner_by_ppo_needs_pytorch(monkeypatch):
    monkeypatch.setitem(sys.modules, "torch", None)
    with pytest.raises(MissingExtra, match=r"rl\.ppo_learner needs an optional library \(extra 'torch'\)"):
        rl.ppo_learner(None)


def test_ppo_learns_to_catch_who_stays_and_goes_on_from_its_last_policy(tmp_path):
    pytest.importorskip("torch", reason='PyTorch is not installed: pip install ".[torch]"')
    learner = partial(rl.ppo_learner, steps=8_000, seed=1)
    found = [population(out=tmp_path / name, learner=learner, games=8) for name in "ab"]
    caught = [one.responses("red", "learn", to="last") for one in found]
    assert [(one.value, one.bound) for one in caught] == [(1.0, "lower")] * 2
    files = [tmp_path / name / "policies" / "red" / f"{caught[0].name}.safetensors" for name in "ab"]
    assert files[0].read_bytes() == files[1].read_bytes(), "the same seeds give the same network"
    env = rl.vector_env(scene(), num_games=4, team="red", others={"blue": stay})
    with pytest.raises(BadValue, match="has other layers"):
        rl.ppo_learner(env, files[0], width=16)
    on = rl.ppo_learner(env, files[0], steps=1, rate=0.0)
    rl.save_policy(on, tmp_path / "on.safetensors", env)
    weights = [safetensors.numpy.load_file(file) for file in (files[0], tmp_path / "on.safetensors")]
    assert all((weights[0][name] == weights[1][name]).all() for name in weights[0])
    env.close()


def test_ppo_learns_deeds_and_refuses_agents_that_fly():
    pytest.importorskip("torch", reason='PyTorch is not installed: pip install ".[torch]"')
    deeds = scene().replace(settings={"deeds": {"rest": None, "call": {"whom": "agent"}}})
    env = rl.vector_env(deeds, num_games=4, team="red", others={"blue": stay}, mask="info")
    network = rl.ppo_learner(env, steps=1)
    assert network[-1].out_features == env.single_action_space.nvec.sum()
    env.close()
    env = rl.vector_env(scene().replace(**{"teams.red.type": "aerial", "teams.red.speed": 8}), num_games=1, team="red")
    with pytest.raises(BadValue, match="agents that fly"):
        rl.ppo_learner(env)
    env.close()


def test_a_metric_that_no_game_has_is_refused():
    with pytest.raises(UnknownName, match=r"Unknown metric 'wins\.rd'\. Did you mean 'wins\.red'"):
        population(metric="wins.rd")
    with pytest.raises(UnknownName, match="Unknown column of numbers 'foo'"):
        population(metric="foo").payoffs  # noqa: B018
    assert np.isfinite(population(metric="score.blue").payoffs).all()  # nobody has scored


def test_wrong_arguments_of_a_population_are_refused_by_name():
    for name in ("exact", "learner"):
        with pytest.raises(BadType, match=f"{name} must be a function, not 3"):
            population(**{name: 3})
    with pytest.raises(BadValue, match="to must be 'nash' or 'uniform' or 'last', not 'nsh'"):
        population().responses("red", to="nsh")
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
