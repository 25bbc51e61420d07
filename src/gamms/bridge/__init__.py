"""Robots and other programs: send positions, receive positions, and let other programs change the world.

    ctx.game.add(gamms.bridge.drive("anna", feed))

`driving.py` has the rule by which a robot plays an agent; read it first. `lines.py` defines the messages, `feeds.py`
the sources of fixes, `matching.py` matches positions to roads, and `simulated.py` has a robot for experiments. A client
of contexts: May import: `scenario`, `rules`, `recordings` and below. To add a way to reach robots, add a class to
`links.py`; `rules.py` has the rules that exchange messages in every turn.
"""

from gamms.bridge.driving import Drive, drive
from gamms.bridge.feeds import Feed
from gamms.bridge.lines import Fix
from gamms.bridge.links import Link, Process, Udp, WebSocketServer
from gamms.bridge.matching import FixChecks
from gamms.bridge.rosbridge import RosBridge, rosbridge
from gamms.bridge.rules import positions, publish, traffic
from gamms.bridge.simulated import SimulatedRobot
from gamms.bridge.tracks import recording_from_tracks
from gamms.clocks import Clock, SimulatedClock, WallClock
from gamms.errors import suggest_names as _suggest_names
from gamms.graph.tracks import TrackMatch

__all__ = [
    "Clock",
    "Drive",
    "Feed",
    "Fix",
    "FixChecks",
    "Link",
    "Process",
    "RosBridge",
    "SimulatedClock",
    "SimulatedRobot",
    "TrackMatch",
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

_suggest_names(__name__, __all__)
