"""The rules of capture the flag, on a straight road: red's half is left, blue's half is right."""

from collections import Counter

import pytest

import gamms
from gamms.demo import Match, Team, play
from gamms.demo.rules import end_rule, flag_rule, tag_rule

NODES = 60
TEAMS = (Team("red", 1, (213, 94, 0)), Team("blue", 1, (0, 114, 178)))


def quiet(**keywords):
    return gamms.create_context(logger_config={"level": "CRITICAL"}, **keywords)


@pytest.fixture
def match():
    with quiet(seed=3) as ctx:
        ctx.graph.add_nodes(range(NODES), [10.0 * i for i in range(NODES)], [0.0] * NODES)
        there, back = range(NODES - 1), range(1, NODES)
        ctx.graph.add_edges(range(2 * (NODES - 1)), [*there, *back], [*back, *there])
        yield Match(ctx, TEAMS, max_turns=10)


def put(match, **places):
    """Stand agents on a node of somebody's territory: ('own' | 'enemy', how far from the border)."""
    for name, (whose, steps) in places.items():
        agent = match.ctx.agent.get_agent(f"{name}_0")
        team = agent.team if whose == "own" else 1 - agent.team
        border = sorted(node for node, side in match.world.side.items() if side == team)
        border = border[::-1] if border[0] == 0 else border
        agent.current_node_id = border[steps]


def kinds(match):
    return [event["kind"] for event in match.events]


def test_an_intruder_met_by_a_defender_is_sent_home(match):
    put(match, red=("enemy", 3), blue=("own", 3))
    tag_rule(match)
    red, blue = match.agents
    assert red.current_node_id == red.prev_node_id == match.start_of["red_0"]
    assert match.world.side[blue.current_node_id] == blue.team
    assert kinds(match) == ["tag"]


def test_nobody_is_tagged_at_home_or_from_afar(match):
    put(match, red=("own", 3), blue=("own", 3))
    tag_rule(match)
    put(match, red=("enemy", 3), blue=("own", 5))
    tag_rule(match)
    assert match.events == []


def test_two_that_meet_across_the_border_stay(match):
    put(match, red=("own", 0), blue=("own", 0))
    tag_rule(match)
    assert match.events == []


def test_a_flag_is_taken_on_its_node_and_scores_at_home(match):
    red = match.agents[0]
    red.current_node_id = match.world.flag[1]
    flag_rule(match)
    assert match.announced.carriers == {1: "red_0"}
    put(match, red=("own", 0))
    flag_rule(match)
    assert match.scores == [1, 0]
    assert match.announced.carriers == {}
    assert kinds(match) == ["take", "capture"]


def test_a_tagged_carrier_loses_the_flag(match):
    red = match.agents[0]
    red.current_node_id = match.world.flag[1]
    flag_rule(match)
    match.agents[1].current_node_id = red.current_node_id
    tag_rule(match)
    assert match.announced.carriers == {}
    assert kinds(match) == ["take", "tag", "save"]


def test_the_game_ends_with_enough_captures_or_time(match):
    end_rule(match)
    assert not match.reason
    match.turn = 10
    end_rule(match)
    assert match.reason == "time is up"
    match.scores[1] = 3
    end_rule(match)
    assert match.reason == "3 captures"
    assert match.winner == "blue"


def test_a_map_in_two_pieces_is_refused():
    with quiet() as ctx:
        ctx.graph.add_nodes(range(NODES), range(NODES), [0.0] * NODES)
        with pytest.raises(ValueError, match="cannot be reached"):
            Match(ctx, TEAMS, max_turns=1)


@pytest.fixture(scope="module")
def helsinki(tmp_path_factory):
    path = tmp_path_factory.mktemp("map") / "helsinki-10m.gamms"
    with quiet() as ctx:
        gamms.osm.helsinki(ctx)
        ctx.graph.save(path)
    return path


def test_each_side_wins_at_least_20_of_100_games(helsinki):
    teams = (Team("red", 5, (213, 94, 0)), Team("blue", 5, (0, 114, 178)))
    winners = Counter()
    for seed in range(100):
        with quiet(seed=seed) as ctx:
            ctx.graph.load(helsinki)
            winners[play(ctx, teams, max_turns=600).winner] += 1
    assert winners["red"] >= 20, winners
    assert winners["blue"] >= 20, winners


def test_both_engines_play_the_same_game(helsinki):
    teams = (Team("red", 4, (213, 94, 0)), Team("blue", 4, (0, 114, 178)))
    games = []
    for engine in gamms.graph.Engine:
        with quiet(seed=9, graph_engine=engine) as ctx:
            ctx.graph.load(helsinki)
            match = play(ctx, teams, max_turns=120)
            games.append((match.events, [agent.current_node_id for agent in match.agents]))
    assert games[0] == games[1]
