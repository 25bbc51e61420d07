"""Robots and other programs: positions out, positions in, and changes of the world from elsewhere.

    ctx.game.add(gamms.bridge.drive("anna", feed))

`driving.py` has the rule by which a robot plays an agent; read it first. `lines.py` has the messages, `feeds.py` where
fixes come from, `matching.py` where on the roads they are, `simulated.py` a robot for trying things out. A client of
contexts: May import: `scenario`, `rules`, `recordings` and below. A way to reach robots is one class with `feed(agent)`
and `send(message)`.
"""

from gamms.bridge.driving import Drive, drive
from gamms.bridge.feeds import Clock, Feed, SimulatedClock, WallClock
from gamms.bridge.lines import BadLine, Fix
from gamms.bridge.matching import Checks
from gamms.bridge.simulated import SimulatedRobot

__all__ = [
    "BadLine",
    "Checks",
    "Clock",
    "Drive",
    "Feed",
    "Fix",
    "SimulatedClock",
    "SimulatedRobot",
    "WallClock",
    "drive",
]
