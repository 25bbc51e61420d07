"""Legends: beside the map, the same in every format, and told by whoever draws."""

import numpy as np
import pytest

from gamms.errors import BadType
from gamms.visual.appearance import PAPER
from gamms.visual.camera import Camera
from gamms.visual.legend import Row, Rows
from gamms.visual.page import Page, PageStyle

FIRE = Rows("", (Row((200, 0, 0), "fire", "3"),))


def has_color(pixels, color):
    return bool((np.abs(pixels.astype(int) - color).max(axis=2) < 8).any())


def test_a_bar_is_in_every_format(ctx, tmp_path):
    ctx.visual.set_values(nodes={0: 0, 1: 1.25, 2: 5}, name="risk")
    ctx.visual.save(tmp_path / "risk.svg")
    text = (tmp_path / "risk.svg").read_text()
    assert all(f">{word}</text>" in text for word in ("risk", "0", "2.5", "5"))
    pixels = ctx.visual.frame(640, 400)
    assert has_color(pixels[:, 480:], (253, 231, 37))
    ctx.visual.set_values(name="risk")
    assert not has_color(ctx.visual.frame(640, 400)[:, 480:], (253, 231, 37))


def test_the_map_leaves_room_for_the_legend(ctx):
    ctx.visual.set_graph_visual(node_size=0.1, edge_color=(1, 2, 3))
    wide = (np.abs(ctx.visual.frame(640, 640).astype(int) - (1, 2, 3)).max(axis=2) < 8).any(axis=0)
    ctx.visual.set_values(nodes={0: 0, 1: 1})
    slim = (np.abs(ctx.visual.frame(640, 640).astype(int) - (1, 2, 3)).max(axis=2) < 8).any(axis=0)
    assert np.flatnonzero(wide).max() > np.flatnonzero(slim).max()


def test_a_camera_that_was_pointed_keeps_its_place(ctx):
    ctx.visual.look_at(5, 5, 30)
    before = ctx.visual.frame(640, 640)
    ctx.visual.add_artist("own", {"drawer": lambda *_: None, "legend": FIRE})
    after = ctx.visual.frame(640, 640)
    changed = np.flatnonzero((before != after).any(axis=(0, 2)))
    assert changed.min() > 320


def test_any_artist_may_explain_itself_and_a_hidden_one_does_not(ctx, tmp_path):
    artist = ctx.visual.add_artist("own", {"drawer": lambda *_: None, "legend": [FIRE, None]})
    ctx.visual.save(tmp_path / "a.svg")
    assert ">fire</text>" in (tmp_path / "a.svg").read_text()
    artist.set_visible(False)
    ctx.visual.save(tmp_path / "a.svg")
    assert "fire" not in (tmp_path / "a.svg").read_text()


def test_something_else_than_a_legend_is_refused(ctx):
    ctx.visual.add_artist("own", {"drawer": lambda *_: None, "legend": "fire"})
    with pytest.raises(BadType, match="artist 'own'"):
        ctx.visual.frame(320, 200)


def test_a_small_picture_has_no_legend(ctx):
    before = ctx.visual.frame(60, 40)
    ctx.visual.add_artist("own", {"drawer": lambda *_: None, "legend": FIRE})
    assert (ctx.visual.frame(60, 40) == before).all()


def test_what_would_be_too_long_is_counted():
    rows = Rows("", tuple(Row((0, 0, 0), f"team {number}") for number in range(40)))
    commands = Page(1280, 720, (rows,), PageStyle()).commands(Camera(1280, 720, 0.0, 0.0, 1.0))
    assert commands.text[-1] == "and 29 more"


def test_a_legend_is_where_it_belongs_whatever_the_camera_sees():
    page = Page(640, 400, (FIRE,), PageStyle())
    for camera in (Camera(640, 400, 0.0, 0.0, 1.0), Camera(640, 400, 5e5, 6.7e6, 0.01)):
        commands = page.commands(camera)
        places = camera.to_screen(commands.points[commands.offsets[:-1]])
        assert ((places > 0) & (places < (640, 400))).all()
        assert tuple(commands.color[0, :3]) == PAPER
