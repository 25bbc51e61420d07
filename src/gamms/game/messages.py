"""Messages: find who hears each message, and collect the inboxes of agents.

The outcome of a message is decided when it is sent, after the moves of that turn: the positions of all agents then
determine who is in range, who is jammed, and the route over relays. Thus one entry in the log of a game describes the
outcome of a message, and messages under way follow from the log.
"""

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from itertools import pairwise
from typing import Any, NamedTuple, cast

import numpy as np

from gamms import kernels
from gamms.core import messages as core
from gamms.game.channels import Channel, Jammer, Outgoing, checked_outboxes, groups_of, matching, unknown_in
from gamms.game.movement.legality import IllegalAction
from gamms.game.settings import Settings
from gamms.game.slots import AgentSlot
from gamms.ir.chances import as_chances
from gamms.ir.game_state import GameState
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.messages import ARRIVALS
from gamms.ir.obstacles import BoolArray
from gamms.kernels.draws import BitArray
from gamms.readonly import copied
from gamms.text import shown
from gamms.typing.agent_engine import IAgent
from gamms.typing.context import HostContext
from gamms.typing.on_edges import located

_SCALARS = frozenset({str, bytes, int, float, bool, type(None)})
ByteArray = np.ndarray[Any, np.dtype[np.uint8]]
ANTENNA = np.array((0.0, 0.0, 1.6))  # the offset from an agent on the ground to its antenna, metres
_AT_ONCE = 1 << 20  # the maximum number of messages times agents per call of the core
_MOST_TERMS = 64  # the size of the cache of core channels


class MessagePositions(NamedTuple):
    """The positions of agents after their moves, when messages are sent, in one or several games.

    Attributes:
        teams: agent -> its team, in the order of names.
        keys: (agents,) hashes of the names, for keyed draws.
        turns: (games,) the number of turns played before this one.
        xyz, antennas: (games, agents, 3) the positions of the agents and of their antennas.
        alive: (games, agents) whether the agent is alive.
        purposes: returns hashes of the seeds and a purpose, (games,).
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
    purposes: Callable[..., BitArray]
    is_within: Callable[[IntArray, IntArray, int], BoolArray]
    visible: Callable[[FloatArray, FloatArray], BoolArray]
    place_of: Callable[[int], Sequence[Any]]

    @classmethod
    def of(cls, ctx: HostContext, agents: Sequence[IAgent], turn: int) -> "MessagePositions":
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
            progress = block.on_edge(block.row_of(agent.name))
            place = None if progress is None else located(graph, progress)
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
            keys=kernels.name_keys([agent.name for agent in agents]),
            turns=np.array([turn]),
            xyz=xyz,
            antennas=antennas,
            alive=np.ones((1, len(agents)), np.bool_),
            purposes=lambda *purpose: np.array([kernels.purpose_key(ctx.seed, *purpose)], np.uint64),
            is_within=is_within,
            visible=ctx.graph.visible,
            place_of=lambda node: graph.positions([node]).tolist() if graph.has_node(node) else [],
        )


def sent(ctx: HostContext, agents: Sequence[IAgent], outgoing: Sequence[Outgoing], turn: int) -> list[dict[str, Any]]:
    """Return the log entries of messages that are sent now.

    Args:
        ctx: the context, for its map and channels.
        agents: the living agents, in the order of names.
        outgoing: the messages; those of dead senders are dropped.
        turn: the number of turns played before this one.
    """
    row_of = {agent.name: row for row, agent in enumerate(agents)}
    channels = ctx.game.channels
    going = [one for one in outgoing if one.channel in channels and one.sender in row_of]
    if not going:
        return []
    scene = MessagePositions.of(ctx, agents, turn)
    fates = dict[str, Iterator[dict[str, Any]]]()
    for name in dict.fromkeys(one.channel for one in going):
        messages = [one for one in going if one.channel == name]
        senders = np.array([row_of[one.sender] for one in messages])
        found = outcomes_of(channels[name], scene, np.zeros_like(senders), senders, [one.to for one in messages])
        fates[name] = found.entries(list(row_of), len(messages))
    return [entry_of(one, turn + 1, next(fates[one.channel])) for one in going]


def entry_of(message: Outgoing, turn: int, fate: Mapping[str, Any]) -> dict[str, Any]:
    """Return the log entry of a message that is sent in a turn, from 1; see `MessageOutcomes.entries` for its fate."""
    sender, channel, to, body, size = message
    return {"turn": turn, "channel": channel, "sender": sender, "to": to, "body": body, "size": size, **fate}


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

    def entries(self, names: Sequence[str], num_messages: int) -> Iterator[dict[str, Any]]:
        """Yield, for each message, the part of its log entry about agents that hear or miss it."""
        rows = list(zip(self.agents.tolist(), self.outcomes.tolist(), self.arrivals.tolist(), strict=True))
        for first, last in pairwise(np.searchsorted(self.messages, np.arange(num_messages + 1)).tolist()):
            found: dict[int, dict[str, int]] = {core.HEARD: {}, core.OVERHEARD: {}, core.LOST: {}, core.JAMMED: {}}
            for agent, outcome, turn in rows[first:last]:
                found[outcome][names[agent]] = turn
            heard, overheard, lost, jammed = found.values()
            yield {"heard": heard, "overheard": overheard, "lost": [*lost], "jammed": [*jammed]}


def outcomes_of(
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
    groups, first, members = groups_of(to, scene.teams)
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
        network.spread(core.Messages(*map(kernels.buffer, columns)))
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
        jammers = tuple(place for one in channel.jammers for place in _places_of(one, scene))
        self._terms = _terms_of(channel, names, tuple(scene.teams.values()), jammers)
        self._purposes = np.zeros((games, agents) if channel.loss else 0, np.uint64)
        for sender in np.unique(senders).tolist() if channel.loss else ():
            self._purposes[:, sender] = scene.purposes("channel", channel.name, names[sender])
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
            network = core.ChannelNetwork(*map(kernels.buffer, (*columns, *known, self.rows, *self._bytes)))
            number = core.spread_all(self._terms, network, messages)
            if not number:
                break
            transmitters = self._awaited[:number]
            self._slots[transmitters] = len(self._reach) + np.arange(number)
            self._reach = np.concatenate((self._reach, self._reached(network, transmitters)))

    def _reached(self, network: core.ChannelNetwork, transmitters: IntArray) -> ByteArray:
        """Return which agents each transmitter reaches, (transmitters, agents)."""
        channel = self._channel
        scene = self._scene
        agents = len(self._scene.teams)
        reach = np.empty((len(transmitters), agents), np.uint8)
        core.find_in_range(self._terms, network, len(reach), kernels.buffer(reach))
        at, by = np.divmod(transmitters, agents)
        if channel.hops is not None:
            reach &= scene.is_within(at, by, channel.hops)
        for row, game in enumerate(at.tolist() if channel.line_of_sight else ()):
            near = np.flatnonzero(reach[row])
            if len(near):
                reach[row, near] = scene.visible(scene.antennas[game, by[row]], scene.antennas[game, near])
        return reach


@lru_cache(maxsize=_MOST_TERMS)
def _terms_of(
    channel: Channel, names: tuple[str, ...], teams: tuple[Any, ...], jammers: tuple[tuple[float, ...], ...]
) -> core.Channel:
    """Return a channel in the form of the core; `_places_of` describes jammers."""
    uses = [channel.is_for(team) for team in teams]
    overhears = matching(channel.eavesdroppers, names, teams)
    relays = uses if channel.relay is True else matching(channel.relay or (), names, teams)
    weights = np.array((core.USES, core.OVERHEARS, core.RELAYS), np.uint8)
    roles = weights @ np.array((uses, overhears, relays), np.uint8)
    losses = as_chances(channel.loss, "loss") if channel.loss else np.zeros((0, 2))
    places = np.array(jammers).reshape(-1, 5)
    columns = roles, *losses.T, places[:, 0].astype(np.int64), places[:, 1:4], places[:, 4]
    return core.Channel(
        len(names),
        np.inf if channel.range_m is None else channel.range_m,
        channel.delay_turns,
        *map(kernels.buffer, columns),
        needs_rows=channel.hops is not None or channel.line_of_sight,
        is_relayed=bool(channel.relay),
    )


def _places_of(jammer: Jammer, scene: MessagePositions) -> list[tuple[float, ...]]:
    """Return a jammer as tuples: the number of an agent, or -1 with x, y and z of a place; and the radius."""
    if jammer.at is None:
        wanted, known = (jammer.team, scene.teams.values()) if jammer.agent is None else (jammer.agent, scene.teams)
        return [(row, 0.0, 0.0, 0.0, jammer.radius_m) for row, one in enumerate(known) if one == wanted]
    places = [jammer.at] if isinstance(jammer.at, tuple) else scene.place_of(jammer.at)
    return [(-1, x, y, 0.0, jammer.radius_m) for x, y in places]


class Outboxes:
    """The messages that agents send in a turn.

    Args:
        ctx: the context, for its agents.
        settings: the settings of the game.

    Attributes:
        outgoing: the messages of the current turn.
    """

    def __init__(self, ctx: HostContext, settings: Settings) -> None:
        self._ctx = ctx
        self._settings = settings
        self.outgoing: list[Outgoing] = []
        self._known_channels: list[Channel] = []  # channels whose names were checked

    def take(self, slots: Iterable[AgentSlot], turn: int) -> list[tuple[AgentSlot, str]]:
        """Collect the outboxes of agents; return (slot, error text) for each message that cannot be sent.

        Raises:
            IllegalAction: a message cannot be sent, and `on_illegal` is "raise".
        """
        self._warn_of_unknown_names()
        messages, unsent = self.read(slots)
        if unsent and self._settings.on_illegal == "raise":
            raise IllegalAction(f"Agent {shown(unsent[0][0].name)} in turn {turn}: {unsent[0][1]}")
        self.outgoing += messages
        return unsent

    def read(self, slots: Iterable[AgentSlot]) -> tuple[list[Outgoing], list[tuple[AgentSlot, str]]]:
        """Return the messages in outboxes, and (slot, error text) for each message that cannot be sent."""
        channels = self._settings.channels
        teams = {one.name: one.team for one in self._ctx.agent.create_iter()}
        outboxes = [(slot, slot.last[0].get("outbox", ())) for slot in slots]
        return checked_outboxes([one for one in outboxes if one[1] != []], channels, teams)

    def sent(self, agents: Sequence[IAgent], turn: int) -> list[dict[str, Any]]:
        """Send the collected messages, after all agents have moved; return their log entries."""
        outgoing = self.outgoing
        self.outgoing = []
        return sent(self._ctx, agents, outgoing, turn)

    def _warn_of_unknown_names(self) -> None:
        for channel in self._settings.channels.values():
            if channel not in self._known_channels:
                for flaw in unknown_in(channel, self._ctx):
                    self._ctx.logger.warning(f"{channel.name}: {flaw}")
        self._known_channels = list(self._settings.channels.values())


class Inboxes:
    """The messages that agents hear in a turn, found in the log of messages.

    Args:
        ctx: the context; messages on channels that were removed do not arrive.
        state: the state of the game.
    """

    def __init__(self, ctx: HostContext, state: GameState) -> None:
        self._ctx = ctx
        self._state = state
        self._known: list[dict[str, Any]] = []  # the log at the last call
        self._by_turn: dict[int, list[dict[str, Any]]] = {}  # turn of arrival -> log entries
        self._turn: int | None = None  # the turn of `_found`
        self._found: dict[str, list[_Arrival]] = {}  # agent -> its messages of this turn

    def of(self, name: str) -> list[dict[str, Any]]:
        """Return the messages that an agent hears in the next turn, in the order of sending."""
        arriving = self._arriving().get(name)
        inbox = list[dict[str, Any]]()
        if not arriving:
            return inbox
        channels = set(self._ctx.game.channels)
        for known, copy in arriving:
            if known["channel"] in channels:
                message = known.copy()
                if copy is not None:
                    message["body"] = copy(message["body"])
                inbox.append(message)
        return inbox

    def entries(self) -> list[dict[str, Any]]:
        """Return the log entries of the messages that agents hear in the next turn, in the order of sending."""
        self._catch_up(self._state.messages)
        return self._by_turn.get(self._state.turn + 1, [])

    def _arriving(self) -> "dict[str, list[_Arrival]]":
        self._catch_up(self._state.messages)
        turn = self._state.turn + 1
        if self._turn != turn:
            self._turn = turn
            self._found = defaultdict(list)
            for entry in self._by_turn.get(turn, ()):
                for key in ARRIVALS:
                    message = {part: entry[part] for part in ("channel", "sender", "to", "body")}
                    message |= {"turn": entry["turn"] - 1, "overheard": key == "overheard"}
                    arrival = message, _copy_of(entry["body"])
                    for name, at in entry[key].items():
                        if at == turn:
                            self._found[name].append(arrival)
        return self._found

    def _catch_up(self, log: list[dict[str, Any]]) -> None:
        """Read new entries of the log; after a snapshot was restored, drop entries that no longer exist."""
        # A log is only appended to and truncated, so two logs with a common entry agree up to this entry.
        known = self._known
        same = min(len(known), len(log))
        while same and known[same - 1] is not log[same - 1]:
            same -= 1
        if same == len(known) == len(log):
            return
        self._turn = None
        for entry in reversed(known[same:]):
            for turn in _turns_of(entry):
                self._by_turn[turn].pop()
        for entry in log[same:]:
            for turn in _turns_of(entry):
                self._by_turn.setdefault(turn, []).append(entry)
        known[same:] = log[same:]


_Arrival = tuple[dict[str, Any], Callable[[Any], Any] | None]  # a message, and a function that copies its body


def _turns_of(entry: dict[str, Any]) -> set[int]:
    return {*entry["heard"].values(), *entry["overheard"].values()}


def _copy_of(body: Any) -> Callable[[Any], Any] | None:
    """Return a function that copies a body for each recipient; None if the body is immutable."""
    kind = type(body)
    if kind in _SCALARS:
        return None
    # NOTE: a flat body is copied for each of many that hear it in a tenth of the time (benchmarks: messages).
    if kind in (list, dict) and _SCALARS.issuperset(map(type, body.values() if kind is dict else body)):
        return cast("Callable[[Any], Any]", kind.copy)
    return copied
