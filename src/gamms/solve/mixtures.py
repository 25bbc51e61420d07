"""Mixtures of strategies, and what they are worth at worst: matrix games and the double oracle."""

from collections.abc import Sequence
from math import inf
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike

from gamms import kernels
from gamms.arguments import as_count, as_known
from gamms.context import Context
from gamms.errors import BadValue, TooLarge
from gamms.ir.graph import FloatArray
from gamms.scenario import Scenario
from gamms.solve.solution import (
    MAX_STATES,
    Reward,
    TableStrategy,
    checked_discount,
    looks_at_winners,
    rewards_of,
    setup_of,
    teams_of,
)
from gamms.solve.stages import Rewards
from gamms.solve.table import Table, explore
from gamms.text import shown
from gamms.typing.game import State

_MEMORY = "gamms.solve.mixture"  # the key of the memory of agents
MAX_NODES = 200_000  # of all best responses
_TOLERANCE = 1e-9  # at which gap it ends
_MOST_TURNS = 250  # which a recursion can go back from


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
    try:
        matrix = np.asarray(payoffs)
    except ValueError:  # rows of several lengths
        matrix = np.empty(0, object)
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


class DoubleOracle:
    """An equilibrium of mixtures over strategies that were found as best responses; made by `double_oracle`.

    Attributes:
        team: whose values these are; the other one gets the opposite.
        teams: both, this one first.
        value: what it gets where both draw a strategy by their mixture before the game.
        bounds: between which the value of the game is, by the best responses of all iterations.
        gaps: by iteration what both teams together could gain by answering best to the mixtures: their `nash_conv`.
        payoffs: (strategies of the team, strategies of the other one) what the team gets.
        mixtures: team -> the share of each of its strategies.
        information: "full": each team knows where all are, and its agents decide together.
    """

    information = "full"

    def __init__(self, game: "_Game", payoffs: FloatArray, gaps: Sequence[float], bounds: tuple[float, float]) -> None:
        self._game = game
        self.payoffs = payoffs
        self.gaps = tuple(gaps)
        self.bounds = bounds
        self.teams: tuple[str, ...] = game.table.setup.teams
        self.team = self.teams[0]
        self.value, rows, columns = matrix_game(payoffs)
        self.mixtures = dict(zip(self.teams, (rows, columns), strict=True))

    @property
    def gap(self) -> float:
        """What both teams together could gain by answering best; 0 in equilibrium."""
        return self.gaps[-1]

    def __repr__(self) -> str:
        (low, high), (rows, columns) = self.bounds, self.payoffs.shape
        within = "" if self.gap <= _TOLERANCE else f"bounds=({low:.6g}, {high:.6g}), "
        return f"DoubleOracle(value={self.value:.6g}, {within}gap={self.gap:.3g}, {rows} x {columns} strategies)"

    def strategy(self, team: str | None = None) -> TableStrategy:
        """Return how a team plays, for `scenario.play(strategies={team: …})`; it draws a strategy at first.

        Args:
            team: either of the two; None: the one whose values these are.

        Raises:
            UnknownName (KeyError): there is no such team.
        """
        one = self.team if team is None else team
        side = self.teams.index(as_known(one, "team that was solved for", self.teams))
        return _MixedStrategy(self._game, side, self.mixtures[one])


def double_oracle(  # noqa: PLR0913 - what `solve` takes, and two limits
    scenario: Scenario,
    *,
    team: str | None = None,
    reward: Reward = "score",
    turns: int | None = None,
    discount: float = 1.0,
    seed: int | None = None,
    iterations: int = 100,
    max_states: int = MAX_STATES,
    max_nodes: int = MAX_NODES,
) -> DoubleOracle:
    """Return mixtures of strategies that no strategy beats, found by best responses to mixtures of fewer strategies.

    Each team begins with one strategy, by which all its agents stay. In each iteration the matrix of the strategies is
    solved, and each team gets the best response to the other's mixture, if that gains (McMahan, Gordon, Blum: Planning
    in the presence of cost functions controlled by an adversary, ICML 2003). A best response knows the mixture, but
    not which strategy was drawn, and finds that out by what it sees. It ends in equilibrium, since there are finitely
    many strategies. Where that takes more iterations or nodes than it may, it returns the mixtures of the last
    iteration that was finished: `gap` says how far they are from equilibrium, and `bounds` where the value is.

    Args:
        scenario: of two teams, with a last turn; see `solve` for what is refused.
        team: whose values are given; None: the first one.
        reward: see `solve`.
        turns: see `solve`; the game needs a last turn.
        discount: see `solve`.
        seed: see `solve`.
        iterations: how many at most; see `DoubleOracle.gaps`.
        max_states: see `solve`.
        max_nodes: how many nodes all best responses may have: what a team can have seen, before and after a turn.

    Raises:
        BadType, BadValue: see `solve`; the game has no last turn.
        UnknownName (KeyError): there is no such team.
        TooLarge: see `solve`; or the first best responses have more nodes than they may.
    """
    teams, share = teams_of(scenario, team), checked_discount(reward, discount)
    most, nodes = as_count(iterations, "iterations"), as_count(max_nodes, "max_nodes")
    if len(teams) != 2:
        raise BadValue(
            f"double_oracle is for games of two teams, not of {len(teams)} ({', '.join(map(shown, teams))}): let all "
            "but one play strategies, and use best_response."
        )
    table = explore(
        setup_of(scenario, teams, {}, turns=turns, seed=seed, max_states=max_states),
        by_winner=looks_at_winners(reward),
    )
    if table.last_turn is None or table.last_turn > _MOST_TURNS:
        raise BadValue(
            f"double_oracle needs a game with a last turn, up to {_MOST_TURNS}, not {table.last_turn}: give turns=, or "
            "use solve, which needs none."
        )
    game = _Game(table, rewards_of(table, reward, share, teams[0]), nodes)
    found: DoubleOracle | None = None
    try:
        for _ in range(most):
            found = game.improved(found)
            if found.gap <= _TOLERANCE:
                break
    except (TooLarge, RecursionError):  # strategies that answer each other ask each other, too
        if found is None:
            raise
    assert found is not None  # noqa: S101 - there is one iteration at least
    game.max_nodes = None  # against others its strategies get elsewhere
    return found


# -- strategies without chance ------------------------------------------------------------------------------------


class _Pure(Protocol):
    """A strategy of a team: what it does by what it has seen, which has a number; 0 is the start."""

    def act(self, turn: int, state: int, seen: int, other: int | None) -> int:
        """Return its joint action; `other` is that of the other team, if that has moved before it."""

    def after(self, turn: int, state: int, seen: int, other: int | None, own: int, later: int) -> int:
        """Return what it has seen after a turn which has led to another state."""


class _Stay:
    """All agents stay, and nothing is remembered."""

    def act(self, turn: int, state: int, seen: int, other: int | None) -> int:  # noqa: ARG002 - as `_Pure` says
        """Return the first joint action."""
        return 0

    def after(self, turn: int, state: int, seen: int, other: int | None, own: int, later: int) -> int:  # noqa: ARG002
        """Return 0."""
        return 0


class _Game:
    """A table, rewards, and the strategies of both teams."""

    def __init__(self, table: Table, rewards: Rewards, max_nodes: int) -> None:
        self.table, self._rewards = table, rewards
        self.max_nodes: int | None = max_nodes
        self._nodes = 0
        self.strategies: tuple[list[_Pure], list[_Pure]] = [_Stay()], [_Stay()]
        self.turns: int = table.last_turn or 0
        self._is_over = (np.diff(table.offsets) == 0).tolist()
        self.later: list[int] = table.usual.after.tolist()
        last = rewards.usual if rewards.last is None else rewards.last
        self._usual, self._last = rewards.usual.tolist(), last.tolist()

    def improved(self, before: DoubleOracle | None) -> DoubleOracle:
        """Return mixtures with the best responses to those of an iteration; None: those of the first strategies.

        Raises:
            TooLarge: the best responses have more nodes than they may.
        """
        payoffs = self.grown(np.zeros((0, 0)) if before is None else before.payoffs)
        _, rows, columns = matrix_game(payoffs)
        upper, lower = _Answer(self, 0, columns), _Answer(self, 1, rows)
        low, high = (-inf, inf) if before is None else before.bounds
        bounds = max(low, lower.value) + 0.0, min(high, upper.value) + 0.0
        gap, value = max(0.0, upper.value - lower.value), float(rows @ payoffs @ columns)
        found = DoubleOracle(self, payoffs, (*(before.gaps if before else ()), gap), bounds)
        if upper.value - value > _TOLERANCE / 2.0:
            self.strategies[0].append(upper)
        if value - lower.value > _TOLERANCE / 2.0:
            self.strategies[1].append(lower)
        return found

    def count_node(self) -> None:
        """Count a node of a best response.

        Raises:
            TooLarge: there are more than there may be.
        """
        self._nodes += 1
        if self.max_nodes is not None and self._nodes > self.max_nodes:
            raise TooLarge(
                f"In this game teams can see more than max_nodes={self.max_nodes:,} different things: use fewer "
                "turns=, a smaller map, more max_nodes=, or solve."
            )

    def reward(self, turn: int, row: int) -> float:
        """Return what the first team gets in a turn, discounted from the start."""
        now: list[float] = self._last if turn == self.turns - 1 else self._usual
        return now[row] * self._rewards.discount**turn

    def is_over(self, turn: int, state: int) -> bool:
        """Return whether the game is over."""
        return bool(turn >= self.turns or self._is_over[state])

    def moves_second(self, side: int) -> bool:
        """Return whether a team sees what the other one does in a turn."""
        return self.table.order == (1 if side == 0 else -1)

    def row(self, state: int, side: int, own: int, other: int) -> int:
        """Return the row of the table for a joint action of a team and one of the other team."""
        return self.table.row_of(state, (own, other) if side == 0 else (other, own))

    def played(self, first: int, second: int) -> float:
        """Return what the first team gets where each team plays the strategy of a number."""
        pair = self.strategies[0][first], self.strategies[1][second]
        seen, state, total = [0, 0], 0, 0.0
        late = 0 if self.moves_second(0) else 1
        for turn in range(self.turns):
            if self.is_over(turn, state):
                break
            actions = [0, 0]
            actions[1 - late] = pair[1 - late].act(turn, state, seen[1 - late], None)
            shown_to_late = actions[1 - late] if self.moves_second(late) else None
            actions[late] = pair[late].act(turn, state, seen[late], shown_to_late)
            row = self.table.row_of(state, actions)
            total += self.reward(turn, row)
            later = self.later[row]
            seen[1 - late] = pair[1 - late].after(turn, state, seen[1 - late], None, actions[1 - late], later)
            seen[late] = pair[late].after(turn, state, seen[late], shown_to_late, actions[late], later)
            state = later
        return total

    def grown(self, payoffs: FloatArray) -> FloatArray:
        """Return the matrix with the strategies that it lacks."""
        rows, columns = payoffs.shape
        found = np.zeros((len(self.strategies[0]), len(self.strategies[1])))
        found[:rows, :columns] = payoffs
        for row, column in np.ndindex(found.shape):
            if row >= rows or column >= columns:
                found[row, column] = self.played(row, column)
        return found


class _Answer:
    """The best response of a team to a mixture of the other one's strategies.

    What it has seen is which of these strategies it can be, and what each of them has seen then.

    Args:
        game: the table and the strategies.
        side: the team that answers, 0 or 1.
        shares: of the strategies of the other one.

    Attributes:
        value: what the first team gets.
    """

    def __init__(self, game: _Game, side: int, shares: FloatArray) -> None:
        self._game, self._side, self._shares = game, side, shares.tolist()
        self._others = tuple(game.strategies[1 - side])
        self._beliefs: list[tuple[tuple[int, int], ...]] = []  # seen -> (strategy, what that has seen), …
        self._numbers: dict[tuple[tuple[int, int], ...], int] = {}
        self._best: dict[tuple[int, int, int, int | None], tuple[float, int]] = {}
        self._after: dict[tuple[int | None, ...], int] = {}
        self._sign = 1.0 if side == 0 else -1.0
        self._number(tuple((k, 0) for k in np.flatnonzero(shares).tolist()))
        self.value = self._sign * self._worth(0, 0, 0)

    def act(self, turn: int, state: int, seen: int, other: int | None) -> int:
        """Return its joint action; `other` is that of the other team, if that has moved before it."""
        return self._chosen(turn, state, seen, other)[1]

    def after(self, turn: int, state: int, seen: int, other: int | None, own: int, later: int) -> int:
        """Return what it has seen after a turn which has led to another state."""
        key = turn, state, seen, other, own, later
        if key not in self._after:
            self._game.count_node()
            self._after[key] = self._seen_after(turn, state, seen, other, own, later)
        return self._after[key]

    def _seen_after(self, turn: int, state: int, seen: int, other: int | None, own: int, later: int) -> int:
        found, is_second = [], other is not None
        for k, its in self._beliefs[seen]:
            does = self._does(turn, state, k, its, own)
            if does == other if is_second else self._game.later[self._game.row(state, self._side, own, does)] == later:
                found.append((k, does, its))
        # Where none of them would have done that, each of them is taken to go on from there.
        every = found or [(k, self._does(turn, state, k, its, own), its) for k, its in self._beliefs[seen]]
        given = None if is_second or not self._game.moves_second(1 - self._side) else own
        return self._number(
            tuple((k, self._others[k].after(turn, state, its, given, does, later)) for k, does, its in every)
        )

    def _number(self, beliefs: tuple[tuple[int, int], ...]) -> int:
        if beliefs not in self._numbers:
            self._numbers[beliefs] = len(self._beliefs)
            self._beliefs.append(beliefs)
        return self._numbers[beliefs]

    def _does(self, turn: int, state: int, k: int, its: int, own: int) -> int:
        """Return what the other team does by one of its strategies."""
        return self._others[k].act(turn, state, its, own if self._game.moves_second(1 - self._side) else None)

    def _worth(self, turn: int, state: int, seen: int) -> float:
        """Return what the team gets from there on, times the shares of the strategies that it can be."""
        if self._game.is_over(turn, state):
            return 0.0
        if not self._game.moves_second(self._side):
            return self._chosen(turn, state, seen, None)[0]
        others = {self._does(turn, state, k, its, 0) for k, its in self._beliefs[seen]}
        return sum(self._chosen(turn, state, seen, other)[0] for other in sorted(others))

    def _chosen(self, turn: int, state: int, seen: int, other: int | None) -> tuple[float, int]:
        """Return what the team gets by its best joint action, and that action."""
        key = turn, state, seen, other
        if key not in self._best:
            self._game.count_node()
            worths = list[float]()
            for action in range(
                int(self._game.table.sizes[state, self._side])
            ):  # a comprehension has a frame of its own
                worths.append(self._worth_of(turn, state, seen, other, action))
            best = max(worths)
            self._best[key] = best, worths.index(best)
        return self._best[key]

    def _worth_of(self, turn: int, state: int, seen: int, other: int | None, own: int) -> float:
        total, laters = 0.0, dict[int, None]()
        does = [(k, self._does(turn, state, k, its, own)) for k, its in self._beliefs[seen]]
        if other is not None:  # where none of the strategies does that, each of them is taken to have done it
            does = [one for one in does if one[1] == other] or [(k, other) for k, _ in does]
        for k, action in does:
            row = self._game.row(state, self._side, own, action)
            total += self._shares[k] * self._sign * self._game.reward(turn, row)
            laters[self._game.later[row]] = None
        for later in laters:
            if not self._game.is_over(turn + 1, later):
                total += self._worth(turn + 1, later, self.after(turn, state, seen, other, own, later))
        return total


class _MixedStrategy(TableStrategy):
    """A mixture of strategies, one of which is drawn before the first turn."""

    def __init__(self, game: _Game, side: int, shares: FloatArray) -> None:
        super().__init__(game.table, side)
        self._game, self._shares = game, shares

    def __repr__(self) -> str:
        return f"DoubleOracle.strategy({shown(self.team)})"

    def _action(self, ctx: Context, state: State, number: int, seen: int | None) -> int:
        strategies, turn = self._game.strategies[self._side], state["turn"]
        before = state["memory"].get(_MEMORY)
        if before is None:
            sums = np.cumsum(self._shares)
            drawn = min(int(np.searchsorted(sums, self._drawn(ctx, _MEMORY, 0), side="right")), len(self._shares) - 1)
            known = 0
        else:
            drawn, known, *last = before
            known = strategies[drawn].after(last[0], last[1], known, last[2], last[3], number)
        own = strategies[drawn].act(turn, number, known, seen)
        state["memory"][_MEMORY] = (drawn, known, turn, number, seen, own)
        return own
