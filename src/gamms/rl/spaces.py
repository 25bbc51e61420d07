"""The spaces of Gymnasium for what learners observe and do."""

from typing import Any

import numpy as np
from gymnasium import spaces

from gamms.ir.graph import IntArray
from gamms.rl.heads import action_masks
from gamms.rl.learners import Learners


class MovesAndDeeds(spaces.MultiDiscrete):
    """A move and a deed; samples take the masks of both one behind the other, as observations have them."""

    def sample(self, mask: Any = None, probability: Any = None) -> Any:
        """Return a pair of a move and a deed; see `gymnasium.spaces.MultiDiscrete`."""
        parts = (np.split(one, [self.nvec[0]]) if isinstance(one, np.ndarray) else one for one in (mask, probability))
        return super().sample(*(tuple(one) if isinstance(one, list) else one for one in parts))


def action_space(learners: Learners, agent: int = 0) -> spaces.Discrete | spaces.Box | MovesAndDeeds:
    """Return the space of what an agent does: see `heads`.

    Args:
        learners: of which it is one.
        agent: its number.
    """
    deeds = 0 if learners.deeds is None else len(learners.deeds)
    if learners.flies[agent]:
        return spaces.Box(-1.0, 1.0, (3 + deeds,), np.float32)
    return MovesAndDeeds([learners.num_actions, deeds]) if deeds else spaces.Discrete(learners.num_actions)


def observation_space(learners: Learners, agent: int = 0) -> spaces.Dict:
    """Return the space of what an agent observes: `observation`, and of one on the ground `action_mask`."""
    values = np.asarray(learners.observe())
    shape, kind = values.shape[2:], values.dtype
    if kind.kind == "f":
        box = spaces.Box(*learners.bounds, shape, kind.type)
    else:
        limits = (0, 1) if kind.kind == "b" else (np.iinfo(kind).min, np.iinfo(kind).max)
        box = spaces.Box(*limits, shape, np.int8 if kind.kind == "b" else kind.type)
    if learners.flies[agent]:
        return spaces.Dict({"observation": box})
    return spaces.Dict({"observation": box, "action_mask": spaces.Box(0, 1, action_masks(learners).shape[2:], np.int8)})


def observed(learners: Learners, which: IntArray | None = None) -> dict[str, Any]:
    """Return what all agents observe, as in `observation_space`; arrays begin with the games and the agents.

    Args:
        learners: the agents.
        which: the numbers of games; None: all.
    """
    values = np.asarray(learners.observe(which))
    found = {"observation": values.astype(np.int8) if values.dtype == np.bool_ else values}
    if learners.flies.all():
        return found
    masks = action_masks(learners)
    return found | {"action_mask": (masks if which is None else masks[which]).astype(np.int8)}
