"""A window on a real screen, with a real pointer: where Xvfb and xdotool are installed."""

import json
import os
import shutil
import signal
import subprocess
import sys
from contextlib import contextmanager
from ctypes.util import find_library
from time import sleep

import pytest

from gamms import recorder, recordings

pytestmark = pytest.mark.skipif(
    not (shutil.which("Xvfb") and shutil.which("xdotool")), reason="needs Xvfb and xdotool (Debian: xvfb, xdotool)"
)

WORLD = """
import json
import sys
import gamms

ctx = gamms.create_context(
    vis_engine=gamms.visual.Engine.PYGAME,
    vis_kwargs={"width": 640, "height": 360, "simulation_time_constant": 0.1, "title": "real"},
    logger_config={"level": "ERROR"},
)
ctx.graph.graph.add_nodes([0, 1, 2], x=[0, 10, 10], y=[0, 0, 10])
ctx.graph.graph.add_edges([0, 1, 2], sources=[0, 1, 0], targets=[1, 2, 2])
ctx.agent.create_agent("anna", start_node_id=0)
anna, view = ctx.agent.get_agent("anna"), ctx.visual._render_manager


def say(**facts):
    camera = [view.camera_x, view.camera_y, view.camera_size]
    places = [view.world_to_screen(*xy) for xy in ctx.graph.graph.positions([0, 1, 2]).tolist()]
    print(json.dumps({"camera": camera, "places": places, **facts}), flush=True)

"""

PLAYER = """
ctx.visual.update()
say()
while not ctx.is_terminated():
    state = anna.get_state()
    state["action"] = ctx.visual.human_input("anna", state)
    anna.set_state()
    ctx.visual.simulate()
    if not ctx.is_terminated():
        say(node=anna.current_node_id, pinned=ctx.visual.overlay.describe_pointed() is not None)
"""

LOOP_OF_THE_PAPER = """
ctx.record.start(sys.argv[1])
turns = 0
while not ctx.is_terminated():
    state = anna.get_state()
    state["action"] = 1 - state["curr_pos"] if state["curr_pos"] < 2 else 2
    anna.set_state()
    ctx.visual.simulate()
    turns += 1
    if not ctx.is_terminated():
        say(turns=turns, size=ctx.visual._screen.get_size())
print(json.dumps({"turns": turns}))
"""


A_GAME = """
import os
import sys
import gamms

case = sys.argv[1]
if case == "a test":
    os.environ["CI"] = "1"
options = {"width": 640, "height": 360, "simulation_time_constant": 0.05, "stay_open": case != "stay_open=False"}
ctx = gamms.create_context(vis_engine="PYGAME", vis_kwargs=options, logger_config={"level": "ERROR"}, seed=1)
ctx.graph.graph.add_nodes([0, 1, 2], x=[0, 10, 10], y=[0, 0, 10])
ctx.graph.graph.add_edges([0, 1, 2], sources=[0, 1, 2], targets=[1, 2, 0])
ctx.agent.create_agent("anna", start_node_id=0, team="red", strategy=gamms.strategies.random_walk)
if case == "a loop of one's own":
    for _ in range(2):
        ctx.game.step()
elif case == "a rule":
    ctx.game.add(gamms.rules.time_limit(2))
    while not ctx.game.is_over:
        ctx.game.step()
else:
    ctx.game.run(max_turns=2)
if case == "terminate":
    ctx.terminate()
if case == "an exception":
    raise RuntimeError("a mistake")
if case == "an interpreter":
    sys.ps1 = ">>> "
print("done", ctx.is_terminated(), flush=True)
ctx.visual.hud = lambda _: print("frame", flush=True) or []
"""

CLOSE = """
import sys
from ctypes import *

class Message(Structure):
    _fields_ = [("type", c_int), ("serial", c_ulong), ("send_event", c_int), ("display", c_void_p),
                ("window", c_ulong), ("kind", c_ulong), ("format", c_int), ("data", c_long * 5), ("rest", c_long * 24)]

x11 = CDLL(sys.argv[1])
x11.XOpenDisplay.restype, x11.XInternAtom.restype = c_void_p, c_ulong
screen, window = c_void_p(x11.XOpenDisplay(None)), c_ulong(int(sys.argv[2]))
protocols, delete = (x11.XInternAtom(screen, name, 0) for name in (b"WM_PROTOCOLS", b"WM_DELETE_WINDOW"))
message = Message(33, 0, 1, None, window, protocols, 32, (c_long * 5)(delete, 0))
assert x11.XSendEvent(screen, window, 0, c_long(0), byref(message))
x11.XCloseDisplay(screen)
"""  # as a window manager does when a person clicks on the cross


@pytest.fixture(scope="module")
def screen():
    """A screen of its own; the environment that leads to it."""
    read, write = os.pipe()
    command = ["Xvfb", "-displayfd", str(write), "-screen", "0", "800x600x24", "-nolisten", "tcp", "-noreset"]
    with subprocess.Popen(command, pass_fds=[write], stderr=subprocess.DEVNULL) as server:
        os.close(write)
        with os.fdopen(read) as number:
            display = f":{number.readline().strip()}"
        yield {**os.environ, "DISPLAY": display, "SDL_VIDEODRIVER": "x11"}
        server.terminate()


@pytest.fixture
def do(screen):
    """Does what a person or a window manager does, by xdotool."""

    def do(*words):
        command = ["xdotool", *map(str, words)]
        return subprocess.run(command, env=screen, check=True, timeout=60, capture_output=True, text=True).stdout

    return do


@pytest.fixture
def find(screen):
    """Finds the window: the only one beside the root, which was there first."""

    def windows(is_wanted):
        search = ["xdotool", "search", "--onlyvisible", "--class", ".*"]
        for _ in range(600):
            found = subprocess.run(search, env=screen, check=False, timeout=60, capture_output=True).stdout.split()
            if (len(found) > 1) is is_wanted:
                return found
            sleep(0.1)
        return pytest.fail("no window appears" if is_wanted else "the window of another test stays")

    windows(is_wanted=False)  # that of a program that was just killed goes a little later

    def find():
        return windows(is_wanted=True)[-1].decode()

    return find


@contextmanager
def played(screen, program, *words):
    """A program that opens the window; it is ended at the latest with the block."""
    command = [sys.executable, "-c", WORLD + program, *map(str, words)]
    with subprocess.Popen(command, env=screen, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as player:
        try:
            yield player
        finally:
            player.kill()


def heard(player):
    return json.loads(player.stdout.readline())


def test_a_person_plays_with_keys_and_mouse_until_the_program_is_ended(screen, do, find):
    with played(screen, PLAYER) as player:
        first, window = heard(player), find()
        do("windowfocus", "--sync", window)
        do("mousemove", "--window", window, 320, 10, "click", 4)  # one notch nearer
        do("key", "2")
        after_key = heard(player)
        assert after_key["node"] == 2
        assert after_key["camera"] != first["camera"]

        do("mousemove", "--window", window, 20, 300, "mousedown", 1)
        do("mousemove", "--window", window, 50, 320, "mouseup", 1)
        do("key", "0")
        after_drag = heard(player)
        moved = [b - a for a, b in zip(after_key["places"][2], after_drag["places"][2], strict=True)]
        assert moved == pytest.approx([30, 20], abs=1.5)

        do("mousemove", "--window", window, *map(round, after_drag["places"][2]), "click", 1)
        after_click = heard(player)
        assert after_click["node"] == 2
        assert after_click["pinned"]  # the pointer is on the agent

        player.terminate()
        assert player.wait(60) == -signal.SIGTERM, player.stderr.read()


def close(screen, window):
    """Ask a window to close, as the cross in its frame does."""
    subprocess.run([sys.executable, "-c", CLOSE, find_library("X11"), window], env=screen, check=True, timeout=60)


@pytest.mark.skipif(find_library("X11") is None, reason="needs libX11")
def test_closing_the_window_ends_the_loop_of_the_paper_and_its_recording_is_whole(screen, find, tmp_path):
    with played(screen, LOOP_OF_THE_PAPER, tmp_path / "game") as player:
        window = find()
        heard(player)
        close(screen, window)
        rest, errors = player.communicate(timeout=60)
        assert (player.returncode, errors) == (0, "")
        *_, last = map(json.loads, rest.splitlines())
    recordings.verify(tmp_path / "game.ggr")
    with recorder.open(tmp_path / "game.ggr") as game:
        assert game.turns == last["turns"]


@contextmanager
def a_game(screen, case):
    """A program that plays a game in a window and does not end its context; where a person may be looking."""
    environment = {name: value for name, value in screen.items() if name != "CI"}
    command = [sys.executable, "-c", A_GAME, case]
    with subprocess.Popen(
        command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as player:
        try:
            yield player
        finally:
            player.kill()


@pytest.mark.skipif(find_library("X11") is None, reason="needs libX11")
@pytest.mark.parametrize("case", ["run", "a rule"])
def test_the_window_of_a_game_that_is_over_stays_open_at_the_end_of_the_program(screen, find, case):
    with a_game(screen, case) as player:
        window = find()
        assert player.stdout.readline() == "done False\n"
        assert {player.stdout.readline() for _ in range(8)} == {"frame\n"}
        close(screen, window)
        assert (player.wait(60), player.stderr.read()) == (0, "")


def test_ctrl_c_ends_a_program_whose_window_stays_open(screen, find):
    with a_game(screen, "run") as player:
        find()
        assert [player.stdout.readline() for _ in range(2)] == ["done False\n", "frame\n"]
        player.send_signal(signal.SIGINT)
        assert (player.wait(60), player.stderr.read()) == (0, "")


@pytest.mark.parametrize(
    "case",
    ["terminate", "stay_open=False", "a loop of one's own", "an exception", "an interpreter", "a test"],
)
def test_a_program_with_a_window_ends_by_itself_after(screen, case):
    with a_game(screen, case) as player:
        printed, errors = player.communicate(timeout=60)
    assert (player.returncode == 0) == (printed != "") == (case != "an exception"), errors


@pytest.mark.skipif(find_library("X11") is None, reason="needs libX11")
def test_closing_the_window_in_a_question_ends_the_program(screen, find):
    with played(screen, PLAYER) as player:
        heard(player)
        close(screen, find())
        rest, errors = player.communicate(timeout=60)
        assert (player.returncode, rest, errors) == (0, "", "")
