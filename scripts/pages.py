"""Reads the pages of the documentation, runs their fences, and finds their links and anchors.

The tests of the documentation and `docs/conf.py` use it, so that a page means the same to both. A page's ```python
fences run in order in one namespace. A ```text fence right behind one is what it prints. A fence tagged `no-run` is
only compiled.
"""

import contextlib
import io
import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parent.parent
DOCS = ROOT / "docs"
REFERENCE = DOCS / "reference"
EXAMPLES = (
    REFERENCE / "examples"
)  # of public names; the site shows each below the entry of its name, not on its own page
LINK = re.compile(r"\[([^\]]*)\]\(([^)\s]+)\)")
REPLAY = re.compile(r"^<!-- replay: (\S+) -->$", re.MULTILINE)  # where a page shows an HTML replay that its code saves

INDEX = re.compile(r"^<!-- index: (.+) -->$", re.MULTILINE)  # words under which the search finds the section

_AFTER = re.compile(r"^<!-- after: (\S+) -->$", re.MULTILINE)
_ROW = re.compile(r"^\| \[[^\]<]*\]\(([^)#\s]+\.md)\)", re.MULTILINE)  # not one that begins with a picture
_LIST = re.compile(r"^\* \*\*([^*]+):\*\* (.+(?:\n  .+)*)$", re.MULTILINE)
_FENCE = re.compile(r"^```([^\n`]*)\n(.*?)^```[ \t]*$", re.MULTILINE | re.DOTALL)
_CODE = re.compile(r"`[^`\n]*`")  # within a line
_HEADING = re.compile(r"^#+ (.+?)\s*$", re.MULTILINE)


class Fence(NamedTuple):
    """A ```python fence of a page."""

    tags: list[str]
    code: str
    line: int  # of its first line of code in the page
    printed: str | None  # what the page says that it prints


def index_words_of(page: Path) -> list[str]:
    """Return the single words of all comments `<!-- index: … -->` of a page, each once."""
    comments = " ".join(INDEX.findall(page.read_text(encoding="utf-8")))
    return [*dict.fromkeys(re.findall(r"\w+", comments.lower()))]


def index_words() -> dict[str, list[str]]:
    """Return the name of each page on the site -> its index words, for pages that have any."""
    words = {page.relative_to(DOCS).with_suffix("").as_posix(): index_words_of(page) for page in all_pages()[1:]}
    return {name: found for name, found in words.items() if found}


def all_pages() -> list[Path]:
    """Return the README and all pages of the documentation, without those that are written when the site is built."""
    written = set(REFERENCE.glob("gamms*.md"))
    return [ROOT / "README.md", *(path for path in sorted(DOCS.rglob("*.md")) if path not in written)]


def fences_of(page: Path) -> list[Fence]:
    """Return the ```python fences of a page, in order."""
    return fences_in(page.read_text(encoding="utf-8"))


def fences_in(text: str) -> list[Fence]:
    """Return the ```python fences of a text in Markdown, in order."""
    found = list(_FENCE.finditer(text))
    fences = []
    for i, match in enumerate(found):
        after = found[i + 1] if i + 1 < len(found) else None
        is_output = after and after[1].strip() == "text" and not text[match.end() : after.start()].strip()
        line = text.count("\n", 0, match.start(2)) + 1
        fences.append(Fence(match[1].split(), match[2], line, after[2] if after and is_output else None))
    return [fence for fence in fences if fence.tags[:1] == ["python"]]


def run(page: Path) -> Iterator[tuple[Fence, str]]:
    """Run the fences of a page in the working directory, and yield each with what it has printed.

    A page that goes on with the files of another one says so by `<!-- after: other.md -->`; that one is run before.
    """
    for earlier in _AFTER.findall(page.read_text(encoding="utf-8")):
        for _ in run(page.parent / earlier):
            pass
    namespace: dict[str, object] = {"__name__": f"docs_{page.stem}"}
    for fence in fences_of(page):
        code = compile("\n" * (fence.line - 1) + fence.code, name_of(page), "exec", dont_inherit=True)
        if "no-run" in fence.tags:
            continue
        with contextlib.redirect_stdout(io.StringIO()) as printed:
            exec(code, namespace)
        yield fence, printed.getvalue()


def print_instead(page: Path, fence: Fence, printed: str) -> None:
    """Let a page say that a fence, which has an output, prints something else."""
    text = page.read_text(encoding="utf-8")
    behind = text.index(fence.code) + len(fence.code)
    at = text.index(fence.printed or "", text.index("```text", behind))
    page.write_text(text[:at] + printed + text[at + len(fence.printed or "") :], encoding="utf-8")


def name_of(path: Path) -> str:
    """Return the path of a page within the repository."""
    return path.relative_to(ROOT).as_posix()


def folder_of(page: Path) -> Path:
    """Return the folder of the pictures that a page saves."""
    return DOCS / "figures" / "_".join(page.relative_to(ROOT).with_suffix("").parts).lower().removeprefix("docs_")


def prose_of(page: Path) -> str:
    """Return a page without its fences."""
    return _FENCE.sub("", page.read_text(encoding="utf-8"))


def internal_links_of(page: Path) -> list[tuple[Path, str]]:
    """Return the target file and the anchor of every link that does not leave the repository."""
    links = [link for _, link in LINK.findall(_CODE.sub("", prose_of(page))) if not re.match(r"[a-z]+:", link)]
    parts = [link.partition("#") for link in links]
    return [((page.parent / path).resolve() if path else page, anchor) for path, _, anchor in parts]


def anchors_of(page: Path) -> set[str]:
    """Return the anchors of the headings of a page."""
    headings = _HEADING.findall(prose_of(page))
    return {re.sub(r"[^\w\- ]", "", heading.lower()).strip().replace(" ", "-") for heading in headings}


def contents_of(page: Path) -> list[tuple[str, list[Path]]]:
    """Return the table of contents of a page: headings, each with its pages.

    A heading has the pages that begin the rows of tables below it. The list of all pages has a heading in each line.
    """
    prose = prose_of(page)
    parts = re.split(r"^## (.+)$", prose, flags=re.MULTILINE)
    rows = [(heading, _ROW.findall(text)) for heading, text in zip(["", *parts[1::2]], parts[::2], strict=True)]
    lists = [(heading, [path for _, path in LINK.findall(links)]) for heading, links in _LIST.findall(prose)]
    return [(heading, [(page.parent / path).resolve() for path in paths]) for heading, paths in [*rows, *lists]]
