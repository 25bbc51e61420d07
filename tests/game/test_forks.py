"""A fork goes on from where the game is, with other random numbers, and leaves the game alone."""

import copy
import random
import threading
from concurrent.futures import ThreadPoolExecutor

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from test_snapshots import build, plain, wander

import gamms
from gamms import rules
from gamms.errors import BadType, ContextTerminated, IllegalMutation
from gamms.game import Game, SnapshotError
from gamms.game.game import UnreadFork
from gamms.game.snapshots import get_counterpart
from gamms.sensor import SensorType


def seen(game):
    """All that can be seen of a game but for its seed."""
    found = plain(game.ctx)
    del found["result"]["seed"]
    return found


def places(game):
    return {name: agent.current_node_id for name, agent in game.ctx.agent.agents.items()}


@pytest.fixture
def game(grid):
    ctx = build(grid)
    ctx.game.run(3)
    yield ctx.game
    ctx.terminate()


def test_a_memo_of_copies_does_not_confuse_a_new_object_with_a_deleted_one():
    """Dicts that come later, in the places of those that are gone, were taken for what had been copied."""

    class Plan:
        def __init__(self):
            self.seen = [{}]

        def __call__(self, state):
            state["action"] = state["curr_pos"]

    memo, plan = {}, Plan()
    assert get_counterpart(plan, memo).seen is not plan.seen
    assert not [one for one in [{} for _ in range(100)] if id(one) in memo]


def test_a_fork_begins_as_the_game_is(game):
    assert seen(game.fork(1)) == seen(game)


def test_a_copy_of_the_context_plays_the_same_turns(game):
    random.seed(1)
    game.observation(next(iter(game.agents)))["draw"].bits()  # what was drawn since the last turn counts
    twin = copy.deepcopy(game.ctx)
    assert plain(twin) == plain(game.ctx)
    assert [twin.rng.random(), *twin.graph.place(3)] == [game.ctx.rng.random(), *game.ctx.graph.place(3)]
    for ctx in (game.ctx, twin):
        ctx.game.run(9)
    assert plain(twin) == plain(game.ctx)
    twin.terminate()


@pytest.mark.parametrize("turns", [0, 3])
def test_copies_of_games_with_teams_and_strategies_of_the_context_play_the_same_turns(grid, turns):
    with grid(side=9, seed=4) as ctx:
        ctx.sensor.create_sensor("near", "AGENT_RANGE", sensor_range=30.0)
        ctx.agent.create_team("blue", [80] * 6, strategy=gamms.strategies.random_walk)
        for number in range(3):
            near = ctx.sensor.create_sensor(f"near{number}", "AGENT_RANGE", sensor_range=30.0)
            strategy = gamms.strategies.chase(ctx)
            ctx.agent.create_agent(
                f"red_{number}", start_node_id=number, team="red", sensors=[near.sensor_id], strategy=strategy
            )
        ctx.game.add(rules.tag("red", "blue"))
        ctx.game.run(turns)
        with copy.deepcopy(ctx) as twin:
            assert twin.game.run(turns + 9) == ctx.game.run(turns + 9)
            assert places(twin.game) == places(ctx.game)
            assert twin.agent.get_agent("red_0").current_node_id != 0


def test_the_game_leaves_its_forks_alone(game):
    fork = game.fork(1)
    before = seen(fork)
    game.run(5)
    assert seen(fork) == before


def test_a_fork_draws_other_numbers(game):
    games = [game.fork(3), game.fork(3), game.fork(2), game.fork(game.ctx.seed), game]
    for one in games:
        one.run(4)
    drawn = [seen(one) for one in games]
    assert drawn[0] == drawn[1]
    assert all(one != other for i, one in enumerate(drawn[1:]) for other in drawn[i + 2 :])


def test_forks_of_forks_and_snapshots_in_forks(game):
    fork = game.fork(1)
    here = fork.snapshot()
    first = seen(fork) if fork.run(3) else None
    fork.restore(here)
    nested = fork.fork(7)
    nested.run(3)
    assert seen(fork.fork(7)) == seen(fork)
    fork.run(3)
    assert seen(fork) == first
    with pytest.raises(gamms.errors.BadValue, match="another context"):
        fork.restore(game.snapshot())


def test_agents_respawn_in_a_fork_where_they_began_in_the_game(game):
    fork = game.fork(1)
    fork.respawn("a3")
    assert (fork.start_node("a3"), places(fork)["a3"]) == (15, 15)


# -- the map --------------------------------------------------------------------------------------------------------


def test_a_game_changes_its_own_map_in_place_once_its_forks_are_gone(grid, collect):
    with grid() as ctx:
        fork = ctx.game.fork(1)
        nodes = ctx.graph.graph._store.nodes
        assert fork.ctx.graph.graph._store.nodes is nodes
        del fork
        collect()
        ctx.graph.graph.remove_edge(3)
        assert ctx.graph.graph._store.nodes is nodes


# -- what functions hold --------------------------------------------------------------------------------------------


def test_objects_are_copied_and_uncopyable_ones_are_shared(grid):
    class Strategy:
        def __init__(self, *held):
            self.calls, self.held = 0, held

        def __call__(self, state):
            self.calls += 1
            state["action"] = state["curr_pos"]

    with grid() as ctx:
        own, shared = Strategy(ctx), Strategy(threading.Lock())
        lock = threading.Lock()
        agent = ctx.agent.create_agent("own", start_node_id=0, strategy=own, meta={"lock": lock, "hp": [1]})
        ctx.agent.create_agent("shared", start_node_id=0, strategy=shared)
        fork = ctx.game.fork(1)
        fork.step()
        twin = fork.ctx.agent.get_agent("own")
        assert (own.calls, twin.strategy.calls, shared.calls) == (0, 1, 1)
        assert twin.strategy.held == (fork.ctx,)
        assert twin.meta["lock"] is lock
        assert agent.meta is not None


def closed_over(ctx):
    """Return a rule and a strategy that close over the context, and the list of their observations of it."""
    noted = []

    def rule(ctx_of_rule):
        noted.append(ctx_of_rule is ctx)
        ctx.game.data["turns"] = ctx.game.data.get("turns", 0) + 1

    def strategy(state):
        noted.append(ctx.agent.get_agent("closed").state is state)
        state["memory"].setdefault("nodes", []).append(state["curr_pos"])
        state["action"] = state["curr_pos"]

    return rule, strategy, noted


def change_everything(ctx):
    """Change what a program can change of a game between two turns."""
    agent = ctx.agent.get_agent("closed")
    agent.current_node_id = 8
    agent.energy["left"].append(0)
    agent.state["memory"]["nodes"].append("changed")
    agent.state["team_memory"]["changed"] = True
    agent.strategy = wander
    ctx.sensor.get_sensor("eyes").range = 1.0
    ctx.game.data["turns"] = -1
    ctx.game.scores["red"] = 7
    ctx.game.max_turns = 99
    ctx.game.default_action = 0
    ctx.game.remove("rule")
    ctx.agent.create_agent("late", start_node_id=0)


@pytest.mark.parametrize("is_original", [True, False])
def test_a_fork_and_its_game_show_nothing_of_later_changes_of_each_other(grid, is_original):
    with grid() as ctx:
        rule, strategy, noted = closed_over(ctx)
        ctx.sensor.create_sensor("eyes", SensorType.AGENT_RANGE, sensor_range=15)
        agent = ctx.agent.create_agent("closed", start_node_id=4, team="red", sensors=["eyes"], strategy=strategy)
        agent.energy = {"left": [1, 2]}
        ctx.game.add(rule)
        ctx.game.run(2)
        fork = ctx.game.fork(1)
        changed, other = (ctx, fork.ctx) if is_original else (fork.ctx, ctx)
        before = copy.deepcopy(seen(other.game))
        change_everything(changed)
        twin = other.agent.get_agent("closed")
        assert seen(other.game) == before
        assert twin.energy == {"left": [1, 2]}
        assert twin.state["memory"] == {"nodes": [4, 4]}
        assert "changed" not in twin.state["team_memory"]
        assert other.sensor.get_sensor("eyes").range == 15.0
        assert (other.game.max_turns, other.game.default_action) == (None, "stay")
        noted.clear()
        other.game.run(1)
        assert noted == [True, True]
        assert other.game.data["turns"] == 3


def test_a_fork_is_played_on_with_the_memories_in_the_states_of_its_agents(grid):
    with grid() as ctx:
        _, strategy, _ = closed_over(ctx)
        ctx.agent.create_agent("closed", start_node_id=4, team="red", strategy=strategy)
        ctx.game.run(1)
        twin = ctx.game.fork(1).ctx.agent.get_agent("closed")
        memory = twin.state["memory"]
        twin._ctx.game.run(1)
        assert twin.state["memory"] is memory
        assert memory == {"nodes": [4, 4]}
        assert ctx.agent.get_agent("closed").state["memory"] == {"nodes": [4]}


@pytest.mark.parametrize("shares_memory", [True, False])
def test_the_states_of_a_fork_have_a_team_memory_only_where_teams_have_one(grid, shares_memory):
    with grid() as ctx:
        ctx.game.team_memory = shares_memory
        ctx.agent.create_agent("a", start_node_id=4, team="red", strategy=lambda state: state.update(action=4))
        ctx.game.run(1)
        twin = ctx.game.fork(1).ctx.agent.get_agent("a")
        assert ("team_memory" in twin.state) == ("team_memory" in ctx.agent.get_agent("a").state) == shares_memory


CHANGES = {
    "play": lambda game: game.run(1),
    "draw": lambda game: game.observation(game.agents[0])["draw"].bits(),
    "delete": lambda game: game.ctx.agent.delete_agent("c"),
    "create": lambda game: game.ctx.agent.create_agent(f"late {len(game.agents)}", start_node_id=0),
    "kill": lambda game: setattr(game.ctx.agent.get_agent("b"), "alive", False),
    "reseed": lambda game: game.ctx.reseed(5),
    "remember": lambda game: game.agents[0].state.get("team_memory", {}).setdefault("noted", []).append(game.turn),
    "reset": lambda game: game.reset(),
}


@settings(max_examples=20, suppress_health_check=list(HealthCheck))
@given(turns=st.integers(1, 3), changes=st.lists(st.sampled_from(sorted(CHANGES)), max_size=3, unique=True))
def test_the_states_of_a_fork_that_is_read_late_are_those_of_one_that_is_read_at_once(grid, turns, changes):
    def draw(game):
        own = [(agent.alive, agent.state) for agent in game.agents]
        return [
            (alive, state["team_memory"], "draw" in state and (state["draw"].bits(), state["rng"].random()))
            for alive, state in own
        ]

    with grid() as ctx:
        for name in "abc":
            ctx.agent.create_agent(name, start_node_id=4, team="red", strategy=wander)
        ctx.game.run(turns)
        drawn = draw(ctx.game.fork(1))
        late = ctx.game.fork(1)
        for change in changes:
            CHANGES[change](ctx.game)
        assert draw(late) == drawn
        assert late.agents[0].state["draw"] is late.observation(late.agents[0])["draw"]


def remove_a_road(game):
    graph = game.ctx.graph.graph
    if 3 in graph.get_edges():
        graph.remove_edge(3)


WHEREABOUTS = {
    **CHANGES,
    "place": lambda game: setattr(game.ctx.agent.get_agent("a"), "current_node_id", 15),
    "attribute": lambda game: game.ctx.agent.get_agent("a").bag.append("more"),
    "new attribute": lambda game: setattr(game.ctx.agent.get_agent("a"), "cargo", {"new": [1]}),
    "team": lambda game: setattr(game.ctx.agent.get_agent("a"), "team", "blue"),
    "strategy": lambda game: setattr(game.ctx.agent.get_agent("a"), "strategy", wander),
    "deregister": lambda game: game.ctx.agent.get_agent("a").deregister_sensor("eyes"),
    "member": lambda game: setattr(game.ctx.agent.get_agent("m_1"), "energy", 99),
    "range": lambda game: setattr(game.ctx.sensor.get_sensor("eyes"), "range", 1.0),
    "conflicts": lambda game: setattr(game.conflicts, "allow_swaps", False),
    "function": lambda game: setattr(game.ctx.sensor.get_sensor("inbox"), "function", lambda node_id: -node_id),
    "sensor": lambda game: game.ctx.sensor.create_sensor(f"more {len(game.ctx.sensor.sensors)}", SensorType.MAP),
    "memory": lambda game: game.memories.get("a", {}).clear(),
    "data": lambda game: game.data.setdefault("list", []).append(0),
    "score": lambda game: game.scores.update(red=99),
    "publish": lambda game: game.publish(said=game.turn),
    "emit": lambda game: game.emit("noise"),
    "rule": lambda game: game.add(lambda ctx: ctx.game.emit("late rule"), name=f"late {len(game.rules)}"),
    "no rule": lambda game: game.remove("count") if any(one.name == "count" for one in game.rules) else None,
    "setting": lambda game: setattr(game, "on_error", "stay"),
    "road": remove_a_road,
    "attribute of ctx": lambda game: setattr(game.ctx, "note", "later"),
    "what a rule holds": lambda game: game.ctx.held.append(game.ctx.agent.get_agent("a")),
    "what a cell holds": lambda game: game.ctx.swap(),
}


def game_of_plain_values(grid):
    """Return a game with functions that close over it, and with plain values: its forks are made when they are read."""
    ctx = grid()
    ctx.sensor.create_sensor("eyes", SensorType.AGENT_RANGE, sensor_range=15)
    held, agent = [ctx, {"ctx": ctx}], None

    def stroll(state):
        state["memory"].setdefault("turns", []).append(ctx.game.turn)
        state["team_memory"].setdefault("seen", set()).add(state["name"])
        state["action"] = state["draw"].choice(state["legal"])

    def count(of):
        of.game.data.setdefault("list", []).append([one is of for one in held[:1]])
        of.game.scores["red"] += agent is None or agent._ctx is of

    def swap():
        nonlocal agent
        agent = ctx.agent.get_agent("b")

    ctx.held, ctx.swap, ctx.note = held, swap, "first"
    ctx.sensor.from_function("inbox", lambda node_id: [node_id, ctx.game.turn])
    ctx.game.conflicts = rules.Conflicts(capacity=4, resolve=lambda contest, ctx: contest.movers[: contest.places])
    for name, sensors in zip("abc", (["eyes"], ["inbox"], []), strict=True):
        ctx.agent.create_agent(name, start_node_id=4, team="red", strategy=stroll, sensors=sensors)
    ctx.agent.get_agent("a").bag = ["first"]
    ctx.agent.create_team("m", [0, 1], strategy=wander, columns={"energy": [1, 2]})
    ctx.game.add(count)
    ctx.game.add(rules.tag("red", "m"))
    ctx.game.collect("where", len_of_red)
    return ctx


def len_of_red(ctx):
    return len(ctx.agent.agents)


def whole(game):
    own = {one.name: (vars(one), one.state.get("memory"), [*one.sensors]) for one in game.agents}
    ranges = {name: getattr(one, "range", None) for name, one in game.ctx.sensor.sensors.items()}
    edges = [*game.ctx.graph.graph.get_edges()]
    settings = game.on_error, game.conflicts.allow_swaps
    return copy.deepcopy((seen(game), own, ranges, edges, settings, game.facts, game.ctx.note))


@settings(max_examples=30, suppress_health_check=list(HealthCheck), deadline=None)
@given(turns=st.integers(0, 3), changes=st.lists(st.sampled_from(sorted(WHEREABOUTS)), max_size=4, unique=True))
def test_a_fork_that_is_read_late_is_the_game_as_it_was(grid, turns, changes):
    with game_of_plain_values(grid) as ctx:
        ctx.game.run(turns)
        early, late = ctx.game.fork(1), ctx.game.fork(1)
        at_once, changed = whole(early), ctx.game.fork(2)
        assert type(late) is UnreadFork
        assert isinstance(late, Game)
        for change in changes:
            WHEREABOUTS[change](ctx.game)
        ctx.terminate()
        assert whole(late) == at_once
        assert type(late) is Game
        early.run(3)
        late.run(3)
        assert whole(late) == whole(early)
        assert late.ctx.game is late
        for change in changes:
            WHEREABOUTS[change](changed)


@settings(max_examples=25, suppress_health_check=list(HealthCheck), deadline=None)
@given(turns=st.integers(0, 3), changes=st.lists(st.sampled_from(sorted(WHEREABOUTS)), max_size=4, unique=True))
def test_a_game_shows_nothing_of_changes_by_which_its_fork_is_read_first(grid, turns, changes):
    with game_of_plain_values(grid) as ctx:
        ctx.game.run(turns)
        before = whole(ctx.game)
        for change in changes:
            if change != "what a rule holds" and change != "what a cell holds":  # lists that functions hold are shared
                WHEREABOUTS[change](ctx.game.fork(1))
        assert whole(ctx.game) == before


def test_objects_that_can_change_are_copied_when_a_fork_is_taken(grid):
    class Counter:
        calls = 0

        def __call__(self, state):
            self.calls += 1
            state["action"] = state["curr_pos"]

    with game_of_plain_values(grid) as ctx:
        ctx.agent.get_agent("a").strategy = Counter()
        fork = ctx.game.fork(1)
        assert type(fork) is Game
        ctx.game.run(2)
        assert fork.ctx.agent.get_agent("a").strategy.calls == 0
        ctx.agent.get_agent("a").strategy = wander
        ctx.agent.get_agent("b").friend = ctx.agent.get_agent("a")
        fork = ctx.game.fork(1)
        ctx.agent.get_agent("b").friend = None
        assert fork.ctx.agent.get_agent("b").friend is fork.ctx.agent.get_agent("a")


def test_one_thread_makes_a_fork_that_several_read_first(grid):
    with game_of_plain_values(grid) as ctx:
        ctx.game.run(2)
        for _ in range(20):
            fork = ctx.game.fork(1)
            with ThreadPoolExecutor(4) as pool:
                found = [*pool.map(lambda name, fork=fork: getattr(fork, name), ["ctx"] * 8)]
            assert len({*map(id, found)}) == 1


def test_a_fork_is_read_while_agents_of_its_game_decide(grid):
    with game_of_plain_values(grid) as ctx:
        ctx.game.run(2)
        fork, read = ctx.game.fork(1), []

        def peek(state):
            read.append((fork.turn, fork.run(2).turns))
            state["action"] = state["curr_pos"]

        ctx.agent.get_agent("a").strategy = peek
        ctx.game.step()
        assert read == [(2, 4)]


def test_agents_of_a_fork_share_the_sensors_that_agents_share(grid):
    with grid() as ctx:
        ctx.sensor.create_sensor("eyes", SensorType.AGENT_RANGE, sensor_range=15)
        for name in ("a", "b"):
            ctx.agent.create_agent(name, start_node_id=0, sensors=["eyes"], strategy=wander)
        agents = ctx.game.fork(1).ctx.agent.agents
        assert agents["a"].sensors["eyes"] is agents["b"].sensors["eyes"]
        assert agents["a"].get_state()["sensor"]["eyes"][1].keys() == {"b"}
        assert agents["b"].get_state()["sensor"]["eyes"][1].keys() == {"a"}


def test_sensors_of_a_fork_are_its_own(grid):
    with grid() as ctx:
        looks = []
        ctx.sensor.from_function("inbox", lambda node_id, agent: looks.append(ctx.game.turn))
        ctx.sensor.create_sensor("eyes", SensorType.AGENT_RANGE, sensor_range=15, detection=0.5)
        ctx.agent.create_agent("a", start_node_id=0, sensors=["inbox", "eyes"], strategy=wander)
        ctx.agent.create_agent("b", start_node_id=0, sensors=["eyes"], strategy=wander)
        ctx.game.run(2)
        fork = ctx.game.fork(1)
        fork.ctx.sensor.get_sensor("eyes").range = 99.0
        fork.turn = 7
        fork.step()
        assert looks[-1] == 7
        assert ctx.sensor.get_sensor("eyes").range == 15.0
        assert fork.ctx.agent.get_agent("b").sensors["eyes"] is fork.ctx.sensor.get_sensor("eyes")
        states = [one.get_state() for one in (ctx.agent.get_agent("b"), fork.ctx.agent.get_agent("b"))]
        assert states[0]["sensor"] is not states[1]["sensor"]


# -- when -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("form", ["columns", "objects", "deleted"])
def test_the_team_of_a_fork_is_its_own(grid, form):
    ctx = gamms.create_context(seed=1)
    ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 3))
    ctx.sensor.create_sensor("near", SensorType.NEIGHBOR)
    sensors = ["near"] if form == "objects" else []
    team = ctx.agent.create_team("red", [0, 1, 3], columns={"energy": [1, 2, 3]}, sensors=sensors)
    if form == "deleted":
        team.agents[1].energy = 7
        _ = team.agents[2]
        ctx.agent.delete_agent("red_2")
    seen = []

    def shift(ctx):
        team.move([1, 4, 0])
        team.set("energy", team["energy"] + 1)
        seen.append((team.node_ids.tolist(), team["energy"].tolist()))

    ctx.game.add(shift)
    before = team.node_ids.tolist(), team["energy"].tolist()
    ahead = ctx.game.fork(2)
    ahead.step()
    assert (team.node_ids.tolist(), team["energy"].tolist()) == before
    assert [agent.current_node_id for agent in ahead.agents] == [1, 4, 0][: len(ctx.agent.agents)]
    ctx.game.step()
    assert seen[0] == seen[1]
    ctx.terminate()


@pytest.mark.parametrize("come", range(3))
def test_agents_of_a_fork_meet_where_they_are_in_the_fork(grid, come):
    """Agents that came between the last turn and the fork were left out, where versions of both games were equal."""
    ctx = grid()
    for name, team, node in (("a", "red", 5), ("b", "blue", 6)):
        ctx.agent.create_agent(name, start_node_id=node, team=team, strategy=gamms.strategies.stay)
    ctx.game.step()
    for number in range(come):
        ctx.agent.create_agent(f"c{number}", start_node_id=6, team="red")
    fork = ctx.game.fork(1)
    assert len(rules.contacts(fork.ctx, "red", "blue")) == come
    fork.ctx.agent.get_agent("a").current_node_id = 6
    assert len(rules.contacts(fork.ctx, "red", "blue")) == come + 1
    assert len(rules.contacts(ctx, "red", "blue")) == come


def test_a_fork_by_metres_knows_how_its_agents_moved_when_the_game_goes_on(grid):
    ctx = grid(speed_unit="metres")
    agent = ctx.agent.create_agent("a", start_node_id=0, speed=0.7, strategy=gamms.strategies.random_walk)
    ctx.game.step()
    fork, tracks = ctx.game.fork(1), ctx.game.tracks([agent])
    ctx.game.step()
    assert fork.tracks(fork.agents) == tracks


def test_forks_belong_to_the_program_that_runs_the_game(grid):
    with grid() as ctx:
        refused = []

        def cheat(state):
            state["action"] = 0
            with pytest.raises(IllegalMutation, match=r"call ctx\.game\.fork"):
                ctx.game.fork(1)
            with pytest.raises(IllegalMutation, match=r"call ctx\.fork"):
                ctx.fork(1)
            refused.append("strategy")

        @ctx.game.add
        def rule(_):
            with pytest.raises(SnapshotError, match="middle of a turn"):
                ctx.game.fork(1)
            refused.append("rule")

        ctx.agent.create_agent("a", start_node_id=0, strategy=cheat)
        ctx.game.step()
        assert refused == ["strategy", "rule"]
        with pytest.raises(BadType):
            ctx.game.fork("one")
    with pytest.raises(ContextTerminated):
        ctx.game.fork(1)


@settings(max_examples=10, suppress_health_check=list(HealthCheck))
@given(
    before=st.integers(0, 6),
    ahead=st.integers(1, 4),
    seeds=st.lists(st.integers(0, 9), min_size=1, max_size=3),
    after=st.integers(1, 4),
)
def test_a_game_goes_on_as_if_it_was_never_forked(grid, before, ahead, seeds, after):
    with build(grid) as forked, build(grid) as alone:
        for ctx in (forked, alone):
            ctx.game.run(before)
        results = {}
        for seed in [*seeds, *seeds]:
            fork = forked.game.fork(seed)
            fork.run(ahead)
            assert results.setdefault(seed, seen(fork)) == seen(fork)
            fork.ctx.terminate()
        for ctx in (forked, alone):
            ctx.game.run(after)
        assert plain(forked) == plain(alone)
