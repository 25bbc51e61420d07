"""Reads the code of rules: whether a rule gives scores, and whether it brings agents back."""

from collections.abc import Iterator
from contextlib import suppress
from functools import partial
from pathlib import Path
from types import CodeType, FunctionType, ModuleType

_GAMMS = str(Path(__file__).parents[1])  # the folder of GAMMS


def brings_back(rule: object) -> bool:
    """Return whether a rule declares that it brings agents back, or code of the caller names `respawn`."""
    own = (code for code in _codes_of(rule, set()) if not code.co_filename.startswith(_GAMMS))
    return getattr(rule, "brings_back", False) or any("respawn" in code.co_names for code in own)


def gives_scores(rule: object) -> bool:
    """Return whether the code of a rule, or of a function that it calls, names the scores of the game."""
    return any("scores" in code.co_names for code in _codes_of(rule, set()))


def _codes_of(value: object, seen: set[int]) -> Iterator[CodeType]:
    """Yield the code of a function or of the methods of an object, and of the functions that it can reach."""
    if id(value) in seen or isinstance(value, type | ModuleType):
        return
    seen.add(id(value))
    if isinstance(value, partial):
        yield from _codes_of(value.func, seen)
        return
    if not isinstance(value, FunctionType):
        methods = (one for kind in type(value).__mro__ for one in vars(kind).values() if isinstance(one, FunctionType))
        for method in methods:
            yield from _codes_of(method, seen)
        return
    yield from _within(value.__code__)
    for cell in value.__closure__ or ():
        with suppress(ValueError):  # it has no value yet
            yield from _codes_of(cell.cell_contents, seen)
    for name in value.__code__.co_names:
        if isinstance(value.__globals__.get(name), FunctionType):
            yield from _codes_of(value.__globals__[name], seen)


def _within(code: CodeType) -> Iterator[CodeType]:
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _within(constant)
