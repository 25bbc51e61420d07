"""Which code a scenario names, and where it is: found by looking, without running any of it."""

import ast
import os
import sys
from importlib.util import find_spec
from pathlib import Path, PureWindowsPath
from typing import NamedTuple

from gamms.errors import nearest
from gamms.scenario.errors import ScenarioError


class Found(NamedTuple):
    """Where a reference leads."""

    path: str  # where in the scenario it stands
    text: str  # the reference
    module: str  # dotted; for a file, below the folder of the scenario
    function: str  # its name in the module; "" for the module's `map_strategy`
    file: Path | None  # None for a module of an installed package

    def __str__(self) -> str:
        """What `gamms run` says about it."""
        name = f"{self.module}:{self.function or 'map_strategy'}"
        return f"{name}, installed" if self.file is None else f"{name}, from {self.file}"


def inside(text: str, folder: Path | None, path: str, what: str) -> Path:
    """A file in the folder of a scenario or below, which need not be there.

    Raises:
        ScenarioError: it would be elsewhere, directly or through a symbolic link.
    """
    if folder is None:
        raise ScenarioError(path, f"{text!r} is a {what}, and a scenario that is no file needs folder= to find it in.")
    given = PureWindowsPath(text)  # knows both kinds of slash, and drives
    if given.anchor or ".." in given.parts or "\0" in text:
        raise ScenarioError(path, f"{text!r} leads out of the folder of the scenario. Put the {what} into it.")
    file = folder.joinpath(*given.parts)
    if not file.resolve().is_relative_to(folder.resolve()):
        raise ScenarioError(path, f"{text!r} leads out of the folder of the scenario, to {file.resolve()}.")
    return file


def find(text: str, folder: Path | None, path: str, *, short: str | None = None) -> Found:
    """Where the code of a reference is; nothing is imported but parts of GAMMS.

    Args:
        text: `module:function`, `file.py:function`, or one of these without `:function`.
        folder: of the scenario; looked through first. None: only installed packages.
        path: where in the scenario the reference stands.
        short: the module of a name without a colon; None if that is a module.

    Raises:
        ScenarioError: there is no such file, module or function, or it is not in the folder nor installed.
    """
    left, colon, function = text.partition(":")
    if (colon and not function.isidentifier()) or not left:
        raise ScenarioError(path, f"{text!r} is no reference to code; write module:function.")
    if not colon and short is not None:
        left, function = short, left
        if not function.isidentifier():
            raise ScenarioError(path, f"{text!r} is no reference to code; write module:function.")
    if left.endswith(".py") or "/" in left or "\\" in left:
        file = inside(left, folder, path, "Python file")
        if not file.is_file():
            raise ScenarioError(path, f"there is no file {left!r} in {folder}.{_neighbour(left, folder)}")
        dotted = ".".join(PureWindowsPath(left).with_suffix("").parts)
        if not all(part.isidentifier() for part in dotted.split(".")):
            raise ScenarioError(path, f"{left!r} cannot be imported: it may have letters, digits and _ in its name.")
        return _known(Found(path, text, dotted, function, file))
    if not all(part.isidentifier() for part in left.split(".")):
        raise ScenarioError(path, f"{text!r} is no reference to code; write module:function.")
    file_or_none = None if folder is None or left.partition(".")[0] == "gamms" else _in_folder(left, folder, path)
    if file_or_none is None:
        _check_installed(left, text, folder, path)
    return _known(Found(path, text, left, function, file_or_none))


def chosen(text: str, path: str) -> tuple[Found, Path]:
    """Where the code is that a person asks for, and the folder it is in: a file may be anywhere.

    Raises:
        ScenarioError: there is no such file, module or function.
    """
    left, colon, function = text.rpartition(":")
    if not colon:
        raise ScenarioError(path, f"{text!r} is no reference to code; write mine.py:strategy or module:function.")
    if not left.endswith(".py"):
        return find(text, Path.cwd(), path), Path.cwd()
    file = Path(left).absolute()
    return find(f"{file.name}:{function}", file.parent, path), file.parent


def _in_folder(dotted: str, folder: Path, path: str) -> Path | None:
    """The file of a module in the folder."""
    stem = "/".join(dotted.split("."))
    for text in (f"{stem}/__init__.py", f"{stem}.py"):
        if folder.joinpath(text).is_file():
            return inside(text, folder, path, "Python file")
    return None


def _check_installed(dotted: str, text: str, folder: Path | None, path: str) -> None:
    """Refuse a module that is not in an installed package."""
    top = dotted.split(".", maxsplit=1)[0]
    if top in sys.stdlib_module_names or top == "__main__":
        raise ScenarioError(path, f"{text!r} is no code for games: Python's own modules are not offered to scenarios.")
    try:
        spec = find_spec(top)
    except (ValueError, ImportError):
        spec = None
    if spec is None:
        where = "installed" if folder is None else f"in {folder}, nor installed"
        raise ScenarioError(
            path, f"there is no module {dotted!r} {where}.{_neighbour(dotted, folder) or _built_in(dotted)}"
        )
    places = list(spec.submodule_search_locations or ()) or [spec.origin or ""]
    if any(Path(place).resolve().parent in _casual_places() for place in places):
        raise ScenarioError(
            path, f"the module {dotted!r} is in {places[0]}, which is neither the folder of the scenario nor installed."
        )


def _casual_places() -> set[Path]:
    """Where Python finds modules only because of where it was started."""
    casual = {Path.cwd()}
    main = getattr(sys.modules.get("__main__"), "__file__", None)
    if main is not None:
        casual.add(Path(main).resolve().parent)
    chosen = {Path(one).resolve() for one in os.environ.get("PYTHONPATH", "").split(os.pathsep) if one}
    return casual - chosen - {Path(__file__).resolve().parents[2]}


def _neighbour(name: str, folder: Path | None) -> str:
    """A hint at a file of the folder with nearly that name."""
    if folder is None or not folder.is_dir():
        return ""
    names = sorted(file.name for file in folder.glob("*.py"))
    return nearest(name, names if name.endswith(".py") else [one.removesuffix(".py") for one in names])


def _built_in(name: str) -> str:
    near = nearest(name, offered("gamms.strategies"))
    return near.replace("Did you mean '", "Did you mean 'gamms.strategies:")


def _known(found: Found) -> Found:
    """The same, if its function can be seen in the file, or in GAMMS itself."""
    wanted = found.function or "map_strategy"
    names: set[str] | None = None
    if found.file is not None:
        names = _names_in(found.file, found.path)
    elif found.module.split(".")[0] == "gamms":
        names = set(offered(found.module))
    if names is not None and wanted not in names:
        where = found.file or found.module
        hint = nearest(wanted, sorted(names)) or (
            "" if found.function else " Write module:function, or give the module one."
        )
        raise ScenarioError(found.path, f"there is no function {wanted!r} in {where}.{hint}")
    return found


def offered(module: str) -> list[str]:
    """What a module of GAMMS offers; empty if there is no such module."""
    from importlib import import_module

    try:
        found = import_module(module)
    except ImportError:
        return []
    public = [name for name, value in vars(found).items() if callable(value) and not name.startswith("_")]
    return list(getattr(found, "__all__", public))


def _names_in(file: Path, path: str) -> set[str] | None:
    """The names that a file binds; None where only running it could tell."""
    try:
        tree = ast.parse(file.read_bytes(), str(file))
    except (SyntaxError, ValueError) as error:
        raise ScenarioError(path, f"{file} is no Python: {error}.") from None
    names: set[str] = set()
    waiting: list[ast.AST] = list(tree.body)
    while waiting:
        node = waiting.pop()
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)):
            names.add(node.name)
            continue
        if isinstance(node, ast.alias):
            names.add((node.asname or node.name).split(".")[0])
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            names.add(node.id)
        waiting.extend(ast.iter_child_nodes(node))
    return None if "*" in names or "__getattr__" in names else names
