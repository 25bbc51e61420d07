"""Many games as a `VecEnv` of Stable-Baselines3."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from gymnasium import spaces
from sb3_contrib.common.maskable.buffers import MaskableDictRolloutBuffer, MaskableRolloutBuffer
from stable_baselines3 import PPO
from stable_baselines3.common.buffers import RolloutBuffer
from stable_baselines3.common.save_util import load_from_zip_file
from stable_baselines3.common.vec_env import VecEnv

from gamms.arguments import as_known
from gamms.errors import BadValue
from gamms.ir.obstacles import BoolArray
from gamms.rl.gym_envs import GamesEnv
from gamms.rl.learners import combine_runs

_METHODS = ("action_masks",)


def load_model(file: Path) -> Any:
    """Return a model saved by PPO, with or without masks; this runs the code in the file."""
    from sb3_contrib import MaskablePPO

    data, _, _ = load_from_zip_file(file, device="cpu")
    is_masked = "maskable" in str(getattr(data.get("policy_class"), "__module__", ""))
    return (MaskablePPO if is_masked else PPO).load(file, device="cpu")


class SlotValidity:
    """The slots that took part in the last turn, for the rollouts of a model; pickling empties it.

    Attributes:
        now: (slots,) None: no environment is attached.
    """

    def __init__(self) -> None:
        self.now: BoolArray | None = None

    def __reduce__(self) -> tuple[Any, ...]:
        return SlotValidity, ()


class _LivingRollouts(RolloutBuffer):  # type: ignore[misc] # Stable-Baselines3 is not always there to be checked
    """Rollouts without the turns of agents that were out of their games: the common part.

    Args:
        given: see `sb3_contrib.common.maskable.buffers`.
        validity: the validity of the environment's slots.
        more: see `given`.
    """

    buffer_size: int
    n_envs: int
    observations: Any

    def __init__(self, *given: object, validity: SlotValidity, **more: object) -> None:
        super().__init__(*given, **more)
        self._validity = validity
        self._shape = (self.buffer_size, self.n_envs)
        self._is_valid = np.ones(self._shape, np.bool_)

    def reset(self) -> None:
        """Empty the buffer, and restore its original size."""
        if hasattr(self, "_shape"):  # not during construction
            self.buffer_size, self.n_envs = self._shape
        super().reset()

    def add(self, *given: object, **more: object) -> None:
        """Add a turn of all slots."""
        if self._validity.now is None:
            raise BadValue(
                "A model that was loaded needs the rollouts of its environment: load(path, env, **env.rollouts)."
            )
        self._is_valid[self.pos] = self._validity.now
        super().add(*given, **more)

    def compute_returns_and_advantage(self, last_values: object, dones: object) -> None:
        """Compute returns and advantages, then drop the turns that do not count."""
        super().compute_returns_and_advantage(last_values, dones)
        rows = np.flatnonzero(self.swap_and_flatten(self._is_valid))
        for name in ("actions", "values", "log_probs", "advantages", "returns", "action_masks"):
            setattr(self, name, self.swap_and_flatten(getattr(self, name))[rows])
        if isinstance(self.observations, dict):
            self.observations = {key: self.swap_and_flatten(one)[rows] for key, one in self.observations.items()}
        else:
            self.observations = self.swap_and_flatten(self.observations)[rows]
        self.buffer_size = len(rows)
        self.n_envs = 1
        self.generator_ready = True


class LivingRollouts(_LivingRollouts, MaskableDictRolloutBuffer):  # type: ignore[misc] # as above
    """Dict rollouts without the turns of agents that were out of their games, which teach nothing."""


class LivingBoxRollouts(_LivingRollouts, MaskableRolloutBuffer):  # type: ignore[misc] # as above
    """Array rollouts without the turns of agents that were out of their games, which teach nothing."""


class SlotsEnv(VecEnv):  # type: ignore[misc] # Stable-Baselines3 is not always there to be checked
    """The slots of many games for Stable-Baselines3 and sb3-contrib; made by `gamms.rl.sb3_env`.

    `sb3_contrib.MaskablePPO` finds the masks of legal actions. The episode of a slot ends when its agent is out or its
    game is over; `info["episode"]` has the return and the length of its life, as the logs of models show them.

    Args:
        games: the environment of the games.
    """

    def __init__(self, games: GamesEnv) -> None:
        self._games = games
        self.learners = games.learners
        self._actions = np.zeros(games.num_envs, np.int64)
        self._seed: int | None = None
        self._validity = SlotValidity()
        self._began = perf_counter()
        is_dict = isinstance(games.single_observation_space, spaces.Dict)
        self.rollouts: dict[str, Any] = {
            "rollout_buffer_class": LivingRollouts if is_dict else LivingBoxRollouts,
            "rollout_buffer_kwargs": {"validity": self._validity},
        }
        if games.learners.any_fly:  # without masks there is no such buffer
            self.rollouts = {}
        super().__init__(games.num_envs, games.single_observation_space, games.single_action_space)

    def __reduce__(self) -> tuple[Any, ...]:
        return SlotsEnv, (self._games,), {"_seed": self._seed, "_actions": self._actions}

    def reset(self) -> Any:
        """Begin all games."""
        observed, _ = self._games.reset(seed=self._seed)
        self._seed = None
        return observed

    def seed(self, seed: int | None = None) -> Sequence[int | None]:
        """Set the run of the games for the next `reset`, see `combine_runs`; models call this with their `seed=`."""
        self._seed = None if seed is None else combine_runs(self._games.recipe.options["seed"], seed)
        return [self._seed] * self.num_envs

    def set_others(self, others: Mapping[str, Any] | None) -> None:
        """Replace the strategies of other agents and teams, in each game from its next start on; see `vector_env`.

        A callback calls `self.training_env.set_others({…})`, also through wrappers.
        """
        self._games.set_others(others)

    def step_async(self, actions: np.ndarray[Any, Any]) -> None:
        """Store the actions of the next turn."""
        self._actions = actions

    def step_wait(self) -> tuple[Any, Any, Any, list[dict[str, Any]]]:
        """Play the turn."""
        observed, rewards, terminated, truncated, infos = self._games.step(self._actions)
        ends = terminated | truncated
        self._validity.now = infos["valid"]
        of_slots: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for slot in np.flatnonzero(~infos["valid"]).tolist():
            of_slots[slot]["valid"] = False
        for slot in np.flatnonzero(ends).tolist():
            of_slots[slot]["terminal_observation"] = _select_slot(infos["final_obs"], slot)
            of_slots[slot] |= {key: infos["final_info"][key][slot] for key in self.learners.drawn}
            of_slots[slot]["TimeLimit.truncated"] = bool(truncated[slot] and not terminated[slot])
            life = {key: column[slot].item() for key, column in infos["life"].items()}
            of_slots[slot]["episode"] = {**life, "t": perf_counter() - self._began}
        return observed, rewards.astype(np.float32), ends, of_slots

    def get_images(self) -> Sequence[Any]:
        """Return a picture for each slot; see `vector_env`."""
        return self._games.render() or ()

    def close(self) -> None:
        """Close the games."""
        self._games.close()

    def env_method(self, method_name: str, *_: object, indices: Any = None, **__: object) -> list[Any]:
        """Return the result of a method for each slot; only `action_masks` is supported."""
        as_known(method_name, "method of the slots", _METHODS)
        masks = self._games.action_masks()
        return [masks[slot] for slot in self._get_indices(indices)]

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Return an attribute for each slot."""
        value = self.env_method if attr_name in _METHODS else getattr(self._games, attr_name)
        return [value for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: object, indices: Any = None) -> None:  # noqa: ARG002 - the signature of SB3
        """Set an attribute of all games."""
        setattr(self._games, attr_name, value)

    def env_is_wrapped(self, wrapper_class: object, indices: Any = None) -> list[bool]:  # noqa: ARG002 - the signature of SB3
        """Return False for each slot: none is wrapped."""
        return [False for _ in self._get_indices(indices)]


def _select_slot(observed: dict[str, Any] | np.ndarray[Any, Any], slot: int) -> Any:
    """Return the observation of a slot."""
    return {key: column[slot] for key, column in observed.items()} if isinstance(observed, dict) else observed[slot]
