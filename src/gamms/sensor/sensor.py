"""What every built-in sensor has: a name, a kind, an owner, the last result, perhaps a fixed place."""

from collections.abc import Iterable
from copy import copy
from typing import Any, Self, cast

import numpy as np

from gamms.arguments import as_float, as_int
from gamms.errors import BadType, BadValue, UnknownName
from gamms.ir.graph import FloatArray
from gamms.ir.sensed import SensorView
from gamms.sensor import looks
from gamms.sensor.views import FULL_CIRCLE, Place, coordinates
from gamms.typing import IContext
from gamms.typing.sensor_engine import ISensor, SensorType

__all__ = ["ALL_AROUND", "FULL_CIRCLE", "GroundSensor", "Heading", "Sensor", "checked_place"]

Heading = tuple[float, float]  # (cos, sin); (0.0, 0.0) sees all around

ALL_AROUND: Heading = (0.0, 0.0)
_OURS = "gamms.sensor."


class Sensor(ISensor):
    """A built-in sensor; a subclass writes `sense`."""

    # NOTE: slots, not properties: the paper's loop reads them at every step (benchmarks/README.md, w2).
    __slots__ = ("_owner", "ctx", "data", "sensor_id", "type")

    type: SensorType
    data: Any
    sensor_id: str

    def __init__(self, ctx: IContext, sensor_id: str, sensor_type: SensorType) -> None:
        self.ctx = ctx
        self.sensor_id = sensor_id
        self.type = sensor_type
        self._owner: str | None = None

    def __repr__(self) -> str:
        """Name the sensor, its kind and its owner."""
        return f"{type(self).__name__}({self.sensor_id!r}, {self.type}, owner={self._owner!r})"

    def update(self, data: dict[str, Any]) -> None:
        """Ignore `data`: a built-in sensor sees for itself."""

    def set_owner(self, owner: str | None) -> None:
        """Name the agent that carries the sensor, or nobody."""
        self._owner = owner

    def reset(self) -> None:
        """Forget what was sensed."""
        self.data = [] if isinstance(self.data, list) else {}

    def view_from(self, node_id: int | None, owner: str | None) -> SensorView:
        """Return what it would see now, for drawing; a class of the user's own is not asked, but what it saw last."""
        if not type(self).__module__.startswith(_OURS):
            return self.last_view()
        twin = self._twin()
        twin._owner = owner
        try:
            twin.sense(node_id)  # type: ignore[arg-type] # those that look from the air need no node
        except UnknownName:  # a node is gone
            return SensorView()
        return twin.last_view()

    def _twin(self) -> Self:
        """A sensor that looks in its place."""
        return copy(self)

    def places_of(self, node_ids: Iterable[int]) -> FloatArray:
        """Where the nodes of a look are (nodes, 2); those that were removed since then are left out."""
        graph = self.ctx.graph.graph
        return graph.positions([id for id in node_ids if graph.has_node(id)])


class GroundSensor(Sensor):
    """Looks over the ground, from the node it is asked about or from a fixed place.

    Attributes:
        range: map units; may be infinite.
        fov: full opening angle in radians; exactly 2 pi sees all around.
        orientation: `(cos, sin)` relative to the owner's heading; absolute without an owner or at a fixed place.
        at: a node id or (x, y) to look from, whatever node is asked about; None looks from that node.
    """

    __slots__ = ("_at", "_looked", "fov", "orientation", "range")

    range: float
    fov: float
    orientation: Heading

    def __init__(self, ctx: IContext, sensor_id: str, sensor_type: SensorType) -> None:
        super().__init__(ctx, sensor_id, sensor_type)
        self._at: Place | None = None
        self._looked: tuple[Place, float, float, Heading] | None = None  # whence, how far, how wide, whither

    @property
    def at(self) -> Place | None:
        """The fixed place it looks from; settable."""
        return self._at

    @at.setter
    def at(self, at: Any) -> None:
        self._at = None if at is None else checked_place(self.ctx, at, f"at of {self.sensor_id!r}")

    def place(self, node_id: Any) -> Place:
        """Where it looks from when asked about a node."""
        if self._at is not None:
            return self._at
        if node_id is None:
            raise BadType(f"Sensor {self.sensor_id!r} has no place of its own: sense(node_id), or give it at=.")
        return node_id  # type: ignore[no-any-return] # the graph checks it

    def heading(self) -> Heading:
        """Whither it looks, turned by the heading of its owner; (0.0, 0.0) while that has none."""
        if self._owner is None or self._at is not None:
            return self.orientation
        cos, sin = self.ctx.agent.get_agent(self._owner).orientation
        x, y = self.orientation
        return (x * cos - y * sin, x * sin + y * cos)

    def reset(self) -> None:
        """Forget what was sensed."""
        super().reset()
        self._looked = None

    def set_owner(self, owner: str | None) -> None:
        """Name the agent that carries the sensor, or nobody: then it has no place where it looked last."""
        self._owner = owner
        if owner is None:
            self._looked = None

    def view_from(self, node_id: int | None, owner: str | None) -> SensorView:
        """Return what it would see now, for drawing."""
        if node_id is None and self._at is None:
            if self._looked is None:
                return SensorView()
            node_id = cast("int", self._looked[0])
        return super().view_from(node_id, owner)

    def outline(self) -> FloatArray:
        """Corners (corners, 2) of the field of view of the last look; none where it had no end."""
        if self._looked is None:
            return np.zeros((0, 2))
        place, radius, fov, heading = self._looked
        try:
            x, y = self._where(place)
        except UnknownName:  # its node is gone
            return np.zeros((0, 2))
        return self._area(x, y, radius, heading, fov)

    def _area(self, x: float, y: float, radius: float, heading: Heading, fov: float) -> FloatArray:
        """Corners of what it covers from a place."""
        return looks.sector(x, y, radius, heading, fov)

    def _where(self, place: Place) -> tuple[float, float]:
        return coordinates(self.ctx, place)


def checked_place(ctx: IContext, at: Any, name: str) -> Place:
    """A node id or (x, y) from what a caller passed.

    Raises:
        UnknownName (KeyError): there is no such node.
        BadType, BadValue: neither an integer nor a pair of finite numbers.
    """
    if isinstance(at, str) or not hasattr(at, "__len__"):
        node = as_int(at, name)
        ctx.graph.graph.get_node(node)
        return node
    if len(at) != 2:
        raise BadValue(f"{name} must be the id of a node or a pair (x, y), not {at!r}.")
    return as_float(at[0], name), as_float(at[1], name)
