"""Recordings with right checksums and wrong content: what an enemy would write into events and keyframes."""

import copy
import io
import random
from contextlib import suppress

import numpy as np
from recordings import opened

import gamms
from gamms import recorder
from gamms.errors import BadType, BadValue, GammsError, UnknownName
from gamms.recorder import RecordingError, Writer
from gamms.sensor import SensorType
from gamms.strategies import random_walk

QUIET = {"level": "CRITICAL"}
JUNK = [
    *(None, True, 0, -1, 7, 1 << 40, -(1 << 70), 0.5, float("nan"), float("inf"), "", "anna", "x" * 40, b"", b"abc"),
    *([], [1, 2], ["a", ["b"]], (), (1, "a"), {}, {"a": 1}, {"set": 3}, {1: {}}, set(), {1, "b"}, frozenset()),
    *(np.zeros(0), np.arange(3), np.arange(3, dtype=np.uint8), np.zeros((2, 2)), np.array([True])),
]
HUGE = ["0..99999999999", "0..5 " * 20_000, "9" * 5000, "x" * 100_000, 1e308, [1e12, 0.0], (0, 0, 255), 300]


def explore(state):
    """Remember, draw and move."""
    state["memory"].setdefault("path", []).append(state["curr_pos"])
    state["team_memory"]["seen"] = {state["curr_pos"]}
    random_walk(state)
    if "deeds" in state:
        lot = state["draw"].below(5)
        state["action"] = {"node_id": 99 if lot == 4 else state["action"], "do": {"mark": lot} if lot else {"mork": 0}}
        state["outbox"] += [{"channel": "radio", "to": None, "body": {"at": state["curr_pos"]}}] * (lot % 3)


def fly(state):
    """Fly straight on."""
    state["action"] = (1.0, 0.5, 0.0)


def game():
    """The bytes of a game with a bit of everything."""
    stream = io.BytesIO()
    with gamms.create_context(seed=2, logger_config=QUIET) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(4, 4, 10.0))
        ctx.sensor.create_sensor("eyes", SensorType.RANGE, sensor_range=12.0)
        ctx.record.start(stream, sensed=True, provenance={"by": "test"})

        @ctx.record.component(struct={"charge": float, "log": list[int]})
        class Battery:
            pass

        battery = Battery(name="battery")
        for name, node in (("anna", 0), ("bert", 5)):
            ctx.agent.create_agent(name, start_node_id=node, team=name[0], sensors=["eyes"], strategy=explore)
        ctx.agent.create_agent("kite", start_node_id=3, type=1, speed=2.0, strategy=fly)
        ctx.game.publish(wind=(1, 2))
        ctx.game.publish(to="anna", word="fox")
        ctx.game.deeds = {"mark": {"what": "integer"}}
        ctx.game.order = [["a", None], ["b"]]
        ctx.game.add_channel("radio", range_m=25.0, loss=0.2, delay_turns=2)
        ctx.sensor.create_sensor("late eyes", SensorType.AGENT_RANGE, sensor_range=30.0, delay_turns=2)
        ctx.agent.get_agent("anna").register_sensor("late eyes", ctx.sensor.get_sensor("late eyes"))

        def rule(ctx):
            battery.charge = float(ctx.rng.random())
            ctx.game.scores["a"] += 1
            ctx.game.data.setdefault("turns", []).append(ctx.game.turn)
            ctx.game.emit("tick", n=ctx.game.turn)
            ctx.record.event("note", n=1)
            ctx.game.publish(to="a", turn=ctx.game.turn)
            ctx.sensor.get_sensor("late eyes").range = 20.0 + ctx.game.turn
            if ctx.game.turn == 3:
                ctx.graph.graph.remove_node(15)
                if "late" not in ctx.sensor.sensors:
                    ctx.sensor.create_sensor("late", SensorType.NEIGHBOR)
                ctx.agent.create_agent("late", start_node_id=1, sensors=["late"], strategy=explore)
                ctx.agent.delete_agent("bert")

        ctx.game.add(rule)
        ctx.game.run(6)
        ctx.game.reset(5)
        ctx.game.run(4)
        ctx.record.stop()
    return stream.getvalue()


def drawn_game(*, is_declared):
    """The bytes of a game with flags and territories, with looks that were declared or without."""
    stream = io.BytesIO()
    with gamms.create_context(seed=2, logger_config=QUIET) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(4, 4, 10.0))
        ctx.graph.add_obstacles([[(2, 2, 5), (6, 2, 5), (6, 2, 0), (2, 2, 0)]])
        for sensor, kind in (("eyes", SensorType.RANGE), ("ways", SensorType.NEIGHBOR)):
            ctx.sensor.create_sensor(sensor, kind)
        for name, node in (("anna", 0), ("bert", 5)):
            ctx.agent.create_agent(name, start_node_id=node, team=name[0], sensors=["eyes"], strategy=explore)
        ctx.agent.create_agent("kite", start_node_id=3, type=1, speed=2.0, strategy=fly)
        ctx.game.data |= {
            "territories": {"ground": {"a": "0..5", "b": "9 10"}},
            "flags": {"bases": {"a": 0, "b": 5}, "carriers": {"a": "bert", "b": None}},
        }
        if is_declared:
            ctx.visual.set_graph_visual(node_size=1.0, draw_id=True)
            ctx.visual.set_obstacle_visual(fill=True, color_map={1: (9, 9, 9)})
            ctx.visual.set_sensor_visual("eyes", node_color=(0, 0, 200))
            for name, color in (("anna", (200, 0, 0)), ("bert", "blue"), ("kite", (0, 0, 0))):
                ctx.visual.set_agent_visual(name, color=color, size=3)
        ctx.record.start(stream)

        def rule(ctx):
            ctx.game.scores["a"] += 1
            ctx.game.emit("tag", tagger="anna", tagged="bert", node=ctx.agent.get_agent("anna").current_node_id)

        ctx.game.add(rule)
        ctx.game.run(3)
        ctx.record.stop()
    return stream.getvalue()


def mutant(data, rng, junk=JUNK):
    """The same game with some values that are others."""
    reader = opened(data)
    header, begin = copy.deepcopy(reader.header), copy.deepcopy(reader.keyframe(0)[1])
    logs = [copy.deepcopy(reader.log(turn)) for turn in range(reader.turns)]
    for _ in range(rng.choice((1, 1, 2, 5))):
        event = [entry for log in logs for entry in log if type(entry) is tuple and isinstance(entry[1], dict)]
        target = rng.choice([begin, *[data for _, data in event], *([header] if rng.random() < 0.1 else [])])
        _spoil(target, rng, junk)
    stream = io.BytesIO()
    writer = Writer(stream, header)
    writer.keyframe(begin)
    for log in logs:
        writer.add_turn(log)
    writer.close()
    return stream.getvalue()


def _spoil(value, rng, junk):
    """Change something in a dict, or somewhere within it."""
    while True:
        keys = list(value) if isinstance(value, dict) else list(range(len(value)))
        if not keys:
            return
        key = rng.choice(keys)
        inner = value[key]
        if isinstance(inner, (dict, list)) and len(inner) and rng.random() < 0.6:
            value = inner
            continue
        if isinstance(value, dict) and rng.random() < 0.15:
            del value[key]
        else:
            value[key] = copy.deepcopy(rng.choice(junk))
        return


def use(data):
    """Do with a recording whatever can be done; raises what a reader of strangers' files must not raise."""
    with suppress(RecordingError), recorder.open(io.BytesIO(data)) as found:
        turns = found.turns
        for turn in range(turns + 1):
            with suppress(RecordingError):
                found.state(turn)
        for name in ("moves", "positions", "scores", "events", "sensed", "tick", "note"):
            with suppress(RecordingError, UnknownName):
                found.table(name)
        with suppress(RecordingError):
            list(found.steps())
        for turn in (0, turns // 2, turns):
            with suppress(RecordingError), found.resume(turn, seed=3) as ctx, suppress(BadType, BadValue):
                ctx.game.run(2)  # which may refuse an agent of impossible speed, as in any other game
        for turn in (1, 4, turns):
            with suppress(RecordingError, UnknownName, BadValue):
                found.observation(turn, "anna")
    with suppress(RecordingError, BadType), gamms.create_context(logger_config=QUIET) as ctx:
        ctx.record.start(io.BytesIO())
        for _ in ctx.record.replay(io.BytesIO(data)):
            pass


def look(data):
    """Draw how things stand after each turn, in every way; raises only errors that a stranger's file may cause."""
    with suppress(GammsError), gamms.create_context(logger_config=QUIET) as ctx:
        for _ in ctx.record.replay(io.BytesIO(data)):
            with suppress(GammsError):
                ctx.visual.frame(300, 200)
            with suppress(GammsError):
                ctx.visual.picture(".svg", 300, 200)


def drawn_mutant(name):
    """The mutant of a drawn game that is called so."""
    rng = random.Random(name)
    return mutant(drawn_game(is_declared=rng.random() < 0.5), rng, JUNK + HUGE)


def fuzz_games(seed, count):
    """Use so many mutants, and look at a tenth as many others; the same seed gives the same ones."""
    data = game()
    for number in range(count):
        found = mutant(data, random.Random(f"{seed}/{number}"))
        try:
            use(found)
            if number % 10 == 0:
                look(drawn_mutant(f"{seed}/{number}"))
        except Exception as error:
            raise AssertionError(f"mutant {seed}/{number}: {type(error).__name__}: {error}") from error
