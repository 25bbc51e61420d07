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
    look = {"name": "a look", "aims": [14, 2], "SQLITE": {"ratio": 13.0}, "MEMORY": {"ratio": 2.0}}
    lines = ["* a walk: 1 / 20 of NumPy, aim 1 / 40", "* a look: 13 of the speed of 1.0.0 with SQLITE, aim 14"]
    assert results_page._missed([case], [look, {"name": "a size", "aims": [None, 3]}]) == "\n".join(lines)
    assert results_page._missed([case | {"aim": 0.05}], []) == "None of those that have one."


def test_where_ours_is_slower_than_1_0_0_or_a_peer_is_named_first(results_page):
    slow = {"name": "a context", "MEMORY": {"ratio": 0.5}, "SQLITE": {"ratio": 8.0}}
    peers = [{"name": "A", "ratio": 0.25}, {"name": "B", "ratio": 2.0}, {"name": "C", "error": "not installed"}]
    lines = ["* a context: 0.5 of the speed of 1.0.0 with MEMORY", "* A: 0.25 of its speed"]
    assert results_page._slower([slow], peers) == "\n".join(lines)
    assert results_page._slower([], peers[1:]) == "Nowhere in what was measured."


def test_a_row_against_1_0_0_has_both_engines_their_ratios_and_aims(results_page):
    side = {"1.0.0": 2e-3, "ours": 1e-3, "ratio": 2.0, "least": 1.5, "greatest": 2.5}
    row = {"name": "a look", "unit": "s a look", "aims": [1, 3], "SQLITE": side, "MEMORY": side}
    size = {"name": "a file", "unit": "bytes an agent-step", "aims": [None, None], "MEMORY": side}
    part = {"command": "c", "seconds": 1, "output": [{"1.0.0": {"gamms": "1.0.0"}, "ours": {}}, row, size]}
    table = results_page._against(part).splitlines()[-2:]
    assert table[0] == "| a look | look | 2 ms | 2 ms | 1 ms | 2 [1.5, 2.5], 1 | 2 [1.5, 2.5], 3 |"
    assert table[1] == "| a file | agent-step |  | 0.002 bytes | 0.001 bytes |  | 2 [1.5, 2.5] |"


def test_raw_data_do_not_say_where_other_pythons_are(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "scripts"))
    import reproduce

    assert reproduce._unnamed(["--peer", "/home/me/python", "--python=/x/y"]) == ["--peer", "PYTHON", "--python=PYTHON"]
    sys.modules.pop("run", None)


def test_data_of_a_part_that_has_failed_are_not_expected(results_page, monkeypatch, tmp_path):
    import reproduce

    expected = []
    monkeypatch.setattr(reproduce, "PARTS", {"laws": ["-c", "1 / 0"], "values": ["-c", "print(1)"]})
    monkeypatch.setattr(reproduce, "_expect", lambda _, parts: expected.append(parts))
    monkeypatch.setattr(sys, "argv", ["reproduce.py", "--out", str(tmp_path), "--only", "laws", "values", "--expect"])
    assert (reproduce.main(), expected) == (1, [["values"]])
