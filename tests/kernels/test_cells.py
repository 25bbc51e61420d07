"""The cell grid: what it offers always includes the disc, wherever the points are."""

import numpy as np
import pytest

from gamms import kernels

CLOUDS = {
    "uniform": lambda rng, n: rng.uniform(-9, 9, (n, 2)),
    "far away": lambda rng, n: rng.uniform(0, 1, (n, 2)) + 1e12,
    "outliers": lambda rng, n: np.where(rng.random((n, 2)) < 0.02, 1e18, rng.uniform(0, 1, (n, 2))),
    "line": lambda rng, n: np.column_stack([np.zeros(n), rng.uniform(0, 9, n)]),
    "one place": lambda rng, n: np.ones((n, 2)),
    "tiny": lambda rng, n: rng.uniform(0, 5e-324 * 10, (n, 2)),
    "largest": lambda rng, n: rng.choice([-1.7e308, 0.0, 1.7e308], (n, 2)),
}


@pytest.mark.parametrize("name", CLOUDS)
@pytest.mark.parametrize("count", [1, 2, 300])
def test_candidates_include_the_disc(name, count):
    rng = np.random.default_rng(count)
    xy = CLOUDS[name](rng, count)
    cells = kernels.build_cells(xy)
    assert sorted(cells.rows.tolist()) == list(range(count))
    for _ in range(40):
        x, y = xy[rng.integers(count)].tolist()
        with np.errstate(over="ignore"):
            distances = np.hypot(*(xy - (x, y)).T)
        d = float(rng.choice(distances))
        rows = kernels.find_candidate_rows(cells, x, y, d)
        if rows is not None:
            assert len(set(rows.tolist())) == len(rows)
            assert set(np.flatnonzero(distances <= d).tolist()) <= set(rows.tolist())


@pytest.mark.parametrize("name", CLOUDS)
def test_the_rows_around_a_place_are_those_of_the_cells_up_to_so_many_away(name):
    rng = np.random.default_rng(3)
    xy = CLOUDS[name](rng, 300)
    cells = kernels.build_cells(xy)
    for x, y in [*xy[:20].tolist(), *rng.uniform(-50.0, 150.0, (20, 2)).tolist()]:
        for reach in (0, 1, 3):
            rows = kernels.find_rows_around(cells, x, y, reach)
            with np.errstate(over="ignore"):
                near = np.flatnonzero(np.hypot(*(xy - (x, y)).T) < 0.9 * reach * cells.size)
            assert len(set(rows)) == len(rows)
            assert set(near.tolist()) <= set(rows)


def test_no_points_have_no_candidates():
    cells = kernels.build_cells(np.zeros((0, 2)))
    assert kernels.find_rows_around(cells, 0.0, 0.0, 3) == []
    assert kernels.find_candidate_rows(cells, 0.0, 0.0, 5.0).tolist() == []


def test_a_small_disc_is_not_offered_the_whole_city():
    side = np.arange(100.0)
    xy = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
    cells = kernels.build_cells(xy)
    assert len(kernels.find_candidate_rows(cells, 50.0, 50.0, 2.0)) < 100


def test_a_few_outliers_do_not_spoil_the_cells():
    rng = np.random.default_rng(0)
    xy = rng.uniform(0, 100, (10_000, 2))
    xy[:20] = 1e7
    cells = kernels.build_cells(xy)
    assert len(kernels.find_candidate_rows(cells, 50.0, 50.0, 2.0)) < 200


@pytest.mark.parametrize("stretch", [(1e4, 1.0), (1.0, 1e4)])
def test_a_small_disc_in_a_long_town_has_no_far_candidates(stretch):
    xy = np.random.default_rng(0).uniform(0, 1, (10_000, 2)) * stretch
    x, y = 0.5 * np.array(stretch)
    assert len(kernels.find_candidate_rows(kernels.build_cells(xy), x, y, 1.0)) < 30


def test_a_disc_over_everything_is_left_to_a_scan():
    cells = kernels.build_cells(np.random.default_rng(0).uniform(0, 1, (1000, 2)))
    assert kernels.find_candidate_rows(cells, 0.0, 0.0, 1e6) is None
    assert kernels.find_candidate_rows(cells, 0.0, 0.0, float("inf")) is None
    assert kernels.find_rows_between(cells, (0.5, -1e6), (0.5, 1e6)) is None
