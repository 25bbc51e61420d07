"""Tracks are matched to the roads of a graph."""

from itertools import pairwise

import numpy as np
import pytest

import gamms
from gamms.errors import BadFile, BadType, BadValue, TooLarge
from gamms.graph import tracks

CORNER = np.array((385_000.0, 6_672_000.0))


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
    found = town.graph.match_track(gpx(town, tmp_path / "a.gpx", walk))
    assert found.paths == [[0, 1, 2, 7, 12]]
    assert len(found.edges) == 7
    assert None not in found.edges


def test_between_far_points_the_shortest_path_leads(town, tmp_path):
    found = town.graph.match_track(gpx(town, tmp_path / "a.gpx", [(0, 0), (400, 300)], kind="rte"))
    (path,) = found.paths
    assert (path[0], path[-1], len(path)) == (0, 19, len(town.graph.shortest_path(0, 19)))


def test_a_new_path_begins_with_a_segment_and_points_off_the_map_are_outliers(town, tmp_path):
    file = gpx(town, tmp_path / "a.gpx", [(0, 0), (100, 0), (200, -80), (300, 0), (400, 0)], [(0, 300), (100, 300)])
    found = town.graph.match_track(file)
    assert found.paths == [[0, 1, 2, 3, 4], [15, 16]]
    assert [edge is None for edge in found.edges] == [False, False, True, False, False, False, False]
    assert (found.outliers, found.gaps) == ([2], [(4, 5)])
    assert not town.graph.match_track(file, within_m=100).outliers


def test_a_new_path_begins_where_no_path_leads_on(town, tmp_path):
    town.graph.close_roads(
        [
            edge.id
            for edge in map(town.graph.graph.get_edge, town.graph.graph.get_edges())
            if {edge.source, edge.target} in ({1, 2}, {1, 6}, {0, 5})
        ]
    )
    found = town.graph.match_track(gpx(town, tmp_path / "a.gpx", [(0, 0), (90, 0), (210, 0), (300, 0)]))
    assert found.paths == [[0, 1], [2, 3]]
    assert found.gaps == [(1, 2)]


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
    (path,) = town.graph.match_track(tmp_path / "game.gpx", within_m=1.0).paths
    assert path == [node for at, node in enumerate(nodes) if at == 0 or node != nodes[at - 1]]


def test_an_empty_track_has_no_paths(town, tmp_path):
    for empty in (gpx(town, tmp_path / "a.gpx", [], []), [], np.empty((0, 2))):
        found = town.graph.match_track(empty)
        assert (found.paths, found.edges, found.points, found.length) == ([], [], 0, 0.0)


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
        town.graph.match_track(tmp_path / "bad.gpx")


def test_a_bomb_of_entities_is_refused_at_once(town, tmp_path):
    entities = "".join(f'<!ENTITY e{k} "{f"&e{k - 1};" * 10 if k else "x" * 100}">' for k in range(12))
    (tmp_path / "bomb.gpx").write_text(f"<!DOCTYPE gpx [{entities}]><gpx>&e11;</gpx>")
    with pytest.raises(BadFile, match="document type"):
        town.graph.match_track(tmp_path / "bomb.gpx")


def test_files_that_are_too_large_or_absent_are_refused(town, tmp_path, monkeypatch):
    file = gpx(town, tmp_path / "a.gpx", [(0, 0)] * 30)
    with gamms.limits.allowing(100), pytest.raises(TooLarge):
        town.graph.match_track(file)
    monkeypatch.setattr(tracks, "_MOST_POINTS", 20)
    with pytest.raises(BadFile, match="more than 20 points"):
        town.graph.match_track(file)
    with pytest.raises(FileNotFoundError, match="GPX"):
        town.graph.match_track(tmp_path / "none.gpx")
    with pytest.raises(BadType):
        town.graph.match_track(7)


def test_a_map_without_a_crs_takes_no_track(town, tmp_path):
    file = gpx(town, tmp_path / "a.gpx", [(0, 0)])
    town.graph.graph.crs = None
    with pytest.raises(BadValue, match=r"set graph\.crs"):
        town.graph.match_track(file)


def test_points_match_as_files_do_with_and_without_times(town, tmp_path):
    xy = np.array([(3, 4), (40, -6), (70, 5), (160, 3), (203, 20), (196, 90), (204, 190)]) + CORNER
    file = tmp_path / "walk.csv"
    file.write_text("x,y\n" + "\n".join(f"{x},{y}" for x, y in xy.tolist()), encoding="utf-8")
    found = [town.graph.match_track(one) for one in (xy, xy.tolist(), np.column_stack([xy, np.arange(7.0)]), file)]
    assert [one.paths for one in found] == [[[0, 1, 2, 7, 12]]] * 4
    assert [one.agent for one in found] == ["", "", "", "walk"]
    assert found[0].length == pytest.approx(387.0, abs=1.0)
    assert found[0].off_m == pytest.approx(29 / 7)
    assert found[0].places[1] == pytest.approx(xy[1] + (0.0, 6.0))


@pytest.mark.parametrize("xs", [(50.0, 50.0), (50.0, 50.0, 50.0, 50.0), (50.0, 50.001)])
def test_a_track_that_stays_at_one_place_has_no_outliers(town, xs):
    found = town.graph.match_track([(385_000.0 + x, 6_672_002.0) for x in xs])
    assert (found.outliers, found.gaps, found.parts) == ([], [], 1)
    assert found.length == pytest.approx(0.0, abs=0.01)


def test_a_row_of_a_csv_file_that_ends_early_is_named(town, tmp_path):
    file = tmp_path / "walk.csv"
    file.write_text("x,y,time\n1,2,3\n1,2\n", encoding="utf-8")
    with pytest.raises(BadFile, match="line 3: it has 2 of the 3 columns"):
        town.graph.match_track(file)


def test_a_point_far_from_the_route_but_near_a_road_is_an_outlier(town):
    xy = np.array([(x, 2.0 * (-1) ** (x // 20)) for x in range(0, 401, 20)]) + CORNER
    xy[9] += (10.0, 300.0)
    found = town.graph.match_track(xy)
    assert found.paths == [[0, 1, 2, 3, 4]]
    assert (found.outliers, found.gaps, found.off_road, found.parts) == ([9], [], 1, 1)
    assert np.isnan(found.places[9]).all()


def test_points_nearer_than_two_sigma_are_skipped_and_stay_on_the_edge_of_the_last_one(town):
    xy = [(385_000.0 + x, 6_672_000.0) for x in (10.0, 30.0, 35.0, 39.0, 60.0)]
    found = town.graph.match_track(xy, noise_m=5.0)
    assert found.places[:, 0] - 385_000.0 == pytest.approx([10, 30, 30, 30, 60])
    assert not found.outliers
    assert len(set(found.edges)) == 1


def test_noisy_tracks_in_helsinki_stay_on_their_roads():
    with gamms.create_context(seed=1, logger_config={"level": "CRITICAL"}) as ctx:
        gamms.osm.helsinki(ctx)
        graph = ctx.graph
        rng = np.random.default_rng(7)
        figures = []
        for _ in range(4):
            path = long_path(graph, rng)
            figures.append(
                [*matched_figures(graph, path, rng, 4.0, 20.0), *matched_figures(graph, path, rng, 8.0, 10.0)]
            )
        wrong, total, wrong_dense, total_dense = np.mean(figures, axis=0)
        assert wrong < 0.10
        assert wrong_dense < 0.15
        assert [total, total_dense] == pytest.approx([1.0, 1.0], abs=0.04)


def long_path(graph, rng):
    while True:
        try:
            path = graph.shortest_path(*map(int, rng.choice(graph.columns().node_ids, 2)))
        except ValueError:
            continue
        if len(path) >= 40:
            return path


def matched_figures(graph, path, rng, noise_m, every):
    """Return the length on wrong edges and the whole length of a match, each as a share of the true length."""
    xy = np.array([(node.x, node.y) for node in map(graph.get_node, path)])
    gone = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(xy, axis=0).T))])
    at = np.arange(0.0, gone[-1], every)
    errors = rng.normal(0.0, noise_m, (len(at), 2))
    if every > 2.0 * noise_m:  # errors of one point last into the next
        for before, after in pairwise(errors):
            after[:] = 0.6 * before + 0.8 * after
    points = np.column_stack([np.interp(at, gone, axis) for axis in xy.T]) + errors
    pairs = [pair for way in graph.match_track(points, noise_m=noise_m).paths for pair in pairwise(way)]
    right = {frozenset(pair) for pair in pairwise(path)}
    lengths = [graph.distance(*pair) for pair in pairs]
    wrong = sum(length for pair, length in zip(pairs, lengths, strict=True) if frozenset(pair) not in right)
    return wrong / gone[-1], sum(lengths) / gone[-1]


def test_track_is_a_deprecated_name_of_match_track(town, tmp_path):
    file = gpx(town, tmp_path / "a.gpx", [(0, 0), (400, 300)])
    with pytest.warns(DeprecationWarning, match="match_track"):
        found = town.graph.track(file, within=20.0)
    assert found.paths == town.graph.match_track(file, within_m=20.0).paths


@pytest.mark.parametrize(
    "points", [7, None, [(1, 2, 3, 4)], [("a", "b")], [[1, 2], [3]], [{"x": 1, "y": 2}], np.zeros(4)]
)
def test_values_that_are_no_track_are_refused_with_the_way_out(town, points):
    with pytest.raises(BadType, match=r"A track is a GPX or CSV file, or points \(x, y\)"):
        town.graph.match_track(points)


@pytest.mark.parametrize("arguments", [{"noise_m": 0.0}, {"noise_m": -1}, {"within_m": float("nan")}])
def test_errors_and_distances_are_positive(town, arguments):
    with pytest.raises(BadValue, match=next(iter(arguments))):
        town.graph.match_track([(0.0, 0.0)], **arguments)


def test_points_that_are_not_finite_are_outliers(town):
    xy = [(385_000.0, 6_672_000.0), (float("nan"), 1.0), (385_100.0, float("inf")), (385_200.0, 6_672_000.0)]
    found = town.graph.match_track(xy)
    assert found.outliers == [1, 2]
    assert found.paths == [[0, 1, 2]]


def test_a_graph_without_edges_takes_no_track():
    with gamms.create_context(seed=1) as ctx, pytest.raises(BadValue, match="no edges"):
        ctx.graph.match_track([(0.0, 0.0)])


def test_the_match_of_several_agents_says_whose_each_point_is(town, tmp_path):
    file = tmp_path / "walks.csv"
    file.write_text("agent,x,y\nbo,385000,6672003\nan,385000,6672003\nbo,385100,6672003\nan,385000,6679003\n")
    found = town.graph.match_track(file)
    assert found.agent == "bo, an"
    assert found.agents == ["bo", "bo", "an", "an"]
    assert [found.agents[point] for point in found.outliers] == ["an"]
