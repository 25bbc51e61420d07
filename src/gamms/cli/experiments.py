"""The commands that play many games by a file or a protocol: `gamms experiment`, `gamms suite`, `gamms tournament`."""

import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gamms.cli.many import check_keys
from gamms.cli.output import INTERRUPTED, echo, join_names, warn
from gamms.cli.play import Allow, KeyVariable, find_foreign_code
from gamms.errors import BadFile, GammsError, MissingExtra, install_command
from gamms.folders import make_folder, write_whole
from gamms.text import make_printable_line

if TYPE_CHECKING:
    from gamms.experiment import Rows, Verification
    from gamms.suite import Results

_MOST_VARIANTS = 40  # that are shown one by one
_MOST_FAULTS = 100  # that are printed
_MOST_UNPLAYABLE = 3  # rows that are named
_UNPLAYABLE = 3  # the exit code of verify if drawn rows cannot be played again
_UNREADABLE = 2  # the exit code of verify if the folder cannot be read, and not because it was damaged
_ALTERED = 0.1  # the share of altered rows for which verify prints the probability that it misses all of them
_REQUIRED = ("scenario", "entries", "seeds")  # of a tournament
_KEYS = (*_REQUIRED, "move_seconds", "memory_mb", "sides", "rounds", "record", "allow")


def run(
    file: Annotated[Path, typer.Argument(help="An experiment: YAML or JSON.", metavar="FILE", show_default=False)],
    out: Annotated[
        Path | None,
        typer.Option(
            help="The folder for the rows; by default that of the file, or FILE-results. A run that was ended goes on "
            "there.",
            metavar="FOLDER",
        ),
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option(
            min=0,
            help="In how many processes; 0: in this one. By default as the file says, or as many as cores.",
            metavar="N",
        ),
    ] = None,
    seeds: Annotated[
        str | None, typer.Option(help="Other seeds than those of the file: 0:50 or 1,2,5.", metavar="SEEDS")
    ] = None,
    shard: Annotated[
        str | None,
        typer.Option(help="Play only a part, 3/20 for the third of 20; merge puts them together.", metavar="PART"),
    ] = None,
    allow: Allow = None,
    key_variable: KeyVariable = None,
) -> None:
    """Play each variant with each seed, or continue an interrupted run."""
    from gamms import experiment
    from gamms.experiment.files import parse_seeds, read_experiment
    from gamms.experiment.folders import JOURNAL, find_shard_folder, parse_shard, read_journal
    from gamms.workers import count_cores

    planned = read_experiment(file, allow or (), key_variable)
    folder = out or planned.out or Path(f"{file.stem}-results")
    folder = folder.relative_to(Path.cwd()) if folder.is_relative_to(Path.cwd()) else folder
    part = find_shard_folder(folder, parse_shard(shard))
    for line in find_foreign_code(planned.scenario, {}):
        echo(f"imports {make_printable_line(line)}")
    warn(planned.scenario)
    before = len(read_journal(part / JOURNAL))
    if before:
        echo(f"{part} already has {before:,} games; the run continues from there.")
    with _explain_interrupt(part, lambda: len(read_journal(part / JOURNAL))):
        rows = experiment.run(
            planned.scenario,
            planned.seeds if seeds is None else parse_seeds(seeds),
            planned.vary,
            workers=(planned.workers or count_cores()) if workers is None else workers or None,
            out=folder,
            shard=shard,
            progress=True,
        )
    _print_rows(rows)
    if shard is not None:
        echo(f"\nWrote {part / JOURNAL}; when all parts are played: gamms experiment merge {folder}")
        return
    _print_root(rows)
    written = [one for one in sorted(folder.glob("rows.*")) if one.suffix in (".csv", ".jsonl", ".parquet")]
    missing = "" if len(written) > 2 else f" For rows.parquet: {install_command('parquet')}."
    echo(f"\nWrote {join_names(written)}.{missing}")


@contextmanager
def _explain_interrupt(folder: Path, count: Callable[[], int]) -> Iterator[None]:
    """Print after Ctrl-C in a `with` block how many games are in the folder, and that the command continues there."""
    try:
        yield
    except KeyboardInterrupt:
        echo(f"Interrupted with {count():,} games in {folder}; the same command goes on.", err=True)
        raise typer.Exit(INTERRUPTED) from None


def merge(
    out: Annotated[Path, typer.Argument(help="The folder of the experiment.", metavar="FOLDER", show_default=False)],
    shards: Annotated[
        list[Path] | None,
        typer.Argument(
            help="The folders of the shards; by default those in FOLDER.", metavar="[SHARD]...", show_default=False
        ),
    ] = None,
) -> None:
    """Put the rows of shards together into the files of one run."""
    from gamms import experiment

    written = experiment.merge(out, shards or None)
    rows = experiment.load(out)
    _print_digest(rows)
    _print_root(rows)
    echo(f"\nWrote {join_names(written)}.")


def verify(
    folder: Annotated[Path, typer.Argument(help="The folder of the experiment.", metavar="FOLDER", show_default=False)],
    root: Annotated[
        str | None,
        typer.Option(help="The published root. Without it the folder is only compared with itself.", metavar="DIGEST"),
    ] = None,
    sample: Annotated[
        int | None,
        typer.Option(
            min=0,
            help="How many games are played again. By default 10 if --root is given, otherwise none: playing runs the "
            "code that the folder names.",
            metavar="K",
            show_default=False,
        ),
    ] = None,
    seed: Annotated[int, typer.Option(help="Another seed draws other games.", metavar="N")] = 0,
    code: Annotated[
        Path | None,
        typer.Option(help="The folder of the code and maps of the scenario.", metavar="FOLDER", show_default=False),
    ] = None,
    allow: Allow = None,
) -> None:
    """Check a folder by its published root; exit code 1 if it was damaged.

    The exit code is 2 if it cannot be read for another reason.
    The exit code is 3 if nothing differs, but drawn games cannot be played again with the code that is there.
    """
    from gamms import experiment
    from gamms.experiment.folders import PLAN

    try:
        found = experiment.load(folder, folder=code, allow=allow or ()).verify(root, sample=sample, seed=seed)
    except (GammsError, OSError) as error:
        is_damaged = isinstance(error, BadFile) and (folder / PLAN).is_file()
        echo(f"tampered or damaged: {error}" if is_damaged else f"gamms: {error}", err=True)
        raise typer.Exit(1 if is_damaged else _UNREADABLE) from None
    for note in found.notes:
        echo(f"note: {note}")
    for fault in found.faults[:_MOST_FAULTS]:
        echo(fault, err=True)
    if found.faults:
        more = len(found.faults) - _MOST_FAULTS
        is_altered = root is not None and found.root != root.strip().lower()
        echo(f"tampered or damaged: {_name_damaged(folder, found.faults, is_altered=is_altered)}", err=True)
        echo(f"{folder}: no{f', and {more:,} faults more' if more > 0 else ''}.", err=True)
        raise typer.Exit(1)
    answer = "yes" if found.is_valid else "cannot be played again"
    covered = "is the root" if root is not None else "is its root, which nothing was compared with"
    echo(f"{folder}: {answer}. {found.root} {covered}; the files that follow from its {found.rows:,} rows are right.")
    if found.unplayable:
        _print_unplayable(found, folder)
        raise typer.Exit(_UNPLAYABLE)
    if found.played:
        chance = found.miss_probability(_ALTERED)
        echo(
            f"{len(found.played):,} games played again are equal. If a tenth of the rows were altered, they would miss "
            f"all of them with probability {chance:.2g}."
        )


def _name_damaged(folder: Path, faults: Sequence[str], *, is_altered: bool) -> str:
    """Return the files that faults name; those that the root covers, if it is another one or faults name no file."""
    from gamms.experiment.folders import JOURNAL, PLAN, SERIES, list_files

    files = list_files(folder)
    named = [one for one in files if any(one.as_posix() in fault for fault in faults)]
    covered = [one for one in files if one.name in (PLAN, JOURNAL, SERIES) or one.suffix == ".ggr"]
    found = {*named, *covered} if is_altered or not named else named
    return make_printable_line(" or ".join(sorted(one.as_posix() for one in found)))


def _print_unplayable(found: "Verification", folder: Path) -> None:
    """Print why games were not played again, and how they can be."""
    for sentence in found.unplayable[:_MOST_UNPLAYABLE]:
        echo(sentence, err=True)
    played = len(found.played)
    unplayable = len(found.unplayable)
    echo(
        f"Of {played + unplayable:,} drawn games, {played:,} are equal and {unplayable:,} were not played. For code "
        "and maps of the scenario, give --code and --allow. For functions that a program passed, call in Python "
        f"experiment.load({str(folder)!r}, scenario=…, vary=…).verify({found.root!r}). "
        "--sample 0 checks only the files.",
        err=True,
    )


def pack(
    folder: Annotated[Path, typer.Argument(help="The folder of the experiment.", metavar="FOLDER", show_default=False)],
    file: Annotated[Path, typer.Argument(help="The file to write.", metavar="FILE.zip", show_default=False)],
) -> None:
    """Make one file of the folder of an experiment."""
    from gamms import experiment

    count = experiment.pack(folder, file)
    echo(f"Wrote {file}, with {count:,} files.")


def unpack(
    file: Annotated[Path, typer.Argument(help="A file that pack wrote.", metavar="FILE.zip", show_default=False)],
    folder: Annotated[Path, typer.Argument(help="A new folder.", metavar="FOLDER", show_default=False)],
) -> None:
    """Restore the folder of an experiment. No code is run, and nothing is written outside of the folder."""
    from gamms import experiment

    count = experiment.unpack(file, folder)
    echo(f"Wrote {count:,} files into {folder}.")


def _print_rows(rows: "Rows") -> None:
    """Print a summary, and the number of games that raised errors."""
    try:
        metrics = [name for name in rows.metrics() if not name.startswith("collector.")]
        variants = {tuple(row[key] for key in rows.keys) for row in rows}
        is_few = len(variants) <= _MOST_VARIANTS
        table = rows.summary(None if is_few else [], metrics)
    except MissingExtra as error:
        echo(f"{len(rows):,} games. {error}")
    else:
        echo(str(table))
        if not is_few:
            echo(f"\nThis is of all {len(variants):,} variants together; experiment.load(…).summary() has each.")
    _print_digest(rows)
    errors = rows.errors()
    if errors:
        first = errors[0]
        echo(f"\n{len(errors):,} of {len(rows):,} games have raised; row {first['id']}: {first['error']}", err=True)


def _print_digest(rows: "Rows") -> None:
    echo(f"\nrows sha256 (without versions) {rows.sha256()}")


def _print_root(rows: "Rows") -> None:
    echo(f"root for the paper (gamms experiment verify) {rows.root()}")


def suite(
    strategy: Annotated[
        str,
        typer.Argument(
            help="Code, mine.py:strategy; a baseline, such as random_walk; or references: all baselines.",
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
    version: Annotated[int, typer.Option(help="The version of the suite.", metavar="1|2")] = 1,
    allow: Allow = None,
) -> None:
    """Play a strategy on the tasks of the benchmark suite."""
    from gamms import suite as suites
    from gamms.experiment.files import parse_seeds
    from gamms.experiment.folders import JOURNAL, read_journal
    from gamms.suite.results import measure_references
    from gamms.workers import count_cores

    count = count_cores() if workers is None else workers or None
    by_seed = None if seeds is None else parse_seeds(seeds)
    if by_seed is not None:
        echo("These are not the seeds of the protocol: do not compare them with other results.")
    if strategy == "references":
        file = out / "references.json"
        with make_folder(out):
            write_whole(file, (json.dumps(measure_references(count, only, by_seed, version), indent=1) + "\n").encode())
        echo(f"Wrote {file}.")
        return
    baselines = {name for task in suites.tasks(version) for name in task.baselines}
    reference, code = (strategy, {}) if strategy in baselines else _find_strategy(strategy, allow or [])
    with _explain_interrupt(out, lambda: sum(len(read_journal(one)) for one in sorted(out.glob(f"*/{JOURNAL}")))):
        results = suites.run(
            reference, only=only, seeds=by_seed, version=version, workers=count, out=out, progress=True, **code
        )
    _print_results(results, strategy)
    file = out / "table.json"
    columns = {name: column.tolist() for name, column in results.table.items()}
    write_whole(file, (json.dumps(columns, indent=1) + "\n").encode())
    echo(f"\nWrote {file}, the rows of each task, and recordings (gamms replay).")


def _find_strategy(strategy: str, allow: list[str]) -> tuple[str, dict[str, Any]]:
    """Return the reference by which a scenario names a strategy, and the place of its code."""
    from gamms.scenario.code import find_function

    found, folder = find_function(strategy, "STRATEGY")
    package = [] if found.file is not None or found.module.startswith("gamms.") else [found.module.partition(".")[0]]
    reference = f"{found.module}:{found.function}" if found.function else found.module
    return reference, {"folder": folder, "allow": [*allow, *package]}


def _print_results(results: "Results", strategy: str) -> None:
    """Print the table, and the games that raised errors."""
    echo(f"{strategy}: the share of games that it wins, and that against the worst opponent\n")
    echo(str(results.table))
    for name, rows in results.rows.items():
        errors = rows.errors()
        if errors:
            echo(f"{name}: {len(errors)} of {len(rows)} games have raised; {errors[0]['error']}", err=True)


def tournament(
    file: Annotated[Path, typer.Argument(help="A tournament file: YAML or JSON.", metavar="FILE", show_default=False)],
    out: Annotated[
        Path, typer.Option(help="The folder for games, logs, the table and its page.", metavar="FOLDER")
    ] = Path("gamms-tournament"),
    workers: Annotated[
        int | None,
        typer.Option(
            min=1, help="How many games at once. By default as many as cores.", metavar="N", show_default=False
        ),
    ] = None,
    secret: Annotated[
        str | None, typer.Option(help="The published secret of an earlier run, to repeat its games.", metavar="SECRET")
    ] = None,
) -> None:
    """Let entries play each other, confined."""
    from gamms import scenario, tournament
    from gamms.experiment.files import parse_seeds
    from gamms.experiment.folders import JOURNAL, read_journal
    from gamms.scenario import documents
    from gamms.workers import count_cores

    with documents.name_errors(file):
        values: Any = check_keys(file, documents.read(file), "tournament", _REQUIRED, _KEYS)
        given = values.pop("seeds")
        with documents.locate_errors("seeds"):
            seeds = parse_seeds(given)
    folder = file.absolute().parent
    game = scenario.load(folder / values.pop("scenario"), values.pop("allow", ()))
    with _explain_interrupt(out, lambda: len(read_journal(out / JOURNAL))):
        table = tournament.run(
            game, seeds=seeds, out=out, workers=workers or count_cores(), folder=folder, secret=secret, **values
        )
    echo(str(table))
    echo(f"\nWrote {out / 'index.html'} (all results), {out / 'games'} (recordings; gamms replay, gamms render).")
