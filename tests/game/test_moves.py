"""The one writer of moves: it checks first, and changes nothing when it raises."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gamms.game import Moves
from gamms.graph import Graph
from gamms.ir.agents import AgentColumns
from gamms.typing.graph_engine import IGraph


def columns_on(node):
    columns = AgentColumns()
    columns.append("anna", node, None)
    columns.touched.clear()
    return columns


def shown(columns):
    return (columns.node, columns.previous, columns.heading, columns.touched)


@pytest.fixture(scope="module")
def moves():
    graph = Graph()
    graph.add_nodes(range(5), range(5), [0] * 5)
    graph.add_edges([0, 1], [0, 1], [1, 2])
    return Moves(graph)


def test_a_move_writes_the_node_and_the_one_before(moves):
    columns = columns_on(0)
    moves.act(columns, 0, 1)
    moves.act(columns, 0, {"node_id": np.int64(4), "orientation": (0, 2)})
    assert shown(columns) == ([4], [1], [(0.0, 1.0)], {0})
    assert type(columns.node[0]) is int


def test_placing_leaves_the_previous_node_alone(moves):
    columns = columns_on(0)
    moves.place(columns, 0, 3)
    assert shown(columns) == ([3], [0], [None], {0})
    moves.place_previous(columns, 0, 2)
    assert shown(columns) == ([3], [2], [None], {0})


def test_turning_and_following_the_moves_again(moves):
    columns = columns_on(0)
    moves.turn(columns, 0, np.array([3.0, 4.0]))
    assert columns.heading == [(0.6, 0.8)]
    moves.turn(columns, 0, None)
    assert columns.heading == [None]


def test_a_node_that_was_just_removed_is_no_longer_reached():
    graph = Graph()
    graph.add_nodes([0, 1], [0, 1], [0, 0])
    moves, columns = Moves(graph), columns_on(0)
    assert graph.neighborhoods[1] == (1,)
    moves.act(columns, 0, 1)
    graph.remove_node(1)
    with pytest.raises(KeyError):
        moves.act(columns, 0, 1)
    graph.add_node({"id": 1, "x": 0, "y": 0})
    moves.act(columns, 0, 1)


def test_a_bad_place_is_called_a_node_id_and_not_an_action(moves):
    with pytest.raises(TypeError, match=r"^A node id must be an integer, not 'home'"):
        moves.place(columns_on(0), 0, "home")


ODD = st.one_of(
    st.integers(-2, 7),
    st.booleans(),
    st.none(),
    st.floats(),
    st.text(max_size=2),
    st.tuples(st.integers(0, 4)),
    st.integers(min_value=2**62),
    st.integers(0, 6).map(np.int64),
)
ORIENTATIONS = st.one_of(ODD, st.tuples(ODD, ODD), st.lists(st.floats(-2, 2), max_size=3))
ACTIONS = st.one_of(
    ODD, st.fixed_dictionaries({}, optional={"node_id": ODD, "orientation": ORIENTATIONS, "speed": st.integers()})
)


@given(action=ACTIONS)
def test_whatever_the_action_all_of_it_happens_or_nothing(moves, action):
    columns = columns_on(2)
    try:
        moves.act(columns, 0, action)
    except (KeyError, ValueError, TypeError):
        assert shown(columns) == ([2], [2], [None], set())
    else:
        node = action["node_id"] if isinstance(action, dict) else action
        assert not isinstance(node, bool)
        assert (columns.node, columns.previous, columns.touched) == ([node], [2], {0})
        assert (columns.heading[0] is not None) == (isinstance(action, dict) and action.get("orientation") is not None)


class Slow(IGraph):
    """A graph of the user's own that writes nothing but what it must."""

    def __init__(self):
        self.ids = [0, 1]

    def get_node(self, node_id):
        if node_id not in self.ids:
            raise KeyError(node_id)
        return (node_id, 0.0, 0.0)

    def _none(self, *_):
        return iter(())

    add_node = add_edge = get_edge = get_edges = update_node = update_edge = _none
    get_nodes = remove_node = remove_edge = get_neighbors = _none


def test_any_graph_will_do():
    moves, columns = Moves(Slow()), columns_on(0)
    moves.act(columns, 0, 1)
    with pytest.raises(KeyError):
        moves.act(columns, 0, 2)
    assert columns.node == [1]


def test_rules_find_what_a_strategy_adds_to_its_state_and_its_action(ctx):
    def strategy(state):
        state["message"] = "hello"
        state["action"] = {"node_id": 1, "attack": "b"}

    agent = ctx.agent.create_agent("a", start_node_id=0, strategy=strategy)
    found = []
    ctx.game.add(lambda ctx: found.append((agent.state["message"], agent.state["action"]["attack"])))
    ctx.game.step()
    assert (found, agent.current_node_id) == ([("hello", "b")], 1)
