"""Many games at once: each is the game that would be played alone."""

import copy
import inspect
import pickle
import signal
from contextlib import suppress

import numpy as np
import pytest
from batch_scenes import (
    WAYS,
    as_it_is,
    assert_as_alone,
    assert_as_played,
    assert_as_shown,
    by_another_plan,
    part,
    plain,
    scene,
)

import gamms
from gamms import recorder
from gamms.errors import BadType, BadValue, TooLarge, UnknownName
from gamms.game.plan import find_first_called
from gamms.readonly import ReadOnly
from gamms.rules import time_limit
from gamms.scenario import Scenario

TAG = {"rule": "tag", "with": {"taggers": "red", "tagged": "blue"}}


@pytest.mark.parametrize("name", ["grid_tag", "helsinki_pursuit"])
def test_what_functions_of_gamms_make_of_parameters_is_the_same_in_all_games(name, same_as_one_by_one):
    same_as_one_by_one(gamms.scenario.from_gallery(name).replace(max_turns=30), [3, 4])


MINE = """
import random

import gamms

def drawn(ctx):
    return ctx.graph.place(1)

def lucky():
    return [random.randrange(25)]

def corner(side):
    return [side * side - 1]

def same(ctx):
    nodes = ctx.graph.columns().node_ids.tolist()
    def strategy(state):
        state["action"] = state["draw"].choice(state["legal"]) if nodes else state["legal"][0]
    return strategy

def by_seed(ctx, period=2):
    k = -1 if ctx.seed % period else 0
    def strategy(state):
        state["action"] = state["legal"][k]
    return strategy

def paved(ctx):
    if ctx.seed == 13 and not ctx.graph.graph.has_node(99):
        ctx.graph.add_nodes([99], [0.0], [9.0])
    return by_seed(ctx)

def by_place(ctx):
    homes = {agent.name: agent.current_node_id for agent in ctx.agent.create_iter()}
    def strategy(state):
        state["action"] = state["legal"][homes[state["name"]] % len(state["legal"])]
    return strategy

def map_strategy(config):
    def made(home):
        def strategy(state):
            state["action"] = state["legal"][home % len(state["legal"])]
        return strategy
    return {name: made(one["start_node_id"]) for name, one in config.items()}

def homing(ctx):
    return gamms.strategies.goto(ctx, ctx.agent.get_agent("red_0").current_node_id)

def planned(ctx):
    k = ctx.seed
    def plan(states):
        for state in states.values():
            state["action"] = state["legal"][(k + state["turn"]) % len(state["legal"])]
    return plan

def noise(ctx):
    level = int(ctx.stream("noise").integers(9))
    return lambda node_id, agent: (agent.name, node_id + level)

def echo(ctx):
    level = ctx.seed
    return lambda: level

def luck(ctx):
    return ctx.seed % 7

def attentive(state):
    sensed = state["sensor"]["noise"][1][1] + state["sensor"]["echo"][1]
    state["action"] = state["legal"][sensed % len(state["legal"])]

def tell(ctx):
    for agent in ctx.game.agents:
        ctx.game.emit("told", agent=agent.name, luck=agent.meta.get("luck"))

class Prepared:
    def prepare(self, ctx):
        ctx.game.data["lot"] = ctx.stream("lot").integers(9)
    def __call__(self, ctx):
        ctx.game.scores["lot"] += int(ctx.game.data["lot"])

def prepared():
    return Prepared()

def pay(ctx):
    ctx.game.scores["paid"] += ctx.game.facts["spot"][0]

@gamms.array_rule
def pays(turn):
    turn.add_score("in arrays", turn.games * 0, float(turn.facts["spot"][0]))
"""


def arrive(function, **parameters):
    nodes = {"function": function, "with": parameters}
    return {"rules": [{"rule": "arrive", "with": {"team": "red", "nodes": nodes}}]}


def by(strategy):
    return {"teams": {"red": {"count": 2, "strategy": strategy}}}


@pytest.mark.parametrize(
    ("given", "is_called"),
    [
        (arrive("mine:corner", side=5), False),
        (arrive("mine:drawn"), True),
        (arrive("mine:lucky"), True),
        (by("mine:same"), False),
        ({"rules": [{"rule": "mine:prepared"}]}, True),
        ({"rules": [{"rule": "mine:pay"}, {"rule": "mine:pays"}], "facts": {"spot": {"function": "mine:drawn"}}}, True),
    ],
)
def test_only_what_differs_with_the_seed_is_made_for_each_game(given, is_called, tmp_path):
    (tmp_path / "mine.py").write_text(MINE)
    scenario = Scenario(**{**scene([]).to_dict(), **given, "folder": tmp_path})
    with scenario.batch(3, seed=1) as games:
        assert ("the rule" in str(find_first_called(games.game, games.roster))) == is_called
        games.run()
        assert games.is_in_arrays
        games.reset([1], seeds=[9])
        games.run()
        if "lucky" not in str(given):
            assert_as_played(games, scenario)


def test_rules_draw_from_the_stream_of_the_context_behind_the_code_of_the_scenario(tmp_path, caplog):
    code = """
def spots(ctx):
    return [int(ctx.rng.integers(16)) for _ in range(2)]

def draw(ctx):
    ctx.logger.warning(f"seed {ctx.seed}, turn {ctx.game.turn}")
    ctx.game.emit("drawn", spots=ctx.game.facts["spots"], number=int(ctx.rng.integers(1000)))
    if ctx.game.turn == 3 and ctx.seed == 2:
        ctx.game.max_turns = 6
"""
    (tmp_path / "drawing.py").write_text(code)
    given = scene([{"rule": "drawing:draw"}], max_turns=5).to_dict()
    scenario = Scenario(**given, facts={"spots": {"function": "drawing:spots"}}, folder=tmp_path)
    with scenario.batch(3, seed=1) as games:
        games.step()
        games.reset([1])
        games.run()
        assert not games.detached
        assert sorted({*caplog.messages}) == sorted([*caplog.messages[3:], *caplog.messages[:1], caplog.messages[2]])
        assert_as_played(games, scenario)


@pytest.mark.parametrize(
    "strategy",
    [
        {"function": "mine:by_seed", "with": {"period": 5}},
        "mine:by_place",
        "mine",
        "mine:homing",
        {"function": "gamms.strategies:patrol", "with": {"nodes": {"function": "mine:drawn"}}},
    ],
)
def test_strategies_that_differ_with_the_seed_are_called_in_the_core(strategy, tmp_path):
    (tmp_path / "mine.py").write_text(MINE)
    scenario = Scenario(**{**scene([TAG]).to_dict(), "folder": tmp_path})
    scenario = scenario.replace(**{f"teams.{team}.strategy": strategy for team in ("red", "blue")})
    with scenario.batch(4, seed=1) as games:
        for seeds in (range(1, 5), [7, 2, 9, 9]):
            games.reset(seeds=seeds)
            games.run()
            assert games.is_in_arrays
            assert find_first_called(games.game, games.roster).startswith("the strategy")
            for number, seed in enumerate(seeds):
                assert games.result(number) == scenario.play(seed=seed)
                assert plain(games.context(number).game.result()) == plain(games.result(number))


def test_sensors_and_descriptions_of_agents_that_differ_with_the_seed_are_those_of_each_game(tmp_path):
    (tmp_path / "mine.py").write_text(MINE)
    sensors = {name: {"function": f"mine:{name}"} for name in ("noise", "echo")}
    red = {"count": 2, "sensors": [*sensors], "meta": {"luck": {"function": "mine:luck"}}, "strategy": "mine:attentive"}
    given = {**scene([{"rule": "mine:tell"}]).to_dict(), "sensors": sensors, "folder": tmp_path}
    scenario = Scenario(**given).replace(**{"teams.red": red})
    with scenario.batch(4, seed=1) as games:
        for seeds in (range(1, 5), [7, 2, 9, 9]):
            games.reset(seeds=seeds)
            games.run()
            assert games.is_in_arrays
            assert_as_played(games, scenario)


def test_a_window_shows_the_game_that_is_asked_for_and_games_are_played_without_one():
    maps = [{"grid": {"width": width, "height": 4}} for width in (4, 5)]
    with scene([TAG]).batch(6, vis_engine=gamms.visual.Engine.OFFSCREEN, maps=maps) as games:
        games.step()
        first, second = np.flatnonzero(games.maps == 0)[:2].tolist()
        shown = games.context(first)
        games.step()
        assert (shown.game.turn, shown.seed) == (2, games.seeds[first])
        assert shown.visual.frame(40, 30).shape == (30, 40, 3)
        for ask in (lambda: games.context(second), games.run, lambda: games.reset([second])):
            ask()
            before, shown = shown, games.context(second)
            assert before.is_terminated() == (before is not shown)
            assert shown.visual.frame(40, 30).shape == (30, 40, 3)
            assert plain(shown.game.result()) == plain(games.result(second))
        games.step()
        assert games.context(second) is shown
        games.reset([second])
        assert games.context(second) is shown, "the window stays for games that begin"
        other = games.context(int(games.maps.argmax()))
        assert shown.is_terminated()
        assert len(other.graph.columns().node_ids) == 20
        assert games.is_in_arrays
    assert other.is_terminated()


class Planned:
    """A strategy that plans before the first turn, and tells what it has planned."""

    def prepare(self, ctx):
        self.number = ctx.seed + sum(agent.current_node_id for agent in ctx.agent.create_iter())
        ctx.game.publish(planned=self.number)

    def __call__(self, state):
        number = self.number + state["facts"]["planned"] + state["turn"]
        state["action"] = state["legal"][number % len(state["legal"])]


@pytest.mark.parametrize("turns", [0, 2])
def test_strategies_prepare_in_each_game(turns):
    def tell(ctx):
        ctx.game.emit("planned", what=ctx.game.facts["planned"])

    with scene([TAG]).build(seed=1) as ctx:
        planned = Planned()
        for name in ("red_0", "red_1", "blue_0"):
            ctx.agent.get_agent(name).register_strategy(planned)
        for _ in range(turns):
            ctx.game.step()
        ctx.game.add(tell)
        with ctx.game.batch(seeds=[4, 5, 6]) as games:
            for _ in range(2):
                games.run()
                assert games.is_in_arrays
                with ctx.game.fork(0).ctx as alone:
                    assert_as_alone(games, alone)
                assert_as_shown(games)
                games.reset([1], seeds=[8])
                games.reset([0])


@pytest.mark.parametrize("maps", [None, [{"grid": {"width": 4, "height": 4}}, {"grid": {"width": 6, "height": 3}}]])
def test_strategies_of_scenarios_prepare_in_each_game(maps, tmp_path):
    (tmp_path / "mine.py").write_text(f"{inspect.getsource(Planned)}\nplanned = Planned()")
    team = {"count": 2, "strategy": "mine:planned"}
    scenario = Scenario(**{**scene([TAG], teams={"red": team, "blue": team}).to_dict(), "folder": tmp_path})
    with scenario.batch(4, seed=1, maps=maps) as games:
        games.run()
        assert games.is_in_arrays
        assert_as_played(games, scenario, maps=maps)


def test_plans_that_differ_with_the_seed_are_called_in_the_core_on_several_maps(tmp_path):
    (tmp_path / "mine.py").write_text(MINE)
    given = {"teams": {"red": {"count": 2, "plan": "mine:planned"}, "blue": {"count": 1, "strategy": "mine:by_place"}}}
    scenario = Scenario(**{**scene([TAG]).to_dict(), **given, "folder": tmp_path})
    maps = [{"grid": {"width": 4, "height": 4}}, {"grid": {"width": 6, "height": 3}}]
    with scenario.batch(6, seed=1, maps=maps) as games:
        games.step()
        games.reset([2, 3], seeds=[40, 41])
        games.run()
        assert games.is_in_arrays
        assert_as_played(games, scenario, maps=maps)


def test_a_batch_of_one_game_begins_again_with_the_functions_of_other_seeds(tmp_path):
    (tmp_path / "mine.py").write_text(MINE)
    scenario = Scenario(**{**scene([]).to_dict(), **by("mine:by_seed"), "folder": tmp_path})
    with scenario.batch(1, seed=2) as games:
        for seed in (2, 3, 4):
            games.reset(seeds=[seed])
            games.run()
            assert games.result(0) == scenario.play(seed=seed)


def test_games_go_on_as_before_a_reset_that_code_of_the_game_refuses(tmp_path):
    (tmp_path / "mine.py").write_text(MINE)
    scenario = Scenario(**{**scene([]).to_dict(), **by("mine:paved"), "folder": tmp_path})
    with scenario.batch(3, seed=1) as games:
        for rounds in range(2):
            with pytest.raises(BadValue, match="more of the map by the seed"):
                games.reset(seeds=[7, 13, 8])
            assert games.seeds == (1, 2, 3)
            games.run(2 if rounds == 0 else None)
        assert [games.result(number) == scenario.play(seed=number + 1) for number in range(3)] == [True] * 3


def test_games_to_which_a_rule_adds_a_rule_are_played_on_with_the_same_results():
    scenario = scene([TAG])
    with scenario.batch(4, seed=1) as fast, scenario.build(seed=1) as ctx:
        fast.run()
        ctx.game.add(part, phase="before")
        ctx.game.add(time_limit(3))
        with ctx.game.batch(seeds=[1, 2]) as slow:
            assert slow.is_in_arrays
            slow.step()
            assert not slow.detached
            assert repr(slow) == "Batch(2 games, 0 over)"
            slow.run()
            assert [slow.result(number).reason for number in (0, 1)] == ["time limit", "time limit"]
            assert slow.turn.tolist() == [3, 3]


def test_impossible_actions_are_refused_and_name_game_and_agent():
    with scene().batch(2) as games:
        with pytest.raises(UnknownName, match="green"):
            games.step({"green": [[0]]})
        with pytest.raises(BadValue, match=r"\(2, 3\)"):
            games.step({"red": [0, 0, 0]})
        with pytest.raises(BadType, match="numbers of legal nodes"):
            games.step({"red": np.full((2, 3), 0.5)})
        with pytest.raises(BadValue, match="action 9 of agent 'red_1' in game 1"):
            games.step({"red": [[0, 0, 0], [0, 9, 0]]})
        with pytest.raises(BadValue, match="no game 2"):
            games.result(2)
        assert games.turn.tolist() == [0, 0]


def test_a_batch_needs_games_that_can_end_and_a_number_of_them():
    with pytest.raises(BadValue, match="number of games"):
        scene().batch()
    with pytest.raises(BadValue, match="num_games"):
        scene().batch(3, seeds=[1, 2])
    with pytest.raises(BadValue, match="seed=7 and seeds: give one"):
        scene().batch(seed=7, seeds=[1, 2])
    with scene().batch(2) as games, pytest.raises(BadType, match="progress must be True or False, not 10"):
        games.run(progress=10)
    with scene(max_turns=None).batch(2) as games, pytest.raises(BadValue, match="could end"):
        games.run()


def count_walkers(ctx):
    """Count turns, and let an agent come in some games."""
    ctx.game.scores["turns"] = ctx.game.turn
    if ctx.game.turn == 2 and ctx.seed % 2:
        ctx.agent.create_agent("late", start_node_id=0, team="red")


def change_settings(ctx):
    """Do in some games what one context for all games cannot do."""
    if ctx.game.turn == 2 and ctx.seed % 2:
        ctx.game.add(count_walkers)


@pytest.mark.parametrize("rule", [None, count_walkers, change_settings])
def test_a_run_of_some_turns_is_that_of_each_game_and_can_go_on(rule):
    with scene(max_turns=None).build(seed=1) as ctx:
        if rule is not None:
            ctx.game.add(rule)
        with ctx.game.batch(seeds=[4, 5, 6]) as games, ctx.game.fork(0).ctx as alone:
            for turns in (3, 0, 4):
                games.run(max_turns=turns)
            games.reset([1])
            assert [games.result(number).reason for number in range(3)] == ["max_turns", "unfinished", "max_turns"]
            games.run(2)
            assert not games.is_over.any()
            for number, turns in enumerate((9, 2, 9)):
                alone.game.reset(seed=games.seeds[number])
                assert plain(games.result(number)) == plain(alone.game.run(turns))
            games.step()
            assert games.turn.tolist() == [10, 3, 10]


def test_a_run_of_some_turns_ends_with_the_game():
    with scene(max_turns=5).batch(2) as games:
        games.run(3)
        assert not games.is_over.any()
        games.run(3)
        assert games.is_over.all()
        assert games.turn.tolist() == [5, 5]
        with pytest.raises(BadValue, match="max_turns"):
            games.run(-1)


def test_games_that_are_reset_begin_again_with_their_seeds():
    with scene([TAG]).batch(4, seed=2) as games:
        games.run()
        first = [plain(games.result(number)) for number in range(4)]
        games.reset([1, 3])
        assert games.turn.tolist() == [12, 0, 12, 0]
        assert games.is_over.tolist() == [True, False, True, False]
        games.run()
        assert [plain(games.result(number)) for number in range(4)] == first
        games.reset(np.array([True, False, False, False]))
        assert games.turn.tolist() == [0, 12, 12, 12]


@pytest.mark.parametrize("way", WAYS)
def test_games_can_begin_again_with_other_seeds(way):
    with way(scene([TAG])).batch(3, seed=5) as games:
        games.step()
        games.reset([2, 0], seeds=[11, 12])
        assert games.turn.tolist() == [0, 1, 0]
        assert games.seeds == (12, 6, 11)
        assert games.observe("red").turn.tolist() == [0, 1, 0]
        games.run()
        assert_as_played(games, scene([TAG]))
        for wrong in ([1], [1, "a"]):
            with pytest.raises((BadType, BadValue), match="seeds"):
                games.reset([0, 1], seeds=wrong)
        for wrong in (1, [[0, 1]], [[0], [1, 2]], [True, False], [0, 2, 0], [3]):
            with pytest.raises(BadValue, match=r"which is a list .* such as \[0\]|once|no game 3"):
                games.reset(wrong)
        games.reset([])
        assert games.is_over.all()


def test_one_by_one_has_no_effect_and_warns():
    with (
        pytest.warns(DeprecationWarning, match=r"one_by_one= has no effect .* batch\.context"),
        scene([TAG]).batch(2, one_by_one=True) as games,
    ):
        assert games.is_in_arrays
    with pytest.warns(DeprecationWarning, match="one_by_one="), scene().batch(1, one_by_one=False):
        pass


def test_the_table_has_a_row_for_each_game():
    with scene([TAG, {"rule": "time_limit", "with": {"turns": 6}}]).batch(8) as games:
        games.run()
        table = games.table()
        results = [games.result(number) for number in range(8)]
        assert table["score.red"].tolist() == [result.scores.get("red", 0) for result in results]
        assert table["winner"].tolist() == [result.winner for result in results]
        assert games.truncated.all()
        assert not games.terminated.any()


@pytest.mark.parametrize("phase", ["before", "after"])
def test_a_game_of_a_batch_is_recorded_byte_by_byte_as_it_would_be_alone(phase, tmp_path):
    scenario = scene([TAG, {"rule": "time_limit", "with": {"turns": 5}, "phase": phase}])
    with scenario.batch(3, seed=4) as games:
        games.run()
        games.record(1, tmp_path / "batch.ggr")
        expected = plain(games.result(1))
    assert plain(scenario.play(seed=5, record=tmp_path / "alone.ggr")) == expected
    assert (tmp_path / "batch.ggr").read_bytes() == (tmp_path / "alone.ggr").read_bytes()


def test_given_actions_are_recorded_if_they_are_kept(tmp_path):
    scenario = scene([TAG])
    with scenario.batch(2, seed=4, record=True) as games:
        for _ in range(5):
            games.step({"red": games.observe("red").counts - 1})
        games.record(1, tmp_path / "game.ggr")
        with gamms.recorder.open(tmp_path / "game.ggr") as recording:
            assert recording.turns == 5
            state = recording.state(5)
            nodes = dict(zip(state.agents["name"].tolist(), state.agents["node"].tolist(), strict=True))
        assert nodes == {name: agent["node"] for name, agent in games.result(1).agents.items()}
    with scenario.batch(2, seed=4) as games:
        games.step({"red": games.observe("red").counts - 1})
        with pytest.raises(BadValue, match="record=True"):
            games.record(0, tmp_path / "other.ggr")


def test_a_batch_that_does_not_fit_is_refused_before_it_is_built():
    for number in (10**7, 10**9):  # of the more, not even the seeds would fit
        with pytest.raises(TooLarge, match=rf"{number} games with 6 agents each, of which \d+ would fit, would take"):
            scene().batch(number)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("play", ["run", "step"])
def test_a_strategy_that_remembers_outside_of_its_game_is_refused(play, way):
    calls = []

    def count(state):
        calls.append(1)
        state["action"] = state["legal"][len(calls) % len(state["legal"])]

    games = way(scene()).batch(2, strategies={"red": count})
    with games, pytest.raises(BadValue, match=r"closure variable 'calls' of count\(\) changed .* state\['memory'\]"):
        getattr(games, play)()


def test_an_error_of_a_strategy_names_game_agent_and_turn():
    def fall(state):
        if state["turn"] == 2 and state["name"] == "red_1":
            raise ZeroDivisionError("fell")
        state["action"] = state["curr_pos"]

    def stay(state):
        state["action"] = state["curr_pos"]

    with scene().batch(3, seed=5, strategies={"red": fall, "blue": stay}) as games:
        assert find_first_called(games.game, games.roster) is not None
        with pytest.raises(ZeroDivisionError) as caught:
            games.run()
    notes = ["In the strategy of agent 'red_1', in turn 2.", "In game 0 of a batch, with the seed 5."]
    assert caught.value.__notes__ == notes


def test_an_error_of_an_array_form_names_it_and_the_turn():
    @gamms.array_strategy
    def fall(view):
        if (view.turn == 2).any():
            raise ZeroDivisionError("fell")
        return view.counts * 0

    with scene().batch(3, strategies={"red": fall}) as games:
        with pytest.raises(ZeroDivisionError) as caught:
            games.run()
        assert caught.value.__notes__ == ["In the strategy fall of a batch, in turn 2."]
    with scene().build(seed=1) as ctx:
        ctx.game.add(gamms.array_rule(lambda turn: 1 // int(turn.turn[0] != 2)), name="falls")
        with ctx.game.batch(3) as games:
            games.step()
            games.reset([2])
            with pytest.raises(ZeroDivisionError) as caught:
                games.step()
        assert caught.value.__notes__ == ["In the rule 'falls' (phase 'after') of a batch, in turns 1 to 2."]


def test_a_rule_that_raises_leaves_a_turn_that_was_played():
    @gamms.array_rule
    def rule(turn):
        raise ZeroDivisionError("fell")

    with scene().build(seed=1) as ctx:
        ctx.game.add(rule)
        with ctx.game.batch(2, seed=3) as games:
            before = games.observe("red")["curr_pos"]
            with pytest.raises(ZeroDivisionError):
                games.step()
            assert games.turn.tolist() == [1, 1]
            moved = (games.observe("red")["curr_pos"] != before).sum()
            assert sum(games.result(i).agents[f"red_{k}"]["moves"] for i in range(2) for k in range(3)) == moved


def test_flights_of_a_team_on_the_ground_are_refused():
    with scene().batch(2) as games:
        with pytest.raises(BadValue, match="team 'red' was given flights, and none of its agents flies"):
            games.step({"red": {"flights": np.zeros((2, 3, 3))}})
        assert games.turn.tolist() == [0, 0]


def test_moments_that_are_not_of_such_games_are_not_loaded():
    with scene().batch(2) as games:
        games.step()
        columns, before = games.columns(), games.observe("red")["curr_pos"].tolist()
        elsewhere = {**columns, "node": columns["node"][:, ::-1]}
        for wrong, message in (
            (({"node": columns["node"]}, 1), "'start' has the shape None"),
            (({**columns, "fuel": columns["node"]}, 1), "'fuel' has the shape"),
            (({**columns, "node": columns["node"][:1]}, 1), "'node' has the shape"),
            (({**columns, "node": columns["node"] + 10**6}, 1), "'node' has numbers from 0 to 24, not 10000"),
            (({**columns, "start": columns["start"] * 0 - 1}, 1), "'start' has numbers from 0 to 24, not -1"),
            (({**columns, "node": columns["node"] + 0.5}, 1), "'node' is of int64, not of float64"),
            (({**columns, "alive": columns["alive"] + 1}, 1), "'alive' is of bool, not of int64"),
            ((elsewhere, -1), "turn"),
            ((elsewhere, 1.5), "turn"),
            ((elsewhere, 1, {"red": np.zeros(3)}), "Scores of 'red'"),
            ((elsewhere, 1, {"red": np.array([0.0, np.nan])}), "Scores of 'red'"),
        ):
            with pytest.raises((BadType, BadValue), match=message):
                games.load(*wrong)
        assert games.observe("red")["curr_pos"].tolist() == before
        assert games.turn.tolist() == [1, 1]


@pytest.mark.parametrize("record", [False, True])
def test_a_loaded_game_is_recorded_once_it_has_begun_again(tmp_path, record):
    with scene().batch(2, seed=1, record=record) as games:
        games.step()
        games.load(games.columns(), 1)
        games.step()
        with pytest.raises(BadValue, match="Game 0 was loaded, and its turns before are unknown"):
            games.record(0, tmp_path / "loaded.ggr")
        assert not (tmp_path / "loaded.ggr").exists()
        games.reset([0])
        games.step()
        games.record(0, tmp_path / "begun.ggr")
        with recorder.open(tmp_path / "begun.ggr") as recording:
            assert len(recording) == 1


def test_seeds_of_a_reset_are_as_many_as_its_games():
    with scene().batch(3, seed=1) as games:
        for seeds in ([5], []):
            with pytest.raises(BadValue, match=r"reset got \d seeds for 2 games"):
                games.reset([0, 1], seeds=seeds)
        with pytest.raises(BadValue, match="reset got 1 seeds for 0 games"):
            games.reset([], seeds=[7])
        games.reset([], seeds=[])
        assert games.seeds == (1, 2, 3)


def test_games_that_are_played_one_by_one_have_no_columns():
    with by_another_plan(scene()).batch(2) as games, pytest.raises(BadValue, match="because of the rule"):
        games.columns()


def alarm():
    """Yield whether to raise, at moments that are sent; a generator, for what else remembers is refused."""
    asked, at = 0, frozenset()
    while True:
        sent = yield asked in at
        if sent is None:
            asked += 1
        else:
            asked, at = 0, sent


ALARM = alarm()
next(ALARM)


def walk_and_ring(state):
    node = state["legal"][state["draw"].below(len(state["legal"]))]
    if ALARM.send(None):
        raise ZeroDivisionError
    state["action"] = node


def walk_and_press(state):
    node = state["legal"][state["draw"].below(len(state["legal"]))]
    if ALARM.send(None):
        raise KeyboardInterrupt
    state["action"] = node


PLAYED = {
    "in the core": (70, as_it_is),
    "few": (4, as_it_is),
    "one by one": (4, by_another_plan),
    "alone": (1, by_another_plan),
}


@pytest.mark.parametrize("how", PLAYED)
@pytest.mark.parametrize("by_turns", [False, True])
@pytest.mark.parametrize("walk", [walk_and_ring, walk_and_press])
def test_games_in_which_a_strategy_raises_go_on_as_if_it_had_not(how, by_turns, walk, tmp_path):
    number, way = PLAYED[how]
    game, team = way(scene(max_turns=9)), {"red": walk}
    ALARM.send(frozenset())
    results = [plain(game.play(seed=1 + i, strategies=team)) for i in range(number)]
    ALARM.send(frozenset({11, 20, 11 + 3 * number}))
    with game.batch(number, seed=1, record=True, strategies=team) as games:
        for _ in range(20):
            with suppress(ZeroDivisionError, KeyboardInterrupt):
                if by_turns:
                    games.step()
                else:
                    games.run()
            assert len(set(games.turn.tolist())) == 1 or not by_turns
        assert [plain(games.result(i)) for i in range(number)] == results
        games.record(0, tmp_path / "game.ggr")
        with recorder.open(tmp_path / "game.ggr") as recording:
            assert len(recording) == 9


def test_actions_that_are_given_after_an_interrupt_are_kept_for_the_turns_of_their_games():
    ALARM.send(frozenset({30}))
    with by_another_plan(scene(max_turns=9)).batch(3, seed=1, record=True, strategies={"red": walk_and_press}) as games:
        with pytest.raises(KeyboardInterrupt):
            games.run()
        assert games.turn.tolist() == [3, 3, 3]
        while not games.is_over.all():
            games.step({"blue": games.observe("blue").counts - 1})
        assert_as_shown(games)


def test_ctrl_c_comes_between_two_turns_of_a_batch():
    def press(ctx):
        if ctx.game.turn in (3, 5) and ctx.seed == 7:
            signal.raise_signal(signal.SIGINT)
        ctx.game.scores["red"] += 1

    with scene(max_turns=8).build(seed=1) as ctx:
        ctx.game.add(press)
        with ctx.game.batch(40, seed=1) as games:
            for turn in (3, 5):
                with pytest.raises(KeyboardInterrupt):
                    while True:
                        games.step()
                assert set(games.turn.tolist()) == {turn}
            games.run()
            assert set(games.scores["red"].tolist()) == {8}


@pytest.mark.parametrize("name", ["max_turns", "turn", "seeds"])
def test_attributes_of_batches_and_scenarios_cannot_be_set(name):
    game = scene()
    with game.batch(2) as games:
        for one, way_out in ((games, "settings are those of the scenario"), (game, r"scenario\.replace")):
            with pytest.raises(ReadOnly, match=rf"{name} of a (batch|scenario) cannot be set: {way_out}"):
                setattr(one, name, 3)
        assert games.seeds == (0, 1)


@pytest.mark.parametrize("copied", [pickle.dumps, copy.deepcopy])
@pytest.mark.parametrize("way", WAYS)
def test_a_batch_says_that_its_scenario_is_to_be_pickled(copied, way):
    with way(scene()).batch(2) as games, pytest.raises(BadType, match="Pickle its scenario"):
        copied(games)


@pytest.mark.parametrize("way", WAYS)
def test_a_closed_batch_plays_no_turn_and_keeps_its_results(way):
    with way(scene([TAG], max_turns=2)).batch(2) as games:
        games.run()
        known = games.result(1)
    for verb in (games.step, games.run, games.reset):
        with pytest.raises(BadValue, match="This batch is closed"):
            verb()
    assert games.is_closed
    assert games.result(1) == known


def test_a_wrong_chance_names_the_sensor_in_a_batch():
    near = {"near": {"type": "AGENT_RANGE", "sensor_range": 90.0}}
    chase = {"count": 1, "strategy": "gamms.strategies:chase", "sensors": ["near"]}
    teams = {"red": chase, "blue": {"count": 2, "strategy": "gamms.strategies:random_walk"}}
    with scene(sensors=near, teams=teams).build() as ctx:
        for sensor in ctx.agent.get_agent("red_0").sensors.values():
            sensor.notice.detection = lambda far: far + 2.0
            named = sensor.sensor_id
        with ctx.game.batch(2) as games, pytest.raises(BadValue, match=f"detection of '{named}' must give"):
            games.step()


def test_games_that_go_on_from_here_are_not_recorded():
    with scene([TAG]).build() as ctx, pytest.raises(BadValue, match="cannot be recorded"):
        ctx.game.batch(2, record=True)


def test_a_step_after_a_run_of_some_turns_leaves_a_game_unfinished_as_alone():
    scenario = scene(max_turns=4)
    with scenario.batch(1, seed=1) as games, scenario.build(seed=1) as alone:
        games.run(1)
        alone.game.run(1)
        for reason in ("max_turns", "unfinished", "unfinished", "max_turns"):
            assert games.result(0).reason == alone.game.result().reason == reason
            games.step()
            alone.game.step()
