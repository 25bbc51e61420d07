"""The example that trains pursuers, in a short version."""

import runpy
import sys
from pathlib import Path

import pytest

pytest.importorskip("torch", reason='torch is not installed: pip install "gamms[train]"')

FILE = Path(__file__).parents[2] / "examples" / "rl" / "ppo.py"


def test_the_example_trains_and_compares(monkeypatch, capsys):
    monkeypatch.setattr(
        sys, "argv", [str(FILE), "--iterations", "1", "--seeds", "2", "--games", "20", "--held-out", "20"]
    )
    runpy.run_path(str(FILE), run_name="__main__")
    printed = capsys.readouterr().out
    assert "seed 2, iteration 1" in printed
    assert "more than chase: interquartile mean" in printed
