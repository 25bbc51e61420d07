"""What the tests of `ctx.record` share: a small world, how to record it, and all there is to compare."""

import io

import gamms
from gamms.sensor import SensorType

CORNERS = {"tr": (5.0, 5.0, 8.0), "tl": (5.0, 15.0, 8.0), "br": (5.0, 5.0, 0.0), "bl": (5.0, 15.0, 0.0)}
QUIET = {"level": "CRITICAL"}


def empty_context(**options):
    return gamms.create_context(logger_config=QUIET, **{"seed": 1, **options})


def grid_context(**options):
    """A grid of three by three nodes, ten units apart: node `3 * y + x` is at (10 x, 10 y); and three sensors."""
    ctx = empty_context(**options)
    graph = ctx.graph.graph
    for id in range(9):
        graph.add_node({"id": id, "x": 10.0 * (id % 3), "y": 10.0 * (id // 3)})
    ends = [(a, b) for a in range(9) for b in range(9) if abs(a % 3 - b % 3) + abs(a // 3 - b // 3) == 1]
    for id, (source, target) in enumerate(ends):
        graph.add_edge({"id": id, "source": source, "target": target, "length": 10.0})
    for sensor_id, kind in (("near", SensorType.NEIGHBOR), ("map", SensorType.MAP), ("others", SensorType.AGENT)):
        ctx.sensor.create_sensor(sensor_id, kind)
    return ctx


def act(ctx, name, action):
    """What the paper's loop does."""
    agent = ctx.agent.get_agent(name)
    agent.get_state()["action"] = action
    agent.set_state()


def recorded(play, ctx=None, **options):
    """The bytes of a recording of whatever `play(ctx)` does."""
    ctx, stream = ctx or grid_context(), io.BytesIO()
    ctx.record.start(stream, **options)
    play(ctx)
    ctx.record.close()  # which may be paused
    return stream.getvalue()


def replayed(data, ctx=None):
    """The context in which a recording was replayed, and the records."""
    ctx = ctx or empty_context(seed=2)
    return ctx, list(ctx.record.replay(io.BytesIO(data)))


def copied(data, ctx=None, **options):
    """What is recorded while a recording is replayed."""
    return recorded(lambda ctx: list(ctx.record.replay(io.BytesIO(data))), ctx or empty_context(seed=2), **options)


# -- all there is to compare --------------------------------------------------------------------------------------


def agent_of(agent):
    told = {
        "type": agent.type,
        "node": agent.current_node_id,
        "previous": agent.prev_node_id,
        "orientation": agent.orientation,
        "team": agent.team,
        "alive": agent.alive,
        "speed": agent.speed,
        "sensors": {name: sensor.sensor_id for name, sensor in agent._sensor_list.items()},
        "heading": agent._block.heading[agent._row],
    }
    if agent.type == gamms.agent.AgentType.AERIAL:
        told |= {"position": agent.position, "before": agent.prev_position, "quat": agent.quat}
    return told


def everything(ctx):
    return {
        "agents": [(agent.name, agent_of(agent)) for agent in ctx.agent.create_iter()],
        "attributes": {agent.name: dict(vars(agent)) for agent in ctx.agent.create_iter()},
        "data": ctx.game.data,
        "scores": dict(ctx.game.scores),
        "events": ctx.game.events,
        "over": ctx.game.over,
        **{name: getattr(ctx.game.internals.state, name) for name in ("deeds", "messages", "blocked")},
        "private": [dict(ctx.game.internals.state.agent_facts), dict(ctx.game.internals.state.team_facts)],
        "world": ctx.graph.storage.pack(),
        "sensors": ctx.sensor.storage.describe_sensors(),
        "components": {
            name: dict(vars(ctx.record.get_component(name))["__recorded_component_"])
            for name in ctx.record.component_iter()
        },
        "classes": list(ctx.record.components._component_registry),
    }
