"""Pictures, frames and films of a context."""

import os
from base64 import b64encode
from typing import TYPE_CHECKING, Unpack

from gamms.arguments import as_target, spell_out_options
from gamms.deciding import Guarded, Protected, get_phase, lift_decide_phase, refuse_while_deciding
from gamms.errors import ContextTerminated, MissingExtra
from gamms.typing import IContext, PictureOptions
from gamms.visual.artists import Artists
from gamms.visual.drawing import Drawing

if TYPE_CHECKING:
    from gamms.visual.backends.pillow_backend import ByteArray
    from gamms.visual.files import Film
    from gamms.visual.scene import Scene

_NOTEBOOK_PX = 900, 600  # at most


class Pictures(Guarded):
    """Saves the drawings of a context as pictures, frames and films.

    Args:
        ctx: the context.
        drawing: the drawing primitives, and the view of pictures.
        artists: the artists.

    Attributes:
        films: films in progress.
        width, height: the size of a frame, pixels.
        turn_seconds: the display time of a turn in a window, seconds.
    """

    _called = "ctx.visual"

    films: Protected[list["Film"]] = Protected(list)
    _films: list["Film"]

    def __init__(self, ctx: IContext, drawing: Drawing, artists: Artists, turn_seconds: float) -> None:
        self._phase = get_phase(ctx)
        self._ctx = ctx
        self._drawing = drawing
        self._artists = artists
        self.films = []
        self.width = 1280
        self.height = 720
        self.turn_seconds = turn_seconds
        self._scene: Scene | None = None

    def add_turn(self) -> None:
        """Add the turn that was just played to the films that are being made."""
        if self._films and not self._ctx.is_terminated():
            self._drawing.motion.begin_turn()
            for film in tuple(self._films):
                film.add_turn()

    def finish_films(self) -> None:
        """End the films that are being made."""
        for film in tuple(self.films):
            film.finish()

    @lift_decide_phase
    @spell_out_options()
    def save(
        self,
        path: str | os.PathLike[str],
        width: int | None = None,
        height: int | None = None,
        *,
        dpi: float = 96.0,
        **options: Unpack[PictureOptions],
    ) -> None:
        """Save a picture of the present state; the suffix of `path` names the format (`.svg`, `.png`, `.pdf`).

        Args:
            path: an existing file is replaced.
            width: pixels; None: as the map needs.
            height: pixels; None: as the map needs.
            dpi: pixels per inch: how large the picture is on paper.
            options: see `PictureOptions`.

        Raises:
            BadValue: a size or dpi that is not positive or too large, or a folder that does not exist.
            NotYet: a format that cannot be written.
            MissingExtra (ImportError): PNG needs pygame and Pillow, which are not installed.
            ContextTerminated: the context has ended.
        """
        from gamms.folders import write_whole

        file = as_target(path)
        content = self.picture(file, width, height, dpi=dpi, **options)
        write_whole(file, content, through_links=True)

    @lift_decide_phase
    @spell_out_options()
    def picture(
        self,
        format: str | os.PathLike[str],
        width: int | None = None,
        height: int | None = None,
        *,
        dpi: float = 96.0,
        **options: Unpack[PictureOptions],
    ) -> bytes:
        """Return a picture of the present state as bytes.

        Args:
            format: `.svg`, `.png` or `.pdf`, or a file name that ends so.
            width: pixels; None: as the map needs.
            height: pixels; None: as the map needs.
            dpi: pixels per inch: how large the picture is on paper.
            options: see `PictureOptions`.

        Raises:
            BadValue: a size or dpi that is not positive, or too large.
            NotYet: a format that cannot be written.
            MissingExtra (ImportError): PNG needs pygame and Pillow, which are not installed.
            ContextTerminated: the context has ended.
        """
        from gamms.visual import files
        from gamms.visual.page import make_style

        sheet = files.check_sheet(format, width, height, dpi)
        style = make_style(self._ctx, **options)
        with self._drawing.themed(style.theme):
            return files.paint_picture(files.FrameSource(self._ctx, self._drawing, self._artists), sheet, style)

    @lift_decide_phase
    def as_png(self) -> bytes | None:
        """Return the current state as PNG bytes for a notebook; None if no library can make it."""
        try:
            return self.picture(".png", *_NOTEBOOK_PX, fit="tight")
        except MissingExtra:
            return None

    @lift_decide_phase
    def as_html(self) -> str:
        """Return the present state as an element of a page: a PNG, or an SVG where that cannot be made."""
        kind = "png"
        content = self.as_png()
        if content is None:
            kind = "svg+xml"
            content = self.picture(".svg", *_NOTEBOOK_PX, fit="tight")
        source = f"data:image/{kind};base64,{b64encode(content).decode()}"
        return f'<img alt="the present state" src="{source}"/>'

    @lift_decide_phase
    @spell_out_options()
    def frame(
        self,
        width: int | None = None,
        height: int | None = None,
        **options: Unpack[PictureOptions],
    ) -> "ByteArray":
        """Return the present state as pixels: red, green and blue from 0 to 255, (height, width, 3).

        Drawings of STATIC artists are cached until the graph, the obstacles or their data change.

        Args:
            width: pixels; None: the width of the engine, 1280 unless it was given another one.
            height: pixels; None: the height of the engine, 720 unless it was given another one.
            options: see `PictureOptions`.

        Raises:
            BadValue: a size that is not positive, or too large.
            MissingExtra (ImportError): pygame or Pillow is not installed.
            ContextTerminated: the context has ended.
        """
        from gamms.visual.files import Frames, FrameSource, check_size

        width, height = check_size(self.width if width is None else width, self.height if height is None else height)
        frames = Frames(FrameSource(self._ctx, self._drawing, self._artists), (width, height), options, self._scene)
        self._scene = frames.scene
        return frames.paint_frame(1.0).pixels().copy()  # which may be written to

    @refuse_while_deciding
    @spell_out_options()
    def film(
        self,
        path: str | os.PathLike[str],
        fps: float = 30,
        width: int | None = None,
        height: int | None = None,
        frames_per_turn: int | None = None,
        **options: Unpack[PictureOptions],
    ) -> "Film":
        """Film the turns that are played in a `with` block; the suffix of `path` is the format.

        Each `simulate()`, and so each turn of `ctx.game`, adds frames in which agents glide to their current positions.
        Time is measured in frames, not by the clock. The film ends with the block or with the context.

        Args:
            path: `.mp4` or `.gif`; an existing file is replaced when the film has ended without an error.
            fps: frames per second.
            width: pixels; None: as the map needs that is there now. For MP4, odd sizes are rounded up.
            height: pixels; None: as the map needs.
            frames_per_turn: 5 by default. The last frame is held, and then a card says how the game ended.
            options: see `PictureOptions`.

        Raises:
            BadValue: an unknown format, a bad number, a folder that does not exist, or a film that is being made there.
            MissingExtra (ImportError): a library is not installed.
            ContextTerminated: the context has ended.
        """
        if self._ctx.is_terminated():
            raise ContextTerminated("the state to film")
        return self.new_film(path, fps, width, height, frames_per_turn, **options)

    def new_film(
        self,
        path: str | os.PathLike[str],
        fps: float,
        width: int | None,
        height: int | None,
        frames_per_turn: int | None,
        **options: Unpack[PictureOptions],
    ) -> "Film":
        """Begin a film; see `film`."""
        from gamms.visual.files import Film, Frames, FrameSource, check_film_plan

        plan = check_film_plan(path, fps, width, height, frames_per_turn)
        source = FrameSource(self._ctx, self._drawing, self._artists)
        options.setdefault("captions", True)
        frames = Frames(source, plan.asked, options, is_even=plan.path.suffix.lower() == ".mp4", is_film=True)
        film = Film(frames, plan, self.films)
        self.films.append(film)
        return film
