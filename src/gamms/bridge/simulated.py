"""A simulated robot: it drives along its waypoints and reports its position."""

from math import atan2, degrees, hypot

import numpy as np

from gamms import kernels
from gamms.arguments import as_int, as_name, as_range
from gamms.bridge.feeds import Message
from gamms.bridge.lines import Fix
from gamms.clocks import Clock, SimulatedClock, as_clock
from gamms.context import Context
from gamms.typing import IAgent


class SimulatedRobot:
    """Drives along the waypoints that it receives, at a constant speed, and returns a fix when it is called.

    It is a feed: `ctx.game.add(gamms.bridge.drive("anna", SimulatedRobot(ctx, "anna")))`. The same clock, speed and
    seed give the same fixes.

    Args:
        ctx: the context.
        agent: the agent at whose position the robot starts, or its name.
        clock: the clock for its motion; None: a `SimulatedClock` of its own. Several robots in one game share a clock.
        speed: meters per second.
        noise_m: standard deviation of the error of each coordinate, meters.
        seed: the seed of the errors.

    Attributes:
        clock: its clock.
        xy: its true position.
    """

    def __init__(
        self,
        ctx: Context,
        agent: IAgent | str,
        *,
        clock: Clock | None = None,
        speed: float = 1.5,
        noise_m: float = 0.0,
        seed: int = 0,
    ) -> None:
        name = as_name(getattr(agent, "name", agent), "an agent")
        one = ctx.agent.get_agent(name)
        self.clock = as_clock(clock or SimulatedClock())
        self._speed = as_range(speed, "speed")
        self._noise_m = as_range(noise_m, "noise_m")
        self._rng = kernels.stream(as_int(seed, "seed"), "simulated robot", name)
        self.xy: tuple[float, float] = one.xy
        self._number: int | None = None  # number of the current route
        self._way: list[tuple[float, float]] = []
        self._heading: float | None = None
        self._time = self.clock.now()

    def send(self, message: Message) -> None:
        """Take the waypoints of a new route; any other message stops the robot."""
        self._drive()
        points = message["points"] if message.get("type") == "waypoints" else []
        if points and message["way"] == self._number:
            return
        self._number = message.get("way")
        self._way = [(float(x), float(y)) for x, y in points]

    def __call__(self) -> Fix:
        """Return a fix of the current position."""
        self._drive()
        x, y = np.array(self.xy) + self._noise_m * self._rng.standard_normal(2)
        return Fix(t=self._time, x=float(x), y=float(y), heading=self._heading)

    def _drive(self) -> None:
        """Move along the waypoints for the time since the last call."""
        now = self.clock.now()
        left = self._speed * (now - self._time)
        self._time = now
        while self._way and left > 0.0:
            x, y = self.xy
            to_x, to_y = self._way[0]
            dx = to_x - x
            dy = to_y - y
            apart = hypot(dx, dy)
            if apart > 0.0:
                self._heading = degrees(atan2(dx, dy)) % 360.0
            if apart <= left:
                self.xy = self._way.pop(0)
            else:
                self.xy = (x + dx / apart * left, y + dy / apart * left)
            left -= apart
