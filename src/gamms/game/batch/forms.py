"""How batches play strategies, rules and checks: what these declare, and how it is found."""

from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple, TypeVar

F = TypeVar("F", bound=Callable[..., Any])

_SPEC = "strategy_spec"  # the attribute of a strategy, or of the plan of a team, that has its `StrategySpec`


class CoreStep(NamedTuple):
    """What the core tries for an agent along edges, as a part of its strategy.

    Attributes:
        kind: one of `gamms.core.strategies.KINDS`.
        nodes: ids of those to go to; None: all.
        number, following: see `gamms.core.strategies.StrategySteps`.
        key: under which the agent remembers something in `state["memory"]`.
        chance: see `gamms.core.strategies.StrategySteps`.
    """

    kind: str
    nodes: tuple[int, ...] | None = ()
    number: int = 0
    following: tuple[int, ...] = ()
    key: str = ""
    chance: float = 0.0


@dataclass(frozen=True, kw_only=True)
class StrategySpec:
    """How batches play a strategy, or the plan of a team.

    Attributes:
        array_form: returns the actions of all agents of an `ArrayView`; None: it has none.
        core_form: the number by which `gamms.core.moves` knows the strategy; None: it has none.
        core_steps: what the core tries, one after the other, for agents without a `core_form`; None: it does not play
            the strategy.
        begins: returns what is kept of agents in a game that has begun, see `array_strategy`; None: memories are not
            taken up.
        takes_up_all: whether agents that come later begin with what `begins` returns, or with nothing.
    """

    array_form: Callable[..., Any] | None = None
    core_form: int | None = None
    core_steps: tuple[CoreStep, ...] | None = None
    begins: Callable[..., Any] | None = None
    takes_up_all: bool = False


_UNDECLARED = StrategySpec()


def declare(strategy: object, spec: StrategySpec) -> None:
    """Declare how batches play a strategy."""
    setattr(strategy, _SPEC, spec)


def strategy_spec_of(strategy: object) -> StrategySpec:
    """Return what a strategy, or the plan of a team, declares; one that declares nothing has no array form.

    A function that `functools.wraps` another one has the attributes of that, but does not do the same.
    """
    spec: StrategySpec = getattr(strategy, _SPEC, _UNDECLARED)
    wrapped = getattr(strategy, "__wrapped__", None)
    return _UNDECLARED if spec is getattr(wrapped, _SPEC, None) else spec


def decides_in_arrays(decider: object, settings: Mapping[str, Any]) -> bool:
    """Return whether a decider is called once for all games: an array function whose calls are not timed one by one."""
    return strategy_spec_of(decider).array_form is not None and settings["time_budget"] is None


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
