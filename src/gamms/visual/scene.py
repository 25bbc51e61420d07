"""A scene: what is drawn, kept as long as it stays the same, and painted in layers.

From back to front a scene is a list of parts. STATIC artists are drawn again only when the graph, the obstacles or
what was declared has changed; each of their parts is painted once per camera. Parts at the back that are the same as
in the frame before are shown as they were painted then.
"""

from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from itertools import groupby, takewhile
from typing import Any
from zlib import crc32

import numpy as np

from gamms.ir.draw import DrawCommands
from gamms.ir.graph import FloatArray
from gamms.typing import ArtistType, IArtist, IContext
from gamms.typing.artist import Drawer
from gamms.visual.artist import Artist
from gamms.visual.artist_group import ArtistGroup, in_painting_order
from gamms.visual.backends.pygame import Canvas, load, on_glass
from gamms.visual.backends.raster import Painting
from gamms.visual.camera import Camera, bounds, fit_box
from gamms.visual.color import Rgba

_BORDER = 4  # one fourth of the view on every side


class Plate:
    """A painting on a background, or on glass, through which one sees what is on the canvas."""

    def __init__(self) -> None:
        self._painting: Painting | None = None
        self._background: Rgba | None = None
        self._camera: Camera | None = None
        self._surface: Any = None

    def show(
        self, painting: Painting, canvas: Canvas, camera: Camera, background: Rgba | None, *, is_moving: bool
    ) -> None:
        """Show the painting as the camera sees it; no background is glass."""
        is_mine = painting is self._painting and background == self._background
        if not is_mine or not self._serves(camera, is_moving=is_moving):
            self._painting, self._background = painting, background
            self._camera = _larger(camera) if is_moving else camera
            self._surface = _painted(painting, self._camera, background)
        self._blit(canvas, camera, load().BLEND_PREMULTIPLIED if background is None else 0)

    def _serves(self, camera: Camera, *, is_moving: bool) -> bool:
        """Whether what was painted shows all that the camera sees; while it moves, up to half a pixel beside."""
        mine = self._camera
        if mine is None or camera.scale != mine.scale:
            return False
        x, y = _shift(mine, camera)
        is_whole = is_moving or (x == round(x) and y == round(y))
        is_held = min(x, y) >= 0.0 and x + camera.width <= mine.width and y + camera.height <= mine.height
        return is_whole and is_held

    def _blit(self, canvas: Canvas, camera: Camera, flags: int) -> None:
        if self._camera is not None:
            x, y = _shift(self._camera, camera)
            canvas.paste(self._surface, (round(x), round(y), camera.width, camera.height), flags)


def _painted(painting: Painting, camera: Camera, background: Rgba | None) -> Any:
    if background is None:
        return on_glass(lambda color: _painted(painting, camera, color))
    canvas = Canvas(camera.width, camera.height)
    canvas.fill(background)
    painting.paint(canvas, camera)
    return canvas.surface


def _larger(camera: Camera) -> Camera:
    across, down = camera.width // _BORDER, camera.height // _BORDER
    return Camera(
        camera.width + 2 * across,
        camera.height + 2 * down,
        camera.left - across / camera.scale,
        camera.top + down / camera.scale,
        camera.scale,
    )


def _shift(mine: Camera, camera: Camera) -> tuple[float, float]:
    """How many pixels right of and below the corner of `mine` the corner of a camera of the same scale lies."""
    return (camera.left - mine.left) * mine.scale, (mine.top - camera.top) * mine.scale


_FEW = 400  # points that are repainted faster than shown from a cache
_STAGES = 2

Draw = Callable[[ArtistGroup], DrawCommands]
_Groups = list[tuple["_Pace", dict[str, IArtist], ArtistGroup]]


class Part:
    """Artists that follow each other, as commands that are ready to be painted."""

    def __init__(self, group: ArtistGroup, commands: DrawCommands, key: Any = None) -> None:
        self.artists = group.artists
        self.painting, self.key = Painting(commands), key
        self.is_static = key is not None
        self.lasts = self.is_static  # at least as long as this turn
        self.outlasts_turns = self.is_static  # was there in the turn before, too
        self.is_much = len(commands.points) > _FEW
        self._plate = Plate() if self.is_much else None

    @property
    def box(self) -> tuple[FloatArray, FloatArray] | None:
        """Lower left and upper right corner; None where nothing is drawn."""
        commands = self.painting.commands
        return bounds(commands) if len(commands) else None

    def paint(self, canvas: Canvas, camera: Camera) -> None:
        """Paint what the camera sees of it."""
        self.painting.paint(canvas, camera)

    def show(self, canvas: Canvas, camera: Camera, behind: Rgba | None, *, is_moving: bool) -> None:
        """Paint it, from a plate where that is faster; `behind` is the colour behind it, if nothing else is there."""
        if self._plate is not None and (self.is_static or (is_moving and self.outlasts_turns)):
            self._plate.show(self.painting, canvas, camera, behind, is_moving=is_moving)
        else:
            self.paint(canvas, camera)

    def shows_what(self, commands: DrawCommands) -> bool:
        """Whether these commands would give the same part."""
        mine = self.painting.commands
        if not np.array_equal(mine.points, commands.points) or mine.text != commands.text:  # what differs most often
            return False
        columns = ("kind", "layer", "space", "size", "width", "angle", "color", "offsets")
        return all(np.array_equal(getattr(mine, name), getattr(commands, name)) for name in columns)


_Still = tuple[list[Part], Camera, Rgba, Any]  # parts, camera, background, and the surface


class Scene:
    """The parts of the present state, and the surfaces that save painting them.

    Args:
        ctx: the context.
        world: what else than its data a STATIC artist's drawing depends on, such as the revision of the graph.
    """

    def __init__(self, ctx: IContext, world: Callable[[], Any]) -> None:
        self._ctx, self._world = ctx, world
        self._grouped: tuple[Mapping[str, IArtist], int, _Groups] | None = None  # artists, their edits, and groups
        self._frames, self._expects_more = 0, False  # of this turn; whether there will be more, as there were before
        self._parts: list[Part] = []
        self._before: list[Part] = []
        self._stages: list[_Still] = []  # what was painted of the parts at the back, the fewest first

    def draw(self, artists: Mapping[str, IArtist], draw: Draw, *, is_new_turn: bool = True) -> None:
        """Update to the present state: `draw` lets artists draw, and returns their commands.

        Within a turn, static artists, and those whose drawer has a true attribute `once_a_turn`, are not asked again.
        """
        if is_new_turn:
            self._expects_more, self._frames = self._frames > 1, 0
        self._frames += 1
        world, known = self._world(), {part.key: part for part in self._parts if part.is_static}
        asked = {} if is_new_turn else {part.artists: part for part in self._parts}
        self._before, self._parts = self._parts, []
        for pace, members, group in self._groups(artists, is_new_turn=is_new_turn):
            if pace is not _Pace.FRAME and group.artists in asked:
                part = asked[group.artists]
            elif pace is _Pace.STATIC:
                key = (world, *(_key_of(name, artist) for name, artist in members.items()))
                part = known.get(key) or Part(group, draw(group), key)
            else:
                part = self._moving_part(group, draw)
            part.lasts = pace is not _Pace.FRAME
            self._parts.append(part)

    def _groups(self, artists: Mapping[str, IArtist], *, is_new_turn: bool) -> _Groups:
        """Artists in painting order, those together that make one part; within a turn they are sorted once."""
        if self._grouped is not None and not is_new_turn and self._grouped[:2] == (artists, Artist.edits):
            return self._grouped[2]
        by_likeness = groupby(in_painting_order(artists), _likeness)
        parts = [(pace, dict(members)) for (pace, *_), members in by_likeness]
        groups = [(pace, members, ArtistGroup(self._ctx, members)) for pace, members in parts]
        are_counted = all(isinstance(artist, Artist) for artist in artists.values())  # others may change unseen
        self._grouped = (artists, Artist.edits, groups) if are_counted else None
        return groups

    def _moving_part(self, group: ArtistGroup, draw: Draw) -> Part:
        """The part of the frame before, where it would look the same."""
        commands = draw(group)
        for part in self._before:
            is_taken = any(
                part is other for other in self._parts
            )  # by artists that draw the same
            if not part.is_static and not is_taken and part.shows_what(commands):
                part.artists = group.artists
                part.outlasts_turns |= self._frames == 1
                return part
        return Part(group, commands)

    def fit(self, width: int, height: int, header: float, aside: float = 0.0) -> Camera:
        """A camera that sees everything below a header and left of a legend of so many pixels."""
        boxes = [box for part in self._parts if (box := part.box) is not None]
        low = np.min([box[0] for box in boxes], axis=0) if boxes else np.zeros(2)
        high = np.max([box[1] for box in boxes], axis=0) if boxes else np.zeros(2)
        return fit_box(low, high, width, height, header, aside)

    def paint(self, canvas: Canvas, camera: Camera, background: Rgba, *, is_moving: bool = False) -> None:
        """Paint all of it.

        Args:
            canvas: what was there is painted over.
            camera: as large as the canvas.
            background: the colour behind everything.
            is_moving: the camera is on its way, so that what does not change may be shifted by half a pixel.
        """
        same = 0 if is_moving else _leading(self._parts, self._before)
        still = same if is_moving or not self._expects_more else self._lasting(same)
        begin = self._from_stage(canvas, camera, background, still)
        if begin == 0:
            canvas.fill(background)
        for place, part in enumerate(self._parts[begin:], begin):
            part.show(canvas, camera, background if place == 0 else None, is_moving=is_moving)
            if place + 1 in (same, still):
                self._stages.append((self._parts[: place + 1], camera, background, canvas.keep()))

    def _lasting(self, same: int) -> int:
        """How many parts at the back will be there in the next frame, too, when so many were there in the last one."""
        lasting = (part.lasts for part in self._parts[same:])
        return same + sum(takewhile(bool, lasting))

    def _from_stage(self, canvas: Canvas, camera: Camera, background: Rgba, still: int) -> int:
        """Show what was painted before of the most of the first few parts, and return how many parts that are.

        What is the same for a turn lies on what is the same for the whole game: both are kept, and nothing else.
        """
        if still == 0:
            return 0
        self._stages = [
            stage
            for stage in self._stages
            if stage[1:3] == (camera, background) and _leading(stage[0], self._parts) == len(stage[0]) <= still
        ][-_STAGES:]
        if not self._stages:
            return 0
        parts, _, _, surface = self._stages[-1]
        canvas.show(surface)
        return len(parts)


def _leading(parts: list[Part], before: list[Part]) -> int:
    """How many parts at the back are those of the frame before."""
    same = (now is then for now, then in zip(parts, before, strict=False))
    return sum(takewhile(bool, same))


class _Pace(Enum):
    """How often artists draw."""

    STATIC = "when the world changes"
    TURN = "once a turn"
    FRAME = "for every frame"


def _likeness(item: tuple[str, IArtist]) -> tuple[_Pace, int, Drawer | None]:
    """Key of the artists that make one part: those that change together."""
    artist = item[1]
    if artist.get_artist_type() is ArtistType.STATIC:
        return _Pace.STATIC, 0, None
    if getattr(artist.get_drawer(), "once_a_turn", False):
        return _Pace.TURN, artist.get_layer(), artist.get_drawer()
    return _Pace.FRAME, artist.get_layer(), None


def _key_of(name: str, artist: IArtist) -> Any:
    return name, artist.get_layer(), artist.get_drawer(), _print_of(getattr(artist, "data", None))


def _print_of(value: Any) -> Any:
    """Something hashable that differs where two values would be drawn differently."""
    if isinstance(value, dict):
        return tuple((_print_of(key), _print_of(one)) for key, one in value.items())
    if isinstance(value, list | tuple | set | frozenset):
        return type(value), tuple(_print_of(one) for one in value)
    if is_dataclass(value) and not isinstance(value, type):
        return type(value), tuple(_print_of(getattr(value, field.name)) for field in fields(value) if field.compare)
    if isinstance(value, np.ndarray) and value.dtype != object:
        return value.shape, value.dtype.str, crc32(value.tobytes())
    if value is None or isinstance(value, str | int | float | bytes | complex):
        return type(value), value
    return id(value)
