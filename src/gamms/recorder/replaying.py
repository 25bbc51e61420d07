"""Replay a recording: apply its events to a context, and yield them in the form of 1.0.0."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import nullcontext
from typing import Any, Protocol

from gamms.errors import BadFile, ContextTerminated
from gamms.ir import events as kinds
from gamms.ir.events import COMPONENTS, EVENTS, Mover, events_of, records_of
from gamms.plain import Plain
from gamms.recorder.errors import UNFIT, RecordingError
from gamms.recorder.formats.chunks import FORMS
from gamms.recorder.formats.reader import Reader
from gamms.recorder.host import HostContext
from gamms.recorder.live import LegacyState, LiveState
from gamms.recorder.maps import has_map, hash_in, is_map_of
from gamms.text import reason

Record = dict[str, Any]  # timestamp, opCode, data

TURN_NS = 1_000_000_000  # what a turn lasts in time stamps, which follow from the turns alone


class Recording(Protocol):
    """The part of a recording that is being written which a replay needs."""

    def adopt(self, header: dict[str, Any], begin: dict[str, Any]) -> bool:
        """Begin as a recording that is replayed does, if nothing has happened yet."""

    def emit_snapshot(self) -> None:
        """Write how things are now."""

    def renumber(self, snapshot: dict[str, Any]) -> None:
        """Give agents the numbers that they have in a snapshot."""


class Replayer:
    """Applies events to a context; its journal takes them where the context is being recorded.

    Args:
        ctx: the context.
        recording: gives the recording that is being written now, if any.
        is_version_2: whether the events are records of 1.0.0, which wrote more than it accepted.

    Attributes:
        state: what events are applied to.
        clock: the time stamp of what is being replayed.
    """

    def __init__(
        self, ctx: HostContext, recording: Callable[[], Recording | None] = lambda: None, *, is_version_2: bool = False
    ) -> None:
        self._ctx, self._recording, self._is_version_2 = ctx, recording, is_version_2
        self.state = LegacyState(ctx) if is_version_2 else LiveState(ctx)
        self.clock = 0

    def play(self, reader: Reader) -> Iterator[Record]:
        """Apply a recording of version 3, and yield its records.

        Raises:
            RecordingError: it is damaged, or does not fit the context; what was whole has been applied.
        """
        attach(self._ctx, reader.header)
        self.show(reader.header.get("visuals"), reader.header.get("drawings", []))
        begin = reader.keyframe(0)
        if begin is not None and begin[0] == 0:
            self._begin(reader.header, begin[1])
        elif reader.turns or not reader.warning:  # else it was cut off behind its map
            raise RecordingError("This recording does not say how it begins.")
        for turn in range(reader.turns):
            yield from self._turn(turn, reader.log(turn))
            if self._ctx.is_terminated():
                return
        yield {"timestamp": max(0, reader.turns - 1) * TURN_NS, "opCode": kinds.TERMINATE}

    def play_until(self, log: kinds.Log, kind: int) -> Any:
        """Apply a turn as far as the first event of some kind, and return the data of that; None if there is none."""
        for code, data in events_of(log):
            if code == kind:
                return data
            self.apply(code, data)
        return None

    def _begin(self, header: dict[str, Any], snapshot: dict[str, Plain]) -> None:
        recording = self._recording()
        try:
            is_adopted = recording is not None and recording.adopt(header, snapshot)
            with self.state.agents.unnoted():
                self.state.restore(snapshot)
        except ContextTerminated:
            raise
        except UNFIT as error:
            raise RecordingError(f"This recording cannot begin here: {reason(error)}") from error
        if recording is not None:
            recording.renumber(snapshot) if is_adopted else recording.emit_snapshot()

    def _turn(self, turn: int, log: kinds.Log) -> Iterator[Record]:
        timestamp, is_over, ctx = turn * TURN_NS, True, self._ctx
        for kind, data in events_of(log):
            if ctx.is_terminated():
                return
            self.clock = timestamp
            if kind == kinds.MOVES:
                yield from self._moves(data, turn)
            elif kind == kinds.UNFINISHED:
                is_over = False
            else:
                mover = self._mover(kind, data)
                self.apply(kind, data)
                for code, record in records_of(kind, data, mover):
                    yield {"timestamp": timestamp, "opCode": code, "data": record}
        if is_over and not ctx.is_terminated():
            self.apply(kinds.SIMULATE, {})
            yield {"timestamp": timestamp, "opCode": kinds.SIMULATE, "data": {}}

    def _moves(self, flat: list[int], turn: int) -> Iterator[Record]:
        timestamp, is_terminated, move = turn * TURN_NS, self._ctx.is_terminated, self.state.agents.move_one
        for number, node in zip(flat[::2], flat[1::2], strict=True):
            if is_terminated():
                return
            try:
                name, before = move(number, node)
            except UNFIT as error:
                raise RecordingError(f"Turn {turn} moves agent number {number}: {reason(error)}") from error
            # NOTE: not by `records_of`, which takes half as long again (benchmarks/README.md, replay).
            data = {"agent_name": name, "node_id": before}
            yield {"timestamp": timestamp, "opCode": kinds.AGENT_PREV_NODE, "data": data}
            data = {"agent_name": name, "node_id": node}
            yield {"timestamp": timestamp, "opCode": kinds.AGENT_CURRENT_NODE, "data": data}

    def _mover(self, kind: int, data: Plain) -> Mover | None:
        """Return which flyer an event moves, and the node it is above."""
        agents = self.state.agents
        try:
            if kind in FORMS:
                return agents.mover(agents.row_of(data[0]))
            return agents.mover(agents.row(data["agent_name"])) if kind == kinds.AERIAL_AGENT_POSITION else None
        except UNFIT as error:
            raise _unfit(kind, error) from error

    def apply(self, kind: int, data: Plain) -> None:
        """Apply an event, and note it where the context is being recorded; one that is not known is only noted.

        Raises:
            RecordingError: it cannot happen here; the context is as it was.
        """
        known, agents = EVENTS.get(kind), self.state.agents
        if known is None and self._is_version_2:
            raise RecordingError(f"Operation code {kind:#010x} is none of gamms 1.0.0.")
        notes_itself = (
            self._is_version_2 or kind in FORMS or kind in COMPONENTS or kind in (kinds.MOVES, kinds.SIMULATE)
        )
        try:
            with nullcontext() if notes_itself else agents.unnoted():
                if known is not None:
                    known.apply(self.state, data)
            if kind == kinds.SNAPSHOT:
                self._note_snapshot(data)
            elif not notes_itself:
                agents.note(kind, data)
        except (ContextTerminated, RecordingError):
            raise
        except UNFIT as error:
            raise _unfit(kind, error) from error

    def _note_snapshot(self, snapshot: dict[str, Plain]) -> None:
        """Note a snapshot as it is where it says everything; else how things are now."""
        recording = self._recording()
        if recording is not None and list(self._ctx.agent.agents) == list(snapshot["names"]):
            self._ctx.agent.block.journal.append(kinds.SNAPSHOT, snapshot)
            recording.renumber(snapshot)
        elif recording is not None:
            recording.emit_snapshot()

    def show(self, visuals: dict[str, Plain] | None, drawings: Iterable[dict[str, Plain]] = ()) -> None:
        """Declare what a recording looks like; None: as it does.

        Raises:
            RecordingError: this is not right.
        """
        if visuals is None:
            return
        try:
            self.state.show(visuals)
            for drawing in drawings:
                self.state.draw(drawing)
        except UNFIT as error:
            raise RecordingError(
                f"What this recording looks like is not right ({type(error).__name__}: {reason(error)})."
            ) from error


def attach(ctx: HostContext, header: dict[str, Any]) -> None:
    """Attach the map of a recording where there is none yet; else it must be the same.

    Raises:
        RecordingError: it is another, or there is none and the recording holds none, either.
    """
    name = hash_in(header)
    if not has_map(header):
        if not is_map_of(ctx.graph.storage.pack_savable()[0], header):
            raise RecordingError(
                "This recording does not hold its map, and the graph of this context is another. Load the map with "
                f"the SHA-256 {name} first: ctx.graph.load('map.gamms')."
            )
        return
    if next(iter(ctx.graph.graph.get_nodes()), None) is None:
        try:
            ctx.graph.storage.unpack(header["world"])
        except BadFile as error:
            raise RecordingError(f"The map of this recording is damaged: {reason(error)}") from error
    elif not is_map_of(ctx.graph.storage.pack_savable()[0], header):
        raise RecordingError(
            "The graph or the obstacles of this context are not those of the recording. Replay it into a context "
            "without a graph: the recording brings its own."
        )


def _unfit(kind: int, error: Exception) -> RecordingError:
    return RecordingError(f"An event of kind {kind:#010x} cannot happen here: {reason(error)}")
