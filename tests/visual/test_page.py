"""A page is as large as its map needs, and says what lengths on it mean."""

import re
from xml.etree import ElementTree as ET

import numpy as np
import pytest

import gamms
from gamms.errors import BadType, BadValue
from gamms.visual.backends.pillow_backend import decode_pixels
from gamms.visual.legend import LegendRow, LegendRows
from gamms.visual.page import find_round_length

SVG = "{http://www.w3.org/2000/svg}"
FIRE = (LegendRows("", (LegendRow((200, 0, 0), "fire", "3"),)),)


@pytest.fixture
def street():
    """A function that returns a context with a map of a width and a height."""
    made = []

    def make(width, height, crs=None):
        ctx = gamms.create_context()
        made.append(ctx)
        x, y = (500_000.0, 6_700_000.0) if crs else (0.0, 0.0)
        ctx.graph.add_nodes([0, 1, 2], x=[x, x + width, x], y=[y, y, y + height])
        ctx.graph.add_edges([0, 1], sources=[0, 1], targets=[1, 2])
        ctx.graph.graph.crs = crs
        return ctx

    yield make
    for ctx in made:
        ctx.terminate()


def sides(ctx, *size, **options):
    root = ET.fromstring(ctx.visual.picture(".svg", *size, **options))
    return int(root.get("width")), int(root.get("height"))


def words(ctx, *size, **options):
    return [text.text for text in ET.fromstring(ctx.visual.picture(".svg", *size, **options)).iter(f"{SVG}text")]


def inked(ctx, *size, **options):
    """The first and last column, and row, of a picture with anything but paper."""
    pixels = decode_pixels(ctx.visual.picture(".png", *size, background="white", **options))
    rows, columns = (np.flatnonzero((pixels < 250).any(axis=axes)) for axes in ((1, 2), (0, 2)))
    return columns[0], columns[-1], rows[0], rows[-1], pixels.shape[1], pixels.shape[0]


def test_a_high_map_has_a_high_page_and_a_broad_map_a_broad_one(street):
    for extent, ratio in (((500, 1000), 1.9), ((1000, 500), 0.5)):
        width, height = sides(street(*extent))
        assert height / width == pytest.approx(ratio, rel=0.1)


def test_the_map_fills_a_page_of_no_given_size(street):
    left, right, top, low, width, height = inked(street(500, 1000))
    assert right - left > 0.9 * width
    assert low - top > 0.9 * height


def test_a_page_is_as_large_as_was_asked(street):
    assert sides(street(500, 1000), 640, 300) == (640, 300)


def test_a_tight_page_is_as_large_as_the_map_needs_and_not_larger_than_asked(street):
    width, height = sides(street(500, 1000), 640, 300, fit="tight")
    assert height == 300
    assert width < 200


def test_a_road_without_any_height_still_has_a_page_that_can_be_looked_at(street):
    width, height = sides(street(1000, 0))
    assert 1000 < width < 1400
    assert 20 < height < 120


def test_a_page_without_a_map_has_a_size(ctx):
    ctx.visual.set_graph_visual().set_visible(False)
    assert min(sides(ctx)) > 0


def test_a_picture_that_looks_at_a_part_is_16_by_9(street):
    ctx = street(500, 1000)
    ctx.visual.look_at(0, 0, 100)
    assert sides(ctx) == (1280, 720)
    assert sides(ctx, 640) == (640, 360)


def test_a_page_of_more_dots_per_inch_is_as_large_on_paper(street):
    assert np.allclose(
        np.array(sides(street(500, 1000), dpi=96)), np.array(page_px(street(500, 1000), 192)) / 2, atol=1
    )


def page_px(ctx, dpi):
    pixels = decode_pixels(ctx.visual.picture(".png", dpi=dpi))
    return pixels.shape[1], pixels.shape[0]


def test_a_film_of_no_given_size_is_as_its_map(street, tmp_path):
    ctx = street(500, 1000)
    with ctx.visual.film(tmp_path / "a.gif", frames_per_turn=1, captions=False):
        ctx.visual.simulate()
    picture = (tmp_path / "a.gif").read_bytes()
    width, height = int.from_bytes(picture[6:8], "little"), int.from_bytes(picture[8:10], "little")
    assert (width, height) == sides(ctx)


# -- the scale bar and north ------------------------------------------------------------------------------------


def test_a_map_in_metres_has_a_scale_bar_and_others_do_not(street):
    assert words(street(500, 1000, "EPSG:32635"), 400, 600) == ["100 m"]
    assert words(street(500, 1000), 400, 600) == []
    assert words(street(5, 10, "EPSG:4326"), 400, 600) == []


def test_a_scale_bar_can_be_asked_for_and_left_out(street):
    assert words(street(500, 1000), 400, 600, scale_bar=True) == ["100"]
    assert words(street(500, 1000, "EPSG:32635"), 400, 600, scale_bar=False) == []


def test_north_is_shown_where_it_is_asked_for(street):
    assert "N" in words(street(500, 1000), north=True)
    assert "N" not in words(street(500, 1000))


@pytest.mark.parametrize(
    ("longest", "length"), [(1, 1), (1.99, 1), (2, 2), (7, 5), (99, 50), (0.3, 0.2), (5_000, 5_000)]
)
def test_lengths_are_round(longest, length):
    assert find_round_length(longest) == pytest.approx(length)


def test_a_small_picture_has_no_scale_bar(street):
    assert words(street(500, 1000, "EPSG:32635"), 150, 200) == []


def test_a_bar_that_has_no_room_beside_the_note_stands_above_it(street):
    ctx = street(500, 1000, "EPSG:32635")
    ctx.graph.graph.attribution = "© OpenStreetMap contributors, ODbL 1.0"
    root = ET.fromstring(ctx.visual.picture(".svg", 300, 500))
    heights = {text.text: float(text.get("y")) for text in root.iter(f"{SVG}text")}
    assert 10 < heights["© OpenStreetMap contributors, ODbL 1.0"] - heights["100 m"] < 40


def test_a_scale_bar_ends_where_its_words_stand(street):
    picture = street(500, 1000, "EPSG:32635").visual.picture(".svg", 400, 500).decode()
    ((top, height),) = re.findall(r'stroke="#777777" stroke-width="1.5" d="m\d+ (\d+) 0 (\d+) ', picture)
    assert f'y="{int(top) + int(height) - 1}" font-size="11"' in picture


# -- the legend and the words -----------------------------------------------------------------------------------


def test_the_legend_stands_beside_the_map_however_broad_the_page(street):
    ctx = street(500, 1000)
    ctx.visual.add_artist("own", {"drawer": lambda *_: None, "legend": list(FIRE)})
    left, right, *_, width, _ = inked(ctx, 1200, 400)
    assert right - left < 400
    assert abs((left + right) - width) < 60  # the map and its legend are in the middle


def test_a_title_and_a_note_stay_on_the_page(street):
    shown = words(street(10, 10), 300, 300, title="title " * 200, note="note " * 200)
    assert all(word.startswith("…") and 20 < len(word) < 100 for word in shown)
    assert len(shown) == 2


def test_a_tight_page_has_room_for_its_title(street):
    title = "A rather long title of a slim map"
    assert title in words(street(10, 100), title=title)
    assert title in words(street(10, 100), 900, 400, fit="tight", title=title)


@pytest.mark.parametrize(
    ("options", "error", "said"),
    [
        ({"fit": "loose"}, BadValue, "'page' or 'tight', not 'loose'"),
        ({"scale_bar": "yes"}, BadType, "scale_bar"),
        ({"titel": "A"}, BadType, "'titel'.* Did you mean 'title'"),
        ({"background": "rde"}, BadValue, "rde"),
    ],
)
def test_an_impossible_option_is_refused(street, tmp_path, options, error, said):
    ctx = street(10, 10)
    for call in (
        lambda: ctx.visual.picture(".svg", **options),
        lambda: ctx.visual.frame(64, 64, **options),
        lambda: ctx.visual.film(tmp_path / "a.gif", **options),
    ):
        with pytest.raises(error, match=said):
            call()
    assert list(tmp_path.iterdir()) == []
