"""The common parts of environments: spaces, observations, masks and actions, pictures, and copies.

A game is determined by its seed and the actions of its agents, so copies and pickles contain only these.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal, NamedTuple, get_args

import numpy as np
from gymnasium import spaces

from gamms.arguments import as_choice
from gamms.errors import BadValue
from gamms.ir.graph import IntArray
from gamms.ir.obstacles import BoolArray
from gamms.rl import heads
from gamms.rl.learners import Learners
from gamms.scenario import Scenario
from gamms.text import shown
from gamms.visual import Engine
from gamms.visual.window.display import may_open

Columns = dict[str, Any]  # `observation` and `action_mask`, (games, agents, …)
MaskPlace = Literal["observation", "info"]
ActionForm = Literal["pair", "discrete"]
RenderMode = Literal["human", "rgb_array"] | None
METADATA: dict[str, Any] = {"render_modes": ["human", "rgb_array"], "render_fps": 5, "is_parallelizable": True}
_MOST = 4096  # actions of a discrete space
_SIZE = 480, 480  # of pictures, pixels


class MovesAndDeeds(spaces.MultiDiscrete):
    """The space of pairs of a move and a deed; sample masks are concatenated, as in observations."""

    def sample(self, mask: Any = None, probability: Any = None) -> Any:
        """Return a pair of a move and a deed; see `gymnasium.spaces.MultiDiscrete`."""
        parts = (np.split(one, [self.nvec[0]]) if isinstance(one, np.ndarray) else one for one in (mask, probability))
        return super().sample(*(tuple(one) if isinstance(one, list) else one for one in parts))


class EnvInterface:
    """Maps between learners and the spaces of Gymnasium.

    Args:
        learners: learners in one game or in many.
        mask: "observation": observations are dicts of the numbers and the mask; "info": observations are numbers alone,
            and the mask is in the infos.
        actions: "pair": a move and a deed are two numbers; "discrete": they are a single number, see `heads`.

    Attributes:
        learners: see above.
        has_masks: whether observations have masks.

    Raises:
        BadValue: an option has another value; or discrete actions would have more than 4,096 values, or all agents
            fly, which have no discrete actions.
    """

    def __init__(self, learners: Learners, mask: MaskPlace = "observation", actions: ActionForm = "pair") -> None:
        self.learners = learners
        self.has_masks = as_choice(mask, "mask", get_args(MaskPlace)) == "observation"
        self._are_flat = as_choice(actions, "actions", get_args(ActionForm)) == "discrete"
        if not self._are_flat:
            return
        if learners.all_fly:
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

    def make_action_space(self, agent: int = 0) -> spaces.Discrete | spaces.Box | MovesAndDeeds:
        """Return the action space of an agent, by its number; see `heads`."""
        learners = self.learners
        has_deeds = self.learners.deeds is not None
        if learners.flies[agent]:
            return spaces.Box(-1.0, 1.0, (heads.AXES + has_deeds * self._choices,), np.float32)
        if has_deeds and not self._are_flat:
            return MovesAndDeeds([learners.num_actions, self._choices])
        return spaces.Discrete(learners.num_actions * self._choices)

    def make_observation_space(self, agent: int = 0) -> spaces.Dict | spaces.Box:
        """Return the observation space of an agent, by its number: see `mask` above."""
        values = np.asarray(self.learners.observe())
        shape = values.shape[2:]
        kind = values.dtype
        if kind.kind == "f":
            box = spaces.Box(*self.learners.bounds, shape, kind.type)
        else:
            limits = (0, 1) if kind.kind == "b" else (np.iinfo(kind).min, np.iinfo(kind).max)
            box = spaces.Box(*limits, shape, np.int8 if kind.kind == "b" else kind.type)
        if not self.has_masks:
            return box
        if self.learners.flies[agent]:
            return spaces.Dict({"observation": box})
        return spaces.Dict(
            {"observation": box, "action_mask": spaces.Box(0, 1, self.compute_masks().shape[2:], np.int8)}
        )

    def collect_columns(self, which: IntArray | None = None) -> Columns:
        """Return all agents' observations, and their masks unless all fly; arrays are (games, agents, …).

        Args:
            which: the numbers of games; None: all.
        """
        values = np.asarray(self.learners.observe(which))
        found = {"observation": values.astype(np.int8) if values.dtype == np.bool_ else values}
        if self.learners.all_fly:
            return found
        masks = self.compute_masks()
        return found | {"action_mask": (masks if which is None else masks[which]).astype(np.int8)}

    def get_ended_columns(self) -> Columns:
        """Return what `columns` returned for the games `learners.begun` before they began again."""
        values, masks = self.learners.observe_ended()
        return {"observation": values, "action_mask": masks.astype(np.int8)}

    def convert(self, columns: Columns) -> Any:
        """Return observations in the form of the environment, from columns of any shape."""
        return columns if self.has_masks else columns["observation"]

    def compute_masks(self) -> BoolArray:
        """Return a mask of legal actions, (games, agents, actions).

        Raises:
            BadValue: all agents fly.
        """
        return heads.compute_action_masks(self.learners, are_flat=self._are_flat)

    def decode_heads(self, given: Sequence[tuple[IntArray, Any]]) -> heads.ActionHeads:
        """Return the decoded heads of actions; see `heads.make_heads`."""
        return heads.make_heads(self.learners, given, are_flat=self._are_flat)

    def as_actions(self, games: int, agents: IntArray, actions: object) -> np.ndarray[Any, Any]:
        """Return actions as an array (games, agents, …); see `heads.as_actions`."""
        return heads.as_actions(self.learners, games, agents, actions, are_flat=self._are_flat)


def make_mask_infos(columns: Columns) -> dict[str, Any]:
    """Return the infos of an environment: the action mask, if the columns contain one; flying agents have no mask."""
    return {key: value for key, value in columns.items() if key == "action_mask"}


def make_metadata(name: str) -> dict[str, Any]:
    """Return the metadata of an environment; without a display, "human" is not among the render modes."""
    modes = [mode for mode in METADATA["render_modes"] if mode != "human" or may_open()]
    return {**METADATA, "render_modes": modes, "name": name or "gamms"}


def choose_engine(mode: object) -> Engine | None:
    """Return the visual engine for a render mode.

    Raises:
        BadValue: the mode does not exist.
    """
    if mode not in (None, *METADATA["render_modes"]):
        raise BadValue(f"render_mode must be None, 'human' or 'rgb_array', not {shown(mode)}.")
    return Engine.PYGAME if mode == "human" else None


def prepare(learners: Learners, mode: RenderMode) -> None:
    """Set how long a window shows each turn: one frame of `METADATA["render_fps"]`."""
    if mode == "human":
        learners.games.context(0).visual.turn_seconds = 1.0 / METADATA["render_fps"]


def render_first_game(learners: Learners, mode: str | None) -> np.ndarray[Any, np.dtype[np.uint8]] | None:
    """Return a picture of the first game, (height, width, 3), or show it in its window."""
    if mode is None:
        learners.games.game.ctx.logger.warning(
            "render() shows nothing: make the environment with render_mode='rgb_array' or 'human'."
        )
        return None
    visual = learners.games.context(0).visual
    if mode == "human":
        visual.update()
        return None
    pixels: np.ndarray[Any, np.dtype[np.uint8]] = visual.frame(*_SIZE)
    return pixels


class EnvRecipe(NamedTuple):
    """The call that made an environment: `make(scenario, **options)`."""

    make: Callable[..., Any]
    scenario: Scenario
    options: dict[str, Any]


class CopyableEnv:
    """Copying and pickling of environments, see `remake`, and the change of their opponents.

    Attributes:
        recipe: the call that made the environment.
    """

    recipe: EnvRecipe
    learners: Any
    _own: tuple[str, ...] = ()  # names of attributes that copies keep unchanged

    def __reduce__(self) -> tuple[Any, ...]:
        return remake, (self.recipe, {name: getattr(self, name) for name in self._own}, self._get_checkpoint())

    def set_others(self, others: Mapping[str, Any] | None) -> None:
        """Replace the strategies of other agents and teams: in each game from its next start on.

        A game that is under way goes on with the strategies that it began with. See `Learners.set_others`.

        Args:
            others: strategies by team or agent, as in `gamms.rl.parallel_env`, in place of all earlier ones; None: all
                others play those of the scenario.

        Raises:
            UnknownName, BadType, BadValue: see `gamms.rl.parallel_env`; then nothing changes.
        """
        self.learners.set_others(others)

    def _get_checkpoint(self) -> Any:
        """Return a checkpoint of the games."""
        return self.learners.carried()

    def _restore(self, carried: Any) -> None:
        """Replay the games up to a checkpoint."""
        self.learners.restore(carried)


def remake(recipe: EnvRecipe, own: dict[str, Any], carried: object) -> Any:
    """Return a copy of an environment, with its games replayed to the same turns."""
    env = recipe.make(recipe.scenario, **recipe.options)
    try:
        env._restore(carried)
    except BaseException:
        env.close()
        raise
    for name, value in own.items():
        setattr(env, name, value)
    return env
