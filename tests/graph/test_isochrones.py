"""Isochrones: exact ends on edges, polygons with the areas of closed forms, GeoJSON and pictures."""

import csv
import json
import sqlite3
from contextlib import closing
from itertools import pairwise
from math import cos, pi, sin
from xml.etree import ElementTree as ET

import networkx as nx
import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

import gamms
from gamms.errors import BadType, BadValue, UnknownName, UnknownType

WIDTH = 10.0
DISK = 0.5 * 32 * WIDTH**2 * sin(2 * pi / 32)  # a circle with 32 corners


@pytest.fixture
def world():
    with gamms.create_context(seed=1) as ctx:
        yield ctx


def add_roads(ctx, places, roads):
    """Add nodes at these places, and roads (source, target, attributes) with the lengths of straight lines."""
    ctx.graph.add_nodes(range(len(places)), *zip(*places, strict=True))
    for id, (source, target, more) in enumerate(roads):
        length = float(np.hypot(*np.subtract(places[source], places[target])))
        ctx.graph.graph.add_edge({"id": id, "source": source, "target": target, "length": length, **more})


def add_star(ctx, rays, **more):
    places = [(0.0, 0.0), *[(1000 * cos(2 * pi * ray / rays), 1000 * sin(2 * pi * ray / rays)) for ray in range(rays)]]
    ways = [(ends, ray) for ray in range(1, rays + 1) for ends in ((0, ray), (ray, 0))]
    add_roads(ctx, places, [(*ends, {name: of(ray) for name, of in more.items()}) for ends, ray in ways])


def length_of(isochrone):
    return shapely.union_all([shapely.LineString(line) for line in isochrone.lines]).length


@pytest.mark.parametrize("whole", [0, 1, 4])
@pytest.mark.parametrize("part", [0.0, 0.25])
def test_a_grid_is_reached_as_far_as_its_closed_form_says(world, whole, part):
    world.graph.attach_networkx_graph(gamms.graph.grid(11, 11, spacing=100.0))
    (found,) = world.graph.isochrone(60, 100.0 * (whole + part))
    assert length_of(found) == pytest.approx(100.0 * (4 * whole**2 + part * (8 * whole + 4)), abs=1e-9)
    ends = {(round(x, 9), round(y, 9)) for x, y in found.ends.tolist()}
    far = {abs(x - 500.0) + abs(y - 500.0) for x, y in ends}
    assert {round(one, 9) for one in far if one > 100.0 * whole} == ({100.0 * (whole + part)} if part else set())


@pytest.mark.parametrize(("rays", "area"), [(2, 2 * 300 * 20 + DISK), (4, 2 * (600 * 20 + DISK) - 20**2)])
def test_a_star_has_the_area_of_its_streets(world, rays, area):
    add_star(world, rays)
    (found,) = world.graph.isochrone(0, 300.0, width=WIDTH)
    assert found.polygon.area == pytest.approx(area, rel=1e-9)
    angles = [2 * pi * ray / rays for ray in range(rays)]
    assert found.ends == pytest.approx(np.array([(300 * cos(angle), 300 * sin(angle)) for angle in angles]), abs=1e-9)
    assert length_of(found) == pytest.approx(300 * rays, abs=1e-9)


def test_by_time_each_ray_is_reached_at_its_own_speed(world):
    add_star(world, 5, travel_time=lambda ray: 100.0 * ray)
    found = world.graph.isochrone(0, [20.0, 50.0, 150.0], weight="travel_time", width=WIDTH)
    for one in found:
        ahead = {part.edge // 2 + 1: part.end for part in one.parts if part.edge % 2 == 0}
        assert ahead == pytest.approx({ray: min(1.0, one.limit / (100 * ray)) for ray in range(1, 6)})
    back = [part for part in found[2].parts if part.edge == 1]  # from the end of the first ray back to the center
    assert back == [(1, 0.0, 0.5)]


def test_an_edge_is_a_source_in_both_directions_where_it_may_be_left_so(world):
    add_roads(world, [(0, 0), (100, 0), (200, 0)], [(0, 1, {}), (1, 0, {}), (1, 2, {}), (2, 1, {})])
    (found,) = world.graph.isochrone({"edge": 0, "share": 0.25}, [85.0])
    parts = [(0, 0.0, 1.0), (1, 0.0, 0.1), (1, 0.75, 1.0), (2, 0.0, 0.1)]
    assert np.array(found.parts) == pytest.approx(np.array(parts))
    assert length_of(found) == pytest.approx(110.0)
    world.graph.close_roads([1])
    (found,) = world.graph.isochrone({"edge": 0, "share": 0.25}, 85.0)
    assert np.array(found.parts) == pytest.approx(np.array([(0, 0.25, 1.0), (2, 0.0, 0.1)]))


def test_an_edge_may_be_reached_again_from_its_beginning(world):
    add_roads(world, [(0, 0), (100, 0), (100, 75)], [(0, 1, {}), (1, 2, {}), (2, 0, {})])
    rounds = world.graph.isochrone({"edge": 0, "share": 0.5}, [40.0, 275.0, 310.0])
    assert [[tuple(part) for part in one.parts if part.edge == 0] for one in rounds] == [
        [(0, 0.5, 0.9)],
        [(0, 0.0, pytest.approx(0.25)), (0, 0.5, 1.0)],
        [(0, 0.0, 1.0)],
    ]
    assert world.graph.isochrone({"edge": 0}, 10.0)[0].parts == [(0, 0.0, pytest.approx(0.1))]


@settings(max_examples=15, deadline=None)
@given(st.lists(st.tuples(st.integers(0, 5), st.integers(0, 5)), max_size=12), st.lists(st.integers(0, 99), min_size=2))
def test_greater_limits_hold_smaller_ones_and_the_nodes_that_routes_reach(ends, limits):
    places = [(0, 0), (30, 5), (60, 0), (0, 40), (33, 37), (61, 45)]
    with gamms.create_context(seed=1, logger_config={"level": "CRITICAL"}) as ctx:
        add_roads(ctx, places, [(*pair, {}) for pair in ends])
        limits = sorted(limits)
        found = ctx.graph.isochrone(0, limits, width=3.0)
        for one, nodes in zip(found, ctx.graph.routes.isochrones(0, limits), strict=True):
            targets = {ctx.graph.graph.get_edge(part.edge).target for part in one.parts if part.end == 1.0}
            assert targets | {0} == set(nodes.tolist())
        for one, next_one in pairwise(found):
            assert one.polygon.difference(next_one.polygon).area < 1e-6


def test_geojson_has_the_polygons_in_degrees(world, tmp_path):
    world.graph.attach_networkx_graph(gamms.graph.grid(3, 3, spacing=100.0))
    with pytest.raises(BadValue, match="GeoJSON needs degrees"):
        world.graph.isochrone(4, 50).to_geojson()
    columns = world.graph.columns()
    with gamms.create_context(seed=1) as ctx:
        graph = ctx.graph.graph
        graph.crs, graph.attribution = "EPSG:32635", "the surveyors"
        ctx.graph.add_nodes(columns.node_ids, *(columns.xy + np.array([385_000, 6_672_000])).T)
        ends = columns.node_ids[columns.sources], columns.node_ids[columns.targets]
        ctx.graph.add_edges(columns.edge_ids, *ends)
        found = ctx.graph.isochrone(4, [250, 50], width=WIDTH)
        written = json.loads(found.export(tmp_path / "reach.geojson").read_text(encoding="utf-8"))
        assert written["attribution"] == "the surveyors"
        assert [one["properties"] for one in written["features"]] == [
            {"limit": 250.0, "weight": "length"},
            {"limit": 50.0, "weight": "length"},
        ]
        for one, feature in zip(found, written["features"], strict=True):
            shape = shapely.geometry.shape(feature["geometry"])
            assert all(polygon.exterior.is_ccw for polygon in shape.geoms)
            lon, lat = shapely.get_coordinates(shape).T
            again = shapely.MultiPoint(np.column_stack(ctx.graph.from_latlon(lat=lat, lon=lon)))
            assert again.hausdorff_distance(shapely.MultiPoint(shapely.get_coordinates(one.polygon))) < 1e-3
        (block,) = shapely.geometry.shape(written["features"][0]["geometry"]).geoms
        assert len(block.interiors) == 4
        with pytest.raises(UnknownType, match=r"written as \.geojson, not as '\.gpkg'"):
            found.export(tmp_path / "reach.gpkg")


def test_a_picture_shows_the_polygons(world, tmp_path):
    world.graph.attach_networkx_graph(gamms.graph.grid(3, 3, spacing=100.0))
    reach = world.graph.isochrone(4, [50, 250], width=WIDTH)
    world.visual.add_artist("reach", {"drawer": reach.draw, "color": (200, 0, 0)})
    world.visual.save(tmp_path / "reach.svg")
    assert (tmp_path / "reach.svg").read_text().count("#c80000") == 4  # areas and outlines


@pytest.mark.parametrize(
    ("source", "limits", "more", "error", "message"),
    [
        (99, 10, {}, UnknownName, "99"),
        ({"edge": 99}, 10, {}, UnknownName, "Unknown edge 99"),
        ({"node": 0}, 10, {}, UnknownName, "Unknown key of a place on an edge 'node'"),
        ({"edge": 0, "share": 1.5}, 10, {}, BadValue, "share must be at most 1"),
        (0, -1, {}, BadValue, "A limit must not be negative"),
        (0, float("inf"), {}, BadValue, "finite"),
        (0, [], {}, BadValue, "one or more finite numbers"),
        (0, "ten", {}, BadType, "limits must be a list of numbers"),
        (0, 10, {"width": 0}, BadValue, "width must be positive"),
        (0, 10, {"width": 1e300}, BadValue, r"at most 1e\+09, not 1e\+300"),
        (0, 10, {"weight": "tarvel_time"}, UnknownName, "tarvel_time"),
    ],
)
def test_impossible_isochrones_are_refused(world, source, limits, more, error, message):
    world.graph.attach_networkx_graph(gamms.graph.grid(2, 2))
    with pytest.raises(error, match=message):
        world.graph.isochrone(source, limits, **more)


def test_the_isochrone_of_a_mode_has_the_edges_and_times_of_the_mode(world, tmp_path):
    slow = {"speed_kph": 5.0, "travel_time": 72.0, "travel_time:walk": 72.0, "walk": 5.0}
    fast = {"speed_kph": 5.0, "travel_time": 72.0, "travel_time:walk": 72.0, "walk": 5.0, "drive": 50.0}
    places = [(0.0, 0.0), (100.0, 0.0), (0.0, 100.0)]
    add_roads(world, places, [(0, 1, {**fast, "travel_time:drive": 7.2}), (0, 2, {**slow, "drive": 0.0})])
    (walked,) = world.graph.isochrone(0, 3.6, weight="travel_time", mode="walk")
    (driven,) = world.graph.isochrone(0, 3.6, weight="travel_time", mode={"attribute": "drive"})
    (every,) = world.graph.isochrone(0, 3.6, weight="travel_time")
    assert [(part.edge, part.end) for part in walked.parts] == [(0, 0.05), (1, 0.05)]
    assert [(part.edge, part.end) for part in driven.parts] == [(0, 0.5)]
    assert every.parts == walked.parts
    with pytest.raises(BadValue, match="Mode 'drive' may not use edge 1: start from a node or an edge of the mode"):
        world.graph.isochrone({"edge": 1}, 3.6, mode="drive")
    with pytest.raises(UnknownName, match="Unknown edge 99"):
        world.graph.isochrone({"edge": 99}, 3.6, mode="drive")
    world.graph.export(tmp_path / "cars.csv", mode="drive")
    with (tmp_path / "cars_edges.csv").open(newline="") as file:
        (car,) = csv.DictReader(file)
    assert (car["id"], car["speed_kph"], car["travel_time"]) == ("0", "50.0", "7.2")


@pytest.mark.parametrize(
    "name", ["cars.csv", "cars.gpkg", "cars.graphml", "cars.net.xml", "cars.geojson", "cars.osmnx.graphml"]
)
def test_a_file_of_a_mode_has_the_nodes_of_the_mode_only(world, tmp_path, name):
    places = [(0.0, 0.0), (100.0, 0.0), (0.0, 100.0), (100.0, 100.0)]
    add_roads(
        world, [(385_000.0 + x, 6_672_000.0 + y) for x, y in places], [(0, 1, {"drive": 0.0}), (1, 3, {"drive": 50.0})]
    )
    world.graph.graph.crs = "EPSG:32635"
    world.graph.graph.update_node({"id": 3, "signal": "red"})
    path = world.graph.export(tmp_path / name, mode="drive")[0]
    assert read_nodes(path) == {1: None, 3: "red"}


def read_nodes(path):
    """Return node -> its attribute `signal` in a file."""
    if path.suffix == ".csv":
        with path.open(newline="") as file:
            return {int(row["id"]): row["signal"] or None for row in csv.DictReader(file)}
    if path.suffix == ".gpkg":
        with closing(sqlite3.connect(path)) as database:
            return dict(database.execute("SELECT id, signal FROM nodes"))
    if path.suffix == ".graphml":
        return {int(node): data.get("signal") for node, data in nx.read_graphml(path).nodes(data=True)}
    if path.suffix == ".xml":
        junctions = {int(one.get("id")) for one in ET.parse(path).iter("junction")}
        return {node: {3: "red"}.get(node) for node in junctions}  # SUMO knows no attributes of junctions
    points = (
        one["properties"] for one in json.loads(path.read_text())["features"] if one["geometry"]["type"] == "Point"
    )
    return {one["id"]: one.get("signal") for one in points}


def test_the_error_for_a_time_of_a_mode_says_where_the_time_may_be(world):
    places = [(0.0, 0.0), (100.0, 0.0)]
    add_roads(world, places, [(0, 1, {"drive": 50.0, "travel_time": 9.0, "travel_time:drive": "long"})])
    with pytest.raises(BadType, match="'travel_time' of edge 0 must be a number, not 'long'") as caught:
        world.graph.isochrone(0, 3.6, weight="travel_time", mode="drive")
    assert caught.value.__notes__ == ["For agents of a mode, 'travel_time:drive' replaces 'travel_time'."]
