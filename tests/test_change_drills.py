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


BATTERY = """    Column(
        "battery",
        np.float64,
        initial=1.0,
        event=ChangeEvent(0x01100015, "AGENT_BATTERY", Audience.TEAM, "battery"),
    ),
"""


def with_battery(folder):
    """A copy of the source in which agents have a battery, which is recorded."""
    before = '    Column("sensors", '
    return changed(folder, ("ir/schema.py", before, BATTERY + before))


def test_a_number_of_agents_that_is_recorded_is_one_entry_of_the_schema(tmp_path):
    source = with_battery(tmp_path)
    program = """
import gamms

def drain(ctx):
    ctx.agent.get_agent("anna").battery -= 0.25

with gamms.create_context(seed=1) as ctx:
    ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 3))
    anna = ctx.agent.create_agent("anna", start_node_id=0)
    ctx.game.add(drain)
    ctx.record.start("game")
    ctx.game.step()
    ctx.agent.create_agent("ben", start_node_id=1, battery=0.875)
    ctx.game.step()
    ctx.record.stop()
    snapshot = ctx.game.snapshot()
    ahead = ctx.game.fork(seed=2)
    ahead.step()
    print(anna.battery, ahead.agents[0].battery)
    anna.battery = 0.0
    ctx.game.restore(snapshot)
    print(anna.battery)
    try:
        anna.battery = "full"
    except gamms.errors.BadType as error:
        print(error)
with gamms.recorder.open("game.ggr") as recording:
    print([recording.state(turn).agents["battery"].tolist() for turn in range(3)])
    with recording.resume(2) as ctx:
        print([agent.battery for agent in ctx.agent.create_iter()])
with gamms.create_context() as ctx:
    for _ in ctx.record.replay("game.ggr"):
        pass
    print([agent.battery for agent in ctx.agent.create_iter()])
"""
    assert printed(source, tmp_path, program).splitlines() == [
        "0.5 0.25",
        "0.5",
        "battery must be a number, not 'full' (str).",
        "[[1.0], [0.75], [0.5, 0.875]]",
        "[0.5, 0.875]",
        "[0.5, 0.875]",
    ]


AXES = """    Column("mobility", np.int64, 2),
    Column("scratch", np.int64, 7, is_copied=False, is_recorded=False),
    Column("fuel", np.float64, 1.0, axis="team"),
    Column("wind", np.float64, 0.0, shape=(2,), axis="game"),
"""


def test_a_number_of_agents_teams_or_games_is_one_entry_of_the_schema(tmp_path):
    before = '    Column("sensors", '
    source = changed(tmp_path, ("ir/schema.py", before, AXES + before))
    program = """
import gamms

def shown(ctx):
    game = ctx.agent.block.games
    return [game.row(name).tolist() for name in ("mobility", "scratch", "fuel", "wind")]

with gamms.create_context(seed=1) as ctx:
    ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 3))
    anna = ctx.agent.create_agent("anna", start_node_id=0, team="red")
    ben = ctx.agent.create_agent("ben", start_node_id=0, team="blue", mobility=3)
    print(shown(ctx))
    anna.scratch, game = 5, ctx.agent.block.games
    game.row("fuel")[1], game.row("wind")[0] = 0.5, 2.5
    now, snapshot = shown(ctx), ctx.game.snapshot()
    ctx.record.start("game")
    ctx.game.step()
    ctx.record.stop()
    game.row("fuel")[0], game.row("wind")[1], anna.mobility, ben.team = 4.0, 1.0, 9, "green"
    print(shown(ctx))
    ctx.game.restore(snapshot)
    print(shown(ctx) == [now[0], [7, 7], *now[2:]], shown(ctx.game.fork(seed=2).ctx) == shown(ctx))
    print(shown(ctx))
with gamms.recorder.open("game.ggr") as recording:
    print(sorted(recording.state(0).agents.keys() & {"mobility", "scratch"}))
    with recording.resume(1) as ctx:
        print(shown(ctx))
"""
    assert printed(source, tmp_path, program).splitlines() == [
        "[[2, 3], [7, 7], [1.0, 1.0], [0.0, 0.0]]",
        "[[9, 3], [5, 7], [4.0, 0.5, 1.0], [2.5, 1.0]]",
        "True True",
        "[[2, 3], [7, 7], [1.0, 0.5], [2.5, 0.0]]",
        "['mobility']",
        "[[2, 3], [7, 7], [1.0, 0.5], [2.5, 0.0]]",
    ]


def test_a_number_of_agents_is_that_of_its_own_game_in_batches(tmp_path):
    program = """
import gamms

def drain(ctx):
    anna = ctx.agent.get_agent("anna")
    anna.battery -= 0.125 if anna.current_node_id % 2 else 0.0625
    if anna.battery <= 0.0:
        ctx.game.end("the battery is empty")

with gamms.create_context(seed=1, game={"max_turns": 40}) as ctx:
    ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 3))
    anna = ctx.agent.create_agent("anna", start_node_id=0, team="red", strategy=gamms.strategies.random_walk)
    ctx.game.add(drain)
    ctx.game.step()
    with ctx.game.batch(seeds=range(5)) as games:
        while games.step().any():
            pass
        together = [games.result(number).turns for number in range(5)]
    fork, alone = ctx.game.fork(0), []
    for seed in range(5):
        fork.reset(seed=seed)
        alone.append(fork.run().turns)
    print(together == alone, len(set(alone)) > 1)
    ctx.game.remove(drain)
    with ctx.game.batch(seeds=range(2)) as games:
        moment = games.columns()
        print(moment["battery"].tolist() == [[anna.battery]] * 2 != [[1.0]] * 2)
        games.load({**moment, "battery": moment["battery"] / 2}, turn=1)
        print(games.columns()["battery"].tolist() == [[anna.battery / 2]] * 2)
"""
    printed_lines = printed(with_battery(tmp_path), tmp_path, program).splitlines()
    assert printed_lines == ["True True", "True", "True"]


def test_a_number_of_agents_stays_in_its_game_in_the_core(tmp_path):
    program = """
import gamms

def drain(ctx):
    anna = ctx.agent.get_agent("anna")
    anna.battery -= 0.125 if anna.current_node_id % 2 else 0.0625
    if anna.battery <= 0.0:
        ctx.game.end("the battery is empty")

with gamms.create_context(seed=1, game={"max_turns": 40}) as ctx:
    ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 3))
    ctx.agent.create_agent("anna", start_node_id=0, team="red", strategy=gamms.strategies.random_walk)
    ctx.game.add(drain)
    with ctx.game.batch(seeds=range(5)) as games:
        games.run()
        together = [games.result(number).turns for number in range(5)]
        print(games.slow, games.detached)
    fork, alone = ctx.game.fork(0), []
    for seed in range(5):
        fork.reset(seed=seed)
        alone.append(fork.run().turns)
    print(together == alone, len(set(alone)) > 1)
"""
    printed_lines = printed(with_battery(tmp_path), tmp_path, program).splitlines()
    assert printed_lines == ["the rule 'drain' {}", "True True"]


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
