"""Scripts beside the package use names that it has, and a page that a script writes is what it would write now."""

import ast
import runpy
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SCRIPTS = sorted(path for folder in ("benchmarks", "scripts", "examples") for path in (ROOT / folder).rglob("*.py"))


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_names_that_scripts_import_from_the_package_exist(script: Path) -> None:
    imports = [node for node in ast.walk(ast.parse(script.read_text("utf-8"))) if isinstance(node, ast.ImportFrom)]
    names = [(node.module, alias.name) for node in imports for alias in node.names if node.module]
    for module, name in names:
        if module.split(".")[0] == "gamms":
            exec(f"from {module} import {name}")


def test_the_page_of_benchmarks_is_one_screen_with_the_table_of_the_raw_data(monkeypatch) -> None:
    monkeypatch.setattr(sys, "path", [*sys.path])  # the script adds the folder of benchmarks
    page = (ROOT / "benchmarks" / "README.md").read_text(encoding="utf-8")
    assert len(page.split()) <= 900
    table = page.partition("<!-- table -->\n")[2].partition("<!-- end of the table -->")[0]
    assert table == runpy.run_path(str(ROOT / "scripts" / "results_page.py"))["compare"]()
    for peer in ("Mesa", "SUMO", "POGEMA", "PettingZoo", "JaxMARL", "VMAS", "OpenSpiel", "SciPy", "gamms 1.0.0"):
        assert f"| {peer}" in table
