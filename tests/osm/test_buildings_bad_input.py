"""Bad input to the loaders of buildings: the same errors as for roads, and none for a map without buildings."""

import gzip
import math
import tracemalloc
from collections import Counter

import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from gamms.errors import BadType, BadValue, TooLarge
from gamms.osm import faces_of_features, obstacle_from_file, obstacle_from_osm

HOUSE = {"building": "house"}
BLOCK = [1, 2, 3, 1]
NODES = {1: (60.17, 24.940), 2: (60.17, 24.942), 3: (60.171, 24.941)}


def test_a_file_without_buildings_gives_no_walls(make_map):
    assert list(obstacle_from_file(make_map(NODES, ([1, 2], {"highway": "path"})))) == []
    assert list(obstacle_from_file(make_map({}))) == []


def test_a_pbf_gives_the_same_walls(make_map, tmp_path):
    from osmium import FileProcessor, SimpleWriter

    path = make_map(NODES, (BLOCK, HOUSE))
    expected = list(obstacle_from_file(path))
    with SimpleWriter(str(tmp_path / "map.osm.pbf")) as writer:
        for item in FileProcessor(str(path)):
            writer.add(item)
    assert list(obstacle_from_file(tmp_path / "map.osm.pbf")) == expected


def test_places_outside_the_world_are_missing(make_map):
    assert list(obstacle_from_file(make_map({**NODES, 3: (60.0, 181.0)}, (BLOCK, HOUSE)))) == []


def test_a_building_near_the_pole_or_far_from_the_zone_is_refused(make_map):
    with pytest.raises(BadValue, match="84"):
        list(obstacle_from_file(make_map({1: (85.0, 0.0), 2: (85.0, 0.1), 3: (85.1, 0.1)}, (BLOCK, HOUSE))))
    with pytest.raises(BadValue, match="outside the area of the projection"):
        list(obstacle_from_file(make_map(NODES, (BLOCK, HOUSE)), crs="EPSG:32705"))


@pytest.mark.parametrize("name", ["min_tolerance", "relative_tolerance"])
def test_an_impossible_tolerance_is_refused(make_map, name):
    path = make_map(NODES, (BLOCK, HOUSE))
    for value in (-1.0, math.nan, math.inf):
        with pytest.raises(BadValue, match="tolerance"):
            obstacle_from_file(path, **{name: value})
    with pytest.raises(BadType, match=name):
        obstacle_from_file(path, **{name: "1"})


@pytest.mark.parametrize(
    ("table", "error", "words"),
    [
        ([("building", "yes")], BadType, "must be a dict"),
        ({"building": (3.0, 1)}, BadType, "two strings"),
        ({("building", "yes"): 3.0}, BadType, "height in meters, type"),
        ({("building", "yes"): ("3", 1)}, BadType, "must be a number"),
        ({("building", "yes"): (-3.0, 1)}, BadValue, "more than 0"),
        ({("building", "yes"): (math.nan, 1)}, BadValue, "finite"),
        ({("building", "yes"): (3.0, 1.5)}, BadType, "must be an integer"),
    ],
)
def test_a_bad_table_of_heights_is_refused(make_map, table, error, words):
    with pytest.raises(error, match=words):
        obstacle_from_file(make_map(NODES, (BLOCK, HOUSE)), height_estimates=table)


def test_a_bad_filter_is_refused_before_any_server_is_asked(make_map):
    for tags in (["building"], "building", {"building": 3}):
        with pytest.raises(BadType, match="tags"):
            obstacle_from_file(make_map(NODES, (BLOCK, HOUSE)), tags=tags)
        with pytest.raises(BadType, match="tags"):
            obstacle_from_osm("Nowhere", tags=tags)


def test_a_way_that_many_relations_share_is_not_copied_into_a_bomb(tmp_path):
    path = tmp_path / "shared.osm.gz"
    nodes = "".join(f'<node id="{n}" lat="{60 + n * 1e-5}" lon="{25 + n % 7 * 1e-5}"/>' for n in range(1, 1000))
    way = '<way id="1">' + "".join(f'<nd ref="{n}"/>' for n in range(1, 1000)) + "</way>"
    house = '<member type="way" ref="1" role="outer"/><tag k="type" v="multipolygon"/><tag k="building" v="yes"/>'
    relations = "".join(f'<relation id="{n}">{house}</relation>' for n in range(3000))
    path.write_bytes(gzip.compress(f'<osm version="0.6">{nodes}{way}{relations}</osm>'.encode()))
    with pytest.raises(TooLarge, match="honest files of its size"):
        obstacle_from_file(path)


def test_walls_take_no_memory_before_they_are_asked_for():
    """A dict of a wall takes a kilobyte; 20,000 of them at once would take 20 MB."""
    ring = shapely.Point(24.94, 60.17).buffer(0.001, quad_segs=5_000)
    faces = faces_of_features([(ring, HOUSE)], min_tolerance=0.0, relative_tolerance=0.0)
    tracemalloc.start()
    count = sum(1 for _ in faces)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert count == 20_000
    assert peak < 8_000_000


refs = st.lists(st.integers(1, 12), min_size=1, max_size=9)


@given(
    places=st.lists(st.tuples(st.integers(0, 4), st.integers(0, 4)), min_size=11, max_size=11),  # node 12 is missing
    ways=st.lists(st.tuples(refs, st.booleans(), st.booleans()), min_size=1, max_size=8),
    relations=st.lists(st.lists(st.tuples(st.integers(100, 108), st.sampled_from(["outer", "inner"]))), max_size=3),
    tolerance=st.sampled_from([0.0, 0.5, 20.0]),
)
@settings(max_examples=16)
def test_whatever_the_lines_enclose_the_walls_close(tmp_path_factory, places, ways, relations, tolerance):
    path = tmp_path_factory.mktemp("maps") / "map.osm"
    lines = [
        f'<node id="{i}" lat="{60 + y * 1e-4:.7f}" lon="{24 + x * 1e-4:.7f}"/>' for i, (x, y) in enumerate(places, 1)
    ]
    house = "<tag k='building' v='yes'/>"
    for id, (nodes, is_closed, is_house) in enumerate(ways, 100):
        inside = "".join(f'<nd ref="{ref}"/>' for ref in (*nodes, *nodes[:is_closed]))
        lines.append(f'<way id="{id}">{inside}{house * is_house}</way>')
    for id, members in enumerate(relations, 900):
        inside = "".join(f'<member type="way" ref="{ref}" role="{role}"/>' for ref, role in members)
        tags = "<tag k='type' v='multipolygon'/><tag k='building' v='yes'/>"
        lines.append(f'<relation id="{id}">{inside}{tags}</relation>')
    path.write_text("\n".join(["<osm version='0.6'>", *lines, "</osm>"]))
    ends = Counter()
    for face in obstacle_from_file(path, min_tolerance=tolerance, relative_tolerance=0.0):
        assert all(math.isfinite(number) for corner in ("tr", "tl", "br", "bl") for number in face[corner])
        assert face["br"] != face["bl"]
        ends[face["br"]] += 1
        ends[face["bl"]] -= 1
    assert not any(ends.values())
