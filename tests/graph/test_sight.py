"""Sight lines between places on a map with walls: `ctx.graph.visible`, and faces by place."""

import math
from itertools import islice

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gamms import kernels
from gamms.errors import BadType, BadValue
from gamms.graph.obstacles import Obstacles, check_face, check_faces
from gamms.typing.obstacles import IObstacles


def walls(count, extent, seed, length=8.0):
    """Vertical walls (faces, 4, 3) strewn over a square."""
    rng = np.random.default_rng(seed)
    middle, turn = rng.uniform(0, extent, (count, 2)), rng.uniform(0, 2 * np.pi, count)
    half = np.column_stack((np.cos(turn), np.sin(turn))) * length / 2.0
    faces = np.zeros((count, 4, 3))
    faces[:, ::2, :2], faces[:, 1::2, :2] = (middle + half)[:, None], (middle - half)[:, None]
    faces[:, :2, 2] = 6.0
    return faces


def test_an_observer_on_a_wall_sees_only_along_it(ctx):
    ctx.graph.add_obstacle_face(1, (1, -9, 3), (1, 9, 3), (1, -9, 0), (1, 9, 0), 0)
    targets = [(x, y, 1.6) for x in (0, 1, 2) for y in (-1, 0, 1)]
    seen = ctx.graph.visible((1, 0, 1.6), targets)
    assert [target[:2] for target, is_seen in zip(targets, seen, strict=True) if is_seen] == [(1, -1), (1, 0), (1, 1)]


def test_there_may_be_nothing_to_look_at(any_ctx):
    for _ in range(2):
        for nothing in ([], np.zeros((0, 3))):
            assert any_ctx.graph.visible((0, 0, 0), nothing).shape == (0,)
        any_ctx.graph.add_obstacles(walls(300, 100.0, 1))


@pytest.mark.parametrize(
    ("origin", "targets", "error", "words"),
    [
        ((0, 0), [(1, 1, 1)], BadValue, r"origin must be one place, \(x, y, z\)"),
        ([(0, 0, 0)], [(1, 1, 1)], BadValue, r"shape \(1, 3\)"),
        ((0, 0, math.nan), [(1, 1, 1)], BadValue, "origin must be finite; there is nan"),
        ((0, 0, 0), [(1, 1, 1), (1, math.inf, 1)], BadValue, "targets must be finite; there is inf"),
        ((0, 0, 0), (1, 1, 1), BadValue, r"targets must have shape \(targets, 3\).*not \(3,\)"),
        ((0, 0, 0), [(1, 1)], BadValue, r"not \(1, 2\)"),
        ((0, 0, 0), [(1, 1), (1,)], BadValue, "targets must be an array of places"),
        ("here", [(1, 1, 1)], BadType, "origin must be numbers"),
        ((0, 0, 0), None, BadType, "targets must be numbers"),
        ((True, False, True), [(1, 1, 1)], BadType, "bool"),
    ],
)
def test_ends_of_sight_lines_are_checked(any_ctx, origin, targets, error, words):
    for verb in (any_ctx.graph.visible, lambda *ends: IObstacles.visible(any_ctx.graph, *ends)):
        with pytest.raises(error, match=words):
            verb(origin, targets)


def test_the_revision_changes_with_every_change(any_ctx, tmp_path):
    graph, seen = any_ctx.graph, [any_ctx.graph.obstacle_revision]

    def is_new():
        seen.append(graph.obstacle_revision)
        return seen[-1] not in seen[:-1]

    graph.add_obstacles(walls(3, 9.0, 0))
    assert is_new()
    graph.add_obstacle_face(7, *[(0, 0, 0)] * 4, 0)
    assert is_new()
    graph.save(tmp_path / "map.gamms")
    assert not is_new()
    graph.remove_obstacle_face(7)
    assert is_new()
    graph.load(tmp_path / "map.gamms")
    assert is_new()
    with pytest.raises(KeyError):
        graph.add_obstacle_face(7, *[(0, 0, 0)] * 4, 0)
    assert not is_new()
    assert IObstacles.obstacle_revision.fget(graph) is None


@pytest.mark.parametrize("seed", range(4))
def test_the_engine_answers_as_the_slow_default_of_the_contract(ctx, seed):
    rng = np.random.default_rng(seed)
    shift = np.array([385_000.0, 6.67e6, 0.0]) if seed % 2 else np.zeros(3)
    faces = walls(1500, 600.0, seed) + shift
    faces[:9, :, :2] = rng.uniform(0, 600, (9, 4, 2)) + shift[:2]  # a few large ones
    ids = ctx.graph.add_obstacles(faces)
    for step in range(6):
        targets = rng.uniform(0, 600, (200, 3)) * (1, 1, 0.01) + shift
        origin = targets[0]
        near = targets[np.hypot(*(targets - origin)[:, :2].T) < (600.0, 80.0)[step % 2]]
        assert np.array_equal(ctx.graph.visible(origin, near), IObstacles.visible(ctx.graph, origin, near))
        for id in ids[step * 250 : step * 250 + 200]:
            ctx.graph.remove_obstacle_face(id)
        ctx.graph.add_obstacles(walls(120, 600.0, 99 + step) + shift)


# -- faces by place ---------------------------------------------------------------------------------------------

spots = st.tuples(st.integers(-300, 300), st.integers(-300, 300))
edits = st.lists(
    st.one_of(
        st.tuples(st.just("add"), st.integers(1, 400), st.integers(0, 9), st.sampled_from([0.0, 8.0, 300.0, 1e200])),
        st.tuples(st.just("one"), spots, spots, st.just(0)),
        st.tuples(st.just("remove"), st.integers(1, 5), st.integers(0, 4), st.just(0)),
    ),
    min_size=1,
    max_size=8,
)


@given(edits=edits, place=spots, d=st.sampled_from([0, 1, 40.5, 300, 1e6]), target=spots)
def test_after_any_edits_the_cells_answer_as_a_scan_does(edits, place, d, target):
    obstacles, model = Obstacles(), {}
    for kind, a, b, length in edits:
        if kind == "add":
            new = check_faces(np.round(walls(a, 400.0, b, length)), None, 0, obstacles)
            obstacles.add_many(new)
            model.update(zip(new.ids.tolist(), new.corners, strict=True))
        elif kind == "one":
            id = int(obstacles.find_free_ids(1)[0])
            face = check_face(id, (*a, 4), (*b, 4), (*a, 0), (*b, 0), 0)
            obstacles.add(face)
            model[id] = np.array(face[1:5])
        else:
            for id in [id for id in model if id % a == b]:
                obstacles.remove(id)
                del model[id]
        corners = np.array(list(model.values())).reshape(-1, 4, 3)
        low, high = corners.min(axis=1)[:, :2], corners.max(axis=1)[:, :2]
        meets = ((low <= np.add(place, d)) & (high >= np.subtract(place, d))).all(axis=1)
        expected = [id for id, hit in zip(model, meets.tolist(), strict=True) if hit]
        assert list(obstacles.find_near(d, *place)) == expected
        origin, targets = np.array([*place, 1.6]), np.array([[*target, 1.6], [*place, 9.0], [0.0, 0.0, 3.0]])
        assert np.array_equal(obstacles.find_visible(origin, targets), kernels.find_visible(corners, origin, targets))


def test_a_few_huge_faces_do_not_make_every_search_a_wide_one():
    obstacles = Obstacles()
    obstacles.add_many(check_faces(walls(5000, 1000.0, 0), None, 0, obstacles))
    obstacles.add_many(check_faces(walls(40, 1000.0, 1, length=1e6), None, 0, obstacles))
    assert list(obstacles.find_near(5.0, 500.0, 500.0))
    assert len(obstacles._find_between((495.0, 495.0), (505.0, 505.0))) < 300
    assert all(
        face[0] in obstacles.find_near(0.0, *corner[:2]) for face in islice(obstacles, 500) for corner in face[1:5]
    )
