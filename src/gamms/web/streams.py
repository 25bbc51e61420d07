"""The streams of a live game, one for each audience: a header, and parts with the columns of one or several turns.

The game thread only packs the events of each turn into a history. They are encoded for an audience when one of its
connections asks for data, a few turns at a time, so that spectators do not slow down a game that waits between turns.
Each message is compressed separately, once for all connections.

A stream begins where the history begins: a late viewer receives all turns, encoded as for those who have watched
them. Of a long game, the history and each stream store the last turns, 4 MB each. A stream begins with a keyframe,
which can be read without earlier parts. All connections of an audience read the same bytes. A connection that falls
behind continues at the last keyframe, and the turns in between are counted as dropped. No connection has its own queue.
"""

import zlib
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from copy import deepcopy
from functools import partial
from itertools import islice
from threading import Lock
from typing import Any, NamedTuple

from gamms.ir import events as kinds
from gamms.ir.events import Log, list_events
from gamms.ir.graph import GraphColumns
from gamms.ir.packing import from_bytes, to_bytes
from gamms.knowledge.looks import make_nearest
from gamms.knowledge.sides import list_sides
from gamms.recorder.cut import KnowledgeFilter, cut_header
from gamms.recorder.detached import DetachedState
from gamms.web.columns import MAGIC, frame
from gamms.web.links import Audience, PartOfServer
from gamms.web.pages import select_header
from gamms.web.painter import Painter
from gamms.web.server import Connection

_KEYFRAME_TURNS = 64
_MOST_WAITING = 1 << 10  # agents, summed over the logs that are encoded at once
_MOST_PARTS = 64  # these logs
_KEYFRAME_BYTES = 1 << 20  # of parts after a keyframe, before the next keyframe
_MOST_BYTES = 1 << 22  # of the history, and of the stored parts of a stream
_PIECE = 1 << 18  # bytes, before compression, of one message
_OF_HEADER = (kinds.VISUALS, kinds.VISUAL_COMMANDS, kinds.WORLD)  # `artist` says which one is drawn

Keyframe = dict[str, Any]


class StreamPosition(NamedTuple):
    """The position of a connection in a stream."""

    stream: "AudienceStream"
    number: int  # the number of the next part
    turns: int  # the number of turns before it


class AudienceStream:
    """The stream of one audience, from some turn of a game on.

    Args:
        audience: the audience.
        header: the header of the recording of the game.
        state: the complete state at the beginning, from which the first keyframe is made.
        turns: the number of turns played before.
        get_map: returns the map in the header.
        number: the number in the history of the first log after the state.

    Attributes:
        opening: the messages with the magic bytes and the header.
        number: the number in the history of the next log.
        is_followed: whether connections read the stream.
    """

    def __init__(
        self,
        audience: Audience,
        header: Keyframe,
        state: Keyframe,
        turns: int,
        get_map: Callable[[], GraphColumns],
        number: int,
    ) -> None:
        is_everything = audience.is_everything
        visuals = header.get("visuals")
        nearest = make_nearest(get_map)
        self._cut = None if is_everything else KnowledgeFilter(state, audience.has, nearest, get_map, visuals)
        if self._cut is not None:
            state = self._cut.make_keyframe(0)
            header = {**cut_header(header, self._cut), "sides": header["sides"], "audience": str(audience)}
            header |= {"agents": sorted(audience.agents)} if audience.agents else {}
        self.number = number
        self.is_followed = True
        self._painter = Painter(header, state, turns)
        self._since: Log = []  # events after the last complete turn
        self._turns = turns  # that were written
        self._begun_at = turns
        self._is_seen = False  # whether what agents see at the beginning was written
        self.opening = _split_messages(MAGIC + frame(select_header(header)))
        self._lock = Lock()
        self._parts: deque[tuple[list[bytes], int]] = deque()  # messages, and the number of turns played after them
        self._first = 0  # the number of the first stored part
        self._keyframes = deque[StreamPosition]()  # among the stored parts; the first part is one
        self._size = 0  # bytes
        self._since_keyframe = 0
        self._add_keyframe()

    @property
    def first_keyframe(self) -> StreamPosition:
        """The position of the first stored part, at which new connections begin."""
        return self._keyframes[0]

    @property
    def last_keyframe(self) -> StreamPosition:
        """The position of the last keyframe."""
        return self._keyframes[-1]

    def hear(self, log: Log, *, is_over: bool) -> None:
        """Add events; `write` encodes them.

        Args:
            log: the events since the last call.
            is_over: whether the turn has ended.
        """
        if self._cut is None:
            self._since += log
            if is_over:
                self._add_turn(self._since)
                self._since = []
            return
        cut = self._cut
        for given in cut.add(log, is_end=is_over):
            self._add_turn(given, cut.looked)
        if not self._is_seen and (cut.is_shown or is_over):  # no turn contains sensor data from before the first turn
            self._painter.restore(cut.make_keyframe(self._turns - self._begun_at))
            self._painter.look_ahead(cut.looked)
            self._add_keyframe()
            self._is_seen = True

    def write(self) -> None:
        """Encode the added turns as one part."""
        if part := self._painter.encode_part():
            self._add(part)

    def close(self) -> None:
        """Stop following the game."""
        self._painter.close()

    def end(self) -> None:
        """Encode the last turn of the game; no sensing follows it."""
        for given in () if self._cut is None else self._cut.take_rest():
            self._add_turn(given)
            self._is_seen = False  # in case the game continues
        self.write()

    def _add_turn(self, log: Log, looked: Sequence[dict[str, Any]] = ()) -> None:
        """Add a turn, and the sensor reports that follow it, if they are known."""
        self._painter.add(log)
        self._painter.look_ahead(looked)
        self._turns += 1
        if (self._turns - self._begun_at) % _KEYFRAME_TURNS == 0 or self._since_keyframe > _KEYFRAME_BYTES:
            self._add_keyframe()

    def _add_keyframe(self) -> None:
        self.write()
        self._painter.begin()
        self._add(self._painter.encode_part(), is_keyframe=True)

    def _add(self, part: bytes, *, is_keyframe: bool = False) -> None:
        messages = _split_messages(part)
        size = sum(map(len, messages))
        with self._lock:
            self._parts.append((messages, self._turns))
            self._size += size
            self._since_keyframe = 0 if is_keyframe else self._since_keyframe + size
            if is_keyframe:
                self._keyframes.append(StreamPosition(self, self._first + len(self._parts) - 1, self._turns))
            while self._size > _MOST_BYTES and len(self._keyframes) > 1:
                self._keyframes.popleft()
                while self._first < self.first_keyframe.number:
                    self._size -= sum(map(len, self._parts.popleft()[0]))
                    self._first += 1

    def read(self, place: StreamPosition) -> tuple[list[bytes], StreamPosition, int]:
        """Read messages from a position on.

        Returns:
            The messages, the position after them, and the number of dropped turns.
        """
        found = list[bytes]()
        with self._lock:
            begin = self.last_keyframe if place.number < self._first else place
            after = begin
            for messages, turns in islice(self._parts, begin.number - self._first, None):
                found += messages
                after = StreamPosition(self, after.number + 1, turns)
                if sum(map(len, found)) > _PIECE:
                    break
        return found, after, begin.turns - place.turns


class Streams(PartOfServer):
    """The history of a running game, and its streams by audience; a `Follower` of `ctx.record`.

    Args:
        columns: returns the columns of the map.

    Attributes:
        turns: the number of turns played since the game began.
    """

    def __init__(self, columns: Callable[[], GraphColumns]) -> None:
        self.turns = 0
        self._columns = columns
        self._lock = Lock()
        self._history = list[bytes]()  # packed logs, and whether they end a turn; None: the game
        self._first = 0  # the number of the first log in the history
        self._size = 0  # bytes
        self._most_waiting = 1
        self._error: Exception | None = None  # raised by a log
        self._state: DetachedState | None = None  # before the history; None: no game has begun
        self._turns = 0  # the number of turns before the history
        self._header: Keyframe = {}
        self._first_map: GraphColumns  # that in the header
        self._lasting: dict[Any, Any] = {}  # the last events before the history that change what is in the header
        self._sides: Callable[[Callable[[str, Any], bool]], Any]  # returns the sides that some agents know
        self._streams: dict[Audience, AudienceStream] = {}

    def begin(self, header: Keyframe, state: Keyframe) -> None:
        """Begin a game with new streams for all audiences; see `Follower`."""
        with self._lock:
            self._most_waiting = min(max(_MOST_WAITING // max(len(state["names"]), 1), 1), _MOST_PARTS)
            self._header = header
            self._first_map = self._columns()
            self._history = []
            self._first = 0
            self._size = 0
            self.turns = 0
            self._turns = 0
            self._lasting = {}
            self._sides = partial(list_sides, header, {name: state[name] for name in ("names", "teams")})
            self._state = DetachedState(deepcopy(state))
            self._error = None
            self._close()

    def hear(self, log: Log, *, is_over: bool) -> None:
        """Add events to the history; encode them now if followed streams lack many. See `Follower`.

        Raises:
            Damaged: an event does not fit the state; it may have been added by an earlier call.
        """
        if self._error is not None:
            raise self._error
        self.turns += is_over
        self._hold(log, is_over=is_over)
        if self._end % self._most_waiting == 0:
            with self._lock:
                self._catch_up_followed()
                self._drop_turns()

    def _hold(self, log: Log, *, is_over: bool | None) -> None:
        packed = to_bytes([log, is_over], "A turn of a live game")
        self._size += len(packed)
        self._history.append(packed)

    @property
    def _end(self) -> int:
        """The number of the log that comes next."""
        return self._first + len(self._history)

    def _catch_up_followed(self) -> None:
        """Add as many logs to each followed stream as come in between, so that none falls further behind."""
        for stream in list(self._streams.values()):
            if stream.is_followed and stream.number >= self._first:
                self._catch_up(stream)

    def _catch_up(self, stream: AudienceStream) -> None:
        """Add the next logs of the history to a stream, and encode them."""
        begin = stream.number - self._first
        try:
            for packed in self._history[begin : begin + self._most_waiting]:
                stream.number += 1
                log, is_over = from_bytes(packed)
                if is_over is None:
                    stream.end()
                else:
                    stream.hear(log, is_over=is_over)
            stream.write()
        except Exception as error:
            self._error = error
            self._state = None
            self._close()
            raise

    def _drop_turns(self) -> None:
        """Drop the first turns of a history that is too large."""
        state = self._state
        dropped = 0
        while state is not None and self._size > _MOST_BYTES and self._turns < self.turns:
            turn: Log = []
            is_over = False
            while not is_over:
                packed = self._history[dropped]
                dropped += 1
                self._size -= len(packed)
                log, is_over = from_bytes(packed)
                turn += log
            state.apply(turn)
            self._turns += 1
            for kind, data in list_events(turn):
                if kind in _OF_HEADER:
                    self._lasting[kind, data.get("artist")] = kind, data
        self._first += dropped
        del self._history[:dropped]

    def end(self) -> None:
        """End the game in all streams: no sensing follows the last turn."""
        self._hold([], is_over=None)
        with self._lock:
            self._catch_up_followed()

    def get_stream(self, audience: Audience) -> AudienceStream | None:
        """Return the stream of an audience with a few more turns, and begin it if needed; None before a game begins."""
        with self._lock:
            if self._state is None:
                return None
            stream = self._streams.get(audience)
            if stream is None or stream.number < self._first:
                self._drop(audience)
                stream = self._begin_stream(audience, self._state)
                self._streams[audience] = stream
            stream.is_followed = True
            self._catch_up(stream)
            return stream

    def count_pieces(self, audience: Audience) -> int:
        """Return how often `get_stream` is to be called until the stream has all turns that are played now."""
        stream = self._streams.get(audience)
        missing = self._end - (self._first if stream is None else stream.number)
        return 1 + missing // self._most_waiting

    @property
    def have_cuts(self) -> bool:
        """Return whether an audience receives only a part of the game."""
        return any(not audience.is_everything for audience in list(self._streams))

    def leave(self, audience: Audience) -> None:
        """Encode nothing for an audience until `get_stream` is called."""
        with self._lock:
            if (stream := self._streams.get(audience)) is not None:
                stream.is_followed = False

    def close(self) -> None:
        """End all streams."""
        with self._lock:
            self._close()
            self._state = None

    def _close(self) -> None:
        for audience in list(self._streams):
            self._drop(audience)

    def _drop(self, audience: Audience) -> None:
        stream = self._streams.pop(audience, None)
        if stream is not None:
            stream.close()

    def _begin_stream(self, audience: Audience, before: DetachedState) -> AudienceStream:
        state = before.make_keyframe(self._turns)
        sides = self._sides(lambda name, team: audience.is_everything or audience.has(name, team))
        header = self._header | {"sides": sides}
        first_map = self._first_map
        stream = AudienceStream(audience, header, state, self._turns, lambda: first_map, self._first)
        stream.hear(list(self._lasting.values()), is_over=False)
        return stream


def list_news(streams: Streams, connection: Connection) -> Iterator[bytes]:
    """Yield the messages that a connection has not received yet, and update its position."""
    audience = connection.grant.audience
    for _ in range(streams.count_pieces(audience)):
        stream = streams.get_stream(audience)
        if stream is not None:
            yield from _list_new_messages(stream, connection)


def _list_new_messages(stream: AudienceStream, connection: Connection) -> Iterator[bytes]:
    place = connection.place
    if place is None or place.stream is not stream:
        yield from stream.opening
        place = stream.first_keyframe
        connection.place = place
    while True:
        messages, place, dropped = stream.read(place)
        connection.counts["dropped"] += dropped
        if dropped:  # the connection continues at a keyframe
            yield from stream.opening
        connection.place = place
        if not messages:
            return
        yield from messages


def _split_messages(data: bytes) -> list[bytes]:
    """Split bytes into messages, each of which is compressed separately."""
    return [zlib.compress(data[at : at + _PIECE]) for at in range(0, len(data), _PIECE)]
