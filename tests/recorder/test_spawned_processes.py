"""A game is recorded in a spawned process as in the program itself, byte by byte."""

import subprocess
import sys

from gamms import recorder

PROGRAM = """
import multiprocessing, sys
from pathlib import Path

import gamms


def walk(state):
    state["action"] = state["legal"][-1]


def play(file):
    with gamms.create_context(seed=1, logger_config={"level": "ERROR"}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 3))
        ctx.agent.create_agent("anna", start_node_id=0, team="red", strategy=walk)

        @ctx.record.component(struct={"a": int})
        class Counter:
            def __init__(self):
                self.a = 0

        ctx.record.start(file)
        Counter("one").a = 1
        ctx.game.run(2)
        ctx.record.stop()


if __name__ == "__main__":
    play("here.ggr")
    child = multiprocessing.get_context("spawn").Process(target=play, args=("there.ggr",))
    child.start()
    child.join()
"""


def test_a_recording_of_a_spawned_process_has_the_same_bytes(tmp_path):
    (tmp_path / "program.py").write_text(PROGRAM)
    subprocess.run([sys.executable, "program.py"], cwd=tmp_path, check=True, timeout=60)
    with recorder.open(tmp_path / "there.ggr") as recording:
        assert recording[0].agents["strategy"].tolist() == ["__main__:walk"]
    assert (tmp_path / "there.ggr").read_bytes() == (tmp_path / "here.ggr").read_bytes()
