"""A ground agent: it stands on nodes."""

from math import hypot
from typing import Any

from gamms.agent.member import Member
from gamms.arguments import as_range
from gamms.errors import ContextTerminated, UnknownName
from gamms.ir import events as kinds
from gamms.typing import IContext


class Agent(Member):
    """An agent on the ground; see `IAgent` for what each call promises. Any other attribute is the caller's own.

    Args:
        ctx: the context.
        name: the agent's name.
        start_node_id: where it stands.
        kwargs: become attributes (`team`, `orientation`, `meta`, …).

    Raises:
        KeyError: there is no such node.
        AttributeError: a keyword that is the name of a method or of something read-only.
    """

    __slots__ = ()

    _ACTION = "a node id"

    def __init__(self, ctx: IContext, name: str, start_node_id: Any, **kwargs: Any) -> None:
        super().__init__(ctx, name, kwargs)
        self._act = self._moves.act
        self._moves.place(self._columns, 0, start_node_id)
        self._moves.place_previous(self._columns, 0, start_node_id)
        self._adopt(kwargs)

    @property
    def current_node_id(self) -> int:
        """The node it stands on; settable, without changing `prev_node_id`."""
        return self._columns.node[self._row]

    @current_node_id.setter
    def current_node_id(self, node_id: int) -> None:
        self._moves.place(self._columns, self._row, node_id)

    @property
    def speed(self) -> Any:
        """How far it may move in a turn of `ctx.game`, in edges or metres; None for one edge. Settable."""
        return self._columns.speed[self._row]

    @speed.setter
    def speed(self, speed: Any) -> None:
        if speed is not None:
            as_range(speed, f"speed of agent {self.name!r}")
        self._columns.speed[self._row] = speed
        self._note(kinds.AGENT_SPEED, speed=speed)
        self._columns.roster += 1

    @property
    def orientation(self) -> tuple[float, float]:
        """`(cos, sin)` of the heading; (0.0, 0.0) while there is none. Settable: a pair, or None to follow moves."""
        columns, row = self._columns, self._row
        heading = columns.heading[row]
        if heading is not None:
            return heading
        here, before = columns.node[row], columns.previous[row]
        if here == before:
            return (0.0, 0.0)
        try:
            graph = self._ctx.graph.graph
            (_, x1, y1), (_, x0, y0) = graph.get_node(here), graph.get_node(before)
        except (UnknownName, ContextTerminated):  # where it came from, or the whole graph, is gone
            return (0.0, 0.0)
        distance = hypot(x1 - x0, y1 - y0)
        return ((x1 - x0) / distance, (y1 - y0) / distance) if distance else (0.0, 0.0)

    @orientation.setter
    def orientation(self, heading: tuple[float, float] | None) -> None:
        self._moves.turn(self._columns, self._row, heading)
