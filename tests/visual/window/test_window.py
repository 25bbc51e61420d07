"""The window: what it shows, how it ends, and what programs for 1.0.0 do with it."""

import os
import signal
import subprocess
import sys

import numpy as np
import pytest

import gamms
from gamms.errors import BadValue, MissingFile, UnknownName
from gamms.sensor import SensorType
from gamms.typing import ISensor
from gamms.visual import Artist, Color, Engine
from gamms.visual.appearance import TEAM_COLORS
from gamms.visual.themes import THEMES
from gamms.visual.window import display


def has_color(pixels, color):
    return bool((pixels == color).all(axis=2).any())


def test_defaults_are_those_of_1_0_0():
    with gamms.create_context(vis_engine=Engine.PYGAME) as ctx:
        visual, view = ctx.visual, ctx.visual._render_manager
        assert (view.screen_width, view.screen_height, visual._sim_time_constant) == (1280, 720, 2.0)
        assert (view.camera_x, view.camera_y, view.camera_size, view.camera_size_y) == (0, 0, 15, 8.4375)
        assert list(visual._dynamic_artists) == ["input_overlay"]
        overlay = visual._dynamic_artists["input_overlay"]
        assert overlay.get_layer() == 50
        assert not overlay.get_visible()
        look = overlay.data["graph_data"]
        assert (look.node_color, look.node_size, look.edge_color) == (Color.Green, 4, Color.Green)


def test_the_look_of_choices_can_be_set(open_window):
    ctx = open_window(input_overlay={"node_size": 9, "edge_color": Color.Red})
    look = ctx.visual._dynamic_artists["input_overlay"].data["graph_data"]
    assert (look.node_color, look.node_size, look.edge_color) == (Color.Green, 9, Color.Red)


def test_positional_options_are_those_of_1_0_0(open_window):
    engine = gamms.visual.PygameVisualizationEngine(open_window(), 400, 300, 0.5, anything=1)
    assert (engine.pictures.width, engine.pictures.height, engine.turn_seconds) == (400, 300, 0.5)
    engine.terminate()


@pytest.mark.parametrize("bad", [{"width": 0}, {"theme": "loud"}, {"max_fps": 0}])
def test_an_impossible_option_is_refused(open_window, bad):
    with pytest.raises(BadValue):
        open_window(**bad)


@pytest.mark.parametrize(("range_m", "room"), [(2.5, 2.5), (4.5, 4.5), (60.0, 4.5)])
def test_fields_of_view_are_seen_up_to_nearly_half_of_the_map_wherever_agents_go(ctx, range_m, room):
    ctx.sensor.create_sensor("eye", SensorType.RANGE, sensor_range=range_m)
    red = ctx.agent.get_agent("red_0")
    red.register_sensor("eye", ctx.sensor.get_sensor("eye"))
    red.get_state()
    ctx.visual.simulate()
    left, right, low, high, _ = ctx.visual.get_viewport()
    assert left < -room < 10.0 + room < right
    assert low < -room < 10.0 + room < high
    assert high - low < 24.0  # the map, 10 units high, stays large


def test_without_visuals_the_whole_graph_is_seen_in_the_default_look(ctx, seen):
    ctx.visual.update()
    left, right, low, high, _ = ctx.visual.get_viewport()
    assert left < 0 < 12 < right
    assert low < 0 < 10 < high
    pixels = seen(ctx)
    assert has_color(pixels, (165, 168, 172))  # streets
    assert has_color(pixels, TEAM_COLORS[1])  # the red team
    assert has_color(pixels, TEAM_COLORS[0])


def test_the_dark_theme_is_dark(open_window, seen):
    ctx = open_window(theme="dark")
    ctx.visual.hud = None
    ctx.visual.update()
    assert np.median(seen(ctx)) < 40
    assert has_color(seen(ctx), THEMES["dark"].map.streets)


def test_declaring_the_graph_points_the_camera_at_it(ctx):
    ctx.visual.set_graph_visual(width=5, node_color=Color.Red)
    view = ctx.visual._render_manager
    assert (view.camera_x, view.camera_y, view.camera_size) == (6, 3, 10.0)


def test_an_empty_graph_can_be_declared_and_shown(open_window):
    ctx = open_window(is_empty=True)
    ctx.visual.update()
    ctx.visual.set_graph_visual()
    ctx.visual.update()
    assert ctx.visual._render_manager.camera_size == 15


def test_errors_of_declarations(ctx):
    with pytest.raises(UnknownName):
        ctx.visual.set_sensor_visual("nobody")
    with pytest.raises(FileNotFoundError, match=r"nowhere\.png") as caught:
        ctx.visual.set_agent_visual("red_0", image_path="nowhere.png")
    assert isinstance(caught.value, MissingFile)
    ctx.visual.set_agent_visual("comes_later")
    ctx.visual.update()


def test_a_sensor_that_cannot_describe_its_view_is_refused(ctx):
    class Mute(ISensor):
        sensor_id, type, data = "mute", gamms.sensor.SensorType.CUSTOM, None

        def sense(self, node_id): ...

        def update(self, data): ...

        def set_owner(self, owner): ...

    ctx.sensor.add_sensor(Mute())
    with pytest.raises(ValueError, match="last_view"):
        ctx.visual.set_sensor_visual("mute")
    assert ctx.visual.set_sensor_visual("near").get_layer() == 30


def test_a_drawer_may_paint_on_the_target_surface_above_its_own_layer_only(ctx, seen):
    import pygame

    def paint(ctx, data):
        x, y = ctx.visual._render_manager.world_to_screen(0, 0)
        pygame.draw.circle(ctx.visual._get_target_surface(), data["color"], (x, y), 30)

    ctx.visual.hud = None
    for static in (False, True):
        artist = ctx.visual.add_artist("below", {"drawer": paint, "color": Color.Red, "layer": 3})
        if static:
            artist.set_artist_type(gamms.typing.ArtistType.STATIC)
        ctx.visual.add_artist("above", {"drawer": paint, "color": Color.Green, "layer": 60})
        for place in ((0, 0), (4, 3)):
            ctx.visual.look_at(*place, 20.0)
            ctx.visual.update()
            ctx.visual.update()
            x, y = ctx.visual._render_manager.world_to_screen(0, 0)
            assert tuple(seen(ctx)[round(y), round(x)]) == Color.Green
        ctx.visual.remove_artist("above")
        ctx.visual.update()
        assert has_color(seen(ctx), Color.Red)
    assert ctx.visual._get_target_surface() is ctx.visual._screen


def test_a_loaded_image_can_be_drawn(ctx, seen):
    import pygame

    image = pygame.Surface((4, 4))
    image.fill(Color.Purple)
    ctx.visual.add_artist("image", {"drawer": lambda ctx, data: ctx.visual.render_image(5, 5, image, 2)})
    ctx.visual.update()
    assert has_color(seen(ctx), Color.Purple)


def test_closing_the_window_ends_the_context(ctx, person):
    person.close()
    ctx.visual.update()
    assert ctx.is_terminated()
    ctx.visual.update()
    ctx.visual.simulate()
    ctx.visual.handle_input()
    ctx.visual.handle_single_draw()
    assert ctx.visual.human_input("red_0", {"curr_pos": 0}) == 0


def test_closing_the_window_while_a_turn_is_shown_ends_the_context(open_window, person):
    ctx = open_window(simulation_time_constant=60.0)
    person.close()
    ctx.visual.simulate()
    assert ctx.is_terminated()


@pytest.mark.parametrize("who", ["drawer", "hud"])
def test_a_drawer_may_end_the_context(ctx, who):
    if who == "hud":
        ctx.visual.hud = lambda ctx: ctx.terminate() or []
    else:
        ctx.visual.add_artist("end", {"drawer": lambda ctx, data: ctx.terminate(), "layer": 60})
    ctx.visual.simulate()
    assert ctx.is_terminated()


def test_there_is_no_sound(ctx):
    import pygame

    ctx.visual.update()
    assert not pygame.mixer.get_init()


@pytest.mark.skipif(sys.platform == "win32", reason="there are no such signals")
def test_sigterm_ends_the_process(tmp_path):
    code = """
import gamms
ctx = gamms.create_context(vis_engine=gamms.visual.Engine.PYGAME)
ctx.visual.update()
print("open", flush=True)
while True:
    ctx.visual.simulate()
"""
    environment = {**os.environ, "SDL_VIDEODRIVER": "dummy"}
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True, env=environment) as process:
        assert process.stdout.readline() == "open\n"
        process.terminate()
        assert process.wait(60) == -signal.SIGTERM


def test_an_artist_that_fails_is_logged_and_the_others_draw_on(ctx, seen):
    def fail(ctx, data):
        raise RuntimeError("no")

    ctx.visual.add_artist("broken", Artist(ctx, fail))
    ctx.visual.update()
    assert has_color(seen(ctx), TEAM_COLORS[1])


def test_resizing_the_window_resizes_the_view(ctx):
    import pygame

    pygame.display.set_mode((500, 400), pygame.RESIZABLE)
    pygame.event.post(pygame.event.Event(pygame.VIDEORESIZE, w=500, h=400, size=(500, 400)))
    ctx.visual.update()
    view = ctx.visual._render_manager
    assert (view.screen_width, view.screen_height) == (500, 400)
    assert ctx.visual.frame().shape == (400, 500, 3)


def test_a_frame_after_which_nothing_changed_has_the_same_artists(ctx):
    ctx.visual.update()
    shown = ctx.visual.overlay.shown
    ctx.visual.update()
    assert ctx.visual.overlay.shown == shown
    ctx.agent.get_agent("blue_0").team = "red"
    ctx.visual.update()
    assert ctx.visual.overlay.shown != shown


def test_who_is_out_is_neither_shown_nor_found_nor_named_nor_followed_by_a_trail(open_window, person, seen):
    ctx = open_window(labels=True, trails=4)
    ctx.sensor.create_sensor("eyes", SensorType.RANGE, sensor_range=4.0)
    red = ctx.agent.get_agent("red_0")
    red.register_sensor("eyes", ctx.sensor.get_sensor("eyes"))
    red.register_strategy(lambda state: state.update(action=1))
    ctx.game.add(lambda ctx: ctx.game.turn == 2 and ctx.game.eliminate("red_0"))
    ctx.game.step()
    ctx.visual.update()
    x, y = ctx.visual._render_manager.world_to_screen(*ctx.visual.drawing.position_of("red_0"))
    person.click(x, y)
    ctx.visual.update()
    assert ctx.visual.overlay.describe_pointed() is not None
    assert "sensor_eyes" in ctx.visual.overlay.shown
    before = seen(ctx)
    ctx.game.step()
    for _ in range(2):  # with the cross, and without
        ctx.visual.update()
        assert ctx.visual.overlay.describe_pointed() is None
        assert "sensor_eyes" not in ctx.visual.overlay.shown
        assert not ctx.visual.overlay.list_hints()
        assert ctx.visual.overlay.shown["red_0"].data["agent_data"].current_position is None
        assert "red_0" not in ctx.visual.overlay.shown["trails"].data["colors"]
        ctx.game.step()
    ctx.visual.update()
    assert (before != seen(ctx)).any()
    assert "left: red 0 · blue 1" in ctx.visual.overlay.write_turn_lines(ctx)
    ctx.agent.delete_agent("blue_0")
    assert "left: red 0" in ctx.visual.overlay.write_turn_lines(ctx)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"input_overlay": "green"}, "input_overlay must be a dict with some of node_color, .*, not 'green'"),
        ({"title": 5}, "title must be a string, not 5"),
        ({"stay_open": "no"}, "stay_open must be True or False, not 'no'"),
    ],
)
def test_an_option_of_the_wrong_type_is_refused_before_a_window_opens(open_window, options, said):
    with pytest.raises(TypeError, match=said):
        open_window(**options)
    assert display.get_window_surface() is None


def test_a_misspelt_part_of_the_look_of_choices_is_warned_about(open_window, caplog):
    open_window(input_overlay={"node_colour": (1, 2, 3), "edge_color": (4, 5, 6)})
    assert "vis_kwargs: Unknown keyword 'node_colour'. Did you mean 'node_color'?" in caplog.text
