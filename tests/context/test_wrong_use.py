"""A wrong use of a right object is answered where it is used: the error says how it is used."""

import pytest

import gamms
from gamms.errors import BadType, UnknownName
from gamms.sensor import SensorType, agent_range, neighbor
from gamms.sensor import range as range_sensor
from gamms.strategies import stay


@pytest.fixture
def town():
    with gamms.create_context(seed=1, logger_config={"level": "CRITICAL"}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(4, 4))
        ctx.agent.create_agent("bob", start_node_id=1, team="blue", strategy=stay)
        yield ctx


SENSORS = {"eyes": agent_range(), "near": neighbor(), "street": range_sensor()}
PAIR = "A sensor gives the pair (kind, data): write _, seen = state['sensor']['eyes']."


def note_of(town, strategy):
    """Return what is noted at the error of a strategy of an agent with sensors."""
    town.agent.create_agent("ann", start_node_id=0, team="red", sensors=SENSORS, strategy=strategy)
    with pytest.raises((AttributeError, TypeError)) as caught:
        town.game.step()
    return caught.value.__notes__[-1]


@pytest.mark.parametrize(
    "strategy",
    [
        lambda state: state["sensor"]["eyes"].items(),
        lambda state: state["sensor"]["eyes"]["bob"],
        lambda state: [name for name, _ in state["sensor"]["eyes"]],
        lambda state: state["sensor"]["eyes"](),
        lambda state: min(state["sensor"]["eyes"]),
    ],
)
def test_the_pair_of_a_sensor_that_is_used_as_its_data_is_explained(town, strategy):
    assert note_of(town, strategy) == f"In the strategy of agent 'ann', in turn 0. {PAIR}"


def test_the_attribute_of_a_pair_names_the_sensor_that_gave_it(town):
    assert note_of(town, lambda state: state["sensor"]["near"].data).endswith("state['sensor']['near'].")


def test_the_pair_of_a_sensor_is_explained_to_plans_and_coroutines(town):
    async def look(state):
        state["sensor"]["eyes"].items()

    assert PAIR in note_of(town, look)
    town.agent.delete_agent("ann")
    town.game.command("red", lambda states: states["ann"]["sensor"]["eyes"].items())
    assert note_of(town, stay) == f"In the plan of team 'red', in turn 0. {PAIR}"


def test_other_errors_with_tuples_have_no_hint_of_sensors(town):
    assert note_of(town, lambda state: state["legal"].pop()) == "In the strategy of agent 'ann', in turn 0."


def test_a_key_that_is_read_as_an_attribute_is_answered_with_the_key(town):
    assert note_of(town, lambda state: state["sensor"]["street"][1].nodes).endswith("It is a key: write ['nodes'].")
    town.agent.delete_agent("ann")
    town.game.publish(goal=3)
    assert note_of(town, lambda state: state.facts.goal).endswith("It is a key: write ['goal'].")


def test_a_key_that_is_read_as_an_attribute_is_answered_in_rules(town):
    town.game.emit("toll", node=4)
    town.game.add(lambda ctx: ctx.game.events[0].node)
    with pytest.raises(AttributeError) as caught:
        town.game.step()
    assert caught.value.__notes__[-1].endswith("It is a key: write ['node'].")


@pytest.mark.parametrize(
    ("keys", "hint"),
    [
        ({"acton": 1}, "Unknown key of the state 'acton'. Did you mean 'action'?"),
        ({"outbx": []}, "Unknown key of the state 'outbx'. Did you mean 'outbox'?"),
        (
            {"move": 1},
            "Unknown key of the state 'move'. There are: 'action', 'outbox', 'memory', 'team_memory'.",
        ),
        ({"outbox": []}, "legal are [0, 1, 4]"),
    ],
)
def test_a_missing_action_is_explained_by_the_key_that_was_set_instead(town, keys, hint):
    def strategy(state):
        state.update(keys)

    town.agent.create_agent("ann", start_node_id=0, team="red", strategy=strategy)
    (error,) = town.game.run(1).errors
    assert error["message"].startswith("IllegalAction: state['action'] was not set")
    assert error["message"].endswith(hint)


def test_a_missing_action_of_a_plan_is_explained_too(town):
    def plan(states):
        for state in states.values():
            state["acton"] = 1

    town.agent.create_agent("ann", start_node_id=0, team="red")
    town.game.command("red", plan)
    (error,) = town.game.run(1).errors
    assert error["message"].endswith("Did you mean 'action'?")


DECLARED = "Declare it: sensors={'eyes': gamms.sensor.agent_range()}."


@pytest.mark.parametrize("given", ["agent_range", "AGENT_RANGE", SensorType.AGENT_RANGE, agent_range])
def test_the_name_of_a_kind_is_not_taken_for_a_sensor(town, given):
    for sensors in ({"eyes": given}, given):
        with pytest.raises((BadType, UnknownName)) as caught:
            town.agent.create_agent("ann", start_node_id=0, sensors=sensors)
        assert str(caught.value).endswith(DECLARED)
    assert "ann" not in town.agent.agents


def test_an_unknown_id_in_a_dict_of_sensors_is_refused(town):
    town.sensor.create_sensor("near", "NEIGHBOR")
    with pytest.raises(UnknownName, match=r"Unknown sensor 'naer'. Did you mean 'near'\?"):
        town.agent.create_agent("ann", start_node_id=0, sensors={"eyes": "naer"})
    town.agent.create_agent("ann", start_node_id=0, sensors={"eyes": "near"})


def test_the_name_of_a_kind_in_a_list_is_skipped_as_in_1_0_0_with_a_warning_that_says_how(town, caplog):
    town.logger.setLevel("WARNING")
    town.agent.create_agent("ann", start_node_id=0, sensors=["agent_range"])
    assert caplog.records[-1].getMessage().endswith(DECLARED)
