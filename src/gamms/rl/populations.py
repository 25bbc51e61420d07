"""Populations: strategies of two teams, their payoffs against each other, and responses to mixtures of them.

`ppo_learner`, at the end, is a learner of responses.
"""

import os
from collections.abc import Callable, Hashable, Iterable, Mapping
from functools import partial
from pathlib import Path
from shutil import rmtree
from tempfile import mkdtemp
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, get_args
from weakref import finalize

import numpy as np

from gamms import kernels
from gamms.arguments import as_choice, as_count, as_float, as_int, as_known, as_mapping, as_path
from gamms.errors import BadType, BadValue, Duplicate, UnknownName
from gamms.experiment import Rows, run
from gamms.experiment.games import Row
from gamms.experiment.rows import read_metric
from gamms.ir.graph import FloatArray
from gamms.plugins import require_extra
from gamms.rl.environments import vector_env
from gamms.rl.evaluation import name_maps
from gamms.rl.learners import Reward, combine_runs
from gamms.rl.policies import opponents, policy, save_policy
from gamms.rl.turns import Turn, gain_lead
from gamms.scenario import Scenario
from gamms.strategies.pool import list_pool_members
from gamms.text import shown

if TYPE_CHECKING:
    from torch import Tensor, nn
    from torch.distributions import Categorical

    from gamms.rl.gym_envs import GamesEnv

Learner = Callable[[Any, Path | None], Any]
"""Trains in an environment, from the saved policy of the last training or from None; returns a network."""
Mix = Literal["nash", "uniform", "last"]
_MIXES = get_args(Mix)
_GAMES = 64  # games in which a learner trains at once


class PopulationResponse(NamedTuple):
    """A response of a team to a mixture; made by `Population.responses`.

    Attributes:
        name: the name that no strategy of the team in the population has yet.
        strategy: the strategy.
        value: the payoff of the team against the mixture.
        bound: how `value` bounds that of the best response: "exact", "upper", or "lower", as for all learned ones.
        team: the team that responds.
    """

    name: str
    strategy: Any
    value: float
    bound: str
    team: Hashable


class Population:
    """Strategies of two teams, which play each other; mixtures of them, and responses to mixtures.

        population = rl.Population(scenario, {"red": [chase], "blue": [flee]}, exact=solve.best_response, games=1)
        population.add("red", population.responses("red"))

    Its games are an experiment: only pairs without rows are played. With `out=`, the same program goes on after an
    interruption and gets the same rows; games of a strategy that has changed are played again.

    Args:
        scenario: a scenario of two teams.
        strategies: team -> its strategies, functions of a context that make them, and paths of saved policies; or team
            -> name -> one of these.
        out: a folder that keeps the rows (`games`) and trained policies (`policies`); None: a temporary one.
        maps: name -> map, or maps that are named by their numbers; see `evaluate`.
        games: the number of games of each pair on each map, with the seeds `seed`, `seed + 1`, …
        seed: the first seed, which is also that of exact responses. Trainings have runs of their own, so that no
            policy has played the games that value it.
        metric: the payoff of the first team, which the other one pays: `wins.<team>`, or a column of numbers; None: its
            lead in score. A learner gets it as reward, but for other columns, which need `env={"reward": …}`.
        exact: the function that responds exactly, `gamms.solve.best_response` or one with its keywords; it must count
            what `metric` counts.
        learner: the function that trains, `(env, start) -> network`, such as `ppo_learner`: `env` is a `vector_env`,
            `start` the path of the policy that the team trained last, or None; see `save_policy` for networks.
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
        if metric is not None and str(metric).startswith("wins."):
            as_known(metric, "metric", [f"wins.{team}" for team in self.teams])
        self._metric = metric
        for name, function in {"exact": exact, "learner": learner}.items():
            if function is not None and not callable(function):
                raise BadType(f"{name} must be a function, not {shown(function)}.")
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
            BadValue: the response is that of another team.
            Duplicate: the team has a strategy of this name.
        """
        members = self._members[as_known(team, "team", self.teams)]
        if isinstance(strategy, PopulationResponse):
            if strategy.team != team:
                raise BadValue(
                    f"The response {shown(strategy.name)} is of team {shown(strategy.team)}, not of {shown(team)}: add "
                    "it to its own team."
                )
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
        return self._compute_mean_payoffs(self.rows, self._members)

    def _play(self, members: Mapping[Hashable, Mapping[str, Any]]) -> Rows:
        """Play all pairs of these strategies that have no rows, and return the rows of all."""
        vary: dict[str, Any] = {"map": self._maps} if self._maps else {}
        vary |= {f"strategies.{team}": members[team] for team in self.teams}
        rows = run(self._scenario, self._seeds, vary, out=self._out / "games", workers=self._workers)
        for row in rows.errors():
            raise BadValue(f"Game {row['id']} of {self!r} raised an error: {row['error']}")
        return rows

    def _compute_mean_payoffs(self, rows: Rows, members: Mapping[Hashable, Iterable[str]]) -> FloatArray:
        """Return the mean payoffs of the first team, (strategies of the first team, strategies of the second)."""
        keys = [f"strategies.{team}" for team in self.teams]
        places = [{name: place for place, name in enumerate(members[team])} for team in self.teams]
        sums = np.zeros([len(one) for one in places])
        for row in rows:
            first, second = (place[str(row[key])] for place, key in zip(places, keys, strict=True))
            sums[first, second] += self._find_payoff(row)
        if np.isnan(sums).any():  # no row has the metric, or some have none
            raise UnknownName("column of numbers", self._metric, rows.metrics())
        return sums / (len(self._seeds) * max(1, len(self._maps)))

    def _find_payoff(self, row: Row) -> float:
        """Return the payoff of the first team in a game."""
        if self._metric is not None:
            payoff = read_metric(self._metric, row)
            is_of_team = self._metric in [f"score.{team}" for team in self.teams]
            return float(np.nan_to_num(payoff)) if is_of_team else payoff
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
        if as_choice(by, "by", _MIXES) == "nash":
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
        other = self._find_other_team(team)
        respond = self._respond_exactly if as_choice(by, "by", ("exact", "learn")) == "exact" else self._train
        as_choice(to, "to", _MIXES)
        number, others = len(self._members[team]), len(self._members[other])
        return respond(team, f"{by} {number} to {to} of {others}", other, to)

    def exploitability(self, by: Literal["exact", "learn"] = "exact", to: Mix = "nash") -> float:
        """Return half the width of `interval`: 0 in equilibrium.

        With `by="learn"` it is a lower bound, up to the errors of the means over games.

        Args:
            by: see `responses`.
            to: see `weights`.

        Raises:
            BadValue: see `responses`.
        """
        low, high = self.interval(by, to)
        return (high - low) / 2.0

    def interval(self, by: Literal["exact", "learn"] = "exact", to: Mix = "nash") -> tuple[float, float]:
        """Return what the first team gets against the best response to its mixture, and by its own best response.

        The value of the game lies between these numbers if responses are exact and one team pays the other. Learned
        responses may be worse than the best ones, so that their interval may be too narrow to contain it.

        Args:
            by: see `responses`.
            to: see `weights`.

        Raises:
            BadValue: see `responses`.
        """
        first, second = (self.responses(team, by, to).value for team in self.teams)
        return -second + 0.0, first

    def _find_other_team(self, team: Hashable) -> Hashable:
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
        return PopulationResponse(name, found.strategy, float(found.value), str(found.bound), team)

    def _train(self, team: Hashable, name: str, other: Hashable, to: Mix) -> PopulationResponse:
        """Return the trained response; its policy is trained only once."""
        path = self._out / "policies" / str(team) / f"{name}.safetensors"
        shares = np.array(list(self.weights(other, to).values()))
        if not path.exists():
            self._train_policy(team, path, other, to)
        strategy = policy(path, observation=self._env.get("observation"))
        found = self._play({team: {name: strategy}, other: self._members[other]})
        gains = self._compute_mean_payoffs(found, {team: [name], other: list(self._members[other])}).ravel()
        sign = 1.0 if team == self.teams[0] else -1.0
        return PopulationResponse(name, strategy, sign * float(gains @ shares), "lower", team)

    def _train_policy(self, team: Hashable, path: Path, other: Hashable, to: Mix) -> None:
        """Train a policy against a mixture, and save it."""
        if self._learner is None:
            raise BadValue("This population has no learner: give learner=, a function (env, start) -> network.")
        files = [path.with_name(f"{name}.safetensors") for name in self._members[team]]
        starts = [file for file in files if file.exists()]
        options: dict[str, Any] = {
            "num_games": _GAMES,
            "reward": self._find_reward(team),
            "maps": list(self._maps.values()) or None,
            "seed": kernels.compute_purpose_key(self._seeds[0], "training", str(team), path.stem) >> 1,
        }
        others = {str(other): self.mixture(other, to)}
        env = vector_env(self._scenario, team=str(team), others=others, **{**options, **self._env})
        try:
            network = self._learner(env, starts[-1] if starts else None)
            path.parent.mkdir(parents=True, exist_ok=True)
            save_policy(network, path, env)
        finally:
            env.close()

    def _find_reward(self, team: Hashable) -> Reward | None:
        """Return the reward with which a team learns; None: the change of its score."""
        if self._metric is None:
            return gain_lead
        kind, _, winner = self._metric.partition(".")
        if kind != "wins":
            return None
        return partial(_pay_winner, winner=winner, pays=1.0 if team == self.teams[0] else -1.0)


def _pay_winner(turn: Turn, winner: str, pays: float) -> FloatArray:
    """Return the reward of a team in games that a team wins in this turn, (games,)."""
    return pays * np.array([one is not None and str(one) == winner for one in turn.winner], np.float64)


def _name_strategies(given: Iterable[Any] | Mapping[str, Any]) -> dict[str, Any]:
    """Return name -> strategy; as in `gamms.strategies.pool`, functions have their own names."""
    return {one.name: one.strategy for one in list_pool_members(opponents(given))}


# -- a learner ----------------------------------------------------------------------------------------------------

_TURNS = 32  # turns of all games between two updates
_EPOCHS = 4  # passes over these turns in an update
_BATCHES = 4  # steps of a pass
_CLIP = 0.2  # the most by which a probability may change in an update, as a share of it
_SMOOTHING = 0.95  # lambda of generalized advantage estimation
_ENTROPY = 0.01  # the weight of the entropy in the loss


def ppo_learner(
    env: "GamesEnv",
    start: str | os.PathLike[str] | None = None,
    *,
    steps: int = 100_000,
    seed: int = 0,
    width: int = 64,
    rate: float = 1e-3,
    discount: float = 0.99,
) -> "nn.Sequential":
    """Train a policy by proximal policy optimization (Schulman et al. 2017), and return its network.

    It is a learner for `Population`, which gives it the environment and the start: `learner=rl.ppo_learner`, or
    `functools.partial(rl.ppo_learner, steps=300_000)`. All agents of the team play the same network. Agents that wait
    in a vector environment are not learned from, and the last turn of a game counts as its end, as it does for payoffs.
    It computes on one thread of the CPU, so that the same seeds give the same network on the same machine.

    Args:
        env: a `vector_env` of agents on the ground, which it plays and leaves open.
        start: a policy of such a network, with which training starts; None: random weights.
        steps: the actions of agents to learn from.
        seed: the seed of weights, actions and batches; and of the run of games if the environment has no seed. If both
            have one and they differ, the run is derived from both. An environment that has begun goes on instead.
        width: the number of units in each of two hidden layers.
        rate: the learning rate, which falls to 0.
        discount: the weight of a reward one turn later.

    Returns:
        The network, an `nn.Sequential` of PyTorch for `save_policy`.

    Raises:
        BadType, BadValue: an argument is impossible, the agents fly, or `start` has other layers.
        MissingExtra (ImportError): PyTorch is not installed.
    """
    with require_extra("rl.ppo_learner", "torch"):
        import torch
    space = env.single_action_space
    if not hasattr(space, "n") and not hasattr(space, "nvec"):
        raise BadValue(f"rl.ppo_learner learns moves and deeds, not {space}: write a learner for agents that fly.")
    iterations = -(-as_count(steps, "steps") // (_TURNS * env.num_envs))
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(as_int(seed, "seed"))
            run = None if env.learners.has_begun else combine_runs(env.recipe.options["seed"], seed)
            agent = _PolicyTrainer(env, run, as_count(width, "width"), as_float(discount, "discount"))
            if start is not None:
                agent.load(as_path(start, "start"))
            optimizer = torch.optim.Adam([*agent.actor.parameters(), *agent.critic.parameters()], eps=1e-5)
            for iteration in range(iterations):
                optimizer.param_groups[0]["lr"] = rate * (1.0 - iteration / iterations)
                samples = agent.play()
                for _ in range(_EPOCHS):
                    for rows in torch.randperm(len(samples[0])).chunk(_BATCHES):
                        optimizer.zero_grad()
                        agent.compute_loss(*(column[rows] for column in samples)).backward()
                        torch.nn.utils.clip_grad_norm_(agent.actor.parameters(), 0.5)
                        optimizer.step()
    finally:
        torch.set_num_threads(threads)
    return agent.actor


class _PolicyTrainer:
    """The actor and the critic of `ppo_learner`, and the games in which they play.

    Attributes:
        actor: gives a number for each move, followed by one for each deed.
        critic: gives the expected sum of rewards.
    """

    def __init__(self, env: "GamesEnv", run: int | None, width: int, discount: float) -> None:
        from torch import nn

        self._env = env
        self._discount = discount
        self._observed, _ = env.reset(seed=run)
        space = env.single_action_space
        self._sizes = [int(one) for one in getattr(space, "nvec", [getattr(space, "n", 0)])]  # moves, and deeds
        entries = self._read()[0].shape[1]

        def make(outputs: int) -> "nn.Sequential":
            hidden = [nn.Linear(entries, width), nn.Tanh(), nn.Linear(width, width), nn.Tanh()]
            return nn.Sequential(*hidden, nn.Linear(width, outputs))

        self.actor = make(sum(self._sizes))
        self.critic = make(1)
        nn.init.orthogonal_(self.actor[-1].weight, 0.01)  # at first, all actions are as likely

    def load(self, start: Path) -> None:
        """Take the weights of the actor from a saved policy."""
        from safetensors.torch import load_file

        try:
            self.actor.load_state_dict(load_file(start))
        except RuntimeError as error:
            raise BadValue(f"Training cannot start with {start}, which has other layers: {error}") from None

    def _read(self) -> tuple["Tensor", "Tensor"]:
        """Return the observations, (slots, entries), and the masks of actions, (slots, actions), as tensors."""
        import torch

        observed = self._observed["observation"] if isinstance(self._observed, dict) else self._observed
        rows = torch.tensor(observed, dtype=torch.float32).flatten(1)
        return rows, torch.tensor(np.asarray(self._env.action_masks()), dtype=torch.bool)

    def _make_distributions(self, observations: "Tensor", masks: "Tensor") -> list["Categorical"]:
        """Return the distributions of moves and of deeds."""
        from torch.distributions import Categorical

        logits = self.actor(observations).masked_fill(~masks, -1e9).split(self._sizes, dim=1)
        return [Categorical(logits=one) for one in logits]

    def play(self) -> list["Tensor"]:
        """Play some turns; return the samples: observations, masks, actions, log-probabilities, gains and returns."""
        import torch

        played = []
        with torch.no_grad():
            for _ in range(_TURNS):
                observations, masks = self._read()
                choices = self._make_distributions(observations, masks)
                actions = torch.stack([one.sample() for one in choices], dim=1)
                logs = _log_probability(choices, actions)
                given = actions.numpy() if len(choices) > 1 else actions[:, 0].numpy()
                self._observed, rewards, terminated, truncated, infos = self._env.step(given)
                results = (rewards, terminated | truncated, infos["valid"])
                outcome = [torch.tensor(np.asarray(one), dtype=torch.float32) for one in results]
                values = self.critic(observations)[:, 0]
                played.append((observations, masks, actions, logs, values, *outcome))
            last = self.critic(self._read()[0])[:, 0]
        *columns, values, rewards, ends, valid = (torch.stack(column) for column in zip(*played, strict=True))
        gains = torch.zeros_like(values)
        later = torch.zeros_like(last)
        for turn in reversed(range(_TURNS)):  # generalized advantage estimation (Schulman et al. 2016)
            goes_on = self._discount * (1.0 - ends[turn])
            later = rewards[turn] + goes_on * (last + _SMOOTHING * later) - values[turn]
            gains[turn] = later
            last = values[turn]
        took_part = valid.flatten() > 0
        return [one.flatten(0, 1)[took_part] for one in (*columns, gains, gains + values)]

    def compute_loss(
        self,
        observations: "Tensor",
        masks: "Tensor",
        actions: "Tensor",
        logs: "Tensor",
        gains: "Tensor",
        returns: "Tensor",
    ) -> "Tensor":
        """Return the loss of PPO for some samples."""
        import torch

        choices = self._make_distributions(observations, masks)
        ratio = (_log_probability(choices, actions) - logs).exp()
        scaled = (gains - gains.mean()) / (gains.std(correction=0) + 1e-8)
        surrogate = torch.minimum(ratio * scaled, ratio.clamp(1.0 - _CLIP, 1.0 + _CLIP) * scaled).mean()
        error = (self.critic(observations)[:, 0] - returns).pow(2).mean()
        entropy = sum(one.entropy().mean() for one in choices)
        return 0.5 * error - surrogate - _ENTROPY * entropy


def _log_probability(choices: list["Categorical"], actions: "Tensor") -> "Tensor":
    """Return the logarithms of the probabilities of actions, (rows,)."""
    return sum(one.log_prob(actions[:, head]) for head, one in enumerate(choices))
