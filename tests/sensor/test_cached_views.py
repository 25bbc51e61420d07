"""Cached views equal what each agent would see by itself, whatever the size of the cache."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import gamms
from gamms.errors import UnknownName
from gamms.graph import Graph
from gamms.sensor import views
from gamms.typing import SensorType

SIDE = 12


def game(agents, radius, with_sensor=lambda i: True, seed=3):
    """Return a game of agents that walk on a grid and check what they see, and the list of how many checked it."""
    ctx = gamms.create_context(seed=seed, logger_config={"level": "CRITICAL"})
    ctx.graph.attach_networkx_graph(gamms.graph.grid(SIDE, SIDE))
    graph, checked = ctx.graph.graph, []

    def look(state):
        for _, data in state["sensor"].values():
            seen = Graph.within(graph, state["curr_pos"], radius)
            assert list(data["nodes"].items()) == list(seen.nodes.items())
            assert data["edges"] == seen.edges
            data["nodes"].clear()  # which is the strategy's own
            data["edges"].clear()
            checked.append(state["curr_pos"])
        legal = state["legal"]
        state["action"] = legal[(state["curr_pos"] + state["turn"]) % len(legal)]

    for i, node in enumerate(agents):
        sensors = {}
        if with_sensor(i):
            sensors = {"s": ctx.sensor.create_sensor(f"s{i}", SensorType.RANGE, sensor_range=radius)}
        ctx.agent.create_agent(f"a{i}", start_node_id=node, strategy=look, sensors=sensors)
    return ctx, checked


@given(data=st.data())
@settings(max_examples=12)
def test_agents_together_see_the_same_as_each_by_itself(data):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(views, "_MOST_WORDS", data.draw(st.sampled_from([1, 900, 4000, 1 << 24])))
        agents = data.draw(st.lists(st.integers(0, SIDE * SIDE - 1), min_size=1, max_size=24))
        every = data.draw(st.sampled_from([1, 1, 3]))
        radius = data.draw(st.sampled_from([0.0, 10.0, 25.0]))
        ctx, checked = game(agents, radius, lambda i: i % every == 0)
        for _ in range(4):
            ctx.game.step()
            change = data.draw(st.sampled_from(["nothing", "nothing", "edge", "node"]))
            graph, memo = ctx.graph.graph, ctx.sensor.storage.memory.views
            assert memo._words <= views._MOST_WORDS
            if change == "edge":
                graph.remove_edge(data.draw(st.sampled_from(list(graph.get_edges()))))
            elif change == "node":
                taken = {agent.current_node_id for agent in ctx.agent.create_iter()}
                graph.remove_node(data.draw(st.sampled_from([id for id in graph.get_nodes() if id not in taken])))
        assert len(checked) == 4 * len(agents[::every])
        assert not ctx.game.errors
        ctx.terminate()


def test_an_agent_on_a_removed_node_spoils_no_view_of_others():
    ctx, checked = game([0, 5, 20, 40, 77, 100], 20.0)
    ctx.graph.graph.remove_node(77)
    with pytest.raises(UnknownName, match="77"):
        ctx.game.step()
    assert checked == [0, 5, 20, 40]
