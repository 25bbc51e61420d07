"""The visual engine without a window: accepts all calls of 1.0.0, and draws only for pictures and films.

`PictureEngine` is a front for four parts: `drawing` (primitives to commands), `artists`, `viewpoint` and `pictures`.
The engine with a window is in `window/`.
"""

import atexit
import os
from collections.abc import Callable, Iterator, Mapping
from typing import Any, Concatenate, Generic, ParamSpec, TypeVar, cast

from gamms.arguments import as_float, as_range, explain_misspelled
from gamms.compat import Surface
from gamms.deciding import (
    ContextPart,
    Protected,
    get_phase,
    leave_last_turn,
    lift_decide_phase,
    refuse_while_deciding,
)
from gamms.ir.draw import DrawCommands
from gamms.progress import delay_interrupts
from gamms.text import shown
from gamms.typing import IContext, IVisualizationEngine
from gamms.visual.artist import ArtistGroup
from gamms.visual.artists import Artists
from gamms.visual.drawing import Drawing
from gamms.visual.files import check_size
from gamms.visual.pictures import Pictures
from gamms.visual.shown_turn import PastTurns

_OFFSCREEN_OPTIONS = ("width", "height", "video", "fps", "frames_per_turn", "simulation_time_constant", "title", "note")

_TURN_SECONDS = 2.0

_P = ParamSpec("_P")
_R = TypeVar("_R")
_T = TypeVar("_T")


class _Method:
    """A descriptor that forwards to a method of a part."""

    def __init__(self, part: str, method: Callable[..., Any]) -> None:
        self._part = part
        self._method = method

    def __call__(self, engine: object, *args: object, **kwargs: object) -> Any:
        return self.__get__(engine, type(engine))(*args, **kwargs)

    def __get__(self, engine: object, owner: type) -> Any:
        return self._method if engine is None else getattr(getattr(engine, self._part), self._method.__name__)


def _delegate_to(part: str, method: Callable[Concatenate[Any, _P], _R]) -> Callable[Concatenate[Any, _P], _R]:
    return cast("Callable[Concatenate[Any, _P], _R]", _Method(part, method))


class _Attribute(Generic[_T]):
    """A descriptor that forwards to an attribute of a part."""

    def __init__(self, part: str, name: str, check: Callable[[Any, str], _T] | None = None) -> None:
        self._part = part
        self._name = name
        self._check = check

    def __get__(self, engine: object, owner: type) -> _T:
        value: _T = getattr(getattr(engine, self._part), self._name)
        return value

    def __set__(self, engine: object, value: _T) -> None:
        checked = value if self._check is None else self._check(value, f"ctx.visual.{self._name}")
        setattr(getattr(engine, self._part), self._name, checked)


class PictureEngine(Surface, ContextPart, IVisualizationEngine):
    """The engine without a window.

    Attributes:
        after_turn: functions that `simulate` calls, in order.
        drawing: the drawing primitives.
        artists: the artists.
        pictures: makes pictures of the current state, and films.
        turn_seconds: the display time of a turn, seconds; the simulation time constant of 1.0.0.
        viewpoint: the view of pictures.
    """

    _called = "ctx.visual"

    def __deepcopy__(self, memo: dict[int, Any]) -> Any:
        """Return the engine of the copy of the context, which is made now; without such a copy, stay itself."""
        ctx = memo.get(id(self.ctx))
        return self if ctx is None else ctx.visual_engine

    def __repr__(self) -> str:
        return f"{type(self).__name__}(artists=[{', '.join(map(shown, self.artists.declared))}])"

    def _repr_png_(self) -> bytes | None:
        """Return the current state as PNG for notebooks; None if it cannot be drawn."""
        return self._show_in_notebook(self.pictures.as_png)

    def _repr_html_(self) -> str | None:
        """Return the current state as SVG for notebooks, if PNG is not available; else None."""
        return None if self._repr_png_() is not None else self._show_in_notebook(self.pictures.as_html)

    def _show_in_notebook(self, show: Callable[[], _T | None]) -> _T | None:
        try:
            return None if self.ctx.is_terminated() else show()
        except Exception as error:  # noqa: BLE001 - a notebook then shows the repr
            self.ctx.logger.warning(f"The context cannot be shown: {error}")
            return None

    after_turn: Protected[list[Callable[[], None]]] = Protected(list)
    _after_turn: list[Callable[[], None]]

    def __init__(
        self, ctx: IContext, *, simulation_time_constant: float = _TURN_SECONDS, drawing: Drawing | None = None
    ) -> None:
        self._phase = get_phase(ctx)
        self.ctx = ctx
        self.after_turn = []
        self.drawing = drawing or Drawing(ctx)
        self.viewpoint = self.drawing.viewpoint
        self.artists = Artists(ctx, self.drawing)
        seconds = as_range(simulation_time_constant, "simulation_time_constant")
        self.pictures = Pictures(ctx, self.drawing, self.artists, seconds)

    turn_seconds = _Attribute[float]("pictures", "turn_seconds", as_range)

    # -- drawing: 1.0.0's primitives; `drawing` can also draw many objects at once -----------------------

    render_text = _delegate_to("drawing", Drawing.render_text)
    render_rectangle = _delegate_to("drawing", Drawing.render_rectangle)
    render_circle = _delegate_to("drawing", Drawing.render_circle)
    render_line = _delegate_to("drawing", Drawing.render_line)
    render_linestring = _delegate_to("drawing", Drawing.render_linestring)
    render_polygon = _delegate_to("drawing", Drawing.render_polygon)
    render_image = _delegate_to("drawing", Drawing.render_image)

    def render_layer(self, layer_id: int) -> None:
        """Do nothing: layers are painted with the picture."""

    def create_layer(self, layer_id: int, *args: object, **kwargs: object) -> None:
        """Do nothing: layers exist as soon as they have an artist."""

    def clear_layer(self, layer_id: int) -> None:
        """Do nothing: every picture begins empty."""

    def fill_layer(self, layer_id: int, *args: object, **kwargs: object) -> None:
        """Do nothing: layers have no background."""

    # -- artists ---------------------------------------------------------------------------------------------

    set_graph_visual = _delegate_to("artists", Artists.set_graph_visual)
    set_obstacle_visual = _delegate_to("artists", Artists.set_obstacle_visual)
    set_agent_visual = _delegate_to("artists", Artists.set_agent_visual)
    set_sensor_visual = _delegate_to("artists", Artists.set_sensor_visual)
    set_values = _delegate_to("artists", Artists.set_values)
    add_artist = _delegate_to("artists", Artists.add_artist)
    remove_artist = _delegate_to("artists", Artists.remove_artist)

    # -- pictures --------------------------------------------------------------------------------------------

    save = _delegate_to("pictures", Pictures.save)
    picture = _delegate_to("pictures", Pictures.picture)
    frame = _delegate_to("pictures", Pictures.frame)
    film = _delegate_to("pictures", Pictures.film)

    @lift_decide_phase
    def draw_commands(self, share: float = 1.0) -> DrawCommands:
        """Return the present state as draw commands, after a share of the agents' last moves from 0.0 to 1.0.

        Unless the graph was declared, the default scene is drawn as far as nothing else was. A drawer that raises is
        logged, and the others draw on.

        Raises:
            ContextTerminated: the context has ended.
        """
        return ArtistGroup(self.ctx, self.artists.list_shown()).draw_artists(share)

    # -- where pictures look ---------------------------------------------------------------------------------

    @refuse_while_deciding
    def look_at(self, x: float, y: float, width: float) -> None:
        """Show `width` world units around (x, y) in frames and films, instead of everything.

        Raises:
            BadType, BadValue: not finite numbers, or a width that is not positive.
        """
        self.viewpoint.look_at(x, y, width)

    @refuse_while_deciding
    def look_at_all(self) -> None:
        """Show everything that is drawn in frames and films."""
        self.viewpoint.look_at_all()

    @refuse_while_deciding
    def follow(self, agent_name: str, width: float) -> None:
        """Keep an agent in the center of `width` world units in pictures, frames and films, until another view is set.

        After the agent is deleted, the view stays at its last position.

        Raises:
            UnknownName (KeyError): there is no such agent.
            BadType, BadValue: a width that is no positive number.
        """
        self.look_at(*self.drawing.position_of(agent_name), width)
        self.viewpoint.follow(agent_name)

    def get_viewport(self) -> tuple[float, float, float, float, float] | None:
        """Return None: nothing is shown."""
        return None

    # -- turns -----------------------------------------------------------------------------------------------

    @property
    def is_closing(self) -> bool:
        """Return False, because there is no window to close."""
        return False

    def simulate(self) -> None:
        """End the turn: call the listeners, and add it to the films that are being made."""
        # NOTE: games without pictures pay for this in every turn, too (benchmarks: the loop, turns).
        if self._phase.agent is not None:
            self._phase.refuse_look("call ctx.visual.simulate")
        if self._after_turn or self.artists.drawings.commands or self.pictures._films:
            with delay_interrupts(at_most_once=True):
                self._end_turn()
        else:
            self.drawing.turns.end_turn()

    def _end_turn(self) -> None:
        """End a turn that is recorded, drawn or heard of by listeners."""
        try:
            self.drawing.turns.end_turn()
            if self.artists.drawings.commands:
                self.artists.end_turn()
        finally:  # the turn is counted: a recording has it in any case
            _call_each(iter(self._after_turn))
        if self.pictures._films:
            self.pictures.add_turn()

    @leave_last_turn
    def quiet_turns(self) -> PastTurns | None:
        """Return the turns that trails show; None if more than that happens at the end of a turn."""
        is_quiet = not (self._after_turn or self.artists.drawings.commands or self.pictures.films)
        return self.drawing.turns if is_quiet and type(self).simulate is PictureEngine.simulate else None

    def update(self) -> None:
        """Do nothing, because there is no window."""

    def stay_open(self) -> None:
        """Do nothing, because there is no window."""

    def human_input(self, agent_name: str, state: dict[str, Any]) -> int | tuple[float, float, float]:  # noqa: ARG002 - there is no window to ask in
        """Return the agent's own node, or no movement for an agent that flies."""
        position: int | tuple[float, ...] = state["curr_pos"]
        return (0.0, 0.0, 0.0) if isinstance(position, tuple) else position

    @refuse_while_deciding
    def terminate(self) -> None:
        """Finish open films, and clear the stored positions of agents."""
        self.pictures.finish_films()
        self.drawing.turns.forget()


class NoEngine(PictureEngine):
    """Accepts all calls of an engine with a window, and shows nothing."""

    def __init__(self, ctx: IContext, *, simulation_time_constant: float = _TURN_SECONDS, **kwargs: object) -> None:
        super().__init__(ctx, simulation_time_constant=simulation_time_constant)
        _warn_of_fog(ctx, kwargs)


class OffscreenEngine(PictureEngine):
    """Films the turns of a context without a display; `frame`, `save` and `film` work as everywhere.

    Args:
        ctx: the context.
        width: pixels, of the film and of frames.
        height: pixels.
        video: the file of the film, `.mp4` or `.gif`; None films nothing.
        fps: frames per second.
        frames_per_turn: default: so many that a turn takes `simulation_time_constant` seconds, or else 5.
        simulation_time_constant: seconds per turn.
        title: a line above the film.
        note: small print in its lower right corner.
        kwargs: options of other engines are no error.

    Raises:
        BadValue, BadType: see `film`.
        MissingExtra (ImportError): pygame, or what writes the film, is not installed.
    """

    def __init__(  # noqa: PLR0913 - the options of `vis_kwargs`
        self,
        ctx: IContext,
        *,
        width: int = 1280,
        height: int = 720,
        video: str | os.PathLike[str] | None = None,
        fps: float = 30,
        frames_per_turn: int | None = None,
        simulation_time_constant: float | None = None,
        title: str = "",
        note: str = "",
        **kwargs: object,
    ) -> None:
        seconds = _TURN_SECONDS if simulation_time_constant is None else simulation_time_constant
        super().__init__(ctx, simulation_time_constant=seconds)
        from gamms.visual.backends.pygame_backend import load

        load()
        self.pictures.width, self.pictures.height = check_size(width, height)
        for sentence in explain_misspelled(kwargs, _OFFSCREEN_OPTIONS):
            ctx.logger.warning("vis_kwargs: %s", sentence)
        _warn_of_fog(ctx, kwargs)
        if video is not None:
            if simulation_time_constant is not None and frames_per_turn is None:
                frames_per_turn = max(1, round(self.turn_seconds * as_float(fps, "fps")))
            pictures = self.pictures
            pictures.new_film(video, fps, pictures.width, pictures.height, frames_per_turn, title=title, note=note)
            atexit.register(self.terminate)  # a program that does not end its context keeps its film, too

    def terminate(self) -> None:
        """End the films that are being made."""
        atexit.unregister(self.terminate)
        super().terminate()

    def get_viewport(self) -> tuple[float, float, float, float, float] | None:
        """Return `(left, right, low end, high end, pixels per unit)` after `look_at`; None sees everything."""
        if self.viewpoint.look is None:
            return None
        camera = self.viewpoint.look.make_camera(self.pictures.width, self.pictures.height)
        right = camera.left + camera.width / camera.scale
        low = camera.top - camera.height / camera.scale
        return camera.left, right, low, camera.top, camera.scale


def _warn_of_fog(ctx: IContext, options: Mapping[str, object]) -> None:
    """Log that pictures show everything, if an option asks for the view of a team, which only windows have."""
    if isinstance(options.get("fog"), str):
        ctx.logger.warning(
            "vis_kwargs: fog= works in windows only. These pictures show everything; gamms render has --fog."
        )


def _call_each(listeners: Iterator[Callable[[], object]]) -> None:
    """Call all listeners, also the others after an error of one."""
    for listener in listeners:
        try:
            listener()
        except BaseException:
            _call_each(listeners)
            raise
