"""Lines across squares and merged junctions keep clear of the buildings of the same map."""

import pytest
import shapely
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gamms.errors import BadType
from gamms.osm import graph_from_file, report
from gamms.osm.areas import ACROSS

NO_CUT = 1e6
SQUARE, FOOTWAY, HOUSE = {"highway": "pedestrian", "area": "yes"}, {"highway": "footway"}, {"building": "yes"}
STREET = {"highway": "residential"}
CORNERS = [(0, 0), (100, 0), (100, 100), (0, 100)]


def at(x, y):
    """Degrees of a place in metres from a corner of the map."""
    return 60.17 + y / 111_413.0, 24.94 + x / 55_521.0


def block(west, south, east, north):
    return [(west, south), (east, south), (east, north), (west, north)]


@pytest.fixture
def square_with(make_map):
    """A function from outlines in metres to a map of a square of 100 m, a footway at each corner, and buildings."""

    def write(*outlines, tags=HOUSE, of_square=SQUARE, **more):
        arms = [(-20, -20), (120, -20), (120, 120), (-20, 120)]
        nodes = {number: at(*place) for number, place in enumerate([*CORNERS, *arms], 1)}
        ways = [([1, 2, 3, 4, 1], of_square), *(([number, number + 4], FOOTWAY) for number in range(1, 5))]
        for first, outline in zip(range(100, 10_000, 100), outlines, strict=False):
            nodes |= {first + number: at(*place) for number, place in enumerate(outline)}
            ways.append(([*range(first, first + len(outline)), first], tags))
        return make_map(nodes, *ways, **more)

    return write


def walked(path, **options):
    return graph_from_file(path, NO_CUT, osm_type="walk", retain_all=True, **options)


def lines_across(graph):
    return [data["linestring"] for u, v, data in graph.edges(data=True) if data.get(ACROSS) and u < v]


IN_THE_MIDDLE = block(45, 45, 55, 55)


def test_no_line_leads_through_a_building_on_a_square(square_with):
    path = square_with(IN_THE_MIDDLE)
    graph = walked(path)
    assert lines_across(graph) == []
    assert report(graph, path).is_faithful
    freely = walked(path, around_buildings=False)
    assert len(lines_across(freely)) == 2
    assert report(freely, path).is_faithful


def test_lines_past_a_building_stay(square_with):
    assert len(lines_across(walked(square_with(block(10, 60, 30, 80), block(40, 2, 60, 30))))) == 1
    assert len(lines_across(walked(square_with(block(40, 2, 60, 30))))) == 2


@pytest.mark.parametrize(
    "tags",
    [
        {"building": "roof"},
        {"building": "no"},
        {"building": "yes", "layer": "-1"},
        {"building": "yes", "location": "underground"},
        {"building": "yes", "min_height": "5"},
        {"building": "yes", "building:min_level": "1"},
        {"building": "yes", "area": "no"},
        {"landuse": "residential"},
    ],
)
def test_areas_that_people_walk_below_or_above_do_not_block_ways(square_with, tags):
    assert len(lines_across(walked(square_with(IN_THE_MIDDLE, tags=tags)))) == 2


def test_a_square_in_a_hall_or_below_the_ground_is_crossed(square_with):
    assert len(lines_across(walked(square_with(block(-5, -5, 105, 105))))) == 2
    assert len(lines_across(walked(square_with(IN_THE_MIDDLE, of_square={**SQUARE, "level": "-1"})))) == 2
    assert len(lines_across(walked(square_with(IN_THE_MIDDLE, of_square={**SQUARE, "layer": "1"})))) == 0


def test_the_order_and_the_numbers_of_nodes_play_no_part(square_with):
    path = square_with(IN_THE_MIDDLE)
    text = path.read_text()
    head, nodes, ways = text[: text.index("<node")], text[text.index("<node") : text.index("<way")], "<way"
    ways = text[text.index("<way") : text.index("</osm>")]
    path.write_text(head + ways + nodes + "</osm>")
    assert lines_across(walked(path)) == []
    path.write_text(
        text.replace('ref="1', 'ref="-1').replace('node id="1', 'node id="-1').replace('id="105"', 'id="-5"')
    )
    assert lines_across(walked(path)) == []


def test_a_part_of_a_file_has_its_buildings(square_with):
    (south, west), (north, east) = at(-10, -10), at(130, 130)
    assert lines_across(walked(square_with(IN_THE_MIDDLE), clip=(west, south, east, north))) == []


def test_a_building_whose_nodes_are_not_all_in_the_file_is_left_out(square_with):
    path = square_with(IN_THE_MIDDLE)
    path.write_text("\n".join(line for line in path.read_text().splitlines() if '<node id="102"' not in line))
    assert len(lines_across(walked(path))) == 2


def test_an_outline_of_more_nodes_than_ways_have_is_left_out(square_with):
    path = square_with(IN_THE_MIDDLE)
    path.write_text(path.read_text().replace('<nd ref="101"/>', '<nd ref="101"/><nd ref="102"/>' * 1000))
    assert len(lines_across(walked(path))) == 2


boxes = st.tuples(*[st.floats(1.0, 80.0)] * 2, *[st.floats(1.0, 18.0)] * 2).map(
    lambda one: block(one[0], one[1], one[0] + one[2], one[1] + one[3])
)


@settings(max_examples=8, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(boxes, max_size=6))
def test_lines_across_are_those_that_meet_no_building(square_with, outlines):
    found = lines_across(walked(square_with(*outlines)))
    free = [
        not any(shapely.LineString(line).intersects(shapely.Polygon(one).buffer(-0.01)) for one in outlines)
        for line in ([(0, 0), (100, 100)], [(100, 0), (0, 100)])
    ]
    touched = [
        any(shapely.LineString(line).intersects(shapely.Polygon(one).buffer(0.01)) for one in outlines)
        for line in ([(0, 0), (100, 100)], [(100, 0), (0, 100)])
    ]
    assert 2 - sum(touched) <= len(found) <= sum(free)


# -- junctions --------------------------------------------------------------------------------------------------


def alley(make_map, *outlines, tags=HOUSE):
    """Two streets 6 m apart, joined by a lane of 7 m around whatever stands between their junctions."""
    places = {1: (0, 0), 2: (6, 0), 3: (-60, 0), 4: (0, 60), 5: (66, 0), 6: (6, -60), 7: (3, 2)}
    nodes = {number: at(*place) for number, place in places.items()}
    ways = [([3, 1, 4], STREET), ([5, 2, 6], STREET), ([1, 7, 2], STREET)]
    for first, outline in zip(range(100, 1000, 100), outlines, strict=False):
        nodes |= {first + number: at(*place) for number, place in enumerate(outline)}
        ways.append(([*range(first, first + len(outline)), first], tags))
    return make_map(nodes, *ways)


def test_junctions_inside_one_building_may_merge(make_map):
    assert graph_from_file(alley(make_map, block(-80, -80, 80, 80)), NO_CUT, tolerance=5.0).graph["merged_nodes"] == 1


def test_it_is_a_yes_or_no_question(square_with):
    with pytest.raises(BadType, match="around_buildings"):
        walked(square_with(), around_buildings="maybe")
