"""The schema of scenario files: keys, types and defaults, and checks of values. Uses msgspec.

`Spec` is the whole file. Every class is one mapping in it; a key that is not listed is an error. Docstrings explain the
keys to editors and in descriptions, except where the function whose argument a key is explains it: see `describing.py`.
"""

import builtins
import re
import types
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from itertools import chain, count
from typing import Annotated, Any, Literal, TypeVar, Union, cast, get_args, get_origin

import msgspec
from msgspec import Meta
from msgspec.structs import FieldInfo

from gamms.errors import nearest
from gamms.scenario.documents import ScenarioError, join_path
from gamms.text import find_summary, parse_entries, shown

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
    """A position in degrees, which stands for the nearest node.

    Attributes:
        lat: degrees north.
        lon: degrees east.
    """

    lat: float
    lon: float


Place = NodeId | Xy | LatLon | str  # a street, or "A & B"
Outline = Annotated[list[Xy], Meta(min_length=3, description="The corners of an area.")]


class Code(_Mapping, frozen=True, kw_only=True):
    """A function with parameters.

    Attributes:
        function: the function, `module:function`.
        with: its parameters by name.
    """

    function: Reference
    with_: Values = {}


class Plan(Code, frozen=True, kw_only=True):
    """A function that decides for all agents of a team, with parameters.

    Attributes:
        arrays: whether it gets and returns arrays.
    """

    arrays: bool = False


class Grid(_Mapping, frozen=True, kw_only=True):
    """A grid of streets.

    Attributes:
        rows: the number of rows of nodes.
        columns: the number of nodes in each row.
        spacing: metres between neighbors.
    """

    rows: Annotated[int, Meta(ge=1)]
    columns: Annotated[int, Meta(ge=1)]
    spacing: Annotated[float, Meta(gt=0.0)] = 10.0


class Helsinki(_Mapping, frozen=True, kw_only=True):
    """The map that comes with GAMMS."""

    buildings: bool | None = None
    resolution: float = 10.0
    bidirectional: bool | None = None
    osm_type: Modes | None = None


class StreetMap(_Mapping, frozen=True, kw_only=True):
    """The common keys of maps of real streets.

    Attributes:
        modes: a TOML file of modes of travel in the folder.
        bidirectional: whether agents may go against one-way streets; None: as the mode says.
        buildings: whether buildings are obstacles.
        barriers: whether barriers are obstacles, too, or which of them.
        tags: tags that edges and nodes keep besides the usual ones.
        elevation: a .hgt file, or a folder of them, in the folder: nodes get heights, and edges grades.
        scenery: whether buildings, parks, water and rails are drawn.
    """

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
    """A map file in the folder of the scenario: OpenStreetMap, GeoJSON or .gamms.

    Attributes:
        path: the file.
    """

    path: Location


class MapPlace(StreetMap, frozen=True, kw_only=True):
    """Streets by the name of a place.

    Attributes:
        location: the name of the place, or of several.
        truncate_by_edge: whether streets that cross the boundary stay whole.
        custom_filter: filters of Overpass that replace those of the mode.
        offline: whether only earlier downloads are used.
    """

    location: str | dict[str, str] | list[str | dict[str, str]]
    truncate_by_edge: bool | None = None
    custom_filter: str | list[str] | None = None
    offline: bool = False


class Map(_Mapping, frozen=True, kw_only=True):
    """The map of a scenario: exactly one kind of map, and its closed roads.

    Attributes:
        grid: a grid of streets.
        helsinki: the map of central Helsinki that comes with GAMMS.
        file: a map file in the folder of the scenario.
        place: the streets of a place, downloaded.
        generator: a function that returns a networkx graph.
        closed: roads that are closed from the start: names of streets, or areas.
    """

    grid: Grid | None = None
    helsinki: Helsinki | None = None
    file: Location | MapFile | None = None
    place: Location | MapPlace | None = None
    generator: Reference | Code | None = None
    closed: list[Name | Outline | Values] = []


class Sensor(_Mapping, frozen=True, kw_only=True):
    """A sensor, built-in or a function; each agent that names it gets a separate instance.

    Attributes:
        type: the kind of a built-in sensor, such as AGENT_RANGE.
        function: the function that computes the data, `module:function`.
        with: its parameters by name.
    """

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
    """A straight-line distance to every agent of an earlier team.

    Attributes:
        team: the team to keep away from.
        at_least: the distance in metres.
    """

    team: Name
    at_least: Metres


class ModeAttribute(_Mapping, frozen=True, kw_only=True):
    """The edge attribute that says which edges may be used: by true or false, or by speeds.

    Attributes:
        attribute: the name of the edge attribute.
        turns: whether agents obey the turn restrictions of the map.
    """

    attribute: Name
    turns: Annotated[bool, Meta(description="Whether agents obey the turn restrictions of the map.")] = False


class AgentKeys(_Mapping, frozen=True, kw_only=True):
    """The keys that a team sets for all its agents, or an agent for itself.

    Attributes:
        altitude: the height at which an aerial agent starts.
        sensors: name -> sensor, or names of sensors of the scenario.
        strategy: the function that decides for the agent.
        meta: plain values for the code of the game.
    """

    type: str | None = None
    speed: Annotated[float, Meta(gt=0.0)] | None = None
    mode: Name | ModeAttribute | None = None
    altitude: float | None = None
    sensors: dict[Name, Sensor] | list[Name] | None = None
    strategy: Reference | Code | None = None
    meta: Values = {}


class Agent(AgentKeys, frozen=True, kw_only=True):
    """An agent; without a node it is placed by the rules of its team.

    Attributes:
        name: its name, which no other agent has.
        node: where it starts; None: as its team says.
    """

    name: Name
    node: Place | None = None


class Team(AgentKeys, frozen=True, kw_only=True):
    """A team: listed agents, or a number of agents placed at random.

    Attributes:
        count: the number of agents that are placed at random, called NAME_0, NAME_1, and so on.
        agents: agents that are listed one by one.
        near: the place around which its agents start, within the distance `within`.
        within: the greatest distance from `near` at the start, in metres.
        apart: the least distance of its agents from each other at the start, in metres.
        from: the least distance of its agents from those of earlier teams at the start.
        plan: the function that decides for all agents of the team.
    """

    count: Count = 0
    agents: list[Agent] = []
    near: Place | None = None
    within: Metres | None = None
    apart: Metres = 0.0
    from_: TeamDistance | list[TeamDistance] = []
    plan: Reference | Plan | None = None


class Rule(_Mapping, frozen=True, kw_only=True):
    """A rule with parameters.

    Attributes:
        rule: the function: a name of `gamms.rules`, or `module:function`.
        with: its parameters by name.
    """

    rule: Reference
    with_: Values = {}
    phase: Literal["after", "before", "deeds"] = "after"
    name: Name | None = None


class PriorityOrder(_Mapping, frozen=True, kw_only=True):
    """The teams and roles in the order in which they win.

    Attributes:
        by_priority: the teams and roles, the first of which wins.
    """

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
    deadline_s: Annotated[float, Meta(gt=0.0, description="Seconds per turn for awaited strategies.")] | None = None
    default_action: Literal["stay"] | NodeId = "stay"
    team_memory: bool = True
    information: Literal["private", "full"] = "private"
    order: Annotated[list[Annotated[list[Name], Meta(min_length=1)]], Meta(min_length=1)] | None = None
    deeds: dict[Name, dict[Name, Any] | None] = {}


class Jammer(_Mapping, frozen=True, kw_only=True):
    """A jammer of a channel around an agent, all agents of a team, or a place: exactly one of these.

    Attributes:
        radius_m: the radius in which nothing is heard, in map units.
        agent: the agent around which the channel is jammed.
        team: the team around whose agents the channel is jammed.
        at: the place around which the channel is jammed.
    """

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
    """A game, completely.

    Attributes:
        map: where the game is played.
        teams: name -> team: agents, their starts and strategies.
        name: the name of the game.
        description: what the game is about.
        seed: the seed from which all draws follow; None: every game has another one.
        max_turns: the maximum number of turns; None: only rules end the game.
        sensors: name -> sensor; each agent that names one gets a separate instance.
        rules: the rules in the order in which they are applied.
        conflicts: how conflicting moves are resolved; None: all moves are made.
        channels: name -> channel for messages.
        settings: the settings of the turn engine.
        facts: facts for all strategies.
        data: the initial content of `ctx.game.data`.
        files: files in the folder that the code reads; experiments play games again when one changes.
    """

    map: Map
    teams: Annotated[dict[Name, Team], Meta(min_length=1)]
    name: str = ""
    description: str = ""
    seed: int | None = None
    max_turns: Count | None = None
    sensors: dict[Name, Sensor] = {}
    rules: list[Reference | Rule] = []
    conflicts: Conflicts | None = None
    channels: dict[Name, Channel] = {}
    settings: Settings = Settings()
    facts: Values = {}
    data: Values = {}
    files: list[Location] = []


def schema() -> Values:
    """Return the JSON Schema of a scenario file, for editors."""
    found: Values = {"$schema": "https://json-schema.org/draft/2020-12/schema", **msgspec.json.schema(Spec)}
    for kind in list_mappings():
        part = found["$defs"][kind.__name__]
        part["description"] = find_summary(kind.__doc__)
        for key, text in list_key_texts(kind).items():
            part["properties"][key].setdefault("description", text)
    return found


def list_mappings() -> list[type[msgspec.Struct]]:
    """Return all mappings of the schema, from the whole file to the innermost ones."""
    found: list[type[msgspec.Struct]] = [Spec]
    position = 0
    while position < len(found):
        for field in list_keys(found[position]).values():
            inner = dict.fromkeys(one for _, one in _find_mappings(field.type, ""))
            found += [one for one in inner if one not in found]
        position += 1
    return found


def list_key_texts(kind: type) -> dict[str, str]:
    """Return the meaning of the keys of a mapping that its docstrings explain."""
    texts: dict[str, str] = {}
    for part in reversed(kind.__mro__):
        texts |= parse_entries(part.__doc__)
    return {key: text for key, text in texts.items() if key in list_keys(kind)}


def convert_plain(value: object, kind: Any, path: str = "") -> Any:  # Any: a type, or a union of types
    """Convert plain values to a type.

    Raises:
        ScenarioError: they do not fit; it names the innermost place that is wrong, and the nearest valid key.
    """
    try:
        return msgspec.convert(value, kind)
    except (ValueError, TypeError, RecursionError) as error:
        raise _explain_error(value, kind, path, str(error)) from None


def expand(kind: type[_T], given: str | _T) -> _T:
    """Convert a value to a mapping of the schema; a text becomes the value of the first required key."""
    return kind(**{_find_first_required(kind): given}) if isinstance(given, str) else given


@cache
def _find_first_required(kind: type) -> str:
    return next(field.name for field in msgspec.structs.fields(kind) if field.required)


def to_plain(part: msgspec.Struct) -> Values:
    """Return a mapping of the schema as plain values, defaults included."""
    plain: Values = msgspec.to_builtins(part)
    return plain


def list_given_values(part: msgspec.Struct) -> Values:
    """Return the values of a mapping by Python's names: all that are not None."""
    values = {name: getattr(part, name) for name in part.__struct_fields__}
    return {name: value for name, value in values.items() if value is not None}


# -- walking through a scenario ---------------------------------------------------------------------------------


def find_mappings(spec: Spec) -> dict[type, list[tuple[str, msgspec.Struct]]]:
    """Return all mappings of a scenario by their kind, each with its place."""
    found: dict[type, list[tuple[str, msgspec.Struct]]] = {kind: [] for kind in list_mappings()}
    waiting: list[tuple[str, object]] = [("", spec)]
    while waiting:
        path, value = waiting.pop()
        if isinstance(value, msgspec.Struct):
            found[type(value)].append((path, value))
        parts = [(join_path(path, key), one) for key, one in _list_items(value)]
        waiting += reversed(parts)
    return found


def has_mapping(value: object) -> bool:
    """Return whether a value is a mapping of the schema, or holds one."""
    return isinstance(value, msgspec.Struct) or any(has_mapping(one) for _, one in _list_items(value))


def _list_items(value: object) -> Iterable[tuple[object, object]]:
    if isinstance(value, msgspec.Struct):
        return [(key, getattr(value, field.name)) for key, field in list_keys(type(value)).items()]
    if isinstance(value, dict):
        return value.items()
    return enumerate(value) if isinstance(value, (list, tuple)) else ()


def list_given_keys(part: msgspec.Struct) -> Values:
    """Return the values of a mapping that differ from their defaults, by their keys, as plain values."""
    plain = to_plain(part)
    keys = list_keys(type(part))
    return {key: plain[key] for key, one in keys.items() if getattr(part, one.name) != get_default(one)}


def get_default(field: FieldInfo) -> Any:  # Any: of any type
    """Return the default of a key."""
    return field.default if field.default_factory is msgspec.NODEFAULT else field.default_factory()


def as_builtins(value: object) -> Any:  # Any: of any type
    """Return a value with its mappings of the schema as plain values."""
    return msgspec.to_builtins(value)


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


def _explain_error(value: Any, kind: Any, path: str, message: str) -> ScenarioError:
    """Return the error for a value that is not of a type, at the innermost place that is wrong."""
    for option in _list_options(kind):
        fields = list_keys(option) if isinstance(value, dict) else {}
        for key in value if fields else ():
            if key not in fields:
                hint = _explain_key(key, value, option, path)
                return ScenarioError(join_path(path, key), f"unknown key, with the value {shown(value[key])}.{hint}")
        for key, field in fields.items():
            if field.required and key not in value:
                return ScenarioError(join_path(path, key), f"is missing in {shown(value)}.")
        for key, part, its_kind in _list_parts(value, option, fields):
            try:
                msgspec.convert(part, its_kind)
            except (ValueError, TypeError, RecursionError) as error:
                return _explain_error(part, its_kind, join_path(path, key), str(error))
    return ScenarioError(path, f"cannot be {shown(value)}: {_describe_valid_values(value, kind, message)}")


def _explain_key(key: str, value: Mapping[str, Any], kind: object, path: str) -> str:
    """Return the hint for an unknown key of a mapping: where it belongs, or the most similar key, or all keys."""
    fields = list_keys(kind)
    if path and key in list_keys(Spec):
        return " It belongs at the top of the file, beside map and teams."
    if kind is Rule and "rule" not in value:
        return nearest(key, fields) or f" Write {{rule: {key}, with: {{…}}}}."
    if isinstance(kind, type) and issubclass(kind, Rule | Code):
        return nearest(key, fields) or f" Parameters belong into with: {{{key}: …}}."
    sibling = nearest(key, [field for field in fields if field not in value]) if kind is Spec else ""
    if sibling:
        return sibling
    wanted = _IN_PYTHON.get(key, key)
    below = [place for place, _ in _find_places(wanted, kind)]
    if wanted in fields or below:
        named = "" if wanted == key else f" Scenario files call it {wanted}."
        return named + (_describe_places(below, _describe_form(wanted, value, kind)) if below else "")
    elsewhere = [place for place, one in _find_places(key, Spec) if one is not kind]
    return nearest(key, fields) or _describe_places(elsewhere) or f" Keys here are: {', '.join(fields)}."


def _describe_places(places: list[str], form: str = "") -> str:
    """Return a sentence that names the first few places of a key; nothing without places."""
    few = list(dict.fromkeys(place.replace(_LIST, "") for place in places))[:_FEW]
    return f" It belongs into {' or '.join(few)}{form and f', such as {form}'}." if few else ""


def _describe_form(key: str, value: Mapping[str, Any], kind: object) -> str:
    """Return how a key is written into a mapping inside of a mapping, with the keys that it needs there."""

    def rank(found: tuple[str, type]) -> tuple[bool, bool]:
        place, inner = found
        return place.partition(".")[0] not in value, not any(field.required for field in list_keys(inner).values())

    place, inner = min(_find_places(key, kind), key=rank)
    needed = [f"{name}: …" for name, field in list_keys(inner).items() if field.required and name != key]
    form = f"{{{', '.join([*needed, f'{key}: …'])}}}"
    names = place.split(".")
    for name in reversed(names):
        form = f"[{form}]" if name.endswith(_LIST) else form
        form = f"{name.removesuffix(_LIST)}: {form}"
        form = form if name is names[0] else f"{{{form}}}"
    return form


def _find_places(key: str, kind: object, path: str = "") -> Iterator[tuple[str, type]]:
    """Yield the place and the type of each mapping inside of a type of mapping that has a key."""
    for name, field in list_keys(kind).items():
        for place, inner in _find_mappings(field.type, join_path(path, name)):
            if key in list_keys(inner):
                yield place, inner
            yield from _find_places(key, inner, place)


def _find_mappings(kind: object, path: str) -> Iterator[tuple[str, type]]:
    """Yield the place and the type of each mapping of the schema that a value of a type may be or hold."""
    for option in _list_options(kind):
        if list_keys(option):
            yield path, cast("type", option)
        elif get_origin(option) is dict:
            yield from _find_mappings(get_args(option)[1], join_path(path, "NAME"))
        elif get_origin(option) is list:
            yield from _find_mappings(get_args(option)[0], f"{path}{_LIST}")


def _list_parts(value: Any, kind: Any, fields: Mapping[str, FieldInfo]) -> Iterator[tuple[object, Any, Any]]:
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


def list_keys(kind: object) -> dict[str, FieldInfo]:
    """Return the keys of a mapping of the schema; nothing for another type."""
    if not (isinstance(kind, type) and issubclass(kind, msgspec.Struct)):
        return {}
    return _read_keys(kind)


@cache
def _read_keys(kind: type[msgspec.Struct]) -> dict[str, FieldInfo]:
    return {field.encode_name: field for field in msgspec.structs.fields(kind)}


def _list_options(kind: object) -> list[object]:
    """Return the types that a type may be, without their annotations."""
    if get_origin(kind) is Annotated:
        return _list_options(get_args(kind)[0])
    if get_origin(kind) in (Union, types.UnionType):
        return list(chain.from_iterable(_list_options(option) for option in get_args(kind)))
    return [kind]


def _describe_valid_values(value: object, kind: object, message: str) -> str:
    """Return a hint about the valid values."""
    literals = [option for option in _list_options(kind) if get_origin(option) is Literal]
    choices = list(chain.from_iterable(map(get_args, literals)))
    if choices:
        others = [_TYPES[name] for name in ("int", "float", "str") if getattr(builtins, name) in _list_options(kind)]
        return f"use one of {', '.join(map(str, [*choices, *others]))}.{nearest(value, choices)}"
    return _describe_required(message) + _explain_form(value, kind)


def _explain_form(value: object, kind: object) -> str:
    """Return the hint for a value that is not in the form of a mapping or a list: the form that it probably means."""
    options = _list_options(kind)
    mapping = next((option for option in options if list_keys(option)), None)
    if mapping is not None and not isinstance(value, dict):
        keys = f" Its keys are {', '.join(list_keys(mapping))}."
        if isinstance(value, str) and value in list_keys(mapping):
            return f"{keys} Write {{{value}: …}}."
        is_kind = mapping is Sensor and isinstance(value, str) and value.isidentifier()
        return f"{keys} Write {{type: {value}}}." if is_kind else keys
    if isinstance(value, list) and any(get_origin(option) is dict for option in options):
        return " Give each a name: {NAME: …}."
    if isinstance(value, dict) and any(get_origin(option) is list for option in options):
        return " Begin each item with '- '."
    return ""


def _describe_required(message: str) -> str:
    """Return what msgspec says about the type of a value, in words of scenario files."""
    plain = re.sub(
        r"`([a-z |]+)`", lambda found: " or ".join(_TYPES.get(one, one) for one in found[1].split(" | ")), message
    )
    return f"{plain[:1].lower()}{plain[1:]}.".replace("expected ", "it must be ").replace(", got ", ", not ")
