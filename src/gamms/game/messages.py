"""Messages: who hears what is sent, and what is in the inbox of an agent.

All is decided when a message is sent, after the moves of that turn: where everybody is then says who is in range,
what is jammed and which way relays take. So one entry of the log of a game says what becomes of a message, and what is
under way follows from the log.
"""

from collections import defaultdict
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, cast

import numpy as np

from gamms import kernels
from gamms.game.channels import Channel, Jammer, Outgoing, matching, receivers_of
from gamms.ir.agents import Position
from gamms.ir.chances import as_chances, chances_at
from gamms.ir.game_state import GameState
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.messages import ARRIVALS
from gamms.ir.obstacles import BoolArray
from gamms.kernels.draws import BitArray
from gamms.readonly import copied
from gamms.typing.agent_engine import IAgent
from gamms.typing.context import HostContext
from gamms.typing.on_edges import located

_SCALARS = frozenset({str, bytes, int, float, bool, type(None)})
ANTENNA_M = 1.6  # above the ground, of agents there: the height of their sight lines


class Places(NamedTuple):
    """The living agents when messages are sent, in the order of their names."""

    names: list[str]
    teams: list[Any]
    nodes: list[int]  # of flyers those below them
    xyz: FloatArray  # (agents, 3)
    flies: BoolArray  # (agents,)

    @classmethod
    def of(cls, ctx: HostContext, agents: Sequence[IAgent]) -> "Places":
        """Ask where agents are now."""
        nodes = [agent.current_node_id for agent in agents]
        xyz = np.zeros((len(agents), 3))
        xyz[:, :2], ground = ctx.graph.graph.positions(nodes), ctx.graph.graph.ground(nodes)
        xyz[:, 2] = 0.0 if ground is None else ground.z
        positions: list[Position | None] = [getattr(agent, "position", None) for agent in agents]
        for row, position in enumerate(positions):
            if position is not None:
                xyz[row] = position
        block = ctx.agent.block
        for row, agent in enumerate(agents):
            progress = block.on_edge(block.row_of(agent.name))
            place = None if progress is None else located(ctx.graph.graph, progress)
            if place is not None:
                xyz[row, :2] = place.xy
        flies = np.array([position is not None for position in positions], bool)
        return cls([agent.name for agent in agents], [agent.team for agent in agents], nodes, xyz, flies)


def sent(ctx: HostContext, agents: Sequence[IAgent], outgoing: Sequence[Outgoing], turn: int) -> list[dict[str, Any]]:
    """Return the entries of the log for messages that are sent now.

    Args:
        ctx: the context, whose map and channels count.
        agents: the living ones, in the order of their names.
        outgoing: the messages, in the order of their senders; those of agents that are dead by now are dropped.
        turn: how many turns were played before this one.
    """
    if not outgoing or not agents:
        return []
    places, waves = Places.of(ctx, agents), dict[str, Propagation]()
    row_of = {name: row for row, name in enumerate(places.names)}
    counts: dict[tuple[str, str], int] = {}
    entries = []
    for message in outgoing:
        channel, row = ctx.game.channels.get(message.channel), row_of.get(message.sender)
        if channel is None or row is None:
            continue
        if channel.name not in waves:
            waves[channel.name] = Propagation(ctx, channel, places, turn)
        key = (message.channel, message.sender)
        counts[key] = k = counts.get(key, -1) + 1
        entries.append(
            {
                "turn": turn + 1,
                "channel": channel.name,
                "sender": message.sender,
                "to": message.to,
                "body": message.body,
                "size": message.size,
                **waves[channel.name].outcome(row, message.to, k),
            }
        )
    return entries


class _Link(NamedTuple):
    """What one agent sends, to each of the others."""

    reaches: BoolArray  # (agents,)
    losses: FloatArray  # (agents,) how probably it is lost; none where nothing ever is
    keys: BitArray  # (agents,) what draws for both names start from


_NO_LOSSES: FloatArray = np.zeros(0)


class Propagation:
    """Who hears what is sent on one channel in one turn.

    Args:
        ctx: the context.
        channel: the channel.
        places: the living agents.
        turn: how many turns were played before this one.
    """

    def __init__(self, ctx: HostContext, channel: Channel, places: Places, turn: int) -> None:
        self._ctx, self._channel, self._places, self._turn = ctx, channel, places, turn
        self._teams = dict(zip(places.names, places.teams, strict=True))
        self._row_of = {name: row for row, name in enumerate(places.names)}
        self._keys = kernels.name_keys(places.names)
        self._may_use = np.array([channel.is_for(team) for team in places.teams], bool)
        self._overhears = self._matching(channel.eavesdroppers)
        self._relays = self._may_use if channel.relay is True else self._matching(channel.relay or ())
        self._is_jammed = np.zeros(len(places.names), bool)
        for jammer in channel.jammers:
            for xyz in self._places_of(jammer):
                self._is_jammed |= _distances(places.xyz, xyz) <= jammer.radius_m
        self._losses = as_chances(channel.loss, "loss") if channel.loss else None
        self._links: dict[int, _Link] = {}
        self._addressed: dict[Any, BoolArray] = {}

    def outcome(self, sender: int, to: Any, k: int) -> dict[str, Any]:
        """Return who hears a message and when, and who does not.

        Args:
            sender: its row.
            to: an agent, a team, or None.
            k: how many messages it has sent on this channel before in this turn.
        """
        channel, names = self._channel, self._places.names
        is_meant = self._meant(to).copy()
        is_meant[sender] = False
        can_hear = ~self._is_jammed
        can_hear[sender] = False
        if not channel.relay:
            can_hear &= is_meant | self._overhears
        wave, in_reach = self._spread(sender, can_hear, k)
        heard, missed = wave > 0, in_reach & is_meant
        turns = (self._turn + 1 + wave * channel.delay_turns).tolist()

        def named(rows: BoolArray) -> list[str]:
            return [names[row] for row in np.flatnonzero(rows).tolist()]

        def timed(rows: BoolArray) -> dict[str, int]:
            return {names[row]: turns[row] for row in np.flatnonzero(rows).tolist()}

        return {
            "heard": timed(heard & is_meant),
            "overheard": timed(heard & self._overhears & ~is_meant),
            "lost": named(missed & ~heard & ~self._is_jammed),
            "jammed": named(missed & self._is_jammed),
        }

    def _spread(self, sender: int, can_hear: BoolArray, k: int) -> tuple[IntArray, BoolArray]:
        """Return by how many transmissions a message comes to each agent, 0 for not at all, and whom it might reach."""
        wave, in_reach = np.zeros(len(can_hear), np.int64), np.zeros(len(can_hear), bool)
        purpose = kernels.purpose_key(self._ctx.seed, "channel", self._channel.name, self._places.names[sender])
        transmitters, number = [sender], 1
        while transmitters:
            links = [self._link(row) for row in transmitters]
            reaches = np.stack([link.reaches for link in links])  # (transmitters, agents)
            in_reach |= reaches.any(axis=0)
            sources, gets = np.nonzero(reaches & (can_hear & (wave == 0)))
            if self._losses is not None:
                keys, losses = np.stack([link.keys for link in links]), np.stack([link.losses for link in links])
                draws = kernels.fraction_many(kernels.draw_bits_many(purpose, keys[sources, gets], self._turn, k))
                gets = gets[draws >= losses[sources, gets]]
            is_new = np.zeros(len(can_hear), bool)
            is_new[gets] = True
            wave[is_new] = number
            transmitters = np.flatnonzero(is_new & self._relays).tolist() if self._channel.relay else []
            number += 1
        return wave, in_reach

    def _link(self, row: int) -> "_Link":
        """Return which agents are in reach of one, and how probably each of them misses what it sends."""
        if row not in self._links:
            channel, places = self._channel, self._places
            distances = _distances(places.xyz, places.xyz[row])
            reaches = distances <= (np.inf if channel.range_m is None else channel.range_m)
            if channel.hops is not None:
                near = self._ctx.graph.graph.distances(source=places.nodes[row], weight=None, cutoff=channel.hops)
                reaches &= np.array([node in near for node in places.nodes], bool)
            reaches[row] = False
            if channel.line_of_sight and reaches.any():
                reaches[reaches] = self._ctx.graph.visible(self._antennas([row])[0], self._antennas(reaches))
            if self._losses is None:
                self._links[row] = _Link(reaches, _NO_LOSSES, self._keys)
            else:
                keys = kernels.draw_bits_many(int(self._keys[row]), self._keys, 0) if channel.relay else self._keys
                self._links[row] = _Link(reaches, chances_at(distances, self._losses), keys)
        return self._links[row]

    def _antennas(self, rows: BoolArray | list[int]) -> FloatArray:
        """Return the ends of sight lines (rows, 3)."""
        xyz, flies = self._places.xyz[rows].copy(), self._places.flies[rows]
        xyz[~flies, 2] += ANTENNA_M
        return xyz

    def _meant(self, to: Any) -> BoolArray:
        """Return which agents a message is for, (agents,), the sender included."""
        if to not in self._addressed:
            is_meant = np.zeros(len(self._teams), bool)
            is_meant[[self._row_of[name] for name in receivers_of(to, self._teams)]] = True
            self._addressed[to] = is_meant & self._may_use
        return self._addressed[to]

    def _matching(self, named: Sequence[Any]) -> BoolArray:
        return np.array(matching(named, self._places.names, self._places.teams), bool)

    def _places_of(self, jammer: Jammer) -> list[Any]:
        """Return where a jammer is: one place, that of each living agent of a team, or none."""
        if jammer.at is None:
            wanted = zip(self._places.names, self._places.teams, self._places.xyz, strict=True)
            is_team = jammer.team is not None
            return [xyz for name, team, xyz in wanted if (team == jammer.team if is_team else name == jammer.agent)]
        if isinstance(jammer.at, tuple):
            return [(*jammer.at, 0.0)]
        graph = self._ctx.graph.graph
        return [(*xy, 0.0) for xy in graph.positions([jammer.at])] if graph.has_node(jammer.at) else []


def _distances(xyz: FloatArray, place: Any) -> FloatArray:
    ways = xyz - np.asarray(place, np.float64)
    distances: FloatArray = np.sqrt((ways * ways).sum(axis=1))
    return distances


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
