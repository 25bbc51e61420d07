"""Sensors can be removed: no agent carries them any longer, and their names are free."""

import pytest

import gamms
from gamms.errors import IllegalMutation, UnknownName
from gamms.sensor import SensorType


@pytest.fixture
def scout(ctx):
    ctx.sensor.create_sensor("near", SensorType.NEIGHBOR)
    ctx.sensor.create_sensor("eyes", SensorType.AGENT, delay_turns=1)
    return ctx.agent.create_agent("scout", start_node_id=0, sensors={"n": "near", "e": "eyes", "again": "eyes"})


def test_no_agent_carries_a_sensor_that_was_removed(ctx, scout):
    other, eyes = ctx.agent.create_agent("other", start_node_id=1, sensors=["eyes"]), ctx.sensor.get_sensor("eyes")
    ctx.sensor.delete_sensor("eyes")
    assert list(ctx.sensor.sensors) == ["near"]
    assert (list(scout.sensors), list(other.sensors)) == (["n"], [])
    assert list(scout.get_state()["sensor"]) == ["n"]
    assert eyes._owner is None
    with pytest.raises(UnknownName, match="'eyes'"):
        ctx.sensor.get_sensor("eyes")


def test_the_name_of_a_sensor_that_was_removed_is_free(ctx, scout):
    ctx.sensor.delete_sensor("near")
    near = ctx.sensor.create_sensor("near", SensorType.MAP)
    assert ctx.sensor.get_sensor("near") is near
    assert "n" not in scout.sensors


@pytest.mark.parametrize("name", ["naer", None, 3])
def test_an_unknown_sensor_cannot_be_removed(ctx, scout, name):
    with pytest.raises(UnknownName, match="sensor"):
        ctx.sensor.delete_sensor(name)
    assert list(scout.sensors) == ["n", "e", "again"]


def test_sensors_of_ones_own_can_be_removed(ctx):
    ctx.sensor.from_function("clock", lambda: 3)
    ctx.sensor.delete_sensor("clock")
    assert ctx.sensor.sensors == {}


def test_a_deleted_sensor_forgets_delayed_reports(ctx, scout):
    scout.register_strategy(lambda state: state.update(action=0))
    ctx.game.run(2)
    assert ctx.game.internals.state.delayed_looks
    ctx.sensor.delete_sensor("eyes")
    assert not ctx.game.internals.state.delayed_looks


def test_a_strategy_may_not_remove_a_sensor(ctx, scout):
    scout.register_strategy(lambda state: ctx.sensor.delete_sensor("near"))
    with pytest.raises(IllegalMutation, match=r"may not .*delete_sensor"):
        ctx.game.step()
    assert "near" in ctx.sensor.sensors


def test_a_snapshot_brings_a_place_back_that_was_gone_already(ctx):
    tower = ctx.sensor.create_sensor("tower", SensorType.RANGE, at=5)
    ctx.graph.graph.remove_node(5)
    snapshot = ctx.game.snapshot()
    tower.at = 0
    ctx.game.restore(snapshot)
    assert tower.at == 5
    with pytest.raises(UnknownName, match="5"):
        tower.sense()


def test_a_picture_leaves_out_a_sensor_that_was_removed():
    def picture(*, has_sensor):
        with gamms.create_context(logger_config={"level": "CRITICAL"}) as ctx:
            ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 3))
            if has_sensor:
                ctx.sensor.create_sensor("eyes", "RANGE", at=4)
                ctx.sensor.get_sensor("eyes").sense()
                assert ctx.visual.frame(200, 150).any()
                ctx.sensor.delete_sensor("eyes")
            return ctx.visual.frame(200, 150)

    assert (picture(has_sensor=True) == picture(has_sensor=False)).all()
