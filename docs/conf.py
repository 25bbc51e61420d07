"""Builds the documentation site: `make docs`.

Pages are plain Markdown. The build adds the rest: the navigation follows the links of `index.md` and of each
section's index, the reference is written from the source, the code of pages makes their replays, and a comment
`<!-- index: word, other word -->` adds words under which the search finds a section: whole entries as entries of the
index, and their single words as words of the page, which also raise its rank. Pages for contributors are neither in the
navigation nor in the search.
"""

import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx import addnodes
from sphinx.application import Sphinx
from sphinx.builders import Builder

DOCS = Path(__file__).parent
sys.path.insert(0, str(DOCS.parent / "scripts"))
import pages  # noqa: E402

import reference  # noqa: E402
from gamms import __version__  # noqa: E402

project = "GAMMS"
author = "the authors of GAMMS"
version = release = __version__
extensions = ["myst_parser"]
exclude_patterns = ["figures", "reference/examples"]  # examples are put into the entries of the reference
myst_heading_anchors = 4
myst_enable_extensions = ["colon_fence"]
smartquotes = False  # commands and code in comments of scenario files are copied from the site
suppress_warnings = ["myst.header", "ref.python"]  # two classes of one name: the link leads to the first

html_theme = "furo"
html_title = f"GAMMS {version}"
html_static_path = ["_static"]
html_favicon = "_static/icon.svg"
html_css_files = ["site.css"]
html_search_scorer = str(DOCS / "search_scorer.js")
html_copy_source = False
html_show_sphinx = False
html_show_copyright = False
maximum_signature_line_length = 88
toc_object_entries_show_parents = "hide"
add_module_names = False
python_use_unqualified_type_names = True

_ADDRESS = re.search(
    r'^repository-code: "(https:[^"]+)"', (DOCS.parent / "CITATION.cff").read_text("utf-8"), re.MULTILINE
)
if _ADDRESS:  # pages have a link to edit them
    html_theme_options = {"source_repository": _ADDRESS[1], "source_branch": "main", "source_directory": "docs/"}

_FOR_CONTRIBUTORS = re.compile(r"decisions/|architecture$|contributing$|page-format$|releasing$")
_UNLISTED = "---\norphan: true\nnosearch: true\n---\n\n"
_KEYWORDS = '---\nmyst:\n  html_meta:\n    keywords: "{words}"\n---\n\n'  # under which the search finds the page
_STILL = re.compile(r"^!\[([^\]]*)\]\((figures/gallery/(\w+)\.png)\)$", re.MULTILINE)  # of a game of the gallery
_PLAYING = (
    '```{raw} html\n<a href="_replays/gallery/\\3.html" title="Play it in this browser">'
    '<img class="only-light" src="_replays/gallery/\\3.png" alt="\\1">'
    '<img class="only-dark" src="_replays/gallery/\\3_dark.png" alt="\\1"></a>\n```'
)
_THUMBNAIL = re.compile(r'<img src="figures/gallery/(\w+)\.png" ([^>]+)>')  # in tables of pictures
_BY_THEME = (
    r'<img class="only-light" src="_replays/gallery/\1.png" \2>'
    r'<img class="only-dark" src="_replays/gallery/\1_dark.png" \2>'
)
_ALL_PAGES = re.compile(r"^## All pages\n.*?(?=^## |\Z)", re.MULTILINE | re.DOTALL)  # which the site shows at the side
_FRONT = re.compile(r"^!\[[^\]]*\]\(demo\.svg\)$", re.MULTILINE)  # of the front page, where the site shows a replay
_MOMENT = "gallery/capture_the_flag.html#turn=134&agent=blue_1&play"  # a frame follows the agent: it takes the flag
_FRAME = (
    '```{{raw}} html\n<iframe class="replay" src="{to_root}_replays/{name}" title="Replay of a game" loading="lazy">'
    "</iframe>\n```"
)


def setup(app: Sphinx) -> None:
    """Connect the functions of this file to the steps of a build."""
    app.connect("builder-inited", write_reference)
    app.connect("builder-inited", write_scorer)
    app.connect("source-read", complete)
    app.connect("write-started", collect_toctrees)
    app.connect("html-page-context", shorten_navigation, priority=400)  # before the theme calls it
    app.connect("build-finished", make_replays)


def write_reference(_: Sphinx) -> None:
    """Write a page for each public package; unchanged pages stay, so that they are not built again."""
    for package in reference.packages():
        path, text = DOCS / "reference" / f"{package}.md", reference.page_of(package)
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


def write_scorer(app: Sphinx) -> None:
    """Write the ranking of the search with the index words of all pages."""
    scorer = Path(app.doctreedir, "search_scorer.js")
    ranking = Path(app.config.html_search_scorer).read_text(encoding="utf-8")
    scorer.parent.mkdir(parents=True, exist_ok=True)
    scorer.write_text(f"const pageWords = {json.dumps(pages.index_words())};\n{ranking}", encoding="utf-8")
    app.config.html_search_scorer = str(scorer)


def complete(_: Sphinx, docname: str, source: list[str]) -> None:
    """Add the navigation to a page of contents, and frames to pages with replays."""
    page = DOCS / f"{docname}.md"
    if page.name == "index.md":
        source[0] = _ALL_PAGES.sub("", source[0])
        source[0] += "".join(toctree_of(page, heading, linked) for heading, linked in pages.contents_of(page))
    to_root = "../" * docname.count("/")
    source[0] = pages.LINK.sub(lambda match: _within(page, match), source[0])
    source[0] = _STILL.sub(_PLAYING, source[0])
    source[0] = _THUMBNAIL.sub(_BY_THEME, source[0])
    if docname == "index":
        source[0] = _FRONT.sub(_FRAME.format(to_root="", name=_MOMENT), source[0])
    source[0] = pages.INDEX.sub(_index_entries, source[0])
    source[0] = pages.REPLAY.sub(lambda match: _FRAME.format(to_root=to_root, name=f"{docname}/{match[1]}"), source[0])
    words = pages.index_words_of(page) if page.is_file() else []
    if _FOR_CONTRIBUTORS.match(docname):
        source[0] = _UNLISTED + source[0]
    elif words:
        source[0] = _KEYWORDS.format(words=", ".join(words)) + source[0]


def _index_entries(match: re.Match[str]) -> str:
    """Return the directive that adds the words of a comment to the index as main entries."""
    words = ", ".join(f"! {word.strip()}" for word in match[1].split(","))
    return f"```{{index}} {words}\n```"


def _within(page: Path, match: re.Match[str]) -> str:
    """Return a link; for a page outside the documentation, its text alone."""
    target = (page.parent / match[2].partition("#")[0]).resolve()
    is_outside = target.suffix == ".md" and target.exists() and not target.is_relative_to(DOCS)
    return match[1] if is_outside else match[0]


def toctree_of(page: Path, heading: str, linked: list[Path]) -> str:
    """Return the toctree of the pages below a heading of a page of contents."""
    names = [os.path.relpath(path, page.parent) for path in linked if path.is_relative_to(DOCS) and path != page]
    if page.parent == DOCS / "reference":
        names += [f"{package}.md" for package in reference.packages()] if not heading else []
    entries = list(dict.fromkeys(name.removesuffix(".md") for name in names))
    caption = [f":caption: {heading}"] if heading else []
    return "\n".join(["", "", "```{toctree}", ":hidden:", *caption, "", *entries, "```", ""]) if entries else ""


_toctrees: dict[str, nodes.Element] = {}  # page -> the toctrees in its contents


def collect_toctrees(_: Sphinx, builder: Builder) -> None:
    """Collect the toctrees of all pages, without headings and objects."""
    for name, contents in builder.env.tocs.items():
        toctrees = contents.deepcopy()
        for part in list(toctrees.findall(nodes.bullet_list)):
            if part.parent is not None and not any(part.findall(addnodes.toctree)):
                part.parent.remove(part)
        _toctrees[name] = toctrees


def shorten_navigation(app: Sphinx, page: str, template: str, context: dict[str, Any], doctree: object) -> None:  # noqa: ARG001
    """Make the navigation of a page from toctrees alone.

    NOTE: copying all names of the reference for every page took two thirds of the build.
    """
    navigation = context["toctree"]

    def from_toctrees(**options: Any) -> str:
        whole = app.env.tocs
        app.env.tocs = _toctrees
        try:
            return str(navigation(**options))
        finally:
            app.env.tocs = whole

    context["toctree"] = from_toctrees


def make_replays(app: Sphinx, exception: Exception | None) -> None:
    """Run the code of pages with replays, and copy the replays beside the pages.

    The games of the gallery are played once for a folder of the site; `make clean` removes them.
    """
    if exception is not None or app.builder.name != "html":
        return
    games = Path(app.outdir, "_replays", "gallery")
    if not (games / "index.html").exists():
        command = [sys.executable, "-m", "gamms", "gallery", "--page", str(games)]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)  # noqa: S603 - our own command
    here = Path.cwd()
    for page in sorted(DOCS.rglob("*.md")):
        names = pages.REPLAY.findall(page.read_text(encoding="utf-8"))
        target = Path(app.outdir, "_replays", page.relative_to(DOCS).with_suffix(""))
        if not names:
            continue
        target.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory() as folder:
            os.chdir(folder)
            try:
                for _ in pages.run(page):
                    pass
            finally:
                os.chdir(here)
            for name in names:
                shutil.copy(Path(folder, name), target / name)
