"""States: dicts whose keys are attributes, too."""

import pytest

from gamms.agent import AgentType
from gamms.typing import AerialState, State


@pytest.fixture
def seen(grid):
    """The state of an agent with two sensors in a game, and what its strategy has read of it."""
    found = {}

    def strategy(state):
        found["state"] = state
        found["read"] = state.node, state.legal, state.turn, state.name, state.team, state.sensors, state.sensor
        state.action = state.legal[1]

    with grid() as ctx:
        near = ctx.sensor.create_sensor("near", "neighbor")
        eyes = ctx.sensor.create_sensor("eyes", "agent_range", sensor_range=100.0)
        ctx.agent.create_agent("b", start_node_id=2)
        ctx.agent.create_agent("a", start_node_id=0, team="red", strategy=strategy, sensors=[near, eyes])
        ctx.game.step()
        found["node"] = ctx.agent.get_agent("a").current_node_id
        yield found


def test_an_action_may_be_set_as_an_attribute(seen):
    assert seen["node"] == seen["state"]["action"] == seen["state"].action == seen["state"].legal[1]


@pytest.mark.parametrize("name", ["legal", "node", "team_memory", "sensors", "nonsense"])
def test_nothing_else_can_be_set(seen, name):
    before = dict(seen["state"])
    with pytest.raises(AttributeError):
        setattr(seen["state"], name, 3)
    assert seen["state"] == before


def test_an_attribute_of_a_key_that_is_not_there_names_those_that_are():
    state = State(curr_pos=3, sensor={})
    with pytest.raises(AttributeError, match=r"no 'legal'\. Its keys are: curr_pos, sensor"):
        _ = state.legal
    assert not hasattr(state, "action")
    assert not hasattr(state, "nonsense")
    assert getattr(state, "inbox", None) is None


def test_a_flyer_has_a_place_and_no_node(grid):
    found = []

    def strategy(state):
        found.append(state)
        state.action = (1.0, 0.0, 0.0)

    with grid() as ctx:
        ctx.agent.create_agent("kite", type=AgentType.AERIAL, start_node_id=0, speed=1.0, strategy=strategy)
        ctx.game.step()
    (state,) = found
    assert type(state) is AerialState
    assert (state.curr_pos, state.quat, hasattr(state, "node")) == (state["curr_pos"], state["quat"], False)
