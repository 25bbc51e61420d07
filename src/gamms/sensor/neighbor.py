"""NEIGHBOR: where one may go from here."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from gamms.arguments import as_ids, as_int
from gamms.ir.sensed import Sensed, SensorView
from gamms.sensor.map import ragged
from gamms.sensor.sensor import Sensor, of_data
from gamms.typing import IContext
from gamms.typing.sensor_engine import SensorType


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
