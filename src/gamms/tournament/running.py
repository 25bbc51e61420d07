"""Runs a tournament: who plays whom, and where, until all games are played; none is played twice."""

import json
import logging
import os
import pickle
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import BrokenExecutor, Executor, Future
from functools import partial
from itertools import combinations
from pathlib import Path
from typing import Any, TypeVar

from gamms.arguments import as_bool, as_count, as_int, as_items, as_known, as_path, as_positive
from gamms.errors import BadType, BadValue, GammsError, WriteConflict
from gamms.experiment.executors import Here, executor_for
from gamms.experiment.folders import Journal
from gamms.experiment.variants import digest_of, row_id
from gamms.folders import json_in, locked, refuse_link, without_link, write_whole
from gamms.limits import max_memory
from gamms.progress import progress
from gamms.scenario import Scenario
from gamms.text import printable_line, shown
from gamms.tournament.entries import SCRATCH, Entry, Given, found_entries, publish
from gamms.tournament.games import MOST_TURNS, Fixture, Row
from gamms.tournament.page import write_page
from gamms.tournament.players import Allowed
from gamms.tournament.scratch import remove_folder
from gamms.tournament.table import Table
from gamms.tournament.workers import Settings, Task, Trial, close_launchers, play, trial
from gamms.versions import versions
from gamms.workers import WorkerPool, cores, first_done, result_of

MANIFEST = "tournament.json"
_FORMAT = "gamms tournament 1"
_LEAST_MB = 64
_MAP = "map.gamms"
_FOLDERS = (SCRATCH, "entries", "games", "logs")
_GAMES_OF_A_TASK = 10
_ATTEMPTS = 3  # at a task whose process dies
_Pair = tuple[Entry, Entry]
T = TypeVar("T")


def run(  # noqa: PLR0913 - each option is independent of the others
    scenario: Scenario,
    *,
    entries: Mapping[str, Given],
    seeds: Iterable[int],
    out: str | os.PathLike[str],
    move_seconds: float = 1.0,
    memory_mb: int = 512,
    sides: Sequence[str] | None = None,
    rounds: int | None = None,
    workers: int | None = None,
    executor: Executor | str | None = None,
    record: bool = True,
    folder: str | os.PathLike[str] | None = None,
) -> Table:
    """Let entries play each other on both sides with the same seeds, and return the table.

    Each entry is tried before the first game; one that cannot play is named by a warning and in `not_ready` of the
    table, and loses its games. A tournament that was interrupted, by a crash too, goes on where it was when it is run
    again with the same `out`.

    Args:
        scenario: the game.
        entries: name -> `file.py:function`, `module:function`, or a program and its arguments; see docs/tournaments.md.
        seeds: of the games of each two entries.
        out: the folder for all that is written.
        move_seconds: how long an entry may take for a move, by the clock on the wall.
        memory_mb: how much memory the process of an entry may use, MiB.
        sides: the two teams that entries play; None: the scenario has no others.
        rounds: of a Swiss tournament; None: all play all.
        workers: how many games at once, each in a process of its own; None: one after the other, in this process.
        executor: plays instead: any executor of `concurrent.futures` on this machine, or "ray".
        record: keep a recording of each game, in `out/games`.
        folder: where relative paths of entries begin; None: the current folder.

    Raises:
        BadType, BadValue: there are too few entries, sides or seeds, or a limit is too low.
        UnknownName (KeyError): the scenario has no such team.
        ScenarioError (ValueError): an entry has no such function, or the scenario cannot be built.
        WriteConflict (RuntimeError): another tournament was or is played in this folder.
        GammsError: the system is Windows, where processes cannot be confined so.
    """
    if not hasattr(os, "fork"):
        raise GammsError("Tournaments run on Linux and macOS: Windows has no way to bound the processes of entries.")
    if not isinstance(scenario, Scenario):
        raise BadType(f"scenario must be a Scenario, as gamms.scenario.load gives it, not {shown(scenario)}.")
    where = as_path(out, "out").absolute()
    teams, numbers = _sides(scenario, sides), _seeds(seeds)
    base = Path.cwd() if folder is None else as_path(folder, "folder").absolute()
    allowed = _allowed(scenario, move_seconds, memory_mb)
    number = None if rounds is None else as_count(rounds, "rounds", 1)
    games = where / "games" if as_bool(record, "record") else None
    chosen, is_own = executor_for(executor, workers)
    with locked(where):
        for name in _FOLDERS:
            refuse_link(where / name)
        private = [one for one in (scenario.file, scenario.folder) if one is not None]
        game = {"sides": list(teams), "move_seconds": allowed.move_s, "memory_mb": memory_mb, **versions()}
        manifest = {"scenario": digest_of(scenario), **game}
        _refuse_other(where, manifest)
        remove_folder(where / SCRATCH)  # of a tournament that was interrupted
        runner = None
        try:
            with scenario.build(seed=numbers[0]) as ctx:
                found = found_entries(entries, base, where, private)
                ctx.graph.save(without_link(where / _MAP))
            settings = Settings(scenario, where / _MAP, where / SCRATCH, allowed, games, where / "logs", max_memory())
            plan = {"entries": {one.name: one.digest for one in found}, "seeds": numbers, "rounds": number}
            runner = _Runner(settings, chosen, workers, Journal(where, Row), manifest)
            (where / SCRATCH).mkdir(exist_ok=True)
            not_ready, missing = _tried(runner, found, teams, numbers[0])
            written = {"format": _FORMAT, **manifest, **plan, "not_enforced": missing, "not_ready": not_ready}
            write_whole(where / MANIFEST, (json.dumps(written, indent=1) + "\n").encode())
            table = runner.play(found, teams, numbers, number)
            table.not_enforced, table.not_ready = missing, not_ready
            publish(found, where)
        finally:
            if runner is not None:
                runner.close(is_own=is_own)
            remove_folder(where / SCRATCH)
        write_page(table, where, scenario.spec.name or "Tournament")
    return table


def _seeds(given: Iterable[int]) -> list[int]:
    numbers = list(dict.fromkeys(as_int(seed, "a seed") for seed in as_items(given, "seeds", "integers")))
    if not numbers:
        raise BadValue("A tournament needs one seed at least.")
    return numbers


def _sides(scenario: Scenario, given: Sequence[str] | None) -> tuple[str, str]:
    teams = list(scenario.spec.teams)
    if given is None and len(teams) != 2:
        raise BadValue(f"The scenario has the teams {', '.join(teams)}. Say by sides= which two of them entries play.")
    sides = teams if given is None else list(as_items(given, "sides", "two teams"))
    for one in sides:
        as_known(one, "team", teams)
    if len(sides) != 2 or sides[0] == sides[1]:
        raise BadValue(f"sides must be two teams, not {shown(given)}.")
    return sides[0], sides[1]


def _allowed(scenario: Scenario, move_seconds: float, memory_mb: int) -> Allowed:
    seconds, megabytes = as_positive(move_seconds, "move_seconds"), as_int(memory_mb, "memory_mb")
    if megabytes < _LEAST_MB:
        raise BadValue(f"memory_mb must be at least {_LEAST_MB}, which programs take to start, not {megabytes}.")
    turns = scenario.spec.max_turns or MOST_TURNS
    return Allowed(seconds, megabytes << 20, int(seconds * (turns + 10)) + 1)


def _tried(
    runner: "_Runner", entries: Sequence[Entry], sides: tuple[str, str], seed: int
) -> tuple[dict[str, str], list[str]]:
    """Try all entries; return why some of them cannot play, and what this system cannot enforce."""
    trials = runner.tried(entries, sides, seed)
    not_ready = {name: one.reason for name, one in trials.items() if one.reason is not None}
    for name, reason in not_ready.items():
        words = printable_line(name), reason
        logging.getLogger("gamms").warning("The entry %r cannot play: %s", *words)
    return not_ready, next(iter(trials.values())).not_enforced


def _refuse_other(where: Path, game: Mapping[str, Any]) -> None:
    """Check that a folder has no tournament, or this one."""
    try:
        before = json_in(where / MANIFEST, "the file of a tournament", dict[str, Any])
    except FileNotFoundError:
        return
    changed = [key for key, value in {"format": _FORMAT, **game}.items() if before.get(key) != value]
    if changed:
        raise WriteConflict(f"{str(where)!r} has a tournament with another {changed[0]}. Choose another folder.")


class _Runner:
    """Hands out games, round by round, and collects rows."""

    def __init__(
        self,
        settings: Settings,
        executor: Executor,
        workers: int | None,
        journal: Journal,
        game: Mapping[str, Any],
    ) -> None:
        self._settings, self._executor, self._journal, self._game = (
            pickle.dumps(settings),
            executor,
            journal,
            dict(game),
        )
        self._slots = 1 if isinstance(executor, Here) else 2 * (workers or cores())
        self._spare: WorkerPool | None = None
        self._workers = workers or cores()

    def tried(self, entries: Sequence[Entry], sides: tuple[str, str], seed: int) -> dict[str, Trial]:
        """Return what a trial of each entry shows, by its name."""
        keeps = isinstance(self._executor, Here | WorkerPool)
        futures = {
            one.name: self._asked(partial(trial, self._settings, one, sides, seed, keeps_launchers=keeps))
            for one in entries
        }
        return {name: result_of(future) for name, future in futures.items()}

    def play(self, entries: list[Entry], sides: tuple[str, str], seeds: list[int], rounds: int | None) -> Table:
        """Play all rounds, and return the table."""
        names, rows = [entry.name for entry in entries], list[Row]()
        met: set[frozenset[str]] = set()
        with progress() as show:
            for number in range(1, (rounds or 1) + 1):
                pairs = list(combinations(entries, 2)) if rounds is None else _swiss(entries, Table(rows, names), met)
                met |= {frozenset((first.name, second.name)) for first, second in pairs}
                fixtures = {
                    pair: [
                        self._fixture(way, sides, seed, number) for seed in seeds for way in (pair, (pair[1], pair[0]))
                    ]
                    for pair in pairs
                }
                for done, total in self._play(fixtures):
                    show(f"{done:,} of {total:,} games" + (f" of round {number}" if rounds else ""))
                known: Mapping[str, Any] = self._journal.rows
                some = [one for fixtures_of in fixtures.values() for one in fixtures_of]
                rows += [Row(**{**known[one.id], "round": one.round}) for one in some]  # type: ignore[typeddict-item] # as written
        return Table(rows, names)

    def _fixture(self, pair: _Pair, sides: tuple[str, str], seed: int, number: int) -> Fixture:
        by_side = dict(zip(sides, pair, strict=True))
        digests = {side: [one.name, one.digest] for side, one in by_side.items()}
        id = row_id(self._game["scenario"], {**self._game, "entries": digests}, (), seed)
        return Fixture(id, {side: one.name for side, one in by_side.items()}, seed, number)

    def _play(self, fixtures: Mapping[_Pair, list[Fixture]]) -> Iterator[tuple[int, int]]:
        """Play the games that have no row yet; yield how many are done."""
        total, waiting = sum(map(len, fixtures.values())), dict[Future[list[Row]], tuple[Task, int]]()
        tasks = iter(self._tasks(fixtures))
        done = total - sum(one.id not in self._journal.rows for some in fixtures.values() for one in some)
        while True:
            while len(waiting) < self._slots and (task := next(tasks, None)) is not None:
                waiting[self._asked(partial(play, task))] = task, 1
            if not waiting:
                return
            for future in first_done(waiting):
                task, attempts = waiting.pop(future)
                try:
                    rows = future.result()
                except BrokenExecutor:  # the process was killed: its games follow from their seeds alone
                    if attempts == _ATTEMPTS:
                        raise
                    waiting[self._asked(partial(play, task))] = task, attempts + 1
                else:
                    self._journal.add(dict(row) for row in rows)
                    done += len(rows)
                    yield done, total

    def _tasks(self, fixtures: Mapping[_Pair, list[Fixture]]) -> Iterator[Task]:
        for pair, some in fixtures.items():
            new = [one for one in some if one.id not in self._journal.rows]
            for first in range(0, len(new), _GAMES_OF_A_TASK):
                games = tuple(new[first : first + _GAMES_OF_A_TASK])
                yield Task(self._settings, pair, games, isinstance(self._executor, Here | WorkerPool))

    def _asked(self, function: Callable[[], T]) -> Future[T]:
        try:
            return self._executor.submit(function)
        except BrokenExecutor:  # one of the caller's, whose workers have died
            self._spare = self._spare or WorkerPool(self._workers)
            self._executor = self._spare
            return self._executor.submit(function)

    def close(self, *, is_own: bool) -> None:
        """End what plays, and close the journal."""
        close_launchers()
        if is_own:
            self._executor.shutdown(cancel_futures=True)
        if self._spare is not None:
            self._spare.shutdown(cancel_futures=True)
        self._journal.close()


def _swiss(entries: Sequence[Entry], table: Table, met: set[frozenset[str]]) -> list[_Pair]:
    """Return who plays whom in the next round: neighbours in the table who have not met yet, from above.

    With an odd number, or where all that are left have met, some do not play.
    """
    known = {entry.name: entry for entry in entries}
    waiting, pairs = [known[one.entry] for one in table.standings()], []
    while waiting:
        first = waiting.pop(0)
        second = next((one for one in waiting if frozenset((first.name, one.name)) not in met), None)
        if second is not None:
            waiting.remove(second)
            pairs.append((first, second))
    return pairs
