"""The example that trains pursuers, in a short version."""

import runpy
import sys
from pathlib import Path

import pytest

import gamms

pytest.importorskip("torch", reason='torch is not installed: pip install "gamms[train]"')

FILE = Path(__file__).parents[2] / "examples" / "rl" / "ppo.py"


def test_the_example_trains_and_compares(monkeypatch, capsys, tmp_path):
    options = ["--iterations", "1", "--seeds", "2", "--games", "20", "--held-out", "20", "--record"]
    monkeypatch.setattr(sys, "argv", [str(FILE), *options, str(tmp_path / "game.ggr")])
    runpy.run_path(str(FILE), run_name="__main__")
    with gamms.recorder.open(tmp_path / "game.ggr") as recording:
        assert 0 < recording.turns <= 150
    printed = capsys.readouterr().out
    assert "seed 2, iteration 1" in printed
    assert "more than chase: interquartile mean" in printed
