"""Sensors made of plain functions, and information from outside: a file that grows, a socket that speaks."""

import numpy as np
import pytest

from gamms.errors import IllegalMutation
from gamms.sensor import FunctionSensor, SensorType
from gamms.testing import check_sensor
from gamms.typing import ISensor


def test_a_function_becomes_a_sensor_of_its_name(ctx):
    fuel = ctx.sensor.from_function("fuel", lambda node_id: 100 - node_id)
    assert isinstance(fuel, FunctionSensor)
    assert isinstance(fuel, ISensor)
    assert (fuel.sensor_id, fuel.type, fuel.data) == ("fuel", SensorType.CUSTOM, None)
    scout = ctx.agent.create_agent("scout", start_node_id=3, sensors=["fuel"])
    assert scout.get_state()["sensor"] == {"fuel": (SensorType.CUSTOM, 97)}
    check_sensor(fuel, 0)


def test_a_function_may_look_at_the_agent_that_carries_it(ctx):
    fuel = ctx.sensor.from_function("fuel", lambda node_id, agent: agent and (agent.name, agent.meta["fuel"]))
    fuel.sense(0)
    assert fuel.data is None
    scouts = [ctx.agent.create_agent(f"scout {i}", start_node_id=0, meta={"fuel": i}, sensors=["fuel"]) for i in (1, 2)]
    assert [scout.get_state()["sensor"]["fuel"][1] for scout in scouts] == [("scout 1", 1), ("scout 2", 2)]


def test_functions_of_every_shape_are_called_with_what_they_take(ctx):
    def optional(node_id, scale=2):
        return node_id * scale

    class Meter:
        def read(self, node_id):
            return -node_id

    shapes = {
        "nothing": (lambda: "x", "x"),
        "optional": (optional, 6),
        "open": (lambda *given: given, (3, None)),
        "bound": (Meter().read, -3),
        "builtin": (str, "3"),
    }
    for name, (fn, expected) in shapes.items():
        sensor = ctx.sensor.from_function(name, fn)
        sensor.sense(3)
        assert sensor.data == expected, name


@pytest.mark.parametrize("fn", [None, 5, "fuel", lambda a, b, c: 0, lambda node_id, *, key: 0])
def test_functions_with_wrong_parameters_are_refused(ctx, fn):
    with pytest.raises(TypeError, match=r"The function of sensor 'fuel' must take \(\), \(node_id\) or"):
        ctx.sensor.from_function("fuel", fn)
    assert ctx.sensor.sensors == {}


def test_a_taken_name_is_refused_and_an_ended_context_too(ctx):
    ctx.sensor.from_function("fuel", lambda: 1)
    with pytest.raises(ValueError, match="already a sensor named 'fuel'"):
        ctx.sensor.from_function("fuel", lambda: 2)
    ctx.terminate()
    with pytest.raises(AttributeError, match="terminated"):
        ctx.sensor.from_function("more", lambda: 3)


@pytest.mark.parametrize("make", [lambda log: log, lambda log: {"log": 1} if not log else dict.fromkeys(log), np.array])
def test_a_container_that_the_function_goes_on_writing_to_is_copied(ctx, make):
    log = []
    kept = make(log)
    sensor = ctx.sensor.from_function("log", lambda: kept)
    sensor.sense(0)
    assert sensor.data is not kept
    assert type(sensor.data) is type(kept)


def test_an_error_of_the_function_reaches_the_caller_and_the_data_stays(ctx):
    answers = iter([1])
    sensor = ctx.sensor.from_function("s", lambda: next(answers))
    sensor.sense(0)
    with pytest.raises(StopIteration):
        sensor.sense(0)
    assert sensor.data == 1


def test_a_strategy_may_not_call_it(ctx):
    calls = []
    sensor = ctx.sensor.from_function("s", lambda: calls.append(1))

    def peek(state):
        sensor.sense(0)

    ctx.agent.create_agent("a", start_node_id=0, strategy=peek)
    with pytest.raises(IllegalMutation, match=r"sensor\.sense"):
        ctx.game.step()
    assert not calls


def test_many_looks_are_one_by_one(ctx):
    sensor = ctx.sensor.from_function("square", lambda node_id: [node_id] * node_id)
    many = sensor.sense_many([0, 2, 1])
    assert [many[i].tolist() for i in range(3)] == [[[]], [[2, 2]], [[1]]]
    assert many[-1].tolist() == [[1]]
    with pytest.raises(IndexError):
        many[3]
