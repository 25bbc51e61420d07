"""Mixtures of strategies, and what they are worth at worst: matrix games."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from gamms import kernels
from gamms.errors import BadValue
from gamms.ir.graph import FloatArray


class MatrixGame(NamedTuple):
    """An equilibrium of a zero-sum matrix game; made by `matrix_game`.

    Attributes:
        value: what the player who chooses the row gets, however the other one plays.
        rows: how often each row is played, (rows,); the shares add up to 1.
        columns: how often each column is played, (columns,).
    """

    value: float
    rows: FloatArray
    columns: FloatArray


def matrix_game(payoffs: ArrayLike) -> MatrixGame:
    """Return the value of a zero-sum matrix game and how often each player plays each action in an equilibrium.

        value, rows, columns = matrix_game([[0, -1, 1], [1, 0, -1], [-1, 1, 0]])

    Args:
        payoffs: (rows, columns), what the player who chooses the row gets and the other one pays.

    Raises:
        BadValue: it is no matrix of finite numbers.
    """
    matrix = np.asarray(payoffs)
    if matrix.ndim != 2 or not matrix.size or matrix.dtype.kind not in "biuf":
        raise BadValue(
            "payoffs must be a matrix of numbers, of at least one row and one column, not an array of "
            f"{matrix.dtype} of the shape {matrix.shape}."
        )
    if not np.isfinite(matrix).all():
        row, column = np.argwhere(~np.isfinite(matrix))[0].tolist()
        raise BadValue(f"payoffs[{row}][{column}] is {matrix[row, column]}: all have to be finite numbers.")
    values, rows, columns = kernels.solve_matrix_games(matrix[None].astype(np.float64))
    return MatrixGame(float(values[0]), rows[0], columns[0])
