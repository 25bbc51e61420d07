"""The documentation says what is so: its fences run, its links lead somewhere, the examples print what is pinned.

`scripts/pages.py` says how a page is read. The fences of a page run in an empty folder. Every picture that a page saves
is shown on it, from the folder `docs/figures/<page>`, and is what the code makes. `GAMMS_REFRESH_EXAMPLES=1` writes the
examples' `.out`, what fences print, and these pictures again.
"""

import json
import logging
import os
import re
import runpy
import shutil
import subprocess
import sys
from operator import attrgetter
from pathlib import Path

import pytest
from figure_files import assert_same_figure

import gamms
from gamms import compat, scenario

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "scripts"))
import pages  # noqa: E402

DOCS = ROOT / "docs"
PAGES = pages.all_pages()
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
WORDS_TYPED = {
    "batch": "batches.md",
    "cite": "cite.md",
    "collision": "rules.md",
    "colors": "pictures.md",
    "colours": "pictures.md",
    "gpu": "batches.md",
    "headless": "pictures.md",
    "jupyter": "browser.md",
    "many agents": "agents.md",
    "my first rl run": "howto/first_rl_run.md",
    "my own map": "worlds.md",
    "paper figure": "pictures.md",
    "radio": "messages.md",
    "real time": "travel.md",
    "seeds": "concepts.md",
    "snapshot": "snapshots.md",
}
IS_REFRESHING = os.environ.get("GAMMS_REFRESH_EXAMPLES") == "1"


@pytest.fixture
def quiet_logging():
    """What a page does to the logging of the process ends with it."""
    root, ours = logging.getLogger(), logging.getLogger("gamms")
    before = root.handlers[:], root.level, ours.level
    yield
    root.handlers[:] = before[0]
    root.setLevel(before[1])
    ours.setLevel(before[2])


@pytest.mark.parametrize("page", PAGES, ids=pages.name_of)
@pytest.mark.usefixtures("quiet_logging")
def test_every_fence_of_a_page_runs_and_prints_what_the_page_says(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for fence, printed in pages.run(page):
        if fence.printed is None:
            continue
        if IS_REFRESHING:
            pages.print_instead(page, fence, printed)
        else:
            assert printed == fence.printed, f"{pages.name_of(page)}:{fence.line} prints something else"
    check_figures(page, sorted(path for path in tmp_path.iterdir() if path.suffix in {".svg", ".png"}))


def check_figures(page, made):
    """Assert that a page shows the pictures that its code has made, and no others in their folder."""
    folder = pages.folder_of(page)
    shown = [target for target, _ in pages.internal_links_of(page) if target.parent == folder]
    assert sorted(path.name for path in shown) == [path.name for path in made], "show every picture that the page saves"
    for path in made:
        if IS_REFRESHING:
            folder.mkdir(exist_ok=True)
            shutil.copy(path, folder)
        assert_same_figure(folder / path.name, path)
    assert {path.name for path in made} == {path.name for path in folder.glob("*")}, "a figure that no page shows"


@pytest.mark.parametrize("page", PAGES, ids=pages.name_of)
def test_every_internal_link_leads_somewhere(page):
    for target, anchor in pages.internal_links_of(page):
        assert target.exists(), f"{pages.name_of(page)} links to {target}, which is not there"
        if anchor and target.suffix == ".md":
            assert anchor in pages.anchors_of(target), (
                f"{pages.name_of(page)} links to #{anchor}, no heading of {target.name}"
            )


def test_what_pages_call_on_a_context_can_be_called():
    call = re.compile(r"\bctx((?:\.(?:game|graph|agent|sensor|record)\b)(?:\.\w+)+)\(")
    called = {name for page in PAGES for name in call.findall(page.read_text(encoding="utf-8"))}
    assert len(called) > 80
    with gamms.create_context(logger_config={"level": "ERROR"}) as ctx:
        assert not [name for name in called if not callable(attrgetter(name[1:])(ctx))]


def test_the_times_in_the_readme_are_those_of_the_benchmarks():
    paragraphs = (ROOT / "README.md").read_text(encoding="utf-8").split("\n\n")
    said = next(one for one in paragraphs if "[Benchmarks](" in one)
    table = (ROOT / "benchmarks" / "README.md").read_text(encoding="utf-8")
    times = re.findall(r"[\d.]+ [nu]s\b", said)
    assert len(times) == 5
    assert not [one for one in times if f" {one} |" not in table and f": {one}" not in table]


CARD = re.compile(r'\[<img src="([^"]+)" width="\d+" alt="[^"]+">\]\(([^)]+)\)<br>')


def test_the_front_page_has_six_cards_with_pictures_and_lists_all_pages_once():
    page = (DOCS / "index.md").read_text(encoding="utf-8")
    shown, leads = zip(*CARD.findall(page), strict=True)
    assert len(set(leads)) == 6
    assert all((DOCS / picture).is_file() for picture in shown)
    listed = [one for _, several in pages.contents_of(DOCS / "index.md") for one in several]
    assert len(listed) == len(set(listed)) > 40
    assert {DOCS / lead for lead in leads} <= set(listed)


def test_the_gallery_opens_with_a_picture_of_each_of_its_games_which_leads_to_it():
    opening, *entries = (DOCS / "gallery.md").read_text(encoding="utf-8").split("\n## ")
    cards = CARD.findall(opening)
    assert [picture for picture, _ in cards] == [f"figures/gallery/{name}.png" for name in sorted(scenario.gallery())]
    assert opening.index("<img") < opening.index("```")
    for (picture, lead), entry in zip(cards, entries, strict=False):
        assert entry.lower().startswith(f"{lead[1:].replace('-', ' ')}\n"), f"{lead} is not where its picture leads"
        assert f"]({picture})" in entry


def test_every_page_can_be_reached_from_the_index():
    reached, waiting = set(), [DOCS / "index.md"]
    while waiting:
        page = waiting.pop()
        if page not in reached and page.suffix == ".md" and page.is_file():
            reached.add(page)
            waiting += [target for target, _ in pages.internal_links_of(page)]
    shown = [page for page in PAGES if page.is_relative_to(DOCS) and page.parent != pages.EXAMPLES]
    missing = [pages.name_of(page) for page in shown if page not in reached]
    assert not missing, f"no way leads from docs/index.md to {missing}"


def test_the_site_leaves_dashes_and_quotes_as_pages_have_them():
    assert "\nsmartquotes = False " in (DOCS / "conf.py").read_text(encoding="utf-8"), "commands are copied from there"
    odd = re.compile("[\u2013\u201c\u201d\u2018]")
    found = {page.name: odd.findall(page.read_text(encoding="utf-8")) for page in [*PAGES, *DOCS.rglob("*.yaml")]}
    assert {name for name, marks in found.items() if marks} == set()


@pytest.mark.skipif(shutil.which("node") is None, reason="Node.js is not installed")
def test_the_search_of_the_site_ranks_guides_before_decisions_and_changes():
    scorer = DOCS / "search_scorer.js"
    assert f'html_search_scorer = str(DOCS / "{scorer.name}")' in (DOCS / "conf.py").read_text(encoding="utf-8")
    found = [
        ["decisions/0012-a-journal", 40],
        ["changelog", 40],
        ["reference/gamms.graph", 30],
        ["recording", 2],
        ["howto/debugging", 2],
    ]
    rank = f"{json.dumps(found)}.map(([page, score]) => Scorer.score([page, 'title', '', null, score]))"
    shown = f"{scorer.read_text(encoding='utf-8')}; console.log(JSON.stringify({rank}))"
    scores = json.loads(subprocess.run(["node", "-e", shown], capture_output=True, check=True).stdout)
    assert max(scores[:3]) < min(scores[3:]) == 2


def test_the_search_finds_pages_under_the_words_that_people_type():
    found = {
        (word.strip(), page.relative_to(DOCS).as_posix())
        for page in DOCS.rglob("*.md")
        for words in re.findall(r"^<!-- index: (.+) -->$", page.read_text(encoding="utf-8"), re.MULTILINE)
        for word in words.split(",")
    }
    assert WORDS_TYPED.items() - found == set()


SEVERAL_WORDS_TYPED = {
    "communication range": "messages",
    "range of communication": "messages",
    "team communication": "messages",
    "radio range": "messages",
    "load osm": "maps",
    "load an osm file": "maps",
    "partial observability": "sensors",
    "predator prey": "gallery",
    "stochastic": "concepts",
    "pomdp": "belief",
    "trajectory": "recording",
    "trajectories": "recording",
    "heterogeneous agents": "agents",
    "multiplayer": "people",
    "sensor noise": "sensors",
    "random seed": "concepts",
    "zero sum": "solve",
    "turn order": "game",
    "road network": "maps",
    "particle filter": "belief",
}


@pytest.mark.skipif(shutil.which("node") is None, reason="Node.js is not installed")
def test_the_search_lifts_the_page_whose_index_words_are_typed_highest():
    words = pages.index_words()
    names = [page.relative_to(DOCS).with_suffix("").as_posix() for page in PAGES[1:]]
    lifted = (
        f"{json.dumps([*SEVERAL_WORDS_TYPED])}.map((query) => {json.dumps(names)}.map((page) => liftOf(page, query)))"
    )
    code = f"const pageWords = {json.dumps(words)}; {(DOCS / 'search_scorer.js').read_text(encoding='utf-8')}; "
    node = ["node", "-e", f"{code}console.log(JSON.stringify({lifted}))"]
    scores = json.loads(subprocess.run(node, capture_output=True, check=True).stdout)
    best = {
        query: [name for name, lift in zip(names, lifts, strict=True) if lift == max(lifts)]
        for query, lifts in zip(SEVERAL_WORDS_TYPED, scores, strict=True)
    }
    assert best == {query: [page] for query, page in SEVERAL_WORDS_TYPED.items()}


def test_a_page_is_found_under_the_single_words_of_its_comments():
    found = pages.index_words_of(DOCS / "messages.md")
    assert {"radio", "communication", "range", "team"} <= set(found)
    assert len(found) == len(set(found))
    assert not set(pages.index_words()) & {"architecture", "releasing", "README"}


def test_the_navigation_has_at_most_64_pages_besides_the_reference():
    found, waiting = set(), [DOCS / "index.md"]
    while waiting:
        page = waiting.pop()
        linked = {one for _, several in pages.contents_of(page) for one in several} - {page}
        waiting += [one for one in linked - found if one.name == "index.md"]
        found |= linked
    assert 50 < len(found) <= 64


def test_pages_for_contributors_are_not_in_the_navigation():
    pattern = re.search(r'^_FOR_CONTRIBUTORS = re.compile\(r"(.+)"\)$', (DOCS / "conf.py").read_text(), re.MULTILINE)[1]
    hidden = [page for page in PAGES if re.match(pattern, page.with_suffix("").as_posix().removeprefix(f"{DOCS}/"))]
    listed = {
        one for page in PAGES if page.name == "index.md" for _, several in pages.contents_of(page) for one in several
    }
    assert {"architecture.md", "releasing.md", "README.md"} <= {page.name for page in hidden}
    assert not listed & set(hidden)


def test_records_of_decisions_have_one_page_each_and_are_listed():
    folder = DOCS / "decisions"
    records = {path.name: path.read_text(encoding="utf-8") for path in sorted(folder.glob("[0-9]*.md"))}
    listed, superseded = (folder / "README.md").read_text(encoding="utf-8").split("## Superseded")
    assert re.findall(r"^\| \[\d{4}\]\((.+?)\) \|", listed, re.MULTILINE) == list(records)
    assert not {name[:4] for name in records} & set(re.findall(r"^\| (\d{4}) \|", superseded, re.MULTILINE))
    assert not [name for name, text in records.items() if not text.startswith(f"# {name[:4]} ")]
    assert not [name for name, text in records.items() if len(text.split()) > 600]


def test_one_line_installs_the_extras_of_all_tutorials():
    install = re.compile(r'pip install "\.\[([\w,-]+)\]"')
    chapters = sorted((DOCS / "tutorials").glob("[1-9]_*.md"))
    named = {one for page in chapters for extras in install.findall(page.read_text()) for one in extras.split(",")}
    shown = set(install.search((DOCS / "tutorials/index.md").read_text())[1].split(","))
    assert {"accel", "osm", "rl", "web"} <= shown == named - {"train"}, "training has an extra of its own"


def test_every_old_import_path_is_on_the_page_about_compatibility():
    page = (DOCS / "compatibility.md").read_text(encoding="utf-8")
    paths = [*compat._PACKAGES_OF, *compat._LATER]
    missing = [path for path in paths if f"`{path}`" not in page and f"`.{path.rpartition('.')[2]}`" not in page]
    assert not missing


@pytest.mark.parametrize("name", ["torchrl", "benchmarl", "rllib", "openspiel"])
def test_a_page_about_another_library_shows_parts_of_its_program_and_its_output(name):
    page = DOCS / "howto" / f"{name}.md"
    commands, printed = re.search(r"```bash\n(.*?)```\n\n```text\n(.*?)```", page.read_text(), re.DOTALL).groups()
    program = (ROOT / commands.split()[-1]).read_text(encoding="utf-8")
    squeezed = re.sub(r"\s+", " ", program)
    shown = [re.sub(r"\s+", " ", fence.code).strip() for fence in pages.fences_of(page)]
    assert shown
    assert not [code for code in shown if code not in squeezed]
    assert "wins" in printed


def test_every_pinned_output_belongs_to_an_example():
    pinned = {path.stem for path in (ROOT / "examples").glob("*.out")}
    assert pinned <= {path.stem for path in EXAMPLES}


@pytest.mark.parametrize("example", EXAMPLES, ids=pages.name_of)
@pytest.mark.usefixtures("quiet_logging")
def test_an_example_prints_exactly_the_pinned_output_and_no_warning(example, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", [str(example)])
    runpy.run_path(str(example), run_name="__main__")
    printed, errors = capfd.readouterr()
    assert errors == ""
    printed = re.sub(r"\d+\.\d+ us\b", "… us", printed)  # times are those of the machine
    pinned = example.with_suffix(".out")
    if IS_REFRESHING:
        pinned.write_text(printed, encoding="utf-8")
    assert printed == pinned.read_text(encoding="utf-8")
    for figure in sorted(tmp_path.glob("figures/*")):
        assert_same_figure(DOCS / "figures" / figure.name, figure)


def test_an_example_is_a_program_of_its_own(tmp_path):
    example = ROOT / "examples" / "grid_tag.py"
    command = [sys.executable, "-W", "error", str(example)]
    run = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, encoding="utf-8", check=False)
    assert (run.returncode, run.stderr) == (0, "")
    assert run.stdout == example.with_suffix(".out").read_text(encoding="utf-8")
