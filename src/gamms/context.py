"""The composition root: the only module that imports every engine; it builds the engines of a context."""

import logging
import os
from collections.abc import Callable, Mapping
from enum import Enum
from functools import partial
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

from gamms import agent, graph, kernels, memory, sensor, typing, visual
from gamms.arguments import as_bool, as_choice, as_int, as_mapping, as_member, as_path, as_text, explain_call_errors
from gamms.compat import Surface, suggest_part
from gamms.deciding import DecidePhase, Guarded, add_copies, leave_last_turn, refuse_to_judges, refuse_while_deciding
from gamms.errors import BadType, BadValue, ContextTerminated, UnknownEngine
from gamms.readonly import NotPickled
from gamms.text import make_printable, shown
from gamms.typing.context import contexts
from gamms.typing.visualization_engine import live_engines

if TYPE_CHECKING:
    from numpy.random import Generator

    from gamms.agent.snapshots import AgentsSnapshot
    from gamms.game import Game
    from gamms.recorder import Recorder

_LEVELS = ("DEBUG", "INFO", "WARNING", "ERROR", "CRITICAL")
_LOGGER_VERBS = ("debug", "info", "warning", "error", "critical", "setLevel")


class InternalContext(typing.IInternalContext):
    """Engines that serve other engines, not users."""

    def __init__(
        self,
        compute_engine: typing.IComputeEngine | None = None,
        memory_engine: typing.IMemoryEngine | None = None,
        message_engine: typing.IMessageEngine | None = None,
    ) -> None:
        self.compute_engine = compute_engine
        self.memory_engine = memory_engine
        self.message_engine = message_engine

    @property
    def memory(self) -> typing.IMemoryEngine:
        """The stores."""
        return self.memory_engine  # type: ignore[return-value] # None only in a context that is built by hand

    @property
    def compute(self) -> typing.IComputeEngine | None:
        """Background work; None unless the program provides such an engine."""
        return self.compute_engine

    @property
    def message(self) -> typing.IMessageEngine | None:
        """Messages between processes; None unless the program provides such an engine."""
        return self.message_engine

    def terminate(self) -> None:
        """Close every engine."""
        for engine in (self.memory_engine, self.compute_engine, self.message_engine):
            if engine is not None:
                engine.terminate()


class Context(Surface, Guarded, NotPickled, typing.IContext):
    """One running scenario. Usable in a `with` statement, which terminates it.

    The engines are attributes, so that a program may build a context with other engines.
    """

    _called = "ctx"
    _not_pickled = DecidePhase._not_pickled
    _elsewhere = suggest_part

    agent_engine: Any
    graph_engine: Any
    sensor_engine: Any
    _shows_nothing = False  # whether a NoEngine is made when the visual engine is first asked for

    @partial(explain_call_errors, hint=" Call gamms.create_context(…), which makes a context and its engines.")
    def __init__(
        self,
        internal_context: typing.IInternalContext | None = None,
        agent_engine: typing.IAgentEngine | None = None,
        sensor_engine: typing.ISensorEngine | None = None,
        visual_engine: typing.IVisualizationEngine | None = None,
        graph_engine: typing.IGraphEngine | None = None,
        recorder: typing.IRecorder | None = None,
        logger: typing.ILogger | logging.Logger | None = None,
    ) -> None:
        self._phase = DecidePhase()
        self._internal_context: Any = internal_context
        self.agent_engine = agent_engine
        self.sensor_engine = sensor_engine
        self._visual_engine: Any = visual_engine
        self.graph_engine = graph_engine
        self._recorder: Any = recorder
        self._logger: Any = logger or logging.getLogger("gamms")
        self._alive = False
        self._seed = int.from_bytes(os.urandom(6), "little")
        self.is_seeded = False  # whether the caller has given the seed
        self._seed_uses = 0
        self._rng: Generator | None = None
        self._game: Game | None = None

    def __setattr__(self, name: str, value: object) -> None:
        """Set an attribute; another engine has other agents or another map."""
        super().__setattr__(name, value)
        if name.endswith("_engine"):
            self._phase.drop_plans()

    @property
    def agent(self) -> "agent.AgentEngine":
        """The agent engine: creates agents and stores them by name."""
        return self.agent_engine  # type: ignore[no-any-return] # a program may put its own there

    @property
    def graph(self) -> "graph.GraphEngine":
        """The graph engine: the graph, its obstacles and visibility tables."""
        return self.graph_engine  # type: ignore[no-any-return] # a program may put its own there

    @property
    def sensor(self) -> "sensor.SensorEngine":
        """The sensor engine: creates sensors and stores them by name."""
        return self.sensor_engine  # type: ignore[no-any-return] # a program may put its own there

    @property
    def visual(self) -> "visual.PictureEngine":
        """The visual engine: pictures, films and the window."""
        return self.visual_engine  # type: ignore[no-any-return] # a program may put its own there

    @property
    def visual_engine(self) -> Any:
        """The visual engine, settable, also by a member of `visual.Engine`; a `NoEngine` if none was chosen."""
        if self._visual_engine is None and self._shows_nothing:
            with self._phase.suspend(changes_world=False):
                self._visual_engine = visual.NoEngine(self)
        return self._visual_engine

    @visual_engine.setter
    def visual_engine(self, engine: typing.IVisualizationEngine | Enum | None) -> None:
        self._visual_engine = _make_visual_engine(self, engine, {}) if isinstance(engine, visual.Engine) else engine

    @property
    def record(self) -> "Recorder":
        """The recorder: writes recordings and replays them."""
        return self.recorder  # type: ignore[no-any-return] # a program may put its own there

    @property
    def recorder(self) -> Any:
        """The recorder, settable; created on first access."""
        if self._recorder is None:
            from gamms.recorder import Recorder

            with self._phase.suspend():
                self._recorder = Recorder(self)
        return self._recorder

    @recorder.setter
    def recorder(self, recorder: typing.IRecorder | None) -> None:
        self._recorder = recorder

    @property
    def is_recording(self) -> bool:
        """Whether a recording is being written or replayed."""
        recorder = self._recorder
        if recorder is None:
            return False
        return bool(getattr(recorder, "is_replaying", False) or getattr(recorder, "is_open", recorder.record()))

    @property
    def game(self) -> "Game":
        """The turn engine, created on first access; loops without it, as in the paper, work too."""
        if self._game is None:
            from gamms.game import Game

            with self._phase.suspend(changes_world=False):
                self._game = Game(self)
        return self._game

    @leave_last_turn
    def use_game(self, game: object) -> None:
        """Set the turn engine: the one that the program has of a fork; see `gamms.game.game.UnreadFork`."""
        from gamms.game import Game

        if not isinstance(game, Game):
            raise BadType(f"The game of a context must be a Game, such as ctx.game.fork(1), not {shown(game)}.")
        self._game = game

    @property
    def current_game(self) -> "Game | None":
        """The turn engine if `ctx.game` was used before, else None."""
        return self._game

    @property
    def ictx(self) -> typing.IInternalContext:
        """Engines that serve other engines; not for strategies."""
        return self.internal_context  # type: ignore[no-any-return] # a program may put its own there

    @property
    def internal_context(self) -> Any:
        """The internal context, settable; `ictx` is the same."""
        self._phase.refuse("use ctx.ictx")
        return self._internal_context

    @internal_context.setter
    def internal_context(self, internal_context: typing.IInternalContext | None) -> None:
        self._internal_context = internal_context

    @property
    def logger(self) -> typing.ILogger:
        """The logger; settable to any object with the methods of `ILogger`."""
        return self._logger  # type: ignore[no-any-return] # checked when it is set

    @logger.setter
    def logger(self, logger: typing.ILogger) -> None:
        missing = [verb for verb in _LOGGER_VERBS if not callable(getattr(logger, verb, None))]
        if missing:
            raise BadType(f"A logger needs the methods of gamms.logger.ILogger; {shown(logger)} lacks {missing}.")
        self._logger = logger

    @property
    def seed(self) -> int:
        """The seed of all random streams; hidden from strategies, which could predict the draws of others."""
        if self._phase.is_deciding:
            self._phase.refuse("read ctx.seed, from which all draws of others follow")
        self.__dict__["_seed_uses"] += 1  # NOTE: without the guard, which each turn asks (benchmarks: turns)
        return self._seed

    @property
    def seed_uses(self) -> int:
        """The number of times that the seed or a stream was read, which shows whether something depends on the seed."""
        return self._seed_uses

    @property
    def rng(self) -> "Generator":
        """The random stream of the scenario; hidden from strategies, which use `state['rng']`."""
        self._phase.refuse("draw from ctx.rng, which all share instead of state['rng']")
        self.__dict__["_seed_uses"] += 1
        if self._rng is None:
            self._rng = self.stream("context")
        return self._rng

    @refuse_to_judges
    def reseed(self, seed: int, rng_state: Mapping[str, Any] | None = None) -> None:
        """Derive all further random draws, also of agents, from another seed.

        Values that were drawn at the start of the game stay.

        Args:
            seed: the same seed gives the same random streams.
            rng_state: a state returned by `rng_state`, from which `rng` continues.
        """
        last = self._seed
        # NOTE: at once, without asking for each who may set it (benchmarks: a plain rule).
        vars(self).update(_seed=as_int(seed, "seed"), is_seeded=True, _rng=None)
        self.graph.storage.restart_stream()
        if self._game is not None and self._seed != last:
            self._game.internals.restart_streams()
        if rng_state is not None:
            self.rng.bit_generator.state = rng_state

    @leave_last_turn
    def rng_state(self) -> Any:
        """Return the state of `rng`; None before its first use."""
        return None if self._rng is None else self._rng.bit_generator.state

    @leave_last_turn
    def stream(self, *names: str | int) -> "Generator":
        """Return the random stream of one purpose; it depends only on the seed and the names.

        For example `ctx.stream("agent", name)` for an agent, `ctx.stream("weather", turn)` for a turn.

        Raises:
            BadType: a name is neither a string nor an integer.
        """
        self._seed_uses += 1
        plain = (str(name) if isinstance(name, str) else as_int(name, "The name of a stream") for name in names)
        return kernels.stream(self._seed, *plain)

    @refuse_while_deciding
    def fork(self, seed: int) -> "tuple[Context, dict[int, Any]]":
        """Return a context with the same map and copies of the agents and sensors, for `ctx.game.fork`.

        Args:
            seed: the seed of the new context.

        Returns:
            The context, and the memo of `copy.deepcopy`: `id()` of a replaced object -> its replacement.
        """
        memo = dict[int, Any]()
        return self.capture(self.agent.storage.snapshot(dict), only_plain=False).make_fork(seed, memo), memo

    @refuse_while_deciding
    def capture(self, agents: "AgentsSnapshot", *, only_plain: bool) -> "_CapturedContext":
        """Return what a fork of the context is made of.

        Args:
            agents: the result of `ctx.agent.storage.snapshot`.
            only_plain: whether forks can be made later, when the context has changed.

        Raises:
            BadType: `only_plain` is not a boolean.
            NotPlain: `only_plain`, and the sensors do not permit it.
        """
        return _CapturedContext(self, agents, self.sensor.storage.capture(only_plain=as_bool(only_plain, "only_plain")))

    @refuse_to_judges
    def set_alive(self) -> None:
        """Start the scenario."""
        self._alive = True

    def is_terminated(self) -> bool:
        """Whether the scenario has ended (or has not begun)."""
        return not self._alive

    @refuse_to_judges
    def terminate(self) -> None:
        """End the scenario: close all engines, each before the engines that it depends on."""
        if not self._alive:
            return
        if self._game is not None:
            self._game.internals.close()  # before the recorder stops, which writes how the game ended
        closing: list[Callable[[], object]] = [self._end]
        try:
            names = ("_visual_engine", "internal_context", "graph_engine", "sensor_engine", "agent_engine")
            closing += [engine.terminate for name in names if (engine := getattr(self, name)) is not None]
            recorder = self._recorder
            if recorder is not None and getattr(recorder, "is_open", recorder.record()):
                closing.append(getattr(recorder, "close", recorder.stop))
        finally:
            _call_each(closing)

    def _end(self) -> None:
        self._alive = False
        self._phase.drop_plans()

    def _repr_png_(self) -> bytes | None:
        """Return the current state as PNG for notebooks; None if it cannot be drawn."""
        return None if self.is_terminated() else getattr(self.visual, "_repr_png_", _show_as_text)()

    def _repr_html_(self) -> str | None:
        """Return the current state as SVG for notebooks, if PNG is not available; else None."""
        return None if self.is_terminated() else getattr(self.visual, "_repr_html_", _show_as_text)()

    def __repr__(self) -> str:
        seed = "" if self._phase.is_deciding else f"seed={self._seed}, "
        if self.is_terminated():
            return f"Context({seed}terminated)"
        turn = 0 if self._game is None else self._game.turn
        return f"Context({seed}nodes={len(self.graph.graph)}, agents={len(self.agent.agents)}, turn={turn})"

    def __deepcopy__(self, memo: dict[int, Any]) -> "Context":
        """Return a fork with random streams that draw the same numbers, without recorder and window.

        Raises:
            SnapshotError: a turn is being played.
            ContextTerminated: the context has ended.
        """
        self._phase.refuse("copy the context: state['fork'](seed) gives a copy to look ahead in")
        if self.is_terminated():
            raise ContextTerminated("copy.deepcopy")
        twin, parts = self.fork(self._seed) if self._game is None else self._game.internals.fork(self._seed)
        add_copies(memo, parts)
        twin.reseed(self._seed, self.rng_state())
        twin.is_seeded = self.is_seeded
        if self.graph.storage.has_placed:
            streams = [one.graph.storage.get_place_stream() for one in (twin, self)]
            streams[0].bit_generator.state = streams[1].bit_generator.state
        if self._game is not None:
            self._game.internals.copy_streams(twin.game.internals)
        return twin

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            if error is None and not self.is_terminated() and hasattr(self.visual_engine, "stay_open_after_game"):
                self.visual_engine.stay_open_after_game()  # a window with a game that is over
            self.terminate()
        except Exception as failure:
            if error is None:
                raise
            # The error that ended the block is the one to show; a full disk must not take its place.
            self.logger.error(f"The context could not be closed properly: {failure}")  # noqa: TRY400 - an `ILogger`
            error.add_note(f"The context could not be closed properly either: {failure}")


class _CapturedContext:
    """The parts of a context at a moment, of which a fork is made.

    Args:
        ctx: the context.
        agents: the result of `ctx.agent.storage.snapshot`.
        sensors: the result of `ctx.sensor.storage.capture`.
    """

    def __init__(self, ctx: Context, agents: "AgentsSnapshot", sensors: dict[str, Any]) -> None:
        self._ctx = ctx
        self._attributes = vars(ctx).copy()
        self._agents = agents
        self._sensors = sensors
        self._map = graph.engine.SharedMap(ctx.graph)

    def renew_map(self) -> None:
        """Take the map of the context again, for one more fork."""
        self._map.renew()

    def make_fork(self, seed: int, memo: dict[int, Any]) -> Context:
        """Return the fork, and add the copies to the memo of `copy.deepcopy`; call it once after each `renew_map`."""
        then = self._attributes
        logger = then["_logger"]
        phase = then["_phase"]
        ahead = Context(InternalContext(memory_engine=memory.MemoryEngine()), logger=logger)
        # NOTE: at once, as in `reseed` (w9 fork).
        vars(ahead).update(_seed=seed, is_seeded=then["is_seeded"], _shows_nothing=True)
        ahead._phase.known_names = phase.known_names  # whose warnings are not repeated
        ahead.agent_engine = agent.AgentEngine(ahead)
        ahead.sensor_engine = sensor.SensorEngine(ahead)
        memo |= {id(self._ctx): ahead, id(phase): ahead._phase, id(logger): logger}
        memo[id(then["_internal_context"])] = ahead._internal_context
        picture = then["_visual_engine"]
        if picture is not None and not isinstance(picture, visual.PictureEngine):
            memo[id(picture)] = ahead.visual_engine  # the others find theirs when a function needs it
        if then["_recorder"] is not None:
            memo[id(then["_recorder"])] = None
        ahead.graph_engine = self._map.make_engine(ahead, memo)
        ahead.sensor_engine.storage.copy_from(self._sensors, then["sensor_engine"], memo)
        ahead.agent_engine.storage.copy_from(self._agents, then["agent_engine"], memo)
        vars(ahead).update(then | vars(ahead))  # attributes of the caller's
        ahead.set_alive()
        return ahead


def _show_as_text() -> None:
    """Stand in for the display of an engine that has none in notebooks, which then print its repr."""


@explain_call_errors
def create_context(
    graph_engine: "graph.Engine | str" = graph.Engine.MEMORY,
    vis_engine: "visual.Engine | str" = visual.Engine.NO_VIS,
    vis_kwargs: dict[str, Any] | None = None,
    logger_config: dict[str, Any] | None = None,
    *,
    seed: int | None = None,
    graph_path: str | os.PathLike[str] | None = None,
    game: dict[str, Any] | None = None,
) -> Context:
    """Create a context with all its engines; engines are given as enum members or names, such as `vis_engine="pygame"`.

    Args:
        graph_engine: MEMORY writes nothing to disk unless asked; SQLITE also keeps the graph in a database file.
        vis_engine: NO_VIS shows nothing (and can still draw pictures and films); PYGAME opens a window; OFFSCREEN films
            the game; WEB serves it to browsers.
        vis_kwargs: keywords of the visual engine.
        logger_config: arguments of `logging.basicConfig`; `level` defaults to $GAMMS_LOG_LEVEL, then INFO.
        seed: the seed of all random streams; None: a random seed.
        graph_path: the database file of SQLITE, which is opened if it exists; None: a database in memory.
        game: settings of the turn engine, such as `{"on_error": "stay"}`; see `gamms.game.Settings`.

    Raises:
        UnknownType (ValueError): an unknown graph engine.
        NoDisplay (RuntimeError): there is no screen for a window.
        MissingExtra (ImportError): a library that the visual engine needs is not installed.
        UnknownName (KeyError): `game` has an unknown setting.
        UnknownEngine (NotImplementedError): an unknown visual engine.
        BadValue, BadType: a bad seed, or a `graph_path` without SQLITE.
        BadFile (ValueError): `graph_path` is not the database of a graph.
    """
    keywords = _check_keywords(vis_kwargs, "vis_kwargs")
    graph_engine = as_member(graph.Engine, graph_engine) or graph_engine
    vis_engine = as_member(visual.Engine, vis_engine) or vis_engine
    ctx = Context(logger=_configure_logger(_check_keywords(logger_config, "logger_config")))
    if seed is not None:
        ctx._seed = as_int(seed, "seed")
        ctx.is_seeded = True
    ctx.internal_context = InternalContext(memory_engine=memory.MemoryEngine())
    try:
        path = _find_database_path(graph_engine, graph_path)
        ctx.graph_engine = graph.GraphEngine(ctx, engine=graph_engine, path=path)  # type: ignore[arg-type] # it is checked there
        ctx.agent_engine = agent.AgentEngine(ctx)
        ctx.sensor_engine = sensor.SensorEngine(ctx)
        if vis_engine is visual.Engine.NO_VIS and not keywords:
            ctx._shows_nothing = True
        else:
            ctx._visual_engine = _make_visual_engine(ctx, vis_engine, keywords)
    except BaseException:
        ctx.internal_context.terminate()
        raise
    ctx.set_alive()
    if game is not None:
        try:
            ctx.game.configure(game)
        except BaseException:
            ctx.terminate()
            raise
    return ctx


contexts.register("gamms")(create_context)


def _call_each(verbs: list[Callable[[], object]]) -> None:
    """Call all functions, the last one first, even if some raise."""
    if verbs:
        try:
            verbs.pop()()
        finally:
            _call_each(verbs)


def _check_keywords(given: object, name: str) -> dict[str, Any]:
    mapping = {} if given is None else as_mapping(given, name)
    return {as_text(key, f"Each key of {name}"): value for key, value in mapping.items()}


def _make_visual_engine(ctx: Context, engine: object, keywords: dict[str, Any]) -> typing.IVisualizationEngine:
    if engine is visual.Engine.OFFSCREEN:
        from gamms.visual.engine import OffscreenEngine

        return OffscreenEngine(ctx, **keywords)
    if engine is visual.Engine.PYGAME or engine is visual.Engine.NO_VIS:
        made_by: Any = visual.NoEngine if engine is visual.Engine.NO_VIS else visual.PygameVisualizationEngine
        return made_by(ctx, **keywords)  # type: ignore[no-any-return] # the window is loaded when it is asked for
    if engine is visual.Engine.WEB:
        return live_engines["gamms"](ctx, **keywords)
    raise UnknownEngine(
        f"Unknown visual engine {shown(engine)}. Use gamms.visual.Engine.NO_VIS, PYGAME, OFFSCREEN or WEB."
    )


def _find_database_path(engine: object, path: str | os.PathLike[str] | None) -> "memory.PathLike | None":
    if engine is not graph.Engine.SQLITE:
        if path is not None:
            raise BadValue(f"graph_path={shown(path)} needs graph_engine=gamms.graph.Engine.SQLITE.")
        return None
    return None if path is None else memory.PathLike(str(as_path(path, "graph_path")))


def _configure_logger(config: dict[str, Any]) -> logging.Logger:
    level = config.get("level")
    if level is None:
        level = os.environ.get("GAMMS_LOG_LEVEL", "INFO").upper()
        level = level if level in _LEVELS else "INFO"
    if isinstance(level, str):
        as_choice(level, "level of logger_config", list(logging.getLevelNamesMapping()))
    try:
        logging.basicConfig(**{**config, "level": level})
    except (TypeError, ValueError) as error:
        kind = BadType if isinstance(error, TypeError) else BadValue
        raise kind(f"logger_config cannot be {shown(config)}: {error}.") from error
    logger = logging.getLogger("gamms")
    if logging.getLevelName(logger.level) != level:  # NOTE: to set it empties the caches of all loggers
        logger.setLevel(level)
    logger.addFilter(_make_printable)
    return logger


def _make_printable(record: logging.LogRecord) -> bool:
    """Remove control characters from a log message, for example from the name of a file in it."""
    record.msg = make_printable(record.getMessage())
    record.args = None
    return True
