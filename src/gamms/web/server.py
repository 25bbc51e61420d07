"""The HTTP and WebSocket server for pages of games: links with tokens, limits, and checks of every request.

Live games (`live.py`) and studies (`study.py`) build on it.

* A **link** (`links.py`) is an address with a token after `#`. Browsers do not send this part when they request a page,
  so that it appears in no log. `Links.add(grant)` makes a token; `LinkPermissions` are those of its holder, with
  the knowledge that the holder receives: an `Audience` of everything, of a team, or of agents by name.
* A **site** (`Site`) is the content of a server: `pages` by path; `calls` by path, functions that a page calls by POST
  with JSON and the header `Authorization: Bearer TOKEN`; and `talk`, the handler of the WebSocket at `/live`.
* A **handler** (`SocketHandler`) is told when clients join and leave, receives their messages, and provides the data to
  send. Its methods are called in the server thread, and must not block.
* A **connection** (`Connection`) is one browser. `tell` queues JSON to send, only the latest message of each type.

Every request is checked first: its host must be the served one (against DNS rebinding), the origin of calls and
WebSockets must be a page of this server, and the sizes, rates and number of connections are limited; idle connections
are closed (`IdleTimeout`). Addresses other than loopback need `allow_network=True`. Tokens are compared in constant
time and never logged.
"""

import asyncio
import ipaddress
import json
import re
import socket
import threading
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from time import monotonic, sleep, thread_time
from typing import TYPE_CHECKING, Any, Protocol

from gamms.arguments import as_int
from gamms.errors import BadType, BadValue, GammsError, NetworkError
from gamms.plain import Plain
from gamms.plugins import require_extra
from gamms.text import shown
from gamms.web.links import LinkPermissions, Links, Refused

if TYPE_CHECKING:
    from starlette.requests import Request
    from starlette.responses import Response
    from starlette.types import ASGIApp, Message, Receive, Scope, Send
    from starlette.websockets import WebSocket

MOST_MESSAGE = 4096  # bytes of a client message
MOST_CALL = 1 << 18  # bytes of the body of a call
_MOST_CONNECTIONS = 256
_MOST_SPECTATORS = 224  # connections after which spectators are refused
_MOST_STRANGERS = 32  # connections that have not sent their token yet
_JOIN_S = 5.0  # the time to send the token
_MOST_QUIET = 128  # idle HTTP connections
_QUIET_S = 5.0  # the time that they may be idle
_BODY_S = 10.0  # the time to send the body of a call
# frames of a client: the rate, and the burst
_MOST_A_SECOND = 20.0
_MOST_AT_ONCE = 40.0
_MOST_BAD = 20  # invalid messages after which a client is disconnected
_MOST_BACKLOG = 64
_MOST_DEPTH = 16  # of nested values
_SHARE = 20  # sending takes at most a 20th of the time, so that spectators do not slow down the game
# the time between two rounds of sending
_SHORTEST_S = 0.01
_LONGEST_S = 1.0
_START_S = 10.0
_MOST_S = 60.0  # the time of a request, including the response
_MOST_STUCK_S = 30.0  # the time that a client may block sending
# close codes of WebSockets
_BAD_TOKEN = 4401
_TOO_MUCH = 1008
_TOO_MANY = 1013

Json = dict[str, Plain]


# -- content ------------------------------------------------------------------------------------------------------

Client = tuple[str, int]  # address and port


class Connection:
    """The WebSocket connection of one browser.

    Attributes:
        grant: the grant of its link.
        place: its position in the stream; used only by the handler.
        counts: the numbers of "received", "bad" and "refused" messages, and of "dropped" turns.
    """

    def __init__(self, grant: LinkPermissions) -> None:
        self.grant = grant
        self.place: Any = None  # Any: the handler chooses the type
        self.counts: Counter[str] = Counter()
        self._told: dict[str, str] = {}
        self._woken = asyncio.Event()
        self._loop = asyncio.get_running_loop()
        self._rate = _RateLimit()

    def tell(self, message: Mapping[str, Plain]) -> None:
        """Queue a message to the browser; it replaces a queued message with the same `type`. Thread-safe."""
        self._told[str(message["type"])] = json.dumps(message)
        with suppress(RuntimeError):  # the server has stopped
            self._loop.call_soon_threadsafe(self._woken.set)

    def may_speak(self) -> bool:
        """Count a received message; return whether the client is within its rate and its limit of bad messages."""
        self.counts["received"] += 1
        return self._rate.count() and self.counts["bad"] < _MOST_BAD

    def take_messages(self) -> list[str]:
        """Return the queued messages, and clear the queue."""
        told = self._told
        self._told = {}
        return list(told.values())


class SocketHandler(Protocol):
    """The handler of a WebSocket. Its methods are called in the server thread, and must not block."""

    def joined(self, connection: Connection) -> None:
        """Handle a new connection."""

    def left(self, connection: Connection) -> None:
        """Handle a closed connection."""

    def received(self, connection: Connection, message: Json) -> None:
        """Handle a client message: a JSON object. No key of it has been checked.

        Raises:
            Refused: the message is invalid, or cannot be obeyed; the client receives the text.
        """

    def news(self, connection: Connection) -> Iterable[bytes]:
        """Yield the data that a client has not received yet; each piece is requested after the previous one is sent."""


@dataclass(frozen=True)
class Page:
    """A page: its bytes, which declare a content security policy in a `meta` element."""

    body: bytes

    @property
    def policy(self) -> str:
        """The content security policy in the page.

        Raises:
            BadValue: the page declares none.
        """
        found = re.search(rb'http-equiv="Content-Security-Policy" content="([^"]*)"', self.body)
        if found is None:
            raise BadValue("A page that is served declares its content security policy in a meta element.")
        return f"{found[1].decode('ascii')}; frame-ancestors 'none'"


Call = Callable[[LinkPermissions, Json, str], Plain]


@dataclass
class Site:
    """The content of a server.

    Attributes:
        links: the tokens and their grants.
        pages: path, such as "/", -> page.
        calls: path -> a function that pages call with JSON; called in a worker thread with the grant of the token, the
            JSON object, and the network address of the client.
        talk: the handler of the WebSocket at `/live`; None: there is no WebSocket.
    """

    links: Links = field(default_factory=Links)
    pages: dict[str, Page] = field(default_factory=dict)
    calls: dict[str, Call] = field(default_factory=dict)
    talk: SocketHandler | None = None


# -- the server ---------------------------------------------------------------------------------------------------


class Server:
    """Serves a site in a separate thread, from its creation until `close`.

    Args:
        site: the content.
        host: the address; addresses other than loopback need `allow_network`.
        port: the port; 0: any free port.
        allow_network: whether other machines may connect, with a link; the connection is not encrypted.

    Attributes:
        address: the address without path and token, such as "http://127.0.0.1:8000".
        links: the links of the site.

    Raises:
        MissingExtra (ImportError): Starlette or uvicorn is not installed.
        BadValue (ValueError): the address is not loopback, and `allow_network` is not set; or the port is invalid.
        NetworkError (ConnectionError): the port is in use, or not allowed.
    """

    def __init__(self, site: Site, *, host: str = "127.0.0.1", port: int = 0, allow_network: bool = False) -> None:
        with require_extra("A live view in the browser", "web"):
            import starlette  # noqa: F401 - raises now if it is missing, as does websockets
            import uvicorn
            import websockets  # noqa: F401
            from uvicorn.protocols.http.h11_impl import H11Protocol
            from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
        is_local = _is_loopback(host)
        if not (is_local or allow_network):
            raise BadValue(
                f"host={shown(host)} lets other machines in. Say that you want that: allow_network=True, or "
                f"--allow-network; without, use host='127.0.0.1'."
            )
        listener = _open_listener(host, as_int(port, "port"))
        port = listener.getsockname()[1]
        name = f"[{host}]" if ":" in host else host
        self.address = f"http://{name}:{port}"
        self.links = site.links
        self._hub = _SiteRouter(site)
        idle = IdleTimeout(_MOST_QUIET, _QUIET_S)
        guard = _Guard(self._hub.make_application(), _list_own_names(port) if is_local else None, idle)

        def protocol(**keywords: Any) -> WatchedConnection:  # called by uvicorn
            return WatchedConnection(H11Protocol(**keywords), idle)

        config = uvicorn.Config(
            guard,
            loop="asyncio",
            http=protocol,  # type: ignore[arg-type] # it makes one
            ws=limit_frames(WebSocketsSansIOProtocol),
            ws_max_size=MOST_MESSAGE,
            ws_per_message_deflate=False,  # messages are compressed already
            ws_ping_interval=None,  # pings would draw from the global random generator, which games seed
            lifespan="off",
            log_config=None,
            log_level="critical",
            access_log=False,
            proxy_headers=False,
            server_header=False,
            limit_concurrency=2 * _MOST_CONNECTIONS + _MOST_STRANGERS + _MOST_QUIET,
            backlog=_MOST_BACKLOG,
            h11_max_incomplete_event_size=1 << 14,
            timeout_graceful_shutdown=1,
        )
        self._server = uvicorn.Server(config)
        self._thread = threading.Thread(
            target=self._server.run, kwargs={"sockets": [listener]}, name="gamms web", daemon=True
        )
        self._thread.start()
        ends = monotonic() + _START_S
        while not self._server.started and self._thread.is_alive() and monotonic() < ends:
            sleep(0.002)
        if not self._server.started:
            listener.close()
            raise NetworkError(f"The server at {self.address} has not begun within {_START_S:g} s.")

    @property
    def connections(self) -> list[Connection]:
        """The open WebSocket connections, in the order of joining."""
        return list(self._hub.open)

    def link(self, token: str, path: str = "/") -> str:
        """Return the address of a page with a token."""
        return f"{self.address}{path}#{token}"

    def wake(self) -> None:
        """Tell the server that there is new data; it is sent later. Thread-safe; never blocks."""
        self._hub.wake()

    def close(self) -> None:
        """Stop the server, and close all connections."""
        self._server.should_exit = True
        if threading.current_thread() is not self._thread:
            self._thread.join(_START_S)


def _is_loopback(host: str) -> bool:
    if not isinstance(host, str):
        raise BadType(f"host is an address such as '127.0.0.1', not {shown(host)}.")
    with suppress(ValueError):
        return ipaddress.ip_address(host).is_loopback
    return host == "localhost"


def _list_own_names(port: int) -> frozenset[str]:
    return frozenset(f"{name}:{port}" for name in ("127.0.0.1", "localhost", "[::1]"))


def _open_listener(host: str, port: int) -> socket.socket:
    """Open a listening socket.

    Raises:
        BadValue: the port is out of range.
        NetworkError: the port is in use, or not allowed.
    """
    if not 0 <= port < 1 << 16:
        raise BadValue(f"port must be 0 to 65535, not {port}; 0 takes a free one.")
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    # asyncio sends small messages at once where a socket says that it is TCP, and else waits 40 ms for more.
    listener = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((host, port))
        listener.listen(_MOST_BACKLOG)
    except OSError as error:
        listener.close()
        raise NetworkError(
            f"Port {port} at {host} cannot be served: {error.strerror or error}. Give another one;"
            " port=0 takes a free one."
        ) from None
    return listener


class IdleTimeout:
    """Closes connections that are idle for too long, and the oldest ones if too many are idle.

    If too many are idle, a connection of the address with the most idle ones is closed: a client that opens many
    connections loses its own, and cannot lock out others. Used only in the server thread.

    Args:
        most: the maximum number of idle connections.
        seconds: the time that a connection may be idle.
    """

    def __init__(self, most: int, seconds: float) -> None:
        self._most = most
        self._seconds = seconds
        self._quiet: dict[Client, tuple[float, Callable[[], object]]] = {}  # idle since, oldest first; closes it
        self._busy: dict[Client, tuple[float, Callable[[], object]]] = {}
        self._timer: asyncio.TimerHandle | None = None

    def add_connection(self, client: Client, end: Callable[[], object]) -> None:
        """Add a new connection with the function that closes it; close another one if there are too many."""
        self._quiet[client] = monotonic(), end
        if len(self._quiet) > self._most:
            counts = Counter(host for host, _ in self._quiet)
            most = max(counts.values())
            self._end(next(one for one in self._quiet if counts[one[0]] == most))
        self._schedule_check()

    def mark_busy(self, client: Client) -> None:
        """Mark a connection as busy with a request."""
        if (known := self._quiet.pop(client, None)) is not None:
            self._busy[client] = monotonic(), known[1]

    def mark_idle(self, client: Client) -> None:
        """Mark a connection as idle, after a response."""
        if (known := self._busy.pop(client, None)) is not None:
            self._quiet[client] = monotonic(), known[1]
            self._schedule_check()

    def remove_connection(self, client: Client) -> None:
        """Stop watching a connection."""
        self._quiet.pop(client, None)
        self._busy.pop(client, None)

    def _end(self, client: Client) -> None:
        _, end = (self._quiet if client in self._quiet else self._busy).pop(client)
        end()

    def _schedule_check(self) -> None:
        if self._timer is None:
            self._timer = asyncio.get_running_loop().call_later(self._seconds / 4, self._close_idle_connections)

    def _close_idle_connections(self) -> None:
        """Close the connections whose time is over."""
        now = monotonic()
        self._timer = None
        for known, most in ((self._quiet, self._seconds), (self._busy, _MOST_S)):
            for client in [client for client, (since, _) in known.items() if now - since > most]:
                self._end(client)
        if self._quiet or self._busy:
            self._schedule_check()


class WatchedConnection(asyncio.Protocol):
    """Wraps the protocol of a connection, and reports its opening and closing to an `IdleTimeout`.

    Args:
        protocol: the wrapped protocol.
        idle: closes the connection when it is idle.
    """

    def __init__(self, protocol: asyncio.Protocol, idle: IdleTimeout) -> None:
        self._protocol = protocol
        self._idle = idle
        self._client: Client = "", 0

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """See `asyncio.Protocol`."""
        made: Any = transport  # a socket, whose transport can be aborted
        with suppress(TypeError, IndexError):  # the peer has disconnected already
            self._client = made.get_extra_info("peername")[:2]
        self._protocol.connection_made(transport)
        self._idle.add_connection(self._client, made.abort)

    def connection_lost(self, exc: Exception | None) -> None:
        """See `asyncio.Protocol`."""
        self._idle.remove_connection(self._client)
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


class _Guard:
    """Checks host and origin of every request before the application sees it, and adds headers to every response.

    Args:
        application: the wrapped application.
        names: the accepted values of the host header; None: any.
        idle: is told when requests begin and end.
    """

    def __init__(self, application: "ASGIApp", names: frozenset[str] | None, idle: IdleTimeout) -> None:
        self._application = application
        self._names = names
        self._idle = idle

    async def __call__(self, scope: "Scope", receive: "Receive", send: "Send") -> None:
        client = _get_client(scope)
        if scope["type"] == "websocket":  # WebSockets have their own limits
            self._idle.remove_connection(client)
            await self._answer(scope, receive, send)
            return
        self._idle.mark_busy(client)
        try:
            await self._answer(scope, receive, send)
        finally:
            self._idle.mark_idle(client)

    async def _answer(self, scope: "Scope", receive: "Receive", send: "Send") -> None:
        from starlette.datastructures import MutableHeaders
        from starlette.responses import PlainTextResponse
        from starlette.websockets import WebSocketClose

        async def send_with_headers(message: "Message") -> None:
            if message["type"] == "http.response.start":
                MutableHeaders(scope=message).update(_HEADERS)
            await send(message)

        answer = self._application
        if not self._is_own(scope):
            refusal = PlainTextResponse("This is not the page of this server.", 403)
            answer = WebSocketClose(_TOO_MUCH) if scope["type"] == "websocket" else refusal
        await answer(scope, receive, send_with_headers)

    def _is_own(self, scope: "Scope") -> bool:
        """Return whether a request is for this host, and has no origin or the origin of this host.

        `TrustedHostMiddleware` takes any port, takes the first of several hosts, and does not know origins.
        """
        from starlette.datastructures import Headers

        headers = Headers(scope=scope)
        hosts = headers.getlist("host")
        origins = headers.getlist("origin")
        if len(hosts) != 1 or len(origins) > 1 or (self._names is not None and hosts[0] not in self._names):
            return False
        return not origins or origins[0] in (f"http://{hosts[0]}", f"https://{hosts[0]}")


_HEADERS = {
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cache-control": "no-store",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
}


def _get_client(scope: "Scope") -> Client:
    return tuple(scope["client"] or ("", 0))


class _SiteRouter:
    """The routes of a site, and its open connections."""

    def __init__(self, site: Site) -> None:
        self._site = site
        self.open: dict[Connection, None] = {}
        self._strangers = IdleTimeout(_MOST_STRANGERS, _JOIN_S)
        self._loop: asyncio.AbstractEventLoop | None = None
        self._news: asyncio.Event
        self._pump: asyncio.Task[None]

    def make_application(self) -> "ASGIApp":
        """Return the Starlette application with all routes."""
        from starlette.applications import Starlette
        from starlette.routing import Route, WebSocketRoute

        routes: list[Route | WebSocketRoute] = [
            Route(path, _make_page_route(page), methods=["GET"]) for path, page in self._site.pages.items()
        ]
        routes += [Route(path, self._call_route(call), methods=["POST"]) for path, call in self._site.calls.items()]
        if self._site.talk is not None:
            routes.append(WebSocketRoute("/live", self._talk))
        return Starlette(routes=routes)

    # -- calls ----------------------------------------------------------------------------------------------------

    def _call_route(self, call: Call) -> Callable[["Request"], Any]:
        async def answer(request: "Request") -> "Response":
            from starlette.concurrency import run_in_threadpool
            from starlette.responses import JSONResponse

            client = _get_client(request.scope)
            _, _, token = request.headers.get("authorization", "").partition("Bearer ")
            grant = self._site.links.find(token)
            if grant is None:
                return JSONResponse({"error": "This link is not known here, or not any more."}, 401)
            body = bytearray()
            try:
                async with asyncio.timeout(_BODY_S):
                    async for part in request.stream():
                        body += part
                        if len(body) > MOST_CALL:
                            return JSONResponse({"error": f"More than {MOST_CALL} bytes."}, 413)
            except TimeoutError:
                return JSONResponse({"error": f"The call has not come within {_BODY_S:g} s."}, 408)
            try:
                return JSONResponse(
                    {"value": await run_in_threadpool(call, grant, _as_message(bytes(body)), client[0])}
                )
            except (GammsError, OSError) as error:
                return JSONResponse({"error": str(error)}, 400)

        return answer

    # -- connections ----------------------------------------------------------------------------------------------

    def wake(self) -> None:
        """See `Server.wake`."""
        if self._loop is not None and self.open and not self._news.is_set():
            with suppress(RuntimeError):  # the loop is closed
                self._loop.call_soon_threadsafe(self._news.set)

    async def _talk(self, websocket: "WebSocket") -> None:
        self._begin()
        client = _get_client(websocket.scope)
        try:
            grant = await self._wait_for_token(websocket, client)
        except TimeoutError:
            await websocket.close(_TOO_MANY, "No token has come in time.")
            return
        finally:
            self._strangers.remove_connection(client)
        if grant is None:
            await websocket.close(_BAD_TOKEN, "This link is not known here, or not any more.")
            return
        looks_on = not (grant.may_control or grant.may_play)
        if len(self.open) >= (_MOST_SPECTATORS if looks_on else _MOST_CONNECTIONS):
            await websocket.close(_TOO_MANY, "Too many people are watching.")
            return
        await self._serve(websocket, Connection(grant))

    def _begin(self) -> None:
        if self._loop is None:
            self._news = asyncio.Event()
            self._loop = asyncio.get_running_loop()
            self._pump = self._loop.create_task(self._send_in_rounds())

    async def _wait_for_token(self, websocket: "WebSocket", client: Client) -> LinkPermissions | None:
        """Wait for the first message of a client, which contains its token; None: the token is unknown.

        Raises:
            TimeoutError: the message has not arrived in time, or too many connections have not sent their token.
        """
        loop = asyncio.get_running_loop()
        async with asyncio.timeout(None) as limit:
            self._strangers.add_connection(client, lambda: limit.reschedule(loop.time()))
            await websocket.accept()
            first = await websocket.receive()
        with suppress(Refused):
            return self._site.links.find(_as_message(first.get("text")).get("token"))
        return None

    async def _serve(self, websocket: "WebSocket", connection: Connection) -> None:
        talk = self._site.talk
        assert talk is not None  # noqa: S101 - there is no route without it
        self.open[connection] = None
        try:
            talk.joined(connection)
            connection._woken.set()
            tasks = {
                asyncio.create_task(_send_all(websocket, connection, talk)),
                asyncio.create_task(self._hear_all(websocket, connection, talk)),
            }
            ended, others = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            for task in others:
                task.cancel()
            for task in ended:
                task.result()
        finally:
            del self.open[connection]
            talk.left(connection)

    async def _hear_all(self, websocket: "WebSocket", connection: Connection, talk: SocketHandler) -> None:
        """Handle the messages of a client until it disconnects or exceeds its limits."""
        while (message := await websocket.receive())["type"] == "websocket.receive":
            if not connection.may_speak():
                await websocket.close(_TOO_MUCH, "Too many messages, or too many that make no sense.")
                return
            self._hear(connection, talk, message.get("text"))

    def _hear(self, connection: Connection, talk: SocketHandler, text: object) -> None:
        try:
            message = _as_message(text)
        except Refused:
            connection.counts["bad"] += 1
            return
        try:
            talk.received(connection, message)
        except Refused as error:
            connection.counts["refused"] += 1
            connection.tell({"type": "refused", "words": str(error)})

    async def _send_in_rounds(self) -> None:
        """Wake all connections when there is new data, at intervals that bound the share of time spent on sending."""
        begun = monotonic()
        spent = thread_time()
        while True:
            await self._news.wait()
            await asyncio.sleep(_SHORTEST_S)  # while the game thread ends its turn
            while (rest := min((thread_time() - spent) * _SHARE, _LONGEST_S) - (monotonic() - begun)) > 0.0:  # noqa: ASYNC110 - it is time that passes
                await asyncio.sleep(rest)
            self._news.clear()
            begun = monotonic()
            spent = thread_time()
            for connection in self.open:
                connection._woken.set()


async def _send_all(websocket: "WebSocket", connection: Connection, talk: SocketHandler) -> None:
    """Send queued messages and stream data to a client whenever its connection is woken, until it disconnects."""
    from starlette.websockets import WebSocketDisconnect

    with suppress(WebSocketDisconnect, TimeoutError):
        while True:
            await connection._woken.wait()
            connection._woken.clear()
            for text in connection.take_messages():
                async with asyncio.timeout(_MOST_STUCK_S):
                    await websocket.send_text(text)
            for piece in talk.news(connection):
                async with asyncio.timeout(_MOST_STUCK_S):
                    await websocket.send_bytes(piece)
                await asyncio.sleep(0)  # the turns of a long game must not keep the others waiting


def _make_page_route(page: Page) -> Callable[["Request"], Any]:
    from starlette.responses import HTMLResponse

    answer = HTMLResponse(page.body, headers={"content-security-policy": page.policy})

    async def give(_request: "Request") -> "Response":
        return answer

    return give


def _as_message(text: object) -> Json:
    """Parse a JSON object from a client.

    Raises:
        Refused: it is no JSON object, or nested too deeply.
    """
    try:
        found = json.loads(text, parse_constant=_refuse_constant) if isinstance(text, str | bytes) else None
    except (ValueError, RecursionError):
        found = None
    if not isinstance(found, dict) or not _is_shallow(found, _MOST_DEPTH):
        raise Refused("A message is a mapping in JSON.")
    return found


def _refuse_constant(name: str) -> float:
    raise ValueError(name)


def _is_shallow(value: object, most: int) -> bool:
    if isinstance(value, dict | list):
        parts = value.values() if isinstance(value, dict) else value
        return most > 0 and all(_is_shallow(part, most - 1) for part in parts)
    return True


class _RateLimit:
    """Limits the rate of the frames that a connection sends: a token bucket."""

    def __init__(self) -> None:
        self._left = _MOST_AT_ONCE
        self._counted_at = monotonic()

    def count(self) -> bool:
        """Count a frame; return whether it is within the limit."""
        now = monotonic()
        self._left = min(self._left + (now - self._counted_at) * _MOST_A_SECOND, _MOST_AT_ONCE) - 1.0
        self._counted_at = now
        return self._left >= 0.0


def limit_frames(protocol: type[Any]) -> type[Any]:  # classes of uvicorn, which one file imports
    """Return a subclass of uvicorn's protocol that aborts connections with too many pings, pongs or fragments.

    The protocol answers pings and joins fragments itself, so that the application cannot count them.
    """

    class Counting(protocol):  # type: ignore[misc] # of any class
        def connection_made(self, transport: asyncio.BaseTransport) -> None:
            self._rate = _RateLimit()
            super().connection_made(transport)

        def _may_come(self) -> bool:
            is_allowed = self._rate.count()
            if not is_allowed:
                self.transport.abort()
            return is_allowed

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
