"""A scene: what is drawn, kept as long as it stays the same, and painted in layers.

From back to front a scene is a list of parts. STATIC artists are drawn again only when the graph, the obstacles or
what was declared has changed; each of their parts is painted once per camera. Parts at the back that are the same as
in the frame before are shown as they were painted then.
"""

from collections.abc import Callable, Mapping
from enum import Enum
from itertools import groupby, takewhile
from typing import Any

import numpy as np

from gamms.ir.draw import DrawCommands
from gamms.ir.graph import FloatArray
from gamms.typing import ArtistType, IArtist, IContext
from gamms.typing.artist import Drawer
from gamms.visual.artist import Artist
from gamms.visual.artist_group import ArtistGroup, in_painting_order, state_of
from gamms.visual.backends.pygame import Canvas
from gamms.visual.backends.raster import Painting
from gamms.visual.camera import Camera, bounds, fit_box
from gamms.visual.color import Rgba
from gamms.visual.tiles import FrameBudget, SurfacePool, Tiles, whole_frame

_FEW = 400  # points that are repainted faster than shown from a cache
_STAGES = 2

Draw = Callable[[ArtistGroup], DrawCommands]
_Groups = list[tuple["_Pace", dict[str, IArtist], ArtistGroup]]


class Part:
    """Artists that follow each other, as commands that are ready to be painted.

    Attributes:
        is_static: the same until the world changes.
        is_of_turn: the same for all frames of a turn.
        lasts: it will be there in the next frame, too.
        is_old: it was there in the turn before, too.
    """

    def __init__(self, group: ArtistGroup, commands: DrawCommands, key: Any = None) -> None:
        self.artists = group.artists
        self.painting, self.key = Painting(commands), key
        self.is_static = self.lasts = self.is_old = key is not None
        self.is_of_turn = self.is_static
        self.is_much = len(commands.points) > _FEW
        self.tiles: Tiles | None = None

    @property
    def box(self) -> tuple[FloatArray, FloatArray] | None:
        """Lower left and upper right corner; None where nothing is drawn."""
        commands = self.painting.commands
        return bounds(commands) if len(commands) else None

    def paint(self, canvas: Canvas, camera: Camera) -> None:
        """Paint what the camera sees of it."""
        self.painting.paint(canvas, camera)

    def show(self, canvas: Canvas, camera: Camera, behind: Rgba | None, budget: FrameBudget, pool: SurfacePool) -> None:
        """Paint it as tiles; `behind` is the colour behind it, if nothing else is there."""
        if self.tiles is None or self.tiles.background != behind:
            self.tiles = Tiles(self.painting, self.box, behind, pool)
        self.tiles.show(canvas, camera, budget)

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
        tiles_turns: show in tiles what stays the same for a turn only, as is good for many frames per turn.
    """

    def __init__(self, ctx: IContext, world: Callable[[], Any], *, tiles_turns: bool = False) -> None:
        self._tiles_turns, self._pool = tiles_turns, SurfacePool()
        self._overlays: dict[tuple[IArtist, ...], Any] = {}
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
                key = (world, *(state_of(name, artist) for name, artist in members.items()))
                part = known.get(key) or Part(group, draw(group), key)
            else:
                part = self._moving_part(group, draw)
            part.lasts = pace is not _Pace.FRAME
            part.is_of_turn = part.lasts
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
            is_taken = any(part is other for other in self._parts)  # by artists that draw the same
            if not part.is_static and not is_taken and part.shows_what(commands):
                part.artists = group.artists
                part.is_old |= self._frames == 1
                return part
        return Part(group, commands)

    def fit(self, width: int, height: int, header: float, aside: float = 0.0) -> Camera:
        """A camera that sees everything below a header and left of a legend of so many pixels."""
        boxes = [box for part in self._parts if (box := part.box) is not None]
        low = np.min([box[0] for box in boxes], axis=0) if boxes else np.zeros(2)
        high = np.max([box[1] for box in boxes], axis=0) if boxes else np.zeros(2)
        return fit_box(low, high, width, height, header, aside)

    def note_overlay(self, artists: tuple[IArtist, ...], surface: Any) -> None:
        """Show a surface above what these artists drew; None: nothing."""
        if surface is None:
            self._overlays.pop(artists, None)
        else:
            self._overlays[artists] = surface

    def paint(self, canvas: Canvas, camera: Camera, background: Rgba, budget: FrameBudget | None = None) -> None:
        """Paint all of it.

        Args:
            canvas: what was there is painted over.
            camera: as large as the canvas.
            background: the colour behind everything.
            budget: the time there is for a camera that moves; None: it rests, so that whole surfaces are kept.
        """
        same = 0 if budget else _leading(self._parts, self._before)
        still = same if budget or not self._expects_more else self._lasting(same)
        begin = self._from_stage(canvas, camera, background, still)
        tiled = [part for part in self._parts[begin:] if self._is_tiled(part, is_moving=budget is not None)]
        if begin == 0 and (canvas.is_tracked or self._parts[:1] != tiled[:1]):
            canvas.fill(background)
        for place, part in enumerate(self._parts[begin:], begin):
            if part in tiled and (budget or place):  # at the back, a whole surface is kept
                part.show(canvas, camera, None if place else background, budget or whole_frame(), self._pool)
            else:
                part.paint(canvas, camera)
            overlay = self._overlays.get(part.artists)
            if overlay is not None:
                canvas.surface.blit(overlay, (0, 0))
            if place + 1 in (same, still):
                self._stages.append((self._parts[: place + 1], camera, background, canvas.keep()))
        for part in tiled:
            if part.tiles is not None and budget is not None:
                part.tiles.paint_ahead(camera, budget)

    def is_sharp(self, camera: Camera) -> bool:
        """Whether everything is painted in the scale in which it is shown."""
        return all(part.tiles is None or part.tiles.is_sharp(camera) for part in self._parts)

    def _is_tiled(self, part: Part, *, is_moving: bool) -> bool:
        """Whether a part is so much, and stays the same for so long, that it is better kept than repainted."""
        is_kept = part.is_static or (part.is_of_turn if self._tiles_turns else is_moving and part.is_old)
        return part.is_much and is_kept

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
