"""From a keyframe to the turns after it: what each event does to a state, on plain columns."""

from collections.abc import Callable
from copy import deepcopy
from typing import Any

import numpy as np

from gamms.errors import GammsError
from gamms.ir import journal
from gamms.recorder.state import State, opened

_LISTS = ("names", "teams", "speed", "sensors", "attributes", "strategies")
_ARRAYS = {
    "numbers": (np.int64, ()),
    "kind": (np.int64, ()),
    "node": (np.int64, ()),
    "previous": (np.int64, ()),
    "heading": (np.float64, (2,)),
    "position": (np.float64, (3,)),
    "previous_position": (np.float64, (3,)),
    "quat": (np.float64, (4,)),
    "alive": (np.int64, ()),
    "carry": (np.float64, ()),
}


def begin() -> State:
    """A state with nobody in it."""
    arrays = {name: np.zeros((0, *shape), dtype) for name, (dtype, shape) in _ARRAYS.items()}
    return {**{name: [] for name in _LISTS}, **arrays, "scores": [], "data": {}, "over": None}


class Fold:
    """A state that events are applied to.

    Attributes:
        state: as `recorder.state.captured` gives it.
        world: the bytes of graph and obstacles, where an event has changed them; else None.
    """

    def __init__(self, state: State) -> None:
        self.state = deepcopy(opened(state))
        self.world: bytes | None = None
        self._row_of = {number: row for row, number in enumerate(self.state["numbers"].tolist())}
        self._next = max(self._row_of, default=-1) + 1

    def apply(self, log: journal.Log) -> None:
        """Let the log of one turn happen."""
        node, previous, row_of = self.state["node"], self.state["previous"], self._row_of
        entries = iter(log)
        for entry in entries:
            if type(entry) is tuple:
                self._happen(*entry)
                node, previous = self.state["node"], self.state["previous"]
            else:
                row = row_of[entry]
                previous[row] = node[row]
                node[row] = next(entries)

    def _happen(self, kind: int, data: Any) -> None:
        happen = _EVENTS.get(kind)
        if happen is not None:  # what is not known does nothing
            happen(self, data)

    def row(self, name: str) -> int:
        """The row of an agent by its name."""
        return self.state["names"].index(name)  # type: ignore[no-any-return] # a list of texts

    def enter(self, data: Any) -> None:
        """An agent was created."""
        given = data["kwargs"]
        flies = given.get("type") in (1, "AERIAL") or given.get("agent_type") in (1, "AERIAL")
        node = int(given["start_node_id"])
        values: dict[str, Any] = {
            "names": data["name"],
            "teams": given.get("team"),
            "speed": given.get("speed"),
            "sensors": _sensors_of(given.get("sensors") or {}),
            "attributes": {},
            "strategies": data.get("strategy"),
            "numbers": self._next,
            "kind": int(flies),
            "node": node,
            "previous": node,
            "alive": 1,
            **data.get("state", {}),
        }
        for name in _LISTS:
            self.state[name].append(values[name])
        for name, (dtype, shape) in _ARRAYS.items():
            value = np.full((1, *shape), values.get(name, np.nan if shape else 0), dtype)
            self.state[name] = np.concatenate([self.state[name], value])
        self._row_of[self._next] = len(self.state["names"]) - 1
        self._next += 1

    def leave(self, data: Any) -> None:
        """An agent was deleted."""
        row = self.row(data["name"])
        for name in _LISTS:
            del self.state[name][row]
        for name in _ARRAYS:
            self.state[name] = np.delete(self.state[name], row, axis=0)
        self._row_of = {number: row for row, number in enumerate(self.state["numbers"].tolist())}

    def replace(self, data: Any) -> None:
        """A snapshot was written."""
        following = self._next
        self.__init__(data)  # type: ignore[misc] # it begins anew
        self._next = max(self._next, following)


def _sensors_of(given: Any) -> dict[str, str]:
    return dict(given) if isinstance(given, dict) else {name: name for name in given}


def _set(column: str, key: str, convert: Callable[[Any], Any] = lambda value: value) -> Callable[[Fold, Any], None]:
    def happen(fold: Fold, data: Any) -> None:
        fold.state[column][fold.row(data["agent_name"])] = convert(data[key])

    return happen


def _fly(fold: Fold, data: Any) -> None:
    row = fold.row(data["agent_name"])
    fold.state["previous_position"][row] = fold.state["position"][row]
    fold.state["position"][row] = data["position"]
    fold.state["previous"][row] = fold.state["node"][row]
    if "node" in data:
        fold.state["node"][row] = data["node"]


def _register(fold: Fold, data: Any) -> None:
    fold.state["sensors"][fold.row(data["agent_name"])][data["name"]] = data["sensor_id"]


def _deregister(fold: Fold, data: Any) -> None:
    fold.state["sensors"][fold.row(data["agent_name"])].pop(data["name"], None)


def _change_data(fold: Fold, data: Any) -> None:
    fold.state["data"].update(deepcopy(data["set"]))
    for key in data["removed"]:
        fold.state["data"].pop(key, None)


def _change_world(fold: Fold, data: Any) -> None:
    fold.world = data["world"]


_EVENTS: dict[int, Callable[[Fold, Any], None]] = {
    journal.SNAPSHOT: Fold.replace,
    journal.AGENT_CREATE: Fold.enter,
    journal.AGENT_DELETE: Fold.leave,
    journal.AGENT_CURRENT_NODE: _set("node", "node_id"),
    journal.AGENT_PREV_NODE: _set("previous", "node_id"),
    journal.AGENT_SENSOR_REGISTER: _register,
    journal.AGENT_SENSOR_DEREGISTER: _deregister,
    journal.AGENT_ORIENTATION: _set("heading", "orientation", lambda pair: (np.nan,) * 2 if pair is None else pair),
    journal.AERIAL_AGENT_POSITION: _fly,
    journal.AERIAL_AGENT_QUATERNION: _set("quat", "quat"),
    journal.AGENT_TEAM: _set("teams", "team"),
    journal.AGENT_ALIVE: _set("alive", "alive", int),
    journal.AGENT_SPEED: _set("speed", "speed"),
    journal.AGENT_STRATEGY: _set("strategies", "strategy"),
    journal.WORLD: _change_world,
    journal.GAME_SCORES: lambda fold, data: fold.state.__setitem__("scores", data["scores"]),
    journal.GAME_DATA: _change_data,
    journal.GAME_OVER: lambda fold, data: fold.state.__setitem__("over", data),
}


class Damaged(GammsError, ValueError):
    """An event does not fit the state it happens to."""
