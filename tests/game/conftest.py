"""A 4 x 4 grid of streets in both directions, 10 metres apart; node `4 * row + column`."""

import sys
from pathlib import Path

import pytest

import gamms
from gamms.graph import Engine
from gamms.sensor import SensorType

sys.path.insert(0, str(Path(__file__).parent))  # the tests of games find what they share beside them


def grid(seed=1, engine=Engine.MEMORY, side=4, **settings):
    ctx = gamms.create_context(engine, seed=seed, logger_config={"level": "CRITICAL"}, game=settings)
    ids = range(side * side)
    ctx.graph.add_nodes(ids, [10.0 * (i % side) for i in ids], [10.0 * (i // side) for i in ids])
    pairs = [(i, i + 1) for i in ids if i % side < side - 1] + [(i, i + side) for i in ids if i < side * (side - 1)]
    pairs += [(b, a) for a, b in pairs]
    ctx.graph.add_edges(range(len(pairs)), [a for a, _ in pairs], [b for _, b in pairs])
    return ctx


@pytest.fixture(name="grid")
def make_grid():
    """The function that makes a context with the grid."""
    return grid


@pytest.fixture(name="everything")
def give_everything():
    """Sensors for an agent that looks at all there is."""

    def give(ctx, agent):
        for kind in (SensorType.NEIGHBOR, SensorType.AGENT):
            agent.register_sensor(kind.name, ctx.sensor.create_sensor(f"{agent.name} {kind.name}", kind))
        return agent

    return give


@pytest.fixture(params=list(Engine), ids=lambda engine: engine.name)
def ctx(request):
    with grid(engine=request.param) as ctx:
        yield ctx


@pytest.fixture
def play(ctx):
    """Create an agent that does what a list says, turn by turn, and then stays."""

    def play(name, start, *actions, **kwargs):
        seen = []

        def strategy(state):
            seen.append(state)
            turn = state["turn"]
            state["action"] = actions[turn] if turn < len(actions) else state["curr_pos"]

        agent = ctx.agent.create_agent(name, start_node_id=start, strategy=strategy, **kwargs)
        agent.seen = seen
        return agent

    return play
