"""GeoJSON lines: what joins, what is kept, and what hostile files get."""

import json
import sys

import networkx as nx
import pytest

from gamms import limits
from gamms.errors import BadFile, BadType, BadValue, TooLarge
from gamms.osm import graph_from_file, graph_from_geojson, is_geojson

NO_CUT = 1e6
A, B, C, D = [24.94, 60.17], [24.941, 60.17], [24.942, 60.17], [24.941, 60.1705]


def line(*places, **properties):
    return {"type": "Feature", "properties": properties, "geometry": {"type": "LineString", "coordinates": [*places]}}


@pytest.fixture
def write(tmp_path):
    def write(content, name="map.geojson"):
        path = tmp_path / name
        if isinstance(content, bytes):
            path.write_bytes(content)
        else:
            path.write_text(content if isinstance(content, str) else json.dumps(content), encoding="utf-8")
        return path

    return write


def collection(*features, **members):
    return {"type": "FeatureCollection", "features": [*features], **members}


def load(path, **wishes):
    return graph_from_geojson(path, NO_CUT, **wishes)


def test_lines_join_at_equal_coordinates(write):
    graph = load(write(collection(line(A, B, C, name="x"), line(B, D, name="y"))))
    assert (graph.number_of_nodes(), graph.number_of_edges()) == (4, 6)
    assert nx.is_strongly_connected(graph)
    assert graph.graph["crs"] == "EPSG:32635"


@pytest.mark.parametrize(
    "content",
    [
        line(A, B),
        line(A, B)["geometry"],
        collection(line(A, B)),
        {"type": "MultiLineString", "coordinates": [[A, B]]},
        {"type": "GeometryCollection", "geometries": [line(A, B)["geometry"], {"type": "Point", "coordinates": A}]},
        collection({"type": "Feature", "properties": None, "geometry": None}, line(A, B)),
        collection(line([*A, 17.5], [*B, 18.5])),
        collection(line(A, B), {"type": "Feature", "geometry": {"type": "Polygon", "coordinates": [[A, B, D, A]]}}),
        collection(line(A, B), crs={"type": "name", "properties": {"name": "urn:ogc:def:crs:OGC:1.3:CRS84"}}),
    ],
)
def test_every_form_of_a_line_is_read(write, content):
    assert load(write(content)).number_of_nodes() == 2


def test_a_byte_order_mark_is_passed_over(write):
    assert load(write(b"\xef\xbb\xbf" + json.dumps(line(A, B)).encode())).number_of_nodes() == 2


def test_properties_never_replace_our_own(write):
    data = load(write(line(A, B, id="x", length=3, linestring="y", geometry=1, u_of_edge=1, self=2))).edges[0, 1]
    assert (data["id"], data["u_of_edge"], data["self"]) == (0, 1, 2)
    assert data["length"] == pytest.approx(55.5, rel=0.01)
    assert "geometry" not in data


def test_a_street_against_its_drawing_is_turned(write):
    graph = load(write(line(A, B, oneway="-1")), bidirectional=False)
    assert graph.nodes[0]["x"] > graph.nodes[1]["x"]


def test_the_largest_part_is_kept_unless_all_are_asked_for(write):
    path = write(collection(line([25.0, 60.0], [25.001, 60.0]), line(A, B, C), line(B, D)))
    assert load(path).number_of_nodes() == 4
    assert load(path, retain_all=True).number_of_nodes() == 6


def test_the_credit_is_that_of_the_file(write):
    assert "attribution" not in load(write(line(A, B))).graph
    assert load(write(collection(line(A, B), copyright="© me"))).graph["attribution"] == "© me"


def test_a_geojson_file_is_distinguished_from_a_map_of_osm(write, make_map, cross):
    assert is_geojson(write(line(A, B)))
    assert not is_geojson(make_map(cross, ([1, 2], {"highway": "steps"})))


BAD = {
    "empty": b"",
    "text": b"hello",
    "list": b"[]",
    "number": b"3",
    "binary": bytes(range(256)),
    "utf-16": json.dumps(line(A, B)).encode("utf-16"),
    "cut off": json.dumps(collection(line(A, B))).encode()[:-5],
    "no type": b"{}",
    "no lines": json.dumps(collection()).encode(),
    "points only": b'{"type": "Point", "coordinates": [1, 2]}',
    "features no list": b'{"type": "FeatureCollection", "features": 3}',
    "feature no object": b'{"type": "FeatureCollection", "features": [3]}',
    "geometry no object": b'{"type": "Feature", "geometry": 3}',
    "geometry without type": b'{"type": "Feature", "geometry": {}}',
    "coordinates no list": b'{"type": "LineString", "coordinates": "abc"}',
    "coordinates missing": b'{"type": "LineString"}',
    "multi no list": b'{"type": "MultiLineString", "coordinates": 1}',
    "collection no list": b'{"type": "GeometryCollection"}',
    "position no list": b'{"type": "LineString", "coordinates": [1, 2]}',
    "position an object": b'{"type": "LineString", "coordinates": [{"a": 1}, {"a": 2}]}',
    "position short": b'{"type": "LineString", "coordinates": [[1], [2]]}',
    "position text": b'{"type": "LineString", "coordinates": [["1", "2"], ["1", "3"]]}',
    "position bool": b'{"type": "LineString", "coordinates": [[true, false], [1, 2]]}',
    "nan": b'{"type": "LineString", "coordinates": [[NaN, 1], [1, 2]]}',
    "infinity": b'{"type": "LineString", "coordinates": [[1e999, 1], [1, 2]]}',
    "huge": b'{"type": "LineString", "coordinates": [[' + b"9" * 400 + b", 1], [1, 2]]}",
    "endless digits": b'{"type": "LineString", "coordinates": [[' + b"9" * 5000 + b", 1], [1, 2]]}",
    "metres": b'{"type": "LineString", "coordinates": [[385000, 6672000], [385100, 6672000]]}',
    "other crs": json.dumps({**line(A, B), "crs": {"properties": {"name": "EPSG:3857"}}}).encode(),
    "strange crs": json.dumps({**line(A, B), "crs": "EPSG:3857"}).encode(),
    "properties a list": json.dumps({**line(A, B), "properties": [1]}).encode(),
    "deep list": b"[" * 200_000,
    "deep object": b'{"a":' * 200_000,
    "deep position": b'{"type": "LineString", "coordinates": ' + b"[" * 900 + b"]" * 900 + b"}",
    "one point": json.dumps(line(A, A)).encode(),
    "one position": json.dumps(line(A)).encode(),
    "no position": json.dumps(line()).encode(),
}


@pytest.mark.parametrize("content", BAD.values(), ids=BAD.keys())
def test_an_invalid_map_is_refused_by_its_name(write, content):
    path = write(content)
    with pytest.raises(BadFile) as caught:
        graph_from_geojson(path)
    assert str(path) in str(caught.value)
    assert len(str(caught.value)) < 600


def test_collections_inside_collections_end_somewhere(write):
    nested = line(A, B)["geometry"]
    for _ in range(100):
        nested = {"type": "GeometryCollection", "geometries": [nested]}
    with pytest.raises(BadFile, match="deep"):
        graph_from_geojson(write(nested))


def test_a_file_of_absurd_size_is_not_even_opened(write):
    with limits.allowing(1000), pytest.raises(TooLarge, match="max-memory"):
        graph_from_geojson(write(line(A, B)))


def test_properties_that_are_nested_too_deep_are_named(write):
    nested = []
    for _ in range(900):
        nested = [nested]
    path = write(collection(line((24.0, 60.0), (24.1, 60.0), name="A"), line((24.0, 60.0), (24.1, 60.1), odd=nested)))
    with pytest.raises(BadFile, match=r"the property 'odd' of feature 2.* is nested more than 24 levels deep"):
        load(path)


def test_a_line_that_would_be_cut_into_millions_of_pieces_is_refused(write):
    with pytest.raises(TooLarge, match="m of road in pieces"):
        graph_from_geojson(write(line([24.0, 60.0], [25.0, 60.0])), resolution=0.01)


def test_lines_at_the_pole_are_refused(write):
    with pytest.raises(BadValue, match="84"):
        graph_from_geojson(write(line([0.0, 89.0], [1.0, 89.0])))


def test_a_path_is_a_path(tmp_path):
    with pytest.raises(BadType):
        graph_from_geojson(3)
    with pytest.raises(FileNotFoundError):
        graph_from_geojson(tmp_path / "nowhere.geojson")
    with pytest.raises(IsADirectoryError):
        graph_from_geojson(tmp_path)


def test_it_needs_no_osmium(write, monkeypatch):
    monkeypatch.setitem(sys.modules, "osmium", None)
    assert load(write(line(A, B))).number_of_nodes() == 2


def test_osm_and_geojson_are_not_mixed_up(write, make_map, cross):
    with pytest.raises(BadFile):
        graph_from_file(write(line(A, B)))
    with pytest.raises(BadFile):
        graph_from_geojson(make_map(cross, ([1, 2], {"highway": "steps"})))


# -- lines that nearly meet ---------------------------------------------------------------------------------------


def parts_of(graph):
    return nx.number_weakly_connected_components(graph)


def test_ends_that_nearly_meet_are_joined_by_snapping(write, caplog):
    near = [A[0] + 1e-9, A[1]]
    file = write(collection(line(A, C, name="x"), line(near, D, name="y")))
    with caplog.at_level("WARNING", logger="gamms"):
        assert len(load(file)) == 2
    assert "map.geojson has 2 lines in 2 parts; 41.5% of their length" in caplog.text
    assert "snap=" in caplog.text
    caplog.clear()
    graph = load(file, snap=0.5)
    assert (len(graph), parts_of(graph), caplog.text) == (3, 1, "")


def test_an_end_beside_a_line_becomes_a_vertex_of_it(write):
    beside = [B[0], B[1] + 1e-6]  # 0.11 m from the middle of the line from A to C
    file = write(collection(line(A, C), line(beside, D)))
    assert load(file, retain_all=True, snap=0.1).number_of_nodes() == 4
    graph = load(file, snap=0.2)
    assert (graph.number_of_nodes(), graph.number_of_edges()) == (4, 6)
    length = sum(data["length"] for *_, data in load(file, retain_all=True).edges(data=True))
    assert sum(data["length"] for *_, data in graph.edges(data=True)) == pytest.approx(length, abs=0.01)


def test_several_ends_beside_one_line_are_in_order(write):
    sides = [line([24.94 + 0.0001 * k, 60.170001], [24.94 + 0.0001 * k, 60.171], name=str(k)) for k in (15, 3, 9)]
    graph = load(write(collection(line(A, C, name="x"), *sides)), snap=1.0)
    assert (len(graph), parts_of(graph)) == (8, 1)
    along = [data["length"] for *_, data in graph.edges(data=True) if data["name"] == "x"]
    assert sum(along) / 2 == pytest.approx(111.0, abs=0.1)


def test_lines_that_cross_stay_apart(write):
    graph = load(write(collection(line(A, C), line([24.941, 60.169], D))), retain_all=True, snap=5.0)
    assert parts_of(graph) == 2


def test_snapping_changes_nothing_where_all_lines_meet(write):
    file = write(collection(line(A, B, C, name="x"), line(B, D, name="y"), line(A, [24.94, 60.171], D, A)))
    one, other = load(file), load(file, snap=2.0)
    assert list(one.edges(data="length")) == list(other.edges(data="length"))


@pytest.mark.parametrize("lines", [[[A]], [[]], [[A], [A, C], [[24.9400001, 60.17], D]]])
def test_lines_without_a_length_are_passed_over(write, lines):
    file = write(collection(*(line(*places) for places in lines)))
    try:
        assert len(load(file, snap=1.0)) == 2  # from C to D, by way of A
    except BadFile:
        assert len(lines) == 1


def test_masses_of_near_lines_are_refused(write, monkeypatch):
    from gamms.osm import geojson

    monkeypatch.setattr(geojson, "_FEW_NEAR", 100)
    monkeypatch.setattr(geojson, "_MOST_NEAR", 1)
    file = write(collection(*(line([24.94 + 1e-9 * k, 60.17], [24.941, 60.17 + 1e-9 * k]) for k in range(40))))
    with pytest.raises(BadFile, match="too many lines are within 5 m"):
        load(file, snap=5.0)


@pytest.mark.parametrize(
    ("snap", "error"), [(-1.0, BadValue), (float("nan"), BadValue), (1e9, BadValue), ("x", BadType)]
)
def test_a_distance_to_snap_that_is_none_is_refused(write, snap, error):
    with pytest.raises(error, match="snap"):
        load(write(collection(line(A, B))), snap=snap)


@pytest.mark.parametrize(
    ("oneway", "directions"),
    [
        *(
            (value, [True])
            for value in (1, 1.0, True, "1", "yes", "Yes", " TRUE ", "F", "FT", "1.0", "forward", "Y", "t", ["yes"])
        ),
        *((value, [False]) for value in (-1, -1.0, "-1", "Reverse", "T", "TF", "backward", ["-1"])),
        *((value, [False, True]) for value in (0, False, None, "no", "0", 2, "", "maybe", "f", "N", "reversible")),
    ],
)
def test_one_way_lines_may_be_written_as_numbers_and_truths(write, oneway, directions):
    graph = load(write(line(A, B, oneway=oneway)), bidirectional=False)
    east = [graph.nodes[v]["x"] > graph.nodes[u]["x"] for u, v in graph.edges]
    assert sorted(east) == directions


@pytest.mark.parametrize("places", [[], [A]])
def test_lines_without_two_places_are_skipped(write, places):
    graph = load(write(collection(line(*places), line(A, B), line(*places))))
    assert graph.number_of_edges() == 2
    with pytest.raises(BadFile, match="no lines; only LineString and MultiLineString are roads"):
        load(write(line(*places)))


def test_an_answer_of_overpass_in_json_is_named(write):
    answer = {"version": 0.6, "elements": [], "remark": "runtime error: Query timed out"}
    with pytest.raises(BadFile, match=r"answer of Overpass.*the server reports 'runtime error: Query.*\[out:xml\]"):
        load(write(answer))


OVERTURE = {"subtype": "road", "class": "residential", "connectors": [{"connector_id": "c1", "at": 0.0}]}


@pytest.mark.parametrize(
    ("properties", "words"),
    [
        (OVERTURE, "feature 2 has 'connectors': these are roads of Overture Maps, whose speeds, directions, access"),
        ({"class": "motorway", "access_restrictions": "[]"}, "has 'access_restrictions': .* Overture"),
        ({"class": "motorway", "speed_limits": None}, "has 'speed_limits': .* Overture"),
        ({"id": 3, "startid": 0, "endid": 1}, "has 'startid': these are edges of a route graph of Nav2, whose frame"),
    ],
)
@pytest.mark.parametrize("kind", ["LineString", "MultiLineString"])
def test_roads_of_another_format_are_refused_by_its_name(tmp_path, properties, words, kind):
    line = [[24.94, 60.17], [24.95, 60.17]]
    shape = {"type": kind, "coordinates": line if kind == "LineString" else [line]}
    point = {"type": "Feature", "properties": {"id": 0, "frame": "map"}, "geometry": None}
    features = [point, {"type": "Feature", "properties": properties, "geometry": shape}]
    path = tmp_path / "roads.geojson"
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features}), encoding="utf-8")
    with pytest.raises(BadFile, match=f"{words}.*Convert it first"):
        graph_from_geojson(path)
