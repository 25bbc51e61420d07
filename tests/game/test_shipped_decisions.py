"""Turns in which the core decides for shipped strategies: nothing tells them from turns in which agents are asked."""

from contextlib import ExitStack

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import gamms
from gamms.errors import BadType
from gamms.game import native
from gamms.rules import Conflicts, reach, respawn, tag
from gamms.strategies import chase, first, flee, goto, mix, patrol, random_walk, random_waypoints
from gamms.typing import SensorType

pytestmark = pytest.mark.law
NODES = 20
QUIET = {"level": "CRITICAL"}


@pytest.fixture(autouse=True, scope="module")
def the_core_decides_at_once():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(native, "PATIENCE", 0.0)
        yield


def go_on(state):
    state["memory"]["n"] = state["memory"].get("n", 0) + 1
    state["action"] = state["draw"].choice(state["legal"])


def teach(state):
    state["team_memory"][state["name"]] = state["turn"]
    state["action"] = state["legal"][-1]


def fail_at_times(state):
    if state["draw"].below(3) == 0:
        raise BadType("no")
    state["action"] = state["legal"][0]


KINDS = {
    "walk": lambda ctx, node: random_walk,
    "goto": goto,
    "patrol": lambda ctx, node: patrol(ctx, [node, (node + 7) % NODES]),
    "wander": lambda ctx, node: random_waypoints(ctx, pause=1),
    "chase": lambda ctx, node: chase(ctx, otherwise=random_walk),
    "flee": lambda ctx, node: flee(ctx),
    "mix": lambda ctx, node: mix(0.5, goto(ctx, node), random_walk),
    "first": lambda ctx, node: first(chase(ctx, otherwise=None), patrol(ctx, [node])),
    "none": lambda ctx, node: None,
    "own": lambda ctx, node: go_on,
    "teacher": lambda ctx, node: teach,
    "failing": lambda ctx, node: fail_at_times,
}
RULES = {
    "tag": lambda: tag("red", "blue"),
    "eliminate": lambda: tag("red", "blue", then="eliminate"),
    "respawn": lambda: tag("blue", "red", then="respawn"),
    "return": lambda: respawn(2),
    "reach": lambda: reach("red", [NODES - 1]),
}


def asked(strategy):
    """Return a strategy of the program that does the same: the core does not know it."""

    def decide(state):
        strategy(state)

    return None if strategy is None else decide


def open_game(drawn, decide):
    """Return a context with a drawn game; `decide` is applied to each strategy."""
    agents, names_of_rules, has_conflicts, has_rule, seed = drawn
    ctx = gamms.create_context(seed=seed, logger_config=QUIET)
    ctx.graph.attach_networkx_graph(gamms.graph.grid(4, 5))
    ctx.agent.create_team("red", [])
    ctx.agent.create_team("blue", [])
    for i, (name, node, team, kind, sight) in enumerate(agents):
        near = ctx.sensor.create_sensor(f"near {i}", SensorType.NEIGHBOR)
        eyes = ctx.sensor.create_sensor(f"eyes {i}", SensorType.AGENT_RANGE, sensor_range=sight)
        strategy = decide(KINDS[kind](ctx, node))
        ctx.agent.create_agent(name, start_node_id=node, team=team, sensors=[near, eyes], strategy=strategy)
    ctx.game.on_error = "stay"
    if has_conflicts:
        ctx.game.conflicts = Conflicts(capacity=1)
    for name in names_of_rules:
        ctx.game.add(RULES[name]())
    if has_rule:
        ctx.game.add(count_turns)
    return ctx


def count_turns(ctx):
    ctx.game.data["turns"] = ctx.game.data.get("turns", 0) + 1


def pick(ctx, i, *, alive=True):
    agents = [agent for agent in ctx.agent.create_iter() if agent.alive or not alive]
    return agents[i % len(agents)] if agents else None


def plain_state(agent):
    return {key: value for key, value in agent.state.items() if key not in ("draw", "rng", "fork")}


def read_state(ctx, i):
    return plain_state(pick(ctx, i, alive=False))


def read_sensor(ctx, i):
    return {name: sensor.data for name, sensor in pick(ctx, i, alive=False).sensors.items()}


def draw_again(ctx, i):
    state = pick(ctx, i, alive=False).state
    return state["draw"].below(1000) if state else None


def step_aside(ctx, i):
    pick(ctx, i, alive=False).current_node_id = i % NODES


def eliminate(ctx, i):
    agent = pick(ctx, i)
    if agent is not None:
        ctx.game.eliminate(agent)


def bring_back(ctx, i):
    ctx.game.respawn(pick(ctx, i, alive=False))


def forget(ctx, i):
    pick(ctx, i, alive=False).state.get("memory", {}).clear()


def close_a_road(ctx, i):
    open_roads = [*ctx.graph.graph.get_edges()]
    ctx.graph.close_roads(open_roads[i % len(open_roads) : i % len(open_roads) + 1] if open_roads else [])


def change_team(ctx, i):
    pick(ctx, i, alive=False).team = ("red", "blue")[i % 2]


def tell_a_team(ctx, i):
    ctx.game.team_memories.setdefault(("red", "blue")[i % 2], {})["told"] = i


def set_order(ctx, i):
    ctx.game.order = (None, [["red"], ["blue", None]], [[None, "blue"], ["red"]], [["blue"], ["red"], [None]])[i % 4]


def look_ahead(ctx, i):
    ahead = ctx.game.fork(i)
    ahead.step()
    found = [(agent.name, agent.current_node_id, plain_state(agent)) for agent in ahead.ctx.agent.create_iter()]
    ahead.ctx.terminate()
    return found


def go_back(ctx, i):
    before = ctx.game.snapshot()
    for _ in range(i % 4):
        ctx.game.step()
    ctx.game.restore(before)


DEEDS = {
    "nothing": lambda ctx, i: None,
    "run": lambda ctx, i: ctx.game.run(i % 30).row(),
    "state": read_state,
    "sensor": read_sensor,
    "draw": draw_again,
    "step aside": step_aside,
    "eliminate": eliminate,
    "bring back": bring_back,
    "forget": forget,
    "road": close_a_road,
    "team": change_team,
    "fork": look_ahead,
    "restore": go_back,
    "reset": lambda ctx, i: ctx.game.reset(seed=i),
    "moves": lambda ctx, i: dict(ctx.game.moves),
    "counts": lambda ctx, i: counted(ctx),
    "memories": lambda ctx, i: {name: dict(memory) for name, memory in ctx.game.memories.items()},
}


def counted(ctx):
    """Return what was counted; an agent of whom nothing was may be missing in a restored game."""
    return {name: counts for name, counts in ctx.game.counts.items() if any(counts.values())}


def everything(ctx):
    """Return all that can be read of a game."""
    agents = [
        (agent.name, agent.current_node_id, agent.prev_node_id, agent.alive, plain_state(agent), agent.orientation)
        for agent in ctx.agent.create_iter()
    ]
    game = ctx.game
    seen = [{name: sensor.data for name, sensor in agent.sensors.items()} for agent in ctx.agent.create_iter()]
    return agents, seen, dict(game.moves), game.events, dict(game.scores), counted(ctx), dict(game.data), game.turn


AGENTS = st.lists(
    st.tuples(
        st.text("abxyz", min_size=1, max_size=3),
        st.integers(0, NODES - 1),
        st.sampled_from(["red", "blue", None]),
        st.sampled_from(sorted(KINDS)),
        st.sampled_from([15.0, 25.0]),
    ),
    min_size=1,
    max_size=8,
    unique_by=lambda agent: agent[0],
)
GAMES = st.tuples(
    AGENTS,
    st.lists(st.sampled_from(sorted(RULES)), max_size=2, unique=True),
    st.booleans(),
    st.booleans(),
    st.integers(0, 9),
)
DONE = st.lists(st.tuples(st.integers(0, 3), st.sampled_from(sorted(DEEDS)), st.integers(0, 99)), max_size=8)


@settings(max_examples=80, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(GAMES, DONE)
def test_a_game_of_shipped_strategies_is_one_in_which_all_are_asked(drawn, done):
    with open_game(drawn, lambda one: one) as ours, open_game(drawn, asked) as theirs:
        for turns, deed, i in done:
            for _ in range(turns):
                assert ours.game.step() == theirs.game.step()
            found, wanted = DEEDS[deed](ours, i), DEEDS[deed](theirs, i)
            assert found == wanted
        assert everything(ours) == everything(theirs)


def crowd(agents=6, **options):
    ctx = gamms.create_context(seed=1, logger_config=QUIET)
    ctx.graph.attach_networkx_graph(gamms.graph.grid(4, 5))
    for i in range(agents):
        team = ("red", "blue")[i % 2]
        ctx.agent.create_agent(f"a{i}", start_node_id=3 * i, team=team, strategy=random_walk, **options)
    return ctx


def test_a_state_that_is_read_late_is_that_of_the_turn_in_which_it_was_made():
    with crowd() as ctx:
        ctx.game.step()
        before = {agent.name: agent.current_node_id for agent in ctx.game.agents}
        ctx.game.step()
        after = {agent.name: agent.current_node_id for agent in ctx.game.agents}
        states = {agent.name: agent.state for agent in ctx.game.agents}
        assert {name: state["curr_pos"] for name, state in states.items()} == before
        assert {name: state["action"] for name, state in states.items()} == after
        assert {state["turn"] for state in states.values()} == {1}
        assert {agent.name: agent.current_node_id for agent in ctx.game.agents} == after


def test_an_eliminated_agent_keeps_the_state_of_its_last_turn():
    with crowd() as ctx:

        @ctx.game.add
        def remove_one(ctx):
            if ctx.game.turn == 3:
                ctx.game.eliminate("a4")

        for _ in range(6):
            ctx.game.step()
        state = ctx.agent.get_agent("a4").state
        assert (state["turn"], state["action"]) == (2, ctx.agent.get_agent("a4").current_node_id)
        assert ctx.agent.get_agent("a5").state["turn"] == 5


def test_a_rule_reads_the_states_of_its_turn():
    with crowd() as ctx:
        read = []
        ctx.game.add(lambda ctx: read.append([agent.state["turn"] for agent in ctx.game.agents]))
        for _ in range(4):
            ctx.game.step()
        assert read == [[turn] * 6 for turn in range(4)]


def test_a_change_after_the_moves_does_not_change_observations():
    with crowd(1) as ctx:
        near = ctx.sensor.create_sensor("near", SensorType.NEIGHBOR)
        agent = ctx.agent.get_agent("a0")
        agent.register_sensor("near", near)

        @ctx.game.add
        def build(ctx):
            ctx.graph.close_roads([*ctx.graph.graph.get_edges()])

        ctx.game.step()
        assert (agent.state["curr_pos"], agent.state["legal"]) == (0, (0, 1, 5))
        assert agent.state["sensor"]["near"][1] == [0, 1, 5]


def test_an_error_in_a_rule_leaves_states_that_can_be_read():
    with crowd() as ctx:

        @ctx.game.add
        def fail(ctx):
            if ctx.game.turn == 2:
                raise BadType("no")

        ctx.game.step()
        with pytest.raises(BadType):
            ctx.game.step()
        assert {agent.state["turn"] for agent in ctx.game.agents} == {1}
        ctx.game.step()
        assert {agent.state["turn"] for agent in ctx.game.agents} == {2}


def test_states_outlive_their_context():
    with ExitStack() as stack:
        ctx = stack.enter_context(crowd())
        ctx.game.step()
        agents = ctx.game.agents
    assert [agent.state["turn"] for agent in agents] == [0] * 6


def walks(decide, turns, look):
    """Return what `look` returns after each turn of agents that remember; it gets the context and its memories."""
    with crowd(0) as ctx:
        for i, node in enumerate((0, 7, 13)):
            strategy = decide(patrol(ctx, [node, 19 - node, 4]))
            ctx.agent.create_agent(f"a{i}", start_node_id=node, team="red", strategy=strategy)
        ctx.game.step()
        memories = ctx.game.memories
        found = []
        for _ in range(turns):
            ctx.game.step()
            found.append(look(ctx, memories))
        return found


def read_all(ctx, memories):
    return [dict(memory) for memory in memories.values()], [agent.current_node_id for agent in ctx.game.agents]


def write_one(ctx, memories):
    memories["a1"].clear()
    return read_all(ctx, memories)


@pytest.mark.parametrize("look", [read_all, write_one])
def test_a_memory_that_a_program_holds_is_that_of_the_agent(look):
    assert walks(lambda one: one, 12, look) == walks(asked, 12, look)


def test_numbers_that_a_program_draws_from_a_state_are_not_drawn_again():
    drawn = []
    for decide in (lambda one: one, asked):
        with crowd(0) as ctx:
            agent = ctx.agent.create_agent("a", start_node_id=0, strategy=decide(random_walk))
            ctx.agent.create_agent("b", start_node_id=9, strategy=decide(random_walk))
            ctx.game.step()
            draw = agent.state["draw"]
            numbers = []
            for _ in range(12):
                ctx.game.step()
                numbers += [draw.below(1000), agent.current_node_id, ctx.agent.get_agent("b").state["turn"]]
                numbers.append(draw.below(1000))
            drawn.append(numbers)
    assert drawn[0] == drawn[1]


def test_a_strategy_of_a_dead_agent_may_name_a_node_that_was_removed():
    with crowd() as ctx:
        ctx.agent.create_agent("late", start_node_id=1, strategy=goto(ctx, 19))
        ctx.game.step()
        ctx.game.eliminate("late")
        ctx.graph.graph.remove_node(19)
        assert ctx.game.step()


@pytest.mark.parametrize("stop", [-1, -2, 99])
def test_a_stop_that_a_program_has_written_is_looked_up_as_python_does(stop):
    moves = []
    for decide in (lambda one: one, asked):
        with crowd(0) as ctx:
            for name in "ab":
                ctx.agent.create_agent(name, start_node_id=0, strategy=decide(patrol(ctx, [0, 7, 13])))
            ctx.game.step()
            (key,) = ctx.game.memories["a"]
            ctx.game.memories["a"][key] = stop
            try:
                for _ in range(5):
                    ctx.game.step()
            except IndexError:
                pass
            moves.append([agent.current_node_id for agent in ctx.game.agents])
    assert moves[0] == moves[1]
