"""Opponents that are drawn from a pool for each game, and what environments tell of them."""

import gc
import pickle
import re
import runpy
import sys
import weakref
from functools import partial
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="Gymnasium is not installed")
pytest.importorskip("safetensors", reason="safetensors is not installed")

import gamms
from gamms import array_strategy, kernels, rl
from gamms.errors import BadType, BadValue, MissingFile, UnknownName
from gamms.scenario import Scenario, ScenarioError
from gamms.strategies import chase, flee, pool, random_walk

WALK = "gamms.strategies:random_walk"


def scene(turns=4):
    """Two taggers and two runners, who see to a distance."""
    team = {"count": 2, "strategy": WALK, "sensors": ["eyes"]}
    return Scenario(
        map={"grid": {"rows": 4, "columns": 4}},
        sensors={"eyes": {"type": "AGENT_RANGE", "range_m": 25}},
        teams={"red": team, "blue": team},
        rules=[{"rule": "tag", "with": {"taggers": "red", "tagged": "blue"}}],
        max_turns=turns,
    )


@pytest.fixture
def blue(tmp_path):
    """A pool of two policies of random weights and a strategy."""
    entries = 2 + 5 * 3 + 3 * 5 + 1
    for number in (1, 2):
        weight = np.random.default_rng(number).normal(size=(5, entries))
        rl.save_policy([(weight, np.zeros(5))], tmp_path / f"{number}.safetensors", scene(), team="blue")
    paths = [tmp_path / "1.safetensors", str(tmp_path / "2.safetensors")]
    return {"policies": rl.opponents(paths), "all kinds": rl.opponents({"a": paths[0], "b": paths[1], "c": flee})}


@pytest.mark.parametrize("kind", ["policies", "all kinds"])
def test_policies_and_strategies_are_drawn_as_in_games_alone(blue, kind):
    others = {"blue": blue[kind]}
    with scene(12).batch(10, strategies=others) as games:
        games.run()
        alone = [scene(12).play(seed=seed, strategies=others) for seed in range(10)]
        assert [games.result(number) for number in range(10)] == alone
    assert len({one.row()["opponent.blue"] for one in alone}) > 1


@pytest.mark.parametrize("workers", [1, 2])
def test_infos_of_many_games_name_the_opponents_also_at_the_end(blue, workers):
    others = {"blue": blue["all kinds"]}
    env = rl.vector_env(scene(), num_games=6, team="red", others=others, workers=workers)
    _, infos = env.reset(seed=0)
    seeds = kernels.compute_run_seeds([0] * 12, [*range(6)] * 2, [0] * 6 + [1] * 6)
    drawn = [scene().play(seed=seed, strategies=others).row()["opponent.blue"] for seed in seeds]
    assert infos["opponent.blue"].tolist() == np.repeat(drawn[:6], 2).tolist()
    for _ in range(4):
        *_, infos = env.step(np.zeros(12, int))
    assert infos["final_info"]["opponent.blue"].tolist() == np.repeat(drawn[:6], 2).tolist()
    assert infos["opponent.blue"].tolist() == np.repeat(drawn[6:], 2).tolist()
    env.close()


def test_infos_of_games_in_processes_have_their_maps():
    maps = [{"grid": {"rows": rows, "columns": 4}} for rows in (3, 4, 5)]
    envs = [rl.vector_env(scene(), num_games=5, team="red", maps=maps, workers=workers) for workers in (1, 2)]
    found = []
    for env in envs:
        infos = [env.reset(seed=0)[1]] + [env.step(np.zeros(10, int))[4] for _ in range(9)]
        assert all(info["map_spec"][slot] == maps[info["map"][slot]] for info in infos for slot in range(10))
        found.append([info["map"].tolist() for info in infos])
        env.close()
    assert found[0] == found[1]
    assert found[0][0] != found[0][-1]


def test_infos_of_one_game_name_the_opponent():
    others = {"blue": pool([chase, flee])}
    env = rl.single_agent_env(scene(), agent="red_0", others=others)
    for seed in range(4):
        _, info = env.reset(seed=[seed])
        drawn = scene().play(seed=seed, strategies=others).row()["opponent.blue"]
        assert info["opponent.blue"] == drawn
        assert env.step(0)[4]["opponent.blue"] == drawn
    env.close()
    team = {**scene().to_dict()["teams"]["blue"]}
    team["strategy"] = {
        "function": "gamms.strategies:pool",
        "with": {"members": [{"function": "gamms.strategies:flee"}]},
    }
    env = rl.parallel_env(scene().replace(**{"teams.blue": team}), team="red")
    _, infos = env.reset(seed=1)
    assert infos["red_1"]["opponent.blue"] == "flee"
    env.close()


def test_a_path_without_a_policy_is_named(tmp_path):
    with pytest.raises(MissingFile, match=r"none.safetensors' for a policy"):
        rl.opponents([tmp_path / "none.safetensors"])


def go_last(state):
    """Move to the last legal node: a function that the core does not know."""
    if state["legal"]:
        state["action"] = state["legal"][-1]


@array_strategy
def meet(view):
    """Move toward the first node, which array strategies are asked for game by game."""
    return view.towards(np.zeros_like(view.node))


def places(view):
    """Return where agents are, and whom they see: more than the default observation."""
    return np.stack([view.node, np.broadcast_to(view.turn[:, None], view.node.shape), view.counts], axis=2)


def play_lives(sets, turns=18, **options):
    """Play games whose others change every four turns; return what happened in each, and alone with its others."""
    lives, alone = [], []
    chosen = np.random.default_rng(1).integers(0, 60, (turns, 4, 2))
    with rl.Learners(scene(9), 4, others=sets[0], **options) as learners:
        shape = learners.are_legal(np.zeros((4, len(learners.names)), int)).shape
        learners.begin_all(5)
        going = [_begin_life(learners, game, 0) for game in range(4)]
        for turn in range(turns):
            if turn and turn % 4 == 0:
                learners.set_others(sets[turn // 4 % len(sets)])
            taken = chosen[turn, :, : shape[1]] % np.maximum(learners.masks.sum(axis=2), 1)
            rewards = learners.step(taken).rewards
            for game, life in enumerate(going):
                life["turns"].append((taken[game].tolist(), rewards[game].tolist(), _show_game(learners, game)))
            over = np.flatnonzero(learners.is_over)
            lives += [{**going[game], "result": learners.games.result(game)} for game in over.tolist()]
            if len(over):
                learners.begin_again(over)
            for game in over.tolist():
                going[game] = _begin_life(learners, game, turn // 4 % len(sets))
    for life in lives:
        with rl.Learners(scene(9), others=sets[life["set"]], **options) as learners:
            learners.begin_all([life["seed"]])
            found = _begin_life(learners, 0, life["set"])
            for taken, *_ in life["turns"]:
                rewards = learners.step(np.array([taken])).rewards
                found["turns"].append((taken, rewards[0].tolist(), _show_game(learners, 0)))
            alone.append({**found, "result": learners.games.result(0)})
    return lives, alone


def _begin_life(learners, game, number):
    drawn = {key: column[game] for key, column in learners.drawn.items() if key == "map"}
    return {
        "seed": learners.games.seeds[game],
        "set": number,
        "first": _show_game(learners, game),
        "turns": [],
        **drawn,
    }


def _show_game(learners, game):
    return learners.observe()[game].tolist(), learners.masks[game].tolist(), learners.alive[game].tolist()


MAPS = [{"grid": {"rows": rows, "columns": 4}} for rows in (3, 4)]
KINDS = {
    "the core plays": [{"blue": flee}, {"blue": pool([chase, flee])}, {}, {"blue_1": chase}],
    "some are functions": [{"blue": chase}, {"blue": go_last}, {"blue": meet}],
    "the first is a function": [{"blue": go_last}, {"blue": flee}, {}],
}


@pytest.mark.parametrize("options", [{"teams": "red"}, {"agent": "red_1"}, {"teams": "red", "maps": MAPS}])
@pytest.mark.parametrize("sets", KINDS.values(), ids=KINDS)
def test_games_with_old_and_new_others_are_as_alone(sets, options):
    lives, alone = play_lives(sets, **options)
    assert lives == alone
    assert {life["set"] for life in lives} > {0}


@pytest.mark.parametrize("mode", ["ended", "waiting"])
@pytest.mark.parametrize("options", [{"teams": "red"}, {"agent": "red_1"}, {"teams": "red", "maps": MAPS}])
@pytest.mark.parametrize("sets", KINDS.values(), ids=KINDS)
def test_games_that_begin_in_a_step_have_the_newest_others(sets, options, mode):
    """Their starts were drawn before these others were set."""
    one, other = pair = [rl.Learners(scene(5), 6, others=sets[0], **options) for _ in range(2)]
    chosen = np.random.default_rng(2)
    begun = 0
    for learners in pair:
        learners.begin_all(3)
    for turn in range(14):
        for learners in pair:
            if turn == 2:
                learners.begin_again(np.arange(3))  # they end in other turns than the rest
            if turn % 3 == 2:
                learners.set_others(sets[turn % len(sets)])
        taken = chosen.integers(0, 5, one.masks.shape[:2])
        ended = other.is_over
        found = [one.step(taken, begins=mode), other.step(taken)]
        assert is_same(*map(tuple, found))
        ended = other.is_over if mode == "ended" else ended
        begun += len(one.begun)
        if ended.any():
            one.begin_again(np.setdiff1d(np.flatnonzero(ended), one.begun))
            other.begin_again(np.flatnonzero(ended))
        assert is_same(one.drawn, other.drawn)
        assert one.games.seeds == other.games.seeds
        for game in range(6):
            assert _show_game(one, game) == _show_game(other, game)
            assert one.games.result(game) == other.games.result(game)
    assert begun > 8 or sets is not KINDS["the core plays"]
    for learners in pair:
        learners.close()


def test_functions_of_views_get_games_with_the_same_others():
    options = {"teams": "red", "observation": places, "reward": lambda turn: turn.won}
    lives, alone = play_lives(KINDS["some are functions"], **options)
    assert lives == alone


def test_policies_follow_each_other(blue):
    lives, alone = play_lives([{"blue": blue["policies"]}, {"blue": blue["all kinds"]}], teams="red")
    assert lives == alone


def is_same(one, other):
    """Return whether results of environments are equal: dicts, arrays and tuples of these."""
    if isinstance(one, dict):
        return one.keys() == other.keys() and all(is_same(one[key], other[key]) for key in one)
    if isinstance(one, tuple):
        return all(is_same(*pair) for pair in zip(one, other, strict=True))
    return type(one) is type(other) and np.array_equal(one, other)


def play_twice(env, actions):
    """Return the results of two games of three turns."""
    found = []
    for _ in range(2):
        found += [env.reset(), *(env.step(actions) for _ in range(3))]
    return tuple(found)


MAKERS = {
    "parallel": (partial(rl.parallel_env, team="red"), {"red_0": 1}),
    "one agent": (partial(rl.single_agent_env, agent="red_0"), 1),
    "vector": (partial(rl.vector_env, num_games=3, team="red"), np.ones(6, int)),
    "processes": (partial(rl.vector_env, num_games=3, team="red", workers=2), np.ones(6, int)),
}


@pytest.mark.parametrize(("make", "actions"), MAKERS.values(), ids=MAKERS)
def test_others_set_before_the_first_reset_are_those_of_the_environment(make, actions):
    others = {"blue": pool([chase, flee])}
    envs = [make(scene(), seed=3, others=one) for one in (others, {"blue": random_walk})]
    envs[1].set_others(others)
    assert is_same(*(play_twice(env, actions) for env in envs))
    for env in envs:
        env.close()


@pytest.mark.parametrize(("make", "actions"), MAKERS.values(), ids=MAKERS)
def test_a_copy_goes_on_against_the_same_opponents(make, actions):
    env = make(scene(9), seed=3, others={"blue": chase})
    env.reset()
    env.step(actions)
    env.set_others({"blue": flee})
    if "num_games" in make.keywords:
        env.reset(options={"reset_mask": np.repeat([False, True, False], 2)})
    env.step(actions)
    env.set_others({"blue": pool([chase, random_walk])})
    same = pickle.loads(pickle.dumps(env))
    found = [(one.step(actions), play_twice(one, actions)) for one in (env, same)]
    assert is_same(*found)
    for one in (env, same):
        one.close()


def opponents_of(infos):
    return infos["opponent.blue"].tolist()[::2]


@pytest.mark.parametrize("workers", [1, 2])
def test_infos_name_the_opponent_of_each_game(workers):
    env = rl.vector_env(scene(), num_games=3, team="red", others={"blue": chase}, workers=workers)
    stay = np.zeros(6, int)
    assert opponents_of(env.reset(seed=0)[1]) == ["chase"] * 3
    env.set_others({"blue": pool({"runs": flee})})
    assert opponents_of(env.step(stay)[4]) == ["chase"] * 3
    mask = np.repeat([False, True, False], 2)
    assert opponents_of(env.reset(seed=0, options={"reset_mask": mask})[1]) == ["chase", "runs", "chase"]
    env.set_others({"blue": flee})
    for _ in range(3):
        *_, infos = env.step(stay)
    assert opponents_of(infos) == ["flee", "runs", "flee"]
    assert opponents_of(infos["final_info"]) == ["chase", "runs", "chase"]
    if workers == 1:
        assert env.learners.games.table()["opponent.blue"].tolist() == ["flee", "runs", "flee"]
    env.close()


@pytest.mark.parametrize("workers", [1, 2])
def test_others_that_are_refused_change_nothing(workers):
    wrong = [({"green": chase}, "green"), ({"red_0": flee}, "red_0"), ({"blue": 3}, "3"), (["blue"], "others")]
    maps = [{"grid": {"rows": 3, "columns": rows}} for rows in (3, 5)]
    envs = [rl.vector_env(scene(), num_games=4, team="red", maps=maps, workers=count) for count in (1, workers)]
    for others, named in wrong:
        with pytest.raises((BadType, BadValue, UnknownName, ScenarioError), match=named):
            envs[1].set_others(others)
    first, other = [play_twice(env, np.ones(8, int)) for env in envs]
    assert is_same(first, other)
    for env in envs:
        env.close()
    with pytest.raises(BadValue, match="closed"):
        envs[1].set_others({"blue": chase})


def test_earlier_others_are_kept_only_as_long_as_games_play_them():
    env = rl.vector_env(scene(), num_games=6, team="red")
    env.reset(seed=0)
    known = []
    for number in range(40):
        others = {"blue": LastNode()}
        known.append(weakref.ref(others["blue"]))
        env.set_others(others)
        if number % 5 == 0:
            env.step(np.zeros(12, int))
    del others
    gc.collect()
    playing = 35  # when the games began
    assert [number for number, one in enumerate(known) if one() is not None] == [playing, 39]
    env.close()


class LastNode:
    """A strategy that moves to the last legal node."""

    def __call__(self, state):
        """Set the action."""
        go_last(state)


def test_contexts_and_recordings_of_games_have_their_own_opponents(tmp_path):
    with rl.Learners(scene(9), 2, teams="red", others={"blue": chase}, record=True) as learners:
        learners.begin_all(0)
        learners.set_others({"blue": flee})
        learners.begin(np.array([1]), [1])
        for _ in range(3):
            learners.step(np.zeros((2, 2), int))
        for game in range(2):
            agents = learners.games.context(game).agent
            nodes = {name: agents.get_agent(name).current_node_id for name in ("blue_0", "blue_1")}
            assert nodes == {name: learners.games.result(game).agents[name]["node"] for name in nodes}
            learners.games.record(game, tmp_path / "game.ggr")
            with gamms.recorder.open(tmp_path / "game.ggr") as recording:
                state = recording.state(3).agents
                placed = dict(zip(state["name"].tolist(), state["node"].tolist(), strict=True))
            assert {name: placed[name] for name in nodes} == nodes


def test_the_example_of_self_play_brackets_the_exact_value(monkeypatch, capsys):
    file = Path(__file__).parents[2] / "examples" / "rl" / "self_play.py"
    monkeypatch.setattr(sys, "argv", [str(file), "--quick"])
    example = runpy.run_path(str(file), run_name="__main__")
    exact, *gaps = [
        [float(one) for one in re.findall(r"\d\.\d+", line)] for line in capsys.readouterr().out.splitlines()
    ]
    assert len(gaps) == 2
    assert all(least <= exact[0] <= most for least, most, _ in gaps)
    (most, least), again = [next(example["play_itself"](1, seed=3)) for _ in range(2)]
    assert (most, least) == again


@array_strategy
def meet(view):
    """Go towards the first node: where agents have speeds, array strategies are then called game by game."""
    return view.towards(np.zeros_like(view.node))


@pytest.mark.parametrize("learns", [{"agent": "red_1"}, {"teams": ["red"]}])
def test_games_that_are_played_again_for_new_others_have_the_same_actions(learns):
    fleet = {"count": 2, "speed": 2, "sensors": ["eyes"]}
    game = Scenario(
        map={"grid": {"rows": 4, "columns": 4}},
        max_turns=20,
        sensors={"eyes": {"type": "AGENT_RANGE", "range_m": 25}},
        teams={"red": fleet, "blue": fleet},
        rules=[{"rule": "tag", "with": {"taggers": "red", "tagged": "blue", "then": "respawn"}}],
    )
    changed, same = (rl.Learners(game, 3, others={"blue": chase}, **learns) for _ in range(2))
    for one in (changed, same):
        one.begin_all(33)
    draw = np.random.default_rng(0)
    for turn in range(6):
        actions = draw.integers(0, 60, same.masks.shape[:2]) % np.maximum(same.masks.sum(axis=2), 1)
        if turn == 3:
            changed.set_others({"blue": meet})
        for one in (changed, same):
            one.step(actions)
        np.testing.assert_array_equal(changed.masks[1:], same.masks[1:])
        np.testing.assert_array_equal(changed.observe()[1:], same.observe()[1:])
        if turn == 3:
            changed.begin_again(np.array([0]))
    changed.close()
    same.close()
