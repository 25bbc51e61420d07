"""The drawing primitives: each appends to the open command list, and does nothing while none is open."""
# ruff: noqa: ARG002 - published signatures; culling and smoothing are the backend's business

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, TypeVar, cast

import numpy as np

from gamms.deciding import Guarded, phase_of
from gamms.errors import BadType, BadValue
from gamms.ir.draw import DrawSpace
from gamms.ir.graph import GraphColumns
from gamms.text import shown
from gamms.typing import ColorType, IContext, IVisualizationEngine
from gamms.visual.appearance import BY_DAY
from gamms.visual.color import Color
from gamms.visual.motion import Motion
from gamms.visual.sides import Happenings
from gamms.visual.sights import Carriers

if TYPE_CHECKING:
    from gamms.ir.graph import IntArray
    from gamms.visual.commands import Commands, Disc

Measured = TypeVar("Measured")

_FONT_PX = 36


class Primitives(Guarded, IVisualizationEngine):
    """The part of an engine that drawers draw with.

    Attributes:
        wall_tones: of obstacles that are filled, on the background that is usual here.
    """

    _called = "ctx.visual"

    def __init__(self, ctx: IContext) -> None:
        self._phase = phase_of(ctx)
        self.ctx = ctx
        self.motion = Motion(ctx)
        self.happenings = Happenings(ctx)
        self.carriers = Carriers(ctx)
        self.wall_tones = BY_DAY
        self._drawing: Commands | None = None
        self._measured: tuple[GraphColumns | None, dict[Any, Any]] = None, {}

    @contextmanager
    def _collecting(self) -> "Iterator[Commands]":
        """Open a command list: what is drawn inside the block is in it."""
        from gamms.visual.commands import Commands

        outer, self._drawing = self._drawing, Commands()
        try:
            yield self._drawing
        finally:
            self._drawing = outer

    def render_text(
        self,
        text: str,
        x: float,
        y: float,
        color: ColorType = Color.Black,
        perform_culling_test: bool = True,
        font_size: int | None = None,
    ) -> None:
        """Write `text` with its top-left corner at (x, y); `font_size` in pixels, default 36."""
        if self._drawing is not None:
            self._drawing.add_text(text, x, y, color, _FONT_PX if font_size is None else font_size)

    def render_rectangle(
        self,
        x: float,
        y: float,
        width: float,
        height: float,
        color: ColorType = Color.Black,
        perform_culling_test: bool = True,
    ) -> None:
        """Fill a rectangle whose top-left corner is at (x, y); `width` and `height` in pixels."""
        if self._drawing is not None:
            self._drawing.add_rectangle(x, y, width, height, color)

    def render_circle(
        self,
        x: float,
        y: float,
        radius: float,
        color: ColorType = Color.Black,
        width: int = 0,
        perform_culling_test: bool = True,
    ) -> None:
        """Draw a circle; `width` is its outline in pixels, 0 = filled."""
        if self._drawing is not None:
            self._drawing.add_circles([(x, y)], radius, color, width)

    def render_line(
        self,
        start_x: float,
        start_y: float,
        end_x: float,
        end_y: float,
        color: ColorType = Color.Black,
        width: int = 1,
        is_aa: bool = False,
        perform_culling_test: bool = True,
        force_no_aa: bool = False,
    ) -> None:
        """Draw a line, `width` in pixels."""
        if self._drawing is not None:
            self._drawing.add_line([(start_x, start_y), (end_x, end_y)], color, width)

    def render_linestring(
        self,
        points: Sequence[tuple[float, float]],
        color: ColorType = Color.Black,
        width: int = 1,
        closed: bool = False,
        is_aa: bool = False,
        perform_culling_test: bool = True,
    ) -> None:
        """Draw a polyline, `width` in pixels; a closed one returns to its first point."""
        if self._drawing is not None:
            self._drawing.add_line([*points, *points[:1]] if closed else points, color, width)

    def render_polygon(
        self,
        points: Sequence[tuple[float, float]],
        color: ColorType = Color.Black,
        width: int = 0,
        perform_culling_test: bool = True,
    ) -> None:
        """Draw a polygon; `width` is its outline in pixels, 0 = filled."""
        if self._drawing is not None:
            self._drawing.add_polygon(points, color, width)

    def render_image(
        self,
        x: float,
        y: float,
        image: Any,
        size: float,
        angle: float = 0.0,
        perform_culling_test: bool = True,
    ) -> None:
        """Draw the image file `image` with side `2 * size`, turned by `angle` degrees."""
        if self._drawing is not None:
            self._drawing.add_image(_image_path(image), x, y, size, angle)

    def render_lines(
        self,
        points: Any,
        offsets: Any,
        color: ColorType = Color.Black,
        width: float = 1,
        *,
        in_world: bool = False,
    ) -> None:
        """Draw many polylines at once: line `i` is `points[offsets[i]:offsets[i + 1]]`.

        `width` is in pixels, or in world units (but never thinner than a pixel) where `in_world` is set.
        """
        if self._drawing is not None:
            self._drawing.add_lines(points, offsets, color, width, DrawSpace.WORLD if in_world else DrawSpace.SCREEN)

    def render_polygons(self, points: Any, offsets: Any, color: ColorType = Color.Black, width: float = 0) -> None:
        """Draw many polygons at once: polygon `i` is `points[offsets[i]:offsets[i + 1]]`.

        `width` is the outline in pixels, 0 = filled. A polygon is filled where it winds around; so one with a seam to
        an inner ring, which runs the other way around, has a hole there.
        """
        if self._drawing is not None:
            self._drawing.add_polygons(points, offsets, color, width)

    def render_circles(
        self,
        centers: Any,
        radius: float,
        color: ColorType = Color.Black,
        width: float = 0,
        *,
        in_pixels: bool = False,
    ) -> None:
        """Draw many equal circles at once; `radius` in world units, or in pixels where `in_pixels` is set."""
        if self._drawing is not None:
            space = DrawSpace.SCREEN if in_pixels else DrawSpace.WORLD
            self._drawing.add_circles(centers, radius, color, width, space)

    def position_of(self, agent_name: str, share: float = 1.0) -> tuple[float, float]:
        """Where an agent is shown after a share of its last move; 1.0 is where it stands.

        While a film or a window shows a turn, drawers find the share in `data["_alpha"]`.

        Raises:
            UnknownName (KeyError): there is no such agent.
        """
        return self.motion.position_of(agent_name, share)

    def is_shown(self, agent: Any, share: float = 1.0) -> bool:
        """Whether an agent is drawn after a share of its last move: one that is out is not, once it has got there."""
        return getattr(agent, "alive", True) or (share < 1.0 and agent.name in self.happenings.eliminated())

    def hidden_agents(self, share: float = 1.0) -> set[str]:
        """The names of the agents that are not drawn, after a share of their last moves."""
        columns, agents = self.ctx.agent.columns, self.ctx.agent.agents  # type: ignore[attr-defined] # of our own engine
        out = [agents.get(columns.names[row]) for row in columns.out]
        return {agent.name for agent in out if agent is not None and not self.is_shown(agent, share)}

    def extent(self) -> float:
        """How much of the map pictures show, world units, for marks that are as large in all; 0.0 for no map.

        It is the longer side of the map, or less where `look_at` or `follow` said so.
        """
        whole, look = self.of_map(longer_side), getattr(self, "look", None)
        return whole if look is None else min(whole, look.world_width)

    def of_map(self, measure: Callable[[GraphColumns], Measured]) -> Measured:
        """What a function makes of the map, worked out once per map: drawers ask for it in every frame."""
        columns = self.ctx.graph.columns()
        if self._measured[0] is not columns:
            self._measured = columns, {}
        known = self._measured[1]
        if measure not in known:
            known[measure] = measure(columns)
        found: Measured = known[measure]
        return found

    def render_discs(
        self,
        centers: Any,
        radius: float,
        color: ColorType = Color.Black,
        edge: ColorType = Color.White,
        *,
        at_least_px: float = 0.0,
    ) -> None:
        """Fill many equal discs with a thin edge; `radius` in world units, but never less than some pixels."""
        if self._drawing is not None:
            from gamms.visual.commands import Disc

            self.render_all_discs(centers, [Disc(radius, at_least_px, color, edge)], np.zeros(len(centers), np.int64))

    def render_all_discs(self, centers: Any, discs: "Sequence[Disc]", looks: "IntArray") -> None:
        """Draw discs of several looks, each above those before it; `looks` (discs,) are rows of `discs`."""
        if self._drawing is not None:
            self._drawing.add_discs(centers, discs, looks)

    def render_layer(self, layer_id: int) -> None:
        """Do nothing: layers are painted with the picture."""

    def create_layer(self, layer_id: int, *args: Any, **kwargs: Any) -> None:
        """Do nothing: a layer is there as soon as an artist is on it."""

    def clear_layer(self, layer_id: int) -> None:
        """Do nothing: every picture begins empty."""

    def fill_layer(self, layer_id: int, *args: Any, **kwargs: Any) -> None:
        """Do nothing: layers have no background of their own."""


def longer_side(columns: GraphColumns) -> float:
    """How long a map is from west to east or from south to north, whichever is longer; 0.0 for no map."""
    return float(np.ptp(columns.xy, axis=0).max()) if len(columns.xy) else 0.0


def primitives_of(ctx: IContext) -> Primitives:
    """The visual engine of a context as what built-in drawers draw with, bulk primitives included."""
    return cast("Primitives", ctx.visual)


def _image_path(image: Any) -> str:
    if not isinstance(image, str | os.PathLike):
        raise BadType(f"An image is given by the path of its file here, not by {shown(image)}.")
    if not os.path.isfile(image):  # noqa: PTH113 - pathlib is not loaded for a game without pictures
        raise BadValue(f"There is no image file {str(image)!r}.")
    return str(image)
