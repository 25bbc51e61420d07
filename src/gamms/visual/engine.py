"""What every visual engine can do: draw the present state as commands, pictures, frames and films."""

import os
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from gamms.arguments import as_float
from gamms.deciding import Protected, outside_of_deciding, refused_while_deciding
from gamms.errors import BadValue, ContextTerminated, GammsError
from gamms.ir.draw import DrawCommands
from gamms.typing import ColorType, IArtist, IContext
from gamms.visual.artist_group import ArtistGroup
from gamms.visual.camera import Camera, Follow, Look
from gamms.visual.color import PAPER
from gamms.visual.declarations import Declarations
from gamms.visual.layers import Layer

if TYPE_CHECKING:
    from gamms.visual.backends.coverage import ByteArray
    from gamms.visual.film import Film
    from gamms.visual.scene import Scene
    from gamms.visual.undeclared import Undeclared


class PictureEngine(Declarations):
    """The common part of engines with and without a window.

    Attributes:
        after_turn: called by `simulate`, in order.
        turn_seconds: how long a turn is shown; 1.0.0 calls it the simulation time constant.
        width, height: of a frame, pixels.
        look: where pictures look; None sees everything that is drawn.
        followed: whom they keep in the middle instead; None: nobody.
    """

    after_turn: Protected[list[Callable[[], None]]] = Protected()

    def __init__(self, ctx: IContext, *, simulation_time_constant: float = 2.0) -> None:
        super().__init__(ctx)
        self.after_turn = []
        self.turn_seconds = as_float(simulation_time_constant, "simulation_time_constant")
        self.width, self.height = 1280, 720
        self.look: Look | None = None
        self.followed: Follow | None = None
        self._undeclared: Undeclared | None = None
        self._films: list[Film] = []
        self._scene: Scene | None = None

    # -- turns -----------------------------------------------------------------------------------------------

    @refused_while_deciding
    def simulate(self) -> None:
        """Tell those who count turns that one is over, and add it to the films that are being made."""
        self.happenings.end_turn()
        for tell in self.after_turn:
            tell()
        if self._films and not self.ctx.is_terminated():
            self.motion.begin_turn()
            for film in tuple(self._films):
                film.add_turn()

    def update(self) -> None:
        """Do nothing: there is no window to draw a frame in."""

    def stay_open(self) -> None:
        """Do nothing: there is no window that somebody could close."""

    def human_input(self, agent_name: str, state: dict[str, Any]) -> int | tuple[float, float, float]:  # noqa: ARG002 - nobody to ask
        """Stay: the agent's own node, or no movement for an agent that flies."""
        position: int | tuple[float, ...] = state["curr_pos"]
        return (0.0, 0.0, 0.0) if isinstance(position, tuple) else position

    @refused_while_deciding
    def terminate(self) -> None:
        """Close the room: films that are being made end here."""
        for film in tuple(self._films):
            film.finish()

    # -- where pictures look ---------------------------------------------------------------------------------

    @refused_while_deciding
    def look_at(self, x: float, y: float, width: float) -> None:
        """Let frames and films show `width` world units around (x, y), instead of everything.

        Raises:
            BadType, BadValue: not finite numbers, or a width that is not positive.
        """
        x, y, width = as_float(x, "x"), as_float(y, "y"), as_float(width, "width")
        if width <= 0.0:
            raise BadValue(f"A view needs a positive width in world units, not {width:g}.")
        self.look, self.followed = Look(x, y, width), None

    @refused_while_deciding
    def look_at_all(self) -> None:
        """Let frames and films show everything that is drawn."""
        self.look = self.followed = None

    @refused_while_deciding
    def follow(self, agent_name: str, width: float) -> None:
        """Let pictures, frames and films keep an agent in the middle of `width` world units, until they look elsewhere.

        When there is no such agent any more, they stay where it was last.

        Raises:
            UnknownName (KeyError): there is no such agent.
            BadType, BadValue: a width that is no positive number.
        """
        self.look_at(*self.position_of(agent_name), width)
        self.followed = Follow(agent_name, float(width))

    @outside_of_deciding
    def pointed(self, width: int, height: int, share: float = 1.0) -> Camera | None:
        """The camera of a picture of so many pixels, after a share of the agents' last moves; None sees everything."""
        if self.followed is not None:
            try:
                x, y = self.position_of(self.followed.name, share)
            except GammsError:  # it is gone
                self.followed = None
            else:
                self.look = Look(x, y, self.followed.world_width)
                return self.followed.camera((x, y), width, height)
        return None if self.look is None else self.look.camera(width, height)

    @property
    def is_filming(self) -> bool:
        """Whether a film is being made."""
        return bool(self._films)

    def get_viewport(self) -> tuple[float, float, float, float, float] | None:
        """None: nothing is shown."""
        return None

    # -- pictures --------------------------------------------------------------------------------------------

    @outside_of_deciding
    def shown_artists(self) -> dict[str, IArtist]:
        """Who draws: the artists that were declared, or those of the default look.

        Raises:
            ContextTerminated: the context has ended.
        """
        if self.ctx.is_terminated():
            raise ContextTerminated("the state to draw")
        return self._with_marks(self._usual_artists() | self._artists)

    def _with_marks(self, artists: dict[str, IArtist]) -> dict[str, IArtist]:
        """Artists, and one that marks where those of their agents were that went out in the turn that is shown."""
        if not self.happenings.eliminated():
            return artists
        from gamms.visual.artist import Artist, looks_of
        from gamms.visual.drawers.tags import render_eliminated

        marks = Artist(self.ctx, render_eliminated, Layer.TAGS)
        marks.data = {"colors": {look.name: look.color for look in looks_of(artists)}}
        return {"eliminated": marks} | artists

    def _usual_artists(self) -> dict[str, IArtist]:
        """Who draws in pictures beside the artists that were declared or added."""
        if self._is_declared and not self._is_replayed:
            return {}
        if self._undeclared is None:
            from gamms.visual.undeclared import Undeclared

            self._undeclared = Undeclared(self.ctx)
        return self._undeclared_part(self._undeclared)

    def _undeclared_part(self, usual: "Undeclared") -> dict[str, IArtist]:
        """All of the default look where nothing was declared; in a replay of what was, what its rules drew."""
        if self._is_declared:
            return usual.of_rules() if self._is_replayed else {}
        return usual.artists()

    @outside_of_deciding
    def draw_commands(self, share: float = 1.0) -> DrawCommands:
        """Return the present state as draw commands, after a share of the agents' last moves from 0.0 to 1.0.

        Where no visual was declared, the graph and the agents are drawn in a default look. A drawer that
        raises is logged, and the others draw on.

        Raises:
            ContextTerminated: the context has ended.
        """
        return self._drawn(ArtistGroup(self.ctx, self.shown_artists()), share)

    def _drawn(self, group: ArtistGroup, share: float = 1.0) -> DrawCommands:
        """What artists draw after a share of the agents' last moves, from 0.0 to 1.0."""
        with self._collecting() as commands:
            group.draw(commands, share)
        return commands.freeze()

    @outside_of_deciding
    def save(
        self,
        path: str | os.PathLike[str],
        width: int = 1280,
        height: int = 720,
        *,
        title: str = "",
        note: str = "",
        background: ColorType = PAPER,
        dpi: float = 96.0,
    ) -> None:
        """Save a picture of the present state; the suffix of `path` names the format (`.svg`, `.png`).

        Args:
            path: an existing file is replaced.
            width: pixels.
            height: pixels.
            title: a line above the picture.
            note: small print in its lower right corner; the source of the map is added to it.
            background: the colour behind everything.
            dpi: pixels per inch: how large the picture is on paper.

        Raises:
            BadValue: a size or dpi that is not positive or too large, or a folder that does not exist.
            NotYet: a format that cannot be written.
            MissingExtra (ImportError): PNG needs pygame and Pillow, which are not installed.
            ContextTerminated: the context has ended.
        """
        from gamms.folders import write_whole
        from gamms.visual import picture

        file = picture.place(path)
        content = self.picture(file, width, height, title=title, note=note, background=background, dpi=dpi)
        write_whole(file, content)

    @outside_of_deciding
    def picture(
        self,
        format: str | os.PathLike[str],
        width: int = 1280,
        height: int = 720,
        *,
        title: str = "",
        note: str = "",
        background: ColorType = PAPER,
        dpi: float = 96.0,
    ) -> bytes:
        """A picture of the present state as bytes; `format` is `.svg`, `.png`, or a name that ends so. See `save`.

        Raises:
            BadValue: a size or dpi that is not positive, or too large.
            NotYet: a format that cannot be written.
            MissingExtra (ImportError): PNG needs pygame and Pillow, which are not installed.
            ContextTerminated: the context has ended.
        """
        from gamms.visual import picture
        from gamms.visual.legend import blocks_of

        sheet, artists = picture.sheet(format, width, height, dpi), self.shown_artists()
        commands, blocks = self._drawn(ArtistGroup(self.ctx, artists)), blocks_of(self.ctx, artists)
        camera, note = self.pointed(sheet.width, sheet.height), self.noted(note)
        return picture.painted(sheet, commands, blocks, camera, title=title, note=note, background=background)

    @outside_of_deciding
    def as_html(self) -> str:
        """The present state as an element of a page: a PNG, or an SVG where that cannot be made."""
        from gamms.visual import notebook

        return notebook.html(self)

    def noted(self, note: str) -> str:
        """The note, and the source of the map unless the note already names it."""
        from gamms.visual import picture

        return picture.with_attribution(note, getattr(self.ctx.graph, "attribution", None))

    @outside_of_deciding
    def frame(
        self,
        width: int | None = None,
        height: int | None = None,
        *,
        title: str = "",
        note: str = "",
        background: ColorType = PAPER,
    ) -> "ByteArray":
        """The present state as pixels: red, green and blue from 0 to 255, (height, width, 3); see `save`.

        The size is that of the engine, 1280 x 720 if it was given none.

        What STATIC artists drew is kept until the graph, the obstacles or their data change.

        Raises:
            BadValue: a size that is not positive, or too large.
            MissingExtra (ImportError): pygame is not installed.
            ContextTerminated: the context has ended.
        """
        from gamms.visual.film import Frames
        from gamms.visual.picture import size

        width, height = size(self.width if width is None else width, self.height if height is None else height)
        frames = Frames(self, width, height, title=title, note=note, background=background, scene=self._scene)
        self._scene = frames.scene
        return frames.at(1.0).pixels().copy()  # which may be written to

    # -- films -----------------------------------------------------------------------------------------------

    @refused_while_deciding
    def film(
        self,
        path: str | os.PathLike[str],
        fps: float = 30,
        width: int = 1280,
        height: int = 720,
        frames_per_turn: int | None = None,
        *,
        title: str = "",
        note: str = "",
        background: ColorType = PAPER,
    ) -> "Film":
        """Film the turns that are played inside a `with` block; the suffix of `path` names the format.

        Each `simulate()`, and so each turn of `ctx.game`, adds frames in which the agents glide to where they are
        now. Time is counted in frames, never by the clock. The film ends with the block or with the context.

        Args:
            path: `.mp4` or `.gif`; an existing file is replaced when the film has ended without an error.
            fps: frames per second.
            width: pixels; for MP4, odd sizes are rounded up.
            height: pixels.
            frames_per_turn: default: so many that a turn takes `simulation_time_constant` seconds.
            title: a line above the picture.
            note: small print in the lower right corner; the source of the map is added to it.
            background: the colour behind everything.

        Raises:
            BadValue: an unknown format, a bad number, a folder that does not exist, or a film that is being made there.
            MissingExtra (ImportError): a library is not installed.
            ContextTerminated: the context has ended.
        """
        if self.ctx.is_terminated():
            raise ContextTerminated("the state to film")
        return self._new_film(path, fps, width, height, frames_per_turn, title=title, note=note, background=background)

    def _new_film(
        self,
        path: str | os.PathLike[str],
        fps: float,
        width: int,
        height: int,
        frames_per_turn: int | None,
        *,
        title: str,
        note: str,
        background: ColorType = PAPER,
    ) -> "Film":
        from gamms.visual.film import Film, Frames, film_plan

        plan = film_plan(path, fps, width, height, frames_per_turn, self.turn_seconds)
        frames = Frames(self, plan.width, plan.height, title=title, note=note, background=background)
        film = Film(frames, plan, self._films)
        self._films.append(film)
        return film
