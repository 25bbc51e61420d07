"""Strategies that are written in arrays alone play the same in games alone and in batches."""

import numpy as np
import pytest
from batch_scenes import BEYOND, WALK, assert_as_alone, beyond_core, plain, scene

import gamms
from gamms.errors import BadType, BadValue

OUT = {"rule": "tag", "with": {"taggers": "red", "tagged": "blue", "then": "eliminate"}}
SEEING = {
    "sensors": {"near": {"type": "AGENT_RANGE", "sensor_range": 25.0}},
    "teams": {
        team: {"count": 3, "strategy": "gamms.strategies:random_walk", "sensors": ["near"]} for team in ("red", "blue")
    },
}


@gamms.array_strategy
def hunt(view):
    """Go to an enemy in sight in every second turn; walk at random in the others."""
    actions, seen = view.draw.below(view.counts), view.enemies()
    kept = view.keep("turns", lambda games: {"asked": np.zeros((games, 6), np.int64)})
    asked = kept["asked"][np.ix_(view.games, view.agents)]
    kept["asked"][np.ix_(view.games, view.agents)] = asked + view.mask
    hunts = asked[seen.at, seen.viewers] % 2 == 0
    at, viewers = seen.at[hunts], seen.viewers[hunts]
    towards = view.routes().actions(view.node[at, viewers], seen.nodes[hunts])
    actions[at, viewers] = np.maximum(towards, 0)
    again = view.only(actions == 0)
    return np.where(again.mask, again.draw.below(view.counts), actions)


def test_an_array_strategy_plays_the_same_alone_and_in_batches(same_as_one_by_one):
    tag = {"rule": "tag", "with": {"taggers": "red", "tagged": "blue"}}
    same_as_one_by_one(scene([tag], **SEEING), [1, 2, 3], {"red": hunt})


@gamms.array_strategy
def wary(view):
    """Stay while an agent is near, whatever else is far away."""
    near = view.seen("near")
    return np.where(np.bincount(near.at * 3 + near.viewers, minlength=view.node.size).reshape(view.node.shape), 0, 1)


@pytest.mark.parametrize("name", ["games", "agents", "node", "mask", "turn", "counts"])
def test_it_cannot_write_into_what_it_is_shown(name):
    @gamms.array_strategy
    def write(view):
        getattr(view, name).fill(0)
        return view.draw.below(view.counts)

    with pytest.raises(ValueError, match="read-only"):
        scene().play(seed=1, strategies={"red": write})
    with scene().batch(2, strategies={"red": write}) as games, pytest.raises(ValueError, match="read-only"):
        games.step()
    with scene().batch(2) as games:
        games.step()
        assert getattr(games.observe("red"), name).flags.writeable, "what a learner observes is its own"


def test_it_may_look_at_what_some_of_its_sensors_show(same_as_one_by_one):
    sensors = {"near": {"type": "AGENT_RANGE", "sensor_range": 12.0}, "all": {"type": "AGENT"}}
    teams = {name: {**team, "sensors": ["near", "all"]} for name, team in SEEING["teams"].items()}
    same_as_one_by_one(scene(sensors=sensors, teams=teams), [1, 2], {"red": wary})


def test_it_plays_in_games_that_have_no_array_form():
    scenario = beyond_core(scene(**SEEING))
    with scenario.batch(2, seed=3, strategies={"red": hunt}) as games:
        assert games.slow == BEYOND
        games.run()
        assert plain(games.result(1)) == plain(scenario.play(seed=4, strategies={"red": hunt}))


def test_it_knows_who_is_alive(same_as_one_by_one):
    @gamms.array_strategy
    def count(view):
        return np.minimum(view.living.sum(axis=1)[:, None] % view.counts, view.counts - 1)

    same_as_one_by_one(scene([OUT]), [1, 2], {"blue": count})


def test_what_it_cannot_do_is_refused():
    with pytest.raises(BadType, match="An array strategy must be a function of a view"):
        gamms.array_strategy(3)

    @gamms.array_strategy
    def hunt(view):
        return view.counts

    with scene().build() as ctx:
        ctx.agent.get_agent("red_0").strategy = hunt
        assert ctx.agent.get_agent("red_0").strategy is not hunt
    too_many = {"red": gamms.array_strategy(lambda view: view.counts)}
    with (
        scene(**SEEING).build(seed=1, strategies=too_many) as ctx,
        pytest.raises(BadValue, match="is not the number of a legal node"),
    ):
        ctx.game.step()
    for legal in ("edges", "any"):  # where numbers so large are no aims of agents with speeds
        far = {"red": gamms.array_strategy(lambda view: view.counts + (1 << 33))}
        with (
            scene(settings={"legal": legal}).batch(1, strategies=far) as games,
            pytest.raises(BadValue, match="is not the number of a legal node"),
        ):
            games.step()


def test_a_function_beside_the_form_is_refused():
    with pytest.raises(BadType, match=r"array_strategy takes neither of= .* pass the array function itself"):
        gamms.array_strategy(of=lambda state: None)
    with pytest.raises(BadType, match=r"array_rule takes neither of= .* pass the array function itself"):
        gamms.array_rule(of=lambda ctx: None, begins=lambda ctx, arrays: {})
    with pytest.raises(BadType, match="must be a function of a turn"):
        gamms.array_rule(lambda turn, ends: None)


def test_forms_that_remember_outside_of_their_games_are_refused():
    calls, turns = [], {"storm": 0}

    @gamms.array_strategy
    def last(view):
        calls.append(1)
        return view.counts - 1

    @gamms.array_rule
    def storm(turn):
        turns["storm"] += int(turn.turn.max()) > 2

    games = scene().batch(2, strategies={"red": last})
    with games, pytest.raises(BadValue, match=r"variable 'calls' of last\(\) changed .* view\.keep\("):
        games.step()
    with scene().build(seed=1) as ctx:
        ctx.game.add(storm)
        with (
            ctx.game.batch(2) as games,
            pytest.raises(BadValue, match=r"'turns' of storm\(\) .* turn\.keep\("),
        ):
            games.run()


def test_with_a_time_budget_it_is_asked_game_by_game_in_the_core(same_as_one_by_one):
    scenario = scene(settings={"time_budget": 60.0}, **SEEING)
    with scenario.batch(2, strategies={"red": hunt}) as games:
        assert games.is_in_arrays
        assert "hunt" in games.slow
    same_as_one_by_one(scenario, [1, 2, 3], {"red": hunt})


def test_with_a_time_budget_it_shares_what_it_keeps_with_an_array_rule():
    @gamms.array_strategy
    def count(view):
        asked = view.keep("asked", lambda games: {"number": np.zeros(games, np.int64)})["number"]
        asked[view.games] += 1
        return np.broadcast_to(asked[view.games][:, None] % view.counts, view.node.shape)

    @gamms.array_rule
    def double(turn):
        turn.keep("asked", lambda games: {"number": np.zeros(games, np.int64)})["number"][turn.games] *= 2

    with scene(settings={"time_budget": 60.0}).build(seed=1, strategies={"red": count}) as ctx:
        ctx.game.add(double)
        with ctx.game.batch(2) as games, ctx.game.fork(0).ctx as alone:
            games.run()
            assert_as_alone(games, alone)


@gamms.array_strategy
def head_on(view):
    """Go towards nodes that change from turn to turn, by some nodes alone in some turns, and keep how often."""
    asked = view.keep("asked", lambda games: {"number": np.zeros(games, np.int64)})["number"]
    asked[view.games] += 1
    targets = (view.node * 0 + view.agents * 5 + asked[view.games][:, None] * 3) % 25
    allowed = np.arange(25) % 7 != 3
    ways = view.towards(targets, allowed=allowed if (asked[view.games] % 2).all() else None)
    return np.where(ways < 0, 0, ways)


@pytest.mark.parametrize(
    ("speed", "settings"),
    [(2.5, {}), (0.7, {"order": [["blue"], ["red"]]}), (14.0, {"speed_unit": "metres"})],
    ids=["edges", "parts", "metres"],
)
def test_strategies_of_agents_with_speeds_go_towards_nodes_in_each_game(speed, settings):
    teams = {"red": {"count": 3, "strategy": WALK, "speed": speed}, "blue": {"count": 2, "strategy": WALK}}
    tag = {"rule": "tag", "with": {"taggers": "red", "tagged": "blue"}}
    made = scene([tag], teams=teams, settings=settings).build(seed=1, strategies={"red": head_on})
    with made as ctx, ctx.game.batch(seeds=[3, 4]) as games, ctx.game.fork(0).ctx as alone:
        games.step()
        games.run()
        assert games.is_in_arrays, games.slow
        assert_as_alone(games, alone)
