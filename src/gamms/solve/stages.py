"""Value iteration: the values of all states with so many turns left, and how teams play there (Shapley 1953)."""

from functools import cached_property
from typing import Any, Literal, NamedTuple

import numpy as np

from gamms import kernels
from gamms.errors import BadValue
from gamms.ir.graph import FloatArray, IntArray
from gamms.solve.table import Shape, Table

Bound = Literal["exact", "lower", "upper", "none"]
"""What a value is to that of the game: the same, at most it, at least it, or near it on a side that is not known."""
_MOST_SWEEPS = 100_000
_FEW_SWEEPS, _MANY_SWEEPS = 100, 2_000  # after which values that change as much as before are taken to grow for ever
_MOST_VALUES = 50_000_000  # that are kept, for play with so many turns left


class Rewards(NamedTuple):
    """What the first team gets, and the second pays, by row of a table.

    Attributes:
        usual: in a turn that is not the last one.
        last: in the last turn; None: the same.
        discount: what a reward counts one turn later.
    """

    usual: FloatArray
    last: FloatArray | None
    discount: float


class Play(NamedTuple):
    """How two teams play in some states, as shares of their joint actions.

    Attributes:
        first: (n, actions of the first team, actions of the second) the share of an action of the first team; where it
            moves after the second team, given what that one does.
        second: the same of the second team, given what the first one does where it moves after it.
    """

    first: FloatArray
    second: FloatArray


class Stages:
    """The values of all states of a table, by how many turns are left.

    Args:
        table: the game.
        rewards: what the first team gets.
        tolerance: at which change of values a game without a last turn counts as solved.

    Attributes:
        values: k -> (states,) what the first team gets from there on if at most k turns are left.
        error: how far the values of the start may be from those of the game; inf: it is not known.
        side: what the values are to those of the game with full information: "exact", "lower" (at most), "upper" or
            "none": near, on a side that is not known.
    """

    def __init__(self, table: Table, rewards: Rewards, tolerance: float) -> None:
        self.table, self.rewards = table, rewards
        self.values = [np.zeros(len(table))]
        self.error, self._gap, self.tolerance = 0.0, 0.0, tolerance
        self.side: Bound = "exact"
        if table.by_turn:
            self._sweep_levels()
        elif table.last_turn is not None:
            self._sweep_turns(table.last_turn)
        else:
            self._sweep_on(tolerance)
        self.error += self._gap

    def left(self, turn: int, team: int) -> int:
        """Return with how many turns left a team plays after so many turns; where it does not count, all."""
        most, last = len(self.values) - 1, self.table.last_turn
        if self.table.by_turn:
            return 0
        if last is not None:
            return max(1, min(most, last - turn))
        return most - turn if self.counts_down(team) and turn < most else most

    def counts_down(self, team: int) -> bool:
        """Return whether a team plays as if the game had as many turns as were computed, so that it gets somewhere.

        One that only keeps what it has plays in every turn as with all turns left.
        """
        if self.table.last_turn is not None or self.rewards.discount < 1.0 or self.side == "exact":
            return False
        gains = self.rewards.usual * (1 if team == 0 else -1)
        return bool((gains > 0).any())

    def payoffs(self, shape: Shape, left: int) -> FloatArray:
        """Return what the first team gets by joint actions from then on, (states of the shape, actions, actions).

        Args:
            shape: of the states.
            left: how many turns are left, see `left`.
        """
        rows, rewards = shape.rows, self.rewards
        later = self.values[left if self.table.by_turn else left - 1]
        is_last = left == 1 and self.table.last_turn is not None and rewards.last is not None
        now = rewards.last if is_last and rewards.last is not None else rewards.usual
        return now[rows] + rewards.discount * later[self.table.usual.after[rows]]

    def play(self, shape: Shape, left: int) -> Play:
        """Return how both teams play best in the states of a shape, with so many turns left.

        A team that can only gain plays as with the fewest turns in which it gets as much, so that it does not put off
        what it can have.
        """
        found = self._play(shape, left)
        for team in (0, 1) if left > 1 else ():
            if self._can_only_gain[team]:
                fewest = self._fewest(shape.states, left)
                for fewer in np.unique(fewest[fewest < left]).tolist():
                    at = np.flatnonzero(fewest == fewer)
                    found[team][at] = self._play(Shape(shape.states[at], shape.rows[at]), fewer)[team]
        return found

    def _fewest(self, states: IntArray, left: int) -> IntArray:
        """Return with how many turns left the values of states are as good already, (states,)."""
        fewest, wanted = np.full(len(states), left), self.values[left][states]
        for fewer in range(left - 1, 0, -1):
            is_same = (self.values[fewer][states] == wanted) & (fewest == fewer + 1)
            if not is_same.any():
                break
            fewest[is_same] = fewer
        return fewest

    @cached_property
    def _can_only_gain(self) -> tuple[bool, bool]:
        """Whether the teams never get less than nothing in a turn, and as much in the last one as in others."""
        usual, last, discount = self.rewards
        if discount < 1.0 or self.table.by_turn or (last is not None and not np.array_equal(last, usual)):
            return False, False
        return bool((usual >= 0).all()), bool((usual <= 0).all())

    def _play(self, shape: Shape, left: int) -> Play:
        payoffs = self.payoffs(shape, left)
        if self.table.order == 0:
            _, rows, columns = kernels.solve_matrix_games(payoffs)
            shape_of = np.ones(payoffs.shape)
            return Play(rows[:, :, None] * shape_of, columns[:, None, :] * shape_of)
        first, second = np.zeros(payoffs.shape), np.zeros(payoffs.shape)
        games = np.arange(len(payoffs))
        if self.table.order < 0:
            first[games, payoffs.min(axis=2).argmax(axis=1)] = 1.0
            np.put_along_axis(second, payoffs.argmin(axis=2)[:, :, None], 1.0, axis=2)
        else:
            second[games, :, payoffs.max(axis=1).argmin(axis=1)] = 1.0
            np.put_along_axis(first, payoffs.argmax(axis=1)[:, None, :], 1.0, axis=1)
        return Play(first, second)

    def _sweep(self, left: int) -> FloatArray:
        """Return the values with so many turns left."""
        values = np.zeros(len(self.table))
        for shape in self.table.shapes:
            values[shape.states] = self._best(self.payoffs(shape, left), shape, left)
        return values

    def _best(self, payoffs: FloatArray, shape: Shape, left: int) -> FloatArray:  # noqa: ARG002 - for `Responses`
        """Return the values of states of one shape."""
        low, high = kernels.saddle_points(payoffs)
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
        """Go back from the last turn, where the turn is part of the state."""
        table, values = self.table, np.zeros(len(self.table))
        self.values = [values]
        for level in range(int(table.level.max()), -1, -1):
            for shape in table.shapes:
                at = np.flatnonzero(table.level[shape.states] == level)
                if len(at):
                    part = Shape(shape.states[at], shape.rows[at])
                    values[part.states] = self._best(self.payoffs(part, 0), part, 0)

    def _sweep_turns(self, last: int) -> None:
        """Go back from the last turn, until nothing changes any more."""
        for left in range(1, last + 1):
            self.values.append(self._sweep(left))
            if self._is_settled(left):
                break
            self._refuse_many()

    def _is_settled(self, left: int) -> bool:
        """Return whether more turns would change nothing."""
        return left > 1 and np.array_equal(self.values[-1], self.values[-2])

    def _sweep_on(self, tolerance: float) -> None:
        """Repeat for a game without a last turn."""
        discount, change, changes = self.rewards.discount, np.inf, list[float]()
        patience = _FEW_SWEEPS + min(len(self.table), _MANY_SWEEPS)
        while change > 0.0:
            self.values.append(self._sweep(len(self.values)))
            change = float(abs(self.values[-1] - self.values[-2]).max())
            changes.append(change)
            grows = len(changes) > patience and change > 0.99 * changes[-_FEW_SWEEPS]
            if len(changes) > _MOST_SWEEPS or (grows and discount == 1.0):
                raise BadValue(self._no_value(change))
            self.error = change * discount / (1.0 - discount) if discount < 1.0 else np.inf
            if (discount < 1.0 and self.error <= tolerance) or change <= tolerance * 1e-3:
                break
            self._refuse_many()
        self.error = 0.0 if change == 0.0 else self.error
        if self.error > tolerance:
            usual = self.rewards.usual
            self.side = "lower" if (usual >= 0).all() else "upper" if (usual <= 0).all() else "none"

    def _refuse_many(self) -> None:
        if len(self.values) * len(self.table) > _MOST_VALUES:
            raise BadValue(self._no_value(float(abs(self.values[-1] - self.values[-2]).max())))

    def _no_value(self, change: float) -> str:
        return (
            f"The values of this game still change by {change:.3g} after {len(self.values) - 1} sweeps: what teams get "
            "may grow without bound. Give the game a time limit, or turns= or discount= (such as 0.95)."
        )


class Responses(Stages):
    """The values of all states for a team that answers best to how the other one plays, which it knows.

    Args:
        table: the game.
        rewards: what the first team gets.
        tolerance: see `Stages`.
        other: how the other team plays.
        team: that answers, 0 or 1.
    """

    def __init__(self, table: Table, rewards: Rewards, tolerance: float, other: Stages, team: int) -> None:
        self._other, self._team = other, team
        super().__init__(table, rewards, tolerance)

    def _is_settled(self, left: int) -> bool:
        return super()._is_settled(left) and left > len(self._other.values)

    def _best(self, payoffs: FloatArray, shape: Shape, left: int) -> FloatArray:
        expected: FloatArray = self._expected(payoffs, shape, left)
        if expected.ndim == 2:
            expected = expected.max(axis=1) if self._team == 0 else expected.min(axis=1)
        return expected

    def _expected(self, payoffs: FloatArray, shape: Shape, left: int) -> Any:
        """Return what the first team gets by each action of the team that answers, or at best where it moves second."""
        first, second = self._other.play(shape, min(left, len(self._other.values) - 1))
        if self._team == 0:
            if self.table.order > 0:
                return (second[:, 0] * payoffs.max(axis=1)).sum(axis=1)
            return (second * payoffs).sum(axis=2)
        if self.table.order < 0:
            return (first[:, :, 0] * payoffs.min(axis=2)).sum(axis=1)
        return (first * payoffs).sum(axis=1)

    def play(self, shape: Shape, left: int) -> Play:
        """Return how both teams play in the states of a shape: one answers best, the other as it does."""
        payoffs = self.payoffs(shape, left)
        played = self._other.play(shape, min(left, len(self._other.values) - 1))
        own, games = np.zeros(payoffs.shape), np.arange(len(payoffs))
        axis = 1 + self._team
        is_second = self.table.order == (1 if self._team == 0 else -1)
        if is_second:
            best = payoffs.argmax(axis=1) if self._team == 0 else payoffs.argmin(axis=2)
            np.put_along_axis(own, np.expand_dims(best, axis), 1.0, axis=axis)
        else:
            expected = self._expected(payoffs, shape, left)
            best = expected.argmax(axis=1) if self._team == 0 else expected.argmin(axis=1)
            own[(games, best) if self._team == 0 else (games, slice(None), best)] = 1.0
        return Play(own, played.second) if self._team == 0 else Play(played.first, own)
