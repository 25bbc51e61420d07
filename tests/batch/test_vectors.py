"""Agents are observed as vectors of numbers, which say what their states say."""

import numpy as np
import pytest
from batch_scenes import WAYS, scene

import gamms
from gamms.errors import BadValue, TooLarge

NEAR = {"near": {"type": "AGENT_RANGE", "sensor_range": 25.0}}
WALKS = {"count": 3, "strategy": "gamms.strategies:random_walk", "sensors": ["near"]}
TEAMS = {"red": WALKS, "blue": WALKS}
TAG = {"rule": "tag", "with": {"taggers": "red", "tagged": "blue", "then": "eliminate"}}


def expected_of(ctx, name, others, radii):
    """The numbers of a vector, worked out one by one from where agents are; `radii` are those of the sensors."""
    graph, agents = ctx.graph.graph, ctx.agent.agents
    nodes = [graph.get_node(node) for node in graph.get_nodes()]
    widths = [[getattr(node, axis) for node in nodes] for axis in "xy"]
    low, high = [[choose(axis) for axis in widths] for choose in (min, max)]
    scale = max(high[0] - low[0], high[1] - low[1]) / 2.0

    def placed(node):
        there = graph.get_node(node)
        return [
            (at - (least + most) / 2.0) / scale for at, least, most in zip((there.x, there.y), low, high, strict=True)
        ]

    agent = agents[name]
    here = graph.get_node(agent.current_node_id)
    own = placed(agent.current_node_id)
    numbers = [*own]
    for node in ctx.game.observation(name)["legal"]:
        numbers += [1.0, *(to - at for to, at in zip(placed(node), own, strict=True))]
    numbers += [0.0] * (2 + 3 * 5 - len(numbers))  # a node of the grid has four neighbors
    seen = []
    for other in sorted(agents.values(), key=lambda one: one.name):
        there = graph.get_node(other.current_node_id)
        far = (there.x - here.x) ** 2 + (there.y - here.y) ** 2
        if other.name != name and other.alive and any(far <= radius**2 for radius in radii):
            dx, dy = (to - at for to, at in zip(placed(other.current_node_id), own, strict=True))
            seen.append((dx * dx + dy * dy, [1.0, float(other.team == agent.team), dx, dy]))
    nearest = sorted(seen, key=lambda one: one[0])[:others]  # of several as far away, the first by name
    for _, entries in nearest:
        numbers += entries
    return np.float32([*numbers, *[0.0] * (4 * (others - len(nearest)))])


@pytest.mark.parametrize("radii", [(25.0,), (0.0, 15.0), (float("inf"),), (10.0, 30.0, 20.0)])
@pytest.mark.parametrize("way", WAYS)
def test_a_vector_has_the_numbers_that_follow_from_where_agents_are(radii, way):
    sensors = {f"s{number}": {"type": "AGENT_RANGE", "sensor_range": one} for number, one in enumerate(radii)}
    carrying = {**WALKS, "sensors": [*sensors]}
    scenario = way(scene([TAG], teams={"red": carrying, "blue": carrying}, sensors=sensors))
    with scenario.build(seed=2) as ctx, scenario.batch(seeds=[5, 2]) as games:
        for _ in range(10):
            for team in ("red", "blue"):
                found = games.observe(team).vector(others=3)
                for number in range(3):
                    name = f"{team}_{number}"
                    values = found.values[1, number]
                    if ctx.agent.agents[name].alive:
                        assert values.tolist() == expected_of(ctx, name, 3, radii).tolist()
                    else:
                        assert not values.any()
            games.step()
            ctx.game.step()


@pytest.mark.parametrize("others", [10**8, 10**15])
def test_vectors_that_do_not_fit_into_memory_are_refused(others):
    with scene().batch(2) as games, pytest.raises(TooLarge, match=f"ectors of {others} others would take about"):
        games.observe("red").vector(others=others)


def test_vectors_of_dead_agents_are_zero_and_only_to_stay_is_legal():
    with scene([TAG], teams=TEAMS, sensors=NEAR).batch(20, seed=1) as games:
        games.run()
        found = games.observe("blue").vector()
        assert not found.mask.all()
        assert not found.values[~found.mask].any()
        assert found.legal[~found.mask].sum(axis=1).tolist() == [1] * int((~found.mask).sum())
        assert (found.legal[found.mask].sum(axis=1) >= 3).all()


def test_vectors_of_some_games_are_those_of_all_games():
    scenario = scene(teams=TEAMS, sensors=NEAR)
    with scenario.batch(5, seed=1) as games, scenario.batch(1, seed=4) as one:
        for _ in range(4):
            games.step()
            one.step()
        assert (games.observe("red").vector().values[3:4] == one.observe("red").vector().values).all()
        with pytest.raises(BadValue, match="others"):
            games.observe("red").vector(others=-1)


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
