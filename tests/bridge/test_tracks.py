"""Tracks of real journeys become recordings: matched to the roads, in time, whatever is in the files."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import gamms
from gamms.bridge import recording_from_tracks
from gamms.cli import main
from gamms.errors import BadFile, BadType, BadValue, MissingFile, UnknownType

QUIET = {"level": "CRITICAL"}


def fixes(*places, start=0.0, every=10.0):
    return [{"t": start + i * every, "x": 385_000.0 + x, "y": 6_672_000.0 + y} for i, (x, y) in enumerate(places)]


def places_of(path, agent="anna"):
    """Return (turns + 1, 2) where an agent was, from the corner of the town; NaN while it took no part."""
    with gamms.recorder.open(path) as rec:
        found = []
        for turn in range(rec.turns + 1):
            state = rec.state(turn)
            row = state.agents["name"].tolist().index(agent)
            there = state.agents["alive"][row]
            found.append(state.xy()[row] - (385_000.0, 6_672_000.0) if there else (np.nan, np.nan))
        return np.array(found)


def test_values_read_from_a_recording_give_that_recording_again(tmp_path):
    def ride(state):
        state["action"] = state["draw"].choice(state["legal"])

    with gamms.create_context(seed=3, game={"speed_unit": "metres"}, logger_config=QUIET) as ctx:
        gamms.osm.helsinki(ctx)
        goals = ctx.graph.place(4, rng=np.random.default_rng(1))
        for name, start, goal in (("anna", goals[0], goals[1]), ("bert", goals[2], goals[3])):
            way = {"strategy": lambda state, goal=goal: state.update(action=goal)}
            ctx.agent.create_agent(name, start_node_id=start, speed=70.0, **way)
        ctx.record.start(tmp_path / "first.ggr", created=1_750_000_000)
        ctx.game.run(6)
        ctx.record.stop()
        with gamms.recorder.open(tmp_path / "first.ggr") as rec:
            before = np.array([rec.state(turn).xy() for turn in range(7)])
            rec.export(tmp_path / "tracks.gpx", turn_seconds=10)
        out = tmp_path / "second.ggr"
        reports = recording_from_tracks([tmp_path / "tracks.gpx"], ctx, out, turn_seconds=10.0, noise_m=2.0)
        assert [one.agent for one in reports] == ["anna", "bert"]
    with gamms.recorder.open(out) as rec:
        after = np.array([rec.state(turn).xy() for turn in range(7)])
        assert rec.header["created"] == 1_750_000_000
    off = np.hypot(*(after - before).transpose(2, 0, 1))
    assert off[1:].max() < 3.0
    assert off[0].max() < 30.0  # it begins on a node


def test_a_recording_of_tracks_is_one_as_any_other(town, tmp_path):
    with gamms.create_context(seed=1, logger_config=QUIET) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(2, 2, spacing=100.0))
        (tmp_path / "a.csv").write_text("agent,t,x,y\nb,0,0,0\na,0,9,0\nb,10,60,0\na,10,99,0\n", encoding="utf-8")
        recording_from_tracks([tmp_path / "a.csv"], ctx, tmp_path / "a.ggr", turn_seconds=10.0)
        assert ctx.agent.agents == {}
    gamms.recordings.verify(tmp_path / "a.ggr")
    with gamms.recorder.open(tmp_path / "a.ggr") as rec:
        assert rec.state(1).agents["name"].tolist() == ["a", "b"]
        assert rec.state(1).xy() == pytest.approx(np.array([(99, 0), (60, 0)]))


def test_an_agent_takes_part_while_its_track_lasts(town, tmp_path):
    tracks = {"anna": fixes((0, 0), (100, 0), (200, 0)), "bert": fixes((0, 100), (100, 100), start=30.0)}
    recording_from_tracks(tracks, town, tmp_path / "game", turn_seconds=10.0)
    anna, bert = (places_of(tmp_path / "game.ggr", name) for name in ("anna", "bert"))
    assert np.isfinite(anna[:, 0]).tolist() == [True, True, True, False, False]
    assert np.isfinite(bert[:, 0]).tolist() == [False, False, False, True, True]


def test_one_that_stands_stays_where_it_is_however_its_positions_jump(town, tmp_path):
    rng = np.random.default_rng(0)
    stand = [(150 + dx, dy) for dx, dy in rng.normal(0, 3.0, (40, 2))]
    recording_from_tracks({"anna": fixes((100, 0), *stand, (200, 0))}, town, tmp_path / "game", turn_seconds=10.0)
    found = places_of(tmp_path / "game.ggr")[2:-1]
    assert np.ptp(found[:, 0]) < 20.0
    assert np.abs(np.diff(found[:, 0])).sum() < 20.0


def test_noise_does_not_lead_into_side_streets(town, tmp_path):
    rng = np.random.default_rng(5)
    walk = [(x + dx, dy) for x, (dx, dy) in zip(range(0, 400, 10), rng.normal(0, 5.0, (40, 2)), strict=True)]
    recording_from_tracks({"anna": fixes(*walk, every=1.0)}, town, tmp_path / "game")
    found = places_of(tmp_path / "game.ggr")
    assert found[1:, 1] == pytest.approx(0.0, abs=1e-6)
    assert (np.diff(found[1:, 0]) >= -1e-6).all()


def test_a_track_goes_on_behind_a_gap_in_the_roads(tmp_path):
    with gamms.create_context(seed=1, logger_config=QUIET) as ctx:
        ctx.graph.add_nodes([0, 1, 2, 3], [385_000.0, 385_100.0, 385_200.0, 385_300.0], [6_672_000.0] * 4)
        ctx.graph.add_edges([0, 1], [0, 2], [1, 3], [100.0, 100.0])
        walk = fixes((0, 0), (80, 0), (150, 900), (210, 0), (290, 0))
        (report,) = recording_from_tracks({"anna": walk}, ctx, tmp_path / "game", turn_seconds=10.0)
        assert (report.parts, report.off_road) == (2, 1)
        assert places_of(tmp_path / "game.ggr")[[1, 3, 4], 0] == pytest.approx([80, 210, 290], abs=1.0)


def test_one_way_streets_are_gone_along_in_their_direction(tmp_path):
    with gamms.create_context(seed=1, logger_config=QUIET) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(2, 2, spacing=100.0))
        ctx.graph.close_roads(
            [edge for edge in ctx.graph.graph.get_edges() if ctx.graph.graph.get_edge(edge).target == 0]
        )
        walk = [{"t": t, "x": x, "y": 0.0} for t, x in ((0, 10.0), (10, 50.0), (20, 90.0))]
        recording_from_tracks({"anna": walk}, ctx, tmp_path / "game", turn_seconds=10.0)
        with gamms.recorder.open(tmp_path / "game.ggr") as rec:
            assert rec.state(2).xy()[0] == pytest.approx((90.0, 0.0))


def test_columns_of_csv_files_have_several_names(town, tmp_path):
    lat, lon = town.graph.to_latlon(np.array([385_000.0, 385_100.0]), np.array([6_672_000.0] * 2))
    rows = [f"2025-06-15T15:06:{40 + 10 * i},{lat[i]},{lon[i]}" for i in range(2)]
    (tmp_path / "ride.csv").write_text("\n".join(["Timestamp,Latitude,Longitude", *rows]), encoding="utf-8")
    (report,) = recording_from_tracks([tmp_path / "ride.csv"], town, tmp_path / "game", turn_seconds=10.0)
    assert (report.agent, report.points) == ("ride", 2)
    assert places_of(tmp_path / "game.ggr", "ride")[1] == pytest.approx((100, 0), abs=0.1)
    with gamms.recorder.open(tmp_path / "game.ggr") as rec:
        assert rec.header["created"] == 1_750_000_000


def test_the_map_may_be_a_file(town, tmp_path):
    town.graph.save(tmp_path / "town.gamms")
    recording_from_tracks(
        {"anna": fixes((0, 0), (100, 0))}, tmp_path / "town.gamms", tmp_path / "game", turn_seconds=5.0
    )
    assert places_of(tmp_path / "game.ggr")[:, 0] == pytest.approx([0, 50, 100])


def test_the_command_line_makes_recordings_of_tracks(town, tmp_path, capsys, monkeypatch):
    def convert(*arguments):
        monkeypatch.setattr("sys.argv", ["gamms", "convert", str(tmp_path / "ride.csv"), *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            main()
        return ended.value.code

    town.graph.save(tmp_path / "town.gamms")
    (tmp_path / "ride.csv").write_text("t,x,y\n0,385000,6672003\n10,385100,6672003\n", encoding="utf-8")
    out = tmp_path / "ride.ggr"
    assert not convert(out, "--map", tmp_path / "town.gamms", "--turn-seconds", "5")
    assert "ride: 2 points, on average 3.0 m from their roads; outliers: 0." in capsys.readouterr().out
    assert places_of(out, "ride")[:, 0] == pytest.approx([0, 50, 100])
    assert convert(out)
    assert "give --map FILE.gamms" in capsys.readouterr().err


def test_a_fix_without_a_place_is_none_and_the_track_goes_on(town, tmp_path):
    walk = fixes((0, 0), (100, 0), (200, 0))
    walk.insert(1, {"t": 5.0})
    (report,) = recording_from_tracks({"anna": walk}, town, tmp_path / "game.ggr", turn_seconds=10.0)
    assert report.points == 3
    assert places_of(tmp_path / "game.ggr")[:, 0] == pytest.approx([0, 100, 200])


BAD = {
    "bomb.gpx": '<?xml version="1.0"?><!DOCTYPE gpx [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;">]><gpx>&b;</gpx>',
    "deep.gpx": "<gpx>" + "<a>" * 100_000,
    "empty.gpx": "<gpx></gpx>",
    "untimed.gpx": '<gpx><trk><trkseg><trkpt lat="60.17" lon="24.94"/></trkseg></trk></gpx>',
    "mistimed.gpx": '<gpx><trk><trkseg><trkpt lat="60.17" lon="24.94"><time>now</time></trkpt></trkseg></trk></gpx>',
    "far.gpx": '<gpx><trk><trkseg><trkpt lat="-60" lon="-120"><time>2025-01-01</time></trkpt></trkseg></trk></gpx>',
    "off.gpx": '<gpx><trk><trkseg><trkpt lat="60.3" lon="24.94"><time>2025-01-01</time></trkpt></trkseg></trk></gpx>',
    "none.csv": "",
    "columns.csv": "a,b,c\n1,2,3",
    "words.csv": "t,x,y\n1,here,3",
    "short.csv": "t,x,y\n1",
    "nan.csv": "t,x,y\nnan,385000,6672000",
    "infinite.csv": "t,x,y\n1,inf,6672000",
    "nul.csv": "t,x,y\n1,\0,3",
    "huge.csv": "t,x,y\n1," + "9" * 200_000 + ",3",
    "times.csv": "t,x,y\n0,385000,6672000\n1e18,385100,6672000",
    "latin.csv": b"t,x,y\n\xff\xfe,1,2",
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_file_is_refused_by_a_sentence(town, tmp_path, name):
    content = BAD[name]
    (tmp_path / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises((BadValue, BadFile)) as error:
        recording_from_tracks([tmp_path / name], town, tmp_path / "game.ggr", turn_seconds=1.0)
    assert len(str(error.value)) < 400
    assert not (tmp_path / "game.ggr").exists()


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        ("t,x,y\n0,385000,6672000\n1,here,3", "'ride.csv' cannot be used .* line 3: could not convert .* 'here'"),
        ("t,lat,lon\n0,60.17,24.94\n1,90.5,24.94", "'ride.csv' cannot be used .*: lat must lie between .* not 90.5"),
        ("t,x,y\n0,385000,", "'ride.csv' cannot be used .* line 2"),
    ],
)
def test_a_bad_value_in_a_csv_file_is_named_with_the_file(town, tmp_path, monkeypatch, rows, words):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "ride.csv").write_text(rows, encoding="utf-8")
    with pytest.raises(BadFile, match=words):
        recording_from_tracks(["ride.csv"], town, "game.ggr")


@pytest.mark.parametrize(
    ("digits", "unit"), [("{}000", "milliseconds"), ("{}000000", "microseconds"), ("{}000000000", "nanoseconds")]
)
@pytest.mark.parametrize("is_file", [True, False])
def test_times_in_a_finer_unit_than_seconds_are_refused(town, tmp_path, digits, unit, is_file):
    times = [digits.format(1_774_745_990 + i) for i in range(3)]
    lines = [f"{time},{385_000 + 20 * i},6672000" for i, time in enumerate(times)]
    (tmp_path / "ride.csv").write_text("\n".join(["time,x,y", *lines]), encoding="utf-8")
    given = [{"t": float(time), "x": 385_000.0 + 20 * i, "y": 6_672_000.0} for i, time in enumerate(times)]
    tracks = [tmp_path / "ride.csv"] if is_file else {"ride": given}
    with pytest.raises(BadValue, match=f"time of the track of 'ride' is 17747.* it may be {unit}. Divide times by 1"):
        recording_from_tracks(tracks, town, tmp_path / "game.ggr")
    assert not (tmp_path / "game.ggr").exists()


def test_digits_in_a_gpx_file_are_no_date(town, tmp_path):
    place = '<trkpt lat="60.17" lon="24.94"><time>1712101012345</time></trkpt>'  # not 10 October 1712
    (tmp_path / "ride.gpx").write_text(f"<gpx><trk><trkseg>{place}</trkseg></trk></gpx>", encoding="utf-8")
    with pytest.raises(BadFile, match="no point with both a time and a position"):
        recording_from_tracks([tmp_path / "ride.gpx"], town, tmp_path / "game.ggr")


def test_errors_for_wrong_arguments_name_right_ones(town, tmp_path):
    cases = [
        (lambda: recording_from_tracks([], town, "x"), BadValue, "There are no tracks"),
        (lambda: recording_from_tracks("a.gpx", town, "x"), BadType, "tracks must be a list of files"),
        (lambda: recording_from_tracks([3], town, "x"), BadType, "A track"),
        (lambda: recording_from_tracks({"anna": 3}, town, "x"), BadType, "A track is a file or a list of fixes"),
        (lambda: recording_from_tracks(["a.kml"], town, "x"), UnknownType, r"\.kml"),
        (lambda: recording_from_tracks(["a.csv"], town, "x"), MissingFile, "a.csv"),
        (lambda: recording_from_tracks({"a": fixes((0, 0))}, 3, "x"), BadType, "graph must be a context"),
        (lambda: recording_from_tracks({"a": fixes((0, 0))}, town, "x", turn_seconds=0), BadValue, "more than 0"),
        (
            lambda: recording_from_tracks({"a": fixes((0, 0), (9, 0), every=2e6)}, town, "x", turn_seconds=0.5),
            BadValue,
            "The tracks last 2,000,000 s, which are 4,000,000 turns of 0.5 s, and 1,000,000 are allowed",
        ),
    ]
    for call, kind, words in cases:
        with pytest.raises(kind, match=words):
            call()
    assert not list(tmp_path.iterdir())


times = st.floats(-1e6, 1e6)
coordinates = st.floats(-600, 900)


@settings(max_examples=8)
@given(st.lists(st.tuples(st.floats(0, 200), coordinates, coordinates), min_size=1, max_size=8))
def test_any_track_gives_a_recording_on_the_roads_or_an_error(tmp_path_factory, points):
    out = tmp_path_factory.mktemp("any") / "game.ggr"
    with gamms.create_context(seed=1, logger_config=QUIET) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(4, 4, spacing=100.0))
        walk = [{"t": t, "x": x, "y": y} for t, x, y in points]
        try:
            recording_from_tracks({"anna": walk}, ctx, out, turn_seconds=20.0)
        except BadValue as error:
            if "No point of the track" not in str(error):
                raise
            return
        with gamms.recorder.open(out) as rec:
            for turn in range(rec.turns + 1):
                x, y = rec.state(turn).xy()[0]
                assert min(x % 100.0, -x % 100.0, y % 100.0, -y % 100.0) < 1e-6
