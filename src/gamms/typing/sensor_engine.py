"""Contract of the sensor engine."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Hashable, Mapping, Sequence
from enum import Enum
from typing import Any, TypedDict, Unpack

import numpy as np

from gamms.arguments import as_ids, spell_out_options
from gamms.errors import BadType, BadValue, NotOffered
from gamms.ir.graph import FloatArray
from gamms.ir.sensor_results import Coverage, LookResults, SensorView
from gamms.text import shown


class SensorType(Enum):
    """Types of sensors; custom types are added at run time and exist until the process ends."""

    CUSTOM = 0
    NEIGHBOR = 1
    MAP = 2
    AGENT = 3
    RANGE = 4
    ARC = 5
    AGENT_RANGE = 6
    AGENT_ARC = 7
    AERIAL = 8
    AERIAL_AGENT = 9
    OCCLUDED_MAP = 10
    OCCLUDED_AGENT = 11
    OCCLUDED_AERIAL = 12
    OCCLUDED_AERIAL_AGENT = 13


def get_kind(name: str) -> SensorType:
    """Return `SensorType.<name>`, which is added to the enumeration if it is new.

    Raises:
        BadValue: the name is not an identifier, or is reserved by enums.
    """
    if name in SensorType.__members__:
        return SensorType[name]
    if not name.isidentifier() or hasattr(SensorType, name) or hasattr(SensorType.CUSTOM, name):
        raise BadValue(f"{shown(name)} cannot be the name of a kind of sensor; use another identifier.")
    member = object.__new__(SensorType)
    value = len(SensorType)
    tables = vars(SensorType)
    vars(member).update({"_name_": name, "_value_": value})
    type.__setattr__(SensorType, name, member)
    tables["_member_names_"].append(name)
    tables["_member_map_"][name] = member
    tables["_value2member_map_"][value] = member
    return member


ON_GROUND = frozenset((SensorType.AGENT, SensorType.AGENT_RANGE, SensorType.AGENT_ARC, SensorType.OCCLUDED_AGENT))
"""The built-in types that show other agents by their nodes."""

IN_AIR = frozenset((SensorType.AERIAL_AGENT, SensorType.OCCLUDED_AERIAL_AGENT))
"""The built-in types that show other agents by their 3D positions."""

FROM_AIR = frozenset((SensorType.AERIAL, SensorType.OCCLUDED_AERIAL))
"""The built-in types that show the ground from the air."""


SensorDeclaration = Mapping[str, object]
"""The kind of a sensor and its settings, `{"type": "AGENT_RANGE", "range_m": 60}`; see `gamms.sensor.agent_range`."""


class ISensor(ABC):
    """A sensor: it looks at the world from a node and stores the result.

    After `sense`, `data` is a fresh object: later calls do not change earlier results.
    """

    # -- to implement -------------------------------------------------------------------------------------------

    @property
    @abstractmethod
    def sensor_id(self) -> str:
        """The sensor's name."""

    @property
    @abstractmethod
    def type(self) -> SensorType:
        """The type of this sensor."""

    @property
    @abstractmethod
    def data(self) -> Any:
        """The result of the last look; empty before the first look."""

    @abstractmethod
    def sense(self, node_id: int) -> None:
        """Look at the world from a node and store the result in `data`.

        Raises:
            UnknownName (KeyError): the node does not exist.
        """

    @abstractmethod
    def update(self, data: dict[str, Any]) -> None:
        """Pass data that the sensor cannot collect itself; built-in sensors ignore it."""

    @abstractmethod
    def set_owner(self, owner: str | None) -> None:
        """Set the name of the agent that carries the sensor; None for no agent."""

    # -- to override --------------------------------------------------------------------------------------------

    sees_world_only: bool = False  # whether it reads only the graph and the agents
    looks_alike: Hashable = None  # equal for built-in sensors that share results; None: it looks by itself

    def sense_many(self, node_ids: Sequence[int] | np.ndarray[Any, Any]) -> LookResults:
        """Look from many nodes; each result equals the result of `sense` from that node.

        This default looks one by one: `values` are the `data` of each look, and `data` is that of the last look.

        Raises:
            UnknownName (KeyError): a node does not exist.
        """
        ids = as_ids(node_ids, "node_ids")
        values = np.empty(len(ids), object)
        for look, node_id in enumerate(ids):
            self.sense(node_id)
            values[look] = self.data
        return LookResults(np.arange(len(values) + 1), values)

    def reset(self) -> None:  # noqa: B027 - most sensors of a user's own have nothing to forget
        """Clear all data and draws, as for a new sensor; called when a game is reset."""

    def last_view(self) -> SensorView:
        """Return the view of the last look, for drawing; empty before the first look.

        Raises:
            NotOffered: this sensor cannot be drawn.
        """
        raise NotOffered(self, "last_view, so it cannot be drawn")

    def view_from(self, node_id: int | None, owner: str | None) -> SensorView:  # noqa: ARG002 - not every sensor can tell
        """Return the present view, for drawing; `data` and later looks are unchanged.

        This default returns the view of the last look.

        Args:
            node_id: node of the agent that carries it; None: the place of the last look.
            owner: name of this agent.

        Raises:
            NotOffered: this sensor cannot be drawn.
        """
        return self.last_view()

    def view_of(self, data: object, place: int | tuple[float, ...], owner: str | None) -> SensorView:  # noqa: ARG002 - as above
        """Return the view of a report, for drawing, without a look; `data` is unchanged.

        This default returns the view of the last look.

        Args:
            data: the `data` that an agent got; an empty dict: only the field of view is wanted.
            place: node or position of this agent.
            owner: name of this agent.

        Raises:
            NotOffered: this sensor cannot be drawn.
        """
        return self.last_view()

    def coverage(self, node_id: int | None = None, owner: str | None = None) -> Coverage:  # noqa: ARG002 - as above
        """Return the nodes on which it would show agents on the ground now; `data` and later looks are unchanged.

        Args:
            node_id: node to look from.
            owner: name of the agent that looks; None: its owner.

        Raises:
            NotOffered: this sensor has no coverage.
        """
        raise NotOffered(self, "coverage, so not seeing an agent gives no information")

    def live_result(self) -> Sequence[Any]:
        """Return a sequence whose first item is always the result of the last look (agents read it often).

        Built-in sensors return the list in which they store it.
        """
        return LiveData(self)


class LiveData(Sequence[Any]):
    """The `data` of any sensor, as a sequence of one item."""

    __slots__ = ("_sensor",)

    def __init__(self, sensor: ISensor) -> None:
        self._sensor = sensor

    def __getitem__(self, index: int | slice) -> Any:
        return (self._sensor.data,)[index]

    def __len__(self) -> int:
        return 1


# A sensor in the form in which an agent reads it: its name in the state, and its `live_result`; if a look only copies
# the neighborhood of the agent's node, its type and None, else None and the object to read, with `sense` and `type`.
Carried = tuple[str, Any, Any, Any]

_INTERFACE = ("sensor_id", "type", "data", "sense", "update", "set_owner")


def find_owner(sensor: ISensor) -> str | None:
    """Return the name of the agent that carries a sensor, if the sensor stores it under the name used in 1.0.0."""
    return getattr(sensor, "_owner", None)


def find_place_of_look(sensor: object, node_id: int, on_edge: tuple[float, float] | None) -> int | tuple[float, float]:
    """Return the place from which the sensor of an agent looks.

    Args:
        sensor: the sensor.
        node_id: the node of the agent, or the last node that it passed.
        on_edge: the position of the agent between nodes; None: it is at the node.
    """
    if on_edge is None or not getattr(sensor, "looks_from_points", False):
        return node_id
    return on_edge


def is_sensor(value: object) -> bool:
    """Return whether `value` can serve as a sensor: an `ISensor`, or any object with its attributes and methods."""
    return isinstance(value, ISensor) or not _find_missing(value)


def refuse_no_sensor(value: object) -> None:
    """Raise BadType with the missing names if `value` cannot serve as a sensor."""
    if not is_sensor(value):
        missing = ", ".join(_find_missing(value))
        raise BadType(f"A sensor is an object with {', '.join(_INTERFACE)}; {shown(value)} has no {missing}.")


def _find_missing(value: object) -> list[str]:
    # A class also has these names, but is not a sensor.
    return [name for name in _INTERFACE if isinstance(value, type) or not hasattr(value, name)]


class PlaceOptions(TypedDict, total=False):
    """The keywords of all kinds of sensor but NEIGHBOR.

    Attributes:
        at: a fixed place to look from: a node id or `(x, y)`, for the AERIAL kinds `(x, y, z)`. All kinds but NEIGHBOR.
            Default: None, from the agent.
    """

    at: int | np.integer[Any] | Sequence[float] | None


class DetectionOptions(PlaceOptions, total=False):
    """The keywords of the kinds that look for agents.

    Attributes:
        team: a team, or a list, tuple or set of teams: only their agents are sensed. The AGENT kinds. Default: None,
            agents of all teams.
        exclude: a team, or a list, tuple or set of teams, whose agents are not sensed. The AGENT kinds. Default: None.
        detection: the probability that an agent in view is sensed: a number, pairs `(distance, probability)`, or a
            function from distances (agents,) to probabilities (agents,). The AGENT kinds. Default: None, always.
        position_noise_m: the standard deviation of the Gaussian error of a reported place along each axis, in map
            units. The AGENT kinds. Default: None, no error.
        false_alarm_rate: the mean number of agents that a look reports without having noticed them. The AGENT kinds.
            Default: None, no false alarms.
        delay_turns: the age of a report in turns of `ctx.game`. The AGENT kinds. Default: None, no delay.
    """

    team: object
    exclude: object
    detection: float | Sequence[tuple[float, float]] | Callable[[FloatArray], FloatArray] | None
    position_noise_m: float | None
    false_alarm_rate: float | None
    delay_turns: int | None


class SensorOptions(DetectionOptions, total=False):
    """The keywords of `create_sensor`; `docs/sensors.md` has the default of each for each kind.

    Attributes:
        type: a synonym of `sensor_type`.
        range_m: the range in map units, in a straight line; may be infinite. Default: 30.0 for RANGE, ARC,
            AGENT_RANGE and AGENT_ARC, 100.0 for the AERIAL kinds, infinite for OCCLUDED_MAP and OCCLUDED_AGENT.
        sensor_range: the name of `range_m` in 1.0.0.
        fov: the full opening angle in radians; exactly 2 pi: all around. ARC, AGENT, AGENT_ARC, the OCCLUDED and AERIAL
            kinds. Default: 2 pi, but pi / 3 for AERIAL and OCCLUDED_AERIAL.
        orientation: the direction `(cos, sin)`, relative to the heading of the agent that carries the sensor. ARC,
            AGENT, AGENT_ARC, OCCLUDED_MAP, OCCLUDED_AGENT. Default: (1.0, 0.0), straight ahead.
        observer_height: the height of the eye above the ground, in map units. OCCLUDED_MAP, OCCLUDED_AGENT. Default:
            1.6.
        quat: the direction `(w, x, y, z)`, relative to the rotation of the agent. The AERIAL kinds. Default: straight
            down, but straight ahead for the kinds that look for agents.
    """

    type: SensorType
    range_m: float
    sensor_range: float
    fov: float
    orientation: tuple[float, float]
    observer_height: float
    quat: Sequence[float]


class ISensorEngine(ABC):
    """Creates sensors and stores them by name."""

    sensors: dict[str, ISensor]

    @abstractmethod
    @spell_out_options(PlaceOptions, DetectionOptions)
    def create_sensor(
        self, sensor_id: str, sensor_type: SensorType | str | None = None, **options: Unpack[SensorOptions]
    ) -> ISensor:
        """Create and store a built-in sensor.

        A keyword that the type of sensor does not use is ignored with a warning, once for each type.

        Args:
            sensor_id: a name that no other sensor has; agents carry the sensor by this name.
            sensor_type: the kind of sensor: a `SensorType`, or its name such as "AGENT_RANGE".
            options: see `SensorOptions`.

        Raises:
            UnknownType (ValueError): not a built-in type.
            Duplicate (ValueError): the name is taken.
            ContextTerminated: the context has ended.
        """

    @abstractmethod
    def from_function(self, sensor_id: str, fn: Callable[..., Any]) -> ISensor:
        """Create and store a sensor whose `data` is the result of a function.

        The function is called as `fn()`, `fn(node_id)` or `fn(node_id, agent)`, depending on its number of parameters;
        `agent` is the agent that carries the sensor, or None.

        Raises:
            BadType (TypeError): not such a function.
            Duplicate (ValueError): the name is taken.
            ContextTerminated: the context has ended.
        """

    def from_declaration(self, sensor_id: str, declaration: SensorDeclaration) -> ISensor:  # noqa: ARG002 - not every engine can
        """Create the sensor that a factory such as `gamms.sensor.agent_range` declares, and keep it.

        A sensor of that name that no agent carries any longer is replaced.

        Raises:
            UnknownType (ValueError): not a built-in kind.
            BadType (TypeError): it has no kind.
            Duplicate (ValueError): an agent carries a sensor of that name.
            NotOffered: this engine creates none.
        """
        raise NotOffered(self, "from_declaration")

    @abstractmethod
    def add_sensor(self, sensor: ISensor) -> None:
        """Store a sensor under its own name.

        Raises:
            Duplicate (ValueError): the name is taken.
        """

    def delete_sensor(self, sensor_id: str) -> None:  # noqa: ARG002 - not every engine can
        """Remove a sensor from its agents and from the engine; its name becomes free.

        Raises:
            UnknownName (KeyError): the sensor does not exist.
            NotOffered: this engine cannot remove sensors.
        """
        raise NotOffered(self, "delete_sensor")

    @abstractmethod
    def get_sensor(self, sensor_id: str) -> ISensor:
        """Return a sensor by name (KeyError)."""

    @abstractmethod
    def custom(self, name: str) -> Callable[[type], type]:
        """Return a decorator for the class of a custom type of sensor, `SensorType.<name>`."""

    @abstractmethod
    def terminate(self) -> None:
        """Close the engine; sensors stay readable."""
