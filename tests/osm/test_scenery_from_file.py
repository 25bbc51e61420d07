"""Parks, water, rails and buildings around the streets are read from the file of the streets, and kept with the map."""

import itertools

import numpy as np
import pytest

import gamms
from gamms.errors import BadFile, BadValue
from gamms.graph import map_file
from gamms.ir.obstacles import ObstacleColumns
from gamms.ir.scenery import MOST_POINTS, Scenery, SceneryKind

WEST, SOUTH = 24.940, 60.170
M_LAT, M_LON = 1 / 111_300.0, 1 / 55_400.0  # degrees, of a metre there


class City:
    """A map whose places are given in metres east and north of a corner."""

    def __init__(self):
        self.nodes, self.ways = {}, []

    def way(self, *points, **tags):
        """Add a way; a repeated first point closes it."""
        refs = []
        for x, y in points:
            known = [id for id, place in self.nodes.items() if place == (SOUTH + y * M_LAT, WEST + x * M_LON)]
            id = known[0] if known else len(self.nodes) + 1
            self.nodes[id] = (SOUTH + y * M_LAT, WEST + x * M_LON)
            refs.append(id)
        self.ways.append((refs, tags))
        return self

    def area(self, x, y, dx, dy, **tags):
        """Add a rectangle with tags."""
        return self.way((x, y), (x + dx, y), (x + dx, y + dy), (x, y + dy), (x, y), **tags)


def streets():
    """Streets around a square of 400 by 300 metres."""
    return City().way((0, 0), (400, 0), (400, 300), (0, 300), (0, 0), highway="residential")


@pytest.fixture
def read(make_map):
    """A function from a city to a context with its streets, and its scenery."""

    def opened(city, **options):
        file = make_map(city.nodes, *city.ways)
        ctx = gamms.create_context()
        ctx.graph.attach_networkx_graph(gamms.osm.graph_from_file(str(file)))
        return ctx, gamms.osm.scenery_from_file(file, ctx, **options)

    return opened


def shapes(scenery, kind):
    """The points of the shapes of a kind."""
    runs = itertools.pairwise(scenery.offsets.tolist())
    return [scenery.points[a:b] for one, (a, b) in zip(scenery.kinds.tolist(), runs, strict=True) if one == kind]


def area(points):
    x, y = (points - points[0]).T
    return abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1))) / 2


@pytest.mark.parametrize(
    "tags",
    [
        {"railway": "subway", "tunnel": "yes"},
        {"railway": "rail", "layer": "-1"},
        {"railway": "abandoned"},
        {"waterway": "stream", "tunnel": "culvert"},
        {"natural": "tree_row"},
    ],
)
def test_underground_and_unknown_areas_are_left_out(read, tags):
    _, scenery = read(streets().way((50, 50), (150, 50), **tags))
    assert len(scenery.kinds) == 0


def test_distant_parts_of_areas_are_cut_off(read):
    ctx, scenery = read(streets().area(200, 100, 5_000, 100, natural="water").area(3_000, 0, 90, 90, leisure="park"))
    [shape] = shapes(scenery, SceneryKind.WATER)
    assert area(shape) == pytest.approx(220 * 100, rel=0.04)
    assert shape[:, 0].max() == pytest.approx(ctx.graph.columns().xy[:, 0].max() + 20.0, abs=0.1)
    assert not shapes(scenery, SceneryKind.GREEN)


def test_areas_that_meet_are_one(read):
    _, scenery = read(streets().area(50, 50, 100, 40, leisure="park").area(150, 50, 100, 40, landuse="grass"))
    assert len(shapes(scenery, SceneryKind.GREEN)) == 1


def test_the_sea_lies_at_the_right_of_a_coast(read):
    _, scenery = read(streets().way((-900, 100), (200, 110), (900, 100), natural="coastline"))
    [sea] = shapes(scenery, SceneryKind.WATER)
    _, other = read(streets().way((900, 100), (200, 110), (-900, 100), natural="coastline"))
    [north] = shapes(other, SceneryKind.WATER)
    assert area(sea) == pytest.approx(440 * 127, rel=0.1)  # south of it
    assert area(sea) + area(north) == pytest.approx(440 * 340, rel=0.1)


def test_an_island_is_land(read):
    city = streets().way((-900, 290), (900, 290), natural="coastline")
    _, scenery = read(city.area(100, 100, 100, 100, natural="coastline"))  # counter-clockwise: land inside
    [sea] = shapes(scenery, SceneryKind.WATER)
    assert area(sea) == pytest.approx(440 * 310 - 10_000, rel=0.1)


def test_a_coast_that_ends_inside_makes_no_sea(read):
    _, scenery = read(streets().way((-900, 150), (200, 150), natural="coastline"))
    assert not shapes(scenery, SceneryKind.WATER)


def test_a_context_without_streets_is_named(make_map):
    city = streets()
    file = make_map(city.nodes, *city.ways)
    with gamms.create_context() as ctx, pytest.raises(BadValue, match="no streets"):
        gamms.osm.scenery_from_file(file, ctx)


# -- kept with the map ------------------------------------------------------------------------------------------


@pytest.fixture
def town(read):
    """A context with a park, a rail and a building."""
    city = streets().area(50, 50, 100, 40, leisure="park").way((0, 200), (400, 200), railway="rail")
    ctx, scenery = read(city.area(200, 100, 30, 20, building="yes"))
    ctx.graph.graph.scenery = scenery
    return ctx


def equal(one, other):
    columns = [(s.kinds, s.offsets, s.points, *s.buildings) for s in (one, other)]
    return all(np.array_equal(a, b) for a, b in zip(*columns, strict=True))


def test_files_recordings_forks_and_snapshots_keep_it(town, tmp_path):
    scenery = town.graph.scenery_columns()
    town.graph.save(tmp_path / "map.gamms")
    node = int(town.graph.columns().node_ids[0])
    town.agent.create_agent("a", start_node_id=node, strategy=lambda state: None)
    town.record.start(tmp_path / "game.ggr")
    town.game.step()
    town.record.stop()
    with gamms.create_context() as ctx:
        ctx.graph.load(tmp_path / "map.gamms")
        assert equal(ctx.graph.scenery_columns(), scenery)
    with gamms.create_context() as ctx:
        for _ in ctx.record.replay(tmp_path / "game.ggr"):
            pass
        assert equal(ctx.graph.scenery_columns(), scenery)
    with gamms.create_context() as ctx:
        ctx.graph.storage.copy_from(town.graph.storage.snapshot())
        assert equal(ctx.graph.scenery_columns(), scenery)
    assert equal(town.game.fork(1).ctx.graph.scenery_columns(), scenery)


def test_a_picture_changes_with_the_scenery(town):
    before = len(town.visual.draw_commands())
    town.graph.graph.scenery = None
    assert len(town.visual.draw_commands()) < before


def test_it_cannot_be_changed(town):
    scenery = town.graph.scenery_columns()
    for column in (scenery.kinds, scenery.offsets, scenery.points, *scenery.buildings):
        with pytest.raises(ValueError, match="read-only"):
            column[...] = 0


NO_BUILDINGS = ObstacleColumns(np.zeros(0, np.int64), np.zeros((0, 4, 3)), np.zeros(0, np.int64))


@pytest.mark.parametrize(
    ("kinds", "offsets", "points", "match"),
    [
        ([1], [0, 2], np.zeros((2, 2)), "three points"),
        ([18], [0, 1], np.zeros((1, 2)), "two"),
        ([18], [0, 3], np.zeros((2, 2)), "offsets"),
        ([18, 18], [0, 2], np.zeros((2, 2)), "columns"),
        ([18], [0, 2], np.full((2, 2), np.nan), "not finite"),
        ([18], [0, 2], np.full((2, 2), 1e13), "farther"),
        ([18], [0, MOST_POINTS + 1], np.zeros((MOST_POINTS + 1, 2)), "at most"),
    ],
)
def test_impossible_columns_are_named(kinds, offsets, points, match):
    with pytest.raises(BadValue, match=match):
        Scenery(np.array(kinds), np.array(offsets), points, NO_BUILDINGS)


@pytest.mark.parametrize(
    "forged",
    [
        {"kinds": np.array([1, 1])},
        {"sizes": np.array([-1])},
        {"sizes": np.array([2**62, 2**62])},
        {"points": np.zeros(4)},
        {"points": np.full((6, 2), np.inf)},
        {"face_types": np.zeros(3, np.int64)},
        {"face_corners": np.zeros((4, 11))},
        {"kinds": "1"},
        None,
    ],
)
def test_a_forged_scenery_is_refused(town, forged):
    packed = town.graph.storage.pack()
    state = map_file.unframe_file(packed, map_file.MAGIC, map_file.VERSION)
    state["base_map"] = {**state["base_map"], **forged} if forged is not None else {"kinds": np.zeros(0, np.int64)}
    with pytest.raises(BadFile):
        map_file.decode(map_file.frame_file(state, map_file.MAGIC, map_file.VERSION))


def test_a_kind_of_a_later_version_is_kept_and_not_drawn(town):
    before = len(town.visual.draw_commands())
    town.graph.graph.scenery = Scenery(np.array([9, 99]), np.array([0, 3, 5]), np.zeros((5, 2)), NO_BUILDINGS)
    with gamms.create_context() as ctx:
        ctx.graph.storage.unpack(town.graph.storage.pack())
        assert ctx.graph.scenery_columns().kinds.tolist() == [9, 99]
        assert len(ctx.visual.draw_commands()) < before


def test_scenarios_draw_it(make_map, tmp_path):
    city = streets().area(50, 50, 100, 40, leisure="park").area(200, 100, 30, 20, building="yes")
    make_map(city.nodes, *city.ways)
    teams = "teams: {red: {count: 1, strategy: gamms.strategies:stay}}"
    for more, walls in (("", (4, 0)), (", buildings: true", (0, 4))):
        (tmp_path / "game.yaml").write_text(
            f"map: {{file: {{path: map.osm, scenery: true{more}}}}}\n{teams}\nmax_turns: 1\n"
        )
        with gamms.scenario.load(tmp_path / "game.yaml").build(seed=1) as ctx:
            scenery = ctx.graph.scenery_columns()
            assert scenery.kinds.tolist() == [SceneryKind.GREEN]
            assert (len(scenery.buildings.ids), len(ctx.graph.obstacle_columns().ids)) == walls
