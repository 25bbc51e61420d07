"""Squares: walkers follow their rims and go straight across, past holes, and in sight only."""

import math

import networkx as nx
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gamms.osm import graph_from_file, report
from gamms.osm.areas import ACROSS

SQUARE = {"highway": "pedestrian", "area": "yes"}
FOOTWAY = {"highway": "footway"}
NO_CUT = 1e6


def at(x, y):
    """Degrees of a place in metres from a corner of the map."""
    return 60.17 + y / 111_413.0, 24.94 + x / 55_521.0


def town(corners, *, arms=None):
    """Nodes of a square with these corners in metres, and a footway of 20 m outwards from each of the named ones."""
    middle = sum(x for x, _ in corners) / len(corners), sum(y for _, y in corners) / len(corners)
    nodes, ways = {number: at(*corner) for number, corner in enumerate(corners, 1)}, []
    for number in arms or range(1, len(corners) + 1):
        x, y = corners[number - 1]
        far = math.hypot(x - middle[0], y - middle[1])
        nodes[100 + number] = at(x + 20 * (x - middle[0]) / far, y + 20 * (y - middle[1]) / far)
        ways.append(([number, 100 + number], FOOTWAY))
    return nodes, [([*range(1, len(corners) + 1), 1], SQUARE), *ways]


def length_across(graph):
    return sum(data["length"] for u, v, data in graph.edges(data=True) if data.get(ACROSS) and u < v)


def test_cars_do_not_cross_squares(make_map):
    nodes, ways = town([(0, 0), (100, 0), (100, 100), (0, 100)])
    path = make_map(nodes, *((refs, {**tags, "highway": "residential"}) for refs, tags in ways))
    graph = graph_from_file(path, NO_CUT, osm_type="drive", retain_all=True)
    assert {data["length"] < 21.0 for *_, data in graph.edges(data=True)} == {True}
    assert report(graph, path).closed == {"area=yes": pytest.approx(400.0, rel=1e-3)}


def test_a_square_that_is_closed_has_no_ways(make_map):
    nodes, ways = town([(0, 0), (100, 0), (100, 100), (0, 100)])
    path = make_map(nodes, (ways[0][0], {**SQUARE, "foot": "no"}), *ways[1:])
    graph = graph_from_file(path, NO_CUT, osm_type="walk", retain_all=True)
    assert {data["highway"] for *_, data in graph.edges(data=True)} == {"footway"}


def test_corners_without_a_way_are_not_crossed_to(make_map):
    nodes, ways = town([(0, 0), (100, 0), (100, 100), (0, 100)], arms=[1, 3])
    graph = graph_from_file(make_map(nodes, *ways), NO_CUT, osm_type="walk")
    assert length_across(graph) == pytest.approx(100.0 * math.sqrt(2.0), rel=1e-3)


def with_relation(path, members, tags):
    parts = "".join(f'<member type="way" ref="{way}" role="{role}"/>' for way, role in members)
    inside = "".join(f'<tag k="{key}" v="{value}"/>' for key, value in tags.items())
    text = path.read_text().replace("</osm>", f'<relation id="9">{parts}{inside}</relation></osm>')
    path.write_text(text)
    return path


def test_a_hole_leaves_the_ways_past_it(make_map):
    nodes, ways = town([(0, 0), (100, 0), (100, 100), (0, 100), (0, 50)])
    nodes |= {number: at(*place) for number, place in zip((51, 52, 53), ((55, 60), (75, 60), (65, 70)), strict=True)}
    path = make_map(nodes, ([*range(1, 6), 1], {}), ([51, 52, 53, 51], {}), *ways[1:])
    path = with_relation(path, [(100, "outer"), (101, "inner")], {"type": "multipolygon", "highway": "pedestrian"})
    graph = graph_from_file(path, NO_CUT, osm_type="walk", retain_all=True)
    assert length_across(graph) == pytest.approx(100 * math.sqrt(5) + 100 * math.sqrt(2), rel=1e-3)


def test_a_square_whose_outline_crosses_itself_is_two(make_map):
    """The outline is a bow tie with its knot in the middle: only its outer sides are in sight of each other."""
    nodes, ways = town([(0, 0), (100, 100), (100, 0), (0, 100)])
    graph = graph_from_file(make_map(nodes, *ways), NO_CUT, osm_type="walk")
    assert nx.is_strongly_connected(graph)
    assert length_across(graph) == 0.0


@pytest.mark.parametrize("refs", [[1, 1], [1, 2, 1], [1, 2, 3, 2, 1], [1, 2, 9, 1], [1, 2, 3, 1, 2, 3, 1]])
def test_an_area_that_encloses_nothing_or_lacks_nodes_is_a_way(make_map, refs):
    nodes, ways = town([(0, 0), (100, 0), (100, 100)])
    graph = graph_from_file(make_map(nodes, ([1, 2, 3], FOOTWAY), (refs, SQUARE), *ways[1:]), NO_CUT, osm_type="walk")
    assert nx.is_strongly_connected(graph)
    assert length_across(graph) == 0.0


angles = st.lists(st.floats(0.0, 6.0), min_size=3, max_size=12, unique_by=lambda angle: round(angle, 1))


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(angles)
def test_no_way_between_junctions_that_see_each_other_is_longer_by_a_twentieth(make_map, angles):
    corners = [(100 * math.cos(angle), 60 * math.sin(angle)) for angle in sorted(angles)]
    nodes, ways = town(corners)
    graph = graph_from_file(make_map(nodes, *ways), NO_CUT, osm_type="walk", tolerance=0.0)
    rim = [name for name in graph if graph.out_degree(name) > 1]
    assert len(rim) == len(corners)
    for one, lengths in nx.all_pairs_dijkstra_path_length(graph, weight="length"):
        for other in rim if one in rim else ():
            here, there = graph.nodes[one], graph.nodes[other]
            assert lengths[other] <= 1.055 * math.dist((here["x"], here["y"]), (there["x"], there["y"])) + 0.1


def test_huge_squares_have_their_rims_only(make_map):
    corners = [(900 * math.cos(2 * math.pi * k / 410), 900 * math.sin(2 * math.pi * k / 410)) for k in range(410)]
    nodes = {number: at(*corner) for number, corner in enumerate(corners, 1)}
    nodes |= {number + 1000: (lat + 1e-5, lon) for number, (lat, lon) in nodes.items()}
    arms = [([number, number + 1000], FOOTWAY) for number in range(1, 411)]
    graph = graph_from_file(make_map(nodes, ([*range(1, 411), 1], SQUARE), *arms), NO_CUT, osm_type="walk")
    assert length_across(graph) == 0.0
