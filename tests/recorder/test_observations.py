"""`Recording.observation`: the very state by which an agent decided."""

import copy
import io

import numpy as np
import pytest

import gamms
from gamms import recorder
from gamms.agent import AgentType
from gamms.errors import BadValue, UnknownName
from gamms.knowledge import looks as sensed
from gamms.sensor import SensorType

QUIET = {"level": "CRITICAL"}


def rng_of(state):
    """What the agent's stream would give next; each turn begins it again."""
    return state["rng"].random(3).tolist()


def look_and_spoil(seen):
    """A strategy that keeps a copy of all it is told, and then spoils what it may."""

    def strategy(state):
        told = {key: value for key, value in state.items() if key not in ("rng", "draw")}
        seen[state["turn"] + 1, state["name"]] = copy.deepcopy({**told, "facts": dict(state["facts"])})
        seen[state["turn"] + 1, state["name"]]["lots"] = rng_of(state)
        state["memory"].setdefault("been", set()).add(state["curr_pos"])
        state["team_memory"].setdefault("been", []).append(state["turn"])
        if state["legal"]:
            state["action"] = state["legal"][state["turn"] % len(state["legal"])]
        else:
            state["action"] = (1.0, 0.5, 0.0)
        for _, data in state["sensor"].values():
            data.clear() if hasattr(data, "clear") else None

    return strategy


def build(seen):
    ctx = gamms.create_context(seed=6, logger_config=QUIET)
    ctx.graph.attach_networkx_graph(gamms.graph.grid(6, 6, 10.0))
    strategy = look_and_spoil(seen)
    kinds = (SensorType.NEIGHBOR, SensorType.RANGE, SensorType.AGENT_RANGE, SensorType.ARC, SensorType.OCCLUDED_MAP)
    for i, node in enumerate((0, 8, 14)):
        sensors = {}
        for kind in kinds:
            more = {} if kind is SensorType.NEIGHBOR else {"sensor_range": 25.0}
            if kind is SensorType.AGENT_RANGE:
                more["detection"] = 0.5
            sensors[kind.name.lower()] = ctx.sensor.create_sensor(f"{kind.name} {i}", kind, **more)
        name = f"walker_{i}"
        ctx.agent.create_agent(name, start_node_id=node, team="red", sensors=sensors, strategy=strategy)
    ctx.sensor.from_function(
        "smell", lambda ctx, agent: {"strength": agent.current_node_id * 0.5, "from": ("west", agent.name)}
    )
    ctx.agent.get_agent("walker_0").register_sensor("smell", ctx.sensor.get_sensor("smell"))
    ctx.sensor.create_sensor("below", SensorType.AERIAL, sensor_range=40.0)
    ctx.sensor.create_sensor("traffic", SensorType.AERIAL_AGENT, sensor_range=60.0)
    ctx.agent.create_agent(
        "kite", start_node_id=7, type=AgentType.AERIAL, speed=3.0, sensors=["below", "traffic"], strategy=strategy
    )
    ctx.agent.get_agent("kite").position = (20.0, 20.0, 15.0)

    def weather(ctx):
        """Changes the world before anybody looks."""
        ctx.game.publish(wind=ctx.game.turn)
        if ctx.game.turn == 3:
            ctx.agent.get_agent("walker_1").current_node_id = 35
            ctx.agent.create_agent("late", start_node_id=1, team="red", sensors={"near": near}, strategy=strategy)
        if ctx.game.turn == 5:
            ctx.game.eliminate("walker_2")

    near = ctx.sensor.create_sensor("near", SensorType.NEIGHBOR)
    ctx.game.add(weather, phase="before")
    ctx.game.configure({"legal": "any", "on_error": "raise"})
    return ctx


@pytest.fixture(scope="module")
def game():
    """A recording, and what its agents were told."""
    seen, stream = {}, io.BytesIO()
    with build(seen) as ctx:
        ctx.record.start(stream, sensed=True)
        ctx.game.run(8)
        ctx.record.stop()
    return recorder.open(io.BytesIO(stream.getvalue())), seen


def test_an_observation_is_the_very_state_that_the_strategy_got(game):
    recording, seen = game
    assert {turn for turn, _ in seen} == set(range(1, 9))
    for (turn, name), told in seen.items():
        state = recording.observation(turn, name)
        lots = rng_of(state)
        del state["rng"], state["draw"]
        assert list(state) == [key for key in told if key != "lots"]
        assert {**state, "facts": dict(state["facts"]), "lots": lots} == told, (turn, name)


def test_the_table_of_what_was_sensed_has_nodes_and_agents(game):
    recording, seen = game
    table = recording.table("sensed", 2, 4)
    rows = list(zip(*(column.tolist() for column in table.values()), strict=True))
    assert {row[0] for row in rows} == {2, 3}
    near = [node for turn, agent, sensor, node, _ in rows if (turn, agent, sensor) == (3, "walker_1", "neighbor")]
    assert near == seen[3, "walker_1"]["sensor"]["neighbor"][1]
    others = {
        other: node for turn, agent, sensor, node, other in rows if (agent, sensor) == ("walker_0", "agent_range")
    }
    assert set(others) <= {"walker_1", "walker_2"}
    assert list(table) == ["turn", "agent", "sensor", "node", "other"]
    assert len(recording.table("sensed", 5, 5)["node"]) == 0


@pytest.mark.parametrize("given", [[1, 2, 3], {"anna": 5}, {"nodes": {1: None}, "edges": []}])
def test_what_a_function_returns_is_not_taken_for_nodes_or_agents(given):
    stream = io.BytesIO()
    with gamms.create_context(seed=1, logger_config=QUIET) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 3, 10.0))
        ctx.sensor.from_function("dice", lambda: given)
        ctx.sensor.create_sensor("near", SensorType.NEIGHBOR)
        ctx.agent.create_agent("anna", start_node_id=0, sensors=["dice", "near"], strategy=lambda state: None)
        ctx.record.start(stream, sensed=True)
        ctx.game.run(1)
    with recorder.open(io.BytesIO(stream.getvalue())) as recording:
        assert set(recording.table("sensed")["sensor"]) == {"near"}
        assert recording.observation(1, "anna")["sensor"]["dice"][1] == given


def test_sensing_changes_nothing_by_being_recorded(game):
    recording, _ = game
    stream = io.BytesIO()
    with build({}) as ctx:
        ctx.record.start(stream)
        ctx.game.run(8)
        ctx.record.stop()
    with recorder.open(io.BytesIO(stream.getvalue())) as other:
        assert np.array_equal(other.table("moves")["node"], recording.table("moves")["node"])
        with pytest.raises(BadValue, match="sensed=True"):
            other.observation(3, "walker_0")


def test_what_was_not_observed_is_refused(game):
    recording, _ = game
    with pytest.raises(BadValue, match="no turn 0"):
        recording.observation(0, "walker_0")
    with pytest.raises(BadValue, match="no turn 9"):
        recording.observation(9, "walker_0")
    with pytest.raises(UnknownName, match="'walker'"):
        recording.observation(2, "walker")
    with pytest.raises(UnknownName, match="living agent"):
        recording.observation(8, "walker_2")
    with pytest.raises(UnknownName, match="late"):
        recording.observation(2, "late")


def test_damaged_columns_are_refused():
    data = sensed.packed([(0, {"near": (SensorType.NEIGHBOR, [1, 2])})], {"anna": 0}, {"anna": 0})
    assert [look.first for _, look in sensed.looks_of(data, 0)] == [[1, 2]]
    for key, value in (("counts", np.array([2])), ("which", np.array([5])), ("sensors", [3]), ("forms", np.array([3]))):
        with pytest.raises((KeyError, ValueError, TypeError, IndexError)):
            sensed.looks_of({**data, key: value}, 0)
