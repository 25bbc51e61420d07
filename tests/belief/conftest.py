"""Small worlds in which agents look for others."""

import pytest

import gamms
from gamms.sensor import SensorType


def staying(state):
    state["action"] = state["curr_pos"]


@pytest.fixture
def make_ctx():
    """Make a context with nodes 0, 1, … ten apart on a line, and edges (source, target); all end with the test."""
    made = []

    def make(nodes=5, edges=None, **keywords):
        ctx = gamms.create_context(seed=1, logger_config={"level": "CRITICAL"}, **keywords)
        made.append(ctx)
        pairs = [(a, b) for i in range(nodes - 1) for a, b in ((i, i + 1), (i + 1, i))] if edges is None else edges
        ctx.graph.add_nodes(range(nodes), [10.0 * i for i in range(nodes)], [0.0] * nodes)
        if pairs:
            ctx.graph.add_edges(range(len(pairs)), *zip(*pairs, strict=True))
        return ctx

    yield make
    for ctx in made:
        ctx.terminate()


@pytest.fixture
def add():
    """Add an agent with eyes of some range; `strategy` gets what `observe` returns, too."""

    def add(ctx, name, node, team, sight=None, strategy=None, **keywords):
        sensors = {}
        if sight is not None:
            sensors["eyes"] = ctx.sensor.create_sensor(f"eyes of {name}", SensorType.AGENT_RANGE, sensor_range=sight)
        return ctx.agent.create_agent(
            name, start_node_id=node, team=team, sensors=sensors, strategy=strategy or staying, **keywords
        )

    return add
