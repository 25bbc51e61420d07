"""Speeds and times under OSMnx's names, on every edge of every loader."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import gamms
from gamms.osm import graph_from_file, graph_from_xml, modes
from gamms.osm.speeds import SPEED_OF_HIGHWAY_KPH, UNKNOWN_SPEED_KPH, compute_speed_kph


@pytest.mark.parametrize(
    ("maxspeed", "kph"),
    [
        ("50", 50.0),
        (" 50 km/h", 50.0),
        ("50kmh", 50.0),
        ("30 mph", 48.28032),
        ("30mph", 48.28032),
        ("7.5", 7.5),
        ("10 knots", 18.52),
        ("FI:urban", 50.0),
        ("DE:rural", 80.0),
        ("DE:zone:30", 30.0),
        ("DE:zone30", 30.0),
        ("walk", 5.0),
        ("RO:urban", 50.0),
        ("ro: Urban", 50.0),
        ("GB:nsl_restricted", 48.28032),
        ("50;30", 40.0),
        ("50; 30 ;", 40.0),
        ("50|30", 40.0),
        ("50,30", 40.0),
        ("50, 30", 40.0),
        ("30,5", 30.5),
        ("30,5 mph", 30.5 * 1.609344),
        ("30-50", 40.0),
        ("30 \u2013 50 mph", 40.0 * 1.609344),
        ("5 knots", 9.26),
        ("5 Kn", 9.26),
        ("30 MPH", 48.28032),
        ("30 km / h", 30.0),
        ("30 km/h.", 30.0),
        ("10 m/s", 36.0),
        ("['50', '30 mph']", (50.0 + 48.28032) / 2),
        ("['30,5']", 30.5),
        ("[50, 30]", 40.0),
        (["50", "30 mph"], (50.0 + 48.28032) / 2),
        ("50;signals", 50.0),
        (60, 60.0),
        (60.5, 60.5),
    ],
)
def test_a_sign_is_read(maxspeed, kph):
    assert compute_speed_kph({"highway": "service", "maxspeed": maxspeed}) == pytest.approx(kph)


@pytest.mark.parametrize("key", ["zone:maxspeed", "maxspeed:type", "source:maxspeed", "zone:traffic"])
@pytest.mark.parametrize(
    ("value", "kph"),
    [
        ("DE:urban", 50.0),
        ("DE:30", 30.0),
        ("DE:zone:20", 20.0),
        ("DE:zone30", 30.0),
        ("30", 30.0),
        ("GB:20", 32.18688),
        ("GB:zone20", 32.18688),
        ("AT:rural", 80.0),
        ("sign", 60.0),
        ("survey;2019", 60.0),
    ],
)
def test_a_zone_gives_the_speed_of_a_road_without_a_sign(key, value, kph):
    road = {"highway": "primary", key: value}
    assert compute_speed_kph(road) == pytest.approx(kph)
    assert modes()["drive"](road).speed_kph == pytest.approx(kph)
    assert compute_speed_kph({**road, "maxspeed": "70"}) == 70.0
    assert modes()["drive"].ignored_values(road) == []


def test_zones_may_differ_by_direction(make_map, cross):
    tags = {"highway": "primary", "source:maxspeed:forward": "DE:zone:30", "maxspeed:type:backward": "DE:rural"}
    access = modes()["drive"](tags)
    assert (access.speed_kph, access.backward_kph) == (30.0, 80.0)
    for osm_type in (None, "drive"):
        graph = graph_from_file(make_map(cross, ([1, 2, 3], tags)), osm_type=osm_type, resolution=1e6)
        assert sorted(data["speed_kph"] for *_, data in graph.edges(data=True)) == [30.0, 80.0]
        assert sorted(data["maxspeed"] for *_, data in graph.edges(data=True)) == ["DE:rural", "DE:zone:30"]


def test_a_living_street_in_a_traffic_zone_keeps_its_own_limit():
    assert compute_speed_kph({"highway": "living_street", "zone:traffic": "DE:urban"}) == 10.0
    assert compute_speed_kph({"highway": "living_street", "zone:maxspeed": "DE:20"}) == 20.0


NO_SPEEDS = [None, "", "signals", "variable", "none", "DE:none", "fast", "0", "-50", "999", "1e9", "٣٠", "30 parsecs"]
NO_SPEEDS += ["nan", math.nan, True, [], {}, [[]], "[", "[]", "[,]", ";;", 1 << 2000, 1e300]


@pytest.mark.parametrize("maxspeed", NO_SPEEDS)
def test_an_invalid_speed_is_replaced_by_that_of_the_road_class(maxspeed):
    assert compute_speed_kph({"highway": "residential", "maxspeed": maxspeed}) == SPEED_OF_HIGHWAY_KPH["residential"]


@pytest.mark.parametrize(
    ("highway", "kph"),
    [("motorway", 130.0), ("trunk", 130.0), ("motorway_link", 60.0), ("residential", 30.0), ("living_street", 10.0)],
)
def test_only_on_motorways_and_trunk_roads_no_limit_means_130(highway, kph):
    for none in ("none", "None ", "DE:none", "unlimited"):
        assert compute_speed_kph({"highway": highway, "maxspeed": none}) == kph
    assert modes()["drive"]({"highway": highway, "maxspeed": "none"}).speed_kph == kph


@given(st.text(alphabet="0123456789.,;|[]'\"-: kmphRO", max_size=20), st.sampled_from(["residential", "motorway"]))
def test_whatever_a_sign_says_the_speed_is_possible(text, highway):
    assert 0.0 < compute_speed_kph({"highway": highway, "maxspeed": text}) <= 300.0


def test_the_class_may_be_unknown_or_several():
    assert (
        compute_speed_kph({})
        == compute_speed_kph({"highway": "dreamway"})
        == compute_speed_kph({"highway": 3})
        == UNKNOWN_SPEED_KPH
    )
    for several in (["dreamway", "steps", "primary"], "dreamway; Steps;primary", "['dreamway', 'steps', 'primary']"):
        assert compute_speed_kph({"highway": several}) == SPEED_OF_HIGHWAY_KPH["steps"]


@pytest.mark.parametrize(
    ("given", "kph"), [(12.5, 12.5), (np.int64(12), 12.0), (0, 50.0), (-1, 50.0), ("12", 12.0), (math.inf, 50.0)]
)
def test_a_given_speed_is_kept_if_it_is_one(given, kph):
    assert compute_speed_kph({"speed_kph": given, "maxspeed": "50"}) == kph


def test_every_speed_in_the_table_is_positive():
    assert all(0.0 < speed <= 130.0 for speed in SPEED_OF_HIGHWAY_KPH.values())


@pytest.mark.parametrize("load", [graph_from_xml, graph_from_file])
def test_edges_of_a_file_have_a_speed_and_a_time(make_map, cross, load):
    path = make_map(cross, ([1, 2, 3], {"highway": "primary", "maxspeed": "36"}), ([2, 4], {"highway": "steps"}))
    for _, _, data in load(path).edges(data=True):
        assert data["speed_kph"] == (36.0 if data["highway"] == "primary" else 2.0)
        assert data["travel_time"] == pytest.approx(data["length"] / data["speed_kph"] * 3.6)


def test_the_shipped_map_has_them_too():
    with gamms.create_context(logger_config={"level": "CRITICAL"}) as ctx:
        gamms.osm.helsinki(ctx)
        attributes = ctx.graph.edge_attributes(0)
        assert attributes["speed_kph"] == float(attributes["maxspeed"])
        assert len(ctx.graph.columns().edge_attributes["travel_time"]) == len(ctx.graph.columns().edge_ids)
