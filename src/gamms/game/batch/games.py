"""The front of a batch: many games of one kind, played together."""

import os
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from threading import RLock
from typing import Any, Literal, NamedTuple, NoReturn, Self

import numpy as np

from gamms.arguments import as_array, as_bool, as_choice, as_count, as_ids, as_int, as_key, as_mapping, as_path
from gamms.errors import BadType, BadValue, GammsError, UnknownName
from gamms.game.batch.arrays import ArrayEngine, Numbers, movement_in_core
from gamms.game.batch.columns import BYTES_PER_AGENT, PlayedGame, Roster, ScoresOfGames, agents_of, reserved
from gamms.game.batch.cursor import first_called
from gamms.game.batch.given import Acting, Given, as_given, as_kept
from gamms.game.batch.maps import OneByOneOnMaps, drawn_maps
from gamms.game.batch.one_by_one import OneByOneEngine
from gamms.game.batch.own_functions import MakeDeciders, OwnFunctions
from gamms.game.batch.state import Columns, GameArrays, NotTakenUp
from gamms.game.batch.view import ArrayView
from gamms.game.global_random import global_state, seeded_for_run
from gamms.game.hidden_state import refusing_changes
from gamms.game.result import Result
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.limits import max_memory, refuse_above
from gamms.progress import progress as progress_line
from gamms.progress import uninterrupted
from gamms.readonly import Immutable, locked
from gamms.text import shown

MostAgents = int | Mapping[Any, int | Sequence[str]]
"""How many agents teams may come to have: of each team, or by team; or the names of those that may come."""
_FEWEST_WARNED = 16  # games
_AT_ONCE_IN_CORE = 1 << 22  # agents times turns that the core plays before Ctrl-C is heard
_BYTES_PER_RESULT = 3_000  # of an agent in a game that was played by itself
_BYTES_PER_SNAPSHOT = 30_000  # of an agent in a game that is played by itself, turn by turn; 27,000 measured


class BatchSource(NamedTuple):
    """Where the games of a batch that are on one map come from.

    Attributes:
        game: at its start, in a context of the batch's own.
        starts: returns where agents begin with each of several seeds, by name the ids of nodes, (seeds,); None: with
            every seed where they are.
        follows_seed: what else differs with the seed, in words; None: nothing but `deciders`.
        deciders: makes the strategies and plans that differ with the seed; None: there are none.
        build: makes a context with the game of a seed; None: recordings cannot be made.
    """

    game: PlayedGame
    starts: Callable[[Sequence[int]], Mapping[str, IntArray]] | None
    follows_seed: str | None
    build: Callable[[int], Any] | None
    deciders: MakeDeciders | None = None


class _Alone(NamedTuple):
    """A game that is played once more in a context of its own."""

    number: int
    game: PlayedGame


class Batch(Immutable):
    """Many games of one kind, each with a seed of its own: `scenario.batch(1000)`, `ctx.game.batch(1000)`.

    Game i is the one that `scenario.play(seed=seeds[i])` plays. The core plays games of which it has all parts, and
    calls plain functions and array functions between its phases. Other games are played one after the other, in one
    context. A batch is a context manager.

    Attributes:
        seeds: of the games, (games,).
        maps: (games,) the number of the map that each game is on, which its seed draws; 0 where there is one map.
        slow: the first part that the core does not have, or plain function that it calls, in words; None: neither.
        is_closed: whether `close` was called; results stay.
    """

    seeds: Sequence[int]
    maps: IntArray
    slow: str | None
    is_closed: bool
    _way_out = "settings are those of the scenario, or of ctx.game, when it is made; reset(seeds=…) begins other games."

    def __init__(
        self,
        sources: Sequence[BatchSource],
        seeds: Sequence[int],
        *,
        record: bool,
        most_agents: MostAgents | None,
    ) -> None:
        self._sources = sources
        self._rosters = [_roster_of(source.game, most_agents) for source in sources]
        self._roster = self._rosters[0]
        for number, roster in enumerate(self._rosters):
            _refuse_other_agents(roster, self._roster, number)
        self._put_public(seeds=seeds)
        self._refuse_too_many(BYTES_PER_AGENT * len(sources))
        maps = locked(drawn_maps(seeds, len(sources)))
        self._put_public(seeds=tuple(seeds), slow=None, maps=maps, is_closed=False)
        # Before agents move in those contexts:
        self._first_nodes = [
            roster.first_nodes(source.game) for source, roster in zip(sources, self._rosters, strict=True)
        ]
        self._begin: IntArray = np.zeros((len(seeds), len(self._roster.names)), np.int64)  # see `_starts`
        made = [(source.game, source.deciders) for source in sources]
        self._own = [None if make is None else OwnFunctions(game, make, self.seeds) for game, make in made]
        self._engine = self._made_engine()
        self._left: str | None = None  # why the games have left the core
        is_kept = as_bool(record, "record") or self._engine.may_leave
        self._log: list[dict[Hashable, Given]] | None = [] if is_kept else None
        self._begun = np.zeros(len(seeds), np.int64)  # how many entries the log had when games began; -1: loaded
        self._steps = 0
        self._ran_from: int | None = None  # how many entries the log had when the run that plays now began
        self._is_said = False  # whether it was logged what slows it down
        self._first_turn = sources[0].game.turn  # how many turns were played before the batch
        self._shown: _Alone | None = None
        self._alone: _Alone | None = None  # which is played right now
        self._was_given = False  # whether actions came from outside and were not kept
        self._lock = RLock()  # of the thread that plays

    def _made_engine(self) -> ArrayEngine | OneByOneOnMaps:
        """Return what plays the games: the core, unless it cannot hold a part of them; then `slow` names that part."""
        try:
            engine = self._made_in_core()
        except GammsError as error:
            self._put_public(slow=str(error))
            self._refuse_too_many(_BYTES_PER_RESULT)
            return self._made_one_by_one()
        self._put_public(slow=first_called(self._sources[0].game, self._roster))
        return engine

    def _made_in_core(self) -> ArrayEngine:
        """Return what plays the games in the core.

        Raises:
            NotTakenUp: the core cannot hold a part of the games.
            GammsError: a part of them does not fit into memory, or is not on the map any more.
        """
        for source in self._sources:
            if source.follows_seed is not None:
                raise NotTakenUp(source.follows_seed)
        self._take_functions(np.arange(len(self)))
        games = [source.game for source in self._sources]
        movements = [movement_in_core(game, roster) for game, roster in zip(games, self._rosters, strict=True)]
        self._begin = self._starts(self.seeds, self.maps)
        return ArrayEngine(games, movements, self.seeds, self.maps, self._begin, self._rosters)

    def _take_functions(self, games: IntArray) -> None:
        """Make the strategies and plans of some games, where they differ between games."""
        for number, own in enumerate(self._own):
            if own is not None:
                on_map = games[self.maps[games] == number]
                own.take(on_map, [self.seeds[game] for game in on_map.tolist()])
                own.install()

    def _made_one_by_one(self) -> OneByOneOnMaps:
        """Return what plays the games one after the other."""
        for own in filter(None, self._own):
            own.remove()
        engines = [
            OneByOneEngine(source.game, roster, self.seeds)
            for source, roster in zip(self._sources, self._rosters, strict=True)
        ]
        return OneByOneOnMaps(engines, self.maps.copy())

    def __len__(self) -> int:
        return len(self.seeds)

    def __repr__(self) -> str:
        how = "in the core" if self.is_in_arrays else f"one by one, because of {self.slow}"
        return f"Batch({len(self)} games, {int(self._engine.is_over.sum())} over, played {how})"

    def __reduce__(self) -> NoReturn:
        """Refuse to be pickled or copied."""
        raise BadType(
            "A batch can neither be pickled nor copied, because it plays in a context. Pickle its scenario and make a "
            "batch of it in the other process; columns() and load(…) of batches copy games in arrays."
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the contexts of the batch."""
        self._put_public(is_closed=True)
        self._hide()
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
        """Play one turn of all games that are not over; return which go on, (games,).

        Ctrl-C waits until the turn is played; a second one does not.

        Args:
            actions: team -> integers (games, agents of the team in the order of their names): the numbers of the nodes
                in `state["legal"]` that they go to, 0 to stay. Teams that are not there play their own strategies.
                Those of dead agents and of games that are over do not count. Or a dict of `"moves"`, such integers,
                without which all stay; `"flights"` of those that fly, (games, agents, 3) map units, without which they
                hover; `"deeds"`: deed -> (where, fields), or `where` alone, booleans (games, agents);
                and `"messages"`: channel -> (where, body) or (where, body, to). Fields, bodies and `to` are as in
                `view.do` and `view.send`: one value for all, or arrays (games, agents).
            on_illegal: "stay": where a rule before the turn leaves fewer nodes legal than `observe` has said, actions
                that are not legal any more stay, as do all others that are not; "raise": they are refused.
            threads: how many threads play; see `run`.

        Raises:
            UnknownName (KeyError): no agent plays for a team; there is no such deed or channel.
            BadType, BadValue: actions are not such integers, or not legal; no game has played then, and no rule was
                called. Where a rule before the turn has made one illegal, these rules were; actions may be given again.
            TooLarge: games that are played one by one would not fit into memory, each at its turn.
        """
        self._refuse_closed()
        wanted = dict(as_mapping({} if actions is None else actions, "actions"))
        may_stay = as_choice(on_illegal, "on_illegal", ("raise", "stay")) == "stay"
        given = {team: self._as_given(team, value)._replace(may_stay=may_stay) for team, value in wanted.items()}
        if not self.is_in_arrays:
            self._refuse_too_many(_BYTES_PER_SNAPSHOT)
        self._step(given, None, min(as_count(threads, "threads"), len(self)))
        self._follow()
        return ~self._engine.is_over

    def _step(self, given: dict[Hashable, Given], numbers: Numbers | None, threads: int) -> None:
        """Play one turn, and note what was given."""
        before, is_played = self._engine.turns(), False
        with self._playing(), uninterrupted(at_most_once=True):
            try:
                with self._watched():
                    self._play_turn(given, numbers, threads)
                is_played = True
            finally:
                if is_played or (self._engine.turns() > before).any():  # or a rule has raised when all had moved
                    self._note(given)
                    self._was_given |= self._log is None and numbers is not None

    def _step_numbers(self, numbers: Numbers, threads: int) -> bool:
        """Play a turn; see `step_numbers`."""
        self._refuse_closed()
        if not self.is_in_arrays:
            return False
        given = dict[Hashable, Given]()
        if self._log is not None:  # for the turn engine, if it plays these games again
            for team in self._roster.teams:
                members = self._roster.members(team)
                if numbers.is_given[members].all():
                    given[team] = Given(as_kept(numbers.actions[:, members]), {}, {}, may_stay=True)
        self._step(given, numbers, threads)
        self._follow()
        return True

    def _play_turn(self, given: Mapping[Hashable, Given], numbers: Numbers | None, threads: int) -> None:
        engine = self._engine
        if isinstance(engine, OneByOneOnMaps):
            engine.step(given)
            return
        try:
            engine.step({} if numbers is not None else given, numbers, threads)
        except NotTakenUp as error:
            left = self._leave_arrays(engine, " ".join((f"{error}.", *getattr(error, "__notes__", ()))))
            if self._ran_from is None:
                left.step(given)

    def _leave_arrays(self, left: ArrayEngine, why: str) -> OneByOneOnMaps:
        """Let the turn engine play all games from their starts to the last turn that was played, and go on there.

        In `run` it plays them up to the first turn of that, as it seeds the global generators for all of a run.
        """
        self._hide()
        left.release()
        engine = self._made_one_by_one()
        log = self._log or []
        if self._ran_from is not None:
            del log[self._ran_from :]
        for number in range(len(self)):
            for given in log[self._entry_of(number) :]:
                if engine.over(number) is None:
                    engine.step_game(number, given)
        self._engine = engine
        self._left = why
        self._put_public(slow=why)
        return engine

    @contextmanager
    def _playing(self) -> Iterator[None]:
        """Refuse to play while another thread does."""
        if not self._lock.acquire(blocking=False):
            raise BadValue(
                "Another thread plays this batch right now. Make a batch for each thread, or use run(threads=…)."
            )
        try:
            yield
        finally:
            self._lock.release()

    def _note(self, given: dict[Hashable, Given]) -> None:
        """Note the actions of a turn that was played."""
        if self._ran_from is not None and not self.is_in_arrays:  # it begins the run again
            return
        if self._log is not None:
            self._log.append(given)
        self._was_given |= self._log is None and bool(given)
        self._steps += 1

    def _as_given(self, team: Hashable, value: object) -> Given:
        """Return actions as they were given, copies where they are kept."""
        members = self._roster.members(team)
        given = as_given(value, team, (len(self), len(members)), is_copied=self._log is not None)
        if given.flights is not None and not self._roster.flies[members].any():
            raise BadValue(f"team {shown(team)} was given flights, and none of its agents flies.")
        return given

    def _watched(self) -> AbstractContextManager[None]:
        """Refuse forms that remember elsewhere than in their views and turns; looked at in turns that get rarer."""
        if not self.is_in_arrays or self._steps & (self._steps - 1):
            return nullcontext()
        return refusing_changes(
            self._engine.functions,
            "Keep it in view.keep(key, make) or turn.keep(key, make), else in state['memory'] or ctx.game.data.",
        )

    def run(self, progress: bool = False, *, warn: bool = True, threads: int = 1) -> None:
        """Play all games to their ends.

        Args:
            progress: show how far it is on a line of stderr, where that is a terminal.
            warn: log once which teams have no strategy, and which part the core does not have.
            threads: how many threads play games of which all parts are in the core; the games are the same with any
                number. Other games are played by one.

        Raises:
            BadType, BadValue: `progress` or `warn` is no flag, `threads` is not a number from 1, nothing could ever
                end these games, or another thread plays them.
        """
        self._refuse_closed()
        num_threads = min(as_count(threads, "threads"), len(self))
        is_shown, game = as_bool(progress, "progress"), self.game
        if game.settings()["max_turns"] is None and not game.rules:
            raise BadValue("These games have no rule that could end them: set max_turns or add a rule.")
        if as_bool(warn, "warn"):
            game.internals.warn_of_idle_teams()
            self._say_what_is_slow()
        with self._playing(), progress_line() as line:
            show = line if is_shown else None
            if isinstance(self._engine, ArrayEngine):
                self._ran_from = None if self._log is None else len(self._log)
                try:
                    self._run_in_core(self._engine, num_threads, show)
                finally:
                    self._ran_from = None
            if isinstance(self._engine, OneByOneOnMaps):  # or they have left the core
                self._run_one_by_one(self._engine, show)
        self._follow()

    def _run_in_core(self, engine: ArrayEngine, threads: int, show: Callable[[str], object] | None) -> None:
        """Play games to their ends, as long as they are in the core: so many turns at a time that Ctrl-C is heard."""
        turns = max(1, _AT_ONCE_IN_CORE // (len(self) * len(self._roster.names)))
        plays_by_phases = engine.plays_by_phases
        before = global_state() if engine.calls_each else None
        while self._engine is engine and not engine.is_over.all():
            if plays_by_phases:
                self.step()
            else:
                with uninterrupted(at_most_once=True):
                    played = engine.play(turns, threads)
                    if self._log is not None:
                        self._log += [{}] * played
                    self._steps += played
            if show is not None:
                self._show_progress(show)
        if self._engine is engine and before is not None and global_state() != before:
            self._leave_arrays(engine, "a plain function draws from the global generators of random numbers")

    def _show_progress(self, show: Callable[[str], object]) -> None:
        over = int(self._engine.is_over.sum())
        show(f"{over} of {len(self)} games over, turn {int(self._engine.turns().max())}")

    def _say_what_is_slow(self) -> None:
        if self._is_said or self.slow is None:
            return
        self._is_said = True
        logger = self.game.ctx.logger
        if self.is_in_arrays:
            logger.info(f"A batch calls plain functions game by game, because of {self.slow}.")
            return
        say = logger.info if len(self) < _FEWEST_WARNED else logger.warning
        say(f"A batch is played one game after the other, because of {self.slow}.")

    def _run_one_by_one(self, engine: OneByOneOnMaps, show: Callable[[str], object] | None) -> None:
        try:
            for game in np.flatnonzero(~engine.is_over).tolist():
                engine.run(game)
                if show is not None:
                    show(f"game {game + 1} of {len(self)}")
        finally:
            engine.return_to_shown()

    def reset(self, which: Any = None, *, seeds: Iterable[int] | None = None) -> None:
        """Begin games again; games with other seeds draw their maps again, if there are several.

        Args:
            which: the numbers of games, or an array (games,) of booleans; None: all.
            seeds: of each of them; None: those that they have.

        Raises:
            BadType, BadValue: a number is not that of a game or is there twice, or there is not one seed or boolean for
                each.
        """
        self._refuse_closed()
        numbers = self._numbers_of(which)
        given = [self.seeds[game] for game in numbers] if seeds is None else as_ids(seeds, "seeds")
        if len(given) != len(numbers):
            raise BadValue(f"reset got {len(given)} seeds for {len(numbers)} games: give one for each.")
        if not numbers:
            return
        if self._shown is not None and self._shown.number in numbers:
            self._hide()
        changed = dict(zip(numbers, given, strict=True))
        if seeds is not None:
            maps = self.maps.copy()
            maps[numbers] = drawn_maps(given, len(self._sources))
            if self.is_in_arrays:
                self._begin[numbers] = self._starts(given, maps[numbers])
            self._put_public(maps=locked(maps))
        self._put_public(seeds=tuple(changed.get(game, seed) for game, seed in enumerate(self.seeds)))
        if isinstance(self._engine, ArrayEngine):
            if any(self._own):
                self._engine.release()
                self._take_functions(np.array(numbers))
            self._engine.start(np.array(numbers), given, self.maps[numbers], self._begin[numbers])
        else:
            self._engine.start(np.array(numbers), given, self.maps[numbers])
        if len(changed) == len(self):
            self._log, self._was_given = None if self._log is None else [], False
        self._begun[numbers] = len(self._log or ())
        if self._log:  # turns of games that have all begun again since are not kept
            first = max(0, int(self._begun.min()))
            del self._log[:first]
            self._begun[self._begun >= 0] -= first

    def columns(self) -> Columns:
        """Return what the next turns of all games follow from besides turn, scores and seeds, for `load`.

        That is where agents are and what rules and strategies remember, as arrays (games, …), of which rows can be
        taken, repeated and put together.

        Raises:
            BadValue: the games are not played in the core, or they have several maps.
        """
        return self._arrays("columns").columns()

    def load(self, columns: Columns, turn: int, scores: Mapping[Hashable, FloatArray | float] | None = None) -> None:
        """Let all games be at the moments that `columns` of such games say, with their own seeds and without events.

        Args:
            columns: a row for each game.
            turn: how many turns were played.
            scores: key -> (games,) numbers; None: none.

        Raises:
            BadType, BadValue: the games are not played in the core, they have several maps, or these are no moments of
                such games.
        """
        as_mapping(columns, "columns")
        for key, points in as_mapping({} if scores is None else scores, "scores").items():
            numbers = as_array(points, f"Scores of {shown(key)}", "numbers")
            if numbers.shape not in {(), (len(self),)} or np.isnan(numbers).any():
                raise BadValue(f"Scores of {shown(key)} are numbers of {len(self)} games, not {shown(points)}.")
        self._arrays("load").load(columns, as_count(turn, "turn", least=0), scores or {})
        self._hide()
        self._begun[:] = -1

    def _arrays(self, what: str) -> GameArrays:
        if isinstance(self._engine, OneByOneOnMaps) or self._engine.calls_each:
            why = str(self.slow).removesuffix(".")
            raise BadValue(f"{what} is for games of which the core plays all parts; these are not, because of {why}.")
        if len(self._sources) > 1:
            raise BadValue(
                f"{what} is for games on one map, whose nodes its columns number; these are on {len(self._sources)}: "
                "make a batch for each map."
            )
        return self._engine.state_of(0)

    # -- seeing -------------------------------------------------------------------------------------------------

    def observe(self, team: Hashable, *, map: int | None = None) -> ArrayView:
        """Return where the agents of a team are and what they may do, in all games, as arrays.

        Args:
            team: of the agents.
            map: the number of a map, of several: the view has the games that are on it now; its `games` are their
                numbers, which may be none.

        Raises:
            UnknownName (KeyError): no agent plays for it.
            BadValue: there are several maps, and none is given, or there is no such map.
        """
        return self._view(self._roster.members(team), map)

    def observe_agent(self, name: str, *, map: int | None = None) -> ArrayView:
        """Return what `observe` does, of one agent alone.

        Raises:
            UnknownName (KeyError): there is no such agent.
            BadValue: see `observe`.
        """
        if as_key(name, "The name of an agent") not in self._roster.names:
            raise UnknownName("agent", name, self._roster.names)
        return self._view(np.array([self._roster.names.index(name)]), map)

    def _view(self, agents: IntArray, map: int | None) -> ArrayView:
        num_maps = len(self._sources)
        if map is None and num_maps > 1:
            raise BadValue(
                f"These games are on {num_maps} maps, and a view has one: give map=k, from 0 to {num_maps - 1}, for "
                "the games of which batch.maps is k."
            )
        number = 0 if map is None else as_int(map, "map")
        if not 0 <= number < num_maps:
            raise BadValue(f"There is no map {number}: the batch has {num_maps}, numbered from 0.")
        return self._engine.view(agents, number)

    @property
    def game(self) -> PlayedGame:
        """The game that the batch was made from: its agents, rules and settings.

        Of several maps, it is the one on the map of the game that was played by itself last, or on the first map.
        """
        if self._alone is not None:
            return self._alone.game
        return self._sources[self._engine.current].game

    @property
    def num_maps(self) -> int:
        """How many maps there are."""
        return len(self._sources)

    @property
    def teams(self) -> tuple[Hashable, ...]:
        """The teams that agents play for."""
        return self._roster.teams

    @property
    def turn(self) -> IntArray:
        """How many turns were played, (games,)."""
        return self._engine.turns()

    @property
    def scores(self) -> dict[Any, Any]:
        """The scores: key -> (games,) float64; of one that was not set in any game they are 0."""
        scores = ScoresOfGames(lambda: np.zeros(len(self)))
        scores.update(self._engine.scores())
        return scores

    @property
    def is_over(self) -> BoolArray:
        """Which games have ended, (games,)."""
        return self._engine.is_over

    @property
    def terminated(self) -> BoolArray:
        """Which games were ended by what happened in them, (games,)."""
        return self._engine.is_over & ~self.truncated

    @property
    def truncated(self) -> BoolArray:
        """Which games were ended because the time was up, (games,)."""
        late = np.zeros(len(self), np.bool_)
        for game in np.flatnonzero(self._engine.is_over).tolist():
            over = self._engine.over(game)
            late[game] = over is not None and over["truncated"]
        return late

    def result(self, game: int) -> Result:
        """Return the result of a game so far; its timings are 0 if the core plays it."""
        return self._engine.result(self._as_game(game))

    @property
    def detached(self) -> dict[int, str]:
        """Game -> why it has left the core while it was played: all games, or none."""
        return {} if self._left is None else dict.fromkeys(range(len(self)), self._left)

    def table(self) -> dict[str, Any]:
        """Return one row a game: seed, turns, reason, winner, truncated, and `score.<key>` for each score.

        Where there are several maps, `map` is the number of the map of each game.
        """
        overs = [self._engine.over(game) or {} for game in range(len(self))]
        columns: dict[str, Any] = {"seed": np.array(self.seeds), "turns": self._engine.turns()}
        if len(self._sources) > 1:
            columns["map"] = self.maps.copy()
        columns["reason"] = np.array([over.get("reason", "unfinished") for over in overs], object)
        columns["winner"] = np.array([over.get("winner") for over in overs], object)
        columns["truncated"] = np.array([over.get("truncated", True) for over in overs])
        return columns | {f"score.{key}": numbers for key, numbers in sorted(self._engine.scores().items(), key=str)}

    def record(self, game: int, path: str | os.PathLike[str]) -> None:
        """Write a recording of a game as far as it was played, as `scenario.play(seed=…, record=path)` does.

        The game is played once more, with the actions that were given to `step`; a file is replaced.

        Raises:
            BadValue: actions were given to `step`, and the batch was not made with `record=True`; the game was loaded
                and not begun again since; or the batch is not of a scenario.
        """
        number, file = self._as_game(game), as_path(path, "path")
        build = self._sources[self.maps[number]].build
        if build is None:
            raise BadValue("Only a batch of a scenario can be recorded: scenario.batch(…), not ctx.game.batch(…).")
        self._refuse_unknown_past(number)
        with build(self.seeds[number]) as ctx:
            ctx.record.start(file, overwrite=True)
            self._play_alone(ctx.game, number)

    def _refuse_unknown_past(self, game: int) -> None:
        """Refuse to play a game once more if it is not known what was done in it."""
        if self._was_given:
            raise BadValue(
                "The actions that were given to step were not kept: make the batch with scenario.batch(…, "
                "record=True), or ask for context(…) before actions are given."
            )
        self._entry_of(game)

    def _play_alone(self, game: PlayedGame, number: int) -> None:
        """Play a game in another context, on to where it is in the batch."""
        first, log = self._entry_of(number) - self._first_turn, self._log or []
        turns = int(self._engine.turns()[number])
        ran_from = self._engine.ran_from(number) if isinstance(self._engine, OneByOneOnMaps) else None
        num_given = turns if ran_from is None else ran_from
        acting = Acting(game, self._roster)
        self._alone = _Alone(number, game)
        try:
            with seeded_for_run(game.ctx, game.turn):
                for turn in range(game.turn, turns):
                    acting.take(log[first + turn] if log and turn < num_given else {}, number)
                    _step_again(game)
                if self._engine.is_over[number] and game.over is None and turns != game.settings()["max_turns"]:
                    game.step()  # which a rule of the phase "before" ends
        finally:
            self._alone = None
            acting.end()

    def _entry_of(self, game: int) -> int:
        """Return which entry of the log is that of the first turn of a game."""
        first = int(self._begun[game])
        if first < 0:
            raise BadValue(f"Game {game} was loaded, so it cannot be played from its start: begin it with reset first.")
        return first

    def context(self, game: int) -> Any:
        """Return a context that is pointed at a game, to look at it; after each turn it has the game as it is then.

        A game in the core, or one that is over, is played once more in a context of its own. This takes as long as the
        game takes alone, and so does each turn from then on. That context ends when another game is asked for and when
        the game begins again. Other games are shown in the context of the batch, which has another one for each map.

        Raises:
            BadValue: actions were given to `step` before, and the batch was not made with `record=True`; or the game
                was loaded and not begun again since.
        """
        number = self._as_game(game)
        with self._playing():
            if isinstance(self._engine, OneByOneOnMaps) and self._engine.can_show(number):
                return self._engine.show(number).ctx
            return self._context_of(number)

    def _context_of(self, number: int) -> Any:
        """Return a context of its own that shows a game."""
        if self._shown is None or self._shown.number != number or self._shown.game.ctx.is_terminated():
            self._refuse_unknown_past(number)
            self._hide()
            if self._log is None:
                self._begin_log()
            self._shown = _Alone(number, self._begun_alone(number))
        self._follow()
        return self._shown.game.ctx

    def _begun_alone(self, number: int) -> PlayedGame:
        """Return a game at its start, in a context of its own."""
        source, seed = self._sources[self.maps[number]], self.seeds[number]
        game: PlayedGame
        if source.build is not None:
            game = source.build(seed).game
            return game
        self._engine.release()
        game = source.game.fork(0)
        if isinstance(self._engine, OneByOneOnMaps):
            self._engine.return_to_shown()
        game.reset(seed=seed)
        return game

    def _begin_log(self) -> None:
        """Note actions from now on; none were given before."""
        turns = self._engine.turns() - self._first_turn
        most = int(turns.max())
        self._log = [{} for _ in range(most)]
        self._begun[self._begun >= 0] = (most - turns)[self._begun >= 0]

    def _follow(self) -> None:
        """Let the context that shows a game have it as it is now."""
        if self._shown is not None and not self._shown.game.ctx.is_terminated():
            self._play_alone(self._shown.game, self._shown.number)

    def _hide(self) -> None:
        """End the context that shows a game."""
        if self._shown is not None:
            self._shown.game.ctx.terminate()
            self._shown = None

    @property
    def is_in_arrays(self) -> bool:
        """Whether the games are played in the core, and not one after the other."""
        return isinstance(self._engine, ArrayEngine)

    @property
    def loaded(self) -> int | None:
        """The number of the game whose strategies are called now; None: none are called."""
        if self._alone is not None:
            return self._alone.number
        return self._engine.loaded

    # -- inside -------------------------------------------------------------------------------------------------

    def _refuse_too_many(self, per_agent: int) -> None:
        """Refuse more games than fit into memory, with so many bytes for each agent."""
        games, agents = len(self), len(self._roster.names)
        fitting = int(max_memory() // max(1, agents * per_agent))
        what = f"A batch of {games} games with {agents} agents each, of which {fitting} would fit,"
        refuse_above(games * agents * per_agent, what)

    def _as_game(self, number: int) -> int:
        game = as_int(number, "The number of a game")
        if not 0 <= game < len(self):
            raise BadValue(f"There is no game {game}: the batch has {len(self)}, numbered from 0.")
        return game

    def _numbers_of(self, which: object) -> list[int]:
        """Return the numbers of games, which are given as such, or by booleans; None: of all."""
        try:
            games = np.arange(len(self)) if which is None else np.asarray(which)
        except ValueError:  # lists of several lengths
            games = np.zeros((1, 1))
        if games.ndim != 1 or (games.dtype == np.bool_ and len(games) != len(self)):
            wanted = f"a list of numbers of games, such as [0], or of {len(self)} booleans"
            raise BadValue(f"which is {wanted}, not {shown(which)}.")
        which_ones = np.flatnonzero(games) if games.dtype == np.bool_ else games
        numbers = [self._as_game(game) for game in which_ones.tolist()]
        if len({*numbers}) < len(numbers):
            raise BadValue(f"Each game is begun again once, not as {shown(which)} says.")
        return numbers

    def _starts(self, seeds: Sequence[int], maps: IntArray) -> IntArray:
        """Return the ids of the nodes where agents begin on maps, (games, agents), in the order of their names."""
        found = np.zeros((len(seeds), len(self._roster.names)), np.int64)
        for number, source in enumerate(self._sources):
            which = np.flatnonzero(maps == number)
            if not len(which):
                continue
            if source.starts is None:
                found[which] = self._first_nodes[number]
                continue
            nodes = source.starts([seeds[place] for place in which.tolist()])
            some = next(iter(nodes.values()))  # for names that are reserved, any will do
            found[which] = np.stack([nodes.get(name, some) for name in self._roster.names], axis=1)
        return found


def _roster_of(game: PlayedGame, most_agents: MostAgents | None) -> Roster:
    """Return the agents of a game, and names that are reserved for others."""
    agents = agents_of(game)
    roster = Roster.of(agents)
    return roster if most_agents is None else Roster.of(agents, reserved(roster, most_agents))


def _refuse_other_agents(roster: Roster, first: Roster, number: int) -> None:
    """Refuse a map on which the game has other agents than on the first one."""
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


def _step_again(game: PlayedGame) -> None:
    """Play a turn of a game; an error was raised in the batch, too, if it comes when all agents have moved."""
    turn = game.turn
    try:
        game.step()
    except Exception:
        if game.turn == turn:
            raise


def step_numbers(games: Batch, numbers: Numbers, threads: int) -> bool:
    """Play one turn of all games that are not over, where the core plays them; return whether it does.

    Args:
        games: the batch.
        numbers: what learners do.
        threads: how many threads play.
    """
    return games._step_numbers(numbers, threads)
