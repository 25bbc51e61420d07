"""Replay a recording: apply its events to a live context, and yield them as records of 1.0.0."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from copy import deepcopy
from functools import partial
from typing import Any

import numpy as np

from gamms.arguments import as_numbers
from gamms.errors import BadType, BadValue, ContextTerminated, GammsError
from gamms.ir import events as kinds
from gamms.ir.agents import AgentBlock
from gamms.ir.event_targets import AgentsState, State
from gamms.ir.events import (
    COMPONENTS,
    EVENTS,
    LOGGED,
    Mover,
    as_entry,
    list_events,
    records_of,
)
from gamms.ir.graph import GraphColumns, IntArray
from gamms.ir.journal import Journal, MutedJournal
from gamms.ir.schema import ATTRIBUTES, CHANGE_EVENTS, ON_EDGES, VECTORS
from gamms.knowledge import looks as sensed
from gamms.knowledge.fields import FieldTable, find_first_turn
from gamms.knowledge.looks import Look, Report, Reports
from gamms.knowledge.sides import list_assigned_labels
from gamms.plain import Plain
from gamms.recorder import keyframes, maps
from gamms.recorder.errors import UNFIT, Damaged, RecordingError, report_damage
from gamms.recorder.formats.chunks import FORMS
from gamms.recorder.formats.reader import Reader
from gamms.recorder.keyframes import Keyframe
from gamms.recorder.session import RecordingSession
from gamms.text import reason, shown
from gamms.typing.actions import as_position
from gamms.typing.context import HostContext
from gamms.typing.recorder import OpCodes

Record = dict[str, Any]  # timestamp, opCode, data

TURN_NS = 1_000_000_000  # duration of a turn in time stamps, which depend only on the turns


class LiveState(State):
    """A live context to which the events of a recording of version 3 are applied, exactly.

    Attributes:
        pace: increment of the turn number of the game.
        shown_turn: turn number of the game after the last turn that was applied.
        sensor_ids: ids of the sensors of the recording; other sensors belong to the program, and stay.
    """

    agents: "LiveAgents"

    def __init__(self, ctx: HostContext) -> None:
        self._ctx = ctx
        self.agents = LiveAgents(ctx)
        self.game = ctx.game.internals.state
        self.pace = 0
        self.shown_turn = 0
        self._shown: Any = {}  # artists of the recording
        self.sensor_ids: set[str] = set()

    def restore(self, snapshot: Keyframe) -> None:
        """Apply a snapshot: agents with the same name and kind are moved, missing ones created, others stay."""
        self.agents.restore(snapshot, lambda: self._restore_sensors(snapshot.get("sensor_kinds", ())))
        game = self.game
        keyframes.restore_game(game, snapshot)
        self.set_rng(snapshot.get("chance"))
        if "events" in snapshot:
            for log in LOGGED.values():
                getattr(game, log)[:] = [as_entry(log, entry) for entry in snapshot.get(log, ())]
            self.publish(deepcopy(snapshot.get("facts", {})), list(game.facts))
        if "starts" in snapshot:
            game.began = dict(snapshot["starts"])
        self.pace = int(snapshot.get("pace", 0))
        self.shown_turn = game.turn

    def end_turn(self) -> None:
        """End the turn, also in a recording of this context."""
        self.game.turn += self.pace
        self.shown_turn = self.game.turn
        self._ctx.visual.simulate()

    def count(self, turn: int, pace: int, starts: dict[str, Any]) -> None:
        """Set the number of this turn, and the increment for the following turns; agents began at `starts`."""
        self.pace = pace
        self.game.turn = turn - pace
        self.game.began |= starts

    def append(self, log: str, entry: dict[str, Any]) -> None:
        """Append to a log of the game."""
        getattr(self.game, log).append(entry)

    def publish(self, facts: dict[str, Any], removed: Sequence[str]) -> None:
        """Publish facts, and withdraw others."""
        for name in removed:
            self.game.facts.pop(name, None)
        self._ctx.game.publish(**deepcopy(facts))

    def set_rng(self, rng_state: Mapping[str, Plain] | None) -> None:
        """Set the state of the context's own random stream; None: it was not used."""
        if rng_state is not None:
            self._ctx.rng.bit_generator.state = rng_state

    def change_sensors(self, groups: list[dict[str, Plain]], removed: Iterable[str]) -> None:
        """Remove sensors, then add or update others."""
        for sensor_id in removed:
            if sensor_id in self._ctx.sensor.sensors:
                self._ctx.sensor.delete_sensor(sensor_id)
        for sensor in keyframes.list_sensors(groups):
            self._ctx.sensor.storage.put(sensor)
            self.sensor_ids.add(sensor["id"])

    def _restore_sensors(self, groups: list[dict[str, Plain]]) -> None:
        gone = self.sensor_ids - {sensor["id"] for sensor in keyframes.list_sensors(groups)}
        self.change_sensors(groups, sorted(gone))

    def replace_world(self, world: bytes) -> None:
        """Replace the graph and the obstacles."""
        self._ctx.graph.storage.unpack(world)

    def show(self, visuals: dict[str, Any]) -> None:
        """Declare visuals; a custom visual engine may have no artists."""
        artists = getattr(self._ctx.visual, "artists", None)
        if artists is not None:
            self._shown = artists.add_specs(visuals, self._shown)

    def order_sides(self, sides: Sequence[str | None], labels: Sequence[str]) -> None:
        """Declare the order in which teams get their colors, and the assigned texts of sides."""
        drawing = getattr(self._ctx.visual, "drawing", None)
        if drawing is not None:
            drawing.sides = sides
            drawing.labels = labels

    def show_reports(self, read: Callable[[], Reports | None]) -> None:
        """Let pictures read the reports of sensors; the function returns None if no state of the recording is shown."""
        drawing = getattr(self._ctx.visual, "drawing", None)
        if drawing is not None:
            drawing.carriers.read_reports = read

    def draw(self, drawing: dict[str, Any]) -> None:
        """Set the draw commands of an artist."""
        artists = getattr(self._ctx.visual, "artists", None)
        if artists is not None:
            artists.add_drawing(drawing)

    def change_component(self, kind: int, data: dict[str, Any]) -> None:
        """Apply a change of components; the components record it if the context is being recorded."""
        self._ctx.record.components.apply(OpCodes(kind).name, data)


class LiveAgents(AgentsState):
    """The agents of a live context; events in its journal use the agent numbers of that journal.

    Attributes:
        names: number in the recording -> name.
        following: number of the next new agent.
    """

    def __init__(self, ctx: HostContext) -> None:
        self._ctx = ctx
        self._engine = ctx.agent
        self.names: dict[int, str] = {}
        self.following = 0

    # -- who is there ---------------------------------------------------------------------------------------------

    def restore(self, snapshot: Keyframe, make_sensors: Callable[[], None]) -> None:
        """Create and place the agents of a snapshot."""
        columns = keyframes.check_columns(keyframes.unpack_keyframe(snapshot))
        numbers = columns["numbers"].tolist()
        names = columns["names"]
        self.following = keyframes.check_following(numbers, snapshot["next"])
        make_sensors()
        with self._engine.block.accept_any_node():
            for row, name in enumerate(names):
                self._put(name, columns, row)
            keyframes.restore_beside_agents(self._engine.block, snapshot)
        self.names = dict(zip(numbers, names, strict=True))

    def _put(self, name: str, columns: dict[str, Any], row: int) -> None:
        flies = bool(columns["kind"][row])
        speed = columns["speed"][row]
        sensors = columns["sensors"][row]
        agent = self._engine.agents.get(name)
        if agent is None or bool(agent.type) != flies:
            if agent is not None:
                self._engine.delete_agent(name)
            given: dict[str, Any] = {"start_node_id": int(columns["node"][row]), "sensors": sensors}
            if flies:
                given |= {"type": 1, "speed": speed}
            given |= {key: value for key, value in columns["attributes"][row].items() if key == "mode"}
            agent = self._engine.create_agent(name, **given)
        self._equip_as(agent, sensors)
        for key, value in columns["attributes"][row].items():
            if key != "mode" or flies:  # on the ground, it is fixed
                agent.__dict__[key] = deepcopy(value)
        agent.team = columns["teams"][row]
        agent.alive = bool(columns["alive"][row])
        if not flies:
            agent.speed = speed
        self._block.write(self._block.find_row(name), keyframes.get_row(columns, row))

    def _equip_as(self, agent: Any, sensors: dict[str, str]) -> None:
        """Set the sensors of an agent, without missing ones."""
        there = {name: sensor_id for name, sensor_id in sensors.items() if sensor_id in self._ctx.sensor.sensors}
        if list(there.items()) != [(name, sensor.sensor_id) for name, sensor in agent.sensors.items()]:
            for name in list(agent.sensors):
                agent.deregister_sensor(name)
            for name, sensor_id in there.items():
                agent.register_sensor(name, self._ctx.sensor.get_sensor(sensor_id))

    def add(self, name: str, kwargs: dict[str, Any], state: dict[str, Any], strategy: str | None) -> None:  # noqa: ARG002
        """Create an agent exactly as it was, even on a node that no longer exists."""
        places = {key: tuple(map(float, value)) for key, value in state.items() if key in VECTORS}
        for key, numbers in places.items():
            if len(numbers) != VECTORS[key]:
                raise BadValue(f"{shown(key)} has {VECTORS[key]} numbers, and not {shown(numbers)}.")
        with self._engine.block.accept_any_node():
            agent = self._engine.create_agent(name, **kwargs)
        self._block.write(self._block.find_row(agent.name), places)
        self.names[self.following] = name
        self.following += 1

    def remove(self, name: str) -> None:
        """Delete an agent."""
        self._engine.get_agent(name)
        self._engine.delete_agent(name)

    @property
    def _block(self) -> AgentBlock:
        block: AgentBlock = self._engine.block
        return block

    def find_row(self, name: str) -> int:
        """Return the row of an agent by name (KeyError)."""
        return self._block.find_row(self._engine.get_agent(name).name)

    def find_numbered_row(self, number: int) -> int:
        """Return the row of an agent by number.

        Raises:
            Damaged: the agent does not exist.
        """
        try:
            return self._block.find_row(self.names[number])
        except KeyError as error:
            raise Damaged(f"Agent number {number} is not there: {reason(error)}") from error

    # -- what they are --------------------------------------------------------------------------------------------

    def set(self, row: int, column: str, value: Plain) -> None:
        """Set a column of an agent; strategies are functions, and not in recordings."""
        if column in CHANGE_EVENTS:
            if column == "speed" and self._block.kind[row]:
                raise BadType(f"Agent {self._block.names[row]!r} flies, so its speed is fixed.")
            self._block.set(row, column, value)
        elif column != "strategies":
            self._block.write(row, {column: value})

    def move(self, numbers: Sequence[int], nodes: Sequence[int]) -> None:
        """Move agents on the ground, and record it."""
        for number, node in zip(numbers, nodes, strict=True):
            self.move_one(int(number), int(node))

    def move_one(self, number: int, node: int) -> tuple[str, int]:
        """Move an agent, and record it; return its name, and its previous node."""
        block = self._engine.block
        name = self.names[number]
        row = block.find_row(name)
        before: int = block.get_node(row)
        block.move(row, node)
        return name, before

    def fly(self, row: int, node: int | None, position: tuple[float, ...]) -> None:
        """Move a flying agent, and record it."""
        self._check_flies(row)
        self._block.fly(row, as_position(position), node)

    def set_rotation(self, row: int, quat: tuple[float, ...]) -> None:
        """Set the rotation of a flying agent, and record it."""
        w, x, y, z = as_numbers(quat, "quat", "(w, x, y, z)")
        self._check_flies(row)
        self._block.set_rotation(row, (w, x, y, z))

    def get_mover(self, row: int) -> Mover:
        """Return a flying agent before its move, with its node."""
        self._check_flies(row)
        return Mover(self._block.names[row], self._block.find_nearest_node(row))

    def _check_flies(self, row: int) -> None:
        if not self._block.kind[row]:
            raise BadType(f"Agent {self._block.names[row]!r} does not fly.")

    def set_progress(self, numbers: IntArray, columns: Mapping[str, np.ndarray[Any, Any]]) -> None:
        """Set the progress of agents along edges."""
        zeros = np.zeros(len(numbers), np.int64)
        places = [columns.get(name, zeros) for name in ON_EDGES]
        for number, *where in zip(numbers.tolist(), *places, strict=True):
            self._block.write(self.find_numbered_row(number), {"progress": keyframes.make_progress(*where)})

    def set_attribute(self, numbers: Sequence[int], name: str, values: Sequence[Plain] | None) -> None:
        """Set or delete a custom attribute."""
        for number, value in zip(numbers, [None] * len(numbers) if values is None else values, strict=True):
            agent = self._get_agent(self.find_numbered_row(number))
            known = getattr(type(agent), name, None)
            if name[0] == "_" or callable(known) or isinstance(known, property):
                raise BadValue(f"{shown(name)} is no attribute of agent {agent.name!r} that a program may set.")
            if values is None:
                agent.__dict__.pop(name, None)
            else:
                setattr(agent, name, deepcopy(value))

    def _get_agent(self, row: int) -> Any:
        return self._engine.agents[self._block.names[row]]

    def equip(self, row: int, name: str, sensor_id: str) -> None:
        """Add a sensor to an agent, if the sensor exists."""
        sensor = self._ctx.sensor.sensors.get(sensor_id)
        if sensor is None:
            self._ctx.logger.error(f"Sensor {shown(sensor_id)} does not exist: it is left out of the replay.")
            return
        try:
            self._get_agent(row).register_sensor(name, sensor)
        except GammsError as error:
            self._ctx.logger.error(f"{reason(error)} The sensor is left out of the replay.")  # noqa: TRY400 - ILogger has none

    def unequip(self, row: int, name: str) -> None:
        """Remove a sensor from an agent, unless it is already gone."""
        if name in self._get_agent(row).sensors:
            self._get_agent(row).deregister_sensor(name)

    # -- the journal ----------------------------------------------------------------------------------------------

    @contextmanager
    def mute(self) -> Iterator[None]:
        """Record no changes of agents, because one event describes them."""
        block = self._block
        if block.journal.is_silent:
            yield
            return
        journal = block.journal
        block.journal = MutedJournal(block.journal)
        try:
            yield
        finally:
            block.journal = journal

    def note(self, kind: int, data: Plain) -> None:
        """Record an event of the recording, with the agent numbers of the journal."""
        journal: Journal = self._block.journal
        if journal.is_silent:
            return

        def number_of(number: int) -> int:
            return journal.ids[self.find_numbered_row(number)]

        renumber = sensed.renumber_looks if kind == kinds.SENSED else partial(kinds.renumber_event, kind)
        journal.append(kind, renumber(data, number_of))


# -- format version 2 -----------------------------------------------------------------------------------------------


class LegacyState(LiveState):
    """A context to which records of version 2 are applied as in gamms 1.0.0, which recorded more than it accepted.

    The records are actions of a program: they are checked and recorded like those.
    """

    def __init__(self, ctx: HostContext) -> None:
        super().__init__(ctx)
        self.agents = _LegacyAgents(ctx)

    def change_component(self, kind: int, data: dict[str, Any]) -> None:
        """Apply an operation on components, unless 1.0.0 refused it after recording it."""
        self._ctx.record.components.apply(OpCodes(kind).name, data, lenient=True)


class _LegacyAgents(LiveAgents):
    def add(self, name: str, kwargs: dict[str, Any], state: dict[str, Any], strategy: str | None) -> None:  # noqa: ARG002
        """Create an agent, unless 1.0.0 refused it."""
        is_refused = name in self._engine.agents or "start_node_id" not in kwargs
        if not is_refused and not (kwargs.get("type") == 1 and "speed" not in kwargs):
            self._engine.create_agent(name, **kwargs)

    def remove(self, name: str) -> None:
        """Delete an agent, if it exists."""
        if name in self._engine.agents:
            self._engine.delete_agent(name)

    def set(self, row: int, column: str, value: Plain) -> None:
        """Set an attribute of an agent."""
        setattr(self._get_agent(row), ATTRIBUTES[column], value)

    def fly(self, row: int, node: int | None, position: tuple[float, ...]) -> None:  # noqa: ARG002
        """Move a flying agent; the graph gives the node below."""
        self._get_agent(row).position = position


# -- replay -------------------------------------------------------------------------------------------------------


class ReportReader:
    """Reads the sensor reports that follow the turns of a recording, from which agents decide next.

    Args:
        reader: reader of the recording.
        get_map: returns the first map of the recording.
    """

    def __init__(self, reader: Reader, get_map: Callable[[], GraphColumns]) -> None:
        self._reader = reader
        self._get_map = get_map
        self._fields = FieldTable()
        self._following = 0  # turn to be read next
        self._latest: tuple[int, bool, list[tuple[int, Look]]] = (-1, False, [])

    def read(self, turn: int) -> tuple[bool, list[tuple[int, Look]]]:
        """Return the reports after a number of turns, by numbers of agents, and before them whether these are early.

        If none follow, such as after the last turn, they are those of the turn itself, before its moves.

        Raises:
            RecordingError: they are damaged.
        """
        if turn != self._latest[0]:
            following = self._read(turn)
            is_early = not following and turn > 0
            self._latest = turn, is_early, self._read(turn - 1) if is_early else following
        return self._latest[1:]

    def _read(self, turn: int) -> list[tuple[int, Look]]:
        if turn >= self._reader.turns:
            return []
        first = find_first_turn(turn)
        if self._following <= turn:
            first = max(first, self._following)
        found = list[tuple[int, Look]]()
        with report_damage("The sensor data are damaged", with_type=True):
            now = []
            for at, *_, data in self._reader.events(first, turn + 1, {kinds.SENSED}):
                if at == turn:
                    now.append(data)
                else:
                    self._fields.read(data, len(data["which"]))
            sensed.refuse_many(now)
            for data in now:
                found += sensed.decode_looks(data, None, self._fields, self._get_map)
        self._following = turn + 1
        return found


_Ongoing = Callable[[], RecordingSession | None]


class Replayer:
    """Applies events to a context, and records them if the context is being recorded.

    Args:
        ctx: the context.
        recording: returns the present recording, if any.
        is_version_2: whether the events are records of 1.0.0, which recorded more than it accepted.

    Attributes:
        state: the state to which events are applied.
        clock: time stamp of the present record.
        turn: number of turns replayed, including the turn that is shown.
    """

    def __init__(self, ctx: HostContext, recording: _Ongoing = lambda: None, *, is_version_2: bool = False) -> None:
        self._ctx = ctx
        self._recording = recording
        self._is_version_2 = is_version_2
        self.state = LegacyState(ctx) if is_version_2 else LiveState(ctx)
        self.clock = 0
        self.turn = 0

    def begin(self, reader: Reader) -> None:
        """Apply the initial state of a recording of version 3.

        Raises:
            RecordingError: it is damaged, or does not fit the context.
        """
        self._declare(reader.header)
        begin = reader.keyframe(0)
        first_map = self._ctx.graph.columns()
        reports = ReportReader(reader, lambda: first_map)
        self.state.show_reports(lambda: self._get_reports(reports))
        if begin is not None:
            self._begin(reader.header, begin[1])
        elif reader.turns or not reader.warning:  # otherwise it was truncated after its map
            raise RecordingError("This recording has no initial state.")

    def begin_with(self, header: dict[str, Any], snapshot: Keyframe) -> None:
        """Apply a snapshot of a game whose recording has this header.

        Raises:
            RecordingError: it does not fit the context.
        """
        self._declare(header)
        self._begin(header, snapshot)

    def _declare(self, header: dict[str, Any]) -> None:
        maps.attach(self._ctx, header)
        self.show(header.get("visuals"), header.get("drawings", []))
        self.state.order_sides(_read_sides(header), list_assigned_labels(header))

    def play(self, reader: Reader) -> Iterator[Record]:
        """Apply the turns of a recording from the present one on, and yield their records.

        Raises:
            RecordingError: the recording is damaged, or does not fit the context; the valid part has been applied.
        """
        while self.turn < reader.turns:
            yield from self.play_turn(reader)
            if self._ctx.is_terminated():
                return
        yield {"timestamp": max(0, reader.turns - 1) * TURN_NS, "opCode": kinds.TERMINATE}

    def play_turn(self, reader: Reader) -> Iterator[Record]:
        """Apply the next turn, and yield its records; a seek during the iteration changes the next turn."""
        self.turn += 1
        return self._replay_turn(self.turn - 1, reader.log(self.turn - 1))

    def play_log(self, log: kinds.Log) -> None:
        """Apply the log of the next turn."""
        self.turn += 1
        for _ in self._replay_turn(self.turn - 1, log):
            pass

    def _get_reports(self, reports: ReportReader) -> Reports | None:
        """Return the reports for the turn that is shown; None once the program plays on by itself."""
        if self.state.game.turn != self.state.shown_turn:
            return None
        names = self.state.agents.names
        is_early, looks = reports.read(self.turn)
        found: dict[tuple[str, str], Report] = {}
        nearest_last = looks if is_early else looks[::-1]  # an agent may report several times in a turn
        for number, look in nearest_last:
            if number in names:
                found[names[number], look.sensor] = Report(look, names, is_early)
        return found

    def play_until_sensed(self, log: kinds.Log, agent: str) -> Any:
        """Apply a turn until an agent senses, and return the sensor data; None if it does not sense."""
        for code, data in list_events(log):
            if code != kinds.SENSED:
                self.apply(code, data)
                continue
            with report_damage("The sensor data are damaged", with_type=True):
                if agent in map(self.state.agents.names.get, data["agents"].tolist()):
                    return data
        return None

    def _begin(self, header: dict[str, Any], snapshot: dict[str, Plain]) -> None:
        recording = self._recording()
        with report_damage("This recording cannot begin here"):
            is_adopted = recording is not None and recording.adopt(header, snapshot)
            with self.state.agents.mute():
                self.state.restore(snapshot)
        if recording is not None:
            recording.renumber(snapshot) if is_adopted else recording.emit_snapshot()

    def _replay_turn(self, turn: int, log: kinds.Log) -> Iterator[Record]:
        timestamp = turn * TURN_NS
        is_over = True
        ctx = self._ctx
        for kind, data in list_events(log):
            if ctx.is_terminated():
                return
            self.clock = timestamp
            if kind == kinds.MOVES:
                yield from self._replay_moves(data, turn)
            elif kind == kinds.UNFINISHED:
                is_over = False
            else:
                mover = self.apply(kind, data)
                for code, record in records_of(kind, data, mover):
                    yield {"timestamp": timestamp, "opCode": code, "data": record}
        if is_over and not ctx.is_terminated():
            self.apply(kinds.SIMULATE, {})
            yield {"timestamp": timestamp, "opCode": kinds.SIMULATE, "data": {}}

    def _replay_moves(self, flat: list[int], turn: int) -> Iterator[Record]:
        timestamp = turn * TURN_NS
        is_terminated = self._ctx.is_terminated
        move = self.state.agents.move_one
        for number, node in zip(flat[::2], flat[1::2], strict=True):
            if is_terminated():
                return
            try:
                name, before = move(number, node)
            except UNFIT as error:
                raise RecordingError(f"Turn {turn} moves agent number {number}: {reason(error)}") from error
            # NOTE: `records_of` would take half as long again (benchmarks: replay).
            data = {"agent_name": name, "node_id": before}
            yield {"timestamp": timestamp, "opCode": kinds.AGENT_PREV_NODE, "data": data}
            data = {"agent_name": name, "node_id": node}
            yield {"timestamp": timestamp, "opCode": kinds.AGENT_CURRENT_NODE, "data": data}

    def apply(self, kind: int, data: Plain) -> Mover | None:
        """Apply an event, and record it if the context is being recorded; unknown events are only recorded.

        Returns:
            The flying agent that was moved, with its previous node, or None.

        Raises:
            RecordingError: the event does not fit; the context is unchanged.
        """
        known = EVENTS.get(kind)
        agents = self.state.agents
        mover = None
        if known is None and self._is_version_2:
            raise RecordingError(f"Operation code {kind:#010x} does not exist in gamms 1.0.0.")
        notes_itself = (
            self._is_version_2 or kind in FORMS or kind in COMPONENTS or kind in (kinds.MOVES, kinds.SIMULATE)
        )
        try:
            if kind in FORMS:
                mover = agents.get_mover(agents.find_numbered_row(data[0]))
            elif kind == kinds.AERIAL_AGENT_POSITION and not self._is_version_2:
                mover = agents.get_mover(agents.find_row(data["agent_name"]))
            with nullcontext() if notes_itself else agents.mute():
                if known is not None:
                    known.apply(self.state, data)
            if kind == kinds.SNAPSHOT:
                self._note_snapshot(data)
            elif not notes_itself:
                agents.note(kind, data)
        except (ContextTerminated, RecordingError):
            raise
        except UNFIT as error:
            if kind == kinds.SIMULATE:  # actions of the program after each turn
                raise
            raise RecordingError(f"An event of kind {kind:#010x} cannot happen here: {reason(error)}") from error
        return mover

    def _note_snapshot(self, snapshot: dict[str, Plain]) -> None:
        """Record a snapshot unchanged if it is complete; otherwise the present state."""
        recording = self._recording()
        if recording is not None and list(self._ctx.agent.agents) == list(snapshot["names"]):
            self._ctx.agent.block.journal.append(kinds.SNAPSHOT, snapshot)
            recording.renumber(snapshot)
        elif recording is not None:
            recording.emit_snapshot()

    def show(self, visuals: dict[str, Plain] | None, drawings: Iterable[dict[str, Plain]] = ()) -> None:
        """Declare the visuals of a recording; None: unchanged.

        Raises:
            RecordingError: the visuals are invalid.
        """
        if visuals is not None:
            with report_damage("The visuals of this recording are invalid", with_type=True):
                self.state.show(visuals)
                for drawing in drawings:
                    self.state.draw(drawing)


def _read_sides(header: Mapping[str, Any]) -> tuple[str | None, ...]:
    """Return the sides in the header of a cut recording; empty for a whole recording."""
    sides = header.get("sides", ())
    if not isinstance(sides, list | tuple) or any(not isinstance(side, str | None) for side in sides):
        raise RecordingError(f"The sides in the header of this recording are invalid: {shown(sides)}.")
    return tuple(sides)
