"""The benchmark suite: fixed tasks, and what a strategy achieves on them."""

import hashlib
import json
import os

import networkx as nx
import pytest
from typer.testing import CliRunner

from gamms import cli, recorder, rl, suite
from gamms.errors import BadValue, UnknownName
from gamms.scenario import Scenario, ScenarioError
from gamms.suite import protocol

FEW = ["pursuit-grid-c0505f71"]


def stay(state):
    state["action"] = state["curr_pos"]


def fail(state):
    raise ValueError("no")


def test_there_are_ten_tasks_of_five_kinds_on_two_maps():
    names = [task.name for task in suite.tasks()]
    assert names[0] == FEW[0]
    assert [name.rpartition("-")[0] for name in names] == [
        f"{kind}-{map}" for map in suite.MAPS for kind in suite.KINDS
    ]
    with pytest.raises(BadValue, match="no version 9 of the suite; there are the versions 1 and 2"):
        suite.tasks(9)


def test_the_name_of_a_task_follows_from_its_content(tmp_path, monkeypatch):
    changed = [task._replace(seeds=[1]) for task in suite.tasks()]
    (tmp_path / "suite_1.json").write_text(json.dumps([task._asdict() for task in changed]))
    monkeypatch.setattr(protocol, "_DATA", tmp_path)
    with pytest.raises(ValueError, match="task 'pursuit-grid-c0505f71' is not what its name says"):
        suite.tasks()


def test_the_tasks_are_those_that_the_generator_draws():
    made = []
    for map in suite.MAPS:
        for kind in suite.KINDS:
            drawn = suite.generate(kind, map, seed=1)
            played = drawn.team, drawn.opponent, drawn.opponents, list(range(20)), f"wins.{drawn.team}"
            made.append(protocol.add_digest(suite.Task(f"{kind}-{map}", drawn.scenario.to_dict(), *played)))
    assert made == suite.tasks()


@pytest.mark.parametrize("kind", suite.KINDS)
def test_a_generated_scenario_follows_from_its_seed_and_can_be_played(kind):
    one, same, other = (suite.generate(kind, seed=seed) for seed in (5, 5, 6))
    assert one == same
    assert one.scenario != other.scenario
    assert one.team in one.scenario.spec.teams
    assert len(one.opponents) == 3
    for strategy in one.opponents.values():
        game = one.scenario.replace(**{f"teams.{one.opponent}.strategy": strategy, "max_turns": 3})
        assert game.play(seed=1).turns <= 3
    with pytest.raises(BadValue, match=f"Did you mean '{kind}'"):
        suite.generate(f"{kind}x")


def test_a_strategy_has_a_row_with_its_worst_case_and_a_replay(tmp_path):
    results = suite.run(stay, only=FEW, seeds=range(3), out=tmp_path)
    table = {name: column.tolist() for name, column in results.table.items()}
    measured = ["games", "seeds", "errors", "mean", "low", "high"]
    assert list(table) == ["task", *measured, "worst", "worst_opponent", "replay"]
    assert (table["games"], table["seeds"]) == ([9], [3])
    assert all(low <= mean <= high for low, mean, high in zip(table["low"], table["mean"], table["high"], strict=True))
    rows = results.rows[FEW[0]]
    wins = {row["strategies.blue"]: 0 for row in rows}
    for row in rows:
        wins[row["strategies.blue"]] += row["winner"] == "red"
    assert table["worst"][0] == min(wins.values()) / 3
    assert wins[table["worst_opponent"][0]] == min(wins.values())
    with recorder.open(table["replay"][0]) as recording:
        assert recording.turns == next(
            row["turns"] for row in rows if row["strategies.blue"] == table["worst_opponent"][0]
        )


def test_a_strategy_that_raises_has_errors():
    results = suite.run(fail, only=FEW, seeds=[1])
    assert results.table["errors"].tolist() == [3]


def test_unknown_tasks_and_strategies_are_refused():
    with pytest.raises(UnknownName, match="Did you mean 'pursuit'"):
        suite.run(stay, only=["pursiut"])
    with pytest.raises(ScenarioError, match=r"teams\.red\.strategy"):
        suite.run("gamms.strategies:chas", only=FEW)


def test_the_results_of_a_baseline_are_those_of_its_games():
    pinned = suite.references()
    rows = [
        dict(zip(pinned, cells, strict=True)) for cells in zip(*(one.tolist() for one in pinned.values()), strict=True)
    ]
    assert len(rows) == len(suite.BASELINES) * len(suite.tasks())
    (row,) = (row for row in rows if row["task"] in FEW and row["baseline"] == "random_walk")
    table = suite.run("random_walk", only=FEW).table
    assert {name: table[name].tolist()[0] for name in table if name != "replay"} == {
        name: one for name, one in row.items() if name != "baseline"
    }


def test_districts_have_60_to_150_junctions_and_are_connected():
    train, test = (suite.districts(part) for part in ("train", "test"))
    assert {name.rpartition("_")[0] for name in train} == {*suite.CITIES["train"]}
    assert {name.rpartition("_")[0] for name in test} == {*suite.CITIES["test"]}
    for name in [*train, *test]:
        streets = suite.district(name)
        assert 60 <= len(streets) <= 150
        assert [*streets] == [*range(len(streets))]
        assert nx.is_strongly_connected(streets)
        assert "OpenStreetMap" in streets.graph["attribution"]
    with pytest.raises(UnknownName, match="Did you mean 'monaco_1'"):
        suite.district("monaco1")
    with pytest.raises(BadValue, match="part must be 'train' or 'test'"):
        suite.districts("trian")


def test_districts_are_maps_of_environments():
    task = suite.tasks(2)[0]
    with rl.Learners(Scenario(**task.scenario), 2, teams=["red"], maps=suite.districts("bejaia")) as learners:
        assert learners.games.num_maps == 6


def test_a_version_that_does_not_exist_has_no_references():
    with pytest.raises(BadValue, match="There is no version 3 of the suite; there are the versions 1 and 2"):
        suite.references(3)


def test_districts_never_change():
    files = sorted((protocol._DATA / "districts").glob("*.gamms"))
    digest = hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()
    assert (len(files), digest) == (31, "61c9680a44d83a6db8970f295c4485a04aff9fee23519734908498940097368c")


def test_tasks_of_version_2_order_their_baselines_with_intervals_apart():
    pinned = suite.references(2)
    names = zip(pinned["task"].tolist(), pinned["baseline"].tolist(), strict=True)
    found = {key: tuple(pinned[name][row] for name in ("low", "mean", "high")) for row, key in enumerate(names)}
    for task in suite.tasks(2):
        assert {name for of, name in found if of == task.name} == {*task.baselines}
        chase, exact = found[task.name, "chase"], found[task.name, "exact"]
        assert max(found[task.name, name][2] for name in ("stay", "random_walk")) < chase[0]
        assert chase[2] < exact[0]
        assert 0.2 <= chase[1] <= 0.8


def test_a_part_of_the_results_of_version_2_is_played_again():
    task = suite.tasks(2)[1]
    results = suite.run("chase", only=[task.name], version=2)
    rows = results.rows[task.name]
    assert {row["map"] for row in rows} == {*task.maps}
    assert {row["opponent.blue"] for row in rows} == {"exact", "flee", "safest_exit"}
    pinned = suite.references(2)
    (stored,) = [
        row
        for row, pair in enumerate(zip(pinned["baseline"].tolist(), pinned["task"].tolist(), strict=True))
        if pair == ("chase", task.name)
    ]
    table = results.table
    assert {name: table[name].tolist()[0] for name in table if name != "replay"} == {
        name: column.tolist()[stored] for name, column in pinned.items() if name != "baseline"
    }


def test_the_command_plays_code_in_a_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "players.py").write_text("def stay(state):\n    state['action'] = state['curr_pos']\n")
    given = ["suite", "players.py:stay", "--only", FEW[0], "--seeds", "0:2", "--workers", "0"]
    done = CliRunner().invoke(cli.app, given, catch_exceptions=False)
    assert done.exit_code == 0
    assert "pursuit-grid-c0505f71      6      2       0" in done.stdout
    assert json.loads((tmp_path / "gamms-suite" / "table.json").read_text())["games"] == [6]
    assert (tmp_path / "gamms-suite" / "pursuit-grid-c0505f71.ggr").exists()


def test_the_command_plays_version_2(tmp_path):
    task = suite.tasks(2)[2]
    given = ["suite", "follow_belief", "--version", "2", "--only", task.name, "--seeds", "0:1", "--workers", "0"]
    done = CliRunner().invoke(cli.app, [*given, "--out", str(tmp_path / "new")], catch_exceptions=False)
    assert done.exit_code == 0
    assert f"{task.name}      3      1       0" in done.stdout
    assert (tmp_path / "new" / f"{task.name}.ggr").exists()


def test_the_command_names_errors_of_a_strategy_of_a_package(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path / "packages")
    (tmp_path / "packages" / "mine").mkdir(parents=True)
    (tmp_path / "packages" / "mine" / "walks.py").write_text(
        "import os\n\ndef fail(state):\n    raise ValueError(f'no way in {os.getpid()}')\n"
    )
    given = ["suite", "mine.walks:fail", "--only", FEW[0], "--seeds", "0:1", "--workers", "0"]
    done = CliRunner().invoke(cli.app, given, catch_exceptions=False)
    assert done.exit_code == 0
    assert done.stderr.splitlines()[-1].startswith(
        f"{FEW[0]}: 3 of 3 games have raised; ValueError: no way in {os.getpid()}"  # no process of its own
    )


def test_the_command_plays_all_baselines(tmp_path):
    given = [
        "suite",
        "references",
        "--only",
        FEW[0],
        "--seeds",
        "0:1",
        "--workers",
        "0",
        "--out",
        str(tmp_path / "new"),
    ]
    done = CliRunner().invoke(cli.app, given, catch_exceptions=False)
    assert done.exit_code == 0
    assert "These are not the seeds of the protocol" in done.stdout
    rows = json.loads((tmp_path / "new" / "references.json").read_text())
    assert [row["baseline"] for row in rows] == list(suite.BASELINES)
    assert all(row.keys() == {*suite.references()} for row in rows)
    table = suite.run("random_walk", only=FEW, seeds=[0]).table
    assert [rows[1][column] for column in ("games", "mean", "worst")] == [3, table["mean"][0], table["worst"][0]]
