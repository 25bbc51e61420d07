"""Observations of nodes: neighbourhoods and graphs."""

import networkx as nx
import numpy as np
import pytest

import gamms
from gamms import rl
from gamms.errors import BadType, BadValue, TooLarge
from gamms.game.plan import find_first_called
from gamms.scenario import Scenario

WALK = "gamms.strategies:random_walk"


def scene(width=5, **more):
    """Two agents that see two others on a grid."""
    teams = {"red": {"count": 2, "strategy": WALK, "sensors": ["near"]}, "blue": {"count": 2, "strategy": WALK}}
    rules = [{"rule": "tag", "with": {"taggers": "red", "tagged": "blue", "then": "eliminate"}}]
    near = {"near": {"type": "AGENT_RANGE", "sensor_range": 30}}
    given = {"teams": teams, "sensors": near, "rules": rules, "max_turns": 15, **more}
    return Scenario(map={"grid": {"width": width, "height": 4}}, **given)


def test_a_neighbourhood_shows_mates_and_enemies_where_they_are():
    sight = {"near": {"type": "AGENT_RANGE", "sensor_range": 1000}}
    with rl.Learners(scene(sensors=sight), 9, teams=["red"], observation=rl.neighbourhood(9)) as learners:
        values, red, blue = learners.observe(), *(learners.games.observe(team) for team in ("red", "blue"))
        assert (values[..., 5].sum(axis=2) == 1).all()
        assert (values[..., 6].sum(axis=2) == 2).all()
        for game, agent in np.ndindex(9, 2):
            offsets = np.float32((blue["xy"][game] - red["xy"][game, agent]) / 20.0)
            shown = values[game, agent][values[game, agent, :, 6] > 0]
            assert {tuple(one) for one in offsets.tolist()} == {tuple(one) for one in shown[:, 1:3].tolist()}


def test_a_graph_has_the_nodes_and_edges_of_the_map():
    observe = rl.graph()
    with pytest.raises(BadValue, match="reset the environment first"):
        _ = observe.edge_index
    env = rl.vector_env(scene(), num_games=3, team="red", observation=observe)
    observed, _ = env.reset(seed=1)
    values, view = observed["observation"], env.learners.games.observe("red")
    columns = view.streets.columns
    assert values.shape == (6, 20, len(observe.names))
    assert observe.edge_index.dtype == np.int64
    assert observe.edge_index.tolist() == [columns.sources.tolist(), columns.targets.tolist()]
    assert values[..., 2].argmax(axis=1).tolist() == view.node.ravel().tolist()
    assert (values[..., 2].sum(axis=1) == 1).all()
    assert ((values[..., 3] >= 0).sum(axis=1) == view.counts.ravel()).all()
    assert values[0, :, :2].min() >= -1
    one, several = observe.data(values[0]), observe.data(values)
    assert one["x"].shape == (20, 6)
    assert one["edge_index"].shape == observe.edge_index.shape
    assert several["x"].shape == (120, 6)
    assert several["edge_index"].max() == 119
    assert np.bincount(several["batch"]).tolist() == [20] * 6
    assert (several["batch"][several["edge_index"][0]] == several["batch"][several["edge_index"][1]]).all()
    env.close()


def test_padded_graphs_have_one_shape_and_the_edges_of_each_map():
    maps = [{"grid": {"width": width, "height": height}} for width, height in ((5, 4), (2, 3), (7, 3))]
    observe = rl.graph(nodes=23)
    env = rl.vector_env(scene(), num_games=12, team="red", maps=maps, observation=observe)
    observed, _ = env.reset(seed=1)
    values = observed["observation"]
    assert values.shape == (24, 23, len(observe.names))
    of_rows = np.repeat(env.unwrapped.learners.games.maps, 2)
    assert {*of_rows.tolist()} == {0, 1, 2}
    found = observe.data(values, of_rows)
    assert found["x"].shape == (24 * 23, 6)
    sources, targets = found["edge_index"]
    assert (found["batch"][sources] == found["batch"][targets]).all()
    for row, number in enumerate(of_rows.tolist()):
        own = rl.graph()
        alone = rl.vector_env(scene().replace(map=maps[number]), num_games=1, team="red", observation=own)
        alone.reset(seed=1)
        assert np.array_equal(observe.edges_of(number), own.edge_index)
        is_own = found["batch"][sources] == row
        assert np.array_equal(found["edge_index"][:, is_own] - 23 * row, own.edge_index)
        size = maps[number]["grid"]["width"] * maps[number]["grid"]["height"]
        assert not values[row, size:].any()
        assert values[row, :size, 2].sum() == 1
        one = observe.data(values[row], number)
        assert np.array_equal(one["edge_index"], own.edge_index)
        alone.close()
    with pytest.raises(BadValue, match="The edges of map 3 are known when it was observed"):
        observe.data(values[:1], 3)
    with pytest.raises(BadValue, match=r"rl.graph\(nodes=19\) has no room for map \d, which has 2\d nodes"):
        rl.vector_env(scene(), num_games=12, team="red", maps=maps, observation=rl.graph(nodes=19))
    env.close()


def test_a_move_of_a_pursuer_leaves_the_nodes_that_enemies_reach_first():
    sight = {"near": {"type": "AGENT_RANGE", "sensor_range": 1000}}
    with rl.Learners(scene(sensors=sight), 4, teams=["red"], observation=rl.pursuit_observation) as learners:
        values = learners.observe().reshape(4, 2, learners.num_actions, -1)
        red, blue = (learners.games.observe(team) for team in ("red", "blue"))
        streets = nx.Graph(zip(red.streets.columns.sources.tolist(), red.streets.columns.targets.tolist(), strict=True))
        far = dict(nx.all_pairs_shortest_path_length(streets))
        legal, is_legal = red.legal_rows()
        for game, agent, action in np.argwhere(is_legal).tolist():
            here, mate = int(legal[game, agent, action]), int(red.node[game, 1 - agent])
            evaders = blue.node[game].tolist()
            reached = {node: min(far[one][node] for one in evaders) for node in streets}
            room = [node for node in streets if reached[node] < min(far[here][node], far[mate][node])]
            rings = streets.subgraph(room).number_of_edges() - len(room) + bool(room)
            entries = {
                "is_legal": 1,
                "stays": here == red.node[game, agent],
                "enemy": reached[here] / 10,
                "mate": far[mate][here] / 10,
                "mate_to_enemy": reached[mate] / 10,
                "share": len(room) / 20,
                "room": np.log1p(len(room)) / 3,
                "rings": np.log1p(max(rings, 0)),
                "depth": max([reached[node] for node in room], default=0) / 10,
                "ways_out": sum(reached[node] <= 1 for node in room) / 3,
            }
            assert tuple(entries) == rl.pursuit_observation.names
            np.testing.assert_allclose(values[game, agent, action], [*map(float, entries.values())], rtol=1e-6)
        assert not values[..., ~is_legal.any(axis=(0, 1)), :].any()


def test_a_pursuer_that_sees_no_one_observes_the_farthest_distances():
    blind = {"near": {"type": "AGENT_RANGE", "sensor_range": 0}}
    with rl.Learners(scene(sensors=blind), 9, teams=["red"], observation=rl.pursuit_observation) as learners:
        values = learners.observe().reshape(9, 2, learners.num_actions, -1)
        view = learners.games.observe("red")
        sees_no_one = np.ones((9, 2), np.bool_)
        seen = view.seen()
        sees_no_one[seen.at, seen.viewers] = False
        stays = values[sees_no_one][:, 0]
        assert len(stays)
        assert (stays == np.float32([1, 1, 10, 10, 10, 0, 0, 0, 0, 0])).all()


@pytest.mark.parametrize("make", [lambda: rl.neighbourhood(2), rl.graph])
def test_a_strategy_that_observes_nodes_plays_the_same_games_alone(make):
    observe = make()

    @gamms.array_strategy
    def crowd(view):
        values = observe(view)
        score = values[..., -2] + 2 * values[..., -1] + 0.01 * np.arange(values.shape[2])
        action = values[..., -3].astype(int)
        best = np.where(action >= 0, score, -1.0).argmax(axis=2)
        return np.maximum(np.take_along_axis(action, best[..., None], axis=2)[..., 0], 0)

    with scene().batch(5, strategies={"red": crowd}) as games:
        games.run()
        assert find_first_called(games.game, games.roster) is None
        for game in range(5):
            assert games.result(game) == scene().play(seed=game, strategies={"red": crowd})


def test_wrong_arguments_of_observations_are_refused_by_name():
    with pytest.raises(BadValue, match="hops"):
        rl.neighbourhood(0)
    with pytest.raises(BadType, match="nodes"):
        rl.neighbourhood(2, nodes="many")
    learners = rl.Learners(scene(), 30, teams=["red"], observation=rl.graph())
    with learners, pytest.raises(TooLarge, match="A map of 20 nodes for 60 agents"), gamms.limits.allowing(20_000):
        learners.observe()
