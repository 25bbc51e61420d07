"""The games of a batch that have left it: the turn engine plays each in a context.

A function has done there what columns cannot hold, for example changed a setting: only the turn engine plays them.
"""

from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from functools import partial
from typing import Any
from weakref import WeakSet

import numpy as np

from gamms.errors import BadValue, UnknownName
from gamms.game.array_functions.given import OutsideActions, OutsideActor
from gamms.game.array_functions.view import ArrayView, make_asked_view
from gamms.game.batch_engine import BatchEngine
from gamms.game.block.columns import AgentTable, PlayedGame
from gamms.game.block.sensing import look_in, note_sensors
from gamms.game.block.state import NO_STOP, GameArrays
from gamms.game.movement.legal_moves import MovesInContexts
from gamms.game.movement.roads import RoadMap
from gamms.game.random_streams import seed_for_run
from gamms.game.result import Result
from gamms.ir.game_state import describe_conflict
from gamms.ir.graph import IntArray
from gamms.text import shown
from gamms.typing import AgentType


class SeparateGames:
    """The games of a batch that are played in contexts of their own.

    Args:
        engine: plays the other games.
        roster: the agents of all games.
        playing: returns a context manager in which a game is played, by its number.

    Attributes:
        reasons: why each of these games is played in a context of its own.
    """

    def __init__(
        self,
        engine: BatchEngine,
        roster: AgentTable,
        playing: Callable[[int, PlayedGame], AbstractContextManager[None]],
    ) -> None:
        self.reasons: dict[int, str] = {}
        self._playing = playing
        self._games: dict[int, PlayedGame] = {}
        self._results: dict[int, Result] = {}  # of games whose contexts have ended
        self._unobserved: set[int] = set()  # whose places are not in the columns
        self._observed = WeakSet[GameArrays]()  # the states of maps whose views call sensors in contexts
        self._beyond_arrays: dict[int, UnknownName] = {}  # with agents at or next to nodes that rules have added
        self._roster = roster
        self._engine = engine

    def __len__(self) -> int:
        return len(self.reasons)

    def __contains__(self, number: object) -> bool:
        return number in self.reasons

    def add(self, number: int, why: str, game: PlayedGame, turns: int | None = None) -> None:
        """Play a game in a context of its own from now on.

        Args:
            number: its number.
            why: the reason.
            game: the game in that context.
            turns: the number of turns before the turn that the game is in the middle of; None: it is between two turns.
        """
        self.reasons[number] = why
        self._unobserved.add(number)
        self._games[number] = game
        game.internals.left_as = number
        state = self._engine.get_game_state(number)
        state.is_apart[number] = True
        state.apart[number] = partial(self.get_game, number)
        state.is_going[number] = True
        state.over[number] = None
        if turns is not None:
            state.turn[number] = turns

    def forget(self, numbers: Iterable[int]) -> None:
        """End the contexts of games, which are not played in them any more."""
        for number in self.reasons.keys() & numbers:
            self._end(number)
            for known in (self.reasons, self._results, self._beyond_arrays):
                known.pop(number, None)
            self._unobserved.discard(number)
            state = self._engine.get_game_state(number)
            state.apart.pop(number, None)
            state.is_apart[number] = False

    def close(self) -> None:
        """End all contexts; results remain available."""
        for number in [*self._games]:
            with suppress(BadValue):  # an error of `observe`, which raises it again
                self.observe([number])
            self._results[number] = self.get_result(number)
            self._end(number)

    def _end(self, number: int) -> None:
        game = self._games.pop(number, None)
        if game is not None:
            game.ctx.terminate()

    @property
    def going(self) -> list[int]:
        """The games that are not over."""
        is_over = self._engine.is_over
        return [number for number in sorted(self.reasons) if not is_over[number]]

    def get_game(self, number: int) -> PlayedGame:
        """Return a game in its context."""
        return self._games[number]

    # -- playing ------------------------------------------------------------------------------------------------

    def check(self, given: Mapping[Hashable, OutsideActions]) -> None:
        """Refuse actions that are not legal before any game is played.

        Raises:
            BadType, BadValue: an action is not legal in a game.
        """
        if not given or not self.going:
            return
        self.observe(self.going)
        for state, games in self._engine.group_by_map(np.array(self.going)):
            for team, one in given.items():
                self._check(
                    make_asked_view(state, games, one.select_agents(self._roster, team)), one, f"team {shown(team)}"
                )

    def _check(self, view: ArrayView, given: OutsideActions, by: str) -> None:
        given.act(view)
        if given.may_stay:
            return
        given.check_edges(view, by)
        if given.edges is not None:
            view.mask = view.mask & (given.edges[view.games] < 0)
        view.mask = view.mask & ~self._roster.flies[view.agents] & (view["edge"][..., 0] < 0)
        view._check_actions(given.moves[view.games], by)

    def step(self, numbers: Sequence[int], given: Mapping[Hashable, OutsideActions]) -> None:
        """Play one turn of some games."""
        for number in numbers:
            self._engine.get_game_state(number).notice_interrupt()
            game = self.get_game(number)
            actor = OutsideActor(game, self._roster)
            try:
                with self._record_changes(number, game):
                    actor.take(given, number)
                    game.step()
            finally:
                actor.end()

    @contextmanager
    def undo_after_error(self, played: Sequence[int], *, is_single: bool) -> Iterator[None]:
        """Restore all games, and the engines that play them, if the block raises.

        Args:
            played: the games that the block plays, besides those that leave the batch in it.
            is_single: whether one game plays: it takes its turn back itself, unless the turn is counted.
        """
        known = {*self.reasons}
        taken_back = [] if is_single else played
        snapshots = {number: self._games[number].snapshot() for number in taken_back}
        turns = self._engine.count_turns()
        try:
            yield
        except BaseException:
            if is_single and (self._engine.count_turns() != turns).any():
                raise
            for number, snapshot in snapshots.items():
                self._games[number].restore(snapshot)
                self._note(number)
            self.forget(self.reasons.keys() - known)
            raise

    def run(self, began: IntArray, only: int | None = None) -> Iterator[int]:
        """Play games until the run of the batch stops; yield the number of each.

        Args:
            began: (games,) the number of turns that each game had played when the run began.
            only: the only game to play, which goes on with the global generators as they are; None: all games, each
                with those of its seed; see `seed_for_run`.
        """
        for number in self.going if only is None else [only]:
            game = self.get_game(number)
            seeding = seed_for_run(game.ctx, int(began[number])) if only is None else nullcontext()
            last = self._engine.find_last_turn(number)
            game.internals.seeds_runs = False
            game.internals.takes_all_back = len(self._engine.is_over) > 1
            try:
                with seeding, self._record_changes(number, game):
                    game.run(None if last is None else max(0, last - game.turn))
            finally:
                game.internals.takes_all_back = False
                game.internals.seeds_runs = True
            yield number

    @contextmanager
    def _record_changes(self, number: int, game: PlayedGame) -> Iterator[None]:
        """Record the changes of a game in the block, and name the game in errors."""
        try:
            with self._playing(number, game):
                yield
        except Exception as error:
            error.add_note(f"In game {number} of a batch, with the seed {game.ctx.seed}.")
            raise
        finally:
            self._note(number)

    def get_result(self, number: int) -> Result:
        """Return the result of a game so far."""
        if number in self._results:
            return self._results[number]
        found = self.get_game(number).result()
        over = self._engine.describe_end(number)
        if found.reason == "unfinished" and over is not None:
            found.reason = over["reason"]
        return found

    # -- columns ------------------------------------------------------------------------------------------------

    def _note(self, number: int) -> None:
        """Write the turn, the scores and the end of a game into the columns."""
        game = self._games[number]
        state = self._engine.get_game_state(number)
        state.turn[number] = game.turn
        state.over[number] = None if game.over is None else dict(game.over)
        state.is_going[number] = game.over is None
        state.scores.put(number, game.scores)
        self._unobserved.add(number)

    def begin_run(self) -> None:
        """Take the last turns that rules have set: a run that begins now ends there; the run before went on."""
        for number, game in self._games.items():
            last = game.settings()["max_turns"]
            self._engine.last_turns[number] = NO_STOP if last is None else last

    def observe(self, numbers: Iterable[int]) -> None:
        """Write the observations of agents of some games into the columns.

        Raises:
            BadValue: an agent is at or next to a node that is not in the columns.
        """
        for number in self._unobserved.intersection(numbers):
            self._beyond_arrays.pop(number, None)
            state = self._engine.get_game_state(number)
            if state not in self._observed:
                self._observed.add(state)
                note_sensors(state, with_nodes=True)
                state.shared.clear()
            try:
                note_game(state, self.get_game(number), number)
            except UnknownName as error:
                self._beyond_arrays[number] = error
            self._unobserved.discard(number)
        for number in self._beyond_arrays.keys() & {*numbers}:
            raise BadValue(
                f"Game {number} cannot be observed, nor be given actions: {self._beyond_arrays[number]} A rule has "
                "added it to the map of this game, and arrays have the nodes that are there at the start. Have it "
                "there."
            )


def note_game(state: GameArrays, game: PlayedGame, number: int) -> None:
    """Write the observations of a game in a context of its own into the columns of a batch.

    Args:
        state: the state of all games.
        game: the game.
        number: the number of the game.

    Raises:
        UnknownName (KeyError): an agent is at or next to a node that is not in the columns.
    """
    ctx = game.ctx
    known = ctx.agent.agents
    names = state.roster.names
    gone = game.internals.state.departed
    at = {name: node for name, (_, node) in gone.items()} | {name: one.current_node_id for name, one in known.items()}
    those = [i for i, name in enumerate(names) if name in at]
    state.node[number, those] = state.streets.rows([at[names[i]] for i in those])
    state.is_there[number] = [name in known for name in names] | state.roster.is_first
    state.alive[number] = [name in known and known[name].alive for name in names]
    blocked = game.internals.state.blocked
    state.blocked[number] = [describe_conflict("") in blocked.get(name, "") for name in names]
    state.movement.clear(np.array([number]))
    state.put_roads(np.array([number]), _make_road_map(state, game))
    state.now.clear()
    MovesInContexts({number: lambda: game}, names, state.streets, nullcontext).list_legal(number)  # it may raise
    if state.flights is not None:
        for row, i in enumerate(state.flyers.tolist()):
            agent: Any = known.get(names[i])
            if agent is not None and agent.type is AgentType.AERIAL:
                state.position[number, row] = agent.position
    look_in(state, game, number)


def _make_road_map(state: GameArrays, game: PlayedGame) -> RoadMap | None:
    """Return the map of a game, if only its open roads differ from the start; None: it has other nodes."""
    try:
        return state.roads.map_with(*game.ctx.graph.storage.list_roads())
    except (BadValue, UnknownName):
        return None
