"""Value iteration: the values of all states by the number of turns left, and optimal play there (Shapley 1953)."""

from copy import copy
from functools import cached_property
from typing import Any, Literal, NamedTuple, Self

import numpy as np

from gamms import kernels
from gamms.errors import BadValue
from gamms.ir.graph import FloatArray, IntArray
from gamms.solve.table import StateGroup, Table

Bound = Literal["exact", "lower", "upper", "none"]
"""The relation of a value to the value of the game: equal, lower or upper bound, or uncertain."""
_MOST_SWEEPS = 100_000
_FEW_SWEEPS = 100  # sweeps after which values that still change as much as before are assumed to grow without bound
_MANY_SWEEPS = 2_000
_MOST_VALUES = 50_000_000  # stored values, for play by the number of turns left


class Rewards(NamedTuple):
    """The rewards of the first team, which the second pays, by row of a table.

    Attributes:
        usual: (rows,) in turns before the last one.
        last: (rows,) in the last turn; None: as usual.
        discount: the weight of a reward one turn later.
    """

    usual: FloatArray
    last: FloatArray | None
    discount: float


class StrategyShares(NamedTuple):
    """The mixed strategies of two teams in n states, as arrays of probabilities.

    Attributes:
        first: (n, actions of the first team, actions of the second), the probabilities of the first team's actions; if
            it moves second, given the second team's action.
        second: the same shape, the probabilities of the second team's actions; if it moves second, given the first
            team's action.
    """

    first: FloatArray
    second: FloatArray


class ValueIteration:
    """The values of all states of a table, by the number of turns left.

    Args:
        table: the game.
        rewards: the rewards of the first team.
        tolerance: the change of values at which a game without a last turn counts as solved.

    Attributes:
        values: k -> (states,) the first team's value if at most k turns are left.
        error: the largest error of the start's value; inf: unknown.
        side: the kind of bound that the values are for the game with full information: "exact", "lower", "upper",
            or "none" (uncertain).
    """

    def __init__(self, table: Table, rewards: Rewards, tolerance: float) -> None:
        self.table = table
        self.rewards = rewards
        self.values = [np.zeros(len(table))]
        self.error = 0.0
        self._gap = 0.0
        self.tolerance = tolerance
        self.side: Bound = "exact"
        if table.by_turn:
            self._sweep_levels()
        elif table.last_turn is not None:
            self._sweep_turns(table.last_turn)
        else:
            self._sweep_on(tolerance)
        self.error += self._gap

    def count_turns_left(self, turn: int, team: int) -> int:
        """Return the number of turns left after `turn` turns, or of all turns if policies do not depend on it."""
        most = len(self.values) - 1
        last = self.table.last_turn
        if self.table.by_turn:
            return 0
        if last is not None:
            return max(1, min(most, last - turn))
        return most - turn if self.is_counting_down(team) and turn < most else most

    def is_counting_down(self, team: int) -> bool:
        """Return whether a team plays as if the game ended after the computed turns, so that it makes progress.

        This applies to games without a last turn, and not to a team that only defends.
        """
        if self.table.last_turn is not None or self.rewards.discount < 1.0 or self.side == "exact":
            return False
        gains = self.rewards.usual * (1 if team == 0 else -1)
        return bool((gains > 0).any())

    def compute_payoffs(self, shape: StateGroup, left: int) -> FloatArray:
        """Return the first team's value of each pair of joint actions, (states of the group, actions, actions).

        Args:
            shape: the group of states.
            left: the number of turns left, see `left`.
        """
        rows = shape.rows
        rewards = self.rewards
        later = self.values[left if self.table.by_turn else left - 1]
        is_last = left == 1 and self.table.last_turn is not None and rewards.last is not None
        now = rewards.last if is_last and rewards.last is not None else rewards.usual
        return now[rows] + rewards.discount * later[self.table.usual.after[rows]]

    def play(self, shape: StateGroup, left: int) -> StrategyShares:
        """Return optimal strategies of both teams in a group of states, with this many turns left.

        A team that can only gain plays as if only as many turns were left as it needs, so that it does not delay its
        gains.
        """
        found = self._play(shape, left)
        for team in (0, 1) if left > 1 else ():
            if self._can_only_gain[team]:
                fewest = self._find_fewest_turns(shape.states, left)
                for fewer in np.unique(fewest[fewest < left]).tolist():
                    at = np.flatnonzero(fewest == fewer)
                    found[team][at] = self._play(StateGroup(shape.states[at], shape.rows[at]), fewer)[team]
        return found

    def move_to(self, table: Table) -> Self:
        """Return these values for a table of the same game that differs only in its ends."""
        found = copy(self)
        found.table = table
        found.values = []
        goes_on = [np.flatnonzero(np.diff(one.offsets)) for one in (self.table, table)]
        for values in self.values:
            moved = np.zeros(len(table))
            moved[goes_on[1]] = values[goes_on[0]]
            found.values.append(moved)
        return found

    def _find_fewest_turns(self, states: IntArray, left: int) -> IntArray:
        """Return the smallest number of turns left that gives states the same values, (states,)."""
        fewest = np.full(len(states), left)
        wanted = self.values[left][states]
        for fewer in range(left - 1, 0, -1):
            is_same = (self.values[fewer][states] == wanted) & (fewest == fewer + 1)
            if not is_same.any():
                break
            fewest[is_same] = fewer
        return fewest

    @cached_property
    def _can_only_gain(self) -> tuple[bool, bool]:
        """Whether each team never gets a negative reward, and the last turn has the usual rewards."""
        usual, last, discount = self.rewards
        if discount < 1.0 or self.table.by_turn or (last is not None and not np.array_equal(last, usual)):
            return False, False
        return bool((usual >= 0).all()), bool((usual <= 0).all())

    def _play(self, shape: StateGroup, left: int) -> StrategyShares:
        payoffs = self.compute_payoffs(shape, left)
        if self.table.order == 0:
            _, rows, columns = kernels.solve_matrix_games(payoffs)
            shape_of = np.ones(payoffs.shape)
            return StrategyShares(rows[:, :, None] * shape_of, columns[:, None, :] * shape_of)
        first = np.zeros(payoffs.shape)
        second = np.zeros(payoffs.shape)
        games = np.arange(len(payoffs))
        if self.table.order < 0:
            first[games, payoffs.min(axis=2).argmax(axis=1)] = 1.0
            np.put_along_axis(second, payoffs.argmin(axis=2)[:, :, None], 1.0, axis=2)
        else:
            second[games, :, payoffs.max(axis=1).argmin(axis=1)] = 1.0
            np.put_along_axis(first, payoffs.argmax(axis=1)[:, None, :], 1.0, axis=1)
        return StrategyShares(first, second)

    def _sweep(self, left: int) -> FloatArray:
        """Return the values with this many turns left."""
        values = np.zeros(len(self.table))
        for shape in self.table.shapes:
            values[shape.states] = self._compute_best(self.compute_payoffs(shape, left), shape, left)
        return values

    def _compute_best(self, payoffs: FloatArray, shape: StateGroup, left: int) -> FloatArray:  # noqa: ARG002 - for `BestResponseValues`
        """Return the values of the states of a group."""
        low, high = kernels.find_saddle_points(payoffs)
        if self.table.order:
            return low if self.table.order < 0 else high
        mixed = np.flatnonzero(high > low)
        if len(mixed):
            games = payoffs[mixed]
            values, rows, columns = kernels.solve_matrix_games(games)
            sure = (games * rows[:, :, None]).sum(axis=1).min(axis=1)
            most = (games * columns[:, None, :]).sum(axis=2).max(axis=1)
            self._gap += float((most - sure).max())
            low[mixed] = values
        return low

    def _sweep_levels(self) -> None:
        """Compute values backward from the last turn, if the turn is part of the state."""
        table = self.table
        values = np.zeros(len(self.table))
        self.values = [values]
        for level in range(int(table.level.max()), -1, -1):
            for shape in table.shapes:
                at = np.flatnonzero(table.level[shape.states] == level)
                if len(at):
                    part = StateGroup(shape.states[at], shape.rows[at])
                    values[part.states] = self._compute_best(self.compute_payoffs(part, 0), part, 0)

    def _sweep_turns(self, last: int) -> None:
        """Compute values backward from the last turn, until they no longer change."""
        for left in range(1, last + 1):
            self.values.append(self._sweep(left))
            if self._is_settled(left):
                break
            self._refuse_many()

    def _is_settled(self, left: int) -> bool:
        """Return whether more turns would change nothing."""
        return left > 1 and np.array_equal(self.values[-1], self.values[-2])

    def _sweep_on(self, tolerance: float) -> None:
        """Repeat sweeps for a game without a last turn, until the values converge."""
        discount = self.rewards.discount
        change = np.inf
        changes = list[float]()
        patience = _FEW_SWEEPS + min(len(self.table), _MANY_SWEEPS)
        while change > 0.0:
            self.values.append(self._sweep(len(self.values)))
            change = float(abs(self.values[-1] - self.values[-2]).max())
            changes.append(change)
            grows = len(changes) > patience and change > 0.99 * changes[-_FEW_SWEEPS]
            if len(changes) > _MOST_SWEEPS or (grows and discount == 1.0):
                raise BadValue(self._explain_missing_value(change))
            self.error = change * discount / (1.0 - discount) if discount < 1.0 else np.inf
            if (discount < 1.0 and self.error <= tolerance) or change <= tolerance * 1e-3:
                break
            self._refuse_many()
        self.error = 0.0 if change == 0.0 else self.error
        if self.error > tolerance:
            usual = self.rewards.usual
            if (usual >= 0).all():
                self.side = "lower"
            elif (usual <= 0).all():
                self.side = "upper"
            else:
                self.side = "none"

    def _refuse_many(self) -> None:
        if len(self.values) * len(self.table) > _MOST_VALUES:
            raise BadValue(self._explain_missing_value(float(abs(self.values[-1] - self.values[-2]).max())))

    def _explain_missing_value(self, change: float) -> str:
        return (
            f"The values of this game still change by {change:.3g} after {len(self.values) - 1} sweeps: what teams get "
            "may grow without bound. Give the game a time limit, or turns= or discount= (such as 0.95)."
        )


class BestResponseValues(ValueIteration):
    """The values of all states for a team that responds optimally to a known strategy of the other team.

    Args:
        table: the game.
        rewards: the rewards of the first team.
        tolerance: see `ValueIteration`.
        other: the values that define the other team's strategy.
        team: the team that responds, 0 or 1.
    """

    def __init__(self, table: Table, rewards: Rewards, tolerance: float, other: ValueIteration, team: int) -> None:
        self._other = other
        self._team = team
        super().__init__(table, rewards, tolerance)

    def move_to(self, table: Table) -> Self:
        """Return these values and the other team's strategy; see `ValueIteration.move_to`."""
        found = super().move_to(table)
        found._other = self._other.move_to(table)
        return found

    def _is_settled(self, left: int) -> bool:
        return super()._is_settled(left) and left > len(self._other.values)

    def _compute_best(self, payoffs: FloatArray, shape: StateGroup, left: int) -> FloatArray:
        expected: FloatArray = self._compute_expected(payoffs, shape, left)
        if expected.ndim == 2:
            expected = expected.max(axis=1) if self._team == 0 else expected.min(axis=1)
        return expected

    def _compute_expected(self, payoffs: FloatArray, shape: StateGroup, left: int) -> Any:
        """Return the first team's expected value for each action of the responding team; maximal if it moves second."""
        first, second = self._other.play(shape, min(left, len(self._other.values) - 1))
        if self._team == 0:
            if self.table.order > 0:
                return (second[:, 0] * payoffs.max(axis=1)).sum(axis=1)
            return (second * payoffs).sum(axis=2)
        if self.table.order < 0:
            return (first[:, :, 0] * payoffs.min(axis=2)).sum(axis=1)
        return (first * payoffs).sum(axis=1)

    def play(self, shape: StateGroup, left: int) -> StrategyShares:
        """Return the strategies in a group of states: a best response, and the other team's strategy."""
        payoffs = self.compute_payoffs(shape, left)
        played = self._other.play(shape, min(left, len(self._other.values) - 1))
        own = np.zeros(payoffs.shape)
        games = np.arange(len(payoffs))
        axis = 1 + self._team
        is_second = self.table.order == (1 if self._team == 0 else -1)
        if is_second:
            best = payoffs.argmax(axis=1) if self._team == 0 else payoffs.argmin(axis=2)
            np.put_along_axis(own, np.expand_dims(best, axis), 1.0, axis=axis)
        else:
            expected = self._compute_expected(payoffs, shape, left)
            best = expected.argmax(axis=1) if self._team == 0 else expected.argmin(axis=1)
            own[(games, best) if self._team == 0 else (games, slice(None), best)] = 1.0
        return StrategyShares(own, played.second) if self._team == 0 else StrategyShares(played.first, own)
