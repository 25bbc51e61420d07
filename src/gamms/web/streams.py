"""What each audience of a live game is sent: the recording format, header, keyframes and a block for each turn.

A stream holds the blocks of the last turns only, and one keyframe at least; all connections of an audience read the
same bytes. One that falls behind them begins again at the last keyframe, and the turns between are counted as dropped:
no connection has a queue of its own, and none can make the game wait.
"""

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from copy import deepcopy
from functools import partial
from io import RawIOBase
from itertools import islice
from threading import Lock
from typing import Any, NamedTuple

import numpy as np

from gamms.ir.events import Log
from gamms.ir.graph import GraphColumns
from gamms.recorder import Writer
from gamms.recorder.cut import Cut, sides_of
from gamms.recorder.detached import DetachedState
from gamms.web.links import Audience
from gamms.web.pages import drawn_header, drawn_keyframe, drawn_log
from gamms.web.server import Connection

_KEYFRAME_TURNS = 64
_KEYFRAME_BYTES = 1 << 20  # of blocks behind a keyframe, after which there is another one
_MOST_BYTES = 1 << 22  # of blocks that are kept
_PIECE = 1 << 16  # bytes that are sent at once

Keyframe = dict[str, Any]


class Place(NamedTuple):
    """How far a connection is in what it is sent."""

    stream: "Stream"
    number: int  # of the next part


class _Parts(RawIOBase):
    """Takes what a writer writes; `taken` gives it."""

    def __init__(self) -> None:
        super().__init__()
        self._parts: list[bytes] = []

    def writable(self) -> bool:
        return True

    def write(self, data: bytes | bytearray | memoryview) -> int:  # type: ignore[override] # what a writer hands over
        self._parts.append(bytes(data))
        return len(self._parts[-1])

    def taken(self) -> bytes:
        """Return what was written since the last call."""
        parts, self._parts = self._parts, []
        return b"".join(parts)


class Stream:
    """What one audience is sent, from some turn of one game on.

    Args:
        audience: whose knowledge it is.
        header: of the game, as the viewer reads it.
        state: the whole state, which is the first keyframe; not kept.
        turns: how many were played before.
        nearest: the id of the node below a place, (x, y).

    Attributes:
        opening: the first bytes of a recording, with its header.
    """

    def __init__(
        self, audience: Audience, header: Keyframe, state: Keyframe, turns: int, nearest: Callable[[Any], int]
    ) -> None:
        self._cut = None if audience.is_everything else Cut(state, audience.has, nearest)
        if self._cut is not None:
            state = self._cut.keyframe(0)
            header = {key: value for key, value in header.items() if key not in ("seed", "drawings")}
            header |= {"audience": str(audience)}
        self._turns = turns  # that were given out
        self._begun_at = turns
        self._is_seen = False  # whether a keyframe or a turn says what is seen at the beginning
        self._sink = _Parts()
        self._writer = Writer(self._sink, header, turns=1, seconds=None, first=turns)  # type: ignore[arg-type]
        self.opening = self._sink.taken()
        self._lock = Lock()
        self._parts: deque[bytes] = deque()
        self._first = 0  # number of the first part
        self._keyframe_at = 0  # number of the last part that is a keyframe
        self._size = self._since_keyframe = 0  # bytes
        self._add_keyframe(state)

    def hear(self, log: Log, whole: Log, *, is_over: bool, state: Callable[[], Keyframe]) -> None:
        """Take what has happened.

        Args:
            log: since the last call.
            whole: since the last turn.
            is_over: whether this turn is over.
            state: gives the whole state after it.
        """
        if self._cut is None:
            if is_over:
                self._add_turn(whole, state)
            return
        cut = self._cut
        for given in cut.add(log, is_end=is_over):
            self._add_turn(given, self._known)
        if not self._is_seen and (cut.is_shown or is_over):  # what is seen before the first turn is in none
            self._add_keyframe(self._known())
            self._is_seen = True

    def end(self) -> None:
        """Give out the last turn, behind which nothing is sensed."""
        for given in () if self._cut is None else self._cut.rest():
            self._add_turn(given, self._known)
            self._is_seen = False  # if it goes on

    def _known(self) -> Keyframe:
        assert self._cut is not None  # noqa: S101 - callers look
        return self._cut.keyframe(self._turns - self._begun_at)

    def _add_turn(self, log: Log, state: Callable[[], Keyframe]) -> None:
        self._writer.add_turn(drawn_log(log))
        self._turns += 1
        self._add(self._sink.taken())
        if (self._turns - self._begun_at) % _KEYFRAME_TURNS == 0 or self._since_keyframe > _KEYFRAME_BYTES:
            self._add_keyframe(state())

    def _add_keyframe(self, state: Keyframe) -> None:
        self._writer.keyframe(drawn_keyframe(state))
        self._add(self._sink.taken(), is_keyframe=True)

    def _add(self, part: bytes, *, is_keyframe: bool = False) -> None:
        with self._lock:
            self._parts.append(part)
            self._size += len(part)
            self._since_keyframe = 0 if is_keyframe else self._since_keyframe + len(part)
            if is_keyframe:
                self._keyframe_at = self._first + len(self._parts) - 1
            while self._size > _MOST_BYTES and self._first < self._keyframe_at:
                self._size -= len(self._parts.popleft())
                self._first += 1

    def read(self, number: int) -> tuple[bytes, int, int]:
        """Return what comes from a part on, some of it, the number of the part behind it, and how many were dropped."""
        with self._lock:
            dropped = 0
            if number < self._first:
                dropped, number = self._keyframe_at - number, self._keyframe_at
            found, size = [], 0
            for part in islice(self._parts, number - self._first, None):
                found.append(part)
                size += len(part)
                if size > _PIECE:
                    break
            return b"".join(found), number + len(found), dropped

    @property
    def last_keyframe(self) -> int:
        """The number of the part that is the last keyframe."""
        return self._keyframe_at


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
        self._state: DetachedState | None = None  # after the last whole turn
        self._since: Log = []  # what has happened since then
        self._header: Keyframe = {}
        self._sides: Callable[[Callable[[str, Any], bool]], Any]  # that are known to agents
        self._streams: dict[Audience, Stream | None] = {}  # of those who follow; None before there is a game

    def begin(self, header: Keyframe, state: Keyframe) -> None:
        """Begin with all audiences; see `Follower`."""
        with self._lock:
            self._header, self._since, self.turns = drawn_header(header), [], 0
            self._sides = partial(sides_of, header, {name: state[name] for name in ("names", "teams")})
            self._state = DetachedState(deepcopy(state))
            self._streams = {audience: self._begun(audience) for audience in self._streams}

    def hear(self, log: Log, *, is_over: bool) -> None:
        """Add to all streams; see `Follower`."""
        with self._lock:
            state = self._state
            if state is None:
                return
            self._since += log
            if is_over:
                state.apply(self._since)
                self.turns += 1
            for stream in filter(None, self._streams.values()):
                stream.hear(log, self._since, is_over=is_over, state=lambda: state.keyframe(self.turns))
            if is_over:
                self._since = []

    def end(self) -> None:
        """Give out the last turn to all, because the game is over."""
        with self._lock:
            for stream in filter(None, self._streams.values()):
                stream.end()

    def of(self, audience: Audience) -> Stream | None:
        """Return the stream of an audience, which begins now if there was none; None before there is a game."""
        with self._lock:
            if self._streams.get(audience) is None:
                self._streams[audience] = None if self._state is None else self._begun(audience)
            return self._streams[audience]

    def drop(self, audience: Audience) -> None:
        """Write no stream for an audience until it is asked for again."""
        with self._lock:
            self._streams.pop(audience, None)

    def _begun(self, audience: Audience) -> Stream:
        assert self._state is not None  # noqa: S101 - callers look
        state = self._state.keyframe(self.turns)
        sides = self._sides(lambda name, team: audience.is_everything or audience.has(name, team))
        stream = Stream(audience, self._header | {"sides": sides}, state, self.turns, self._nearest)
        if self._since:
            stream.hear(self._since, self._since, is_over=False, state=dict)
        return stream

    def _nearest(self, place: Sequence[float]) -> int:
        columns = self._columns()
        return int(columns.node_ids[((columns.xy - np.asarray(place)) ** 2).sum(axis=1).argmin()])


def news(streams: Streams, connection: Connection) -> Iterator[bytes]:
    """Yield what a connection has not been sent yet, in pieces, and note how far it is."""
    stream = streams.of(connection.grant.audience)
    if stream is None:
        return
    place = connection.place
    if place is None or place.stream is not stream:
        for at in range(0, len(stream.opening), _PIECE):
            yield stream.opening[at : at + _PIECE]
        place = connection.place = Place(stream, stream.last_keyframe)
    while True:
        piece, number, dropped = stream.read(place.number)
        connection.counts["dropped"] += dropped
        if dropped:  # it begins again
            yield stream.opening
        place = connection.place = Place(stream, number)
        if not piece:
            return
        for at in range(0, len(piece), _PIECE):
            yield piece[at : at + _PIECE]
