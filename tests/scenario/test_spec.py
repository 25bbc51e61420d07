"""What is wrong with a scenario is told by its place in the file and the nearest valid key."""

import copy
import json
import pickle
from typing import Annotated

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import gamms
from gamms import rules, scenario
from gamms.errors import GammsError
from gamms.scenario import ScenarioError
from gamms.sensor import SensorType
from gamms.typing.game import OWNERS, TEAMS, Team

EYES = {"type": "AGENT_RANGE", "sensor_range": 15}
FAR = {"type": "AGENT_RANGE", "range_m": 15}
WRONG = [
    ({"teams.red.cuont": 8}, "teams.red.cuont", "8. Did you mean 'count'?"),
    ({"teams.red.count": "many"}, "teams.red.count", "'many': it must be a whole number, not a text."),
    ({"teams.red.count": -1}, "teams.red.count", ">= 0"),
    ({"teams.red.count": True}, "teams.red.count", "not true or false"),
    ({"teams.red.count": 0}, "teams.red", "no agents"),
    ({"mpa": {}}, "mpa", "Did you mean 'map'?"),
    ({"map": {}}, "map", "nothing is given"),
    ({"map": {"gird": {}}}, "map.gird", "Did you mean 'grid'?"),
    ({"map": {"grid": {"columns": 3}}}, "map.grid.rows", "missing"),
    ({"map": {"grid": {"width": 3}}}, "map.grid.rows", "missing"),
    ({"map": {"grid": {"rows": 0, "columns": 3}}}, "map.grid.rows", "cannot be 0: it must be a whole number >= 1"),
    ({"map": {"grid": {"rows": 3, "columns": 3, "spacing": 0}}}, "map.grid.spacing", "> 0"),
    ({"map": {"grid": {"columns": 3, "width": 3}}}, "map.grid.width", "the old name of columns, which is given, too"),
    (
        {"teams.red.sensors": {"a": {"type": "range", "range_m": 1, "sensor_range": 1}}},
        "teams.red.sensors.a.sensor_range",
        "the old name of range_m",
    ),
    ({"map.helsinki": {}}, "map", "grid and helsinki are given"),
    ({"map": {"place": {"location": "Turku", "osm_type": "wlak"}}}, "map.place.osm_type", "Did you mean 'walk'?"),
    ({"sensors.near.type": "NEIGHBOUR"}, "sensors.near.type", "Did you mean 'NEIGHBOR'?"),
    ({"sensors.near.type": "agent-range"}, "sensors.near.type", "Did you mean 'agent_range'?"),
    ({"sensors.near": {}}, "sensors.near", "exactly one of type and function"),
    ({"sensors.near.fov": 1.0}, "sensors.near.fov", "a NEIGHBOR sensor has none"),
    ({"sensors.eyes.rnge_m": 1.0}, "sensors.eyes.rnge_m", "Did you mean 'range_m'?"),
    ({"sensors.eyes.team": "bleu"}, "sensors.eyes.team", "Did you mean 'blue'?"),
    ({"sensors.eyes.position_noise_m": -1.0}, "sensors.eyes.position_noise_m", ">= 0"),
    ({"sensors.eyes.false_alarm_rate": 101}, "sensors.eyes.false_alarm_rate", "<= 100"),
    ({"sensors.eyes.delay_turns": 1.5}, "sensors.eyes.delay_turns", "whole number"),
    ({"sensors.eyes.dealy_turns": 1}, "sensors.eyes.dealy_turns", "Did you mean 'delay_turns'?"),
    ({"sensors.near.delay_turns": 1}, "sensors.near.delay_turns", "a NEIGHBOR sensor has none"),
    ({"sensors.near.at": [1, 2, 3]}, "sensors.near.at", "a NEIGHBOR sensor has none"),
    ({"sensors.eyes.at": [1]}, "sensors.eyes.at", "2"),
    ({"sensors.eyes.at": [1, 2, 3]}, "sensors.eyes.at", "sensors are on the ground. Give a node or"),
    *(
        ({"sensors.eyes": {"type": "aerial", "at": at}}, "sensors.eyes.at", "aerial sensors are in the air. Give")
        for at in (3, [1, 2])
    ),
    ({"teams.red.sensors.0": "neer"}, "teams.red.sensors.0", "Did you mean 'near'?"),
    ({"teams.red.within": None}, "teams.red.within", "near needs it"),
    ({"teams.red.near": None}, "teams.red.near", "within needs it"),
    ({"teams.red.near": [1, 2, 3]}, "teams.red.near", "length 2"),
    ({"teams.red.near": {"lat": 60.2, "lno": 25.0}}, "teams.red.near.lno", "Did you mean 'lon'?"),
    ({"teams.red.from": {"team": "blue", "at_least": 5}}, "teams.red.from.team", "before this team"),
    ({"teams.blue.from": [{"team": "rd", "at_least": 5}]}, "teams.blue.from.0.team", "Did you mean 'red'?"),
    ({"teams.red.type": "aerial"}, "teams.red.speed", "aerial agent needs it"),
    ({"teams.red.type": "AERIAL"}, "teams.red.speed", "aerial agent needs it"),
    ({"teams.red.type": "arial"}, "teams.red.type", "unknown agent type 'arial'. Did you mean 'aerial'?"),
    ({"teams.blue.agents.0.type": "boat"}, "teams.blue.agents.0.type", "Use one of basic, aerial."),
    ({"teams.red.altitude": 5}, "teams.red.altitude", "aerial"),
    ({"teams.blue.agents.0.type": "aerial"}, "teams.blue.agents.0.speed", "aerial agent needs it"),
    ({"teams.blue.agents.1.name": "anna"}, "teams.blue.agents.1.name", "already an agent named 'anna'"),
    ({"teams.blue.agents.1.name": "red_2"}, "teams.blue.agents.1.name", "in teams.red"),
    ({"teams.blue.agents.1.nod": 3}, "teams.blue.agents.1.nod", "Did you mean 'node'?"),
    ({"conflicts.resolve.by_priority.1": "bleu"}, "conflicts.resolve.by_priority.1", "Did you mean 'blue'?"),
    ({"conflicts.resolve.by_priority": ["red"]}, "conflicts.resolve.by_priority", "leaves out team 'blue'. Put it"),
    ({"conflicts.among": "teams"}, "conflicts.among", "Did you mean 'team'?"),
    ({"conflicts.capacity": -1}, "conflicts.capacity", ">= 0"),
    ({"settings": {"legal": "edge"}}, "settings.legal", "Did you mean 'edges'?"),
    ({"settings": {"turn_seconds": float("inf")}}, "settings.turn_seconds", "must be finite"),
    ({"settings": {"default_action": "go"}}, "settings.default_action", "use one of stay, a whole number"),
    ({"settings": {"order": [["red"]]}}, "settings.order", "leaves out team 'blue'. Put it"),
    (
        {"rules.0": {"rule": "hold", "with": {"nodes": 3, "turns": 2, "teams": ["blue", "rad"]}}},
        "rules.0.with.teams",
        "'red'?",
    ),
    ({"rules.0": {"rule": "respawn", "with": {"teams": "rad"}}}, "rules.0.with.teams", "'red'?"),
    ({"rules.0.with.taggers": "rad"}, "rules.0.with.taggers", "Did you mean 'red'?"),
    ({"rules.0.with.tagged": 3}, "rules.0.with.tagged", "unknown team 3. Teams are: red, blue."),
    ({"rules.0": {"rule": "reach", "with": {"team": {"rad": 3}}}}, "rules.0.with.team", "Did you mean 'red'?"),
    ({"rules.0": {"rule": "reach", "with": {"team": "red", "winner": "rad"}}}, "rules.0.with.winner", "'red'?"),
    ({"rules.0": {"rule": "gamms.rules:reach", "with": {"team": "x"}}}, "rules.0.with.team", "Teams are: red, blue"),
    (
        {"facts": {"land": {"function": "gamms.rules.territory:halves", "with": {"teams": ["red", "blu"]}}}},
        "facts.land.with.teams",
        "Did you mean 'blue'?",
    ),
    ({"rules.0": {"tag": {"taggers": "red"}}}, "rules.0.tag", "Write {rule: tag, with: {…}}."),
    ({"rules.0": {"rule": "tag", "taggers": "red"}}, "rules.0.taggers", "Parameters belong into with: {taggers: …}."),
    ({"map.buildings": True}, "map.buildings", "It belongs into helsinki or file or place, such as file: {path: …, "),
    ({"map.path": "a.osm"}, "map.path", "It belongs into file, such as file: {path: …}."),
    ({"map.osm": "a.osm"}, "map.osm", "Scenario files call it file."),
    ({"grid": {}}, "grid", "It belongs into map, such as map: {grid: …}."),
    ({"speed_unit": "metres"}, "speed_unit", "It belongs into settings, such as settings: {speed_unit: …}."),
    ({"order": []}, "order", "It belongs into settings"),
    ({"teams.red.size": 3}, "teams.red.size", "Scenario files call it count."),
    ({"turns": 5}, "turns", "Scenario files call it max_turns."),
    ({"teams.red.node": 3}, "teams.red.node", "It belongs into agents, such as agents: [{name: …, node: …}]."),
    ({"teams.red.start_node_id": 3}, "teams.red.start_node_id", "Scenario files call it node. It belongs into agents,"),
    ({"teams.red.range_m": 3}, "teams.red.range_m", "such as sensors: {NAME: {range_m: …}}."),
    ({"map": "helsinki"}, "map", "Its keys are grid, helsinki, file, place, generator, closed. Write {helsinki: …}."),
    ({"sensors": {"eyes": "agent_range"}}, "sensors.eyes", "Write {type: agent_range}."),
    ({"sensors": [{"type": "agent_range"}]}, "sensors", "Give each a name: {NAME: …}."),
    ({"rules": {"tag": {}}}, "rules", "Begin each item with '- '."),
    ({"rules.0.wiht": {}}, "rules.0.wiht", "Did you mean 'with'?"),
    ({"rules.0": {"rule": "capture_flag", "with": {"flags": {"bleu": 3}}}}, "rules.0.with.flags", "'blue'"),
    ({"seed": "x"}, "seed", "it must be a whole number or nothing, not a text."),
    ({"seed": 1 << 64}, "seed", "64 bits"),
    ({"max_turns": 1.5}, "max_turns", "it must be a whole number"),
    ({"max_turns": 1 << 64}, "max_turns", "64 bits"),
    ({"teams": {}}, "teams", "length >= 1"),
    ({"sensors": {"eyes": {"a - at `$": 1}}}, "sensors.eyes.a - at `$", "unknown key, with the value 1"),
    ({"a - at `$": 1}, "a - at `$", "unknown key"),
    ({"settings": {"legal": "x` - at `$"}}, "settings.legal", "use one of edges, any"),
    ({"facts": {1: 2}}, "facts.1", "cannot be 1: it must be a text, not a whole number."),
    ({"teams": {5: {"count": 1}}}, "teams.5", "cannot be 5: it must be a text, not a whole number."),
    ({"teams.red": {5: 1}}, "teams.red.5", "unknown key"),
    ({"facts": {"a": 1j}}, "facts.a", "not a plain value"),
    ({"facts": {"a": float("nan")}}, "facts.a", "NaN"),
]


@pytest.mark.parametrize(("changes", "path", "hint"), WRONG, ids=[str(changes) for changes, _, _ in WRONG])
def test_an_error_names_the_place_and_the_way_out(made, changes, path, hint):
    with pytest.raises(ScenarioError) as raised:
        made(changes)
    assert raised.value.path == path
    assert str(raised.value).startswith(f"{raised.value.place}: ")
    assert hint in str(raised.value)
    assert isinstance(raised.value, (GammsError, ValueError))


def test_a_misspelt_section_that_is_missing_is_named_rather_than_a_key_of_its_items(little):
    sections = {key: value for key, value in little.items() if key not in ("rules", "sensors")}
    for key in ("rule", "sensor"):
        with pytest.raises(ScenarioError, match=f"Did you mean '{key}s'"):
            scenario.Scenario(**sections, **{key: []})


@pytest.mark.parametrize(
    ("changes", "place"),
    [
        ({"teams.red.cuont": 3}, "teams.red.cuont"),
        ({"rules.1": {"rule": "tag", "wiht": {}}}, "item 2 of rules (tag), wiht"),
        ({"teams.blue.agents.1.nod": 3}, "item 2 of teams.blue.agents (bert), nod"),
        ({"teams.blue.from": [{"team": "red"}]}, "item 1 of teams.blue.from, at_least"),
        ({"conflicts": {"capacity": {"5": "x"}}}, "conflicts.capacity.5"),
    ],
    ids=str,
)
def test_a_message_counts_the_items_of_lists_from_one(made, changes, place):
    with pytest.raises(ScenarioError) as raised:
        made(changes)
    assert raised.value.place == place
    assert str(raised.value).startswith(f"{place}: ")


def test_the_teams_that_a_new_rule_names_are_checked_by_its_annotations(made, monkeypatch):
    def escort(convoy: Team, guards: Annotated[list[str], TEAMS], watched: Annotated[dict[str, int], OWNERS]):
        pass

    monkeypatch.setattr(rules, "escort", escort, raising=False)
    monkeypatch.setattr(rules, "__all__", [*rules.__all__, "escort"])
    right = {"convoy": "red", "guards": ["blue"], "watched": {"gold": 3}}
    made({"rules.0": {"rule": "escort", "with": right}})
    for wrong, path in (
        ({"convoy": "rad"}, "convoy"),
        ({"guards": ["red", "rad"]}, "guards"),
        ({"watched": {"rad": 3}}, "watched"),
    ):
        with pytest.raises(
            ScenarioError, match=rf"^item 1 of rules \(escort\), with\.{path}: unknown team 'rad'. Did you mean 'red'?"
        ):
            made({"rules.0": {"rule": "escort", "with": right | wrong}})


def test_an_error_of_a_file_begins_with_its_name(folder):
    file = folder / "little.yaml"
    file.write_text(file.read_text().replace("count:", "cuont:"))
    with pytest.raises(ScenarioError, match=r"little\.yaml: teams\.red\.cuont: .* Did you mean 'count'\?") as raised:
        scenario.load(file)
    assert raised.value.file == str(file)


FOUND_BY_CHECK = [
    ({"teams.red.strategy": "plyers:wander"}, "teams.red.strategy", "Did you mean 'players'?"),
    ({"teams.red.strategy": "plyers.py:wander"}, "teams.red.strategy", "Did you mean 'players.py'?"),
    ({"teams.red.strategy": "players:wandr"}, "teams.red.strategy", "Did you mean 'wander'?"),
    ({"teams.red.strategy": "referee"}, "teams.red.strategy", "'map_strategy'"),
    ({"teams.red.strategy": "wandr"}, "teams.red.strategy", "Did you mean 'players:wander'?"),
    ({"teams.red.strategy": "zigzag"}, "teams.red.strategy", "Write module:function, such as strategies:zigzag."),
    ({"teams.red.strategy": "chase"}, "teams.red.strategy", "Did you mean 'gamms.strategies:chase'?"),
    ({"teams.red.strategy": "gamms.strategies:chse"}, "teams.red.strategy", "Did you mean 'chase'?"),
    ({"teams.blue.strategy.with": {"node": []}}, "teams.blue.strategy.with.node", "Did you mean 'nodes'?"),
    ({"rules.0.rule": "tagg"}, "rules.0", "Did you mean 'tag'?"),
    ({"rules.0.with": {"taggers": "red", "hop": 1}}, "rules.0.with.hop", "Did you mean 'hops'?"),
    ({"rules.0": "time_limit"}, "rules.0.with.turns", "missing"),
    ({"conflicts.resolve": "at_randm"}, "conflicts.resolve", "Did you mean 'at_random'?"),
    ({"conflicts.resolve": "by_priority"}, "conflicts.resolve", "such as {by_priority: [red, blue]}."),
    ({"facts": {"land": {"function": "nowhere:x"}}}, "facts.land", "no module 'nowhere'"),
    ({"map": {"file": "town.osm"}}, "map.file", "no file 'town.osm'"),
    ({"teams.blue.agents.0.node": 48}, "teams.blue.agents.0.node", "Unknown node 48. There are, among others: 0, 1"),
    ({"teams.blue.agents.0.node": "Main"}, "teams.blue.agents.0.node", "also be the id of a node, [x, y] or {lat"),
    (
        {"teams.red.count": 99},
        "teams.red",
        "only 11 of 99 agents could be placed, within 30 of node 0. Change count or",
    ),
    (
        {"teams.red.apart": 31},
        "teams.red",
        "of 3 agents could be placed, within 30 of node 0, at least 31 apart, with the seed",
    ),
    ({"teams.blue.count": 2, "teams.blue.from": {"team": "red", "at_least": 200}}, "teams.blue", "only 0 of 2"),
]


FOUND_BY_BUILDING = [
    ({"teams.blue.strategy.with": {"nodes": [99]}}, "teams.blue.strategy", "Unknown node 99. There are"),
    ({"rules.0": "players:wander"}, "rules.0", "a strategy"),
    ({"rules.1": "referee:explode"}, "rules.1", "RuntimeError: boom"),
    ({"conflicts.capacity": "one"}, "conflicts.capacity", "Unknown node attribute 'one'. There are none. The capacity"),
    ({"conflicts.capacity": {"99": 1}}, "conflicts.capacity.99", "Unknown node 99. There are"),
    ({"conflicts.capacity": {"a": 1}}, "conflicts.capacity.a", "is not an id. Give ids and numbers, such as {3: 1}."),
    ({"conflicts.edge_capacity": "one"}, "conflicts.edge_capacity", "or a mapping from edge ids to numbers."),
    ({"conflicts.edge_capacity": {"999": 1}}, "conflicts.edge_capacity.999", "Unknown edge 999. There are"),
    ({"settings": {"default_action": 99}}, "settings.default_action", "Unknown node 99. There are"),
    ({"settings": {"decide": "arrival"}}, "settings", "set ctx.game.speed_unit = 'metres'"),
    ({"settings": {"speed_unit": "metres", "weight": "lenght"}}, "settings.weight", "Did you mean 'length'?"),
    (
        {"channels": {"radio": {"hops": 1, "jammers": [{"at": 99, "radius_m": 1}]}}},
        "channels.radio.jammers.0.at",
        "Unknown node 99. There are",
    ),
]
MISSING = FOUND_BY_CHECK + FOUND_BY_BUILDING


@pytest.mark.parametrize(("changes", "path", "hint"), MISSING, ids=[str(changes) for changes, _, _ in MISSING])
def test_missing_things_are_reported_when_the_game_is_built(made, changes, path, hint):
    little = made(changes)
    with pytest.raises(ScenarioError) as raised:
        little.build()
    assert raised.value.path == path
    assert hint in str(raised.value)


@pytest.mark.parametrize("case", FOUND_BY_CHECK, ids=[str(changes) for changes, _, _ in FOUND_BY_CHECK])
def test_most_of_it_is_found_without_running_any_code(made, folder, case):
    changes, path, _ = case
    for file in folder.glob("*.py"):
        file.write_text(file.read_text() + "\nraise RuntimeError('this was run')\n")
    with pytest.raises(ScenarioError) as raised:
        made(changes).check()
    assert raised.value.path == path


GAME = {
    "max_turns": 2,
    "map": {"grid": {"rows": 4, "columns": 5}},
    "sensors": {
        "eyes": {"type": "AGENT_ARC", "range_m": 30, "fov": 1.0, "team": "blue", "detection": [[0, 1], [9, 0]]}
    },
    "teams": {
        "red": {"count": 2, "near": 0, "within": 30, "sensors": ["eyes"], "strategy": "gamms.strategies:chase"},
        "blue": {"agents": [{"name": "anna", "node": [20, 10]}], "from": {"team": "red", "at_least": 1}, "speed": 2},
        "air": {"count": 1, "type": "aerial", "speed": 5, "altitude": 10},
    },
    "rules": [
        {"rule": "tag", "with": {"taggers": "red", "tagged": "blue", "hops": 1, "then": "eliminate", "score": 2}},
        {"rule": "reach", "with": {"team": "blue", "nodes": [19]}, "phase": "after", "name": "home"},
        {"rule": "capture_flag", "with": {"flags": {"red": 1, "blue": 2}}},
    ],
    "conflicts": {"capacity": {3: 1}, "edge_capacity": 2, "resolve": {"by_priority": ["red", "blue"]}},
    "channels": {"radio": {"range_m": 30, "relay": ["anna"], "loss": 0.1, "jammers": [{"at": 3, "radius_m": 2}]}},
    "settings": {"speed_unit": "metres", "weight": "length", "order": [["red"], ["blue", "air"]], "turn_seconds": 1.0},
    "facts": {"goal": {"node_at": [10, 10]}},
}


def places_in(part, keys=()):
    """Yield the keys that lead to each value."""
    for key, one in part.items() if isinstance(part, dict) else enumerate(part) if isinstance(part, list) else ():
        yield (*keys, key)
        yield from places_in(one, (*keys, key))


@given(
    st.sampled_from([*places_in(GAME)]),
    st.none() | st.booleans() | st.integers() | st.floats() | st.sampled_from(["", "x", "red", [], ["x", 1], {"x": 1}]),
)
def test_a_value_anywhere_is_played_or_refused_with_its_file_and_place(keys, value):
    changed = copy.deepcopy(GAME)
    here = changed
    for key in keys[:-1]:
        here = here[key]
    here[keys[-1]] = value
    refused = None
    try:
        with gamms.limits.allowing("100M"):
            scenario.Scenario(file="game.yaml", **changed).play(seed=1)
    except ScenarioError as error:
        refused = error
    assert refused is None or (refused.path and str(refused).startswith("game.yaml: "))


def test_a_scenario_describes_its_values(made, little):
    one = made()
    assert one.to_dict() == little
    assert scenario.Scenario(**one.to_dict()) == one
    assert pickle.loads(pickle.dumps(one)) == one
    assert json.loads(json.dumps(one.to_dict())) == little
    assert repr(one) == "Scenario('little', red: 3, blue: 2)"


def test_given_values_are_copied(made, little):
    one = made()
    one.to_dict()["teams"]["red"]["count"] = 99
    little["teams"]["red"]["count"] = 99
    assert one.spec.teams["red"].count == 3


def test_values_of_python_are_taken_as_a_file_would_say_them(made):
    one = made({"sensors.eyes.type": SensorType.AGENT_RANGE, "teams.red.near": (0.0, 0.0)})
    assert one.to_dict()["sensors"]["eyes"]["type"] == "AGENT_RANGE"
    assert one.to_dict()["teams"]["red"]["near"] == [0.0, 0.0]


def test_values_are_replaced_by_dotted_paths(made):
    one = made()
    new = one.replace(
        **{
            "max_turns": 5,
            "teams.red.count": 2,
            "teams.blue.agents.bert.node": 3,
            "teams.blue.agents.0.node": 4,
            "rules.tag.with.hops": 2,
            "settings.legal": "any",
        }
    )
    assert (new.spec.max_turns, new.spec.teams["red"].count, new.spec.settings.legal) == (5, 2, "any")
    assert [agent.node for agent in new.spec.teams["blue"].agents] == [4, 3]
    assert new.spec.rules[0].with_["hops"] == 2
    assert one == made()


@pytest.mark.parametrize(
    ("path", "hint"),
    [
        ("teams.rde.count", "Did you mean 'red'?"),
        ("teams.red.cuont", "Did you mean 'count'?"),
        ("max_trns", "Did you mean 'max_turns'?"),
        ("teams.blue.agents.brt.node", "Did you mean 'bert'?"),
        ("rules.7", "no '7' to change"),
        ("teams.green.count", "no 'green' to change. There are: 'red', 'blue'"),
        ("max_turns.x.y", "no 'x' to change"),
        ("sttings.legal", "Did you mean 'settings'?"),
    ],
)
def test_a_path_that_leads_nowhere_is_an_error(made, path, hint):
    with pytest.raises(ScenarioError, match=r"Did you mean|to change") as raised:
        made().replace(**{path: 1})
    assert hint in str(raised.value)


def test_the_schema_is_one_that_editors_take():
    schema = scenario.schema()
    assert json.loads(json.dumps(schema)) == schema
    assert schema["$defs"]["Team"]["additionalProperties"] is False
    assert "from" in schema["$defs"]["Team"]["properties"]


def test_old_names_of_keys_mean_the_current_ones(made):
    old = made({"map": {"grid": {"width": 8, "height": 6}}, "teams.blue.agents.0.sensors": {"far": EYES}})
    new = made({"map": {"grid": {"rows": 6, "columns": 8}}, "teams.blue.agents.0.sensors": {"far": FAR}})
    assert old.spec == new.spec
    assert old.replace(**{"map.grid.width": 9, "sensors.eyes.sensor_range": 20}) == old.replace(
        **{"map.grid.columns": 9, "sensors.eyes.range_m": 20}
    )
    properties = scenario.schema()["$defs"]
    assert properties["Grid"]["required"] == ["rows", "columns"]
    assert "sensor_range" not in properties["Sensor"]["properties"]


def test_a_key_of_the_data_that_no_code_names_is_warned_about(made, folder):
    (folder / "referee.py").write_text((folder / "referee.py").read_text() + "\nPRICE = 'price'\n")
    odd = made({}, data={"price": 1, "pirce": 2})
    assert odd.warnings() == ["data.pirce: nothing in the code of this game names 'pirce'."]
    assert made({}, data={"price": 1}).warnings() == []


def test_the_memory_of_a_shipped_rule_counts_as_named(made):
    rules = [{"rule": "capture_flag", "with": {"flags": {"red": 0, "blue": 5}}}]
    assert made({}, rules=rules, data={"flags": {}}).warnings() == []
    rules[0]["with"]["key"] = "flags_of_mine"
    assert made({}, rules=rules, data={"flags_of_mine": {}}).warnings() == []
    assert made({}, rules=[], data={"flags_of_mine": {}}).warnings() != []


def test_scalars_of_numpy_are_the_numbers_that_a_file_could_hold(made):
    given = made({"max_turns": np.int64(7), "seed": np.array(3)}).to_dict()
    assert [(type(given[key]), given[key]) for key in ("max_turns", "seed")] == [(int, 7), (int, 3)]
    with pytest.raises(ScenarioError, match=r"max_turns: array\(\[7\]\) is not a plain value"):
        made({"max_turns": np.array([7])})


def decide(state):
    state["action"] = state["curr_pos"]


NAMES = {
    "a function of a module": (decide, f"Write its name, '{__name__}:decide', with the folder of its file as folder=."),
    "a function of a function": (lambda state: None, "Move it to a file, such as strategies.py, and write"),
    "a strategy of gamms": (gamms.strategies.random_walk, "Write its name, such as 'gamms.strategies:chase'"),
    "a rule": (gamms.rules.last_team(), "or 'tag' for a rule."),
    "a module": (pytest, "Write its name, 'pytest:decide', with the folder"),
}


@pytest.mark.parametrize("kind", NAMES)
def test_a_function_in_a_scenario_is_refused_and_the_error_says_how_to_name_it(made, kind):
    value, way_out = NAMES[kind]
    with pytest.raises(ScenarioError) as caught:
        made({"rules": [value]})
    assert way_out in str(caught.value)
