"""Programs that are killed, or run out of room, while they record: what was written opens, and the errors are clear."""

import pytest
from games import grid_context
from test_crashes import Disk

from gamms import recorder
from gamms.recorder import Reader, RecordingError

# -- no room --------------------------------------------------------------------------------------------------------


def test_a_file_that_cannot_be_written_when_the_context_ends_does_not_keep_it_open():
    ctx, disk = grid_context(), Disk()
    ctx.record.start(disk)
    disk.room = 0
    with pytest.raises(RecordingError, match="No space left"):
        ctx.terminate()
    assert ctx.is_terminated()
    assert not ctx.record.is_open


def test_a_full_disk_at_the_end_does_not_hide_the_error_of_the_block():
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
