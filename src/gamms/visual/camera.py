"""Where a picture looks: from world coordinates, y up, to pixels, y down."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from gamms.arguments import as_float
from gamms.deciding import Guarded, outside_of_deciding, phase_of, refused_while_deciding
from gamms.errors import BadValue, GammsError
from gamms.ir.draw import DrawCommands, DrawKind, DrawSpace
from gamms.ir.graph import FloatArray
from gamms.typing import IContext

CSS_DPI = 96.0  # at which a pixel is what everybody takes for one
_MARGIN = 0.04  # of the picture's shorter side
_SMALLEST = 1e-9  # world units; anything smaller is a point


class Camera(NamedTuple):
    """A picture's size in pixels, the world point in its upper left corner, and pixels per world unit."""

    width: int
    height: int
    left: float
    top: float
    scale: float

    def to_screen(self, points: FloatArray) -> FloatArray:
        """World points (points, 2) in pixels."""
        screen: FloatArray = (points - (self.left, self.top)) * (self.scale, -self.scale)
        return screen


class Look(NamedTuple):
    """Where pictures of any size look: a point and a width, in world units."""

    x: float
    y: float
    world_width: float

    def camera(self, width: int, height: int) -> Camera:
        """The camera of a picture of so many pixels."""
        scale = width / self.world_width
        return Camera(width, height, self.x - self.world_width / 2, self.y + height / 2 / scale, scale)


class Follow(NamedTuple):
    """Where pictures look while they keep an agent in the middle: its name, and a width in world units."""

    name: str
    world_width: float

    def camera(self, place: tuple[float, float], width: int, height: int) -> Camera:
        """The camera over a place, moved by whole pixels only so that streets do not flicker."""
        camera = Look(*place, self.world_width).camera(width, height)
        left, top = round(camera.left * camera.scale) / camera.scale, round(camera.top * camera.scale) / camera.scale
        return camera._replace(left=left, top=top)


class Viewpoint(Guarded):
    """Where pictures, frames and films look.

    Args:
        ctx: the context.
        position_of: of an agent, by name, after a share of its last move.

    Attributes:
        look: None sees everything that is drawn.
        followed: the agent that is kept in the middle, if any.
    """

    _called = "ctx.visual"

    def __init__(self, ctx: IContext, position_of: Callable[[str, float], tuple[float, float]]) -> None:
        self._phase, self._position_of = phase_of(ctx), position_of
        self.look: Look | None = None
        self.followed: Follow | None = None

    @refused_while_deciding
    def look_at(self, x: float, y: float, width: float) -> None:
        """Look at `width` world units around (x, y), instead of everything.

        Raises:
            BadType, BadValue: not finite numbers, or a width that is not positive.
        """
        x, y, width = as_float(x, "x"), as_float(y, "y"), as_float(width, "width")
        if width <= 0.0:
            raise BadValue(f"A view needs a positive width in world units, not {width:g}.")
        self.look, self.followed = Look(x, y, width), None

    @refused_while_deciding
    def look_at_all(self) -> None:
        """Look at everything that is drawn."""
        self.look = self.followed = None

    @refused_while_deciding
    def follow(self, agent_name: str, width: float) -> None:
        """Keep an agent in the middle of `width` world units; where it is gone, stay where it was last."""
        self.followed = Follow(agent_name, float(width))

    @outside_of_deciding
    def camera(self, width: int, height: int, share: float = 1.0) -> Camera | None:
        """The camera of a picture of so many pixels, after a share of the agents' last moves; None sees everything."""
        if self.followed is not None:
            try:
                x, y = self._position_of(self.followed.name, share)
            except GammsError:  # it is gone
                self.followed = None
            else:
                self.look = Look(x, y, self.followed.world_width)
                return self.followed.camera((x, y), width, height)
        return None if self.look is None else self.look.camera(width, height)


def fit(commands: DrawCommands, width: int, height: int, header: float = 0.0, aside: float = 0.0) -> Camera:
    """A camera that sees everything drawn, as large as it gets below a header and left of a legend, pixels."""
    return fit_box(*bounds(commands), width, height, header, aside)


def fit_box(low: FloatArray, high: FloatArray, width: int, height: int, header: float, aside: float = 0.0) -> Camera:
    """A camera that sees all from corner to corner, as large as it gets below a header and left of a legend, pixels."""
    margin = _MARGIN * min(width, height)
    free = max(width - aside - 2 * margin, 1.0), max(height - header - 2 * margin, 1.0)
    scale = min(
        (room / extent for room, extent in zip(free, high - low, strict=True) if extent > _SMALLEST),
        default=1.0,
    )
    x, y = ((low + high) / 2).tolist()
    return Camera(width, height, x - (width - aside) / 2 / scale, y + (height + header) / 2 / scale, scale)


def bounds(commands: DrawCommands) -> tuple[FloatArray, FloatArray]:
    """Lower left and upper right corner of everything drawn, in world units; sizes in pixels do not count."""
    if len(commands) == 0:
        return np.zeros(2), np.zeros(2)
    reach = np.where(commands.space == DrawSpace.WORLD, commands.size, 0.0)
    around, axes = np.repeat(reach, np.diff(commands.offsets)), _corners(commands).T
    # NOTE: one axis after the other, which takes a third of the time (first frame of 100,000 edges).
    return np.array([(axis - around).min() for axis in axes]), np.array([(axis + around).max() for axis in axes])


def _corners(commands: DrawCommands) -> FloatArray:
    """The points of all commands, with the far corner of each rectangle in place of its extent."""
    points = commands.points.copy()
    rows = np.flatnonzero(commands.kind == DrawKind.RECTANGLE)
    anchors = commands.offsets[rows]
    in_world = (commands.space[rows] == DrawSpace.WORLD)[:, None]
    points[anchors + 1] = points[anchors] + points[anchors + 1] * (1.0, -1.0) * in_world
    return points
