"""Play a strategy on the tasks of the suite: a table with intervals and the worst case, and a replay of each task."""

import json
import os
from collections.abc import Callable, Iterable, Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import Any, NamedTuple

from gamms.arguments import as_known, as_path
from gamms.experiment import Rows, Table
from gamms.experiment import run as run_experiment
from gamms.experiment.running import get_executor
from gamms.folders import remove_link
from gamms.suite.protocol import VERSION, Task, find_task_file, make_scenario, tasks


class Results(NamedTuple):
    """The results of a strategy.

    Attributes:
        table: a row for each task: task, games, seeds, errors, mean (the share of games won) with its Wilson interval
            over seeds, worst (the share won against the worst opponent), worst_opponent, and replay: the file of the
            first game against that opponent.
        rows: task name -> the rows of its games.
    """

    table: Table
    rows: dict[str, Rows]


def run(  # noqa: PLR0913 - each option is independent of the others
    strategy: str | Callable[..., Any],
    *,
    folder: str | os.PathLike[str] | None = None,
    allow: Iterable[str] = (),
    only: Sequence[str] | None = None,
    seeds: Iterable[int] | None = None,
    version: int = VERSION,
    workers: int | None = None,
    out: str | os.PathLike[str] | None = None,
    progress: bool = False,
) -> Results:
    """Play a strategy on all tasks of the suite, and return its results.

    Args:
        strategy: a function of the state, or a function of the context that makes one, as in scenarios; a reference to
            code, such as `mine:strategy`; or the name of a baseline. `state["facts"]["task"]` describes the task.
        folder: the folder of the referenced code; None: the code is in GAMMS or in a package.
        allow: see `scenario.load`.
        only: kinds, or names of tasks; None: all.
        seeds: other seeds than the protocol's; results are then not comparable.
        version: the version of the suite.
        workers: see `experiment.run`.
        out: a folder that keeps the rows, and a recording of each task; None: keep nothing.
        progress: show the progress on a line of stderr, if that is a terminal.

    Raises:
        UnknownName (KeyError): a task does not exist.
        BadValue: the version does not exist.
        ScenarioError: the strategy does not exist.
    """
    chosen = _select_tasks(only, version)
    into = None if out is None else as_path(out, "out")
    by_seed = None if seeds is None else list(seeds)
    executor, is_own = get_executor(None, workers)
    rows = {}
    made = []
    with executor if is_own else nullcontext():
        for task in chosen:
            reference = task.baselines.get(strategy, strategy) if isinstance(strategy, str) else None
            vary: dict[str, Any] = {"map": task.maps} if task.maps else {}
            vary[f"strategies.{task.opponent}"] = task.opponents
            if callable(strategy):
                vary[f"strategies.{task.team}"] = [strategy]
            found = run_experiment(
                make_scenario(task, reference, folder=folder, allow=allow),
                task.seeds if by_seed is None else by_seed,
                vary,
                workers=workers,
                executor=executor,
                out=None if into is None else into / task.name,
                progress=progress,
            )
            rows[task.name] = found
            made.append(_measure_task(task, found, into))
    return Results(Table.of(made), rows)


def _select_tasks(only: Sequence[str] | None, version: int) -> list[Task]:
    every = tasks(version)
    wanted = [task.name for task in every] if only is None else list(only)
    known = [*dict.fromkeys(task.name.partition("-")[0] for task in every), *(task.name for task in every)]
    for one in wanted:
        as_known(one, "task", known)
    return [task for task in every if task.name in wanted or task.name.partition("-")[0] in wanted]


def _measure_task(task: Task, rows: Rows, out: Path | None) -> dict[str, Any]:
    """Return the table row of a task, and record the first game against the worst opponent."""
    drawn = f"opponent.{task.opponent}"  # the member of a pool
    key = drawn if all(row.get(drawn) is not None for row in rows) else f"strategies.{task.opponent}"
    overall = rows.summary([], [task.metric])
    against = rows.summary([key], [task.metric])
    worst = min(range(len(against[key])), key=lambda number: (against["mean"][number], number))
    name = against[key][worst]
    first = next(row for row in rows if row[key] == name)
    columns = ("games", "seeds", "errors", "mean", "low", "high")
    row = {"task": task.name, **{column: overall[column][0] for column in columns}}
    row |= {"worst": against["mean"][worst], "worst_opponent": name, "replay": first["id"]}
    if out is not None and first["error"] is None:
        file = remove_link(out / f"{task.name}.ggr")
        rows.play(first["id"], record=file)
        row["replay"] = str(file)
    return {column: value.item() if hasattr(value, "item") else value for column, value in row.items()}


def references(version: int = VERSION) -> Table:
    """Return the results of the baselines of GAMMS on the tasks of a version of the suite.

    Its columns are the baseline, and those of `Results.table` without replay.

    Raises:
        BadValue: the version does not exist.
    """
    rows: list[dict[str, Any]] = json.loads(find_task_file(version, "_references").read_text(encoding="utf-8"))
    return Table.of(rows)


def measure_references(
    workers: int | None = None,
    only: Sequence[str] | None = None,
    seeds: Iterable[int] | None = None,
    version: int = VERSION,
) -> list[dict[str, Any]]:
    """Play all baselines on the tasks like `run`; return the rows of `references`."""
    by_seed = None if seeds is None else list(seeds)
    chosen = _select_tasks(only, version)
    made = []
    for name in dict.fromkeys(name for task in chosen for name in task.baselines):
        own = [task.name for task in chosen if name in task.baselines]
        table = run(name, workers=workers, only=own, seeds=by_seed, version=version).table
        columns = [column for column in table if column != "replay"]
        made += [
            {"baseline": name, **dict(zip(columns, cells, strict=True))}
            for cells in zip(*(table[column].tolist() for column in columns), strict=True)
        ]
    return made
