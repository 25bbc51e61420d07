"""What spreads along edges, of many games at once, is what the graph and beliefs say one by one."""

import numpy as np
import pytest
from batch_scenes import scene
from hypothesis import given, settings
from hypothesis import strategies as st

import gamms
from gamms import belief, limits
from gamms.errors import BadValue, TooLarge
from gamms.game.movement import flows, routes
from gamms.game.movement.flows import Flows
from gamms.game.movement.streets import StreetGraph

EDGES = st.lists(st.tuples(st.integers(0, 6), st.integers(0, 6), st.sampled_from([0.0, 1.0, 2.0, 3.5])), max_size=20)


def small_map(ctx, edges):
    """Seven nodes, whose ids are not their rows, with these edges."""
    for node in range(7):
        ctx.graph.graph.add_node({"id": (node * 3) % 7, "x": float(node), "y": float(node % 3)})
    for number, (source, target, length) in enumerate(edges):
        ctx.graph.graph.add_edge({"id": number, "source": source, "target": target, "length": length})
    return Flows(StreetGraph(ctx.graph.columns(), ctx.graph.routes))


@settings(max_examples=25, deadline=None, derandomize=True)
@given(edges=EDGES, stay=st.sampled_from([None, 0.0, 0.3]), turns=st.integers(0, 3))
def test_probabilities_diffuse_as_those_of_filters(edges, stay, turns):
    with gamms.create_context(seed=1) as ctx:
        found = small_map(ctx, edges)
        masses = np.random.default_rng(1).random((2, 3, 7))
        filter = belief.Filter(ctx, belief.random_walk(stay), [*"abcdef"])
        filter.masses = masses.reshape(6, 7).T.copy()
        filter.predict(turns)
        diffused = found.diffuse(masses, turns, stay)
        assert (diffused.reshape(6, 7) == filter.masses.T).all()
        assert (found.diffuse(masses[1, 2], turns, stay) == diffused[1, 2]).all()
        assert (found.diffuse(masses) == found.diffuse(masses, turns=1)).all()


@settings(max_examples=25, deadline=None, derandomize=True)
@given(
    edges=EDGES,
    limit=st.sampled_from([0.0, 1.0, 3.0]),
    weight=st.sampled_from(["length", None]),
)
def test_nodes_in_reach_are_those_that_the_graph_gives(edges, limit, weight):
    with gamms.create_context(seed=1) as ctx:
        found, ids = small_map(ctx, edges), ctx.graph.columns().node_ids
        for nodes in (np.array([[0, 3], [3, 6]]), np.arange(7)):
            reached = found.within(nodes, limit, weight)
            for place in np.ndindex(nodes.shape):
                near = ctx.graph.distances(source=int(ids[nodes[place]]), weight=weight, cutoff=limit)
                assert set(ids[reached[place]].tolist()) == set(near)


@settings(max_examples=15, deadline=None, derandomize=True)
@given(
    edges=EDGES,
    most=st.sampled_from([28, 84, 1 << 20]),
    weight=st.sampled_from([None, "length"]),
)
def test_distances_are_those_of_the_graph_added_up_from_the_sources(edges, most, weight):
    with gamms.create_context(seed=1) as ctx, pytest.MonkeyPatch.context() as patch:
        patch.setattr(routes, "_MOST_BYTES", most)
        found, ids = small_map(ctx, edges), ctx.graph.columns().node_ids.tolist()
        for nodes in (np.array([3, 1]), np.array([[3, 6, 0]]), np.arange(7)):
            expected = ctx.graph.distance_matrix([ids[one] for one in nodes.ravel()], ids, weight=weight)
            assert (found.far(nodes[..., None], np.arange(7), weight).reshape(-1, 7) == expected).all()
            assert weight is not None or (found.edges(nodes[..., None], np.arange(7)).reshape(-1, 7) == expected).all()


def test_walks_of_as_many_turns_as_are_said_to_fit_do():
    with scene().batch(2) as games, limits.allowing(6 * 8 * 11):
        found, nodes = games.observe("red").flows(), games.observe("red").node
        with pytest.raises(TooLarge, match="6 walks of 11 turns, of which 10 would fit"):
            found.walks(nodes, 11)
        assert len(found.walks(nodes, 10)) == 11
        with pytest.raises(TooLarge, match="0 walks of 66 turns, of which 65 would fit"):
            found.walks(nodes[:0], 66)
        assert found.walks(nodes[:0], 65).shape == (66, 0, 3)


def test_walks_are_spread_as_probabilities_diffuse():
    with scene().batch(1) as games:
        view = games.observe("red")
        ends = view.flows().walks(np.full(20_000, 7), 3)[-1]
        masses = view.flows().diffuse(np.eye(25)[7], 3)
        assert np.bincount(ends, minlength=25) / 20_000 == pytest.approx(masses, abs=0.02)
        for kind in (int, bool):
            assert (view.flows().diffuse(np.eye(25, dtype=kind)[7], 3) == masses).all()


def test_what_cannot_be_is_refused(monkeypatch):
    with scene().batch(2) as games:
        found = games.observe("red").flows()
        with pytest.raises(BadValue, match="must have 25 nodes"):
            found.diffuse(np.zeros((25, 2)))
        with pytest.raises(BadValue, match="stay must be"):
            found.diffuse(np.zeros(25), stay=1.5)
        with pytest.raises(TooLarge, match=r"6 walks of 1000000000 turns, of which \d+ would fit, would take about"):
            found.walks(games.observe("red").node, 10**9)
        for wrong in (-0.1, np.nan, np.inf):
            with pytest.raises(BadValue, match=f"masses must be finite and not negative, not {wrong}"):
                found.diffuse(np.where(np.arange(25) == 3, wrong, 0.0))
        monkeypatch.setattr(flows, "_MOST_DENSE", 100)
        with pytest.raises(TooLarge, match="Ask for fewer games"):
            found.within(np.arange(5), 10.0)
