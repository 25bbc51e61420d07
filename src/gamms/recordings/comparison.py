"""Compare recordings: find the first difference of two games, and verify a recording by replaying it."""

import io
import os
from collections.abc import Iterator
from itertools import count
from pathlib import Path
from typing import NamedTuple

import numpy as np

from gamms.errors import BadType, GammsError
from gamms.ir.packing import to_bytes
from gamms.plain import Plain
from gamms.recorder import Reader, Recording, RecordingError, State
from gamms.recorder import open as opened
from gamms.recorder.maps import HASH
from gamms.recordings.conversion import make_context_with_map
from gamms.text import as_text, reason, shown, write_repr


class Difference(NamedTuple):
    """The first difference of two games.

    Attributes:
        turn: the number of turns after which the states differ; 0: at the start.
        agent: the agent with the field; None: a field of the game.
        field: a column of `State.agents`; or "agents", "scores", "data", "over", "components", "events", "map" or
            "turns".
        first: the value in the first game.
        second: the value in the second game.
    """

    turn: int
    agent: str | None
    field: str
    first: Plain
    second: Plain

    def __str__(self) -> str:
        """Return a description in one line."""
        whose = "" if self.agent is None else f"agent {self.agent!r}, "
        pair = write_repr(self.first), write_repr(self.second)
        return f"Turn {self.turn}, {whose}{self.field}: {pair[0]} in the first, {pair[1]} in the second"


def first_difference(first: Recording, second: Recording) -> Difference | None:
    """Return the first difference of two games; None if the games are equal.

    Seeds, and the time and program of recording, are ignored.

    Raises:
        RecordingError (ValueError): a recording is damaged.
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
        found = next(list_differences(first[turn], second[turn], maps), None)
        if found is None and turn:
            found = _compare_events(turn, first, second)
        if found is not None:
            return found
    if first.turns != second.turns:
        return Difference(min(first.turns, second.turns), None, "turns", first.turns, second.turns)
    return _compare_events(first.turns + 1, first, second)


def _is_same(one: Plain, other: Plain) -> bool:
    try:
        if one == other:
            return True
    except ValueError:  # arrays are compared item by item
        pass
    return to_bytes(one, "A log") == to_bytes(other, "A log")  # as NaN is, too


def list_differences(first: State, second: State, maps: tuple[str, str]) -> Iterator[Difference]:
    """Yield the differences of two states: of their maps, whose hashes are `maps`, then agent by agent."""
    turn = first.turn
    if maps[0] != maps[1]:
        yield Difference(turn, None, "map", _describe_size(first, maps[0]), _describe_size(second, maps[1]))
    names = [state.agents["name"].tolist() for state in (first, second)]
    if set(names[0]) != set(names[1]):
        only = [sorted(set(names[i]) - set(names[1 - i])) for i in (0, 1)]
        yield Difference(turn, None, "agents", *only)
        return
    row_of = {name: row for row, name in enumerate(names[1])}
    order = [row_of[name] for name in names[0]]
    found = []
    for place, (field, column) in enumerate(first.agents.items()):
        pairs = zip(column.tolist(), second.agents[field][order].tolist(), strict=True)
        row, pair = next(((row, pair) for row, pair in enumerate(pairs) if not _is_equal(*pair)), (None, None))
        if row is not None and pair is not None:
            found.append((row, place, Difference(turn, names[0][row], field, *pair)))
    yield from (difference for *_, difference in sorted(found, key=lambda one: one[:2]))
    for field in ("scores", "data", "over", "components"):
        values = getattr(first, field), getattr(second, field)
        if not _is_equal(*values):
            yield Difference(turn, None, field, *values)


def _is_equal(one: Plain, other: Plain) -> bool:
    """Return whether two values are the same, NaN being equal to itself."""
    return one == other if type(one) is int and type(other) is int else _make_plain(one) == _make_plain(other)


def _make_plain(value: Plain) -> Plain:
    """Return a comparable form of a value."""
    if isinstance(value, np.ndarray):
        return (str(value.dtype), _make_plain(value.tolist()))
    if isinstance(value, dict):
        return {key: _make_plain(one) for key, one in value.items()}
    if isinstance(value, (list, tuple)):
        return [_make_plain(one) for one in value]
    return "NaN" if value != value else value  # noqa: PLR0124 - that is what NaN is


def _describe_size(state: State, name: str) -> str:
    try:
        columns = state.graph.columns()
    except RecordingError:  # it is not in the recording
        return f"SHA-256 {name}"
    return f"{len(columns.node_ids)} nodes, {len(columns.edge_ids)} edges"


def _compare_events(turn: int, first: Recording, second: Recording) -> Difference | None:
    """Return the difference between the events of rules and programs in a turn."""
    events = [list(one.events(turn, turn + 1)) for one in (first, second)]
    for i in range(max(map(len, events))):
        pair = [one[i] if i < len(one) else None for one in events]
        if not _is_equal(*pair):
            return Difference(turn, None, "events", *pair)
    return None


# -- one recording ----------------------------------------------------------------------------------------------


def verify(path: str | os.PathLike[str], map: str | os.PathLike[str] | None = None) -> None:
    """Verify a recording of version 3: read it completely, recompute its keyframes, replay it, and record the replay.

    The new recording must have exactly the same events, and with the same versions of GAMMS and zlib the same bytes.

    Args:
        path: the file of the recording.
        map: a file written by `ctx.graph.save`, for recordings without their map.

    Raises:
        RecordingError (ValueError): the recording is unfinished, a block or the index is damaged, a keyframe
        contradicts the turns before it, the replay fails or differs, or the map is a different one. BadFile
        (ValueError): the map is damaged.
        OSError: one of the files cannot be read.
    """
    with opened(path, graph=map) as recording:  # its error explains what to do with version 2
        name = recording.header.get(HASH)
    with Reader(path) as reader:
        reader.verify()
        if reader.warning:
            raise RecordingError(reader.warning)
    if name is not None and map is None:
        raise RecordingError(
            "The readable part of this recording is intact, but it contains only the SHA-256 of its map, "
            f"{as_text(name)}, and cannot be replayed without the map. Give the map: --map FILE.gamms."
        )
    _check_keyframes(path)
    before = Path(path).read_bytes()
    after = record_again(path, map)
    if before != after and (part := _find_differing_part(before, after)) is not None:
        raise RecordingError(f"Replayed and recorded again, it is another recording: {part} is not the same.")


class _SequentialReader(Reader):
    """A reader that uses only the first keyframe, so that every state is computed from all turns before it."""

    def keyframe_before(self, turn: int) -> int:
        """Return the start."""
        return super().keyframe_before(min(turn, 0))

    def keyframe(self, turn: int) -> tuple[int, dict[str, Plain]] | None:
        """Return the keyframe of the start."""
        return super().keyframe(min(turn, 0))


def _check_keyframes(path: str | os.PathLike[str]) -> None:
    """Compare every keyframe with the state computed from the turns before it."""
    with Reader(path) as reader, _SequentialReader(path) as walker:
        stored = Recording(reader)
        computed = Recording(walker)
        turns = []
        turn = reader.keyframe_before(stored.turns)
        while turn > 0:
            turns.append(turn)
            turn = reader.keyframe_before(turn - 1)
        for turn in reversed(turns):
            difference = next(list_differences(computed.state(turn), stored.state(turn), ("", "")), None)
            if difference is not None:
                raise RecordingError(
                    f"The keyframe after turn {turn} is not what follows from the turns before it. {difference}."
                )
        computed.state(stored.turns)  # which raises where an event cannot have happened


def _find_differing_part(before: bytes, after: bytes) -> str | None:
    """Return the first part that differs between two recordings; None if only blocks and compression differ."""
    with Reader(io.BytesIO(before)) as first, Reader(io.BytesIO(after)) as second:
        if first.turns != second.turns:
            return "the number of turns"
        if _pack_value(first.header) != _pack_value(second.header):
            return "the header"
        differing = (
            turn for turn in range(first.turns) if _pack_value(first.log(turn)) != _pack_value(second.log(turn))
        )
        turn = next(differing, None)
        return None if turn is None else f"turn {turn + 1}"


def _pack_value(value: Plain) -> bytes:
    return to_bytes(value, "The recording")


class _FinalBuffer(io.BytesIO):
    """A buffer that is read only after the end of the recording, so that turns need not be written one by one."""

    def seekable(self) -> bool:
        return False


def record_again(path: str | os.PathLike[str], map: str | os.PathLike[str] | None = None) -> bytes:
    """Replay a recording of version 3 into a fresh context, record it there, and return the bytes.

    Raises:
        RecordingError (ValueError): it cannot be replayed.
    """
    stream = _FinalBuffer()
    with make_context_with_map(map) as ctx:
        ctx.record.start(stream)
        try:
            for _ in ctx.record.replay(path):
                pass
        except GammsError as error:
            raise RecordingError(f"It cannot be replayed: {reason(error)}") from error
        ctx.record.stop()
    return stream.getvalue()
