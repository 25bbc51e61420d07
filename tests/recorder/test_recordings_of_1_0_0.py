"""What gamms 1.0.0 recorded replays here to what it reached there; and what ours writes for it says the same."""

import contextlib
import importlib.util
import io
import json
from pathlib import Path

import pytest
from games import QUIET, recorded

import gamms
from gamms.recorder import RecordingError
from gamms.recorder.formats import version2

SAMPLES = Path(__file__).parent / "samples"
REACHED = json.loads((SAMPLES / "version2/states.json").read_text())
GAMES = REACHED["games"]
ENDED = "Recording ended unexpectedly."


def made_by():
    """The script that made the samples, whose games can be played here as well."""
    spec = importlib.util.spec_from_file_location("make", SAMPLES / "version2/make.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


make = made_by()


def world():
    ctx = gamms.create_context(logger_config=QUIET)
    for id, x, y in REACHED["nodes"]:
        ctx.graph.graph.add_node({"id": id, "x": x, "y": y})
    for id, (source, target) in enumerate(REACHED["edges"]):
        ctx.graph.graph.add_edge({"id": id, "source": source, "target": target, "length": 10.0})
    for sensor_id, kind in (("near", "NEIGHBOR"), ("map", "MAP"), ("others", "AGENT")):
        ctx.sensor.create_sensor(sensor_id, gamms.sensor.SensorType[kind])
    return ctx


def reached(ctx, game):
    state = make.plain(make.state_of(ctx))
    for agent in state["agents"].values():
        if agent.get("team", 0) is None:
            del agent["team"]  # which ours have, given or not
    if game in ("keywords", "tags"):
        state["agents"]["a"].pop("meta", None)
    return state


def rounded(states):
    """1.0.0 normalises a direction once more when it replays, and comes to another last bit."""
    return json.loads(json.dumps(states), parse_float=lambda text: round(float(text), 12))


@pytest.mark.parametrize("game", [game for game in GAMES if game not in ("refused", "tags")])
def test_a_replay_reaches_the_states_of_1_0_0_turn_by_turn(game):
    ctx, turns, error = world(), [], None
    try:
        for record in ctx.record.replay(SAMPLES / f"version2/{game}.ggr"):
            if record["opCode"] == 1:
                turns.append(reached(ctx, game))  # noqa: PERF401 - it may raise
    except RecordingError as problem:
        error = f"ValueError: {ENDED}" if str(problem).startswith(ENDED) else str(problem)
    assert rounded(turns) == rounded(GAMES[game]["turns"])
    assert rounded(reached(ctx, game)) == rounded(GAMES[game]["end"])
    assert error == GAMES[game]["error"]


def test_recordings_that_1_0_0_could_not_replay_end_as_the_game_ended():
    ctx = world()
    list(ctx.record.replay(SAMPLES / "version2/refused.ggr"))
    assert reached(ctx, "refused") == GAMES["refused"]["end"]


def test_the_tags_of_cbor_stay_unopened_and_the_rest_is_replayed():
    ctx = world()
    records = list(ctx.record.replay(SAMPLES / "version2/tags.ggr"))
    assert [record["opCode"] for record in records] == [0x01000000, 0]
    assert ctx.agent.get_agent("a").current_node_id == 0


@pytest.mark.parametrize("game", GAMES)
def test_replay_yields_the_very_records(game):
    data = (SAMPLES / f"version2/{game}.ggr").read_bytes()
    there, here = [], []
    for found, records in ((there, version2.read(io.BytesIO(data))), (here, world().record.replay(io.BytesIO(data)))):
        try:
            for record in records:
                found.append(record)
        except RecordingError:
            found.append(None)
    assert here == there


# -- and the other way: what ours writes ----------------------------------------------------------------------------


def told(data):
    """The records but for their time, and for where a class of the script is at home."""
    text = repr([(record["opCode"], record.get("data")) for record in version2.read(io.BytesIO(data))])
    return text.replace("'__main__'", "'make'")


SAME = ["basic", "orientation", "sensors", "components", "deleted", "paused"]


@pytest.mark.parametrize("game", SAME)
def test_a_game_recorded_in_version_2_has_the_records_of_1_0_0(game):
    data = recorded(getattr(make, game), world(), version=2)
    assert told(data) == told((SAMPLES / f"version2/{game}.ggr").read_bytes())


def everything_of_version_2(ctx):
    """All that a recording of version 2 holds, in one game."""
    for game in (make.basic, make.orientation, make.sensors, make.aerial, make.components):
        for name in list(ctx.agent.agents):
            ctx.agent.delete_agent(name)
        game(ctx)
    ctx.agent.create_agent("kite", start_node_id=3, type=1, speed=2, position=(1, 2, 3), quat=(0, 0, 0, 2))
    ctx.agent.create_agent("kept", start_node_id=3, strategy=print, plan=print, color=gamms.visual.Color.Red)
    ctx.agent.get_agent("kept").team = 3
    ctx.game.emit("unknown to 1.0.0")
    make.act(ctx, "kite", (0, 0, 1))


def test_a_frozen_recording_for_1_0_0_is_still_written_to_the_byte():
    """1.0.0 replays this file: nodes, positions, quaternions and components were compared by hand."""
    assert recorded(everything_of_version_2, world(), version=2) == (SAMPLES / "ours/version2.ggr").read_bytes()


# -- copies ---------------------------------------------------------------------------------------------------------


def samples_of_version_2():
    return [*sorted((SAMPLES / "version2").glob("*.ggr")), SAMPLES / "ours/version2.ggr"]


@pytest.mark.parametrize("path", samples_of_version_2(), ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_a_replay_that_is_recorded_as_version_2_gives_the_same_bytes(path):
    data, ctx, stream = path.read_bytes(), world(), io.BytesIO()
    ctx.record.start(stream, version=2)
    with contextlib.suppress(RecordingError):  # of the one that was not finished
        list(ctx.record.replay(path))
    ctx.record.stop()
    copy = stream.getvalue()
    if path.stem == "unfinished":
        assert copy.startswith(data)
        assert [record["opCode"] for record in version2.read(io.BytesIO(copy[:8] + copy[len(data) :]))] == [0]
    else:
        assert copy == data


@pytest.mark.parametrize("game", SAME)
def test_games_of_ours_are_copied_to_the_byte_in_version_2(game):
    data = recorded(getattr(make, game), world(), version=2)
    assert recorded(lambda ctx: list(ctx.record.replay(io.BytesIO(data))), world(), version=2) == data


def test_changes_to_replayed_values_do_not_change_the_copy():
    path = SAMPLES / "version2/keywords.ggr"

    def play(ctx):
        for record in ctx.record.replay(path):
            record.get("data", {}).clear()
        ctx.agent.get_agent("a").meta.clear()

    assert recorded(play, world(), version=2) == path.read_bytes()
