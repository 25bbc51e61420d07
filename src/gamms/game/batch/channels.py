"""Messages of many games at once: what array strategies send, who hears it, and what is under way."""

from collections.abc import Hashable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from gamms.arguments import as_key
from gamms.core import messages as core
from gamms.errors import BadType, BadValue, UnknownName
from gamms.game.batch.columns import GameLog, Roster, joined_rows, places_of, some_rows
from gamms.game.channels import Channel, bytes_of, flaw_of, receivers_of, refusals, size_of
from gamms.game.messages import Fates, Scene, fates_of
from gamms.ir.graph import IntArray
from gamms.ir.obstacles import BoolArray
from gamms.plain import to_plain, why_not_plain
from gamms.text import shown

MOST_AT_ONCE = 1 << 20  # messages of one agent in a turn


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
        return self._replace(order=moment * MOST_AT_ONCE + self.order)


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
    """Messages of one channel and turn, (messages,), and what became of them."""

    channel: str
    at: IntArray  # -1: of a game that was forgotten
    turns: IntArray  # numbers of the turns, from 1
    senders: IntArray
    to: np.ndarray[Any, Any]
    bodies: list[Any]
    place: IntArray  # of several messages of a game and turn, that with the smaller number comes first
    fates: Fates


class Radio(GameLog[list[_Sent]]):
    """The channels of a game, and what was sent by them in all games of a batch.

    Args:
        channels: by name.
        roster: of every game.
        num_games: of the batch.
    """

    def __init__(self, channels: Mapping[str, Channel], roster: Roster, num_games: int) -> None:
        super().__init__(num_games)
        self.channels, self._roster = channels, roster
        self.teams = dict(zip(roster.names, (roster.teams[number] for number in roster.team_of), strict=True))
        self._under_way: list[tuple[int, _Sent]] = []  # for how many turns more, and what

    # -- sending ------------------------------------------------------------------------------------------------

    def checked(
        self, channel: str, where: BoolArray, games: IntArray, agents: IntArray, to: object, body: object, order: int
    ) -> Outbox:
        """Return what agents send in these games, checked, as `ArrayView.send`; `order` is the place among theirs."""
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
        elif to is not None and not receivers_of(_as_key(to), self.teams):
            raise UnknownName("agent or team", to, [*self.teams, *self._roster.teams])
        if isinstance(body, np.ndarray) and body.shape[:2] != where.shape:
            raise BadValue(
                f"The first axes of an array of bodies are {where.shape}, games and agents: not {body.shape}."
            )
        bodies = body[at, which].tolist() if isinstance(body, np.ndarray) else [body] * len(at)
        for one in bodies if isinstance(body, np.ndarray) and body.dtype == object else [body] * (len(at) > 0):
            if not isinstance(one, np.ndarray) and (flaw := why_not_plain(one)):
                raise BadType(f"The body must be a plain value, such as numbers, texts, lists and dicts: body{flaw}.")
        order_of_each, to_each = np.full(len(at), order), np.fromiter(receivers, object, len(at))
        return Outbox(channel, games[at], senders, to_each, bodies, order_of_each)

    def sendable(self, boxes: Sequence[Outbox], is_there: BoolArray) -> tuple[list[Outbox], list[tuple[int, int, str]]]:
        """Return what agents can send of what they want to send when they are asked, and what is wrong with the rest.

        Args:
            boxes: in each an agent sends one message at most.
            is_there: (games of the batch, agents) which agents are in the game, dead or alive.

        Returns:
            messages, and of each that cannot be sent the game, the sender, and why; see `refusals`.
        """
        found, flaws, place = list[Outbox](), list[tuple[int, int, str]](), np.zeros(is_there.shape, np.int64)
        left = {name: bytes_of(one, is_there.shape) for name, one in self.channels.items()}
        for box in boxes:
            channel, sizes = self.channels[box.channel], np.zeros_like(box.at)
            if channel.max_bytes_per_turn is not None:
                size_by_id = {
                    id(body): size_of(to_plain(body)) for body in {id(one): one for one in box.bodies}.values()
                }
                sizes[:] = [size_by_id[id(body)] for body in box.bodies]
            sent = box.at, box.senders, box.to.tolist(), sizes
            errors = refusals(channel, sent, is_there, self.teams, left[box.channel])
            for row, error in errors.items():
                game, sender = int(box.at[row]), int(box.senders[row])
                flaws.append((game, sender, flaw_of(int(place[game, sender]), error)))
            place[box.at, box.senders] += 1
            found.append(box.those(~np.isin(np.arange(len(box.at)), [*errors])) if errors else box)
        return found, flaws

    def send(self, games: IntArray, scene: Scene, outboxes: Sequence[Outbox]) -> None:
        """Work out who hears what is sent in these games of the scene; what dead agents send is dropped."""
        number, sent = places_of(games, len(self._of_game)), list[_Sent]()
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
                fates = fates_of(self.channels[name], scene, at, senders, box.to.tolist())
                moment, order = np.divmod(box.order, MOST_AT_ONCE)
                place = (moment * len(self._roster.names) + senders) * MOST_AT_ONCE + order
                turns = scene.turns[at] + 1
                sent.append(_Sent(name, box.at, turns, senders, box.to, box.bodies, place, fates))
        self._pending.append(sent)
        for one in sent:
            last = int((one.fates.arrivals - one.turns[one.fates.messages]).max(initial=0))
            self._under_way.append((last, one))

    def _named(self, to: np.ndarray[Any, Any], shape: tuple[int, ...]) -> np.ndarray[Any, Any]:
        """Return the names of receivers, (games, agents), that are given by their numbers."""
        names = np.array(self._roster.names, object)
        if to.dtype.kind not in "iu" or to.shape not in (shape, shape[1:], ()) or ((to < 0) | (to >= len(names))).any():
            raise BadValue(
                f"Receivers of messages are numbers of agents from 0 to {len(names) - 1}, an array {shape}, not "
                f"{shown(to)}."
            )
        return np.broadcast_to(names[to], shape)

    def end_turn(self) -> None:
        """Forget what has arrived everywhere."""
        self._under_way = [(left - 1, sent) for left, sent in self._under_way if left > 0]

    def heard(self, channel: str, games: IntArray, turns: IntArray, agents: IntArray, asked: BoolArray) -> Heard:
        """Return what agents hear by a channel in the turn that comes; see `Heard`."""
        if as_key(channel, "The name of a channel") not in self.channels:
            raise UnknownName("channel", channel, self.channels)
        number = places_of(games, len(self._of_game) + 1)  # at last the place of games that were forgotten
        column = places_of(agents, len(self._roster.names))
        none = np.zeros(0, np.int64)
        found, places = [Heard(none, none, none, [], none, none > 0)], [none]
        for _, sent in self._under_way:
            if sent.channel != channel:
                continue
            fates = sent.fates
            at, hearers = number[sent.at[fates.messages]], column[fates.agents]
            arrives = (at >= 0) & (hearers >= 0) & (fates.arrivals == turns[at] + 1)
            rows = np.flatnonzero(arrives & asked[at, hearers])
            which, overheard = fates.messages[rows], fates.outcomes[rows] == core.OVERHEARD
            bodies = [sent.bodies[message] for message in which.tolist()]
            found.append(Heard(at[rows], hearers[rows], sent.senders[which], bodies, sent.turns[which] - 1, overheard))
            places.append(sent.place[which])
        heard = joined_rows(found)
        keys = heard.overheard, np.concatenate(places), heard.turns, heard.hearers, heard.at
        return some_rows(heard, np.lexsort(keys))

    def go_on(self, games: IntArray, entries: Sequence[dict[str, Any]], turn: int) -> None:
        """Let some games begin after so many turns, with these messages in their logs, of which some are under way."""
        self.begin(games, entries)
        number = {name: i for i, name in enumerate(self._roster.names)}
        for place, entry in enumerate(entries):
            arrivals = [
                (number[name], outcome, arrival)
                for outcome, key in ((core.HEARD, "heard"), (core.OVERHEARD, "overheard"))
                for name, arrival in entry[key].items()
                if name in number
            ]
            last = max((arrival for *_, arrival in arrivals), default=0)
            if last > turn:
                columns = (np.tile(column, len(games)) for column in np.array(arrivals).T)
                fates = Fates(np.repeat(np.arange(len(games)), len(arrivals)), *columns)
                sender, to, bodies = number[entry["sender"]], np.full(len(games), None), [entry["body"]] * len(games)
                turns, senders, places = (np.full(len(games), one) for one in (entry["turn"], sender, place))
                sent = _Sent(entry["channel"], games, turns, senders, to, bodies, places, fates)
                self._under_way.append((last - turn - 1, sent))

    # -- the log ------------------------------------------------------------------------------------------------

    def forget(self, games: IntArray) -> None:
        """Forget the messages of some games."""
        super().forget(games)
        for row, (left, sent) in enumerate(self._under_way):
            at = np.where(np.isin(sent.at, games), -1, sent.at)
            self._under_way[row] = left, sent._replace(at=at)

    def _entries(self, noted: list[_Sent]) -> Iterator[tuple[int, dict[str, Any]]]:
        rows = [row for sent in noted for row in self._written(sent)]
        for game, _, entry in sorted(rows, key=lambda row: row[:2]):
            yield game, entry

    def _written(self, sent: _Sent) -> list[tuple[int, int, dict[str, Any]]]:
        """Return game, place and the entry of the log of each message."""
        names, rows, fates = self._roster.names, [], sent.fates.entries(self._roster.names, len(sent.at))
        for i, body in enumerate(map(to_plain, sent.bodies)):
            entry = {
                "turn": int(sent.turns[i]),
                "channel": sent.channel,
                "sender": names[sent.senders[i]],
                "to": to_plain(sent.to[i]),
                "body": body,
                "size": size_of(body),
                **next(fates),
            }
            rows.append((int(sent.at[i]), int(sent.place[i]), entry))
        return rows


def _as_key(to: object) -> Hashable:
    if not isinstance(to, Hashable):
        raise BadType(f"The receiver of a message is an agent, a team or None, not {shown(to)}.")
    return to
