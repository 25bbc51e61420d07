"""Recordings of format version 3 that were written once, and say the same for ever."""

import json
from collections.abc import Mapping
from itertools import compress
from math import hypot
from pathlib import Path

import pytest
from games import act, empty_context, everything, grid_context

import gamms

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
def test_a_frozen_recording_says_what_it_said(path):
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
