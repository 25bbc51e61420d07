"""The context of one game of a batch: what is read from it is what the game alone has at that turn."""

import copy
import threading
from queue import SimpleQueue

import numpy as np
import pytest
from batch_scenes import WALK, assert_as_alone, by_another_plan, plain, scene

from gamms import rl
from gamms.errors import BadValue

TAG = {"rule": "tag", "with": {"taggers": "red", "tagged": "blue"}}
EYES = {"near": {"type": "AGENT_RANGE", "sensor_range": 25.0}}
CHASE = {"count": 3, "strategy": "gamms.strategies:chase", "sensors": ["near"]}
FAST = {"count": 2, "strategy": WALK, "speed": 7.0}
SCENES = {
    "a walk": scene([TAG]),
    "sensors": scene([TAG, "respawn"], teams={"red": CHASE, "blue": CHASE}, sensors=EYES),
    "conflicts": scene([TAG], conflicts={"capacity": 1, "resolve": "at_random"}),
    "by metres": scene([TAG], teams={"red": FAST, "blue": FAST}, settings={"speed_unit": "metres"}),
}


def bonus(ctx):
    """Pay agents on nodes of even numbers, and remember how many there were."""
    there = [agent.team for agent in ctx.game.agents if agent.current_node_id % 2 == 0]
    ctx.game.data["seen"] = ctx.game.data.get("seen", 0) + len(there)
    for team in there:
        ctx.game.scores[team] += 1


def seen_in(ctx, *, with_moves=True):
    """Return what a program may read of a game, agents by their names."""
    agents = {
        agent.name: (agent.current_node_id, agent.prev_node_id, agent.alive, agent.xy, agent.get_state()["sensor"])
        for agent in sorted(ctx.agent.create_iter(), key=lambda one: one.name)
    }
    return (
        ctx.seed,
        ctx.game.turn,
        agents,
        plain(ctx.game.result()),
        ctx.game.data.get("seen"),
        with_moves and ctx.game.moves,
    )


@pytest.mark.parametrize("name", SCENES)
def test_a_context_shows_what_the_game_alone_has_after_each_turn(name):
    scenario = SCENES[name]
    with scenario.batch(3, seed=4) as games, scenario.build(seed=5) as alone:
        assert games.is_in_arrays
        for turn in range(6):
            if turn == 2:
                shown = games.context(1)
            if turn >= 2:
                are_moves_known = turn > 2 or name != "by metres"  # the core keeps no paths
                assert seen_in(shown, with_moves=are_moves_known) == seen_in(alone, with_moves=are_moves_known)
                assert are_moves_known or shown.game.moves == {}
            games.step()
            alone.game.step()
        assert games.is_in_arrays
        games.run()
        assert shown is games.context(1)
        assert plain(shown.game.result()) == plain(games.result(1)) == plain(scenario.play(seed=5))


@pytest.mark.parametrize("played", [0, 3])
def test_a_context_changes_nothing_of_what_the_batch_plays_on(played):
    with scene([TAG]).build(seed=1) as ctx:
        for _ in range(played):
            ctx.game.step()
        ctx.game.add(bonus)
        ctx.game.collect("seen", lambda ctx: ctx.game.data["seen"])
        with ctx.game.batch(3, seed=4) as games, ctx.game.batch(3, seed=4) as others, ctx.game.fork(0).ctx as alone:
            for turn in range(5):
                games.step()
                others.step()
                number = turn % 3
                shown = games.context(number)
                alone.game.reset(seed=4 + number)
                while alone.game.turn < played + turn + 1:
                    alone.game.step()
                assert seen_in(shown) == seen_in(alone)
            games.run()
            others.run()
            for number in range(3):
                assert plain(games.result(number)) == plain(others.result(number))
            assert games.is_in_arrays == others.is_in_arrays


def test_functions_are_called_again_only_in_turns_after_a_context_was_asked_for(caplog):
    def tell(ctx):
        ctx.logger.warning(f"seed {ctx.seed}, turn {ctx.game.turn}")

    with scene([TAG]).build(seed=1) as ctx:
        ctx.game.add(tell)
        with ctx.game.batch(2) as games:
            for _ in range(3):
                games.step()
            shown = games.context(1)
            assert len({*caplog.messages}) == len(caplog.messages) == 6
            games.step()
            assert caplog.messages[6:] == ["seed 0, turn 4", "seed 1, turn 4", "seed 1, turn 4"]
            with pytest.raises(BadValue, match=r"has not its start: games.reset\(\[1\]\)"):
                shown.game.reset()


def test_a_context_knows_what_agents_have_sensed_from_the_next_turn_on():
    with SCENES["sensors"].batch(2, seed=4) as games:
        games.step()
        agent = games.context(1).agent.get_agent("red_0")
        for read in (lambda: agent.state, lambda: agent.sensors["near"].data):
            with pytest.raises(BadValue, match=r"has not kept what (agent 'red_0'|sensor 'red_0/near') has sensed"):
                read()
        twin = copy.deepcopy(games.context(1)).agent.get_agent("red_0")
        with pytest.raises(BadValue, match="has not kept what agent 'red_0' has sensed"):
            assert twin.state
        games.step()
        assert agent.state["turn"] == 1
        assert agent.sensors["near"].data == agent.state["sensor"]["near"][1]


def test_a_context_shows_the_effects_of_actions_from_outside():
    with scene([TAG]).batch(3, seed=4) as games:
        games.step()
        shown = games.context(2)
        for turn in range(4):
            view = games.observe("red")
            games.step({"red": (view.counts - 1) * (turn % 2)})
            nodes = [shown.agent.get_agent(name).current_node_id for name in view["name"]]
            assert nodes == games.observe("red")["curr_pos"][2].tolist()
        assert shown.game.plans == {}
        other = games.context(0)
        assert plain(other.game.result()) == plain(games.result(0))


def test_a_context_shows_games_with_actions_that_were_not_kept_or_that_were_loaded():
    with scene([TAG]).batch(2, seed=4) as games:
        for _ in range(3):
            games.step({"red": np.ones((2, 3), np.int64)})
        shown = games.context(0)
        games.load(games.columns(), turn=7)
        assert shown.is_terminated()
        for _ in range(2):
            assert games.context(1).game.turn == games.turn[1]
            assert_as_observed(games, 1)
            games.step({"red": np.ones((2, 3), np.int64)})


def assert_as_observed(games, number):
    """Check that agents are shown where they are observed."""
    view = games.observe("red")
    shown = games.context(number).agent
    assert [shown.get_agent(name).current_node_id for name in view["name"]] == view["curr_pos"][number].tolist()


def test_an_agent_answers_for_its_own_game_when_another_is_shown():
    with scene([TAG]).batch(2, seed=5) as games:
        games.step()
        first = games.context(0)
        agents = [first.agent.get_agent(f"red_{i}") for i in range(3)]
        nodes = games.observe("red")["curr_pos"].tolist()
        other = games.context(1)
        assert first.is_terminated()
        assert [agent.current_node_id for agent in agents] == nodes[0]
        assert [other.agent.get_agent(agent.name).current_node_id for agent in agents] == nodes[1]
        games.reset([1])
        assert other.is_terminated()
        last = games.context(1)
    assert last.is_terminated()


def test_a_rule_that_keeps_an_agent_for_other_games_is_refused():
    kept = {}

    def follow(ctx):
        for agent in ctx.game.agents:
            kept.setdefault(agent.name, agent)

    with scene().build(seed=1) as ctx:
        ctx.game.add(follow)
        with (
            ctx.game.batch(3) as games,
            pytest.raises(BadValue, match="variable 'kept' of follow"),
        ):
            games.run()


def test_the_turn_in_which_a_rule_raised_is_shown():
    def fall(ctx):
        if ctx.game.turn == 3:
            raise ZeroDivisionError("fell")

    with scene().build(seed=1) as ctx:
        ctx.game.add(fall)
        with ctx.game.batch(1) as games:
            with pytest.raises(ZeroDivisionError):
                games.run()
            assert games.turn.tolist() == [3]
            shown = games.context(0)
            assert shown.game.turn == 3
            assert plain(shown.game.result()) == plain(games.result(0))


def test_two_batches_of_one_context_play_in_two_threads_as_alone():
    with scene([TAG]).build(seed=1) as ctx:
        ctx.game.add(bonus)
        with ctx.game.batch(4, seed=1) as first, ctx.game.batch(4, seed=9) as second, ctx.game.fork(0).ctx as alone:
            threads = [threading.Thread(target=games.run) for games in (first, second)]
            for thread in threads:
                thread.start()
            for thread in threads:
                thread.join()
            for games in (first, second):
                assert_as_alone(games, alone)


@pytest.mark.parametrize("verb", [lambda games: games.context(0), lambda games: games.step()])
def test_a_batch_is_played_and_shown_by_one_thread_at_a_time(verb):
    batches, answers = SimpleQueue(), SimpleQueue()

    def ask(games):
        try:
            verb(games)
        except BadValue as error:
            answers.put(str(error))

    def ask_elsewhere(ctx):
        if not batches.empty():
            thread = threading.Thread(target=ask, args=(batches.get(),))
            thread.start()
            thread.join()

    with scene().build(seed=1) as ctx:
        ctx.game.add(ask_elsewhere)
        with ctx.game.batch(2) as games:
            batches.put(games)
            games.step()
            assert "Another thread plays this batch" in answers.get()
            assert games.turn.tolist() == [1, 1]


@pytest.mark.parametrize("make", [rl.parallel_env, rl.single_agent_env])
def test_an_environment_has_a_context_of_its_game(make):
    given = {"team": "red"} if make is rl.parallel_env else {"agent": "red_0"}
    env = make(scene([TAG]), **given)
    learners = env.unwrapped.learners
    env.reset(seed=3)
    shown = learners.games.context(0)
    for _ in range(4):
        action = dict.fromkeys(learners.names, 1) if make is rl.parallel_env else 1
        env.step(action)
        nodes = learners.games.observe("red")["curr_pos"][0].tolist()
        assert [shown.agent.get_agent(f"red_{i}").current_node_id for i in range(3)] == nodes
    env.close()


@pytest.mark.parametrize(("of_scenario", "turns"), [(True, 1), (False, 1), (False, 0)])
def test_a_game_that_is_over_is_shown_where_games_are_played_one_after_the_other(of_scenario, turns):
    scenario = by_another_plan(scene([TAG], max_turns=5))
    with scenario.build(seed=1) as ctx, ctx.game.fork(0).ctx as fork:
        make, alone = (scenario.batch, ctx) if of_scenario else (ctx.game.batch, fork)
        with make(3, seed=4) as games:
            if turns:
                games.run(turns)
            first = games.context(0)
            games.run()
            for number in (1, 0, 2):
                alone.game.reset(seed=4 + number)
                alone.game.run()
                assert seen_in(games.context(number)) == seen_in(alone)
            assert (first.seed, first.game.turn) == (4, 5)


def test_the_context_of_a_game_of_a_batch_is_played_by_the_batch_alone():
    with scene(max_turns=None).batch(2, seed=1) as games:
        shown = games.context(1)
        for verb in (shown.game.step, lambda: shown.game.run(3)):
            with pytest.raises(BadValue, match="shows game 1 of a batch"):
                verb()
        assert copy.deepcopy(shown).game.step()
        games.run(3)
        assert shown.game.turn == 3
        assert shown.game.result().reason == games.result(1).reason == "max_turns"
        assert games.context(0).game.result().reason == "max_turns"


def test_functions_of_a_batch_see_the_last_turn_of_the_run_as_alone():
    def note(ctx):
        ctx.game.emit("last", until=ctx.game.last_turn)
        if ctx.game.turn == 1 and ctx.seed == 1:
            ctx.game.legal = "any"  # its game leaves

    with scene(max_turns=9).build(seed=1) as ctx:
        ctx.game.add(note, phase="before")
        with ctx.game.batch(seeds=[1, 2]) as games, ctx.game.fork(0).ctx as alone:
            games.run(3, warn=False)
            assert not games.detached
            for number, seed in enumerate(games.seeds):
                alone.game.reset(seed=seed)
                assert alone.game.run(3).events == games.result(number).events
