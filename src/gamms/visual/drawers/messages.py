"""Drawer of messages: an arc from the sender to each agent that hears it, or a ring that fades if none does."""

from collections.abc import Collection, Iterator
from itertools import islice, takewhile
from math import inf
from typing import Any

import numpy as np

from gamms.ir.graph import FloatArray
from gamms.ir.messages import ARRIVALS
from gamms.knowledge.sides import find_receivers, find_side_of
from gamms.typing import IContext
from gamms.typing.agent_engine import AgentType
from gamms.visual.appearance import Rgba
from gamms.visual.drawers.agents import RING, RING_PX, draw_rings
from gamms.visual.drawing import get_drawing
from gamms.visual.legend import SIGN, LegendRow, LegendRows

_MOST = 2000  # arcs
_OLDEST = 200  # turns that a message may have been under way
_LINE_PX = 2.0
# alpha of heard and of overheard messages
_INK = 200
_FAINT = 90
# of the ring around an agent: how far it is beyond the disc, or the ring of a flyer, in radii of discs and at least
_BEYOND = 0.25
_BEYOND_PX = 4.0
_DISC_PX = 6.0  # the least radius of a disc
# how the ring around the sender of an unheard message grows over the turn
_WIDER = 0.15
_WIDER_PX = 6.0
# alpha of this ring, and its loss over the turn
_UNHEARD_INK = 230
_FADED = 160
_BEND = np.linspace(0.0, 1.0, 13)  # where the points of an arc are
_HEIGHT = 0.12  # of an arc, in lengths of the way


def has_messages(ctx: IContext) -> bool:
    """Return whether anything was sent by a channel."""
    game = ctx.current_game
    return game is not None and bool(game.messages)


def render_messages(ctx: IContext, data: dict[str, Any]) -> None:
    """Draw the messages that arrive after the moves of this turn, in the colors of the senders.

    A message sent in this turn that no agent hears is a ring around its sender, which grows and fades over the turn.
    `data` may have `of`, names of agents: only messages that these send, hear or overhear are shown; `hidden`,
    names of agents: a message from a hidden agent is a ring around its receiver; and `size`, the radius of agents in
    world units: rings lie outside their discs.
    """
    visual = get_drawing(ctx)
    agents = ctx.agent.agents
    alpha = data.get("_alpha", 1.0)
    hidden = data.get("hidden", ())
    for sender, receiver, is_overheard in islice(_list_arriving_messages(ctx, data.get("of")), _MOST):
        if sender not in agents or receiver not in agents or receiver in hidden:
            continue
        color = (*visual.color_of(visual.label_side(find_side_of(agents[sender]))), _FAINT if is_overheard else _INK)
        end = visual.position_of(receiver, alpha)
        if sender in hidden:
            _draw_ring(ctx, data, receiver, color)
        else:
            arc = _compute_arc(visual.position_of(sender, alpha), end)
            visual.render_lines(arc, [0, len(arc)], color, _LINE_PX)
    for sender in islice(_list_unheard_senders(ctx, data.get("of")), _MOST):
        if sender in agents and sender not in hidden:
            color = (
                *visual.color_of(visual.label_side(find_side_of(agents[sender]))),
                round(_UNHEARD_INK - _FADED * alpha),
            )
            _draw_ring(ctx, data, sender, color, alpha)


def _draw_ring(ctx: IContext, data: dict[str, Any], name: str, color: Rgba, grown: float = 0.0) -> None:
    """Draw a ring around an agent, outside its disc, that has grown by a share of all that it grows."""
    flies = ctx.agent.agents[name].type == AgentType.AERIAL
    radius = (RING if flies else 1.0) + _BEYOND + _WIDER * grown
    least_px = (RING_PX if flies else _DISC_PX) + _BEYOND_PX + _WIDER_PX * grown
    place = get_drawing(ctx).position_of(name, data.get("_alpha", 1.0))
    draw_rings(ctx, [place], radius * data.get("size", 0.0), color, least_px, _LINE_PX)


def _list_unheard_senders(ctx: IContext, of: Collection[str] | None) -> Iterator[str]:
    """Yield the senders of messages of this turn that no agent, or none of these, will hear or overhear, each once."""
    game = ctx.current_game
    turn = 0 if game is None else game.turn
    sent = takewhile(lambda entry: entry["turn"] >= turn, reversed(() if game is None else game.messages))
    known = ((entry["sender"], entry if of is None else find_receivers(entry, of, inf)) for entry in sent)
    lost = (sender for sender, heard in known if not any(heard[key] for key in ARRIVALS))
    yield from dict.fromkeys(sender for sender in lost if of is None or sender in of)


def _list_arriving_messages(ctx: IContext, of: Collection[str] | None) -> Iterator[tuple[str, str, bool]]:
    """Yield sender, receiver and whether it is overheard, for messages that arrive before the next turn."""
    game = ctx.current_game
    turn = 0 if game is None else game.turn
    for entry in reversed(() if game is None else game.messages):
        if entry["turn"] < turn - _OLDEST:
            return
        heard = entry if of is None else find_receivers(entry, of, turn + 1)
        for key in ARRIVALS:
            arriving = (name for name, arrival in heard[key].items() if arrival == turn + 1)
            yield from ((entry["sender"], name, key == "overheard") for name in arriving)


def _compute_arc(start: tuple[float, float], end: tuple[float, float]) -> FloatArray:
    """Return points (points, 2) from start to end that bend to the left, so that there and back are two arcs."""
    first = np.array(start)
    way = np.subtract(end, start)
    aside = np.array([-way[1], way[0]]) * _HEIGHT
    return first + _BEND[:, None] * way + (4.0 * _BEND * (1.0 - _BEND))[:, None] * aside


def make_message_legend(ctx: IContext, of: Collection[str] | None = None) -> LegendRows | None:
    """Return the legend rows of the messages that are shown; `of` is as for `render_messages`."""
    rows = list[LegendRow]()
    if next(_list_arriving_messages(ctx, of), None) is not None:
        rows.append(LegendRow(SIGN, "message", sign="curve"))
    if next(_list_unheard_senders(ctx, of), None) is not None:
        rows.append(LegendRow(SIGN, "message that nobody hears", sign="ring"))
    return LegendRows("", tuple(rows)) if rows else None


render_messages.__dict__["legend"] = make_message_legend
