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


def test_an_infection_reaches_people_within_its_radius_only():
    game = scenario.from_gallery("epidemic")
    rule = {
        "rules.0.with.chance": 1.0,
        "teams.healthy.count": 2,
        "teams.infected.count": 1,
        "teams.vaccinators.count": 1,
    }
    with game.replace(**rule).build(seed=1) as ctx:
        for agent in ctx.game.agents:
            agent.register_strategy(stay)
        places = {"infected_0": 0, "healthy_0": 1, "healthy_1": 3, "vaccinators_0": 200}
        for name, node in places.items():
            ctx.agent.get_agent(name).current_node_id = node  # nodes are 10 metres apart
        ctx.game.step()
        assert {agent.name: agent.team for agent in ctx.game.agents} == {
            "healthy_0": "infected",
            "healthy_1": "healthy",
            "infected_0": "infected",
            "vaccinators_0": "vaccinators",
        }
        ctx.agent.get_agent("vaccinators_0").current_node_id = 3
        ctx.game.run(19)
        assert {agent.team for agent in ctx.agent.create_iter()} == {"infected", "immune", "vaccinators"}
        assert ctx.agent.get_agent("healthy_1").team == "immune"
        assert ctx.agent.get_agent("infected_0").team == "immune", "the infection is over"


def test_fire_spreads_to_all_trees_beside_it_that_no_firefighter_has_reached():
    with scenario.from_gallery("firefighters").build(seed=1) as ctx:
        game = ctx.game
        start = set(game.data["forest"]["burning"])
        beside = {node for tree in start for node in ctx.graph.get_neighbors(tree)}
        game.run(2)
        assert set(game.data["forest"]["burning"]) == start
        game.step()
        protected = set(game.data["forest"]["protected"])
        assert set(game.data["forest"]["burning"]) == start | (beside - protected)
        game.run()
        assert not protected & set(game.data["forest"]["burning"]), "a tree stays protected"


def test_people_believe_the_first_rumor_that_they_hear():
    with scenario.from_gallery("rumors").build(seed=3) as ctx:
        result = ctx.game.run()
        heard = {}
        for message in result.messages:
            for name, turn in message["heard"].items():
                heard.setdefault((name, turn), set()).add(message["body"])
        first = {name: min(turn for other, turn in heard if other == name) for name, _ in heard}
        assert sum(result.scores.values()) == len(result.deeds) == len({deed["agent"] for deed in result.deeds})
        for deed in result.deeds:
            assert deed["what"] in heard[deed["agent"], first[deed["agent"]]]
            assert deed["turn"] == first[deed["agent"]]


def test_people_whose_neighbors_are_like_them_stay_and_others_move():
    with scenario.from_gallery("segregation").build(seed=2) as ctx:
        before = {}
        for agent in ctx.game.agents:
            seen = [name.split("_")[0] for name in agent.get_state()["sensor"]["neighbors"][1]]
            before[agent.name] = seen.count(agent.team) >= 0.45 * len(seen)
        ctx.game.step()
        moved = {name: move.start != move.end for name, move in ctx.game.moves.items()}
        assert not any(moved[name] for name, is_content in before.items() if is_content)
        assert sum(moved.values()) > 10
        at_first = ctx.game.scores["alike"]
        assert ctx.game.run().scores["alike"] > at_first + 20


def test_selfish_drivers_make_fewer_trips_than_drivers_with_a_plan():
    game = scenario.from_gallery("selfish_routing")
    trips = {
        name: sum(game.replace(**{f"teams.{other}.strategy": f"selfish_routing:{name}"}).play(seed=3).scores.values())
        for name, other in (("selfish", "planned"), ("planned", "selfish"))
    }
    assert trips["selfish"] < 0.9 * trips["planned"]


def test_a_meal_gives_energy_to_wolves_and_takes_the_sheep():
    sizes = {"teams.sheep.count": 2, "teams.wolves.count": 1}
    with scenario.from_gallery("wolf_sheep").replace(**sizes).build(seed=1) as ctx:
        for agent in ctx.game.agents:
            agent.register_strategy(stay)
        for name, node in {"sheep_0": 0, "sheep_1": 100, "wolves_0": 100}.items():
            ctx.agent.get_agent(name).current_node_id = node
        ctx.game.step()
        assert ctx.game.data["life"]["energy"] == {"sheep_0": 6 - 1 + 4, "wolves_0": 18 - 1 + 7}
        assert [agent.name for agent in ctx.game.agents] == ["sheep_0", "wolves_0"]


def test_an_animal_with_energy_to_spare_shares_it_with_its_young():
    with scenario.from_gallery("wolf_sheep").build(seed=1) as ctx:
        ctx.game.data["life"]["energy"]["wolves_0"] = 41
        ctx.game.step()
        energy = ctx.game.data["life"]["energy"]
        assert energy["wolves_born_1"] == energy["wolves_0"] >= 20
        assert ctx.agent.get_agent("wolves_born_1").team == "wolves"


NAMES = (
    "collecting",
    "epidemic",
    "firefighters",
    "rumors",
    "segregation",
    "selfish_routing",
    "territory",
    "wolf_sheep",
)


@pytest.mark.parametrize("name", NAMES)
def test_a_game_of_a_batch_is_the_game_alone(name):
    game = scenario.from_gallery(name).replace(max_turns=10)
    with game.batch(2, seed=5) as games:
        games.run(warn=False)
        assert all(games.result(number) == game.play(seed=5 + number) for number in range(2))
