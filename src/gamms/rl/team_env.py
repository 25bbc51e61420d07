"""The environment of PettingZoo: the agents of one or several teams that learn in one game."""

from copy import deepcopy
from itertools import compress
from typing import Any

import numpy as np
from gymnasium import spaces
from pettingzoo import ParallelEnv

from gamms.arguments import as_mapping
from gamms.errors import UnknownName
from gamms.rl.heads import are_legal
from gamms.rl.interface import (
    CopyableEnv,
    EnvInterface,
    RenderMode,
    make_mask_infos,
    make_metadata,
    prepare,
    render_first_game,
)
from gamms.rl.learners import Float32Array, Seeds

Observed = dict[str, Any]  # agent -> `observation` and `action_mask`, or the observation alone


class TeamEnv(CopyableEnv, ParallelEnv[str, dict[str, Any], Any]):  # type: ignore[misc] # PettingZoo has no types
    """The agents of some teams in one game; made by `gamms.rl.parallel_env`.

    Dead agents leave `agents`. If a rule brings agents back, they stay there and wait, without reward and with staying
    as their only legal action, because agents of PettingZoo cannot return. Agents for which `most_agents` reserves
    names join when they are created.

    Args:
        interface: the interface of learners in one game, in a context.
        name: the name of the scenario.
        render_mode: "human", "rgb_array" or None.

    Attributes:
        np_random: random numbers for wrappers, which `reset` seeds; games do not use them.
    """

    _own = "agents", "observation_spaces", "action_spaces", "np_random"

    def __init__(self, interface: EnvInterface, name: str, render_mode: RenderMode) -> None:
        self.metadata = make_metadata(name)
        self._interface = interface
        self.render_mode = render_mode
        learners = interface.learners
        self.learners = learners
        prepare(learners, render_mode)
        self.possible_agents = list(learners.names)
        self.agents: list[str] = []
        self.np_random = np.random.default_rng()
        self._number = {agent: number for number, agent in enumerate(self.possible_agents)}
        kinds = {
            flies: interface.make_observation_space(number) for number, flies in enumerate(learners.flies.tolist())
        }
        of_agents = list(zip(self.possible_agents, learners.flies.tolist(), strict=True))
        self.observation_spaces = {
            agent: deepcopy(kinds[flies]) for agent, flies in of_agents
        }  # each samples independently
        self.action_spaces = {agent: interface.make_action_space(self._number[agent]) for agent in self.possible_agents}
        self._parts = [np.flatnonzero(learners.flies == flies) for flies in (False, True)]
        self._idle = {agent: 0 * space.sample() for agent, space in self.action_spaces.items()}
        self.state_space = spaces.Box(-np.inf, np.inf, self.state().shape, np.float32)

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """Return the observation space of an agent."""
        return self.observation_spaces[self._check_agent(agent)]

    def action_space(self, agent: str) -> spaces.Space[Any]:
        """Return the action space of an agent: the index of a legal node, 0 to stay, and optionally a deed."""
        return self.action_spaces[self._check_agent(agent)]

    def reset(self, seed: Seeds = None, options: dict[str, Any] | None = None) -> tuple[Observed, Observed]:  # noqa: ARG002 - PettingZoo's signature
        """Reset the game.

        Args:
            seed: the seed of a run, whose first game begins; or a list with the seed of the game itself, as in
                `Scenario.play`; None: the next game of the run.
            options: ignored.

        Returns:
            The observations and the infos by agent.
        """
        self.learners.begin_all(seed)
        if seed is not None:
            self.np_random = np.random.default_rng(abs(self.learners.games.seeds[0]))  # NumPy has no negative seeds
        self.agents = self._list_agents_in_game()
        return self._make_answers(self.agents)

    def step(
        self, actions: dict[str, Any]
    ) -> tuple[Observed, dict[str, float], dict[str, bool], dict[str, bool], Observed]:
        """Play a turn.

        Args:
            actions: agent -> action; an agent without an action, or with an illegal one, stays.

        Returns:
            Observations, rewards, terminations, truncations and infos by agent; `infos[agent]["is_legal"]` tells
            whether its action was legal. It is False for a living agent without an action.
        """
        for name in as_mapping(actions, "actions"):
            self._check_agent(name)
        given = [actions.get(name, self._idle[name]) for name in self.possible_agents]
        heads = self._interface.decode_heads([(agents, [given[number] for number in agents]) for agents in self._parts])
        is_legal = are_legal(self.learners, heads)[0].tolist()
        alive = self.learners.alive[0].tolist()
        was_legal = {
            name: legal and (name in actions or not lives)
            for name, legal, lives in zip(self.possible_agents, is_legal, alive, strict=True)
        }
        played = self.learners.step(*heads)
        is_over = bool(self.learners.is_over[0])
        come = [] if is_over else [name for name in self._list_agents_in_game() if name not in self.agents]
        asked = self.agents + come
        observations, infos = self._make_answers(asked)
        for name in asked:
            infos[name]["is_legal"] = was_legal[name]
        rewards = {name: float(played.rewards[0, self._number[name]]) for name in asked}
        terminated = {name: bool(played.terminated[0, self._number[name]]) for name in asked}
        truncated = {name: bool(played.truncated[0, self._number[name]]) for name in asked}
        self.agents = [] if is_over else self._list_agents_in_game()
        return observations, rewards, terminated, truncated, infos

    def action_masks(self) -> dict[str, Any]:
        """Return the masks of legal actions: agent on the ground -> (actions,) booleans."""
        if self.learners.all_fly:
            return {}
        masks = zip(self.possible_agents, self._interface.compute_masks()[0], self.learners.flies, strict=True)
        return {name: mask for name, mask, flies in masks if not flies}

    def state(self) -> Float32Array:
        """Return the state of the game as numbers: for each agent of all teams `alive`, and `x`, `y` as map shares.

        See `Learners.whole`.
        """
        whole: Float32Array = self.learners.whole()[0]
        return whole

    def render(self) -> np.ndarray[Any, np.dtype[np.uint8]] | None:
        """Return a picture, (height, width, 3), or show it in the window; do nothing without a render mode."""
        return render_first_game(self.learners, self.render_mode)

    def close(self) -> None:
        """Close the game."""
        self.learners.close()

    def _check_agent(self, agent: str) -> str:
        if agent not in self._number:
            raise UnknownName("agent that learns", agent, self.possible_agents)
        return agent

    def _list_agents_in_game(self) -> list[str]:
        """Return the agents that are alive, or may return."""
        learners = self.learners
        are_in = learners.is_there[0] if learners.may_return else learners.alive[0]
        return list(compress(self.possible_agents, are_in.tolist()))

    def _make_answers(self, names: list[str]) -> tuple[Observed, Observed]:
        """Return the observations of these agents, and their infos."""
        columns = self._interface.collect_columns()
        values = {}
        infos = {}
        for name in names:
            number = self._number[name]
            found = {key: column[0, number] for key, column in columns.items()}
            if self.learners.flies[number]:
                found.pop("action_mask", None)
            values[name] = self._interface.convert(found)
            infos[name] = make_mask_infos(found) | {key: column[0] for key, column in self.learners.drawn.items()}
        return values, infos
