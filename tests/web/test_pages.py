"""A page holds the recording, and nothing of it becomes markup."""

import base64
import io
import json
import re
import sys
from pathlib import Path

import numpy as np
import pytest

import gamms
from gamms import recorder, rendering, web
from gamms.errors import BadValue, MissingFolder

sys.path.insert(0, str(Path(__file__).parents[2] / "scripts"))
import build_viewer

HOSTILE = "</script><img src=x onerror=alert(1)>"


def recording_in(page):
    """Return the recording in the bytes of a page."""
    [data] = re.findall(r'class="recording">([^<]*)<', page.decode())
    return recorder.open(io.BytesIO(base64.b64decode(data)))


@pytest.mark.parametrize("name", build_viewer.PAGES)
def test_the_pages_that_ship_are_built_from_their_sources(name):
    text = (build_viewer.BUILT / f"{name}.html").read_text(encoding="utf-8")
    assert text == build_viewer.built(name), "run python scripts/build_viewer.py"


def test_a_page_holds_every_state_of_the_game(game, tmp_path):
    with recorder.open(game) as recording:
        recording.save(tmp_path / "game.html", title="A walk")
        states = list(recording)
        graph = recording.graph.columns()
    with recording_in((tmp_path / "game.html").read_bytes()) as found:
        assert np.array_equal(found.graph.columns().node_ids, graph.node_ids)
        assert np.allclose(found.graph.columns().xy, graph.xy, rtol=0.0, atol=1e-4)
        assert found.turns == 80
        for before, after in zip(states, found, strict=True):
            assert before.scores == after.scores
            for name in ("name", "node", "previous", "alive"):
                assert np.array_equal(before.agents[name], after.agents[name]), name
        assert list(found.events()) == [{"turn": 12, "kind": "storm", "agent": "red_0"}]


def test_the_same_recording_gives_the_same_bytes(game):
    with recorder.open(game) as one, recorder.open(game) as other:
        assert web.page(one) == web.page(other)


def test_gamms_render_writes_a_page(game, tmp_path):
    options = rendering.RenderOptions(first=41, title="Later", theme="dark", trails=5)
    assert rendering.render(game, tmp_path / "game.html", options) == 80
    text = (tmp_path / "game.html").read_text()
    [shown] = re.findall(r'id="options">([^<]*)<', text)
    assert json.loads(shown) == {"title": "Later", "theme": "dark", "labels": "auto", "trails": 5, "turn": 40}
    with pytest.raises(BadValue, match="all turns"):
        rendering.render(game, tmp_path / "game.html", rendering.RenderOptions(last=5))


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
    assert text.count("</script>") == 3


def test_a_page_says_what_it_cannot_be(game, tmp_path):
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
