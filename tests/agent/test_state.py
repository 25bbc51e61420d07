"""An agent senses, decides and acts: `get_state`, `set_state`, `step`."""

import numpy as np
import pytest

from gamms.errors import GammsError, ReservedName
from gamms.sensor import SensorType


def where(agent):
    return (agent.current_node_id, agent.prev_node_id, agent.orientation)


def test_a_state_has_exactly_two_keys(anna):
    assert anna.get_state() == {"curr_pos": 4, "sensor": {"near": (SensorType.NEIGHBOR, [4, 5, 3, 7, 1])}}
    assert type(anna.get_state()["curr_pos"]) is int


@pytest.mark.parametrize("flight", [{}, {"type": "aerial", "position": (0.0, 0.0, 9.0), "speed": 1.0}])
def test_an_eliminated_agent_shows_that_it_is(ctx, flight):
    agent = ctx.agent.create_agent("ben", start_node_id=0, **flight)
    assert "alive" not in repr(agent)
    ctx.game.eliminate("ben")
    assert repr(agent).endswith(", alive=False)")


def test_before_the_first_look_the_state_is_empty(anna):
    assert anna.state == {}


def test_sensors_appear_in_the_order_of_their_registration_under_the_name_given_there(ctx, anna):
    for name in ("z", "a"):
        ctx.sensor.create_sensor(name, SensorType.AGENT)
    anna.register_sensor("second", ctx.sensor.get_sensor("z"))
    anna.register_sensor("third", ctx.sensor.get_sensor("a"))
    assert list(anna.get_state()["sensor"]) == ["near", "second", "third"]


def test_a_sensor_that_was_deregistered_is_in_no_later_state(anna):
    anna.get_state()
    anna.deregister_sensor("near")
    assert anna.get_state() == {"curr_pos": 4, "sensor": {}}


@pytest.mark.parametrize("action", [5, np.int64(5), np.uint8(5), {"node_id": 5}, {"node_id": np.int32(5), "x": 1}])
def test_an_action_is_a_node_id_or_a_dict_with_one(anna, action):
    anna.get_state()["action"] = action
    anna.set_state()
    assert (anna.current_node_id, anna.prev_node_id) == (5, 4)
    assert type(anna.current_node_id) is int


@pytest.mark.parametrize(
    ("action", "error"),
    [
        (99, KeyError),
        (-1, KeyError),
        (np.int64(99), KeyError),
        ({"node_id": 99}, KeyError),
        ({"node_id": 99, "orientation": (0, 1)}, KeyError),
        ({}, ValueError),
        ({"node": 5}, ValueError),
        ({"orientation": (1, 0)}, ValueError),
        ({"node_id": 5, "orientation": (0, 0)}, ValueError),
        ({"node_id": 5, "orientation": (1, 0, 0)}, ValueError),
        ({"node_id": 5, "orientation": ()}, ValueError),
        ({"node_id": 5, "orientation": 7}, ValueError),
        ({"node_id": 5, "orientation": (float("nan"), 1)}, ValueError),
        ({"node_id": 5, "orientation": (float("inf"), 1)}, ValueError),
        ({"node_id": "5"}, TypeError),
        ({"node_id": None}, TypeError),
        ({"node_id": True}, TypeError),
        (True, TypeError),
        (np.True_, TypeError),
        (5.0, TypeError),
        (np.float64(5), TypeError),
        ("5", TypeError),
        (None, TypeError),
        ((5,), TypeError),
        ([5], TypeError),
    ],
)
def test_a_bad_action_raises_and_changes_nothing(anna, action, error):
    anna.prev_node_id = 1
    before = where(anna)
    anna.get_state()["action"] = action
    with pytest.raises(error) as caught:
        anna.set_state()
    assert isinstance(caught.value, GammsError)
    assert where(anna) == before


def test_an_action_far_too_large_for_an_id_is_refused(anna):
    anna.get_state()["action"] = 2**70
    with pytest.raises((KeyError, ValueError)):
        anna.set_state()
    assert where(anna) == (4, 4, (0.0, 0.0))


def test_without_an_action_set_state_is_a_key_error(anna):
    with pytest.raises(KeyError, match="action"):
        anna.set_state()
    anna.get_state()
    with pytest.raises(KeyError, match="action"):
        anna.set_state()
    assert where(anna) == (4, 4, (0.0, 0.0))


def test_the_error_of_a_bad_action_shows_the_value(anna):
    anna.get_state()["action"] = 5.5
    with pytest.raises(TypeError, match=r"node id or a dict with 'node_id', not 5\.5 \(float\)"):
        anna.set_state()


def test_a_move_need_not_follow_an_edge(anna):
    anna.get_state()["action"] = 8
    anna.set_state()
    assert (anna.current_node_id, anna.prev_node_id) == (8, 4)


def test_staying_is_a_move_that_makes_the_node_its_own_previous_one(anna):
    for action in (5, 5):
        anna.get_state()["action"] = action
        anna.set_state()
    assert (anna.current_node_id, anna.prev_node_id) == (5, 5)


def test_a_step_without_a_strategy_is_an_attribute_error(anna):
    with pytest.raises(AttributeError, match="'anna' has no strategy"):
        anna.step()
    anna.register_strategy(lambda state: None)
    anna.register_strategy(None)
    with pytest.raises(AttributeError):
        anna.step()


def test_a_strategy_that_is_no_function_is_refused(anna):
    with pytest.raises(TypeError, match="function of the state"):
        anna.register_strategy("north")
    assert anna.strategy is None


def test_a_strategy_that_raises_leaves_the_agent_where_it_is(anna):
    anna.register_strategy(lambda state: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        anna.step()
    assert where(anna) == (4, 4, (0.0, 0.0))


@pytest.mark.parametrize(("node", "error"), [(99, KeyError), ("4", TypeError), (True, TypeError), (4.0, TypeError)])
@pytest.mark.parametrize("attribute", ["current_node_id", "prev_node_id"])
def test_an_agent_cannot_be_put_on_an_unknown_node(anna, attribute, node, error):
    with pytest.raises(error):
        setattr(anna, attribute, node)
    assert where(anna) == (4, 4, (0.0, 0.0))


@pytest.mark.parametrize("attribute", ["name", "type", "state"])
def test_the_identity_of_an_agent_cannot_be_assigned(anna, attribute):
    with pytest.raises(AttributeError):
        setattr(anna, attribute, "x")


def test_a_removed_node_under_an_agent_is_a_key_error_until_it_moves(ctx, anna):
    ctx.graph.graph.remove_node(4)
    with pytest.raises(KeyError):
        anna.get_state()
    anna.current_node_id = anna.prev_node_id = 0
    assert anna.get_state()["sensor"]["near"][1] == [0, 1, 3]
    anna.state["action"] = 4
    with pytest.raises(KeyError):
        anna.set_state()


@pytest.mark.parametrize("name", ["set_state", "get_state", "state", "step"])
def test_a_keyword_that_agents_have_as_a_method_says_what_a_keyword_may_be(ctx, name):
    with pytest.raises(ReservedName, match=f"'{name}' cannot be a keyword of create_agent: .* may be alive, .*own"):
        ctx.agent.create_agent("anna", start_node_id=0, **{name: 1})
    assert "anna" not in ctx.agent.agents
