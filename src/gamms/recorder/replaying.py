"""Play a recording: apply what it says to a context, event by event, and yield it in the form of 1.0.0."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, nullcontext
from copy import deepcopy
from typing import Any

from gamms.errors import BadFile, BadValue, ContextTerminated, GammsError
from gamms.ir import events as kinds
from gamms.ir.events import NOBODY, Muted
from gamms.recorder import game_state, state
from gamms.recorder.checking import following_number
from gamms.recorder.errors import UNFIT, RecordingError
from gamms.recorder.formats.reader import Reader
from gamms.recorder.formats.tracks import FORMS
from gamms.recorder.maps import has_map, hash_in, is_map_of
from gamms.recorder.records import TURN_NS, Record, named, records_of, records_of_move, steps_of
from gamms.text import reason, shown
from gamms.typing.actions import as_position, as_quat, position_of
from gamms.typing.opcodes import OpCodes


class Player:
    """Applies events to a context, and copies them where the context is being recorded.

    Args:
        recorder: the context's own.
        is_version_2: whether the events are those of 1.0.0, which writes more than it accepts.
    """

    def __init__(self, recorder: Any, *, is_version_2: bool = False) -> None:
        self._recorder = recorder
        self._is_version_2 = is_version_2
        self._ctx = recorder.ctx
        self._numbers: dict[int, str] = {}
        self._next = 0
        self._shown: Any = {}  # artists of the recording
        self._pace = 0  # by how much the game counts on in a turn

    def play(self, reader: Reader) -> Iterator[Record]:
        """Everything in a recording of version 3, whose map is attached."""
        self.dress(reader.header.get("visuals"), reader.header.get("drawings", []))
        begin = reader.keyframe(0)
        if begin is not None and begin[0] == 0:
            self._begin(begin[1])
        elif reader.turns or not reader.warning:  # else it was cut off behind its map
            raise RecordingError("This recording does not say how it begins.")
        for turn in range(reader.turns):
            yield from self._turn(turn, reader.log(turn))
            if self._ctx.is_terminated():
                return
        yield {"timestamp": max(0, reader.turns - 1) * TURN_NS, "opCode": kinds.TERMINATE}

    def _begin(self, state: Any) -> None:
        """Let the context be as a recording begins."""
        try:
            self._silently(lambda: self._put(state))
        except ContextTerminated:
            raise
        except UNFIT as error:
            raise RecordingError(f"This recording cannot begin here: {reason(error)}") from error

    def play_until(self, log: kinds.Log, kind: int, names: dict[int, str], following: int) -> Any:
        """Play a turn as far as an event of some kind, and give the data of it; None if there is none.

        Args:
            log: of the turn.
            kind: of the event.
            names: number of an agent -> its name; who comes is added.
            following: the number that the next new agent gets.
        """
        self._numbers, self._next = names, following
        agents = self._ctx.agent
        for number, step in steps_of(log):
            if number is not None:
                agents.block.move(agents.block.row_of(names[number]), step)
            elif step[0] == kind:
                return step[1]
            elif step[0] in FORMS:
                self._fly(step[0], step[1])
            else:
                self.happen(*step)
        return None

    def _turn(self, turn: int, log: kinds.Log) -> Iterator[Record]:
        timestamp, is_over = turn * TURN_NS, True
        agents, recorder = self._ctx.agent, self._recorder
        for number, step in steps_of(log):
            if self._ctx.is_terminated():
                return
            recorder.clock = timestamp
            if number is None:
                if step[0] == kinds.UNFINISHED:
                    is_over = False
                    continue
                if step[0] in FORMS:
                    kind, data = self._fly(step[0], step[1])
                else:
                    kind, data = step
                    self.happen(kind, data)
                yield from records_of(kind, data, timestamp, self._before(kind, data))
                continue
            is_copying = recorder.is_copying
            try:
                name = self._numbers[number]
                row = agents.block.row_of(name)
            except KeyError as error:
                raise RecordingError(f"Turn {turn} moves agent number {number}: {reason(error)}") from error
            block = agents.block
            before = block.node[row]
            if is_copying:
                journal, block.journal = block.journal, NOBODY
                block.move(row, step)
                block.journal = journal
                recorder.copy(number, step)
            else:
                block.move(row, step)  # unchecked: the node was there when the agent went there
            yield from records_of_move(name, before, step, timestamp)
        if is_over and not self._ctx.is_terminated():
            self.happen(kinds.SIMULATE, {})
            yield from records_of(kinds.SIMULATE, {}, timestamp)

    def _fly(self, kind: int, data: Any) -> tuple[int, Any]:
        """Let a flyer go somewhere, or turn, and be copied; gives the same event by name."""
        number, *parts = data
        agents, is_copying = self._ctx.agent, self._recorder.is_copying
        block = agents.block
        try:
            name = self._numbers[number]
            row = block.row_of(name)
            position_of(block, row)  # or it does not fly
            if kind == kinds.AERIAL_AGENT_FLIGHT:
                position = as_position(parts[1:])
                (self._muted if is_copying else _now)(lambda: block.fly(row, position))
            else:
                as_quat(parts)  # to be checked, for it does not come to the last bit
                (self._muted if is_copying else _now)(lambda: block.turn(row, tuple(parts)))
        except (GammsError, KeyError) as error:
            raise RecordingError(f"An event of kind {kind:#010x} cannot happen here: {reason(error)}") from error
        if is_copying:
            self._recorder.copy((kind, data))
        return named((kind, data), name)

    def _before(self, kind: int, data: Any) -> int | None:
        """Above which node a flyer was that has just moved."""
        if kind != kinds.AERIAL_AGENT_POSITION:
            return None
        node: int = self._ctx.agent.agents[data["agent_name"]].prev_node_id
        return node

    def happen(self, kind: int, data: Any) -> None:
        """Let an event other than a move happen; one that is not known does nothing.

        Raises:
            RecordingError: it cannot happen here; the context is as it was.
        """
        if kind == kinds.SIMULATE:
            self._ctx.game.turn += self._pace
            self._ctx.visual.simulate()  # which ends the turn of a recording that is being written, too
            return
        apply = _EVENTS.get(kind)
        is_exact = kind in _EXACT and not self._is_version_2
        if apply is not None:
            try:
                with self._trusting():
                    (self._muted if is_exact else self._silently)(lambda: apply(self, data))
            except ContextTerminated:
                raise
            except UNFIT as error:
                raise RecordingError(f"An event of kind {kind:#010x} cannot happen here: {reason(error)}") from error
        elif kind in COMPONENTS:
            self._recorder.components.apply(COMPONENTS[kind], data, lenient=self._is_version_2)
            return  # the components have reported it
        elif self._is_version_2:
            raise RecordingError(f"Operation code {kind:#010x} is none of gamms 1.0.0.")
        if self._recorder.is_copying or is_exact or apply is None:
            self._recorder.copy((kind, data))

    # -- what events do -----------------------------------------------------------------------------------------

    def _put(self, data: Any) -> None:
        with self._trusting():
            self._muted(lambda: state.put(self._ctx, data))
        numbers = data["numbers"].tolist()
        self._numbers = dict(zip(numbers, data["names"], strict=True))
        self._next = following_number(numbers, data["next"])
        self._pace = int(data.get("pace", 0))
        if self._recorder.is_copying:
            self._recorder.renumber(data["names"], numbers, self._next)
        else:
            self._recorder.tell_anew()

    def _create(self, data: Any) -> None:
        if self._is_version_2 and self._was_refused(data["name"], data["kwargs"]):
            return
        if self._is_version_2:
            self._ctx.agent.create_agent(data["name"], **data["kwargs"])
        else:
            self._muted(lambda: self._create_exactly(data))
            noted = {key: value for key, value in data.items() if key != "strategy"}
            self._ctx.agent.block.journal.note(kinds.AGENT_CREATE, noted)
        self._numbers[self._next] = data["name"]
        self._next += 1
        self._recorder.renumber([data["name"]], [self._next - 1], self._next)

    def _create_exactly(self, data: Any) -> None:
        """Where it was, perhaps on a node that the map has no longer; and to the last bit."""
        given = data.get("state", {}).items()
        places = {name: tuple(map(float, value)) for name, value in given if name in _PLACES}
        for name, numbers in places.items():
            if len(numbers) != _PLACES[name]:
                raise BadValue(f"{shown(name)} has {_PLACES[name]} numbers, and not {shown(numbers)}.")
        agent = self._ctx.agent.create_agent(data["name"], **self._with_known_sensors(data["kwargs"]))
        self._ctx.agent.block.write(self._ctx.agent.block.row_of(agent.name), places)

    def _with_known_sensors(self, given: dict[str, Any]) -> dict[str, Any]:
        """The keywords of an agent without sensors that are not here."""
        sensors, known = given.get("sensors") or (), self._ctx.sensor.sensors
        if all(sensor_id in known for sensor_id in (sensors.values() if isinstance(sensors, dict) else sensors)):
            return given
        self._ctx.logger.error("Sensors that are not here are left out of the replay.")
        if isinstance(sensors, dict):
            return given | {"sensors": {name: one for name, one in sensors.items() if one in known}}
        return given | {"sensors": [one for one in sensors if one in known]}

    def _was_refused(self, name: Any, given: Any) -> bool:
        """Whether 1.0.0 made no agent of this after it had written it down."""
        flies = given.get("type") == 1
        return name in self._ctx.agent.agents or "start_node_id" not in given or (flies and "speed" not in given)

    def _delete(self, data: Any) -> None:
        if not self._is_version_2:
            self._ctx.agent.get_agent(data["name"])
        elif data["name"] not in self._ctx.agent.agents:  # 1.0.0 wrote it down all the same
            return
        self._ctx.agent.delete_agent(data["name"])

    def _register(self, data: Any) -> None:
        agent = self._ctx.agent.get_agent(data["agent_name"])
        sensor = self._ctx.sensor.sensors.get(data["sensor_id"])
        if sensor is None:
            self._ctx.logger.error(f"Sensor {shown(data['sensor_id'])} is not here: it is left out of the replay.")
            return
        try:
            agent.register_sensor(data["name"], sensor)
        except GammsError as error:
            self._ctx.logger.error(f"{reason(error)} The sensor is left out of the replay.")  # noqa: TRY400 - ILogger has none

    def _deregister(self, data: Any) -> None:
        self._ctx.agent.get_agent(data["agent_name"]).deregister_sensor(data["name"])

    def _above(self, data: Any) -> None:
        for name, node, previous in zip(data["names"], data["node"].tolist(), data["previous"].tolist(), strict=True):
            block = self._ctx.agent.block
            block.write(block.row_of(self._ctx.agent.get_agent(name).name), {"node": node, "previous": previous})

    def _world(self, data: Any) -> None:
        self._ctx.graph.storage.unpack(data["world"])

    def _visuals(self, data: Any) -> None:
        artists = getattr(self._ctx.visual, "artists", None)  # an engine of the caller's may have none
        if artists is not None:
            self._shown = artists.add_specs(data, self._shown)

    def _draw(self, data: Any) -> None:
        artists = getattr(self._ctx.visual, "artists", None)
        if artists is not None:
            artists.add_drawing(data)

    def dress(self, visuals: Any, drawings: Any = ()) -> None:
        """Let it look as a recording says; None: as it does.

        Raises:
            RecordingError: nobody recorded this.
        """
        if visuals is None:
            return
        try:
            self._visuals(visuals)
            for drawing in drawings:
                self._draw(drawing)
        except UNFIT as error:
            raise RecordingError(
                f"What this recording looks like is not right ({type(error).__name__}: {reason(error)})."
            ) from error

    def _scores(self, data: Any) -> None:
        self._ctx.game.scores.clear()
        self._ctx.game.scores.update(data["scores"])

    def _data(self, data: Any) -> None:
        game_state.apply(self._ctx.game.data, data)

    def _progress(self, data: Any) -> None:
        block = self._ctx.agent.block
        for i, number in enumerate(data["numbers"].tolist()):
            block.write(block.row_of(self._numbers[number]), {"progress": state.progress_from(data, i)})

    def _count(self, data: Any) -> None:
        self._pace = int(data["pace"])
        self._ctx.game.turn = int(data["turn"]) - self._pace  # until the turn is over
        self._ctx.game.state.began |= data.get("starts", {})

    def _remember(self, data: Any) -> None:
        game_state.remember(self._ctx, data)

    def _facts(self, data: Any) -> None:
        game = self._ctx.game
        known = {name: fact for name, fact in game.facts.items() if name not in data["removed"]}
        game_state.publish_only(self._ctx, known | deepcopy(data["set"]))

    def _chance(self, data: Any) -> None:
        game_state.put_chance(self._ctx, data["chance"])

    def _equip(self, data: Any) -> None:
        state.make_sensors(self._ctx, data)

    def _event(self, data: Any) -> None:
        self._ctx.game.events.append(game_state.as_event(deepcopy(data)))

    def _over(self, data: Any) -> None:
        game_state.put_over(self._ctx, data or None)

    # -- around them --------------------------------------------------------------------------------------------

    def attach(self, header: dict[str, Any]) -> None:
        """Take the map of the recording where there is none yet; else it must be the same.

        Raises:
            RecordingError: it is another, or there is none and the recording holds none, either.
        """
        name = hash_in(header)
        if not has_map(header):
            if not is_map_of(self._ctx.graph.storage.pack_savable()[0], header):
                raise RecordingError(
                    "This recording does not hold its map, and the graph of this context is another. Load the map with "
                    f"the SHA-256 {name} first: ctx.graph.load('map.gamms')."
                )
            return
        if next(iter(self._ctx.graph.graph.get_nodes()), None) is None:
            try:
                self._ctx.graph.storage.unpack(header["world"])
            except BadFile as error:
                raise RecordingError(f"The map of this recording is damaged: {reason(error)}") from error
        elif not is_map_of(self._ctx.graph.storage.pack_savable()[0], header):
            raise RecordingError(
                "The graph or the obstacles of this context are not those of the recording. Replay it into a context "
                "without a graph: the recording brings its own."
            )

    def _trusting(self) -> AbstractContextManager[None]:
        """Let agents be on nodes that are not there: a map that changes in a turn stands before all its moves."""
        if self._is_version_2:
            return nullcontext()
        trusting: AbstractContextManager[None] = self._ctx.agent.block.trusting()
        return trusting

    def _silently(self, happen: Callable[[], None]) -> None:
        """Let something happen without a note in the journal where the event itself is copied from the recording."""
        if self._recorder.is_copying:
            self._muted(happen)
        else:
            happen()

    def _muted(self, happen: Callable[[], None]) -> None:
        columns = self._ctx.agent.block
        journal = columns.journal
        columns.journal = Muted(journal)
        try:
            happen()
        finally:
            columns.journal = journal


def _now(happen: Callable[[], None]) -> None:
    happen()


COMPONENTS = {code.value: code.name for code in OpCodes if code.name.startswith("COMPONENT")}
_EXACT = (  # copied as they are: of length 1, but not to the last bit; or what the context would work out otherwise
    kinds.AGENT_ORIENTATION,
    kinds.AERIAL_AGENT_QUATERNION,
    kinds.FLYERS_ABOVE,
)
_PLACES = {"heading": 2, "position": 3, "previous_position": 3, "quat": 4}  # how many numbers each has


def _set(attribute: str, key: str, column: str | None = None) -> Callable[[Player, Any], None]:
    """Set an attribute; a column is given where setting it again would not come to the last bit."""

    def happen(player: Player, data: Any) -> None:
        agent = player._ctx.agent.get_agent(data["agent_name"])
        setattr(agent, attribute, data[key])
        if column is not None and data[key] is not None and not player._is_version_2:
            block = player._ctx.agent.block
            block.write(block.row_of(agent.name), {column: tuple(map(float, data[key]))})

    return happen


_EVENTS: dict[int, Callable[[Player, Any], None]] = {
    kinds.SNAPSHOT: Player._put,
    kinds.AGENT_CREATE: Player._create,
    kinds.AGENT_DELETE: Player._delete,
    kinds.AGENT_CURRENT_NODE: _set("current_node_id", "node_id"),
    kinds.AGENT_PREV_NODE: _set("prev_node_id", "node_id"),
    kinds.AGENT_SENSOR_REGISTER: Player._register,
    kinds.AGENT_SENSOR_DEREGISTER: Player._deregister,
    kinds.AGENT_ORIENTATION: _set("orientation", "orientation", "heading"),
    kinds.AERIAL_AGENT_POSITION: _set("position", "position"),
    kinds.AERIAL_AGENT_QUATERNION: _set("quat", "quat", "quat"),
    kinds.AGENT_TEAM: _set("team", "team"),
    kinds.AGENT_ALIVE: _set("alive", "alive"),
    kinds.AGENT_SPEED: _set("speed", "speed"),
    kinds.AGENT_PROGRESS: Player._progress,
    kinds.FLYERS_ABOVE: Player._above,
    kinds.WORLD: Player._world,
    kinds.VISUALS: Player._visuals,
    kinds.VISUAL_COMMANDS: Player._draw,
    kinds.GAME_SCORES: Player._scores,
    kinds.GAME_DATA: Player._data,
    kinds.GAME_EVENT: Player._event,
    kinds.GAME_OVER: Player._over,
    kinds.GAME_TURN: Player._count,
    kinds.GAME_MEMORY: Player._remember,
    kinds.GAME_FACTS: Player._facts,
    kinds.GAME_CHANCE: Player._chance,
    kinds.SENSORS: Player._equip,
}
