"""What agents remember: little, plain, the same in every run, and merged whatever the order."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import gamms
from gamms import belief
from gamms.agent import AgentType
from gamms.belief import Sighting
from gamms.errors import BadType, BadValue, MissingKey, UnknownName
from gamms.plain import is_plain
from gamms.sensor import SensorType
from gamms.testing import check_strategy


def noting(ctx, *, stay=False, **keywords):
    def watch(state):
        belief.observe(ctx, state, **keywords)
        state["action"] = state["curr_pos"] if stay else state["draw"].choice(state["legal"])

    return watch


def hunt(turns=30, seed=1, path=None, **keywords):
    """A game of three hunters and two that are hunted: its context, which has ended if it was recorded."""
    ctx = gamms.create_context(seed=seed, logger_config={"level": "CRITICAL"})
    ctx.graph.attach_networkx_graph(gamms.graph.grid(30, 30))
    for i in range(3):
        eyes = ctx.sensor.create_sensor(f"e{i}", SensorType.AGENT_RANGE, sensor_range=40.0)
        strategy = noting(ctx, **keywords)
        ctx.agent.create_agent(f"h{i}", start_node_id=400 + 5 * i, team="red", sensors={"e": eyes}, strategy=strategy)
    for i in range(2):
        ctx.agent.create_agent(f"p{i}", start_node_id=410 + i, team="blue", strategy=gamms.strategies.random_walk)
    if path:
        ctx.record.start(path)
    ctx.game.run(turns)
    if path:
        ctx.terminate()
    return ctx


def test_of_an_agent_between_nodes_that_is_seen_from_the_air_it_is_not_known_which_node_it_has_passed(make_ctx, add):
    ctx = make_ctx(3, game={"speed_unit": "metres"})
    eyes = ctx.sensor.create_sensor("sky", SensorType.AERIAL_AGENT, sensor_range=100.0, quat=(0.7071, 0.0, 0.7071, 0.0))
    position = {"type": AgentType.AERIAL, "position": (10.0, 0.0, 50.0), "speed": 1.0}
    found = []

    def watch(state):
        found.append((state["sensor"]["eyes"][1].get("prey"), belief.observe(ctx, state).last_seen.get("prey")))
        state["action"] = (0.0, 0.0, 0.0)

    ctx.agent.create_agent("drone", start_node_id=0, team="red", sensors={"eyes": eyes}, strategy=watch, **position)
    add(ctx, "prey", 0, "blue", strategy=lambda state: state.update(action=1)).speed = 7.0
    ctx.game.run(2)
    assert [seen is not None for seen, _ in found] == [True, True]
    assert [known for _, known in found] == [Sighting(0, 0, "drone")] * 2
    assert 0 in belief.belief_of(ctx, "drone").reachable("prey")


def test_an_agent_that_is_seen_from_the_air_is_known_to_be_on_its_node(make_ctx, add):
    ctx = make_ctx(3, game={"speed_unit": "metres"})
    for node in (1, 2):
        ctx.graph.graph.update_node({"id": node, "y": 20.0})
    eyes = ctx.sensor.create_sensor("sky", SensorType.AERIAL_AGENT, sensor_range=100.0, quat=(0.7071, 0.0, 0.7071, 0.0))
    position = {"type": AgentType.AERIAL, "position": (10.0, 20.0, 50.0), "speed": 1.0}
    found = []

    def watch(state):
        found.append(belief.observe(ctx, state).last_seen.get("prey"))
        state["action"] = (0.0, 0.0, 0.0)

    ctx.agent.create_agent("drone", start_node_id=0, team="red", sensors={"eyes": eyes}, strategy=watch, **position)
    add(ctx, "prey", 2, "blue")
    ctx.game.run(1)
    assert found == [Sighting(2, 0, "drone")]


def test_mates_and_flyers_are_no_targets_and_an_agent_without_a_team_has_no_mates(make_ctx, add):
    ctx = make_ctx(3)
    add(ctx, "a", 0, "red", sight=50.0, strategy=noting(ctx))
    add(ctx, "mate", 1, "red")
    ctx.agent.create_agent("drone", type=AgentType.AERIAL, start_node_id=0, speed=1.0, team="blue")
    add(ctx, "n1", 1, None, sight=50.0, strategy=noting(ctx))
    add(ctx, "n2", 2, None)
    ctx.game.run(1)
    assert list(belief.belief_of(ctx, "a").last_seen) == ["n1", "n2"]
    assert list(belief.belief_of(ctx, "n1").last_seen) == ["a", "mate", "n2"]
    assert ctx.game.team_memories.get(None, {}) == {}


def test_drones_tell_of_agents_on_the_ground(make_ctx, add):
    ctx = make_ctx(6)
    known = []

    def see(state):
        known.append(belief.observe(ctx, state))
        state["action"] = (0.0, 0.0, 0.0)

    kind = AgentType.AERIAL
    drone = ctx.agent.create_agent("drone", type=kind, start_node_id=1, speed=1.0, team="red", strategy=see)
    drone.position = (10.0, 0.0, 5.0)
    drone.register_sensor("down", ctx.sensor.create_sensor("down", SensorType.AERIAL_AGENT, sensor_range=15.0))
    add(ctx, "prey", 2, "blue")
    add(ctx, "far", 5, "blue")

    ctx.game.run(1)
    assert known[0].last_seen == {"prey": Sighting(2, 0, "drone")}
    assert known[0].reachable("far") == {3, 4, 5}


def test_a_program_can_note_its_own_knowledge(make_ctx, add):
    ctx = make_ctx(6)

    def informed(state):
        belief.note(ctx, state, "prey", 4)
        known = belief.observe(ctx, state)
        assert known.reachable("prey") == {4}
        assert known.probability("prey") == {4: 1.0}
        for name, node, error in (("nobody", 4, UnknownName), ("prey", 9, UnknownName), ("prey", "4", BadType)):
            with pytest.raises(error):
                belief.note(ctx, state, name, node)
        state["action"] = state["curr_pos"]

    add(ctx, "a", 0, "red", sight=10.0, strategy=informed)
    add(ctx, "prey", 5, "blue")
    ctx.game.run(1)
    assert belief.belief_of(ctx, "a").last_seen == {"prey": Sighting(4, 0, "a")}


@pytest.mark.parametrize("turns", [1, 2, 3, 30])
def test_shared_beliefs_equal_those_of_merged_memories(turns):
    with hunt(turns, share=True) as shared, hunt(turns, share=False) as alone:
        merged = belief.merge(*(alone.game.memories[f"h{i}"] for i in range(3)))
        assert belief.merge(shared.game.team_memories["red"]) == merged
        assert alone.game.team_memories == {}


def test_the_memory_of_a_team_has_few_entries(make_ctx):
    with hunt(turns=30) as ctx:
        shared = ctx.game.team_memories["red"]
        assert len(shared) == 28 + 3 * 2  # one for each turn, and what was shared in the last two
        assert is_plain(shared)


def test_the_last_sighting_is_never_forgotten(make_ctx, add):
    ctx = make_ctx(4)

    def leave(state):
        state["action"] = 1 if state["turn"] == 5 else state["curr_pos"]

    add(ctx, "a", 0, "red", sight=0.0, strategy=noting(ctx, horizon=4, stay=True))
    add(ctx, "prey", 0, "blue", strategy=leave)
    ctx.game.run(40)
    assert belief.belief_of(ctx, "a").last_seen == {"prey": Sighting(0, 5, "a")}


def test_a_recording_grows_by_less_than_a_hundred_bytes_for_each_agent_and_turn(tmp_path):
    sizes = []
    for turns in (50, 150):
        hunt(turns=turns, path=tmp_path / f"{turns}.ggr")
        sizes.append((tmp_path / f"{turns}.ggr").stat().st_size)
    assert (sizes[1] - sizes[0]) / 300 < 100  # 25 when it was written; probabilities of 900 nodes would be 7,200


def test_nothing_is_remembered_outside_of_memories():
    def follow(ctx):
        def strategy(state):
            chances = belief.observe(ctx, state).probability("p0")
            state["action"] = max(state["legal"], key=lambda node: (chances.get(node, 0.0), node))

        return strategy

    def make_ctx():
        ctx = hunt(turns=0)
        ctx.agent.get_agent("h0").register_strategy(follow(ctx))
        return ctx

    check_strategy(None, make_ctx, "h0", turns=15)


PROGRAM = """
import sys
from test_memory import hunt
from gamms import belief
ctx = hunt(turns=12)
known = belief.belief_of(ctx, "h0")
print(sorted(ctx.game.memories["h2"].items(), key=repr))
print(known.last_seen, sorted(known.reachable("p0")), known.probability("p1", belief.to_goals([0, 899])))
"""


def test_beliefs_are_the_same_with_any_hash_seed(capsys):
    exec(PROGRAM.replace("from test_memory import hunt\n", ""), {"hunt": hunt})
    paths = os.pathsep.join([str(Path(__file__).parent), *sys.path])
    environment = os.environ | {"PYTHONHASHSEED": "77", "PYTHONPATH": paths}
    run = subprocess.run([sys.executable, "-c", PROGRAM], env=environment, capture_output=True, text=True, check=True)
    assert run.stdout == capsys.readouterr().out


def test_values_of_a_program_in_the_same_memory_are_not_observations(make_ctx, add):
    ctx = make_ctx(3)
    state = add(ctx, "a", 0, "red", sight=10.0).get_state() | {"name": "a", "team": "red", "turn": 0, "memory": {}}
    belief.observe(ctx, state)
    known = belief.believed(ctx, state).last_seen
    state["memory"] |= {"now": 1, 7: 2, ("place", 3): 4, ("a", "b", "c"): 5, ("a", "b", "c", "d"): 6}
    assert belief.believed(ctx, state).last_seen == known


def test_errors_name_the_missing_part(make_ctx, add):
    ctx = make_ctx(3)
    agent = add(ctx, "a", 0, "red", sight=10.0)
    with pytest.raises(MissingKey, match=r"state\['name'\]. ctx.game sets it; in your own loop, set name"):
        belief.observe(ctx, agent.get_state())
    state = agent.get_state() | {"name": "a", "team": "red", "turn": 0, "memory": {}}
    with pytest.raises(BadType, match="observe takes a context"):
        belief.observe(state, ctx)
    with pytest.raises(BadType, match="note takes a context"):
        belief.note(state, state, "a", 0)
    with pytest.raises(BadType, match="A memory must be a dict, not 3"):
        belief.merge(3)
    with pytest.raises(BadValue, match="horizon must be at least 1"):
        belief.observe(ctx, state, horizon=0)
    state["memory"]["belief", 0, "b"] = "nonsense"
    with pytest.raises(BadType, match="the observation of 'b' in turn 0"):
        _ = belief.believed(ctx, state).last_seen
    del state["memory"]["belief", 0, "b"]
    state["memory"]["belief", 0, ""] = "nonsense"
    with pytest.raises(BadType, match=r"the observation of .a team. in turn 0"):
        belief.believed(ctx, state)


def reporting(ctx, reports):
    """Observe, and note at some turns where the prey was in others: turn -> (node, turn when it was there)."""

    def watch(state):
        if state["turn"] in reports:
            node, then = reports[state["turn"]]
            belief.note(ctx, state, "prey", node, turn=then)
        belief.observe(ctx, state)
        state["action"] = state["curr_pos"]

    return watch


@pytest.mark.parametrize("delay", range(6))
@pytest.mark.parametrize("order", ["ab", "ba"])
def test_late_reports_count_as_if_noted_in_their_turn(make_ctx, add, delay, order):
    beliefs = []
    for late in (0, delay):
        ctx = make_ctx(40)
        # Two mates learn of the same turn at once, so that neither may overwrite what the other shares.
        reports = {"a": {2 + late: (20, 2), 5: (23, 5)}, "b": {2 + late: (20, 2)}}
        for name in order:
            add(ctx, name, 0 if name == "a" else 39, "red", sight=15.0, strategy=reporting(ctx, reports[name]))
        add(ctx, "c", 10, "red", sight=5.0, strategy=noting(ctx, stay=True))
        add(ctx, "prey", 18, "blue", strategy=lambda state: state.update(action=min(39, state["curr_pos"] + 1)))
        ctx.game.run(10)
        known = [belief.belief_of(ctx, name) for name in "abc"]
        assert all(one.last_seen == {"prey": Sighting(23, 5, "a")} for one in known)
        beliefs.append([(one.reachable("prey"), one.probability("prey")) for one in known])
        assert all(28 in reachable for reachable, _ in beliefs[-1])
    assert beliefs[0] == beliefs[1]


def test_reports_are_forgotten_but_for_the_last_of_each_agent(make_ctx, add):
    ctx = make_ctx(40)
    add(ctx, "a", 0, "red", strategy=reporting(ctx, {turn: (turn % 40, turn - 1) for turn in range(1, 90)}))
    add(ctx, "prey", 20, "blue")
    ctx.game.run(200)
    assert belief.belief_of(ctx, "a").last_seen == {"prey": Sighting(9, 88, "a")}
    for memory in (ctx.game.memories["a"], ctx.game.team_memories["red"]):
        assert not any(key[0] == "belief reports" for key in memory if type(key) is tuple)
        assert is_plain(memory)


@pytest.mark.parametrize(("turn", "error"), [(4, BadValue), (-1, BadValue), ("1", BadType)])
def test_a_report_is_of_a_turn_that_was(make_ctx, add, turn, error):
    ctx, raised = make_ctx(5), []

    def watch(state):
        if state["turn"] == 3:
            with pytest.raises(error) as caught:
                belief.note(ctx, state, "prey", 1, turn=turn)
            raised.append(str(caught.value))
        state["action"] = state["curr_pos"]

    add(ctx, "a", 0, "red", strategy=watch)
    add(ctx, "prey", 4, "blue")
    ctx.game.run(4)
    assert len(raised) == 1
    assert turn != 4 or "this is turn 3" in raised[0]


@pytest.mark.parametrize(
    ("motion", "hint"),
    [("random_walk", "not 'random_walk'"), (belief.random_walk, "It makes a model: call it")],
)
def test_an_invalid_motion_model_is_named(make_ctx, add, motion, hint):
    ctx = make_ctx(5)
    add(ctx, "a", 0, "red")
    add(ctx, "prey", 4, "blue")
    calls = [
        lambda: belief.belief_of(ctx, "a").probability("prey", motion),
        lambda: belief.Filter(ctx, motion, ["prey"]),
        lambda: belief.artist("a", "prey", motion),
        lambda: belief.mixture({motion: 1}),
        lambda: gamms.strategies.follow_belief(ctx, motion=motion),
    ]
    for call in calls:
        with pytest.raises(BadType, match=hint):
            call()
