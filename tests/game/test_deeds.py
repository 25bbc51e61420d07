"""What agents do besides moving: declared, checked, handed to rules before moves, recorded, in tables."""

import io

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import gamms
from gamms.errors import BadType, BadValue, Duplicate, UnknownName
from gamms.rules import cooldown, tag, time_limit


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


def test_a_strategy_knows_its_allowed_deeds(road):
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


# -- deeds that last ----------------------------------------------------------------------------------------------

DEFUSE = {"fields": {"bomb": "node"}, "turns": 4, "interrupted_by": ["move", "tag"], "blocks_moving": True}


def lasts(road, **more):
    road.game.deeds = {"defuse": {**DEFUSE, **more}, "wait": None}


def events_of(result, *kinds):
    return [
        (event["kind"], event["time"], *(event[key] for key in ("by", "left") if key in event))
        for event in result.events
        if event["kind"] in kinds
    ]


def test_a_deed_that_lasts_is_done_after_its_turns_by_an_agent_that_stays(road):
    lasts(road)
    road.plans["ann"] = [{"node_id": 1, "do": {"defuse": 3}}, 1, 1, 1, 1]
    seen, done = [], []
    ann = road.agent.get_agent("ann").strategy
    road.agent.get_agent("ann").register_strategy(lambda state: (seen.append(state["doing"]), ann(state))[1])
    road.game.add(lambda ctx: done.extend(ctx.game.performed("defuse")))
    result = road.game.run(6)
    begun = {"kind": "defuse", "since": 0.0, "values": {"bomb": 3}}
    assert seen == [None, *({**begun, "left": left} for left in (3.0, 2.0, 1.0)), None, None]
    assert result.deeds == [
        {"turn": 4, "agent": "ann", "deed": "defuse", "at": 0, "bomb": 3, "since": 0.0, "time": 4.0}
    ]
    assert events_of(result, "begun", "done", "interrupted") == [("begun", 0.0), ("done", 4.0)]
    assert [(deed.agent, deed.values["bomb"], deed.values["time"]) for deed in done] == [("ann", 3, 4.0)]
    assert road.seen[2][2] == "it begins 'defuse'"
    assert road.seen[4][2] == "it is doing 'defuse' until 4"
    assert result.agents["ann"]["node"] == 1


@pytest.mark.parametrize("rank", [-1, 0, 1])
@pytest.mark.parametrize("goes", ["out", "away"])
def test_a_deed_is_interrupted_by_the_move_of_an_agent_that_a_rule_then_puts_out_of_play(road, rank, goes):
    lasts(road, turns=5, blocks_moving=False, interrupted_by=["move"], on_interrupt="resume")
    road.plans["ann"] = [{"node_id": 0, "do": {"defuse": 3}}, 1]

    def put_out(ctx):
        if ctx.game.turn == 2:
            (ctx.game.eliminate if goes == "out" else ctx.agent.delete_agent)("ann")

    put_out.rank = rank
    road.game.add(put_out)
    result = road.game.run(2)
    assert events_of(result, "begun", "interrupted") == [("begun", 0.0), ("interrupted", 1.0, "move", 4.0)]


def test_a_declaration_of_a_deed_that_lasts_is_checked(road):
    for declaration, message in (
        ({"fields": {}, "turns": 1, "seconds": 1}, "either turns or seconds"),
        ({"fields": {}, "blocks_moving": True}, "either turns or seconds"),
        ({"fields": {}, "turns": 0}, "must be more than 0"),
        ({"fields": {"since": "node"}, "turns": 1}, "which deeds that last have"),
        ({"fields": {}, "turns": 1, "on_interrupt": "stop"}, "must be 'restart' or 'resume'"),
        ({"fields": {}, "turns": 1, "interupted_by": ["tag"]}, "Did you mean 'interrupted_by'"),
        ({"fields": {}, "turns": 1, "interrupted_by": ["tag", "done"]}, "cannot have 'done', an event of the deed"),
        ({"fields": {}, "turns": 1, "interrupted_by": ["noise", "tga"]}, "Unknown event .* Did you mean 'tag'"),
        ({"fields": {}, "turns": 1, "interrupted_by": ["moved"]}, "Did you mean 'move'"),
        ({"bomb": "node", "turns": 4}, "put its fields into fields"),
    ):
        with pytest.raises((BadValue, UnknownName), match=message):
            road.game.deeds = {"defuse": declaration}
    road.game.deeds = {"wait": {"fields": None}, "mark": {"fields": "text"}}  # both are done at once
    assert not road.game.rules


@pytest.mark.parametrize("time", [None, "0.5", float("nan"), True])
def test_an_event_that_interrupts_a_deed_needs_a_time_that_is_a_number(road, time):
    lasts(road, interrupted_by=["noise"])
    road.plans["ann"] = [{"do": {"defuse": 3}}]
    road.game.add(lambda ctx: ctx.game.emit("noise", agent="ann", time=time))
    with pytest.raises((BadType, BadValue), match="time of the event 'noise' of agent 'ann' must be"):
        road.game.run(1)


def test_two_deeds_that_last_are_not_done_at_once(road):
    road.game.deeds = {"defuse": {**DEFUSE, "turns": 2}, "rest": {"fields": {}, "turns": 2}, "wait": None}
    road.plans["ann"] = [{"do": {"defuse": 3, "rest": None}}, {"do": {"defuse": 4, "wait": None}}]
    result = road.game.run(3)
    assert [error["message"] for error in result.errors] == [
        "rest: it begins 'defuse' in the same turn",
        "defuse: it is doing 'defuse'",
    ]
    assert [(deed["deed"], deed["turn"]) for deed in result.deeds] == [("wait", 2), ("defuse", 2)]


@given(st.integers(1, 9), st.floats(1.5, 40.0), st.floats(0.1, 60.0), st.floats(0.5, 9.0), st.booleans())
@settings(max_examples=40, deadline=None, derandomize=True)
def test_a_deed_is_interrupted_when_the_tagger_arrives(nodes, speed, seconds, turn_seconds, resumes):
    how = {"seconds": seconds, "turns": None, "on_interrupt": "resume" if resumes else "restart"}
    game = {
        "deeds": {"defuse": {**DEFUSE, **how}},
        "speed_unit": "metres_per_second",
        "turn_seconds": turn_seconds,
    }
    with gamms.create_context(seed=3, logger_config={"level": "ERROR"}, game=game) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(1, 10))
        work = lambda state: state.update(action={"do": {"defuse": 5}})
        ctx.agent.create_agent("ann", start_node_id=0, team="red", strategy=work)
        goto = gamms.strategies.goto(ctx, 0)
        ctx.agent.create_agent("bob", start_node_id=nodes, team="blue", strategy=goto, speed=speed)
        ctx.game.add(tag("blue", "red", then=lambda ctx, bob, ann: ctx.game.eliminate(bob)))
        meet = 10.0 * nodes / speed / turn_seconds
        full = seconds / turn_seconds
        found = events_of(ctx.game.run(int(meet + full) + 3), "begun", "done", "interrupted")
    expected = []
    begun, left = 0, full
    while begun <= meet + full + 1:
        expected.append(("begun", float(begun)))
        if begun <= meet < begun + left:
            left -= meet - begun
            expected.append(("interrupted", meet, "tag", left))
            left = left if resumes else full
            begun = int(meet) + 1
        else:
            expected.append(("done", begun + left))
            begun, left = int(-(-(begun + left) // 1)), full
    for one, other in zip(found, expected, strict=False):
        assert (one[0], one[2:3]) == (other[0], other[2:3])
        assert [*one[1:2], *one[3:]] == pytest.approx([*other[1:2], *other[3:]], abs=1e-9)
    assert len(found) > 2


@pytest.mark.parametrize(
    ("order", "path", "time"),
    [
        (None, [1], 2.0),
        (None, [0, 0, 1], 2.5),
        ([["blue"], ["red"]], [1], 2.5),
        ([["red"], ["blue"]], [0, 0, 1], 2.25),
    ],
)
def test_a_deed_is_interrupted_when_its_agent_sets_out(road, order, path, time):
    lasts(road, blocks_moving=False, on_interrupt="resume")
    road.game.order = order
    road.agent.get_agent("ann").speed = len(path)
    road.plans["ann"] = [{"do": {"defuse": 3}}, 0, path, {"do": {"defuse": 3}}]
    begun = 0.5 if order == [["blue"], ["red"]] else 0.0
    found = events_of(road.game.run(6), "begun", "done", "interrupted")
    assert found[:2] == [
        ("begun", begun),
        ("interrupted", pytest.approx(time), "move", pytest.approx(4 + begun - time)),
    ]
    assert found[2:] == [("begun", 3 + begun), ("done", pytest.approx(3 + begun + 4 + begun - time))]


def test_agents_that_are_out_of_play_or_put_elsewhere_do_not_finish(road):
    lasts(road)
    road.plans = {"ann": [{"do": {"defuse": 3}}], "bob": [{"do": {"defuse": 3}}]}

    @road.game.add
    def storm(ctx):
        if ctx.game.turn == 2:
            ctx.game.eliminate("ann")
            ctx.game.respawn("bob", 5)

    result = road.game.run(4)
    assert events_of(result, "interrupted", "done") == [
        ("interrupted", 2.0, "eliminated", 2.0),
        ("interrupted", 2.0, "move", 2.0),
    ]


def test_a_tagger_interrupts_whatever_the_order_of_the_rules(road):
    deeds = []
    for place in range(3):
        lasts(road)
        road.plans = {"ann": [{"do": {"defuse": 3}}], "bob": [8, 7, 6]}
        road.game.reset()
        rules = [lambda ctx: deeds.extend(ctx.game.performed("defuse")), time_limit(9)]
        rules.insert(place, tag("blue", "red", hops=7))
        names = [road.game.add(rule) for rule in rules]
        assert events_of(road.game.run(3), "interrupted") == [("interrupted", 2.0, "tag", 2.0)]
        for rule in names:
            road.game.remove(rule)
        road.game.reset()
    assert not deeds


def test_a_game_continues_exactly_from_the_middle_of_a_deed(road):
    lasts(road, on_interrupt="resume", turns=2.5)
    road.plans["ann"] = [{"do": {"defuse": 3}}] * 8
    road.game.add(tag("blue", "red", hops=7, then=lambda ctx, bob, ann: ctx.game.respawn(bob, 9)))
    road.plans["bob"] = [8, 7, 8, 7, 8, 7, 8, 7, 8]
    stream = io.BytesIO()
    road.record.start(stream)
    whole = road.game.run(9)
    road.record.stop()
    road.game.reset()
    kinds = ("begun", "done", "interrupted")
    assert {kind for kind, *_ in events_of(whole, *kinds)} == set(kinds)
    for turn in range(1, 8):
        road.game.step()
        here = road.game.snapshot()
        ahead = road.game.fork(5).run(9 - turn)
        later = road.game.run(9 - turn)
        assert later.events == whole.events == ahead.events
        assert later.deeds == whole.deeds == ahead.deeds
        road.game.restore(here)
    recording = gamms.recorder.open(io.BytesIO(stream.getvalue()))
    assert recording.table("deeds")["time"].tolist() == [deed["time"] for deed in whole.deeds]
    for turn in (2, 5):
        with recording.resume(turn) as ctx:
            for name in ("ann", "bob"):
                ctx.agent.get_agent(name).register_strategy(road.agent.get_agent(name).strategy)
            ctx.game.add(tag("blue", "red", hops=7, then=lambda ctx, bob, ann: ctx.game.respawn(bob, 9)))
            resumed = ctx.game.run(9 - turn)
            assert (resumed.events, resumed.deeds) == (whole.events, whole.deeds)


def test_the_arc_of_a_deed_is_outside_the_arcs_of_cooldowns(road):
    lasts(road)
    road.plans["ann"] = [{"do": {"defuse": 3, "wait": None}}]
    road.game.add(cooldown("wait", 5))
    road.game.run(2)
    commands = road.visual.draw_commands()
    rows = (commands.layer == 22).nonzero()[0]
    tops = commands.points[commands.offsets[rows] + 1]  # the first corners, after the place of the agent
    assert sorted(tops[:, 1].tolist()) == [-26.0, -26.0, -18.0]


def test_a_lasting_deed_is_drawn_as_an_arc_that_closes(road):
    with gamms.create_context(logger_config={"level": "ERROR"}, game={"deeds": {"defuse": DEFUSE}}) as ctx:
        assert ctx.visual.artists.get("doing") is not None
    lasts(road)
    road.plans["ann"] = [{"do": {"defuse": 3}}]
    stream = io.BytesIO()
    road.record.start(stream)
    drawn = []
    for _ in range(4):
        road.game.step()
        drawn.append(road.visual.draw_commands().layer.tolist().count(22))
    road.record.stop()
    assert drawn == [2, 2, 2, 0]
    with gamms.create_context(logger_config={"level": "ERROR"}) as ctx:
        replayed = [
            ctx.visual.draw_commands().layer.tolist().count(22)
            for record in ctx.record.replay(io.BytesIO(stream.getvalue()))
            if record["opCode"] == 1
        ]
    assert replayed == drawn


@pytest.mark.parametrize("turn", [1, 2])
def test_an_agent_that_is_created_under_the_name_of_a_deleted_one_begins_without_its_deed(turn):
    def work(state):
        state["memory"].setdefault("seen", []).append(state["doing"] and state["doing"]["left"])
        state["action"] = {"do": {"defuse": 3}} if state["turn"] in (0, 4) else state["curr_pos"]

    def swap(ctx):
        if ctx.game.turn == turn:
            ctx.agent.delete_agent("ann")
            ctx.agent.create_agent("ann", start_node_id=3, team="red", strategy=work)

    with gamms.create_context(seed=1, game={"deeds": {"defuse": {**DEFUSE, "on_interrupt": "resume"}}}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(1, 10))
        ctx.agent.create_agent("ann", start_node_id=1, team="red", strategy=work)
        ctx.game.add(swap)
        with ctx.game.batch(1, seed=1) as games:
            games.run(10, warn=False)
            together = games.result(0)
        result = ctx.game.run(10)
        seen = ctx.agent.get_agent("ann").state["memory"]["seen"]
    assert seen == [None, *((3.0, 2.0)[: turn - 1]), *[None] * (5 - turn), 3.0, 2.0, 1.0, None, None]
    assert events_of(result, "interrupted") == [("interrupted", float(turn), "eliminated", 4.0 - turn)]
    assert events_of(result, "done") == [("done", 8.0)]
    assert result == together
