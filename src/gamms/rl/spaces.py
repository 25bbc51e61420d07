"""The spaces of Gymnasium for what learners observe and do."""

from typing import Any

import numpy as np
from gymnasium import spaces

from gamms.errors import BadValue
from gamms.ir.graph import IntArray
from gamms.rl.learners import ActionArray, Learners, are_in, joined
from gamms.text import shown


class MovesAndDeeds(spaces.MultiDiscrete):
    """A move and a deed; samples take the masks of both one behind the other, as observations have them."""

    def sample(self, mask: Any = None, probability: Any = None) -> Any:
        """Return a pair of a move and a deed; see `gymnasium.spaces.MultiDiscrete`."""
        parts = (np.split(one, [self.nvec[0]]) if isinstance(one, np.ndarray) else one for one in (mask, probability))
        return super().sample(*(tuple(one) if isinstance(one, list) else one for one in parts))


def action_space(learners: Learners) -> spaces.Discrete | MovesAndDeeds:
    """Return the space of what one agent does: the number of a legal node, and of a deed where there are any."""
    if learners.deeds is None:
        return spaces.Discrete(learners.num_actions)
    return MovesAndDeeds([learners.num_actions, len(learners.deeds)])


def observation_space(learners: Learners) -> spaces.Dict:
    """Return the space of what one agent observes: `observation` and `action_mask`."""
    values = np.asarray(learners.observe())
    shape, kind = values.shape[2:], values.dtype
    if kind.kind == "f":
        box = spaces.Box(*learners.bounds, shape, kind.type)
    else:
        limits = (0, 1) if kind.kind == "b" else (np.iinfo(kind).min, np.iinfo(kind).max)
        box = spaces.Box(*limits, shape, np.int8 if kind.kind == "b" else kind.type)
    mask = spaces.Box(0, 1, action_masks(learners).shape[2:], np.int8)
    return spaces.Dict({"observation": box, "action_mask": mask})


def action_masks(learners: Learners) -> np.ndarray[Any, np.dtype[np.bool_]]:
    """Return which actions are legal, (games, agents, actions): moves, and behind them deeds where there are any."""
    parts = [learners.masks] if learners.deeds is None else [learners.masks, learners.deed_masks]
    found: np.ndarray[Any, np.dtype[np.bool_]] = joined(np, parts, axis=2)
    return found


def observed(learners: Learners, which: IntArray | None = None) -> dict[str, Any]:
    """Return what all agents observe, as in `observation_space`; arrays begin with the games and the agents.

    Args:
        learners: the agents.
        which: the numbers of games; None: all.
    """
    values, masks = np.asarray(learners.observe(which)), action_masks(learners)
    values = values.astype(np.int8) if values.dtype == np.bool_ else values
    return {"observation": values, "action_mask": (masks if which is None else masks[which]).astype(np.int8)}


def moves_and_deeds(learners: Learners, actions: Any) -> tuple[ActionArray, ActionArray | None]:
    """Return the moves, (games, agents), and the deeds of actions; None: there are no deeds.

    Args:
        learners: who takes them.
        actions: of all games and agents, in any shape that has as many numbers.

    Raises:
        BadValue: they are not of the action space.
    """
    shape = learners.masks.shape[:2]
    try:
        given = np.asarray(actions)
    except ValueError:  # of several shapes
        given = np.asarray("")
    if learners.deeds is not None:
        shape = *shape, 2
    if given.size != np.prod(shape) or given.dtype.kind not in "iu":
        of_deeds = "" if learners.deeds is None else ", each a pair of a move and a deed"
        raise BadValue(
            f"Actions are integers, one for each of {shape[0] * shape[1]} agents{of_deeds}, not {shown(actions)} "
            f"({given.dtype} of the shape {given.shape})."
        )
    given = given.reshape(shape)
    return (given, None) if learners.deeds is None else (given[..., 0], given[..., 1])


def are_legal(learners: Learners, moves: ActionArray, deeds: ActionArray | None) -> np.ndarray[Any, np.dtype[np.bool_]]:
    """Return whose actions are legal, (games, agents)."""
    found = are_in(learners.masks, moves)
    return found if deeds is None else found & are_in(learners.deed_masks, deeds)
