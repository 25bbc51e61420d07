"""Plays the games of a batch one after the other in one context, for games of which some part has no array form."""

from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

from gamms.errors import BadValue
from gamms.game.batch.columns import BoolArray, PlayedGame, Roster
from gamms.game.batch.turn import GameArrays, Places
from gamms.game.batch.view import ArrayView
from gamms.game.result import Result
from gamms.game.settings import Plan
from gamms.game.snapshots import Snapshot
from gamms.game.streets import Streets
from gamms.ir.graph import IntArray
from gamms.text import shown


class OneByOneEngine:
    """Plays the games of a batch one after the other: each is a snapshot that is restored for its turn.

    Args:
        game: at its start.
        seeds: of the games.
    """

    def __init__(self, game: PlayedGame, seeds: Sequence[int]) -> None:
        self._game, self.seeds = game, list(seeds)
        self._snapshots: list[Snapshot | None] = [None] * len(seeds)  # None: at the start
        self._results: list[Result | None] = [None] * len(seeds)
        self._over: list[dict[str, Any] | None] = [None] * len(seeds)
        self._turns = np.zeros(len(seeds), np.int64)
        self._scores: list[dict[Any, float]] = [{} for _ in seeds]
        self._last: int | None = game.settings()["max_turns"]

    @property
    def is_over(self) -> BoolArray:
        """Which games have ended, (games,)."""
        return np.array([over is not None for over in self._over])

    def start(self, game: int) -> None:
        """Begin a game again, with the seed that it has now."""
        self._snapshots[game] = self._results[game] = self._over[game] = None
        self._turns[game], self._scores[game] = 0, {}

    def step(self, given: Mapping[Hashable, Any]) -> None:
        """Play one turn of all games that are not over.

        Args:
            given: team -> the actions of its agents, (games, agents), in place of their strategies.
        """
        wanted = {team: self._checked(team, actions) for team, actions in given.items()}
        for number in np.flatnonzero(~self.is_over).tolist():
            game, team_plans = self._load(number), self._game.plans
            if wanted:
                own = {team: Plan(acting(self._names_of(team), actions[number])) for team, actions in wanted.items()}
                game.plans = {**team_plans, **own}
            try:
                with self._named(number):
                    game.step()
            finally:
                if wanted:
                    game.plans = team_plans
            self._store(number)

    def run(self, number: int) -> None:
        """Play a game to its end."""
        game = self._load(number)
        last = None if self._last is None else max(0, self._last - game.turn)
        with self._named(number):
            game.run(last)
        self._store(number)

    @contextmanager
    def _named(self, number: int) -> Iterator[None]:
        """Say of errors in which game they are."""
        try:
            yield
        except Exception as error:
            error.add_note(f"In game {number} of a batch, with the seed {self.seeds[number]}.")
            raise

    def view(self, team: Hashable) -> ArrayView:
        """Return what the agents of a team observe, in all games."""
        roster = Roster.of(self._game.ctx.agent.agents.values())
        graph = self._game.ctx.graph
        agents, streets = roster.members(team), Streets(graph.columns(), graph.routes)
        shape = len(self.seeds), len(roster.names)
        state = GameArrays(roster, streets, self.seeds, np.zeros(shape, np.int64))
        state.places = Places(np.full((*shape, 3), -1), np.zeros(shape), np.zeros((*shape, 2)))
        for number in range(len(self.seeds)):
            game = self._load(number)
            state.turn[number] = game.turn
            state.node[number] = streets.rows([agent.current_node_id for agent in roster.agents])
            state.alive[number] = [agent.alive for agent in roster.agents]
            for i, agent in enumerate(roster.agents):
                state.places.offset_m[number, i], state.places.xy[number, i] = agent.offset_m, agent.xy
                state.places.edge[number, i] = (-1, -1, -1) if agent.edge is None else agent.edge
        return ArrayView(state, np.arange(len(self.seeds)), agents)

    def overs(self) -> list[dict[str, Any] | None]:
        """Return how the games have ended; None of one that goes on."""
        return self._over

    def scores(self) -> dict[Any, Any]:
        """Return the scores of all games: key -> (games,)."""
        keys = dict.fromkeys(key for scores in self._scores for key in scores)
        return {key: np.array([scores.get(key, 0.0) for scores in self._scores]) for key in keys}

    def turns(self) -> IntArray:
        """Return how many turns were played, (games,)."""
        return self._turns.copy()

    def result(self, number: int) -> Result:
        """Return the result of a game so far."""
        known = self._results[number]
        if known is None:
            self._load(number)
            known = self._results[number] = self._result()
        return known

    def _load(self, number: int) -> PlayedGame:
        """Let the context have a game as it is now."""
        game, snapshot = self._game, self._snapshots[number]
        if snapshot is None:
            game.reset(seed=self.seeds[number])
        else:
            game.restore(snapshot)
        return game

    def _store(self, number: int) -> None:
        """Keep what has become of the game that the context has."""
        game = self._game
        self._turns[number], self._scores[number], self._results[number] = game.turn, dict(game.scores), None
        is_late = self._last is not None and game.turn >= self._last
        if game.over is not None:
            self._over[number] = dict(game.over)
        elif is_late:
            self._over[number] = {"reason": "max_turns", "winner": None, "truncated": True}
        if self._over[number] is not None:
            self._results[number] = self._result()
        self._snapshots[number] = game.snapshot()

    def _result(self) -> Result:
        result = self._game.result()
        if result.reason == "unfinished" and self._last is not None and result.turns >= self._last:
            result.reason = "max_turns"
        return result

    def _names_of(self, team: Hashable) -> list[str]:
        return sorted(agent.name for agent in self._game.ctx.agent.agents.values() if agent.team == team)

    def _checked(self, team: Hashable, given: object) -> IntArray:
        """Return actions as integers, (games, agents)."""
        agents, actions = self._names_of(team), np.asarray(given)
        if actions.shape != (len(self.seeds), len(agents)) or actions.dtype.kind not in "iu":
            form = f"integers ({len(self.seeds)}, {len(agents)})"
            raise BadValue(
                f"Actions of team {shown(team)} are numbers of legal nodes, one for each game and agent, {form}, not "
                f"{actions.dtype} of the shape {actions.shape}."
            )
        return actions


def acting(names: Sequence[str], actions: IntArray) -> Callable[[dict[str, Any]], None]:
    """Return a plan by which the agents of these names, if they are alive, take these actions."""
    action_of = dict(zip(names, actions.tolist(), strict=True))

    def plan(states: dict[str, Any]) -> None:
        for name, state in states.items():
            legal, action = state["legal"], action_of[name]
            if not 0 <= action < len(legal):
                raise BadValue(
                    f"Action {action} of agent {shown(name)}, turn {state['turn']}, is not the number of a legal node: "
                    f"it has {len(legal)}, numbered from 0."
                )
            state["action"] = legal[action]

    return plan
