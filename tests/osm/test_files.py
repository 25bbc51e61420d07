"""`graph_from_file`: ways of moving, one-way rules, junction to junction, hostile PBF."""

import contextlib
import itertools
import math
import struct
import zlib

import networkx as nx
import pytest

from gamms.errors import BadFile, BadType, BadValue
from gamms.osm import OSMType, graph_from_file, graph_from_xml
from gamms.osm.network import CLOSED_TO
from gamms.osm.osmium_reader import find_file_format, measure_pbf

ROAD = {"highway": "residential"}
NO_CUT = 1e6


def names(graph):
    return {data.get("name") for *_, data in graph.edges(data=True)}


def street_of(make_map, cross, tags):
    """A residential street, and a second one with these tags beside it."""
    return make_map(cross, ([1, 2], {**ROAD, "name": "first"}), ([2, 3], {**tags, "name": "second"}))


def test_without_a_way_of_moving_all_roads_are_taken(make_map, cross):
    assert names(graph_from_file(street_of(make_map, cross, {"highway": "steps", "access": "private"}))) == {
        "first",
        "second",
    }


def test_every_way_of_moving_has_its_rules():
    assert set(CLOSED_TO) == {None, *OSMType}


@pytest.mark.parametrize(
    ("osm_type", "bidirectional", "edges"),
    [
        (None, None, 2),
        (OSMType.WALK, None, 2),
        (OSMType.BIKE, None, 1),
        (OSMType.DRIVE, None, 1),
        (None, False, 1),
        (OSMType.WALK, False, 1),
        (OSMType.BIKE, True, 2),
        (OSMType.DRIVE, True, 2),
    ],
)
def test_who_rides_or_drives_keeps_to_one_way_streets_by_default(make_map, cross, osm_type, bidirectional, edges):
    path = make_map(cross, ([1, 2], {**ROAD, "oneway": "yes"}))
    graph = graph_from_file(path, NO_CUT, bidirectional, osm_type=osm_type, strong=False)
    assert graph.number_of_edges() == edges


def test_bicycles_may_have_a_rule_of_their_own(make_map, cross):
    path = make_map(cross, ([1, 2], {**ROAD, "oneway": "yes", "oneway:bicycle": "no"}))
    assert graph_from_file(path, NO_CUT, osm_type=OSMType.BIKE).number_of_edges() == 2
    assert graph_from_file(path, NO_CUT, osm_type=OSMType.DRIVE, strong=False).number_of_edges() == 1


def test_the_largest_part_is_the_largest_of_the_roads_that_are_open(make_map, cross):
    cross |= {11: (60.18, 24.94), 12: (60.181, 24.94)}
    path = make_map(cross, ([11, 12], ROAD), ([1, 2, 3], {"highway": "footway"}))
    assert graph_from_file(path, NO_CUT, osm_type=OSMType.DRIVE).number_of_nodes() == 2
    assert names(graph_from_file(path, NO_CUT)) == {None}


def test_a_map_without_open_roads_is_refused(make_map, cross):
    with pytest.raises(BadFile, match="no roads for the mode 'drive'"):
        graph_from_file(make_map(cross, ([1, 2], {"highway": "steps"})), osm_type=OSMType.DRIVE)


def test_a_way_of_moving_may_be_given_by_its_name(make_map, cross):
    path = make_map(cross, ([1, 2], {**ROAD, "oneway": "yes", "oneway:bicycle": "no"}))
    assert graph_from_file(path, NO_CUT, osm_type="bike").number_of_edges() == 2
    assert graph_from_file(path, NO_CUT, osm_type="OSMType.DRIVE", strong=False).number_of_edges() == 1


@pytest.mark.parametrize("osm_type", ["driv", 2, True])
def test_a_way_of_moving_is_an_osm_type(make_map, cross, osm_type):
    with pytest.raises(BadType, match=r"OSMType\.WALK, BIKE or DRIVE"):
        graph_from_file(make_map(cross, ([1, 2], ROAD)), osm_type=osm_type)


def test_without_simplifying_it_is_the_graph_of_graph_from_xml(make_map, curve):
    path = make_map(curve, ([*curve], ROAD))
    ours, xml = graph_from_file(path, 4.0, tolerance=1e-9, simplify=False), graph_from_xml(path, 4.0)
    for name in ("x", "y"):
        assert dict(ours.nodes(data=name)) == dict(xml.nodes(data=name))
    assert list(ours.edges(data=True)) == list(xml.edges(data=True))


def test_the_graph_says_how_it_was_made(make_map, cross):
    graph = graph_from_file(make_map(cross, ([1, 2, 3], ROAD)), 20.0, osm_type=OSMType.BIKE).graph
    assert (graph["resolution"], graph["tolerance"], graph["osm_type"]) == (20.0, 2.0, "BIKE")
    assert (graph["bidirectional"], graph["retain_all"], graph["simplify"]) == (None, False, True)
    assert (graph["mode"], graph["strong"]) == ("bike", True)


def test_the_default_tolerance_merges_nodes_less_than_a_metre_apart(make_map, cross):
    cross |= {5: (60.17, 24.941015), 6: (60.1695, 24.941015)}  # 5 is 0.8 m from node 2
    path = make_map(cross, ([1, 2, 5, 3], ROAD), ([2, 4], ROAD), ([5, 6], ROAD))
    assert graph_from_file(path, NO_CUT).number_of_nodes() == 5
    assert graph_from_file(path, NO_CUT, tolerance=0.0).number_of_nodes() == 6


def test_a_ring_road_without_a_junction_is_kept(make_map, cross):
    graph = graph_from_file(make_map(cross, ([1, 2, 4, 1], ROAD)), NO_CUT)
    assert (graph.number_of_nodes(), graph.number_of_edges()) == (3, 6)
    assert nx.is_strongly_connected(graph)


def test_a_map_that_is_one_junction_is_one_node(make_map):
    nodes = {i: (60.0 + 1e-6 * (i // 2), 24.0 + 1e-6 * (i % 2)) for i in range(1, 5)}
    ways = [([a, b], ROAD) for a, b in itertools.combinations(nodes, 2)]
    graph = graph_from_file(make_map(nodes, *ways), tolerance=5.0)
    assert (graph.number_of_nodes(), graph.number_of_edges()) == (1, 0)


def test_a_map_of_one_point_is_refused(make_map, cross):
    with pytest.raises(BadFile, match="nodes"):
        graph_from_file(make_map(cross, ([1], ROAD)))
    with pytest.raises(BadFile, match="nodes"):
        graph_from_file(make_map(cross, ([1, 1], ROAD)))


@pytest.mark.parametrize("lat", ["nan", "inf", "1e30", "x", "84.5", "95", "1000"])
def test_a_latitude_off_the_map_is_refused(make_map, cross, lat):
    path = make_map(cross, ([1, 2], ROAD))
    text = path.read_text().replace('lat="60.1700000"', f'lat="{lat}"')
    path.write_text(text)
    with pytest.raises((BadFile, BadValue)):
        graph_from_file(path)


@pytest.mark.parametrize("resolution", [0.0, -1.0, math.nan])
def test_bad_numbers_are_refused_before_the_file_is_looked_for(resolution):
    with pytest.raises(BadValue, match="resolution"):
        graph_from_file("nowhere.osm", resolution)
    with pytest.raises(BadValue, match="tolerance"):
        graph_from_file("nowhere.osm", tolerance=math.inf)


def varint(value):
    out = bytearray()
    while value > 127:
        out.append(value & 127 | 128)
        value >>= 7
    return bytes([*out, value])


def data(field, content):
    return varint(field << 3 | 2) + varint(len(content)) + content


def block(kind, content, claimed=None):
    raw_size = len(content) if claimed is None else claimed
    blob = varint(2 << 3) + varint(raw_size) + data(3, zlib.compress(content))
    header = data(1, kind) + varint(3 << 3) + varint(len(blob))
    return struct.pack(">I", len(header)) + header + blob


HEADER = block(b"OSMHeader", data(4, b"OsmSchema-V0.6") + data(4, b"DenseNodes"))


def test_a_pbf_that_unpacks_absurdly_is_refused_without_unpacking_it(tmp_path):
    path = tmp_path / "bomb.osm.pbf"
    path.write_bytes(HEADER + 40 * block(b"OSMData", bytes(30 << 20)))
    assert path.stat().st_size < 2_000_000
    assert measure_pbf(path) > 40 * (30 << 20)
    with pytest.raises(BadFile, match="unpacks to more than"):
        graph_from_file(path)


@pytest.mark.parametrize("claimed", [2**31 - 1, 2**63, 1, 0])
def test_a_pbf_that_lies_about_its_size_is_refused(tmp_path, claimed):
    path = tmp_path / "liar.osm.pbf"
    path.write_bytes(HEADER + block(b"OSMData", bytes(1 << 20), claimed))
    with pytest.raises(BadFile):
        graph_from_file(path)


@pytest.fixture
def pbf(make_map, cross, tmp_path):
    from osmium import FileProcessor, SimpleWriter

    path = tmp_path / "map.osm.pbf"
    with SimpleWriter(str(path)) as writer:
        for item in FileProcessor(str(make_map(cross, ([1, 2, 3], ROAD)))):
            writer.add(item)
    return path


def test_a_pbf_that_was_cut_off_is_refused_wherever_it_ends(pbf):
    whole = pbf.read_bytes()
    for end in range(0, len(whole), 5):
        pbf.write_bytes(whole[:end])
        with pytest.raises(BadFile):
            graph_from_file(pbf)


def test_a_pbf_with_a_damaged_byte_gives_an_error_of_ours_or_a_graph(pbf):
    whole = pbf.read_bytes()
    for place in range(0, len(whole), 3):
        pbf.write_bytes(whole[:place] + bytes([whole[place] ^ 0xFF]) + whole[place + 1 :])
        with contextlib.suppress(BadFile, BadValue):
            assert graph_from_file(pbf).number_of_nodes() > 0


def test_the_frame_of_a_real_pbf_adds_up(pbf):
    assert find_file_format(pbf) == "pbf"
    assert 100 < measure_pbf(pbf) < 2000
