"""AGENT, AGENT_RANGE, AGENT_ARC: who is around."""

from math import inf, pi

import numpy as np

from gamms import kernels
from gamms.arguments import as_range
from gamms.errors import UnknownName
from gamms.ir.sensed import SensorView
from gamms.sensor import looks
from gamms.sensor.crowd import Crowd
from gamms.sensor.sensor import Sensor
from gamms.typing import IContext
from gamms.typing.sensor_engine import SensorType


class AgentSensor(Sensor):
    """`data`: fresh `{agent name: id of its node}` of the other agents around, in the order of their creation.

    Without an owner, every agent counts as another. The geometry is that of `MapSensor`, applied to the nodes the
    agents stand on.

    Args:
        ctx: the context.
        sensor_id: the sensor's name.
        sensor_type: AGENT, AGENT_RANGE or AGENT_ARC.
        sensor_range: map units; may be infinite.
        fov: full opening angle in radians; exactly 2 pi sees all around.
        orientation: `(cos, sin)` relative to the owner's heading; absolute without an owner.
        owner: name of the agent that carries the sensor.
        crowd: where all agents are; None asks for this sensor alone.

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
        owner: str | None = None,
        crowd: Crowd | None = None,
    ) -> None:
        super().__init__(ctx, sensor_id, sensor_type)
        self.range = as_range(sensor_range, f"sensor_range of {sensor_id!r}")
        self.fov = as_range(fov, f"fov of {sensor_id!r}")
        self.orientation = orientation
        self.data: dict[str, int] = {}
        self._owner = owner
        self._crowd = crowd or Crowd(ctx)
        self._looked: tuple[float, float, float, float, tuple[float, float]] | None = None  # None: without bounds

    def sense(self, node_id: int) -> None:
        """Look around."""
        heading = (0.0, 0.0) if self.fov == 2.0 * pi else self.heading(self.orientation)
        sees_all = self.range == inf and heading == (0.0, 0.0)
        data = self._everyone(node_id) if sees_all else self._found(node_id, heading)
        if self._owner is not None:
            data.pop(self._owner, None)
        self.data = data

    def last_view(self) -> SensorView:
        """The agents seen last, at their nodes of then, and the field of view from where they were seen."""
        outline = np.zeros((0, 2))
        if self._looked is not None:
            x, y, radius, fov, heading = self._looked
            outline = looks.sector(x, y, radius, heading, fov)
        return SensorView(agents=self.places_of(self.data.values()), outline=outline)

    def _everyone(self, node_id: int) -> dict[str, int]:
        if not self.ctx.graph.graph.has_node(node_id):
            raise UnknownName("node", node_id)
        everyone = self._crowd.everyone()
        self._looked = None
        return everyone

    def _found(self, node_id: int, heading: tuple[float, float]) -> dict[str, int]:
        _, x, y = self.ctx.graph.graph.get_node(node_id)
        names, nodes, xs, ys = self._crowd.now()
        dx, dy = xs - x, ys - y
        with np.errstate(over="ignore"):  # infinitely far away is far away
            rows = np.flatnonzero(dx * dx + dy * dy <= self.range * self.range)
        if heading != (0.0, 0.0):
            rows = rows[kernels.in_cone(dx[rows], dy[rows], heading, self.fov)]
        self._looked = (x, y, self.range, self.fov, heading)
        return {names[row]: node for row, node in zip(rows.tolist(), nodes[rows].tolist(), strict=True)}
