"""A game that was restored goes on as it did, whatever happened in between."""

import copy
import pickle

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import gamms
from gamms.game import SnapshotError
from gamms.ir.game_state import cut_log
from gamms.rules import Conflicts, capture_flag
from gamms.sensor import SensorType
from gamms.typing import AgentType


def wander(state):
    """Draw from every stream, and remember."""
    rng = state["rng"]
    state["memory"].setdefault("turns", []).append(state["turn"])
    state["memory"]["drawn"] = (state["draw"].random(), float(rng.random()))
    state["team_memory"].setdefault("seen", set()).add(state["name"])
    state["action"] = state["draw"].choice(state["legal"])


def stroll(state):
    node = state["draw"].below(16)
    state["action"] = {"node_id": node, "orientation": (0, 1)}


def fly(state):
    state["action"] = {"direction": (state["draw"].random(), 1.0, 0.5), "quat": (1, 0, 0, state["draw"].random())}


def build(grid, **more):
    """A game with births and deaths, fractional progress, a flyer, memories, rules with data, detection and draws."""
    ctx = grid(speed_unit="metres", **more)
    for i in range(4):
        eyes = ctx.sensor.create_sensor(f"eyes{i}", SensorType.AGENT_RANGE, range=25, detection=0.5)
        strategy = stroll if i == 3 else wander
        ctx.agent.create_agent(
            f"a{i}",
            start_node_id=5 * i,
            team=("red", "blue")[i % 2],
            sensors=[eyes],
            strategy=strategy,
            meta={"hp": [9]},
            **({"speed": 3.7} if i == 3 else {}),
        )
    ctx.agent.create_agent("drone", type=AgentType.AERIAL, start_node_id=5, speed=3.0, strategy=fly)
    ctx.game.conflicts = Conflicts()
    ctx.game.add(capture_flag({"red": 0, "blue": 15}))
    ctx.game.collect("where", lambda agent: agent.current_node_id, per="agent")

    @ctx.game.add
    def live(ctx):
        game, turn = ctx.game, ctx.game.turn
        game.data.setdefault("lots", []).append(ctx.rng.random())
        game.data["place"] = ctx.graph.place(1)
        game.scores["red"] += 0.5
        game.emit("tick", at=turn)
        ctx.agent.get_agent("a0").meta["hp"].append(turn)
        if turn == 2:
            ctx.agent.create_agent("late", start_node_id=3, team="red", strategy=wander)
            game.eliminate("a1")
        if turn == 3:
            ctx.agent.delete_agent("a2")
            ctx.graph.graph.remove_node(12)
            game.publish(closed=[12])
        if turn == 4:
            game.respawn("a1")
            ctx.sensor.get_sensor("eyes0").range = 15
        if turn == 5:
            ctx.agent.delete_agent("late")
            ctx.graph.add_obstacle_face(1, (1, 1, 1), (1, 2, 1), (2, 1, 0), (2, 2, 0), 1)

    return ctx


def plain(ctx):
    """All that can be seen of a game."""
    game = ctx.game
    agents = [
        {
            "name": agent.name,
            "team": agent.team,
            "alive": agent.alive,
            "node": agent.current_node_id,
            "before": agent.prev_node_id,
            "position": getattr(agent, "position", None),
            "quat": getattr(agent, "quat", None),
            "orientation": tuple(agent.orientation),
            "hp": list(getattr(agent, "meta", {}).get("hp", ())),
            "progress": ctx.agent.block.get_progress(agent._row),
            "state": repr({key: value for key, value in agent.state.items() if key not in ("draw", "rng")}),
        }
        for agent in ctx.agent.agents.values()
    ]
    result = game.result().to_dict()
    del result["timings"]
    return copy.deepcopy(
        {
            "agents": agents,
            "result": result,
            "data": game.data,
            "facts": dict(game.facts),
            "memories": {name: memory for name, memory in game.memories.items() if memory},
            "teams": game.team_memories,
            "sensors": ctx.sensor.storage.describe_sensors(),
            "sensed": {name: sensor.data for name, sensor in ctx.sensor.sensors.items()},
            "nodes": sorted(ctx.graph.graph.get_nodes()),
            "faces": len(ctx.graph.obstacle_columns()[0]),
            "moves": game.moves,
            "turn": game.turn,
        }
    )


@settings(max_examples=12, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(before=st.integers(0, 6), after=st.integers(1, 6), global_draws=st.booleans())
def test_the_turns_after_a_restored_snapshot_are_the_same_as_before(grid, before, after, global_draws):
    with build(grid) as ctx:
        if global_draws:
            import random

            ctx.game.add(lambda ctx: ctx.game.data.update(global_draw=random.random()), name="global")
        ctx.game.run(before)
        snapshot, then, agents = ctx.game.snapshot(), plain(ctx), dict(ctx.agent.agents)
        ctx.game.run(after)
        later = plain(ctx)
        for _ in range(2):
            ctx.game.restore(snapshot)
            assert plain(ctx) == then
            assert all(agent is agents[name] for name, agent in ctx.agent.agents.items())
            ctx.game.run(after)
            assert plain(ctx) == later


@settings(max_examples=8, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(steps=st.lists(st.tuples(st.integers(0, 3), st.integers(0, 4)), min_size=2, max_size=7))
def test_snapshots_are_restored_in_any_order(grid, steps):
    with build(grid) as ctx:
        known = [(ctx.game.snapshot(), plain(ctx))]
        for turns, which in steps:
            ctx.game.run(turns)
            known.append((ctx.game.snapshot(), plain(ctx)))
            snapshot, then = known[which % len(known)]
            ctx.game.restore(snapshot)
            assert plain(ctx) == then
        for snapshot, then in known:
            ctx.game.restore(snapshot)
            assert plain(ctx) == then


def test_draws_of_an_agent_between_two_turns_are_restored(grid):
    with build(grid) as ctx:
        ctx.game.run(1)
        state = ctx.game.observation("a0")
        drawn = state["draw"].random(), state["rng"].random()
        snapshot = ctx.game.snapshot()
        more = state["draw"].random(), state["rng"].random()
        ctx.game.restore(snapshot)
        state = ctx.game.observation("a0")
        assert (state["draw"].random(), state["rng"].random()) == more != drawn


def test_a_snapshot_is_refused_where_it_cannot_be_restored_exactly(grid, tmp_path):
    with build(grid) as ctx, build(grid) as other:
        snapshot = ctx.game.snapshot()
        with pytest.raises(gamms.errors.BadValue, match="of another context"):
            other.game.restore(snapshot)
        with pytest.raises(gamms.errors.BadType, match=r"needs what ctx\.game\.snapshot\(\) gave"):
            ctx.game.restore({})
        with pytest.raises(gamms.errors.BadType, match="cannot be pickled"):
            pickle.dumps(snapshot)
        ctx.record.start(str(tmp_path / "game"))
        with pytest.raises(SnapshotError, match="being recorded"):
            ctx.game.restore(snapshot)
        ctx.record.stop()
        ctx.game.restore(snapshot)
        ctx.game.add(lambda ctx: ctx.game.snapshot(), name="eager")
        with pytest.raises(SnapshotError, match="in the middle of a turn"):
            ctx.game.run(1)
    with pytest.raises(gamms.errors.ContextTerminated):
        ctx.game.snapshot()


def test_a_copy_of_a_context_restores_its_own_copy_of_a_snapshot(grid):
    with build(grid) as ctx:
        ctx.game.run(2)
        snapshot, then = ctx.game.snapshot(), plain(ctx)
        twin, copied = copy.deepcopy((ctx, snapshot))
        twin.game.run(2)
        twin.game.restore(copied)
        assert twin.game.result() == ctx.game.result()
        assert plain(ctx) == then


def test_a_copy_of_a_game_with_a_team_restores_copies_of_snapshots_from_before_an_agent_was_deleted():
    with gamms.create_context(seed=1) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(5, 5))
        ctx.agent.create_team("ant", [0, 6, 12], strategy=gamms.strategies.random_walk)
        ctx.game.run(2)
        moments = [(ctx.game.snapshot(), plain(ctx))]
        ctx.agent.delete_agent("ant_1")
        ctx.game.run(2)
        moments.append((ctx.game.snapshot(), plain(ctx)))
        twin, *copied = copy.deepcopy((ctx, *(snapshot for snapshot, _ in moments)))
        for i in (0, 1, 0):
            twin.game.run(1)
            twin.game.restore(copied[i])
            assert plain(twin) == moments[i][1]
        assert plain(ctx) == moments[1][1]


@given(steps=st.lists(st.one_of(st.integers(1, 5), st.integers(-9, -1)), max_size=30))
def test_a_log_returns_to_any_of_its_marks(steps):
    log, fresh, marked = [], iter(range(10**6)), 0
    marks = [((log, 0), [])]
    for step in steps:
        if step > 0:
            log.extend(next(fresh) for _ in range(step))
            marked = len(log)
            marks.append(((log, marked), list(log)))
        else:
            mark, then = marks[step % len(marks)]
            log, marked = cut_log(log, *mark, marked), mark[1]
            assert log == then
