"""What a recording holds costs time and memory in proportion to its size, and whatever GAMMS writes is within that."""

import io
import tracemalloc
from contextlib import nullcontext, suppress
from time import process_time

import hostile
import numpy as np
import pytest
from recordings import logs_of, opened, read_all, written

from gamms import limits
from gamms.ir import events as kinds
from gamms.recorder import RecordingError
from gamms.recorder import open as opened_recording
from gamms.recorder.detached import DetachedAgents

FLOOR = 1 << 18


@pytest.fixture
def low_floor(monkeypatch):
    monkeypatch.setattr(limits, "_FLOOR", FLOOR)


def everything(data):
    """Read a recording in the ways that commands do."""
    with opened_recording(io.BytesIO(data)) as recording:
        for _ in recording.steps():
            pass
        return recording[0], recording[-1], list(recording.events())


@pytest.mark.parametrize("made", hostile.COLLISIONS.values(), ids=hostile.COLLISIONS.keys())
def test_keys_of_one_hash_are_refused_wherever_they_are(made):
    with pytest.raises(RecordingError, match="made to have one hash"):
        everything(made(200))
    everything(made(20))


@pytest.mark.parametrize("made", hostile.MEMORY.values(), ids=hostile.MEMORY.keys())
@pytest.mark.usefixtures("low_floor")
def test_a_small_file_does_not_take_much_memory(made):
    data = made(100_000)
    assert len(data) < 8_000
    tracemalloc.start()
    try:
        with suppress(RecordingError):
            everything(data)
        assert tracemalloc.get_traced_memory()[1] < 4 * (FLOOR + limits.PER_BYTE * len(data))
    finally:
        tracemalloc.stop()


LISTS = [[]] * 8_000
REGULAR = {
    "empty lists": [[(3, LISTS)]],
    "lists and dicts": [[(3, [{"a": (1, {2})}, None] * 1_250)]] * 3,
    "zeros": [[(3, np.zeros(10**6 // 4))], [(3, bytes(10**6 // 4))]],
    "equal texts": [[(3, hostile.texts(10_000))]],
    "numbered texts": [[(3, [f"agent_{i}" for i in range(10_000)])]],
    "other texts": [[(3, ["a\ud800", "ü" * 100, "a"] * 2_500)]],
    "moves to one node": [[0, 0] * 50_000] * 2,
    "turns without events": [[]] * 5_000,
    "events of one kind": [[(3, {"a": 1, "b": {"c": 0.5}})] * 5_000],
    "flights": [[(kinds.AERIAL_AGENT_FLIGHT, (0, 0, 0.0, 0.0, 0.0))] * 10_000],
}


@pytest.mark.parametrize("logs", REGULAR.values(), ids=REGULAR.keys())
def test_whatever_is_written_can_be_read_however_regular_it_is(logs, monkeypatch):
    monkeypatch.setattr(limits, "_FLOOR", 0)
    data = written(logs, {"a": LISTS}, turns=1 << 16)
    assert str(logs_of(opened(data))) == str(logs)
    read_all(data)  # several times, all of which is charged once


@pytest.mark.parametrize("name", ["empty lists", "empty dicts", "texts", "zeros", "moves to one node"])
def test_no_value_of_a_recording_takes_more_memory_than_is_allowed(name, monkeypatch):
    monkeypatch.setattr(hostile, "unpadded", nullcontext)
    data = hostile.MEMORY[name](100_000)
    everything(data)
    with limits.allowing("200K"), pytest.raises(RecordingError, match=r"more than the 0 MiB .* --max-memory 8G"):
        everything(data)


@pytest.mark.usefixtures("low_floor")
def test_a_file_that_unpacks_to_too_much_is_refused():
    with pytest.raises(RecordingError, match=r"damaged at byte \d+: it unpacks to more than 1 MiB of values"):
        opened(hostile.recording([[]] * 40_000, turns=1 << 16))


def test_turns_of_an_ordinary_game_are_not_padded():
    logs = [[row for agent in range(50) for row in (agent, agent * turn % 97)] for turn in range(64)]
    logs[7].append((4, {"kind": "met", "agents": [f"agent {i}" for i in range(50)]}))
    data = written(logs)
    with hostile.unpadded():
        assert written(logs) == data


@pytest.mark.parametrize("made", hostile.TIME.values(), ids=hostile.TIME.keys())
def test_agents_come_and_go_without_looking_at_all_others(made, monkeypatch):
    touched = [0]

    settle = DetachedAgents.settle

    def counted(self):
        touched[0] += len(self.columns["names"]) if self._gone else 0
        settle(self)

    monkeypatch.setattr(DetachedAgents, "settle", counted)
    count = 1_000
    with suppress(RecordingError), opened_recording(io.BytesIO(made(count))) as recording:
        recording.state(recording.turns)
    assert touched[0] < 12 * count


@pytest.mark.parametrize(
    ("made", "size"),
    [*((made, 10_000) for made in hostile.MEMORY.values()), *((made, 4_000) for made in hostile.TIME.values())],
)
@pytest.mark.usefixtures("no_collection")
def test_a_small_file_does_not_take_much_time(made, size):
    quarter, whole = (seconds_of(made(count)) for count in (size // 4, size))
    assert whole < 8 * quarter + 0.2  # where each is compared with each, 16 times as much, and 40 ns for each pair


def seconds_of(data):
    begin = process_time()
    with suppress(RecordingError):
        everything(data)
    return process_time() - begin
