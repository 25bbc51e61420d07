"""A window on a real screen, with a real pointer: where Xvfb and xdotool are installed."""

import json
import os
import shutil
import signal
import subprocess
import sys
from time import sleep

import pytest

pytestmark = pytest.mark.skipif(
    not (shutil.which("Xvfb") and shutil.which("xdotool")), reason="needs Xvfb and xdotool (Debian: xvfb, xdotool)"
)

PLAYER = """
import json
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
ctx.visual.update()


def say(**facts):
    camera = [view.camera_x, view.camera_y, view.camera_size]
    places = [view.world_to_screen(*xy) for xy in ctx.graph.graph.positions([0, 1, 2]).tolist()]
    print(json.dumps({"camera": camera, "places": places, **facts}), flush=True)


say()
while not ctx.is_terminated():
    state = anna.get_state()
    state["action"] = ctx.visual.human_input("anna", state)
    anna.set_state()
    ctx.visual.simulate()
    if not ctx.is_terminated():
        say(node=anna.current_node_id, pinned=ctx.visual.pointed_at() is not None)
"""


@pytest.fixture(scope="module")
def screen():
    """A screen of its own; the environment that leads to it."""
    read, write = os.pipe()
    command = ["Xvfb", "-displayfd", str(write), "-screen", "0", "800x600x24", "-nolisten", "tcp"]
    with subprocess.Popen(command, pass_fds=[write], stderr=subprocess.DEVNULL) as server:
        os.close(write)
        with os.fdopen(read) as number:
            display = f":{number.readline().strip()}"
        yield {**os.environ, "DISPLAY": display, "SDL_VIDEODRIVER": "x11"}
        server.terminate()


def test_a_person_plays_with_keys_and_mouse_until_the_program_is_ended(screen):
    def do(*words):
        subprocess.run(["xdotool", *map(str, words)], env=screen, check=True, timeout=20, capture_output=True)

    def find():
        """The window: the only one beside the root, which was there first."""
        search = ["xdotool", "search", "--onlyvisible", "--class", ".*"]
        for _ in range(100):
            found = subprocess.run(search, env=screen, check=False, timeout=20, capture_output=True).stdout.split()
            if len(found) > 1:
                return found[-1].decode()
            sleep(0.1)
        pytest.fail("no window appears")

    with subprocess.Popen(
        [sys.executable, "-c", PLAYER], env=screen, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as player:
        try:
            first = json.loads(player.stdout.readline())
            window = find()
            do("windowfocus", "--sync", window)
            do("mousemove", "--window", window, 320, 10, "click", 4)  # one notch nearer
            do("key", "2")
            after_key = json.loads(player.stdout.readline())
            assert after_key["node"] == 2
            assert after_key["camera"][2] < first["camera"][2]

            do("mousemove", "--window", window, 20, 300, "mousedown", 1)
            do("mousemove", "--window", window, 50, 320, "mouseup", 1)
            do("key", "0")
            after_drag = json.loads(player.stdout.readline())
            moved = [b - a for a, b in zip(after_key["places"][2], after_drag["places"][2], strict=True)]
            assert moved == pytest.approx([30, 20], abs=1.5)

            do("mousemove", "--window", window, *map(round, after_drag["places"][2]), "click", 1)
            after_click = json.loads(player.stdout.readline())
            assert after_click["node"] == 2
            assert after_click["pinned"]  # the pointer is on the agent

            player.terminate()
            assert player.wait(20) == -signal.SIGTERM, player.stderr.read()
        finally:
            player.kill()
