"""Artists that draw one after the other into one list of commands; agents that are discs draw together."""

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from itertools import groupby
from typing import Any
from zlib import crc32

import numpy as np

from gamms.ir.draw import DrawCommands
from gamms.typing import ArtistType, IArtist, IContext
from gamms.typing.agent_engine import AgentType
from gamms.visual.appearance import AgentData
from gamms.visual.artist import Artist
from gamms.visual.commands import Commands
from gamms.visual.drawers.agents import render_agent, render_agents
from gamms.visual.drawing import drawing_of

_Item = tuple[str, IArtist]


def in_painting_order(artists: Mapping[str, IArtist]) -> list[_Item]:
    """Sort the visible artists by layer; within a layer, static artists come first."""
    return sorted((item for item in artists.items() if item[1].get_visible()), key=_order)


def _order(item: _Item) -> tuple[int, bool]:
    return item[1].get_layer(), item[1].get_artist_type() is not ArtistType.STATIC


class ArtistGroup:
    """The visible ones among some artists, sorted once and drawn any number of times.

    Args:
        ctx: the context.
        artists: by name; what is changed in them other than their data needs a new group.

    Attributes:
        artists: in painting order.
    """

    def __init__(self, ctx: IContext, artists: Mapping[str, IArtist]) -> None:
        items = in_painting_order(artists)
        self._ctx, self.artists = ctx, tuple(artist for _, artist in items)
        by_step = groupby(items, lambda item: (item[1].get_layer(), _is_disc(ctx, item[1])))
        self._steps = [(layer, are_discs, list(members)) for (layer, are_discs), members in by_step]

    def commands(self, share: float = 1.0) -> DrawCommands:
        """Return what all draw after a share of the agents' last moves, from 0.0 to 1.0.

        An artist that fails is logged, and the others draw.
        """
        return drawing_of(self._ctx).record(lambda commands: self._draw(commands, share))

    def _draw(self, commands: Commands, share: float) -> None:
        for layer, are_discs, members in self._steps:
            commands.layer = layer
            for _, artist in members:
                data = getattr(artist, "data", None)
                if isinstance(data, dict) and artist.get_artist_type() is ArtistType.DYNAMIC:
                    data["_alpha"] = share
            if not (are_discs and self._draw_discs(members, share)):
                self._draw_singly(members)

    def _draw_discs(self, members: list[_Item], share: float) -> bool:
        """Draw agents together; False where one of them has to be drawn, or to fail, by itself."""
        try:
            return render_agents(self._ctx, [_data_of(artist)["agent_data"] for _, artist in members], share)
        except Exception:  # noqa: BLE001 - drawn by itself, the agent that is the reason fails likewise
            return False

    def _draw_singly(self, members: list[_Item]) -> None:
        for name, artist in members:
            try:
                artist.draw()
            except Exception as error:  # noqa: BLE001 - a drawer is user code; the contract is to log and go on
                self._ctx.logger.error(  # noqa: TRY400 - ILogger has no `exception`
                    "Artist %r could not be drawn: %s: %s", name, type(error).__name__, error
                )


def _is_disc(ctx: IContext, artist: IArtist) -> bool:
    """Whether an artist draws an agent on the ground as a disc."""
    if artist.get_drawer() is not render_agent or type(artist).draw is not Artist.draw:
        return False
    look = _data_of(artist).get("agent_data")
    agent = ctx.agent.agents.get(look.name) if isinstance(look, AgentData) else None
    return agent is not None and agent.type != AgentType.AERIAL


def _data_of(artist: IArtist) -> dict[str, Any]:
    data: dict[str, Any] = artist.data
    return data


def state_of(name: str, artist: IArtist) -> Any:
    """Return something hashable that changes whenever a STATIC artist has to draw again in the same world."""
    return name, artist.get_layer(), artist.get_drawer(), _print_of(getattr(artist, "data", None))


def _print_of(value: Any) -> Any:
    """Something hashable that differs where two values would be drawn differently."""
    if isinstance(value, dict):
        return tuple((_print_of(key), _print_of(one)) for key, one in value.items())
    if isinstance(value, list | tuple | set | frozenset):
        return type(value), tuple(_print_of(one) for one in value)
    if is_dataclass(value) and not isinstance(value, type):
        return type(value), tuple(_print_of(getattr(value, field.name)) for field in fields(value) if field.compare)
    if isinstance(value, np.ndarray) and value.dtype != object:
        return value.shape, value.dtype.str, crc32(value.tobytes())
    if value is None or isinstance(value, str | int | float | bytes | complex):
        return type(value), value
    return id(value)
