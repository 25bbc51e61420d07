"""Spreadsheets open CSV files, and take texts that begin with = for formulas: no file of ours has one."""

import csv
import json

import pytest
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

import gamms
from gamms import experiment, recorder, recordings, web
from gamms.cli import app
from gamms.scenario import Scenario
from gamms.text import as_cell, parse_cell

EVIL = '=HYPERLINK("http://x","y")'
GAME = {
    "map": {"grid": {"width": 3, "height": 1}},
    "teams": {
        EVIL: {"agents": [{"name": "+ann", "node": 0}], "strategy": "gamms.strategies:random_walk"},
        "-b": {"agents": [{"name": "@bob", "node": 2}], "strategy": "gamms.strategies:stay"},
    },
    "rules": [{"rule": "reach", "with": {"team": "-b", "nodes": [2]}}],
    "max_turns": 1,
}


def cells(file):
    with file.open(newline="", encoding="utf-8") as stream:
        return {cell for row in csv.reader(stream) for cell in row}


def formulas(file):
    return [cell for cell in cells(file) if cell.startswith(("=", "+", "-", "@", "\t", "\r")) and not is_number(cell)]


def is_number(cell):
    try:
        return float(cell) is not None
    except ValueError:
        return False


def of_an_experiment(folder):
    experiment.run(Scenario(**GAME), [1], {"name": [EVIL, "-x"]}, out=folder)
    return [folder / "rows.csv"]


def of_several_games(folder):
    (folder / "game.yaml").write_text(json.dumps(GAME))
    done = CliRunner().invoke(app, ["run", str(folder / "game.yaml"), "--seeds", "0:2", "--out", str(folder)])
    assert done.exit_code == 0, done.output
    return [folder / "results.csv"]


def of_a_recording(folder):
    Scenario(**GAME).play(1, record=folder / "game.ggr")
    return recordings.to_csv(folder / "game.ggr", folder / "game.csv")[0]


def of_tracks(folder):
    Scenario(**GAME).play(1, record=folder / "game.ggr")
    with recorder.open(folder / "game.ggr") as recording:
        recording.export(folder / "tracks.csv")
    return [folder / "tracks.csv"]


def of_a_graph(folder):
    ctx = gamms.create_context()
    ctx.graph.graph.add_node({"id": 0, "x": -1.0, "y": 0.0, "=name": "=1+1"})
    ctx.graph.export(folder / "town.csv")
    ctx.terminate()
    return [folder / "town_nodes.csv"]


def of_a_study(folder):
    with web.study(Scenario(**GAME), consent="Yes?", out=folder, people="-b", conditions={EVIL: {}}) as study:
        study._rows = [{"participant": "-5", "condition": EVIL, "number": -5}]
        study._write_csv()
    return [folder / "rows.csv"]


@pytest.mark.parametrize(
    "write", [of_an_experiment, of_several_games, of_a_recording, of_tracks, of_a_graph, of_a_study]
)
def test_no_cell_is_a_formula(write, tmp_path):
    files = write(tmp_path)
    assert [formulas(file) for file in files] == [[]] * len(files)
    assert any(cell.startswith("'") for file in files for cell in cells(file))


@given(text=st.text(st.sampled_from("'=+-@\t\r1.eE ab"), max_size=6))
def test_a_written_formula_is_read_again(text):
    assert parse_cell(as_cell(text)) == text


@pytest.mark.parametrize("value", [-1, -1.5, float("-inf"), "-1", "+1.5e-3", "-.5", None, "a=b", True])
def test_numbers_and_other_texts_stay(value):
    assert as_cell(value) is value
