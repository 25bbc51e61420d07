"""The heads of actions: for agents on the ground a move and optionally a deed, for flying agents a flight.

A move and a deed are given as a pair, or as the number `move * choices + deed`, where `choices` is the number of deed
choices, doing nothing included. A flying agent gives numbers from -1 to 1: east, north and up, as shares of its reach
in a turn; with deeds, one more number for each deed choice, of which the largest wins.
"""

from collections.abc import Sequence
from math import prod
from typing import Any, NamedTuple

import numpy as np

from gamms.errors import BadValue
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.rl.learners import Learners, are_in, check_range
from gamms.text import shown

AXES = 3  # components of a flight


class ActionHeads(NamedTuple):
    """The decoded actions of agents, (games, agents), as arguments of `Learners.step`."""

    moves: IntArray
    deeds: IntArray | None
    flights: FloatArray | None


def make_heads(learners: Learners, given: Sequence[tuple[IntArray, Any]], *, are_flat: bool = False) -> ActionHeads:
    """Return the heads of actions.

    Args:
        learners: the learners.
        given: pairs of agent numbers, all on the ground or all flying, and their actions in all games, in any shape of
            the right size. Other agents stay.
        are_flat: whether a move and a deed are a single number.

    Raises:
        BadValue: the actions are not in the action space.
    """
    shape = learners.masks.shape[:2]
    deeds = None if learners.deeds is None else np.zeros(shape, np.int64)
    flights = np.zeros((*shape, AXES)) if learners.any_fly else None
    moves = np.zeros(shape, np.int64)
    for agents, actions in given:
        if not len(agents):
            continue
        values = as_actions(learners, shape[0], agents, actions, are_flat=are_flat)
        if flights is not None and learners.flies[agents[0]]:
            flights[:, agents] = values[..., :AXES]
            if deeds is not None:
                legal = learners.deed_masks[:, agents]
                deeds[:, agents] = np.where(legal, np.nan_to_num(values[..., AXES:]), -np.inf).argmax(axis=2)
        elif deeds is None or learners.deeds is None:
            moves[:, agents] = values
        elif are_flat:
            moves[:, agents], found = np.divmod(values, len(learners.deeds))
            deeds[:, agents] = np.where(learners.are_legal(moves)[:, agents], found, 0)
        else:
            moves[:, agents] = values[..., 0]
            deeds[:, agents] = values[..., 1]
    return ActionHeads(moves, deeds, flights)


def as_actions(
    learners: Learners, games: int, agents: IntArray, actions: object, *, are_flat: bool = False
) -> np.ndarray[Any, Any]:
    """Return actions of agents, all on the ground or all flying, as an array (games, agents, …).

    Raises:
        BadValue: the actions are not in the action space, or no game has begun. Illegal ones in the space are allowed.
    """
    if not learners.has_begun:
        raise BadValue("No game has begun: call reset() before step().")
    shape = (games, len(agents))
    choices = 0 if learners.deeds is None else len(learners.deeds)
    if learners.flies[agents[0]]:
        wide = AXES + choices
        return _check_numbers(actions, (*shape, wide), "iuf", f"{wide} numbers from -1 to 1 for each")
    count: Any = learners.num_actions * max(1, choices)
    if not choices or are_flat:
        found = _check_numbers(actions, shape, "iu", "integers, one for each")
    else:
        found = _check_numbers(actions, (*shape, 2), "iu", "integers, each a pair of a move and a deed for each")
        count = np.array([learners.num_actions, choices])
    check_range(found, count, [learners.names[agent] for agent in agents.tolist()])
    return found


def _check_numbers(actions: object, shape: tuple[int, ...], kinds: str, form: str) -> np.ndarray[Any, Any]:
    try:
        given = np.asarray(actions)
    except ValueError:  # rows of different shapes
        given = np.asarray("")
    if given.size != prod(shape) or given.dtype.kind not in kinds:
        raise BadValue(
            f"Actions are {form} of {shape[0] * shape[1]} agents, not {shown(actions)} ({given.dtype} of the shape "
            f"{given.shape})."
        )
    return given.reshape(shape)


def are_legal(learners: Learners, heads: ActionHeads) -> BoolArray:
    """Return whether actions are legal, (games, agents); for flying agents, numbers from -1 to 1."""
    found = learners.are_legal(heads.moves)
    if heads.deeds is not None:
        found &= are_in(learners.deed_masks, heads.deeds)
    if heads.flights is not None:
        found &= (np.abs(heads.flights) <= 1.0).all(axis=2)
    return found


def compute_action_masks(learners: Learners, *, are_flat: bool = False) -> BoolArray:
    """Return a mask of legal actions, (games, agents, actions): moves, followed by deeds if there are any.

    Args:
        learners: the learners.
        are_flat: whether a move and a deed are a single number; then the mask has an entry for each pair.

    Raises:
        BadValue: all agents fly.
    """
    if learners.all_fly:
        raise BadValue(f"Agent {shown(learners.names[0])} flies, and what it does has no mask: learn without masks.")
    if learners.deeds is None:
        return learners.masks
    moves = learners.masks
    deeds = learners.deed_masks
    if are_flat:
        return (moves[..., None] & deeds[..., None, :]).reshape(*moves.shape[:2], -1)
    found: BoolArray = np.concatenate((moves, deeds), axis=2)
    return found


def refuse_mixed(learners: Learners, agents: Sequence[int], what: str) -> None:
    """Refuse agents of which only some fly, where they share one action space.

    Raises:
        BadValue: only some of the agents fly.
    """
    flies = learners.flies[[*agents]]
    if flies.any() and not flies.all():
        one, other = (learners.names[agents[int(np.argmax(flies == value))]] for value in (True, False))
        raise BadValue(
            f"Agent {shown(one)} flies and {shown(other)} does not, and {what} has one action space: let one of these "
            "kinds learn, by agent= or in a team of its own, or use parallel_env."
        )
