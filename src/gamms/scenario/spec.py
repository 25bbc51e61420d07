"""The keys of a scenario file and their types, checked by msgspec; errors name the place and what was probably meant.

`Spec` is the whole file. Every class is one mapping in it; a key that is not listed is an error.
"""

import types
from collections.abc import Iterable
from typing import Annotated, Any, Literal, Union, cast, get_args, get_origin

import msgspec
from msgspec import Meta

from gamms.errors import nearest
from gamms.scenario.documents import ScenarioError, joined
from gamms.text import shown

Metres = Annotated[float, Meta(ge=0.0, description="Map units; metres on maps of streets.")]
Count = Annotated[int, Meta(ge=0)]
NodeId = Annotated[int, Meta(description="The id of a node.")]
Xy = Annotated[tuple[float, float], Meta(description="[x, y] on the map; the nearest node is meant.")]
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
Travel = Literal["walk", "bike", "drive"]
Values = dict[str, Any]
Kind = object  # a type, or a form such as `int | None`


class _Mapping(
    msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True, rename={"with_": "with", "from_": "from"}
):
    """One mapping of the file."""


class LatLon(_Mapping, frozen=True, kw_only=True):
    """Degrees; the nearest node is meant."""

    lat: float
    lon: float


Place = NodeId | Xy | LatLon


class Code(_Mapping, frozen=True, kw_only=True):
    """A function with parameters."""

    function: Reference
    with_: Values = {}


class Plan(Code, frozen=True, kw_only=True):
    """A function that decides for all agents of a team, with parameters."""

    arrays: bool = False


class Grid(_Mapping, frozen=True, kw_only=True):
    """A grid of streets."""

    width: Annotated[int, Meta(ge=1, description="Nodes in each row.")]
    height: Annotated[int, Meta(ge=1, description="Rows.")]
    spacing: Annotated[float, Meta(gt=0.0, description="Metres between neighbours.")] = 10.0


class Helsinki(_Mapping, frozen=True, kw_only=True):
    """The map that comes with GAMMS."""

    buildings: bool = False
    resolution: float = 10.0
    bidirectional: bool = True


class MapFile(_Mapping, frozen=True, kw_only=True):
    """A map file in the folder of the scenario: OpenStreetMap, GeoJSON or .gamms."""

    path: Location
    osm_type: Travel | None = None
    resolution: float | None = None
    bidirectional: bool | None = None
    retain_all: bool | None = None
    tolerance: float | None = None
    simplify: bool | None = None
    buildings: bool = False


class MapPlace(_Mapping, frozen=True, kw_only=True):
    """Streets by the name of a place."""

    location: str | dict[str, str] | list[str | dict[str, str]]
    osm_type: Travel | None = None
    resolution: float | None = None
    simplify: bool | None = None
    retain_all: bool | None = None
    truncate_by_edge: bool | None = None
    custom_filter: str | list[str] | None = None
    tolerance: float | None = None
    bidirectional: bool | None = None
    offline: bool = False
    buildings: bool = False


class Map(_Mapping, frozen=True, kw_only=True):
    """Where the game is played: exactly one of these."""

    grid: Grid | None = None
    helsinki: Helsinki | None = None
    file: Location | MapFile | None = None
    place: Location | MapPlace | None = None
    generator: Reference | Code | None = None


class Sensor(_Mapping, frozen=True, kw_only=True):
    """What each agent that carries it gets one of: a built-in type, or a function."""

    type: str | None = None
    function: Reference | None = None
    with_: Values | None = None
    sensor_range: Metres | None = None
    fov: float | None = None
    orientation: tuple[float, float] | None = None
    observer_height: float | None = None
    quat: tuple[float, float, float, float] | None = None
    at: NodeId | Xy | None = None
    team: str | list[str] | None = None
    exclude: str | list[str] | None = None
    detection: float | list[tuple[float, float]] | None = None


class From(_Mapping, frozen=True, kw_only=True):
    """Away from every agent of an earlier team, as the crow flies."""

    team: Name
    at_least: Metres


class _Equipment(_Mapping, frozen=True, kw_only=True):
    """What a team says for all its agents, and an agent for itself."""

    type: Literal["basic", "aerial"] | None = None
    speed: Annotated[float, Meta(gt=0.0)] | None = None
    altitude: float | None = None
    sensors: list[Name] | None = None
    strategy: Reference | Code | None = None
    meta: Values = {}


class Agent(_Equipment, frozen=True, kw_only=True):
    """One agent; without a node it is placed as its team says."""

    name: Name
    node: Place | None = None


class Team(_Equipment, frozen=True, kw_only=True):
    """Agents that play together: listed, or so many of them placed by chance."""

    count: Count = 0
    agents: list[Agent] = []
    near: Place | None = None
    within: Metres | None = None
    apart: Metres = 0.0
    from_: From | list[From] = []
    plan: Reference | Plan | None = None


class Rule(_Mapping, frozen=True, kw_only=True):
    """A rule with parameters."""

    rule: Reference
    with_: Values = {}
    phase: Literal["after", "before"] = "after"
    name: Name | None = None


class ByPriority(_Mapping, frozen=True, kw_only=True):
    """The teams, the first to win first."""

    by_priority: Annotated[list[Name], Meta(min_length=1)]


class Conflicts(_Mapping, frozen=True, kw_only=True):
    """How many may end a turn on a node, and who wins; the parameters of `gamms.rules.Conflicts`."""

    capacity: Count | str | dict[str | int, Count] | None = 1
    among: Literal["all", "team"] = "all"
    allow_swaps: bool = True
    resolve: Reference | ByPriority = "at_random"


class Settings(_Mapping, frozen=True, kw_only=True):
    """Settings of the turn engine."""

    legal: Literal["edges", "any"] = "edges"
    on_illegal: Literal["stay", "raise"] = "stay"
    on_error: Literal["raise", "stay"] = "raise"
    speed_unit: Literal["edges", "metres"] = "edges"
    time_budget: Annotated[float, Meta(gt=0.0, description="Seconds per decision.")] | None = None
    deadline_s: Annotated[float, Meta(gt=0.0, description="Seconds per turn for what is awaited.")] | None = None
    default_action: Literal["stay"] | NodeId = "stay"


class Spec(_Mapping, frozen=True, kw_only=True):
    """A game, completely."""

    map: Map
    teams: Annotated[dict[Name, Team], Meta(min_length=1)]
    name: str = ""
    description: str = ""
    seed: int | None = None
    turns: Count | None = None
    sensors: dict[Name, Sensor] = {}
    rules: list[Reference | Rule] = []
    conflicts: Conflicts | None = None
    settings: Settings = Settings()
    facts: Values = {}
    data: Values = {}


def schema() -> dict[str, Any]:
    """Return the JSON Schema of a scenario file, for editors."""
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **msgspec.json.schema(Spec)}


def plain_of(spec: Spec) -> dict[str, Any]:
    """Return everything in a scenario, defaults included, as plain values."""
    plain: dict[str, Any] = msgspec.to_builtins(spec)
    return plain


def _is_mapping(kind: Kind) -> bool:
    """Whether a type is one of the mappings above."""
    return isinstance(kind, type) and issubclass(kind, msgspec.Struct)


def _fields_of(kind: Kind) -> dict[str, tuple[Kind, bool]]:
    """Return the type of each key, and whether the key must be there."""
    return {
        field.encode_name: (field.type, field.required)
        for field in msgspec.structs.fields(cast("type[msgspec.Struct]", kind))
    }


def given_values(part: _Mapping) -> dict[str, Any]:
    """Return the values in a mapping that are not None, by Python's names."""
    values = {name: getattr(part, name) for name in part.__struct_fields__}
    return {name: value for name, value in values.items() if value is not None}


# -- checks ----------------------------------------------------------------------------------------------------------


def checked(value: object, kind: Kind, path: str = "") -> Any:
    """Convert plain values to what a type describes.

    Raises:
        ScenarioError: they are not; it names the innermost place that is wrong.
    """
    try:
        return msgspec.convert(value, kind)
    except (ValueError, TypeError, RecursionError) as error:
        raise _explained(value, kind, path, error) from None


def unknown_key(path: str, key: object, value: object, known: Iterable[object]) -> ScenarioError:
    """Return the error of an unknown key."""
    names = [str(one) for one in known]
    hint = nearest(key, names) or (f" Keys here are: {', '.join(names)}." if names else "")
    return ScenarioError(joined(path, key), f"unknown key, with the value {shown(value)}.{hint}")


def _explained(value: object, kind: Kind, path: str, error: Exception) -> ScenarioError:
    for option in _options(kind):
        if _is_mapping(option) and isinstance(value, dict):
            known = _fields_of(option)
            for key in value:
                if key not in known:
                    return unknown_key(path, key, value[key], known)
            for key, (_, is_required) in known.items():
                if is_required and key not in value:
                    return ScenarioError(joined(path, key), f"is missing in {shown(value)}.")
        for key, inner, inner_kind in _parts(value, option):
            try:
                msgspec.convert(inner, inner_kind)
            except (ValueError, TypeError, RecursionError) as inner_error:
                return _explained(inner, inner_kind, joined(path, key), inner_error)
    return ScenarioError(path, f"cannot be {shown(value)}: {_in_words(value, kind, str(error))}")


def _parts(value: object, kind: Kind) -> list[tuple[object, object, Kind]]:
    """Return key, value and type of what a value is made of, as far as it may be of that type."""
    origin, args = get_origin(kind), get_args(kind)
    if isinstance(value, dict):
        if _is_mapping(kind):
            known = _fields_of(kind)
            return [(key, inner, known[key][0]) for key, inner in value.items() if key in known]
        return [(key, inner, args[1]) for key, inner in value.items()] if origin is dict else []
    if isinstance(value, list) and origin is list:
        return [(number, inner, args[0]) for number, inner in enumerate(value)]
    if isinstance(value, list) and origin is tuple and len(value) == len(args):
        return [(number, inner, one) for number, (inner, one) in enumerate(zip(value, args, strict=True))]
    return []


def _options(kind: Kind) -> list[Kind]:
    """Return the types of a union, without their notes."""
    if get_origin(kind) is Annotated:
        return _options(get_args(kind)[0])
    if get_origin(kind) in (Union, types.UnionType):
        return [one for option in get_args(kind) for one in _options(option)]
    return [kind]


def _in_words(value: object, kind: Kind, message: str) -> str:
    """Say what is possible instead."""
    choices = [choice for option in _options(kind) if get_origin(option) is Literal for choice in get_args(option)]
    if choices:
        return f"use one of {', '.join(map(str, choices))}.{nearest(value, choices)}"
    plain = message.replace("`", "").replace("null", "nothing").replace("object", "mapping").replace("array", "list")
    return f"{plain[:1].lower()}{plain[1:].split(' - at ')[0]}."
