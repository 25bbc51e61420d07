"""What is on the disk, or in the caller's own stream, while a recording is being written."""

import io
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from contextlib import nullcontext, suppress
from pathlib import Path

import pytest
from games import act, empty_context, grid_context
from hypothesis import given, settings
from hypothesis import strategies as st

import gamms
from gamms import recordings
from gamms.recorder import Reader, RecordingError
from gamms.recorder.saving import INTERVAL_S

VERSIONS = pytest.mark.parametrize("version", [2, 3])


def records_of(data):
    """All records of what was recorded so far, of either version."""
    found = []
    with empty_context(seed=2) if data[7] == 3 else new_game() as ctx:  # noqa: SIM117 - for the errors of the inner one
        with suppress(RecordingError) if data[7] == 2 else nullcontext():  # which has no end yet
            for record in ctx.record.replay(io.BytesIO(data)):
                found.append(record)  # noqa: PERF402 - also those before an error
    return found


def turns_of(data):
    return sum(record["opCode"] == 1 for record in records_of(data))


def step(ctx, turn):
    act(ctx, "a", (turn * turn) % 9)
    ctx.game.data["turn"] = turn
    ctx.visual.simulate()


def new_game():
    ctx = grid_context()
    ctx.agent.create_agent("a", start_node_id=4)
    return ctx


# -- programs that are killed -----------------------------------------------------------------------------------

BEGIN = """
import os, sys, time
sys.path.insert(0, sys.argv[1])
from games import act, grid_context
ctx = grid_context()
ctx.agent.create_agent("a", start_node_id=4)
def step(turn):
    act(ctx, "a", turn * turn % 9)
    ctx.visual.simulate()
ctx.record.start(sys.argv[2])
"""


def run(program, path, *, turns=None, is_killed=False):
    """Run a program until it says that it is ready, and until that many turns of it are saved; then end it."""
    command = [sys.executable, "-c", BEGIN + program, str(Path(__file__).parent), str(path)]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment) as child:
        assert child.stdout.readline() == "ready\n"
        until = time.monotonic() + 60.0
        while turns is not None and saved_in(path) != turns:
            assert time.monotonic() < until
            time.sleep(0.01)
        if is_killed:
            child.send_signal(signal.SIGKILL)
    assert is_killed or child.returncode == 0


def saved_in(path):
    with Reader(path) as reader:
        return reader.turns


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="nothing can be killed here")
@pytest.mark.parametrize("turns", [0, 1, 2, 150])
def test_a_killed_program_that_ended_no_turn_for_a_second_has_lost_none(tmp_path, turns):
    assert INTERVAL_S < 1.0
    path = tmp_path / "game.ggr"
    program = f"for turn in range({turns}): step(turn)\nprint('ready', flush=True)\ntime.sleep(60)"
    run(program, path, turns=turns, is_killed=True)
    with gamms.recorder.open(path) as recording:
        assert (recording.turns, len(list(recording))) == (turns, turns + 1)
        assert f"was not finished: its first {turns} turns" in recording.warning
    with pytest.raises(RecordingError, match="was not finished"):
        recordings.verify(path)
    assert turns_of(path.read_bytes()) == turns
    with new_game() as ctx, pytest.raises(FileExistsError, match="overwrite=True"):
        ctx.record.start(path)


def test_another_process_can_read_the_turns_so_far(tmp_path):
    path, ctx, seen = tmp_path / "game.ggr", new_game(), []
    ctx.record.start(path)
    for turn in range(300):
        step(ctx, turn)
        if turn % 20 == 0:
            ctx.record._session._writer._saving.save_now()
            with Reader(path) as reader:  # which is what another process would see
                reader.verify()
                seen.append(reader.turns)
    ctx.record.stop()
    assert seen == list(range(1, 301, 20))


# -- the bytes --------------------------------------------------------------------------------------------------


@given(st.lists(st.booleans(), min_size=200, max_size=200), st.sampled_from([2, 3]))
@settings(max_examples=10)
def test_the_finished_bytes_do_not_depend_on_when_they_were_saved(saves, version):
    with tempfile.TemporaryDirectory() as folder:
        found = []
        for number, saved in enumerate(([False] * 200, saves)):
            with new_game() as ctx:
                ctx.record.start(f"{folder}/{number}", version=version)
                for turn, is_saved in enumerate(saved):
                    step(ctx, turn)
                    if is_saved:
                        ctx.record._session._writer._saving.save_now()
            found.append(Path(f"{folder}/{number}.ggr").read_bytes())
        with new_game() as ctx:
            stream = io.BytesIO()
            ctx.record.start(stream, version=version)
            for turn in range(200):
                step(ctx, turn)
        assert found[0] == found[1] == stream.getvalue()


def test_a_map_and_a_look_that_come_late_are_in_the_header_as_they_are_without_a_save(tmp_path):
    found = []
    for version in range(2):
        with empty_context() as ctx:
            ctx.record.start(tmp_path / str(version), provenance="x" * 100 * version)
            ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 3))
            ctx.agent.create_agent("a", start_node_id=4)
            ctx.visual.set_agent_visual("a", color=(1, 2, 3))
            ctx.game.run(3)
        with gamms.recorder.open(tmp_path / f"{version}.ggr") as recording:
            found.append((recording.map_hash(0), repr(recording.header["visuals"]), recording.turns))
        recordings.verify(tmp_path / f"{version}.ggr")
    assert found[0] == found[1]
    assert found[0][2] == 3


# -- streams of the caller's own --------------------------------------------------------------------------------


STREAMS = {
    "in memory": lambda folder: io.BytesIO(),
    "buffered": lambda folder: (folder / "game").open("w+b"),
    "unbuffered": lambda folder: (folder / "game").open("w+b", buffering=0),
    "temporary": lambda folder: tempfile.TemporaryFile(dir=folder),  # noqa: SIM115
    "temporary with a name": lambda folder: tempfile.NamedTemporaryFile(dir=folder),  # noqa: SIM115
    "spooled": lambda folder: tempfile.SpooledTemporaryFile(max_size=2000, dir=folder),  # noqa: SIM115
}


@VERSIONS
@pytest.mark.parametrize("kind", STREAMS)
def test_a_stream_has_all_turns_after_each_and_a_copy_replays_while_it_goes_on(tmp_path, kind, version):
    with STREAMS[kind](tmp_path) as stream, new_game() as ctx:
        ctx.record.start(stream, version=version)
        for turn in range(70):
            stream.seek(0)
            data = stream.read()
            if turn < 4 or turn > 62:
                assert turns_of(data) == turn
            stream.seek(3)
            stream.read(5)  # wherever the program stands
            step(ctx, turn)
        stream.seek(0)
        assert turns_of(stream.read()) == 70


# -- what goes wrong --------------------------------------------------------------------------------------------


def test_background_errors_are_raised_by_the_next_turn(tmp_path):
    with new_game() as ctx:
        ctx.record.start(tmp_path / "game")
        step(ctx, 0)
        step(ctx, 1)
        ctx.record._target.stream.close()
        ctx.record._session._writer._saving.save_now()
        with pytest.raises(RecordingError, match="could not be written"):
            step(ctx, 2)
        assert not ctx.record.record()
        step(ctx, 3)


def test_turns_are_saved_at_once_where_no_thread_can_be_started(tmp_path, monkeypatch):
    def refuse(_):
        raise RuntimeError("can't start new thread")

    monkeypatch.setattr(threading.Thread, "start", refuse)
    monkeypatch.setattr("gamms.recorder.saving._backgrounds", [])
    with new_game() as ctx:
        ctx.record.start(tmp_path / "game")
        for turn in range(3):
            step(ctx, turn)
        assert turns_of((tmp_path / "game.ggr").read_bytes()) == 3


@pytest.mark.skipif(not hasattr(os, "fork"), reason="nothing is forked here")
@pytest.mark.parametrize("ends", [False, True])
def test_a_forked_process_leaves_the_recording_alone(tmp_path, ends):
    with new_game() as ctx:
        ctx.record.start(tmp_path / "game")
        for turn in range(3):
            step(ctx, turn)
        child = os.fork()
        if not child:
            try:
                for turn in range(100):
                    step(ctx, turn)
                if ends:
                    ctx.terminate()
                ctx.record.record()
            finally:
                os._exit(0)
        assert os.waitpid(child, 0)[1] == 0
        for turn in range(3, 6):
            step(ctx, turn)
    recordings.verify(tmp_path / "game.ggr")
    assert turns_of((tmp_path / "game.ggr").read_bytes()) == 6


def test_a_file_that_was_removed_is_spoken_of(tmp_path, caplog):
    with new_game() as ctx:
        ctx.record.start(tmp_path / "game")
        step(ctx, 0)
        (tmp_path / "game.ggr").unlink()
        with caplog.at_level("WARNING", logger="gamms"):
            ctx.record.stop()
    assert "was removed" in caplog.text


# -- another recording of this name -----------------------------------------------------------------------------


def files_of(folder):
    return {file.name: file.read_bytes() for file in folder.iterdir()}


def test_a_link_to_a_recording_is_kept_when_that_is_overwritten(tmp_path):
    (tmp_path / "there").mkdir()
    (tmp_path / "there" / "game.ggr").write_bytes(b"old")
    (tmp_path / "game.ggr").symlink_to(tmp_path / "there" / "game.ggr")
    with new_game() as ctx:
        ctx.record.start(tmp_path / "game", overwrite=True)
        step(ctx, 0)
    assert (tmp_path / "game.ggr").is_symlink()
    recordings.verify(tmp_path / "there" / "game.ggr")


@pytest.mark.parametrize("options", [{"version": 7}, {"provenance": object()}, {"created": "now"}])
def test_a_start_that_is_refused_leaves_the_old_file(tmp_path, options):
    (tmp_path / "game.ggr").write_bytes(b"old")
    with new_game() as ctx, pytest.raises((ValueError, TypeError)):
        ctx.record.start(tmp_path / "game", overwrite=True, **options)
    assert files_of(tmp_path) == {"game.ggr": b"old"}


@pytest.mark.parametrize("overwrite", [False, True])
def test_a_start_that_cannot_be_written_leaves_the_old_file(tmp_path, monkeypatch, overwrite):
    if overwrite:
        (tmp_path / "game.ggr").write_bytes(b"old")
    before = files_of(tmp_path)

    def fill_up(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("gamms.recorder.formats.writer.Output._write", fill_up)
    with new_game() as ctx:
        with pytest.raises(RecordingError, match="No space left"):
            ctx.record.start(tmp_path / "game", overwrite=overwrite)
        assert not ctx.record.is_open
        step(ctx, 0)
    assert files_of(tmp_path) == before


def test_open_recordings_cannot_be_overwritten(tmp_path):
    fcntl = pytest.importorskip("fcntl")
    assert fcntl
    with new_game() as ctx, new_game() as other:
        ctx.record.start(tmp_path / "game")
        step(ctx, 0)
        with pytest.raises(RuntimeError, match="being recorded"):
            other.record.start(tmp_path / "game", overwrite=True)
        ctx.record.stop()
        with empty_context() as third:
            for _ in third.record.replay(tmp_path / "game"):
                with pytest.raises(RuntimeError, match="replayed"):
                    other.record.start(tmp_path / "game", overwrite=True)
        assert turns_of((tmp_path / "game.ggr").read_bytes()) == 1
        other.record.start(tmp_path / "game", overwrite=True)


# -- Ctrl-C -----------------------------------------------------------------------------------------------------


class Interrupts:
    """Sends the signal of Ctrl-C once, at a line of what writes a recording."""

    def __init__(self, at):
        self.left = at

    def __call__(self, frame, event, arg):
        is_writing = "/recorder/formats/" in frame.f_code.co_filename or "/compat.py" in frame.f_code.co_filename
        return self.line if is_writing else None

    def line(self, frame, event, arg):
        if event == "line":
            self.left -= 1
            if not self.left:
                sys.settrace(None)
                signal.raise_signal(signal.SIGINT)
        return self.line


def interrupted_game(path, at, version, turns=66):
    """A game in which Ctrl-C comes at some line after `turns` turns."""
    interrupts = 0
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # shells ignore it for what runs behind them
    with new_game() as ctx:
        ctx.record.start(path, version=version)
        for turn in range(turns):
            if turn in (0, 63):
                sys.settrace(Interrupts(at))
            try:
                step(ctx, turn)
            except KeyboardInterrupt:
                interrupts += 1
            finally:
                sys.settrace(None)
    signal.signal(signal.SIGINT, before)
    return interrupts


@VERSIONS
@pytest.mark.parametrize("make", [io.BytesIO, lambda: None])
def test_a_turn_is_neither_lost_nor_there_twice_if_it_is_interrupted_while_it_is_written(
    tmp_path, version, make, monkeypatch
):
    monkeypatch.setattr("gamms.recorder.turn_writer._TURNS_AT_ONCE", 64)
    interrupts = 0
    for at in (*range(1, 40, 4), *range(40, 900, 71)):
        target = make() or tmp_path / f"{at}.ggr"
        interrupts += interrupted_game(target, at, version)
        data = target.read_bytes() if isinstance(target, Path) else target.getvalue()
        nodes = [one["data"]["node_id"] for one in records_of(data) if one["opCode"] == 0x01100000]
        assert nodes == [turn * turn % 9 for turn in range(66)], at
        if version == 3:
            with Reader(io.BytesIO(data)) as reader:
                reader.verify()
                assert reader.is_complete
    assert interrupts > 10
