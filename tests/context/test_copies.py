"""A context, its graph and its agents can be copied, for a look ahead into the game."""

import copy
import pickle

import pytest

import gamms
from gamms.errors import BadType, ContextTerminated


def world():
    ctx = gamms.create_context(seed=3, logger_config={"level": "CRITICAL"})
    ctx.graph.add_nodes(range(4), [0.0, 1.0, 2.0, 3.0], [0.0] * 4)
    ctx.graph.add_edges(range(6), [0, 1, 2, 1, 2, 3], [1, 2, 3, 0, 1, 2])
    ctx.graph.graph.update_node({"id": 1, "tags": ["a"]})
    for kind in ("NEIGHBOR", "RANGE", "AGENT"):
        ctx.sensor.create_sensor(kind, gamms.sensor.SensorType[kind])
    for name, node in (("anna", 0), ("ben", 2)):
        ctx.agent.create_agent(name, start_node_id=node, sensors=["NEIGHBOR", "RANGE", "AGENT"])
    ctx.agent.create_agent("kite", type="AERIAL", start_node_id=1, speed=1.0, sensors=["RANGE"])
    return ctx


def move(ctx, name, node):
    agent = ctx.agent.get_agent(name)
    agent.get_state()["action"] = node
    agent.set_state()


def states(ctx):
    return [agent.get_state() for agent in ctx.agent.create_iter()]


def test_a_copied_context_goes_its_own_way():
    ctx = world()
    before = states(ctx)
    ahead = copy.deepcopy(ctx)
    assert states(ahead) == before
    move(ahead, "anna", 1)
    move(ahead, "kite", (1, 0, 0))
    assert ahead.agent.get_agent("kite").current_node_id == 2
    ahead.graph.graph.remove_node(3)
    ahead.graph.graph.node_attributes(1)["tags"].append("b")
    assert states(ctx) == before
    assert ctx.graph.graph.node_attributes(1) == {"tags": ["a"]}
    move(ctx, "ben", 3)
    assert ctx.agent.get_agent("ben").current_node_id == 3
    assert ahead.agent.get_agent("ben").current_node_id == 2
    assert [state["sensor"]["NEIGHBOR"][1] for state in states(ahead)[:2]] == [[1, 2, 0], [2, 1]]
    ctx.terminate()
    assert states(ahead)[0]["curr_pos"] == 1
    ahead.terminate()


def test_agents_of_a_copy_that_share_a_sensor_get_more_sensors():
    with world() as ctx, copy.deepcopy(ctx) as ahead:
        more = ahead.sensor.create_sensor("more", gamms.sensor.SensorType.AGENT)
        for name in ("anna", "ben"):
            ahead.agent.get_agent(name).register_sensor("more", more)
        assert [state["sensor"]["AGENT"][1] for state in states(ahead)[:2]] == [
            {"ben": 2, "kite": 1},
            {"anna": 0, "kite": 1},
        ]
        assert [state["sensor"]["more"] for state in states(ahead)[:2]] == [
            s["sensor"]["AGENT"] for s in states(ctx)[:2]
        ]


def test_a_graph_is_pickled_by_its_contents():
    with world() as ctx:
        graph = pickle.loads(pickle.dumps(ctx.graph.graph))
        assert [graph.get_edge(id) for id in graph.get_edges()] == [
            ctx.graph.graph.get_edge(id) for id in ctx.graph.graph.get_edges()
        ]
        assert graph.node_attributes(1) == {"tags": ["a"]}
        assert list(graph.neighborhoods[1]) == [1, 2, 0]


@pytest.mark.parametrize("part", ["graph", "agent", "game"])
def test_what_belongs_to_a_context_says_that_it_cannot_be_pickled(part):
    with world() as ctx:
        for pickled in (ctx, getattr(ctx, part), ctx.agent.get_agent("anna")):
            with pytest.raises(
                BadType, match=r"context cannot be pickled.*copy\.deepcopy copies it.*Recording\.resume"
            ):
                pickle.dumps(pickled)


def test_both_engines_list_the_same_stores():
    listed = []
    for engine in gamms.graph.Engine:
        with gamms.create_context(graph_engine=engine, logger_config={"level": "CRITICAL"}) as ctx:
            ctx.ictx.memory.create_store(gamms.typing.StoreType.MEMORY, "graph_store")
            listed.append(list(ctx.ictx.memory.list_stores()))
    assert listed == [["graph_store"]] * 2


def test_a_context_that_has_ended_is_not_copied():
    with world() as ctx:
        ctx.game.step()
    with pytest.raises(ContextTerminated):
        copy.deepcopy(ctx)


def test_what_holds_a_part_of_a_context_holds_the_same_in_copies():
    with world() as ctx:
        held = {"agent": ctx.agent.get_agent("anna"), "sensor": ctx.sensor.get_sensor("AGENT"), "game": ctx.game}
        for key, part in copy.deepcopy(held).items():
            assert part is held[key]


class Slotted:
    """An object whose copy needs a dict that lives only while it is copied."""

    __slots__ = ("number", "seen")

    def __init__(self, number):
        self.number = number
        self.seen = [number]


def test_what_holds_a_context_is_copied_with_it():
    with world() as ctx:
        planner = {"ctx": ctx, "anna": ctx.agent.get_agent("anna"), "plans": [Slotted(number) for number in range(200)]}
        twin = copy.deepcopy(planner)
        assert [(one.number, one.seen) for one in twin["plans"]] == [(number, [number]) for number in range(200)]
        assert twin["anna"] is twin["ctx"].agent.get_agent("anna")
        twin["ctx"].terminate()
