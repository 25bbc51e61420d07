"""Both engines do what the contract says, whatever the programme: Hypothesis writes it, three answer it."""

import math
from functools import partial

import numpy as np
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule, run_state_machine_as_test
from shapely import LineString

from gamms.errors import GammsError
from gamms.graph import Engine

SETTINGS = settings(
    max_examples=16,
    stateful_step_count=50,
    deadline=None,
    derandomize=True,
    suppress_health_check=list(HealthCheck),
)

ids = st.integers(-1, 6)
odd_ids = st.sampled_from([2**40, np.int32(3), np.uint8(4), -(2**63), 2**63 - 1])
bad_ids = st.sampled_from(["1", 2.0, True, None, 2**63, np.float64(1)])
any_ids = st.one_of(ids, ids, ids, ids, odd_ids, bad_ids)
places = st.sampled_from([0.0, 1.0, 2.0, 3.0, -1.0, 0.5, 2, np.float32(1.5), 1e9])
bad_numbers = st.sampled_from([math.nan, math.inf, -math.inf, "1", None, False])
numbers = st.one_of(places, places, places, places, places, bad_numbers)
lengths = st.one_of(st.sampled_from([0, 1.0, 2.5]), st.sampled_from([0.0, 7]), st.just(-1.0), bad_numbers)
good_lengths = st.sampled_from([0.0, 1.0, 2.5])
lines = st.one_of(
    st.none(),
    st.lists(st.tuples(st.integers(0, 3), st.integers(0, 3)), min_size=1, max_size=4),
    st.just(LineString([(0, 0), (0.5, 7), (1, 1)])),
)
plain_values = st.recursive(
    st.one_of(st.none(), st.booleans(), st.integers(), st.floats(allow_nan=False), st.text(max_size=4), st.binary()),
    lambda inner: st.one_of(st.lists(inner, max_size=2), st.tuples(inner), st.dictionaries(st.text(), inner)),
    max_leaves=3,
)
extras = st.dictionaries(st.sampled_from(["name", "lanes", "osm:way", ""]), plain_values, max_size=2)
headings = st.sampled_from([(0.0, 0.0), (1.0, 0.0), (0.0, -1.0), (-1.0, 0.0), (math.sqrt(0.5), math.sqrt(0.5))])


def records(required, optional):
    """Dicts with the required keys, now and then without one, the optional ones and extra ones."""
    whole = st.fixed_dictionaries(required, optional=optional)
    partial_ = st.fixed_dictionaries({}, optional=required | optional)
    return st.builds(lambda base, extra: extra | base, st.one_of(whole, whole, whole, partial_), extras)


node_records = records({"id": any_ids, "x": numbers, "y": numbers}, {})
node_changes = records({"id": any_ids}, {"x": numbers, "y": numbers})
edge_records = records({"id": any_ids, "source": any_ids, "target": any_ids, "length": lengths}, {"linestring": lines})
edge_changes = records({"id": any_ids}, {"source": any_ids, "target": any_ids, "length": lengths, "linestring": lines})
good_nodes = st.fixed_dictionaries({"id": ids, "x": places, "y": places})
good_edges = st.fixed_dictionaries({"id": ids, "source": ids, "target": ids, "length": good_lengths})


class World:
    """A context of each engine, kept from one programme to the next."""

    def __init__(self, open_ctx, model, everything, folder):
        self.open_ctx, self.model, self.everything = open_ctx, model, everything
        self.folder = folder
        self.memory = open_ctx()
        self.reopen()

    def reopen(self):
        self.sqlite = self.open_ctx(Engine.SQLITE, graph_path=self.folder / "graph.db")

    @property
    def contexts(self):
        return (self.memory, self.sqlite)


class Programme(RuleBasedStateMachine):
    def __init__(self, world):
        super().__init__()
        self.world = world

    @initialize()
    def begin(self):
        self.model = self.world.model()
        for graph in self.graphs:
            graph.clear()

    @property
    def graphs(self):
        return [ctx.graph.graph for ctx in self.world.contexts]

    def edit(self, verb, *arguments):
        """All three do it, or none does, for a reason that the model allows and both engines share."""
        before = [graph.revision for graph in self.graphs]
        sizes = (len(self.model.nodes), len(self.model.edges))
        copies = [dict(one) for one in arguments if isinstance(one, dict)]
        allowed = getattr(self.model, verb)(*arguments)
        ends = [_end_of(partial(getattr(graph, verb), *arguments)) for graph in self.graphs]
        assert ends[0] == ends[1]
        assert ends[0] in allowed if allowed else ends[0] is None
        assert copies == [one for one in arguments if isinstance(one, dict)], "a caller's dict was changed"
        if not allowed and (verb != "remove_node" or sizes != (len(self.model.nodes), len(self.model.edges))):
            assert all(graph.revision != old for graph, old in zip(self.graphs, before, strict=True))

    def ask(self, expected, question):
        """All three say the same, or KeyError."""
        try:
            answer = expected()
        except KeyError:
            answer = KeyError
        for graph in self.graphs:
            try:
                found = question(graph)
            except KeyError:
                found = KeyError
            assert found == answer

    # -- edits --------------------------------------------------------------------------------------------------

    @rule(data=st.one_of(node_records, good_nodes, good_nodes))
    def add_node(self, data):
        self.edit("add_node", data)

    @rule(data=st.one_of(edge_records, good_edges, good_edges))
    def add_edge(self, data):
        self.edit("add_edge", data)

    @rule(data=node_changes)
    def update_node(self, data):
        self.edit("update_node", data)

    @rule(data=edge_changes)
    def update_edge(self, data):
        self.edit("update_edge", data)

    @rule(id=any_ids)
    def remove_node(self, id):
        self.edit("remove_node", id)

    @rule(id=any_ids)
    def remove_edge(self, id):
        self.edit("remove_edge", id)

    @rule(nodes=st.lists(st.tuples(ids, numbers.filter(lambda x: x is not False), places), max_size=4))
    def add_nodes(self, nodes):
        self.edit("add_nodes", *map(list, zip(*nodes, strict=True)) if nodes else ([], [], []))

    @rule(edges=st.lists(st.tuples(ids, ids, ids, good_lengths), min_size=1, max_size=4), measured=st.booleans())
    def add_edges(self, edges, measured):
        columns = [list(column) for column in zip(*edges, strict=True)]
        self.edit("add_edges", *(columns[:3] if measured else columns))

    # -- questions ----------------------------------------------------------------------------------------------

    @rule(id=ids)
    def ask_one(self, id):
        model = self.model
        self.ask(lambda: model.get_node(id), lambda graph: graph.get_node(id))
        self.ask(lambda: model.get_edge(id), lambda graph: (*graph.get_edge(id)[:4], graph.get_edge(id).points))
        self.ask(lambda: model.get_neighbors(id), lambda graph: list(graph.get_neighbors(id)))
        self.ask(lambda: model.neighborhood(id), lambda graph: list(graph.neighborhoods[id]))
        self.ask(lambda: model.nodes[id][2], lambda graph: graph.node_attributes(id))
        self.ask(lambda: model.edges[id][4], lambda graph: graph.edge_attributes(id))
        self.ask(lambda: id in model.nodes, lambda graph: graph.has_node(id))

    @rule(d=st.sampled_from([-1.0, 0, 0.0, 1.0, 2, 1e9, math.inf]), x=places, y=places)
    def ask_near(self, d, x, y):
        self.ask(lambda: self.model.get_nodes(d, x, y), lambda graph: list(graph.get_nodes(d, x, y)))
        self.ask(lambda: self.model.get_edges(d, x, y), lambda graph: list(graph.get_edges(d=d, x=x, y=y)))

    @rule(
        id=ids,
        radius=st.sampled_from([0.0, 1.0, 2.0, 30, math.inf]),
        fov=st.sampled_from([2 * math.pi, math.pi, math.pi / 2, 0.0, 1.0]),
        heading=headings,
    )
    def ask_within(self, id, radius, fov, heading):
        def seen(graph):
            nodes, edges = graph.within(id, radius, fov, heading)
            assert all(key == node.id and node == graph.get_node(key) for key, node in nodes.items())
            assert all(edge == graph.get_edge(edge.id) for edge in edges)
            return list(nodes), [edge.id for edge in edges]

        self.ask(lambda: self.model.within(id, radius, fov, heading), seen)

    @rule(some=st.lists(ids, max_size=4))
    def ask_positions(self, some):
        self.ask(lambda: [list(self.model.nodes[id][:2]) for id in some], lambda graph: graph.positions(some).tolist())

    @rule()
    def ask_columns(self):
        self.ask(lambda: _columns_of(self.model), lambda graph: _readable(graph.columns()))

    # -- to disk and back ---------------------------------------------------------------------------------------

    @rule()
    def save_and_load(self):
        for ctx in self.world.contexts:
            ctx.graph.save(self.world.folder / "map.gamms")
            ctx.graph.load(self.world.folder / "map.gamms")

    @rule()
    def end_and_reopen(self):
        self.world.sqlite.terminate()
        self.world.reopen()

    @invariant()
    def all_ids_are_the_same(self):
        self.ask(lambda: list(self.model.nodes), lambda graph: list(graph.get_nodes()))
        self.ask(lambda: list(self.model.edges), lambda graph: list(graph.get_edges()))

    def teardown(self):
        self.ask_columns()
        memory, sqlite = map(self.world.everything, self.world.contexts)
        assert memory == sqlite


def _end_of(call):
    try:
        return call()
    except (GammsError, KeyError) as error:
        return next(kind for kind in (KeyError, TypeError, ValueError) if isinstance(error, kind))


def _columns_of(model):
    nodes, edges = list(model.nodes), list(model.edges.values())
    return {
        "nodes": [(id, *model.nodes[id][:2]) for id in nodes],
        "edges": [(id, *row[:3]) for id, row in model.edges.items()],
        "out": [[i for i, row in enumerate(edges) if row[0] == node] for node in nodes],
        "polylines": {i: row[3] for i, row in enumerate(edges) if row[3] is not None},
        "node attributes": {i: model.nodes[id][2] for i, id in enumerate(nodes) if model.nodes[id][2]},
        "edge attributes": {i: row[4] for i, row in enumerate(edges) if row[4]},
    }


def _readable(columns):
    def by_row(attributes):
        rows = {}
        for name, values in attributes.items():
            for row, value in values.items():
                rows.setdefault(row, {})[name] = value
        return rows

    c = columns
    return {
        "nodes": list(zip(c.node_ids.tolist(), *c.xy.T.tolist(), strict=True)),
        "edges": list(
            zip(
                c.edge_ids.tolist(),
                c.node_ids[c.sources].tolist(),
                c.node_ids[c.targets].tolist(),
                c.lengths.tolist(),
                strict=True,
            )
        ),
        "out": [c.out_edges[a:b].tolist() for a, b in zip(c.offsets, c.offsets[1:], strict=False)],
        "polylines": {row: tuple(polyline.ravel().tolist()) for row, polyline in c.polylines.items()},
        "node attributes": by_row(c.node_attributes),
        "edge attributes": by_row(c.edge_attributes),
    }


def test_both_engines_do_what_the_contract_says(open_ctx, model, everything, tmp_path):
    world = World(open_ctx, model, everything, tmp_path)
    try:
        run_state_machine_as_test(lambda: Programme(world), settings=SETTINGS)
    finally:
        for ctx in world.contexts:
            ctx.terminate()
