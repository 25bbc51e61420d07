"""Buildings as obstacles: which things are walls, where the walls stand and how high they are."""

import math
from itertools import pairwise
from types import SimpleNamespace
from xml.sax.saxutils import quoteattr

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

import gamms.osm.walls as walls_module
from gamms.errors import BadType, BadValue, TooLarge
from gamms.ir.projection import WGS84, project
from gamms.osm import (
    HEIGHT_ESTIMATES_TYPES,
    extract_osm_polygon_faces,
    faces_of_features,
    obstacle_from_file,
    wall_estimates,
)

# A block of about 111 m by 111 m at 60 degrees north, in it a court, in it a kiosk; beside it a road.
LAT, LON = 60.17, 24.94
CRS = "EPSG:32635"
NODES = {
    **{i: (LAT + y * 1e-5, LON + 2 * x * 1e-5) for i, (x, y) in enumerate([(0, 0), (100, 0), (100, 100), (0, 100)], 1)},
    **{
        i: (LAT + y * 1e-5, LON + 2 * x * 1e-5) for i, (x, y) in enumerate([(20, 20), (80, 20), (80, 80), (20, 80)], 11)
    },
    **{
        i: (LAT + y * 1e-5, LON + 2 * x * 1e-5) for i, (x, y) in enumerate([(45, 45), (55, 45), (55, 55), (45, 55)], 21)
    },
}
BLOCK, COURT, KIOSK = [1, 2, 3, 4, 1], [11, 12, 13, 14, 11], [21, 22, 23, 24, 21]
BUILDING = {"building": "yes"}


def tags_of(tags):
    return "".join(f"<tag k={quoteattr(k)} v={quoteattr(v)}/>" for k, v in tags.items())


def text_of(ways=(), relations=(), nodes=NODES):
    """`ways`: (refs, tags), ids from 100; `relations`: (members as (way id, role), tags)."""
    lines = [f'<node id="{id}" lat="{lat:.7f}" lon="{lon:.7f}"/>' for id, (lat, lon) in nodes.items()]
    for id, (refs, tags) in enumerate(ways, 100):
        lines.append(
            f'<way id="{id}">{"".join(f"<nd ref={chr(34)}{ref}{chr(34)}/>" for ref in refs)}{tags_of(tags)}</way>'
        )
    for id, (members, tags) in enumerate(relations, 900):
        inside = "".join(f'<member type="way" ref="{ref}" role="{role}"/>' for ref, role in members)
        lines.append(f'<relation id="{id}">{inside}{tags_of({"type": "multipolygon", **tags})}</relation>')
    return "\n".join(['<?xml version="1.0"?><osm version="0.6">', *lines, "</osm>\n"])


@pytest.fixture
def walls(tmp_path):
    """The walls of a map as a list of dicts."""

    def walls(ways=(), relations=(), nodes=NODES, **options):
        path = tmp_path / "map.osm"
        path.write_text(text_of(ways, relations, nodes), encoding="utf-8")
        return list(obstacle_from_file(path, **options))

    return walls


def xy_of(*node_ids, nodes=NODES):
    return project(np.array([nodes[id][::-1] for id in node_ids]), WGS84, CRS)


def edges_of(faces):
    """Pairs of corners on the ground, in centimetres, whatever their direction."""
    return {frozenset((round(x, 2), round(y, 2)) for x, y, _ in (face["br"], face["bl"])) for face in faces}


def edges_between(*rings):
    points = [[tuple(np.round(point, 2).tolist()) for point in xy_of(*ring)] for ring in rings]
    return {frozenset(pair) for ring in points for pair in pairwise(ring)}


def test_a_courtyard_has_walls_and_so_have_buildings_in_it(walls):
    ways = [(BLOCK, {}), (COURT, {}), (KIOSK, {})]
    faces = walls(ways, [([(100, "outer"), (101, "inner"), (102, "outer")], BUILDING)])
    assert edges_of(faces) == edges_between(BLOCK, COURT, KIOSK)


def test_rings_are_joined_from_pieces_in_any_order_and_direction(walls):
    ways = [([3, 4, 1], {}), ([3, 2, 1], {}), ([11, 12], {}), ([14, 13, 12], {}), ([14, 11], {})]
    members = [(104, "inner"), (100, "outer"), (102, "inner"), (101, ""), (103, "inner")]
    assert edges_of(walls(ways, [(members, BUILDING)])) == edges_between(BLOCK, COURT)


def test_incomplete_outlines_make_no_walls(walls):
    ways = [([1, 2, 3, 4], BUILDING), ([1, 2, 1], BUILDING), ([1, 2, 999, 1], BUILDING), ([1, 1, 1, 1], BUILDING)]
    relations = [
        ([(100, "outer")], BUILDING),
        ([(12345, "outer")], BUILDING),
        ([], BUILDING),
        ([(101, "label")], BUILDING),
    ]
    assert walls(ways, relations) == []


def test_of_a_relation_that_the_file_holds_in_part_the_closed_rings_are_walls(walls):
    ways = [([1, 2, 3], {}), (COURT, {})]
    relations = [([(100, "outer"), (555, "outer"), (101, "inner")], BUILDING)]
    assert edges_of(walls(ways, relations)) == edges_between(COURT)


def test_a_footprint_that_crosses_itself_encloses_both_of_its_sides(walls):
    faces = walls([([1, 2, 4, 3, 1], BUILDING)])
    center = xy_of(1, 2, 3, 4).mean(axis=0)
    assert len(faces) == 6
    meeting = [corner for face in faces for corner in (face["br"], face["bl"]) if math.dist(corner[:2], center) < 0.1]
    assert len(meeting) == 4


# -- what is a wall ---------------------------------------------------------------------------------------------


def test_land_use_is_no_wall_unless_it_is_asked_for(walls):
    ways = [(BLOCK, {"landuse": "residential"}), (COURT, {"landuse": "forest"}), (KIOSK, BUILDING)]
    assert [face["type"] for face in walls(ways)] == [14] * 4
    everything = walls(ways, height_estimates=HEIGHT_ESTIMATES_TYPES)
    assert sorted(face["type"] for face in everything) == [14] * 4 + [16] * 4 + [35] * 4


def test_a_wood_is_a_wall(walls):
    assert [(face["type"], face["tr"][2]) for face in walls([(BLOCK, {"natural": "wood"})])] == [(15, 15.0)] * 4


def test_a_table_that_a_program_changes_counts(walls, monkeypatch):
    monkeypatch.setitem(HEIGHT_ESTIMATES_TYPES, ("building", "yes"), (99.0, 14))
    assert {face["tr"][2] for face in walls([(BLOCK, BUILDING)])} == {99.0}
    assert not [row for row in wall_estimates() if row[0] == "landuse"]


# -- heights ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("tags", "height"),
    [
        ({"height": "12"}, 12.0),
        ({"height": "12.5 m"}, 12.5),
        ({"height": "12,5"}, 12.5),
        ({"height": "about 20 metres, 2 floors"}, 20.0),
        ({"height": "40 ft"}, 12.192),
        ({"height": "40 Feet"}, 12.192),
        ({"height": "40'"}, 12.192),
        ({"height": "12'6\""}, 3.81),
        ({"height": "12' 6''"}, 3.81),
        ({"height": "12 ft 6 in"}, 3.81),
        ({"height": "12 ft"}, 3.6576),
        ({"height": "12 m 6 in", "building:levels": "4"}, 12.0),
        ({"height": "10-12"}, 10.0),
        ({"height": "12 - 10 m"}, 10.0),
        ({"height": "30-40 ft"}, 9.144),
        ({"height": "15;12"}, 12.0),
        ({"height": "~ 8"}, 8.0),
        ({"height": "4 storeys"}, 12.0),
        ({"height": "1e3", "building:levels": "4"}, 12.0),
        ({"height": "0x10", "building:levels": "4"}, 12.0),
        ({"height": "12 parsecs", "building:levels": "4"}, 12.0),
        ({"height": "12" + " " * 300 + "m", "building:levels": "4"}, 12.0),
        ({"est_height": "7"}, 7.0),
        ({"est_height": "7", "height": "8", "building:levels": "9"}, 8.0),
        ({"est_height": "7", "building:levels": "9"}, 7.0),
        ({"building:levels": "4", "roof:levels": "1"}, 15.0),
        ({"building:levels": "4", "roof:height": "2.5", "roof:levels": "1"}, 14.5),
        ({"building:levels": "4", "roof:levels": "0"}, 12.0),
        ({"building:levels": "3-5"}, 9.0),
        ({"building:levels": "300", "roof:levels": "300"}, 1000.0),
        ({"roof:levels": "2"}, 10.0),
        ({"building": "garages"}, 4.0),
        ({"building": "shed"}, 3.0),
        ({"building": "garages", "building:levels": "2"}, 6.0),
        ({"height": "12", "building:levels": "9"}, 12.0),
        ({"building:levels": "4"}, 12.0),
        ({"building:levels": "2.5"}, 7.5),
        ({"building:levels": "3;4"}, 9.0),
        ({"height": "tall", "building:levels": "4"}, 12.0),
        ({"height": "-5", "building:levels": "4"}, 12.0),
        ({"height": "0", "building:levels": "4"}, 12.0),
        ({"height": "12000", "building:levels": "4"}, 12.0),
        ({"height": "nan", "building:levels": "0"}, 10.0),
        ({"height": "9" * 400, "building:levels": "-1"}, 10.0),
        ({"building:levels": "many"}, 10.0),
        ({}, 10.0),
    ],
)
def test_the_height_comes_from_the_first_tag_that_can_be_true(walls, tags, height):
    assert [face["tr"][2] for face in walls([(BLOCK, BUILDING | tags)])] == pytest.approx([height] * 4)


# -- where ------------------------------------------------------------------------------------------------------


def test_a_crs_in_degrees_or_none_at_all_is_refused(walls):
    with pytest.raises(BadValue, match="degrees"):
        walls([(BLOCK, BUILDING)], crs=WGS84)
    with pytest.raises(BadValue, match=r"is not a CRS|names no CRS"):
        walls([(BLOCK, BUILDING)], crs="moon")


def test_walls_are_not_put_into_false_metres(walls):
    with pytest.raises(BadValue, match=r"crs: EPSG:3857 is not true to scale at this map.*ctx\.graph\.crs"):
        walls([(BLOCK, BUILDING)], crs="EPSG:3857")
    house = shapely.Polygon(xy_of(*BLOCK))
    mercator = shapely.transform(house, lambda points: project(points, CRS, "EPSG:3857"))
    for crs, shape in ((CRS, house), ("EPSG:3857", mercator)):
        frame = SimpleNamespace(
            geometry=SimpleNamespace(name="geometry"),
            crs=crs,
            to_dict=lambda _, shape=shape: [{"geometry": shape, "building": "yes"}],
        )
        assert edges_of(extract_osm_polygon_faces(frame)) == edges_between(BLOCK)


def test_a_footprint_is_simplified_by_half_a_metre_however_long_it_is(walls):
    """A per cent of the perimeter would be 4 m."""
    steps = {50 + i: (LAT + (i % 2) * 1.8e-5, LON + 2 * i * 1e-5) for i in range(1, 100)}  # 2 m to and fro
    way = [([1, *steps, 2, 3, 4, 1], BUILDING)]
    assert len(walls(way, nodes=NODES | steps)) == 103
    assert len(walls(way, nodes=NODES | steps, min_tolerance=3.0)) == 4


def walls_of_outline(corners, metres):
    """Return the walls around corners (corners, 2) in meters as segments, each from west to east."""
    degrees = project(np.add(corners, (385_700.0, 6_672_100.0)), CRS, WGS84)
    faces = faces_of_features([(shapely.Polygon(degrees), BUILDING)], CRS, min_tolerance=metres, relative_tolerance=0.0)
    return {tuple(sorted((face["br"][:2], face["bl"][:2]))) for face in faces}


@given(
    count=st.integers(3, 40),
    opening=st.sampled_from([0.0, 0.4, 1.0]),
    bumps=st.dictionaries(st.integers(0, 39), st.sampled_from([-1.0, -0.3, 0.4, 4.0]), max_size=3),
    start=st.integers(1, 39),
    metres=st.sampled_from([0.1, 0.5, 2.0]),
)
def test_an_outline_that_is_begun_anywhere_has_the_same_walls_near_its_corners(count, opening, bumps, start, metres):
    angles = np.linspace(opening, 2.0 * np.pi - opening, count, endpoint=opening > 0.0)
    radii = 8.0 + np.array([bumps.get(corner, 0.0) for corner in range(count)])
    outline = np.column_stack((np.cos(angles), np.sin(angles))) * radii[:, None]
    walls = walls_of_outline(outline, metres)
    assert walls_of_outline(np.roll(outline, start, axis=0), metres) == walls
    corners = {corner for wall in walls_of_outline(outline, 0.0) for corner in wall}
    lines = shapely.MultiLineString([*walls])
    assert max(lines.distance(shapely.Point(corner)) for corner in corners) <= metres + 1e-6


def test_a_round_end_in_which_its_outline_begins_keeps_its_place():
    angles = np.radians(np.linspace(-120.0, 120.0, 36))
    round_end = 8.0 * np.column_stack((np.cos(angles), np.sin(angles)))
    outline = [*round_end, (-20.0, round_end[-1, 1]), (-20.0, round_end[0, 1])]
    for start in (0, 4, 18):
        lines = shapely.MultiLineString([*walls_of_outline(np.roll(outline, start, axis=0), 0.5)])
        corners = {corner for wall in walls_of_outline(outline, 0.0) for corner in wall}
        assert max(lines.distance(shapely.Point(corner)) for corner in corners) <= 0.5


BAY = {33: (LAT + 3.6e-6, LON + 1e-3), 34: (LAT - 3.6e-6, LON + 1e-3), 35: (LAT - 9e-6, LON + 1e-3)}


def crossed(faces, *streets, nodes):
    """Which of the streets a wall crosses."""
    edges = shapely.linestrings([[face["br"][:2], face["bl"][:2]] for face in faces])
    return [bool(shapely.crosses(edges, shapely.LineString(xy_of(*street, nodes=nodes))).any()) for street in streets]


def test_simplification_moves_no_wall_across_a_street(walls):
    """The south side has a bay of 0.4 m, in which a path begins."""
    nodes = NODES | BAY | {36: (LAT + 1e-6, LON + 1e-3)}
    house = ([1, 33, 2, 3, 4, 1], BUILDING)
    path = ([36, 35], {"highway": "footway"})
    assert len(walls([house], nodes=nodes)) == 4
    faces = walls([house, path], nodes=nodes)
    assert len(faces) == 5
    assert crossed(faces, path[0], nodes=nodes) == [False]
    assert len(walls([house, (path[0], {"highway": "proposed"})], nodes=nodes)) == 4


@given(
    corners=st.lists(st.tuples(st.floats(0.0, 40.0), st.floats(0.0, 40.0)), min_size=3, max_size=12, unique=True),
    streets=st.lists(st.tuples(*[st.tuples(st.floats(-5.0, 45.0), st.floats(-5.0, 45.0))] * 2), max_size=6),
    tolerance=st.sampled_from([0.2, 0.5, 5.0]),
)
@settings(max_examples=16)
def test_simplified_walls_cross_no_street_that_exact_walls_do_not(corners, streets, tolerance):
    x, y = 385700.0, 6672100.0
    shape = shapely.Polygon(corners).convex_hull
    shapes = [shape, *(shapely.LineString(street) for street in streets if street[0] != street[1])]
    degrees = [shapely.transform(one, lambda points: project(points + np.array((x, y)), CRS, WGS84)) for one in shapes]
    features = [(degrees[0], BUILDING), *((line, {"highway": "path"}) for line in degrees[1:])]
    exact, simple = (
        list(faces_of_features(features, CRS, min_tolerance=metres, relative_tolerance=0.0))
        for metres in (0.0, tolerance)
    )
    streets = shapely.transform(np.array(degrees[1:], object), lambda points: project(points, WGS84, CRS))
    lines = [shapely.MultiLineString([[face["br"][:2], face["bl"][:2]] for face in faces]) for faces in (exact, simple)]
    assert not [street for street in streets if lines[1].crosses(street) and not lines[0].crosses(street)]
    if not lines[0].is_empty:
        assert lines[0].hausdorff_distance(lines[1]) <= tolerance + 1e-6


def test_buildings_in_each_other_without_end_are_refused(walls, monkeypatch):
    monkeypatch.setattr(walls_module, "_BYTES_PER_PAIR", 1 << 28)
    ways = [(BLOCK, BUILDING)] * 4 + [(KIOSK, {"building:part": "yes"})] * 4
    with pytest.raises(TooLarge, match="buildings in each other"):
        walls(ways)


# -- barriers ---------------------------------------------------------------------------------------------------


def test_barriers_are_walls_by_choice(walls):
    line = ([1, 2, 3], {"barrier": "wall", "height": "3"})
    ring = (KIOSK, {"barrier": "hedge"})
    assert walls([line, ring]) == []
    faces = walls([line, ring], barriers=True)
    assert edges_of(faces) == edges_between([1, 2, 3], KIOSK)
    assert [(face["tr"][2], face["type"]) for face in faces] == [(3.0, 37)] * 2 + [(2.0, 37)] * 4
    assert edges_of(walls([line, ring], barriers="wall")) == edges_between([1, 2, 3])
    assert edges_of(walls([line, ring], barriers=["hedge", "fence"])) == edges_between(KIOSK)
    own = walls([([1, 2], {"barrier": "log"}), line], barriers={"log": 1})
    assert [face["tr"][2] for face in own] == [1.0] * 1
    assert walls([([1, 2], {"barrier": "wall", "layer": "-1"})], barriers=True) == []


def test_a_building_with_a_barrier_stands_once(walls):
    assert {face["type"] for face in walls([(BLOCK, BUILDING | {"barrier": "wall"})], barriers=True)} == {14}


def test_a_barrier_is_open_where_it_shares_a_node_with_a_street(walls):
    nodes = NODES | {31: (LAT, LON + 1e-3), 32: (LAT + 1e-3, LON + 1e-3), 33: (LAT - 1e-3, LON + 1e-3)}
    wall, path = ([1, 31, 2], {"barrier": "wall"}), ([33, 31, 32], {"highway": "path"})
    assert len(walls([wall], nodes=nodes, barriers=True, min_tolerance=0.0, relative_tolerance=0.0)) == 2
    faces = walls([wall, path], nodes=nodes, barriers=True)
    assert crossed(faces, path[0], nodes=nodes) == [False]
    lengths = sorted(math.dist(face["br"], face["bl"]) for face in faces)
    whole = math.dist(*xy_of(1, 2, nodes=nodes))
    assert sum(lengths) == pytest.approx(whole - 3.0, abs=0.1)


@pytest.mark.parametrize(
    ("barriers", "error", "words"),
    [
        ("wal", BadValue, "Did you mean 'wall'"),
        (["wall", 3], BadValue, "3"),
        (7, BadType, "barriers"),
        ({"wall": 0.0}, BadValue, "more than 0"),
        ({"wall": "high"}, BadType, "must be a number"),
    ],
)
def test_unknown_barriers_are_refused(walls, barriers, error, words):
    with pytest.raises(error, match=words):
        walls([(BLOCK, BUILDING)], barriers=barriers)


# -- features ---------------------------------------------------------------------------------------------------


def test_features_give_the_walls_that_a_file_gives(walls):
    ring = [NODES[id][::-1] for id in BLOCK]
    court = [NODES[id][::-1] for id in COURT]
    features = [
        (shapely.Polygon(ring, [court]), BUILDING | {"height": math.nan, "levels": None}),
        (shapely.MultiPolygon([shapely.Polygon([NODES[id][::-1] for id in KIOSK])]), {"building": "house"}),
        (shapely.Point(LON, LAT), BUILDING),
        (shapely.Polygon(), BUILDING),
        (None, BUILDING),
        (shapely.Polygon(ring), {"shop": "yes"}),
        (shapely.Polygon(ring), {"building": math.nan}),
    ]
    faces = list(faces_of_features(features, CRS))
    assert edges_of(faces) == edges_between(BLOCK, COURT, KIOSK)
    assert {face["type"] for face in faces} == {0, 14}
    assert list(faces_of_features(features)) == faces
    assert list(faces_of_features([])) == []
    bow = shapely.Polygon([NODES[id][::-1] for id in [1, 2, 4, 3, 1]])
    assert len(list(faces_of_features([(bow, BUILDING)]))) == 6


class Frame:
    """What is used of a GeoDataFrame."""

    def __init__(self, rows, crs):
        self.rows, self.crs = rows, crs
        self.geometry = type("Series", (), {"name": "shape"})

    def to_dict(self, orient):
        assert orient == "records"
        return self.rows


def test_the_rows_of_a_geodataframe_are_walls():
    rows = [{"shape": shapely.box(0, 0, 30, 20), "building": "house", "height": math.nan}]
    assert len(list(extract_osm_polygon_faces(Frame(rows, CRS)))) == 4
    assert next(extract_osm_polygon_faces(Frame(rows, None)))["tr"][2] == 8.0
    degrees = [{"shape": shapely.Polygon([NODES[id][::-1] for id in BLOCK]), "building": "house"}]
    assert edges_of(extract_osm_polygon_faces(Frame(degrees, WGS84))) == edges_between(BLOCK)
    with pytest.raises(BadValue, match=r"GeoDataFrame has no CRS \(gdf\.crs\), and its coordinates look like degrees"):
        extract_osm_polygon_faces(Frame([*degrees, {"shape": None}, {"shape": shapely.Polygon()}], None))
    with pytest.raises(BadType, match="GeoDataFrame"):
        extract_osm_polygon_faces(rows)
