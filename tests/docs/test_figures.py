"""The figures that the documentation shows; `make figures` makes them again, `test_docs.py` compares them."""

from pathlib import Path

import pytest

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
