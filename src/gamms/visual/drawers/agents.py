"""Drawers of agents, of their trails, and of plain shapes."""

from collections.abc import Mapping, Sequence
from dataclasses import fields
from functools import lru_cache
from itertools import chain
from typing import Any, NamedTuple, TypeVar, cast

import numpy as np

from gamms.errors import BadValue
from gamms.ir.graph import FloatArray, IntArray
from gamms.typing import ColorType, IAerialAgent, IAgent, IContext
from gamms.typing.agent_engine import AgentType
from gamms.visual.appearance import AgentData, AgentLooks, AnyColor, Circle, Rectangle, Rgb, parse_color
from gamms.visual.drawing import EDGE_PX, Disc, DiscOffsets, Points, get_drawing
from gamms.visual.shown_turn import MovedAgents

_Shape = TypeVar("_Shape", Circle, Rectangle)


def render_circle(ctx: IContext, data: dict[str, Any]) -> None:
    """Draw a Circle found in `data`, or the one that `data` describes: x, y, radius (or scale), color."""
    if "scale" in data:
        data = {"radius": data["scale"], **data}
    circle = _read_shape(Circle, data)
    ctx.visual.render_circle(circle.x, circle.y, circle.radius, circle.color)


def render_rectangle(ctx: IContext, data: dict[str, Any]) -> None:
    """Draw a Rectangle found in `data`, or the one that `data` describes: x, y, width, height, color."""
    shape = _read_shape(Rectangle, data)
    ctx.visual.render_rectangle(shape.x, shape.y, shape.width, shape.height, shape.color)


def _read_shape(kind: type[_Shape], data: dict[str, Any]) -> _Shape:
    for value in data.values():
        if isinstance(value, kind):
            return value
    names = [field.name for field in fields(kind)]
    missing = [name for name in names if name not in data and name != "color"]
    if missing:
        raise BadValue(f"The data of a {kind.__name__.lower()} lacks {', '.join(missing)}; it has {sorted(data)}.")
    return kind(**{name: data[name] for name in names if name in data})


# A drawer does not know the scale, so each mark is drawn twice, in world units and in pixels.


def draw_rings(
    ctx: IContext, centers: Points, radius: float, color: ColorType, at_least_px: float, width_px: float = 2.0
) -> None:
    """Draw a ring around each of `centers` (rings, 2); a large one keeps the small one inside it."""
    visual = get_drawing(ctx)
    visual.render_circles(centers, radius, color, width_px)
    visual.render_circles(centers, at_least_px, color, width_px, in_pixels=True)


_BRIGHT = 170.0
_WHITE = (255, 255, 255)
_DARK = (60, 60, 60)

# of an agent in the air: in radii of its disc, and at least
RING = 1.8
RING_PX = 11.0
_NOSE = 2.6  # how far it reaches, in radii of the disc


def render_agent(ctx: IContext, data: dict[str, Any]) -> None:
    """Draw the agent that `data['agent_data']`, an AgentData, names and describes.

    Nothing is drawn if it is out of the game or does not exist: `set_agent_visual` warns of an unknown name.
    """
    look: AgentData = data["agent_data"]
    agent = ctx.agent.agents.get(look.name)
    if agent is None:
        return
    if agent.type == AgentType.AERIAL:
        render_aerial_agent(ctx, data)
        return
    place = _locate_agent(ctx, look, agent, data.get("_alpha", 1.0))
    if place is not None:
        _draw_body(ctx, look, *place)


def render_aerial_agent(ctx: IContext, data: dict[str, Any]) -> None:
    """Draw the agent in the air that `data['agent_data']` names, from above.

    Its height is written beside it where agents have labels. One that is out of the game is not drawn.
    """
    look: AgentData = data["agent_data"]
    agent = cast("IAerialAgent", ctx.agent.get_agent(look.name))
    cos, sin = agent.orientation
    place = _locate_agent(ctx, look, agent, data.get("_alpha", 1.0))
    if place is None:
        return
    x, y = place
    for color, edge_px in ((choose_outline(look.color), 2.0), (look.color, 0.0)):  # an edge lifts it off the map
        draw_rings(ctx, [(x, y)], RING * look.size, color, RING_PX, 2.0 + edge_px)
        if (cos, sin) != (0.0, 0.0):  # it does not point straight up or down
            nose = (x + _NOSE * look.size * cos, y + _NOSE * look.size * sin)
            get_drawing(ctx).render_lines([(x, y), nose], [0, 2], color, 3.0 + edge_px)
    _draw_body(ctx, look, x, y)


def render_agents(ctx: IContext, looks: list[AgentData], share: float) -> bool:
    """Draw agents on the ground together, after a share of their last moves, as `render_agent` draws each.

    Returns:
        False if an agent has an image; then nothing was drawn.
    """
    visual = get_drawing(ctx)
    agents = ctx.agent.agents
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
    columns = ([agent.current_node_id for agent in shown], [agent.prev_node_id for agent in shown], rows)
    discs = [Disc(size, least_px, color, choose_outline(color)) for color, size, least_px in styles]
    standing = _GroundAgents([agent.name for agent in shown], *(np.array(column, np.int64) for column in columns))
    positions, shifts = _draw_discs(ctx, standing, discs, share)
    for look, (x, y), (right, down) in zip(looks, positions.tolist(), shifts.tolist(), strict=True):
        look.current_position = (x, y)
        look.shift = (right, down)
    return True


def render_looks(ctx: IContext, data: dict[str, Any]) -> None:
    """Draw the agents that `data['looks']`, an AgentLooks, describes, as `render_agent` draws each."""
    looks: AgentLooks = data["looks"]
    share = data.get("_alpha", 1.0)
    positions = ctx.agent.positions
    rows = looks.rows
    is_shown = np.ones(len(looks.names), bool)
    if looks.structure is None or looks.structure != ctx.agent.structure_version:  # since the turn began
        numbers = {name: number for number, name in enumerate(positions.names)}
        rows = np.array([numbers.get(name, -1) for name in looks.names], np.int64)
        is_shown = rows >= 0
    hidden = get_drawing(ctx).hidden_agents(share)
    if hidden:
        is_shown &= ~np.isin(rows, [row for row in positions.inactive if positions.names[row] in hidden])
    names = looks.names
    colors = looks.color_rows
    if not is_shown.all():
        rows = rows[is_shown]
        colors = colors[is_shown]
        names = [names[row] for row in np.flatnonzero(is_shown).tolist()]
    edge_px = min(EDGE_PX, looks.least_px)  # a small disc would be nothing but its edge
    discs = [Disc(looks.size, looks.least_px, color, choose_outline(color), edge_px) for color in looks.colors]
    standing = _GroundAgents(
        names, positions.node_ids[rows], np.array(positions.previous_nodes, np.int64)[rows], colors
    )
    looks.note(is_shown, *_draw_discs(ctx, standing, discs, share))


class _GroundAgents(NamedTuple):
    """Agents on the ground, in columns."""

    names: Sequence[str]
    nodes: IntArray  # (agents,) ids
    previous: IntArray  # (agents,) ids of the nodes before
    rows: IntArray  # (agents,) the disc of each


def _draw_discs(ctx: IContext, agents: _GroundAgents, discs: list[Disc], share: float) -> tuple[FloatArray, FloatArray]:
    """Draw agents as discs, and return where, and by how many radii they are moved right and down, (agents, 2)."""
    visual = get_drawing(ctx)
    positions = visual.motion.find_positions(agents.names, agents.nodes, share)
    shifts = _compute_shifts(ctx, agents, share)
    visual.render_all_discs(positions, discs, agents.rows, shifts)
    return positions, shifts


_SPREAD = np.array([0.0, 0.0, 0.7, 0.85, 0.95, 1.0])  # number of discs on a node -> their distance from it, in radii
_MOST_SPREAD = 6  # with more discs on a node, discs of the same look are drawn as one


def _compute_shifts(ctx: IContext, agents: _GroundAgents, share: float) -> FloatArray:
    """Return offsets in radii (agents, 2), to the right and down, that separate discs on the same node.

    The offsets of agents that leave or arrive change gradually.
    """
    visual = get_drawing(ctx)
    if not visual.has_default_look:
        visual.has_stacks = False
        return np.zeros((len(agents.names), 2))
    moves = visual.motion.moves
    between = visual.motion.list_on_edges().keys() | visual.motion.reported.keys()
    on = agents.nodes
    previous = agents.previous
    if between:  # each is alone on its node
        on, previous = np.split(np.unique(np.concatenate([on, previous]), return_inverse=True)[1], 2)
        alone = np.array([name in between for name in agents.names], bool)
        on[alone] = 2 * len(on) + np.arange(int(alone.sum()))
    known = visual.spread
    if known is None or known.moves is not moves or not known.is_of(on, agents.rows):  # else it is the same turn
        before = np.where(visual.motion.find_paths(agents.names) >= 0, previous, on)
        starts = _spread(before, agents.rows)
        ends = _spread(on, agents.rows)
        known = DiscOffsets(on, agents.rows, moves, starts, ends)
        visual.spread = known
        visual.has_stacks = int(np.unique(on, return_counts=True)[1].max(initial=0)) > _MOST_SPREAD
    return known.ends if share >= 1.0 else (1.0 - share) * known.starts + share * known.ends


def _spread(nodes: IntArray, rows: IntArray) -> FloatArray:
    """Return how agents on nodes, each of the look in a row, are moved around these."""
    order = np.argsort(nodes, kind="stable")
    is_first = np.ones(len(nodes), bool)
    is_first[1:] = nodes[order[1:]] != nodes[order[:-1]]
    starts = np.flatnonzero(is_first)
    group = np.cumsum(is_first) - 1
    slots = np.diff(starts, append=len(nodes))
    slot = np.arange(len(nodes)) - starts[group]
    is_many = slots[group] > _MOST_SPREAD
    if is_many.any():  # one slot for each look, in the order of the first agents that have it
        looks = int(rows.max()) + 1
        kinds, first, kind = np.unique(
            group[is_many] * looks + rows[order[is_many]], return_index=True, return_inverse=True
        )
        by_first = np.argsort(first)
        groups = kinds[by_first] // looks
        place = np.empty(len(kinds), np.int64)
        place[by_first] = np.arange(len(kinds)) - np.searchsorted(groups, groups)
        slot[is_many] = place[kind]
        slots[np.unique(groups)] = np.unique(groups, return_counts=True)[1]
    count = slots[group]
    moves = np.zeros((len(nodes), 2))
    is_moved = count > 1
    slot = slot[is_moved]
    count = count[is_moved]
    angles = np.pi * (1.0 + 2.0 * (slot / count)) - np.where(count % 2, np.pi / 2, 0.0)
    far = _SPREAD[np.minimum(count, len(_SPREAD) - 1)]
    moves[order[is_moved]] = far[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
    return moves


def _locate_agent(ctx: IContext, look: AgentData, agent: IAgent, share: float) -> tuple[float, float] | None:
    """Return where an agent is drawn, and note it in its look; None if it is not drawn."""
    visual = get_drawing(ctx)
    look.current_position = visual.position_of(look.name, share) if visual.is_shown(agent, share) else None
    return look.current_position


def _draw_body(ctx: IContext, look: AgentData, x: float, y: float) -> None:
    if look.image is not None:
        ctx.visual.render_image(x, y, look.image, look.size)
    else:
        edge = choose_outline(look.color)
        get_drawing(ctx).render_discs([(x, y)], look.size, look.color, edge, at_least_px=look.least_px)


@lru_cache(maxsize=256)
def choose_outline(color: AnyColor) -> Rgb:
    """Return a dark color around bright ones, white around the others."""
    red, green, blue, _ = parse_color(color)
    luminance = 0.299 * red + 0.587 * green + 0.114 * blue
    return _DARK if luminance > _BRIGHT else _WHITE


# -- trails -----------------------------------------------------------------------------------------------------

_TRAIL_ALPHA = 150
_TRAIL_PX = 3.0


def render_past_trails(ctx: IContext, data: dict[str, Any]) -> None:
    """Draw the paths of `data["turns"]` turns except the last, in `data["colors"]` by agent; older ones are fainter."""
    ages = list(enumerate(get_drawing(ctx).motion.list_past(data["turns"])))[1:]
    for age, moves in reversed(ages):
        _draw_trails(ctx, moves, 1.0, data["colors"], round(_TRAIL_ALPHA * (1.0 - age / (data["turns"] + 1))))


render_past_trails.once_a_turn = True  # type: ignore[attr-defined] # then it is over


def render_trails(ctx: IContext, data: dict[str, Any]) -> None:
    """Draw the ways of the last turn as far as it is shown."""
    motion = get_drawing(ctx).motion
    share = float(data.get("_alpha", 1.0))
    for moves in [motion.moves] if share < 1.0 else motion.list_past(1):
        _draw_trails(ctx, moves, share, data["colors"], _TRAIL_ALPHA)


def _draw_trails(ctx: IContext, moves: MovedAgents, share: float, colors: Mapping[str, Any], alpha: int) -> None:
    by_color: dict[Any, list[list[tuple[float, float]]]] = {}
    paths = moves.paths
    ends = [(x, y) for x, y in moves.paths.find_points(share).tolist()]
    for name, row in moves.rows.items():
        if name in colors:
            by_color.setdefault(parse_color(colors[name]), []).append(paths.list_points_until(row, share, ends[row]))
    for color, lines in by_color.items():
        points = list(chain.from_iterable(lines))
        offsets = np.cumsum([0, *map(len, lines)])
        get_drawing(ctx).render_lines(points, offsets, (*color[:3], alpha), _TRAIL_PX)
