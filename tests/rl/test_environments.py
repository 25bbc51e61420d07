"""Scenarios as environments of PettingZoo and Gymnasium."""

import warnings
from contextlib import closing
from functools import partial

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="Gymnasium is not installed")
pytest.importorskip("pettingzoo", reason="PettingZoo is not installed")

import gymnasium
from gymnasium.utils.env_checker import check_env

with warnings.catch_warnings():
    warnings.simplefilter("ignore", DeprecationWarning)  # importing the tests of PettingZoo makes a game the old way
    from pettingzoo.test import max_cycles_test, parallel_api_test, parallel_seed_test, render_test
    from pettingzoo.utils.conversions import parallel_to_aec

import gamms
from gamms import recorder, rl
from gamms.errors import BadType, BadValue, NoDisplay, UnknownName
from gamms.rl.learners import Learners
from gamms.scenario import Scenario

TAG = {"rule": "tag", "with": {"taggers": "red", "tagged": "blue", "then": "eliminate"}}
WALK = "gamms.strategies:random_walk"


def scene(rules=(TAG, "last_team"), max_turns=12, **more):
    """Two taggers with sensors and two runners on a grid."""
    teams = {"red": {"count": 2, "strategy": WALK, "sensors": ["near"]}, "blue": {"count": 2, "strategy": WALK}}
    near = {"near": {"type": "AGENT_RANGE", "sensor_range": 30}}
    given = {"teams": teams, "sensors": near, "rules": list(rules), "max_turns": max_turns, **more}
    return Scenario(name="two on two", **{"map": {"grid": {"width": 4, "height": 4}}, **given})


@pytest.mark.parametrize("team", [None, "red", ["blue", "red"]])
def test_pettingzoo_finds_no_fault_in_the_environment_of_a_team(team, capsys):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        parallel_api_test(rl.parallel_env(scene(), team=team), num_cycles=30)
        parallel_seed_test(lambda: rl.parallel_env(scene(), team=team), num_cycles=15)
    assert "Passed" in capsys.readouterr().out


COME = """
def come(ctx):
    if ctx.game.turn == 2 + ctx.seed % 3:
        first, here = ctx.agent.agents["red_0"], ctx.seed % 16
        ctx.agent.create_agent(
            "red_2", start_node_id=here, team="red", strategy=first.strategy, sensors=dict(first.sensors)
        )
"""


def coming(tmp_path, **more):
    """The scene, with a red agent that comes after some turns, by the seed."""
    (tmp_path / "coming.py").write_text(COME)
    return scene([TAG, {"rule": "coming:come"}, "last_team"], max_turns=9, folder=tmp_path, **more)


def test_agents_that_come_learn_where_places_are_reserved(tmp_path, capsys):
    env = rl.parallel_env(coming(tmp_path), team="red", most_agents={"red": 3})
    games = rl.vector_env(coming(tmp_path), num_games=3, team="red", most_agents={"red": 3})
    assert env.possible_agents == ["red_0", "red_1", "red_2"]
    has_come = 0
    for game in range(3):
        many, infos = games.reset(seed=1)
        observed, _ = env.reset(seed=[games.learners.games.seeds[game]])
        assert env.agents == ["red_0", "red_1"]
        while env.agents:
            actions = np.random.default_rng(game).integers(infos["action_mask"].sum(axis=1))
            slots, before = {name: 3 * game + int(name[-1]) for name in env.agents}, env.agents
            assert all(
                np.array_equal(many["observation"][slots[name]], observed[name]["observation"]) for name in slots
            )
            observed, rewards, terminated, truncated, _ = env.step(
                {name: actions[slot] for name, slot in slots.items()}
            )
            many, *played, infos = games.step(actions)
            assert infos["valid"][3 * game : 3 * game + 3].tolist() == [name in slots for name in env.possible_agents]
            for of_one, of_all in zip((rewards, terminated, truncated), played, strict=True):
                assert all(of_one[name] == of_all[slots[name]] for name in slots)
            if "red_2" in env.agents and "red_2" not in before:
                has_come += 1
                assert (rewards["red_2"], terminated["red_2"], truncated["red_2"]) == (0.0, False, False)
    assert has_come > 1
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", "No agents present")  # the game may end before the last one has come
        parallel_api_test(env, num_cycles=30)
    assert "Passed" in capsys.readouterr().out


def test_deeds_name_agents_once_they_have_come(tmp_path):
    game = coming(tmp_path, settings={"deeds": {"help": {"whom": "agent"}}})
    games = rl.vector_env(game, num_games=1, team="red", most_agents={"red": 3}, seed=5)
    _, infos = games.reset(seed=[5])
    names = games.learners.deeds.names
    at = 5 + names.index("help(whom='red_2')")
    assert not infos["action_mask"][0, at]
    for _ in range(5):
        _, _, _, _, infos = games.step(np.zeros((3, 2), int))
    assert infos["action_mask"][0, at]


def test_gymnasium_finds_no_fault_in_the_environment_of_one_agent(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(rl.single_agent_env(scene(), agent="red_1"))


@pytest.fixture
def without_display(monkeypatch):
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER", "SDL_VIDEO_DRIVER"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr("sys.platform", "linux")


@pytest.mark.parametrize("name", [None, "GridTag", "CaptureTheFlag", "HelsinkiPursuit"])
def test_gymnasium_finds_no_fault_without_a_display(without_display, name):
    env = gymnasium.make(f"gamms/{name}-v0").unwrapped if name else rl.single_agent_env(scene(), agent="red_1")
    assert env.metadata["render_modes"] == ["rgb_array"]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env)
    env.close()


def test_without_a_display_no_environment_offers_a_window_and_asking_for_one_is_refused(without_display):
    env = rl.parallel_env(scene(), team="red")
    assert env.metadata["render_modes"] == ["rgb_array"]
    env.close()
    for make in (partial(rl.parallel_env, team="red"), partial(rl.single_agent_env, agent="red_1")):
        with pytest.raises(NoDisplay):
            make(scene(), render_mode="human")


@pytest.mark.parametrize("variable", ["DISPLAY", "WAYLAND_DISPLAY", "SDL_VIDEODRIVER"])
def test_with_a_display_environments_offer_a_window(without_display, monkeypatch, variable):
    monkeypatch.setenv(variable, "dummy")
    env = rl.parallel_env(scene(), team="red")
    assert env.metadata["render_modes"] == ["human", "rgb_array"]
    env.close()


@pytest.mark.parametrize("name", ["GridTag", "CaptureTheFlag", "Pursuit", "Competition", "HelsinkiPursuit"])
def test_scenarios_that_come_with_gamms_have_names_for_gymnasium(name):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(gymnasium.make(f"gamms/{name}-v0").unwrapped, skip_render_check=True)
        games = gymnasium.make_vec(f"gamms/{name}-v0", num_envs=2)
    observations, infos = games.reset(seed=1)
    assert observations["action_mask"].shape == (2, games.single_action_space.n)
    assert infos["valid"].tolist() == [True, True]
    games.close()


def test_games_on_several_maps_are_those_on_each_map_alone():
    maps = [{"grid": {"width": width, "height": 4}} for width in (3, 5, 9)]
    rules = [{**TAG, "with": {**TAG["with"], "then": "respawn"}}]
    games = rl.vector_env(scene(rules), num_games=9, team="blue", seed=5, maps=maps)
    alone = [
        rl.vector_env(scene(rules, map=maps[number]), num_games=1, team="blue")
        for number in games.learners.games.maps.tolist()
    ]
    assert {*games.learners.games.maps.tolist()} == {0, 1, 2}
    observed, _ = games.reset()
    expected = [one.reset(seed=[seed])[0] for one, seed in zip(alone, games.learners.games.seeds, strict=True)]
    for _ in range(8):
        for name, values in observed.items():
            assert np.array_equal(values, np.concatenate([one[name] for one in expected]))
        masks = observed["action_mask"].reshape(9, 2, -1)
        actions = masks.shape[-1] - 1 - masks[..., ::-1].argmax(axis=-1)
        observed, rewards, *_ = games.step(actions.reshape(-1))
        played = [one.step(actions[game]) for game, one in enumerate(alone)]
        expected = [one for one, *_ in played]
        assert rewards.tolist() == [reward for _, of_game, *_ in played for reward in of_game]


def test_an_agent_that_is_out_leaves_and_its_slot_only_stays():
    rules = [{**TAG, "with": {**TAG["with"], "metres": 1000}}]
    env = rl.parallel_env(scene(rules), team="blue")
    env.reset(seed=1)
    _, rewards, terminated, truncated, _ = env.step({})
    assert terminated == {"blue_0": True, "blue_1": True}
    assert not any(truncated.values())
    assert env.agents == []
    games = rl.vector_env(scene(rules), num_games=2, team="blue")
    games.reset(seed=1)
    games.step(np.zeros(4, int))
    observations, rewards, _, _, infos = games.step(np.full(4, 3))
    assert not infos["valid"].any()
    assert not rewards.any()
    assert not observations["observation"].any()
    assert observations["action_mask"].sum(axis=1).tolist() == [1, 1, 1, 1]


def test_an_end_by_time_is_truncation_and_one_by_a_rule_termination():
    env = rl.parallel_env(scene(rules=[TAG], max_turns=1), team="red")
    env.reset(seed=1)
    _, _, terminated, truncated, _ = env.step({})
    assert (set(terminated.values()), set(truncated.values())) == ({False}, {True})


@pytest.mark.parametrize("wrong", [np.nan, np.inf])
def test_a_reward_that_is_no_finite_number_is_refused_unless_it_is_that_of_the_dead(wrong):
    games = rl.vector_env(scene(), num_games=2, team="red", reward=lambda _: np.array([[1.0, 2.0], [3.0, wrong]]))
    games.reset(seed=1)
    with pytest.raises(BadValue, match=rf"reward must give finite numbers, not {wrong} for agent 'red_1' in game 1"):
        games.step(np.zeros(4, int))
    deadly = scene([{**TAG, "with": {**TAG["with"], "metres": 1000}}])
    dead = rl.vector_env(deadly, num_games=1, team="blue", reward=lambda turn: np.where(turn.before.mask, 1.0, wrong))
    dead.reset(seed=1)
    assert [dead.step(np.zeros(2, int))[1].tolist() for _ in range(2)] == [[1.0, 1.0], [0.0, 0.0]]


def remain(state):
    state["action"] = state["legal"][0]


def test_a_reward_gets_zeros_for_a_score_that_no_game_has_set():
    env = rl.vector_env(scene(), num_games=2, team="red", reward=lambda turn: turn.gains["nothing"] + 1.0)
    env.reset(seed=1)
    assert env.step(np.zeros(4, int))[1].tolist() == [1.0] * 4
    env.close()


def test_a_reward_knows_who_has_won_and_why():
    told = []

    def of_the_end(turn):
        told.append((turn.winner.tolist(), turn.reason.tolist()))
        return np.where(turn.winner == turn.team, 5.0, np.where(turn.reason == "max_turns", -1.0, 0.0))[:, None]

    seeds, game = range(20, 26), scene(max_turns=6)
    expected = [game.play(seed=seed, strategies={"red": remain}) for seed in seeds]
    assert {result.winner for result in expected} == {"red", None}
    for seed, result in zip(seeds, expected, strict=True):
        for env in (
            rl.parallel_env(game, team="red", reward=of_the_end),
            rl.single_agent_env(game, agent="red_0", others={"red": remain}, reward=of_the_end),
        ):
            told.clear()
            env.reset(seed=[seed])
            action = {} if hasattr(env, "agents") else 0
            rewards = [env.step(action)[1] for _ in range(result.turns)]
            assert told == [([None], [None])] * (result.turns - 1) + [([result.winner], [result.reason])]
            paid = [sum(one.values()) / 2 if isinstance(one, dict) else one for one in rewards]
            assert paid == [0.0] * (result.turns - 1) + [5.0 if result.winner == "red" else -1.0]
            env.close()
    games = rl.vector_env(game, num_games=len(seeds), team="red", reward=of_the_end)
    games.reset(seed=[*seeds])
    rewards = np.array([games.step(np.zeros(games.num_envs, int))[1] for _ in range(6)])[:, ::2]
    for number, result in enumerate(expected):
        assert rewards[result.turns - 1, number] == (5.0 if result.winner == "red" else -1.0)
        assert not rewards[: result.turns - 1, number].any()
    games.close()


def test_an_observation_that_compares_games_gets_all_of_them_when_some_begin_again():
    games = rl.vector_env(
        scene(), num_games=3, observation=lambda view: np.full((*view.node.shape, 1), len(view.games))
    )
    games.reset(seed=1)
    assert games.learners.observe(np.array([1]))[..., 0].tolist() == [[3] * 4]


def test_observations_may_be_yes_and_no(caplog):
    env = rl.parallel_env(scene(), team="red", observation=lambda view: view["xy"] > 20.0)
    observed, _ = env.reset(seed=1)
    space = env.observation_space("red_0")["observation"]
    assert (space.low.tolist(), space.high.tolist(), space.dtype) == ([0, 0], [1, 1], np.int8)
    assert space.contains(observed["red_0"]["observation"])
    assert env.render() is None
    assert "make the environment with render_mode='rgb_array'" in caplog.text


def test_wrong_arguments_are_refused_by_name():
    with pytest.raises(BadValue, match="give reward="):
        rl.parallel_env(scene(rules=["last_team"]))
    with pytest.raises(UnknownName, match="red"):
        rl.parallel_env(scene(), team="rde")
    with pytest.raises(UnknownName, match="red_1"):
        rl.single_agent_env(scene(), agent="red_7")
    with pytest.raises(BadValue, match="render_mode must be None, 'human' or 'rgb_array', not 'film'"):
        rl.parallel_env(scene(), render_mode="film")
    with pytest.raises(BadValue, match="team names no team"):
        rl.vector_env(scene(), num_games=2, team=[])
    with pytest.raises(BadValue, match="'red_0' is of the team 'red': give agent= without team="):
        rl.vector_env(scene(), num_games=2, team="blue", agent="red_0")
    with pytest.raises(BadType, match=r"call it, rl.graph\(\)"):
        rl.vector_env(scene(), num_games=2, observation=rl.graph)
    with pytest.raises(BadType, match=r"call it, rl.neighbourhood\(2\)"):
        rl.vector_env(scene(), num_games=2, observation=rl.neighbourhood)
    games = rl.vector_env(scene(), num_games=2, team="red")
    games.reset()
    for actions in (np.zeros(3, int), np.zeros(4), [["a"] * 4], None):
        with pytest.raises(BadValue, match="Actions are"):
            games.step(actions)
    with pytest.raises(UnknownName, match="Unknown agent that learns 'red_9'"):
        rl.parallel_env(scene(), team="red").step({"red_9": 1})
    with pytest.raises(BadType, match="reward must be a function"):
        rl.vector_env(scene(), num_games=2, reward=3)
    games = rl.vector_env(scene(), num_games=2, team="red", reward=lambda _: np.zeros(3))
    games.reset()
    with pytest.raises(BadValue, match=r"reward must give numbers for 2 games and 2 agents"):
        games.step(np.zeros(4, int))
    with pytest.raises(BadType, match=r"gamms.scenario.load\(file\)"):
        rl.parallel_env("tag.yaml")


def test_no_turn_is_played_before_a_game_has_begun():
    env, games = rl.single_agent_env(scene(), agent="red_0"), rl.vector_env(scene(), num_games=2, team="red")
    for step in (partial(env.step, 0), partial(rl.parallel_env(scene()).step, {}), partial(games.step, [0] * 4)):
        with pytest.raises(BadValue, match=r"No game has begun: call reset\(\)"):
            step()
    env.reset()
    env.step(0)


class Module:
    """What the tests of PettingZoo call, made of a scenario."""

    @staticmethod
    def parallel_env(max_cycles=12, render_mode=None):
        return rl.parallel_env(scene(rules=[TAG], max_turns=max_cycles), team="red", render_mode=render_mode)

    @staticmethod
    def env(**options):
        return parallel_to_aec(Module.parallel_env(**options))


def test_pettingzoo_finds_as_many_cycles_as_turns():
    max_cycles_test(Module)


def test_pettingzoo_finds_no_fault_in_pictures(monkeypatch):
    pytest.importorskip("pygame")
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    made = []

    def env(**options):
        made.append(Module.env(**options))
        return made[-1]

    try:
        render_test(env)
    finally:
        for one in made:
            one.close()


def test_rl_is_a_module_of_gamms():
    assert gamms.rl is rl


@pytest.mark.parametrize(
    ("make", "actions"),
    [
        (lambda: rl.parallel_env(scene(), team="red"), {"red_0": 0}),
        (lambda: rl.single_agent_env(scene(), agent="red_0"), 0),
        (lambda: rl.vector_env(scene(), num_games=2, team="red"), np.zeros(4, np.int64)),
    ],
)
def test_a_closed_environment_says_so(make, actions):
    env = make()
    env.reset(seed=1)
    env.close()
    for call in (env.reset, partial(env.step, actions)):
        with pytest.raises(BadValue, match="This environment is closed"):
            call()


MAPS = [{"grid": {"rows": 4, "columns": 4}}, {"grid": {"rows": 2, "columns": 9}}]


def hunt():
    """Two hunters of an agent that walks at random, who win if they tag it."""
    teams = {"red": {"count": 2}, "blue": {"count": 1, "strategy": WALK}}
    rules = [{"rule": "tag", "with": {"taggers": "red", "tagged": "blue", "then": "eliminate"}}, "last_team"]
    return Scenario(map=MAPS[0], max_turns=20, teams=teams, rules=rules)


def test_a_win_is_a_reward_of_the_team_in_all_environments():
    def won(turn):
        return turn.won

    rng = np.random.default_rng(0)
    options = {"others": {"blue": gamms.strategies.stay}, "maps": MAPS, "reward": won}
    team = rl.parallel_env(hunt(), team="red", **options)
    number_of_wins = 0
    for seed in range(8):
        observed, infos = team.reset(seed=seed)
        assert infos["red_0"]["map_spec"] == MAPS[infos["red_0"]["map"]]
        paid = 0.0
        while team.agents:
            actions = {name: rng.choice(np.flatnonzero(observed[name]["action_mask"])) for name in team.agents}
            observed, rewards, *_ = team.step(actions)
            paid += sum(rewards.values())
        has_won = team.learners.games.result(0).winner == "red"
        assert paid == 2.0 * has_won
        number_of_wins += has_won
        assert team.state().shape == team.state_space.shape
    assert 0 < number_of_wins < 8
    team.close()
    one = rl.single_agent_env(hunt(), agent="red_0", **options)
    assert {int(one.reset(seed=seed)[1]["map"]) for seed in range(6)} == {0, 1}
    one.close()
    games = rl.vector_env(hunt(), num_games=4, team="red", **options)
    games.reset(seed=1)
    for _ in range(60):
        _, rewards, terminated, truncated, _ = games.step(games.action_space.sample())
        assert not rewards[~(terminated | truncated)].any()
    games.close()
    bad = rl.vector_env(hunt(), num_games=4, team="red", reward=lambda turn: np.zeros(3))
    bad.reset(seed=1)
    with pytest.raises(BadValue, match=r"an array \(4, 2\), not float64 of the shape \(3,\)"):
        bad.step(np.zeros(8, np.int64))


def test_strategies_for_agents_that_learn_are_refused():
    with pytest.raises(BadValue, match="others has a strategy for 'red', which learns"):
        rl.vector_env(hunt(), num_games=2, team="red", others={"red": gamms.strategies.stay})
    with pytest.raises(BadValue, match="others has a strategy for 'red_1', which learns"):
        rl.vector_env(hunt(), num_games=2, team="red", others={"red_1": gamms.strategies.stay})
    with pytest.raises(BadValue, match="which learns: leave it out, or let team= name the teams that learn"):
        rl.parallel_env(hunt(), others={"blue": gamms.strategies.stay})
    mates = {"red": gamms.strategies.stay, "red_1": gamms.strategies.stay}
    rl.single_agent_env(hunt(), agent="red_0", others=mates).close()


# -- actions that are numbers of edges ----------------------------------------------------------------------------


@pytest.fixture(scope="module")
def ferries(tmp_path_factory):
    """A scenario in a town with two edges from each node to the next, of which a rule notes those that red takes."""
    folder = tmp_path_factory.mktemp("ferries")
    with gamms.create_context(seed=1) as ctx:
        for node in range(3):
            ctx.graph.add_node({"id": node, "x": 50.0 * node, "y": 0.0})
        for edge, (source, target, length) in enumerate([(0, 1, 50), (0, 1, 60), (1, 2, 50), (1, 2, 70), (1, 0, 50)]):
            ctx.graph.add_edge({"id": 10 + edge, "source": source, "target": target, "length": float(length)})
        ctx.graph.save(folder / "town.gamms")
    teams = {
        "red": {"agents": [{"name": "ann", "node": 0}, {"name": "amy", "node": 1}]},
        "blue": {"agents": [{"name": "ben", "node": 2}], "strategy": "gamms.strategies:random_walk"},
    }
    rules = [{"rule": "time_limit", "with": {"turns": 4}}]
    return Scenario(map={"file": "town.gamms"}, teams=teams, rules=rules, folder=folder)


def edges_taken(games, number, folder):
    """Return the edges that agents of a game have named, by turn and agent, from its recording."""
    games.record(number, folder / f"{number}.ggr")
    with recorder.open(folder / f"{number}.ggr") as recording:
        table = recording.table("edges")
    return [*zip(*(table[name].tolist() for name in ("turn", "agent", "edge")), strict=True)]


def test_actions_take_edges_in_many_games_as_in_one(ferries, tmp_path):
    given = [[[1, 2], [3, 0]], [[0, 1], [2, 1]], [[3, 0], [2, 3]]]  # amy, ann
    options = {"teams": "red", "reward": lambda turn: turn.after.mask * 1.0, "moves": "edges"}
    with Learners(ferries, 2, seed=5, **options) as many:
        many.begin_all()
        assert many.num_actions == 4
        assert many.masks.sum(axis=-1).tolist() == [[4, 3], [4, 3]]
        for actions in given:
            many.step(np.array(actions))
        found = [edges_taken(many.games, number, tmp_path) for number in range(2)]
    for number in range(2):
        with Learners(ferries, seed=5 + number, **options) as one:
            one.begin_all()
            for actions in given:
                one.step(np.array(actions)[number : number + 1])
            assert edges_taken(one.games, 0, tmp_path) == found[number]
    assert found[0][0] == (1, "amy", 12)
    assert {edge for edges in found for *_, edge in edges} >= {10, 12}


def test_the_only_learner_takes_the_edges_of_its_actions(ferries, tmp_path):
    options = {"reward": lambda turn: turn.after.mask * 1.0, "moves": "edges"}
    with rl.single_agent_env(ferries, agent="ann", seed=3, **options) as env:
        observation, _ = env.reset()
        assert env.action_space.n == 4
        assert observation["action_mask"].tolist() == [1, 1, 1, 0]
        *_, info = env.step(2)
        assert info["is_legal"]
        *_, info = env.step(0)
        *_, info = env.step(2)
        assert edges_taken(env.learners.games, 0, tmp_path) == [(1, "ann", 11), (3, "ann", 13)]
        observation, _ = env.reset()
        assert observation["action_mask"].tolist() == [1, 1, 1, 0]


def test_environments_of_edges_begin_games_again(ferries):
    options = {"reward": lambda turn: turn.after.mask * 1.0, "moves": "edges"}
    with closing(rl.vector_env(ferries, num_games=2, team="red", **options)) as env:
        env.reset(seed=1)
        for _ in range(6):
            _, rewards, *_ = env.step(np.array([1, 2, 2, 1]))
            assert rewards.tolist() == [1.0] * 4
    with pytest.raises(BadValue, match="moves"):
        rl.parallel_env(ferries, moves="roads")


@pytest.mark.parametrize("maps", [None, [{"grid": {"rows": 2, "columns": 3}}, {"grid": {"rows": 1, "columns": 6}}]])
def test_environments_of_edges_play_the_same_in_one_call_and_by_phases(ferries, tmp_path, maps):
    (ferries.folder / "idle_rule.py").write_text("def do_nothing(ctx):\n    pass\n")  # such turns have phases
    played = []
    for rules in ([], [{"rule": "idle_rule:do_nothing"}]):
        limit = {"rule": "time_limit", "with": {"turns": 5}}
        options = {"reward": None if maps else (lambda turn: turn.after.node * 1.0), "moves": "edges", "maps": maps}
        tag = {"rule": "tag", "with": {"taggers": "red", "tagged": "blue", "then": "respawn", "score": 1}}
        scene = ferries.replace(rules=[limit, *([tag] if maps else []), *rules])
        learners = Learners(scene, 4, teams="red", seed=3, **options)
        with closing(rl.vector_env(scene, num_games=4, team="red", seed=3, **options)) as env, learners:
            learners.begin_all()
            draw = np.random.default_rng(2)
            observed, _ = env.reset(seed=3)
            rows = [(observed["observation"].tolist(), observed["action_mask"].tolist())]
            for _ in range(14):
                actions = draw.integers(0, env.single_action_space.n, 8)
                observed, rewards, terminated, truncated, _ = env.step(actions)
                rows.append((observed["observation"].tolist(), observed["action_mask"].tolist(), rewards.tolist()))
                rows.append((terminated.tolist(), truncated.tolist()))
            for _ in range(4):
                actions = draw.integers(0, learners.num_actions, (4, 2))
                rows.append((learners.are_legal(actions).tolist(), learners.masks.tolist()))
                learners.step(actions)
            rows.append([edges_taken(learners.games, number, tmp_path) for number in range(4)])
        played.append(rows)
    assert played[0] == played[1]
    assert all(played[0][-1])


def choose_randomly(entries, actions, seed=1):
    """Return the layers of a network with random weights."""
    return [(np.random.default_rng(seed).normal(size=(actions, entries)), np.zeros(actions))]


def test_a_saved_policy_takes_the_edges_that_its_network_prefers(ferries, tmp_path):
    options = {"reward": lambda turn: turn.after.mask * 1.0, "moves": "edges"}
    with Learners(ferries, 3, teams="red", seed=7, **options) as learners:
        learners.begin_all()
        entries = learners.observe().shape[-1]
        layers = choose_randomly(entries, learners.num_actions)
        rl.save_policy(layers, tmp_path / "red.safetensors", learners)
        while not learners.is_over.all():
            preferred = np.where(learners.masks, learners.observe() @ layers[0][0].T, -np.inf).argmax(axis=-1)
            learners.step(preferred)
        wanted = [edges_taken(learners.games, number, tmp_path) for number in range(3)]
    assert len({edge for edges in wanted for *_, edge in edges}) > 1
    rl.save_policy(layers, tmp_path / "same.safetensors", ferries, team="red", moves="edges")
    assert (tmp_path / "same.safetensors").read_bytes() == (tmp_path / "red.safetensors").read_bytes()
    red = rl.policy(tmp_path / "red.safetensors")
    for sample in (False, True):
        red = rl.policy(tmp_path / "red.safetensors", sample=sample)
        with ferries.batch(3, seed=7, strategies={"red": red}, record=True) as games:
            games.run()
            assert "contexts of their own" not in str(games)
            found = [edges_taken(games, number, tmp_path) for number in range(3)]
        alone = []
        for number in range(3):
            ferries.play(seed=7 + number, strategies={"red": red}, record=tmp_path / "alone.ggr")
            with recorder.open(tmp_path / "alone.ggr") as recording:
                table = recording.table("edges")
            alone.append([*zip(*(table[name].tolist() for name in ("turn", "agent", "edge")), strict=True)])
        assert found == alone
        assert (found == wanted) != sample


def test_a_policy_by_edges_plays_on_maps_with_fewer_edges_from_a_node_and_refuses_others(ferries, tmp_path):
    few = {"grid": {"rows": 1, "columns": 5}}
    many = {"grid": {"rows": 5, "columns": 5}}
    teams = {"red": {"count": 2}, "blue": {"count": 1}}
    row = Scenario(map=few, teams=teams, max_turns=5)
    options = {"team": "red", "moves": "edges", "reward": lambda turn: turn.after.mask * 1.0}
    with closing(rl.vector_env(row, num_games=2, maps=[few, {"grid": {"rows": 1, "columns": 9}}], **options)) as env:
        entries = env.single_observation_space["observation"].shape[0]
        rl.save_policy(choose_randomly(entries, 3), tmp_path / "red.safetensors", env)
    red = rl.policy(tmp_path / "red.safetensors", sample=True)
    third = row.replace(map={"grid": {"rows": 1, "columns": 3}})
    assert third.play(seed=1, strategies={"red": red}).turns == 5
    with pytest.raises(BadValue, match="at most 2 edges from a node, and here are 4"):
        row.replace(map=many).play(seed=1, strategies={"red": red})
    with pytest.raises(BadValue, match="moves= are for a scenario"):
        rl.save_policy([], tmp_path / "red.safetensors", env, moves="edges")
