"""Best responses to strategies of any kind, how much teams could gain by them, and games for OpenSpiel."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, Literal, cast

import numpy as np

from gamms import planning, rl
from gamms.arguments import as_choice, as_count, as_int, as_known, as_mapping
from gamms.errors import BadValue
from gamms.extras import needing
from gamms.ir.graph import FloatArray
from gamms.scenario import Scenario
from gamms.solve.solution import (
    MAX_STATES,
    Reward,
    Solution,
    SolvedStrategy,
    checked_discount,
    looks_at_winners,
    rewards_of,
    setup_of,
    solved,
    teams_of,
)
from gamms.solve.stages import Bound
from gamms.solve.table import explore
from gamms.solve.worlds import Setup
from gamms.text import shown

if TYPE_CHECKING:
    from gamms.solve.teams_game import TeamsGame

Method = Literal["exact", "search", "learn"]
METHODS = ("exact", "search", "learn")
_ITERATIONS, _DEPTH = 100, 12  # of a decision of "search"
_SEARCHED = 20  # games that say what it gets, since each of its turns takes long
_TRAINED = 50_000  # turns of training
_TRAINED_GAMES = 16  # at once
_PLAYED = 200  # games that say what a strategy gets
_HELD_OUT = 1 << 32  # added to the seeds of games that were not trained in


@dataclass(frozen=True)
class Response:
    """How a team answers strategies of others; made by `best_response`.

    Attributes:
        team: that answers.
        method: by which its strategy was found.
        value: what it gets; an estimate from games, unless the method is "exact".
        interval: in which `value` is with 95 % confidence.
        strategy: for `scenario.play(strategies={team: …})`.
        solution: of the game of this team alone; None unless the method is "exact".
    """

    team: str
    method: Method
    value: float
    interval: tuple[float, float]
    strategy: Any  # a strategy, or a function of a context that makes one
    solution: Solution | None = None

    @property
    def information(self) -> str:
        """What the team knows: "full": where all are; "agent": each agent what its sensors show."""
        return "agent" if self.solution is None else self.solution.information

    @property
    def bound(self) -> Bound:
        """What `value` is to that of the best response of agents that know what their sensors show; see `Solution`."""
        return "lower" if self.solution is None else self.solution.bound


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
    """Return how a team plays best against others whose strategies are known, and what it gets.

    Args:
        scenario: of the game.
        team: that answers.
        against: the strategy of all others, or strategies by team or agent; None: those of the scenario.
        method: "exact": by value iteration over all states that the game can reach, for a team that knows where all
            are; the others may remember, and only draw if they are from a `Solution` of this scenario. "search": by
            `gamms.planning.mcts` in every turn, for agents that know what their sensors show and how the others play.
            "learn": by MaskablePPO of sb3-contrib, for such agents that find out how the others play.
        reward: what the team gets, see `solve`; in games of more than two teams its score less the average of the
            others. "search" takes "score", "learn" that and "turns".
        turns: the game is cut after so many turns; None: as the scenario says.
        seed: of the start, and of the training; None: that of the scenario, or 0.
        budget: for "exact" how many states there may be, for "search" the iterations of a decision, for "learn" the
            turns of training.

    Raises:
        BadType, BadValue: an argument is impossible, or the method does not do what is asked.
        UnknownName (KeyError): there is no such team.
        TooLarge: see `solve`.
        MissingExtra (ImportError): Stable-Baselines3 is not installed, which "learn" needs.
    """
    as_choice(method, "method", METHODS)
    teams = teams_of(scenario, team)
    others = _by_team(against, teams[1:])
    if team in others:
        raise BadValue(f"against names team {shown(team)}, which answers: give the strategies of the others.")
    first = as_int(0 if seed is None else seed, "seed")
    cut = _cut(scenario, turns)
    if method != "exact":
        usual, answer = (_ITERATIONS, _searched) if method == "search" else (_TRAINED, _learned)
        return answer(cut, team, others, reward, first, as_count(usual if budget is None else budget, "budget"))
    most = MAX_STATES if budget is None else budget
    setup = setup_of(scenario, (team,), others, turns=turns, seed=seed, max_states=most, limit="budget")
    solution = _answer(setup, reward, team)
    interval = (solution.value - solution.error, solution.value + solution.error)
    return Response(team, method, solution.value, interval, solution.strategy(), solution)


@dataclass(frozen=True)
class Evaluation:
    """What a strategy gets against several opponents, and at worst; made by `evaluate`.

    Attributes:
        team: that plays it.
        by_opponent: name of an opponent -> the mean of what the team gets.
        response: the best response of the other team, which is one more opponent; None: it was not asked for.
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
        """The least against a named opponent or the best response."""
        answered = [] if self.response is None else [-self.response.value]
        return min(*self.by_opponent.values(), *answered, float("inf"))


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
    """Return by how much a team scores more than others with a strategy: on average, and at worst.

    The worst case is that against a best response to the strategy, as research on pursuit games reports it.

    Args:
        scenario: of two teams.
        strategy: of all agents of the team.
        team: that plays it.
        opponents: name -> the strategy of the other team; games against each have the same seeds.
        method: how the best response is found, see `best_response`; None: there is none. "exact" is that to the
            start of `seed`, and refuses strategies that draw.
        games: how many are played against each opponent, from `seed` on.
        turns: games are cut after so many turns; None: as the scenario says.
        seed: of the first game; None: that of the scenario, or 0.

    Raises:
        BadType, BadValue: see `best_response`; there is no opponent, or the game is not of two teams.
        UnknownName (KeyError): there is no such team.
        TooLarge, MissingExtra: see `best_response`.
    """
    teams, named = teams_of(scenario, team), as_mapping(opponents, "opponents")
    if len(teams) != 2 or not named:
        raise BadValue(
            f"evaluate needs a game of two teams and opponents=, name -> strategy, not {list(teams)} and {list(named)}."
        )
    cut = _cut(scenario, turns)
    start = seed if seed is not None else 0 if scenario.spec.seed is None else scenario.spec.seed
    first, number = as_int(start, "seed"), as_count(games, "games")
    found = {
        name: float(_played(cut, team, {team: strategy, teams[1]: other}, "score", first, number).mean())
        for name, other in named.items()
    }
    response = None
    if method is not None:
        response = best_response(
            scenario, team=teams[1], against={team: strategy}, method=method, turns=turns, seed=first
        )
    return Evaluation(team, found, response)


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
    """Return what the two teams of a game together could gain by answering best to each other; 0 in equilibrium.

    As OpenSpiel defines it, that is the sum of what each team gets by its best response, less what it gets now; what
    both get now adds up to 0.

    Args:
        scenario: of two teams.
        strategies: of both; they may remember, and only draw if they are from a `Solution` of this scenario.
        team: that gets the reward, and the other one pays; None: the first one.
        reward: see `solve`.
        turns: see `solve`.
        seed: see `solve`.
        max_states: see `solve`.

    Raises:
        BadType, BadValue, TooLarge: see `best_response`.
        UnknownName (KeyError): there is no such team.
    """
    teams, given = teams_of(scenario, team), as_mapping(strategies, "strategies")
    for one in given:
        as_known(one, "team", teams)
    if len(teams) != 2 or len(given) != 2:
        raise BadValue(f"nash_conv needs the strategies of both teams of a game of two, not {list(given)} of {teams}.")
    options: dict[str, Any] = {"turns": turns, "seed": seed, "max_states": max_states}
    pairs = (teams, teams[::-1])
    games = [setup_of(scenario, (one,), {two: given[two]}, **options) for one, two in pairs]
    return sum(_answer(game, reward, teams[0]).value for game in games)


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
    """Return `nash_conv` per team, as OpenSpiel defines it; see there for the arguments."""
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
    """Return a game of two teams as a `pyspiel.Game`: of simultaneous moves, with an order of play of sequential ones.

    The first player is the team whose reward it is. Each knows what the sensors of its agents together show when it
    moves, and remembers it. With `reward="win"` a game without a winner is worth 0 to both. The game is not
    registered: use it as it is, or one of simultaneous moves by `pyspiel.convert_to_turn_based`.

    Args:
        scenario: see `solve`.
        team: the first player; None: the first team.
        reward: see `solve`.
        turns: see `solve`; the game needs a last turn.
        discount: see `solve`.
        seed: see `solve`.
        max_states: see `solve`.

    Raises:
        BadType, BadValue, TooLarge: see `solve`; the game has no last turn, or it has an order of play and
            conflicts.
        MissingExtra (ImportError): OpenSpiel is not installed.
    """
    with needing("A game of OpenSpiel", "solve"):
        from gamms.solve.teams_game import TeamsGame
    teams, share = teams_of(scenario, team), checked_discount(reward, discount)
    if len(teams) != 2:
        raise BadValue(f"A game of {len(teams)} teams is no game of OpenSpiel here: only those of two are.")
    setup = setup_of(scenario, teams, {}, turns=turns, seed=seed, max_states=max_states)
    table = explore(setup, by_winner=looks_at_winners(reward))
    return TeamsGame(table, rewards_of(table, reward, share, teams[0]))


# -- inside -------------------------------------------------------------------------------------------------------


def _cut(scenario: Scenario, turns: int | None) -> Scenario:
    """Return a scenario whose games last no longer than so many turns."""
    last = [one for one in (scenario.spec.max_turns, turns) if one is not None]
    return scenario if turns is None else scenario.replace(max_turns=min(as_count(one, "turns") for one in last))


def _by_team(against: object, teams: tuple[str, ...]) -> dict[str, Any]:
    """Return strategies by team or agent."""
    if isinstance(against, Mapping):
        return dict(against)
    return {} if against is None else dict.fromkeys(teams, against)


def _answer(setup: Setup, reward: Reward, of: str) -> Solution:
    """Return the exact best response of the one team of a game; `of` is the team that gets the reward."""
    known: Any = next(iter(setup.others.values())) if len(setup.others) == 1 else None
    is_other = isinstance(known, SolvedStrategy) and known.team not in setup.teams
    if is_other and known.is_of(setup.scenario, setup.last_turn):
        return cast("Solution", known.answered(reward, of))
    return solved(setup, reward, 1.0, of)


def _searched(
    scenario: Scenario, team: str, others: Mapping[str, Any], reward: Reward, seed: int, budget: int
) -> Response:
    """Return a response that searches in every turn."""
    if reward != "score":
        raise BadValue(f"method='search' is for reward='score', not {shown(reward)}: use method='exact'.")
    if not others:
        raise BadValue("method='search' needs to know how the others play: give against=, a strategy or several.")
    plays = planning.mcts(budget, depth=_DEPTH, opponents=others, seed=seed, discount=1.0)
    values = _played(scenario, team, {**others, team: plays}, reward, seed + _HELD_OUT, _SEARCHED)
    return _estimated(team, "search", values, plays)


def _estimated(team: str, method: Method, values: FloatArray, strategy: object) -> Response:
    """Return a response whose value is the mean of what games gave."""
    mean, half = float(values.mean()), float(1.96 * values.std(ddof=1) / len(values) ** 0.5)
    return Response(team, method, mean, (mean - half, mean + half), strategy)


def _learned(
    scenario: Scenario, team: str, others: Mapping[str, Any], reward: Reward, seed: int, budget: int
) -> Response:
    """Return a response that a policy has learned."""
    if reward not in ("score", "turns"):
        raise BadValue(f"method='learn' is for reward='score' or 'turns', not {shown(reward)}: use method='exact'.")
    with needing("A best response that is learned", "train"):
        from sb3_contrib import MaskablePPO
    gets = _gain if reward == "score" else _turn
    env = rl.sb3_env(scenario, num_games=_TRAINED_GAMES, team=team, others=others, reward=gets, seed=seed)
    try:
        model = MaskablePPO("MultiInputPolicy", env, n_steps=64, batch_size=256, seed=seed, device="cpu")
        model.learn(budget)
        with TemporaryDirectory() as folder:
            rl.save_policy(model, Path(folder) / "response.safetensors", env)
            strategy = rl.policy(Path(folder) / "response.safetensors", other_scenario=True)
    finally:
        env.close()
    values = _played(scenario, team, {**others, team: strategy}, reward, seed + _HELD_OUT, _PLAYED)
    return _estimated(team, "learn", values, strategy)


def _gain(turn: rl.Turn) -> FloatArray:
    """Return by how much the score of a team has changed more than those of the others."""
    own = turn.gains.get(turn.team, np.zeros(len(turn.after.mask)))
    others = [turn.gains[team] for team in turn.after.roster.teams if team != turn.team and team in turn.gains]
    number = max(1, len(turn.after.roster.teams) - 1)
    return (own - sum(others, np.zeros(len(own))) / number)[:, None]


def _turn(turn: rl.Turn) -> FloatArray:
    """Return -1 for each turn."""
    return np.full((len(turn.after.mask), 1), -1.0)


def _played(
    scenario: Scenario, team: str, strategies: Mapping[str, Any], reward: Reward, seed: int, number: int
) -> FloatArray:
    """Return what a team gets in so many games, (games,)."""
    with scenario.batch(number, seed=seed, strategies=strategies) as games:
        games.run(warn=False)
        if reward == "turns":
            return -games.turn.astype(np.float64)
        others = [games.scores[one] for one in games.teams if one != team and one in games.scores]
        own = games.scores.get(team, np.zeros(number))
        gained: FloatArray = own - sum(others, np.zeros(number)) / max(1, len(games.teams) - 1)
        return gained
