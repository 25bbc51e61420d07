"""The stored description of the public API names what programs can use."""

import importlib
import runpy
import sys
from pathlib import Path

import pytest

SCRIPTS = Path(__file__).resolve().parents[2] / "scripts"


@pytest.fixture(scope="module")
def stored() -> list[str]:
    """The lines of the stored description."""
    return (SCRIPTS / "public_api.txt").read_text(encoding="utf-8").splitlines()


def test_each_stored_name_can_be_imported(stored: list[str]) -> None:
    paths = {line.removeprefix("class ").split("(")[0].split(":")[0].split()[0] for line in stored}
    packages = {".".join(path.split(".")[:2]) for path in paths}
    for path in paths:
        parts = path.split(".")
        depth = 2 if len(parts) > 2 and ".".join(parts[:2]) in packages and parts[1].islower() else 1
        module = importlib.import_module(".".join(parts[:depth]))
        assert hasattr(module, parts[depth]), path


def test_a_parameter_that_is_gone_is_a_change(stored: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "path", [str(SCRIPTS), *sys.path])
    compare = runpy.run_path(str(SCRIPTS / "check_api.py"))["compare"]
    line = next(one for one in stored if one.startswith("gamms.rules.tag("))
    shorter = line.replace(", ends: bool = False", "")
    assert shorter != line
    now = [shorter if one is line else one for one in stored]
    assert compare(stored, now) == [f"-{line}", f"+{shorter}"]
    assert compare(stored, stored) == []
