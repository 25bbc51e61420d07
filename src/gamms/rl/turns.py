"""Turns of learners: what agents do in them, what rewards are made of, and what they came to."""

from collections.abc import Hashable
from copy import copy
from functools import cached_property
from typing import Any, NamedTuple, cast

import numpy as np

from gamms.core import moves
from gamms.game.batch import ArrayView, Batch
from gamms.game.batch.forms import StrategySpec
from gamms.game.batch.given import flown
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.rl.deeds import DeedChoices

ObjectArray = np.ndarray[tuple[int, ...], np.dtype[np.object_]]


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
    """A turn that was played, for `reward=`: of the games of one map, where there are several.

    Attributes:
        team: whose reward it is.
        before: its agents before the turn; of this view only the attributes `node` and `mask`, (games, agents), and
            `turn`, (games,), are those of then.
        after: its agents now.
        gains: key -> (games,) by how much each score has changed.
        outcomes: how all games of the batch have ended; read `winner` and `reason` of the turn.
    """

    team: Hashable
    before: ArrayView
    after: ArrayView
    gains: dict[Any, FloatArray]
    outcomes: Outcomes

    @property
    def winner(self) -> ObjectArray:
        """The winner of each game, (games,) objects; None while a game goes on, or if no team has won."""
        winner: ObjectArray = self.outcomes.winner[self.after.games]
        return winner

    @property
    def reason(self) -> ObjectArray:
        """Why each game has ended, (games,) objects, such as "time_limit"; None while it goes on."""
        reason: ObjectArray = self.outcomes.reason[self.after.games]
        return reason


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
        self._first: IntArray = np.zeros(shape[0], np.int64)  # the turn, of those that are kept, in which each began
        self._heads: list[list[IntArray]] = []  # by turn and head, (games, agents)
        self._flights: list[FloatArray | None] = []
        self._none = [np.zeros(shape, np.int64)] * heads, np.zeros((*shape, 3)) if flies else None

    def begin(self, which: IntArray) -> None:
        """Forget the actions of games, by their numbers."""
        self.steps[which] = 0
        self._first[which] = len(self._heads)
        forgotten = int(self._first.min())
        del self._heads[:forgotten], self._flights[:forgotten]
        self._first -= forgotten

    def add(self, games: BoolArray, heads: list[Any], flights: FloatArray | None) -> None:
        """Add what agents do in a turn of some games, each head (games, agents) legal: at most 4,096 in number."""
        self._heads.append([head.astype(np.int16) for head in heads])
        self._flights.append(None if flights is None else flights.copy())
        self.steps += games

    def cut(self) -> "Prefix":
        """Return a copy, to which nothing is added."""
        copied = copy(self)
        copied.steps = self.steps.copy()
        copied._first = self._first.copy()
        copied._heads = [*self._heads]
        copied._flights = [*self._flights]
        return copied

    def at(self, turns: IntArray) -> tuple[IntArray, IntArray | None, FloatArray | None]:
        """Return the moves, deeds and flights of these turns of the games, (games,); before the first turn all stay."""
        stay, hover = self._none
        heads = [one.copy() for one in stay]
        flights = None if hover is None else hover.copy()
        for game in np.flatnonzero(turns >= 0).tolist():
            turn = int(self._first[game] + turns[game])
            for head, given in zip(heads, self._heads[turn], strict=False):
                head[game] = given[game]
            flown = self._flights[turn]
            if flights is not None and flown is not None:
                flights[game] = flown[game]
        return heads[0], heads[1] if len(heads) > 1 else None, flights


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
        """How the core plays it: what it is given stands in place of what it decides."""
        return StrategySpec(core_form=moves.STAY)
