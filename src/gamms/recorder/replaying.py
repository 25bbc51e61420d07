"""Replay a recording: apply its events to a live context, and yield them in the form of 1.0.0."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from copy import deepcopy
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
    events_of,
    records_of,
)
from gamms.ir.graph import IntArray
from gamms.ir.journal import Journal, MutedJournal
from gamms.ir.schema import ATTRIBUTES, CHANGE_EVENTS, ON_EDGES, VECTORS
from gamms.plain import Plain
from gamms.recorder import keyframes, maps, sensed
from gamms.recorder.errors import UNFIT, Damaged, RecordingError, refusing
from gamms.recorder.formats.chunks import FORMS
from gamms.recorder.formats.reader import Reader
from gamms.recorder.keyframes import Keyframe
from gamms.recorder.session import RecordingSession
from gamms.text import reason, shown
from gamms.typing.actions import as_position
from gamms.typing.context import HostContext
from gamms.typing.recorder import OpCodes

Record = dict[str, Any]  # timestamp, opCode, data

TURN_NS = 1_000_000_000  # what a turn lasts in time stamps, which follow from the turns alone


class LiveState(State):
    """A context that becomes what a recording of version 3 says, to the last bit.

    Attributes:
        pace: by how much the game counts on in a turn.
        sensor_ids: of the sensors of the recording; others are the program's own, and stay.
    """

    agents: "LiveAgents"

    def __init__(self, ctx: HostContext) -> None:
        self._ctx = ctx
        self.agents, self.game, self.pace = LiveAgents(ctx), ctx.game.internals.state, 0
        self._shown: Any = {}  # artists of the recording
        self.sensor_ids: set[str] = set()

    def restore(self, snapshot: Keyframe) -> None:
        """Become what a snapshot says: agents of the same name and kind are moved, missing ones made, others stay."""
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

    def end_turn(self) -> None:
        """End the turn, also of a recording that is being written."""
        self.game.turn += self.pace
        self._ctx.visual.simulate()

    def count(self, turn: int, pace: int, starts: dict[str, Any]) -> None:
        """Number this turn, when it is over, and the following ones by adding `pace`; agents began at `starts`."""
        self.pace, self.game.turn = pace, turn - pace
        self.game.began |= starts

    def append(self, log: str, entry: dict[str, Any]) -> None:
        """Add to one of the logs of the game."""
        getattr(self.game, log).append(entry)

    def publish(self, facts: dict[str, Any], removed: Sequence[str]) -> None:
        """Publish facts, and withdraw others."""
        for name in removed:
            self.game.facts.pop(name, None)
        self._ctx.game.publish(**deepcopy(facts))

    def set_rng(self, rng_state: Mapping[str, Plain] | None) -> None:
        """Set the state of the context's own random stream; None: it was not drawn from."""
        if rng_state is not None:
            self._ctx.rng.bit_generator.state = rng_state

    def change_sensors(self, groups: list[dict[str, Plain]], removed: Iterable[str]) -> None:
        """Remove sensors, then make or set others."""
        for sensor_id in removed:
            if sensor_id in self._ctx.sensor.sensors:
                self._ctx.sensor.delete_sensor(sensor_id)
        for sensor in keyframes.sensors_in(groups):
            self._ctx.sensor.storage.put(sensor)
            self.sensor_ids.add(sensor["id"])

    def _restore_sensors(self, groups: list[dict[str, Plain]]) -> None:
        gone = self.sensor_ids - {sensor["id"] for sensor in keyframes.sensors_in(groups)}
        self.change_sensors(groups, sorted(gone))

    def replace_world(self, world: bytes) -> None:
        """Replace graph and obstacles."""
        self._ctx.graph.storage.unpack(world)

    def show(self, visuals: dict[str, Any]) -> None:
        """Declare what it looks like; a visual engine of the caller's may have no artists."""
        artists = getattr(self._ctx.visual, "artists", None)
        if artists is not None:
            self._shown = artists.add_specs(visuals, self._shown)

    def order_sides(self, sides: Sequence[str | None]) -> None:
        """Declare in which order teams choose their colours."""
        drawing = getattr(self._ctx.visual, "drawing", None)
        if drawing is not None:
            drawing.sides = sides

    def draw(self, drawing: dict[str, Any]) -> None:
        """Let an artist draw these commands from now on."""
        artists = getattr(self._ctx.visual, "artists", None)
        if artists is not None:
            artists.add_drawing(drawing)

    def change_component(self, kind: int, data: dict[str, Any]) -> None:
        """Apply a change of components, which note it themselves."""
        self._ctx.record.components.apply(OpCodes(kind).name, data)


class LiveAgents(AgentsState):
    """The agents of a context. What has a number is noted in the journal with the number that the agent has there.

    Attributes:
        names: number in the recording -> name.
        following: the number that the next new agent gets.
    """

    def __init__(self, ctx: HostContext) -> None:
        self._ctx, self._engine = ctx, ctx.agent
        self.names: dict[int, str] = {}
        self.following = 0

    # -- who is there ---------------------------------------------------------------------------------------------

    def restore(self, snapshot: Keyframe, make_sensors: Callable[[], None]) -> None:
        """Make and place the agents of a snapshot."""
        columns = keyframes.checked(keyframes.opened(snapshot))
        numbers, names = columns["numbers"].tolist(), columns["names"]
        self.following = keyframes.checked_following(numbers, snapshot["next"])
        make_sensors()
        with self._engine.block.accepting_any_node():
            for row, name in enumerate(names):
                self._put(name, columns, row)
            keyframes.restore_beside_agents(self._engine.block, snapshot)
        self.names = dict(zip(numbers, names, strict=True))

    def _put(self, name: str, columns: dict[str, Any], row: int) -> None:
        flies, speed, sensors = bool(columns["kind"][row]), columns["speed"][row], columns["sensors"][row]
        agent = self._engine.agents.get(name)
        if agent is None or bool(agent.type) != flies:
            if agent is not None:
                self._engine.delete_agent(name)
            given: dict[str, Any] = {"start_node_id": int(columns["node"][row]), "sensors": sensors}
            if flies:
                given |= {"type": 1, "speed": speed}
            agent = self._engine.create_agent(name, **given)
        self._equip_as(agent, sensors)
        for key, value in columns["attributes"][row].items():
            agent.__dict__[key] = deepcopy(value)
        agent.team, agent.alive = columns["teams"][row], bool(columns["alive"][row])
        if not flies:
            agent.speed = speed
        self._block.write(self._block.row_of(name), keyframes.row_of(columns, row))

    def _equip_as(self, agent: Any, sensors: dict[str, str]) -> None:
        """Let an agent carry these sensors, as far as there are such."""
        there = {name: sensor_id for name, sensor_id in sensors.items() if sensor_id in self._ctx.sensor.sensors}
        if list(there.items()) != [(name, sensor.sensor_id) for name, sensor in agent.sensors.items()]:
            for name in list(agent.sensors):
                agent.deregister_sensor(name)
            for name, sensor_id in there.items():
                agent.register_sensor(name, self._ctx.sensor.get_sensor(sensor_id))

    def add(self, name: str, kwargs: dict[str, Any], state: dict[str, Any], strategy: str | None) -> None:  # noqa: ARG002
        """Create an agent where it was, perhaps on a node that the map has no longer; and to the last bit."""
        places = {key: tuple(map(float, value)) for key, value in state.items() if key in VECTORS}
        for key, numbers in places.items():
            if len(numbers) != VECTORS[key]:
                raise BadValue(f"{shown(key)} has {VECTORS[key]} numbers, and not {shown(numbers)}.")
        with self._engine.block.accepting_any_node():
            agent = self._engine.create_agent(name, **kwargs)
        self._block.write(self._block.row_of(agent.name), places)
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

    def row(self, name: str) -> int:
        """Return the row of an agent by its name (KeyError)."""
        return self._block.row_of(self._engine.get_agent(name).name)

    def row_of(self, number: int) -> int:
        """Return the row of an agent by its number.

        Raises:
            Damaged: there is none.
        """
        try:
            return self._block.row_of(self.names[number])
        except KeyError as error:
            raise Damaged(f"Agent number {number} is not there: {reason(error)}") from error

    # -- what they are --------------------------------------------------------------------------------------------

    def set(self, row: int, column: str, value: Plain) -> None:
        """Set one column of an agent; strategies are functions, which a recording does not hold."""
        if column in CHANGE_EVENTS:
            if column == "speed" and self._block.kind[row]:
                raise BadType(f"Agent {self._block.names[row]!r} flies, and keeps its speed.")
            self._block.set(row, column, value)
        elif column != "strategies":
            self._block.write(row, {column: value})

    def move(self, numbers: Sequence[int], nodes: Sequence[int]) -> None:
        """Move agents on the ground, and note it."""
        for number, node in zip(numbers, nodes, strict=True):
            self.move_one(int(number), int(node))

    def move_one(self, number: int, node: int) -> tuple[str, int]:
        """Move an agent, and note it; returns its name, and the node it was on."""
        block, name = self._engine.block, self.names[number]
        row = block.row_of(name)
        before: int = block.node[row]
        block.move(row, node)
        return name, before

    def fly(self, row: int, node: int | None, position: tuple[float, ...]) -> None:
        """Move a flyer, and note it."""
        self._check_flies(row)
        self._block.fly(row, as_position(position), node)

    def turn(self, row: int, quat: tuple[float, ...]) -> None:
        """Turn a flyer in space, and note it."""
        w, x, y, z = as_numbers(quat, "quat", "(w, x, y, z)")
        self._check_flies(row)
        self._block.turn(row, (w, x, y, z))

    def mover(self, row: int) -> Mover:
        """Return a flyer that is about to move."""
        self._check_flies(row)
        return Mover(self._block.names[row], self._block.nearest(row))

    def _check_flies(self, row: int) -> None:
        if not self._block.kind[row]:
            raise BadType(f"Agent {self._block.names[row]!r} does not fly.")

    def progress(self, numbers: IntArray, columns: Mapping[str, np.ndarray[Any, Any]]) -> None:
        """Set how far along edges agents are."""
        zeros = np.zeros(len(numbers), np.int64)
        places = [columns.get(name, zeros) for name in ON_EDGES]
        for number, *where in zip(numbers.tolist(), *places, strict=True):
            self._block.write(self.row_of(number), {"progress": keyframes.progress_of(*where)})

    def attribute(self, numbers: Sequence[int], name: str, values: Sequence[Plain] | None) -> None:
        """Set an attribute of the caller's, or take it away."""
        for number, value in zip(numbers, [None] * len(numbers) if values is None else values, strict=True):
            agent = self._agent(self.row_of(number))
            known = getattr(type(agent), name, None)
            if name[0] == "_" or callable(known) or isinstance(known, property):
                raise BadValue(f"{shown(name)} is no attribute of agent {agent.name!r} that a program may set.")
            if values is None:
                agent.__dict__.pop(name, None)
            else:
                setattr(agent, name, deepcopy(value))

    def _agent(self, row: int) -> Any:
        return self._engine.agents[self._block.names[row]]

    def equip(self, row: int, name: str, sensor_id: str) -> None:
        """Let an agent carry a sensor, if it is here."""
        sensor = self._ctx.sensor.sensors.get(sensor_id)
        if sensor is None:
            self._ctx.logger.error(f"Sensor {shown(sensor_id)} is not here: it is left out of the replay.")
            return
        try:
            self._agent(row).register_sensor(name, sensor)
        except GammsError as error:
            self._ctx.logger.error(f"{reason(error)} The sensor is left out of the replay.")  # noqa: TRY400 - ILogger has none

    def unequip(self, row: int, name: str) -> None:
        """Let an agent carry a sensor no longer, if that did not go itself."""
        if name in self._agent(row).sensors:
            self._agent(row).deregister_sensor(name)

    # -- the journal ----------------------------------------------------------------------------------------------

    @contextmanager
    def unnoted(self) -> Iterator[None]:
        """Note nothing of what happens to agents: it follows from an event that is noted as it is."""
        block = self._block
        if block.journal.is_silent:
            yield
            return
        journal, block.journal = block.journal, MutedJournal(block.journal)
        try:
            yield
        finally:
            block.journal = journal

    def note(self, kind: int, data: Plain) -> None:
        """Note an event of the recording, with the numbers that agents have in the journal."""
        journal: Journal = self._block.journal
        if journal.is_silent:
            return

        def number_of(number: int) -> int:
            return journal.ids[self.row_of(number)]

        if kind == kinds.SENSED:
            data = sensed.renumbered(data, number_of)
        journal.append(kind, kinds.renumbered(kind, data, number_of))


# -- format version 2 -----------------------------------------------------------------------------------------------


class LegacyState(LiveState):
    """A context in which records of version 2 happen as in gamms 1.0.0, which wrote more than it accepted.

    They are what a program did: they are checked, and noted like it.
    """

    def __init__(self, ctx: HostContext) -> None:
        super().__init__(ctx)
        self.agents = _LegacyAgents(ctx)

    def change_component(self, kind: int, data: dict[str, Any]) -> None:
        """Do what an operation code of components says, unless 1.0.0 refused it after it had written it down."""
        self._ctx.record.components.apply(OpCodes(kind).name, data, lenient=True)


class _LegacyAgents(LiveAgents):
    def add(self, name: str, kwargs: dict[str, Any], state: dict[str, Any], strategy: str | None) -> None:  # noqa: ARG002
        """Create an agent, unless 1.0.0 made none of this."""
        is_refused = name in self._engine.agents or "start_node_id" not in kwargs
        if not is_refused and not (kwargs.get("type") == 1 and "speed" not in kwargs):
            self._engine.create_agent(name, **kwargs)

    def remove(self, name: str) -> None:
        """Delete an agent, if it is there."""
        if name in self._engine.agents:
            self._engine.delete_agent(name)

    def set(self, row: int, column: str, value: Plain) -> None:
        """Set an attribute of an agent."""
        setattr(self._agent(row), ATTRIBUTES[column], value)

    def fly(self, row: int, node: int | None, position: tuple[float, ...]) -> None:  # noqa: ARG002
        """Put a flyer somewhere; the graph says which node is below."""
        self._agent(row).position = position


# -- playing ------------------------------------------------------------------------------------------------------


_Ongoing = Callable[[], RecordingSession | None]


class Replayer:
    """Applies events to a context; its journal takes them where the context is being recorded.

    Args:
        ctx: the context.
        recording: gives the recording that is being written now, if any.
        is_version_2: whether the events are records of 1.0.0, which wrote more than it accepted.

    Attributes:
        state: what events are applied to.
        clock: the time stamp of what is being replayed.
        turn: how many turns have been replayed, with the one that is shown now.
    """

    def __init__(self, ctx: HostContext, recording: _Ongoing = lambda: None, *, is_version_2: bool = False) -> None:
        self._ctx, self._recording, self._is_version_2 = ctx, recording, is_version_2
        self.state = LegacyState(ctx) if is_version_2 else LiveState(ctx)
        self.clock = self.turn = 0

    def begin(self, reader: Reader) -> None:
        """Become what a recording of version 3 begins with.

        Raises:
            RecordingError: it is damaged, or does not fit the context.
        """
        self._declare(reader.header)
        begin = reader.keyframe(0)
        if begin is not None:
            self._begin(reader.header, begin[1])
        elif reader.turns or not reader.warning:  # else it was cut off behind its map
            raise RecordingError("This recording does not say how it begins.")

    def begin_with(self, header: dict[str, Any], snapshot: Keyframe) -> None:
        """Become what a snapshot says of a game whose recording has this header.

        Raises:
            RecordingError: it does not fit the context.
        """
        self._declare(header)
        self._begin(header, snapshot)

    def _declare(self, header: dict[str, Any]) -> None:
        maps.attach(self._ctx, header)
        self.show(header.get("visuals"), header.get("drawings", []))
        self.state.order_sides(_sides_in(header))

    def play(self, reader: Reader) -> Iterator[Record]:
        """Apply the turns of a recording from the present one on, and yield their records.

        Raises:
            RecordingError: it is damaged, or does not fit the context; what was whole has been applied.
        """
        while self.turn < reader.turns:
            yield from self.play_turn(reader)
            if self._ctx.is_terminated():
                return
        yield {"timestamp": max(0, reader.turns - 1) * TURN_NS, "opCode": kinds.TERMINATE}

    def play_turn(self, reader: Reader) -> Iterator[Record]:
        """Apply the next turn, and yield its records; where another turn is asked for meanwhile, that is the next."""
        self.turn += 1
        return self._turn(self.turn - 1, reader.log(self.turn - 1))

    def play_log(self, log: kinds.Log) -> None:
        """Apply the log of the next turn."""
        self.turn += 1
        for _ in self._turn(self.turn - 1, log):
            pass

    def play_until_sensed(self, log: kinds.Log, agent: str) -> Any:
        """Apply a turn as far as an agent senses, and return what was sensed then; None: it does not."""
        for code, data in events_of(log):
            if code != kinds.SENSED:
                self.apply(code, data)
                continue
            with refusing("What was sensed is damaged", with_type=True):
                if agent in map(self.state.agents.names.get, data["agents"].tolist()):
                    return data
        return None

    def _begin(self, header: dict[str, Any], snapshot: dict[str, Plain]) -> None:
        recording = self._recording()
        with refusing("This recording cannot begin here"):
            is_adopted = recording is not None and recording.adopt(header, snapshot)
            with self.state.agents.unnoted():
                self.state.restore(snapshot)
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
                mover = self.apply(kind, data)
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
            # NOTE: not by `records_of`, which takes half as long again (benchmarks: replay).
            data = {"agent_name": name, "node_id": before}
            yield {"timestamp": timestamp, "opCode": kinds.AGENT_PREV_NODE, "data": data}
            data = {"agent_name": name, "node_id": node}
            yield {"timestamp": timestamp, "opCode": kinds.AGENT_CURRENT_NODE, "data": data}

    def apply(self, kind: int, data: Plain) -> Mover | None:
        """Apply an event, and note it where the context is being recorded; one that is not known is only noted.

        Returns:
            Which flyer it has moved, and the node that was below it.

        Raises:
            RecordingError: it cannot happen here; the context is as it was.
        """
        known, agents, mover = EVENTS.get(kind), self.state.agents, None
        if known is None and self._is_version_2:
            raise RecordingError(f"Operation code {kind:#010x} is none of gamms 1.0.0.")
        notes_itself = (
            self._is_version_2 or kind in FORMS or kind in COMPONENTS or kind in (kinds.MOVES, kinds.SIMULATE)
        )
        try:
            if kind in FORMS:
                mover = agents.mover(agents.row_of(data[0]))
            elif kind == kinds.AERIAL_AGENT_POSITION and not self._is_version_2:
                mover = agents.mover(agents.row(data["agent_name"]))
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
            if kind == kinds.SIMULATE:  # of what the program does after each turn
                raise
            raise RecordingError(f"An event of kind {kind:#010x} cannot happen here: {reason(error)}") from error
        return mover

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
        if visuals is not None:
            with refusing("What this recording looks like is not right", with_type=True):
                self.state.show(visuals)
                for drawing in drawings:
                    self.state.draw(drawing)


def _sides_in(header: Mapping[str, Any]) -> tuple[str | None, ...]:
    """Return the sides that the header of a cut recording names; none for a recording that is whole."""
    sides = header.get("sides", ())
    if not isinstance(sides, list | tuple) or any(not isinstance(side, str | None) for side in sides):
        raise RecordingError(f"The sides in the header of this recording are not right: {shown(sides)}.")
    return tuple(sides)
