"""Batches whose games have several maps: each game is the one of its seed on the map that the seed draws."""

from functools import partial

import numpy as np
import pytest
from batch_scenes import WALK, WAYS, assert_as_played, by_another_plan, scene

import gamms
import gamms.recorder
from gamms import rl
from gamms.errors import BadType, BadValue
from gamms.rl.learners import default_observation
from gamms.scenario.documents import ScenarioError

MAPS = [{"grid": {"rows": rows, "columns": columns}} for rows, columns in ((4, 4), (3, 7), (9, 1), (6, 5))]
TAG = {"rule": "tag", "with": {"taggers": "red", "tagged": "blue", "score": 0.5}}
LIMIT = {"rule": "time_limit", "with": {"turns": 9, "winner": "blue"}}
CODE = '''
from functools import partial

import numpy as np

import gamms


@gamms.array_rule
def crowd(turn):
    """Score by how often agents were on the last node of their map."""
    kept = turn.keep("crowd", lambda games: {"times": np.zeros((games, len(turn.roster.names)))})
    there = turn.node == turn.streets.num_nodes - 1
    kept["times"][turn.games] += there
    turn.add_scores(*there.nonzero(), kept["times"][turn.games][there])


def count_meetings(ctx):
    """Score by how many agents are on nodes with even numbers; end the game when these are many."""
    nodes = [agent.current_node_id for agent in ctx.agent.agents.values()]
    even = sum(node % 2 == 0 for node in nodes)
    ctx.game.scores["red"] = ctx.game.scores.get("red", 0) + even
    if even == len(nodes):
        ctx.game.end("even")


def fails(ctx):
    """Raise on a node that the smallest maps do not have."""
    if any(agent.current_node_id > 20 for agent in ctx.agent.agents.values()):
        raise RuntimeError("too far")
'''


@pytest.fixture
def with_code(tmp_path):
    """Make scenarios with rules of a user."""
    (tmp_path / "mine.py").write_text(CODE)
    return lambda *rules, **more: scene([TAG, *rules], folder=tmp_path, **more)


def test_the_map_of_a_game_follows_from_its_seed_alone():
    scenario = scene([TAG])
    with scenario.batch(40, maps=MAPS) as many, scenario.batch(seeds=[17, 3, 39], maps=MAPS) as few:
        assert few.maps.tolist() == many.maps[[17, 3, 39]].tolist()
        assert (np.bincount(many.maps, minlength=4) > 3).all()
    with by_another_plan(scenario).batch(40, maps=MAPS) as slow:
        assert slow.maps.tolist() == many.maps.tolist()


@pytest.mark.parametrize("way", WAYS)
def test_games_that_begin_again_draw_their_maps_again(way):
    scenario = way(scene([TAG]))
    with scenario.batch(10, maps=MAPS) as games:
        before = games.maps.tolist()
        for _ in range(4):
            games.step()
        games.reset([1, 2, 3, 7], seeds=[21, 22, 23, 27])
        assert [before[i] for i in (0, 4, 5)] == [games.maps[i] for i in (0, 4, 5)]
        assert games.maps.tolist() != before
        assert games.turn.tolist() == [4, 0, 0, 0, 4, 4, 4, 0, 4, 4]
        games.run()
        assert_as_played(games, scenario, maps=MAPS)
        games.reset()
        games.run()
        assert_as_played(games, scenario, maps=MAPS)
        with scenario.batch(seeds=games.seeds, maps=MAPS) as fresh:
            assert fresh.maps.tolist() == games.maps.tolist()


def test_games_are_recorded_on_their_maps(tmp_path):
    scenario = scene([TAG])
    with scenario.batch(6, maps=MAPS, record=True) as games:
        games.step({"red": np.zeros((6, 3), np.int64)})
        games.run()
        for number in range(6):
            games.record(number, tmp_path / "game.ggr")
            with gamms.recorder.open(tmp_path / "game.ggr") as recording:
                again = gamms.scenario.from_recording(recording)
                assert recording.turns == games.turn[number]
            assert again.to_dict()["map"]["grid"]["columns"] == MAPS[games.maps[number]]["grid"]["columns"]


def test_the_table_has_the_maps():
    with scene([TAG]).batch(6, maps=MAPS) as games:
        games.run()
        assert games.table()["map"].tolist() == games.maps.tolist()
    with scene([TAG]).batch(6) as games:
        assert games.maps.tolist() == [0] * 6
        assert "map" not in games.table()


def test_no_game_is_played_where_a_rule_raises_on_one_map(with_code):
    scenario = with_code({"rule": "mine:fails"}, max_turns=30)
    with scenario.batch(12, maps=MAPS) as games, pytest.raises(RuntimeError, match="too far"):
        for turn in range(30):
            assert games.turn.tolist() == [turn] * 12
            games.step()
    assert len({*games.turn.tolist()}) == 1


def test_what_one_map_alone_can_say_is_refused():
    with scene([TAG]).batch(6, maps=MAPS) as games:
        with pytest.raises(BadValue, match="give map=k"):
            games.observe("red")
        with pytest.raises(BadValue, match="There is no map 4"):
            games.observe("red", map=4)
        with pytest.raises(BadValue, match="columns is for games on one map"):
            games.columns()
    with scene([TAG]).batch(3, maps=MAPS[:1]) as games:
        assert games.observe("red").node.shape == (3, 3)
        assert len(games.columns()["node"]) == 3


def test_maps_are_checked_as_those_of_scenarios(tmp_path):
    scenario = scene([TAG])
    with pytest.raises(BadValue, match="maps is empty"):
        scenario.batch(3, maps=[])
    with pytest.raises(BadType, match="maps must be a list"):
        scenario.batch(3, maps=7)
    with pytest.raises(ScenarioError, match=r"^maps\[1\]: cannot be 7"):
        scenario.batch(3, maps=[MAPS[0], 7])
    with pytest.raises(ScenarioError, match=r"^maps\[2\]\.grid\.columns"):
        scenario.batch(3, maps=[*MAPS[:2], {"grid": {"rows": 2, "columns": 0}}])
    with pytest.raises(ScenarioError, match=r"^maps\[0\]\.file.*there is no file"):
        scene([TAG], folder=tmp_path).batch(3, maps=[{"file": "none.gamms"}])


def test_array_functions_know_the_map_that_they_are_called_for(tmp_path):
    code = """
import gamms


@gamms.array_strategy
def walk_east(view):
    columns = view.map_spec["grid"]["columns"]
    here = view["curr_pos"]
    return view.action_to(here + (here % columns < columns - 1))


@gamms.array_rule
def score(turn):
    turn.add_scores(*turn.alive.nonzero(), turn.map + turn.map_spec["grid"]["rows"] / 100)
"""
    (tmp_path / "mine.py").write_text(code)
    scenario = scene(["mine:score"], teams={"red": {"count": 2, "strategy": "mine:walk_east"}}, folder=tmp_path)
    scenario = scenario.replace(map=MAPS[3])
    with scenario.batch(8, maps=MAPS) as games:
        games.run(max_turns=9)
        assert len({*games.maps.tolist()}) > 2
        for game, number in enumerate(games.maps.tolist()):
            grid = MAPS[number]["grid"]
            assert games.scores["red"][game] == pytest.approx(2 * 9 * (number + grid["rows"] / 100))
            ends = [agent["node"] % grid["columns"] for agent in games.result(game).agents.values()]
            assert ends == [grid["columns"] - 1] * 2
        number = int(games.maps[0])
        view = games.observe("red", map=number)
        assert (view.map, view.map_spec) == (number, MAPS[number])
        view.map_spec["grid"]["rows"] = 0
        assert view.map_spec == MAPS[number]
    with scenario.batch(1) as games:
        assert (games.observe("red").map, games.observe("red").map_spec) == (0, scenario.to_dict()["map"])
    assert scenario.play(seed=3).scores["red"] > 0  # one game calls the same functions


def test_an_error_in_a_start_names_the_map_and_the_seed():
    teams = {"red": {"count": 1}, "blue": {"count": 1, "from": {"team": "red", "at_least": 70}}}
    maps = [{"grid": {"rows": 20, "columns": 20}}, {"grid": {"rows": 4, "columns": 11}}]
    scenario = scene(teams=teams)
    for seeds in ([9], range(12)):  # the game that fails is the first, or a later one
        with pytest.raises(ScenarioError, match=r"on maps\[1\], .*at least 70 from red, with the seed 9\."):
            scenario.batch(seeds=seeds, maps=maps)


def test_agents_need_their_places_on_all_maps():
    agents = [{"name": "one", "node": 15}]
    scenario = scene(teams={"red": {"agents": agents, "strategy": WALK}})
    with pytest.raises(ScenarioError, match=r"teams\.red.*on maps\[2\]"):
        scenario.batch(3, maps=MAPS)


# -- learners -------------------------------------------------------------------------------------------------------


def test_learners_observe_all_maps_in_one_array():
    env = rl.vector_env(scene([TAG]), num_games=9, team="red", maps=MAPS[:3])
    observed, _ = env.reset(seed=4)
    games = env.unwrapped.learners.games
    masks = observed["action_mask"].reshape(9, 3, -1)
    assert masks.shape[2] == 5
    for number in range(3):
        view = games.observe("red", map=number)
        assert masks[view.games].sum(axis=2).tolist() == view.counts.tolist()
    assert env.single_observation_space["observation"].shape == observed["observation"].shape[1:]
    env.close()


def test_what_learners_observe_by_default_is_what_views_give_on_each_map():
    sensors = {"near": {"type": "AGENT_RANGE", "sensor_range": 2.5}}
    teams = {team: {"count": 2, "strategy": WALK, "sensors": ["near"]} for team in ("red", "blue")}
    scenario = scene([{**TAG, "with": {**TAG["with"], "then": "eliminate"}}, LIMIT], teams=teams, sensors=sensors)
    plain_env, called = [
        rl.vector_env(scenario, num_games=12, maps=MAPS, observation=observation)
        for observation in (None, partial(default_observation, threads=1))
    ]
    observed, _ = plain_env.reset(seed=4)
    others, _ = called.reset(seed=4)
    draw = np.random.default_rng(1)
    num_out = 0
    for _ in range(30):
        np.testing.assert_array_equal(observed["observation"], others["observation"])
        np.testing.assert_array_equal(observed["action_mask"], others["action_mask"])
        before = observed["observation"].copy()
        actions = draw.integers(0, 5, len(before))  # some of which are not legal
        now, *ends = plain_env.step(actions)
        np.testing.assert_array_equal(observed["observation"], before)  # nobody writes into it any more
        others, *same = called.step(actions)
        for mine, other in zip(ends[:3], same[:3], strict=True):
            np.testing.assert_array_equal(mine, other)
        num_out += int(ends[1].sum())
        observed = now
    assert num_out > 0
    plain_env.close()
    called.close()


def test_rewards_of_learners_are_given_map_by_map():
    asked = []

    def where(turn):
        asked.append(turn.after.games.tolist())
        assert len(turn.winner) == len(turn.gains["red"]) == len(turn.after.games)
        return turn.after.node + 100.0 * turn.after.streets.num_nodes

    env = rl.vector_env(scene([TAG]), num_games=8, team="red", maps=MAPS, reward=where)
    env.reset(seed=1)
    maps = env.unwrapped.learners.games.maps
    _, rewards, *_ = env.step(np.zeros(24, np.int64))
    sizes = np.array([one["grid"]["rows"] * one["grid"]["columns"] for one in MAPS])[maps]
    assert (rewards.reshape(8, 3) // 100).tolist() == np.repeat(sizes[:, None], 3, axis=1).tolist()
    assert asked == [np.flatnonzero(maps == number).tolist() for number in np.unique(maps)]
    env.close()


def test_observations_of_other_shapes_on_other_maps_are_refused():
    with pytest.raises(BadValue, match="one shape on all maps"):
        rl.vector_env(scene([TAG]), num_games=9, team="red", maps=MAPS, observation=rl.graph())


def test_processes_play_the_same_games_on_several_maps():
    found = []
    for workers in (1, 2):
        env = rl.vector_env(scene([TAG]), num_games=6, team="red", maps=MAPS, workers=workers)
        env.reset(seed=5)
        steps = [env.step(np.full(18, 1)) for _ in range(14)]
        found.append([(one[0]["observation"], one[1]) for one in steps])
        env.close()
    for one, other in zip(*found, strict=True):
        np.testing.assert_array_equal(one[0], other[0])
        np.testing.assert_array_equal(one[1], other[1])


def test_on_each_map_agents_see_those_who_are_near_there():
    radius = 25.0
    teams = {team: {"count": 3, "strategy": WALK, "sensors": ["eyes"]} for team in ("red", "blue")}
    eyes = {"eyes": {"type": "AGENT_RANGE", "range_m": radius}}
    growing = [MAPS[2], MAPS[0], MAPS[1]]
    with scene([TAG], teams=teams, sensors=eyes).batch(40, maps=growing) as games:
        for _ in range(3):
            games.step()
            for number in range(3):
                view = games.observe("red", map=number)
                everyone = view.of(np.arange(len(games.roster.names)))["xy"]
                far = np.linalg.norm(everyone[:, None] - view["xy"][:, :, None], axis=-1)
                is_near = (far <= radius) & view.living[:, None, :] & view.mask[..., None]
                is_near[:, np.arange(len(view.agents)), view.agents] = False
                assert (view.seen().mask == is_near).all()
