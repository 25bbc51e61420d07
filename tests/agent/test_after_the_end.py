"""After the end of its context an agent stays readable and does nothing; creating raises."""

import pytest

from gamms.errors import ContextTerminated
from gamms.sensor import ISensor, SensorType


def test_the_last_state_is_handed_out_again(ctx, anna):
    last = anna.get_state()
    ctx.terminate()
    assert anna.get_state() == anna.state == last


def test_an_agent_that_never_looked_hands_out_the_data_of_its_sensors(ctx, anna):
    ctx.terminate()
    assert anna.get_state() == {"curr_pos": 4, "sensor": {"near": (SensorType.NEIGHBOR, [])}}
    assert anna.state == {}


def test_a_step_without_a_strategy_is_quiet_too(ctx, anna):
    ctx.terminate()
    anna.set_state()
    anna.step()
    assert (anna.current_node_id, anna.prev_node_id) == (4, 4)


def test_creating_an_agent_raises(ctx):
    ctx.terminate()
    with pytest.raises(ContextTerminated, match="terminated"):
        ctx.agent.create_agent("a", start_node_id=0)
    with pytest.raises(AttributeError):
        ctx.agent.create_agent("a", start_node_id=0)


def test_a_sensor_with_nothing_to_show_does_not_keep_a_context_from_ending(ctx):
    class Shy(ISensor):
        sensor_id, type = "shy", SensorType.CUSTOM

        @property
        def data(self):
            return self._seen

        def sense(self, node_id):
            self._seen = node_id

        def update(self, data):
            pass

        def set_owner(self, owner):
            pass

    ctx.sensor.add_sensor(Shy())
    agents = [ctx.agent.create_agent(name, start_node_id=0, sensors=["shy"]) for name in "xyz"]
    ctx.terminate()
    for agent in agents:
        assert agent.get_state()["sensor"] == {"shy": (SensorType.CUSTOM, None)}
        agent.set_state()
