"""Agents that decide where they arrive, in the core: the same games as alone, with any number of threads."""

import logging

import numpy as np
import pytest
from batch_scenes import WALK, assert_as_alone, assert_as_played, check_games, plain, scene
from hypothesis import given, settings
from hypothesis import strategies as st

import gamms
from gamms.core.arrivals import Queue
from gamms.rules import Conflicts

SEEDS = [3, 4, 5, 6]
SAID = logging.getLogger("tests of games that leave at arrivals")


def test_actions_from_outside_are_taken_at_each_arrival_as_alone():
    team = {"count": 3, "strategy": "gamms.strategies:random_walk", "speed": 17.0}
    settings = {"speed_unit": "metres", "decide": "arrival", "deeds": {"scan": {}}}
    channels = {"radio": {"range_m": 100.0, "max_bytes_per_turn": 4}}
    made = scene(teams={"red": team}, settings=settings, channels=channels)
    with made.batch(seeds=SEEDS, record=True) as games:
        games.step()
        done = {"moves": np.ones((len(SEEDS), 3), np.int64), "deeds": {"scan": True}, "messages": {"radio": (True, 7)}}
        games.step({"red": done})
        assert games.is_in_arrays
        result = games.result(0)
        assert any("not at an arrival in it" in error["message"] for error in result.errors)
        assert len(result.messages) > len(result.deeds) > 0
        games.run()
        for number in range(len(SEEDS)):
            assert plain(games.result(number)) == plain(games.context(number).game.result())


def test_a_strategy_that_raises_at_an_arrival_leaves_all_games_where_the_turn_began():
    def fail(state):
        if state["time"] > 0.5 and state["turn"] == 2:
            raise ValueError("at an arrival")
        state["action"] = state["draw"].choice(state["legal"])

    team = {"count": 3, "strategy": WALK, "speed": 17.0}
    made = scene(teams={"red": team}, settings={"speed_unit": "metres", "decide": "arrival"})
    with made.batch(seeds=SEEDS, strategies={"red": fail}) as games:
        games.step()
        games.step()
        before, places = [plain(games.result(number)) for number in range(len(SEEDS))], games.observe("red")["xy"]
        with pytest.raises(ValueError, match="at an arrival"):
            games.step()
        assert [plain(games.result(number)) for number in range(len(SEEDS))] == before
        assert np.array_equal(games.observe("red")["xy"], places)
        assert games.turn.tolist() == [2] * len(SEEDS)


@settings(deadline=None)
@given(st.lists(st.floats(0, 1), max_size=9), st.lists(st.booleans(), max_size=30))
def test_a_queue_gives_who_arrives_first_and_of_several_the_first(times, pops):
    queue, waiting = Queue(len(times)), []
    steps = iter([*pops, *[True] * len(times)])
    coming = [*enumerate(times)]
    for is_pop in steps:
        if not is_pop and coming:
            agent, time = coming.pop()
            queue.push(0, agent, time)
            waiting.append((time, agent))
        elif waiting:
            assert queue.find_first_time(0) == min(waiting)[0]
            assert queue.pop(0) == min(waiting)[1]
            waiting.remove(min(waiting))
    assert queue.count_agents(0) == len(waiting)


def test_headings_of_agents_that_lose_conflicts_or_are_turned_by_a_rule_are_those_of_the_game_alone():
    def turn(state):
        angle = state["draw"].random()
        node = state["draw"].choice(state["legal"])
        state["action"] = {"node_id": node, "orientation": (1.0 - angle, angle)} if angle < 0.5 else node

    def tell(ctx):
        ctx.game.emit("headings", what=[list(agent.orientation) for agent in ctx.game.agents])
        ctx.game.agents[ctx.game.turn % 6].orientation = (-1.0, float(ctx.seed))

    team = {"count": 6, "strategy": WALK, "speed": 19.0}
    settings = {"speed_unit": "metres", "decide": "arrival"}
    made = scene(teams={"red": team}, side=3, settings=settings, conflicts={"capacity": 1, "edge_capacity": 1})
    with made.build(seed=1, strategies={"red": turn}) as ctx:
        ctx.game.add(tell)
        assert check_in_core(ctx)[0].agents["red_0"]["blocked"] > 0


def check_in_core(ctx):
    """Check that a batch plays its games in the core as they are played alone."""

    def play(games):
        games.run()
        assert games.is_in_arrays

    return check_games(ctx, seeds=SEEDS, play=play)


@gamms.array_strategy
def roam(view):
    """Go somewhere by lot, other agents elsewhere, do deeds, send messages and count the times of being asked."""
    known = view.keep("asked", lambda games: {"number": np.zeros((games, 6), np.int64)})["number"]
    number = known[np.ix_(view.games, view.agents)] + view.mask
    known[np.ix_(view.games, view.agents)] = number
    sees = view.seen().mask.sum(axis=-1)
    lots = view.draw.below(7) + view.only(view.node % 2 == 0).draw.below(3)
    view.do("scan", lots == 3)
    view.send("radio", lots % 2 == 0, (view["time"][:, None] * 100 + sees + number).astype(np.int64))
    on_edges = (view["edge"][..., 0] >= 0).sum(axis=1)
    return (lots + sees + np.arange(len(view.agents)) + on_edges[:, None]) % view.counts


@pytest.mark.parametrize("order", [None, [["blue"], ["red"]]], ids=["at once", "in parts"])
@pytest.mark.parametrize("conflicts", [None, Conflicts(1, edge_capacity=1)], ids=["free", "conflicts"])
def test_array_strategies_decide_for_all_agents_that_arrive_as_alone(conflicts, order):
    team = {
        "count": 3,
        "strategy": WALK,
        "speed": 17.0,
        "sensors": {"eyes": {"type": "AGENT_RANGE", "sensor_range": 25.0}},
    }
    settings = {"speed_unit": "metres", "decide": "arrival", "deeds": {"scan": {}}}
    settings |= {} if order is None else {"order": order}
    teams = {"red": team, "blue": team | {"speed": 10.0}}  # several arrive at the same time
    made = scene(teams=teams, max_turns=6, settings=settings, channels={"radio": {"range_m": 30.0, "loss": 0.2}})
    with made.build(seed=1, strategies={"red": roam, "blue": roam}) as ctx:
        ctx.game.conflicts = conflicts
        check_in_core(ctx)


def test_array_strategies_with_sensors_that_err_are_called_game_by_game_at_arrivals():
    eyes = {"type": "AGENT_RANGE", "sensor_range": 25.0, "detection": 0.5}
    team = {"count": 3, "strategy": WALK, "speed": 17.0, "sensors": {"eyes": eyes}}
    settings = {"speed_unit": "metres", "decide": "arrival", "deeds": {"scan": {}}}
    made = scene(teams={"red": team}, settings=settings, channels={"radio": {"range_m": 30.0}})
    with made.batch(seeds=SEEDS, strategies={"red": roam}) as games:
        games.run()
        assert games.is_in_arrays
        assert_as_played(games, made, {"red": roam})


def look_ahead(_, state):
    state["memory"]["ahead"] = state["fork"](1).game.turn


def count_memories(ctx, state):
    state["memory"]["known"] = len(str(ctx.game.memories))


def open_arriving(act, last, order):
    """Return a context with a game in which a strategy acts while agents are on their way, in games with odd seeds."""

    def note(ctx):
        ctx.game.scores["seed"] = ctx.seed

    def count(ctx):
        ctx.game.emit(
            "moves", what=[[*move.path] for move in ctx.game.moves.values()], done=len(ctx.game.performed("rest"))
        )

    def walk(state):
        calls = state["memory"]["calls"] = state["memory"].get("calls", 0) + 1
        seed = ctx.game.scores["seed"]
        SAID.warning(f"seed {seed}, {state['name']}, call {calls}")
        lot = state["draw"].below(9) + sum(len(data) for _, data in state["sensor"].values()) + len(state["inbox"])
        lot += len(state["blocked"] or "") + int(state["rng"].integers(3))
        node = state["legal"][lot % len(state["legal"])]
        state["team_memory"][state["name"]] = [state["curr_pos"], state["time"]]
        state["outbox"].append({"channel": "radio", "to": None, "body": calls})
        state["action"] = node
        if calls % 3 == 0:
            state["action"] = {"node_id": node, "do": {"rest": {}}, "orientation": (1.0, float(calls))}
        if calls == last and seed % 2 and state["name"] == "red_1":
            act(ctx, state)

    eyes = {"near": {"type": "AGENT_RANGE", "sensor_range": 60.0, "detection": 0.5}}
    team = {"count": 3, "sensors": ["near"], "speed": 13.0, "strategy": WALK}
    settings = {"speed_unit": "metres", "decide": "arrival", "deeds": {"rest": {}}, "order": order}
    rules = [{"rule": "tag", "with": {"taggers": "red", "tagged": "blue"}}]
    teams = {"red": team, "blue": team | {"speed": 25.0}}
    channels = {"radio": {"range_m": 30.0}}
    made = scene(rules, side=4, max_turns=6, teams=teams, sensors=eyes, settings=settings, channels=channels)
    ctx = made.build(seed=1)
    ctx.game.conflicts = Conflicts(1)
    for agent in ctx.agent.create_iter():
        if agent.name != "blue_2":
            agent.strategy = walk
    ctx.game.add(note, phase="before")
    ctx.game.add(count)
    return ctx


@pytest.mark.parametrize(("last", "order"), [(4, None), (7, [["blue"], ["red"]])])
@pytest.mark.parametrize("act", [look_ahead, count_memories])
def test_strategies_look_ahead_and_read_memories_while_agents_are_on_their_way_as_alone(act, last, order, caplog):
    with open_arriving(act, last, order) as ctx:
        ctx.game.on_illegal = "stay"
        with ctx.game.batch(seeds=[0, 1, 3]) as games, ctx.game.fork(0).ctx as alone:
            games.step()
            games.run()
            assert games.is_in_arrays
            said = [one for one in caplog.messages if one.startswith("seed")]
            assert len({*said}) == len(said)
            assert_as_alone(games, alone)
