"""A game as data: read it from a file or make it in Python, change it, build it and play it."""

import logging
import os
import warnings
from collections.abc import Callable, Collection, Hashable, Iterable, Mapping, Sequence
from functools import cache, partial
from itertools import chain, islice
from pathlib import Path
from typing import Any

from gamms.arguments import (
    as_flag,
    as_int,
    as_items,
    as_known,
    as_mapping,
    as_path,
    as_recording,
    as_text,
    explain_call_errors,
)
from gamms.compat import Surface, suggest_part
from gamms.context import Context, create_context
from gamms.errors import BadType, BadValue, UnknownName
from gamms.game.batch import Batch, BatchSource, MostAgents
from gamms.game.block.columns import as_seeds
from gamms.game.result import Result, warn_of_idle
from gamms.graph.storage import MapSnapshot
from gamms.ir.graph import GraphColumns, IntArray
from gamms.readonly import Immutable
from gamms.recorder import Recording
from gamms.recorder.resuming import builders
from gamms.scenario import documents, maps
from gamms.scenario.builder import Builder, Strategies, make_digests, write_out
from gamms.scenario.code import ON_REQUEST, CodeLibrary, CodeReference, CodeSources, check_packages
from gamms.scenario.documents import ScenarioError, add_map_number, name_errors
from gamms.scenario.placement import AgentPlacement, find_node, list_members
from gamms.scenario.spec import LatLon, Place, Spec, convert_plain, to_plain
from gamms.scenario.validation import check_code, check_sense, find_unread_data
from gamms.text import shown
from gamms.typing.graph_engine import Engine as GraphEngine
from gamms.visual import Engine

_PROBES = 2  # other seeds that are tried to see whether functions depend on the seed
_AMONG = 1000  # the seeds of a batch, from the first, among which these are
_GALLERY = Path(__file__).parent.parent / "data" / "gallery"


def _suggest_place(name: str) -> str:
    """Return the hint that the contents of a scenario, or parts of its context, have a name; nothing if none has."""
    if name in Spec.__struct_fields__:
        return f" There is scenario.spec.{name}."
    found = suggest_part(name)
    return f"{found[:-1]}, where ctx = scenario.build(seed=…). scenario.play(…) plays a whole game." if found else ""


class Scenario(Surface, Immutable):
    """A complete, immutable description of a game.

    Args:
        folder: the folder of code and maps; None: no folder.
        file: the file that errors name.
        allow: installed packages whose functions may be named without an entry point.
        key_variable: the name of the environment variable with the key of language models; see docs/llm.md.
        given: the keys of a scenario file, as plain values. Pass untrusted values to `load` or `from_recording`
            instead, because `folder`, `allow` and `key_variable` are trusted here.

    Attributes:
        spec: its contents, typed; see `Spec`.
        folder: see above.
        file: see above.
        allow: see above.
        key_variable: see above.

    Raises:
        ScenarioError: the contents are not valid; the message names the place and the nearest valid key.
    """

    folder: Path | None
    file: Path | None
    allow: tuple[str, ...]
    key_variable: str | None
    spec: Spec
    _called = "scenario"
    _elsewhere = _suggest_place
    _way_out = "scenario.replace(…) returns a scenario with other values."

    def __init__(
        self,
        *,
        folder: str | os.PathLike[str] | None = None,
        file: str | os.PathLike[str] | None = None,
        allow: Iterable[str] = (),
        key_variable: str | None = None,
        **given: object,
    ) -> None:
        within = None if folder is None else as_path(folder, "folder").absolute()
        self._put_public(
            folder=within, file=None if file is None else as_path(file, "file"), allow=check_packages(allow)
        )
        self._put_public(key_variable=None if key_variable is None else as_text(key_variable, "key_variable"))
        self._library = CodeLibrary(CodeSources(self.folder, self.allow, self.key_variable))
        with name_errors(self.file, given):
            self._raw: dict[str, Any] = documents.copy_plain(given)
            self._put_public(spec=convert_plain(documents.rename_keys(self._raw), Spec))
            check_sense(self.spec)
        self._digests: dict[str, str] | None = None
        self._map_number: int | None = None  # among the maps of a batch; None: it is the only one
        self._named_idle = set[Hashable]()
        self._loaded = cache(partial(maps.load, self.spec.map, self.folder, self._library))

    def to_dict(self) -> dict[str, Any]:
        """Return its contents as plain values; `Scenario(**scenario.to_dict())` is an equal scenario."""
        copy: dict[str, Any] = documents.copy_plain(self._raw)
        return copy

    def replace(self, **changes: object) -> "Scenario":
        """Return a copy with other values: `replace(**{"max_turns": 50, "teams.red.count": 8})`.

        A part of a path is a key, or the index or the name of a list item. The map is shared.

        Raises:
            ScenarioError: a path does not exist, or a value is not allowed there.
        """
        with name_errors(self.file, self._raw):
            raw = documents.apply_changes(self._raw, changes)
        with name_errors(self.file, raw):
            new = from_plain(raw, self.folder, self.file, self.allow, self.key_variable)
        if self._library.is_current():
            new._library = self._library
            if raw.get("map") == self._raw.get("map"):
                new._loaded = self._loaded
        new._named_idle = self._named_idle
        return new

    def columns(self) -> GraphColumns:
        """Return the map as read-only arrays, for looking up nodes; load it if necessary.

        Raises:
            ScenarioError: the map cannot be loaded.
        """
        with name_errors(self.file, self._raw):
            return self._loaded().columns

    def map_snapshot(self) -> MapSnapshot:
        """Return graph and obstacles, to be copied into a context by `ctx.graph.storage.copy_from`.

        Raises:
            ScenarioError: the map cannot be loaded.
        """
        with name_errors(self.file, self._raw):
            return self._loaded()

    def starts(self, seeds: Iterable[int]) -> dict[str, IntArray]:
        """Return the starting nodes of the agents for these seeds, without building a game: name -> (seeds,) ids.

        Raises:
            BadType (TypeError): the seeds are not integers.
            ScenarioError: with one of the seeds, not all agents can be placed.
        """
        chosen = [as_int(seed, "A seed") for seed in as_items(seeds, "seeds", "integers")]
        with name_errors(self.file, self._raw), create_context(logger_config=maps.make_log_settings()) as ctx:
            ctx.graph.storage.copy_from(self._loaded())
            return AgentPlacement(ctx, self.spec, list_members(self.spec)).place(chosen)

    def node_at(self, place: int | str | Sequence[float] | Mapping[str, float] | LatLon | None) -> int:
        """Return the node for `[x, y]`, `{"lat": …, "lon": …}`, a street, or a node id.

        Raises:
            ScenarioError: the node does not exist, or the value is not a place.
        """
        with name_errors(self.file, self._raw), create_context(logger_config=maps.make_log_settings()) as ctx:
            ctx.graph.storage.copy_from(self._loaded())
            return find_node(ctx, place if isinstance(place, LatLon) else convert_plain(place, Place, "place"), "place")

    def code(self) -> list[CodeReference]:
        """Return the code that `build` would import, without running any of it.

        Raises:
            ScenarioError: some code does not exist.
        """
        with name_errors(self.file, self._raw):
            return check_code(self.spec, self._library.sources)

    def warnings(self) -> list[str]:
        """Return likely mistakes: keys of `data` that no code of the game names. No code is run.

        Raises:
            ScenarioError: some code does not exist.
        """
        file = "" if self.file is None else f"{self.file}: "
        unread = find_unread_data(self.spec, self.code())
        return [f"{file}data.{key}: nothing in the code of this game names {shown(key)}." for key in unread]

    def warn_of_idle_teams(self, given: Collection[str] = ()) -> None:
        """Log a warning that lists the teams without a strategy; a team is named once, also by games that run.

        Args:
            given: the teams and agents that the caller gives strategies.

        Raises:
            BadType: `given` is not a collection of names.
        """
        names = [as_text(name, "a name of given") for name in as_items(given, "given", "names")]
        decided = set[str]()
        for name, team in list_members(self.spec).items():
            strategies = [self.spec.teams[name].plan, self.spec.teams[name].strategy]
            strategies += [one.listed.strategy for one in team if one.listed]
            if any(strategies) or not {name, *(one.name for one in team)}.isdisjoint(names):
                decided.add(name)
        warn_of_idle(self.spec.teams, decided, self._named_idle, logging.getLogger("gamms").warning)

    def check(self) -> list[str]:
        """Check everything that needs neither code nor a server; return a list of the checks.

        Raises:
            ScenarioError: a check failed.
        """
        found = self.code()
        agents = list_members(self.spec)
        done = ["keys, types and names", f"{len(found)} references to code (found, not run)"]
        if maps.is_data(self.spec.map):
            with (
                name_errors(self.file, self._raw),
                create_context(seed=self.spec.seed, logger_config=maps.make_log_settings()) as ctx,
            ):
                ctx.graph.storage.copy_from(self._loaded())
                AgentPlacement(ctx, self.spec, agents).place([ctx.seed])
                done += [
                    f"the map ({len(ctx.graph.graph)} nodes)",
                    f"the places of {sum(map(len, agents.values()))} agents",
                ]
        return done

    def describe(self, *, build: bool = False) -> str:
        """Return a description of the game by the ODD protocol, as Markdown; see docs/scenarios.md.

        Args:
            build: also load maps that are made by code or servers, whose code is run then; otherwise no code is run.

        Raises:
            BadType: `build` is not a bool.
            ScenarioError: a part of the scenario cannot be built as it is written.
        """
        from gamms.scenario.describing import OddDocument

        is_built = as_flag(build, "build")
        found = self.code()
        is_loaded = is_built or maps.is_data(self.spec.map)
        map = self.map_snapshot() if is_loaded else None
        starts = self.starts([self.spec.seed]) if is_loaded and self.spec.seed is not None else {}
        with name_errors(self.file, self._raw):
            return OddDocument(self.spec, self._raw, found, self.folder, map, starts).write()

    def differences(self, other: "Scenario") -> list[str]:
        """Return a line for each key whose value differs in another scenario; a default counts like the same value.

        Raises:
            BadType: the other is not a scenario.
        """
        if not isinstance(other, Scenario):
            raise BadType(f"differences needs another Scenario, not {shown(other)}.")
        return [*documents.list_differences(to_plain(self.spec), to_plain(other.spec))]

    def digests(self) -> dict[str, str]:
        """Return the SHA-256 of each part of the game, in hexadecimal; this imports its code and loads the map.

        Games with equal parts differ only by their seeds and strategies. The parts are the keys of a scenario, without
        `name`, `description`, `seed`, and the strategies and plans of teams; `map` covers streets and obstacles.

        Raises:
            ScenarioError: a part cannot be built as it is written.
        """
        if self._digests is None:
            with name_errors(self.file, self._raw):
                self._digests = make_digests(self.spec, self._library, self._loaded())
        return dict(self._digests)

    @explain_call_errors
    def build(
        self,
        seed: int | None = None,
        strategies: Strategies | None = None,
        vis_engine: Engine | None = None,
        *,
        graph_engine: GraphEngine = GraphEngine.MEMORY,
    ) -> Context:
        """Return a context with the game in it, ready to play; the caller terminates it.

        The code that the scenario names is imported now. The map is loaded by the first call only.

        Args:
            seed: all random streams follow from it; None: that of the scenario, or a fresh one.
            strategies: strategies by team or agent, which replace those of the scenario: `state -> None`, or
                `ctx -> strategy`.
            vis_engine: see `create_context`; None: no window.
            graph_engine: see `create_context`.

        Raises:
            ScenarioError: a part of the scenario cannot be built as it is written.
            UnknownName (KeyError): a strategy is for an unknown team or agent.
        """
        return self._build_context(seed, strategies, vis_engine, graph_engine)[0]

    def _make_builder(self, seed: int, strategies: Strategies | None) -> Builder:
        """Return the builder of the same game with another seed."""
        ctx, builder = self._build_context(seed, strategies)
        ctx.terminate()
        return builder

    def _build_context(
        self,
        seed: int | None,
        strategies: Strategies | None,
        vis_engine: Engine | None = None,
        graph_engine: GraphEngine = GraphEngine.MEMORY,
    ) -> tuple[Context, Builder]:
        """Return a context with the game in it, and its builder; see `build`."""
        given = dict(as_mapping({} if strategies is None else strategies, "strategies"))
        by_team = list_members(self.spec)
        known = [*by_team, *(member.name for member in chain.from_iterable(by_team.values()))]
        unknown = next((name for name in given if name not in known), None)
        if unknown is not None:
            raise UnknownName("team or agent", unknown, known)
        with name_errors(self.file, self._raw):
            if not self._loaded.cache_info().currsize:
                self.code()
            map = self._loaded()
        ctx = create_context(
            graph_engine,
            Engine.NO_VIS if vis_engine is None else vis_engine,
            vis_kwargs={"title": self.spec.name} if vis_engine is Engine.PYGAME and self.spec.name else None,
            logger_config=maps.make_log_settings(),
            seed=self.spec.seed if seed is None else seed,
            game={
                **to_plain(self.spec.settings),
                "max_turns": self.spec.max_turns,
                "channels": {name: to_plain(channel) for name, channel in self.spec.channels.items()},
            },
        )
        try:
            with name_errors(self.file, self._raw):
                ctx.graph.storage.copy_from(map)  # with the visibility tables of earlier games
                ctx.game.internals.digests = self.digests
                ctx.game.internals.map_number = self._map_number or 0
                ctx.game.internals.map_spec = documents.copy_plain(self._raw).get("map")
                ctx.game.internals.named_idle = self._named_idle
                builder = Builder(ctx, self.spec, self._library, given)
                builder.build()
                ctx.game.internals.scenario = write_out(self.spec, self._library)
        except BaseException:
            ctx.terminate()
            raise

        def draw_again() -> None:
            with name_errors(self.file, self._raw):
                builder.draw_again()

        ctx.game.internals.draw_start = draw_again
        return ctx, builder

    @explain_call_errors
    def play(
        self,
        seed: int | None = None,
        strategies: Strategies | None = None,
        *,
        record: str | os.PathLike[str] | None = None,
        sensed: bool | None = None,
    ) -> Result:
        """Build the game, play it to its end, and terminate the context; see `build`.

        Args:
            seed: see `build`.
            strategies: see `build`.
            record: the file for a recording, which replaces an existing file; None: do not record.
            sensed: whether the recording contains the sensor reports of agents; see `ctx.record.start`.

        Raises:
            BadValue: `sensed` is True without `record`.
        """
        with self.build(seed, strategies) as ctx:
            return ctx.game.run(record=record, sensed=sensed)

    @explain_call_errors
    def batch(  # noqa: PLR0913 - which games, who decides in them, and how they are played
        self,
        num_games: int | None = None,
        *,
        seed: int = 0,
        seeds: Iterable[int] | None = None,
        strategies: Strategies | None = None,
        record: bool = False,
        one_by_one: bool | None = None,
        vis_engine: Engine | None = None,
        most_agents: MostAgents | None = None,
        maps: Iterable[object] | None = None,
    ) -> Batch:
        """Return many games of this scenario, to be played together; game i equals `play(seed=seeds[i])`.

        The code that the scenario names is imported now, and makes its strategies and rules once for all games, or,
        if the seed changes them, for each. Close the batch, or use it in a `with` statement. See docs/batches.md.

        Args:
            num_games: the number of games.
            seed: the seed of the first game; the others have the next ones.
            seeds: the seed of each game, instead of `num_games` and `seed`.
            strategies: see `build`.
            record: keep the actions that are given to `step`, so that games can be recorded.
            one_by_one: deprecated, and without an effect: `batch.context` needs it no more.
            vis_engine: shows the game of `batch.context(i)` in a window, or films it; see `build`.
            most_agents: the maximum number of agents in each team, or team -> number. Rows are reserved for agents
                that rules create: `red_3`, `red_4`, … if `red` begins with three. Or team -> names of such agents.
            maps: several maps instead of the scenario's, each in the form of the key `map`. The seed of a game
                draws one; `batch.maps` has its number. Game i equals
                `replace(map=maps[batch.maps[i]]).play(seed=seeds[i])`.

        Raises:
            ScenarioError: a part of the scenario cannot be built as it is written.
            BadType, BadValue: there is no game or map, a seed is no integer, or the game has other agents on another
                map.
            TooLarge: the games would not fit into memory; the message says how much they need.
        """
        chosen = as_seeds(num_games, seed, seeds)
        if one_by_one is not None:
            warnings.warn(
                "one_by_one= has no effect any more: leave it out. batch.context(i) shows any game.",
                DeprecationWarning,
                stacklevel=2,
            )
        make = partial(_make_sources, [self] if maps is None else self._copy_to_maps(maps), vis_engine)
        sources = make(chosen, strategies)
        try:
            sources[0].game.internals.parts.rules.check_new()
            return Batch(sources, chosen, record=record, most_agents=most_agents, make_sources=make)
        except BaseException:
            for source in sources:
                source.game.ctx.terminate()
            raise

    def _copy_to_maps(self, maps: Iterable[object]) -> list["Scenario"]:
        """Return the scenario on each of several maps."""
        found = []
        for number, one in enumerate(as_items(maps, "maps", "maps of scenarios")):
            with add_map_number(number):
                found.append(self.replace(map=one))
            found[-1]._map_number = number
        if not found:
            raise BadValue("maps is empty: give at least one map, or None for that of the scenario.")
        return found

    def _make_source(
        self, seeds: Sequence[int], strategies: Strategies | None, vis_engine: Engine | None
    ) -> BatchSource:
        """Return the source of a batch's games on this map."""
        are_drawn = any(team.count or any(one.node is None for one in team.agents) for team in self.spec.teams.values())
        ctx, builder = self._build_context(seeds[0], strategies)
        try:
            some = dict.fromkeys([*seeds[:_AMONG], *range(seeds[0] + 1, seeds[0] + 1 + _PROBES)])  # for later resets
            others = islice(some, 1, 1 + _PROBES)
            varying = builder.list_varying(self._make_builder(one, strategies) for one in others)
            functions = partial(builder.get_functions, varying) if varying else None
            differs = builder.has_other_values(varying)
            place = add_map_number(self._map_number)(builder.place) if are_drawn else None
            build = partial(self.build, strategies=strategies)
            show = open_window = None
            if vis_engine is not None:
                show = partial(build, vis_engine=vis_engine)
                open_window = partial(_open_window, vis_engine=vis_engine)
            edges = builder.list_removed_edges()
            return BatchSource(ctx.game, place, build, show, open_window, functions, differs, edges)
        except BaseException:
            ctx.terminate()
            raise

    def __eq__(self, other: object) -> bool:
        return self._raw == other._raw if isinstance(other, Scenario) else NotImplemented

    __hash__ = None  # type: ignore[assignment] # what holds dicts has no hash

    def __repr__(self) -> str:
        teams = ", ".join(f"{name}: {team.count + len(team.agents)}" for name, team in self.spec.teams.items())
        return f"Scenario({self.spec.name!r}, {teams})"

    def __reduce__(self) -> tuple[Any, ...]:
        # Without the map: each worker of a pool loads it once. Idle teams are named by the process that asks.
        named = {"_named_idle": {*self.spec.teams}}
        return from_plain, (self._raw, self.folder, self.file, self.allow, self.key_variable), named


def _open_window(ctx: Context, vis_engine: Engine) -> None:
    """Show a fork by a visual engine, with the artists of its rules."""
    ctx.visual_engine = vis_engine
    ctx.game.internals.parts.rules.propose_artists()


def _make_sources(
    scenarios: Sequence[Scenario], vis_engine: Engine | None, seeds: Sequence[int], strategies: Strategies | None
) -> list[BatchSource]:
    """Return the sources of a batch's games on each map; `scenarios` are the same on different maps."""
    sources: list[BatchSource] = []
    try:
        for scenario in scenarios:
            with add_map_number(scenario._map_number):
                sources.append(scenario._make_source(seeds, strategies, vis_engine))
    except BaseException:
        for source in sources:
            source.game.ctx.terminate()
        raise
    return sources


def load(path: str | os.PathLike[str], allow: Iterable[str] = (), *, key_variable: str | None = None) -> Scenario:
    """Read a scenario from a YAML or JSON file, and check its shape; this imports and opens nothing that it names.

    Args:
        path: the file; code and maps are in its folder.
        allow: installed packages whose functions it may name, though they have no entry point that says so.
        key_variable: the name of the environment variable with the key of language models that it names.

    Raises:
        ScenarioError: it is not a scenario; the message names the place in the file and the nearest valid key.
        OSError: it cannot be read.
    """
    file = as_path(path, "path")
    with name_errors(file):
        return from_plain(documents.read(file), file.absolute().parent, file, allow, key_variable)


def gallery() -> dict[str, Path]:
    """Return the games that come with GAMMS: name -> scenario file, with the code in its folder."""
    return {file.stem: file for file in sorted(_GALLERY.glob("*.yaml"))}


def from_gallery(name: str) -> Scenario:
    """Return a game that comes with GAMMS; see docs/gallery.md.

    Raises:
        UnknownName (KeyError): the game does not exist.
    """
    games = gallery()
    as_known(name, "game", games)
    return load(games[name], allow=ON_REQUEST)


def from_recording(
    recording: Recording,
    *,
    folder: str | os.PathLike[str] | None = None,
    allow: Iterable[str] = (),
    key_variable: str | None = None,
) -> Scenario:
    """Read the scenario that the game of a recording was built from.

    The recording names code: only GAMMS's own is used unless you allow more.

    Args:
        recording: an open recording; see `gamms.recorder.open`.
        folder: the folder of its code and maps; None: none.
        allow: installed packages whose functions it may name, though they have no entry point that says so.
        key_variable: the name of the environment variable with the key of language models that it names.

    Raises:
        ScenarioError: the recorded game was built by a program, or its scenario is invalid.
    """
    raw = as_recording(recording, "from_recording").header.get("scenario")
    if raw is None:
        raise ScenarioError(
            "", "this recording holds no scenario, for a program built its game: give branch(…) that as build=."
        )
    return from_plain(raw, folder, None, allow, key_variable)


@builders.register("gamms")
def _make_rebuilder(recording: Recording) -> Callable[[], Context]:
    """Return the function that rebuilds the game of a recording, with code of GAMMS alone."""
    return from_recording(recording).build


def from_plain(
    raw: object,
    folder: str | os.PathLike[str] | None = None,
    file: str | os.PathLike[str] | None = None,
    allow: Iterable[str] = (),
    key_variable: str | None = None,
) -> Scenario:
    """Make a scenario from untrusted plain values, which cannot say where code comes from."""
    if not isinstance(raw, Mapping):
        given = "empty" if raw is None else shown(raw)
        raise ScenarioError("", f"a scenario is a mapping with the keys map and teams; this is {given}.")
    for key in raw:
        if key in ("folder", "file", "allow", "key_variable") or not isinstance(key, str):
            raise ScenarioError(str(key), "unknown key.")
    return Scenario(folder=folder, file=file, allow=allow, key_variable=key_variable, **raw)
