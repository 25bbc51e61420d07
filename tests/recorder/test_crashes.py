"""Killed, full, cut off: what is on the disk opens up to the last whole block, at every moment."""

import io
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from recordings import HEADER, fly, logs_of, opened, read_all, walk, written

from gamms.recorder import Reader, RecordingError, Writer

MIXED = [[*log[:4], (turn, {"data": "x" * turn}), *log[4:]] for turn, log in enumerate(walk(4, 12))]


class Tape(io.BytesIO):
    """A file that remembers every single change, so that it can be looked at after each byte."""

    def __init__(self):
        super().__init__()
        self.changes = []

    def write(self, data):
        self.changes.append((self.tell(), bytes(data)))
        return super().write(data)

    def truncate(self, size=None):
        self.changes.append((self.tell() if size is None else size, None))
        return super().truncate(size)


def moments_of(changes, step):
    """The file after each `step` bytes that go to the disk, and after each cut, with the number of whole changes."""
    data = bytearray()
    for number, (at, piece) in enumerate(changes):
        if piece is None:
            del data[at:]
            yield number + 1, bytes(data)
            continue
        data.extend(bytes(max(at - len(data), 0)))
        for begin in range(0, len(piece), step):
            data[at + begin : at + begin + step] = piece[begin : begin + step]
            yield number + (begin + step >= len(piece)), bytes(data)


def test_a_file_cut_at_any_byte_opens_to_a_prefix():
    data = written(MIXED, turns=5, keyframes=True)
    begin = len(written([], close=False))
    known = 0
    for size in range(len(data)):
        if size < begin:
            with pytest.raises(RecordingError, match="byte"):
                opened(data[:size])
            continue
        reader, logs = read_all(data[:size])
        assert logs == MIXED[: len(logs)]
        assert len(logs) >= known
        known = len(logs)
        assert not reader.is_complete
        assert f"its first {known} turns" in reader.warning
    assert known == len(MIXED)


@pytest.mark.parametrize("turns", [3, 64])
def test_at_every_byte_that_is_written_no_saved_turn_is_lost(turns):
    tape = Tape()
    writer = Writer(tape, HEADER, turns=turns, seconds=0)
    begin, saved = len(tape.changes), []
    for log in MIXED:
        if not writer.turns:
            writer.keyframe({"start": 1})
        writer.add_turn(log)
        saved.append(len(tape.changes))
    writer.close()
    for number, state in moments_of(tape.changes, 29):
        if number >= begin:
            reader, logs = read_all(state)
            assert sum(changes <= number for changes in saved) <= len(logs)
            assert logs == MIXED[: len(logs)]
    assert reader.is_complete
    assert state == tape.getvalue()


@given(st.lists(st.booleans(), min_size=24, max_size=24), st.sampled_from([3, 7, 64]))
@settings(max_examples=10)
def test_flushing_saves_all_turns_and_leaves_the_finished_bytes_as_they_are(flushes, turns):
    logs = [*MIXED, *fly(3, 6), *walk(4, 6)]
    stream = io.BytesIO()
    writer = Writer(stream, {}, turns=turns, seconds=None)
    for turn, (log, is_flushed) in enumerate(zip(logs, flushes, strict=True)):
        writer.add_turn(log)
        if is_flushed:
            writer.flush()
            assert repr(logs_of(opened(stream.getvalue()))) == repr(logs[: turn + 1])
    writer.close()
    assert stream.getvalue() == written(logs, {}, turns=turns)


@given(st.integers(0, 10**6), st.integers(0, 255))
def test_one_wrong_byte_is_noticed(place, byte):
    data = bytearray(written(MIXED, turns=5))
    place %= len(data)
    is_same = data[place] == byte
    data[place] = byte
    try:
        reader, logs = read_all(bytes(data))
    except RecordingError as error:
        is_noticed = "byte" in str(error)
    else:
        is_noticed = not reader.is_complete
        assert logs == MIXED[: len(logs)]
    assert is_noticed != is_same


def test_bytes_after_a_finished_recording_are_mentioned():
    reader, logs = read_all(written(MIXED) + b"more")
    assert logs == MIXED
    assert "are lost" in reader.warning


# -- streams that fail, or know no way back ---------------------------------------------------------------------


class Pipe(io.RawIOBase):
    """A stream that only goes forwards, and that may be full after some bytes."""

    def __init__(self, room=10**9):
        super().__init__()
        self.data, self.room = b"", room

    def writable(self):
        return True

    def write(self, data):
        piece = bytes(data[: min(100, self.room - len(self.data))])  # raw streams take what they like
        if not piece:
            raise BrokenPipeError(32, "Broken pipe")
        self.data += piece
        return len(piece)


def test_a_stream_without_a_way_back_gets_the_same_bytes():
    pipe = Pipe()
    writer = Writer(pipe, HEADER, turns=5, seconds=0)
    for log in MIXED:
        writer.add_turn(log)
        writer.flush()
    assert opened(pipe.data).turns == 10
    writer.close()
    assert pipe.data == written(MIXED, turns=5)


@pytest.mark.parametrize("mode", ["ab", "wb", "xb", "w+b"])
@pytest.mark.parametrize("buffering", [-1, 0])
def test_files_of_every_mode_get_the_same_bytes(tmp_path, mode, buffering):
    with (tmp_path / "game.ggr").open(mode, buffering) as file:
        writer = Writer(file, HEADER, turns=5, seconds=0)
        for log in MIXED:
            writer.add_turn(log)
        writer.close()
    assert (tmp_path / "game.ggr").read_bytes() == written(MIXED, turns=5)


def record(stream, logs):
    writer = Writer(stream, HEADER, turns=5)
    try:
        for log in logs:
            writer.add_turn(log)
        writer.close()
    finally:
        writer.close()  # in silence, whatever happened


def test_a_closed_pipe_gives_one_clear_error_wherever_it_closes():
    whole = written(MIXED, turns=5)
    begin = len(written([], close=False))
    for room in range(0, len(whole), 11):
        pipe = Pipe(room)
        with pytest.raises(RecordingError, match="Broken pipe"):
            record(pipe, MIXED)
        if room >= begin:
            logs = read_all(pipe.data)[1]
            assert logs == MIXED[: len(logs)]


class Disk(io.BytesIO):
    """A file on a disk that has only so much room."""

    room = 10**9

    def write(self, data):
        left = self.room - self.tell()
        if len(data) > left:
            super().write(data[: max(left, 0)])
            raise OSError(28, "No space left on device")
        return super().write(data)


@pytest.mark.parametrize("seconds", [0, None])
def test_a_full_disk_leaves_the_saved_turns(seconds):
    whole = len(written(MIXED, turns=5))
    for room in range(len(written([], close=False)), whole, 5):
        disk = Disk()
        disk.room = room
        writer, saved = Writer(disk, HEADER, turns=5, seconds=seconds), 0
        with pytest.raises(RecordingError, match="No space left"):
            for turn, log in enumerate(MIXED):
                writer.add_turn(log)
                saved = turn + 1 if seconds == 0 else saved
            writer.close()
        logs = read_all(disk.getvalue())[1]
        assert logs == MIXED[: len(logs)]
        assert len(logs) >= saved
        with pytest.raises(RecordingError, match="Nothing more"):
            writer.add_turn([])
        writer.close()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no /dev/full here")
def test_a_device_that_is_full_gives_one_error():
    with Path("/dev/full").open("wb") as file, pytest.raises(RecordingError, match="No space left"):
        Writer(file, {})


@pytest.mark.parametrize("stream", [io.StringIO(), None, io.BytesIO().read], ids=["text", "none", "call"])
def test_a_text_stream_is_refused(stream):
    with pytest.raises(RecordingError, match="could not be written"):
        Writer(stream, {})
    with pytest.raises(RecordingError, match=r"binary stream|not a recording"):
        Reader(stream)
