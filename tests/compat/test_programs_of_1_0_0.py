"""Programs written for 1.0.0 run unchanged and come out as they did there.

`programs/<name>.py` leaves what happened in `outcome`; `programs/<name>.json` is what 1.0.0 made of it. To pin a new
program, run it in an environment of its own that holds gamms==1.0.0:

    python -c "import json, runpy, sys; print(json.dumps(runpy.run_path(sys.argv[1])['outcome']))" <name>.py
"""

import functools
import json
import runpy
from pathlib import Path

import pytest

import gamms

PROGRAMS = sorted((Path(__file__).parent / "programs").glob("*.py"))


def test_there_are_programs():
    assert len(PROGRAMS) >= 5


@pytest.mark.parametrize("engine", list(gamms.graph.Engine), ids=lambda engine: engine.name)
@pytest.mark.parametrize("path", PROGRAMS, ids=lambda path: path.stem)
def test_a_program_comes_out_as_in_1_0_0(path, engine, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    for name in ("SDL_VIDEODRIVER", "SDL_AUDIODRIVER"):  # which programs set, to need no device
        monkeypatch.setenv(name, "dummy")
    monkeypatch.setattr(gamms, "create_context", functools.partial(gamms.create_context, graph_engine=engine))
    outcome = runpy.run_path(str(path))["outcome"]
    assert json.loads(json.dumps(outcome)) == json.loads(path.with_suffix(".json").read_text())
    assert list(tmp_path.iterdir()) == []


def test_where_1_0_0_stopped_with_a_traceback_the_loop_ends_quietly():
    ctx = gamms.create_context(logger_config={"level": "CRITICAL"})
    for node in range(3):
        ctx.graph.graph.add_node({"id": node, "x": node, "y": 0})
    for node in range(2):
        ctx.graph.graph.add_edge({"id": node, "source": node, "target": node + 1, "length": 1.0})
    ctx.sensor.create_sensor("near", gamms.sensor.SensorType.NEIGHBOR)
    for name in ("first", "second", "third"):
        ctx.agent.create_agent(name, start_node_id=0, sensors=["near"])

    def capture_rule(agent):
        if agent.name == "second" and agent.current_node_id == 2:
            ctx.terminate()

    turns = 0
    while not ctx.is_terminated():
        turns += 1
        for agent in ctx.agent.create_iter():
            state = agent.get_state()
            state["action"] = max(state["sensor"]["near"][1])
            agent.set_state()
            capture_rule(agent)
        ctx.visual.simulate()
        for agent in ctx.agent.create_iter():  # a rule that runs after the end
            if agent.current_node_id == 2:
                agent.current_node_id = agent.prev_node_id = 0
    assert turns == 2
    assert [agent.current_node_id for agent in ctx.agent.create_iter()] == [2, 2, 1]
