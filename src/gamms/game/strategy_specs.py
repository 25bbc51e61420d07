"""Declarations of how batches play a strategy or the plan of a team, and of what strategies store."""

from bisect import bisect_right
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple, TypeVar

from gamms import kernels
from gamms.ir.graph import FloatArray
from gamms.kernels.draws import BitArray

F = TypeVar("F", bound=Callable[..., Any])

_SPEC = "strategy_spec"  # the attribute of a strategy, or of the plan of a team, that holds its `StrategySpec`


class CoreStep(NamedTuple):
    """One step of a strategy, which the core tries for an agent that moves along edges.

    Attributes:
        kind: one of `gamms.core.strategies.KINDS`.
        nodes: the ids of the target nodes; None: all nodes.
        number, following: see `gamms.core.strategies.StrategySteps`.
        key: the key of the agent's data in `state["memory"]`.
        chance: see `gamms.core.strategies.StrategySteps`.
    """

    kind: str
    nodes: tuple[int, ...] | None = ()
    number: int = 0
    following: tuple[int, ...] = ()
    key: str = ""
    chance: float = 0.0


class PoolSpec(NamedTuple):
    """The members of a pool of strategies, of which each team draws one in each game.

    Attributes:
        names: the names of the members.
        bounds: a team plays the first member whose bound is above the number that it draws.
    """

    names: tuple[str, ...]
    bounds: tuple[float, ...]

    def draw(self, seed: int, team: Hashable) -> int:
        """Return the number of the member that a team plays in the game of a seed."""
        bits = kernels.draw_bits(kernels.compute_purpose_key(seed, "pool"), kernels.compute_name_key(repr(team)), 0)
        return bisect_right(self.bounds, kernels.convert_to_fraction(bits))


def draw_shares(purposes: BitArray, teams: Sequence[Hashable]) -> FloatArray:
    """Return the numbers in [0, 1) by which teams draw members of pools, (games, teams).

    Args:
        purposes: (games, 1) the `kernels.compute_purpose_key` of each game's seed and "pool".
        teams: the teams.
    """
    names = kernels.compute_name_keys(map(repr, teams))
    return kernels.convert_to_fractions(kernels.draw_bits_rows(purposes, names[None], 0))


@dataclass(frozen=True, kw_only=True)
class StrategySpec:
    """The declaration of how batches play a strategy or the plan of a team.

    Attributes:
        array_form: returns the actions of all agents of an `ArrayView`; None: it has none.
        core_steps: the steps that the core tries in order; None: the core does not play the strategy.
        is_called_each: whether batches call the strategy game by game although it has an array form.
        is_replaced: whether batches replace its decisions by actions from outside, so that it is called in one game.
        pool: the members of which it plays one in each game; None: it is no pool.
    """

    array_form: Callable[..., Any] | None = None
    core_steps: tuple[CoreStep, ...] | None = None
    is_called_each: bool = False
    is_replaced: bool = False
    pool: PoolSpec | None = None

    @property
    def is_in_core(self) -> bool:
        """Whether the core may decide in place of the strategy in one game."""
        return self.core_steps is not None and not self.is_replaced


_UNDECLARED = StrategySpec()


def declare(strategy: object, spec: StrategySpec) -> None:
    """Declare how batches play a strategy."""
    setattr(strategy, _SPEC, spec)


def get_strategy_spec(strategy: object) -> StrategySpec:
    """Return the declaration of a strategy or of a team's plan; an empty one if it declares nothing.

    `functools.wraps` copies the attributes of the wrapped function, so a declaration that a wrapper shares with the
    wrapped function is ignored.
    """
    spec: StrategySpec = getattr(strategy, _SPEC, _UNDECLARED)
    wrapped = getattr(strategy, "__wrapped__", None)
    return _UNDECLARED if spec is getattr(wrapped, _SPEC, None) else spec


def list_pools(deciders: Iterable[tuple[Hashable, object]]) -> dict[Hashable, PoolSpec]:
    """Return the pool of each team that plays one; see `draw_members`."""
    return {team: pool for team, one in deciders if (pool := get_strategy_spec(one).pool) is not None}


def name_strategy(strategy: object) -> str:
    """Return the name of a strategy, or of a function that makes one, as results name opponents."""
    call: str | None = getattr(strategy, "call", None)
    if call is None:
        return str(getattr(strategy, "__name__", type(strategy).__name__))
    return call.replace("(ctx, ", "(").removesuffix("(ctx)")


def draw_members(deciders: Iterable[tuple[Hashable, object]], seed: int) -> dict[Hashable, str]:
    """Return the name of the member that each team with a pool plays in the game of a seed.

    Args:
        deciders: for each agent its team, and its strategy or the plan of its team.
        seed: the seed of the game.
    """
    return {team: pool.names[pool.draw(seed, team)] for team, pool in list_pools(deciders).items()}


def is_deciding_in_arrays(decider: object, settings: Mapping[str, Any]) -> bool:
    """Return whether a decider is called once for all games: by its array form, if games have no time budget."""
    spec = get_strategy_spec(decider)
    return spec.array_form is not None and not spec.is_called_each and settings["time_budget"] is None


def call_each(decider: object) -> None:
    """Let batches call a strategy, or the plan of a team, game by game from now on."""
    declare(decider, replace(get_strategy_spec(decider), is_called_each=True))


class Same:
    """A value in a key that is equal to itself alone.

    Args:
        value: the value.
    """

    def __init__(self, value: object) -> None:
        self._value = value

    def __eq__(self, other: object) -> bool:
        """Return whether the other one holds the same object."""
        return isinstance(other, Same) and other._value is self._value

    def __hash__(self) -> int:
        """Return the hash of the object's identity."""
        return id(self._value)


def make_form_key(form: Any) -> Hashable:
    """Return a key that is equal for equal forms; partial functions are equal if function and arguments are."""
    key: Hashable
    if isinstance(form, partial):
        key = (
            form.func,
            tuple(map(make_form_key, form.args)),
            tuple((k, make_form_key(v)) for k, v in sorted(form.keywords.items())),
        )
    else:
        key = tuple(map(make_form_key, form)) if isinstance(form, tuple | list) else form
    try:
        hash(key)
    except TypeError:
        return Same(form)
    return key
