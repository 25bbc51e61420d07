"""The figures that the documentation shows; `make figures` makes them again, `test_docs.py` compares them."""

import json
import runpy
from pathlib import Path

import pytest
from figure_files import assert_same_figure

ROOT = Path(__file__).parents[2]
SHOWN = Path(__file__).parents[2] / "docs/figures"
NAMES = ("capture_the_flag", "city", "from_the_air", "grid_world")


def test_the_figures_of_the_example_are_shown_in_both_formats():
    files = {f"{name}{suffix}" for name in NAMES for suffix in (".png", ".svg")}
    assert files <= {path.name for path in SHOWN.iterdir()}


@pytest.mark.parametrize("name", ["capture_the_flag", "city", "from_the_air"])
def test_a_figure_of_a_real_map_names_its_source(name):
    assert "OpenStreetMap contributors" in (SHOWN / f"{name}.svg").read_text()


def test_the_figures_stay_small():
    assert max(path.stat().st_size for path in SHOWN.rglob("*.*")) < 600_000


def test_the_curves_of_learning_are_those_of_stored_results(tmp_path):
    pytest.importorskip("matplotlib", reason="Matplotlib is not installed")
    script = runpy.run_path(str(ROOT / "scripts" / "learning_curves.py"))
    results = json.loads(script["RESULTS"].read_text())
    assert results["command"].split() == ["python", "scripts/learning_curves.py"]
    script["draw"](results["curves"], tmp_path)
    page = (ROOT / "docs" / "learning.md").read_text()
    assert results["command"] in page
    for name, curves in results["curves"].items():
        assert (ROOT / "examples" / "rl" / f"{name}.py").exists()
        assert len(curves) == len(results["seeds"]) == 5
        assert len({len(curve) for curve in curves}) == 1
        assert f"figures/learning_curves/{name}.png" in page
        assert_same_figure(script["FIGURES"] / f"{name}.png", tmp_path / f"{name}.png")
