"""`Model`: the game as some agents know it, for simulating it ahead."""

from collections.abc import Callable, Mapping
from inspect import iscoroutinefunction
from itertools import chain, compress
from math import hypot
from typing import Any, Literal, TypedDict, Unpack, cast

from gamms import belief, kernels
from gamms.arguments import as_choice, as_count, as_int, as_known
from gamms.context import Context
from gamms.core.copies import copy_deep
from gamms.errors import BadType, BadValue, MissingKey
from gamms.game import Game
from gamms.game.facts import INFORMATION
from gamms.ir.agents import are_mates
from gamms.planning.hidden import HiddenPositions
from gamms.scenario.code import find_offered_function
from gamms.strategies import random_walk
from gamms.text import shown
from gamms.typing.actions import make_strategy
from gamms.typing.game import Action, State, Strategy
from gamms.typing.sensor_engine import IN_AIR, ON_GROUND

Policy = str | Callable[..., Any]
"""The policy of agents in a model: a strategy, a factory that makes one from the context, or the name of one, such as
"gamms.strategies:chase".
"""
Choice = Callable[[State], Action | None]
"""Chooses an action; None: follow the policy of the agent."""
States = State | Mapping[str, State]


class ModelOptions(TypedDict, total=False):
    """Keywords of a `Model`, and of planners that make one."""

    information: Literal["private", "full"]
    """"full": start from the true state of the game, if `ctx.game.information` allows it. Default: "private"."""
    sample: Callable[[Context, Any], object] | None
    """Sets further unknown state in each world; called with the model's context and a NumPy generator, after agents
    have been placed. Default: None, unknown state is as at the start.
    """
    motion: belief.Motion
    """The motion of other teams' agents until they are seen again. Default: `belief.random_walk()`."""


class Model:
    """A copy of the game that agents simulate while they decide, with only their knowledge and its own random numbers.

    It has many worlds, numbered from 0. In each world, agents that are out of sight are at positions that fit the
    observations of these agents and their team, and all draws depend on the seed, the turn and the number. Unknown
    state that is not sampled is as at the start of the game; docs/planning.md lists it.

        model = Model(state, opponents="gamms.strategies:flee")
        model.sample(3)
        model.play(10, {"ann": 17})

    Args:
        state: the argument of a strategy; or of a plan, a dict of states.
        seed: the seed of all draws.
        rollout: the policy of the own team; or for several teams, team -> policy.
        opponents: the policy of all others, or team -> policy.
        options: see `ModelOptions`.

    Attributes:
        names: the agents that decide.
        team: their team.
        policies: agent -> its policy.
        game: the simulated game: `game.scores`, `game.turn`, `game.over`, `game.ctx`.

    Raises:
        MissingKey (KeyError): the state does not come from `ctx.game`.
        BadType, BadValue: an argument is impossible, or the game does not allow full information.
        UnknownName (KeyError): an option, strategy, team or agent does not exist.
    """

    def __init__(
        self,
        state: States,
        *,
        seed: int = 0,
        rollout: Policy | Mapping[Any, Policy] = random_walk,
        opponents: Policy | Mapping[Any, Policy] = random_walk,
        **options: Unpack[ModelOptions],
    ) -> None:
        check_options(options, ModelOptions)
        self.states = list_states(state)
        some = next(iter(self.states.values()))
        self._seed = as_int(seed, "seed")
        self._turn = some["turn"]
        self._sample = options.get("sample")
        if self._sample is not None and not callable(self._sample):
            raise BadType(f"sample is a function of the context and a generator, not {shown(self._sample)}.")
        information = options.get("information", "private")
        fork = some["fork"](0, information=information)
        self.names = fork.names
        self.team = some["team"]
        if set(self.names) != set(self.states):
            raise BadValue(
                f"A model is made of all states that a plan gets, those of {list(self.names)}, not only of "
                f"{list(self.states)}."
            )
        self.game: Game = fork.game
        self._actions: Mapping[str, Action | Choice] = {}
        self.policies: Mapping[str, Strategy] = self._find_policies(
            {"rollout": rollout, "opponents": opponents}, fork.own
        )
        for agent in self.ctx.agent.create_iter():
            agent.register_strategy(self._steer(agent.name, self.policies[agent.name]))
        motion = options.get("motion", belief.random_walk())
        self._hidden = None if information == "full" else HiddenPositions(self.ctx, self.states, motion)
        self._now = self.game.snapshot()
        self.sample(0)

    @property
    def ctx(self) -> Context:
        """The context of the simulated game."""
        ctx: Context = self.game.ctx
        return ctx

    @property
    def is_over(self) -> bool:
        """Whether the simulated game has ended."""
        return self.game.is_over

    def sample(self, number: int) -> None:
        """Go back to the moment of the decision, in the world of this number, which is the same each time.

        Raises:
            BadType, BadValue: the number is not an integer from 0.
        """
        game = self.game
        which = as_count(number, "number of a world", 0)
        game.restore(self._now)
        names = ",".join(self.names)
        self.ctx.reseed(kernels.compute_purpose_key(self._seed, "model", names, self._turn, which) >> 1)
        if self._hidden is not None:
            game.internals.state.began.update(self._hidden.place())
        if self._sample is not None:
            self._sample(self.ctx, self.ctx.stream("hidden"))

    def play(self, turns: int, actions: Mapping[str, Action | Choice] | None = None) -> None:
        """Play some turns, or to the end of the game.

        Args:
            turns: the number of turns.
            actions: agents' actions in the first turn; other agents and turns follow the policies.

        Raises:
            UnknownName (KeyError): an action is for an unknown agent.
        """
        given = {} if actions is None else actions
        for name in given:
            as_known(name, "agent", self.ctx.agent.agents)
        for turn in range(as_count(turns, "turns of play", 0)):
            self._actions = {} if turn else given
            if not self.game.step():
                return

    def decide(self) -> dict[str, Action | None]:
        """Return the actions of the deciding agents' policies in the game, and copy their memories into the model.

        The policies get the states of the game, so their memories there change. The model goes to world 0.
        """
        self.sample(0)
        for name, state in self.states.items():
            self.policies[name](state)
        memories = self.game.memories
        if any(memories.get(name, {}) != state["memory"] for name, state in self.states.items()):
            self.game.restore(self._now)
            for name, state in self.states.items():
                memories[name].clear()
                memories[name].update(copy_deep(state["memory"]))
            self._now = self.game.snapshot()
            self.sample(0)
        return {name: state.get("action") for name, state in self.states.items()}

    def lead(self) -> float:
        """Return the lead in points of the own team over the best other team; the result of an ended game adds a point.

        The winner gets an extra point and every other team loses one; a tie changes nothing.
        """
        scores = self.game.scores
        over = self.game.over
        others = [scores[team] for team in self.ctx.agent.teams if team != self.team]
        lead = float(scores[self.team] - max(others, default=0.0))
        winner = None if over is None else over["winner"]
        if winner is None:
            return lead
        return lead + 1.0 if winner == self.team else lead - 1.0

    # -- policies -------------------------------------------------------------------------------------------------

    def _steer(self, name: str, policy: Strategy) -> Strategy:
        """Return a strategy that takes the action given to `play`, or else follows a policy."""

        def strategy(state: State) -> None:
            action = self._actions.get(name)
            if callable(action):
                action = action(state)
            if action is None:
                policy(state)
            else:
                state["action"] = action

        return strategy

    def _find_policies(
        self, given: Mapping[str, Policy | Mapping[Any, Policy]], own: Callable[[Any], Any]
    ) -> dict[str, Strategy]:
        """Return the policy of each agent, for turns without a given action."""
        made: dict[tuple[str, Any], Strategy] = {}
        found = {}
        for name, agent in self.ctx.agent.agents.items():
            argument = (
                "rollout" if agent.team == self.team and (self.team is not None or name in self.names) else "opponents"
            )
            policies = given[argument]
            key = argument, agent.team if isinstance(policies, Mapping) else None
            if key not in made:
                policy: Any = policies
                if isinstance(policies, Mapping):
                    as_known(agent.team, f"team in {argument}=", policies)
                    policy = policies[agent.team]
                made[key] = self._make(policy, argument, own)
            found[name] = made[key]
        return found

    def _make(self, policy: Policy, argument: str, own: Callable[[Any], Any]) -> Strategy:
        """Return the strategy that a policy names or makes, in this game."""
        function = as_policy(policy, argument)
        return cast("Strategy", make_strategy(self.ctx, function if isinstance(policy, str) else own(function)))


def as_policy(policy: object, argument: str) -> Callable[..., Any]:
    """Return the function that a policy is, or names.

    Raises:
        BadType, BadValue: the value is not a policy.
    """
    function: Any = find_offered_function(policy, "gamms.strategies") if isinstance(policy, str) else policy
    if function is None:
        raise BadValue(
            f"{argument}={shown(policy)} is not a strategy of GAMMS, such as 'gamms.strategies:chase'. To use your "
            "own, give the function; in a scenario file {function: …}."
        )
    if not callable(function) or iscoroutinefunction(function):
        raise BadType(f"{argument} is a strategy, an ordinary function of the state, not {shown(policy)}.")
    return cast("Callable[..., Any]", function)


def closeness(model: Model) -> float:
    """Return how near a model's team is to its opponents, by road: a `value` for pursuers.

    Each living opponent counts from 0, if it is caught up with, to -1, if no road leads to it: -d / (d + the diagonal
    of the map), with the road distance d from the nearest living agent of the team. An opponent that no sensor of the
    team shows in the last turn counts -1: the team still has to find it. If the team has no sensor that shows agents,
    all opponents are known.
    """
    agents = model.ctx.agent
    graph = model.ctx.graph
    living = [one for one in agents.create_iter() if one.alive]
    is_own = [one.name in model.names or are_mates(one.team, model.team) for one in living]
    own = [*compress(living, is_own)]
    others = [one for one, is_mate in zip(living, is_own, strict=True) if not is_mate]
    carried = chain.from_iterable(one.sensors.values() for one in own)
    sensors = [sensor for sensor in carried if sensor.type in IN_AIR | ON_GROUND]
    seen = set(chain.from_iterable(sensor.data for sensor in sensors)) if sensors else {one.name for one in others}
    xy = graph.columns().xy
    diagonal = max(hypot(*(xy.max(axis=0) - xy.min(axis=0))), 1e-9)
    value = -float(len(others))
    for other in others:
        if own and other.name in seen:
            ends = other.current_node_id
            far = min(graph.graph.distance(one.current_node_id, ends) for one in own)
            value += diagonal / (far + diagonal)
    return value


def list_states(given: States) -> dict[str, State]:
    """Return the states in the argument of a plan or strategy, by the names of the agents.

    Raises:
        MissingKey (KeyError): they do not come from `ctx.game`.
    """
    some: Any = given
    if not isinstance(some, dict) or not some or not all(isinstance(key, str) for key in some):
        raise BadType(f"A model is made of the state of an agent, or of the states of a plan, not of {shown(given)}.")
    is_one = "curr_pos" in some and not isinstance(some["curr_pos"], dict)
    states: dict[str, Any] = {some.get("name", ""): some} if is_one else dict(some)
    for state in states.values():
        if "fork" not in state:
            raise MissingKey(
                "A model needs state['fork']. ctx.game puts it into the states of strategies and plans; a loop of "
                "your own has none."
            )
    return states


def check_options(options: Mapping[str, object], kind: type) -> None:
    """Refuse unknown keywords, and unknown values of `information`.

    Raises:
        UnknownName (KeyError): an option does not exist.
        BadType, BadValue: `information` is neither "private" nor "full".
    """
    for name in options:
        as_known(name, "option", kind.__annotations__)
    as_choice(options.get("information", "private"), "information", INFORMATION)
