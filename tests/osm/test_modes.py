"""Modes of travel: who may use which ways, how fast and in which direction, as data and as functions."""

import copy
import math
import pickle
from dataclasses import fields, replace

import networkx as nx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gamms.errors import BadFile, BadType, BadValue
from gamms.osm import Access, Mode, OSMType, graph_from_file, graph_from_xml, modes, report
from gamms.osm.network import find_strong_components
from gamms.osm.speeds import SPEED_OF_HIGHWAY_KPH

NO_CUT = 1e6
NAMES = ["walk", "robot", "bike", "drive", "drive_service"]


def street(**tags):
    return {"highway": "residential"} | {name.replace("__", ":"): value for name, value in tags.items()}


BOTH, ALONG, AGAINST = (True, True), (True, False), (False, True)


@pytest.mark.parametrize(
    ("tags", "walk", "bike", "drive"),
    [
        (street(), BOTH, BOTH, BOTH),
        (street(oneway="yes"), BOTH, ALONG, ALONG),
        (street(oneway="-1"), BOTH, AGAINST, AGAINST),
        (street(oneway="no", junction="roundabout"), BOTH, BOTH, BOTH),
        (street(oneway="reversible"), BOTH, BOTH, BOTH),
        (street(junction="roundabout"), BOTH, ALONG, ALONG),
        (street(junction="circular"), BOTH, ALONG, ALONG),
        (street(oneway="yes", oneway__bicycle="no"), BOTH, BOTH, ALONG),
        (street(oneway__bicycle="yes"), BOTH, ALONG, BOTH),
        (street(oneway="yes", cycleway="opposite"), BOTH, BOTH, ALONG),
        (street(oneway="yes", cycleway="opposite_track"), BOTH, BOTH, ALONG),
        (street(oneway="yes", cycleway="opposite_share_busway"), BOTH, BOTH, ALONG),
        (street(oneway="yes", cycleway="lane"), BOTH, ALONG, ALONG),
        (street(oneway="yes", cycleway__right="opposite_lane"), BOTH, BOTH, ALONG),
        (street(oneway="yes", cycleway__right__oneway="-1"), BOTH, BOTH, ALONG),
        (street(oneway="yes", cycleway__left__oneway="no"), BOTH, BOTH, ALONG),
        (street(oneway="yes", cycleway__both__oneway="no"), BOTH, BOTH, ALONG),
        (street(oneway="true"), BOTH, ALONG, ALONG),
        (street(oneway="1"), BOTH, ALONG, ALONG),
        (street(oneway="reverse"), BOTH, AGAINST, AGAINST),
        (street(oneway="-1", cycleway="opposite_lane"), BOTH, BOTH, AGAINST),
        (street(oneway="yes", cycleway__left="opposite_track"), BOTH, BOTH, ALONG),
        (street(oneway="yes", cycleway__left="lane", cycleway__left__oneway="-1"), BOTH, BOTH, ALONG),
        (street(oneway="yes", oneway__bicycle="yes", cycleway="opposite"), BOTH, ALONG, ALONG),
        (street(oneway="yes", oneway__motor_vehicle="no"), BOTH, ALONG, BOTH),
        (street(oneway__foot="yes"), ALONG, BOTH, BOTH),
        (street(oneway__foot="-1"), AGAINST, BOTH, BOTH),
        (street(oneway=" Yes "), BOTH, ALONG, ALONG),
        (street(Oneway="TRUE"), BOTH, ALONG, ALONG),
        (street(oneway="perhaps", junction="roundabout"), BOTH, ALONG, ALONG),
        (street(oneway="yes", oneway__vehicle="no"), BOTH, BOTH, BOTH),
        (street(oneway__vehicle="yes", cycleway="opposite"), BOTH, BOTH, ALONG),
        (street(oneway="yes", oneway__bicycle="No "), BOTH, BOTH, ALONG),
        (street(vehicle__forward="no"), BOTH, AGAINST, AGAINST),
        (street(vehicle__backward="no"), BOTH, ALONG, ALONG),
        (street(motor_vehicle__backward="no"), BOTH, BOTH, ALONG),
        (street(motorcar__backward="private"), BOTH, BOTH, ALONG),
        (street(foot__backward="no"), ALONG, BOTH, BOTH),
        (street(access__backward="no"), ALONG, ALONG, ALONG),
        (street(access__backward="No;Private "), ALONG, ALONG, ALONG),
        (street(access__backward="no", bicycle__backward="yes"), ALONG, BOTH, ALONG),
        (street(access="no", foot="yes", bicycle__forward="yes", motorcar__backward="yes"), BOTH, ALONG, AGAINST),
        (street(oneway="yes", bicycle__backward="yes"), BOTH, BOTH, ALONG),
        (street(oneway="yes", bicycle__backward="designated"), BOTH, BOTH, ALONG),
        (street(oneway="yes", bicycle__backward="destination"), BOTH, ALONG, ALONG),
        (street(oneway="-1", bicycle__forward="yes"), BOTH, BOTH, AGAINST),
        (street(oneway="yes", motor_vehicle__backward="yes"), BOTH, ALONG, BOTH),
        (street(oneway="yes", vehicle__backward="yes"), BOTH, ALONG, ALONG),
        (street(oneway="yes", cycleway="lane;opposite_lane"), BOTH, BOTH, ALONG),
    ],
)
def test_each_mode_has_its_own_one_way_streets(tags, walk, bike, drive):
    assert [modes()[name](tags)[1:] for name in ("walk", "bike", "drive")] == [walk, bike, drive]


@pytest.mark.parametrize(
    ("tags", "why"),
    [
        (street(motor_vehicle="agricultural;forestry"), "motor_vehicle=agricultural;forestry"),
        (street(motor_vehicle="agricultural; destination"), ""),
        (street(access="Private"), "access=private"),
        (street(Access="private"), "access=private"),
        (street(access="no "), "access=no"),
        (street(access="private;customers"), ""),
        (street(access="no", motor_vehicle="destination"), ""),
        (street(access="no", motor_vehicle="perhaps"), "access=no"),
        (street(access="no", motor_vehicle="unknown"), "access=no"),
        (street(vehicle__forward="no", vehicle__backward="no"), "vehicle:forward=no"),
        (street(vehicle="no", vehicle__forward="destination", vehicle__backward="destination"), ""),
        (street(oneway="yes", vehicle__forward="no"), "vehicle:forward=no"),
        (street(oneway="-1", vehicle__backward="no"), "vehicle:backward=no"),
        (street(area="YES"), "area=yes"),
        (street(construction="yes;minor"), ""),
        ({"highway": "Residential "}, ""),
        ({"highway": "Footway"}, "highway=footway"),
        ({"highway": "footway;residential"}, ""),
        ({"highway": "pedestrian", "motorcar:forward": "yes"}, ""),
        ({}, "highway=no"),
    ],
)
def test_a_way_is_closed_if_each_of_its_directions_is(tags, why):
    drive = modes()["drive"]
    assert drive.why_closed(tags) == why
    assert (drive(tags) is None) == bool(why)


def test_a_gate_is_closed_however_it_is_written():
    for closed in ({"access": "Private"}, {"Access": "no "}, {"motor_vehicle": "agricultural;forestry"}):
        assert modes()["drive"].is_stopped_by({"barrier": "gate"} | closed)
    assert modes()["drive"].is_stopped_by({"barrier": "Bollard "})
    assert not modes()["drive"].is_stopped_by({"barrier": "bollard", "motorcar": "YES"})


@pytest.mark.parametrize(
    ("tags", "forward", "backward"),
    [
        (street(maxspeed__forward="30", maxspeed__backward="70"), 30, 70),
        (street(maxspeed="50", maxspeed__backward="70"), 50, 70),
        (street(maxspeed__forward="20"), 20, 30),
        (street(maxspeed__forward="signals", maxspeed="50"), 50, 50),
        (street(maxspeed="50", maxspeed__motorcar="40", maxspeed__bicycle="7"), 40, 40),
        (street(maxspeed="50", maxspeed__forward__motor_vehicle="40"), 40, 50),
        (street(maxspeed="50", maxspeed__vehicle__backward="20 mph"), 50, 32.18688),
        (street(maxspeed="50", maxspeed__forward__bicycle="7"), 50, 50),
        (street(maxspeed="50", maxspeed__hgv="30", maxspeed__conditional="30 @ wet"), 50, 50),
        (street(**{"Maxspeed:Forward": "40"}), 40, 30),
    ],
)
def test_signs_may_hold_for_one_direction_or_vehicle(tags, forward, backward):
    access = modes()["drive"](tags)
    assert access.speed_kph == pytest.approx(forward)
    assert (access.speed_kph if access.backward_kph is None else access.backward_kph) == pytest.approx(backward)
    assert modes()["walk"](tags) == Access(5.0)


def test_bicycles_keep_to_their_own_signs():
    bike = modes()["bike"]
    assert bike(street(maxspeed__forward__bicycle="7")) == Access(7.0, backward_kph=15.0)
    assert bike(street(maxspeed__bicycle="12", maxspeed="8")) == Access(12.0)
    assert bike(street(maxspeed="8", oneway="-1", maxspeed__backward="6")) == Access(6.0, forward=False)


def test_the_speed_of_the_way_back_is_beside_the_tuple():
    access = Access(30.0, backward_kph=70.0)
    speed, forward, backward = access
    assert (speed, forward, backward) == (30.0, True, True)
    assert repr(access) == "Access(speed_kph=30.0, forward=True, backward=True, backward_kph=70.0)"
    assert access != Access(30.0)
    assert access._replace(speed_kph=12.0) == Access(12.0)
    assert pickle.loads(pickle.dumps(access)) == copy.deepcopy(access) == access
    assert len({access, Access(30.0), Access(30.0, backward_kph=70.0)}) == 2


def test_edges_have_the_speed_and_the_sign_of_their_direction(make_map, cross):
    ways = ([1, 2], street(maxspeed__forward="30", maxspeed__backward="70")), ([3, 2], street(maxspeed="36"))
    path = make_map(cross, *ways, ([4, 2], street(oneway="-1", maxspeed__backward="20", maxspeed__forward="90")))
    wanted = {("30", 30.0): (1, 1), ("70", 70.0): (1, -1), ("36", 36.0): (1, -1), ("20", 20.0): (1, 1)}
    for options in ({"osm_type": "drive", "strong": False}, {"bidirectional": False}):
        graph = graph_from_file(path, NO_CUT, **options)
        found = {(data["maxspeed"], data["speed_kph"]) for *_, data in graph.edges(data=True)}
        assert found == set(wanted)
        for u, v, data in graph.edges(data=True):
            assert data["travel_time"] == pytest.approx(data["length"] / data["speed_kph"] * 3.6)
            assert "tags:backward" not in data
            is_east = graph.nodes[u]["x"] < graph.nodes[v]["x"]
            assert (data["speed_kph"] == 30.0, data["speed_kph"] == 70.0) in (
                (is_east, False),
                (False, not is_east),
            ) or (data["maxspeed"] in ("36", "20"))
        assert report(graph, path).is_faithful
    against = graph_from_file(path, NO_CUT, True, osm_type="drive")
    assert sorted(data["speed_kph"] for *_, data in against.edges(data=True)) == [20.0, 20.0, 30.0, 36.0, 36.0, 70.0]


DIRECTED = {
    "oneway": ["yes", "-1", "no"],
    "vehicle:forward": ["no"],
    "vehicle:backward": ["no", "destination"],
    "motorcar:backward": ["yes"],
    "maxspeed": ["50"],
    "maxspeed:forward": ["30", "signals"],
    "maxspeed:motorcar:backward": ["70"],
}
OTHERS = {"forward": "backward", "backward": "forward", "yes": "-1", "-1": "yes"}


def turned(tags):
    """Return the tags of the same way, drawn from its end to its beginning."""
    return {
        ":".join(OTHERS.get(part, part) for part in key.split(":")): OTHERS.get(value, value)
        if key == "oneway"
        else value
        for key, value in tags.items()
    }


def paces(path, **options):
    """Return the heights of the ends of all edges with the speed, time and length of each; None if all is closed."""
    try:
        graph = graph_from_file(path, 50.0, tolerance=0.0, **options)
    except BadFile:
        return None
    y = dict(graph.nodes(data="y"))
    names = ("speed_kph", "travel_time", "length")
    edges = [[y[u], y[v], *(data[name] for name in names)] for u, v, data in graph.edges(data=True)]
    return np.round(sorted(edges), 6).tolist()


@settings(max_examples=12)
@given(st.fixed_dictionaries({}, optional={key: st.sampled_from(values) for key, values in DIRECTED.items()}))
def test_a_way_that_is_drawn_from_its_end_is_the_same_road(write_map, tags):
    nodes = {1: (60.17, 24.94), 2: (60.171, 24.94), 3: (60.172, 24.94)}
    there = street() | tags
    whole = [([1, 2, 3], there)]
    from_its_end = [([3, 2, 1], turned(there))]
    in_two_parts = [([1, 2], there), ([3, 2], turned(there))]
    found = []
    for ways in (whole, from_its_end, in_two_parts):
        path = write_map(nodes, *ways)
        found.append([paces(path, osm_type="drive", strong=False), paces(path, bidirectional=False)])
    assert found[0] == found[1] == found[2]


@pytest.mark.parametrize(
    ("conveying", "directions"), [("forward", ALONG), ("backward", AGAINST), ("reversible", BOTH), ("yes", BOTH)]
)
def test_an_escalator_leads_where_it_runs(conveying, directions):
    for highway in ("steps", "footway", "escalator"):
        assert modes()["walk"]({"highway": highway, "conveying": conveying})[1:] == directions


def test_motorways_are_one_way_unless_they_say_otherwise():
    assert modes()["drive"]({"highway": "motorway"})[1:] == ALONG
    assert modes()["drive"]({"highway": "motorway", "oneway": "no"})[1:] == BOTH
    assert modes()["drive"]({"highway": "motorway_link"})[1:] == BOTH


@pytest.mark.parametrize(
    ("tags", "speeds"),
    [
        ({"highway": "primary"}, (5, None, 15, 60, 60)),
        ({"highway": "primary", "maxspeed": "80"}, (5, None, 15, 80, 80)),
        (street(maxspeed="10"), (5, 6, 10, 10, 10)),
        (street(maxspeed="DE:urban"), (5, 6, 15, 50, 50)),
        ({"highway": "steps"}, (2, None, None, None, None)),
        ({"highway": "service"}, (5, 6, 15, None, 20)),
    ],
)
def test_each_mode_has_its_own_speed(tags, speeds):
    found = [mode(tags) for mode in (modes()[name] for name in NAMES)]
    assert [None if access is None else access.speed_kph for access in found] == [*speeds]


def test_cars_have_the_usual_speeds_of_all_roads():
    assert {name: SPEED_OF_HIGHWAY_KPH[name] for name in modes()["drive"].highways} == modes()["drive"].highways
    service = modes()["drive_service"].highways
    assert service == {**modes()["drive"].highways, "service": SPEED_OF_HIGHWAY_KPH["service"]}


def test_without_a_mode_the_speed_is_that_of_cars(make_map, cross):
    path = make_map(cross, ([1, 2], street(maxspeed="50")))
    for graph in (graph_from_file(path, NO_CUT), graph_from_xml(path, NO_CUT)):
        assert {data["speed_kph"] for *_, data in graph.edges(data=True)} == {50.0}


def test_a_mode_of_ones_own_has_barriers_of_its_own(tmp_path):
    mine = tmp_path / "mine.toml"
    mine.write_text('[cart]\nextends = "drive"\nbarriers = ["gate"]\n')
    cart = modes(mine)["cart"]
    assert cart.is_stopped_by({"barrier": "gate"})
    assert not cart.is_stopped_by({"barrier": "bollard"})


# -- one's own modes ----------------------------------------------------------------------------------------------


def test_a_changed_mode_is_a_mode(make_map, cross):
    walk = modes()["walk"]
    runner = replace(walk, name="runner", highways=dict.fromkeys(walk.highways, 12.0))
    graph = graph_from_file(make_map(cross, ([1, 2], street())), NO_CUT, osm_type=runner)
    assert graph.edges[0, 1]["speed_kph"] == 12.0


@pytest.mark.parametrize(
    ("answer", "error", "words"),
    [
        (5.0, BadType, "my_rule must return an Access or None, not 5.0"),
        (Access(0.0), BadValue, "my_rule gives way 100 the speed 0.0"),
        (Access(math.inf), BadValue, "the speed inf"),
        (Access("fast"), BadValue, "the speed 'fast'"),
    ],
)
def test_a_function_with_an_impossible_answer_is_refused(make_map, cross, answer, error, words):
    def my_rule(tags):
        return answer

    with pytest.raises(error, match=words):
        graph_from_file(make_map(cross, ([1, 2], street())), osm_type=my_rule)


def test_an_error_in_a_function_is_not_blamed_on_the_file(make_map, cross):
    def my_rule(tags):
        return Access(float(tags["width"]))

    with pytest.raises(BadValue, match="my_rule failed for way 100: KeyError: 'width'"):
        graph_from_file(make_map(cross, ([1, 2], street())), osm_type=my_rule)


def test_a_function_that_closes_both_directions_closes_the_way(make_map, cross):
    with pytest.raises(BadFile, match="no roads for the mode 'shut'"):

        def shut(tags):
            return Access(5.0, forward=False, backward=False)

        graph_from_file(make_map(cross, ([1, 2], street())), osm_type=shut)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[cart", "is not a TOML file"),
        ("cart = 5", "mode 'cart' must be a table"),
        ('[cart]\nextends = "drve"', "extends 'drve', which is not an earlier mode.*'drive'"),
        ('[cart]\nextends = "drive"\nhighway = {}', "has no field 'highway'.*'highways'"),
        ("[cart]\nrefused = []", "missing required field"),
        ('[cart]\nextends = "drive"\nhighways = { residential = "fast" }', "Expected `float`, got `str`"),
        ('[cart]\nextends = "drive"\nhighways = { residential = 0 }', r"\$.highways"),
        ('[cart]\nextends = "drive"\nmaxspeed = "often"', "Invalid enum value 'often'"),
    ],
)
def test_a_faulty_file_of_modes_is_refused(tmp_path, text, words):
    mine = tmp_path / "mine.toml"
    mine.write_text(text)
    with pytest.raises(BadFile, match=words):
        modes(mine)


def test_a_file_of_modes_has_to_be_there(tmp_path):
    with pytest.raises(FileNotFoundError):
        modes(tmp_path / "none.toml")


def test_all_shipped_modes_are_complete():
    assert sorted(modes()) == sorted(NAMES)
    for name, mode in modes().items():
        assert mode.name == name
        assert not set(mode.highways) & set(mode.by_permission)
        assert {field.name for field in fields(Mode)} <= set(dir(mode))


# -- strongly connected parts ---------------------------------------------------------------------------------------


def trap(make_map, cross):
    """A two-way street 1-2-3 with a one-way street 2-4 into a dead end, and a street elsewhere."""
    cross |= {11: (60.18, 24.94), 12: (60.181, 24.94)}
    return make_map(cross, ([1, 2, 3], street()), ([2, 4], street(oneway="yes")), ([11, 12], street()))


@pytest.mark.parametrize("kind", ["bike", "drive", OSMType.DRIVE])
def test_agents_cannot_be_trapped(make_map, cross, kind):
    graph = graph_from_file(trap(make_map, cross), NO_CUT, osm_type=kind)
    assert nx.is_strongly_connected(graph)
    assert graph.number_of_nodes() == 2
    assert graph.graph["no_way_back_m"] == pytest.approx(55.71, abs=0.01)
    assert graph.graph["other_parts_m"] == pytest.approx(111.42, abs=0.01)


def test_traps_stay_on_request_and_where_all_parts_are_kept(make_map, cross):
    path = trap(make_map, cross)
    for options in ({"strong": False}, {"retain_all": True}):
        graph = graph_from_file(path, NO_CUT, osm_type="drive", **options)
        assert not nx.is_strongly_connected(graph)
        assert graph.graph["no_way_back_m"] == 0.0


def test_against_the_traffic_there_are_no_traps(make_map, cross):
    graph = graph_from_file(trap(make_map, cross), NO_CUT, True, osm_type="drive")
    assert graph.number_of_nodes() == 4
    assert nx.is_strongly_connected(graph)


def test_without_a_mode_only_strong_looks_at_directions(make_map, cross):
    path = trap(make_map, cross)
    assert graph_from_file(path, NO_CUT, False).number_of_nodes() == 4
    assert graph_from_file(path, NO_CUT, False, strong=True).number_of_nodes() == 2


def test_streets_without_a_way_back_are_refused(make_map, cross):
    path = make_map(cross, ([1, 2, 3], street(oneway="yes")))
    with pytest.raises(BadFile, match=r"no two places with a route in both directions.*strong=False"):
        graph_from_file(path, osm_type="drive")


def test_the_report_names_the_reasons_for_closed_ways(make_map, cross):
    ways = ([2, 3], {"highway": "footway"}), ([2, 4], street(access="private")), ([4, 3], {"highway": "footway"})
    path = make_map(cross, ([1, 2], street()), *ways)
    found = report(graph_from_file(path, 10.0, osm_type="drive"), path)
    assert [*found.closed] == ["highway=footway", "access=private"]
    assert found.closed["access=private"] == pytest.approx(55.71, abs=0.01)
    assert dict(found.rows())["closed by class"] == "134.2 m left out: highway=footway 134.2 m"
    assert dict(found.rows())["closed by access"] == "55.7 m left out: access=private 55.7 m"
    everything = report(graph_from_file(path, 10.0), path).length_before
    assert sum(found.closed.values()) + found.length_before == pytest.approx(everything, rel=1e-9)
    assert found.to_dict()["closed"] == found.closed
    assert report(graph_from_file(path, 10.0), path).closed == {}


def test_the_report_names_ways_that_are_not_roads(make_map, cross):
    path = make_map(cross, ([1, 2], street()), ([2, 3], {"highway": "construction"}))
    assert [*report(graph_from_file(path), path).closed] == ["highway=construction"]
    assert report(graph_from_xml(path), path).closed == {}


def test_the_report_counts_values_without_a_known_meaning(make_map, cross):
    odd = street(**{"Maxspeed:Forward": "fast ", "motorcar": "perhaps;yes", "oneway": "reversible"})
    path = make_map(cross, ([1, 2], odd), ([2, 3], street(maxspeed="signals", motorcar="perhaps")), ([2, 4], street()))
    found = report(graph_from_file(path, 10.0, osm_type="drive"), path)
    counts = {"motorcar=perhaps": 2, "maxspeed:forward=fast": 1, "maxspeed=signals": 1, "oneway=reversible": 1}
    assert found.ignored_values == counts
    assert dict(found.rows())["not understood"].startswith(
        "motorcar=perhaps on 2 ways, maxspeed:forward=fast on 1 ways"
    )
    assert found.to_dict()["ignored_values"] == counts
    without_mode = report(graph_from_file(path, 10.0), path).ignored_values
    assert without_mode == {name: count for name, count in counts.items() if "motorcar" not in name}
    assert report(graph_from_file(path, 10.0, osm_type="walk"), path).ignored_values == {}


def test_the_report_of_ones_own_mode_needs_the_mode(make_map, cross):
    def mine(tags):
        return Access(5.0)

    path = trap(make_map, cross)
    graph = graph_from_file(path, 10.0, osm_type=mine)
    with pytest.raises(BadValue, match="for the custom mode 'mine'"):
        report(graph, path)
    assert report(graph, path, osm_type=mine).is_faithful


steps = st.lists(st.tuples(st.integers(0, 9), st.integers(0, 9)), max_size=30)


@given(steps)
def test_strong_components_are_those_of_networkx(pairs):
    graph = nx.DiGraph(pairs)
    graph.add_nodes_from(range(10))
    label = find_strong_components(*np.array(pairs, np.int64).reshape(-1, 2).T, 10)
    expected = {row: min(part) for part in nx.strongly_connected_components(graph) for row in part}
    assert label.tolist() == [expected[row] for row in range(10)]


@given(st.lists(st.tuples(st.integers(0, 8), st.integers(0, 8), st.booleans()), min_size=1, max_size=16))
def test_every_node_has_an_exit_and_can_be_reached(tmp_path_factory, roads):
    nodes = {k + 1: (60.17 + 0.001 * (k // 3), 24.94 + 0.002 * (k % 3)) for k in range(9)}
    text = ['<osm version="0.6">']
    text += [f'<node id="{id}" lat="{lat}" lon="{lon}"/>' for id, (lat, lon) in nodes.items()]
    for number, (a, b, one_way) in enumerate(roads, 1):
        tag = '<tag k="oneway" v="yes"/>' if one_way else ""
        refs = f'<nd ref="{a + 1}"/><nd ref="{b + 1}"/>'
        text.append(f'<way id="{number}">{refs}<tag k="highway" v="residential"/>{tag}</way>')
    path = tmp_path_factory.mktemp("roads") / "roads.osm"
    path.write_text("\n".join([*text, "</osm>"]))
    try:
        graph = graph_from_file(path, 50.0, osm_type="drive", tolerance=0.0)
    except BadFile:  # nothing but loops, or streets without a way back
        there = nx.DiGraph((a, b) for a, b, _ in roads)
        there.add_edges_from((b, a) for a, b, one_way in roads if not one_way)
        assert all(len(part) == 1 for part in nx.strongly_connected_components(there))
        return
    assert nx.is_strongly_connected(graph)
    assert all(graph.out_degree(node) and graph.in_degree(node) for node in graph)
