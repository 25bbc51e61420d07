"""Headings in games: an agent that stays looks where it looked before, and in the program's own loop all around."""

import pytest

import gamms
from gamms.sensor import SensorType

EAST, NORTH = (1.0, 0.0), (0.0, 1.0)


def walk(*nodes):
    def strategy(state):
        state["action"] = nodes[state["turn"]]

    return strategy


@pytest.fixture
def ctx():
    """A grid of 3 x 3 nodes with a guard in the middle, which sees what is ahead."""
    with gamms.create_context(seed=1, logger_config={"level": "CRITICAL"}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 3))
        ctx.sensor.create_sensor("ahead", SensorType.ARC, sensor_range=20.0, fov=1.0)
        ctx.agent.create_agent("guard", start_node_id=3, sensors=["ahead"], strategy=walk(4, 4, 4, 7, 7))
        yield ctx


def seen(ctx):
    return sorted(ctx.agent.get_agent("guard").get_state()["sensor"]["ahead"][1]["nodes"])


def test_an_agent_that_never_moved_sees_all_around(ctx):
    ctx.agent.get_agent("guard").strategy = gamms.strategies.stay
    ctx.game.run(3)
    assert ctx.agent.get_agent("guard").orientation == (0.0, 0.0)
    assert len(seen(ctx)) == 7


def test_an_agent_that_is_blocked_keeps_its_heading_and_one_that_is_put_back_has_none(ctx):
    guard = ctx.agent.get_agent("guard")
    ctx.agent.create_agent("wall", start_node_id=7, strategy=gamms.strategies.stay)
    ctx.game.conflicts = gamms.rules.Conflicts(capacity=1, resolve=lambda contest, ctx: [])
    for _ in range(5):
        ctx.game.step()
    assert (guard.current_node_id, guard.orientation) == (4, EAST)
    ctx.game.respawn("guard")
    assert guard.orientation == (0.0, 0.0)


def test_a_heading_that_was_set_stays_and_taken_back_it_is_that_of_the_last_move(ctx):
    guard = ctx.agent.get_agent("guard")
    ctx.game.step()
    guard.orientation = (0, -1)
    ctx.game.step()
    assert guard.orientation == (0.0, -1.0)
    guard.orientation = None
    ctx.game.step()
    assert guard.orientation == EAST


def test_in_the_programs_own_loop_an_agent_that_stays_sees_all_around_as_in_version_1(ctx):
    headings = []
    for node in (4, 4, 7):
        for agent in ctx.agent.create_iter():
            state = agent.get_state()
            state["action"] = node
            agent.set_state()
            headings.append((agent.orientation, agent.prev_node_id))
    assert headings == [(EAST, 3), ((0.0, 0.0), 4), (NORTH, 4)]


def test_snapshots_forks_and_recordings_keep_the_headings_of_agents_that_stay(ctx, tmp_path):
    ctx.record.start(tmp_path / "game")
    for _ in range(2):
        ctx.game.step()
    here = ctx.game.snapshot()
    ctx.game.step()
    ctx.record.stop()
    ctx.game.run(2)
    ctx.game.restore(here)
    path = tmp_path / "game.ggr"
    with ctx.game.fork(1).ctx as fork, gamms.create_context(logger_config={"level": "CRITICAL"}) as replayed:
        for _ in replayed.record.replay(path):
            pass
        for one in (ctx, fork, replayed):
            assert (one.agent.get_agent("guard").orientation, seen(one)) == (EAST, [4, 5])
    with gamms.recorder.open(path) as recording:
        assert [recording.state(turn).agents["previous"].tolist() for turn in range(4)] == [[3]] * 4
        assert recording.table("moves")["turn"].tolist() == [1]
