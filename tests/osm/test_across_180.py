"""Areas in degrees, and maps on both sides of 180 degrees."""

import json
import math

import numpy as np
import pytest
import shapely

import gamms
from gamms.errors import BadType, BadValue
from gamms.osm import (
    graph_from_bbox,
    graph_from_file,
    graph_from_geojson,
    graph_from_polygon,
    obstacle_from_file,
    report,
    scenery_from_file,
)

ROAD = {"highway": "residential"}
NO_CUT = 1e6
BOX = (179.9, -17.0, -179.9, -16.0)
TWO_BOXES = shapely.MultiPolygon([shapely.box(179.9, -17, 180, -16), shapely.box(-180, -17, -179.9, -16)])


@pytest.fixture
def road(make_map):
    """A road of 853 m across 180 degrees, and one elsewhere."""
    nodes = {1: (-16.8, 179.998), 2: (-16.8, 179.9999), 3: (-16.8, -179.9999), 4: (-16.8, -179.998)}
    nodes |= {5: (-16.8, 179.5), 6: (-16.8, 179.51)}
    return make_map(nodes, ([1, 2, 3, 4], ROAD), ([5, 6], ROAD))


def length(graph):
    return round(sum(data["length"] for u, v, data in graph.edges(data=True) if u < v), 1)


@pytest.mark.parametrize(
    "clip",
    [BOX, [*BOX], np.array(BOX), TWO_BOXES, shapely.geometry.mapping(TWO_BOXES)],
    ids=lambda clip: type(clip).__name__,
)
def test_a_box_across_180_degrees_is_the_area_between_its_sides(road, clip):
    graph = graph_from_file(road, NO_CUT, clip=clip)
    assert length(graph) == 426.4
    found = report(graph, road)
    assert found.is_faithful
    assert found.clipped == pytest.approx(1066.0, abs=1.0)


@pytest.mark.parametrize(("clip", "metres"), [((179, -17, 180, -16), 202.5 + 1066.0), ((180, -17, -179, -16), 202.5)])
def test_a_box_may_end_at_180_degrees(road, clip, metres):
    assert length(graph_from_file(road, NO_CUT, retain_all=True, clip=clip)) == pytest.approx(metres, abs=0.1)


def test_a_box_of_the_whole_world_is_everything(road):
    graph = graph_from_file(road, NO_CUT, retain_all=True, clip=(-180, -90, 180, 90))
    assert length(graph) == length(graph_from_file(road, NO_CUT, retain_all=True))


SWAPPED = {
    "west and east": ((25.0, 60.1, 24.9, 60.2), r"west=25.* it takes west < east; across .* 359\.9 degrees wide"),
    "south and north": ((24.9, 60.2, 25.0, 60.1), "it takes west < east .* and south < north"),
    "no width": ((24.9, 60.1, 24.9, 60.2), "it takes west < east"),
    "no height": ((24.9, 60.1, 25.0, 60.1), "south < north"),
    "too far north": ((24.9, 60.1, 25.0, 91.0), "latitudes from -90 to 90"),
    "too far east": ((179.0, 60.1, 181.0, 61.0), "longitudes are from -180 to 180"),
    "NaN": ((24.9, math.nan, 25.0, 60.2), "south"),
    "infinite": ((-math.inf, 60.1, 25.0, 60.2), "west"),
}


@pytest.mark.parametrize("what", SWAPPED)
def test_sides_that_are_swapped_or_impossible_are_named(road, what):
    clip, words = SWAPPED[what]
    for given in (clip, np.array(clip)):
        with pytest.raises(BadValue, match=f"clip.*{words}"):
            graph_from_file(road, clip=given)
    of_bbox = dict(zip(("west", "south", "east", "north"), ("left", "bottom", "right", "top"), strict=True))
    for name, other in of_bbox.items():
        words = words.replace(name, other)
    with pytest.raises(BadValue, match=words):
        graph_from_bbox(*clip)


def test_a_side_that_is_no_number_is_a_bad_type(road):
    with pytest.raises(BadType, match="left"):
        graph_from_bbox("24.9", 60.1, 25.0, 60.2)


@pytest.mark.parametrize("ring", [[(179.9, -17), (-179.9, -17), (-179.9, -16), (179.9, -16)]])
def test_a_polygon_across_180_degrees_is_cut_there_by_its_author(road, ring):
    closed = {"type": "Polygon", "coordinates": [[*ring, ring[0]]]}
    for clip in (ring, closed, shapely.Polygon(ring)):
        with pytest.raises(BadValue, match=r"longitude 179\.9 to -179\.9, around the world. Cut an area across 180"):
            graph_from_file(road, clip=clip)


def test_servers_end_at_180_degrees():
    for call in (lambda: graph_from_bbox(*BOX), lambda: graph_from_polygon(TWO_BOXES)):
        with pytest.raises(BadValue, match="both sides of the 180th meridian, where map servers end"):
            call()


def test_lines_of_geojson_that_are_cut_at_180_degrees_join_there(tmp_path):
    file = tmp_path / "cut.geojson"
    lines = [[[179.998, -16.8], [180, -16.8]], [[-180.0, -16.8], [-179.998, -16.8]]]
    file.write_text(json.dumps({"type": "MultiLineString", "coordinates": lines}))
    assert length(graph_from_geojson(file, NO_CUT)) == 426.4


# -- the same town at other longitudes --------------------------------------------------------------------------


def _turned(lon):
    return (lon + 180) % 360 - 180


def town(middle):
    """Streets, a square, buildings, a wall and a park, in ten-thousandths of a degree around a longitude."""
    streets = {1: (0, -3), 2: (0, -1), 3: (0, 1), 4: (0, 3), 5: (2, -1), 6: (2, 1), 7: (3, 0.4), 8: (3, 3), 9: (-1, -1)}
    square = {11: (0.2, -0.7), 12: (0.2, -0.2), 13: (1, -0.2), 14: (0.6, -0.4), 15: (1, -0.7), 21: (4, -3), 22: (4, 3)}
    houses = {31: (6, -2), 32: (6, -1), 33: (7, -1), 34: (7, -2), 41: (6, 1), 42: (6, 2), 43: (7, 2)}
    places = streets | square | houses
    nodes = {id: (-16.8 + north * 1e-4, _turned(middle + east * 1e-4)) for id, (north, east) in places.items()}
    ways = [
        ([1, 2, 3, 4], {"highway": "footway"}),
        ([2, 3, 6, 5, 2], {"highway": "pedestrian", "area": "yes"}),
        *(([a, b], {"highway": "footway"}) for a, b in [(5, 7), (6, 8), (2, 9), (21, 22), (1, 21)]),
        *((refs, {"building": "yes"}) for refs in ([11, 12, 13, 14, 15, 11], [31, 32, 33, 34, 31], [41, 42, 43, 41])),
        ([21, 8], {"barrier": "wall", "height": "2"}),
        ([21, 8, 22, 43, 31, 21], {"leisure": "park"}),
    ]
    return nodes, ways


def sizes(lines):
    return sorted(round(math.dist(a, b), 2) for a, b in lines)


@pytest.mark.parametrize("middle", [-180.0, 179.9999, -179.99985])
@pytest.mark.parametrize("tolerance", [0.5, 10.0])
def test_a_town_across_180_degrees_is_as_anywhere(make_map, middle, tolerance):
    found = []
    for at in (middle - 6.0, middle):  # both on the edge of a zone of UTM
        nodes, ways = town(at)
        file = make_map(nodes, *ways, name=f"{at}.osm")
        graph = graph_from_file(file, NO_CUT, osm_type="walk", tolerance=tolerance)
        walls = obstacle_from_file(file, barriers=True)
        with gamms.create_context(logger_config={"level": "CRITICAL"}) as ctx:
            ctx.graph.attach_networkx_graph(graph)
            drawn = scenery_from_file(file, ctx)
        result = report(graph, file)
        assert result.is_faithful
        edges = [(u, v, round(data["length"], 2)) for u, v, data in graph.edges(data=True)]
        of_walls = sizes((wall["tl"], wall["tr"]) for wall in walls)
        found.append((edges, of_walls, round(result.across, 2), len(drawn.points), len(drawn.buildings.ids)))
    assert found[0] == found[1]
    assert found[0][2] > 0.0


@pytest.mark.parametrize("middle", [-180.0, 24.0])
def test_buildings_block_junctions_on_either_side_of_180_degrees(make_map, middle):
    """Two junctions with a building between them do not merge; their road leads around it."""
    places = {1: (0, -0.5), 2: (0.3, 0), 3: (0, 0.5), 4: (2, -0.5), 5: (-2, -0.5), 6: (2, 0.5), 7: (-2, 0.5)}
    places |= {11: (-0.1, -0.1), 12: (-0.1, 0.1), 13: (0.1, 0.1), 14: (0.1, -0.1)}
    nodes = {id: (-16.8 + north * 1e-4, _turned(middle + east * 1e-4)) for id, (north, east) in places.items()}
    ways = [([1, 2, 3], ROAD), *(([a, b], ROAD) for a, b in [(1, 4), (1, 5), (3, 6), (3, 7)])]
    house = ([11, 12, 13, 14, 11], {"building": "yes"})
    files = [make_map(nodes, *ways, *more, name=f"{len(more)}.osm") for more in ([], [house])]
    assert [len(graph_from_file(file, NO_CUT, tolerance=12.0)) for file in files] == [5, 6]
