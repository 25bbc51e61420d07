"""Choose between the compiled and the interpreted form of the core."""

import os
import sys
import warnings
from collections.abc import Sequence
from importlib import import_module
from importlib.machinery import SOURCE_SUFFIXES, FileFinder, ModuleSpec, SourceFileLoader
from pathlib import Path
from types import ModuleType


def choose(package: str, folder: Path) -> bool:
    """Choose the form in which the modules of a package are loaded; return whether it is the compiled one.

    The environment variable `GAMMS_CORE` selects a form: `python` for the interpreted one, `compiled` to require the
    compiled one. If the source of a checkout has changed since it was compiled, the source runs interpreted, with a
    warning.

    Raises:
        ImportError: `GAMMS_CORE` has another value, or requires compiled modules that do not exist.
    """
    asked = os.environ.get("GAMMS_CORE", "")
    if asked not in ("", "python", "compiled"):
        raise ImportError(f"GAMMS_CORE is {asked!r}: set it to 'python' or 'compiled', or not at all.")
    if asked != "python" and _is_compiled(package, folder):
        return True
    if asked == "compiled":
        raise ImportError("GAMMS_CORE is 'compiled', and gamms.core is not: install it where a C compiler works.")
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


def _is_compiled(package: str, folder: Path) -> bool:
    """Return whether compiled modules can be loaded and, in a checkout, match the source."""
    try:
        stamp = import_module(f"{package}._stamp")
    except ModuleNotFoundError:
        return False
    except ImportError as error:
        reason = f"The compiled gamms.core cannot be loaded ({error})."
    else:
        is_checkout = (folder.parents[2] / "pyproject.toml").is_file()
        if not is_checkout or digest(folder) == stamp.TEXT:
            return True
        reason = "The text of gamms.core has changed since it was compiled."
    remedy = "It runs interpreted until it is compiled again: make, or python setup.py build_ext --inplace"
    warnings.warn(f"{reason} {remedy}", RuntimeWarning, stacklevel=2)
    return False


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
