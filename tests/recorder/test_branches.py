"""What would have happened: games that go on from a turn of a recording with other strategies and seeds."""

import pytest

import gamms
from gamms import recorder
from gamms.errors import BadType, UnknownName
from gamms.scenario import Scenario

WALK = {"strategy": "gamms.strategies:random_walk"}
TAG = Scenario(
    max_turns=12,
    map={"grid": {"width": 5, "height": 5}},
    teams={"red": {"count": 2, **WALK}, "blue": {"count": 2, **WALK}},
    rules=[{"rule": "tag", "with": {"taggers": "red", "tagged": "blue"}}],
)


def wait(state):
    state["action"] = state["curr_pos"]


def fail(state):
    raise ValueError("no")


@pytest.fixture(scope="module")
def played(tmp_path_factory):
    """A recorded game, and its result."""
    file = tmp_path_factory.mktemp("games") / "game.ggr"
    return file, TAG.play(seed=3, record=file)


def test_the_recorded_seed_and_strategies_give_the_recorded_end(played):
    file, result = played
    with recorder.open(file) as recording:
        table = recording.branch(5, seeds=[3])
    assert table["turns"].tolist() == [12]
    assert table["score.red"].tolist() == [result.scores.get("red", 0)]
    assert table["error"].tolist() == [None]


def test_each_seed_of_each_combination_is_a_row_of_resume(played):
    file, _ = played
    with recorder.open(file) as recording:
        table = recording.branch(5, strategies={"red": [None, wait], "blue": {"still": wait}}, seeds=[1, 2])
        assert table["strategies.red"].tolist() == [None, None, "wait", "wait"]
        assert table["strategies.blue"].tolist() == ["still"] * 4
        assert table["seed"].tolist() == [1, 2, 1, 2]
        assert table["moves.red"][2:].tolist() == [0, 0]
        with recording.resume(5, {"blue": wait}, seed=2, ctx=TAG.build()) as ctx:
            row = ctx.game.run().row()
    assert {name: table[name][1] for name in row} == row


def test_a_strategy_that_raises_is_a_row_with_an_error(played):
    file, _ = played
    with recorder.open(file) as recording:
        table = recording.branch(5, strategies={"red": [fail, wait]}, max_turns=2)
    assert table["error"].tolist() == ["ValueError: no", None]
    assert table["turns"].tolist() == [None, 7]


def test_the_game_may_be_built_by_the_caller(played):
    file, _ = played
    with recorder.open(file) as recording:
        table = recording.branch(5, seeds=[1], build=TAG.replace(rules=[]).build)
        assert table["turns"].tolist() == [12]
        with pytest.raises(UnknownName, match="Did you mean 'blue'"):
            recording.branch(5, strategies={"bleu": [wait]})
        with pytest.raises(BadType, match=r"build must be a function .* not range\(0, 3\)"):
            recording.branch(5, build=range(3))


def test_a_recording_without_a_scenario_asks_for_a_function_that_builds_the_game(tmp_path):
    with gamms.create_context(seed=3) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 3))
        ctx.record.start(tmp_path / "game.ggr")
        ctx.game.run(1)
        ctx.record.stop()
    with (
        recorder.open(tmp_path / "game.ggr") as recording,
        pytest.raises(ValueError, match=r"holds no scenario.*build="),
    ):
        recording.branch(1)


def test_a_recording_that_was_closed_says_so(played):
    with recorder.open(played[0]) as recording:
        pass
    with pytest.raises(recorder.RecordingError, match="This recording was closed: open it again"):
        recording.state(3)
