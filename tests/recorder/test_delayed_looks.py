"""What sensors with a delay are still to report is recorded: replays, states and resumed games have it."""

import io

import pytest

import gamms
from gamms import recorder
from gamms.agent import AgentType
from gamms.recorder.keyframes import capture_state

TURNS = 9


def context():
    """Return a game in which a walker and a drone watch two others through sensors with every error and a delay."""
    ctx = gamms.create_context(seed=5, logger_config={"level": "CRITICAL"})
    ctx.graph.attach_networkx_graph(gamms.graph.grid(6, 6))
    errors = {"position_noise_m": 6.0, "false_alarm_rate": 0.4, "detection": 0.7, "team": "blue"}
    ctx.sensor.create_sensor("eyes", "AGENT_RANGE", sensor_range=40.0, delay_turns=2, **errors)
    ctx.sensor.create_sensor("radar", "AERIAL_AGENT", delay_turns=1, **errors)
    for name, node in (("bea", 7), ("bob", 22)):
        ctx.agent.create_agent(name, start_node_id=node, team="blue", strategy=wander)
    ctx.agent.create_agent("ann", start_node_id=14, team="red", sensors=["eyes"], strategy=follow)
    drone = ctx.agent.create_agent("drone", start_node_id=14, team="red", type=AgentType.AERIAL, speed=5.0)
    drone.position = (20.0, 20.0, 9.0)
    drone.register_sensor("radar", ctx.sensor.get_sensor("radar"))
    drone.register_strategy(follow)
    return ctx


def wander(state):
    state["action"] = min(state["legal"]) if state["turn"] % 3 else max(state["legal"])


def follow(state):
    (seen,) = [data for _, data in state["sensor"].values()]
    state["memory"].setdefault("seen", []).append(
        {name: list(seen[name]) if "radar" in state["sensor"] else seen[name] for name in seen}
    )
    if state["legal"]:
        state["action"] = max(state["legal"]) if len(seen) > 1 else min(state["legal"])


def play(ctx, turns=TURNS, **keywords):
    stream = io.BytesIO()
    with ctx:
        ctx.record.start(stream)
        ctx.game.run(turns, **keywords)
        ctx.record.stop()
    return stream.getvalue()


def opened(data):
    return recorder.open(io.BytesIO(data))


def test_a_recorded_replay_has_the_same_bytes_and_the_looks_of_each_turn():
    game = play(context())
    with gamms.create_context(logger_config={"level": "CRITICAL"}) as ctx:
        stream = io.BytesIO()
        ctx.record.start(stream)
        state = ctx.game.internals.state
        looks = [dict(state.delayed_looks) for _ in ctx.record.replay(io.BytesIO(game))]
        ctx.record.stop()
    assert stream.getvalue() == game
    assert looks[-1].keys() == {("eyes", "ann"), ("radar", "drone")}
    assert [*looks[-1]["eyes", "ann"]] == [TURNS - 3, TURNS - 2, TURNS - 1]


@pytest.fixture(scope="module")
def game():
    return opened(play(context()))


def test_a_game_without_delays_has_no_word_of_them():
    with context() as ctx:
        for name in ("eyes", "radar"):
            ctx.sensor.get_sensor(name).notice.delay_turns = None
        assert "delayed_looks" not in capture_state(ctx)
        data = play(ctx)
    assert "DELAYED_LOOKS" not in {event["kind"] for event in opened(data).events()}
