"""Snapshots: a game at a moment, and how to restore it."""

from collections.abc import Callable
from copy import deepcopy
from typing import Any, NamedTuple, NoReturn, TypeVar

import numpy as np

from gamms.errors import BadType, GammsError
from gamms.game.host import GameContext
from gamms.game.order import COUNTED
from gamms.game.random_streams import GlobalRandom
from gamms.game.result import Collectors
from gamms.game.ruleset import RuleSet
from gamms.game.settings import Settings
from gamms.game.turn import TurnEngine
from gamms.ir.agents import Position
from gamms.ir.game_state import GameState
from gamms.typing.agent_engine import IAgent

T = TypeVar("T")

_SCALARS = frozenset({str, bytes, int, float, bool, complex, type(None)})


class SnapshotError(GammsError, RuntimeError):
    """A snapshot cannot be taken or restored now."""


class Snapshot:
    """A game at a moment, from `ctx.game.snapshot()` for `ctx.game.restore`.

    Attributes:
        turn: the number of turns that were played.
        seed: of the context.
    """

    __slots__ = ("_of", "_parts", "_values", "seed", "turn")

    def __init__(self, turn: int, seed: int, of: GameState, values: dict[str, Any], parts: dict[str, Any]) -> None:
        self.turn, self.seed = turn, seed
        self._of, self._values, self._parts = of, values, parts

    def __repr__(self) -> str:
        """Show the turn and the seed."""
        return f"Snapshot(turn={self.turn}, seed={self.seed})"

    def place_of(self, agent: IAgent) -> int | Position:
        """Return where an agent was: a node id, or (x, y, z)."""
        place: int | Position = self._parts["agents"].place_of(agent)
        return place

    def __deepcopy__(self, memo: dict[int, Any]) -> "Snapshot":
        """Copy the snapshot together with the context that it is of."""
        of, values, parts = deepcopy((self._of, self._values, self._parts), memo)
        return Snapshot(self.turn, self.seed, of, values, parts)

    def __reduce__(self) -> NoReturn:
        """Refuse to be pickled."""
        raise BadType(
            "A snapshot cannot be pickled, because it refers to the agents and the graph of its context. To continue a "
            "game in another process, record it and use Recording.resume."
        )


class SnapshotTaker(NamedTuple):
    """The parts of a game of which snapshots are taken."""

    ctx: GameContext
    state: GameState
    settings: Settings
    rules: RuleSet
    collectors: Collectors
    turns: TurnEngine
    global_random: GlobalRandom

    def take(self) -> Snapshot:
        """Take a snapshot."""
        ctx, state = self.ctx, self.state
        parts = {
            "turns": self.turns.snapshot(),  # first: it brings the counts up to date
            "agents": ctx.agent.storage.snapshot(),
            "world": ctx.graph.storage.snapshot(),
            "sensors": ctx.sensor.storage.snapshot(),
            "settings": self.settings.settings(),
            "rules": self.rules.rules,
            "collectors": self.collectors.snapshot(),
            "events": state.event_history.mark(state.events),
            "errors": state.error_history.mark(state.errors),
            "global_random": self.global_random.snapshot(),
            "is_seeded": ctx.is_seeded,
            "rng": ctx.rng_state(),
        }
        return Snapshot(state.turn, ctx.seed, state, {name: copy(getattr(state, name)) for name, copy in _PARTS}, parts)

    def belongs_here(self, snapshot: Snapshot) -> bool:
        """Return whether a snapshot is of this game."""
        return snapshot._of is self.state

    def restore(self, snapshot: Snapshot, *, forget: bool = False) -> None:
        """Restore everything but the random streams; with `forget`, sensors forget what they have sensed."""
        ctx, state, parts = self.ctx, self.state, snapshot._parts
        ctx.graph.storage.restore(parts["world"])
        ctx.agent.storage.restore(parts["agents"])
        ctx.sensor.storage.restore(parts["sensors"], forget=forget)
        if self.settings.settings() != parts["settings"]:
            self.settings.configure(parts["settings"])
        if self.rules.rules is not parts["rules"]:
            self.rules.restore(parts["rules"])
        self.collectors.restore(parts["collectors"])
        self._restore_state(snapshot._values)
        state.event_history.go_to(state.events, parts["events"])
        state.error_history.go_to(state.errors, parts["errors"])
        self.turns.restore(parts["turns"])

    def _restore_state(self, values: dict[str, Any]) -> None:
        """Set the fields of the state; a dict of which others hold a reference is written to."""
        state = self.state
        for name in _VALUES:
            setattr(state, name, values[name])
        for name, copy in _REPLACED:
            setattr(state, name, copy(values[name]))
        for name, copy in _REFERRED:
            known = getattr(state, name)
            known.clear()
            known.update(copy(values[name]))
        _put_each(state.counts, values["counts"], _NO_COUNTS)
        _put_each(state.memories, _copied_filled(values["memories"]), {})

    def restore_streams(self, snapshot: Snapshot) -> None:
        """Restore the seed and the random streams, before anything else."""
        ctx, parts = self.ctx, snapshot._parts
        if ctx.seed != snapshot.seed:
            self.state.stream_version += 1
        ctx.reseed(snapshot.seed, parts["rng"])
        ctx.is_seeded = parts["is_seeded"]
        self.global_random.restore(parts["global_random"])


def _put_each(known: dict[str, dict[Any, Any]], values: dict[str, dict[Any, Any]], default: dict[Any, Any]) -> None:
    for name, one in known.items():
        one.clear()
        one.update(values.get(name, default))
    for name in values.keys() - known.keys():
        known[name] = values[name]


def copied(value: object, memo: dict[int, Any] | None = None) -> Any:
    """Return a copy that shares nothing that can change, of the same shape: what is one object stays one.

    Args:
        value: what is copied.
        memo: what takes the place of which objects; see `copy.deepcopy`.
    """
    try:
        return _copied(value, set())
    except _Unusual:
        return deepcopy(value, memo)


class _Unusual(Exception):
    """A value is not made of plain values, or an object is in it twice."""


def _copied(value: object, seen: set[int]) -> Any:
    kind = type(value)
    if kind in _SCALARS:
        return value
    copy = _COPIES.get(kind)
    if copy is None or id(value) in seen:
        raise _Unusual
    seen.add(id(value))
    return copy(value, seen)


def _copied_dict(value: dict[Any, Any], seen: set[int]) -> dict[Any, Any]:
    return {key: one if type(one) in _SCALARS else _copied(one, seen) for key, one in value.items()}


def _copied_list(value: list[Any], seen: set[int]) -> list[Any]:
    return [one if type(one) in _SCALARS else _copied(one, seen) for one in value]


def _copied_tuple(value: tuple[Any, ...], seen: set[int]) -> tuple[Any, ...]:
    return tuple([one if type(one) in _SCALARS else _copied(one, seen) for one in value])


def _copied_set(value: set[Any], _seen: set[int]) -> set[Any]:
    return value.copy()  # what can be in a set does not change


def _copied_array(value: "np.ndarray[Any, Any]", _seen: set[int]) -> "np.ndarray[Any, Any]":
    if value.dtype.hasobject or value.base is not None:
        raise _Unusual
    return value.copy()


_COPIES: dict[type, Callable[[Any, set[int]], Any]] = {
    dict: _copied_dict,
    list: _copied_list,
    tuple: _copied_tuple,
    set: _copied_set,
    np.ndarray: _copied_array,
}


def _same(value: T) -> T:
    return value


def _copied_each(values: dict[Any, dict[Any, Any]]) -> dict[Any, dict[Any, Any]]:
    return {key: one.copy() for key, one in values.items()}


def _copied_filled(memories: dict[str, dict[Any, Any]]) -> dict[str, dict[Any, Any]]:
    return {name: copied(memory) for name, memory in memories.items() if memory}


_Copy = Callable[[Any], Any]

_NO_COUNTS = dict.fromkeys(COUNTED, 0)
_VALUES = ("turn", "last_turn", "start", "has_begun", "moves")  # fields of the state that are no containers
_REPLACED: tuple[tuple[str, _Copy], ...] = (
    ("over", copied),
    ("team_memories", copied),
    ("players", dict),
    ("began", dict),
)
_REFERRED: tuple[tuple[str, _Copy], ...] = (("scores", dict), ("facts", dict), ("timings", dict), ("data", copied))
_PARTS: tuple[tuple[str, _Copy], ...] = (  # all fields that are copied
    *[(name, _same) for name in _VALUES],
    *_REPLACED,
    *_REFERRED,
    ("memories", _copied_filled),
    ("counts", _copied_each),
)
