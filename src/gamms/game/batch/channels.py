"""Messages of many games at once: what array strategies send, who hears it, and what is under way."""

from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from gamms import kernels
from gamms.errors import BadType, BadValue, UnknownName
from gamms.game.batch.columns import GameLog, Roster, joined_rows, places_of, some_rows
from gamms.game.batch.routes import RouteTable
from gamms.game.channels import Channel, Jammer, matching, receivers_of
from gamms.game.messages import ANTENNA_M
from gamms.ir.chances import as_chances, chances_at
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.ir.packing import to_bytes
from gamms.kernels.draws import BitArray
from gamms.plain import to_plain, why_not_plain
from gamms.text import shown

_MOST_AT_ONCE = 1 << 20  # messages of one agent in a turn
_HEARD, _OVERHEARD, _LOST, _JAMMED = 1, 2, 3, 4  # what becomes of a message for an agent; 0: nothing


class Outbox(NamedTuple):
    """Messages that agents send together by one channel; arrays (messages,).

    Attributes:
        channel: its name.
        at: the games, by their numbers in the batch.
        senders: numbers in the roster.
        to: of each an agent, a team, or None.
        bodies: of each.
        order: of several messages of one agent that it sends at once, that with the smaller number comes first.
    """

    channel: str
    at: IntArray
    senders: IntArray
    to: np.ndarray[Any, Any]
    bodies: list[Any]
    order: IntArray

    def those(self, which: BoolArray | IntArray) -> "Outbox":
        """Return some of the messages."""
        return some_rows(self, which)

    def sent_at(self, moment: int) -> "Outbox":
        """Return the messages, sent when agents were asked for that time in the turn."""
        return self._replace(order=moment * _MOST_AT_ONCE + self.order)


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


class _Sent(NamedTuple):
    """Messages of one channel and turn, (messages,), and what became of them, (messages, agents)."""

    channel: str
    at: IntArray
    turns: IntArray  # numbers of the turns, from 1
    senders: IntArray
    to: np.ndarray[Any, Any]
    bodies: list[Any]
    place: IntArray  # of several messages of a game and turn, that with the smaller number comes first
    outcome: IntArray
    arrival: IntArray


class Scene(NamedTuple):
    """The games in which messages are sent: where agents are when all have moved.

    Attributes:
        games: (games,) numbers in the batch.
        turns: (games,) how many turns were played before this one.
        node, alive: (games, agents)
        xy: (games, agents, 2) where they are, on nodes or edges.
        purposes: returns the hash of the seeds and a purpose, of all games of the batch.
        hops: how many edges it is between rows of nodes.
    """

    games: IntArray
    turns: IntArray
    node: IntArray
    xy: FloatArray
    alive: BoolArray
    purposes: Callable[..., BitArray]
    hops: Callable[[], RouteTable]


class Radio(GameLog[list[_Sent]]):
    """The channels of a game, and what was sent by them in all games of a batch.

    Args:
        channels: by name.
        roster: of every game.
        ids: (nodes,) of the nodes.
        xyz: (nodes, 3) where they are.
        num_games: of the batch.
        visible: says which of some places (places, 3) are in sight of one, (3,); None: no agent asks.
    """

    def __init__(
        self,
        channels: Mapping[str, Channel],
        roster: Roster,
        ids: IntArray,
        xyz: FloatArray,
        num_games: int,
        visible: Callable[[FloatArray, FloatArray], BoolArray] | None = None,
    ) -> None:
        super().__init__(num_games)
        self._visible = visible
        self.channels, self._roster, self._ids, self._xyz = channels, roster, ids, xyz
        self._teams = dict(zip(roster.names, (roster.teams[number] for number in roster.team_of), strict=True))
        self._pair_keys: BitArray | None = None
        self._under_way: list[tuple[int, _Sent]] = []  # for how many turns more, and what

    # -- sending ------------------------------------------------------------------------------------------------

    def checked(
        self, channel: str, where: BoolArray, games: IntArray, agents: IntArray, to: object, body: object, order: int
    ) -> Outbox:
        """Return what agents send in these games, checked, as `ArrayView.send`; `order` is the place among theirs."""
        if channel not in self.channels:
            raise UnknownName("channel", channel, self.channels)
        at, which = np.nonzero(where)
        senders, team_of = agents[which], self._roster.team_of
        for number in np.unique(team_of[senders]).tolist():
            if not self.channels[channel].is_for(self._roster.teams[number]):
                raise BadValue(f"Channel {channel!r} is not for team {shown(self._roster.teams[number])}.")
        receivers: list[Any] = [to] * len(at)
        if isinstance(to, np.ndarray):
            receivers = [self._roster.names[number] for number in np.broadcast_to(to, where.shape)[at, which]]
        elif to is not None and not receivers_of(_as_key(to), self._teams):
            raise UnknownName("agent or team", to, [*self._teams, *self._roster.teams])
        bodies = body[at, which].tolist() if isinstance(body, np.ndarray) else [body] * len(at)
        for one in bodies if isinstance(body, np.ndarray) and body.dtype == object else [body] * (len(at) > 0):
            if not isinstance(one, np.ndarray) and (flaw := why_not_plain(one)):
                raise BadType(f"The body must be a plain value, such as numbers, texts, lists and dicts: body{flaw}.")
        order_of_each, to_each = np.full(len(at), order), np.fromiter(receivers, object, len(at))
        return Outbox(channel, games[at], senders, to_each, bodies, order_of_each)

    def send(self, scene: Scene, outboxes: Sequence[Outbox]) -> None:
        """Work out who hears what is sent in these games; what dead agents send is dropped."""
        number, sent = places_of(scene.games, len(self._of_game)), list[_Sent]()
        for name in self.channels:
            boxes = [box for box in outboxes if box.channel == name]
            if not boxes:
                continue
            box = joined_rows(boxes)
            at = number[box.at]
            those = np.flatnonzero((at >= 0) & scene.alive[at, box.senders])
            box = box.those(those[np.lexsort((box.order[those], box.senders[those], at[those]))])
            if len(those):
                at, senders = number[box.at], box.senders
                wave = _Waves(self, self.channels[name], scene, at, senders, box.to)
                moment, order = np.divmod(box.order, _MOST_AT_ONCE)
                place = (moment * len(self._roster.names) + senders) * _MOST_AT_ONCE + order
                turns = scene.turns[at] + 1
                sent.append(_Sent(name, box.at, turns, senders, box.to, box.bodies, place, *wave.outcomes(turns)))
        self._pending.append(sent)
        for one in sent:
            last = int((one.arrival - one.turns[:, None]).max(initial=0))
            self._under_way.append((last, one))

    def end_turn(self) -> None:
        """Forget what has arrived everywhere."""
        self._under_way = [(left - 1, sent) for left, sent in self._under_way if left > 0]

    def heard(self, channel: str, games: IntArray, turns: IntArray, agents: IntArray, asked: BoolArray) -> Heard:
        """Return what agents hear by a channel in the turn that comes; see `Heard`."""
        if channel not in self.channels:
            raise UnknownName("channel", channel, self.channels)
        number, none = places_of(games, len(self._of_game)), np.zeros(0, np.int64)
        found, places = [Heard(none, none, none, [], none, none > 0)], [none]
        for _, sent in self._under_way:
            if sent.channel != channel:
                continue
            at = number[sent.at]
            arrives = (sent.outcome == _HEARD) | (sent.outcome == _OVERHEARD)
            arrives &= (sent.arrival == np.where(at >= 0, turns[at] + 1, -1)[:, None]) & (at >= 0)[:, None]
            rows, columns = np.nonzero(arrives[:, agents] & asked[at])
            overheard = sent.outcome[rows, agents[columns]] == _OVERHEARD
            bodies = [sent.bodies[row] for row in rows.tolist()]
            found.append(Heard(at[rows], columns, sent.senders[rows], bodies, sent.turns[rows] - 1, overheard))
            places.append(sent.place[rows])
        heard = joined_rows(found)
        keys = heard.overheard, np.concatenate(places), heard.turns, heard.hearers, heard.at
        return some_rows(heard, np.lexsort(keys))

    # -- who is meant and where ---------------------------------------------------------------------------------

    def in_sight(self, xyz: FloatArray, transmitters: IntArray, reaches: BoolArray) -> BoolArray:
        """Return which of the agents that transmitters reach they see, (transmitters, agents)."""
        antennas, found, visible = xyz + np.array([0.0, 0.0, ANTENNA_M]), reaches.copy(), self._visible
        if visible is not None:
            for row in np.flatnonzero(reaches.any(axis=1)).tolist():
                found[row, reaches[row]] = visible(antennas[row, transmitters[row]], antennas[row, reaches[row]])
        return found

    def keys(self, *, relay: bool) -> BitArray:
        """Return what draws for a transmitter and a hearer start from, (agents, agents) or (1, agents)."""
        if not relay:
            return self._roster.keys[None]
        if self._pair_keys is None:
            keys = self._roster.keys
            self._pair_keys = np.stack([kernels.draw_bits_many(int(key), keys, 0) for key in keys])
        return self._pair_keys

    def jammed(self, jammer: Jammer, scene: Scene, xyz: FloatArray) -> BoolArray:
        """Return which agents a jammer silences, (games, agents)."""
        if jammer.at is None:
            is_team = jammer.team is not None
            named = [
                (self._teams[name] == jammer.team if is_team else name == jammer.agent) for name in self._roster.names
            ]
            found = np.zeros(scene.node.shape, np.bool_)
            for number in np.flatnonzero(named).tolist():
                found |= (_distances(xyz, xyz[:, number, None]) <= jammer.radius_m) & scene.alive[:, number, None]
            return found
        at = jammer.at
        places = [at] if isinstance(at, tuple) else self._xyz[self._ids == at, :2].tolist()
        found = np.zeros(scene.node.shape, np.bool_)
        for x, y in places:
            found |= _distances(xyz, np.array((x, y, 0.0))) <= jammer.radius_m
        return found

    # -- the log ------------------------------------------------------------------------------------------------

    def forget(self, games: IntArray) -> None:
        """Forget the messages of some games."""
        super().forget(games)
        self._under_way = [(left, some_rows(sent, ~np.isin(sent.at, games))) for left, sent in self._under_way]

    def _entries(self, noted: list[_Sent]) -> Iterator[tuple[int, dict[str, Any]]]:
        rows = [row for sent in noted for row in self._written(sent)]
        for game, _, entry in sorted(rows, key=lambda row: row[:2]):
            yield game, entry

    def _written(self, sent: _Sent) -> list[tuple[int, int, dict[str, Any]]]:
        """Return game, place and the entry of the log of each message."""
        names, rows = self._roster.names, []
        for i, body in enumerate(map(to_plain, sent.bodies)):
            of = [np.flatnonzero(sent.outcome[i] == kind).tolist() for kind in (_HEARD, _OVERHEARD, _LOST, _JAMMED)]
            timed = [{names[agent]: int(sent.arrival[i, agent]) for agent in agents} for agents in of[:2]]
            entry = {
                "turn": int(sent.turns[i]),
                "channel": sent.channel,
                "sender": names[sent.senders[i]],
                "to": to_plain(sent.to[i]),
                "body": body,
                "size": len(to_bytes(body, "The body of a message")),
                "heard": timed[0],
                "overheard": timed[1],
                "lost": [names[agent] for agent in of[2]],
                "jammed": [names[agent] for agent in of[3]],
            }
            rows.append((int(sent.at[i]), int(sent.place[i]), entry))
        return rows


class _Waves:
    """How messages of one channel spread, from agent to agent."""

    def __init__(self, radio: Radio, channel: Channel, scene: Scene, at: IntArray, senders: IntArray, to: Any) -> None:
        self._radio, self._channel, self._scene = radio, channel, scene
        self._at, self._senders = at, senders
        self._xyz = np.concatenate((scene.xy, radio._xyz[scene.node][..., 2:]), axis=-1)
        self._may_use = np.array([channel.is_for(team) for team in radio._teams.values()], np.bool_)
        self._is_jammed = np.zeros(scene.node.shape, np.bool_)
        for jammer in channel.jammers:
            self._is_jammed |= radio.jammed(jammer, scene, self._xyz)
        named = {one: receivers_of(one, radio._teams) for one in set(to.tolist())}
        kinds = {one: np.array([name in those for name in radio._teams], np.bool_) for one, those in named.items()}
        self._is_meant = np.stack([kinds[one] for one in to.tolist()]) & self._may_use & scene.alive[at]
        self._is_meant[np.arange(len(at)), senders] = False
        self._losses = as_chances(channel.loss, "loss") if channel.loss else None
        self._purposes = np.zeros(len(at), np.uint64)
        for sender in np.unique(senders).tolist():
            purposes, of_one = scene.purposes("channel", channel.name, radio._roster.names[sender]), senders == sender
            self._purposes[of_one] = purposes[scene.games[at[of_one]]]
        pairs = at * len(self._may_use) + senders  # ascending: the messages of a sender follow each other
        starts = np.searchsorted(pairs, pairs)
        self._k = np.arange(len(pairs)) - starts

    def outcomes(self, turns: IntArray) -> tuple[IntArray, IntArray]:
        """Return what becomes of the messages, and when they arrive, (messages, agents)."""
        channel, jammed = self._channel, self._is_jammed[self._at]
        overhears = self._matching(channel.eavesdroppers)
        can_hear = ~jammed & self._scene.alive[self._at]
        can_hear[np.arange(len(self._at)), self._senders] = False
        if not channel.relay:
            can_hear &= self._is_meant | overhears
        wave, in_reach = self._spread(can_hear)
        heard, missed = wave > 0, in_reach & self._is_meant
        outcome = np.select(
            [heard & self._is_meant, heard & overhears & ~self._is_meant, missed & ~jammed, missed & jammed],
            [_HEARD, _OVERHEARD, _LOST, _JAMMED],
        )
        return outcome, np.where(heard, turns[:, None] + wave * channel.delay_turns, 0)

    def _spread(self, can_hear: BoolArray) -> tuple[IntArray, BoolArray]:
        """Return by how many transmissions messages come to agents, 0 for not at all, and whom they might reach."""
        channel, scene = self._channel, self._scene
        wave, in_reach = np.zeros(can_hear.shape, np.int64), np.zeros(can_hear.shape, np.bool_)
        relays = self._may_use if channel.relay is True else self._matching(channel.relay or ())
        keys = self._radio.keys(relay=bool(channel.relay))
        rows, transmitters, number = np.arange(len(wave)), self._senders, 1
        while len(rows):
            reaches, far = self._reached(rows, transmitters)
            np.logical_or.at(in_reach, rows, reaches)
            which, gets = np.nonzero(reaches & (can_hear & (wave == 0))[rows])
            of = rows[which]
            if self._losses is not None:
                names = keys[transmitters[which] if channel.relay else 0, gets]
                later = kernels.later_key_rows(
                    kernels.first_key_rows(self._purposes[of], names), scene.turns[self._at[of]]
                )
                draws = kernels.fraction_many(kernels.bits_at_rows(later, self._k[of]))
                comes = draws >= chances_at(far[which, gets], self._losses)
                of, gets = of[comes], gets[comes]
            is_new = np.zeros(wave.shape, np.bool_)
            is_new[of, gets] = True
            wave[is_new] = number
            rows, transmitters = np.nonzero(is_new & relays if channel.relay else is_new & False)
            number += 1
        return wave, in_reach

    def _matching(self, named: Sequence[Any]) -> BoolArray:
        """Return which agents, or whose teams, are named, (agents,)."""
        teams = self._radio._teams
        return np.array(matching(named, tuple(teams), teams.values()), np.bool_)

    def _reached(self, rows: IntArray, transmitters: IntArray) -> tuple[BoolArray, FloatArray]:
        """Return which agents transmitters of messages reach, and how far they are, (transmitters, agents)."""
        channel, scene, at = self._channel, self._scene, self._at[rows]
        far = _distances(self._xyz[at], self._xyz[at, transmitters][:, None])
        reaches = scene.alive[at] & (far <= (np.inf if channel.range_m is None else channel.range_m))
        if channel.hops is not None:
            edges = scene.hops().distances(scene.node[at, transmitters][:, None], scene.node[at])
            reaches &= edges <= channel.hops
        reaches[np.arange(len(rows)), transmitters] = False
        if channel.line_of_sight:
            reaches = self._radio.in_sight(self._xyz[at], transmitters, reaches)
        return reaches, far


def _as_key(to: object) -> Hashable:
    if not isinstance(to, Hashable):
        raise BadType(f"The receiver of a message is an agent, a team or None, not {shown(to)}.")
    return to


def _distances(xyz: FloatArray, place: FloatArray) -> FloatArray:
    ways = xyz - place
    distances: FloatArray = np.sqrt((ways * ways).sum(axis=-1))
    return distances


def why_not_sent(channels: Mapping[str, Channel]) -> str | None:
    """Return what has no array form of channels, in words; None: all has."""
    for name, channel in channels.items():
        if channel.max_bytes_per_turn is not None:
            return f"channel {name!r}, which bounds what is sent in a turn"
    return None
