"""People as players, without a browser: what they are asked, which choices count, and what is recorded of them."""

import asyncio
from threading import Lock, Thread

import pytest

import gamms
from gamms import recorder, scenario, web
from gamms.bridge import SimulatedClock
from gamms.web.choices import RefusedChoice
from gamms.web.people import People

GRID = {"grid": {"width": 5, "height": 5}}


def context(red, blue=gamms.strategies.stay, **settings):
    """Return a game of two agents on a grid: `red` in a corner, `blue` in the other one, who see two edges far."""
    ctx = gamms.create_context(seed=1, logger_config={"level": "ERROR"}, game=settings)
    ctx.graph.attach_networkx_graph(gamms.graph.grid(5, 5))
    for name, node, strategy in (("anna", 0, red), ("bert", 24, blue)):
        eyes = ctx.sensor.create_sensor(f"{name}/eyes", "agent_range", sensor_range=25)
        team = {"anna": "red", "bert": "blue"}[name]
        ctx.agent.create_agent(name, start_node_id=node, team=team, sensors={"eyes": eyes}, strategy=strategy)
    return ctx


def play(ctx, answer, turns=1):
    """Play with people who answer each question at once by a function; return the result and its answers in order."""
    people, found = People.open(ctx), {}
    for name in people.persons:
        people.mark_present(name)

    def on_change():
        for name in people.persons:
            for question in people.list_questions(name):
                with lock:
                    is_new = question["question"] not in seen
                    seen.add(question["question"])
                if is_new:
                    found[question["question"]] = answer(people, name, question)

    def look():
        answering.append(Thread(target=on_change, daemon=True))
        answering[-1].start()

    seen, lock, answering = set(), Lock(), []
    people.changed.append(look)
    result = ctx.game.run(turns)
    for thread in answering:  # the game may end before the last of them has noted what it answered
        thread.join(60.0)
    return result, [found[number] for number in sorted(found)]


def going_to(*nodes):
    """Answer with these nodes, one each turn."""

    def answer(people, name, question):
        people.choose(name, {"question": question["question"], "move": nodes[question["turn"]]})
        return question

    return answer


def test_a_person_chooses_and_the_choice_is_recorded_with_its_time(tmp_path):
    path = tmp_path / "game.ggr"
    with context(web.human(seconds=60.0)) as ctx:
        ctx.record.start(path)
        result, asked = play(ctx, going_to(1, 6), turns=2)
    assert result.agents["anna"]["node"] == 6
    assert asked[0]["moves"] == [0, 1, 5]
    with recorder.open(path) as recording:
        events = [event for event in recording.events() if event["kind"] == "choice"]
    assert [(one["turn"], one["agent"], one["person"], one["action"]) for one in events] == [
        (1, "anna", "anna", '{"move": 1}'),
        (2, "anna", "anna", '{"move": 6}'),
    ]
    assert all(0.0 <= one["seconds"] < 60.0 and one["outcome"] == "chosen" for one in events)


def test_a_recording_is_played_again_without_the_person(tmp_path):
    first, second = tmp_path / "game.ggr", tmp_path / "again.ggr"
    with context(web.human(seconds=0.05), web.human(seconds=60.0)) as ctx:
        ctx.record.start(first)
        result, _ = play(ctx, lambda people, name, asked: name == "bert" and going_to(23)(people, name, asked))
    with context(web.human(choices=first), web.human(choices=first)) as ctx:
        ctx.record.start(second)
        assert ctx.game.run(1) == result
    assert first.read_bytes() == second.read_bytes()
    assert [event["outcome"] for event in result.events] == ["no choice in time", "chosen"]


def east(state):
    """Go to the next node of the row."""
    state["action"] = state["curr_pos"] + 1


def test_the_default_decides_where_the_time_is_over():
    with context(web.human(seconds=60.0, otherwise=east), clock=SimulatedClock()) as ctx:
        result, _ = play(ctx, lambda *_: None)
    assert result.agents["anna"]["node"] == 1
    assert result.table("choice")["outcome"].tolist() == ["no choice in time"]
    assert result.table("choice")["seconds"].tolist() == [60.0]


def test_a_choice_counts_once_when_its_turn_has_to_be_begun_again():
    class Failing:
        """A strategy that raises an error in its first turn, when others have decided."""

        calls = 0

        async def __call__(self, state):
            await asyncio.sleep(90.0)
            self.calls += 1
            state["action"] = state["curr_pos"] // (self.calls - 1)

    with context(web.human(seconds=60.0, otherwise=east), Failing(), clock=SimulatedClock()) as ctx:
        people = People.open(ctx)
        people.mark_present("anna")
        with pytest.raises(ZeroDivisionError):
            ctx.game.step()
        ctx.game.step()
        assert [event["turn"] for event in ctx.game.events] == [1]
        assert ctx.game.observation("anna")["curr_pos"] == 1


def test_a_question_vanishes_from_the_page_when_its_turn_is_interrupted():
    async def press(state):
        await asyncio.sleep(1.0)
        raise KeyboardInterrupt

    with context(web.human(seconds=60.0), press, clock=SimulatedClock()) as ctx:
        people = People.open(ctx)
        people.mark_present("anna")
        asked = []
        people.changed.append(lambda: asked.append([one["question"] for one in people.list_questions("anna")]))
        with pytest.raises(KeyboardInterrupt):
            ctx.game.step()
        assert asked == [[1], []]
        assert not people.is_waiting
        with pytest.raises(RefusedChoice, match="Question 1 is not open"):
            people.choose("anna", {"question": 1, "move": 1})


@pytest.mark.parametrize(
    ("choice", "why"),
    [
        ({"move": 12}, "illegal"),
        ({"move": True}, "illegal"),
        ({"move": "1"}, "illegal"),
        ({"move": [1]}, "illegal"),
        ({}, "illegal"),
        ({"move": 1, "direction": [1, 0, 0]}, "illegal"),
        ({"move": 1, "do": {"fly": {}}}, "illegal"),
        ({"move": 1, "do": {"mark": {"whom": "bert"}}}, "illegal"),  # who is out of sight
        ({"move": 1, "do": {"mark": None}}, "illegal"),
        ({"move": 1, "do": {"hack": {"what": "bert/eye"}}}, "illegal"),  # without a hint at what is out of sight
        ({"move": 1, "do": [["mark", "anna"]]}, "illegal"),
        ({"question": 99, "move": 1}, "late"),
        ({"question": True, "move": 1}, "illegal"),
        ({"question": "bert", "move": 23}, "foreign"),
    ],
)
def test_choices_that_do_not_count_are_refused_by_name_and_move_nothing(choice, why):
    found = []

    def on_change():
        asked = {name: people.list_questions(name) for name in ("anna", "bert")}
        if all(asked.values()) and not found:
            given = {"question": asked["anna"][0]["question"], **choice}
            given["question"] = asked["bert"][0]["question"] if given["question"] == "bert" else given["question"]
            with pytest.raises(RefusedChoice) as caught:
                people.choose("anna", given)
            assert "eyes" not in str(caught.value)
            found.append(caught.value.why)
            people.let_go()

    deeds = {"mark": {"whom": "agent"}, "hack": {"what": "sensor"}}
    with context(web.human(), web.human(), deeds=deeds) as ctx:
        people = People.open(ctx)
        for name in ("anna", "bert"):
            people.mark_present(name)
        people.changed.append(on_change)
        result = ctx.game.run(1)
    assert found == [why]
    assert [result.agents[name]["node"] for name in ("anna", "bert")] == [0, 24]


def test_the_first_choice_counts_and_a_second_one_is_refused():
    def answer(people, name, question):
        choice = {"question": question["question"], "move": 1}
        people.choose(name, choice)
        with pytest.raises(RefusedChoice) as caught:
            people.choose(name, {**choice, "move": 5})
        return caught.value.why

    with context(web.human(seconds=60.0)) as ctx:
        result, found = play(ctx, answer)
    assert result.agents["anna"]["node"] == 1
    assert found in ([], ["duplicate"], ["late"])  # late, where the turn was over first


def test_a_person_who_has_not_come_yet_is_waited_for_in_the_beginning():
    with context(web.human(seconds=5.0, joins_within=0.05)) as ctx:
        People.open(ctx)
        result = ctx.game.run(1)
    assert result.table("choice")["outcome"].tolist() == ["not there"]


def test_flyers_get_a_direction_and_deeds_name_who_is_in_sight():
    asked = []

    def answer(people, name, question):
        asked.append(question)
        for bad in (
            {"direction": [1, 0]},
            {"direction": [1, 0, float("nan")]},
            {"direction": [1, 0, 0], "distance": 9},
        ):
            with pytest.raises(RefusedChoice):
                people.choose(name, {"question": question["question"], **bad})
        deed = {"do": {"mark": {"whom": "bert"}}}
        people.choose(name, {"question": question["question"], "direction": [3, 4, 0], "distance": 5.0, **deed})

    with gamms.create_context(seed=1, game={"deeds": {"mark": {"whom": "agent"}}}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(5, 5))
        eyes = ctx.sensor.create_sensor("eyes", "aerial_agent", sensor_range=25, fov=3.0)
        drone = {"type": "AERIAL", "position": (0, 0, 10), "speed": 5.0, "strategy": web.human("pilot", seconds=60.0)}
        ctx.agent.create_agent("drone", start_node_id=0, sensors={"eyes": eyes}, **drone)
        ctx.agent.create_agent("bert", start_node_id=1, team="blue", strategy=gamms.strategies.stay)
        ctx.agent.create_agent("carl", start_node_id=24, team="blue", strategy=gamms.strategies.stay)
        result, _ = play(ctx, answer)
        assert ctx.agent.get_agent("drone").position == (3, 4, 10)
    assert asked[0]["moves"] is None
    assert asked[0]["deeds"]["mark"]["whom"]["choices"] == ["bert", "drone"]
    assert result.deeds[0]["whom"] == "bert"


def test_a_person_sees_which_deed_an_agent_is_doing():
    asked = []

    def answer(people, name, question):
        asked.append(question.get("doing"))
        deed = {"do": {"dig": {}}}
        people.choose(name, {"question": question["question"], "move": question["here"], **deed})

    with context(web.human(seconds=60.0), deeds={"dig": {"fields": {}, "turns": 1.5}}) as ctx:
        result, _ = play(ctx, answer, 2)
    assert asked == [None, {"kind": "dig", "since": 0.0, "left": 0.5, "values": {}}]
    assert [deed["time"] for deed in result.deeds] == [1.5]


RADIO = {"range_m": 100.0, "max_bytes_per_turn": 12, "teams": ["red", "blue"]}


def saying(*messages):
    """Answer with a move to node 1 or back, and with these messages in the first turn."""

    def answer(people, name, question):
        choice = {"question": question["question"], "move": question["here"]}
        people.choose(name, choice | ({"messages": list(messages)} if question["turn"] == 0 and name == "anna" else {}))
        return question

    return answer


def test_a_person_sends_messages_which_are_recorded_and_sent_again(tmp_path):
    first, second = tmp_path / "game.ggr", tmp_path / "again.ggr"
    by_radio = {"channel": "radio", "to": "blue", "body": "hello"}
    with context(web.human(seconds=60.0), web.human(seconds=60.0), channels={"radio": RADIO}) as ctx:
        ctx.record.start(first)
        result, asked = play(ctx, saying(by_radio), turns=2)
    found = {(one["agent"], one["turn"]): one for one in asked}
    assert found["anna", 0]["channels"] == {"radio": {"to": [None, "blue"], "bytes": 12}}  # bert is out of sight
    (heard,) = found["bert", 1]["inbox"]
    assert heard == by_radio | {"sender": "anna", "turn": 0, "overheard": False}
    assert found["bert", 1]["channels"]["radio"]["to"] == [None, "red", "anna"]  # who was heard can be answered
    assert [(one["sender"], one["to"], one["body"]) for one in result.messages] == [("anna", "blue", "hello")]
    again = web.human(choices=first)
    with context(again, web.human(choices=first), channels={"radio": RADIO}) as ctx:
        ctx.record.start(second)
        assert ctx.game.run(2) == result
    assert first.read_bytes() == second.read_bytes()


@pytest.mark.parametrize(
    ("messages", "words"),
    [
        ([{"channel": "radio", "to": "blue", "body": "far too long"}], "channel 'radio' takes 12 of each agent"),
        ([{"channel": "radio", "to": None, "body": "1234567"}] * 2, "channel 'radio' takes 12 of each agent"),
        ([{"channel": "wire", "to": None, "body": "a"}], "has no channel for"),
        ([{"channel": "police", "to": None, "body": "a"}], "has no channel for"),
        ([{"channel": "radio", "to": "bert", "body": "a"}], "cannot send to 'bert'"),  # who is out of sight
        ([{"channel": "radio", "to": "anna", "body": "a"}], "cannot send to 'anna'"),
        ([{"channel": "radio", "to": False, "body": "a"}], "cannot send to False"),
        ([{"channel": "radio", "to": ["blue"], "body": "a"}], "cannot send to"),
        ([{"channel": ["radio"], "to": None, "body": "a"}], "has no channel for"),
        ([{"channel": "radio", "to": None}], "There is no 'body'"),
        ([{"channel": "radio", "to": None, "body": "a", "sender": "bert"}], "Unknown key of a message: 'sender'"),
        (["radio"], "has no channel for 'radio'"),
        ("radio", "Messages are a list"),
        ([{"channel": "radio", "to": None, "body": ""}] * 9, "at most 8"),
    ],
)
def test_messages_that_the_channels_do_not_take_are_refused_with_the_whole_choice(messages, words):
    found = []

    def answer(people, name, question):
        with pytest.raises(RefusedChoice) as caught:
            people.choose(name, {"question": question["question"], "move": 1, "messages": messages})
        found.append(str(caught.value))
        people.let_go()

    channels = {"radio": RADIO, "police": {"range_m": 9.0, "teams": ["blue"]}}
    with context(web.human(seconds=60.0), channels=channels) as ctx:
        result, _ = play(ctx, answer)
    assert words in found[0]
    assert "bert" not in found[0].replace(str(messages), "").replace("'bert'", "")
    assert result.messages == []
    assert result.agents["anna"]["node"] == 0


def test_choices_of_people_are_cut_from_the_knowledge_of_another_team(tmp_path):
    path = tmp_path / "game.ggr"
    with context(web.human(seconds=60.0)) as ctx:
        ctx.agent.get_agent("bert").current_node_id = 6  # and both see each other
        ctx.record.start(path, sensed=True)
        play(ctx, going_to(1, 6), turns=2)
    counts = {}
    for team in ("red", "blue"):
        with recorder.open(path) as recording:
            recording.cut(tmp_path / f"{team}.ggr", team)
        with recorder.open(tmp_path / f"{team}.ggr") as recording:
            counts[team] = [event["kind"] for event in recording.events()].count("choice")
    assert counts == {"red": 2, "blue": 0}


def test_one_strategy_is_one_person_and_a_team_of_a_scenario_is_one():
    game = scenario.Scenario(
        map=GRID,
        teams={
            "red": {"count": 2, "agents": [{"name": "solo", "strategy": "human"}], "strategy": "human"},
            "blue": {"count": 1, "strategy": "gamms.strategies:stay"},
        },
    )
    with game.build(1) as ctx:
        people = People.open(ctx)
        assert {one.name: one.agents for one in people.persons.values()} == {
            "red": ("red_0", "red_1"),
            "solo": ("solo",),
        }


def test_without_a_server_a_game_of_people_says_what_to_do():
    teams = {"red": {"count": 1, "strategy": {"function": "human", "with": {"seconds": 5}}}}
    game = scenario.Scenario(map=GRID, max_turns=1, teams=teams)
    game.check()
    with pytest.raises(ValueError, match=r"'red_0': a person plays.*gamms run FILE --web.*--strategy"):
        game.play(1)
    with pytest.raises(ValueError, match="a person plays"):
        game.batch(2)
    assert game.play(1, strategies={"red": gamms.strategies.stay}).turns == 1


BUS = 900


def with_bus(ctx):
    """Add an edge for buses between the first two nodes of a game."""
    ctx.graph.add_edge({"id": BUS, "source": 0, "target": 1, "length": 30.0, "bus": True})
    return ctx


def test_a_person_chooses_one_of_several_edges_to_a_node(tmp_path):
    path = tmp_path / "game.ggr"
    with with_bus(context(web.human(seconds=60.0))) as ctx:
        ctx.record.start(path)
        asked = []

        def answer(people, name, question):
            asked.append(question)
            wrong = {"question": question["question"], "move": 5, "edge": BUS}
            for choice in (wrong, {**wrong, "move": 1, "edge": 7}, {**wrong, "move": 1, "edge": str(BUS)}):
                with pytest.raises(RefusedChoice, match="may not take edge"):
                    people.choose(name, choice)
            people.choose(name, {**wrong, "move": 1})

        play(ctx, answer)
        assert [leg.edge for leg in ctx.game.moves["anna"].legs] == [BUS]
        edges = {one["edge"]: (one["to"], one["length"], one["attributes"]) for one in asked[0]["edges"]}
        assert edges == {0: (1, 10.0, {}), BUS: (1, 30.0, {"bus": True})}
    with recorder.open(path) as recording:
        assert recording.table("edges")["edge"].tolist() == [BUS]
        assert recording.table("choice")["action"].tolist() == ['{"edge": 900, "move": 1}']
    with with_bus(context(web.human(choices=path))) as ctx:
        ctx.game.run(1)
        assert [leg.edge for leg in ctx.game.moves["anna"].legs] == [BUS]


def test_people_are_asked_for_edges_only_where_several_lead_to_a_node():
    with context(web.human(seconds=60.0)) as ctx:
        _, asked = play(ctx, going_to(1))
    assert "edges" not in asked[0]
