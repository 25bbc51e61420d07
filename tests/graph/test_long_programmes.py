"""Long series of edits of a graph: indexes wear out, tables compact, and no answer changes."""

import math
import random

import pytest

NODES, EDGES = 150, 600


class LongProgramme:
    """Random edits of a graph and of its model, with looks in between."""

    def __init__(self, graph, model, seed):
        self.graph, self.model, self.random = graph, model, random.Random(seed)
        self.next_id = 10_000
        ids = list(range(100, 100 + NODES))
        ends = [self.random.choices(ids, k=EDGES) for _ in range(2)]
        self.both("add_nodes", ids, self.places(NODES), self.places(NODES))
        self.both("add_edges", list(range(EDGES)), *ends, [1.0] * EDGES)

    def places(self, count):
        return [float(self.random.randrange(30)) for _ in range(count)]

    def both(self, verb, *arguments):
        getattr(self.model, verb)(*arguments)
        getattr(self.graph, verb)(*arguments)

    def node(self):
        return self.random.choice(list(self.model.nodes))

    def edge(self):
        return self.random.choice(list(self.model.edges))

    def fresh(self):
        self.next_id += self.random.choice((1, 1, 1, -7, 50))
        return self.next_id if self.next_id not in self.model.nodes | self.model.edges else self.fresh()

    def step(self, weights):
        verb = self.random.choices(list(weights), list(weights.values()))[0]
        getattr(self, verb)()

    def add_node(self):
        x, y = self.places(2)
        self.both("add_node", {"id": self.fresh(), "x": x, "y": y})

    def add_edge(self):
        data = {"id": self.fresh(), "source": self.node(), "target": self.node(), "length": 2.0}
        self.both("add_edge", data | self.random.choice(({}, {"linestring": [(0, 0), (5, 5), (9, 0)]}, {"lanes": 2})))

    def move_node(self):
        self.both("update_node", {"id": self.node(), "x": self.places(1)[0]})

    def move_edge_to_and_fro(self):
        id = self.edge()
        source, target = self.model.edges[id][:2]
        self.both("update_edge", {"id": id, "source": self.node(), "target": self.node()})
        if self.random.random() < 0.7:
            self.look_at(source)
            self.both("update_edge", {"id": id, "source": source, "target": target})
            self.look_at(source)

    def remove_node(self):
        self.both("remove_node", self.node())

    def remove_edge(self):
        self.both("remove_edge", self.edge())

    def put_back(self):
        id = self.node()
        x, y = self.model.nodes[id]
        self.both("remove_node", id)
        self.both("add_node", {"id": id, "x": x, "y": y})

    def look(self):
        self.look_at(self.node())

    def look_at(self, id):
        graph, model = self.graph, self.model
        x, y = model.nodes[id]
        radius = self.random.choice((0.0, 1.0, 5.0, math.inf))
        fov, heading = self.random.choice(((2 * math.pi, (1.0, 0.0)), (2.0, (0.0, 1.0)), (math.pi, (-1.0, 0.0))))
        nodes, edges = graph.within(id, radius, fov, heading)
        assert (list(nodes), [edge.id for edge in edges]) == model.within(id, radius, fov, heading)
        assert list(nodes.values()) == [model.get_node(other) for other in nodes]
        assert [(*edge[:4], edge.points) for edge in edges] == [model.get_edge(edge.id) for edge in edges]
        assert list(graph.get_nodes(radius, x, y)) == model.get_nodes(radius, x, y)
        assert list(graph.get_edges(radius, x, y)) == model.get_edges(radius, x, y)
        assert list(graph.get_neighbors(id)) == model.get_neighbors(id)
        assert list(graph.neighborhoods[id]) == model.neighborhood(id)

    def look_at_all(self):
        graph, model = self.graph, self.model
        assert [graph.get_node(id) for id in graph.get_nodes()] == [model.get_node(id) for id in model.nodes]
        found = [graph.get_edge(id) for id in graph.get_edges()]
        assert [(*edge[:4], edge.points) for edge in found] == [model.get_edge(id) for id in model.edges]
        graph.neighborhoods.learn(self.random.sample([*model.nodes, 10**6], len(model.nodes) // 2))  # and one unknown
        for id in model.nodes:
            assert list(graph.neighborhoods[id]) == model.neighborhood(id)
        assert graph.positions(list(model.nodes)).tolist() == [list(place) for place in model.nodes.values()]


PROGRAMMES = {
    "everything": {
        "add_node": 3,
        "add_edge": 6,
        "move_node": 3,
        "move_edge_to_and_fro": 3,
        "remove_node": 1,
        "remove_edge": 3,
        "put_back": 1,
        "look": 1,
    },
    "moving": {"move_node": 10, "look": 1},
    "rewiring": {"move_edge_to_and_fro": 5, "look": 1},
    "growing": {"add_node": 5, "add_edge": 10, "look": 1},
    "putting back": {"put_back": 5, "add_edge": 10, "remove_edge": 5, "look": 1},
}


@pytest.mark.parametrize("name", PROGRAMMES)
def test_no_answer_depends_on_when_tables_were_built(graph, model, name):
    programme = LongProgramme(graph, model(), seed=name)
    for _ in range(500):
        programme.step(PROGRAMMES[name])
    programme.look_at_all()
