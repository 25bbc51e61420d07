"""GPX tracks as paths on a graph."""

import pytest

import gamms
from gamms.errors import BadFile, BadType, BadValue, TooLarge
from gamms.graph import finding


def gpx(ctx, path, *segments, kind="trk"):
    """Write places on the map as a file."""
    lines = ['<?xml version="1.0"?>', '<gpx version="1.1" xmlns="http://www.topografix.com/GPX/1/1">']
    for places in segments:
        lines.append("<trk><trkseg>" if kind == "trk" else "<rte>")
        for x, y in places:
            lat, lon = ctx.graph.to_latlon(385_000.0 + x, 6_672_000.0 + y)
            lines.append(f'<{kind}pt lat="{lat:.9f}" lon="{lon:.9f}"><ele>3</ele></{kind}pt>')
        lines.append("</trkseg></trk>" if kind == "trk" else "</rte>")
    path.write_text("\n".join([*lines, "</gpx>"]), encoding="utf-8")
    return path


def test_a_track_is_the_path_along_the_nearest_edges(town, tmp_path):
    walk = [(3, 4), (40, -6), (70, 5), (160, 3), (203, 20), (196, 90), (204, 190)]
    found = town.graph.track(gpx(town, tmp_path / "a.gpx", walk))
    assert found.paths == [[0, 1, 2, 7, 12]]
    assert len(found.edges) == 7
    assert None not in found.edges


def test_between_far_points_the_shortest_path_leads(town, tmp_path):
    found = town.graph.track(gpx(town, tmp_path / "a.gpx", [(0, 0), (400, 300)], kind="rte"))
    assert found.paths == [town.graph.shortest_path(0, 19)]


def test_a_new_path_begins_with_a_segment_and_behind_points_off_the_map(town, tmp_path):
    file = gpx(town, tmp_path / "a.gpx", [(0, 0), (100, 0), (200, -80), (300, 0), (400, 0)], [(0, 300), (100, 300)])
    found = town.graph.track(file)
    assert found.paths == [[0, 1], [3, 4], [15, 16]]
    assert [edge is None for edge in found.edges] == [False, False, True, False, False, False, False]
    assert town.graph.track(file, within=100).paths == [[0, 1, 2, 3, 4], [15, 16]]


def test_a_new_path_begins_where_no_path_leads_on(town, tmp_path):
    town.graph.close_roads(
        [
            edge.id
            for edge in map(town.graph.graph.get_edge, town.graph.graph.get_edges())
            if {edge.source, edge.target} in ({1, 2}, {1, 6}, {0, 5})
        ]
    )
    found = town.graph.track(gpx(town, tmp_path / "a.gpx", [(0, 0), (90, 0), (210, 0), (300, 0)]))
    assert found.paths == [[0, 1], [2, 3]]


def test_the_tracks_of_a_recording_lead_back_to_its_nodes(town, tmp_path):
    town.agent.create_agent("a", start_node_id=0, strategy=gamms.strategies.random_walk)
    town.record.start(tmp_path / "game.ggr")
    nodes = [0]
    for _ in range(20):
        town.game.step()
        nodes.append(town.agent.get_agent("a").current_node_id)
    town.record.stop()
    with gamms.recorder.open(tmp_path / "game.ggr") as recording:
        recording.export(tmp_path / "game.gpx")
    (path,) = town.graph.track(tmp_path / "game.gpx", within=1.0).paths
    assert path == [node for at, node in enumerate(nodes) if at == 0 or node != nodes[at - 1]]


def test_an_empty_track_has_no_paths(town, tmp_path):
    assert town.graph.track(gpx(town, tmp_path / "a.gpx", [], [])) == ([], [])


@pytest.mark.parametrize(
    "text",
    [
        "",
        "no xml",
        "<gpx>",
        "<kml></kml>",
        '<gpx><trk><trkseg><trkpt lat="91" lon="0"/></trkseg></trk></gpx>',
        '<gpx><trk><trkseg><trkpt lat="x" lon="0"/></trkseg></trk></gpx>',
        '<gpx><trk><trkseg><trkpt lon="0"/></trkseg></trk></gpx>',
        '<!DOCTYPE gpx [<!ENTITY a "b">]><gpx>&a;</gpx>',
        '<!DOCTYPE gpx SYSTEM "file:///etc/passwd"><gpx/>',
        "<gpx>" + "<a>" * 1000,
    ],
)
def test_a_file_that_is_no_gpx_is_refused(town, tmp_path, text):
    (tmp_path / "bad.gpx").write_text(text)
    with pytest.raises(BadFile, match=r"bad\.gpx' cannot be used as a GPX file"):
        town.graph.track(tmp_path / "bad.gpx")


def test_a_bomb_of_entities_is_refused_at_once(town, tmp_path):
    entities = "".join(f'<!ENTITY e{k} "{f"&e{k - 1};" * 10 if k else "x" * 100}">' for k in range(12))
    (tmp_path / "bomb.gpx").write_text(f"<!DOCTYPE gpx [{entities}]><gpx>&e11;</gpx>")
    with pytest.raises(BadFile, match="document type"):
        town.graph.track(tmp_path / "bomb.gpx")


def test_files_that_are_too_large_or_absent_are_refused(town, tmp_path, monkeypatch):
    file = gpx(town, tmp_path / "a.gpx", [(0, 0)] * 30)
    with gamms.limits.allowing(100), pytest.raises(TooLarge):
        town.graph.track(file)
    monkeypatch.setattr(finding, "_MOST_POINTS", 20)
    with pytest.raises(BadFile, match="more than 20 points"):
        town.graph.track(file)
    with pytest.raises(FileNotFoundError, match="GPX"):
        town.graph.track(tmp_path / "none.gpx")
    with pytest.raises(BadType):
        town.graph.track(7)


def test_a_map_without_a_crs_takes_no_track(town, tmp_path):
    file = gpx(town, tmp_path / "a.gpx", [(0, 0)])
    town.graph.graph.crs = None
    with pytest.raises(BadValue, match=r"set graph\.crs"):
        town.graph.track(file)
