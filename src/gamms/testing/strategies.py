"""Does a strategy play fair: the same actions every time, and nothing changed but what is its own?"""

from collections.abc import Callable
from copy import deepcopy
from typing import Any

from gamms.game import IllegalMutation
from gamms.readonly import ReadOnly
from gamms.testing.games import Play

_OWN = ("action", "memory", "team_memory", "draw", "rng", "sensor")  # a sensor's data is fresh, and may be used up


def check_strategy(
    strategy: Callable[[dict[str, Any]], Any] | None, make_ctx: Callable[[], Any], agent: str, *, turns: int = 30
) -> None:
    """Let an agent play with a strategy, again and again, and see to it that it does the same every time.

    It finds what a strategy remembers elsewhere than in `state["memory"]` and `state["team_memory"]`, what it draws
    otherwise than from `state["rng"]` or the global generators that a game seeds, what it writes into its state beside
    `state["action"]` and the two memories, and actions that are not legal.

    Args:
        strategy: a function of the state; None takes the one that the agent has.
        make_ctx: makes a context, always the same, with a seed, a map, and agents with their strategies.
        agent: the name of the one that is to play with it.
        turns: how long each game is played.

    Raises:
        AssertionError: it does not keep to one of these; the message says which, and what to do about it.
    """
    play = Play(make_ctx, None, turns)
    if strategy is not None:
        play.trust()
    with play.opened() as ctx:
        watched = _Watched(ctx, agent, strategy)
        first = watched.actions(turns)
        ctx.game.reset()
        _same("when the game is reset and played again", first, watched.actions(turns))
    with play.opened() as ctx:
        _same("in a new game of the same seed", first, _Watched(ctx, agent, strategy).actions(turns))


class _Watched:
    """A strategy that an agent plays with, and what it does."""

    def __init__(self, ctx: Any, agent: str, strategy: Callable[[dict[str, Any]], Any] | None) -> None:
        self._ctx, self._agent = ctx, ctx.agent.get_agent(agent)
        self._strategy = self._agent.strategy if strategy is None else strategy
        if self._strategy is None:
            raise AssertionError(f"Agent {agent!r} has no strategy to check: make_ctx must give it one.")
        self._actions: list[tuple[int, Any]] = []
        self._agent.register_strategy(self._play)
        ctx.game.on_error = "raise"

    def actions(self, turns: int) -> list[tuple[int, Any]]:
        """Turn and action of a game that is played now."""
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

    def _play(self, state: dict[str, Any]) -> None:
        before = dict(state)
        kept = {key: deepcopy(value) for key, value in state.items() if key not in (*_OWN, "facts")}
        turn = f"in turn {state['turn']} the strategy of agent {self._agent.name!r}"
        try:
            self._strategy(state)
        except Exception as error:
            advice = " What is published in state['facts'] is read-only." if isinstance(error, ReadOnly) else ""
            raise AssertionError(f"{turn} raised {type(error).__name__}: {str(error).rstrip('.')}.{advice}") from error
        for key in dict.fromkeys([*before, *state]):
            _refuse_writing(turn, key, before, state, kept)
        self._actions.append((state.get("turn", -1), _shown(state.get("action"))))


def _refuse_writing(turn: str, key: str, before: dict[str, Any], state: dict[str, Any], kept: dict[str, Any]) -> None:
    """Raise if a key is not as it was and should be."""
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
    if key not in _OWN and (state[key] is not before[key] or (key in kept and state[key] != kept[key])):
        raise AssertionError(f"{turn} changed state[{key!r}] to {state[key]!r}; only state['action'] is its to set.")


def _shown(action: Any) -> Any:
    """An action that can be compared: arrays become lists."""
    return action.tolist() if hasattr(action, "tolist") else deepcopy(action)


def _same(when: str, first: list[tuple[int, Any]], again: list[tuple[int, Any]]) -> None:
    for (turn, action), (_, other) in zip(first, again, strict=False):
        if action != other:
            raise AssertionError(
                f"{when}, the strategy chose {other!r} in turn {turn}, where it had chosen {action!r}. Draw from "
                "state['rng'], keep what it remembers in state['memory'], and sort sets before choosing from them."
            )
    if len(first) != len(again):
        raise AssertionError(
            f"{when}, it was asked {len(again)} times, not {len(first)}: somebody else plays differently."
        )
