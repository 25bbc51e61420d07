"""What writes the logs of a session, one class per format version."""

import io
import os
from collections.abc import Callable
from functools import cache
from typing import Any

from gamms.ir import events as kinds
from gamms.ir.events import Log
from gamms.ir.packing import to_bytes
from gamms.plain import to_plain
from gamms.recorder import state
from gamms.recorder.formats.output import Output
from gamms.recorder.formats.tracks import FORMS
from gamms.recorder.formats.version2 import Version2Writer
from gamms.recorder.formats.writer import Writer
from gamms.recorder.records import TURN_NS, Record, named, records_of, records_of_move, steps_of
from gamms.recorder.session import Session

_MOST_WAITING = 1 << 16  # bytes


class Version3Sink:
    """Writes the container of docs/recording-format.md.

    Args:
        output: where to.
        header: what the header says of a session.
    """

    def __init__(self, output: Output, header: Callable[[Session], dict[str, Any]]) -> None:
        self._output, self._header = output, header
        self._writer: Writer = None  # type: ignore[assignment] # until it begins
        self._beginning: tuple[bytes, state.State] | None = None
        self._values = 0

    @property
    def is_current(self) -> bool:
        """Whether what was flushed can be read at once."""
        return self._output.can_overwrite

    def begin(self, session: Session, *, is_final: bool) -> None:
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

    def mark(self) -> Any:
        """How far it has come, for `back_to`."""
        return self._writer, self._beginning, self._values, None if self._beginning is None else self._writer.mark()

    def back_to(self, mark: Any) -> None:
        """Forget what was written since."""
        self._writer, self._beginning, self._values, written = mark
        if written:
            self._writer.back_to(written)

    def add(self, logs: list[Log]) -> None:
        """Write the logs of turns."""
        try:
            self._writer.add_moves(logs)
        except TypeError:  # there are events between the moves
            for log in logs:
                self._add(log)

    def _add(self, log: Log) -> None:
        try:
            self._writer.add_moves([log])
        except TypeError:
            self._writer.add_turn(log)

    def new_values(self) -> int:
        """How many events with a value were written since it was asked last."""
        before, self._values = self._values, self._writer.values
        return self._values - before

    def keyframe(self, keyframe: state.State) -> None:
        """Write the whole state."""
        self._writer.keyframe(keyframe)

    def flush(self) -> None:
        """Let what was written be readable if the program dies."""
        self._writer.flush()

    def close(self) -> None:
        """Write the end."""
        self._writer.close()


class Version2Sink:
    """Writes what gamms 1.0.0 reads; what that does not know is left out."""

    is_current = True

    def __init__(self, output: Output) -> None:
        self._output = output
        self._waiting = io.BytesIO()
        self._writer = Version2Writer(self._waiting)
        self._turn = 0
        self._since = 0, 0  # a turn, and its time stamp, from which those of the others follow
        self._end: Record | None = None  # how a recording ended that was copied, and nothing came after it

    def begin(self, session: Session, *, is_final: bool) -> None:  # noqa: ARG002 - nothing of it changes later
        """Write what is in front of the records."""
        self._names: list[str] = list(session.begin["names"])
        self._nodes: dict[str, int] = dict(zip(self._names, session.begin["node"].tolist(), strict=True))
        self.flush()

    def mark(self) -> Any:
        """How far it has come, for `back_to`."""
        known = {**vars(self), "_names": self._names[:], "_nodes": self._nodes.copy()}
        return known, self._waiting.getvalue(), self._output.end

    def back_to(self, mark: Any) -> None:
        """Forget what was written since."""
        known, waiting, end = mark
        vars(self).update(known)
        self._waiting.seek(0)
        self._waiting.truncate()
        self._waiting.write(waiting)
        self._output.back_to(end)

    def add(self, logs: list[Log]) -> None:
        """Write the logs of turns."""
        for log in logs:
            self._add(log)

    def _add(self, log: Log) -> None:
        is_over = True
        for number, step in steps_of(log):
            if number is not None:
                name = self._names[number]
                before, timestamp = self._nodes.get(name, step), self._timestamp(self._turn)
                for record in records_of_move(name, before, step, timestamp):
                    self._write(record)
                self._nodes[name] = step
            elif step[0] == kinds.REPLAYED:
                self._copy(*step[1])
                is_over = is_over and step[1][0]["opCode"] != kinds.SIMULATE
            else:
                kind, data = self._by_name(step)
                self._happen(kind, data, self._timestamp(self._turn))
                is_over = is_over and kind != kinds.UNFINISHED
        if is_over:
            self._write(*records_of(kinds.SIMULATE, {}, self._timestamp(self._turn)))
        self._turn += 1
        if self._waiting.tell() > _MOST_WAITING:
            self.flush()

    def _timestamp(self, turn: int) -> int:
        begin, timestamp = self._since
        return timestamp + (turn - begin) * TURN_NS

    def _by_name(self, event: tuple[int, Any]) -> tuple[int, Any]:
        """The event as it is where agents are named."""
        return named(event, self._names[event[1][0]]) if event[0] in FORMS else event

    def _copy(self, record: Record, noted: Log) -> None:
        """Write a record of another recording as it is there, and go on from its time."""
        for step in noted:
            self._follow(*self._by_name(step))
        self._since = self._turn, record["timestamp"]
        if record["opCode"] == kinds.TERMINATE:
            self._end = record
        else:
            self._write(record)

    def _happen(self, kind: int, data: Any, timestamp: int) -> None:
        before = self._follow(kind, data)
        if kind in _OF_VERSION_2:
            self._write(*records_of(kind, data, timestamp, before))

    def _follow(self, kind: int, data: Any) -> int | None:
        """Keep in mind who is where; where one that has flown was before."""
        before = None
        if kind == kinds.AGENT_CREATE:
            self._names.append(data["name"])
            self._nodes[data["name"]] = data.get("state", {}).get("node", data["kwargs"]["start_node_id"])
        elif kind == kinds.AGENT_CURRENT_NODE:
            self._nodes[data["agent_name"]] = data["node_id"]
        elif kind == kinds.AERIAL_AGENT_POSITION and "node" in data:
            before = self._nodes.get(data["agent_name"])
            self._nodes[data["agent_name"]] = data["node"]
        elif kind == kinds.FLYERS_ABOVE:
            self._nodes.update(zip(data["names"], data["node"].tolist(), strict=True))
        elif kind == kinds.SNAPSHOT:
            self._names = list(data["names"])
            self._nodes = dict(zip(self._names, data["node"].tolist(), strict=True))
        return before

    def _write(self, *records: dict[str, Any]) -> None:
        for record in records:
            self._writer.write(record["timestamp"], record["opCode"], record.get("data"))
            self._end = None

    def keyframe(self, keyframe: state.State) -> None:
        """There is no place for it."""

    def new_values(self) -> int:
        """None that a keyframe would save from being read."""
        return 0

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


_OF_VERSION_2 = {
    kinds.SIMULATE,
    kinds.AGENT_CREATE,
    kinds.AGENT_DELETE,
    kinds.AGENT_CURRENT_NODE,
    kinds.AGENT_PREV_NODE,
    kinds.AGENT_SENSOR_REGISTER,
    kinds.AGENT_SENSOR_DEREGISTER,
    kinds.AGENT_ORIENTATION,
    kinds.AERIAL_AGENT_POSITION,
    kinds.AERIAL_AGENT_QUATERNION,
    *range(0x02000000, 0x02000005),
}


@cache
def _package() -> str:
    from importlib.metadata import version

    return version("gamms")


def header_of(ctx: Any, session: Session, options: dict[str, Any]) -> dict[str, Any]:
    """What a recording says of the context it was made in: no host, no user, no path, and no time unless asked."""
    created = options.get("created")
    if created is None and (epoch := os.environ.get("SOURCE_DATE_EPOCH")):
        created = int(epoch)
    return {
        "format": 3,
        "package": _package(),
        "seed": session.seed,
        "created": created,
        "provenance": options.get("provenance"),
        **({} if ctx.game.scenario is None else {"scenario": {**to_plain(ctx.game.scenario), "seed": session.seed}}),
        "world": ctx.graph.storage.pack() if session.world is None else session.world,
        **({"visuals": session.visuals} if session.visuals["artists"] else {}),
        **({"drawings": session.drawings.first} if session.drawings.first else {}),
    }
