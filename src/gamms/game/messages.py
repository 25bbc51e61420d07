"""Messages: who hears what is sent, and what is in the inbox of an agent.

All is decided when a message is sent, after the moves of that turn: where everybody is then says who is in range,
what is jammed and which way relays take. So one entry of the log of a game says what becomes of a message, and what is
under way follows from the log.
"""

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from itertools import pairwise
from typing import Any, NamedTuple, cast

import numpy as np

from gamms import kernels
from gamms.core import messages as core
from gamms.game.channels import Channel, Jammer, Outgoing, checked_outboxes, flat, groups_of, matching, unknown_in
from gamms.game.legality import IllegalAction
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
ANTENNA = np.array((0.0, 0.0, 1.6))  # from an agent on the ground to the end of its sight lines, metres
_AT_ONCE = 1 << 20  # messages times agents that are worked out together
_MOST_TERMS = 64  # channels of agents that are kept in numbers


class Scene(NamedTuple):
    """Where agents are when messages are sent and all have moved, in one game or in several at once.

    Attributes:
        teams: of the agents, by name, in the order of their names.
        keys: (agents,) the hashes of the names, for keyed draws.
        turns: (games,) how many turns were played before this one.
        xyz, antennas: (games, agents, 3) where they are, and the ends of their sight lines.
        alive: (games, agents)
        purposes: returns the hashes of the seeds and of a purpose, (games,).
        is_within: returns which agents so many edges lead to from transmitters at most, (transmitters, agents); called
            with the games and the agents, (transmitters,), and the number.
        visible: says which of some places (places, 3) are in sight of one, (3,).
        place_of: returns x and y of a node by its id, one pair or none.
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
    def of(cls, ctx: HostContext, agents: Sequence[IAgent], turn: int) -> "Scene":
        """Ask where the living agents of one game are now."""
        graph, block, ids = ctx.graph.graph, ctx.agent.block, [agent.current_node_id for agent in agents]
        xyz, near = np.zeros((1, len(agents), 3)), dict[tuple[int, int], BoolArray]()
        xyz[0, :, :2], ground = graph.positions(ids), graph.ground(ids)
        xyz[0, :, 2] = 0.0 if ground is None else ground.z
        antennas = xyz + ANTENNA
        for row, agent in enumerate(agents if block.flyers or block.travellers else ()):
            position, progress = getattr(agent, "position", None), block.on_edge(block.row_of(agent.name))
            place = None if progress is None else located(graph, progress)
            if position is not None:
                xyz[0, row] = antennas[0, row] = position
            if place is not None:
                xyz[0, row, :2] = antennas[0, row, :2] = place.xy

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
    """Return the entries of the log for messages that are sent now.

    Args:
        ctx: the context, whose map and channels count.
        agents: the living ones, in the order of their names.
        outgoing: the messages; those of agents that are dead by now are dropped.
        turn: how many turns were played before this one.
    """
    row_of, channels = {agent.name: row for row, agent in enumerate(agents)}, ctx.game.channels
    going = [one for one in outgoing if one.channel in channels and one.sender in row_of]
    if not going:
        return []
    scene, fates = Scene.of(ctx, agents, turn), dict[str, Iterator[dict[str, Any]]]()
    for name in dict.fromkeys(one.channel for one in going):
        those = [one for one in going if one.channel == name]
        senders = np.array([row_of[one.sender] for one in those])
        found = fates_of(channels[name], scene, np.zeros_like(senders), senders, [one.to for one in those])
        fates[name] = found.entries(list(row_of), len(those))
    return [
        {
            "turn": turn + 1,
            "channel": one.channel,
            "sender": one.sender,
            "to": one.to,
            "body": one.body,
            "size": one.size,
            **next(fates[one.channel]),
        }
        for one in going
    ]


class Fates(NamedTuple):
    """What becomes of messages: for each that an agent hears or misses a row, by message, then by agent; (rows,).

    Attributes:
        messages: their numbers.
        agents: likewise.
        outcomes: `core.HEARD`, `OVERHEARD`, `LOST` or `JAMMED`.
        arrivals: the numbers of the turns, from 1, in which messages are heard.
    """

    messages: IntArray
    agents: IntArray
    outcomes: ByteArray
    arrivals: IntArray

    def entries(self, names: Sequence[str], num_messages: int) -> Iterator[dict[str, Any]]:
        """Yield what the log says of who hears each message and when, and who does not."""
        rows = list(zip(self.agents.tolist(), self.outcomes.tolist(), self.arrivals.tolist(), strict=True))
        for first, last in pairwise(np.searchsorted(self.messages, np.arange(num_messages + 1)).tolist()):
            found: dict[int, dict[str, int]] = {core.HEARD: {}, core.OVERHEARD: {}, core.LOST: {}, core.JAMMED: {}}
            for agent, outcome, turn in rows[first:last]:
                found[outcome][names[agent]] = turn
            heard, overheard, lost, jammed = found.values()
            yield {"heard": heard, "overheard": overheard, "lost": [*lost], "jammed": [*jammed]}


def fates_of(channel: Channel, scene: Scene, at: IntArray, senders: IntArray, to: Sequence[Any]) -> Fates:
    """Return what becomes of messages of one channel.

    Args:
        channel: the channel.
        scene: where agents are.
        at: (messages,) the games in the scene, ascending.
        senders: (messages,) their numbers.
        to: (messages,) of each an agent, a team, or None.
    """
    network, numbers = _Network(channel, scene, senders), np.zeros(len(at), np.int64)
    groups, first, members = groups_of(to, scene.teams)
    if channel.loss:
        core.count_messages(at.data, senders.data, network.rows.data, numbers.data)
    at_once, parts = max(1, _AT_ONCE // len(scene.teams)), list[Fates]()
    for begin in range(0, len(at), at_once):
        those = slice(begin, begin + at_once)
        shape = len(at[those]), len(scene.teams)
        outcomes, arrivals = np.empty(shape, np.uint8), np.empty(shape, np.int64)
        written = np.zeros(shape[0], np.uint8), outcomes, arrivals
        columns: Any = at[those], senders[those], groups[those], first, members, numbers[those], *written
        network.spread(core.Messages(*map(flat, columns)))
        messages, agents = np.nonzero(outcomes)
        parts.append(Fates(begin + messages, agents, outcomes[messages, agents], arrivals[messages, agents]))
    return parts[0] if len(parts) == 1 else Fates(*map(np.concatenate, zip(*parts, strict=True)))


class _Network:
    """Whom agents reach by a channel.

    Args:
        channel: the channel.
        scene: where agents are.
        senders: the agents that send.

    Attributes:
        rows: working memory.
    """

    def __init__(self, channel: Channel, scene: Scene, senders: IntArray) -> None:
        games, agents = scene.alive.shape
        self._channel, self._scene = channel, scene
        names, jammers = tuple(scene.teams), tuple(place for one in channel.jammers for place in _places_of(one, scene))
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
        """Find what becomes of messages."""
        scene = self._scene
        while True:
            columns = scene.xyz, scene.alive.view(np.uint8), scene.keys, self._purposes, scene.turns
            known = self._slots, self._awaited, self._reach
            network = core.Network(*map(flat, (*columns, *known, self.rows, *self._bytes)))
            number = core.spread_all(self._terms, network, messages)
            if not number:
                break
            transmitters = self._awaited[:number]
            self._slots[transmitters] = len(self._reach) + np.arange(number)
            self._reach = np.concatenate((self._reach, self._reached(network, transmitters)))

    def _reached(self, network: core.Network, transmitters: IntArray) -> ByteArray:
        """Return which agents transmitters reach, (transmitters, agents)."""
        channel, scene, agents = self._channel, self._scene, len(self._scene.teams)
        reach = np.empty((len(transmitters), agents), np.uint8)
        core.find_in_range(self._terms, network, len(reach), flat(reach))
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
    """Return what a channel says of agents of these names and teams, in numbers; see `_places_of`."""
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
        *map(flat, columns),
        needs_rows=channel.hops is not None or channel.line_of_sight,
        is_relayed=bool(channel.relay),
    )


def _places_of(jammer: Jammer, scene: Scene) -> list[tuple[float, ...]]:
    """Return where a jammer is: the number of an agent or -1, x, y and z of a place, and the radius."""
    if jammer.at is None:
        wanted, known = (jammer.team, scene.teams.values()) if jammer.agent is None else (jammer.agent, scene.teams)
        return [(row, 0.0, 0.0, 0.0, jammer.radius_m) for row, one in enumerate(known) if one == wanted]
    places = [jammer.at] if isinstance(jammer.at, tuple) else scene.place_of(jammer.at)
    return [(-1, x, y, 0.0, jammer.radius_m) for x, y in places]


class Outboxes:
    """What agents send in a turn.

    Args:
        ctx: the context, whose agents count.
        settings: of the game.

    Attributes:
        outgoing: what they send in the turn under way.
    """

    def __init__(self, ctx: HostContext, settings: Settings) -> None:
        self._ctx, self._settings = ctx, settings
        self.outgoing: list[Outgoing] = []
        self._known_channels: list[Channel] = []  # of which it was checked whom they name

    def take(self, slots: Iterable[AgentSlot], turn: int) -> list[tuple[AgentSlot, str]]:
        """Take what agents have decided to send, and return what cannot be sent: by whom, and why.

        Raises:
            IllegalAction: something cannot be sent, and `on_illegal` is "raise".
        """
        self._warn_of_unknown_names()
        messages, unsent = self.read(slots)
        if unsent and self._settings.on_illegal == "raise":
            raise IllegalAction(f"Agent {shown(unsent[0][0].name)} in turn {turn}: {unsent[0][1]}")
        self.outgoing += messages
        return unsent

    def read(self, slots: Iterable[AgentSlot]) -> tuple[list[Outgoing], list[tuple[AgentSlot, str]]]:
        """Return what agents have decided to send, and what of it cannot be sent: by whom, and why."""
        channels, teams = self._settings.channels, {one.name: one.team for one in self._ctx.agent.create_iter()}
        outboxes = [(slot, slot.last[0].get("outbox", ())) for slot in slots]
        return checked_outboxes([one for one in outboxes if one[1] != []], channels, teams)

    def sent(self, agents: Sequence[IAgent], turn: int) -> list[dict[str, Any]]:
        """Send what was taken, between agents that have moved by now; return its entries in the log."""
        outgoing, self.outgoing = self.outgoing, []
        return sent(self._ctx, agents, outgoing, turn)

    def _warn_of_unknown_names(self) -> None:
        for channel in self._settings.channels.values():
            if channel not in self._known_channels:
                for flaw in unknown_in(channel, self._ctx):
                    self._ctx.logger.warning(f"{channel.name}: {flaw}")
        self._known_channels = list(self._settings.channels.values())


class Inboxes:
    """What agents hear in a turn, found in the log of messages.

    Args:
        ctx: the context, whose channels count: what is under way on one that is gone does not arrive.
        state: of the game.
    """

    def __init__(self, ctx: HostContext, state: GameState) -> None:
        self._ctx, self._state = ctx, state
        self._known: list[dict[str, Any]] = []  # the log as it was when it was read last
        self._by_turn: dict[int, list[dict[str, Any]]] = {}  # in which they arrive -> messages
        self._turn: int | None = None  # for which `_found` is
        self._found: dict[str, list[_Arrival]] = {}  # agent -> what it hears in this turn

    def of(self, name: str) -> list[dict[str, Any]]:
        """Return the messages that an agent hears in the turn that comes, in the order in which they were sent."""
        arriving, inbox = self._arriving().get(name), list[dict[str, Any]]()
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

    def _arriving(self) -> "dict[str, list[_Arrival]]":
        self._catch_up(self._state.messages)
        turn = self._state.turn + 1
        if self._turn != turn:
            self._turn, self._found = turn, defaultdict(list)
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
        """Read what is new in the log; where it was cut for a snapshot, forget what is no longer in it."""
        # A log is only appended to and cut, so that what comes before an entry of both is the same in both.
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


_Arrival = tuple[dict[str, Any], Callable[[Any], Any] | None]  # a message, and what copies its body


def _turns_of(entry: dict[str, Any]) -> set[int]:
    return {*entry["heard"].values(), *entry["overheard"].values()}


def _copy_of(body: Any) -> Callable[[Any], Any] | None:
    """Return what copies a body, so that those who hear it share nothing; None where nothing in it can change."""
    kind = type(body)
    if kind in _SCALARS:
        return None
    # NOTE: a flat body is copied for each of many that hear it in a tenth of the time (benchmarks: messages).
    if kind in (list, dict) and _SCALARS.issuperset(map(type, body.values() if kind is dict else body)):
        return cast("Callable[[Any], Any]", kind.copy)
    return copied
