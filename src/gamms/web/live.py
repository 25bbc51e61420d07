"""Serve a game to browsers while it is played: `serve`, and the handle that it returns.

The game thread passes each turn to `Streams` and then waits as `TurnPacing` says; the server thread sends the streams
to browsers. `Live` connects both: it is the `SocketHandler` of the server and a follower of `ctx.record`.

To extend it: add functions to `Live.handlers`, by the `type` of the client messages that they handle; add functions to
`Live.when_joined`, called with each new connection; make links for any `LinkPermissions` with `Live.link`; read
`Live.streams` and `Live.connections`. Handlers run in the server thread.
"""

import asyncio
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from functools import partial
from html import escape
from pathlib import Path
from time import monotonic
from typing import Any, Protocol, TypedDict, Unpack

from gamms.arguments import as_bool, as_float, as_text
from gamms.context import Context
from gamms.errors import BadType, BadValue, ContextTerminated, GammsError
from gamms.game.result import Result
from gamms.ir.events import Log
from gamms.ir.graph import GraphColumns
from gamms.knowledge.sides import Side, label_sides
from gamms.plain import Plain
from gamms.scenario import Scenario, load
from gamms.text import reason, shown
from gamms.web.links import Audience, Handle, LinkPermissions, Links, PartOfServer, Refused
from gamms.web.pages import make_live_page
from gamms.web.people import People
from gamms.web.server import Connection, Json, Page, Server, Site
from gamms.web.streams import Streams, list_news
from gamms.workers import SIGNALS_S

Handler = Callable[[Connection, Json], None]
_CLOSE_S = 10.0
_COUNT_S = 1.0  # between two messages to all about how many watch: for each who comes, they would be quadratic
_FILES_S = 0.5  # between two checks for changed files
_FASTEST = 1000.0  # turns a second
_LARGEST = 1e300  # JSON and YAML allow integers that do not fit a float
_MOST_NUMBERS = 60
_MOST_STEPS = 20  # requested single turns that are not played yet
_WATCHED = {".py", ".yaml", ".yml", ".json", ".toml"}


class ServeOptions(TypedDict, total=False):
    """The keywords of `serve`."""

    port: int
    """The port: 0, any free port."""
    host: str
    """The address: "127.0.0.1"; addresses other than loopback need `allow_network`."""
    allow_network: bool
    """Whether other machines may connect: False."""
    speed: float | None
    """Turns per second: 4.0; None: as fast as possible."""
    is_paused: bool
    """Whether the game begins paused: False."""
    title: str
    """The title above the map: the name of the scenario."""
    seed: int | None
    """The seed, for scenarios: None, the seed of the scenario."""
    strategies: Mapping[str, Callable[..., Any]] | None
    """Strategies by team or agent that replace those of the scenario: None."""
    record: str | Path | None
    """The file of a recording, for scenarios: None, no recording."""
    watch: bool | Callable[[], Scenario]
    """Whether to restart when a file in the folder of the scenario changes: False. A function returns the new scenario;
    True loads the file again."""


def serve(game: Context | Scenario, **options: Unpack[ServeOptions]) -> "Live":
    """Serve a game to browsers while it is played; return a handle with the links.

    A scenario is built and played in a separate thread. The game of a context is played by the program; while it is
    served, a pause in the browser makes `ctx.game.step` and `ctx.visual.simulate` wait.

    Args:
        game: a scenario, or a context.
        options: see `gamms.web.ServeOptions`.

    Raises:
        MissingExtra (ImportError): the extra `web` is not installed.
        NetworkError (ConnectionError): the port is in use.
        BadType, BadValue: an option is invalid, or applies only to scenarios.
        ScenarioError: the game cannot be built.
    """
    if not isinstance(game, Context | Scenario):
        raise BadType(f"serve takes a context or a scenario, not {shown(game)}.")
    if unknown := sorted(options.keys() - ServeOptions.__annotations__.keys()):
        raise BadValue(
            f"serve has no option {shown(unknown[0])}; there are: {', '.join(ServeOptions.__annotations__)}."
        )
    return Live(game, options)


class TurnPacing(PartOfServer):
    """Decides when the next turn is played: at a speed, one by one, or not while paused.

    Attributes:
        speed: turns per second; None: as fast as possible.
        is_paused: whether turns are played only by `step`.
    """

    def __init__(self, speed: float | None, *, is_paused: bool) -> None:
        self.speed = speed
        self.is_paused = is_paused
        self._steps = 0
        self._is_released = False
        self._next_at = 0.0
        self._changed = threading.Condition()

    def wait(self) -> None:
        """Wait until the next turn may be played."""
        with self._changed:
            while not self._is_released:
                if self._steps:
                    self._steps -= 1
                    break
                rest = SIGNALS_S if self.is_paused else self._next_at - monotonic()
                if rest <= 0.0:
                    break
                self._changed.wait(min(rest, SIGNALS_S))
            self._next_at = monotonic() + (0.0 if self.speed is None else 1.0 / self.speed)

    def pause(self, *, is_paused: bool) -> None:
        """Pause the game, or continue it."""
        with self._changed:
            self.is_paused = is_paused
            self._steps = 0
            self._changed.notify_all()

    def change_speed(self, speed: float | None) -> None:
        """Set the turns per second; None: as fast as possible."""
        with self._changed:
            self.speed = speed
            self._next_at = min(self._next_at, monotonic() + (0.0 if speed is None else 1.0 / speed))
            self._changed.notify_all()

    def step(self) -> None:
        """Play one turn, then pause."""
        with self._changed:
            self.is_paused = True
            self._steps = min(self._steps + 1, _MOST_STEPS)
            self._changed.notify_all()

    def release(self, *, is_released: bool) -> None:
        """Stop making turns wait, or start again."""
        with self._changed:
            self._is_released = is_released
            self._changed.notify_all()


class Throttle:
    """Calls a function soon after each request, at most once in a period; used in the server thread.

    Args:
        call: the function.
        period_s: the shortest time between two calls, seconds.
    """

    def __init__(self, call: Callable[[], object], period_s: float) -> None:
        self._call = call
        self._period_s = period_s
        self._next_at = 0.0
        self._is_scheduled = False

    def request(self) -> None:
        """Schedule a call, unless one is scheduled."""
        if not self._is_scheduled:
            self._is_scheduled = True
            loop = asyncio.get_running_loop()
            loop.call_later(max(self._next_at - loop.time(), 0.0), self._run, loop)

    def _run(self, loop: asyncio.AbstractEventLoop) -> None:
        self._is_scheduled = False
        self._next_at = loop.time() + self._period_s
        self._call()


class Host(Protocol):
    """The server of a game: a `Server`, or a part of a shared server."""

    address: str
    links: Links

    @property
    def connections(self) -> list[Connection]:
        """The open connections of the game."""

    def link(self, token: str) -> str:
        """Return the address of the game with a token in it."""

    def wake(self) -> None:
        """Tell the server that there is new data."""

    def close(self) -> None:
        """Stop serving the game."""


class Live(Handle):
    """A served game; close it with `close` or use it in a `with` statement.

    Attributes:
        ctx: the context of the current game; None before the first game.
        pace: decides when turns are played.
        streams: the data for each audience.
        handlers: `type` of a client message -> the function that handles it.
        when_joined: functions that are called with each new connection, in the server thread.
        when_failed: functions that are called with each error in the files watched by `watch=`, or in their game, in
            another thread.
        scenario: the scenario that is played, with the numbers chosen in the browser; None: the program plays.

    Args:
        game: see `serve`.
        options: see `serve`.
        host: the server; None: a new server with these options.
    """

    def __init__(self, game: Context | Scenario, options: ServeOptions, host: "Host | None" = None) -> None:
        is_scenario = isinstance(game, Scenario)
        of_scenarios = [name for name in ("seed", "strategies", "record", "watch") if options.get(name) is not None]
        if of_scenarios and not is_scenario:
            raise BadValue(f"{of_scenarios[0]}= is for a scenario; the game of a context is played by the program.")
        self.pace = TurnPacing(
            _check_speed(options.get("speed", 4.0)), is_paused=as_bool(options.get("is_paused", False), "is_paused")
        )
        self.scenario: Scenario | None = game if isinstance(game, Scenario) else None
        self._first = self.scenario  # with the numbers of its file
        self.ctx: Context | None = game if isinstance(game, Context) else None
        self.streams = Streams(self._get_columns)
        self.handlers: dict[str, Handler] = {
            "pause": self._pause,
            "step": self._step,
            "speed": self._set_speed,
            "restart": self._restart,
        }
        self.when_joined: list[Callable[[Connection], None]] = [self._tell_status]
        self.when_failed: list[Callable[[BaseException], object]] = []
        self._count = Throttle(self._tell_all, _COUNT_S)
        self._players = Players(self)
        self._options = options
        self._seed = options.get("seed")
        self._result: Result | None = None
        self._error: BaseException | None = None
        self._trouble: str | None = None  # an error in changed files
        self._is_over = threading.Event()
        self._is_closed = threading.Event()
        self._wanted = threading.Event()
        self._asking = threading.Lock()
        self._trying = threading.Lock()  # held while a restart that a page has requested is tried
        self._is_following = False
        self._tokens = dict[LinkPermissions, str]()
        self._server: Host = self._make_server(game, options) if host is None else host
        self._thread: threading.Thread | None = None
        try:
            self._begin()
        except BaseException:
            self.close()
            raise

    def _make_server(self, game: Context | Scenario, options: ServeOptions) -> Server:
        title = as_text(options.get("title") or _make_title(game), "title")
        site = Site(Links(), {"/": Page(make_live_page(title))}, talk=self)
        network = as_bool(options.get("allow_network", False), "allow_network")
        return Server(site, host=options.get("host", "127.0.0.1"), port=options.get("port", 0), allow_network=network)

    # -- links ----------------------------------------------------------------------------------------------------

    def link(self, grant: LinkPermissions) -> str:
        """Return the address for a grant; equal grants have the same address."""
        if grant not in self._tokens:
            self._tokens[grant] = self._server.links.add(grant)
        return self._server.link(self._tokens[grant])

    @property
    def url(self) -> str:
        """The address for spectators who see everything."""
        return self.links["everything"]

    @property
    def links(self) -> dict[str, str]:
        """The addresses by name: "admin" may pause and change the game; "everything" sees all; teams see their part."""
        grants = [LinkPermissions("admin", may_control=True), LinkPermissions("everything")]
        labels = label_sides(Side(team, None) for team in self._list_teams())
        grants += [LinkPermissions(label, Audience(side.team)) for side, label in labels.items()]
        by_name = {grant.name: grant for grant in reversed(grants)}
        return {name: self.link(by_name[name]) for name in dict.fromkeys(grant.name for grant in grants)}

    @property
    def players(self) -> dict[str, str]:
        """The addresses by name of the people whose agents have the strategy `gamms.web.human()`."""
        return self._players.links()

    def _list_teams(self) -> list[Any]:
        if self.scenario is not None:
            return list(self.scenario.spec.teams)
        block = self._context.agent.block
        return list(dict.fromkeys(team for team in block.teams if team is not None))

    # -- the handle -----------------------------------------------------------------------------------------------

    @property
    def connections(self) -> list[Connection]:
        """The open connections."""
        return self._server.connections

    def wait(self, timeout: float | None = None) -> Result | None:
        """Wait until the game ends, and return its result; None after the timeout in seconds, or after `close`.

        Raises:
            Any exception raised by the game of a scenario. With `watch=`, the method waits for corrected files instead,
                and after a restart for the next one.
        """
        ends = None if timeout is None else monotonic() + timeout
        while not (self._is_over.is_set() or self._is_closed.is_set()):
            rest = SIGNALS_S if ends is None else min(ends - monotonic(), SIGNALS_S)
            if rest <= 0.0:
                break
            self._is_over.wait(rest)
        if self._is_over.is_set() and self._error is not None:
            raise self._error
        return self._result if self._is_over.is_set() else None

    def close(self) -> None:
        """Stop the server, and the game of a scenario; a context stays open."""
        self._is_closed.set()
        self._play_again()
        if self._thread is not None and threading.current_thread() is not self._thread:
            self._thread.join(_CLOSE_S)
        if self.scenario is None and self.ctx is not None and not self.ctx.is_terminated():
            self.ctx.record.unfollow(self)
        self._server.close()
        self.streams.close()

    def __repr__(self) -> str:
        """Return the address without tokens, the turns and the number of connections."""
        return f"Live({self._server.address}, turns={self.streams.turns}, connections={len(self.connections)})"

    def _repr_html_(self) -> str:
        """Return the links as HTML, for notebooks."""
        links = (f'<a href="{escape(to)}" target="_blank">{escape(name)}</a>' for name, to in self.links.items())
        return f"A live game: {' · '.join(links)}"

    # -- the game -------------------------------------------------------------------------------------------------

    @property
    def _context(self) -> Context:
        if self.ctx is None:
            raise ContextTerminated("A served game")
        return self.ctx

    def _get_columns(self) -> GraphColumns:
        return self._context.graph.columns()

    def _begin(self) -> None:
        if self.scenario is None:
            self.follow()
            return
        begun = threading.Event()
        self._thread = threading.Thread(target=self._play_on, args=(begun,), name="gamms game", daemon=True)
        self._thread.start()
        while not begun.wait(SIGNALS_S):
            pass
        if self._error is not None:
            raise self._error
        if watched := self._options.get("watch"):
            source = watched if callable(watched) else partial(load, self.scenario.file or "", self.scenario.allow)
            args = source, _read_stamps(self._find_watched_folder())  # before a program can change them
            threading.Thread(target=self._watch_files, args=args, name="gamms files", daemon=True).start()

    def follow(self) -> None:
        """Start to follow the game of the context, unless it is followed already or the context is terminated."""
        if not self._is_following and not self._context.is_terminated():
            self._is_following = True
            self._context.record.follow(self)
            self._players.open(self._context)

    def _find_watched_folder(self) -> Path:
        return Path() if self.scenario is None or self.scenario.folder is None else self.scenario.folder

    def _watch_files(self, source: Callable[[], Scenario], known: dict[str, tuple[int, int]]) -> None:
        """Restart the game whenever a file in the folder of the scenario changes; report errors in the files."""
        folder = self._find_watched_folder()
        while not self._is_closed.wait(_FILES_S):
            try:
                stamps = _read_stamps(folder)
                if stamps == known:
                    continue
                known = stamps
                self.scenario = source()
                self._first = self.scenario
                self._trouble = None
                self._play_again()
            except Exception as error:  # noqa: BLE001 - files may be half written, and the code in them raise anything
                self._trouble = f"not begun again: {reason(error)}"
                self._say_failed(error)

    def _say_failed(self, error: BaseException) -> None:
        for hear in self.when_failed:
            hear(error)
        self._tell_all()

    def _play_on(self, begun: threading.Event) -> None:
        """Play the scenario, and play it again whenever a restart is requested."""
        survives = bool(self._options.get("watch"))
        while not self._is_closed.is_set():
            with self._asking:
                self._wanted.clear()
                self._is_over.clear()
                self.pace.release(is_released=False)
            try:
                self._play(begun)
            except BaseException as error:  # noqa: BLE001 - it is for the thread that waits, and for the page
                self._error = error
            if self._error is not None and survives and begun.is_set():
                self._say_failed(self._error)
            elif not self._wanted.is_set():
                self._is_over.set()
            begun.set()
            self._tell_all()
            self._wanted.wait()
            survives = True  # the numbers of a page end no program

    def _play(self, begun: threading.Event) -> None:
        scenario = self.scenario
        assert scenario is not None  # noqa: S101 - this thread is for scenarios
        self._error = None
        with scenario.build(self._seed, self._options.get("strategies")) as ctx:
            self.ctx = ctx
            if (path := self._options.get("record")) is not None:
                ctx.record.start(path, overwrite=True)
            ctx.record.follow(self)
            self._players.open(ctx)
            begun.set()
            self._tell_all()
            self.pace.wait()
            game = ctx.game
            while not self._wanted.is_set() and game.turn != game.max_turns and game.step():
                pass
            self._result = game.result()

    # -- called by the game thread --------------------------------------------------------------------------------

    def begin(self, header: dict[str, Any], state: dict[str, Any]) -> None:
        """Start the streams of a new game (called by the game thread)."""
        self.streams.begin(header, state)
        self._server.wake()

    def hear(self, log: Log, *, is_over: bool) -> None:
        """Add events to the streams; after a turn, wait until the next may begin (called by the game thread)."""
        self.streams.hear(log, is_over=is_over)
        game = None if self.ctx is None else self.ctx.current_game
        if is_over and game is not None and (game.is_over or game.turn == game.last_turn):
            self.streams.end()
            if self.scenario is None:
                self._is_over.set()
        if is_over or self.streams.have_cuts:  # only streams of teams get data within a turn
            self._server.wake()
        if is_over:
            self.pace.wait()

    # -- called by the server thread ------------------------------------------------------------------------------

    def joined(self, connection: Connection) -> None:
        """Call the functions in `when_joined` (called by the server)."""
        for hear in self.when_joined:
            hear(connection)
        self._count.request()

    def left(self, connection: Connection) -> None:
        """Encode no turns for the audience that no other connection reads (called by the server)."""
        audience = connection.grant.audience
        if all(one.grant.audience != audience for one in self.connections):
            self.streams.leave(audience)
        self._players.left(connection)
        self._count.request()

    def received(self, connection: Connection, message: Json) -> None:
        """Pass a client message to its handler (called by the server)."""
        handler = self.handlers.get(str(message.get("type")))
        if handler is None:
            connection.counts["bad"] += 1
            raise Refused("This type of message is unknown.")
        handler(connection, message)

    def news(self, connection: Connection) -> Iterable[bytes]:
        """Yield the data that a client has not received yet (called by the server)."""
        before = connection.counts["dropped"]
        yield from list_news(self.streams, connection)
        if connection.counts["dropped"] != before:
            self._tell_status(connection)

    def _tell_all(self) -> None:
        for connection in self.connections:
            self._tell_status(connection)

    def _tell_status(self, connection: Connection) -> None:
        """Send a client the status of the game, and its permissions."""
        status: Json = {
            "type": "status",
            "paused": self.pace.is_paused,
            "speed": self.pace.speed,
            "over": self._is_over.is_set(),
            "control": connection.grant.may_control,
            "watching": len(self.connections) - 1,  # besides this client
            "dropped": connection.counts["dropped"],
            "error": self._trouble if self._error is None else "the game has failed",
        }
        if self._error is not None and (connection.grant.audience.is_everything or connection.grant.may_control):
            status["error"] = f"the game has failed: {reason(self._error)}"  # the reason may name any agent
        if connection.grant.may_control and self.scenario is not None:
            status |= {
                "restart": True,
                "numbers": list(list_numbers(self._first or self.scenario, self.scenario)),
                "seed": self._seed,
            }
        connection.tell(status)

    # -- messages of clients that may control ---------------------------------------------------------------------

    def _pause(self, connection: Connection, message: Json) -> None:
        _check_control(connection)
        self.pace.pause(is_paused=_is_flag(message.get("paused")))
        self._tell_all()

    def _step(self, connection: Connection, _message: Json) -> None:
        _check_control(connection)
        self.pace.step()
        self._tell_all()

    def _set_speed(self, connection: Connection, message: Json) -> None:
        _check_control(connection)
        speed = message.get("speed")
        if speed is not None and not (_is_number(speed) and 0.0 < speed <= _FASTEST):
            raise Refused(f"A speed is a number up to {_FASTEST:g} turns a second.")
        self.pace.change_speed(None if speed is None else float(speed))
        self._tell_all()

    def _restart(self, connection: Connection, message: Json) -> None:
        _check_control(connection)
        if self.scenario is None:
            raise Refused("Only the program that plays this game can restart it.")
        seed = message.get("seed")
        chosen = message.get("numbers", {})
        if seed is not None and not (isinstance(seed, int) and not isinstance(seed, bool) and abs(seed) < 1 << 53):
            raise Refused("A seed is a whole number.")
        scenario = _replace_numbers(self._first or self.scenario, self.scenario, chosen)
        if not self._trying.acquire(blocking=False):
            raise Refused("Another restart is being tried.")
        args = connection, scenario, seed
        threading.Thread(target=self._restart_if_possible, args=args, name="gamms restart", daemon=True).start()

    def _restart_if_possible(self, connection: Connection, scenario: Scenario, seed: int | None) -> None:
        """Restart the game, or tell the page why the new one cannot be built, or why its first turn fails."""
        try:
            with scenario.build(seed, self._options.get("strategies")) as ctx:
                People.open(ctx).let_go()
                ctx.game.step()
        except BaseException as error:  # noqa: BLE001 - the code of a scenario may raise anything
            connection.tell({"type": "refused", "words": f"Not restarted: {reason(error)}"})
        else:
            self.scenario = scenario
            self._seed = seed
            self._play_again()
        finally:
            self._trying.release()

    def _play_again(self) -> None:
        """Make the game thread end the current game, if it is running, and begin a new one."""
        with self._asking:
            self._wanted.set()
            self._players.let_go()
            self.pace.release(is_released=True)


def list_numbers(scenario: Scenario, changed: Scenario | None = None) -> Iterator[dict[str, Plain]]:
    """Yield the numbers of a scenario that can be changed in the browser: `path`, `value`, `low`, `high`, `step`.

    Args:
        scenario: the scenario, from which the bounds follow.
        changed: the scenario with changed numbers, which has the values; None: none was changed.
    """
    found = (
        (path, value) for path, value in _list_numbers(scenario.to_dict()) if path.partition(".")[0] not in _NO_NUMBERS
    )
    now = dict(_list_numbers((changed or scenario).to_dict()))
    for (path, value), _ in zip(found, range(_MOST_NUMBERS), strict=False):
        is_whole = isinstance(value, int)
        low = 0 if value >= 0 else 4 * value
        high = max(10 if is_whole else 1.0, 4 * value)
        step = 1 if is_whole else (high - low) / 200
        if value > 0 and path.rpartition(".")[2] in _POSITIVE:
            low = min(step, value)
        yield {"path": path, "value": now.get(path, value), "low": low, "high": high, "step": step}


_POSITIVE = {"capacity", "count", "goal", "speed", "times", "turn_seconds", "turns"}  # a scenario refuses 0 for these
_NO_NUMBERS = ("map", "seed", "name", "description", "facts")
_NO_KEYS = {"node", "near", "at"}  # their numbers are node ids


class Players:
    """Sends questions to people and receives their choices; a part of `Live`.

    Args:
        live: the served game.
    """

    def __init__(self, live: Live) -> None:
        self._live = live
        self._people: People | None = None
        live.handlers["choose"] = self._choose
        live.when_joined.append(self._add_connection)

    def open(self, ctx: Context) -> None:
        """Open a new game, so that people can join it."""
        self._people = People.open(ctx)
        self._people.changed.append(self._tell_all)
        for connection in self._live.connections:
            self._add_connection(connection)

    def links(self) -> dict[str, str]:
        """Return the links of the people of the game, by name."""
        if self._people is None:
            return {}
        self._people.look_up()
        return {
            person.name: self._live.link(
                LinkPermissions(person.name, Audience(agents=frozenset(person.agents)), may_play=True),
            )
            for person in self._people.persons.values()
        }

    def let_go(self) -> None:
        """Stop waiting for people in the current game."""
        if self._people is not None:
            self._people.let_go()

    def _add_connection(self, connection: Connection) -> None:
        if self._people is not None and connection.grant.may_play:
            self._people.mark_present(connection.grant.name)
            self._tell_sharers(connection.grant)

    def left(self, connection: Connection) -> None:
        """Tell the other pages of a person that one is closed."""
        if connection.grant.may_play:
            self._tell_sharers(connection.grant)

    def _list_open_pages(self, grant: LinkPermissions) -> list[Connection]:
        """Return the open pages of a link."""
        return [one for one in self._live.connections if one.grant == grant]

    def _tell_sharers(self, grant: LinkPermissions) -> None:
        for connection in self._list_open_pages(grant):
            if self._people is not None:
                self._tell(connection, self._people)

    def _choose(self, connection: Connection, message: Json) -> None:
        if self._people is None or not connection.grant.may_play:
            raise Refused("This link only allows watching.")
        choice = {key: value for key, value in message.items() if key != "type"}
        self._people.choose(connection.grant.name, choice)

    def _tell_all(self) -> None:
        for connection in self._live.connections:
            if self._people is not None and connection.grant.may_play:
                self._tell(connection, self._people)

    def _tell(self, connection: Connection, people: People) -> None:
        asked: Mapping[str, Plain] = {
            "type": "questions",
            "questions": people.list_questions(connection.grant.name),
            "waiting": people.is_waiting,
            "pages": len(self._list_open_pages(connection.grant)),
        }
        connection.tell(asked)


def _list_numbers(values: Mapping[str, Any], path: str = "") -> Iterator[tuple[str, int | float]]:
    """Yield the numbers in nested mappings, with their paths for `Scenario.replace`."""
    for key, value in values.items():
        if key in _NO_KEYS or "." in key:
            continue
        if _is_number(value):
            yield path + key, value
        elif isinstance(value, Mapping):
            yield from _list_numbers(value, f"{path}{key}.")
        elif isinstance(value, list):
            items = {str(number): item for number, item in enumerate(value) if isinstance(item, Mapping)}
            yield from _list_numbers(items, f"{path}{key}.")


def _replace_numbers(first: Scenario, scenario: Scenario, chosen: object) -> Scenario:
    """Return a copy of a scenario with the chosen numbers, path -> number, which are in the bounds of the first one."""
    known = {one["path"]: one for one in list_numbers(first)}
    if not isinstance(chosen, dict):
        raise Refused("The numbers are a mapping from paths to numbers.")
    for path, value in chosen.items():
        one = known.get(path)
        if one is None:
            raise Refused(f"{shown(path)} is not a number that can be changed here.")
        low, high = one["low"], one["high"]
        if not _is_number(value) or not low <= value <= high or (one["step"] == 1 and value != int(value)):
            kind = "whole number" if one["step"] == 1 else "number"
            raise Refused(f"{path} must be a {kind} from {low:g} to {high:g}, not {shown(value)}.")
    whole = {path: int(value) if known[path]["step"] == 1 else float(value) for path, value in chosen.items()}
    try:
        return scenario.replace(**whole)
    except GammsError as error:
        raise Refused(str(error)) from None


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < _LARGEST


def _is_flag(value: object) -> bool:
    if not isinstance(value, bool):
        raise Refused("The value must be true or false.")
    return value


def _check_control(connection: Connection) -> None:
    if not connection.grant.may_control:
        raise Refused("This link only allows watching.")


def _read_stamps(folder: Path) -> dict[str, tuple[int, int]]:
    """Return file name -> (modification time in ns, size) of the code and scenario files in a folder."""
    found = {}
    for file in folder.iterdir():
        with suppress(OSError):
            if file.suffix in _WATCHED:
                found[file.name] = (file.stat().st_mtime_ns, file.stat().st_size)
    return found


def _check_speed(speed: float | None) -> float | None:
    if speed is None:
        return None
    found = as_float(speed, "speed")
    if not 0.0 < found <= _FASTEST:
        raise BadValue(f"speed must be up to {_FASTEST:g} turns a second, or None, not {found:g}.")
    return found


def _make_title(game: Context | Scenario) -> str:
    if isinstance(game, Context):
        return "A live game"
    return game.spec.name or (game.file.stem if game.file else "A live game")
