"""A sensor defined by a plain function."""

from collections.abc import Callable
from typing import Any

from gamms.arguments import find_signature
from gamms.deciding import refuse_while_deciding
from gamms.errors import BadType
from gamms.ir.sensor_results import SensorView
from gamms.readonly import thaw
from gamms.sensor.sensor import Sensor
from gamms.text import shown
from gamms.typing import IContext
from gamms.typing.sensor_engine import SensorType


class FunctionSensor(Sensor):
    """`data`: the result of a function.

    The function is called as `fn()`, `fn(node_id)` or `fn(node_id, agent)`, depending on its number of parameters;
    `agent` is the owner, or None. Its result is deep-copied, so that later changes of it, or changes by one agent,
    affect no other agent.

    Args:
        ctx: the context.
        sensor_id: the sensor's name.
        fn: the function.

    Raises:
        BadType: `fn` cannot be called in one of these ways.
    """

    sees_world_only = False

    def __init__(self, ctx: IContext, sensor_id: str, fn: Callable[..., Any]) -> None:
        super().__init__(ctx, sensor_id, SensorType.CUSTOM)
        self.function = fn

    @property
    def function(self) -> Callable[..., Any]:
        """The function; settable."""
        return self._function

    @function.setter
    def function(self, fn: Callable[..., Any]) -> None:
        self._takes = _count_parameters(fn, self.sensor_id)
        self._function = fn

    def called_with_both(self) -> Callable[[int | None, Any], Any]:
        """Return the function as one of a node and an agent, which passes on as many as the function takes."""
        function = self._function
        takes = self._takes
        return lambda node_id, agent: function(*(node_id, agent)[:takes])

    @refuse_while_deciding
    def reset(self) -> None:
        """Clear the sensed data."""
        self._last[0] = None

    @refuse_while_deciding
    def view_from(self, node_id: int | None, owner: str | None) -> SensorView:  # noqa: ARG002 - it is not drawn
        """Raise NotOffered, without a call of the function."""
        return self.last_view()

    def sense(self, node_id: int | None = None) -> None:
        """Call the function."""
        if self._phase.agent is not None:
            self._phase.refuse("call sensor.sense")
        agent = None if self._owner is None or self._takes < 2 else self.ctx.agent.get_agent(self._owner)
        try:
            sensed = self._function(*(node_id, agent)[: self._takes])
        except Exception as error:
            whose = "" if self._owner is None else f" of agent {self._owner!r}"
            error.add_note(f"In the function of sensor {self.sensor_id!r}{whose}.")
            raise
        try:
            self._last[0] = thaw(sensed)
        except Exception as error:
            error.add_note(
                f"The result of the function of sensor {self.sensor_id!r} is copied: every agent gets its own."
            )
            raise


def _count_parameters(fn: object, sensor_id: str) -> int:
    """Return the number of arguments, at most two, with which a function is called."""
    from inspect import Parameter

    wanted = f"The function of sensor {sensor_id!r} must take (), (node_id) or (node_id, agent)"
    if not callable(fn):
        raise BadType(f"{wanted}; {shown(fn)} is no function.")
    try:
        parameters = list(find_signature(fn).parameters.values())
    except (TypeError, ValueError):  # some builtins have no signature
        return 1
    positional = [one for one in parameters if one.kind in (Parameter.POSITIONAL_ONLY, Parameter.POSITIONAL_OR_KEYWORD)]
    needed = [one for one in positional if one.default is Parameter.empty]
    keywords = [one for one in parameters if one.kind is Parameter.KEYWORD_ONLY and one.default is Parameter.empty]
    if len(needed) > 2 or keywords:
        raise BadType(f"{wanted}; {shown(fn)} takes {find_signature(fn)}.")
    is_open = any(one.kind is Parameter.VAR_POSITIONAL for one in parameters)
    return 2 if is_open else len(needed) or min(len(positional), 1)
