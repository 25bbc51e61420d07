"""Agents that went out of the game are not drawn, nor is what their sensors saw; a mark says where it happened."""

from math import inf

import numpy as np
import pytest

import gamms
from gamms.agent import AgentType
from gamms.ir.draw import DrawKind
from gamms.sensor import SensorType
from gamms.strategies import stay

AGENTS, SENSORS, MARKS = 20, 15, 25  # layers


def places(ctx, layer, kind=DrawKind.CIRCLE):
    """Where something of that kind is drawn on a layer, each place once."""
    commands = ctx.visual.draw_commands()
    rows = np.flatnonzero((commands.layer == layer) & (commands.kind == kind))
    return {tuple(commands.points[commands.offsets[row]].tolist()) for row in rows}


@pytest.fixture
def road():
    """A road with an agent at each of ten nodes, who see whom is near, and stay."""
    with gamms.create_context(seed=1, logger_config={"level": "CRITICAL"}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(1, 10))
        for node in range(10):
            ctx.sensor.create_sensor(f"eyes_{node}", SensorType.AGENT_RANGE, sensor_range=15.0)
            team = ("red", "blue")[node % 2]
            ctx.agent.create_agent(f"a_{node}", start_node_id=node, team=team, sensors=[f"eyes_{node}"], strategy=stay)
        yield ctx


def out_in_turn(ctx, turn, *names):
    @ctx.game.add
    def rule(ctx):
        for name in names if ctx.game.turn == turn else ():
            ctx.game.eliminate(name)


def test_a_picture_shows_as_many_agents_as_live(road):
    out_in_turn(road, 2, *(f"a_{node}" for node in range(7)))
    road.game.run(2)
    assert places(road, AGENTS) == {(70.0, 0.0), (80.0, 0.0), (90.0, 0.0)}
    assert len(road.game.agents) == 3


def test_who_returns_is_drawn_again(road):
    road.game.run(1)
    road.game.eliminate("a_0")
    assert (0.0, 0.0) not in places(road, AGENTS)
    road.game.respawn("a_0")
    assert (0.0, 0.0) in places(road, AGENTS)


def test_a_deleted_agent_leaves_no_view_behind(road):
    road.game.run(1)
    for node in range(10):
        road.agent.delete_agent(f"a_{node}")
    assert set(road.visual.draw_commands().layer.tolist()) == {10}


@pytest.mark.parametrize("is_declared", [False, True])
def test_a_drone_that_is_out_is_not_drawn(road, is_declared):
    drone = road.agent.create_agent("drone", type=AgentType.AERIAL, start_node_id=0, speed=1.0)
    drone.position = (35.0, 5.0, 20.0)
    if is_declared:
        road.visual.set_agent_visual("drone")
    assert (35.0, 5.0) in places(road, AGENTS)
    drone.alive = False
    assert (35.0, 5.0) not in places(road, AGENTS)


def test_a_sensor_of_infinite_range_without_a_place_is_no_error(road):
    road.sensor.create_sensor("all", SensorType.AGENT_RANGE, sensor_range=inf).sense(0)
    road.game.run(1)
    assert road.visual.draw_commands()
