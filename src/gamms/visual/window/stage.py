"""The stage: a scene that is shown through a moving camera, in tiles, crowds and what drawers paint themselves."""

from collections.abc import Callable
from typing import Any

from gamms.typing import IArtist, IContext
from gamms.visual.backends.pygame import Canvas
from gamms.visual.camera import Camera
from gamms.visual.color import Rgba
from gamms.visual.scene import Part, Scene
from gamms.visual.window.tiles import Haste, Sheets, Tiles


class Stage(Scene):
    """The parts of the present state, as a window shows them.

    Args:
        ctx: the context.
        world: what else than its data a STATIC artist's drawing depends on.
    """

    def __init__(self, ctx: IContext, world: Callable[[], Any]) -> None:
        super().__init__(ctx, world)
        self._tiles: dict[Part, Tiles] = {}
        self._sheets = Sheets()
        self._overlays: dict[tuple[IArtist, ...], Any] = {}

    def note_overlay(self, artists: tuple[IArtist, ...], surface: Any) -> None:
        """Show a surface above what these artists drew; None: nothing."""
        if surface is None:
            self._overlays.pop(artists, None)
        else:
            self._overlays[artists] = surface

    def show(self, canvas: Canvas, camera: Camera, background: Rgba, haste: Haste) -> None:
        """Paint all of it."""
        if not self._parts or not self._is_tiled(self._parts[0]):
            canvas.fill(background)
        shown = {part: self._tiles[part] for part in self._parts if part in self._tiles}
        for place, part in enumerate(self._parts):
            if self._is_tiled(part):
                behind = background if place == 0 else None
                tiles = shown.get(part)
                if tiles is None or tiles.background != behind:
                    tiles = shown[part] = Tiles(part.painting, part.box, behind, self._sheets)
                tiles.show(canvas, camera, haste)
            else:
                part.paint(canvas, camera)
            overlay = self._overlays.get(part.artists)
            if overlay is not None:
                canvas.surface.blit(overlay, (0, 0))
        self._tiles = shown
        for tiles in shown.values():
            tiles.paint_ahead(camera, haste)

    def is_sharp(self, camera: Camera) -> bool:
        """Whether everything is painted in the scale in which it is shown."""
        return all(tiles.is_sharp(camera) for tiles in self._tiles.values())

    @staticmethod
    def _is_tiled(part: Any) -> bool:
        """Whether it stays the same for so long, and is so much, that it is better kept."""
        if isinstance(part, Part) and part.is_much:
            return part.is_static or all(getattr(one.get_drawer(), "once_a_turn", False) for one in part.artists)
        return False
