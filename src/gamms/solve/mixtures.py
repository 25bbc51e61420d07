"""Mixed strategies and their values: matrix games, the double oracle, and best responses to pools."""

from collections.abc import Mapping, Sequence
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
from gamms.solve.information import find_sensor_information
from gamms.solve.solution import (
    MAX_STATES,
    TOLERANCE,
    Reward,
    SolvedStrategy,
    TableStrategy,
    check_discount,
    find_rewards,
    is_using_winner,
    list_teams,
    make_setup,
    read_rewards,
)
from gamms.solve.stages import Bound, Rewards, ValueIteration
from gamms.solve.table import Table, explore
from gamms.solve.worlds import GameSetup
from gamms.strategies.pool import PoolMember
from gamms.text import shown
from gamms.typing.game import State

_MEMORY = "gamms.solve.mixture"  # the key of the memory of agents
MAX_NODES = 200_000  # nodes of all best responses
_LEAST_GAP = 1e-9  # the gap at which the iteration ends
_MOST_TURNS = 250  # turns that a recursion can handle


class MatrixGame(NamedTuple):
    """An equilibrium of a zero-sum matrix game; made by `matrix_game`.

    Attributes:
        value: the row player's guaranteed payoff.
        rows: (rows,) the probability of each row.
        columns: (columns,) the probability of each column.
    """

    value: float
    rows: FloatArray
    columns: FloatArray


def matrix_game(payoffs: ArrayLike) -> MatrixGame:
    """Return the value of a zero-sum matrix game, and the equilibrium strategies of both players.

        value, rows, columns = matrix_game([[0, -1, 1], [1, 0, -1], [-1, 1, 0]])

    Args:
        payoffs: (rows, columns), the payoff of the row player, which the column player pays.

    Raises:
        BadValue: the payoffs are not a matrix of finite numbers.
    """
    try:
        matrix = np.asarray(payoffs)
    except ValueError:  # rows of different lengths
        matrix = np.empty(0, object)
    if matrix.ndim != 2 or not matrix.size or matrix.dtype.kind not in "biuf":
        raise BadValue(
            "payoffs must be a matrix of numbers, of at least one row and one column, not an array of "
            f"{matrix.dtype} of the shape {matrix.shape}."
        )
    if not np.isfinite(matrix).all():
        row, column = np.argwhere(~np.isfinite(matrix))[0].tolist()
        raise BadValue(f"payoffs[{row}][{column}] is {matrix[row, column]}: payoffs must be finite numbers.")
    values, rows, columns = kernels.solve_matrix_games(matrix[None].astype(np.float64))
    return MatrixGame(float(values[0]), rows[0], columns[0])


class DoubleOracle:
    """An equilibrium of mixtures over strategies that were found as best responses; made by `double_oracle`.

    Attributes:
        team: the team whose values these are; the other one gets the negated values.
        teams: both teams, this one first.
        value: the expected reward of `team`, if both teams draw a strategy from their mixtures before the game.
        bounds: lower and upper bound of the game's value, from the best responses of all iterations.
        gaps: the gain of both teams together from best responses to the mixtures of each iteration: their
            `nash_conv`.
        payoffs: (strategies of the team, strategies of the other one), the rewards of the team.
        mixtures: team -> the probability of each of its strategies.
        information: "full": each team knows all positions, and its agents decide together.
    """

    information = "full"

    def __init__(
        self, game: "_StrategyGame", payoffs: FloatArray, gaps: Sequence[float], bounds: tuple[float, float]
    ) -> None:
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
        """The gain of both teams together from best responses; 0 in equilibrium."""
        return self.gaps[-1]

    def __repr__(self) -> str:
        low, high = self.bounds
        rows, columns = self.payoffs.shape
        within = "" if self.gap <= _LEAST_GAP else f"bounds=({low:.6g}, {high:.6g}), "
        return f"DoubleOracle(value={self.value:.6g}, {within}gap={self.gap:.3g}, {rows} x {columns} strategies)"

    def strategy(self, team: str | None = None) -> TableStrategy:
        """Return the strategy of a team for `scenario.play(strategies={team: …})`; it draws one at the start.

        Args:
            team: one of the two teams; None: the team whose values these are.

        Raises:
            UnknownName (KeyError): the team does not exist.
        """
        one = self.team if team is None else team
        side = self.teams.index(as_known(one, "team of the solution", self.teams))
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
    """Return an equilibrium of mixed strategies, found by repeated best responses to mixtures of fewer strategies.

    Each team starts with a single strategy, in which all its agents stay. Each iteration solves the matrix game of the
    strategies, and adds each team's best response to the other's mixture, if that gains (McMahan, Gordon, Blum:
    Planning in the presence of cost functions controlled by an adversary, ICML 2003). A best response knows the
    mixture, but not which strategy was drawn, and infers that from its observations. The iteration ends in equilibrium,
    because there are finitely many strategies. If that takes too many iterations or nodes, the function returns the
    mixtures of the last complete iteration: `gap` tells how far they are from equilibrium, and `bounds` limit the
    value.

    Args:
        scenario: a scenario of two teams, with a last turn; see `solve` for unsupported games.
        team: the team whose values are returned; None: the first one.
        reward: see `solve`.
        turns: see `solve`; the game needs a last turn.
        discount: see `solve`.
        seed: see `solve`.
        iterations: the most iterations; see `DoubleOracle.gaps`.
        max_states: see `solve`.
        max_nodes: the most nodes of all best responses: possible observation histories, before and after a turn.

    Raises:
        BadType, BadValue: see `solve`; or the game has no last turn.
        UnknownName (KeyError): the team does not exist.
        TooLarge: see `solve`; or the first best responses exceed `max_nodes`.
    """
    teams = list_teams(scenario, team)
    share = check_discount(reward, discount)
    most = as_count(iterations, "iterations")
    nodes = as_count(max_nodes, "max_nodes")
    if len(teams) != 2:
        raise BadValue(
            f"double_oracle is for games of two teams, not of {len(teams)} ({', '.join(map(shown, teams))}): give "
            "strategies to all teams but one, and use best_response."
        )
    table = explore(
        make_setup(scenario, teams, {}, turns=turns, seed=seed, max_states=max_states),
        by_winner=is_using_winner(reward),
        merges=not callable(reward),
    )
    if table.last_turn is None or table.last_turn > _MOST_TURNS:
        raise BadValue(
            f"double_oracle needs a game with a last turn, up to {_MOST_TURNS}, not {table.last_turn}: give turns=, or "
            "use solve, which needs none."
        )
    game = _StrategyGame(table, find_rewards(table, reward, share, teams[0]), nodes)
    found: DoubleOracle | None = None
    try:
        for _ in range(most):
            found = game.compute_next_iteration(found)
            if found.gap <= _LEAST_GAP:
                break
    except (TooLarge, RecursionError):  # strategies that respond to each other call each other
        if found is None:
            raise
    assert found is not None  # noqa: S101 - there is one iteration at least
    game.max_nodes = None  # later its strategies may meet other opponents and get elsewhere
    return found


# -- strategies without chance ------------------------------------------------------------------------------------


class _PureStrategy(Protocol):
    """A pure strategy of a team; histories of observations have numbers, 0 is the start."""

    def act(self, turn: int, state: int, seen: int, other: int | None) -> int:
        """Return the joint action; `other` is the other team's, if that team moves first."""

    def find_next_history(self, turn: int, state: int, seen: int, other: int | None, own: int, later: int) -> int:
        """Return the number of the history after a turn that has led to state `later`."""


class _StayStrategy:
    """A strategy in which all agents stay, without memory."""

    def act(self, turn: int, state: int, seen: int, other: int | None) -> int:  # noqa: ARG002 - as `_PureStrategy` says
        """Return the first joint action."""
        return 0

    def find_next_history(self, turn: int, state: int, seen: int, other: int | None, own: int, later: int) -> int:  # noqa: ARG002
        """Return 0."""
        return 0


class _StrategyGame:
    """A table with rewards, and the pure strategies of both teams so far."""

    def __init__(self, table: Table, rewards: Rewards, max_nodes: int) -> None:
        self.table = table
        self._rewards = rewards
        self.max_nodes: int | None = max_nodes
        self._nodes = 0
        self.strategies: tuple[list[_PureStrategy], list[_PureStrategy]] = [_StayStrategy()], [_StayStrategy()]
        self.turns: int = table.last_turn or 0
        self._is_over = (np.diff(table.offsets) == 0).tolist()
        self.later: list[int] = table.usual.after.tolist()
        last = rewards.usual if rewards.last is None else rewards.last
        self._usual = rewards.usual.tolist()
        self._last = last.tolist()

    def compute_next_iteration(self, before: DoubleOracle | None) -> DoubleOracle:
        """Return the next iteration's mixtures, and add best responses to them; `before` is None at first.

        Raises:
            TooLarge: the best responses have too many nodes.
        """
        payoffs = self.extend_payoffs(np.zeros((0, 0)) if before is None else before.payoffs)
        _, rows, columns = matrix_game(payoffs)
        upper = _BestResponse(self, 0, columns)
        lower = _BestResponse(self, 1, rows)
        low, high = (-inf, inf) if before is None else before.bounds
        bounds = max(low, lower.value) + 0.0, min(high, upper.value) + 0.0
        gap = max(0.0, upper.value - lower.value)
        value = float(rows @ payoffs @ columns)
        found = DoubleOracle(self, payoffs, (*(before.gaps if before else ()), gap), bounds)
        if upper.value - value > _LEAST_GAP / 2.0:
            self.strategies[0].append(upper)
        if value - lower.value > _LEAST_GAP / 2.0:
            self.strategies[1].append(lower)
        return found

    def count_node(self) -> None:
        """Count a node of a best response.

        Raises:
            TooLarge: there are too many nodes.
        """
        self._nodes += 1
        if self.max_nodes is not None and self._nodes > self.max_nodes:
            raise TooLarge(
                f"In this game teams can make more than max_nodes={self.max_nodes:,} different observations: use fewer "
                "turns=, a smaller map, a larger max_nodes=, or solve."
            )

    def compute_reward(self, turn: int, row: int) -> float:
        """Return the first team's reward in a turn, discounted from the start."""
        now: list[float] = self._last if turn == self.turns - 1 else self._usual
        return now[row] * self._rewards.discount**turn

    def is_over(self, turn: int, state: int) -> bool:
        """Return whether the game is over."""
        return bool(turn >= self.turns or self._is_over[state])

    def is_second(self, side: int) -> bool:
        """Return whether a team sees the other team's action before it moves."""
        return self.table.order == (1 if side == 0 else -1)

    def find_row(self, state: int, side: int, own: int, other: int) -> int:
        """Return the table row of a state and the joint actions of a team and of the other team."""
        return self.table.find_row(state, (own, other) if side == 0 else (other, own))

    def compute_pair_reward(self, first: int, second: int) -> float:
        """Return the first team's reward if the teams play their strategies of these numbers."""
        pair = self.strategies[0][first], self.strategies[1][second]
        seen = [0, 0]
        state = 0
        total = 0.0
        late = 0 if self.is_second(0) else 1
        for turn in range(self.turns):
            if self.is_over(turn, state):
                break
            actions = [0, 0]
            actions[1 - late] = pair[1 - late].act(turn, state, seen[1 - late], None)
            shown_to_late = actions[1 - late] if self.is_second(late) else None
            actions[late] = pair[late].act(turn, state, seen[late], shown_to_late)
            row = self.table.find_row(state, actions)
            total += self.compute_reward(turn, row)
            later = self.later[row]
            seen[1 - late] = pair[1 - late].find_next_history(
                turn, state, seen[1 - late], None, actions[1 - late], later
            )
            seen[late] = pair[late].find_next_history(turn, state, seen[late], shown_to_late, actions[late], later)
            state = later
        return total

    def extend_payoffs(self, payoffs: FloatArray) -> FloatArray:
        """Return the payoff matrix extended by the new strategies."""
        rows, columns = payoffs.shape
        found = np.zeros((len(self.strategies[0]), len(self.strategies[1])))
        found[:rows, :columns] = payoffs
        for row, column in np.ndindex(found.shape):
            if row >= rows or column >= columns:
                found[row, column] = self.compute_pair_reward(row, column)
        return found


class _BestResponse:
    """The best response of a team to a mixture of the other team's strategies.

    Its history is a belief: which of these strategies are possible, and the number of each one's own history.

    Args:
        game: the table and the strategies.
        side: the team that responds, 0 or 1.
        shares: the probabilities of the other team's strategies.

    Attributes:
        value: the reward of the first team.
    """

    def __init__(self, game: _StrategyGame, side: int, shares: FloatArray) -> None:
        self._game = game
        self._side = side
        self._shares = shares.tolist()
        self._others = tuple(game.strategies[1 - side])
        self._beliefs: list[tuple[tuple[int, int], ...]] = []  # history -> (strategy, its own history), …
        self._numbers: dict[tuple[tuple[int, int], ...], int] = {}
        self._best: dict[tuple[int, int, int, int | None], tuple[float, int]] = {}
        self._after: dict[tuple[int | None, ...], int] = {}
        self._sign = 1.0 if side == 0 else -1.0
        self._number_beliefs(tuple((k, 0) for k in np.flatnonzero(shares).tolist()))
        self.value = self._sign * self._compute_worth(0, 0, 0)

    def act(self, turn: int, state: int, seen: int, other: int | None) -> int:
        """Return its joint action; `other` is the other team's, if that team has moved first."""
        return self._choose_action(turn, state, seen, other)[1]

    def find_next_history(self, turn: int, state: int, seen: int, other: int | None, own: int, later: int) -> int:
        """Return the number of the history after a turn that has led to state `later`."""
        key = turn, state, seen, other, own, later
        if key not in self._after:
            self._game.count_node()
            self._after[key] = self._find_seen(turn, state, seen, other, own, later)
        return self._after[key]

    def _find_seen(self, turn: int, state: int, seen: int, other: int | None, own: int, later: int) -> int:
        found = []
        is_second = other is not None
        for k, its in self._beliefs[seen]:
            does = self._find_action(turn, state, k, its, own)
            if (
                does == other
                if is_second
                else self._game.later[self._game.find_row(state, self._side, own, does)] == later
            ):
                found.append((k, does, its))
        # If no strategy would have done that, all of them stay possible.
        every = found or [(k, self._find_action(turn, state, k, its, own), its) for k, its in self._beliefs[seen]]
        given = None if is_second or not self._game.is_second(1 - self._side) else own
        return self._number_beliefs(
            tuple(
                (k, self._others[k].find_next_history(turn, state, its, given, does, later)) for k, does, its in every
            )
        )

    def _number_beliefs(self, beliefs: tuple[tuple[int, int], ...]) -> int:
        if beliefs not in self._numbers:
            self._numbers[beliefs] = len(self._beliefs)
            self._beliefs.append(beliefs)
        return self._numbers[beliefs]

    def _find_action(self, turn: int, state: int, k: int, its: int, own: int) -> int:
        """Return the action of the other team's strategy number `k`."""
        return self._others[k].act(turn, state, its, own if self._game.is_second(1 - self._side) else None)

    def _compute_worth(self, turn: int, state: int, seen: int) -> float:
        """Return the team's future reward, weighted by the probabilities of the possible strategies."""
        if self._game.is_over(turn, state):
            return 0.0
        if not self._game.is_second(self._side):
            return self._choose_action(turn, state, seen, None)[0]
        others = {self._find_action(turn, state, k, its, 0) for k, its in self._beliefs[seen]}
        return sum(self._choose_action(turn, state, seen, other)[0] for other in sorted(others))

    def _choose_action(self, turn: int, state: int, seen: int, other: int | None) -> tuple[float, int]:
        """Return the team's future reward for its best joint action, and that action."""
        key = turn, state, seen, other
        if key not in self._best:
            self._game.count_node()
            worths = list[float]()
            for action in range(int(self._game.table.sizes[state, self._side])):  # a comprehension would add a frame
                worths.append(self._compute_worth_of_state(turn, state, seen, other, action))
            best = max(worths)
            self._best[key] = best, worths.index(best)
        return self._best[key]

    def _compute_worth_of_state(self, turn: int, state: int, seen: int, other: int | None, own: int) -> float:
        total = 0.0
        laters = dict[int, None]()
        does = [(k, self._find_action(turn, state, k, its, own)) for k, its in self._beliefs[seen]]
        if other is not None:  # if no strategy does that, all of them are assumed to have done it
            does = [one for one in does if one[1] == other] or [(k, other) for k, _ in does]
        for k, action in does:
            row = self._game.find_row(state, self._side, own, action)
            total += self._shares[k] * self._sign * self._game.compute_reward(turn, row)
            laters[self._game.later[row]] = None
        for later in laters:
            if not self._game.is_over(turn + 1, later):
                total += self._compute_worth(
                    turn + 1, later, self.find_next_history(turn, state, seen, other, own, later)
                )
        return total


class _MixedStrategy(TableStrategy):
    """A mixture of pure strategies, one of which is drawn before the first turn."""

    def __init__(self, game: _StrategyGame, side: int, shares: FloatArray) -> None:
        super().__init__(game.table, side)
        self._game = game
        self._shares = shares

    def __repr__(self) -> str:
        return f"DoubleOracle.strategy({shown(self.team)})"

    def _find_joint_action(self, ctx: Context, state: State, number: int, seen: int | None) -> int:
        strategies = self._game.strategies[self._side]
        turn = state["turn"]
        before = state["memory"].get(_MEMORY)
        if before is None:
            sums = np.cumsum(self._shares)
            drawn = min(
                int(np.searchsorted(sums, self._draw_number(ctx, _MEMORY, 0), side="right")), len(self._shares) - 1
            )
            known = 0
        else:
            drawn, known, *last = before
            known = strategies[drawn].find_next_history(last[0], last[1], known, last[2], last[3], number)
        own = strategies[drawn].act(turn, number, known, seen)
        state["memory"][_MEMORY] = (drawn, known, turn, number, seen, own)
        return own


# -- best responses to pools --------------------------------------------------------------------------------------

_Belief = tuple[tuple[int, int], ...]  # members that may have been drawn, and the state of the game against each


class PoolResponse:
    """The best response of a team to a pool, of which the other team plays one member in each game.

    The team knows all positions and the pool, but not which member was drawn: moves of the other team rule out members.
    The game against each member is a table of its own. Where no member would have led the game, the team plays the most
    probable action of an equilibrium.

    Args:
        setup: the game of this team; each member in turn replaces its `others`.
        other: the team that plays the pool.
        members: the members of the pool, none of which draws random numbers.
        reward: the reward of the team.

    Attributes:
        team: the team that responds.
        value: its expected reward.
        bound: see `Solution.bound`.
        information: "full": it knows all positions, and its agents decide together.

    Raises:
        BadValue: the game has no last turn, or an unsupported feature.
        TooLarge: see `solve`.
    """

    information = "full"

    def __init__(self, setup: GameSetup, other: str, members: Sequence[PoolMember], reward: Reward) -> None:
        self.team = setup.teams[0]
        by_winner = is_using_winner(reward)
        whole = explore(setup._replace(teams=(self.team, other), others={}), by_winner=by_winner)
        last = whole.last_turn
        if last is None or last > _MOST_TURNS:
            raise BadValue(
                f"An exact response to a pool needs a game with a last turn, up to {_MOST_TURNS}, not {last}: give "
                "turns=, or respond to one member."
            )
        given = [setup._replace(others={other: one.strategy}) for one in members]
        self.tables = [explore(one, by_winner=by_winner) for one in given]
        self._shares = [one.share for one in members]
        self.elsewhere = ValueIteration(whole, read_rewards(whole, reward, 1.0, self.team), TOLERANCE)
        self._turns: int = last
        self._rewards = [read_rewards(table, reward, 1.0, self.team) for table in self.tables]
        self._best: dict[tuple[int, _Belief], tuple[float, int]] = {}
        self.start: _Belief = tuple((member, 0) for member in range(len(members)))
        self.value = self._compute_value_before(0, self.start) + 0.0
        seen = [find_sensor_information(table)[self.team] for table in self.tables]
        self.bound: Bound = "exact" if set(seen) == {"full"} else "upper"

    def make_strategy(self) -> TableStrategy:
        """Return the strategy for `scenario.play(strategies={team: …})`; it draws nothing."""
        return _PoolResponseStrategy(self)

    def choose(self, turn: int, belief: _Belief) -> tuple[float, int]:
        """Return the expected reward of the best joint action, weighted by the shares of the members, and this action.

        Args:
            turn: the number of turns played.
            belief: the members that are possible, with the moves that the team has seen.
        """
        key = turn, belief
        if key not in self._best:
            actions = {int(self.tables[member].sizes[state, 0]) for member, state in belief}
            if len(actions) > 1:
                raise BadValue("Legal moves differ at equal positions: an exact response to a pool needs equal ones.")
            values = list[float]()
            for action in range(actions.pop()):  # a comprehension would add a frame
                values.append(self._compute_value(turn, belief, action))
            best = max(values)
            self._best[key] = best, values.index(best)
        return self._best[key]

    def list_after(self, turn: int, belief: _Belief, action: int) -> dict[tuple[int, ...], _Belief]:
        """Return the belief after a turn, by the nodes of all agents, -1: out; ended games are left out."""
        found: dict[tuple[int, ...], _Belief] = {}
        for member, state in belief:
            table = self.tables[member]
            later = int(table.usual.after[table.find_row(state, (action, 0))])
            if turn + 1 < self._turns and table.offsets[later] < table.offsets[later + 1]:
                nodes = tuple(np.where(table.alive[later], table.nodes[later], -1).tolist())
                found[nodes] = (*found.get(nodes, ()), (member, later))
        return found

    def list_seen(self, belief: _Belief) -> dict[tuple[int, ...], _Belief]:
        """Return the belief by the nodes of the agents that move earlier in the turn, which the team sees."""
        found: dict[tuple[int, ...], _Belief] = {}
        for member, state in belief:
            table = self.tables[member]
            later = table.usual.after[table.find_row(state, (0, 0))]
            numbers = [table.roster.names.index(name) for name in table.earlier[0]]
            nodes = tuple(int(table.nodes[later, number]) for number in numbers if table.alive[state, number])
            found[nodes] = (*found.get(nodes, ()), (member, state))
        return found

    def _compute_value_before(self, turn: int, belief: _Belief) -> float:
        """Return the expected reward before the team has seen earlier moves of the turn."""
        total = 0.0
        for seen in self.list_seen(belief).values():
            total += self.choose(turn, seen)[0]
        return total

    def _compute_value(self, turn: int, belief: _Belief, action: int) -> float:
        """Return the expected reward of a joint action."""
        total = 0.0
        for member, state in belief:
            rewards = self._rewards[member]
            is_last = turn == self._turns - 1 and rewards.last is not None
            now = rewards.last if is_last and rewards.last is not None else rewards.usual
            total += self._shares[member] * float(now[self.tables[member].find_row(state, (action, 0))])
        for later in self.list_after(turn, belief, action).values():
            total += self._compute_value_before(turn + 1, later)
        return total


class _PoolResponseStrategy(SolvedStrategy):
    """The strategy of a best response to a pool, which draws nothing."""

    def __init__(self, response: PoolResponse) -> None:
        super().__init__(response.elsewhere, 0)
        self._response = response

    def __repr__(self) -> str:
        return f"PoolResponse.make_strategy({shown(self.team)})"

    def is_of(self, scenario: Scenario, last_turn: int | None) -> bool:  # noqa: ARG002
        """Return False: it is not the strategy of a solution, which `best_response` would look up."""
        return False

    def _choose_node(self, ctx: Context, state: State, nodes: list[int], moved: Mapping[str, int]) -> int:
        response = self._response
        turn = state["turn"]
        before = state["memory"].get(_MEMORY)
        belief = response.start if turn == 0 else ()
        if turn and before:
            belief = response.list_after(turn - 1, *before).get(tuple(nodes), ())
        possible = response.list_seen(belief).get(tuple(moved.values()), ())
        if not possible:
            state["memory"][_MEMORY] = ()
            return super()._choose_node(ctx, state, nodes, moved)
        member, number = possible[0]
        action = response.choose(turn, possible)[1]
        state["memory"][_MEMORY] = possible, action
        return response.tables[member].name_actions(number, 0, action)[state["name"]]

    def _find_joint_action(self, ctx: Context, state: State, number: int, seen: int | None) -> int:  # noqa: ARG002
        return int(self._find_action_probabilities(state["turn"], number, seen).argmax())
