"""Messages of many games at once: checks, outcomes and inboxes."""

from collections.abc import Callable, Collection, Hashable, Iterable, Iterator, Mapping, Sequence
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np

from gamms.arguments import as_key
from gamms.core import messages as core
from gamms.errors import BadType, BadValue, UnknownName
from gamms.game.block.columns import AgentTable, Failure
from gamms.game.channels import (
    Channel,
    Outgoing,
    as_body,
    bytes_of,
    flaw_of,
    receivers_of,
    refusals,
    refuse_others,
    size_of,
)
from gamms.game.messages import MessageOutcomes, MessagePositions, entry_of, outcomes_of
from gamms.ir.columns import GameLog, joined_rows, places_of, some_rows
from gamms.ir.graph import IntArray
from gamms.ir.obstacles import BoolArray
from gamms.plain import to_plain
from gamms.text import shown

_MOST_OF_ONE = 1 << 20  # messages of one agent in a turn
_UNKNOWN = -1  # size of a body


class OutgoingMessages(NamedTuple):
    """Messages that agents send together by one channel; arrays are (messages,).

    Attributes:
        channel: the name of the channel.
        at: the game of each message, as a number in the batch.
        senders: the number of the sender in the roster.
        to: the recipient: an agent, a team, or None.
        bodies: the bodies.
        sizes: the sizes of the bodies, bytes; -1: unknown.
        order: orders the messages of one agent; `MessageTraffic.admit` adds a multiple of 2**20 for its number in the
            turn.
    """

    channel: str
    at: IntArray
    senders: IntArray
    to: list[Any]
    bodies: list[Any]
    sizes: IntArray
    order: IntArray


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


class _SentMessages(NamedTuple):
    """Sent messages of one channel, and their outcomes.

    Attributes:
        box: the messages; game -1: the messages of the game were dropped.
        turns: (messages,) the turn of each message, from 1.
        place: (messages,) orders the messages of one game and turn.
        fates: the outcomes of the messages.
    """

    box: OutgoingMessages
    turns: IntArray
    place: IntArray
    fates: MessageOutcomes


class MessageTraffic(GameLog[list[_SentMessages]]):
    """The channels of a game, and the messages of all games of a batch.

    In each turn, `post` and `post_checked` collect messages, `admit` refuses messages that the channels do not accept,
    and `send` determines the receivers of the others after all agents have moved.

    Args:
        channels: the channels by name.
        roster: the agents of every game.
        part_of: (agents,) the part of the turn in which each agent decides.
        num_games: the number of games in the batch.
    """

    def __init__(self, channels: Mapping[str, Channel], roster: AgentTable, part_of: IntArray, num_games: int) -> None:
        super().__init__(num_games)
        self.channels = channels
        self._roster = roster
        self._part_of = part_of
        self.teams = dict(zip(roster.names, (roster.teams[number] for number in roster.team_of), strict=True))
        self._under_way: list[tuple[int, _SentMessages]] = []  # (remaining turns, messages)
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

    def checked(
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
        team_of = self._roster.team_of
        for number in np.unique(team_of[senders]).tolist():
            refuse_others(self.channels[channel], self._roster.teams[number])
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
            if not isinstance(one, np.ndarray):
                as_body(one)
        sizes = np.full(len(at), _UNKNOWN)
        orders = np.full(len(at), order)
        return OutgoingMessages(channel, games[at], senders, receivers, bodies, sizes, orders)

    def _named(self, to: np.ndarray[Any, Any], shape: tuple[int, ...]) -> np.ndarray[Any, Any]:
        """Return the names of receivers, (games, agents), from their numbers."""
        names = np.array(self._roster.names, object)
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

    def post_checked(self, game: int, messages: Sequence[Outgoing], flaws: Iterable[Failure]) -> None:
        """Add messages of a game that the channels accept, and the errors of other messages."""
        for order, one in enumerate(messages):
            self._checked.setdefault(one.channel, []).append((game, one, order))
        self._flaws += flaws

    def admit(self, part: int, is_there: BoolArray) -> list[Failure]:
        """Check the posted messages of a part of the turn; return the errors of refused messages, by game and agent.

        Args:
            part: the part of the turn.
            is_there: (games of the batch, agents) whether the agent is in the game, dead or alive.
        """
        here = [box for box in self._posted if self._part_of[box.senders[0]] == part]
        self._posted = [box for box in self._posted if self._part_of[box.senders[0]] != part]
        self._first_admitted = len(self._admitted)
        flaws = self._flaws + self._take_posted(here, is_there)
        self._flaws = []
        number_of = {name: number for number, name in enumerate(self._roster.names)}
        for channel, rows in self._checked.items():
            games, messages, orders = zip(*rows, strict=True)
            senders = [number_of[one.sender] for one in messages]
            to, bodies, sizes = ([getattr(one, name) for one in messages] for name in ("to", "body", "size"))
            box = OutgoingMessages(
                channel, np.array(games), np.array(senders), to, bodies, np.array(sizes), np.array(orders)
            )
            self._admitted.append(box)
        self._checked = {}
        for box in self._admitted[self._first_admitted :]:
            box.order[:] += self._admissions * _MOST_OF_ONE
        self._admissions += 1
        return sorted(flaws, key=attrgetter("game", "agent"))

    def withdraw(self, failed: Collection[tuple[int, int]]) -> None:
        """Drop the messages of the last admission by agents whose action failed, given as (game, agent) pairs."""
        for number, box in enumerate(self._admitted[self._first_admitted :], self._first_admitted):
            senders = zip(box.at.tolist(), box.senders.tolist(), strict=True)
            self._admitted[number] = some_rows(box, np.array([one not in failed for one in senders], np.bool_))

    def _take_posted(self, boxes: Sequence[OutgoingMessages], is_there: BoolArray) -> list[Failure]:
        """Admit posted messages that the channels accept; return the errors of the others."""
        flaws = list[Failure]()
        place = np.zeros(is_there.shape, np.int64)
        left = {name: bytes_of(one, is_there.shape) for name, one in self.channels.items()}
        for box in boxes:
            channel = self.channels[box.channel]
            if channel.max_bytes_per_turn is not None:
                by_id = {id(body): body for body in box.bodies}
                size_by_id = {key: size_of(to_plain(body)) for key, body in by_id.items()}
                box.sizes[:] = [size_by_id[id(body)] for body in box.bodies]
            sent = box.at, box.senders, box.to, np.maximum(box.sizes, 0)
            errors = refusals(channel, sent, is_there, self.teams, left[box.channel])
            for row, error in errors.items():
                game = int(box.at[row])
                sender = int(box.senders[row])
                flaws.append(Failure.illegal(game, sender, flaw_of(int(place[game, sender]), error)))
            place[box.at, box.senders] += 1
            self._admitted.append(some_rows(box, ~np.isin(np.arange(len(box.at)), [*errors])) if errors else box)
        return flaws

    @property
    def is_sending(self) -> bool:
        """Return whether there are messages to send in this turn."""
        return len(self._admitted) > 0

    def send(self, games: IntArray, scene: MessagePositions) -> None:
        """Find the outcomes of the messages of these games; messages of dead agents are dropped."""
        number = places_of(games, self._num_games)
        sent = list[_SentMessages]()
        for name in self.channels:
            boxes = [box for box in self._admitted if box.channel == name]
            if not boxes:
                continue
            box = joined_rows(boxes)
            at = number[box.at]
            those = np.flatnonzero((at >= 0) & scene.alive[at, box.senders])
            if not len(those):
                continue
            box = some_rows(box, those[np.lexsort((box.order[those], box.senders[those], at[those]))])
            at = number[box.at]
            senders = box.senders
            fates = outcomes_of(self.channels[name], scene, at, senders, box.to)
            admission, order = np.divmod(box.order, _MOST_OF_ONE)
            agents = admission * len(self._roster.names) + senders
            sent.append(_SentMessages(box, scene.turns[at] + 1, agents * _MOST_OF_ONE + order, fates))
        self._pending.append(sent)
        for one in sent:
            self._under_way.append((int((one.fates.arrivals - one.turns[one.fates.messages]).max(initial=0)), one))

    def end_turn(self) -> None:
        """Drop messages that have arrived in all games."""
        self._under_way = [(left - 1, sent) for left, sent in self._under_way if left > 0]

    # -- hearing ------------------------------------------------------------------------------------------------

    def heard(
        self, channel: str, games: IntArray, turns: IntArray, agents: IntArray, asked: BoolArray
    ) -> ReceivedMessages:
        """Return the messages that agents hear by a channel in the next turn; see `ReceivedMessages`."""
        if as_key(channel, "The name of a channel") not in self.channels:
            raise UnknownName("channel", channel, self.channels)
        none = np.zeros(0, np.int64)
        found = [ReceivedMessages(none, none, none, [], none, none > 0)]
        places = [none]
        number = places_of(games, self._num_games + 1)  # the last entry, index -1, is for dropped games
        column = places_of(agents, len(self._roster.names))
        for _, sent in self._under_way:
            if sent.box.channel != channel:
                continue
            fates = sent.fates
            box = sent.box
            at = number[box.at[fates.messages]]
            hearers = column[fates.agents]
            arrives = (at >= 0) & (hearers >= 0) & (fates.arrivals == turns[at] + 1)
            rows = np.flatnonzero(arrives & asked[at, hearers])
            which = fates.messages[rows]
            overheard = fates.outcomes[rows] == core.OVERHEARD
            bodies = [box.bodies[message] for message in which.tolist()]
            found.append(
                ReceivedMessages(at[rows], hearers[rows], box.senders[which], bodies, sent.turns[which] - 1, overheard)
            )
            places.append(sent.place[which])
        heard = joined_rows(found)
        keys = heard.overheard, np.concatenate(places), heard.turns, heard.hearers, heard.at
        return some_rows(heard, np.lexsort(keys))

    # -- the log ------------------------------------------------------------------------------------------------

    def go_on(self, games: IntArray, entries: Sequence[dict[str, Any]], turn: int) -> None:
        """Start the empty logs of games after `turn` turns with earlier messages; some may still have to arrive."""
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
                fates = MessageOutcomes(np.repeat(np.arange(len(games)), len(arrivals)), *columns)
                senders, turns, places = (
                    np.full(len(games), one) for one in (number.get(entry["sender"], -1), entry["turn"], place)
                )
                to = [entry["to"]] * len(games)
                bodies = [entry["body"]] * len(games)
                box = OutgoingMessages(entry["channel"], games, senders, to, bodies, places, places)
                self._under_way.append((last - turn - 1, _SentMessages(box, turns, places, fates)))

    def forget(self, games: IntArray) -> None:
        """Drop the messages of some games."""
        super().forget(games)
        for row, (left, sent) in enumerate(self._under_way):
            at = np.where(np.isin(sent.box.at, games), -1, sent.box.at)
            self._under_way[row] = left, sent._replace(box=sent.box._replace(at=at))

    def clear(self) -> None:
        """Drop the messages of all games."""
        super().clear()
        self._under_way.clear()

    def checkpoint(self) -> Callable[[], None]:
        """Return a function that undoes all later changes."""
        undo_log = super().checkpoint()
        under_way = [*self._under_way]

        def undo() -> None:
            undo_log()
            self._under_way = under_way

        return undo

    def _entries(self, noted: list[_SentMessages]) -> Iterator[tuple[int, dict[str, Any]]]:
        rows = [row for sent in noted for row in self._written(sent)]
        for game, _, entry in sorted(rows, key=lambda row: row[:2]):
            yield game, entry

    def _written(self, sent: _SentMessages) -> Iterator[tuple[int, int, dict[str, Any]]]:
        """Yield (game, place, log entry) for each message."""
        names = self._roster.names
        box = sent.box
        fates = sent.fates
        columns = box.at.tolist(), sent.place.tolist(), sent.turns.tolist(), box.senders.tolist(), box.sizes.tolist()
        found = fates.entries(names, len(box.at))
        for game, place, turn, sender, size, to, body, fate in zip(*columns, box.to, box.bodies, found, strict=True):
            plain = to_plain(body)
            known = size_of(plain) if size == _UNKNOWN else size
            yield game, place, entry_of(Outgoing(names[sender], box.channel, to_plain(to), plain, known), turn, fate)


def radio_of(settings: Mapping[str, Any], roster: AgentTable, num_games: int) -> MessageTraffic | None:
    """Return the channels of a game with these settings; None: it has none."""
    part_of = roster.part_of(settings["order"])
    channels = settings["channels"]
    return MessageTraffic(channels, roster, part_of, num_games) if channels else None


def _as_key(to: object) -> Hashable:
    if not isinstance(to, Hashable):
        raise BadType(f"The receiver of a message is an agent, a team or None, not {shown(to)}.")
    return to
