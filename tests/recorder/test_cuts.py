"""A recording cut down to what a team knew: its own agents whole, others as its sensors reported them, and no more."""

import io

import pytest
from games import empty_context, grid_context, recorded, replayed
from hypothesis import given, settings
from hypothesis import strategies as st
from test_random_games import Programme, programmes

from gamms.agent import AgentType
from gamms.errors import BadValue, UnknownName
from gamms.recorder import open as opened
from gamms.sensor import SensorType


def cut_of(data, team):
    stream = io.BytesIO()
    with opened(io.BytesIO(data)) as recording:
        recording.cut(stream, team)
    return stream.getvalue()


def to_and_fro(state):
    state["action"] = 1 if state["curr_pos"] == 0 else 0


def stay(state):
    state["action"] = state["curr_pos"]


def pair_on_a_grid(**more):
    """Red walks between nodes 0 and 1 and sees 12 units far; blue stands on node 2, 20 units from node 0."""
    ctx = grid_context(**more)
    ctx.sensor.create_sensor("eyes", SensorType.AGENT_RANGE, sensor_range=12.0)
    ctx.agent.create_agent("red_0", start_node_id=0, team="red", sensors=["eyes"], strategy=to_and_fro)
    ctx.agent.create_agent("blue_0", start_node_id=2, team="blue", strategy=stay, mood="a grudge", speed=3)
    return ctx


def names_in(data):
    with opened(io.BytesIO(data)) as recording:
        return [recording[turn].agents["name"].tolist() for turn in range(len(recording) + 1)]


def everything_in(data):
    """All that a reader gets out of it, as text."""
    with opened(io.BytesIO(data)) as recording:
        frames = [recording.reader.keyframe(turn) for turn in range(len(recording) + 1)]
        return repr([recording.reader.header | {"world": b""}, frames, list(recording.logs())])


def test_others_are_there_while_sensors_of_the_team_see_them():
    data = cut_of(recorded(lambda ctx: ctx.game.run(4), pair_on_a_grid(), sensed=True), "red")
    alone, both = ["red_0"], ["red_0", "blue_0"]
    assert names_in(data) == [alone, both, alone, both, both]  # nothing was sensed behind the last turn


def test_a_cut_has_no_seed():
    whole = recorded(lambda ctx: ctx.game.run(4), pair_on_a_grid(seed=471100004711), sensed=True)
    assert "471100004711" in everything_in(whole)
    assert "471100004711" not in everything_in(cut_of(whole, "red"))


def test_a_teammate_that_comes_before_the_agents_look_is_in_the_cut():
    ctx = pair_on_a_grid()

    def send_help(ctx):
        if ctx.game.turn == 2:
            eyes = ctx.sensor.create_sensor("more eyes", SensorType.AGENT_RANGE, sensor_range=12.0)
            ctx.agent.create_agent("red_1", start_node_id=1, team="red", sensors=[eyes], strategy=stay)

    ctx.game.add(send_help, phase="before")
    data = cut_of(recorded(lambda ctx: ctx.game.run(4), ctx, sensed=True), "red")
    assert [sorted(names) for names in names_in(data)[2:]] == [["blue_0", "red_0"], *[["blue_0", "red_0", "red_1"]] * 2]


def change_team(ctx):
    ctx.agent.get_agent("red_1").team = "blue"


def create_again(ctx):
    ctx.agent.delete_agent("red_1")
    ctx.agent.create_agent("red_1", start_node_id=2, team="blue", strategy=stay)


@pytest.mark.parametrize("leave", [change_team, create_again])
def test_a_teammate_that_leaves_before_the_agents_look_is_seen_as_another(leave):
    ctx = pair_on_a_grid()
    ctx.agent.create_agent("red_1", start_node_id=1, team="red", strategy=stay)
    ctx.game.add(lambda ctx: ctx.game.turn == 3 and leave(ctx), phase="before")
    data = cut_of(recorded(lambda ctx: ctx.game.run(4), ctx, sensed=True), "red")
    with opened(io.BytesIO(data)) as recording:
        agents = [recording[turn].agents for turn in range(5)]
    teams = [dict(zip(each["name"].tolist(), each["team"].tolist(), strict=True)) for each in agents]
    mates = {"red_0": "red", "red_1": "red"}
    assert teams[2] == mates
    assert teams[3] == mates | {"blue_0": "blue"}
    assert teams[4] == {"red_0": "red", "red_1": "blue", "blue_0": "blue"}


def test_a_cut_of_a_recording_that_was_not_finished_is_not_finished():
    data = recorded(lambda ctx: ctx.game.run(4), pair_on_a_grid(), sensed=True)
    for whole in (data, data[:-30]):
        with opened(io.BytesIO(whole)) as recording, opened(io.BytesIO(cut_of(whole, "red"))) as cut:
            assert (cut.is_complete, cut.turns) == (recording.is_complete, 4)
            assert recording.is_complete == (whole is data)


def test_one_that_is_seen_and_deleted_in_the_same_turn_is_gone():
    ctx = pair_on_a_grid()
    ctx.game.add(lambda ctx: ctx.game.turn == 2 and ctx.agent.delete_agent("blue_0"))
    data = cut_of(recorded(lambda ctx: ctx.game.run(3), ctx, sensed=True), "red")
    assert names_in(data) == [["red_0"], ["red_0", "blue_0"], ["red_0"], ["red_0"]]


def test_one_that_is_seen_right_after_a_reset_is_there():
    def play(ctx):
        ctx.agent.get_agent("blue_0").current_node_id = 1  # which red_0 sees from both of its nodes
        ctx.game.run(2)
        ctx.game.reset(seed=5)
        ctx.game.run(3)

    data = cut_of(recorded(play, pair_on_a_grid(), sensed=True), "red")
    assert names_in(data) == [["red_0", "blue_0"]] * 6


def test_one_that_goes_takes_no_other_that_is_seen_with_it():
    ctx = pair_on_a_grid()
    ctx.agent.create_agent("red_1", start_node_id=1, team="red", sensors=["eyes"], strategy=stay)
    ctx.agent.create_agent("blue_1", start_node_id=2, team="blue", strategy=stay)
    ctx.game.add(lambda ctx: ctx.game.turn == 2 and ctx.agent.delete_agent("blue_1"))
    with opened(io.BytesIO(cut_of(recorded(lambda ctx: ctx.game.run(4), ctx, sensed=True), "red"))) as recording:
        gone = [(step["turn"], step["data"]["name"]) for step in recording.steps() if step["event"] == "AGENT_DELETE"]
    assert gone == [(2, "blue_1")]


def test_without_sightings_there_is_nothing_of_others():
    ctx = pair_on_a_grid()
    ctx.game.add(lambda ctx: ctx.game.data.update(secret="kept by a rule"))
    data = cut_of(recorded(lambda ctx: ctx.game.run(4), ctx, sensed=True), "blue")
    assert set(map(tuple, names_in(data))) == {("blue_0",)}
    sides = "'sides': ['red', 'blue']"  # which teams there are is public, by which they have their colours
    text = everything_in(data)
    assert "blue_0" in text
    assert "grudge" in text
    assert sides in text
    assert "red" not in text.replace(sides, "")
    assert "kept by a rule" not in text


def test_seed_and_scenario_are_left_out():
    data = cut_of(recorded(lambda ctx: ctx.game.run(1), pair_on_a_grid(seed=12345), sensed=True), "red")
    assert "12345" not in everything_in(data)
    with opened(io.BytesIO(data)) as recording:
        assert recording.seed is None
        assert recording.header["audience"] == "red"


def test_a_team_has_its_own_memories_facts_and_messages():
    ctx = pair_on_a_grid()
    ctx.game.add_channel("radio", range_m=1000.0)
    ctx.agent.create_agent("blue_1", start_node_id=8, team="blue")

    def tell(ctx):
        ctx.game.publish(to="red", plan=f"red plan {ctx.game.turn}")
        ctx.game.publish(to="blue", plan=f"blue plan {ctx.game.turn}")
        ctx.game.publish(weather="rain")

    def talk(state):
        state["memory"]["note"] = f"{state['name']} notes"
        state["outbox"] = [{"channel": "radio", "to": "blue_1", "body": f"from {state['name']}"}]
        stay(state)

    for agent in ctx.agent.create_iter():
        agent.register_strategy(talk)
    ctx.game.add(tell)
    text = everything_in(cut_of(recorded(lambda ctx: ctx.game.run(3), ctx, sensed=True), "red"))
    assert "red plan" in text
    assert "rain" in text
    assert "red_0 notes" in text
    assert "from red_0" in text
    assert "blue plan" not in text
    assert "blue_0 notes" not in text
    assert "from blue_0" not in text


def test_messages_come_when_they_are_heard():
    ctx = pair_on_a_grid()
    ctx.game.add_channel("radio", range_m=1000.0, delay_turns=2)

    def call(state):
        if not state["turn"]:
            state["outbox"] = [{"channel": "radio", "to": "red_0", "body": "psst"}]
        stay(state)

    ctx.agent.get_agent("blue_0").register_strategy(call)
    whole = recorded(lambda ctx: ctx.game.run(6), ctx, sensed=True)
    with opened(io.BytesIO(whole)) as recording:
        arrival = recording.table("messages")["arrival"].tolist()
    with opened(io.BytesIO(cut_of(whole, "red"))) as recording:
        turns = [turn for turn, log in enumerate(recording.logs(), 1) if "psst" in repr(log)]
    assert arrival
    assert turns == arrival


def test_the_state_of_a_strategy_can_be_seen_again():
    whole = recorded(lambda ctx: ctx.game.run(4), pair_on_a_grid(), sensed=True)
    with opened(io.BytesIO(whole)) as recording, opened(io.BytesIO(cut_of(whole, "red"))) as red:
        for turn in (1, 2, 3, 4):
            then, now = (one.observation(turn, "red_0") for one in (recording, red))
            assert (then["curr_pos"], then["sensor"]) == (now["curr_pos"], now["sensor"])


def test_noise_hides_where_an_agent_really_is():
    ctx = grid_context()
    ctx.sensor.create_sensor("radar", SensorType.AERIAL_AGENT, sensor_range=500.0, fov=6.0, position_noise_m=9.0)
    ctx.agent.create_agent(
        "red_0", start_node_id=4, team="red", type=AgentType.AERIAL, position=(10.0, 10.0, 100.0), speed=1.0,
        sensors=["radar"], quat=(0.7071067811865476, 0.0, 0.7071067811865476, 0.0),
    )  # fmt: skip
    ctx.agent.create_agent("blue_0", start_node_id=8, team="blue", strategy=stay)
    whole = recorded(lambda ctx: ctx.game.run(12), ctx, sensed=True)
    with opened(io.BytesIO(whole)) as recording, opened(io.BytesIO(cut_of(whole, "red"))) as red:
        reported = [recording.observation(turn, "red_0")["sensor"]["radar"][1]["blue_0"][1] for turn in range(1, 13)]
        graph, shown = recording.graph.columns(), [red[turn].agents["node"][1] for turn in range(12)]
        nearest = [graph.node_ids[((graph.xy - place[:2]) ** 2).sum(axis=1).argmin()] for place in reported]
        assert shown == nearest
        assert len(set(shown)) > 1
        looks = red.table("sensed")
        assert looks["node"].tolist() == nearest


def test_who_changes_sides_takes_its_own_with_it():
    ctx = pair_on_a_grid()

    def defect(ctx):
        if ctx.game.turn == 1:
            ctx.agent.get_agent("blue_0").team = "red"

    ctx.game.add(defect)
    data = cut_of(recorded(lambda ctx: ctx.game.run(3), ctx, sensed=True), "red")
    assert [set(names) for names in names_in(data)][2:] == [{"red_0", "blue_0"}] * 2
    assert "grudge" in everything_in(data)


@pytest.mark.parametrize("team", ["green", 7, None])
def test_a_team_that_is_not_there_is_named(team):
    with pytest.raises(UnknownName, match="team"):
        cut_of(recorded(lambda ctx: ctx.game.run(1), pair_on_a_grid(), sensed=True), team)


def test_a_recording_without_sensor_data_cannot_be_cut(tmp_path):
    (tmp_path / "game.ggr").write_bytes(recorded(lambda ctx: ctx.game.run(1), pair_on_a_grid(), sensed=False))
    with opened(tmp_path / "game.ggr") as recording, pytest.raises(BadValue, match="sensed=False"):
        recording.cut(tmp_path / "red.ggr", "red")
    assert [file.name for file in tmp_path.iterdir()] == ["game.ggr"]


def test_a_cut_is_drawn_like_any_recording(tmp_path):
    with opened(io.BytesIO(cut_of(recorded(lambda ctx: ctx.game.run(2), pair_on_a_grid(), sensed=True), "red"))) as red:
        red.save(tmp_path / "red.svg", 1)
    assert "red_0" in (tmp_path / "red.svg").read_text()


def own_of(recording, turn, names):
    agents = recording[turn].agents
    return {
        name: [str(agents[key][row]) for key in ("team", "kind", "alive", "node", "previous", "x", "y", "z", "speed")]
        for row, name in enumerate(agents["name"].tolist())
        if name in names
    }


@settings(max_examples=12)
@given(programmes, programmes, st.sampled_from(["red", "blue", None]))
def test_a_cut_of_any_game_has_the_team_whole_and_of_others_whom_it_saw(before, after, team):
    steps = [step for step in (*before, ("game",), *after, ("game",), ("game",)) if step[0] not in ("pause", "play")]
    ctx = grid_context()

    whole = recorded(lambda ctx: Programme(ctx).do(steps), ctx, sensed=True)
    try:
        data = cut_of(whole, team)
    except (UnknownName, BadValue):
        return
    with opened(io.BytesIO(whole)) as recording, opened(io.BytesIO(data)) as cut:
        assert cut.turns == recording.turns
        sensed = recording.table("sensed")
        for turn in range(cut.turns + 1):
            there = recording[turn].agents
            own = {name for name, of in zip(there["name"].tolist(), there["team"].tolist(), strict=True) if of == team}
            assert own_of(recording, turn, own) == own_of(cut, turn, own)
            if turn < cut.turns:
                rows = (sensed["turn"] == turn + 1).nonzero()[0].tolist()
                seen = {sensed["other"][row] for row in rows if sensed["agent"][row] in own}
                assert set(cut[turn].agents["name"].tolist()) - own <= seen
        if recording.reader.turns > recording.turns:
            return  # of the turn that was not over there is no state
        again, _ = replayed(data, empty_context(seed=2))
        assert {agent.name for agent in again.agent.create_iter()} == set(cut[-1].agents["name"].tolist())


def hidden_game(deed):
    """Red stands on node 0 and sees 5 units far; blue stands on node 8 and does what `deed` says."""
    ctx = grid_context()
    ctx.sensor.create_sensor("eyes", SensorType.AGENT_RANGE, sensor_range=5.0)
    ctx.agent.create_agent("red_0", start_node_id=0, team="red", sensors=["eyes"], strategy=stay)
    ctx.agent.create_agent("blue_0", start_node_id=8, team="blue", strategy=stay)
    deed(ctx)
    return ctx


def jump_at_times(state):
    state["action"] = 0 if state["turn"] == 1 else state["curr_pos"]  # 0 is not legal


def come_in_the_first_turn(ctx):
    if ctx.game.turn == 1:
        ctx.agent.create_agent("blue_1", start_node_id=7, team="blue", strategy=stay)


@pytest.mark.parametrize(
    "deed",
    [
        lambda ctx: ctx.agent.get_agent("blue_0").register_strategy(jump_at_times),
        lambda ctx: ctx.game.add(come_in_the_first_turn),
    ],
    ids=["is blocked", "comes"],
)
def test_no_byte_of_a_cut_depends_on_agents_that_are_not_seen(deed):
    one, other = (recorded(lambda ctx: ctx.game.run(4), hidden_game(each)) for each in (deed, lambda _: None))
    assert one != other
    assert cut_of(one, "red") == cut_of(other, "red")


def test_a_team_knows_the_carriers_that_it_sees_and_of_others_only_that_they_carry():
    ctx = pair_on_a_grid()
    flags = {"bases": {"red": 0, "blue": 2, "green": 3}, "carriers": {"red": "blue_0", "blue": "red_0", "green": None}}
    ctx.game.data |= {"flags": flags, "secret": {"bases": {}, "carriers": "blue_0"}}

    def drop(ctx):
        if ctx.game.turn == 4:
            flags["carriers"]["red"] = None

    ctx.game.add(drop)
    data = cut_of(recorded(lambda ctx: ctx.game.run(5), ctx, sensed=True), "red")
    with opened(io.BytesIO(data)) as recording:
        states = [recording[turn] for turn in range(6)]
    known = [state.data["flags"]["carriers"] for state in states]
    seen = ["blue_0" in state.agents["name"] for state in states[:4]]
    assert seen == [False, True, False, True]
    assert [each["red"] for each in known] == ["", "blue_0", "", "blue_0", None, None]
    assert {each["blue"] for each in known} == {"red_0"}
    assert {each["green"] for each in known} == {None}
    assert all(state.data.keys() == {"flags"} and state.data["flags"]["bases"] == flags["bases"] for state in states)
