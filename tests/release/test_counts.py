"""Counts that stand for speed: the same on every machine, so an upper bound can be a test. Each bound leaves a tenth.

They are of CPython 3.11 and later; a version that inlines comprehensions counts less. Where a bound is passed, either
find what came in, or measure (`benchmarks/run.py`) and raise the bound with that number in the commit.
"""

import subprocess
import sys
import tracemalloc

import pytest

import gamms
from gamms.sensor import SensorType

AGENTS, TURNS = 20, 30


@pytest.fixture
def ctx():
    """Agents that walk on a grid, each with a sensor of its neighbours; what is remembered has been looked up."""
    ctx = gamms.create_context(seed=1)
    ctx.graph.attach_networkx_graph(gamms.graph.grid(12, 12))
    for i in range(AGENTS):
        eyes = ctx.sensor.create_sensor(f"eyes{i}", SensorType.NEIGHBOR)
        ctx.agent.create_agent(f"a{i}", start_node_id=i, sensors={"eyes": eyes}, strategy=stay)
    ctx.game.max_turns = 10_000
    for _ in range(40):  # the abstract classes of Python, too, keep of which classes they were asked
        ctx.game.step()
    yield ctx
    ctx.terminate()


def stay(state):
    state["action"] = state["legal"][0]


def test_importing_gamms_loads_few_modules():
    assert modules_loaded_by("import gamms") <= 46  # 41


def test_a_first_context_loads_few_modules_beyond_those_of_numpy():
    first = modules_loaded_by("import gamms; gamms.create_context()")
    assert first - modules_loaded_by("import numpy") <= 149  # of which the compiled core needs 21


def modules_loaded_by(code):
    """Return how many modules a new interpreter loads for the code."""
    counted = f"import sys; sys.path[:0] = {sys.path!r}; before = set(sys.modules); {code}"
    counted += "; print(len(set(sys.modules) - before))"
    return int(subprocess.check_output([sys.executable, "-S", "-c", counted], text=True))


def test_a_step_of_an_agent_makes_few_calls(ctx):
    calls = 0

    def count(_frame, event, _argument):
        nonlocal calls
        calls += event in ("call", "c_call")

    sys.setprofile(count)
    try:
        for _ in range(TURNS):
            ctx.game.step()
    finally:
        sys.setprofile(None)
    assert calls / (TURNS * AGENTS) <= 9.0  # 8.1


def test_making_a_batch_lists_its_agents_as_often_for_many_as_for_few():
    assert listings_of_agents(40) == listings_of_agents(10)


def listings_of_agents(agents):
    """Count how often the agents of a game are listed while a batch of it is made."""
    ctx, code, listed = gamms.create_context(seed=1), gamms.game.Game.agents.fget.__code__, 0
    ctx.graph.attach_networkx_graph(gamms.graph.grid(4, 4))
    ctx.agent.create_team("red", [0] * agents, strategy=gamms.strategies.random_walk)

    def count(frame, event, _argument):
        nonlocal listed
        listed += event == "call" and frame.f_code is code

    sys.setprofile(count)
    try:
        batch = ctx.game.batch(1)
    finally:
        sys.setprofile(None)
    batch.close()
    ctx.terminate()
    return listed


def test_a_turn_allocates_little_and_keeps_little(ctx):
    tracemalloc.start()
    try:
        before = tracemalloc.get_traced_memory()[0]
        for _ in range(TURNS):
            ctx.game.step()
        after, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert (peak - before) / AGENTS <= 5_900  # 5,300
    assert (after - before) / (TURNS * AGENTS) <= 100  # 90, of which 60 once


def test_a_turn_of_a_small_game_makes_few_calls():
    teams = {team: {"count": 5, "strategy": "gamms.strategies:random_walk"} for team in ("red", "blue")}
    rules = [
        {"rule": "tag", "with": {"taggers": "red", "tagged": "blue"}},
        {"rule": "time_limit", "with": {"turns": 90}},
    ]
    scenario = gamms.scenario.Scenario(map={"grid": {"width": 90, "height": 90}}, teams=teams, rules=rules, seed=1)
    calls = 0

    def count(_frame, event, _argument):
        nonlocal calls
        calls += event == "call"

    with scenario.build() as ctx:
        for _ in range(30):
            ctx.game.step()
        ctx.game.run(max_turns=1)
        sys.setprofile(count)
        try:
            ctx.game.run(max_turns=TURNS)
        finally:
            sys.setprofile(None)
    assert calls / TURNS <= (85 if gamms.core.is_compiled else 290)  # 73 and 264; 31 by strategies and their draws
