"""`gamms tournament`: a tournament as a file says, its table on the terminal and its page in a folder."""

from pathlib import Path
from typing import Annotated, Any

import typer

from gamms.cli.many import checked_keys
from gamms.cli.output import echo

_REQUIRED = ("scenario", "entries", "seeds")
_KEYS = (*_REQUIRED, "move_seconds", "memory_mb", "sides", "rounds", "record", "allow")


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
) -> None:
    """Let entries play each other, confined."""
    from gamms import scenario, tournament
    from gamms.experiment.files import seeds_of
    from gamms.scenario import documents
    from gamms.workers import cores

    with documents.named(file):
        values: Any = checked_keys(file, documents.read(file), "tournament", _REQUIRED, _KEYS)
        given = values.pop("seeds")
        with documents.at("seeds"):
            seeds = range(given) if isinstance(given, int) else seeds_of(given)
    folder = file.absolute().parent
    game = scenario.load(folder / values.pop("scenario"), values.pop("allow", ()))
    table = tournament.run(game, seeds=seeds, out=out, workers=workers or cores(), folder=folder, **values)
    echo(str(table))
    echo(f"\nWrote {out / 'index.html'} (all results), {out / 'games'} (recordings; gamms replay, gamms render).")
