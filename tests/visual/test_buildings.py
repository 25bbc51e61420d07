"""Buildings: what walls lead around is filled by height, courtyards stay free, and open walls stay lines."""

import os
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

import gamms
from gamms import kernels
from gamms.ir.draw import DrawKind
from gamms.ir.obstacles import ObstacleColumns
from gamms.visual.backends.pillow_backend import compute_polygons, decode_pixels
from gamms.visual.drawers.graph import find_footprints
from gamms.visual.themes import THEMES

BY_DAY = THEMES["light"].map.walls

GOLDEN = Path(__file__).parent / "golden" / "buildings.png"
SQUARE = [(0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0)]
YARD = [(3.0, 3.0), (7.0, 3.0), (7.0, 7.0), (3.0, 7.0)]
WHITE = (255, 255, 255)


def walls(outline, top, *, is_open=False):
    """Faces (faces, 4, 3) along an outline, each from its right corner to its left one."""
    ends = [*outline[1:], outline[0]]
    pairs = list(zip(outline, ends, strict=True))[: len(outline) - is_open]
    return [[(*a, top), (*b, top), (*a, 0.0), (*b, 0.0)] for a, b in pairs]


def moved(outline, x, y=0.0):
    return [(a + x, b + y) for a, b in outline]


def columns(*buildings, type=0):
    corners = np.array([face for faces in buildings for face in faces], np.float64).reshape(-1, 4, 3)
    return ObstacleColumns(np.arange(len(corners)), corners, np.full(len(corners), type, np.int64))


def area(outline):
    """The area by the even-odd rule."""
    line = shapely.LineString([*outline, outline[0]])
    return shapely.build_area(shapely.union_all([line])).area


def areas(faces):
    built = find_footprints(faces)
    return [area(built.points[begin:end]) for begin, end in zip(built.offsets[:-1], built.offsets[1:], strict=True)]


@pytest.fixture
def town():
    """A low building, one with a courtyard, a high one and an open wall, around a street."""
    with gamms.create_context(seed=1) as ctx:
        graph = ctx.graph.graph
        graph.add_nodes([0, 1, 2], x=[-5, 25, 55], y=[-5, -5, -5])
        graph.add_edges([0, 1], sources=[0, 1], targets=[1, 2])
        open_wall = walls([(48.0, 0.0), (48.0, 10.0), (55.0, 10.0)], 3.0, is_open=True)
        yard = walls(SQUARE, 12.0) + walls(YARD[::-1], 12.0)
        shifted = np.add(yard, (15.0, 0.0, 0.0))
        ctx.graph.add_obstacles(np.array(walls(SQUARE, 4.0)), types=0)
        ctx.graph.add_obstacles(shifted, types=0)
        ctx.graph.add_obstacles(np.array(walls(moved(SQUARE, 30.0), 40.0)), types=1)
        ctx.graph.add_obstacles(np.array(open_wall), types=0)
        yield ctx


def seen(ctx):
    """The colours at places of the town: `look(x, y)`."""
    ctx.visual.look_at(25.0, 0.0, 100.0)
    picture = ctx.visual.frame(2000, 1000, background=WHITE)
    return lambda x, y: tuple(picture[round(500 - 20 * y), round(20 * (x + 25))].tolist())


# -- rings ------------------------------------------------------------------------------------------------------


def test_walls_that_lead_back_to_their_beginning_are_a_footprint():
    assert areas(columns(walls(SQUARE, 3.0))) == [100.0]
    assert find_footprints(columns(walls(SQUARE, 3.0))).row_of.tolist() == [0] * 4


def test_walls_that_go_on_from_left_to_right_are_one_too():
    faces = columns(walls(SQUARE, 3.0))
    assert areas(faces._replace(corners=faces.corners[:, [1, 0, 3, 2]])) == [100.0]


def test_walls_that_do_not_close_are_no_footprint():
    built = find_footprints(columns(walls(SQUARE, 3.0, is_open=True)))
    assert (built.points.shape, built.offsets.tolist(), built.row_of.tolist()) == ((0, 2), [0], [-1] * 3)


def test_a_building_is_found_behind_an_open_wall_that_touches_it():
    faces = columns(walls([(-9.0, 0.0), (-4.0, 0.0), (0.0, 0.0)], 3.0, is_open=True), walls(SQUARE, 3.0))
    assert areas(faces) == [100.0]
    assert find_footprints(faces).row_of.tolist() == [-1] * 2 + [0] * 4


def test_neighbours_that_share_a_wall_are_two_footprints():
    neighbour = [(10.0, 10.0), (10.0, 0.0), (20.0, 0.0), (20.0, 10.0)]
    assert areas(columns(walls([*SQUARE[2:], *SQUARE[:2]], 3.0), walls(neighbour, 3.0))) == [100.0, 100.0]


def test_a_wall_that_is_missing_opens_its_building_only():
    faces = columns(walls(SQUARE, 3.0), walls(moved(SQUARE, 30.0), 3.0))
    rows = np.delete(np.arange(8), 1)
    assert areas(ObstacleColumns(*(column[rows] for column in faces))) == [100.0]


@pytest.mark.parametrize("yard", [YARD, YARD[::-1]])
def test_a_courtyard_is_a_hole_whichever_way_its_walls_run(yard):
    assert find_footprints(columns(walls(SQUARE, 3.0), walls(yard, 3.0))).row_of.tolist() == [0] * 8
    assert areas(columns(walls(SQUARE, 3.0), walls(yard, 3.0))) == [84.0]


def test_a_building_in_a_courtyard_is_a_footprint():
    inner = [(4.0, 4.0), (6.0, 4.0), (6.0, 6.0), (4.0, 6.0)]
    assert areas(columns(walls(SQUARE, 3.0), walls(YARD, 3.0), walls(inner, 3.0))) == [84.0, 4.0]


def test_a_part_that_is_higher_than_the_building_around_it_is_no_courtyard():
    assert areas(columns(walls(SQUARE, 3.0), walls(YARD, 9.0))) == [100.0, 16.0]


def test_a_building_in_a_notch_of_another_is_no_courtyard():
    notched = [(0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (6.0, 10.0), (6.0, 4.0), (3.0, 4.0), (3.0, 10.0), (0.0, 10.0)]
    notch = [(3.0, 4.0), (6.0, 4.0), (6.0, 10.0), (3.0, 10.0)]
    assert areas(columns(walls(notched, 3.0), walls(notch, 3.0))) == [82.0, 18.0]


def test_buildings_on_hills_are_as_dark_as_they_are_high():
    flat = columns(walls(SQUARE, 9.0), walls(moved(SQUARE, 30.0), 21.0))
    hills = flat.corners + np.repeat([(0.0, 0.0, 300.0), (0.0, 0.0, 100.0)], 4, axis=0)[:, None]
    assert find_footprints(flat).heights.tolist() == [9.0, 21.0]
    assert find_footprints(flat._replace(corners=hills)).heights.tolist() == [9.0, 21.0]


@given(st.lists(st.tuples(st.integers(3, 9), st.booleans()), max_size=8))
def test_every_building_of_a_town_is_found(sizes):
    buildings = []
    for place, (corners, is_open) in enumerate(sizes):
        turn = np.arange(corners) * 2 * np.pi / corners
        outline = np.column_stack((np.cos(turn) + 3 * place, np.sin(turn))).tolist()
        buildings.append(walls([tuple(point) for point in outline], 3.0 + place, is_open=is_open))
    built = find_footprints(columns(*buildings))
    expected = [place for place, (_, is_open) in enumerate(sizes) if not is_open]
    assert built.heights.tolist() == [3.0 + place for place in expected]
    assert built.offsets.tolist() == [0, *np.cumsum([sizes[place][0] for place in expected]).tolist()]
    rows = {place: row for row, place in enumerate(expected)}
    around = [rows.get(place, -1) for place, (corners, is_open) in enumerate(sizes) for _ in range(corners - is_open)]
    assert built.row_of.tolist() == around


@given(st.lists(st.tuples(st.integers(0, 3), st.integers(0, 3)), max_size=40))
def test_rings_never_share_a_line_and_are_closed_chains(lines):
    places = np.array(lines, np.float64).reshape(-1, 2)
    starts, ends = places[:, :1], places[:, 1:]
    last = 0
    for begin, end in kernels.find_closed_rings(starts, ends).tolist():
        assert last <= begin <= end - 3
        assert (starts[begin + 1 : end] == ends[begin : end - 1]).all()
        assert starts[begin] == ends[end - 1]
        last = end


# -- pictures ---------------------------------------------------------------------------------------------------


def test_the_golden_picture(town):
    """Refresh with `GAMMS_REFRESH_GOLDEN=1 pytest tests/visual/test_buildings.py`, and look at it."""
    from gamms.visual.backends.pillow_backend import encode_png

    picture = town.visual.frame(320, 160).astype(int)
    if os.environ.get("GAMMS_REFRESH_GOLDEN"):
        GOLDEN.write_bytes(encode_png(picture.astype(np.uint8), 96))
    difference = np.abs(picture - decode_pixels(GOLDEN.read_bytes()))
    assert np.quantile(difference, 0.995) <= 24  # another version of pygame may smooth hairlines otherwise
    assert difference.mean() <= 1


def test_where_nothing_was_declared_buildings_are_filled_by_height_and_courtyards_are_not(town):
    look = seen(town)
    low, middle, high = look(5, 5), look(16.5, 5), look(35, 5)
    assert (low, high) == (BY_DAY.low, BY_DAY.high)
    assert low > middle > high
    assert look(20, 5) == WHITE  # in the courtyard
    assert look(52, 5) == WHITE  # in the corner of the open wall
    assert look(48, 5) == BY_DAY.wall


def test_in_commands_a_courtyard_is_a_seam_and_a_ring_that_runs_back(town):
    commands = town.visual.draw_commands()
    rows = np.flatnonzero(commands.kind == DrawKind.POLYGON)
    shapes = [commands.points[commands.offsets[row] : commands.offsets[row + 1]] for row in rows]
    assert sorted(map(area, shapes)) == [84.0, 100.0, 100.0]  # with its sign, the ring of the courtyard is taken off


def test_declared_obstacles_are_lines_unless_they_shall_be_filled(town):
    town.visual.set_graph_visual().set_visible(False)  # nothing but what is declared
    town.visual.set_obstacle_visual()
    assert set(town.visual.draw_commands().kind.tolist()) == {DrawKind.LINE}
    assert seen(town)(5, 5) == WHITE
    town.visual.set_obstacle_visual(fill=True)
    assert seen(town)(5, 5) == BY_DAY.low


def test_a_type_with_a_color_is_filled_with_it(town):
    town.visual.set_obstacle_visual(fill=True, color_map={1: (200, 100, 0)})
    look = seen(town)
    assert (look(35, 5), look(5, 5)) == ((200, 100, 0), BY_DAY.low)
    assert look(30, 5) == (150, 75, 0)


def test_a_fence_around_the_whole_map_is_not_filled(town):
    fence = [(-10.0, -10.0), (60.0, -10.0), (60.0, 15.0), (-10.0, 15.0)]
    town.graph.add_obstacles(np.array(walls(fence, 2.0)))
    look = seen(town)
    assert look(-3, 5) == WHITE
    assert look(-10, 5) == BY_DAY.wall


def test_buildings_are_below_streets(town):
    commands = town.visual.draw_commands()
    areas, nodes = (set(commands.layer[commands.kind == kind].tolist()) for kind in (DrawKind.POLYGON, DrawKind.CIRCLE))
    assert max(areas) < min(nodes)


@pytest.mark.parametrize("theme", THEMES.values(), ids=THEMES)
def test_the_tones_of_walls_are_distinguished_in_every_theme(theme):
    tones = theme.map.walls
    away = [abs(sum(color) - sum(theme.background[:3])) for color in (tones.low, tones.high, tones.outline, tones.wall)]
    assert away == sorted(away)
    assert away[0] >= 30


# -- pixels -----------------------------------------------------------------------------------------------------

corners = st.lists(st.tuples(st.floats(-20, 60), st.floats(-20, 40)), min_size=3, max_size=6)


@given(st.lists(corners, min_size=1, max_size=5))
def test_polygons_that_are_painted_together_cover_what_each_covers_alone(shapes):
    def covered(*some):
        points = np.array([point for shape in some for point in shape])
        patch = compute_polygons(points, np.cumsum([0, *map(len, some)]), 40, 20)
        full = np.zeros((20, 40), int)
        if patch is not None:
            rows, across = patch.coverage.shape
            full[patch.top : patch.top + rows, patch.left : patch.left + across] = patch.coverage
        return full

    alone = [covered(shape) for shape in shapes]
    together = covered(*shapes)
    sample = 16  # of 4 x 4 in a pixel: a corner on the edge of its own patch may be in the next one of a larger patch
    assert (together >= np.max(alone, axis=0) - sample * len(shapes)).all()
    assert (together <= np.sum(alone, axis=0) + sample * len(shapes)).all()
