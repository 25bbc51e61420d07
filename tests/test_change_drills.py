"""The table in CONTRIBUTING.md is true: a test changes, in a copy, the files that a row names, and the change works."""

import base64
import json
import os
import re
import shutil
import subprocess
import sys
import zlib
from pathlib import Path

import gamms

SRC = Path(gamms.__file__).parent


def changed(folder, *changes):
    """Copy the source, compiled as it is, and change it: (file, text that stands there once, text in its place)."""
    whole = folder.parent / "whole"  # a copy for all tests, to whose files each links
    if not whole.exists():
        shutil.copytree(SRC, whole)
    copy = folder / "src" / "gamms"
    shutil.copytree(whole, copy, copy_function=os.link)
    for file, before, after in changes:
        path = copy / file
        text = path.read_text()
        assert text.count(before) == 1, f"{file}: {before!r}"
        path.unlink()
        path.write_text(text.replace(before, after))
    return copy.parent


def printed(source, folder, program):
    environment = {**os.environ, "PYTHONPATH": str(source), "PYTHONDONTWRITEBYTECODE": "1"}
    return subprocess.check_output([sys.executable, "-c", program], cwd=folder, env=environment, text=True).strip()


def data_of_page(folder):
    """Return what `page.html` in a folder shows, as the bytes that its viewer reads."""
    [data] = re.findall(r'class="recording">([^<]*)<', (folder / "page.html").read_text())
    return zlib.decompress(base64.b64decode(data))


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
    recording.save("page.html")
    print([recording.state(turn).agents["battery"].tolist() for turn in range(3)])
    with recording.resume(2) as ctx:
        print([agent.battery for agent in ctx.agent.create_iter()])
with gamms.create_context() as ctx:
    for _ in ctx.record.replay("game.ggr"):
        pass
    print([agent.battery for agent in ctx.agent.create_iter()])
"""
    printed_lines = printed(source, tmp_path, program).splitlines()
    assert all(text in data_of_page(tmp_path) for text in (b"battery", b"0.75", b"0.875"))
    assert printed_lines == [
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
    return [game.get_row(name).tolist() for name in ("mobility", "scratch", "fuel", "wind")]

with gamms.create_context(seed=1) as ctx:
    ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 3))
    anna = ctx.agent.create_agent("anna", start_node_id=0, team="red")
    ben = ctx.agent.create_agent("ben", start_node_id=0, team="blue", mobility=3)
    print(shown(ctx))
    anna.scratch, game = 5, ctx.agent.block.games
    game.get_row("fuel")[1], game.get_row("wind")[0] = 0.5, 2.5
    now, snapshot = shown(ctx), ctx.game.snapshot()
    ctx.record.start("game")
    ctx.game.step()
    ctx.record.stop()
    game.get_row("fuel")[0], game.get_row("wind")[1], anna.mobility, ben.team = 4.0, 1.0, 9, "green"
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
        print(games.detached)
    fork, alone = ctx.game.fork(0), []
    for seed in range(5):
        fork.reset(seed=seed)
        alone.append(fork.run().turns)
    print(together == alone, len(set(alone)) > 1)
"""
    printed_lines = printed(with_battery(tmp_path), tmp_path, program).splitlines()
    assert printed_lines == ["{}", "True True"]


GUIDE = (Path(__file__).parents[1] / "CONTRIBUTING.md").read_text(encoding="utf-8")
KIND = '    "AGENT_COUNT": SensorKind(derived(AgentSensor, len), _RANGE, _DETECTION),\n'


def test_a_kind_of_sensor_is_a_row_of_the_catalog(tmp_path):
    assert KIND in GUIDE
    before = '    "AGENT_RANGE": '
    source = changed(tmp_path, ("sensor/catalog.py", before, KIND + before))
    program = """
import gamms
from gamms.sensor import SensorType

def closer(state):
    count = state["sensor"]["c"][1]
    state["action"] = state["legal"][(count + state["turn"]) % len(state["legal"])]

with gamms.create_context(seed=1, logger_config={"filename": "log"}, game={"max_turns": 6}) as ctx:
    ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 3))
    ctx.sensor.create_sensor("c", "AGENT_COUNT", sensor_range=1.5)
    ctx.agent.create_agent("anna", start_node_id=0, sensors=["c"], team="red", strategy=closer)
    for name, node in {"ben": 1, "cleo": 8}.items():
        ctx.agent.create_agent(name, start_node_id=node, team="blue", strategy=gamms.strategies.random_walk)
    print(ctx.agent.get_agent("anna").get_state()["sensor"]["c"])
    gamms.testing.check_sensor(ctx.sensor.get_sensor("c"), 0)
    ctx.visual.save("seen.svg")
    with ctx.game.batch(seeds=range(4)) as games:
        games.run()
        together = [games.context(number).agent.get_agent("anna").prev_node_id for number in range(4)]
        print(games.detached)
    fork, alone = ctx.game.fork(0), []
    for seed in range(4):
        fork.reset(seed=seed)
        fork.run()
        alone.append(fork.agents[0].prev_node_id)
    print(together == alone, len(set(alone)) > 1)
    ctx.record.start("game", sensed=True)
    ctx.game.collect("seen", lambda ctx: ctx.sensor.get_sensor("c").data)
    print(ctx.game.run(3).table("seen")["value"].tolist())
    ctx.record.stop()
with gamms.recorder.open("game.ggr") as recording:
    seen = [recording.observation(turn, "anna")["sensor"]["c"] for turn in range(1, 4)]
    print([(kind.name, count) for kind, count in seen])
    recording.save("page.html")
    with recording.resume(3) as ctx:
        print(ctx.agent.get_agent("anna").get_state()["sensor"]["c"][1])
"""
    assert printed(source, tmp_path, program).splitlines() == [
        "(<SensorType.AGENT_COUNT: 14>, 0)",
        "{}",
        "True True",
        "[1, 2, 1]",
        "[('AGENT_COUNT', 1), ('AGENT_COUNT', 2), ('AGENT_COUNT', 1)]",
        "0",
    ]
    assert "could not be drawn" not in (tmp_path / "log").read_text()


FLARES = '''
"""Flares: agents fire one wherever they stand on a node of even number."""


def flares(ctx):
    """Emit an event for each flare."""
    for agent in ctx.agent.agents.values():
        if agent.current_node_id % 2 == 0:
            ctx.game.emit("flare", agent=agent.name, node=agent.current_node_id)


def draw_flares(ctx, data):
    """Draw the flares of the last turn."""
    game = ctx.current_game
    for event in game.events:
        if event["kind"] == "flare" and event["turn"] == game.turn:
            node = ctx.graph.graph.get_node(event["node"])
            ctx.visual.render_circle(node.x, node.y, 0.3, (1, 2, 3))


draw_flares.artist = "lights"
flares.drawer = draw_flares
'''

GAMES = """
import gamms

def opened():
    ctx = gamms.create_context(seed=1, game={"max_turns": 6})
    ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 3))
    for name, node in {"ben": 1, "cleo": 3, "di": 7}.items():
        ctx.agent.create_agent(name, start_node_id=node, team=name[0], strategy=gamms.strategies.random_walk)
    return ctx

def in_batch_and_alone(ctx, look):
    with ctx.game.batch(seeds=range(4)) as games:
        games.run()
        print(games.detached)
        together = [look(games.context(number)) for number in range(4)]
    fork, alone = ctx.game.fork(0), []
    for seed in range(4):
        fork.reset(seed=seed)
        fork.run()
        alone.append(look(fork.ctx))
    print(together == alone, together[0] != together[1])
"""


def test_a_rule_with_its_event_and_its_drawing_is_one_file(tmp_path):
    source = changed(tmp_path)
    (source / "gamms" / "rules" / "flares.py").write_text(FLARES.lstrip())
    program = f"""{GAMES}
from gamms.rules.flares import flares

with opened() as ctx:
    ctx.game.add(flares)
    in_batch_and_alone(ctx, lambda ctx: list(ctx.game.events))
    ctx.record.start("game")
    ctx.game.run(3)
    ctx.visual.save("live.svg")
    ctx.record.stop()
flares.drawer = None
with gamms.recorder.open("game.ggr") as recording:
    recording.save("replayed.svg")
    recording.save("page.html")
    print(next(event["node"] for event in recording.events() if event["kind"] == "flare"))
live, replayed = open("live.svg").read(), open("replayed.svg").read()
print(live == replayed, live.count("#010203"))
"""
    assert printed(source, tmp_path, program).splitlines() == ["{}", "True True", "6", "True 1"]
    assert b"lights" in data_of_page(tmp_path)


CURFEW = '''


@show_as_call
def curfew(turns: int) -> Rule:
    """Make a rule that ends the game after a number of turns, won by nobody."""

    def curfew(ctx: Context) -> None:
        if ctx.game.turn >= turns:
            ctx.game.end("time limit", truncated=True)

    core_form = in_core("time_limit", turns, None)
    return declared(curfew, RuleSpec(rank=Rank.END, core_form=core_form, drawer=_draw_curfew))


def _draw_curfew(ctx: Context, _: dict[str, Any]) -> None:
    ctx.visual.render_circle(1.0, 1.0, 0.3, (1, 2, 3))
'''


def test_a_rule_of_gamms_is_a_function_and_its_name(tmp_path):
    source = changed(
        tmp_path,
        ("rules/__init__.py", "reach, time_limit\n", "reach, time_limit, curfew\n"),
        ("rules/__init__.py", '    "discover",\n', '    "curfew",\n    "discover",\n'),
    )
    with (source / "gamms" / "rules" / "endings.py").open("a") as file:
        file.write(CURFEW)
    program = f"""{GAMES}
with opened() as ctx:
    ctx.game.add(gamms.rules.curfew(3))
    in_batch_and_alone(ctx, lambda ctx: [agent.current_node_id for agent in ctx.agent.agents.values()])
walkers = {{"count": 2, "strategy": "gamms.strategies:random_walk"}}
little = {{"map": {{"grid": {{"rows": 3, "columns": 3}}}}, "teams": {{"red": walkers}}}}
game = gamms.scenario.Scenario(**little, rules=[{{"rule": "curfew", "with": {{"turns": 2}}}}])
result = game.play(record="game.ggr")
print(result.turns, result.reason)
with gamms.recorder.open("game.ggr") as recording:
    recording.save("last.svg")
    recording.save("page.html")
print(open("last.svg").read().count("#010203"))
"""
    assert printed(source, tmp_path, program).splitlines() == ["{}", "True True", "2 time limit", "1"]
    assert b"curfew" in data_of_page(tmp_path)


RESOLVER = '''

def shortest_name() -> Resolver:
    """Make a resolver by which the agents with the shortest names win."""
    return by_rank(lambda name, _team: len(name))
'''


def test_a_resolver_of_conflicts_is_one_function_which_the_core_plays(tmp_path):
    before = "\n\ndef _resolve_by_key("
    source = changed(
        tmp_path,
        ("rules/conflicts.py", before, RESOLVER + before),
        ("rules/__init__.py", "by_rank, nobody\n", "by_rank, nobody, shortest_name\n"),
        ("rules/__init__.py", '    "tag",\n', '    "shortest_name",\n    "tag",\n'),
    )
    program = f"""{GAMES}
with opened() as ctx:
    ctx.game.conflicts = gamms.rules.Conflicts(capacity=1, resolve=gamms.rules.shortest_name())
    in_batch_and_alone(ctx, lambda ctx: [agent.current_node_id for agent in ctx.agent.agents.values()])
    ctx.record.start("game")
    ctx.game.run(6)
    ctx.record.stop()
    nodes = [agent.current_node_id for agent in ctx.agent.agents.values()]
with gamms.recorder.open("game.ggr") as recording:
    print(recording.state(6).agents["node"].tolist() == nodes)
walkers = {{name: {{"count": 1, "strategy": "gamms.strategies:random_walk"}} for name in ("red", "blue")}}
little = {{"map": {{"grid": {{"rows": 2, "columns": 2}}}}, "teams": walkers, "max_turns": 3}}
print(gamms.scenario.Scenario(**little, conflicts={{"resolve": "shortest_name"}}).play().turns)
"""
    assert printed(source, tmp_path, program).splitlines() == ["{}", "True True", "True", "3"]


WIND = """
    wind: float = game_field(
        float,
        _return_value,
        captured=to_plain,
        restored=float,
        axis="game",
        event=ChangeEvent(0x04000010, "GAME_WIND", Audience.ALL, "wind"),
    )
"""


def test_a_kind_of_event_that_notes_a_field_of_the_game_is_one_entry(tmp_path):
    before = "    data: dict[str, Any] = game_field("
    source = changed(tmp_path, ("ir/game_state.py", before, WIND.lstrip("\n") + before))
    program = f"""{GAMES}
def blow(ctx):
    ctx.game.internals.state.wind += 0.5 if ctx.agent.get_agent("ben").current_node_id > 3 else 0.25

def wind_of(ctx):
    return ctx.game.internals.state.wind

with opened() as ctx:
    ctx.game.add(blow)
    in_batch_and_alone(ctx, wind_of)
    ctx.record.start("game")
    snapshot = ctx.game.snapshot()
    ctx.game.run(3)
    ctx.record.stop()
    now = wind_of(ctx)
    ctx.game.restore(snapshot)
    print(now > wind_of(ctx) == 0.0)
with gamms.recorder.open("game.ggr") as recording:
    recording.save("page.html")
    print([event[1] for log in recording.logs() for event in log if isinstance(event, tuple)])
    with recording.resume(3) as ctx:
        print(wind_of(ctx) == now)
"""
    assert printed(source, tmp_path, program).splitlines() == [
        "{}",
        "True True",
        "True",
        "[{'wind': 0.25}, {'turn': 1, 'pace': 1}, {'wind': 0.5}, {'wind': 0.75}]",
        "True",
    ]


CROSSES = """
def render_crosses(ctx, data):
    for x, y in data["at"]:
        ctx.visual.render_line(x - 0.2, y, x + 0.2, y, (1, 2, 3))
        ctx.visual.render_line(x, y - 0.2, x, y + 0.2, (1, 2, 3))
"""

HTML = """
def html(commands, camera, *, title, background, dpi):
    from gamms.visual.backends.svg import write_svg

    return b"<!doctype html>" + write_svg(commands, camera, title=title, background=background, dpi=dpi)
"""


def test_something_to_draw_and_a_way_to_show_it_are_one_file_each(tmp_path):
    before = '@FORMATS.register(".png")\n'
    source = changed(
        tmp_path,
        ("visual/backends/__init__.py", "backends import svg\n", "backends import svg, xhtml\n"),
        ("visual/backends/__init__.py", before, 'FORMATS.register(".xhtml")(xhtml.html)\n\n\n' + before),
    )
    (source / "gamms" / "visual" / "backends" / "xhtml.py").write_text(HTML)
    (source / "gamms" / "visual" / "drawers" / "crosses.py").write_text(CROSSES)
    program = f"""{GAMES}
from gamms.visual.backends.xhtml import html
from gamms.visual.drawers.crosses import render_crosses

gamms.testing.check_backend(html)
with opened() as ctx:
    ctx.visual.add_artist("crosses", {{"drawer": render_crosses, "at": [(1.0, 1.0)]}})
    ctx.visual.save("now.svg")
    ctx.visual.save("now.xhtml")
drawn, shown = open("now.svg").read(), open("now.xhtml").read()
print(drawn.count("#010203"), shown.count("#010203"), shown.endswith(drawn))
"""
    assert printed(source, tmp_path, program) == "1 1 True"


LINES = '''
"""Recordings as text: a line for each turn, a list of agents and nodes in turn."""

import json


class LinesEncoder:
    """Writes the moves of each turn in a line."""

    holds_looks_and_drawings = False
    is_current = True
    values = blocks = 0

    def __init__(self, output, _header):
        self._output = output

    def begin(self, session, *, is_final):
        pass

    def add(self, logs):
        for log in logs:
            moves = [item for item in log if isinstance(item, int)]
            self._output.append(json.dumps(moves).encode() + b"\\n")

    def keyframe(self, keyframe):
        pass

    def flush(self):
        pass

    def close(self):
        self._output.close()
'''


def test_a_format_of_recordings_is_an_encoder(tmp_path):
    source = changed(
        tmp_path,
        ("recorder/encoders.py", "3: Version3Encoder}\n", "3: Version3Encoder, 4: LinesEncoder}\n"),
        (
            "recorder/encoders.py",
            "from gamms.recorder.formats.writer",
            "from gamms.recorder.formats.lines import LinesEncoder\nfrom gamms.recorder.formats.writer",
        ),
    )
    (source / "gamms" / "recorder" / "formats" / "lines.py").write_text(LINES.lstrip())
    program = f"""{GAMES}
with opened() as ctx:
    ctx.record.start("game", version=4)
    ctx.game.run(3)
    ctx.record.stop()
    print([agent.current_node_id for agent in ctx.agent.agents.values()])
print(open("game.ggr").read().splitlines()[-1])
"""
    nodes, moves = map(json.loads, printed(source, tmp_path, program).splitlines())
    assert moves
    assert [nodes[number] for number in moves[::2]] == moves[1::2]


NORTH = """
def north(state):
    state["action"] = max(state["legal"])
"""


def test_a_strategy_is_one_function(tmp_path):
    source = changed(tmp_path)
    (source / "gamms" / "strategies" / "north.py").write_text(NORTH)
    program = f"""{GAMES}
from gamms.strategies.north import north

with opened() as ctx:
    ctx.agent.get_agent("ben").register_strategy(north)
    in_batch_and_alone(ctx, lambda ctx: [agent.current_node_id for agent in ctx.agent.agents.values()])
"""
    assert printed(source, tmp_path, program).splitlines() == ["{}", "True True"]


LINE = "cpdef u64 lowest_bit(u64 bits) noexcept nogil\n"
LOWEST = """

def lowest_bit(bits: int) -> int:
    return bits & 1
"""


def test_a_function_of_the_core_is_its_text_and_a_line_of_types(tmp_path, monkeypatch):
    source = changed(
        tmp_path,
        ("core/draws.pxd", "\ncpdef u64 mix(", f"\n{LINE}cpdef u64 mix("),
    )
    with (source / "gamms" / "core" / "draws.py").open("a") as file:
        file.write(LOWEST)
    monkeypatch.setenv("GAMMS_CORE", "python")
    assert printed(source, tmp_path, "from gamms.core import draws; print(draws.lowest_bit(7))") == "1"
