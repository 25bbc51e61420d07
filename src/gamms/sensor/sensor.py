"""What every built-in sensor has: a name, a kind, an owner, the last result."""

from collections.abc import Iterable
from typing import Any

from gamms.ir.graph import FloatArray
from gamms.typing import IContext
from gamms.typing.sensor_engine import ISensor, SensorType


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

    def heading(self, orientation: tuple[float, float]) -> tuple[float, float]:
        """`orientation` of the sensor, turned by the heading of its owner; (0.0, 0.0) while that has none."""
        if self._owner is None:
            return orientation
        cos, sin = self.ctx.agent.get_agent(self._owner).orientation
        x, y = orientation
        return (x * cos - y * sin, x * sin + y * cos)

    def places_of(self, node_ids: Iterable[int]) -> FloatArray:
        """Where the nodes of a look are (nodes, 2); those that were removed since then are left out."""
        graph = self.ctx.graph.graph
        return graph.positions([id for id in node_ids if graph.has_node(id)])
