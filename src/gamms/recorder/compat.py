"""Compatibility with gamms 1.0.0: recordings of format version 2, and names of `ctx.record`."""

import io
from collections.abc import Callable, Iterable, KeysView, Mapping
from contextlib import suppress
from copy import deepcopy
from struct import Struct
from typing import Any, BinaryIO

import numpy as np

from gamms.errors import BadType, BadValue
from gamms.ir import events as kinds
from gamms.ir.events import EVENTS, Log, Mover, list_steps, records_of
from gamms.plain import Plain
from gamms.recorder.components import Components
from gamms.recorder.detached import DetachedState
from gamms.recorder.errors import Damaged
from gamms.recorder.formats.chunks import FORMS
from gamms.recorder.formats.version2 import SET, VERSION, BadCbor, CborReader, Record, Tagged
from gamms.recorder.formats.writer import Output
from gamms.recorder.keyframes import Keyframe
from gamms.recorder.replaying import TURN_NS
from gamms.recorder.session import RecordingSession
from gamms.text import reason
from gamms.typing.recorder import MAGIC_NUMBER, C, OpCodes

_MOST_WAITING = 1 << 16  # bytes
_FILE_HEADER = Struct(">4sI")
# The records whose data contain values passed by users.
_USERS = {OpCodes.AGENT_CREATE.value, OpCodes.COMPONENT_UPDATE.value}


class Version2Writer:
    """Writes records to a binary stream; each record is written completely or not at all."""

    def __init__(self, stream: BinaryIO) -> None:
        import cbor2

        self._dumps = cbor2.dumps
        self._tag = cbor2.CBORTag
        self._errors = (cbor2.CBOREncodeError, UnicodeEncodeError)
        self._stream = stream
        stream.write(_FILE_HEADER.pack(MAGIC_NUMBER, VERSION))

    def write(self, timestamp: int, opcode: int, data: Mapping[str, Plain] | None = None) -> None:
        """Write one record; with None `data` is left out, as in TERMINATE.

        Raises:
            BadType (TypeError): a value is not plain data; nothing was written.
            BadValue (ValueError): the data are too large or nested too deeply to be read; nothing was written.
        """
        record: Record = {"timestamp": timestamp, "opCode": opcode}
        try:
            if data is not None:
                record["data"] = self._make_plain(data) if opcode in _USERS else data
            encoded = self._dumps(record)
            if opcode in _USERS:
                CborReader(encoded).read_item()
        except self._errors as error:
            raise BadType(f"{OpCodes(opcode).name} cannot be recorded: {reason(error)}. Use plain data.") from error
        except (BadCbor, RecursionError) as error:
            raise BadValue(f"{OpCodes(opcode).name} cannot be recorded: {reason(error)}.") from error
        self._stream.write(encoded)

    def _make_plain(self, value: Plain) -> Plain:
        """Return the value in the form of cbor2, with sorted sets, so that equal games give equal bytes."""
        if isinstance(value, Mapping):
            return {self._make_plain(key): self._make_plain(one) for key, one in value.items()}
        if isinstance(value, list | tuple):
            return tuple(self._make_plain(one) for one in value)
        if isinstance(value, set | frozenset):
            return self._tag(SET, tuple(sorted(map(self._make_plain, value), key=self._dumps)))
        if isinstance(value, Tagged):
            return self._tag(value.number, self._make_plain(value.value))
        if isinstance(value, np.generic | np.ndarray):
            return self._make_plain(value.tolist())
        return value


class Version2Encoder:
    """Writes recordings for gamms 1.0.0; events that it does not know are left out."""

    holds_looks_and_drawings = False
    is_current = True
    values = 0  # never due: version 2 has no keyframes
    blocks = 0  # never due: flushed records are final

    def __init__(self, output: Output, _header: object) -> None:
        self._output = output
        self._waiting = io.BytesIO()
        self._writer = Version2Writer(self._waiting)
        self._agents: DetachedState  # positions of agents, which records of moves contain, but events do not
        self._turn = 0
        self._since = 0, 0  # a turn and its time stamp, from which other time stamps follow
        self._end: Record | None = None  # the last record of a copied recording, if nothing follows it

    def begin(self, session: RecordingSession, *, is_final: bool) -> None:  # noqa: ARG002 - nothing of it changes later
        """Write the header."""
        self._agents = DetachedState(deepcopy(session.begin))
        self.flush()

    def add(self, logs: list[Log]) -> None:
        """Write the logs of turns."""
        for log in logs:
            self._add(log)

    def _add(self, log: Log) -> None:
        is_over = True
        timestamp = self._find_timestamp(self._turn)
        for kind, data in list_steps(log):
            if kind == kinds.REPLAYED:
                self._copy(*data)
                is_over = is_over and data[0]["opCode"] != kinds.SIMULATE
                timestamp = self._find_timestamp(self._turn)
                continue
            mover = self._find_mover(kind, data)
            self._follow(kind, data)
            if kind in EVENTS and EVENTS[kind].records is not None:
                self._write(timestamp, records_of(kind, data, mover))
            is_over = is_over and kind != kinds.UNFINISHED
        if is_over:
            self._write(timestamp, [(kinds.SIMULATE, {})])
        self._turn += 1
        if self._waiting.tell() > _MOST_WAITING:
            self.flush()

    def _find_mover(self, kind: int, data: Plain) -> Mover | None:
        """Return the agent that an event moves or rotates."""
        agents = self._agents.agents
        if kind == kinds.MOVES or kind in FORMS:
            row = agents.find_numbered_row(data[0])
        elif kind == kinds.AERIAL_AGENT_POSITION and "node" in data:
            row = agents.find_row(data["agent_name"])
        else:
            return None
        return Mover(agents.columns["names"][row], int(agents.columns["node"][row]))

    def _follow(self, kind: int, data: Plain) -> None:
        """Apply an event about agents; invalid events written by a program are ignored."""
        if kind == kinds.SNAPSHOT or kind >> 24 == kinds.AGENT_CREATE >> 24:
            with suppress(Damaged):
                self._agents.apply_event(kind, data)

    def _find_timestamp(self, turn: int) -> int:
        begin, timestamp = self._since
        return timestamp + (turn - begin) * TURN_NS

    def _copy(self, record: Record, noted: Log) -> None:
        """Copy a record of another recording, and continue from its time stamp."""
        for kind, data in list_steps(noted):
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

    def write_keyframe(self, keyframe: Keyframe) -> None:
        """Do nothing: version 2 has no keyframes."""

    def flush(self) -> None:
        """Flush the stream to the system."""
        if self._waiting.tell():
            self._output.append(self._waiting.getvalue())
            self._waiting.seek(0)
            self._waiting.truncate()

    def close(self) -> None:
        """Write the final record."""
        timestamp = max(self._since[1], self._find_timestamp(self._turn - 1))
        end = self._end or {"timestamp": timestamp, "opCode": kinds.TERMINATE}
        self._writer.write(end["timestamp"], end["opCode"], end.get("data"))
        self.flush()


class ComponentNames:
    """Names of 1.0.0 for `ctx.record.components`."""

    components: Components

    def component(self, struct: Mapping[str, object] | None) -> Callable[[C], C]:
        """Return a class decorator; see `Components.component`."""
        return self.components.component(struct)

    def get_component(self, name: str) -> object:
        """Return a component by name (KeyError)."""
        return self.components.get_component(name)

    def delete_component(self, name: str) -> None:
        """Delete a component (KeyError)."""
        self.components.delete_component(name)

    def component_iter(self) -> KeysView[Any]:
        """Return the names of the components."""
        return self.components.component_iter()

    def add_component(self, name: str, obj: object) -> None:
        """Add a component under a name (ValueError if it is taken)."""
        self.components.add_component(name, obj)

    def is_component_registered(self, key: tuple[str, str]) -> bool:
        """Return whether a component class is registered, by module and qualified name."""
        return self.components.is_component_registered(key)

    def unregister_component(self, key: tuple[str, str]) -> None:
        """Unregister a component class (KeyError)."""
        self.components.unregister_component(key)

    # NOTE: programs access these two (docs on compatibility).

    @property
    def _components(self) -> dict[Any, Any]:
        return self.components._components

    @property
    def _component_registry(self) -> dict[tuple[str, str], type]:
        return self.components._component_registry
