"""Games of the gallery in which some chase, guard or look for others keep their rules."""

import pytest

from gamms import belief, scenario


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


def test_the_cops_catch_a_robber_beside_them_before_it_moves():
    with scenario.from_gallery("cops_and_robber").build() as ctx:
        node = ctx.agent.get_agent("robber").current_node_id
        ctx.agent.get_agent("cops_0").current_node_id = max(ctx.graph.distances(source=node, weight=None, cutoff=1))
        result = ctx.game.run()
    assert result.winner == "cops"
    assert [(event["turn"], event["node"]) for event in result.events if event["kind"] == "tag"] == [(1, node)]


def test_every_runner_leaves_or_is_caught_as_none_is_patient_for_ever():
    result = scenario.from_gallery("interception").play()
    assert sum(result.scores.values()) == 5
    assert result.turns > 60, "these runners have waited"


def test_hunters_in_fog_never_exclude_the_node_of_a_deer():
    with scenario.from_gallery("hunt_in_fog").replace(max_turns=30).build() as ctx:
        while not ctx.game.is_over:
            ctx.game.step()
            known = belief.belief_of(ctx, "hunters_0")
            for deer in ctx.agent.teams["deer"]:
                assert deer.current_node_id in known.reachable(deer.name) or not deer.alive


def test_saboteurs_close_bridges_alone_and_these_open_again_after_twenty_turns():
    closed_in, opened_in = {}, {}
    with scenario.from_gallery("sabotage").build() as ctx:
        bridges = {id for id in ctx.graph.get_edges() if ctx.graph.get_edge(id).length > 20}
        while not ctx.game.is_over:
            ctx.game.step()
            closed = set(ctx.graph.closed_roads)
            closed_in.update(dict.fromkeys(closed - closed_in.keys(), ctx.game.turn))
            opened_in.update(dict.fromkeys(closed_in.keys() - closed - opened_in.keys(), ctx.game.turn))
    assert closed_in.keys() <= bridges
    assert opened_in
    assert {opened_in[id] - closed_in[id] for id in opened_in} == {20}


def test_drones_find_a_hiker_but_a_robot_has_to_get_there():
    result = scenario.from_gallery("search_by_drones").play()
    (found,) = [event for event in result.events if event["kind"] == "tag"]
    assert found["agent"].startswith("robot")
    assert result.winner == "searchers"


def test_the_dog_wins_when_fifteen_sheep_are_in_the_pen():
    with scenario.from_gallery("herding").build() as ctx:
        result = ctx.game.run()
        nodes = [ctx.graph.get_node(event["node"]) for event in result.events if event["kind"] == "penned"]
    assert all(node.x**2 + (node.y - 120) ** 2 <= 35**2 for node in nodes)
    assert result.winner == "dogs"
    assert len(nodes) == result.scores["dogs"] >= 15
