"""Check rules and strategies by playing games again and comparing.

Games have to be reproducible, and a strategy may decide only by what its agent knows.
"""

import random
import sys
from collections.abc import Awaitable, Callable, Hashable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from copy import deepcopy
from functools import partial
from hashlib import sha256
from inspect import isawaitable
from typing import Any, NamedTuple, cast

import numpy as np

from gamms.arguments import as_flag, as_function_of, explain_call_errors, find_signature
from gamms.context import Context
from gamms.deciding import get_phase
from gamms.game import IllegalMutation, Result
from gamms.game.hidden_state import HiddenState
from gamms.plain import describe_flaw
from gamms.readonly import ReadOnly
from gamms.typing import AerialStrategy, AsyncStrategy, IAgent, Rule, State, Strategy

_WHERE = "where (check)"  # the name of the collector
_ORDERS = (1, 2)  # seeds for shuffling agents
_OWN = (
    "action",
    "memory",
    "team_memory",
    "outbox",
    "draw",
    "rng",
    "fork",
    "sensor",
)  # a sensor's data is fresh, and may be used up
_RULES_REMEMBER = "Keep it in ctx.game.data."
_STRATEGIES_REMEMBER = "Keep it in state['memory']."

_TWIN_TURNS = 2  # a leak by way of another agent's strategy may take a turn
_MOST_TWINS = 4  # with one kind of change, in each turn
_UNCOMPARED = frozenset({"action", "rng", "draw", "fork"})  # what these are going to give is not shown by their text

_AnyStrategy = Strategy | AerialStrategy | AsyncStrategy
_Game = dict[str, Any]  # a result as plain values
_Actions = list[tuple[int, object]]  # turn and action
_Change = Callable[[dict[str, Any]], None]  # of the state of an agent


@explain_call_errors
def check_rule(rule: Rule, make_ctx: Callable[..., Context], *, turns: int = 30) -> None:
    """Play games with a rule repeatedly, and compare them.

    The check detects memory of the rule outside of `ctx.game.data`, such as in a closure; draws other than from
    `ctx.stream`; values in `ctx.game.data` that are not plain; and results that depend on the order in which agents
    were created.

    Args:
        rule: the rule, as for `ctx.game.add`.
        make_ctx: makes an identical context in each call, with a seed, a map and agents to which the rule applies, but
            without the rule. If it takes the keyword `shuffled`, it is also called with a seed for shuffling the order
            in which the agents are created, for example with `random.Random(shuffled).shuffle(names)`; None keeps the
            order.
        turns: the number of turns of each game.

    Raises:
        AssertionError: a game went differently; the message tells which, and how to fix it.
        BadType: `rule` is not a function of the context.
    """
    as_function_of(rule, "A rule", "the context")
    play = _RepeatableGame(make_ctx, rule, turns)
    play.check_repeatable()
    hidden = HiddenState(rule)
    first = play.play_once()
    with _report_hidden_state(hidden, _RULES_REMEMBER):
        for promise in (_check_restart, _is_forgotten, _check_sharing, _check_order, _check_restore):
            promise(play, first)


@explain_call_errors
def check_strategy(
    strategy: _AnyStrategy | None,
    make_ctx: Callable[[], Context],
    agent: str,
    *,
    turns: int = 30,
    knowledge: bool = True,
) -> None:
    """Play games with a strategy for an agent repeatedly, and compare its actions.

    The check detects memory of the strategy outside of `state["memory"]` and `state["team_memory"]`, such as in a
    closure; draws other than from `state["rng"]` or the global generators that a game seeds; writes to its state other
    than `state["action"]` and the two memories; illegal actions; and decisions by what the agent cannot know.

    For the last, each turn is also played in twin games. They differ from the game only in the places of agents of
    other teams, their draws, the messages that they send and receive, or the facts that were published to them. Where
    the state of the agent, the scores, the public facts and the map are the same, its decision has to be the same.

    Args:
        strategy: a function of the state, which may be asynchronous; None: the agent's own strategy.
        make_ctx: makes an identical context in each call, with a seed, a map, and agents with their strategies.
        agent: the name of the agent that plays with the strategy.
        turns: the number of turns of each game.
        knowledge: whether to play twin games; False for a strategy that is meant to know more than its agent.

    Raises:
        AssertionError: the strategy breaks one of these rules, or the game did not ask it; the message tells which, and
            how to fix it.
        BadType: an argument has another type.
    """
    is_audited = as_flag(knowledge, "knowledge")
    play = _RepeatableGame(make_ctx, None, turns)
    if strategy is not None:
        as_function_of(strategy, "A strategy", "the state")
        play.check_repeatable()
    with play.open_game() as ctx:
        watched = _WatchedStrategy(ctx, agent, strategy)
        hidden = HiddenState(watched.strategy)
        first = watched.list_actions(turns)
        if not first:
            raise AssertionError(watched.explain_silence(turns))
        with _report_hidden_state(hidden, _STRATEGIES_REMEMBER):
            ctx.game.reset()
            _check_same_actions("when the game is reset and played again", first, watched.list_actions(turns))
            ctx.game.reset()
            watched.list_actions(turns // 2)
            half = ctx.game.snapshot()
            rest = watched.list_actions(turns - turns // 2)
            ctx.game.restore(half)
            _check_same_actions(
                "when the game is restored and played on", rest, watched.list_actions(turns - turns // 2)
            )
            with play.open_game() as new:
                again = _WatchedStrategy(new, agent, strategy).list_actions(turns)
                _check_same_actions("in a new game of the same seed", first, again)
    if is_audited:
        with play.open_game() as ctx:
            _KnowledgeAudit(ctx, agent, strategy).check(turns)


@contextmanager
def _report_hidden_state(hidden: HiddenState, way_out: str) -> Iterator[None]:
    """Name a changed hidden variable, in addition to another error or as the only one."""
    changed = hidden.describe_change(way_out)
    try:
        yield
    except AssertionError as error:
        raise AssertionError(f"{error} {changed}".rstrip()) from error
    if changed:
        raise AssertionError(changed)


# -- games ------------------------------------------------------------------------------------------------------


class _RepeatableGame:
    """A game that can be played repeatedly from the beginning.

    Attributes:
        make_ctx: makes the context.
        turns: the number of turns.
    """

    def __init__(self, make_ctx: Callable[..., Context], rule: Rule | None, turns: int) -> None:
        self.make_ctx = make_ctx
        self.turns = turns
        self._rule = rule

    @contextmanager
    def open_game(self, *, with_rule: bool = True, **keywords: int) -> Iterator[Context]:
        """Make a context with the rule, ready to be played."""
        with self.make_ctx(**keywords) as ctx:
            if ctx.is_terminated():
                raise AssertionError("make_ctx must make a new context at every call; this one has ended already.")
            if not ctx.is_seeded:
                raise AssertionError("make_ctx must give its context a seed: gamms.create_context(seed=…).")
            ctx.game.collect(_WHERE, _find_place, per="agent")
            if with_rule and self._rule is not None:
                ctx.game.add(self._rule)
            yield ctx

    def play_once(self, *, with_rule: bool = True, **keywords: int) -> _Game:
        """Play a new game and return its result."""
        with self.open_game(with_rule=with_rule, **keywords) as ctx:
            return _play_on(ctx, self.turns)

    def check_repeatable(self) -> None:
        """Check that `make_ctx` makes the same game twice."""
        one = self.play_once(with_rule=False)
        other = self.play_once(with_rule=False)
        if one != other:
            raise AssertionError(
                "make_ctx must always make the same game, and two that it made went differently: "
                f"{_find_first_difference(one, other)} Do its strategies draw from state['rng']?"
            )


def _play_on(ctx: Context, turns: int) -> _Game:
    """Play on, and return the result without its timings."""
    return _make_comparable(ctx.game.run(turns))


def _make_comparable(result: Result) -> _Game:
    found = result.to_dict()
    del found["timings"]
    return found


def _find_first_difference(one: _Game, other: _Game) -> str:
    """Return a sentence about the first difference between two games."""
    seen = [_group_by_turn(game["collected"][_WHERE]) for game in (one, other)]
    for turn in sorted(seen[0].keys() & seen[1].keys()):
        for agent in sorted(seen[0][turn].keys() | seen[1][turn].keys()):
            before, now = (places[turn].get(agent, "gone") for places in seen)
            if before != now:
                return f"after turn {turn}, agent {agent!r} is at {now}, and was at {before}."
    for key in one:
        if one[key] != other[key]:
            return f"its {key} is {_shorten(other[key])}, and was {_shorten(one[key])}."
    return ""


def _find_place(agent: IAgent) -> object:
    return getattr(agent, "position", agent.current_node_id)


def _group_by_turn(table: Mapping[str, Any]) -> dict[int, dict[str, object]]:
    places: dict[int, dict[str, object]] = {}
    for turn, agent, place in zip(table["turn"], table["agent"], table["value"], strict=True):
        places.setdefault(turn, {})[agent] = place
    return places


def _shorten(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 120 else text[:117] + "..."


# -- rules ------------------------------------------------------------------------------------------------------


def _check_restart(play: _RepeatableGame, first: _Game) -> None:
    with play.open_game() as ctx:
        ctx.game.run(play.turns)
        flaw = describe_flaw(dict(ctx.game.data))
        if flaw:
            raise AssertionError(f"ctx.game.data holds plain values only; ctx.game.data{flaw}. Keep names of agents.")
        ctx.game.reset()
        again = _play_on(ctx, play.turns)
    _check_same_game(
        "a game that is reset and played again",
        again,
        first,
        "Keep what the rule remembers in ctx.game.data, and draw from ctx.stream(name, ctx.game.turn).",
    )


def _check_restore(play: _RepeatableGame, first: _Game) -> None:
    with play.open_game() as ctx:
        ctx.game.run(play.turns // 2)
        half = ctx.game.snapshot()
        ctx.game.run(play.turns - play.turns // 2)
        ctx.game.restore(half)
        again = _play_on(ctx, play.turns - play.turns // 2)
    _check_same_game(
        "a game that is restored from a snapshot and played on",
        again,
        first,
        "The rule remembers turns that are undone: keep that in ctx.game.data.",
    )


def _is_forgotten(play: _RepeatableGame, first: _Game) -> None:
    _check_same_game(
        "a new game with the same rule",
        play.play_once(),
        first,
        "The rule remembers earlier games: keep that in ctx.game.data, not in a global, a default or a closure.",
    )


def _check_sharing(play: _RepeatableGame, first: _Game) -> None:
    with play.open_game() as one, play.open_game() as other:
        for _ in range(play.turns):
            one.game.run(1)
            other.game.run(1)
        _check_same_game(
            "a game that takes turns with another one of the same rule",
            _play_on(one, 0),
            first,
            "The rule mixes games up: keep what it remembers in the ctx.game.data of the context it is called with.",
        )


def _check_order(play: _RepeatableGame, first: _Game) -> None:
    if "shuffled" not in find_signature(play.make_ctx).parameters:
        return
    for seed in _ORDERS:
        _check_same_game(
            f"the game with the agents created in another order (shuffled={seed})",
            play.play_once(shuffled=seed),
            first,
            "Go through ctx.game.agents, which is in the order of the names, and judge all before moving any.",
        )


def _check_same_game(what: str, seen: _Game, promised: _Game, advice: str) -> None:
    if seen != promised:
        raise AssertionError(f"{what} went differently: {_find_first_difference(promised, seen)} {advice}")


# -- strategies -------------------------------------------------------------------------------------------------


class _Decision(NamedTuple):
    """A decision of a strategy under test.

    Attributes:
        turn: the number of turns played before it.
        action: the action.
        known: the state before the decision, the scores, the public facts and the hash of the map, as text.
        written: key of the state -> its value after the decision, as text.
    """

    turn: int
    action: object
    known: str
    written: dict[str, str]


class _WatchedStrategy:
    """A strategy under test, wrapped to record its decisions.

    Attributes:
        strategy: the strategy.
    """

    def __init__(self, ctx: Context, agent: str, strategy: _AnyStrategy | None) -> None:
        self._ctx = ctx
        self._agent = ctx.agent.get_agent(agent)
        self._hashed: tuple[tuple[int, int], str] | None = None  # revisions of the map, and its hash
        self.strategy = cast("Strategy", self._agent.strategy if strategy is None else strategy)
        if self.strategy is None:
            raise AssertionError(
                f"Agent {agent!r} has no strategy to check: make_ctx must give it one. A plan of its team is checked "
                "as a strategy, lambda state: plan({state['name']: state}), in a game without it."
            )
        self._decisions: list[_Decision] = []
        self._agent.register_strategy(cast("Strategy", _Wrapper(self._play, self.strategy)))
        ctx.game.on_error = "raise"

    def list_actions(self, turns: int) -> _Actions:
        """Play on, and return (turn, action) of each decision."""
        return [(one.turn, one.action) for one in self.decide(turns)]

    def decide(self, turns: int) -> list[_Decision]:
        """Play on, and return the decisions."""
        self._decisions = []
        try:
            result = self._ctx.game.run(turns)
        except IllegalMutation as error:
            raise AssertionError(str(error)) from error
        name = self._agent.name
        for wrong in result.errors:
            if wrong["agent"] == name:
                raise AssertionError(
                    f"in turn {wrong['turn']} the strategy of agent {name!r} did what is not legal: {wrong['message']} "
                    "Choose from state['legal']."
                )
        return self._decisions

    def explain_silence(self, turns: int) -> str:
        """Return the message about a strategy that the game never asked."""
        found = f"agent {self._agent.name!r} was not asked in {turns} turns, so nothing was checked: "
        if self._agent.team in self._ctx.game.plans:
            return (
                f"{found}the plan of team {self._agent.team!r} decides for it. Check the plan as a strategy, "
                "lambda state: plan({state['name']: state}), in a game without it."
            )
        return f"{found}it must be alive and able to decide, in a game of at least one turn."

    def _play(self, given: State) -> Awaitable[None] | None:
        state = cast("dict[str, Any]", given)
        before = {**state, "legal_edges": state["legal_edges"]}  # a state finds these when they are read
        copies = {key: deepcopy(value) for key, value in state.items() if key not in (*_OWN, "facts")}
        turn = f"in turn {state['turn']} the strategy of agent {self._agent.name!r}"
        known = repr((_describe(state), dict(self._ctx.game.scores), dict(self._ctx.game.facts), self._hash_map()))
        with _convert_errors(turn):
            answer: object = self.strategy(given)

        def note() -> None:
            for key in dict.fromkeys([*before, *state]):
                _refuse_writing(turn, key, before, state, copies)
            action = _copy_action(state.get("action"))
            self._decisions.append(_Decision(state.get("turn", -1), action, known, _describe(state)))

        async def note_later(answer: Awaitable[None]) -> None:
            with _convert_errors(turn):
                await answer
            note()

        if isawaitable(answer):
            return note_later(answer)
        note()
        return None

    def _hash_map(self) -> str:
        """Return the SHA-256 of the present map, which agents know."""
        graph = self._ctx.graph
        revisions = (graph.graph.revision, graph.obstacle_revision)
        if self._hashed is None or self._hashed[0] != revisions:
            with get_phase(self._ctx).suspend(changes_world=False):
                self._hashed = revisions, sha256(graph.storage.pack_savable()[0]).hexdigest()
        return self._hashed[1]


class _Wrapper:
    """A function in place of a strategy or plan, which the game prepares as before.

    Args:
        decide: the function.
        wrapped: the strategy or plan.
    """

    def __init__(self, decide: Callable[[Any], object], wrapped: object) -> None:
        self._decide = decide
        if hasattr(wrapped, "prepare"):
            self.prepare = wrapped.prepare

    def __call__(self, state: object) -> object:  # of a plan: the states of a team
        return self._decide(state)


@contextmanager
def _convert_errors(turn: str) -> Iterator[None]:
    """Turn errors of a strategy into errors of the check."""
    try:
        yield
    except Exception as error:
        advice = " What is published in state['facts'] is read-only." if isinstance(error, ReadOnly) else ""
        raise AssertionError(f"{turn} raised {type(error).__name__}: {str(error).rstrip('.')}.{advice}") from error


def _refuse_writing(turn: str, key: str, before: _Game, state: _Game, copies: _Game) -> None:
    """Raise if the strategy changed a key of its state that it may not change."""
    if key == "action":
        return
    if key not in before:
        raise AssertionError(
            f"{turn} put {key!r} into its state; what it wants to remember belongs in state['memory']."
        )
    if key not in state or (key in _OWN and state[key] is not before[key]):
        raise AssertionError(
            f"{turn} replaced or removed state[{key!r}]; write into it, as in state['memory']['x'] = 1."
        )
    if key not in _OWN and (state[key] is not before[key] or (key in copies and state[key] != copies[key])):
        raise AssertionError(f"{turn} changed state[{key!r}] to {state[key]!r}; only state['action'] is its to set.")


def _copy_action(action: object) -> object:
    """Return a copy of an action for comparisons: arrays become lists."""
    return action.tolist() if hasattr(action, "tolist") else deepcopy(action)


def _check_same_actions(when: str, first: _Actions, again: _Actions) -> None:
    for (turn, action), (_, other) in zip(first, again, strict=False):
        if action != other:
            raise AssertionError(
                f"{when}, the strategy chose {other!r} in turn {turn}, where it had chosen {action!r}. Draw from "
                "state['rng'], keep what it remembers in state['memory'], and sort sets before choosing from them."
            )
    if len(first) != len(again):
        raise AssertionError(
            f"{when}, it was asked {len(again)} times, not {len(first)}: another strategy plays differently."
        )


def _describe(state: Mapping[str, Any]) -> dict[str, str]:
    """Return the values of a state without its action and its streams, as text."""
    with np.printoptions(threshold=sys.maxsize, floatmode="unique"):
        return {key: repr(value) for key, value in state.items() if key not in _UNCOMPARED}


# -- knowledge --------------------------------------------------------------------------------------------------


class _KnowledgeAudit:
    """Plays twin games, which differ from a game only in what an agent cannot know.

    Args:
        ctx: the context of the game.
        agent: the name of the agent.
        strategy: its strategy; None: the one that it has.
    """

    def __init__(self, ctx: Context, agent: str, strategy: _AnyStrategy | None) -> None:
        self._ctx = ctx
        self._watched = _WatchedStrategy(ctx, agent, strategy)
        self._agent = agent
        self._team = ctx.agent.get_agent(agent).team
        self._changes: dict[str, Callable[[random.Random], None]] = {
            "the places of other agents": self._move_others,
            "the draws of other agents": lambda _: self._change_others(_draw_ahead, _keep),
            "the messages to other agents": lambda _: self._change_others(partial(_alter_bodies, "inbox"), _keep),
            "the messages of other agents": lambda _: self._change_others(_keep, partial(_alter_bodies, "outbox")),
            "the facts of other agents": self._change_facts,
        }
        self._change: tuple[_Change, _Change] = (_keep, _keep)  # of states of others, before and after they decide

    def _list_others(self) -> list[IAgent]:
        """Return the present agents that share no knowledge with the agent."""
        agents = [one for one in self._ctx.agent.create_iter() if one.name != self._agent]
        return [one for one in agents if self._team is None or one.team != self._team]

    def _wrap_others(self) -> None:
        """Wrap the strategies and plans of others, also of agents that the last turn created."""
        game = self._ctx.game
        for one in self._list_others():
            if one.strategy is not None and not isinstance(one.strategy, _Wrapper):
                one.register_strategy(cast("Strategy", self._wrap(one.strategy)))
        for team, plan in game.plans.items():
            is_own = team is not None and team == self._team
            if not (is_own or plan.arrays or isinstance(plan.function, _Wrapper)):
                game.command(team, cast("Any", self._wrap(plan.function, is_plan=True)))

    def check(self, turns: int) -> None:
        """Play a game, and twins from each of its turns.

        Raises:
            AssertionError: a decision differs from that in a twin, though the agent knew the same.
        """
        game = self._ctx.game
        for turn in range(turns):
            if game.is_over:
                return
            self._wrap_others()
            before = game.snapshot()
            decisions = self._watched.decide(_TWIN_TURNS)
            for kind, change in self._changes.items():
                for attempt in range(_MOST_TWINS):
                    game.restore(before)
                    change(random.Random(f"{turn} {kind} {attempt}"))  # noqa: S311 - for tests
                    if self._compare(kind, decisions):
                        break
            game.restore(before)
            self._watched.decide(1)

    def _compare(self, kind: str, decisions: Sequence[_Decision]) -> bool:
        """Play a twin as long as the agent knows the same; return whether it has decided at all."""
        try:
            twins = self._watched.decide(_TWIN_TURNS)
        except Exception:  # noqa: BLE001 - other strategies and rules, of users, may not be able to go on
            return False
        finally:
            self._change = (_keep, _keep)
        is_compared = False
        for one, twin in zip(decisions, twins, strict=False):
            if one.known != twin.known:
                break
            is_compared = True
            if (one.action, one.written) != (twin.action, twin.written):
                raise AssertionError(_tell_leak(kind, one, twin))
        return is_compared

    def _move_others(self, rng: random.Random) -> None:
        """Place other agents at or above random nodes; later attempts place fewer of them."""
        nodes = sorted(self._ctx.graph.graph.get_nodes())
        for one in self._list_others():
            if rng.random() < rng.choice((1.0, 0.5)):
                one.current_node_id = rng.choice(nodes)
                one.prev_node_id = one.current_node_id

    def _change_others(self, before: _Change, after: _Change) -> None:
        """Change the states of other agents before and after they decide."""
        self._change = (before, after)

    def _change_facts(self, _: random.Random) -> None:
        """Change the facts that were published to other agents and teams."""
        game = self._ctx.game
        others = self._list_others()
        teams: dict[Hashable, None] = dict.fromkeys(one.team for one in others if one.team is not None)
        names = {one.name for one in self._ctx.agent.create_iter()}  # no facts are published to a team of such a name
        for to in [*others, *(team for team in teams if team not in names)]:
            facts = game.facts_of(to)
            if facts:
                game.publish(to=to, **{name: _alter(value) for name, value in facts.items()})

    def _wrap(self, decide: object, *, is_plan: bool = False) -> _Wrapper:
        """Return a strategy or plan of others that decides in twin games by changed states."""

        async def change_later(answer: Awaitable[object], states: Sequence[_Game], after: _Change) -> None:
            await answer
            for state in states:
                after(state)

        def decide_by_changed(given: _Game) -> object:
            before, after = self._change
            states = [*given.values()] if is_plan else [given]
            for state in states:
                before(state)
            answer = cast("Callable[[_Game], object]", decide)(given)
            if isawaitable(answer):
                return change_later(answer, states, after)
            for state in states:
                after(state)
            return answer

        return _Wrapper(decide_by_changed, decide)


def _tell_leak(kind: str, one: _Decision, twin: _Decision) -> str:
    """Return the message about a decision by what the agent cannot know."""
    did = f"chose {twin.action!r}, where it had chosen {one.action!r}"
    changed = [key for key, value in twin.written.items() if value != one.written.get(key)]
    if changed:
        key = changed[0]
        had = _shorten(one.written.get(key))
        did = f"wrote {_shorten(twin.written[key])} into state[{key!r}], where it had written {had}"
    return (
        f"in turn {one.turn}, the strategy {did}, when only {kind} were changed and its state was the same. It "
        "knows more than its agent: decide by the state alone, and share by state['team_memory'] or messages. If it is "
        "meant to know more, check it with knowledge=False."
    )


def _keep(_: _Game) -> None:
    """Change nothing in a state."""


def _draw_ahead(state: _Game) -> None:
    """Draw once from the streams of a state."""
    for key in ("rng", "draw"):
        if key in state:
            state[key].random()


def _alter_bodies(box: str, state: _Game) -> None:
    """Change the bodies of the messages in a box of a state."""
    if box in state:
        state[box][:] = [{**one, "body": _alter(one["body"])} for one in state[box]]


def _alter(value: object) -> Any:
    """Return another value of the same kind."""
    if isinstance(value, bool):
        return not value
    if isinstance(value, int | float):
        return value + 1
    if isinstance(value, str):
        return f"{value}'"
    if isinstance(value, Mapping):
        return {key: _alter(one) for key, one in value.items()}
    if isinstance(value, Sequence):
        return [_alter(one) for one in value] or [0]
    return 0 if value is None else value
