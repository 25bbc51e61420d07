"""Connections that ask for nothing: they are ended after some time, and at once where others need their places."""

import asyncio
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from time import monotonic
from typing import Any

Client = tuple[str, int]  # address and port
_MOST_S = 60.0  # that a request may take, and sending its answer


class Idle:
    """Ends connections that are quiet: too long, or too many; of many, the oldest of the address that has most.

    So a client that opens connections and says nothing ends its own, and keeps no other client out. For the thread of
    the server alone.

    Args:
        most: quiet connections.
        seconds: that one may be quiet.
    """

    def __init__(self, most: int, seconds: float) -> None:
        self._most, self._seconds = most, seconds
        self._quiet: dict[Client, tuple[float, Callable[[], object]]] = {}  # since when, oldest first; what ends it
        self._busy: dict[Client, tuple[float, Callable[[], object]]] = {}
        self._timer: asyncio.TimerHandle | None = None

    def opened(self, client: Client, end: Callable[[], object]) -> None:
        """Note a new connection, and what ends it; end another one if there are too many."""
        self._quiet[client] = monotonic(), end
        if len(self._quiet) > self._most:
            counts = Counter(host for host, _ in self._quiet)
            most = max(counts.values())
            self._end(next(one for one in self._quiet if counts[one[0]] == most))
        self._look_later()

    def asks(self, client: Client) -> None:
        """Note that a request has begun."""
        if (known := self._quiet.pop(client, None)) is not None:
            self._busy[client] = monotonic(), known[1]

    def answered(self, client: Client) -> None:
        """Note that a request was answered."""
        if (known := self._busy.pop(client, None)) is not None:
            self._quiet[client] = monotonic(), known[1]
            self._look_later()

    def gone(self, client: Client) -> None:
        """Forget a connection, which is closed or is not to be ended any more."""
        self._quiet.pop(client, None)
        self._busy.pop(client, None)

    def _end(self, client: Client) -> None:
        _, end = (self._quiet if client in self._quiet else self._busy).pop(client)
        end()

    def _look_later(self) -> None:
        if self._timer is None:
            self._timer = asyncio.get_running_loop().call_later(self._seconds / 4, self._look)

    def _look(self) -> None:
        """End those whose time is over."""
        now, self._timer = monotonic(), None
        for known, most in ((self._quiet, self._seconds), (self._busy, _MOST_S)):
            for client in [client for client, (since, _) in known.items() if now - since > most]:
                self._end(client)
        if self._quiet or self._busy:
            self._look_later()


class Watched(asyncio.Protocol):
    """A connection as its protocol handles it, until that hands it to another one; `Idle` notes what it does.

    Args:
        protocol: handles it.
        idle: ends it.
    """

    def __init__(self, protocol: asyncio.Protocol, idle: Idle) -> None:
        self._protocol, self._idle = protocol, idle
        self._client: Client = "", 0

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """See `asyncio.Protocol`."""
        made: Any = transport  # a socket, whose transport can be aborted
        with suppress(TypeError, IndexError):  # it is gone already
            self._client = made.get_extra_info("peername")[:2]
        self._protocol.connection_made(transport)
        self._idle.opened(self._client, made.abort)

    def connection_lost(self, exc: Exception | None) -> None:
        """See `asyncio.Protocol`."""
        self._idle.gone(self._client)
        self._protocol.connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """See `asyncio.Protocol`."""
        self._protocol.data_received(data)

    def eof_received(self) -> bool | None:
        """See `asyncio.Protocol`."""
        return self._protocol.eof_received()

    def pause_writing(self) -> None:
        """See `asyncio.Protocol`."""
        self._protocol.pause_writing()

    def resume_writing(self) -> None:
        """See `asyncio.Protocol`."""
        self._protocol.resume_writing()
