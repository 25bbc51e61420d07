"""Networks that are no roads: rails, waterways, ferries, by their tags, by functions and beside roads."""

import pytest

import gamms
from gamms import scenario
from gamms.errors import BadFile, BadType, BadValue
from gamms.osm import Access, graph_from_file, modes, report
from gamms.osm.speeds import parse_duration_s

UNCUT = {"resolution": 1e6, "retain_all": True}
WAYS = [
    ([1, 2], {"highway": "residential"}),
    ([2, 3], {"railway": "tram", "electrified": "contact_line"}),
    ([2, 4], {"railway": "rail", "maxspeed": "120"}),
    ([1, 4], {"railway": "abandoned"}),
    ([3, 4], {"waterway": "canal"}),
    ([1, 3], {"power": "line"}),
    ([1, 2, 4], {"building": "yes"}),
]


@pytest.fixture
def town(make_map, cross):
    return make_map(cross, *WAYS)


def edges_of(file, osm_type, **options):
    graph = graph_from_file(file, osm_type=osm_type, **UNCUT, **options)
    return [data for u, v, data in graph.edges(data=True) if u < v]


@pytest.mark.parametrize(
    ("given", "speeds"),
    [
        ({"railway": ["rail", "tram"]}, {"tram": 25.0, "rail": 120.0}),
        ({"railway": "tram"}, {"tram": 25.0}),
        ({"railway": {"tram": 33}}, {"tram": 33.0}),
        ({"railway": True}, {"tram": 30.0, "rail": 120.0, "abandoned": 30.0}),
    ],
)
def test_rails_are_chosen_by_their_tags(town, given, speeds):
    assert {data["railway"]: data["speed_kph"] for data in edges_of(town, given)} == speeds


def test_one_network_may_have_several_keys(town):
    edges = edges_of(town, {"waterway": True, "power": ["line"]})
    assert {(data.get("waterway"), data.get("power"), data["speed_kph"]) for data in edges} == {
        ("canal", None, 10.0),
        (None, "line", 30.0),
    }


def test_a_function_may_open_any_network(town):
    def train(tags):
        return Access(90.0) if tags.get("railway") == "rail" else None

    (edge,) = edges_of(town, train)
    assert (edge["railway"], edge["speed_kph"]) == ("rail", 90.0)


def test_a_function_that_opens_all_ways_opens_roads_only(town):
    assert [data["highway"] for data in edges_of(town, lambda tags: Access(3.0))] == ["residential"]
    assert [data["highway"] for data in edges_of(town, lambda tags: Access(3.0) if tags["highway"] else None)] == [
        "residential"
    ]


def test_a_network_and_roads_are_one_graph(town):
    edges = edges_of(town, ["walk", {"railway": ["tram"]}])
    assert {(data["walk"], data["tram"]) for data in edges} == {(5.0, 0.0), (0.0, 25.0)}
    with pytest.raises(BadValue, match="cannot have the name 'railway'"):
        edges_of(town, ["walk", {"railway": True}])


def test_reports_count_the_ways_of_the_network(town):
    given = {"railway": ["rail", "tram"]}
    found = report(graph_from_file(town, osm_type=given), town, osm_type=given)
    assert found.is_faithful
    assert set(found.closed) == {"railway=abandoned"}
    both = ["walk", given]
    found = report(graph_from_file(town, osm_type=both, retain_all=True), town, osm_type=both)
    assert found.is_faithful
    assert set(found.closed) == {"railway=abandoned"}


def test_networks_are_maps_of_scenarios(town):
    for given in ({"railway": ["tram"]}, ["walk", {"railway": ["tram"]}]):
        map = {"file": {"path": town.name, "osm_type": given}}
        with scenario.Scenario(map=map, teams={"red": {"count": 1}}, folder=town.parent).build() as ctx:
            edges = [ctx.graph.edge_attributes(edge) for edge in ctx.graph.graph.get_edges()]
        assert "tram" in {data.get("railway") for data in edges}


@pytest.mark.parametrize(
    ("given", "error", "text"),
    [
        ({}, BadValue, "empty dict"),
        ({"railway": 3}, BadType, "must be a value, a list of values"),
        ({"railway": []}, BadType, "must be a value, a list of values"),
        ({"railway": [3]}, BadType, "must have texts"),
        ({"railway": {"tram": -1}}, BadValue, "must be a speed"),
        ({"aeroway": ["runway"]}, BadFile, "one of the tags aeroway are read"),
    ],
)
def test_a_wrong_network_is_refused(town, given, error, text):
    with pytest.raises(error, match=text):
        edges_of(town, given)


def test_files_of_modes_may_name_other_networks(town, tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text('[barge]\nextends = "walk"\nhighways = { "waterway=canal" = 8 }\nby_permission = {}\n')
    (edge,) = edges_of(town, modes(file)["barge"])
    assert (edge["waterway"], edge["speed_kph"]) == ("canal", 8.0)


FERRY = {"route": "ferry", "duration": "00:20"}


@pytest.mark.parametrize(
    ("tags", "open_to"),
    [
        ({}, {"walk", "bike"}),
        ({"motor_vehicle": "yes"}, {"walk", "bike", "drive", "drive_service"}),
        ({"motorcar": "yes", "foot": "no"}, {"bike", "drive", "drive_service"}),
        ({"bicycle": "no"}, {"walk"}),
        ({"access": "private"}, set()),
        ({"vehicle": "yes"}, {"walk", "bike"}),
    ],
)
def test_ferries_are_open_to_those_whom_they_take(tags, open_to):
    assert {name for name, mode in modes().items() if mode({**FERRY, **tags}) is not None} == open_to


def test_a_ferry_takes_its_duration(make_map, cross):
    file = make_map(cross, ([1, 2], {"highway": "residential"}), ([2, 3, 4], {**FERRY, "motor_vehicle": "yes"}))
    for osm_type in ("walk", "drive"):
        graph = graph_from_file(file, osm_type=osm_type, resolution=10.0)
        ferry = [data for u, v, data in graph.edges(data=True) if data.get("route") == "ferry" and u < v]
        assert sum(data["travel_time"] for data in ferry) == pytest.approx(1200.0)
        metres = sum(data["length"] for data in ferry)
        assert all(data["speed_kph"] == pytest.approx(metres / 1200.0 * 3.6) for data in ferry)
        assert not any("stated_seconds" in data for data in ferry)
        assert report(graph, file).is_faithful
    both = graph_from_file(file, osm_type=["walk", "drive"], resolution=1e6)
    (ferry,) = [data for u, v, data in both.edges(data=True) if data.get("route") == "ferry" and u < v]
    assert ferry["walk"] == ferry["drive"] == ferry["speed_kph"] < 1.0


def test_a_ferry_without_its_duration_is_slow(make_map, cross):
    for duration in ({}, {"duration": "soon"}, {"duration": "00:00:01"}):
        file = make_map(cross, ([1, 2], {"highway": "path"}), ([2, 3], {"route": "ferry", **duration}))
        graph = graph_from_file(file, osm_type="walk")
        assert {data["speed_kph"] for *_, data in graph.edges(data=True) if data.get("route")} == {15.0}


@pytest.mark.parametrize(
    ("value", "seconds"),
    [
        ("00:20", 1200.0),
        ("1:05", 3900.0),
        ("01:00:30", 3630.0),
        ("25", 1500.0),
        ("PT30M", 1800.0),
        ("pt1h30m", 5400.0),
        ("PT1.5H", 5400.0),
        ("P1DT2H", 93600.0),
        ("PT45S", 45.0),
        ("P1D", 86400.0),
        ("0", None),
        ("PT", None),
        ("20 min", None),
        ("10:00;12:00", None),
        ("", None),
        (None, None),
    ],
)
def test_a_duration_is_read(value, seconds):
    assert parse_duration_s(value) == seconds


def test_a_game_is_played_on_rails(town):
    with gamms.create_context() as ctx:
        ctx.graph.attach_networkx_graph(graph_from_file(town, osm_type={"railway": ["rail", "tram"]}))
        assert {ctx.graph.edge_attributes(edge)["railway"] for edge in ctx.graph.graph.get_edges()} == {"rail", "tram"}
