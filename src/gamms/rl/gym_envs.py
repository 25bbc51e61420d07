"""The environments of Gymnasium: one agent that learns, and many games at once."""

from collections.abc import Callable
from functools import partial
from typing import Any

import gymnasium
import numpy as np
from gymnasium.envs.registration import EnvSpec
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from gamms.rl.heads import action_masks, are_legal, heads_of, refuse_mixed
from gamms.rl.learners import ActionArray, Learners
from gamms.rl.rendering import METADATA, RenderMode, prepare, rendered
from gamms.rl.spaces import action_space, observation_space, observed
from gamms.scenario import Scenario

Infos = dict[str, Any]
Observed = dict[str, Any]  # `observation` and `action_mask`


class AgentEnv(gymnasium.Env[Observed, Any]):
    """One agent that learns in one game; made by `gamms.rl.single_agent_env`.

    Args:
        learners: in one game, in a context; only the first agent of them is asked.
        name: of the scenario.
        render_mode: "human", "rgb_array" or None.
    """

    metadata = METADATA

    def __init__(self, learners: Learners, name: str, render_mode: RenderMode) -> None:
        self.metadata = {**METADATA, "name": name or "gamms"}
        self.learners, self.render_mode = learners, render_mode
        prepare(learners, render_mode)
        self.observation_space = observation_space(learners)
        self.action_space = action_space(learners)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Observed, Infos]:
        """Begin a game; without a seed, that of the next one."""
        super().reset(seed=seed, options=options)
        self.learners.begin_next(seed)
        found = self._observed()
        return found, _mask_in(found)

    def step(self, action: Any) -> tuple[Observed, float, bool, bool, Infos]:
        """Play a turn; an action that is not legal stays, and `info["is_legal"]` is False then."""
        heads = heads_of(self.learners, [(np.array([0]), action)])
        was_legal = bool(are_legal(self.learners, heads)[0, 0])
        played = self.learners.step(*heads)
        found = self._observed()
        infos = {**_mask_in(found), "is_legal": was_legal}
        is_out, is_late = bool(played.terminated[0, 0]), bool(played.truncated[0, 0])
        return found, float(played.rewards[0, 0]), is_out, is_late and not is_out, infos

    def action_masks(self) -> np.ndarray[Any, np.dtype[np.bool_]]:
        """Return which actions are legal, (actions,); `sb3_contrib.MaskablePPO` asks for it."""
        masks: np.ndarray[Any, np.dtype[np.bool_]] = action_masks(self.learners)[0, 0]
        return masks

    def render(self) -> Any:
        """Return a picture, (height, width, 3), or show it in the window; nothing without a render mode."""
        return rendered(self.learners, self.render_mode)

    def close(self) -> None:
        """End the game."""
        self.learners.close()

    def _observed(self) -> Observed:
        return {key: column[0, 0] for key, column in observed(self.learners).items()}


class GamesEnv(VectorEnv[Observed, ActionArray, Any]):
    """Many games at once, with a slot for each game and learning agent; made by `gamms.rl.vector_env`.

    Slot `game * agents + agent`. The slots of a game begin together, in the step in which the game before has ended:
    what was observed last is in `infos["final_obs"]`. A slot is `terminated` when its agent goes out, and not again
    when its game ends: its next episode begins with waiting for the next game. While it waits its reward is 0, it only
    stays, and `infos["valid"]` is False.

    Args:
        learners: in the games.
        name: of the scenario.
        num_games: how many games; None: those of the learners.

    Attributes:
        learners: see above.
        num_games: how many games.
        num_agents: how many agents learn in each.
    """

    def __init__(self, learners: Learners, name: str, num_games: int | None = None) -> None:
        self.metadata = {"render_modes": [], "autoreset_mode": AutoresetMode.SAME_STEP, "name": name or "gamms"}
        self.learners, self.num_agents = learners, len(learners.names)
        self.num_games = len(learners.games) if num_games is None else num_games
        self.num_envs = self.num_games * self.num_agents
        refuse_mixed(learners, range(self.num_agents), "vector_env")
        self.single_observation_space = observation_space(learners)
        self.single_action_space = action_space(learners)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)

    def reset(self, *, seed: Any = None, options: dict[str, Any] | None = None) -> tuple[Observed, Infos]:  # noqa: ARG002 - Gymnasium's signature
        """Begin all games: game i with the seed `seed + i`, and at each further time with one larger by `num_games`.

        Without a seed all begin their next games.
        """
        self.learners.begin_all(seed)
        return self._flat(observed(self.learners)), self._infos()

    def step(self, actions: ActionArray) -> tuple[Observed, Any, Any, Any, Infos]:
        """Play a turn of all games, and begin those again that have ended.

        Args:
            actions: (slots,) numbers of legal nodes, or with deeds (slots, 2); one that is not legal stays. Of agents
                that fly, (slots, 3) and more: see `heads`.
        """
        was_alive = self.learners.alive
        played = self.learners.step(*heads_of(self.learners, [(np.arange(self.num_agents), actions)]))
        has_ended = self.learners.is_over
        found, infos = observed(self.learners), {}
        ends = played.terminated | played.truncated
        if ends.any():
            infos = {"final_obs": self._flat(found), "_final_obs": ends.ravel()}
        if has_ended.any():
            ended = np.flatnonzero(has_ended)
            self.learners.begin_again(ended)
            found = {key: column.copy() for key, column in found.items()}
            for key, column in observed(self.learners, ended).items():
                found[key][ended] = column
        infos |= {**self._infos(), "valid": was_alive.ravel()}
        ends = played.terminated.ravel(), played.truncated.ravel()
        return self._flat(found), played.rewards.ravel(), *ends, infos

    def action_masks(self) -> np.ndarray[Any, np.dtype[np.bool_]]:
        """Return which actions are legal, (slots, actions)."""
        return action_masks(self.learners).reshape(self.num_envs, -1)

    def close_extras(self, **_: object) -> None:
        """End the games."""
        self.learners.close()

    def _infos(self) -> Infos:
        masks = {} if self.learners.flies.all() else {"action_mask": self.action_masks()}
        return {**masks, "valid": self.learners.alive.ravel()}

    def _flat(self, found: Observed) -> Observed:
        return {key: column.reshape(self.num_envs, *column.shape[2:]) for key, column in found.items()}


def _mask_in(found: Observed) -> Infos:
    """Return the mask of what was observed; of an agent that flies there is none."""
    return {key: value for key, value in found.items() if key == "action_mask"}


def spec_of(make: Callable[..., Any], scenario: Scenario, options: dict[str, Any]) -> EnvSpec:
    """Return how an environment was made, so that Gymnasium can make it again with another render mode."""
    name = "".join(word for word in scenario.spec.name.title() if word.isalnum()) or "Game"
    return EnvSpec(f"gamms/{name}-v0", entry_point=partial(make, scenario), kwargs=options)
