"""Choose between the compiled and the interpreted form of the core."""

import os
import sys
import warnings
from collections.abc import Sequence
from importlib import import_module
from importlib.machinery import SOURCE_SUFFIXES, FileFinder, ModuleSpec, SourceFileLoader
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

_COMPILE = "Compile it again: make, or python setup.py build_ext --inplace."
_OF_ONE_INTERPRETER = ("one interpreter per process", "loading in subinterpreters")  # in errors of Cython, of Python


class _Problem(NamedTuple):
    """Why the compiled modules do not run."""

    reason: str
    way_out: str


_NOT_COMPILED = _Problem("There are no compiled modules.", "Install it where a C compiler works.")


def choose(package: str, folder: Path) -> bool:
    """Choose the form in which the modules of a package are loaded; return whether it is the compiled one.

    The environment variable `GAMMS_CORE` selects a form: `python` for the interpreted one, `compiled` to require the
    compiled one. The source runs interpreted, with a warning, if it has changed in a checkout since it was compiled, or
    if the compiled modules cannot be loaded, for example in a subinterpreter.

    Raises:
        ImportError: `GAMMS_CORE` has another value, or requires compiled modules that do not exist.
    """
    asked = os.environ.get("GAMMS_CORE", "")
    if asked not in ("", "python", "compiled"):
        raise ImportError(f"GAMMS_CORE is {asked!r}: set it to 'python' or 'compiled', or not at all.")
    problem = None if asked == "python" else _find_problem(package, folder)
    if asked != "python" and problem is None:
        return True
    if problem and asked == "compiled":
        raise ImportError(f"GAMMS_CORE is 'compiled', and gamms.core is not. {problem.reason} {problem.way_out}")
    if problem and problem is not _NOT_COMPILED:
        warnings.warn(
            f"{problem.reason} It runs interpreted: the same games, slower. {problem.way_out}",
            RuntimeWarning,
            stacklevel=2,
        )
    sys.meta_path.insert(0, _SourceFinder(package))  # else compiled modules of other text would be found first
    return False


def digest(folder: Path) -> str:
    """Return a hash of the compiled source: each `.pxd` file, and the `.py` file beside it."""
    from hashlib import sha256  # it takes milliseconds to load, and only checkouts need it

    total = sha256()
    types = sorted(folder.glob("*.pxd"))
    for file in [*types, *(one.with_suffix(".py") for one in types)]:
        text = file.read_bytes().replace(b"\r\n", b"\n")
        total.update(f"{file.name} {len(text)}\n".encode() + text)
    return total.hexdigest()


def _find_problem(package: str, folder: Path) -> _Problem | None:
    """Return why the compiled modules cannot be loaded or, in a checkout, are of other source; None: they run."""
    try:
        stamp = import_module(f"{package}._stamp")
    except ModuleNotFoundError:
        return _NOT_COMPILED
    except ImportError as error:
        if any(words in str(error) for words in _OF_ONE_INTERPRETER):
            reason = f"Only one interpreter of a process can load the compiled gamms.core ({error})."
            return _Problem(reason, "Other processes run it compiled; see the multiprocessing module.")
        return _Problem(f"The compiled gamms.core cannot be loaded ({error}).", _COMPILE)
    is_checkout = (folder.parents[2] / "pyproject.toml").is_file()
    if not is_checkout or digest(folder) == stamp.TEXT:
        return None
    return _Problem("The text of gamms.core has changed since it was compiled.", _COMPILE)


class _SourceFinder:
    """A finder for `sys.meta_path` that loads the modules of one package from source, and no other modules."""

    def __init__(self, package: str) -> None:
        self._prefix = f"{package}."

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Return the spec of a module of the package; None for any other module."""
        if not fullname.startswith(self._prefix):
            return None
        for folder in path or ():
            spec = FileFinder(folder, (SourceFileLoader, SOURCE_SUFFIXES)).find_spec(fullname, target)
            if spec is not None:
                return spec
        return None


def as_dict(value: dict[object, object]) -> dict[object, object]:
    """Return a dict unchanged; in compiled code, its type then selects the fast methods of `dict`."""
    return value
