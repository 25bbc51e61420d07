"""Plays the games of this folder with gamms 1.0.0 and writes down what it reaches; see README.md."""

import contextlib
import datetime as dt
import io
import json
import sys
from pathlib import Path
from typing import Optional, Union

import gamms

SensorType = gamms.sensor.SensorType

HERE = Path(__file__).parent
NODES = [(row * 3 + column, 10.0 * column, 10.0 * row) for row in range(3) for column in range(3)]
EDGES = [(a, b) for a, ax, ay in NODES for b, bx, by in NODES if abs(ax - bx) + abs(ay - by) == 10.0]


def new_context():
    ctx = gamms.create_context(graph_engine=gamms.graph.Engine.MEMORY, logger_config={"level": "ERROR"})
    for id, x, y in NODES:
        ctx.graph.graph.add_node({"id": id, "x": x, "y": y})
    for id, (source, target) in enumerate(EDGES):
        ctx.graph.graph.add_edge({"id": id, "source": source, "target": target, "length": 10.0})
    ctx.sensor.create_sensor("near", SensorType.NEIGHBOR)
    ctx.sensor.create_sensor("map", SensorType.MAP)
    ctx.sensor.create_sensor("others", SensorType.AGENT)
    return ctx


def act(ctx, name, action):
    agent = ctx.agent.get_agent(name)
    agent.get_state()["action"] = action
    agent.set_state()


# -- the games ----------------------------------------------------------------------------------------------------


def basic(ctx):
    ctx.agent.create_agent("red_0", start_node_id=0, meta={"team": 0, "note": "é"}, color="red", size=1.5)
    ctx.agent.create_agent("blue_0", start_node_id=8, team=1)
    for red, blue in [(1, 7), (4, 6), (4, 3)]:
        act(ctx, "red_0", red)
        act(ctx, "blue_0", {"node_id": blue})
        ctx.visual.simulate()
    ctx.agent.get_agent("red_0").current_node_id = 2
    ctx.agent.get_agent("red_0").prev_node_id = 5


def orientation(ctx):
    ctx.agent.create_agent("a", start_node_id=4, orientation=(3.0, 4.0))
    ctx.agent.create_agent("b", start_node_id=0)
    act(ctx, "a", {"node_id": 5, "orientation": (0.0, -2.0)})
    act(ctx, "b", 3)
    ctx.visual.simulate()
    ctx.agent.get_agent("b").orientation = (-1.0, 1.0)
    act(ctx, "b", 4)
    ctx.visual.simulate()


def sensors(ctx):
    ctx.agent.create_agent("a", start_node_id=0, sensors=["near", "map"])
    ctx.agent.create_agent("b", start_node_id=8, sensors=["others"])
    act(ctx, "a", 1)
    ctx.visual.simulate()
    ctx.agent.get_agent("a").register_sensor("eyes", ctx.sensor.get_sensor("others"))
    ctx.agent.get_agent("a").deregister_sensor("map")
    act(ctx, "a", 4)
    ctx.visual.simulate()


def aerial(ctx):
    ctx.agent.create_agent("drone", start_node_id=0, type=gamms.agent.AgentType.AERIAL, speed=2.5, sensors=["near"])
    ctx.agent.create_agent("walker", start_node_id=1)
    for action in [(1.0, 0.0, 1.0), (0.0, 3.0, 0.0), {"direction": [1, 1, 0], "quat": [0.5, 0.5, 0.5, 0.5]}]:
        act(ctx, "drone", action)
        act(ctx, "walker", 2)
        ctx.visual.simulate()
    drone = ctx.agent.get_agent("drone")
    drone.current_node_id = 4
    drone.position = (11.0, 19.5, 7.25)
    drone.quat = (2.0, 0.0, 0.0, 2.0)
    ctx.visual.simulate()


def declare(ctx, **others):
    """One field of each type that 1.0.0 takes, but for `type(None)`, which it writes and cannot read."""

    class Everything:
        def __init__(self):
            pass

    struct = {"whole": int, "real": float, "text": str, "truth": bool, "dots": ..., **others}
    struct |= {"maybe": Optional[int], "either": Union[int, str], "any": Union[int, float, str, bool, None]}  # noqa: UP007, UP045 - its own spelling
    return ctx.record.component(struct=struct)(Everything)


def components(ctx):
    Everything = declare(ctx)
    one, two = Everything("one"), Everything("two")
    one.whole, one.real, one.text, one.truth = 2**70, 0.1, "tëxt", True
    one.maybe, one.either, one.any = -5, "three", float("inf")
    ctx.visual.simulate()
    one.maybe, one.either, two.real, two.whole = None, 3, 2, True
    two.text = 1.25  # of a type that is not declared, which 1.0.0 takes
    ctx.visual.simulate()


def deleted(ctx):
    for name, node in (("a", 0), ("b", 1), ("c", 2)):
        ctx.agent.create_agent(name, start_node_id=node)
    act(ctx, "b", 4)
    ctx.visual.simulate()
    ctx.agent.delete_agent("b")
    ctx.agent.delete_agent("c")
    ctx.agent.create_agent("b", start_node_id=7)
    act(ctx, "b", 8)
    ctx.visual.simulate()


def paused(ctx):
    ctx.agent.create_agent("a", start_node_id=0)
    act(ctx, "a", 1)
    ctx.visual.simulate()
    ctx.record.pause()
    act(ctx, "a", 2)
    act(ctx, "a", 5)
    ctx.record.play()
    act(ctx, "a", 8)
    ctx.visual.simulate()


def unfinished(ctx):
    ctx.agent.create_agent("a", start_node_id=3)
    act(ctx, "a", 4)
    ctx.visual.simulate()
    act(ctx, "a", 5)


def keywords(ctx):
    meta = {
        "numbers": [0, 23, 24, 255, 256, 65535, 65536, 2**32, 2**64, -1, -(2**64) - 1, 1.5, -0.0, float("inf")],
        "texts": ["", "ä" * 20, "x" * 300],
        "others": [None, True, False, b"\x00\xff", (1, (2, 3)), {}, []],
        "nodes": {1: "one", (0, 1): "edge", 2.5: "half"},
        "set": {5},
    }
    ctx.agent.create_agent("a", start_node_id=0, meta=meta)


def refused(ctx):
    """Events that 1.0.0 writes and then refuses, or cannot replay; the states are those of the game itself."""
    Everything = declare(ctx, nothing=type(None))
    one, two = Everything("one"), Everything("two")
    one.whole, two.whole = 1, 2
    ctx.agent.create_agent("a", start_node_id=1)
    for wrong in (lambda: Everything("one"), lambda: ctx.agent.create_agent("a", start_node_id=5)):
        with contextlib.suppress(ValueError):
            wrong()
    ctx.agent.delete_agent("nobody")
    ctx.record.delete_component("two")
    two.whole = 3
    act(ctx, "a", 4)
    ctx.visual.simulate()
    ctx.record.unregister_component((Everything.__module__, Everything.__qualname__))
    one.whole = 4


def tags(ctx):
    """Values that CBOR writes as tags; ours opens none of them, so that no states are given."""
    when = dt.datetime(2026, 6, 1, tzinfo=dt.UTC)
    ctx.agent.create_agent("a", start_node_id=0, meta={"when": when, "day": when.date(), "complex": 1 + 2j})


GAMES = [basic, orientation, sensors, aerial, components, deleted, paused, unfinished, keywords, refused, tags]


# -- what is reached ----------------------------------------------------------------------------------------------


def state_of(ctx):
    agents = {}
    for agent in ctx.agent.create_iter():
        state = {"type": agent.type.name, "node": agent.current_node_id, "prev": agent.prev_node_id}
        if agent.type.name == "AERIAL":
            state |= {"position": agent.position, "quat": agent.quat, "speed": agent.speed}
        else:
            state["orientation"] = agent.orientation
            state |= {key: getattr(agent, key) for key in ("team", "color", "size", "meta") if hasattr(agent, key)}
        agents[agent.name] = state | {"sensors": list(agent._sensor_list)}
    components = {
        name: dict(vars(ctx.record.get_component(name))["__recorded_component_"])
        for name in ctx.record.component_iter()
    }
    classes = sorted(list(key) for key in ctx.record._component_registry)
    return {"agents": agents, "components": components, "classes": classes}


def plain(value):
    """JSON has neither tuples nor infinity nor other keys than texts; such metadata is compared as bytes instead."""
    return json.loads(json.dumps(value, default=repr, skipkeys=True))


def record(game):
    ctx, stream = new_context(), io.BytesIO()
    ctx.record.start(stream)
    game(ctx)
    live = state_of(ctx)
    if game is unfinished:
        return stream.getvalue(), live
    close, stream.close = stream.close, lambda: None
    ctx.record.stop()
    data = stream.getvalue()
    close()
    return data, live


def replayed(data):
    ctx, turns = new_context(), []
    try:
        for step in ctx.record.replay(io.BytesIO(data)):
            if step["opCode"] == 1:
                turns.append(state_of(ctx))  # noqa: PERF401 - it may raise
        error = None
    except Exception as problem:  # noqa: BLE001 - whatever 1.0.0 says
        error = f"{type(problem).__name__}: {problem}"
    return {"turns": turns, "end": state_of(ctx), "error": error}


def main():
    states = {"nodes": NODES, "edges": EDGES, "games": {}}
    for game in GAMES:
        data, live = record(game)
        (HERE / f"{game.__name__}.ggr").write_bytes(data)
        reached = {"turns": [], "end": live, "error": None} if game is refused else replayed(data)
        if game in (keywords, tags):
            reached["end"]["agents"]["a"].pop("meta", None)
        states["games"][game.__name__] = reached
        sys.stdout.write(f"{game.__name__}: {len(data)} bytes, {reached['error']}\n")
    text = json.dumps(plain(states), indent=1)
    (HERE / "states.json").write_text(text + "\n")


if __name__ == "__main__":
    main()
