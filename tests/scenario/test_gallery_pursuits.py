"""Games of the gallery in which some chase, guard or look for others keep their rules."""

import pytest

from gamms import scenario


def test_mr_x_shows_himself_after_five_turns_and_is_always_where_the_detectives_think_possible():
    with scenario.from_gallery("scotland_yard").build() as ctx:
        mr_x = ctx.agent.get_agent("mr_x")
        known = []
        while not ctx.game.is_over:
            ctx.game.step()
            possible = ctx.game.facts["possible"]
            assert mr_x.current_node_id in possible or ctx.game.turn < 3 or not mr_x.alive
            if len(possible) == 1:
                known.append(ctx.game.turn)
        shown = [event["turn"] for event in ctx.game.result().events if event["kind"] == "shown"]
    assert shown == known == [3, 8, 13, 18, 24]


@pytest.mark.parametrize(("place", "winner"), [((110, 140), "intruder"), ((20, 20), "guards")])
def test_an_intruder_wins_if_no_guard_is_as_near_to_the_target(place, winner):
    with scenario.from_gallery("target_guarding").build() as ctx:
        for name, (x, y) in {"intruder_0": place, "guards_0": (60, 60), "guards_1": (180, 95)}.items():
            ctx.agent.get_agent(name).current_node_id = ctx.graph.nearest_node(x, y)
        assert ctx.game.run().winner == winner
