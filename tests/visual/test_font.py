"""Words are as broad in pixels as they are measured, so that gaps between letters are even."""

import logging

import numpy as np
import pytest
from PIL import ImageFont

import gamms
from gamms.visual import font
from gamms.visual.backends.pygame_backend import Canvas
from gamms.visual.font import EM, measure_words


def inked(words: str, font_px: int) -> np.ndarray:
    """Return how much ink is in each column of a picture, from where the words begin."""
    canvas = Canvas(600, 80)
    canvas.fill((255, 255, 255, 255))
    canvas.draw_text(words, 10, 10, font_px, (0, 0, 0, 255), edge=(255, 255, 255))
    return (255.0 - canvas.pixels()[:, 10:, 0]).sum(axis=0)


@pytest.mark.parametrize("font_px", [13, 16, 17, 19, 21, 28])
@pytest.mark.parametrize("words", ["OpenStreetMap contributors", "pursuer_2", "turn 9", "Ökologie Привет"])
def test_words_are_as_broad_as_measured(words, font_px):
    end = np.flatnonzero(inked(words, font_px) > 60)[-1] + 1
    assert end == pytest.approx(measure_words(words, font_px), abs=1.5)  # but for a bearing


def test_widths_are_those_of_helvetica():
    # From the metrics that Adobe publishes, in thousandths of the font size.
    for letter, width in {"a": 556, "i": 222, "W": 944, "0": 556, " ": 278, "@": 1015}.items():
        assert measure_words(letter, 1 / EM) == pytest.approx(width / 1000, abs=0.0006)


def test_a_letter_that_the_font_lacks_has_a_width():
    assert measure_words("\U0001f600", 10) > 0


@pytest.mark.parametrize("suffix", [".png", ".pdf", ".svg"])
def test_letters_that_the_font_lacks_are_warned_about_once_where_they_are_boxes(suffix, caplog, monkeypatch):
    monkeypatch.setattr(font, "_warned", [])
    font.warn_of_boxes.cache_clear()
    with gamms.create_context(logger_config={"level": "WARNING"}) as ctx, caplog.at_level("WARNING", "gamms"):
        monkeypatch.setattr(logging.getLogger("gamms"), "propagate", True)
        ctx.graph.add_nodes([0, 1], x=[0, 9], y=[0, 0])
        for title in ("Zürich, Αθήνα, Москва", "東京", "北京"):
            ctx.visual.picture(suffix, 300, 200, title=title)
    logged = [record.getMessage() for record in caplog.records]
    assert len(logged) == (suffix != ".svg")
    assert all("'東京' is written with boxes" in words and ".svg" in words for words in logged)


def test_the_table_of_widths_is_that_of_the_font():
    letters = ImageFont.truetype(str(font.FONT), 2048, layout_engine=ImageFont.Layout.BASIC)
    for letter in map(chr, range(32, 0x2200)):
        width = round(2048 * measure_words(letter, 1 / EM))
        assert letters.getlength(letter) == pytest.approx(width, abs=8), letter  # of which hints take some
