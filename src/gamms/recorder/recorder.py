"""`ctx.record`: records a context, and replays recordings."""

import os
import time
from collections.abc import Generator, Iterator
from contextlib import ExitStack, nullcontext
from copy import deepcopy
from typing import Any, BinaryIO

from gamms.arguments import as_bool, as_int, as_name, refuse_finer_time
from gamms.compat import Surface
from gamms.deciding import ContextPart, get_phase, refuse_while_deciding
from gamms.errors import BadType, BadValue, ContextTerminated
from gamms.ir import events as kinds
from gamms.ir.events import EVENTS
from gamms.plain import Plain, describe_flaw, to_plain
from gamms.recorder.compat import ComponentNames
from gamms.recorder.components import Components
from gamms.recorder.encoders import ENCODERS, make_header
from gamms.recorder.errors import RecorderBusy, RecordingError
from gamms.recorder.formats import version2
from gamms.recorder.formats.reader import Reader
from gamms.recorder.formats.writer import Output
from gamms.recorder.maps import remove_map
from gamms.recorder.playback import Playback
from gamms.recorder.recording import Recording
from gamms.recorder.replaying import TURN_NS, Record, Replayer
from gamms.recorder.session import Follower, RecordingSession
from gamms.recorder.streams import RecordingTarget, lock_file, open_readable, read_format
from gamms.text import shown
from gamms.typing.context import HostContext
from gamms.typing.recorder import IRecorder, OpCodes


class Recorder(Surface, ComponentNames, ContextPart, IRecorder):
    """The recorder of one context.

    Attributes:
        ctx: the context.
        components: recorded objects of the user.
        is_replaying: whether a recording is being replayed.
    """

    _called = "ctx.record"

    def __init__(self, ctx: HostContext) -> None:
        self._phase = get_phase(ctx)
        self.ctx = ctx
        self.components = Components(self._record_component_event, self._phase)
        self.is_replaying = False
        self._session: RecordingSession | None = None
        self._target: RecordingTarget | None = None
        self._replayer: Replayer | None = None
        self._followers: tuple[Follower, ...] = ()
        self._watch: RecordingSession | None = None  # session for followers while nothing is recorded
        self._recorded = self.components.get_recorded()  # components when the recording was paused
        self._version = 3  # format version of the present recording

    # -- writing ------------------------------------------------------------------------------------------------

    def record(self) -> bool:
        """Return whether events are being written."""
        session = self._session
        return session is not None and not (session.is_paused or session.has_failed or self.ctx.is_terminated())

    def __repr__(self) -> str:
        if self.is_replaying:
            return "Recorder(replaying)"
        doing = "recording" if self.record() else "paused"
        return f"Recorder({doing if self.is_open else 'not recording'})"

    @property
    def is_open(self) -> bool:
        """Whether a recording has started and not stopped, paused or not."""
        return self._session is not None

    @refuse_while_deciding
    def start(
        self,
        path: str | os.PathLike[str] | BinaryIO,
        *,
        version: int = 3,
        created: int | None = None,
        provenance: Plain = None,
        sensed: bool | None = None,
        drawings: bool = True,
        embed_graph: bool = True,
        overwrite: bool = False,
    ) -> None:
        """Begin a recording with the present state.

        Args:
            path: path of a new file, with the suffix `.ggr` by default; or a binary stream.
            version: 3, or 2 for gamms 1.0.0 (agents and components only).
            created: seconds since 1970 for the header; None: $SOURCE_DATE_EPOCH, or no time.
            provenance: plain values for the header.
            sensed: whether to record the sensor data of agents in the turns of `ctx.game`, for pages, fog, cuts and
                `Recording.observation`. Default: None, from the first turn in which an agent carries a sensor. True:
                from the first turn on. False: not at all, for a smaller and faster recording.
            drawings: whether to record the drawings of artists and rules with custom drawers at the end of each turn,
                which calls these drawers.
            embed_graph: whether the recording contains the map; otherwise only its SHA-256, and a replay needs the map.
            overwrite: whether to replace an existing file, after the recording has started successfully.

        Raises:
            FileExistsError: the file exists.
            RecorderBusy (RuntimeError): another recording is being written, or the file to overwrite is in use.
            RecordingError: the file cannot be written.
                BadType (TypeError), BadValue (ValueError): an argument is invalid.
        """
        if self.ctx.is_terminated():
            return
        if self._session is not None and self._session.has_failed:
            self.close()
        if self._session is not None:
            raise RecorderBusy("A recording is being written already. Call ctx.record.stop() first.")
        options = _check_options(version, created, provenance)
        flags = {"overwrite": overwrite, "embed_graph": embed_graph}
        overwrite, embed_graph = (as_bool(flag, name) for name, flag in flags.items())
        with_sensed = None if sensed is None else as_bool(sensed, "sensed")
        if not ENCODERS[version].holds_looks_and_drawings:
            with_sensed = False

        def header(session: RecordingSession) -> dict[str, Any]:
            found = make_header(self.ctx, session, options) if session.header is None else session.header
            return found if embed_graph else remove_map(found)

        self._end_watch()
        session = RecordingSession(
            self.ctx,
            with_sensed=True if self._followers else with_sensed,
            with_drawings=as_bool(drawings, "drawings") and ENCODERS[version].holds_looks_and_drawings,
        )  # before the file is created: not every map can be written
        target: RecordingTarget | None = None
        try:
            target = RecordingTarget(path, overwrite=overwrite)
            output = Output(target.stream)
            session.write_to(ENCODERS[version](output, header), in_background=target.is_owned)
            target.keep()
        except BaseException:
            session.abandon()
            if target is not None:
                target.discard()
            self._tell_followers()
            raise
        self._target = target
        self._session = session
        self._version = version
        for name, data in self.components.list_events_since((set(), {})):
            self._record_component_event(name, data)
        self._tell_followers()

    @refuse_while_deciding
    def stop(self) -> None:
        """End the recording and close its file.

        Raises:
            RecorderBusy (RuntimeError): no recording is being written, or it is paused.
            RecordingError: the end cannot be written; everything before stays readable.
        """
        if self._session is None:
            if self.ctx.is_terminated():
                return
            raise RecorderBusy("No recording is being written. Call ctx.record.start(path) first.")
        if self._session.is_paused:
            raise RecorderBusy("The recording is paused. Call ctx.record.play() first, or terminate the context.")
        self.close()
        self._tell_followers()

    @refuse_while_deciding
    def close(self) -> None:
        """End the recording if there is one, even if it is paused, and close its file.

        Raises:
            RecordingError: see `stop`.
        """
        session = self._session
        if session is None:
            return
        self._session = None
        try:
            session.close()
        finally:
            session.abandon()
            target = self._target
            self._target = None
            if target is not None and not target.close():
                self.ctx.logger.warning("The file of the recording was removed while it was written; it is lost.")

    @refuse_while_deciding
    def pause(self) -> None:
        """Pause the recording until `play`."""
        if self.ctx.is_terminated():
            return
        if self._session is None or self._session.is_paused:
            self.ctx.logger.warning("There is nothing to pause: no recording is being written.")
            return
        self._session.pause()
        self._recorded = self.components.get_recorded()
        self._tell_followers()

    @refuse_while_deciding
    def play(self) -> None:
        """Resume the recording with the present state."""
        if self.ctx.is_terminated():
            return
        if self._session is None or not self._session.is_paused:
            self.ctx.logger.warning("There is nothing to play: no recording is paused.")
            return
        self._end_watch()
        self._session.play()
        for name, data in self.components.list_events_since(self._recorded):
            self._record_component_event(name, data)
        self._tell_followers()

    # -- followers ----------------------------------------------------------------------------------------------

    @refuse_while_deciding
    def follow(self, follower: Follower) -> None:
        """Send all events to a follower from now on, whether or not the game is recorded.

        Sensor data are included, also in recordings that begin while there is a follower.

        Raises:
            BadType (TypeError): the follower has no `begin` and `hear`.
        """
        if not (callable(getattr(follower, "begin", None)) and callable(getattr(follower, "hear", None))):
            raise BadType(f"A follower has begin(header, state) and hear(log, is_over=), unlike {shown(follower)}.")
        self._followers = (*self._followers, follower)
        self._tell_followers()

    @refuse_while_deciding
    def unfollow(self, follower: Follower) -> None:
        """Stop sending events to a follower."""
        self._followers = tuple(one for one in self._followers if one is not follower)
        self._tell_followers()

    def _tell_followers(self) -> None:
        """Connect followers to the present recording; without one, to a separate session."""
        self._end_watch()
        session = self._get_recording()
        if session is None and self._followers and not self.ctx.is_terminated():
            session = RecordingSession(self.ctx, with_sensed=True, with_drawings=True)
            self._watch = session
        if session is not None:
            session.follow(self._followers, lambda session: make_header(self.ctx, session, {}))

    def _end_watch(self) -> None:
        if self._watch is not None:
            self._watch.abandon()
            self._watch = None

    @refuse_while_deciding
    def write(self, opCode: OpCodes, data: dict[str, Any]) -> None:  # noqa: N803 - published name
        """Write one record unchanged; SIMULATE ends a turn.

        Raises:
            RecorderBusy (RuntimeError): no recording is being written.
                BadType (TypeError), BadValue (ValueError): the record could not be read back; nothing was written.
        """
        if self.ctx.is_terminated():
            return
        session = self._get_recording()
        if session is None:
            raise RecorderBusy("No recording is being written, or it is paused.")
        _check_record(opCode, data)
        if opCode is OpCodes.SIMULATE:
            session.end_turn()
        else:
            session.log.append((opCode.value, to_plain(data)))

    @refuse_while_deciding
    def event(self, kind: str, **data: Plain) -> None:
        """Record a custom event with plain values; does nothing if no recording is being written.

        Raises:
            BadType: a value is not plain.
        """
        kind = as_name(kind, "an event")
        if flaw := describe_flaw(data):
            raise BadType(f"Recorded data must be plain values, not {shown(data)}: data{flaw}.")
        if (session := self._get_recording()) is not None:
            session.log.append((kinds.USER_EVENT, {"kind": kind, **to_plain(data)}))

    def time(self) -> int:
        """Return nanoseconds: of the recording during a replay or recording, with one second per turn."""
        if self._replayer is not None:
            return self._replayer.clock
        return time.monotonic_ns() if self._session is None else self._session.turn * TURN_NS

    # -- replay -------------------------------------------------------------------------------------------------

    @refuse_while_deciding
    def replay(self, path: str | os.PathLike[str] | BinaryIO | Recording, *, start: int = 0) -> Iterator[Record]:
        """Apply a recording to this context, and yield its records one by one, as in 1.0.0.

        In a window any turn can be shown, so records may repeat or be skipped.

        Args:
            path: path of the recording; a binary stream; or an open recording, which stays open.
            start: number of turns before the first shown turn; 0 for version 2.

        Raises (at the first `next`):
            FileNotFoundError: the file does not exist.
            RecorderBusy (RuntimeError): a recording is being replayed already.
            RecordingError (ValueError): not a recording, or damaged, after the valid part has been applied. Or it does
            not fit this context.
            BadValue (ValueError): the start turn does not exist.
        """
        if self.ctx.is_terminated():
            return
        if self.is_replaying:
            raise RecorderBusy("A recording is being replayed already.")
        records = self._read_records(path, start)
        self.is_replaying = True
        try:
            yield from records
        except ContextTerminated:
            if not self.ctx.is_terminated():
                raise
        finally:
            if self._session is not None:
                self._session.end_replay()
            self.is_replaying = False
            self._replayer = None

    def _read_records(self, path: str | os.PathLike[str] | BinaryIO | Recording, start: int) -> Iterator[Record]:
        """Yield the records of a recording of any version while they are applied."""
        if isinstance(path, Recording):
            yield from self._replay_version_3(path, start, None)
            return
        stream, is_owned = open_readable(path)
        with ExitStack() as closing:
            if is_owned:
                lock_file(stream, alone=False)
                closing.callback(stream.close)
            if not 0 <= read_format(stream) < 3:
                owned = stream if is_owned else None
                if (yield from self._replay_version_3(Recording(Reader(stream)), start, owned)):
                    closing.pop_all()
            elif start:
                raise BadValue(f"A recording of version 2 is replayed from its beginning, not from turn {start}.")
            else:
                yield from self._replay_version_2(stream)

    def _replay_version_3(
        self, recording: Recording, start: int, owned: BinaryIO | None
    ) -> Generator[Record, None, bool]:
        """Replay, and return whether a window keeps the recording open for seeking."""
        reader = recording.reader
        replayer = Replayer(self.ctx, self._get_recording)
        self._replayer = replayer
        if reader.warning:
            self.ctx.logger.warning(reader.warning)
        playback = Playback(self.ctx, recording, replayer, owned)
        keep = getattr(self.ctx.visual, "show_playback", None)
        try:
            replayer.begin(reader)
            if start:
                playback.seek(start)
            if keep is not None:
                keep(playback)
            yield from replayer.play(reader)
        except BaseException:
            playback.close()
            raise
        return keep is not None

    def _replay_version_2(self, stream: BinaryIO) -> Iterator[Record]:
        replayer = Replayer(self.ctx, self._get_recording, is_version_2=True)
        self._replayer = replayer
        if (session := self._get_recording()) is not None and self._version == 2:
            session.take_records()
        for record in version2.read(stream):
            replayer.clock = record["timestamp"]
            session = self._get_recording()
            taken = session is not None and session.takes_records
            with session.as_replayed(deepcopy(record)) if session is not None and taken else nullcontext():
                if record["opCode"] != kinds.TERMINATE:
                    replayer.apply(record["opCode"], record["data"])
            yield record
            if self.ctx.is_terminated():
                return

    def _get_recording(self) -> RecordingSession | None:
        """Return the present recording."""
        return self._session if self.record() else None

    def _record_component_event(self, opcode_name: str, data: dict[str, Any]) -> None:
        if (session := self._get_recording()) is not None:
            session.note_component(OpCodes[opcode_name].value, to_plain(data))


def _check_record(opcode: object, data: object) -> None:
    """Check that a record of the user can be read back."""
    if not isinstance(opcode, OpCodes):
        raise BadType(f"opCode must be one of gamms.typing.OpCodes, not {shown(opcode)}.")
    if opcode is OpCodes.TERMINATE:
        raise BadValue("TERMINATE is written by ctx.record.stop().")
    if not isinstance(data, dict):
        raise BadType(f"Recorded data must be a dict of plain values, not {shown(data)}.")
    if flaw := describe_flaw(data):
        raise BadType(f"Recorded data must be a dict of plain values, not {shown(data)}: data{flaw}.")
    fields = {key: field for key, field in EVENTS[opcode.value].fields.items() if not field.is_optional}
    if missing := sorted(fields.keys() - data.keys()):
        raise BadValue(f"The data of {opcode.name} must have {', '.join(map(repr, missing))}, not only {list(data)}.")
    for key, field in fields.items():
        if field.check is not None:
            field.check(data[key], f"{key!r} of {opcode.name}")


def _check_options(version: object, created: object, provenance: Plain) -> dict[str, Any]:
    if not isinstance(version, int) or version not in ENCODERS:
        raise BadValue(f"version must be {' or '.join(map(str, ENCODERS))}, not {shown(version)}.")
    if flaw := describe_flaw(provenance):
        raise BadType(f"provenance must be plain values, not {shown(provenance)}: it{flaw}.")
    seconds = None if created is None else as_int(created, "created")
    refuse_finer_time(seconds or 0, "created")
    return {"created": seconds, "provenance": to_plain(provenance)}


__all__ = ["Recorder", "RecorderBusy", "RecordingError"]
