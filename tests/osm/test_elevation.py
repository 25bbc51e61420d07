"""Heights from .hgt files: read, interpolated, and what they do to nodes, grades and walking times."""

import math

import networkx as nx
import numpy as np
import pytest
import shapely

import gamms
from gamms.errors import BadFile, BadType, BadValue
from gamms.osm import Elevation, add_elevation, graph_from_file, modes
from gamms.osm.networkx_bridge import compute_walking_factor

POSTS = 1201
VOID = -32768
TUNNEL = {"highway": "path", "tunnel": "yes"}
NODES = {1: (60.17, 24.940), 2: (60.17, 24.950), 3: (60.18, 24.940)}


@pytest.fixture
def heights(tmp_path):
    """Write the heights of N60E024, given from south to north as a function of column and row, and give the path."""

    def heights(of, name="N60E024.hgt", posts=POSTS):
        column = np.broadcast_to(np.arange(posts, dtype=np.int32), (posts, posts))
        path = tmp_path / name
        np.asarray(of(column, column.T), ">i2")[::-1].tofile(path)
        return path

    return heights


def test_both_sizes_are_read_and_a_folder_has_many_files(heights, tmp_path):
    heights(lambda column, row: column // 12 + row * 0)
    heights(lambda column, row: row // 36 + column * 0, "n60e025.srtmgl1.hgt".upper().replace(".HGT", ".hgt"), 3601)
    found = Elevation(tmp_path).heights(np.array([(24.5, 60.1), (25.9, 60.5)]))
    assert found.tolist() == pytest.approx([50.0, 50.0], abs=0.1)


def test_a_file_reaches_to_its_last_row_and_column(heights):
    path = heights(lambda column, row: column + row)
    assert Elevation(path).heights(np.array([(25.0, 61.0), (24.0, 60.0), (25.0, 60.5)])).tolist() == [2400, 0, 1800]


def test_heights_are_continuous_across_files_of_both_sizes(heights, tmp_path):
    heights(lambda column, row: column + row, "N60E024.hgt")
    heights(lambda column, row: 1200 + (column + row) // 3, "N60E025.hgt", 3601)
    heights(lambda column, row: 1200 + column + row, "N61E024.hgt")
    lonlat = np.array([(25 - 1e-9, 60.5), (25.0, 60.5), (25 + 1e-9, 60.5), (24.5, 61 - 1e-9), (24.5, 61 + 1e-9)])
    assert Elevation(tmp_path).heights(lonlat).tolist() == pytest.approx([1800.0] * 5, abs=0.5)
    with pytest.raises(BadValue, match=r"no heights at \[25.5, 61.5\]: N61E025.hgt is needed"):
        Elevation(tmp_path).heights(np.array([(24.5, 60.5), (25.5, 61.5)]))


def test_voids_at_the_rim_of_a_file_are_filled_from_inside(heights):
    def of(column, row):
        posts = column + row * 0
        posts[:, -3:] = VOID  # the last three columns
        posts[600, :] = VOID
        return posts

    elevation = Elevation(heights(of))
    places = np.array([(25.0, 60.25), (25 - 0.5 / 1200, 60.25), (24.25, 60.5), (24.25, 60.5 + 0.5 / 1200)])
    assert elevation.heights(places).tolist() == pytest.approx([1197.0, 1197.0, 300.0, 300.0], abs=1.0)


def test_a_file_of_voids_only_is_refused(heights):
    with pytest.raises(BadValue, match="lacks heights around column 600, row 600 from the south"):
        Elevation(heights(lambda column, row: column * 0 + VOID)).heights(np.array([(24.5, 60.5)]))


def test_a_small_void_is_filled_from_its_rim_and_a_large_one_is_refused(heights):
    def of(column, row):
        posts = 100 + column * 0
        posts[600, 600] = VOID
        posts[300:310, 300:310] = VOID
        posts[800:900, 800:900] = VOID
        return posts

    elevation = Elevation(heights(of))
    places = np.array([(24 + 600.4 / 1200, 60 + 600.4 / 1200), (24 + 305 / 1200, 60 + 305 / 1200)])
    assert elevation.heights(places).tolist() == [100.0, 100.0]
    with pytest.raises(BadValue, match="lacks heights around column 850, row 850"):
        elevation.heights(np.array([(24 + 850 / 1200, 60 + 850 / 1200)]))


def test_a_point_in_a_void_has_the_height_of_the_nearest_post_on_any_side(heights):
    def of(column, row):
        posts = column + 2 * row
        posts[590:611, 590:611] = VOID
        return posts

    near = [(609, 600), (600, 609), (591, 600), (600, 591)]
    found = Elevation(heights(of)).heights(np.array([(24 + x / 1200, 60 + y / 1200) for x, y in near]))
    assert found.tolist() == [611 + 1200, 600 + 2 * 611, 589 + 1200, 600 + 2 * 589]


@pytest.mark.parametrize("name", ["N60E024.tif", "heights.hgt", "60N24E.hgt"])
def test_a_file_of_another_name_is_refused(tmp_path, name):
    (tmp_path / name).write_bytes(b"x")
    with pytest.raises(BadFile, match=r"GeoTIFF and \.zip are not read"):
        Elevation(tmp_path / name)


@pytest.mark.parametrize("size", [0, 1, 2 * 1201 * 1201 - 1, 2 * 1201 * 1201 + 1, 2 * 1000 * 1000])
def test_a_file_of_another_size_is_refused_before_it_is_read(tmp_path, size):
    path = tmp_path / "N60E024.hgt"
    with path.open("wb") as file:
        file.truncate(size)
    with pytest.raises(BadFile, match=f"has {size} bytes"):
        Elevation(path).heights(np.array([(24.5, 60.5)]))


def test_missing_height_files_are_named(heights, tmp_path):
    with pytest.raises(FileNotFoundError, match="nowhere"):
        Elevation(tmp_path / "nowhere")
    with pytest.raises(BadType, match="elevation"):
        Elevation(7)
    path = heights(lambda column, _: column)
    for elevation in (Elevation(path), Elevation(tmp_path)):
        with pytest.raises(BadValue, match=r"S34W071\.hgt is needed"):
            elevation.heights(np.array([(-70.6, -33.4)]))


# -- roads ------------------------------------------------------------------------------------------------------


def test_slopes_slow_only_walkers_and_not_on_stairs(make_map, heights):
    hill = heights(lambda column, row: 30 * (row - 200))
    for highway, mode in (("residential", "drive"), ("residential", "bike"), ("steps", "walk"), ("residential", None)):
        path = make_map(NODES, ([1, 3], {"highway": highway}))
        times = [
            [data["travel_time"] for *_, data in graph_from_file(path, osm_type=mode, elevation=one).edges(data=True)]
            for one in (None, hill)
        ]
        assert times[0] == times[1]
    assert [name for name, mode in modes().items() if mode.slope == "walked"] == ["walk"]


@pytest.mark.parametrize("order", [["walk", "drive"], ["drive", "walk"]])
def test_each_of_several_modes_has_the_times_of_its_own_graph_on_slopes(make_map, heights, order):
    hill = heights(lambda column, row: 30 * (row - 200))
    path = make_map(NODES, ([1, 3], {"highway": "residential"}), ([1, 2], {"highway": "footway"}))
    options = {"elevation": hill, "retain_all": True, "tolerance": 0.0}
    both = graph_from_file(path, osm_type=order, **options)
    for mode in order:
        alone = graph_from_file(path, osm_type=mode, **options)
        own = [round(data["travel_time"], 6) for *_, data in alone.edges(data=True)]
        found = [round(data[f"travel_time:{mode}"], 6) for *_, data in both.edges(data=True) if data[mode]]
        assert sorted(found) == sorted(own)
        assert (len({*own}) > 1) == (mode == "walk")
    for *_, data in both.edges(data=True):
        assert data["travel_time"] == next(data[f"travel_time:{mode}"] for mode in order if data[mode])


def test_tobler_walks_fastest_on_a_gentle_way_down():
    assert compute_walking_factor(np.array([0.0, -0.1])).tolist() == pytest.approx([1.0, 1.0])
    assert compute_walking_factor(np.array([-0.05, 0.2])).tolist() == pytest.approx([math.exp(-0.175), math.exp(0.7)])
    assert np.isfinite(compute_walking_factor(np.array([1e9, -1e9]))).all()


def test_a_bridge_and_a_tunnel_rise_evenly_between_their_ends(make_map, heights):
    """A valley of 50 m: the road goes across it, and the path down into it."""
    nodes = {1: (60.17, 24.94), 2: (60.17, 24.945), 3: (60.17, 24.955), 4: (60.17, 24.96), 5: (60.1705, 24.95)}
    ways = [
        ([1, 2], {"highway": "residential"}),
        ([2, 3], {"highway": "residential", "bridge": "yes", "layer": "1"}),
        ([3, 4], {"highway": "residential"}),
        ([2, 5, 3], {"highway": "path"}),
    ]
    valley = heights(lambda column, row: np.abs(column - 1140) * 10 + row * 0)
    graph = graph_from_file(make_map(nodes, *ways), resolution=20.0, elevation=valley)
    bridge = {n for u, v, data in graph.edges(data=True) if data.get("bridge") for n in (u, v)}
    on_bridge = [graph.nodes[node]["z"] for node in bridge]
    assert min(on_bridge) == pytest.approx(60.0, abs=0.01)  # both ends are as high
    assert max(on_bridge) == pytest.approx(60.0, abs=0.01)
    assert min(height for _, height in graph.nodes(data="z")) < 5.0
    sloping = heights(lambda column, row: column * 2 + np.abs(column - 1140) * 5 + row * 0)
    graph = graph_from_file(make_map(nodes, *ways), resolution=20.0, elevation=sloping)
    grades = [abs(data["grade"]) for *_, data in graph.edges(data=True) if data.get("bridge")]
    assert max(grades) == pytest.approx(min(grades), abs=1e-4)


def test_a_long_tunnel_costs_a_bounded_number_of_rounds(make_map, heights):
    path = make_map(
        {1: (60.1, 24.1), 2: (60.1, 24.11), 3: (60.1, 24.9)}, ([1, 2], {"highway": "path"}), ([2, 3], TUNNEL)
    )
    hill = heights(lambda column, row: column // 2 + row * 0)
    graph = graph_from_file(path, resolution=5.0, elevation=hill)
    assert len(graph) > 8000
    assert max(abs(grade) for *_, grade in graph.edges(data="grade")) < 0.1


def test_a_bridge_that_leads_nowhere_lies_on_the_ground(make_map, heights):
    path = make_map(NODES, ([1, 2], {"highway": "path", "bridge": "yes"}))
    graph = graph_from_file(path, resolution=20.0, elevation=heights(lambda column, row: row * 0 + 7))
    assert {height for _, height in graph.nodes(data="z")} == {7.0}


def test_a_graph_gets_heights_of_its_own(make_map, heights):
    path, hill = make_map(NODES, ([2, 1, 3], {"highway": "residential"})), heights(lambda column, row: column + row)
    graph, loaded = graph_from_file(path), graph_from_file(path, elevation=hill)
    add_elevation(graph, hill)
    assert dict(graph.nodes(data="z")) == dict(loaded.nodes(data="z"))
    for u, v, data in graph.edges(data=True):
        assert data["grade"] == pytest.approx(loaded.edges[u, v]["grade"], abs=1e-12)
    with pytest.raises(BadValue, match="no CRS"):
        add_elevation(nx.path_graph(2), hill)
    with pytest.raises(BadType, match="networkx graph"):
        add_elevation(7, hill)
    with pytest.raises(BadValue, match="length"):
        add_elevation(nx.Graph([(0, 1)], crs="EPSG:32635"), hill)


def test_lines_of_geojson_have_heights(heights, tmp_path):
    path = tmp_path / "roads.geojson"
    path.write_text('{"type": "LineString", "coordinates": [[24.5, 60.25], [24.5, 60.26]]}')
    graph = gamms.osm.graph_from_geojson(path, elevation=heights(lambda column, row: row))
    assert graph.nodes[0]["z"] == pytest.approx(300.0, abs=0.01)
    assert graph.edges[0, 1]["grade"] == pytest.approx(12 / 1114, rel=0.01)


def test_heights_go_through_contexts_and_files(make_map, heights, tmp_path):
    path, hill = make_map(NODES, ([2, 1, 3], {"highway": "residential"})), heights(lambda column, row: column + row)
    with gamms.create_context(logger_config={"level": "CRITICAL"}) as ctx:
        ctx.graph.attach_networkx_graph(graph_from_file(path, elevation=hill))
        ctx.graph.save(tmp_path / "hill.gamms")
        ctx.graph.load(tmp_path / "hill.gamms")
        ((*_, z),) = [(n, ctx.graph.graph.node_attributes(n)["z"]) for n in [0]]
        assert z == graph_from_file(path, elevation=hill).nodes[0]["z"]
        assert "grade" in ctx.graph.graph.edge_attributes(0)


# -- walls ------------------------------------------------------------------------------------------------------

BLOCK = {11: (60.17, 24.940), 12: (60.17, 24.942), 13: (60.171, 24.942), 14: (60.171, 24.940), 15: (60.172, 24.941)}
HOUSE = ([11, 12, 13, 14, 11], {"building": "yes", "height": "20", "min_height": "3"})
FENCE = ([11, 15], {"barrier": "wall", "height": "4"})


def test_a_building_stands_level_on_its_lowest_point_and_a_barrier_follows_the_ground(make_map, heights):
    path, hill = make_map(BLOCK, HOUSE, FENCE), heights(lambda column, row: row * 10)
    flat = list(gamms.osm.obstacle_from_file(path, barriers=True))
    walls = list(gamms.osm.obstacle_from_file(path, barriers=True, elevation=hill))
    lowest = 0.17 * 12_000
    assert [face["type"] for face in walls] == [14] * 4 + [37]
    for face, level in zip(walls[:4], flat, strict=False):
        for corner in ("tr", "tl", "br", "bl"):
            assert face[corner][:2] == level[corner][:2]
            assert face[corner][2] == pytest.approx(level[corner][2] + lowest, abs=0.01)
    fence = walls[4]
    assert [fence[corner][2] for corner in ("br", "tr", "bl", "tl")] == pytest.approx(
        [lowest, lowest + 4.0, lowest + 24.0, lowest + 28.0], abs=0.05
    )
    polygon = [(shapely.Polygon([BLOCK[id][::-1] for id in HOUSE[0]]), HOUSE[1])]
    of_features = list(gamms.osm.faces_of_features(polygon, crs="EPSG:32635", elevation=hill))
    assert of_features == walls[:4]


def test_walls_without_a_file_of_heights_are_refused(make_map, tmp_path):
    path = make_map(BLOCK, HOUSE)
    with pytest.raises(FileNotFoundError, match="nowhere"):
        gamms.osm.obstacle_from_file(path, elevation=tmp_path / "nowhere")
    with pytest.raises(BadType, match="Did you mean 'elevation'"):
        gamms.osm.obstacle_from_file(path, elevatoin=tmp_path)


def test_a_scenario_names_its_heights(make_map, heights, tmp_path):
    make_map({**NODES, **BLOCK}, ([2, 1, 3], {"highway": "residential"}), HOUSE)
    heights(lambda column, row: row)
    text = "map: {file: {path: map.osm, buildings: true, elevation: %s}}\nteams: {red: {count: 1}}\nmax_turns: 1\n"
    (tmp_path / "game.yaml").write_text(text % "N60E024.hgt")
    with gamms.scenario.load(tmp_path / "game.yaml").build() as ctx:
        assert ctx.graph.graph.node_attributes(0)["z"] > 200.0
        assert ctx.graph.get_obstacle_face(0).br[2] > 200.0
    (tmp_path / "game.yaml").write_text(text % "../N60E024.hgt")
    with pytest.raises(gamms.scenario.ScenarioError, match=r"map\.file\.elevation"):
        gamms.scenario.load(tmp_path / "game.yaml").build()
