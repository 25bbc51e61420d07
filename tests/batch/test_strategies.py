"""The array forms of strategies do what their scalar forms do, in all games at once."""

import pytest
from batch_scenes import check_games, scene
from hypothesis import given, settings
from hypothesis import strategies as st

import gamms
from gamms.game import IllegalAction
from gamms.game.plan import find_first_called
from gamms.scenario import Scenario
from gamms.strategies import (
    chase,
    first,
    flee,
    follow_path,
    goto,
    mix,
    patrol,
    random_walk,
    random_waypoints,
    stay,
    unblock,
)

TAG = {"rule": "tag", "with": {"taggers": "red", "tagged": "blue"}}


def hunted(map=None, sight=None, **more):
    """A scenario of hunters that see some way, and of others that walk about."""
    teams = {
        "red": {"count": 3, "sensors": ["near"], "strategy": "gamms.strategies:random_walk"},
        "blue": {"count": 3, "sensors": ["near"], "strategy": "gamms.strategies:random_walk"},
    }
    near = {"type": "AGENT_RANGE", "sensor_range": 25.0, **(sight or {})}
    map = map or {"grid": {"width": 7, "height": 6}}
    return Scenario(map=map, teams=teams, sensors={"near": near}, rules=[TAG], max_turns=16, **more)


def test_agents_that_set_no_action_stay_in_arrays_as_alone(same_as_one_by_one):
    strategies = {"red": lambda ctx: chase(ctx, None), "blue": lambda ctx: mix(0.5, unblock(flee(ctx, None)), stay)}
    same_as_one_by_one(hunted(), [1], strategies)
    travel = hunted(sight={"sensor_range": 0.0}, settings={"speed_unit": "metres", "decide": "arrival"})
    travel = travel.replace(**{"teams.red.speed": 23.0, "teams.red.count": 1})  # so that it arrives in some games alone
    same_as_one_by_one(travel, [1, 2], {"red": lambda ctx: mix(0.5, random_walk, chase(ctx, None))})
    assert hunted().play(seed=1, strategies=strategies).errors
    strict = hunted(settings={"on_illegal": "raise"})
    with strict.batch(2, strategies=strategies) as games, pytest.raises(IllegalAction, match=r"not set.*legal are \["):
        games.run()


@pytest.mark.parametrize(("count", "radius"), [(650, 40.0), (40, 1e9)])
def test_any_number_of_agents_chase_and_flee_in_the_core_as_alone(count, radius):
    teams = {
        team: {"count": count, "sensors": ["near"], "strategy": f"gamms.strategies:{strategy}"}
        for team, strategy in (("red", "chase"), ("blue", "flee"))
    }
    near = {"type": "AGENT_RANGE", "sensor_range": radius}
    grid = {"grid": {"width": 30, "height": 30}}  # several agents are at the same x, and on the same node
    scenario = Scenario(map=grid, teams=teams, sensors={"near": near}, rules=[TAG], max_turns=5)
    with scenario.batch(2, seed=5) as games:
        games.run()
        assert not find_first_called(games.game, games.roster)
        for number in range(2):
            assert games.result(number) == scenario.play(seed=5 + number)


def test_agents_on_a_map_without_edges_stay_by_metres():
    scenario = scene(red=1, blue=1, side=1, max_turns=2, settings={"speed_unit": "metres"})
    with scenario.batch(1, strategies={"red": unblock(stay)}) as games:
        games.run()
        assert games.observe("red").counts.tolist() == [[1]]
        assert games.result(0) == scenario.play(seed=0, strategies={"red": unblock(stay)})


def test_strategies_that_call_functions_have_no_array_form():
    with hunted().build(seed=1) as ctx:
        agent = ctx.agent.get_agent("red_1")
        for strategy, slow in {
            goto(ctx, lambda state: 3): "the strategy goto(ctx, <lambda>)",
            first(stay, lambda state: None): "the strategy first(stay, <lambda>)",
        }.items():
            agent.register_strategy(strategy)
            with ctx.game.batch(2) as games:
                assert find_first_called(games.game, games.roster) == slow


@pytest.mark.parametrize("strategy", [gamms.strategies.chase, gamms.strategies.flee])
def test_agents_without_a_team_are_enemies_of_each_other(strategy):
    with gamms.create_context(logger_config={"level": "CRITICAL"}) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(5, 5))
        for number, node in enumerate((0, 12, 24, 3)):
            eyes = ctx.sensor.create_sensor(f"eyes {number}", "agent_range", sensor_range=25.0)
            made = strategy(ctx) if number % 2 else gamms.strategies.random_walk
            ctx.agent.create_agent(f"a{number}", start_node_id=node, sensors=[eyes], strategy=made)
        ctx.game.max_turns = 12
        check_games(ctx, seeds=range(6))


STRATEGIES = {
    "chase": lambda ctx: chase(ctx, otherwise=random_waypoints(ctx, [30, 4, 17], pause=1)),
    "flee": lambda ctx: flee(ctx, otherwise=follow_path(ctx, [40, 3, 3, 12])),
    "patrol": lambda ctx: patrol(ctx, [35, 6, 41, 6]),
    "mix": lambda ctx: mix(0.4, first(chase(ctx, None), goto(ctx, 20)), random_walk),
}
KEYS = ("curr_pos", "sensor", "name", "team", "turn", "legal", "draw", "memory")


def by_hand(make):
    """Return a function that makes the same strategy, called with a plain dict as in a loop of one's own."""

    def make_called(ctx):
        shipped = make(ctx)

        def strategy(state):
            own = {key: state[key] for key in KEYS}
            shipped(own)
            if "action" in own:
                state["action"] = own["action"]

        return strategy

    return make_called


@given(red=st.sampled_from(sorted(STRATEGIES)), blue=st.sampled_from(sorted(STRATEGIES)), seed=st.integers(0, 99))
@settings(max_examples=16, deadline=None)
def test_a_strategy_that_is_called_with_a_plain_dict_decides_as_in_a_batch(red, blue, seed):
    chosen = {"red": STRATEGIES[red], "blue": STRATEGIES[blue]}
    called = {team: by_hand(make) for team, make in chosen.items()}
    with hunted().batch(1, seed=seed, strategies=chosen) as games, hunted().build(seed, strategies=called) as ctx:
        games.run()
        ctx.game.run()
        assert not find_first_called(games.game, games.roster)
        assert games.result(0) == ctx.game.result()
        played = games.context(0)
        for name, agent in ctx.agent.agents.items():
            assert agent.current_node_id == played.agent.get_agent(name).current_node_id
            assert dict(ctx.game.memories.get(name, {})) == dict(played.game.memories.get(name, {}))


@pytest.mark.parametrize("game", [{}, {"speed_unit": "metres"}, {"order": [["blue"], ["red"]]}])
def test_plans_of_arrays_decide_in_a_batch_as_alone(game):
    def plan(team):
        return team.choose(team.draw.below(team.counts))

    with gamms.create_context(seed=1, game=game) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(4, 4))
        for number, team in enumerate(["red", "red", "blue"]):
            ctx.agent.create_agent(f"a{number}", start_node_id=number, team=team, strategy=random_walk)
        ctx.game.command("red", plan, arrays=True)
        with ctx.game.batch(3) as games:
            games.run(5)
            found = [games.result(number) for number in range(3)]
        for number in range(3):
            ctx.game.reset(seed=number)
            assert ctx.game.run(5) == found[number]
        assert {found[number].agents["a0"]["node"] for number in range(3)} != {0}
