"""Matrix games of strategies, beside a linear program of SciPy."""

import numpy as np
import pytest
from solved_games import matrix_value

from gamms.errors import BadValue
from gamms.solve import matrix_game


@pytest.mark.parametrize("shape", [(1, 1), (1, 4), (5, 3), (20, 20)])
@pytest.mark.parametrize("entries", ["real", "few", "antisymmetric"])
def test_no_action_gains_against_an_equilibrium_whose_value_is_that_of_scipy(shape, entries):
    rng = np.random.default_rng(7)
    for _ in range(5):
        payoffs = rng.normal(size=shape) if entries == "real" else rng.integers(-1, 2, shape).astype(float)
        if entries == "antisymmetric":
            payoffs = payoffs[: min(shape), : min(shape)]
            payoffs = payoffs - payoffs.T
        value, rows, columns = matrix_game(payoffs)
        assert value == pytest.approx(matrix_value(payoffs), abs=1e-9)
        assert rows.sum() == pytest.approx(1.0)
        assert columns.sum() == pytest.approx(1.0)
        assert (rows @ payoffs).min() == pytest.approx(value, abs=1e-9)
        assert (payoffs @ columns).max() == pytest.approx(value, abs=1e-9)


@pytest.mark.parametrize("payoffs", [[], [1, 2], [["a"]], [[1.0, float("nan")]], [[float("inf")]]])
def test_a_matrix_that_is_none_is_refused(payoffs):
    with pytest.raises(BadValue, match="payoffs"):
        matrix_game(payoffs)
