"""What each audience of a live game is sent: what a page holds, a header and parts of turns.

The thread that plays only hands over what has happened. It becomes bytes when a connection asks for it, in a part of
all turns since then, so that spectators cost a game that waits between its turns nothing. Each message is deflated by
itself, once for all connections.

A stream holds the parts of the last turns only, and at least one that is whole, which needs none before it; all
connections of an audience read the same bytes. One that falls behind them begins again at the last whole part, and the
turns between are counted as dropped: no connection has a queue of its own, and none can make the game wait.
"""

import zlib
from collections import deque
from collections.abc import Callable, Iterator
from copy import deepcopy
from functools import partial
from itertools import islice
from threading import Lock
from typing import Any, NamedTuple

from gamms.ir import events as kinds
from gamms.ir.events import Log, events_of
from gamms.ir.graph import GraphColumns
from gamms.recorder.cut import KnowledgeFilter, cut_header, sides_of
from gamms.recorder.detached import DetachedState
from gamms.recorder.sensed import Nearest, nearest_on
from gamms.web.columns import MAGIC, frame
from gamms.web.links import Audience
from gamms.web.pages import drawn_header
from gamms.web.painter import Painter
from gamms.web.server import Connection

_KEYFRAME_TURNS = 64
_MOST_WAITING = 1 << 11  # agents in the parts of turns that wait to become bytes
_MOST_PARTS = 256  # likewise
_KEYFRAME_BYTES = 1 << 20  # of blocks behind a keyframe, after which there is another one
_MOST_BYTES = 1 << 22  # of blocks that are kept
_PIECE = 1 << 18  # bytes that become one message, and that are sent at once

Keyframe = dict[str, Any]


class StreamPosition(NamedTuple):
    """How far a connection is in what it is sent."""

    stream: "AudienceStream"
    number: int  # of the next part
    turns: int  # that come before it


class AudienceStream:
    """What one audience is sent, from some turn of one game on.

    Args:
        audience: whose knowledge it is.
        header: of the game.
        state: the whole state, which is the first keyframe; not kept.
        turns: how many were played before.
        nearest: the id of the node below a place, (x, y).

    Attributes:
        opening: the messages with the first bytes of a recording, and its header.
        last_keyframe: where the last keyframe is.
    """

    def __init__(self, audience: Audience, header: Keyframe, state: Keyframe, turns: int, nearest: Nearest) -> None:
        is_everything, visuals = audience.is_everything, header.get("visuals")
        self._cut = None if is_everything else KnowledgeFilter(state, audience.has, nearest, visuals)
        if self._cut is not None:
            state = self._cut.keyframe(0)
            header = {**cut_header(header, self._cut), "sides": header["sides"], "audience": str(audience)}
        self._painter = Painter(header, state, turns)
        self._turns = turns  # that were given out
        self._begun_at = turns
        self._is_seen = False  # whether a whole part or a turn says what is seen at the beginning
        self.opening = _messages(MAGIC + frame(drawn_header(header)))
        self._lock = Lock()
        self._parts: deque[tuple[list[bytes], int]] = deque()  # messages, and how many turns are over behind them
        self._first = 0  # number of the first part
        self.last_keyframe = StreamPosition(self, 0, turns)
        self._size = self._since_keyframe = 0  # bytes
        self._add_keyframe()

    def hear(self, log: Log, whole: Log, *, is_over: bool) -> None:
        """Take what has happened; `write` gives it out.

        Args:
            log: since the last call.
            whole: since the last turn.
            is_over: whether this turn is over.
        """
        if self._cut is None:
            if is_over:
                self._add_turn(whole)
            return
        cut = self._cut
        for given in cut.add(log, is_end=is_over):
            self._add_turn(given)
        if not self._is_seen and (cut.is_shown or is_over):  # what is seen before the first turn is in none
            self._painter.restore(cut.keyframe(self._turns - self._begun_at))
            self._add_keyframe()
            self._is_seen = True

    def write(self) -> None:
        """Give out the turns that were taken, in a part of their own."""
        if part := self._painter.part():
            self._add(part)

    def close(self) -> None:
        """Follow the game no longer."""
        self._painter.close()

    def end(self) -> None:
        """Give out the last turn, behind which nothing is sensed."""
        for given in () if self._cut is None else self._cut.rest():
            self._add_turn(given)
            self._is_seen = False  # if it goes on
        self.write()

    def _add_turn(self, log: Log) -> None:
        self._painter.add(log)
        self._turns += 1
        if (self._turns - self._begun_at) % _KEYFRAME_TURNS == 0 or self._since_keyframe > _KEYFRAME_BYTES:
            self._add_keyframe()

    def _add_keyframe(self) -> None:
        self.write()
        self._painter.begin()
        self._add(self._painter.part(), is_keyframe=True)

    def _add(self, part: bytes, *, is_keyframe: bool = False) -> None:
        messages = _messages(part)
        size = sum(map(len, messages))
        with self._lock:
            self._parts.append((messages, self._turns))
            self._size += size
            self._since_keyframe = 0 if is_keyframe else self._since_keyframe + size
            if is_keyframe:
                self.last_keyframe = StreamPosition(self, self._first + len(self._parts) - 1, self._turns)
            while self._size > _MOST_BYTES and self._first < self.last_keyframe.number:
                self._size -= sum(map(len, self._parts.popleft()[0]))
                self._first += 1

    def read(self, place: StreamPosition) -> tuple[list[bytes], StreamPosition, int]:
        """Return the next messages from a place on, the place behind them, and how many turns were dropped."""
        found = list[bytes]()
        with self._lock:
            begin = after = self.last_keyframe if place.number < self._first else place
            for messages, turns in islice(self._parts, begin.number - self._first, None):
                found += messages
                after = StreamPosition(self, after.number + 1, turns)
                if sum(map(len, found)) > _PIECE:
                    break
        return found, after, begin.turns - place.turns


class Streams:
    """The streams of a game that is played, one for each audience that is followed; a `Follower` of `ctx.record`.

    Args:
        columns: returns the map as arrays.

    Attributes:
        turns: that were played since it began.
    """

    def __init__(self, columns: Callable[[], GraphColumns]) -> None:
        self.turns = 0
        self._columns = columns
        self._lock = Lock()
        self._waiting: deque[tuple[Log, bool]] = deque()  # what was heard and is in no stream yet
        self._most_waiting = 0
        self._error: Exception | None = None  # what was wrong with it
        self._state: DetachedState | None = None  # after the last whole turn that is in the streams
        self._turns = 0  # of that
        self._since: Log = []  # what has happened since then
        self._header: Keyframe = {}
        self._drawings: dict[str, Any] = {}  # what artists draw now, by their names
        self._sides: Callable[[Callable[[str, Any], bool]], Any]  # that are known to agents
        self._streams: dict[Audience, AudienceStream | None] = {}  # of those who follow; None before there is a game

    def begin(self, header: Keyframe, state: Keyframe) -> None:
        """Begin with all audiences; see `Follower`."""
        with self._lock:
            self._waiting.clear()
            self._most_waiting = min(max(_MOST_WAITING // max(len(state["names"]), 1), 1), _MOST_PARTS)
            self._header, self._since, self.turns, self._turns = header, [], 0, 0
            self._drawings = {one["artist"]: one for one in header.get("drawings", [])}
            self._sides = partial(sides_of, header, {name: state[name] for name in ("names", "teams")})
            self._state, self._error = DetachedState(deepcopy(state)), None
            self._close()
            self._streams = {audience: self._begun(audience) for audience in self._streams}

    def hear(self, log: Log, *, is_over: bool) -> None:
        """Take what has happened, for the thread that asks for it next, unless too much waits; see `Follower`.

        Raises:
            Damaged: something that a program has written fits no state; it may have been heard before.
        """
        if self._error is not None:
            raise self._error
        self.turns += is_over
        self._waiting.append((log, is_over))
        if len(self._waiting) >= self._most_waiting:
            with self._lock:
                self._catch_up()

    def _catch_up(self) -> None:
        """Add to all streams what waits."""
        if not self._waiting or self._state is None:
            return
        streams = [stream for stream in self._streams.values() if stream is not None]
        try:
            while self._waiting:
                self._add(self._state, streams, *self._waiting.popleft())
        except Exception as error:
            self._close()
            self._error, self._state, self._streams = error, None, dict.fromkeys(self._streams)
            raise
        for stream in streams:
            stream.write()

    def _add(self, state: DetachedState, streams: list[AudienceStream], log: Log, is_over: bool) -> None:
        self._since += log
        if is_over:
            state.apply(self._since)
            self._turns += 1
            for kind, data in events_of(self._since):
                if kind == kinds.VISUALS:
                    self._header = self._header | {"visuals": data}
                elif kind == kinds.VISUAL_COMMANDS:
                    self._drawings[data["artist"]] = data
        for stream in streams:
            stream.hear(log, self._since, is_over=is_over)
        if is_over:
            self._since = []

    def end(self) -> None:
        """Give out the last turn to all, because the game is over."""
        with self._lock:
            self._catch_up()
            for stream in filter(None, self._streams.values()):
                stream.end()

    def of(self, audience: Audience) -> AudienceStream | None:
        """Return the stream of an audience, which begins now if there was none; None before there is a game."""
        with self._lock:
            self._catch_up()
            if self._streams.get(audience) is None:
                self._streams[audience] = None if self._state is None else self._begun(audience)
            return self._streams[audience]

    @property
    def have_cuts(self) -> bool:
        """Whether an audience is followed that is not sent everything."""
        return any(not audience.is_everything for audience in list(self._streams))

    def drop(self, audience: Audience) -> None:
        """Write no stream for an audience until it is asked for again."""
        with self._lock:
            stream = self._streams.pop(audience, None)
            if stream is not None:
                stream.close()

    def close(self) -> None:
        """Write no stream any more."""
        with self._lock:
            self._close()
            self._streams, self._state = {}, None

    def _close(self) -> None:
        for stream in filter(None, self._streams.values()):
            stream.close()

    def _begun(self, audience: Audience) -> AudienceStream:
        assert self._state is not None  # noqa: S101 - callers look
        state = self._state.keyframe(self._turns)
        sides = self._sides(lambda name, team: audience.is_everything or audience.has(name, team))
        header = self._header | {"sides": sides, "drawings": list(self._drawings.values())}
        stream = AudienceStream(audience, header, state, self._turns, nearest_on(self._columns))
        if self._since:
            stream.hear(self._since, self._since, is_over=False)
            stream.write()
        return stream


def news(streams: Streams, connection: Connection) -> Iterator[bytes]:
    """Yield the messages that a connection has not been sent yet, and note how far it is."""
    stream = streams.of(connection.grant.audience)
    if stream is None:
        return
    place = connection.place
    if place is None or place.stream is not stream:
        yield from stream.opening
        place = connection.place = stream.last_keyframe
    while True:
        messages, place, dropped = stream.read(place)
        connection.counts["dropped"] += dropped
        if dropped:  # it begins again
            yield from stream.opening
        connection.place = place
        if not messages:
            return
        yield from messages


def _messages(data: bytes) -> list[bytes]:
    """Return bytes as messages, each of which can be inflated by itself."""
    return [zlib.compress(data[at : at + _PIECE]) for at in range(0, len(data), _PIECE)]
