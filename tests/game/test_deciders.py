"""A team can be commanded by one plan, of states or of arrays, and strategies and plans may be awaited."""

import asyncio
import gc
import io
import math
import signal
import threading
import time
import warnings

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

import gamms
from gamms.bridge import SimulatedClock
from gamms.errors import BadType, BadValue, IllegalMutation
from gamms.rules import Conflicts
from gamms.sensor import SensorType
from gamms.typing import AgentType


def wander(state):
    state["memory"]["turns"] = [*state["memory"].get("turns", ()), state["turn"]]
    state["team_memory"].setdefault("seen", set()).add((state["name"], state["curr_pos"]))
    state["action"] = state["draw"].choice(state["legal"])


def walk(arrays):
    """What `state["draw"].choice(state["legal"])` does, for a whole team."""
    return arrays.targets[arrays.offsets[:-1] + arrays.draw.below(np.diff(arrays.offsets))]


def team(ctx, *names, start=5, strategy=None, team="red", **more):
    return [ctx.agent.create_agent(name, start_node_id=start, team=team, strategy=strategy, **more) for name in names]


def nodes(ctx):
    return {name: agent.current_node_id for name, agent in ctx.agent.agents.items()}


def each(states):
    """A plan under which all go one node to the right."""
    for state in states.values():
        state["action"] = state["curr_pos"] + 1


# -- plans of states ------------------------------------------------------------------------------------------------


def test_a_plan_decides_for_its_team_alone(ctx):
    team(ctx, "b", "a")
    team(ctx, "c", team="blue")
    seen = []
    ctx.game.command("red", lambda states: (seen.append(list(states)), each(states))[-1])
    ctx.game.step()
    assert seen == [["a", "b"]]
    assert nodes(ctx) == {"a": 6, "b": 6, "c": 5}


def test_rules_see_the_states_of_a_plan(ctx):
    team(ctx, "a")
    ctx.game.command("red", each)
    ctx.game.step()
    assert ctx.agent.get_agent("a").state["action"] == 6


def test_a_plan_that_returns_something_is_an_error_that_says_how_to_act(ctx):
    team(ctx, "a")
    ctx.game.command("red", lambda states: dict.fromkeys(states, 6))
    with pytest.raises(BadType, match=r"sets state\['action'\] in each state.*arrays=True") as error:
        ctx.game.step()
    assert error.value.__notes__ == ["In the plan of team 'red', in turn 0."]
    assert ctx.game.turn == 0


def test_who_gets_no_action_from_a_plan_stays_and_is_counted(ctx):
    team(ctx, "a", "b", "c")

    def plan(states):
        states["a"]["action"] = 6
        states["b"]["action"] = 15

    ctx.game.command("red", plan)
    result = ctx.game.run(1)
    assert nodes(ctx) == {"a": 6, "b": 5, "c": 5}
    assert [(error["agent"], error["kind"]) for error in result.errors] == [("b", "illegal"), ("c", "illegal")]
    assert "state['action'] was not set" in result.errors[1]["message"]


def test_a_plan_that_raises_is_an_error_of_all_its_agents(ctx):
    team(ctx, "a", "b")
    ctx.game.command("red", lambda states: 1 / 0)
    with pytest.raises(ZeroDivisionError) as error:
        ctx.game.step()
    assert error.value.__notes__ == ["In the plan of team 'red', in turn 0."]
    ctx.game.on_error = "stay"
    result = ctx.game.run(1)
    assert [(error["agent"], error["kind"]) for error in result.errors] == [("a", "error"), ("b", "error")]
    assert result.agents["a"]["errors"] == 1


def test_a_plan_may_change_nothing_and_look_at_its_own_team_alone(ctx):
    team(ctx, "a", "b")
    team(ctx, "z", team="blue")
    said = []

    def plan(states):
        assert ctx.agent.get_agent("b").state is states["b"]
        assert list(ctx.game.memories) == ["a", "b"]
        for cheat in (
            lambda: ctx.game.emit("x"),
            lambda: ctx.agent.get_agent("z").state,
            lambda: setattr(ctx.agent.get_agent("a"), "team", "blue"),
            lambda: ctx.game.command("blue", None),
            ctx.game.snapshot,
        ):
            with pytest.raises(IllegalMutation) as error:
                cheat()
            said.append(str(error.value))
        each(states)

    ctx.game.command("red", plan)
    ctx.game.step()
    assert all(text.startswith("The plan of team 'red' may not ") for text in said)
    assert not ctx.game.events


def test_invalid_plans_are_refused(ctx):
    for wrong in (3, "each", lambda: None, lambda one, two: None):
        with pytest.raises(BadType, match="A plan must be a function of the states of its team"):
            ctx.game.command("red", wrong)
    with pytest.raises(BadType, match="A team"):
        ctx.game.command([], each)
    with pytest.raises(BadType):
        ctx.game.plans = [each]
    ctx.game.plans = {"red": each}
    assert ctx.game.plans["red"].function is each


def test_a_plan_for_a_team_without_agents_is_warned_about_once(ctx, caplog):
    team(ctx, "a")
    ctx.logger.setLevel("WARNING")
    ctx.game.command("rde", each)
    ctx.game.command("green", each)
    ctx.game.command("green", None)
    ctx.game.run(2)
    said = [record.getMessage() for record in caplog.records]
    assert said[1:] == ["command: Unknown team 'rde'. Did you mean 'red'? Its plan decides for no agent."]
    assert said[0].startswith("No strategy decides for: team 'red'.")


# -- plans of arrays ------------------------------------------------------------------------------------------------


def test_a_plan_of_arrays_asks_no_sensor(ctx):
    looks = []
    sensor = ctx.sensor.from_function("eyes", lambda node_id, agent: looks.append(node_id))
    team(ctx, "a", sensors=[sensor])
    ctx.game.command("red", walk, arrays=True)
    ctx.game.run(3)
    assert looks == []


def test_the_generator_of_a_team_follows_from_the_seed_the_team_and_the_turn(grid):
    drawn = {}
    for seed, name in ((1, "red"), (1, "red"), (2, "red"), (1, "blue")):
        with grid(seed=seed) as ctx:
            team(ctx, "a", team=name)
            seen = []
            ctx.game.command(
                name, lambda arrays, seen=seen: (seen.append(arrays.rng.random()), arrays.nodes)[-1], arrays=True
            )
            ctx.game.run(2)
            drawn.setdefault((seed, name), []).append(tuple(seen))
    first, again = drawn[1, "red"]
    assert first == again
    assert len({first, drawn[2, "red"][0], drawn[1, "blue"][0], first[::-1]}) == 4


@pytest.mark.parametrize(
    ("answer", "message"),
    [
        ([1], "one node for each agent, an array"),
        ([[5, 5]], "one node for each agent, an array"),
        ([5.0, 5.0], "returns the ids of 2 nodes"),
        ([[1], [1, 2]], "returns the ids of 2 nodes"),
        (None, "returns the ids of 2 nodes"),
        ([True, False], "returns the ids of 2 nodes"),
    ],
)
def test_wrong_answers_in_arrays_are_errors_of_the_plan(ctx, answer, message):
    team(ctx, "a", "b")
    ctx.game.command("red", lambda arrays: answer, arrays=True)
    with pytest.raises((BadType, BadValue), match=message):
        ctx.game.step()
    ctx.game.on_error = "stay"
    assert [error["kind"] for error in ctx.game.run(1).errors] == ["error", "error"]
    assert nodes(ctx) == {"a": 5, "b": 5}


def test_illegal_nodes_in_arrays_are_counted_agent_by_agent(ctx):
    team(ctx, "a", "b", "c")
    ctx.game.command("red", lambda arrays: np.array([6, 15, 99], np.int32), arrays=True)
    result = ctx.game.run(1)
    assert nodes(ctx) == {"a": 6, "b": 5, "c": 5}
    assert [(error["agent"], error["kind"]) for error in result.errors] == [("b", "illegal"), ("c", "illegal")]
    assert ["not next to" in result.errors[0]["message"], "99" in result.errors[1]["message"]] == [True, True]


def test_a_plan_of_arrays_commands_runners_and_any_move(ctx):
    team(ctx, "a", speed=2)
    team(ctx, "b")
    ctx.game.command("red", lambda arrays: [7, 6], arrays=True)
    ctx.game.step()
    assert nodes(ctx) == {"a": 7, "b": 6}
    ctx.game.legal = "any"
    seen = []
    ctx.game.command("red", lambda arrays: (seen.append(arrays.offsets), [15, 99])[-1], arrays=True)
    ctx.game.step()
    assert (seen, nodes(ctx)) == ([None], {"a": 15, "b": 6})


def test_a_plan_of_arrays_refuses_flyers(ctx):
    ctx.agent.create_agent("drone", type=AgentType.AERIAL, start_node_id=5, speed=2.0, team="red")
    ctx.game.command("red", walk, arrays=True)
    with pytest.raises(BadType, match="agent 'drone' flies"):
        ctx.game.step()


# -- awaiting -------------------------------------------------------------------------------------------------------


def later(seconds, then=wander):
    async def strategy(state):
        await asyncio.sleep(seconds)
        then(state)

    return strategy


def test_at_the_deadline_the_default_action_counts(ctx):
    ended = []

    async def slow(state):
        try:
            await asyncio.sleep(60)
        finally:
            ended.append(state["name"])

    ctx.game.configure({"deadline_s": 0.2, "default_action": 6})
    team(ctx, "a", strategy=slow)
    team(ctx, "b", strategy=later(0.0, lambda state: state.update(action=4)))
    team(ctx, "c", start=0, strategy=slow)
    began = time.perf_counter()
    result = ctx.game.run(1)
    assert time.perf_counter() - began < 50
    assert ended == ["a", "c"]
    assert nodes(ctx) == {"a": 6, "b": 4, "c": 0}  # from 0 no edge leads to 6
    assert [(error["agent"], error["kind"]) for error in result.errors] == [("a", "overrun"), ("c", "overrun")]
    assert "0.2 s" in result.errors[0]["message"]
    assert (result.agents["a"]["overruns"], result.agents["a"]["illegal"]) == (1, 0)


def test_decisions_are_awaited_by_the_clock_of_the_game(ctx):
    clock = SimulatedClock()
    ctx.game.configure({"deadline_s": 3600.0, "default_action": 6, "clock": clock})
    team(ctx, "a", strategy=later(1800.0, lambda state: state.update(action=4)))
    team(ctx, "b", strategy=later(7200.0))
    began = time.perf_counter()
    result = ctx.game.run(1)
    assert nodes(ctx) == {"a": 4, "b": 6}
    assert [error["agent"] for error in result.errors] == ["b"]
    assert clock.now() == pytest.approx(3600.0)
    ctx.game.clock = SimulatedClock(-5.0)
    ctx.game.step()
    assert (clock.now(), ctx.game.clock.now()) == (pytest.approx(3600.0), pytest.approx(3595.0))
    ctx.game.clock = None
    ctx.game.deadline_s = 0.05
    ctx.game.step()
    assert time.perf_counter() - began < 60


@given(
    start=st.sampled_from([0.0, 0.1, 86400.7, 1.8e9]) | st.floats(0.0, 4e9),
    delays=st.lists(st.floats(1e-9, 100.0), min_size=1, max_size=4),
)
@example(start=0.1, delays=[30.0 - 6.2e-13, 30.0])
def test_decisions_that_wait_for_a_time_end_by_any_simulated_clock(start, delays):
    clock = SimulatedClock(start)
    waits = 0

    def wait_until(end):
        async def wait(state):
            nonlocal waits
            while (left := end - clock.now()) > 0.0:
                waits += 1
                assert waits < 1000
                await asyncio.sleep(left)

        return wait

    ctx = gamms.create_context()
    ctx.graph.attach_networkx_graph(gamms.graph.grid(2, 2))
    ctx.game.clock = clock
    for number, delay in enumerate(delays):
        team(ctx, f"agent {number}", start=0, strategy=wait_until(start + delay))
    ctx.game.step()
    assert clock.now() >= start + max(delays)


@pytest.mark.parametrize("now", [-1e300, -1.7e12, 1.7e12, 1.7e18])
def test_decisions_are_awaited_by_a_clock_that_cannot_count_them(ctx, now):
    clock = SimulatedClock()
    clock._now = now
    ctx.game.clock = clock
    team(ctx, "a", strategy=later(1e-9, lambda state: state.update(action=4)))
    ctx.game.step()
    assert nodes(ctx) == {"a": 4}


@pytest.mark.parametrize("start", ["0", None, True, math.nan, math.inf, 1.7e12, -1.7e18, 10**400])
def test_a_simulated_clock_starts_at_seconds_that_floats_can_count(start):
    with pytest.raises((BadType, BadValue), match="start"):
        SimulatedClock(start)


def test_a_class_of_clocks_is_no_clock(ctx):
    with pytest.raises(
        BadType, match=r"A clock has now\(\) and sleep\(seconds\), as gamms.bridge.SimulatedClock\(\), unlike"
    ):
        ctx.game.clock = SimulatedClock


@pytest.mark.parametrize("clock", [None, SimulatedClock()])
def test_decisions_that_are_late_before_they_begin_are_closed(ctx, clock):
    ctx.game.configure({"deadline_s": 1e-300, "clock": clock})
    team(ctx, "a", "b", strategy=later(1.0))
    errors = ctx.game.run(1).errors
    gc.collect()  # a coroutine that was never awaited would warn
    assert [error["kind"] for error in errors] == ["overrun"] * 2


def test_a_simulated_clock_stands_while_threads_work_for_a_decision(ctx):
    async def think(state):
        await asyncio.to_thread(time.sleep, 0.05)
        state["action"] = 4

    clock = SimulatedClock()
    ctx.game.configure({"deadline_s": 1.0, "clock": clock})
    team(ctx, "a", strategy=think)
    assert ctx.game.run(1).errors == []
    assert (nodes(ctx), clock.now()) == ({"a": 4}, 0.0)


def test_ctrl_c_in_an_awaited_decision_leaves_no_error_that_is_not_read(ctx, caplog):
    async def press(state):
        signal.raise_signal(signal.SIGINT)

    team(ctx, "a", strategy=press)
    team(ctx, "b", strategy=later(60.0))
    with pytest.raises(KeyboardInterrupt):
        ctx.game.step()
    gc.collect()
    assert caplog.records == []


def test_a_late_plan_is_an_overrun_of_all_its_agents(ctx):
    team(ctx, "a", "b")

    async def plan(states):
        each(states)
        await asyncio.sleep(60)

    ctx.game.configure({"deadline_s": 0.02})
    ctx.game.command("red", plan)
    result = ctx.game.run(1)
    assert nodes(ctx) == {"a": 5, "b": 5}
    assert [error["kind"] for error in result.errors] == ["overrun", "overrun"]


def test_the_default_action_may_follow_from_the_state(ctx):
    ctx.game.configure({"on_error": "stay", "default_action": lambda state: state["legal"][1]})
    team(ctx, "a", strategy=lambda state: 1 / 0)
    team(ctx, "b", start=0, strategy=later(0.0, lambda state: 1 / 0))
    result = ctx.game.run(1)
    assert nodes(ctx) == {"a": 6, "b": 1}
    assert [error["kind"] for error in result.errors] == ["error", "error"]


def test_a_default_action_that_raises_is_named(ctx):
    ctx.game.configure({"on_error": "stay", "default_action": lambda state: 1 / 0})
    team(ctx, "a", strategy=lambda state: 1 / 0)
    with pytest.raises(ZeroDivisionError) as error:
        ctx.game.step()
    assert error.value.__notes__ == ["In ctx.game.default_action for agent 'a', in turn 0."]


def test_default_actions_and_deadlines_are_checked(ctx):
    for name, wrong in (
        ("default_action", "go"),
        ("default_action", lambda: 1),
        ("deadline_s", 0),
        ("deadline_s", "x"),
        ("clock", 1.0),
    ):
        with pytest.raises((BadType, BadValue)):
            setattr(ctx.game, name, wrong)


def test_an_error_in_a_strategy_that_is_awaited_ends_the_turn(ctx):
    ended = []

    async def wait(state):
        try:
            await asyncio.sleep(60)
        finally:
            ended.append(state["name"])

    team(ctx, "a", strategy=wait)
    team(ctx, "b", strategy=later(0.0, lambda state: 1 / 0))
    with pytest.raises(ZeroDivisionError) as error:
        ctx.game.step()
    assert error.value.__notes__ == ["In the strategy of agent 'b', in turn 0."]
    assert (ended, ctx.game.turn) == (["a"], 0)


def test_nothing_is_left_waiting_if_another_strategy_raises(ctx, collect):
    team(ctx, "a", strategy=later(0.0))
    team(ctx, "b", strategy=lambda state: 1 / 0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(ZeroDivisionError):
            ctx.game.step()
        collect()


def test_no_agent_may_change_anything_while_several_are_awaited(ctx):
    said = []

    async def cheat(state):
        for _ in range(3):
            await asyncio.sleep(0)
            with pytest.raises(IllegalMutation) as error:
                ctx.game.emit("cheated")
            said.append(str(error.value).split(" may not")[0])
        assert ctx.agent.get_agent(state["name"]).state is state
        assert list(ctx.game.memories) == [state["name"]]
        other = "b" if state["name"] == "a" else "a"
        with pytest.raises(IllegalMutation):
            _ = ctx.agent.get_agent(other).state
        state["action"] = 6

    team(ctx, "a", "b", strategy=cheat)
    ctx.game.step()
    assert sorted(said) == ["The strategy of agent 'a'"] * 3 + ["The strategy of agent 'b'"] * 3
    assert not ctx.game.events
    ctx.game.emit("allowed")


def test_tasks_and_threads_of_a_strategy_are_guarded_too(ctx):
    said = []

    def cheat():
        try:
            ctx.game.emit("cheated")
        except IllegalMutation as error:
            said.append(str(error).split(" may not")[0])

    async def delegate(state):
        async def task():
            cheat()

        await asyncio.gather(asyncio.create_task(task()), asyncio.to_thread(cheat))
        thread = threading.Thread(target=cheat)
        thread.start()
        await asyncio.sleep(0)
        thread.join()
        state["action"] = 6

    team(ctx, "a", strategy=delegate)
    ctx.game.step()
    assert said == ["The strategy of agent 'a'"] * 2 + ["A strategy that is awaited"]
    assert not ctx.game.events


def test_no_thread_is_left_over(grid):
    before = set(threading.enumerate())
    with grid() as ctx:
        team(ctx, "a", strategy=later(0.0))
        ctx.game.step()
        assert set(threading.enumerate()) <= before
        asyncio.run(stepping(ctx))
        assert set(threading.enumerate()) <= before


async def stepping(ctx):
    ctx.game.step()


def test_games_can_be_played_inside_of_a_running_loop(grid):
    with grid() as inside, grid() as outside:
        for ctx in (inside, outside):
            team(ctx, "a", "b", strategy=later(0.0))
        played = outside.game.run(5)

        async def notebook():
            return inside.game.run(5)

        assert asyncio.run(notebook()) == played


@pytest.mark.parametrize("is_heard", [True, False], ids=["it wakes the game", "it does not wake the game"])
@pytest.mark.parametrize("is_in_loop", [False, True])
def test_an_interrupt_leaves_the_turn_unplayed_and_cancels(ctx, is_in_loop, is_heard):
    begun, ended = [], []

    def interrupt():  # which reaches the main thread, as usual, or another one, and Python alone
        signal.pthread_kill((threading.main_thread() if is_heard else threading.current_thread()).ident, signal.SIGINT)

    async def wait(state):
        try:
            begun.append(state["name"])
            if len(begun) == 2:
                thread.start()
            await asyncio.sleep(60)
        finally:
            ended.append(state["name"])

    team(ctx, "a", "b", strategy=wait)

    async def notebook():
        ctx.game.step()

    thread = threading.Thread(target=interrupt)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    began = time.perf_counter()
    try:
        with pytest.raises(KeyboardInterrupt):
            if is_in_loop:
                loop = asyncio.new_event_loop()
                try:
                    loop.run_until_complete(notebook())
                finally:
                    loop.close()
            else:
                ctx.game.step()
    finally:
        thread.join()
        signal.signal(signal.SIGINT, before)
    assert time.perf_counter() - began < 50
    assert (sorted(ended), ctx.game.turn) == (["a", "b"], 0)
    ctx.game.emit("allowed")


def test_the_paper_s_loop_and_strategies_made_of_strategies_say_that_they_do_not_await(ctx, collect):
    (agent,) = team(ctx, "a", strategy=later(0.0))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(BadType, match=r"agent 'a' is asynchronous: play with ctx\.game"):
            agent.step()
        with pytest.raises(BadType, match="must not be an async def"):
            gamms.strategies.first(later(0.0), wander)
        collect()


# -- laws -----------------------------------------------------------------------------------------------------------


def build(grid, seed, settings, *, commanded, is_async):
    ctx = grid(seed=seed, **settings)
    for i in range(6):
        name = "abcdef"[i]
        eyes = ctx.sensor.create_sensor(f"eyes {name}", SensorType.AGENT_RANGE, range=15)
        more = {"speed": 2} if i == 5 else {}
        team(ctx, name, start=2 * i, team=("red", "blue")[i % 2], strategy=decide, sensors=[eyes], **more)

    def plan(states):
        for state in states.values():
            decide(state)

    async def plan_later(states):
        for state in reversed(states.values()):
            await asyncio.sleep(0)
            decide(state)

    for one in (plan, plan_later):
        one.__module__, one.__qualname__ = decide.__module__, decide.__qualname__  # recordings name what decides
    for red in commanded:
        ctx.game.command(red, plan_later if is_async else plan)
    ctx.game.conflicts = Conflicts(capacity=1)
    return ctx


def decide(state):
    """Do all that a strategy may do, and what it may not."""
    wander(state)
    near = [name for name in state["sensor"][f"eyes {state['name']}"][1] if name != state["name"]]
    lot = state["draw"].below(8)
    if lot == 1:
        state["action"] = 15
    if lot == 2:
        del state["action"]
    state["memory"]["near"] = near


@settings(max_examples=8, suppress_health_check=list(HealthCheck))
@given(
    seed=st.integers(0, 1000),
    commanded=st.sets(st.sampled_from(["red", "blue"]), min_size=1),
    is_async=st.booleans(),
    turns=st.integers(1, 8),
)
def test_a_plan_that_calls_the_strategies_is_the_same_game(grid, seed, commanded, is_async, turns):
    settings = {"on_error": "stay"}
    files, results = [], []
    for teams in ((), sorted(commanded)):
        with build(grid, seed, settings, commanded=teams, is_async=is_async) as ctx:
            file = io.BytesIO()
            ctx.record.start(file)
            results.append(ctx.game.run(turns))
            for error in results[-1].errors:
                del error["message"]
            ctx.record.stop()
            files.append(file.getvalue())
    assert results[0] == results[1]
    assert files[0] == files[1]
