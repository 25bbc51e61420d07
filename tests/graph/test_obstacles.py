"""Obstacle faces: quadrangles by id and by place."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gamms.errors import BadType, BadValue, DuplicateId, UnknownName
from gamms.graph.obstacles import Obstacles, checked_face

WALL = {"tr": (2, 1, 3), "tl": (0, 1, 3), "br": (2, 1, 0), "bl": (0, 1, 0), "type": 4}


def test_a_face_is_given_back_as_floats(any_ctx):
    any_ctx.graph.add_obstacle_face(np.int32(7), **WALL)
    face = any_ctx.graph.get_obstacle_face(np.int64(7))
    assert face == (7, (2.0, 1.0, 3.0), (0.0, 1.0, 3.0), (2.0, 1.0, 0.0), (0.0, 1.0, 0.0), 4)
    assert [type(number) for corner in face[1:5] for number in corner] == [float] * 12


def test_faces_come_in_the_order_they_were_added(any_ctx):
    for id in (5, -3, 9):
        any_ctx.graph.add_obstacle_face(id, **WALL)
    any_ctx.graph.remove_obstacle_face(5)
    any_ctx.graph.add_obstacle_face(5, **WALL)
    assert list(any_ctx.graph.get_obstacle_faces()) == [-3, 9, 5]
    assert list(any_ctx.graph.get_obstacle_faces(5.0, 0.0, 0.0)) == [-3, 9, 5]


def test_a_face_is_near_where_its_box_meets_the_square(any_ctx):
    any_ctx.graph.add_obstacle_face(1, (2, 2, 0), (0, 2, 0), (2, 0, 9), (0, 0, 9), 0)
    near = any_ctx.graph.get_obstacle_faces
    assert list(near(1.0, 3.0, 3.0)) == [1]  # corner to corner
    assert list(near(0.99, 3.0, 3.0)) == []
    assert list(near(d=0.0, x=1.0, y=1.0)) == [1]
    assert list(near(0.0, 2.0, 0.0)) == [1]
    assert list(near(math.inf)) == [1]
    any_ctx.graph.add_obstacle_face(2, *[(3, 3, 0)] * 4, 0)
    assert list(near(1.0, 3.0, 3.0)) == [1, 2]
    any_ctx.graph.remove_obstacle_face(1)
    assert list(near(1.0, 1.0, 1.0)) == []


corners = st.tuples(*[st.integers(-9, 9)] * 3)


@given(
    faces=st.lists(st.tuples(corners, corners, corners, corners), max_size=6),
    d=st.integers(-1, 12),
    x=st.integers(-15, 15),
    y=st.integers(-15, 15),
)
@settings(max_examples=100, deadline=None, derandomize=True)
def test_nearness_equals_brute_force(faces, d, x, y):
    obstacles = Obstacles()
    for id, face in enumerate(faces):
        obstacles.add(checked_face(id, *face, 0))

    def meets(face):
        xs, ys = [corner[0] for corner in face], [corner[1] for corner in face]
        return min(xs) <= x + d and max(xs) >= x - d and min(ys) <= y + d and max(ys) >= y - d

    assert list(obstacles.near(d, x, y)) == [id for id, face in enumerate(faces) if d < 0 or meets(face)]


@pytest.mark.parametrize(
    ("change", "error"),
    [
        ({"tr": (1, 2)}, BadValue),
        ({"tl": (1, 2, 3, 4)}, BadValue),
        ({"br": (1, 2, math.nan)}, BadValue),
        ({"bl": (1, math.inf, 2)}, BadValue),
        ({"bl": (1, "2", 3)}, BadType),
        ({"tr": 5}, BadType),
        ({"tr": None}, BadType),
        ({"type": "wall"}, BadType),
        ({"face_id": "wall"}, BadType),
        ({"face_id": True}, BadType),
        ({"face_id": 1}, DuplicateId),
    ],
)
def test_a_bad_face_changes_nothing(any_ctx, everything, change, error):
    any_ctx.graph.add_obstacle_face(1, **WALL)
    before = everything(any_ctx)
    with pytest.raises(error):
        any_ctx.graph.add_obstacle_face(**({"face_id": 2} | WALL | change))
    assert everything(any_ctx) == before


def test_a_missing_face_is_not_found(any_ctx):
    for verb in (any_ctx.graph.get_obstacle_face, any_ctx.graph.remove_obstacle_face):
        with pytest.raises(UnknownName, match="8"):
            verb(8)


def test_faces_may_be_removed_while_they_are_listed(any_ctx):
    for id in range(4):
        any_ctx.graph.add_obstacle_face(id, **WALL)
    for id in any_ctx.graph.get_obstacle_faces():
        any_ctx.graph.remove_obstacle_face(id)
    assert list(any_ctx.graph.get_obstacle_faces()) == []


def test_a_place_that_is_no_number_is_refused(ctx):
    with pytest.raises(ValueError, match="must be numbers"):
        ctx.graph.get_obstacle_faces(1.0, float("nan"), 0.0)
