"""What writes the logs of a session, one class per format version."""

import io
import os
from collections.abc import Callable, Iterable
from contextlib import suppress
from copy import deepcopy
from typing import Any

from gamms.ir import events as kinds
from gamms.ir.events import EVENTS, Log, Mover, records_of, steps_of
from gamms.ir.packing import to_bytes
from gamms.plain import Plain, to_plain
from gamms.recorder.detached import DetachedState
from gamms.recorder.errors import Damaged
from gamms.recorder.formats.chunks import FORMS
from gamms.recorder.formats.version2 import Version2Writer
from gamms.recorder.formats.writer import Output, Writer
from gamms.recorder.keyframes import Keyframe
from gamms.recorder.replaying import TURN_NS, Record
from gamms.recorder.session import RecordingSession
from gamms.typing.context import HostContext
from gamms.versions import __version__

_MOST_WAITING = 1 << 16  # bytes


class Version3Encoder:
    """Writes the container of docs/recording-format.md.

    Args:
        output: where to.
        header: what the header says of a session.
    """

    def __init__(self, output: Output, header: Callable[[RecordingSession], dict[str, Any]]) -> None:
        self._output, self._header = output, header
        self._writer: Writer = None  # type: ignore[assignment] # until it begins
        self._beginning: tuple[bytes, Keyframe] | None = None

    @property
    def is_current(self) -> bool:
        """Whether what was flushed can be read at once."""
        return self._output.can_overwrite

    def begin(self, session: RecordingSession, *, is_final: bool) -> None:
        """Write how the recording begins, unless that is there: for now, so that it opens, or for good."""
        if not is_final and not self._output.can_overwrite:
            return
        header = self._header(session)
        beginning = to_bytes(header, "The header"), session.begin
        if self._beginning is None or self._beginning[0] != beginning[0] or self._beginning[1] is not beginning[1]:
            self._output.back_to(0)
            self._writer = Writer(self._output, header)
            self._writer.keyframe(session.begin)
            self._beginning = beginning

    def add(self, logs: list[Log]) -> None:
        """Write the logs of turns."""
        try:
            self._writer.add_moves(logs)
        except TypeError:  # there are events between the moves
            for log in logs:
                self._writer.add_turn(log)

    @property
    def values(self) -> int:
        """How many events with a value were written."""
        return self._writer.values

    @property
    def blocks(self) -> int:
        """How many blocks were written that stay."""
        return self._output.blocks

    def keyframe(self, keyframe: Keyframe) -> None:
        """Write the whole state."""
        self._writer.keyframe(keyframe)

    def flush(self) -> None:
        """Make what was written readable even if the program dies."""
        self._writer.flush()

    def close(self) -> None:
        """Write the end."""
        self._writer.close()


class Version2Encoder:
    """Writes what gamms 1.0.0 reads; what that does not know is left out."""

    is_current = True
    values = 0  # no keyframe would save any from being read
    blocks = 0  # likewise: what was flushed stays

    def __init__(self, output: Output) -> None:
        self._output = output
        self._waiting = io.BytesIO()
        self._writer = Version2Writer(self._waiting)
        self._agents: DetachedState  # where they are: what records of moves say as well, and events do not
        self._turn = 0
        self._since = 0, 0  # a turn, and its time stamp, from which those of the others follow
        self._end: Record | None = None  # how a recording ended that was copied, and nothing came after it

    def begin(self, session: RecordingSession, *, is_final: bool) -> None:  # noqa: ARG002 - nothing of it changes later
        """Write what is in front of the records."""
        self._agents = DetachedState(deepcopy(session.begin))
        self.flush()

    def add(self, logs: list[Log]) -> None:
        """Write the logs of turns."""
        for log in logs:
            self._add(log)

    def _add(self, log: Log) -> None:
        is_over, timestamp = True, self._timestamp(self._turn)
        for kind, data in steps_of(log):
            if kind == kinds.REPLAYED:
                self._copy(*data)
                is_over, timestamp = is_over and data[0]["opCode"] != kinds.SIMULATE, self._timestamp(self._turn)
                continue
            mover = self._mover(kind, data)
            self._follow(kind, data)
            if kind in EVENTS and EVENTS[kind].records is not None:
                self._write(timestamp, records_of(kind, data, mover))
            is_over = is_over and kind != kinds.UNFINISHED
        if is_over:
            self._write(timestamp, [(kinds.SIMULATE, {})])
        self._turn += 1
        if self._waiting.tell() > _MOST_WAITING:
            self.flush()

    def _mover(self, kind: int, data: Plain) -> Mover | None:
        """Return the agent that an event moves or turns."""
        agents = self._agents.agents
        if kind == kinds.MOVES or kind in FORMS:
            row = agents.row_of(data[0])
        elif kind == kinds.AERIAL_AGENT_POSITION and "node" in data:
            row = agents.row(data["agent_name"])
        else:
            return None
        return Mover(agents.columns["names"][row], int(agents.columns["node"][row]))

    def _follow(self, kind: int, data: Plain) -> None:
        """Apply an event that concerns agents, unless a program has written it and it cannot be."""
        if kind == kinds.SNAPSHOT or kind >> 24 == kinds.AGENT_CREATE >> 24:
            with suppress(Damaged):
                self._agents.apply_event(kind, data)

    def _timestamp(self, turn: int) -> int:
        begin, timestamp = self._since
        return timestamp + (turn - begin) * TURN_NS

    def _copy(self, record: Record, noted: Log) -> None:
        """Write a record of another recording as it is there, and go on from its time."""
        for kind, data in steps_of(noted):
            self._follow(kind, data)
        self._since = self._turn, record["timestamp"]
        if record["opCode"] == kinds.TERMINATE:
            self._end = record
        else:
            self._write(record["timestamp"], [(record["opCode"], record.get("data"))])

    def _write(self, timestamp: int, records: Iterable[tuple[int, Any]]) -> None:
        for code, data in records:
            self._writer.write(timestamp, code, data)
            self._end = None

    def keyframe(self, keyframe: Keyframe) -> None:
        """There is no place for it."""

    def flush(self) -> None:
        """Hand over what was written to the system."""
        if self._waiting.tell():
            self._output.append(self._waiting.getvalue())
            self._waiting.seek(0)
            self._waiting.truncate()

    def close(self) -> None:
        """Write the end."""
        timestamp = max(self._since[1], self._timestamp(self._turn - 1))
        end = self._end or {"timestamp": timestamp, "opCode": kinds.TERMINATE}
        self._writer.write(end["timestamp"], end["opCode"], end.get("data"))
        self.flush()


class NoEncoder:
    """Writes nothing, where there is no recording and others follow the game."""

    is_current = True
    values = blocks = 0

    def begin(self, session: RecordingSession, *, is_final: bool) -> None:
        """Write nothing."""

    def add(self, logs: list[Log]) -> None:
        """Write nothing."""

    def keyframe(self, keyframe: Keyframe) -> None:
        """Write nothing."""

    def flush(self) -> None:
        """Write nothing."""

    def close(self) -> None:
        """Write nothing."""


def header_of(ctx: HostContext, session: RecordingSession, options: dict[str, Any]) -> dict[str, Any]:
    """Return the header of a recording: no host, no user, no path, and no time unless asked."""
    created = options.get("created")
    if created is None and (epoch := os.environ.get("SOURCE_DATE_EPOCH")):
        created = int(epoch)
    scenario = ctx.game.internals.scenario
    return {
        "format": 3,
        "package": __version__,
        "seed": session.seed,
        "created": created,
        "provenance": options.get("provenance"),
        **({} if scenario is None else {"scenario": {**to_plain(scenario), "seed": session.seed}}),
        "world": ctx.graph.storage.pack() if session.world is None else session.world,
        **({"visuals": session.visuals} if session.visuals["artists"] or "team_colors" in session.visuals else {}),
        **({"drawings": session.drawings.first} if session.drawings.first else {}),
    }
