"""Robots and other programs: positions out, positions in, and changes of the world from elsewhere.

    ctx.game.add(gamms.bridge.drive("anna", feed))

`driving.py` has the rule by which a robot plays an agent; read it first. `lines.py` has the messages, `feeds.py` where
fixes come from, `matching.py` where on the roads they are, `simulated.py` a robot for trying things out. A client of
contexts: May import: `scenario`, `rules`, `recordings` and below. `links.py` has the ways to reach robots, to which a
class may be added, and `rules.py` what is exchanged in every turn.
"""

from gamms.bridge.driving import Drive, drive
from gamms.bridge.feeds import Clock, Feed, SimulatedClock, WallClock
from gamms.bridge.lines import Fix
from gamms.bridge.links import Link, Process, Udp, WebSocketServer
from gamms.bridge.matching import Checks
from gamms.bridge.rosbridge import RosBridge, rosbridge
from gamms.bridge.rules import positions, publish, traffic
from gamms.bridge.simulated import SimulatedRobot
from gamms.bridge.tracks import Matched, recording_from_tracks

__all__ = [
    "Checks",
    "Clock",
    "Drive",
    "Feed",
    "Fix",
    "Link",
    "Matched",
    "Process",
    "RosBridge",
    "SimulatedClock",
    "SimulatedRobot",
    "Udp",
    "WallClock",
    "WebSocketServer",
    "drive",
    "positions",
    "publish",
    "recording_from_tracks",
    "rosbridge",
    "traffic",
]
