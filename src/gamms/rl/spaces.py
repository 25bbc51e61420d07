"""The spaces of Gymnasium for what learners observe and do."""

from typing import Any

import numpy as np
from gymnasium import spaces

from gamms.rl.learners import Learners


def observation_space(learners: Learners) -> spaces.Dict:
    """Return the space of what one agent observes: `observation` and `action_mask`."""
    values = np.asarray(learners.observe())
    shape, kind = values.shape[2:], values.dtype
    if kind.kind == "f":
        box = spaces.Box(*learners.bounds, shape, kind.type)
    else:
        limits = (0, 1) if kind.kind == "b" else (np.iinfo(kind).min, np.iinfo(kind).max)
        box = spaces.Box(*limits, shape, np.int8 if kind.kind == "b" else kind.type)
    mask = spaces.Box(0, 1, (learners.num_actions,), np.int8)
    return spaces.Dict({"observation": box, "action_mask": mask})


def observed(learners: Learners) -> dict[str, Any]:
    """Return what all agents observe, as in `observation_space`; arrays begin with the games and the agents."""
    values = np.asarray(learners.observe())
    values = values.astype(np.int8) if values.dtype == np.bool_ else values
    return {"observation": values, "action_mask": learners.masks.astype(np.int8)}
