"""docs/architecture.md names files and functions that exist, and its drawings are those of the present imports."""

import re
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SRC = ROOT / "src" / "gamms"
PAGES = [ROOT / "docs" / "architecture.md", ROOT / "CONTRIBUTING.md", ROOT / "docs" / "glossary.md"]
ROW = re.compile(r"^\| (.+?) \| (.+?) \| (.*?) \| (.+?) \|$", re.MULTILINE)

sys.path.insert(0, str(ROOT / "scripts"))
import draw_architecture  # noqa: E402


def paths_in(text):
    return set(re.findall(r"`([\w./]+(?:\.py|\.md|\.toml|/))`", text))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_file_that_a_page_names_exists(page):
    missing = [path for path in paths_in(page.read_text()) if not (SRC / path).exists() and not (ROOT / path).exists()]
    assert not missing


def test_every_behaviour_is_where_the_page_says():
    rows = [row for row in ROW.findall(PAGES[0].read_text()) if paths_in(row[1]) and row[3].startswith("`")]
    assert len(rows) >= 10
    for behaviour, files, name, tests in rows:
        sources = [SRC / path for path in paths_in(files)]
        text = "".join(path.read_text() for path in sources if path.is_file())
        for part in re.findall(r"`([\w.]+)`", name):
            defined = rf"^\s*(class|def|async def) {part.rpartition('.')[2]}\b|^{part}\b"
            assert part.endswith(".md") or re.search(defined, text, re.MULTILINE), f"{behaviour}: no {part} in {files}"
        assert all((ROOT / path).exists() for path in re.findall(r"`(tests[\w./]*)`", tests)), behaviour


def test_the_drawings_are_those_of_the_present_imports():
    stale = [
        name
        for name, drawing in draw_architecture.drawings().items()
        if (ROOT / "docs" / "figures" / name).read_text() != drawing
    ]
    assert not stale, "run: python scripts/draw_architecture.py"
