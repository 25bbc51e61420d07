"""Sensors that are declared where agents are created."""

import inspect

import pytest

import gamms
from gamms import scenario
from gamms.errors import BadType, BadValue, Duplicate, UnknownName, UnknownType
from gamms.scenario import Scenario, ScenarioError
from gamms.sensor import SensorType
from gamms.sensor.catalog import KINDS

MAP = {"grid": {"width": 9, "height": 9}}
EYES = gamms.sensor.agent_range(range_m=25)


@pytest.fixture
def town():
    with gamms.create_context(seed=4) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(9, 9))
        yield ctx


@pytest.mark.parametrize("kind", [kind.name for kind in KINDS])
def test_every_kind_has_a_factory_that_declares_it(town, kind):
    factory = getattr(gamms.sensor, kind.lower())
    declared = town.sensor.from_declaration("declared", factory())
    created = town.sensor.create_sensor("created", kind)
    assert KINDS[SensorType[kind]].list_keywords(declared) == KINDS[SensorType[kind]].list_keywords(created)
    assert set(inspect.signature(factory).parameters) == KINDS[SensorType[kind]].list_names() - {"sensor_range"}


def test_a_declared_sensor_needs_no_id(town):
    for name, node in (("anna", 0), ("ben", 2), ("eve", 40)):
        town.agent.create_agent(name, start_node_id=node, sensors={"eyes": EYES})
    assert town.agent.get_agent("anna").get_state()["sensor"] == {"eyes": (SensorType.AGENT_RANGE, {"ben": 2})}
    assert town.agent.get_agent("eve").get_state()["sensor"]["eyes"] == (SensorType.AGENT_RANGE, {})


def test_each_agent_of_a_team_gets_its_own_sensor(town):
    town.agent.create_team("red", [0, 1, 80], sensors={"eyes": EYES})
    red = town.agent.teams["red"]
    assert [sorted(agent.get_state()["sensor"]["eyes"][1]) for agent in red] == [["red_1"], ["red_0"], []]
    assert len({id(agent.sensors["eyes"]) for agent in red}) == 3


def test_a_function_is_declared_as_a_sensor(town):
    double = gamms.sensor.from_function(lambda node: 2 * node)
    agent = town.agent.create_agent("anna", start_node_id=7, sensors={"double": double})
    assert agent.get_state()["sensor"]["double"] == (SensorType.CUSTOM, 14)


def test_an_agent_that_comes_back_gets_a_new_sensor(town):
    town.agent.create_agent("anna", start_node_id=0, sensors={"eyes": EYES})
    town.agent.delete_agent("anna")
    anna = town.agent.create_agent("anna", start_node_id=0, sensors={"eyes": gamms.sensor.agent_range(range_m=50)})
    assert anna.sensors["eyes"].range == 50


@pytest.mark.parametrize(
    ("sensors", "error"),
    [
        ({"eyes": EYES, "ears": {"type": "AGNT"}}, UnknownType),
        ({"eyes": EYES, "ears": {"type": "range", "range_m": -1}}, BadValue),
        ({"eyes": EYES, "sky": gamms.sensor.aerial()}, ValueError),
        ({"eyes": EYES, "ears": 3}, BadType),
    ],
)
def test_an_agent_with_an_impossible_sensor_changes_nothing(town, sensors, error):
    with pytest.raises(error):
        town.agent.create_agent("anna", start_node_id=0, sensors=sensors)
    with pytest.raises(error):
        town.agent.create_team("red", [0, 1], sensors=sensors)
    assert (dict(town.agent.agents), dict(town.sensor.sensors)) == ({}, {})


def test_a_sensor_that_an_agent_carries_is_not_replaced(town):
    town.agent.create_agent("ben", start_node_id=0, sensors={"x": town.sensor.create_sensor("anna/eyes", "NEIGHBOR")})
    with pytest.raises(Duplicate):
        town.agent.create_agent("anna", start_node_id=0, sensors={"eyes": EYES})
    assert list(town.agent.agents) == ["ben"]


@pytest.mark.parametrize(
    ("mistake", "message"),
    [
        (lambda _: gamms.sensor.agent_range(range=60), "takes no range=. Did you mean 'range_m'?"),
        (lambda _: gamms.sensor.map(team="red"), "gamms.sensor.map() takes no team=. It takes: at."),
        (lambda ctx: ctx.agent.create_agent("a", start_node_id=0, sensors=[EYES]), "Give it a name, sensors={"),
        (lambda ctx: ctx.agent.create_agent("a", start_node_id=0, sensors=EYES), "Give it a name, sensors={"),
        (lambda ctx: ctx.sensor.create_sensor("s", "RANGE", range_m=1, sensor_range=2), "Give range_m= only."),
    ],
)
def test_a_mistake_says_the_way_out(town, mistake, message):
    with pytest.raises((BadType, BadValue)) as caught:
        mistake(town)
    assert message in str(caught.value)


def test_range_m_and_its_old_name_are_the_same(town):
    new = town.sensor.create_sensor("new", "RANGE", range_m=12)
    old = town.sensor.create_sensor("old", "RANGE", sensor_range=12)
    assert new.range == old.range == 12


def declared(sensors, by_name=None, **teams):
    red = {"count": 2, "sensors": sensors, "strategy": "gamms.strategies:chase"}
    blue = {"count": 1, "strategy": "gamms.strategies:random_walk"}
    return Scenario(map=MAP, seed=3, max_turns=20, sensors=by_name or {}, teams={"red": red, "blue": blue, **teams})


def test_an_agent_of_a_scenario_declares_its_own_sensors():
    agents = [{"name": "anna", "node": 0, "sensors": {"near": gamms.sensor.neighbor()}}]
    with declared({"eyes": EYES}, green={"agents": agents, "sensors": {"eyes": EYES}}).build() as ctx:
        assert list(ctx.agent.get_agent("anna").sensors) == ["near"]
        assert list(ctx.agent.get_agent("red_0").sensors) == ["eyes"]


def test_digests_do_not_depend_on_the_name_of_a_keyword():
    assert declared({"e": EYES}).digests() == declared({"e": {"type": "AGENT_RANGE", "sensor_range": 25}}).digests()


def test_a_recording_of_a_scenario_with_declared_sensors_gives_the_scenario(tmp_path):
    match = declared({"eyes": EYES})
    result = match.play(record=tmp_path / "game.ggr")
    with gamms.recorder.open(tmp_path / "game.ggr") as recording:
        assert scenario.from_recording(recording).play() == result


def test_a_function_of_a_team_is_found_and_made_again_for_each_seed(tmp_path):
    (tmp_path / "own.py").write_text("def scent(ctx, k):\n    return lambda node: (k, ctx.seed)\n")
    match = declared({"nose": {"function": "own:scent", "with": {"k": 2}}})
    match = Scenario(folder=tmp_path, **match.to_dict())
    assert "teams.red.sensors.nose" in [one.path for one in match.code()]
    with match.build() as ctx:
        ctx.game.reset(8)
        assert ctx.agent.get_agent("red_1").get_state()["sensor"]["nose"][1] == (2, 8)


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        ("eyes.rang_m", 3, "teams.red.sensors.eyes.rang_m: unknown key, with the value 3. Did you mean 'range_m'?"),
        ("eyes.type", "agnt_range", "unknown sensor type 'agnt_range'. Did you mean 'agent_range'?"),
        ("eyes.range_m", -1, "teams.red.sensors.eyes.range_m: cannot be -1"),
        ("eyes.fov", 3, "a AGENT_RANGE sensor has none"),
    ],
)
def test_a_mistake_in_a_team_names_its_place(path, value, message):
    with pytest.raises(ScenarioError) as caught:
        declared({"eyes": EYES}).replace(**{f"teams.red.sensors.{path}": value})
    assert message in str(caught.value)


def test_a_sensor_that_is_only_named_has_to_be_declared():
    with pytest.raises(ScenarioError, match="or here: sensors:"):
        declared(["eyes"])
    with pytest.raises(UnknownName), gamms.create_context() as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(2, 2))
        ctx.agent.create_team("red", [0], sensors={"eyes": "eyes"})
