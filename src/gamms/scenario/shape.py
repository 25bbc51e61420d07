"""What a scenario file may say: its keys and their types, and the one door to msgspec.

`Spec` is the whole file. Every class is one mapping in it; a key that is not listed is an error.
"""

from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta

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
    """The JSON Schema of a scenario file, for editors."""
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **msgspec.json.schema(Spec)}


def converted(value: Any, kind: Any) -> Any:
    """Plain values as what a type describes.

    Raises:
        ValueError: they are not; the message is msgspec's.
    """
    return msgspec.convert(value, kind)


def plain_of(spec: Spec) -> dict[str, Any]:
    """Everything that a scenario says, defaults included, as plain values."""
    plain: dict[str, Any] = msgspec.to_builtins(spec)
    return plain


def is_mapping(kind: Any) -> bool:
    """Whether a type is one of the mappings above."""
    return isinstance(kind, type) and issubclass(kind, msgspec.Struct)


def fields_of(kind: Any) -> dict[str, tuple[Any, bool]]:
    """Key -> its type, and whether it must be there."""
    return {field.encode_name: (field.type, field.required) for field in msgspec.structs.fields(kind)}


def said(part: Any) -> dict[str, Any]:
    """What a mapping says, by Python's names: all that is not None."""
    values = {name: getattr(part, name) for name in part.__struct_fields__}
    return {name: value for name, value in values.items() if value is not None}
