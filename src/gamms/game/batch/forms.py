"""How batches play strategies, rules and checks: what these declare, and how it is found."""

from collections.abc import Callable, Hashable
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

from gamms.arguments import as_function_of
from gamms.errors import BadType, BadValue
from gamms.game.settings import spec_of as rule_spec_of
from gamms.text import as_code, shown

F = TypeVar("F", bound=Callable[..., Any])

_SPEC = "strategy_spec"  # the attribute of a strategy, or of the plan of a team, that has its `StrategySpec`
_FORM = "array_form"  # the attribute of a rule of a user, or of a check, that has its array form
BEGINS = "begin_arrays"  # that of a rule which has `begins`, see `array_rule`


@dataclass(frozen=True, kw_only=True)
class StrategySpec:
    """How batches play a strategy, or the plan of a team.

    Attributes:
        array_form: returns the actions of all agents of an `ArrayView`; None: agents are asked one by one.
        core_form: the number by which `gamms.core.moves` knows the strategy; None: the core does not play it.
        flies: whether it decides for agents that fly, too; the array form returns how far they fly then.
        looks: whether it asks what sensors show or have in view. Agents may carry any sensor if it does not.
        may_skip: whether it may set no action, for which the array form returns `NO_ACTION`.
        boards: the keys under which it writes into the memory of the team.
        refuses: functions of a game and an agent that say in words why the agent cannot be asked; None: it can.
        begins: returns what the array form keeps of agents in a game that has begun, see `array_strategy`; None: it
            takes up no memories.
        takes_up_all: whether agents that come later begin with what `begins` returns, or with nothing.
    """

    array_form: Callable[..., Any] | None = None
    core_form: int | None = None
    flies: bool = False
    looks: bool = True
    may_skip: bool = False
    boards: tuple[str, ...] = ()
    refuses: tuple[Callable[..., str | None], ...] = ()
    begins: Callable[..., Any] | None = None
    takes_up_all: bool = False


_UNDECLARED = StrategySpec()


def declare(strategy: object, spec: StrategySpec) -> None:
    """Declare how batches play a strategy."""
    setattr(strategy, _SPEC, spec)


def spec_of(strategy: object) -> StrategySpec:
    """Return what a strategy, or the plan of a team, declares; one that declares nothing is asked agent by agent."""
    spec: StrategySpec = getattr(strategy, _SPEC, _UNDECLARED)
    return spec


def form_declared(
    of: object,
    decorator: str,
    argument: str,
    most: int = 1,
    begins: Callable[..., object] | None = None,
    *,
    is_strategy: bool = False,
) -> Callable[[F], F]:
    """Return what declares a function as the array form of another; what it is called with see `as_function_of`.

    `begins` says what it keeps of games that have begun; None: nothing does.

    One of the same name and module replaces the form that is there, as when a cell of a notebook is run again; another
    one is refused (BadValue), since games that were checked with the first would silently be others.
    """
    if not callable(of) or not hasattr(of, "__dict__") or hasattr(of, "__func__"):
        raise BadType(f"{decorator}(of=…) needs the function whose form it declares, not {shown(of)}.")

    def declared(form: F) -> F:
        find = _strategy_form if is_strategy else _rule_form
        known, wrapped = find(of), getattr(of, "__wrapped__", None)  # of which a decorator has copied the form
        if known is not None and known is not find(wrapped) and _place_of(known) != _place_of(form):
            raise BadValue(
                f"{as_code(of)} has an array form already, {as_code(known)}: it is not replaced by {as_code(form)}. "
                f"Declare one form, or define {as_code(of)} again before."
            )
        made = as_function_of(form, f"What {decorator}(of=…) declares", argument, most)
        if is_strategy:
            declare(of, StrategySpec(array_form=made, begins=begins))
            return form
        of.__dict__[_FORM] = made
        of.__dict__.pop(BEGINS, None)  # of what it was copied from
        of.__dict__.update({} if begins is None else {BEGINS: begins})
        return form

    return declared


def _place_of(form: object) -> tuple[object, object]:
    """Return the module and the name of a function; of another object, itself."""
    return getattr(form, "__module__", None), getattr(form, "__qualname__", id(form))


def _rule_form(rule: object) -> Any:
    return rule_spec_of(rule).array_form


def _strategy_form(strategy: object) -> Any:
    return spec_of(strategy).array_form


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
