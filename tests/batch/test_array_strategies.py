"""Strategies that are written in arrays alone play the same in games alone and in batches."""

from functools import partial

import numpy as np
import pytest
from batch_scenes import WALK, assert_as_alone, assert_as_played, by_another_plan, check_games, plain, scene

import gamms
from gamms import strategies
from gamms.errors import BadType, BadValue
from gamms.game.plan import find_first_called

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
def test_a_strategy_cannot_write_into_its_view(name):
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
        is_own = name not in ("games", "agents")  # what a learner observes is its own; whom it observes is not
        assert getattr(games.observe("red"), name).flags.writeable == is_own


def test_it_may_look_at_what_some_of_its_sensors_show(same_as_one_by_one):
    sensors = {"near": {"type": "AGENT_RANGE", "sensor_range": 12.0}, "all": {"type": "AGENT"}}
    teams = {name: {**team, "sensors": ["near", "all"]} for name, team in SEEING["teams"].items()}
    same_as_one_by_one(scene(sensors=sensors, teams=teams), [1, 2], {"red": wary})


def test_it_plays_in_games_to_which_a_rule_adds_a_rule():
    scenario = by_another_plan(scene(**SEEING))
    with scenario.batch(2, seed=3, strategies={"red": hunt}) as games:
        assert find_first_called(games.game, games.roster) == "the rule 'part'"
        games.run()
        assert games.is_in_arrays
        assert plain(games.result(1)) == plain(scenario.play(seed=4, strategies={"red": hunt}))


def test_it_knows_who_is_alive(same_as_one_by_one):
    @gamms.array_strategy
    def count(view):
        return np.minimum(view.living.sum(axis=1)[:, None] % view.counts, view.counts - 1)

    same_as_one_by_one(scene([OUT]), [1, 2], {"blue": count})


def test_unsupported_calls_of_array_strategies_are_refused():
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
        assert "hunt" in find_first_called(games.game, games.roster)
    same_as_one_by_one(scenario, [1, 2, 3], {"red": hunt})


def test_with_a_time_budget_a_strategy_shares_its_memory_with_an_array_rule():
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
        assert games.is_in_arrays
        assert_as_alone(games, alone)


# -- asking other strategies ------------------------------------------------------------------------------------------

TAG = {"rule": "tag", "with": {"taggers": "red", "tagged": "blue"}}


@gamms.array_strategy
def step_twice(view):
    """Take the last legal node."""
    return view.counts - 1


@pytest.mark.parametrize(
    "asked",
    [
        strategies.stay,
        strategies.random_walk,
        strategies.chase,
        strategies.flee,
        partial(strategies.patrol, nodes=[3, 17, 8]),
        partial(strategies.follow_path, nodes=[3, 17, 8], repeat=True),
        partial(strategies.goto, target=12),
        partial(strategies.random_waypoints, pause=2),
        step_twice,
    ],
)
def test_an_array_strategy_that_asks_another_one_plays_as_that_one(asked):
    @gamms.array_strategy
    def ask(view):
        return view.ask(asked)

    scenario = scene([TAG], **SEEING)
    with scenario.batch(3, strategies={"red": ask}) as games:
        games.run()
        assert not games.detached
        for number, seed in enumerate(games.seeds):
            own = plain(scenario.play(seed=seed, strategies={"red": asked}))
            assert plain(games.result(number)) == own
            assert plain(scenario.play(seed=seed, strategies={"red": ask})) == own


def test_asked_strategies_share_the_numbers_that_agents_draw():
    @gamms.array_strategy
    def mix(view):
        is_bold = view.draw.random() < 0.5
        chosen = np.where(is_bold, view.only(is_bold).ask(strategies.chase), 0)
        rest = view.only(~is_bold).ask(strategies.random_walk)
        assert not rest[is_bold].any()
        return np.where(view.draw.random() < 0.1, 0, np.maximum(chosen, rest))

    scenario = scene([TAG], **SEEING)
    with scenario.batch(9, strategies={"red": mix}) as games:
        games.run()
        assert len({games.result(number).scores["red"] for number in range(9)}) > 1
        assert_as_played(games, scenario, {"red": mix})


def test_asked_strategies_know_which_roads_are_closed():
    def close(ctx):
        """Close two roads for some turns, others in each game."""
        roads = [ctx.seed % 7, 7 + ctx.seed % 5]
        if ctx.game.turn % 4 == 1:
            ctx.graph.close_roads(roads)
        elif ctx.game.turn % 4 == 3:
            ctx.graph.open_roads(roads)

    scenario = scene([TAG], **SEEING)
    for asked in (strategies.chase, strategies.random_walk):

        @gamms.array_strategy
        def ask(view, asked=asked):
            return view.ask(asked)

        found = []
        for strategy in (asked, ask):
            with scenario.build(seed=1, strategies={"red": strategy}) as ctx:
                ctx.game.add(close)
                found.append([plain(one) for one in check_games(ctx, 6)])
        assert found[0] == found[1]


def test_learners_see_what_a_shipped_strategy_would_do():
    scenario = scene([TAG], **SEEING)
    with scenario.batch(4) as games, scenario.batch(4, strategies={"red": strategies.chase}) as own:
        for _ in range(9):
            games.step({"red": games.observe("red").ask(strategies.chase)})
            own.step()
            assert np.array_equal(games.observe("red").node, own.observe("red").node)


def test_a_strategy_that_cannot_be_asked_is_refused():
    def think(state):
        state["action"] = state["legal"][0]

    with scene().batch(2) as games:
        view = games.observe("red")
        with pytest.raises(BadType, match="called agent by agent"):
            view.ask(think)
        with pytest.raises(BadType, match="intercept, which is called agent by agent"):
            view.ask(strategies.intercept)
        with pytest.raises(BadType, match="A strategy must be a function"):
            view.ask(7)
    late = {**SEEING, "sensors": {"near": {"type": "AGENT_RANGE", "sensor_range": 25.0, "delay_turns": 1}}}
    with scene(**late).batch(2) as games, pytest.raises(BadValue, match="neither err nor report late"):
        games.observe("red").ask(strategies.chase)
    fast = {"red": {"count": 2, "speed": 3.0}}
    with scene(teams=fast).batch(2) as games, pytest.raises(BadValue, match="along one edge a turn"):
        games.observe("red").ask(strategies.random_walk)


@pytest.mark.parametrize("target", [-1, 9, 1 << 40])
@pytest.mark.parametrize("speed", [None, 2])
def test_targets_that_are_no_nodes_are_refused_with_their_bounds(target, speed):
    @gamms.array_strategy
    def wild(view):
        return view.towards(np.full(view.node.shape, target))

    with gamms.create_context(seed=1, logger_config={"level": "CRITICAL"}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 3))
        ctx.agent.create_agent("a", start_node_id=0, strategy=wild, **({} if speed is None else {"speed": speed}))
        for play in (ctx.game.step, lambda: ctx.game.batch(2).run(2)):
            with pytest.raises(BadValue, match=f"targets: {target} is out of range; the 9 nodes are numbered from 0"):
                play()


def test_flows_of_earlier_builds_say_what_to_use():
    with gamms.create_context(seed=1, logger_config={"level": "CRITICAL"}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 3))
        ctx.agent.create_agent("a", start_node_id=0, team="red")
        with ctx.game.batch(1) as games, pytest.raises(AttributeError, match=r"'flows'. Use .*GamesFilter"):
            games.observe("red").flows()
