"""Batches of which every part is in the core: the same games as in arrays and alone, with any number of threads."""

import json
from pathlib import Path
from random import Random

import numpy as np
import pytest
from batch_scenes import WALK, plain

import gamms
from gamms.scenario import Scenario

MAPS = Path(__file__).parents[1] / "reference"
TEAMS = ("red", "blue", "green")
STAY = "gamms.strategies:stay"
GAMES = 6


@pytest.fixture(autouse=True)
def core_plays(monkeypatch):
    """Let the core play, interpreted too."""
    monkeypatch.setattr(gamms.core, "is_compiled", True)


@pytest.fixture
def in_arrays(monkeypatch):
    """Return a function that makes a batch of a scenario which arrays play."""

    def made(scenario, *args, **kwargs):
        with monkeypatch.context() as patch:
            patch.setattr(gamms.core, "is_compiled", False)
            return scenario.batch(*args, **kwargs)

    return made


def is_in_core(games):
    return games._engine.is_in_core


def random_scenario(number):
    """Return a random scenario that the core can play."""
    rng = Random(number)
    given = {"generator": {"function": "maps:streets", "with": {"number": number % 12}}}
    base = Scenario(folder=MAPS, map=given, teams={"red": {"count": 1}})
    nodes = base.columns().node_ids.tolist()
    names = list(TEAMS[: rng.randint(2, 3)])
    teams = {}
    for team in names:
        agents = [
            {"name": f"{rng.choice('abcxyz')}{i}{team}", "node": rng.choice(nodes)} for i in range(rng.randint(1, 4))
        ]
        teams[team] = {"agents": agents, "strategy": rng.choice([WALK, WALK, WALK, WALK, STAY])}
    changes = {"teams": teams, "rules": random_rules(rng, names, nodes), "max_turns": rng.choice([9, 30])}
    if rng.random() < 0.6:
        changes["conflicts"] = random_conflicts(rng, names, nodes)
    if rng.random() < 0.3:
        changes["settings"] = {"team_memory": False}
    return base.replace(**changes)


def random_rules(rng, teams, nodes):
    """Return random rules that the core knows."""
    rules = []
    land = {node: rng.choice(teams) for node in nodes if rng.random() < 0.8}
    territory = rng.choice([None, land, "territory"])
    if territory == "territory":
        rules.append({"rule": "gamms.rules.territory:published", "with": {"nodes": land}})
    for _ in range(rng.choice([0, 1, 1, 2])):
        taggers, tagged = rng.sample(teams, 2)
        tag = {"taggers": taggers, "tagged": tagged, "mutual": rng.random() < 0.3, "passing": rng.random() < 0.8}
        tag |= {"then": rng.choice(["respawn", "eliminate"]), "score": rng.choice([0, 1, 2, 2.5])}
        tag["crossing"] = rng.choice([None, True, False])
        if territory is not None and rng.random() < 0.5:
            tag["territory"] = territory
        rules.append({"rule": "tag", "with": tag})
    for key in rng.choice([[], ["flags"], ["flags"], ["flags", "others"]]):
        flags = {team: rng.choice(nodes) for team in rng.sample(teams, rng.randint(1, len(teams)))}
        with_ = {"flags": flags, "goal": rng.choice([None, 1, 3]), "key": key, "passing": rng.random() < 0.8}
        with_ |= {"announce": rng.random() < 0.5, "score": rng.choice([1, 1.5, 0])}
        if territory is not None and rng.random() < 0.6:
            with_["territory"] = territory
        rules.append({"rule": "capture_flag", "with": with_})
    if rng.random() < 0.4:
        given = {"after": rng.randint(1, 3), "times": rng.choice([None, 1, 2]), "teams": rng.choice([None, teams[0]])}
        rules.append({"rule": "respawn", "with": given})
    if rng.random() < 0.2:
        rules.append("last_team")
    if rng.random() < 0.3:
        rules.append({"rule": "none_left", "with": {"team": rng.choice(teams)} | winner_of(rng, teams)})
    if rng.random() < 0.6:
        rules.append({"rule": "time_limit", "with": {"turns": rng.randint(2, 20)} | winner_of(rng, teams)})
    rng.shuffle(rules)
    return rules


def winner_of(rng, teams):
    return rng.choice([{}, {}, {"winner": None}, {"winner": teams[0]}])


def random_conflicts(rng, teams, nodes):
    by_node = {node: rng.choice([0, 1, 2]) for node in rng.sample(nodes, 4)}
    return {
        "capacity": rng.choice([1, 1, 2, None, by_node]),
        "among": rng.choice(["all", "all", "team"]),
        "allow_swaps": rng.random() < 0.6,
        "resolve": rng.choice(["at_random", "at_random", "nobody", {"by_priority": rng.sample(teams, len(teams))}]),
    }


def text_of(games):
    """Return all that is told of the games of a batch, as text: the order of its entries counts, too."""
    results = [games.result(number).to_dict() for number in range(len(games))]
    for one in results:
        del one["timings"]
    table = {name: column.tolist() for name, column in games.table().items()}
    scores = {str(key): [numbers.tolist(), str(numbers.dtype)] for key, numbers in games.scores.items()}
    told = [results, table, dict(sorted(scores.items())), games.turn.tolist(), games.is_over.tolist()]
    return json.dumps(told, default=str)


def columns_of(games):
    return {str(name): column.tolist() for name, column in games.columns().items()}


def play_by_steps(games, rng, teams):
    """Play some turns, of which actions for some teams are given."""
    for _ in range(rng.randint(1, 12)):
        acting = rng.sample(teams, rng.randint(0, len(teams)))
        given = {}
        for team in acting:
            view = games.observe(team)
            given[team] = np.array([[rng.randrange(n) for n in row] for row in view.counts.tolist()], np.int64)
        games.step(given)


def check(number, made_in_arrays):
    """Compare the games of a random scenario, however they are played."""
    scenario, seeds = random_scenario(number), range(number, number + GAMES)
    teams = list(scenario.to_dict()["teams"])
    with scenario.batch(seeds=seeds) as games, made_in_arrays(scenario, seeds=seeds) as others:
        assert is_in_core(games)
        assert not is_in_core(others)
        for one in (games, others):
            play_by_steps(one, Random(number), teams)
        assert text_of(games) == text_of(others)
        assert columns_of(games) == columns_of(others)
        some, seed = [number % GAMES], [number + 99]
        for one in (games, others):
            one.reset(some, seeds=seed)
            one.run()
        assert text_of(games) == text_of(others)
        for one, threads in ((games, 3), (others, 1)):
            one.reset()
            one.run(threads=threads)
        assert text_of(games) == text_of(others)
        assert columns_of(games) == columns_of(others)
        assert plain(games.result(0)) == plain(scenario.play(seed=games.seeds[0]))


@pytest.mark.parametrize("part", range(4))
def test_games_in_the_core_are_those_in_arrays(part, in_arrays):
    number_of_games = 240 if Path(gamms.core.turn.__file__).suffix != ".py" else 40
    for number in range(part, number_of_games, 4):
        check(number, in_arrays)
