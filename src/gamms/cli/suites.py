"""The command of the benchmark suite: `gamms suite STRATEGY`."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gamms.cli.output import echo
from gamms.cli.play import Allow
from gamms.folders import made_folder, write_whole

if TYPE_CHECKING:
    from gamms.suite import Results


def suite(
    strategy: Annotated[
        str,
        typer.Argument(
            help="Code, mine.py:strategy; a baseline: scripted, random_walk, stay; or references: all of these.",
            metavar="STRATEGY",
            show_default=False,
        ),
    ],
    out: Annotated[Path, typer.Option(help="The folder for rows, recordings and table.json.", metavar="FOLDER")] = Path(
        "gamms-suite"
    ),
    only: Annotated[list[str] | None, typer.Option("--only", help="Only this kind or task.", metavar="TASK")] = None,
    workers: Annotated[
        int | None,
        typer.Option(min=0, help="In how many processes; 0: in this one. By default as many as cores.", metavar="N"),
    ] = None,
    seeds: Annotated[
        str | None, typer.Option(help="Other seeds than those of the protocol: 0:5.", metavar="SEEDS")
    ] = None,
    allow: Allow = None,
) -> None:
    """Play a strategy on the ten tasks of the benchmark suite."""
    from gamms import suite as suites
    from gamms.experiment.files import seeds_of
    from gamms.suite.results import measured_references
    from gamms.workers import cores

    count = cores() if workers is None else workers or None
    by_seed = None if seeds is None else seeds_of(seeds)
    if by_seed is not None:
        echo("These are not the seeds of the protocol: do not compare them with other results.")
    if strategy == "references":
        file = out / "references.json"
        with made_folder(out):
            write_whole(file, (json.dumps(measured_references(count, only, by_seed), indent=1) + "\n").encode())
        echo(f"Wrote {file}.")
        return
    reference, code = _found(strategy, allow or [])
    results = suites.run(reference, only=only, seeds=by_seed, workers=count, out=out, progress=True, **code)
    _print(results, strategy)
    file = out / "table.json"
    columns = {name: column.tolist() for name, column in results.table.items()}
    write_whole(file, (json.dumps(columns, indent=1) + "\n").encode())
    echo(f"\nWrote {file}, the rows of each task, and recordings (gamms replay).")


def _found(strategy: str, allow: list[str]) -> tuple[str, dict[str, Any]]:
    """Return how a scenario names a strategy, and where its code is."""
    from gamms.scenario.code import chosen
    from gamms.suite import BASELINES

    if strategy in BASELINES:
        return strategy, {}
    found, folder = chosen(strategy, "STRATEGY")
    package = [] if found.file is not None or found.module.startswith("gamms.") else [found.module.partition(".")[0]]
    reference = f"{found.module}:{found.function}" if found.function else found.module
    return reference, {"folder": folder, "allow": [*allow, *package]}


def _print(results: "Results", strategy: str) -> None:
    """Print the table, and the games that have raised."""
    echo(f"{strategy}: the share of games that it wins, and that against the worst opponent\n")
    echo(str(results.table))
    for name, rows in results.rows.items():
        errors = rows.errors()
        if errors:
            echo(f"{name}: {len(errors)} of {len(rows)} games have raised; {errors[0]['error']}", err=True)
