"""Going somewhere: to a node, along a list of nodes, round and round."""

from itertools import pairwise, takewhile

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gamms.agent import AgentType
from gamms.errors import BadType, NoPath
from gamms.strategies import first, follow_path, goto, patrol, stay

NODES = st.integers(0, 35)
LINE = {node: (10.0 * node, 0.0) for node in range(4)}


def test_going_somewhere_is_going_there_and_staying(world):
    world.add("anna", 0, goto(world.ctx, np.int64(8)))
    assert world.play(5)["anna"] == [0, 1, 2, 8, 8, 8]


@given(start=NODES, target=NODES)
def test_an_agent_arrives_after_as_many_turns_as_the_shortest_path_has_edges(open_world, start, target):
    with open_world() as world:
        world.add("anna", start, goto(world.ctx, target))
        path = world.ctx.graph.graph.shortest_path(start, target)
        assert world.play(len(path) + 1)["anna"] == [*path, target, target]


@given(start=NODES, target=NODES, reach=st.integers(1, 4))
def test_who_may_go_farther_in_a_turn_goes_as_far_along_the_path_as_it_may(open_world, start, target, reach):
    with open_world(reach=reach) as world:
        world.add("anna", start, goto(world.ctx, target))
        path = world.ctx.graph.graph.shortest_path(start, target)
        turns = -(-(len(path) - 1) // reach)
        assert world.play(turns)["anna"] == [*path[: turns * reach : reach], target][-turns - 1 :]


STREETS = st.lists(st.tuples(st.integers(0, 7), st.integers(0, 7), st.integers(0, 5)), min_size=1, max_size=24)


def step_along_the_whole_path(graph, here, target, legal):
    """Where a step leads by the whole shortest path: to the last node before the first that is out of reach."""
    if target in legal:
        return target
    try:
        path = graph.shortest_path(here, target)[1:]
    except NoPath:
        return None
    return [here, *takewhile(legal.__contains__, path)][-1]


@given(streets=STREETS, closed=st.sets(st.integers(0, 23)), target=st.integers(0, 7), reach=st.integers(1, 3))
def test_next_nodes_lead_as_the_whole_path_does_on_one_way_streets_and_after_closures(
    open_world, streets, closed, target, reach
):
    with open_world(dict.fromkeys(range(8), (0.0, 0.0)), streets, reach=reach) as world:
        graph, anna = world.ctx.graph.graph, world.add("anna", 0)
        go = goto(world.ctx, target, otherwise=None)
        for street in (None, *(id for id in sorted(closed) if id < len(streets))):
            if street is not None:
                graph.remove_edge(street)
            for node in range(8):
                anna.current_node_id = node
                state = world.state_of(anna)
                go(state)
                assert state.get("action") == step_along_the_whole_path(graph, node, target, state["legal"])


def test_the_way_is_the_shortest_by_length_but_for_a_shortcut_in_turns(open_world):
    road = [(0, 1, 1.0), (1, 2, 1.0), (2, 4, 1.0), (4, 5, 1.0)]
    for more, walk in ([(0, 3, 9.0), (3, 5, 9.0)], [0, 1, 2, 4, 5]), ([(1, 4, 9.0)], [0, 1, 4, 5, 5]):
        with open_world({node: (10.0 * node, 0.0) for node in range(6)}, [*road, *more]) as world:
            world.add("anna", 0, goto(world.ctx, 5))
            assert world.play(4)["anna"] == walk


def test_a_target_may_depend_on_the_state_and_none_is_nowhere(world):
    anna = world.add("anna", 0, goto(world.ctx, lambda state: 35 if state["turn"] % 2 else None))
    assert world.play(4)["anna"] == [0, 0, 1, 1, 2]
    anna.register_strategy(goto(world.ctx, lambda _: 99))
    with pytest.raises(KeyError, match="Unknown node 99"):
        world.play()


def test_without_a_way_it_asks_the_other_strategy(open_world):
    with open_world(LINE, [(0, 1, 1.0), (1, 2, 1.0), (1, 0, 1.0)]) as world:
        anna = world.add("anna", 0)
        for make, target in ((goto, 3), (follow_path, [3]), (patrol, [3])):
            state = world.state_of(anna)
            make(world.ctx, target, otherwise=None)(state)
            assert "action" not in state
            make(world.ctx, target)(state)
            assert state["action"] == 0
            make(world.ctx, target, otherwise=goto(world.ctx, 2))(state)
            assert state["action"] == 1


def test_a_closed_road_is_gone_round_from_the_next_turn_on(world):
    world.add("anna", 0, goto(world.ctx, 3))
    assert world.play()["anna"] == [0, 1]
    graph = world.ctx.graph.graph
    (closed,) = [id for id in graph.get_edges() if graph.get_edge(id)[1:3] == (1, 2)]
    graph.remove_edge(closed)
    assert world.play(4)["anna"] == [1, 7, 8, 2, 3]


def test_a_path_is_followed_leg_by_leg_and_ends(world):
    world.add("anna", 7, follow_path(world.ctx, [0, 2, 2, 0]))
    world.add("bert", 7, first(follow_path(world.ctx, [1], otherwise=None), goto(world.ctx, 13)))
    been = world.play(8)
    assert been["anna"] == [7, 1, 0, 1, 2, 1, 0, 0, 0]
    assert been["bert"] == [7, 1, 7, 13, 13, 13, 13, 13, 13]


def test_a_path_that_repeats_begins_again(world):
    world.add("anna", 0, follow_path(world.ctx, iter([0, 1, 7]), repeat=True))
    world.add("bert", 3, follow_path(world.ctx, [3, 3], repeat=True))
    been = world.play(7)
    assert been["anna"] == [0, 1, 7, 1, 0, 1, 7, 1]
    assert been["bert"] == [3] * 8


def test_a_patrol_begins_with_the_nearest_and_of_several_with_the_first_on_the_list(world):
    world.add("anna", 8, patrol(world.ctx, [0, 10, 6]))
    world.add("bert", 14, patrol(world.ctx, [0, 16, 12]))
    been = world.play(4)
    assert been["anna"][:3] == [8, 9, 10]
    assert been["bert"][:3] == [14, 15, 16]
    assert world.memories["anna"] == {"patrol [0, 10, 6]": 2}


@given(nodes=st.lists(NODES, min_size=1, max_size=4), start=NODES)
def test_a_patrol_visits_its_nodes_in_order_by_shortest_paths_for_ever(open_world, nodes, start):
    with open_world() as world:
        graph = world.ctx.graph.graph
        world.add("anna", start, patrol(world.ctx, nodes))
        begin = min(range(len(nodes)), key=lambda i: (graph.distance(start, nodes[i]), i))
        stops = [start, *(nodes[(begin + i) % len(nodes)] for i in range(2 * len(nodes) + 1))]
        legs = [graph.shortest_path(*leg)[1:] for leg in pairwise(stops)]
        walk = [start, *(node for leg in legs for node in leg)]
        assert world.play(len(walk) - 1)["anna"] == walk


@given(starts=st.lists(NODES, min_size=2, max_size=4), nodes=st.lists(NODES, min_size=1, max_size=3))
@settings(max_examples=8)
def test_agents_that_share_a_strategy_go_as_those_with_one_of_their_own(open_world, starts, nodes):
    for make in (patrol, follow_path):
        walks = []
        for is_shared in (True, False):
            with open_world() as world:
                one = make(world.ctx, nodes)
                for i, start in enumerate(starts):
                    world.add(f"agent {i}", start, one if is_shared else make(world.ctx, nodes))
                walks.append(world.play(12))
        assert walks[0] == walks[1]


def test_an_agent_may_have_several_paths_in_its_memory(world):
    north, east = follow_path(world.ctx, [0, 12], otherwise=None), follow_path(world.ctx, [14], otherwise=None)
    world.add("anna", 0, first(north, east, stay))
    assert world.play(6)["anna"] == [0, 6, 12, 13, 14, 14, 14]
    assert world.memories["anna"] == {"follow_path [0, 12]": 2, "follow_path [14]": 1}


def test_with_a_fresh_memory_a_path_begins_again(world):
    anna = world.add("anna", 0, follow_path(world.ctx, [1, 0]))
    assert world.play(4)["anna"] == [0, 1, 0, 0, 0]
    world.memories["anna"] = {}
    assert world.play(2)[anna.name] == [0, 1, 0]


def test_in_the_papers_own_loop_the_map_says_where_to_go(world):
    anna = world.ctx.agent.create_agent("anna", start_node_id=0, strategy=goto(world.ctx, 14))
    for _ in range(4):
        anna.step()
    assert anna.current_node_id == 14
    anna.register_strategy(patrol(world.ctx, [0, 1]))
    with pytest.raises(KeyError, match=r"patrol needs state\['memory'\].* a dict that you store"):
        anna.step()


@pytest.mark.parametrize("make", [goto, lambda ctx, node: follow_path(ctx, [0, node])], ids=["goto", "follow_path"])
def test_a_node_that_is_none_is_refused_when_the_strategy_is_made(world, make):
    for node, error in ((99, KeyError), (1.5, TypeError), (True, TypeError), ("home", TypeError)):
        with pytest.raises(error, match=r"99|1\.5|True|home"):
            make(world.ctx, node)


def test_impossible_arguments_are_refused(world):
    with pytest.raises(ValueError, match="patrol needs at least one node"):
        patrol(world.ctx, [])
    with pytest.raises(TypeError, match="nodes of follow_path must be a list of node ids, not 3"):
        follow_path(world.ctx, 3)
    with pytest.raises(TypeError, match="otherwise of goto must be a function of the state, not 3"):
        goto(world.ctx, 3, 3)


def test_for_a_flyer_an_error_says_that_these_go_along_edges(world):
    for i, make in enumerate((goto, follow_path, patrol)):
        world.add(f"kite {i}", 0, make(world.ctx, 3 if make is goto else [3]), type=AgentType.AERIAL, speed=3.0)
        with pytest.raises(TypeError, match=f"{make.__name__} moves along edges, but the agent at .* flies"):
            world.play()
        del world.agents[f"kite {i}"]


@pytest.mark.parametrize("legal", [[2.0, 10.0], [None], ["2"], [2**70]])
def test_a_state_whose_legal_nodes_are_none_is_refused_with_their_values(world, legal):
    world.add("anna", 0, stay)
    with pytest.raises(BadType, match=r"state\['legal'\] has ids of nodes, 64-bit integers, not \["):
        goto(world.ctx, 8)({"name": "anna", "curr_pos": 0, "legal": legal, "sensor": {}})
