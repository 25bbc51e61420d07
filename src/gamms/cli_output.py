"""What the commands have in common: errors as sentences, tables, the recording of a game."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import typer
from rich.console import Console
from rich.table import Table

from gamms.errors import GammsError

RECORDING = "game.ggr"


@contextmanager
def one_sentence() -> Iterator[None]:
    """Our own errors are sentences, also where the command is called by another program."""
    try:
        yield
    except (GammsError, OSError) as error:
        typer.echo(f"gamms: {error}", err=True)
        raise typer.Exit(1) from None


def console() -> Console:
    """Where commands print what has style."""
    return Console(highlight=False, soft_wrap=True)


def rich_table(header: tuple[str, ...], rows: Iterable[tuple[str, ...]], *, right: bool = True) -> Table:
    """A table without lines; all columns but the first are to the right."""
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for i, title in enumerate(header):
        table.add_column(title, justify="right" if i and right else "left")
    for row in rows:
        table.add_row(*row)
    return table


@contextmanager
def recorded(ctx: Any, folder: Path) -> Iterator[Path]:
    """Record what happens in a context into a folder, in the place of what was recorded there before."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / RECORDING
    path.unlink(missing_ok=True)
    ctx.record.start(path)
    try:
        yield path
    finally:
        ctx.record.stop()
