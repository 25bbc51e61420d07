"""A game of two teams as an OpenSpiel game, from the same states and turns as its values.

Teams that move simultaneously give a simultaneous game; an order of play gives a sequential one.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pyspiel

from gamms.errors import BadValue
from gamms.ir.graph import FloatArray
from gamms.solve.information import open_observer
from gamms.solve.stages import Rewards
from gamms.solve.table import Table

_MOST_ENTRIES = 1 << 20  # of a tensor


class _SharedModel:
    """The data shared by all states of a game.

    Attributes:
        table, rewards: the states and the rewards of the game.
        first: the player that moves first in each turn; None: both move simultaneously.
        observed: (states, players) the number of a team's observation at the beginning of a turn.
    """

    def __init__(self, table: Table, rewards: Rewards) -> None:
        self.table = table
        self.rewards = rewards
        self.turns: int = table.last_turn or 0
        self.players = len(table.setup.teams)
        self.first = None if table.order == 0 else int(table.order > 0)
        self.num_actions = int(table.sizes.max())
        self.observed = np.zeros((len(table), self.players), np.int64)
        self._within: list[list[int]] = []  # state, first player's action -> the second player's observation
        numbers: list[dict[tuple[str, ...], int]] = [{} for _ in range(self.players)]

        def number(player: int, seen: Sequence[str]) -> int:
            own = tuple(seen[agent] for agent in table.list_members(player).tolist())
            return numbers[player].setdefault(own, len(numbers[player]))

        with open_observer(table) as observer:
            if self.first is not None and observer.may_stop_moves:
                raise BadValue(
                    "If conflicts or rules can stop moves, the observation of the team that moves second is undefined: "
                    "remove conflicts and rules of the phase 'deeds', or the order of play."
                )
            for state in range(len(table)):
                seen = observer.observe(state)
                self.observed[state] = [number(player, seen) for player in range(self.players)]
                if (first := self.first) is not None:
                    moves = [table.name_actions(state, first, one) for one in range(table.sizes[state, first])]
                    self._within.append([number(1 - first, observer.observe(state, moved)) for moved in moves])
        self.num_observations = max(map(len, numbers))

    def find_observation(self, state: int, action: int) -> int:
        """Return the number of the second player's observation after the first has moved."""
        return self._within[state][action]

    def __deepcopy__(self, _: dict[int, Any]) -> "_SharedModel":
        """Return the model itself, because OpenSpiel copies states."""
        return self

    def compute_reward(self, row: int, turn: int) -> float:
        """Return the first team's reward in a turn, discounted from the start."""
        last = self.rewards.last if turn == self.turns - 1 else None
        rewards = self.rewards.usual if last is None else last
        return float(rewards[row]) * self.rewards.discount**turn


class TeamsGame(pyspiel.Game):  # type: ignore[misc] # OpenSpiel has no types
    """A game of two players, each a team that knows the joint observations of its agents.

    Args:
        table: all states, with a last turn.
        rewards: the rewards of the first team, which the second pays.
    """

    def __init__(self, table: Table, rewards: Rewards) -> None:
        if table.last_turn is None:
            raise BadValue("A game of OpenSpiel needs a last turn: give turns=, or the scenario max_turns.")
        model = _SharedModel(table, rewards)
        self.model = model
        most = sum(float(abs(one).max()) for one in (rewards.usual, rewards.last) if one is not None) * model.turns
        has_tensor = model.turns * (model.num_observations + model.num_actions) <= _MOST_ENTRIES
        kind = pyspiel.GameType(
            short_name="python_gamms",
            long_name="A GAMMS scenario",
            dynamics=getattr(pyspiel.GameType.Dynamics, "SIMULTANEOUS" if model.first is None else "SEQUENTIAL"),
            chance_mode=pyspiel.GameType.ChanceMode.DETERMINISTIC,
            information=pyspiel.GameType.Information.IMPERFECT_INFORMATION,
            utility=pyspiel.GameType.Utility.ZERO_SUM,
            reward_model=pyspiel.GameType.RewardModel.REWARDS,
            max_num_players=model.players,
            min_num_players=model.players,
            provides_information_state_string=True,
            provides_information_state_tensor=has_tensor,
            provides_observation_string=True,
            provides_observation_tensor=has_tensor,
            parameter_specification={},
        )
        info = pyspiel.GameInfo(
            num_distinct_actions=model.num_actions,
            max_chance_outcomes=0,
            num_players=model.players,
            min_utility=-most,
            max_utility=most,
            utility_sum=0.0,
            max_game_length=model.turns * (1 if model.first is None else 2),
        )
        super().__init__(kind, info, {})

    def new_initial_state(self) -> "TeamsState":
        """Return the start."""
        return TeamsState(self, self.model)

    def make_py_observer(self, iig_obs_type: Any = None, params: Any = None) -> "_KnowledgeEncoder":  # noqa: ARG002 - of OpenSpiel
        """Return an observer of the players' knowledge."""
        return _KnowledgeEncoder(self.model, recalls=iig_obs_type is not None and iig_obs_type.perfect_recall)


class TeamsState(pyspiel.State):  # type: ignore[misc] # OpenSpiel has no types
    """A moment of a game: the number of its state in the table, and the players' histories."""

    def __init__(self, game: TeamsGame, model: _SharedModel) -> None:
        super().__init__(game)
        self.model = model
        self.number = 0
        self.turn = 0
        self.seen = [[int(one)] for one in model.observed[0]]  # by player
        self.done: list[list[int]] = [[] for _ in range(model.players)]  # by player
        self._moved: int | None = None  # the first player's action in this turn, if the second moves after it
        self._last = 0.0
        self._sum = 0.0

    def current_player(self) -> Any:
        """Return the player to move."""
        if self.is_terminal():
            return pyspiel.PlayerId.TERMINAL
        first = self.model.first
        if first is None:
            return pyspiel.PlayerId.SIMULTANEOUS
        return first if self._moved is None else 1 - first

    def is_terminal(self) -> bool:
        """Return whether the game is over."""
        offsets = self.model.table.offsets
        return self.turn >= self.model.turns or bool(offsets[self.number] == offsets[self.number + 1])

    def _legal_actions(self, player: int) -> list[int]:
        return list(range(int(self.model.table.sizes[self.number, player])))

    def _apply_action(self, action: int) -> None:
        player = self.current_player()
        first = self.model.first or 0
        if player == first:
            self._moved = action
            self._last = 0.0
            self.done[first].append(action)
            self.seen[1 - first].append(self.model.find_observation(self.number, action))
            return
        self.done[player].append(action)
        actions = [action, action]
        actions[first] = self._moved or 0
        self._moved = None
        self._play(actions)
        self.seen[first].append(int(self.model.observed[self.number, first]))

    def _apply_actions(self, actions: list[int]) -> None:
        self._play(actions)
        for player, action in enumerate(actions):
            self.done[player].append(int(action))
            self.seen[player].append(int(self.model.observed[self.number, player]))

    def _play(self, actions: list[int]) -> None:
        """Play a turn with these actions of the players."""
        table = self.model.table
        row = table.find_row(self.number, actions)
        self._last = self.model.compute_reward(row, self.turn)
        self._sum += self._last
        self.number = int(table.usual.after[row])
        self.turn = self.turn + 1

    def _action_to_string(self, player: int, action: int) -> str:
        nodes = self.model.table.name_actions(self.number, player, action)
        return ", ".join(f"{name} to {node}" for name, node in sorted(nodes.items()))

    def rewards(self) -> list[float]:
        """Return the rewards of the players in the last turn."""
        return [self._last, -self._last]

    def returns(self) -> list[float]:
        """Return the rewards of the players so far."""
        return [self._sum, -self._sum]

    def __str__(self) -> str:
        table = self.model.table
        where = zip(table.roster.names, table.nodes[self.number], table.alive[self.number], strict=True)
        places = ", ".join(f"{name} {'on ' + str(node) if is_alive else 'out'}" for name, node, is_alive in where)
        return f"turn {self.turn}: {places}"


class _KnowledgeEncoder:
    """Encodes the knowledge of a player: the current observations, or all observations and actions."""

    def __init__(self, model: _SharedModel, *, recalls: bool) -> None:
        self._model = model
        self._recalls = recalls
        turns = model.turns + 1 if recalls else 1
        self._seen: FloatArray = np.zeros((turns, model.num_observations))
        self._done = np.zeros((model.turns if recalls else 0, model.num_actions))
        size = self._seen.size + self._done.size + 1
        self.tensor = np.zeros(size if size <= 2 * _MOST_ENTRIES else 0, np.float32)
        self.dict = {"observation": self.tensor}

    def set_from(self, state: TeamsState, player: int) -> None:
        """Write a player's knowledge into the tensor: one entry for each observation and action of a turn."""
        if not len(self.tensor):
            return
        self._seen[:] = 0.0
        self._done[:] = 0.0
        seen = state.seen[player] if self._recalls else state.seen[player][-1:]
        self._seen[np.arange(len(seen)), seen] = 1.0
        if self._recalls:
            self._done[np.arange(len(state.done[player])), state.done[player]] = 1.0
        self.tensor[:-1] = np.concatenate((self._seen.ravel(), self._done.ravel()))
        self.tensor[-1] = state.turn / self._model.turns

    def string_from(self, state: TeamsState, player: int) -> str:
        """Return a player's knowledge as a text."""
        seen = state.seen[player]
        if not self._recalls:
            return f"turn {state.turn}, sees {seen[-1]}"
        steps = [f"{one} {did}" for one, did in zip(seen, state.done[player], strict=False)]
        return f"player {player}: {', '.join([*steps, str(seen[-1])])}"
