"""A recording that is open for reading: its states, events and tables, without a context."""

import os
from base64 import b64decode
from bisect import bisect_right
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import nullcontext
from functools import partial
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, TypeVar, Unpack, overload

import numpy as np

from gamms.arguments import (
    as_bool,
    as_context,
    as_int,
    as_mapping,
    as_path,
    as_target,
    explain_call_errors,
    spell_out_options,
)
from gamms.compat import Surface
from gamms.errors import BadType, BadValue
from gamms.folders import write_whole
from gamms.ir import events as kinds
from gamms.ir.events import COMPONENTS, Log
from gamms.ir.graph import GraphColumns, read_only
from gamms.ir.tables import add_latlon, make_frame, make_table
from gamms.knowledge.sides import list_sides
from gamms.recorder import tables
from gamms.recorder.detached import DetachedAgents, DetachedState
from gamms.recorder.errors import DAMAGES, Damaged, RecordingError, report_damage
from gamms.recorder.formats.reader import Reader
from gamms.recorder.maps import become, check_given_map, compute_hash, has_map, hash_in
from gamms.recorder.states import State, copy_state
from gamms.recorder.streams import StreamOwner, open_output, open_readable, read_format
from gamms.text import shown
from gamms.typing import AerialStrategy, AsyncStrategy, IContext, Strategy
from gamms.typing.context import HostContext
from gamms.typing.map_storage import IPackedGraph, packed_graphs
from gamms.typing.recorder import pages
from gamms.typing.visualization_engine import PictureOptions

if TYPE_CHECKING:
    import pandas as pd

C = TypeVar("C", bound=IContext)
AnyStrategy = Strategy | AerialStrategy | AsyncStrategy
Strategies = Mapping[str, AnyStrategy]  # agent or team -> its strategy
# strategies with which agents or teams may continue
Branches = Sequence[AnyStrategy | None] | Mapping[str, AnyStrategy | None]

_MOST_SHOWN = 20 << 20  # largest page shown in a notebook, bytes
_FRAME = (  # sandboxed: scripts run, but cannot access the notebook
    '<iframe title="the game" sandbox="allow-scripts" style="width:100%;height:560px;border:0" srcdoc="{}"></iframe>'
)
_FEW_SIDES = 4  # sides that a title lists
_BLOBS = ("world",)  # header entries that are not text
_CALLERS = ("folder", "file", "allow")  # arguments of `Scenario(**header["scenario"])` that only a caller may give
_LISTS = {"name": "names", "team": "teams", "speed": "speed", "strategy": "strategies"}  # columns that rarely change


def open(source: str | os.PathLike[str] | BinaryIO, *, graph: object = None) -> "Recording":
    """Open a recording of version 3, by path or as a binary stream.

    Args:
        source: the path, with or without suffix, or the stream.
        graph: the map, for a recording that does not contain it: a context, the graph of another recording, or the path
            of a file written by `ctx.graph.save`.

    Raises:
        FileNotFoundError, OSError: the file cannot be read.
        RecordingError (ValueError): not a recording, of version 2, with a damaged header, or with another map.
        BadType (TypeError): `source` is neither a path nor a binary stream, or `graph` is not a map.
    """
    stream, is_owned = open_readable(source)
    try:
        if 0 < read_format(stream) < 3:
            raise RecordingError(  # noqa: TRY301 - the stream is closed below
                "This recording has format version 2, which has neither a map nor an index. `gamms convert IN OUT` "
                "makes version 3 of it; ctx.record.replay plays it as it is."
            )
        return Recording(Reader(stream), stream if is_owned else None, graph)
    except BaseException:
        if is_owned:
            stream.close()
        raise


class Recording(Surface, StreamOwner):
    """A recording that is open for reading; only a few turns are in memory.

    State 0 is the start, state n is the state after turn n; `recording[n]` is state n, `recording[-1]` the last state,
    and `len(recording)` is the number of completed turns. Iteration yields all states in order. Turn n is between
    states n - 1 and n; events after the last completed turn are in turn `turns + 1`.

    Every method raises RecordingError (a ValueError) with the position if the file is damaged, and BadValue for turns
    that do not exist.

    Attributes:
        header: metadata: `format`, `package` (version of GAMMS), `seed`, `created`, `provenance`.
        reader: reads the blocks of the file.
        warning: the missing part of an unfinished recording; else None.
    """

    _called = "recording"

    def __init__(self, reader: Reader, owned: BinaryIO | None = None, graph: object = None) -> None:
        if not isinstance(reader, Reader):
            raise BadType(f"gamms.recorder.open opens a recording; this is made of a Reader, not {shown(reader)}.")
        super().__init__(owned)
        self.reader = reader
        self._given = None if graph is None else check_given_map(graph, reader.header)
        self.header = {key: value for key, value in reader.header.items() if key not in _BLOBS}
        for key in _CALLERS:
            if isinstance(self.header.get("scenario"), dict) and key in self.header["scenario"]:
                raise RecordingError(f"The scenario in this recording sets {key!r}, which only the reader may set.")
        self.warning = reader.warning
        self._turns: int | None = None
        self._state: DetachedState | None = None
        self._at = 0  # turns that it knows
        self._named: tuple[tuple[DetachedAgents, int] | None, dict[str, Any]] = (None, {})
        self._maps: dict[int, IPackedGraph] = {}  # turn of a map change -> the map; the first map and one other
        self._map_turns: list[int] | None = None

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.turns} turns)"

    def _repr_html_(self) -> str | None:
        """Return HTML with turns, scores and a page that replays the game, for notebooks; None if it cannot be read.

        Without scripts, or if the page would be too large, the page is a picture of the last state.
        """
        try:
            scores = "".join(f"<br/>{escape(f'{of}: {score}')}" for of, score in self[-1].scores.items())
            with self._make_context(self.turns, {}, is_quiet=True) as ctx:
                still = ctx.visual.pictures.as_html()
            content = pages["gamms"](self, still=b64decode(still.partition("base64,")[2].partition('"')[0]))
            if len(content) <= _MOST_SHOWN:
                still = _FRAME.format(escape(content.decode()))
            return f"<b>{escape(repr(self))}</b>{scores}<br/>{still}"
        except Exception:  # noqa: BLE001 - a notebook then shows its repr
            return None

    def _repr_png_(self) -> bytes | None:
        """Return a picture of the last state, for printed notebooks; None if no renderer is available."""
        try:
            with self._make_context(self.turns, {}, is_quiet=True) as ctx:
                found: bytes | None = ctx.visual.pictures.as_png()
                return found
        except Exception:  # noqa: BLE001 - a notebook then shows its repr
            return None

    @property
    def seed(self) -> Any:
        """The seed of the context that was recorded."""
        return self.header.get("seed")

    @property
    def is_complete(self) -> bool:
        """Whether the recording was finished."""
        return self.warning is None

    @property
    def title(self) -> str:
        """The name of the scenario, else the sides of the game."""
        scenario = self.header.get("scenario")
        name = scenario.get("name") if isinstance(scenario, dict) else None
        if isinstance(name, str) and name:
            return name
        with report_damage("The sides of this recording are damaged", DAMAGES):
            sides = self.header.get("sides") or list_sides(self.header, self.detached(0).make_keyframe(0))
            named = [side for side in sides if side is not None]
            return " and ".join(named) if 0 < len(named) <= _FEW_SIDES else "A recorded game"

    @property
    def turns(self) -> int:
        """The number of completed turns."""
        if self._turns is None:
            logs = self.reader.turns
            last = self.reader.events(logs - 1, logs, {kinds.UNFINISHED}) if logs else ()
            self._turns = logs - any(True for _ in last)
        return self._turns

    def __len__(self) -> int:
        return self.turns

    # -- states -------------------------------------------------------------------------------------------------

    @explain_call_errors
    def state(self, turn: int) -> State:
        """Return the state after a number of turns; 0 is the start."""
        state = self.detached(turn := as_int(turn, "turn"))
        version = state.agents, state.agents.version
        if self._named[0] != version:
            named = make_table({name: state.agents.columns[key] for name, key in _LISTS.items()})
            self._named = version, {name: read_only(column) for name, column in named.items()}
        return copy_state(state, turn, self._named[1], lambda: self.map_at(turn))

    @overload
    def __getitem__(self, turn: int) -> State: ...
    @overload
    def __getitem__(self, turn: slice) -> list[State]: ...
    def __getitem__(self, turn: int | slice) -> State | list[State]:
        """Return the state after a number of turns, negative from the end; for a slice, a list of states."""
        if isinstance(turn, slice):
            return [self.state(one) for one in range(*turn.indices(self.turns + 1))]
        turn = as_int(turn, "turn")
        return self.state(turn + self.turns + 1 if -self.turns - 1 <= turn < 0 else turn)

    def __iter__(self) -> Iterator[State]:
        for turn in range(self.turns + 1):
            yield self.state(turn)

    def _as_turn(self, turn: int) -> int:
        number = as_int(turn, "turn")
        if not 0 <= number <= self.turns:
            raise BadValue(f"There is no state after {number} turns: this recording has {self.turns} turns.")
        return number

    @explain_call_errors
    def detached(self, turn: int) -> DetachedState:
        """Return the state after a number of turns, valid until the next call."""
        turn = self._as_turn(turn)
        with report_damage(f"The state after turn {turn} cannot be worked out", (Damaged,)):
            return self._compute_state(turn)

    def _compute_state(self, turn: int) -> DetachedState:
        """Return a state, computed from the last keyframe or from the previous result."""
        state = self._state
        if state is None or not max(self.reader.keyframe_before(turn), 0) <= self._at <= turn:
            found = self.reader.keyframe(turn)
            if found is None:
                raise RecordingError("This recording has no initial state.")
            self._state = None
            self._named = (None, {})
            self._at = found[0]
            state = DetachedState(found[1], found[0])
            if "components" not in found[1]:  # missing in the first recordings of version 3
                for _, _, kind, data in self.reader.events(0, self._at, COMPONENTS):
                    state.apply_event(kind, data)
        self._state = None  # cleared, because an error in the next line leaves it incomplete
        state.advance(self.reader, self._at, turn)
        self._state = state
        self._at = turn
        return state

    @overload
    def resume(
        self,
        turn: int,
        strategies: Strategies | None = None,
        seed: int | None = None,
        vis_engine: object = None,
        *,
        ctx: None = None,
    ) -> HostContext: ...
    @overload
    def resume(
        self,
        turn: int,
        strategies: Strategies | None = None,
        seed: int | None = None,
        vis_engine: None = None,
        *,
        ctx: C,
    ) -> C: ...
    @explain_call_errors
    def resume(
        self,
        turn: int,
        strategies: Strategies | None = None,
        seed: int | None = None,
        vis_engine: object = None,
        *,
        ctx: IContext | None = None,
    ) -> HostContext | IContext:
        """Return a live context with the game after a number of turns, to continue or to branch.

        Agents, sensors, teams, scores, data, facts, memories and random streams are restored; `ctx.game.reset` returns
        to this state. The caller supplies what a recording cannot contain: strategies, rules (add them to the context
        as in the recorded program), conflicts, settings, and data of strategies outside `state["memory"]`. With the
        same seed, strategies and rules the game continues identically. An agent that came during the recording gets
        the plain function of the same name that decides for another agent; otherwise a warning names it.

        Args:
            turn: number of turns before; 0 is the start.
            strategies: by agent or team; `state -> None`.
            seed: seed of all random streams; None: the seed of the recording.
            vis_engine: see `create_context`.
            ctx: a context with agents, strategies and rules, as created by a program or a scenario; it is changed,
                unless an error is raised. None: a new context, which the caller must terminate.

        Returns:
            The context; a given context keeps its static type.

        Raises:
            BadValue: the turn does not exist, or vis_engine is given with ctx.
            UnknownName (KeyError): a team or agent with a strategy does not exist.
            RecordingError (ValueError): the recording is damaged, or does not fit the context.
        """
        if ctx is not None and vis_engine is not None:
            raise BadValue("vis_engine is for a fresh context, and ctx has an engine already.")
        given = {} if strategies is None else as_mapping(strategies, "strategies")
        live: HostContext = self._make_context(turn, given, seed, vis_engine, ctx)
        return live

    def branch(
        self,
        turn: int,
        strategies: Mapping[str, Branches] | None = None,
        seeds: Iterable[int] | None = None,
        *,
        build: Callable[[], HostContext] | None = None,
        max_turns: int | None = None,
    ) -> dict[str, "np.ndarray[Any, Any]"]:
        """Continue from a turn with other strategies and seeds; return a table of the results.

        It has one row per seed and combination of strategies: `strategies.<team>`, seed, the columns of `Result.row()`,
        and error: the error of the game, or None. See `resume` for errors.

        Args:
            turn: number of turns before.
            strategies: for each team or agent a list, in which None is the strategy from `build`; or a dict by name.
            seeds: seeds of the continued games; None: the seed of the recording.
            build: function that makes a context with agents, strategies and rules; None: rebuild the scenario of the
                recording, which may use only code of GAMMS (or ScenarioError is raised).
            max_turns: maximum number of turns from there; None: as in the settings.
        """
        from gamms.recorder import resuming

        made = resuming.builders["gamms"](self) if build is None else build
        named = as_mapping({} if strategies is None else strategies, "strategies")
        return make_table(list(resuming.play_branches(partial(self.resume, turn), made, named, seeds, max_turns)))

    def _make_context(
        self,
        turn: int,
        strategies: Mapping[str, Any],
        seed: int | None = None,
        vis_engine: object = None,
        ctx: IContext | None = None,
        *,
        is_quiet: bool = False,
    ) -> Any:
        """Return the context of `resume`; a quiet one does not warn about data that recordings cannot contain."""
        from gamms.recorder import resuming

        then = self.state(turn)
        turn = as_int(turn, "turn")
        if is_quiet and seed is None and "audience" in self.header:
            seed = 0  # unused, because such a recording does not reveal its seed
        if ctx is not None:
            as_context(ctx, "resume")
        chosen = resuming.find_strategies(self.detached(turn), strategies)
        seed = resuming.as_seed(seed, resuming.find_seed(self.reader, turn))
        live: Any = resuming.open_context(seed, vis_engine, is_quiet=is_quiet) if ctx is None else ctx
        own = set(live.agent.agents)
        try:
            with nullcontext() if ctx is None or live.is_recording else resuming.restore_on_error(live):
                become(live, self.map_hash(turn), lambda: then.graph.packed, (self.map_hash(0),))
                live.reseed(seed)
                resuming.resume(live, self.reader, turn, self.detached(turn), is_fresh=ctx is None)
                for name, strategy in chosen.items():
                    live.agent.agents[name].register_strategy(strategy)
                if ctx is not None or chosen:
                    resuming.complete_strategies(live, self.detached(turn), own | {*self.state(0).agents["name"]})
                with report_damage(f"This game cannot go on from turn {turn}"):
                    live.game.internals.refuse_misfits()
        except BaseException:
            if ctx is None:
                live.terminate()
            raise
        return live

    @spell_out_options()
    @explain_call_errors
    def save(
        self,
        path: str | os.PathLike[str],
        turn: int | None = None,
        width: int | None = None,
        height: int | None = None,
        *,
        dpi: float = 96.0,
        audience: str | None = None,
        **options: Unpack[PictureOptions],
    ) -> None:
        """Save a picture of the state after a number of turns, or, as `.html`, a page that replays all turns.

        A picture equals the result of `ctx.visual.save` at that time. A page accepts `title`, `theme`, `labels` and
        `trails`, begins after `turn`, by default 0, and fills its window.

        Args:
            path: an existing file is replaced; its suffix names the format.
            turn: number of turns before; None: the end.
            width: pixels; None: derived from the map.
            height: pixels; None: derived from the map.
            dpi: pixels per inch: the size of the picture on paper.
            audience: for a page: a team, by its text; the page leaves out what the team could not know. None:
                everything.
            options: see `PictureOptions`.

        Raises:
            BadValue: the turn does not exist, or an option is invalid.
            MissingFolder (FileNotFoundError): the folder does not exist.
            MissingExtra (ImportError): a library for the format is not installed.
            RecordingError (ValueError): the recording is damaged.
        """
        if as_path(path, "path").suffix.lower() == ".html":
            if width is not None or height is not None:
                raise BadValue("A page is as large as its window; leave width and height out.")
            self._save_page(path, {"turn": turn or 0, "audience": audience, **options})
            return
        if audience is not None:
            raise BadValue("audience is for pages, .html; `gamms render --fog` draws what a team knows.")
        with self._make_context(self.turns if turn is None else turn, {}, is_quiet=True) as ctx:
            ctx.visual.save(path, width, height, dpi=dpi, **options)

    def _save_page(self, path: str | os.PathLike[str], options: dict[str, Any]) -> None:
        write_whole(as_target(path), pages["gamms"](self, **options), through_links=True)

    @explain_call_errors
    def cut(self, path: str | os.PathLike[str] | BinaryIO, team: object, *, overwrite: bool = False) -> None:
        """Write the knowledge of a team as a separate recording; see docs/recording.md.

        Args:
            path: destination, as for `ctx.record.start`; or a binary stream, which stays open.
            team: the team, or its text; for an agent without a team its name. "team red" and "agent red" tell a team
                and an agent with the same name apart.
            overwrite: whether to replace an existing file.

        Raises:
            UnknownName (KeyError): the team does not exist; True and 1.0 are not the team 1.
            BadValue: the recording has no sensor data, or a team and an agent without a team have this name.
            FileExistsError, OSError: the file exists, or cannot be written.
            RecordingError (ValueError): the recording is damaged, or does not contain its map.
        """
        from gamms.recorder.cut import write_cut

        with open_output(path, overwrite=as_bool(overwrite, "overwrite")) as stream:
            write_cut(self.reader, self.graph.columns(), stream, team)

    @explain_call_errors
    def observation(self, turn: int, agent: str) -> dict[str, Any]:
        """Return the state that an agent's strategy received in a turn; requires recorded sensor data.

        Used to repeat a decision: `strategy(recording.observation(12, "anna"))`. Data of custom sensors, memories and
        facts are included if they were plain values.

        Args:
            turn: number of the turn, from 1.
            agent: name of the agent.

        Raises:
            BadValue: the turn does not exist, or the recording has no sensor data of it.
            UnknownName (KeyError): no living agent had this name.
            RecordingError (ValueError): the recording is damaged.
        """
        from gamms.recorder import resuming

        turn = as_int(turn, "turn")
        if not 1 <= turn <= self.turns:
            raise BadValue(f"There is no turn {turn}: this recording has turns 1 to {self.turns}.")
        with self._make_context(turn - 1, {}, is_quiet=True) as ctx:
            return resuming.get_observation(ctx, self.reader.log(turn - 1), self.detached(turn - 1), turn, agent)

    # -- the map ------------------------------------------------------------------------------------------------

    @property
    def graph(self) -> IPackedGraph:
        """The map at the start, read-only.

        Raises:
            RecordingError: it is not in the recording, and was not given to `open`.
        """
        return self._map(0, self._make_first_map)

    def _make_first_map(self) -> Any:
        header = self.reader.header
        if self._given is None and not has_map(header):
            raise RecordingError(
                f"This recording does not contain its map, only the SHA-256 of it, {hash_in(header)}. Pass the map: "
                "gamms.recorder.open(path, graph='map.gamms')."
            )
        return header.get("world") if self._given is None else self._given

    def _get_first_map(self) -> GraphColumns:
        return self.graph.columns()

    def map_hash(self, turn: int) -> str:
        """Return the SHA-256 of the map after a number of turns, even if the recording does not contain the map."""
        last = self._map_turn(turn)
        return compute_hash(self.map_at(turn).packed) if last else hash_in(self.reader.header)

    def _map_turn(self, turn: int) -> int:
        """Return the last turn up to this one with a map change; 0 if there is none."""
        if self._map_turns is None:
            self._map_turns = sorted({log + 1 for log, *_ in self.reader.events(kinds={kinds.WORLD})})
        place = bisect_right(self._map_turns, self._as_turn(turn))
        return self._map_turns[place - 1] if place else 0

    def map_at(self, turn: int) -> IPackedGraph:
        """Return the read-only map after a number of turns."""
        last = self._map_turn(turn)
        return self._map(last, lambda: self._make_changed_map(last)) if last else self.graph

    def _make_changed_map(self, turn: int) -> Any:
        *_, (*_, data) = self.reader.events(turn - 1, turn, {kinds.WORLD})
        return data.get("world") if isinstance(data, dict) else None

    def _map(self, turn: int, packed: Callable[[], Any]) -> IPackedGraph:
        if turn not in self._maps:
            world = packed()
            if not isinstance(world, bytes):
                raise RecordingError(
                    f"The map of turn {turn} is not there: this recording holds {type(world)} instead."
                )
            self._maps = {one: kept for one, kept in self._maps.items() if one == 0}
            self._maps[turn] = packed_graphs["gamms"](world)
        return self._maps[turn]

    # -- events -------------------------------------------------------------------------------------------------

    def events(self, start: int | None = None, stop: int | None = None) -> Iterator[dict[str, Any]]:
        """Yield events emitted by rules or recorded by programs, for turns from `start` until before `stop`, in order.

        Yields:
            `turn`, `kind`, and the data of the event. For events of rules, the turn is the turn number of the game, as
            in a `Result`.
        """
        return tables.read_events(self.reader, *self._find_logs(start, stop))

    def steps(self, start: int | None = None, stop: int | None = None) -> Iterator[dict[str, Any]]:
        """Yield all events of these turns, in order.

        Yields:
            `turn`; `event`, which is "MOVE", or the name of a kind of the format; `agent` and `node` for a move, `data`
            for other events.
        """
        return tables.read_steps(self.reader, *self._find_logs(start, stop), self._find_names)

    @explain_call_errors
    def export(self, path: str | os.PathLike[str], *, turn_seconds: float = 1.0) -> Path:
        """Write the positions of agents at the start and after each turn: `.gpx`, `.geojson` or `.csv`.

        Positions are latitude and longitude; CSV also has map units, and works without a CRS. Heights are those of
        flying agents. Times count from `header["created"]`, or from 1970.

        Args:
            path: an existing file is replaced; its suffix names the format.
            turn_seconds: duration of a turn.

        Raises:
            UnknownType (ValueError): the suffix names no supported format.
            BadValue (ValueError): the map has no CRS, or the duration is invalid.
            RecordingError (ValueError): the recording is damaged, or does not contain its map.
            TooLarge (ValueError): the positions do not fit in memory.
            OSError: the file cannot be written.
        """
        from gamms.recorder import tracks

        def moments() -> Iterator[tracks.AgentsAtTurn]:
            for turn in range(self.turns + 1):
                state = self.state(turn)
                yield tracks.AgentsAtTurn(state.agents, state.graph.columns())

        return tracks.export(path, moments(), self.turns, self.header.get("created"), turn_seconds)

    def table(
        self, name: str, start: int | None = None, stop: int | None = None, *, lat_lon: bool = False
    ) -> dict[str, np.ndarray[Any, Any]]:
        """Return a table of turns from `start` until before `stop`, as columns of equal length.

        `events`, `moves`, `positions` and `scores` always exist; each kind of event is also a table. docs/recording.md
        lists their columns. With `lat_lon` nodes have latitude and longitude, if they are on the final map.

        Raises:
            UnknownName (KeyError): the table does not exist.
            BadValue (ValueError): `lat_lon` for a table without nodes or a map without a CRS.
        """
        logs = self._find_logs(start, stop)
        table = tables.read_table(self.reader, name, *logs, self._find_names, self._get_first_map)
        return add_latlon(table, self.state(self.turns).graph.columns()) if as_bool(lat_lon, "lat_lon") else table

    def to_pandas(
        self, name: str, start: int | None = None, stop: int | None = None, *, lat_lon: bool = False
    ) -> "pd.DataFrame":
        """Return a table as a pandas data frame; see `table`.

        Raises:
            UnknownName (KeyError): the table does not exist.
            MissingExtra (ImportError): pandas is not installed.
        """
        return make_frame(self.table(name, start, stop, lat_lon=lat_lon))

    def logs(self, start: int | None = None, stop: int | None = None) -> Iterator[Log]:
        """Yield the log of each turn from `start` until before `stop`; see docs/recording-format.md."""
        return (self.reader.log(log) for log in range(*self._find_logs(start, stop)))

    def content(self) -> bytes:
        """Return the present bytes of the file."""
        return self.reader.content()

    def counts(self) -> dict[str, int]:
        """Return the number of events of each kind of the format, without moves."""
        counts: Counter[str] = Counter()
        for kind, count in self.reader.count_events().items():
            counts[tables.KINDS.get(kind, f"{kind:#010x}")] += count
        return dict(counts)

    def count_moves(self) -> int:
        """Return the number of moves of agents on the ground."""
        return self.reader.count_moves()

    def _find_names(self, log: int) -> tuple[dict[int, str], int]:
        """See `tables.NamesAt`."""
        agents = self.detached(log).agents
        return agents.get_names_by_number(), agents.following

    def _find_logs(self, start: int | None, stop: int | None) -> tuple[int, int]:
        """Return the range of logs for turns from `start` until before `stop`; turn n is in log n - 1."""
        first = 0 if start is None else as_int(start, "start")
        last = self.reader.turns + 1 if stop is None else as_int(stop, "stop")
        if first < 0 or last < 0:
            raise BadValue(f"Turns are counted from 1 on; start={start} and stop={stop} are no such range.")
        end = min(max(last - 1, 0), self.reader.turns)
        return min(max(first - 1, 0), end), end
