"""What an environment makes of learners: its spaces, the observations and masks that it gives, the actions it takes."""

from collections.abc import Sequence
from typing import Any, Literal, get_args

import numpy as np
from gymnasium import spaces

from gamms.arguments import as_choice
from gamms.errors import BadValue
from gamms.ir.graph import IntArray
from gamms.ir.obstacles import BoolArray
from gamms.rl import heads
from gamms.rl.learners import Learners

Columns = dict[str, Any]  # `observation` and `action_mask`, (games, agents, …)
MaskPlace = Literal["observation", "info"]
ActionForm = Literal["pair", "discrete"]
_MOST = 4096  # actions of a discrete space


class MovesAndDeeds(spaces.MultiDiscrete):
    """A move and a deed; samples take the masks of both one behind the other, as observations have them."""

    def sample(self, mask: Any = None, probability: Any = None) -> Any:
        """Return a pair of a move and a deed; see `gymnasium.spaces.MultiDiscrete`."""
        parts = (np.split(one, [self.nvec[0]]) if isinstance(one, np.ndarray) else one for one in (mask, probability))
        return super().sample(*(tuple(one) if isinstance(one, list) else one for one in parts))


class Interface:
    """The spaces of Gymnasium for learners, and what is given and taken in them.

    Args:
        learners: in one game or in many.
        mask: "observation": observations are dicts of the numbers and the mask; "info": they are the numbers alone,
            and the mask is in the infos.
        actions: "pair": a move and a deed are two numbers; "discrete": they are one, see `heads`.

    Attributes:
        learners: see above.
        has_masks: whether observations have masks.

    Raises:
        BadValue: an option has another value; there are more than 4,096 pairs of moves and deeds, or only agents that
            fly, which have no discrete actions.
    """

    def __init__(self, learners: Learners, mask: MaskPlace = "observation", actions: ActionForm = "pair") -> None:
        self.learners = learners
        self.has_masks = as_choice(mask, "mask", get_args(MaskPlace)) == "observation"
        self._are_flat = as_choice(actions, "actions", get_args(ActionForm)) == "discrete"
        if not self._are_flat:
            return
        if learners.flies.all():
            raise BadValue("actions='discrete' is for agents on the ground; all that learn here fly: leave it out.")
        most = learners.num_actions * self._choices
        if most > _MOST:
            raise BadValue(
                f"actions='discrete' makes {learners.num_actions} moves and {self._choices} deeds {most} actions, and "
                f"{_MOST} is the limit: leave it out, for pairs of a move and a deed, or declare fewer deeds."
            )

    @property
    def _choices(self) -> int:
        return 1 if self.learners.deeds is None else len(self.learners.deeds)

    def action_space(self, agent: int = 0) -> spaces.Discrete | spaces.Box | MovesAndDeeds:
        """Return the space of the actions of an agent, by its number; see `heads`."""
        learners, has_deeds = self.learners, self.learners.deeds is not None
        if learners.flies[agent]:
            return spaces.Box(-1.0, 1.0, (heads.AXES + has_deeds * self._choices,), np.float32)
        if has_deeds and not self._are_flat:
            return MovesAndDeeds([learners.num_actions, self._choices])
        return spaces.Discrete(learners.num_actions * self._choices)

    def observation_space(self, agent: int = 0) -> spaces.Dict | spaces.Box:
        """Return the space of the observations of an agent, by its number: see `mask` above."""
        values = np.asarray(self.learners.observe())
        shape, kind = values.shape[2:], values.dtype
        if kind.kind == "f":
            box = spaces.Box(*self.learners.bounds, shape, kind.type)
        else:
            limits = (0, 1) if kind.kind == "b" else (np.iinfo(kind).min, np.iinfo(kind).max)
            box = spaces.Box(*limits, shape, np.int8 if kind.kind == "b" else kind.type)
        if not self.has_masks:
            return box
        if self.learners.flies[agent]:
            return spaces.Dict({"observation": box})
        return spaces.Dict({"observation": box, "action_mask": spaces.Box(0, 1, self.masks().shape[2:], np.int8)})

    def columns(self, which: IntArray | None = None) -> Columns:
        """Return what all agents observe, and their masks unless all fly; arrays begin with the games and the agents.

        Args:
            which: the numbers of games; None: all.
        """
        values = np.asarray(self.learners.observe(which))
        found = {"observation": values.astype(np.int8) if values.dtype == np.bool_ else values}
        if self.learners.flies.all():
            return found
        masks = self.masks()
        return found | {"action_mask": (masks if which is None else masks[which]).astype(np.int8)}

    def given(self, columns: Columns) -> Any:
        """Return observations as the environment gives them, of columns in any shape."""
        return columns if self.has_masks else columns["observation"]

    def masks(self) -> BoolArray:
        """Return which actions are legal, (games, agents, actions).

        Raises:
            BadValue: all agents fly.
        """
        return heads.action_masks(self.learners, are_flat=self._are_flat)

    def heads_of(self, given: Sequence[tuple[IntArray, Any]]) -> heads.Heads:
        """Return the heads of actions; see `heads.heads_of`."""
        return heads.heads_of(self.learners, given, are_flat=self._are_flat)

    def as_actions(self, games: int, agents: IntArray, actions: object) -> np.ndarray[Any, Any]:
        """Return actions as an array that begins (games, agents); see `heads.as_actions`."""
        return heads.as_actions(self.learners, games, agents, actions, are_flat=self._are_flat)


def mask_in(columns: Columns) -> dict[str, Any]:
    """Return the infos with the mask of columns; agents that fly have none."""
    return {key: value for key, value in columns.items() if key == "action_mask"}
