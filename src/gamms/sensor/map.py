"""NEIGHBOR, MAP, RANGE, ARC, OCCLUDED_MAP: the nodes and edges around."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from gamms.arguments import as_ids, as_int
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.sensed import Sensed, SensorView
from gamms.sensor import fov_geometry
from gamms.sensor.sensor import ALL_AROUND, FULL_CIRCLE, GroundSensor, Heading, OccludedSensor, Sensor, of_data
from gamms.sensor.views import Place, memory_of
from gamms.typing import IContext
from gamms.typing.graph_engine import Surroundings
from gamms.typing.sensor_engine import SensorType


class MapSensor(GroundSensor):
    """`data`: fresh `{'nodes': {id: Node}, 'edges': [OSMEdge, …]}`, in insertion order.

    A node is seen if it is at most `range` away from where the sensor looks and inside its field of view, both rims
    included; the node it stands on always is. An edge is seen if both its ends are.

    For the arguments see `GroundSensor`.
    """

    __slots__ = ("_memory",)

    def __init__(
        self,
        ctx: IContext,
        sensor_id: str,
        sensor_type: SensorType,
        sensor_range: float,
        fov: float = FULL_CIRCLE,
        orientation: Heading = (1.0, 0.0),
        observer_height: float = 1.6,
    ) -> None:
        super().__init__(ctx, sensor_id, sensor_type, sensor_range, fov, orientation, observer_height)
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
        """Return the nodes and edges seen last, and the field of view from where they were seen."""
        return map_view(self.data, self.outline())

    def _where(self, place: Place) -> tuple[float, float]:
        node = self.data["nodes"].get(place)  # where it was then, unless the data was emptied since
        return super()._where(place) if node is None else (node.x, node.y)

    def _look(self, place: Place, heading: Heading) -> Surroundings:
        if self._is_occluded:
            views = self._memory.views_past_obstacles
            return views.look_past(place, self.range, self.fov, heading, self._observer_height)
        return self._memory.views.look(place, self.range, self.fov, heading)


class OccludedMapSensor(OccludedSensor, MapSensor):
    """The same, without what obstacles hide."""

    __slots__ = ()


def ragged(rows: list[list[int]]) -> tuple[IntArray, IntArray]:
    """Return offsets (rows + 1,) and values of lists of different lengths."""
    offsets = np.zeros(len(rows) + 1, np.int64)
    np.cumsum([len(row) for row in rows], out=offsets[1:])
    return offsets, np.fromiter((value for row in rows for value in row), np.int64, int(offsets[-1]))


def map_view(data: dict[str, Any], outline: FloatArray) -> SensorView:
    """Return what a sensor of nodes and edges shows of its `data`."""
    nodes = np.array([(node.x, node.y) for node in data.get("nodes", {}).values()], np.float64).reshape(-1, 2)
    return SensorView(nodes, *fov_geometry.polylines(data.get("edges", ())), outline=outline)


class NeighborSensor(Sensor):
    """`data`: a fresh list of the node itself, then its out-neighbours in edge insertion order."""

    __slots__ = ("_neighborhoods",)

    def __init__(self, ctx: IContext, sensor_id: str, sensor_type: SensorType = SensorType.NEIGHBOR) -> None:
        super().__init__(ctx, sensor_id, sensor_type)
        self._last[0] = []
        self._neighborhoods = ctx.graph.graph.neighborhoods

    def sense_many(self, node_ids: Sequence[int] | np.ndarray[Any, Any]) -> Sensed:
        """Look from many nodes; values are ids of nodes. `data` stays as it is."""
        near = self._neighborhoods
        return Sensed(*ragged([[*near[node_id]] for node_id in as_ids(node_ids, "node_ids")]))

    def sense(self, node_id: int) -> None:
        """Look around."""
        if self._phase.agent is not None:
            self._phase.refuse("call sensor.sense")
        try:
            self._last[0] = [*self._neighborhoods[node_id]]
        except TypeError:  # not hashable, or no id
            self._last[0] = [*self._neighborhoods[as_int(node_id, "The id of a node")]]

    @of_data
    def last_view(self) -> SensorView:
        """The nodes seen last."""
        return SensorView(nodes=self.places_of(self.data))
