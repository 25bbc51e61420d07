"""Where an agent looks: it follows the moves until it is set, and again once it is cleared."""

from math import atan2, hypot

import pytest
from hypothesis import given
from hypothesis import strategies as st

import gamms

NUMBERS = st.floats(-1e9, 1e9, allow_subnormal=False)


def move(agent, action):
    agent.get_state()["action"] = action
    agent.set_state()


def test_an_agent_that_has_not_moved_looks_nowhere(anna):
    assert anna.orientation == (0.0, 0.0)


def test_an_agent_that_stays_looks_nowhere_again(anna):
    move(anna, 5)
    move(anna, 5)
    assert anna.orientation == (0.0, 0.0)


def test_between_two_nodes_in_one_place_there_is_no_heading(ctx, anna):
    ctx.graph.graph.add_node({"id": 40, "x": 1, "y": 1})
    move(anna, 40)
    assert anna.orientation == (0.0, 0.0)


def test_a_set_orientation_stays_while_the_agent_moves(anna):
    anna.orientation = (0, -3)
    move(anna, 5)
    anna.current_node_id = 8
    assert anna.orientation == (0.0, -1.0)


def test_an_action_without_an_orientation_leaves_it_alone(anna):
    anna.orientation = (0, 1)
    move(anna, {"node_id": 5})
    assert anna.orientation == (0.0, 1.0)


@pytest.mark.parametrize("bad", [(0, 0), (1,), (1, 0, 0), 5, (float("nan"), 0), (float("inf"), 0)])
def test_an_impossible_orientation_is_a_value_error_and_changes_nothing(anna, bad):
    anna.orientation = (0, 1)
    with pytest.raises(ValueError, match=r"[Oo]rientation"):
        anna.orientation = bad
    assert anna.orientation == (0.0, 1.0)


def test_an_agent_can_be_created_looking_somewhere(ctx):
    assert ctx.agent.create_agent("a", start_node_id=0, orientation=(3, 4)).orientation == (0.6, 0.8)
    with pytest.raises(ValueError, match="orientation"):
        ctx.agent.create_agent("b", start_node_id=0, orientation=(0, 0))
    assert list(ctx.agent.agents) == ["a"]


@given(x=NUMBERS, y=NUMBERS)
def test_an_orientation_is_kept_at_length_one(x, y):
    with gamms.create_context(logger_config={"level": "CRITICAL"}) as ctx:
        ctx.graph.graph.add_node({"id": 0, "x": 0, "y": 0})
        agent = ctx.agent.create_agent("a", start_node_id=0)
        if hypot(x, y) == 0.0:
            return
        agent.orientation = (x, y)
        cos, sin = agent.orientation
        assert hypot(cos, sin) == pytest.approx(1.0)
        assert atan2(sin, cos) == pytest.approx(atan2(y, x), abs=1e-9)
