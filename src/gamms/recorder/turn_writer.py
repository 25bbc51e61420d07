"""Scheduling of writes: turns at their end, in the background, or many at once; and keyframes."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Protocol

from gamms.ir.events import Log
from gamms.progress import delay_interrupts
from gamms.recorder.keyframes import Keyframe
from gamms.recorder.saving import BackgroundSaving
from gamms.typing.context import HostContext

_TURNS_AT_ONCE = 256  # most turns that wait to be written
_ENTRIES_AT_ONCE = 1 << 13  # of logs that may wait
_TURNS_OF_ARRAYS = 8  # most waiting turns if many agents move
_TURNS_OF_STREAM = 64  # most waiting turns if blocks cannot be replaced, and no other thread writes
_KEYFRAME_ENTRIES = 1 << 17  # log entries between two keyframes: 65,536 moves, which take some milliseconds to read
# minimum number of turns in which each agent acts, because the cost of a keyframe grows with the agents, too
_KEYFRAME_TURNS = 128
_OF_VALUE = 64  # entries that take as long to read as one event with a value; for flights see `SessionJournal.weight`

Encoder = Any
"""An encoder of logs: `begin(session, is_final)`, `add(logs)`, `keyframe(state)`, `flush()`, `close()`.

It has `values`, the number of events with a value written; `blocks`, the number of final blocks; `is_current`, whether
flushed turns can be read at once.
"""


class TurnSource(Protocol):
    """A session whose turns are written."""

    ctx: HostContext
    turn: int

    def make_keyframe(self) -> Keyframe:
        """Return the state after the last turn."""

    def abandon(self) -> None:
        """Stop listening and writing."""


class TurnWriter:
    """Writes the turns of a session with an encoder.

    Args:
        session: the session.
        encoder: writes logs.
        in_background: whether another thread writes turns that wait long; otherwise each turn is written at its end, if
            it can be read then.

    Attributes:
        has_begun: whether the beginning is final: until the first turn is over, a map may be loaded.
        has_failed: whether writing has failed.
    """

    def __init__(self, session: TurnSource, encoder: Encoder, *, in_background: bool) -> None:
        self._session = session
        self._encoder = encoder
        self._in_background = in_background
        self._saving = BackgroundSaving(self._save)
        self._logs: list[Log] = []  # that wait
        self._entries = 0  # log entries since the last interval
        self._weight = 0  # weight of flights since then; see `SessionJournal`
        self._writes_at = 1  # turn after which waiting turns are written
        self._interval_ends = _TURNS_AT_ONCE  # turn after which a keyframe may be written
        self._since_keyframe = 0  # entries
        self._values = 0  # values written up to the last interval
        self._blocks = 0  # complete blocks when waiting turns were last saved
        self.has_begun = False
        self.has_failed = False
        encoder.begin(session, is_final=False)

    def add(self, log: Log, entries: int, weight: int, *, has_arrays: bool) -> None:
        """Add the log of a finished turn, and write it now or later.

        Args:
            log: not changed afterwards.
            entries: number of entries, with each move of an array counted.
            weight: weight of its flights.
            has_arrays: whether it has arrays of moves.
        """
        self._logs.append(log)
        self._entries += entries
        self._weight += weight
        turn = self._session.turn
        # NOTE: arrays may wait: starting to write takes a twentieth of a turn (benchmarks: teams, recorded).
        is_full = self._entries >= _ENTRIES_AT_ONCE and not (has_arrays and turn % _TURNS_OF_ARRAYS)
        if turn >= self._writes_at or is_full:
            self._write(is_full=is_full)

    def close(self, rest: Log) -> None:
        """Write the waiting turns, the log of the unfinished turn, and the end."""
        if rest:
            self._logs.append(rest)
        with self._protect_writing():
            self._encode()
            self._encoder.close()
            self._saving.end()

    def end(self) -> None:
        """Stop writing in the background."""
        self._saving.end()

    def has_stopped(self) -> bool:
        """Return whether writing has stopped; it stops in a process that did not start the recording."""
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
        with self._protect_writing():
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
    def _protect_writing(self) -> Iterator[None]:
        """Delay Ctrl-C, and end the recording if writing fails."""
        with delay_interrupts(), self._saving.lock:
            try:
                self._saving.check()
                yield
            except BaseException:
                self._fail()
                raise

    def _save(self, is_last: bool) -> None:
        """Write waiting turns; on an error let the next turn report it."""
        try:
            self._encode()
            # NOTE: turns of a new block are written with it, or the next time, so that large, short-lived
            # blocks are not written twice (benchmarks: teams, recorded).
            before = self._blocks
            self._blocks = self._encoder.blocks
            if is_last or before == self._blocks:
                self._encoder.flush()
        except Exception:
            self._writes_at = 0
            raise

    def _end_interval(self) -> None:
        """Write a keyframe if one is due, depending on the data, never on the clock."""
        values = self._encoder.values
        self._since_keyframe += self._entries + self._weight + _OF_VALUE * (values - self._values)
        self._values = values
        self._entries = 0
        self._weight = 0
        self._interval_ends = self._session.turn + _TURNS_AT_ONCE
        if self._since_keyframe >= max(_KEYFRAME_ENTRIES, 2 * _KEYFRAME_TURNS * len(self._session.ctx.agent.agents)):
            self._encoder.write_keyframe(self._session.make_keyframe())
            self._since_keyframe = 0

    def _encode(self) -> None:
        if not self.has_begun:
            self.has_begun = True
            self._encoder.begin(self._session, is_final=True)
        if waiting := self._logs[:]:
            self._encoder.add(waiting)
            del self._logs[: len(waiting)]  # other turns may have been added after them
