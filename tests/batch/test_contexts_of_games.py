"""Each game of a batch has a context of its own: what functions get, keep and change there is of this game."""

import asyncio
import gc
import weakref
from queue import SimpleQueue

import pytest
from batch_scenes import assert_as_alone, scene

TAG = {"rule": "tag", "with": {"taggers": "red", "tagged": "blue"}}


@pytest.mark.parametrize("number", [2, 40])
def test_a_rule_gets_the_same_context_in_all_turns_of_a_game_and_another_in_each_game(number):
    told = SimpleQueue()  # a batch refuses functions that change what it cannot reset

    def rule(ctx):
        told.put((ctx.seed, ctx))

    with scene([TAG], max_turns=5).build(seed=1) as ctx:
        ctx.game.add(rule)
        with ctx.game.batch(number) as games:
            games.run()
    each = [told.get() for _ in range(told.qsize())]
    assert len(each) == 5 * number
    assert len({id(one) for _, one in each}) == len({(seed, id(one)) for seed, one in each}) == number


def test_agents_that_a_function_keeps_are_those_of_their_game_after_others_were_played():
    told = SimpleQueue()

    def keep(ctx):
        if ctx.game.turn == 1:
            told.put((ctx.seed, [*ctx.agent.create_iter()]))

    with scene([TAG], max_turns=6).build(seed=1) as ctx:
        ctx.game.add(keep)
        with ctx.game.batch(seeds=[0, 1, 2]) as games:
            games.run()
            kept = dict(told.get() for _ in range(3))
            for seed, agents in kept.items():
                ends = games.result(seed).agents
                assert [agent.current_node_id for agent in agents] == [ends[agent.name]["node"] for agent in agents]
                assert not {*map(id, agents)} & {id(agent) for other in {*kept} - {seed} for agent in kept[other]}


def test_attributes_and_data_of_a_game_are_not_seen_in_others():
    def count(ctx):
        if ctx.seed % 2:
            ctx.game.data.setdefault("turns", []).append(ctx.game.turn)
            ctx.agent.get_agent("red_0").marks = {"turns": [*ctx.game.data["turns"]]}
        ctx.game.emit("seen", data=str(ctx.game.data), marks=str(vars(ctx.agent.get_agent("red_0"))))

    with scene([TAG], max_turns=5).build(seed=1) as ctx:
        ctx.game.add(count)
        with ctx.game.batch(seeds=[0, 1, 2, 3]) as games, ctx.game.fork(0).ctx as alone:
            games.run()
            assert games.detached == {}
            assert_as_alone(games, alone)


def test_a_strategy_that_is_an_object_without_parts_of_a_context_is_shared_by_all_games():
    copies = SimpleQueue()

    class Walker:
        def __deepcopy__(self, memo):
            copies.put(self)
            return type(self)()

        def __call__(self, state):
            state["action"] = state["legal"][(state["turn"] + len(state["name"])) % len(state["legal"])]

    with scene([], max_turns=3).build(seed=1) as ctx:
        walker = Walker()
        for agent in ctx.agent.create_iter():
            agent.strategy = walker
        with ctx.game.batch(30) as games:
            games.run()
            assert games.turn.tolist() == [3] * 30
    assert copies.qsize() <= 2  # for the batch, and to see that it holds no part of a context


@pytest.mark.parametrize("members", [[], [1, 2]])
def test_a_team_that_a_rule_creates_lets_functions_see_the_game_as_it_goes_on(members):
    def reinforce(ctx):
        if ctx.game.turn == 1 and ctx.seed == 1:
            ctx.agent.create_team("green", members)

    def look(ctx):
        ctx.game.emit("seen", nodes=[agent.current_node_id for agent in ctx.agent.create_iter()])

    with scene([TAG], max_turns=5).build(seed=1) as ctx:
        ctx.game.add(reinforce, phase="before")
        ctx.game.add(look)
        with ctx.game.batch(seeds=[0, 1, 2]) as games, ctx.game.fork(0).ctx as alone:
            games.run()
            assert_as_alone(games, alone)


@pytest.mark.parametrize(("name", "value"), [("speed", 2), ("team", "green")])
@pytest.mark.parametrize("phase", ["before", "after"])
def test_terms_of_an_agent_go_back_with_a_turn_that_is_taken_back(name, value, phase):
    faults = SimpleQueue()
    faults.put(ZeroDivisionError)

    def look(ctx):
        ctx.game.emit("seen", value=getattr(ctx.agent.get_agent("red_0"), name))

    def change(ctx):
        if ctx.game.turn == 2 and ctx.seed == 0:
            setattr(ctx.agent.get_agent("red_0"), name, value)

    def fail(ctx):
        if ctx.game.turn == 2 and ctx.seed == 1 and not faults.empty():
            raise faults.get()

    with scene([], max_turns=5).build(seed=1) as ctx:
        for function in (look, change, fail):
            ctx.game.add(function, phase=phase)
        with ctx.game.batch(seeds=[0, 1]) as games, ctx.game.fork(0).ctx as alone:
            with pytest.raises(ZeroDivisionError):
                games.run()
            games.run()
            assert_as_alone(games, alone)


def test_agents_that_were_deleted_are_freed_while_a_batch_plays():
    told = SimpleQueue()

    def replace(ctx):
        if "extra" in ctx.agent.agents:
            told.put(weakref.ref(ctx.agent.get_agent("extra")))
            ctx.agent.delete_agent("extra")
        else:
            ctx.agent.create_agent("extra", team="red", start_node_id=4, strategy=stay)

    with scene([], max_turns=200).build(seed=1) as ctx:
        ctx.game.add(replace)
        with ctx.game.batch(2, most_agents={"red": ["extra"]}) as games:
            for _ in range(60):
                games.step()
            gc.collect()
            left = [told.get()() is not None for _ in range(told.qsize())]
            assert len(left) == 60
            assert sum(left) <= 4


def stay(state):
    state["action"] = state["curr_pos"]


def test_strategies_of_all_games_await_in_one_event_loop():
    loops = SimpleQueue()

    async def wait(state):
        await asyncio.sleep(0)
        loops.put(asyncio.get_running_loop())
        state["action"] = state["legal"][0]

    with scene([], max_turns=3).build(seed=1) as ctx:
        for agent in ctx.agent.create_iter():
            agent.strategy = wait
        with ctx.game.batch(5) as games:
            games.run()
    assert len({id(one) for one in [loops.get() for _ in range(loops.qsize())]}) == 1


def test_a_game_whose_rule_changes_the_seed_goes_on_with_the_new_one():
    def reseed(ctx):
        if ctx.game.turn == 2 and ctx.seed == 1:
            ctx.reseed(77)

    def draw(ctx):
        ctx.game.emit("drawn", number=int(ctx.rng.integers(1000)))

    with scene([TAG], max_turns=5).build(seed=1) as ctx:
        ctx.game.add(reseed)
        ctx.game.add(draw)
        with ctx.game.batch(seeds=[0, 1, 2]) as games, ctx.game.fork(0).ctx as alone:
            games.run()
            assert not games.detached
            assert_as_alone(games, alone)


def test_contexts_of_games_end_with_their_batch_and_results_stay():
    told = SimpleQueue()

    def keep(ctx):
        told.put(ctx)

    with scene([TAG], max_turns=1).build(seed=1) as ctx:
        ctx.game.add(keep)
        with ctx.game.batch(3) as games:
            games.run()
            before = [games.result(number).events for number in range(3)]
        assert all(told.get().is_terminated() for _ in range(3))
        assert [games.result(number).events for number in range(3)] == before
