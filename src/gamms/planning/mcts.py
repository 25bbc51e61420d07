"""Search for agents that decide at once: Monte Carlo tree search in worlds that fit what they know."""

from collections.abc import Callable, Mapping, Sequence
from itertools import count
from math import exp, inf, isqrt, log, sqrt
from typing import Any, Literal, NamedTuple, Unpack, cast

from gamms import kernels
from gamms.arguments import as_choice, as_count, as_float, as_int, as_items, as_range
from gamms.context import Context
from gamms.errors import BadType, BadValue, UnknownName
from gamms.limits import GarbagePause
from gamms.planning.model import Model, ModelOptions, Policy, States, as_policy, checked_options, states_of
from gamms.planning.pace import Pace, Timer
from gamms.scenario.code import offered_function
from gamms.strategies import random_walk
from gamms.text import shown, shown_as_called
from gamms.typing import IAgent
from gamms.typing.actions import strategy_in
from gamms.typing.game import Action, Draws, State, Strategy
from gamms.typing.sensor_engine import ON_GROUND

Value = Callable[[Model], float]
Key = tuple[Any, ...]

_ITERATIONS = 200
_EXPLORATION = 0.7  # how much UCT is for actions that it does not know yet; gains are from 0 to 1
_TRIED = 2  # how often an agent does something else than its policy, in each world
_EXPLORED = 0.2  # the share of moves that Exp3 makes at random


class SearchOptions(ModelOptions, total=False):
    """Further keywords of `mcts`; and those of a `Model`."""

    selection: Literal["uct", "exp3"]
    """How actions are chosen. Default: "uct", and at the end the one that was better than the policy by most. "exp3"
    draws one by how often each was tried, for games in which opponents must not foresee it."""
    actions: Callable[[State], Sequence[Action]]
    """The actions that are searched: a function of the state. Default: `state["legal"]`, nodes."""
    confidence: float
    """By how many standard errors another action has to be better than that of the rollout policy. Default: 1; for the
    random walk 0."""
    discount: float
    """What a point is worth that is made a turn later, from 0 to 1. Default: 0.98."""
    seed: int
    """Of all draws. Default: 0."""


class _Settings(NamedTuple):
    """The arguments of `mcts`, checked."""

    iterations: float
    seconds: float
    depth: int
    rollout: Policy | Mapping[Any, Policy]
    opponents: Policy | Mapping[Any, Policy]
    are_searched: bool  # the opponents
    value: Value | None
    is_uct: bool
    actions: Callable[[State], Sequence[Action]]
    confidence: float
    discount: float
    seed: int
    options: ModelOptions


@shown_as_called
def mcts(
    iterations: int | None = None,
    *,
    seconds: float | None = None,
    depth: int = 20,
    rollout: Policy | Mapping[Any, Policy] = random_walk,
    opponents: Policy | Mapping[Any, Policy] = "search",
    value: str | Value | None = None,
    **options: Unpack[SearchOptions],
) -> Callable[[States], None]:
    """Make a strategy, or a plan of a team, that searches for actions by playing the game ahead.

    In each iteration it samples a world of a `Model`, and plays `depth` turns in it. Each agent of the team has a tree
    of its own, whose nodes are what it has done and seen, and chooses at once with the others by UCT or Exp3, on its
    own gains: decoupled search for simultaneous moves (Tak, Lanctot, Winands: Monte Carlo tree search variants for
    simultaneous move games, CIG 2014; Lanctot, Lisy, Winands: Monte Carlo tree search in simultaneous move games with
    applications to Goofspiel, 2014), with trees of information sets (Cowling, Powley, Whitehouse: Information set Monte
    Carlo tree search, 2012). Behind its tree an agent follows the rollout policy. At a node that was visited n times it
    chooses among sqrt(n) actions, first that of the policy (progressive widening; Coulom: Computing Elo ratings of move
    patterns in the game of Go, 2007).

    What agents do now they try one after another, in turn with the policy and in the same worlds, so that draws and
    hidden places are equal where two actions are compared (Tesauro, Galperin: On-line policy improvement using Monte
    Carlo search, NIPS 1996), while the others do what was found for them so far (Bertsekas: Multiagent reinforcement
    learning: rollout and policy iteration, 2021). With Exp3 all try at once.

    The gain of an iteration is by how much the lead of the team grows (`Model.lead`), later points for less, and what
    `value` says at its end.

    For iterations alone, the same seed gives the same actions; for seconds, how far it comes depends on the machine.
    Nothing is begun that would end late, by how long turns have taken so far, also in the decisions before.

    Args:
        iterations: how many; None: 200, or as many as there are seconds for.
        seconds: how long a decision may take; None: as long as it takes.
        depth: how many turns are played ahead.
        rollout: the policy of the own team behind its trees, and of teammates that decide by themselves.
        opponents: the policy of the others; "search": they search as well, for what is worst for the team, and go at
            random behind their trees.
        value: what the model at the end of an iteration is worth to the team besides its points, such as
            `gamms.planning.closeness`; None: nothing.
        options: see `SearchOptions`.

    Raises:
        BadType, BadValue: an argument is impossible.
        UnknownName (KeyError): there is no such option.
    """
    checked_options(options, SearchOptions)
    rest: dict[str, Any] = {name: one for name, one in options.items() if name in ModelOptions.__annotations__}
    are_searched = isinstance(opponents, str) and opponents == "search"
    worth = offered_function(value, "gamms.planning") if isinstance(value, str) else value
    if value is not None and not callable(worth):
        raise BadType(f"value is a function of the model, such as gamms.planning.closeness, not {shown(value)}.")
    for argument, policies in (("rollout", rollout), ("opponents", random_walk if are_searched else opponents)):
        for policy in policies.values() if isinstance(policies, Mapping) else [policies]:
            as_policy(policy, argument)
    actions = options.get("actions", _legal)
    if not callable(actions):
        raise BadType(f"actions is a function of the state, not {shown(actions)}.")
    discount = as_float(options.get("discount", 0.98), "discount")
    if not 0.0 < discount <= 1.0:
        raise BadValue(f"discount must be more than 0 and at most 1, not {discount}.")
    limit = inf if seconds is None else as_range(seconds, "seconds")
    if not limit > 0.0:
        raise BadValue(f"seconds must be more than 0, not {shown(seconds)}.")
    chosen = as_choice(options.get("selection", "uct"), "selection", ("uct", "exp3"))
    most = (
        inf
        if iterations is None and seconds is not None
        else as_count(_ITERATIONS if iterations is None else iterations, "iterations")
    )
    settings = _Settings(
        iterations=most,
        seconds=limit,
        depth=as_count(depth, "depth"),
        rollout=rollout,
        opponents=random_walk if are_searched else opponents,
        are_searched=are_searched,
        value=worth,
        is_uct=chosen == "uct",
        actions=actions,
        confidence=as_range(options.get("confidence", 0.0 if rollout is random_walk else 1.0), "confidence"),
        discount=discount,
        seed=as_int(options.get("seed", 0), "seed"),
        options=cast("ModelOptions", rest),
    )

    return _searching(settings)


def _searching(settings: _Settings) -> Callable[[States], None]:
    """Return the strategy, or plan, of checked settings."""
    pace, limit = Pace(), settings.seconds

    def mcts(states: States) -> None:
        # NOTE: a collection of garbage takes 50 to 80 ms on the map of a suburb: with a limit it waits until the
        # decision was made. Nothing may be made behind this block, or the collection would begin here.
        with GarbagePause(is_wanted=limit < inf):
            given, timer = states_of(states), Timer(limit, pace)
            if not pace.has_followed(given, limit):
                _Search(settings, pace, timer, given).decide()

    def prepare(ctx: Context) -> None:
        teams = [team for team, plan in ctx.game.plans.items() if getattr(plan.function, "prepare", None) is prepare]
        own = [
            one
            for one in ctx.agent.create_iter()
            if one.team in teams or getattr(one.strategy, "prepare", None) is prepare
        ]
        if not own:
            return
        if pace.costs["model"].least == inf:
            _warm_up(ctx, own[0], settings, pace, is_plan=own[0].team in teams)
        pace.follow(ctx, {one.name: _policy_in(ctx, settings.rollout, one) for one in own})

    if limit < inf:
        mcts.__dict__["prepare"] = prepare
    return mcts


def _policy_in(ctx: Context, rollout: Policy | Mapping[Any, Policy], agent: IAgent) -> Strategy:
    """Return what an agent does in the game itself where there is no time for a search."""
    if isinstance(rollout, Mapping) and agent.team not in rollout:
        raise UnknownName("team in rollout=", agent.team, rollout)
    function = as_policy(rollout[agent.team] if isinstance(rollout, Mapping) else rollout, "rollout")
    return cast("Strategy", strategy_in(ctx, function))


def _warm_up(ctx: Context, first: IAgent, settings: _Settings, pace: Pace, *, is_plan: bool) -> None:
    """Search twice in a fork before the first decision: its time is not for loading libraries and making tables."""
    game = ctx.game.fork(0)
    game.configure({"plans": {}, "max_turns": None, "deadline_s": None, "time_budget": None})
    once = settings._replace(iterations=1, seconds=inf)

    def look(states: States) -> None:
        _Search(once, pace, Timer(inf, pace), states_of(states)).decide()

    for agent in game.ctx.agent.create_iter():
        agent.register_strategy(random_walk)
    if is_plan:
        game.command(first.team, look)
    else:
        game.ctx.agent.get_agent(first.name).register_strategy(look)
    game.run(2)


def _legal(state: State) -> Sequence[Action]:
    return state["legal"]


class _Range:
    """The gains of a search so far, by which others are from 0 to 1."""

    def __init__(self) -> None:
        self._least, self._most = inf, -inf

    def add(self, gain: float) -> None:
        """Take in a gain."""
        self._least, self._most = min(self._least, gain), max(self._most, gain)

    def share(self, gain: float) -> float:
        """Return where between the least and the most a gain is."""
        return (gain - self._least) / (self._most - self._least) if self._most > self._least else 0.5


class _Node:
    """What an agent knows at some point of an iteration, and what came of its actions there.

    Attributes:
        actions: what it may do; None: no iteration came so far.
        counts, totals: how often it did each, and the gains that this brought.
        weights: of Exp3.
        children: (action, what it saw then) -> the node behind.
    """

    __slots__ = ("actions", "children", "counts", "totals", "weights")

    def __init__(self) -> None:
        self.actions: Sequence[Action] | None = None
        self.children: dict[Key, _Node] = {}
        self.counts: list[int] = []
        self.totals: list[float] = []
        self.weights: list[float] = []

    def offer(self, actions: Sequence[Action]) -> None:
        """Set what the agent may do, in the order in which it is tried."""
        self.actions = actions
        self.counts = [0] * len(actions)
        self.totals, self.weights = ([0.0] * len(actions) for _ in range(2))

    def by_uct(self, known: _Range, draw: Draws) -> int:
        """Return the action with the highest upper bound, of several any; of n visits, the first sqrt(n) are open."""
        tries = sum(self.counts)
        among = range(min(len(self.counts), max(1, isqrt(tries))))
        if not self.counts[among[-1]]:
            return among[-1]
        explore = log(tries)
        bounds = [
            known.share(self.totals[one] / self.counts[one]) + _EXPLORATION * sqrt(explore / self.counts[one])
            for one in among
        ]
        highest = max(bounds)
        return draw.choice([action for action, bound in enumerate(bounds) if bound == highest])

    def chances(self) -> list[float]:
        """Return how probably Exp3 chooses each action."""
        highest, number = max(self.weights), len(self.weights)
        shares = [exp(_EXPLORED / number * (weight - highest)) for weight in self.weights]
        total = sum(shares)
        return [(1.0 - _EXPLORED) * share / total + _EXPLORED / number for share in shares]

    def mixed(self, chance: float) -> int:
        """Return an action by how often each was tried, but for what Exp3 tries in any case."""
        number, tries = len(self.counts), sum(self.counts)
        shares = [max(0.0, one - tries * _EXPLORED / number) for one in self.counts]
        return _drawn(shares if any(shares) else [1.0] * number, chance)


def _drawn(shares: Sequence[float], chance: float) -> int:
    """Return which of some shares a number from 0 to 1 falls into."""
    left = chance * sum(shares)
    for number, share in enumerate(shares):
        left -= share
        if left < 0.0:
            return number
    return max(number for number, share in enumerate(shares) if share)


class _Trials:
    """How much more each action of an agent brings than that of its policy, in the same worlds.

    Args:
        actions: how many; the first is that of the policy.
    """

    def __init__(self, actions: int) -> None:
        self.counts = [0] * actions
        self._totals = [0.0] * actions
        self._squares = 0.0

    def note(self, action: int, gain: float) -> None:
        """Note by how much more an action has brought in a world."""
        self.counts[action] += 1
        self._totals[action] += gain
        self._squares += gain * gain

    def next(self) -> int:
        """Return the action with the highest upper bound but the first; those that were not tried come first."""
        rest = range(1, len(self.counts))
        untried = [action for action in rest if not self.counts[action]]
        if untried:
            return untried[0]
        tries = sum(self.counts)
        spread, explore = sqrt(self._squares / tries), _EXPLORATION * sqrt(log(tries))
        return max(rest, key=lambda one: self._mean(one) + spread * explore / sqrt(self.counts[one]))

    def best(self, confidence: float) -> int:
        """Return the action with the highest lower bound of its mean, or the first, if no other is surely better.

        Args:
            confidence: by how many standard errors another has to be better than the first.
        """
        tries = sum(self.counts)
        spread, best, most = sqrt(self._squares / max(tries, 1)), 0, 0.0
        for action in range(1, len(self.counts)):
            margin = self._mean(action) - confidence * spread / sqrt(max(self.counts[action], 1))
            if margin > most:
                best, most = action, margin
        return best

    def _mean(self, action: int) -> float:
        return self._totals[action] / max(self.counts[action], 1)


class _Walker:
    """An agent in one iteration, on its way down its tree.

    Args:
        search: its settings, and the gains so far.
        roots: what it knows at first -> the root of its tree; of an agent that decides, its only root under ().
        policy: what it does behind its tree.
        first: the action that it begins with, of an agent that tries others one by one.
        is_own: whether it decides.
    """

    def __init__(
        self, search: "_Search", roots: dict[Key, _Node], policy: Strategy, *, first: int | None, is_own: bool
    ) -> None:
        self._search, self._branch, self._policy = search, roots, policy
        self._first, self._is_own = first, is_own
        self._action: int | None = None  # that it did last; None: it is at the root
        self._has_left = False  # whether it is behind its tree
        self.visits: list[tuple[int, _Node, int, float]] = []  # turn, node, action and how probable that was

    def __call__(self, state: State) -> Action | None:
        """Return its action in the tree; None behind it."""
        if self._has_left:
            return None
        key = () if self._is_own and self._action is None else (self._action, *_seen(state))
        node = self._branch.get(key)
        settings = self._search.settings
        if node is None:
            self._has_left = self._action is not None  # one node is added in an iteration, and the root for nothing
            node = self._branch[key] = _Node()
            if self._has_left:
                return None
        if node.actions is None:
            node.offer(self._in_order(state))
        if not node.actions:
            self._has_left = True
            return None
        chance = 1.0
        if self._action is None and self._first is not None:
            action = self._first
        elif settings.is_uct:
            action = node.by_uct(self._search.known, state["draw"])
        else:
            chances = node.chances()
            action = _drawn(chances, state["draw"].random())
            chance = chances[action]
        self.visits.append((self._search.turn, node, action, chance))
        self._branch, self._action = node.children, action
        return node.actions[action]

    def _in_order(self, state: State) -> list[Action]:
        """Return the actions to search, first what the policy says, and the others by lot."""
        rest, draw = list(self._search.settings.actions(state)), state["draw"]
        actions = [rest.pop(draw.below(len(rest))) for _ in range(len(rest))]
        self._policy(state)
        return _policy_first(actions, state.pop("action", None))


def _options(settings: _Settings, state: State) -> list[Action]:
    """Return the actions to search, of which there has to be one.

    Raises:
        BadType, BadValue: there is none.
    """
    actions = as_items(settings.actions(state), "What actions(state) returns", "actions")
    if actions:
        return actions
    name = shown(state.get("name"))
    if settings.actions is _legal:
        raise BadValue(
            f"mcts has no action to choose for agent {name}: it searches state['legal'], which agents that fly do not "
            "have. Give actions=, a function of the state."
        )
    raise BadValue(f"actions(state) returns no action for agent {name}: return at least one, such as state['legal'].")


def _policy_first(actions: Sequence[Action], first: Action | None) -> list[Action]:
    """Return the actions to search, first what the policy says."""
    ordered = list(actions)
    if first in ordered:
        ordered.remove(first)
        ordered.insert(0, first)
    return ordered


def _seen(state: State) -> Key:
    """Return what an agent sees of others, and where it is itself."""
    seen = [sorted(data.items()) for kind, data in state["sensor"].values() if kind in ON_GROUND]
    return (state["curr_pos"], *(pair for pairs in seen for pair in pairs))


class _Search:
    """A search for the actions of one turn.

    Args:
        settings: of the strategy.
        pace: of the decisions before.
        timer: begun when it was called.
        states: what the strategy or plan was given.

    Attributes:
        settings: as given.
        known: the gains so far.
        turn: of the iteration under way, from 0.
    """

    def __init__(self, settings: _Settings, pace: Pace, timer: Timer, states: Mapping[str, State]) -> None:
        self.settings, self.known, self.turn = settings, _Range(), 0
        self._timer = timer
        self._model = Model(
            states, seed=settings.seed, rollout=settings.rollout, opponents=settings.opponents, **settings.options
        )
        self._own: dict[str, dict[Key, _Node]] = {name: {} for name in self._model.states}
        self._actions: dict[str, list[Action]] = {}
        self._has_searched: dict[str, bool] = {}  # of agents that have more than one action
        preferred = self._model.decide()
        for name, state in self._model.states.items():
            actions = _options(settings, state)
            self._actions[name] = _policy_first(actions, preferred[name])
            self._own[name][()] = root = _Node()
            root.offer(self._actions[name])
        if not pace.knows(states := self._model.states):
            pace.follow(next(iter(states.values()))["fork"], self._model.policies)
        agents = self._model.ctx.agent.agents.items()
        others = [(name, one.team) for name, one in agents if name not in self._own]
        rivals = [name for name, team in others if team is None or team != self._model.team]
        self._others: dict[str, dict[Key, _Node]] = {name: {} for name in rivals if settings.are_searched}

    def decide(self) -> None:
        """Set the actions of all agents."""
        found = self._one_by_one() if self.settings.is_uct else self._at_once()
        fork: Any = next(iter(self._model.states.values()))["fork"]
        fork.note_search(self._has_searched)
        for name, action in found.items():
            self._model.states[name]["action"] = self._actions[name][action]

    def _at_once(self) -> dict[str, int]:
        """Return the actions of all agents, who try theirs at once and as often as they will do them."""
        for number in count():
            if number >= self.settings.iterations or self._iterate(number, {}) is None:
                break
        found = {}
        for name, state in self._model.states.items():
            key = kernels.purpose_key(self.settings.seed, "mcts", state["turn"])
            chance = kernels.fraction(kernels.draw_bits(key, kernels.name_key(name), 0))
            root = self._own[name][()]
            found[name] = root.mixed(chance) if any(root.counts) else 0
            if len(root.counts) > 1:
                self._has_searched[name] = any(root.counts)
        return found

    def _one_by_one(self) -> dict[str, int]:
        """Return the actions of all agents: one after another tries its own, as the others will do what they do.

        In each world all first do what was found so far, for an agent that has not tried anything what its policy
        says; then the agent does something else, twice. What counts is the difference.
        """
        names, found = list(self._model.states), dict.fromkeys(self._model.states, 0)
        begin = next(iter(self._model.states.values()))["turn"] % len(names)
        known: dict[Key, float | None] = {}
        spent = 0

        def gain(world: int, actions: Mapping[str, int]) -> float | None:
            nonlocal spent
            key = (world, *actions.values())
            if key not in known:
                spent += 1
                known[key] = self._iterate(world, actions)
            return known[key]

        for number, name in enumerate(names[begin:] + names[:begin], 1):
            trials = _Trials(len(self._actions[name]))
            if len(trials.counts) == 1:
                continue
            for world in count():
                if spent >= self.settings.iterations * number / len(names) or self._timer.is_past(number / len(names)):
                    break
                base = gain(world, found)
                for _ in range(_TRIED):
                    action = trials.next()
                    other = gain(world, {**found, name: action})
                    if base is None or other is None:
                        break
                    trials.note(action, other - base)
                if base is None or other is None:
                    break
            found[name] = trials.best(self.settings.confidence)
            self._has_searched[name] = any(trials.counts)
        return found

    def _iterate(self, number: int, first: Mapping[str, int]) -> float | None:
        """Play ahead once, and note and return what came of it; None, and note nothing, if there is no time for it.

        Args:
            number: of the world.
            first: agent -> which of its actions it begins with; an agent that is not in it chooses.
        """
        model, rewards, timer = self._model, list[float](), self._timer
        if not timer.fits("world"):
            return None
        model.sample(number)
        policies = model.policies
        walkers = {
            name: _Walker(self, roots, policies[name], first=first.get(name), is_own=True)
            for name, roots in self._own.items()
        }
        walkers |= {
            name: _Walker(self, roots, policies[name], first=None, is_own=False) for name, roots in self._others.items()
        }
        lead = model.lead()
        for turn in range(self.settings.depth):
            self.turn = turn
            if not timer.fits("turn", then="value"):
                return None
            model.play(1, walkers)
            before, lead = lead, model.lead()
            rewards.append(lead - before)
            if model.is_over:
                break
        if not timer.fits("value"):
            return None
        value = self.settings.value
        gains = [0.0 if value is None or model.is_over else as_float(value(model), "What value(model) returns")]
        for reward in reversed(rewards):
            gains.append(reward + self.settings.discount * gains[-1])
        gains.reverse()
        for gain in gains[:-1]:
            self.known.add(gain)
        for name, walker in walkers.items():
            for turn, node, action, chance in walker.visits:
                share = self.known.share(gains[turn])
                node.counts[action] += 1
                node.totals[action] += gains[turn]
                node.weights[action] += (share if name in self._own else 1.0 - share) / chance
        timer.end_iteration()
        return gains[0]
