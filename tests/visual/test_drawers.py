"""Drawers: what each thing looks like, as commands."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import gamms
from gamms.errors import BadValue
from gamms.ir.draw import DrawKind, DrawSpace
from gamms.ir.obstacles import OTHER_OBSTACLE
from gamms.visual import Circle, render_circle, render_rectangle
from gamms.visual.drawers.graph import find_typical_edge_length
from gamms.visual.drawers.streets import find_distinct_roads, find_median, join_polylines


def points_of(commands, kind):
    """The points of every command of one kind."""
    return [
        commands.points[commands.offsets[row] : commands.offsets[row + 1]].tolist()
        for row in np.flatnonzero(commands.kind == kind)
    ]


def test_a_two_way_street_is_drawn_once_and_a_bend_is_followed(ctx):
    ctx.visual.set_graph_visual()
    commands = ctx.visual.draw_commands()
    assert points_of(commands, DrawKind.LINE) == [[[0, 0], [10, 0]], [[10, 0], [12, 5], [10, 10]]]
    assert points_of(commands, DrawKind.CIRCLE) == [[[0, 0]], [[10, 0]], [[10, 10]]]


def test_parallel_streets_of_different_shape_are_all_drawn(columns_of):
    xy = np.array([(0.0, 0.0), (4.0, 0.0)])
    bend = np.array([(0.0, 0.0), (2.0, 1.0), (4.0, 0.0)])
    other = bend * (1.0, -1.0)
    columns = columns_of(xy, [(0, 1), (0, 1), (1, 0), (0, 1), (1, 0)], {1: bend, 2: bend[::-1], 3: other})
    assert find_distinct_roads(columns).tolist() == [0, 1, 3]


@given(st.lists(st.tuples(st.integers(0, 5), st.integers(0, 5)), max_size=30), st.randoms())
def test_every_street_is_drawn_exactly_once(columns_of, edges, random):
    xy = np.arange(12.0).reshape(6, 2)
    bends = {
        row: np.array([xy[source], (source + target, 50.0), xy[target]])
        for row, (source, target) in enumerate(edges)
        if random.random() < 0.5
    }
    columns = columns_of(xy, edges, bends)
    points, offsets = join_polylines(columns, find_distinct_roads(columns))
    drawn = [points[begin:end].tolist() for begin, end in pairwise(offsets)]
    streets = [
        bends[row].tolist() if row in bends else [xy[source].tolist(), xy[target].tolist()]
        for row, (source, target) in enumerate(edges)
    ]
    assert {frozenset(map(tuple, line)) for line in drawn} == {frozenset(map(tuple, line)) for line in streets}
    assert len(drawn) == len({min(str(line), str(line[::-1])) for line in streets})


@given(st.lists(st.booleans(), max_size=12), st.randoms())
def test_bent_and_straight_streets_come_in_the_order_that_was_asked_for(columns_of, is_bent, random):
    xy = np.array([(0.0, 0.0), (4.0, 0.0)])
    bends = {row: np.array([(0.0, 0.0), (2.0, row), (4.0, 0.0)]) for row, bent in enumerate(is_bent) if bent}
    columns = columns_of(xy, [(0, 1)] * len(is_bent), bends)
    rows = random.sample(range(len(is_bent)), len(is_bent))
    points, offsets = join_polylines(columns, np.array(rows, np.int64))
    lines = [points[begin:end].tolist() for begin, end in pairwise(offsets.tolist())]
    assert lines == [bends.get(row, xy).tolist() for row in rows]


@given(st.lists(st.floats(0, 1e6), min_size=1))
def test_the_usual_length_is_the_median(lengths):
    assert find_median(np.array(lengths)) == np.median(lengths)


def test_the_usual_length_of_no_street_is_zero():
    assert find_median(np.empty(0)) == 0.0


def test_node_ids_are_written_on_demand(ctx):
    ctx.visual.set_graph_visual(draw_id=True)
    assert [text for text in ctx.visual.draw_commands().text if text] == ["0", "1", "2"]


def test_an_agent_is_an_outlined_disc_at_its_node_that_is_never_too_small(ctx):
    ctx.visual.set_graph_visual().set_visible(False)  # nothing but what is declared
    artist = ctx.visual.set_agent_visual("blue_0", color=(0, 0, 255), size=3)
    commands = ctx.visual.draw_commands()
    assert points_of(commands, DrawKind.CIRCLE) == [[[10, 10]]] * 4
    assert commands.color[:, :3].tolist() == [[255, 255, 255]] * 2 + [[0, 0, 255]] * 2
    assert commands.space.tolist() == [DrawSpace.WORLD, DrawSpace.SCREEN] * 2
    assert artist.data["agent_data"].current_position == (10.0, 10.0)


def test_obstacle_colors_can_be_changed_and_unknown_types_are_grey(ctx):
    ctx.visual.set_graph_visual().set_visible(False)  # nothing but what is declared
    artist = ctx.visual.set_obstacle_visual(color_map={1: (1, 2, 3)})
    assert ctx.visual.draw_commands().color.tolist() == [[1, 2, 3, 255]]
    ctx.graph.remove_obstacle_face(0)
    ctx.graph.add_obstacle_face(1, (4, 3, 9), (2, 3, 9), (4, 3, 0), (2, 3, 0), 77)
    artist.data = {}
    assert ctx.visual.draw_commands().color.tolist() == [[*OTHER_OBSTACLE, 255]]


def test_a_sensor_that_has_not_sensed_yet_draws_nothing(ctx):
    ctx.visual.set_graph_visual().set_visible(False)  # nothing but what is declared
    for name in ("near", "map", "spy"):
        ctx.visual.set_sensor_visual(name)
    assert len(ctx.visual.draw_commands()) == 0


def test_a_sensor_of_the_users_own_kind_without_a_view_is_an_error_of_its_artist(ctx, caplog):
    ctx.visual.set_graph_visual().set_visible(False)  # nothing but what is declared
    ctx.visual.set_sensor_visual("own")
    assert len(ctx.visual.draw_commands()) == 0
    assert "Own does not offer last_view, so it cannot be drawn: override it" in caplog.text


@pytest.mark.parametrize(
    "data",
    [
        {"x": 1, "y": 2, "radius": 3, "color": (9, 9, 9), "layer": 30},
        {"x": 1, "y": 2, "scale": 3, "color": (9, 9, 9)},
        {"anything": Circle(1, 2, 3, (9, 9, 9))},
    ],
)
def test_a_circle_is_described_by_data_or_by_a_circle(ctx, data):
    circle = ctx.visual.drawing.record(lambda _: render_circle(ctx, data))
    assert (circle.points.tolist(), circle.size.tolist()) == ([[1, 2]], [3])
    assert circle.color.tolist() == [[9, 9, 9, 255]]


def test_a_shape_names_its_missing_data(ctx):
    with pytest.raises(BadValue, match="lacks width, height; it has"):
        render_rectangle(ctx, {"x": 1, "y": 2})


def test_paths_of_a_real_map_are_slimmer_than_its_streets():
    with gamms.create_context() as ctx:
        ctx.graph.add_nodes([0, 1, 2, 3], x=[0, 100, 0, 100], y=[0, 0, 5, 5])
        for id, kind in enumerate(("residential", ["footway", "steps"])):
            edge = {"id": id, "source": 2 * id, "target": 2 * id + 1, "length": 100.0, "highway": kind}
            ctx.graph.graph.add_edge(edge)
        ctx.graph.graph.crs = "EPSG:32635"
        commands = ctx.visual.draw_commands()
        widths = {tuple(commands.points[first].tolist()): width for first, width in street_widths(commands)}
        assert widths[(0.0, 5.0)] == pytest.approx(0.4 * widths[(0.0, 0.0)])


def street_widths(commands):
    rows = np.flatnonzero((commands.kind == DrawKind.LINE) & (commands.layer == 10))
    return zip(commands.offsets[rows].tolist(), commands.width[rows].tolist(), strict=True)


@pytest.mark.parametrize(
    ("xy", "edges", "unit"),
    [
        ([], [], 1.0),
        ([(5, 5)], [], 1.0),
        ([(0, 0), (3, 7)], [], 7.0),
        ([(0, 0), (3, 4), (0, 4)], [(0, 1), (1, 2)], 4.0),
    ],
)
def test_nodes_are_as_large_as_edges_are_long_or_a_map_without_any(xy, edges, unit):
    with gamms.create_context(logger_config={"level": "ERROR"}) as ctx:
        ctx.graph.add_nodes(range(len(xy)), [x for x, _ in xy], [y for _, y in xy])
        ctx.graph.add_edges(range(len(edges)), [a for a, _ in edges], [b for _, b in edges], [1.0] * len(edges))
        assert find_typical_edge_length(ctx.graph.columns()) == unit
