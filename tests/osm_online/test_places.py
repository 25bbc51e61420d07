"""Streets by the name of a place or by an area, from a server that answers from a real extract."""

import inspect
import math
from itertools import pairwise

import networkx as nx
import numpy as np
import pytest
import shapely
from server import EAST, EXTRACT, NORTH, SOUTH, WEST, elements

import gamms
from gamms.osm import (
    OSMType,
    create_osm_graph,
    get_network_type,
    graph_from_bbox,
    graph_from_file,
    graph_from_place,
    graph_from_point,
    graph_from_polygon,
)

PLACE = "Kluuvi, Helsinki"
KINDS = ["WALK", "BIKE", "DRIVE"]


def osmids(graph):
    found = {one for _, _, data in graph.edges(data=True) for one in np.atleast_1d(data["osmid"]).tolist()}
    assert found
    return found


def road_length(graph):
    return sum(data["length"] for u, v, data in graph.edges(data=True) if u < v or (v, u) not in graph.edges)


def one_way_edges(graph):
    return [(u, v, data) for u, v, data in graph.edges(data=True) if (v, u) not in graph.edges]


def segments_of_extract(osmids):
    """The metres of the ways with these ids that lie inside the place, straight from the extract."""
    geod = pytest.importorskip("pyproj").Geod(ellps="WGS84")
    inside = shapely.box(WEST, SOUTH, EAST, NORTH)
    nodes, metres = elements()["node"], 0.0
    for id in osmids:
        line = [(nodes[ref]["lon"], nodes[ref]["lat"]) for ref in elements()["way"][id]["nodes"]]
        for a, b in pairwise(line):
            if inside.contains(shapely.Point(a)) and inside.contains(shapely.Point(b)):
                metres += geod.line_length(*zip(a, b, strict=True))
    return metres


@pytest.mark.parametrize("kind", KINDS)
def test_uncut_at_the_boundary_the_network_has_the_length_of_its_ways(server, kind):
    options = {"tolerance": 0.0, "simplify": False, "truncate_by_edge": False, "retain_all": True}
    graph = create_osm_graph(PLACE, OSMType[kind], **options)
    assert road_length(graph) == pytest.approx(segments_of_extract(osmids(graph)), rel=1e-6)


def test_riders_and_drivers_honour_one_way_streets_and_walkers_need_not(streets):
    assert one_way_edges(streets["WALK"]) == []
    for kind in ("BIKE", "DRIVE"):
        against = one_way_edges(streets[kind])
        assert len(against) > 20
        assert all(data["oneway"] is True for _, _, data in against)
        assert any(data["oneway"] is False for _, _, data in streets[kind].edges(data=True))


@pytest.mark.parametrize("kind", KINDS)
def test_both_ways_can_be_asked_for(server, streets, kind):
    graph = create_osm_graph(PLACE, OSMType[kind], tolerance=0.01, bidirectional=True)
    assert one_way_edges(graph) == []
    assert len(graph) == len(streets[kind])
    assert road_length(graph) == pytest.approx(road_length(streets[kind]), rel=1e-9)


def test_streets_for_drivers_can_be_made_to_honour_nothing_else(server, streets):
    graph = create_osm_graph(PLACE, OSMType.DRIVE, tolerance=0.01, bidirectional=False)
    assert nx.utils.graphs_equal(graph, streets["DRIVE"])


def test_the_default_tolerance_merges_junctions(server, streets):
    graph = create_osm_graph(PLACE)
    assert len(graph) < len(streets["WALK"])
    assert nx.is_weakly_connected(graph)
    assert road_length(graph) == pytest.approx(road_length(streets["WALK"]), rel=0.05)


def test_edges_keep_the_tags_of_their_street_and_the_ids_of_its_ways(streets):
    edges = [data for _, _, data in streets["DRIVE"].edges(data=True)]
    assert {"Mannerheimintie", "Mikonkatu"} <= {data.get("name") for data in edges if isinstance(data.get("name"), str)}
    assert all({"osmid", "highway", "oneway", "length", "linestring", "id"} <= data.keys() for data in edges)
    assert not any("reversed" in data or "geometry" in data for data in edges)
    several = [data["osmid"] for data in edges if isinstance(data["osmid"], list)]
    assert several
    assert all(len(set(ids)) == len(ids) > 1 for ids in several)


def test_places_can_be_dicts_and_lists(server):
    one = create_osm_graph({"city": PLACE}, OSMType.DRIVE, tolerance=0.01)
    assert nx.utils.graphs_equal(
        one, create_osm_graph([PLACE, {"city": "Helsinki-Kluuvi"}], OSMType.DRIVE, tolerance=0.01)
    )


def test_a_custom_filter_replaces_that_of_the_type(server):
    steps = create_osm_graph(PLACE, custom_filter='["highway"~"steps"]', retain_all=True)
    assert {data["highway"] for _, _, data in steps.edges(data=True)} == {"steps"}
    both = create_osm_graph(PLACE, custom_filter=['["highway"="steps"]', "[highway=cycleway]"], retain_all=True)
    assert {data["highway"] for _, _, data in both.edges(data=True)} == {"steps", "cycleway"}


def test_a_multipolygon_has_the_streets_of_all_its_parts(server):
    parts = [shapely.box(24.9420, 60.1680, 24.9440, 60.1690), shapely.box(24.9470, 60.1680, 24.9490, 60.1690)]
    options = {"retain_all": True, "tolerance": 0.0, "truncate_by_edge": False, "simplify": False}
    ids = [osmids(graph_from_polygon(part, **options)) for part in parts]
    assert osmids(graph_from_polygon(shapely.MultiPolygon(parts), **options)) == ids[0] | ids[1]


def test_the_extract_is_small_and_names_its_makers():
    assert len(EXTRACT.read_bytes()) < 150_000
    assert "OpenStreetMap contributors" in (EXTRACT.parent / "README.md").read_text(encoding="utf-8")


def test_the_graph_says_how_it_was_made(streets):
    made = streets["DRIVE"].graph
    assert (made["resolution"], made["tolerance"], made["bidirectional"], made["osm_type"]) == (
        10.0,
        0.01,
        False,
        "DRIVE",
    )


def test_a_place_of_parts_far_apart_is_asked_for_part_by_part(server, settings, monkeypatch):
    monkeypatch.setattr(settings, "max_query_area_size", 5e6)
    parts = [shapely.box(24.9420, 60.1680, 24.9440, 60.1690), shapely.box(25.9470, 60.1680, 25.9490, 60.1690)]
    graph_from_polygon(shapely.MultiPolygon(parts), retain_all=True)
    assert server.asked == ["interpreter"] * 2


def test_the_network_types_have_the_names_that_osmnx_gives_them():
    assert [get_network_type(kind) for kind in OSMType] == ["walk", "bike", "drive"]


@pytest.mark.parametrize(
    ("change", "error", "words"),
    [
        ({"location": 7}, TypeError, "location must be the name of a place"),
        ({"location": {"city": 7}}, TypeError, "location must be the name of a place"),
        ({"location": " "}, ValueError, "location must name a place"),
        ({"location": []}, ValueError, "location must name a place"),
        ({"osm_type": "wlak"}, TypeError, r"osm_type must be OSMType\.WALK"),
        ({"osm_type": 0}, TypeError, r"osm_type must be OSMType\.WALK"),
        ({"resolution": 0}, ValueError, "resolution must be more than 0"),
        ({"resolution": math.nan}, ValueError, "resolution must be finite"),
        ({"resolution": "ten"}, TypeError, "resolution must be a number"),
        ({"tolerance": -1.0}, ValueError, "tolerance must not be negative"),
        ({"tolerance": math.inf}, ValueError, "tolerance must be finite"),
        ({"custom_filter": 7}, TypeError, "custom_filter must be text"),
        ({"custom_filter": []}, ValueError, "custom_filter must look like"),
        ({"custom_filter": "highway"}, ValueError, "custom_filter must look like"),
    ],
)
def test_an_impossible_argument_is_refused_before_anything_is_asked(server, change, error, words):
    with pytest.raises(error, match=words) as caught:
        create_osm_graph(**({"location": PLACE} | change))
    assert isinstance(caught.value, gamms.errors.GammsError)
    assert server.asked == []


DATE_LINE = shapely.MultiPolygon([shapely.box(179.99, -17, 180, -16.9), shapely.box(-180, -17, -179.99, -16.9)])


@pytest.mark.parametrize(
    ("call", "error", "words"),
    [
        (lambda: graph_from_bbox(EAST, SOUTH, WEST, NORTH), ValueError, "left < right"),
        (lambda: graph_from_bbox(WEST, NORTH, EAST, SOUTH), ValueError, "bottom < top"),
        (lambda: graph_from_bbox(24.0, 60.0, 200.0, 61.0), ValueError, "degrees"),
        (lambda: graph_from_bbox(24.0, math.nan, 25.0, 61.0), ValueError, "bottom must be finite"),
        (lambda: graph_from_bbox("24", 60.0, 25.0, 61.0), TypeError, "left must be a number"),
        (lambda: graph_from_bbox(20.0, 60.0, 30.0, 70.0), ValueError, "km², more than 20000 km²"),
        (lambda: graph_from_point(60.0, 24.0, 0.0), ValueError, "radius_m must be more than 0"),
        (lambda: graph_from_point(60.0, 24.0, 1e6), ValueError, "radius_m .* at most 75000 m"),
        (lambda: graph_from_point(91.0, 24.0, 10.0), ValueError, "is not a position"),
        (lambda: graph_from_point(88.0, 24.0, 10.0), ValueError, "UTM"),
        (lambda: graph_from_point(None, 24.0, 10.0), TypeError, "lat must be a number"),
        (lambda: graph_from_polygon("POLYGON ((0 0, 1 0, 0 1, 0 0))"), TypeError, "polygon must be a shapely"),
        (lambda: graph_from_polygon(shapely.Point(24, 60)), TypeError, "polygon must be a shapely"),
        (lambda: graph_from_polygon(shapely.Polygon()), ValueError, "outline is empty"),
        (lambda: graph_from_point(-16.8, 180.0, 900), ValueError, "both sides of the 180th meridian"),
        (lambda: graph_from_point(-16.8, 179.999, 900), ValueError, "both sides of the 180th meridian"),
        (lambda: graph_from_polygon(DATE_LINE), ValueError, "both sides of the 180th meridian"),
        (lambda: graph_from_polygon(shapely.box(3.8e5, 6.6e6, 3.9e5, 6.7e6)), ValueError, "not degrees"),
        (
            lambda: graph_from_polygon(shapely.Polygon([(24, 60), (25, 61), (25, 60), (24, 61)])),
            ValueError,
            "crosses itself",
        ),
    ],
)
def test_an_impossible_area_is_refused_before_anything_is_asked(server, call, error, words):
    with pytest.raises(error, match=words) as caught:
        call()
    assert isinstance(caught.value, gamms.errors.GammsError)
    assert server.asked == []


@pytest.mark.parametrize("by_area", [graph_from_bbox, graph_from_point, graph_from_polygon])
def test_every_area_has_the_options_of_a_place_and_the_defaults_of_a_file(by_area):
    def defaults(maker):
        parameters = inspect.signature(maker).parameters.values()
        return {one.name: one.default for one in parameters if one.default is not one.empty}

    of_area, of_file = defaults(by_area), defaults(graph_from_file)
    own = {"filter", "clip"}  # of files; areas have custom_filter, and are cut anyway
    assert set(of_area) == {*defaults(create_osm_graph), "strong", "tags", "elevation", "around_buildings"}
    shared = {name: value for name, value in of_file.items() if name not in own | {"around_buildings"}}
    assert {**shared, "osm_type": OSMType.WALK}.items() <= of_area.items()


@pytest.mark.parametrize("mode", ["walk", "bike", "drive", "drive_service", "robot"])
def test_an_area_and_a_file_of_it_give_the_same_streets_for_a_mode(server, mode):
    options = {"osm_type": mode, "resolution": 1e6, "around_buildings": mode != "bike"}
    of_area = graph_from_polygon(shapely.box(24.93, 60.16, 24.96, 60.18), **options)
    of_file = graph_from_file(EXTRACT, **options)
    assert len(server.asked) == (1 if mode == "bike" else 2)
    assert osmids(of_area) == osmids(of_file)
    assert road_length(of_area) == pytest.approx(road_length(of_file), rel=1e-6)
    assert nx.is_strongly_connected(of_area)
    for name in ("tolerance", "bidirectional", "strong", "mode", "osm_type"):
        assert of_area.graph[name] == of_file.graph[name]
    assert of_area.graph["no_way_back_m"] == pytest.approx(of_file.graph["no_way_back_m"], abs=0.1)


def test_a_place_by_name_is_the_area_inside_its_boundary(server):
    box = shapely.box(WEST, SOUTH, EAST, NORTH)
    for mode in ("walk", "drive"):
        of_name = graph_from_place(PLACE, osm_type=mode)
        assert nx.utils.graphs_equal(of_name, graph_from_polygon(box, osm_type=mode))


@pytest.mark.parametrize(("kind", "fastest"), [("WALK", 5.0), ("BIKE", 15.0), ("DRIVE", 40.0)])
def test_the_streets_of_a_place_have_the_speeds_of_the_mode(streets, kind, fastest):
    edges = [data for *_, data in streets[kind].edges(data=True)]
    assert max(data["speed_kph"] for data in edges) == fastest
    assert all(data["travel_time"] == pytest.approx(data["length"] / (data["speed_kph"] / 3.6)) for data in edges)
    if kind == "WALK":
        assert {data["speed_kph"] for data in edges if data["highway"] == "steps"} == {2.0}


def test_a_place_has_one_graph_for_several_modes(server):
    options = {"tolerance": 0.0, "simplify": False, "resolution": 1e6}
    both = graph_from_place(PLACE, osm_type=["walk", "drive"], **options)
    assert all(data["walk"] > 0.0 or data["drive"] > 0.0 for _, _, data in both.edges(data=True))
    for mode in ("walk", "drive"):
        alone = graph_from_place(PLACE, osm_type=mode, **options)
        in_both = nx.DiGraph((u, v, data) for u, v, data in both.edges(data=True) if data[mode] > 0.0)
        assert nx.is_strongly_connected(in_both)
        assert in_both.number_of_edges() == alone.number_of_edges()
        assert in_both.size("length") == pytest.approx(alone.size("length"), rel=1e-9)


def test_a_place_has_networks_that_are_no_roads(server):
    wires = graph_from_place(PLACE, osm_type={"man_made": ["wire", "pipeline"]}, retain_all=True, strong=False)
    assert {data["man_made"] for *_, data in wires.edges(data=True)} == {"wire", "pipeline"}
    both = graph_from_place(PLACE, osm_type=["walk", {"man_made": ["pipeline"]}], retain_all=True)
    flows = [data for *_, data in both.edges(data=True) if data["pipeline"]]
    assert {(data["man_made"], data["walk"], data["pipeline"]) for data in flows} == {("pipeline", 0.0, 30.0)}
