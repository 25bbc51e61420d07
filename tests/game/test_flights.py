"""The writer's part for flyers: it checks first, and changes nothing when it raises."""

from math import dist, hypot, sqrt

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from gamms.game import Moves
from gamms.graph import Graph
from gamms.ir.agents import AgentColumns
from gamms.typing.graph_engine import IGraph, Node

HALF = sqrt(0.5)


def a_graph():
    graph = Graph()
    graph.add_nodes(range(5), [0, 10, 20, 30, 40], [0] * 5)
    return graph


@pytest.fixture(scope="module")
def moves():
    return Moves(a_graph())


def a_flyer(moves, node=2, speed=3.0, position=None):
    columns = AgentColumns()
    columns.append("kite", 0, None, (0.0, 0.0, 0.0))
    moves.launch(columns, 0, node, speed, position)
    columns.touched.clear()
    return columns


def shown(columns):
    position, turn = (columns.position[0], columns.previous_position[0]), (columns.quat[0], columns.speed[0])
    return (*position, *turn, columns.previous[0], set(columns.touched))


def test_a_launch_is_a_beginning_without_a_past(moves):
    columns = a_flyer(moves, np.int64(1), np.float32(2.0))
    assert shown(columns) == ((10.0, 0.0, 0.0), (10.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), 2.0, 1, set())
    assert type(columns.speed[0]) is float
    columns = a_flyer(moves, 1, 2, [31, 1, 5])
    assert shown(columns)[:2] == ((31.0, 1.0, 5.0), (31.0, 1.0, 5.0))
    assert (columns.previous[0], moves.nearest(columns, 0)) == (1, 3)


def test_a_move_writes_where_it_was(moves):
    columns = a_flyer(moves)
    moves.fly(columns, 0, (-1, 0, 0))
    moves.fly(columns, 0, (-8, 0, 0))
    moves.fly(columns, 0, (0, 0, 0.1))
    assert shown(columns) == ((14.0, 0.0, 3.0), (14.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), 3.0, 1, {0})
    assert moves.nearest(columns, 0) == columns.node[0] == 1


def test_being_put_somewhere_writes_where_it_was_too(moves):
    columns = a_flyer(moves)
    moves.place_at(columns, 0, np.array([1.0, 2.0, 3.0]))
    assert shown(columns)[:2] == ((1.0, 2.0, 3.0), (20.0, 0.0, 0.0))
    assert columns.previous[0] == 2
    moves.place_above(columns, 0, 4)
    assert shown(columns)[:2] == ((40.0, 0.0, 3.0), (1.0, 2.0, 3.0))
    assert columns.previous[0] == 0
    moves.place_previous(columns, 0, 3)
    assert shown(columns)[:2] == ((40.0, 0.0, 3.0), (1.0, 2.0, 3.0))
    assert columns.previous[0] == 3


def test_turning_leaves_the_place_alone(moves):
    columns = a_flyer(moves)
    before = shown(columns)
    moves.turn_in_space(columns, 0, [0, 0, 2, 0])
    assert columns.quat[0] == (0.0, 0.0, 1.0, 0.0)
    moves.face(columns, 0, (0, 5))
    assert columns.quat[0] == pytest.approx((HALF, 0.0, 0.0, HALF))
    moves.face(columns, 0, None)
    assert shown(columns) == before


def test_nodes_are_worked_out_again_only_after_a_change():
    class Counting(Graph):
        asked = 0

        def nearest_node(self, *args, **kwargs):
            self.asked += 1
            return super().nearest_node(*args, **kwargs)

    graph = Counting()
    graph.add_nodes([0, 1], [0, 10], [0, 0])
    moves = Moves(graph)
    columns = a_flyer(moves, node=0)
    for _ in range(3):
        assert moves.nearest(columns, 0) == 0
        moves.locate(columns)
    assert graph.asked == 1
    moves.fly(columns, 0, (0, 0, 1))
    moves.locate(columns)
    assert graph.asked == 1
    graph.add_node({"id": 2, "x": 0, "y": 0.5})
    graph.remove_node(0)
    columns.touched.clear()
    moves.locate(columns)
    assert (graph.asked, columns.node[0], columns.touched) == (2, 2, {0})
    moves.fly(columns, 0, {"direction": (1, 0, 0)})
    moves.locate(columns)
    assert graph.asked == 3


def test_in_a_graph_that_has_become_empty_a_flyer_keeps_its_last_node():
    graph = a_graph()
    moves = Moves(graph)
    columns = a_flyer(moves)
    graph.clear()
    moves.fly(columns, 0, (0, 1, 0))
    moves.locate(columns)
    assert (columns.position[0], moves.nearest(columns, 0), columns.previous[0]) == ((20.0, 3.0, 0.0), 2, 2)
    graph.add_node({"id": 7, "x": 0, "y": 0})
    assert moves.nearest(columns, 0) == 7


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
    moves = Moves(graph)
    columns = a_flyer(moves, node=0)
    assert moves.nearest(columns, 0) == 1
    graph.ids = (0,)
    assert moves.nearest(columns, 0) == 0


def test_those_on_the_ground_do_not_fly(moves):
    columns = AgentColumns()
    columns.append("anna", 0, None)
    with pytest.raises(TypeError, match="'anna' does not fly"):
        moves.fly(columns, 0, (1, 0, 0))


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
def test_whatever_the_action_all_of_it_happens_or_nothing(moves, action):
    columns = a_flyer(moves)
    before = shown(columns)
    try:
        moves.fly(columns, 0, action)
    except (ValueError, TypeError):
        assert shown(columns) == before
        return
    is_dict = isinstance(action, dict)
    assert is_dict or isinstance(action, (tuple, np.ndarray))
    direction = action.get("direction") if is_dict else action
    if direction is None:
        assert shown(columns)[:2] == before[:2]
    else:
        assert len(direction) == 3
        assert columns.previous_position[0] == before[0]
        assert dist(columns.position[0], before[0]) == pytest.approx(3.0 if any(direction) else 0.0)
    if not (is_dict and "quat" in action):
        assert columns.quat[0] == before[2]
    assert hypot(*columns.quat[0]) == pytest.approx(1.0)


@given(value=VECTORS)
@pytest.mark.parametrize("verb", ["place_at", "turn_in_space", "face"])
def test_what_is_no_place_and_no_turn_changes_nothing(moves, verb, value):
    columns = a_flyer(moves)
    before = shown(columns)
    try:
        getattr(moves, verb)(columns, 0, value)
    except (ValueError, TypeError):
        assert shown(columns) == before


@given(direction=st.tuples(*[st.floats(allow_nan=False, allow_infinity=False)] * 3))
def test_a_step_is_as_long_as_the_agent_is_fast(moves, direction):
    columns = a_flyer(moves, speed=2.5)
    moves.fly(columns, 0, direction)
    step = [after - before for after, before in zip(*shown(columns)[:2], strict=True)]
    if not any(direction):
        assert step == [0.0, 0.0, 0.0]
    else:
        assert hypot(*step) == pytest.approx(2.5)
        scale = max(map(abs, direction))
        unit = [part / scale for part in direction]
        assert step == pytest.approx([part / hypot(*unit) * 2.5 for part in unit])


def test_a_step_beyond_all_numbers_is_refused(moves):
    columns = a_flyer(moves, speed=1.7e308)
    moves.fly(columns, 0, (1, 0, 0))
    before = shown(columns)
    with pytest.raises(ValueError, match="smaller speed"):
        moves.fly(columns, 0, (1, 0, 0))
    assert shown(columns) == before


@given(quat=st.tuples(*[st.floats(allow_nan=False, allow_infinity=False)] * 4))
def test_a_turn_is_kept_at_length_one_and_setting_it_again_changes_nothing(moves, quat):
    columns = a_flyer(moves)
    moves.turn_in_space(columns, 0, quat)
    kept = columns.quat[0]
    if not any(quat):
        assert kept == (1.0, 0.0, 0.0, 0.0)
    assert hypot(*kept) == pytest.approx(1.0)
    moves.turn_in_space(columns, 0, kept)
    assert columns.quat[0] == kept


@given(quat=st.tuples(*[st.floats(-10, 10)] * 4), scale=st.floats(0.001, 1000))
def test_the_length_of_a_turn_does_not_matter(moves, quat, scale):
    assume(hypot(*quat) > 1e-3)
    one, other = a_flyer(moves), a_flyer(moves)
    moves.turn_in_space(one, 0, quat)
    moves.turn_in_space(other, 0, [part * scale for part in quat])
    assert one.quat[0] == pytest.approx(other.quat[0])
