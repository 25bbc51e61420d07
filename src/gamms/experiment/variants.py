"""The variants of a scenario in an experiment: their settings with names in rows, and the digests of what decides.

Before play, `compute_digest` hashes the scenario, the code in its folder, the files that it names, and functions that
a program passes. In play, the modules and files of the folder that are used beside these are found.
"""

import hashlib
import json
import os
import sys
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import cache
from importlib.machinery import all_suffixes
from itertools import chain, product
from math import prod
from pathlib import Path
from types import CellType, CodeType, FunctionType, ModuleType
from typing import Any, NamedTuple

from gamms.arguments import as_items, as_mapping
from gamms.errors import BadValue, UnknownName, nearest
from gamms.limits import refuse_above
from gamms.plain import Plain
from gamms.scenario import Scenario, ScenarioError
from gamms.scenario.code import CodeSources
from gamms.scenario.placement import list_members
from gamms.scenario.spec import to_plain
from gamms.scenario.validation import list_files
from gamms.text import as_code, remove_addresses, shown

Function = Callable[..., Any]
Vary = Mapping[str, Sequence[Any] | Mapping[str, Any]] | Sequence[Mapping[str, Any]]

_BYTES = 1_500  # bytes of a variant; 940 measured
_OPEN = ("data", "facts")  # parts of a scenario that accept any keys
_ROW = ("id", "scenario", "seed", "reason", "winner", "truncated", "turns", "error", "gamms", "python", "numpy")
_SUFFIXES = tuple(all_suffixes())  # of files from which Python imports
_MOST_FILES = 100_000  # files and folders below that of a scenario
_NO_CODE = {"pyvenv.cfg", "conda-meta", "experiment.json"}  # in environments and in folders of results
_INSTALLED = {"site-packages", "dist-packages"}
_VERSIONED = {"gamms", *sys.stdlib_module_names}
_PARTS: Mapping[type, Sequence[str]] = {  # attributes that make up values which cannot be pickled
    CodeType: ("co_code", "co_consts", "co_names", "co_varnames", "co_argcount"),
    CellType: ("cell_contents",),
    property: ("fget", "fset", "fdel"),
    staticmethod: ("__func__",),
    classmethod: ("__func__",),
}
_OF_FUNCTION = ("__code__", "__defaults__", "__kwdefaults__", "__closure__", "__dict__")
_open_watches = list[set[str]]()  # of `watch_files`


class Variant(NamedTuple):
    """A variant of a scenario.

    Attributes:
        settings: varied key -> the name of its value in rows.
        changes: the arguments of `Scenario.replace`.
        strategies: the argument of `Scenario.play`, by team or agent.
    """

    settings: dict[str, Plain]
    changes: dict[str, Plain]
    strategies: dict[str, Function]

    def apply_to(self, scenario: Scenario) -> Scenario:
        """Return the scenario with the changes of this variant."""
        return scenario.replace(**self.changes) if self.changes else scenario


def make_variants(scenario: Scenario, vary: Vary | None) -> list[Variant]:
    """Return the variants of a grid, or of a list of settings, after checking each with the scenario.

    Raises:
        BadType, BadValue: `vary` is neither, or two values of a key would have one name in the rows.
        ScenarioError, UnknownName: a key is misspelled, or a value is not allowed for its key.
    """
    if vary is None:
        points: list[dict[str, tuple[Plain, Any]]] = [{}]
    elif isinstance(vary, Mapping):
        points = _make_grid({key: _name_values(key, values) for key, values in vary.items()})
    else:
        given = [dict(as_mapping(one, "Each of vary")) for one in as_items(vary, "vary", "dicts of settings")]
        points = _read_list(given)
    variants = [_make_variant(scenario, point) for point in points]
    if not variants:
        raise BadValue("vary has no values: give each key at least one, or leave vary out.")
    return variants


def _make_grid(values: Mapping[str, list[tuple[Plain, Any]]]) -> list[dict[str, tuple[Plain, Any]]]:
    count = prod(len(some) for some in values.values())
    refuse_above(count * _BYTES, f"A grid of {count:,} variants")
    return [dict(zip(values, some, strict=True)) for some in product(*values.values())]


def _read_list(given: list[dict[str, Any]]) -> list[dict[str, tuple[Plain, Any]]]:
    refuse_above(len(given) * _BYTES, f"A list of {len(given):,} variants")
    known = list(given[0]) if given else []
    for point in given:
        if list(point) != known:
            raise BadValue(f"All variants have the same keys, {', '.join(known)}; one has {', '.join(point)}.")
    names = {key: _ValueNames(key) for key in known}
    return [{key: (names[key].find_name(value), value) for key, value in point.items()} for point in given]


def _name_values(key: str, values: object) -> list[tuple[Plain, Any]]:
    """Return the values of a key with their names in rows; a dict gives the names."""
    if isinstance(values, Mapping):
        return [(_find_name(name), value) for name, value in values.items()]
    names = _ValueNames(key)
    found = [
        (names.find_name(value), value) for value in as_items(values, f"The values of {shown(key)} in vary", "values")
    ]
    if len({(type(name), name) for name, _ in found}) < len(found):
        raise BadValue(f"A value of {shown(key)} in vary is there twice: {shown(values)}.")
    return found


class _ValueNames:
    """Names in rows for the values of a key; different functions must have different names."""

    def __init__(self, key: str) -> None:
        self._key = key
        self._values: dict[Plain, Any] = {}

    def find_name(self, value: Any) -> Plain:
        name = _find_name(value)
        other = self._values.setdefault((type(name), name), value)
        if callable(value) and other is not value:
            raise BadValue(
                f"Two values of {shown(self._key)} in vary would both be called {shown(name)}. Give a dict of names: "
                f"{{{self._key!r}: {{'first': …, 'second': …}}}}."
            )
        return name


def _find_name(value: Any) -> Plain:
    """Return the name of a value in rows: a number or text itself, the name of code, or JSON."""
    if hasattr(value, "item") and getattr(value, "ndim", None) == 0:  # a scalar of NumPy
        value = value.item()
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    if callable(value):
        return remove_addresses(as_code(value))
    if isinstance(value, Mapping) and set(value) == {"function"}:
        return value["function"]
    return json.dumps(value, default=str, ensure_ascii=False)


def _make_variant(scenario: Scenario, point: Mapping[Any, tuple[Plain, Any]]) -> Variant:
    found = Variant({key: name for key, (name, _) in point.items()}, {}, {})
    for key, (_, value) in point.items():
        if not isinstance(key, str) or not key:
            raise BadValue(f"A key of vary is a path in the scenario, such as 'teams.red.count', not {shown(key)}.")
        if key == "seed":
            raise BadValue("seed cannot be varied: give seeds=; each variant plays all of them.")
        if key in _ROW:
            raise BadValue(f"{key!r} cannot be varied: it is a column of every row.")
        if key.startswith("strategies."):
            _set_strategy(scenario, key.partition(".")[2], value, found)
        else:
            _check_open(scenario, key)
            found.changes[key] = value
    found.apply_to(scenario)  # checks the spelling of keys
    return found


def _check_open(scenario: Scenario, key: str) -> None:
    """Refuse a new key in a part that accepts any keys: it is probably misspelled."""
    part, _, name = key.partition(".")
    known = scenario.to_dict().get(part) or {} if part in _OPEN else {}
    first = name.partition(".")[0]
    if name and part in _OPEN and first not in map(str, known):
        hint = nearest(first, map(str, known)) or f" Give it a first value in the scenario, in {part}."
        raise ScenarioError(key, f"there is no {first!r} to vary.{hint}")


def _set_strategy(scenario: Scenario, of: str, value: Any, variant: Variant) -> None:
    """Set the strategy of a team or agent: a function, a reference to code, or None for the scenario's own."""
    by_team = list_members(scenario.spec)
    agents = {member.name: member for member in chain.from_iterable(by_team.values())}
    if of not in by_team and of not in agents:
        raise UnknownName("team or agent", of, [*by_team, *agents])
    if callable(value):
        variant.strategies[of] = value
    elif value is not None and of in by_team:
        team = scenario.spec.teams[of]
        if team.plan is not None:
            variant.changes[f"teams.{of}.plan"] = None
        own = [i for i, one in enumerate(team.agents) if one.strategy is not None]
        variant.changes.update({f"teams.{of}.agents.{i}.strategy": None for i in own})
        variant.changes[f"teams.{of}.strategy"] = value
    elif value is not None:
        if agents[of].listed is None:
            raise BadValue(f"{of!r} is one of a count: list it under agents, or vary the strategy of its team.")
        variant.changes[f"{agents[of].path}.strategy"] = value


def compute_row_id(digest: str, settings: Mapping[str, Plain], collected: Sequence[str], seed: int) -> str:
    """Return the id of a row: the first 16 digits of the SHA-256 of its settings and seed."""
    return hash_value([digest, dict(settings), sorted(collected), seed])[:16]


# -- digests ------------------------------------------------------------------------------------------------------


def compute_digest(
    scenario: Scenario, strategies: Mapping[str, Function] | None = None, code: Mapping[str, str] | None = None
) -> str:
    """Return the SHA-256 of everything that determines a game except seed and versions, in hexadecimal.

    Args:
        scenario: the scenario.
        strategies: functions that decide instead of those of the scenario, by team or agent.
        code: the code in its folder, as `hash_code` returns it; None: read it.
    """
    functions = {of: hash_function(function) for of, function in (strategies or {}).items()}
    own: Mapping[str, str] = {}
    if functions or any(one.file is not None for one in scenario.code()):  # otherwise no code of the folder decides
        own = hash_code(scenario.folder) if code is None else code
    files = {name: _hash_file(file) for name, file in name_files(scenario).items()}
    map = to_plain(scenario.spec.map)
    return hash_value([scenario.digests(), _list_deciders(scenario), map, own, files, functions])


def compute_first_digest(scenario: Scenario) -> str:
    """Return the digest of rows of the first format, which covers only the files of code that the scenario names."""
    folder = scenario.folder
    files = {one.file for one in scenario.code() if one.file is not None}
    code = {
        (file.relative_to(folder) if folder and file.is_relative_to(folder) else file).as_posix(): _hash_file(file)
        for file in files
    }
    return hash_value([scenario.digests(), _list_deciders(scenario), code])


def _list_deciders(scenario: Scenario) -> dict[str, Any]:
    """Return the strategies that a scenario names, by team."""
    return {
        name: [team.get("strategy"), team.get("plan"), [one.get("strategy") for one in team.get("agents") or ()]]
        for name, team in scenario.to_dict()["teams"].items()
    }


def hash_value(value: Plain) -> str:
    """Return the SHA-256 of plain values, in hexadecimal."""
    return hashlib.sha256(json.dumps(value, sort_keys=True, default=str).encode()).hexdigest()


def _hash_file(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest()


def hash_code(folder: Path | None) -> dict[str, str]:
    """Return the files in a folder and below from which Python could import: relative name -> SHA-256.

    Hidden folders, environments and folders of results are left out.

    Raises:
        BadValue: there are too many files.
    """
    found = {}
    count = 0
    for here, folders, files in os.walk(folder or ""):
        count += len(folders) + len(files)
        if count > _MOST_FILES:
            raise BadValue(
                f"The folder of the scenario, {shown(str(folder))}, has more than {_MOST_FILES:,} files and folders: "
                "give the scenario and its code a folder of their own."
            )
        if here != str(folder) and not _NO_CODE.isdisjoint([*folders, *files]):
            folders.clear()
            continue
        folders[:] = [name for name in folders if not name.startswith((".", "__pycache__"))]
        for file in (Path(here, name) for name in files if name.endswith(_SUFFIXES)):
            if file.is_file():
                found[file.relative_to(folder or "").as_posix()] = _hash_file(file)
    return found


def name_files(scenario: Scenario) -> dict[str, Path]:
    """Return the files that a scenario names, by their names in its folder."""
    sources = CodeSources(scenario.folder, scenario.allow, scenario.key_variable)
    return {file.relative_to(scenario.folder or "").as_posix(): file for file in list_files(scenario.spec, sources)}


# -- functions ----------------------------------------------------------------------------------------------------


def hash_function(function: Function) -> str:
    """Return the SHA-256 of a function: its code, its defaults, and the values and functions that it uses.

    Functions of installed packages count by their names and what they close over, and paths of files by the content.
    Values that cannot be pickled count by their types.

    Raises:
        BadValue: the values that it uses are nested too deeply.
    """
    try:
        return hash_value(_describe(function, {}))
    except RecursionError:
        raise BadValue(
            "A function of the experiment uses values that are nested too deeply for a digest, such as a long chain of "
            "objects: hold them in a list, and let them refer to each other by their places there."
        ) from None


def _describe(value: object, seen: dict[int, Any]) -> Plain:
    """Return plain values that are the same in every process for equal code and data.

    Args:
        value: any value.
        seen: id -> number and value, of those that were described before.
    """
    if value is None or type(value) in (bool, int, float, str):
        return repr(value)
    if isinstance(value, Path) and value.is_file():  # such as that of a saved policy
        return _hash_file(value)
    if isinstance(value, bytes):
        return hashlib.sha256(value).hexdigest()
    if id(value) in seen:
        number: int = seen[id(value)][0]
        return number
    seen[id(value)] = (len(seen), value)
    if isinstance(value, (set, frozenset)):
        return sorted(json.dumps(_describe(one, dict(seen))) for one in value)
    return [type(value).__qualname__, *(_describe(part, seen) for part in _list_parts(value))]


def _list_parts(value: Any) -> Iterable[Any]:
    """Return what makes up a value."""
    kind = type(value)
    if kind in (list, tuple):
        return value  # type: ignore[no-any-return] # one of these
    if kind is dict:
        return chain.from_iterable(value.items())
    if isinstance(value, (FunctionType, ModuleType, type)):
        return _list_parts_of_code(value)
    if kind in _PARTS:
        return [getattr(value, name, None) for name in _PARTS[kind]]  # an empty cell has no contents
    with suppress(Exception):  # of attributes that are made when they are read, and of code that makes values picklable
        if hasattr(kind, "requires_grad"):  # a tensor
            value = value.detach().cpu().numpy()
        reduced = value.__reduce_ex__(4)  # which may have iterators over the items
        return reduced, getattr(value, "__wrapped__", None), *map(list, filter(None, reduced[3:5]))
    return ()


def _list_parts_of_code(value: FunctionType | ModuleType | type) -> Iterable[Any]:
    """Return what makes up a function, class or module; the name of one that versions of packages determine."""
    of_code = getattr(value, "__globals__", {}).get("__name__")
    module = str(of_code or getattr(value, "__module__", None) or value.__name__)
    file = getattr(sys.modules.get(module), "__file__", None) or ""
    if module.partition(".")[0] in _VERSIONED or (
        module != "__main__" and not _INSTALLED.isdisjoint(Path(file).parts)  # an installed tool may run a program
    ):
        return module, getattr(value, "__qualname__", ""), getattr(value, "__closure__", None)
    if isinstance(value, FunctionType):
        known = value.__globals__
        used = {name: known[name] for name in _list_names(value.__code__) if name in known}
        return *(getattr(value, name) for name in _OF_FUNCTION), used
    made = (FunctionType, staticmethod, classmethod)
    members = {name: one for name, one in vars(value).items() if name[:2] != "__" or isinstance(one, made)}
    return getattr(value, "__bases__", ()), members


def _list_names(code: CodeType) -> Iterator[str]:
    yield from code.co_names
    for inner in code.co_consts:
        if isinstance(inner, CodeType):
            yield from _list_names(inner)


# -- what a game uses beside ------------------------------------------------------------------------------------------


def find_other_module(folder: Path | None, code: Collection[str]) -> str | None:
    """Return the name of a loaded file of code in a folder that is not among the covered ones; None: there is none."""
    files = (getattr(module, "__file__", None) or "" for module in [*sys.modules.values()])
    return min(_name_in_folder(folder, files) - {*code}, default=None)


@contextmanager
def watch_files() -> Iterator[set[str]]:
    """Collect the files that this process opens in a `with` block, without those that it may create."""
    _install_hook()
    opened = set[str]()
    _open_watches.append(opened)
    try:
        yield opened
    finally:
        _open_watches.remove(opened)


@cache
def _install_hook() -> None:
    """Let Python report opened files; no hook can be removed again."""
    sys.addaudithook(_note_opening)


def _note_opening(event: str, arguments: tuple[Any, ...]) -> None:
    if _open_watches and event == "open" and isinstance(arguments[0], (str, bytes, os.PathLike)):
        is_new = arguments[2] & os.O_CREAT
        for opened in _open_watches if not is_new else ():
            opened.add(os.path.abspath(os.fsdecode(arguments[0])))  # noqa: PTH100 - follows no links


def list_undeclared(scenario: Scenario, opened: Iterable[str]) -> set[str]:
    """Return the opened files in a scenario's folder that it does not name and that are no code, by relative names."""
    known = {*name_files(scenario)}
    if scenario.file is not None:
        known.add(scenario.file.name)
    return {one for one in _name_in_folder(scenario.folder, opened) - known if not one.endswith(_SUFFIXES)}


def _name_in_folder(folder: Path | None, files: Iterable[str]) -> set[str]:
    """Return those files that are in a folder, without installed packages, by their names in it."""
    places = () if folder is None else tuple({f"{folder}{os.sep}", f"{folder.resolve()}{os.sep}"})
    found = {Path(file[len(place) :]) for file in files for place in places if file.startswith(place)}
    return {one.as_posix() for one in found if _INSTALLED.isdisjoint(one.parts)}
