"""Points the context of one game at each game of a batch in turn."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import numpy as np

from gamms.core.agents import PointedColumns
from gamms.core.copies import copied
from gamms.errors import BadValue
from gamms.game.batch.columns import PlayedGame
from gamms.game.batch.movement import AnyNodeMovement, Movement
from gamms.game.batch.roads import RoadMap
from gamms.game.batch.state import GameArrays, Heading, NotInCore
from gamms.game.snapshots import Snapshot
from gamms.ir.agents import show_flights, show_game, show_lives, show_progress
from gamms.ir.graph import IntArray
from gamms.ir.obstacles import BoolArray


class PointedContext:
    """A context whose agents, turn and seed are those of one game of a batch after the other.

    Args:
        game: at its start, in a context in which nothing else is played.
        state: of all games.

    Attributes:
        numbers: the number in the roster of each agent of the context, by row.
        headings: those that agents have, by their numbers, where they are not those of the start.
        rows_in_air: the rows of the agents that fly, in the order of the roster.
        alive: which agents of the context live, by row, as bytes; empty: unknown.
        delayed_looks: what sensors are still to report in each game.
    """

    def __init__(self, game: PlayedGame, state: GameArrays) -> None:
        self._game = game
        self._state = state
        self._before: Snapshot | None = None
        self._looks_at_start = copied(game.internals.state.delayed_looks)
        self.delayed_looks = [copied(self._looks_at_start) for _ in range(len(state))]
        self._own = vars(game.ctx)
        self.numbers: IntArray = np.zeros(0, np.int64)
        self.rows_in_air: list[int] = []
        self.alive = b""

    def forget(self, games: IntArray) -> None:
        """Let some games begin again: sensors are to report in them what they were to report at first."""
        for number in games.tolist():
            self.delayed_looks[number] = copied(self._looks_at_start)

    def hold(self) -> None:
        """Remember the context as it is, for `release`."""
        block = self._game.ctx.agent.block
        number = {name: i for i, name in enumerate(self._state.roster.names)}
        self._before = self._game.snapshot()
        self._first_looks = self._game.internals.state.delayed_looks
        self._block = block
        self.numbers = np.array([number[name] for name in block.names], np.int64)
        self.rows_in_air = (
            [] if self._state.flights is None else np.argsort(self.numbers)[self._state.flights.agents].tolist()
        )
        self.alive = b""
        self.first_headings = [*block.heading]
        self.headings: dict[int, Heading] = {}  # that are shown
        self._graph = self._game.ctx.graph.graph
        self._first_map = self._game.ctx.graph.storage.snapshot()
        self._note_map(None)

    def release(self) -> None:
        """Restore the context as it was before it was pointed at games."""
        assert self._before is not None  # noqa: S101 - it is held
        self._block.placed.clear()
        self._game.internals.state.delayed_looks = self._first_looks
        self._game.restore(self._before)
        self._before = None

    @contextmanager
    def held(self) -> Iterator[None]:
        """Point the context at games in the block, and restore it afterwards unless it was held before."""
        if self._before is not None:
            yield
            return
        self.hold()
        try:
            yield
        finally:
            self.release()

    def each(self, games: IntArray) -> Iterator[int]:
        """Point the context at each of some games in turn, and yield the number of the game."""
        state = self._state
        block = self._block
        values = self._game.internals.state
        turns = self._game.internals.parts.turns
        node, previous = (
            np.ascontiguousarray(state.streets.ids_of(column[games][:, self.numbers]), np.int64).reshape(-1).data
            for column in (state.node, state.previous)
        )
        columns = PointedColumns(block, node, previous)
        size = len(self.numbers)
        row_of = {number: row for row, number in enumerate(self.numbers.tolist())}
        lives = np.ascontiguousarray(state.alive[games][:, self.numbers]).tobytes()
        placed = self._placed(games)
        are_placed = np.any(placed, axis=1).tolist()
        may_be_on_edges = len(state.movement.remembers) > 0
        roads = state.roads
        if self.has_changed_map():  # by a function that has raised
            self._show_roads(None)
        played = state.turn[games].tolist()
        for at, number in enumerate(games.tolist()):
            values.turn = played[at]
            values.delayed_looks = self.delayed_looks[number]
            self._own["_seed"] = state.seeds[number]
            turns.seed_changes += 1
            show_game(block, columns, at)
            if self.rows_in_air or state.headings[number] != self.headings:
                self._show_poses(number)
            alive = lives[at * size : (at + 1) * size]
            if alive != self.alive:
                self.show_lives(alive)
            for name, column in state.numbers.items():
                np.asarray(getattr(block, name))[:] = column[number, self.numbers]
            if are_placed[at]:
                block.placed = set(np.flatnonzero(placed[at][self.numbers]).tolist())
            elif block.placed:
                block.placed = set()
            if may_be_on_edges:
                on_edges = state.movement.on_edges(number, state.node[number])
                show_progress(block, {row_of[agent]: one for agent, one in on_edges.items()})
            if roads.are_closed or self._roads is not None:
                self._show_roads(roads.of(number))
            yield number

    def _show_poses(self, number: int) -> None:
        """Let agents fly where they do in a game, and be turned as they are there."""
        flights, headings = self._state.flights, self._state.headings[number]
        if flights is not None:
            show_flights(self._block, self.rows_in_air, flights.poses(number))
        self.headings = headings
        self._block.heading[:] = [
            headings.get(number, first)
            for number, first in zip(self.numbers.tolist(), self.first_headings, strict=True)
        ]

    def _placed(self, games: IntArray) -> BoolArray:
        """Return which agents rules have put where they are, (games, agents), without those that have flown there."""
        placed: BoolArray = self._state.placed[games]
        flights = self._state.flights
        if flights is not None:
            placed[:, flights.agents] &= ~flights.has_flown[games]
        return placed

    def show_lives(self, alive: bytes) -> None:
        """Let the agents of the context live that lived in some game, by row."""
        show_lives(self._block, alive)
        self.alive = alive

    def _show_roads(self, roads: RoadMap | None) -> None:
        """Let those roads be open in the context that are in a game; None: those of the start."""
        if roads is not self._roads or self.has_changed_map():
            self._game.ctx.graph.storage.restore(self._first_map if roads is None else roads.snapshot)
            self._note_map(roads)

    def _note_map(self, roads: RoadMap | None) -> None:
        self._roads = roads
        self._revision, self._road_changes = self._graph.revision, self._game.ctx.graph.storage.road_changes

    def has_changed_map(self) -> bool:
        """Whether the graph of the context was changed since the game was shown."""
        changed: bool = self._graph.revision != self._revision
        return changed

    def change_roads(self, games: IntArray, verb: str, edges: Sequence[int]) -> None:
        """Close or open roads in some games.

        Args:
            games: their numbers.
            verb: the name of the method of `ctx.graph`.
            edges: ids.

        Raises:
            UnknownName (KeyError): an edge does not exist in a game.
            NotInCore: the core cannot close roads in these games.
        """
        change = getattr(self._game.ctx.graph, verb)
        with self.held():
            for number in self.each(games):
                change(edges)
                if not self.take_roads(number):
                    raise NotInCore("roads that an array rule closes or opens")

    def take_roads(self, number: int) -> bool:
        """Let a game have the map of the context; return False, and do nothing, if more than roads was changed."""
        state, storage = self._state, self._game.ctx.graph.storage
        others = self._graph.revision - self._revision - storage.road_changes + self._road_changes
        if others or type(state.movement) not in (Movement, AnyNodeMovement):
            return False
        try:
            roads = state.roads.map_with(*storage.roads())
        except BadValue:
            return False
        if roads is not None and roads.snapshot is None:
            roads.snapshot = storage.snapshot()
        state.put_roads(np.array([number]), roads)
        self._note_map(roads)
        return True
