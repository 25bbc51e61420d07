"""What agents do besides moving: declared, checked, handed to rules before moves, recorded, in tables."""

import io

import pytest

import gamms
from gamms.errors import BadType, BadValue, Duplicate, UnknownName


@pytest.fixture
def road():
    """Return a road of ten nodes with ann of red on 0 and bob of blue on 9, each with a list of actions."""
    ctx = gamms.create_context(seed=3, logger_config={"level": "ERROR"})
    ctx.graph.attach_networkx_graph(gamms.graph.grid(1, 10))
    ctx.plans, ctx.seen = {"ann": [], "bob": []}, []

    def strategy(state):
        ctx.seen.append((state["name"], state["turn"], state["blocked"]))
        plan = ctx.plans[state["name"]]
        state["action"] = plan[state["turn"]] if state["turn"] < len(plan) else state["curr_pos"]

    ctx.agent.create_agent("ann", start_node_id=0, team="red", strategy=strategy)
    ctx.agent.create_agent("bob", start_node_id=9, team="blue", strategy=strategy)
    ctx.game.deeds = {"attack": {"target": "agent", "force": "number?"}, "wait": None}
    yield ctx
    ctx.terminate()


def attack(target, **more):
    return {"do": {"attack": {"target": target, **more}}}


def test_a_deed_may_place_move_and_remove_a_fixed_sensor(road):
    road.game.deeds = {
        "place": {"where": "node"},
        "shift": {"sensor": "sensor", "where": "node"},
        "remove": {"sensor": "sensor"},
    }
    road.plans["ann"] = [
        {"do": {"place": 5}},
        {"do": {"shift": {"sensor": "tower", "where": 7}}},
        {"do": {"shift": {"sensor": "towr", "where": 8}}},
        {"do": {"remove": "tower"}},
        {"do": {"remove": "tower"}},
    ]
    seen, stream = [], io.BytesIO()

    @road.game.add(phase="deeds")
    def build(ctx):
        for deed in ctx.game.performed():
            if deed.kind == "place":
                ctx.sensor.create_sensor("tower", "agent_range", sensor_range=25, at=deed.values["where"])
            elif deed.kind == "shift":
                ctx.sensor.get_sensor(deed.values["sensor"]).at = deed.values["where"]
            else:
                ctx.sensor.delete_sensor(deed.values["sensor"])

    def places(ctx):
        return [sensor.at for sensor in ctx.sensor.sensors.values()]

    road.game.add(lambda ctx: seen.append(places(ctx)))
    road.record.start(stream)
    result = road.game.run(5)
    road.record.stop()
    assert seen == [[5], [7], [7], [], []]
    assert "Unknown sensor as 'sensor' of the deed 'shift': 'towr'. Did you mean" in result.errors[0]["message"]
    assert "Unknown sensor as 'sensor' of the deed 'remove': 'tower'." in result.errors[1]["message"]
    with gamms.create_context(logger_config={"level": "ERROR"}) as ctx:
        records = ctx.record.replay(io.BytesIO(stream.getvalue()))
        assert [places(ctx) for record in records if record["opCode"] == 1] == seen
    recording = gamms.recorder.open(io.BytesIO(stream.getvalue()))
    for turn in range(1, 6):
        with recording.resume(turn) as ctx:
            assert places(ctx) == seen[turn - 1]


@pytest.mark.parametrize(
    ("do", "message"),
    [
        ({"atack": "bob"}, "Unknown deed 'atack'. Did you mean 'attack'?"),
        ({"attack": "bobby"}, "Unknown agent as 'target' of the deed 'attack': 'bobby'. Did you mean 'bob'?"),
        ({"attack": {}}, "There is no 'target' of the deed 'attack'; it needs 'target', 'force'."),
        (
            {"attack": {"target": "bob", "forse": 1}},
            "Unknown field of the deed 'attack': 'forse'. Did you mean 'force'?",
        ),
        ({"attack": {"target": "bob", "force": "much"}}, "'force' of the deed 'attack' must be a number"),
        ({"wait": 5}, "The deed 'wait' needs no field: give None, not 5."),
        ("attack", "The deeds of an agent must be a dict from deeds to their fields, not 'attack'."),
    ],
)
def test_an_action_with_an_impossible_deed_is_not_done_at_all(road, do, message):
    road.plans["ann"] = [{"node_id": 1, "do": {"wait": None} | do if isinstance(do, dict) else do}]
    result = road.game.run(2)
    assert message in result.errors[0]["message"]
    assert (result.agents["ann"]["node"], result.agents["ann"]["illegal"], result.deeds) == (0, 1, [])
    assert message in road.seen[2][2]


def test_a_game_without_deeds_says_so(road):
    road.game.deeds = {}
    road.plans["ann"] = [attack("bob")]
    assert "as ctx.game.deeds declares none" in road.game.run(1).errors[0]["message"]


@pytest.mark.parametrize(
    ("deeds", "error", "message"),
    [
        ({"two words": {}}, BadValue, "A deed is called by a name of letters"),
        ({5: {}}, BadValue, "A deed is called by a name of letters"),
        ({"a": {5: "agent"}}, BadValue, r"A field of ctx.game.deeds\['a'\] is called by a name of letters"),
        ({"a": {"to-do": "agent"}}, BadValue, r"A field of ctx.game.deeds\['a'\] is called by a name of letters"),
        ({"a": {"agent": "agent"}}, BadValue, "cannot be called 'agent', which all deeds have"),
        ({"a": {"to": "agnt"}}, BadValue, r"\['to'\] cannot be 'agnt'. Did you mean 'agent'"),
        ({"a": {"to": []}}, BadType, "must be a kind of field"),
        ({"a": {"to": [object()]}}, BadType, "must be a kind of field"),
        ({"a": 5}, BadType, r"ctx.game.deeds\['a'\] must be a dict"),
        (["a"], BadType, "ctx.game.deeds must be a dict"),
    ],
)
def test_a_declaration_that_means_nothing_is_refused_at_once(road, deeds, error, message):
    before = road.game.deeds
    with pytest.raises(error, match=message):
        road.game.deeds = deeds
    assert road.game.deeds == before


@pytest.mark.parametrize(
    ("kind", "good", "bad"),
    [
        ("agent", "bob", "cat"),
        ("team", "blue", "green"),
        ("node", 4, 40),
        ("edge", 0, 400),
        ("integer", 3, 3.5),
        ("number", 3.5, float("nan")),
        ("boolean", True, "yes"),
        ("text", "hello", 5),
        ("value", {"a": [1, (2, 3)]}, object()),
        (["north", 3], 3, "south"),
        ("node?", None, "x"),
    ],
)
def test_fields_are_checked_by_their_kinds(road, kind, good, bad):
    road.game.deeds = {"do_it": {"what": kind}}
    road.plans = {"ann": [{"do": {"do_it": {"what": good}}}], "bob": [{"do": {"do_it": {"what": bad}}}]}
    result = road.game.run(1)
    assert [deed["agent"] for deed in result.deeds] == ["ann"]
    assert result.deeds[0].get("what") == good
    assert [error["agent"] for error in result.errors] == ["bob"]


@pytest.mark.parametrize(("given", "is_done"), [(None, True), (True, True), ({}, True), (False, False), (0, False)])
def test_a_deed_without_fields_is_wanted_by_none_true_or_an_empty_dict(road, given, is_done):
    road.plans["ann"] = [{"do": {"wait": given}}]
    result = road.game.run(1)
    assert (len(result.deeds), len(result.errors)) == (is_done, not is_done)


def test_a_check_refuses_moves_and_deeds_before_they_are_done(road):
    road.plans = {"ann": [{"node_id": 1, "do": {"attack": "bob", "wait": None}}], "bob": [8]}

    def tired(ctx):
        """Do nothing after the moves."""

    def check(ctx):
        ctx.game.refuse("ann", "its weapon is cold", deed="attack")
        ctx.game.refuse(ctx.agent.get_agent("bob"), "it is tired")
        ctx.game.refuse("bob", "it is old")
        ctx.game.refuse("bob", "it has none", deed="attack")  # which it did not want to do

    tired.check = check
    road.game.add(tired)
    result = road.game.run(2)
    assert [deed["deed"] for deed in result.deeds] == ["wait"]
    assert {name: one["node"] for name, one in result.agents.items()} == {"ann": 1, "bob": 9}
    assert result.errors == [{"turn": 0, "agent": "ann", "kind": "illegal", "message": "attack: its weapon is cold"}]
    assert road.seen[2:] == [("ann", 1, "attack: its weapon is cold"), ("bob", 1, "it is old; it is tired")]
    assert (result.agents["bob"]["blocked"], result.agents["ann"]["illegal"]) == (1, 1)
    with pytest.raises(BadValue, match="is for the check of a rule"):
        road.game.refuse("bob", "why")
    with pytest.raises(UnknownName, match="Unknown deed 'atack'"):
        road.game.performed("atack")


@pytest.mark.parametrize("turns", [0, 1])
def test_a_check_that_is_set_after_the_rule_was_added_counts(road, turns):
    road.plans = {"ann": [], "bob": [8, 7, 6]}
    rule = road.game.add(lambda ctx: None)
    road.game.run(turns)
    rule.check = lambda ctx: ctx.game.refuse("bob", "it is tired")
    road.game.run(2)
    assert road.agent.get_agent("bob").current_node_id == 9 - turns
    road.game.reset()
    rule.check = None
    road.game.run(2)
    assert road.agent.get_agent("bob").current_node_id == 7


def test_a_check_that_is_set_after_the_rule_was_added_counts_in_a_batch(road):
    rule = road.game.add(lambda ctx: None)
    rule.check = lambda ctx: ctx.game.refuse("bob", "it is tired")
    for agent in road.game.agents:
        agent.strategy = gamms.strategies.random_walk
    with road.game.batch(3) as games:
        games.step()
        assert {games.result(number).agents["bob"]["node"] for number in range(3)} == {9}


def test_attributes_that_are_set_before_the_game_begins_count(road):
    called = []
    first = road.game.add(lambda ctx: called.append("first"))
    second = road.game.add(lambda ctx: called.append("second"))
    first.rank = 1
    second.prepare = lambda ctx: called.append("prepared")
    second.drawer = lambda ctx, data: None
    second.drawer.artist = "mark"
    road.game.run(1)
    assert called == ["prepared", "second", "first"]
    road.game.reset()
    road.game.run(1)
    assert called == ["prepared", *["second", "first"] * 2]
    assert road.visual.artists.get("mark") is not None


def test_a_key_that_is_set_after_adding_must_be_unique_too(road):
    rules = [road.game.add(lambda ctx: None), road.game.add(lambda ctx: None)]
    for rule in rules:
        rule.key = "same"
    with pytest.raises(Duplicate, match="already a rule with a key named 'same'"):
        road.game.step()


def test_a_strategy_knows_what_it_may_do(road):
    found = []
    road.agent.get_agent("ann").register_strategy(lambda state: found.append(dict(state)) or state.update(action=0))
    road.game.run(1)
    assert found[0]["deeds"] == {"attack": {"target": "agent", "force": "number?"}, "wait": {}}
    road.game.deeds = {}
    road.game.run(1)
    assert "deeds" not in found[1]


def test_the_error_of_a_deed_at_an_unknown_node_does_not_say_that_there_are_none(road):
    road.game.deeds = {"scan": {"node": "node"}}
    road.plans["ann"] = [{"node_id": 1, "do": {"scan": 99}}]
    assert road.game.run(1).errors[0]["message"].endswith("Unknown node as 'node' of the deed 'scan': 99.")
