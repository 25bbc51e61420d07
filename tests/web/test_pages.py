"""A page holds the recording, and nothing of it becomes markup."""

import json
import re
from graphlib import TopologicalSorter
from pathlib import Path

import numpy as np
import pytest
from shown_game import game_in

import gamms
from gamms import recorder, rendering, web
from gamms.errors import BadValue, MissingFolder
from gamms.visual.keys import KEYS, explain_keys, find_actions
from gamms.web import bundle

HOSTILE = "</script><img src=x onerror=alert(1)>"


def test_each_module_of_the_pages_imports_what_another_one_exports_and_none_imports_itself():
    texts = {file.stem: file.read_text(encoding="utf-8") for file in bundle.SOURCES.glob("*.js")}
    imports = {name: bundle.IMPORT.findall(text) for name, text in texts.items()}
    for name, found in imports.items():
        for names, other in found:
            wanted = {one.strip() for one in names.split(",")} - {""}
            assert wanted <= set(bundle.EXPORT.findall(texts[other])), f"{name}.js imports from {other}.js"
        assert texts[name].count("import {") == len(found), name
    graph = {name: [other for _, other in found] for name, found in imports.items()}
    assert set(TopologicalSorter(graph).static_order()) == set(texts)  # it raises a CycleError


@pytest.mark.parametrize("name", bundle.PAGES)
def test_a_page_has_the_hashes_of_its_own_script_and_style(name):
    page = bundle.read_page(name)
    for kind in ("script", "style"):
        [text] = re.findall(f"<{kind}>(.*?)</{kind}>", page, re.DOTALL)
        assert f"{kind}-src '{bundle.compute_hash(text)}'" in page
        assert text.isascii()


@pytest.mark.parametrize("name", bundle.PAGES)
def test_a_page_has_all_of_its_modules_without_comments(name):
    page = bundle.read_page(name)
    entry, _ = bundle.PAGES[name]
    assert page.count(f"const {entry}_js = (() => {{") == 1
    assert not re.search(r"^\s*(//|import |export )", page, re.MULTILINE)


def test_a_page_holds_every_state_of_the_game(game, tmp_path):
    with recorder.open(game) as recording:
        recording.save(tmp_path / "game.html", title="A walk")
        states = list(recording)
        graph = recording.graph.columns()
    found = game_in((tmp_path / "game.html").read_bytes())
    assert np.array_equal(found.world["node_ids"], graph.node_ids)
    assert np.allclose(found.world["xy"].T * found.world["step"], graph.xy, rtol=0.0, atol=1e-3)
    assert found.turns == 80
    for before, after in zip(states, found, strict=True):
        assert before.scores == after.slots["scores"]
        for name in ("name", "node", "alive"):
            assert np.array_equal(before.agents[name], after.agents[name]), name
    first, second, *_ = found.captions()
    assert first == {"words": "red scores: 1", "agent": "red", "major": True, "marked": True, "turn": 10}
    assert second == {"words": "red_0: storm", "agent": "red_0", "major": False, "marked": True, "turn": 12}


def test_the_same_recording_gives_the_same_bytes(game):
    with recorder.open(game) as one, recorder.open(game) as other:
        assert web.page(one) == web.page(other)


def test_gamms_render_writes_a_page(game, tmp_path):
    options = rendering.RenderOptions(first=41, title="Later", theme="dark", trails=5, sensors=False)
    assert rendering.render(game, tmp_path / "game.html", options) == 80
    text = (tmp_path / "game.html").read_text()
    [shown] = re.findall(r'id="options">([^<]*)<', text)
    look = {"title": "Later", "theme": "dark", "labels": "auto", "trails": 5, "sensors": False, "turn": 40}
    assert json.loads(shown) == look
    with pytest.raises(BadValue, match="all turns"):
        rendering.render(game, tmp_path / "game.html", rendering.RenderOptions(last=5))


def test_a_page_is_called_as_its_game(tmp_path):
    with gamms.create_context(seed=1) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 3))
        ctx.agent.create_team("police", [0], strategy=gamms.strategies.chase(ctx))
        ctx.agent.create_team("walkers", [8], strategy=gamms.strategies.random_walk)
        ctx.game.run(max_turns=2, record=tmp_path / "game.ggr")
    with recorder.open(tmp_path / "game.ggr") as recording:
        assert b"<title>police and walkers</title>" in web.page(recording)
    gamms.scenario.from_gallery("pursuit").replace(max_turns=2).play(record=tmp_path / "game.ggr")
    with recorder.open(tmp_path / "game.ggr") as recording:
        assert b"<title>Pursuit</title>" in web.page(recording)


def test_a_page_asks_for_nothing_from_anywhere(game):
    with recorder.open(game) as recording:
        text = web.page(recording).decode()
    assert "default-src 'none'" in text
    assert not re.search(r'(?:src|href)\s*=\s*"(?!data:)', text)
    assert not re.search(r"\bhttps?://(?!www\.w3\.org/2000/svg)", text)


def test_nothing_that_a_recording_says_is_markup(ctx, tmp_path):
    ctx.graph.add_nodes([0, 1], x=[0, 10], y=[0, 0])
    ctx.graph.add_edges([0], sources=[0], targets=[1])
    ctx.agent.create_agent(HOSTILE, start_node_id=0, team=HOSTILE)
    ctx.record.start(tmp_path / "hostile.ggr")
    ctx.game.emit(HOSTILE, agent=HOSTILE)
    ctx.game.run(max_turns=2)
    ctx.record.stop()
    with recorder.open(tmp_path / "hostile.ggr") as recording:
        text = web.page(recording, title=HOSTILE).decode()
    assert "<img" not in text
    assert text.count("</script>") == 5


def test_a_page_refuses_conflicting_options(game, tmp_path):
    with recorder.open(game) as recording:
        for keywords, words in (
            ({"turn": 81}, "81"),
            ({"theme": "print"}, "print"),
            ({"north": True}, "'north'"),
            ({"width": 9}, "as large"),
        ):
            with pytest.raises(BadValue, match=words):
                recording.save(tmp_path / "no.html", **keywords)
        with pytest.raises(MissingFolder):
            recording.save(tmp_path / "nowhere" / "game.html")
    assert list(tmp_path.iterdir()) == []


@pytest.fixture
def ctx():
    with gamms.create_context(seed=1) as ctx:
        yield ctx


def test_two_games_are_on_one_page_with_the_turn_where_they_part(game, tmp_path):
    other = tmp_path / "other.ggr"
    with (
        recorder.open(game) as recording,
        recording.resume(20, ctx=None, strategies={"red": stay, "blue": stay}) as ctx,
    ):
        ctx.record.start(other)
        ctx.game.run(max_turns=5)
        ctx.record.stop()
    with recorder.open(game) as first, recorder.open(other) as second:
        text = web.page_of_two(first, second, names=("whole", "branch")).decode()
    [shown] = re.findall(r'id="options">([^<]*)<', text)
    assert json.loads(shown)["names"] == ["whole", "branch"]
    assert json.loads(shown)["parts"] == 0  # the second one begins later
    assert text.count('class="recording"') == 2


def stay(state):
    state["action"] = state["curr_pos"]


def test_pages_windows_and_docs_have_one_table_of_keys():
    page, window = explain_keys("page"), explain_keys("window")
    docs = (Path(__file__).parents[2] / "docs" / "browser.md").read_text(encoding="utf-8")
    controls = docs.partition("## Controls")[2].partition("\n## ")[0]
    rows = [f"| {words} | {page.get(words, '')} | {window.get(words, '')} |" for words in {**page, **window}]
    assert re.findall(r"^\| .*\|$", controls, re.MULTILINE)[1:] == rows
    table = json.loads(re.search(r'id="key-table">(.*)</script>', bundle.read_page("viewer"))[1])
    assert table == {"actions": find_actions("page"), "help": page}
    viewer = (bundle.SOURCES / "input.js").read_text(encoding="utf-8")
    actions = viewer.partition("const actions = {")[2].partition("};")[0]
    named = {one or other for one, other in re.findall(r'"([a-z ]+)": \(\)|(\w+): \(\)', actions)}
    assert named == set(find_actions("page").values())


@pytest.mark.parametrize("place", ["page", "window"])
def test_each_key_has_one_action_in_a_place(place):
    keys = [key for one in KEYS for key in one.list_keys(place)]
    assert len(keys) == len(set(keys))
    assert {one.action for one in KEYS if one.list_keys(place)} == set(find_actions(place).values())
