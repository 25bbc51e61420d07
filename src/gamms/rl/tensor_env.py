"""The games of many as an `EnvBase` of TorchRL: tensordicts of games, with a group of agents for each team."""

from functools import partial
from typing import Any

import numpy as np
import torch
from tensordict import TensorDict, TensorDictBase
from torchrl.data import Binary, Bounded, Categorical, Composite, MultiCategorical, Unbounded
from torchrl.envs import EnvBase

from gamms.rl.heads import heads_of, refuse_mixed
from gamms.rl.learners import Learners
from gamms.rl.turns import Played

_ENDS = ("done", "terminated", "truncated")


class TensorEnv(EnvBase):  # type: ignore[misc] # TorchRL is not always there to be checked
    """Many games for TorchRL, of the batch size (games,); made by `gamms.rl.torchrl_env`.

    Each team is a group, with agents in the order of their names: `(team, "observation")`, (games, agents, …),
    `(team, "action_mask")`, which actions are legal, `(team, "mask")`, who takes part, `(team, "action")`,
    `(team, "reward")`, and `done`, `terminated` and `truncated` of agents; those of games are at the root. A game that
    has ended waits for its reset.

    Args:
        learners: in the games, in tensors.

    Attributes:
        learners: see above.
        group_map: team -> the names of its agents.
    """

    def __init__(self, learners: Learners) -> None:
        self.learners = learners
        games = len(learners.games)
        library = learners.games.library
        super().__init__(device=torch.device(str(library.device if library else "cpu")), batch_size=[games])
        names = learners.names_by_team()
        self.group_map = {str(team): list(names[team]) for team in learners.teams}
        shape = tuple(learners.observe().shape[2:])
        kind = learners.observe().dtype
        observed, acting, rewards, ends = {}, {}, {}, {}
        for team, members in self.group_map.items():
            size = games, len(members)
            box = (
                Bounded(*learners.bounds, shape=(*size, *shape), dtype=kind, device=self.device)
                if np.isfinite(learners.bounds).all() and kind.is_floating_point
                else Unbounded(shape=(*size, *shape), dtype=kind, device=self.device)
            )
            sizes = [learners.num_actions, *([] if learners.deeds is None else [len(learners.deeds)])]
            first = learners.names.index(members[0])
            refuse_mixed(learners, range(first, first + len(members)), f"the group {team!r} of torchrl_env")
            masks = {
                "action_mask": Binary(shape=(*size, sum(sizes)), dtype=torch.bool, device=self.device),
                "mask": Binary(shape=size, dtype=torch.bool, device=self.device),
            }
            if learners.flies[first]:
                del masks["action_mask"]
            observed[team] = Composite({"observation": box, **masks}, shape=size, device=self.device)
            kinds = {"dtype": torch.int64, "device": self.device}
            if learners.flies[first]:
                shape_of_flights = *size, 3 + sum(sizes[1:])
                action = Bounded(-1.0, 1.0, shape=shape_of_flights, dtype=torch.float32, device=self.device)
            elif learners.deeds is None:
                action = Categorical(learners.num_actions, shape=size, **kinds)
            else:
                action = MultiCategorical(sizes, shape=(*size, 2), **kinds)
            acting[team] = Composite({"action": action}, shape=size, device=self.device)
            reward = Unbounded(shape=(*size, 1), dtype=torch.float32, device=self.device)
            rewards[team] = Composite({"reward": reward}, shape=size, device=self.device)
            ends[team] = self._ends_spec(size)
        self.observation_spec = Composite(observed, shape=(games,), device=self.device)
        self.action_spec = Composite(acting, shape=(games,), device=self.device)
        self.reward_spec = Composite(rewards, shape=(games,), device=self.device)
        self.done_spec = Composite({**ends, **self._ends_spec((games,))}, shape=(games,), device=self.device)

    def _ends_spec(self, size: tuple[int, ...]) -> Any:
        kinds = {key: Binary(shape=(*size, 1), dtype=torch.bool, device=self.device) for key in _ENDS}
        return Composite(kinds, shape=size, device=self.device)

    def _reset(self, tensordict: TensorDictBase | None = None, **_: object) -> TensorDictBase:
        """Begin the games that `_reset` names; None: all."""
        which = None if tensordict is None else tensordict.get("_reset", None)
        if which is None:
            self.learners.begin_all()
        else:
            self.learners.begin_again(np.flatnonzero(which.reshape(-1).cpu().numpy()))
        return self._filled(None)

    def _step(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Play a turn of all games that are not over."""
        given = [tensordict.get((team, "action")) for team in self.group_map]
        learners, ends = self.learners, np.cumsum([len(members) for members in self.group_map.values()])
        if learners.flies.any():
            numbers = [np.arange(end - one.shape[1], end) for one, end in zip(given, ends, strict=True)]
            parts = zip(numbers, (one.cpu().numpy() for one in given), strict=True)
            moves, deeds, flights = heads_of(learners, [*parts])
            tensor: Any = partial(torch.as_tensor, device=self.device)
            return self._filled(learners.step(tensor(moves), None if deeds is None else tensor(deeds), flights))
        actions = torch.cat(given, dim=1)
        heads = (actions,) if self.learners.deeds is None else actions.unbind(dim=-1)
        return self._filled(self.learners.step(*heads))

    def _set_seed(self, seed: int | None) -> None:
        """Let game i have the seed `seed + i` at the next reset."""
        if seed is not None:
            self.learners.begin_from(seed)

    def close(self, *, raise_if_closed: bool = True) -> None:
        """End the games."""
        if not self.is_closed:
            self.learners.close()
        super().close(raise_if_closed=raise_if_closed)

    def _filled(self, played: Played | None) -> TensorDictBase:
        """Return what is observed, and what the last turn came to."""
        learners, games = self.learners, len(self.learners.games)
        alive, over = learners.alive, learners.is_over
        if played is None:
            root = {key: torch.zeros((games, 1), dtype=torch.bool, device=self.device) for key in _ENDS}
            ended = {key: torch.zeros_like(alive) for key in _ENDS}
        else:
            ends = (over, learners.games.terminated, learners.games.truncated)
            root = {key: one[:, None] for key, one in zip(_ENDS, ends, strict=True)}
            terminated, truncated = (
                one[:, None] | played_one for one, played_one in zip(ends[1:], played[1:], strict=True)
            )
            if not learners.may_return:
                terminated = terminated | (learners.is_there & ~alive)
            ended = {"done": terminated | truncated, "terminated": terminated, "truncated": truncated}
        masks = [learners.masks] + ([] if learners.deeds is None else [learners.deed_masks])
        columns = {
            "observation": learners.observe(),
            "action_mask": torch.cat(masks, dim=-1),
            "mask": alive & ~over[:, None],
        }
        columns |= {key: one[..., None] for key, one in ended.items()}
        if played is not None:
            columns["reward"] = torch.as_tensor(played.rewards, dtype=torch.float32)[..., None]
        groups, first = {}, 0
        for team, members in self.group_map.items():
            size = len(members)
            of_team = {key: one[:, first : first + size] for key, one in columns.items()}
            if learners.flies[first]:
                del of_team["action_mask"]
            groups[team] = TensorDict(of_team, batch_size=(games, size), device=self.device)
            first += size
        return TensorDict({**groups, **root}, batch_size=(games,), device=self.device)
