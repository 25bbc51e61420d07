"""The page about reproduced results has what its programs find, and every result agrees with what is expected."""

import math
import os
import re
import runpy
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "tests" / "rebuilt_games"))
from code_lines import code_lines  # noqa: E402

PAGE = ROOT / "docs" / "reproduced.md"
PROGRAMS = sorted((ROOT / "examples" / "reproduced").glob("*.py"))


def show(value):
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def find_lines(program, source):
    """Return the rows of the page about a program, which is run."""
    lines = []
    for row in runpy.run_path(str(program), run_name="__main__")["rows"]:
        low, high = row.get("low", math.nan), row.get("high", math.nan)
        interval = "" if math.isnan(low) else f" [{show(low)}, {show(high)}]"
        agrees = "yes" if row["agrees"] else "NO"
        command = f"`python {program.relative_to(ROOT).as_posix()}`"
        cells = (row["result"], source, command, show(row["expected"]), show(row["ours"]) + interval, agrees)
        lines.append(f"| {' | '.join(cells)} |\n")
    return lines


@pytest.mark.parametrize("program", PROGRAMS, ids=lambda path: path.stem)
def test_a_program_prints_the_results_that_the_page_has(program, capsys):
    page = PAGE.read_text(encoding="utf-8")
    shown = re.findall(rf"^\| .*/{program.name}` \|.*\n", page, re.MULTILINE)
    lines = find_lines(program, source=shown[0].split(" | ")[1])
    if os.environ.get("GAMMS_REFRESH_EXAMPLES") == "1":
        PAGE.write_text(page.replace("".join(shown), "".join(lines)), encoding="utf-8")
    else:
        assert shown == lines
    assert not [line for line in lines if not line.endswith(" | yes |\n")]
    assert capsys.readouterr().out.count("True\n") == len(lines)


@pytest.mark.parametrize("program", PROGRAMS, ids=lambda path: path.stem)
def test_a_program_has_at_most_50_lines_of_code(program, tmp_path):
    whole = tmp_path / program.name
    whole.write_text(program.read_text(encoding="utf-8").replace('if __name__ == "__main__":', "if True:"))
    assert code_lines(whole) <= 50
