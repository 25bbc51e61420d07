"""Every implementation keeps its contract, and the checks find one that does not."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import gamms
from gamms.graph import Graph
from gamms.sensor.catalog import KINDS
from gamms.testing import check_graph, check_sensor
from gamms.typing import IGraph, ISensor, Node, OSMEdge, SensorType


class PlainGraph(IGraph):
    """A graph of plain dicts: what an implementer must write, and nothing else."""

    def __init__(self) -> None:
        self.nodes: dict[int, Node] = {}
        self.edges: dict[int, dict] = {}

    def add_node(self, node_data):
        if type(node_data.get("id")) is not int:
            raise TypeError("id")
        if not {"x", "y"} <= node_data.keys() or not np.isfinite([node_data["x"], node_data["y"]]).all():
            raise ValueError("x, y")
        if node_data["id"] in self.nodes:
            raise KeyError(node_data["id"])
        self.nodes[node_data["id"]] = Node(node_data["id"], float(node_data["x"]), float(node_data["y"]))

    def add_edge(self, edge_data):
        if "length" not in edge_data:
            raise ValueError("length")
        if edge_data["id"] in self.edges:
            raise KeyError(edge_data["id"])
        self._check_ends(edge_data)
        self.edges[edge_data["id"]] = dict(edge_data)

    def _check_ends(self, edge):
        for end in ("source", "target"):
            self.nodes[edge[end]]

    def get_node(self, node_id):
        return self.nodes[node_id]

    def get_edge(self, edge_id):
        edge = self.edges[edge_id]
        ends = [self.nodes[edge[end]][1:] for end in ("source", "target")]
        return OSMEdge(edge_id, edge["source"], edge["target"], edge["length"], ends)

    def get_nodes(self, d=-1.0, x=0.0, y=0.0):
        near = (n.id for n in self.nodes.values() if d < 0 or (n.x - x) ** 2 + (n.y - y) ** 2 <= d * d)
        return iter(list(near))

    def get_edges(self, d=-1.0, x=0.0, y=0.0):
        near = set(self.get_nodes(d, x, y))
        return iter([id for id, edge in self.edges.items() if {edge["source"], edge["target"]} & near])

    def update_node(self, node_data):
        if "id" not in node_data:
            raise ValueError("id")
        self.nodes[node_data["id"]] = self.nodes[node_data["id"]]._replace(**node_data)

    def update_edge(self, edge_data):
        if "id" not in edge_data:
            raise ValueError("id")
        changed = {**self.edges[edge_data["id"]], **edge_data}
        self._check_ends(changed)
        self.edges[edge_data["id"]] = changed

    def remove_node(self, node_id):
        self.nodes.pop(node_id, None)
        self.edges = {id: edge for id, edge in self.edges.items() if node_id not in (edge["source"], edge["target"])}

    def remove_edge(self, edge_id):
        del self.edges[edge_id]

    def get_neighbors(self, node_id):
        self.nodes[node_id]
        return iter(dict.fromkeys(e["target"] for e in self.edges.values() if e["source"] == node_id))


@pytest.mark.parametrize("make", [Graph, PlainGraph])
def test_a_graph_keeps_its_contract(make):
    check_graph(make)


BROKEN = {
    "remove_node takes its edges along": {"remove_node": lambda graph, node: graph.nodes.pop(node, None)},
    "add_node without x": {"add_node": lambda graph, node: PlainGraph.add_node(graph, {"x": 0.0, **node})},
    "add_edge without length": {"add_edge": lambda graph, edge: PlainGraph.add_edge(graph, {"length": 1.0, **edge})},
    "update_edge to a missing node": {"update_edge": lambda graph, edge: graph.edges[edge["id"]].update(edge)},
    "remove_edge of a missing id": {"remove_edge": lambda graph, edge: graph.edges.pop(edge, None)},
    "has_node": {"has_node": lambda graph, node: True},
}


@pytest.mark.parametrize("promise", BROKEN)
def test_the_check_names_a_broken_promise(promise):
    with pytest.raises(AssertionError, match=promise):
        check_graph(type("Broken", (PlainGraph,), BROKEN[promise]))


places = st.lists(st.tuples(st.integers(-9, 9), st.integers(-9, 9)), min_size=1, max_size=12)


@given(places, st.lists(st.tuples(st.integers(0, 11), st.integers(0, 11)), max_size=30), st.data())
def test_the_fast_ways_agree_with_the_slow_defaults_of_the_contract(points, pairs, data):
    fast, slow = Graph(), PlainGraph()
    for graph in (fast, slow):
        for id, (x, y) in enumerate(points):
            graph.add_node({"id": id, "x": x, "y": y})
        for id, (u, v) in enumerate(pairs):
            edge = {"id": id, "source": u % len(points), "target": v % len(points), "length": 1.0}
            graph.add_edge(edge)
    node = data.draw(st.integers(0, len(points) - 1))
    radius = data.draw(st.one_of(st.just(float("inf")), st.integers(0, 20).map(float)))
    fov = data.draw(st.sampled_from([1.0, np.pi, 2.0 * np.pi]))
    heading = data.draw(st.sampled_from([(0.0, 0.0), (1.0, 0.0), (0.6, -0.8)]))

    assert fast.within(node, radius, fov, heading) == slow.within(node, radius, fov, heading)
    assert list(fast.neighborhoods[node]) == list(slow.neighborhoods[node])
    assert fast.positions([node]).tolist() == slow.positions([node]).tolist()


@pytest.mark.parametrize("kind", [kind.name for kind in KINDS])
def test_a_built_in_sensor_keeps_its_contract(kind):
    with gamms.create_context(logger_config={"level": "CRITICAL"}) as ctx:
        ctx.graph.add_nodes([0, 1], [0.0, 5.0], [0.0, 0.0])
        ctx.graph.add_edges([0, 1], [0, 1], [1, 0])
        ctx.agent.create_agent("anna", start_node_id=1)
        check_sensor(ctx.sensor.create_sensor("s", SensorType[kind]), node_id=0)


class Echo(ISensor):
    """A sensor that sees its node."""

    sensor_id, type, data = "echo", SensorType.CUSTOM, []

    def sense(self, node_id):
        self.data = [node_id]

    def update(self, data):
        pass

    def set_owner(self, owner):
        pass


def looks(*seen):
    return lambda _, __: SensedRows(seen)


class SensedRows(list):
    """What a sensor returns of several looks."""

    def __init__(self, seen):
        super().__init__(np.array([one, None], object)[:1] for one in seen)
        self.values = np.array([None], object)


BROKEN_SENSORS = {
    "sensing twice": {"sense": lambda sensor, node: sensor.data.append(node)},
    "sensor_id is a name": {"sensor_id": ""},
    "sense_many sees the same from the same node": {"sense_many": looks([3], [4])},
    "sense_many sees what sense sees": {"sense_many": looks([4], [4])},
}


@pytest.mark.parametrize("promise", BROKEN_SENSORS)
def test_the_check_of_sensors_names_a_broken_promise(promise):
    with pytest.raises(AssertionError, match=promise):
        check_sensor(type("Broken", (Echo,), {"data": [], **BROKEN_SENSORS[promise]})(), node_id=3)
