"""From a keyframe to the turns after it: what each event does to a state, on plain columns."""

from collections.abc import Callable
from typing import Any

import numpy as np

from gamms.ir import events as kinds
from gamms.ir.graph import IntArray
from gamms.recorder import component_fold, game_state
from gamms.recorder.checking import ARRAYS, LISTS, checked, text
from gamms.recorder.errors import DAMAGES, Damaged
from gamms.recorder.formats.reader import Reader
from gamms.recorder.formats.tracks import FORMS, Tracks
from gamms.recorder.roster import Roster
from gamms.recorder.state import State, opened, shares
from gamms.recorder.waiting import Batch, Waiting, follow
from gamms.text import reason, shown


class Fold:
    """A state that events are applied to.

    Every call raises Damaged (ValueError) where an event does not fit the state.

    Args:
        state: a keyframe, which is not to be used afterwards; checked, for a stranger may have written it.
        at: how many turns it knows.

    Attributes:
        state: as `recorder.state.opened` gives it.
        following: the number that the next new agent gets.
        changes: a number that changes whenever agents come or go, or any of the lists does.
    """

    def __init__(self, state: State, at: int = 0) -> None:
        self.changes = 0
        self._log = at  # the one whose events happen
        self._begin(state)

    def _begin(self, state: State) -> None:
        try:
            self.state, self.following = checked(opened(state)), int(state["next"])
            told = state.get("components")
            self.state |= component_fold.nothing() if told is None else component_fold.opened(told)
            self._clock = int(state.get("turn", 0)), self._log, int(state.get("pace", 0))
        except DAMAGES as error:
            raise Damaged(f"the whole state is not right ({type(error).__name__}: {reason(error)})") from error
        self._roster = Roster(self.state)
        self.changes += 1

    def game_turn(self, turns: int) -> int:
        """How the game counted the last of so many turns."""
        counted, at, pace = self._clock
        return counted + pace * (turns - at)

    def apply(self, log: kinds.Log) -> None:
        """Let the log of one turn happen, entry by entry: what `advance` does at once."""
        entries = iter(log)
        for entry in entries:
            if type(entry) is tuple:
                self.happen(*entry)
            else:
                self._move_one(entry, next(entries))
        self._roster.settle()

    def advance(self, reader: Reader, start: int, stop: int) -> None:
        """Let the turns `start` to `stop - 1` of a recording happen; of these, a few at a time are in memory."""
        for begin, end in reader.pieces(start, stop):
            self._advance(reader, begin, end)
        self._roster.settle()

    def _advance(self, reader: Reader, start: int, stop: int) -> None:
        waiting = Waiting(reader, start, stop, _OTHERS)
        in_order = not self._roster.are_walkers(waiting.numbers)
        apart = _APART - _OF_FLYERS if waiting.has_flyers else _APART
        for event, (turn, place, kind, data) in enumerate(reader.events(start, stop, _OTHERS)):
            if (in_order or kind not in apart) and (batch := waiting.before(event, turn, place)):
                self._go(batch, in_order=in_order)
            self._log = turn
            self.happen(kind, data)
            in_order = in_order or kind == kinds.SNAPSHOT
        self._go(waiting.rest(), in_order=in_order)

    def _go(self, batch: Batch, *, in_order: bool) -> None:
        """Let moves, flights and turns happen, in their order if moves may be those of flyers."""
        done, flights = 0, batch.flights
        if in_order and not self._roster.are_walkers(batch.numbers):
            for i, after in enumerate(batch.after.tolist()):
                self.move(batch.numbers[done:after], batch.nodes[done:after])
                self.fly(flights.at(slice(i, i + 1)))
                done = after
            flights = flights.at(slice(0, 0))
        self.move(batch.numbers[done:], batch.nodes[done:])
        self.fly(flights)
        self.turn(batch.turns)

    def move(self, numbers: IntArray, nodes: IntArray) -> None:
        """Let moves happen: numbers of agents and nodes, (moves,) each, in their order."""
        if self._roster.are_few(numbers):
            for number, end in zip(numbers.tolist(), nodes.tolist(), strict=True):
                self._move_one(number, end)
            return
        rows = self._roster.rows(numbers)
        follow(self.state, rows, {"node": ("previous", nodes)})

    def fly(self, flights: Tracks) -> None:
        """Let flights happen, in their order."""
        if self._roster.are_few(flights.numbers):
            for data in flights.data():
                self.happen(kinds.AERIAL_AGENT_FLIGHT, data)
            return
        rows = self._roster.rows(flights.numbers)
        if not self.state["kind"][rows].all():
            row = rows[self.state["kind"][rows] == 0][0]
            raise _grounded(self.state["names"][row])
        nodes, positions = flights.nodes[:, 0], flights.floats
        follow(self.state, rows, {"node": ("previous", nodes), "position": ("previous_position", positions)})

    def turn(self, turns: Tracks) -> None:
        """Let flyers turn in space, in their order."""
        if len(turns.numbers):
            rows = self._roster.rows(turns.numbers)
            self.state["quat"][rows] = turns.floats  # of several at one row, the last one stays

    def _move_one(self, number: int, end: int) -> None:
        row = self.row_of(number)
        node = self.state["node"]
        self.state["previous"][row] = node[row]
        node[row] = end

    def happen(self, kind: int, data: Any) -> None:
        """Let an event other than a move happen; one that is not known does nothing."""
        happen = _EVENTS.get(kind)
        if happen is None:
            return
        try:
            happen(self, data)
        except Damaged:
            raise
        except DAMAGES as error:
            raise _misfit(kind, error) from error

    def row(self, name: str) -> int:
        """The row of an agent by its name."""
        return self._roster.row(name)

    def row_of(self, number: int) -> int:
        """The row of an agent by its number."""
        return self._roster.row_of(number)

    def enter(self, data: Any) -> None:
        """An agent was created."""
        self._roster.enter(self._values_of(data, self.following))
        self.following += 1
        self.changes += 1

    def _values_of(self, data: Any, number: int) -> dict[str, Any]:
        """The row of a new agent."""
        given = data["kwargs"]
        node, more = int(given["start_node_id"]), data.get("state", {})
        places = {name: (np.nan,) * shape[0] for name, (_, shape) in ARRAYS.items() if shape}
        places |= {name: value for name, value in more.items() if name in places}
        return {
            "names": text(data["name"]),
            "teams": given.get("team"),
            "speed": given.get("speed"),
            "sensors": _sensors_of(given.get("sensors") or {}),
            "attributes": {},
            "strategies": data.get("strategy"),
            "numbers": number,
            "kind": int(given.get("type") == 1 or not np.isnan(places["position"][0])),
            "node": int(more.get("node", node)),
            "previous": node,
            "alive": 1,
            "edge_source": 0,
            "edge_target": 0,
            "edge_share": 0.0,
            **places,
        }

    def leave(self, data: Any) -> None:
        """An agent was deleted."""
        self._roster.leave(data["name"])
        self.changes += 1

    def progress(self, data: Any) -> None:
        """Agents are so far along edges."""
        rows = self._roster.rows(np.asarray(data["numbers"], np.int64))
        self.state["edge_source"][rows], self.state["edge_target"][rows] = data["edge_source"], data["edge_target"]
        self.state["edge_share"][rows] = shares(data["edge_share"])

    def count(self, data: Any) -> None:
        """The game counted a turn otherwise than the ones before."""
        self._clock = int(data["turn"]), self._log + 1, int(data["pace"])

    def remember(self, data: Any) -> None:
        """Agents or teams remember something else."""
        for name, changes in data["agents"].items():
            game_state.apply(self.state["memories"].setdefault(name, {}), changes)
        for team, changes in data["teams"]:
            game_state.apply(self.state["team_memories"].setdefault(team, {}), changes)

    def equip(self, data: Any) -> None:
        """Sensors came."""
        self.state["sensor_kinds"].extend(data["sensor_kinds"])

    def replace(self, data: Any) -> None:
        """A snapshot was written, which says nothing of components."""
        kept = {name: self.state[name] for name in component_fold.nothing()}
        self._begin(data)
        self.state |= kept


def _grounded(name: str) -> Damaged:
    return Damaged(f"agent {shown(name)} flies and is on the ground")


def _misfit(kind: int, error: Exception) -> Damaged:
    return Damaged(f"an event of kind {kind:#010x} does not fit ({type(error).__name__}: {reason(error)})")


def _sensors_of(given: Any) -> dict[str, str]:
    return dict(given) if isinstance(given, dict) else {name: name for name in given}


def _set(column: str, key: str, convert: Callable[[Any], Any] = lambda value: value) -> Callable[[Fold, Any], None]:
    def happen(fold: Fold, data: Any) -> None:
        row = fold.row(data["agent_name"])  # which may make the columns longer
        fold.state[column][row] = convert(data[key])
        fold.changes += column in LISTS

    return happen


def _fly(fold: Fold, row: int, position: Any) -> None:
    state = fold.state
    if not state["kind"][row]:
        raise _grounded(state["names"][row])
    state["previous_position"][row] = state["position"][row]
    state["position"][row] = position
    state["previous"][row] = state["node"][row]


def _fly_by_name(fold: Fold, data: Any) -> None:
    row = fold.row(data["agent_name"])
    _fly(fold, row, data["position"])
    if "node" in data:
        fold.state["node"][row] = data["node"]


def _hover(fold: Fold, data: Any) -> None:
    for name, node, previous in zip(data["names"], data["node"], data["previous"], strict=True):
        row = fold.row(name)
        fold.state["node"][row], fold.state["previous"][row] = node, previous


def _fly_by_number(fold: Fold, data: Any) -> None:
    number, node, *position = data
    row = fold.row_of(number)
    _fly(fold, row, position)
    fold.state["node"][row] = node


def _turn(fold: Fold, data: Any) -> None:
    number, *quat = data
    row = fold.row_of(number)
    fold.state["quat"][row] = quat


def _register(fold: Fold, data: Any) -> None:
    row = fold.row(data["agent_name"])
    fold.state["sensors"][row][data["name"]] = data["sensor_id"]


def _deregister(fold: Fold, data: Any) -> None:
    row = fold.row(data["agent_name"])
    fold.state["sensors"][row].pop(data["name"], None)


def _component(happen: Callable[[State, Any], None]) -> Callable[[Fold, Any], None]:
    return lambda fold, data: happen(fold.state, data)


_EVENTS: dict[int, Callable[[Fold, Any], None]] = {
    kinds.SNAPSHOT: Fold.replace,
    kinds.AGENT_CREATE: Fold.enter,
    kinds.AGENT_DELETE: Fold.leave,
    kinds.AGENT_CURRENT_NODE: _set("node", "node_id"),
    kinds.AGENT_PREV_NODE: _set("previous", "node_id"),
    kinds.AGENT_SENSOR_REGISTER: _register,
    kinds.AGENT_SENSOR_DEREGISTER: _deregister,
    kinds.AGENT_ORIENTATION: _set("heading", "orientation", lambda pair: (np.nan,) * 2 if pair is None else pair),
    kinds.AERIAL_AGENT_FLIGHT: _fly_by_number,
    kinds.AERIAL_AGENT_TURN: _turn,
    kinds.AERIAL_AGENT_POSITION: _fly_by_name,
    kinds.AERIAL_AGENT_QUATERNION: _set("quat", "quat"),
    kinds.AGENT_TEAM: _set("teams", "team"),
    kinds.AGENT_ALIVE: _set("alive", "alive", int),
    kinds.AGENT_SPEED: _set("speed", "speed"),
    kinds.AGENT_PROGRESS: Fold.progress,
    kinds.AGENT_STRATEGY: _set("strategies", "strategy"),
    kinds.FLYERS_ABOVE: _hover,
    **{kind: _component(happen) for kind, happen in component_fold.EVENTS.items()},
    kinds.GAME_SCORES: lambda fold, data: fold.state.__setitem__("scores", data["scores"]),
    kinds.GAME_DATA: lambda fold, data: game_state.apply(fold.state["data"], data),
    kinds.GAME_OVER: lambda fold, data: fold.state.__setitem__("over", data or None),
    kinds.GAME_TURN: Fold.count,
    kinds.GAME_MEMORY: Fold.remember,
    kinds.GAME_CHANCE: lambda fold, data: fold.state.__setitem__("chance", data["chance"]),
    kinds.SENSORS: Fold.equip,
}
_OTHERS = frozenset(_EVENTS.keys() - FORMS)  # than those that happen many at once
_OF_FLYERS = {kinds.AERIAL_AGENT_POSITION, kinds.AERIAL_AGENT_QUATERNION}  # flights, turns of who wrote by name
_APART = _EVENTS.keys() - {  # events that change nothing that moves of others look at or change
    kinds.SNAPSHOT,
    kinds.AGENT_CREATE,
    kinds.AGENT_DELETE,
    kinds.AGENT_CURRENT_NODE,
    kinds.AGENT_PREV_NODE,
    kinds.FLYERS_ABOVE,
}
