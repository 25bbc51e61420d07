"""Where the agents of a recording were, as GPX, GeoJSON and CSV files."""

import csv
import io
import json

import numpy as np
import pytest

import gamms
from gamms import recorder
from gamms.errors import BadType, BadValue, MissingFolder, UnknownType
from gamms.ir.tables import add_latlon
from gamms.recorder import RecordingError

QUIET = {"level": "CRITICAL"}
GPX = "{http://www.topografix.com/GPX/1/1}"


def played(path, crs="EPSG:32635", **options):
    """Record three turns of a walker, who is named against XML, and of a drone."""
    with gamms.create_context(seed=1, logger_config=QUIET) as ctx:
        ctx.graph.add_nodes(range(3), [385_000, 385_100, 385_100], [6_672_000, 6_672_000, 6_672_100])
        ctx.graph.add_edges([0, 1], [0, 1], [1, 2])
        ctx.graph.graph.crs = crs
        walk = iter([1, 2, 2])
        ctx.agent.create_agent("a<b>&", team="réd", start_node_id=0, strategy=lambda s: s.update(action=next(walk)))
        drone = ctx.agent.create_agent("drone", agent_type="AERIAL", start_node_id=0, speed=10.0)
        drone.position = (385_000.0, 6_672_000.0, 50.0)
        ctx.record.start(path, created=1_750_000_000, **options)
        for _ in range(3):
            ctx.game.step()
        ctx.record.stop()
        return ctx.graph.columns().xy


@pytest.fixture
def game(tmp_path):
    xy = played(tmp_path / "game.ggr")
    with recorder.open(tmp_path / "game.ggr") as recording:
        yield recording, xy


def degrees(places):
    from gamms.ir import projection

    return projection.project(np.array(places, float), "EPSG:32635", projection.WGS84)[:, ::-1]


def test_geojson_holds_a_line_for_each_agent(game, tmp_path):
    recording, xy = game
    recording.export(tmp_path / "game.geojson")
    walker, drone = json.loads((tmp_path / "game.geojson").read_text(encoding="utf-8"))["features"]
    assert (walker["properties"]["agent"], walker["properties"]["team"]) == ("a<b>&", "réd")
    assert walker["properties"]["turns"] == [0, 1, 2, 3]
    assert np.abs(np.array(walker["geometry"]["coordinates"])[:, ::-1] - degrees(xy[[0, 1, 2, 2]])).max() < 1e-7
    assert [place[2] for place in drone["geometry"]["coordinates"]] == [50.0] * 4


def test_csv_holds_map_units_and_degrees(game, tmp_path):
    recording, xy = game
    recording.export(tmp_path / "game.csv")
    rows = list(csv.DictReader(io.StringIO((tmp_path / "game.csv").read_bytes().decode())))
    assert [(row["turn"], row["agent"], row["node"]) for row in rows[:3]] == [
        ("0", "a<b>&", "0"),
        ("1", "a<b>&", "1"),
        ("2", "a<b>&", "2"),
    ]
    assert [[float(row["x"]), float(row["y"])] for row in rows[:3]] == xy.tolist()
    assert float(rows[2]["lat"]) == pytest.approx(degrees(xy[2:])[0, 0], abs=1e-7)


def test_agents_along_an_edge_are_on_its_polyline(tmp_path):
    with gamms.create_context(seed=1, logger_config=QUIET) as ctx:
        ctx.graph.add_nodes([0, 1], [0, 60], [0, 80])
        bend = [(0, 0), (60, 0), (60, 80)]
        ctx.graph.graph.add_edge({"id": 0, "source": 0, "target": 1, "length": 140.0, "linestring": bend})
        ctx.game.speed_unit = "metres"
        ctx.agent.create_agent("a", start_node_id=0, strategy=lambda state: state.update(action=1)).speed = 35.0
        ctx.record.start(tmp_path / "game.ggr")
        for _ in range(4):
            ctx.game.step()
        ctx.record.stop()
    with recorder.open(tmp_path / "game.ggr") as recording:
        recording.export(tmp_path / "game.csv")
    rows = list(csv.DictReader(io.StringIO((tmp_path / "game.csv").read_text())))
    assert [(float(row["x"]), float(row["y"])) for row in rows] == [(0, 0), (35, 0), (60, 10), (60, 45), (60, 80)]
    assert "lat" not in rows[0]


def test_tracks_without_degrees_are_refused(tmp_path):
    played(tmp_path / "game.ggr", crs=None)
    with recorder.open(tmp_path / "game.ggr") as recording:
        with pytest.raises(BadValue, match="has no CRS"):
            recording.export(tmp_path / "game.gpx")
        recording.export(tmp_path / "game.csv")
        for path, error in [("game.gpz", UnknownType), ("game", UnknownType), ("no/game.gpx", MissingFolder)]:
            with pytest.raises(error):
                recording.export(tmp_path / path)
        for seconds, error in [(-1.0, BadValue), ("x", BadType), (1e12, BadValue), (float("nan"), BadValue)]:
            with pytest.raises(error):
                recording.export(tmp_path / "game.csv", turn_seconds=seconds)


def test_a_recording_without_its_map_has_no_tracks(tmp_path):
    played(tmp_path / "game.ggr", embed_graph=False)
    with recorder.open(tmp_path / "game.ggr") as recording, pytest.raises(RecordingError, match="map"):
        recording.export(tmp_path / "game.gpx")
    assert not (tmp_path / "game.gpx").exists()


@pytest.mark.parametrize("node", [0, 1])  # the first and the last of the map
def test_an_agent_whose_node_is_gone_is_nowhere(tmp_path, node):
    with gamms.create_context(seed=1, logger_config=QUIET) as ctx:
        ctx.graph.add_nodes(range(2), [385_000, 385_100], [6_672_000, 6_672_000])
        ctx.graph.graph.crs = "EPSG:32635"
        ctx.agent.create_agent("a", start_node_id=node)
        ctx.record.start(tmp_path / "game.ggr")
        ctx.game.step()
        ctx.graph.graph.remove_node(node)
        ctx.visual.simulate()
        ctx.record.stop()
    with recorder.open(tmp_path / "game.ggr") as recording:
        recording.export(tmp_path / "game.geojson")
    (line,) = json.loads((tmp_path / "game.geojson").read_text())["features"]
    assert line["properties"]["turns"] == [0, 1]


def test_the_command_line_writes_tracks(game, tmp_path):
    from typer.testing import CliRunner

    from gamms.cli.commands import app

    done = CliRunner().invoke(
        app, ["convert", str(tmp_path / "game.ggr"), str(tmp_path / "c.gpx"), "--turn-seconds", "5"]
    )
    assert done.exit_code == 0, done.output
    assert "2025-06-15T15:06:45Z" in (tmp_path / "c.gpx").read_text()
    again = CliRunner().invoke(app, ["convert", str(tmp_path / "game.ggr"), str(tmp_path / "c.gpx")])
    assert again.exit_code != 0
    CliRunner().invoke(app, ["convert", str(tmp_path / "game.ggr"), str(tmp_path / "d.gpx")])
    assert "2025-06-15T15:06:41Z" in (tmp_path / "d.gpx").read_text(), "by default a turn takes a second"


def test_the_command_line_converts_maps(tmp_path):
    from typer.testing import CliRunner

    from gamms.cli.commands import app

    with gamms.create_context(logger_config=QUIET) as ctx:
        ctx.graph.attach_networkx_graph(gamms.graph.grid(2, 2))
        ctx.graph.save(tmp_path / "grid.gamms")
    done = CliRunner().invoke(app, ["convert", str(tmp_path / "grid.gamms"), str(tmp_path / "grid.csv")])
    assert done.exit_code == 0, done.output
    assert len((tmp_path / "grid_nodes.csv").read_text().splitlines()) == 5
    assert "grid_edges.csv" in done.output.replace("\n", "")


def test_tables_have_degrees_of_nodes(game):
    recording, xy = game
    moves = recording.table("moves", lat_lon=True)
    assert list(moves) == ["turn", "agent", "node", "lat", "lon"]
    assert np.abs(np.column_stack((moves["lat"], moves["lon"])) - degrees(xy[moves["node"]])).max() < 1e-9
    elsewhere = add_latlon({"at": np.array([2, 2**40, None], object)}, recording.graph.columns())
    assert np.isnan(elsewhere["lat"]).tolist() == [False, True, True]
    assert list(recording.table("positions", lat_lon=True)) == ["turn", "agent", "x", "y", "z", "lat", "lon"]
    assert "lat" not in recording.table("moves")
    with pytest.raises(BadValue, match="it has no nodes, but turn, of, score"):
        recording.table("scores", lat_lon=True)
    with pytest.raises(BadType, match="lat_lon"):
        recording.table("moves", lat_lon="yes")


def test_results_have_degrees_of_nodes_that_are_on_the_map():
    with gamms.create_context(seed=1, logger_config=QUIET) as ctx:
        ctx.graph.add_nodes(range(2), [385_000, 385_100], [6_672_000, 6_672_000])
        ctx.graph.graph.crs = "EPSG:32635"
        for node in range(2):
            ctx.agent.create_agent(f"a{node}", start_node_id=node)
        for node in (1, 7, None, (1, 2)):
            ctx.game.emit("seen", node=node, x="none")
        ctx.game.emit("heard", x=385_050.0, y=6_672_000)
        result = ctx.game.result()
        heard = result.table("heard", lat_lon=ctx.graph)
        assert (heard["lat"][0], heard["lon"][0]) == pytest.approx(tuple(degrees([(385_050, 6_672_000)])[0]))
        found = result.table("agents", lat_lon=ctx.graph)
        wanted = degrees([(385_000, 6_672_000), (385_100, 6_672_000)])
        assert np.abs(np.column_stack((found["lat"], found["lon"])) - wanted).max() < 1e-9
        seen = result.table("seen", lat_lon=ctx.graph)["lat"]
        assert seen[0] == pytest.approx(wanted[1, 0])
        assert np.isnan(seen[1:]).all()
        with pytest.raises(BadValue, match="it has no nodes"):
            result.table("teams", lat_lon=ctx.graph)
        ctx.graph.graph.crs = None
        with pytest.raises(BadValue, match="the map has no CRS"):
            result.table("agents", lat_lon=ctx.graph)
