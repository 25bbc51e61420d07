"""Monte Carlo tree search for agents that decide simultaneously, in sampled worlds that fit their knowledge."""

from collections.abc import Callable, Mapping, Sequence
from itertools import chain, count
from math import exp, inf, isqrt, log, sqrt
from typing import Any, Literal, NamedTuple, Unpack, cast

from gamms import kernels
from gamms.arguments import as_choice, as_count, as_float, as_int, as_items, as_range, show_as_call
from gamms.context import Context
from gamms.errors import BadType, BadValue, UnknownName
from gamms.game.snapshots import get_counterpart
from gamms.ir.schema import Memo
from gamms.limits import GarbagePause
from gamms.planning.model import Model, ModelOptions, Policy, States, as_policy, check_options, list_states
from gamms.planning.pace import SearchPace, SearchTimer
from gamms.scenario.code import find_offered_function
from gamms.strategies import random_walk
from gamms.text import shown
from gamms.typing import IAgent
from gamms.typing.actions import make_strategy
from gamms.typing.game import Action, Draws, State, Strategy
from gamms.typing.sensor_engine import ON_GROUND

Value = Callable[[Model], float]
Key = tuple[Any, ...]

_ITERATIONS = 200
_EXPLORATION = 0.7  # weight of exploration in UCT; gains are scaled to 0 to 1
_TRIED = 2  # alternative actions that an agent tries in each world
_EXPLORED = 0.2  # share of actions that Exp3 chooses uniformly at random


class SearchOptions(ModelOptions, total=False):
    """Keywords of `mcts` besides the keywords of `Model`."""

    selection: Literal["uct", "exp3"]
    """How actions are chosen. Default: "uct", which finally takes the action with the largest gain over the policy.
    "exp3" draws an action in proportion to its number of trials, for games in which opponents must not foresee it.
    """
    actions: Callable[[State], Sequence[Action]]
    """The actions to search: a function of the state. Default: `state["legal"]`, nodes."""
    confidence: float
    """By how many standard errors another action must be better than the rollout policy's.

    Default: 1; for the random walk 0.
    """
    discount: float
    """The weight of a point that is scored one turn later, from 0 to 1. Default: 0.98."""
    seed: int
    """The seed of all draws. Default: 0."""


class _SearchSettings(NamedTuple):
    """The checked arguments of `mcts`."""

    iterations: float
    seconds: float
    depth: int
    rollout: Policy | Mapping[Any, Policy]
    opponents: Policy | Mapping[Any, Policy]
    are_searched: bool  # whether opponents search as well
    value: Value | None
    is_uct: bool
    actions: Callable[[State], Sequence[Action]]
    confidence: float
    discount: float
    seed: int
    options: ModelOptions


@show_as_call
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
    """Make a strategy, or a plan of a team, that searches for actions by simulating the game.

    Each iteration samples a world of a `Model`, and plays `depth` turns in it. Each agent of the team has its own tree;
    a node stands for the actions and observations of the agent. All agents choose simultaneously by UCT or Exp3, on
    their own gains: decoupled search for simultaneous moves (Tak, Lanctot, Winands: Monte Carlo tree search variants
    for simultaneous move games, CIG 2014; Lanctot, Lisy, Winands: Monte Carlo tree search in simultaneous move games
    with applications to Goofspiel, 2014), with trees of information sets (Cowling, Powley, Whitehouse: Information set
    Monte Carlo tree search, 2012). Below its tree an agent follows the rollout policy. At a node with n visits it
    chooses among sqrt(n) actions, the policy's action first (progressive widening; Coulom: Computing Elo ratings of
    move patterns in the game of Go, 2007).

    For the current turn, the agents try their actions one agent after another. Each alternative action is compared with
    the policy's action in the same worlds, so that draws and hidden positions are equal in both (Tesauro, Galperin:
    On-line policy improvement using Monte Carlo search, NIPS 1996). Meanwhile the others take the best actions found so
    far (Bertsekas: Multiagent reinforcement learning: rollout and policy iteration, 2021). With Exp3 all agents try
    their actions at once.

    The gain of an iteration is the growth of the team's lead (`Model.lead`), with later points discounted, plus the
    `value` at its end.

    With a limit on iterations alone, the same seed gives the same actions; with a limit on seconds, the result depends
    on the machine. The search starts no step that would end late, judging by the duration of earlier steps, including
    those of earlier decisions.

    Args:
        iterations: the number of iterations; None: 200, or as many as fit into `seconds`.
        seconds: the time for a decision; None: no limit.
        depth: the number of turns of an iteration.
        rollout: the policy of the own team below its trees, and of teammates that decide by themselves.
        opponents: the policy of the others; "search": they search as well, for the worst outcome for the team, and move
            at random below their trees.
        value: the value of the model at the end of an iteration for the team, besides its points, such as
            `gamms.planning.closeness`; None: 0.
        options: see `SearchOptions`.

    Raises:
        BadType, BadValue: an argument is impossible.
        UnknownName (KeyError): an option does not exist.
    """
    check_options(options, SearchOptions)
    rest: dict[str, Any] = {name: one for name, one in options.items() if name in ModelOptions.__annotations__}
    are_searched = isinstance(opponents, str) and opponents == "search"
    worth = find_offered_function(value, "gamms.planning") if isinstance(value, str) else value
    if value is not None and not callable(worth):
        raise BadType(f"value is a function of the model, such as gamms.planning.closeness, not {shown(value)}.")
    for argument, policies in (("rollout", rollout), ("opponents", random_walk if are_searched else opponents)):
        for policy in policies.values() if isinstance(policies, Mapping) else [policies]:
            as_policy(policy, argument)
    actions = options.get("actions", _list_legal_actions)
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
    settings = _SearchSettings(
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

    return _make_strategy(settings)


def _make_strategy(settings: _SearchSettings) -> Callable[[States], None]:
    """Return the strategy, or plan, for checked settings."""
    pace = SearchPace()
    limit = settings.seconds

    def mcts(states: States) -> None:
        # NOTE: garbage collection takes 50 to 80 ms on the map of a suburb: with a time limit, it waits until the
        # decision is made. Nothing may be allocated after this block, or the collection would begin here.
        with GarbagePause(is_wanted=limit < inf):
            given = list_states(states)
            timer = SearchTimer(limit, pace)
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
        pace.follow(ctx, {one.name: _make_policy(ctx, settings.rollout, one) for one in own})

    if limit < inf:
        mcts.__dict__["prepare"] = prepare
    return mcts


def _make_policy(ctx: Context, rollout: Policy | Mapping[Any, Policy], agent: IAgent) -> Strategy:
    """Return the strategy that an agent follows in the game if there is no time for a search."""
    if isinstance(rollout, Mapping) and agent.team not in rollout:
        raise UnknownName("team in rollout=", agent.team, rollout)
    function = as_policy(rollout[agent.team] if isinstance(rollout, Mapping) else rollout, "rollout")
    return cast("Strategy", make_strategy(ctx, function))


def _warm_up(ctx: Context, first: IAgent, settings: _SearchSettings, pace: SearchPace, *, is_plan: bool) -> None:
    """Search twice in a fork before the first decision, to load libraries and make tables ahead of it."""
    fork, copies = ctx.game.internals.fork(0)
    game = fork.game
    game.configure({"plans": {}, "max_turns": None, "deadline_s": None, "time_budget": None})
    once = settings._replace(
        iterations=1,
        seconds=inf,
        rollout=_bind_policies(settings.rollout, copies),
        opponents=_bind_policies(settings.opponents, copies),
    )

    def look(states: States) -> None:
        _Search(once, pace, SearchTimer(inf, pace), list_states(states)).decide()

    for agent in game.ctx.agent.create_iter():
        agent.register_strategy(random_walk)
    if is_plan:
        game.command(first.team, look)
    else:
        game.ctx.agent.get_agent(first.name).register_strategy(look)
    game.run(2)


def _bind_policies(policies: Policy | Mapping[Any, Policy], copies: Memo) -> Policy | Mapping[Any, Policy]:
    """Return policies that use the context of a fork instead of the one that they were made for."""
    if isinstance(policies, Mapping):
        return {team: get_counterpart(policy, copies) for team, policy in policies.items()}
    return cast("Policy", get_counterpart(policies, copies))


def _list_legal_actions(state: State) -> Sequence[Action]:
    return state["legal"]


class _GainRange:
    """The range of gains in a search so far, used to scale gains to 0 to 1."""

    def __init__(self) -> None:
        self._least = inf
        self._most = -inf

    def add(self, gain: float) -> None:
        """Extend the range by a gain."""
        self._least = min(self._least, gain)
        self._most = max(self._most, gain)

    def share(self, gain: float) -> float:
        """Return the position of a gain in the range, from 0 to 1."""
        return (gain - self._least) / (self._most - self._least) if self._most > self._least else 0.5


class _TreeNode:
    """The knowledge of an agent at a point of an iteration, and the results of its actions there.

    Attributes:
        actions: the actions of the agent; None: not visited yet.
        counts, totals: the number of trials and the sum of gains of each action.
        weights: the weights of Exp3.
        children: (action, observation after it) -> the next node.
    """

    __slots__ = ("actions", "children", "counts", "totals", "weights")

    def __init__(self) -> None:
        self.actions: Sequence[Action] | None = None
        self.children: dict[Key, _TreeNode] = {}
        self.counts: list[int] = []
        self.totals: list[float] = []
        self.weights: list[float] = []

    def offer(self, actions: Sequence[Action]) -> None:
        """Set the actions of the agent, in the order in which it tries them."""
        self.actions = actions
        self.counts = [0] * len(actions)
        self.totals, self.weights = ([0.0] * len(actions) for _ in range(2))

    def choose_by_uct(self, known: _GainRange, draw: Draws) -> int:
        """Return the action with the highest upper bound, ties at random, among the first sqrt(n) after n visits."""
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

    def compute_chances(self) -> list[float]:
        """Return the probabilities with which Exp3 chooses each action."""
        highest = max(self.weights)
        number = len(self.weights)
        shares = [exp(_EXPLORED / number * (weight - highest)) for weight in self.weights]
        total = sum(shares)
        return [(1.0 - _EXPLORED) * share / total + _EXPLORED / number for share in shares]

    def draw_by_trials(self, chance: float) -> int:
        """Return an action drawn in proportion to its trials, without the share that Exp3 explores at random."""
        number = len(self.counts)
        tries = sum(self.counts)
        shares = [max(0.0, one - tries * _EXPLORED / number) for one in self.counts]
        return _draw_index(shares if any(shares) else [1.0] * number, chance)


def _draw_index(shares: Sequence[float], chance: float) -> int:
    """Return the index drawn from weights by a number from 0 to 1."""
    left = chance * sum(shares)
    for number, share in enumerate(shares):
        left -= share
        if left < 0.0:
            return number
    return max(number for number, share in enumerate(shares) if share)


class _PairedTrials:
    """The gains of each action over the policy's action, in the same worlds.

    Args:
        actions: the number of actions; the first is the policy's.
    """

    def __init__(self, actions: int) -> None:
        self.counts = [0] * actions
        self._totals = [0.0] * actions
        self._squares = 0.0

    def note(self, action: int, gain: float) -> None:
        """Add the gain of an action over the policy's action in a world."""
        self.counts[action] += 1
        self._totals[action] += gain
        self._squares += gain * gain

    def choose_next(self) -> int:
        """Return the action other than the first with the highest upper bound; untried actions come first."""
        rest = range(1, len(self.counts))
        untried = [action for action in rest if not self.counts[action]]
        if untried:
            return untried[0]
        tries = sum(self.counts)
        spread = sqrt(self._squares / tries)
        explore = _EXPLORATION * sqrt(log(tries))
        return max(rest, key=lambda one: self._compute_mean(one) + spread * explore / sqrt(self.counts[one]))

    def choose_best(self, confidence: float) -> int:
        """Return the action with the highest lower bound of its mean, or the first if no other is clearly better.

        Args:
            confidence: the number of standard errors by which another action has to be better than the first.
        """
        tries = sum(self.counts)
        spread = sqrt(self._squares / max(tries, 1))
        best = 0
        most = 0.0
        for action in range(1, len(self.counts)):
            margin = self._compute_mean(action) - confidence * spread / sqrt(max(self.counts[action], 1))
            if margin > most:
                best = action
                most = margin
        return best

    def _compute_mean(self, action: int) -> float:
        return self._totals[action] / max(self.counts[action], 1)


class _TreeWalker:
    """An agent in one iteration, on its way down its tree.

    Args:
        search: the search, with its settings and the gains so far.
        roots: initial observation -> root of the tree; an agent that decides has a single root under ().
        policy: the policy of the agent below its tree.
        first: the first action of an agent whose actions are tried one by one.
        is_own: whether the agent is one that decides.
    """

    def __init__(
        self, search: "_Search", roots: dict[Key, _TreeNode], policy: Strategy, *, first: int | None, is_own: bool
    ) -> None:
        self._search = search
        self._branch = roots
        self._policy = policy
        self._first = first
        self._is_own = is_own
        self._action: int | None = None  # its last action; None: it is at the root
        self._has_left = False  # whether it is below its tree
        self.visits: list[tuple[int, _TreeNode, int, float]] = []  # turn, node, action and the action's probability

    def __call__(self, state: State) -> Action | None:
        """Return the agent's action in the tree; None below it."""
        if self._has_left:
            return None
        key = () if self._is_own and self._action is None else (self._action, *_observe_state(state))
        node = self._branch.get(key)
        settings = self._search.settings
        if node is None:
            self._has_left = self._action is not None  # an iteration adds one node, besides the root
            node = _TreeNode()
            self._branch[key] = node
            if self._has_left:
                return None
        if node.actions is None:
            node.offer(self._order_actions(state))
        if not node.actions:
            self._has_left = True
            return None
        chance = 1.0
        if self._action is None and self._first is not None:
            action = self._first
        elif settings.is_uct:
            action = node.choose_by_uct(self._search.known, state["draw"])
        else:
            chances = node.compute_chances()
            action = _draw_index(chances, state["draw"].random())
            chance = chances[action]
        self.visits.append((self._search.turn, node, action, chance))
        self._branch = node.children
        self._action = action
        return node.actions[action]

    def _order_actions(self, state: State) -> list[Action]:
        """Return the actions to search: the policy's first, the others in random order."""
        rest = list(self._search.settings.actions(state))
        draw = state["draw"]
        actions = [rest.pop(draw.below(len(rest))) for _ in range(len(rest))]
        self._policy(state)
        return _put_policy_first(actions, state.pop("action", None))


def _list_options(settings: _SearchSettings, state: State) -> list[Action]:
    """Return the actions to search.

    Raises:
        BadType, BadValue: there are no actions.
    """
    actions = as_items(settings.actions(state), "The result of actions(state)", "actions")
    if actions:
        return actions
    name = shown(state.get("name"))
    if settings.actions is _list_legal_actions:
        raise BadValue(
            f"mcts has no action to choose for agent {name}: it searches state['legal'], which agents that fly do not "
            "have. Give actions=, a function of the state."
        )
    raise BadValue(f"actions(state) returns no action for agent {name}: return at least one, such as state['legal'].")


def _put_policy_first(actions: Sequence[Action], first: Action | None) -> list[Action]:
    """Return the actions to search, the policy's first."""
    ordered = list(actions)
    if first in ordered:
        ordered.remove(first)
        ordered.insert(0, first)
    return ordered


def _observe_state(state: State) -> Key:
    """Return the agent's observation of others, and its own position."""
    seen = [sorted(data.items()) for kind, data in state["sensor"].values() if kind in ON_GROUND]
    return (state["curr_pos"], *chain.from_iterable(seen))


class _Search:
    """A search for the actions of one turn.

    Args:
        settings: the settings of the strategy.
        pace: the duration of steps in earlier decisions.
        timer: started when the strategy was called.
        states: the argument of the strategy or plan.

    Attributes:
        settings: the argument `settings`.
        known: the range of gains so far.
        turn: the turn of the current iteration, from 0.
    """

    def __init__(
        self, settings: _SearchSettings, pace: SearchPace, timer: SearchTimer, states: Mapping[str, State]
    ) -> None:
        self.settings = settings
        self.known = _GainRange()
        self.turn = 0
        self._timer = timer
        self._model = Model(
            states, seed=settings.seed, rollout=settings.rollout, opponents=settings.opponents, **settings.options
        )
        self._own: dict[str, dict[Key, _TreeNode]] = {name: {} for name in self._model.states}
        self._actions: dict[str, list[Action]] = {}
        self._has_searched: dict[str, bool] = {}  # for agents with more than one action
        preferred = self._model.decide()
        for name, state in self._model.states.items():
            actions = _list_options(settings, state)
            self._actions[name] = _put_policy_first(actions, preferred[name])
            root = _TreeNode()
            self._own[name][()] = root
            root.offer(self._actions[name])
        if not pace.has_policies(states := self._model.states):
            pace.follow(next(iter(states.values()))["fork"], self._model.policies)
        agents = self._model.ctx.agent.agents.items()
        others = [(name, one.team) for name, one in agents if name not in self._own]
        rivals = [name for name, team in others if team is None or team != self._model.team]
        self._others: dict[str, dict[Key, _TreeNode]] = {name: {} for name in rivals if settings.are_searched}

    def decide(self) -> None:
        """Set the actions of all agents."""
        found = self._search_one_by_one() if self.settings.is_uct else self._search_together()
        fork: Any = next(iter(self._model.states.values()))["fork"]
        fork.note_search(self._has_searched)
        for name, action in found.items():
            self._model.states[name]["action"] = self._actions[name][action]

    def _search_together(self) -> dict[str, int]:
        """Return the actions of all agents, drawn in proportion to trials in which all agents chose at once."""
        for number in count():
            if number >= self.settings.iterations or self._iterate(number, {}) is None:
                break
        found = {}
        for name, state in self._model.states.items():
            key = kernels.compute_purpose_key(self.settings.seed, "mcts", state["turn"])
            chance = kernels.convert_to_fraction(kernels.draw_bits(key, kernels.compute_name_key(name), 0))
            root = self._own[name][()]
            found[name] = root.draw_by_trials(chance) if any(root.counts) else 0
            if len(root.counts) > 1:
                self._has_searched[name] = any(root.counts)
        return found

    def _search_one_by_one(self) -> dict[str, int]:
        """Return the actions of all agents, searched for one agent after another.

        In each world all agents first take the best actions found so far, which for agents not yet searched are the
        policy's. Then the agent takes another action instead, twice. The difference of the gains counts.
        """
        names = list(self._model.states)
        found = dict.fromkeys(self._model.states, 0)
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
            trials = _PairedTrials(len(self._actions[name]))
            if len(trials.counts) == 1:
                continue
            for world in count():
                if spent >= self.settings.iterations * number / len(names) or self._timer.is_past(number / len(names)):
                    break
                base = gain(world, found)
                for _ in range(_TRIED):
                    action = trials.choose_next()
                    other = gain(world, {**found, name: action})
                    if base is None or other is None:
                        break
                    trials.note(action, other - base)
                if base is None or other is None:
                    break
            found[name] = trials.choose_best(self.settings.confidence)
            self._has_searched[name] = any(trials.counts)
        return found

    def _iterate(self, number: int, first: Mapping[str, int]) -> float | None:
        """Play one iteration, and store and return its gain; if there is no time for it, store nothing and return None.

        Args:
            number: the number of the world.
            first: agent -> number of its first action; agents that are missing choose by themselves.
        """
        model = self._model
        rewards = list[float]()
        timer = self._timer
        if not timer.has_time("world"):
            return None
        model.sample(number)
        policies = model.policies
        walkers = {
            name: _TreeWalker(self, roots, policies[name], first=first.get(name), is_own=True)
            for name, roots in self._own.items()
        }
        walkers |= {
            name: _TreeWalker(self, roots, policies[name], first=None, is_own=False)
            for name, roots in self._others.items()
        }
        lead = model.lead()
        for turn in range(self.settings.depth):
            self.turn = turn
            if not timer.has_time("turn", then="value"):
                return None
            model.play(1, walkers)
            before = lead
            lead = model.lead()
            rewards.append(lead - before)
            if model.is_over:
                break
        if not timer.has_time("value"):
            return None
        value = self.settings.value
        gains = [0.0 if value is None or model.is_over else as_float(value(model), "The result of value(model)")]
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
