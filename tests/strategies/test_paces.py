"""How long agents take for a distance."""

from math import inf

import pytest

import gamms
from gamms.strategies.paces import count_turns, find_pace


@pytest.mark.parametrize(
    ("far", "speed", "turns"), [(10.0, 4.0, 2.5), (0.0, 0.0, 0.0), (3.0, 0.0, inf), (inf, 2.0, inf), (inf, inf, inf)]
)
def test_a_distance_takes_its_turns_at_a_speed(far, speed, turns):
    assert count_turns(far, speed) == turns


@pytest.mark.parametrize(
    ("unit", "pace"), [("edges", (None, 2.5)), ("metres", ("length", 2.5)), ("metres_per_second", ("length", 10.0))]
)
def test_a_pace_is_the_distance_that_an_agent_covers_in_a_turn(unit, pace):
    with gamms.create_context() as ctx:
        ctx.graph.add_nodes([0], [0.0], [0.0])
        ctx.agent.create_agent("anna", start_node_id=0, speed=2.5)
        ctx.agent.create_agent("bert", start_node_id=0)
        ctx.game.speed_unit, ctx.game.turn_seconds = unit, 4.0
        assert find_pace(ctx, "anna") == (*pace, None)
        assert find_pace(ctx, "bert") == find_pace(ctx, None) == (None, 1.0, None)
