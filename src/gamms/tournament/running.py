"""Run a tournament: decide who plays whom, and play every game exactly once."""

import json
import logging
import os
import pickle
import secrets
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import BrokenExecutor, Executor, Future
from functools import partial
from itertools import chain, combinations, product
from pathlib import Path
from typing import Any, Literal, NamedTuple, NotRequired, TypedDict, TypeVar

from gamms.arguments import as_bool, as_count, as_int, as_items, as_known, as_path, as_positive, as_text
from gamms.errors import BadFile, BadType, BadValue, GammsError, WriteConflict
from gamms.experiment.folders import JOURNAL, Journal, read_journal
from gamms.experiment.running import InProcessExecutor, get_executor
from gamms.experiment.variants import compute_digest, compute_row_id
from gamms.folders import lock_folder, read_bytes, read_json, refuse_link, remove_link, write_whole
from gamms.limits import max_memory, refuse_above
from gamms.progress import show_progress
from gamms.scenario import Scenario
from gamms.text import make_printable_line, shown
from gamms.tournament.entries import SCRATCH, Entry, EntrySpec, find_entries, publish
from gamms.tournament.games import MOST_TURNS, Fixture, Row, Run, hash_secret
from gamms.tournament.page import write_page
from gamms.tournament.players import ResourceLimits
from gamms.tournament.scratch import remove_folder
from gamms.tournament.table import Table
from gamms.tournament.workers import Task, TournamentSettings, TrialResult, close_launchers, play, run_trial
from gamms.versions import versions
from gamms.workers import WorkerPool, count_cores, wait_for_first, wait_for_result

MANIFEST = "tournament.json"
_FORMAT = "gamms tournament 2"
_LEAST_MB = 64
_MAP = "map.gamms"
_SUFFIX = ".secret"  # of the file that has the secret of a run until the run has ended
_SECRET_BYTES = 16
_FOLDERS = (SCRATCH, "entries", "games", "logs")
_GAMES_OF_A_TASK = 10
_ATTEMPTS = 3  # attempts at a task whose process dies
_BYTES = 3_000  # bytes of a row
T = TypeVar("T")


class _EntryKey(NamedTuple):
    """The name and the digest of an entry."""

    name: str
    digest: str


_Pair = tuple[_EntryKey, _EntryKey]


class _Manifest(TypedDict):
    """The contents of a tournament's manifest file; in format 1, seeds of games had no secret."""

    format: Literal["gamms tournament 1", "gamms tournament 2"]
    scenario: str
    sides: list[str]
    move_seconds: float
    memory_mb: int
    gamms: str
    python: str
    numpy: str
    entries: dict[str, str]
    seeds: list[int]
    rounds: int | None
    runs: NotRequired[list[Run]]
    not_enforced: list[str]
    not_ready: dict[str, str]


_GAME = ("scenario", "sides", "move_seconds", "memory_mb", "gamms", "python", "numpy")
"""Manifest keys that determine a game, besides its entries and its seed."""


class _Schedule(NamedTuple):
    """The schedule of a tournament: who plays whom.

    Attributes:
        entries: all entries, sorted by name.
        sides: the two teams that they play.
        seeds: the labels of the games of each pair of entries.
        rounds: the number of rounds of a Swiss tournament; None: every entry plays every other.
        game: the values of `_GAME`.
    """

    entries: list[_EntryKey]
    sides: tuple[str, str]
    seeds: list[int]
    rounds: int | None
    game: dict[str, Any]

    def list_fixtures(
        self, known: Mapping[str, Any], rows: list[Row]
    ) -> Iterator[tuple[int, dict[_Pair, list[Fixture]]]]:
        """Yield the fixtures of each round, then append the known rows of the round; stop after an unfinished round.

        Args:
            known: all rows by their ids; the caller adds the rows of each round to it.
            rows: receives the rows in the order of the schedule.

        Raises:
            BadFile: a row does not belong to its game.
        """
        met: set[frozenset[str]] = set()
        names = [entry.name for entry in self.entries]
        for number in range(1, (self.rounds or 1) + 1):
            if self.rounds is None:
                pairs = list(combinations(self.entries, 2))
            else:
                pairs = _pair_entries(self.entries, Table(rows, names), met)
            met |= {frozenset((first.name, second.name)) for first, second in pairs}
            fixtures = {pair: self._make_fixtures(pair, number) for pair in pairs}
            yield number, fixtures
            games = list(chain.from_iterable(fixtures.values()))
            found = [_make_row(one, known[one.id]) for one in games if one.id in known]
            rows += found
            if len(found) < len(games):
                return

    def _make_fixtures(self, pair: _Pair, number: int) -> list[Fixture]:
        first, second = pair
        return [self._make_fixture(way, seed, number) for seed, way in product(self.seeds, (pair, (second, first)))]

    def _make_fixture(self, pair: _Pair, seed: int, number: int) -> Fixture:
        by_side = dict(zip(self.sides, pair, strict=True))
        digests = {side: [one.name, one.digest] for side, one in by_side.items()}
        id = compute_row_id(self.game["scenario"], {**self.game, "entries": digests}, (), seed)
        return Fixture(id, {side: one.name for side, one in by_side.items()}, seed, number)


def _make_row(fixture: Fixture, found: Mapping[str, Any]) -> Row:
    """Return the row of a game, with the round in which it counts.

    Raises:
        BadFile: the row belongs to another game.
    """
    row: Row = {**found, "round": fixture.round}  # type: ignore[typeddict-item] # as the journal has been checked
    sides = fixture.entries.keys()
    named = {*row["faults"], *([] if row["winner"] is None else [row["winner"]])}
    if (
        row["entries"] != fixture.entries
        or row["seed"] != fixture.seed
        or row["scores"].keys() != sides
        or named - sides
    ):
        raise BadFile(f"The row {shown(fixture.id)} in {JOURNAL} is not that of its game. Delete its line.")
    return row


def run(  # noqa: PLR0913 - each option is independent of the others
    scenario: Scenario,
    *,
    entries: Mapping[str, EntrySpec],
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
    secret: str | None = None,
) -> Table:
    """Play entries against each other on both sides with the same seeds, and return the table.

    Each entry is tried before the first game. An entry that cannot play is named by a warning and in `not_ready` of
    the table, and loses its games. An interrupted tournament continues when it is run again with the same `out`, even
    after a crash. All seeds follow from a random secret, which is published with the table; games that are added later
    have another one.

    Args:
        scenario: the game.
        entries: name -> `file.py:function`, `module:function`, or a program and its arguments; see docs/tournaments.md.
        seeds: integers that label the games of each pair of entries.
        out: the folder for all files of the tournament.
        move_seconds: seconds of wall-clock time that an entry may take for a move.
        memory_mb: the memory in MiB that the process of an entry may use.
        sides: the two teams that entries play; None: the two teams of the scenario.
        rounds: the number of rounds of a Swiss tournament; None: every entry plays every other.
        workers: the number of worker processes, each of which plays one game at a time; None: play in this process.
        executor: plays instead: any executor of `concurrent.futures` on this machine, or "ray".
        record: whether to keep a recording of each game, in `out/games`.
        folder: the folder that relative paths of entries start from; None: the current folder.
        secret: the secret of an earlier run, to repeat its games, as in `table.runs`; None: a new one.

    Raises:
        BadType, BadValue: there are too few entries, sides or seeds, a limit is too low, or an entry may read
            `out`.
        UnknownName (KeyError): the scenario does not have a team of this name.
        ScenarioError (ValueError): the function of an entry does not exist, or the scenario cannot be built.
        WriteConflict (RuntimeError): another tournament was or is played in this folder.
        GammsError: the system is Windows, where entries cannot be confined.
    """
    if not hasattr(os, "fork"):
        raise GammsError("Tournaments run on Linux and macOS: Windows has no way to bound the processes of entries.")
    if not isinstance(scenario, Scenario):
        raise BadType(f"scenario must be a Scenario, as gamms.scenario.load gives it, not {shown(scenario)}.")
    where = as_path(out, "out").absolute()
    teams = _check_sides(scenario, sides)
    numbers = _check_seeds(seeds)
    base = Path.cwd() if folder is None else as_path(folder, "folder").absolute()
    allowed = _make_limits(scenario, move_seconds, memory_mb)
    number = None if rounds is None else as_count(rounds, "rounds", 1)
    games = where / "games" if as_bool(record, "record") else None
    given = None if secret is None else as_text(secret, "secret")
    chosen, is_own = get_executor(executor, workers)
    with lock_folder(where):
        for name in _FOLDERS:
            refuse_link(where / name)
        private = [one for one in (scenario.file, scenario.folder) if one is not None]
        game = {"sides": list(teams), "move_seconds": allowed.move_s, "memory_mb": memory_mb, **versions()}
        manifest = {"scenario": compute_digest(scenario), **game}
        runs = _find_runs(where, manifest)
        _check_runs(runs, read_journal(where / JOURNAL, Row).values())
        remove_folder(where / SCRATCH)  # of an interrupted tournament
        runner = None
        try:
            with scenario.build(seed=numbers[0]) as ctx:
                found = find_entries(entries, base, where, private)
                ctx.graph.save(remove_link(where / _MAP))
            plan = _Schedule([_EntryKey(one.name, one.digest) for one in found], teams, numbers, number, manifest)
            planned = {"entries": dict(plan.entries), "seeds": numbers, "rounds": number}
            key = _begin_run(where, runs, planned, given)
            settings = TournamentSettings(
                scenario, key, where / _MAP, where / SCRATCH, allowed, games, where / "logs", max_memory()
            )
            runner = _Runner(settings, chosen, workers, Journal(where, Row))
            (where / SCRATCH).mkdir(exist_ok=True)
            table = _play_run(runner, plan, found, where, {"format": _FORMAT, **manifest, **planned, "runs": runs}, key)
        finally:
            if runner is not None:
                runner.close(is_own=is_own)
            remove_folder(where / SCRATCH)
        write_page(table, where, scenario.spec.name or "Tournament")
    return table


def load(out: str | os.PathLike[str]) -> Table:
    """Return the table of the tournament in a folder, even if it has not ended, without playing games.

    Args:
        out: the folder.

    Raises:
        BadFile: the folder does not hold a tournament, or is damaged or tampered with.
        TooLarge: the tournament would take more memory than allowed.
    """
    where = as_path(out, "out")
    try:
        manifest = read_json(where / MANIFEST, "the file of a tournament", _Manifest)
    except FileNotFoundError:
        raise BadFile(f"{str(where)!r} is not the folder of a tournament: it has no {MANIFEST}.") from None
    if len(manifest["sides"]) != 2 or len(manifest["entries"]) < 2 or not manifest["seeds"]:
        raise BadFile(f"{str(where / MANIFEST)!r} must name two sides, two entries at least, and a seed at least.")
    players = [_EntryKey(name, digest) for name, digest in sorted(manifest["entries"].items())]
    rounds = manifest["rounds"]
    pairs = len(players) * (len(players) - 1) // 2 if rounds is None else len(players) // 2 * rounds
    games = 2 * pairs * len(manifest["seeds"])
    refuse_above(games * _BYTES, f"A tournament of {games:,} games")
    game = {name: manifest[name] for name in _GAME}  # type: ignore[literal-required] # of a tuple of such
    plan = _Schedule(players, (manifest["sides"][0], manifest["sides"][1]), manifest["seeds"], rounds, game)
    rows = list[Row]()
    known = read_journal(where / JOURNAL, Row)
    _check_runs(manifest.get("runs", []), known.values())
    for _ in plan.list_fixtures(known, rows):
        pass
    table = Table(rows, [one.name for one in players])
    table.runs = manifest.get("runs", [])
    table.not_enforced = manifest["not_enforced"]
    table.not_ready = manifest["not_ready"]
    return table


def _check_seeds(given: Iterable[int]) -> list[int]:
    numbers = list(dict.fromkeys(as_int(seed, "a seed") for seed in as_items(given, "seeds", "integers")))
    if not numbers:
        raise BadValue("A tournament needs one seed at least.")
    return numbers


def _check_sides(scenario: Scenario, given: Sequence[str] | None) -> tuple[str, str]:
    teams = list(scenario.spec.teams)
    if given is None and len(teams) != 2:
        raise BadValue(f"The scenario has the teams {', '.join(teams)}. Say by sides= which two of them entries play.")
    sides = teams if given is None else list(as_items(given, "sides", "two teams"))
    for one in sides:
        as_known(one, "team", teams)
    if len(sides) != 2 or sides[0] == sides[1]:
        raise BadValue(f"sides must be two teams, not {shown(given)}.")
    return sides[0], sides[1]


def _make_limits(scenario: Scenario, move_seconds: float, memory_mb: int) -> ResourceLimits:
    seconds = as_positive(move_seconds, "move_seconds")
    megabytes = as_int(memory_mb, "memory_mb")
    if megabytes < _LEAST_MB:
        raise BadValue(f"memory_mb must be at least {_LEAST_MB}, which programs take to start, not {megabytes}.")
    turns = scenario.spec.max_turns or MOST_TURNS
    return ResourceLimits(seconds, megabytes << 20, int(seconds * (turns + 10)) + 1)


def _try_entries(
    runner: "_Runner", entries: Sequence[Entry], sides: tuple[str, str], seed: int
) -> tuple[dict[str, str], list[str]]:
    """Try all entries; return why some cannot play, and the limits that this system cannot enforce."""
    trials = runner.try_entries(entries, sides, seed)
    not_ready = {name: one.reason for name, one in trials.items() if one.reason is not None}
    for name, reason in not_ready.items():
        words = make_printable_line(name), reason
        logging.getLogger("gamms").warning("The entry %r cannot play: %s", *words)
    return not_ready, next(iter(trials.values())).not_enforced


def _play_run(
    runner: "_Runner", plan: _Schedule, entries: list[Entry], where: Path, manifest: dict[str, Any], secret: str
) -> Table:
    """Try the entries and play all games, with the manifest written before, and with the secret afterwards."""
    not_ready, missing = _try_entries(runner, entries, plan.sides, plan.seeds[0])
    manifest |= {"not_enforced": missing, "not_ready": not_ready}
    write_whole(where / MANIFEST, (json.dumps(manifest, indent=1) + "\n").encode())
    table = runner.play(plan, {one.name: one for one in entries})
    table.runs = manifest["runs"]
    table.not_enforced = missing
    table.not_ready = not_ready
    publish(entries, where)
    table.runs[-1]["secret"] = secret
    write_whole(where / MANIFEST, (json.dumps(manifest, indent=1) + "\n").encode())
    for file in where.glob(f"*{_SUFFIX}"):
        file.unlink()
    return table


def _find_runs(where: Path, game: Mapping[str, Any]) -> list[Run]:
    """Return the runs of the tournament in a folder, and check that it is this one."""
    try:
        before = read_json(where / MANIFEST, "the file of a tournament", _Manifest)
    except FileNotFoundError:
        return []
    changed = [key for key, value in {"format": _FORMAT, **game}.items() if before.get(key) != value]
    if changed:
        raise WriteConflict(f"{str(where)!r} has a tournament with another {changed[0]}. Choose another folder.")
    return before.get("runs", [])


def _begin_run(folder: Path, runs: list[Run], plan: Mapping[str, Any], given: str | None) -> str:
    """Return the secret of the last run if it has this plan; else end it, append a new run and return its secret.

    Args:
        folder: the folder of the tournament.
        runs: its runs.
        plan: the keys `entries`, `seeds` and `rounds` of a `Run`.
        given: the secret that the caller gave.

    Raises:
        BadFile: the secret of an interrupted run is lost.
    """
    for last in runs[-1:]:
        file = folder / f"{last['sha256']}{_SUFFIX}"
        known = last["secret"]
        if known is None:
            known = read_bytes(file).decode(errors="replace") if file.exists() else ""
        if hash_secret(known) != last["sha256"]:
            raise BadFile(
                f"The secret of the interrupted run is not in {str(file)!r}. Put it back, or use another folder."
            )
        if {**last, **plan} == last and given in (None, known):
            return known
        last["secret"] = known
    secret = secrets.token_hex(_SECRET_BYTES) if given is None else given
    hashed = hash_secret(secret)
    file = folder / f"{hashed}{_SUFFIX}"
    file.unlink(missing_ok=True)
    with open(file, "xb", opener=partial(os.open, mode=0o600)) as stream:
        stream.write(secret.encode())
    runs.append({"sha256": hashed, "secret": None, "is_given": given is not None, **plan})  # type: ignore[typeddict-item] # the plan has the other keys
    return secret


def _check_runs(runs: Sequence[Run], rows: Iterable[Mapping[str, Any]]) -> None:
    """Check that published secrets have their SHA-256, and that each row belongs to a run.

    Raises:
        BadFile: the folder has been tampered with.
    """
    for run in runs:
        if run["secret"] is not None and hash_secret(run["secret"]) != run["sha256"]:
            raise BadFile(
                f"The secret of a run does not have its SHA-256, {shown(run['sha256'])}: tampered or damaged."
            )
    hashes: set[str | None] = {run["sha256"] for run in runs} or {None}
    for row in rows:
        if row.get("run") not in hashes:
            raise BadFile(f"The row {shown(row['id'])} belongs to no run of the tournament: tampered or damaged.")


class _Runner:
    """Hands out games, round by round, and collects rows."""

    def __init__(
        self,
        settings: TournamentSettings,
        executor: Executor,
        workers: int | None,
        journal: Journal,
    ) -> None:
        self._settings = pickle.dumps(settings)
        self._executor = executor
        self._journal = journal
        self._slots = 1 if isinstance(executor, InProcessExecutor) else 2 * (workers or count_cores())
        self._spare: WorkerPool | None = None
        self._workers = workers or count_cores()

    def try_entries(self, entries: Sequence[Entry], sides: tuple[str, str], seed: int) -> dict[str, TrialResult]:
        """Return the trial of each entry, by its name."""
        keeps = isinstance(self._executor, InProcessExecutor | WorkerPool)
        futures = {
            one.name: self._submit(partial(run_trial, self._settings, one, sides, seed, keeps_launchers=keeps))
            for one in entries
        }
        return {name: wait_for_result(future) for name, future in futures.items()}

    def play(self, plan: _Schedule, entries: Mapping[str, Entry]) -> Table:
        """Play all rounds, and return the table."""
        rows = list[Row]()
        with show_progress() as show:
            for number, fixtures in plan.list_fixtures(self._journal.rows, rows):
                for done, total in self._play(fixtures, entries):
                    show(f"{done:,} of {total:,} games" + (f" of round {number}" if plan.rounds else ""))
        return Table(rows, [one.name for one in plan.entries])

    def _play(self, fixtures: Mapping[_Pair, list[Fixture]], entries: Mapping[str, Entry]) -> Iterator[tuple[int, int]]:
        """Play the games without a row; yield the numbers of finished and of all games."""
        total = sum(map(len, fixtures.values()))
        waiting = dict[Future[list[Row]], tuple[Task, int]]()
        tasks = iter(self._list_tasks(fixtures, entries))
        done = total - sum(one.id not in self._journal.rows for one in chain.from_iterable(fixtures.values()))
        while True:
            while len(waiting) < self._slots and (task := next(tasks, None)) is not None:
                waiting[self._submit(partial(play, task))] = task, 1
            if not waiting:
                return
            for future in wait_for_first(waiting):
                task, attempts = waiting.pop(future)
                try:
                    rows = future.result()
                except BrokenExecutor:  # the process was killed: its games can be repeated from their seeds
                    if attempts == _ATTEMPTS:
                        raise
                    waiting[self._submit(partial(play, task))] = task, attempts + 1
                else:
                    self._journal.add(dict(row) for row in rows)
                    done += len(rows)
                    yield done, total

    def _list_tasks(self, fixtures: Mapping[_Pair, list[Fixture]], entries: Mapping[str, Entry]) -> Iterator[Task]:
        for (first_player, second_player), some in fixtures.items():
            pair = entries[first_player.name], entries[second_player.name]
            new = [one for one in some if one.id not in self._journal.rows]
            for first in range(0, len(new), _GAMES_OF_A_TASK):
                games = tuple(new[first : first + _GAMES_OF_A_TASK])
                yield Task(self._settings, pair, games, isinstance(self._executor, InProcessExecutor | WorkerPool))

    def _submit(self, function: Callable[[], T]) -> Future[T]:
        try:
            return self._executor.submit(function)
        except BrokenExecutor:  # the workers of the caller's executor have died
            self._spare = self._spare or WorkerPool(self._workers)
            self._executor = self._spare
            return self._executor.submit(function)

    def close(self, *, is_own: bool) -> None:
        """Shut down the workers, and close the journal."""
        close_launchers()
        if is_own:
            self._executor.shutdown(cancel_futures=True)
        if self._spare is not None:
            self._spare.shutdown(cancel_futures=True)
        self._journal.close()


def _pair_entries(entries: Sequence[_EntryKey], table: Table, met: set[frozenset[str]]) -> list[_Pair]:
    """Pair the entries for the next round: neighbors in the table that have not met yet, from the top.

    With an odd number of entries, or if all remaining entries have met, some do not play.
    """
    known = {entry.name: entry for entry in entries}
    waiting = [known[one.entry] for one in table.standings()]
    pairs = []
    while waiting:
        first = waiting.pop(0)
        second = next((one for one in waiting if frozenset((first.name, one.name)) not in met), None)
        if second is not None:
            waiting.remove(second)
            pairs.append((first, second))
    return pairs
