"""The layout of a picture: which place a part takes, beside areas that are covered already."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gamms.visual.layout import Layout

PAGE = (0.0, 0.0, 100.0, 80.0)
boxes = st.builds(
    lambda x, y, width, height: (x, y, x + width, y + height),
    *[st.integers(-20, 90)] * 2,
    *[st.integers(1, 40)] * 2,
)


def shared(one, other, gap=0):
    """The area that a box with a gap around it shares with another."""
    across = min(one[2] + gap, other[2]) - max(one[0] - gap, other[0])
    down = min(one[3] + gap, other[3]) - max(one[1] - gap, other[1])
    return max(across, 0) * max(down, 0)


def is_inside(box):
    return PAGE[0] <= box[0] and PAGE[1] <= box[1] and box[2] <= PAGE[2] and box[3] <= PAGE[3]


@given(st.lists(boxes, max_size=6), st.lists(boxes, min_size=1, max_size=6), st.integers(0, 5))
@settings(max_examples=150)
def test_the_first_place_is_taken_that_covers_nothing_or_else_the_least(areas, places, gap):
    layout = Layout(PAGE, areas)
    covered = [sum(shared(place, area, gap) for area in areas) if is_inside(place) else np.inf for place in places]
    given = np.array(places, float)
    assert layout.choose(given, gap) == covered.index(min(covered))
    assert layout.find_free(given, gap) == (covered.index(0) if 0 in covered else None)


@given(st.lists(boxes, max_size=6), boxes, st.integers(0, 5))
@settings(max_examples=100)
def test_a_part_that_goes_down_or_up_keeps_its_gap_to_the_area_that_it_has_passed(areas, box, gap):
    layout = Layout(PAGE, areas)
    for listed, is_down in ((layout.list_below(box, gap), True), (layout.list_above(box, gap), False)):
        assert listed[0].tolist() == list(box)
        ways = (listed[:, 1] - box[1]) * (1 if is_down else -1)
        assert (np.diff(ways) >= 0).all()
        ends = [area[3] + gap for area in areas] if is_down else [area[1] - gap for area in areas]
        assert all(place[1 if is_down else 3] in ends for place in listed[1:])
        assert (listed[:, [0, 2]] == (box[0], box[2])).all()


@pytest.mark.parametrize(
    ("box", "moved"),
    [
        ((90, 70, 110, 90), (80, 60, 100, 80)),
        ((-5, 10, 15, 30), (0, 10, 20, 30)),
        ((10, 10, 150, 20), (0, 10, 140, 20)),
    ],
    ids=["below at the right", "at the left", "too large"],
)
def test_a_box_beside_the_page_moves_onto_it(box, moved):
    assert Layout(PAGE).move_inside(np.array([box], float)).tolist() == [list(moved)]
