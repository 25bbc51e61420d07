"""Check the folder of an experiment: its root, the files that follow from its rows, and games that are played again.

The root is one SHA-256 of everything that cannot be made again without playing: the plan and the rows without
versions, the collected values of games, and the recordings in the folder. Everything else that a run writes follows
from these, and is compared with new copies.
"""

import hashlib
import json
import re
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from heapq import nsmallest
from itertools import product, zip_longest
from os import SEEK_END
from os.path import commonprefix
from pathlib import Path
from typing import Any, Literal, NamedTuple

from gamms.arguments import as_float, as_text
from gamms.errors import BadFile, BadValue, GammsError
from gamms.experiment import folders
from gamms.experiment.games import Row
from gamms.experiment.variants import compute_row_id
from gamms.folders import as_lines, open_regular_file, read_bytes, read_json_lines
from gamms.limits import refuse_above
from gamms.scenario import ScenarioError
from gamms.text import make_printable_line, shown

SAMPLE = 10  # rows that are played again if a root is given
_VERSIONS = ("gamms", "python", "numpy")  # columns of rows
_FORMAT = "gamms experiment root 1"
_ROOT = re.compile("[0-9a-f]{64}")
_RECORDING = ".ggr"
_CHUNK = 1 << 20
_CELL_BYTES = 50  # of memory for a cell of a table; 47 measured
_FEW = 5  # files that a sentence names
_CONTEXT = 24  # bytes of a line that are shown before a difference
_PYARROW = re.compile(rb"parquet-cpp-arrow version ([0-9.]{1,20})")
_DIED = "WorkerDied: "  # begins the error of a game whose process died


class Provenance(NamedTuple):
    """Where rows come from.

    Attributes:
        plan: the plan of the experiment, as its file has it.
        folder: the folder of the experiment; None: it was not written.
    """

    plan: Mapping[str, Any]
    folder: Path | None


class Verification(NamedTuple):
    """The result of verifying the folder of an experiment.

    Attributes:
        root: the root of the folder.
        rows: the number of rows in the plan.
        played: the ids of the rows that were played again.
        faults: a sentence for each contradiction that was found.
        notes: sentences that say which files and values were not checked.
        unplayable: a sentence for each drawn row whose game cannot be played again, with the reason and the way out.
    """

    root: str
    rows: int
    played: tuple[str, ...]
    faults: tuple[str, ...]
    notes: tuple[str, ...]
    unplayable: tuple[str, ...] = ()

    @property
    def verdict(self) -> Literal["yes", "no", "unplayable"]:
        """The answer to the question whether the folder is right.

        "no" if a fault was found; otherwise "unplayable" if a drawn row cannot be played again; otherwise "yes".
        """
        if self.faults:
            return "no"
        return "unplayable" if self.unplayable else "yes"

    @property
    def is_valid(self) -> bool:
        """Whether no fault was found, and all drawn rows could be played again."""
        return self.verdict == "yes"

    def miss_probability(self, share: float) -> float:
        """Return the probability that none of the rows that were played again is among altered ones.

        The rows are drawn without replacement, so the probability is hypergeometric; (1 - share) ** K bounds it. If
        drawn rows cannot be played again, it is 1, because all altered rows may be such rows.

        Args:
            share: the share of altered rows, 0 to 1; the number of rows is rounded down, but is at least one unless the
                share is 0.

        Raises:
            BadValue: the share is not in this range.
        """
        part = as_float(share, "share")
        if not 0.0 <= part <= 1.0:
            raise BadValue(f"share is a share of the rows, 0 to 1, not {part:g}.")
        altered = 0 if part == 0.0 or self.unplayable else max(int(part * self.rows), 1)
        chance = 1.0
        for number in range(len(self.played)):
            chance *= max(self.rows - altered - number, 0) / (self.rows - number)
        return chance


class Unplayable(BadValue):
    """The plan of an experiment does not say how the game of a row is played."""


# -- the root -----------------------------------------------------------------------------------------------------


def digest_of_lines(lines: Iterable[Mapping[str, object]]) -> str:
    """Return the SHA-256 of JSON objects without their order, and without columns of versions, in hexadecimal."""
    parts = ({name: line[name] for name in sorted(line) if name not in _VERSIONS} for line in lines)
    return hashlib.sha256(b"".join(sorted(as_lines([part]) for part in parts))).hexdigest()


def find_root(source: Provenance, rows: Iterable[Row], series: Iterable[Mapping[str, object]]) -> str:
    """Return the root of an experiment, in hexadecimal.

    Raises:
        BadFile: the folder holds a link, or folders that are nested too deeply.
        TooLarge: the recordings have more bytes than is allowed.
    """
    plan = {name: value for name, value in source.plan.items() if name != "versions"}
    parts = {
        "format": _FORMAT,
        "plan": plan,
        "rows": digest_of_lines(rows),
        "series": digest_of_lines(series),
        "recordings": {} if source.folder is None else _hash_recordings(source.folder),
    }
    plain = json.loads(json.dumps(parts))  # as a file has it: all keys are texts, and can be sorted
    return hashlib.sha256(json.dumps(plain, sort_keys=True).encode()).hexdigest()


def _hash_recordings(folder: Path) -> dict[str, str]:
    """Return the SHA-256 of each recording in a folder and below, by its path in the folder."""
    names = [name for name in folders.list_files(folder) if name.suffix == _RECORDING]
    refuse_above(sum((folder / name).lstat().st_size for name in names), f"Reading the recordings in {str(folder)!r}")
    return {name.as_posix(): _hash_file(folder / name) for name in names}


def _hash_file(file: Path) -> str:
    digest = hashlib.sha256()
    with open_regular_file(file, "rb") as stream:
        while chunk := stream.read(_CHUNK):
            digest.update(chunk)
    return digest.hexdigest()


def as_root(given: object) -> str:
    """Check a root that a caller gives.

    Raises:
        BadType, BadValue: it is not 64 hexadecimal digits.
    """
    text = as_text(given, "root").strip().lower()
    if not _ROOT.fullmatch(text):
        raise BadValue(
            f"root is a SHA-256 of 64 hexadecimal digits, which gamms experiment prints, not {shown(given)} "
            f"({len(text)} characters)."
        )
    return text


# -- the folder ---------------------------------------------------------------------------------------------------

PlayRow = Callable[[str], tuple[Row, Iterable[folders.SeriesLine]]]
"""Plays the game of an id; returns its row without the columns of the plan, and its collected values.

Raises `Unplayable` or `ScenarioError` if the game cannot be played with the plan, the code and the maps that there are.
"""


def verify(
    source: Provenance, root: str, rows: Sequence[Row], drawn: Sequence[Row], play: PlayRow, faults: Sequence[str] = ()
) -> Verification:
    """Check the files of a folder, and play the games of some rows again.

    Args:
        source: the plan and the folder.
        root: the root of the folder.
        rows: the rows of the folder, in the order of the plan.
        drawn: the rows that are played again.
        play: plays them.
        faults: the faults that are known.

    Raises:
        BadFile: a file is not what a run writes.
        TooLarge: a file would take more memory than is allowed.
    """
    plan = source.plan
    folder = source.folder or Path()
    lines = read_json_lines(folder / folders.JOURNAL, "a row")
    misfit = _check_fit(folder, plan)
    found = [
        *faults,
        *_check_plan(folder, plan),
        *([*_check_ids(plan), *_check_rows(plan, rows)] if misfit is None else [misfit]),
        *_check_spelling(folder / folders.JOURNAL, lines),
        *_check_copies(folder, plan, rows),
    ]
    games = _check_games(plan, folder, [row for row in drawn if not _has_died(row)], play)
    found += games.faults
    notes = [*_describe_unchecked_files(folder, plan, len(lines)), *_describe_unchecked_values(plan, drawn)]
    unplayable = tuple(games.unplayable)
    return Verification(root, len({*plan["rows"]}), tuple(games.played), tuple(found), tuple(notes), unplayable)


def _check_copies(folder: Path, plan: Mapping[str, Any], rows: Sequence[Row]) -> Iterator[str]:
    """Yield a fault for each file that follows from the rows and differs from the one made again."""
    columns = len(folders.list_columns(rows, plan["keys"]))
    refuse_above(len(rows) * columns * _CELL_BYTES, f"A table of {len(rows):,} rows and {columns:,} columns")
    with tempfile.TemporaryDirectory() as made:
        for file in folders.write_rows(Path(made), rows, plan["keys"]):
            yield from _compare_copy(folder / file.name, file)
    series = folder / folders.SERIES
    if series.exists() and read_bytes(series) != as_lines([*folders.read_series(folder, (row["id"] for row in rows))]):
        yield f"{folders.SERIES} does not have the series of the rows, in the order of the plan, as a run writes them."


def _check_plan(folder: Path, plan: Mapping[str, Any]) -> Iterator[str]:
    raw = json.loads(read_bytes(folder / folders.PLAN))
    if read_bytes(folder / folders.PLAN) != folders.plan_as_bytes(raw) or not set(raw) <= set(plan):
        yield f"{folders.PLAN} is not written as a run writes it: it has other spaces, signs or keys."
    if set(plan["versions"]) != set(_VERSIONS):
        yield f"{folders.PLAN} has versions of other things than {', '.join(_VERSIONS)}."


def _check_fit(folder: Path, plan: Mapping[str, Any]) -> str | None:
    """Return how the parts of a plan contradict each other; None: they fit together.

    Raises:
        TooLarge: the ids of rows follow from more bytes than is allowed, so that checking them would take long.
    """
    variants = plan["variants"]
    count = len(variants) * len(plan["seeds"])
    if len(plan["digests"]) != len(variants) or len(plan["rows"]) != count:
        return (
            f"{folders.PLAN} has {len(variants):,} variants, {len(plan['digests']):,} digests, {len(plan['seeds']):,} "
            f"seeds and {len(plan['rows']):,} rows, which do not fit together."
        )
    if any([*settings] != plan["keys"] for settings in variants):
        return f"{folders.PLAN} has variants without the keys {shown(plan['keys'])}."
    hashed = len(json.dumps(variants)) * len(plan["seeds"]) + len(json.dumps(_list_collectors(plan))) * count
    refuse_above(hashed, f"Hashing the ids of the rows in {str(folder)!r}")
    return None


def _check_ids(plan: Mapping[str, Any]) -> Iterator[str]:
    games = product(zip(plan["digests"], plan["variants"], strict=True), plan["seeds"])
    for id, ((digest, settings), seed) in zip(plan["rows"], games, strict=True):
        expected = compute_row_id(digest, settings, _list_collectors(plan), seed)
        if id != expected:
            yield f"{folders.PLAN} names the row {shown(id)} for seed {seed}, whose id is {expected}."


def _list_collectors(plan: Mapping[str, Any]) -> list[str]:
    """Return the texts that stand for collectors in the ids of rows."""
    found: list[str] = plan["collect"] if plan["format"] == folders.FIRST_FORMAT else plan.get("collectors", [])
    return found


def _check_spelling(file: Path, lines: Sequence[Mapping[str, object]]) -> Iterator[str]:
    """Yield a fault if a file of JSON lines has other bytes than GAMMS writes for its values."""
    found = read_bytes(file).splitlines(keepends=True) if file.exists() else []  # without it, its rows are missing
    for number, (line, value) in enumerate(zip_longest(found, lines), 1):
        if value is None or line != as_lines([value]):
            yield f"{file.name}, line {number}, is not written as a run writes it: it is torn, or has other signs."
            return


def _check_rows(plan: Mapping[str, Any], rows: Sequence[Row]) -> Iterator[str]:
    by_id = {row["id"]: row for row in rows}
    games = product(zip(plan["digests"], plan["variants"], strict=True), plan["seeds"])
    versions = {name: plan["versions"].get(name) for name in _VERSIONS}
    missing = []
    for id, ((digest, settings), seed) in zip(plan["rows"], games, strict=True):
        row = by_id.get(id)
        if row is None:
            missing.append(id)
            continue
        expected = {"scenario": digest, **versions, **settings, "seed": seed}
        yield from _compare_row(row, expected, expected, "and the plan says")
    if missing:
        yield f"{len(missing):,} of {len(plan['rows']):,} rows are missing, such as {missing[0]}: run to the end."


def _compare_row(row: Row, expected: Mapping[str, Any], columns: Iterable[str], whence: str) -> Iterator[str]:
    """Yield a fault for each column in which a row differs from expected values."""
    for column in columns:
        found = row.get(column)
        value = expected.get(column)
        is_same = type(found) is type(value) and found == value
        if not is_same and as_lines([{"value": found}]) != as_lines([{"value": value}]):
            yield make_printable_line(f"{_name_row(row)}: {column} is {shown(found)}, {whence} {shown(value)}.")


def _name_row(row: Row) -> str:
    return f"Row {row['id']} (seed {row.get('seed')})"


def _compare_copy(file: Path, expected: Path) -> Iterator[str]:
    """Yield a fault if a file that follows from the rows differs from the one made again."""
    if not file.exists() and not file.is_symlink():
        return
    data = expected.read_bytes()
    try:
        with open_regular_file(file, "rb") as stream:
            found = stream.read(len(data) + 1)
    except BadFile as error:
        yield str(error)
        return
    if found == data or (file.suffix == ".parquet" and _read_writer(file) not in (None, _read_writer(expected))):
        return
    place = _find_first_difference(found, data) if file.suffix != ".parquet" else ""
    if len(found) > len(data):
        yield f"{file.name} is larger than the file made again from the rows, of {len(data):,} bytes{place}."
    elif file.suffix == ".jsonl":
        yield from _compare_lines(file, expected)
    else:
        yield f"{file.name} differs from the file made again from the rows{place}."


def _compare_lines(file: Path, expected: Path) -> Iterator[str]:
    try:
        found = read_json_lines(file, "a row", folders.RowWithId)
    except BadFile as error:
        yield str(error)
        return
    made = read_json_lines(expected, "a row", folders.RowWithId)
    if len(found) != len(made):
        yield f"{file.name} has {len(found):,} rows, and the journal {len(made):,} of them."
        return
    faults = list[str]()
    for one, other in zip(found, made, strict=True):
        columns = dict.fromkeys([*other, *one]) if one != other else {}
        faults += _compare_row(one, other, columns, f"in {file.name}, and the journal says")
    yield from faults or _check_spelling(file, made)


def _find_first_difference(found: bytes, expected: bytes) -> str:
    """Return a text that says in which line of a text file the first difference is."""
    pairs = zip_longest(found.splitlines(), expected.splitlines(), fillvalue=b"")
    for number, lines in enumerate(pairs, 1):
        if lines[0] != lines[1]:
            begin = max(len(commonprefix(lines)) - _CONTEXT, 0)  # noqa: RUF071 - of bytes, not of paths
            texts = (shown(line[begin:].decode(errors="replace")) for line in lines)
            return ", line {}: it has {}, and the rows give {}".format(number, *texts)
    return ", in the ends of its lines"


def _read_writer(file: Path) -> str | None:
    """Return the version of pyarrow that a Parquet file names as its writer; None: it names none."""
    with open_regular_file(file, "rb") as stream:
        stream.seek(max(stream.seek(0, SEEK_END) - _CHUNK, 0))
        found = _PYARROW.search(stream.read(_CHUNK))
    return None if found is None else found[1].decode()


def _describe_unchecked_files(folder: Path, plan: Mapping[str, Any], lines: int) -> Iterator[str]:
    """Yield sentences about the content of a folder that verification does not check.

    Args:
        folder: the folder of the experiment.
        plan: its plan.
        lines: the number of lines of its journal.
    """
    rows = len({*plan["rows"]})
    if lines > rows:
        yield (
            f"{folders.JOURNAL} has {lines:,} lines for {rows:,} rows: lines of other rows, and lines before another "
            "one of the same row, are not checked."
        )
    derived = ("rows.jsonl", "rows.csv", "rows.parquet")
    checked = {folders.PLAN, folders.JOURNAL, folders.SERIES, *derived}
    others = [one for one in folders.list_files(folder) if one.suffix != _RECORDING and one.as_posix() not in checked]
    if others:
        names = ", ".join(make_printable_line(one.as_posix()) for one in others[:_FEW])
        more = f" and {len(others) - _FEW:,} more" if len(others) > _FEW else ""
        yield f"Neither the root nor the rows cover these files: {names}{more}."
    absent = [name for name in derived if not (folder / name).exists()]
    if absent:
        yield f"The folder has no {', '.join(absent)} to compare."
    yield from _note_of_parquet(folder / "rows.parquet")


def _note_of_parquet(file: Path) -> Iterator[str]:
    if not file.exists():
        return
    version = folders.find_parquet_version()
    if version is None:
        yield f'{file.name} was not compared, because pyarrow is not installed: pip install ".[parquet]".'
        return
    writer = _read_writer(file)
    if writer not in (None, version):
        yield (
            f"{file.name} was not compared: it names pyarrow {writer} as its writer, and other versions write other "
            f"bytes than {version}. Install that version, or use rows.csv."
        )


# -- games --------------------------------------------------------------------------------------------------------


def draw_rows(root: str, seed: int, rows: Sequence[Row], count: int) -> list[Row]:
    """Draw rows without replacement; the same root and seed draw the same rows on every machine."""
    by_id = {row["id"]: row for row in rows}
    keys = {id: hashlib.sha256(f"{root}/{seed}/{id}".encode()).digest() for id in by_id}
    return [by_id[id] for id in nsmallest(count, keys, keys.__getitem__)]


class _CheckedGames(NamedTuple):
    """The result of playing games again.

    Attributes:
        played: the ids of the rows whose games were played.
        faults: a sentence for each value that differs, and for each game that failed.
        unplayable: a sentence for each game that cannot be played.
    """

    played: list[str]
    faults: list[str]
    unplayable: list[str]


def _check_games(plan: Mapping[str, Any], folder: Path, rows: Sequence[Row], play: PlayRow) -> _CheckedGames:
    """Play the games of rows again, and compare their values."""
    given = {"id", "scenario", "seed", *_VERSIONS, *plan["keys"], *(f"collector.{name}" for name in plan["collect"])}
    collected: dict[str, list[folders.SeriesLine]] = {row["id"]: [] for row in rows}
    for line in folders.read_series(folder, collected):
        collected[line["id"]].append(line)
    games = _CheckedGames([], [], [])
    for row in rows:
        try:
            again, series = play(row["id"])
        except (Unplayable, ScenarioError) as error:
            games.unplayable.append(make_printable_line(f"{_name_row(row)} cannot be played again: {error}"))
            continue
        except (GammsError, OSError) as error:
            games.faults.append(make_printable_line(f"{_name_row(row)} could not be played again: {error}"))
            continue
        games.played.append(row["id"])
        columns = [name for name in dict.fromkeys([*row, *again]) if name not in given]
        games.faults.extend(_compare_row(row, again, columns, "and played again"))
        games.faults.extend(_compare_series(row, collected[row["id"]], series))
    return games


def _compare_series(row: Row, found: Iterable[folders.SeriesLine], made: Iterable[folders.SeriesLine]) -> Iterator[str]:
    by_name = {line["name"]: as_lines([line]) for line in found}
    again = {line["name"]: as_lines([line]) for line in made}
    for name in dict.fromkeys([*by_name, *again]):
        if by_name.get(name) != again.get(name):
            yield make_printable_line(
                f"{_name_row(row)}: the series {shown(name)} is another one when it is played again."
            )


def _describe_unchecked_values(plan: Mapping[str, Any], rows: Iterable[Row]) -> Iterator[str]:
    """Yield sentences about values of rows that playing a game again does not check."""
    if plan["collect"]:
        names = ", ".join(f"collector.{name}" for name in plan["collect"])
        yield make_printable_line(f"A program computed {names}: games that are played again do not check them.")
    died = [row["id"] for row in rows if _has_died(row)]
    if died:
        yield f"{len(died):,} drawn rows were not played again, because their process died: {', '.join(died[:_FEW])}."


def _has_died(row: Row) -> bool:
    """Return whether the process that played the game of a row died."""
    return str(row.get("error") or "").startswith(_DIED)
