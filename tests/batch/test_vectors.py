"""Agents are observed as vectors of numbers, which say what their states say."""

import numpy as np
import pytest
from batch_scenes import scene

import gamms
from gamms.errors import TooLarge
from gamms.rl.learners import Learners, default_observation, straight_observation
from gamms.scenario import Scenario

NEAR = {"near": {"type": "AGENT_RANGE", "sensor_range": 25.0}}
WALKS = {"count": 3, "strategy": "gamms.strategies:random_walk", "sensors": ["near"]}
TEAMS = {"red": WALKS, "blue": WALKS}
TAG = {"rule": "tag", "with": {"taggers": "red", "tagged": "blue", "then": "eliminate"}}


@pytest.mark.parametrize("others", [10**8, 10**15])
def test_vectors_that_do_not_fit_into_memory_are_refused(others):
    with scene().batch(2) as games, pytest.raises(TooLarge, match=f"ectors of {others} others would take about"):
        games.observe("red").vector(others=others)


@gamms.array_strategy
def away(view):
    """Go away from the nearest agent that is seen."""
    found = view.vector(others=1)
    values = dict(zip(found.names, np.moveaxis(found.values, -1, 0), strict=True))
    actions = range(found.legal.shape[-1])
    gained = np.stack([-values["other_0.dx"] * values[f"action_{k}.dx"] for k in actions], axis=-1)
    return np.where(found.legal, gained, -np.inf).argmax(axis=-1)


def test_a_strategy_of_vectors_plays_the_same_alone_and_in_batches(same_as_one_by_one):
    same_as_one_by_one(scene([TAG], teams=TEAMS, sensors=NEAR), [1, 2, 3], {"red": away})


@gamms.array_strategy
def along_roads(view):
    """Go to the first legal node if the nearest agent in sight is far by road, else to the last one."""
    found = view.vector(others=1)
    road = found.values[..., found.names.index("other_0.road")]
    return np.where(road > 0.7, 0, view.counts - 1)


def dig(ctx):
    """Close some roads at random, others in each game."""
    draw = ctx.stream("dig", ctx.game.turn)
    edges = [*ctx.graph.graph.get_edges()]
    ctx.graph.close_roads([edges[int(draw.integers(len(edges)))] for _ in range(6)])


def test_distances_by_road_are_the_same_alone_and_in_batches(same_as_one_by_one):
    same_as_one_by_one(scene([TAG], teams=TEAMS, sensors=NEAR), [1, 2, 3], {"red": along_roads})


def expected_roads(view, others):
    """The distances by road to the nearest agents in sight, as `view.routes` and positions say."""
    xy = view.streets.columns.xy
    unit = float((xy.max(axis=0) - xy.min(axis=0)).max()) / 2
    places = (xy - (xy.max(axis=0) + xy.min(axis=0)) / 2) / unit
    found = np.zeros((*view.node.shape, others))
    seen = view.seen()
    far = view.routes().distances(view.node[seen.at, seen.viewers], seen.nodes) / unit
    straight = ((places[seen.nodes] - places[view.node[seen.at, seen.viewers]]) ** 2).sum(axis=1)
    for game, agent in np.ndindex(*view.node.shape):
        pairs = np.flatnonzero((seen.at == game) & (seen.viewers == agent))
        nearest = pairs[np.argsort(straight[pairs], kind="stable")][:others]
        found[game, agent, : len(nearest)] = np.minimum(far[nearest], 2.0)
    return found


def road_entries(found):
    """The entries of distances by road, (games, agents, others)."""
    return found.values[..., [number for number, name in enumerate(found.names) if name.endswith(".road")]]


def test_roads_of_vectors_are_those_of_routes_also_where_games_close_roads():
    with scene(teams=TEAMS, sensors={"near": {"type": "AGENT_RANGE"}}).build(seed=1) as ctx:
        ctx.game.add(dig)
        with ctx.game.batch(seeds=range(4)) as games:
            largest = 0.0
            for _ in range(10):
                games.step()
                view = games.observe("red")
                entries = road_entries(view.vector(others=5))
                for game in range(4):
                    one = view.in_games(np.array([game]))
                    expected = expected_roads(one, 5)
                    np.testing.assert_allclose(entries[game], expected[0], rtol=1e-6)
                    assert road_entries(one.vector(others=5)).tobytes() == entries[game].tobytes()
                    largest = max(largest, expected.max())
            assert largest == 2.0  # some have no path, or a longer one


@pytest.mark.parametrize("map", [{"grid": {"width": 7, "height": 5}}, {"grid": {"rows": 33, "columns": 33}}])
@pytest.mark.parametrize("threads", [1, 3])
def test_learners_get_the_roads_that_views_have(map, threads):
    teams = {team: {"count": 3, "strategy": "gamms.strategies:random_walk", "sensors": ["near"]} for team in TEAMS}
    near = {"near": {"type": "AGENT_RANGE", "sensor_range": 150.0}}
    game = Scenario(map=map, teams=teams, sensors=near, rules=[TAG], max_turns=9)
    with Learners(game, 40, teams=["red"], threads=threads) as learners:
        for _ in range(5):
            values = learners.observe()
            assert default_observation(learners.games.observe("red"), threads=threads).tobytes() == values.tobytes()
            found = learners.games.observe("red").vector(others=5)
            assert values[..., :-1].tobytes() == found.values.tobytes()
            roads = [number for number, name in enumerate(found.names) if name.endswith(".road")]
            old = straight_observation(learners.games.observe("red"))
            assert old.tobytes() == np.delete(values, roads, axis=2).tobytes()
            np.testing.assert_allclose(values[..., roads], expected_roads(learners.games.observe("red"), 5), rtol=1e-6)
            learners.step(np.ones(learners.masks.shape[:2], np.int64))
