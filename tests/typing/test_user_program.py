"""What a type checker makes of a user's program."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

TUTORIAL = Path(__file__).with_name("tutorial.py.txt")  # what docs/tutorial.md does, annotated


PACKAGES = """
import gamms

ctx = gamms.create_context(seed=1)
gamms.osm.helsinki(ctx)
gamms.strategies.chase(ctx, otherwise=gamms.strategies.stay)
gamms.rules.tag("red", "blue")
gamms.scenario.load("game.yaml").play(seed=7)
gamms.recorder.open("game.ggr")
gamms.rulez
"""
ERRORS = """
import gamms
from gamms.sensor import SensorType

ctx = gamms.create_context(seed=1)
ctx.sensor.create_sensor("a", SensorType.RANGE, range=5.0)  # error
ctx.sensor.create_sensor("b", SensorType.RANGE, sensor_range="far")  # error
ctx.sensor.create_sensor("c", SensorType.RANGE, sensor_range=5.0)
ctx.sensor.create_sensor("d", SensorType.RANGE).observer_height  # error
ctx.sensor.create_sensor("e", SensorType.OCCLUDED_MAP).observer_height
ctx.agent.create_agent("f", start_node=0)  # error
ctx.agent.create_agent("g", start_node_id="0")  # error
ctx.agent.create_agent("h", start_node_id=0, sensors=5)  # error
ctx.agent.create_agent("i", type=gamms.agent.AgentType.AERIAL, start_node_id=0, position=5)  # error
ctx.agent.create_agent("j", start_node_id=0, home=0, energy=7)


def strategy(state: gamms.typing.State) -> None:
    state["action"] = "north"  # error
    state["acton"] = 3  # error
    state["legal"].append(3)  # error
    state["action"] = state["current_node"]  # error
    state["action"] = state["curr_pos"] + state["turn"]
    state["outbox"].append({"channel": "radio", "to": "red", "text": "hello"})  # error
    state["outbox"].append({"channel": "radio", "to": "red", "body": [message["turn"] for message in state["inbox"]]})


def misnamed(state: gamms.typing.Stat) -> None:  # error
    pass


def rule(ctx: gamms.Context) -> None:
    ctx.gme.end("over")  # error
    ctx.agent.create_itr()  # error
    ctx.game.end("over")
    ctx.game.eliminate(5)  # error
    ctx.game.agents[0].name.real  # error
    ctx.game.agents["red_0"]  # error
    ctx.game.eliminate(ctx.game.agents[0])


def flying(state: gamms.typing.AerialState) -> None:
    state["action"] = 3  # error


ctx.agent.create_agent("k", start_node_id=0, strategy=flying)  # error
ctx.agent.create_agent("l", start_node_id=0, strategy=rule)  # error
ctx.game.add(rule)
ctx.game.add(5)  # error
ctx.game.add_channel("radio", range=50)  # error
ctx.game.add_channel("radio", range_m=50, loss=[(0, 0.1), (50, 0.5)], jammers=[{"agent": "g", "radius_m": 5}])
gamms.strategies.chase(ctx, otherwse=None)  # error
ctx.visual.set_graph_visual(node_size=2, edge_color="red", draw_id=True).set_layer(3)
ctx.visual.set_graph_visual(node_sise=2.0)  # error
ctx.visual.set_graph_visual(edge_color=5)  # error
ctx.visual.set_agent_visual("f", colour="red")  # error
ctx.visual.set_agent_visual("f", color=(1, 2, 3), size=3.0, image_path=None)
ctx.visual.set_agent_visual("f", size="large")  # error
ctx.visual.set_sensor_visual("a", node_color="red", layer=30)
ctx.visual.set_sensor_visual("a", layers=30)  # error
ctx.visual.set_obstacle_visual(color_map={1: "red"}, fill=True)
ctx.visual.set_obstacle_visual(color_map="red")  # error
ctx.visual.set_values(nodes={0: 1.0}, cmap="magma")
ctx.visual.set_values(node={0: 1.0})  # error
ctx.visual.save("a.png", widht=100)  # error
gamms.rules.tag("red", "blue", meters=5)  # error
gamms.rules.tag("red", "blue", metres="near")  # error
gamms.rules.reach("red", [0], winner="blue").add  # error
"""
RESUMED = """
import gamms


def stay(state: gamms.typing.State) -> None:
    state["action"] = state["curr_pos"]


def scores(ctx: gamms.Context) -> dict[str, float]:
    return {str(team): score for team, score in ctx.game.scores.items()}


with gamms.recorder.open("game.ggr") as recording:
    with recording.resume(20, {"red": stay}, seed=3, vis_engine=gamms.visual.Engine.NO_VIS) as ctx:
        ctx.agent.create_iter()
        ctx.game.run(max_turns=5)
        ctx.gme.run()  # error
        ctx.agents  # error
        ctx.seed.real + ctx.seed.name  # error
    with recording.resume(20, ctx=gamms.create_context(seed=1)) as own:
        scores(own)
        own.game.end("over")
        own.game.edn("over")  # error
        own.agent.create_itr()  # error
    recording.resume(20, {"red": 5})  # error
    recording.resume(20, ctx=5)  # error
    recording.resume(20, vis_engine=gamms.visual.Engine.NO_VIS, ctx=own)  # error
"""


@pytest.fixture(scope="module")
def said(tmp_path_factory):
    """What mypy prints of each program; it is asked once, because most of its time goes to reading GAMMS."""
    folder = tmp_path_factory.mktemp("programs")
    programs = {
        "packages.py": PACKAGES,
        "tutorial.py": TUTORIAL.read_text(),
        "errors.py": ERRORS,
        "resumed.py": RESUMED,
    }
    for name, program in programs.items():
        (folder / name).write_text(program)
    command = [sys.executable, "-m", "mypy", "--strict", "--cache-dir", str(folder / "cache"), *programs]
    output = subprocess.run(command, check=False, cwd=folder, text=True, capture_output=True).stdout
    *lines, end = output.splitlines()
    assert "checked 4 source files" in end
    return {name: [line for line in lines if line.startswith(f"{name}:")] for name in programs}


def test_every_package_is_typed_after_import_gamms_and_misspelt_names_are_errors(said):
    [line] = [line for line in said["packages.py"] if "error" in line]
    assert 'Module has no attribute "rulez"' in line


def test_the_program_of_the_tutorial_is_typed_to_the_end(said):
    assert said["tutorial.py"] == []


@pytest.mark.parametrize(("name", "program"), [("errors.py", ERRORS), ("resumed.py", RESUMED)])
def test_a_wrong_keyword_or_key_is_an_error_at_its_line(said, name, program):
    wanted = {number for number, line in enumerate(program.splitlines(), 1) if line.endswith("# error")}
    found = {int(re.match(rf"{name}:(\d+): error", line)[1]) for line in said[name] if ": error" in line}
    assert found == wanted
