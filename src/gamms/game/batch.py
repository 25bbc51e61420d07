"""The public interface of a batch: many games of one scenario, played together."""

import os
from collections import defaultdict
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from functools import partial
from itertools import count
from threading import RLock
from types import MappingProxyType
from typing import Any, Literal, NamedTuple, Self

import numpy as np

from gamms.arguments import (
    as_array,
    as_bool,
    as_choice,
    as_count,
    as_ids,
    as_int,
    as_key,
    as_mapping,
    as_path,
    explain_call_errors,
)
from gamms.compat import Surface
from gamms.errors import BadValue, UnknownName
from gamms.game.array_functions.given import ActionLog, OutsideActions, OutsideActor, as_given
from gamms.game.array_functions.view import ArrayView, LearnerWriter
from gamms.game.batch_engine import BatchEngine, make_core_movement
from gamms.game.block.columns import (
    BYTES_PER_AGENT,
    BYTES_PER_NAME,
    BYTES_PER_PLAYER,
    AgentTable,
    PlayedGame,
    draw_maps,
    find_decider,
    make_roster,
)
from gamms.game.block.state import Columns, GameArrays
from gamms.game.hidden_state import is_drawing_globally, refuse_changes
from gamms.game.plan import find_first_called
from gamms.game.random_streams import get_global_state, seed_for_run
from gamms.game.result import MANY_TURNS, Result, warn_of_no_end
from gamms.game.rows.by_seed import GamesBySeed, MakeFunctions
from gamms.game.rows.shown_games import ShownGames
from gamms.game.strategy_specs import PoolSpec, list_pools, name_strategy
from gamms.ir.graph import ClosedEdges, FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.limits import max_memory, refuse_above
from gamms.plain import MOST_WHOLE
from gamms.progress import TurnInterrupted, delay_interrupts
from gamms.progress import show_progress as progress_line
from gamms.readonly import Immutable, NotPickled, copy_locked
from gamms.text import shown

MostAgents = int | Mapping[Any, int | Sequence[str]]
"""The largest number of agents of a team, for every team or by team; or by team, the names of agents to reserve."""


class BatchSource(NamedTuple):
    """The source of the games of a batch on one map.

    Attributes:
        game: the game at its start, in a context that belongs to the batch.
        starts: returns the ids of the start nodes for several seeds, agent name -> (seeds,); None: the start nodes do
            not depend on the seed.
        build: makes a context with the game of a seed; None: the batch was not made from a scenario.
        show: makes a context with the game of a seed and with a window; None: games are shown without one.
        open_window: opens a window for a context with one of these games; None: as above.
        functions: makes the strategies, plans and functions of sensors that depend on the seed; None: none do.
        differs: whether rules, facts, data or attributes of agents depend on the seed, too.
        more_edges: edges that are not on the map of the game, but may be for other seeds.
    """

    game: PlayedGame
    starts: Callable[[Sequence[int]], Mapping[str, IntArray]] | None
    build: Callable[[int], Any] | None
    show: Callable[[int], Any] | None
    open_window: Callable[[Any], object] | None
    functions: MakeFunctions | None = None
    differs: bool = False
    more_edges: ClosedEdges = MappingProxyType({})


MakeSources = Callable[[Sequence[int], Mapping[str, Any]], list[BatchSource]]
"""Returns the sources on all maps for the seeds of games, with strategies by team or agent."""


class _SingleGame(NamedTuple):
    """A game of the batch in a separate context."""

    number: int
    game: PlayedGame


class Batch(Surface, Immutable, NotPickled):
    """Many games of one scenario, each with its own seed: `scenario.batch(1000)`, `ctx.game.batch(1000)`.

    Game i equals the game that `scenario.play(seed=seeds[i])` plays. The core plays the games, and calls plain
    functions and array functions between its phases. A game in which a plain function does what the core cannot do, for
    example changes a setting, continues in a context of its own. A batch is a context manager.

    Attributes:
        seeds: (games,) the seed of each game.
        maps: (games,) the number of each game's map, drawn from its seed; 0 if there is one map.
        is_closed: whether `close` was called; results remain available.
    """

    seeds: Sequence[int]
    maps: IntArray
    is_closed: bool
    _called = "batch"
    _items = " batch.result(0) is the result of its first game, and batch.table() has a row for each game."
    _way_out = "settings are those of the scenario, or of ctx.game, when it is made; reset(seeds=…) begins other games."
    _not_pickled = (
        "A batch can neither be pickled nor copied, because it plays in a context. Pickle its scenario and make a "
        "batch of it in the other process; columns() and load(…) of batches copy games in arrays."
    )

    def __init__(
        self,
        sources: Sequence[BatchSource],
        seeds: Sequence[int],
        *,
        record: bool,
        most_agents: MostAgents | None,
        make_sources: MakeSources | None = None,
    ) -> None:
        self._num_maps = len(sources)
        self._sources = list(sources)  # for all maps; after `change_strategies`, further ones with other strategies
        self._make_sources = make_sources
        self._most_agents = most_agents
        self._rosters = [make_roster(source.game, most_agents) for source in sources]
        self._roster = self._rosters[0]
        for number, roster in enumerate(self._rosters):
            _refuse_other_agents(roster, self._roster, number)
        self._put_public(seeds=seeds)
        self._refuse_too_many()
        maps = copy_locked(draw_maps(seeds, len(sources)))
        self._put_public(seeds=tuple(seeds), maps=maps, is_closed=False)
        self._source_of = maps.copy()  # (games,) the number of the source of each game
        # Before agents move in those contexts:
        self._first_nodes = [
            roster.list_start_nodes(source.game) for source, roster in zip(sources, self._rosters, strict=True)
        ]
        self._own = [self._make_functions(source) for source in sources]
        self._deciders: dict[int, dict[Hashable, PoolSpec | str]] = {}  # by source; see `_name_deciders`
        self._engine = self._make_engine()
        self._shown_games = ShownGames(self._engine)
        self._actions = ActionLog(len(seeds), is_kept=as_bool(record, "record"))
        self._is_loaded = np.zeros(len(seeds), np.bool_)
        self._steps = 0
        self._ran_from: IntArray | None = None  # (games,) the turns played before the current run; None: none runs
        self._warns_of_no_end = False  # whether the current run may never end, which has not been said yet
        self._first_turn = sources[0].game.turn  # the number of turns played before the batch
        self._shown: _SingleGame | None = None  # the game in the context that `context` returned
        self._window: _SingleGame | None = None  # the game that began in a window, with the number of its source
        self._alone: _SingleGame | None = None  # the game that is playing now
        self._lock = RLock()  # of the thread that plays

    def _make_engine(self) -> BatchEngine:
        """Return the engine that plays the games in the core.

        Raises:
            TooLarge: the games do not fit into memory.
            BadValue, UnknownName: a game that has begun refers to a node or edge that the map no longer has.
        """
        self._take_functions(np.arange(len(self)))
        games = [source.game for source in self._sources]
        each = zip(games, self._rosters, self._own, strict=True)
        movements = [make_core_movement(game, roster, own.more_edges) for game, roster, own in each]
        begin = self._draw_starts(self.seeds, self.maps)
        played = games, movements, self.seeds, self._source_of, begin
        return BatchEngine(*played, self._rosters, self._own, self._num_maps)

    def _change_strategies(self, strategies: Mapping[str, Any]) -> None:
        """Let games play other strategies from their next start on; see `change_strategies`."""
        self._refuse_closed()
        if self._make_sources is None:
            raise BadValue("Only a batch of a scenario can change its strategies: scenario.batch(…).")
        with self._lock_for_playing():
            sources = self._make_sources(self.seeds, strategies)
            try:
                self._put_sources(sources)
            except BaseException:
                for source in sources:
                    source.game.ctx.terminate()
                raise

    def _put_sources(self, sources: Sequence[BatchSource]) -> None:
        """Begin games from other sources from now on, which replace sources that no game plays any more."""
        sources[0].game.internals.parts.rules.check_new()
        rosters = [make_roster(source.game, self._most_agents) for source in sources]
        for number, roster in enumerate(rosters):
            _refuse_other_agents(roster, self._roster, number)
        own = [self._make_functions(source) for source in sources]
        for one in own:
            if one.is_needed:
                one.take(np.array([0]), [self.seeds[0]])  # an example, which says how they are called
                one.install()
        games = [source.game for source in sources]
        each = zip(games, rosters, own, strict=True)
        movements = [make_core_movement(game, roster, of_map.more_edges) for game, roster, of_map in each]
        used = {number // self._num_maps for number in self._engine.maps_in_use}
        free = (one for one in count(1) if one not in used)  # the first sources tell of the agents of all games
        first = next(free) * self._num_maps
        self._engine.put_maps(first, games, movements, rosters, own)
        those = slice(first, first + self._num_maps)
        for source in self._sources[those]:
            source.game.ctx.terminate()
        for number in range(first, first + self._num_maps):
            self._deciders.pop(number, None)
            if self._window is not None and self._window.number == number:
                self._close_window()
        self._sources[those] = sources
        self._rosters[those] = rosters
        self._own[those] = own

    def _make_functions(self, source: BatchSource) -> GamesBySeed:
        seed = self.seeds[0]
        return GamesBySeed(source.game, source.functions, seed, source.more_edges, differs=source.differs)

    def _take_functions(self, games: IntArray) -> None:
        """Make and install the strategies and plans of games, if they depend on the seed."""
        for number, own in enumerate(self._own):
            if own.is_needed:
                on_map = games[self._source_of[games] == number]
                own.take(on_map, [self.seeds[game] for game in on_map.tolist()])
                own.install()

    def __len__(self) -> int:
        return len(self.seeds)

    def __repr__(self) -> str:
        return f"Batch({len(self)} games, {int(self._engine.is_over.sum())} over)"

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the contexts of the batch."""
        self._put_public(is_closed=True)
        self._hide()
        self._engine.close()
        self._close_window()
        for source in self._sources:
            source.game.ctx.terminate()

    def _refuse_closed(self) -> None:
        if self.is_closed:
            raise BadValue("This batch is closed: make another one with scenario.batch(…) or ctx.game.batch(…).")

    # -- playing ------------------------------------------------------------------------------------------------

    def step(
        self,
        actions: Mapping[Hashable, Any] | None = None,
        *,
        on_illegal: Literal["raise", "stay"] = "raise",
        threads: int = 1,
    ) -> BoolArray:
        """Play one turn of all games that are not over; return a mask of the games that continue, (games,).

        Ctrl-C takes effect after the turn or, in a turn that takes long, between two functions or games; then the turn
        is taken back in all games.

        Args:
            actions: team -> integers, (games, agents of the team, ordered by name): the index in `state["legal"]` of
                the node that each agent moves to, 0 to stay. Teams without actions play their own strategies. Actions
                of dead agents and of finished games are ignored. Instead of integers, a dict with the optional keys
                `"moves"`: the integers, otherwise all stay; `"edges"`: ids of `view["legal_edges"]` that agents take
                instead, (games, agents), or -1; `"flights"`: the offsets of flying agents, (games, agents,
                3), map units, otherwise they hover; `"deeds"`: deed -> (where, fields), or `where` alone, a mask
                (games, agents); and `"messages"`: channel -> (where, body) or (where, body, to). Fields, bodies and
                `to` are as in `view.do` and `view.send`: one value for all, or arrays (games, agents).
            on_illegal: "raise": refuse illegal actions; "stay": agents with an illegal action stay, for example after a
                rule has made nodes illegal that `observe` listed.
            threads: the number of threads that play; see `run`.

        Raises:
            UnknownName (KeyError): no agent plays for a team, or a deed or channel does not exist.
            BadType, BadValue: actions have a wrong type or shape, or are illegal. No game has played and no rule was
                called, unless a rule of the phase "before", or of the phase "deeds" in an earlier part of the order of
                play, made an action illegal; then these rules were called, and other actions may be passed.
        """
        self._refuse_closed()
        wanted = dict(as_mapping({} if actions is None else actions, "actions"))
        may_stay = as_choice(on_illegal, "on_illegal", ("raise", "stay")) == "stay"
        given = {team: self._as_given(team, value)._replace(may_stay=may_stay) for team, value in wanted.items()}
        self._step(given, min(as_count(threads, "threads"), len(self)))
        return ~self._engine.is_over

    def _step(
        self,
        given: Mapping[Hashable, OutsideActions],
        threads: int,
        *,
        writer: LearnerWriter | None = None,
    ) -> None:
        """Play one turn; `writer` is for turns that the core plays at once, see `BatchEngine.play`."""
        try:
            with self._lock_for_playing():
                is_played = False
                while not is_played:  # Ctrl-C may do something else than to raise an error
                    if can_play_in_one_call(self, given):
                        is_played = self._try_play(1, threads, given, writer=writer)
                    else:
                        is_played = self._try_step(given, threads)
        finally:
            self._follow(given)  # a rule may have raised after all agents moved

    def _interrupt(self) -> None:
        """Stop the turns under way, if they take long; see `BatchEngine.interrupt`."""
        self._engine.interrupt()

    def _try_step(self, given: Mapping[Hashable, OutsideActions], threads: int) -> bool:
        """Play one turn; return whether it was played, and not interrupted and taken back."""
        before = self._engine.count_turns()
        is_played = False
        with delay_interrupts(at_most_once=True, on_interrupt=self._interrupt):
            try:
                with self._check_hidden_state():
                    self._shown_games.observe(self._engine.own if given else ())
                    self._engine.step(given, threads)
                is_played = True
            except TurnInterrupted:
                return False
            finally:
                if is_played or (self._engine.count_turns() > before).any():  # a rule may raise after all agents moved
                    self._note(before, given)
        return True

    def _is_at_start(self, number: int) -> bool:
        """Return whether a game has not begun to play."""
        is_over = self._engine.is_over[number] or self._is_loaded[number]
        return bool(self._engine.count_turns()[number] == self._first_turn and not is_over)

    @contextmanager
    def _lock_for_playing(self) -> Iterator[None]:
        """Hold the lock of the batch; refuse to play while another thread plays."""
        if not self._lock.acquire(blocking=False):
            raise BadValue(
                "Another thread plays this batch right now. Make a batch for each thread, or use run(threads=…)."
            )
        try:
            yield
        finally:
            self._lock.release()

    def _note(self, turns: IntArray, given: Mapping[Hashable, OutsideActions]) -> None:
        """Note the actions that games got in a turn, which had played `turns`, (games,)."""
        self._actions.note(turns, given)
        self._steps += 1

    def _as_given(self, team: Hashable, value: object) -> OutsideActions:
        """Return the checked actions of a team; copies if they are kept."""
        members = self._roster.members(team)
        given = as_given(value, team, (len(self), len(members)), is_copied=self._actions.is_kept)
        if given.flights is not None and not self._roster.flies[members].any():
            raise BadValue(f"team {shown(team)} was given flights, and none of its agents flies.")
        return given

    def _check_hidden_state(self) -> AbstractContextManager[None]:
        """Refuse functions that change hidden state; the check runs after 0, 1, 2, 4, 8, … steps."""
        is_due = not (self._steps & (self._steps - 1) or self._engine.only is not None)
        return self._watch_hidden_state() if is_due else nullcontext()

    def _watch_hidden_state(self) -> AbstractContextManager[None]:
        return refuse_changes(
            self._engine.functions,
            "Keep it in view.keep(key, make) or turn.keep(key, make), else in state['memory'] or ctx.game.data.",
        )

    @explain_call_errors
    def run(self, max_turns: int | None = None, progress: bool = False, *, warn: bool = True, threads: int = 1) -> None:
        """Play all games to their ends, or for a number of turns, after which `run` and `step` continue them.

        Args:
            max_turns: the largest number of turns that each game plays now; None: until the total of the settings is
                reached, which ends a game in any case.
            progress: whether to show the progress on a line of stderr, if it is a terminal.
            warn: whether to log once the teams without a strategy, and the agents that cannot move.
            threads: the number of threads, if the core plays all parts; the results do not depend on it. Other games
                use one thread.

        Raises:
            BadType, BadValue: `progress` or `warn` is not a boolean, `threads` is less than 1, `max_turns` is negative,
                the games have neither a rule nor `max_turns` to end them, or another thread is playing them.
        """
        self._refuse_closed()
        turns = None if max_turns is None else as_count(max_turns, "max_turns", 0)
        num_threads = min(as_count(threads, "threads"), len(self))
        is_shown = as_bool(progress, "progress")
        game = self.game
        if turns is None and game.settings()["max_turns"] is None and not game.rules:
            raise BadValue("These games have no rule that could end them: give run(max_turns=…) or add a rule.")
        if as_bool(warn, "warn"):
            game.internals.warn_of_idle_teams()
            self._warn_of_stuck_agents()
        with self._lock_for_playing(), progress_line() as line:
            show = line if is_shown else None
            began = self._engine.count_turns()
            self._ran_from = began
            self._engine.stop_after(turns)
            limits = [turns, game.settings()["max_turns"], *(rule.spec.last_turn for rule in game.rules)]
            self._warns_of_no_end = not any(isinstance(limit, int) for limit in limits)
            try:
                self._run_games(num_threads, show)
            finally:
                self._ran_from = None
        self._follow({})

    def _run_games(self, threads: int, show: Callable[[str], object] | None) -> None:
        """Play games until they are over or `stop_at`, in chunks of turns, between which Ctrl-C works.

        Games in which functions draw from the global generators are played one after the other.
        """
        if self._engine.calls_each and is_drawing_globally(self._engine.functions):
            with self._watch_hidden_state():
                for number in np.flatnonzero(self._engine.playing).tolist():
                    with self._engine.play_only(number):
                        self._run_together(threads, show, None)
        else:
            self._run_together(threads, show, get_global_state() if self._engine.calls_each else None)

    def _run_together(self, threads: int, show: Callable[[str], object] | None, before: object) -> None:
        """Play games turn by turn; `before`: the state of the global generators, None: functions may draw from them."""
        plays_by_phases = self._engine.plays_by_phases
        steps = 0
        while (left := self._engine.count_turns_left()) > 0:
            if plays_by_phases:
                self.step()
                steps += 1
                if not steps & (steps - 1):  # after 1, 2, 4, 8, … steps
                    _refuse_global_draws(before)
            else:
                self._try_play(min(left, MANY_TURNS), threads)
            if self._warns_of_no_end and self._count_turns_of_run() >= MANY_TURNS:
                self._warns_of_no_end = False
                warn_of_no_end(self.game.ctx.logger)
            if show is not None:
                self._show_progress(show)
        _refuse_global_draws(before)

    def _try_play(
        self,
        most: int,
        threads: int,
        given: Mapping[Hashable, OutsideActions] | None = None,
        *,
        writer: LearnerWriter | None = None,
    ) -> bool:
        """Play some turns in the core, at most `most`; return whether any was played.

        None is played if Ctrl-C was pressed in a long turn. See `BatchEngine.play` for `given` and `writer`.
        """
        with delay_interrupts(at_most_once=True, on_interrupt=self._interrupt), suppress(TurnInterrupted):
            before = self._engine.count_turns()
            played = self._engine.play(most, threads, given, writer)
            if given is None:
                self._steps += played
            else:
                self._note(before, given)
            if writer is not None and len(writer.begun):
                starts = self._engine.starts
                rows = starts.now[writer.begun]
                first = self._engine.newest.start
                self._put_seeds(writer.begun, starts.get_seeds(rows), starts.streets[rows], first)
                self._note_begun(writer.begun)
            return True
        return False

    def _count_turns_of_run(self) -> int:
        """Return how many turns the games that are played in the current run have played in it."""
        before = 0 if self._ran_from is None else self._ran_from
        played: IntArray = (self._engine.count_turns() - before)[self._engine.playing]
        return int(played.max(initial=0))

    def _show_progress(self, show: Callable[[str], object]) -> None:
        over = int(self._engine.is_over.sum())
        show(f"{over} of {len(self)} games over, turn {int(self._engine.count_turns().max())}")

    def _warn_of_stuck_agents(self) -> None:
        """Log a warning with agents that cannot move from where they begin in some game."""
        for number in self._engine.maps_in_use:
            state = self._engine.maps[number].state
            games = np.flatnonzero((self._source_of == number) & (state.turn == self._first_turn))
            if not len(games):
                continue
            seeds = [self.seeds[game] for game in games.tolist()]
            nodes = state.streets.ids(state.node[games]).T.tolist()
            each = zip(state.roster.names, nodes, strict=True)
            seeds_at = {name: dict(zip(starts, seeds, strict=True)) for name, starts in each}
            self._sources[number].game.internals.warn_of_stuck_agents(seeds_at)

    def reset(self, which: Any = None, *, seeds: Iterable[int] | None = None) -> None:
        """Reset games to their start; with several maps, games with new seeds draw their maps again.

        Args:
            which: the numbers of games, or a mask (games,); None: all games.
            seeds: one seed for each of these games; None: keep their seeds.

        Raises:
            BadType, BadValue: a game does not exist or occurs twice, or `which` or `seeds` has a wrong length.
        """
        self._refuse_closed()
        numbers = self._check_game_numbers(which)
        given = [self.seeds[game] for game in numbers.tolist()] if seeds is None else as_ids(seeds, "seeds")
        if len(given) != len(numbers):
            raise BadValue(f"reset got {len(given)} seeds for {len(numbers)} games: give one for each.")
        if len(numbers):
            self._reset(numbers, given, self._engine.newest.start)

    def _reset(self, numbers: IntArray, given: Sequence[int], first: int | IntArray) -> None:
        """Reset games with these seeds; `first`: the number of each one's source on the first map."""
        if self._shown is not None and self._shown.number in numbers:
            self._hide()
        starts = self._engine.starts
        if starts.get_seeds(starts.now[numbers]) == [*given]:
            starts.next[numbers] = starts.now[numbers]
        else:
            self._prepare(starts.next[numbers], given)
        seeds = self.seeds
        maps = self.maps
        sources = self._source_of.copy()
        self._put_seeds(numbers, given, starts.streets[starts.next[numbers]], first)
        try:
            self._take_functions(numbers)
        except BaseException:
            self._source_of[:] = sources
            self._put_public(seeds=seeds, maps=maps)
            raise
        self._engine.start(numbers, first)
        self._note_begun(numbers)

    def _prepare(self, rows: IntArray, seeds: Sequence[int]) -> None:
        """Draw what games have by these seeds when they begin, unless their rows have these seeds; see `NextStarts`."""
        drawn = self._engine.starts.get_seeds(rows)
        places = [place for place, seed in enumerate(seeds) if seed != drawn[place]]
        if places:
            new = [seeds[place] for place in places]
            maps = draw_maps(new, self._num_maps)
            self._engine.starts.prepare(rows[places], new, maps, self._draw_starts(new, maps))

    def _put_seeds(self, games: IntArray, given: Sequence[int], of_games: IntArray, first: int | IntArray) -> None:
        """Set the seeds, maps and sources of games that begin; `first`: see `_reset`."""
        seeds = list(self.seeds)
        for game, seed in zip(games.tolist(), given, strict=True):
            seeds[game] = seed
        maps = self.maps.copy()
        maps[games] = of_games
        self._put_public(seeds=tuple(seeds), maps=copy_locked(maps))
        self._source_of[games] = first + of_games

    def _note_begun(self, games: IntArray) -> None:
        """Note that games have begun: forget the actions that were given to them before."""
        self._shown_games.forget(games.tolist())
        self._actions.forget(games)
        self._is_loaded[games] = False

    def columns(self) -> Columns:
        """Return the state of all games as arrays, key -> (games, …), for `load`.

        The arrays hold the positions of agents and the memory of rules and strategies; turn, scores and seeds are not
        included. Rows can be selected, repeated and concatenated.

        Raises:
            BadValue: the core does not play all parts of the games, or they have several maps.
        """
        return self._get_arrays("columns").copy_columns()

    def load(self, columns: Columns, turn: int, scores: Mapping[Hashable, FloatArray | float] | None = None) -> None:
        """Set the state of all games from `columns`; games keep their seeds.

        Args:
            columns: the arrays of `columns()` of a batch of the same scenario, with one row for each game.
            turn: the number of turns played.
            scores: key -> (games,) numbers; None: no scores.

        Raises:
            BadType, BadValue: the core does not play all parts of the games, they have several maps, or the columns do
                not fit these games.
        """
        as_mapping(columns, "columns")
        for key, points in as_mapping({} if scores is None else scores, "scores").items():
            numbers = as_array(points, f"Scores of {shown(key)}", "numbers")
            if numbers.shape not in {(), (len(self),)} or np.isnan(numbers).any():
                raise BadValue(f"Scores of {shown(key)} are numbers of {len(self)} games, not {shown(points)}.")
        played = as_count(turn, "turn", least=0)
        if played > MOST_WHOLE:
            raise BadValue(f"turn must be at most {MOST_WHOLE}, not {shown(turn)}.")
        self._get_arrays("load").refuse_others(columns)
        self._load(columns, played, scores or {})

    def _load(
        self,
        columns: Columns,
        turn: int,
        scores: Mapping[Hashable, FloatArray | float],
        games: slice = slice(None),
    ) -> None:
        """Set the state of games from checked columns; see `GameArrays.load`."""
        self._get_arrays("load").load(columns, turn, scores, games)
        self._hide()
        self._is_loaded[:] = True

    def _get_arrays(self, what: str) -> GameArrays:
        if self._engine.maps[0].plan.drives.any():
            raise BadValue(
                f"{what} needs games that the core plays; by metres it does not know turn restrictions, and agents "
                "obey them."
            )
        if self._engine.calls_each:
            why = str(find_first_called(self.game, self._roster)).removesuffix(".")
            raise BadValue(f"{what} needs games that the core plays completely; it does not, because of {why}.")
        if self._num_maps > 1:
            raise BadValue(
                f"{what} is for games on one map, whose nodes its columns number; these are on {self._num_maps}: "
                "make a batch for each map."
            )
        return self._engine.maps[0].state

    # -- seeing -------------------------------------------------------------------------------------------------

    def observe(self, team: Hashable, *, map: int | None = None) -> ArrayView:
        """Return a view of the agents of a team in all games: positions, legal nodes and observations as arrays.

        Args:
            team: the team.
            map: the number of a map, required if there are several: the view contains the games that are on this map
                now, possibly none; its `games` are their numbers.

        Raises:
            UnknownName (KeyError): no agent plays for the team.
            BadValue: the map does not exist, or is missing although there are several; or some games on it play other
                strategies than others, see `gamms.rl.Learners.set_others`.
        """
        return self._make_view(self._roster.members(team), map)

    def observe_agent(self, name: str, *, map: int | None = None) -> ArrayView:
        """Return a view of one agent in all games; see `observe`.

        Raises:
            UnknownName (KeyError): the agent does not exist.
            BadValue: see `observe`.
        """
        if as_key(name, "The name of an agent") not in self._roster.names:
            raise UnknownName("agent", name, self._roster.names)
        return self._make_view(np.array([self._roster.names.index(name)]), map)

    def _make_view(self, agents: IntArray, map: int | None) -> ArrayView:
        num_maps = self._num_maps
        if map is None and num_maps > 1:
            raise BadValue(
                f"These games are on {num_maps} maps, and a view has one: give map=k, from 0 to {num_maps - 1}, for "
                "the games of which batch.maps is k."
            )
        number = 0 if map is None else as_int(map, "map")
        if not 0 <= number < num_maps:
            raise BadValue(f"There is no map {number}: the batch has {num_maps}, numbered from 0.")
        sources = [one for one in self._engine.maps_in_use if one % num_maps == number]
        if len(sources) > 1:
            raise BadValue(
                "Some of these games still play the strategies from before set_others, and a view is of games with the "
                "same ones: reset all games first."
            )
        return self._make_source_view(agents, *(sources or [self._engine.newest[number]]))

    def _make_source_view(self, agents: IntArray, number: int) -> ArrayView:
        self._shown_games.observe([game for game in self._engine.own if self._source_of[game] == number])
        return self._engine.make_view(agents, number)

    @property
    def game(self) -> PlayedGame:
        """The game that the batch was made from, with its agents, rules and settings.

        With several maps, it is the game on the first map, or on the map of the game whose strategies are being called.
        """
        if self._alone is not None:
            return self._alone.game
        return self._sources[self._engine.current].game

    @property
    def num_maps(self) -> int:
        """The number of maps."""
        return self._num_maps

    @property
    def teams(self) -> tuple[Hashable, ...]:
        """The teams that agents play for."""
        return self._roster.public_teams

    @property
    def roster(self) -> AgentTable:
        """The agents of all games; rules may add some."""
        return self._roster

    @property
    def turn(self) -> IntArray:
        """The number of turns played, (games,)."""
        return self._engine.count_turns()

    @property
    def scores(self) -> dict[Any, Any]:
        """The scores, key -> float64 (games,); a score that no game has set is 0."""
        return defaultdict(
            partial(np.zeros, len(self)),
            {key: points.copy() for key, points in self._engine.maps[0].state.scores.items()},
        )

    @property
    def is_over(self) -> BoolArray:
        """Whether each game has ended, (games,)."""
        return self._engine.is_over

    @property
    def terminated(self) -> BoolArray:
        """Whether each game has ended for a reason other than its time limit, (games,)."""
        return self._engine.is_over & ~self.truncated

    @property
    def truncated(self) -> BoolArray:
        """Whether each game has ended because of its time limit, (games,)."""
        late = np.zeros(len(self), np.bool_)
        for game in np.flatnonzero(self._engine.is_over).tolist():
            over = self._engine.describe_end(game)
            late[game] = over is not None and over["truncated"]
        return late

    @explain_call_errors
    def result(self, game: int) -> Result:
        """Return the result of a game so far; timings are 0 if the core plays it."""
        number = self._as_game(game)
        return self._engine.get_result(number)

    @property
    def detached(self) -> dict[int, str]:
        """Always empty: whatever functions do, games stay in their batch."""
        return {}

    def table(self) -> dict[str, Any]:
        """Return columns with one row for each game: seed, turns, reason, winner, truncated, and `score.<key>`.

        With several maps, the column `map` is the number of each game's map. For a team that plays a pool,
        `opponent.<team>` is the name of the member that it has drawn.
        """
        overs = [self._engine.describe_end(game) or {} for game in range(len(self))]
        columns: dict[str, Any] = {"seed": np.array(self.seeds), "turns": self._engine.count_turns()}
        if self._num_maps > 1:
            columns["map"] = self.maps.copy()
        columns["reason"] = np.array([over.get("reason", "unfinished") for over in overs], object)
        columns["winner"] = np.array([over.get("winner") for over in overs], object)
        columns["truncated"] = np.array([over.get("truncated", True) for over in overs])
        for team in find_pools(self):
            columns[f"opponent.{team}"] = find_opponent_names(self, team, np.arange(len(self)))
        return columns | {f"score.{key}": points for key, points in sorted(self.scores.items(), key=str)}

    @explain_call_errors
    def record(self, game: int, path: str | os.PathLike[str]) -> None:
        """Write a recording of the turns of a game played so far, as `scenario.play(seed=…, record=path)` does.

        The scenario is played for it, with the actions that were passed to `step`. An existing file is overwritten.

        Raises:
            BadValue: actions were passed to `step` without `record=True`, the game was loaded and not reset since, or
                the batch was not made from a scenario.
        """
        number = self._as_game(game)
        file = as_path(path, "path")
        build = self._sources[self._source_of[number]].build
        if build is None:
            raise BadValue("Only a batch of a scenario can be recorded: scenario.batch(…), not ctx.game.batch(…).")
        if self._is_loaded[number]:
            raise BadValue(f"Game {number} was loaded, and its turns before are unknown: begin it with reset first.")
        given = self._actions.list_actions(number)
        with build(self.seeds[number]) as ctx:
            ctx.record.start(file, overwrite=True)
            self._play_to_now(ctx.game, number, given)

    def _play_to_now(
        self, game: PlayedGame, number: int, given: Mapping[int, Mapping[Hashable, OutsideActions]]
    ) -> None:
        """Play a game in a separate context up to its turn in the batch, and the rules that end it before its moves.

        Args:
            game: the game.
            number: its number.
            given: the number of turns played before -> the actions from outside, team by team.
        """
        turns = int(self._engine.count_turns()[number])
        game.internals.state.last_turn = self._engine.maps[0].state.run_until(number)
        is_ended = bool(self._engine.is_over[number]) and turns != self.game.settings()["max_turns"]
        acting = OutsideActor(game, self._roster)
        try:
            with self._play_separately(number, game), seed_for_run(game.ctx, game.turn):
                for turn in range(game.turn, turns):
                    acting.take(given.get(turn, {}), number)
                    _step_again(game)
                if is_ended and game.over is None:
                    game.step()
        finally:
            acting.end()

    @contextmanager
    def _play_separately(self, number: int, game: PlayedGame) -> Iterator[None]:
        """Let a game play in a separate context."""
        before = self._alone
        self._alone = _SingleGame(number, game)
        shown_as = game.internals.shown_as
        game.internals.shown_as = None
        try:
            yield
        finally:
            self._alone = before
            game.internals.shown_as = shown_as

    @explain_call_errors
    def context(self, game: int) -> Any:
        """Return a context that shows a game; it is updated after each turn.

        It begins as a copy of the game as it is now, and plays each later turn as the batch does, which takes as long
        as a turn of the game alone; its own `step` and `run` are refused. It is terminated when another game is shown,
        and when the game is reset; with `vis_engine=`, it has a window.

        Raises:
            BadValue: another thread plays the batch.
        """
        number = self._as_game(game)
        with self._lock_for_playing():
            if self._shown is None or self._shown.number != number or self._shown.game.ctx.is_terminated():
                self._hide()
                self._shown = _SingleGame(number, self._show(number))
            ctx = self._shown.game.ctx
            ctx.game.internals.shown_as = number
            return ctx

    def _show(self, number: int) -> PlayedGame:
        """Return a game as it is now, in a context of its own, which may have a window."""
        source = self._sources[self._source_of[number]]
        if source.show is not None and self._is_at_start(number):
            return self._begin_in_window(source.show, number)
        self._close_window()
        game = self._engine.fork(number)
        if source.open_window is not None:
            source.open_window(game.ctx)
        return game

    def _begin_in_window(self, show: Callable[[int], Any], number: int) -> PlayedGame:
        """Return a game at its start, in the window of games that began before, or in a new one."""
        seed = self.seeds[number]
        source = int(self._source_of[number])
        if self._window is not None and self._window.number == source and not self._window.game.ctx.is_terminated():
            self._window.game.reset(seed=seed)
        else:
            self._close_window()
            self._window = _SingleGame(source, show(seed).game)
        return self._window.game

    def _close_window(self) -> None:
        if self._window is not None:
            self._window.game.ctx.terminate()
            self._window = None

    def _follow(self, given: Mapping[Hashable, OutsideActions]) -> None:
        """Advance the separate context to the current turn of its game, with the actions of this turn."""
        shown = self._shown
        if shown is not None and not shown.game.ctx.is_terminated():
            self._play_to_now(shown.game, shown.number, {shown.game.turn: given})

    def _hide(self) -> None:
        """Terminate the separate context that shows a game; the window in which it began stays for the next game."""
        if self._shown is not None and (self._window is None or self._shown.game is not self._window.game):
            self._shown.game.ctx.terminate()
        self._shown = None

    @property
    def is_in_arrays(self) -> bool:
        """Whether the core plays all games, except for functions."""
        return not self._engine.own

    @property
    def loaded(self) -> int | None:
        """The number of the game whose strategies are being called; None: no strategy is."""
        if self._alone is not None:
            return self._alone.number
        return self._engine.loaded

    # -- inside -------------------------------------------------------------------------------------------------

    def _name_deciders(self, number: int) -> dict[Hashable, PoolSpec | str]:
        """Return for each team the pool that it plays in the games of a source, or the name of its strategy."""
        found = self._deciders.get(number)
        if found is None:
            plans = self._sources[number].game.settings()["plans"]
            pairs = [(agent.team, find_decider(agent, plans)) for agent in self._rosters[number].agents]
            names = {
                team: dict.fromkeys(name_strategy(one) for mate, one in pairs if mate == team) for team, _ in pairs
            }
            found = {team: ", ".join(several) for team, several in names.items()} | list_pools(pairs)
            self._deciders[number] = found
        return found

    def _refuse_too_many(self) -> None:
        """Refuse more games than fit into memory."""
        games = len(self)
        agents = len(self._roster.names)
        players = int(self._roster.is_first.sum())
        of_all = (players * BYTES_PER_PLAYER + (agents - players) * BYTES_PER_NAME) * len(self._sources)
        of_game = agents * BYTES_PER_AGENT
        fitting = max(0, int((max_memory() - of_all) // max(1, of_game)))
        what = f"A batch of {games} games with {agents} agents each, of which {fitting} would fit,"
        refuse_above(of_all + games * of_game, what)

    def _as_game(self, number: int) -> int:
        game = as_int(number, "The number of a game")
        if not 0 <= game < len(self):
            raise BadValue(f"There is no game {game}: the batch has {len(self)}, numbered from 0.")
        return game

    def _check_game_numbers(self, which: object) -> IntArray:
        """Return game numbers from a list of numbers or a mask (games,); None: all games."""
        if which is None:
            return np.arange(len(self))
        try:
            games = np.asarray(which)
        except ValueError:  # lists of several lengths
            games = np.zeros((1, 1))
        if games.ndim != 1 or (games.dtype == np.bool_ and len(games) != len(self)):
            wanted = f"a list of numbers of games, such as [0], or of {len(self)} booleans"
            raise BadValue(f"which is {wanted}, not {shown(which)}.")
        if games.dtype == np.bool_:
            return np.flatnonzero(games)
        if games.dtype.kind != "i" or not ((games >= 0) & (games < len(self))).all():
            games = np.array([self._as_game(game) for game in games.tolist()], np.int64)
        if len(np.unique(games)) < len(games):
            raise BadValue(f"Each game is begun again once, not as {shown(which)} says.")
        return games

    def _draw_starts(self, seeds: Sequence[int], maps: IntArray) -> IntArray:
        """Return the ids of the start nodes, (seeds, agents), for seeds and the numbers of their maps."""
        found = np.zeros((len(seeds), len(self._roster.names)), np.int64)
        for number, source in enumerate(self._sources[: self._num_maps]):
            which = np.flatnonzero(maps == number)
            if not len(which):
                continue
            if source.starts is None:
                found[which] = self._first_nodes[number]
                continue
            nodes = source.starts([seeds[place] for place in which.tolist()])
            some = next(iter(nodes.values()))  # reserved names need a node, but never use it
            found[which] = np.stack([nodes.get(name, some) for name in self._roster.names], axis=1)
        return found


def _refuse_other_agents(roster: AgentTable, first: AgentTable, number: int) -> None:
    """Refuse a map on which the game's agents differ from the first map."""
    if roster.names != first.names:
        other = min({*roster.names} ^ {*first.names})
        raise BadValue(
            f"On maps[{number}] the game has other agents than on maps[0]: only one of both has {shown(other)}. "
            "Code of the scenario makes agents by the map; let it make the same on all maps."
        )
    are_alike = [
        roster.teams == first.teams,
        np.array_equal(roster.team_of, first.team_of),
        np.array_equal(roster.is_first, first.is_first),
        np.array_equal(roster.flies, first.flies),
    ]
    if not all(are_alike):
        raise BadValue(
            f"On maps[{number}] agents of the game have other teams or kinds than on maps[0]: let the code of the "
            "scenario make the same on all maps."
        )


def _refuse_global_draws(before: object) -> None:
    """Refuse that functions have drawn from the global generators of random numbers since a state; None: unknown.

    Raises:
        BadValue: they have.
    """
    if before is not None and get_global_state() != before:
        raise BadValue(
            "A plain function has drawn from the global generators of random or numpy.random in games that are played "
            "together, so the numbers of each game depend on the others. Its code does not name them: use ctx.rng, or "
            "draw by random.random() or np.random.rand() in the function itself; then run plays one game after the "
            "other from the start."
        )


def _step_again(game: PlayedGame) -> None:
    """Play a turn of a game; ignore an error after all agents moved, because the batch has already raised it."""
    turn = game.turn
    try:
        game.step()
    except Exception:
        if game.turn == turn:
            raise


def list_digests(games: Batch) -> list[dict[str, str]]:
    """Return the digests of the scenario on each map of a batch; see `Scenario.digests`."""
    known = [source.game.internals.digests for source in games._sources[: games.num_maps]]
    return [one() for one in known if one is not None]


def change_strategies(games: Batch, strategies: Mapping[str, Any]) -> None:
    """Let other strategies decide in the games of a batch, in each from its next reset on.

    A game that is under way goes on with the strategies that it began with. The batch keeps contexts with earlier
    strategies as long as games play in them.

    Args:
        games: a batch of a scenario.
        strategies: strategies by team or agent, instead of those with which the batch was made; see `Scenario.build`.

    Raises:
        ScenarioError, BadType, BadValue, UnknownName: see `Scenario.build` and `Scenario.batch`; then nothing changes.
    """
    games._change_strategies(strategies)


def reset_alike(games: Batch, which: IntArray, seeds: Sequence[int]) -> None:
    """Reset games as `Batch.reset` does, with the strategies that they play now instead of the newest ones."""
    games._reset(which, seeds, games._source_of[which] - games.maps[which])


def list_sources(games: Batch) -> list[int]:
    """Return the numbers of the present sources, for `make_source_view`: one for each map and set of strategies."""
    return games._engine.maps_in_use


def list_newest_sources(games: Batch) -> range:
    """Return the numbers of the sources from which games begin, one for each map; see `make_source_view`."""
    return games._engine.newest


def make_source_view(games: Batch, number: int, team: Hashable, agent: str | None = None) -> ArrayView:
    """Return a view of a team, or of one agent, in the games of a source; see `Batch.observe`."""
    roster = games._roster
    agents = roster.members(team) if agent is None else np.array([roster.names.index(agent)])
    return games._make_source_view(agents, number)


def has_first_roads(games: Batch) -> bool:
    """Return whether in all games the roads of the start are open."""
    return games._engine.has_first_roads


def find_pools(games: Batch) -> list[Hashable]:
    """Return the teams that play a pool in a game of a batch, or will play one in the next."""
    numbers = dict.fromkeys([*list_sources(games), *list_newest_sources(games)[:1]])
    deciders = [games._name_deciders(number) for number in numbers]
    return [*dict.fromkeys(team for one in deciders for team, by in one.items() if not isinstance(by, str))]


def find_opponent_names(games: Batch, team: Hashable, which: IntArray) -> np.ndarray[Any, np.dtype[np.object_]]:
    """Return the name of a team's strategy in some games, (games,); of a pool, that of the member that it has drawn."""
    found = np.full(len(which), None, object)
    for place, game in enumerate(which.tolist()):
        decider = games._name_deciders(int(games._source_of[game]))[team]
        seed = games.seeds[game]
        found[place] = decider if isinstance(decider, str) else decider.names[decider.draw(seed, team)]
    return found


def step_with(
    games: Batch,
    given: Mapping[Hashable, OutsideActions],
    threads: int,
    *,
    writer: LearnerWriter | None = None,
) -> None:
    """Play one turn of all games that are not over, with checked actions.

    Args:
        games: the batch.
        given: team -> the actions of its agents; the batch keeps their arrays.
        threads: the number of threads that play.
        writer: writes what learners get and see, if the core plays the turn at once; see `can_play_in_one_call`.
    """
    games._refuse_closed()
    games._step(given, threads, writer=writer)


def can_play_in_one_call(games: Batch, given: Mapping[Hashable, OutsideActions]) -> bool:
    """Return whether the core plays a whole turn with these actions in one call."""
    return games._engine.can_play_moves(given)


def can_restart_in_one_call(games: Batch) -> bool:
    """Return whether games may begin again in the call that plays a turn.

    No game is shown, and no functions are made for the games that begin.
    """
    return games._shown is None and not any(games._own[number].is_needed for number in games._engine.newest)


def prepare_starts(games: Batch, which: IntArray, later: IntArray, seeds: Sequence[int], ahead: int) -> None:
    """Draw what games have by their seeds at their next starts, of which as many as `ahead` are kept.

    Args:
        games: the batch.
        which: the numbers of the games, which may occur several times.
        later: how many starts of the game come before each; less than `ahead`.
        seeds: the seed of each.
        ahead: the same number in all calls.

    Raises:
        ScenarioError: with one of the seeds, not all agents can be placed.
    """
    starts = games._engine.starts
    if starts.ahead != ahead:
        starts.make_room(ahead)
    games._prepare(which * ahead + (starts.next[which] + later) % ahead, seeds)


def load_columns(
    batch: Batch, columns: Columns, turn: int, scores: Mapping[Hashable, FloatArray], games: slice
) -> None:
    """Set the state of some games as `Batch.load` does, without checks; the other games do not go on.

    Args:
        batch: the batch.
        columns: columns of a batch of the same scenario, with a row for each of these games; the others stay.
        turn: the number of turns played.
        scores: key -> the scores of these games.
        games: the games.
    """
    batch._load(columns, turn, scores, games)


def find_winners(games: Batch) -> IntArray:
    """Return the number of each game's winning team in `games.teams`, (games,); -1: there is none."""
    numbers = {team: number for number, team in enumerate(games.teams) if team is not None}
    found = np.full(len(games), -1)
    ended, ends = games._engine.list_ends()
    found[ended] = [-1 if end is None else numbers.get(end["winner"], -1) for end in ends]
    return found
