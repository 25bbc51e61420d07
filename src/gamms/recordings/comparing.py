"""Where two recorded games part."""

from collections.abc import Iterator
from itertools import count
from typing import Any, NamedTuple

import numpy as np

from gamms.errors import BadType
from gamms.ir.packing import to_bytes
from gamms.recorder import Recording, RecordingError, State
from gamms.text import shown, written


class Difference(NamedTuple):
    """The first thing in which two games differ.

    Attributes:
        turn: after which they differ; 0: from the start.
        agent: whose field it is; None: the game's own.
        field: a column of `State.agents`; or "agents", "scores", "data", "over", "components", "events", "map" or
            "turns".
        first: the value in the first game.
        second: the value in the second.
    """

    turn: int
    agent: str | None
    field: str
    first: Any
    second: Any

    def __str__(self) -> str:
        """Say it in one line."""
        whose = "" if self.agent is None else f"agent {self.agent!r}, "
        pair = written(self.first), written(self.second)
        return f"Turn {self.turn}, {whose}{self.field}: {pair[0]} in the first, {pair[1]} in the second"


def first_difference(first: Recording, second: Recording) -> Difference | None:
    """The first thing in which two games differ; None if they are the same game.

    Their seeds, and who recorded them when, do not count.

    Raises:
        RecordingError (ValueError): one of them is damaged.
    """
    for one in (first, second):
        if not isinstance(one, Recording):
            raise BadType(f"first_difference compares recordings, as gamms.recorder.open gives them, not {shown(one)}.")
    logs = first.logs(), second.logs()
    for turn in count():
        if turn > min(first.turns, second.turns):
            break
        pair = (None, None) if turn == 0 else (next(logs[0]), next(logs[1]))
        if turn and _is_same(*pair):
            continue  # from equal states, equal events lead to equal states
        maps = first.map_hash(turn), second.map_hash(turn)
        found = next(differences(first[turn], second[turn], maps), None)
        if found is None and turn:
            found = _of_events(turn, first, second)
        if found is not None:
            return found
    if first.turns != second.turns:
        return Difference(min(first.turns, second.turns), None, "turns", first.turns, second.turns)
    return _of_events(first.turns + 1, first, second)


def _is_same(one: Any, other: Any) -> bool:
    try:
        if one == other:
            return True
    except ValueError:  # arrays are compared item by item
        pass
    return to_bytes(one, "A log") == to_bytes(other, "A log")  # as NaN is, too


def differences(first: State, second: State, maps: tuple[str, str]) -> Iterator[Difference]:
    """In what two states differ, the game's map first, whose names are `maps`; then agent by agent."""
    turn = first.turn
    if maps[0] != maps[1]:
        yield Difference(
            turn, None, "map", *(_size(one, name) for one, name in zip((first, second), maps, strict=True))
        )
    names = [state.agents["name"].tolist() for state in (first, second)]
    if set(names[0]) != set(names[1]):
        only = [sorted(set(names[i]) - set(names[1 - i])) for i in (0, 1)]
        yield Difference(turn, None, "agents", *only)
        return
    row_of = {name: row for row, name in enumerate(names[1])}
    order = [row_of[name] for name in names[0]]
    parted = []
    for place, (field, column) in enumerate(first.agents.items()):
        pairs = zip(column.tolist(), second.agents[field][order].tolist(), strict=True)
        row, pair = next(((row, pair) for row, pair in enumerate(pairs) if not _is_equal(*pair)), (None, None))
        if row is not None and pair is not None:
            parted.append((row, place, Difference(turn, names[0][row], field, *pair)))
    yield from (difference for *_, difference in sorted(parted, key=lambda one: one[:2]))
    for field in ("scores", "data", "over", "components"):
        values = getattr(first, field), getattr(second, field)
        if not _is_equal(*values):
            yield Difference(turn, None, field, *values)


def _is_equal(one: Any, other: Any) -> bool:
    """Whether two values are the same, where NaN is."""
    return one == other if type(one) is int and type(other) is int else _plain(one) == _plain(other)


def _plain(value: Any) -> Any:
    """A value by which it can be compared."""
    if isinstance(value, np.ndarray):
        return (str(value.dtype), _plain(value.tolist()))
    if isinstance(value, dict):
        return {key: _plain(one) for key, one in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(one) for one in value]
    return "NaN" if value != value else value  # noqa: PLR0124 - that is what NaN is


def _size(state: State, name: str) -> str:
    try:
        columns = state.graph.columns()
    except RecordingError:  # it is not in the recording
        return f"SHA-256 {name}"
    return f"{len(columns.node_ids)} nodes, {len(columns.edge_ids)} edges"


def _of_events(turn: int, first: Recording, second: Recording) -> Difference | None:
    """The difference between what was told in a turn."""
    told = [list(one.events(turn, turn + 1)) for one in (first, second)]
    for i in range(max(map(len, told))):
        pair = [one[i] if i < len(one) else None for one in told]
        if not _is_equal(*pair):
            return Difference(turn, None, "events", *pair)
    return None
