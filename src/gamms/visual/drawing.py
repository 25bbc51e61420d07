"""The drawing primitives: each appends to the open command list, and does nothing while none is open."""
# ruff: noqa: ARG002 - published signatures; culling and smoothing are the backend's business

import os
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, TypeVar, cast

import numpy as np

from gamms.arguments import as_float
from gamms.errors import BadType, BadValue
from gamms.ir.draw import DrawCommands, DrawSpace
from gamms.ir.graph import GraphColumns, IntArray
from gamms.text import shown
from gamms.typing import ColorType, IContext
from gamms.visual.appearance import BY_DAY, WallTones
from gamms.visual.camera import Viewpoint
from gamms.visual.color import Color
from gamms.visual.motion import Motion, TurnEvents
from gamms.visual.sights import Carriers

if TYPE_CHECKING:
    from gamms.visual.commands import Commands, Disc

Measured = TypeVar("Measured")

_FONT_PX = 36


class Drawing:
    """What drawers draw with, and what they ask about the turn that is shown.

    Args:
        ctx: the context.
        wall_tones: of obstacles that are filled, on the background that is usual here.
        held_image: turns an image into the path of a file, or the name of a loaded image.

    Attributes:
        motion: the last moves of agents.
        events: of the turn that is shown.
        carriers: of sensors.
        viewpoint: of pictures.
        commands: the open list; None: nothing is drawn.
    """

    def __init__(
        self, ctx: IContext, wall_tones: WallTones = BY_DAY, held_image: Callable[[Any], str] | None = None
    ) -> None:
        self._ctx, self.wall_tones, self._held_image = ctx, wall_tones, held_image or image_path
        self.motion, self.events, self.carriers = Motion(ctx), TurnEvents(ctx), Carriers(ctx)
        self.viewpoint = Viewpoint(ctx, self.motion.position_of)
        self.commands: Commands | None = None
        self._measured: tuple[GraphColumns | None, dict[Any, Any]] = None, {}

    def record(self, draw: "Callable[[Commands], None]") -> DrawCommands:
        """Return what is drawn while a function runs, as draw commands."""
        from gamms.visual.commands import Commands

        outer, self.commands = self.commands, Commands()
        try:
            draw(self.commands)
            return self.commands.freeze()
        finally:
            self.commands = outer

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
        if self.commands is not None:
            self.commands.add_text(text, x, y, color, _FONT_PX if font_size is None else font_size)

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
        if self.commands is not None:
            self.commands.add_rectangle(x, y, width, height, color)

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
        if self.commands is not None:
            self.commands.add_circles([(x, y)], radius, color, width)

    def render_line(  # noqa: PLR0913, PLR0917 - 1.0.0's signature
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
        if self.commands is not None:
            self.commands.add_line([(start_x, start_y), (end_x, end_y)], color, width)

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
        if self.commands is not None:
            self.commands.add_line([*points, *points[:1]] if closed else points, color, width)

    def render_polygon(
        self,
        points: Sequence[tuple[float, float]],
        color: ColorType = Color.Black,
        width: int = 0,
        perform_culling_test: bool = True,
    ) -> None:
        """Draw a polygon; `width` is its outline in pixels, 0 = filled."""
        if self.commands is not None:
            self.commands.add_polygon(points, color, width)

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
        if self.commands is not None:
            self.commands.add_image(self._held_image(image), x, y, size, angle)

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
        if self.commands is not None:
            self.commands.add_lines(points, offsets, color, width, DrawSpace.WORLD if in_world else DrawSpace.SCREEN)

    def render_polygons(self, points: Any, offsets: Any, color: ColorType = Color.Black, width: float = 0) -> None:
        """Draw many polygons at once: polygon `i` is `points[offsets[i]:offsets[i + 1]]`.

        `width` is the outline in pixels, 0 = filled. A polygon is filled where it winds around; so one with a seam to
        an inner ring, which runs the other way around, has a hole there.
        """
        if self.commands is not None:
            self.commands.add_polygons(points, offsets, color, width)

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
        if self.commands is not None:
            space = DrawSpace.SCREEN if in_pixels else DrawSpace.WORLD
            self.commands.add_circles(centers, radius, color, width, space)

    def position_of(self, agent_name: str, share: float = 1.0) -> tuple[float, float]:
        """Where an agent is shown after a share of its last move; 1.0 is where it stands.

        While a film or a window shows a turn, drawers find the share in `data["_alpha"]`.

        Raises:
            UnknownName (KeyError): there is no such agent.
        """
        if type(share) is not float:
            share = as_float(share, "share")
        return self.motion.position_of(agent_name, share)

    def is_shown(self, agent: Any, share: float = 1.0) -> bool:
        """Whether an agent is drawn after a share of its last move: one that is out is not, once it has got there."""
        return getattr(agent, "alive", True) or (
            as_float(share, "share") < 1.0 and agent.name in self.events.eliminated()
        )

    def hidden_agents(self, share: float = 1.0) -> set[str]:
        """The names of the agents that are not drawn, after a share of their last moves."""
        columns, agents = self._ctx.agent.columns, self._ctx.agent.agents  # type: ignore[attr-defined] # of our own engine
        out = [agents.get(columns.names[row]) for row in columns.out]
        return {agent.name for agent in out if agent is not None and not self.is_shown(agent, share)}

    def extent(self) -> float:
        """How much of the map pictures show, world units, for marks that are as large in all; 0.0 for no map.

        It is the longer side of the map, or less where `look_at` or `follow` said so.
        """
        whole, look = self.of_map(longer_side), self.viewpoint.look
        return whole if look is None else min(whole, look.world_width)

    def of_map(self, measure: Callable[[GraphColumns], Measured]) -> Measured:
        """What a function makes of the map, worked out once per map: drawers ask for it in every frame."""
        columns = self._ctx.graph.columns()
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
        if self.commands is not None:
            from gamms.visual.commands import Disc

            self.render_all_discs(centers, [Disc(radius, at_least_px, color, edge)], np.zeros(len(centers), np.int64))

    def render_all_discs(self, centers: Any, discs: "Sequence[Disc]", looks: IntArray) -> None:
        """Draw discs of several looks, each above those before it; `looks` (discs,) are rows of `discs`."""
        if self.commands is not None:
            self.commands.add_discs(centers, discs, looks)


def longer_side(columns: GraphColumns) -> float:
    """How long a map is from west to east or from south to north, whichever is longer; 0.0 for no map."""
    return float(np.ptp(columns.xy, axis=0).max()) if len(columns.xy) else 0.0


def drawing_of(ctx: IContext) -> Drawing:
    """Return what built-in drawers of a context draw with, bulk primitives included."""
    return cast("Drawing", ctx.visual.drawing)  # type: ignore[attr-defined] # of our own engines


def image_path(image: Any) -> str:
    """Check the path of an image file.

    Raises:
        BadType, BadValue: it is none, or there is no such file.
    """
    if not isinstance(image, str | os.PathLike):
        raise BadType(f"An image is given by the path of its file here, not by {shown(image)}.")
    if not os.path.isfile(image):  # noqa: PTH113 - pathlib is not loaded for a game without pictures
        raise BadValue(f"There is no image file {str(image)!r}.")
    return str(image)
