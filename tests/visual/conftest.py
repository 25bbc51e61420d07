"""A small world to draw: a two-way street, a one-way bend, two teams, a wall and a sensor of each kind."""

import numpy as np
import pytest

import gamms
from gamms.ir.graph import GraphColumns
from gamms.sensor import SensorType
from gamms.typing import ISensor

BEND = [(10.0, 0.0), (12.0, 5.0), (10.0, 10.0)]


class Own(ISensor):
    """A sensor of the user's own kind."""

    sensor_id, type, data = "own", SensorType.CUSTOM, None

    def sense(self, node_id):
        """See nothing."""

    def update(self, data):
        """Take nothing in."""

    def set_owner(self, owner):
        """Have no owner."""


@pytest.fixture
def ctx():
    """A real context without a window."""
    with gamms.create_context(seed=1) as ctx:
        graph = ctx.graph.graph
        for id, (x, y) in enumerate([(0, 0), (10, 0), (10, 10)]):
            graph.add_node({"id": id, "x": x, "y": y})
        graph.add_edge({"id": 0, "source": 0, "target": 1, "length": 10})
        graph.add_edge({"id": 1, "source": 1, "target": 0, "length": 10})
        graph.add_edge({"id": 2, "source": 1, "target": 2, "length": 11, "linestring": BEND})
        ctx.graph.add_obstacle_face(0, (4, 3, 9), (2, 3, 9), (4, 3, 0), (2, 3, 0), 1)
        ctx.agent.create_agent("red_0", start_node_id=0, team="red")
        ctx.agent.create_agent("blue_0", start_node_id=2, team="blue")
        ctx.sensor.create_sensor("near", SensorType.NEIGHBOR)
        ctx.sensor.create_sensor("map", SensorType.MAP)
        ctx.sensor.create_sensor("spy", SensorType.AGENT)
        ctx.sensor.add_sensor(Own())
        yield ctx


@pytest.fixture(scope="session")
def columns_of():
    """The maker of graphs with `edges` (source row, target row); what drawers do not read is left empty."""

    def make(xy, edges, bends=None):
        no = np.empty(0, np.int64)
        sources, targets = np.array(edges, np.int64).reshape(-1, 2).T
        nodes, rows = np.arange(len(xy)), np.arange(len(edges))
        return GraphColumns(nodes, xy, rows, sources, targets, no, no, no, bends or {}, {}, {}, 1, None)

    return make
