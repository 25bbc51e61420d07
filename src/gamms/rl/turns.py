"""Turns of learners: what agents do in them, what rewards are made of, and what they came to."""

from collections.abc import Hashable
from functools import cached_property
from typing import Any, NamedTuple, cast

import numpy as np

from gamms.game.batch import ArrayView, Batch
from gamms.game.batch.forms import StrategySpec
from gamms.game.batch.given import flown
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.rl.deeds import DeedChoices

ObjectArray = np.ndarray[tuple[int, ...], np.dtype[np.object_]]
_LEAST, _MOST = -1, 4096  # numbers of actions that are not legal: there are at most 4,096, numbered from 0


class Outcomes:
    """How games have ended, read from them when it is first asked.

    Args:
        games: the batch that they are in.
    """

    def __init__(self, games: Batch) -> None:
        self._games = games

    @cached_property
    def winner(self) -> ObjectArray:
        """The winner of each game; None while a game goes on, or if no team has won."""
        found: ObjectArray = self._table["winner"]
        return found

    @cached_property
    def reason(self) -> ObjectArray:
        """Why each game has ended; None while it goes on."""
        found: ObjectArray = self._table["reason"]
        found[~self._games.is_over] = None
        return found

    @cached_property
    def _table(self) -> dict[str, Any]:
        return self._games.table()


class Turn(NamedTuple):
    """A turn that was played, for `reward=`.

    Attributes:
        team: whose reward it is.
        before: its agents before the turn; of this view only the attributes `node` and `mask`, (games, agents), and
            `turn`, (games,), are those of then.
        after: its agents now.
        gains: key -> (games,) by how much each score has changed.
        outcomes: how the games have ended; read `winner` and `reason` of the turn.
    """

    team: Hashable
    before: ArrayView
    after: ArrayView
    gains: dict[Any, FloatArray]
    outcomes: Outcomes

    @property
    def winner(self) -> ObjectArray:
        """The winner of each game, (games,) objects; None while a game goes on, or if no team has won."""
        return self.outcomes.winner

    @property
    def reason(self) -> ObjectArray:
        """Why each game has ended, (games,) objects, such as "time_limit"; None while it goes on."""
        return self.outcomes.reason


class Played(NamedTuple):
    """What a turn came to, each (games, agents).

    Attributes:
        rewards: of the agents; 0 of those that were dead before.
        terminated: who has gone out in this turn, or took part in a game that was ended by what happened in it. Of an
            agent that went out in an earlier turn it is not said again when its game ends.
        truncated: who took part in a game that ended because the time was up.
    """

    rewards: FloatArray
    terminated: BoolArray
    truncated: BoolArray


class Prefix:
    """The actions of games since they began.

    Args:
        shape: how many games and agents there are.
        heads: how many numbers an action has: a move, and perhaps a deed.
        flies: whether agents fly.

    Attributes:
        steps: (games,) how many actions were taken.
    """

    def __init__(self, shape: tuple[int, int], heads: int, *, flies: bool) -> None:
        self.steps: IntArray = np.zeros(shape[0], np.int64)
        self._heads = np.zeros((1, *shape, heads), np.int16)
        self._flights = np.zeros((1, *shape, 3)) if flies else None

    def begin(self, which: IntArray) -> None:
        """Forget the actions of games, by their numbers."""
        self.steps[which] = 0

    def add(self, games: BoolArray, heads: list[Any], flights: FloatArray | None) -> None:
        """Add what agents do in a turn of some games, each head (games, agents)."""
        if self.steps.max() >= len(self._heads):
            self._heads = np.concatenate((self._heads, np.zeros_like(self._heads)))
            if self._flights is not None:
                self._flights = np.concatenate((self._flights, np.zeros_like(self._flights)))
        at = self.steps[games], np.flatnonzero(games)
        for number, head in enumerate(heads):
            self._heads[(*at, slice(None), number)] = np.clip(head[games], _LEAST, _MOST)
        if self._flights is not None and flights is not None:
            self._flights[at] = flights[games]
        self.steps[games] += 1

    def cut(self) -> "Prefix":
        """Return a copy without the room for further turns."""
        copy = Prefix(self._heads.shape[1:3], self._heads.shape[3], flies=False)
        last = max(1, int(self.steps.max()))
        copy.steps, copy._heads = self.steps.copy(), self._heads[:last].copy()
        copy._flights = None if self._flights is None else self._flights[:last].copy()
        return copy

    def at(self, turns: IntArray) -> tuple[IntArray, IntArray | None, FloatArray | None]:
        """Return the moves, deeds and flights of these turns of the games, (games,); before the first turn all stay."""
        there = turns >= 0
        at = np.maximum(turns, 0), np.arange(len(turns))
        heads = np.where(there[:, None, None], self._heads[at], 0).astype(np.int64)
        flights = None if self._flights is None else np.where(there[:, None, None], self._flights[at], 0.0)
        return heads[..., 0], heads[..., 1] if heads.shape[2] > 1 else None, flights


class Hand:
    """The strategy of one agent: in each turn of each game it does what it was given for that turn."""

    def __init__(self) -> None:
        self._games: Batch | None = None
        self._choices: DeedChoices | None = None
        self._taken = np.zeros((0, 0, 5))  # (turns, games, 5)  moves, deeds, and flights

    def begin(self, games: Batch, choices: DeedChoices | None) -> None:
        """Play in the games of a batch."""
        self._games = games
        self._choices = choices
        self._taken = np.zeros((16, len(games), 5))

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

    @property
    def strategy_spec(self) -> StrategySpec:
        """How batches play it."""
        return StrategySpec(array_form=self._decide, looks=False)

    def _decide(self, view: ArrayView) -> IntArray:
        """Return what it is given for each game."""
        moves, deeds = np.moveaxis(self._taken[view.turn, view.games, None, :2].astype(np.int64), -1, 0)
        if self._choices is not None:
            self._choices.do(deeds, view)
        return np.where(moves < view.counts, moves, 0)
