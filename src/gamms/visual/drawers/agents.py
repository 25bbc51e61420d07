"""Drawers of agents and of plain shapes."""

from collections import Counter
from dataclasses import fields
from functools import lru_cache
from typing import Any, TypeVar, cast

import numpy as np

from gamms.errors import BadValue
from gamms.ir.graph import FloatArray
from gamms.typing import ColorType, IAerialAgent, IAgent, IContext
from gamms.typing.agent_engine import AgentType
from gamms.visual.appearance import AgentData, AnyColor, Circle, Rectangle, Rgb, rgba
from gamms.visual.drawing import Disc, Points, drawing_of

_Shape = TypeVar("_Shape", Circle, Rectangle)


def render_circle(ctx: IContext, data: dict[str, Any]) -> None:
    """Draw a Circle found in `data`, or the one that `data` describes: x, y, radius (or scale), color."""
    if "scale" in data:
        data = {"radius": data["scale"], **data}
    circle = _described(Circle, data)
    ctx.visual.render_circle(circle.x, circle.y, circle.radius, circle.color)


def render_rectangle(ctx: IContext, data: dict[str, Any]) -> None:
    """Draw a Rectangle found in `data`, or the one that `data` describes: x, y, width, height, color."""
    shape = _described(Rectangle, data)
    ctx.visual.render_rectangle(shape.x, shape.y, shape.width, shape.height, shape.color)


def _described(kind: type[_Shape], data: dict[str, Any]) -> _Shape:
    for value in data.values():
        if isinstance(value, kind):
            return value
    names = [field.name for field in fields(kind)]
    missing = [name for name in names if name not in data and name != "color"]
    if missing:
        raise BadValue(f"The data of a {kind.__name__.lower()} lacks {', '.join(missing)}; it has {sorted(data)}.")
    return kind(**{name: data[name] for name in names if name in data})


# A drawer does not know the scale, so each mark is drawn twice, in world units and in pixels.


def rings(
    ctx: IContext, centers: Points, radius: float, color: ColorType, at_least_px: float, width_px: float = 2.0
) -> None:
    """Draw a ring around each of `centers` (rings, 2); a large one keeps the small one inside it."""
    visual = drawing_of(ctx)
    visual.render_circles(centers, radius, color, width_px)
    visual.render_circles(centers, at_least_px, color, width_px, in_pixels=True)


_BRIGHT = 170.0
_WHITE, _DARK = (255, 255, 255), (60, 60, 60)

RING, RING_PX = 1.8, 11.0  # of an agent in the air: in radii of its disc, and at least
_NOSE = 2.6  # how far it reaches, in radii of the disc


def render_agent(ctx: IContext, data: dict[str, Any]) -> None:
    """Draw the agent that `data['agent_data']`, an AgentData, names and describes, unless it is out of the game."""
    look: AgentData = data["agent_data"]
    agent = ctx.agent.get_agent(look.name)
    if agent.type == AgentType.AERIAL:
        render_aerial_agent(ctx, data)
        return
    place = _place(ctx, look, agent, data.get("_alpha", 1.0))
    if place is not None:
        _body(ctx, look, *place)


def render_aerial_agent(ctx: IContext, data: dict[str, Any]) -> None:
    """Draw the agent in the air that `data['agent_data']` names, from above; `labels.py` writes its height beside it.

    One that is out of the game is not drawn.
    """
    look: AgentData = data["agent_data"]
    agent = cast("IAerialAgent", ctx.agent.get_agent(look.name))
    cos, sin = agent.orientation
    place = _place(ctx, look, agent, data.get("_alpha", 1.0))
    if place is None:
        return
    x, y = place
    for color, edge_px in ((outline_of(look.color), 2.0), (look.color, 0.0)):  # an edge lifts it off the map
        rings(ctx, [(x, y)], RING * look.size, color, RING_PX, 2.0 + edge_px)
        if (cos, sin) != (0.0, 0.0):  # it does not point straight up or down
            nose = (x + _NOSE * look.size * cos, y + _NOSE * look.size * sin)
            drawing_of(ctx).render_lines([(x, y), nose], [0, 2], color, 3.0 + edge_px)
    _body(ctx, look, x, y)


def render_agents(ctx: IContext, looks: list[AgentData], share: float) -> bool:
    """Draw agents on the ground together, after a share of their last moves, as `render_agent` draws each.

    Returns:
        False if one of them has an image: nothing was drawn.
    """
    visual, agents = drawing_of(ctx), ctx.agent.agents
    hidden = visual.hidden_agents(share)
    if hidden:
        for look in looks:
            if look.name in hidden:
                look.current_position = None
        looks = [look for look in looks if look.name not in hidden]
    if any(look.image is not None for look in looks):
        return False
    styles: dict[tuple[Any, ...], int] = {}
    rows = [styles.setdefault((look.color, look.size, look.least_px), len(styles)) for look in looks]
    shown = [agents[look.name] for look in looks]
    nodes = [agent.current_node_id for agent in shown]
    positions = visual.motion.positions_of(shown, nodes, share)
    discs = [Disc(size, least_px, color, outline_of(color)) for color, size, least_px in styles]
    between = visual.motion.on_edges()
    stands: list[Any] = [one.name if one.name in between else node for one, node in zip(shown, nodes, strict=True)]
    shifts = _shifts(ctx, shown, stands, rows, share)
    visual.render_all_discs(positions, discs, np.array(rows, np.int64), shifts)
    for look, (x, y), (right, down) in zip(looks, positions.tolist(), shifts.tolist(), strict=True):
        look.current_position, look.shift = (x, y), (right, down)
    return True


_SPREAD = {2: 0.7, 3: 0.85, 4: 0.95}  # how far discs are moved that stand on one node, in radii; more of them by one
_MOST_SPREAD = 6  # of more on one node, those of one look are drawn as one


def _shifts(ctx: IContext, agents: list[IAgent], nodes: list[Any], rows: list[int], share: float) -> FloatArray:
    """Return by how many radii discs (agents, 2) are moved right and down, so that those on one node can be told apart.

    Those of agents that leave or come glide from where they stood to where they will.
    """
    visual, key = drawing_of(ctx), (*nodes, *rows)
    if not visual.has_default_look:
        visual.has_stacks = False
        return np.zeros((len(agents), 2))
    moved = visual.motion.moves
    if visual.spread is None or visual.spread[0] != key or visual.spread[1] is not moved:  # else it is the same turn
        before = [
            agent.prev_node_id if agent.name in moved.rows else node for agent, node in zip(agents, nodes, strict=True)
        ]
        visual.spread = key, moved, _spread(before, rows), _spread(nodes, rows)
        visual.has_stacks = max(Counter(nodes).values(), default=0) > _MOST_SPREAD
    *_, starts, ends = visual.spread
    return ends if share >= 1.0 else (1.0 - share) * starts + share * ends


def _spread(nodes: list[Any], rows: list[int]) -> FloatArray:
    """Return how agents on nodes, each of the look in a row, are moved around these."""
    moves, on = np.zeros((len(nodes), 2)), dict[Any, list[int]]()
    if len(set(nodes)) == len(nodes):
        return moves
    for place, node in enumerate(nodes):
        on.setdefault(node, []).append(place)
    for places in on.values():
        slots = places if len(places) <= _MOST_SPREAD else list(dict.fromkeys(rows[place] for place in places))
        if len(places) > 1 < len(slots):
            taken = places if slots is places else [rows[place] for place in places]
            turns = np.array([slots.index(one) for one in taken]) / len(slots)
            angles = np.pi * (1.0 + 2.0 * turns) - (np.pi / 2 if len(slots) % 2 else 0.0)
            far = _SPREAD.get(len(slots), 1.0)
            moves[places] = far * np.column_stack([np.cos(angles), np.sin(angles)])
    return moves


def _place(ctx: IContext, look: AgentData, agent: IAgent, share: float) -> tuple[float, float] | None:
    """Return where an agent is drawn, and note it in its look; None if it is not drawn."""
    visual = drawing_of(ctx)
    look.current_position = visual.position_of(look.name, share) if visual.is_shown(agent, share) else None
    return look.current_position


def _body(ctx: IContext, look: AgentData, x: float, y: float) -> None:
    if look.image is not None:
        ctx.visual.render_image(x, y, look.image, look.size)
    else:
        edge = outline_of(look.color)
        drawing_of(ctx).render_discs([(x, y)], look.size, look.color, edge, at_least_px=look.least_px)


@lru_cache(maxsize=256)
def outline_of(color: AnyColor) -> Rgb:
    """Return a dark colour around bright ones, white around the others."""
    red, green, blue, _ = rgba(color)
    luminance = 0.299 * red + 0.587 * green + 0.114 * blue
    return _DARK if luminance > _BRIGHT else _WHITE
