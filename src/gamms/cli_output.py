"""What all commands share: printing, errors as sentences, tables, and the files that a game is saved to."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, nullcontext
from functools import wraps
from inspect import Parameter, signature
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.table import Table

from gamms.errors import GammsError, MissingExtra
from gamms.limits import allowing, parse_memory
from gamms.text import printable, printable_line, reason

if TYPE_CHECKING:
    from gamms.context import Context

RECORDING = "game.ggr"
_MaxMemory = Annotated[
    str | None,
    typer.Option(help="Allow so much memory for what a file holds or declares; 2G by default.", metavar="SIZE"),
]
_PICTURE = (1400, 1600)
_MOST_ROWS = 500  # of a table that is printed
_FILMS: dict[str, dict[str, Any]] = {  # the first that can be written; under half a minute for 300 turns
    "game.mp4": {"fps": 25, "width": 700, "height": 800, "frames_per_turn": 2},
    "game.gif": {"fps": 12, "width": 560, "height": 640, "frames_per_turn": 1},
}


def bounded(command: Callable[..., None]) -> Callable[..., None]:
    """Add the option `--max-memory` to a command that reads or makes what may be large."""

    @wraps(command)
    def run(*args: object, max_memory: str | None = None, **keywords: object) -> None:
        with one_sentence(), nullcontext() if max_memory is None else allowing(parse_memory(max_memory)):
            command(*args, **keywords)

    known = signature(command)
    option = Parameter("max_memory", Parameter.KEYWORD_ONLY, default=None, annotation=_MaxMemory)
    run.__signature__ = known.replace(parameters=[*known.parameters.values(), option])  # type: ignore[attr-defined] # what typer reads
    return run


@contextmanager
def one_sentence() -> Iterator[None]:
    """Print an error of GAMMS or of a file as one sentence, and exit with code 1."""
    try:
        yield
    except (GammsError, OSError) as error:
        echo(f"gamms: {reason(error)}", err=True)
        raise typer.Exit(1) from None


def echo(text: str, *, err: bool = False) -> None:
    """Print a text with its control characters escaped."""
    typer.echo(printable(text), err=err)


class _Console(Console):
    """Prints styled texts with their control characters escaped."""

    def print(self, *objects: object, **options: Any) -> None:  # Any: the options of rich
        """Print texts, and tables of `rich_table`."""
        super().print(*(printable(one) if isinstance(one, str) else one for one in objects), **options)


def console() -> Console:
    """Return a console for styled texts and tables."""
    return _Console(highlight=False, soft_wrap=True)


def rich_table(header: tuple[str, ...], rows: Iterable[tuple[str, ...]], *, right: bool = True) -> Table:
    """Return a table without lines, all columns but the first aligned right, with the first 500 rows."""
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for i, title in enumerate(header):
        table.add_column(title, justify="right" if i and right else "left")
    every = list(rows)
    for row in every[:_MOST_ROWS]:
        table.add_row(*map(printable_line, row))
    if len(every) > _MOST_ROWS:
        table.add_row(f"and {len(every) - _MOST_ROWS:,} more")
    return table


@contextmanager
def recorded(ctx: "Context", folder: Path) -> Iterator[Path]:
    """Record a game into a folder; replaces an earlier recording there."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / RECORDING
    path.unlink(missing_ok=True)
    ctx.record.start(path, drawings=True)
    try:
        yield path
    finally:
        ctx.record.stop()


@contextmanager
def filmed(ctx: "Context", folder: Path, title: str) -> Iterator[Path | None]:
    """Film a game into a folder; yield the file, or None where the libraries for films are missing."""
    for name, options in _FILMS.items():
        try:
            film = ctx.visual.film(folder / name, **options, title=title)
        except MissingExtra:
            continue
        with film:
            yield folder / name
        return
    yield None


def save_pictures(ctx: "Context", folder: Path, title: str) -> list[Path]:
    """Save the current state as `final.svg`, and as `final.png` where Pillow is installed; return the files."""
    files = []
    for name in ("final.png", "final.svg"):
        try:
            ctx.visual.save(folder / name, *_PICTURE, title=title)
        except MissingExtra:
            continue
        files.append(folder / name)
    return files


def not_made(wanted: Iterable[Path], made: Iterable[Path | None]) -> str:
    """Return a line on the files that could not be made, and on how to install the libraries for them."""
    missing = [path for path in wanted if path not in made]
    if not missing:
        return ""
    extras = "viz,video" if any(path.name in _FILMS for path in missing) else "viz"
    return (
        f"\nNot made, for want of optional libraries: {in_words(missing)}. "
        f'To get them: pip install "gamms[{extras}]", then play again.'
    )


def in_words(files: Iterable[Path]) -> str:
    """Return the names of files, joined by "and"."""
    return " and ".join(map(str, files))
