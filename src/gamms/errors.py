"""The exceptions that GAMMS raises on purpose.

GammsError
├─ UnknownName (KeyError)          an unknown name or id of a sensor, agent, node, edge or store
├─ UnknownAttribute (AttributeError) an unknown name of a package or of a part of the context
├─ UnknownType (ValueError)        an unknown type
├─ UnknownEngine (NotImplementedError) an unknown visual engine
├─ Duplicate (ValueError)          a name is already taken
├─ DuplicateId (KeyError)          an id is already used in the graph
├─ BadValue (ValueError)           an argument has the right type and an invalid value
├─ BadType (TypeError)             an argument has the wrong type
├─ BadFile (ValueError)            a file is damaged, of another kind, or too large
│  └─ TooLarge (also BadValue)     a file or a call needs more memory than is allowed
├─ NoPath (ValueError)             there is no path between two nodes
├─ PlaceError (ValueError)         a place is unknown, or has no map
├─ NetworkError (ConnectionError)  a map server cannot be reached, is busy, or sends an invalid answer
├─ MissingExtra (ImportError)      an optional library is required and not installed
├─ MissingKey (KeyError)           a required key or argument is missing
├─ MissingFolder (FileNotFoundError) the folder of an output file does not exist, or takes no new files
├─ MissingFile (FileNotFoundError) an input file does not exist
├─ NoDisplay (RuntimeError)        a window cannot be opened, because there is no display
├─ NotOffered (NotImplementedError) an optional method that a user's class does not override
├─ NotYet (NotImplementedError)    a feature that is announced and not implemented yet
│  ├─ NotYetImportable (ImportError)   ... in an import
│  └─ NotYetAttribute (AttributeError) ... as an attribute
├─ Outdated (RuntimeError)         a computed result is outdated
├─ WriteConflict (RuntimeError)    another program has written a file since it was read
├─ ReservedName (AttributeError)   a keyword of `create_agent` is the name of a method or property of agents
├─ IllegalMutation (RuntimeError)  a strategy tried to change something other than through its action
└─ ContextTerminated (AttributeError) the context is terminated

Packages add their own: NoStrategy (agent), IllegalAction, UnknownSetting and SnapshotError (game), ReadOnly (readonly),
ScenarioError (scenario), RecordingError, RecorderBusy and Damaged (recorder), UnknownMap, DuplicateKey and BadKeyField
(memory).
"""

import os
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from itertools import chain, islice
from typing import Any, NoReturn

from gamms.text import shown

DISTRIBUTION = "gamms-engine"  # on package indexes, where `gamms` is the package of the paper's authors
_FOLDER_OF_GAMMS_1 = "AgentEngine"  # a module of gamms 1.0.0, and no file of ours


class GammsError(Exception):
    """Base class: `except GammsError` catches all of ours and nothing else."""

    def __reduce__(self) -> tuple[Any, ...]:
        # Rebuilt without its constructor, which takes the parts of the message: worker pools return errors.
        return _rebuild_error, (type(self), self.args, dict(self.__dict__))

    def __str__(self) -> str:
        # KeyError shows the repr of its message; a sentence should read like one.
        return str(self.args[0]) if self.args else ""


def _rebuild_error(kind: type[GammsError], args: tuple[Any, ...], attributes: dict[str, Any]) -> GammsError:
    error = kind.__new__(kind, *args)
    error.args = args
    error.__dict__.update(attributes)
    return error


_FEW = 8  # names that an error message lists
_ALIKE = 0.6  # how much, from 0 to 1, a name has to be like the one that it is taken for
_GUESSES = 2  # names that it asks for: of more that are as much like it, none
_LONG = 80  # characters of a name that are compared
_MANY = 1 << 10  # names that are searched for a similar one: of more, the search would take longer than the call


def nearest(name: object, known: Iterable[object], alike: float = _ALIKE) -> str:
    """Return the hint of an error message: the known names most like `name`; nothing if none is, or too many are."""
    from difflib import SequenceMatcher, get_close_matches

    wanted = _make_searchable(name)
    names = [_make_searchable(one) for one in islice(known, _MANY)]
    near = get_close_matches(wanted, names, _GUESSES + 1, alike)
    ratios = [SequenceMatcher(None, one, wanted).ratio() for one in near]
    best = [one for one, ratio in zip(near, ratios, strict=True) if ratio == ratios[0]]
    best = best or [one for one in names if len(wanted) > 2 and wanted in one.split("_")]  # `range`: `sensor_range`
    return f" Did you mean {' or '.join(sorted(map(repr, best)))}?" if 0 < len(best) <= _GUESSES else ""


def _make_searchable(name: object) -> str:
    return str.__str__(name)[:_LONG] if isinstance(name, str) else shown(name)


class UnknownName(GammsError, KeyError):
    """An unknown name or id."""

    def __init__(self, kind: str, name: object, known: Iterable[object] | None = None, hint: str = "") -> None:
        way_out = "" if known is None else _suggest_names(name, known) or " There are none."
        super().__init__(f"Unknown {kind} {shown(name)}.{way_out}{hint}")


class UnknownAttribute(GammsError, AttributeError):
    """A name that a package or a part of the context lacks.

    Args:
        owner: the package or the part.
        name: the name.
        known: the names that it has.
        elsewhere: a function of the module level that returns where else there is such a name, as a hint; "": nowhere.
    """

    def __init__(
        self, owner: str, name: str, known: Iterable[str], elsewhere: Callable[[str], str] | None = None
    ) -> None:
        super().__init__(f"{owner} has no attribute {name!r}.")
        self._wanted = name
        self._known = [one for one in known if not one.startswith("_")]
        self._elsewhere = elsewhere or _give_no_hint

    def __str__(self) -> str:
        # Looked for here, because `hasattr` and imports of submodules show no message.
        return super().__str__() + (self._elsewhere(self._wanted) or _suggest_names(self._wanted, self._known))

    @staticmethod
    def hint_of(error: BaseException) -> str:
        """Return how to read a key that was read as an attribute, or the names most like an unknown name; else ""."""
        if type(error) is ImportError and (module := sys.modules.get(str(error.name))) is not None:
            quoted = str(error).split("'")
            return nearest(quoted[1], dir(module)) if quoted[0] == "cannot import name " else ""
        if type(error) is not AttributeError:
            return ""
        if isinstance(error.obj, Mapping):
            return _explain_key(error.obj, str(error.name))
        if error.obj is None and str(error).startswith("'dict' object has no attribute '"):  # that was set
            return _explain_key({}, str(error).split("'")[3])
        if not type(error.obj).__module__.startswith("gamms."):
            return ""
        return _suggest_names(error.name, [one for one in dir(error.obj) if not one.startswith("_")])


def _explain_key(mapping: Mapping[object, object], name: str) -> str:
    """Return the hint for a key of a mapping that was read or set as an attribute."""
    if name in mapping:
        return f" It is a key: write [{name!r}]."
    methods = [one for one in dir(mapping) if not one.startswith("_")]
    return nearest(name, methods) or f" Keys are read and set in brackets: write [{name!r}]."


def _give_no_hint(_name: str) -> str:
    """Return the hint for a name that is not looked for elsewhere."""
    return ""


def list_names(package: str, known: Iterable[str]) -> None:
    """Let `dir` and completion list the public names of a package, without its modules."""
    listed = {*known}
    module = vars(sys.modules[package])
    module["__dir__"] = lambda: sorted(listed | {name for name in module if name.startswith("__")})


def suggest_names(package: str, known: Iterable[str]) -> None:
    """Let a package answer unknown names with the most similar of these names, and list only them."""
    list_names(package, known)

    def refuse(name: str) -> NoReturn:
        raise UnknownAttribute(package, name, () if name.startswith("_") else known)

    vars(sys.modules[package])["__getattr__"] = refuse  # set here, so that type checkers still know all names


def _suggest_names(name: object, known: Iterable[object]) -> str:
    """Return the known names most like `name`, else the first few."""
    names = list(islice(known, _MANY))
    others = ", among others" if len(names) > _FEW else ""
    verb = "is" if len(names) == 1 else "are"
    few = f" There {verb}{others}: {', '.join(map(shown, names[:_FEW]))}." if names else ""
    guess = "" if isinstance(name, int) else nearest(name, names)
    return guess or few


class UnknownType(GammsError, ValueError):
    """An unknown type."""


class UnknownEngine(GammsError, NotImplementedError):
    """An unknown visual engine."""


class Duplicate(GammsError, ValueError):
    """A name is already taken."""

    def __init__(self, kind: str, name: object) -> None:
        super().__init__(f"There is already {kind} named {shown(name)}. Choose another name or delete that one first.")


class DuplicateId(GammsError, KeyError):
    """An id is already used in the graph."""

    def __init__(self, kind: str, id: int) -> None:
        super().__init__(
            f"There is already {kind} with id {shown(id)}. Use another id, or the update method to change it."
        )


class BadValue(GammsError, ValueError):
    """An argument has the right type and an invalid value."""


class BadType(GammsError, TypeError):
    """An argument has the wrong type."""


class BadFile(GammsError, ValueError):
    """A file is damaged, of another kind, or too large."""


class TooLarge(BadFile, BadValue):
    """A file or a call needs more memory than is allowed.

    Attributes:
        estimated: the bytes that it would take, if they were estimated before.
    """

    def __init__(self, message: str, estimated: float | None = None) -> None:
        super().__init__(message)
        self.estimated = estimated


class NoPath(GammsError, ValueError):
    """There is no path between two nodes."""

    def __init__(self, source: int, target: int) -> None:
        super().__init__(
            f"No path leads from node {shown(source)} to node {shown(target)}. "
            "Ask graph.distance(source, target) first: it is infinite where there is none."
        )


class MissingExtra(GammsError, ImportError):
    """An optional library is required and not installed."""

    def __init__(self, feature: str, extra: str) -> None:
        super().__init__(f"{feature} needs an optional library (extra {extra!r}): {install_command(extra)}")


def install_command(*extras: str) -> str:
    """Return the pip command that installs the libraries of extras, wherever GAMMS itself was installed from.

    It names the libraries. `gamms[extra]` would be an extra of the package of the paper's authors.
    """
    from importlib.metadata import PackageNotFoundError, requires

    try:
        declared = requires(DISTRIBUTION) or []
    except PackageNotFoundError:  # run from its source
        return f'pip install ".[{",".join(extras)}]" in a checkout of GAMMS'
    libraries = dict.fromkeys(chain.from_iterable(_list_libraries(extra, declared) for extra in extras))
    return " ".join(("pip install", *(f'"{one}"' for one in libraries)))


def _list_libraries(extra: str, declared: list[str]) -> Iterator[str]:
    """Yield the requirements of an extra, including the extras that it refers to."""
    for line in declared:
        requirement, _, marker = line.partition(";")
        if extra not in marker.replace("'", '"').split('"'):
            continue
        name, bracket, rest = requirement.strip().partition("[")
        if name == DISTRIBUTION and bracket:
            for other in rest.partition("]")[0].split(","):
                yield from _list_libraries(other.strip(), declared)
        else:
            yield requirement.strip()


class NoDisplay(GammsError, RuntimeError):
    """A window cannot be opened, because there is no display."""

    def __init__(self, reason: str) -> None:
        super().__init__(
            f"No window can be opened here ({reason}). To film a game without a display, use `gamms run --film FILE`, "
            "or vis_engine=gamms.visual.Engine.OFFSCREEN in Python; to run a window program unseen, set "
            "SDL_VIDEODRIVER=dummy."
        )


class PlaceError(GammsError, ValueError):
    """A place is unknown, or has no map."""


class NetworkError(GammsError, ConnectionError):
    """A map server cannot be reached, is busy, or sends an invalid answer."""


class NotOffered(GammsError, NotImplementedError):
    """An optional method is called that a user's class does not override."""

    def __init__(self, asked: object, call: str) -> None:
        super().__init__(f"{type(asked).__name__} does not offer {call}: override it in the class.")


class NotYet(GammsError, NotImplementedError):
    """A feature that is announced and not implemented yet."""

    def __init__(self, feature: str) -> None:
        super().__init__(f"Not in this version of GAMMS yet: {feature}.")


class NotYetImportable(NotYet, ImportError):
    """A name of a feature that is not implemented yet."""


class NotYetAttribute(NotYet, AttributeError):
    """An attribute of a feature that is not implemented yet; `hasattr` returns False."""


class MissingKey(GammsError, KeyError):
    """A required key or argument is missing."""


class MissingFolder(GammsError, FileNotFoundError):
    """The folder of an output file or folder does not exist, or takes no new ones."""

    def __init__(self, path: object, folder: object) -> None:
        if os.path.isdir(str(folder)):  # noqa: PTH112 - pathlib is loaded late
            made = os.path.join(str(folder), str(path))  # noqa: PTH118
            said = f"{made!r} cannot be made: the folder {str(folder)!r} takes no new files. Choose another place."
        else:
            said = f"There is no folder {str(folder)!r} to write {str(path)!r} into. Create it first."
        super().__init__(said)


class MissingFile(GammsError, FileNotFoundError):
    """An input file does not exist."""

    def __init__(self, what: str | None, path: object) -> None:
        of_what = "" if what is None else f" for {what}"
        super().__init__(f"There is no file {str(path)!r}{of_what}.{_suggest_file(str(path))}")


_YAML = (".yaml", ".yml")


def _suggest_file(path: str) -> str:
    """Return the hint of an error message: the file of the same folder and kind whose name is most like a path's."""
    folder, name = os.path.split(path)
    kind = os.path.splitext(name)[1]  # noqa: PTH122 - pathlib is loaded late
    kinds = _YAML if kind in _YAML else (kind,)
    try:
        files = sorted(os.listdir(folder or "."))  # noqa: PTH208
    except OSError:
        return f" There is no folder {folder!r}."
    return nearest(name, [file for file in files if file.endswith(kinds)])


class Outdated(GammsError, RuntimeError):
    """A computed result is outdated, because its inputs have changed."""

    def __init__(self, change: str, way_out: str) -> None:
        super().__init__(f"This no longer holds: {change}. Call {way_out} again.")


class WriteConflict(GammsError, RuntimeError):
    """Another program has written a file since it was read."""


class ReservedName(GammsError, AttributeError):
    """A keyword of `create_agent` is the name of a method or property of agents."""

    def __init__(self, name: str, settable: Iterable[str]) -> None:
        known = ", ".join(sorted({"strategy", *settable}))
        super().__init__(
            f"{shown(name)} cannot be a keyword of create_agent: agents have a method or property of this name. A "
            f"keyword may be {known}, or another name of your own, which becomes an attribute."
        )


class IllegalMutation(GammsError, RuntimeError):
    """A strategy tried to change something other than through its action, or a rule tried to play or reset the game."""


class ContextTerminated(GammsError, AttributeError):
    """The context is terminated; its graph is closed, and nothing can be created in it."""

    def __init__(self, wanted: str) -> None:
        super().__init__(
            f"The context is terminated, by terminate(), the end of its `with` block or a closed window: {wanted} is "
            "no longer there. Create a new context."
        )


def _refuse_mixed_installation() -> None:
    """Refuse to run among files of gamms 1.0.0 (ImportError); one question to the file system."""
    folder = os.path.dirname(__file__)  # noqa: PTH120 - pathlib alone would take as long as all of `import gamms`
    if os.path.isdir(os.path.join(folder, _FOLDER_OF_GAMMS_1)):  # noqa: PTH112, PTH118
        raise ImportError(  # none of ours, which no program could import to catch it
            f"The distributions 'gamms' (1.0.0, of the paper's authors) and {DISTRIBUTION!r} are both installed in "
            f"{folder!r}, where each has overwritten files of the other. Remove both, then install one: "
            f"pip uninstall gamms {DISTRIBUTION}"
        )


_refuse_mixed_installation()  # here, as all modules of ours import this one, whichever `gamms/__init__.py` has won
