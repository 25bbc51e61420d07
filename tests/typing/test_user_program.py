"""What a type checker makes of a user's program."""

import subprocess
import sys

import pytest


def checked(tmp_path, program):
    (tmp_path / "program.py").write_text(program)
    command = [sys.executable, "-m", "mypy", "--strict", "--cache-dir", str(tmp_path / "cache"), "program.py"]
    return subprocess.run(command, check=False, cwd=tmp_path, text=True, capture_output=True).stdout


@pytest.mark.slow
def test_every_package_is_typed_after_import_gamms_and_misspelt_names_are_errors(tmp_path):
    said = checked(
        tmp_path,
        """
import gamms

ctx = gamms.create_context(seed=1)
gamms.osm.helsinki(ctx)
gamms.strategies.chase(ctx, otherwise=gamms.strategies.stay)
gamms.rules.tag("red", "blue")
gamms.scenario.load("game.yaml").play(seed=7)
gamms.recorder.open("game.ggr")
gamms.rulez
""",
    )
    assert 'Module has no attribute "rulez"' in said
    assert "Found 1 error" in said
