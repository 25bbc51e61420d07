"""Solve scenarios: values, best responses to strategies of any kind, the gains from them, and games for OpenSpiel."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, Literal, cast

import numpy as np

from gamms import planning, rl
from gamms.arguments import as_choice, as_count, as_int, as_known, as_mapping, explain_call_errors
from gamms.errors import BadValue
from gamms.ir.graph import FloatArray
from gamms.plugins import require_extra
from gamms.rl.turns import gain_lead
from gamms.scenario import Scenario
from gamms.solve.mixtures import PoolResponse
from gamms.solve.pursuit import recognize_pursuit
from gamms.solve.solution import (
    MAX_STATES,
    Reward,
    Solution,
    SolvedStrategy,
    TableSolution,
    check_discount,
    find_rewards,
    is_using_winner,
    list_teams,
    make_setup,
    solve_table,
)
from gamms.solve.stages import Bound
from gamms.solve.table import explore
from gamms.solve.worlds import GameSetup
from gamms.strategies.pool import list_pool_members
from gamms.text import shown

if TYPE_CHECKING:
    from gamms.solve.teams_game import TeamsGame

Method = Literal["exact", "search", "learn"]
METHODS = ("exact", "search", "learn")
_ITERATIONS = 100  # iterations and depth of a decision of "search"
_DEPTH = 12
_SEARCHED = 20  # games that estimate its value; few, because each turn takes long
_TRAINED = 50_000  # turns of training
_TRAINED_GAMES = 16  # at once
_PLAYED = 200  # games that estimate the value of a strategy


@dataclass(frozen=True)
class Response:
    """The response of a team to strategies of others; made by `best_response`.

    Attributes:
        team: the team that responds.
        method: the method that found its strategy.
        value: its reward; an estimate from games, unless the method is "exact".
        interval: the 95 % confidence interval of `value`.
        strategy: the strategy, for `scenario.play(strategies={team: …})`.
        solution: the solution of the game of this team alone, or against a pool; None unless the method is "exact".
    """

    team: str
    method: Method
    value: float
    interval: tuple[float, float]
    strategy: Any  # a strategy, or a function of a context that makes one
    solution: TableSolution | PoolResponse | None = None

    @property
    def information(self) -> str:
        """The knowledge of the team: "full": all positions; "agent": each agent has only its own observations."""
        return "agent" if self.solution is None else self.solution.information

    @property
    def bound(self) -> Bound:
        """How `value` bounds the value of the best response under the agents' own observations; see `Solution`."""
        return "lower" if self.solution is None else self.solution.bound


@explain_call_errors
def solve(
    scenario: Scenario,
    *,
    team: str | None = None,
    reward: Reward = "score",
    turns: int | None = None,
    discount: float = 1.0,
    seed: int | None = None,
    max_states: int = MAX_STATES,
) -> Solution:
    """Return the values of a small game of two teams, and optimal strategies, by value iteration.

    Every turn is played by the scenario's own rules, from every state that the game can reach. A game with a last turn
    is solved backward from it; other games are iterated until their values converge. Teams that move simultaneously
    play a matrix game in each state; a team that moves second sees the other's action. A pursuit in turns with full
    sight is recognized, and solved as by `pursuit`. See docs/solve.md.

    Args:
        scenario: a scenario of two teams.
        team: the team whose values are returned; None: the first one.
        reward: its reward for a turn, which the other one pays. "score": the change of its score less that of the other
            team's; "win": 1 if it wins, -1 if the other one wins; "turns": -1, so that it wants a short game; or a
            function of a `Transition` that returns a number.
        turns: the number of turns after which the game is cut; None: as in the scenario.
        discount: the weight of a reward one turn later, above 0 and up to 1.
        seed: the seed of the start; None: that of the scenario, or 0.
        max_states: the most states; a pursuit that is recognized is limited by memory alone.

    Raises:
        BadType, BadValue: an argument is impossible, or the game has an unsupported feature, such as random draws.
        UnknownName (KeyError): the team does not exist.
        TooLarge: the game has too many states; the message tells how many, and what would fit.
    """
    teams = list_teams(scenario, team)
    if len(teams) != 2:
        raise BadValue(
            f"A game of {len(teams)} teams ({', '.join(map(shown, teams))}) cannot be solved: solve needs two teams. "
            "Give strategies to all teams but one, and use best_response."
        )
    setup = make_setup(scenario, teams, {}, turns=turns, seed=seed, max_states=max_states)
    share = check_discount(reward, discount)
    return recognize_pursuit(setup, reward, share) or solve_table(setup, reward, share, teams[0])


def best_response(
    scenario: Scenario,
    *,
    team: str,
    against: object = None,
    method: Method = "exact",
    reward: Reward = "score",
    turns: int | None = None,
    seed: int | None = None,
    budget: int | None = None,
) -> Response:
    """Return a best response of a team to known strategies of others, and its value.

    Args:
        scenario: the scenario of the game.
        team: the team that responds.
        against: the strategy of all others, or strategies by team or agent; None: the scenario's.
        method: "exact": value iteration over all reachable states, for a team that knows all positions; the others may
            have memory, but may draw only if they are from a `Solution` of this scenario, or a
            `gamms.strategies.pool` of strategies that draw nothing, for a team that does not know the drawn member,
            in a game with a last turn. "search":
            `gamms.planning.mcts` in every turn, for agents that know their own observations and the others' strategies.
            "learn": MaskablePPO of sb3-contrib, for agents that know their own observations and learn how the others
            play.
        reward: the reward of the team, see `solve`; in games of more than two teams its score less the average of the
            others. "search" supports "score"; "learn" supports "score" and "turns".
        turns: the number of turns after which the game is cut; None: as in the scenario.
        seed: the seed of the start, of the run of the training (see `gamms.rl.vector_env`), and of the first game that
            estimates the value; None: that of the scenario, or 0.
        budget: the most states for "exact", the iterations of a decision for "search", the turns of
            training.

    Raises:
        BadType, BadValue: an argument is impossible, or the method does not support it.
        UnknownName (KeyError): the team does not exist.
        TooLarge: see `solve`.
        MissingExtra (ImportError): Stable-Baselines3 is not installed, which "learn" needs.
    """
    as_choice(method, "method", METHODS)
    teams = list_teams(scenario, team)
    others = _group_by_team(against, teams[1:])
    if team in others:
        raise BadValue(f"against contains team {shown(team)}, which responds: give the strategies of the other teams.")
    first = as_int(0 if seed is None else seed, "seed")
    cut = _cut(scenario, turns)
    if method != "exact":
        usual, answer = (_ITERATIONS, _search_response) if method == "search" else (_TRAINED, _learn_response)
        return answer(cut, team, others, reward, first, as_count(usual if budget is None else budget, "budget"))
    most = MAX_STATES if budget is None else budget
    setup = make_setup(scenario, (team,), others, turns=turns, seed=seed, max_states=most, limit="budget")
    found = _find_response_to_pool(setup, reward)
    if found is not None:
        return Response(team, method, found.value, (found.value, found.value), found.make_strategy(), found)
    solution = _find_exact_response(setup, reward, team)
    interval = (solution.value - solution.error, solution.value + solution.error)
    return Response(team, method, solution.value, interval, solution.strategy(), solution)


@dataclass(frozen=True)
class Evaluation:
    """The rewards of a strategy against several opponents, and in the worst case; made by `evaluate`.

    Attributes:
        team: the team that plays it.
        by_opponent: name of an opponent -> the mean reward of the team.
        response: the best response of the other team, which counts as one more opponent; None: not requested.
    """

    team: str
    by_opponent: Mapping[str, float]
    response: Response | None

    @property
    def average(self) -> float:
        """The mean over the named opponents."""
        return sum(self.by_opponent.values()) / len(self.by_opponent)

    @property
    def worst(self) -> float:
        """The lowest reward against the named opponents and the best response."""
        best_response_of_other = [] if self.response is None else [-self.response.value]
        return min(*self.by_opponent.values(), *best_response_of_other, float("inf"))


@explain_call_errors
def evaluate(
    scenario: Scenario,
    strategy: object,
    *,
    team: str,
    opponents: Mapping[str, object],
    method: Method | None = "exact",
    games: int = 20,
    turns: int | None = None,
    seed: int | None = None,
) -> Evaluation:
    """Return the mean lead in score of a team's strategy against several opponents, and the worst case.

    The worst case is the game against a best response to the strategy, as is usual in research on pursuit games.
    (`gamms.rl.evaluate` compares strategies on many maps against opponents that are given.)

    Args:
        scenario: a scenario of two teams.
        strategy: the strategy of all agents of the team.
        team: the team that plays it.
        opponents: name -> the strategy of the other team; games against each have the same seeds.
        method: the method of the best response, see `best_response`; None: compute none. "exact" responds for the
            start of `seed`, and refuses strategies that draw.
        games: the number of games against each opponent, from `seed` on.
        turns: the number of turns after which games are cut; None: as in the scenario.
        seed: the seed of the first game; None: that of the scenario, or 0.

    Raises:
        BadType, BadValue: see `best_response`; or there is no opponent, or the game does not have two teams.
        UnknownName (KeyError): the team does not exist.
        TooLarge, MissingExtra: see `best_response`.
    """
    teams = list_teams(scenario, team)
    named = as_mapping(opponents, "opponents")
    if len(teams) != 2 or not named:
        raise BadValue(
            f"evaluate needs a game of two teams and opponents=, name -> strategy, not {list(teams)} and {list(named)}."
        )
    cut = _cut(scenario, turns)
    start = scenario.spec.seed if seed is None else seed
    start = 0 if start is None else start
    first = as_int(start, "seed")
    number = as_count(games, "games")
    found = {
        name: float(_play_for_rewards(cut, team, {team: strategy, teams[1]: other}, "score", first, number).mean())
        for name, other in named.items()
    }
    response = None
    if method is not None:
        response = best_response(
            scenario, team=teams[1], against={team: strategy}, method=method, turns=turns, seed=first
        )
    return Evaluation(team, found, response)


@explain_call_errors
def nash_conv(
    scenario: Scenario,
    strategies: Mapping[str, object],
    *,
    team: str | None = None,
    reward: Reward = "score",
    turns: int | None = None,
    seed: int | None = None,
    max_states: int = MAX_STATES,
) -> float:
    """Return the gain of the two teams together from best responses to each other; 0 in equilibrium.

    As in OpenSpiel, this is the sum over both teams of the reward of a best response less the current reward; the
    current rewards add up to 0.

    Args:
        scenario: a scenario of two teams.
        strategies: the strategies of both; they may have memory, but may draw only if they are from a `Solution` of
            this scenario.
        team: the team that gets the reward, which the other one pays; None: the first one.
        reward: see `solve`.
        turns: see `solve`.
        seed: see `solve`.
        max_states: see `solve`.

    Raises:
        BadType, BadValue, TooLarge: see `best_response`.
        UnknownName (KeyError): the team does not exist.
    """
    teams = list_teams(scenario, team)
    given = as_mapping(strategies, "strategies")
    for one in given:
        as_known(one, "team", teams)
    if len(teams) != 2 or len(given) != 2:
        raise BadValue(f"nash_conv needs the strategies of both teams of a game of two, not {list(given)} of {teams}.")
    options: dict[str, Any] = {"turns": turns, "seed": seed, "max_states": max_states}
    pairs = (teams, teams[::-1])
    games = [make_setup(scenario, (one,), {two: given[two]}, **options) for one, two in pairs]
    return sum(_find_exact_response(game, reward, teams[0]).value for game in games)


@explain_call_errors
def exploitability(
    scenario: Scenario,
    strategies: Mapping[str, object],
    *,
    team: str | None = None,
    reward: Reward = "score",
    turns: int | None = None,
    seed: int | None = None,
    max_states: int = MAX_STATES,
) -> float:
    """Return `nash_conv` divided by the number of teams, as in OpenSpiel; see there for the arguments."""
    options: dict[str, Any] = {"team": team, "reward": reward, "turns": turns, "seed": seed, "max_states": max_states}
    return nash_conv(scenario, strategies, **options) / 2


def openspiel(
    scenario: Scenario,
    *,
    team: str | None = None,
    reward: Reward = "score",
    turns: int | None = None,
    discount: float = 1.0,
    seed: int | None = None,
    max_states: int = MAX_STATES,
) -> "TeamsGame":
    """Return a game of two teams as a `pyspiel.Game`: simultaneous, or sequential if teams take turns.

    The first player is the team that gets the reward. Each player remembers the joint observations of its agents at its
    moves. With `reward="win"` a game without a winner gives both 0. The game is not registered: use it directly, or
    convert a simultaneous one by `pyspiel.convert_to_turn_based`.

    Args:
        scenario: see `solve`.
        team: the first player; None: the first team.
        reward: see `solve`.
        turns: see `solve`; the game needs a last turn.
        discount: see `solve`.
        seed: see `solve`.
        max_states: see `solve`.

    Raises:
        BadType, BadValue, TooLarge: see `solve`; or the game has no last turn, or has both an order of play and
            conflicts.
        MissingExtra (ImportError): OpenSpiel is not installed.
    """
    with require_extra("A game of OpenSpiel", "solve"):
        from gamms.solve.teams_game import TeamsGame
    teams = list_teams(scenario, team)
    share = check_discount(reward, discount)
    if len(teams) != 2:
        raise BadValue(f"A game of {len(teams)} teams cannot become a game of OpenSpiel: it needs two teams.")
    setup = make_setup(scenario, teams, {}, turns=turns, seed=seed, max_states=max_states)
    table = explore(setup, by_winner=is_using_winner(reward))
    return TeamsGame(table, find_rewards(table, reward, share, teams[0]))


# -- inside -------------------------------------------------------------------------------------------------------


def _cut(scenario: Scenario, turns: int | None) -> Scenario:
    """Return a scenario whose games have at most this many turns."""
    last = [one for one in (scenario.spec.max_turns, turns) if one is not None]
    return scenario if turns is None else scenario.replace(max_turns=min(as_count(one, "turns") for one in last))


def _group_by_team(against: object, teams: tuple[str, ...]) -> dict[str, Any]:
    """Return strategies by team or agent."""
    if isinstance(against, Mapping):
        return dict(against)
    return {} if against is None else dict.fromkeys(teams, against)


def _find_response_to_pool(setup: GameSetup, reward: Reward) -> PoolResponse | None:
    """Return the best response to the only other team if it plays a pool; else None."""
    pools = {name: list_pool_members(strategy) for name, strategy in setup.others.items()}
    other = next(iter(pools), "")
    if len(pools) != 1 or other not in setup.scenario.spec.teams or not pools[other]:
        return None
    check_discount(reward, 1.0)
    return PoolResponse(setup, other, pools[other], reward)


def _find_exact_response(setup: GameSetup, reward: Reward, of: str) -> TableSolution:
    """Return the exact best response of the deciding team; `of` is the team that gets the reward."""
    known: Any = next(iter(setup.others.values())) if len(setup.others) == 1 else None
    is_other = isinstance(known, SolvedStrategy) and known.team not in setup.teams
    if is_other and known.is_of(setup.scenario, setup.last_turn):
        return cast("TableSolution", known.best_response_of_other(reward, of))
    return solve_table(setup, reward, 1.0, of)


def _search_response(
    scenario: Scenario, team: str, others: Mapping[str, Any], reward: Reward, seed: int, budget: int
) -> Response:
    """Return a response that searches in every turn."""
    if reward != "score":
        raise BadValue(f"method='search' is for reward='score', not {shown(reward)}: use method='exact'.")
    if not others:
        raise BadValue("method='search' needs to know how the others play: give against=, a strategy or several.")
    plays = planning.mcts(budget, depth=_DEPTH, opponents=others, seed=seed, discount=1.0)
    values = _play_for_rewards(scenario, team, {**others, team: plays}, reward, seed, _SEARCHED)
    return _make_response(team, "search", values, plays)


def _make_response(team: str, method: Method, values: FloatArray, strategy: object) -> Response:
    """Return a response whose value is the mean of the rewards in games."""
    mean = float(values.mean())
    half = float(1.96 * values.std(ddof=1) / len(values) ** 0.5)
    return Response(team, method, mean, (mean - half, mean + half), strategy)


def _learn_response(
    scenario: Scenario, team: str, others: Mapping[str, Any], reward: Reward, seed: int, budget: int
) -> Response:
    """Return a response whose policy was learned."""
    if reward not in ("score", "turns"):
        raise BadValue(f"method='learn' is for reward='score' or 'turns', not {shown(reward)}: use method='exact'.")
    with require_extra("A best response that is learned", "train"):
        from sb3_contrib import MaskablePPO
    gets = gain_lead if reward == "score" else _make_turn_reward
    env = rl.sb3_env(scenario, num_games=_TRAINED_GAMES, team=team, others=others, reward=gets, seed=seed)
    try:
        model = MaskablePPO("MultiInputPolicy", env, n_steps=64, batch_size=256, seed=seed, device="cpu")
        model.learn(budget)
        with TemporaryDirectory() as folder:
            rl.save_policy(model, Path(folder) / "response.safetensors", env)
            strategy = rl.policy(Path(folder) / "response.safetensors", other_scenario=True)
    finally:
        env.close()
    values = _play_for_rewards(scenario, team, {**others, team: strategy}, reward, seed, _PLAYED)
    return _make_response(team, "learn", values, strategy)


def _make_turn_reward(turn: rl.Turn) -> FloatArray:
    """Return -1 for each turn, (games, 1)."""
    return np.full((len(turn.after.mask), 1), -1.0)


def _play_for_rewards(
    scenario: Scenario, team: str, strategies: Mapping[str, Any], reward: Reward, seed: int, number: int
) -> FloatArray:
    """Return a team's rewards in a number of games, (games,)."""
    with scenario.batch(number, seed=seed, strategies=strategies) as games:
        games.run(warn=False)
        if reward == "turns":
            return -games.turn.astype(np.float64)
        others = [games.scores[one] for one in games.teams if one != team and one in games.scores]
        own = games.scores.get(team, np.zeros(number))
        gained: FloatArray = own - sum(others, np.zeros(number)) / max(1, len(games.teams) - 1)
        return gained
