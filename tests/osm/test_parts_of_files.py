"""Parts of map files: by a filter of one's own, and within an area."""

from pathlib import Path

import pytest

from gamms.errors import BadFile, BadType, BadValue
from gamms.osm import graph_from_file, report

ROAD = {"highway": "residential"}
ROW = {i: (60.17, 24.94 + 0.001 * i) for i in range(10)}
WHOLE = {"resolution": 1e6, "tolerance": 0.0, "simplify": False}


def ids(graph):
    return {data["osmid"] for *_, data in graph.edges(data=True)}


@pytest.fixture
def streets(make_map):
    ways = [([0, 1, 2], {**ROAD, "surface": "asphalt"}), ([2, 3, 4], {**ROAD, "surface": "gravel"})]
    ways += [([4, 5, 6, 7, 8, 9], {"highway": "footway", "surface": "asphalt", "lit": "yes"}), ([9, 0], ROAD)]
    return make_map(ROW, *ways)


def test_a_filter_opens_no_way_that_a_mode_closes(streets):
    graph = graph_from_file(streets, retain_all=True, osm_type="drive", filter={"surface": True}, **WHOLE)
    assert ids(graph) == {100, 101}


@pytest.mark.parametrize("given", [7, "surface", {"surface": 7}, {"surface": [7]}, {"surface": False}])
def test_a_filter_that_is_none_is_refused(streets, given):
    with pytest.raises(BadType, match="filter"):
        graph_from_file(streets, filter=given)


def test_an_error_of_a_filter_is_raised(streets):
    with pytest.raises(KeyError, match="lanes"):
        graph_from_file(streets, filter=lambda tags: tags["lanes"])


# -- areas ------------------------------------------------------------------------------------------------------


def test_a_hole_splits_a_road(streets):
    hole = [[24.9435, 60.1], [24.9445, 60.1], [24.9445, 60.2], [24.9435, 60.2], [24.9435, 60.1]]
    outer = [[24.9415, 60], [24.9475, 60], [24.9475, 61], [24.9415, 61], [24.9415, 60]]
    clip = {"type": "Polygon", "coordinates": [outer, hole]}
    graph = graph_from_file(streets, retain_all=True, clip=clip, **WHOLE)
    assert len(graph) == 5
    assert sorted(data["osmid"] for u, v, data in graph.edges(data=True) if u < v) == [101, 102, 102]


@pytest.mark.parametrize("mode", [None, "walk", "bike", "drive"])
def test_an_area_around_everything_changes_nothing(make_map, mode):
    nodes = {i: (60.17 + 0.001 * (i // 4), 24.94 + 0.001 * (i % 4)) for i in range(16)}
    ways = [([i, i + 1], {**ROAD, "name": str(i)}) for i in range(15) if i % 4 < 3]
    ways += [([i, i + 4], ROAD) for i in range(12)]
    ways += [([5, 6, 10, 9, 5], {"highway": "pedestrian", "area": "yes"})]
    file = make_map(nodes, *ways)
    one, other = (graph_from_file(file, osm_type=mode, clip=clip) for clip in (None, (24.0, 60.0, 25.0, 61.0)))
    assert list(one.nodes(data=True)) == list(other.nodes(data=True))
    assert [(u, v, data["length"]) for u, v, data in one.edges(data=True)] == [
        (u, v, data["length"]) for u, v, data in other.edges(data=True)
    ]


@pytest.mark.parametrize(
    "clip",
    [7, "Helsinki", (1, 2, 3), (24.9, 60, 24.9, 61), (0, 0, 400, 10), {"type": "Point"}, (0, float("nan"), 1, 1)],
)
def test_an_area_that_is_none_is_refused(streets, clip):
    with pytest.raises(BadValue, match=r"clip|side"):
        graph_from_file(streets, clip=clip)


def test_an_area_without_roads_is_named(streets):
    with pytest.raises(BadFile, match="no roads in the area of clip"):
        graph_from_file(streets, clip=(10, 10, 11, 11))


# -- reports of parts -------------------------------------------------------------------------------------------


def test_a_report_counts_roads_left_out_by_a_filter(streets):
    graph = graph_from_file(streets, retain_all=True, filter={"highway": ["residential"]}, **WHOLE)
    found, whole = report(graph, streets), report(graph_from_file(streets, retain_all=True, **WHOLE), streets)
    assert found.is_faithful
    assert found.filtered > 0.0
    assert found.length_before + found.filtered == pytest.approx(whole.length_before)
    assert dict(found.rows())["by filter"] == f"{found.filtered:,.1f} m left out"
    assert (whole.filtered, whole.clipped, "by filter" in dict(whole.rows())) == (0.0, 0.0, False)


def test_a_filter_that_is_a_function_has_to_be_given_again(streets):
    def is_residential(tags):
        return tags["highway"] == "residential"

    graph = graph_from_file(streets, retain_all=True, filter=is_residential, **WHOLE)
    with pytest.raises(BadValue, match=r"by the function 'is_residential'. Give it again: report\(…, filter=…\)"):
        report(graph, streets)
    assert report(graph, streets, filter=is_residential).is_faithful
    assert not report(graph, streets, filter=lambda tags: True).is_faithful


@pytest.mark.parametrize("mode", [None, "bike", "drive_service"])
def test_a_report_counts_roads_outside_of_an_area(mode):
    file = Path(__file__).parent.parent / "osm_online/data/kluuvi.osm.gz"
    corners = [(24.940, 60.167), (24.948, 60.167), (24.948, 60.172), (24.940, 60.172)]
    graph = graph_from_file(file, osm_type=mode, clip=corners, filter={"highway": ["service", "footway", "tertiary"]})
    found = report(graph, file)
    assert found.is_faithful
    parts = (found.filtered, found.clipped, found.other_parts, found.no_way_back, *found.closed.values())
    assert found.length_before - found.across + sum(parts) == pytest.approx(found.source_length)
    assert min(found.filtered, found.clipped) > 1000.0
    assert 0.0 not in found.closed.values()
    assert not report(graph, file, clip=(24.0, 60.0, 25.0, 61.0)).is_faithful


def test_an_area_between_the_nodes_of_a_road_has_no_roads(streets):
    with pytest.raises(BadFile, match="no roads in the area of clip"):
        graph_from_file(streets, clip=(24.9401, 60.1699, 24.9409, 60.1701))
    with pytest.raises(BadFile, match="no roads in the area of clip"):
        graph_from_file(streets, clip=(24.9401, 60.1699, 24.9411, 60.1701))
