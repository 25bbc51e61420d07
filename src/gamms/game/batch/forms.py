"""Array forms beside scalar forms: how they are declared for rules, their checks, strategies and plans, and found."""

from collections.abc import Callable, Hashable
from functools import partial
from typing import Any, TypeVar

from gamms.arguments import as_function_of
from gamms.errors import BadType, BadValue
from gamms.text import as_code, shown

F = TypeVar("F", bound=Callable[..., Any])

_FORM = "array_form"  # the attribute of a scalar form that has its array form
BEGINS = "begin_arrays"  # that of a scalar form which has `begins`, see `array_rule` and `array_strategy`
CORE_FORM = "core_form"  # that of strategies and rules which the core plays in batches, see `in_core.py`
FLIES = "flies"  # of strategies, or of forms: whether the form is for agents that fly, too


def form_declared(
    of: object, decorator: str, argument: str, most: int = 1, begins: Callable[..., object] | None = None
) -> Callable[[F], F]:
    """Return what declares a function as the array form of another; what it is called with see `as_function_of`.

    `begins` says what it keeps of games that have begun; None: nothing does.

    One of the same name and module replaces the form that is there, as when a cell of a notebook is run again; another
    one is refused (BadValue), since games that were checked with the first would silently be others.
    """
    if not callable(of) or not hasattr(of, "__dict__") or hasattr(of, "__func__"):
        raise BadType(f"{decorator}(of=…) needs the function whose form it declares, not {shown(of)}.")

    def declare(form: F) -> F:
        known, wrapped = form_of(of), getattr(of, "__wrapped__", None)  # of which a decorator has copied the form
        if known is not None and known is not form_of(wrapped) and _place_of(known) != _place_of(form):
            raise BadValue(
                f"{as_code(of)} has an array form already, {as_code(known)}: it is not replaced by {as_code(form)}. "
                f"Declare one form, or define {as_code(of)} again before."
            )
        of.__dict__[_FORM] = as_function_of(form, f"What {decorator}(of=…) declares", argument, most)
        for name in (BEGINS, CORE_FORM):  # of what it was copied from
            of.__dict__.pop(name, None)
        of.__dict__.update({} if begins is None else {BEGINS: begins})
        return form

    return declare


def _place_of(form: object) -> tuple[object, object]:
    """Return the module and the name of a function; of another object, itself."""
    return getattr(form, "__module__", None), getattr(form, "__qualname__", id(form))


def form_of(function: object) -> Any:
    """Return the array form of a strategy, a rule, a check, a plan or a resolver; None: it has none."""
    return getattr(function, _FORM, None)


def flies(strategy: object) -> bool:
    """Whether the array form of a strategy decides for agents that fly, too: it returns how far they fly then."""
    return getattr(strategy, FLIES, False) or getattr(form_of(strategy), FLIES, False)


def key_of(form: Any) -> Hashable:
    """Return a key that is equal for forms that do the same."""
    key: Hashable
    if isinstance(form, partial):
        key = (
            form.func,
            tuple(map(key_of, form.args)),
            tuple((k, key_of(v)) for k, v in sorted(form.keywords.items())),
        )
    else:
        key = tuple(map(key_of, form)) if isinstance(form, tuple) else form
    try:
        hash(key)
    except TypeError:
        return id(form)
    return key
