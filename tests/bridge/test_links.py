"""Links carry lines by UDP, WebSocket and pipes; what strangers send is bounded and counted, and never stops a game."""

import json
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
import websockets
from websockets.sync.client import connect

import gamms
from gamms.bridge import Fix, Process, SimulatedClock, Udp, WebSocketServer, drive, links
from gamms.errors import BadType, BadValue, NetworkError

HOME = "127.0.0.1"


def wait_until(holds, seconds=60.0):
    ends = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < ends, "it has not come"
        time.sleep(0.002)


@pytest.fixture(autouse=True)
def _no_thread_is_left():
    before = set(threading.enumerate())
    yield
    wait_until(lambda: not [one for one in {*threading.enumerate()} - before if one.name.startswith("gamms")])


# -- UDP ------------------------------------------------------------------------------------------------------------


def datagrams():
    """Return a socket that robots and strangers use."""
    one = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    one.bind((HOME, 0))
    one.settimeout(60.0)
    return one


def test_a_robot_that_talks_by_udp_plays_an_agent():
    with datagrams() as robot, Udp(listen=(HOME, 0), to=robot.getsockname()) as link, gamms.create_context() as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(1, 3, spacing=10.0))
        goes = {"strategy": lambda state: state.update(action=1)}
        anna = ctx.agent.create_agent("anna", start_node_id=0, **goes)
        ctx.game.add(drive("anna", link.feed("anna"), limit_s=60.0))

        def play():
            x, y = json.loads(robot.recv(9_999))["points"][-1]
            robot.sendto(json.dumps({"type": "fix", "agent": "anna", "x": x, "y": y}).encode(), link.address)

        thread = threading.Thread(target=play)
        thread.start()
        ctx.game.step()
        thread.join()
        assert (anna.current_node_id, ctx.game.events) == (1, [])


def test_fixes_go_to_the_feed_of_their_agent():
    with Udp(listen=(HOME, 0)) as link, datagrams() as stranger:
        anna, bert = link.feed("anna"), link.feed("bert")
        for agent in ("anna", "bert", "anna", "carl"):
            stranger.sendto(json.dumps({"type": "fix", "agent": agent, "x": 1, "y": 1}).encode(), link.address)
        taken = []
        wait_until(lambda: taken.extend(anna.take()) or link.counts["received"] == 4)
        assert (len(taken), len(bert.take()), link.counts["unknown"]) == (2, 1, 1)


def test_garbage_by_udp_is_counted():
    with Udp(listen=(HOME, 0)) as link, datagrams() as stranger:
        for line in (b"", b"hello", b"[" * 60_000, b"\xff" * 100, b'{"type": "fix", "x": "1"}'):
            stranger.sendto(line, link.address)
        wait_until(lambda: link.feed("anna").take() or link.counts["received"] == 5)
        assert link.counts["bad"] == 5


def test_a_flood_by_udp_takes_a_bounded_time():
    with Udp(listen=(HOME, 0)) as link, datagrams() as stranger:
        feed = link.feed("anna")
        for _ in range(3_000):
            stranger.sendto(b'{"type": "fix", "agent": "anna", "x": 1, "y": 1}', link.address)
        assert len(feed.take()) <= 256
        assert link.counts["received"] <= 1_000


def test_what_cannot_be_sent_by_udp_is_counted():
    with Udp(listen=(HOME, 0)) as listener, Udp(to=listener.address) as link:
        link.send({"type": "note", "text": "a" * 70_000})
        assert link.counts["unsent"] == 1
        link.send({"type": "note"})
        assert link.counts["sent"] == 1
    link.send({"type": "note"})  # it is closed
    assert (link.counts["sent"], link.counts["unsent"]) == (1, 2)
    with Udp(listen=(HOME, 0)) as deaf:
        deaf.send({"type": "note"})
        assert deaf.counts["unsent"] == 1


@pytest.mark.parametrize(
    ("options", "kind", "words"),
    [
        ({}, BadValue, "needs listen="),
        ({"listen": "127.0.0.1:9000"}, BadType, r"listen must be \(host, port\)"),
        ({"to": ("127.0.0.1", 70_000)}, BadValue, "A port must be less than 65536"),
        ({"to": ("127.0.0.1", 65_536)}, BadValue, "A port must be less than 65536"),
        ({"to": ("127.0.0.1", 0)}, BadValue, "A port must be at least 1"),
    ],
)
def test_a_wrong_address_names_a_right_one(options, kind, words):
    with pytest.raises(kind, match=words):
        Udp(**options)


# -- WebSocket ------------------------------------------------------------------------------------------------------


def test_viewers_come_and_go_and_get_the_messages_sent_meanwhile():
    with WebSocketServer() as link:
        link.send({"type": "turn", "turn": 0})
        assert link.counts["unsent"] == 1
        with connect(link.url) as first, connect(link.url) as second:
            wait_until(lambda: link.viewers == 2)
            link.send({"type": "turn", "turn": 1})
            assert json.loads(first.recv(timeout=60)) == {"gamms": 1, "type": "turn", "turn": 1}
            assert json.loads(second.recv(timeout=60))["turn"] == 1
        wait_until(lambda: link.viewers == 0)
        with connect(link.url) as third:
            wait_until(lambda: link.viewers == 1)
            link.send({"type": "turn", "turn": 2})
            assert json.loads(third.recv(timeout=60))["turn"] == 2


def test_a_robot_may_send_fixes_by_websocket():
    with WebSocketServer() as link, connect(link.url) as robot:
        feed, taken = link.feed("anna"), []
        robot.send('{"type": "fix", "agent": "anna", "t": 3, "x": 1, "y": 2}')
        wait_until(lambda: taken.extend(feed.take()) or taken)
        assert taken[0].fix == Fix(t=3.0, x=1.0, y=2.0, agent="anna")


def test_a_peer_that_sends_only_bad_lines_is_disconnected():
    with WebSocketServer() as link, connect(link.url) as stranger:
        with pytest.raises(websockets.ConnectionClosed):
            while True:
                stranger.send("garbage")
        wait_until(lambda: link.viewers == 0)
        assert link.counts["bad"] == 100


def test_a_peer_is_read_no_faster_than_a_thousand_lines_a_second():
    began = time.monotonic()
    with WebSocketServer() as link, connect(link.url, close_timeout=0.1) as stranger:
        for _ in range(1_200):
            stranger.send('{"type": "fix", "agent": "anna", "x": 1, "y": 1}')
        wait_until(lambda: link.counts["received"] == 1_200)
        assert time.monotonic() - began >= 1.0


def test_a_message_that_is_too_long_ends_the_connection():
    with WebSocketServer() as link, connect(link.url) as stranger:
        stranger.send("a" * 100_000)
        with pytest.raises(websockets.ConnectionClosed) as error:
            stranger.recv(timeout=60)
        assert error.value.rcvd.code == 1009


def test_pages_of_other_sites_may_not_connect():
    with WebSocketServer(origins=["http://localhost:8000"]) as link:
        with pytest.raises(websockets.InvalidStatus), connect(link.url, origin="http://evil.example"):
            pass
        with connect(link.url, origin="http://localhost:8000"):
            pass


def test_a_port_that_is_taken_is_an_error_at_once():
    with WebSocketServer() as link, pytest.raises(NetworkError, match=r"Nothing can listen at .* in use"):
        WebSocketServer(int(link.url.rpartition(":")[2]))
    with Udp(listen=(HOME, 0)) as link, pytest.raises(NetworkError, match=r"Nothing can listen at .* in use"):
        Udp(listen=link.address)


def test_a_viewer_that_does_not_read_is_disconnected():
    with WebSocketServer() as link, connect(link.url, max_queue=1, close_timeout=0.1):
        wait_until(lambda: link.viewers == 1)
        wait_until(lambda: link.send({"type": "note", "text": "a" * 60_000}) or not link.viewers)


# -- processes ------------------------------------------------------------------------------------------------------


def program(code):
    return Process([sys.executable, "-c", "import sys, json, time\n" + code])


ANSWER = """
for line in sys.stdin:
    turn = json.loads(line)["turn"]
    print(json.dumps({"type": "roads", "turn": turn, "close": [turn]}), flush=True)
"""


def test_a_process_answers_line_by_line():
    with program(ANSWER) as link:
        for turn in range(3):
            link.send({"type": "turn", "turn": turn})
            assert link.roads(turn, 60.0).close == [turn]


def test_a_process_that_says_nothing_is_waited_for_no_longer_than_is_said():
    with program("sys.stdin.read()") as link:
        began = time.monotonic()
        assert link.roads(0, 0.05) is None
        assert 0.04 < time.monotonic() - began < 60.0  # it would wait for ever


def test_a_link_waits_by_its_clock():
    clock = SimulatedClock()
    with Udp(listen=(HOME, 0), clock=clock) as link:
        assert link.roads(0, 5.0) is None
    assert clock.now() == pytest.approx(5.0)


def test_a_process_that_has_ended_is_not_waited_for():
    with program("") as link:
        assert link.roads(0, 60.0) is None


def test_a_process_that_writes_garbage_and_lines_without_end_is_read_on():
    code = """
sys.stdout.write("a" * 1_000_000 + "\\n")
sys.stdout.write("[" * 50_000 + "\\n\\n")
print(json.dumps({"type": "roads", "turn": 4}), flush=True)
sys.stdin.read()
"""
    with program(code) as link:
        assert link.roads(4, 60.0) is not None
        assert link.counts == {"received": 4, "bad": 3}


def test_a_process_that_reads_nothing_blocks_no_game():
    with program("time.sleep(60)") as link:
        link._process.kill()
        for _ in range(3_000):
            link.send({"type": "note", "text": "a" * 1_000})
        assert link.counts["unsent"]


def test_a_process_that_is_closed_leaves_no_thread_and_has_read_all_its_lines():
    lines = 6_000  # as many as fit into a pipe, which are read when the program has ended
    with program(f"sys.stdin.read(); print('{{}}\\n' * {lines}, end='', flush=True)") as link:
        pass
    assert not [one.name for one in threading.enumerate() if one.name.startswith("gamms lines")]
    assert link.counts["received"] == lines


@pytest.mark.parametrize("code", ["sys.stdin.read()", "time.sleep(60)", "sys.stdout.close(); sys.stdin.close()", ""])
def test_a_process_that_is_closed_has_ended_and_leaves_nothing_open(code, monkeypatch):
    monkeypatch.setattr(links, "_GRACE_S", 0.3)
    with program(code) as link:
        process = link._process
    assert process.returncode is not None
    assert process.stdin.closed
    assert process.stdout.closed
    assert not [one.name for one in threading.enumerate() if one.name.startswith("gamms lines")]
    link.close()  # once more changes nothing
    link.send({"type": "note"})
    assert link.counts["sent"] == 0


def test_a_server_that_is_closed_leaves_no_thread():
    before = {*threading.enumerate()}
    with WebSocketServer() as link, connect(link.url) as viewer:
        viewer.send("{}")
        wait_until(lambda: link.counts["received"])
    assert not [one.name for one in {*threading.enumerate()} - before if one.name.startswith("gamms")]


def test_a_command_is_a_list():
    with pytest.raises(BadType, match="command must be a list of texts"):
        Process("rm -rf")
    with pytest.raises(BadValue, match="must begin with the program"):
        Process([])


HOST = """
import os, signal, sys, threading, time
from gamms.bridge import Process

link = None
def start():
    global link
    link = Process([sys.executable, "-c", "import time; time.sleep(600)"])
starter = threading.Thread(target=start)  # which ends before the program does
starter.start()
starter.join()
print(link._process.pid, flush=True)
sys.stdin.readline()
{end}
"""


@pytest.mark.skipif(sys.platform != "linux", reason="needs prctl")
@pytest.mark.parametrize("end", ["os.kill(os.getpid(), signal.SIGKILL)", "os._exit(0)", "sys.exit()"])
def test_a_program_does_not_outlive_a_game_that_ends_without_closing(end):
    command = [sys.executable, "-c", HOST.format(end=end)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as host:
        child = Path(f"/proc/{int(host.stdout.readline())}")
        assert state_of(child) in "RS"
        host.stdin.write("\n")
        host.stdin.flush()
        host.wait(60)
        wait_until(lambda: state_of(child) in ("", "Z"))


def state_of(process):
    """The letter that Linux has for what a process does; nothing: it is gone."""
    try:
        return (process / "stat").read_text().rpartition(")")[2].split()[0]
    except (FileNotFoundError, ProcessLookupError):
        return ""


def test_a_program_that_is_not_there_is_named():
    with pytest.raises(FileNotFoundError, match="no-such-program"):
        Process(["no-such-program"])


# -- games ----------------------------------------------------------------------------------------------------------


def test_a_robot_that_reconnects_goes_on_playing():
    """Each connection of a robot lasts for one turn."""
    with gamms.create_context(seed=1, logger_config={"level": "ERROR"}) as ctx, WebSocketServer() as link:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(1, 4, spacing=10.0))
        anna = ctx.agent.create_agent(
            "anna", start_node_id=0, strategy=lambda state: state.update(action=max(state["legal"]))
        )
        ctx.game.add(drive("anna", link.feed("anna"), limit_s=60.0))
        ends = []

        def robot():
            for _ in range(3):
                with connect(link.url) as line:
                    message = json.loads(line.recv(timeout=60))
                    ends.append(message["points"][-1])
                    x, y = message["points"][-1]
                    line.send(json.dumps({"type": "fix", "agent": "anna", "x": x, "y": y}))

        thread = threading.Thread(target=robot)
        thread.start()
        for turn in range(3):
            wait_until(lambda: link.viewers == 1)
            ctx.game.step()
            assert anna.current_node_id == turn + 1
            if turn < 2:
                wait_until(lambda turn=turn: len(ends) == turn + 1)
        thread.join()
        assert ends == [[10, 0], [20, 0], [30, 0]]
        assert ctx.game.events == []
