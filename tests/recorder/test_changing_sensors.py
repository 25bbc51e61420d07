"""Sensors that come, go and are changed in a game: replays, states and resumed games have them as they were."""

import io

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import gamms
from gamms import recorder
from gamms.errors import UnknownName
from gamms.recorder.keyframes import capture_state

QUIET = {"level": "CRITICAL"}
IDS = ["a", "b", "c"]
OPERATIONS = st.one_of(
    st.tuples(st.just("create"), st.sampled_from(IDS), st.sampled_from(["AGENT_RANGE", "RANGE", "NEIGHBOR"])),
    st.tuples(st.just("delete"), st.sampled_from(IDS), st.none()),
    st.tuples(st.just("at"), st.sampled_from(IDS), st.sampled_from([None, 3, (5.0, 5.0)])),
    st.tuples(st.just("range"), st.sampled_from(IDS), st.sampled_from([10.0, 20.0])),
    st.tuples(st.just("team"), st.sampled_from(IDS), st.sampled_from([None, "red", ["red", "blue"]])),
    st.tuples(st.just("delay"), st.sampled_from(IDS), st.sampled_from([None, 1, 2])),
    st.tuples(st.just("carry"), st.sampled_from(IDS), st.sampled_from(["ann", "bob"])),
    st.tuples(st.just("drop"), st.sampled_from(IDS), st.sampled_from(["ann", "bob"])),
)
TURNS = st.lists(st.lists(OPERATIONS, max_size=4), min_size=1, max_size=6)


def grid():
    ctx = gamms.create_context(seed=2, logger_config=QUIET)
    ctx.graph.attach_networkx_graph(gamms.graph.grid(4, 4))
    return ctx


def apply(ctx, what, name, value):
    """Do one thing to a sensor, if it can be done."""
    sensor = ctx.sensor.sensors.get(name)
    if what == "create" and sensor is None:
        ctx.sensor.create_sensor(name, value)
    elif sensor is None:
        return
    elif what == "delete":
        ctx.sensor.delete_sensor(name)
    elif what in ("at", "range") and hasattr(sensor, what):
        setattr(sensor, what, value)
    elif what in ("team", "delay") and hasattr(sensor, "notice"):
        setattr(sensor.notice, {"team": "team", "delay": "delay_turns"}[what], value)
    elif what == "carry":
        ctx.agent.get_agent(value).register_sensor(f"my {name}", sensor)
    elif what == "drop" and f"my {name}" in ctx.agent.get_agent(value).sensors:
        ctx.agent.get_agent(value).deregister_sensor(f"my {name}")


def shown(ctx):
    """Return all sensors, in their order, and who carries which."""
    carried = {
        name: {key: one.sensor_id for key, one in agent.sensors.items()} for name, agent in ctx.agent.agents.items()
    }
    return ctx.sensor.storage.describe_sensors(), carried


def play(turns, also=lambda ctx, turn: None):
    """Return the bytes of a game in which a rule does these things, and what there was after each turn."""
    stream, states = io.BytesIO(), []
    with grid() as ctx:
        ctx.sensor.create_sensor("a", "AGENT_RANGE", sensor_range=15.0)
        for name, team, node in (("ann", "red", 0), ("bob", "blue", 9)):
            ctx.agent.create_agent(name, start_node_id=node, team=team, sensors=["a"] if name == "ann" else [])
            ctx.agent.get_agent(name).register_strategy(lambda state: state.update(action=max(state["legal"])))

        @ctx.game.add
        def rule(ctx):
            for operation in turns[ctx.game.turn - 1]:
                apply(ctx, *operation)

        ctx.record.start(stream)
        states.append(shown(ctx))
        for turn in range(len(turns)):
            also(ctx, turn)
            ctx.game.step()
            states.append(shown(ctx))
        ctx.record.stop()
    return stream.getvalue(), states


@settings(max_examples=12)
@given(TURNS)
def test_every_state_and_every_replay_has_the_sensors_of_then(turns):
    data, states = play(turns)
    recording = recorder.open(io.BytesIO(data))
    for turn, state in enumerate(states):
        with recording.resume(turn) as ctx:
            assert shown(ctx) == state
    again = io.BytesIO()
    with gamms.create_context(logger_config=QUIET) as ctx:
        ctx.record.start(again)
        replayed = [shown(ctx) for record in ctx.record.replay(io.BytesIO(data)) if record["opCode"] == 1]
        ctx.record.stop()
        assert replayed == states[1:]
        keyframe = capture_state(ctx)
    assert again.getvalue() == data
    with recording.resume(len(turns)) as ctx:
        assert capture_state(ctx)["sensor_kinds"] == keyframe["sensor_kinds"]


@settings(max_examples=12)
@given(TURNS, st.data())
def test_a_reset_takes_sensors_back_in_the_recording_too(turns, data):
    turn_of_reset = data.draw(st.integers(0, len(turns)))

    def go_back(ctx, turn):
        if turn == turn_of_reset:
            ctx.game.reset()
            described, carried = shown(ctx)
            assert [(one["id"], one["keywords"]["sensor_range"]) for one in described] == [("a", 15.0)]
            assert carried == {"ann": {"a": "a"}, "bob": {}}

    game, states = play([*turns, *turns], go_back)
    recording = recorder.open(io.BytesIO(game))
    for turn in range(1, len(states)):
        with recording.resume(turn) as ctx:
            assert shown(ctx) == states[turn]


def test_a_resumed_context_keeps_values_that_a_recording_cannot_hold():
    data, _ = play([[("delete", "a", None), ("create", "b", "AGENT_RANGE")], [("range", "b", 20.0)]])
    with grid() as ctx:
        for name in ("a", "b", "own"):
            ctx.sensor.create_sensor(name, "AGENT_RANGE", detection=lambda distances: distances * 0.0)
        before = ctx.sensor.get_sensor("b")
        recorder.open(io.BytesIO(data)).resume(2, ctx=ctx)
        assert list(ctx.sensor.sensors) == ["b", "own"]  # the recording does not know of the last one
        assert ctx.sensor.get_sensor("b") is before
        assert before.range == 20.0
        assert callable(before.notice.detection)


def test_a_sensor_on_a_node_that_was_removed_is_there_and_does_not_look():
    def remove(ctx, turn):
        if turn == 1:
            ctx.agent.get_agent("ann").deregister_sensor("a")
            ctx.graph.graph.remove_node(3)

    data, states = play([[("at", "a", 3)], [("range", "a", 20.0)]], remove)
    with recorder.open(io.BytesIO(data)).resume(2) as ctx:
        assert shown(ctx) == states[2]
        with pytest.raises(UnknownName, match="3"):
            ctx.sensor.get_sensor("a").sense()
    with gamms.create_context(logger_config=QUIET) as ctx:
        assert [shown(ctx) for record in ctx.record.replay(io.BytesIO(data)) if record["opCode"] == 1] == states[1:]


def test_a_game_that_changes_no_sensor_asks_for_none():
    with grid() as ctx:
        ctx.sensor.create_sensor("a", "AGENT_RANGE")
        for name in ("ann", "bob"):  # who share it, so that its owner changes with every look
            agent = ctx.agent.create_agent(name, start_node_id=0, sensors=["a"])
            agent.register_strategy(lambda state: state.update(action=max(state["legal"])))
        storage, asked = ctx.sensor.storage, []
        described = storage.describe_sensors
        ctx.record.start(io.BytesIO())
        ctx.game.step()
        object.__setattr__(storage, "describe_sensors", lambda: asked.append(1) or described())
        ctx.game.run(5)
        assert asked == []
        ctx.sensor.get_sensor("a").range = 12.0
        ctx.game.run(2)
        assert asked == [1]
        ctx.record.stop()
