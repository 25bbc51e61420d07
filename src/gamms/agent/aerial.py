"""An aerial agent: it is somewhere in space, and above the node that is nearest."""

from contextlib import suppress
from typing import Any

from gamms import kernels
from gamms.agent.member import Member
from gamms.deciding import refused_while_deciding
from gamms.errors import GammsError
from gamms.ir.agents import Position, Quat
from gamms.typing import IContext
from gamms.typing.agent_engine import IAerialAgent
from gamms.typing.sensor_engine import SensorType
from gamms.typing.state import AerialState


class AerialAgent(Member, IAerialAgent):
    """An agent that flies; see `IAerialAgent` for what each call promises. Any other attribute is the caller's own.

    Args:
        ctx: the context.
        name: the agent's name.
        start_node_id: the node it starts from, at its x and y and z = 0.
        speed: how far it moves at each step, map units; not negative.
        position: `(x, y, z)` where it starts instead.
        kwargs: become attributes (`team`, `quat`, `orientation`, `meta`, …).

    Raises:
        KeyError: there is no such node.
        BadValue, BadType: a speed, position, quat or orientation that is none.
        AttributeError: a keyword that is the name of a method or of something read-only.
    """

    __slots__ = ()

    _SETTABLE = (Member._SETTABLE | {"quat"}) - {"speed"}
    _ACTION = "a direction (dx, dy, dz)"

    def __init__(
        self, ctx: IContext, name: str, start_node_id: Any, speed: Any, position: Any = None, **kwargs: Any
    ) -> None:
        super().__init__(ctx, name, kwargs, (0.0, 0.0, 0.0))
        self._act = self._moves.fly
        self._moves.launch(self._columns, 0, start_node_id, speed, position)
        self._adopt(kwargs)

    def __repr__(self) -> str:
        """Name the agent and where it is."""
        return f"{type(self).__name__}({self.name!r}, position={self.position})"

    @property
    def position(self) -> Position:
        """`(x, y, z)`; settable: where it was is then `prev_position`, above `prev_node_id`."""
        return self._columns.position[self._row]  # type: ignore[return-value] # None only on the ground

    @position.setter
    def position(self, position: Position) -> None:
        self._moves.place_at(self._columns, self._row, position)

    @property
    def prev_position(self) -> Position:
        """Where it was before the last move."""
        return self._columns.previous_position[self._row]  # type: ignore[return-value] # as above

    @property
    def current_node_id(self) -> int:
        """The node nearest to its x and y; settable: it goes there without changing its z."""
        return self._moves.nearest(self._columns, self._row)

    @current_node_id.setter
    def current_node_id(self, node_id: int) -> None:
        self._moves.place_above(self._columns, self._row, node_id)

    @property
    def quat(self) -> Quat:
        """How it is turned, `(w, x, y, z)` of length 1; settable, of any length."""
        return self._columns.quat[self._row]  # type: ignore[return-value] # as above

    @quat.setter
    def quat(self, quat: Quat) -> None:
        self._moves.turn_in_space(self._columns, self._row, quat)

    @property
    def orientation(self) -> tuple[float, float]:
        """`(cos, sin)` of the yaw of `quat`; (0.0, 0.0) if it points straight up or down.

        Settable: a pair turns it about the vertical, without pitch and roll; None leaves it unturned, facing east.
        """
        return kernels.yaw(self.quat)

    @orientation.setter
    def orientation(self, heading: tuple[float, float] | None) -> None:
        self._moves.face(self._columns, self._row, heading)

    @property
    def speed(self) -> float:
        """How far it moves at each step, map units."""
        return self._columns.speed[self._row]  # type: ignore[return-value] # as above

    @refused_while_deciding
    def sense(self) -> dict[str, tuple[SensorType, Any]]:
        """Ask all sensors: name -> (kind, data)."""
        if self._carried:
            self._moves.nearest(self._columns, self._row)  # where the sensors look from
        return super().sense()

    def get_state(self) -> AerialState:  # type: ignore[override] # an agent of unknown kind is taken for one on the ground
        """Sense; a fresh dict with `curr_pos`, `quat` and `sensor`."""
        sensed = self.sense()
        self._last[0] = state = self._state_of(sensed)
        return state

    def _state_of(self, sensed: dict[str, Any]) -> AerialState:  # type: ignore[override] # as above
        return {"curr_pos": self.position, "quat": self.quat, "sensor": sensed}

    def _rest(self) -> None:
        with suppress(GammsError):  # a graph of somebody else's may not know
            self._moves.nearest(self._columns, self._row)  # while there is a graph
        super()._rest()
