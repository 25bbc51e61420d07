"""The streams of a live game, one for each audience: a header, and parts with the columns of one or several turns.

The game thread only queues the events of each turn. They are encoded when a connection asks for data, as one part with
all turns since the last request, so that spectators do not slow down a game that waits between turns. Each message is
compressed separately, once for all connections.

A stream stores only the parts of the last turns, among them at least one keyframe, which can be read without earlier
parts. All connections of an audience read the same bytes. A connection that falls behind continues at the last
keyframe, and the turns in between are counted as dropped. No connection has its own queue, and none can delay the game.
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
from gamms.knowledge.looks import Nearest, make_nearest
from gamms.knowledge.sides import list_sides
from gamms.recorder.cut import KnowledgeFilter, cut_header
from gamms.recorder.detached import DetachedState
from gamms.web.columns import MAGIC, frame
from gamms.web.links import Audience, PartOfServer
from gamms.web.pages import select_header
from gamms.web.painter import Painter
from gamms.web.server import Connection

_KEYFRAME_TURNS = 64
_MOST_WAITING = 1 << 11  # agents, summed over the queued logs
_MOST_PARTS = 256  # queued logs
_KEYFRAME_BYTES = 1 << 20  # of parts after a keyframe, before the next keyframe
_MOST_BYTES = 1 << 22  # of stored parts
_PIECE = 1 << 18  # bytes, before compression, of one message

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
        nearest: returns the id of the node nearest to a position (x, y).
        get_map: returns the map in the header.

    Attributes:
        opening: the messages with the magic bytes and the header.
        last_keyframe: the position of the last keyframe.
    """

    def __init__(
        self,
        audience: Audience,
        header: Keyframe,
        state: Keyframe,
        turns: int,
        nearest: Nearest,
        get_map: Callable[[], GraphColumns],
    ) -> None:
        is_everything = audience.is_everything
        visuals = header.get("visuals")
        self._cut = None if is_everything else KnowledgeFilter(state, audience.has, nearest, get_map, visuals)
        if self._cut is not None:
            state = self._cut.make_keyframe(0)
            header = {**cut_header(header, self._cut), "sides": header["sides"], "audience": str(audience)}
            header |= {"agents": sorted(audience.agents)} if audience.agents else {}
        self._painter = Painter(header, state, turns)
        self._turns = turns  # that were written
        self._begun_at = turns
        self._is_seen = False  # whether what agents see at the beginning was written
        self.opening = _split_messages(MAGIC + frame(select_header(header)))
        self._lock = Lock()
        self._parts: deque[tuple[list[bytes], int]] = deque()  # messages, and the number of turns played after them
        self._first = 0  # the number of the first stored part
        self.last_keyframe = StreamPosition(self, 0, turns)
        self._size = 0  # bytes
        self._since_keyframe = 0
        self._add_keyframe()

    def hear(self, log: Log, whole: Log, *, is_over: bool) -> None:
        """Add events; `write` encodes them.

        Args:
            log: the events since the last call.
            whole: the events since the end of the last turn.
            is_over: whether the turn has ended.
        """
        if self._cut is None:
            if is_over:
                self._add_turn(whole)
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
                self.last_keyframe = StreamPosition(self, self._first + len(self._parts) - 1, self._turns)
            while self._size > _MOST_BYTES and self._first < self.last_keyframe.number:
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
    """The streams of a running game by audience; a `Follower` of `ctx.record`.

    Args:
        columns: returns the columns of the map.

    Attributes:
        turns: the number of turns played since the game began.
    """

    def __init__(self, columns: Callable[[], GraphColumns]) -> None:
        self.turns = 0
        self._columns = columns
        self._lock = Lock()
        self._waiting: deque[tuple[Log, bool]] = deque()  # logs that are in no stream yet, and whether they end a turn
        self._most_waiting = 0
        self._error: Exception | None = None  # raised by a log
        self._state: DetachedState | None = None  # after the last complete turn in the streams
        self._turns = 0  # the number of turns in the streams
        self._since: Log = []  # events after the last complete turn
        self._header: Keyframe = {}
        self._first_map: GraphColumns  # that in the header
        self._drawings: dict[str, Any] = {}  # artist -> its last drawing
        self._sides: Callable[[Callable[[str, Any], bool]], Any]  # returns the sides that some agents know
        self._streams: dict[Audience, AudienceStream | None] = {}  # None: no game has begun

    def begin(self, header: Keyframe, state: Keyframe) -> None:
        """Begin a game with new streams for all audiences; see `Follower`."""
        with self._lock:
            self._waiting.clear()
            self._most_waiting = min(max(_MOST_WAITING // max(len(state["names"]), 1), 1), _MOST_PARTS)
            self._header = header
            self._first_map = self._columns()
            self._since = []
            self.turns = 0
            self._turns = 0
            self._drawings = {one["artist"]: one for one in header.get("drawings", [])}
            self._sides = partial(list_sides, header, {name: state[name] for name in ("names", "teams")})
            self._state = DetachedState(deepcopy(state))
            self._error = None
            self._close()
            self._streams = {audience: self._begin_stream(audience) for audience in self._streams}

    def hear(self, log: Log, *, is_over: bool) -> None:
        """Queue events for the next reader; encode them now if the queue is full. See `Follower`.

        Raises:
            Damaged: an event does not fit the state; it may have been queued by an earlier call.
        """
        if self._error is not None:
            raise self._error
        self.turns += is_over
        self._waiting.append((log, is_over))
        if len(self._waiting) >= self._most_waiting:
            with self._lock:
                self._catch_up()

    def _catch_up(self) -> None:
        """Add the queued events to all streams."""
        if not self._waiting or self._state is None:
            return
        streams = [stream for stream in self._streams.values() if stream is not None]
        try:
            while self._waiting:
                self._add(self._state, streams, *self._waiting.popleft())
        except Exception as error:
            self._close()
            self._error = error
            self._state = None
            self._streams = dict.fromkeys(self._streams)
            raise
        for stream in streams:
            stream.write()

    def _add(self, state: DetachedState, streams: list[AudienceStream], log: Log, is_over: bool) -> None:
        self._since += log
        if is_over:
            state.apply(self._since)
            self._turns += 1
            for kind, data in list_events(self._since):
                if kind == kinds.VISUALS:
                    self._header = self._header | {"visuals": data}
                elif kind == kinds.VISUAL_COMMANDS:
                    self._drawings[data["artist"]] = data
        for stream in streams:
            stream.hear(log, self._since, is_over=is_over)
        if is_over:
            self._since = []

    def end(self) -> None:
        """Encode the last turn of the game in all streams."""
        with self._lock:
            self._catch_up()
            for stream in filter(None, self._streams.values()):
                stream.end()

    def get_stream(self, audience: Audience) -> AudienceStream | None:
        """Return the stream of an audience, and begin it if needed; None before a game begins."""
        with self._lock:
            self._catch_up()
            if self._streams.get(audience) is None:
                self._streams[audience] = None if self._state is None else self._begin_stream(audience)
            return self._streams[audience]

    @property
    def have_cuts(self) -> bool:
        """Return whether an audience receives only a part of the game."""
        return any(not audience.is_everything for audience in list(self._streams))

    def drop(self, audience: Audience) -> None:
        """End the stream of an audience; `get_stream` begins a new one."""
        with self._lock:
            stream = self._streams.pop(audience, None)
            if stream is not None:
                stream.close()

    def close(self) -> None:
        """End all streams."""
        with self._lock:
            self._close()
            self._streams = {}
            self._state = None

    def _close(self) -> None:
        for stream in filter(None, self._streams.values()):
            stream.close()

    def _begin_stream(self, audience: Audience) -> AudienceStream:
        assert self._state is not None  # noqa: S101 - callers look
        state = self._state.make_keyframe(self._turns)
        sides = self._sides(lambda name, team: audience.is_everything or audience.has(name, team))
        header = self._header | {"sides": sides, "drawings": list(self._drawings.values())}
        first_map = self._first_map
        stream = AudienceStream(audience, header, state, self._turns, make_nearest(self._columns), lambda: first_map)
        if self._since:
            stream.hear(self._since, self._since, is_over=False)
            stream.write()
        return stream


def list_news(streams: Streams, connection: Connection) -> Iterator[bytes]:
    """Yield the messages that a connection has not received yet, and update its position."""
    stream = streams.get_stream(connection.grant.audience)
    if stream is None:
        return
    place = connection.place
    if place is None or place.stream is not stream:
        yield from stream.opening
        place = stream.last_keyframe
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
