"""Recordings that do not hold their map, but name it by its SHA-256."""

import hashlib
import io
import json

import pytest
from games import QUIET, act, copied, empty_context, everything, grid_context, recorded, replayed
from typer.testing import CliRunner

import gamms
from gamms import recordings
from gamms.cli import app
from gamms.errors import BadType
from gamms.recorder import RecordingError


def a_game(ctx):
    ctx.agent.create_agent("a", start_node_id=0)
    for node in (1, 4, 5):
        act(ctx, "a", node)
        ctx.visual.simulate()


@pytest.fixture
def small():
    return recorded(a_game, embed_graph=False)


@pytest.fixture
def map(ctx, tmp_path):
    ctx.graph.save(tmp_path / "map.gamms")
    return tmp_path / "map.gamms"


def run(*words):
    return CliRunner().invoke(app, [str(word) for word in words])


def test_the_header_names_the_map_by_the_hash_of_its_file(small, map):
    with gamms.recorder.open(io.BytesIO(small)) as rec:
        assert rec.header["world_sha256"] == hashlib.sha256(map.read_bytes()).hexdigest()
    assert len(small) < len(recorded(a_game))


def test_it_replays_where_the_same_map_is(small, map):
    ctx = empty_context()
    ctx.graph.load(map)
    again, _ = replayed(small, ctx)
    assert everything(again) == everything(replayed(recorded(a_game))[0])


@pytest.mark.parametrize("has_graph", [False, True])
def test_it_is_refused_where_the_map_is_another_and_nothing_changes(small, has_graph):
    ctx, stream = empty_context(), io.BytesIO()
    if has_graph:
        ctx.graph.graph.add_node({"id": 0, "x": 0.0, "y": 0.0})
    ctx.record.start(stream)
    with pytest.raises(RecordingError, match=r"does not contain its map.*SHA-256.*ctx\.graph\.load"):
        replayed(small, ctx)
    ctx.graph.graph.add_node({"id": 7, "x": 0.0, "y": 0.0})
    ctx.record.stop()
    again, _ = replayed(stream.getvalue())
    assert everything(again) == everything(ctx)


def test_a_copy_is_the_same_file(small):
    assert copied(small, grid_context()) == small
    assert copied(recorded(a_game), embed_graph=False) == small


def test_states_need_no_map_and_maps_that_came_later_are_there(ctx):
    def play(ctx):
        a_game(ctx)
        ctx.graph.graph.remove_edge(3)
        ctx.visual.simulate()

    data = recorded(play, ctx, embed_graph=False)
    rec = gamms.recorder.open(io.BytesIO(data))
    assert rec[3].agents["node"].tolist() == [5]
    for graph in (lambda: rec.graph, lambda: rec[3].graph):
        with pytest.raises(RecordingError, match=r"does not contain its map.*graph="):
            graph()
    assert rec[4].graph.packed == ctx.graph.storage.pack()


@pytest.mark.parametrize("of", [lambda ctx, _: ctx, lambda ctx, _: ctx.graph, lambda _, path: path])
def test_the_map_may_be_given_when_it_is_opened(small, ctx, map, of):
    with gamms.recorder.open(io.BytesIO(small), graph=of(ctx, map)) as rec:
        assert rec.graph.packed == rec[2].graph.packed == ctx.graph.storage.pack()
        with gamms.recorder.open(io.BytesIO(small), graph=rec.graph) as other:
            assert other.graph.packed == rec.graph.packed


def test_another_map_is_refused_when_it_is_opened(small, ctx):
    ctx.graph.graph.remove_node(0)
    for data in (small, recorded(a_game)):
        with pytest.raises(RecordingError, match="not the map of the recording"):
            gamms.recorder.open(io.BytesIO(data), graph=ctx)
    with pytest.raises(BadType, match="graph= is"):
        gamms.recorder.open(io.BytesIO(small), graph=7)


def test_games_are_compared_by_the_hashes_of_their_maps(small, ctx):
    ctx.graph.graph.remove_edge(3)
    other = recorded(a_game, ctx, embed_graph=False)

    def difference(one, two):
        with gamms.recorder.open(io.BytesIO(one)) as first, gamms.recorder.open(io.BytesIO(two)) as second:
            return recordings.first_difference(first, second)

    assert difference(small, recorded(a_game)) is None
    assert difference(small, other).field == "map"


def test_the_command_line_names_the_missing_map(small, map, tmp_path):
    game = tmp_path / "game.ggr"
    game.write_bytes(small)
    found = json.loads(run("info", game, "--json").stdout)
    assert "not in the file" in found["map"]
    assert hashlib.sha256(map.read_bytes()).hexdigest() in found["map"]
    assert "nodes" not in found
    without = run("verify", game)
    assert (without.exit_code, "--map FILE" in without.stderr) == (1, True)
    assert run("verify", game, "--map", map).exit_code == 0
    assert run("replay", game, "--map", map).exit_code == 0
    assert run("convert", game, tmp_path / "game.jsonl").exit_code == 0
    with gamms.create_context(logger_config=QUIET) as ctx:
        ctx.graph.save(tmp_path / "other.gamms")
    wrong = run("verify", game, "--map", tmp_path / "other.gamms")
    assert (wrong.exit_code, "not the map of the recording" in wrong.stderr) == (1, True)


def test_a_header_without_a_map_and_without_a_name_is_refused(empty):
    stream = io.BytesIO()
    gamms.recorder.Writer(stream, {"format": 3}).close()
    with pytest.raises(RecordingError, match="map at the start is not there"):
        replayed(stream.getvalue(), empty)
