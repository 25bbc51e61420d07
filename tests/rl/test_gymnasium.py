"""Environments in the hands of Gymnasium: how it makes vectors of them, wraps them, and counts episodes."""

import pickle

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="Gymnasium is not installed")

import gymnasium
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from gamms import kernels, rl
from gamms.errors import BadType, BadValue
from gamms.scenario import Scenario

TAG = {"rule": "tag", "with": {"taggers": "red", "tagged": "blue", "then": "eliminate"}}


def scene(**more):
    """Five agents who are tagged out one after the other, by one who walks at random."""
    teams = {"red": {"count": 1, "strategy": "gamms.strategies:random_walk"}, "blue": {"count": 5}}
    given = {"teams": teams, "rules": [TAG, "last_team"], "max_turns": 40, **more}
    return Scenario(map={"grid": {"width": 4, "height": 3}}, **given)


DEEDS = {"settings": {"deeds": {"scan": {"node": "node"}, "rest": None}}}
FLYERS = {
    "teams": {
        "red": {"count": 1, "strategy": "gamms.strategies:random_walk"},
        "blue": {"count": 2, "type": "aerial", "speed": 4},
    }
}


def one_each_turn(turn):
    return turn.before.mask * 1.0


@pytest.mark.parametrize("mode", ["sync", "async", "vector_entry_point"])
def test_gymnasium_makes_the_same_games_in_every_mode(mode):
    games = gymnasium.make_vec("gamms/GridTag-v0", num_envs=2, vectorization_mode=mode, agent="red_1")
    found = [games.reset(seed=4)[0], *(games.step(np.array([k % 3, 1]))[0] for k in range(4))]
    games.close()
    alone = gymnasium.make("gamms/GridTag-v0", agent="red_1")
    seeds = [4, 5]  # Gymnasium gives each environment a seed, and ours plays one run
    if mode == "vector_entry_point":
        seeds = [[seed] for seed in kernels.compute_run_seeds([4, 4], [0, 1], [0, 0])]
    for slot in range(2):
        expected = [alone.reset(seed=seeds[slot])[0], *(alone.step((k % 3, 1)[slot])[0] for k in range(4))]
        for one, other in zip(found, expected, strict=True):
            assert all(np.array_equal(one[key][slot], other[key]) for key in other)
    alone.close()


def test_gymnasium_finds_no_fault_in_plain_observations():
    check_env(
        rl.single_agent_env(scene(**DEEDS), agent="blue_1", mask="info", actions="discrete"), skip_render_check=True
    )


def test_too_many_moves_and_deeds_are_refused():
    many = {"settings": {"deeds": {"paint": {"colour": [f"colour {number}" for number in range(1000)]}}}}
    with pytest.raises(BadValue, match=r"5 moves and 1001 deeds 5005 actions, and 4096 is the limit"):
        rl.vector_env(scene(**many), num_games=2, team="blue", actions="discrete", reward=one_each_turn)
    with pytest.raises(BadValue, match="all that learn here fly"):
        rl.parallel_env(scene(**FLYERS), team="blue", actions="discrete", reward=one_each_turn)
    for wrong in ({"mask": "nowhere"}, {"actions": "flat"}, {"autoreset_mode": "LATER"}, {"autoreset_mode": []}):
        with pytest.raises(BadValue, match=f"{next(iter(wrong))} must be "):
            rl.vector_env(scene(), num_games=2, team="blue", **wrong)


def alone():
    """One agent who is hunted: its game ends with it."""
    teams = {"red": {"count": 1, "strategy": "gamms.strategies:random_walk"}, "blue": {"count": 1}}
    return scene(teams=teams, max_turns=9)


def is_same(one, other):
    """Whether two values are the same: dicts, arrays, and arrays of arrays."""
    if isinstance(one, dict):
        return one.keys() == other.keys() and all(is_same(one[key], other[key]) for key in one)
    return np.array_equal(one, other)


@pytest.mark.parametrize("mask", ["observation", "info"])
@pytest.mark.parametrize("mode", [*AutoresetMode])
def test_games_begin_again_as_in_the_environment_of_gymnasium(mode, mask):
    options = {"agent": "blue_0", "reward": one_each_turn, "mask": mask}
    ours = [rl.vector_env(alone(), num_games=1, autoreset_mode=mode, seed=seed, **options) for seed in (3, 50)]
    theirs = SyncVectorEnv([lambda: rl.single_agent_env(alone(), **options)] * 2, autoreset_mode=mode)
    assert ours[0].metadata["autoreset_mode"] is theirs.metadata["autoreset_mode"] is mode
    for env in ours:
        env.reset(seed=[None])
    theirs.reset(seed=[3, 50])
    ended = np.zeros(2)
    for turn in range(60):
        actions = np.array([turn % 3, turn % 2])
        played = [env.step(actions[slot : slot + 1]) for slot, env in enumerate(ours)]
        expected, *numbers, infos = theirs.step(actions)
        for part, column in enumerate(numbers, 1):
            assert [one[part][0] for one in played] == column.tolist()
        ends = numbers[1] | numbers[2]
        ended += ends
        for slot, one in enumerate(played):
            assert is_same(rows(one[0], 0), rows(expected, slot))
            told = one[4]
            assert (told["action_mask"][0] == infos["action_mask"][slot]).all()
            assert ("final_obs" in told) == (mode is AutoresetMode.SAME_STEP and ends[slot])
            if "final_obs" in told:
                assert is_same(rows(told["final_obs"], 0), infos["final_obs"][slot])
                assert told["_final_obs"].tolist() == told["_final_info"].tolist() == [True]
                assert (told["final_info"]["action_mask"][0] == infos["final_info"]["action_mask"][slot]).all()
        if mode is AutoresetMode.DISABLED and ends.any():
            for env, is_done in zip(ours, ends, strict=True):
                if is_done:
                    with pytest.raises(BadValue, match=r"Game 0 has ended: call reset\(options="):
                        env.step(actions[:1])
                    env.reset(options={"reset_mask": np.array([True])})
            theirs.reset(options={"reset_mask": ends})
    assert ended.min() > 2
    for env in (*ours, theirs):
        env.close()


def rows(observed, slot):
    return {key: column[slot] for key, column in observed.items()} if isinstance(observed, dict) else observed[slot]


@pytest.mark.parametrize("workers", [1, 2])
def test_some_games_begin_again_with_seeds_of_their_own(workers):
    env = rl.vector_env(alone(), num_games=3, agent="blue_0", autoreset_mode="DISABLED", workers=workers)
    single = rl.single_agent_env(alone(), agent="blue_0")

    def first_of(seed):
        return single.reset(seed=[seed])[0]["observation"]

    [later] = kernels.compute_run_seeds([4], [1], [1])
    run = kernels.compute_run_seeds([20] * 3, range(3), [0] * 3)
    observed, _ = env.reset(seed=[9, 4, 4])
    assert (observed["observation"] == np.array([first_of(seed) for seed in (9, 4, 4)])).all()
    first, *_ = env.step(np.array([1, 1, 1]))
    observed, _ = env.reset(seed=[None, None, 77], options={"reset_mask": np.array([False, True, True])})
    assert (observed["observation"] == np.array([first["observation"][0], first_of(later), first_of(77)])).all()
    observed, _ = env.reset(seed=20)
    assert (observed["observation"] == np.array([first_of(seed) for seed in run])).all()
    env.close()


def test_the_slots_of_a_game_begin_together():
    env = rl.vector_env(scene(), num_games=2, team="blue", autoreset_mode="DISABLED")
    env.reset(seed=[3, 3, 3, 3, 3, 8, 8, 8, 8, 8])
    assert env.learners.games.seeds == (3, 8)
    every, is_over = np.zeros(10, np.int64), False
    while not is_over:  # a loop that asks for what has ended plays on
        *_, terminated, truncated, _ = env.step(every)
        ends = terminated | truncated
        if ends.any():
            before = env.learners.games.turn.copy()
            over = env.learners.is_over.copy()
            env.reset(options={"reset_mask": ends})
            assert (env.learners.games.turn == np.where(over, 0, before)).all()
            is_over = over.any()
    env.reset()
    mask = np.arange(10) == 2
    with pytest.raises(BadValue, match="names some slots of game 0, which begin together"):
        env.reset(options={"reset_mask": mask})
    for wrong in ([True] * 10, np.ones(10)):
        with pytest.raises(BadType, match="array of NumPy of booleans"):
            env.reset(options={"reset_mask": wrong})
    for wrong in (np.zeros(10, np.bool_), np.ones(2, np.bool_)):
        with pytest.raises(BadValue, match="at least one of 10 slots"):
            env.reset(options={"reset_mask": wrong})
    with pytest.raises(BadValue, match="seed has 3 seeds, and there are 2 games and 10 slots"):
        env.reset(seed=[1, 2, 3])
    with pytest.raises(BadValue, match=r"slots of game 1 have the seeds \[5, 6, 7, 8, 9\]"):
        env.reset(seed=[0] * 5 + [5, 6, 7, 8, 9])


TEAM = {"team": "blue"}


@pytest.mark.parametrize(("learns", "workers"), [(TEAM, 1), (TEAM, 2), ({"agent": "blue_0"}, 1)])
def test_game_0_of_a_vector_is_rendered_as_the_same_game_alone(learns, workers):
    env = rl.vector_env(scene(), num_games=3, render_mode="rgb_array", workers=workers, **learns)
    is_one = "agent" in learns
    of_one = rl.single_agent_env if is_one else rl.parallel_env
    game = of_one(scene(), render_mode="rgb_array", **learns)
    assert env.render_mode == "rgb_array"
    assert env.metadata["render_fps"] == game.metadata["render_fps"]
    for seed in (5, 8):  # of two games one after the other
        env.reset(seed=seed)
        game.reset(seed=seed)
        for _ in range(2):
            pictures = env.render()
            assert len(pictures) == env.num_envs
            for slot, picture in enumerate(pictures):
                assert np.array_equal(picture, game.render()) == (slot < env.num_agents)
            assert not np.any(pictures[-1])
            env.step(np.ones(env.num_envs, np.int64))
            game.step(1 if is_one else dict.fromkeys(game.agents, 1))
    env.close()
    game.close()


def test_a_vector_without_a_render_mode_shows_nothing_and_another_mode_is_refused(caplog):
    env = rl.vector_env(scene(), num_games=2, team="blue")
    env.reset(seed=1)
    assert env.render() is None
    assert "make the environment with render_mode='rgb_array'" in caplog.text
    env.close()
    with pytest.raises(BadValue, match="render_mode must be None, 'human' or 'rgb_array', not 'film'"):
        rl.vector_env(scene(), num_games=2, team="blue", render_mode="film")


def test_a_window_follows_game_0_of_a_vector(monkeypatch):
    pytest.importorskip("pygame")
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    env = rl.vector_env(scene(), num_games=2, team="blue", render_mode="human")
    for seed in (1, 2):
        env.reset(seed=seed)
        assert env.render() is None
        env.step(np.zeros(env.num_envs, np.int64))
        shown = env.learners.games.context(0)
        assert (shown.game.turn, shown.seed) == (1, env.learners.games.seeds[0])
    env.close()


def test_gymnasium_records_videos_of_game_0(tmp_path):
    pytest.importorskip("moviepy", reason="MoviePy is not installed: pip install moviepy")
    from gymnasium.wrappers.vector import RecordVideo

    games = rl.vector_env(alone(), num_games=2, agent="blue_0", autoreset_mode="NEXT_STEP", render_mode="rgb_array")
    env = RecordVideo(games, str(tmp_path / "videos"), record_first_only=True, episode_trigger=lambda _: True)
    env.reset(seed=1)
    for _ in range(25):
        env.step(np.zeros(2, np.int64))
    env.close()
    assert len([*(tmp_path / "videos").glob("*.mp4")]) > 1


@pytest.mark.parametrize("mode", ["SAME_STEP", "NEXT_STEP", "DISABLED"])
def test_infos_have_the_length_and_the_return_of_each_life(mode):
    games = rl.vector_env(scene(), num_games=4, team="blue", reward=one_each_turn, autoreset_mode=mode)
    games.reset(seed=1)
    lengths = []
    for _ in range(150):
        *_, terminated, truncated, infos = games.step(np.zeros(20, np.int64))
        ends = terminated | truncated
        assert ("life" in infos) == ends.any()
        if ends.any():
            assert np.array_equal(infos["_life"], ends)
            assert np.array_equal(infos["life"]["r"], infos["life"]["l"])
            assert (infos["life"]["l"][ends] > 0).all()
            assert not infos["life"]["l"][~ends].any()
            lengths += infos["life"]["l"][ends].tolist()
        is_over = games.unwrapped.learners.is_over
        if mode == "DISABLED" and is_over.any():
            games.reset(options={"reset_mask": np.repeat(is_over, 5)})
    assert len(lengths) > 40
    assert len({*lengths}) > 10
    assert max(lengths) <= 40


def test_new_lives_begin_where_games_are_reset_and_go_on_in_copies():
    games = rl.vector_env(scene(), num_games=2, team="blue", reward=one_each_turn)

    def play(env, turns):
        """Return the lengths of lives by slot, 0 where none ends, for each turn."""
        infos = [env.step(np.zeros(10, np.int64))[-1] for _ in range(turns)]
        return [one["life"]["l"].tolist() if "life" in one else [0] * 10 for one in infos]

    games.reset(seed=1)
    whole = play(games, 30)
    games.reset(seed=1)
    begun = play(games, 7)
    twin = pickle.loads(pickle.dumps(games))
    assert begun + play(twin, 23) == whole
    assert begun + play(games, 23) == whole
    games.close()
    twin.close()


def test_infos_say_on_which_map_games_are():
    maps = [{"grid": {"width": 4, "height": 3}}, {"grid": {"width": 2, "height": 7}}]
    games = rl.vector_env(scene(), num_games=6, team="blue", maps=maps)
    _, infos = games.reset(seed=1)
    assert len({*infos["map"].tolist()}) == 2
    for _ in range(60):
        assert infos["map"].tolist() == np.repeat(games.unwrapped.learners.games.maps, 5).tolist()
        assert [maps[number] for number in infos["map"]] == infos["map_spec"].tolist()
        *_, infos = games.step(np.zeros(30, np.int64))
    games.close()


def test_gains_are_0_for_scores_that_no_game_has_set():
    asked = []

    def reward(turn):
        asked.append(turn.gains["nothing"].tolist())
        return turn.gains["red"]

    env = rl.vector_env(scene(), num_games=3, team="red", reward=reward)
    env.reset(seed=1)
    _, rewards, *_ = env.step(np.zeros(env.num_envs, np.int64))
    assert asked == [[0.0, 0.0, 0.0]]
    assert rewards.shape == (env.num_envs,)
    env.close()
