"""Many games as an `EnvBase` of TorchRL: tensordicts of games, with a group of agents for each team."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import torch
from tensordict import TensorDict, TensorDictBase
from torchrl.data import Binary, Bounded, Categorical, Composite, MultiCategorical, Unbounded
from torchrl.envs import EnvBase

from gamms.rl.heads import compute_action_masks, make_heads, refuse_mixed
from gamms.rl.learners import Learners
from gamms.rl.turns import TurnOutcome

_ENDS = ("done", "terminated", "truncated")


class TensorEnv(EnvBase):  # type: ignore[misc] # TorchRL is not always there to be checked
    """Many games for TorchRL, with the batch size (games,); made by `gamms.rl.torchrl_env`.

    Each team is a group, with its agents sorted by name: `(team, "observation")`, (games, agents, …),
    `(team, "action_mask")`, the legal actions, `(team, "mask")`, the agents that take part, `(team, "action")`,
    `(team, "reward")`, and `done`, `terminated` and `truncated` of agents; those of games are at the root. A finished
    game waits for its reset.

    On the CPU, the tensors of observations, masks and ends share the memory of the games' arrays.

    Args:
        learners: learners in the games.

    Attributes:
        learners: see above.
        group_map: team -> the names of its agents.
    """

    def __init__(self, learners: Learners) -> None:
        self.learners = learners
        games = len(learners.games)
        super().__init__(device=torch.device("cpu"), batch_size=[games])
        names = learners.names_by_team()
        self.group_map = {str(team): list(names[team]) for team in learners.teams}
        example = _convert_array(learners.observe())
        shape = example.shape[2:]
        kind = example.dtype
        observed = {}
        acting = {}
        rewards = {}
        ends = {}
        for team, members in self.group_map.items():
            size = games, len(members)
            box = (
                Bounded(*learners.bounds, shape=(*size, *shape), dtype=kind)
                if np.isfinite(learners.bounds).all() and kind.is_floating_point
                else Unbounded(shape=(*size, *shape), dtype=kind)
            )
            sizes = [learners.num_actions, *([] if learners.deeds is None else [len(learners.deeds)])]
            first = learners.names.index(members[0])
            refuse_mixed(learners, range(first, first + len(members)), f"the group {team!r} of torchrl_env")
            masks = {
                "action_mask": Binary(shape=(*size, sum(sizes)), dtype=torch.bool),
                "mask": Categorical(2, shape=size, dtype=torch.bool),  # not Binary, whose last axis cannot be indexed
            }
            if learners.flies[first]:
                del masks["action_mask"]
            observed[team] = Composite({"observation": box, **masks}, shape=size)
            if learners.flies[first]:
                shape_of_flights = *size, 3 + sum(sizes[1:])
                action = Bounded(-1.0, 1.0, shape=shape_of_flights, dtype=torch.float32)
            elif learners.deeds is None:
                action = Categorical(learners.num_actions, shape=size, dtype=torch.int64)
            else:
                action = MultiCategorical(sizes, shape=(*size, 2), dtype=torch.int64)
            acting[team] = Composite({"action": action}, shape=size)
            reward = Unbounded(shape=(*size, 1), dtype=torch.float32)
            rewards[team] = Composite({"reward": reward}, shape=size)
            ends[team] = self._make_ends_spec(size)
        self.observation_spec = Composite(observed, shape=(games,))
        self.action_spec = Composite(acting, shape=(games,))
        self.reward_spec = Composite(rewards, shape=(games,))
        self.done_spec = Composite({**ends, **self._make_ends_spec((games,))}, shape=(games,))

    def _make_ends_spec(self, size: tuple[int, ...]) -> Any:
        kinds = {key: Binary(shape=(*size, 1), dtype=torch.bool) for key in _ENDS}
        return Composite(kinds, shape=size)

    def _reset(self, tensordict: TensorDictBase | None = None, **_: object) -> TensorDictBase:
        """Reset the games that `_reset` names; None: all."""
        which = None if tensordict is None else tensordict.get("_reset", None)
        if which is None:
            self.learners.begin_all()
        else:
            self.learners.begin_again(np.flatnonzero(_convert_tensor(which)))
        return self._make_results(None)

    def _step(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Play a turn of all unfinished games."""
        given = [_convert_tensor(tensordict.get((team, "action"))) for team in self.group_map]
        ends = np.cumsum([one.shape[1] for one in given])
        parts = [(np.arange(end - one.shape[1], end), one) for one, end in zip(given, ends, strict=True)]
        return self._make_results(self.learners.step(*make_heads(self.learners, parts)))

    def set_others(self, others: Mapping[str, Any] | None) -> None:
        """Replace the strategies of other agents and teams, in each game from its next reset on; see `Learners`."""
        self.learners.set_others(others)

    def _set_seed(self, seed: int | None) -> None:
        """Set the run of the games for the next reset; see `Learners.begin_from`."""
        if seed is not None:
            self.learners.begin_from(seed)

    def close(self, **options: Any) -> None:
        """Close the games; takes the options of `EnvBase.close`, which early versions of TorchRL lack."""
        if not self.is_closed:
            self.learners.close()
        super().close(**options)

    def _make_results(self, played: TurnOutcome | None) -> TensorDictBase:
        """Return the observations, and the results of the last turn."""
        learners = self.learners
        games = len(self.learners.games)
        alive = learners.alive
        over = learners.is_over
        if played is None:
            root = {key: np.zeros((games, 1), np.bool_) for key in _ENDS}
            ended = {key: np.zeros_like(alive) for key in _ENDS}
        else:
            ends = (over.copy(), learners.games.terminated, learners.games.truncated)
            root = {key: one[:, None] for key, one in zip(_ENDS, ends, strict=True)}
            terminated = played.terminated | ends[1][:, None]
            truncated = played.truncated | ends[2][:, None]
            if not learners.may_return:
                terminated = terminated | (learners.is_there & ~alive)
            ended = {"done": terminated | truncated, "terminated": terminated, "truncated": truncated}
        columns = {"observation": learners.observe(), "mask": alive & ~over[:, None]}
        if not learners.all_fly:
            columns["action_mask"] = compute_action_masks(learners)
        columns |= {key: one[..., None] for key, one in ended.items()}
        if played is not None:
            columns["reward"] = played.rewards.astype(np.float32)[..., None]
        tensors = {key: _convert_array(column) for key, column in columns.items()}
        groups = {}
        first = 0
        for team, members in self.group_map.items():
            size = len(members)
            of_team = {key: one[:, first : first + size] for key, one in tensors.items()}
            if learners.flies[first]:
                of_team.pop("action_mask", None)
            groups[team] = TensorDict(of_team, batch_size=(games, size), device=self.device)
            first += size
        ends_of_games = {key: _convert_array(one) for key, one in root.items()}
        return TensorDict({**groups, **ends_of_games}, batch_size=(games,), device=self.device)


def _convert_tensor(tensor: torch.Tensor) -> np.ndarray[Any, Any]:
    """Return an array that shares the memory of a tensor; a tensor on a GPU is copied."""
    return np.from_dlpack(tensor.detach().cpu())


def _convert_array(array: np.ndarray[Any, Any]) -> torch.Tensor:
    """Return a tensor that shares the memory of an array; a read-only array is copied."""
    return torch.from_dlpack(array if array.flags.writeable else array.copy())
