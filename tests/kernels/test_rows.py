"""Grouping and gathering rows and fields of view equal slow references."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gamms import kernels


@given(groups=st.integers(1, 6), keys=st.lists(st.integers(0, 5), max_size=30))
def test_grouped_rows_are_in_row_order(groups, keys):
    keys = [key % groups for key in keys]
    offsets, rows = kernels.group_rows(np.array(keys, np.int64), groups)
    found = [rows[a:b].tolist() for a, b in pairwise(offsets)]
    assert found == [[row for row, key in enumerate(keys) if key == group] for group in range(groups)]


def test_no_rows_are_grouped_into_empty_groups():
    offsets, rows = kernels.group_rows(np.zeros(0, np.int64), 3)
    assert (offsets.tolist(), rows.tolist()) == ([0, 0, 0, 0], [])


@given(ids=st.lists(st.integers(0, 9), max_size=12), wanted=st.lists(st.integers(-1, 10), max_size=8))
def test_a_row_is_the_first_that_has_the_id(ids, wanted):
    known, asked = np.array(ids, np.int64), np.array(wanted, np.int64)
    found = kernels.find_rows(known, asked, np.argsort(known, kind="stable"))
    assert found.tolist() == [ids.index(id) if id in ids else -1 for id in wanted]
    ascending = sorted(ids)
    found = kernels.find_rows(np.sort(known), asked)
    assert found.tolist() == [ascending.index(id) if id in ids else -1 for id in wanted]


@given(lengths=st.lists(st.integers(0, 4), min_size=1, max_size=8), data=st.data())
def test_chosen_runs_come_one_after_the_other(lengths, data):
    offsets = np.cumsum([0, *lengths])
    chosen = data.draw(st.lists(st.integers(0, len(lengths) - 1), max_size=8))
    places, ends = kernels.select_runs(offsets, np.array(chosen, np.int64))
    runs = [places[begin:end].tolist() for begin, end in pairwise(ends.tolist())]
    assert runs == [list(range(offsets[run], offsets[run + 1])) for run in chosen]


@given(
    offsets=st.lists(st.tuples(*[st.floats(-1e6, 1e6)] * 2), max_size=20),
    angle=st.floats(-10, 10),
    length=st.sampled_from([1.0, 1e-3, 50.0]),
    fov=st.floats(0, 7),
)
def test_the_cone_is_where_the_wrapped_angle_is_at_most_half_the_opening(offsets, angle, length, fov):
    heading = (length * math.cos(angle), length * math.sin(angle))
    dx, dy = np.array(offsets, float).reshape(-1, 2).T
    seen = kernels.find_in_cone(dx, dy, heading, fov)
    for x, y, is_seen in zip(dx.tolist(), dy.tolist(), seen.tolist(), strict=True):
        off = abs(math.remainder(math.atan2(y, x) - math.atan2(heading[1], heading[0]), 2 * math.pi))
        if abs(off - fov / 2) > 1e-9:  # closer to the rim the other tests look
            assert is_seen == (off < fov / 2 or (x, y) == (0.0, 0.0))


@pytest.mark.parametrize("quarter", range(4))
@pytest.mark.parametrize("eighths", range(9))
def test_the_rim_of_the_cone_is_inside(quarter, eighths):
    heading = quarter * math.pi / 2
    fov = eighths * math.pi / 4
    rims = [heading - fov / 2, heading + fov / 2]
    dx, dy = 7.0 * np.cos(rims), 7.0 * np.sin(rims)
    assert kernels.find_in_cone(dx, dy, (math.cos(heading), math.sin(heading)), fov).all()


def test_just_outside_the_rim_is_outside():
    angles = np.array([0.5001, -0.5001, 3.0, -3.0])
    assert not kernels.find_in_cone(np.cos(angles), np.sin(angles), (1.0, 0.0), 1.0).any()


def test_the_observer_sees_its_own_place():
    assert kernels.find_in_cone(np.array([0.0, -0.0]), np.array([-0.0, 0.0]), (0.0, -1.0), 0.0).all()


def ring_from(starts, ends, row):
    """The line with which a ring begins that a line closes, the latest there is; None: it closes none."""
    begins = [begin for begin in range(row + 1) if starts[begin] == ends[row]]
    chained = begins and all(ends[i] == starts[i + 1] for i in range(begins[-1], row))
    return begins[-1] if chained and row - begins[-1] >= 2 else None


@given(steps=st.lists(st.tuples(st.integers(0, 5), st.integers(0, 3), st.integers(0, 3)), min_size=6, max_size=14))
def test_closed_rings_are_lines_one_after_the_other_that_end_where_they_began(steps):
    places, starts, ends = [(0.0, 0.0), (0.0, 5.0), (5.0, 0.0), (5.0, 5.0)], [], []
    for goes_on, start, end in steps:
        starts.append(ends[-1] if goes_on and ends else places[start])
        ends.append(places[end])
    rings = []
    for row in range(len(starts)):
        begin = ring_from(starts, ends, row)
        if begin is not None and (not rings or begin >= rings[-1][1]):
            rings.append([begin, row + 1])
    assert kernels.find_closed_rings(np.array(starts).reshape(-1, 2), np.array(ends).reshape(-1, 2)).tolist() == rings
