"""Sensors in pictures: one drawing for all kinds, from what each offers of its last look."""

import os
from math import inf, pi
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import gamms
from gamms.ir.draw import DrawKind
from gamms.ir.sensor_results import SensorView
from gamms.sensor import SensorType
from gamms.typing import ISensor
from gamms.visual import default_scene, drawers
from gamms.visual.appearance import TEAM_COLORS
from gamms.visual.camera import frame_drawings
from gamms.visual.drawers.sensors import cut

GOLDEN = Path(__file__).parent / "golden" / "sensors.svg"
LOW, HIGH = np.array([0.0, 0.0]), np.array([10.0, 10.0])
SQUARE = np.array([(2.0, 2.0), (8.0, 2.0), (8.0, 8.0), (2.0, 8.0)])


class Sonar(ISensor):
    """A sensor of the user's own kind, which shows what is given."""

    sensor_id, type, data = "sonar", SensorType.CUSTOM, None
    view = SensorView()

    def sense(self, node_id):
        """Hear nothing."""

    def update(self, data):
        """Take nothing in."""

    def set_owner(self, owner):
        """Have no owner."""

    def last_view(self):
        """What was given."""
        return self.view


@pytest.fixture
def sonar(ctx):
    """A sensor of the user's own kind."""
    sonar = Sonar()
    ctx.sensor.add_sensor(sonar)
    return sonar


@pytest.fixture
def town():
    """Streets on a grid of 7 by 5 junctions, 50 m apart, and two teams with a sensor each of three kinds."""
    with gamms.create_context(seed=1) as ctx:
        ids = range(35)
        ctx.graph.add_nodes(ids, [50 * (id % 7) for id in ids], [50 * (id // 7) for id in ids])
        streets = [(id, id + 1) for id in ids if id % 7 < 6] + [(id, id + 7) for id in ids if id < 28]
        ctx.graph.add_edges(range(len(streets)), *zip(*streets, strict=True))
        kinds = {
            "disc": (SensorType.RANGE, {"sensor_range": 60.0}),
            "ahead": (SensorType.ARC, {"sensor_range": 120.0, "fov": 1.2}),
            "radar": (SensorType.AGENT_RANGE, {"sensor_range": 130.0}),
        }
        for (name, (kind, given)), node in zip(kinds.items(), (15, 33, 19), strict=True):
            ctx.sensor.create_sensor(name, kind, **given)
            agent = ctx.agent.create_agent(
                f"with_{name}", start_node_id=node, sensors=[name], team=int(name == "radar")
            )
            agent.orientation = (0.0, -1.0)
        yield ctx


def look_around(ctx):
    """Let every agent sense."""
    for agent in ctx.agent.create_iter():
        agent.get_state()


def kinds_of(commands):
    """The kinds of the commands, each once, from back to front."""
    return [DrawKind(kind).name for kind in dict.fromkeys(commands.kind[commands.in_painting_order()].tolist())]


def test_the_golden_picture(town, tmp_path):
    """Refresh with `GAMMS_REFRESH_GOLDEN=1 pytest tests/visual/test_sensor_views.py`, and look at the picture."""
    look_around(town)
    town.visual.save(tmp_path / "sensors.svg", 640, 480, title="Three sensors")
    text = (tmp_path / "sensors.svg").read_text(encoding="utf-8")
    if os.environ.get("GAMMS_REFRESH_GOLDEN"):
        GOLDEN.write_text(text, encoding="utf-8")
    assert text == GOLDEN.read_text(encoding="utf-8")


def test_all_published_names_are_the_one_drawing():
    names = ("map_sensor", "agent_sensor", "neighbor_sensor", "aerial_agent_sensor")
    assert {getattr(drawers, f"render_{name}") for name in names} == {drawers.render_sensor}


def test_one_color_is_enough(ctx, sonar):
    ctx.visual.set_graph_visual().set_visible(False)  # nothing but what is declared
    sonar.view = SensorView(nodes=SQUARE, lines=SQUARE, offsets=np.array([0, 4]), agents=SQUARE, outline=SQUARE)
    ctx.visual.set_sensor_visual("sonar", color=(1, 2, 3))
    assert set(map(tuple, ctx.visual.draw_commands().color[:, :3].tolist())) == {(1, 2, 3)}


@pytest.mark.parametrize(
    ("view", "words"),
    [
        ({"nodes": []}, "BadType: last_view of sensor 'sonar' must return a SensorView, not {'nodes'"),
        (SensorView(outline=np.array([(0.0, inf), (1.0, 0.0), (0.0, 0.0)])), "BadValue: The outline"),
        (SensorView(outline=np.zeros((4, 3))), "BadValue: The outline"),
    ],
)
@pytest.mark.parametrize("is_declared", [True, False])
def test_a_view_that_cannot_be_drawn_is_an_error_of_its_artist(ctx, sonar, caplog, view, words, is_declared):
    sonar.view = view
    if is_declared:
        ctx.visual.set_sensor_visual("sonar")
    ctx.visual.draw_commands()
    assert f"'sensor_sonar' could not be drawn: {words}" in caplog.text


def test_a_class_that_is_a_sensor_by_its_decorator_alone_is_warned_of_missing_methods(ctx, caplog):
    @ctx.sensor.custom(name="DUCK_TO_DRAW")
    class Duck:
        sensor_id = "duck"

    ctx.sensor.add_sensor(Duck())
    ctx.visual.draw_commands()
    assert not caplog.text
    ctx.visual.set_sensor_visual("duck")
    ctx.visual.draw_commands()
    assert "NotOffered: Duck does not offer last_view" in caplog.text


def test_a_field_of_view_that_holds_the_whole_map_is_not_drawn(ctx):
    ctx.visual.set_graph_visual().set_visible(False)  # nothing but what is declared
    eye = ctx.sensor.create_sensor("eye", SensorType.RANGE, sensor_range=1e9)
    eye.sense(0)
    ctx.visual.set_sensor_visual("eye")
    assert kinds_of(ctx.visual.draw_commands()) == ["LINE", "CIRCLE"]


def test_a_field_of_view_far_beyond_the_map_leaves_the_map_its_size(ctx):
    ctx.visual.set_graph_visual().set_visible(False)  # nothing but what is declared
    eye = ctx.sensor.create_sensor("eye", SensorType.ARC, sensor_range=1e4, fov=pi)
    eye.sense(0)
    ctx.visual.set_sensor_visual("eye")
    commands = ctx.visual.draw_commands()
    corners = commands.points[commands.offsets[0] : commands.offsets[1]]
    assert corners.min(axis=0).tolist() == pytest.approx([0.0, -40.0])
    assert corners.max(axis=0).tolist() == pytest.approx([50.0, 50.0])


def test_a_picture_shows_a_whole_field_of_view_that_reaches_as_far_as_the_map(ctx):
    columns = ctx.graph.columns()
    far = 0.9 * float((columns.xy.max(axis=0) - columns.xy.min(axis=0)).max())
    ctx.sensor.create_sensor("eye", SensorType.RANGE, sensor_range=far).sense(0)
    ctx.visual.set_sensor_visual("eye")
    low, high = frame_drawings(ctx.visual.draw_commands())
    assert low.tolist() == pytest.approx((columns.xy[0] - far).tolist())
    assert (high >= columns.xy[0] + 0.99 * far).all()


def test_no_side_of_a_frame_is_seen_in_a_field_of_view(ctx):
    pytest.importorskip("pygame")
    ctx.sensor.create_sensor("eye", SensorType.RANGE, sensor_range=25.0).sense(0)
    ctx.visual.set_sensor_visual("eye", color="red")
    seen = ctx.visual.frame(600, 600, scale_bar=False, labels=False, legend=False).astype(int)
    red = seen[..., 0] - seen[..., 2] > 8
    rows = np.flatnonzero(red.any(axis=1))
    columns = np.flatnonzero(red.any(axis=0))
    # A straight side would be a row or column that is red from end to end and has none beyond it.
    assert rows[0] == 0 or red[rows[0]].sum() < 0.3 * red.any(axis=0).sum()
    assert columns[-1] == 599 or red[:, columns[-1]].sum() < 0.3 * red.any(axis=1).sum()


def test_a_map_without_extent_cuts_nothing():
    with gamms.create_context() as ctx:
        ctx.graph.add_nodes([0], [5], [5])
        ctx.sensor.create_sensor("eye", SensorType.RANGE, sensor_range=2.0).sense(0)
        ctx.visual.set_graph_visual().set_visible(False)
        ctx.visual.set_sensor_visual("eye")
        assert kinds_of(ctx.visual.draw_commands()) == ["POLYGON", "CIRCLE"]


@given(st.lists(st.tuples(*[st.floats(-30, 30)] * 2), min_size=3, max_size=8))
def test_cutting_to_a_box_keeps_the_inner_part(corners):
    corners = np.array(corners)
    left = cut(corners, LOW, HIGH)
    assert ((left >= LOW) & (left <= HIGH)).all()
    inside = ((corners >= LOW) & (corners <= HIGH)).all(axis=1)
    assert set(map(tuple, corners[inside].tolist())) <= set(map(tuple, left.tolist()))
    if inside.all():
        assert left.tolist() == corners.tolist()


# -- where nothing is declared ------------------------------------------------------------------------------------


def test_before_the_first_look_no_sensor_is_in_the_picture(town):
    assert set(town.visual.draw_commands().layer.tolist()) == {10, 20}


def test_sensors_have_the_color_of_the_team_that_carries_them_and_lie_below_the_agents(town):
    look_around(town)
    commands = town.visual.draw_commands()
    assert set(commands.layer.tolist()) == {10, 15, 20}
    colors = dict.fromkeys(tuple(color) for color in commands.color[commands.layer == 15, :3].tolist())
    assert list(colors) == list(TEAM_COLORS[:2])


def test_where_one_may_go_and_the_whole_map_are_no_news(town):
    for name, kind in (("near", SensorType.NEIGHBOR), ("all", SensorType.MAP)):
        town.sensor.create_sensor(name, kind).sense(0)
    assert 15 not in town.visual.draw_commands().layer


def test_a_sensor_that_no_agent_carries_is_grey(town):
    town.sensor.create_sensor("mast", SensorType.RANGE).sense(0)
    commands = town.visual.draw_commands()
    (color,) = {tuple(color) for color in commands.color[commands.layer == 15, :3].tolist()}
    assert color not in TEAM_COLORS


def test_more_sensors_than_can_be_distinguished_are_left_out(town):
    for number in range(default_scene.MOST_SENSORS):
        town.sensor.create_sensor(f"mast_{number}", SensorType.RANGE).sense(number)
    assert 15 in town.visual.draw_commands().layer
    look_around(town)
    assert 15 not in town.visual.draw_commands().layer
