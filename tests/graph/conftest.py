"""Quiet contexts, a description of everything a graph holds, and the contract as plain dicts."""

import math

import numpy as np
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


def id_faults(value):
    if isinstance(value, bool) or not isinstance(value, int | np.integer):
        return {TypeError}
    return set() if -(2**63) <= value < 2**63 else {ValueError}


def number_faults(value, least=-math.inf):
    if isinstance(value, bool) or not isinstance(value, int | float | np.number):
        return {TypeError}
    return set() if math.isfinite(value) and value >= least else {ValueError}


class Model:
    """The contract (sections 0, 3 and 4.3) in the plainest way: two dicts and loops.

    An edit returns the exception classes it may end in; with one of them nothing has changed.
    """

    def __init__(self):
        self.nodes = {}  # id -> (x, y, attributes)
        self.edges = {}  # id -> (source, target, length, polyline or None, attributes)

    # -- edits --------------------------------------------------------------------------------------------------

    def add_node(self, data):
        faults = set() if {"id", "x", "y"} <= data.keys() else {ValueError}
        faults |= id_faults(data.get("id", 0)) | number_faults(data.get("x", 0)) | number_faults(data.get("y", 0))
        if data.get("id") in self.nodes:
            faults |= {KeyError}
        if not faults:
            self.nodes[int(data["id"])] = (float(data["x"]), float(data["y"]), _others(data, "id", "x", "y"))
        return faults

    def update_node(self, data):
        if "id" not in data:
            return {ValueError}
        faults = id_faults(data["id"])
        if data["id"] not in self.nodes:
            return faults | {KeyError}
        x, y, attributes = self.nodes[data["id"]]
        x, y = data.get("x", x), data.get("y", y)
        faults |= number_faults(x) | number_faults(y)
        if not faults:
            self.nodes[int(data["id"])] = (float(x), float(y), attributes | _others(data, "id", "x", "y"))
        return faults

    def add_edge(self, data):
        faults = set() if {"id", "length"} <= data.keys() else {ValueError}
        faults |= self._edge_faults(data)
        if data.get("id") in self.edges:
            faults |= {KeyError}
        if not faults:
            self._put(data, _polyline(data.get("linestring")), {})
        return faults

    def update_edge(self, data):
        if "id" not in data:
            return {ValueError}
        if data["id"] not in self.edges:
            return id_faults(data["id"]) | {KeyError}
        source, target, length, line, attributes = self.edges[data["id"]]
        full = {"source": source, "target": target, "length": length, **data}
        faults = self._edge_faults(full)
        if not faults:
            if "linestring" in data:
                line = _polyline(data["linestring"])
            elif (full["source"], full["target"]) != (source, target):
                line = None
            self._put(full, line, attributes)
        return faults

    def remove_node(self, id):
        if not id_faults(id) and id in self.nodes:
            del self.nodes[id]
            self.edges = {edge: row for edge, row in self.edges.items() if id not in row[:2]}
        return id_faults(id)

    def remove_edge(self, id):
        if not id_faults(id) and id in self.edges:
            del self.edges[id]
            return set()
        return id_faults(id) or {KeyError}

    def add_nodes(self, ids, x, y):
        faults = {KeyError} if len(set(ids)) < len(ids) or self.nodes.keys() & set(ids) else set()
        for value in (*x, *y):
            faults |= number_faults(value)
        if not faults:
            self.nodes.update({id: (float(a), float(b), {}) for id, a, b in zip(ids, x, y, strict=True)})
        return faults

    def add_edges(self, ids, sources, targets, lengths=None):
        faults = {KeyError} if len(set(ids)) < len(ids) or self.edges.keys() & set(ids) else set()
        if not {*sources, *targets} <= self.nodes.keys():
            faults |= {KeyError}
        for length in lengths or ():
            faults |= number_faults(length, 0.0)
        if not faults:
            for i, (id, source, target) in enumerate(zip(ids, sources, targets, strict=True)):
                straight = np.hypot(*np.subtract(self.nodes[source][:2], self.nodes[target][:2]))
                self.edges[id] = (source, target, float(straight if lengths is None else lengths[i]), None, {})
        return faults

    # -- queries; KeyError where there is nothing ----------------------------------------------------------------

    def get_node(self, id):
        return (id, *self.nodes[id][:2])

    def get_edge(self, id):
        source, target, length, line, _ = self.edges[id]
        return (id, source, target, length, self.nodes[source][:2] + self.nodes[target][:2] if line is None else line)

    def get_nodes(self, d=-1.0, x=0.0, y=0.0):
        d, x, y = float(d), float(x), float(y)
        return [id for id, (a, b, _) in self.nodes.items() if d < 0 or (a - x) ** 2 + (b - y) ** 2 <= d * d]

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
        x, y, _ = self.nodes[id]
        seen = {}
        for other, (a, b, _) in self.nodes.items():
            angle = math.remainder(math.atan2(b - y, a - x) - math.atan2(heading[1], heading[0]), 2.0 * math.pi)
            is_ahead = abs(angle) <= fov / 2.0 + 1e-12 or (a, b) == (x, y)
            sees_all = fov == 2.0 * math.pi or heading == (0.0, 0.0)
            if (a - x) ** 2 + (b - y) ** 2 <= radius**2 and (sees_all or is_ahead):
                seen[other] = None
        return list(seen), [edge for edge, row in self.edges.items() if row[0] in seen and row[1] in seen]

    # -- inside -------------------------------------------------------------------------------------------------

    def _edge_faults(self, data):
        faults = id_faults(data.get("id", 0)) | number_faults(data.get("length", 0.0), 0.0)
        for end in ("source", "target"):
            faults |= id_faults(data.get(end, 0)) or (set() if data.get(end, "none") in self.nodes else {KeyError})
        return faults if _is_polyline(data.get("linestring")) else faults | {ValueError}

    def _put(self, data, line, attributes):
        source, target = int(data["source"]), int(data["target"])
        if line == self.nodes[source][:2] + self.nodes[target][:2]:
            line = None  # the straight line
        attributes = attributes | _others(data, "id", "source", "target", "length", "linestring")
        self.edges[int(data["id"])] = (source, target, float(data["length"]), line, attributes)


def _others(data, *ours):
    return {key: value for key, value in data.items() if key not in ours}


def _polyline(line):
    return None if line is None else tuple(float(number) for point in getattr(line, "coords", line) for number in point)


def _is_polyline(line):
    return line is None or (hasattr(line, "coords") or len(line) >= 2)
