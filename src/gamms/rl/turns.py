"""Turns of learners: the actions in them, the input of rewards, and their outcomes."""

from collections.abc import Hashable
from copy import copy
from functools import cached_property
from typing import Any, NamedTuple, cast

import numpy as np

from gamms.core import observe
from gamms.game.array_functions.aims import make_flight_action
from gamms.game.array_functions.view import ArrayView
from gamms.game.batch import Batch
from gamms.game.strategy_specs import CoreStep, StrategySpec
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.rl.deeds import DeedChoices

ObjectArray = np.ndarray[tuple[int, ...], np.dtype[np.object_]]


class GameOutcomes:
    """The winners and reasons of ended games, computed on first use.

    Args:
        games: the batch of the games.
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
    """A played turn, for `reward=`; with several maps, of the games on one map.

    Attributes:
        team: the team that gets the reward.
        before: the view of its agents before the turn; only the attributes `node` and `mask`, (games, agents), and
            `turn`, (games,), of this view have the old values.
        after: the view of its agents now.
        gains: key -> (games,) the change of each score; of a score that no game has set, zeros.
        outcomes: the ends of all games of the batch; use `winner` and `reason` of the turn instead.
    """

    team: Hashable
    before: ArrayView
    after: ArrayView
    gains: dict[Any, FloatArray]
    outcomes: GameOutcomes

    @property
    def winner(self) -> ObjectArray:
        """The winner of each game, (games,) objects; None while a game goes on, or if no team has won."""
        winner: ObjectArray = self.outcomes.winner[self.after.games]
        return winner

    @property
    def won(self) -> BoolArray:
        """Whether the team has won each game, (games,): `reward=lambda turn: turn.won` is 1 for a win."""
        found: BoolArray = self.winner == np.array(self.team, object)
        return found

    @property
    def reason(self) -> ObjectArray:
        """Why each game has ended, (games,) objects, such as "time_limit"; None while it goes on."""
        reason: ObjectArray = self.outcomes.reason[self.after.games]
        return reason


class TurnOutcome(NamedTuple):
    """The outcome of a turn for learners, each (games, agents).

    Attributes:
        rewards: the rewards of the agents; 0 for agents that were dead before.
        terminated: whether the agent went out in this turn, or took part in a game that an event of this turn ended. An
            agent that went out in an earlier turn is not terminated again when its game ends.
        truncated: whether the agent took part in a game that reached its time limit.
        valid: whether the agent took part in the turn.
        num_ended: the number of agents that are terminated or truncated.
    """

    rewards: FloatArray
    terminated: BoolArray
    truncated: BoolArray
    valid: BoolArray
    num_ended: int


def as_buffer(column: np.ndarray[Any, Any]) -> Any:  # memoryviews are not subscriptable
    """Return an array as a flat buffer, which the core writes to."""
    return (column.view(np.uint8) if column.dtype == np.bool_ else column).reshape(-1).data


class TurnArrays:
    """The arrays in which the core takes the actions of learners, and writes their rewards and ends.

    Args:
        shape: the numbers of games and agents.
        may_return: whether agents that are out may come back.

    Attributes:
        counts, alive, over, was_over, late, earned, moves, may_begin, begun: see `core.observe.LearnerTurn`; (games,
            agents), or (games,).
        core: these arrays in the form of the core.
    """

    def __init__(self, shape: tuple[int, int], *, may_return: bool) -> None:
        self.counts, self.moves = np.zeros((2, *shape), np.int64)
        self.earned, self._rewards = np.zeros((2, *shape))
        self.alive, self._plays, self._terminated, self._truncated = np.zeros((4, *shape), np.bool_)
        self.over, self.late, self.was_over, self.begun = np.zeros((4, shape[0]), np.bool_)
        self.may_begin = np.zeros(shape[0], np.uint8)

        self.core = observe.LearnerTurn(
            *shape,
            as_buffer(self.counts),
            as_buffer(self.alive),
            as_buffer(self.over),
            as_buffer(self.late),
            as_buffer(self.earned),
            as_buffer(self.moves),
            was_over=as_buffer(self.was_over),
            plays=as_buffer(self._plays),
            rewards=as_buffer(self._rewards),
            terminated=as_buffer(self._terminated),
            truncated=as_buffer(self._truncated),
            may_begin=as_buffer(self.may_begin),
            begun=as_buffer(self.begun),
            may_return=may_return,
        )

    def begin(self) -> None:
        """Note which agents take part in a turn, and replace illegal moves by 0."""
        observe.begin_turns(self.core)

    def write_masks(self, legal: BoolArray) -> None:
        """Write which actions are legal, (games, agents, actions), by `counts`; see `core.observe.write_masks`."""
        observe.write_masks(self.core, as_buffer(legal))

    def end(self) -> TurnOutcome:
        """Write the rewards and ends of a turn, and return its outcome."""
        return self.make_outcome(observe.end_turns(self.core))

    def make_outcome(self, num_ended: int) -> TurnOutcome:
        """Return the outcome of a turn in new arrays, given the number of agents that ended."""
        ends = self._terminated.copy(), self._truncated.copy()
        return TurnOutcome(self._rewards.copy(), *ends, self._plays.copy(), num_ended)


class ActionHistory:
    """The actions of games since they began.

    Args:
        shape: the numbers of games and agents.
        heads: the number of heads of an action: a move, and optionally a deed.
        flies: whether agents fly.

    Attributes:
        steps: (games,) the number of actions.
    """

    def __init__(self, shape: tuple[int, int], heads: int, *, flies: bool) -> None:
        self.steps: IntArray = np.zeros(shape[0], np.int64)
        self._first: IntArray = np.zeros(shape[0], np.int64)  # the index of the stored turn in which each game began
        self._heads: list[list[IntArray]] = []  # by turn and head, (games, agents)
        self._flights: list[FloatArray | None] = []
        self._none = [np.zeros(shape, np.int64)] * heads, np.zeros((*shape, 3)) if flies else None

    def begin(self, which: IntArray) -> None:
        """Discard the actions of games, by their numbers."""
        self.steps[which] = 0
        self._first[which] = len(self._heads)
        forgotten = int(self._first.min())
        del self._heads[:forgotten], self._flights[:forgotten]
        self._first -= forgotten

    def add(self, games: BoolArray, heads: list[Any], flights: FloatArray | None) -> None:
        """Add a turn of some games: heads (games, agents) of legal actions, which fit into 16 bits."""
        self._heads.append([head.astype(np.int16) for head in heads])
        self._flights.append(None if flights is None else flights.copy())
        self.steps += games

    def cut(self) -> "ActionHistory":
        """Return an independent copy."""
        copied = copy(self)
        copied.steps = self.steps.copy()
        copied._first = self._first.copy()
        copied._heads = [*self._heads]
        copied._flights = [*self._flights]
        return copied

    def get_actions(self, turns: IntArray) -> tuple[IntArray, IntArray | None, FloatArray | None]:
        """Return the moves, deeds and flights of these turns of the games, (games,); before turn 0 agents stay."""
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


class ScriptedActions:
    """The strategy of a learning agent: takes the action that was stored for each turn of each game."""

    def __init__(self) -> None:
        self._games: Batch | None = None
        self._choices: DeedChoices | None = None
        self._by_edges = False
        self._taken = np.zeros((0, 0, 5))  # (turns, games, 5) move, deed and flight

    def begin(self, games: Batch, choices: DeedChoices | None, *, by_edges: bool) -> None:
        """Use the strategy in the games of a batch; `by_edges`: moves are numbers of legal edges, from 1."""
        self._by_edges = by_edges
        self._games = games
        self._choices = choices
        self._taken = np.zeros((16, len(games), 5))

    def take(self, turns: IntArray, moves: IntArray, deeds: IntArray | None, flights: FloatArray | None) -> None:
        """Store actions for these turns of the games, (games,), as arrays (games, 1)."""
        while turns.max() >= len(self._taken):
            self._taken = np.concatenate((self._taken, np.zeros_like(self._taken)))
        done = moves * 0 if deeds is None else deeds
        flown = np.zeros((len(moves), 3)) if flights is None else flights[:, 0]
        self._taken[turns, np.arange(len(turns))] = np.column_stack((moves, done, flown))

    def __call__(self, state: dict[str, Any]) -> None:
        """Set the action that was stored for this turn of the current game."""
        legal = state["legal"]
        games = cast("Batch", self._games)
        move, deed, *flight = self._taken[state["turn"], games.loaded].tolist()
        agent = games.game.ctx.agent.agents[state["name"]]
        here = agent.current_node_id
        done = {} if self._choices is None else self._choices.make_plain(int(deed), legal or (here,), here)
        if "quat" in state:
            state["action"] = make_flight_action(flight, agent.speed, done)
            return
        if self._by_edges and 0 < move <= len(state["legal_edges"]):
            edge = {"edge": state["legal_edges"][int(move) - 1]}
            state["action"] = {**edge, "do": done} if done else edge
            return
        node = legal[int(move) if move < len(legal) and not self._by_edges else 0]
        state["action"] = {"node_id": node, "do": done} if done else node

    @property
    def strategy_spec(self) -> StrategySpec:
        """Declare that the core keeps the agent's stored action, instead of calling a decision."""
        return StrategySpec(core_steps=(CoreStep("stay"),), is_replaced=True)


def gain_lead(turn: Turn) -> FloatArray:
    """Return the growth of a team's lead in score over the mean of the others, (games, 1)."""
    own = turn.gains.get(turn.team, np.zeros(len(turn.after.mask)))
    others = [turn.gains[team] for team in turn.after.roster.teams if team != turn.team and team in turn.gains]
    number = max(1, len(turn.after.roster.teams) - 1)
    return (own - sum(others, np.zeros(len(own))) / number)[:, None]
