"""A scene: cached drawings, painted in layers and tiles."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from enum import Enum
from itertools import groupby, product, takewhile
from operator import is_, itemgetter
from time import perf_counter
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from gamms.ir.draw import DrawCommands
from gamms.ir.graph import FloatArray
from gamms.typing import ArtistType, IArtist, IContext
from gamms.typing.visualization_engine import Drawer
from gamms.visual.appearance import Rgba
from gamms.visual.artist import ArtistGroup, make_state_key, sort_for_painting
from gamms.visual.backends.pygame_backend import Canvas, load, paint_transparent
from gamms.visual.backends.raster import Painting
from gamms.visual.camera import NO_MARGINS, Box, Camera, Margins, compute_bounds, frame_drawings, spill
from gamms.visual.constants import CACHE_ZOOM_MAX

if TYPE_CHECKING:
    from pygame import Surface

_STEP = 256  # px: sides are multiples of it, so that a view that grows does not need a new surface in every frame
_LARGEST = 4_000_000  # pixels: 16 MB; larger surfaces are not reused


class SurfacePool:
    """Reusable surfaces, one for each use, because allocating memory costs more than painting."""

    def __init__(self) -> None:
        self._kept: dict[tuple[str, int], Any] = {}

    def get_surface(self, use: str, width: int, height: int, flags: int = 0) -> Any:
        """Return a surface of this size, with the contents of its last use."""
        kept = self._kept.get((use, flags))
        if kept is None or kept.get_width() < width or kept.get_height() < height:
            across, down = (-(-length // _STEP) * _STEP for length in (width, height))
            kept = load().Surface((across, down), flags, 32)
            if across * down <= _LARGEST:
                self._kept[use, flags] = kept
        return kept.subsurface((0, 0, width, height))


SIDE = 128  # px of a tile
_AROUND = 2  # tiles around the view that are kept
# the memory of all levels: at least 50 MiB, or this number of views
_MOST_TILES = 800
_MOST_VIEWS = 4
_SPILL_PX = 64.0  # how far outside the box of a painting something sized in pixels may reach
# how many times coarser or finer a level may be that tiles are cut out of
_COARSEST = 16.0
_FINEST = 4.0
_ROUNDING_PX = 1e-3  # camera offsets this close to whole pixels are rounded
_LOST = (3, 3, 3)  # of each color, give or take one, when a surface is made smaller

Place = tuple[int, int]  # column, row


class FrameBudget:
    """The time that a frame has for painting.

    Attributes:
        is_zooming: the scale changes from frame to frame.
        is_leaping: the camera is somewhere else at once, and all it sees is to be painted as it should be.
    """

    def __init__(self, seconds: float, *, is_zooming: bool = False, is_leaping: bool = False) -> None:
        self.is_zooming = is_zooming
        self.is_leaping = is_leaping
        self._end = perf_counter() + seconds
        self._is_first = True

    def has_time(self, seconds: float) -> bool:
        """Return whether there is time for a step of a given duration; always true for the first step."""
        is_first = self._is_first
        self._is_first = False
        return is_first or perf_counter() + seconds < self._end

    def spend(self) -> None:
        """Record that the first step was done."""
        self._is_first = False


def make_whole_budget() -> FrameBudget:
    """Return a budget without a time limit: everything in view is painted at once."""
    return FrameBudget(0.0, is_leaping=True)


class _Area(NamedTuple):
    """A rectangle of pixels of one level, or of tiles; right and bottom are exclusive."""

    left: int
    top: int
    right: int
    bottom: int

    def find_tiles(self) -> "_Area":
        """Return the tiles that hold these pixels."""
        return _Area(self.left // SIDE, self.top // SIDE, -(-self.right // SIDE), -(-self.bottom // SIDE))

    def widen(self, by: int) -> "_Area":
        return _Area(self.left - by, self.top - by, self.right + by, self.bottom + by)

    def list_places(self) -> Iterator[Place]:
        return product(range(self.left, self.right), range(self.top, self.bottom))


class _Level:
    """The tiles of one scale."""

    def __init__(self, scale: float, phase: tuple[float, float]) -> None:
        # the fraction by which its pixels are to the right of and below whole pixels
        self.scale = scale
        self._phase = phase
        self.tiles: dict[Place, Any] = {}  # surfaces; None is an empty one
        self.rough: set[Place] = set()  # tiles that were scaled from another level

    def forget(self, place: Place) -> None:
        """Remove a tile."""
        self.tiles.pop(place, None)
        self.rough.discard(place)

    def find_view(self, camera: Camera) -> _Area:
        """Return the pixels of this level that a camera sees."""
        share = self.scale / camera.scale
        x, y = self._phase
        left = round(camera.left * self.scale - x)
        top = round(-camera.top * self.scale - y)
        return _Area(left, top, left + round(camera.width * share), top + round(camera.height * share))

    def make_camera(self, tiles: _Area) -> Camera:
        """Return a camera that sees just these tiles."""
        size = (tiles.right - tiles.left) * SIDE, (tiles.bottom - tiles.top) * SIDE
        x, y = self._phase
        return Camera(*size, (tiles.left * SIDE + x) / self.scale, -(tiles.top * SIDE + y) / self.scale, self.scale)


class Tiles:
    """A painting as tiles, on a background, or transparent.

    Args:
        painting: the painting.
        box: its lower left and upper right corners, world units; None if it is empty.
        background: the color; None: transparent.
        pool: reusable surfaces, which several paintings may share.
    """

    def __init__(
        self, painting: Painting, box: tuple[FloatArray, FloatArray] | None, background: Rgba | None, pool: SurfacePool
    ) -> None:
        self.painting = painting
        self.background = background
        self._pool = pool
        self._box = box
        self._cost = 0.0  # seconds that the last tile took
        self._flags = load().BLEND_PREMULTIPLIED if background is None else 0
        self._levels: dict[_Grid, _Level] = {}  # the one that was used last is the last

    def show(self, canvas: Canvas, camera: Camera, budget: FrameBudget) -> None:
        """Show the view of a camera; with the background None, over the present contents."""
        level = self._choose_level(camera, budget)
        area = level.find_view(camera)
        if budget.is_leaping:
            for place in level.rough.intersection(area.find_tiles().list_places()):
                level.forget(place)
        # A camera that only pans misses few tiles, which are painted at once.
        is_settling = budget.is_zooming or not level.tiles or bool(level.rough)
        if self._fill(level, area.find_tiles(), may_cut_out=is_settling and not budget.is_leaping):
            budget.spend()
        self._sharpen(level, area.find_tiles(), budget)
        if level.scale == camera.scale:
            self._blit(canvas.surface, level, area)
            return
        canvas.surface.blit(
            self._scale_area(level, area, (camera.width, camera.height)), (0, 0), special_flags=self._flags
        )

    def is_sharp(self, camera: Camera) -> bool:
        """Return whether everything in view is painted at the scale of the camera."""
        level = self._levels.get(_compute_grid(camera))
        return level is not None and not level.rough.intersection(level.find_view(camera).find_tiles().list_places())

    def _choose_level(self, camera: Camera, budget: FrameBudget) -> _Level:
        """Return the level to show: that of the camera's scale, or while zooming one that is near."""
        last = next(reversed(self._levels.values()), None)
        if budget.is_zooming and last is not None:
            share = camera.scale / last.scale
            if 1 / CACHE_ZOOM_MAX <= share <= CACHE_ZOOM_MAX:
                return last
        grid = _compute_grid(camera)
        level = self._levels.pop(grid, None) or _Level(*grid)
        self._levels[grid] = level
        return level

    # -- painting --------------------------------------------------------------------------------------------

    def _fill(self, level: _Level, tiles: _Area, *, may_cut_out: bool) -> bool:
        """Make missing tiles: empty, cut out of another level, or painted at once; return whether it took time."""
        missing = [place for place in tiles.list_places() if place not in level.tiles]
        if not missing:
            return False
        self._evict(level, tiles)
        missing = [place for place in missing if not self._is_empty(level, place)]
        if not missing:
            return False
        if may_cut_out:
            missing = self._cut_out(level, missing)
        for row, places in groupby(sorted(missing, key=itemgetter(1, 0)), itemgetter(1)):
            columns = [column for column, _ in places]
            self._paint(level, _Area(columns[0], row, columns[-1] + 1, row + 1))
        return True

    def _is_empty(self, level: _Level, place: Place) -> bool:
        """Return whether a tile has no drawings; it is then stored as empty."""
        camera = level.make_camera(_Area(*place, place[0] + 1, place[1] + 1))
        if self._box is not None:
            (left, low), (right, high) = (corner.tolist() for corner in self._box)
            spill = _SPILL_PX / level.scale
            side = SIDE / level.scale
            if (
                camera.left - spill <= right
                and camera.left + side + spill >= left
                and camera.top - side - spill <= high
                and camera.top + spill >= low
            ):
                return False
        level.tiles[place] = None
        return True

    def _paint(self, level: _Level, tiles: _Area) -> None:
        surface = self._paint_tiles(level.make_camera(tiles))
        for place in tiles.list_places():
            level.tiles[place] = _copy_tile(surface, tiles, place)
            level.rough.discard(place)

    def _paint_tiles(self, camera: Camera) -> Any:
        if self.background is None:
            return paint_transparent(lambda color: self._paint_on_color(camera, color))
        return self._paint_on_color(camera, self.background)

    def _paint_on_color(self, camera: Camera, color: Rgba) -> Any:
        canvas = Canvas(camera.width, camera.height, self._pool.get_surface(str(color), camera.width, camera.height))
        canvas.fill(color)
        self.painting.paint(canvas, camera)
        return canvas.surface

    def _sharpen(self, level: _Level, tiles: _Area, budget: FrameBudget) -> None:
        """Repaint scaled tiles in view, from the middle outward, until the time is over."""
        middle = (tiles.left + tiles.right - 1) / 2, (tiles.top + tiles.bottom - 1) / 2
        rough = level.rough.intersection(tiles.list_places()) if level.rough else set()
        outwards = sorted(rough, key=lambda place: abs(place[0] - middle[0]) + abs(place[1] - middle[1]))
        for column, row in outwards:
            if not budget.has_time(self._cost):
                return
            began = perf_counter()
            self._paint(level, _Area(column, row, column + 1, row + 1))
            self._cost = perf_counter() - began

    # -- other levels ----------------------------------------------------------------------------------------

    def _cut_out(self, level: _Level, missing: list[Place]) -> list[Place]:
        """Make tiles by scaling tiles of other levels, nearest scale first; return the tiles that cannot be made."""
        others = [other for other in self._levels.values() if other is not level]
        others.sort(key=lambda other: max(other.scale / level.scale, level.scale / other.scale))
        for other in others:
            if 1 / _COARSEST <= other.scale / level.scale <= _FINEST:
                found = [place for place in missing if self._is_known(other, level, place)]
                if found:
                    self._cut_out_of(other, level, found)
                    missing = [place for place in missing if place not in level.tiles]
        return missing

    @staticmethod
    def _is_known(other: _Level, level: _Level, place: Place) -> bool:
        """Return whether a level has all that is to be seen on a tile of another level."""
        area = other.find_view(level.make_camera(_Area(*place, place[0] + 1, place[1] + 1)))
        return all(there in other.tiles for there in area.find_tiles().list_places())

    def _cut_out_of(self, source: _Level, level: _Level, found: list[Place]) -> None:
        tiles = _enclose_places(found)
        camera = level.make_camera(tiles)
        surface = self._scale_area(source, source.find_view(camera), (camera.width, camera.height))
        for place in found:
            level.tiles[place] = _copy_tile(surface, tiles, place)
            level.rough.add(place)

    def _evict(self, level: _Level, tiles: _Area) -> None:
        """Drop levels that were not used for long, except the one with the widest view; then distant tiles."""
        most = max(_MOST_TILES, _MOST_VIEWS * len(list(tiles.list_places())))
        farthest = min(self._levels.values(), key=lambda one: one.scale)
        for grid, old in list(self._levels.items()):
            if sum(len(one.tiles) for one in self._levels.values()) <= most:
                return
            if old is not level and old is not farthest:
                del self._levels[grid]
        for one in self._levels.values():
            kept = set(tiles.widen(_AROUND).list_places()) if one is level else set()
            for place in [place for place in one.tiles if place not in kept]:
                one.forget(place)

    # -- surfaces --------------------------------------------------------------------------------------------

    def _scale_area(self, level: _Level, area: _Area, size: tuple[int, int]) -> Any:
        """Return an area in another size; the brightness that shrinking costs is given back."""
        pygame = load()
        flags = pygame.SRCALPHA if self.background is None else 0
        part = self._pool.get_surface("part", max(area.right - area.left, 1), max(area.bottom - area.top, 1), flags)
        self._blit(part, level, area, is_copy=True)
        scaled = self._pool.get_surface("scaled", *size, flags)
        pygame.transform.smoothscale(part, size, scaled)
        if self.background is not None and size[0] < part.get_width():
            scaled.fill(_LOST, special_flags=pygame.BLEND_RGB_ADD)
        return scaled

    def _blit(self, surface: "Surface", level: _Level, area: _Area, *, is_copy: bool = False) -> None:
        """Put the tiles of an area on a surface of its size; a copy takes transparency as it is."""
        if is_copy or self.background is not None:
            surface.fill((0, 0, 0, 0) if self.background is None else self.background[:3])
        placed = [
            (tile, (place[0] * SIDE - area.left, place[1] * SIDE - area.top))
            for place in area.find_tiles().list_places()
            if (tile := level.tiles.get(place)) is not None
        ]
        if self.background is None and not is_copy:
            placed = [(tile, at, None, self._flags) for tile, at in placed]  # type: ignore[misc]
        surface.blits(placed, False)


_Grid = tuple[float, tuple[float, float]]  # scale and phase


def _compute_grid(camera: Camera) -> _Grid:
    """Return the scale of a camera, and by how much it lies right of and below whole pixels of the world."""
    across = camera.left * camera.scale
    down = -camera.top * camera.scale
    x, y = (part - round(part) for part in (across, down))
    return camera.scale, (x if abs(x) > _ROUNDING_PX else 0.0, y if abs(y) > _ROUNDING_PX else 0.0)


def _enclose_places(places: list[Place]) -> _Area:
    columns, rows = zip(*places, strict=True)
    return _Area(min(columns), min(rows), max(columns) + 1, max(rows) + 1)


def _copy_tile(surface: "Surface", tiles: _Area, place: Place) -> Any:
    """Return a copy of a tile, so that it does not keep the whole surface alive."""
    x = (place[0] - tiles.left) * SIDE
    y = (place[1] - tiles.top) * SIDE
    return surface.subsurface((x, y, SIDE, SIDE)).copy()


_FEW = 400  # points that are repainted faster than shown from a cache

Draw = Callable[[ArtistGroup], DrawCommands]
_Groups = list[tuple["_DrawRate", dict[str, IArtist], ArtistGroup]]


class ScenePart:
    """Consecutive artists, as commands prepared for painting.

    Attributes:
        is_static: the same until the world changes.
        lasts: the same for all frames of a turn.
        is_old: it was there in the turn before, too.
    """

    def __init__(self, group: ArtistGroup, commands: DrawCommands, key: object = None) -> None:
        self.artists = group.artists
        self.painting = Painting(commands)
        self.key = key
        self.is_static = key is not None
        self.lasts = self.is_static
        self.is_old = self.is_static
        self.is_much = len(commands.points) > _FEW
        self.tiles: Tiles | None = None

    @property
    def box(self) -> tuple[FloatArray, FloatArray] | None:
        """Lower left and upper right corner; None where nothing is drawn."""
        commands = self.painting.commands
        return compute_bounds(commands) if len(commands) else None

    def paint(self, canvas: Canvas, camera: Camera) -> None:
        """Paint the part visible to a camera."""
        self.painting.paint(canvas, camera)

    def show(self, canvas: Canvas, camera: Camera, behind: Rgba | None, budget: FrameBudget, pool: SurfacePool) -> None:
        """Paint it as tiles; `behind` is the color behind it, if nothing else is there."""
        if self.tiles is None or self.tiles.background != behind:
            self.tiles = Tiles(self.painting, self.box, behind, pool)
        self.tiles.show(canvas, camera, budget)

    def is_matching(self, commands: DrawCommands) -> bool:
        """Return whether these commands would give the same part."""
        mine = self.painting.commands
        if (
            not np.array_equal(mine.points, commands.points) or mine.text != commands.text
        ):  # the most frequent change first
            return False
        columns = ("kind", "layer", "space", "size", "width", "angle", "color", "offsets")
        return all(np.array_equal(getattr(mine, name), getattr(commands, name)) for name in columns)


_Still = tuple[list[ScenePart], Camera, Rgba, Any]  # parts, camera, background, and the surface


class Scene:
    """The drawings of the current state in parts, and surfaces that cache their pixels.

    Args:
        ctx: the context.
        world: returns the inputs of STATIC artists besides their data, for example the revision of the graph.
        tiles_turns: whether drawings that are constant for a turn use tiles, which is fast with many frames per turn.
    """

    def __init__(self, ctx: IContext, world: Callable[[], Any], *, tiles_turns: bool = False) -> None:
        self._tiles_turns = tiles_turns
        self._pool = SurfacePool()
        self._overlays: dict[tuple[IArtist, ...], Any] = {}
        self._ctx = ctx
        self._world = world
        self._parts: list[ScenePart] = []
        self._before: list[ScenePart] = []
        self._stages: list[_Still] = []  # surfaces of the rear parts, smallest number of parts first

    def draw(self, artists: Mapping[str, IArtist], draw: Draw, *, is_new_turn: bool = True) -> None:
        """Update the parts to the current state; `draw` calls artists, and returns their commands.

        Within a turn, static artists and artists whose drawer has a true attribute `once_a_turn` are not called again.
        """
        world = self._world()
        known = {part.key: part for part in self._parts if part.is_static}
        asked = {} if is_new_turn else {part.artists: part for part in self._parts}
        self._before = self._parts
        self._parts = []
        for rate, members, group in self._group_artists(artists):
            if rate is not _DrawRate.FRAME and group.artists in asked:
                part = asked[group.artists]
            elif rate is _DrawRate.STATIC:
                key = (world, *(make_state_key(name, artist) for name, artist in members.items()))
                part = known.get(key) or ScenePart(group, draw(group), key)
            else:
                part = self._make_moving_part(group, draw, is_new_turn=is_new_turn)
            part.lasts = rate is not _DrawRate.FRAME
            self._parts.append(part)

    def _group_artists(self, artists: Mapping[str, IArtist]) -> _Groups:
        """Return artists in painting order, grouped by parts."""
        by_likeness = groupby(sort_for_painting(artists), _group_key)
        parts = [(rate, dict(members)) for (rate, *_), members in by_likeness]
        return [(rate, members, ArtistGroup(self._ctx, members)) for rate, members in parts]

    def _make_moving_part(self, group: ArtistGroup, draw: Draw, *, is_new_turn: bool) -> ScenePart:
        """Return a part: that of the frame before, where it would look the same."""
        commands = draw(group)
        for part in self._before:
            is_taken = any(part is other for other in self._parts)  # by artists that draw the same
            if not part.is_static and not is_taken and part.is_matching(commands):
                part.artists = group.artists
                part.is_old |= is_new_turn
                return part
        return ScenePart(group, commands)

    def compute_box(self) -> Box:
        """Return the corners of what a picture of all parts shows."""
        return frame_drawings(*(part.painting.commands for part in self._parts))

    def spill(self, box: Box) -> Margins:
        """Return how many pixels signs at the sides of a box reach beyond it: left, top, right and bottom."""
        reach = [spill(part.painting.commands, box) for part in self._parts]
        left, top, right, bottom = map(max, zip(NO_MARGINS, *reach, strict=True))
        return left, top, right, bottom

    def note_overlay(self, artists: tuple[IArtist, ...], surface: "Surface | None") -> None:
        """Show a surface above the drawings of these artists; None: no surface."""
        if surface is None:
            self._overlays.pop(artists, None)
        else:
            self._overlays[artists] = surface

    def paint(self, canvas: Canvas, camera: Camera, background: Rgba, budget: FrameBudget | None = None) -> None:
        """Paint all parts.

        Args:
            canvas: the canvas; its content is replaced.
            camera: a camera of the size of the canvas.
            background: the background color.
            budget: the time limit for a moving camera; None: the camera is at rest, and whole surfaces are cached.
        """
        # Parts that are constant for a turn are above parts that are constant for the game; only these two are cached.
        stops = set() if budget else {_count_leading(part.is_static for part in self._parts)}
        stops |= set() if budget else {_count_leading(part.lasts for part in self._parts)}
        begin = self._show_stage(canvas, camera, background, stops)
        tiled = [part for part in self._parts[begin:] if self._is_tiled(part, is_moving=budget is not None)]
        if begin == 0 and not (budget and self._parts[:1] == tiled[:1]):
            canvas.fill(background)
        for place, part in enumerate(self._parts[begin:], begin):
            if part in tiled and (budget or place):  # rear parts are cached as a whole surface
                part.show(canvas, camera, None if place else background, budget or make_whole_budget(), self._pool)
            else:
                part.paint(canvas, camera)
            overlay = self._overlays.get(part.artists)
            if overlay is not None:
                canvas.surface.blit(overlay, (0, 0))
            if place + 1 in stops:
                self._stages.append((self._parts[: place + 1], camera, background, canvas.surface.copy()))

    def is_sharp(self, camera: Camera) -> bool:
        """Return whether all parts are painted at the scale of the camera."""
        return all(part.tiles is None or part.tiles.is_sharp(camera) for part in self._parts)

    def _is_tiled(self, part: ScenePart, *, is_moving: bool) -> bool:
        """Return whether a part is so large, and constant for so long, that caching its pixels pays."""
        is_kept = part.is_static or (part.lasts if self._tiles_turns else is_moving and part.is_old)
        return part.is_much and is_kept

    def _show_stage(self, canvas: Canvas, camera: Camera, background: Rgba, stops: set[int]) -> int:
        """Show the cached painting of the most leading parts, and return their number."""
        if not stops:
            return 0
        self._stages = [
            (parts, *seen, surface)
            for parts, *seen, surface in self._stages
            if len(parts) in stops and seen == [camera, background] and _are_first(parts, self._parts)
        ]
        if not self._stages:
            return 0
        parts, _, _, surface = max(self._stages, key=lambda stage: len(stage[0]))
        canvas.surface.blit(surface, (0, 0))
        return len(parts)


def _count_leading(are_so: Iterable[bool]) -> int:
    """Return the number of leading items that are true."""
    return sum(takewhile(bool, are_so))


def _are_first(parts: list[ScenePart], others: list[ScenePart]) -> bool:
    """Return whether others begin with these very parts."""
    return len(parts) <= len(others) and all(map(is_, parts, others))


class _DrawRate(Enum):
    """The draw frequency of artists: once, each turn, or each frame."""

    STATIC = "when the world changes"
    TURN = "once a turn"
    FRAME = "for every frame"


def _group_key(item: tuple[str, IArtist]) -> tuple[_DrawRate, int, Drawer | None]:
    """Return the key of the part of an artist; artists with equal keys change together."""
    artist = item[1]
    if artist.get_artist_type() is ArtistType.STATIC:
        return _DrawRate.STATIC, 0, None
    if getattr(artist.get_drawer(), "once_a_turn", False):
        return _DrawRate.TURN, artist.get_layer(), artist.get_drawer()
    return _DrawRate.FRAME, artist.get_layer(), None
