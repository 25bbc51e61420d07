"""The legend on the window: that of pictures, beside the words and the map, and painted only when it changes."""

import pytest

from gamms.visual.legend import LegendRow, LegendRows
from gamms.visual.window import overlay

RISK = {"nodes": {0: 0, 1: 1.25, 2: 5}, "name": "risk"}


@pytest.fixture
def said(monkeypatch):
    """Everything that is written in a frame."""
    words = []
    text = overlay.Canvas.text
    monkeypatch.setattr(
        overlay.Canvas, "text", lambda self, line, *rest, **more: words.append(line) or text(self, line, *rest, **more)
    )
    return words


def frame(ctx, said):
    said.clear()
    ctx.visual.update()
    return set(said)


def test_what_is_declared_explains_itself_and_nothing_else_is_explained(ctx, said):
    ctx.visual.set_graph_visual()
    assert frame(ctx, said).isdisjoint({"red", "blue"})
    artist = ctx.visual.add_artist(
        "fire", {"drawer": lambda *_: None, "legend": LegendRows("", (LegendRow((200, 0, 0), "fire"),))}
    )
    assert "fire" in frame(ctx, said)
    artist.set_visible(False)
    ctx.visual.update()
    assert ctx.visual.overlay.hud.legend.width == 0


def test_it_is_written_only_when_it_changes(ctx, said):
    assert "red" in frame(ctx, said)
    ctx.visual.look_at(3.0, 3.0, 20.0)
    assert "red" not in frame(ctx, said)
    ctx.game.scores["red"] = 7
    assert {"red", "7"} <= frame(ctx, said)


def test_a_window_that_was_made_smaller_has_none_and_sees_the_whole_map(ctx, person):
    ctx.visual.set_values(**RISK)
    ctx.visual.update()
    assert ctx.visual.overlay.hud.legend.width > 0
    person._do("VIDEORESIZE", w=90, h=60, size=(90, 60))
    ctx.visual.screen = person.pygame.display.set_mode((90, 60), person.pygame.RESIZABLE)
    ctx.visual.update()
    assert ctx.visual.overlay.hud.legend.width == 0
    left, right, low, high, _ = ctx.visual.get_viewport()
    assert left < 0 < 12 < right
    assert low < 0 < 10 < high
