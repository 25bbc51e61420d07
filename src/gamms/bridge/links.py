"""Ways to reach robots and other programs by lines of JSON: UDP, WebSocket, and the pipes of a process.

A link never blocks a game: lines that cannot be sent at once, and surplus incoming lines, are counted and dropped.
To add another way, write a class that calls `_take` for each incoming line and implements `_transmit`.
"""

import asyncio
import logging
import os
import socket
import subprocess
import sys
import threading
from abc import ABC, abstractmethod
from collections import Counter, deque
from collections.abc import Sequence
from concurrent.futures import Future
from contextlib import suppress
from functools import partial
from queue import Empty, Full, Queue
from time import monotonic
from typing import IO, TYPE_CHECKING, Any, Self

from gamms.arguments import as_count, as_items, as_name
from gamms.bridge.feeds import Feed, Message
from gamms.bridge.lines import LONGEST_LINE, BadLine, Fix, RoadChanges, encode_line, parse
from gamms.clocks import Clock, as_clock
from gamms.errors import BadType, BadValue, MissingFile, NetworkError
from gamms.plugins import require_extra
from gamms.readonly import NotPickled
from gamms.text import shown
from gamms.workers import die_with_parent

if TYPE_CHECKING:
    from websockets.asyncio.server import ServerConnection

Address = tuple[str, int]

_MOST_ROADS = 256  # waiting messages
_MOST_AT_ONCE = 1_000  # datagrams that are read in one call
_MOST_UNSENT = 1_000  # lines that wait to be sent
_DATAGRAM = 65_507  # bytes that fit into one datagram, by IPv4
_MOST_BAD = 100  # bad lines of one viewer
_MOST_VIEWERS = 64
_MOST_A_SECOND = 1_000  # lines of one viewer that are read in a second; the others wait in the network
_MOST_BUFFERED = 1 << 20  # bytes for one viewer
_GRACE_S = 2.0
_LOOK_S = 0.001  # seconds between two looks for the changes of the roads
_CLOSE_S = 0.2  # seconds that a peer has to answer when it is disconnected
_PORTS = 1 << 16
_quiet = logging.getLogger("gamms.websocket")  # logger of the library, which would report every new connection
_quiet.setLevel(logging.WARNING)


class Link(NotPickled, ABC):
    """Exchanges lines of JSON with another program.

    Attributes:
        counts: "received" lines, and among them "bad" and "unknown" (for an agent without a feed) ones; "dropped" (more
            came than were taken); "sent" and "unsent" (full buffers, or no peer).
    """

    _not_pickled = "A link can neither be pickled nor copied, because it holds a connection. Open another one there."

    def __init__(self, clock: Clock | None = None) -> None:
        self.counts: Counter[str] = Counter()
        self._clock = as_clock(clock)
        self._feeds = dict[str, Feed]()
        self._roads: deque[RoadChanges] = deque(maxlen=_MOST_ROADS)
        self._lock = threading.Lock()

    def feed(self, agent: str) -> Feed:
        """Return the feed of an agent's robot; its messages to the robot are sent by this link."""
        name = as_name(agent, "an agent")
        if name not in self._feeds:
            self._feeds[name] = Feed(self._read_waiting_lines, clock=self._clock, send=self.send)
        return self._feeds[name]

    def send(self, message: Message) -> None:
        """Send a message as one line; if that would block, count and drop it."""
        line = encode_line(str(message.get("type", "")), message)
        if len(line) <= LONGEST_LINE and self._transmit(line):
            self._count("sent")
        else:
            self._count("unsent")

    def roads(self, turn: int, wait_s: float = 0.0) -> RoadChanges | None:
        """Wait for the changes of the roads for a turn and return them; None: they did not come in time.

        Changes for earlier turns are discarded.
        """
        clock = self._clock
        ends = clock.now() + wait_s
        while True:
            self._read_waiting_lines()
            with self._lock:
                while self._roads and self._roads[0].turn < turn:
                    self._roads.popleft()
                found = next((one for one in self._roads if one.turn == turn), None)
            left = ends - clock.now()
            if found is not None or left <= 0.0 or not self._may_come():
                return found
            clock.sleep(min(left, _LOOK_S))

    @abstractmethod
    def close(self) -> None:
        """End the connection, and the threads that serve it."""

    @abstractmethod
    def _transmit(self, line: bytes) -> bool:
        """Send a line; return False if that would block."""

    def _read_waiting_lines(self) -> None:
        """Read waiting lines, in links without a reader thread."""
        return  # links with a thread of their own read there

    def _may_come(self) -> bool:
        """Return whether more lines may arrive."""
        return True

    def _count(self, what: str) -> None:
        with self._lock:
            self.counts[what] += 1

    def _take(self, line: bytes | str) -> bool:
        """Process an incoming line; return whether it is valid."""
        self._count("received")
        try:
            message = parse(line)
        except BadLine:
            self._count("bad")
            return False
        with self._lock:
            if isinstance(message, RoadChanges):
                if len(self._roads) == self._roads.maxlen:
                    self.counts["dropped"] += 1
                self._roads.append(message)
                return True
            feed = self._feeds.get(message.agent)
            if feed is None:
                self.counts["unknown"] += 1
        if feed is not None and isinstance(message, Fix):
            feed.put(message)
        return True

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class Udp(Link):
    """Exchanges lines by UDP, one in each datagram. Senders are not checked: listen where no stranger can send.

    Args:
        listen: host and port to read datagrams at; port 0 takes a free one. None: receive nothing.
        to: host and port to send lines to; None: send nothing.
        clock: the clock for the age of fixes and for waits; None: that of the machine.

    Attributes:
        address: the address where it listens; None if it does not.

    Raises:
        BadType, BadValue: an address is not valid, or both are None.
        NetworkError (ConnectionError): the port is taken, or the host does not exist.
    """

    def __init__(self, listen: Address | None = None, to: Address | None = None, *, clock: Clock | None = None) -> None:
        super().__init__(clock)
        if listen is None and to is None:
            raise BadValue("A link by UDP needs listen=(host, port), to=(host, port), or both.")
        self._to = None if to is None else as_address(to, "to", 1)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.setblocking(False)
            if listen is not None:
                self._socket.bind(as_address(listen, "listen", 0))
        except OSError as error:
            self._socket.close()
            raise _make_listen_error(listen, error) from None
        except BaseException:
            self._socket.close()
            raise
        self.address: Address | None = None if listen is None else self._socket.getsockname()[:2]

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()

    def _transmit(self, line: bytes) -> bool:
        if self._to is None or len(line) > _DATAGRAM:
            return False
        try:
            self._socket.sendto(line, self._to)
        except OSError:  # full buffers, no route, or closed
            return False
        return True

    def _read_waiting_lines(self) -> None:
        if self.address is None:
            return
        for _ in range(_MOST_AT_ONCE):
            try:
                line = self._socket.recv(LONGEST_LINE + 1)
            except BlockingIOError:
                return
            except ConnectionError:  # an earlier datagram reached no one
                continue
            except OSError:
                return
            self._take(line)


class Process(Link):
    """Starts another program, and exchanges lines with its standard input and output.

    On Linux the program is killed when this one ends without `close`, however it ends. Elsewhere it has to end by
    itself at the end of its input.

    Args:
        command: the program and its arguments; no shell reads them.
        clock: the clock for the age of fixes and for waits; None: that of the machine.

    Raises:
        BadType: the command is not a list of texts.
        OSError: the program cannot be started.
    """

    def __init__(self, command: Sequence[str], *, clock: Clock | None = None) -> None:
        super().__init__(clock)
        words = [as_name(word, "a part of a command") for word in as_items(command, "command", "texts")]
        if not words:
            raise BadValue("command must begin with the program that is started, not be empty.")
        self._unsent: Queue[bytes | None] = Queue(_MOST_UNSENT)
        self._is_read = threading.Event()  # set when the program has closed its output
        started: Future[subprocess.Popen[bytes]] = Future()
        self._threads = [
            threading.Thread(target=self._read, args=(words, started), name="gamms lines in", daemon=True),
            threading.Thread(target=self._write, name="gamms lines out", daemon=True),
        ]
        self._threads[0].start()
        self._process = started.result()
        self._threads[1].start()

    def close(self) -> None:
        """Close the program's input, and kill the program if it does not end by itself."""
        self._stop_writing()
        try:
            self._process.wait(_GRACE_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        for thread in self._threads:
            thread.join(_GRACE_S)
        for pipe in (self._process.stdin, self._process.stdout):
            _close_quietly(pipe)

    def _stop_writing(self) -> None:
        while True:
            with suppress(Full):
                return self._unsent.put_nowait(None)
            with suppress(Empty):
                self._unsent.get_nowait()

    def _transmit(self, line: bytes) -> bool:
        try:
            self._unsent.put_nowait(line)
        except Full:
            return False
        return self._may_come()

    def _may_come(self) -> bool:
        return not self._is_read.is_set() or bool(self._roads)

    def _read(self, words: list[str], started: "Future[subprocess.Popen[bytes]]") -> None:
        """Start the program and read its lines until it ends; the program is killed when this thread ends."""
        ending = partial(die_with_parent, os.getpid()) if sys.platform == "linux" else None
        try:
            process = subprocess.Popen(  # noqa: S603 - the caller's
                words,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                preexec_fn=ending,  # noqa: PLW1509 - it loads nothing and takes no lock
            )
        except FileNotFoundError:
            started.set_exception(MissingFile("a program", words[0]))
            return
        except BaseException as error:  # noqa: BLE001 - it is for the thread that waits
            started.set_exception(error)
            return
        started.set_result(process)
        self._read_lines(process.stdout)
        self._is_read.set()
        process.wait()

    def _read_lines(self, pipe: IO[bytes] | None) -> None:
        is_rest = False  # the rest of a line that is too long
        while pipe is not None and (line := pipe.readline(LONGEST_LINE + 1)):
            is_whole = line.endswith(b"\n")
            if not is_rest:
                self._take(line.rstrip(b"\n") if is_whole else line)
            is_rest = not is_whole

    def _write(self) -> None:
        pipe = self._process.stdin
        while pipe is not None and (line := self._unsent.get()) is not None:
            try:
                pipe.write(line + b"\n")
                pipe.flush()
            except OSError:  # the program has ended
                break
        _close_quietly(pipe)


class WebSocketServer(Link):
    """Serves lines by WebSocket to any number of viewers and robots, which connect to it.

    It is a server because viewers come and go while a game is played, and pages in a browser can only be clients. A
    viewer that reads too slowly, or sends only bad lines, is disconnected.

    Args:
        port: 0 takes a free one.
        host: "127.0.0.1" accepts programs of this machine, "0.0.0.0" also those of other machines.
        origins: origins of browser pages that may connect, such as "http://localhost:8000"; programs other than
            browsers send no origin and may always connect.
        clock: the clock for the age of fixes and for waits; None: that of the machine.

    Attributes:
        url: the address for clients.

    Raises:
        MissingExtra (ImportError): websockets is not installed.
        NetworkError (ConnectionError): the port is taken, or the host does not exist.
    """

    def __init__(
        self, port: int = 0, host: str = "127.0.0.1", *, origins: Sequence[str] = (), clock: Clock | None = None
    ) -> None:
        super().__init__(clock)
        with require_extra("A WebSocket server", "web"):
            import websockets  # noqa: F401 - it is imported where it is used
        self._listen = as_address((host, port), "(host, port)", 0)
        self._origins: list[Any] = [None, *(as_name(one, "an origin") for one in as_items(origins, "origins", "texts"))]
        self._viewers: set[ServerConnection] = set()
        self._pending = 0  # lines on their way to the thread
        self._loop: asyncio.AbstractEventLoop | None = None
        self._stop: asyncio.Event | None = None
        self._errors: list[OSError] = []
        self.url = ""
        is_ready = threading.Event()
        self._thread = threading.Thread(target=self._run, args=(is_ready,), name="gamms websocket", daemon=True)
        self._thread.start()
        is_ready.wait()
        if self._errors:
            self._thread.join()
            raise self._errors[0]

    @property
    def viewers(self) -> int:
        """The number of connected viewers."""
        return len(self._viewers)

    def close(self) -> None:
        """Disconnect all viewers, and stop serving."""
        loop = self._loop
        stop = self._stop
        if loop is not None and stop is not None and self._thread.is_alive():
            loop.call_soon_threadsafe(stop.set)
            self._thread.join()

    def _transmit(self, line: bytes) -> bool:
        loop = self._loop
        if loop is None or not self._viewers or self._pending >= _MOST_UNSENT:
            return False
        self._pending += 1
        try:
            loop.call_soon_threadsafe(self._broadcast, line.decode())
        except RuntimeError:  # it was closed
            return False
        return True

    def _broadcast(self, line: str) -> None:
        from websockets.asyncio.server import broadcast

        self._pending -= 1
        slow = {one for one in self._viewers if one.transport.get_write_buffer_size() > _MOST_BUFFERED}
        for viewer in slow:
            viewer.transport.abort()
        self._viewers -= slow
        broadcast(self._viewers, line)

    def _run(self, is_ready: threading.Event) -> None:
        try:
            asyncio.run(self._serve(is_ready))
        except OSError as error:
            self._errors.append(_make_listen_error(self._listen, error))
        finally:
            is_ready.set()

    async def _serve(self, is_ready: threading.Event) -> None:
        from websockets.asyncio.server import serve

        self._loop = asyncio.get_running_loop()
        self._stop = asyncio.Event()
        host, port = self._listen
        serving = serve(
            self._talk,
            host,
            port,
            origins=self._origins,
            compression=None,  # a short message could become a very long one
            max_size=LONGEST_LINE,
            close_timeout=_CLOSE_S,
            logger=_quiet,
            ping_interval=None,  # pings draw from the global `random`, as strategies may; dead peers fill their buffers
        )
        async with serving as server:
            here = next(iter(server.sockets)).getsockname()
            self.url = f"ws://{here[0]}:{here[1]}"
            is_ready.set()
            await self._stop.wait()

    async def _talk(self, viewer: "ServerConnection") -> None:
        from websockets.exceptions import ConnectionClosed

        if len(self._viewers) >= _MOST_VIEWERS:
            await viewer.close(1013, "too many viewers")
            return
        self._viewers.add(viewer)
        bad = 0
        count = 0
        ends = monotonic() + 1.0
        try:
            async for line in viewer:
                bad += not self._take(line)
                count += 1
                if count >= _MOST_A_SECOND:
                    await asyncio.sleep(max(0.0, ends - monotonic()))
                    count = 0
                    ends = monotonic() + 1.0
                if bad >= _MOST_BAD:
                    await viewer.close(1008, "too many bad lines")
                    return
        except ConnectionClosed:
            return
        finally:
            self._viewers.discard(viewer)


def as_address(value: object, name: str, least_port: int) -> Address:
    """Return a host and a port.

    Raises:
        BadType, BadValue: the value is not an address.
    """
    if not isinstance(value, (tuple, list)) or len(value) != 2:
        raise BadType(f"{name} must be (host, port), such as ('127.0.0.1', 9000), not {shown(value)}.")
    port = as_count(value[1], "A port", least_port)
    if port >= _PORTS:
        raise BadValue(f"A port must be less than {_PORTS}, not {port}.")
    return as_name(value[0], "a host"), port


def _make_listen_error(address: object, error: OSError) -> NetworkError:
    return NetworkError(
        f"Nothing can listen at {shown(address)}: {error.strerror}. Check the host; port 0 takes a free one."
    )


def _close_quietly(pipe: IO[bytes] | None) -> None:
    with suppress(OSError):  # unwritten lines have no reader any more
        if pipe is not None:
            pipe.close()
