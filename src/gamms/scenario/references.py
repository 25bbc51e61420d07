"""Which code a scenario names, and whether it may: found by looking, without importing any of it.

A name in a file may mean three things, and nothing else. In the folder of the file: a function that is defined there.
Of GAMMS: what the modules in `OFFERED` list. Of an installed package: what an entry point of the group
`gamms.scenario` names, or, if the caller allows the package, what that defines itself.
"""

import ast
import hashlib
import os
import sys
from collections.abc import Iterable
from importlib.util import find_spec
from pathlib import Path, PureWindowsPath
from typing import NamedTuple

from gamms.arguments import as_items
from gamms.errors import BadType, BadValue, nearest
from gamms.limits import refuse_above
from gamms.scenario.documents import ScenarioError, at
from gamms.text import shown

OFFERED = ("gamms.strategies", "gamms.rules", "gamms.rules.territory", "gamms.demo.strategies")
GROUP = "gamms.scenario"  # of entry points
_BYTES_PER_LETTER = 1 << 10  # that a file of Python takes as a syntax tree: "f();f();…" takes 720
_REFUSED = frozenset({"__main__", "gamms", *sys.stdlib_module_names})


class Sources(NamedTuple):
    """Where the code of a scenario may be. The caller says so, never a file.

    Attributes:
        folder: of the scenario; None: only GAMMS and installed packages.
        allow: installed packages that may be named without an entry point.
    """

    folder: Path | None = None
    allow: tuple[str, ...] = ()


class Found(NamedTuple):
    """Where a reference leads."""

    path: str  # where in the scenario it stands
    text: str  # the reference
    module: str  # dotted; for a file, below the folder of the scenario
    function: str  # its name in the module; "" for the module's `map_strategy`
    file: Path | None  # None for a module of an installed package
    owner: str | None  # the package that must define the function; None where its name alone says that it may be used

    def __str__(self) -> str:
        """What `gamms run` says about it."""
        name = f"{self.module}:{self.wanted}"
        return f"{name}, installed" if self.file is None else f"{name}, from {self.file}"

    @property
    def wanted(self) -> str:
        """The name of the function."""
        return self.function or "map_strategy"


def allowed(packages: Iterable[str]) -> tuple[str, ...]:
    """Check the packages that the caller allows.

    Raises:
        BadType: they are one text, or not texts.
        BadValue: one is not a package, or one whose functions are never offered.
    """
    names = tuple(as_items(packages, "allow", "names of packages, such as ['my_package'],"))
    if not all(isinstance(name, str) for name in names):
        raise BadType(f"allow must be names of packages, such as ['my_package'], not {shown(packages)}.")
    for name in names:
        if not _is_dotted(name):
            raise BadValue(f"{shown(name)} in allow is not the name of a package.")
        if name.partition(".")[0] in _REFUSED:
            raise BadValue(f"{shown(name)} cannot be allowed: scenarios never name all of GAMMS, nor of Python itself.")
    return names


def private_package(folder: Path) -> str:
    """Return the name under which the modules of a folder are imported."""
    return f"_gamms_scenario_{hashlib.sha256(str(folder.resolve()).encode()).hexdigest()[:16]}"


def is_defined_in(value: object, package: str) -> bool:
    """Whether calling a value calls what a package defines: a function, a class or an object of a class of its own."""

    def is_own(part: object) -> bool:
        name = getattr(part, "__module__", None)
        return isinstance(name, str) and (name == package or name.startswith(f"{package}."))

    if not callable(value) or not is_own(value):
        return False
    if not isinstance(value, type):
        return True
    makers = ((value.__init__, object.__init__), (value.__new__, object.__new__), (type(value).__call__, type.__call__))  # type: ignore[misc] # of the class itself
    return all(maker is plain or is_own(maker) for maker, plain in makers)


def inside(text: str, folder: Path | None, path: str, what: str) -> Path:
    """Return a file in the folder of a scenario or below, which need not exist.

    Raises:
        ScenarioError: it would be elsewhere, directly or through a symbolic link.
    """
    if folder is None:
        raise ScenarioError(path, f"{text!r} is a {what}, and a scenario without a file needs folder= to find it in.")
    given = PureWindowsPath(text)  # knows both kinds of slash, and drives
    if given.anchor or ".." in given.parts or "\0" in text:
        raise ScenarioError(path, f"{text!r} leads out of the folder of the scenario. Put the {what} into it.")
    file = folder.joinpath(*given.parts)
    if not file.resolve().is_relative_to(folder.resolve()):
        raise ScenarioError(path, f"{text!r} leads out of the folder of the scenario, to {file.resolve()}.")
    return file


def find(text: str, sources: Sources, path: str, *, short: str | None = None) -> Found:
    """Find the code of a reference; nothing is imported but the parts of GAMMS that are offered.

    Args:
        text: `module:function`, `file.py:function`, or one of these without `:function`.
        sources: where it may be; the folder is looked through first.
        path: where in the scenario the reference stands.
        short: the module of a name without a colon; None if that is a module.

    Raises:
        ScenarioError: there is no such file, module or function, or it may not be named.
    """
    found = _located(text, sources, path, short)
    if found.file is not None:
        own, others = _names_in(found.file, path)
        if found.wanted in others - own:
            raise ScenarioError(
                path, f"{found.wanted!r} is not defined in {found.file}, only imported there. Name it where it is."
            )
        _check_known(found, own, found.file)
    elif found.module in OFFERED:
        _check_known(found, offered(found.module), found.module)
    return found


def chosen(text: str, path: str) -> tuple[Found, Path]:
    """Find the code that a person names, and its folder: a file may be anywhere.

    Raises:
        ScenarioError: there is no such file, module or function.
    """
    left, colon, function = text.rpartition(":")
    if not colon:
        raise ScenarioError(path, f"{text!r} is not a reference to code; write mine.py:strategy or module:function.")
    file = Path(left).absolute() if left.endswith(".py") else None
    folder = Path.cwd() if file is None else file.parent
    top = left.partition(".")[0]
    allow = (top,) if file is None and _is_dotted(left) and top not in _REFUSED else ()
    found = _located(text if file is None else f"{file.name}:{function}", Sources(folder, allow), path)
    if found.file is not None:
        _check_known(found, set().union(*_names_in(found.file, path)), found.file)
    elif found.module in OFFERED:
        _check_known(found, offered(found.module), found.module)
    return found._replace(owner=None), folder


def offered(module: str) -> list[str]:
    """Return what a module of GAMMS offers; empty if it is for programs only."""
    from importlib import import_module

    if module not in OFFERED:
        return []
    found = import_module(module)
    return [name for name in found.__all__ if callable(getattr(found, name))]


def _located(text: str, sources: Sources, path: str, short: str | None = None) -> Found:
    """Return where a reference leads, without a look whether the function is there."""
    folder = sources.folder
    left, colon, function = text.partition(":")
    if not colon and short is not None:
        left, colon, function = short, ":", left
    if (colon and not function.isidentifier()) or not left:
        raise ScenarioError(path, f"{shown(text)} is not a reference to code; write module:function.")
    if left.endswith(".py") or "/" in left or "\\" in left:
        file = inside(left, folder, path, "Python file")
        if not file.is_file():
            raise ScenarioError(path, f"there is no file {left!r} in {folder}.{_neighbour(left, folder)}")
        dotted = ".".join(PureWindowsPath(left).with_suffix("").parts)
        if not _is_dotted(dotted):
            raise ScenarioError(path, f"{left!r} cannot be imported: it may have letters, digits and _ in its name.")
        return _in(folder or Path(), Found(path, text, dotted, function, file, None))
    if not _is_dotted(left):
        raise ScenarioError(path, f"{shown(text)} is not a reference to code; write module:function.")
    if left.partition(".")[0] == "gamms":
        if left not in OFFERED:
            hint = nearest(left, OFFERED) or f" Scenarios may name what is in {', '.join(OFFERED)}."
            raise ScenarioError(path, f"{left!r} is not offered to scenarios.{hint}")
        return Found(path, text, left, function, None, None)
    in_folder = None if folder is None else _in_folder(left, folder, path)
    if folder is not None and in_folder is not None:
        return _in(folder, Found(path, text, left, function, in_folder, None))
    found = Found(path, text, left, function, None, None)
    return found._replace(owner=_owner(found, sources))


def _in(folder: Path, found: Found) -> Found:
    """Return the same, if no package that is imported on the way to it leads out of the folder."""
    *packages, _ = found.module.split(".")
    for depth in range(1, len(packages) + 1):
        inside("/".join([*packages[:depth], "__init__.py"]), folder, found.path, "Python file")
    return found._replace(owner=private_package(folder))


def _in_folder(dotted: str, folder: Path, path: str) -> Path | None:
    """Return the file of a module in the folder."""
    stem = "/".join(dotted.split("."))
    for text in (f"{stem}/__init__.py", f"{stem}.py"):
        if folder.joinpath(text).is_file():
            return inside(text, folder, path, "Python file")
    return None


def _owner(found: Found, sources: Sources) -> str:
    """Return the installed package, or the part of it, whose functions may be named.

    Raises:
        ScenarioError: it is not installed, or was not allowed to be named.
    """
    dotted, top, path = found.module, found.module.partition(".")[0], found.path
    if top in _REFUSED:
        raise ScenarioError(
            path, f"{found.text!r} is not code for games: Python's own modules are not offered to scenarios."
        )
    try:
        spec = find_spec(top)
    except (ValueError, ImportError):
        spec = None
    if spec is None:
        where = "installed" if sources.folder is None else f"in {sources.folder}, nor installed"
        hint = _neighbour(dotted, sources.folder) or _built_in(dotted)
        raise ScenarioError(path, f"there is no module {dotted!r} {where}.{hint}")
    for package in sources.allow:
        if dotted == package or dotted.startswith(f"{package}."):
            return package
    places = list(spec.submodule_search_locations or ()) or [spec.origin or ""]
    if any(Path(place).resolve().parent in _casual_places() for place in places):
        raise ScenarioError(
            path, f"the module {dotted!r} is in {places[0]}, which is neither the folder of the scenario nor installed."
        )
    for module, function in _entry_points():
        if module == dotted and function in ("", found.wanted):
            return top if function else module
    raise ScenarioError(
        path,
        f"the installed package {top!r} does not offer {dotted}:{found.wanted} to scenarios."
        f"{_neighbour(dotted, sources.folder)} If you trust this file with all that the package defines: "
        f"--allow {top}, or allow=[{top!r}] in Python.",
    )


def _entry_points() -> Iterable[tuple[str, str]]:
    """Yield module and function of what installed packages offer to scenarios; "" for all that a module defines."""
    from importlib.metadata import entry_points

    for entry in entry_points(group=GROUP):
        module, _, function = entry.value.partition("[")[0].partition(":")
        yield module.strip(), function.strip()


def _casual_places() -> set[Path]:
    """Return the folders where Python finds modules only because of where it was started."""
    casual = {Path.cwd()}
    main = getattr(sys.modules.get("__main__"), "__file__", None)
    if main is not None:
        casual.add(Path(main).resolve().parent)
    chosen = {Path(one).resolve() for one in os.environ.get("PYTHONPATH", "").split(os.pathsep) if one}
    return casual - chosen - {Path(__file__).resolve().parents[2]}


def _neighbour(name: str, folder: Path | None) -> str:
    """Return a hint at a file of the folder with nearly that name."""
    if folder is None or not folder.is_dir():
        return ""
    names = sorted(file.name for file in folder.glob("*.py"))
    return nearest(name, names if name.endswith(".py") else [one.removesuffix(".py") for one in names])


def _built_in(name: str) -> str:
    near = nearest(name, offered("gamms.strategies"))
    return near.replace("Did you mean '", "Did you mean 'gamms.strategies:")


def _check_known(found: Found, names: Iterable[str], where: object) -> None:
    """Refuse a function that can be seen not to be there."""
    if found.wanted in names or "*" in names:
        return
    hint = nearest(found.wanted, sorted(names)) or (
        "" if found.function else " Write module:function, or give the module one."
    )
    raise ScenarioError(found.path, f"there is no function {found.wanted!r} in {where}.{hint}")


def _is_dotted(text: str) -> bool:
    return all(part.isidentifier() for part in text.split("."))


def _names_in(file: Path, path: str) -> tuple[set[str], set[str]]:
    """Return the names that a file binds: those of the folder's own, and those that it imports from elsewhere.

    "*" is among its own where only running it could tell.
    """
    with at(path):
        refuse_above(file.stat().st_size * _BYTES_PER_LETTER, f"reading {file}")
    try:
        tree = ast.parse(file.read_bytes(), str(file))
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        raise ScenarioError(path, f"{file} is not Python: {error}.") from None
    own: set[str] = set()
    others: set[str] = set()
    waiting: list[ast.AST] = list(tree.body)
    while waiting:
        node = waiting.pop()
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)):
            own.add("*" if node.name == "__getattr__" else node.name)
            continue
        if isinstance(node, (ast.Import, ast.ImportFrom)):
            names = {(alias.asname or alias.name).partition(".")[0] for alias in node.names}
            is_own = "*" in names or (isinstance(node, ast.ImportFrom) and node.level > 0)
            (own if is_own else others).update(names)
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            own.add(node.id)
        waiting.extend(ast.iter_child_nodes(node))
    return own, others
