"""Programs that are killed, or run out of room, while they record: what was written opens, and the errors are clear."""

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from games import empty_context, grid_context
from test_crashes import Disk

from gamms import recorder
from gamms.recorder import Reader, RecordingError

PROGRAM = """
import sys, time
sys.path.insert(0, sys.argv[1])
from games import act, grid_context
ctx = grid_context()
for number in range(20):
    ctx.agent.create_agent(f"a{number}", start_node_id=4, sensors=["near"])
ctx.record.start(sys.argv[2])
print("ready", flush=True)
turn = 0
while True:
    for name, agent in ctx.agent.agents.items():
        state = agent.get_state()
        state["action"] = state["sensor"]["near"][1][(turn + agent._row) % 3]
        agent.set_state()
    turn += 1
    ctx.game.data["turn"] = turn
    ctx.visual.simulate()
    time.sleep(0.0002)
"""


def killed_after(path, seconds):
    """Let a program record, and kill it after a time; None: when turns of it were saved."""
    command = [sys.executable, "-c", PROGRAM, str(Path(__file__).parent), str(path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as program:
        assert program.stdout.readline() == "ready\n"
        time.sleep(seconds or 0.0)
        while seconds is None and not turns_of(path):
            assert program.poll() is None
            time.sleep(0.01)
        program.send_signal(signal.SIGKILL)
    assert program.returncode == -signal.SIGKILL


def turns_of(path):
    with Reader(path) as reader:
        return reader.turns


def check_prefix(path, seconds):
    """What was saved can be read and replayed, turn by turn."""
    with Reader(path) as reader:
        reader.verify()
        assert not reader.is_complete
        assert "turns" in reader.warning
        turns = reader.turns
    ctx = empty_context()
    counted = [ctx.game.data["turn"] for record in ctx.record.replay(path) if record["opCode"] == 1]
    assert counted == list(range(1, turns + 1))
    assert turns or seconds is not None


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="nobody is killed here")
@pytest.mark.parametrize("seconds", [0.05, 0.4, None])
def test_a_killed_program_leaves_a_recording_of_its_first_turns(tmp_path, seconds):
    killed_after(tmp_path / "game.ggr", seconds)
    check_prefix(tmp_path / "game.ggr", seconds)


# -- no room --------------------------------------------------------------------------------------------------------


def test_a_file_that_cannot_be_written_when_the_context_ends_does_not_keep_it_open():
    ctx, disk = grid_context(), Disk()
    ctx.record.start(disk)
    disk.room = 0
    with pytest.raises(RecordingError, match="No space left"):
        ctx.terminate()
    assert ctx.is_terminated()
    assert not ctx.record.is_open


def test_a_full_disk_at_the_end_does_not_hide_what_ended_the_block():
    ctx, disk = grid_context(), Disk()
    with pytest.raises(ZeroDivisionError) as caught, ctx:
        ctx.record.start(disk)
        disk.room = 0
        _ = 1 / 0
    assert "No space left" in caught.value.__notes__[0]
    assert ctx.is_terminated()
    assert not ctx.record.is_open


def test_a_rule_that_closes_the_context_leaves_a_finished_recording(tmp_path):
    ctx = grid_context()
    ctx.agent.create_agent("a", start_node_id=0, strategy=lambda state: None)
    ctx.game.add(lambda ctx: ctx.terminate() if ctx.game.turn == 3 else None)
    ctx.record.start(tmp_path / "game")
    ctx.game.run(5)
    with recorder.open(tmp_path / "game.ggr") as recording:
        assert (recording.turns, recording.warning) == (2, None)  # and what happened in the third


@pytest.mark.parametrize("phase", ["before", "after"])
def test_a_rule_that_raises_leaves_as_many_turns_as_the_game_has(tmp_path, phase):
    def fail_once(ctx):
        if ctx.game.turn == 2 and not failures:
            failures.append(ctx.game.turn)
            raise ZeroDivisionError

    failures = []
    with grid_context() as ctx:
        ctx.agent.create_agent("a", start_node_id=0, strategy=lambda state: None)
        ctx.game.add(fail_once, phase=phase)
        ctx.record.start(tmp_path / "game")
        with pytest.raises(ZeroDivisionError):
            ctx.game.run(4)
        ctx.game.run(4 - ctx.game.turn)
        assert ctx.game.turn == 4
    with Reader(tmp_path / "game.ggr") as reader:
        assert (reader.turns, reader.is_complete) == (4, True)
