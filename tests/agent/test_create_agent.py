"""Creating agents: which keywords mean what, and that nothing has changed when it fails."""

import numpy as np
import pytest

import gamms
from gamms.agent import AgentType
from gamms.errors import GammsError, MissingKey
from gamms.sensor import SensorType


def test_an_agent_starts_on_its_node_with_nothing_else(ctx):
    agent = ctx.agent.create_agent("a", start_node_id=np.int64(3))
    assert (agent.name, agent.type, agent.current_node_id, agent.prev_node_id) == ("a", AgentType.BASIC, 3, 3)
    assert (agent.state, agent.strategy, agent.team, agent.orientation, agent._sensor_list) == (
        {},
        None,
        None,
        (0.0, 0.0),
        {},
    )
    assert type(agent.current_node_id) is int
    assert ctx.agent.get_agent("a") is agent
    assert isinstance(agent, gamms.typing.IAgent)


def test_keywords_that_are_settable_are_set(ctx):
    agent = ctx.agent.create_agent("a", start_node_id=0, current_node_id=2, prev_node_id=1)
    assert (agent.current_node_id, agent.prev_node_id) == (2, 1)


@pytest.mark.parametrize("kwargs", [{}, {"type": 0}, {"type": AgentType.BASIC}, {"agent_type": AgentType.BASIC}])
def test_type_and_agent_type_are_synonyms(ctx, kwargs):
    agent = ctx.agent.create_agent("a", start_node_id=0, **kwargs)
    assert agent.type is AgentType.BASIC


def test_a_type_that_is_none_means_basic_and_is_warned_about(ctx, heard):
    assert ctx.agent.create_agent("a", start_node_id=0, type="basik").type is AgentType.BASIC
    assert "unknown type 'basik'" in heard[0]
    assert "Did you mean 'BASIC'" in heard[0]
    assert ctx.agent.create_agent("b", start_node_id=0, type="basic").type is AgentType.BASIC
    assert len(heard) == 1


def test_an_agent_type_that_is_none_is_an_attribute_of_the_callers(ctx):
    agent = ctx.agent.create_agent("a", start_node_id=0, agent_type="defender")
    assert (agent.type, agent.agent_type) == (AgentType.BASIC, "defender")


def test_sensors_may_be_given_by_the_names_in_the_state(ctx):
    agent = ctx.agent.create_agent(
        "a", start_node_id=0, sensors={"around": ctx.sensor.get_sensor("near"), "too": "near"}
    )
    assert list(agent.get_state()["sensor"]) == ["around", "too"]


@pytest.mark.parametrize(
    ("kwargs", "error", "words"),
    [
        ({}, KeyError, "start_node_id"),
        ({"start_node": 0}, KeyError, "Did you mean 'start_node_id'"),
        ({"start_node_id": 99}, KeyError, "Unknown node 99"),
        ({"start_node_id": "0"}, TypeError, "'0'"),
        ({"start_node_id": True}, TypeError, "True"),
        ({"start_node_id": None}, TypeError, "None"),
        ({"start_node_id": 0, "current_node_id": 99}, KeyError, "99"),
        ({"start_node_id": 0, "state": {}}, AttributeError, "'state'"),
        ({"start_node_id": 0, "step": print}, AttributeError, "'step'"),
        ({"start_node_id": 0, "get_state": print}, AttributeError, "'get_state'"),
        ({"start_node_id": 0, "register_sensor": 1}, AttributeError, "'register_sensor'"),
        ({"start_node_id": 0, "_row": 7}, AttributeError, "'_row'"),
        ({"start_node_id": 0, "__class__": int}, AttributeError, "'__class__'"),
        ({"start_node_id": 0, "type": "aerial"}, KeyError, "'new' needs speed="),
        ({"start_node_id": 0, "type": AgentType.BASIC, "agent_type": AgentType.AERIAL}, KeyError, "speed"),
        ({"start_node_id": 0, "type": 1, "sped": 1.0}, KeyError, "Did you mean 'speed'"),
        ({"type": 1, "speed": 1.0}, KeyError, "start_node_id"),
        ({"start_node_id": 99, "type": 1, "speed": 1.0}, KeyError, "Unknown node 99"),
        ({"start_node_id": "0", "type": 1, "speed": 1.0}, TypeError, "'0'"),
        ({"start_node_id": 0, "type": 1, "speed": -1.0}, ValueError, "speed of agent 'new' must not be negative"),
        ({"start_node_id": 0, "type": 1, "speed": float("nan")}, ValueError, "speed of agent 'new'"),
        ({"start_node_id": 0, "type": 1, "speed": float("inf")}, ValueError, "speed of agent 'new'"),
        ({"start_node_id": 0, "type": 1, "speed": None}, TypeError, "speed of agent 'new'"),
        ({"start_node_id": 0, "type": 1, "speed": "fast"}, TypeError, "'fast'"),
        ({"start_node_id": 0, "type": 1, "speed": 1, "position": (1, 2)}, ValueError, "position"),
        ({"start_node_id": 0, "type": 1, "speed": 1, "quat": "wxyz"}, TypeError, "quat"),
        ({"start_node_id": 0, "type": 1, "speed": 1, "orientation": (0, 0)}, ValueError, "orientation"),
        ({"start_node_id": 0, "type": 1, "speed": 1, "prev_position": (0, 0, 0)}, AttributeError, "'prev_position'"),
        ({"start_node_id": 0, "sensors": "near"}, TypeError, "list of sensor ids"),
        ({"start_node_id": 0, "sensors": None}, TypeError, "list of sensor ids"),
        ({"start_node_id": 0, "strategy": "north"}, TypeError, "function of the state"),
    ],
)
def test_a_bad_keyword_raises_and_nothing_has_changed(ctx, anna, kwargs, error, words):
    sensor = ctx.sensor.get_sensor("near")
    with pytest.raises(error, match=words):
        ctx.agent.create_agent("new", **{"sensors": ["near"], **kwargs})
    assert list(ctx.agent.agents) == ["anna"]
    assert list(ctx.agent.positions.names) == ["anna"]
    assert sensor._owner == "anna"
    assert ctx.agent.create_agent("new", start_node_id=0).current_node_id == 0


def test_a_duplicate_name_is_a_value_error_and_the_first_agent_stays(ctx, anna):
    with pytest.raises(ValueError, match="already an agent named 'anna'"):
        ctx.agent.create_agent("anna", start_node_id=0, sensors=["near"], team=2)
    assert ctx.agent.get_agent("anna") is anna
    assert (anna.current_node_id, anna.team) == (4, None)


@pytest.mark.parametrize(("name", "error"), [("", ValueError), (7, TypeError), (None, TypeError)])
def test_a_name_is_a_string(ctx, name, error):
    with pytest.raises(error):
        ctx.agent.create_agent(name, start_node_id=0)


def test_an_unknown_agent_is_a_key_error_with_the_nearest_name(ctx, anna):
    with pytest.raises(KeyError, match=r"Unknown agent 'ana'. Did you mean 'anna'\?") as caught:
        ctx.agent.get_agent("ana")
    assert isinstance(caught.value, GammsError)
    with pytest.raises(KeyError):
        ctx.agent.get_agent(["anna"])


def test_unknown_sensors_are_warned_about_and_skipped(ctx, heard):
    agent = ctx.agent.create_agent("a", start_node_id=0, sensors=iter(["nearr", "near"]))
    assert list(agent._sensor_list) == ["near"]
    assert len(heard) == 1
    assert "'a' is created without a sensor: Unknown sensor 'nearr'. Did you mean 'near'?" in heard[0]


@pytest.mark.parametrize("sensors", [[5], {"e": 5}, ["near", ["odd"]], {5: "near"}, {"": "near"}, 5, "near"])
def test_an_invalid_sensor_is_refused_before_anything_has_changed(ctx, sensors):
    with pytest.raises((TypeError, ValueError)):
        ctx.agent.create_agent("a", start_node_id=0, sensors=sensors)
    assert not ctx.agent.agents
    assert ctx.sensor.get_sensor("near")._owner is None


def test_a_sensor_itself_may_be_in_a_list(ctx):
    agent = ctx.agent.create_agent("a", start_node_id=0, sensors=[ctx.sensor.get_sensor("near")])
    assert list(agent.get_state()["sensor"]) == ["near"]


def test_a_misspelt_keyword_is_warned_about_and_kept_as_an_attribute(ctx, heard):
    agent = ctx.agent.create_agent("a", start_node_id=0, sensor=["near"], goal=3)
    assert agent.sensor == ["near"]
    assert len(heard) == 1
    assert "Unknown keyword 'sensor'. Did you mean 'sensors'?" in heard[0]


@pytest.mark.parametrize("name", ["start", "home", "node", "squad", "post", "stage"])
def test_an_attribute_that_is_no_misspelt_keyword_is_not_warned_about(ctx, heard, name):
    assert getattr(ctx.agent.create_agent("a", start_node_id=0, **{name: 3}), name) == 3
    ctx.agent.create_team("red", [0, 1], columns={name: 3})
    assert not heard


def test_an_attribute_that_looks_misspelt_is_warned_about_once_and_kept(ctx, heard):
    ann, ben = (ctx.agent.create_agent(name, start_node_id=0) for name in ("ann", "ben"))
    for agent in (ann, ben, ann):
        agent.curent_node_id = 3
        agent.energy, agent.notes, agent.alive = 3, [1], True
    assert (ann.curent_node_id, ann.current_node_id, ann.notes) == (3, 0, [1])
    hint = "Unknown attribute 'curent_node_id'. Did you mean 'current_node_id'? It is stored as an attribute."
    assert heard == [f"Agent 'ann': {hint}"]
    with ctx.game.fork(1).ctx as ahead:
        ahead.agent.get_agent("ann").curent_node_id = 4
    assert len(heard) == 1


def test_the_position_of_an_agent_that_does_not_fly_is_warned_about_and_kept_as_in_1_0_0(ctx, heard):
    kite = ctx.agent.create_agent("kite", start_node_id=0, position=(1.0, 2.0, 3.0))
    assert (kite.position, kite.type, kite.current_node_id) == ((1.0, 2.0, 3.0), AgentType.BASIC, 0)
    hint = "position= is only for flying agents: also give type=AgentType.AERIAL and speed=."
    assert heard == [f"Agent 'kite': {hint} It is stored as an attribute."]
    with pytest.raises(MissingKey, match=f"needs start_node_id=, the node it stands on. {hint}"):
        ctx.agent.create_agent("ann", position=(1.0, 2.0, 3.0))
    ctx.agent.create_agent("drone", start_node_id=0, type="AERIAL", speed=1.0, position=(1.0, 2.0, 3.0))
    assert len(heard) == 1


def test_an_attribute_that_looks_misspelt_is_warned_about_in_each_context(ctx, heard):
    ctx.agent.create_agent("ann", start_node_id=0).currentnodeid = [1]
    assert heard == [
        "Agent 'ann': Unknown attribute 'currentnodeid'. Did you mean 'current_node_id'? It is stored as an attribute."
    ]


def test_a_strategy_can_be_given_at_once(ctx):
    agent = ctx.agent.create_agent("a", start_node_id=0, strategy=lambda state: state.update(action=1))
    agent.step()
    assert agent.current_node_id == 1


def test_a_config_is_not_changed(ctx):
    config = {"start_node_id": 0, "sensors": ["near"], "type": AgentType.BASIC, "meta": {"team": 1}}
    kept = {**config, "sensors": list(config["sensors"])}
    ctx.agent.create_agent("a", **config)
    assert config == kept


def test_an_agent_of_no_kind_cannot_be_made():
    with pytest.raises(TypeError):
        gamms.agent.NoOpAgent()


def test_a_registered_sensor_belongs_to_the_agent_and_a_displaced_one_keeps_its_owner(ctx, anna, heard):
    first = ctx.sensor.get_sensor("near")
    second = ctx.sensor.create_sensor("other", SensorType.NEIGHBOR)
    anna.register_sensor("near", second)
    assert (first._owner, second._owner) == ("anna", "anna")
    anna.deregister_sensor("near")
    anna.deregister_sensor("near")
    assert (anna._sensor_list, second._owner) == ({}, None)
    assert heard == ["Agent 'anna' has no sensor 'near' to deregister."]


@pytest.mark.parametrize("thing", [None, "near", object()])
def test_only_sensors_can_be_registered(anna, thing):
    with pytest.raises(TypeError, match="A sensor is an object with"):
        anna.register_sensor("x", thing)
    assert list(anna._sensor_list) == ["near"]


def test_an_agent_that_cannot_carry_its_sensors_is_not_created(ctx):
    with pytest.raises(TypeError):
        ctx.agent.create_agent("a", start_node_id=0, sensors={5: "near"})
    assert "a" not in ctx.agent.agents
    assert ctx.sensor.get_sensor("near")._owner is None
    ctx.agent.create_agent("a", start_node_id=0)


def test_a_team_that_cannot_be_distinguished_from_others_is_refused(ctx):
    from gamms.errors import BadType

    agent = ctx.agent.create_agent("of a team", start_node_id=0, team=("red", 1))
    with pytest.raises(BadType, match="A team must be a value such as a text"):
        agent.team = ["red"]
    assert agent.team == ("red", 1)
