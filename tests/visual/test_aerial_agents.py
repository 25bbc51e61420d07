"""Agents in the air: seen from above, and not to be mistaken for agents on the ground."""

import re
from math import sqrt

import numpy as np
import pytest

from gamms.agent import AgentType
from gamms.ir.draw import DrawKind

WEST = (0.0, 0.0, 0.0, 1.0)
DOWN = (sqrt(0.5), 0.0, sqrt(0.5), 0.0)


@pytest.fixture
def drone(ctx):
    """A drone above the middle of nowhere that looks west."""
    drone = ctx.agent.create_agent("drone", start_node_id=0, type=AgentType.AERIAL, speed=1.0, team="red")
    drone.position, drone.quat = (5.0, 6.0, 12.0), WEST
    return drone


def points_of(commands, kind):
    """The points of every command of one kind."""
    rows = np.flatnonzero(commands.kind == kind)
    return [commands.points[commands.offsets[row] : commands.offsets[row + 1]].tolist() for row in rows]


def heights(ctx):
    """What is written beside agents in the air in a picture without names."""
    return re.findall(r">(\S+ m)</text>", ctx.visual.picture(".svg", labels=False, scale_bar=False).decode())


def test_looking_straight_down_it_has_no_nose(ctx, drone):
    ctx.visual.set_graph_visual().set_visible(False)  # nothing but what is declared
    drone.quat = DOWN
    ctx.visual.set_agent_visual("drone")
    assert points_of(ctx.visual.draw_commands(), DrawKind.LINE) == []


def test_it_is_drawn_in_the_air_where_nothing_is_declared_too(ctx, drone):
    commands = ctx.visual.draw_commands()
    assert heights(ctx) == ["12 m"]
    agents = commands.layer == 20
    assert [5.0, 6.0] in commands.points[commands.offsets[:-1][agents]].tolist()
