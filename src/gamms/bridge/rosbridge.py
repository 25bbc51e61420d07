"""Robots that run ROS, by the rosbridge protocol: receive poses from topics, and publish waypoints as paths."""

import logging
from collections import Counter
from collections.abc import Sequence
from itertools import pairwise
from math import atan2, cos, degrees, pi, sin
from typing import TYPE_CHECKING, Any, Self

import msgspec

from gamms.arguments import as_name, as_numbers, as_range
from gamms.bridge.feeds import Feed, Message
from gamms.bridge.lines import Fix
from gamms.clocks import Clock
from gamms.errors import BadValue, NetworkError, nearest
from gamms.plugins import require_extra
from gamms.readonly import NotPickled
from gamms.text import reason, shown

if TYPE_CHECKING:
    from roslibpy import Ros

_LONGEST = 1 << 20  # bytes of one message: covariances and point clouds make them long
_MOST_DELAY_S = 5.0  # before the next attempt to connect
_MOST_SHOWN = 200  # bytes of an invalid message in the log
_PATH = "nav_msgs/Path"


class _Stamp(msgspec.Struct):
    secs: int = 0  # of ROS 1
    nsecs: int = 0
    sec: int = 0  # of ROS 2
    nanosec: int = 0


class _Header(msgspec.Struct):
    stamp: _Stamp = msgspec.field(default_factory=_Stamp)

    @property
    def seconds(self) -> float | None:
        """The time in seconds; None: the header holds no time."""
        seconds = self.stamp.secs + self.stamp.sec + (self.stamp.nsecs + self.stamp.nanosec) * 1e-9
        return seconds or None


class _Point(msgspec.Struct):
    x: float
    y: float


class _Quaternion(msgspec.Struct):
    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    w: float = 0.0


class _Pose(msgspec.Struct):
    position: _Point
    orientation: _Quaternion = msgspec.field(default_factory=_Quaternion)

    def fix(self, header: _Header, origin: Sequence[float]) -> Fix:
        q = self.orientation
        heading = None
        if q.w or q.z:
            yaw = atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y**2 + q.z**2))
            heading = degrees(pi / 2.0 - yaw) % 360.0
        return Fix(t=header.seconds, x=self.position.x + origin[0], y=self.position.y + origin[1], heading=heading)


class _PoseStamped(msgspec.Struct):
    pose: _Pose
    header: _Header = msgspec.field(default_factory=_Header)

    def fix(self, origin: Sequence[float]) -> Fix:
        return self.pose.fix(self.header, origin)


class _Odometry(msgspec.Struct):
    pose: _PoseStamped  # with a covariance, and without a header
    header: _Header = msgspec.field(default_factory=_Header)

    def fix(self, origin: Sequence[float]) -> Fix:
        return self.pose.pose.fix(self.header, origin)


class _Status(msgspec.Struct):
    status: int = 0


class _NavSatFix(msgspec.Struct):
    latitude: float
    longitude: float
    status: _Status = msgspec.field(default_factory=_Status)
    header: _Header = msgspec.field(default_factory=_Header)

    def fix(self, origin: Sequence[float]) -> Fix:  # noqa: ARG002 - degrees have an origin of their own
        """Return the message as a fix; without a position if the receiver has none."""
        if self.status.status < 0:
            return Fix(t=self.header.seconds)
        return Fix(t=self.header.seconds, lat=self.latitude, lon=self.longitude)


_KINDS: dict[str, type[_PoseStamped] | type[_Odometry] | type[_NavSatFix]] = {
    "geometry_msgs/PoseStamped": _PoseStamped,
    "nav_msgs/Odometry": _Odometry,
    "sensor_msgs/NavSatFix": _NavSatFix,
}


class RosBridge(NotPickled):
    """A connection to rosbridge; made by `gamms.bridge.rosbridge`.

    Attributes:
        counts: "bad" (not a message of its topic's type), "invalid" (no message of rosbridge), "sent", "unsent" (not
            connected).
    """

    _not_pickled = (
        "A connection to rosbridge can neither be pickled nor copied, because threads use it. Open another one there."
    )

    def __init__(
        self, ros: "Ros", origin: Sequence[float], frame_id: str, clock: Clock | None, counts: Counter[str]
    ) -> None:
        self._ros = ros
        self._origin = origin
        self._frame_id = frame_id
        self._clock = clock
        self.counts = counts

    @property
    def is_connected(self) -> bool:
        """Whether the connection is open now; a lost connection is opened again."""
        return bool(self._ros.is_connected)

    def feed(self, topic: str, type: str = "nav_msgs/Odometry", *, path: str | None = None) -> Feed:
        """Return the feed of a robot that publishes its position on a topic.

        Args:
            topic: the name of the topic, such as "/anna/odom".
            type: "nav_msgs/Odometry", "geometry_msgs/PoseStamped" or "sensor_msgs/NavSatFix"; or their names in ROS 2,
                such as "nav_msgs/msg/Odometry".
            path: the topic for waypoints, published as `nav_msgs/Path`; None: send no waypoints.

        Raises:
            BadType, BadValue: an argument has a wrong type or value.
        """
        from roslibpy import Topic

        name = as_name(topic, "a topic")
        kind = str(type).replace("/msg/", "/")
        if kind not in _KINDS:
            raise BadValue(f"No fix comes from a {shown(type)}.{nearest(kind, _KINDS)} There are {', '.join(_KINDS)}.")
        feed = Feed(clock=self._clock)

        def take(message: Any) -> None:
            try:
                fix = msgspec.convert(dict(message), _KINDS[kind]).fix(self._origin)
            except (msgspec.MsgspecError, TypeError, ValueError, OverflowError):
                self.counts["bad"] += 1
            else:
                feed.put(fix)

        if path is not None:
            out = Topic(self._ros, as_name(path, "a topic"), _PATH)
            out.advertise()
            feed.send = lambda message: self._publish(out, message)
        Topic(self._ros, name, type).subscribe(take)
        return feed

    def close(self) -> None:
        """Close the connection; the thread of roslibpy, which all connections share, stays."""
        self._ros.factory.maxRetries = 0
        self._ros.close()

    def _publish(self, topic: Any, message: Message) -> None:
        """Publish waypoints as a path; ignore other messages, which only robots that read lines of JSON use."""
        if message.get("type") != "waypoints":
            return
        if not self._ros.is_connected:  # roslibpy would keep the message until it is connected
            self.counts["unsent"] += 1
            return
        topic.publish(self.path_of(message["points"]))
        self.counts["sent"] += 1

    def path_of(self, points: Sequence[Sequence[float]]) -> Message:
        """Return waypoints as a `nav_msgs/Path`; each pose faces the next one."""
        header = {"frame_id": self._frame_id}
        flat = [(x - self._origin[0], y - self._origin[1]) for x, y in points]
        yaws = [atan2(y1 - y0, x1 - x0) for (x0, y0), (x1, y1) in pairwise(flat)]
        poses = [
            {
                "header": header,
                "pose": {
                    "position": {"x": x, "y": y, "z": 0.0},
                    "orientation": {"x": 0.0, "y": 0.0, "z": sin(yaw / 2.0), "w": cos(yaw / 2.0)},
                },
            }
            for (x, y), yaw in zip(flat, [*yaws, *(yaws[-1:] or [0.0])], strict=True)
        ]
        return {"header": header, "poses": poses}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def rosbridge(
    url: str,
    *,
    origin: tuple[float, float] = (0.0, 0.0),
    frame_id: str = "map",
    timeout_s: float = 10.0,
    clock: Clock | None = None,
) -> RosBridge:
    """Connect to a rosbridge server (rosbridge v2 protocol), by roslibpy with its asyncio transport.

    Args:
        url: such as "ws://localhost:9090".
        origin: (x, y) in map units of the origin of the robot's frame: UTM coordinates are too large for the floats of
            many robots. Not needed for degrees.
        frame_id: the frame of published paths.
        timeout_s: the longest wait for the connection in seconds.
        clock: the clock for the age of fixes; None: that of the machine.

    Raises:
        MissingExtra (ImportError): roslibpy is not installed.
        NetworkError (ConnectionError): the server does not answer in time.
        BadType, BadValue: an argument has a wrong type or value.
    """
    where = as_name(url, "a URL")
    seconds = as_range(timeout_s, "timeout_s")
    if not where.startswith(("ws://", "wss://")):
        raise BadValue(f"The URL of a rosbridge server begins with ws:// or wss://, unlike {shown(url)}.")
    at = as_numbers(origin, "origin", "(x, y)")
    with require_extra("A connection to rosbridge", "ros"):
        import roslibpy
    logging.getLogger("roslibpy").addFilter(_once)

    counts: Counter[str] = Counter()

    class BoundedRos(roslibpy.Ros):  # type: ignore[misc] # roslibpy has no types
        def connect(self) -> None:
            """Connect with a bounded length of messages, and with a protocol that skips invalid ones."""
            self.factory.protocol = _skip_invalid(self.factory.protocol, counts)
            self.factory.setProtocolOptions(
                maxFramePayloadSize=_LONGEST, maxMessagePayloadSize=_LONGEST, perMessageCompressionOffers=[]
            )
            self.factory.maxDelay = _MOST_DELAY_S
            super().connect()

    ros = BoundedRos(where, transport="asyncio")
    try:
        ros.run(seconds)
    except roslibpy.core.RosTimeoutError:
        ros.factory.maxRetries = 0
        raise NetworkError(
            f"No rosbridge server answers at {where} within {seconds:g} s. Start it, such as by "
            "'roslaunch rosbridge_server rosbridge_websocket.launch', and check the port."
        ) from None
    return RosBridge(ros, at, as_name(frame_id, "a frame"), clock, counts)


def _skip_invalid(protocol: type[Any], counts: Counter[str]) -> type[Any]:
    """Return a protocol that counts messages which roslibpy cannot use; its own prints a traceback for each."""

    class SkippingProtocol(protocol):  # type: ignore[misc] # roslibpy has no types
        def onMessage(self, payload: bytes, isBinary: bool) -> None:  # noqa: N802, N803 - Autobahn's names
            flaw = "it is binary" if isBinary else self._use(payload)
            if not flaw:
                return
            counts["invalid"] += 1
            if counts["invalid"] == 1:
                logging.getLogger("roslibpy").warning(
                    "A message of the rosbridge server was skipped (%s): %s. Further ones are only counted, in "
                    'counts["invalid"].',
                    flaw,
                    shown(payload[:_MOST_SHOWN]),
                )

        def _use(self, payload: bytes) -> str:
            """Pass a message on; return "", or the reason if that fails."""
            try:
                self.on_message(payload)
            except Exception as error:  # noqa: BLE001 - whatever a message from outside makes roslibpy raise
                return reason(error)
            return ""

    return SkippingProtocol


class _LogOnce(logging.Filter):
    """Logs each error of roslibpy only once, because roslibpy logs an error for every invalid message."""

    def __init__(self) -> None:
        super().__init__()
        self._seen: set[object] = set()

    def filter(self, record: logging.LogRecord) -> bool:
        """Return whether to log the record."""
        is_known = record.msg in self._seen
        if record.levelno >= logging.ERROR:
            self._seen.add(record.msg)
        return not is_known


_once = _LogOnce()
