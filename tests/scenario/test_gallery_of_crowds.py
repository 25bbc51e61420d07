"""Facts of gallery games: what spreads, who paints, who carries, which road is fast."""

import pytest

from gamms import scenario
from gamms.strategies import stay


def test_the_last_team_on_a_square_owns_it():
    with scenario.from_gallery("territory").build(seed=2) as ctx:
        robot = ctx.agent.get_agent("red_0")
        square = robot.current_node_id
        ctx.game.step()
        ctx.game.step()
        assert ctx.game.data["owners"][square] == "red"
        for agent in ctx.game.agents:
            agent.register_strategy(stay)
        robot.current_node_id = 0
        rival = ctx.agent.get_agent("blue_0")
        rival.current_node_id = square
        ctx.game.step()
        assert ctx.game.data["owners"][square] == "blue"
        assert sum(ctx.game.scores.values()) == len(ctx.game.data["owners"])


def test_a_robot_carries_two_parcels_and_scores_them_at_its_depot():
    with scenario.from_gallery("collecting").replace(**{"rules.0.with.chance": 0.0}).build(seed=1) as ctx:
        game = ctx.game
        for agent in game.agents:
            agent.register_strategy(stay)
        robot, mate = ctx.agent.get_agent("red_0"), ctx.agent.get_agent("red_1")
        mate.current_node_id = ctx.graph.nearest_node(385900, 6672000)
        here = robot.current_node_id = ctx.graph.nearest_node(386000, 6672000)
        game.data["parcels"] = [here, here, here]
        for carried in (1, 2, 2):
            game.step()
            assert game.data["loads"] == {"red_0": carried}
        assert game.data["parcels"] == [here]
        robot.current_node_id = ctx.graph.nearest_node(385850, 6672250)
        game.step()
        assert game.scores["red"] == 2
        assert not game.data["loads"]


@pytest.mark.parametrize("name", ["collecting", "territory"])
def test_a_game_of_a_batch_is_the_game_alone(name):
    game = scenario.from_gallery(name).replace(max_turns=40)
    with game.batch(3, seed=5) as games:
        games.run(warn=False)
        assert all(games.result(number) == game.play(seed=5 + number) for number in range(3))
