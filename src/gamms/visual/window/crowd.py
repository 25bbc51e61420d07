"""A crowd: agents on the ground, each a small surface that is shown where the agent is.

What the drawer of agents would draw for each of them is painted once per look, size and place within a pixel.
"""

from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import numpy as np

from gamms.errors import GammsError
from gamms.ir.draw import DrawCommands
from gamms.ir.graph import FloatArray
from gamms.typing import IArtist, IContext
from gamms.typing.agent_engine import AgentType
from gamms.visual.appearance import AgentData
from gamms.visual.backends.pygame import BLACK, WHITE, Canvas, load, veil
from gamms.visual.backends.raster import Painting
from gamms.visual.camera import Camera
from gamms.visual.color import Rgba, rgba
from gamms.visual.commands import Commands
from gamms.visual.drawers.agents import outline_of, render_agent
from gamms.visual.primitives import EDGE_PX, Primitives

_STEPS = 4  # places within a pixel
_ROOM_PX = 4  # around a disc: for its edge
_LARGEST_PX = 64.0  # of a radius; larger discs are few


class Crowd:
    """Agents in painting order, and where they are.

    Args:
        members: artists by name.
        visual: the engine.
        share: of their last moves.
    """

    is_static = False

    def __init__(self, members: Mapping[str, IArtist], visual: Primitives, share: float) -> None:
        self.artists = tuple(members.values())
        self.looks: list[AgentData] = []
        places: list[tuple[float, float]] = []
        position_of, hidden = visual.position_of, visual.hidden_agents(share)
        for name, artist in members.items():
            data = artist.data
            look: AgentData = data["agent_data"]
            if look.name in hidden:
                look.current_position = None
                continue
            try:
                place = position_of(look.name, share)
            except GammsError as error:
                kind = type(error).__name__
                visual.ctx.logger.error(f"Artist {name!r} could not be drawn: {kind}: {error}")  # noqa: TRY400 - not in ILogger
                continue
            data["_alpha"], look.current_position = share, place
            self.looks.append(look)
            places.append(place)
        self.places: FloatArray = np.array(places, np.float64).reshape(-1, 2)

    @staticmethod
    def shows_what(commands: DrawCommands) -> bool:  # noqa: ARG004 - asked of every part of a scene
        """Never: a crowd is no commands."""
        return False

    def paint(self, canvas: Canvas, camera: Camera) -> None:
        """Paint those that the camera sees."""
        if not self.looks:
            return
        corners = camera.to_screen(self.places)
        whole = np.floor(corners)
        steps = ((corners - whole) * _STEPS).astype(np.int64)
        code = (steps[:, 0] * _STEPS + steps[:, 1]).tolist()
        columns = zip(self.looks, whole.astype(np.int64).tolist(), code, strict=True)
        placed, scale = [], camera.scale
        right, low = canvas.width, canvas.height
        known: dict[tuple[Any, ...], tuple[Any, int]] = {}
        for look, (x, y), step in columns:
            color = look.color if look.color.__class__ is tuple else rgba(look.color)
            key = (color, look.size, look.least_px, step)
            found = known.get(key)
            if found is None:
                found = known[key] = _sprite(rgba(color), round(float(look.size) * scale, 1), look.least_px, step)
            sprite, reach = found
            if -reach <= x <= right + reach and -reach <= y <= low + reach:
                placed.append((sprite, (x - reach, y - reach)))
        canvas.stamps(placed, load().BLEND_PREMULTIPLIED)


def is_crowd(ctx: IContext, members: Mapping[str, IArtist], scale: float) -> bool:
    """Whether all of them are agents on the ground that are drawn as discs."""
    return all(_is_disc(ctx, artist, scale) for artist in members.values())


def _is_disc(ctx: IContext, artist: IArtist, scale: float) -> bool:
    if artist.get_drawer() is not render_agent:
        return False
    look = artist.data.get("agent_data")
    if not isinstance(look, AgentData) or look.image is not None or look.size * scale > _LARGEST_PX:
        return False
    try:
        return ctx.agent.get_agent(look.name).type != AgentType.AERIAL
    except KeyError:
        return True


@lru_cache(maxsize=4096)
def _sprite(color: Rgba, radius_px: float, least_px: float, step: int) -> tuple[Any, int]:
    """An agent as one sees it from a distance, and how far its middle is from its upper left corner."""
    reach = round(max(radius_px, least_px)) + _ROOM_PX
    right, down = divmod(step, _STEPS)
    x, y = (reach + (part + 0.5) / _STEPS for part in (right, down))
    side = 2 * reach + 1
    canvas = Canvas(2 * side, side)
    canvas.fill(BLACK)
    canvas.rectangle(side, 0, side, side, WHITE)
    _twins(color, radius_px, least_px, side).paint(canvas, Camera(2 * side, side, -x, y, 1.0))
    return veil(*(canvas.surface.subsurface((left, 0, side, side)) for left in (0, side))), reach


@lru_cache(maxsize=256)
def _twins(color: Rgba, radius_px: float, least_px: float, apart_px: int) -> Painting:
    """The same agent twice, so that it is painted on black and on white at once."""
    commands = Commands()
    commands.add_discs([(0.0, 0.0), (apart_px, 0.0)], radius_px, least_px, color, outline_of(color), EDGE_PX)
    return Painting(commands.freeze())
