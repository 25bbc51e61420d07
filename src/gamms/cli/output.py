"""The shared parts of all commands: printing, errors, tables, and saving a game to files."""

import errno
import os
import sysconfig
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, nullcontext
from functools import wraps
from inspect import Parameter, signature
from itertools import chain, dropwhile
from pathlib import Path
from traceback import FrameSummary, StackSummary, TracebackException
from typing import TYPE_CHECKING, Annotated, Any, Unpack

import typer
from rich.console import Console
from rich.table import Table

from gamms.errors import BadValue, GammsError, MissingExtra, MissingFile, install_command
from gamms.folders import make_folder, remove_link, write_whole
from gamms.limits import allowing, parse_memory
from gamms.text import make_printable, make_printable_line, reason

if TYPE_CHECKING:
    from gamms.context import Context
    from gamms.scenario import Scenario
    from gamms.typing import PictureOptions

RECORDING = "game.ggr"
_MaxMemory = Annotated[
    str | None,
    typer.Option(help="Allow so much memory for what a file holds or declares; 2G by default.", metavar="SIZE"),
]
_Traceback = Annotated[bool, typer.Option("--traceback", help="Print errors with all that Python knows of them.")]
_GAMMS = str(Path(__file__).parents[1])
_FINE = 192.0  # pixels per inch
INTERRUPTED = 130  # the exit code of Ctrl-C in shells
_MOST_ROWS = 500  # of a table that is printed
_FILMS: dict[str, dict[str, Any]] = {  # the first supported one is written; under a minute for 600 turns
    "game.mp4": {"fps": 25, "frames_per_turn": 2},
    "game.gif": {"fps": 12, "height": 640, "frames_per_turn": 1},
}


def guard_command(command: Callable[..., None]) -> Callable[..., None]:
    """Add the options `--max-memory` and `--traceback` to a command, and print errors as sentences."""

    @wraps(command)
    def run(*args: object, max_memory: str | None = None, traceback: bool = False, **keywords: object) -> None:
        try:
            with nullcontext() if max_memory is None else allowing(parse_memory(max_memory)):
                command(*args, **keywords)
        except (typer.Exit, typer.Abort, typer.BadParameter, BrokenPipeError):
            raise
        except (Exception, SystemExit) as error:  # a strategy may raise it, too
            if traceback:
                raise
            echo(explain_error(error), err=True)
            raise typer.Exit(1) from None

    known = signature(command)
    for hint in chain.from_iterable(getattr(one.annotation, "__metadata__", ()) for one in known.parameters.values()):
        hint.readable = False  # an unreadable file is an error of the system, like a missing one
    options = (("max_memory", None, _MaxMemory), ("traceback", False, _Traceback))
    added = [Parameter(name, Parameter.KEYWORD_ONLY, default=default, annotation=of) for name, default, of in options]
    run.__signature__ = known.replace(parameters=[*known.parameters.values(), *added])  # type: ignore[attr-defined] # what typer reads
    return run


def explain_error(error: BaseException) -> str:
    """Return the message for an error: a sentence for errors of GAMMS or of files, a traceback for the user's code.

    A traceback contains only the user's own frames; without any, it is an error in GAMMS itself, and the whole
    traceback is printed.
    """
    from gamms.scenario import ScenarioError

    raised = error.__cause__ if isinstance(error, ScenarioError) else error
    lines = [] if raised is None else _format_own_traceback(raised)
    if raised is error and lines:
        return "".join(lines).rstrip()
    if isinstance(error, (GammsError, OSError)):
        return "".join(lines) + "\n".join((f"gamms: {_write_sentence(error)}", *getattr(error, "__notes__", ())))
    return "".join(TracebackException.from_exception(error).format()).rstrip()


def _format_own_traceback(error: BaseException) -> list[str]:
    """Return the traceback of an error without frames of GAMMS and its callers; [] if none is left."""
    shown = TracebackException.from_exception(error)
    own = _select_own_frames(shown.stack)
    part: TracebackException | None = shown
    while part is not None:
        part.stack = StackSummary.from_list(_select_own_frames(part.stack))
        part = part.__cause__ or part.__context__
    return list(shown.format()) if own else []


def _select_own_frames(frames: StackSummary) -> list[FrameSummary]:
    """Return the frames from the user's first one on, without those of GAMMS."""
    foreign = tuple(sysconfig.get_paths()[name] for name in ("stdlib", "purelib", "platlib"))
    own = [frame for frame in frames if not frame.filename.startswith((_GAMMS, "<frozen")) and not _is_compiled(frame)]
    return list(dropwhile(lambda frame: frame.filename.startswith(foreign), own))


def _is_compiled(frame: FrameSummary) -> bool:
    """Return whether a frame is in a compiled library, which names its source as on the build machine."""
    return frame.filename.endswith((".pyx", ".pxi")) or not (
        frame.filename.startswith("<") or os.path.exists(frame.filename)  # noqa: PTH110 - in 3.11, Path.exists may raise
    )


def _write_sentence(error: GammsError | OSError) -> str:
    """Return the message of an error; for system errors with the file, and a file of a similar name."""
    if isinstance(error, FileNotFoundError) and _is_current_folder_gone():
        return "The current folder is not there any more: change into another one."
    if isinstance(error, GammsError) or error.strerror is None:
        return reason(error)
    if error.filename is None:
        return f"{error.strerror}, while something was read or written."
    path = Path(os.fsdecode(error.filename))
    if isinstance(error, FileNotFoundError):
        return reason(MissingFile(None, path))
    if isinstance(error, IsADirectoryError):
        return f"{str(path)!r} is a folder, not a file."
    return f"{str(path)!r}: {error.strerror}."


def _is_current_folder_gone() -> bool:
    try:
        Path.cwd()
    except FileNotFoundError:
        return True
    return False


def echo(text: str, *, err: bool = False) -> None:
    """Print a text with its control characters escaped."""
    typer.echo(make_printable(text), err=err)


def warn(game: "Scenario") -> None:
    """Print likely mistakes in a scenario."""
    for line in game.warnings():
        echo(f"gamms: {line}", err=True)


class _Console(Console):
    """Prints styled texts with their control characters escaped."""

    def on_broken_pipe(self) -> None:
        """End commands as after any other output when a reader such as `head` closes the pipe."""
        raise BrokenPipeError(errno.EPIPE, os.strerror(errno.EPIPE))

    def print(self, *objects: object, **options: Any) -> None:  # Any: the options of rich
        """Print texts, and tables of `make_rich_table`."""
        super().print(*(make_printable(one) if isinstance(one, str) else one for one in objects), **options)


def make_console() -> Console:
    """Return a console for styled texts and tables."""
    return _Console(highlight=False, soft_wrap=True)


def make_rich_table(header: tuple[str, ...], rows: Iterable[tuple[str, ...]], *, right: bool = True) -> Table:
    """Return a table without lines, all columns but the first aligned right, with the first 500 rows."""
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for i, title in enumerate(header):
        table.add_column(title, justify="right" if i and right else "left", overflow="fold")
    every = list(rows)
    for row in every[:_MOST_ROWS]:
        table.add_row(*map(make_printable_line, row))
    if len(every) > _MOST_ROWS:
        table.add_row(f"and {len(every) - _MOST_ROWS:,} more")
    return table


def write_page(file: Path, page: bytes) -> None:
    """Write an HTML page, and print its file name.

    Raises:
        BadValue: the file name does not end in .html, such as that of the recording shown.
    """
    if file.suffix.lower() not in (".html", ".htm"):
        raise BadValue(f"A page is an .html file: give such a name instead of {str(file)!r}.")
    write_whole(file, page, through_links=True)
    echo(f"Wrote {file}.")


@contextmanager
def record_game(ctx: "Context", folder: Path, *, sensed: bool | None = None, is_kept: bool = True) -> Iterator[Path]:
    """Record a game into a folder, with sensor data unless these are left out; replace an earlier recording there.

    After Ctrl-C, a line says up to which turn it goes, unless the folder is removed then (not `is_kept`).
    """
    path = folder / RECORDING
    with _report_kept_turns(path) if is_kept else nullcontext(), make_folder(folder):
        path.unlink(missing_ok=True)
        ctx.record.start(path, sensed=sensed)
        try:
            yield path
        finally:
            ctx.record.stop()


@contextmanager
def _report_kept_turns(path: Path) -> Iterator[None]:
    """Print after Ctrl-C in a `with` block up to which turn the recording of a game goes."""
    try:
        yield
    except KeyboardInterrupt:
        turns = 0
        if path.exists():
            from gamms import recorder

            with recorder.open(path) as recording:
                turns = recording.turns
        echo(f"Wrote {path} (every move up to turn {turns}; gamms replay)." if turns else "No turn was recorded.")
        raise


@contextmanager
def film_game(ctx: "Context", folder: Path, **page: Unpack["PictureOptions"]) -> Iterator[Path | None]:
    """Film a game into a folder; yield the file, or None if the libraries for films are missing."""
    for name, options in _FILMS.items():
        try:
            film = ctx.visual.film(remove_link(folder / name), **options, **page)
        except MissingExtra:
            continue
        with film:
            yield folder / name
        return
    yield None


def save_pictures(ctx: "Context", folder: Path, **page: Unpack["PictureOptions"]) -> list[Path]:
    """Save the last state as `final.svg`, and as `final.png` if Pillow is installed; return the files.

    Returns no files if the context has ended, because the window was closed.
    """
    files: list[Path] = []
    if ctx.is_terminated():
        return files
    for name in ("final.png", "final.svg"):
        try:
            ctx.visual.save(remove_link(folder / name), dpi=_FINE, **page)
        except MissingExtra:
            continue
        files.append(folder / name)
    return files


def describe_missing(wanted: Iterable[Path], made: Iterable[Path | None]) -> str:
    """Return a line about files that could not be made, and how to install the libraries for them."""
    missing = [path for path in wanted if path not in made]
    if not missing:
        return ""
    extras = ("viz", "video") if any(path.name in _FILMS for path in missing) else ("viz",)
    return (
        f"\nSkipped because optional packages are missing: {join_names(missing)}. "
        f"To install them: {install_command(*extras)}, then play again."
    )


def join_names(files: Iterable[Path]) -> str:
    """Return the names of files: "a", "a and b", "a, b and c"."""
    *others, last = map(str, files)
    return f"{', '.join(others)} and {last}" if others else last
