"""Messages of many games at once: what array strategies send, who hears it, and what is under way."""

from collections.abc import Hashable, Mapping
from typing import Any, NamedTuple

import numpy as np

from gamms.arguments import as_key
from gamms.errors import BadType, BadValue, UnknownName
from gamms.game.batch.columns import Roster
from gamms.game.channels import Channel, receivers_of
from gamms.ir.graph import IntArray
from gamms.ir.obstacles import BoolArray
from gamms.plain import why_not_plain
from gamms.text import shown


class Outbox(NamedTuple):
    """Messages that agents send together by one channel; arrays (messages,).

    Attributes:
        channel: its name.
        to: of each an agent, a team, or None.
        bodies: of each.
    """

    channel: str
    to: list[Any]
    bodies: list[Any]


class Heard(NamedTuple):
    """The messages that agents of a view have in their inboxes, by game, then by agent, then as they were sent.

    Attributes:
        at: (messages,) the game in the view.
        hearers: (messages,) the agent of the view.
        senders: (messages,) numbers in the roster.
        bodies: (messages,) as they were sent; they must not be changed.
        turns: (messages,) how many turns were played when they were sent.
        overheard: (messages,) whether they were for others.
    """

    at: IntArray
    hearers: IntArray
    senders: IntArray
    bodies: list[Any]
    turns: IntArray
    overheard: BoolArray


class Radio:
    """The channels of a game.

    Args:
        channels: by name.
        roster: of the game.
    """

    def __init__(self, channels: Mapping[str, Channel], roster: Roster) -> None:
        self.channels = channels
        self._roster = roster
        self._teams = dict(zip(roster.names, (roster.teams[number] for number in roster.team_of), strict=True))

    def checked(self, channel: str, where: BoolArray, agents: IntArray, to: object, body: object) -> Outbox:
        """Return what agents send, (games, agents), checked, as `ArrayView.send`."""
        if as_key(channel, "The name of a channel") not in self.channels:
            raise UnknownName("channel", channel, self.channels)
        at, which = np.nonzero(where)
        senders, team_of = agents[which], self._roster.team_of
        for number in np.unique(team_of[senders]).tolist():
            if not self.channels[channel].is_for(self._roster.teams[number]):
                raise BadValue(f"Channel {channel!r} is not for team {shown(self._roster.teams[number])}.")
        receivers: list[Any] = [to] * len(at)
        if isinstance(to, np.ndarray):
            receivers = self._named(to, where.shape)[at, which].tolist()
        elif to is not None and not receivers_of(_as_key(to), self._teams):
            raise UnknownName("agent or team", to, [*self._teams, *self._roster.teams])
        if isinstance(body, np.ndarray) and body.shape[:2] != where.shape:
            raise BadValue(
                f"The first axes of an array of bodies are {where.shape}, games and agents: not {body.shape}."
            )
        bodies = body[at, which].tolist() if isinstance(body, np.ndarray) else [body] * len(at)
        for one in bodies if isinstance(body, np.ndarray) and body.dtype == object else [body] * (len(at) > 0):
            if not isinstance(one, np.ndarray) and (flaw := why_not_plain(one)):
                raise BadType(f"The body must be a plain value, such as numbers, texts, lists and dicts: body{flaw}.")
        return Outbox(channel, receivers, bodies)

    def _named(self, to: np.ndarray[Any, Any], shape: tuple[int, ...]) -> np.ndarray[Any, Any]:
        """Return the names of receivers, (games, agents), that are given by their numbers."""
        names = np.array(self._roster.names, object)
        if to.dtype.kind not in "iu" or to.shape not in (shape, shape[1:], ()) or ((to < 0) | (to >= len(names))).any():
            raise BadValue(
                f"Receivers of messages are numbers of agents from 0 to {len(names) - 1}, an array {shape}, not "
                f"{shown(to)}."
            )
        return np.broadcast_to(names[to], shape)


def _as_key(to: object) -> Hashable:
    if not isinstance(to, Hashable):
        raise BadType(f"The receiver of a message is an agent, a team or None, not {shown(to)}.")
    return to
