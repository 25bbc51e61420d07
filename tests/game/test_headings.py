"""Headings in games: an agent that stays looks where it looked before, and in the program's own loop all around."""

import pytest

import gamms
from gamms.sensor import SensorType


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
