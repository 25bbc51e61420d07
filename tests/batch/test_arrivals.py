"""Agents that decide where they arrive, in the core: the same games as alone, with any number of threads."""

import numpy as np
import pytest
from batch_scenes import plain, scene
from hypothesis import given, settings
from hypothesis import strategies as st
from test_in_core import random_scenario, scenario_of_steps

from gamms.core.arrivals import Queue

SEEDS = [3, 4, 5, 6]


def at_arrivals(number, *, by_steps):
    """Return a random scenario by metres whose agents decide where they arrive, and their strategies."""
    units = "metres", "metres_per_second"
    scenario, made = scenario_of_steps(number, units) if by_steps else (random_scenario(number, units), None)
    known = scenario.to_dict()
    changes = {"settings": known["settings"] | {"decide": "arrival", "legal": "edges"}}
    if "conflicts" in known:
        edge_capacity = [None, 1, 2][number % 3]
        changes["conflicts"] = known["conflicts"] | {"allow_swaps": True, "edge_capacity": edge_capacity}
    return scenario.replace(**changes), made


def check(scenario, made):
    with scenario.batch(seeds=SEEDS, strategies=made) as games:
        assert games.is_in_arrays, games.slow
        games.step()
        games.run(threads=2)
        for number, seed in enumerate(SEEDS):
            assert plain(games.result(number)) == plain(scenario.play(seed=seed, strategies=made))


@pytest.mark.parametrize("by_steps", [False, True])
@pytest.mark.parametrize("part", range(3))
def test_agents_that_decide_at_arrivals_do_in_the_core_what_they_do_alone(part, by_steps):
    for number in range(part, 45, 3):
        check(*at_arrivals(number, by_steps=by_steps))


def short_streets(ctx):
    """Make streets so short that agents arrive very often."""
    for edge in [*ctx.graph.graph.get_edges()]:
        ctx.graph.graph.update_edge({"id": edge, "length": 1e-9})


def test_agents_that_arrive_too_often_in_a_turn_wait():
    team = {"count": 3, "strategy": "gamms.strategies:random_walk", "speed": 7.0}
    with scene(teams={"red": team}, settings={"speed_unit": "metres", "decide": "arrival"}).build(seed=1) as ctx:
        short_streets(ctx)
        with ctx.game.batch(seeds=SEEDS) as games, ctx.game.fork(0).ctx as alone:
            games.run()
            assert games.is_in_arrays
            assert any("times in one turn" in error["message"] for error in games.result(0).errors)
            for number, seed in enumerate(SEEDS):
                alone.game.reset(seed=seed)
                assert plain(games.result(number)) == plain(alone.game.run())


@pytest.mark.parametrize("phase", ["before", "after"])
def test_plain_rules_are_called_between_turns_of_agents_that_decide_at_arrivals(phase):
    def tell(ctx):
        for name, move in ctx.game.moves.items():
            ctx.game.emit("went", agent=name, path=[*move.path], legs=[[*leg] for leg in move.legs])
        for agent in ctx.game.agents:
            if (agent.current_node_id + ctx.game.turn) % 11 == 0:
                ctx.game.respawn(agent)

    team = {"count": 3, "strategy": "gamms.strategies:random_walk", "speed": 17.0}
    tag = {"rule": "tag", "with": {"taggers": "red", "tagged": "blue", "then": "respawn"}}
    made = scene(
        [tag], teams={"red": team, "blue": team | {"speed": 4.0}}, conflicts={"capacity": 1, "edge_capacity": 1}
    )
    with made.replace(settings={"speed_unit": "metres", "decide": "arrival"}).build(seed=1) as ctx:
        ctx.game.add(tell, phase=phase)
        with ctx.game.batch(seeds=SEEDS) as games, ctx.game.fork(0).ctx as alone:
            games.run()
            assert games.is_in_arrays, games.slow
            for number, seed in enumerate(SEEDS):
                alone.game.reset(seed=seed)
                assert plain(games.result(number)) == plain(alone.game.run())


def test_games_whose_agents_are_given_actions_go_on_as_games_alone():
    team = {"count": 3, "strategy": "gamms.strategies:random_walk", "speed": 17.0}
    scenario = scene(teams={"red": team}, settings={"speed_unit": "metres", "decide": "arrival"})
    with scenario.batch(seeds=SEEDS) as games:
        games.step()
        assert games.is_in_arrays
        games.step({"red": np.ones((len(SEEDS), 3), np.int64)})
        assert "actions from outside" in games.detached[0]
        games.run()
        for number in range(len(SEEDS)):
            assert plain(games.result(number)) == plain(games.context(number).game.result())


@settings(deadline=None)
@given(st.lists(st.floats(0, 1), max_size=9), st.lists(st.booleans(), max_size=30))
def test_a_queue_gives_who_arrives_first_and_of_several_the_first(times, pops):
    queue, waiting = Queue(len(times)), []
    steps = iter([*pops, *[True] * len(times)])
    coming = [*enumerate(times)]
    for is_pop in steps:
        if not is_pop and coming:
            agent, time = coming.pop()
            queue.push(agent, time)
            waiting.append((time, agent))
        elif waiting:
            assert queue.first_time() == min(waiting)[0]
            assert queue.pop() == min(waiting)[1]
            waiting.remove(min(waiting))
    assert queue.size == len(waiting)
