"""What `gamms.osm` offers: names, tables, the shipped map, a line on the terminal."""

import io
import subprocess
import sys
from importlib.resources import files
from types import SimpleNamespace

import networkx as nx
import pytest

import gamms.osm
from gamms.errors import BadValue
from gamms.graph.map_file import load
from gamms.osm import constants
from gamms.progress import show_progress


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.fixture(scope="module")
def helsinki():
    return load(str(files("gamms") / "data" / "helsinki.gamms"))


def test_ways_of_moving_have_their_numbers():
    assert [(kind.name, kind.value) for kind in gamms.osm.OSMType] == [("WALK", 0), ("BIKE", 1), ("DRIVE", 2)]


def test_an_unknown_name_is_no_attribute():
    with pytest.raises(AttributeError, match="nonsense"):
        _ = gamms.osm.nonsense


def test_importing_the_package_loads_no_library():
    code = (
        "import gamms.osm, sys; "
        "assert not {'osmium', 'pyproj', 'networkx', 'shapely'} & set(sys.modules), sorted(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_the_tables_of_obstacles():
    assert constants.HEIGHT_ESTIMATES_TYPES["building", "church"] == (25.0, 10)
    assert len(constants.HEIGHT_ESTIMATES_TYPES) == 38
    assert constants.OSM_OBSTACLE_TAGS["building"] is True
    assert constants.COLOR_TYPES[31] == "#ccebc5"


def test_the_shipped_map_is_small_and_names_its_makers(helsinki):
    folder = files("gamms") / "data"
    assert len((folder / "helsinki.gamms").read_bytes()) < 1_000_000
    assert "ODbL" in (folder / "ATTRIBUTION.md").read_text(encoding="utf-8")
    assert "OpenStreetMap" in helsinki.attribution


@pytest.mark.parametrize("bidirectional", [True, False])
def test_the_shipped_map_is_cut_without_any_optional_library(helsinki, monkeypatch, bidirectional):
    monkeypatch.setitem(sys.modules, "osmium", None)
    monkeypatch.setitem(sys.modules, "pyproj", None)
    graph = gamms.osm.resample_columns(helsinki.columns, bidirectional=bidirectional)
    assert nx.is_weakly_connected(graph)
    assert graph.graph["crs"] == "EPSG:32635"
    roads = sum(way["length"] for u, v, way in graph.edges(data=True) if u < v or (v, u) not in graph.edges)
    assert roads == pytest.approx(helsinki.columns.lengths.sum(), rel=1e-9)
    assert {"osmid", "highway", "oneway"} <= set(next(iter(graph.edges(data=True)))[2])


def test_lengths_of_the_shipped_map_fit_its_polylines(helsinki):
    graph = gamms.osm.resample_columns(helsinki.columns, resolution=50.0)
    for _, _, data in graph.edges(data=True):
        assert data["length"] == pytest.approx(data["linestring"].length, rel=0.01, abs=0.02)


def test_progress_shows_on_a_terminal_after_a_while(monkeypatch):
    monkeypatch.setattr(sys, "stderr", terminal := Terminal())
    now = [7.0]
    monkeypatch.setattr("gamms.progress.time", SimpleNamespace(monotonic=lambda: now[0]))
    with show_progress(0.02) as show:
        show("soon")
        now[0] += 0.05
        show("late")
    assert "soon" not in terminal.getvalue()
    assert "late" in terminal.getvalue()
    assert terminal.getvalue().endswith("\r\x1b[K")


@pytest.mark.parametrize("bad", [0, -1.0, float("nan")])
def test_a_bad_resolution_leaves_the_context_as_it_was(bad):
    with gamms.create_context(logger_config={"level": "CRITICAL"}) as ctx:
        with pytest.raises(ValueError, match="resolution"):
            gamms.osm.helsinki(ctx, resolution=bad)
        assert list(ctx.graph.graph.get_nodes()) == []
        ctx.graph.add_obstacle_face(1, (0, 0, 1), (1, 0, 1), (0, 0, 0), (1, 0, 0), 0)
        with pytest.raises(ValueError, match="obstacles"):
            gamms.osm.helsinki(ctx)
        assert list(ctx.graph.get_obstacle_faces()) == [1]


@pytest.mark.parametrize("box", [(25.0, 60.1, 24.9, 60.2), (24.9, 60.2, 25.0, 60.1), (24.9, 60.1, 25.0, 91.0)])
def test_a_box_that_is_not_an_area_is_refused(box):
    with pytest.raises(BadValue, match=r"^left=.* is not an area: (it takes|longitudes are)"):
        gamms.osm.graph_from_bbox(*box)


def helsinki_for(**options):
    with gamms.create_context(logger_config={"level": "CRITICAL"}) as ctx:
        graph = gamms.osm.helsinki(ctx, **options)
        assert len(ctx.graph.graph) == len(graph)
        return graph


def test_the_shipped_map_has_walkers_bicycles_and_cars():
    everyone = helsinki_for(osm_type=["walk", "bike", "drive"], resolution=100.0)
    for mode in ("walk", "bike", "drive"):
        alone = helsinki_for(osm_type=mode, resolution=100.0)
        part = nx.DiGraph((u, v, data) for u, v, data in everyone.edges(data=True) if data[mode] > 0.0)
        assert nx.is_strongly_connected(part)
        assert part.size("length") == pytest.approx(alone.size("length"), rel=1e-9)
        assert not any(mode in data for _, _, data in alone.edges(data=True))
    speeds = {name: {data[name] for *_, data in everyone.edges(data=True)} for name in ("walk", "bike", "drive")}
    assert speeds["walk"] == {0.0, 2.0, 4.0, 5.0}
    assert {0.0, 15.0} <= speeds["bike"]
    assert {0.0, 30.0, 40.0} <= speeds["drive"]


def test_cars_of_the_shipped_map_obey_signs_unless_they_need_not():
    signs = helsinki_for(osm_type=["walk", "drive"], resolution=100.0)
    free = helsinki_for(osm_type=["walk", "drive"], resolution=100.0, bidirectional=True)
    one_way = [(u, v) for u, v, data in signs.edges(data=True) if data["drive"] and not signs.edges[v, u]["drive"]]
    assert len(one_way) > 50
    assert all((free.edges[v, u]["drive"] > 0.0) == (data["drive"] > 0.0) for u, v, data in free.edges(data=True))


@pytest.mark.parametrize(
    ("given", "text"),
    [
        ({"osm_type": "robot"}, "has the modes walk, bike, drive, not 'robot'"),
        ({"osm_type": ["walk", "drive_service"]}, "not 'drive_service'"),
        ({"osm_type": ["walk", "drive"], "bidirectional": False}, "no walkers who obey"),
    ],
)
def test_other_modes_of_the_shipped_map_are_refused(given, text):
    with pytest.raises(BadValue, match=text):
        helsinki_for(**given)
