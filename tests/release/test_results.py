"""The page of results is what its raw data say."""

import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture
def results_page(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "scripts"))
    import results_page

    yield results_page
    sys.modules.pop("run", None)  # a short name for a module that only this page needs


def test_the_tables_of_the_page_are_those_of_the_raw_data(results_page):
    assert results_page.PAGE.read_text(encoding="utf-8") == results_page.page()


def test_a_ratio_above_its_aim_is_named_first(results_page):
    case = {"name": "teams: a walk", "against": "NumPy", "ratio": 0.05, "aim": 1 / 40}
    assert results_page._missed([case]) == "* a walk: 1 / 20 of NumPy, aim 1 / 40"
    assert results_page._missed([case | {"aim": 0.05}]) == "None of those that have one."
