"""Colours by name and value."""

import pytest

from gamms.errors import BadType, BadValue
from gamms.visual import Color, string_to_color
from gamms.visual.appearance import parse_color


@pytest.mark.parametrize(
    ("text", "color"),
    [
        ("red", (255, 0, 0)),
        ("LightGrey", (211, 211, 211)),
        ("orange", (255, 165, 0)),
        ("#0a10ff", (10, 16, 255)),
    ],
)
def test_a_color_has_a_name_or_a_code(text, color):
    assert string_to_color(text) == color


def test_an_unknown_color_names_the_nearest_one():
    with pytest.raises(ValueError, match="Did you mean 'magenta'"):
        string_to_color("magneta")


@pytest.mark.parametrize("text", ["", "#12345", "#gggggg", "#12345678"])
def test_an_invalid_color_is_refused(text):
    with pytest.raises(BadValue, match="Unknown color"):
        string_to_color(text)


def test_components_are_clipped_and_alpha_is_full_by_default():
    assert parse_color((300, -5, 12.4)) == (255, 0, 12, 255)
    assert parse_color((1, 2, 3, 4)) == (1, 2, 3, 4)
    assert parse_color("cyan") == (*Color.Cyan, 255)


@pytest.mark.parametrize(
    ("color", "error"),
    [((1, 2), BadValue), ((1, 2, float("nan")), BadValue), (7, BadType), ((1, 2, None), BadType)],
)
def test_an_impossible_color_is_refused(color, error):
    with pytest.raises(error):
        parse_color(color)
