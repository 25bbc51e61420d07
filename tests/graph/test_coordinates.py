"""Places on the globe and on the map: degrees and back, the nearest node, and nodes drawn at random."""

import hashlib
import math
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gamms.errors import BadType, BadValue, MissingExtra
from gamms.graph import Graph
from gamms.ir import projection

ZONES = {
    "EPSG:32635": (60.17, 24.94),  # Helsinki
    "EPSG:32632": (43.73, 7.42),  # Monaco
    "EPSG:32734": (-33.92, 18.42),  # Cape Town
    "EPSG:32719": (-33.45, -70.66),  # Santiago
    "EPSG:32601": (52.0, -179.9),  # beside the date line
    "EPSG:32660": (-16.5, 179.99),  # and a northern zone used south of the equator
    "EPSG:3067": (65.0, 26.0),  # Finland
    "EPSG:3857": (40.7, -74.0),  # the web's Mercator
    "EPSG:4326": (10.0, 20.0),  # degrees: x is the longitude
}


def cloud(xy, crs=None):
    graph = Graph()
    graph.add_nodes(range(100, 100 + len(xy)), *np.asarray(xy, float).reshape(-1, 2).T)
    graph.crs = crs
    return graph


@pytest.fixture
def helsinki():
    return cloud([(385_000, 6_672_000), (386_000, 6_672_000), (386_000, 6_673_000)], "EPSG:32635")


def test_degrees_off_the_map_have_no_nearest_node(helsinki):
    lat, lon = helsinki.to_latlon(385_500, 6_672_500)
    assert helsinki.nearest_node(lat=lat, lon=lon) in (100, 101, 102)
    assert helsinki.nearest_node(lat=lat, lon=lon + 0.02) == 101  # 1.1 km east of it, and the map is 1.4 km wide
    for far, km in (((61.5, 23.8), "159"), ((48.1, 24.9), "1,34")):
        with pytest.raises(BadValue, match=rf"is {km}.* km from the nearest node: the map reaches from lat=60\.1"):
            helsinki.nearest_node(lat=far[0], lon=far[1])
    with pytest.raises(BadValue, match=r"lat=61\.5, lon=23\.8 is"):
        helsinki.nearest_node(lat=[lat, 61.5], lon=[lon, 23.8])
    assert helsinki.nearest_node(0, 0) == 100


def test_places_beyond_a_distance_of_the_caller_have_no_nearest_node(helsinki):
    assert helsinki.nearest_node(385_000, 6_672_100, within=100.0) == 100
    with pytest.raises(BadValue, match=r"\(385000, 6672100\) is 100\.0 from the nearest node, .* more than 99"):
        helsinki.nearest_node([385_000, 385_000], [6_672_000, 6_672_100], within=99)
    lat, lon = helsinki.to_latlon(385_500, 6_672_000)
    with pytest.raises(BadValue, match=r"is 500\.0 from the nearest node"):
        helsinki.nearest_node(lat=lat, lon=lon, within=400.0)
    assert helsinki.nearest_node(lat=61.5, lon=23.8, within=math.inf) in (100, 101, 102)
    with pytest.raises(BadValue, match="within"):
        helsinki.nearest_node(0, 0, within=-1.0)


@pytest.mark.parametrize("crs", sorted(ZONES))
def test_near_a_single_node_degrees_find_it(crs):
    lat, lon = ZONES[crs]
    graph = cloud([Graph.from_latlon(cloud([], crs), lat=lat, lon=lon)], crs)
    assert graph.nearest_node(lat=lat + 0.005, lon=lon) == 100
    with pytest.raises(BadValue, match="km from the nearest node"):
        graph.nearest_node(lat=lat + 0.02, lon=lon)


# -- degrees ----------------------------------------------------------------------------------------------------


@given(crs=st.sampled_from(sorted(ZONES)), north=st.floats(-2.0, 2.0), east=st.floats(-2.0, 2.0))
def test_degrees_lead_back_to_a_centimetre(crs, north, east):
    lat, lon = ZONES[crs][0] + north, ZONES[crs][1] + east
    graph = cloud([], crs)
    again = graph.to_latlon(*graph.from_latlon(lat=lat, lon=lon))
    assert projection.measure_on_ellipsoid(np.array([[lon, lat]]), np.array([again[::-1]]))[0] < 0.01


@given(crs=st.sampled_from(sorted(set(ZONES) - {"EPSG:4326"})), right=st.floats(-5e4, 5e4), up=st.floats(-5e4, 5e4))
def test_map_units_lead_back_to_a_centimetre(crs, right, up):
    graph = cloud([], crs)
    x, y = graph.from_latlon(lat=ZONES[crs][0], lon=ZONES[crs][1])
    lat, lon = graph.to_latlon(x + right, y + up)
    assert math.dist(graph.from_latlon(lat=lat, lon=lon), (x + right, y + up)) < 0.01


def test_degrees_are_those_of_the_map(helsinki):
    x, y = helsinki.from_latlon(lat=60.17, lon=24.94)
    assert (x, y) == pytest.approx((385700.42, 6672126.74), abs=0.01)
    assert (type(x), type(y)) == (float, float)


def test_without_a_crs_degrees_mean_nothing():
    graph = cloud([(0, 0)])
    calls = [
        lambda: graph.to_latlon(0, 0),
        lambda: graph.from_latlon(lat=0, lon=0),
        lambda: graph.nearest_node(lat=0, lon=0),
    ]
    for call in calls:
        with pytest.raises(BadValue, match=r"set graph\.crs"):
            call()


@pytest.mark.parametrize(
    ("lat", "lon", "hint"),
    [
        (24.94, 60.17, "order of the coordinates"),  # swapped
        (60.0, -100.0, "outside the area"),
        (60.0, 40.1, "outside the area"),  # the zone ends at 30 degrees, and may be left by ten
        (0.0, 117.0, "outside the area"),
        (91.0, 25.0, "lat must lie between -90 and 90"),
        (60.0, 400.0, "lon must lie between -360 and 360"),
        (math.nan, 25.0, "lat must be finite"),
        ([60.0, 61.0], 25.0, "two arrays of one length"),
        ([[60.0]], [[25.0]], "two arrays of one length"),
    ],
)
def test_degrees_outside_the_projection_are_refused(helsinki, lat, lon, hint):
    with pytest.raises(BadValue, match=hint):
        helsinki.from_latlon(lat=lat, lon=lon)
    with pytest.raises(BadValue, match=hint):
        helsinki.nearest_node(lat=lat, lon=lon)


def test_degrees_beside_the_zone_are_projected(helsinki):
    for lon in (14.1, 39.9):
        assert helsinki.to_latlon(*helsinki.from_latlon(lat=60.0, lon=lon)) == pytest.approx((60.0, lon))


@pytest.mark.parametrize(("x", "y"), [(1e9, 1e9), (1e300, 0.0), (-3e6, 6e6), (math.inf, 0.0), (0.0, math.nan)])
def test_map_units_outside_the_projection_are_refused(helsinki, x, y):
    with pytest.raises(BadValue):
        helsinki.to_latlon(x, y)


@pytest.mark.parametrize("value", ["60", None, True, [1, "a"], [[1], [1, 2]]])
def test_an_invalid_number_is_refused(helsinki, value):
    with pytest.raises(BadType):
        helsinki.to_latlon(value, 0.0)


@pytest.mark.parametrize("crs", ["nonsense", "EPSG:0"])
def test_a_crs_that_is_none_is_named(crs):
    with pytest.raises(BadValue, match=crs):
        cloud([], crs).to_latlon(0.0, 0.0)


def test_without_pyproj_the_error_prints_the_command(monkeypatch):
    monkeypatch.setitem(sys.modules, "pyproj", None)
    with pytest.raises(MissingExtra, match=r"other than UTM zones.*extra .osm.*pip install .*pyproj"):
        cloud([], "EPSG:31256").to_latlon(0.0, 0.0)


@pytest.mark.parametrize("crs", ["EPSG:32635", "EPSG:32701", "EPSG:32660", "EPSG:25832", "EPSG:25828", "EPSG:3067"])
def test_zones_of_utm_agree_with_pyproj_and_do_without_it(crs, monkeypatch):
    pyproj, rng = pytest.importorskip("pyproj"), np.random.default_rng(1)
    west, _, east, _ = pyproj.CRS(crs).area_of_use.bounds
    lonlat = np.column_stack((rng.uniform(west - 9.0, east + 9.0, 5_000), rng.uniform(-84.0, 84.0, 5_000)))
    known = np.column_stack(pyproj.Transformer.from_crs("EPSG:4326", crs, always_xy=True).transform(*lonlat.T))
    monkeypatch.setitem(sys.modules, "pyproj", None)
    assert np.abs(projection.project(lonlat, projection.WGS84, crs) - known).max() < 1e-6  # metres
    again = projection.project(known, crs, projection.WGS84)
    assert np.abs((again - lonlat + 180.0) % 360.0 - 180.0).max() < 1e-12  # degrees


def test_zones_of_utm_and_lengths_have_the_same_bits_on_every_machine():
    steps = np.arange(5_000)
    lonlat = np.column_stack((steps * 7919 % 18_000 / 1_000.0 + 18.0, steps * 104_729 % 168_000 / 1_000.0 - 84.0))
    xy = projection.project(lonlat, projection.WGS84, "EPSG:32635")
    again = projection.project(xy, "EPSG:32635", projection.WGS84)
    lengths = projection.measure_on_ellipsoid(lonlat[1:], lonlat[:-1])
    bits = b"".join(np.ascontiguousarray(one, "<f8").tobytes() for one in (xy, again, lengths))
    assert hashlib.sha256(bits).hexdigest()[:16] == "2bb181c0ec08571d"


def test_coordinates_of_one_zone_become_those_of_its_neighbor_without_pyproj(monkeypatch):
    monkeypatch.setitem(sys.modules, "pyproj", None)
    lonlat = np.array([(29.9, 60.2), (30.1, -12.0)])
    there, beside = (projection.project(lonlat, projection.WGS84, crs) for crs in ("EPSG:32635", "EPSG:32636"))
    assert np.abs(projection.project(there, "EPSG:32635", "EPSG:32636") - beside).max() < 1e-6  # metres


HELSINKI = np.array([(24.93, 60.16), (24.95, 60.18)])  # degrees


@pytest.mark.parametrize(
    ("crs", "scale"),
    [
        ("EPSG:32635", 1.0),
        ("EPSG:3067", 1.0),
        ("EPSG:3035", 1.0),  # Europe, equal area
        ("EPSG:3857", 0.4984),
        (3857, 0.4984),
        ("3857", 0.4984),
        ("ESRI:102100", 0.4984),
        ("ESRI:54009", 1.2021),  # Mollweide
        ("EPSG:32637", 0.993),  # two zones away
        ("EPSG:32643", 0.9247),  # eight zones away
    ],
)
def test_the_scale_of_a_crs_is_that_of_its_place(crs, scale):
    pyproj = pytest.importorskip("pyproj")
    to_map = pyproj.Transformer.from_crs("EPSG:4326", pyproj.CRS.from_user_input(crs), always_xy=True)
    xy = np.column_stack(to_map.transform(*HELSINKI.T))
    found = projection.compute_ground_scale(projection.parse_crs(crs)[0], xy)
    assert found == pytest.approx(scale, abs=0.002)
    assert ("is not true to scale at this map" in projection.scale_fault(crs, xy)) == (abs(scale - 1.0) > 0.01)


def test_far_outside_of_a_projection_nothing_is_true():
    far = np.array([(1e9, 0.0), (1e9, 100.0)])
    assert math.isnan(projection.compute_ground_scale("EPSG:32635", far))
    assert "outside of its area" in projection.scale_fault("EPSG:32635", far)


def test_a_crs_in_feet_has_no_metres_and_an_unknown_one_is_not_judged():
    xy = np.array([(0.0, 0.0), (100.0, 100.0)])
    assert "US survey foot" in projection.scale_fault("EPSG:2263", xy)
    for unknown in (None, "moon", "EPSG:4326", 'LOCAL_CS["site",UNIT["metre",1]]'):
        assert projection.scale_fault(unknown, xy) == ""
    assert projection.scale_fault("EPSG:3857", xy[:0]) == ""


def test_without_pyproj_only_zones_of_utm_are_judged(monkeypatch):
    monkeypatch.setitem(sys.modules, "pyproj", None)
    xy = np.array([(2_776_308.0, 8_437_000.0)])
    assert projection.scale_fault("EPSG:3857", xy) == ""
    assert projection.scale_fault("epsg:32635", xy[:, ::-1] * 10) != ""


@pytest.mark.parametrize("crs", ["EPSG:32635", "epsg:32635", 32635, "32635", " EPSG : 32635 "])
def test_a_zone_has_one_name_however_it_is_written(crs, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyproj", None)
    assert projection.parse_crs(crs) == ("EPSG:32635", False)
    assert projection.parse_crs("epsg:4326") == projection.parse_crs(4326) == ("EPSG:4326", True)
    graph = Graph()
    graph.crs = str(crs)
    assert graph.crs == "EPSG:32635"


def test_a_crs_with_false_metres_is_warned_about(caplog, tmp_path, open_ctx):
    ctx = open_ctx()
    caplog.set_level("WARNING", "gamms")
    ctx.graph.graph.add_nodes([0, 1], [2_776_308.0, 2_777_308.0], [8_437_000.0, 8_437_000.0])
    ctx.graph.graph.crs = "EPSG:32635"
    assert "not true to scale" in caplog.text  # so far east it is none of this zone
    caplog.clear()
    ctx.graph.graph.crs = "EPSG:3857"
    assert "1 m of it is 0.498 m on the ground" in caplog.text
    ctx.graph.save(tmp_path / "town.gamms")
    caplog.clear()
    ctx.graph.load(tmp_path / "town.gamms")
    assert "town.gamms: EPSG:3857 is not true to scale" in caplog.text
    assert ctx.graph.crs == "EPSG:3857"
    ctx.terminate()


def test_the_length_between_opposite_sides_of_the_globe_is_about_half_its_circumference():
    ends = [np.array([[0.0, lat], [20.0, -lat]]) for lat in (0.3, 40.0)]
    found = np.concatenate([projection.measure_on_ellipsoid(a, a * (1, -1) + (180.0, 0.0)) for a in ends])
    assert np.abs(found / 20_003_931.0 - 1.0).max() < 0.01


@pytest.mark.parametrize("crs", ["EPSG:31256", "EPSG:27700", "EPSG:5514"])
def test_national_grids_take_all_places_of_their_country(crs):
    area, rng = pytest.importorskip("pyproj").CRS(crs).area_of_use, np.random.default_rng(3)
    lat, lon = rng.uniform(area.south, area.north, 300), rng.uniform(area.west, area.east, 300)
    graph = cloud([], crs)
    again = graph.to_latlon(*graph.from_latlon(lat=lat, lon=lon))
    pairs = [np.column_stack(ends[::-1]) for ends in ((lat, lon), again)]
    assert projection.measure_on_ellipsoid(*pairs).max() < 0.01


# -- the nearest node -------------------------------------------------------------------------------------------

NUMBER = st.integers(-9, 9).map(float) | st.floats(-1e3, 1e3) | st.sampled_from([1e15, -1e200, 1e-200])
POINT = st.tuples(NUMBER, NUMBER)


@given(points=st.lists(POINT, min_size=1, max_size=30), place=POINT, gone=st.sets(st.integers(0, 29), max_size=5))
def test_the_nearest_node_equals_brute_force(points, place, gone):
    graph = cloud(points)
    graph.nearest_node(0.0, 0.0)  # an index is there before the edits
    for row in sorted(gone & set(range(1, len(points)))):
        graph.remove_node(100 + row)
    graph.update_node({"id": 100, "x": points[0][1]})
    graph.add_node({"id": 5, "x": points[0][0], "y": points[-1][1]})
    ids = list(graph.get_nodes())
    dx, dy = (graph.positions(ids) - place).T
    with np.errstate(over="ignore", under="ignore"):
        squares = dx * dx + dy * dy
    is_there = (dx == 0.0) & (dy == 0.0)
    distances = squares if 1e-300 < squares.min() < 1e300 else np.hypot(dx, dy)
    assert graph.nearest_node(*place) == ids[int(np.argmin(np.where(is_there, -1.0, distances)))]


def test_of_equally_near_nodes_the_first_one_counts():
    graph = cloud([(1, 0), (-1, 0), (1, 0), (0, 1)])
    assert graph.nearest_node(0, 0) == 100
    graph.remove_node(100)
    assert graph.nearest_node(0, 0) == 101


def test_the_nearest_node_may_be_asked_for_in_degrees(helsinki):
    lat, lon = helsinki.to_latlon([385_100, 385_900], [6_672_000, 6_673_100])
    assert helsinki.nearest_node(lat=lat, lon=lon).tolist() == [100, 102]
    nearest = helsinki.nearest_node(lat=lat[0], lon=lon[0])
    assert (nearest, type(nearest)) == (100, int)


@pytest.mark.parametrize("given", [{}, {"x": 1}, {"lat": 1}, {"x": 1, "y": 1, "lat": 1}, {"x": 1, "lon": 1}])
def test_a_place_is_one_complete_pair(helsinki, given):
    with pytest.raises(BadType, match="nearest_node"):
        helsinki.nearest_node(**given)


def test_in_an_empty_graph_nothing_is_nearest():
    with pytest.raises(BadValue, match="no nodes"):
        Graph().nearest_node(0, 0)


# -- drawing nodes ----------------------------------------------------------------------------------------------


@given(
    n=st.integers(0, 12),
    radius=st.none() | st.floats(0, 9) | st.just(math.inf),
    apart=st.floats(0, 4) | st.just(1.0),
    seed=st.integers(0, 9),
)
def test_placed_nodes_keep_the_requested_attributes(n, radius, apart, seed):
    graph = cloud([(i % 7, i // 7) for i in range(49)])
    graph.remove_node(124)
    near = None if radius is None else (2.5, 3)
    try:
        ids = graph.place(n, near=near, radius=radius, apart=apart, rng=seed)
    except BadValue:
        return  # too many; the next tests say when
    assert len(set(ids)) == n
    assert ids == graph.place(n, near=near, radius=radius, apart=apart, rng=seed)
    places = [tuple(graph.get_node(id))[1:] for id in ids]
    assert all(math.dist(one, near) <= radius for one in places if near)
    assert all(math.dist(one, other) >= apart for one in places for other in places if one is not other)


@pytest.mark.parametrize(
    ("demand", "hint"),
    [
        ({"n": 11}, "Only 10 of 11 nodes could be placed; ask for fewer"),
        ({"n": 3, "apart": 9}, "Only 2 of 3 nodes could be placed at least 9 apart; ask for fewer or a smaller apart"),
        ({"n": 4, "near": 100, "radius": 2}, "Only 3 of 4 .* within 2 of .0, 0.; ask for fewer or a larger radius"),
        ({"n": 1, "near": (0, 50), "radius": 2}, "Only 0 of 1"),
        ({"n": -1}, "n must not be negative"),
        ({"n": 1, "apart": -1}, "apart must not be negative"),
        ({"n": 1, "near": 100, "radius": -1}, "radius must not be negative"),
        ({"n": 1, "near": 100, "radius": math.nan}, "radius must be finite"),
        ({"n": 1, "near": 100}, "near= without radius="),
        ({"n": 1, "radius": 5}, "radius= without near="),
    ],
)
def test_an_impossible_demand_names_the_possible_values(demand, hint):
    graph = cloud([(i, 0) for i in range(10)])
    with pytest.raises(BadValue, match=hint):
        graph.place(**demand, rng=4)


@pytest.mark.parametrize(
    "demand",
    [{"n": 1.5}, {"n": "2"}, {"near": "a", "radius": 1}, {"near": (1,), "radius": 1}, {"rng": "x"}, {"rng": 0.5}],
)
def test_an_argument_of_the_wrong_type_is_refused(demand):
    graph = cloud([(i, 0) for i in range(10)])
    with pytest.raises(TypeError):
        graph.place(**{"n": 1, "rng": 1, **demand})


def test_an_unknown_node_to_be_near_to_is_named():
    with pytest.raises(KeyError, match="7"):
        cloud([(0, 0)]).place(1, near=7, radius=1, rng=1)


def test_chance_must_come_from_somewhere():
    with pytest.raises(BadType, match="rng="):
        cloud([(0, 0)]).place(1)


def test_a_generator_is_used_on():
    graph, rng = cloud([(i, 0) for i in range(50)]), np.random.default_rng(1)
    assert graph.place(20, rng=rng) != graph.place(20, rng=rng)


def test_a_seeded_context_places_the_same_nodes_again(open_ctx):
    drawn = []
    for seed in (1, 1, 2):
        with open_ctx(seed=seed) as ctx:
            ctx.graph.add_nodes(range(99), range(99), [0] * 99)
            drawn.append([ctx.graph.place(9), ctx.graph.place(9)])
    assert drawn[0] == drawn[1]
    assert drawn[0] != drawn[2]
    assert drawn[0][0] != drawn[0][1]


def test_the_engine_forwards_to_the_graph(ctx):
    ctx.graph.add_nodes([1, 2], [385_000, 386_000], [6_672_000, 6_672_000])
    ctx.graph.graph.crs = "EPSG:32635"
    lat, lon = ctx.graph.to_latlon(386_000, 6_672_000)
    assert ctx.graph.from_latlon(lat=lat, lon=lon) == pytest.approx((386_000, 6_672_000), abs=0.01)
    assert ctx.graph.nearest_node(lat=lat, lon=lon) == ctx.graph.nearest_node(385_999, 0) == 2
    assert ctx.graph.place(1, near=2, radius=1, rng=ctx.rng) == [2]
