"""Turns of learners that the core plays: what it writes is what follows from contexts, with any number of threads."""

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="Gymnasium is not installed")

from gamms import rl
from gamms.errors import BadType, BadValue
from gamms.rl.learners import Learners
from gamms.scenario import Scenario

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


def observed(ctx, name, actions, others):
    """What an agent observes by default, worked out from where the agents of a context are."""
    graph, agent = ctx.graph.graph, ctx.agent.agents[name]
    if not agent.alive:
        return np.zeros(2 + 3 * actions + 4 * others + 1, np.float32)

    def placed(node):  # the grid is 50 m wide and 30 m high
        there = graph.get_node(node)
        return (there.x - 25.0) / 25.0, (there.y - 15.0) / 25.0

    here, (x, y) = graph.get_node(agent.current_node_id), placed(agent.current_node_id)
    moves, seen = [], []
    for node in ctx.game.observation(name)["legal"]:
        moves += [1.0, placed(node)[0] - x, placed(node)[1] - y]
    for other_name, other in sorted(ctx.agent.agents.items()):
        there = graph.get_node(other.current_node_id)
        if other is agent or not other.alive or np.hypot(there.x - here.x, there.y - here.y) > SIGHT_M:
            continue
        dx, dy = placed(other.current_node_id)[0] - x, placed(other.current_node_id)[1] - y
        seen.append((dx * dx + dy * dy, other_name, [1.0, float(other.team == agent.team), dx, dy]))
    entries = [entry for *_, of_other in sorted(seen) for entry in of_other]
    moves += [0.0] * (3 * actions - len(moves))
    entries += [0.0] * (4 * others - len(entries))
    return np.float32([x, y, *moves, *entries, ctx.game.turn / (ctx.game.turn + 100.0)])


def test_environments_say_what_follows_from_a_context():
    given = {}

    def obey(state):
        action = given[state["name"]]
        state["action"] = state["legal"][action if action < len(state["legal"]) else 0]

    def begun(seed):
        return scene().build(seed=seed, strategies={"red": obey})

    names = ["red_0", "red_1", "red_2"]
    env = rl.vector_env(scene(), num_games=4, team="red")
    assert env.learners.games.slow is None
    actions, slots = env.learners.num_actions, slice(3, 6)  # those of game 1
    observation, _ = env.reset(seed=30)
    rng = np.random.default_rng(1)
    seed, ended = 31, 0
    ctx = begun(seed)
    for _ in range(60):
        for values, mask, name in zip(
            observation["observation"][slots], observation["action_mask"][slots], names, strict=True
        ):
            assert values.tolist() == observed(ctx, name, actions, 4).tolist()
            alive = ctx.agent.agents[name].alive
            assert mask.sum() == (len(ctx.game.observation(name)["legal"]) if alive else 1)
        chosen = rng.integers(actions + 1, size=env.num_envs)  # some are not legal, and stay
        given.update(zip(names, chosen[slots].tolist(), strict=True))
        alive, score = [ctx.agent.agents[name].alive for name in names], ctx.game.scores["red"]
        ctx.game.step()
        observation, rewards, terminated, truncated, infos = env.step(chosen)
        is_late = ctx.game.is_over and ctx.game.over["truncated"]
        for slot, (name, was_alive) in enumerate(zip(names, alive, strict=True), 3):
            gain = ctx.game.scores["red"] - score if was_alive else 0.0
            assert rewards[slot] == gain
            assert infos["valid"][slot] == was_alive
            is_out = was_alive and not ctx.agent.agents[name].alive
            assert truncated[slot] == (was_alive and is_late and not is_out)
            assert terminated[slot] == (is_out or (was_alive and ctx.game.is_over and not is_late))
        if ctx.game.is_over:
            for slot, name in enumerate(names, 3):
                if infos["_final_obs"][slot]:
                    final = infos["final_obs"]["observation"][slot]
                    assert final.tolist() == observed(ctx, name, actions, 4).tolist()
            ctx.terminate()
            seed += 4
            ended += 1
            ctx = begun(seed)
    assert ended > 3
    ctx.terminate()
    env.close()


def written(value):
    """Arrays as bytes, in dicts and tuples."""
    if isinstance(value, dict):
        return {key: written(one) for key, one in value.items()}
    if isinstance(value, tuple):
        return [written(one) for one in value]
    return value.tobytes() if isinstance(value, np.ndarray) else value


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
        actions = rng.integers(-1, 6, size=envs[0].num_envs)
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
        assert learners.games.slow is None
        learners.begin_all()
        alone.begin_all()
        rng = np.random.default_rng(5)
        for _ in range(12):
            assert learners.observe().tobytes() == alone.observe().tobytes()
            assert learners.whole().tobytes() == alone.whole().tobytes()
            for name in ("masks", "alive", "is_over"):
                assert getattr(learners, name).tolist() == getattr(alone, name).tolist()
            actions = rng.integers(-1, 6, size=learners.masks.shape[:2])
            played, wanted = learners.step(actions), alone.step(actions)
            assert written(tuple(played)) == written(tuple(wanted))
