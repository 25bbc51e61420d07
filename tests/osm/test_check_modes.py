"""A small town passes the independent judge of `scripts/check_modes.py`, and graphs with faults do not."""

import sys
from pathlib import Path

import networkx as nx
import pytest

import gamms.osm

pytest.importorskip("scipy")
sys.path.insert(0, str(Path(__file__).parents[2] / "scripts"))

import check_modes

STREET, SQUARE, FOOTWAY = {"highway": "residential"}, {"highway": "pedestrian", "area": "yes"}, {"highway": "footway"}
ROADS = [
    ([1, 2, 3], {**STREET, "oneway": "yes"}),
    ([3, 6], {**STREET, "oneway": "yes", "cycleway": "opposite"}),
    ([6, 5, 4], {**STREET, "oneway": "-1", "oneway:bicycle": "no"}),
    ([4, 1], {**STREET, "access": "private", "bicycle": "yes", "foot": "permissive"}),
    ([4, 7], STREET),
    ([7, 8, 9], {**STREET, "bridge": "yes", "layer": "1"}),
    ([9, 6], STREET),
    ([2, 5], {"highway": "cycleway", "foot": "no"}),
    ([7, 1], {"highway": "service", "motor_vehicle": "no"}),
    ([10, 11, 12, 13, 10], SQUARE),
    ([1, 10], FOOTWAY),
    ([2, 11], FOOTWAY),
    ([5, 12], FOOTWAY),
    ([4, 13], FOOTWAY),
    ([3, 9], {"highway": "steps", "conveying": "forward"}),
    ([14, 15, 16, 17, 14], {"building": "yes"}),
    ([5, 18], STREET),
    ([18, 8], STREET),
    ([18, 9], FOOTWAY),
]
PLACES = [
    *((0, 0), (80, 0), (160, 0), (0, 80), (80, 80), (160, 80), (0, 160), (80, 160), (160, 160)),
    *((20, 20), (60, 20), (60, 60), (20, 60), (34, 34), (46, 34), (46, 40), (34, 40), (84, 86)),
]


@pytest.fixture
def town(make_map):
    """Streets in both directions and one, a bollard, a bridge, stairs, and a square with a kiosk."""
    nodes = {number: (60.17 + y / 111_413.0, 24.94 + x / 55_521.0) for number, (x, y) in enumerate(PLACES, 1)}
    path = make_map(nodes, *ROADS)
    text = path.read_text().replace('lon="24.9400000"/>', 'lon="24.9400000"><tag k="barrier" v="bollard"/></node>', 1)
    path.write_text(text)
    return path


@pytest.mark.parametrize("mode", ["walk", "bike", "drive"])
def test_the_judge_finds_no_fault_with_a_town(town, mode, capsys):
    assert check_modes.judge(town, mode, routes=20, tolerance=5.0)
    said = capsys.readouterr().out
    assert "0.000 km only by our rules" in said
    assert "0.000 km only in the graph" in said
    assert "FAIL" not in said


def test_the_judge_finds_walls_on_the_map(town):
    assert check_modes.check_walls(town)


def test_the_judge_finds_wrong_lengths_directions_and_traps(town):
    city = check_modes.read_map(town)
    drive = gamms.osm.graph_from_file(town, osm_type="drive", **check_modes.WHOLE)
    every = gamms.osm.graph_from_file(town, osm_type="drive", retain_all=True, **check_modes.WHOLE)
    assert check_modes.check_parts(city, "drive", every, drive)[0]
    assert check_modes.check_own_routes(city, "drive", drive, 20)[0]
    assert not check_modes.check_parts(city, "drive", every, every)[0]
    assert not check_modes.check_own_routes(city, "drive", drive.reverse(), 20)[0]
    nx.set_edge_attributes(every, 50.0, "length")
    assert not check_modes.check_lengths(city, every)[0]
