"""What the built-in drawers find in an artist's `data`."""

from dataclasses import dataclass, field
from typing import Any, NamedTuple

from gamms.typing import ColorType
from gamms.visual.color import Color, Rgb


@dataclass
class Circle:
    """A disc; `radius` in world units."""

    x: float
    y: float
    radius: float
    color: ColorType = Color.Black


@dataclass
class Rectangle:
    """A rectangle with its top-left corner at (x, y); `width` and `height` in pixels."""

    x: float
    y: float
    width: float
    height: float
    color: ColorType = Color.Black


@dataclass
class AgentData:
    """How an agent looks; `size` in world units."""

    name: str
    color: ColorType = Color.Black
    size: float = 8.0
    image: Any = None  # the path of a picture; a window may keep the loaded one
    current_position: tuple[float, float] | None = None  # where it was drawn last
    least_px: float = 6.0  # its radius is never less


@dataclass
class GraphData:
    """How the graph looks; `node_size` in world units."""

    node_color: ColorType = Color.DarkGray
    node_size: float = 2.0
    edge_color: ColorType = Color.LightGray
    draw_id: bool = False
    edge_line_points: dict[int, Any] = field(
        default_factory=dict, compare=False
    )  # graph revision -> what the drawer made of it


class WallTones(NamedTuple):
    """How buildings and walls look that have no colour of their own."""

    low: Rgb  # of the areas of the lowest buildings
    high: Rgb  # of the areas of the highest ones; what is between is mixed
    outline: Rgb  # of areas
    wall: Rgb  # of walls that stand around nothing


BY_DAY = WallTones(low=(240, 236, 228), high=(206, 197, 181), outline=(193, 184, 168), wall=(139, 128, 110))
BY_NIGHT = WallTones(low=(37, 40, 45), high=(70, 68, 66), outline=(86, 84, 81), wall=(140, 130, 116))
