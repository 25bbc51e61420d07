"""Quiet contexts, a description of everything a graph holds, and the contract as plain dicts."""

import math

import pytest

import gamms
from gamms.graph import Engine

QUIET = {"level": "CRITICAL"}


def open_context(engine=Engine.MEMORY, **keywords):
    return gamms.create_context(graph_engine=engine, logger_config=QUIET, **keywords)


@pytest.fixture(scope="session")
def open_ctx():
    """Opens a context; the caller ends it."""
    return open_context


@pytest.fixture
def ctx():
    with open_context() as ctx:
        yield ctx


@pytest.fixture(params=Engine, ids=lambda engine: engine.name)
def any_ctx(request):
    """A context of either engine."""
    with open_context(request.param) as ctx:
        yield ctx


@pytest.fixture
def graph(ctx):
    return ctx.graph.graph


@pytest.fixture(scope="session")
def fill():
    """Puts a small graph with one of everything into a context."""

    def fill(ctx):
        graph = ctx.graph.graph
        for id, x, y in ((1, 0.0, 0.0), (2, 3.0, 4.0), (-7, 6.0, 0.0), (40, -1.5, 2.0)):
            graph.add_node({"id": id, "x": x, "y": y})
        graph.update_node({"id": 2, "name": "Töölö", "tags": ["a", ("b", b"\x00")], "none": None})
        graph.add_edge({"id": 1, "source": 1, "target": 2, "length": 5.0, "lanes": 2})
        graph.add_edge({"id": 2, "source": 1, "target": 2, "length": 6.0, "linestring": [(0, 0), (3, 0), (3, 4)]})
        graph.add_edge({"id": 3, "source": 2, "target": -7, "length": 5.0})
        graph.add_edge({"id": 4, "source": -7, "target": -7, "length": 0.0})
        ctx.graph.add_obstacle_face(5, (1, 1, 2), (0, 1, 2), (1, 1, 0), (0, 1, 0), 3)
        graph.crs, graph.attribution = "EPSG:32635", "© those who mapped it"
        return graph

    return fill


@pytest.fixture(scope="session")
def everything():
    """All that can be seen of a context's graph, as plain values."""

    def everything(ctx):
        graph = ctx.graph.graph
        edges = [graph.get_edge(id) for id in graph.get_edges()]
        return {
            "nodes": [(*graph.get_node(id), graph.node_attributes(id)) for id in graph.get_nodes()],
            "edges": [(*edge[:4], edge.points, graph.edge_attributes(edge.id)) for edge in edges],
            "neighbors": [list(graph.get_neighbors(id)) for id in graph.get_nodes()],
            "faces": [ctx.graph.get_obstacle_face(id) for id in ctx.graph.get_obstacle_faces()],
            "about": (graph.crs, graph.attribution),
        }

    return everything


@pytest.fixture(scope="session")
def model():
    """The class `Model`."""
    return Model


class Model:
    """The contract of graphs in the plainest way: two dicts and loops, for edits that are possible."""

    def __init__(self):
        self.nodes = {}  # id -> (x, y)
        self.edges = {}  # id -> (source, target, length, polyline or None)

    # -- edits --------------------------------------------------------------------------------------------------

    def add_node(self, data):
        self.nodes[data["id"]] = (data["x"], data["y"])

    def update_node(self, data):
        x, y = self.nodes[data["id"]]
        self.nodes[data["id"]] = (data.get("x", x), data.get("y", y))

    def add_edge(self, data):
        line = data.get("linestring")
        polyline = None if line is None else tuple(float(number) for point in line for number in point)
        self.edges[data["id"]] = (data["source"], data["target"], data["length"], polyline)

    def update_edge(self, data):
        *ends, length, line = self.edges[data["id"]]
        is_moved = [data["source"], data["target"]] != ends
        self.edges[data["id"]] = (data["source"], data["target"], length, None if is_moved else line)

    def remove_node(self, id):
        del self.nodes[id]
        self.edges = {edge: row for edge, row in self.edges.items() if id not in row[:2]}

    def remove_edge(self, id):
        del self.edges[id]

    def add_nodes(self, ids, x, y):
        self.nodes.update(zip(ids, zip(x, y, strict=True), strict=True))

    def add_edges(self, ids, sources, targets, lengths):
        rows = zip(sources, targets, lengths, [None] * len(ids), strict=True)
        self.edges.update(zip(ids, rows, strict=True))

    # -- queries; KeyError where there is nothing ----------------------------------------------------------------

    def get_node(self, id):
        return (id, *self.nodes[id])

    def get_edge(self, id):
        source, target, length, line = self.edges[id]
        return (id, source, target, length, self.nodes[source] + self.nodes[target] if line is None else line)

    def get_nodes(self, d=-1.0, x=0.0, y=0.0):
        d, x, y = float(d), float(x), float(y)
        return [id for id, (a, b) in self.nodes.items() if d < 0 or (a - x) ** 2 + (b - y) ** 2 <= d * d]

    def get_edges(self, d=-1.0, x=0.0, y=0.0):
        near = set(self.get_nodes(d, x, y))
        return [id for id, row in self.edges.items() if near & set(row[:2])]

    def get_neighbors(self, id):
        _ = self.nodes[id]
        return list(dict.fromkeys(row[1] for row in self.edges.values() if row[0] == id))

    def neighborhood(self, id):
        return [id, *(other for other in self.get_neighbors(id) if other != id)]

    def within(self, id, radius, fov=2.0 * math.pi, heading=(0.0, 0.0)):
        """Ids of the nodes and ids of the edges."""
        x, y = self.nodes[id]
        seen = {}
        for other, (a, b) in self.nodes.items():
            angle = math.remainder(math.atan2(b - y, a - x) - math.atan2(heading[1], heading[0]), 2.0 * math.pi)
            is_ahead = abs(angle) <= fov / 2.0 + 1e-12 or (a, b) == (x, y)
            sees_all = fov == 2.0 * math.pi or heading == (0.0, 0.0)
            if (a - x) ** 2 + (b - y) ** 2 <= radius**2 and (sees_all or is_ahead):
                seen[other] = None
        return list(seen), [edge for edge, row in self.edges.items() if row[0] in seen and row[1] in seen]
