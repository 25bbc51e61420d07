"""The games of a batch in contexts of their own, which are made when functions are called in them."""

from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from functools import cached_property, partial
from typing import Any

import numpy as np

from gamms.core.rows import RowColumns
from gamms.game.block.columns import PlayedGame
from gamms.game.block.in_core import CoreGames, get_memory
from gamms.game.block.state import Arrays, GameArrays
from gamms.game.plan import RowPlan
from gamms.game.rows.by_seed import GamesBySeed, list_shared
from gamms.game.rows.row import PhaseCall, RowMeans, RowOfGame, continue_streams
from gamms.game.rows.state import get_data
from gamms.game.snapshots import ForkSource
from gamms.ir.graph import IntArray


class RowContexts:
    """The games on one map of a batch, each in a context of its own, which is made when a function is called in it.

    Args:
        game: the game at its start.
        state: the state of all games.
        core: plays the games in the core.
        own: the differences between the games from their start.
        plan: what the games share.

    Attributes:
        game, plan: see the arguments.
        call: what is the same in all games in which a function is called.
        rows: the games, by number.
        moved: number of a game that has columns of its own -> a function that shows it in its context.
    """

    def __init__(
        self,
        game: PlayedGame,
        state: GameArrays,
        core: CoreGames,
        own: GamesBySeed,
        plan: RowPlan,
    ) -> None:
        self.game = game
        self.call = PhaseCall()
        self.rows: dict[int, RowOfGame] = {}
        self.moved: dict[int, Callable[[], PlayedGame]] = {}
        self._kept: dict[int, tuple[Any, ...]] = {}  # values of games at the last checkpoint
        self._state = state
        self._core = core
        self._own = own
        self.plan = plan

    @cached_property
    def _source(self) -> ForkSource:
        """The start, of which the contexts are forks."""
        return ForkSource(self.game.internals.parts, only_plain=False)

    @cached_property
    def _shared(self) -> list[object]:
        """The functions and settings that are objects which all games share."""
        return list_shared(self.game, self.plan.functions)

    @cached_property
    def means(self) -> RowMeans:
        """What all these games share that follow the plan of the start."""
        number_of = {name: number for number, name in enumerate(self._state.roster.names)}
        start = self.game.internals.state.start
        is_known = self._own.goes_on and start is not None
        return RowMeans(
            state=self._state,
            core=self._core,
            plan=self.plan,
            start=self.game.internals.state,
            call=self.call,
            columns=self._make_columns(),
            number_of=number_of,
            at_rest=start.snapshot if is_known else self.game.snapshot(),  # of the first game, not of each fork
            turns=self.game.internals.parts.turns,
        )

    def _make_columns(self) -> RowColumns:
        """Return the columns of all games that contexts show."""
        state = self._state
        ids: IntArray = np.ascontiguousarray(state.streets.columns.node_ids, np.int64)
        numbers = np.zeros_like(ids)
        self.game.ctx.agent.block.numbers.write(ids.data, numbers.data)
        rows = np.zeros(numbers.max(initial=-1) + 1, np.int64)
        rows[numbers] = np.arange(len(numbers))
        columns = (state.turn, state.node, state.previous, state.alive, state.placed, numbers, rows)
        return RowColumns(state.stop.data, *map(get_memory, columns))

    def get(self, number: int) -> "RowOfGame":
        """Return a game in its context, which may change from now on; see `checkpoint`."""
        row = self.rows.get(number)
        if row is None:
            row = self._make(number)
            self.rows[number] = row
        if number not in self._kept:  # NOTE: only now, when the row is read in any case (w8_games.py rule)
            self._kept[number] = row.copy_turn_values()
        return row

    def find(self, number: int) -> "RowOfGame | None":
        """Return a game in its context; None: it shows nothing but what all games begin with."""
        return self.get(number) if self._own.is_needed else self.rows.get(number)

    def _make(self, number: int) -> "RowOfGame":
        """Return a game at its start in a context of its own."""
        if self._own.is_needed:
            return RowOfGame(self._own.begun.pop(number), number, self.means)
        source = self._source
        source.renew_map()
        ctx, _ = source.make_fork(self._state.seeds[number], shared=self._shared)
        ctx.game.internals.parts.turns.legality.share_maps(self.game.internals.parts.turns.legality)
        self._begin(number, ctx.game)
        row = RowOfGame(ctx.game, number, self.means)
        row.has_first_functions = _list_functions(ctx.game) == _list_functions(self.game)
        return row

    def _begin(self, number: int, game: PlayedGame) -> None:
        """Let `ctx.rng` of a game draw what it draws after a reset, or next in the game that it goes on from."""
        if self._own.goes_on:
            continue_streams(game.ctx, self.game.ctx)
            game.internals.take_calls(self.game.internals)
            return
        start = self.game.internals.state.start
        rng = None if start is None else start.get_rng_state(self._state.seeds[number])
        if rng is not None:
            game.ctx.reseed(self._state.seeds[number], rng)

    def forget(self, games: IntArray) -> None:
        """Begin games again in their contexts, or end these contexts if functions are not those of the start."""
        for number in games.tolist() if self.rows else ():
            self._kept.pop(number, None)
            row = self.rows.pop(number, None)  # an error, or Ctrl-C, leaves no row that has half begun
            if row is not None and row.has_first_functions:
                row.begin_again(self._state.seeds[number], partial(self._begin, number))
                self.rows[number] = row
            elif row is not None:
                row.ctx.terminate()

    def close(self) -> None:
        """End all contexts; what results are made of remains."""
        for row in self.rows.values():
            row.ctx.terminate()
        self._own.close()

    def change_roads(self, games: IntArray, verb: str, edges: Sequence[int]) -> None:
        """Close or open roads in some games.

        Args:
            games: the numbers of the games.
            verb: the name of the method of `ctx.graph`.
            edges: ids.

        Raises:
            UnknownName (KeyError): an edge does not exist in a game.
        """
        for number in games.tolist():
            row = self.get(number)
            row.show()
            getattr(row.ctx.graph, verb)(edges)
            row.take_roads()

    def take_own_arrays(self, key: Hashable) -> Iterator[tuple[int, Arrays]]:
        """Yield the number of each game, and the arrays that functions called in it keep under a key."""
        for number, row in self.rows.items():
            yield number, row.take_own_arrays(key)

    def decide_again(self) -> None:
        """Let agents decide again in a turn that was not played."""
        for row in self.rows.values():
            row.decide_again()

    def show(self, number: int) -> PlayedGame:
        """Return a game in a context that shows it as it is now."""
        if number in self.moved:
            return self.moved[number]()
        row = self.get(number)
        row.show()
        return row.game

    def get_data(self, number: int, first: Mapping[Any, Any]) -> Mapping[Any, Any]:
        """Return `ctx.game.data` of a game; `first` is that of the start."""
        row = self.rows.get(number)
        return first if row is None else get_data(row.values)

    def checkpoint(self) -> Callable[[], None]:
        """Return a function that undoes later changes; what functions have written themselves stays."""
        kept: dict[int, tuple[Any, ...]] = {}
        self._kept = kept

        def take_back() -> None:
            for number, values in kept.items():
                self.rows[number].take_back(values)

        return take_back


def _list_functions(game: PlayedGame) -> list[int]:
    """Return the `id` of each function of a game, and of its settings."""
    parts = game.internals.parts
    ctx = game.ctx
    functions = [*ctx.agent.storage.list_strategies(), *(one.rule for one in parts.rules.now.rules)]
    functions += [one.fn for one in parts.collectors.by_name.values()]
    functions += [getattr(sensor, "function", None) for sensor in ctx.sensor.sensors.values()]
    plans = [plan.function for plan in game.settings()["plans"].values()]
    return [*map(id, functions), *map(id, plans), id(game.settings()["conflicts"])]
