"""The figures that the documentation shows are those that example and demo make; `make figures` refreshes them."""

import runpy
from pathlib import Path

import pytest
from figure_files import assert_same_figure
from typer.testing import CliRunner

from gamms import cli

ROOT = Path(__file__).parents[2]
SHOWN = ROOT / "docs/figures"
NAMES = ("capture_the_flag", "city", "from_the_air", "grid_world")


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """The folder with figures made just now."""
    folder = tmp_path_factory.mktemp("figures")
    runpy.run_path(str(ROOT / "examples/figures.py"))["main"](folder)
    return folder


def test_these_are_the_figures(made):
    files = sorted(f"{name}{suffix}" for name in NAMES for suffix in (".png", ".svg"))
    assert sorted(path.name for path in made.iterdir()) == files
    assert set(files) <= {path.name for path in SHOWN.iterdir()}


@pytest.mark.parametrize("suffix", [".png", ".svg"])
@pytest.mark.parametrize("name", NAMES)
def test_a_figure_shows_what_it_showed(made, name, suffix):
    assert_same_figure(SHOWN / f"{name}{suffix}", made / f"{name}{suffix}")


@pytest.mark.parametrize("name", ["capture_the_flag", "city", "from_the_air"])
def test_a_figure_of_a_real_map_names_its_source(made, name):
    assert "OpenStreetMap contributors" in (made / f"{name}.svg").read_text()


def test_the_picture_of_the_readme_is_what_the_demo_draws(tmp_path):
    CliRunner().invoke(cli.app, ["demo", "--no-film", "--out", str(tmp_path)], catch_exceptions=False)
    assert (tmp_path / "final.svg").read_text() == (ROOT / "docs/demo.svg").read_text()


def test_the_figures_stay_small():
    assert max(path.stat().st_size for path in SHOWN.rglob("*.*")) < 600_000
