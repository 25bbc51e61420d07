"""Channels: declarations of how agents can send messages, and checks of their outboxes."""

from collections.abc import Collection, Hashable, Iterable, Mapping, Sequence
from itertools import compress
from typing import Any, NamedTuple, Protocol, TypeVar

import numpy as np

from gamms.arguments import (
    as_count,
    as_flag,
    as_items,
    as_key,
    as_known,
    as_mapping,
    as_name,
    as_numbers,
    as_range,
    as_text,
)
from gamms.core import messages as core
from gamms.errors import BadType, BadValue, GammsError, UnknownName
from gamms.ir.chances import as_chances
from gamms.ir.graph import IntArray, as_node_id
from gamms.ir.obstacles import BoolArray
from gamms.ir.packing import to_bytes
from gamms.kernels import as_buffer
from gamms.plain import Plain, describe_flaw, to_plain
from gamms.readonly import ReadOnlyMapping
from gamms.text import reason, shown
from gamms.typing.context import HostContext

_SEVERAL = (list, tuple, set, frozenset)
_RANGES = "range_m= (metres in a straight line), hops= (edges along the graph) or line_of_sight=True"
_JAMMER = "{'agent': name, 'radius_m': 50}, with 'team' or 'at' (a node or (x, y)) in place of 'agent'"
_KEYS = ("channel", "to", "body")  # of a message in an outbox
_UNLIMITED = (1 << 63) - 1  # bytes


class Jammer(NamedTuple):
    """An agent, a team or a place that jams a channel: within its radius, no agent hears messages."""

    radius_m: float
    agent: str | None = None
    team: Any = None  # any value that can be a key of a dict
    at: int | tuple[float, float] | None = None


class Channel(NamedTuple):
    """A way to send messages; `Settings.add_channel` describes the attributes."""

    name: str
    range_m: float | None = None
    hops: int | None = None
    line_of_sight: bool = False
    relay: bool | tuple[Any, ...] = False
    loss: float | tuple[tuple[float, float], ...] = 0.0
    delay_turns: int = 1
    max_bytes_per_turn: int | None = None
    jammers: tuple[Jammer, ...] = ()
    teams: tuple[Any, ...] | None = None
    eavesdroppers: tuple[Any, ...] = ()

    def __repr__(self) -> str:
        given = [f"{key}={shown(value)}" for key, value in self.list_options().items()]
        return f"Channel({', '.join([shown(self.name), *given])})"

    def list_options(self) -> dict[str, Plain]:
        """Return the keywords that declare the channel, as plain values; defaults are left out."""
        values = zip(self._fields[1:], self[1:], strict=True)
        given: dict[str, Any] = {key: value for key, value in values if value != self._field_defaults[key]}
        if self.jammers:
            given["jammers"] = [{k: v for k, v in one._asdict().items() if v is not None} for one in self.jammers]
        plain: dict[str, Plain] = to_plain(given)
        return plain

    def is_for(self, team: Hashable) -> bool:
        """Return whether agents of a team may use the channel."""
        return self.teams is None or team in self.teams

    def list_named(self) -> set[Any]:
        """Return all agents and teams that the channel mentions, without distinction."""
        relays = self.relay if isinstance(self.relay, tuple) else ()
        jammers = [one.agent if one.team is None else one.team for one in self.jammers if one.at is None]
        return {*relays, *(self.teams or ()), *self.eavesdroppers, *jammers}


# -- declarations -------------------------------------------------------------------------------------------------


def as_channels(value: object) -> Mapping[str, Channel]:
    """Return declared channels as a read-only mapping: name -> channel.

    Raises:
        BadType, BadValue, UnknownName: a declaration is invalid.
    """
    given = as_mapping(value, "ctx.game.channels")
    return ReadOnlyMapping(
        {name: one if isinstance(one, Channel) else as_channel(name, one) for name, one in given.items()}
    )


def as_channel(name: object, options: object) -> Channel:
    """Return the channel declared by keywords; None means that a keyword is not given.

    Raises:
        BadType, BadValue: a value is impossible, or the channel has no range.
        UnknownName (KeyError): a keyword does not exist.
    """
    known = Channel(as_name(name, "a channel"))
    given = {key: one for key, one in as_mapping(options, f"Channel {known.name!r}").items() if one is not None}
    for key in given:
        as_known(key, f"keyword of channel {known.name!r}:", _CHECKS)
    values = {key: _CHECKS[key](one, f"{key} of channel {known.name!r}") for key, one in given.items()}
    channel = known._replace(**values)
    if channel.range_m is None and channel.hops is None and not channel.line_of_sight:
        passed_on = (
            " relay= passes messages on; what is missing is how far each agent reaches." if channel.relay else ""
        )
        raise BadValue(f"Channel {known.name!r} has no range: give {_RANGES}.{passed_on}")
    return channel


def _check_loss(value: object, name: str) -> float | tuple[tuple[float, float], ...]:
    points = as_chances(value, name).tolist()
    return float(points[0][1]) if len(points) == 1 else tuple([(distance, chance) for distance, chance in points])


def _check_names(value: object, name: str) -> tuple[Any, ...]:
    """Return agents or teams as a tuple, from a single one or from a list, tuple or set."""
    several = tuple(value) if isinstance(value, _SEVERAL) else (value,)
    return tuple(dict.fromkeys(as_key(one, f"Each of {name}") for one in several))


def _check_teams(value: object, name: str) -> tuple[Any, ...]:
    teams = _check_names(value, name)
    if not teams:
        raise BadValue(f"{name} must name a team at least; None lets all use it.")
    return teams


def _check_relay(value: object, name: str) -> bool | tuple[Any, ...]:
    return value if isinstance(value, bool) else _check_names(as_items(value, name, "agents and teams, or True"), name)


def _check_jammers(value: object, name: str) -> tuple[Jammer, ...]:
    return tuple(_check_jammer(one, name) for one in as_items(value, name, f"dicts such as {_JAMMER}"))


def _check_jammer(value: object, name: str) -> Jammer:
    given = as_mapping(value, f"Each of {name}")
    for key in given:
        as_known(key, f"key of {name}:", Jammer._fields)
    if "radius_m" not in given or sum(given.get(key) is not None for key in ("agent", "team", "at")) != 1:
        raise BadValue(f"Each of {name} must be like {_JAMMER}, not {shown(value)}.")
    at = given.get("at")
    team = given.get("team")
    where: Any = None
    if hasattr(at, "__index__") or isinstance(at, str):
        where = as_node_id(at, f"The node of {name}")
    elif at is not None:
        where = tuple(as_numbers(at, name, "(x, y)"))
    agent = None if given.get("agent") is None else as_name(given["agent"], "a jammer")
    return Jammer(as_range(given["radius_m"], f"radius_m of {name}"), agent, as_key(team, name), where)


_CHECKS: dict[str, Any] = {  # keyword -> what checks it
    "range_m": as_range,
    "hops": as_count,
    "line_of_sight": as_flag,
    "relay": _check_relay,
    "loss": _check_loss,
    "delay_turns": as_count,
    "max_bytes_per_turn": as_count,
    "jammers": _check_jammers,
    "teams": _check_teams,
    "eavesdroppers": _check_names,
}


def list_unknown_names(channel: Channel, ctx: HostContext) -> list[str]:
    """Return error texts for agents, teams and nodes that a channel mentions and that do not exist."""
    agents = ctx.agent.agents
    teams = set(ctx.agent.teams)
    graph = ctx.graph.graph
    missing = [one for one in channel.list_named() if one not in teams and one not in agents]
    found = [str(UnknownName("agent or team", one, [*agents, *teams])) for one in sorted(missing, key=str)]
    nodes = [one.at for one in channel.jammers if isinstance(one.at, int) and not graph.has_node(one.at)]
    return found + [str(UnknownName("node of a jammer:", node)) for node in nodes]


# -- outboxes -----------------------------------------------------------------------------------------------------


class Outgoing(NamedTuple):
    """A message that an agent sends."""

    sender: str
    channel: str
    to: Any  # an agent, a team, or None
    body: Plain
    size: int  # bytes


class Sender(Protocol):
    """The agent that owns an outbox."""

    @property
    def name(self) -> str:
        """The name of the agent."""

    @property
    def team(self) -> Any:
        """The team of the agent, any hashable value."""


S = TypeVar("S", bound=Sender)


def check_outboxes(
    outboxes: Iterable[tuple[S, Any]], channels: Mapping[str, Channel], teams: Mapping[str, Any]
) -> tuple[list[Outgoing], list[tuple[S, str]]]:
    """Return the messages that can be sent, and (sender, error text) for each other message.

    Args:
        outboxes: pairs of an agent and the outbox in its state.
        channels: name -> channel.
        teams: agent -> its team, for all agents.
    """
    wanted = dict[tuple[int, int], Outgoing]()
    flaws = dict[tuple[int, int], str]()
    senders = list[S]()
    for place, (sender, outbox) in enumerate(outboxes):
        senders.append(sender)
        if type(outbox) not in (list, tuple):
            flaws[place, 0] = f"BadType: state['outbox'] must be a list of messages, not {shown(outbox)}."
            continue
        for number, given in enumerate(outbox):
            try:
                wanted[place, number] = _check_message(given, sender, channels)
            except Exception as error:  # noqa: BLE001 - a body may be of the caller's own class
                flaws[place, number] = describe_message_flaw(number, error)
    row_of = {name: row for row, name in enumerate(teams)}
    for channel in {one.channel: channels[one.channel] for one in wanted.values()}.values():
        keys = [key for key, one in wanted.items() if one.channel == channel.name]
        messages = [wanted[key] for key in keys]
        if is_accepting_all(channel, [one.to for one in messages]):
            continue
        rows, sizes = (
            np.array(column) for column in ([row_of[one.sender] for one in messages], [one.size for one in messages])
        )
        left = find_byte_limits(channel, (1, len(teams)))
        to = [one.to for one in messages]
        refused = find_refusals(
            channel, (np.zeros_like(rows), rows, to, sizes), np.ones(left.shape, np.bool_), teams, left
        )
        for row, why in refused.items():
            del wanted[keys[row]]
            flaws[keys[row]] = describe_message_flaw(keys[row][1], why)
    return list(wanted.values()), [(senders[place], flaws[place, number]) for place, number in sorted(flaws)]


def describe_message_flaw(number: int, error: Exception) -> str:
    """Return the error text of a message, with its number in the outbox."""
    why = error if isinstance(error, GammsError) else reason(error)
    return f"{type(error).__name__}: state['outbox'][{number}]: {why}"


def find_byte_limits(channel: Channel, shape: tuple[int, ...]) -> IntArray:
    """Return the numbers of bytes that agents may send in a turn, as an array of a shape such as (games, agents)."""
    return np.full(shape, _UNLIMITED if channel.max_bytes_per_turn is None else channel.max_bytes_per_turn, np.int64)


def is_accepting_all(channel: Channel, to: Sequence[Any]) -> bool:
    """Return whether a channel refuses no messages to these recipients from agents that may use it."""
    return channel.max_bytes_per_turn is None and to.count(None) == len(to)


def find_refusals(
    channel: Channel,
    sent: tuple[IntArray, IntArray, Sequence[Any], IntArray],
    is_there: BoolArray,
    teams: Mapping[str, Any],
    left: IntArray,
) -> dict[int, GammsError]:
    """Return message number -> the reason why it cannot be sent.

    Args:
        channel: the channel.
        sent: the games, senders, receivers and sizes of messages, each (messages,).
        is_there: (games, agents) whether the agent is in the game, alive or not.
        teams: agent -> its team.
        left: (games, agents) the numbers of bytes that agents may still send; see `find_byte_limits`.
    """
    at, senders, to, sizes = sent
    if is_accepting_all(channel, to):
        return {}
    uses = np.array([channel.is_for(team) for team in teams.values()], np.uint8)
    verdicts = np.zeros_like(at)
    columns: Any = at, senders, *make_groups(to, teams), uses, is_there.view(np.uint8), sizes, left, verdicts
    core.admit(*map(as_buffer, columns))
    return {
        row: _make_refusal(
            channel, verdicts[row], to[row], sizes[row], dict(compress(teams.items(), is_there[at[row]]))
        )
        for row in np.flatnonzero(verdicts != core.ADMITTED).tolist()
    }


def _make_refusal(channel: Channel, verdict: int, to: Any, size: int, teams: Mapping[str, Any]) -> GammsError:
    """Return the error of a message that cannot be sent, from the verdict of `core.admit`."""
    if verdict == core.UNKNOWN:
        names = sorted(teams)
        named = dict.fromkeys(team for team in map(teams.__getitem__, names) if team is not None)
        return UnknownName("agent or team", to, [*names, *named])
    if verdict == core.FOR_SENDER:
        return BadValue(f"A message to {shown(to)} would come to no agent but its sender.")
    if verdict == core.FOR_OTHERS:
        return BadValue(f"Channel {channel.name!r} is not for {shown(to)}.")
    return BadValue(
        f"Its body has {size} bytes; channel {channel.name!r} takes {channel.max_bytes_per_turn} of each "
        f"agent per turn; {verdict} are left."
    )


def make_groups(to: Sequence[Any], teams: Mapping[str, Any]) -> tuple[IntArray, IntArray, IntArray]:
    """Return the recipients of messages as numbered groups of agents.

    Args:
        to: (messages,) the recipient of each message: an agent, a team, or None.
        teams: agent -> its team.

    Returns:
        The group of each message, -1 for everybody; where each group begins in the members; and the members, as indices
        in `teams`.
    """
    number_of = {one: number for number, one in enumerate(dict.fromkeys([None, *to]), -1)}
    row_of = {name: row for row, name in enumerate(teams)}
    members = list[int]()
    first = [0]
    for one in list(number_of)[1:]:
        members += [row_of[name] for name in find_receivers(one, teams)]
        first.append(len(members))
    groups = list(map(number_of.__getitem__, to))
    return np.array(groups, np.int64), np.array(first, np.int64), np.array(members, np.int64)


def _check_message(given: object, sender: Sender, channels: Mapping[str, Channel]) -> Outgoing:
    message = as_mapping(given, "A message")
    for key in _KEYS:
        if key not in message:
            raise BadValue(f"There is no {key!r}; a message has {', '.join(map(repr, _KEYS))}.")
    for key in message:
        as_known(key, "key of a message:", _KEYS)
    channel = channels.get(as_text(message["channel"], "The channel of a message"))
    if channel is None:
        raise UnknownName("channel", message["channel"], channels)
    refuse_others(channel, sender.team)
    to = as_key(message["to"], "The receiver of a message")
    body = to_plain(as_body(message["body"]))
    return Outgoing(sender.name, channel.name, to_plain(to), body, measure_size(body))


def refuse_others(channel: Channel, team: Hashable) -> None:
    """Raise BadValue if a channel is not for a team."""
    if not channel.is_for(team):
        raise BadValue(f"Channel {channel.name!r} is not for team {shown(team)}.")


def as_body(body: object) -> Any:
    """Return the body of a message.

    Raises:
        BadType: it is not a plain value.
    """
    flaw = describe_flaw(body)
    if flaw:
        raise BadType(f"The body must be a plain value, such as numbers, texts, lists and dicts of these: body{flaw}.")
    return body


def measure_size(body: Plain) -> int:
    """Return the size of a plain value in bytes, when packed."""
    return len(to_bytes(body, "The body of a message"))


def find_receivers(to: Hashable, teams: Mapping[str, Any]) -> Collection[str]:
    """Return the recipients of a message, including the sender.

    Args:
        to: an agent, a team, or None for everybody; the name of an agent takes precedence.
        teams: agent -> its team.
    """
    if to is None:
        return teams.keys()
    if isinstance(to, str) and to in teams:
        return (to,)
    return [name for name, team in teams.items() if team == to]


def find_matching_agents(named: Iterable[Any], names: Iterable[str], teams: Iterable[Any]) -> list[bool]:
    """Return for each agent whether `named` contains its name or its team."""
    wanted = set(named)
    return [name in wanted or team in wanted for name, team in zip(names, teams, strict=True)]
