"""The engine with a window: shows every turn, takes the wishes of those who watch, and asks people where to go."""

import math
import os
from collections.abc import Callable, Mapping
from time import monotonic
from typing import Any

import numpy as np

from gamms.arguments import as_int, misspelt
from gamms.deciding import outside_of_deciding, refused_while_deciding
from gamms.errors import BadValue, MissingFile
from gamms.ir.draw import DrawCommands
from gamms.typing import ArtistType, IArtist, IContext, ISensor
from gamms.visual.appearance import GraphData
from gamms.visual.artist import Artist
from gamms.visual.artist_group import ArtistGroup
from gamms.visual.backends.pygame import Canvas, hold_image, load
from gamms.visual.camera import Camera
from gamms.visual.color import Color
from gamms.visual.drawers import render_input_overlay
from gamms.visual.layers import Layer
from gamms.visual.legend import blocks_of
from gamms.visual.picture import size
from gamms.visual.undeclared import Undeclared
from gamms.visual.window.asking import Question, Walk, question
from gamms.visual.window.controls import Controls
from gamms.visual.window.display import close_window, open_window, window_surface
from gamms.visual.window.hud import Hud, Words
from gamms.visual.window.onlookers import Onlookers
from gamms.visual.window.pacing import Pace
from gamms.visual.window.stage import Stage
from gamms.visual.window.themes import theme_called
from gamms.visual.window.tiles import Haste
from gamms.visual.window.view import RenderManager, is_near

_OPTIONS = (
    "width", "height", "simulation_time_constant", "input_overlay", "max_fps", "theme", "trails", "labels", "title",
)  # fmt: skip
_SMALLEST = 0.1  # world units: half the width that a graph without extent is seen in
_FOR_TILES = 0.005  # seconds of a frame
_ZOOM_RESTS = 0.12  # seconds after which a camera that was zooming is at rest
_MARGINS = (
    (40, 0.06),
    (40, 0.06),
    (84, 0.12),
)  # at the sides, above and below a whole graph: pixels, share of the height


class WindowEngine(Onlookers):
    """Shows a scenario in a window; see docs/pictures.md.

    Args:
        ctx: the context.
        width: pixels.
        height: pixels.
        simulation_time_constant: seconds for which a turn is shown.
        input_overlay: how a person's choices look: `node_color`, `node_size` (world units), `edge_color`.
        max_fps: frames per second at most in `simulate`, `human_input` and `stay_open`; `update` never waits.
        theme: "light" or "dark".
        trails: of how many turns the ways of agents are shown.
        labels: whether agents have their names beside them.
        title: of the window.
        kwargs: options of other engines are no error.

    Attributes:
        hud: what is written in the upper left corner: a function of the context that returns lines, or None.

    Raises:
        BadValue, BadType: an option that is impossible.
        MissingExtra (ImportError): pygame is not installed.
        NoDisplay (RuntimeError): no window can be opened here.
    """

    def __init__(  # noqa: PLR0913 - the options of `vis_kwargs`; 1.0.0 takes the first by position
        self,
        ctx: IContext,
        width: int = 1280,
        height: int = 720,
        simulation_time_constant: float = 2.0,
        *,
        input_overlay: Mapping[str, Any] | None = None,
        max_fps: float = 60,
        theme: str = "light",
        trails: int = 0,
        labels: bool = False,
        title: str = "GAMMS",
        **kwargs: Any,
    ) -> None:
        super().__init__(ctx, simulation_time_constant=simulation_time_constant)
        self.width, self.height = size(width, height)
        self.pace, self._theme = Pace(max_fps), theme_called(theme)
        self._usual, self.wall_tones = Undeclared(ctx, self._theme.map), self._theme.map.walls
        self._turns_of_trails, self.has_labels = as_int(trails, "trails"), bool(labels)
        self.trails.turns = max(self._turns_of_trails, 0)
        look = {"node_color": Color.Green, "node_size": 4.0, "edge_color": Color.Green, **(input_overlay or {})}
        self._declare_overlay(look)
        for sentence in misspelt(kwargs, _OPTIONS):
            ctx.logger.warning("vis_kwargs: %s", sentence)
        self.question: Question | None = None
        self.hud: Hud | None = self.turn_lines
        self.words = Words(self, self._theme)
        self.controls = Controls(self)
        self._render_manager = RenderManager(ctx, screen_width=self.width, screen_height=self.height)
        self._stage = Stage(ctx, self._world)
        self._share, self._has_painters = 1.0, False
        self._is_fresh, self._shown = True, dict[str, IArtist]()
        self._last_camera: Camera | None = None
        self._last_frame = self._zoomed = -math.inf
        self._fitted: Any = None
        self._screen = open_window(self, self.width, self.height, title)
        self.resized(*self._screen.get_size())

    @refused_while_deciding
    def quit(self) -> None:
        """End the context because the window was closed; in the midst of a turn of `ctx.game`, when it is over."""
        self._will_quit = True
        game: Any = getattr(self.ctx, "_game", None)  # asking for `ctx.game` would make one
        if game is None or not game.is_deciding:
            self.ctx.terminate()

    def terminate(self) -> None:
        """Close the room and its window."""
        super().terminate()
        close_window(self)

    # -- frames ----------------------------------------------------------------------------------------------

    @outside_of_deciding
    def update(self) -> None:
        """Do what keys and mouse say, and draw one frame, without waiting."""
        self._is_fresh = True
        self._frame()

    def simulate(self) -> None:
        """Show the turn that was played: the agents glide to where they are now, within `simulation_time_constant`."""
        super().simulate()
        if self._will_quit:
            self.quit()
        if self.ctx.is_terminated():
            return
        self._has_begun = bool(self._films)  # which have looked up the moves already
        self.turns += 1
        self._is_fresh = True
        self._toggle_waiting_simulation(True)
        self.trails.add_turn(self.motion)
        self._frames_while(lambda: self._waiting_simulation)

    @outside_of_deciding
    def human_input(self, agent_name: str, state: dict[str, Any]) -> int | tuple[float, float, float]:
        """Ask a person what an agent does: the node it goes to, or the way (dx, dy, dz) it flies.

        Where the window is closed meanwhile, the context ends, and the agent stays.

        Raises:
            UnknownName (KeyError): there is no such agent.
        """
        if self.ctx.is_terminated() or self._will_quit:
            return super().human_input(agent_name, state)
        asked = self.question = question(self.ctx, agent_name, state)
        self._show_options(asked)
        self._is_fresh = True
        try:
            self._frames_while(lambda: asked.answer is None)
        finally:
            self.question = None
            self._show_options(None)
        return super().human_input(agent_name, state) if asked.answer is None else asked.answer

    @refused_while_deciding
    def stay_open(self) -> None:
        """Show how things are until somebody closes the window, or a key handler or drawer ends the context."""
        self._frames_while(lambda: True)

    def _frames_while(self, goes_on: Callable[[], bool]) -> None:
        """Draw frames at their pace as long as it goes on and the window is open."""
        self.pace.is_capped = True
        try:
            while not self.ctx.is_terminated() and not self._will_quit and goes_on():
                self._frame()
        finally:
            self.pace.is_capped = False

    def _frame(self) -> None:
        self.handle_input()
        if self.ctx.is_terminated():
            return
        self.handle_single_draw()
        if not self.ctx.is_terminated():
            load().display.flip()
            self.handle_tick()

    def handle_input(self) -> None:
        """Do what happened to keys, mouse and window since the last frame."""
        if not self.ctx.is_terminated():
            self.controls.handle(load().event.get())

    def handle_tick(self) -> None:
        """End a frame: where its pace is capped, wait until it is time for the next one."""
        if self.ctx.is_terminated():
            return
        is_over = self._waiting_simulation and self._simulation_time >= self.turn_seconds and not self.pace.stands
        seconds, shown = self.pace.tick()
        if self._waiting_simulation:
            self._simulation_time += shown
        if is_over:
            self._toggle_waiting_simulation(False)
        self.controls.glide(min(seconds, 0.1))

    def handle_single_draw(self) -> None:
        """Draw the present state and the words on it; it is seen after the next flip of the display."""
        if self.ctx.is_terminated():
            return
        self._screen = window_surface() or self._screen
        if self._is_fresh or not self._shown:
            self._ask_who_is_shown()
        self._fit()
        self._share = self._turn_share()
        self._stage.draw(
            self._shown | self.hints(), self._draw_members, is_new_turn=self._is_fresh or self._has_painters
        )
        self._is_fresh = False
        if self.ctx.is_terminated():  # by a drawer
            return
        width, height = self._screen.get_size()
        canvas = Canvas(width, height, self._screen)
        self._stage.show(canvas, self._render_manager.camera(), self._theme.background, self._haste())
        self.paint_labels(canvas)
        self.words.paint(canvas)

    def _ask_who_is_shown(self) -> None:
        shown = self.onstage_artists()
        if self._is_declared or shown != self._shown:  # what one declares one may also change from outside
            self._shown = shown
        self.words.legend.explain(blocks_of(self.ctx, shown), *self._screen.get_size())

    def _turn_share(self) -> float:
        """How much of the turn is shown."""
        if not self._waiting_simulation or self.turn_seconds <= 0.0:
            return 1.0
        return min(self._simulation_time / self.turn_seconds, 1.0)

    def _draw_members(self, members: ArtistGroup) -> DrawCommands:
        self._overlay = None
        for artist in members.artists:
            if isinstance(getattr(artist, "data", None), dict) and "agent_data" in artist.data:
                artist.data["_waiting_simulation"] = self._waiting_simulation
        commands = self._drawn(members, self._share)
        self._stage.note_overlay(members.artists, self._overlay)
        if self._overlay is not None:
            kinds = {artist.get_artist_type() for artist in members.artists}
            self._has_painters = self._has_painters or ArtistType.STATIC in kinds
        return commands

    def _world(self) -> Any:
        """What STATIC artists' drawings depend on; what they paint themselves depends on the camera, too."""
        graph = self.ctx.graph
        seen = self._render_manager.camera() if self._has_painters else None
        return getattr(graph.graph, "revision", None), getattr(graph, "obstacle_revision", None), seen

    def _haste(self) -> Haste:
        now, camera, last = monotonic(), self._render_manager.camera(), self._last_camera
        is_leaping = last is None or not is_near(camera, last)
        if last is not None and camera.scale != last.scale:
            is_leaping = is_leaping or now - self._last_frame > 2 * _ZOOM_RESTS
            self._zoomed = -math.inf if is_leaping else now
        self._last_camera, self._last_frame = camera, now
        is_zooming = now - self._zoomed < _ZOOM_RESTS
        return Haste(_FOR_TILES / 2 if is_zooming else _FOR_TILES, is_zooming=is_zooming, is_leaping=is_leaping)

    # -- where it looks --------------------------------------------------------------------------------------

    def look_at(self, x: float, y: float, width: float) -> None:
        """Let the window, frames and films show `width` world units around (x, y).

        Raises:
            BadType, BadValue: not finite numbers, or a width that is not positive.
        """
        super().look_at(x, y, width)
        view = self._render_manager
        view.camera_x, view.camera_y, view.camera_size = float(x), float(y), float(width) / 2

    def look_at_all(self) -> None:
        """Let the window, frames and films show everything."""
        super().look_at_all()
        self.see_everything()

    @refused_while_deciding
    def see_everything(self) -> None:
        """Let the window show the whole graph."""
        if not self.ctx.is_terminated():
            self._see_graph(is_pointed=True)

    def get_viewport(self) -> tuple[float, float, float, float, float]:
        """`(left, right, low end, high end, pixels per unit)` of what is seen."""
        view = self._render_manager
        return view.bound_left, view.bound_right, view.bound_top, view.bound_bottom, view.scale

    def resized(self, width: int, height: int) -> None:
        """The window has another size now."""
        self._screen = window_surface() or self._screen
        self.width, self.height = width, height
        self._render_manager.set_screen_size(width, height)

    def _fit(self) -> None:
        """See the whole graph, as long as the camera was not moved."""
        if self._render_manager.is_pointed:
            return
        revision = getattr(self.ctx.graph.graph, "revision", None)
        # Not the width of the legend: with it, the map would jump whenever a score has one more digit.
        now = revision, self._screen.get_size(), len(self.words.legend.blocks)
        if revision is None or now != self._fitted:
            self._fitted = now
            self._see_graph()

    def _see_graph(self, *, is_pointed: bool = False) -> None:
        xy = self.ctx.graph.columns().xy
        if len(xy):
            side, top, low = (min(px, share * self.height) for px, share in _MARGINS)
            margins = side, top, max(side, self.words.legend.width), low
            self._render_manager.look_at_box(xy.min(axis=0), xy.max(axis=0), margins, is_pointed=is_pointed)

    # -- what is declared ------------------------------------------------------------------------------------

    def set_graph_visual(self, **kwargs: Any) -> Artist:
        """Declare how the graph looks, and look at it: `node_color`, `node_size`, `edge_color`, `draw_id`."""
        artist = super().set_graph_visual(**kwargs)
        if not self.ctx.is_terminated():
            xy = self.ctx.graph.columns().xy
            if len(xy):
                self._render_manager.set_origin(*xy.mean(axis=0).tolist())
                self._render_manager.camera_size = max(float(np.ptp(xy, axis=0).max()), _SMALLEST)
        return artist

    @refused_while_deciding
    def set_agent_visual(self, name: str, **kwargs: Any) -> Artist:
        """Declare how an agent looks: `color`, `size` (world units), `image_path`; it need not exist yet.

        Raises:
            MissingFile (FileNotFoundError): there is no such image.
        """
        path = kwargs.get("image_path")
        if path is not None and not os.path.isfile(path):  # noqa: PTH113 - as elsewhere in the room
            raise MissingFile(f"the image of agent {name!r}", path)
        return super().set_agent_visual(name, **kwargs)

    def set_sensor_visual(self, name: str, **kwargs: Any) -> Artist:
        """Declare how a sensor's last view looks: `color`, `size`, or `node_color`, `edge_color`; `layer`.

        Raises:
            UnknownName (KeyError): there is no such sensor.
            BadValue: it is of a kind of its own that does not say what it saw.
        """
        if self.ctx.is_terminated():
            return super().set_sensor_visual(name, **kwargs)
        sensor = self.ctx.sensor.get_sensor(name)
        last_view = getattr(type(sensor), "last_view", None)
        if last_view is None or last_view is ISensor.last_view:
            raise BadValue(f"Sensor {name!r} cannot be drawn: give {type(sensor).__name__} a method last_view.")
        return super().set_sensor_visual(name, **{"layer": Layer.WINDOW_SENSORS, **kwargs})

    def render_image(
        self, x: float, y: float, image: Any, size: float, angle: float = 0.0, perform_culling_test: bool = True
    ) -> None:
        """Draw an image file, or a loaded image, with side `2 * size`, turned by `angle` degrees."""
        if self._drawing is not None and isinstance(image, load().Surface):
            self._drawing.add_image(hold_image(image), x, y, size, angle)
        else:
            super().render_image(x, y, image, size, angle, perform_culling_test)

    def _declare_overlay(self, look: dict[str, Any]) -> None:
        artist = Artist(self.ctx, render_input_overlay, Layer.OPTIONS)
        known = {name: look[name] for name in ("node_color", "node_size", "edge_color")}
        artist.data = {"graph_data": GraphData(**known)}
        self._artists["input_overlay"] = artist
        self._show_options(None)

    def _show_options(self, asked: Question | None) -> None:
        artist, is_asked = self._artists["input_overlay"], asked is not None
        self._waiting_user_input, self._waiting_agent_name = is_asked, asked.name if asked is not None else None
        artist.data |= {
            "_input_options": dict(asked.options) if isinstance(asked, Walk) else {},
            "_waiting_user_input": is_asked,
            "_waiting_agent_name": self._waiting_agent_name,
        }
        artist.set_visible(is_asked)
