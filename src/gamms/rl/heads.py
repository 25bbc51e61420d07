"""The heads of actions: of agents on the ground a move and perhaps a deed, of those that fly a flight.

A move and a deed are given as a pair, or flat: as the number `move * choices + deed`, where `choices` is how many deeds
there are, doing nothing included. An agent that flies gives numbers from -1 to 1: east, north and up, in shares of what
it reaches in a turn; and, where there are deeds, one for each choice of a deed, of which that with the largest number
is done.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from gamms.errors import BadValue
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.rl.learners import Learners, are_in
from gamms.text import shown

AXES = 3  # of flights


class Heads(NamedTuple):
    """What agents do, as `Learners.step` takes it, (games, agents)."""

    moves: IntArray
    deeds: IntArray | None
    flights: FloatArray | None


def heads_of(learners: Learners, given: Sequence[tuple[IntArray, Any]], *, are_flat: bool = False) -> Heads:
    """Return the heads of actions.

    Args:
        learners: who take them.
        given: the numbers of agents, all on the ground or all in the air, and their actions in all games, in any shape
            that has as many numbers. The others stay.
        are_flat: whether moves and deeds are one number.

    Raises:
        BadValue: they are not of the action space.
    """
    shape = learners.masks.shape[:2]
    deeds = None if learners.deeds is None else np.zeros(shape, np.int64)
    flights = np.zeros((*shape, AXES)) if learners.flies.any() else None
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
            moves[:, agents], deeds[:, agents] = values[..., 0], values[..., 1]
    return Heads(moves, deeds, flights)


def as_actions(
    learners: Learners, games: int, agents: IntArray, actions: object, *, are_flat: bool = False
) -> np.ndarray[Any, Any]:
    """Return actions of some agents, all on the ground or all in the air, as an array that begins (games, agents).

    Raises:
        BadValue: they are not of the action space, or no game has begun.
    """
    if not learners.has_begun:
        raise BadValue("No game has begun: call reset() before step().")
    shape, choices = (games, len(agents)), 0 if learners.deeds is None else len(learners.deeds)
    if learners.flies[agents[0]]:
        wide = AXES + choices
        return _numbers(actions, (*shape, wide), "iuf", f"{wide} numbers from -1 to 1 for each")
    if not choices or are_flat:
        return _numbers(actions, shape, "iu", "integers, one for each")
    return _numbers(actions, (*shape, 2), "iu", "integers, each a pair of a move and a deed for each")


def _numbers(actions: object, shape: tuple[int, ...], kinds: str, form: str) -> np.ndarray[Any, Any]:
    try:
        given = np.asarray(actions)
    except ValueError:  # of several shapes
        given = np.asarray("")
    if given.size != np.prod(shape) or given.dtype.kind not in kinds:
        raise BadValue(
            f"Actions are {form} of {shape[0] * shape[1]} agents, not {shown(actions)} ({given.dtype} of the shape "
            f"{given.shape})."
        )
    return given.reshape(shape)


def are_legal(learners: Learners, heads: Heads) -> BoolArray:
    """Return whose actions are legal, (games, agents): of those that fly, numbers from -1 to 1."""
    found = learners.are_legal(heads.moves)
    if heads.deeds is not None:
        found &= are_in(learners.deed_masks, heads.deeds)
    if heads.flights is not None:
        found &= (np.abs(heads.flights) <= 1.0).all(axis=2)
    return found


def action_masks(learners: Learners, *, are_flat: bool = False) -> BoolArray:
    """Return which actions are legal, (games, agents, actions): moves, and behind them deeds where there are any.

    Args:
        learners: the agents.
        are_flat: whether moves and deeds are one number: then each pair of them has a place.

    Raises:
        BadValue: all agents fly.
    """
    if learners.flies.all():
        raise BadValue(f"Agent {shown(learners.names[0])} flies, and what it does has no mask: learn without masks.")
    if learners.deeds is None:
        return learners.masks
    moves, deeds = learners.masks, learners.deed_masks
    if are_flat:
        return (moves[..., None] & deeds[..., None, :]).reshape(*moves.shape[:2], -1)
    found: BoolArray = np.concatenate((moves, deeds), axis=2)
    return found


def refuse_mixed(learners: Learners, agents: Sequence[int], what: str) -> None:
    """Refuse agents of which some fly and others do not, where they need one action space.

    Raises:
        BadValue: they do.
    """
    flies = learners.flies[[*agents]]
    if flies.any() and not flies.all():
        one, other = (learners.names[agents[int(np.argmax(flies == value))]] for value in (True, False))
        raise BadValue(
            f"Agent {shown(one)} flies and {shown(other)} does not, and {what} has one action space: let one of these "
            "kinds learn, by agent= or in a team of its own, or use parallel_env."
        )
