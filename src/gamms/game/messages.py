"""Messages: find who hears each message, and collect the inboxes of agents.

The outcome of a message is decided when it is sent, after the moves of that turn: the positions of all agents then
determine who is in range, who is jammed, and the route over relays. `MessageTraffic` keeps messages and their outcomes
as tables of columns, for one game and for batches, and makes the entries of logs and inboxes when they are read.
"""

from collections import defaultdict
from collections.abc import Callable, Collection, Hashable, Iterable, Iterator, Mapping, Sequence
from functools import lru_cache, partial
from itertools import pairwise
from operator import attrgetter, itemgetter
from types import MappingProxyType
from typing import Any, NamedTuple, cast

import numpy as np

from gamms import kernels
from gamms.arguments import as_key
from gamms.core import messages as core
from gamms.errors import BadType, BadValue, UnknownName
from gamms.game.channels import (
    Channel,
    Jammer,
    Outgoing,
    as_body,
    check_outboxes,
    describe_message_flaw,
    find_byte_limits,
    find_matching_agents,
    find_receivers,
    find_refusals,
    list_unknown_names,
    make_groups,
    measure_size,
    refuse_others,
)
from gamms.game.movement.legality import IllegalAction
from gamms.game.settings import Settings
from gamms.game.slots import AgentSlot
from gamms.ir.chances import as_chances
from gamms.ir.columns import Failure, GameLog, find_places, join_rows, select_rows
from gamms.ir.game_state import GameState
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.messages import ARRIVALS
from gamms.ir.obstacles import BoolArray
from gamms.kernels.draws import BitArray
from gamms.plain import to_plain
from gamms.readonly import copy_locked, thaw
from gamms.text import shown
from gamms.typing.agent_engine import IAgent
from gamms.typing.context import HostContext
from gamms.typing.on_edges import locate

_SCALARS = frozenset({str, bytes, int, float, bool, type(None)})
ByteArray = np.ndarray[Any, np.dtype[np.uint8]]
ANTENNA = np.array((0.0, 0.0, 1.6))  # the offset from an agent on the ground to its antenna, metres
_AT_ONCE = 1 << 20  # the maximum number of messages times agents per call of the core
UNKNOWN_SIZE = -1  # of a body
_MOST_OF_ONE = 1 << 20  # messages of one agent in a turn
_REPLACED = 1 << 62  # the turn before a log was replaced: after all turns
_ONE = np.zeros(1, np.int64)  # the number of the only game
_NOTHING: Mapping[str, list[Any]] = {}
_MOST_TERMS = 64  # the size of the cache of core channels


class MessagePositions(NamedTuple):
    """The positions of agents after their moves, when messages are sent, in one or several games.

    Attributes:
        teams: agent -> its team, in the order of names.
        keys: (agents,) hashes of the names, for keyed draws.
        turns: (games,) the number of turns played before this one.
        xyz, antennas: (games, agents, 3) the positions of the agents and of their antennas.
        alive: (games, agents) whether the agent is alive.
        send_keys: returns hashes of the seeds, the name of a channel and the names of senders, (games, senders).
        is_within: returns which agents are within a number of edges of transmitters, (transmitters, agents); called
            with the games and the agents of the transmitters, (transmitters,), and the number.
        visible: returns which points, (points, 3), are visible from a point, (3,).
        place_of: returns x and y of a node by its id: a list of one pair, or an empty list.
    """

    teams: Mapping[str, Any]
    keys: BitArray
    turns: IntArray
    xyz: FloatArray
    antennas: FloatArray
    alive: BoolArray
    send_keys: Callable[[str, Sequence[str]], BitArray]
    is_within: Callable[[IntArray, IntArray, int], BoolArray]
    visible: Callable[[FloatArray, FloatArray], BoolArray]
    place_of: Callable[[int], Sequence[Any]]

    @classmethod
    def from_game(cls, ctx: HostContext, agents: Sequence[IAgent], turn: int) -> "MessagePositions":
        """Return the current positions of the living agents of one game."""
        graph = ctx.graph.graph
        block = ctx.agent.block
        ids = [agent.current_node_id for agent in agents]
        xyz = np.zeros((1, len(agents), 3))
        near = dict[tuple[int, int], BoolArray]()
        xyz[0, :, :2] = graph.positions(ids)
        ground = graph.ground(ids)
        xyz[0, :, 2] = 0.0 if ground is None else ground.z
        antennas = xyz + ANTENNA
        for row, agent in enumerate(agents if block.flyers or block.travellers else ()):
            position = getattr(agent, "position", None)
            progress = block.get_edge_position(block.find_row(agent.name))
            place = None if progress is None else locate(graph, progress)
            if position is not None:
                xyz[0, row] = position
                antennas[0, row] = position
            if place is not None:
                xyz[0, row, :2] = place.xy
                antennas[0, row, :2] = place.xy

        def is_within(_: IntArray, transmitters: IntArray, hops: int) -> BoolArray:
            for row in transmitters.tolist():
                if (row, hops) not in near:
                    reached = graph.distances(source=ids[row], weight=None, cutoff=hops)
                    near[row, hops] = np.array([node in reached for node in ids], np.bool_)
            return np.stack([near[row, hops] for row in transmitters.tolist()])

        return cls(
            teams={agent.name: agent.team for agent in agents},
            keys=kernels.compute_name_keys([agent.name for agent in agents]),
            turns=np.array([turn]),
            xyz=xyz,
            antennas=antennas,
            alive=np.ones((1, len(agents)), np.bool_),
            send_keys=lambda channel, names: _send_keys(ctx.seed, channel, tuple(names)),
            is_within=is_within,
            visible=ctx.graph.visible,
            place_of=lambda node: graph.positions([node]).tolist() if graph.has_node(node) else [],
        )


class MessageOutcomes(NamedTuple):
    """The outcomes of messages: one row for each agent that hears or misses a message, by message, then by agent.

    Attributes:
        messages: (rows,) the number of the message.
        agents: (rows,) the number of the agent.
        outcomes: (rows,) `core.HEARD`, `OVERHEARD`, `LOST` or `JAMMED`.
        arrivals: (rows,) the turn, from 1, in which the agent hears the message.
    """

    messages: IntArray
    agents: IntArray
    outcomes: ByteArray
    arrivals: IntArray

    def make_entries(self, names: Sequence[str], num_messages: int) -> Iterator[dict[str, Any]]:
        """Yield, for each message, the part of its log entry about agents that hear or miss it."""
        rows = list(zip(self.agents.tolist(), self.outcomes.tolist(), self.arrivals.tolist(), strict=True))
        for first, last in pairwise(np.searchsorted(self.messages, np.arange(num_messages + 1)).tolist()):
            found: dict[int, dict[str, int]] = {core.HEARD: {}, core.OVERHEARD: {}, core.LOST: {}, core.JAMMED: {}}
            for agent, outcome, turn in rows[first:last]:
                found[outcome][names[agent]] = turn
            heard, overheard, lost, jammed = found.values()
            yield {"heard": heard, "overheard": overheard, "lost": [*lost], "jammed": [*jammed]}


def compute_outcomes(
    channel: Channel, scene: MessagePositions, at: IntArray, senders: IntArray, to: Sequence[Any]
) -> MessageOutcomes:
    """Return the outcomes of messages of one channel.

    Args:
        channel: the channel.
        scene: the positions of the agents.
        at: (messages,) the game of each message in the scene, ascending.
        senders: (messages,) the numbers of the senders.
        to: (messages,) the recipient of each message: an agent, a team, or None.
    """
    network = _Network(channel, scene, senders)
    numbers = np.zeros(len(at), np.int64)
    groups, first, members = make_groups(to, scene.teams)
    if channel.loss:
        core.count_messages(at.data, senders.data, network.rows.data, numbers.data)
    at_once = max(1, _AT_ONCE // len(scene.teams))
    parts = list[MessageOutcomes]()
    for begin in range(0, len(at), at_once):
        part = slice(begin, begin + at_once)
        shape = len(at[part]), len(scene.teams)
        outcomes = np.empty(shape, np.uint8)
        arrivals = np.empty(shape, np.int64)
        written = np.zeros(shape[0], np.uint8), outcomes, arrivals
        columns: Any = at[part], senders[part], groups[part], first, members, numbers[part], *written
        network.spread(core.Messages(*map(kernels.as_buffer, columns)))
        messages, agents = np.nonzero(outcomes)
        parts.append(MessageOutcomes(begin + messages, agents, outcomes[messages, agents], arrivals[messages, agents]))
    return parts[0] if len(parts) == 1 else MessageOutcomes(*map(np.concatenate, zip(*parts, strict=True)))


class _Network:
    """The agents that transmitters reach by a channel.

    Args:
        channel: the channel.
        scene: the positions of the agents.
        senders: the numbers of the senders.

    Attributes:
        rows: working memory.
    """

    def __init__(self, channel: Channel, scene: MessagePositions, senders: IntArray) -> None:
        games, agents = scene.alive.shape
        self._channel = channel
        self._scene = scene
        names = tuple(scene.teams)
        jammers = tuple(place for one in channel.jammers for place in _convert_jammer(one, scene))
        self._terms = _convert_channel(channel, names, tuple(scene.teams.values()), jammers)
        self._purposes = np.zeros((games, agents) if channel.loss else 0, np.uint64)
        if channel.loss:
            sending = np.flatnonzero(np.bincount(senders))
            self._purposes[:, sending] = scene.send_keys(channel.name, [names[i] for i in sending.tolist()])
        self._slots = np.full(games * agents, -1)
        self._awaited = np.zeros(games * agents, np.int64)
        self._reach = np.zeros((0, agents), np.uint8)
        self.rows = np.zeros(3 * agents, np.int64)
        self._bytes = np.zeros((2, agents), np.uint8)

    def spread(self, messages: core.Messages) -> None:
        """Find the outcomes of messages."""
        scene = self._scene
        while True:
            columns = scene.xyz, scene.alive.view(np.uint8), scene.keys, self._purposes, scene.turns
            known = self._slots, self._awaited, self._reach
            network = core.ChannelNetwork(*map(kernels.as_buffer, (*columns, *known, self.rows, *self._bytes)))
            number = core.spread_all(self._terms, network, messages)
            if not number:
                break
            transmitters = self._awaited[:number]
            self._slots[transmitters] = len(self._reach) + np.arange(number)
            self._reach = np.concatenate((self._reach, self._find_reached_agents(network, transmitters)))

    def _find_reached_agents(self, network: core.ChannelNetwork, transmitters: IntArray) -> ByteArray:
        """Return which agents each transmitter reaches, (transmitters, agents)."""
        channel = self._channel
        scene = self._scene
        agents = len(self._scene.teams)
        reach = np.empty((len(transmitters), agents), np.uint8)
        core.find_in_range(self._terms, network, len(reach), kernels.as_buffer(reach))
        at, by = np.divmod(transmitters, agents)
        if channel.hops is not None:
            reach &= scene.is_within(at, by, channel.hops)
        for row, game in enumerate(at.tolist() if channel.line_of_sight else ()):
            near = np.flatnonzero(reach[row])
            if len(near):
                reach[row, near] = scene.visible(scene.antennas[game, by[row]], scene.antennas[game, near])
        return reach


@lru_cache(maxsize=_MOST_TERMS)
def _convert_channel(
    channel: Channel, names: tuple[str, ...], teams: tuple[Any, ...], jammers: tuple[tuple[float, ...], ...]
) -> core.Channel:
    """Return a channel in the form of the core; `_convert_jammer` describes jammers."""
    uses = [channel.is_for(team) for team in teams]
    overhears = find_matching_agents(channel.eavesdroppers, names, teams)
    relays = uses if channel.relay is True else find_matching_agents(channel.relay or (), names, teams)
    weights = np.array((core.USES, core.OVERHEARS, core.RELAYS), np.uint8)
    roles = weights @ np.array((uses, overhears, relays), np.uint8)
    losses = as_chances(channel.loss, "loss") if channel.loss else np.zeros((0, 2))
    places = np.array(jammers).reshape(-1, 5)
    columns = roles, *losses.T, places[:, 0].astype(np.int64), places[:, 1:4], places[:, 4]
    return core.Channel(
        len(names),
        np.inf if channel.range_m is None else channel.range_m,
        channel.delay_turns,
        *map(kernels.as_buffer, columns),
        needs_rows=channel.hops is not None or channel.line_of_sight,
        is_relayed=bool(channel.relay),
    )


@lru_cache(maxsize=_MOST_TERMS)
def _send_keys(seed: int, channel: str, names: tuple[str, ...]) -> BitArray:
    """Return hashes of a seed, a channel and the names of senders, (1, senders)."""
    return copy_locked(kernels.compute_purpose_keys([seed], [("channel", channel, name) for name in names]))


def _convert_jammer(jammer: Jammer, scene: MessagePositions) -> list[tuple[float, ...]]:
    """Return a jammer as tuples: the number of an agent, or -1 with x, y and z of a place; and the radius."""
    if jammer.at is None:
        wanted, known = (jammer.team, scene.teams.values()) if jammer.agent is None else (jammer.agent, scene.teams)
        return [(row, 0.0, 0.0, 0.0, jammer.radius_m) for row, one in enumerate(known) if one == wanted]
    places = [jammer.at] if isinstance(jammer.at, tuple) else scene.place_of(jammer.at)
    return [(-1, x, y, 0.0, jammer.radius_m) for x, y in places]


# -- storage ------------------------------------------------------------------------------------------------------


class OutgoingMessages(NamedTuple):
    """Messages that agents send together by one channel; arrays are (messages,).

    Attributes:
        channel: the name of the channel.
        at: the game of each message, as a number in the storage; -1: the messages of the game were dropped.
        senders: the number of the sender in `names`; -1: it is not in the game any more.
        to: the recipient: an agent, a team, or None.
        bodies: the bodies.
        sizes: the sizes of the bodies, bytes; -1: unknown.
        are_plain: whether body and recipient were converted by `to_plain`.
        order: orders the messages of one agent; `MessageTraffic.admit` adds a multiple of 2**20 for its number in the
            turn.
        names: the names of the agents, by number.
    """

    channel: str
    at: IntArray
    senders: IntArray
    to: list[Any]
    bodies: list[Any]
    sizes: IntArray
    are_plain: BoolArray
    order: IntArray
    names: tuple[str, ...]

    def renumber(self, names: tuple[str, ...]) -> "OutgoingMessages":
        """Return the same messages with the numbers of the senders among other names."""
        if names == self.names:
            return self
        return self._replace(senders=number_names(self.names, names)[self.senders], names=names)


class ReceivedMessages(NamedTuple):
    """The messages in the inboxes of the agents of a view, by game, then by agent, then in the order of sending.

    Attributes:
        at: (messages,) the game, as an index in the view.
        hearers: (messages,) the agent, as an index in the view.
        senders: (messages,) the number of the sender in the roster; -1: it is not in the roster any more.
        bodies: (messages,) the bodies; read-only.
        turns: (messages,) the number of turns played when the message was sent.
        overheard: (messages,) whether the message was for other agents.
    """

    at: IntArray
    hearers: IntArray
    senders: IntArray
    bodies: list[Any]
    turns: IntArray
    overheard: BoolArray


class _ReceivedMessage(NamedTuple):
    """A message as agents hear it.

    Attributes:
        turn, place: orders messages by sending.
        message: the entry of an inbox.
        copy: copies its body for each recipient; None: the body is immutable.
    """

    turn: int
    place: int
    message: dict[str, Any]
    copy: Callable[[Any], Any] | None

    def overhear(self) -> "_ReceivedMessage":
        """Return the same message for an agent that it is not for."""
        return self._replace(message=self.message | {"overheard": True})


class SentMessages:
    """Sent messages of one channel, and their outcomes.

    Attributes:
        box: the messages.
        turns: (messages,) the turn of each message, from 1.
        place: (messages,) orders the messages of one game and turn.
        fates: the outcomes of the messages.
    """

    __slots__ = ("_received", "box", "fates", "place", "turns")

    def __init__(self, box: OutgoingMessages, turns: IntArray, place: IntArray, fates: MessageOutcomes) -> None:
        self.box = box
        self.turns = turns
        self.place = place
        self.fates = fates
        self._received: dict[tuple[int, int], dict[str, list[_ReceivedMessage]]] | None = None

    def forget(self, games: IntArray) -> "SentMessages":
        """Return these messages without those of some games."""
        at = np.where(np.isin(self.box.at, games), -1, self.box.at)
        return SentMessages(self.box._replace(at=at), self.turns, self.place, self.fates)

    def get_received(self, game: int, turn: int) -> "Mapping[str, list[_ReceivedMessage]]":
        """Return agent -> the messages that it hears, in order, for agents of a game that hear some in a turn."""
        if self._received is None:
            self._received = self._find_received()
        return self._received.get((game, turn), _NOTHING)

    def forget_received(self) -> None:
        """Drop the messages that were made for inboxes."""
        self._received = None

    def _find_received(self) -> "dict[tuple[int, int], dict[str, list[_ReceivedMessage]]]":
        """Return (game, turn) -> agent -> the messages that it hears, in order."""
        box = self.box
        found = defaultdict[tuple[int, int], dict[str, list[_ReceivedMessage]]](partial(defaultdict, list))
        columns = [column.tolist() for column in (box.at, self.turns, self.place, box.senders)]
        names = box.names
        heard_it = core.HEARD
        known = -1
        for number, agent, outcome, arrival in zip(*(column.tolist() for column in self.fates), strict=True):
            if not arrival:
                continue
            if known != number:
                game, turn, place, sender = (column[number] for column in columns)
                to, body = self.make_plain(number)
                message = {"channel": box.channel, "sender": names[sender], "to": to, "body": body}
                message |= {"turn": turn - 1, "overheard": False}
                heard = _ReceivedMessage(turn, place, message, _make_copier(body))
                known = number
                of_turn = 0
            if of_turn != arrival:
                by_name = found[game, arrival]
                of_turn = arrival
            by_name[names[agent]].append(heard if outcome == heard_it else heard.overhear())
        return found

    def make_plain(self, message: int) -> tuple[Any, Any]:
        """Return the recipient and the body of a message as plain values."""
        to, body = self.box.to[message], self.box.bodies[message]
        return (to, body) if self.box.are_plain[message] else (to_plain(to), to_plain(body))

    def list_entries(self) -> Iterator[tuple[int, int, dict[str, Any]]]:
        """Yield (game, place, log entry) for each message."""
        box = self.box
        columns = box.at.tolist(), self.place.tolist(), self.turns.tolist(), box.senders.tolist(), box.sizes.tolist()
        fates = self.fates.make_entries(box.names, len(box.at))
        for number, (game, place, turn, sender, size, fate) in enumerate(zip(*columns, fates, strict=True)):
            to, body = self.make_plain(number)
            yield (
                game,
                place,
                {
                    "turn": turn,
                    "channel": box.channel,
                    "sender": box.names[sender],
                    "to": to,
                    "body": body,
                    "size": measure_size(body) if size == UNKNOWN_SIZE else size,
                    **fate,
                },
            )


class UnderWay(NamedTuple):
    """The messages of one game that are under way; a value of its state, which snapshots and copies share.

    Attributes:
        turn: the number of turns that were played.
        logged, last: the number of messages in the log, and the last one; None: it is not written yet.
        sent: pairs of remaining turns and messages.
    """

    turn: int
    logged: int
    last: dict[str, Any] | None
    sent: tuple[tuple[int, SentMessages], ...]

    def is_of(self, log: Sequence[dict[str, Any]]) -> bool:
        """Return whether a log is the one of these messages."""
        return len(log) == self.logged and self.is_beginning_of(log)

    def is_beginning_of(self, log: Sequence[dict[str, Any]]) -> bool:
        """Return whether these messages are the first entries of a log; logs are only appended to and truncated."""
        return not self.logged or (len(log) >= self.logged and log[self.logged - 1] is self.last)


_NONE_UNDER_WAY = UnderWay(0, 0, None, ())


class MessageTraffic(GameLog[list[SentMessages]]):
    """The messages of games that play by the same channels: of one game, or of a batch.

    In each turn, `post` and `post_checked` collect messages, `admit` refuses messages that the channels do not accept,
    and `send` determines the receivers of the others after all agents have moved. Sent messages are a table of columns;
    log entries and inboxes are made from it.

    Args:
        channels: the channels by name.
        teams: agent -> its team, for all agents of every game.
        part_of: (agents,) the part of the turn in which each agent decides.
        num_games: the number of games.
        departed: deleted agent -> its team, for agents that `teams` lacks.

    Attributes:
        channels, teams: see the arguments.
        names: the names of the agents, by number.
    """

    def __init__(
        self,
        channels: Mapping[str, Channel],
        teams: Mapping[str, Any],
        part_of: IntArray,
        num_games: int,
        departed: Mapping[str, Any] = MappingProxyType({}),
    ) -> None:
        super().__init__(num_games)
        self._departed = departed
        self.channels = channels
        self.teams = teams
        self.names = tuple(teams)
        self._part_of = part_of
        self._under_way: tuple[tuple[int, SentMessages], ...] = ()  # (remaining turns, messages)
        self.begin_turn()

    # -- sending ------------------------------------------------------------------------------------------------

    def begin_turn(self) -> None:
        """Drop posted messages that were not sent."""
        self._posted: list[OutgoingMessages] = []
        self._admitted: list[OutgoingMessages] = []
        self._admissions = 0  # of the turn
        self._first_admitted = 0  # the first outbox of the last admission
        self._checked: dict[str, list[tuple[int, Outgoing, int]]] = {}  # by channel: the game, and the order
        self._flaws: list[Failure] = []

    def check_messages(
        self, channel: str, where: BoolArray, who: tuple[IntArray, IntArray], to: object, body: object, order: int
    ) -> OutgoingMessages:
        """Return the checked messages of a call of `ArrayView.send`.

        `who` are the numbers of the games and of the agents; `order` is the number of the call.
        """
        if as_key(channel, "The name of a channel") not in self.channels:
            raise UnknownName("channel", channel, self.channels)
        games, agents = who
        at, which = np.nonzero(where)
        senders = agents[which]
        self._refuse_other_teams(self.channels[channel], senders)
        receivers: list[Any] = [to] * len(at)
        if isinstance(to, np.ndarray):
            receivers = self._list_receiver_names(to, where.shape)[at, which].tolist()
        elif to is not None and not find_receivers(_as_key(to), {**self._departed, **self.teams}):
            raise UnknownName("agent or team", to, [*self.teams, *dict.fromkeys(self.teams.values())])
        if isinstance(body, np.ndarray) and body.shape[:2] != where.shape:
            raise BadValue(
                f"The first axes of an array of bodies are {where.shape}, games and agents: not {body.shape}."
            )
        bodies = body[at, which].tolist() if isinstance(body, np.ndarray) else [body] * len(at)
        for one in bodies if isinstance(body, np.ndarray) and body.dtype == object else [body] * (len(at) > 0):
            if not isinstance(one, np.ndarray):
                as_body(one)
        sizes = np.full(len(at), UNKNOWN_SIZE)
        orders = np.full(len(at), order)
        are_plain = np.zeros(len(at), np.bool_)
        return OutgoingMessages(channel, games[at], senders, receivers, bodies, sizes, are_plain, orders, self.names)

    def _refuse_other_teams(self, channel: Channel, senders: IntArray) -> None:
        """Raise BadValue if a channel is not for the team of a sender."""
        if channel.teams is None:
            return
        sending = {self.teams[self.names[number]] for number in np.unique(senders).tolist()}
        for team in dict.fromkeys(self.teams.values()) if sending else ():
            if team in sending:
                refuse_others(channel, team)

    def _list_receiver_names(self, to: np.ndarray[Any, Any], shape: tuple[int, ...]) -> np.ndarray[Any, Any]:
        """Return the names of receivers, (games, agents), from their numbers."""
        names = np.array(self.names, object)
        if to.dtype.kind not in "iu" or to.shape not in (shape, shape[1:], ()) or ((to < 0) | (to >= len(names))).any():
            raise BadValue(
                f"Receivers of messages are numbers of agents from 0 to {len(names) - 1}, an array {shape}, not "
                f"{shown(to)}."
            )
        return np.broadcast_to(names[to], shape)

    def post(self, boxes: Iterable[OutgoingMessages]) -> None:
        """Add messages of this turn; `admit` checks later whether the channels accept them.

        The senders of one outbox decide in the same part of the turn.
        """
        self._posted += [box for box in boxes if len(box.at)]

    def post_checked(self, game: int, messages: Sequence[Outgoing], flaws: Iterable[Failure] = ()) -> None:
        """Add messages of a game that the channels accept, and the errors of other messages."""
        for order, one in enumerate(messages):
            self._checked.setdefault(one.channel, []).append((game, one, order))
        self._flaws += flaws

    def admit(self, part: int, is_there: BoolArray) -> list[Failure]:
        """Check the posted messages of a part of the turn; return the errors of refused messages, by game and agent.

        Args:
            part: the part of the turn.
            is_there: (games, agents) whether the agent is in the game, dead or alive.
        """
        here = [box for box in self._posted if self._part_of[box.senders[0]] == part]
        self._posted = [box for box in self._posted if self._part_of[box.senders[0]] != part]
        first = len(self._admitted)
        flaws = self._flaws + self._take_posted(here, is_there)
        self._flaws = []
        self.admit_checked()
        self._first_admitted = first
        return sorted(flaws, key=attrgetter("game", "agent"))

    def admit_checked(self) -> None:
        """Admit the messages that were checked when they were posted."""
        self._first_admitted = len(self._admitted)
        first = self._admissions * _MOST_OF_ONE
        number_of = {name: number for number, name in enumerate(self.names)}
        for channel, rows in self._checked.items():
            games, messages, orders = zip(*rows, strict=True)
            names, _, to, bodies, sizes = zip(*messages, strict=True)
            columns = games, [*map(number_of.__getitem__, names)], sizes, orders
            at, senders, packed, order = np.array(columns, np.int64)
            are_plain = np.ones(len(rows), np.bool_)
            box = OutgoingMessages(channel, at, senders, [*to], [*bodies], packed, are_plain, order + first, self.names)
            self._admitted.append(box)
        self._checked = {}
        self._admissions += 1

    def move_admitted(self, game: int, target: "MessageTraffic") -> None:
        """Copy the messages that a game has admitted in this turn to the storage of a single game, which sends them."""
        target._admissions = self._admissions
        of_game = [select_rows(box, box.at == game) for box in self._admitted]
        moved = [box._replace(at=np.zeros_like(box.at)) for box in of_game if len(box.at)]
        target._admitted = [box.renumber(target.names) for box in moved]

    def withdraw(self, failed: Collection[tuple[int, int]]) -> None:
        """Drop the messages of the last admission by agents whose action failed, given as (game, agent) pairs."""
        for number, box in enumerate(self._admitted[self._first_admitted :], self._first_admitted):
            senders = zip(box.at.tolist(), box.senders.tolist(), strict=True)
            self._admitted[number] = select_rows(box, np.array([one not in failed for one in senders], np.bool_))

    def _take_posted(self, boxes: Sequence[OutgoingMessages], is_there: BoolArray) -> list[Failure]:
        """Admit posted messages that the channels accept; return the errors of the others."""
        flaws = list[Failure]()
        place = np.zeros(is_there.shape, np.int64)
        left = {name: find_byte_limits(one, is_there.shape) for name, one in self.channels.items()}
        for box in boxes:
            channel = self.channels[box.channel]
            if channel.max_bytes_per_turn is not None:
                by_id = {id(body): body for body in box.bodies}
                size_by_id = {key: measure_size(to_plain(body)) for key, body in by_id.items()}
                box.sizes[:] = [size_by_id[id(body)] for body in box.bodies]
            sent = box.at, box.senders, box.to, np.maximum(box.sizes, 0)
            errors = find_refusals(channel, sent, is_there, self.teams, left[box.channel])
            for row, error in errors.items():
                game = int(box.at[row])
                sender = int(box.senders[row])
                flaws.append(Failure.make_illegal(game, sender, describe_message_flaw(int(place[game, sender]), error)))
            place[box.at, box.senders] += 1
            box.order[:] += self._admissions * _MOST_OF_ONE
            self._admitted.append(select_rows(box, ~np.isin(np.arange(len(box.at)), [*errors])) if errors else box)
        return flaws

    @property
    def is_sending(self) -> bool:
        """Return whether there are messages to send in this turn."""
        return len(self._admitted) > 0

    def send(self, games: IntArray, scene: MessagePositions) -> None:
        """Find the outcomes of the messages of these games; messages of dead agents are dropped."""
        number = find_places(games, self._num_games)
        names = tuple(scene.teams)
        sent = list[SentMessages]()
        for name in self.channels:
            boxes = [box.renumber(names) for box in self._admitted if box.channel == name]
            if not boxes:
                continue
            box = join_rows(boxes)
            at = number[box.at]
            those = np.flatnonzero((at >= 0) & (box.senders >= 0))  # of deleted senders there are none in the scene
            those = those[scene.alive[at[those], box.senders[those]]]
            if not len(those):
                continue
            admission, order = np.divmod(box.order[those], _MOST_OF_ONE)
            place = (admission * len(names) + box.senders[those]) * _MOST_OF_ONE + order
            by_place = np.lexsort((place, at[those]))
            box = select_rows(box, those[by_place])
            at = number[box.at]
            fates = compute_outcomes(self.channels[name], scene, at, box.senders, box.to)
            sent.append(SentMessages(box, scene.turns[at] + 1, place[by_place], fates))
        self._pending.append(sent)
        left = [int((one.fates.arrivals - one.turns[one.fates.messages]).max(initial=0)) for one in sent]
        self._under_way += (*zip(left, sent, strict=True),)

    def end_turns(self, turns: int) -> None:
        """Drop messages that have arrived in all games when these have played some more turns."""
        for left, sent in self._under_way:
            if left < turns:
                sent.forget_received()
        self._under_way = (*((left - turns, sent) for left, sent in self._under_way if left >= turns),)

    # -- hearing ------------------------------------------------------------------------------------------------

    def share(self, teams: Mapping[str, Any], part_of: IntArray, departed: Mapping[str, Any]) -> "MessageTraffic":
        """Return the messages that are under way for agents with other numbers, see the arguments of the class."""
        found = MessageTraffic(self.channels, teams, part_of, self._num_games, departed)
        found._under_way = self._under_way
        return found

    def find_heard(
        self, channel: str, games: IntArray, turns: IntArray, agents: IntArray, asked: BoolArray
    ) -> ReceivedMessages:
        """Return the messages that agents hear by a channel in the next turn; see `ReceivedMessages`."""
        if as_key(channel, "The name of a channel") not in self.channels:
            raise UnknownName("channel", channel, self.channels)
        none = np.zeros(0, np.int64)
        found = [ReceivedMessages(none, none, none, [], none, none > 0)]
        places = [none]
        number = find_places(games, self._num_games + 1)  # the last entry, index -1, is for dropped games
        column = find_places(agents, len(self.names) + 1)  # the last entry, index -1, is for unknown agents
        for _, sent in self._under_way:
            if sent.box.channel != channel:
                continue
            fates = sent.fates
            box = sent.box.renumber(self.names)
            known = fates.agents
            if box is not sent.box:
                known = number_names(sent.box.names, self.names)[known]
            at = number[box.at[fates.messages]]
            hearers = column[known]
            arrives = (at >= 0) & (hearers >= 0) & (fates.arrivals == turns[at] + 1)
            rows = np.flatnonzero(arrives & asked[at, hearers])
            which = fates.messages[rows]
            overheard = fates.outcomes[rows] == core.OVERHEARD
            bodies = [box.bodies[message] for message in which.tolist()]
            found.append(
                ReceivedMessages(at[rows], hearers[rows], box.senders[which], bodies, sent.turns[which] - 1, overheard)
            )
            places.append(sent.place[which])
        heard = join_rows(found)
        keys = heard.overheard, np.concatenate(places), heard.turns, heard.hearers, heard.at
        return select_rows(heard, np.lexsort(keys))

    def make_inbox(self, game: int, turn: int, name: str) -> list[dict[str, Any]]:
        """Return the messages that an agent of a game hears after some turns, in the order of sending."""
        heard = list[_ReceivedMessage]()
        channels = 0
        for _, sent in self._under_way:
            found = sent.get_received(game, turn + 1).get(name)
            if found and sent.box.channel in self.channels:
                heard += found
                channels += 1
        if channels > 1:
            heard.sort(key=itemgetter(0, 1))
        inbox = list[dict[str, Any]]()
        for _, _, known, copy in heard:
            message = known.copy()
            if copy is not None:
                message["body"] = copy(message["body"])
            inbox.append(message)
        return inbox

    # -- the log ------------------------------------------------------------------------------------------------

    def go_on(self, games: IntArray, entries: Sequence[dict[str, Any]], turn: int) -> None:
        """Start the empty logs of games after `turn` turns with earlier messages; some may still have to arrive."""
        self.begin(games, entries)
        self.put_under_way(games, entries, turn)

    def put_under_way(self, games: IntArray, entries: Iterable[dict[str, Any]], turn: int) -> None:
        """Put logged messages that some agents hear after `turn` turns under way again."""
        waiting: dict[str, list[tuple[int, dict[str, Any]]]] = {}
        for place, entry in enumerate(entries):
            if _find_last_arrival(entry) > turn:
                waiting.setdefault(entry["channel"], []).append((place, entry))
        for channel, rows in waiting.items():
            last = max(_find_last_arrival(entry) for _, entry in rows)
            self._under_way += ((last - turn - 1, _repeat_message(channel, games, rows)),)

    def renew_under_way(self, game: int, entries: Sequence[dict[str, Any]], turn: int) -> None:
        """Put those messages of a game under way that are logged and that some agents hear after `turn` turns."""
        games = np.array([game])
        self._under_way = (*((left, sent.forget(games)) for left, sent in self._under_way),)
        self.put_under_way(games, entries, turn)

    def forget(self, games: IntArray) -> None:
        """Drop the messages of some games."""
        super().forget(games)
        self._under_way = (*((left, sent.forget(games)) for left, sent in self._under_way),)

    def clear(self) -> None:
        """Drop the messages of all games."""
        super().clear()
        self._under_way = ()

    def checkpoint(self) -> Callable[[], None]:
        """Return a function that undoes all later changes."""
        undo_log = super().checkpoint()
        under_way = self._under_way

        def undo() -> None:
            undo_log()
            self._under_way = under_way

        return undo

    def _list_entries(self, noted: list[SentMessages]) -> Iterator[tuple[int, dict[str, Any]]]:
        rows = [row for sent in noted for row in sent.list_entries()]
        for game, _, entry in sorted(rows, key=itemgetter(0, 1)):
            yield game, entry


class GameMessages(MessageTraffic):
    """The messages of one game, whose agents and channels come and go.

    Their log is the one in the state of the game, which snapshots, replays and copies may cut, lengthen or replace.

    Args:
        ctx: the context, for its agents.
        settings: the settings of the game.
        state: the state of the game.
    """

    def __init__(self, ctx: HostContext, settings: Settings, state: GameState) -> None:
        super().__init__({}, {}, _ONE, 1)
        self._ctx = ctx
        self._settings = settings
        self._state = state
        self._known_channels: list[Channel] = []  # channels whose names were checked
        self._found: UnderWay | None = None  # in the state at the last call

    def take(self, slots: Iterable[AgentSlot], names: Sequence[str]) -> list[tuple[AgentSlot, str]]:
        """Collect the outboxes of agents; return (slot, error text) for each message that cannot be sent.

        Args:
            slots: the slots of the agents.
            names: the names of all agents, in order.

        Raises:
            IllegalAction: a message cannot be sent, and `on_illegal` is "raise".
        """
        self._warn_of_unknown_names()
        messages, unsent = read_outboxes(self._ctx, self._settings, slots)
        if unsent and self._settings.on_illegal == "raise":
            raise IllegalAction(f"Agent {shown(unsent[0][0].name)} in turn {self._state.turn}: {unsent[0][1]}")
        if messages:
            self.names = tuple(names)
            self.post_checked(0, messages)
            self.admit_checked()
        return unsent

    def send_all(self, agents: Sequence[IAgent]) -> None:
        """Send the collected messages to the living agents, after all agents have moved."""
        self.follow()
        self._state.unlogged = self  # before there are any: a turn that is taken back drops them
        self.send(_ONE, MessagePositions.from_game(self._ctx, agents, self._state.turn))
        self.begin_turn()
        self._note(self._state.turn, self._of_game[0])

    def get_received(self, name: str) -> list[dict[str, Any]]:
        """Return the messages that an agent hears in the next turn, in the order of sending."""
        self.follow()
        return self.make_inbox(0, self._state.turn, name)

    def follow(self) -> None:
        """Notice other channels, and another log or turn after a snapshot, a replay or a copy."""
        state = self._state
        turn = state.turn
        self.channels = self._settings.channels
        log = self._of_game[0] if self._pending else state.messages
        found: UnderWay | None = state.under_way
        if found is not None and found is self._found and found.turn == turn and (self._pending or found.is_of(log)):
            return
        if found is None or found.turn > turn or not (self._pending or found.is_beginning_of(log)):
            found = _NONE_UNDER_WAY._replace(turn=turn)
        self._of_game[0] = log
        self._under_way = found.sent
        self.end_turns(turn - found.turn)
        if not self._pending:
            self.put_under_way(_ONE, log[found.logged :], turn)
        self._note(turn, log)

    def write(self) -> None:
        """Write sent messages into the log."""
        self._state.unlogged = None
        log = self.list_entries(0)
        if self._state.under_way is self._found:  # else a snapshot is being restored
            self._note(self._found.turn if self._found else 0, log)

    def drop(self) -> None:
        """Drop sent messages that are not in the log, which is replaced."""
        self._state.unlogged = None
        self._pending.clear()
        if self._state.under_way is self._found:  # else a snapshot is being restored
            self._state.under_way = None

    def _note(self, turn: int, log: Sequence[dict[str, Any]]) -> None:
        """Store the messages under way in the state of the game, with the length and the last entry of their log."""
        unlogged = sum(len(one.box.at) for sent in self._pending for one in sent)
        last = log[-1] if log and not unlogged else None
        self._found = UnderWay(turn, len(log) + unlogged, last, self._under_way)
        self._state.under_way = self._found

    def _warn_of_unknown_names(self) -> None:
        for channel in self._settings.channels.values():
            if channel not in self._known_channels:
                for flaw in list_unknown_names(channel, self._ctx):
                    self._ctx.logger.warning(f"{channel.name}: {flaw}")
        self._known_channels = list(self._settings.channels.values())


def read_outboxes(
    ctx: HostContext, settings: Settings, slots: Iterable[AgentSlot]
) -> tuple[list[Outgoing], list[tuple[AgentSlot, str]]]:
    """Return the messages in the outboxes of agents, and (slot, error text) for each message that cannot be sent."""
    teams = {one.name: one.team for one in ctx.agent.create_iter()}
    outboxes = [(slot, slot.last[0].get("outbox", ())) for slot in slots]
    return check_outboxes([one for one in outboxes if one[1] != []], settings.channels, teams)


def number_names(names: Sequence[str], others: Sequence[str]) -> IntArray:
    """Return the number of each name among other names, and -1 at the end and for names that are not there."""
    number_of = {name: number for number, name in enumerate(others)}
    return np.array([*(number_of.get(name, -1) for name in names), -1], np.int64)


def _find_last_arrival(entry: Mapping[str, Any]) -> int:
    """Return the turn in which the last agent hears a logged message; 0: none does."""
    return max((turn for key in ARRIVALS for turn in entry[key].values()), default=0)


def _repeat_message(channel: str, games: IntArray, rows: Sequence[tuple[int, dict[str, Any]]]) -> SentMessages:
    """Return logged messages of a channel in each of some games, given with their places."""
    entries = [entry for _, entry in rows]
    arrivals = [
        (number, name, outcome, turn)
        for number, entry in enumerate(entries)
        for outcome, key in ((core.HEARD, "heard"), (core.OVERHEARD, "overheard"))
        for name, turn in entry[key].items()
    ]
    numbers, hearers, outcomes, turns = zip(*arrivals, strict=True)
    names = tuple(dict.fromkeys((*(entry["sender"] for entry in entries), *hearers)))
    number_of = {name: number for number, name in enumerate(names)}

    def repeat(values: Iterable[Any]) -> IntArray:
        return np.tile(np.array([*values], np.int64), len(games))

    first = np.repeat(np.arange(len(games)) * len(entries), len(arrivals))
    agents = repeat(map(number_of.__getitem__, hearers))
    fates = MessageOutcomes(first + repeat(numbers), agents, repeat(outcomes).astype(np.uint8), repeat(turns))
    box = OutgoingMessages(
        channel,
        np.repeat(games, len(entries)),
        repeat(number_of[entry["sender"]] for entry in entries),
        [entry["to"] for entry in entries] * len(games),
        [entry["body"] for entry in entries] * len(games),
        repeat(entry["size"] for entry in entries),
        np.ones(len(games) * len(entries), np.bool_),
        repeat(range(len(entries))),
        names,
    )
    return SentMessages(box, repeat(entry["turn"] for entry in entries), repeat(place for place, _ in rows), fates)


def _make_copier(body: Any) -> Callable[[Any], Any] | None:
    """Return a function that copies a body for each recipient; None if the body is immutable."""
    kind = type(body)
    if kind in _SCALARS:
        return None
    # NOTE: a flat body is copied for each of many that hear it in a tenth of the time (benchmarks: messages).
    if kind in (list, dict) and _SCALARS.issuperset(map(type, body.values() if kind is dict else body)):
        return cast("Callable[[Any], Any]", kind.copy)
    return thaw


def _as_key(to: object) -> Hashable:
    if not isinstance(to, Hashable):
        raise BadType(f"The receiver of a message is an agent, a team or None, not {shown(to)}.")
    return to
