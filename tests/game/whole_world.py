"""A game with everything in it, and what a program can see of it."""

from collections.abc import Mapping

import numpy as np

import gamms
from gamms.rules import Conflicts
from gamms.sensor import SensorType
from gamms.typing import AgentType

WALL = ((0, 0, 9), (1, 0, 9), (0, 0, 0), (1, 0, 0))


def world(cheat=lambda ctx, state: None, **settings):
    """A game of `cheater`, `other` and `drone`, in which the cheater's strategy is `cheat(ctx, state)`."""
    ctx = gamms.create_context(seed=1, logger_config={"level": "CRITICAL"}, game=settings)
    ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 3, spacing=10.0))
    ctx.graph.add_obstacle_face(0, *WALL, 0)
    ctx.graph.graph.update_node({"id": 4, "tags": ["park"]})
    for name, kind in (("eyes", "AGENT"), ("far", "RANGE"), ("tower", "AGENT_RANGE"), ("camera", "AERIAL_AGENT")):
        ctx.sensor.create_sensor(name, SensorType[kind])
    ctx.sensor.create_sensor("others", SensorType.AGENT)
    ctx.sensor.from_function("inbox", lambda node_id, agent: ctx.game.data["inbox"])

    def strategy(state):
        state["action"] = state["curr_pos"]
        cheat(ctx, state)

    def stay(state):
        state["action"] = (0, 0, 0) if isinstance(state["curr_pos"], tuple) else state["curr_pos"]

    ctx.agent.create_agent("cheater", start_node_id=0, team="red", sensors=["eyes", "inbox"], strategy=strategy)
    ctx.agent.create_agent(
        "other", start_node_id=4, team="blue", sensors=["others", "far"], strategy=stay, meta={"hp": [3]}, color="blue"
    )
    ctx.agent.create_agent(
        "drone", type=AgentType.AERIAL, start_node_id=8, speed=2.0, sensors=["camera"], strategy=stay
    )
    ctx.visual.set_agent_visual("other", color="red")
    game = ctx.game
    game.publish(heat=np.arange(3.0), nested={"rows": [np.zeros(2)], "log": bytearray(b"abc")})
    game.data.update(inbox=[{"seen": []}], wind=np.ones(2))
    game.scores["red"] = 1
    game.internals.state.get_memory("other")["plan"] = [4]
    game.emit("begun")
    game.conflicts = Conflicts()
    game.collect("wind", lambda ctx: 0)
    game.add(lambda ctx: None, name="weather")
    return ctx


def other(ctx):
    return ctx.agent.get_agent("other")


def sensor(ctx, name="others"):
    return ctx.sensor.get_sensor(name)


def plain(value):
    """A value in a form that can be compared."""
    if isinstance(value, np.ndarray):
        return ("array", value.dtype.str, value.tolist())
    if isinstance(value, Mapping):
        return {key: plain(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [plain(one) for one in value]
    return value if isinstance(value, str | int | float | bytes | bytearray | set | type(None)) else repr(value)


def public(ctx):
    """What a program can see of a context, but for the count of turns and what strategies did wrong."""
    game, graph = ctx.game, ctx.graph
    names = ("name", "team", "type", "alive", "current_node_id", "prev_node_id", "orientation", "speed", "strategy")
    columns = graph.columns()
    return plain(
        {
            "agents": [
                {name: getattr(agent, name) for name in names}
                | {"own": vars(agent), "sensors": {key: id(one) for key, one in agent._sensor_list.items()}}
                | {"position": getattr(agent, "position", None), "quat": getattr(agent, "quat", None)}
                for agent in ctx.agent.agents.values()
            ],
            "sensors": ctx.sensor.storage.describe_sensors(),
            "owners": {name: one._owner for name, one in ctx.sensor.sensors.items()},
            "graph": [getattr(columns, name) for name in columns.__dataclass_fields__],
            "obstacles": list(graph.obstacle_columns()),
            "attribution": graph.attribution,
            "data": game.data,
            "scores": game.scores,
            "facts": game.facts,
            "events": game.events,
            "over": game.over,
            "rules": [rule.name for rule in game.rules],
            "settings": [
                game.legal,
                game.on_illegal,
                game.speed_unit,
                game.conflicts,
                game.time_budget,
                game.max_turns,
            ],
            "memories": {name: memory for name, memory in game.memories.items() if memory},
            "teams": {team: memory for team, memory in game.team_memories.items() if memory},
            "visual": ctx.visual.artists.describe_artists(),
            "camera": [ctx.visual.viewpoint.look, ctx.visual.viewpoint.followed, len(ctx.visual.after_turn)],
            "seed": [ctx.seed, ctx.rng_state()],
            "context": [ctx.is_terminated(), ctx.record.is_open, ctx.record.record(), id(ctx.logger)],
        }
    )


def objects(ctx):
    yield from (ctx, ctx.game, ctx.agent, *ctx.agent.agents.values(), ctx.sensor, *ctx.sensor.sensors.values())
    yield from (sensor(ctx).notice, ctx.graph, ctx.graph.graph, ctx.visual, ctx.visual.artists.list_shown()["other"])
    yield from (ctx.record, ctx.record.components)


def kind_of(thing):
    return "Sensor" if hasattr(thing, "sensor_id") else type(thing).__name__
