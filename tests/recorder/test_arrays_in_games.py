"""Arrays as facts, data, events, memories and winner: a game that is recorded plays as one that is not."""

import numpy as np
import pytest

import gamms
from gamms.recorder.recording import open as open_recording


def play(path=None, repeat=1, **values):
    ctx = gamms.create_context(seed=3, logger_config={"level": "CRITICAL"})
    ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 3))

    def strategy(state):
        state["action"] = state["curr_pos"]
        state["memory"]["seen"] = np.arange(state["turn"])

    ctx.agent.create_agent("a", start_node_id=0, strategy=strategy)

    @ctx.game.add
    def rule(ctx):
        turn = ctx.game.turn // repeat
        ctx.game.publish(**{name: make(turn) for name, make in values.items()})
        ctx.game.scores["red"] = np.sum(values["array"](turn))
        ctx.game.data["kept"] = values["array"](turn)
        ctx.game.emit("seen", what=values["array"](turn))
        if ctx.game.turn == 5:
            ctx.game.end("done", winner=values["array"](turn))

    if path is not None:
        ctx.record.start(path)
    with ctx:
        return ctx.game.run(9).to_dict() | {"timings": None}, ctx.game.data


@pytest.mark.parametrize(
    "make",
    [
        lambda turn: np.array([1.0, turn]),
        lambda turn: np.array([turn]),
        lambda turn: np.zeros((0, 2)),
        lambda turn: np.array(turn > 2),
        np.float64,
    ],
    ids=["several", "one", "none", "no dimension", "a number of NumPy"],
)
def test_arrays_play_the_same_with_and_without_a_recording(tmp_path, make):
    values = {"array": make, "nested": lambda turn: {"rows": [make(turn)]}}
    free, recorded = play(**values)[0], play(tmp_path / "game", **values)[0]
    assert free == recorded
    with open_recording(tmp_path / "game.ggr") as recording:
        assert recording.turns == 5
        state = recording.state(3)
        assert dict(state.scores)["red"] == np.sum(make(3))
        assert np.array_equal(state.data["kept"], make(3))
        assert np.array_equal(recording.state(5).over["winner"], make(5))


def test_a_fact_that_is_published_again_as_it_was_is_written_once(tmp_path):
    sizes = []
    for repeat in (1, 9):
        play(tmp_path / f"{repeat}", repeat, array=lambda turn: np.full(500, turn + 0.5))
        sizes.append((tmp_path / f"{repeat}.ggr").stat().st_size)
    assert sizes[1] < sizes[0]
