"""The competition that comes with GAMMS: real flags and decoys, towers, both die, pay-offs that add up to 0."""

import pytest

import gamms
from gamms import scenario


@pytest.fixture(scope="module")
def game():
    return scenario.from_gallery("competition")


@pytest.fixture(scope="module")
def result(game):
    return game.play(seed=5)


def of(result, kind):
    return [event for event in result.events if event["kind"] == kind]


def test_the_seed_draws_which_flags_are_real_and_only_the_defenders_know(game):
    drawn = set()
    for seed in range(4):
        with game.build(seed=seed) as ctx:
            real = ctx.game.data["flags"]["real"]
            candidates = ctx.game.facts["candidates"]
            drawn.add(tuple(real))
            assert set(real) < set(candidates)
            assert (len(real), len(candidates)) == (3, 6)
            assert ctx.game.observation("defenders_0")["facts"]["flags"] == tuple(real)
            assert "flags" not in ctx.game.observation("attackers_0")["facts"]
            assert ctx.game.observation("attackers_0")["facts"]["known"] == {}
    assert len(drawn) > 1


def test_a_reset_to_a_seed_is_a_new_game_of_it(game):
    with game.build(seed=1) as ctx, game.build(seed=2) as other:
        ctx.game.run(3)
        ctx.game.reset(seed=2)
        assert ctx.game.data == other.game.data
        assert ctx.game.run(40) == other.game.run(40)


def test_flags_are_found_before_they_are_captured_and_decoys_never_are(result):
    found = {event["node"]: event for event in of(result, "discovered")}
    for event in of(result, "captured"):
        assert found[event["node"]]["real"]
        assert found[event["node"]]["turn"] <= event["turn"]
    assert len(of(result, "captured")) >= 1


def test_who_is_tagged_captures_nothing_and_both_are_out(result):
    tags = {(event["turn"], event["agent"], event["other"]) for event in of(result, "tag")}
    assert tags
    assert all((turn, other, agent) in tags for turn, agent, other in tags)
    tagged = {(turn, agent) for turn, agent, _ in tags}
    assert not tagged & {(event["turn"], event["agent"]) for event in of(result, "captured")}


def test_an_attacker_comes_back_once_after_20_turns(result):
    out = [(event["turn"], event["agent"]) for event in of(result, "eliminated")]
    back = [(event["turn"], event["agent"]) for event in of(result, "respawned") if "attackers" in event["agent"]]
    assert back
    assert len({agent for _, agent in back}) == len(back)
    assert all((turn - 20, agent) in out for turn, agent in back)


def test_pay_offs_add_up_to_0_and_follow_from_the_events(result):
    expected = len(of(result, "discovered")) + 10 * len(of(result, "captured"))
    assert result.scores == {"attackers": expected, "defenders": -expected}


def test_towers_see_along_lines_of_sight_only(game):
    with game.build(seed=1) as ctx:
        towers = {name: one for name, one in ctx.agent.get_agent("defenders_0").sensors.items() if "tower" in name}
        assert len(towers) == 2
        for tower in towers.values():
            in_reach = list(ctx.graph.graph.get_nodes(300, *tower.at[:2]))
            assert 0 < len(tower.coverage().node_ids) < 0.8 * len(in_reach)


def test_the_baselines_beat_one_that_walks_at_random(game):
    walk = gamms.strategies.random_walk
    assert game.play(seed=1, strategies={"defenders": walk}).winner == "attackers"
    short = game.replace(**{"rules.time_limit.with.turns": 150})  # by then attackers that look have all flags
    assert short.play(seed=1, strategies={"attackers": walk}).winner == "defenders"
