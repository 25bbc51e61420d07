"""Find the entries of a tournament, copy them if they could read each other, and compute their digests.

No code of an entry runs here: a Python file is read as text to check that the function exists.
"""

import hashlib
import os
import secrets
import shutil
import stat
import sys
import sysconfig
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import NamedTuple

from gamms.arguments import as_items, as_mapping, as_name
from gamms.errors import BadType, BadValue
from gamms.folders import find_home_folder, read_bytes, write_whole
from gamms.scenario.code import find_function
from gamms.tournament.scratch import remove_folder

EntrySpec = str | Sequence[str]
"""`file.py:function`, `module:function`, or a program with its arguments."""

_MOST_FILES = 2_000  # limits on the folder of an entry
_MOST_BYTES = 1 << 28
_Places = list[tuple[Path, Path] | None]  # for each text: the file that it names, and the path that the entry may read
SCRATCH = "scratch"  # the subfolder for files that exist only while the tournament is played
_LIBRARIES = ("lib", "lib64", "libexec", "share", "pyvenv.cfg")
_IGNORED_FOLDERS = ("__pycache__", ".git")


class Entry(NamedTuple):
    """One entry of a tournament.

    Attributes:
        name: the name of the entry in the table.
        reference: the function as `file.py:function` or `module:function`; "" for a program.
        command: the program and its arguments, by absolute paths; () for Python.
        readable: the files and folders of its own that it may read.
        digest: the SHA-256 of its files and of its command or function, in hexadecimal.
        copy: the folder of its copy, if its file was copied; else "".
        published: the place of the copy in the tournament's folder after the tournament.
    """

    name: str
    reference: str
    command: tuple[str, ...]
    readable: tuple[str, ...]
    digest: str
    copy: str
    published: str


def find_entries(given: Mapping[str, EntrySpec], base: Path, out: Path, private: Iterable[Path]) -> list[Entry]:
    """Return the entries, sorted by name.

    An entry may read the folder of its file, unless the folder also holds another entry or a file of the game; in
    that case only the entry's file is copied. Until the tournament ends, the copy lies in a folder whose name no entry
    can guess.

    Args:
        given: name -> specification of the entry.
        base: the folder that relative paths start from.
        out: the folder of the tournament.
        private: further files and folders that no entry may read.

    Raises:
        BadType, BadValue: there are fewer than two entries, a specification is not valid, or a program does not exist.
        ScenarioError (ValueError): a file, module or function does not exist.
    """
    texts = {as_name(name, "an entry"): _split_words(name, one) for name, one in as_mapping(given, "entries").items()}
    if len(texts) < 2:
        raise BadValue(f"A tournament needs two entries at least, not {len(texts)}.")
    files = {name: [_find_file(text, base) for text in some] for name, some in texts.items()}
    for name, (text, *_) in texts.items():
        if isinstance(given[name], str):  # errors name the file, not its copy
            file = files[name][0]
            reference = text if file is None else f"{file}:{text.rpartition(':')[2]}"
            find_function(reference, f"the entry {name!r}")
    entries = []
    for number, name in enumerate(sorted(texts)):
        others = chain.from_iterable(some for other, some in files.items() if other != name)
        closed = [out, *private, *(file for file in others if file is not None), find_home_folder()]
        copies = out / SCRATCH / secrets.token_hex()
        places = [None if file is None else _prepare_readable_paths(file, closed, copies) for file in files[name]]
        make = _make_python_entry if isinstance(given[name], str) else _make_program_entry
        entry = make(name, texts[name], places)
        if copies.exists():
            entry = entry._replace(copy=str(copies.absolute()), published=f"entries/{number:02d}")
        _refuse_readable(out, entry)
        entries.append(entry)
    return entries


def _refuse_readable(out: Path, entry: Entry) -> None:
    """Check that an entry cannot read the folder of the tournament, which has a secret until the end."""
    for one in (*entry.readable, *(() if entry.command else list_python_folders())):
        if out.resolve().is_relative_to(Path(one).resolve()):
            raise BadValue(
                f"The entry {entry.name!r} may read {one!r}, where {str(out)!r} lies. Choose another folder."
            )


def publish(entries: Iterable[Entry], out: Path) -> None:
    """Move the copies of entries to their published folders; the entries cannot be played afterwards."""
    for entry in entries:
        if entry.copy:
            place = out / entry.published
            place.parent.mkdir(exist_ok=True)
            remove_folder(place)
            Path(entry.copy).rename(place)


def _split_words(name: str, given: object) -> list[str]:
    if isinstance(given, str):
        if given.endswith(".py"):
            raise BadValue(f"The entry {name!r} needs the name of a function in {given!r}: '{given}:plan'.")
        return [as_name(given, f"the entry {name!r}")]
    words = as_items(given, f"entry {name!r}", "a program and its arguments, or 'file.py:function'")
    words = [as_name(word, f"a part of the entry {name!r}") for word in words]
    if not words:
        raise BadValue(f"The entry {name!r} is empty. Give 'file.py:function', or a program and its arguments.")
    return words


def _find_file(text: str, base: Path) -> Path | None:
    """Return the file that a text names, `file.py:function` included; None if it names no file."""
    left = text.rpartition(":")[0] or text
    for one in (text, left):
        file = base / one
        if one and file.is_file():
            return file.absolute()
    return None


def _prepare_readable_paths(file: Path, closed: Sequence[Path], copies: Path) -> tuple[Path, Path]:
    """Return the path of an entry's file, and the path that the entry may read; copy the file where needed.

    A file is copied if its folder has closed paths or too many files.
    """
    folder = file.parent.resolve()
    if file.is_relative_to(sys.prefix) or file.is_relative_to("/usr"):
        return file, file
    is_own = not any(one.resolve().is_relative_to(folder) for one in closed)
    if is_own and len(_list_files(folder)) < _MOST_FILES:
        return file, folder
    copies.mkdir(parents=True, exist_ok=True)
    copy = copies / file.name
    write_whole(copy, read_bytes(file.resolve(), _MOST_BYTES))
    copy.chmod(stat.S_IMODE(file.stat().st_mode) | stat.S_IRUSR)  # it may be a program
    return copy.absolute(), copies.absolute()


def _make_python_entry(name: str, texts: list[str], places: _Places) -> Entry:
    file, _, function = texts[0].rpartition(":")
    place = places[0]
    reference = f"{place[0]}:{function}" if place else texts[0]
    found, _ = find_function(reference, f"the entry {name!r}")
    readable = str(place[1]) if place else _find_package(found.module)
    digest = _digest([f"{file.rpartition('/')[2]}:{function}"], [readable])
    return Entry(name, reference, (), (readable,), digest, "", "")


def _make_program_entry(name: str, texts: list[str], places: _Places) -> Entry:
    words = [str(place[0]) if place else text for text, place in zip(texts, places, strict=True)]
    found = shutil.which(words[0])
    if found is None:
        raise BadValue(f"The entry {name!r} starts {words[0]!r}, and there is no such program.")
    program = Path(found).absolute()
    own = sorted({str(place[1]) for place in places if place})
    libraries = {
        str(one) for one in chain.from_iterable(_list_folders_beside(way) for way in (program, program.resolve()))
    }
    digest = _digest([place[0].name if place else text for text, place in zip(texts, places, strict=True)], own)
    return Entry(name, "", (str(program), *words[1:]), (*own, *sorted(libraries)), digest, "", "")


def _list_folders_beside(program: Path) -> Iterator[Path]:
    """Yield the folder of a program, and the folders of its libraries if it lies in a folder `bin`."""
    yield program.parent
    for name in _LIBRARIES if program.parent.name == "bin" else ():
        yield program.parent.parent / name


def _find_package(module: str) -> str:
    """Return the folder or file of an installed package."""
    from importlib.util import find_spec

    spec = find_spec(module.partition(".")[0])
    if spec is None or spec.origin is None:
        raise BadType(f"The package of {module!r} has no files.")
    origin = Path(spec.origin)
    return str(origin.parent if origin.name == "__init__.py" else origin)


def _list_files(folder: Path) -> list[Path]:
    found: list[Path] = []
    for parent, folders, names in os.walk(folder):
        folders[:] = sorted(one for one in folders if one not in _IGNORED_FOLDERS)
        found += [Path(parent, name) for name in sorted(names)]
        if len(found) >= _MOST_FILES:
            break
    return found


def _digest(texts: Iterable[str], readable: Iterable[str]) -> str:
    """Return the digest of an entry's command or function and of its files, by their paths in their folders."""
    whole = hashlib.sha256()
    left = _MOST_BYTES
    for text in texts:
        whole.update(f"{text}\n".encode())
    for place in map(Path, readable):
        for file in _list_files(place) if place.is_dir() else [place.resolve()]:
            content = os.fsencode(file.readlink()) if file.is_symlink() else read_bytes(file, _MOST_BYTES)
            left -= len(content)
            if left < 0:
                raise BadValue(
                    f"The files in {str(place)!r} take more than {_MOST_BYTES >> 20} MiB, too many to digest."
                )
            name = os.fsencode(file.relative_to(place) if place.is_dir() else place.name)
            whole.update(b"%s\n%s\n" % (name, hashlib.sha256(content).hexdigest().encode()))
    return whole.hexdigest()


def list_python_folders() -> list[str]:
    """Return the folders of Python and GAMMS, which every Python entry may read."""
    import gamms

    places = {sys.prefix, sys.base_prefix, sysconfig.get_path("stdlib"), str(Path(gamms.__file__).resolve().parent)}
    return sorted(places | {sysconfig.get_path("purelib"), sysconfig.get_path("platlib")})
