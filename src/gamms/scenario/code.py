"""The code that a scenario names: find it without importing, then import and call it.

A name in a file has one of three meanings. In the folder of the file: a function that is defined there. In GAMMS: a
name that the modules in `OFFERED` list, or those in `ON_REQUEST` if the caller allows them. In an installed package: a
name that an entry point of the group `gamms.scenario` gives, or, if the caller allows the package, a function that the
package defines itself.
"""

import ast
import hashlib
import importlib
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, nullcontext, suppress
from difflib import get_close_matches
from functools import lru_cache, partial, update_wrapper
from importlib.util import find_spec
from inspect import Parameter
from itertools import islice
from pathlib import Path, PureWindowsPath
from types import FunctionType, ModuleType
from typing import Any, NamedTuple

from gamms.arguments import as_items, find_signature
from gamms.context import Context
from gamms.errors import BadType, BadValue, UnknownAttribute, nearest
from gamms.limits import refuse_above
from gamms.plain import Plain
from gamms.scenario.documents import ScenarioError, copy_plain, join_path, locate_errors
from gamms.text import parse_syntax, shown
from gamms.typing.actions import is_factory, make_strategy
from gamms.typing.game import PRIVATE_MODULES

OFFERED = (
    *("gamms.strategies", "gamms.rules", "gamms.rules.territory", "gamms.demo.strategies"),
    *("gamms.planning", "gamms.rl", "gamms.solve", "gamms.suite", "gamms.web"),
)
HUMAN = "human"  # instead of a reference to a strategy: a person plays
ON_REQUEST = ("gamms.llm",)  # offered only if the caller allows it: it sends agents' knowledge to a server
GROUP = "gamms.scenario"  # of entry points
RULES = "gamms.rules"  # the module of rules that are named without a module
GIVEN_LATER = ("ctx", "state", "states", "arrays")  # first parameters that the game supplies, not the file
_ARGUMENTS = {"strategy": ("state",), "plan": ("states", "arrays"), "rule": ("ctx",)}
_FEW = 8  # names that an error lists
_NAMED = (Parameter.POSITIONAL_OR_KEYWORD, Parameter.KEYWORD_ONLY)
_BYTES_PER_LETTER = 1 << 10  # of memory for the syntax tree of a Python file: "f();f();…" takes 720
_REFUSED = frozenset({"__main__", "gamms", *sys.stdlib_module_names})
_stamps: dict[str, dict[str, tuple[int, int]]] = {}  # private package -> modification times and sizes of its files


Function = Callable[..., Any]
Parameters = Mapping[str, Plain]


class CodeSources(NamedTuple):
    """The places where the code of a scenario may be; set by the caller, never by a file.

    Attributes:
        folder: the folder of the scenario; None: only GAMMS and installed packages.
        allow: installed packages that may be named without an entry point.
        key_variable: the environment variable with the key of a language model; None: no key.
    """

    folder: Path | None = None
    allow: tuple[str, ...] = ()
    key_variable: str | None = None


class CodeReference(NamedTuple):
    """A resolved reference to code: its module, function and file."""

    path: str  # its place in the scenario
    text: str  # the reference
    module: str  # dotted; for a file, relative to the folder of the scenario
    function: str  # its name in the module; "" for the module's `map_strategy`
    file: Path | None  # None for a module of an installed package
    owner: str | None  # the package that must define the function; None if its name alone permits its use

    def __str__(self) -> str:
        """Name the function and its file, as `gamms run` prints it."""
        name = f"{self.module}:{self.wanted}"
        return f"{name}, installed" if self.file is None else f"{name}, from {self.file}"

    @property
    def wanted(self) -> str:
        """The name of the function."""
        return self.function or "map_strategy"


def check_packages(packages: Iterable[str]) -> tuple[str, ...]:
    """Check the packages that a caller allows.

    Raises:
        BadType: they are a single text, or not texts.
        BadValue: one is not a package, or is a package that can never be allowed.
    """
    names = tuple(as_items(packages, "allow", "names of packages, such as ['my_package'],"))
    if not all(isinstance(name, str) for name in names):
        raise BadType(f"allow must be names of packages, such as ['my_package'], not {shown(packages)}.")
    for name in names:
        if not _is_dotted(name):
            raise BadValue(f"{shown(name)} in allow is not the name of a package.")
        if name.partition(".")[0] in _REFUSED and name not in ON_REQUEST:
            raise BadValue(f"{shown(name)} cannot be allowed: scenarios never name all of GAMMS, nor of Python itself.")
    return names


def name_private_package(folder: Path) -> str:
    """Return the name under which the modules of a folder are imported."""
    return f"{PRIVATE_MODULES}{hashlib.sha256(os.fsencode(folder.resolve())).hexdigest()[:16]}"


def is_defined_in(value: object, package: str) -> bool:
    """Return whether a package defines a callable: a function, a class, or the class of an object."""

    def is_own(part: object) -> bool:
        name = getattr(part, "__module__", None)
        return isinstance(name, str) and (name == package or name.startswith(f"{package}."))

    if not callable(value) or not is_own(value):
        return False
    if not isinstance(value, type):
        return True
    makers = ((value.__init__, object.__init__), (value.__new__, object.__new__), (type(value).__call__, type.__call__))  # type: ignore[misc] # of the class itself
    return all(maker is plain or is_own(maker) for maker, plain in makers)


def find_path(text: str, folder: Path | None, path: str, what: str) -> Path:
    """Return the path of a file in the folder of a scenario or below, whether it exists or not.

    Raises:
        ScenarioError: the path leads elsewhere, directly or through a symbolic link, or to a pipe, socket or device.
    """
    if folder is None:
        raise ScenarioError(path, f"{text!r} is a {what}, and a scenario without a file needs folder= to find it in.")
    given = PureWindowsPath(text)  # understands both kinds of slash, and drives
    if given.anchor or ".." in given.parts or "\0" in text:
        raise ScenarioError(path, f"{text!r} leads out of the folder of the scenario. Put the {what} into it.")
    file = folder.joinpath(*given.parts)
    if not file.resolve().is_relative_to(folder.resolve()):
        raise ScenarioError(path, f"{text!r} leads out of the folder of the scenario, to {file.resolve()}.")
    if file.exists() and not (file.is_file() or file.is_dir()):
        raise ScenarioError(path, f"{text!r} is a pipe, socket or device. Put a {what} in its place.")
    return file


def find(text: str, sources: CodeSources, path: str, *, short: str | None = None) -> CodeReference:
    """Find the code of a reference; only the offered modules of GAMMS are imported.

    Args:
        text: `module:function`, `file.py:function`, or one of these without `:function`.
        sources: the places where it may be; the folder is searched first.
        path: the place of the reference in the scenario.
        short: the module of a name without a colon; None if that is a module.

    Raises:
        ScenarioError: the file, module or function does not exist, or may not be named.
    """
    return _check_reference(_locate_reference(text, sources, path, short), is_imported_allowed=False)


def find_function(text: str, path: str) -> tuple[CodeReference, Path]:
    """Find the code that a person names, in a file anywhere or a module, and return it with its folder.

    Raises:
        ScenarioError: the file, module or function does not exist.
    """
    left, colon, function = _describe_reference(text, None).rpartition(":")
    if not colon:
        form = "write mine.py:strategy or module:function"
        raise ScenarioError(path, f"{text!r} is not a reference to code; {form}.{_suggest_built_in(text)}")
    file = Path(left).absolute() if left.endswith(".py") else None
    folder = Path.cwd() if file is None else file.parent
    top = left.partition(".")[0]
    allow = (top,) if file is None and _is_dotted(left) and top not in _REFUSED else ()
    found = _locate_reference(f"{left if file is None else file.name}:{function}", CodeSources(folder, allow), path)
    return _check_reference(found, is_imported_allowed=True)._replace(owner=None), folder


def list_offered_functions(module: str) -> Mapping[str, Function]:
    """Return the functions that a module of GAMMS offers, by name; {} if it is only for programs.

    They are listed by its `FOR_SCENARIOS`, or else by its `__all__`.
    """
    if module not in (*OFFERED, *ON_REQUEST):
        return {}
    found = importlib.import_module(module)
    chosen: Mapping[str, Function] | None = getattr(found, "FOR_SCENARIOS", None)
    listed = ((name, getattr(found, name)) for name in found.__all__)
    return {name: one for name, one in listed if callable(one)} if chosen is None else chosen


def find_offered_function(text: str, short: str | None = None) -> Function | None:
    """Return the function of a reference if GAMMS offers it; see `find`."""
    module, _, name = _describe_reference(text, short).partition(":")
    return list_offered_functions(module).get(name)


def locate_files(function: Function, given: Parameters, sources: CodeSources, path: str) -> dict[str, Plain]:
    """Return parameters with files resolved in the folder of the scenario, and with the user's own settings.

    Attributes of the function name these parameters: `files` must exist, `new_files` may be created, and `variables`
    are environment variables.

    Raises:
        ScenarioError: a file does not exist or is elsewhere; or an environment variable is named.
    """
    found = dict(given)
    new = getattr(function, "new_files", ())
    for key in (*getattr(function, "files", ()), *new):
        text = found.get(key)
        where = join_path(path, f"with.{key}")
        if isinstance(text, str):
            file = find_path(text, sources.folder, where, "file")
            if key not in new and not file.is_file():
                raise ScenarioError(where, f"there is no file {text!r} in {sources.folder}.")
            found[key] = str(file)
    for key in getattr(function, "variables", ()):
        if key in found:
            raise ScenarioError(
                join_path(path, f"with.{key}"),
                "a file names no environment variable, which may hold any secret. Take it out, and name the variable "
                f"yourself: --key-variable NAME on the command line, load(…, {key}=…) in Python.",
            )
        if sources.key_variable is not None:
            found[key] = sources.key_variable
    return found


def _locate_reference(text: str, sources: CodeSources, path: str, short: str | None = None) -> CodeReference:
    """Find the module of a reference, without checking whether the function exists."""
    folder = sources.folder
    left, colon, function = _describe_reference(text, short).partition(":")
    is_file = left.endswith(".py") or "/" in left or "\\" in left
    if (colon and not function.isidentifier()) or not (is_file or _is_dotted(left)):
        hint = " Parameters belong into with: {…}." if "(" in text else ""
        raise ScenarioError(path, f"{shown(text)} is not a reference to code; write module:function.{hint}")
    if is_file:
        file = find_path(left, folder, path, "Python file")
        if not file.is_file():
            raise ScenarioError(path, f"there is no file {left!r} in {folder}.{_suggest_file(left, folder)}")
        dotted = ".".join(PureWindowsPath(left).with_suffix("").parts)
        if not _is_dotted(dotted):
            raise ScenarioError(path, f"{left!r} cannot be imported: it may have letters, digits and _ in its name.")
        return _check_folder(folder or Path(), CodeReference(path, text, dotted, function, file, None))
    found = CodeReference(path, text, left, function, None, None)
    if left.partition(".")[0] == "gamms":
        if left in ON_REQUEST and left not in sources.allow:
            raise ScenarioError(
                path,
                f"{left!r} sends what agents know to a server, with a key of yours. If you trust this file with that: "
                f"--allow {left}, or allow=[{left!r}] in Python.",
            )
        if left not in (*OFFERED, *ON_REQUEST):
            module, _, name = left.rpartition(".")
            meant = f" Did you mean '{module}:{name}'?" if module in OFFERED and not colon else nearest(left, OFFERED)
            hint = meant or f" Scenarios may name what is in {', '.join(OFFERED)}."
            raise ScenarioError(path, f"{left!r} is not offered to scenarios.{hint}")
        return found
    stem = left.replace(".", "/")
    for name in (f"{stem}/__init__.py", f"{stem}.py") if folder is not None else ():
        if folder is not None and folder.joinpath(name).is_file():
            return _check_folder(folder, found._replace(file=find_path(name, folder, path, "Python file")))
    return found._replace(owner=_find_owner(found, sources))


def _check_folder(folder: Path, found: CodeReference) -> CodeReference:
    """Check that no parent package of a module leads out of the folder."""
    *packages, _ = found.module.split(".")
    for depth in range(1, len(packages) + 1):
        find_path("/".join([*packages[:depth], "__init__.py"]), folder, found.path, "Python file")
    return found._replace(owner=name_private_package(folder))


def _suggest_built_in(name: str) -> str:
    """Return the hint that a strategy of GAMMS has a name like this one."""
    return nearest(name, list_offered_functions("gamms.strategies")).replace("mean '", "mean 'gamms.strategies:")


def _find_owner(found: CodeReference, sources: CodeSources) -> str:
    """Return the installed package, or its part, whose functions may be named."""
    from importlib.metadata import entry_points

    dotted = found.module
    top = found.module.partition(".")[0]
    path = found.path
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
        hint = (
            _suggest_file(dotted, sources.folder)
            or _suggest_built_in(dotted)
            or _suggest_function(found, sources.folder)
        )
        raise ScenarioError(path, f"there is no module {dotted!r} {where}.{hint}")
    for package in sources.allow:
        if dotted == package or dotted.startswith(f"{package}."):
            return package
    places = list(spec.submodule_search_locations or ()) or [spec.origin or ""]
    if any(Path(place).resolve().parent in _start_folders() for place in places):
        raise ScenarioError(
            path, f"the module {dotted!r} is in {places[0]}, which is neither the folder of the scenario nor installed."
        )
    for entry in entry_points(group=GROUP):
        module, _, function = (part.strip() for part in entry.value.partition("[")[0].partition(":"))
        if module == dotted and function in (
            "",
            found.wanted,
        ):  # without a function, everything that the module defines
            return top if function else module
    raise ScenarioError(
        path,
        f"the installed package {top!r} does not offer {dotted}:{found.wanted} to scenarios."
        f"{_suggest_file(dotted, sources.folder)} If you trust this file with all that the package defines: "
        f"--allow {top}, or allow=[{top!r}] in Python.",
    )


def _start_folders() -> set[Path]:
    """Return the folders from which Python imports modules only because of where it was started."""
    folders = {Path.cwd()}
    main = getattr(sys.modules.get("__main__"), "__file__", None)
    if main is not None:
        folders.add(Path(main).resolve().parent)
    chosen = {Path(one).resolve() for one in os.environ.get("PYTHONPATH", "").split(os.pathsep) if one}
    return folders - chosen - {Path(__file__).resolve().parents[2]}


def _suggest_file(name: str, folder: Path | None) -> str:
    """Return a hint at a file in the folder with a similar name."""
    if folder is None or not folder.is_dir():
        return ""
    names = sorted(file.name for file in folder.glob("*.py"))
    return nearest(name, names if name.endswith(".py") else [one.removesuffix(".py") for one in names])


def _suggest_function(found: CodeReference, folder: Path | None) -> str:
    """Return a hint at a function in the folder whose name is like that of a reference without a module."""
    way_out = f" Write module:function, such as strategies:{found.module}."
    if found.function or folder is None:
        return "" if found.function else way_out
    functions = {}
    for file in islice(sorted(folder.glob("*.py")), _FEW):
        own, _ = _list_names(file, found.path)
        functions.update(dict.fromkeys(own, file.stem))
    meant = get_close_matches(found.module, functions, 1)
    return f" Did you mean '{functions[meant[0]]}:{meant[0]}'?" if meant else way_out


def _check_reference(found: CodeReference, *, is_imported_allowed: bool) -> CodeReference:
    """Refuse a function that evidently does not exist, or is defined elsewhere."""
    if found.file is not None:
        own, others = _list_names(found.file, found.path)
        if found.wanted in others - own and not is_imported_allowed:
            raise ScenarioError(
                found.path,
                f"{found.wanted!r} is not defined in {found.file}, only imported there. Name it where it is.",
            )
        names: Iterable[str] = own | others if is_imported_allowed else own
    elif found.module in (*OFFERED, *ON_REQUEST):
        names = list_offered_functions(found.module)
    else:
        return found
    if found.wanted not in names and "*" not in names:
        hint = nearest(found.wanted, sorted(names))
        if not hint:
            there = ", ".join(islice((name for name in sorted(names) if not name.startswith("_")), _FEW))
            hint = f" It has: {there}." if there else ""
        if not found.function:
            hint += " Write module:function, or give the module one."
        raise ScenarioError(found.path, f"there is no function {found.wanted!r} in {found.file or found.module}.{hint}")
    return found


def _is_dotted(text: str) -> bool:
    return all(part.isidentifier() for part in text.split("."))


def _list_names(file: Path, path: str) -> tuple[set[str], set[str]]:
    """Return the names that a file binds, defined in the folder or imported from elsewhere.

    "*" among its own names means that only running the file could tell.
    """
    with locate_errors(path):
        refuse_above(file.stat().st_size * _BYTES_PER_LETTER, f"reading {file}")
    try:
        tree = parse_syntax(file.read_bytes(), str(file))
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


# -- importing and calling --------------------------------------------------------------------------------------


class CodeLibrary:
    """The functions of a scenario, each imported once.

    Args:
        sources: the places where they may be.
    """

    def __init__(self, sources: CodeSources) -> None:
        self.sources = sources
        self.folder = sources.folder
        self._known: dict[str, Function] = {}
        self._stamps: dict[str, tuple[int, int]] = {}  # of the imported files of the folder

    def get(self, text: str, path: str, short: str | None = None) -> Function:
        """Import the function of a reference; see `find`.

        Raises:
            ScenarioError: it does not exist; the error names the path.
        """
        found = self.get_known(text, short)
        if found is None:
            found = import_function(find(text, self.sources, path, short=short), self.folder)
            self._known[_describe_reference(text, short)] = found
            if self.folder is not None:
                package = name_private_package(self.folder)
                self._stamps = {**_stamps.get(package, {}), **self._stamps}
        return found

    def is_current(self) -> bool:
        """Return whether no file of the folder has changed since its functions were imported."""
        return self.folder is None or self._stamps == _read_stamps(name_private_package(self.folder))

    def get_known(self, text: str, short: str | None = None) -> Function | None:
        """Return the function of a reference if it has been imported; else None."""
        return self._known.get(_describe_reference(text, short))


def _describe_reference(text: str, short: str | None) -> str:
    if text == HUMAN:
        return f"gamms.web:{HUMAN}"
    return f"{short}:{text}" if short and ":" not in text else text


def import_function(found: CodeReference, folder: Path | None) -> Function:
    """Import the code of a reference.

    A module from the folder gets a private name, so that `strategies.py` of two scenarios are two modules, and
    `sys.path` stays as it is. Modules beside it are available by relative imports. No files are written beside it.

    Raises:
        ScenarioError: importing it raises, which is then the cause; or it does not define the function itself.
    """
    with _raise_scenario_errors(found.path, f"importing {found.text!r} failed:"):
        module = (
            importlib.import_module(found.module) if found.file is None else _import_privately(found, folder or Path())
        )
        own = list_offered_functions(found.module) if found.file is None else {}
        function: Function | None = own.get(found.wanted) or getattr(module, found.wanted, None)
    if function is not None and not callable(function):
        raise ScenarioError(found.path, f"{found.wanted!r} in {found.text!r} is not a function, but {shown(function)}.")
    if function is None:
        hint = nearest(found.wanted, [name for name in vars(module) if not name.startswith("_")])
        raise ScenarioError(found.path, f"there is no function {found.wanted!r} in {found.text!r}.{hint}")
    if found.owner is not None and not is_defined_in(function, found.owner):
        raise ScenarioError(
            found.path,
            f"{found.wanted!r} in {found.text!r} is from elsewhere, {getattr(function, '__module__', 'nowhere')}. A "
            "scenario may name what is defined there: write a function that calls it.",
        )
    return function


@contextmanager
def _raise_scenario_errors(path: str, what: str) -> Iterator[None]:
    """Turn errors of a scenario's code, SystemExit included, into an error at the place that names the code."""
    try:
        yield
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        hint = UnknownAttribute.hint_of(error)
        raise ScenarioError(path, f"{what} {type(error).__name__}: {error}{hint}") from error


def _import_privately(found: CodeReference, folder: Path) -> ModuleType:
    """Import a module of a scenario's folder under a private name, again if a file has changed."""
    folder = folder.resolve()
    package = name_private_package(folder)
    if _stamps.get(package) != _read_stamps(package):
        forget_modules(folder)
    if package not in sys.modules:
        sys.modules[package] = ModuleType(package)
        sys.modules[package].__path__ = [str(folder)]
    importlib.invalidate_caches()
    before = sys.dont_write_bytecode
    sys.dont_write_bytecode = True
    try:
        module = importlib.import_module(f"{package}.{found.module}")
    finally:
        sys.dont_write_bytecode = before
    _stamps[package] = _read_stamps(package)
    return module


def forget_modules(folder: Path) -> None:
    """Let the modules of a folder be imported again when they are used next."""
    package = name_private_package(folder)
    for name in [name for name in sys.modules if name.partition(".")[0] == package]:
        del sys.modules[name]


def _read_stamps(package: str) -> dict[str, tuple[int, int]]:
    """Return the times and sizes of the loaded files of a private package."""
    modules = [module for name, module in [*sys.modules.items()] if name.startswith(f"{package}.")]
    files = [file for module in modules if (file := getattr(module, "__file__", None))]
    return {file: _read_stamp(file) for file in files}


def _read_stamp(file: str) -> tuple[int, int]:
    with suppress(OSError):
        status = os.stat(file)  # noqa: PTH116 - a text
        return (status.st_mtime_ns, status.st_size)
    return (0, 0)


def make_from_function(function: Function, given: Parameters, ctx: Context, path: str, what: str) -> Function:
    """Return the strategy, plan or rule that a function is or makes.

    A function whose first parameter has a name in `_ARGUMENTS` is one itself. A function whose first parameter is
    `ctx`, or that can be called with the given parameters alone, makes one. For any other strategy see `make_strategy`;
    any other plan or rule is one itself if it gets no parameters.

    Args:
        function: the function.
        given: its parameters.
        ctx: the context.
        path: the place in the scenario that names it.
        what: "strategy", "plan" or "rule".

    Raises:
        ScenarioError: the parameters do not fit, or its result is not a function.
    """
    first = find_first_parameter(function)
    name = getattr(function, "__name__", function)
    if what == "rule" and first == "state":
        raise ScenarioError(path, f"{name} takes a state: it is not a rule, but a strategy.")
    if what == "strategy" and first not in ("state", "ctx") and first not in given and is_needing_more(function):
        check_parameters(function, given, 1, path)
        asked = partial(function, **given) if given else function
        with nullcontext() if is_factory(asked) is False else _raise_scenario_errors(path, f"{name} raised"):
            found: Function = make_strategy(ctx, asked)
        return update_wrapper(asked, function) if given and found is asked else found
    if first in _ARGUMENTS[what] or (first != "ctx" and not given and is_needing_more(function)):
        check_parameters(function, given, 1, path)
        return update_wrapper(partial(function, **given), function) if given else function
    one = call_function(function, given, (ctx,) if first == "ctx" else (), path)
    if not callable(one):
        raise ScenarioError(path, f"{name} gives {shown(one)}, which is not a {what}.")
    return one  # type: ignore[no-any-return] # it can be called


def call_function(function: Function, given: Parameters, first: tuple[object, ...], path: str) -> Any:
    """Call a function and return its result.

    Raises:
        ScenarioError: the parameters do not fit, or the function raises, which is then the cause.
    """
    check_parameters(function, given, len(first), path)
    with _raise_scenario_errors(path, f"{getattr(function, '__name__', function)} raised"):
        return function(*first, **given)


def check_parameters(function: Function, given: Iterable[str], first: int, path: str) -> None:
    """Check parameters against a function's signature, without its first `first` parameters.

    Raises:
        ScenarioError: a parameter is unknown or missing.
    """
    known = _list_parameters(function)
    if known is None:
        return
    name = getattr(function, "__name__", str(function))
    takes_all = any(one.kind is Parameter.VAR_KEYWORD for one in known)
    left = {one.name: one for one in known[first:] if one.kind in _NAMED}
    for key in given:
        if key not in left and not takes_all:
            others = [other for other in left if other not in given]
            hint = nearest(key, others) or (f" It takes: {', '.join(left)}." if left else " It takes none.")
            raise ScenarioError(join_path(path, f"with.{key}"), f"{name} takes no such parameter.{hint}")
    for key, one in left.items():
        if one.default is Parameter.empty and key not in given:
            raise ScenarioError(join_path(path, f"with.{key}"), f"is missing; {name} needs it.")


def find_first_parameter(function: Function) -> str:
    """Return the name of the first parameter, or ""."""
    return next((one.name for one in _list_parameters(function) or ()), "")


def is_needing_more(function: Function, first: int = 0) -> bool:
    """Return whether a function needs more than its first `first` parameters."""
    known = _list_parameters(function)
    variable = (Parameter.VAR_POSITIONAL, Parameter.VAR_KEYWORD)
    return known is None or any(one.default is Parameter.empty and one.kind not in variable for one in known[first:])


def list_plain_defaults(function: Function) -> dict[str, Plain]:
    """Return the defaults of a function's parameters that a file could hold."""
    defaults = {}
    for one in _list_parameters(function) or ():
        if one.kind in _NAMED and one.default is not Parameter.empty and one.name not in GIVEN_LATER:
            try:
                defaults[one.name] = copy_plain(one.default)
            except ScenarioError:
                continue
    return defaults


def _list_parameters(function: Function) -> list[Parameter] | None:
    """Return the parameters of a function; None for a C function without a signature."""
    # NOTE: called for each agent at each reset of a scenario, which has few functions (benchmarks: turns).
    read = _read_parameters if isinstance(function, FunctionType) else _read_parameters.__wrapped__
    try:
        return read(function)
    except (TypeError, ValueError):
        return None


@lru_cache(maxsize=64)
def _read_parameters(function: Function) -> list[Parameter]:
    return list(find_signature(function).parameters.values())
