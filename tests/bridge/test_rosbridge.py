"""Robots that run ROS, against a server on this machine that speaks the rosbridge v2 protocol."""

import json
import math
import sys
import threading
import time

import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.server import serve

import gamms
from gamms.bridge import WebSocketServer, drive, rosbridge
from gamms.errors import BadType, BadValue, MissingExtra, NetworkError

pytest.importorskip("roslibpy")


class Server:
    """Speaks rosbridge v2, and lets its robot be at the end of each path that is published."""

    def __init__(self, port=0):
        self.received, self.subscribed, self.advertised = [], {}, {}
        self._server = serve(self._talk, "127.0.0.1", port)
        self.port = self._server.socket.getsockname()[1]
        self.url = f"ws://127.0.0.1:{self.port}"
        self._lines = []
        self._thread = threading.Thread(target=self._server.serve_forever, daemon=True)
        self._thread.start()
        self.on_path = None

    def _talk(self, line):
        self._lines.append(line)
        try:
            for text in line:
                message = json.loads(text)
                self.received.append(message)
                if message["op"] == "subscribe":
                    self.subscribed[message["topic"]] = message["type"]
                elif message["op"] == "advertise":
                    self.advertised[message["topic"]] = message["type"]
                elif message["op"] == "publish" and self.on_path:
                    self.on_path(message["msg"])
        except ConnectionClosed:
            pass

    def publish(self, topic, msg):
        self.send(json.dumps({"op": "publish", "topic": topic, "msg": msg}))

    def send(self, text):
        self._lines[-1].send(text)

    def hang_up(self):
        for line in self._lines:
            line.close()

    def close(self):
        self.hang_up()
        self._server.shutdown()
        self._thread.join()


@pytest.fixture
def server():
    one = Server()
    yield one
    one.close()


@pytest.fixture(scope="module", autouse=True)
def _no_thread_is_left():
    yield
    from roslibpy.comm.comm_asyncio import _get_shared_manager

    _get_shared_manager().terminate()


def wait_until(holds, seconds=60.0):
    ends = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < ends, "it has not come"
        time.sleep(0.002)


def pose(x, y, yaw=0.0):
    turned = {"x": 0.0, "y": 0.0, "z": math.sin(yaw / 2), "w": math.cos(yaw / 2)}
    return {"position": {"x": x, "y": y, "z": 0.0}, "orientation": turned}


def odometry(x, y, yaw=0.0, seconds=5):
    header = {"seq": 1, "stamp": {"secs": seconds, "nsecs": 250_000_000}, "frame_id": "map"}
    return {"header": header, "pose": {"pose": pose(x, y, yaw), "covariance": [0.0] * 36}, "twist": {}}


def taken_from(feed):
    found = []
    wait_until(lambda: found.extend(feed.take()) or found)
    return found[-1].fix


def test_a_robot_plays_a_game_by_rosbridge(server):
    def arrive(path):
        end = path["poses"][-1]["pose"]["position"]
        server.publish("/anna/odom", odometry(end["x"], end["y"]))

    server.on_path = arrive
    with gamms.create_context(seed=1) as ctx, rosbridge(server.url, origin=(100.0, 0.0)) as ros:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(1, 4, spacing=20.0))
        walk = {"strategy": lambda state: state.update(action=max(state["legal"]))}
        anna = ctx.agent.create_agent("anna", start_node_id=0, **walk)
        ctx.agent.create_agent("bert", start_node_id=1, strategy=gamms.strategies.random_walk)
        ctx.game.add(drive("anna", ros.feed("/anna/odom", path="/anna/path"), limit_s=60.0))
        ctx.game.run(3)
        assert (anna.current_node_id, ctx.game.events) == (3, [])
        assert server.subscribed == {"/anna/odom": "nav_msgs/Odometry"}
        assert server.advertised == {"/anna/path": "nav_msgs/Path"}
        paths = [one["msg"] for one in server.received if one["op"] == "publish"]
        assert paths[0]["header"] == {"frame_id": "map"}
        assert [one["pose"]["position"] for one in paths[0]["poses"]] == [
            {"x": -100.0, "y": 0.0, "z": 0.0},
            {"x": -80.0, "y": 0.0, "z": 0.0},
        ]
        assert ros.counts["sent"] >= 3


def test_fixes_come_from_odometry_poses_and_satellites(server):
    with rosbridge(server.url, origin=(1_000.0, 2_000.0)) as ros:
        odom = ros.feed("/odom")
        stamped = ros.feed("/pose", "geometry_msgs/msg/PoseStamped")
        gps = ros.feed("/gps", "sensor_msgs/NavSatFix")
        wait_until(lambda: len(server.subscribed) == 3)
        server.publish("/odom", odometry(1.0, 2.0, yaw=math.pi / 2))
        fix = taken_from(odom)
        assert (fix.t, fix.x, fix.y) == (5.25, 1_001.0, 2_002.0)
        assert fix.heading == pytest.approx(0.0, abs=1e-9)  # north
        stamp = {"stamp": {"sec": 7, "nanosec": 500_000_000}, "frame_id": "map"}
        server.publish("/pose", {"header": stamp, "pose": pose(3, 4)})
        fix = taken_from(stamped)
        assert (fix.t, fix.x, fix.y, fix.heading) == (7.5, 1_003.0, 2_004.0, 90.0)  # east
        server.publish("/gps", {"status": {"status": 0}, "latitude": 60.17, "longitude": 24.94, "altitude": 3.0})
        fix = taken_from(gps)
        assert (fix.t, fix.lat, fix.lon) == (None, 60.17, 24.94)


def test_messages_of_another_form_are_counted_and_break_nothing(server, caplog):
    with rosbridge(server.url) as ros:
        odom, gps = ros.feed("/odom"), ros.feed("/gps", "sensor_msgs/NavSatFix")
        wait_until(lambda: len(server.subscribed) == 2)
        for message in ({}, {"pose": 3}, {"pose": {"pose": {"position": {"x": "1", "y": None}}}}, [], 7, None):
            server.publish("/odom", message)
        server.send('{"op": "publish", "topic": "/odom", "msg": {"pose": {"pose": {"position": {"x": NaN, "y": 1}}}}}')
        server.publish("/gps", {"status": {"status": -1}, "latitude": 0.0, "longitude": 0.0})
        invalid = ("hello", "[" * 100_000, "{}", '{"op": "call_service"}', '{"op": "quit"}', '"op"', b"\xff")
        for text in (*invalid, '{"op": "status", "msg": "no topic"}', "{"):
            server.send(text)
        server.publish("/odom", odometry(1.0, 2.0))
        assert taken_from(odom).x == 1.0
        wait_until(lambda: gps.counts["received"])
        assert (odom.counts["bad"], gps.counts["bad"], ros.counts["bad"]) == (1, 1, 6)
        assert ros.counts["invalid"] == 9
    (record,) = [one for one in caplog.records if one.levelname != "INFO"]
    assert "was skipped (Expecting value: line 1 column 1 (char 0)): b'hello'." in record.getMessage()
    assert all(one.exc_info is None for one in caplog.records)


def test_a_message_that_is_too_long_ends_the_connection_which_is_made_again(server):
    with rosbridge(server.url) as ros:
        odom = ros.feed("/odom")
        wait_until(lambda: server.subscribed)
        server.subscribed.clear()
        server.send(json.dumps({"op": "publish", "topic": "/odom", "msg": {"text": "a" * (1 << 21)}}))
        wait_until(lambda: server.subscribed, 10.0)
        server.publish("/odom", odometry(1.0, 2.0))
        assert taken_from(odom).x == 1.0


def test_a_connection_that_is_lost_is_made_again(server):
    with rosbridge(server.url) as ros:
        odom = ros.feed("/odom", path="/path")
        wait_until(lambda: server.subscribed)
        server.subscribed.clear()
        server.hang_up()
        wait_until(lambda: not ros.is_connected)
        odom.send({"type": "waypoints", "points": [[0, 0]]})
        assert ros.counts["unsent"] == 1
        wait_until(lambda: server.subscribed and server.advertised, 10.0)
        server.publish("/odom", odometry(3.0, 2.0))
        assert taken_from(odom).x == 3.0
        assert ros.is_connected


def test_where_no_server_answers_is_said(server):
    with pytest.raises(NetworkError, match=r"No rosbridge server answers at ws://127.0.0.1:1 within 0.05 s"):
        rosbridge("ws://127.0.0.1:1", timeout_s=0.05)
    with pytest.raises(BadValue, match="begins with ws://"):
        rosbridge("localhost:9090")
    with pytest.raises(BadType, match=r"origin must be \(x, y\)"):
        rosbridge(server.url, origin=3)
    with rosbridge(server.url) as ros, pytest.raises(BadValue, match="Did you mean 'nav_msgs/Odometry'"):
        ros.feed("/odom", "nav_msgs/Odom")


def test_without_the_library_the_error_prints_the_command(monkeypatch):
    monkeypatch.setitem(sys.modules, "roslibpy", None)
    with pytest.raises(MissingExtra, match=r"\(extra 'ros'\): pip install "):
        rosbridge("ws://127.0.0.1:1")
    monkeypatch.setitem(sys.modules, "websockets", None)
    with pytest.raises(MissingExtra, match=r"\(extra 'web'\): pip install "):
        WebSocketServer()
