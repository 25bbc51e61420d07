"""What each kind of sensor sees, case by case."""

from copy import deepcopy
from math import pi

import numpy as np
import pytest

import gamms
from gamms.sensor import SensorType
from gamms.typing import Node, OSMEdge

ALL = [0, 1, 2, 3, 4, 5]


def test_neighbor_sees_the_node_itself_and_then_its_neighbours_in_edge_order(ctx, sense):
    assert sense(SensorType.NEIGHBOR) == [0, 1, 2, 3, 4]
    assert sense(SensorType.NEIGHBOR, node=3) == [3, 0]
    assert sense(SensorType.NEIGHBOR, node=5) == [5]
    graph = ctx.graph.graph
    for id, target in ((20, 5), (21, 1), (22, 1), (23, 0)):
        graph.add_edge({"id": id, "source": 5, "target": target, "length": 9})
    assert sense(SensorType.NEIGHBOR, node=5) == [5, 1, 0]


def test_map_sees_everything_as_values(sense):
    seen = sense(SensorType.MAP)
    assert list(seen) == ["nodes", "edges"]
    assert list(seen["nodes"]) == ALL
    assert seen["nodes"][5] == Node(5, 3.0, 4.0)
    assert [edge.id for edge in seen["edges"]] == [2, 3, 4, 5, 6, 7, 8, 9]
    assert all(type(edge) is OSMEdge for edge in seen["edges"])


@pytest.mark.parametrize(
    "kind", ["NEIGHBOR", "MAP", "RANGE", "ARC", "AGENT", "AGENT_RANGE", "AGENT_ARC"], ids=lambda kind: kind
)
def test_looking_from_an_unknown_node_is_a_key_error_and_keeps_the_last_result(ctx, kind):
    sensor = ctx.sensor.create_sensor("s", SensorType[kind])
    ctx.agent.create_agent("a", start_node_id=1)
    sensor.sense(0)
    before = sensor.data
    with pytest.raises(KeyError, match="99"):
        sensor.sense(99)
    assert sensor.data is before


@pytest.mark.parametrize("kind", ["AGENT", "AGENT_RANGE", "AGENT_ARC"])
def test_an_agent_on_a_removed_node_is_a_key_error(ctx, kind):
    sensor = ctx.sensor.create_sensor("s", SensorType[kind])
    ctx.agent.create_agent("a", start_node_id=1)
    sensor.sense(0)
    ctx.graph.graph.remove_node(1)
    with pytest.raises(KeyError, match="1"):
        sensor.sense(0)
    ctx.agent.get_agent("a").current_node_id = 2
    sensor.sense(0)
    assert sensor.data == {"a": 2}


@pytest.fixture(params=[40, 300])
def crowd(request):
    """Agents on a grid of 20 x 20 nodes, 10 m apart, which sense each other within 30 m and jump anywhere."""
    ctx = gamms.create_context(seed=1)
    ids = np.arange(400)
    ctx.graph.add_nodes(ids, (ids % 20) * 10.0, (ids // 20) * 10.0)
    for i, start in enumerate(np.random.default_rng(1).integers(400, size=request.param).tolist()):
        near = ctx.sensor.create_sensor(f"near_{i}", "agent_range", sensor_range=30.0)
        ctx.agent.create_agent(f"a_{i}", start_node_id=start, sensors={"near": near}, strategy=jump)
    ctx.game.legal = "any"
    return ctx


def jump(state):
    state["memory"]["seen"] = list(state["sensor"]["near"][1].items())
    state["sensor"]["near"][1].clear()
    state["action"] = state["draw"].below(400)


def around(at, name):
    """Who is within 30 m of an agent, by a scan of all."""
    x, y = at[name] % 20, at[name] // 20
    return [(one, n) for one, n in at.items() if (n % 20 - x) ** 2 + (n // 20 - y) ** 2 <= 9 and one != name]


def test_many_agents_that_look_equally_far_see_those_within_that_range_in_every_turn(crowd):
    agents = list(crowd.agent.create_iter())
    agents[7].alive = False
    for _ in range(3):
        at = {agent.name: agent.current_node_id for agent in agents if agent.alive}
        crowd.game.step()
        assert {name: crowd.game.memories[name]["seen"] for name in at} == {name: around(at, name) for name in at}


def test_agents_that_a_drawer_moves_while_others_decide_are_seen_where_they_are(tmp_path):
    seen = []

    def strategy(state):
        [(_, shown)] = state["sensor"].values()
        seen.append(shown.get("a39"))
        if len(seen) == 45:
            ctx.visual.save(tmp_path / "picture.svg")
        state["action"] = state["curr_pos"]

    with gamms.create_context() as ctx:
        for node in range(6):
            ctx.graph.graph.add_node({"id": node, "x": 10.0 * node, "y": 0.0})
        drawer = {"drawer": lambda ctx, data: setattr(ctx.agent.get_agent("a39"), "current_node_id", 5)}
        ctx.visual.add_artist("mover", drawer)
        for i in range(40):
            ctx.sensor.create_sensor(f"eyes {i}", "AGENT_RANGE", sensor_range=15.0)
            ctx.agent.create_agent(f"a{i}", start_node_id=0, sensors=[f"eyes {i}"], strategy=strategy)
        ctx.game.step()
        ctx.game.step()
    assert seen[40:45] == [0] * 5
    assert seen[45:] == [None] * 35


def test_sensors_that_look_alike_show_in_turns_what_each_shows_by_itself():
    ctx, seen = gamms.create_context(seed=1), {}
    nodes = np.arange(64)
    ctx.graph.add_nodes(nodes, 10.0 * (nodes % 8), 10.0 * (nodes // 8))
    ctx.graph.add_edges(nodes[:63], nodes[:63], nodes[1:])

    def strategy(state):
        seen[state["name"]] = deepcopy(state["sensor"])
        state["sensor"]["map"][1]["nodes"].clear()  # which is its own
        state["sensor"]["near"][1].clear()
        state["action"] = state["draw"].choice(state["legal"])

    for i in range(40):
        near, around = (f"{kind}_{i}" for kind in ("near", "map"))
        sensors = {"near": ctx.sensor.create_sensor(near, "AGENT_RANGE", sensor_range=15.0)}
        sensors["map"] = ctx.sensor.create_sensor(around, "RANGE", sensor_range=15.0)
        sensors["again"] = ctx.sensor.create_sensor(f"again_{i}", "AGENT_RANGE", sensor_range=15.0 if i % 2 else 25.0)
        ctx.agent.create_agent(f"a{i}", start_node_id=i, sensors=sensors, strategy=strategy, team="ab"[i % 2])
    changes = [
        lambda: setattr(ctx.sensor.get_sensor("near_3"), "range", 35.0),
        lambda: setattr(ctx.sensor.get_sensor("near_4").notice, "team", "b"),
        lambda: setattr(ctx.sensor.get_sensor("near_5"), "at", 63),
        lambda: setattr(ctx.sensor.get_sensor("map_6"), "fov", pi),
        lambda: ctx.sensor.get_sensor("near_7").set_owner(None),
        lambda: ctx.graph.graph.remove_node(63),
        lambda: ctx.agent.delete_agent("a8"),
    ]
    for change in [lambda: None, lambda: None, *changes]:
        change()
        if change is changes[5]:
            ctx.sensor.get_sensor("near_5").at = None
        alone = {name: agent.sense() for name, agent in ctx.agent.agents.items()}
        seen.clear()
        ctx.game.step()
        assert seen == alone
