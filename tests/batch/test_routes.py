"""Distances and steps of many agents at once are those that the graph gives one by one."""

import numpy as np
import pytest
from batch_scenes import scene
from hypothesis import given, settings
from hypothesis import strategies as st

import gamms
from gamms.errors import BadType, BadValue, UnknownName
from gamms.game.movement import routes
from gamms.game.movement.routes import RouteTable
from gamms.game.movement.streets import StreetGraph
from gamms.strategies.knowledge import step_towards

EDGES = st.lists(
    st.tuples(st.integers(0, 6), st.integers(0, 6), st.sampled_from([0.0, 1.0, 1.0, 2.0, 3.5])), max_size=20
)


def small_map(ctx, edges):
    """Seven nodes, whose ids are not their rows, with these edges."""
    for node in range(7):
        ctx.graph.graph.add_node({"id": (node * 3) % 7, "x": float(node), "y": float(node % 3)})
    for number, (source, target, length) in enumerate(edges):
        ctx.graph.graph.add_edge({"id": number, "source": source, "target": target, "length": length})


@pytest.mark.parametrize("kind", [np.uint8, np.uint64, np.int32])
@pytest.mark.parametrize("leaves", [2, 9])  # as many neighbours for about all, and many for one alone
def test_actions_lead_to_the_legal_nodes_one_by_one(leaves, kind):
    with gamms.create_context(seed=1) as ctx:
        small_map(ctx, [])
        for leaf in range(10, 10 + leaves):
            ctx.graph.graph.add_node({"id": leaf, "x": float(leaf), "y": 0.0})
            ctx.graph.graph.add_edge({"id": leaf, "source": 5, "target": leaf, "length": 1.0})
        streets, near = StreetGraph(ctx.graph.columns(), ctx.graph.routes), ctx.graph.graph.neighborhoods
        rows = np.arange(len(streets.counts))
        for row, (node, count) in enumerate(zip(streets.ids(rows).tolist(), streets.count_legal(rows), strict=True)):
            led = streets.step(np.full(count, row), np.arange(count, dtype=kind))
            assert streets.ids(led).tolist() == list(near[node])


@settings(max_examples=16, deadline=None)
@given(
    edges=EDGES,
    first=st.lists(st.tuples(st.integers(0, 6), st.integers(0, 6)), max_size=3),
    most=st.integers(1, 7),
)
def test_steps_and_distances_are_those_of_strategies(edges, first, most):
    with gamms.create_context(seed=1) as ctx, pytest.MonkeyPatch.context() as patch:
        small_map(ctx, edges)
        patch.setattr(routes, "_MOST_BYTES", most * 40)
        streets, graph = StreetGraph(ctx.graph.columns(), ctx.graph.routes), ctx.graph.graph
        table, ids = RouteTable(streets, "length"), ctx.graph.columns().node_ids
        for one, other in first:  # tables of what is near, which later questions extend
            table.distances(np.array([one]), np.array([other]))
        sources, targets = (part.reshape(-1) for part in np.indices((7, 7)))
        far, actions = table.distances(sources, targets), table.actions(sources, targets)
        allowed = ids != 4
        careful = table.actions(sources, targets, allowed)
        for source, target, distance, action, other in zip(sources, targets, far, actions, careful, strict=True):
            here, goal = int(ids[source]), int(ids[target])
            legal = graph.neighborhoods[here]
            state = {"curr_pos": here, "legal": legal}
            assert graph.distance(here, goal) == distance
            assert step_towards(ctx, state, goal, "test") == (None if action < 0 else legal[action])
            if allowed[target] and action >= 0:
                expected = step_towards(ctx, state, goal, "test", lambda node: node != 4)
                assert expected == legal[other]


def test_tables_of_targets_say_what_distances_and_paths_say(grid_of_streets):
    ctx = grid_of_streets
    ids = ctx.graph.columns().node_ids
    found = ctx.graph.routes.tables([3, 17])
    for line, target in enumerate((3, 17)):
        for row, node in enumerate(ids.tolist()):
            assert found.distances[line, row] == ctx.graph.distance(node, target)
            path = ctx.graph.graph.shortest_path(node, target)
            assert found.next_rows[line, row] == (-1 if len(path) == 1 else int(np.flatnonzero(ids == path[1])[0]))
    near = ctx.graph.routes.tables([3], cutoff=20.0)
    assert np.isfinite(near.distances).sum() == (found.distances[0] <= 20.0).sum()
    with pytest.raises(UnknownName):
        ctx.graph.routes.tables([99])
    with pytest.raises(BadValue, match="cutoff"):
        ctx.graph.routes.tables([3], cutoff=-1.0)


@pytest.fixture
def grid_of_streets():
    with scene().build(seed=1) as ctx:
        yield ctx


def test_batches_on_equal_graphs_share_their_tables(monkeypatch):
    monkeypatch.setattr(routes, "_shared", type(routes._shared)())
    scenario = scene(teams={"red": {"count": 2, "strategy": "gamms.strategies:random_walk"}})
    with scenario.batch(2) as games, scenario.batch(3) as others, scene(side=6).batch(1) as larger:
        table = games.observe("red").routes()
        table.distances(np.arange(25), np.full(25, 7))
        assert others.observe("red").routes() is table
        assert others.observe("red").routes(None) is not table
        assert larger.observe("red").routes() is not table
        assert len(routes._shared) == 3
        monkeypatch.setattr(routes, "_MOST_BYTES", table.nbytes - 1)
        with scene(side=4).batch(1) as fresh:
            fresh.observe("red").routes()
        assert len(routes._shared) == 3  # the largest is gone
        assert games.observe("red").routes() is table


@settings(max_examples=25, deadline=None)
@given(
    edges=EDGES,
    asked=st.lists(st.tuples(st.booleans(), st.lists(st.integers(0, 48), min_size=1, max_size=4)), max_size=6),
    most=st.integers(1, 9),
)
def test_earlier_queries_change_no_answer(edges, asked, most):
    with gamms.create_context(seed=1) as ctx, pytest.MonkeyPatch.context() as patch:
        small_map(ctx, edges)
        streets = StreetGraph(ctx.graph.columns(), ctx.graph.routes)
        sources, targets = (part.reshape(-1) for part in np.indices((7, 7)))
        fresh = RouteTable(streets, "length")
        far, actions = fresh.distances(sources, targets), fresh.actions(sources, targets)
        patch.setattr(routes, "_MOST_BYTES", most * 40)
        table = RouteTable(streets, "length")
        for for_ways, pairs in asked:
            expected, found = (actions, table.actions) if for_ways else (far, table.distances)
            assert found(sources[pairs], targets[pairs]).tolist() == expected[pairs].tolist()
        assert table.distances(sources, targets).tolist() == far.tolist()


ROWS = {
    "a row that is not there": (99, BadValue, "99 is out of range; the 25 nodes"),
    "a negative row": (-1, BadValue, "-1 is out of range; the 25 nodes"),
    "a row beyond 63 bits": (np.array([1 << 63], np.uint64), BadValue, "the 25 nodes"),
    "floats": ([1.0], BadType, "must be an array of integers, not"),
    "booleans": (np.array([True]), BadType, "must be an array of integers"),
    "lists of several lengths": ([[0], [0, 1]], BadType, "must be an array of integers"),
    "another shape": ([1, 2, 3], BadValue, "which does not broadcast to one shape"),
}


@pytest.mark.parametrize("case", ROWS)
def test_an_invalid_node_row_is_refused(case):
    rows, kind, message = ROWS[case]
    here = np.array([0, 1])
    with scene().batch(2) as games:
        view = games.observe("red")
        routes = view.routes()
        pairs = (routes.distances, routes.actions)
        for ask in (*pairs, *(lambda one, other, ask=ask: ask(other, one) for ask in pairs)):
            with pytest.raises(kind, match=message):
                ask(rows, here)
        streets = view.streets
        alone = (streets.ids, lambda one: streets.step(one, 0), lambda one: streets.action_to(one, here[:1]))
        for ask in alone:
            if case != "another shape":
                with pytest.raises(kind, match=message):
                    ask(rows)
        assert routes.distances(here, here).tolist() == [0.0, 0.0]


@pytest.mark.parametrize(
    ("actions", "kind", "message"),
    [
        (-1, BadValue, "from node 40 there is no action -1, only 0 to 1"),
        ([0, 5], BadValue, "from node 50 there is no action 5, only 0 to 2"),
        (np.array([0, 1 << 63], np.uint64), BadValue, "there is no action 9223372036854775808"),
        ([0.0, 1.0], BadType, "actions must be an array of integers"),
        ([1, 1, 1], BadValue, r"actions has the shape \(3,\), which does not broadcast to one shape"),
    ],
)
def test_an_invalid_number_of_a_legal_node_is_refused(actions, kind, message):
    with gamms.create_context() as ctx:
        ctx.graph.add_nodes([40, 50, 60], [0.0, 1.0, 2.0], [0.0] * 3)
        ctx.graph.add_edges(range(4), [40, 50, 50, 60], [50, 40, 60, 50])
        streets = StreetGraph(ctx.graph.columns(), ctx.graph.routes)
        with pytest.raises(kind, match=message):
            streets.step([0, 1], actions)


def test_an_invalid_weight_name_is_refused():
    with scene().batch(2) as games:
        view = games.observe("red")
        with pytest.raises(BadType, match="weight must be"):
            view.routes({})
