"""Draw commands: from single calls or bulk calls to the same columns."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gamms.errors import BadValue
from gamms.visual.drawing import Commands

numbers = st.floats(-1e6, 1e6)
points = st.tuples(numbers, numbers)
lines = st.lists(st.lists(points, min_size=2, max_size=5), max_size=8)


@given(lines)
def test_frozen_columns_keep_the_order_and_the_points(polylines):
    commands = Commands()
    for layer, line in enumerate(polylines):
        commands.layer = layer
        commands.add_line(line, (layer, 0, 0), width=layer + 1)
    frozen = commands.freeze()
    assert len(frozen) == len(polylines) == len(frozen.text)
    assert frozen.layer.tolist() == list(range(len(polylines)))
    assert frozen.color[:, 0].tolist() == list(range(len(polylines)))
    assert [
        [tuple(point) for point in frozen.points[begin:end].tolist()]
        for begin, end in zip(frozen.offsets[:-1], frozen.offsets[1:], strict=True)
    ] == polylines


@given(lines)
def test_bulk_lines_equal_single_lines(polylines):
    one_by_one, bulk = Commands(), Commands()
    for line in polylines:
        one_by_one.add_line(line, "red", 2)
    flat = [point for line in polylines for point in line]
    bulk.add_lines(flat, np.cumsum([0, *map(len, polylines)]), "red", 2)
    left, right = one_by_one.freeze(), bulk.freeze()
    for name in ("kind", "layer", "space", "size", "width", "angle", "color", "offsets", "points"):
        np.testing.assert_array_equal(getattr(left, name), getattr(right, name))


def test_the_columns_neither_follow_the_caller_nor_can_be_written():
    mine = np.zeros((2, 2))
    commands = Commands()
    commands.add_line(mine, "red")
    mine[:] = 9
    frozen = commands.freeze()
    assert frozen.points.tolist() == [[0, 0], [0, 0]]
    with pytest.raises(ValueError, match="read-only"):
        frozen.points[0] = 1


@pytest.mark.parametrize(
    "wrong",
    [
        lambda c: c.add_circles([(float("nan"), 0)], 1, "red"),
        lambda c: c.add_circles([(0, float("inf"))], 1, "red"),
        lambda c: c.add_circles([(0, 0, 0)], 1, "red"),
        lambda c: c.add_circles([(0, 0)], -1, "red"),
        lambda c: c.add_circles([(0, 0)], float("inf"), "red"),
        lambda c: c.add_circles([("a", "b")], 1, "red"),
        lambda c: c.add_line([(0, 0)], "red"),
        lambda c: c.add_line([(0, 0), (1, 1)], "red", width=float("nan")),
        lambda c: c.add_lines([(0, 0), (1, 1)], [0, 1], "red"),
        lambda c: c.add_polygon([(0, 0), (1, 1)], "red"),
        lambda c: c.add_rectangle(0, 0, -1, 1, "red"),
        lambda c: c.add_text("x", float("nan"), 0, "red", 12),
    ],
)
def test_an_impossible_command_is_refused_and_leaves_nothing(wrong):
    commands = Commands()
    with pytest.raises(BadValue):
        wrong(commands)
    assert len(commands.freeze()) == 0
