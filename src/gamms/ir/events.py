"""What can happen in a game: the table of event kinds.

Each kind says which of its fields name agents and nodes, who may know of it, what it does to a state, and which records
of format version 2 stand for it. A live context and the columns of a recording are both such a state, so that playing
again and working out the state at a turn are the same act. Adding a kind is a code and an entry of `EVENTS`.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from copy import deepcopy
from enum import Enum
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

from gamms.arguments import as_bool, as_int, as_key, as_name, as_numbers, as_range
from gamms.errors import BadType, BadValue
from gamms.ir.event_state import State
from gamms.plain import Plain
from gamms.text import shown

if TYPE_CHECKING:
    from gamms.ir.game_state import GameState

Log = list[Any]  # (id, node id) of each move of an agent on the ground as two ints; else (kind, data) as a tuple
Record = tuple[int, dict[str, Any]]  # an operation code of format version 2, and its data

TERMINATE = 0x00000000
SIMULATE = 0x00000001
SNAPSHOT = 0x00000010
UNFINISHED = 0x00000011
REPLAYED = -1  # never written: a record of version 2 that is replayed, and what was noted when it happened
AGENT_CREATE = 0x01000000
AGENT_DELETE = 0x01000001
AGENT_CURRENT_NODE = 0x01100000
AGENT_PREV_NODE = 0x01100001
AGENT_SENSOR_REGISTER = 0x01100002
AGENT_SENSOR_DEREGISTER = 0x01100003
AGENT_ORIENTATION = 0x01100004
AERIAL_AGENT_POSITION = 0x01100005
AERIAL_AGENT_QUATERNION = 0x01100006
AGENT_TEAM = 0x01100010
AGENT_ALIVE = 0x01100011
AGENT_SPEED = 0x01100012
AGENT_STRATEGY = 0x01100013
AGENT_PROGRESS = 0x01100014
AERIAL_AGENT_FLIGHT = 0x01100020
AERIAL_AGENT_TURN = 0x01100021
FLYERS_ABOVE = 0x01100030
MOVES = 0x01100040  # never written as an event: the ints of a log, and a column of their own in a file
COMPONENT_REGISTER = 0x02000000
COMPONENT_CREATE = 0x02000001
COMPONENT_UPDATE = 0x02000002
COMPONENT_DELETE = 0x02000003
COMPONENT_UNREGISTER = 0x02000004
WORLD = 0x03000000
VISUALS = 0x03000010
VISUAL_COMMANDS = 0x03000011
GAME_SCORES = 0x04000000
GAME_DATA = 0x04000001
GAME_EVENT = 0x04000002
GAME_OVER = 0x04000003
GAME_TURN = 0x04000004
GAME_MEMORY = 0x04000005
GAME_FACTS = 0x04000006
GAME_CHANCE = 0x04000007
USER_EVENT = 0x05000000
SENSORS = 0x06000000
SENSED = 0x06000001


# -- kinds ------------------------------------------------------------------------------------------------------


class Audience(Enum):
    """Who may know of an event while the game goes on."""

    ALL = "all"
    TEAM = "the team of the agent"
    SENSED = "the team of the agent, and who senses it"
    HOST = "only whoever runs the game"


class Role(Enum):
    """What the value of a field means to the outside."""

    AGENT = "the name of an agent"
    NUMBER = "the number of an agent, or an array of them"
    NODE = "a node id, or an array of them"
    PLAIN = "nothing"


class Field(NamedTuple):
    """A field of an event.

    Attributes:
        role: whether it names an agent or a node.
        check: takes a value and what to call it in an error; gives the value that is meant; None takes any plain value.
        is_optional: whether it may be missing.
    """

    role: Role = Role.PLAIN
    check: Callable[[Any, str], Any] | None = None
    is_optional: bool = False

    def value_of(self, data: Mapping[str, Any], key: str) -> Any:
        """Return the checked value of the field `key`.

        Raises:
            KeyError, BadType, BadValue: there is none, or an impossible one.
        """
        value = data[key]
        return value if self.check is None else self.check(value, key)


class EventKind(NamedTuple):
    """A kind of event.

    Attributes:
        code: the number that stands for it in recordings.
        name: what tables and streams call it.
        fields: of the dict that is its data; of a tuple the names of its items, in their order.
        audience: who may know of it.
        apply: does to a state what has happened.
        records: gives what stands for it in format version 2, by its data and who moved; None: nothing does.
        is_tuple: whether its data are a tuple.
    """

    code: int
    name: str
    fields: Mapping[str, Field]
    audience: Audience
    apply: Callable[[State, Any], None]
    records: "Callable[[Any, Mover | None], Iterator[Record]] | None" = None
    is_tuple: bool = False


class Mover(NamedTuple):
    """The agent that an event moves: its name, and the node it was on, or above, before."""

    name: str
    before: int


def _heading(value: object, name: str) -> tuple[float, ...] | None:
    return None if value is None else tuple(as_numbers(value, name, "(cos, sin)"))


def _position(value: object, name: str) -> tuple[float, ...]:
    return tuple(as_numbers(value, name, "(x, y, z)"))


def _quat(value: object, name: str) -> tuple[float, ...]:
    return tuple(as_numbers(value, name, "(w, x, y, z)"))


def _speed(value: object, name: str) -> Any:
    if value is not None:
        as_range(value, name)
    return value


_NODE, _NODES, _NUMBER = Field(Role.NODE, as_int), Field(Role.NODE), Field(Role.NUMBER)
_FIELDS = {  # fields of these names; all others hold any plain value
    "agent_name": Field(Role.AGENT, as_name),
    "names": Field(Role.AGENT),
    "number": _NUMBER,
    "numbers": _NUMBER,
    "node_id": _NODE,
    "node": _NODES,
    "previous": _NODES,
    "edge_source": _NODES,
    "edge_target": _NODES,
    **dict.fromkeys(("name", "sensor_id", "kind"), Field(check=as_name)),
    "orientation": Field(check=_heading),
    "position": Field(check=_position),
    "quat": Field(check=_quat),
    "team": Field(check=as_key),
    "alive": Field(check=as_bool),
    "speed": Field(check=_speed),
}
EVENTS: dict[int, EventKind] = {}
"""All kinds, by their codes."""

_Apply = Callable[[State, Any], None]
_Records = Callable[[Any, Mover | None], Iterator[Record]]


def _fields_of(spec: str) -> dict[str, Field]:
    """Return fields by their names, such as "name:AGENT ?state": a role of its own, and one that may be missing."""
    fields = {}
    for part in spec.split():
        key, _, role = part.removeprefix("?").partition(":")
        field = _FIELDS.get(key, Field())
        fields[key] = Field(Role[role] if role else field.role, field.check, part.startswith("?"))
    return fields


def _event(
    name: str, audience: Audience, fields: str = "", records: _Records | None = None, *, is_tuple: bool = False
) -> Callable[[_Apply], _Apply]:
    """Add a kind, whose code is the constant of that name, by what it does to a state."""
    code = int(globals()[name])

    def add(apply: _Apply) -> _Apply:
        EVENTS[code] = EventKind(code, name, _fields_of(fields), audience, apply, records, is_tuple)
        return apply

    return add


def _record(name: str, audience: Audience, fields: str = "") -> Callable[[_Apply], _Apply]:
    """Add a kind which is a record of format version 2 itself."""
    code = int(globals()[name])

    def records(data: dict[str, Plain], _: Mover | None) -> Iterator[Record]:
        yield code, data

    return _event(name, audience, fields, records)


def _nothing(_state: State, _data: Plain) -> None:
    """Leave the state as it is."""


def _sets(column: str, key: str) -> _Apply:
    """Return what sets one column of one agent to a field."""
    field = _FIELDS.get(key, Field())

    def apply(state: State, data: Mapping[str, Plain]) -> None:
        value = field.value_of(data, key)
        state.agents.set(state.agents.row(data["agent_name"]), column, value)

    return apply


# -- agents -----------------------------------------------------------------------------------------------------


_NODE_KEYWORDS = {"prev_node_id": AGENT_PREV_NODE, "current_node_id": AGENT_CURRENT_NODE}


def _creation_records(data: Mapping[str, Plain], _: Mover | None) -> Iterator[Record]:
    """Yield the creation and what 1.0.0 records beside it, or has to be given because it knows other keywords."""
    yield AGENT_CREATE, {"name": data["name"], "kwargs": data["kwargs"]}
    name, given, made = {"agent_name": data["name"]}, data["kwargs"], data.get("state", {})
    for key in given:
        if key in _NODE_KEYWORDS:
            yield _NODE_KEYWORDS[key], {**name, "node_id": given[key]}
        elif key == "orientation" and "heading" in made:
            yield AGENT_ORIENTATION, {**name, "orientation": list(made["heading"])}
        elif key == "position" and "position" in made:
            yield AERIAL_AGENT_POSITION, {**name, "position": list(made["position"])}
            yield AGENT_PREV_NODE, {**name, "node_id": given["start_node_id"]}
        elif key in ("quat", "orientation") and "quat" in made:
            yield AERIAL_AGENT_QUATERNION, {**name, "quat": list(made["quat"])}
    sensors = given.get("sensors", ())
    for key, sensor_id in sensors.items() if isinstance(sensors, dict) else zip(sensors, sensors, strict=True):
        yield AGENT_SENSOR_REGISTER, {**name, "name": key, "sensor_id": sensor_id}


@_event("AGENT_CREATE", Audience.ALL, "name:AGENT kwargs ?state ?strategy", _creation_records)
def _create(state: State, data: Mapping[str, Plain]) -> None:
    state.agents.add(data["name"], data["kwargs"], data.get("state", {}), data.get("strategy"))


def _move_records(data: Sequence[int], mover: Mover | None) -> Iterator[Record]:
    assert mover is not None  # noqa: S101 - every move has an agent
    yield AGENT_PREV_NODE, {"agent_name": mover.name, "node_id": mover.before}
    yield AGENT_CURRENT_NODE, {"agent_name": mover.name, "node_id": data[1]}


@_event("MOVES", Audience.SENSED, "number node", _move_records, is_tuple=True)
def _move(state: State, data: Sequence[int]) -> None:
    state.agents.move(data[::2], data[1::2])


def _flight_records(data: tuple[int, int, float, float, float], mover: Mover | None) -> Iterator[Record]:
    assert mover is not None  # noqa: S101 - as above
    yield AERIAL_AGENT_POSITION, {"agent_name": mover.name, "position": list(data[2:])}
    yield AGENT_PREV_NODE, {"agent_name": mover.name, "node_id": mover.before}


@_event("AERIAL_AGENT_FLIGHT", Audience.SENSED, "number node x y z", _flight_records, is_tuple=True)
def _flight(state: State, data: tuple[int, int, float, float, float]) -> None:
    number, node, *position = data
    state.agents.fly(state.agents.row_of(number), node, tuple(position))


def _turn_records(data: tuple[int, float, float, float, float], mover: Mover | None) -> Iterator[Record]:
    assert mover is not None  # noqa: S101 - as above
    yield AERIAL_AGENT_QUATERNION, {"agent_name": mover.name, "quat": list(data[1:])}


@_event("AERIAL_AGENT_TURN", Audience.SENSED, "number w x y z", _turn_records, is_tuple=True)
def _turn(state: State, data: tuple[int, float, float, float, float]) -> None:
    number, *quat = data
    state.agents.turn(state.agents.row_of(number), tuple(quat))


def _position_records(data: Mapping[str, Plain], mover: Mover | None) -> Iterator[Record]:
    yield AERIAL_AGENT_POSITION, {"agent_name": data["agent_name"], "position": data["position"]}
    if mover is not None:
        yield AGENT_PREV_NODE, {"agent_name": data["agent_name"], "node_id": mover.before}


@_event("AERIAL_AGENT_POSITION", Audience.SENSED, "agent_name position ?node", _position_records)
def _fly_by_name(state: State, data: Mapping[str, Plain]) -> None:
    node = as_int(data["node"], "node") if "node" in data else None
    state.agents.fly(state.agents.row(data["agent_name"]), node, _position(data["position"], "position"))


@_record("AGENT_SENSOR_REGISTER", Audience.TEAM, "agent_name name sensor_id")
def _register(state: State, data: Mapping[str, Plain]) -> None:
    state.agents.equip(state.agents.row(data["agent_name"]), data["name"], data["sensor_id"])


@_record("AGENT_SENSOR_DEREGISTER", Audience.TEAM, "agent_name name sensor_id")
def _deregister(state: State, data: Mapping[str, Plain]) -> None:
    state.agents.unequip(state.agents.row(data["agent_name"]), data["name"])


@_event("AGENT_PROGRESS", Audience.SENSED, "numbers edge_source edge_target edge_share")
def _progress(state: State, data: Mapping[str, Plain]) -> None:
    state.agents.progress(data["numbers"], data["edge_source"], data["edge_target"], data["edge_share"])


@_event("FLYERS_ABOVE", Audience.SENSED, "names node previous")
def _above(state: State, data: Mapping[str, Plain]) -> None:
    for name, node, previous in zip(data["names"], data["node"].tolist(), data["previous"].tolist(), strict=True):
        row = state.agents.row(name)
        state.agents.set(row, "node", node)
        state.agents.set(row, "previous", previous)


# -- the game ---------------------------------------------------------------------------------------------------


def _change_component(code: int, state: State, data: dict[str, Plain]) -> None:
    state.change_component(code, data)


_OVER = {"reason", "winner", "truncated"}


def change(values: dict[Any, Any], changes: Mapping[str, Any]) -> None:
    """Change a dict: what is `set`, what is `removed`, and what lists and sets have `more`."""
    values.update(deepcopy(changes.get("set", {})))
    for key, more in changes.get("more", {}).items():
        known = values[key]  # in place, or lists that grow in every turn would be copied in every turn
        if isinstance(known, set):
            known.update(more)
        else:
            known.extend(deepcopy(more))
    for key in changes.get("removed", ()):
        values.pop(key, None)


def as_over(value: object) -> dict[str, Any] | None:
    """Return why a game is over; None: it goes on.

    Raises:
        BadValue: a game is not over like this.
    """
    if value is not None and (not isinstance(value, Mapping) or set(value) != _OVER):
        raise BadValue(f"A game is over with {sorted(_OVER)}, not with {shown(value)}.")
    return None if value is None else dict(value)


def as_event(data: Mapping[str, Plain]) -> dict[str, Any]:
    """Return what a rule emitted, as it is in `ctx.game.events`.

    Raises:
        BadType: it has no kind.
    """
    found = dict(data)
    if not isinstance(found.get("kind"), str):
        raise BadType(f"{shown(found)} is no event: it has no kind.")
    return deepcopy(found)


def set_scores(game: "GameState", scores: Plain) -> None:
    """Replace the scores of a game.

    Raises:
        BadValue: these are none.
    """
    try:
        found = dict(scores)
    except (TypeError, ValueError) as error:
        raise BadValue(f"its scores are none ({error})") from error
    game.scores.clear()
    game.scores.update(found)


@_event("GAME_SCORES", Audience.ALL, "scores")
def _scores(state: State, data: Mapping[str, Plain]) -> None:
    set_scores(state.game, data["scores"])


@_event("GAME_OVER", Audience.ALL, "?reason ?winner ?truncated")
def _over(state: State, data: Mapping[str, Plain]) -> None:
    state.game.over = as_over(data or None)


@_event("GAME_TURN", Audience.ALL, "turn pace ?starts")
def _count(state: State, data: Mapping[str, Plain]) -> None:
    state.count(int(data["turn"]), int(data["pace"]), data.get("starts", {}))


@_event("GAME_MEMORY", Audience.TEAM, "agents teams")
def _remember(state: State, data: Mapping[str, Plain]) -> None:
    for name, changes in data["agents"].items():
        change(state.game.memory_of(name), changes)
    for team, changes in data["teams"]:
        change(state.game.team_memories.setdefault(team, {}), changes)


_record("AGENT_DELETE", Audience.ALL, "name:AGENT")(lambda state, data: state.agents.remove(data["name"]))
_record("AERIAL_AGENT_QUATERNION", Audience.SENSED, "agent_name quat")(_sets("quat", "quat"))
_event("AGENT_STRATEGY", Audience.HOST, "agent_name strategy")(_sets("strategies", "strategy"))

COLUMN_EVENTS: dict[str, tuple[int, str]] = {}
"""Column of an `AgentBlock` -> the kind of event that notes a change of it, and the key of the value."""

for _name, _column, _key, _audience, _add in (
    ("AGENT_CURRENT_NODE", "node", "node_id", Audience.SENSED, _record),
    ("AGENT_PREV_NODE", "previous", "node_id", Audience.SENSED, _record),
    ("AGENT_ORIENTATION", "heading", "orientation", Audience.SENSED, _record),
    ("AGENT_TEAM", "teams", "team", Audience.ALL, _event),
    ("AGENT_ALIVE", "alive", "alive", Audience.ALL, _event),
    ("AGENT_SPEED", "speed", "speed", Audience.TEAM, _event),
):
    _add(_name, _audience, f"agent_name {_key}")(_sets(_column, _key))
    COLUMN_EVENTS[_column] = int(globals()[_name]), _key

_event("GAME_DATA", Audience.HOST, "?set ?more ?removed")(lambda state, data: change(state.game.data, data))
_event("GAME_EVENT", Audience.ALL, "kind")(lambda state, data: state.emit(as_event(data)))
_event("GAME_FACTS", Audience.ALL, "set removed")(lambda state, data: state.publish(data["set"], data["removed"]))
_event("GAME_CHANCE", Audience.HOST, "chance")(lambda state, data: state.set_rng(data["chance"]))
_event("USER_EVENT", Audience.ALL, "kind")(_nothing)

_record("TERMINATE", Audience.ALL)(_nothing)
_record("SIMULATE", Audience.ALL)(lambda state, _: state.end_turn())
_event("SNAPSHOT", Audience.HOST, "names numbers node")(lambda state, data: state.restore(data))
_event("UNFINISHED", Audience.HOST)(_nothing)
_event("WORLD", Audience.ALL, "world")(lambda state, data: state.replace_world(data["world"]))
_event("VISUALS", Audience.ALL, "artists")(lambda state, data: state.show(data))
_event("VISUAL_COMMANDS", Audience.ALL, "artist layer visible")(lambda state, data: state.draw(data))
_event("SENSORS", Audience.HOST, "sensor_kinds")(lambda state, data: state.add_sensors(data["sensor_kinds"]))
_event("SENSED", Audience.TEAM, "agents:NUMBER ids")(_nothing)

for _name, _spec in {
    "COMPONENT_REGISTER": "key struct",
    "COMPONENT_CREATE": "name type",
    "COMPONENT_UPDATE": "name key value",
    "COMPONENT_DELETE": "name",
    "COMPONENT_UNREGISTER": "key",
}.items():
    _record(_name, Audience.ALL, _spec)(partial(_change_component, globals()[_name]))

COMPONENTS = frozenset(code for code in EVENTS if code >> 24 == COMPONENT_REGISTER >> 24)
"""The kinds that change components."""


def events_of(log: Log) -> Iterator[tuple[int, Any]]:
    """Yield the events of a log: moves that follow each other as one, `(MOVES, [number, node, number, node, …])`."""
    types, begin = list(map(type, log)), 0
    for _ in range(types.count(tuple)):
        end = types.index(tuple, begin)
        if end > begin:
            yield MOVES, log[begin:end]
        yield log[end]
        begin = end + 1
    if begin < len(log):
        yield MOVES, log[begin:]


def steps_of(log: Log) -> Iterator[tuple[int, Any]]:
    """Yield the same with each move by itself."""
    for kind, data in events_of(log):
        if kind == MOVES:
            for step in zip(data[::2], data[1::2], strict=True):
                yield MOVES, step
        else:
            yield kind, data


def records_of(kind: int, data: Plain, mover: Mover | None = None) -> Iterator[Record]:
    """Yield the records of format version 2 that stand for an event; else the event itself."""
    known = EVENTS.get(kind)
    if known is None or known.records is None:
        yield kind, data
    else:
        yield from known.records(data, mover)


def renumbered(kind: int, data: Plain, number_of: Callable[[int], int]) -> Any:
    """Return the data of an event with other numbers of agents.

    Args:
        kind: of the event.
        data: of the event; not changed.
        number_of: number -> the other number of the same agent.
    """
    fields = EVENTS[kind].fields if kind in EVENTS else {}
    if isinstance(data, tuple):
        return (number_of(data[0]), *data[1:])
    found = dict(data)
    for key in (key for key, field in fields.items() if field.role is Role.NUMBER):
        found[key] = data[key].copy()
        found[key][:] = [number_of(number) for number in data[key].tolist()]
    return found
