"""Forms of strategies for arrays of any library: what their array forms do, without reading what is on the device.

So they compute for all agents, where those in NumPy do so for the agents that need it; draws count for these alone.
"""

from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np

from gamms.game.batch.device_view import DeviceView, columns_of
from gamms.game.batch.libraries import Tensor
from gamms.ir.graph import IntArray

Form = Callable[[DeviceView], Tensor]
_MOST_OFTEN = 8  # see `unblock`


def no_actions(view: DeviceView) -> Tensor:
    """Return -1 for all agents of a view: the form of setting no action."""
    return full(view, -1)


def full(view: DeviceView, number: int) -> Tensor:
    """Return a number for each agent of a view."""
    return view.xp.full(view.node.shape, number, dtype=view.xp.int64, device=view.library.device)


def stayed(view: DeviceView) -> Tensor:
    """Return what `stay` does."""
    return view.xp.zeros_like(view.node)


def walked(view: DeviceView) -> Tensor:
    """Return what `random_walk` does."""
    return view.draw.below(view.counts)


def asked(view: DeviceView, actions: Tensor, form: Form, which: Tensor) -> Tensor:
    """Return the actions with those of a form for some agents, (games, agents)."""
    some = view.only(which)
    return view.xp.where(some.mask, form(some), actions)


def moves_to(view: DeviceView, targets: Tensor, fallback: Form, known: IntArray | None = None) -> Tensor:
    """Return what `move_to` does; targets are rows of nodes, -1: none, all among those that are known."""
    is_going = view.mask & (targets >= 0)
    actions = view.xp.where(is_going, view.routes().actions(view.node, targets, among=known, asked=is_going), -1)
    return asked(view, actions, fallback, actions < 0)


def remembered(view: DeviceView, key: str, **first: int) -> dict[str, Tensor]:
    """Return what agents remember under a key of `state["memory"]`: name -> (games, agents), at first these numbers."""
    agents = len(view.roster.names)
    kept = view.keep(("memory", key), lambda games: {name: np.full((games, agents), n) for name, n in first.items()})
    return {name: columns_of(column, view.agents, view.library) for name, column in kept.items()}


def remember(view: DeviceView, key: str, **values: Tensor) -> None:
    """Keep what those agents remember from now on that are in the mask of a view."""
    kept, xp, agents = view.keep(("memory", key), lambda _: {}), view.xp, len(view.roster.names)
    places = np.arange(agents)
    places[view.agents] = agents + np.arange(len(view.agents))
    order = view.library.put(places)
    for name, column in values.items():
        own = xp.where(view.mask, column, columns_of(kept[name], view.agents, view.library))
        kept[name] = own if len(view.agents) == agents else xp.take(xp.concat((kept[name], own), axis=1), order, axis=1)


def go(target: int, fallback: Form, view: DeviceView) -> Tensor:
    """The form of `goto` a node."""
    row = view.streets.host.rows([target])
    return moves_to(view, full(view, int(row[0])), fallback, row)


def wander(chosen: tuple[int, ...] | None, turns: int, fallback: Form, view: DeviceView) -> Tensor:
    """The form of `random_waypoints`."""
    xp, known, streets = view.xp, remembered(view, "random_waypoints", target=-1, left=0), view.streets.host
    among = None if chosen is None else streets.rows(chosen)
    options = np.arange(len(streets.counts)) if among is None else among
    target, left, is_there = known["target"], known["left"], known["target"] == view.node
    going = view.mask & ~is_there & (target >= 0)
    is_lost = going & (view.routes().distances(view.node, target, among=among, asked=going) == np.inf)
    draws = view.mask & ((target < 0) | is_lost | (is_there & (left <= 0)))
    left = xp.where(is_there & (left > 0), left - 1, left)
    drawn = view.library.put(options)[view.only(draws).draw.below(len(options))]
    target, left = xp.where(draws, drawn, target), xp.where(draws, turns, left)
    remember(view, "random_waypoints", target=target, left=left)
    return moves_to(view, target, fallback, among)


def route(
    key: str, stops: tuple[int, ...], repeat: bool, is_nearest_first: bool, fallback: Form, view: DeviceView
) -> Tensor:
    """The form of `patrol` and `follow_path`."""
    xp, put, rows = view.xp, view.library.put, view.streets.host.rows(stops)
    at, stop_rows = remembered(view, key, at=-1)["at"], put(np.append(rows, -1))
    first = full(view, 0)
    if is_nearest_first:
        distances = view.routes().distances(view.node[..., None], put(rows)[None, None, :], among=rows)
        first = xp.argmin(distances, axis=2)
    at = xp.where(at < 0, xp.where(view.mask, first, 0), at)
    at = xp.where(stop_rows[at] == view.node, put(np.array(_following(stops, repeat=repeat)))[at], at)
    remember(view, key, at=at)
    return moves_to(view, stop_rows[at], fallback, rows)


@lru_cache(maxsize=256)
def _following(stops: tuple[int, ...], *, repeat: bool) -> tuple[int, ...]:
    """Return of each stop the number of the next one at another node, and behind the last one their number."""
    found = []
    for first, node in enumerate(stops):
        at = first
        for _ in stops:  # no more than once round: they may all be the same node
            if at == len(stops) or stops[at] != node:
                break
            at = (at + 1) % len(stops) if repeat else at + 1
        found.append(at)
    return (*found, len(stops))


def first_of(*forms_and_view: Any) -> Tensor:
    """The form of `first`."""
    *forms, view = forms_and_view
    actions = no_actions(view)
    for form in forms:
        actions = asked(view, actions, form, actions < 0)
    return actions


def mixed(chance: float, b: Form, a: Form, view: DeviceView) -> Tensor:
    """The form of `mix`."""
    is_a = view.draw.random() < chance
    return asked(view, asked(view, no_actions(view), a, is_a), b, ~is_a)


def unblocked(patience: int, goes_on: Form, view: DeviceView) -> Tensor:
    """The form of `unblock`."""
    xp, known = view.xp, remembered(view, "unblock", blocked=0, calm=0, often=0, left=0, ahead=-1)
    blocked, calm = xp.where(view.blocked, known["blocked"] + 1, 0), xp.where(view.blocked, 0, known["calm"] + 1)
    often = xp.where(calm > _powers(known["often"]), 0, known["often"])
    left = xp.where(known["left"] > 0, known["left"] - 1, 0)
    waits = view.only(blocked >= patience)
    yields = waits.mask & (waits.draw.random() < 0.5)
    often = xp.where(yields, xp.where(often < _MOST_OFTEN, often + 1, _MOST_OFTEN), often)
    blocked, calm = xp.where(yields, 0, blocked), xp.where(yields, 0, calm)
    turns = 1 + view.only(yields).draw.below(_powers(xp.where(often > 0, often - 1, 0)))
    left = xp.where(yields, turns, left)
    aside = view.only(left > 0)
    actions = asked(view, _drawn_aside(aside, known["ahead"]), goes_on, left <= 0)
    follows = xp.where(actions < 0, -1, view.streets.step(view.node, xp.where(actions < 0, 0, actions)))
    ahead = xp.where(aside.mask, view.node, follows)
    remember(view, "unblock", blocked=blocked, calm=calm, often=often, left=left, ahead=ahead)
    return actions


def _powers(numbers: Tensor) -> Tensor:
    """Return 2 to the power of some numbers."""
    return (numbers * 0 + 1) << numbers


def _drawn_aside(view: DeviceView, ahead: Tensor) -> Tensor:
    """Return actions to legal nodes that are neither the own ones nor those ahead, or to any where there are none."""
    xp, (nodes, is_legal) = view.xp, view.legal_rows()
    is_free = is_legal & (nodes != view.node[..., None]) & (nodes != ahead[..., None])
    options = xp.where(xp.any(is_free, axis=2, keepdims=True), is_free, is_legal)
    counted = xp.cumulative_sum(xp.astype(options, xp.int64), axis=2)
    drawn = view.draw.below(counted[..., -1])
    return xp.argmax(xp.astype(counted > drawn[..., None], xp.int64), axis=2)


def chase(fallback: Form, view: DeviceView) -> Tensor:
    """The form of `chase`."""
    xp, (far, node) = view.xp, _enemies_by_road(view)
    best = xp.argmin(far, axis=2, keepdims=True)
    is_it = xp.arange(far.shape[2], device=view.library.device) == best
    target = xp.max(xp.where(is_it & (far < np.inf), node[:, None, :], -1), axis=2)
    return moves_to(view, target, fallback)


def _enemies_by_road(view: DeviceView) -> tuple[Tensor, Tensor]:
    """Return how far it is to the agents, (games, agents, all agents), infinite but to enemies in sight; and where."""
    seen, node = view.sees_enemies(), view.nodes_of_all()
    far = view.routes().distances(view.node[..., None], node[:, None, :], asked=seen)
    return view.xp.where(seen, far, np.inf), node


def flee(fallback: Form, view: DeviceView) -> Tensor:
    """The form of `flee`."""
    xp, (legal, is_legal) = view.xp, view.legal_rows()
    seen, node = view.sees_enemies(), view.nodes_of_all()
    is_asked = seen[..., None] & is_legal[:, :, None, :]
    far = view.routes().distances(node[:, None, :, None], legal[:, :, None, :], asked=is_asked)
    safety = xp.min(xp.where(seen[..., None], far, np.inf), axis=2)
    safety = xp.where(is_legal, safety, -np.inf)
    is_best = is_legal & (safety == xp.max(safety, axis=2, keepdims=True))
    ids = xp.where(is_best, view.streets.ids(legal), np.iinfo(np.int64).max)
    actions = xp.where(xp.any(seen, axis=2), xp.argmin(ids, axis=2), -1)
    return asked(view, actions, fallback, actions < 0)
