"""A pool of strategies: each team plays one member in each game, drawn by the seed, alone as in batches."""

import json
import pickle
from collections import Counter

import numpy as np
import pytest

import gamms
from gamms import array_strategy, experiment
from gamms.errors import BadType, BadValue
from gamms.game.plan import find_first_called
from gamms.scenario import Scenario, ScenarioError, load
from gamms.strategies import chase, first, flee, mix, patrol, pool, random_walk, random_waypoints, stay

SEEDS = range(14)


def scene(**changes):
    """Two teams of two agents who see each other on a grid."""
    team = {"count": 2, "sensors": ["eyes"], "strategy": "gamms.strategies:random_walk"}
    given = {
        "map": {"grid": {"rows": 5, "columns": 5}},
        "sensors": {"eyes": {"type": "AGENT_RANGE", "range_m": 25}},
        "teams": {"red": team, "blue": team},
        "rules": [{"rule": "tag", "with": {"taggers": "red", "tagged": "blue"}}],
        "max_turns": 12,
    }
    return Scenario(**{**given, **changes})


@array_strategy
def to_last(view):
    """Go to the last legal node."""
    return view.counts - 1


@array_strategy
def to_any(view):
    """Go to a random legal node."""
    return view.draw.below(view.counts)


def to_first(state):
    """Go to the first neighbor."""
    state["action"] = state["legal"][-1] if state["turn"] % 2 else state["legal"][0]


def round_trip(ctx):
    return patrol(ctx, [0, 12, 4])


def chase_or_rest(ctx):
    return first(chase(ctx, otherwise=None), mix(0.5, random_waypoints(ctx), stay))


SHIPPED = [chase, flee, stay, round_trip, chase_or_rest]
KINDS = {
    "shipped": (SHIPPED, {}),
    "of arrays": ([to_last, to_any], {}),
    "plain": ([to_first, stay], {}),
    "all kinds": ([chase, to_any, to_first, round_trip], {}),
    "in a pool": ([pool([chase, stay]), pool([random_walk, flee])], {}),
    "by speeds": ([random_waypoints, stay, random_walk], {"speed": 2.0}),
    "by metres": ([random_waypoints, stay, random_walk], {"speed": 13.0}),
}


@pytest.mark.parametrize("kind", KINDS)
def test_a_pool_plays_the_same_games_alone_and_in_a_batch(kind):
    members, of_team = KINDS[kind]
    given = scene().to_dict()
    changes = {"teams": {name: {**team, **of_team} for name, team in given["teams"].items()}}
    if kind == "by metres":
        changes["settings"] = {"speed_unit": "metres"}
    game = scene(**changes)
    both = {"red": pool(members), "blue": pool(members[::-1])}
    with game.batch(seeds=SEEDS, strategies=both) as games:
        games.run()
        found = [games.result(number) for number in range(len(SEEDS))]
    alone = [game.play(seed=seed, strategies=both) for seed in SEEDS]
    assert found == alone
    assert [one.provenance["opponents"] for one in found] == [one.provenance["opponents"] for one in alone]
    assert len({tuple(one.provenance["opponents"].items()) for one in found}) > 1


def test_the_core_plays_a_pool_of_shipped_strategies():
    with scene().batch(seeds=SEEDS, strategies={"blue": pool(SHIPPED)}) as games:
        assert find_first_called(games.game, games.roster) is None


@pytest.mark.parametrize("members", [SHIPPED, [to_last, to_any], [chase, to_first]], ids=["shipped", "arrays", "mixed"])
def test_a_team_plays_the_game_of_the_member_that_it_has_drawn(members):
    blue = pool({str(number): one for number, one in enumerate(members)})
    for seed in SEEDS:
        played = scene().play(seed=seed, strategies={"blue": blue})
        member = members[int(played.provenance["opponents"]["blue"])]
        assert played == scene().play(seed=seed, strategies={"blue": member})


def test_teams_draw_apart_and_weights_are_probabilities():
    both = dict.fromkeys(("red", "blue"), pool([stay, random_walk, flee], weights=[1, 0, 3]))
    with scene(max_turns=1).batch(400, strategies=both) as games:
        games.run()
        rows = [games.result(number).row() for number in range(400)]
        table = games.table()
    pairs = Counter((row["opponent.red"], row["opponent.blue"]) for row in rows)
    assert table["opponent.red"].tolist() == [row["opponent.red"] for row in rows]
    assert pairs.keys() == {(a, b) for a in ("stay", "flee") for b in ("stay", "flee")}
    assert all(abs(pairs[a, b] / 400 - x * y) < 0.1 for a, x in WEIGHTS for b, y in WEIGHTS)


WEIGHTS = (("stay", 0.25), ("flee", 0.75))


def test_games_that_begin_again_draw_again():
    with scene().batch(3, strategies={"blue": pool(SHIPPED)}) as games:
        games.run()
        games.reset(np.array([1]), seeds=[11])
        games.run()
        alone = [scene().play(seed=seed, strategies={"blue": pool(SHIPPED)}) for seed in (0, 11, 2)]
        assert [games.result(number) for number in range(3)] == alone


def test_a_pool_plays_on_several_maps():
    maps = [{"grid": {"rows": 5, "columns": 5}}, {"grid": {"rows": 3, "columns": 9}}]
    members = [chase, stay, random_walk]
    with scene().batch(10, maps=maps, strategies={"blue": pool(members)}) as games:
        games.run()
        for number, map in enumerate(games.maps.tolist()):
            played = scene(map=maps[map]).play(seed=number, strategies={"blue": pool(members)})
            assert games.result(number) == played


def test_a_restored_game_goes_on_with_the_same_member():
    with scene().build(seed=5, strategies={"blue": pool([*SHIPPED, to_first])}) as ctx:
        for _ in range(4):
            ctx.game.step()
        kept = ctx.game.snapshot()
        once = ctx.game.run()
        ctx.game.restore(kept)
        assert ctx.game.run() == once


def test_a_scenario_file_names_a_pool(tmp_path):
    (tmp_path / "own.py").write_text("def wait(state):\n    state['action'] = state['curr_pos']\n")
    members = {"hunter": {"function": "gamms.strategies:chase"}, "own": {"function": "own.py:wait"}}
    named = {"function": "gamms.strategies:pool", "with": {"members": members, "weights": [2, 1]}}
    (tmp_path / "game.json").write_text(json.dumps(scene().replace(**{"teams.blue.strategy": named}).to_dict()))
    game = load(tmp_path / "game.json")
    assert any("references to code" in line for line in game.check())
    names = {game.play(seed=seed).row()["opponent.blue"] for seed in SEEDS}
    assert names == {"hunter", "own"}
    listed = {**named, "with": {"members": [{"function": "gamms.strategies:chase"}, {"function": "own.py:wait"}]}}
    game = scene(folder=tmp_path).replace(**{"teams.blue.strategy": listed})
    assert {game.play(seed=seed).row()["opponent.blue"] for seed in SEEDS} == {"chase", "wait"}
    with pytest.raises(ScenarioError, match=r"tag is a rule, and the parameter takes none"):
        wrong = {**named, "with": {"members": [{"function": "gamms.rules:tag", "with": {}}]}}
        scene().replace(**{"teams.blue.strategy": wrong}).check()


def test_a_pool_can_be_sent_to_other_processes():
    sent = pickle.loads(pickle.dumps(pool({"a": chase, "b": round_trip, "c": to_first})))
    assert sent.__name__ == "pool([a, b, c])"
    for seed in (1, 2):
        one, other = (scene().play(seed, {"blue": blue}) for blue in (sent, pool([chase, round_trip, to_first])))
        assert one == other


def test_rows_of_an_experiment_name_the_opponent():
    opponents = {"pool": pool(SHIPPED), "walk": random_walk}
    rows = experiment.run(scene(), SEEDS, {"strategies.blue": opponents})
    drawn = [scene().play(seed, {"blue": pool(SHIPPED)}).row()["opponent.blue"] for seed in SEEDS]
    assert [row["opponent.blue"] for row in rows if row["strategies.blue"] == "pool"] == drawn
    assert not any("opponent.blue" in row for row in rows if row["strategies.blue"] == "walk")


def test_members_of_one_name_are_numbered():
    def again(ctx):
        return chase(ctx)

    again.__name__ = "chase"
    assert pool([chase, again, chase]).__name__ == "pool([chase, chase 2, chase 3])"
    with gamms.create_context() as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(2, 2))
        assert pool([chase(ctx), patrol(ctx, [0])]).__name__ == "pool([chase, patrol([0])])"


@pytest.mark.parametrize("weights", [[1.0], [-1.0, 2.0], [0.0, 0.0]])
def test_weights_that_are_none_are_refused(weights):
    with pytest.raises(BadValue, match="weights are numbers of at least 0, one for each of 2 members"):
        pool([stay, random_walk], weights=weights)


def test_an_invalid_pool_is_refused():
    with pytest.raises(BadValue, match="A pool needs at least one member"):
        pool([])
    with pytest.raises(BadType, match="members must be a list of strategies"):
        pool(stay)
    with pytest.raises(BadType, match=r"Member '1' of a pool must be a strategy.*not 'chase' \(str\).*write {func"):
        pool([stay, "chase"])
    with pytest.raises(BadType, match=r"Member 'trained' of a pool must be a strategy.*not 3"):
        pool({"rests": stay, "trained": 3})


def test_a_pool_among_members_stands_for_its_members():
    outer = pool({"rest": stay, "inner": pool([chase, flee], weights=[3, 1])})
    with scene(max_turns=1).batch(400, strategies={"blue": outer}) as games:
        found = Counter(games.table()["opponent.blue"].tolist())
    assert found.keys() == {"rest", "chase", "flee"}
    assert all(abs(found[name] / 400 - share) < 0.08 for name, share in (("rest", 0.5), ("chase", 0.375)))
