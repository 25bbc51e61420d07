"""MAP, RANGE, ARC: the nodes and edges around."""

from math import pi
from typing import Any

import numpy as np

from gamms.arguments import as_range
from gamms.ir.sensed import SensorView
from gamms.sensor import looks
from gamms.sensor.sensor import Sensor
from gamms.sensor.views import Views
from gamms.typing import IContext
from gamms.typing.sensor_engine import SensorType


class MapSensor(Sensor):
    """`data`: fresh `{'nodes': {id: Node}, 'edges': [OSMEdge, …]}`, in insertion order.

    A node is seen if it is at most `range` away from where the sensor looks and inside its field of view, both rims
    included; the node it stands on always is. An edge is seen if both its ends are.

    Args:
        ctx: the context.
        sensor_id: the sensor's name.
        sensor_type: MAP, RANGE or ARC.
        sensor_range: map units; may be infinite.
        fov: full opening angle in radians; exactly 2 pi sees all around.
        orientation: `(cos, sin)` relative to the owner's heading; absolute without an owner.
        views: remembers what was seen; None remembers for this sensor alone.

    Raises:
        BadValue, BadType: a range or fov that is negative, NaN or no number.
    """

    def __init__(
        self,
        ctx: IContext,
        sensor_id: str,
        sensor_type: SensorType,
        sensor_range: float,
        fov: float = 2.0 * pi,
        orientation: tuple[float, float] = (1.0, 0.0),
        views: Views | None = None,
    ) -> None:
        super().__init__(ctx, sensor_id, sensor_type)
        self.range = as_range(sensor_range, f"sensor_range of {sensor_id!r}")
        self.fov = as_range(fov, f"fov of {sensor_id!r}")
        self.orientation = orientation
        self.data: dict[str, Any] = {}
        self._views = views or Views(ctx)
        self._looked: tuple[int, float, float, tuple[float, float]] | None = None  # whence, how far, how wide, whither

    def sense(self, node_id: int) -> None:
        """Look around."""
        heading = (0.0, 0.0) if self.fov == 2.0 * pi else self.heading(self.orientation)
        self.data = self._views.look(node_id, self.range, self.fov, heading)
        self._looked = (node_id, self.range, self.fov, heading)

    def last_view(self) -> SensorView:
        """The nodes and edges seen last, and the field of view from where they were seen."""
        if self._looked is None:
            return SensorView()
        node_id, radius, fov, heading = self._looked
        nodes = self.data["nodes"]
        here = nodes.get(node_id)  # whoever was handed the data may have emptied it
        lines, offsets = looks.polylines(self.data["edges"])
        return SensorView(
            nodes=np.array([(x, y) for _, x, y in nodes.values()], np.float64).reshape(-1, 2),
            lines=lines,
            offsets=offsets,
            outline=np.zeros((0, 2)) if here is None else looks.sector(here.x, here.y, radius, heading, fov),
        )
