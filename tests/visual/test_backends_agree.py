"""One scene through every backend: what an SVG says by the places of its elements, the others have as pixels."""

import re
from itertools import pairwise
from xml.etree import ElementTree as ET

import numpy as np
import pytest

import gamms
from gamms.sensor import SensorType
from gamms.visual import Engine
from gamms.visual.backends.pillow_backend import decode_pixels, encode_png

WIDTH, HEIGHT = 640, 360
PX = 4.0  # per world unit
CENTER = (40.0, 25.0)
BUILDING = [(24.0, 4.0), (36.0, 4.0), (36.0, 16.0), (24.0, 16.0)]
YARD = [(28.0, 8.0), (28.0, 12.0), (32.0, 12.0), (32.0, 8.0)]
BADGE = (30, 160, 90)
WORDS_AT = (64.0, 30.0)
NUMBER = re.compile(r"-?(?:\d+(?:\.\d+)?|\.\d+)")
ROWS, COLUMNS = np.mgrid[0:HEIGHT, 0:WIDTH] + 0.5


@pytest.fixture
def scene(tmp_path, monkeypatch):
    """The maker of the scene with an engine: a grid of streets, agents, a sensor, walls, words and an image."""
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    badge = tmp_path / "badge.png"
    badge.write_bytes(encode_png(np.full((8, 8, 3), BADGE, np.uint8), 96))
    opened = []

    def make(engine):
        options = {"width": WIDTH, "height": HEIGHT, "simulation_time_constant": 0.0}
        ctx = gamms.create_context(vis_engine=engine, vis_kwargs=options, seed=1)
        opened.append(ctx)
        add_world(ctx)
        declare(ctx, str(badge))
        return ctx

    yield make
    for ctx in opened:
        ctx.terminate()


def add_world(ctx):
    graph = ctx.graph.graph
    nodes = [(column, row) for row in range(3) for column in range(5)]
    graph.add_nodes(range(15), x=[20.0 * column for column, _ in nodes], y=[20.0 * row for _, row in nodes])
    across = [(node, node + 1) for node in range(15) if node % 5 < 4]
    pairs = [*across, *((node, node + 5) for node in range(10))]
    sources, targets = zip(*pairs, strict=True)
    graph.add_edges(range(len(pairs)), sources=sources, targets=targets)
    for outline in (BUILDING, YARD):
        ends = [*outline[1:], outline[0]]
        faces = [[(*a, 9.0), (*b, 9.0), (*a, 0.0), (*b, 0.0)] for a, b in zip(outline, ends, strict=True)]
        ctx.graph.add_obstacles(np.array(faces), types=2)
    ctx.graph.add_obstacles(np.array([[(64, 6, 3), (74, 16, 3), (64, 6, 0), (74, 16, 0)]], float), types=0)
    ctx.sensor.create_sensor("eye", SensorType.ARC, sensor_range=30.0, fov=1.0)
    for name, node in (("red", 5), ("blue", 13), ("badge", 11)):
        ctx.agent.create_agent(name, start_node_id=node, sensors=["eye"] if name == "red" else [])
    ctx.sensor.get_sensor("eye").sense(5)


def declare(ctx, badge):
    visual = ctx.visual
    visual.set_graph_visual(node_size=1.5, node_color=(90, 90, 90), edge_color=(170, 170, 170))
    visual.set_obstacle_visual(fill=True, boundary_thickness=1.0)
    visual.set_agent_visual("red", color=(213, 94, 0), size=4.0)
    visual.set_agent_visual("blue", color=(0, 114, 178), size=4.0)
    visual.set_agent_visual("badge", image_path=badge, size=4.0)
    visual.set_sensor_visual("eye", color=(0, 158, 115), layer=15)
    visual.add_artist("words", {"drawer": lambda ctx, _: ctx.visual.render_text("Here", *WORDS_AT), "layer": 30})
    visual.look_at(*CENTER, WIDTH / PX)


def as_png(ctx, path):
    ctx.visual.save(path, WIDTH, HEIGHT)
    return decode_pixels(path.read_bytes())


def as_frame(ctx, _):
    return ctx.visual.frame(WIDTH, HEIGHT)


def as_window(ctx, _):
    import pygame

    ctx.visual.hud = None
    ctx.visual.update()
    return pygame.surfarray.array3d(pygame.display.get_surface()).swapaxes(0, 1)


PIXELS = {
    "png": (Engine.NO_VIS, as_png),
    "offscreen": (Engine.OFFSCREEN, as_frame),
    "window": (Engine.PYGAME, as_window),
}


@pytest.fixture(params=PIXELS)
def picture(request, scene, tmp_path):
    """The scene as pixels, from each engine."""
    engine, shown = PIXELS[request.param]
    return shown(scene(engine), tmp_path / "scene.png").astype(int)


@pytest.fixture
def drawing(scene, tmp_path):
    """The scene as the elements of an SVG."""
    scene(Engine.NO_VIS).visual.save(tmp_path / "scene.svg", WIDTH, HEIGHT)
    return ET.parse(tmp_path / "scene.svg").getroot()


# -- what an SVG says -------------------------------------------------------------------------------------------


def elements(root):
    """Each element with what it has from its groups, in painting order."""

    def walk(element, given):
        given = {**given, **element.attrib}
        yield element.tag.rpartition("}")[2], given, element.text
        for child in element:
            yield from walk(child, given)

    return list(walk(root, {}))


def chains(path):
    """The polylines of a path: each is a move and lines, all of them steps from the point before."""
    lines, place = [], np.zeros(2)
    for numbers in path.removesuffix("z").split("m")[1:]:
        steps = np.array(list(map(float, NUMBER.findall(numbers)))).reshape(-1, 2)
        lines.append(place + np.cumsum(steps, axis=0))
        place = lines[-1][-1]
    return lines


def near_lines(lines, reach):
    covered = np.zeros((HEIGHT, WIDTH), bool)
    for line in lines:
        for (ax, ay), (bx, by) in pairwise(line):
            way = np.array([bx - ax, by - ay])
            share = np.clip(((COLUMNS - ax) * way[0] + (ROWS - ay) * way[1]) / (way @ way), 0, 1)
            covered |= np.hypot(COLUMNS - ax - share * way[0], ROWS - ay - share * way[1]) <= reach
    return covered


def inside(lines):
    """Which pixels the polygons wind around."""
    winding = np.zeros((HEIGHT, WIDTH), int)
    for line in lines:
        for (ax, ay), (bx, by) in zip(line, np.roll(line, -1, axis=0), strict=True):
            if ay != by:
                crosses = (np.minimum(ay, by) <= ROWS) & (np.maximum(ay, by) > ROWS)
                is_right = ax + (ROWS - ay) / (by - ay) * (bx - ax) > COLUMNS
                winding += np.where(crosses & is_right, 1 if by > ay else -1, 0)
    return winding != 0


def covered_by(tag, given):
    """Which pixels an element covers, and their colour and opacity; None if it paints nothing like that."""
    role = "stroke" if given.get("fill") == "none" else "fill"
    width, opacity = float(given.get("stroke-width", 0)), float(given.get(f"{role}-opacity", 1.0))
    number = {name: float(given[name]) for name in ("cx", "cy", "r", "x", "y") if name in given}
    if tag == "circle":
        away = np.hypot(COLUMNS - number["cx"], ROWS - number["cy"])
        mask = np.abs(away - number["r"]) <= width / 2 if role == "stroke" else away <= number["r"]
    elif tag == "path":
        lines = chains(given["d"])
        closed = [np.concatenate((line, line[:1])) for line in lines] if given["d"].endswith("z") else lines
        mask = near_lines(closed, width / 2) if role == "stroke" else inside(lines)
    elif tag == "image":
        side = float(given["width"])
        mask = (np.abs(COLUMNS - number["x"] - side / 2) <= side / 2) & (
            np.abs(ROWS - number["y"] - side / 2) <= side / 2
        )
        return mask, np.array(BADGE), 1.0
    elif tag == "rect":
        mask = np.ones((HEIGHT, WIDTH), bool)
    else:
        return None
    return mask, np.array([int(given[role][i : i + 2], 16) for i in (1, 3, 5)]), opacity


def painted(root):
    """The colours (rows, columns, 3) that the elements give when painted in order, without words."""
    colors = np.zeros((HEIGHT, WIDTH, 3))
    for tag, given, _ in elements(root):
        covered = covered_by(tag, given)
        if covered is not None:
            mask, color, opacity = covered
            colors[mask] += opacity * (color - colors[mask])
    return colors


def plain(colors):
    """Where all is of one colour, two pixels around."""
    is_plain = np.zeros(colors.shape[:2], bool)
    is_plain[2:-2, 2:-2] = True
    for axis in (0, 1):
        for step in (-2, -1, 1, 2):
            is_plain &= (np.abs(colors - np.roll(colors, step, axis=axis)) < 1).all(axis=2)
    return is_plain


def beside_words(height_px):
    """Which pixels the words of the scene and the note are not near to."""
    left, top = pixel(*WORDS_AT)
    is_near = (left - 4 <= COLUMNS) & (left + 100 >= COLUMNS) & (top - 4 <= ROWS) & (top + height_px >= ROWS)
    return ~is_near


def pixel(x, y):
    """Column and row of a point of the world."""
    return WIDTH / 2 + PX * (x - CENTER[0]), HEIGHT / 2 - PX * (y - CENTER[1])


# -- what all of them show --------------------------------------------------------------------------------------


def test_where_an_svg_has_one_color_the_others_have_it_too(picture, drawing):
    expected = painted(drawing)
    compared = plain(expected) & beside_words(40)
    assert compared.mean() > 0.8
    assert (
        len(np.unique(expected[compared].round() @ [1 << 16, 1 << 8, 1])) >= 8
    )  # of everything that is drawn, something
    assert np.abs(picture - expected)[compared].max() <= 3


def test_each_thing_is_where_it_belongs(picture):
    def look(x, y):
        column, row = pixel(x, y)
        return tuple(picture[int(row), int(column)].tolist())

    assert look(0, 20) == (213, 94, 0)
    assert look(60, 40) == (0, 114, 178)
    assert look(20, 40) == BADGE
    assert look(34.5, 6) == look(34.5, 14)  # the building
    assert look(30.5, 9) == look(31, 11) == look(90, 45) == (252, 252, 250)  # its courtyard, and free ground
    assert look(10, 45) == (222, 241, 234)  # within the range of the sensor
    assert look(69, 11) != look(69, 14)  # the open wall


def test_words_are_written_from_their_upper_left_corner(picture, drawing):
    left, top = pixel(*WORDS_AT)
    is_ink = (picture.sum(axis=2) < 150) & ~beside_words(40)
    rows, columns = np.nonzero(is_ink)
    assert left - 1 <= columns.min() <= left + 8
    assert top - 1 <= rows.min() <= top + 12
    [(given, text)] = [(given, text) for tag, given, text in elements(drawing) if tag == "text"]
    baseline = float(given["y"])
    assert (text, float(given["x"])) == ("Here", left)
    assert abs(rows.max() + 1 - baseline) <= 4


def test_a_film_and_a_picture_have_the_same_pixels(scene, tmp_path):
    engines = [(Engine.NO_VIS, as_png), (Engine.OFFSCREEN, as_frame), (Engine.NO_VIS, as_frame)]
    first, *others = [shown(scene(engine), tmp_path / "scene.png") for engine, shown in engines]
    assert all((first == other).all() for other in others)


def test_a_window_differs_from_a_picture_by_rounding_only(scene, tmp_path):
    window = as_window(scene(Engine.PYGAME), None).astype(int)
    frame = as_frame(scene(Engine.OFFSCREEN), None).astype(int)
    assert np.abs(window - frame).max() <= 3
