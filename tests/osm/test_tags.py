"""Tags on request: on edges, on nodes, in files and in scenarios; numbers of OpenStreetMap, crossings and signals."""

import networkx as nx
import pytest

import gamms
from gamms.errors import BadType, BadValue, TooLarge
from gamms.osm import graph_from_file, graph_from_geojson, graph_from_xml, reader
from gamms.scenario import load

NODES = {1: (60.170, 24.940), 2: (60.170, 24.941), 3: (60.170, 24.942), 4: (60.1705, 24.941), 5: (60.170, 24.9405)}
STREET = {"highway": "residential", "surface": "asphalt", "lit": "yes", "note": "x"}
WAYS = [([1, 5, 2, 3], STREET), ([2, 4], {"highway": "steps", "surface": "stone", "step_count": "12"})]
MARKS = {5: {"highway": "crossing", "crossing": "marked"}, 2: {"highway": "traffic_signals", "ref": "S1"}}


@pytest.fixture
def town(make_map):
    """A street with a crossing between its ends, and signals where stairs begin; ways count from 100."""

    def town(marks=MARKS, ways=WAYS):
        path = make_map(NODES, *ways)
        text = path.read_text()
        for id, tags in marks.items():
            inside = "".join(f'<tag k="{key}" v="{value}"/>' for key, value in tags.items())
            start = text.index("/>", text.index(f'<node id="{id}"'))
            text = f"{text[:start]}>{inside}</node>{text[start + 2 :]}"
        path.write_text(text)
        return path

    return town


def by_osmid(graph):
    return {data["osmid"]: data for _, data in graph.nodes(data=True) if "osmid" in data}


def test_edges_keep_the_tags_that_are_asked_for(town):
    graph = graph_from_file(town(), tags=["surface", "step_count"])
    found = {(data["osmid"], data["surface"], data.get("step_count")) for *_, data in graph.edges(data=True)}
    assert found == {(100, "asphalt", None), (101, "stone", "12")}
    assert not any("lit" in data or "note" in data for *_, data in graph.edges(data=True))
    assert not any("surface" in data for *_, data in graph_from_file(town()).edges(data=True))


def test_a_node_with_a_tag_that_is_asked_for_stays_a_node(town):
    graph = graph_from_file(town(), resolution=1e6, tags=["highway"])
    assert by_osmid(graph)[5]["highway"] == "crossing"
    assert "crossing" not in by_osmid(graph)[5]
    assert by_osmid(graph_from_file(town(), resolution=1e6, tags=["crossing"]))[5]["crossing"] == "marked"
    assert 5 not in by_osmid(graph_from_file(town(), resolution=1e6, tags=["surface"]))
    length = sum(data["length"] for *_, data in graph.edges(data=True))
    plain = sum(data["length"] for *_, data in graph_from_file(town(), resolution=1e6).edges(data=True))
    assert length == pytest.approx(plain)


def test_tags_go_through_contexts_files_and_networkx(town, tmp_path):
    graph = graph_from_file(town(), tags=["surface", "crossing"])
    with gamms.create_context(logger_config={"level": "CRITICAL"}) as ctx:
        ctx.graph.attach_networkx_graph(graph_from_file(town(), tags=["surface", "crossing"]))
        ctx.graph.save(tmp_path / "town.gamms")
    with gamms.create_context(logger_config={"level": "CRITICAL"}) as ctx:
        ctx.graph.load(tmp_path / "town.gamms")
        back = ctx.graph.graph.to_networkx()
        assert ctx.graph.graph.edge_attributes(0)["surface"] == "asphalt"
    assert by_osmid(back) == by_osmid(graph)
    assert list(nx.DiGraph(back).edges(data="surface")) == list(graph.edges(data="surface"))


def test_a_scenario_names_tags_and_barriers(town, tmp_path):
    town()
    (tmp_path / "game.yaml").write_text(
        "map: {file: {path: map.osm, tags: [surface], buildings: true, barriers: [wall]}}\n"
        "teams: {red: {count: 1}}\nmax_turns: 1\n"
    )
    with load(tmp_path / "game.yaml").build() as ctx:
        assert ctx.graph.graph.edge_attributes(0)["surface"] == "asphalt"


def test_the_functions_of_the_first_release_give_nodes_no_more(town):
    assert {frozenset(data) for _, data in graph_from_xml(town()).nodes(data=True)} == {frozenset("xy")}


@pytest.mark.parametrize(
    ("tags", "error", "words"),
    [
        ("surface", BadType, "tags must be a list"),
        (7, BadType, "tags must be a list"),
        ([7], BadType, "names of tags"),
        (["length"], BadValue, "'length'"),
        (["z"], BadValue, "'z'"),
        ([""], BadValue, "''"),
        (["t" * 256], BadValue, "not a valid tag"),
        ([f"t{i}" for i in range(257)], BadValue, "the limit is 256"),
    ],
)
def test_impossible_names_are_refused(town, tags, error, words):
    with pytest.raises(error, match=words):
        graph_from_file(town(), tags=tags)


def test_an_unknown_option_is_refused(town):
    with pytest.raises(BadType, match="Did you mean 'tags'"):
        graph_from_file(town(), tag=["surface"])


def test_nodes_with_tags_have_to_fit_into_memory(town, monkeypatch):
    monkeypatch.setattr(reader, "_BYTES_PER_POINT", 1 << 23)
    lamps = {id: {"highway": "street_lamp"} for id in NODES}
    assert len(graph_from_file(town(marks={})))
    with pytest.raises(TooLarge, match="honest files"):
        graph_from_file(town(marks=lamps))


def test_geojson_keeps_all_properties_and_its_nodes_have_no_numbers(tmp_path):
    path = tmp_path / "roads.geojson"
    path.write_text(
        '{"type": "Feature", "properties": {"surface": "gravel"},'
        ' "geometry": {"type": "LineString", "coordinates": [[24.94, 60.17], [24.941, 60.17]]}}'
    )
    graph = graph_from_geojson(path)
    assert graph.edges[0, 1]["surface"] == "gravel"
    assert not by_osmid(graph)
