"""The commands of experiments: `gamms experiment FILE`, and `gamms experiment merge`."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gamms.cli.output import INTERRUPTED, echo, in_words, warn
from gamms.cli.play import Allow, foreign_code
from gamms.errors import MissingExtra, install_command
from gamms.text import printable_line

if TYPE_CHECKING:
    from gamms.experiment import Rows

_MOST_VARIANTS = 40  # that are shown one by one


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
) -> None:
    """Play each variant with each seed, or go on with it."""
    from gamms import experiment
    from gamms.experiment.files import read_experiment, seeds_of
    from gamms.experiment.folders import JOURNAL, rows_in, shard_folder, shard_of
    from gamms.workers import cores

    planned = read_experiment(file, allow or ())
    folder = out or planned.out or Path(f"{file.stem}-results")
    folder = folder.relative_to(Path.cwd()) if folder.is_relative_to(Path.cwd()) else folder
    part = shard_folder(folder, shard_of(shard))
    for line in foreign_code(planned.scenario, {}):
        echo(f"imports {printable_line(line)}")
    warn(planned.scenario)
    before = len(rows_in(part / JOURNAL))
    if before:
        echo(f"{part} has {before:,} games already; it goes on from there.")
    try:
        rows = experiment.run(
            planned.scenario,
            planned.seeds if seeds is None else seeds_of(seeds),
            planned.vary,
            workers=(planned.workers or cores()) if workers is None else workers or None,
            out=folder,
            shard=shard,
            progress=True,
        )
    except KeyboardInterrupt:
        echo(f"Interrupted with {len(rows_in(part / JOURNAL)):,} games in {part}; the same command goes on.", err=True)
        raise typer.Exit(INTERRUPTED) from None
    _print(rows)
    if shard is not None:
        echo(f"\nWrote {part / JOURNAL}; when all parts are played: gamms experiment merge {folder}")
        return
    written = [one for one in sorted(folder.glob("rows.*")) if one.suffix in (".csv", ".jsonl", ".parquet")]
    missing = "" if len(written) > 2 else f" For rows.parquet: {install_command('parquet')}."
    echo(f"\nWrote {in_words(written)}.{missing}")


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

    echo(f"Wrote {in_words(experiment.merge(out, shards or None))}.")


def _print(rows: "Rows") -> None:
    """Print a summary, and how many games have raised."""
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
    errors = rows.errors()
    if errors:
        first = errors[0]
        echo(f"\n{len(errors):,} of {len(rows):,} games have raised; row {first['id']}: {first['error']}", err=True)
