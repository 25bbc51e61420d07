"""SVG files: small, well-formed, and the same for the same commands."""

import os
import re
from base64 import b64encode
from collections import Counter
from itertools import chain, pairwise
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gamms.errors import BadValue
from gamms.ir.draw import DrawSpace
from gamms.visual.backends.svg import write_svg
from gamms.visual.camera import Camera, compute_bounds, fit_box
from gamms.visual.drawing import Commands

GOLDEN = Path(__file__).parent / "golden" / "tiny.svg"
WHITE = (255, 255, 255, 255)
IN_PIXELS = Camera(100, 50, 0.0, 50.0, 1.0)  # world x, y is pixel x, 50 - y

numbers = st.floats(-1e6, 1e6)
points = st.tuples(numbers, numbers)
colors = st.tuples(*[st.integers(0, 255)] * 4)
sizes = st.floats(0, 1e4)


def written(commands, camera=IN_PIXELS, title=""):
    """The file as text."""
    return write_svg(commands.freeze(), camera, title=title, background=WHITE).decode()


def test_the_golden_picture():
    """Refresh with `GAMMS_REFRESH_GOLDEN=1 pytest tests/visual/test_svg.py`, and review the difference."""
    commands = Commands()
    commands.add_lines([(0, 0), (10, 0), (10, 0.01), (10, 10)], [0, 2, 4], (211, 211, 211), 1.5)
    commands.layer = 20
    commands.add_circles([(10, 10), (5, 5)], 3, (0, 114, 178))
    commands.add_circles([(10, 10)], 6, (0, 0, 0, 128), 2, DrawSpace.SCREEN)
    commands.layer = 10
    commands.add_polygon([(20, 20), (30, 20), (25, 28.66)], "red")
    commands.add_rectangle(2, 30, 12, 8, "green")
    commands.add_text("a < b & c", 2, 40, "black", 10)
    text = written(commands, title="Tiny")
    if os.environ.get("GAMMS_REFRESH_GOLDEN"):
        GOLDEN.write_text(text, encoding="utf-8")
    assert text == GOLDEN.read_text(encoding="utf-8")


@given(st.lists(st.lists(points, min_size=2, max_size=5), min_size=1, max_size=8))
def test_bulk_lines_give_the_file_of_single_lines(lines):
    one_by_one, bulk = Commands(), Commands()
    for line in lines:
        one_by_one.add_line(line, "red", 2)
    bulk.add_lines([*chain(*lines)], np.cumsum([0, *map(len, lines)]), "red", 2)
    camera = fit_box(*compute_bounds(bulk.freeze()), 300, 200, (8, 8, 8, 8))
    assert written(one_by_one, camera) == written(bulk, camera)
    assert written(bulk, camera).count("<path") <= 1


def test_repeated_points_and_lines_too_short_to_see_are_left_out():
    commands = Commands()
    commands.add_line([(1, 1), (1.01, 1), (2, 1)], "red")
    commands.add_line([(5, 5), (5.01, 5.01)], "red")
    assert 'd="m1 49 1 0"' in written(commands)


def test_commands_of_one_style_share_one_group():
    commands = Commands()
    for x in range(5):
        commands.add_circles([(x, x)], 1 + x, "red")
    assert written(commands).count("<g fill") == 1
    assert written(commands).count("<circle") == 5


def test_alpha_becomes_opacity():
    commands = Commands()
    commands.add_circles([(1, 1)], 5, (255, 0, 0, 51))
    commands.add_line([(0, 0), (1, 1)], (255, 0, 0, 51))
    assert 'fill="#ff0000" fill-opacity="0.2"' in written(commands)
    assert 'stroke="#ff0000" stroke-opacity="0.2"' in written(commands)


def test_a_rectangle_keeps_its_pixels_at_any_scale():
    commands = Commands()
    commands.add_rectangle(1, 2, 30, 20, "red")
    for scale in (1.0, 100.0):
        assert 'width="30" height="20"' in written(commands, IN_PIXELS._replace(scale=scale))


def test_a_disc_too_small_to_see_is_left_out():
    commands = Commands()
    commands.add_circles([(1, 1)], 0.4, "red")
    assert "<circle" not in written(commands)


def test_an_image_is_put_into_the_file_and_turned_counter_clockwise(tmp_path):
    image = tmp_path / "robot.png"
    image.write_bytes(b"pixels")
    commands = Commands()
    commands.add_image(str(image), 10, 20, 5, angle=30)
    text = written(commands)
    assert f'href="data:image/png;base64,{b64encode(b"pixels").decode()}"' in text
    assert 'x="5" y="25" width="10" height="10" transform="rotate(-30 10 30)"' in text


def test_an_image_of_a_foreign_kind_is_refused(tmp_path):
    commands = Commands()
    commands.add_image(str(tmp_path / "robot.xcf"), 0, 0, 5)
    with pytest.raises(BadValue, match=r"robot\.xcf"):
        written(commands)


@given(
    st.lists(
        st.one_of(
            st.tuples(st.just("add_circles"), st.tuples(st.lists(points, max_size=3), sizes, colors, sizes)),
            st.tuples(st.just("add_line"), st.tuples(st.lists(points, min_size=2, max_size=4), colors, sizes)),
            st.tuples(st.just("add_polygon"), st.tuples(st.lists(points, min_size=3, max_size=4), colors)),
            st.tuples(
                st.just("add_symbols"),
                st.tuples(st.lists(points, max_size=3), st.lists(points, min_size=2, max_size=4), colors, sizes),
            ),
            st.tuples(st.just("add_rectangle"), st.tuples(numbers, numbers, sizes, sizes, colors)),
            st.tuples(st.just("add_text"), st.tuples(st.text(), numbers, numbers, colors, sizes)),
        )
    ),
    st.text(),
)
def test_any_picture_is_well_formed_and_written_the_same_twice(calls, words):
    commands = Commands()
    for name, arguments in calls:
        getattr(commands, name)(*arguments)
    camera = fit_box(*compute_bounds(commands.freeze()), 320, 240, (9, 44, 9, 9))
    text = written(commands, camera, words)
    assert ET.fromstring(text).get("role") == "img"
    assert text == written(commands, camera, words)


@given(st.lists(st.tuples(st.integers(0, 4), st.integers(0, 4), st.integers(0, 4), st.integers(0, 4)), min_size=1))
def test_lines_that_meet_are_chained_and_each_is_drawn_once(lines):
    commands = Commands()
    for ax, ay, bx, by in lines:
        commands.add_line([(ax, ay), (bx, by)], "red")
    path = "".join(re.findall(' d="([^"]*)"', written(commands)))
    drawn, open_ends, place = [], [], np.zeros(2, int)
    for steps in path.split("m")[1:]:
        points = place + np.cumsum(np.array(re.findall(r"-?\d+", steps), int).reshape(-1, 2), axis=0)
        drawn += [frozenset(map(tuple, ends)) for ends in pairwise(points.tolist())]
        open_ends.append((tuple(points[0].tolist()), tuple(points[-1].tolist())))
        place = points[-1]
    wanted = [frozenset(((ax, 50 - ay), (bx, 50 - by))) for ax, ay, bx, by in lines if (ax, ay) != (bx, by)]
    assert Counter(drawn) == Counter(wanted)
    uneven = [point for point, count in Counter(chain(*wanted)).items() if count % 2]
    assert sorted(chain(*(ends for ends in open_ends if ends[0] != ends[1]))) == sorted(uneven)
