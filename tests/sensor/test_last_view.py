"""What a sensor offers to drawers: the last look, from where it was taken."""

from math import inf

import pytest

from gamms.errors import UnknownName
from gamms.sensor import SensorType

DRAWN = [SensorType.NEIGHBOR, *(SensorType[name] for name in ("MAP", "RANGE", "ARC", "AGENT", "AGENT_RANGE"))]


def is_empty(view):
    return not any(len(part) for part in (view.nodes, view.lines, view.agents, view.outline))


@pytest.mark.parametrize("kind", [*DRAWN, SensorType.AERIAL, SensorType.AERIAL_AGENT], ids=lambda kind: kind.name)
def test_before_the_first_look_nothing_was_seen(ctx, kind):
    assert is_empty(ctx.sensor.create_sensor("eye", kind).last_view())


@pytest.mark.parametrize("kind", DRAWN[:-2], ids=lambda kind: kind.name)
def test_a_look_that_fails_leaves_the_last_view_as_it_was(ctx, kind):
    eye = ctx.sensor.create_sensor("eye", kind)
    eye.sense(1)
    before = eye.last_view()
    with pytest.raises(UnknownName):
        eye.sense(99)
    assert eye.last_view().nodes.tolist() == before.nodes.tolist()
    assert eye.last_view().outline.tolist() == before.outline.tolist()


def test_a_neighbor_sensor_shows_the_nodes_that_are_still_there(ctx):
    eye = ctx.sensor.create_sensor("eye", SensorType.NEIGHBOR)
    eye.sense(0)
    ctx.graph.graph.remove_node(2)
    assert eye.last_view().nodes.tolist() == [[0, 0], [1, 0], [-1, 0], [0, -1]]


def test_a_view_without_bounds_has_no_outline(ctx):
    ctx.agent.create_agent("anna", start_node_id=0)
    eye = ctx.sensor.create_sensor("eye", SensorType.AGENT_RANGE, sensor_range=1.0)
    eye.sense(0)
    eye.range = inf
    eye.sense(0)
    assert eye.last_view().agents.tolist() == [[0, 0]]
    assert eye.last_view().outline.shape == (0, 2)
    world = ctx.sensor.create_sensor("world", SensorType.MAP)
    world.sense(0)
    assert (len(world.last_view().nodes), len(world.last_view().outline)) == (6, 0)
