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
        rows = kernels.candidate_rows(cells, x, y, d)
        if rows is not None:
            assert len(set(rows.tolist())) == len(rows)
            assert set(np.flatnonzero(distances <= d).tolist()) <= set(rows.tolist())


def test_no_points_have_no_candidates():
    cells = kernels.build_cells(np.zeros((0, 2)))
    assert kernels.candidate_rows(cells, 0.0, 0.0, 5.0).tolist() == []


def test_a_small_disc_is_not_offered_the_whole_city():
    side = np.arange(100.0)
    xy = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
    cells = kernels.build_cells(xy)
    assert len(kernels.candidate_rows(cells, 50.0, 50.0, 2.0)) < 100


def test_a_few_outliers_do_not_spoil_the_cells():
    rng = np.random.default_rng(0)
    xy = rng.uniform(0, 100, (10_000, 2))
    xy[:20] = 1e7
    cells = kernels.build_cells(xy)
    assert len(kernels.candidate_rows(cells, 50.0, 50.0, 2.0)) < 200


def test_a_disc_over_everything_is_left_to_a_scan():
    cells = kernels.build_cells(np.random.default_rng(0).uniform(0, 1, (1000, 2)))
    assert kernels.candidate_rows(cells, 0.0, 0.0, 1e6) is None
    assert kernels.candidate_rows(cells, 0.0, 0.0, float("inf")) is None
