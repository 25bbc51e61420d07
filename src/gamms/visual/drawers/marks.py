"""Drawers of marks on the nodes where agents were tagged, were eliminated, or arrived.

A mark has the color of the agent that it is about. Marks stand below discs of agents at their right and left, where
grids have neither edges nor nodes, and apart from several agents on the node; they lie on a layer below agents, so that
they cross out none. `get_drawn_marks` returns them as labels need them, so that they get names.
"""

from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from gamms.ir.draw import Owner
from gamms.ir.graph import FloatArray
from gamms.knowledge.sides import Side, find_side_of
from gamms.typing import IArtist, IContext
from gamms.visual.appearance import AgentData, AnyColor, Rgba, parse_color
from gamms.visual.constants import Layer
from gamms.visual.drawing import get_drawing
from gamms.visual.legend import SIGN, LegendRow, LegendRows

TAG_TURNS = 5  # that a tag is shown
# half of a cross or a tick, and the ring around the cross of a tag
_ARM_PX = 7.0
_RING_PX = 8.5
_LINE_PX = 3.0
_EDGE_PX = 3.0
# from the node aside and downward: radii of the discs there, and pixels; agents that share a node reach 2 radii
_ASIDE = 1.0
_ASIDE_PX = 12.0
_STEP_PX = 20.0  # from a mark to the next one in a row
_LABEL_PX = _STEP_PX / 2 + 0.5  # radius of the free space around a mark; in a row these circles touch
_ROW_PX = 40.0  # at most from the first mark of a row to the last one at each side
MARK_PX = 28.0  # how far marks reach from nodes whose discs have a radius of 6
_MARKS = "_marks"  # the key of the marks in the data of their artist
_PALE = 190  # alpha of marks of earlier turns
_CROSS = np.array([(-1.0, -1.0), (1.0, 1.0), (0.0, 0.0), (1.0, -1.0), (-1.0, 1.0), (0.0, 0.0)]) * _ARM_PX
_TICK = np.array([(-1.0, 0.1), (-0.3, 0.8), (1.0, -0.8), (-0.3, 0.8)]) * _ARM_PX
_AROUND = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
_RING = np.column_stack([np.cos(_AROUND), np.sin(_AROUND)]) * _RING_PX


class _AgentMark(NamedTuple):
    """A sign for an agent at a place."""

    name: str
    color: Rgba
    place: tuple[float, float]
    number: int  # in the row of its place
    signs: tuple[FloatArray, ...]
    owner: Owner
    turn: int = 0  # of several marks of an agent the latest has its name


def render_tags(ctx: IContext, data: dict[str, Any]) -> None:
    """Mark the nodes of the `tag` events of the last turns, as `gamms.rules.tag` emits them.

    `data` may have `colors` by team; the `size` of agents; a `side` (`knowledge.sides.Side`), so that only the tags are
    marked of which it knows; names of agents as `hidden`, and those that `render_eliminated` marks as `out`: for these
    no tag is marked.
    """
    visual = get_drawing(ctx)
    marks = list[_AgentMark]()
    out = data.get("out", {})
    colors = visual.group_colors() | data.get("colors", {})
    labels = visual.label_sides()
    new = visual.events.list_recent("tag", 1)
    taken = Counter(visual.position_of(name) for name in out)
    left_out = {*out, *data.get("hidden", ())}
    for node, tags in _find_latest_tags(ctx, data.get("side"), left_out).items():
        at = ctx.graph.graph.get_node(node)
        for number, (name, tag) in enumerate(sorted(tags.items()), taken[at.x, at.y]):
            agent = ctx.agent.agents[name]
            color = colors.get(getattr(agent, "team", None), colors[visual.label_side(find_side_of(agent))])
            color = _fade_color(color, is_new=tag in new)
            owner = Owner(sides=tuple(sorted(labels[side] for side in visual.events.find_witnesses(tag))))
            signs = _RING, 0.6 * _CROSS
            marks.append(_AgentMark(name, color, (at.x, at.y), number, signs, owner, int(tag.get("turn", 0))))
    _draw(ctx, marks, data)


def _find_latest_tags(
    ctx: IContext, side: Side | None, left_out: Collection[str]
) -> dict[int, dict[str, dict[str, Any]]]:
    """Return node -> agent -> its latest tag there, for marked tags."""
    graph = ctx.graph.graph
    agents = ctx.agent.agents
    found = dict[int, dict[str, dict[str, Any]]]()
    events = get_drawing(ctx).events
    for tag in events.list_recent("tag", TAG_TURNS):
        node = tag.get("node", -1)
        name = tag.get("other", "")
        is_known = side is None or side in events.find_witnesses(tag)
        if is_known and name in agents and name not in left_out and graph.has_node(node):
            found.setdefault(node, {}).setdefault(name, tag)
    return found


def render_eliminated(ctx: IContext, data: dict[str, Any]) -> None:
    """Mark the nodes where agents left the game: a cross for an eliminated agent, a tick for an agent that arrived.

    `data["out"]` maps the agents that are out to whether each arrived; `data["colors"]` has their colors, and
    `data["size"]` is the radius of agents.
    """
    visual = get_drawing(ctx)
    marks = list[_AgentMark]()
    taken = Counter[tuple[float, float]]()
    for name, has_arrived in data["out"].items():
        color = data["colors"][name]
        place = visual.position_of(name)
        color = _fade_color(color, is_new=name in visual.events.list_eliminated())
        marks.append(_AgentMark(name, color, place, taken[place], (_TICK if has_arrived else _CROSS,), Owner(name)))
        taken[place] += 1
    _draw(ctx, marks, data)


def get_drawn_marks(artist: IArtist) -> list[AgentData]:
    """Return the marks that an artist drew last, at their places."""
    data = getattr(artist, "data", None)
    return data.get(_MARKS, []) if isinstance(data, dict) and artist.get_visible() else []


def _fade_color(color: AnyColor, *, is_new: bool) -> Rgba:
    red, green, blue, alpha = parse_color(color)
    return red, green, blue, alpha if is_new else min(alpha, _PALE)


def _draw(ctx: IContext, marks: Sequence[_AgentMark], data: dict[str, Any]) -> None:
    """Draw marks beside their places, first the edges of all, and note in `data` where they are."""
    visual = get_drawing(ctx)
    last = {mark.place: mark.number for mark in marks}
    places = []
    shifts = []
    for mark in marks:
        x, y = mark.place
        aside = _ASIDE * data.get("size", 0.0)
        side = -1.0 if mark.number % 2 else 1.0
        step = min(_STEP_PX, _ROW_PX / max(last[mark.place] // 2, 1))
        places.append((x + side * aside, y - aside))
        shifts.append((side * (_ASIDE_PX + mark.number // 2 * step), _ASIDE_PX))
    for more_px in (_EDGE_PX, 0.0):
        for mark, place, shift in zip(marks, places, shifts, strict=True):
            ink = visual.theme.background if more_px else mark.color
            with visual.owned(*mark.owner):
                for sign in mark.signs:
                    visual.render_symbols([place], sign + shift, ink, _LINE_PX + more_px)
    latest = {mark.name: mark.turn for mark in sorted(marks, key=lambda mark: mark.turn)}
    data[_MARKS] = [
        AgentData(mark.name, mark.color, 0.0, None, place, _LABEL_PX, (right / _LABEL_PX, down / _LABEL_PX))
        for mark, place, (right, down) in zip(marks, places, shifts, strict=True)
        if mark.turn == latest[mark.name]
    ]


def _make_tag_rows(ctx: IContext) -> LegendRows | None:
    is_marked = bool(_find_latest_tags(ctx, None, get_drawing(ctx).events.list_out()))
    return LegendRows("", (LegendRow(SIGN, "tagged", sign="tag"),)) if is_marked else None


def make_elimination_rows(out: Mapping[str, bool]) -> LegendRows:
    """Return the legend of the agents that are out, where these arrived or not."""
    words = ((False, "out", "cross"), (True, "arrived", "tick"))
    return LegendRows(
        "", tuple(LegendRow(SIGN, name, sign=sign) for has_arrived, name, sign in words if has_arrived in out.values())
    )


render_tags.__dict__.update(artist="tags", layer=Layer.TAGS, legend=_make_tag_rows)
_DRAWERS: tuple[Callable[..., None], ...] = render_tags, render_eliminated
for _drawer in _DRAWERS:
    _drawer.once_a_turn = True  # type: ignore[attr-defined] # a mark does not glide
    _drawer.settles_in = TAG_TURNS  # type: ignore[attr-defined] # then it is as pale as it gets, or gone
    _drawer.is_mark = True  # type: ignore[attr-defined] # no name is written upon it
    _drawer.is_in_fog = True  # type: ignore[attr-defined] # teams that see little know of it
