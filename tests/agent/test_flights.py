"""Flights: an aerial agent checks first, and changes nothing when it raises."""

from math import dist, hypot, sqrt
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from gamms.agent import AerialAgent
from gamms.graph import Graph
from gamms.ir.agents import AgentBlock
from gamms.typing.actions import resolve_flight
from gamms.typing.graph_engine import IGraph, Node

HALF = sqrt(0.5)


def a_graph():
    graph = Graph()
    graph.add_nodes(range(5), [0, 10, 20, 30, 40], [0] * 5)
    return graph


@pytest.fixture(scope="module")
def graph():
    return a_graph()


class Kite(AerialAgent):
    """A flyer by itself, over a graph by itself, and a log of its changes."""

    def __init__(self, graph, node=2, speed=3.0, position=None):
        super().__init__(SimpleNamespace(graph=SimpleNamespace(graph=graph)), "kite", node, speed, position)
        self._block.locate()
        self._log = self._block.subscribe()
        self._log.take()

    def act(self, action):
        self.state["action"] = action
        self.set_state()

    def shown(self):
        has_changed = bool(self._log.take())
        return (self.position, self.prev_position, self.quat, self.speed, self.prev_node_id, has_changed)


def test_in_a_graph_that_has_become_empty_a_flyer_keeps_its_last_node():
    graph = a_graph()
    kite = Kite(graph)
    graph.clear()
    kite.act((0, 1, 0))
    assert (kite.position, kite.current_node_id, kite.prev_node_id) == ((20.0, 3.0, 0.0), 2, 2)
    graph.add_node({"id": 7, "x": 0, "y": 0})
    assert kite.current_node_id == 7


def test_a_graph_without_revisions_is_asked_each_time():
    class Slow(IGraph):
        ids = (0, 1)

        def get_node(self, node_id):
            if node_id not in self.ids:
                raise KeyError(node_id)
            return Node(node_id, 0.0, 0.0)

        def nearest_node(self, x=None, y=None, *, lat=None, lon=None):
            return self.ids[-1]

        def _none(self, *_):
            return iter(())

        add_node = add_edge = get_edge = get_edges = update_node = update_edge = _none
        get_nodes = remove_node = remove_edge = get_neighbors = _none

    graph = Slow()
    kite = Kite(graph, node=0)
    assert kite.current_node_id == 1
    graph.ids = (0,)
    assert kite.current_node_id == 0


def test_those_on_the_ground_do_not_fly():
    block = AgentBlock()
    block.add("anna", 0)
    with pytest.raises(TypeError, match="'anna' does not fly"):
        resolve_flight(block, 0, (1, 0, 0))


ODD = st.one_of(
    st.integers(-2, 7),
    st.booleans(),
    st.none(),
    st.floats(),
    st.text(max_size=4),
    st.integers(min_value=2**62),
    st.floats(-3, 3).map(np.float64),
)
VECTORS = st.one_of(
    ODD,
    st.lists(ODD, max_size=5),
    st.lists(st.floats(-3, 3), min_size=3, max_size=4),
    st.lists(st.floats(-3, 3), min_size=3, max_size=4).map(tuple),
    st.lists(st.floats(), max_size=4).map(np.array),
    st.dictionaries(st.integers(0, 2), st.floats(-1, 1)),
    st.just(np.ones((3, 1))),
    st.just(np.float64(3.0)),
    st.just(np.array(["a", "b", "c"])),
)
ACTIONS = st.one_of(
    VECTORS, st.fixed_dictionaries({}, optional={"direction": VECTORS, "quat": VECTORS, "node_id": st.integers()})
)


@given(action=ACTIONS)
def test_whatever_the_action_all_of_it_happens_or_nothing(graph, action):
    kite = Kite(graph)
    before = kite.shown()
    try:
        kite.act(action)
    except (ValueError, TypeError):
        assert kite.shown() == before
        return
    is_dict = isinstance(action, dict)
    assert is_dict or isinstance(action, (tuple, np.ndarray))
    direction = action.get("direction") if is_dict else action
    if direction is None:
        assert kite.shown()[:2] == before[:2]
    else:
        assert len(direction) == 3
        assert kite.prev_position == before[0]
        assert dist(kite.position, before[0]) == pytest.approx(3.0 if any(direction) else 0.0)
    if not (is_dict and "quat" in action):
        assert kite.quat == before[2]
    assert hypot(*kite.quat) == pytest.approx(1.0)


@given(value=VECTORS)
@pytest.mark.parametrize("attribute", ["position", "quat", "orientation"])
def test_an_invalid_position_or_rotation_changes_nothing(graph, attribute, value):
    kite = Kite(graph)
    before = kite.shown()
    try:
        setattr(kite, attribute, value)
    except (ValueError, TypeError):
        assert kite.shown() == before


@given(direction=st.tuples(*[st.floats(allow_nan=False, allow_infinity=False)] * 3))
def test_a_step_is_as_long_as_the_agent_is_fast(graph, direction):
    kite = Kite(graph, speed=2.5)
    kite.act(direction)
    step = [after - before for after, before in zip(*kite.shown()[:2], strict=True)]
    if not any(direction):
        assert step == [0.0, 0.0, 0.0]
    else:
        assert hypot(*step) == pytest.approx(2.5)
        scale = max(map(abs, direction))
        unit = [part / scale for part in direction]
        assert step == pytest.approx([part / hypot(*unit) * 2.5 for part in unit])


def test_a_step_beyond_all_numbers_is_refused(graph):
    kite = Kite(graph, speed=1.7e308)
    kite.act((1, 0, 0))
    before = (*kite.shown()[:-1], False)
    with pytest.raises(ValueError, match="smaller speed"):
        kite.act((1, 0, 0))
    assert kite.shown() == before


@given(quat=st.tuples(*[st.floats(allow_nan=False, allow_infinity=False)] * 4))
def test_a_turn_is_kept_at_length_one_and_setting_it_again_changes_nothing(graph, quat):
    kite = Kite(graph)
    kite.quat = quat
    kept = kite.quat
    if not any(quat):
        assert kept == (1.0, 0.0, 0.0, 0.0)
    assert hypot(*kept) == pytest.approx(1.0)
    kite.quat = kept
    assert kite.quat == kept


@given(quat=st.tuples(*[st.floats(-10, 10)] * 4), scale=st.floats(0.001, 1000))
def test_the_length_of_a_turn_does_not_matter(graph, quat, scale):
    assume(hypot(*quat) > 1e-3)
    one, other = Kite(graph), Kite(graph)
    one.quat = quat
    other.quat = [part * scale for part in quat]
    assert one.quat == pytest.approx(other.quat)
