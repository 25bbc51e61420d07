"""Turns of learners that the core plays: what it writes is what follows from contexts, with any number of threads."""

import numpy as np
import pytest

from gamms.game.plan import find_first_called

pytest.importorskip("gymnasium", reason="Gymnasium is not installed")

from gamms import kernels, rl
from gamms.errors import BadType, BadValue
from gamms.rl.learners import Learners
from gamms.scenario import Scenario, ScenarioError

WALK = "gamms.strategies:random_walk"
SIGHT_M = 25.0


def scene(then="respawn", **more):
    """Three agents that learn, of which two see 25 m far, and two that walk and can be tagged."""
    teams = {
        "red": {"count": 3, "strategy": WALK, "sensors": ["near"]},
        "blue": {"count": 2, "strategy": WALK, "sensors": ["near"]},
    }
    tag = {"rule": "tag", "with": {"taggers": "red", "tagged": "blue", "then": then}}
    back = {"rule": "tag", "with": {"taggers": "blue", "tagged": "red", "score": 2.5, "then": "eliminate"}}
    near = {"near": {"type": "AGENT_RANGE", "sensor_range": SIGHT_M}}
    rules = [tag, back, "last_team", {"rule": "time_limit", "with": {"turns": 9}}]
    grid = {"grid": {"width": 6, "height": 4}}
    return Scenario(map=grid, teams=teams, sensors=near, rules=rules, **more)


def written(value):
    """Arrays as bytes, in dicts and tuples."""
    if isinstance(value, dict):
        return {key: written(one) for key, one in value.items()}
    if isinstance(value, tuple):
        return [written(one) for one in value]
    return value.tobytes() if isinstance(value, np.ndarray) else value


MOVING = [
    {},
    {"teams.red.speed": 1.5},
    {"teams.red.speed": 12.0, "settings.speed_unit": "metres"},
    {"teams.red.speed": 25.0, "settings.speed_unit": "metres", "settings.decide": "arrival"},
    {"settings.order": [["red"], ["blue"]]},
    {"settings.legal": "any"},
]


@pytest.mark.parametrize("moving", MOVING, ids=str)
def test_any_number_of_threads_plays_the_same_games_however_agents_move(moving):
    game = scene("eliminate").replace(**moving)
    reward = {"reward": lambda turn: turn.after.mask * 1.0}
    envs = [rl.vector_env(game, num_games=32, team="red", threads=threads, **reward) for threads in (1, 2, 3)]
    first, *others = [written(env.reset(seed=1)) for env in envs]
    assert all(other == first for other in others)
    for _ in range(12):
        first, *others = [written(env.step(np.ones(env.num_envs, np.int64))) for env in envs]
        assert all(other == first for other in others)
    for env in envs:
        env.close()


@pytest.mark.parametrize("moving", [{}, {"teams.red.speed": 2.0}, MOVING[2]], ids=str)
def test_learners_stay_whose_actions_are_illegal_because_their_games_have_played_on(moving):
    stayed = 0
    with Learners(scene().replace(**moving), 20, teams=["red"], seed=1) as learners:
        learners.begin_all()
        for _ in range(3):
            last = learners.games.observe("red").counts - 1
            learners.games.step()
            now = learners.games.observe("red")
            is_illegal = now.mask & (last >= now.counts) & (now["edge"][..., 0] < 0)
            before = now["curr_pos"][is_illegal]
            learners.step(last)
            after = learners.games.observe("red")
            stayed += np.count_nonzero(is_illegal & after.mask)
            was_tagged = ~after.mask[is_illegal]
            assert ((after["curr_pos"][is_illegal] == before) | was_tagged).all()
    assert stayed > 0


@pytest.mark.parametrize("mode", ["SAME_STEP", "NEXT_STEP"])
@pytest.mark.parametrize("options", [{"team": "red"}, {}, {"agent": "red_1"}, {"observation": rl.neighbourhood(2)}])
def test_any_number_of_threads_plays_the_same_games(mode, options):
    envs = [
        rl.vector_env(scene("eliminate"), num_games=5, autoreset_mode=mode, threads=threads, **options)
        for threads in (1, 2, 9)
    ]
    first, *others = [written(env.reset(seed=4)) for env in envs]
    assert all(other == first for other in others)
    rng = np.random.default_rng(2)
    for _ in range(25):
        actions = rng.integers(0, 5, size=envs[0].num_envs)
        first, *others = [written(env.step(actions)) for env in envs]
        assert all(other == first for other in others)
    for env in envs:
        env.close()


@pytest.mark.parametrize("threads", [0, -2, 1.5, "two", None])
def test_threads_that_are_no_number_from_one_on_are_refused(threads):
    with pytest.raises((BadType, BadValue), match="threads"):
        rl.vector_env(scene(), num_games=2, threads=threads)


@pytest.mark.parametrize("options", [{"teams": "red"}, {"agent": "red_2"}])
def test_learners_in_the_core_are_those_of_contexts(options):
    with (
        Learners(scene("eliminate"), 4, seed=3, **options) as learners,
        Learners(scene("eliminate").replace(**{"channels.unused": {"range_m": 1.0}}), 4, seed=3, **options) as alone,
    ):
        assert find_first_called(learners.games.game, learners.games.roster) is None
        learners.begin_all()
        alone.begin_all()
        rng = np.random.default_rng(5)
        for _ in range(12):
            assert learners.observe().tobytes() == alone.observe().tobytes()
            assert learners.whole().tobytes() == alone.whole().tobytes()
            for name in ("masks", "alive", "is_over"):
                assert getattr(learners, name).tolist() == getattr(alone, name).tolist()
            actions = rng.integers(0, learners.num_actions, size=learners.masks.shape[:2])
            played, wanted = learners.step(actions), alone.step(actions)
            assert written(tuple(played)) == written(tuple(wanted))


@pytest.mark.parametrize("first", ["time_limit", "none_left"])
@pytest.mark.parametrize("then", ["eliminate", "respawn"])
def test_an_event_in_the_last_turn_terminates_a_game_and_its_time_limit_alone_truncates_it(first, then):
    """Both learners and the agent that they tag stand on one node; with "respawn" it is never out."""
    teams = {
        "red": {"agents": [{"name": "red_1", "node": 0}, {"name": "red_2", "node": 0}]},
        "blue": {"agents": [{"name": "blue_1", "node": 0}]},
    }
    tag = {"rule": "tag", "with": {"taggers": "red", "tagged": "blue", "then": then}}
    ends = [{"rule": "time_limit", "with": {"turns": 1}}, {"rule": "none_left", "with": {"team": "blue"}}]
    rules = [tag, *(ends if first == "time_limit" else reversed(ends))]
    game = Scenario(map={"grid": {"width": 3, "height": 1}}, teams=teams, rules=rules)
    with Learners(game, 2, teams="red") as learners:
        learners.begin_all(1)
        played = learners.step(np.zeros((2, 2), np.int64))
        is_out = then == "eliminate"
        assert (played.terminated == is_out).all()
        assert (played.truncated != is_out).all()
        assert (learners.games.truncated != is_out).all()
        assert (played.rewards == learners.games.scores["red"][:, None]).all()
        assert learners.is_over.all()


def test_an_observation_of_ones_own_gets_the_legal_actions_and_ends_of_the_default_one():
    """The core writes them in both cases; here they are compared with what views and tables say."""

    def nodes(view):
        return view.node[..., None].astype(np.float32)

    with Learners(scene("eliminate"), 6, teams="red", observation=nodes) as own:
        own.begin_all(3)
        for _ in range(9):
            view = own.games.observe("red")
            shown = np.where(own.is_over[:, None], 1, np.where(view.mask, view.counts, 1))
            assert (own.masks.sum(axis=2) == shown).all()
            assert (own.alive == view.mask).all()
            assert (own.observe()[..., 0] == view.node).all()
            before = view.mask & ~own.is_over[:, None]
            played = own.step(np.full((6, 3), 1))
            now = own.games.observe("red").mask
            assert (played.valid == before).all()
            assert (played.terminated == (before & (~now | own.games.terminated[:, None]))).all()
            assert (played.truncated == (before & now & own.games.truncated[:, None])).all()
        assert own.is_over.all()


@pytest.mark.parametrize("mode", ["ended", "waiting"])
@pytest.mark.parametrize("maps", [None, [{"grid": {"width": 6, "height": 4}}, {"grid": {"width": 3, "height": 5}}]])
def test_games_that_begin_in_a_step_are_those_that_reset_begins(mode, maps):
    learners, others = (Learners(scene("eliminate"), 12, seed=3, maps=maps) for _ in range(2))
    learners.begin_all()
    others.begin_all()
    rng = np.random.default_rng(5)
    number = 0
    for _ in range(40):
        actions = rng.integers(0, learners.num_actions, size=learners.masks.shape[:2])
        was_over = others.is_over
        played, wanted = learners.step(actions, begins=mode), others.step(actions)
        assert written(tuple(played)) == written(tuple(wanted))
        seen, masks = others.observe()[learners.begun], others.masks[learners.begun]
        if mode == "ended" and len(learners.begun):
            assert [one.tolist() for one in learners.observe_ended()] == [seen.tolist(), masks.tolist()]
        ended = others.is_over if mode == "ended" else was_over
        assert ended[learners.begun].all()
        number += len(learners.begun)
        rest = np.setdiff1d(np.flatnonzero(ended), learners.begun)
        if len(rest):
            learners.begin_again(rest)
        if ended.any():
            others.begin_again(np.flatnonzero(ended))
        assert learners.observe().tobytes() == others.observe().tobytes()
        assert learners.masks.tolist() == others.masks.tolist()
        assert learners.games.seeds == others.games.seeds
        assert written(learners.games.table()) == written(others.games.table())
        assert [learners.games.result(game) for game in range(3)] == [others.games.result(game) for game in range(3)]
    assert number > 20
    learners.games.reset()
    others.games.reset()
    assert (learners.games.observe("red", map=0).node == others.games.observe("red", map=0).node).all()
    learners.close()
    others.close()


def test_agents_that_do_not_fit_are_reported_when_their_game_begins():
    game = scene(max_turns=2).replace(**{"teams.blue.from": {"team": "red", "at_least": 25.0}})
    env = rl.vector_env(game, num_games=1, team="red")
    run = 4  # the first with room for blue, far from red, in three games but not in the fourth
    seeds = kernels.compute_run_seeds([run] * 4, [0] * 4, range(4))
    env.reset(seed=run)
    stay = np.zeros(env.num_envs, np.int64)
    played = []
    for _ in range(5):
        env.step(stay)
        played += env.learners.games.seeds
    assert played == [seeds[number] for number in (0, 1, 1, 2, 2)]
    with pytest.raises(ScenarioError, match=f"with the seed {seeds[3]}"):
        env.step(stay)
    env.close()
