"""The legend on the window: that of pictures, beside the words and the map, and painted only when it changes."""

import pytest

from gamms.visual.legend import LegendRow, LegendRows
from gamms.visual.window import overlay


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
