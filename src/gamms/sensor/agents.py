"""AGENT, AGENT_RANGE, AGENT_ARC, OCCLUDED_AGENT: the agents around."""

from collections.abc import Sequence
from math import inf
from typing import Any, Self

import numpy as np

from gamms import kernels
from gamms.arguments import as_ids
from gamms.errors import UnknownName
from gamms.ir.graph import FloatArray
from gamms.ir.positions import Positions
from gamms.ir.sensed import Sensed, SensorView
from gamms.sensor.detection import DetectionModel
from gamms.sensor.map import ragged
from gamms.sensor.sensor import ALL_AROUND, FULL_CIRCLE, GroundSensor, Heading, OccludedSensor, of_data
from gamms.sensor.views import NearbyAgents, Place, coordinates, in_sight, memory_of
from gamms.typing import IContext
from gamms.typing.graph_engine import NodeColumns
from gamms.typing.sensor_engine import SensorType

_FEW = 8  # agents: more are compared as arrays


class AgentSensor(GroundSensor):
    """`data`: fresh `{agent name: id of its node}` of the other agents around, in the order of their creation.

    Without an owner, or at a fixed place, every agent counts as another. The geometry is that of `MapSensor`, applied
    to the nodes the agents stand on, or fly nearest to.

    For the other arguments see `GroundSensor`.

    Args:
        owner: name of the agent that carries the sensor.
    """

    __slots__ = ("_nearby", "_notice")

    def __init__(
        self,
        ctx: IContext,
        sensor_id: str,
        sensor_type: SensorType,
        sensor_range: float,
        fov: float = FULL_CIRCLE,
        orientation: Heading = (1.0, 0.0),
        owner: str | None = None,
        observer_height: float = 1.6,
    ) -> None:
        super().__init__(ctx, sensor_id, sensor_type, sensor_range, fov, orientation, observer_height)
        self._notice: DetectionModel | None = None
        self._owner = owner
        self._nearby: NearbyAgents = memory_of(ctx).nearby

    @property
    def notice(self) -> DetectionModel:
        """Which of the agents in view are reported: by team, and at random."""
        if self._notice is None:  # NOTE: made when asked for, so that a look touches less memory (see `NearbyAgents`)
            self._notice = DetectionModel(self.sensor_id, self._phase)
        return self._notice

    def reset(self) -> None:
        """Forget what was sensed, and how often."""
        super().reset()
        if self._notice is not None:
            self._notice.reset()

    def _snapshot(self) -> tuple[Any, ...]:
        """Return what was sensed and how often, for `_restore`."""
        return tuple(self._last), None if self._notice is None else self._notice._looks.copy()

    def _restore(self, before: tuple[Any, ...]) -> None:
        """Restore what was sensed and how often."""
        self._last[:], looks = before
        if self._notice is not None and (looks or self._notice._looks):
            self._notice._looks = {} if looks is None else looks.copy()

    def sense(self, node_id: int | None = None) -> None:
        """Look around."""
        if self._phase.agent is not None:
            self._phase.refuse("call sensor.sense")
        place = self.place(node_id) if node_id is None or self._at is not None else node_id
        heading = ALL_AROUND if self.fov == FULL_CIRCLE else self.heading()
        if self.range == inf and heading == ALL_AROUND and not self._is_occluded and self._notice is None:
            data = self._all_agents(place)
        else:
            positions, rows = self._found(place, heading)
            names, nodes = positions.names, positions.nodes
            data = {names[row]: nodes[row] for row in rows}
        if self._owner is not None and self._at is None:
            data.pop(self._owner, None)
        self._last[:] = data, (place, self.range, self.fov, heading)

    def sense_many(self, node_ids: Sequence[int] | np.ndarray[Any, Any]) -> Sensed:
        """Look from many nodes; values are positions in `names`. `data` stays as it is."""
        heading = ALL_AROUND if self.fov == FULL_CIRCLE else self.heading()
        own = self._owner if self._at is None else None
        with self._phase.suspended() if self._notice is None else self._notice.on_trial():
            names = tuple(self.ctx.agent.positions.names)
            looks = [self._found(self.place(id), heading)[1] for id in as_ids(node_ids, "node_ids")]
        return Sensed(*ragged([[row for row in look if names[row] != own] for look in looks]), names=names)

    @of_data
    def last_view(self) -> SensorView:
        """Return the agents seen last, at their nodes of then, and the field of view from where they were seen."""
        return SensorView(agents=self.places_of(self.data.values()), names=tuple(self.data), outline=self.outline())

    def _twin(self) -> Self:
        twin = super()._twin()
        twin._notice = None if self._notice is None else self._notice.repeated()
        return twin

    def _all_agents(self, place: Place) -> dict[str, int]:
        if not isinstance(place, tuple) and not self.ctx.graph.graph.has_node(place):
            raise UnknownName("node", place)
        return self._nearby.nodes_by_name()

    def _found(self, place: Place, heading: Heading) -> tuple[Positions, list[int]]:
        """Return where agents are, and the rows of those that are seen, ascending."""
        positions, rows = self._nearby.within(place, self.range)
        if heading != ALL_AROUND:
            rows = self._ahead(place, rows, positions.nodes, heading)
        notice = self._notice
        if notice is not None:
            rows = notice.wanted(rows, positions.teams)
        if self._is_occluded:
            rows = self._in_sight(place, rows)
        if notice is not None and notice.needs_chance:
            owner = self._owner if self._at is None else None
            distances = np.hypot(*self._offsets(place, rows).T)
            names = [positions.names[row] for row in rows]
            rows = _kept(rows, notice.is_noticed(self.ctx, owner, names, distances))
        return positions, rows

    def _ahead(self, place: Place, rows: list[int], nodes: Sequence[int], heading: Heading) -> list[int]:
        """Return those rows whose agents are in the field of view."""
        if len(rows) > _FEW:
            dx, dy = self._offsets(place, rows).T
            return _kept(rows, kernels.in_cone(dx, dy, heading, self.fov))
        x0, y0 = coordinates(self.ctx, place)
        places = [self.ctx.graph.graph.get_node(nodes[row]) for row in rows]
        ahead = [kernels.is_in_cone(x - x0, y - y0, heading, self.fov) for _, x, y in places]
        return [row for row, is_in in zip(rows, ahead, strict=True) if is_in]

    def _offsets(self, place: Place, rows: list[int]) -> FloatArray:
        offsets: FloatArray = self._nearby.coordinates().xy[rows] - coordinates(self.ctx, place)
        return offsets

    def _in_sight(self, place: Place, rows: list[int]) -> list[int]:
        """Return those rows whose agents no obstacle hides."""
        nodes = NodeColumns(self.ctx.agent.positions.node_ids[rows], self._nearby.coordinates().xy[rows])
        return _kept(rows, in_sight(self.ctx, place, nodes, self.range, self._observer_height))


class OccludedAgentSensor(OccludedSensor, AgentSensor):
    """The same, without the agents that obstacles hide."""

    __slots__ = ()


def _kept(rows: list[int], is_kept: "np.ndarray[Any, np.dtype[np.bool_]]") -> list[int]:
    return [row for row, is_in in zip(rows, is_kept.tolist(), strict=True) if is_in]
