"""A quiet context with a cross of streets around node 0, and an agent that carries what a test asks for.

node   0       1       2       3        4        5
place  (0, 0)  (1, 0)  (0, 1)  (-1, 0)  (0, -1)  (3, 4), which no street reaches
"""

import pytest

import gamms
from gamms.graph import Engine

PLACES = [(0, 0), (1, 0), (0, 1), (-1, 0), (0, -1), (3, 4)]


@pytest.fixture(params=list(Engine), ids=lambda engine: engine.name)
def ctx(request):
    with gamms.create_context(graph_engine=request.param, logger_config={"level": "CRITICAL"}) as ctx:
        graph = ctx.graph.graph
        for id, (x, y) in enumerate(PLACES):
            graph.add_node({"id": id, "x": x, "y": y})
        for end in (1, 2, 3, 4):
            graph.add_edge({"id": 2 * end, "source": 0, "target": end, "length": 1})
            graph.add_edge({"id": 2 * end + 1, "source": end, "target": 0, "length": 1})
        yield ctx


@pytest.fixture
def sense(ctx):
    """Make a sensor, look once, and hand out what it saw."""

    def look(sensor_type, node=0, owner=None, **kwargs):
        name = f"sensor_{len(ctx.sensor.sensors)}"
        sensor = ctx.sensor.create_sensor(name, sensor_type, **kwargs)
        if owner is not None:
            owner.register_sensor(name, sensor)
        sensor.sense(node)
        return sensor.data

    return look
