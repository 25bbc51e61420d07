"""Streets and junctions by name, what lies in a polygon, and roads that are closed and opened again."""

import pickle
from copy import deepcopy

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

import gamms
from gamms.errors import BadFile, BadType, BadValue, DuplicateId, IllegalMutation, UnknownName


@pytest.fixture
def town():
    """Streets, 100 apart; High Street is node 0 to 3, Park Road 1, 4 and 5, Ö Street 6 and 7, 20 from node 3."""
    ctx = gamms.create_context(seed=1, logger_config={"level": "CRITICAL"})
    places = [(0, 0), (100, 0), (200, 0), (300, 0), (100, 100), (100, 200), (320, 0), (420, 0)]
    ctx.graph.add_nodes(range(8), *np.array(places, float).T)
    ways = [
        (0, 1, "High Street"),
        (1, 2, "High Street"),
        (2, 3, "High Street"),
        (1, 4, "Park Road"),
        (4, 5, "Park Road"),
    ]
    ways += [(6, 7, ["Ö Street", "Oe Way"]), (2, 4, None), (3, 6, 5)]
    for id, (source, target, name) in enumerate(ways):
        named = {} if name is None else {"name": name}
        ctx.graph.graph.add_edge({"id": 10 + id, "source": source, "target": target, "length": 100.0, **named})
    ctx.graph.graph.update_edge({"id": 16, "linestring": [(200, 0), (250, 50), (100, 100)]})
    with ctx:
        yield ctx


# -- by name ----------------------------------------------------------------------------------------------------


def test_a_street_is_found_by_its_name(town):
    found = town.graph.find("  high STREET")
    assert (found.name, found.nodes, found.edges) == ("High Street", [0, 1, 2, 3], [10, 11, 12])
    assert found.node in (1, 2)
    assert [town.graph.find(name).edges for name in ("o street", "OE WAY")] == [[15], [15]]


def test_the_junction_of_two_streets_is_the_node_that_they_share(town):
    found = town.graph.find("Park Road & High Street")
    assert (found.name, found.nodes, found.node) == ("Park Road & High Street", [1], 1)
    assert found.edges == [10, 11, 13]


def test_streets_that_nearly_meet_have_a_junction_of_two_nodes(town):
    assert town.graph.find("High Street & Ö Street").nodes == [3, 6]


def test_streets_that_do_not_meet_are_an_error_that_says_what_the_first_one_meets(town):
    with pytest.raises(
        BadValue, match=r"do not meet: they are 220 apart at nodes 1 and 6\. Park Road meets High Street\."
    ):
        town.graph.find("Park Road & Ö Street")
    with pytest.raises(BadValue, match="do not all meet at one node"):
        town.graph.find("Park Road & High Street & Ö Street")


def test_streets_that_meet_twice_have_two_candidates(town):
    town.graph.graph.add_edge({"id": 30, "source": 5, "target": 3, "length": 1.0, "name": "Park Road"})
    found = town.graph.find("High Street & Park Road")
    assert found.nodes == [1, 3]
    with pytest.raises(BadValue, match=r"is at 2 places: node 1 at \(100, 0\), node 3 at \(300, 0\)"):
        _ = found.node


def test_names_that_are_not_there_bring_those_that_are_spelt_alike(town):
    for text in ("Hihg Street", "Hihg Street & Park Road"):
        with pytest.raises(UnknownName, match="Did you mean 'High Street'"):
            town.graph.find(text)
    with pytest.raises(UnknownName, match="Park Road"):
        town.graph.find("zzz")
    with pytest.raises(BadValue, match="200 characters"):
        town.graph.find("x" * 201)
    with pytest.raises(BadType):
        town.graph.find(7)
    town.graph.graph.clear()
    with pytest.raises(BadValue, match="No edge of this graph has a name"):
        town.graph.find("High Street")


def test_a_name_with_an_ampersand_is_a_street_first(town):
    town.graph.graph.update_edge({"id": 16, "name": "Park Road & High Street"})
    assert town.graph.find("park road & high street").edges == [16]


def test_names_follow_the_graph(town):
    assert town.graph.find("Park Road").edges == [13, 14]
    town.graph.graph.remove_edge(13)
    assert town.graph.find("Park Road").edges == [14]


# -- by area ----------------------------------------------------------------------------------------------------


def test_bounds_hold_nodes_and_polylines(town):
    assert town.graph.bounds == (0.0, 0.0, 420.0, 200.0)
    town.graph.graph.update_edge({"id": 16, "linestring": [(200, 0), (250, 950), (100, 100)]})
    assert town.graph.bounds == (0.0, 0.0, 420.0, 950.0)
    town.graph.graph.clear()
    with pytest.raises(BadValue, match="no nodes"):
        _ = town.graph.bounds


def test_an_edge_lies_in_a_polygon_with_all_of_its_polyline(town):
    square = [(50, -10), (210, -10), (210, 110), (50, 110)]
    assert town.graph.inside(square) == ([1, 2, 4], [11, 13])
    assert town.graph.inside(square, touching=True) == ([1, 2, 4], [10, 11, 12, 13, 14, 16])
    assert town.graph.inside(shapely.Polygon(square)) == town.graph.inside(square)
    assert town.graph.inside([(50, 50), (60, 50), (60, 60)]) == ([], [])


def test_holes_and_several_parts_count(town):
    outer, hole = [(50, -10), (210, -10), (210, 110), (50, 110)], [(90, 90), (110, 90), (110, 110), (90, 110)]
    far = shapely.box(400, -10, 430, 10)
    region = shapely.MultiPolygon([shapely.Polygon(outer).difference(shapely.Polygon(hole)), far])
    assert town.graph.inside(region).nodes == [1, 2, 7]


def test_geojson_counts_in_degrees():
    with gamms.create_context(logger_config={"level": "CRITICAL"}) as ctx:
        ctx.graph.graph.crs = "EPSG:32635"
        xy = np.array([(385_000.0, 6_672_000.0), (385_500.0, 6_672_000.0), (386_000.0, 6_672_000.0)])
        ctx.graph.add_nodes(range(3), *xy.T)
        lat, lon = ctx.graph.to_latlon(*(xy[1] + [[-200, -200], [200, -200], [200, 200], [-200, 200]]).T)
        ring = np.column_stack((lon, lat)).tolist()
        polygon = {"type": "Polygon", "coordinates": [[*ring, ring[0]]]}
        feature = {"type": "Feature", "properties": {}, "geometry": polygon}
        several = {"type": "MultiPolygon", "coordinates": [polygon["coordinates"]]}
        for shape in (polygon, feature, several, {"type": "FeatureCollection", "features": [feature, feature]}):
            assert ctx.graph.inside(shape).nodes == [1]
        ctx.graph.graph.crs = None
        with pytest.raises(BadValue, match=r"set graph\.crs"):
            ctx.graph.inside(polygon)


@given(points=st.lists(st.tuples(st.floats(0, 420), st.floats(0, 200)), min_size=1, max_size=20), data=st.data())
def test_nodes_in_a_triangle_equal_those_by_half_planes(points, data):
    corners = np.array(data.draw(st.lists(st.tuples(st.integers(0, 420), st.integers(0, 200)), min_size=3, max_size=3)))
    (ax, ay), (bx, by), (cx, cy) = corners.tolist()
    if (area := (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)) == 0:
        return
    ctx = gamms.create_context(logger_config={"level": "CRITICAL"})
    xy = np.array(points)
    ctx.graph.add_nodes(range(len(xy)), *xy.T)
    sides = [(b - a, xy - a) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)]
    cross = np.stack([side[0] * off[:, 1] - side[1] * off[:, 0] for side, off in sides]) * np.sign(area)
    clear = np.abs(cross).min(axis=0) > 1e-6
    found = np.isin(np.arange(len(xy)), ctx.graph.inside(corners.tolist()).nodes)
    assert (found == (cross > 0).all(axis=0))[clear].all()


@pytest.mark.parametrize(
    "shape",
    [
        None,
        "text",
        7,
        [],
        [(0, 0), (1, 1)],
        [(0, 0), (1, 1), (0, 1), (1, 0)],
        [(0, 0), (1, 0), (float("nan"), 1)],
        {},
        {"type": "Point", "coordinates": [0, 0]},
        {"type": "Polygon", "coordinates": []},
        {"type": "Polygon", "coordinates": [7]},
        {"type": "Polygon", "coordinates": 7},
        {"type": "MultiPolygon", "coordinates": [[]]},
        {"type": "FeatureCollection", "features": [7]},
        {"type": "Feature", "geometry": None},
        shapely.Point(0, 0),
        shapely.Polygon(),
    ],
    ids=repr,
)
def test_an_invalid_polygon_is_refused(town, shape):
    with pytest.raises(BadValue):
        town.graph.inside(shape)


# -- closed roads -----------------------------------------------------------------------------------------------


def test_roads_are_closed_where_an_area_touches_them(town):
    square = [(90, 40), (110, 40), (110, 60), (90, 60)]
    assert town.graph.close_roads(inside=square) == [13]
    assert town.graph.close_roads(name="High Street", inside=[(50, -10), (60, -10), (60, 300), (50, 300)]) == [10]
    assert town.graph.close_roads(inside=[(1000, 0), (1001, 0), (1001, 1)]) == []
    assert town.graph.open_roads(name="high street") == [10]


def test_edges_that_cannot_be_closed_or_opened_change_nothing(town):
    town.graph.close_roads([13])
    for call, error in [
        (town.graph.close_roads, BadValue),
        (lambda: town.graph.close_roads([10, 99]), UnknownName),
        (lambda: town.graph.close_roads([13]), UnknownName),
        (lambda: town.graph.close_roads(name="Nowhere"), UnknownName),
        (lambda: town.graph.open_roads([13, 10]), UnknownName),
        (lambda: town.graph.open_roads(name="High Street"), UnknownName),
    ]:
        revision = town.graph.graph.revision
        with pytest.raises(error):
            call()
        assert (town.graph.graph.revision, town.graph.closed_roads) == (revision, [13])
    town.graph.graph.add_edge({"id": 13, "source": 0, "target": 5, "length": 1.0})
    with pytest.raises(DuplicateId):
        town.graph.open_roads()
    assert town.graph.closed_roads == [13]


def test_a_road_to_a_node_that_was_removed_cannot_be_opened(town):
    town.graph.close_roads(name="Park Road")
    town.graph.graph.remove_node(5)
    assert town.graph.closed_roads == [13]


def test_closed_roads_are_in_saved_maps_and_copies(town, tmp_path):
    town.graph.close_roads([16, 13])
    town.graph.save(tmp_path / "map.gamms")
    with gamms.create_context(logger_config={"level": "CRITICAL"}) as ctx:
        ctx.graph.load(tmp_path / "map.gamms")
        for graph in (ctx.graph, town.graph):
            assert graph.open_roads() == [13, 16]
        assert ctx.graph.graph.get_edge(16) == town.graph.graph.get_edge(16)
        assert ctx.graph.edge_attributes(13) == {"name": "Park Road"}
    store = town.graph._store
    town.graph.close_roads([13])
    assert pickle.loads(pickle.dumps(store)).closed == deepcopy(store).closed == store.closed


def test_a_saved_map_with_closed_roads_that_are_none_is_refused(town):
    town.graph.close_roads([13])
    contents = town.graph.storage.get_contents()
    from gamms.graph import map_file

    bad = [{"length": -1.0}, {"source": "a"}, {"id": None}, {"linestring": [(0, 0)]}, {5: 1}]
    for change in bad:
        data = map_file.encode(contents._replace(closed={13: {**contents.closed[13], **change}}))
        with pytest.raises(BadFile):
            map_file.decode(data)


def test_strategies_cannot_close_roads(town):
    def strategy(state):
        town.graph.close_roads([10])

    town.agent.create_agent("a", start_node_id=0, strategy=strategy)
    with pytest.raises(IllegalMutation):
        town.game.step()
