"""A quiet context with a grid of three by three nodes, one unit apart: node `3 * y + x` is at (x, y)."""

import pytest

import gamms

STEPS = [(1, 0), (-1, 0), (0, 1), (0, -1)]


@pytest.fixture
def ctx():
    with gamms.create_context(logger_config={"level": "CRITICAL"}, seed=1) as ctx:
        graph = ctx.graph.graph
        for id in range(9):
            graph.add_node({"id": id, "x": id % 3, "y": id // 3})
        for id in range(9):
            for dx, dy in STEPS:
                if 0 <= id % 3 + dx < 3 and 0 <= id // 3 + dy < 3:
                    edge = {"id": len(list(graph.get_edges())), "source": id, "target": id + dx + 3 * dy, "length": 1}
                    graph.add_edge(edge)
        ctx.sensor.create_sensor("near", gamms.sensor.SensorType.NEIGHBOR)
        yield ctx


@pytest.fixture
def anna(ctx):
    """An agent in the middle, with a sensor."""
    return ctx.agent.create_agent("anna", start_node_id=4, sensors=["near"])
