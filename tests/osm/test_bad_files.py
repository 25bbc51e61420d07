"""Bad input, to roads and walls: what is wrong, where, and the way out; no hang, no traceback from a library."""

import bz2
import gzip
import math
import os

import networkx as nx
import pytest

from gamms.errors import BadFile, BadType, BadValue, MissingExtra, TooLarge
from gamms.ir import projection
from gamms.osm import graph_from_file, graph_from_xml, obstacle_from_file, reader

ROAD = {"highway": "residential"}
ROAD_AND_HOUSE = ([1, 2, 3], ROAD), ([1, 2, 4, 1], {"building": "house"})
READERS = pytest.mark.parametrize("read", [graph_from_xml, obstacle_from_file])

_LOLS = "".join(f'<!ENTITY l{i} "{f"&l{i - 1};" * 10}">' for i in range(1, 10))
NO_MAPS = {
    "empty": b"",
    "text": b"hello world\n",
    "html": b"<!DOCTYPE html><html><body>404</body></html>",
    "json": b'{"elements": []}',
    "zip": b"PK\x03\x04" + bytes(100),
    "noise": bytes(range(256)),
    "half a pbf": b"\0\0\0\x0e\x0a\x09OSMHeader\x18\xff",
    "no version": b"<?xml version='1.0'?><osm></osm>",
    "entity bomb": (
        f'<?xml version="1.0"?><!DOCTYPE o [<!ENTITY l0 "lol">{_LOLS}]><osm version="0.6"><note>&l9;</note></osm>'
    ).encode(),
    "file entity": (
        b'<?xml version="1.0"?><!DOCTYPE o [<!ENTITY f SYSTEM "file:///etc/passwd">]>'
        b'<osm version="0.6"><note>&f;</note></osm>'
    ),
    "damaged gzip": gzip.compress(b"<osm version='0.6'>" + bytes(1000))[:-30],
    "gzip of noise": gzip.compress(b"hello world"),
    "damaged bzip2": bz2.compress(b"<osm version='0.6'>" + os.urandom(1000))[:-30],
}
NO_STREETS = {
    "bad id": b'<osm version="0.6"><way id="1"><nd ref="x"/><tag k="highway" v="path"/></way></osm>',
    "no roads": b'<osm version="0.6"><node id="1" lat="1" lon="1"/></osm>',
    "nothing": b'<osm version="0.6"></osm>',
    "no nodes": (b'<osm version="0.6"><way id="1"><nd ref="1"/><nd ref="2"/><tag k="highway" v="path"/></way></osm>'),
    "far away": (
        b'<osm version="0.6"><node id="1" lat="1" lon="181"/><node id="2" lat="1" lon="182"/>'
        b'<way id="1"><nd ref="1"/><nd ref="2"/><tag k="highway" v="path"/></way></osm>'
    ),
}


@pytest.mark.parametrize(
    ("read", "content"),
    [
        *((graph_from_xml, content) for content in (NO_MAPS | NO_STREETS).values()),
        *((obstacle_from_file, content) for content in NO_MAPS.values()),
    ],
    ids=[*NO_MAPS, *NO_STREETS, *(f"{name} of walls" for name in NO_MAPS)],
)
@pytest.mark.parametrize("name", ["map.osm", "map"])
def test_an_invalid_map_is_refused_at_the_call_by_its_name_with_the_way_out(tmp_path, read, content, name):
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(BadFile) as caught:
        read(path)
    assert str(path) in str(caught.value)
    assert any(word in str(caught.value) for word in ("Give", "Export", "Download"))


@READERS
def test_a_map_that_was_cut_off_is_refused_wherever_it_ends(make_map, cross, read):
    path = make_map(cross, *ROAD_AND_HOUSE)
    whole = path.read_bytes().strip()
    for end in range(0, len(whole), 7):
        path.write_bytes(whole[:end])
        with pytest.raises(BadFile):
            read(path)


@pytest.mark.parametrize("pack", [gzip, bz2], ids=["gzip", "bzip2"])
def test_a_file_that_unpacks_absurdly_is_refused(tmp_path, pack):
    path = tmp_path / "bomb.osm.gz"
    part = pack.compress(bytes([32]) * (1 << 19) + b"<a/>")
    path.write_bytes(pack.compress(b'<osm version="0.6">') + 140 * part + pack.compress(b"</osm>"))
    with pytest.raises(BadFile, match="unpacks to more than"):
        graph_from_xml(path)


def what_is_in(found):
    return dict(found.nodes(data=True)) if isinstance(found, nx.Graph) else list(found)


@pytest.mark.parametrize("pack", [gzip.compress, bz2.compress], ids=["gzip", "bzip2"])
@READERS
def test_packed_maps_are_read_whatever_their_name(make_map, cross, read, pack):
    path = make_map(cross, *ROAD_AND_HOUSE)
    expected = what_is_in(read(path))
    assert len(expected) > 1
    path.write_bytes(pack(path.read_bytes()))
    assert what_is_in(read(path)) == expected


def test_deleted_and_repeated_ways_are_passed_over(make_map, cross):
    path = make_map(cross, ([1, 2], ROAD), ([2, 3], ROAD))
    text = path.read_text().replace('<way id="101"', '<way id="101" visible="false"')
    first = text[text.index('<way id="100"') : text.index('<way id="101"')]
    path.write_text(text.replace("</osm>", first + "</osm>"))
    assert graph_from_xml(path, 1e6).number_of_nodes() == 2


def test_an_absurd_node_id_is_a_missing_node(make_map, cross):
    path = make_map(cross, ([1, 2, 9_000_000_000_000_000_000], ROAD))
    assert graph_from_xml(path, 1e6).number_of_nodes() == 2


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no named pipes here")
def test_a_pipe_does_not_hang(tmp_path):
    os.mkfifo(tmp_path / "pipe.osm")
    with pytest.raises(BadFile, match="regular"):
        graph_from_xml(tmp_path / "pipe.osm")


@pytest.mark.parametrize(
    ("options", "error", "words"),
    [
        *(({"resolution": value}, BadValue, "resolution") for value in (0, -1, -0.0, math.nan, math.inf)),
        *(({"resolution": value}, BadType, "resolution") for value in ("x", None, True, [10])),
        *(({"resolution": value}, BadValue, "would take about") for value in (1e-7, 5e-324)),
        *(({"tolerance": value}, BadValue, "tolerance") for value in (-1.0, math.nan, math.inf)),
    ],
)
def test_impossible_options_are_refused(make_map, cross, options, error, words):
    with pytest.raises(error, match=words):
        graph_from_xml(make_map(cross, ([1, 2], ROAD)), **options)


def test_a_map_near_the_pole_is_refused(make_map):
    with pytest.raises(BadValue, match="84"):
        graph_from_xml(make_map({1: (85.0, 0.0), 2: (85.0, 0.1)}, ([1, 2], ROAD)))


def test_a_map_of_half_the_world_is_refused(make_map):
    nodes = {i: (0.0, lon) for i, lon in enumerate((0.0, 60.0, 120.0, 179.0, -120.0, -60.0), 1)}
    with pytest.raises(BadValue, match="too wide for one projection"):
        graph_from_xml(make_map(nodes, ([*nodes], ROAD)), resolution=1e5)


@READERS
def test_without_the_extra_the_error_prints_the_pip_command(make_map, cross, monkeypatch, read):
    path = make_map(cross, *ROAD_AND_HOUSE)
    monkeypatch.setitem(__import__("sys").modules, "osmium", None)
    with pytest.raises(MissingExtra, match=r"\(extra 'osm'\): pip install "):
        read(path)
    monkeypatch.setitem(__import__("sys").modules, "pyproj", None)
    with pytest.raises(MissingExtra, match=r"\(extra 'osm'\): pip install "):
        projection.parse_crs("EPSG:31256")
    assert projection.parse_crs("EPSG:4326") == ("EPSG:4326", True)
    assert projection.parse_crs("EPSG:32635") == ("EPSG:32635", False)


@pytest.mark.parametrize("read", [graph_from_xml, graph_from_file, obstacle_from_file])
def test_a_map_with_too_many_points_is_refused(make_map, cross, monkeypatch, read):
    monkeypatch.setattr(reader, "_BYTES_PER_POINT", 1 << 26)
    with pytest.raises(TooLarge, match="honest files of its size"):
        read(make_map(cross, *ROAD_AND_HOUSE))


def test_a_road_that_is_all_repetition_is_refused_at_once(tmp_path):
    path = tmp_path / "road.osm.gz"
    places = b"".join(b'<node id="%d" lat="60.1%d" lon="24.9"/>' % (n, n) for n in (1, 2))
    road = b'<way id="1">' + 250_000 * b'<nd ref="1"/><nd ref="2"/>' + b'<tag k="highway" v="x"/></way>'
    path.write_bytes(gzip.compress(b'<osm version="0.6">' + places + road + b"</osm>"))
    assert path.stat().st_size < 20_000
    with pytest.raises(TooLarge, match="honest files of its size"):
        graph_from_xml(path)


@pytest.mark.parametrize("pack", [gzip, bz2], ids=["gzip", "bzip2"])
def test_a_tag_that_never_ends_is_not_kept(tmp_path, pack):
    path = tmp_path / "tag.osm.packed"
    path.write_bytes(pack.compress(b'<osm version="0.6"><node id="1" user="' + bytes([97]) * (5 << 20) + b'"/></osm>'))
    with pytest.raises(BadFile, match="a tag of more than"):
        graph_from_xml(path)


def test_no_junction_is_a_mile_wide(tmp_path):
    path = tmp_path / "any.osm"
    path.write_text("<osm/>")
    with pytest.raises(ValueError, match="no junction is that wide"):
        graph_from_xml(path, tolerance=1609.0)
