"""Words have an edge in the colour of the background, so that they can be read over a map."""

import re

import numpy as np
import pytest

from gamms.visual.backends.pillow_backend import decode_pixels

WHITE, DARK = (255, 255, 255), (20, 22, 26)


@pytest.mark.parametrize("background", [WHITE, DARK, (240, 220, 200)])
def test_no_other_colour_is_around_words(ctx, background):
    ctx.visual.set_graph_visual().set_visible(False)
    pixels = decode_pixels(ctx.visual.picture(".png", 300, 80, title="A title", note="a note", background=background))
    ink = np.array((222, 224, 228) if background == DARK else (51, 51, 51))
    line = pixels[:44].reshape(-1, 3).astype(float)
    share = (line - background) @ (ink - background) / ((ink - background) @ (ink - background))
    mixed = np.array(background) + share[:, None] * (ink - background)
    assert np.abs(line - mixed).max() < 4  # between paper and ink
    assert share.max() > 0.9


@pytest.mark.parametrize("background", [WHITE, DARK])
def test_the_edge_is_the_same_in_svg(ctx, background):
    picture = ctx.visual.picture(".svg", title="A title", background=background).decode()
    (edge,) = set(re.findall(r'<text[^>]*stroke="(#[0-9a-f]{6})" stroke-width="3"', picture))
    assert edge == "#{:02x}{:02x}{:02x}".format(*background)
