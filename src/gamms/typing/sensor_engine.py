"""Contract of the sensor engine."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Hashable, Sequence
from enum import Enum
from typing import Any, TypedDict, Unpack

import numpy as np

from gamms.arguments import as_ids, with_options
from gamms.errors import BadType, BadValue, NotOffered
from gamms.ir.graph import FloatArray
from gamms.ir.sensed import Coverage, Sensed, SensorView
from gamms.text import shown


class SensorType(Enum):
    """Kinds of sensor; custom kinds are added while a program runs and live as long as its process."""

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


def kind_called(name: str) -> SensorType:
    """Return `SensorType.<name>`, which is added to the enumeration if it is new.

    Raises:
        BadValue: the name is no identifier, or means something else on an enum.
    """
    if name in SensorType.__members__:
        return SensorType[name]
    if not name.isidentifier() or hasattr(SensorType, name) or hasattr(SensorType.CUSTOM, name):
        raise BadValue(f"{shown(name)} cannot be the name of a kind of sensor; use another identifier.")
    member, value, tables = object.__new__(SensorType), len(SensorType), vars(SensorType)
    vars(member).update({"_name_": name, "_value_": value})
    type.__setattr__(SensorType, name, member)
    tables["_member_names_"].append(name)
    tables["_member_map_"][name] = tables["_value2member_map_"][value] = member
    return member


ON_GROUND = frozenset((SensorType.AGENT, SensorType.AGENT_RANGE, SensorType.AGENT_ARC, SensorType.OCCLUDED_AGENT))
"""The built-in types that show other agents by the nodes that they are on."""

IN_AIR = frozenset((SensorType.AERIAL_AGENT, SensorType.OCCLUDED_AERIAL_AGENT))
"""Those that show other agents by their places in space."""

FROM_AIR = frozenset((SensorType.AERIAL, SensorType.OCCLUDED_AERIAL))
"""Those that show the ground from the air."""


class ISensor(ABC):
    """Looks at the world from a node and keeps what it saw.

    `data` after `sense` is a fresh object: no later call changes an earlier result.
    """

    # -- must write ---------------------------------------------------------------------------------------------

    @property
    @abstractmethod
    def sensor_id(self) -> str:
        """The sensor's name."""

    @property
    @abstractmethod
    def type(self) -> SensorType:
        """What kind of sensor this is."""

    @property
    @abstractmethod
    def data(self) -> Any:
        """What was sensed last; empty before the first time."""

    @abstractmethod
    def sense(self, node_id: int) -> None:
        """Look at the world from a node and keep the result in `data`.

        Raises:
            UnknownName (KeyError): there is no such node.
        """

    @abstractmethod
    def update(self, data: dict[str, Any]) -> None:
        """Take in what the sensor cannot see by itself; built-in sensors ignore it."""

    @abstractmethod
    def set_owner(self, owner: str | None) -> None:
        """Name the agent that carries the sensor; None for no agent."""

    # -- may override -------------------------------------------------------------------------------------------

    sees_world_only: bool = False  # whether it looks at nothing but the graph and the agents
    looks_alike: Hashable = None  # equal for built-in ones that share what they know now; None: it looks by itself

    def sense_many(self, node_ids: Sequence[int] | np.ndarray[Any, Any]) -> Sensed:
        """Look from many nodes: exactly what `sense` would see from each of them.

        This default looks one by one: `values` are the `data` of each look, and `data` is that of the last.

        Raises:
            UnknownName (KeyError): there is no such node.
        """
        ids = as_ids(node_ids, "node_ids")
        values = np.empty(len(ids), object)
        for look, node_id in enumerate(ids):
            self.sense(node_id)
            values[look] = self.data
        return Sensed(np.arange(len(values) + 1), values)

    def reset(self) -> None:  # noqa: B027 - most sensors of a user's own have nothing to forget
        """Forget what was sensed and drawn, as if it had just been made; called when a game is reset."""

    def last_view(self) -> SensorView:
        """Return what was seen last, for drawing; empty before the first time.

        Raises:
            NotOffered: this sensor cannot be drawn.
        """
        raise NotOffered(self, "last_view, so it cannot be drawn")

    def view_from(self, node_id: int | None, owner: str | None) -> SensorView:  # noqa: ARG002 - not every sensor can tell
        """Return what it would see now, for drawing; neither `data` nor what it will see changes.

        This default returns what was seen last.

        Args:
            node_id: of the agent that carries it; None: from where it looked last.
            owner: that agent.

        Raises:
            NotOffered: this sensor cannot be drawn.
        """
        return self.last_view()

    def coverage(self, node_id: int | None = None, owner: str | None = None) -> Coverage:  # noqa: ARG002 - as above
        """Return on which nodes it would show agents on the ground now; neither `data` nor what it will see changes.

        Args:
            node_id: where it looks from.
            owner: the agent that looks; None: its owner.

        Raises:
            NotOffered: this sensor does not say so.
        """
        raise NotOffered(self, "coverage, so that not seeing an agent says nothing")

    def live_result(self) -> Sequence[Any]:
        """Return a sequence whose first item always is what was sensed last (used by agents, which read it often).

        Built-in sensors override this with the list in which they keep it.
        """
        return LiveData(self)


class LiveData(Sequence[Any]):
    """The `data` of a sensor of any class, as a sequence of one item."""

    __slots__ = ("_sensor",)

    def __init__(self, sensor: ISensor) -> None:
        self._sensor = sensor

    def __getitem__(self, index: int | slice) -> Any:
        return (self._sensor.data,)[index]

    def __len__(self) -> int:
        return 1


# A sensor as an agent asks it: its name in the state, and its `live_result`; where a look only copies the neighbourhood
# of the agent's node, its type and None, else None and what is asked, by `sense` and `type`.
Carried = tuple[str, Any, Any, Any]

_INTERFACE = ("sensor_id", "type", "data", "sense", "update", "set_owner")


def owner_of(sensor: ISensor) -> str | None:
    """Return the name of the agent that carries a sensor, where the sensor knows it under the name of 1.0.0."""
    return getattr(sensor, "_owner", None)


def is_sensor(value: object) -> bool:
    """Whether `value` can serve as a sensor: an `ISensor`, or any object with its attributes and methods."""
    return isinstance(value, ISensor) or not _missing(value)


def refuse_no_sensor(value: object) -> None:
    """Raise BadType, naming what is missing, if `value` cannot serve as a sensor."""
    if not is_sensor(value):
        missing = ", ".join(_missing(value))
        raise BadType(f"A sensor is an object with {', '.join(_INTERFACE)}; {shown(value)} has no {missing}.")


def _missing(value: object) -> list[str]:
    # A class has these names, too, and is no sensor yet.
    return [name for name in _INTERFACE if isinstance(value, type) or not hasattr(value, name)]


class SensorOptions(TypedDict, total=False):
    """The keywords of `create_sensor`; `docs/sensors.md` has the default of each for each kind.

    Attributes:
        type: a synonym of `sensor_type`.
        sensor_range: how far it senses, in map units in a straight line; may be infinite. Default: 30.0 for RANGE, ARC,
            AGENT_RANGE and AGENT_ARC, 100.0 for the AERIAL kinds, infinite for OCCLUDED_MAP and OCCLUDED_AGENT.
        fov: the full opening angle in radians; exactly 2 pi: all around. ARC, AGENT, AGENT_ARC, the OCCLUDED and AERIAL
            kinds. Default: 2 pi, but pi / 3 for AERIAL and OCCLUDED_AERIAL.
        orientation: the direction `(cos, sin)`, relative to the heading of the agent that carries the sensor. ARC,
            AGENT, AGENT_ARC, OCCLUDED_MAP, OCCLUDED_AGENT. Default: (1.0, 0.0), straight ahead.
        observer_height: the height of the eye above the ground, in map units. OCCLUDED_MAP, OCCLUDED_AGENT. Default:
            1.6.
        quat: the direction `(w, x, y, z)`, relative to how the agent is turned. The AERIAL kinds. Default: straight
            down, but straight ahead for the kinds that look for agents.
        at: a fixed place to look from: a node id or `(x, y)`, for the AERIAL kinds `(x, y, z)`. All kinds but NEIGHBOR.
            Default: None, from the agent.
        team: a team, or a list, tuple or set of teams: only their agents are sensed. The AGENT kinds. Default: None,
            agents of all teams.
        exclude: a team, or a list, tuple or set of teams, whose agents are not sensed. The AGENT kinds. Default: None.
        detection: the probability that an agent in view is sensed: a number, pairs `(distance, probability)`, or a
            function from distances (agents,) to probabilities (agents,). The AGENT kinds. Default: None, always.
        position_noise_m: the standard deviation of the Gaussian error of a reported place along each axis, in map
            units. The AGENT kinds. Default: None, no error.
        false_alarm_rate: the mean number of agents that a look reports without having noticed them. The AGENT kinds.
            Default: None, no false alarms.
        delay_turns: how many turns of `ctx.game` old a report is. The AGENT kinds. Default: None, not old.
    """

    type: SensorType
    sensor_range: float
    fov: float
    orientation: tuple[float, float]
    observer_height: float
    quat: Sequence[float]
    at: int | np.integer[Any] | Sequence[float] | None
    team: object
    exclude: object
    detection: float | Sequence[tuple[float, float]] | Callable[[FloatArray], FloatArray] | None
    position_noise_m: float | None
    false_alarm_rate: float | None
    delay_turns: int | None


class ISensorEngine(ABC):
    """Creates sensors and keeps them by name."""

    sensors: dict[str, ISensor]

    @abstractmethod
    @with_options()
    def create_sensor(
        self, sensor_id: str, sensor_type: SensorType | str | None = None, **options: Unpack[SensorOptions]
    ) -> ISensor:
        """Create a built-in sensor and keep it.

        A keyword that the kind of sensor does not take is ignored and warned about, once for each kind.

        Args:
            sensor_id: a name that no other sensor has; agents carry the sensor by this name.
            sensor_type: the kind of sensor: a `SensorType`, or its name such as "AGENT_RANGE".
            options: see `SensorOptions`.

        Raises:
            UnknownType (ValueError): not a built-in kind.
            Duplicate (ValueError): the name is taken.
            ContextTerminated: the context has ended.
        """

    @abstractmethod
    def from_function(self, sensor_id: str, fn: Callable[..., Any]) -> ISensor:
        """Create a sensor whose `data` is what a function returns, and keep it.

        The function is called as `fn()`, `fn(node_id)` or `fn(node_id, agent)`, by how many parameters it has; `agent`
        is the one that carries the sensor, or None.

        Raises:
            BadType (TypeError): it is no such function.
            Duplicate (ValueError): the name is taken.
            ContextTerminated: the context has ended.
        """

    @abstractmethod
    def add_sensor(self, sensor: ISensor) -> None:
        """Keep a sensor under its own name.

        Raises:
            Duplicate (ValueError): the name is taken.
        """

    def delete_sensor(self, sensor_id: str) -> None:  # noqa: ARG002 - not every engine can
        """Remove a sensor, which no agent carries any longer; its name is free then.

        Raises:
            UnknownName (KeyError): there is no such sensor.
            NotOffered: this engine removes none.
        """
        raise NotOffered(self, "delete_sensor")

    @abstractmethod
    def get_sensor(self, sensor_id: str) -> ISensor:
        """A sensor by name (KeyError)."""

    @abstractmethod
    def custom(self, name: str) -> Callable[[type], type]:
        """Decorator: the class senses a kind of its own, `SensorType.<name>`."""

    @abstractmethod
    def terminate(self) -> None:
        """Close the engine; sensors stay readable."""
