"""Runs whose turns the core plays as a whole, against the same turns played one by one by the turn engine."""

import signal
import threading
from dataclasses import replace
from fractions import Fraction
from math import inf

import numpy as np
import pytest
from batch_scenes import plain
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from random_games import games

import gamms
from gamms.errors import GammsError
from gamms.game import native
from gamms.game.settings import get_rule_spec
from gamms.ir.graph import read_only
from gamms.rules import Conflicts, capture_flag, respawn, tag, time_limit
from gamms.strategies import chase, follow_path, random_walk, random_waypoints

LAW = settings(
    max_examples=8,
    deadline=None,
    derandomize=True,
    phases=[Phase.generate],
    suppress_health_check=[HealthCheck.too_slow],
)


@pytest.fixture(autouse=True, scope="module")
def even_few_turns_are_played_in_the_core():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(native, "FEWEST_TURNS", 2)
        yield


def in_steps(ctx, turns):
    """Play as `run` does, turn by turn."""
    last = ctx.game.turn + turns
    while ctx.game.turn < last and ctx.game.step():
        pass
    return outcome(ctx)


def in_a_run(ctx, turns):
    """Play in one call."""
    ctx.game.run(turns)
    return outcome(ctx)


def outcome(ctx):
    """The result of a game, but for the reason why its last run has stopped."""
    values = plain(ctx.game.result())
    return values if ctx.game.is_over else values | {"reason": "", "truncated": True}


def left_behind(ctx):
    """All that can be read of a game after its turns."""
    agents = {}
    for agent in ctx.agent.create_iter():
        state = {key: value for key, value in agent.state.items() if key not in ("draw", "rng", "fork", "memory")}
        seen = {name: sensor.data for name, sensor in agent.sensors.items()}
        place = agent.current_node_id, agent.prev_node_id, agent.alive, agent.orientation, agent.edge, agent.offset_m
        agents[agent.name] = place, state, seen
    game = ctx.game
    trails = [
        {
            name: moved.paths.points[moved.paths.offsets[row] : moved.paths.offsets[row + 1]].tolist()
            for name, row in moved.rows.items()
        }
        for moved in ctx.visual.drawing.motion.list_past(200)
    ]
    return (
        *(agents, dict(game.moves), game.tracks(game.agents), repr(game.data), dict(game.facts), game.events),
        *({name: dict(memory) for name, memory in game.memories.items()}, game.errors, dict(game.scores), trails),
        *(dict(game.counts), dict(game.internals.state.blocked), list(map(type, game.scores.values())), game.over),
    )


def check_run(open_game, turns, rest=5):
    """Check that a run leaves what its turns leave one by one, and goes on in the same way; return the core's game."""
    with open_game() as played, open_game() as stepped:
        for _ in range(2):
            assert in_a_run(played, turns) == in_steps(stepped, turns)
            assert left_behind(played) == left_behind(stepped)
            in_steps(played, rest)
            in_steps(stepped, rest)
            assert left_behind(played) == left_behind(stepped)
        was_in_core = played.game._in_core
        played.game.reset(seed=7)
        stepped.game.reset(seed=7)
        assert in_a_run(played, turns) == in_steps(stepped, turns)
        assert left_behind(played) == left_behind(stepped)
        return was_in_core


@st.composite
def games_of_shipped_parts(draw, speeds, **motion):
    """A random game in whose turns the core does not call Python."""
    drawn = draw(games(("one edge",)))
    strategies = st.sampled_from(["goto", "patrol", "waypoints", "chase", "flee", "skip", "mix"])
    eyes = st.lists(st.sampled_from([0, 1, 13, 14, 16]), min_size=1, max_size=3, unique=True)
    return replace(
        drawn,
        motion={
            **motion,
            "strategies": draw(st.lists(strategies, max_size=3)),
            "speeds": draw(st.lists(st.sampled_from(speeds), min_size=1, max_size=3)),
        },
        rules=[rule for rule in drawn.rules if get_rule_spec(rule).core_form is not None],
        eyes=draw(st.lists(eyes, min_size=1, max_size=3)),
        early=set(),
        asked="",
        called=(),
        collected=(),
        deeds=None,
        channels={},
        max_turns=None,
    )


MOTIONS = {
    "one edge": {"speeds": [None]},
    "edges": {"speeds": [None, 0.4, 1.0, 1.5, 3, inf]},
    "metres": {"speeds": [None, 1e-9, 0.3, 1.0, 1.9, 40.0, inf], "speed_unit": "metres"},
}


@pytest.mark.parametrize("motion", MOTIONS.values(), ids=MOTIONS)
@LAW
@given(data=st.data(), turns=st.integers(2, 40))
def test_a_run_ends_in_the_same_state_as_its_turns_one_by_one(motion, data, turns):
    drawn = data.draw(games_of_shipped_parts(**motion))

    def opened():
        ctx = drawn.open()
        ctx.game.reset(seed=turns)
        return ctx

    try:
        check_run(opened, turns)
    except GammsError:
        with opened() as played, opened() as stepped:
            with pytest.raises(GammsError) as one:
                for _ in range(3):
                    played.game.run(turns)
            with pytest.raises(GammsError) as other:
                for _ in range(3):
                    in_steps(stepped, turns)
            assert str(one.value) == str(other.value)
            assert left_behind(played) == left_behind(stepped)


def crowd(rules=(), agents=12, **game):
    def open_game():
        ctx = gamms.create_context(seed=3, logger_config={"level": "CRITICAL"}, game=game)
        ctx.graph.attach_networkx_graph(gamms.graph.grid(5, 5))
        nodes = list(ctx.graph.graph.get_nodes())
        kinds = (
            random_walk,
            follow_path(ctx, nodes[3:20:4], repeat=True),
            random_waypoints(ctx, pause=2),
            chase(ctx, random_walk),
        )
        for i in range(agents):
            eyes = ctx.sensor.create_sensor(f"eyes {i}", "agent_range", sensor_range=15.0)
            near = ctx.sensor.create_sensor(f"near {i}", "neighbor")
            team = ("red", "blue")[i % 2]
            where = nodes[i * 7 % 25]
            strategy = kinds[i // 2 % 4]
            ctx.agent.create_agent(f"a{i}", start_node_id=where, team=team, sensors=[eyes, near], strategy=strategy)
        ctx.game.conflicts = Conflicts(1)
        for rule in rules:
            ctx.game.add(rule)
        return ctx

    return open_game


@pytest.mark.parametrize(
    "rules",
    [
        [],
        [tag("red", "blue"), capture_flag({"red": 0, "blue": 24}, score=0.5)],
        [tag("red", "blue", then="eliminate")],
        [tag("red", "blue", then="eliminate"), respawn(3), capture_flag({"red": 0, "blue": 24})],
        [tag("red", "blue", hops=1), time_limit(33)],
    ],
)
@pytest.mark.parametrize("order", [None, [["blue"], ["red"]]])
def test_the_core_plays_runs_of_shipped_parts(rules, order):
    assert check_run(crowd(rules, order=order), 150) is not None


def test_a_listener_is_called_after_each_turn():
    with crowd()() as ctx:
        turns = []
        ctx.visual.after_turn.append(lambda: turns.append(ctx.game.turn))
        ctx.game.run(30)
        assert turns == [*range(1, 31)]


def test_a_run_goes_on_from_changes_between_two_runs():
    rules = [tag("red", "blue"), capture_flag({"red": 0, "blue": 24})]

    def change(ctx):
        ctx.agent.get_agent("a3").current_node_id = 24
        ctx.agent.get_agent("a4").alive = False
        ctx.agent.delete_agent("a6")
        ctx.agent.create_agent("a99", start_node_id=7, team="blue", strategy=random_walk)
        ctx.game.scores["red"] += 0.5
        ctx.game.data["flags"]["captures"]["red"] = 40
        ctx.graph.close_roads([3, 4])

    with crowd(rules)() as played, crowd(rules)() as stepped:
        for _ in range(2):
            assert in_a_run(played, 40) == in_steps(stepped, 40)
            if not played.game.turn > 40:
                change(played)
                change(stepped)
        assert left_behind(played) == left_behind(stepped)
        assert played.game.scores["red"] % 1 == 0.5


def states_of(agents):
    """The last states of agents, without what belongs to their contexts."""
    kept = {"draw", "rng", "fork", "memory", "facts"}
    return [{key: value for key, value in agent.state.items() if key not in kept} for agent in agents]


READERS = {
    "a state": lambda ctx: states_of([ctx.agent.get_agent("a3")]),
    "a sensor": lambda ctx: [sensor.data for sensor in ctx.agent.get_agent("a4").sensors.values()],
    "moves": lambda ctx: dict(ctx.game.moves),
    "tracks": lambda ctx: ctx.game.tracks(["a1", "a2"]),
    "counts": lambda ctx: dict(ctx.game.counts),
    "a rule by hand": lambda ctx: (tag("red", "blue", hops=2)(ctx), ctx.game.events),
    "a fork": lambda ctx: states_of(ctx.game.fork(1).ctx.agent.create_iter()),
    "a snapshot": lambda ctx: states_of(ctx.agent.create_iter()) if ctx.game.snapshot() else None,
}


@pytest.mark.parametrize("read", READERS.values(), ids=READERS)
def test_whatever_is_read_first_after_a_run_shows_its_last_turn(read):
    rules = [tag("red", "blue", then="eliminate"), respawn(2)]
    with crowd(rules)() as played, crowd(rules)() as stepped:
        played.game.run(60)
        in_steps(stepped, 60)
        assert read(played) == read(stepped)
        assert left_behind(played) == left_behind(stepped)


CHANGES = {
    "an agent moves": lambda ctx: setattr(ctx.agent.get_agent("a3"), "current_node_id", 24),
    "an agent leaves": lambda ctx: ctx.agent.delete_agent("a4"),
    "an agent comes": lambda ctx: ctx.agent.create_agent("a99", start_node_id=7, team="blue"),
    "agents get strategies": lambda ctx: [one.register_strategy(None) for one in ctx.agent.create_iter()],
    "sensors see less": lambda ctx: [setattr(one, "range", 1.0) for one in ctx.sensor.sensors.values()],
    "roads close": lambda ctx: ctx.graph.close_roads([*ctx.graph.graph.get_edges()][:40]),
    "a road is removed": lambda ctx: ctx.graph.graph.remove_edge(3),
    "conflicts end": lambda ctx: setattr(ctx.game, "conflicts", None),
    "a team is renamed": lambda ctx: setattr(ctx.agent.get_agent("a5"), "team", "green"),
    "a pose is read": lambda ctx: ctx.agent.get_agent("a2").get_state(),
    "the context ends": lambda ctx: ctx.terminate(),
}


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES)
def test_changes_after_a_run_do_not_change_its_last_turn(change):
    with crowd()() as played, crowd()() as stepped:
        played.game.run(60)
        in_steps(stepped, 60)
        agents, others = ([*ctx.agent.create_iter()] for ctx in (played, stepped))
        change(played)
        change(stepped)
        assert states_of(agents) == states_of(others)


def test_a_game_that_is_reset_or_restored_has_no_last_turn_of_the_run():
    with crowd()() as played, crowd()() as stepped:
        for ctx, play in ((played, lambda: played.game.run(40)), (stepped, lambda: in_steps(stepped, 40))):
            start = ctx.game.snapshot()
            play()
            ctx.game.reset(seed=5)
            assert not any(agent.state for agent in ctx.agent.create_iter())
            play()
            ctx.game.restore(start)
            play()
        assert left_behind(played) == left_behind(stepped)


@pytest.mark.parametrize("turns", [[30, 30], [30, 0], [30, 1, 30], [30, 30, 30]])
def test_a_run_after_a_run_replaces_its_last_turn(turns):
    rules = [tag("red", "blue", then="eliminate"), respawn(4)]
    with crowd(rules)() as played, crowd(rules)() as stepped:
        for number in turns:
            played.game.run(number)
            in_steps(stepped, number)
        assert states_of(played.agent.create_iter()) == states_of(stepped.agent.create_iter())
        assert left_behind(played) == left_behind(stepped)
        for ctx in (played, stepped):
            ctx.game.reset(seed=8)
            ctx.game.run(0)
        assert left_behind(played) == left_behind(stepped)


def test_a_run_that_is_refused_loses_no_last_turn():
    with crowd()() as ctx:
        ctx.game.run(60)
        for wrong in ({"max_turns": -1}, {"max_turns": 5, "sensed": True}, {"most_turns": 3}):
            with pytest.raises((GammsError, TypeError)):
                ctx.game.run(**wrong)
        with pytest.raises(GammsError):
            ctx.game.reset(seed="today")
        with pytest.raises(GammsError):
            ctx.game.restore("yesterday")
        assert {agent.state["turn"] for agent in ctx.agent.create_iter()} == {59}


def test_memories_that_a_program_changes_after_a_run_stay_changed():
    with crowd()() as played, crowd()() as stepped:
        for ctx, play in ((played, played.game.run), (stepped, lambda turns: in_steps(stepped, turns))):
            play(63)
            for memory in ctx.game.memories.values():
                memory.clear()
            in_steps(ctx, 5)
        assert left_behind(played) == left_behind(stepped)


def test_an_agent_that_a_restored_game_does_not_have_keeps_its_last_state():
    with crowd()() as played, crowd()() as stepped:
        states = []
        for ctx, play in ((played, played.game.run), (stepped, lambda turns: in_steps(stepped, turns))):
            before = ctx.game.snapshot()
            late = ctx.agent.create_agent("late", start_node_id=7, team="red", strategy=random_walk)
            play(63)
            ctx.game.restore(before)
            states += states_of([late])
        assert states[0] == states[1]
        assert states[0]["turn"] == 62


def test_a_sensor_without_an_owner_looks_after_a_run():
    def look(ctx, play):
        free = ctx.sensor.create_sensor("free", "agent_range", sensor_range=12.0, team="red")
        play(60)
        found = free.sense_many([1, 2])
        return [list(each) for each in found.names], states_of(ctx.agent.create_iter())

    with crowd()() as played, crowd()() as stepped:
        assert look(played, played.game.run) == look(stepped, lambda turns: in_steps(stepped, turns))


def test_flags_have_read_all_events_but_those_of_later_rules_after_a_run():
    rules = [capture_flag({"red": 0, "blue": 24}), tag("red", "blue"), respawn(1)]
    for turns in range(40, 60):
        with crowd(rules)() as played, crowd(rules)() as stepped:
            played.game.run(turns)
            in_steps(stepped, turns)
            assert played.game.data == stepped.game.data


def test_what_numbers_a_run_leaves_is_read_without_its_last_turn():
    with crowd()() as ctx:
        ctx.game.run(60)
        asked = ctx.game._turns.asked
        assert ctx.game.turn == 60
        assert isinstance(ctx.game.scores, dict)
        ctx.game.scores["red"] += 1
        assert {agent.alive for agent in ctx.agent.agents.values()} == {True}
        assert ctx.agent.get_agent("a1").current_node_id in ctx.graph.graph.get_nodes()
        assert ctx.game._turns.asked == asked
        assert ctx.agent.get_agent("a1").state["turn"] == 59
        assert ctx.game._turns.asked == asked + 1
        assert ctx.game.scores["red"] == 1


def test_a_run_that_is_interrupted_stops_between_two_turns():
    def press():
        signal.pthread_kill(threading.main_thread().ident, signal.SIGINT)

    with crowd(agents=2)() as ctx, crowd(agents=2)() as stepped:
        before = signal.signal(signal.SIGINT, signal.default_int_handler)
        ctx.game.run(2)  # loads what runs need
        timer = threading.Timer(0.02, press)
        try:
            with pytest.raises(KeyboardInterrupt):
                timer.start()
                ctx.game.run(10**9)
        finally:
            timer.join()
            signal.signal(signal.SIGINT, before)
        stepped.game.run(ctx.game.turn - 2)
        in_steps(stepped, 2)
        nodes, others = ([agent.current_node_id for agent in one.game.agents] for one in (ctx, stepped))
        assert nodes == others


def test_agents_that_decide_at_arrivals_keep_their_last_decision():
    def open_game():
        ctx = crowd(agents=4, speed_unit="metres", decide="arrival")()
        for agent in ctx.agent.create_iter():
            agent.strategy, agent.speed = random_walk, 0.3
        return ctx

    check_run(open_game, 41)


@pytest.mark.parametrize("name", ["a0", "a3", "a5"])
def test_runs_by_metres_go_on_after_an_agent_was_deleted(name):
    def open_game():
        ctx = crowd(agents=6, speed_unit="metres")()
        for agent in ctx.agent.create_iter():
            agent.strategy, agent.speed = random_walk, 3.7
        for _ in range(5):
            ctx.game.step()
        ctx.agent.delete_agent(name)
        return ctx

    assert check_run(open_game, 40) is not None


def test_trails_after_a_restored_game_are_those_of_its_turns():
    with crowd()() as played, crowd()() as stepped:
        for ctx, play in ((played, in_a_run), (stepped, in_steps)):
            play(ctx, 30)
            before = ctx.game.snapshot()
            play(ctx, 30)
            ctx.game.restore(before)
            play(ctx, 5)
        assert left_behind(played) == left_behind(stepped)


@pytest.mark.parametrize("score", [10**30, 2**53 + 1, np.float64(5), np.int64(5), Fraction(1, 3), True])
def test_scores_that_a_program_sets_between_two_runs_stay_exact(score):
    with crowd([tag("red", "blue")])() as played, crowd([tag("red", "blue")])() as stepped:
        for ctx, play in ((played, in_a_run), (stepped, in_steps)):
            play(ctx, 60)
            ctx.game.scores["red"] = score
            play(ctx, 60)
        assert left_behind(played) == left_behind(stepped)
        assert played.game.scores["red"] != score


def test_sensors_that_are_taken_off_between_two_runs_are_off():
    with crowd(agents=8)() as played, crowd(agents=8)() as stepped:
        for ctx, play in ((played, in_a_run), (stepped, in_steps)):
            play(ctx, 60)
            for agent in ctx.agent.create_iter():
                agent.deregister_sensor(f"eyes {agent.name[1:]}")
            play(ctx, 60)
        assert left_behind(played) == left_behind(stepped)


def test_facts_of_any_kind_are_published_between_two_runs():
    with crowd()() as ctx:
        for number in range(2):
            ctx.game.publish(heat=read_only(np.arange(3) + number))
            ctx.game.run(60)
        assert ctx.game.turn == 120
