"""The state of a recording at a turn, as columns, without a context."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from gamms.ir import events as kinds
from gamms.ir.event_targets import AgentsState, State
from gamms.ir.events import EVENTS, LOGGED, Log, list_events
from gamms.ir.game_state import GameState
from gamms.ir.graph import IntArray
from gamms.ir.schema import ON_EDGES, RECORDED_NUMBERS, SETTABLE, VECTORS
from gamms.plain import Plain
from gamms.recorder import keyframes
from gamms.recorder.errors import DAMAGES, Damaged, report_damage
from gamms.recorder.formats.reader import Reader
from gamms.recorder.keyframes import ARRAYS, LISTS, Keyframe, check_name
from gamms.text import shown

# Kinds whose data this state does not store; they are not decoded.
_NOT_HELD = {
    kinds.UNFINISHED,
    kinds.WORLD,
    kinds.VISUALS,
    kinds.VISUAL_COMMANDS,
    *LOGGED,
    kinds.GAME_FACTS,
    kinds.USER_EVENT,
    kinds.SENSED,
}
_GONE: Any = object()  # marks a deleted attribute
# Keywords of a creation that do not become attributes of the agent.
_NO_ATTRIBUTES = {"start_node_id", "sensors", "strategy", "type", "position", "quat", *SETTABLE}


class DetachedState(State):
    """An independent state to which events are applied.

    Every method raises Damaged (ValueError) if an event does not fit the state.

    Args:
        keyframe: initial state, checked because files are not trusted; taken over by this object.
        at: number of turns before the state.

    Attributes:
        agents: columns of the agents.
        game: state of the game, without emitted events and published facts.
        sensors: id -> sensor, with its `type` and `keywords`.
        rng_state: state of the context's own random stream; None: unknown.
        beside_agents: columns of teams and of the game in the keyframe.
        component_classes: (module, name) of each class -> its fields.
        components: name -> its values by field.
    """

    agents: "DetachedAgents"

    def __init__(self, keyframe: Keyframe, at: int = 0) -> None:
        self._log = at  # index of the present log
        self.component_classes: dict[tuple[str, str], list[str]] = {}
        self.components: dict[Any, dict[str, Any]] = {}
        with _report_damage():
            if (recorded := keyframe.get("components")) is not None:
                self.component_classes = {(module, name): list(each) for module, name, each in recorded["classes"]}
                self.components = {name: dict(fields) for name, fields in recorded["values"].items()}
        self.restore(keyframe)

    # -- events ---------------------------------------------------------------------------------------------------

    def apply(self, log: Log) -> None:
        """Apply the log of a turn."""
        for kind, data in list_events(log):
            self.apply_event(kind, data)
        self._log += 1
        self.agents.settle()

    def apply_event(self, kind: int, data: Plain) -> None:
        """Apply an event; unknown kinds are ignored."""
        if kind in EVENTS:
            try:  # NOTE: not `report_damage`, which would take a quarter of the time of a seek
                EVENTS[kind].apply(self, data)
            except DAMAGES:
                with report_damage(f"an event of kind {kind:#010x} does not fit", DAMAGES, Damaged, with_type=True):
                    raise

    def advance(self, reader: Reader, start: int, stop: int) -> None:
        """Apply the turns `start` to `stop - 1` of a recording."""
        for begin, end in reader.pieces(start, stop):
            if reader.has_events(begin, end):
                for turn in range(begin, end):
                    self._log = turn
                    self.apply(reader.log(turn, _NOT_HELD))
            else:  # NOTE: most turns; a tenth of the time of single turns (benchmarks: recordings)
                _, numbers, nodes = reader.moves(begin, end)
                self.agents.move(numbers, nodes)
        self.agents.settle()

    # -- effects of events
    # ----------------------------------------------------------------------------------------

    def restore(self, snapshot: Keyframe) -> None:
        """Replace the state by a keyframe or a snapshot; components stay, because snapshots do not contain them."""
        with _report_damage():
            columns = keyframes.check_columns(keyframes.unpack_keyframe(snapshot))
            following = keyframes.check_following(columns["numbers"].tolist(), snapshot["next"])
            self.agents = DetachedAgents(columns, following)
            self.sensors = _index_by_id(snapshot.get("sensor_kinds", ()))
            self.beside_agents = keyframes.get_columns_beside_agents(snapshot)
            self.rng_state = snapshot.get("chance")
            self.game = GameState()
            keyframes.restore_game(self.game, snapshot)
            self._clock = int(snapshot.get("turn", 0)), self._log, int(snapshot.get("pace", 0))

    def count(self, turn: int, pace: int, starts: dict[str, Any]) -> None:  # noqa: ARG002 - named as in `State`
        """Set the number of this turn, and the increment for the following turns."""
        self._clock = turn, self._log + 1, pace

    def set_rng(self, rng_state: Mapping[str, Plain] | None) -> None:
        """Set the state of the context's own random stream."""
        self.rng_state = rng_state

    def change_sensors(self, groups: list[dict[str, Any]], removed: Sequence[str]) -> None:
        """Remove sensors, then add or update others."""
        for sensor_id in removed:
            self.sensors.pop(sensor_id, None)
        self.sensors |= _index_by_id(groups)

    def change_component(self, kind: int, data: dict[str, Any]) -> None:
        """Change names, fields and values of components, without classes that could run code."""
        if kind == kinds.COMPONENT_REGISTER:
            module, name = data["key"]
            self.component_classes[module, name] = list(data["struct"])
        elif kind == kinds.COMPONENT_CREATE:
            module, name = data["type"]
            self.components[data["name"]] = dict.fromkeys(self.component_classes[module, name])
        elif kind == kinds.COMPONENT_UPDATE:
            self.components[data["name"]][data["key"]] = data["value"]
        elif kind == kinds.COMPONENT_DELETE:
            del self.components[data["name"]]

    def number_turn(self, turns: int) -> int:
        """Return how the game numbers the turn after a number of recorded turns."""
        counted, at, pace = self._clock
        return counted + pace * (turns - at)

    def make_keyframe(self, turns: int) -> Keyframe:
        """Return the keyframe after a number of turns, equal to that of a live context."""
        agents = self.agents
        agents.settle()
        self.game.turn = self.number_turn(turns)
        classes = [[*key, fields] for key, fields in self.component_classes.items()]
        columns = {**agents.columns, **self.beside_agents}
        sensors = [*self.sensors.values()]
        return {
            **keyframes.pack_keyframe(columns, agents.following, sensors, self.game, self.rng_state),
            "pace": self._clock[2],
            "components": {"classes": classes, "values": {name: dict(one) for name, one in self.components.items()}},
        }


class DetachedAgents(AgentsState):
    """The columns of agents; the cost of adding and removing agents does not depend on their number.

    Rows of removed agents stay until `settle`.

    Args:
        columns: see `keyframes.unpack_keyframe`; only this object adds or removes rows.
        following: number of the next new agent.

    Attributes:
        columns: `LISTS` and `ARRAYS` of `keyframes`, one row per agent.
        following: number of the next new agent.
        version: changes whenever agents are added or removed, or a list changes.
        departed: removed agent -> its team and its last node.
    """

    def __init__(self, columns: dict[str, Any], following: int) -> None:
        self.departed: dict[str, tuple[Any, int]] = {}
        self.columns = columns
        self.following = following
        self.version = 0
        self._build_index()

    def __len__(self) -> int:
        return len(self._row_of)

    def _build_index(self) -> None:
        """Build the index of agents by row."""
        numbers = self.columns["numbers"].tolist()
        names = self.columns["names"]
        self._row_of: dict[int, int] = dict(zip(numbers, range(len(numbers)), strict=True))
        self._row_of_name: dict[str, int] = dict(zip(names, range(len(names)), strict=True))
        if not len(self._row_of) == len(self._row_of_name) == len(names):
            raise Damaged("two agents have the same name or number")
        # with spare room after the last row
        self._whole: dict[str, np.ndarray[Any, Any]] = {name: self.columns[name] for name in ARRAYS}
        self._gone: list[int] = []
        self._is_counted = numbers == list(range(len(numbers)))  # whether the numbers of agents are their rows

    # -- adding and removing
    # --------------------------------------------------------------------------------------

    def add(self, name: str, kwargs: dict[str, Any], state: dict[str, Any], strategy: str | None) -> None:
        """Add an agent.

        Raises:
            Damaged: the name is taken.
        """
        number = self.following
        row = len(self.columns["names"])
        values = _make_row(check_name(name), number, kwargs, state, strategy)
        if name in self._row_of_name or number in self._row_of:
            raise Damaged("two agents have the same name or number")
        for column in ARRAYS:
            with report_damage(f"a new agent has an invalid {shown(column)}", DAMAGES, Damaged):
                self._make_room(column, row)[row] = values[column]
            self.columns[column] = self._whole[column][: row + 1]
        for column in LISTS:
            self.columns[column].append(values[column])
        self._row_of[number] = row
        self._row_of_name[name] = row
        self._is_counted = self._is_counted and number == row
        self.following += 1
        self.version += 1

    def remove(self, name: str) -> None:
        """Remove an agent (KeyError)."""
        row = self.find_row(name)
        self.departed[name] = self.columns["teams"][row], int(self.columns["node"][row])
        del self._row_of_name[name], self._row_of[int(self.columns["numbers"][row])]
        self._gone.append(row)
        self.version += 1
        if len(self._gone) > len(self):  # so that the cost per removal is constant
            self.settle()

    def find_row(self, name: str) -> int:
        """Return the row of an agent by name (KeyError)."""
        return self._row_of_name[name]

    def find_numbered_row(self, number: int) -> int:
        """Return the row of an agent by number.

        Raises:
            Damaged: the agent does not exist.
        """
        row = self._row_of.get(number)
        if row is None:
            raise _make_unknown_error(number)
        return row

    def get_names_by_number(self) -> dict[int, str]:
        """Return the names of the agents by their numbers."""
        return dict(zip(self.columns["numbers"].tolist(), self.columns["names"], strict=True))

    def find_rows(self, numbers: IntArray) -> IntArray:
        """Return the rows of agents by number.

        Raises:
            Damaged: an agent does not exist.
        """
        are_rows = self._is_counted and not self._gone and len(numbers) > 0
        if are_rows and int(numbers.min()) >= 0 and int(numbers.max()) < len(self.columns["names"]):
            return numbers
        return np.array([self.find_numbered_row(number) for number in numbers.tolist()], np.int64)

    def settle(self) -> None:
        """Drop the rows of removed agents."""
        if not self._gone:
            return
        stays = np.ones(len(self.columns["names"]), np.bool_)
        stays[self._gone] = False
        rows = np.flatnonzero(stays).tolist()
        for name in LISTS:
            column = self.columns[name]
            self.columns[name] = [column[row] for row in rows]
        for name in ARRAYS:
            self.columns[name] = self.columns[name][stays]
        self._build_index()

    def _make_room(self, name: str, rows: int) -> "np.ndarray[Any, Any]":
        """Return a column with room for one more row than `rows`."""
        column = self._whole[name]
        if len(column) == rows:
            dtype, shape = ARRAYS[name]
            spare: np.ndarray[Any, Any] = np.empty((rows + 1, *shape), dtype)
            column = np.concatenate((column, spare))
            self._whole[name] = column
        return column

    # -- values
    # ---------------------------------------------------------------------------------------------------

    def set(self, row: int, column: str, value: Plain) -> None:
        """Set one column of an agent."""
        if value is None and column in VECTORS:
            value = np.nan
        self.columns[column][row] = value
        self.version += column in LISTS
        stays = self.columns["edge_motion"][row] and self.columns["edge_source"][row] == self.columns["node"][row]
        if column == "node" or (column == "alive" and not value and not stays):  # the agent is no longer on an edge
            for name in ON_EDGES:
                self.columns[name][row] = 0

    def move(self, numbers: Sequence[int] | IntArray, nodes: Sequence[int] | IntArray) -> None:
        """Move agents, given by numbers and nodes, (moves,) each, in order.

        The node of each agent becomes its last node, and its previous node the one before.
        """
        nodes = np.asarray(nodes, np.int64)
        rows = self.find_rows(np.asarray(numbers, np.int64))
        node = self.columns["node"]
        order = rows.argsort(kind="stable")
        ordered = rows[order]
        last = np.flatnonzero(np.append(ordered[1:] != ordered[:-1], [True] * min(len(rows), 1)))  # of each agent
        moved = ordered[last]
        has_come = (last > 0) & (ordered[last - 1] == moved)
        self.columns["previous"][moved] = np.where(has_come, nodes[order[last - 1]], node[moved])
        node[moved] = nodes[order[last]]

    def fly(self, row: int, node: int | None, position: tuple[float, ...]) -> None:
        """Move a flying agent."""
        columns = self.columns
        if not columns["kind"][row]:
            raise _make_ground_error(columns["names"][row])
        columns["previous_position"][row] = columns["position"][row]
        columns["position"][row] = position
        columns["previous"][row] = columns["node"][row]
        if node is not None:
            columns["node"][row] = node

    def set_rotation(self, row: int, quat: tuple[float, ...]) -> None:
        """Set the rotation of a flying agent."""
        self.columns["quat"][row] = quat

    def set_progress(self, numbers: IntArray, columns: Mapping[str, np.ndarray[Any, Any]]) -> None:
        """Set the progress of agents along edges."""
        rows = self.find_rows(np.asarray(numbers, np.int64))
        keyframes.check_shares(columns["edge_share"])
        keyframes.check_motions(columns.get("edge_motion", 0))
        for name in ON_EDGES:
            self.columns[name][rows] = columns.get(name, 0)

    def set_attribute(self, numbers: Sequence[int], name: str, values: Sequence[Plain] | None) -> None:
        """Set or delete a custom attribute."""
        attributes = self.columns["attributes"]
        for number, value in zip(numbers, [_GONE] * len(numbers) if values is None else values, strict=True):
            row = self.find_numbered_row(number)
            own = {key: one for key, one in attributes[row].items() if key != name}
            attributes[row] = own if value is _GONE else {**own, name: value}
        self.version += 1

    def equip(self, row: int, name: str, sensor_id: str) -> None:
        """Add a sensor to an agent."""
        self.columns["sensors"][row][name] = sensor_id

    def unequip(self, row: int, name: str) -> None:
        """Remove a sensor from an agent."""
        self.columns["sensors"][row].pop(name, None)


def _make_row(
    name: str, number: int, given: dict[str, Any], state: dict[str, Any], strategy: str | None
) -> dict[str, Any]:
    """Return the row of a new agent."""
    node = int(given["start_node_id"])
    sensors = given.get("sensors") or {}
    places = {key: (np.nan,) * width for key, width in VECTORS.items()}
    places |= {key: value for key, value in state.items() if key in places}
    return {
        "names": name,
        "teams": given.get("team"),
        "speed": given.get("speed"),
        "sensors": dict(sensors) if isinstance(sensors, dict) else {one: one for one in sensors},
        "attributes": {key: value for key, value in given.items() if key not in _NO_ATTRIBUTES},
        "strategies": strategy,
        "numbers": number,
        "kind": int(given.get("type") == 1 or not np.isnan(places["position"][0])),
        "node": int(state.get("node", node)),
        "previous": node,
        "alive": 1,
        **{one.name: given.get(one.name, one.initial) for one in RECORDED_NUMBERS},
        **dict.fromkeys(ON_EDGES, 0),
        **places,
    }


def _index_by_id(groups: Iterable[Mapping[str, Plain]]) -> dict[str, dict[str, Any]]:
    return {sensor["id"]: sensor for sensor in keyframes.list_sensors(groups)}


def _make_unknown_error(number: int) -> Damaged:
    return Damaged(f"agent number {number} moves, but does not exist")


def _make_ground_error(name: str) -> Damaged:
    return Damaged(f"agent {shown(name)} flies, but is on the ground")


def _report_damage() -> report_damage:
    return report_damage("the whole state is invalid", DAMAGES, Damaged, with_type=True)
