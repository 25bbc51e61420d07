"""Pools of strategies: each team plays one member of a pool in each game, drawn by the game's seed."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import accumulate, chain, count
from typing import Any, NamedTuple, cast

import numpy as np

from gamms.arguments import as_context, as_float, as_items, as_mapping, as_name
from gamms.deciding import get_phase
from gamms.errors import BadType, BadValue
from gamms.game.array_functions.declarations import array_strategy
from gamms.game.array_functions.view import ArrayView, get_pool_shares
from gamms.game.strategy_specs import CoreStep, PoolSpec, declare, get_strategy_spec, name_strategy
from gamms.strategies.knowledge import as_strategy, get_required, offer_steps
from gamms.text import shown
from gamms.typing import IContext
from gamms.typing.actions import make_strategy
from gamms.typing.context import HostContext
from gamms.typing.game import State

Maker = Callable[[IContext], Callable[[Any], None]]

_MEMBERS = "pool_members"  # the attribute of a pool that lists its members, for pools that have it as a member


class PoolMember(NamedTuple):
    """A member of a pool: a strategy or a function that makes one, and the probability that it is drawn."""

    name: str
    strategy: Any
    share: float


def pool(members: Iterable[Any] | Mapping[str, Any], weights: Iterable[float] | None = None) -> Maker:
    """Return a strategy that plays one of several: each team draws a member for each game, by the game's seed.

    It is made in a context, like `chase`, and accepted wherever a strategy is:
    `strategies={"blue": pool([chase, flee, random_walk])}`. All agents of a team play the same member. The core plays a
    pool if it plays all members. If all are array strategies, such as saved policies, the pool is one; else batches
    call it game by game.

    Args:
        members: strategies, or functions that make them in a context; or name -> one of these. A pool among them stands
            for its members.
        weights: the weight of each member, proportional to its probability; None: all are equal.

    Raises:
        BadType, BadValue: there are no members, or the weights are not numbers of at least 0 for each member.
    """
    given = _list_members(members, weights)
    make: Any = partial(_make_pool, members=given)  # which other processes can get, unlike a closure
    make.__name__ = make.__qualname__ = f"pool([{', '.join([one.name for one in given])}])"
    setattr(make, _MEMBERS, given)
    return cast("Maker", make)


def pool_for_scenario(
    ctx: IContext,
    members: list[Callable[[Any], None]] | dict[str, Callable[[Any], None]],
    weights: list[float] | None = None,
) -> Callable[[Any], None]:
    """Return the strategy for a scenario file: `{function: gamms.strategies:pool, with: {members: […]}}`."""
    return pool(members, weights)(ctx)


def _list_members(members: object, weights: Iterable[float] | None) -> list[PoolMember]:
    """Return the members of a pool; of a pool among them, its members."""
    if isinstance(members, Mapping):
        named = {as_name(name, "a member of a pool"): one for name, one in as_mapping(members, "members").items()}
        given = [*named.items()]
    else:
        items = as_items(members, "members", "strategies")
        given = [(name_strategy(one) if callable(one) else str(number), one) for number, one in enumerate(items)]
    if not given:
        raise BadValue("A pool needs at least one member, such as pool([chase, flee]).")
    shares = _compute_shares(weights, len(given))
    found: list[PoolMember] = []
    for (name, one), share in zip(given, shares, strict=True):
        if not callable(one):
            raise BadType(
                f"Member {shown(name)} of a pool must be a strategy, or a function of a context that makes one, not "
                f"{shown(one)} ({type(one).__name__}). In a scenario file, write {{function: gamms.strategies:chase}}."
            )
        inner: list[PoolMember] = getattr(one, _MEMBERS, [PoolMember(name, one, 1.0)])
        found += [member._replace(share=member.share * share) for member in inner]
    return _number_members(found)


def list_pool_members(strategy: object) -> list[PoolMember]:
    """Return the members of a pool that may be drawn; of any other strategy an empty list."""
    members: list[PoolMember] = getattr(strategy, _MEMBERS, [])
    return [member for member in members if member.share > 0.0]


def _number_members(members: list[PoolMember]) -> list[PoolMember]:
    """Return members with different names: equal ones get numbers."""
    names: list[str] = []
    for member in members:
        others = (f"{member.name} {number}" for number in count(2))
        names.append(next(one for one in chain([member.name], others) if one not in names))
    return [member._replace(name=name) for member, name in zip(members, names, strict=True)]


def _compute_shares(weights: Iterable[float] | None, number: int) -> list[float]:
    """Return the probability of each member."""
    given = [1.0] * number if weights is None else [*as_items(weights, "weights", "numbers")]
    numbers = [as_float(one, "Each of weights") for one in given]
    if len(numbers) != number or min(numbers) < 0.0 or not sum(numbers) > 0.0:
        raise BadValue(
            f"weights are numbers of at least 0, one for each of {number} members, and not all 0; not {shown(given)}."
        )
    return [one / sum(numbers) for one in numbers]


def _compute_bounds(members: Sequence[PoolMember]) -> tuple[float, ...]:
    """Return the end of the part of [0, 1) in which each member is drawn; that of the last one drawn is 1."""
    sums = [*accumulate(member.share for member in members)]
    return tuple([1.0 if one >= sums[-1] else one / sums[-1] for one in sums])


def _make_pool(ctx: IContext, *, members: Sequence[PoolMember]) -> Callable[[Any], None]:
    """Return the strategy of a pool in a context."""
    as_context(ctx, "A pool")
    spec = PoolSpec(tuple([one.name for one in members]), _compute_bounds(members))
    options = [as_strategy(make_strategy(ctx, one.strategy), "Each member of a pool") for one in members]
    strategy = _make_strategy(ctx, options, spec, f"pool([{', '.join(spec.names)}])")
    made = [one._replace(strategy=option) for one, option in zip(members, options, strict=True)]
    setattr(strategy, _MEMBERS, made)
    return strategy


def _make_strategy(
    ctx: IContext, options: list[Callable[[Any], None]], spec: PoolSpec, name: str
) -> Callable[[Any], None]:
    """Return the strategy of a pool with these members."""
    specs = [get_strategy_spec(one) for one in options]
    forms = tuple([one.array_form for one in specs if one.array_form is not None and not one.is_called_each])
    if len(forms) == len(options):
        form: Any = partial(_play_members, forms=forms, bounds=spec.bounds)
        form.__name__ = name
        strategy = array_strategy(form)(ctx)
        declare(strategy, replace(get_strategy_spec(strategy), pool=spec))
        return strategy

    def play_pool(state: State) -> None:
        with get_phase(ctx).suspend(changes_world=False):
            seed = cast("HostContext", ctx).seed
        options[spec.draw(seed, get_required(state, "team", "pool"))](state)

    play_pool.__name__ = play_pool.__qualname__ = name
    offer_steps(play_pool, *_list_steps(options, spec.bounds))
    declare(play_pool, replace(get_strategy_spec(play_pool), pool=spec))
    return play_pool


def _list_steps(
    options: list[Callable[[Any], None]], bounds: tuple[float, ...]
) -> list[CoreStep | Callable[[Any], None] | None]:
    """Return the steps of a pool, as `offer_steps` takes them: for each member a choice, its steps, and a jump."""
    several = [get_strategy_spec(one).core_steps for one in options]
    if None in several:
        return [None, *options]
    sizes = [len(steps or ()) for steps in several]
    found: list[CoreStep | Callable[[Any], None] | None] = []
    for number, option in enumerate(options[:-1]):
        left = sum(sizes[number + 1 :]) + 2 * (len(options) - number - 2)
        pick = CoreStep("pick", number=sizes[number] + 1, chance=bounds[number])
        found += [pick, option, CoreStep("skip", number=left)]
    return [*found, options[-1]]


def _play_members(view: ArrayView, *, forms: tuple[Callable[[ArrayView], Any], ...], bounds: tuple[float, ...]) -> Any:
    """Return the actions of agents, each decided by the array strategy that its team has drawn in its game."""
    drawn = np.searchsorted(bounds, get_pool_shares(view), side="right")
    actions = np.zeros((*view.node.shape, 3) if view.flies else view.node.shape, float if view.flies else np.int64)
    for number, form in enumerate(forms):
        is_asked = drawn == number
        if (is_asked & view.mask).any():
            decided = np.asarray(form(view.only(is_asked)))
            actions = np.where(is_asked[..., None] if view.flies else is_asked, decided, actions)
    return actions
