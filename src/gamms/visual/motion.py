"""Where agents are between two turns: on their way along the street they took, or through the air."""

from bisect import bisect_right
from typing import Any, NamedTuple, cast

import numpy as np

from gamms.errors import ContextTerminated, UnknownName
from gamms.ir.graph import FloatArray, GraphColumns, IntArray
from gamms.typing import IAerialAgent, IAgent, IContext
from gamms.typing.agent_engine import AgentType

_Point = tuple[float, float]


class Way(NamedTuple):
    """A polyline, and how far along it each of its points lies, from 0.0 to 1.0."""

    points: list[_Point]
    shares: list[float]

    @classmethod
    def through(cls, points: FloatArray) -> "Way":
        """The way through points (points, 2)."""
        lengths = np.hypot(*np.diff(points, axis=0).T)
        shares = np.concatenate([[0.0], np.cumsum(lengths)]) / (float(lengths.sum()) or 1.0)
        return cls([(x, y) for x, y in points.tolist()], shares.tolist())

    def at(self, share: float) -> _Point:
        """The point after a share of the way's length."""
        place = min(max(bisect_right(self.shares, share), 1), len(self.points) - 1)
        (x0, y0), (x1, y1) = self.points[place - 1 : place + 1]
        step = self.shares[place] - self.shares[place - 1]
        part = (share - self.shares[place - 1]) / step if step > 0.0 else 1.0
        return x0 + part * (x1 - x0), y0 + part * (y1 - y0)

    def until(self, share: float) -> list[_Point]:
        """The points up to a share of the way's length."""
        if share >= 1.0:
            return self.points
        return [*self.points[: bisect_right(self.shares, share)], self.at(share)]


class Motion:
    """The last move of every agent, from the start of a turn's frames to their end."""

    def __init__(self, ctx: IContext) -> None:
        self._ctx = ctx
        self._ways: dict[str, Way] = {}
        self._steps: dict[str, tuple[Any, Any]] = {}
        self._columns: GraphColumns | None = None
        self._sorted: IntArray = np.empty(0, np.int64)  # node rows by id

    def begin_turn(self) -> None:
        """Look up how everybody moved; who has the move of the turn before has not moved since."""
        steps = {agent.name: _step(agent) for agent in self._ctx.agent.create_iter()}
        moved = {name: step for name, step in steps.items() if step[0] != step[1] and self._steps.get(name) != step}
        self._steps = steps
        self._ways = {name: way for name, step in moved.items() if (way := self._way(*step)) is not None}

    def ways(self) -> dict[str, Way]:
        """How agents move in this turn, by name; who stays has no way."""
        return dict(self._ways)

    def position_of(self, name: str, share: float) -> _Point:
        """Where an agent is after a share of its last move, from 0.0 (before it) to 1.0 (where it stands).

        Raises:
            UnknownName (KeyError): there is no such agent, or no such node any more.
        """
        if share < 1.0 and name in self._ways:
            return self._ways[name].at(share)
        agent = self._ctx.agent.get_agent(name)
        if agent.type == AgentType.AERIAL:
            return cast("IAerialAgent", agent).position[:2]
        node = self._ctx.graph.graph.get_node(agent.current_node_id)
        return node.x, node.y

    def _way(self, before: Any, now: Any) -> Way | None:
        if isinstance(now, tuple):
            return Way.through(np.array([before[:2], now[:2]], float))
        try:
            points = self._street(before, now)
            if points is None:
                points = self._ctx.graph.graph.positions([before, now])
        except (UnknownName, ContextTerminated):  # where it came from is gone
            return None
        return Way.through(points)

    def _street(self, source: int, target: int) -> FloatArray | None:
        """The polyline of the first edge from one node to another; None where it is straight or there is none."""
        columns = self._ctx.graph.columns()
        if columns is not self._columns:
            self._columns, self._sorted = columns, np.argsort(columns.node_ids, kind="stable")
        ends = np.searchsorted(columns.node_ids, [source, target], sorter=self._sorted)
        begin, end = self._sorted[np.minimum(ends, len(self._sorted) - 1)].tolist()
        edges = columns.out_edges[columns.offsets[begin] : columns.offsets[begin + 1]]
        leading = edges[columns.targets[edges] == end]
        return columns.bends.get(int(leading[0])) if len(leading) else None


def _step(agent: IAgent) -> tuple[Any, Any]:
    """Where an agent was before its last move, and where it is: nodes, or positions in the air."""
    if agent.type == AgentType.AERIAL:
        flyer = cast("IAerialAgent", agent)
        return flyer.prev_position, flyer.position
    return agent.prev_node_id, agent.current_node_id
