"""Where agents start: by the rules of their team, and by draws that do not depend on the numbers of others."""

from itertools import combinations
from math import dist, hypot, inf

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gamms.scenario import Scenario, ScenarioError

WALK = "gamms.strategies:random_walk"


def played_on(width, height, teams, seed=1):
    return Scenario(seed=seed, max_turns=1, map={"grid": {"width": width, "height": height}}, teams=teams)


def places(scenario, seed=None):
    """Agent -> (x, y) of its start."""
    with scenario.build(seed) as ctx:
        nodes = {name: agent.current_node_id for name, agent in ctx.agent.agents.items()}
        return {name: ctx.graph.graph.get_node(node)[1:3] for name, node in nodes.items()}


def of(team, found):
    return [at for name, at in found.items() if name.startswith(team)]


DEMANDS = st.fixed_dictionaries(
    {"count": st.integers(1, 6)},
    optional={"apart": st.sampled_from([0.0, 5.0, 10.0, 14.2, 25.0])},
)
NEAR = st.none() | st.tuples(st.sampled_from([0, 7, [20.0, 20.0]]), st.sampled_from([10.0, 20.0, 40.0]))


@given(
    width=st.integers(2, 8),
    height=st.integers(2, 8),
    red=DEMANDS,
    blue=DEMANDS,
    near=NEAR,
    away=st.none() | st.sampled_from([1.0, 10.0, 30.0]),
    seed=st.integers(0, 99),
)
@settings(max_examples=12)
def test_everybody_is_placed_by_the_rules_or_the_error_says_how_many_fit(width, height, red, blue, near, away, seed):
    if near is not None and (isinstance(near[0], list) or near[0] < width * height):
        red = {**red, "near": near[0], "within": near[1]}
    if away is not None:
        blue = {**blue, "from": {"team": "red", "at_least": away}}
    scenario = played_on(width, height, {"red": red, "blue": blue}, seed)
    try:
        found = places(scenario)
    except ScenarioError as error:
        refusal = error
    else:
        refusal = None
    if refusal is not None:
        assert refusal.path in ("teams.red", "teams.blue")
        assert "agents could be placed" in str(refusal)
        return
    for team, demand in (("red", red), ("blue", blue)):
        at = of(team, found)
        assert len(at) == demand["count"] == len(set(at))
        assert all(dist(*pair) >= demand.get("apart", 0.0) for pair in combinations(at, 2))
    if "near" in red:
        centre = red["near"] if isinstance(red["near"], list) else (red["near"] % width * 10, red["near"] // width * 10)
        assert all(dist(at, centre) <= red["within"] for at in of("red", found))
    nearest = min((dist(a, b) for a in of("red", found) for b in of("blue", found)), default=inf)
    assert nearest >= (away or 0.0)
    assert places(scenario) == found


@given(red=st.integers(1, 8), more=st.integers(1, 8), seed=st.integers(0, 99))
@settings(max_examples=12)
def test_another_number_moves_neither_the_other_team_nor_those_before(red, more, seed):
    few = places(played_on(9, 9, {"red": {"count": red}, "blue": {"count": 3, "apart": 15.0}}, seed))
    many = places(played_on(9, 9, {"red": {"count": red + more}, "blue": {"count": 3, "apart": 15.0}}, seed))
    assert few.items() <= many.items()


def test_agents_may_stand_exactly_as_far_apart_as_is_asked():
    apart = hypot(0.5, 0.5)  # the square of which is rounded up
    teams = {"red": {"count": 2, "apart": apart}}
    scenario = Scenario(max_turns=1, map={"grid": {"width": 2, "height": 2, "spacing": 0.5}}, teams=teams)
    assert dist(*places(scenario).values()) == apart


def test_a_team_that_cannot_be_far_enough_from_another_says_what_to_change():
    teams = {"red": {"count": 1}, "blue": {"count": 2, "from": {"team": "red", "at_least": 999.0}}}
    with pytest.raises(ScenarioError, match=r"at least 999 from red.*Change count or from\."):
        played_on(3, 3, teams).build()


def test_agents_with_a_node_count_for_the_others():
    teams = {"red": {"agents": [{"name": "a", "node": 12}, {"name": "b"}, {"name": "c"}], "apart": 20.0}}
    found = places(played_on(5, 5, teams))
    assert all(dist(*pair) >= 20.0 for pair in combinations(found.values(), 2))
    teams["red"] = {"agents": [{"name": "a", "node": 4}, {"name": "b", "node": 0}], "count": 7}
    assert len(set(places(played_on(3, 3, teams)).values())) == 9


def test_a_seed_decides_and_a_call_may_choose_it():
    scenario = played_on(20, 20, {"red": {"count": 5}})
    assert places(scenario) == places(scenario, seed=1) == places(scenario.replace(seed=7), seed=1)
    assert places(scenario) != places(scenario, seed=2)


def test_agents_by_latitude_stand_on_the_nearest_node():
    helsinki = {"helsinki": {}}
    teams = {"red": {"count": 3, "near": {"lat": 60.1695, "lon": 24.9522}, "within": 60.0}}
    scenario = Scenario(seed=1, map=helsinki, teams=teams)
    with scenario.build() as ctx:
        x, y = ctx.graph.from_latlon(lat=60.1695, lon=24.9522)
        nodes = [ctx.graph.graph.get_node(agent.current_node_id) for agent in ctx.agent.agents.values()]
        assert all(dist((node.x, node.y), (x, y)) <= 120.0 for node in nodes)


def test_degrees_on_a_map_without_them_are_an_error():
    teams = {"red": {"count": 3, "near": {"lat": 60.0, "lon": 25.0}, "within": 60.0}}
    with pytest.raises(ScenarioError, match=r"^teams\.red\.near: .*coordinate reference system"):
        played_on(5, 5, teams).build()


def test_flyers_start_above_their_node():
    drones = {"count": 2, "type": "aerial", "speed": 5.0, "altitude": 30.0}
    with played_on(5, 5, {"drones": drones}).build() as ctx:
        for agent in ctx.agent.agents.values():
            x, y = ctx.graph.graph.get_node(agent.current_node_id)[1:3]
            assert agent.position == (x, y, 30.0)


def test_one_agent_of_a_team_flies():
    kite = {"name": "kite", "node": 6, "type": "aerial", "speed": 5.0, "altitude": 30.0}
    with played_on(5, 5, {"red": {"agents": [{"name": "anna", "node": 7}, kite]}}).build() as ctx:
        x, y = ctx.graph.graph.get_node(6)[1:3]
        assert ctx.agent.get_agent("kite").position == (x, y, 30.0)
        assert ctx.agent.get_agent("anna").current_node_id == 7


def test_agents_by_streets_stand_at_their_junction():
    teams = {
        "red": {"agents": [{"name": "a", "node": "Mannerheimintie & Kaivokatu"}]},
        "blue": {"count": 3, "near": "Kaivokatu", "within": 60.0},
    }
    game = Scenario(map={"helsinki": {}}, teams=teams)
    with game.build(seed=1) as ctx:
        assert ctx.agent.get_agent("a").current_node_id in ctx.graph.find("Kaivokatu").nodes
    for node in ("Manerheimintie", "Mannerheimintie & Liisankatu"):
        with pytest.raises(ScenarioError, match=r"teams\.blue\.near.*(Did you mean 'Mannerheimintie'|do not meet)"):
            game.replace(**{"teams.blue.near": node}).build(seed=1)


def test_roads_of_a_map_are_closed_by_name_and_by_area():
    square = [[385_600, 6_672_050], [385_700, 6_672_050], [385_700, 6_672_150], [385_600, 6_672_150]]
    game = Scenario(map={"helsinki": {}, "closed": ["Kaivokatu", square]}, teams={"red": {"count": 1}})
    with game.build(seed=1) as ctx:
        assert len(ctx.graph.closed_roads) > 100
        assert ctx.graph.inside(square, touching=True).edges == []
        with pytest.raises(KeyError):
            ctx.graph.find("Kaivokatu")
    with pytest.raises(ScenarioError, match=r"item 2 of map\.closed .*Did you mean 'Kaivokatu'"):
        game.replace(**{"map.closed": [square, "Kaivokat"]}).build(seed=1)


def test_agents_with_a_mode_that_start_near_a_place_can_leave_their_nodes():
    team = {"count": 20, "mode": "drive", "near": [385950, 6672200], "within": 150, "speed": 1, "strategy": WALK}
    game = Scenario(seed=1, map={"helsinki": {"osm_type": ["walk", "drive"]}}, teams={"red": team})
    with game.build() as ctx:
        roads = ctx.graph.routes.select_mode("drive")
        assert all(len(roads.neighborhoods[agent.current_node_id]) > 1 for agent in ctx.game.agents)
        with pytest.raises(ScenarioError, match="on nodes that mode drive can leave, within 1 of"):
            game.replace(**{"teams.red.within": 1}).build()
