"""`gamms info`, `verify`, `diff`, `convert`, `replay`, and the recordings that `gamms demo` and `gamms run` write."""

import csv
import io
import json
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

import gamms
from gamms import cli, recorder, recordings
from gamms.recorder import RecordingError

SAMPLES = Path(__file__).parent / "samples/version2"
QUIET = {"level": "CRITICAL"}


def run(*arguments):
    return CliRunner().invoke(cli.app, list(map(str, arguments)), catch_exceptions=False)


def played(path, turns=6, *, change=None, seed=1, drones=True):
    """Record a small game; `change` may do something in each turn."""
    with gamms.create_context(seed=seed, logger_config=QUIET) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 3))
        ctx.sensor.create_sensor("near", gamms.sensor.SensorType.NEIGHBOR)

        def wander(state):
            state["action"] = state["legal"][(state["turn"] * 5 + state["curr_pos"]) % len(state["legal"])]

        for name, team in (("anna", "red"), ("bert", "blue")):
            ctx.agent.create_agent(name, start_node_id=len(team), team=team, sensors=["near"], strategy=wander)
        if drones:
            ctx.agent.create_agent("kite", start_node_id=8, type=1, speed=2.0)
        ctx.record.start(path)
        ctx.game.add(lambda ctx: ctx.game.scores.update(red=ctx.game.turn))
        ctx.game.add(lambda ctx: ctx.game.emit("seen", agent="bert") if ctx.game.turn == 2 else None)
        if change is not None:
            ctx.game.add(change)
        ctx.game.run(max_turns=turns)
        ctx.record.stop()
    return path


@pytest.fixture
def game(tmp_path):
    return played(tmp_path / "game.ggr")


# -- info -------------------------------------------------------------------------------------------------------


def test_info_names_the_missing_part_of_a_recording_that_was_cut_off(game):
    game.write_bytes(game.read_bytes()[:-30])
    assert "was not finished" in run("info", game).stdout


@pytest.mark.parametrize("path", sorted(SAMPLES.glob("*.ggr")), ids=lambda path: path.stem)
def test_info_reads_version_2(path):
    found = json.loads(run("info", path, "--json").stdout)
    assert found["version"] == 2
    assert (found["complete"] == "yes") == (path.stem != "unfinished")
    assert found["events"].get("SIMULATE", 0) == found["turns"]
    assert sum(found["events"].values()) > 0


def test_info_counts_the_agents_at_the_end_of_version_2(tmp_path):
    with gamms.create_context(logger_config=QUIET) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 3))
        ctx.record.start(tmp_path / "old.ggr", version=2)
        for name in ("anna", "bert", "carl"):
            ctx.agent.create_agent(name, start_node_id=0)
        ctx.agent.delete_agent("bert")
        ctx.record.stop()
    assert json.loads(run("info", tmp_path / "old.ggr", "--json").stdout)["agents"] == 2


@pytest.mark.parametrize("command", ["info", "verify", "replay"])
def test_an_invalid_recording_ends_in_one_sentence(tmp_path, command):
    (tmp_path / "no.ggr").write_text("not a recording")
    for name, hint in (("no.ggr", "not a recording"), ("missing.ggr", "missing.ggr")):
        done = run(command, tmp_path / name)
        assert done.exit_code == 1
        assert done.stderr.startswith("gamms: ")
        assert hint in done.stderr


# -- verify -----------------------------------------------------------------------------------------------------


def test_a_sound_recording_is_verified(game):
    done = run("verify", game)
    assert (done.exit_code, done.stderr) == (0, "")
    assert "all is well" in done.stdout


def test_damage_of_any_byte_is_found(game):
    data = game.read_bytes()
    for place in range(0, len(data), 97):
        damaged = bytearray(data)
        damaged[place] ^= 16
        game.write_bytes(damaged)
        done = run("verify", game)
        assert done.exit_code == 1, f"byte {place}"
        assert done.stderr.startswith("gamms: ")


def written_anew(path, monkeypatch, spoil=lambda _: None):
    """A game of 70 turns in blocks of three, whose keyframe after 64 turns was spoilt."""
    monkeypatch.setattr("gamms.recorder.turn_writer._KEYFRAME_ENTRIES", 1)
    monkeypatch.setattr("gamms.recorder.turn_writer._TURNS_AT_ONCE", 64)
    stream = io.BytesIO()
    played(stream, 70)
    reader = recorder.Reader(io.BytesIO(stream.getvalue()))
    with path.open("wb") as file:
        writer = recorder.Writer(file, reader.header, turns=3, seconds=None)
        for turn in range(reader.turns):
            if turn in (0, 64):
                at, keyframe = reader.keyframe(turn)
                assert at == turn
                if turn:
                    spoil(keyframe)
                writer.keyframe(keyframe)
            writer.add_turn(reader.log(turn))
        writer.close()


def test_a_recording_that_was_packed_otherwise_is_sound(tmp_path, monkeypatch):
    written_anew(tmp_path / "odd.ggr", monkeypatch)
    done = run("verify", tmp_path / "odd.ggr")
    assert (done.exit_code, done.stderr) == (0, "")


def test_a_keyframe_that_says_something_else_than_the_turns_before_it_is_named(tmp_path, monkeypatch):
    written_anew(tmp_path / "odd.ggr", monkeypatch, lambda keyframe: keyframe["scores"].append(("blue", 7)))
    done = run("verify", tmp_path / "odd.ggr")
    assert done.exit_code == 1
    assert "The keyframe after turn 64" in done.stderr
    assert "'blue': 7} in the second" in done.stderr


# -- diff -------------------------------------------------------------------------------------------------------


def stray(ctx):
    if ctx.game.turn == 4:
        ctx.agent.get_agent("bert").current_node_id = 0


def test_a_game_is_the_same_as_itself(game, tmp_path):
    played(tmp_path / "again.ggr", seed=2)
    done = run("diff", game, tmp_path / "again.ggr")
    assert done.exit_code == 0
    assert "the same game of 6 turns" in done.stdout


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (stray, "Turn 4, agent 'bert', node: "),
        (lambda ctx: ctx.game.scores.update(blue=1) if ctx.game.turn == 3 else None, "Turn 3, scores: {'red': 3} "),
        (lambda ctx: ctx.game.data.update(x=[1.5]) if ctx.game.turn == 5 else None, "Turn 5, data: {} "),
        (lambda ctx: ctx.game.emit("more") if ctx.game.turn == 2 else None, "Turn 2, events: None "),
        (lambda ctx: ctx.game.end("bored") if ctx.game.turn == 3 else None, "Turn 3, over: None "),
        (lambda ctx: ctx.agent.delete_agent("kite") if ctx.game.turn == 1 else None, "Turn 1, agents: ['kite'] "),
        (lambda ctx: ctx.record.event("note") if ctx.game.turn == 6 else None, "Turn 6, events: None "),
    ],
)
def test_where_two_games_part_is_said(game, tmp_path, change, said):
    played(tmp_path / "other.ggr", change=change)
    done = run("diff", game, tmp_path / "other.ggr")
    assert done.exit_code == 1
    assert done.stdout.startswith(said)


def test_a_game_that_goes_on_longer_is_another(game, tmp_path):
    played(tmp_path / "longer.ggr", 8)
    done = run("diff", game, tmp_path / "longer.ggr")
    assert (done.exit_code, done.stdout) == (1, "Turn 6, turns: 6 in the first, 8 in the second\n")
    played(tmp_path / "fewer.ggr", drones=False)
    assert "Turn 0, agents: ['kite']" in run("diff", game, tmp_path / "fewer.ggr").stdout


# -- convert ----------------------------------------------------------------------------------------------------

EXPECTED = json.loads((SAMPLES / "states.json").read_text())


@pytest.mark.parametrize("name", sorted(path.stem for path in SAMPLES.glob("*.ggr")))
def test_version_2_becomes_version_3_that_is_its_own_replay(name, tmp_path):
    done = run("convert", SAMPLES / f"{name}.ggr", tmp_path / "out")
    is_whole = name != "unfinished"
    assert done.stdout == f"Wrote {tmp_path / 'out.ggr'}.\n"
    assert done.exit_code == (not is_whole)
    assert ("Everything before was converted" in done.stderr) == (not is_whole)
    assert run("verify", tmp_path / "out.ggr").exit_code == 0


def test_values_of_types_that_fields_do_not_declare_are_converted(tmp_path):
    run("convert", SAMPLES / "components.ggr", tmp_path / "out.ggr")
    with gamms.create_context(logger_config=QUIET) as ctx:
        list(ctx.record.replay(tmp_path / "out.ggr"))
        assert ctx.record.get_component("two").text == 1.25


@pytest.mark.parametrize("name", ["basic", "orientation", "sensors", "deleted", "keywords", "tags"])
def test_states_of_version_2_are_those_of_version_3(name, tmp_path):
    run("convert", SAMPLES / f"{name}.ggr", tmp_path / "out.ggr")
    with recorder.open(tmp_path / "out.ggr") as rec:
        assert rec.turns == len(EXPECTED["games"][name]["turns"])
        for state, expected in zip(list(rec)[1:], EXPECTED["games"][name]["turns"], strict=True):
            agents = state.agents
            places = zip(agents["node"].tolist(), agents["previous"].tolist(), strict=True)
            found = dict(zip(agents["name"].tolist(), places, strict=True))
            assert found == {agent: (one["node"], one["prev"]) for agent, one in expected["agents"].items()}


def test_moves_of_version_2_become_moves_and_a_map_may_be_given(tmp_path):
    path = played(tmp_path / "new.ggr", drones=False)
    with gamms.create_context(logger_config=QUIET) as ctx:
        ctx.record.start(tmp_path / "old.ggr", version=2)
        with recorder.open(path) as rec:
            ctx.graph.attach_networkx_graph(rec.graph)
        for name, node in (("anna", 3), ("bert", 4)):
            ctx.agent.create_agent(name, start_node_id=node)
        for _ in ctx.record.replay(path):
            pass
        ctx.record.stop()
        ctx.graph.save(tmp_path / "map.gamms")
    assert run("convert", tmp_path / "old.ggr", tmp_path / "out.ggr", "--map", tmp_path / "map.gamms").exit_code == 0
    with recorder.open(path) as new, recorder.open(tmp_path / "out.ggr") as out:
        for table in zip(new.table("moves").values(), out.table("moves").values(), strict=True):
            assert table[0].tolist() == table[1].tolist()
        assert out.graph.packed == new.graph.packed
    run("convert", tmp_path / "old.ggr", tmp_path / "bare.ggr")
    with recorder.open(tmp_path / "bare.ggr") as bare:
        assert set(bare.graph.columns().xy.ravel().tolist()) == {0.0}


@pytest.mark.parametrize("kind", ["csv", "gpx", "geojson"])
def test_a_game_on_the_shipped_map_is_converted_without_any_optional_library(tmp_path, monkeypatch, kind):
    monkeypatch.setitem(sys.modules, "pyproj", None)
    with gamms.create_context(seed=1, logger_config=QUIET) as ctx:
        gamms.osm.helsinki(ctx)
        ctx.agent.create_agent("anna", start_node_id=0, strategy=gamms.strategies.random_walk)
        ctx.record.start(tmp_path / "game.ggr")
        ctx.game.run(max_turns=2)
    done = run("convert", tmp_path / "game.ggr", tmp_path / f"game.{kind}")
    assert (done.exit_code, done.stderr) == (0, "")
    written = "".join(path.read_text(encoding="utf-8") for path in tmp_path.glob(f"*.{kind}"))
    assert "60.1" in written, "no latitude of Helsinki"


def test_tables_become_csv_files(tmp_path):
    def change(ctx):
        if ctx.game.turn == 3:
            ctx.game.emit("odd", where=[1, {"a": None}], text='a "quoted", text\nin two lines')
            ctx.game.emit("../../up", x=1)

    game = played(tmp_path / "game.ggr", change=change)
    done = run("convert", game, tmp_path / "t.csv")
    assert done.exit_code == 0
    names = {"moves", "scores", "events", "seen", "odd", "sensed"}
    assert {path.name for path in tmp_path.glob("*.csv")} == {f"t_{name}.csv" for name in {*names, "tracks"}}
    assert all(f"t_{name}.csv" in done.stdout for name in names)
    with recorder.open(game) as recording:
        for name in names - {"odd"}:
            header, *rows = csv.reader((tmp_path / f"t_{name}.csv").read_text().splitlines())
            table = recording.table(name)
            assert header == list(table)
            assert rows == [list(map(str, row)) for row in zip(*(one.tolist() for one in table.values()), strict=True)]
    with (tmp_path / "t_odd.csv").open(newline="") as file:
        assert list(csv.reader(file)) == [
            ["turn", "where", "text"],
            ["3", '[1, {"a": null}]', 'a "quoted", text\nin two lines'],
        ]
    before = (tmp_path / "t_moves.csv").stat().st_mtime_ns
    (tmp_path / "t_events.csv").unlink()
    done = run("convert", game, tmp_path / "t.csv")
    assert done.exit_code == 1
    assert "t_moves.csv' already" in done.stderr
    assert not (tmp_path / "t_events.csv").exists()
    assert (tmp_path / "t_moves.csv").stat().st_mtime_ns == before


def test_half_of_a_surrogate_pair_is_escaped_in_json(tmp_path):
    with gamms.create_context(logger_config=QUIET) as ctx:
        ctx.record.start(tmp_path / "game")
        ctx.record.event("odd", text="a\udc80b", nested={"\ud800": "\u00e4"})
        ctx.visual.simulate()
    assert run("convert", tmp_path / "game.ggr", tmp_path / "game.jsonl").exit_code == 0
    lines = [json.loads(line) for line in (tmp_path / "game.jsonl").read_text("utf-8").splitlines()]
    assert lines[2]["data"] == {"kind": "odd", "text": "a\udc80b", "nested": {"\ud800": "\u00e4"}}


def test_json_lines_begin_with_the_agents_as_they_start(game, tmp_path):
    recordings.to_json_lines(game, tmp_path / "out.jsonl")
    header, start = map(json.loads, (tmp_path / "out.jsonl").read_text("utf-8").splitlines()[:2])
    assert (header["event"], header["turns"], start["event"], start["turn"]) == ("HEADER", 6, "START", 0)
    with recorder.open(game) as rec:
        assert [one["node"] for one in start["agents"]] == rec[0].agents["node"].tolist()
        assert rec[1].agents["node"].tolist() != rec[0].agents["node"].tolist()


def test_a_conversion_that_fails_leaves_no_file(game, tmp_path, monkeypatch):
    damaged = bytearray(game.read_bytes())
    damaged[len(damaged) // 2] ^= 1
    (tmp_path / "damaged.ggr").write_bytes(damaged)
    before = sorted(tmp_path.iterdir())
    with pytest.raises(RecordingError):
        recordings.to_json_lines(tmp_path / "damaged.ggr", tmp_path / "out.jsonl")
    with pytest.raises(FileExistsError, match="already"):
        recordings.to_json_lines(game, game)

    def interrupt(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("gamms.recordings.conversion._replay", interrupt)
    with pytest.raises(KeyboardInterrupt):
        recordings.to_version_3(SAMPLES / "basic.ggr", tmp_path / "out")
    assert sorted(tmp_path.iterdir()) == before


def test_conversions_that_make_no_sense_are_refused(game, tmp_path):
    old = SAMPLES / "basic.ggr"
    for arguments, hint in (
        ((game, tmp_path / "out.ggr"), "is a recording of version 3, which is not written as"),
        ((game, tmp_path / "out.xlsx"), "out.xlsx': give an OUT that ends in .csv"),
        ((old, tmp_path / "out.jsonl"), "to a .ggr of version 3 first"),
        ((old, tmp_path / "out.csv"), "to a .ggr of version 3 first"),
        ((game, tmp_path / "out.jsonl", "--map", tmp_path / "map.gamms"), "only for recordings of version 2"),
        ((old, game), "already exists"),
        ((old, tmp_path / "out.ggr", "--map", game), "is not a graph"),
    ):
        done = run("convert", *arguments)
        assert done.exit_code == 1
        assert hint in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["game.ggr"]
    done = run("diff", game, old)
    assert "gamms convert IN OUT" in done.stderr


# -- replay -----------------------------------------------------------------------------------------------------


def test_a_replay_says_who_ended_where(game):
    done = run("replay", game)
    assert done.exit_code == 0
    assert done.stdout.startswith("game.ggr: 6 turns")
    lines = [line.split() for line in done.stdout.splitlines()]
    with recorder.open(game) as rec:
        node = rec[-1].agents["node"][0]
    assert ["anna", "red", "yes", str(node)] in lines
    assert ["kite", "-", "yes", "20,", "20,", "0"] in lines
    assert ["red", "6"] in lines


@pytest.mark.parametrize(
    "arguments",
    [
        ["replay"],
        ["render", "out.html"],
        ["render", "out.svg"],
        ["render", "out.gif"],
        ["convert", "--team", "red", "out.ggr"],
    ],
    ids=" ".join,
)
def test_files_made_of_an_unfinished_recording_name_its_missing_part(game, tmp_path, arguments, monkeypatch):
    monkeypatch.chdir(tmp_path)
    command, *rest = arguments
    assert run(command, game, *rest).exit_code == 0
    assert [Path(name).unlink() for name in rest if name.startswith("out")] == [None] * (len(rest) > 0)
    game.write_bytes(game.read_bytes()[:-30])
    with recorder.open(game) as recording:
        assert "was not finished" in recording.warning
        done = run(command, game, *rest)
        assert done.exit_code == 1
        assert f"gamms: {recording.warning}" in done.stderr
        assert all(Path(name).exists() for name in rest if name.startswith("out"))
        if "out.html" in rest:
            assert recording.warning in Path("out.html").read_text()


def test_a_difference_from_an_unfinished_recording_says_so(game, tmp_path):
    other = tmp_path / "other.ggr"
    other.write_bytes(game.read_bytes()[:-30])
    done = run("diff", game, other)
    assert f"{other}: This recording was not finished" in done.stderr
    assert str(game) not in done.stderr


def test_version_2_is_replayed_too():
    done = run("replay", SAMPLES / "aerial.ggr")
    assert done.exit_code == 0
    done = run("replay", SAMPLES / "unfinished.ggr")
    assert done.exit_code == 1
    assert "ended unexpectedly" in done.stderr
    assert "turns" in done.stdout


# -- games of the command line ----------------------------------------------------------------------------------


def test_the_knowledge_of_a_team_becomes_a_recording(tmp_path):
    with gamms.create_context(logger_config=QUIET) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(3, 3))
        ctx.sensor.create_sensor("near", gamms.sensor.SensorType.NEIGHBOR)
        for name, node in (("anna", 0), ("bert", 8)):
            ctx.agent.create_agent(
                name, start_node_id=node, team=name[0], sensors=["near"], strategy=lambda state: None
            )
        ctx.record.start(tmp_path / "game", sensed=True)
        ctx.game.run(2)
    assert "Wrote" in run("convert", tmp_path / "game.ggr", tmp_path / "a.ggr", "--team", "a").stdout
    with recorder.open(tmp_path / "a") as recording:
        assert recording[-1].agents["name"].tolist() == ["anna"]
    done = run("convert", tmp_path / "game.ggr", tmp_path / "b.csv", "--team", "b")
    assert done.exit_code
    assert "b.csv" in done.stderr
    assert not (tmp_path / "b.csv").exists()
