"""The examples that train pursuers, in short versions."""

import json
import runpy
import sys
from pathlib import Path

import pytest

import gamms
from gamms.game.plan import find_first_called

pytest.importorskip("torch", reason='torch is not installed: pip install ".[train]"')
pytest.importorskip("sb3_contrib", reason='sb3-contrib is not installed: pip install ".[train]"')

FOLDER = Path(__file__).parents[2] / "examples" / "rl"


@pytest.mark.parametrize("name", ["ppo", "sb3"])
def test_an_example_trains_and_compares(name, monkeypatch, capsys, tmp_path):
    file = FOLDER / f"{name}.py"
    options = ["--iterations", "1", "--seeds", "2", "--games", "20", "--held-out", "20", "--out", str(tmp_path)]
    monkeypatch.setattr(sys, "argv", [str(file), *options, "--record", str(tmp_path / "game.ggr")])
    monkeypatch.syspath_prepend(FOLDER)
    runpy.run_path(str(file), run_name="__main__")
    with gamms.recorder.open(tmp_path / "game.ggr") as recording:
        assert 0 < recording.turns <= 150
    printed = capsys.readouterr().out
    assert "seed 2: " in printed
    assert "more than chase: interquartile mean" in printed


def test_a_policy_of_the_example_plays_the_same_games_alone_and_in_a_batch(monkeypatch, tmp_path):
    monkeypatch.syspath_prepend(FOLDER)
    pursuit = runpy.run_path(str(FOLDER / "pursuit.py"))
    train = runpy.run_path(str(FOLDER / "ppo.py"))["train"]
    scenario = pursuit["SCENARIO"]
    learner = {"observation": pursuit["observe"], "reward": pursuit["reward"]}
    train(gamms.rl.vector_env(scenario, num_games=10, team="red", **learner), tmp_path / "red.safetensors", 1, 1)
    red = gamms.rl.policy(tmp_path / "red.safetensors", observation=pursuit["observe"])
    with scenario.batch(5, seed=3, strategies={"red": red}) as games:
        games.run()
        assert find_first_called(games.game, games.roster) is None
        for game in range(5):
            assert games.result(game) == scenario.play(seed=3 + game, strategies={"red": red})


def test_a_policy_of_some_districts_is_evaluated_in_others(monkeypatch, tmp_path):
    monkeypatch.syspath_prepend(FOLDER)
    example = runpy.run_path(str(FOLDER / "many_maps.py"))
    shares = example["learn"](tmp_path / "red.safetensors", iterations=1, num_games=24)
    assert len(shares) == 1
    found = example["compare"](tmp_path / "red.safetensors", games=2)
    assert len(found.rows) == 6 * 3 * 2 * 2
    assert {row["strategies.red"] for row in found.rows} == {"chase", "policy", "exact"}
    assert {row["winner"] for row in found.rows if row["strategies.red"] == "exact"} == {"red"}
    table = found.table()
    shares = zip(table["map"], table["strategies.red"], table["strategies.blue"], table["gap_closed"], strict=True)
    assert [gap for *setting, gap in shares if setting == ["all maps", "exact", "exact"]] == [1.0]


def test_a_policy_learns_from_exact_play_and_its_card_says_how_well(monkeypatch, tmp_path):
    for number, name in enumerate(("helsinki_1", "helsinki_2", "monaco_1")):
        with gamms.create_context() as ctx:
            ctx.graph.attach_networkx_graph(gamms.graph.grid(rows=6 + number, columns=8))
            ctx.graph.save(tmp_path / f"{name}.gamms")
    monkeypatch.syspath_prepend(FOLDER)
    file = tmp_path / "red.safetensors"
    options = ["--seconds", "1", "--width", "8", "--games", "6", "--out", str(file)]
    monkeypatch.setattr(sys, "argv", ["exact_teacher.py", str(tmp_path), *options])
    runpy.run_path(str(FOLDER / "exact_teacher.py"), run_name="__main__")
    card = json.loads(file.with_suffix(".json").read_text())
    assert card["training"] == ["helsinki_1.gamms", "helsinki_2.gamms"]
    assert {*card["test"]["map"]} == {"monaco_1", "all maps"}
    assert {*card["test"]["strategies.red"]} == {"chase", "policy", "exact"}
