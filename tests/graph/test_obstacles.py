"""Obstacle faces: quadrangles by id and by place."""

import copy
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gamms.errors import BadType, BadValue, DuplicateId, UnknownName
from gamms.graph.obstacles import Obstacles, check_face, check_faces

WALL = {"tr": (2, 1, 3), "tl": (0, 1, 3), "br": (2, 1, 0), "bl": (0, 1, 0), "type": 4}


def test_a_face_is_given_back_as_floats(any_ctx):
    any_ctx.graph.add_obstacle_face(np.int32(7), **WALL)
    face = any_ctx.graph.get_obstacle_face(np.int64(7))
    assert face == (7, (2.0, 1.0, 3.0), (0.0, 1.0, 3.0), (2.0, 1.0, 0.0), (0.0, 1.0, 0.0), 4)
    assert [type(number) for corner in face[1:5] for number in corner] == [float] * 12


corners = st.tuples(*[st.integers(-9, 9)] * 3)


@pytest.mark.parametrize("corner", ["tr", "tl", "br", "bl"])
@pytest.mark.parametrize("numbers", [(1.0, 2.0), (1.0, 2.0, 3.0, 4.0)])
def test_each_corner_has_three_numbers(any_ctx, corner, numbers):
    wall = {key: tuple(map(float, value)) for key, value in WALL.items() if key != "type"}
    with pytest.raises(BadValue, match=f"{corner} of .* must be"):
        any_ctx.graph.add_obstacle_face(2, **wall | {corner: numbers}, type=0)


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


def test_a_copy_of_a_context_has_the_faces_and_keeps_them(ctx):
    ctx.graph.add_obstacle_face(1, **WALL)
    twin = copy.deepcopy(ctx)
    ctx.graph.remove_obstacle_face(1)
    assert list(twin.graph.get_obstacle_faces()) == [1]


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


# -- many at once -----------------------------------------------------------------------------------------------

BOX = np.arange(24.0).reshape(2, 4, 3)
RECORDS = [{"face_id": 7, **WALL}, {"face_id": -2, **WALL}]


def test_records_of_faces_keep_their_ids(any_ctx):
    assert any_ctx.graph.add_obstacles(iter(RECORDS)) == [7, -2]
    assert list(any_ctx.graph.get_obstacle_faces()) == [7, -2]
    assert any_ctx.graph.get_obstacle_face(7).type == 4
    assert any_ctx.graph.add_obstacles([]) == []
    assert any_ctx.graph.add_obstacles(np.zeros((0, 4, 3))) == []
    assert any_ctx.graph.add_obstacles(iter(())) == []


def test_the_array_of_a_caller_is_neither_kept_nor_changed(ctx):
    given = BOX.copy()
    ctx.graph.add_obstacles(given)
    given[:] = 0.0
    assert ctx.graph.get_obstacle_face(1).bl == (21.0, 22.0, 23.0)
    columns = ctx.graph.obstacle_columns()
    with pytest.raises(ValueError, match="read-only"):
        columns.corners[0] = 0.0
    ctx.graph.remove_obstacle_face(0)
    assert columns.ids.tolist() == [0, 1]
    assert np.array_equal(columns.corners, BOX)


def one_nan():
    faces = BOX.copy()
    faces[1, 2, 0] = math.nan
    return faces


@pytest.mark.parametrize(
    ("arguments", "error", "words"),
    [
        ({"faces": one_nan()}, BadValue, "x of corner br of face 1 is nan"),
        ({"faces": BOX + math.inf}, BadValue, "finite"),
        ({"faces": BOX[0]}, BadValue, r"shape \(4, 3\)"),
        ({"faces": BOX.reshape(2, 3, 4)}, BadValue, r"shape \(2, 3, 4\)"),
        ({"faces": [[1, 2], [3]]}, BadValue, "array"),
        ({"faces": BOX.astype(str)}, BadType, "array"),
        ({"faces": BOX > 3}, BadType, "bool"),
        ({"faces": 5}, BadType, "array"),
        ({"faces": None}, BadType, "array"),
        ({"faces": BOX, "ids": [1]}, BadValue, "ids must have shape"),
        ({"faces": BOX, "ids": [1.0, 2.0]}, BadType, "integers"),
        ({"faces": BOX, "ids": [3, 3]}, DuplicateId, "id 3"),
        ({"faces": BOX, "ids": [5, 1]}, DuplicateId, "id 1"),
        ({"faces": BOX, "types": [1]}, BadValue, "types must have shape"),
        ({"faces": BOX, "types": 1.5}, BadType, "types"),
        ({"faces": BOX, "types": "wall"}, BadType, "types"),
        ({"faces": [*RECORDS, {"face_id": 1, **WALL}]}, DuplicateId, "id 1"),
        ({"faces": [*RECORDS, RECORDS[0]]}, DuplicateId, "id 7"),
        ({"faces": [*RECORDS, {**RECORDS[0], "face_id": 8, "tr": (1, 2)}]}, BadValue, "tr of obstacle face 8"),
        ({"faces": [*RECORDS, WALL]}, BadValue, "'face_id'"),
        ({"faces": [*RECORDS, 5]}, BadType, "dict"),
        ({"faces": [{**RECORDS[0], "color": 3}]}, BadValue, "'color'"),
        ({"faces": RECORDS, "ids": [1, 2]}, BadValue, "leave out ids and types"),
        ({"faces": RECORDS, "types": 3}, BadValue, "leave out ids and types"),
    ],
)
def test_of_many_faces_one_bad_one_changes_nothing(any_ctx, everything, arguments, error, words):
    any_ctx.graph.add_obstacle_face(1, **WALL)
    before = everything(any_ctx)
    with pytest.raises(error, match=words):
        any_ctx.graph.add_obstacles(**arguments)
    assert everything(any_ctx) == before


def test_where_there_are_no_ids_left_the_caller_has_to_give_some(ctx):
    ctx.graph.add_obstacle_face(2**63 - 2, **WALL)
    with pytest.raises(BadValue, match="no 2 ids after"):
        ctx.graph.add_obstacles(BOX)
    assert ctx.graph.add_obstacles(BOX[:1]) == [2**63 - 1]


def test_the_slow_columns_of_the_contract_are_the_same(any_ctx):
    from gamms.typing.graph_engine import IGraphEngine

    for _ in range(2):
        slow, fast = IGraphEngine.obstacle_columns(any_ctx.graph), any_ctx.graph.obstacle_columns()
        assert all(np.array_equal(getattr(slow, name), getattr(fast, name)) for name in ("ids", "corners", "types"))
        any_ctx.graph.add_obstacles(BOX, types=[3, 1])


steps = st.lists(
    st.one_of(
        st.tuples(st.just("one"), st.integers(0, 30), st.tuples(corners, corners, corners, corners)),
        st.tuples(st.just("many"), st.lists(st.tuples(corners, corners, corners, corners), max_size=40)),
        st.tuples(st.just("remove"), st.integers(0, 120)),
        st.tuples(st.just("remove many"), st.integers(0, 120)),
    ),
    max_size=15,
)


@given(steps=steps, d=st.integers(-1, 12), x=st.integers(-15, 15), y=st.integers(-15, 15))
@settings(max_examples=16)
def test_after_any_changes_nearness_equals_brute_force(steps, d, x, y):
    obstacles, model = Obstacles(), {}
    for kind, *rest in steps:
        if kind == "one" and rest[0] not in model:
            obstacles.add(check_face(rest[0], *rest[1], 2))
            model[rest[0]] = rest[1]
        elif kind == "many":
            new = check_faces(rest[0], None, 1, obstacles)
            obstacles.add_many(new)
            model.update(zip(new.ids.tolist(), rest[0], strict=True))
        elif kind.startswith("remove"):
            for id in [id for id in model if id == rest[0] or (kind == "remove many" and id > rest[0] // 4)]:
                obstacles.remove(id)
                del model[id]

    def meets(face):
        xs, ys = [corner[0] for corner in face], [corner[1] for corner in face]
        return min(xs) <= x + d and max(xs) >= x - d and min(ys) <= y + d and max(ys) >= y - d

    assert len(obstacles) == len(model)
    assert [(face.id, face[1:5]) for face in obstacles] == list(model.items())
    assert [obstacles.get(id)[1:5] for id in model] == list(model.values())
    assert list(obstacles.find_near(d, x, y)) == [id for id, face in model.items() if d < 0 or meets(face)]


def test_a_hundred_thousand_faces_are_added_asked_for_and_removed_one_by_one(ctx):
    import time

    start = time.process_time()
    places = np.random.default_rng(1).uniform(0.0, 1e4, (100_000, 1, 3))
    ctx.graph.add_obstacles(np.repeat(places, 4, axis=1))
    for id in range(100_000, 100_300):
        ctx.graph.add_obstacle_face(id, **WALL)
        assert list(ctx.graph.get_obstacle_faces(0.5, 1.0, 1.0))[-1] == id
    for id in ctx.graph.get_obstacle_faces():
        ctx.graph.remove_obstacle_face(id)
    assert time.process_time() - start < 10.0  # takes half a second; with boxes made again after each change, minutes
