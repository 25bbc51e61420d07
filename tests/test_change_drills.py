"""The table in CONTRIBUTING.md is true: each drill changes the files that it names, in a copy, and the change works."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import gamms

SRC = Path(gamms.__file__).parent


def changed(folder, *changes):
    """Copy the source, compiled as it is, and change it: (file, text that stands there once, text in its place)."""
    copy = folder / "src" / "gamms"
    shutil.copytree(SRC, copy)
    for file, before, after in changes:
        path = copy / file
        text = path.read_text()
        assert text.count(before) == 1, f"{file}: {before!r}"
        path.write_text(text.replace(before, after))
    return copy.parent


def printed(source, folder, program):
    environment = {**os.environ, "PYTHONPATH": str(source), "PYTHONDONTWRITEBYTECODE": "1"}
    return subprocess.check_output([sys.executable, "-c", program], cwd=folder, env=environment, text=True).strip()


PROPERTY = """    battery = property(
        lambda self: self._block.battery[self._row],
        lambda self, value: self._set("battery", float(value)),
    )

"""


def with_battery(folder):
    """A copy of the source in which agents have a battery, which is recorded."""
    return changed(
        folder,
        ("ir/agents.py", "NUMBERS: dict[str, tuple[type, Any]] = {}", 'NUMBERS = {"battery": (np.float64, 1.0)}'),
        (
            "ir/events.py",
            "AGENT_SPEED = ",
            'AGENT_BATTERY = _column(0x01100015, "AGENT_BATTERY", _TEAM, "battery", "battery")\nAGENT_SPEED = ',
        ),
        ("agent/agent.py", '"orientation", "speed", "team"})', '"orientation", "speed", "team", "battery"})'),
        (
            "agent/agent.py",
            "    @property\n    def state(self)",
            PROPERTY + "    @property\n    def state(self)",
        ),
    )


def test_an_attribute_that_is_recorded_takes_three_files(tmp_path):
    source = with_battery(tmp_path)
    program = """
import gamms

with gamms.create_context(seed=1) as ctx:
    ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 3))
    anna = ctx.agent.create_agent("anna", start_node_id=0)
    ctx.game.add(lambda ctx: setattr(anna, "battery", anna.battery - 0.25))
    ctx.record.start("game")
    ctx.game.step()
    ctx.game.step()
    ctx.record.stop()
    snapshot = ctx.game.snapshot()
    anna.battery = 0.0
    ctx.game.restore(snapshot)
    print(anna.battery)
with gamms.recorder.open("game.ggr") as recording:
    print([float(recording.state(turn).agents["battery"][0]) for turn in range(3)])
with gamms.create_context() as ctx:
    for _ in ctx.record.replay("game.ggr"):
        pass
    print(ctx.agent.get_agent("anna").battery)
"""
    assert printed(source, tmp_path, program) == "0.5\n[1.0, 0.75, 0.5]\n0.5"


def test_a_recorded_attribute_is_that_of_its_own_game_in_batches(tmp_path):
    program = """
import gamms

def drain(ctx):
    anna = ctx.agent.get_agent("anna")
    anna.battery -= 0.1 if anna.current_node_id % 2 else 0.05
    if anna.battery <= 0.0:
        ctx.game.end("the battery is empty")

with gamms.create_context(seed=1, game={"max_turns": 40}) as ctx:
    ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 3))
    ctx.agent.create_agent("anna", start_node_id=0, strategy=gamms.strategies.random_walk)
    ctx.game.add(drain)
    with ctx.game.batch(seeds=range(5)) as games:
        while games.step().any():
            pass
        together = [games.result(number).turns for number in range(5)]
    alone = []
    for seed in range(5):
        ctx.game.reset(seed=seed)
        alone.append(ctx.game.run().turns)
    print(together == alone, len(set(alone)) > 1)
"""
    assert printed(with_battery(tmp_path), tmp_path, program) == "True True"


GUIDE = (Path(__file__).parents[1] / "CONTRIBUTING.md").read_text(encoding="utf-8")
COUNT = '''
"""AGENT_COUNT: how many other agents are near."""

from gamms.ir.sensed import SensorView
from gamms.sensor.ground import AgentSensor


class AgentCountSensor(AgentSensor):
    """`data`: the number of other agents in range."""

    def sense(self, node_id=None):
        """Count them."""
        super().sense(node_id)
        self._last[0] = len(self._last[0])

    def last_view(self):
        """Let it be drawn where it looks; the agents are no longer in its data."""
        return SensorView(outline=self.outline())
'''

KIND = "    SensorType.AGENT_COUNT: Kind(AgentCountSensor, _RANGE, _DETECTION),\n"


def test_a_kind_of_sensor_takes_one_file_and_a_line_in_the_catalog(tmp_path):
    assert COUNT in GUIDE
    assert KIND in GUIDE
    source = changed(
        tmp_path,
        ("typing/sensor_engine.py", "    CUSTOM = 0\n", "    CUSTOM = 0\n    AGENT_COUNT = 99\n"),
        (
            "sensor/catalog.py",
            "from gamms.sensor.ground ",
            "from gamms.sensor.count import AgentCountSensor\nfrom gamms.sensor.ground ",
        ),
        (
            "sensor/catalog.py",
            "    SensorType.AGENT_RANGE: ",
            f"{KIND}    SensorType.AGENT_RANGE: ",
        ),
    )
    (source / "gamms" / "sensor" / "count.py").write_text(COUNT.lstrip())
    program = """
import gamms
from gamms.sensor import SensorType

with gamms.create_context(seed=1, logger_config={"filename": "log"}) as ctx:
    ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 3))
    ctx.sensor.create_sensor("c", SensorType.AGENT_COUNT, sensor_range=10)
    for name, node in {"anna": 0, "ben": 1, "cleo": 8}.items():
        ctx.agent.create_agent(name, start_node_id=node, sensors=["c"] if name == "anna" else [])
    print(ctx.agent.get_agent("anna").get_state()["sensor"]["c"][1])
    gamms.testing.check_sensor(ctx.sensor.get_sensor("c"), 0)
    ctx.visual.save("seen.svg")
"""
    assert printed(source, tmp_path, program) == "1"
    assert "could not be drawn" not in (tmp_path / "log").read_text()
