"""Agents that fly in games that are played in arrays: they are where they are in games played alone."""

import numpy as np
import pytest
from batch_scenes import WALK, assert_as_alone, plain, scene

import gamms
from gamms.errors import BadValue
from gamms.rules import Conflicts, tag

DRONE = {"count": 2, "type": "aerial", "speed": 12.0, "altitude": 5.0, "strategy": WALK}


def flying(*rules, drone=None, **more):
    """A scenario of walkers, and of a team that flies above them."""
    teams = {"red": {"count": 2, "strategy": WALK}, "blue": {"count": 2, "strategy": WALK}}
    return scene(rules, teams=teams | {"air": DRONE | (drone or {})}, **more)


@gamms.array_strategy
def climb(view):
    """Fly to the middle, and up."""
    x, y = np.moveaxis(view["xy"], -1, 0)
    return np.stack([20.0 - x, 20.0 - y, view.draw.random() - view["z"] / 40.0], axis=-1)


TAG = {"rule": "tag", "with": {"taggers": "air", "tagged": "blue", "hops": 1, "air": True}}
BACK = {"rule": "tag", "with": {"taggers": "red", "tagged": "air", "hops": 2, "air": True}}


@gamms.array_rule
def toll(turn):
    """Take points for visits, and note when they were, by the starts of agents, too."""
    for passing in (True, False):
        visits = turn.visits(turn.streets.columns.node_ids % 2 == 0, passing=passing)
        times = {"begin": visits.begin.tolist(), "end": visits.end.tolist()}
        turn.emit("toll", visits.at, agents={"agent": visits.agents}, nodes={"node": visits.nodes}, values=times)
    at, agents = np.nonzero(turn.alive & (turn.node == turn.start_of(np.arange(len(turn.roster.names)))))
    turn.add_scores(at, agents, -1)
    turn.emit("home", at, agents={"agent": agents})
    turn.respawn(at[turn.turn[at] % 4 == 0], agents[turn.turn[at] % 4 == 0])


@pytest.mark.parametrize(("speed", "settings"), [(None, {}), (1.5, {"order": [["air"], ["red", "blue"]]})])
def test_rules_in_arrays_alone_have_agents_that_fly_on_the_nodes_below_them(speed, settings):
    scenario = flying(BACK, drone={"speed": 3.0}, settings=settings)
    with scenario.build(seed=2, strategies={"air": climb}) as ctx:
        for agent in ctx.agent.create_iter():
            if agent.team != "air":
                agent.speed = speed
        ctx.game.add(toll)
        alone = ctx.game.fork(0)
        with ctx.game.batch(seeds=[3, 4]) as games:
            games.run()
            for number, seed in enumerate(games.seeds):
                alone.reset(seed=seed)
                assert plain(games.result(number)) == plain(alone.run())


def test_what_agents_that_are_not_there_yet_would_fly_counts_for_nothing():
    with (
        flying().build(seed=2, strategies={"air": climb}) as ctx,
        ctx.game.fork(0).ctx as alone,
        ctx.game.batch(seeds=[3], most_agents={"air": ["air_9"]}) as games,
    ):
        games.run()
        assert_as_alone(games, alone)


def test_agents_that_fly_are_in_no_conflicts_and_meet_others_in_the_air_alone():
    with flying().build(seed=1) as ctx:
        ctx.game.add(tag("air", "blue", score=1))
        ctx.game.conflicts = Conflicts(capacity=1)
        for agent in ctx.agent.create_iter():
            agent.strategy = None
            if agent.type is gamms.agent.AgentType.AERIAL:
                agent.position = (0.0, 0.0, 1.0)
            else:
                agent.current_node_id = 0
        with ctx.game.batch(2) as games:
            games.step()
            assert not games.scores["air"].any()
            assert np.array_equal(games.observe("air")["xy"], np.zeros((2, 2, 2)))


def test_flights_that_lead_beyond_all_numbers_are_refused_as_in_games_alone():
    @gamms.array_strategy
    def far_in_arrays(view):
        return np.broadcast_to((1e308, 0.0, 0.0), (*view.node.shape, 3))

    with flying(drone={"speed": 1e308}).build(seed=1) as ctx:
        for agent in ctx.agent.create_iter():
            if agent.team == "air":
                agent.position, agent.strategy = (1.7e308, 0.0, 0.0), far_in_arrays(ctx)
        ctx.game.on_illegal = "stay"
        alone = ctx.game.fork(0)
        alone.reset(seed=3)
        with ctx.game.batch(seeds=[3, 4]) as games:
            games.run()
            assert "exceeds the range of floats" in games.result(0).errors[0]["message"]
            assert plain(games.result(0)) == plain(alone.run())
        ctx.game.on_illegal = "raise"
        with ctx.game.batch(seeds=[3, 4]) as games, pytest.raises(ValueError, match="'air_0' in turn 0: A step of"):
            games.step()


def test_a_form_that_gives_agents_that_fly_no_flights_is_refused():
    @gamms.array_strategy
    def walks(view):
        return view.counts

    with flying().batch(2, strategies={"air": walks}) as games:
        with pytest.raises(BadValue, match=r"walks: what an agent that flies does are finite numbers \(dx, dy, dz\)"):
            games.step()
        assert not games.turn.any()
