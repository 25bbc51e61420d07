"""Which kinds of sensor there are, and how each is made from the caller's keywords: a table, not a ladder."""

from collections.abc import Callable
from math import inf, pi
from typing import Any, NamedTuple

from gamms.sensor.aerial import (
    AHEAD,
    DOWN,
    AerialAgentSensor,
    AerialSensor,
    OccludedAerialAgentSensor,
    OccludedAerialSensor,
)
from gamms.sensor.agents import AgentSensor, OccludedAgentSensor
from gamms.sensor.map import MapSensor, OccludedMapSensor
from gamms.sensor.neighbor import NeighborSensor
from gamms.sensor.sensor import Sensor
from gamms.typing import IContext
from gamms.typing.sensor_engine import SensorType

FORWARD = (1.0, 0.0)


class Kind(NamedTuple):
    """How to make a sensor of one type."""

    make: Callable[..., Sensor]
    keywords: dict[str, Any]  # those of its constructor that it honours, with their defaults
    settings: tuple[str, ...] = ()  # attributes that may be given as keywords, too: `name` or `part.name`
    tells_type: bool = True  # whether its constructor takes the type

    def create(self, ctx: IContext, sensor_id: str, type: SensorType, given: dict[str, Any]) -> Sensor:
        """A sensor with the keywords that this kind honours; it ignores the others."""
        keywords = {**self.keywords, **{key: value for key, value in given.items() if key in self.keywords}}
        who = (ctx, sensor_id, type) if self.tells_type else (ctx, sensor_id)
        sensor = self.make(*who, **keywords)
        for setting in self.settings if given else ():
            part, _, name = setting.rpartition(".")
            if name in given:
                setattr(getattr(sensor, part) if part else sensor, name, given[name])
        return sensor

    def is_of(self, sensor: object) -> bool:
        """Whether a sensor of this type is one of ours: a program's own has what its class says."""
        wanted = [_ATTRIBUTES.get(name, name) for name in self.keywords]
        wanted += [setting.partition(".")[0] for setting in self.settings]
        return isinstance(sensor, Sensor) and all(hasattr(sensor, name) for name in wanted)

    def keywords_of(self, sensor: Any) -> dict[str, Any]:
        """The keywords that make such a sensor again."""
        given = {name: getattr(sensor, _ATTRIBUTES.get(name, name)) for name in self.keywords}
        for setting in self.settings:
            part, _, name = setting.rpartition(".")
            value = getattr(getattr(sensor, part) if part else sensor, name)
            if value is not None:
                given[name] = value
        return given

    def apply(self, sensor: Any, keywords: dict[str, Any]) -> None:
        """Set a sensor as `keywords_of` said."""
        for name in self.keywords:
            setattr(sensor, _ATTRIBUTES.get(name, name), keywords[name])
        for setting in self.settings:
            part, _, name = setting.rpartition(".")
            owner = getattr(sensor, part) if part else sensor
            if getattr(owner, name) is not keywords.get(name):
                setattr(owner, name, keywords.get(name))

    def names(self) -> set[str]:
        """All keywords it honours."""
        return {*self.keywords, *(setting.rpartition(".")[2] for setting in self.settings)}


_ATTRIBUTES = {"sensor_range": "range"}  # keyword -> attribute, where they differ

_PLACE = ("at",)
_WHOM = ("at", "notice.team", "notice.exclude", "notice.detection")

_RANGE = {"sensor_range": 30.0}
_FIELD = {"fov": 2.0 * pi, "orientation": FORWARD}
_FAR = {"sensor_range": inf}
_PAST = {"observer_height": 1.6}
_CONE = {"sensor_range": 100.0, "fov": pi / 3.0, "quat": DOWN}
_SPHERE = {"sensor_range": 100.0, "fov": 2.0 * pi, "quat": AHEAD}


def _unlimited(make: Callable[..., Sensor]) -> Callable[..., Sensor]:
    """MAP and AGENT have no range, whatever a caller gives them."""
    return lambda *who, **given: make(*who, sensor_range=inf, **given)


KINDS: dict[SensorType, Kind] = {
    SensorType.NEIGHBOR: Kind(NeighborSensor, {}),
    SensorType.MAP: Kind(_unlimited(MapSensor), {}, _PLACE),
    SensorType.RANGE: Kind(MapSensor, _RANGE, _PLACE),
    SensorType.ARC: Kind(MapSensor, _RANGE | _FIELD, _PLACE),
    SensorType.AGENT: Kind(_unlimited(AgentSensor), _FIELD, _WHOM),
    SensorType.AGENT_RANGE: Kind(AgentSensor, _RANGE, _WHOM),
    SensorType.AGENT_ARC: Kind(AgentSensor, _RANGE | _FIELD, _WHOM),
    SensorType.AERIAL: Kind(AerialSensor, _CONE, _PLACE, tells_type=False),
    SensorType.AERIAL_AGENT: Kind(AerialAgentSensor, _SPHERE, _WHOM, tells_type=False),
    SensorType.OCCLUDED_MAP: Kind(OccludedMapSensor, _FAR | _FIELD | _PAST, _PLACE),
    SensorType.OCCLUDED_AGENT: Kind(OccludedAgentSensor, _FAR | _FIELD | _PAST, _WHOM),
    SensorType.OCCLUDED_AERIAL: Kind(OccludedAerialSensor, _CONE, _PLACE, tells_type=False),
    SensorType.OCCLUDED_AERIAL_AGENT: Kind(OccludedAerialAgentSensor, _SPHERE, _WHOM, tells_type=False),
}

# Programs for 1.0.0 pass these to every kind; those that do not know them ignore them.
SHARED_KEYWORDS = {"type", "sensor_range", "fov", "quat", "orientation", "observer_height"}
SYNONYMS = {  # what callers write for a keyword, where the spelling does not tell
    **dict.fromkeys(("range", "radius", "distance", "range_m", "max_range"), "sensor_range"),
    **dict.fromkeys(("angle", "field_of_view", "opening_angle"), "fov"),
    **dict.fromkeys(("heading", "direction"), "orientation"),
    **dict.fromkeys(("height", "eye_height"), "observer_height"),
    **dict.fromkeys(("position", "node", "node_id", "place"), "at"),
    **dict.fromkeys(("teams", "whom"), "team"),
}
