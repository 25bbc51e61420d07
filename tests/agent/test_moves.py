"""Moves of agents on the ground: an agent checks first, and changes nothing when it raises."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gamms.agent import Agent
from gamms.graph import Graph
from gamms.typing.graph_engine import IGraph


class Anna(Agent):
    """An agent by itself, on a graph by itself, and a log of its changes."""

    def __init__(self, graph, node):
        super().__init__(SimpleNamespace(graph=SimpleNamespace(graph=graph)), "anna", node)
        self._log = self._block.subscribe()
        self._log.take()

    def act(self, action):
        self.state["action"] = action
        self.set_state()

    def shown(self):
        block = self._block
        return ([*block.node], [*block.previous], block.heading, bool(self._log.take()))


@pytest.fixture(scope="module")
def graph():
    graph = Graph()
    graph.add_nodes(range(5), range(5), [0] * 5)
    graph.add_edges([0, 1], [0, 1], [1, 2])
    return graph


def test_a_node_that_was_just_removed_is_no_longer_reached():
    graph = Graph()
    graph.add_nodes([0, 1], [0, 1], [0, 0])
    anna = Anna(graph, 0)
    assert graph.neighborhoods[1] == (1,)
    anna.act(1)
    graph.remove_node(1)
    with pytest.raises(KeyError):
        anna.act(1)
    graph.add_node({"id": 1, "x": 0, "y": 0})
    anna.act(1)


def test_a_bad_place_is_called_a_node_id_and_not_an_action(graph):
    with pytest.raises(TypeError, match=r"^A node id must be an integer, not 'home'"):
        Anna(graph, 0).current_node_id = "home"


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
def test_whatever_the_action_all_of_it_happens_or_nothing(graph, action):
    anna = Anna(graph, 2)
    try:
        anna.act(action)
    except (KeyError, ValueError, TypeError):
        assert anna.shown() == ([2], [2], [None], False)
    else:
        node = action["node_id"] if isinstance(action, dict) else action
        assert not isinstance(node, bool)
        nodes, before, headings, has_changed = anna.shown()
        assert (nodes, before, has_changed) == ([node], [2], True)
        assert (headings[0] is not None) == (isinstance(action, dict) and action.get("orientation") is not None)


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
    anna = Anna(Slow(), 0)
    anna.act(1)
    with pytest.raises(KeyError):
        anna.act(2)
    assert anna.current_node_id == 1
