"""`ctx.record` as programs written for gamms 1.0.0 use it."""

import io
from pathlib import Path

import pytest
from games import act, agent_of, empty_context, grid_context, recorded, replayed

import gamms
from gamms.errors import BadType, BadValue
from gamms.recorder import Reader, RecordingError
from gamms.typing import OpCodes

VERSIONS = pytest.mark.parametrize("version", [2, 3])
SIMULATE, TERMINATE = 1, 0


def a_game(ctx):
    """Two agents, three turns."""
    ctx.agent.create_agent("anna", start_node_id=0, sensors=["near"], meta={"team": 0})
    ctx.agent.create_agent("dora", start_node_id=8, type=gamms.agent.AgentType.AERIAL, speed=2.0)
    for node, direction in ((1, (1, 0, 0)), (4, (0, 1, 1)), (5, (0, 0, 1))):
        act(ctx, "anna", node)
        act(ctx, "dora", direction)
        ctx.visual.simulate()


# -- start ----------------------------------------------------------------------------------------------------------


def test_a_path_object_will_do(ctx, tmp_path):
    ctx.record.start(tmp_path / "game")
    ctx.record.stop()
    assert list(ctx.record.replay(tmp_path / "game"))


def test_an_existing_file_is_never_written_over(ctx, tmp_path):
    (tmp_path / "game.ggr").write_bytes(b"precious")
    for path in ("game", "game.ggr"):
        with pytest.raises(FileExistsError, match=r"game\.ggr"):
            ctx.record.start(str(tmp_path / path))
    assert (tmp_path / "game.ggr").read_bytes() == b"precious"
    assert not ctx.record.record()
    ctx.record.start(str(tmp_path / "other"))
    ctx.record.stop()


def test_a_missing_folder_is_an_error_that_changes_nothing(ctx, tmp_path):
    with pytest.raises(FileNotFoundError, match=r"There is no folder .*no' to write 'game.ggr' into"):
        ctx.record.start(str(tmp_path / "no" / "game"))
    assert not ctx.record.record()
    ctx.record.start(str(tmp_path / "game"))


def test_a_second_start_is_refused_and_disturbs_nothing(ctx, tmp_path):
    ctx.record.start(str(tmp_path / "one"))
    for again in (str(tmp_path / "two"), io.BytesIO()):
        with pytest.raises(RuntimeError, match=r"stop\(\)"):
            ctx.record.start(again)
    ctx.record.pause()
    with pytest.raises(RuntimeError):
        ctx.record.start(str(tmp_path / "two"))
    ctx.record.play()
    assert ctx.record.record()
    ctx.record.stop()
    assert [file.name for file in tmp_path.iterdir()] == ["one.ggr"]


@pytest.mark.parametrize("path", [None, 5, b"game", ["game"], io.StringIO(), object()])
def test_an_invalid_path_or_stream_is_refused(ctx, path):
    with pytest.raises(TypeError, match="path or a binary stream"):
        ctx.record.start(path)
    with pytest.raises(TypeError, match="path or a binary stream"):
        next(ctx.record.replay(path))
    assert not ctx.record.record()
    assert not ctx.record.is_replaying


@pytest.mark.parametrize("options", [{"version": 1}, {"version": "3"}, {"version": None}])
def test_an_unknown_version_is_refused(ctx, tmp_path, options):
    with pytest.raises((BadValue, BadType), match="version must be"):
        ctx.record.start(tmp_path / "game", **options)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("options", "kind"),
    [({"provenance": object()}, BadType), ({"created": "yesterday"}, BadType), ({"created": 10**12}, BadValue)],
)
def test_an_impossible_header_is_refused_before_a_file_is_made(ctx, tmp_path, options, kind):
    with pytest.raises(kind):
        ctx.record.start(tmp_path / "game", **options)
    assert list(tmp_path.iterdir()) == []


def empty_or_grid(version):
    """What a replay needs: version 3 brings its map."""
    return grid_context() if version == 2 else empty_context()


def test_agents_from_before_the_start_are_in_the_file(ctx, empty):
    a_game(ctx)
    data = recorded(lambda ctx: act(ctx, "anna", 8), ctx)
    replayed(data, empty)
    assert [agent_of(one) for one in empty.agent.create_iter()] == [agent_of(one) for one in ctx.agent.create_iter()]


# -- stop, pause, play ----------------------------------------------------------------------------------------------


def test_stop_without_a_start_is_refused(ctx, tmp_path):
    with pytest.raises(RuntimeError, match="start"):
        ctx.record.stop()
    ctx.record.start(tmp_path / "game")
    ctx.record.stop()
    with pytest.raises(RuntimeError, match="start"):
        ctx.record.stop()


def test_pause_and_play_out_of_place_only_warn(ctx, heard, tmp_path):
    ctx.record.pause()
    ctx.record.play()
    ctx.record.start(tmp_path / "game")
    ctx.record.play()
    assert len(heard) == 3
    ctx.record.pause()
    assert len(heard) == 3
    ctx.record.pause()
    assert len(heard) == 4


@VERSIONS
def test_nothing_is_written_while_paused(ctx, version):
    def play(ctx):
        a_game(ctx)
        ctx.record.pause()
        act(ctx, "anna", 2)
        ctx.visual.simulate()
        ctx.record.event("unseen")
        ctx.record.play()
        act(ctx, "anna", 1)

    again, records = replayed(recorded(play, ctx, version=version), empty_or_grid(version))
    assert [one for one in records if one.get("data", {}).get("node_id") == 2 and one["opCode"] == 0x01100000] == []
    assert (again.agent.get_agent("anna").current_node_id, again.agent.get_agent("anna").prev_node_id) == (1, 2)


@VERSIONS
def test_a_paused_recording_is_stopped_after_it_goes_on(ctx, version):
    stream = io.BytesIO()
    ctx.record.start(stream, version=version)
    a_game(ctx)
    ctx.record.pause()
    with pytest.raises(RuntimeError, match="paused"):
        ctx.record.stop()
    assert ctx.record.is_open
    ctx.record.play()
    ctx.record.stop()
    assert replayed(stream.getvalue(), empty_or_grid(version))[1][-1]["opCode"] == TERMINATE


# -- write, event, time ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("state", ["before", "paused", "after"])
def test_write_needs_a_recording(ctx, tmp_path, state):
    if state != "before":
        ctx.record.start(tmp_path / "game")
        ctx.record.pause() if state == "paused" else ctx.record.stop()
    with pytest.raises(RuntimeError, match="recording"):
        ctx.record.write(OpCodes.SIMULATE, {})


@VERSIONS
def test_a_record_of_the_users_own_is_written_and_replayed(ctx, version):
    def play(ctx):
        ctx.agent.create_agent("anna", start_node_id=0)
        ctx.record.write(OpCodes.AGENT_CURRENT_NODE, {"agent_name": "anna", "node_id": 5})
        ctx.record.write(OpCodes.SIMULATE, {})

    data = recorded(play, ctx, version=version)
    again, records = replayed(data, empty_or_grid(version))
    assert again.agent.get_agent("anna").current_node_id == 5
    assert [record["opCode"] for record in records[1:]] == [0x01100000, SIMULATE, TERMINATE]
    assert records[1]["data"] == {"agent_name": "anna", "node_id": 5}


@pytest.mark.parametrize(
    ("opcode", "data"),
    [
        (OpCodes.AGENT_CREATE, {"name": "x", "kwargs": {"plan": print}}),
        (OpCodes.AGENT_CREATE, {"name": "x"}),
        (OpCodes.AGENT_DELETE, None),
        (OpCodes.AGENT_DELETE, {"name": 5}),
        (OpCodes.AGENT_CURRENT_NODE, {"agent_name": None, "node_id": 5}),
        (OpCodes.AGENT_CURRENT_NODE, {"agent_name": "anna", "node_id": "5"}),
        (OpCodes.AGENT_ORIENTATION, {"agent_name": "anna", "orientation": "x"}),
        (OpCodes.AERIAL_AGENT_POSITION, {"agent_name": "anna", "position": [1.0, 2.0]}),
        (OpCodes.AERIAL_AGENT_QUATERNION, {"agent_name": "anna", "quat": [1.0, None, 0.0, 0.0]}),
        (OpCodes.TERMINATE, {}),
        ("SIMULATE", {}),
    ],
)
def test_a_record_that_could_not_be_read_again_is_refused(ctx, opcode, data):
    stream = io.BytesIO()
    ctx.record.start(stream)
    with pytest.raises((BadType, BadValue)):
        ctx.record.write(opcode, data)
    ctx.record.stop()
    assert list(Reader(io.BytesIO(stream.getvalue())).events()) == []


@pytest.mark.parametrize("data", [{"x": print}, {"x": {(print,)}}, {"x": [object()]}])
def test_an_event_that_is_not_plain_is_refused_whether_or_not_it_is_recorded(ctx, data):
    with pytest.raises(BadType, match="plain values"):
        ctx.record.event("mine", **data)


def test_time_goes_on_without_a_recording_and_counts_turns_while_there_is_one(ctx, tmp_path):
    times = [ctx.record.time() for _ in range(3)]
    assert times == sorted(times)
    ctx.record.start(tmp_path / "game")
    assert ctx.record.time() == 0
    ctx.visual.simulate()
    assert ctx.record.time() == 1_000_000_000


@VERSIONS
def test_time_is_that_of_the_record_while_one_is_replayed(version):
    ctx = empty_or_grid(version)
    times = [
        (record["timestamp"], ctx.record.time())
        for record in ctx.record.replay(io.BytesIO(recorded(a_game, version=version)))
    ]
    assert all(said == told for said, told in times)
    assert not ctx.record.is_replaying


# -- replay ---------------------------------------------------------------------------------------------------------


def test_every_error_of_replay_comes_with_the_first_record(ctx, tmp_path):
    (tmp_path / "text.ggr").write_text("no recording")
    (tmp_path / "newer.ggr").write_bytes(b"MMGR\0\0\0\x09" + bytes(100))
    (tmp_path / "empty.ggr").write_bytes(b"")
    for path, kind in (
        ("missing.ggr", FileNotFoundError),
        ("text.ggr", ValueError),
        ("newer.ggr", ValueError),
        ("empty.ggr", ValueError),
    ):
        replay = ctx.record.replay(str(tmp_path / path))
        with pytest.raises(kind):
            next(replay)
        assert not ctx.record.is_replaying


def test_a_second_replay_is_refused_and_the_first_goes_on(empty):
    data = recorded(a_game)
    first = empty.record.replay(io.BytesIO(data))
    next(first)
    with pytest.raises(RuntimeError, match="replayed already"):
        next(empty.record.replay(io.BytesIO(data)))
    assert empty.record.is_replaying
    assert list(first)[-1]["opCode"] == TERMINATE
    assert not empty.record.is_replaying


@VERSIONS
@pytest.mark.parametrize("leave", ["break", "close", "error"])
def test_a_replay_that_is_left_leaves_nothing_stuck(tmp_path, version, leave):
    (tmp_path / "game.ggr").write_bytes(recorded(a_game, version=version))
    ctx = empty_or_grid(version)
    replay = ctx.record.replay(tmp_path / "game.ggr")
    next(replay)
    if leave == "error":
        with pytest.raises(KeyError):
            replay.throw(KeyError("mine"))
    else:
        replay.close()
    del replay
    assert not ctx.record.is_replaying
    assert ctx.record.time() not in (0, 1_000_000_000)
    assert list(empty_or_grid(version).record.replay(tmp_path / "game.ggr"))[-1]["opCode"] == TERMINATE
    (tmp_path / "game.ggr").unlink()


def test_the_end_is_yielded_and_does_not_end_the_context(empty):
    records = replayed(recorded(a_game), empty)[1]
    assert records[-1] == {"timestamp": 2_000_000_000, "opCode": TERMINATE}
    assert not empty.is_terminated()


def test_a_replay_can_be_watched(empty):
    turns = []
    empty.visual.after_turn.append(lambda: turns.append(empty.agent.get_agent("anna").current_node_id))
    replayed(recorded(a_game), empty)
    assert turns == [1, 4, 5]


def test_a_recording_on_another_map_is_refused_and_nothing_changes(ctx):
    data = recorded(a_game)
    ctx.graph.graph.add_node({"id": 77, "x": 0, "y": 0})
    before = ctx.graph.storage.pack()
    with pytest.raises(RecordingError, match="graph"):
        replayed(data, ctx)
    assert ctx.graph.storage.pack() == before
    assert list(ctx.agent.create_iter()) == []


def test_a_sensor_that_is_not_there_is_left_out_of_a_replay(ctx):
    ctx.sensor.create_sensor("mine", gamms.sensor.SensorType.RANGE)
    data = recorded(lambda ctx: ctx.agent.create_agent("a", start_node_id=0, sensors=["near", "mine"]), ctx, version=2)
    again = replayed(data, grid_context())[0]
    assert list(again.agent.get_agent("a")._sensor_list) == ["near"]


# -- the end --------------------------------------------------------------------------------------------------------


def test_after_the_end_everything_does_nothing(ctx, tmp_path, heard):
    (tmp_path / "game.ggr").write_bytes(recorded(a_game))
    ctx.terminate()
    ctx.record.start(tmp_path / "late")
    ctx.record.pause()
    ctx.record.play()
    ctx.record.write(OpCodes.SIMULATE, {})
    ctx.record.event("late", x=1)
    ctx.record.stop()
    assert list(ctx.record.replay(tmp_path / "game.ggr")) == []
    assert not ctx.record.record()
    assert not ctx.record.is_replaying
    assert isinstance(ctx.record.time(), int)
    assert heard == []
    assert [file.name for file in tmp_path.iterdir()] == ["game.ggr"]


def test_a_context_that_ends_in_the_middle_of_a_replay_ends_it_quietly(empty):
    replay = empty.record.replay(io.BytesIO(recorded(a_game)))
    next(replay)
    empty.terminate()
    assert {record["opCode"] for record in replay} <= {0x01100002}  # the sensor that anna was made with
    assert not empty.record.is_replaying


def test_a_loop_that_goes_on_after_the_end_of_the_context_records_no_more(ctx, tmp_path):
    ctx.record.start(tmp_path / "game")
    a_game(ctx)
    ctx.terminate()
    size = Path(tmp_path / "game.ggr").stat().st_size
    ctx.agent.get_agent("anna").step()
    ctx.agent.get_agent("anna").set_state()
    ctx.visual.simulate()
    assert Path(tmp_path / "game.ggr").stat().st_size == size
