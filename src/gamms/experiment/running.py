"""Run an experiment: hand out its games, and repeat or report games that raise or kill their process.

Games are played in this process, in worker processes, or by an executor of the caller, such as Ray's.
"""

import logging
import os
import time
from collections import deque
from collections.abc import Callable, Collection, Iterable, Iterator
from concurrent.futures import BrokenExecutor, Executor, Future
from contextlib import ExitStack
from functools import partial
from importlib.util import find_spec
from itertools import product
from numbers import Integral
from typing import Any, NamedTuple, ParamSpec, TypeVar

from gamms.arguments import as_bool, as_count, as_function_of, as_ids, as_mapping, as_path, explain_call_errors
from gamms.errors import BadType, BadValue, MissingExtra, WriteConflict
from gamms.experiment import folders
from gamms.experiment.games import (
    Collect,
    ExperimentSettings,
    FinishedTask,
    Row,
    Series,
    Task,
    VariantPlayer,
    pickle_value,
    play,
)
from gamms.experiment.rows import Rows
from gamms.experiment.sampling import Sample
from gamms.experiment.variants import (
    Variant,
    Vary,
    compute_digest,
    compute_row_id,
    hash_code,
    hash_function,
    list_undeclared,
    make_variants,
    watch_files,
)
from gamms.experiment.verification import Provenance
from gamms.folders import lock_folder
from gamms.limits import max_memory, refuse_above
from gamms.plain import as_json, to_plain
from gamms.progress import Show
from gamms.progress import show_progress as progress_line
from gamms.scenario import Scenario
from gamms.scenario import load as load_scenario
from gamms.scenario.code import forget_modules
from gamms.scenario.scenario import from_plain
from gamms.text import make_printable_line, remove_addresses, shown
from gamms.versions import versions
from gamms.workers import WorkerDied, WorkerPool, count_cores, refuse_in_worker, wait_for_first

P = ParamSpec("P")
T = TypeVar("T")

_BYTES = 3_000  # bytes of a row
_TASK_S = 2.0  # target duration of a task
_MOST_GAMES = 1024  # games in a task
_PARTS = 8  # number of parts into which a task is split after its process died
_FEW_FILES = 8  # that a warning names
_FIRST_GAMES = 4  # games in the first tasks, when their duration is unknown


class _GamePlan(NamedTuple):
    """All games of an experiment."""

    scenario: Scenario
    variants: list[Variant]
    digests: list[str]
    seeds: list[int]
    collect: dict[str, Any]
    code: dict[str, str]  # the files of code in the folder of the scenario, and their SHA-256
    undeclared: set[str]  # other files there that were opened while digests were computed
    sample: tuple[list[str], int] | None  # keys and n of a sample for Sobol indices

    def list_ids(self) -> list[str]:
        """Return the ids of all rows, in order."""
        collectors = self.list_collectors()
        return [
            compute_row_id(digest, variant.settings, collectors, seed)
            for (digest, variant), seed in product(zip(self.digests, self.variants, strict=True), self.seeds)
        ]

    def list_collectors(self) -> list[str]:
        """Return the names of collectors with the SHA-256 of their functions."""
        return [f"{name} {hash_function(function)}" for name, function in self.collect.items()]

    def list_keys(self) -> list[str]:
        return list(self.variants[0].settings)

    def make_plain(self, ids: list[str]) -> dict[str, Any]:
        """Return the plan as plain values for its file."""
        return {
            "format": folders.FORMAT,
            "scenario": self.scenario.to_dict(),
            "keys": self.list_keys(),
            "variants": [variant.settings for variant in self.variants],
            "digests": self.digests,
            "seeds": self.seeds,
            "collect": list(self.collect),
            "collectors": self.list_collectors(),
            "sample": self.sample,
            "versions": versions(),
            "rows": ids,
            "changes": [None if one.strategies else as_json(to_plain(one.changes)) for one in self.variants],
        }


@explain_call_errors
def run(  # noqa: PLR0913 - each option is independent of the others
    scenario: Scenario | str | os.PathLike[str],
    seeds: Iterable[int],
    vary: Vary | None = None,
    *,
    workers: int | None = None,
    executor: object = None,
    out: str | os.PathLike[str] | None = None,
    shard: tuple[int, int] | str | None = None,
    collect: Collect | None = None,
    progress: bool = False,
) -> Rows:
    """Play a game for each seed of each variant of a scenario, and return a row for each; see docs/experiments.md.

    The rows do not depend on the executor, the order, or the use of batches. A game that raises becomes a row with an
    error.

    Args:
        scenario: the scenario, or its file.
        seeds: the seeds of the games of each variant.
        vary: path in the scenario, such as `teams.red.count`, or `strategies.<team>` -> its values; all combinations
            are played. A dict of values names them. Or a list of variants, each a dict of path -> value, such as
            `sample` returns.
        workers: the number of worker processes; None: play in this process.
        executor: plays instead: any executor of `concurrent.futures`, or "ray". `workers` is the number of tasks that
            it gets at once.
        out: a folder that keeps the rows. An interrupted run continues there: games with a row are not played again.
        shard: plays only a part of the games, `(3, 20)` or "3/20" for the third of 20; `merge` joins the parts.
        collect: name -> function of the result of a game, for the column `collector.<name>`.
        progress: show the progress on a line of stderr, if that is a terminal.

    Raises:
        ScenarioError, UnknownName: a key of `vary` is misspelled, or a value is not allowed for its key.
        BadType, BadValue: an argument has a wrong type or value, or cannot be sent to other processes.
        WriteConflict: another run is writing into `out`, or another version has written its rows.
    """
    refuse_in_worker()
    plan = _make_plan(scenario, seeds, vary, collect)
    chosen = get_executor(executor, workers)
    part = folders.parse_shard(shard)
    if part is not None and out is None:
        raise BadValue("A shard needs out, the folder in which merge finds its rows.")
    for variant in plan.variants:
        variant.apply_to(plan.scenario).warn_of_idle_teams(variant.strategies)
    ids = plan.list_ids()
    with ExitStack() as ending:
        if chosen[1]:
            ending.callback(chosen[0].shutdown, cancel_futures=True)
        journal = None
        folder = None
        if out is not None:
            folder = folders.find_shard_folder(as_path(out, "out"), part)
            ending.enter_context(lock_folder(folder))
            folders.refuse_first_format(folder)
            journal = folders.Journal(folder, *folders.ROW)
            folders.refuse_incomplete(folder, journal.rows, ids, plan.list_keys())
            ending.callback(journal.close)
        runner = _Runner(plan, ids, chosen[0], workers, journal)
        if folder is not None:
            folders.write_plan(folder, plan.make_plain(ids))
        runner.play(part, as_bool(progress, "progress"))
        _warn_of_undeclared(plan.undeclared)
        rows = [runner.rows[id] for id in ids if id in runner.rows]
        if folder is not None and part is None:
            folders.write_rows(folder, rows, plan.list_keys())
        series = partial(folders.read_series, folder) if folder is not None else runner.read_series
        source = Provenance(plan.make_plain(ids), folder)
        return Rows(rows, plan.list_keys(), plan.scenario, plan.variants, plan.sample, series, source)


def load(
    out: str | os.PathLike[str],
    *,
    scenario: Scenario | str | os.PathLike[str] | None = None,
    vary: Vary | None = None,
    folder: str | os.PathLike[str] | None = None,
    allow: Iterable[str] = (),
) -> Rows:
    """Return the rows in the folder of an experiment, even if it has not ended.

    Reading the rows runs no code. Playing a game again follows the plan in the folder. The plan may name code, but only
    code of GAMMS is used unless you allow more.

    Args:
        out: the folder.
        scenario: the scenario of the experiment, if functions were varied; None: that of the plan.
        vary: the variations of this scenario.
        folder: the folder of the code and maps that the plan names; None: no folder.
        allow: installed packages whose functions the plan may name.

    Raises:
        BadFile: it is not the folder of an experiment.
    """
    where = as_path(out, "out")
    plan, rows = folders.read_rows(where)
    if scenario is None:
        own: Scenario | Callable[[], Scenario] = partial(from_plain, plan["scenario"], folder, None, tuple(allow))
        changes = plan.get("changes", ())
        variants = [
            Variant(settings, change, {})
            for settings, change in zip(plan["variants"], changes, strict=False)
            if change is not None
        ]
    else:
        own = _as_scenario(scenario)
        variants = make_variants(own, vary)
    series = partial(folders.read_series, where)
    return Rows(rows, plan["keys"], own, variants, plan["sample"], series, Provenance(plan, where))


def _as_scenario(given: Scenario | str | os.PathLike[str]) -> Scenario:
    if isinstance(given, Scenario):
        return given
    if not isinstance(given, (str, os.PathLike)):
        raise BadType(f"scenario must be a Scenario or a file, not {shown(given)}.")
    return load_scenario(given)


def _make_plan(scenario: object, seeds: Iterable[int], vary: Vary | None, collect: object) -> _GamePlan:
    given = _as_scenario(scenario)  # type: ignore[arg-type] # which is checked there
    if given.spec.files and given.folder:
        forget_modules(given.folder)  # which may have read these files
    base = given.replace()  # with the code of now
    if isinstance(seeds, Integral):
        raise BadType(
            f"seeds must be integers: [{int(seeds)}] for the one seed, range({max(int(seeds), 2)}) for the first ones."
        )
    chosen = as_ids(seeds, "seeds")
    if not chosen or len(set(chosen)) < len(chosen):
        raise BadValue(f"seeds must be different integers, at least one, not {shown(chosen)}.")
    variants = make_variants(base, vary)
    count = len(variants) * len(chosen)
    refuse_above(count * _BYTES, f"An experiment of {count:,} games ({len(variants):,} variants)")
    wanted = dict(as_mapping({} if collect is None else collect, "collect"))
    for name, function in wanted.items():
        if not isinstance(name, str):
            raise BadType(f"collect is a dict of names and functions of a result, not {shown(wanted)}.")
        as_function_of(function, f"{name!r} of collect", "a result")
    code = hash_code(base.folder)
    undeclared = set[str]()
    digests = []
    for variant in variants:
        one = variant.apply_to(base)
        with watch_files() as opened:
            digests.append(compute_digest(one, variant.strategies, code))
        undeclared |= list_undeclared(one, opened)
    sample = (list(vary.keys), vary.n) if isinstance(vary, Sample) and vary.method == "sobol" else None
    return _GamePlan(base, variants, digests, chosen, wanted, code, undeclared, sample)


def _warn_of_undeclared(files: Collection[str]) -> None:
    """Log a warning that lists files which games have read, and digests do not cover."""
    if files:
        logging.getLogger("gamms").warning(
            "Games have opened %s, which the digests of rows do not cover: name files that decide under files: in the "
            "scenario, so that games are played again when they change.",
            make_printable_line(", ".join(sorted(files)[:_FEW_FILES])),
        )


class _PendingGames(NamedTuple):
    """Games of one variant that wait to be played."""

    variant: int
    seeds: tuple[int, ...]


class _Runner:
    """Hands out tasks and collects rows."""

    def __init__(
        self, plan: _GamePlan, ids: list[str], executor: Executor, workers: int | None, journal: folders.Journal | None
    ) -> None:
        self._plan = plan
        self._ids = ids
        self._executor = executor
        self._workers = workers
        self._journal = journal
        self.rows: dict[str, Row] = {} if journal is None else dict(journal.rows)
        self._series: dict[str, list[folders.SeriesLine]] = {}  # by row, without a folder
        self._refuse_other_versions()
        self._settings, self._variants = self._pickle_inputs()
        self._queue: deque[_PendingGames] = deque()
        self._waiting: dict[
            Future[FinishedTask], tuple[_PendingGames, bool]
        ] = {}  # games of each task, and whether the task runs in a process of its own
        self._alone: WorkerPool | None = None
        self._pools = ExitStack()
        self._players: dict[int, VariantPlayer] = {}  # player of the variant that is played in this process
        self._places = {seed: place for place, seed in enumerate(plan.seeds)}
        self._seconds: dict[int, float] = {}  # variant -> seconds per game in its last task

    def _refuse_other_versions(self) -> None:
        present = versions()
        for id in self._ids:
            row = self.rows.get(id)
            if row is not None and {name: row[name] for name in present} != present:
                old = make_printable_line(
                    ", ".join(f"{name} {row[name]}" for name in present if row[name] != present[name])
                )
                raise WriteConflict(f"Games in this folder were played by {old}: choose another folder.")

    def _pickle_inputs(self) -> tuple[bytes, list[bytes]]:
        """Pickle all data for workers before any of them starts; return nothing for this process."""
        plan = self._plan
        if isinstance(self._executor, InProcessExecutor):
            return b"", []
        for variant in plan.variants:
            for of, strategy in variant.strategies.items():
                pickle_value(strategy, f"strategies.{of} of vary, {remove_addresses(shown(strategy))},")
        for name, function in plan.collect.items():
            pickle_value(function, f"The function {name!r} of collect, {remove_addresses(shown(function))},")
        shared = pickle_value(self._make_settings(), "The scenario")
        return shared, [pickle_value(variant, "A variant") for variant in plan.variants]

    # -- the games ------------------------------------------------------------------------------------------------

    def play(self, shard: tuple[int, int] | None, is_shown: bool) -> None:
        """Play all games of a shard that have no row yet."""
        wanted = self._list_missing_games(shard)
        total = sum(len(games.seeds) for games in wanted)
        begin = time.monotonic()
        self._queue.extend(wanted)
        before = len(self.rows)
        with self._pools, progress_line() as show:
            while self._queue or self._waiting:
                self._hand_out()
                self._collect()
                if is_shown:
                    _show(show, len(self.rows) - before, total, time.monotonic() - begin)

    def _list_missing_games(self, shard: tuple[int, int] | None) -> list[_PendingGames]:
        number, count = shard or (1, 1)
        known = set(self.rows)
        found = []
        seeds = self._plan.seeds
        for variant in range(len(self._plan.variants)):
            places = range(variant * len(seeds), (variant + 1) * len(seeds))
            new = [place for place in places if place % count == number - 1 and self._ids[place] not in known]
            known |= {self._ids[place] for place in new}
            if new:
                found.append(_PendingGames(variant, tuple(seeds[place - places.start] for place in new)))
        return found

    def _hand_out(self) -> None:
        slots = 1 if isinstance(self._executor, InProcessExecutor) else 2 * (self._workers or count_cores())
        while self._queue and len(self._waiting) < slots:
            games = self._queue.popleft()
            per_game = self._seconds.get(games.variant)
            size = _FIRST_GAMES if per_game is None else int(_TASK_S / max(per_game, 1e-9))
            size = max(1, min(size, _MOST_GAMES, -(-len(games.seeds) // slots)))
            if len(games.seeds) > size:
                self._queue.appendleft(games._replace(seeds=games.seeds[size:]))
                games = games._replace(seeds=games.seeds[:size])
            self._submit(games)

    def _submit(self, games: _PendingGames) -> None:
        try:
            future = self._submit_to(self._executor, games)
        except BrokenExecutor:  # the workers of the caller's executor have died
            self._executor = self._make_pool()
            future = self._submit_to(self._executor, games)
        self._waiting[future] = games, False

    def _submit_to(self, executor: Executor, games: _PendingGames) -> Future[FinishedTask]:
        if isinstance(executor, InProcessExecutor):
            if games.variant not in self._players:
                self._players = {
                    games.variant: VariantPlayer(self._make_settings(), self._plan.variants[games.variant])
                }
            return executor.submit(self._players[games.variant].play, games.seeds)
        return executor.submit(play, Task(self._settings, self._variants[games.variant], games.seeds))

    def _make_settings(self) -> ExperimentSettings:
        plan = self._plan
        return ExperimentSettings(plan.scenario, plan.collect, max_memory(), plan.code)

    def _make_pool(self, *, is_fresh: bool = False) -> WorkerPool:
        pool = WorkerPool(1 if is_fresh else self._workers or count_cores(), is_fresh=is_fresh)
        self._pools.callback(pool.shutdown, cancel_futures=True)
        return pool

    def _collect(self) -> None:
        """Store the rows of finished tasks; play games again whose process died."""
        for future in wait_for_first(self._waiting):
            games, is_alone = self._waiting.pop(future)
            try:
                played = future.result()
            except BrokenExecutor as error:
                self._play_again(games, str(error), is_alone=is_alone)
            else:
                self._seconds[games.variant] = played.seconds / len(games.seeds)
                self._plan.undeclared.update(played.undeclared)
                self._note(games, played.rows, played.series)

    def _play_again(self, games: _PendingGames, why: str, *, is_alone: bool) -> None:
        """Play games whose process died in smaller parts, then each in its own process, then give up."""
        if is_alone:
            self._note(games, [{"error": f"WorkerDied: {why}"}], [{}])
        elif len(games.seeds) > _PARTS:
            self._queue.extendleft(games._replace(seeds=games.seeds[part::_PARTS]) for part in range(_PARTS))
        else:
            if self._alone is None:
                self._alone = self._make_pool(is_fresh=True)
            for seed in games.seeds:
                one = games._replace(seeds=(seed,))
                self._waiting[self._submit_to(self._alone, one)] = one, True

    def _note(self, games: _PendingGames, played: list[Row], collected: list[Series]) -> None:
        plan = self._plan
        rows = []
        lines = list[folders.SeriesLine]()
        first = games.variant * len(plan.seeds)
        variant = plan.variants[games.variant]
        for seed, row, series in zip(games.seeds, played, collected, strict=True):
            id = self._ids[first + self._places[seed]]
            named = {"id": id, "scenario": plan.digests[games.variant], **versions(), **variant.settings, "seed": seed}
            rows.append({**named, **row})
            self.rows[id] = rows[-1]
            of_game = [*folders.list_series_lines(id, series)]
            lines += of_game
            if self._journal is None:
                self._series[id] = of_game
        if self._journal is not None:
            self._journal.add(rows, lines)

    def read_series(self, ids: Iterable[str]) -> Iterator[folders.SeriesLine]:
        """Yield the collected values of the games of some rows; see `folders.read_series`."""
        for id in ids:
            yield from self._series.get(id, ())


def _show(show: Show, done: int, total: int, seconds: float) -> None:
    left = seconds / done * (total - done) if done else 0.0
    show(f"{done:,} of {total:,} games, {left // 60:.0f}:{left % 60:02.0f} left")


# -- executors --------------------------------------------------------------------------------------------------------


def get_executor(given: object, workers: int | None) -> tuple[Executor, bool]:
    """Return the executor of a run, and whether the run has to shut it down.

    Raises:
        BadType, BadValue: `given` is not an executor.
        MissingExtra: Ray is not installed.
    """
    if isinstance(given, Executor):
        return given, False
    if given == "ray":
        return _make_ray_executor(), True
    if isinstance(given, str):
        raise BadValue(f"executor must be an executor of concurrent.futures or 'ray', not {shown(given)}.")
    if given is not None:
        raise BadType(f"executor must be an executor of concurrent.futures or 'ray', not {shown(given)}.")
    return (InProcessExecutor(), False) if workers is None else (WorkerPool(as_count(workers, "workers")), True)


class InProcessExecutor(Executor):
    """Runs each function in this process, as soon as it is submitted."""

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Call a function now, and return its finished future."""
        future: Future[T] = Future()
        future.set_result(fn(*args, **kwargs))
        return future


def _make_ray_executor() -> Executor:
    """Return an executor of the connected Ray cluster, or of a new one on this machine."""
    if find_spec("ray") is None:
        raise MissingExtra('executor="ray"', "ray")
    import ray

    is_own = not ray.is_initialized()
    if is_own:
        ray.init(log_to_driver=False, include_dashboard=False)

    class OnRay(Executor):
        def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
            asked = ray.remote(max_retries=0)(fn).remote(*args, **kwargs).future()
            future: Future[T] = Future()
            asked.add_done_callback(lambda done: _pass_on(done, future, ray.exceptions.WorkerCrashedError))
            return future

        def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:  # noqa: ARG002 - of the class
            if is_own:
                ray.shutdown()

    return OnRay()


def _pass_on(done: Future[T], future: Future[T], crash: type[BaseException]) -> None:
    error = done.exception()
    if error is None:
        future.set_result(done.result())
    else:
        future.set_exception(WorkerDied("the process that played it ended") if isinstance(error, crash) else error)
