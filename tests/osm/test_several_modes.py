"""One graph for several modes of travel: each mode has in it exactly the roads of its own graph."""

import random
from collections import Counter, defaultdict

import networkx as nx
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import gamms
from gamms.errors import BadFile, BadType, BadValue
from gamms.osm import Access, OSMType, graph_from_file, report

MODES = ["walk", "bike", "drive"]
UNCUT = {"resolution": 1e6, "simplify": False, "tolerance": 0.0}
PLACES = {id: (60.17 + 0.001 * (id // 4), 24.94 + 0.002 * (id % 4)) for id in range(1, 16)}
TAGS = [
    {"highway": "residential"},
    {"highway": "residential", "oneway": "yes"},
    {"highway": "residential", "oneway": "-1", "oneway:bicycle": "no"},
    {"highway": "tertiary", "maxspeed:forward": "30", "maxspeed:backward": "70"},
    {"highway": "footway"},
    {"highway": "cycleway"},
    {"highway": "primary", "sidewalk": "separate"},
    {"highway": "service", "access": "private"},
    {"highway": "steps", "conveying": "forward"},
    {"highway": "pedestrian", "area": "yes"},
    {"highway": "residential", "bicycle:backward": "no", "vehicle:forward": "no"},
]
MARKS = [
    {},
    {"barrier": "bollard"},
    {"barrier": "stile"},
    {"barrier": "wall"},
    {"barrier": "gate", "access": "private"},
]


def map_of(ways, marks):
    lines = ['<osm version="0.6">']
    for id, (lat, lon) in PLACES.items():
        tags = "".join(f'<tag k="{key}" v="{value}"/>' for key, value in marks.get(id, {}).items())
        lines.append(f'<node id="{id}" lat="{lat}" lon="{lon}">{tags}</node>')
    for number, (refs, tags) in enumerate(ways, 100):
        nodes = "".join(f'<nd ref="{ref}"/>' for ref in refs)
        texts = "".join(f'<tag k="{key}" v="{value}"/>' for key, value in tags.items())
        lines.append(f'<way id="{number}">{nodes}{texts}</way>')
    return "\n".join([*lines, "</osm>"])


def pieces(graph, mode=None):
    """The directed pieces of ways of a graph, or of one of its modes: ids of both nodes, metres, km/h, and seconds."""
    found = Counter()
    for u, v, data in graph.edges(data=True):
        first, last = u, v
        time = "travel_time" if mode is None else f"travel_time:{mode}"
        length = data["length"]
        seconds = data.get(time)
        speed = data["speed_kph"] if mode is None else data[mode]
        assert (seconds is None) == (not speed)
        if "osmid" not in graph.nodes[first] or not speed:
            continue
        while "osmid" not in graph.nodes[last]:  # one of several roads between two nodes, which is cut
            first, last = last, next(other for other in graph.successors(last) if other != first)
            length += graph.edges[first, last]["length"]
            seconds += graph.edges[first, last][time]
        found[graph.nodes[u]["osmid"], graph.nodes[last]["osmid"], round(length, 6), speed, round(seconds, 6)] += 1
    return found


def graphs_of(file, modes, **options):
    return graph_from_file(file, osm_type=modes, **options), {
        mode: graph_from_file(file, osm_type=mode, **options) for mode in modes
    }


WAYS = st.lists(
    st.tuples(
        st.lists(st.sampled_from(sorted(PLACES)), min_size=2, max_size=6),
        st.sampled_from(TAGS),
    ),
    min_size=1,
    max_size=10,
)


@settings(max_examples=30)
@given(
    ways=WAYS,
    marks=st.dictionaries(st.sampled_from(sorted(PLACES)), st.sampled_from(MARKS), max_size=6),
    bidirectional=st.sampled_from([None, True, False]),
    part=st.sampled_from([{}, {"strong": False}, {"retain_all": True}]),
    seed=st.integers(0, 5),
)
def test_each_mode_has_the_pieces_of_its_own_graph(tmp_path_factory, ways, marks, bidirectional, part, seed):
    file = tmp_path_factory.mktemp("map") / "map.osm"
    file.write_text(map_of(ways, marks))
    single = {}
    for mode in random.Random(seed).sample(MODES, 3):
        try:
            single[mode] = graph_from_file(file, osm_type=mode, bidirectional=bidirectional, **UNCUT, **part)
        except BadFile:
            with pytest.raises(BadFile):
                graph_from_file(file, osm_type=[*single, mode], bidirectional=bidirectional, **UNCUT, **part)
    if not single:
        return
    union = graph_from_file(file, osm_type=[*single], bidirectional=bidirectional, **UNCUT, **part)
    for mode, graph in single.items():
        assert pieces(union, mode) == pieces(graph)
    for _, _, data in union.edges(data=True):
        first = next(mode for mode in single if data[mode] > 0.0)
        assert (data["speed_kph"], data["travel_time"]) == (data[first], data[f"travel_time:{first}"])
    if not report(union, file).is_faithful:  # as is a graph of one mode, of a one-way road there and back
        assert not all(report(graph, file).is_faithful for graph in single.values())


TOWN = [
    ([1, 2, 3], {"highway": "residential", "name": "Main"}),
    ([3, 7, 6], {"highway": "residential", "oneway": "yes"}),
    ([6, 5, 1], {"highway": "tertiary", "maxspeed": "50"}),
    ([2, 6], {"highway": "footway"}),
    ([9, 10], {"highway": "footway"}),
]


@pytest.fixture
def town(tmp_path):
    file = tmp_path / "town.osm"
    file.write_text(map_of(TOWN, {5: {"barrier": "bollard"}}))
    return file


def test_edges_say_who_may_use_them_and_how_fast(town):
    graph = graph_from_file(town, osm_type=["walk", "drive"], resolution=1e6, strong=False)
    ends = {(graph.nodes[u].get("osmid"), graph.nodes[v].get("osmid")): data for u, v, data in graph.edges(data=True)}
    main = ends[1, 2]
    assert (main["walk"], main["drive"], main["speed_kph"]) == (5.0, 30.0, 5.0)
    assert main["travel_time"] == pytest.approx(main["length"] / 5.0 * 3.6)
    assert (ends[3, 6]["walk"], ends[3, 6]["drive"]) == (5.0, 30.0)
    assert (ends[6, 3]["walk"], ends[6, 3]["drive"]) == (5.0, 0.0)
    assert (ends[2, 6]["walk"], ends[2, 6]["drive"]) == (5.0, 0.0)
    assert graph.graph["mode"] == "walk,drive"


def test_the_first_mode_that_may_use_an_edge_gives_its_speed(town):
    graph = graph_from_file(town, osm_type=[OSMType.DRIVE, "walk"], strong=False)
    speeds = {(data["drive"], data["walk"], data["speed_kph"]) for _, _, data in graph.edges(data=True)}
    assert speeds == {(30.0, 5.0, 30.0), (0.0, 5.0, 5.0), (50.0, 0.0, 50.0)}


def test_a_bollard_ends_the_road_of_cars_beside_the_road_of_walkers(town):
    graph = graph_from_file(town, osm_type=["walk", "drive"], strong=False, **UNCUT)
    at_bollard = [node for node, data in graph.nodes(data=True) if data["osmid"] == 5]
    assert len(at_bollard) == 3
    walked = nx.DiGraph([(u, v) for u, v, data in graph.edges(data=True) if data["walk"]])
    driven = nx.DiGraph([(u, v) for u, v, data in graph.edges(data=True) if data["drive"]])
    assert sorted(walked.out_degree(node) for node in at_bollard if node in walked) == [2]
    assert sorted(driven.out_degree(node) for node in at_bollard if node in driven) == [1, 1]


def test_no_mode_has_islands(town):
    graph = graph_from_file(town, osm_type=["walk", "drive"])
    for mode in ("walk", "drive"):
        part = nx.DiGraph([(u, v) for u, v, data in graph.edges(data=True) if data[mode] > 0.0])
        assert nx.is_strongly_connected(part)
    assert {9, 10}.isdisjoint(data.get("osmid") for _, data in graph.nodes(data=True))
    assert graph.graph["other_parts_m"] == pytest.approx(111.1, abs=0.5)


def test_junctions_do_not_merge_across_a_footway_for_cars(tmp_path):
    places = {1: (60.17, 24.94), 2: (60.17, 24.945), 3: (60.17, 24.95), 4: (60.1701, 24.94), 5: (60.1701, 24.945)}
    places |= {6: (60.1701, 24.95), 7: (60.171, 24.945), 8: (60.169, 24.945)}
    ways = [([1, 2, 3], "residential"), ([4, 5, 6], "residential"), ([2, 5], "footway"), ([5, 7], "residential")]
    ways.append(([8, 2], "residential"))
    nodes = "".join(f'<node id="{id}" lat="{lat}" lon="{lon}"/>' for id, (lat, lon) in places.items())
    for number, (refs, highway) in enumerate(ways, 1):
        inside = "".join(f'<nd ref="{ref}"/>' for ref in refs)
        nodes += f'<way id="{number}">{inside}<tag k="highway" v="{highway}"/></way>'
    file = tmp_path / "two.osm"
    file.write_text(f'<osm version="0.6">{nodes}</osm>')
    options = {"retain_all": True, "tolerance": 10.0, "resolution": 1e6}
    graph = graph_from_file(file, osm_type=["walk", "drive"], **options)
    driven = nx.Graph([(u, v) for u, v, data in graph.edges(data=True) if data["drive"]])
    assert len([*nx.connected_components(driven)]) == 2
    assert report(graph, file).is_faithful
    assert nx.is_connected(graph_from_file(file, osm_type="walk", **options).to_undirected())


def test_a_list_of_one_mode_is_its_graph_with_an_attribute(town):
    listed = graph_from_file(town, osm_type=["drive"])
    alone = graph_from_file(town, osm_type="drive")
    assert {data["drive"] for _, _, data in listed.edges(data=True)} == {30.0, 50.0} & {
        data["speed_kph"] for _, _, data in alone.edges(data=True)
    }
    assert (len(listed), listed.number_of_edges()) == (len(alone), alone.number_of_edges())


def test_functions_are_modes_of_a_list(town):
    def truck(tags):
        return Access(20.0) if tags.get("highway") in ("residential", "tertiary") else None

    graph = graph_from_file(town, osm_type=["walk", truck])
    assert {data["truck"] for _, _, data in graph.edges(data=True)} == {0.0, 20.0}
    assert report(graph, town, osm_type=["walk", truck]).is_faithful
    with pytest.raises(BadValue, match="custom mode 'truck'"):
        report(graph, town)


def test_a_report_finds_a_wrong_speed_of_one_mode(town):
    graph = graph_from_file(town, osm_type=["walk", "drive"])
    edge = next((u, v) for u, v, data in graph.edges(data=True) if data["drive"] == 30.0)
    graph.edges[edge]["drive"] = 40.0
    found = report(graph, town)
    assert not found.speeds_kept
    assert found.wrong_speeds == pytest.approx(graph.edges[edge]["length"])


def test_a_context_has_the_attributes(town):
    with gamms.create_context() as ctx:
        ctx.graph.attach_networkx_graph(graph_from_file(town, osm_type=["walk", "drive"]))
        found = defaultdict(int)
        for edge in ctx.graph.graph.get_edges():
            attributes = ctx.graph.edge_attributes(edge)
            found[attributes["walk"] > 0.0, attributes["drive"] > 0.0] += 1
    assert set(found) >= {(True, True), (True, False)}


@pytest.mark.parametrize(
    ("given", "error", "text"),
    [
        ([], BadValue, "empty list"),
        (["walk", "walk"], BadValue, "two modes with the name 'walk'"),
        (["walk", "car"], BadType, "not 'car'"),
        ("walk, drive", BadType, r"not 'walk, drive'. Several modes are a list: \[walk, drive\]"),
        (["walk", ["drive"]], BadType, "not \\['drive'\\]"),
        (["walk", lambda tags: None], BadValue, "cannot have the name '<lambda>'"),
    ],
)
def test_a_wrong_list_is_refused(town, given, error, text):
    with pytest.raises(error, match=text):
        graph_from_file(town, osm_type=given)


def test_a_mode_cannot_have_the_name_of_a_tag(town):
    def surface(tags):
        return Access(5.0)

    graph_from_file(town, osm_type=["walk", surface])
    with pytest.raises(BadValue, match="'surface'"):
        graph_from_file(town, osm_type=["walk", surface], tags=["surface"])


@pytest.mark.parametrize("modes", [["walk", "drive"], ["drive", "walk"]])
def test_officers_walk_and_cars_drive_at_their_own_speeds_along_one_street(tmp_path, modes):
    file = tmp_path / "street.osm"
    file.write_text(map_of([([1, 2, 3], {"highway": "residential"})], {}))
    game = {"speed_unit": "metres_per_second", "turn_seconds": 9.0, "weight": "travel_time", "max_turns": 2}
    with gamms.create_context(seed=1, game=game) as ctx:
        ctx.graph.attach_networkx_graph(graph_from_file(file, osm_type=modes, resolution=1e6))
        for name, mode in (("officer", "walk"), ("car", "drive")):
            goes = gamms.strategies.goto(ctx, 1)
            ctx.agent.create_agent(name, start_node_id=0, mode=mode, speed=float("inf"), strategy=goes)
        metres = ctx.graph.columns().lengths[0]
        with ctx.game.batch(3) as games:
            games.run()
            shares = games.columns()["share"]
        ctx.game.run()
        assert [agent.offset_m for agent in ctx.agent.create_iter()] == pytest.approx([25.0, 150.0])
        assert (shares * metres).tolist() == [pytest.approx([150.0, 25.0])] * 3
