"""Nodes of networkx that are no integers get ids: calls that are given a label name its id, or the way to it."""

from functools import partial

import networkx as nx
import pytest

import gamms
from gamms import belief, rules, strategies
from gamms.errors import GammsError
from gamms.strategies import stay

SAID = "'b' is node 1: ctx.graph.networkx_labels() gives the id of each networkx label."
WAY_OUT = "ctx.graph.networkx_labels() gives the id of each networkx label."


@pytest.fixture
def ctx():
    street = nx.Graph()
    for number, name in enumerate("abcd"):
        street.add_node(name, x=10.0 * number, y=0.0)
    street.add_edges_from(["ab", "bc", "cd"])
    with gamms.create_context(seed=1, logger_config={"level": "CRITICAL"}) as ctx:
        ctx.graph.attach_networkx_graph(street)
        ctx.agent.create_agent("ann", start_node_id=0, team="red", strategy=stay)
        yield ctx


CALLS = {
    "create_agent": lambda ctx: ctx.agent.create_agent("bob", start_node_id="b"),
    "create_team": lambda ctx: ctx.agent.create_team("blue", ["b", "c"]),
    "current_node_id": lambda ctx: setattr(ctx.agent.get_agent("ann"), "current_node_id", "b"),
    "set_state": lambda ctx: act_alone(ctx, "b"),
    "get_node": lambda ctx: ctx.graph.get_node("b"),
    "has_node": lambda ctx: ctx.graph.graph.has_node("b"),
    "get_neighbors": lambda ctx: ctx.graph.get_neighbors("b"),
    "neighborhoods": lambda ctx: ctx.graph.graph.neighborhoods["b"],
    "node_attributes": lambda ctx: ctx.graph.node_attributes("b"),
    "update_node": lambda ctx: ctx.graph.update_node({"id": "b", "x": 1.0}),
    "remove_node": lambda ctx: ctx.graph.remove_node("b"),
    "add_edge": lambda ctx: ctx.graph.add_edge({"id": 9, "source": "b", "target": "c", "length": 1.0}),
    "shortest_path": lambda ctx: ctx.graph.shortest_path("b", "c"),
    "distance": lambda ctx: ctx.graph.distance(0, "b"),
    "distances": lambda ctx: ctx.graph.distances(source="b"),
    "distance_matrix": lambda ctx: ctx.graph.distance_matrix([0], ["b"]),
    "positions": lambda ctx: ctx.graph.positions(["b"]),
    "within": lambda ctx: ctx.graph.graph.within("b", 10),
    "place": lambda ctx: ctx.graph.place(1, near="b", radius=10),
    "visibility": lambda ctx: ctx.graph.visibility(100.0).sees("b", 0),
    "mask": lambda ctx: ctx.graph.visibility(100.0).mask(0, ["b"]),
    "sense": lambda ctx: ctx.sensor.create_sensor("eyes", "RANGE", range_m=10).sense("b"),
    "sense of neighbors": lambda ctx: ctx.sensor.create_sensor("near", "NEIGHBOR").sense("b"),
    "sense_many": lambda ctx: ctx.sensor.create_sensor("eyes", "AGENT", range_m=10).sense_many(["b"]),
    "at": lambda ctx: ctx.sensor.create_sensor("eyes", "AGENT", at="b"),
    "goto": lambda ctx: strategies.goto(ctx, "b"),
    "patrol": lambda ctx: strategies.patrol(ctx, ["b", "c"]),
    "guard": lambda ctx: strategies.guard(ctx, "b", radius=10),
    "by_distance": lambda ctx: rules.territory.by_distance(ctx, {"red": "b"}),
    "note": lambda ctx: belief.note(ctx, {"turn": 0, "memory": {}}, "ann", "b"),
}
WITHOUT_A_MAP = {
    "reach": lambda: rules.reach("red", ["b"]),
    "reach one": lambda: rules.reach("red", "b"),
    "arrive": lambda: rules.arrive("red", ["b"]),
    "capture_flag": lambda: rules.capture_flag({"red": "b"}),
    "hold": lambda: rules.hold("b", 3),
    "discover": lambda: rules.discover({"b": "flag"}),
    "resource": lambda: rules.resource("fuel", 3, recharge={"b": 2}),
    "published": lambda: rules.territory.published({"b": "red"}),
    "Conflicts": lambda: rules.Conflicts({"b": 1}),
}


def act_alone(ctx, action):
    """Set an action in the loop of 1.0.0."""
    agent = ctx.agent.get_agent("ann")
    agent.get_state()["action"] = action
    agent.set_state()


@pytest.mark.parametrize("call", CALLS)
def test_a_call_on_the_map_names_the_id_of_a_label(ctx, call):
    with pytest.raises(TypeError) as caught:
        CALLS[call](ctx)
    assert str(caught.value).endswith(SAID)


@pytest.mark.parametrize("call", WITHOUT_A_MAP)
def test_a_rule_says_where_the_id_of_a_label_is(call):
    with pytest.raises(GammsError) as caught:
        WITHOUT_A_MAP[call]()
    assert str(caught.value).endswith(WAY_OUT)


@pytest.mark.parametrize("action", ["b", {"node_id": "b"}])
def test_an_action_names_the_id_of_a_label(ctx, action):
    def strategy(state):
        state["action"] = action

    ctx.agent.get_agent("ann").strategy = strategy
    (error,) = ctx.game.run(1).errors
    assert error["message"].endswith(SAID)


def test_a_jammer_says_where_the_id_of_a_label_is(ctx):
    with pytest.raises(TypeError, match=r"The node of jammers.*networkx_labels"):
        ctx.game.add_channel("radio", range_m=10, jammers=[{"at": "b", "radius_m": 3}])


def test_labels_may_be_of_any_kind(ctx):
    ctx.graph.attach_networkx_graph(nx.relabel_nodes(nx.grid_2d_graph(2, 2), lambda pair: (pair, "corner")))
    with pytest.raises(TypeError, match=r"\(\(0, 1\), 'corner'\) is node 5"):
        ctx.graph.get_node(((0, 1), "corner"))


def test_a_misspelt_label_is_answered_with_the_right_one(ctx):
    ctx.graph.attach_networkx_graph(nx.path_graph(["depot", "harbor"]))
    with pytest.raises(TypeError, match=r"not 'depott' \(str\). Did you mean 'depot'"):
        ctx.graph.get_node("depott")


@pytest.mark.parametrize("value", [None, 1.5, [1], "b"])
def test_maps_without_labels_say_nothing_of_labels(value):
    with gamms.create_context() as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(2, 2))
        for call in (ctx.graph.get_node, partial(ctx.agent.create_agent, "ann", start_node_id=value)):
            with pytest.raises(TypeError) as caught:
                call(value) if call is ctx.graph.get_node else call()
            assert "networkx" not in str(caught.value)


@pytest.mark.parametrize(
    ("labels", "said"),
    [
        (["7", "3"], ["The networkx label '7' is a text, and its node has the id 4."]),
        (["4", "3"], ["The networkx label '3' is a text, and its node has the id 5."]),
        (["4", "5"], []),
        ([7, 8], []),
        (["9" * 5000, "depot"], []),
    ],
)
def test_a_text_that_looks_like_the_id_of_another_node_is_warned_about(ctx, heard, labels, said):
    more = nx.path_graph(labels)
    nx.set_node_attributes(more, {label: {"x": number, "y": 9.0} for number, label in enumerate(labels)})
    ctx.graph.attach_networkx_graph(more)
    assert [text.partition(" To keep")[0] for text in heard] == said
