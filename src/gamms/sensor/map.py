"""MAP, RANGE, ARC, OCCLUDED_MAP: the nodes and edges around."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from gamms.arguments import as_ids, as_range
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.sensed import Sensed, SensorView
from gamms.sensor import looks
from gamms.sensor.memory import memory_of
from gamms.sensor.sensor import ALL_AROUND, FULL_CIRCLE, GroundSensor, Heading, of_data
from gamms.sensor.views import Place
from gamms.typing import IContext
from gamms.typing.graph_engine import Surroundings
from gamms.typing.sensor_engine import SensorType


class MapSensor(GroundSensor):
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

    Raises:
        BadValue, BadType: a range or fov that is negative, NaN or no number.
    """

    __slots__ = ("_memory",)

    def __init__(
        self,
        ctx: IContext,
        sensor_id: str,
        sensor_type: SensorType,
        sensor_range: float,
        fov: float = FULL_CIRCLE,
        orientation: tuple[float, float] = (1.0, 0.0),
    ) -> None:
        super().__init__(ctx, sensor_id, sensor_type)
        self.range = as_range(sensor_range, f"sensor_range of {sensor_id!r}")
        self.fov = fov
        self.orientation = orientation
        self._last[0] = {}
        self._memory = memory_of(ctx)

    def sense(self, node_id: int | None = None) -> None:
        """Look around."""
        if self._phase.agent is not None:
            self._phase.refuse("call sensor.sense")
        place = self.place(node_id) if node_id is None or self._at is not None else node_id
        heading = ALL_AROUND if self.fov == FULL_CIRCLE else self.heading()
        nodes, edges = self._look(place, heading)
        self._last[:] = {"nodes": nodes.copy(), "edges": edges.copy()}, (place, self.range, self.fov, heading)

    def sense_many(self, node_ids: Sequence[int] | np.ndarray[Any, Any]) -> Sensed:
        """Look from many nodes; values are ids of nodes, and `edges` has ids of edges. `data` stays as it is."""
        heading = ALL_AROUND if self.fov == FULL_CIRCLE else self.heading()
        looks = [self._look(self.place(node_id), heading) for node_id in as_ids(node_ids, "node_ids")]
        nodes = ragged([[*look.nodes] for look in looks])
        return Sensed(*nodes, Sensed(*ragged([[edge.id for edge in look.edges] for look in looks])))

    @of_data
    def last_view(self) -> SensorView:
        """The nodes and edges seen last, and the field of view from where they were seen."""
        return map_view(self.data, self.outline())

    def _where(self, place: Place) -> tuple[float, float]:
        node = self.data["nodes"].get(place)  # where it was then, unless whoever was handed the data has emptied it
        return super()._where(place) if node is None else (node.x, node.y)

    def _look(self, place: Place, heading: Heading) -> Surroundings:
        return self._memory.views.look(place, self.range, self.fov, heading)


class OccludedMapSensor(MapSensor):
    """The same, without what obstacles hide.

    A sight line runs from where the sensor looks to each node, both ends `observer_height` above the ground. A node
    whose line touches an obstacle is not seen; the node it stands on always is.

    Args:
        ctx: the context.
        sensor_id: the sensor's name.
        sensor_type: OCCLUDED_MAP.
        sensor_range: map units; may be infinite.
        fov: full opening angle in radians; exactly 2 pi sees all around.
        orientation: `(cos, sin)` relative to the owner's heading; absolute without an owner.
        observer_height: of the sight lines above the ground, map units.
    """

    def __init__(
        self,
        ctx: IContext,
        sensor_id: str,
        sensor_type: SensorType,
        sensor_range: float,
        fov: float = FULL_CIRCLE,
        orientation: tuple[float, float] = (1.0, 0.0),
        observer_height: float = 1.6,
    ) -> None:
        super().__init__(ctx, sensor_id, sensor_type, sensor_range, fov, orientation)
        self.observer_height = observer_height

    def _look(self, place: Place, heading: Heading) -> Surroundings:
        views = self._memory.views_past_obstacles
        return views.look_past(place, self.range, self.fov, heading, self.observer_height)

    def _area(self, x: float, y: float, radius: float, heading: Heading, fov: float) -> FloatArray:
        return memory_of(self.ctx).views_past_obstacles.area((x, y), (radius, heading, fov), self.observer_height)


def ragged(rows: list[list[int]]) -> tuple[IntArray, IntArray]:
    """Offsets (rows + 1,) and values of lists of different lengths."""
    offsets = np.zeros(len(rows) + 1, np.int64)
    np.cumsum([len(row) for row in rows], out=offsets[1:])
    return offsets, np.fromiter((value for row in rows for value in row), np.int64, int(offsets[-1]))


def map_view(data: dict[str, Any], outline: FloatArray) -> SensorView:
    """What a sensor of nodes and edges shows of its `data`."""
    nodes = np.array([(node.x, node.y) for node in data.get("nodes", {}).values()], np.float64).reshape(-1, 2)
    return SensorView(nodes, *looks.polylines(data.get("edges", ())), outline=outline)
