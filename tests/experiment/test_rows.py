"""What an experiment plays, and the row of each game."""

import json
from concurrent.futures import BrokenExecutor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from functools import partial
from multiprocessing import get_context

import numpy as np
import pytest
import small_hunts
from small_hunts import HUNT, wait_here

from gamms import experiment, recorder
from gamms.errors import BadType, BadValue, UnknownName
from gamms.experiment import Rows
from gamms.scenario import Scenario, ScenarioError

GRID = {"teams.red.count": [1, 2], "strategies.blue": ["gamms.strategies:random_walk", small_hunts.wait_here]}


def test_every_combination_is_played_with_every_seed():
    rows = experiment.run(HUNT, range(3), GRID)
    found = [(row["teams.red.count"], row["strategies.blue"], row["seed"]) for row in rows]
    names = ["gamms.strategies:random_walk", "wait_here"]
    assert found == [(count, name, seed) for count in (1, 2) for name in names for seed in range(3)]
    assert len({row["id"] for row in rows}) == 12
    assert repr(rows) == "Rows(12 games, varied: teams.red.count, strategies.blue)"


def test_a_row_says_what_came_of_the_game_that_its_seed_and_settings_play():
    collect = {"tags": small_hunts.count_tags, "ends": lambda result: [result.turns, None]}
    row = experiment.run(HUNT, [7], {"teams.red.count": [3]}, collect=collect)[0]
    result = HUNT.replace(**{"teams.red.count": 3}).play(seed=7)
    assert row["turns"] == result.turns
    assert row["reason"] == result.reason
    assert row["winner"] == result.winner
    assert row["score.red"] == result.scores.get("red", 0)
    assert row["agents.red"] == 3
    assert row["moves.red"] == sum(one["moves"] for one in result.agents.values() if one["team"] == "red")
    assert row["collector.tags"] == small_hunts.count_tags(result)
    assert row["collector.ends"] == f"[{result.turns}, null]"
    assert row["error"] is None


def test_rows_are_the_same_in_this_process_and_in_others_in_batches_and_one_by_one(pool):
    here, there = (experiment.run(HUNT, range(5), GRID, executor=one) for one in (None, pool))
    assert list(here) == list(there)
    alone = [experiment.run(HUNT, [seed], GRID)[number] for number in range(4) for seed in range(5)]
    assert alone == list(here)


def test_a_value_has_the_name_that_a_dict_gives_it():
    blue = {"still": small_hunts.wait_here, "restless": None}
    rows = experiment.run(HUNT, [1], {"strategies.blue": blue})
    assert [row["strategies.blue"] for row in rows] == ["still", "restless"]
    assert rows[0]["moves.blue"] == 0
    assert rows[1]["moves.blue"] > 0


def test_variants_can_be_listed():
    rows = experiment.run(HUNT, [1], [{"teams.red.count": 1, "max_turns": 2}, {"teams.red.count": 2, "max_turns": 1}])
    assert [(row["agents.red"], row["max_turns"]) for row in rows] == [(1, 2), (2, 1)]
    again = experiment.run(HUNT, [1], [{"max_turns": np.int64(2), "teams.red.count": 1}])[0]
    assert (again["id"], again["max_turns"]) == (rows[0]["id"], 2), "neither the order of keys nor NumPy matters"


def test_a_column_of_numbers_and_texts_has_them_as_they_are():
    rows = experiment.run(HUNT.replace(data={"pay": 0}), [1], {"data.pay": [1, "two"]})
    assert rows.table()["data.pay"].tolist() == [1, "two"]


@pytest.mark.parametrize(
    ("vary", "error", "message"),
    [
        ({"teams.red.cuont": [1]}, ScenarioError, "Did you mean 'count'"),
        ({"strategies.rde": [None]}, UnknownName, "Did you mean 'red'"),
        ({"rules.tag.with.hopps": [1]}, ScenarioError, "Did you mean 'hops'"),
        ({"data.gaol": [1]}, ScenarioError, "Give it a first value"),
        ({"seed": [1]}, BadValue, "give seeds"),
        ({"max_turns": []}, BadValue, "no values"),
        ({"max_turns": [1, 2, 1]}, BadValue, "'max_turns' in vary is there twice"),
        ({"strategies.red": [lambda state: None, lambda state: None]}, BadValue, "Give a dict of names"),
    ],
)
def test_settings_that_cannot_be_varied_are_refused_with_a_way_out(vary, error, message):
    with pytest.raises(error, match=message):
        experiment.run(HUNT, [1], vary)


def test_a_rule_of_a_file_is_varied_by_the_name_of_its_function(tmp_path):
    (tmp_path / "referee.py").write_text("def toll(ctx, price):\n    ctx.game.scores['red'] -= price\n")
    paying = {"rule": "referee:toll", "with": {"price": 0}}
    game = Scenario(**{**HUNT.to_dict(), "rules": [paying], "max_turns": 2}, folder=tmp_path)
    rows = experiment.run(game, [1], {"rules.toll.with.price": [1, 5]})
    assert rows.table()["score.red"].tolist() == [-2.0, -10.0]
    other = game.replace(rules=[paying, {"rule": "deeper.referee:toll", "with": {"price": 0}}])
    with pytest.raises(ScenarioError, match=r"There are: 'referee:toll', 'deeper\.referee:toll'"):
        experiment.run(other, [1], {"rules.toll.with.price": [1]})


def test_a_collector_that_takes_no_result_is_refused():
    with pytest.raises(BadType, match="'tags' of collect must be a function of a result"):
        experiment.run(HUNT, [1], collect={"tags": lambda: 0})


def test_values_that_cannot_be_pickled_are_named_before_anything_starts(pool):
    with pytest.raises(BadValue, match=r"strategies\.red of vary, .*lambda.* Define it with def"):
        experiment.run(HUNT, [1], {"strategies.red": [lambda state: None]}, executor=pool)
    with pytest.raises(BadValue, match=r"'tags' of collect"):
        experiment.run(HUNT, [1], collect={"tags": lambda result: 0}, executor=pool)


def test_a_game_that_raises_is_a_row_with_an_error(pool):
    vary = {"strategies.blue": [small_hunts.raise_at_times]}
    rows = experiment.run(HUNT, range(6), vary)
    assert list(experiment.run(HUNT, range(6), vary, executor=pool)) == list(rows)
    assert 0 < len(rows.errors()) < 6
    assert rows.errors()[0]["error"] == "ValueError: no way In the strategy of agent 'blue_0', in turn 2."
    assert np.isnan(rows.table()["turns"]).sum() == len(rows.errors())
    with pytest.raises(BadValue, match=r"ended without an error: rows.errors\(\) says why"):
        Rows(rows.errors(), rows.keys).plot()


def test_a_process_that_dies_is_a_row_with_an_error_after_a_second_time(pool):
    vary = {"strategies.blue": {"deadly": small_hunts.die_at_times}}
    rows = experiment.run(HUNT, range(4), vary, executor=pool)
    died = "WorkerDied: the process that played it ended, with exit code 3"
    assert [row["error"] for row in rows] == [None, None, died, died]


def test_a_process_that_is_killed_once_changes_nothing(pool, tmp_path):
    once = tmp_path / "once"
    once.touch()
    hunt, vary = HUNT.replace(facts={"once": str(once)}), {"strategies.blue": [small_hunts.be_killed_once]}
    rows = experiment.run(hunt, range(3), vary, executor=pool)
    assert not once.exists()
    assert list(rows) == list(experiment.run(hunt, range(3), vary))


def test_the_game_of_a_row_is_played_again_and_recorded(tmp_path):
    rows = experiment.run(HUNT, range(3), GRID)
    result = rows.play(rows[4]["id"], record=tmp_path / "game.ggr")
    assert result.row()["moves.blue"] == rows[4]["moves.blue"]
    with recorder.open(tmp_path / "game.ggr") as recording:
        assert recording.turns == rows[4]["turns"]
    for number in (4, 4 - len(rows)):
        with rows.build(number) as ctx:
            assert ctx.game.run() == result
    assert rows.play(-len(rows)) == rows.play(0)
    with pytest.raises(UnknownName, match="Unknown row 'x'"):
        rows.play("x")
    for number in (len(rows), -len(rows) - 1):
        with pytest.raises(BadValue, match=f"no row {number}"):
            rows.play(number)


def test_games_are_played_again_by_the_plan_in_their_folder(tmp_path):
    vary = {"teams.red.count": [1, 3], "strategies.blue": {"walking": None, "chasing": "gamms.strategies:chase"}}
    played = experiment.run(HUNT, range(2), vary, out=tmp_path)
    rows = experiment.load(tmp_path)
    for row in rows:
        assert rows.play(row["id"]) == played.play(row["id"])


def test_a_game_is_played_again_only_with_its_code(tmp_path):
    players = "def hide(state):\n    state['action'] = state['curr_pos']\n"
    (tmp_path / "players.py").write_text(players)
    scenario = Scenario(**HUNT.to_dict(), folder=tmp_path)
    vary = {"strategies.blue": [None, "players:hide"]}
    played = experiment.run(scenario, range(2), vary, out=tmp_path / "hunts")
    rows = experiment.load(tmp_path / "hunts")
    assert rows.play(0) == played.play(0)
    with pytest.raises(ScenarioError, match=r"teams\.blue\.strategy.*'players'.*Give load\(…, folder=…\)"):
        rows.play(2)
    assert experiment.load(tmp_path / "hunts", folder=tmp_path).play(2) == played.play(2)
    (tmp_path / "players.py").write_text(f"{players}\n# edited\n")
    with pytest.raises(BadValue, match="has changed"):
        experiment.load(tmp_path / "hunts", folder=tmp_path).play(2)
    (tmp_path / "players.py").write_text("")
    with pytest.raises(ScenarioError, match="no function 'hide'"):
        experiment.load(tmp_path / "hunts", folder=tmp_path).play(2)


def test_a_plan_of_a_stranger_says_not_where_code_is(tmp_path):
    experiment.run(HUNT, range(1), out=tmp_path)
    file = tmp_path / "experiment.json"
    plan = json.loads(file.read_text())
    (tmp_path / "players.py").write_text("raise SystemExit('was run')")
    plan["changes"] = [{"folder": str(tmp_path), "teams.blue.strategy": "players:hide"}]
    file.write_text(json.dumps(plan))
    with pytest.raises(ScenarioError, match="folder: unknown key"):
        experiment.load(tmp_path).play(0)


def test_the_digest_of_rows_knows_neither_versions_nor_order(tmp_path, pool):
    rows = experiment.run(HUNT, range(4), GRID)
    others = [
        {**row, "numpy": "1", "python": "2", "gamms": "3", "collector.none": None} for row in reversed(list(rows))
    ]
    assert Rows(others, rows.keys).sha256() == rows.sha256()
    assert experiment.run(HUNT, range(4), GRID, executor=pool).sha256() == rows.sha256()
    for number in (1, 2):
        experiment.run(HUNT, range(4), GRID, out=tmp_path, shard=(number, 2))
    experiment.merge(tmp_path)
    assert experiment.load(tmp_path).sha256() == rows.sha256()
    others[0]["turns"] += 1
    assert Rows(others, rows.keys).sha256() != rows.sha256()
    assert Rows(others[1:], rows.keys).sha256() != rows.sha256()


def test_games_by_functions_are_played_again_only_with_their_scenario(tmp_path):
    experiment.run(HUNT, range(2), {"strategies.blue": [wait_here]}, out=tmp_path / "functions")
    with pytest.raises(BadValue, match="Give load"):
        experiment.load(tmp_path / "functions").play(0)
    experiment.run(HUNT, range(2), out=tmp_path / "hunts")
    assert experiment.load(tmp_path / "hunts", scenario=HUNT).play(1) == HUNT.play(1)
    with pytest.raises(BadType, match="must be a Scenario or a file, not 5"):
        experiment.run(5, range(2))


@pytest.mark.parametrize("make", [ThreadPoolExecutor, partial(ProcessPoolExecutor, mp_context=get_context("spawn"))])
def test_any_executor_plays(make):
    with make(1) as executor:
        rows = experiment.run(HUNT, range(2), executor=executor)
    assert list(rows) == list(experiment.run(HUNT, range(2)))


class Losing(ThreadPoolExecutor):
    """Loses the first task of many games, as if its process had died."""

    lost = 0

    def submit(self, function, task, /):
        if self.lost or len(task.seeds) <= 8:
            return super().submit(function, task)
        self.lost, future = len(task.seeds), Future()
        future.set_exception(BrokenExecutor("it ended"))
        return future


def test_a_task_of_many_games_whose_process_died_is_played_again_in_parts():
    with Losing(1) as executor:
        rows = experiment.run(HUNT, range(40), executor=executor, workers=1)
    assert executor.lost > 8
    assert list(rows) == list(experiment.run(HUNT, range(40)))


def test_wins_of_a_team_that_never_played_are_refused():
    rows = experiment.run(HUNT, range(2))
    assert rows.summary(metrics=["wins.red"])["metric"].tolist() == ["wins.red"]
    with pytest.raises(UnknownName, match=r"Unknown column of numbers 'wins.rde'. Did you mean 'wins.red'\?"):
        rows.summary(metrics=["wins.rde"])
