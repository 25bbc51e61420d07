"""The engine with a window: a loop that shows every turn, handles keys and mouse, and asks people where to go."""

import math
import os
from collections.abc import Callable, Mapping
from contextlib import suppress
from itertools import pairwise
from time import monotonic
from typing import Any, Literal, Unpack

import numpy as np

from gamms.arguments import as_bool, as_declared, as_text, explain_misspelled
from gamms.deciding import lift_decide_phase, refuse_while_deciding
from gamms.errors import BadType, BadValue, MissingFile, UnknownName
from gamms.ir.draw import DrawCommands
from gamms.knowledge.sides import Side, find_named_side, find_side_of
from gamms.text import shown
from gamms.typing import ArtistType, IAgent, IContext, ISensor
from gamms.typing.recorder import IPlayback, Step
from gamms.typing.visualization_engine import AgentVisual, GraphVisual, IVisualizationEngine, SensorVisual
from gamms.visual.appearance import Color, GraphData
from gamms.visual.artist import Artist, ArtistGroup, get_data
from gamms.visual.backends.pygame_backend import Canvas, hold_image, load
from gamms.visual.camera import Camera, is_near
from gamms.visual.compat import RenderManager, WindowNames
from gamms.visual.constants import Layer
from gamms.visual.drawers import render_input_overlay
from gamms.visual.drawing import Drawing, image_path
from gamms.visual.engine import PictureEngine
from gamms.visual.files import check_size
from gamms.visual.fog import Fog
from gamms.visual.labels import as_choice
from gamms.visual.legend import list_blocks
from gamms.visual.scene import FrameBudget, Scene
from gamms.visual.shown_turn import as_turns
from gamms.visual.themes import find_theme
from gamms.visual.window.display import FrameTiming, close_window, get_window_surface, is_watched, open_window
from gamms.visual.window.framing import Framing
from gamms.visual.window.input import Handlers, Input, NodeChoice, Question, make_question
from gamms.visual.window.overlay import Overlay
from gamms.visual.window.panels import HudLines

_OPTIONS = (
    "width", "height", "simulation_time_constant", "input_overlay", "max_fps", "theme", "trails", "labels", "title",
    "fog", "stay_open", "captions", "street_names",
)  # fmt: skip
_SMALLEST = 0.1  # world units: half the width that a graph without extent is seen in
_FOR_TILES = 0.005  # seconds of a frame
_ZOOM_RESTS = 0.12  # seconds after which a camera that was zooming is at rest


class WindowEngine(WindowNames, PictureEngine):
    """Shows a scenario in a window; see docs/pictures.md.

    Args:
        ctx: the context.
        width: pixels.
        height: pixels.
        simulation_time_constant: seconds for which a turn is shown.
        input_overlay: how a person's choices look: `node_color`, `node_size` (world units), `edge_color`.
        max_fps: frames per second at most in `simulate`, `human_input` and `stay_open`; `update` never waits.
        theme: "light", "dark" or "print".
        trails: of how many turns the ways of agents are shown.
        labels: whether agents have their names beside them; "auto": while they are few.
        title: of the window.
        fog: whether the window shows no more than the team of the person who is asked knows; or a team, by its text,
            of which it always shows the view.
        captions: whether it is said what happens, such as tags.
        street_names: whether streets have their names along them where the map is shown close by.
        stay_open: whether a `with` block, or a program, whose game is over ends only when the window is closed.
        kwargs: options of other engines are no error.

    Attributes:
        hud: a function of the context that returns the lines in the upper left corner, or None.
        camera: what the window shows.
        pace: how time passes in it.
        input: keys and mouse.
        overlay: captions and panels over the map.
        playback: the recording whose turns can be shown, if one is replayed or was.
        question: that a person is asked, if any.
        screen: the surface of the window.
        drawer_surface: what a drawer has painted on with pygame itself, if any did in this frame.

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
        labels: bool | Literal["auto"] = "auto",
        title: str = "GAMMS",
        fog: bool | str = True,
        stay_open: bool = True,
        captions: bool = True,
        street_names: bool = True,
        **kwargs: object,
    ) -> None:
        theme_ = find_theme(theme)
        self._theme = theme
        drawing = Drawing(ctx, theme_, _describe_image)
        super().__init__(ctx, simulation_time_constant=simulation_time_constant, drawing=drawing)
        width, height = check_size(width, height)
        self.camera = RenderManager(ctx, screen_width=width, screen_height=height)
        self.pace = FrameTiming(max_fps)
        self._background = theme_.background
        self.overlay = Overlay(ctx, self.drawing, self.artists, self.camera, self.pace, theme_)
        self.overlay.keep_trails(as_turns(trails))
        self.overlay.labels = as_choice(ctx, labels)
        self.overlay.has_captions = as_bool(captions, "captions")
        self.overlay.has_street_names = as_bool(street_names, "street_names")
        self.playback: IPlayback | None = None
        if not isinstance(fog, (bool, str)):
            raise BadType(f"fog is True, False or the name of a team, not {shown(fog)}.")
        self._fog = fog
        self._fogs = dict[Side, Fog]()
        self._fog_side: Side | None = None
        self._is_fog_missed = False
        self._wanted: int | None = None  # the turn that the person has chosen in this frame
        self._stays_open = as_bool(stay_open, "stay_open")
        self._was_closed = False
        self.hud: HudLines | None = self.overlay.write_turn_lines
        self.question: Question | None = None
        self.input = Input(self.camera, self._make_handlers())
        self._framing = Framing(ctx, self.camera, self.overlay, self.input)
        self.overlay.pointer = lambda: self.input.pointer
        look = {"node_color": Color.Green, "node_size": 4.0, "edge_color": Color.Green}
        given: object = input_overlay or {}
        if not isinstance(given, Mapping):
            raise BadType(f"input_overlay must be a dict with some of {', '.join(look)}, not {shown(given)}.")
        for sentence in (*explain_misspelled(kwargs, _OPTIONS), *explain_misspelled(given, look)):
            ctx.logger.warning("vis_kwargs: %s", sentence)
        self._declare_options({**look, **given})
        self._scene = Scene(ctx, self._make_world_key, tiles_turns=True)
        self.drawer_surface = None
        self._has_painters = False
        self._will_quit = False
        self._is_fresh = True
        self._last_camera: Camera | None = None
        self._last_frame = -math.inf
        self._zoomed = -math.inf
        self.screen = open_window(self, width, height, as_text(title, "title"))
        self.resized(*self.screen.get_size())

    def _make_handlers(self) -> Handlers:
        pace = self.pace
        overlay = self.overlay
        actions = {
            "play": pace.pause,
            "on": pace.step,
            "back": self.step_back,
            "start": self._go_to_start,
            "end": self._go_to_end,
            "slower": lambda: pace.change_speed(-1),
            "faster": lambda: pace.change_speed(1),
            "see everything": self.see_everything,
            "text": overlay.hud.toggle,
            "help": overlay.hud.toggle_help,
            "names": overlay.toggle_labels,
            "trails": overlay.toggle_trails,
            "theme": self.toggle_theme,
            "select none": lambda: self._click(None),
        }
        return Handlers(
            actions=actions,
            click=self._click,
            take=self._take_timeline,
            drag=self._drag_timeline,
            release=self._release_timeline,
            quit=self.quit,
            resize=self.resized,
            question=lambda: self.question,
            map_extent=lambda: self._framing.map_extent,
            is_over=self.ctx.is_terminated,
        )

    def _click(self, at: tuple[float, float] | None) -> None:
        if not self.overlay.dismiss():
            self.overlay.pin(at)

    @refuse_while_deciding
    def set_theme(self, name: str) -> None:
        """Change the theme: "light", "dark" or "print".

        Raises:
            BadValue: the theme does not exist.
        """
        theme = find_theme(name)
        self._theme = name
        self._background = theme.background
        self.drawing.theme = theme
        self.overlay.set_theme(theme)
        self.artists.edits += 1
        self._scene = Scene(self.ctx, self._make_world_key, tiles_turns=True)
        self._is_fresh = True
        self._show_options(self.question)
        self._set_caption(after_jump=True)

    def toggle_theme(self) -> None:
        """Switch between the light and the dark theme."""
        self.set_theme("light" if self._theme == "dark" else "dark")

    @refuse_while_deciding
    def quit(self) -> None:
        """End the context because the window was closed; during a turn of `ctx.game`, wait for the end of the turn."""
        self._will_quit = True
        self._was_closed = True
        game = self.ctx.current_game
        if game is None or not game.is_moving:
            self.ctx.terminate()

    @property
    def is_closing(self) -> bool:
        """Return whether the window was closed, and the context ends after the turn."""
        return self._will_quit

    def terminate(self) -> None:
        """End the films that are being made, and close the window."""
        super().terminate()
        self._end_playback()
        close_window(self)

    # -- frames ----------------------------------------------------------------------------------------------

    @lift_decide_phase
    def update(self) -> None:
        """Handle keys and mouse, and draw one frame, without waiting."""
        self._is_fresh = True
        self._frame()

    def simulate(self) -> None:
        """Show the turn that was played: the agents glide to where they are now, within `simulation_time_constant`."""
        super().simulate()
        if self._will_quit:
            self.quit()
        if self.ctx.is_terminated():
            return
        self.drawing.motion.begin_turn()
        self._count_turn()
        self._renew_fog()
        self._set_caption()
        self._is_fresh = True
        self.pace.begin_turn()
        self._draw_frames_while(lambda: self.pace.is_showing)

    def _count_turn(self) -> None:
        """Update the number of turns of the game, or of the replay, and the new events."""
        overlay = self.overlay
        playback = self.playback
        game = self.ctx.current_game
        if playback is not None and getattr(self.ctx.record, "is_replaying", False):
            overlay.turns = playback.turn
            overlay.is_over = playback.turn >= playback.turns
            overlay.timeline.can_seek = playback.can_seek
            return
        self._end_playback()
        overlay.turns += 1
        if game is not None:
            overlay.turns = game.turn or overlay.turns
            overlay.is_over = game.over is not None
            overlay.timeline.turns = game.last_turn or 0
            for event in self.drawing.events.list_last():
                overlay.timeline.add(overlay.turns, event)
            overlay.timeline.add(overlay.turns, {"scores": game.scores})
            overlay.timeline.add(overlay.turns, {"over": game.over})

    @lift_decide_phase
    def human_input(self, agent_name: str, state: dict[str, Any]) -> int | tuple[float, float, float]:
        """Ask a person for the action of an agent: a node, or a flight (dx, dy, dz).

        If the window is closed meanwhile, the context ends, and the agent stays.

        Raises:
            UnknownName (KeyError): there is no such agent.
        """
        if self.ctx.is_terminated() or self._will_quit:
            return super().human_input(agent_name, state)
        asked = make_question(self.ctx, agent_name, state)
        self.question = asked
        self._show_options(asked)
        self._begin_fog_of_question(self.ctx.agent.get_agent(agent_name), state)
        if isinstance(asked, NodeChoice):
            self._framing.see_choices(asked.places)
        self._is_fresh = True
        try:
            self._draw_frames_while(lambda: asked.answer is None)
        finally:
            self.question = None
            self._show_options(None)
        return super().human_input(agent_name, state) if asked.answer is None else asked.answer

    @refuse_while_deciding
    def stay_open(self) -> None:
        """Show how things are until the window is closed, or a key handler or drawer ends the context.

        After a replay, any of its turns can be shown, and played on from there.
        """
        if self._is_time_up():
            self.overlay.is_over = True
            self._is_fresh = True
            self._renew_fog()
        while not self.ctx.is_terminated() and not self._will_quit:
            self._draw_frames_while(lambda: not self._can_play())
            if self._can_play() and self.playback is not None:
                self.playback.play_turn()

    def _can_play(self) -> bool:
        playback = self.playback
        return playback is not None and playback.can_seek and playback.turn < playback.turns and not self.pace.is_halted

    def stay_open_after_game(self) -> None:
        """Stay open at the end of a `with` block, where a game is over and there may be a person who looks at it."""
        is_over = self.overlay.is_over or self._is_time_up()
        if self._stays_open and is_over and is_watched() and not (self.ctx.is_terminated() or self._was_closed):
            with suppress(KeyboardInterrupt):  # the person at the terminal has seen it
                self.stay_open()

    def stay_open_at_exit(self) -> None:
        """Stay open at the end of a program as well, after a game; a replay ends with its program, as in 1.0.0."""
        if not self.overlay.is_replay:
            self.stay_open_after_game()

    def _is_time_up(self) -> bool:
        game = self.ctx.current_game
        return game is not None and game.turn > 0 and game.turn == game.last_turn

    # -- fog and visibility -------------------------------------------------------------------------------

    def _begin_fog_of_question(self, agent: IAgent, state: dict[str, Any]) -> None:
        """Show the knowledge from which an agent decides, to the person who decides for it."""
        if self._fog and "sensor" in state:
            self.drawing.carriers.follow().note([agent], [state])
        if self._fog is True:
            self._see_as(find_side_of(agent))
        elif self._fog:
            self._renew_fog()

    def _see_as(self, side: Side) -> None:
        """Restrict the display to the knowledge of a side, unless the graph was declared, or the side has no sensor."""
        fog = self._fogs.get(side)
        if fog is None and not self.artists.is_graph_declared:
            with suppress(BadValue):  # the side has no sensor
                fog = Fog(self.ctx, side)
                self._fogs[side] = fog
        if fog is not None:
            fog.look()

    def _renew_fog(self) -> None:
        """Update the fog; show everything at the end of a game in which a person was asked."""
        if isinstance(self._fog, str):
            side = self._find_fog_side(self._fog)
            if side is not None:
                self._see_as(side)
        elif self.overlay.is_over:
            self.artists.fog = None
        elif self.artists.fog is not None:
            self.artists.fog.look()

    def _find_fog_side(self, name: str) -> Side | None:
        """Return the side that `fog=` names, from its first agent on; log a warning if there are only others."""
        if self._fog_side is None:
            sides = list(map(find_side_of, self.ctx.agent.create_iter()))
            try:
                self._fog_side = find_named_side(name, sides)
            except UnknownName as error:
                if sides and not self._is_fog_missed:
                    self._is_fog_missed = True
                    self.ctx.logger.warning(f"fog=: {error} Everything is shown.")
        return self._fog_side

    def _set_caption(self, *, after_jump: bool = False) -> None:
        side = None if self.artists.fog is None else self.artists.fog.side
        self.overlay.show_captions(side, self.turn_seconds, after_jump=after_jump)

    # -- turns of a recording --------------------------------------------------------------------------------

    def show_playback(self, playback: IPlayback) -> None:
        """Show the turns of a recording at the choice of a person; called by the recorder that replays it."""
        self._end_playback()
        overlay = self.overlay
        self.playback = playback
        overlay.is_replay = True
        overlay.turns = playback.turn
        overlay.timeline.turns = playback.turns
        overlay.timeline.can_seek = playback.can_seek
        for turn, highlight in playback.highlights():
            overlay.timeline.add(turn, highlight)
        self._show_recorded_turn(playback)

    def _end_playback(self) -> None:
        if self.playback is not None:
            self.playback.close()
            self.playback = None
            self.overlay.is_replay = False
            self.overlay.clear_timeline()

    @refuse_while_deciding
    def seek(self, turn: int) -> None:
        """Jump to the state after a number of turns of the replayed recording, and continue from there.

        Raises:
            BadValue: the turn does not exist, or no recording of version 3 is being replayed.
            RecorderBusy (RuntimeError): the replay is being recorded.
        """
        if self.playback is None or not self.playback.is_open:
            raise BadValue("There is no turn to go to: no recording of version 3 is being replayed.")
        self.playback.seek(turn)
        self._show_recorded_turn(self.playback)
        self.pace.show_end()

    def _show_recorded_turn(self, playback: IPlayback) -> None:
        """Show the turn that a recording is at, with the trails that lead there."""
        overlay = self.overlay
        motion = self.drawing.motion
        turn = playback.turn
        first = max(turn - overlay.most_trails, 0)
        steps = [playback.steps(one) for one in range(first, turn + 1)] if turn else [{}]
        moves = [motion.make_moves(_find_new_steps(before, after)) for before, after in pairwise(steps)]
        self.drawing.turns.jump(moves)
        motion.begin_turn()
        overlay.turns = turn
        overlay.is_over = turn >= playback.turns
        self._is_fresh = True
        self._renew_fog()
        self._set_caption(after_jump=True)

    @refuse_while_deciding
    def step_back(self) -> None:
        """Jump back by one turn, and pause."""
        if self.playback is not None and self.playback.can_seek:
            self.pace.is_paused = True
            self._wanted = max(self.overlay.turns - 1, 0)

    @refuse_while_deciding
    def _go_to_start(self) -> None:
        """Jump to the start of the recording, and pause; in a game that is played, show the whole graph."""
        if self.playback is None:
            self.see_everything()
        elif self.playback.can_seek:
            self.pace.is_paused = True
            self._wanted = 0

    @refuse_while_deciding
    def _go_to_end(self) -> None:
        """Jump to the last turn of the recording, and pause."""
        if self.playback is not None and self.playback.can_seek:
            self.pace.is_paused = True
            self._wanted = self.playback.turns

    def _take_timeline(self, at: tuple[float, float]) -> bool:
        """Handle a press on the timeline; the chosen turn is shown while the button is held."""
        timeline = self.overlay.timeline
        if not self.overlay.foot:
            return False
        if timeline.is_button(at):
            self.pace.pause()
            return True
        is_there = timeline.find_place(at) is not None
        self.pace.is_held = is_there and timeline.can_seek
        self._drag_timeline(at)
        return is_there

    def _drag_timeline(self, at: tuple[float, float]) -> None:
        if self.pace.is_held:
            self._wanted = round(self.overlay.timeline.find_share(at) * self.overlay.timeline.turns)

    def _release_timeline(self) -> None:
        self.pace.is_held = False

    def _draw_frames_while(self, goes_on: Callable[[], bool]) -> None:
        """Draw frames at the frame rate while the window is open and the condition holds."""
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
        """Handle the events of keys, mouse and window since the last frame."""
        if self.ctx.is_terminated():
            return
        self.input.handle(load().event.get())
        # the last one of all that a hand went over
        wanted = self._wanted
        self._wanted = None
        if wanted is not None and wanted != self.overlay.turns and not self.ctx.is_terminated():
            self.seek(wanted)

    def handle_tick(self) -> None:
        """End a frame: where its pace is capped, wait until it is time for the next one."""
        if self.ctx.is_terminated():
            return
        self.input.glide(min(self.pace.tick(self.turn_seconds), 0.1))

    def handle_single_draw(self) -> None:
        """Draw the present state and the words on it; it is seen after the next flip of the display."""
        if self.ctx.is_terminated():
            return
        self.screen = get_window_surface() or self.screen
        overlay = self.overlay
        overlay.limit_sizes()
        if self._is_fresh or not overlay.shown:
            overlay.begin_turn()
            overlay.hud.legend.explain(list_blocks(self.ctx, overlay.shown), *self.screen.get_size())
        self._framing.fit()
        share = self.pace.share(self.turn_seconds)
        is_new_turn = self._is_fresh or self._has_painters
        self._scene.draw(overlay.list_artists(share), lambda group: self._draw(group, share), is_new_turn=is_new_turn)
        self._is_fresh = False
        if self.ctx.is_terminated():  # by a drawer
            return
        width, height = self.screen.get_size()
        canvas = Canvas(width, height, self.screen)
        self._scene.paint(canvas, self.camera.camera(), self._background, self._make_frame_budget())
        overlay.paint(canvas, self.hud, self.question)

    def _draw(self, group: ArtistGroup, share: float) -> DrawCommands:
        self.drawer_surface = None
        for artist in group.artists:
            data = get_data(artist)
            if "agent_data" in data:
                data["_waiting_simulation"] = self.pace.is_showing
        commands = group.draw_artists(share)
        self._scene.note_overlay(group.artists, self.drawer_surface)
        if self.drawer_surface is not None:
            kinds = {artist.get_artist_type() for artist in group.artists}
            self._has_painters = self._has_painters or ArtistType.STATIC in kinds
        return commands

    def _make_world_key(self) -> Any:
        """Return a key of the inputs of STATIC artists; custom painting also depends on the camera."""
        return self.drawing.map_version(), self.camera.camera() if self._has_painters else None

    def _make_frame_budget(self) -> FrameBudget:
        now = monotonic()
        camera = self.camera.camera()
        last = self._last_camera
        is_leaping = last is None or not is_near(camera, last)
        if last is not None and camera.scale != last.scale:
            is_leaping = is_leaping or now - self._last_frame > 2 * _ZOOM_RESTS
            self._zoomed = -math.inf if is_leaping else now
        self._last_camera = camera
        self._last_frame = now
        is_zooming = now - self._zoomed < _ZOOM_RESTS
        return FrameBudget(_FOR_TILES / 2 if is_zooming else _FOR_TILES, is_zooming=is_zooming, is_leaping=is_leaping)

    # -- where it looks --------------------------------------------------------------------------------------

    def look_at(self, x: float, y: float, width: float) -> None:
        """Show `width` world units around (x, y) in the window, in frames and films.

        Raises:
            BadType, BadValue: not finite numbers, or a width that is not positive.
        """
        super().look_at(x, y, width)
        view = self.camera
        view.camera_x = float(x)
        view.camera_y = float(y)
        view.camera_size = float(width) / 2

    def look_at_all(self) -> None:
        """Show everything in the window, in frames and films."""
        super().look_at_all()
        self.see_everything()

    @refuse_while_deciding
    def see_everything(self) -> None:
        """Show the whole graph in the window, also after it is resized."""
        if not self.ctx.is_terminated():
            self._framing.see_everything()

    def get_viewport(self) -> tuple[float, float, float, float, float]:
        """Return `(left, right, low end, high end, pixels per unit)` of the view."""
        view = self.camera
        return view.bound_left, view.bound_right, view.bound_top, view.bound_bottom, view.scale

    def resized(self, width: int, height: int) -> None:
        """Adapt to a new size of the window."""
        self.screen = get_window_surface() or self.screen
        self.pictures.width = width
        self.pictures.height = height
        self.camera.set_screen_size(width, height)

    # -- declarations ------------------------------------------------------------------------------------

    @as_declared(IVisualizationEngine.set_graph_visual)
    def set_graph_visual(self, **kwargs: Unpack[GraphVisual]) -> Artist:
        """Declare how the graph looks, and look at it."""
        artist = self.artists.set_graph_visual(**kwargs)
        if not self.ctx.is_terminated() and len(xy := self.ctx.graph.columns().xy):
            self.camera.set_origin(*xy.mean(axis=0).tolist())
            self.camera.camera_size = max(float(np.ptp(xy, axis=0).max()), _SMALLEST)
        return artist

    @refuse_while_deciding
    @as_declared(IVisualizationEngine.set_agent_visual)
    def set_agent_visual(self, name: str, **kwargs: Unpack[AgentVisual]) -> Artist:
        """Declare how an agent looks."""
        path = kwargs.get("image_path")
        if path is not None and not os.path.isfile(path):  # noqa: PTH113 - as in other files of drawing
            raise MissingFile(f"the image of agent {name!r}", path)
        return self.artists.set_agent_visual(name, **kwargs)

    @as_declared(IVisualizationEngine.set_sensor_visual)
    def set_sensor_visual(self, name: str, **kwargs: Unpack[SensorVisual]) -> Artist:
        """Declare how a sensor's last view looks."""
        if self.ctx.is_terminated():
            return self.artists.set_sensor_visual(name, **kwargs)
        sensor = self.ctx.sensor.get_sensor(name)
        last_view = getattr(type(sensor), "last_view", None)
        if last_view is None or last_view is ISensor.last_view:
            raise BadValue(f"Sensor {name!r} cannot be drawn: give {type(sensor).__name__} a method last_view.")
        kwargs.setdefault("layer", Layer.WINDOW_SENSORS)
        return self.artists.set_sensor_visual(name, **kwargs)

    def _declare_options(self, look: dict[str, Any]) -> None:
        artist = Artist(self.ctx, render_input_overlay, Layer.OPTIONS)
        artist.data = {"graph_data": GraphData(look["node_color"], look["node_size"], look["edge_color"])}
        self.artists.declared["input_overlay"] = artist
        self._show_options(None)

    def _show_options(self, asked: Question | None) -> None:
        artist = self.artists.declared["input_overlay"]
        theme = self.overlay.hud.theme
        standard = GraphData(Color.Green, 4.0, Color.Green)
        artist.data |= {
            "_ink": theme.ink if artist.data["graph_data"] == standard else None,
            "_input_options": dict(asked.options) if isinstance(asked, NodeChoice) else {},
            "_waiting_user_input": asked is not None,
            "_waiting_agent_name": None if asked is None else asked.name,
        }
        artist.set_visible(asked is not None)


def _find_new_steps(before: dict[str, Step], after: dict[str, Step]) -> dict[str, Step]:
    """Return the last moves of agents that were not their last ones before."""
    return {name: step for name, step in after.items() if before.get(name) != step}


def _describe_image(image: object) -> str:
    """Return the path of an image file, or a name for a loaded image."""
    return hold_image(image) if isinstance(image, load().Surface) else image_path(image)


PygameVisualizationEngine = WindowEngine  # as 1.0.0 names it
