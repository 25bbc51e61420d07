"""Messages: who hears what is sent, and what is in the inbox of an agent.

All is decided when a message is sent, after the moves of that turn: where everybody is then says who is in range,
what is jammed and which way relays take. So one entry of the log of a game says what becomes of a message, and what is
under way follows from the log.
"""

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple, cast

import numpy as np

from gamms import kernels
from gamms.game.channels import Channel, Jammer, Outgoing, checked_outbox, matching, receivers_of, unknown_in
from gamms.game.legality import IllegalAction
from gamms.game.settings import Settings
from gamms.game.slots import AgentSlot
from gamms.ir.chances import as_chances, chances_at
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
ANTENNA = np.array((0.0, 0.0, 1.6))  # from an agent on the ground to the end of its sight lines, metres
HEARD, OVERHEARD, LOST, JAMMED = 1, 2, 3, 4  # what becomes of a message for an agent; 0: nothing
_AT_ONCE = 1 << 20  # messages and agents that are worked out together


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
        for row, agent in enumerate(agents):
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
        fates[name] = _fates(Waves(channels[name], scene, np.zeros_like(senders), senders, [one.to for one in those]))
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


def _fates(waves: "Waves") -> Iterator[dict[str, Any]]:
    """Yield what becomes of messages, some of these at once."""
    for first in range(0, waves.num_messages, waves.at_once):
        outcome, arrival = waves.outcomes(slice(first, first + waves.at_once))
        for row in range(len(outcome)):
            yield fate(waves.names, outcome[row], arrival[row])


def fate(names: Sequence[str], outcome: IntArray, arrival: IntArray) -> dict[str, Any]:
    """Return what the log says of who hears a message and when, and who does not, from a row of `Waves.outcomes`."""
    found: dict[int, dict[str, int]] = {HEARD: {}, OVERHEARD: {}, LOST: {}, JAMMED: {}}
    rows = np.flatnonzero(outcome)
    for row, kind, turn in zip(rows.tolist(), outcome[rows].tolist(), arrival[rows].tolist(), strict=True):
        found[kind][names[row]] = turn
    heard, overheard, lost, jammed = found.values()
    return {"heard": heard, "overheard": overheard, "lost": [*lost], "jammed": [*jammed]}


class Waves:
    """How messages of one channel spread, from agent to agent.

    Args:
        channel: the channel.
        scene: where agents are.
        at: (messages,) the games in the scene.
        senders: (messages,) their numbers.
        to: (messages,) of each an agent, a team, or None.

    Attributes:
        names: of the agents.
        num_messages: how many there are.
        at_once: how many of them are worked out with some megabytes.
    """

    def __init__(self, channel: Channel, scene: Scene, at: IntArray, senders: IntArray, to: Sequence[Any]) -> None:
        self._channel, self._scene, self._at, self._senders, self._to = channel, scene, at, senders, to
        self.names, teams, self.num_messages = list(scene.teams), scene.teams.values(), len(at)
        self.at_once = max(1, _AT_ONCE // len(self.names))
        self._may_use = np.array([channel.is_for(team) for team in teams], np.bool_)
        self._overhears = self._matching(channel.eavesdroppers)
        self._relays = self._may_use if channel.relay is True else self._matching(channel.relay or ())
        self._losses = as_chances(channel.loss, "loss") if channel.loss else None
        self._is_jammed = np.zeros(scene.alive.shape, np.bool_)
        for jammer in channel.jammers:
            self._is_jammed |= self._jammed(jammer)
        self._meant: dict[Any, BoolArray] = {}
        for one in to:
            if one not in self._meant:
                named = receivers_of(one, scene.teams)
                self._meant[one] = np.array([name in named for name in self.names], np.bool_) & self._may_use
        self._sights: dict[int, BoolArray] = {}  # number of a game and a transmitter -> which agents it sees
        self._k: IntArray | None = None  # how many messages their senders have sent before, for draws
        if self._losses is not None:
            pairs, self._k = at * len(self.names) + senders, np.zeros(len(at), np.int64)
            order = np.argsort(pairs, kind="stable")
            self._k[order] = np.arange(len(pairs)) - np.searchsorted(pairs[order], pairs[order])

    def outcomes(self, which: slice) -> tuple[IntArray, IntArray]:
        """Return what becomes of some messages, by numbers as `HEARD`, and when they arrive, (messages, agents)."""
        channel, at, senders = self._channel, self._at[which], self._senders[which]
        own, jammed, living = (np.arange(len(at)), senders), self._is_jammed[at], self._scene.alive[at]
        is_meant = np.array([self._meant[one] for one in self._to[which]]) & living
        is_meant[own] = False
        can_hear = living & ~jammed
        can_hear[own] = False
        if not channel.relay:
            can_hear &= is_meant | self._overhears
        wave, in_reach = self._spread(at, senders, None if self._k is None else self._k[which], can_hear)
        heard, missed = wave > 0, in_reach & is_meant
        outcome = np.where(missed, np.where(jammed, JAMMED, LOST), 0)
        outcome[heard & self._overhears] = OVERHEARD
        outcome[heard & is_meant] = HEARD
        turns = self._scene.turns[at] + 1
        return outcome, np.where(heard, turns[:, None] + wave * channel.delay_turns, 0)

    def _spread(
        self, at: IntArray, senders: IntArray, k: IntArray | None, can_hear: BoolArray
    ) -> tuple[IntArray, BoolArray]:
        """Return by how many transmissions messages come to agents, 0 for not at all, and whom they might reach."""
        wave, in_reach, shape = np.zeros(can_hear.shape, np.int64), np.zeros(can_hear.shape, np.bool_), can_hear.shape
        rows, transmitters, number = np.arange(len(wave)), senders, 1
        while len(rows):
            reaches, far = self._reached(at[rows], transmitters)
            if number == 1:
                in_reach |= reaches
            else:
                begins = np.flatnonzero(np.diff(rows, prepend=-1))  # of each message; rows ascend
                in_reach[rows[begins]] |= np.logical_or.reduceat(reaches, begins)
            sources, gets = np.nonzero(reaches & can_hear[rows])
            of = rows[sources]
            if k is not None and self._losses is not None:
                draws = self._draws(at[of], senders[of], k[of], transmitters[sources], gets)
                comes = draws >= chances_at(far[sources, gets], self._losses)
                of, gets = of[comes], gets[comes]
            is_new = np.zeros(shape, np.bool_)
            is_new[of, gets] = True
            wave[is_new] = number
            if not self._channel.relay:
                break
            can_hear = can_hear & ~is_new
            rows, transmitters = np.nonzero(is_new & self._relays)
            number += 1
        return wave, in_reach

    def _draws(self, at: IntArray, senders: IntArray, k: IntArray, by: IntArray, gets: IntArray) -> FloatArray:
        """Return a number in [0, 1) for each message that a transmitter sends to an agent."""
        scene, purposes = self._scene, np.zeros(len(at), np.uint64)
        for sender in np.unique(senders).tolist():
            of_one = senders == sender
            purposes[of_one] = scene.purposes("channel", self._channel.name, self.names[sender])[at[of_one]]
        names = scene.keys[gets]
        if self._channel.relay:
            names = kernels.draw_bits_rows(scene.keys[by], names, np.zeros(1, np.int64))
        return kernels.fraction_many(kernels.draw_bits_rows(purposes, names, scene.turns[at], k))

    def _reached(self, at: IntArray, transmitters: IntArray) -> tuple[BoolArray, FloatArray]:
        """Return which agents transmitters of messages reach, and how far they are, (transmitters, agents)."""
        channel, scene = self._channel, self._scene
        which = None
        if len(at) > 1:  # several messages may come from one transmitter
            pairs, which = np.unique(at * len(self.names) + transmitters, return_inverse=True)
            at, transmitters = np.divmod(pairs, len(self.names))
        far = _distances(scene.xyz[at], scene.xyz[at, transmitters][:, None])
        reaches = scene.alive[at] & (far <= (np.inf if channel.range_m is None else channel.range_m))
        if channel.hops is not None:
            reaches &= scene.is_within(at, transmitters, channel.hops)
        reaches[np.arange(len(at)), transmitters] = False
        if channel.line_of_sight:
            for row, pair in enumerate(zip(at.tolist(), transmitters.tolist(), strict=True)):
                reaches[row] = self._in_sight(*pair, reaches[row])
        return (reaches, far) if which is None else (reaches[which], far[which])

    def _in_sight(self, game: int, transmitter: int, reaches: BoolArray) -> BoolArray:
        """Return which of the agents that a transmitter reaches it sees, (agents,)."""
        pair, antennas = game * len(self.names) + transmitter, self._scene.antennas[game]
        if pair not in self._sights:
            self._sights[pair] = reaches.copy()
            if reaches.any():
                self._sights[pair][reaches] = self._scene.visible(antennas[transmitter], antennas[reaches])
        return self._sights[pair]

    def _matching(self, named: Sequence[Any]) -> BoolArray:
        """Return which agents, or whose teams, are named, (agents,)."""
        return np.array(matching(named, self.names, self._scene.teams.values()), np.bool_)

    def _jammed(self, jammer: Jammer) -> BoolArray:
        """Return which agents a jammer silences, (games, agents)."""
        scene, found = self._scene, np.zeros(self._scene.alive.shape, np.bool_)
        if jammer.at is None:
            wanted = enumerate(scene.teams.items())
            is_team = jammer.team is not None
            for i in [i for i, (name, team) in wanted if (team == jammer.team if is_team else name == jammer.agent)]:
                found |= (_distances(scene.xyz, scene.xyz[:, i, None]) <= jammer.radius_m) & scene.alive[:, i, None]
            return found
        for x, y in [jammer.at] if isinstance(jammer.at, tuple) else scene.place_of(jammer.at):
            found |= _distances(scene.xyz, np.array((x, y, 0.0))) <= jammer.radius_m
        return found


def _distances(xyz: FloatArray, place: FloatArray) -> FloatArray:
    ways = xyz - place
    distances: FloatArray = np.sqrt((ways * ways).sum(axis=-1))
    return distances


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
        outgoing, unsent = list[Outgoing](), list[tuple[AgentSlot, str]]()
        for slot in slots:
            outbox = slot.last[0].get("outbox", ())
            if type(outbox) is list and not outbox:
                continue
            messages, flaws = checked_outbox(outbox, slot, channels, teams)
            outgoing += messages
            unsent += [(slot, flaw) for flaw in flaws]
        return outgoing, unsent

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
