"""No change is half done: a call that raises has changed nothing, whether or not the game is recorded."""

import math
from io import BytesIO

import pytest
from whole_world import WALL, other, public, sensor, world

import gamms
from gamms.errors import BadType, BadValue
from gamms.recorder.recording import open as open_recording
from gamms.sensor import SensorType
from gamms.typing import AgentType

BAD = (None, -1, 3.5, 10**400, "x", math.nan, (1, "a"), [5], {"e": 5}, object())
WORST = (None, math.nan, "x", {"e": 5})  # in place of a part

CALLS = {  # a call that works, of each verb: what it is called on, its name, its arguments
    "create_agent": (
        lambda ctx: ctx.agent.create_agent,
        ("new",),
        {
            "start_node_id": 1,
            "team": "red",
            "orientation": (1, 0),
            "speed": 2.0,
            "meta": {},
            "sensors": {"e": "eyes"},
            "strategy": len,
            "type": AgentType.BASIC,
        },
    ),
    "create_agent that flies": (
        lambda ctx: ctx.agent.create_agent,
        ("new",),
        {
            "type": AgentType.AERIAL,
            "start_node_id": 1,
            "speed": 1.0,
            "position": (0, 0, 1),
            "quat": (1, 0, 0, 0),
            "orientation": (1, 0),
            "team": "red",
            "sensors": ["camera"],
            "strategy": len,
        },
    ),
    "delete_agent": (lambda ctx: ctx.agent.delete_agent, ("other",), {}),
    "register_sensor": (lambda ctx: other(ctx).register_sensor, ("t", "tower"), {}),
    "deregister_sensor": (lambda ctx: other(ctx).deregister_sensor, ("others",), {}),
    "register_strategy": (lambda ctx: other(ctx).register_strategy, (len,), {}),
    "create_sensor": (
        lambda ctx: ctx.sensor.create_sensor,
        ("new", SensorType.AGENT_ARC),
        {"sensor_range": 5.0, "fov": 1.0, "orientation": (1, 0), "at": 0, "team": "red", "detection": 0.5},
    ),
    "create_sensor in the air": (
        lambda ctx: ctx.sensor.create_sensor,
        ("new", SensorType.OCCLUDED_AERIAL),
        {"sensor_range": 5.0, "fov": 1.0, "quat": (1, 0, 0, 0), "at": (0, 0, 5)},
    ),
    "create_sensor past obstacles": (
        lambda ctx: ctx.sensor.create_sensor,
        ("new", SensorType.OCCLUDED_MAP),
        {"observer_height": 1.0},
    ),
    "from_function": (lambda ctx: ctx.sensor.from_function, ("new", lambda: 1), {}),
    "add_sensor": (lambda ctx: ctx.sensor.add_sensor, (None,), {}),
    "set_owner": (lambda ctx: sensor(ctx).set_owner, ("other",), {}),
    "add_node": (lambda ctx: ctx.graph.graph.add_node, ({"id": 99, "x": 0.0, "y": 0.0},), {}),
    "add_edge": (lambda ctx: ctx.graph.graph.add_edge, ({"id": 99, "source": 0, "target": 8, "length": 1.0},), {}),
    "update_node": (lambda ctx: ctx.graph.graph.update_node, ({"id": 4, "x": 9.0, "y": 1.0, "tags": [1]},), {}),
    "update_edge": (
        lambda ctx: ctx.graph.graph.update_edge,
        ({"id": 0, "length": 2.0, "source": 0, "target": 4, "linestring": [(0, 0), (9, 9)]},),
        {},
    ),
    "remove_node": (lambda ctx: ctx.graph.graph.remove_node, (4,), {}),
    "remove_edge": (lambda ctx: ctx.graph.graph.remove_edge, (0,), {}),
    "add_nodes": (lambda ctx: ctx.graph.add_nodes, ([98, 99], [0, 1], [0, 1]), {}),
    "add_edges": (lambda ctx: ctx.graph.add_edges, ([98, 99], [0, 1], [8, 7]), {"lengths": [1.0, 2.0]}),
    "attach": (lambda ctx: ctx.graph.attach_networkx_graph, (None,), {}),
    "add_obstacle_face": (lambda ctx: ctx.graph.add_obstacle_face, (1, *WALL, 0), {}),
    "add_obstacles": (lambda ctx: ctx.graph.add_obstacles, ([WALL, WALL],), {"ids": [5, 6], "types": [0, 1]}),
    "remove_obstacle_face": (lambda ctx: ctx.graph.remove_obstacle_face, (0,), {}),
    "load": (lambda ctx: ctx.graph.load, (None,), {}),
    "unpack": (lambda ctx: ctx.graph.storage.unpack, (None,), {}),
    "publish": (lambda ctx: lambda a, b: ctx.game.publish(a=a, b=b), (1, [2]), {}),
    "add": (lambda ctx: ctx.game.add, (print,), {"phase": "before", "name": "new"}),
    "remove": (lambda ctx: ctx.game.remove, ("weather",), {}),
    "collect": (lambda ctx: ctx.game.collect, ("new", len), {"every": 2, "per": "agent"}),
    "configure": (lambda ctx: ctx.game.configure, ({"legal": "any", "max_turns": 4, "time_budget": 1.0},), {}),
    "run": (lambda ctx: ctx.game.run, (), {"max_turns": 0}),
    "reset": (lambda ctx: ctx.game.reset, (), {"seed": 5}),
    "emit": (lambda ctx: ctx.game.emit, ("seen",), {}),
    "eliminate": (lambda ctx: ctx.game.eliminate, ("other",), {}),
    "respawn": (lambda ctx: ctx.game.respawn, ("other", 0), {}),
    "respawn a drone": (lambda ctx: ctx.game.respawn, ("drone", 0), {}),
    "reseed": (lambda ctx: ctx.reseed, (5,), {}),
    "set_agent_visual": (lambda ctx: ctx.visual.set_agent_visual, ("new",), {"color": "red"}),
    "set_values": (
        lambda ctx: ctx.visual.set_values,
        (),
        {"nodes": {0: 1.0}, "cmap": "magma", "vmin": 0.0, "name": "v"},
    ),
    "add_artist": (lambda ctx: ctx.visual.add_artist, ("new", {"layer": 5}), {}),
    "look_at": (lambda ctx: ctx.visual.look_at, (0, 0, 5), {}),
    "follow": (lambda ctx: ctx.visual.follow, ("other", 5), {}),
    "record event": (lambda ctx: ctx.record.event, ("seen",), {"x": 1}),
    "add_component": (lambda ctx: ctx.record.add_component, ("new", 5), {}),
    "component": (lambda ctx: lambda struct: ctx.record.component(struct)(type("New", (), {})), ({"x": int},), {}),
    "set_state": (lambda ctx: lambda action: act(other(ctx), action), ({"node_id": 1, "orientation": (1, 0)},), {}),
    "set_state of a drone": (
        lambda ctx: lambda action: act(ctx.agent.get_agent("drone"), action),
        ({"direction": (1, 0, 0), "quat": (1, 0, 0, 0)},),
        {},
    ),
} | {
    f"{path}.{name}": (lambda ctx, find=find, name=name: lambda value: setattr(find(ctx), name, value), (good,), {})
    for path, find, given in (
        (
            "agent",
            other,
            {
                "current_node_id": 0,
                "prev_node_id": 0,
                "orientation": (1, 0),
                "speed": 2.0,
                "team": "x",
                "alive": False,
                "strategy": len,
            },
        ),
        (
            "drone",
            lambda ctx: ctx.agent.get_agent("drone"),
            {"position": (0, 0, 0), "quat": (1, 0, 0, 0), "orientation": (1, 0), "current_node_id": 0},
        ),
        (
            "sensor",
            lambda ctx: sensor(ctx, "far"),
            {
                "range": 5.0,
                "fov": 1.0,
                "orientation": (1, 0),
                "at": 0,
                "sensor_id": "x",
                "type": SensorType.MAP,
            },
        ),
        (
            "camera",
            lambda ctx: sensor(ctx, "camera"),
            {"range": 5.0, "fov": 1.0, "quat": (1, 0, 0, 0), "at": (0, 0, 1)},
        ),
        ("past", lambda ctx: sensor(ctx, "past"), {"observer_height": 1.0}),
        ("notice", lambda ctx: sensor(ctx).notice, {"detection": 0.5}),
        (
            "game",
            lambda ctx: ctx.game,
            {
                "legal": "any",
                "on_illegal": "raise",
                "on_error": "raise",
                "speed_unit": "edges",
                "conflicts": None,
                "time_budget": 1.0,
                "max_turns": 4,
            },
        ),
        ("graph", lambda ctx: ctx.graph.graph, {"crs": "EPSG:32635", "attribution": "me"}),
        ("ctx", lambda ctx: ctx, {"logger": gamms.create_context().logger}),
    )
    for name, good in given.items()
}


def act(agent, action):
    agent.get_state()["action"] = action
    agent.set_state()


def everything():
    ctx = world()
    ctx.sensor.create_sensor("past", SensorType.OCCLUDED_AGENT, observer_height=1.6)
    ctx.game.max_turns = 2
    return ctx


def worse(good):
    """What is bad in place of something, or of a part of it."""
    yield from BAD
    if isinstance(good, dict):
        yield from ({**good, key: bad} for key in good for bad in WORST)
        yield from ({key: value for key, value in good.items() if key != missing} for missing in good)
    elif isinstance(good, list | tuple):
        yield from ([*good[:i], bad, *good[i + 1 :]] for i in range(len(good)) for bad in WORST)


def spoilt(args, kwargs):
    """The arguments of a call, with one of them replaced by something bad."""
    for i, good in enumerate(args):
        yield from (((*args[:i], bad, *args[i + 1 :]), kwargs) for bad in worse(good))
    for name, good in kwargs.items():
        yield from ((args, {**kwargs, name: bad}) for bad in worse(good))


def goes_on(ctx):
    """Whether a context that has taken a change can be used."""
    for agent in ctx.agent.create_iter():
        agent.get_state()
    ctx.game.step()


@pytest.mark.parametrize("name", CALLS)
def test_a_call_that_raises_has_changed_nothing(name):
    find, args, kwargs = CALLS[name]
    ctx, stream, before = begun()
    for bad_args, bad_kwargs in spoilt(args, kwargs):
        try:
            find(ctx)(*bad_args, **bad_kwargs)
        except (gamms.errors.GammsError, OSError):  # any other is no error that says what is wrong
            assert public(ctx) == before, (bad_args, bad_kwargs)
        else:
            goes_on(ctx)
            ended(ctx, stream)
            ctx, stream, before = begun()
    goes_on(ctx)
    ended(ctx, stream)


def begun():
    ctx, stream = everything(), BytesIO()
    ctx.record.start(stream)
    return ctx, stream, public(ctx)


def ended(ctx, stream):
    """End a game; what was recorded of it can be read."""
    turn = ctx.game.turn
    if ctx.record.is_open:
        ctx.record.stop()
        with open_recording(BytesIO(stream.getvalue())) as recording:
            recording.state(recording.turns)
            assert recording.turns == turn
    ctx.terminate()


def test_a_turn_that_no_game_reaches_is_refused():
    with gamms.create_context(seed=1) as ctx:
        with pytest.raises(BadValue, match="turn"):
            ctx.game.turn = 1 << 20_000
        assert ctx.game.turn == 0


@pytest.mark.parametrize("size", [iter([3]), "large", None, float("nan")])
def test_a_size_that_is_no_number_is_refused_where_it_is_declared(size):
    with gamms.create_context(seed=1) as ctx, pytest.raises((BadType, BadValue), match="size must be"):
        ctx.visual.set_agent_visual("ann", size=size)
