"""Pictures and films: from the drawings of artists to files."""

import os
from base64 import b64encode
from collections.abc import Mapping
from contextlib import AbstractContextManager, ExitStack, suppress
from importlib.util import find_spec
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple, Self
from weakref import WeakValueDictionary

import numpy as np

from gamms.arguments import as_float, as_int, as_path, as_target
from gamms.errors import BadValue, Duplicate, MissingExtra, UnknownName
from gamms.folders import add_path_to_errors, make_place_beside
from gamms.ir.draw import DrawCommands
from gamms.knowledge.sides import Side
from gamms.limits import refuse_above
from gamms.typing import IArtist, IContext, PictureOptions
from gamms.visual.artist import ArtistGroup
from gamms.visual.artists import Artists
from gamms.visual.backends import FILMS, FORMATS, Backend, FilmWriter
from gamms.visual.backends.pygame_backend import Canvas
from gamms.visual.backends.raster import Painting
from gamms.visual.camera import CSS_DPI, NO_MARGINS, Box, Camera, Margins, Point, Viewpoint, frame_drawings, spill
from gamms.visual.captions import CAPTION_SECONDS, CaptionBar, Captions, ResultCard, end_card
from gamms.visual.default_scene import reach_of_views
from gamms.visual.drawers.marks import MARK_PX
from gamms.visual.drawing import Drawing, join_drawings, magnify
from gamms.visual.labels import Labels
from gamms.visual.legend import Block, grow_blocks, list_blocks
from gamms.visual.page import Page, PageStyle, compute_page_size, make_style
from gamms.visual.scene import Scene, make_whole_budget

# of a picture that looks at a part of the map
_DEFAULT_PX = 1280
_DEFAULT_RATIO = 16 / 9
_LONGEST_PX = 65_535  # the maximum of GIF
_FINEST_DPI = 10_000.0
# Bytes of memory per pixel, measured.
_PICTURE_BYTES = 20  # the canvas, its copies and the file
_FILM_BYTES = {".gif": 48, ".mp4": 100}  # and memory of an encoder


Asked = tuple[int | None, int | None]
"""A width and a height in pixels; None: as the map needs."""


class PictureTarget(NamedTuple):
    """The requested size of a picture, and the backend that paints it."""

    asked: Asked
    dpi: float
    backend: Backend


def check_sheet(name: str | os.PathLike[str], width: int | None, height: int | None, dpi: float) -> PictureTarget:
    """Check everything that can be checked before drawing; the suffix of a name, or a mere suffix, is the format.

    Raises:
        BadValue: a size or dpi that is not positive or too large, or a format that cannot be written.
    """
    path = as_path(name, "path")
    asked = check_sides(width, height)
    if not 0.0 < (dpi := as_float(dpi, "dpi")) <= _FINEST_DPI:
        raise BadValue(f"A picture needs between 0 and {_FINEST_DPI:g} pixels per inch, not dpi={dpi:g}.")
    return PictureTarget(asked, dpi, _find_backend(path))


def check_sides(width: int | None, height: int | None, bytes_per_pixel: int = _PICTURE_BYTES) -> Asked:
    """Check a width and a height in pixels; either may be None.

    Raises:
        BadValue: one is not positive, or too large.
        TooLarge (BadValue): it would take more memory than is allowed.
    """
    across, up = check_size(1 if width is None else width, 1 if height is None else height, bytes_per_pixel)
    return None if width is None else across, None if height is None else up


def check_size(width: int, height: int, bytes_per_pixel: int = _PICTURE_BYTES) -> tuple[int, int]:
    """Check a width and height in pixels.

    Raises:
        BadValue: one is not positive, or too large.
        TooLarge (BadValue): it would take more memory than is allowed.
    """
    width = as_int(width, "The width of a picture")
    height = as_int(height, "The height of a picture")
    if width <= 0 or height <= 0:
        raise BadValue(f"A picture needs a positive width and height, not {width} x {height}.")
    if max(width, height) > _LONGEST_PX:
        raise BadValue(f"A picture has at most {_LONGEST_PX} pixels at each side, not {width} x {height}.")
    refuse_above(bytes_per_pixel * width * height, f"A picture of {width} x {height} pixels")
    return width, height


def _find_backend(path: Path) -> Backend:
    try:
        return FORMATS[(path.suffix or path.name).lower()]
    except UnknownName:
        known = ", ".join(FORMATS)
        raise BadValue(
            f"A picture cannot be saved as {path.suffix or path.name!r}: use {known}. For a film use "
            "ctx.visual.film(), or gamms.rendering.render with a recording; for a page, recording.save."
        ) from None


def paint_picture(source: "FrameSource", sheet: PictureTarget, style: PageStyle) -> bytes:
    """Return a picture of the present state, with everything around the map, as the bytes of a file."""
    viewpoint = source.drawing.viewpoint
    fine = sheet.dpi / CSS_DPI  # so that lines, letters and marks are as large on paper whatever the dpi
    artists, commands, blocks = source.list_drawn(style)
    box = frame_drawings(commands)
    reach = spill(commands, box)
    width, height = check_size(*_compute_sides(sheet.asked, box, blocks, viewpoint, style, fine, reach))
    page = Page(width, height, blocks, style, fine, reach)
    corner: Point | None = None
    camera = page.find_camera(viewpoint)
    if camera is None:
        camera, corner = page.fit(*box)
    bar = Captions(source.ctx, source.drawing).make_captions(source.side)
    around = page.draw_parts(camera, corner, source.ctx, artists, Labels(), bar)
    commands = magnify(join_drawings(commands, around), fine)
    return sheet.backend(commands, camera, title=style.title, background=style.background, dpi=sheet.dpi)


def _compute_sides(
    asked: Asked,
    box: Box,
    blocks: tuple[Block, ...],
    viewpoint: Viewpoint,
    style: PageStyle,
    fine: float = 1.0,
    reach: Margins = NO_MARGINS,
) -> tuple[int, int]:
    """Return how large a page is; one that looks at a part of the map is 16 by 9 as far as nothing is asked."""
    width, height = asked
    if viewpoint.look is None:
        return compute_page_size(box, asked, blocks, style, fine, reach)
    width = width or round(height * _DEFAULT_RATIO if height else _DEFAULT_PX * fine)
    return width, height or round(width / _DEFAULT_RATIO)


FRAMES_PER_TURN = 5  # a sixth of a second
# the display times of the last frame and of the result card
_HELD_SECONDS = 1.0
_CARD_SECONDS = 2.5
_MOST_SHOWN = 20 << 20  # bytes of a film that a notebook keeps
_FASTEST = 240.0  # frames per second
_LONGEST_MP4_PX = 16_384
_being_made: WeakValueDictionary[Path, "Film"] = WeakValueDictionary()


class FilmPlan(NamedTuple):
    """The checked options of a film."""

    path: Path
    fps: float
    asked: Asked
    frames_per_turn: int


def check_film_plan(
    path: str | os.PathLike[str],
    fps: float,
    width: int | None,
    height: int | None,
    frames_per_turn: int | None,
) -> FilmPlan:
    """Check everything that can be checked before the first frame.

    Raises:
        BadValue: an unknown format, or a bad number.
        MissingFolder: the folder is not there.
    """
    path = as_target(path)
    suffix = path.suffix.lower()
    asked = check_sides(width, height, _FILM_BYTES.get(suffix, _FILM_BYTES[".gif"]))
    if not 0.0 < (fps := as_float(fps, "fps")) <= _FASTEST:
        raise BadValue(f"A film needs between 0 and {_FASTEST:g} frames per second, not fps={fps:g}.")
    frames = FRAMES_PER_TURN if frames_per_turn is None else as_int(frames_per_turn, "frames_per_turn")
    if frames < 1:
        raise BadValue(f"A turn needs at least one frame, not frames_per_turn={frames}.")
    if suffix not in FILMS:
        known = ", ".join(FILMS)
        raise BadValue(f"Cannot write a film as {path.suffix or path.name!r}; there are: {known}.")
    if suffix == ".mp4" and find_spec("av") is None:  # before a frame asks for the extra of pictures alone
        raise MissingExtra("Writing an MP4 film", "video")
    if suffix == ".mp4" and max(width or 0, height or 0) > _LONGEST_MP4_PX:
        raise BadValue(f"An MP4 has at most {_LONGEST_MP4_PX} pixels at each side, not {width} x {height}.")
    return FilmPlan(path, fps, asked, frames)


class FrameSource(NamedTuple):
    """The parts of an engine that frames are made from."""

    ctx: IContext
    drawing: Drawing
    artists: Artists

    @property
    def side(self) -> Side | None:
        """The side whose knowledge is shown; None: everything is shown."""
        return None if self.artists.fog is None else self.artists.fog.side

    def list_drawn(self, style: PageStyle) -> tuple[dict[str, IArtist], DrawCommands, tuple[Block, ...]]:
        """Return the artists that a page shows, their drawings, and the blocks of its legend."""
        artists = self.artists.list_shown(style.trails, sensors=style.sensors)
        return artists, ArtistGroup(self.ctx, artists).draw_artists(), list_blocks(self.ctx, artists)


class Frames:
    """Paints the state of a context at any time between two turns, always through the same camera.

    Args:
        source: the parts of the engine.
        asked: width and height, pixels.
        options: the options of the page.
        scene: cached drawings of earlier frames.
        is_even: whether sides are rounded up to even numbers.
        is_film: whether later turns follow, which need room for marks and for fields of view.

    Attributes:
        width, height: pixels.
        canvas: the frame that was painted last.
        captions: what happened in the last turns.
    """

    def __init__(
        self,
        source: FrameSource,
        asked: Asked,
        options: PictureOptions,
        scene: Scene | None = None,
        *,
        is_even: bool = False,
        is_film: bool = False,
    ) -> None:
        self.ctx = source.ctx
        self.scene = scene or Scene(source.ctx, self._make_world_key)
        self._is_film = is_film
        self._source = source
        self._viewpoint = source.drawing.viewpoint
        self._options = options
        self._style = make_style(self.ctx, **options)
        self._labels = Labels()
        width, height = asked
        if width is None or height is None or self._style.is_tight:
            with self._apply_theme():
                artists, commands, blocks = source.list_drawn(self._style)
            box = frame_drawings(commands)
            reach = self._reach(spill(commands, box))
            box = self._enlarge_box(box, artists)
            width, height = _compute_sides(asked, box, blocks, self._viewpoint, self._style, reach=reach)
        film_bytes = _FILM_BYTES[".mp4" if is_even else ".gif"]
        known = check_size(width, height, film_bytes if is_film else _PICTURE_BYTES)
        self.width, self.height = (side + side % 2 * is_even for side in known)
        self.canvas = Canvas(self.width, self.height, paper=self._style.background[:3])
        self._fitted: tuple[Camera, Point] | None = None
        self._artists: dict[str, IArtist] | None = None
        self._is_new_turn = True
        self._blocks: tuple[Block, ...] = ()
        self._page = Page(self.width, self.height, (), self._style)
        self.captions = Captions(self.ctx, source.drawing)
        self._caption_bar = CaptionBar(0, "", ())
        self._card: ResultCard | None = None
        self._camera: Camera | None = None  # of the last frame

    def begin_turn(self) -> None:
        """Look up which artists draw in this turn."""
        style = self._style if isinstance(self._style.labels, frozenset) else make_style(self.ctx, **self._options)
        with self._apply_theme():
            self._artists = self._source.artists.list_shown(style.trails, sensors=style.sensors)
            self._is_new_turn = True
            blocks = grow_blocks(self._blocks, list_blocks(self.ctx, self._artists))
        if (blocks, style) != (self._blocks, self._style):
            self._blocks = blocks
            self._style = style
            self._page = Page(self.width, self.height, blocks, style, spill=self._page.spill)
        if style.has_captions:
            with self._apply_theme():
                self._caption_bar = self.captions.make_captions(self._source.side)
                self._card = end_card(self.ctx, self._caption_bar.turn)

    def paint_frame(self, share: float) -> Canvas:
        """Return the picture after a share of the agents' last moves; it is painted over by the next one."""
        if self._artists is None:
            self.begin_turn()
        self._draw(share)
        camera, corner = self._compute_view(share)
        budget = None if self._viewpoint.followed is None else make_whole_budget()  # so that streets are shifted
        self.scene.paint(self.canvas, camera, self._style.background, budget)
        with self._apply_theme():
            artists = self._artists or {}
            around = self._page.draw_parts(camera, corner, self.ctx, artists, self._labels, self._caption_bar)
        Painting(around).paint(self.canvas, camera)
        self._camera = camera
        return self.canvas

    def add_card(self) -> bool:
        """Paint how the game ended over the last frame; False where it has not, or nothing is said in the film."""
        if self._card is None or self._camera is None or not self._page.has_captions:
            return False
        Painting(self._page.draw_card(self._camera, self._card)).paint(self.canvas, self._camera)
        return True

    def _reach(self, now: Margins) -> Margins:
        """Return the room for the signs that are at the sides of the map now, and below for marks that come later."""
        left, top, right, bottom = now
        later_px = MARK_PX if self._is_film and self.ctx.current_game is not None else 0.0
        return left, top, right, max(bottom, later_px)

    def _enlarge_box(self, box: Box, artists: Mapping[str, IArtist]) -> Box:
        """Return a box that holds this one, and in a film the fields of view of agents wherever they go on the map."""
        xy = self.ctx.graph.columns().xy
        if not self._is_film or len(xy) == 0:
            return box
        far = reach_of_views(self.ctx, artists)
        low, high = box
        return np.minimum(low, xy.min(axis=0) - far), np.maximum(high, xy.max(axis=0) + far)

    def _draw(self, share: float) -> None:
        with self._apply_theme():
            self.scene.draw(self._artists or {}, lambda group: group.draw_artists(share), is_new_turn=self._is_new_turn)
        self._is_new_turn = False

    def _apply_theme(self) -> AbstractContextManager[None]:
        return self._source.drawing.themed(self._style.theme)

    def _make_world_key(self) -> Any:
        """Return a key that changes with the graph, the obstacles or the theme."""
        return self._source.drawing.map_version(), self._style.theme

    def _compute_view(self, share: float) -> tuple[Camera, Point | None]:
        """Return the camera, and the corner of the map where it is in the picture as a whole."""
        pointed = self._page.find_camera(self._viewpoint, share)
        if pointed is not None:
            return pointed, None
        if self._fitted is None:
            box = self.scene.compute_box()
            self._page.spill = self._reach(self.scene.spill(box))
            self._fitted = self._page.fit(*self._enlarge_box(box, self._artists or {}))
        return self._fitted


class Film:
    """A film in progress. The complete file appears at the end; after an error no file is written."""

    def __init__(self, frames: Frames, plan: FilmPlan, open_films: "list[Film]") -> None:
        self.plan = plan
        self._frames = frames
        self._open = open_films
        frames.captions.turns = max(1, round(CAPTION_SECONDS * plan.fps / plan.frames_per_turn))
        self._place = plan.path.resolve()
        if self._place in _being_made:
            raise Duplicate("a film that is being made", str(plan.path))
        self._beside = ExitStack()
        self._part = self._beside.enter_context(make_place_beside(self._place))
        try:
            with add_path_to_errors(self.plan.path, self._part):
                self._writer: FilmWriter | None = FILMS[plan.path.suffix.lower()](
                    self._part, frames.width, frames.height, plan.fps
                )
        except BaseException:
            self._beside.close()
            raise
        _being_made[self._place] = self
        self.frames = 0

    def add_turn(self) -> None:
        """Add the turn that was just played.

        Raises:
            OSError: the file cannot be written; the film is given up then.
        """
        if self._writer is None:
            return
        try:
            self._frames.begin_turn()
            steps = self.plan.frames_per_turn
            first = 1
            if self.frames == 0 and steps > 1:  # a film begins with the start
                first = 0
                steps -= 1
            for number in range(first, steps + 1):
                with add_path_to_errors(self.plan.path, self._part):
                    self._writer.add(self._frames.paint_frame(number / steps))
                self.frames += 1
        except BaseException:
            self.discard()
            raise

    def finish(self) -> None:
        """Hold the last frame, show the result card, and move the film to its path; without turns, write no file."""
        if self._writer is None:
            return
        writer = self._writer
        self._writer = None
        try:
            if self.frames:
                with add_path_to_errors(self.plan.path, self._part):
                    self._hold(writer, _HELD_SECONDS)
                    if self._frames.add_card():
                        self._hold(writer, _CARD_SECONDS)
                    writer.finish()
                    self._part.replace(self._place)
            else:
                writer.discard()
                self._frames.ctx.logger.warning("The film %r has no turn: it is not written.", self.plan.path.name)
        finally:
            self._close()

    def _hold(self, writer: FilmWriter, seconds: float) -> None:
        """Repeat the last frame for a duration."""
        for _ in range(round(seconds * self.plan.fps)):
            writer.add(self._frames.canvas)
            self.frames += 1

    def discard(self) -> None:
        """Give the film up: nothing is written."""
        if self._writer is not None:
            writer = self._writer
            self._writer = None
            try:
                with suppress(OSError):  # errors of pending writes when the disk is full
                    writer.discard()
            finally:
                self._close()

    def _close(self) -> None:
        self._beside.close()
        _being_made.pop(self._place, None)
        if self in self._open:
            self._open.remove(self)

    def __repr__(self) -> str:
        made = "" if self._writer is None else ", being made"
        return f"Film({str(self.plan.path)!r}, {self.frames / self.plan.fps:.1f} s{made})"

    def _repr_html_(self) -> str | None:
        """Return the film as an element of a page, for notebooks; None while it is made, and if it is too large."""
        try:
            content = b"" if self._writer is not None else self._place.read_bytes()
        except OSError:  # it was moved, or had no turn
            content = b""
        if not 0 < len(content) <= _MOST_SHOWN:
            return None
        data = b64encode(content).decode()
        if self._place.suffix.lower() == ".gif":
            return f'<img style="max-width:100%" alt="the film" src="data:image/gif;base64,{data}"/>'
        return f'<video style="max-width:100%" controls loop src="data:video/mp4;base64,{data}"></video>'

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None:
            self.finish()
        else:
            self.discard()
