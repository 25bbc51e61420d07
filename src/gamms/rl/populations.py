"""Populations: strategies of two teams, their payoffs against each other, and responses to mixtures of them."""

import os
from collections.abc import Callable, Hashable, Iterable, Mapping
from pathlib import Path
from shutil import rmtree
from tempfile import mkdtemp
from typing import Any, Literal, NamedTuple
from weakref import finalize

import numpy as np

from gamms import kernels
from gamms.arguments import as_choice, as_count, as_known, as_mapping, as_path
from gamms.errors import BadValue, Duplicate
from gamms.experiment import Rows, run
from gamms.experiment.games import Row
from gamms.experiment.rows import read_metric
from gamms.ir.graph import FloatArray
from gamms.rl.environments import vector_env
from gamms.rl.evaluation import name_maps
from gamms.rl.policies import opponents, policy, save_policy
from gamms.rl.turns import gain_lead
from gamms.scenario import Scenario
from gamms.strategies.pool import list_pool_members
from gamms.text import shown

Learner = Callable[[Any, Path | None], Any]
"""Trains in an environment, from the saved policy of the last training or from None; returns a network."""
Mix = Literal["nash", "uniform", "last"]
_GAMES = 64  # games in which a learner trains at once


class PopulationResponse(NamedTuple):
    """A response of a team to a mixture; made by `Population.responses`.

    Attributes:
        name: the name that no strategy of the team in the population has yet.
        strategy: the strategy.
        value: the payoff of the team against the mixture.
        bound: how `value` bounds that of the best response: "exact", "upper", or "lower", as for all learned ones.
    """

    name: str
    strategy: Any
    value: float
    bound: str


class Population:
    """Strategies of two teams, which play each other; mixtures of them, and responses to mixtures.

        population = rl.Population(scenario, {"red": [chase], "blue": [flee]}, exact=solve.best_response, games=1)
        population.add("red", population.responses("red"))

    Its games are an experiment: only pairs without rows are played. With `out=`, the same program goes on after an
    interruption and gets the same rows; names tell strategies apart, so that a changed strategy needs a new name.

    Args:
        scenario: a scenario of two teams.
        strategies: team -> its strategies, functions of a context that make them, and paths of saved policies; or team
            -> name -> one of these.
        out: a folder that keeps the rows (`games`) and trained policies (`policies`); None: a temporary one.
        maps: name -> map, or maps that are named by their numbers; see `evaluate`.
        games: the number of games of each pair on each map, with the seeds `seed`, `seed + 1`, …
        seed: the first seed, which is also that of responses.
        metric: the payoff of the first team, which the other one pays: `wins.<team>`, or a column of numbers; None: its
            lead in score.
        exact: the function that responds exactly, `gamms.solve.best_response` or one with its keywords; it must count
            what `metric` counts.
        learner: the function that trains, `(env, start) -> network`: `env` is a `vector_env`, `start` the path of the
            policy that the team trained last, or None; see `save_policy` for networks.
        env: more options of `vector_env`, such as `num_games` and `observation`.
        workers: the number of worker processes that play; None: play in this process.

    Attributes:
        teams: both teams, in the order of the axes of `payoffs`.

    Raises:
        BadType, BadValue: an argument is impossible; see `experiment.run`.
        UnknownName (KeyError): a team does not exist.
    """

    def __init__(  # noqa: PLR0913 - each option is independent of the others
        self,
        scenario: Scenario,
        strategies: Mapping[Any, Iterable[Any] | Mapping[str, Any]],
        *,
        out: str | os.PathLike[str] | None = None,
        maps: Mapping[str, Any] | Iterable[Any] | None = None,
        games: int = 100,
        seed: int = 0,
        metric: str | None = None,
        exact: Callable[..., Any] | None = None,
        learner: Learner | None = None,
        env: Mapping[str, Any] | None = None,
        workers: int | None = None,
    ) -> None:
        self.teams: tuple[Hashable, ...] = tuple(scenario.spec.teams)
        given = as_mapping(strategies, "strategies")
        for team in given:
            as_known(team, "team", self.teams)
        if len(self.teams) != 2 or len(given) != 2:
            raise BadValue(
                f"A population has strategies of both teams of a game of two, not {list(given)} of {list(self.teams)}."
            )
        self._scenario = scenario
        self._members = {team: _name_strategies(given[team]) for team in self.teams}
        self._out = Path(mkdtemp(prefix="gamms")) if out is None else as_path(out, "out")
        if out is None:
            finalize(self, rmtree, self._out, ignore_errors=True)
        self._maps: dict[str, Any] = {} if maps is None else name_maps(maps)
        self._seeds = range(seed, seed + as_count(games, "games"))
        self._metric = metric
        self._exact = exact
        self._learner = learner
        self._env = dict(as_mapping(env or {}, "env"))
        self._workers = workers
        self._rows: Rows | None = None

    def __repr__(self) -> str:
        return f"Population({', '.join(f'{team}: {list(self._members[team])}' for team in self.teams)})"

    # -- members --------------------------------------------------------------------------------------------------

    def strategies(self, team: Hashable) -> dict[str, Any]:
        """Return the strategies of a team: name -> strategy, in the order in which they were added.

        Raises:
            UnknownName (KeyError): the team does not exist.
        """
        return dict(self._members[as_known(team, "team", self.teams)])

    def add(self, team: Hashable, strategy: object, name: str | None = None) -> None:
        """Add a strategy of a team.

        Args:
            team: the team.
            strategy: a response; or a strategy, a function of a context that makes it, or the path of a saved policy.
            name: its name, which the rows have; None: that of the response or function.

        Raises:
            UnknownName (KeyError): the team does not exist.
            Duplicate: the team has a strategy of this name.
        """
        members = self._members[as_known(team, "team", self.teams)]
        if isinstance(strategy, PopulationResponse):
            found = {strategy.name if name is None else name: strategy.strategy}
        else:
            found = _name_strategies([strategy] if name is None else {name: strategy})
        for one in found:
            if one in members:
                raise Duplicate(f"a strategy of team {shown(team)}", one)
        members.update(found)
        self._rows = None

    # -- payoffs --------------------------------------------------------------------------------------------------

    @property
    def rows(self) -> Rows:
        """The rows of all games; pairs without rows are played first.

        Raises:
            BadValue: a game has raised an error.
        """
        if self._rows is None:
            self._rows = self._play(self._members)
        return self._rows

    @property
    def payoffs(self) -> FloatArray:
        """(strategies of the first team, strategies of the second) mean payoffs of the first team."""
        return self._mean_payoffs(self.rows, self._members)

    def _play(self, members: Mapping[Hashable, Mapping[str, Any]]) -> Rows:
        """Play all pairs of these strategies that have no rows, and return the rows of all."""
        vary: dict[str, Any] = {"map": self._maps} if self._maps else {}
        vary |= {f"strategies.{team}": members[team] for team in self.teams}
        rows = run(self._scenario, self._seeds, vary, out=self._out / "games", workers=self._workers)
        for row in rows.errors():
            raise BadValue(f"Game {row['id']} of {self!r} raised an error: {row['error']}")
        return rows

    def _mean_payoffs(self, rows: Rows, members: Mapping[Hashable, Iterable[str]]) -> FloatArray:
        """Return the mean payoffs of the first team, (strategies of the first team, strategies of the second)."""
        keys = [f"strategies.{team}" for team in self.teams]
        places = [{name: place for place, name in enumerate(members[team])} for team in self.teams]
        sums = np.zeros([len(one) for one in places])
        for row in rows:
            first, second = (place[str(row[key])] for place, key in zip(places, keys, strict=True))
            sums[first, second] += self._payoff(row)
        return sums / (len(self._seeds) * max(1, len(self._maps)))

    def _payoff(self, row: Row) -> float:
        """Return the payoff of the first team in a game."""
        if self._metric is not None:
            return read_metric(self._metric, row)
        first, second = (read_metric(f"score.{team}", row) for team in self.teams)
        return float(np.nan_to_num(first) - np.nan_to_num(second))  # teams without points have no column

    # -- mixtures -------------------------------------------------------------------------------------------------

    def weights(self, team: Hashable, by: Mix = "nash") -> dict[str, float]:
        """Return the probability of each strategy of a team in a mixture.

        Args:
            team: the team.
            by: "nash": that of an equilibrium of `payoffs`; "uniform": the same for all; "last": 1 for the strategy
                that was added last.

        Raises:
            UnknownName (KeyError): the team does not exist.
        """
        side = self.teams.index(as_known(team, "team", self.teams))
        names = list(self._members[team])
        if as_choice(by, "by", ("nash", "uniform", "last")) == "nash":
            shares = kernels.solve_matrix_games(self.payoffs[None])[1 + side][0].tolist()
        elif by == "uniform":
            shares = [1.0 / len(names)] * len(names)
        else:
            shares = [0.0] * (len(names) - 1) + [1.0]
        return dict(zip(names, shares, strict=True))

    def mixture(self, team: Hashable, by: Mix = "nash") -> Any:
        """Return a mixture as a strategy: a `gamms.strategies.pool`; see `weights`.

        Args:
            team: the team.
            by: see `weights`.

        Raises:
            UnknownName (KeyError): the team does not exist.
        """
        return opponents(self._members[team], list(self.weights(team, by).values()))

    # -- responses ------------------------------------------------------------------------------------------------

    def responses(
        self, team: Hashable, by: Literal["exact", "learn"] = "exact", to: Mix = "nash"
    ) -> PopulationResponse:
        """Return a response of a team to a mixture of the other one; `add` makes it a member.

        Args:
            team: the team.
            by: "exact": `exact` responds; "learn": `learner` trains against the mixture.
            to: the mixture of the other team; see `weights`.

        Raises:
            UnknownName (KeyError): the team does not exist.
            BadValue: the population has no such function; or an exact response is to be found on several maps.
        """
        other = self._other_of(team)
        respond = self._respond_exactly if as_choice(by, "by", ("exact", "learn")) == "exact" else self._train
        return respond(team, f"{by} {len(self._members[team])}", other, to)

    def exploitability(self, by: Literal["exact", "learn"] = "exact", to: Mix = "nash") -> float:
        """Return half the sum of the values of both teams' responses: 0 in equilibrium, if payoffs add up to 0.

        With `by="learn"` it is a lower bound, up to the errors of the means over games.

        Args:
            by: see `responses`.
            to: see `weights`.

        Raises:
            BadValue: see `responses`.
        """
        return sum(self.responses(team, by, to).value for team in self.teams) / 2.0

    def _other_of(self, team: Hashable) -> Hashable:
        """Return the other team."""
        return self.teams[1 - self.teams.index(as_known(team, "team", self.teams))]

    def _respond_exactly(self, team: Hashable, name: str, other: Hashable, to: Mix) -> PopulationResponse:
        """Return the exact response."""
        if self._exact is None:
            raise BadValue("This population has no exact responses: give exact=gamms.solve.best_response.")
        if len(self._maps) > 1:
            raise BadValue(f"Exact responses are for one map, not {len(self._maps)}: use by='learn'.")
        scenario = self._scenario.replace(map=next(iter(self._maps.values()))) if self._maps else self._scenario
        found = self._exact(scenario, team=team, against={other: self.mixture(other, to)}, seed=self._seeds[0])
        return PopulationResponse(name, found.strategy, float(found.value), str(found.bound))

    def _train(self, team: Hashable, name: str, other: Hashable, to: Mix) -> PopulationResponse:
        """Return the trained response; its policy is trained only once."""
        path = self._out / "policies" / str(team) / f"{name}.safetensors"
        shares = np.array(list(self.weights(other, to).values()))
        if not path.exists():
            self._train_policy(team, path, other, to)
        strategy = policy(path, observation=self._env.get("observation"))
        found = self._play({team: {name: strategy}, other: self._members[other]})
        gains = self._mean_payoffs(found, {team: [name], other: list(self._members[other])}).ravel()
        sign = 1.0 if team == self.teams[0] else -1.0
        return PopulationResponse(name, strategy, sign * float(gains @ shares), "lower")

    def _train_policy(self, team: Hashable, path: Path, other: Hashable, to: Mix) -> None:
        """Train a policy against a mixture, and save it."""
        if self._learner is None:
            raise BadValue("This population has no learner: give learner=, a function (env, start) -> network.")
        earlier = [f"learn {number}" for number in range(len(self._members[team]))]
        starts = [path.with_name(f"{name}.safetensors") for name in earlier if name in self._members[team]]
        options: dict[str, Any] = {
            "num_games": _GAMES,
            "reward": gain_lead if self._metric is None else None,
            "maps": list(self._maps.values()) or None,
            "seed": self._seeds[0],
        }
        others = {str(other): self.mixture(other, to)}
        env = vector_env(self._scenario, team=str(team), others=others, **{**options, **self._env})
        try:
            network = self._learner(env, starts[-1] if starts else None)
            path.parent.mkdir(parents=True, exist_ok=True)
            save_policy(network, path, env)
        finally:
            env.close()


def _name_strategies(given: Iterable[Any] | Mapping[str, Any]) -> dict[str, Any]:
    """Return name -> strategy; as in `gamms.strategies.pool`, functions have their own names."""
    return {one.name: one.strategy for one in list_pool_members(opponents(given))}
