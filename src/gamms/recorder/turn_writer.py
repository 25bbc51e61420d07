"""When turns are written: at their end, in the background, or many at once; and when a keyframe is due."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Protocol

from gamms.ir.events import Log
from gamms.progress import uninterrupted
from gamms.recorder.keyframes import Keyframe
from gamms.recorder.saving import Saving
from gamms.typing.context import HostContext

_TURNS_AT_ONCE = 256  # that may wait to be written
_ENTRIES_AT_ONCE = 1 << 13  # of logs that may wait
_TURNS_OF_ARRAYS = 8  # that may wait where many agents move
_TURNS_OF_STREAM = 64  # that may wait where blocks cannot be replaced, and no other thread writes
_KEYFRAME_ENTRIES = 1 << 17  # of logs between two keyframes: 65,536 moves, which take some milliseconds to read
_KEYFRAME_TURNS = 128  # at least, in which each agent acts: the cost of a keyframe grows with the agents, too
_OF_VALUE = 64  # entries that take as long to read as one event with a value; flights: `SessionJournal.weight`

Encoder = Any
"""Writes logs in some format: `begin(session, is_final)`, `add(logs)`, `keyframe(state)`, `flush()`, `close()`.

It has `values`, the number of events with a value that were written; `blocks`, the number of blocks that will not be
replaced; `is_current`, whether flushed turns can be read at once.
"""


class Source(Protocol):
    """The session whose turns are written."""

    ctx: HostContext
    turn: int

    def keyframe(self) -> Keyframe:
        """Return how things are after the last turn."""

    def abandon(self) -> None:
        """Listen no longer, and write nothing more."""


class TurnWriter:
    """Writes the turns of a session by an encoder.

    Args:
        session: the session.
        encoder: writes logs.
        in_background: whether another thread writes turns that wait for long; else each turn is written at its end, if
            it can be read then.

    Attributes:
        has_begun: whether the beginning is written for good: until the first turn is over, a map may be loaded.
        has_failed: whether nothing more can be written.
    """

    def __init__(self, session: Source, encoder: Encoder, *, in_background: bool) -> None:
        self._session = session
        self._encoder = encoder
        self._in_background = in_background
        self._saving = Saving(self._save)
        self._logs: list[Log] = []  # that wait
        self._entries = 0  # of the logs since the last interval
        self._weight = 0  # of flights since then; see `SessionJournal`
        self._writes_at = 1  # the turn at whose end the waiting turns are written
        self._interval_ends = _TURNS_AT_ONCE  # the turn at whose end a keyframe may be written
        self._since_keyframe = 0  # entries
        self._values = 0  # that were written up to the last interval
        self._blocks = 0  # that were complete when waiting turns were saved
        self.has_begun = False
        self.has_failed = False
        encoder.begin(session, is_final=False)

    def add(self, log: Log, entries: int, weight: int, *, has_arrays: bool) -> None:
        """Take the log of a turn that is over, and write it now or later.

        Args:
            log: not changed afterwards.
            entries: of the log, each move of an array counted by itself.
            weight: of its flights.
            has_arrays: whether it has arrays of moves.
        """
        self._logs.append(log)
        self._entries += entries
        self._weight += weight
        turn = self._session.turn
        # NOTE: arrays may wait: to begin to write takes a twentieth of what a turn does (benchmarks: teams, recorded).
        is_full = self._entries >= _ENTRIES_AT_ONCE and not (has_arrays and turn % _TURNS_OF_ARRAYS)
        if turn >= self._writes_at or is_full:
            self._write(is_full=is_full)

    def close(self, rest: Log) -> None:
        """Write the waiting turns, the log of the turn that is not over, and the end."""
        if rest:
            self._logs.append(rest)
        with self._writing():
            self._encode()
            self._encoder.close()
            self._saving.end()

    def end(self) -> None:
        """Write nothing more in the background."""
        self._saving.end()

    def has_stopped(self) -> bool:
        """Whether nothing more is written; so it is, from now on, in another process than the one that records."""
        if self._saving.is_inherited:
            self._fail()
            self._session.ctx.logger.warning(
                "A recording goes on in the process that began it only, and not in this one."
            )
        return self.has_failed

    def _fail(self) -> None:
        self._session.abandon()
        self.has_failed = True
        self._logs = []

    def _write(self, *, is_full: bool) -> None:
        """Write the waiting turns."""
        if self.has_stopped():
            return
        turn = self._session.turn
        with self._writing():
            if self._in_background:
                self._in_background = self._saving.begin()
            self._encode()
            if turn >= self._interval_ends or is_full:
                self._end_interval()
            if self._in_background:
                self._writes_at = self._interval_ends
            elif self._encoder.is_current:
                self._encoder.flush()
            else:
                self._writes_at = turn - turn % _TURNS_OF_STREAM + _TURNS_OF_STREAM

    @contextmanager
    def _writing(self) -> Iterator[None]:
        """Let Ctrl-C wait, and end the recording if writing fails."""
        with uninterrupted(), self._saving.lock:
            try:
                self._saving.check()
                yield
            except BaseException:
                self._fail()
                raise

    def _save(self, is_last: bool) -> None:
        """Write turns that no later turn has written; or let the next one report the error."""
        try:
            self._encode()
            # NOTE: turns of a block that began since are written with it, or the next time: not twice where blocks are
            # large and end soon (benchmarks: teams, recorded).
            before, self._blocks = self._blocks, self._encoder.blocks
            if is_last or before == self._blocks:
                self._encoder.flush()
        except Exception:
            self._writes_at = 0
            raise

    def _end_interval(self) -> None:
        """Write a keyframe if one is due: by what was recorded, never by the clock."""
        values = self._encoder.values
        self._since_keyframe += self._entries + self._weight + _OF_VALUE * (values - self._values)
        self._values = values
        self._entries = self._weight = 0
        self._interval_ends = self._session.turn + _TURNS_AT_ONCE
        if self._since_keyframe >= max(_KEYFRAME_ENTRIES, 2 * _KEYFRAME_TURNS * len(self._session.ctx.agent.agents)):
            self._encoder.keyframe(self._session.keyframe())
            self._since_keyframe = 0

    def _encode(self) -> None:
        if not self.has_begun:
            self.has_begun = True
            self._encoder.begin(self._session, is_final=True)
        if waiting := self._logs[:]:
            self._encoder.add(waiting)
            del self._logs[: len(waiting)]  # others may have joined, behind them
