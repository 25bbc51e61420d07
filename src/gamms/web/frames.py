"""Frames of WebSocket connections that are no messages: pings, pongs and parts of messages, of which few may come."""

from asyncio import BaseTransport
from time import monotonic
from typing import Any

_MOST_A_SECOND, _MOST_AT_ONCE = 20.0, 40.0


def counting_frames(protocol: type[Any]) -> type[Any]:  # classes of uvicorn, which one file imports
    """Return the class of uvicorn's protocol, whose connections end when they send too many of these frames.

    The protocol answers pings and joins the parts of messages before the application hears of them.
    """

    class Counting(protocol):  # type: ignore[misc] # of any class
        def connection_made(self, transport: BaseTransport) -> None:
            self._allowed, self._allowed_at = _MOST_AT_ONCE, monotonic()
            super().connection_made(transport)

        def _may_come(self) -> bool:
            now = monotonic()
            self._allowed = min(self._allowed + (now - self._allowed_at) * _MOST_A_SECOND, _MOST_AT_ONCE) - 1.0
            self._allowed_at = now
            if self._allowed < 0.0:
                self.transport.abort()
            return self._allowed >= 0.0

        def handle_ping(self) -> None:
            if self._may_come():
                super().handle_ping()

        def handle_pong(self, event: object) -> None:
            if self._may_come():
                super().handle_pong(event)

        def handle_cont(self, event: object) -> None:
            if self._may_come():
                super().handle_cont(event)

    return Counting
