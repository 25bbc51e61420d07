"""Notebooks: contexts and recordings show themselves, and never fail at it."""

import base64
import html
import io
import re
import sys
import xml.etree.ElementTree as ET

import numpy as np
import pytest

import gamms
from gamms import recorder
from gamms.visual.backends.pillow_backend import decode_pixels


def image_in(page):
    kind, data = re.search('src="data:image/([a-z+]+);base64,([^"]+)"', page).groups()
    return kind, base64.b64decode(data)


@pytest.fixture
def recorded(ctx):
    """A short game of two teams and a drone, as a stream."""
    stream = io.BytesIO()
    ctx.agent.create_agent("kite", start_node_id=1, type=1, speed=2.0, team="red").position = (5.0, 5.0, 30.0)
    ctx.game.scores["red"] = 3
    ctx.record.start(stream)
    ctx.game.run(max_turns=2)
    ctx.record.stop()
    return io.BytesIO(stream.getvalue())


def test_a_context_and_its_pictures_are_a_png_of_what_they_are_now(ctx):
    pixels = decode_pixels(ctx._repr_png_())
    assert np.array_equal(decode_pixels(ctx.visual._repr_png_()), pixels)
    assert pixels.shape[0] <= 600
    assert pixels.shape[1] <= 900
    assert ctx._repr_html_() is None
    assert ctx.visual._repr_png_() == ctx._repr_png_()
    ctx.agent.delete_agent("red_0")
    assert not np.array_equal(decode_pixels(ctx._repr_png_()), pixels)


@pytest.mark.parametrize("missing", ["pygame", "PIL"])
def test_without_pixels_it_is_an_svg(ctx, monkeypatch, missing):
    from gamms.visual.backends.pygame_backend import load

    load.cache_clear()
    monkeypatch.setitem(sys.modules, missing, None)
    assert ctx._repr_png_() is None
    kind, content = image_in(ctx._repr_html_())
    load.cache_clear()
    assert kind == "svg+xml"
    assert ET.fromstring(content).tag.endswith("svg")


def test_one_that_has_ended_shows_nothing_and_says_nothing(ctx, heard):
    ctx.terminate()
    assert ctx._repr_png_() is None
    assert ctx._repr_html_() is None
    assert heard == []


def test_one_that_cannot_be_drawn_says_why(ctx, heard):
    ctx.visual.add_artist("own", {"drawer": lambda *_: None, "legend": "nonsense"})
    assert ctx._repr_png_() is None
    assert ctx._repr_html_() is None
    assert "'own'" in heard[0]


def test_a_recording_is_a_page_that_replays_it_and_a_picture_where_no_scripts_run(recorded):
    with recorder.open(recorded) as recording:
        page, printed = recording._repr_html_(), recording._repr_png_()
    assert "2 turns" in page
    assert "red: 3" in page
    [frame] = re.findall('<iframe title="the game" sandbox="allow-scripts"[^>]* srcdoc="([^"]*)"></iframe>', page)
    inner = html.unescape(frame)
    assert inner.startswith("<!DOCTYPE html>")
    kind, content = image_in(re.search("<noscript>(.*)</noscript>", inner)[1])
    assert (kind, content) == ("png", printed)
    assert decode_pixels(content).std() > 1


def test_a_recording_that_would_fill_a_notebook_is_its_last_state(recorded, monkeypatch):
    monkeypatch.setattr(recorder.recording, "_MOST_SHOWN", 1000)
    with recorder.open(recorded) as recording:
        page = recording._repr_html_()
    assert "<iframe" not in page
    assert decode_pixels(image_in(page)[1]).std() > 1


def test_showing_a_recording_logs_nothing_and_leaves_the_logger_alone(recorded, caplog):
    import logging

    before = logging.getLogger("gamms").level
    with recorder.open(recorded) as recording:
        recording._repr_html_()
    assert logging.getLogger("gamms").level == before
    assert caplog.records == []


def test_a_closed_recording_is_shown_as_its_repr(tmp_path):
    with gamms.create_context(seed=1, logger_config={"level": "CRITICAL"}) as ctx:
        ctx.graph.add_nodes([0], x=[0.0], y=[0.0])
        ctx.record.start(tmp_path / "game.ggr")
        ctx.record.stop()
    recording = recorder.open(tmp_path / "game.ggr")
    recording.close()
    assert recording._repr_html_() is None


@pytest.mark.parametrize(("name", "element"), [("f.gif", "<img"), ("f.mp4", "<video")])
def test_a_film_plays_where_it_was_made(ctx, tmp_path, name, element):
    with ctx.visual.film(tmp_path / name, 5, 64, 48, 2) as film:
        ctx.game.run(2)
        assert film._repr_html_() is None
        assert repr(film).endswith("being made)")
    page = film._repr_html_()
    assert page.startswith(element)
    assert base64.b64decode(re.search('base64,([^"]+)', page)[1]) == (tmp_path / name).read_bytes()
    assert repr(film) == f"Film({str(tmp_path / name)!r}, 1.8 s)"  # of which the end is shown for one
    (tmp_path / name).unlink()
    assert film._repr_html_() is None


def test_a_film_that_would_fill_a_notebook_is_not_put_into_it(ctx, tmp_path, monkeypatch):
    from gamms.visual import files

    with ctx.visual.film(tmp_path / "f.gif", 5, 64, 48, 1) as film:
        ctx.game.run(1)
    monkeypatch.setattr(files, "_MOST_SHOWN", (tmp_path / "f.gif").stat().st_size - 1)
    assert film._repr_html_() is None
