"""The kinds of sensors: a table that says how each is made from keywords, and the factories that declare them.

Every agent that is given a declaration gets a sensor of its own.
"""

from collections.abc import Callable, Mapping
from math import inf, pi
from typing import Any, NamedTuple, Unpack

from gamms.arguments import as_range, find_signature, spell_out_options
from gamms.errors import BadType, BadValue, nearest
from gamms.plain import is_same, select_plain
from gamms.sensor.air import (
    AHEAD,
    DOWN,
    AerialAgentSensor,
    AerialSensor,
    OccludedAerialAgentSensor,
    OccludedAerialSensor,
)
from gamms.sensor.ground import (
    AgentSensor,
    GroundSensor,
    MapSensor,
    NeighborSensor,
    OccludedAgentSensor,
    OccludedMapSensor,
)
from gamms.sensor.sensor import ATTRIBUTES_OF, Sensor
from gamms.typing import IContext
from gamms.typing.sensor_engine import (
    DetectionOptions,
    ISensor,
    PlaceOptions,
    SensorDeclaration,
    SensorType,
    get_kind,
)

FORWARD = (1.0, 0.0)


class SensorKind(NamedTuple):
    """The description of one type of sensor: its class, and the keywords that it takes."""

    make: Callable[..., Sensor]
    keywords: dict[str, Any]  # of its constructor, with their defaults
    settings: tuple[str, ...] = ()  # attributes that may be given as keywords, too: `name` or `part.name`
    takes_type: bool = True  # whether its constructor takes the type

    def create(self, ctx: IContext, sensor_id: str, type: SensorType, given: dict[str, Any]) -> Sensor:
        """Create a sensor with the keywords that this kind takes; the others are ignored.

        Raises:
            BadValue: both `range_m` and `sensor_range` are given.
        """
        if "range_m" in given:
            if "sensor_range" in given:
                raise BadValue("range_m= and its old name sensor_range= are both given. Give range_m= only.")
            given = {**given, "sensor_range": given["range_m"]}
        keywords = {**self.keywords, **{key: value for key, value in given.items() if key in self.keywords}}
        sensor = self.make(ctx, sensor_id, *((type,) if self.takes_type else ()), **keywords)
        for setting in self.settings if given else ():
            part, _, name = setting.rpartition(".")
            if name in given:
                setattr(getattr(sensor, part) if part else sensor, name, given[name])
        return sensor

    def is_of(self, sensor: object) -> bool:
        """Whether a sensor of this type is a built-in one, and not of a class of the caller's."""
        wanted = [ATTRIBUTES_OF.get(name, name) for name in self.keywords]
        wanted += [setting.partition(".")[0] for setting in self.settings]
        return isinstance(sensor, Sensor) and all(
            hasattr(type(sensor), name) or hasattr(sensor, name) for name in wanted
        )

    def list_keywords(self, sensor: ISensor) -> dict[str, Any]:
        """Return keywords that create an equal sensor."""
        given = {name: getattr(sensor, ATTRIBUTES_OF.get(name, name)) for name in self.keywords}
        for setting in self.settings:
            part, _, name = setting.rpartition(".")
            # NOTE: without making the part where nothing in it is set (benchmarks: peers).
            owner = getattr(sensor, f"_{part}") if part else sensor
            value = None if owner is None else getattr(owner, name)
            if value is not None:
                given[name] = value
        return given

    def apply(self, sensor: ISensor, keywords: dict[str, Any]) -> None:
        """Set a sensor to keywords that `list_keywords` returned."""
        for name in self.keywords:
            setattr(sensor, ATTRIBUTES_OF.get(name, name), keywords[name])
        for setting in self.settings:
            part, _, name = setting.rpartition(".")
            owner = getattr(sensor, part) if part else sensor
            value = keywords.get(name)
            if isinstance(owner, GroundSensor) and type(value) is int and not owner.ctx.graph.graph.has_node(value):
                owner._at = value  # a node that was removed since, which the sensor says when it looks
            elif getattr(owner, name) is not value:
                setattr(owner, name, value)

    def change(self, sensor: ISensor, keywords: Mapping[str, Any]) -> None:
        """Set a sensor to the plain values among keywords that `list_keywords` returned; other settings stay."""
        now = self.list_keywords(sensor)
        plain = select_plain(now)
        if not is_same(plain, dict(keywords)):
            kept = {name: value for name, value in now.items() if name in self.keywords or name not in plain}
            self.apply(sensor, kept | dict(keywords))

    def list_names(self) -> set[str]:
        """Return all keywords that this kind takes."""
        range_m = ["range_m"] if "sensor_range" in self.keywords else []
        return {*self.keywords, *range_m, *(setting.rpartition(".")[2] for setting in self.settings)}


_PLACE = ("at",)
_DETECTION = (*_PLACE, *(path for path in ATTRIBUTES_OF.values() if path.startswith("notice.")))

_RANGE = {"sensor_range": 30.0}
_FIELD = {"fov": 2.0 * pi, "orientation": FORWARD}
_FAR = {"sensor_range": inf}
_PAST = {"observer_height": 1.6}
_CONE = {"sensor_range": 100.0, "fov": pi / 3.0, "quat": DOWN}
_SPHERE = {"sensor_range": 100.0, "fov": 2.0 * pi, "quat": AHEAD}


def derived(nearest: type[Sensor], read: Callable[..., Any]) -> type[Sensor]:
    """Return a class of sensors whose `data` is a function of the data of a sensor of the nearest kind.

    The sensors have the settings of that kind and are drawn like it.

    Args:
        nearest: the class of that kind.
        read: called with the `data` of the nearest kind, which it must not change; one with a parameter `place` also
            gets the place of the look: the id of a node, (x, y) on an edge, (x, y, z) in the air, None before a look.
    """
    data: property = vars(Sensor)["data"]

    def read_at_place(sensor: Sensor) -> Any:
        return read(sensor._get_view_data(), place=sensor._get_place_of_look())

    read_data = read_at_place if _is_placed(read) else lambda sensor: read(sensor._get_view_data())
    members: dict[str, Any] = {
        "__slots__": (),
        "data": property(read_data, data.fset, doc=read.__doc__),
        "_get_view_data": data.fget,
        "looks_alike": None,
        "shows_alike": None,
        "in_arrays": lambda _: None,
        **{name: vars(ISensor)[name] for name in ("coverage", "live_result", "sense_many")},
    }
    return type(f"{nearest.__name__}Reading", (nearest,), members)


def _is_placed(read: Callable[..., Any]) -> bool:
    try:
        return "place" in find_signature(read).parameters
    except (TypeError, ValueError):  # some builtins have no signature
        return False


def _remove_range(make: Callable[..., Sensor]) -> Callable[..., Sensor]:
    """MAP and AGENT have no range, whatever a caller gives them."""
    return lambda *args, **given: make(*args, sensor_range=inf, **given)


_BY_NAME = {
    "NEIGHBOR": SensorKind(NeighborSensor, {}),
    "MAP": SensorKind(_remove_range(MapSensor), {}, _PLACE),
    "RANGE": SensorKind(MapSensor, _RANGE, _PLACE),
    "ARC": SensorKind(MapSensor, _RANGE | _FIELD, _PLACE),
    "AGENT": SensorKind(_remove_range(AgentSensor), _FIELD, _DETECTION),
    "AGENT_RANGE": SensorKind(AgentSensor, _RANGE, _DETECTION),
    "AGENT_ARC": SensorKind(AgentSensor, _RANGE | _FIELD, _DETECTION),
    "AERIAL": SensorKind(AerialSensor, _CONE, _PLACE, takes_type=False),
    "AERIAL_AGENT": SensorKind(AerialAgentSensor, _SPHERE, _DETECTION, takes_type=False),
    "OCCLUDED_MAP": SensorKind(OccludedMapSensor, _FAR | _FIELD | _PAST, _PLACE),
    "OCCLUDED_AGENT": SensorKind(OccludedAgentSensor, _FAR | _FIELD | _PAST, _DETECTION),
    "OCCLUDED_AERIAL": SensorKind(OccludedAerialSensor, _CONE, _PLACE, takes_type=False),
    "OCCLUDED_AERIAL_AGENT": SensorKind(OccludedAerialAgentSensor, _SPHERE, _DETECTION, takes_type=False),
}
KINDS: dict[SensorType, SensorKind] = {get_kind(name): kind for name, kind in _BY_NAME.items()}

# Programs for 1.0.0 pass these to every kind; those that do not know them ignore them.
SHARED_KEYWORDS = {"type", "sensor_range", "fov", "quat", "orientation", "observer_height"}
SYNONYMS = {  # what callers write for a keyword, where the spelling does not tell
    **dict.fromkeys(("range", "radius", "distance", "max_range", "sensing_range"), "range_m"),
    **dict.fromkeys(("angle", "field_of_view", "opening_angle"), "fov"),
    **dict.fromkeys(("heading", "direction"), "orientation"),
    **dict.fromkeys(("height", "eye_height"), "observer_height"),
    **dict.fromkeys(("position", "node", "node_id", "place"), "at"),
    **dict.fromkeys(("teams", "whom"), "team"),
    **dict.fromkeys(("noise", "sigma", "position_noise", "standard_deviation"), "position_noise_m"),
    **dict.fromkeys(("false_alarms", "clutter", "clutter_rate", "false_positive_rate"), "false_alarm_rate"),
    **dict.fromkeys(("delay", "latency"), "delay_turns"),
}


# -- factories ----------------------------------------------------------------------------------------------------

Direction = tuple[float, float]
Quaternion = tuple[float, float, float, float]


def _make_declaration(kind: str, options: dict[str, Any], **settings: object) -> SensorDeclaration:
    """Return the declaration of a sensor without its defaults; its options are checked against its kind."""
    row = KINDS[get_kind(kind)]
    known = row.list_names() - {"sensor_range"}
    for name in options:
        if name not in known:
            hint = nearest(SYNONYMS.get(name, name), known) or f" It takes: {', '.join(sorted(known))}."
            raise BadType(f"gamms.sensor.{kind.lower()}() takes no {name}=.{hint}")
    for name in ("range_m", "fov"):
        if settings.get(name) is not None:
            as_range(settings[name], f"{name} of gamms.sensor.{kind.lower()}()")
    defaults = {"range_m": row.keywords.get("sensor_range"), **row.keywords}
    own = {name: value for name, value in settings.items() if value != defaults[name]}
    return {"type": kind, **own, **options}


def from_function(fn: Callable[..., Any]) -> SensorDeclaration:
    """Declare a sensor whose data is the result of a function: `fn()`, `fn(node_id)` or `fn(node_id, agent)`."""
    return {"function": fn}


def neighbor() -> SensorDeclaration:
    """Declare a sensor for the node of the agent and its neighbors: `[node, neighbor, …]`."""
    return _make_declaration("NEIGHBOR", {})


@spell_out_options()
def map(**options: Unpack[PlaceOptions]) -> SensorDeclaration:
    """Declare a sensor for the whole graph: `{"nodes": {id: Node}, "edges": [OSMEdge, …]}`.

    Args:
        options: see `PlaceOptions`.
    """
    return _make_declaration("MAP", {**options})


@spell_out_options()
def range(range_m: float = 30.0, **options: Unpack[PlaceOptions]) -> SensorDeclaration:
    """Declare a sensor for the graph within a distance, like `map`.

    Args:
        range_m: the range in map units, in a straight line.
        options: see `PlaceOptions`.
    """
    return _make_declaration("RANGE", {**options}, range_m=range_m)


@spell_out_options()
def arc(
    range_m: float = 30.0, fov: float = 2.0 * pi, orientation: Direction = (1.0, 0.0), **options: Unpack[PlaceOptions]
) -> SensorDeclaration:
    """Declare a sensor for the graph within a distance and a field of view, like `map`.

    Args:
        range_m: the range in map units, in a straight line.
        fov: the full opening angle in radians.
        orientation: the direction `(cos, sin)`, relative to the heading of the agent.
        options: see `PlaceOptions`.
    """
    return _make_declaration("ARC", {**options}, range_m=range_m, fov=fov, orientation=orientation)


@spell_out_options(PlaceOptions)
def agent(
    fov: float = 2.0 * pi, orientation: Direction = (1.0, 0.0), **options: Unpack[DetectionOptions]
) -> SensorDeclaration:
    """Declare a sensor for other agents at any distance: `{name: node}`.

    Args:
        fov: the full opening angle in radians.
        orientation: the direction `(cos, sin)`, relative to the heading of the agent.
        options: see `DetectionOptions`.
    """
    return _make_declaration("AGENT", {**options}, fov=fov, orientation=orientation)


@spell_out_options(PlaceOptions)
def agent_range(range_m: float = 30.0, **options: Unpack[DetectionOptions]) -> SensorDeclaration:
    """Declare a sensor for other agents within a distance: `{name: node}`.

    Args:
        range_m: the range in map units, in a straight line.
        options: see `DetectionOptions`.
    """
    return _make_declaration("AGENT_RANGE", {**options}, range_m=range_m)


@spell_out_options(PlaceOptions)
def agent_arc(
    range_m: float = 30.0,
    fov: float = 2.0 * pi,
    orientation: Direction = (1.0, 0.0),
    **options: Unpack[DetectionOptions],
) -> SensorDeclaration:
    """Declare a sensor for other agents within a distance and a field of view: `{name: node}`.

    Args:
        range_m: the range in map units, in a straight line.
        fov: the full opening angle in radians.
        orientation: the direction `(cos, sin)`, relative to the heading of the agent.
        options: see `DetectionOptions`.
    """
    return _make_declaration("AGENT_ARC", {**options}, range_m=range_m, fov=fov, orientation=orientation)


@spell_out_options()
def occluded_map(
    range_m: float = inf,
    fov: float = 2.0 * pi,
    orientation: Direction = (1.0, 0.0),
    observer_height: float = 1.6,
    **options: Unpack[PlaceOptions],
) -> SensorDeclaration:
    """Declare a sensor for the graph that obstacles do not hide, like `map`.

    Args:
        range_m: the range in map units, in a straight line.
        fov: the full opening angle in radians.
        orientation: the direction `(cos, sin)`, relative to the heading of the agent.
        observer_height: the height of the eye above the ground, in map units.
        options: see `PlaceOptions`.
    """
    settings = {"range_m": range_m, "fov": fov, "orientation": orientation, "observer_height": observer_height}
    return _make_declaration("OCCLUDED_MAP", {**options}, **settings)


@spell_out_options(PlaceOptions)
def occluded_agent(
    range_m: float = inf,
    fov: float = 2.0 * pi,
    orientation: Direction = (1.0, 0.0),
    observer_height: float = 1.6,
    **options: Unpack[DetectionOptions],
) -> SensorDeclaration:
    """Declare a sensor for other agents that obstacles do not hide: `{name: node}`.

    Args:
        range_m: the range in map units, in a straight line.
        fov: the full opening angle in radians.
        orientation: the direction `(cos, sin)`, relative to the heading of the agent.
        observer_height: the height of the eye above the ground, in map units.
        options: see `DetectionOptions`.
    """
    settings = {"range_m": range_m, "fov": fov, "orientation": orientation, "observer_height": observer_height}
    return _make_declaration("OCCLUDED_AGENT", {**options}, **settings)


@spell_out_options()
def aerial(
    range_m: float = 100.0, fov: float = pi / 3.0, quat: Quaternion = DOWN, **options: Unpack[PlaceOptions]
) -> SensorDeclaration:
    """Declare a sensor of a flying agent for the ground, like `map`.

    Args:
        range_m: the range in map units, in a straight line.
        fov: the full opening angle in radians.
        quat: the direction `(w, x, y, z)`, relative to the rotation of the agent; straight down by default.
        options: see `PlaceOptions`.
    """
    return _make_declaration("AERIAL", {**options}, range_m=range_m, fov=fov, quat=quat)


@spell_out_options(PlaceOptions)
def aerial_agent(
    range_m: float = 100.0, fov: float = 2.0 * pi, quat: Quaternion = AHEAD, **options: Unpack[DetectionOptions]
) -> SensorDeclaration:
    """Declare a sensor of a flying agent for other agents: `{name: (AgentType, (x, y, z))}`.

    Args:
        range_m: the range in map units, in a straight line.
        fov: the full opening angle in radians.
        quat: the direction `(w, x, y, z)`, relative to the rotation of the agent; straight ahead by default.
        options: see `DetectionOptions`.
    """
    return _make_declaration("AERIAL_AGENT", {**options}, range_m=range_m, fov=fov, quat=quat)


@spell_out_options()
def occluded_aerial(
    range_m: float = 100.0, fov: float = pi / 3.0, quat: Quaternion = DOWN, **options: Unpack[PlaceOptions]
) -> SensorDeclaration:
    """Declare a sensor of a flying agent for the ground that obstacles do not hide, like `map`.

    Args:
        range_m: the range in map units, in a straight line.
        fov: the full opening angle in radians.
        quat: the direction `(w, x, y, z)`, relative to the rotation of the agent; straight down by default.
        options: see `PlaceOptions`.
    """
    return _make_declaration("OCCLUDED_AERIAL", {**options}, range_m=range_m, fov=fov, quat=quat)


@spell_out_options(PlaceOptions)
def occluded_aerial_agent(
    range_m: float = 100.0, fov: float = 2.0 * pi, quat: Quaternion = AHEAD, **options: Unpack[DetectionOptions]
) -> SensorDeclaration:
    """Declare a sensor of a flying agent for other agents that obstacles do not hide: `{name: (AgentType, (x, y, z))}`.

    Args:
        range_m: the range in map units, in a straight line.
        fov: the full opening angle in radians.
        quat: the direction `(w, x, y, z)`, relative to the rotation of the agent; straight ahead by default.
        options: see `DetectionOptions`.
    """
    return _make_declaration("OCCLUDED_AERIAL_AGENT", {**options}, range_m=range_m, fov=fov, quat=quat)
