"""The strategy of one agent that learns while the other agents of its team play strategies of their own."""

from typing import Any, cast

import numpy as np

from gamms.game.batch import ArrayView, Batch
from gamms.game.batch.given import flown
from gamms.ir.graph import FloatArray, IntArray
from gamms.rl.deeds import DeedChoices


class Hand:
    """The strategy of one agent: in each turn of each game it does what it was given for that turn."""

    def __init__(self) -> None:
        self._games: Batch | None = None
        self._choices: DeedChoices | None = None
        self._taken = np.zeros((0, 0, 5))  # (turns, games, 5)  moves, deeds, and flights

    def begin(self, games: Batch, choices: DeedChoices | None) -> None:
        """Play in the games of a batch."""
        self._games, self._choices, self._taken = games, choices, np.zeros((16, len(games), 5))

    def take(self, turns: IntArray, moves: IntArray, deeds: IntArray | None, flights: FloatArray | None) -> None:
        """Take what is to be done in these turns of the games, (games,), as arrays (games, 1)."""
        while turns.max() >= len(self._taken):
            self._taken = np.concatenate((self._taken, np.zeros_like(self._taken)))
        done = moves * 0 if deeds is None else deeds
        flown = np.zeros((len(moves), 3)) if flights is None else flights[:, 0]
        self._taken[turns, np.arange(len(turns))] = np.column_stack((moves, done, flown))

    def __call__(self, state: dict[str, Any]) -> None:
        """Do what it is given for this turn of the game that is played."""
        legal, games = state["legal"], cast("Batch", self._games)
        move, deed, *flight = self._taken[state["turn"], games.loaded].tolist()
        agent = games.game.ctx.agent.agents[state["name"]]
        here = agent.current_node_id
        done = {} if self._choices is None else self._choices.plain(int(deed), legal or (here,), here)
        if "quat" in state:
            state["action"] = flown(flight, agent.speed, done)
            return
        node = legal[int(move) if move < len(legal) else 0]
        state["action"] = {"node_id": node, "do": done} if done else node

    def array_form(self, view: ArrayView) -> IntArray:
        """Return what it is given for each game."""
        moves, deeds = np.moveaxis(self._taken[view.turn, view.games, None, :2].astype(np.int64), -1, 0)
        if self._choices is not None:
            self._choices.do(deeds, view)
        return np.where(moves < view.counts, moves, 0)

    array_form.is_blind = True  # type: ignore[attr-defined] # it does not ask what sensors show
