"""Check that games with a rule or a strategy are reproducible, by playing them again and comparing."""

from collections.abc import Awaitable, Callable, Iterator, Mapping
from contextlib import contextmanager
from copy import deepcopy
from inspect import isawaitable
from typing import Any, cast

from gamms.arguments import as_function_of, names_keywords, signature_of
from gamms.context import Context
from gamms.game import IllegalMutation, Result
from gamms.game.hidden_state import HiddenState
from gamms.plain import why_not_plain
from gamms.readonly import ReadOnly
from gamms.typing import AerialStrategy, AsyncStrategy, IAgent, Rule, State, Strategy

_WHERE = "where (check)"  # the name of the collector
_ORDERS = (1, 2)  # seeds for shuffling agents
_OWN = (
    "action",
    "memory",
    "team_memory",
    "draw",
    "rng",
    "fork",
    "sensor",
)  # a sensor's data is fresh, and may be used up
_RULES_REMEMBER = "Keep it in ctx.game.data."
_STRATEGIES_REMEMBER = "Keep it in state['memory']."

_AnyStrategy = Strategy | AerialStrategy | AsyncStrategy
_Game = dict[str, Any]  # a result as plain values
_Actions = list[tuple[int, object]]  # turn and action


@names_keywords
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
    first = play.once()
    with _naming(hidden, _RULES_REMEMBER):
        for promise in (_restarts, _is_forgotten, _shares, _ignores_order, _restores):
            promise(play, first)


@names_keywords
def check_strategy(
    strategy: _AnyStrategy | None, make_ctx: Callable[[], Context], agent: str, *, turns: int = 30
) -> None:
    """Play games with a strategy for an agent repeatedly, and compare its actions.

    The check detects memory of the strategy outside of `state["memory"]` and `state["team_memory"]`, such as in a
    closure; draws other than from `state["rng"]` or the global generators that a game seeds; writes to its state other
    than `state["action"]` and the two memories; and illegal actions.

    Args:
        strategy: a function of the state, which may be asynchronous; None: the agent's own strategy.
        make_ctx: makes an identical context in each call, with a seed, a map, and agents with their strategies.
        agent: the name of the agent that plays with the strategy.
        turns: the number of turns of each game.

    Raises:
        AssertionError: the strategy breaks one of these rules; the message tells which, and how to fix it.
    """
    play = _RepeatableGame(make_ctx, None, turns)
    if strategy is not None:
        play.check_repeatable()
    with play.opened() as ctx:
        watched = _WatchedStrategy(ctx, agent, strategy)
        hidden = HiddenState(watched.strategy)
        first = watched.actions(turns)
        with _naming(hidden, _STRATEGIES_REMEMBER):
            ctx.game.reset()
            _same_actions("when the game is reset and played again", first, watched.actions(turns))
            ctx.game.reset()
            watched.actions(turns // 2)
            half = ctx.game.snapshot()
            rest = watched.actions(turns - turns // 2)
            ctx.game.restore(half)
            _same_actions("when the game is restored and played on", rest, watched.actions(turns - turns // 2))
            with play.opened() as new:
                again = _WatchedStrategy(new, agent, strategy).actions(turns)
                _same_actions("in a new game of the same seed", first, again)


@contextmanager
def _naming(hidden: HiddenState, way_out: str) -> Iterator[None]:
    """Name a changed hidden variable, in addition to another error or as the only one."""
    changed = hidden.changed(way_out)
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
    def opened(self, *, with_rule: bool = True, **keywords: int) -> Iterator[Context]:
        """Make a context with the rule, ready to be played."""
        with self.make_ctx(**keywords) as ctx:
            if ctx.is_terminated():
                raise AssertionError("make_ctx must make a new context at every call; this one has ended already.")
            if not ctx.is_seeded:
                raise AssertionError("make_ctx must give its context a seed: gamms.create_context(seed=…).")
            ctx.game.collect(_WHERE, _place_of, per="agent")
            if with_rule and self._rule is not None:
                ctx.game.add(self._rule)
            yield ctx

    def once(self, *, with_rule: bool = True, **keywords: int) -> _Game:
        """Play a new game and return its result."""
        with self.opened(with_rule=with_rule, **keywords) as ctx:
            return _played(ctx, self.turns)

    def check_repeatable(self) -> None:
        """Check that `make_ctx` makes the same game twice."""
        one = self.once(with_rule=False)
        other = self.once(with_rule=False)
        if one != other:
            raise AssertionError(
                "make_ctx must always make the same game, and two that it made went differently: "
                f"{_first_difference(one, other)} Do its strategies draw from state['rng']?"
            )


def _played(ctx: Context, turns: int) -> _Game:
    """Play on, and return the result without its timings."""
    return _plain(ctx.game.run(turns))


def _plain(result: Result) -> _Game:
    found = result.to_dict()
    del found["timings"]
    return found


def _first_difference(one: _Game, other: _Game) -> str:
    """Return a sentence about the first difference between two games."""
    seen = [_by_turn(game["collected"][_WHERE]) for game in (one, other)]
    for turn in sorted(seen[0].keys() & seen[1].keys()):
        for agent in sorted(seen[0][turn].keys() | seen[1][turn].keys()):
            before, now = (places[turn].get(agent, "gone") for places in seen)
            if before != now:
                return f"after turn {turn}, agent {agent!r} is at {now}, and was at {before}."
    for key in one:
        if one[key] != other[key]:
            return f"its {key} is {_short(other[key])}, and was {_short(one[key])}."
    return ""


def _place_of(agent: IAgent) -> object:
    return getattr(agent, "position", agent.current_node_id)


def _by_turn(table: Mapping[str, Any]) -> dict[int, dict[str, object]]:
    places: dict[int, dict[str, object]] = {}
    for turn, agent, place in zip(table["turn"], table["agent"], table["value"], strict=True):
        places.setdefault(turn, {})[agent] = place
    return places


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 120 else text[:117] + "..."


# -- rules ------------------------------------------------------------------------------------------------------


def _restarts(play: _RepeatableGame, first: _Game) -> None:
    with play.opened() as ctx:
        ctx.game.run(play.turns)
        flaw = why_not_plain(dict(ctx.game.data))
        if flaw:
            raise AssertionError(f"ctx.game.data holds plain values only; ctx.game.data{flaw}. Keep names of agents.")
        ctx.game.reset()
        again = _played(ctx, play.turns)
    _same_game(
        "a game that is reset and played again",
        again,
        first,
        "Keep what the rule remembers in ctx.game.data, and draw from ctx.stream(name, ctx.game.turn).",
    )


def _restores(play: _RepeatableGame, first: _Game) -> None:
    with play.opened() as ctx:
        ctx.game.run(play.turns // 2)
        half = ctx.game.snapshot()
        ctx.game.run(play.turns - play.turns // 2)
        ctx.game.restore(half)
        again = _played(ctx, play.turns - play.turns // 2)
    _same_game(
        "a game that is restored from a snapshot and played on",
        again,
        first,
        "The rule remembers turns that are undone: keep that in ctx.game.data.",
    )


def _is_forgotten(play: _RepeatableGame, first: _Game) -> None:
    _same_game(
        "a new game with the same rule",
        play.once(),
        first,
        "The rule remembers earlier games: keep that in ctx.game.data, not in a global, a default or a closure.",
    )


def _shares(play: _RepeatableGame, first: _Game) -> None:
    with play.opened() as one, play.opened() as other:
        for _ in range(play.turns):
            one.game.run(1)
            other.game.run(1)
        _same_game(
            "a game that takes turns with another one of the same rule",
            _played(one, 0),
            first,
            "The rule mixes games up: keep what it remembers in the ctx.game.data of the context it is called with.",
        )


def _ignores_order(play: _RepeatableGame, first: _Game) -> None:
    if "shuffled" not in signature_of(play.make_ctx).parameters:
        return
    for seed in _ORDERS:
        _same_game(
            f"the game with the agents created in another order (shuffled={seed})",
            play.once(shuffled=seed),
            first,
            "Go through ctx.game.agents, which is in the order of the names, and judge all before moving any.",
        )


def _same_game(what: str, seen: _Game, promised: _Game, advice: str) -> None:
    if seen != promised:
        raise AssertionError(f"{what} went differently: {_first_difference(promised, seen)} {advice}")


# -- strategies -------------------------------------------------------------------------------------------------


class _WatchedStrategy:
    """A strategy under test, wrapped to record its actions.

    Attributes:
        strategy: the strategy.
    """

    def __init__(self, ctx: Context, agent: str, strategy: _AnyStrategy | None) -> None:
        self._ctx = ctx
        self._agent = ctx.agent.get_agent(agent)
        self.strategy = cast("Strategy", self._agent.strategy if strategy is None else strategy)
        if self.strategy is None:
            raise AssertionError(f"Agent {agent!r} has no strategy to check: make_ctx must give it one.")
        self._actions: _Actions = []
        self._agent.register_strategy(cast("Strategy", self._play))
        ctx.game.on_error = "raise"

    def actions(self, turns: int) -> _Actions:
        """Play on, and return (turn, action) of each decision."""
        self._actions = []
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
        return self._actions

    def _play(self, given: State) -> Awaitable[None] | None:
        state = cast("dict[str, Any]", given)
        before = dict(state)
        copies = {key: deepcopy(value) for key, value in state.items() if key not in (*_OWN, "facts")}
        turn = f"in turn {state['turn']} the strategy of agent {self._agent.name!r}"
        with _raising(turn):
            answer: object = self.strategy(given)

        def note() -> None:
            for key in dict.fromkeys([*before, *state]):
                _refuse_writing(turn, key, before, state, copies)
            self._actions.append((state.get("turn", -1), _copied(state.get("action"))))

        async def note_later(answer: Awaitable[None]) -> None:
            with _raising(turn):
                await answer
            note()

        if isawaitable(answer):
            return note_later(answer)
        note()
        return None


@contextmanager
def _raising(turn: str) -> Iterator[None]:
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


def _copied(action: object) -> object:
    """Return a copy of an action for comparisons: arrays become lists."""
    return action.tolist() if hasattr(action, "tolist") else deepcopy(action)


def _same_actions(when: str, first: _Actions, again: _Actions) -> None:
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
