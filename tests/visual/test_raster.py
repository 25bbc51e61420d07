"""Pixels: each kind of command where it belongs, blended as its alpha says, and nothing lost at the borders."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gamms.errors import BadValue
from gamms.ir.draw import DrawSpace
from gamms.visual.backends.pillow_backend import decode_pixels, encode_png
from gamms.visual.backends.raster import paint_picture
from gamms.visual.backends.svg import write_svg
from gamms.visual.camera import FAINTEST_PX, Camera
from gamms.visual.drawing import Commands

WHITE = (255, 255, 255, 255)
IN_PIXELS = Camera(100, 50, 0.0, 50.0, 1.0)  # world x, y is pixel x, 50 - y
RED = (255, 0, 0)

GOLDEN = Path(__file__).parent / "golden" / "tiny.png"

numbers = st.floats(-300, 300)
points = st.tuples(numbers, numbers)


def pixels(commands, camera=IN_PIXELS, background=WHITE):
    """The picture, as (rows, columns, 3)."""
    return paint_picture(commands.freeze(), camera, background).pixels().astype(int)


def drawn(name, *arguments, camera=IN_PIXELS, **keywords):
    """The picture of one call."""
    commands = Commands()
    getattr(commands, name)(*arguments, **keywords)
    return pixels(commands, camera)


def test_the_golden_picture():
    """Refresh with `GAMMS_REFRESH_GOLDEN=1 pytest tests/visual/test_raster.py`, and look at it."""
    commands = Commands()
    commands.add_lines([(0, 0), (100, 40), (100, 45), (0, 5)], [0, 2, 4], (120, 120, 120))
    commands.layer = 20
    commands.add_circles([(30, 20), (60, 30)], 7.5, (0, 114, 178))
    commands.add_circles([(60, 30)], 12, (0, 0, 0, 128), 3, DrawSpace.SCREEN)
    commands.layer = 10
    commands.add_polygon([(60, 5), (95, 5), (77.5, 35)], (213, 94, 0, 180))
    commands.add_rectangle(5, 45, 22, 12, (0, 158, 115))
    commands.add_line([(10, 10), (20, 40), (50, 10)], (204, 121, 167, 150), 4.5)
    commands.add_text("Tiny 7", 40, 49, "black", 18)
    picture = pixels(commands)
    if os.environ.get("GAMMS_REFRESH_GOLDEN"):
        GOLDEN.write_bytes(encode_png(picture.astype(np.uint8), 96))
    difference = np.abs(picture - decode_pixels(GOLDEN.read_bytes()))
    assert np.quantile(difference, 0.995) <= 24  # another version of pygame may smooth hairlines and text otherwise
    assert difference.mean() <= 1


def ink(picture):
    """How much was painted, in pixels of black."""
    return (255 - picture).mean(axis=2).sum() / 255


def test_a_disc_has_its_area_and_its_place():
    picture = drawn("add_circles", [(40.3, 20.7)], 9.25, "black")
    assert ink(picture) == pytest.approx(np.pi * 9.25**2, rel=0.02)
    rows, columns = np.nonzero(picture[:, :, 0] < 128)
    assert (columns.mean() + 0.5, 50 - rows.mean() - 0.5) == pytest.approx((40.3, 20.7), abs=0.2)


@pytest.mark.parametrize("radius", [3.0, 20.0, 200.0])
def test_a_ring_leaves_its_middle_free(radius):
    picture = drawn("add_circles", [(50, 25)], radius, "black", 2.0)
    assert (picture[25, 50] == 255).all()
    if radius < 25:
        assert ink(picture) == pytest.approx(2 * np.pi * radius * 2.0, rel=0.03)


def test_a_line_may_be_as_broad_as_the_world():
    assert (drawn("add_line", [(0, 0), (10, 0)], RED, 1e6) == RED).all()
    camera = Camera(400, 300, 0.0, 300.0, 1.0)
    few, many = (drawn("add_line", [(100, 150), (300, 200)], "black", width, camera=camera) for width in (199.9, 200.1))
    assert np.abs(few - many).mean() < 0.5


@pytest.mark.parametrize("width", [0.5, 1.0, 1.5, 4.0, 15.0])
@pytest.mark.parametrize("end", [(80, 30), (20, 45), (20.5, 5.5)])
def test_a_line_has_its_width_in_every_direction(width, end):
    start = (20, 30)
    length = np.hypot(end[0] - start[0], end[1] - start[1])
    picture = drawn("add_line", [start, end], "black", width)
    assert ink(picture) == pytest.approx(length * width + np.pi / 4 * width**2, rel=0.1, abs=1.5)


def test_a_line_in_world_units_grows_with_the_scale_but_never_vanishes():
    commands = Commands()
    commands.add_lines([(0, 25), (100, 25)], [0, 2], "black", 0.5, DrawSpace.WORLD)
    near, far = (ink(pixels(commands, Camera(100, 50, 0.0, 25 + 25 / scale, scale))) for scale in (10.0, 0.5))
    assert near == pytest.approx(500, rel=0.05)
    assert far == pytest.approx(50 * FAINTEST_PX, rel=0.1)


def test_a_line_in_world_units_that_is_thinner_than_a_pixel_is_a_paler_one():
    commands = Commands()
    commands.add_lines([(0, 25), (100, 25)], [0, 2], "black", 1.4, DrawSpace.WORLD)
    camera = Camera(100, 50, 0.0, 25 + 25 / 0.5, 0.5)
    assert ink(pixels(commands, camera)) == pytest.approx(50 * 0.7, rel=0.1)
    assert (
        'stroke-width="0.7"' in write_svg(commands.freeze(), camera, title="", background=(255, 255, 255, 255)).decode()
    )


def test_lines_of_one_style_count_once_where_they_cross():
    commands = Commands()
    commands.add_lines([(0, 25), (100, 25), (50, 0), (50, 50)], [0, 2, 4], (0, 0, 0, 128), 5)
    picture = pixels(commands)
    assert (picture[25, 50] == picture[25, 10]).all()


def test_a_line_across_the_view_is_seen_though_its_ends_are_outside():
    loop = [(-50, -50), (150, 100), (-50, 100), (-50, -50)]
    for width in (1, 3):
        assert ink(drawn("add_line", loop, "black", width)) > 40
        assert ink(drawn("add_line", [(-1e9, 25), (1e9, 25)], "black", width)) == pytest.approx(100 * width, rel=0.05)
    assert (drawn("add_polygon", [(-1e6, -1e6), (1e6, -1e6), (0, 1e6)], RED) == RED).all()
    assert (drawn("add_circles", [(50, 25)], 1e5, RED) == RED).all()
    assert ink(drawn("add_circles", [(-20, 25)], 21.5, "black")) > 3


def test_a_rectangle_hangs_from_its_upper_left_corner():
    picture = drawn("add_rectangle", 10, 40, 20, 5, RED)
    assert (picture[10:15, 10:30] == RED).all()
    assert ink(picture) == pytest.approx(100 * 2 / 3)


def test_an_image_that_cannot_be_read_is_named(tmp_path):
    (tmp_path / "broken.png").write_bytes(b"no picture")
    with pytest.raises(BadValue, match=r"broken\.png"):
        drawn("add_image", str(tmp_path / "broken.png"), 50, 25, 10)


@given(
    st.lists(
        st.one_of(
            st.tuples(st.just("add_circles"), st.tuples(st.lists(points, max_size=3), st.floats(0, 60), st.just(RED))),
            st.tuples(
                st.just("add_line"),
                st.tuples(st.lists(points, min_size=2, max_size=4), st.just(RED), st.sampled_from([1, 1.5, 6])),
            ),
            st.tuples(st.just("add_polygon"), st.tuples(st.lists(points, min_size=3, max_size=4), st.just(RED))),
            st.tuples(
                st.just("add_symbols"),
                st.tuples(
                    st.lists(points, max_size=3),
                    st.lists(st.tuples(st.floats(-30, 30), st.floats(-30, 30)), min_size=2, max_size=4),
                    st.just(RED),
                    st.sampled_from([0, 3]),
                ),
            ),
        ),
        max_size=5,
    )
)
def test_culling_never_changes_pixels(calls):
    """A view is a piece of the larger view around it."""
    commands = Commands()
    for name, arguments in calls:
        getattr(commands, name)(*arguments)
    whole = pixels(commands, Camera(700, 700, -350.0, 350.0, 1.0))
    part = pixels(commands, Camera(100, 50, 0.0, 50.0, 1.0))
    # Hairlines may be rounded differently where they were cut.
    far = np.abs(part - whole[300:350, 350:450]).max(axis=2) > 130
    assert far.sum() <= 3


@given(
    st.lists(st.tuples(points, st.floats(0, 40), st.sampled_from(DrawSpace)), min_size=1),
    st.tuples(points, st.floats(0.05, 20)),
)
def test_circles_out_of_sight_are_left_out_and_no_others(circles, view):
    """Whatever their sizes and units, as it would be if each were looked at on its own."""
    (x, y), scale = view
    camera, together, alone = Camera(100, 50, x, y, scale), Commands(), []
    for center, radius, space in circles:
        for commands in (together, one := Commands()):
            commands.add_circles([center], radius, RED, space=space)
        alone.append(one)
    seen = [pixels(commands, camera)[:, :, 1] < 255 for commands in alone]
    assert ((pixels(together, camera)[:, :, 1] < 255) == np.any(seen, axis=0)).all()


def test_painting_needs_no_display_and_leaves_no_trace():
    code = """
import os
before = dict(os.environ)
import gamms
with gamms.create_context(logger_config={"level": "CRITICAL"}) as ctx:
    ctx.graph.graph.add_node({"id": 0, "x": 0, "y": 0})
    print(ctx.visual.frame(width=40, height=30).shape)
import pygame
print(pygame.display.get_init(), pygame.mixer.get_init(), dict(os.environ) == before)
"""
    lines = subprocess.check_output([sys.executable, "-W", "error", "-c", code], text=True).splitlines()
    assert lines == ["(30, 40, 3)", "False None True"]
