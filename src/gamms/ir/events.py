"""The table of event kinds.

Each kind defines which fields name agents and nodes, which audience may see it, how it changes a state, and which
records of format version 2 correspond to it. A live context and the columns of a recording implement the same state
interface, so that replay and the reconstruction of a turn use the same code. To add a kind, add a code and an entry of
`EVENTS`.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from copy import deepcopy
from enum import Enum
from typing import Any, NamedTuple

import numpy as np

from gamms.arguments import as_bool, as_int, as_key, as_name, as_numbers, as_range
from gamms.errors import BadType
from gamms.ir.event_targets import State
from gamms.ir.game_state import FIELD_EVENTS, FIELDS, as_looks, as_over, as_turn
from gamms.ir.messages import as_message
from gamms.ir.schema import CHANGE_EVENTS, NUMBERS, ON_EDGES, Audience
from gamms.plain import Plain
from gamms.readonly import make_shareable
from gamms.text import shown

# A move on the ground is two ints: the number of the agent and a node id. Moves of many agents are (MOVES, an array
# of shape (agents, 2)). All other events are tuples (kind, data).
Log = list[Any]
Record = tuple[int, dict[str, Any]]  # operation code of format version 2, data


REPLAYED = -1  # never written: a replayed record of version 2, with the events recorded when it happened


# -- kinds ------------------------------------------------------------------------------------------------------


class Role(Enum):
    """The meaning of the value of a field."""

    AGENT = "the name of an agent, or a list of names"
    NUMBER = "the number of an agent, or a list or an array of numbers"
    EACH = "one value for each agent that the event names or numbers"
    BY_AGENT = "values by the names of agents"
    BY_TEAM = "pairs of a team and a value"
    NODE = "a node id"
    PLAIN = "a value for all who know of the event"


class Field(NamedTuple):
    """A field of an event.

    Attributes:
        role: meaning of its value.
        check: function of the value and its name in an error message that returns the checked value; None: any plain
            value.
        is_optional: whether it may be missing.
    """

    role: Role = Role.PLAIN
    check: Callable[[Any, str], Any] | None = None
    is_optional: bool = False

    def read_value(self, data: Mapping[str, Any], key: str) -> Any:
        """Return the checked value of the field `key`.

        Raises:
            KeyError, BadType, BadValue: the value is missing or invalid.
        """
        value = data[key]
        return value if self.check is None else self.check(value, key)


class EventKind(NamedTuple):
    """A kind of event.

    Attributes:
        code: its number in recordings.
        name: its name in tables and streams.
        fields: fields of its dict; if its data are a tuple, the names of the items, in order.
        audience: which agents may know of it.
        apply: applies the event to a state.
        records: returns the records of format version 2 for its data and the moved agent; None: no records.
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
    """An agent moved by an event: its name, and its node, or the node below it, before the event."""

    name: str
    before: int


def _make_number_check(form: str, *, or_none: bool = False) -> Callable[[object, str], tuple[float, ...] | None]:
    """Return a check for tuples of numbers with the fields of `form`."""
    return lambda value, name: None if or_none and value is None else tuple(as_numbers(value, name, form))


def _check_speed(value: object, name: str) -> Any:
    if value is not None:
        as_range(value, name)
    return value


_FIELDS = {  # fields with these names; other fields name their role, and hold any plain value
    "agent_name": Field(Role.AGENT, as_name),
    "names": Field(Role.AGENT),
    "node_id": Field(Role.NODE, as_int),
    **dict.fromkeys(("number", "numbers"), Field(Role.NUMBER)),
    **dict.fromkeys(("node", "previous", "edge_source", "edge_target"), Field(Role.NODE)),
    **dict.fromkeys(("name", "sensor_id", "kind"), Field(check=as_name)),
    **dict.fromkeys(("x", "y", "z", "w"), Field()),
    "orientation": Field(check=_make_number_check("(cos, sin)", or_none=True)),
    "position": Field(check=_make_number_check("(x, y, z)")),
    "quat": Field(check=_make_number_check("(w, x, y, z)")),
    "team": Field(check=as_key),
    "alive": Field(check=as_bool),
    "speed": Field(check=_check_speed),
    **{column.event.key: Field(check=column.check_value) for column in NUMBERS if column.event is not None},
}
EVENTS: dict[int, EventKind] = {}
"""All kinds by code."""

_Apply = Callable[[State, Any], None]
_Records = Callable[[Any, Mover | None], Iterator[Record]]


def _parse_fields(spec: str) -> dict[str, Field]:
    """Return fields by name, from a spec like "name:AGENT ?state:PLAIN": each with a role, or optional.

    A field has no default role, because the role decides who knows the field; see `gamms.knowledge.sides`.

    Raises:
        KeyError: a field has neither a role nor a name of `_FIELDS`.
    """
    fields = {}
    for part in spec.split():
        key, _, role = part.removeprefix("?").partition(":")
        field = _FIELDS.get(key, Field()) if role else _FIELDS[key]
        fields[key] = Field(Role[role] if role else field.role, field.check, part.startswith("?"))
    return fields


def _add_event(
    code: int,
    name: str,
    audience: Audience,
    fields: str = "",
    apply: _Apply | None = None,
    records: _Records | None = None,
) -> int:
    """Add a kind, and return its code. A spec that begins with a number field means that the data are a tuple."""
    is_tuple = fields.startswith("number ")
    EVENTS[code] = EventKind(code, name, _parse_fields(fields), audience, apply or _keep_state, records, is_tuple)
    return code


def _record(code: int, name: str, audience: Audience, fields: str = "", apply: _Apply | None = None) -> int:
    """Add a kind that is also a record of format version 2."""
    return _add_event(code, name, audience, fields, apply, lambda data, _: iter([(code, data)]))


def _keep_state(_state: State, _data: Plain) -> None:
    """Leave the state as it is."""


def _make_setter(column: str, key: str) -> _Apply:
    """Return a function that sets one column of one agent from a field."""
    field = _FIELDS.get(key, Field())

    def apply(state: State, data: Mapping[str, Plain]) -> None:
        value = field.read_value(data, key)
        state.agents.set(state.agents.find_row(data["agent_name"]), column, value)

    return apply


def _make_game_setter(name: str) -> _Apply:
    """Return a function that sets a field of the game from its captured value, stored under its name."""

    def apply(state: State, data: Mapping[str, Plain]) -> None:
        state.game.put(name, FIELDS[name].restored(data[name]))

    return apply


# -- agents -----------------------------------------------------------------------------------------------------


def _list_creation_records(data: Mapping[str, Plain], _: Mover | None) -> Iterator[Record]:
    """Yield the creation, and further records for 1.0.0, which knows other keywords."""
    yield AGENT_CREATE, {"name": data["name"], "kwargs": data["kwargs"]}
    name = {"agent_name": data["name"]}
    given = data["kwargs"]
    made = data.get("state", {})
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


def _move_records(data: Sequence[int], mover: Mover | None) -> Iterator[Record]:
    assert mover is not None  # noqa: S101 - every move has an agent
    yield AGENT_PREV_NODE, {"agent_name": mover.name, "node_id": mover.before}
    yield AGENT_CURRENT_NODE, {"agent_name": mover.name, "node_id": data[1]}


def _list_flight_records(data: tuple[int, int, float, float, float], mover: Mover | None) -> Iterator[Record]:
    assert mover is not None  # noqa: S101 - as above
    yield AERIAL_AGENT_POSITION, {"agent_name": mover.name, "position": list(data[2:])}
    yield AGENT_PREV_NODE, {"agent_name": mover.name, "node_id": mover.before}


def _list_turn_records(data: tuple[int, float, float, float, float], mover: Mover | None) -> Iterator[Record]:
    assert mover is not None  # noqa: S101 - as above
    yield AERIAL_AGENT_QUATERNION, {"agent_name": mover.name, "quat": list(data[1:])}


def _list_position_records(data: Mapping[str, Plain], mover: Mover | None) -> Iterator[Record]:
    yield AERIAL_AGENT_POSITION, {"agent_name": data["agent_name"], "position": data["position"]}
    if mover is not None:
        yield AGENT_PREV_NODE, {"agent_name": data["agent_name"], "node_id": mover.before}


def _create(state: State, data: Mapping[str, Plain]) -> None:
    state.agents.add(data["name"], data["kwargs"], data.get("state", {}), data.get("strategy"))


def _move(state: State, data: Sequence[int]) -> None:
    state.agents.move(data[::2], data[1::2])


def _fly(state: State, data: tuple[int, int, float, float, float]) -> None:
    number, node, *position = data
    state.agents.fly(state.agents.find_numbered_row(number), node, tuple(position))


def _apply_turn(state: State, data: tuple[int, float, float, float, float]) -> None:
    number, *quat = data
    state.agents.set_rotation(state.agents.find_numbered_row(number), tuple(quat))


def _fly_by_name(state: State, data: Mapping[str, Plain]) -> None:
    node = as_int(data["node"], "node") if "node" in data else None
    state.agents.fly(
        state.agents.find_row(data["agent_name"]), node, tuple(as_numbers(data["position"], "position", "(x, y, z)"))
    )


def _register(state: State, data: Mapping[str, Plain]) -> None:
    state.agents.equip(state.agents.find_row(data["agent_name"]), data["name"], data["sensor_id"])


def _deregister(state: State, data: Mapping[str, Plain]) -> None:
    state.agents.unequip(state.agents.find_row(data["agent_name"]), data["name"])


def _apply_progress(state: State, data: Mapping[str, Plain]) -> None:
    columns = {name: data[name] for name in ON_EDGES if name in data}
    state.agents.set_progress(data["numbers"], columns)


def _apply_attribute(state: State, data: Mapping[str, Plain]) -> None:
    numbers = np.asarray(data["numbers"], np.int64).tolist()
    values = data.get("values")
    values = values.tolist() if isinstance(values, np.ndarray) else values
    state.agents.set_attribute(numbers, as_name(data["name"], "name"), values)


def _apply_above(state: State, data: Mapping[str, Plain]) -> None:
    for name, node, previous in zip(data["names"], data["node"].tolist(), data["previous"].tolist(), strict=True):
        row = state.agents.find_row(name)
        state.agents.set(row, "node", node)
        state.agents.set(row, "previous", previous)


_ALL = Audience.ALL
_TEAM = Audience.TEAM
_SENSED = Audience.SENSED
_WITNESSED = Audience.WITNESSED
_HOST = Audience.HOST

AGENT_CREATE = _add_event(
    0x01000000,
    "AGENT_CREATE",
    _HOST,
    "name:AGENT kwargs:PLAIN ?state:PLAIN ?strategy:PLAIN",
    _create,
    _list_creation_records,
)
AGENT_DELETE = _record(
    0x01000001, "AGENT_DELETE", _HOST, "name:AGENT", lambda state, data: state.agents.remove(data["name"])
)
AGENT_SENSOR_REGISTER = _record(0x01100002, "AGENT_SENSOR_REGISTER", _TEAM, "agent_name name sensor_id", _register)
AGENT_SENSOR_DEREGISTER = _record(
    0x01100003, "AGENT_SENSOR_DEREGISTER", _TEAM, "agent_name name sensor_id", _deregister
)
AERIAL_AGENT_POSITION = _add_event(
    0x01100005, "AERIAL_AGENT_POSITION", _SENSED, "agent_name position ?node", _fly_by_name, _list_position_records
)
AERIAL_AGENT_QUATERNION = _record(
    0x01100006, "AERIAL_AGENT_QUATERNION", _SENSED, "agent_name quat", _make_setter("quat", "quat")
)
AGENT_STRATEGY = _add_event(
    0x01100013, "AGENT_STRATEGY", _HOST, "agent_name strategy:PLAIN", _make_setter("strategies", "strategy")
)
AGENT_PROGRESS = _add_event(
    0x01100014,
    "AGENT_PROGRESS",
    _SENSED,
    "numbers edge_source:EACH edge_target:EACH edge_share:EACH ?edge_id:EACH ?edge_motion:EACH",
    _apply_progress,
)
AGENT_ATTRIBUTE = _add_event(0x01100016, "AGENT_ATTRIBUTE", _TEAM, "numbers name ?values:EACH", _apply_attribute)
AERIAL_AGENT_FLIGHT = _add_event(
    0x01100020, "AERIAL_AGENT_FLIGHT", _SENSED, "number node x y z", _fly, _list_flight_records
)
AERIAL_AGENT_TURN = _add_event(
    0x01100021, "AERIAL_AGENT_TURN", _SENSED, "number w x y z", _apply_turn, _list_turn_records
)
FLYERS_ABOVE = _add_event(0x01100030, "FLYERS_ABOVE", _SENSED, "names node:EACH previous:EACH", _apply_above)
# Never written as an event: integers in a log, and a separate column in a file.
MOVES = _add_event(0x01100040, "MOVES", _SENSED, "number node", _move, _move_records)

for _column, (_code, _name, _audience, _key, _is_record) in CHANGE_EVENTS.items():
    (_record if _is_record else _add_event)(_code, _name, _audience, f"agent_name {_key}", _make_setter(_column, _key))
AGENT_CURRENT_NODE = CHANGE_EVENTS["node"].code
AGENT_PREV_NODE = CHANGE_EVENTS["previous"].code
AGENT_ORIENTATION = CHANGE_EVENTS["heading"].code
AGENT_TEAM = CHANGE_EVENTS["teams"].code
AGENT_ALIVE = CHANGE_EVENTS["alive"].code
AGENT_SPEED = CHANGE_EVENTS["speed"].code

_NODE_KEYWORDS = {"prev_node_id": AGENT_PREV_NODE, "current_node_id": AGENT_CURRENT_NODE}


# -- the game ---------------------------------------------------------------------------------------------------


def change(values: dict[Any, Any], changes: Mapping[str, Any]) -> None:
    """Update a dict: items to `set`, keys to `remove`, and `more` items for lists and sets."""
    values.update(deepcopy(changes.get("set", {})))
    for key, more in changes.get("more", {}).items():
        known = values[key]  # in place, so that lists that grow in every turn are not copied
        if isinstance(known, set):
            known.update(more)
        else:
            known.extend(deepcopy(more))
    for key in changes.get("removed", ()):
        values.pop(key, None)


LOGGED: dict[int, str] = {}
"""Kind -> the log of `GameState` to which it adds an entry."""

_TEXTS = {"events": ("kind",), "deeds": ("agent", "deed"), "messages": ("channel", "sender")}  # that entries must have
_NAMES = {"tag": ("agent", "other"), "respawned": ("agent",), "eliminated": ("agent",)}
"""Kind of an event -> its fields that rules and drawings read as names of agents."""


def as_entry(log: str, data: Mapping[str, Plain]) -> dict[str, Any]:
    """Check an entry of a log of `GameState`, and return it.

    Raises:
        BadType: a required key is missing, or a name is not a text.
    """
    found = dict(data)
    missing = next((key for key in _TEXTS[log] if not isinstance(found.get(key), str)), None)
    if missing is not None:
        raise BadType(f"{shown(found)} is not one of the {log}: it has no {missing}.")
    if type(found.get("turn")) is not int:
        raise BadType(f"{shown(found)} is not one of the {log}: its turn is not an integer.")
    named = _NAMES.get(found["kind"], ()) if log == "events" else ()
    wrong = next((key for key in named if not isinstance(found.get(key, ""), str)), None)
    if wrong is not None:
        raise BadType(f"{shown(found)} is not one of the {log}: its {wrong} is not a name.")
    return deepcopy(as_message(found) if log == "messages" else found)


def _add_logged_event(code: int, name: str, audience: Audience, fields: str, log: str) -> int:
    """Add a kind that appends an entry to a log."""
    LOGGED[code] = log
    return _add_event(code, name, audience, fields, lambda state, data: state.append(log, as_entry(log, data)))


def _apply_over(state: State, data: Mapping[str, Plain]) -> None:
    state.game.over = as_over(data or None)


def _remember(state: State, data: Mapping[str, Plain]) -> None:
    for name, changes in data["agents"].items():
        change(state.game.get_memory(name), changes)
    for team, changes in data["teams"]:
        change(state.game.team_memories.setdefault(team, {}), changes)


def _publish_privately(state: State, data: Mapping[str, Plain]) -> None:
    for known, changed in ((state.game.agent_facts, data["agents"].items()), (state.game.team_facts, data["teams"])):
        for to, changes in changed:
            facts = known.setdefault(to, {})
            change(facts, changes)
            facts.update((name, make_shareable(name, facts[name])) for name in changes.get("set", ()))


def _apply_delay(state: State, data: Mapping[str, Plain]) -> None:
    for sensor, owner, changes in data["looks"]:
        looks = state.game.delayed_looks.setdefault((sensor, owner), {})
        change(looks, changes)
        as_looks(looks)


def _count(state: State, data: Mapping[str, Plain]) -> None:
    state.count(as_turn(data["turn"]), int(data["pace"]), data.get("starts", {}))


for _field, (_code, _name, _audience, _key, _) in FIELD_EVENTS.items():
    _add_event(
        _code,
        _name,
        _audience,
        f"{_key}:{'BY_AGENT' if FIELDS[_field].axis == 'agent' else 'PLAIN'}",
        _make_game_setter(_field),
    )
GAME_SCORES = FIELD_EVENTS["scores"].code
GAME_BLOCKED = FIELD_EVENTS["blocked"].code
GAME_NAMED_EDGES = FIELD_EVENTS["named_edges"].code
GAME_DRIVEN = FIELD_EVENTS["driven"].code
GAME_COLLECTED = FIELD_EVENTS["collected"].code
GAME_DATA = _add_event(
    0x04000001,
    "GAME_DATA",
    _HOST,
    "?set:PLAIN ?more:PLAIN ?removed:PLAIN",
    lambda state, data: change(state.game.data, data),
)
DECISIONS = ("choice", "llm")
"""Kinds of emitted events about decisions of an agent: visible only to its own team."""

GAME_EVENT = _add_logged_event(0x04000002, "GAME_EVENT", _WITNESSED, "kind", "events")
GAME_OVER = _add_event(0x04000003, "GAME_OVER", _ALL, "?reason:PLAIN ?winner:PLAIN ?truncated:PLAIN", _apply_over)
GAME_TURN = _add_event(0x04000004, "GAME_TURN", _ALL, "turn:PLAIN pace:PLAIN ?starts:BY_AGENT", _count)
GAME_MEMORY = _add_event(0x04000005, "GAME_MEMORY", _TEAM, "agents:BY_AGENT teams:BY_TEAM", _remember)
GAME_FACTS = _add_event(
    0x04000006,
    "GAME_FACTS",
    _ALL,
    "set:PLAIN removed:PLAIN",
    lambda state, data: state.publish(data["set"], data["removed"]),
)
GAME_CHANCE = _add_event(
    0x04000007, "GAME_CHANCE", _HOST, "chance:PLAIN", lambda state, data: state.set_rng(data["chance"])
)
GAME_PRIVATE_FACTS = _add_event(
    0x0400000B, "GAME_PRIVATE_FACTS", _TEAM, "agents:BY_AGENT teams:BY_TEAM", _publish_privately
)
GAME_DEED = _add_logged_event(0x04000008, "GAME_DEED", _WITNESSED, "agent:AGENT deed:PLAIN at:NODE", "deeds")
GAME_MESSAGE = _add_logged_event(
    0x0400000A, "GAME_MESSAGE", Audience.HEARD, "sender:AGENT channel:PLAIN to:PLAIN body:PLAIN", "messages"
)
USER_EVENT = _add_event(0x05000000, "USER_EVENT", _WITNESSED, "kind")

TERMINATE = _record(0x00000000, "TERMINATE", _ALL)
SIMULATE = _record(0x00000001, "SIMULATE", _ALL, "", lambda state, _: state.end_turn())
SNAPSHOT = _add_event(0x00000010, "SNAPSHOT", _HOST, "names numbers node", lambda state, data: state.restore(data))
UNFINISHED = _add_event(0x00000011, "UNFINISHED", _ALL)
WORLD = _add_event(0x03000000, "WORLD", _ALL, "world:PLAIN", lambda state, data: state.replace_world(data["world"]))
VISUALS = _add_event(0x03000010, "VISUALS", _HOST, "artists:PLAIN", lambda state, data: state.show(data))
VISUAL_COMMANDS = _add_event(
    0x03000011, "VISUAL_COMMANDS", _HOST, "artist:PLAIN layer:PLAIN visible:PLAIN", lambda state, data: state.draw(data)
)
SENSORS = _add_event(
    0x06000000,
    "SENSORS",
    _HOST,
    "sensor_kinds:PLAIN ?removed:PLAIN",
    lambda state, data: state.change_sensors(data["sensor_kinds"], data.get("removed", ())),
)
SENSED = _add_event(0x06000001, "SENSED", _TEAM, "agents:NUMBER ids:PLAIN")
DELAYED_LOOKS = _add_event(0x06000002, "DELAYED_LOOKS", _HOST, "looks:PLAIN", _apply_delay)


def _add_component_event(code: int, name: str, fields: str) -> int:
    """Add a kind that changes components."""
    return _record(code, name, _ALL, fields, lambda state, data: state.change_component(code, data))


COMPONENT_REGISTER = _add_component_event(0x02000000, "COMPONENT_REGISTER", "key:PLAIN struct:PLAIN")
COMPONENT_CREATE = _add_component_event(0x02000001, "COMPONENT_CREATE", "name type:PLAIN")
COMPONENT_UPDATE = _add_component_event(0x02000002, "COMPONENT_UPDATE", "name key:PLAIN value:PLAIN")
COMPONENT_DELETE = _add_component_event(0x02000003, "COMPONENT_DELETE", "name")
COMPONENT_UNREGISTER = _add_component_event(0x02000004, "COMPONENT_UNREGISTER", "key:PLAIN")
COMPONENTS = frozenset([COMPONENT_REGISTER, COMPONENT_CREATE, COMPONENT_UPDATE, COMPONENT_DELETE, COMPONENT_UNREGISTER])
"""The kinds that change components."""


def list_events(log: Log) -> Iterator[tuple[int, Any]]:
    """Yield the events of a log; consecutive moves are one event, `(MOVES, [number, node, number, node, …])`."""
    types = list(map(type, log))
    begin = 0
    for _ in range(types.count(tuple)):
        end = types.index(tuple, begin)
        if end > begin:
            yield MOVES, log[begin:end]
        kind, data = log[end]
        yield kind, data.reshape(-1) if kind == MOVES and isinstance(data, np.ndarray) else data
        begin = end + 1
    if begin < len(log):
        yield MOVES, log[begin:]


def list_steps(log: Log) -> Iterator[tuple[int, Any]]:
    """Yield the events of a log, with each move separately."""
    for kind, data in list_events(log):
        if kind == MOVES:
            moves = data if isinstance(data, list) else data.tolist()
            for step in zip(moves[::2], moves[1::2], strict=True):
                yield MOVES, step
        else:
            yield kind, data


def records_of(kind: int, data: Plain, mover: Mover | None = None) -> Iterator[Record]:
    """Yield the records of format version 2 for an event; without such records, the event itself."""
    known = EVENTS.get(kind)
    if known is None or known.records is None:
        yield kind, data
    else:
        yield from known.records(data, mover)


def renumber_event(kind: int, data: Plain, number_of: Callable[[int], int]) -> Any:
    """Return the data of an event with other agent numbers.

    Args:
        kind: kind of the event.
        data: data of the event; unchanged.
        number_of: number -> new number of the same agent.
    """
    fields = EVENTS[kind].fields if kind in EVENTS else {}
    if isinstance(data, tuple):
        return (number_of(data[0]), *data[1:])
    if kind == MOVES:  # of `list_events`
        moves = list(data)
        moves[::2] = map(number_of, moves[::2])
        return moves
    found = dict(data)
    for key in (key for key, field in fields.items() if field.role is Role.NUMBER):
        found[key] = data[key].copy()
        found[key][:] = [number_of(number) for number in np.asarray(data[key]).tolist()]
    return found
