"""Zero-sum matrix games, many of one size at once: values and optimal mixed strategies, by the simplex method.

A general solver takes a millisecond or more for the linear program of one game; value iteration needs a hundred
thousand. Here the tableaus of all games are one array, and each pivot is one operation on it.
"""

import numpy as np

from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray

_TINY = 1e-12  # smaller numbers count as 0 in a tableau, whose entries are about 1
_LEAST_PIVOT = 1e-10  # smallest pivot; smaller numbers may be rounding errors
_REFRESH = 60  # pivots after which tableaus are recomputed from their bases, to remove rounding errors


def find_saddle_points(payoffs: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return maximin and minimax values of pure strategies, (games,) each.

    If both are equal, they are the value of the game.

    Args:
        payoffs: (games, rows, columns), the payoff from the column player to the row player.
    """
    # NOTE: NumPy reduces many short last axes ten times more slowly than first ones (python benchmarks/solve.py large).
    by_action = np.ascontiguousarray(payoffs.transpose(1, 2, 0))
    return by_action.min(axis=1).max(axis=0), by_action.max(axis=0).min(axis=0)


def solve_matrix_games(payoffs: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the values of zero-sum games, (games,), and optimal strategies, (games, rows) and (games, columns).

    If there is a saddle point, the strategies are the first actions that reach it.

    Args:
        payoffs: (games, rows, columns), the payoff from the column player to the row player.
    """
    low, high = find_saddle_points(payoffs)
    values = low.copy()
    games = np.arange(len(payoffs))
    rows, columns = (np.zeros((*payoffs.shape[:1], n)) for n in payoffs.shape[1:])
    rows[games, payoffs.min(axis=2).argmax(axis=1)] = 1.0
    columns[games, payoffs.max(axis=1).argmin(axis=1)] = 1.0
    mixed = np.flatnonzero(high - low > _TINY * np.maximum(1.0, abs(low)))
    if len(mixed):
        values[mixed], rows[mixed], columns[mixed] = _solve_by_simplex(payoffs[mixed])
    return values, rows, columns


def _solve_by_simplex(payoffs: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Solve games without a saddle point: maximize the sum of y with A y <= 1, for payoffs A between 1 and 2.

    A tableau has as many rows as the row player has actions; the player with fewer is the row player.
    """
    games, rows, columns = payoffs.shape
    if rows > columns:
        values, ys, xs = _solve_by_simplex(-payoffs.transpose(0, 2, 1))
        return -values, xs, ys
    least = payoffs.min(axis=(1, 2), keepdims=True)
    spread = payoffs.max(axis=(1, 2), keepdims=True) - least
    scaled = (payoffs - least) / spread + 1.0
    tableau = _make_first_tableau(scaled)
    basis = np.broadcast_to(np.arange(columns, columns + rows), (games, rows)).copy()
    going = np.arange(games)
    pivots = 0
    while len(going):
        costs = tableau[going, -1, :-2]
        is_open = costs.min(axis=1) < -_TINY
        going = going[is_open]
        costs = costs[is_open]
        if len(going):
            _apply_pivot(tableau, basis, going, costs.argmin(axis=1))
            pivots += 1
            if pivots % _REFRESH == 0:
                tableau[going] = _compute_tableau(_make_first_tableau(scaled[going]), basis[going], pivots)
    total = tableau[:, -1, -1]
    at, row = np.nonzero(basis < columns)
    ys = np.zeros((games, columns))
    xs = np.maximum(tableau[:, -1, columns:-2], 0.0)
    ys[at, basis[at, row]] = np.maximum(tableau[at, row, -1], 0.0)
    xs = xs / xs.sum(axis=1, keepdims=True)
    ys = ys / ys.sum(axis=1, keepdims=True)
    return (1.0 / total - 1.0) * spread[:, 0, 0] + least[:, 0, 0], xs, ys


def _make_first_tableau(scaled: FloatArray) -> FloatArray:
    """Return simplex tableaus, (games, rows + 1, columns + rows + 2): A, the identity, the tie-break column, and 1."""
    games, rows, columns = scaled.shape
    tableau = np.zeros((games, rows + 1, columns + rows + 2))
    tableau[:, :rows, :columns] = scaled
    tableau[:, :rows, columns:-2] = np.eye(rows)
    tableau[:, :rows, -1] = 1.0
    tableau[:, -1, :columns] = -1.0
    return tableau


def _compute_tableau(tableau: FloatArray, basis: IntArray, pivots: int) -> FloatArray:
    """Return the tableaus of these bases, computed from the first tableaus.

    From then on ties are broken as if the right side were slightly larger, by a different amount each time, so that
    pivots do not cycle.
    """
    chosen = np.take_along_axis(tableau, basis[:, None], axis=2)
    rows = basis.shape[1]
    tableau[:, :rows] = np.linalg.solve(chosen[:, :rows], tableau[:, :rows])
    tableau[:, rows:] -= chosen[:, rows:] @ tableau[:, :rows]
    tableau[:, :rows, -2] = 1.0 + np.arange(1, rows + 1) * pivots * 0.6180339887498949 % 1.0
    return tableau


def _apply_pivot(tableau: FloatArray, basis: IntArray, games: IntArray, entering: IntArray) -> None:
    """Pivot: one column of each game enters its basis."""
    now = tableau[games]
    each = np.arange(len(games))
    column = now[each, :, entering]  # (games, rows + 1)
    may_leave: BoolArray = column[:, :-1] > _LEAST_PIVOT
    by = np.where(may_leave, column[:, :-1], 1.0)
    is_least = may_leave
    for side in (-1, -2):
        ratios = np.where(is_least, now[:, :-1, side] / by, np.inf)
        is_least = is_least & (ratios <= ratios.min(axis=1, keepdims=True) + _TINY)
    leaving = np.where(is_least, basis[games], tableau.shape[2]).argmin(axis=1)
    pivot_rows = now[each, leaving] / column[each, leaving][:, None]
    now -= column[:, :, None] * pivot_rows[:, None, :]
    now[each, leaving] = pivot_rows
    tableau[games] = now
    basis[games, leaving] = entering
