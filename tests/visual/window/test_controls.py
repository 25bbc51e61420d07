"""What keys and mouse do to the camera, the pace and the words."""

import numpy as np
import pygame
import pytest

from gamms.visual.keys import find_actions
from gamms.visual.window import input as window_input
from gamms.visual.window.panels import Hud


def camera(ctx):
    view = ctx.visual._render_manager
    return view.camera_x, view.camera_y, view.camera_size


@pytest.fixture
def ctx(open_window):
    ctx = open_window()
    ctx.visual.look_at(0.0, 0.0, 64.0)  # ten pixels are a unit
    ctx.visual.update()
    return ctx


@pytest.mark.parametrize(("key", "factor"), [("PAGEUP", 1 / 4), ("PAGEDOWN", 4)])
def test_keys_zoom_a_notch_and_as_long_as_they_are_held(ctx, person, key, factor):
    person.press(key)
    ctx.visual.handle_input()
    notch = 1.05 if factor > 1 else 1 / 1.05
    assert camera(ctx) == pytest.approx((0, 0, 32 * notch))
    for _ in range(10):
        ctx.visual.input.glide(0.1)
    assert camera(ctx) == pytest.approx((0, 0, 32 * notch * factor))
    person.release(key)
    ctx.visual.handle_input()
    ctx.visual.input.glide(1.0)
    assert camera(ctx) == pytest.approx((0, 0, 32 * notch * factor))


@pytest.mark.parametrize(
    ("keys", "way"), [("w UP", (0, 8)), ("s DOWN", (0, -8)), ("a LEFT", (-8, 0)), ("d RIGHT", (8, 0))]
)
def test_keys_move_the_camera_by_a_quarter_of_the_picture_a_second(ctx, person, keys, way):
    for key in keys.split():
        ctx.visual.look_at(0.0, 0.0, 64.0)
        person.press(key)
        ctx.visual.handle_input()
        ctx.visual.input.glide(0.5)
        assert camera(ctx) == pytest.approx((*way, 32))
        person.release(key)
        ctx.visual.handle_input()


def test_the_wheel_stops_before_the_smallest_streets_are_lost(ctx, person):
    person.turn_wheel(500)
    ctx.visual.update()
    assert 0.0 < camera(ctx)[2] <= 2.0


def test_dragging_moves_the_picture_with_the_hand(ctx, person):
    person.drag((100, 120), (130, 100))
    ctx.visual.update()
    assert camera(ctx) == pytest.approx((-3.0, -2.0, 32.0))


def test_home_shows_everything(ctx, person):
    person.press("HOME")
    ctx.visual.update()
    left, right, low, high, _ = ctx.visual.get_viewport()
    assert left < 0
    assert right > 10
    assert low < 0
    assert high > 10
    assert right - left < 64


def test_the_camera_stays_where_a_person_pointed_it_while_the_graph_grows(open_window, person):
    ctx = open_window()
    ctx.visual.update()
    fitted = camera(ctx)
    ctx.graph.graph.add_node({"id": 9, "x": 100.0, "y": 0.0})
    ctx.visual.update()
    assert camera(ctx) != fitted
    person.drag((100, 100), (130, 80))
    ctx.visual.update()
    moved = camera(ctx)
    ctx.graph.graph.add_node({"id": 10, "x": 500.0, "y": 0.0})
    ctx.visual.update()
    assert camera(ctx) == moved


def test_keys_hide_the_words_and_show_help_names_and_trails(ctx, person):
    visual, overlay, hud = ctx.visual, ctx.visual.overlay, ctx.visual.overlay.hud
    assert (hud.is_shown, hud.has_help, overlay.labels, overlay.trails) == (True, False, False, 0)
    person.press("h", "F1", "l", "t")
    visual.update()
    assert not hud.is_shown
    assert hud.has_help
    assert overlay.labels is True
    assert overlay.trails > 0
    person.press("h", "F1", "l", "t")
    visual.update()
    assert hud.is_shown
    assert (overlay.labels, overlay.trails) == (False, 0)


@pytest.mark.parametrize("key", ["HOME", "0", "KP0"])
def test_a_key_shows_everything_again(ctx, person, key):
    ctx.visual.see_everything()
    whole = camera(ctx)
    person.press("d")
    ctx.visual.handle_input()
    ctx.visual.input.glide(0.5)
    assert camera(ctx) != whole
    person.press(key)
    ctx.visual.handle_input()
    assert camera(ctx) == whole


def test_a_pointer_that_leaves_does_not_stop_the_keys(ctx, person):
    person.press("d")
    person.point(5, 5)
    person._do("WINDOWLEAVE")
    ctx.visual.handle_input()
    ctx.visual.input.glide(0.5)
    assert camera(ctx) == (8, 0, 32)
    assert ctx.visual.input.pointer is None


def test_a_window_that_loses_the_focus_lets_go_of_everything(ctx, person):
    person.press("d")
    person.point(5, 5)
    ctx.visual.handle_input()
    person._do("WINDOWFOCUSLOST")
    ctx.visual.handle_input()
    ctx.visual.input.glide(1.0)
    assert camera(ctx) == (0, 0, 32)
    assert ctx.visual.input.pointer is None


@pytest.mark.parametrize("width", [1000.0, 20.0, 1.0])
def test_agents_keep_a_readable_size_at_every_zoom(ctx, width):
    ctx.visual.look_at(0.0, 0.0, width)
    ctx.visual.update()
    look = ctx.visual.overlay.shown["red_0"].data["agent_data"]
    assert 6 <= max(look.size * ctx.visual.camera.scale, look.least_px) <= 15


def test_a_resized_window_sees_the_whole_map_as_long_as_it_was_not_moved(open_window, person):
    ctx = open_window()
    ctx.visual.update()
    person.press("HOME")
    ctx.visual.update()
    for size in ((900, 700), (300, 300)):
        pygame.display.set_mode(size, pygame.RESIZABLE)
        pygame.event.post(pygame.event.Event(pygame.VIDEORESIZE, w=size[0], h=size[1], size=size))
        ctx.visual.update()
        xy = ctx.graph.columns().xy
        places = ctx.visual.camera.camera().to_screen(xy)
        assert (places > 0).all()
        assert (places < size).all()
        assert np.ptp(places, axis=0).max() > 0.4 * min(size)


def test_panels_of_agents_cover_neither_the_turn_nor_the_agent(ctx, person, monkeypatch):
    boxes = []
    paint = Hud.paint_facts
    monkeypatch.setattr(Hud, "paint_facts", lambda self, *given: paint(self, *given) or boxes.append(self.layout.areas))
    ctx.visual.look_at(0.0, 0.0, 64.0)
    ctx.visual.update()
    person.click(*ctx.visual.camera.world_to_screen(0.0, 0.0))
    ctx.visual.update()
    for x, y in ((31.0, -16.0), (29.0, -14.0), (0.0, 0.0), (60.0, 0.0), (-60.0, 40.0)):  # in the corner, out of view
        ctx.visual.look_at(x, y, 64.0)
        ctx.visual.update()
        (left, top, right, bottom), facts = boxes[-1][0], boxes[-1][-1]
        assert facts[0] >= right or facts[1] >= bottom or facts[2] <= left or facts[3] <= top


def test_each_key_of_the_table_does_something_in_a_window(ctx):
    bound = {*ctx.visual.input._keys, *ctx.visual.input._ways}
    assert bound == {*window_input._bind_keys(pygame)}
    known = {*ctx.visual._make_handlers().actions, *window_input._MOVES}
    assert known == set(find_actions("window").values())
