"""Recordings of format version 3 that were written once, and say the same for ever.

To write the golden games again: `python tests/recorder/test_frozen_recordings.py`.
"""

import json
from collections.abc import Mapping
from itertools import compress
from math import hypot
from pathlib import Path

import pytest
from games import act, empty_context, everything, grid_context

import gamms
from gamms.rules import Conflicts, capture_flag, respawn, tag, time_limit

SAMPLES = Path(__file__).parent / "samples/ours"
FROZEN = sorted(SAMPLES.glob("version3*.ggr"))
#: What games have had since the samples were frozen, and what a game that has none of it says of it.
SINCE = {"deeds": [], "messages": [], "blocked": {}, "private": [{}, {}]}


def everything_of_version_3(ctx):
    """One game with whatever version 3 has and version 2 has not, for who freezes the next sample."""
    for name, node in (("anna", 0), ("bert", 8), ("carl", 4)):
        ctx.agent.create_agent(name, start_node_id=node, team=name[0], sensors=["near"], fuel=3)
    ctx.agent.create_agent("kite", start_node_id=3, type=1, speed=2.0, position=(1, 2, 3))
    ctx.record.event("note", text="frozen", numbers=[1, 2.5, None])
    for turn in range(70):
        act(ctx, "anna", (1, 2, 1, 0)[turn % 4])
        act(ctx, "bert", (7, 8)[turn % 2])
        act(ctx, "kite", (0.5, 0.25, 0.0))
        ctx.game.scores["anna"] = turn
        ctx.game.data["seen"] = {"turn": turn, "nodes": [turn % 9]}
        if turn == 3:
            ctx.game.emit("meeting", node=4)
            ctx.agent.get_agent("carl").alive = False
            ctx.agent.get_agent("bert").team = "c"
        if turn == 40:
            ctx.agent.delete_agent("carl")
            ctx.graph.add_obstacle_face(1, (1, 1, 1), (1, 2, 1), (2, 1, 0), (2, 2, 0), 1)
        if turn == 41:
            ctx.agent.create_agent("dora", start_node_id=5)
            ctx.agent.get_agent("anna").orientation = (0.0, 1.0)
        ctx.visual.simulate()


def _of_length_1(*quat):
    """The quaternion as it was rounded when the sample was frozen; of length 1, it is recorded as it is."""
    scaled = [part / max(quat) for part in quat]
    return tuple(part / hypot(*scaled) for part in scaled)


def flights_of_version_3(ctx):
    """One game with flights and turns by number, in two blocks."""
    for i in range(3):
        ctx.agent.create_agent(f"kite{i}", start_node_id=4 * i, type=1, speed=0.1 + i, position=(i, 2.5, 3.0))
    ctx.agent.create_agent("anna", start_node_id=0)
    for turn in range(70):
        act(ctx, "kite0", (0.5, 0.25, 0.0))
        act(ctx, "anna", turn % 2)
        act(ctx, "kite1", {"direction": (turn - 30.0, 3.0, -0.1), "quat": _of_length_1(1.0, 0.5, turn, 0.0)})
        if turn % 9 == 4:
            ctx.agent.get_agent("kite2").position = (2.0 * turn, -0.0, 1e9)
            ctx.agent.get_agent("kite2").orientation = (turn, 1.0)
        if turn == 41:
            ctx.agent.delete_agent("kite0")
            ctx.agent.create_agent("kite0", start_node_id=8, type=1, speed=0.3)
        ctx.visual.simulate()


def turns_of_version_3(ctx):
    """One game of the turn engine, with all that a game goes on from, and what was sensed."""

    def explore(state):
        state["memory"].setdefault("seen", set()).add(state["curr_pos"])
        state["memory"].setdefault("path", []).append((state["turn"], state["curr_pos"]))
        state["team_memory"]["last"] = {state["name"]: frozenset({state["curr_pos"]})}
        state["action"] = state["legal"][state["rng"].integers(len(state["legal"]))]

    explore.__module__, explore.__qualname__ = "frozen", "explore"  # as it is recorded

    def weather(ctx):
        ctx.game.publish(wind=[ctx.rng.random(), ctx.game.turn])
        if ctx.game.turn == 20:
            ctx.sensor.create_sensor("late", gamms.sensor.SensorType.AGENT_RANGE, sensor_range=20.0, detection=0.5)
            ctx.agent.create_agent("dora", start_node_id=5, sensors=["late"], speed=1.5, strategy=explore)

    for name, node in (("anna", 0), ("bert", 8)):
        ctx.agent.create_agent(name, start_node_id=node, team=name[0], sensors=["near"], strategy=explore)
    ctx.game.add(weather, phase="before")
    ctx.game.run(70)


def told(path):
    """What a recording says, at the turns at which something happens in it, and what a replay comes to."""
    with gamms.recorder.open(path) as recording, empty_context() as ctx:
        states = {turn: recording.state(turn) for turn in (0, 1, 4, 41, 42, recording.turns)}
        said = {
            "turns": recording.turns,
            "seed": recording.seed,
            "events": list(recording.events()),
            "states": {
                turn: {"scores": state.scores, "data": state.data}
                | {name: column.tolist() for name, column in state.agents.items()}
                for turn, state in states.items()
            },
            "moves": {name: column.tolist() for name, column in recording.table("moves").items()},
        }
        if "turns" in path.stem:
            said["sensed"] = {name: column.tolist() for name, column in recording.table("sensed").items()}
        list(ctx.record.replay(path))
        replayed = everything(ctx)
        if "turns" in path.stem:
            replayed |= {"turn": ctx.game.turn, "memories": ctx.game.memories, "facts": ctx.game.facts}
            replayed |= {"lot": ctx.rng.random(), "starts": ctx.game.internals.starts}
    del replayed["world"]
    assert {name: replayed.pop(name) for name in SINCE} == SINCE
    return json.loads(json.dumps({**said, "replayed": replayed}, default=_sorted))


def _sorted(value):
    if isinstance(value, Mapping):
        return dict(value)
    return sorted(value, key=repr) if isinstance(value, (set, frozenset)) else str(value)


def test_there_are_frozen_recordings():
    assert FROZEN


@pytest.mark.parametrize("path", FROZEN, ids=lambda path: path.stem)
def test_a_frozen_recording_reads_as_before(path):
    assert json.dumps(told(path)) == json.dumps(json.loads(path.with_suffix(".json").read_text()))


@pytest.mark.parametrize(
    ("play", "sample"),
    [
        (everything_of_version_3, "version3"),
        (flights_of_version_3, "version3_flights"),
        (turns_of_version_3, "version3_turns"),
    ],
)
def test_a_game_is_recorded_as_the_frozen_one_was(play, sample, tmp_path):
    with grid_context() as ctx:
        ctx.record.start(tmp_path / sample, sensed="turns" in sample)
        play(ctx)
        ctx.record.stop()
    new, frozen = told(tmp_path / f"{sample}.ggr"), told(SAMPLES / f"{sample}.ggr")
    if "turns" in sample:
        # Since then agents that stay are not moved, so that they keep their previous nodes, and what a sensor detects
        # is drawn by other keys.
        for said in (new, frozen):
            known = [sensor != "late" for sensor in said["sensed"]["sensor"]]
            said["sensed"] = {name: [*compress(column, known)] for name, column in said["sensed"].items()}
            del said["moves"]
            for state in said["states"].values():
                del state["previous"]
            for _, agent in said["replayed"]["agents"]:
                del agent["previous"], agent["orientation"]
    assert json.dumps(new) == json.dumps(frozen)


# -- games of the turn engine, one of each kind ------------------------------------------------------------------------


def walk(state):
    state["memory"]["path"] = [*state["memory"].get("path", ()), state["curr_pos"]][-3:]
    state["action"] = state["legal"][state["rng"].integers(len(state["legal"]))]


def create(ctx, name, node, strategy=walk, **options):
    strategy.__module__ = "golden"  # as it is recorded
    return ctx.agent.create_agent(name, start_node_id=node, strategy=strategy, **options)


def teams(ctx):
    """A team of many, one whose plan decides for all, and one that is moved between turns."""

    def plan(states):
        for state in states.values():
            state["action"] = state["legal"][state["turn"] % len(state["legal"])]

    walk.__module__ = plan.__module__ = "golden"
    ctx.agent.create_team("red", [0, 1, 2], strategy=walk, columns={"fuel": [3, 2, 1]})
    ctx.agent.create_team("blue", [7, 8])
    crowd = ctx.agent.create_team("crowd", [4] * 20)
    ctx.game.command("blue", plan)
    ctx.game.add(tag("red", "blue", then="respawn", score=1))
    ctx.game.add(lambda ctx: crowd.move([(4, 5)[ctx.game.turn % 2]] * 20), name="carried")
    ctx.game.run(12)


def births(ctx):
    """Agents are created before and after moves, on nodes where others are, and are tagged at once."""

    def born(ctx):
        if ctx.game.turn % 3 == 0:
            create(ctx, f"new_{ctx.game.turn}", ctx.game.turn % 9, team="blue", fuel=ctx.game.turn)

    create(ctx, "anna", 0, team="red", sensors=["near"])
    create(ctx, "bert", 8, team="blue")
    ctx.game.add(born, phase="before")
    ctx.game.add(tag("red", "blue", then="eliminate", score=2))
    ctx.game.add(lambda ctx: ctx.game.turn == 7 and create(ctx, "abel", 4, team="red"), name="late")
    ctx.game.run(14)


def deaths(ctx):
    """Agents leave for a time or for good, and a name is used again by an agent of another team."""

    def fate(ctx):
        if ctx.game.turn == 3:
            ctx.game.eliminate("carl")
        if ctx.game.turn == 5:
            ctx.agent.delete_agent("bert")
        if ctx.game.turn == 8:
            create(ctx, "bert", 2, team="red", speed=2.0)

    for name, node, team in (("anna", 0, "red"), ("bert", 8, "blue"), ("carl", 4, "blue")):
        create(ctx, name, node, team=team)
    ctx.game.add(fate)
    ctx.game.add(respawn(after=3))
    ctx.game.run(14)


def carriers(ctx):
    """A flag is taken, its carrier is deleted, and the flag is brought home by another agent."""

    def robbed(ctx):
        carrier = ctx.game.data["flags"]["carriers"]["blue"]
        if carrier == "anna":
            ctx.agent.delete_agent("anna")

    def fetch(state):
        has_flag = state["name"] in ctx.game.data["flags"]["carriers"].values()
        state["action"] = toward(state, 0 if has_flag else 8)

    def toward(state, node):
        ways = ctx.graph.shortest_path(state["curr_pos"], node)
        return ways[1] if len(ways) > 1 else node

    create(ctx, "anna", 4, fetch, team="red")
    create(ctx, "carl", 0, fetch, team="red")
    create(ctx, "bert", 6, walk, team="blue")
    ctx.game.add(capture_flag({"red": 0, "blue": 8}, goal=1, score=5))
    ctx.game.add(robbed)
    ctx.game.run(16)


def arrivals(ctx):
    """Agents by metres decide where they arrive, within turns, while a road closes and opens."""

    def works(ctx):
        if ctx.game.turn == 4:
            ctx.graph.close_roads([0, 1])
        if ctx.game.turn == 8:
            ctx.graph.open_roads()

    ctx.game.speed_unit = "metres"
    ctx.game.decide = "arrival"
    for name, node, speed in (("anna", 0, 17.0), ("bert", 8, 4.0), ("carl", 4, 31.0)):
        create(ctx, name, node, team=name[0], speed=speed)
    ctx.game.add(works)
    ctx.game.add(tag("a", "b", euclid=3.0, score=1))
    ctx.game.run(14)


def drones(ctx):
    """Agents fly, turn, land where others are, and carry cameras."""

    def fly(state):
        state["action"] = {"direction": (1.0, state["turn"] - 5.0, 0.5), "distance": 1.5}

    ctx.sensor.create_sensor("camera", gamms.sensor.SensorType.AERIAL, sensor_range=40.0)
    create(ctx, "kite", 3, fly, type="AERIAL", speed=2.0, position=(1.0, 2.0, 3.0), sensors=["camera"])
    create(ctx, "wing", 5, fly, type="AERIAL", speed=0.5)
    create(ctx, "anna", 0, team="red")
    ctx.game.run(12)


def talkers(ctx):
    """Teams play one after the other, resolve conflicts, do deeds, and send messages that may be lost."""

    def act_and_tell(state):
        walk(state)
        state["outbox"].append({"channel": "radio", "to": None, "body": [state["turn"], state["name"]]})
        state["action"] = {"node_id": state["action"], "do": {"mark": state["turn"]}}

    ctx.game.deeds = {"mark": {"what": "integer"}}
    ctx.game.order = [["red", None], ["blue"]]
    ctx.game.conflicts = Conflicts(capacity=1)
    ctx.game.add_channel("radio", range_m=15.0, loss=0.3, delay_turns=2)
    for name, node, team in (("anna", 0, "red"), ("bert", 1, "blue"), ("carl", 3, None)):
        create(ctx, name, node, act_and_tell, team=team, sensors=["near", "others"])
    ctx.game.add(lambda ctx: ctx.game.publish(to="red", turn=ctx.game.turn), name="news")
    ctx.game.run(10)


def looks(ctx):
    """Sensors miss, come late, and see what agents did; what they saw is recorded."""
    options = {"sensor_range": 25.0, "detection": 0.6, "delay_turns": 1}
    ctx.sensor.create_sensor("dim", gamms.sensor.SensorType.AGENT_RANGE, **options)
    ctx.sensor.create_sensor("far", gamms.sensor.SensorType.RANGE, sensor_range=12.0)
    for name, node in (("anna", 0), ("bert", 8)):
        create(ctx, name, node, team=name[0], sensors=["dim", "far", "map"])
    ctx.game.add(time_limit(9, winner="a"))
    ctx.game.run(12)


KINDS = (teams, births, deaths, carriers, arrivals, drones, talkers, looks)
GOLDEN = Path(__file__).parent / "samples/golden"


def record_kind(play, path):
    with grid_context(seed=7) as ctx:
        ctx.record.start(path, sensed=True)
        play(ctx)
        ctx.record.stop()


def told_of_each_turn(path):
    """All that a recording says: the tables, the events, and the state of each turn."""
    with gamms.recorder.open(path) as recording:
        said = {
            "seed": recording.seed,
            "events": list(recording.events()),
            "states": [_told_of(recording.state(turn)) for turn in range(recording.turns + 1)],
        }
        for table in ("moves", "sensed", "deeds", "messages"):
            said[table] = {name: column.tolist() for name, column in recording.table(table).items()}
    return json.dumps(said, default=_sorted, indent=1).splitlines()


def _told_of(state):
    columns = {name: column.tolist() for name, column in state.agents.items()}
    return {"scores": state.scores, "data": state.data, "roads": len(state.graph.columns().edge_ids), **columns}


@pytest.mark.parametrize("play", KINDS, ids=lambda play: play.__name__)
def test_a_game_of_a_kind_is_recorded_as_the_golden_one(play, tmp_path):
    path = tmp_path / f"{play.__name__}.ggr"
    record_kind(play, path)
    assert told_of_each_turn(path) == told_of_each_turn(GOLDEN / path.name)


if __name__ == "__main__":
    for kind in KINDS:
        golden = GOLDEN / f"{kind.__name__}.ggr"
        golden.unlink(missing_ok=True)
        record_kind(kind, golden)
