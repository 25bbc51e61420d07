"""The documentation says what is so: its fences run, its links lead somewhere, the examples print what is pinned.

A page's ```python fences run in order in one namespace, in an empty folder. A ```text fence right behind one is what
it prints. A fence tagged `no-run` is only compiled. Every picture that a page saves is shown on it, from the folder
`docs/figures/<page>`, and is what the code makes. `GAMMS_REFRESH_EXAMPLES=1` writes the examples' `.out` and these
pictures again.
"""

import contextlib
import io
import logging
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import pytest
from figure_files import assert_same_figure

from gamms import _legacy

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", *sorted(DOCS.rglob("*.md"))]
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
IS_REFRESHING = os.environ.get("GAMMS_REFRESH_EXAMPLES") == "1"

_FENCE = re.compile(r"^```([^\n`]*)\n(.*?)^```[ \t]*$", re.MULTILINE | re.DOTALL)
_CODE = re.compile(r"`[^`\n]*`")  # within a line
_LINK = re.compile(r"\[[^\]]*\]\(([^)\s]+)\)")
_HEADING = re.compile(r"^#+ (.+?)\s*$", re.MULTILINE)


class Fence(NamedTuple):
    tags: list[str]
    code: str
    line: int  # of its first line of code in the page
    printed: str | None  # what the page says that it prints


def fences_of(page: Path) -> list[Fence]:
    text = page.read_text(encoding="utf-8")
    found = list(_FENCE.finditer(text))
    fences = []
    for i, match in enumerate(found):
        after = found[i + 1] if i + 1 < len(found) else None
        is_output = after and after[1].strip() == "text" and not text[match.end() : after.start()].strip()
        line = text.count("\n", 0, match.start(2)) + 1
        fences.append(Fence(match[1].split(), match[2], line, after[2] if is_output else None))
    return [fence for fence in fences if fence.tags[:1] == ["python"]]


def name_of(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


@pytest.fixture
def quiet_logging():
    """What a page does to the logging of the process ends with it."""
    root, ours = logging.getLogger(), logging.getLogger("gamms")
    before = root.handlers[:], root.level, ours.level
    yield
    root.handlers[:] = before[0]
    root.setLevel(before[1])
    ours.setLevel(before[2])


@pytest.mark.parametrize("page", PAGES, ids=name_of)
@pytest.mark.usefixtures("quiet_logging")
def test_every_fence_of_a_page_runs_and_prints_what_the_page_says(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    namespace = {"__name__": f"docs_{page.stem}"}
    for fence in fences_of(page):
        code = compile("\n" * (fence.line - 1) + fence.code, name_of(page), "exec", dont_inherit=True)
        if "no-run" in fence.tags:
            continue
        with contextlib.redirect_stdout(io.StringIO()) as printed:
            exec(code, namespace)
        if fence.printed is not None:
            assert printed.getvalue() == fence.printed, f"{name_of(page)}:{fence.line} prints something else"
    check_figures(page, sorted(path for path in tmp_path.iterdir() if path.suffix in {".svg", ".png"}))


def check_figures(page, made):
    """Assert that a page shows the pictures that its code has made, and no others in their folder."""
    folder = DOCS / "figures" / "_".join(page.relative_to(ROOT).with_suffix("").parts).lower().removeprefix("docs_")
    shown = [target for target, _ in internal_links_of(page) if target.parent == folder]
    assert sorted(path.name for path in shown) == [path.name for path in made], "show every picture that the page saves"
    for path in made:
        if IS_REFRESHING:
            folder.mkdir(exist_ok=True)
            shutil.copy(path, folder)
        assert_same_figure(folder / path.name, path)
    assert {path.name for path in made} == {path.name for path in folder.glob("*")}, "a figure that no page shows"


def prose_of(page: Path) -> str:
    return _FENCE.sub("", page.read_text(encoding="utf-8"))


def internal_links_of(page: Path) -> list[tuple[Path, str]]:
    """Target file and anchor of every link that does not leave the repository."""
    links = [link for link in _LINK.findall(_CODE.sub("", prose_of(page))) if not re.match(r"[a-z]+:", link)]
    parts = [link.partition("#") for link in links]
    return [((page.parent / path).resolve() if path else page, anchor) for path, _, anchor in parts]


def anchors_of(page: Path) -> set[str]:
    headings = _HEADING.findall(prose_of(page))
    return {re.sub(r"[^\w\- ]", "", heading.lower()).strip().replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_every_internal_link_leads_somewhere(page):
    for target, anchor in internal_links_of(page):
        assert target.exists(), f"{name_of(page)} links to {target}, which is not there"
        if anchor and target.suffix == ".md":
            assert anchor in anchors_of(target), f"{name_of(page)} links to #{anchor}, no heading of {target.name}"


def test_every_page_can_be_reached_from_the_index():
    reached, waiting = set(), [DOCS / "index.md"]
    while waiting:
        page = waiting.pop()
        if page not in reached and page.suffix == ".md" and page.is_file():
            reached.add(page)
            waiting += [target for target, _ in internal_links_of(page)]
    missing = [name_of(page) for page in DOCS.rglob("*.md") if page not in reached]
    assert not missing, f"no way leads from docs/index.md to {missing}"


def test_every_old_import_path_is_on_the_page_about_compatibility():
    page = (DOCS / "compatibility.md").read_text(encoding="utf-8")
    paths = [*_legacy._PACKAGES_OF, *_legacy._LATER]
    missing = [path for path in paths if f"`{path}`" not in page and f"`.{path.rpartition('.')[2]}`" not in page]
    assert not missing


def test_every_pinned_output_belongs_to_an_example():
    pinned = {path.stem for path in (ROOT / "examples").glob("*.out")}
    assert pinned <= {path.stem for path in EXAMPLES}


@pytest.mark.parametrize("example", EXAMPLES, ids=name_of)
def test_an_example_prints_exactly_what_is_pinned(example, tmp_path):
    command = [sys.executable, "-W", "error", str(example)]
    run = subprocess.run(
        command, cwd=tmp_path, capture_output=True, text=True, encoding="utf-8", timeout=60, check=False
    )
    assert run.returncode == 0, run.stderr
    pinned = example.with_suffix(".out")
    if IS_REFRESHING:
        pinned.write_text(run.stdout, encoding="utf-8")
    assert run.stdout == pinned.read_text(encoding="utf-8")
    for figure in sorted(tmp_path.glob("figures/*")):
        assert_same_figure(DOCS / "figures" / figure.name, figure)
