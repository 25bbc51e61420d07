"""The schema of scenario files: keys, types and defaults, and checks of values. Uses msgspec.

`Spec` is the whole file. Every class is one mapping in it; a key that is not listed is an error.
"""

import builtins
import re
import types
from collections.abc import Iterator, Mapping
from functools import cache
from itertools import chain, count
from typing import Annotated, Any, Literal, TypeVar, Union, cast, get_args, get_origin

import msgspec
from msgspec import Meta
from msgspec.structs import FieldInfo

from gamms.errors import nearest
from gamms.scenario.documents import ScenarioError, joined
from gamms.text import shown

Metres = Annotated[float, Meta(ge=0.0, description="Map units; metres on maps of streets.")]
Count = Annotated[int, Meta(ge=0)]
NodeId = Annotated[int, Meta(description="The id of a node.")]
Xy = Annotated[tuple[float, float], Meta(description="[x, y] on the map; the nearest node is meant.")]
Point = Annotated[list[float], Meta(min_length=2, max_length=3, description="[x, y], or [x, y, z] in the air.")]
Name = Annotated[str, Meta(min_length=1, max_length=200)]
Location = Annotated[str, Meta(min_length=1, max_length=1000)]
Reference = Annotated[
    str,
    Meta(
        min_length=1,
        max_length=1000,
        description="module:function, in the folder of the file, of GAMMS or of a package that offers it.",
    ),
]
Travel = Annotated[
    str,
    Meta(min_length=1, max_length=100, description="A mode of travel of GAMMS, such as walk or drive, or of `modes`."),
]
NetworkTags = Annotated[
    dict[str, bool | str | list[str] | dict[str, float]],
    Meta(min_length=1, description="The tags of a network that is no road, such as railway: [rail, tram]."),
]
Modes = (
    Travel
    | NetworkTags
    | Annotated[list[Travel | NetworkTags], Meta(min_length=1, description="The modes of travel of one graph.")]
)
Values = dict[str, Any]
_T = TypeVar("_T", bound=msgspec.Struct)


class _Mapping(
    msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True, rename={"with_": "with", "from_": "from"}
):
    """The base class of all mappings in the file."""


class LatLon(_Mapping, frozen=True, kw_only=True):
    """A position in degrees, which stands for the nearest node."""

    lat: float
    lon: float


Place = NodeId | Xy | LatLon | str  # a street, or "A & B"
Outline = Annotated[list[Xy], Meta(min_length=3, description="The corners of an area.")]


class Code(_Mapping, frozen=True, kw_only=True):
    """A function with parameters."""

    function: Reference
    with_: Values = {}


class Plan(Code, frozen=True, kw_only=True):
    """A function that decides for all agents of a team, with parameters."""

    arrays: bool = False


class Grid(_Mapping, frozen=True, kw_only=True):
    """A grid of streets."""

    rows: Annotated[int, Meta(ge=1)]
    columns: Annotated[int, Meta(ge=1, description="Nodes in each row.")]
    spacing: Annotated[float, Meta(gt=0.0, description="Metres between neighbours.")] = 10.0


class Helsinki(_Mapping, frozen=True, kw_only=True):
    """The map that comes with GAMMS."""

    buildings: bool | None = None
    resolution: float = 10.0
    bidirectional: bool | None = None
    osm_type: Modes | None = None


class StreetMap(_Mapping, frozen=True, kw_only=True):
    """The common keys of maps of real streets."""

    osm_type: Modes | None = None
    modes: Annotated[Location, Meta(description="A TOML file of modes of travel in the folder.")] | None = None
    resolution: float | None = None
    bidirectional: bool | None = None
    retain_all: bool | None = None
    tolerance: float | None = None
    simplify: bool | None = None
    buildings: bool = False
    barriers: Annotated[bool | list[str], Meta(description="Which barriers are walls, too.")] = False
    tags: Annotated[list[str], Meta(description="Tags that edges and nodes keep.")] | None = None
    elevation: Annotated[Location, Meta(description="A .hgt file, or a folder of them, in the folder.")] | None = None
    scenery: bool = False


class MapFile(StreetMap, frozen=True, kw_only=True):
    """A map file in the folder of the scenario: OpenStreetMap, GeoJSON or .gamms."""

    path: Location


class MapPlace(StreetMap, frozen=True, kw_only=True):
    """Streets by the name of a place."""

    location: str | dict[str, str] | list[str | dict[str, str]]
    truncate_by_edge: bool | None = None
    custom_filter: str | list[str] | None = None
    offline: bool = False


class Map(_Mapping, frozen=True, kw_only=True):
    """The map of a scenario: exactly one kind of map, and its closed roads."""

    grid: Grid | None = None
    helsinki: Helsinki | None = None
    file: Location | MapFile | None = None
    place: Location | MapPlace | None = None
    generator: Reference | Code | None = None
    closed: list[Name | Outline | Values] = []


class Sensor(_Mapping, frozen=True, kw_only=True):
    """A sensor, built-in or a function; each agent that names it gets a separate instance."""

    type: str | None = None
    function: Reference | None = None
    with_: Values | None = None
    range_m: Metres | None = None
    fov: float | None = None
    orientation: tuple[float, float] | None = None
    observer_height: float | None = None
    quat: tuple[float, float, float, float] | None = None
    at: NodeId | Point | None = None
    team: str | list[str] | None = None
    exclude: str | list[str] | None = None
    detection: float | list[tuple[float, float]] | None = None
    position_noise_m: Metres | None = None
    false_alarm_rate: Annotated[float, Meta(ge=0.0, le=100.0)] | None = None
    delay_turns: Count | None = None


class TeamDistance(_Mapping, frozen=True, kw_only=True):
    """A straight-line distance to every agent of an earlier team."""

    team: Name
    at_least: Metres


class ModeAttribute(_Mapping, frozen=True, kw_only=True):
    """The edge attribute that says which edges may be used: by true or false, or by speeds."""

    attribute: Name
    turns: Annotated[bool, Meta(description="Whether agents obey the turn restrictions of the map.")] = False


class AgentKeys(_Mapping, frozen=True, kw_only=True):
    """The keys that a team sets for all its agents, or an agent for itself."""

    type: str | None = None
    speed: Annotated[float, Meta(gt=0.0)] | None = None
    mode: Name | ModeAttribute | None = None
    altitude: float | None = None
    sensors: dict[Name, Sensor] | list[Name] | None = None
    strategy: Reference | Code | None = None
    meta: Values = {}


class Agent(AgentKeys, frozen=True, kw_only=True):
    """An agent; without a node it is placed by the rules of its team."""

    name: Name
    node: Place | None = None


class Team(AgentKeys, frozen=True, kw_only=True):
    """A team: listed agents, or a number of agents placed at random."""

    count: Count = 0
    agents: list[Agent] = []
    near: Place | None = None
    within: Metres | None = None
    apart: Metres = 0.0
    from_: TeamDistance | list[TeamDistance] = []
    plan: Reference | Plan | None = None


class Rule(_Mapping, frozen=True, kw_only=True):
    """A rule with parameters."""

    rule: Reference
    with_: Values = {}
    phase: Literal["after", "before", "deeds"] = "after"
    name: Name | None = None


class PriorityOrder(_Mapping, frozen=True, kw_only=True):
    """The teams and roles in the order in which they win."""

    by_priority: Annotated[list[Name | Values], Meta(min_length=1)]


class Conflicts(_Mapping, frozen=True, kw_only=True):
    """Conflicts of moves: the capacity of nodes, and the winners; the parameters of `gamms.rules.Conflicts`."""

    capacity: Count | str | dict[str | int, Count] | None = 1
    edge_capacity: Count | str | dict[str | int, Count] | None = None
    among: Literal["all", "team"] = "all"
    allow_swaps: bool = True
    resolve: Reference | PriorityOrder = "at_random"


class Settings(_Mapping, frozen=True, kw_only=True):
    """Settings of the turn engine."""

    legal: Literal["edges", "any"] = "edges"
    on_illegal: Literal["stay", "raise"] = "stay"
    on_error: Literal["raise", "stay"] = "raise"
    speed_unit: Literal["edges", "metres", "metres_per_second"] = "edges"
    turn_seconds: Annotated[float, Meta(gt=0.0, description="Seconds per turn, for metres_per_second.")] = 1.0
    weight: Name = "length"
    decide: Literal["turn", "arrival"] = "turn"
    time_budget: Annotated[float, Meta(gt=0.0, description="Seconds per decision.")] | None = None
    deadline_s: Annotated[float, Meta(gt=0.0, description="Seconds per turn for what is awaited.")] | None = None
    default_action: Literal["stay"] | NodeId = "stay"
    team_memory: bool = True
    information: Literal["private", "full"] = "private"
    order: Annotated[list[Annotated[list[Name], Meta(min_length=1)]], Meta(min_length=1)] | None = None
    deeds: dict[Name, dict[Name, Any] | None] = {}


class Jammer(_Mapping, frozen=True, kw_only=True):
    """A jammer of a channel around an agent, all agents of a team, or a place: exactly one of these."""

    radius_m: Metres
    agent: Name | None = None
    team: Name | None = None
    at: NodeId | Xy | None = None


class Channel(_Mapping, frozen=True, kw_only=True):
    """A channel for messages; it needs range_m, hops or line_of_sight."""

    range_m: Metres | None = None
    hops: Annotated[int, Meta(ge=1, description="Edges.")] | None = None
    line_of_sight: bool = False
    relay: bool | list[Name] = False
    loss: float | list[tuple[float, float]] = 0.0
    delay_turns: Annotated[int, Meta(ge=1)] = 1
    max_bytes_per_turn: Annotated[int, Meta(ge=1)] | None = None
    jammers: list[Jammer] = []
    teams: Name | list[Name] | None = None
    eavesdroppers: Name | list[Name] = []


class Spec(_Mapping, frozen=True, kw_only=True):
    """A game, completely."""

    map: Map  # where it is played
    teams: Annotated[dict[Name, Team], Meta(min_length=1)]  # agents, their start nodes, and strategies
    name: str = ""
    description: str = ""
    seed: int | None = None  # all that is drawn follows from it; None: every game is another
    max_turns: Count | None = None  # the maximum number of turns; None: only rules end the game
    sensors: dict[Name, Sensor] = {}  # sensors by name; each agent that names one gets a separate instance
    rules: list[Reference | Rule] = []  # in the order in which they are applied
    conflicts: Conflicts | None = None  # resolution of conflicting moves; None: all moves are made
    channels: dict[Name, Channel] = {}  # channels for messages
    settings: Settings = Settings()  # of the turn engine
    facts: Values = {}  # facts for all strategies
    data: Values = {}  # initial content of `ctx.game.data`


def schema() -> Values:
    """Return the JSON Schema of a scenario file, for editors."""
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **msgspec.json.schema(Spec)}


def checked(value: object, kind: Any, path: str = "") -> Any:  # Any: a type, or a union of types
    """Convert plain values to a type.

    Raises:
        ScenarioError: they do not fit; it names the innermost place that is wrong, and the nearest valid key.
    """
    try:
        return msgspec.convert(value, kind)
    except (ValueError, TypeError, RecursionError) as error:
        raise _explained(value, kind, path, str(error)) from None


def in_full(kind: type[_T], given: str | _T) -> _T:
    """Convert a value to a mapping of the schema; a text becomes the value of the first required key."""
    return kind(**{_first_required(kind): given}) if isinstance(given, str) else given


@cache
def _first_required(kind: type) -> str:
    return next(field.name for field in msgspec.structs.fields(kind) if field.required)


def to_plain(part: msgspec.Struct) -> Values:
    """Return a mapping of the schema as plain values, defaults included."""
    plain: Values = msgspec.to_builtins(part)
    return plain


def given_values(part: msgspec.Struct) -> Values:
    """Return the values of a mapping by Python's names: all that are not None."""
    values = {name: getattr(part, name) for name in part.__struct_fields__}
    return {name: value for name, value in values.items() if value is not None}


# -- errors -----------------------------------------------------------------------------------------------------

_FEW = 3  # places of a key that are named
_LIST = "[]"  # at the end of the place of a list
_IN_PYTHON = {  # other name -> key in files
    "start_node_id": "node",
    "start": "node",
    "osm": "file",
    "turns": "max_turns",
    **dict.fromkeys(("size", "number", "num", "agent_count"), "count"),
}
_TYPES = {
    "int": "a whole number",
    "float": "a number",
    "str": "a text",
    "bool": "true or false",
    "array": "a list",
    "object": "a mapping",
    "null": "nothing",
}


def _explained(value: Any, kind: Any, path: str, message: str) -> ScenarioError:
    """Return the error for a value that is not of a type, at the innermost place that is wrong."""
    for option in _options(kind):
        fields = _fields_of(option) if isinstance(value, dict) else {}
        for key in value if fields else ():
            if key not in fields:
                hint = _hint_for_key(key, value, option, path)
                return ScenarioError(joined(path, key), f"unknown key, with the value {shown(value[key])}.{hint}")
        for key, field in fields.items():
            if field.required and key not in value:
                return ScenarioError(joined(path, key), f"is missing in {shown(value)}.")
        for key, part, its_kind in _parts(value, option, fields):
            try:
                msgspec.convert(part, its_kind)
            except (ValueError, TypeError, RecursionError) as error:
                return _explained(part, its_kind, joined(path, key), str(error))
    return ScenarioError(path, f"cannot be {shown(value)}: {_in_words(value, kind, message)}")


def _hint_for_key(key: str, value: Mapping[str, Any], kind: object, path: str) -> str:
    """Return the hint for an unknown key of a mapping: where it belongs, or the most similar key, or all keys."""
    fields = _fields_of(kind)
    if path and key in _fields_of(Spec):
        return " It belongs at the top of the file, beside map and teams."
    if kind is Rule and "rule" not in value:
        return nearest(key, fields) or f" Write {{rule: {key}, with: {{…}}}}."
    if isinstance(kind, type) and issubclass(kind, Rule | Code):
        return nearest(key, fields) or f" Parameters belong into with: {{{key}: …}}."
    sibling = nearest(key, [field for field in fields if field not in value]) if kind is Spec else ""
    if sibling:
        return sibling
    wanted = _IN_PYTHON.get(key, key)
    below = [place for place, _ in _places_of(wanted, kind)]
    if wanted in fields or below:
        named = "" if wanted == key else f" Scenario files call it {wanted}."
        return named + (_belongs(below, _form_of(wanted, value, kind)) if below else "")
    elsewhere = [place for place, one in _places_of(key, Spec) if one is not kind]
    return nearest(key, fields) or _belongs(elsewhere) or f" Keys here are: {', '.join(fields)}."


def _belongs(places: list[str], form: str = "") -> str:
    """Return a sentence that names the first few places of a key; nothing without places."""
    few = list(dict.fromkeys(place.replace(_LIST, "") for place in places))[:_FEW]
    return f" It belongs into {' or '.join(few)}{form and f', such as {form}'}." if few else ""


def _form_of(key: str, value: Mapping[str, Any], kind: object) -> str:
    """Return how a key is written into a mapping inside of a mapping, with the keys that it needs there."""

    def rank(found: tuple[str, type]) -> tuple[bool, bool]:
        place, inner = found
        return place.partition(".")[0] not in value, not any(field.required for field in _fields_of(inner).values())

    place, inner = min(_places_of(key, kind), key=rank)
    needed = [f"{name}: …" for name, field in _fields_of(inner).items() if field.required and name != key]
    form = f"{{{', '.join([*needed, f'{key}: …'])}}}"
    names = place.split(".")
    for name in reversed(names):
        form = f"[{form}]" if name.endswith(_LIST) else form
        form = f"{name.removesuffix(_LIST)}: {form}"
        form = form if name is names[0] else f"{{{form}}}"
    return form


def _places_of(key: str, kind: object, path: str = "") -> Iterator[tuple[str, type]]:
    """Yield the place and the type of each mapping inside of a type of mapping that has a key."""
    for name, field in _fields_of(kind).items():
        for place, inner in _mappings_in(field.type, joined(path, name)):
            if key in _fields_of(inner):
                yield place, inner
            yield from _places_of(key, inner, place)


def _mappings_in(kind: object, path: str) -> Iterator[tuple[str, type]]:
    """Yield the place and the type of each mapping of the schema that a value of a type may be or hold."""
    for option in _options(kind):
        if _fields_of(option):
            yield path, cast("type", option)
        elif get_origin(option) is dict:
            yield from _mappings_in(get_args(option)[1], joined(path, "NAME"))
        elif get_origin(option) is list:
            yield from _mappings_in(get_args(option)[0], f"{path}{_LIST}")


def _parts(value: Any, kind: Any, fields: Mapping[str, FieldInfo]) -> Iterator[tuple[object, Any, Any]]:
    """Yield the name, value and type of each item of a value, if the value has the form of the type."""
    origin = get_origin(kind)
    arguments = get_args(kind)
    if fields:
        yield from ((key, value[key], field.type) for key, field in fields.items() if key in value)
    elif origin is dict and isinstance(value, dict):
        for key, one in value.items():
            yield key, key, arguments[0]
            yield key, one, arguments[1]
    elif origin is list and isinstance(value, list):
        yield from ((number, one, arguments[0]) for number, one in enumerate(value))
    elif origin is tuple and isinstance(value, list) and len(value) == len(arguments):
        yield from zip(count(), value, arguments)


def _fields_of(kind: object) -> dict[str, FieldInfo]:
    """Return the keys of a mapping of the schema; nothing for another type."""
    if not (isinstance(kind, type) and issubclass(kind, msgspec.Struct)):
        return {}
    return {field.encode_name: field for field in msgspec.structs.fields(kind)}


def _options(kind: object) -> list[object]:
    """Return the types that a type may be, without their annotations."""
    if get_origin(kind) is Annotated:
        return _options(get_args(kind)[0])
    if get_origin(kind) in (Union, types.UnionType):
        return list(chain.from_iterable(_options(option) for option in get_args(kind)))
    return [kind]


def _in_words(value: object, kind: object, message: str) -> str:
    """Return a hint about the valid values."""
    literals = [option for option in _options(kind) if get_origin(option) is Literal]
    choices = list(chain.from_iterable(map(get_args, literals)))
    if choices:
        others = [_TYPES[name] for name in ("int", "float", "str") if getattr(builtins, name) in _options(kind)]
        return f"use one of {', '.join(map(str, [*choices, *others]))}.{nearest(value, choices)}"
    return _required(message) + _hint_for_form(value, kind)


def _hint_for_form(value: object, kind: object) -> str:
    """Return the hint for a value that is not in the form of a mapping or a list: the form that it probably means."""
    options = _options(kind)
    mapping = next((option for option in options if _fields_of(option)), None)
    if mapping is not None and not isinstance(value, dict):
        keys = f" Its keys are {', '.join(_fields_of(mapping))}."
        if isinstance(value, str) and value in _fields_of(mapping):
            return f"{keys} Write {{{value}: …}}."
        is_kind = mapping is Sensor and isinstance(value, str) and value.isidentifier()
        return f"{keys} Write {{type: {value}}}." if is_kind else keys
    if isinstance(value, list) and any(get_origin(option) is dict for option in options):
        return " Give each a name: {NAME: …}."
    if isinstance(value, dict) and any(get_origin(option) is list for option in options):
        return " Begin each item with '- '."
    return ""


def _required(message: str) -> str:
    """Return what msgspec says about the type of a value, in words of scenario files."""
    plain = re.sub(
        r"`([a-z |]+)`", lambda found: " or ".join(_TYPES.get(one, one) for one in found[1].split(" | ")), message
    )
    return f"{plain[:1].lower()}{plain[1:]}.".replace("expected ", "it must be ").replace(", got ", ", not ")
