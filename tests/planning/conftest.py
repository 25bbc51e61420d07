"""A small game of tag for planners."""

import pytest

import gamms
from gamms.scenario import Scenario


def walk(state):
    state["action"] = state["draw"].choice(state["legal"])


@pytest.fixture
def tag():
    """A scenario: two reds on a grid of 6 x 6 nodes, who see ten metres far, tag two blues."""
    eyes = {"type": "AGENT_RANGE", "sensor_range": 10}
    team = {"sensors": ["eyes"], "strategy": "gamms.strategies:random_walk"}
    return Scenario(
        seed=3,
        map={"grid": {"width": 6, "height": 6}},
        sensors={"eyes": eyes},
        teams={
            "red": {"agents": [{"name": "ann", "node": 0}, {"name": "amy", "node": 5}], **team},
            "blue": {"agents": [{"name": "bob", "node": 33}, {"name": "cat", "node": 35}], **team},
        },
        rules=[{"rule": "tag", "with": {"taggers": "red", "tagged": "blue", "then": "eliminate"}}, "last_team"],
        max_turns=30,
    )


@pytest.fixture
def line():
    """A context of five nodes in a row, on which ann of the team red may tag bob of the team blue."""
    with gamms.create_context(seed=1, logger_config={"level": "ERROR"}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(5, 1))
        for name, team, node in (("ann", "red", 0), ("bob", "blue", 4)):
            eyes = ctx.sensor.create_sensor(f"eyes of {name}", "agent_range", sensor_range=100.0)
            ctx.agent.create_agent(name, start_node_id=node, team=team, sensors={"eyes": eyes}, strategy=walk)
        ctx.game.add(gamms.rules.tag("red", "blue"))
        yield ctx
