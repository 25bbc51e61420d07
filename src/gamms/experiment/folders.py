"""The files of a run: a journal of rows that survives a crash, a lock, the plan, and the final tables.

`journal.jsonl` gets rows in the order in which games end; each line is written at once, and an incomplete last line is
ignored when the journal is read. `series.jsonl` has what collectors of the games have collected, a line for each game
and collector, written before the row of the game. `experiment.json` is the plan. `rows.jsonl`, `rows.csv` and
`rows.parquet` are written when all games are played, in the order of the plan, which the series then have, too.

`pack` writes a folder as one ZIP file; equal folders give equal bytes. Because the file that `unpack` restores may come
from a stranger, names, kinds, sizes and counts are checked before anything is written.
"""

import json
import os
import shutil
import stat
import time
import zipfile
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
from itertools import chain
from pathlib import Path, PurePosixPath
from typing import Any, BinaryIO, Literal, NotRequired, TypedDict
from unicodedata import category, normalize

from gamms.arguments import as_items, as_path
from gamms.errors import BadFile, BadValue, WriteConflict
from gamms.experiment.games import Row, Series
from gamms.folders import (
    LOCK,
    Scalar,
    add_path_to_errors,
    as_lines,
    cut_torn_line,
    lock_folder,
    make_folder,
    make_place_beside,
    open_regular_file,
    open_whole_file,
    read_json,
    read_json_lines,
    refuse_link,
    write_csv,
    write_whole,
)
from gamms.ir.tables import make_table
from gamms.limits import refuse_above
from gamms.text import make_printable_line, shown

FIRST_FORMAT = "gamms experiment 1"
FORMAT = "gamms experiment 2"  # the first has rows whose digests cover less code
PLAN = "experiment.json"
JOURNAL = "journal.jsonl"
SERIES = "series.jsonl"
_SYNC_S = 0.5  # seconds between calls of fsync
_INT64 = 1 << 63
_FIRST = ("id", "scenario", "gamms", "python", "numpy")
_MIDDLE = ("seed", "reason", "winner", "truncated", "turns")


class RowWithId(TypedDict):
    """The column by which a journal finds rows."""

    id: str


class _RowColumns(RowWithId):
    """The columns that every row of an experiment has."""

    scenario: str
    gamms: str
    python: str
    numpy: str
    seed: int
    error: str | None


class _FinishedRow(_RowColumns, total=False):
    """The columns of a finished game."""

    turns: int
    truncated: bool
    reason: str


ROW = (_FinishedRow, dict[str, Scalar])
"""The types of a row of an experiment: known columns, and scalars in all columns."""


class SeriesLine(RowWithId):
    """What a collector has collected in a game: a line of `series.jsonl`."""

    name: str
    turn: list[int]
    agent: NotRequired[list[str]]
    value: list[Any]


class ExperimentPlan(TypedDict):
    """The content of the file `experiment.json`."""

    format: Literal["gamms experiment 1", "gamms experiment 2"]
    scenario: dict[str, Any]
    keys: list[str]
    variants: list[dict[str, Scalar]]
    digests: list[str]
    seeds: list[int]
    collect: list[str]
    sample: tuple[list[str], int] | None
    versions: dict[str, str]
    rows: list[str]
    changes: NotRequired[list[dict[str, Any] | None]]
    """Changes to the scenario for each variant; None: a program gave functions for the variant."""
    collectors: NotRequired[list[str]]
    """The names of `collect` with the SHA-256 of their functions; missing in the first format."""


# -- the journal --------------------------------------------------------------------------------------------------


class Journal:
    """The rows of all games in a folder, by id; new rows are appended, and what was collected in their games.

    Args:
        folder: the folder of the run, which is locked.
        kinds: the types that each row must have, for `gamms.folders.read_json_lines`.

    Raises:
        BadFile: a line is not a row.
    """

    def __init__(self, folder: Path, *kinds: type[object]) -> None:
        self._series = _AppendedLines(folder / SERIES)
        self._lines = _AppendedLines(folder / JOURNAL)
        self.rows = read_journal(folder / JOURNAL, *kinds)

    def add(self, rows: Iterable[Row], series: Iterable[SeriesLine] = ()) -> None:
        """Append rows; the system has them when this returns, and the disk within half a second of games.

        The series of these games are written first, so that a row is never without them.
        """
        rows = list(rows)
        self._series.add(series)
        self._lines.add(rows)
        self.rows |= {row["id"]: row for row in rows}

    def close(self) -> None:
        """Write the files to disk and close them."""
        self._series.close()
        self._lines.close()


class _AppendedLines:
    """A file of JSON lines to which a run appends."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._file: BinaryIO | None = None  # until there is something to write
        self._synced = 0.0

    def add(self, lines: Iterable[Mapping[str, Any]]) -> None:
        """Append lines."""
        made = as_lines([*lines])
        if not made:
            return
        if self._file is None:
            cut_torn_line(self._path)
            self._file = open_regular_file(self._path, "ab")
        with add_path_to_errors(self._path, self._path):
            self._file.write(made)
            self._file.flush()
        if time.monotonic() - self._synced > _SYNC_S:
            os.fsync(self._file.fileno())
            self._synced = time.monotonic()

    def close(self) -> None:
        """Write the file to disk and close it."""
        if self._file is not None:
            with add_path_to_errors(self._path, self._path):
                os.fsync(self._file.fileno())
                self._file.close()


def list_series_lines(id: str, series: Series) -> Iterator[SeriesLine]:
    """Yield the lines of what was collected in the game of a row."""
    for name, columns in series.items():
        yield {"id": id, "name": name, **columns}  # type: ignore[typeddict-item] # as collectors make them


def read_series(folder: Path, ids: Iterable[str]) -> Iterator[SeriesLine]:
    """Yield the collected values of the games of some rows, in their order.

    Raises:
        BadFile: a line is not of a series, or its columns differ in length.
    """
    found: dict[str, dict[str, SeriesLine]] = {}
    lines: Any = read_json_lines(folder / SERIES, "a series", SeriesLine)
    for line in lines:
        columns = [line["turn"], line["value"], line.get("agent", line["turn"])]
        if len({*map(len, columns)}) > 1:
            what = f"the series {shown(line['name'])} of the row {shown(line['id'])}"
            raise BadFile(f"{str(folder / SERIES)!r}: the columns of {what} differ in length. Delete its line.")
        found.setdefault(line["id"], {})[line["name"]] = line  # that of a game which was played again is the last one
    for id in ids:
        yield from found.get(id, {}).values()


def read_journal(file: Path, *kinds: type[object]) -> dict[str, Row]:
    """Return the rows of a journal by id; ignore an incomplete last line.

    Raises:
        BadFile: a line is not a row.
    """
    return {row["id"]: row for row in read_json_lines(file, "a row", RowWithId, *kinds)}


def refuse_incomplete(folder: Path, rows: Mapping[str, Row], ids: Iterable[str], keys: Sequence[str]) -> None:
    """Check that the rows with these ids have all varied keys.

    Raises:
        BadFile: a row lacks a key.
    """
    for row in (rows[id] for id in ids if id in rows):
        missing = [key for key in keys if key not in row]
        if missing:
            raise BadFile(
                f"{str(folder / JOURNAL)!r} has a row {shown(row['id'])} without {shown(missing[0])}. Delete its line."
            )


# -- the plan -----------------------------------------------------------------------------------------------------


def write_plan(folder: Path, plan: Mapping[str, Any]) -> None:
    """Write the plan of a run."""
    write_whole(folder / PLAN, plan_as_bytes(plan))


def plan_as_bytes(plan: Mapping[str, Any]) -> bytes:
    """Return the content of the file of a plan."""
    return (json.dumps(plan, indent=1) + "\n").encode()


def read_plan(folder: Path) -> ExperimentPlan:
    """Read the plan of a run.

    Raises:
        BadFile: the plan is missing or not valid.
    """
    try:
        return read_json(folder / PLAN, "the plan of an experiment", ExperimentPlan)
    except FileNotFoundError:
        raise BadFile(f"{str(folder)!r} is not the folder of an experiment: it has no {PLAN}.") from None


def refuse_first_format(folder: Path) -> None:
    """Refuse to add rows to a folder whose plan has the first format.

    Raises:
        WriteConflict: it has.
        BadFile: the plan is not valid.
    """
    if (folder / PLAN).exists() and read_plan(folder)["format"] != FORMAT:
        raise WriteConflict(
            f"The digests of the rows in {str(folder)!r} are of an older GAMMS and cover less code: its rows can be "
            "read, but new ones need another folder."
        )


def read_rows(folder: Path) -> tuple[ExperimentPlan, list[Row]]:
    """Read the plan of a folder, and the rows of its games in the order of the plan.

    Raises:
        BadFile: it is not the folder of an experiment, or a file in it is not valid.
    """
    plan = read_plan(folder)
    rows = read_journal(folder / JOURNAL, *ROW)
    refuse_incomplete(folder, rows, plan["rows"], plan["keys"])
    return plan, [rows[id] for id in plan["rows"] if id in rows]


# -- the files at the end -----------------------------------------------------------------------------------------


def list_columns(rows: Sequence[Row], varied: Sequence[str]) -> list[str]:
    """Return the columns of rows in the order of the files."""
    found = set(chain.from_iterable(rows))
    known = [*_FIRST, *varied, *_MIDDLE]
    others = sorted(found - {*known, "error"}, key=lambda name: (not name.startswith("score."), name))
    return [*known, *others, "error"]


def write_rows(folder: Path, rows: Sequence[Row], varied: Sequence[str]) -> list[Path]:
    """Write all rows as JSON lines, CSV, and Parquet where pyarrow is installed; return the files.

    The series of the folder are put into the order of the rows.
    """
    columns = list_columns(rows, varied)
    full = [{name: row.get(name) for name in columns} for row in rows]
    files = [folder / "rows.jsonl", folder / "rows.csv"]
    write_whole(files[0], as_lines(full))
    with open_whole_file(files[1]) as beside:
        write_csv(beside, columns, (row.values() for row in full), end="\n")
    if find_spec("pyarrow") is not None:
        files.append(folder / "rows.parquet")
        _write_parquet(files[-1], {name: [row[name] for row in full] for name in columns})
    if (folder / SERIES).exists():
        write_whole(folder / SERIES, as_lines([*read_series(folder, (row["id"] for row in rows))]))
        files.append(folder / SERIES)
    return files


def _write_parquet(file: Path, columns: Mapping[str, list[Any]]) -> None:
    """Write columns of scalars to Parquet; a column of mixed types becomes texts."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    arrays = {}
    for name, values in columns.items():
        kinds = {type(value) for value in values if value is not None}
        is_bool_or_int64 = kinds == {bool} or (kinds == {int} and all(-_INT64 <= one < _INT64 for one in values if one))
        convert: Any = float if kinds and kinds <= {int, float} else _as_text
        if is_bool_or_int64:
            convert = _return_value
        arrays[name] = pa.array([None if one is None else convert(one) for one in values])
    with open_whole_file(file) as beside, beside.open("wb") as stream:  # whose name pyarrow reads as UTF-8
        pq.write_table(pa.table(arrays), stream)


def find_parquet_version() -> str | None:
    """Return the version of pyarrow that Parquet files name as their writer; None: it is not installed."""
    if find_spec("pyarrow") is None:
        return None
    import pyarrow as pa

    version: str = pa.cpp_version
    return version


def _return_value(value: Scalar) -> Scalar:
    return value


def _as_text(value: Scalar) -> str:
    return str(value).encode(errors="backslashreplace").decode()


# -- shards -------------------------------------------------------------------------------------------------------


def parse_shard(given: object) -> tuple[int, int] | None:
    """Return (number, count) of a shard, from `(3, 20)` or "3/20".

    Raises:
        BadValue: the value is neither.
    """
    if given is None:
        return None
    parts: list[Any] = []
    if isinstance(given, str):
        parts = given.split("/")
    elif isinstance(given, tuple | list):
        parts = list(given)
    try:
        number, count = (int(part) for part in parts)
    except (ValueError, TypeError):
        number = 0
        count = 0
    if not 1 <= number <= count:
        raise BadValue(
            f"shard must be (number, count), such as (3, 20) or '3/20' for the third of 20, not {shown(given)}."
        )
    return number, count


def find_shard_folder(out: Path, shard: tuple[int, int] | None) -> Path:
    """Return the folder of a shard's rows.

    Raises:
        BadFile: a link has this name.
    """
    if shard is None:
        return out
    folder = out / f"shard-{shard[0]}-of-{shard[1]}"
    refuse_link(folder)
    return folder


def merge(out: str | os.PathLike[str], folders: Iterable[str | os.PathLike[str]] | None = None) -> list[Path]:
    """Merge the rows of shards into the files that a single run would have written; return these files.

    Args:
        out: the folder of the experiment, which gets the files.
        folders: the folders of the shards; None: the folders `shard-…` in `out`.

    Raises:
        BadFile, BadValue: there are no shards, they belong to different experiments, or some games are missing.
        WriteConflict: a run is writing into `out`.
    """
    into = as_path(out, "out")
    if folders is None:
        found = sorted(into.glob("shard-*-of-*"))
    else:
        found = [as_path(one, "Each of folders") for one in as_items(folders, "folders", "paths")]
    if not found:
        raise BadValue(f"There are no folders shard-… in {str(into)!r}: give those of the shards.")
    plans = [read_plan(folder) for folder in found]
    for folder, plan in zip(found, plans, strict=True):
        if plan != plans[0]:
            key = next(key for key, value in plan.items() if value != plans[0].get(key))
            raise BadValue(f"{str(folder)!r} and {str(found[0])!r} are of different experiments: their {key} differ.")
    ids = plans[0]["rows"]
    keys = plans[0]["keys"]
    rows: dict[str, Row] = {}
    for folder in found:
        of_shard = read_journal(folder / JOURNAL, *ROW)
        refuse_incomplete(folder, of_shard, ids, keys)
        rows |= of_shard
    missing = [id for id in ids if id not in rows]
    if missing:
        raise BadValue(
            f"{len(missing):,} of {len(ids):,} games are missing, such as {shown(missing[0])}: run all shards to their "
            "ends."
        )
    with lock_folder(into):
        journal = Journal(into, *ROW)
        new = [row for id, row in rows.items() if id not in journal.rows]
        names = [row["id"] for row in new]
        journal.add(new, [line for one in found for line in read_series(one, names)])
        journal.close()
        write_plan(into, plans[0])
        return write_rows(into, [rows[id] for id in ids], keys)


def as_columns(rows: Sequence[Row], varied: Sequence[str]) -> dict[str, Any]:
    """Return rows as columns; missing numbers are NaN."""
    table = make_table({name: [row.get(name) for row in rows] for name in list_columns(rows, varied)})
    return {name: _convert_column(column) for name, column in table.items()}


def _convert_column(column: Any) -> Any:
    if column.dtype != object:
        return column
    values = column.tolist()
    is_number = [isinstance(value, (int, float)) and not isinstance(value, bool) for value in values]
    if any(is_number) and all(one or value is None for one, value in zip(is_number, values, strict=True)):
        import numpy as np

        return np.array([float("nan") if value is None else value for value in values])
    return column


# -- one file of a folder -----------------------------------------------------------------------------------------

_TIME = (1980, 1, 1, 0, 0, 0)  # the earliest time in the format
_MODE = (stat.S_IFREG | 0o644) << 16
_UNIX = 3  # the system that defines the file attributes
_KINDS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
_ENCRYPTED = 1
_CHUNK = 1 << 20
_DEEPEST = 8  # nested folders
_LONGEST = 200  # bytes of a name that all systems accept
_END = b"PK\x05\x06"
_END_SIZE = 22
_LARGE = b"PK\x06\x07"  # before the end of a file of more than 4 GiB or 65,535 files
_LARGE_SIZE = 20
_LEAST_ENTRY = 46  # bytes in the table at the end of the file; bytes of memory
_BYTES_PER_ENTRY = 2_000


def pack(folder: str | os.PathLike[str], file: str | os.PathLike[str]) -> int:
    """Pack the folder of an experiment into one file, and return the number of files in it.

    The same files make the same bytes: their times and owners are left out.

    Args:
        folder: the folder; no run may be writing into it.
        file: the ZIP file, which is replaced if it exists.

    Raises:
        BadFile: it is not the folder of an experiment, or has links, pipes or the like.
        BadValue: the file would be in the folder, or have more than 65,535 files or 4 GiB.
        WriteConflict: a run is writing into the folder.
        OSError: a file cannot be read or written.
    """
    source = as_path(folder, "folder")
    target = as_path(file, "file")
    if not any((one / PLAN).is_file() for one in (source, *source.glob("shard-*-of-*"))):
        raise BadFile(f"{str(source)!r} is not the folder of an experiment: it has no {PLAN}.")
    if target.resolve().is_relative_to(source.resolve()):
        raise BadValue(f"{str(target)!r} would be in the folder that it is made of. Name a file elsewhere.")
    with lock_folder(source):
        found = list_files(source)
        with open_whole_file(target, through_links=True) as beside:
            try:
                _write(found, source, beside)
            except zipfile.LargeZipFile:
                raise BadValue(
                    f"{str(source)!r} has more than 65,535 files or 4 GiB, too much for one file. Leave out recordings."
                ) from None
    return len(found)


def list_files(folder: Path) -> list[Path]:
    """Return the paths of all files in the folder of an experiment and below, without its lock, in order.

    Raises:
        BadFile: a folder is a link, or lies too deep.
        TooLarge: there are so many files that their names take more memory than is allowed.
    """
    found = list[Path]()
    waiting = [folder]
    while waiting:
        here = waiting.pop()
        if here != folder:
            refuse_link(here)
        if len(here.relative_to(folder).parts) >= _DEEPEST:
            raise BadFile(f"{str(folder)!r} holds the folder {shown(here.name)}, more than {_DEEPEST - 1} levels deep.")
        for one in here.iterdir():
            (waiting if one.is_dir() else found).append(one)
            refuse_above((len(found) + len(waiting)) * _BYTES_PER_ENTRY, f"Listing the files in {str(folder)!r}")
    names = (one.relative_to(folder) for one in found if one.name != LOCK)
    return sorted(names, key=lambda one: one.as_posix())


def _write(found: list[Path], source: Path, target: Path) -> None:
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED, allowZip64=False) as packed:
        for name in found:
            about = zipfile.ZipInfo(name.as_posix(), _TIME)
            about.compress_type = zipfile.ZIP_DEFLATED
            about.external_attr = _MODE
            about.create_system = _UNIX
            why = _find_fault(about)
            if why is not None:
                raise BadFile(f"{str(source)!r} holds {shown(about.filename)}, which cannot be packed: {why}.")
            with open_regular_file(source / name, "rb") as stream:
                about.file_size = os.fstat(stream.fileno()).st_size
                with packed.open(about, "w") as into:
                    shutil.copyfileobj(stream, into, _CHUNK)


def unpack(file: str | os.PathLike[str], folder: str | os.PathLike[str]) -> int:
    """Restore the folder of an experiment from the file that `pack` wrote, and return how many files are in it.

    The file may come from a stranger: it is checked before anything is written, no code is run, and nothing is written
    outside of the folder.

    Args:
        file: the ZIP file.
        folder: a folder that is new, or empty.

    Raises:
        BadFile: it is not such a file, or damaged; nothing is left in the folder then.
        BadValue: the folder is not empty.
        TooLarge: its files would take more than is allowed, by `gamms.limits.allowing` or --max-memory.
        OSError: a file cannot be read or written.
    """
    source = as_path(file, "file")
    target = as_path(folder, "folder")
    is_new = not target.is_dir()
    # In a folder that is there already, which may be a disk, files become visible when all are complete.
    place = target if is_new else target / target.name
    rest = place.with_name(f".{place.name}.part")
    if target.is_symlink() or not (is_new or {*target.iterdir()} <= {rest}):
        raise BadValue(f"{str(target)!r} is not empty, or a link to another folder. Name a new folder.")
    if is_new and target.exists():
        raise BadValue(f"There is {str(target)!r} already, and it is not a folder. Name another folder.")
    with open_regular_file(Path(os.path.realpath(source)), "rb") as stream, _report_damage(source):
        count = _check_end(stream, source)
        with zipfile.ZipFile(stream) as packed:
            entries = packed.infolist()
            if len(entries) != count:
                raise zipfile.BadZipFile(f"it lists {len(entries):,} files, and should list {count:,}")
            _check(entries, source, stream.seek(0, os.SEEK_END))
            with make_folder(target.parent), make_place_beside(place, is_folder=True) as beside:
                for one in entries:
                    _restore(packed, one, beside, target)
                if is_new:
                    beside.replace(target)
                else:
                    for moved in sorted(beside.iterdir(), key=lambda one: one.name == PLAN):
                        moved.replace(target / moved.name)
    return len(entries)


@contextmanager
def _report_damage(file: Path) -> Iterator[None]:
    try:
        yield
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, UnicodeDecodeError) as error:
        raise BadFile(f"{str(file)!r} is not a ZIP file, or is damaged: {make_printable_line(str(error))}") from None


def _check_end(stream: BinaryIO, file: Path) -> int:
    """Return the number of files from the end of a ZIP file, after checking the size of its file table.

    Raises:
        BadFile: the bytes are not the end of a ZIP file that `pack` writes.
        TooLarge: the table would take more memory than is allowed.
    """
    size = stream.seek(0, os.SEEK_END)
    stream.seek(max(size - _END_SIZE - _LARGE_SIZE, 0))
    data = stream.read()
    large = data[:-_END_SIZE]
    end = data[-_END_SIZE:]
    if len(end) < _END_SIZE or not end.startswith(_END) or end[-2:] != b"\0\0" or large.startswith(_LARGE):
        raise BadFile(f"{str(file)!r} is not a file that gamms experiment pack wrote. Pack the folder again.")
    table = int.from_bytes(end[12:16], "little")
    refuse_above(table * _BYTES_PER_ENTRY // _LEAST_ENTRY, f"Reading {str(file)!r}")
    return int.from_bytes(end[10:12], "little")


def _check(entries: list[zipfile.ZipInfo], file: Path, size: int) -> None:
    """Check all names, kinds, sizes and places in a file of `size` bytes.

    Raises:
        BadFile: `pack` does not write such an entry.
        TooLarge: the files would take more than is allowed.
    """
    places = [PurePosixPath(one.filename) for one in entries]
    if not any(PurePosixPath(PLAN) == place or place.match(f"shard-*-of-*/{PLAN}") for place in places):
        raise BadFile(f"{str(file)!r} does not hold the folder of an experiment: it has no {PLAN}.")
    seen = set[str]()
    around = set[str]()
    for one, place in zip(entries, places, strict=True):
        why = _find_fault(one)
        if why is None and not 0 <= one.header_offset < size:
            why = f"its place, byte {one.header_offset:,}, is not in the file"
        key = _fold_name(place)
        if why is None and key in seen:
            why = "it is there twice"
        seen.add(key)
        around.update(_fold_name(above) for above in place.parents)
        if why is not None:
            raise BadFile(f"{str(file)!r} holds {shown(one.orig_filename)}, which is refused: {why}.")
    if seen & around:
        raise BadFile(f"{str(file)!r} holds {shown(min(seen & around))} as a file and as a folder.")
    refuse_above(sum(one.file_size for one in entries), f"Unpacking {str(file)!r}")


def _fold_name(place: PurePosixPath) -> str:
    """Return the key under which names are equal on some systems: without case, in normal form."""
    return normalize("NFC", normalize("NFC", place.as_posix()).casefold())


def _find_fault(one: zipfile.ZipInfo) -> str | None:
    """Return why an entry of a ZIP file is refused; None: it is accepted."""
    parts = one.orig_filename.split("/")
    if "" in parts or "." in parts or ".." in parts or len(parts) > _DEEPEST:
        return (
            f"its name must lead to a file in the folder, or in one of at most {_DEEPEST - 1} folders within each other"
        )
    if any(sign in '\\:*?"<>|' or category(sign) in ("Cc", "Cs") for sign in one.orig_filename):
        return "its name has a sign that names of files may not have"
    if any(len(part.encode()) > _LONGEST or part.endswith((" ", ".")) for part in parts):
        return "its name is not one that all systems take"
    if stat.S_IFMT(one.external_attr >> 16) not in (0, stat.S_IFREG):
        return "it is not a regular file"
    if one.flag_bits & _ENCRYPTED or one.compress_type not in _KINDS:
        return "it is encrypted, or compressed in another way"
    return None


def _restore(packed: zipfile.ZipFile, one: zipfile.ZipInfo, folder: Path, target: Path) -> None:
    """Write a file into the folder that becomes `target`."""
    parts = one.filename.split("/")
    file = folder.joinpath(*parts)
    with add_path_to_errors(target.joinpath(*parts), file):
        file.parent.mkdir(parents=True, exist_ok=True)
        with packed.open(one) as stream, file.open("xb") as into:
            shutil.copyfileobj(stream, into, _CHUNK)
