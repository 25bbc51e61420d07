"""Maps with objects that are deleted, incomplete, or given several times: which of them count, for roads and walls."""

import bz2
import gzip
import random
from collections import Counter
from dataclasses import dataclass, field, replace

import networkx as nx
import osmium
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import gamms
from gamms.errors import BadFile
from gamms.osm import (
    graph_from_file,
    graph_from_xml,
    obstacle_from_file,
    process_osm_graph,
    report,
    scenery_from_file,
)
from gamms.osm.osmium_reader import has_pbf_repeats

MODES = [None, *gamms.osm.modes()]
ROAD = {"highway": "residential"}
WHOLE = 1e6  # a resolution that cuts no road


@dataclass
class Thing:
    """A node, a way or a relation in a file."""

    kind: str
    id: int
    tags: dict = field(default_factory=dict)
    refs: list = field(default_factory=list)  # of the nodes of a way, or pairs of a way and its role
    place: tuple = (60.17, 24.94)
    about: dict = field(default_factory=dict)  # other attributes, such as version
    more: str = ""  # other elements in it

    def text(self):
        about = dict(self.about)
        if self.kind == "node" and self.place is not None:
            about |= {"lat": f"{self.place[0]:.7f}", "lon": f"{self.place[1]:.7f}"}
        inside = self.more
        if self.kind == "way":
            inside += "".join(f'<nd ref="{ref}"/>' for ref in self.refs)
        if self.kind == "relation":
            inside += "".join(f'<member type="way" ref="{ref}" role="{role}"/>' for ref, role in self.refs)
        inside += "".join(f'<tag k="{key}" v="{value}"/>' for key, value in self.tags.items())
        given = "".join(f' {key}="{value}"' for key, value in about.items())
        return f'<{self.kind} id="{self.id}"{given}>{inside}</{self.kind}>'


def node(id, north=0.0, east=0.0, tags=None, **about):
    """A node so many ten-thousandths of a degree from the corner."""
    return Thing("node", id, tags or {}, place=(60.17 + north * 1e-4, 24.94 + east * 1e-4), about=about)


def way(id, refs, tags=None, **about):
    return Thing("way", id, ROAD if tags is None else tags, [*refs], about=about)


def relation(id, refs, tags, **about):
    return Thing("relation", id, tags, [*refs], about=about)


def written(path, things, more=""):
    path.write_text(f'<osm version="0.6">{more}{"".join(one.text() for one in things)}</osm>')
    return path


@pytest.fixture
def write(tmp_path):
    """A function from objects to the path of an .osm file."""
    return lambda *things, name="map.osm", more="": written(tmp_path / name, things, more)


ROW = [node(id, 0.0, 10.0 * id) for id in range(1, 5)]  # four nodes in a row, 55.5 m apart


def lengths(file, **options):
    graph = graph_from_file(file, WHOLE, **{"retain_all": True, "simplify": False, **options})
    return sorted(round(data["length"], 1) for u, v, data in graph.edges(data=True) if u < v)


# -- ways without nodes -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("mode", "refs"), [*((mode, []) for mode in MODES), ("walk", [1]), ("walk", [1, 1]), ("walk", [77, 78])]
)
@pytest.mark.parametrize("at", [0, 1, 2])
def test_a_way_without_nodes_is_skipped(write, mode, refs, at):
    ways = [way(7, [1, 2]), way(8, [2, 3])]
    for tags in (ROAD, {"highway": "pedestrian", "area": "yes"}, {"building": "yes"}, {"barrier": "wall"}):
        ways.insert(at, way(100 + len(ways), refs, tags))
    file = write(*ROW, *ways)
    assert lengths(file, osm_type=mode) == [55.5, 55.5]
    assert not list(obstacle_from_file(file, barriers=True))


@pytest.mark.parametrize("refs", [[], [1], [77, 78]])
@pytest.mark.parametrize("mode", [None, "walk", "drive"])
def test_a_map_of_ways_without_nodes_asks_for_them(write, refs, mode):
    with pytest.raises(BadFile, match=r"roads without their nodes\. Export it with all nodes"):
        graph_from_file(write(*ROW, way(7, refs)), osm_type=mode)


def test_a_multipolygon_without_members_is_no_area(write):
    square = {"type": "multipolygon", "highway": "pedestrian", "building": "yes"}
    file = write(*ROW, way(7, [1, 2]), relation(9, [], square), relation(10, [(7, "outer"), (99, "outer")], square))
    assert lengths(file, osm_type="walk") == [55.5]
    assert not list(obstacle_from_file(file))


# -- deleted objects --------------------------------------------------------------------------------------------

DELETED = {"action": "delete"}, {"visible": "false"}, {"action": "delete", "visible": "true", "version": "3"}
HOUSE = [node(11, 5, 0), node(12, 5, 5), node(13, 8, 5), node(14, 8, 0)]


@pytest.mark.parametrize("about", DELETED)
def test_a_deleted_way_is_not_there(write, about):
    file = write(
        *ROW, *HOUSE, way(7, [1, 2]), way(8, [2, 3], **about), way(9, [11, 12, 13, 14, 11], {"building": "yes"})
    )
    assert lengths(file) == [55.5]
    assert len(list(obstacle_from_file(file))) == 4
    deleted = way(9, [11, 12, 13, 14, 11], {"building": "yes"}, **about)
    assert not list(obstacle_from_file(write(*ROW, *HOUSE, way(7, [1, 2]), deleted)))


@pytest.mark.parametrize("about", DELETED)
def test_a_deleted_node_cuts_its_ways(write, about):
    gone = node(2, 0.0, 20.0, {"highway": "crossing"}, **about)
    file = write(ROW[0], gone, *ROW[2:], way(7, [1, 2, 3, 4]))
    assert lengths(file) == [55.5]
    assert lengths(file, clip=(24, 60, 25, 61)) == [55.5]
    assert not any("highway" in data for _, data in graph_from_file(file, tags=["highway"]).nodes(data=True))


@pytest.mark.parametrize("about", DELETED)
def test_a_deleted_barrier_does_not_block(write, about):
    bollard = node(2, 0.0, 20.0, {"barrier": "bollard"})
    ways = way(7, [1, 2]), way(8, [2, 3])
    assert graph_from_file(write(ROW[0], bollard, *ROW[2:], *ways), osm_type="drive").graph["barriers"] == 1
    file = write(ROW[0], replace(bollard, about=about, id=5), *ROW[1:], *ways)
    assert graph_from_file(file, osm_type="drive").graph["barriers"] == 0


@pytest.mark.parametrize("about", DELETED)
def test_a_deleted_multipolygon_is_no_building_and_no_restriction(write, about):
    ring = way(8, [11, 12, 13, 14, 11], {})
    building = {"type": "multipolygon", "building": "yes"}
    things = *ROW, *HOUSE, way(7, [1, 2]), ring
    assert len(list(obstacle_from_file(write(*things, relation(9, [(8, "outer")], building))))) == 4
    assert not list(obstacle_from_file(write(*things, relation(9, [(8, "outer")], building, **about))))
    forbidden = relation(9, [(7, "from")], {"type": "restriction"}, **about)
    kept = relation(10, [(7, "from")], {"type": "restriction"})
    file = write(*things, forbidden, kept, kept)
    assert report(graph_from_file(file), file).turn_restrictions_ignored == 1


def test_new_objects_of_an_editor_have_negative_ids(write):
    nodes = [replace(one, id=-one.id) for one in (*ROW, *HOUSE)]
    building = {"type": "multipolygon", "building": "yes"}
    file = write(
        *(way(-7, [-1, -2]), way(-8, [-11, -12, -13, -14, -11], {})),
        *(relation(-9, [(-8, "outer"), (9_000_000_000_000_000_000, "inner")], building), *nodes),
    )
    assert lengths(file, osm_type="walk") == [55.5]
    assert len(list(obstacle_from_file(file))) == 4


# -- several versions -------------------------------------------------------------------------------------------


def orders(*things):
    """The objects forward, and backward."""
    return [[*things], [*things][::-1]]


@pytest.mark.parametrize("turn", [0, 1])
def test_of_several_versions_the_highest_counts(write, turn):
    moved = node(2, 3.0, 20.0, version="3")
    things = *ROW, moved, way(7, [1, 2], version="1"), way(7, [2, 3], version="12"), way(7, [3, 4], version="3")
    plain = write(*ROW[:1], moved, *ROW[2:], way(7, [2, 3]), name="plain.osm")
    assert lengths(write(*orders(*things)[turn])) == lengths(plain)


@pytest.mark.parametrize("turn", [0, 1])
def test_a_way_that_its_last_version_deletes_or_closes_is_gone(write, turn):
    old = way(8, [2, 3], version="1"), way(9, [3, 4], version="1")
    new = way(8, [], {}, version="2", visible="false"), way(9, [3, 4], {"natural": "cliff"}, version="2")
    assert lengths(write(*ROW, way(7, [1, 2], version="1"), *orders(*old, *new)[turn])) == [55.5]
    back = way(8, [2, 3], version="3")
    assert lengths(write(*ROW, way(7, [1, 2], version="1"), *orders(*old, *new, back)[turn])) == [55.5, 55.5]


@pytest.mark.parametrize("turn", [0, 1])
def test_walls_and_areas_are_those_of_the_last_version(write, turn):
    ring = way(8, [11, 12, 13, 14, 11], {}, version="1")
    old = relation(9, [(8, "outer")], {"type": "multipolygon", "building": "yes"}, version="1")
    new = relation(9, [(8, "outer")], {"type": "multipolygon", "landuse": "grass"}, version="2")
    things = *ROW, *HOUSE, way(7, [1, 2, 13], version="1"), ring
    assert len(list(obstacle_from_file(write(*things, old)))) == 4
    file = write(*orders(*things, old, new)[turn])
    assert not list(obstacle_from_file(file))
    with gamms.create_context(logger_config={"level": "CRITICAL"}) as ctx:
        ctx.graph.attach_networkx_graph(graph_from_file(file))
        found = scenery_from_file(file, ctx)
        assert (len(found.kinds), len(found.buildings.ids)) == (1, 0)


def recoded(source, target):
    """Write a map in another format, as osmium names it."""
    with osmium.SimpleWriter(str(target)) as out:
        for one in osmium.FileProcessor(str(source)):
            out.add(one)
    return target


@pytest.mark.parametrize("name", ["town.osh.pbf", "town.osh", "town.osm.pbf", "town.osm.bz2", "town.osh.gz"])
def test_a_history_is_read_as_it_ends_in_any_format(write, tmp_path, name):
    things = [
        *(node(1, version="1"), node(2, 0, 10, version="1"), node(2, 0, 20, version="2"), node(3, 0, 30, version="1")),
        *(way(7, [1, 2], version="1"), way(8, [2, 3], version="1"), way(9, [1, 3], version="1")),
        way(9, [1, 3], {"natural": "cliff"}, version="2"),
    ]
    if ".osm." not in name:  # other formats have no deleted objects
        things.append(way(8, [], {}, version="2", visible="false"))
    file = recoded(write(*things), tmp_path / name)
    assert lengths(file) == ([111.0] if ".osm." not in name else [55.5, 111.0])
    assert lengths(file, clip=(24, 60, 25, 61)) == lengths(file)


def test_a_place_where_a_node_was_once_is_not_in_an_area(write):
    file = write(*ROW, node(3, 0.0, 500.0, version="2"), way(7, [1, 2, 3, 4]))
    area = (24.9405, 60.169, 24.9445, 60.171)
    assert lengths(file, clip=area) == [55.5]
    assert lengths(write(*ROW, way(7, [1, 2, 3, 4])), clip=area) == [55.5, 55.5, 55.5]


# -- the same version several times -----------------------------------------------------------------------------


def test_a_way_that_is_given_in_pieces_is_all_there(write):
    file = write(*ROW, way(7, [1, 2]), way(7, [2, 3]), way(7, [3, 4]))
    assert lengths(file) == [55.5, 55.5, 55.5]
    graph = graph_from_file(file, 20.0)
    assert {data["osmid"] for *_, data in graph.edges(data=True)} == {7}
    assert report(graph, file).is_faithful


@pytest.mark.parametrize("turn", [0, 1])
def test_equal_objects_count_once(write, turn):
    tagged = node(2, 0.0, 20.0, {"highway": "crossing"})
    repeats = *ROW, tagged, way(7, [1, 2, 3], {}), way(7, [1, 2, 3]), way(7, [3, 2, 1]), way(7, [])
    file = write(*orders(*ROW, way(7, [1, 2, 3]), *repeats)[turn])
    assert lengths(file) == [55.5, 55.5]
    assert [name for _, name in graph_from_file(file, tags=["highway"]).nodes(data="highway") if name] == ["crossing"]


def test_both_directions_of_a_way_are_two_one_way_roads(write):
    one_way = {**ROAD, "oneway": "yes"}
    file = write(*ROW, way(7, [1, 2], one_way), way(7, [2, 1], one_way))
    graph = graph_from_file(file, WHOLE, osm_type="drive", simplify=False)
    assert sorted(graph.edges) == [(0, 1), (1, 0)]


@pytest.mark.parametrize("turn", [0, 1])
@pytest.mark.parametrize(
    ("things", "words"),
    [
        ((way(7, [1, 2, 3]), way(7, [2, 3, 4])), "way 7 is there several times in one version, with different nodes"),
        ((way(7, [1, 2]), node(2, 5.0)), "node 2 is there several times in one version, at different places"),
    ],
)
def test_objects_that_contradict_each_other_are_named(write, things, words, turn):
    file = write(*orders(*ROW, *things)[turn])
    for read in (graph_from_file, graph_from_xml, lambda file: graph_from_file(file, clip=(24, 60, 25, 61))):
        with pytest.raises(BadFile, match=words):
            read(file)


def test_contradictions_beside_the_roads_matter_to_no_road(write):
    ring = way(8, [11, 12, 13, 14, 11], {"building": "yes"})
    file = write(*ROW, *HOUSE, node(11, 6.0), way(7, [1, 2]), ring)
    assert lengths(file, around_buildings=False) == [55.5]
    with pytest.raises(BadFile, match="node 11"):
        obstacle_from_file(file)
    tags = {"type": "multipolygon", "building": "yes"}
    file = write(*ROW, *HOUSE, way(7, [1, 2]), relation(9, [(8, "outer")], tags), relation(9, [], tags))
    assert lengths(file) == [55.5]
    with pytest.raises(BadFile, match="relation 9 is there several times in one version, with different members"):
        obstacle_from_file(file)


def test_thousands_of_pieces_of_a_way_are_read_at_once(write):
    nodes = [node(id, 0.0, id * 0.01) for id in range(3_001)]
    file = write(*nodes, *(way(7, [id, id + 1]) for id in range(3_000)))
    assert len(graph_from_file(file, WHOLE)) == 2


# -- nodes at one place -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("mode", [None, "walk"])
@pytest.mark.parametrize("simplify", [True, False])
@pytest.mark.parametrize(
    "lines",
    [
        [[1, 3, 2], [2, 3, 4], [3, 5]],  # a piece of length 0 there and back
        [[1, 3, 2, 3, 4], [3, 5]],
        [[1, 2, 6, 3, 2, 4], [6, 5]],  # around a ring of length 0
        [[2, 1], [3, 6, 4], [6, 3, 2], [5, 3]],
        [[3, 2, 1], [4, 2, 6], [2, 2, 5, 5]],  # at the ends
    ],
)
def test_roads_of_length_0_are_no_roads(write, lines, simplify, mode):
    nodes = [node(1, 0, 0), *(node(id, 0, 18) for id in (2, 3, 6)), node(4, 0, 36), node(5, 9, 18)]
    file = write(*nodes, *(way(100 + row, refs, {"highway": "footway"}) for row, refs in enumerate(lines)))
    for resolution, nodes in ((WHOLE, 4), (50.0, 4 + 3)):
        graph = graph_from_file(file, resolution, osm_type=mode, simplify=simplify)
        assert (len(graph), graph.number_of_edges()) == (nodes, 2 * (nodes - 1))
        assert min(data["length"] for *_, data in graph.edges(data=True)) > 40.0
        assert report(graph, file).is_faithful
    assert len(graph_from_xml(file, WHOLE)) == 4


def test_a_loop_of_length_0_in_a_graph_is_no_road():
    graph = nx.MultiDiGraph(crs="EPSG:32635")
    graph.add_nodes_from([(0, {"x": 5e5, "y": 6.7e6}), (1, {"x": 5e5 + 100, "y": 6.7e6})])
    graph.add_edges_from([(0, 1), (0, 0), (1, 1)])
    cut = process_osm_graph(graph, WHOLE, bidirectional=True)
    assert sorted(cut.edges) == [(0, 1), (1, 0)]


@pytest.mark.parametrize("mode", [None, "walk", "drive"])
@pytest.mark.parametrize("refs", [[1, 2, 1], [1, 2, 1, 2], [1, 1, 2, 2], [1, 2, 3, 2, 4]])
def test_a_way_that_turns_back_is_as_long_as_the_map_says(write, mode, refs):
    file = write(*ROW, way(7, refs))
    graph = graph_from_file(file, 20.0, osm_type=mode)
    assert report(graph, file).is_faithful


# -- damage changes nothing -------------------------------------------------------------------------------------

TOWN = [
    *(node(1 + id, 5.0 * (id // 4), 10.0 * (id % 4), version="5") for id in range(16)),
    *(node(20 + id, 6.0 + id // 2, 12.0 + 2 * (id % 2), version="5") for id in range(4)),
    *(way(100 + row, range(1 + 4 * row, 5 + 4 * row), version="5") for row in range(4)),
    *(way(110 + col, range(1 + col, 17, 4), {"highway": "footway"}, version="5") for col in range(4)),
    way(120, [20, 21, 23, 22, 20], {"building": "yes"}, version="5"),
    way(121, [6, 7, 11, 10, 6], {}, version="5"),
    way(122, [1, 16], {"barrier": "wall"}, version="5"),
    relation(130, [(121, "outer")], {"type": "multipolygon", "highway": "pedestrian"}, version="5"),
    relation(131, [(121, "outer")], {"type": "multipolygon", "leisure": "park"}, version="5"),
]


def content(file, mode):
    """The length of each way and the walls of a map, whatever the order of its objects."""
    graph = graph_from_file(file, WHOLE, osm_type=mode, retain_all=True, simplify=False)
    edges = Counter()
    for *_, data in graph.edges(data=True):
        edges[data["osmid"], data["highway"], data["oneway"]] += round(data["length"], 3)
    walls = [(wall["type"], sorted([wall["bl"], wall["br"]])) for wall in obstacle_from_file(file, barriers=True)]
    return {way: round(metres, 1) for way, metres in edges.items()}, sorted(walls)


@pytest.fixture(scope="module")
def town(tmp_path_factory):
    """The contents of an undamaged town by modes."""
    file = written(tmp_path_factory.mktemp("town") / "town.osm", TOWN)
    return {mode: content(file, mode) for mode in MODES}


def damaged(one, rng):
    """The object among others that do not count."""
    found = [one]
    for _ in range(rng.randrange(3)):
        garbage = rng.choice(
            [
                replace(one, about={"version": str(rng.randrange(5))}, place=(60.2, 25.0), refs=one.refs[:1]),
                replace(one, about={"version": "4", "visible": "false"}),
                replace(one, about={"version": "4", "action": "delete"}),
                replace(one, id=one.id + 1000, about=rng.choice(DELETED)),
                replace(one, more='<center lat="1" lon="2"/>' if one.kind != "node" else ""),
                one,
                way(2000 + rng.randrange(100), rng.choice([[], [3]]), rng.choice([ROAD, {"building": "yes"}])),
            ]
        )
        found.append(garbage)
    return found


@settings(max_examples=8, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(seed=st.integers(0, 2**32), mode=st.sampled_from(MODES))
def test_damage_changes_no_road_and_no_wall(tmp_path, town, seed, mode):
    rng = random.Random(seed)
    things = [thing for one in TOWN for thing in damaged(one, rng)]
    if rng.random() < 0.7:
        rng.shuffle(things)
    assert content(written(tmp_path / "damaged.osm", things), mode) == town[mode]


# -- dialects of XML, and files that are no maps ----------------------------------------------------------------

PLAIN = "".join(one.text() for one in (*ROW, way(7, [1, 2, 3])))
OF_OVERPASS = {
    "center": PLAIN.replace('<way id="7">', '<way id="7"><center lat="60" lon="24"/>'),
    "bounds": PLAIN.replace('<way id="7">', '<way id="7"><bounds minlat="1" minlon="2" maxlat="3" maxlon="4"/>'),
    "bounds and nodes": PLAIN + '<node id="50" lat="60" lon="24"><bounds/></node>',
    "count": PLAIN + '<count total="3"><tag k="nodes" v="2"/></count>',
    "area": PLAIN + '<area id="3600000001"><tag k="highway" v="x"/></area>',
    "member": PLAIN + '<relation id="5"><member type="way" ref="7" role=""><nd lat="1" lon="2"/></member></relation>',
    "geom": '<way id="7"><bounds/><nd ref="1" lat="60.17" lon="24.941"/><nd ref="2" lat="60.17" lon="24.942"/>'
    '<nd ref="3" lat="60.17" lon="24.943"/><tag k="highway" v="residential"/></way>',
    "geom and nodes": PLAIN.replace('<nd ref="2"/>', '<nd ref="2" lat="1" lon="2"/>'),
    "signs": PLAIN.replace("residential", "residential&amp;&lt;&#34;").replace('"7"', "'7'"),
}


@pytest.mark.parametrize("pack", [bytes, gzip.compress, bz2.compress], ids=["plain", "gzip", "bzip2"])
@pytest.mark.parametrize("what", OF_OVERPASS)
def test_additions_of_overpass_to_a_map_are_skipped(tmp_path, what, pack):
    file = tmp_path / "map.osm"
    file.write_bytes(pack(f'<osm version="0.6"><note>a &gt; b</note><meta/>{OF_OVERPASS[what]}</osm>'.encode()))
    assert lengths(file) == [55.5, 55.5]
    assert not list(obstacle_from_file(file))


REMARK = "<remark>runtime error: Query timed out in &quot;query&quot; at line 3</remark>"
REFUSED = {
    "change": (f'<osmChange version="0.6"><create>{PLAIN}</create></osmChange>', r"edits.*osmium apply-changes"),
    "empty change": ('<osmChange version="0.6"/>', "edits of a map"),
    "difference": (f'<osm version="0.6"><action type="create">{PLAIN}</action></osm>', "edits of a map"),
    "remark": (f'<osm version="0.6">{PLAIN}{REMARK}</osm>', "incomplete; the server reports 'runtime error: Query"),
    "only a remark": (f'<osm version="0.6">{REMARK}</osm>', 'timed out in "query" at line 3'),
    "version 1": (f'<osm version="1">{PLAIN}</osm>', r"has version='1'. Change it to <osm version=\"0.6\">"),
    "version 1.0": (f"<osm version='1.0'>{PLAIN}</osm>", "Change it to"),
    "no version": (f"<osm>{PLAIN}</osm>", "has no version. Change it to"),
    "another root": (f'<osm-derived version="0.6">{PLAIN}</osm-derived>', "begins with the element <osm-derived>"),
    "ids": ('<osm version="0.6"><way id="7"/><count total="1"/></osm>', "no roads.*Only ways with a highway tag"),
    "entities": (f'<!DOCTYPE osm [<!ENTITY x "y">]><osm version="0.6">{REMARK[:8]}&x;</remark></osm>', "entities"),
}


@pytest.mark.parametrize("pack", [bytes, gzip.compress], ids=["plain", "gzip"])
@pytest.mark.parametrize("what", REFUSED)
def test_a_file_that_is_no_map_is_refused_with_the_reason(tmp_path, what, pack):
    text, words = REFUSED[what]
    file = tmp_path / "map.osm"
    file.write_bytes(pack(text.encode()))
    reads = [graph_from_file, graph_from_xml]
    if what != "ids":
        reads.append(obstacle_from_file)
    for read in reads:
        with pytest.raises(BadFile, match=words) as caught:
            read(file)
        assert str(file) in str(caught.value)


@pytest.mark.parametrize(
    ("start", "words"),
    [
        (b"\xff\xe0\x04o5m2", "o5m. Convert it: osmium cat"),
        (b"\xff\xe0\x04o5c2", "edits of a map"),
        (b"PK\x03\x04", "zip archive"),
        (b"  \n", "is empty"),
        (b' {"version": 0.6, "elements": []}', r"JSON\. Ask Overpass for XML \(\[out:xml\]\)"),
    ],
)
def test_other_formats_are_named(tmp_path, start, words):
    file = tmp_path / "map.osm"
    file.write_bytes(start)
    with pytest.raises(BadFile, match=words):
        graph_from_file(file)


@pytest.mark.parametrize("ids", [[5, -7, 1 << 40, 3], [-1], [1, 2, 3]])
@pytest.mark.parametrize("is_repeated", [False, True])
def test_the_ids_of_a_pbf_file_are_those_that_osmium_reads(write, tmp_path, ids, is_repeated):
    things = [node(id) for id in ids] + [way(id, []) for id in ids] + [relation(id, [], {}) for id in ids]
    for kind in (0, len(ids), 2 * len(ids)):
        again = things[kind : kind + 1] if is_repeated else []
        file = recoded(write(*things, *again), tmp_path / f"map{kind}.osm.pbf")
        assert has_pbf_repeats(file) == bool(again)
