"""Games of every kind are played as they were when they were written down, alone and in batches, to the byte.

To write them again: `GAMMS_REFRESH_EXAMPLES=1 pytest tests/golden_games`. A difference is a change of what a game
means: the change log has to name it.
"""

import hashlib
import io
import json
import os
import zlib
from dataclasses import replace
from pathlib import Path

import pytest
from kinds_of_games import GAMES

import gamms
from gamms import recordings

GOLDEN = Path(__file__).parent / "golden"
RESULTS = GOLDEN / "results.json"
WRITTEN_BY = GOLDEN / "written_by.json"
RECORDED = 1  # the number and the seed of the game of which there is a recording
IS_WRITTEN = os.environ.get("GAMMS_REFRESH_EXAMPLES") == "1"
VERSIONS = {"gamms": gamms.__version__, "zlib": zlib.ZLIB_RUNTIME_VERSION}


def summarize(result):
    """Return digits that differ if anything in a result differs, but for what says how it was played."""
    text = json.dumps(replace(result, timings={}, provenance={}).to_dict(), sort_keys=True, default=repr)
    return hashlib.sha256(text.encode()).hexdigest()[:12]


def read_results(name):
    return json.loads(RESULTS.read_text())[name]


def assert_same_recording(found, name):
    """Check the bytes of a recording; written by other versions, it has the same events and states."""
    expected = (GOLDEN / f"{name}.ggr").read_bytes()
    if found == expected:
        return
    with gamms.recorder.open(io.BytesIO(expected)) as first, gamms.recorder.open(io.BytesIO(found)) as second:
        assert recordings.first_difference(first, second) is None
    assert json.loads(WRITTEN_BY.read_text()) != VERSIONS, "the same events have other bytes"


@pytest.mark.parametrize("name", GAMES)
def test_a_game_alone_is_played_and_recorded_as_it_was_written_down(name, tmp_path):
    path = tmp_path / "game.ggr"
    result = GAMES[name].scenario.play(seed=RECORDED, record=path)
    if IS_WRITTEN:
        write(name, path)
    assert summarize(result) == read_results(name)[RECORDED]
    assert_same_recording(path.read_bytes(), name)


def write(name, path):
    """Write down the results of all games, each played alone, and one recording."""
    GOLDEN.mkdir(exist_ok=True)
    (GOLDEN / f"{name}.ggr").write_bytes(path.read_bytes())
    known = json.loads(RESULTS.read_text()) if RESULTS.exists() else {}
    golden = GAMES[name]
    known[name] = [summarize(golden.scenario.play(seed=seed)) for seed in range(golden.num_games)]
    lines = [f"{json.dumps(one)}: {json.dumps(known[one])}" for one in sorted(known)]
    RESULTS.write_text("{\n" + ",\n".join(lines) + "\n}\n")
    WRITTEN_BY.write_text(json.dumps(VERSIONS) + "\n")


@pytest.mark.parametrize("name", GAMES)
def test_two_games_in_a_batch_are_the_games_alone_and_so_is_the_recording(name, tmp_path):
    golden = GAMES[name]
    with golden.scenario.batch(2, record=True, most_agents=golden.most_agents) as games:
        games.run()
        assert [summarize(games.result(number)) for number in range(2)] == read_results(name)[:2]
        games.record(RECORDED, tmp_path / "game.ggr")
    assert_same_recording((tmp_path / "game.ggr").read_bytes(), name)


@pytest.mark.parametrize("name", [name for name, golden in GAMES.items() if golden.num_games >= 16])
def test_each_of_many_games_in_a_batch_is_the_game_alone(name):
    golden = GAMES[name]
    with golden.scenario.batch(golden.num_games, most_agents=golden.most_agents) as games:
        while not games.is_over.all():
            games.step()
        found = [summarize(games.result(number)) for number in range(golden.num_games)]
    assert found == read_results(name)


@pytest.mark.parametrize("name", [name for name, golden in GAMES.items() if golden.num_games == 300])
def test_forty_games_are_those_of_three_hundred(name):
    golden = GAMES[name]
    with golden.scenario.batch(40, most_agents=golden.most_agents) as games:
        games.run()
        assert [summarize(games.result(number)) for number in range(40)] == read_results(name)[:40]
