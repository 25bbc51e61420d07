"""The games of a batch that have columns of their own, as the columns of all games show them."""

from collections.abc import Iterable
from contextlib import nullcontext
from functools import partial
from typing import Any
from weakref import WeakSet

import numpy as np

from gamms.errors import BadValue, UnknownName
from gamms.game.batch_engine import BatchEngine
from gamms.game.block.columns import PlayedGame
from gamms.game.block.sensing import look_in, note_sensors
from gamms.game.block.state import GameArrays
from gamms.game.movement.legal_moves import MovesInContexts
from gamms.game.movement.roads import RoadMap
from gamms.ir.game_state import describe_conflict
from gamms.typing import AgentType


class ShownGames:
    """Shows games that have columns of their own in those of all games, for observations and actions from outside.

    Args:
        engine: plays all games.
    """

    def __init__(self, engine: BatchEngine) -> None:
        self._engine = engine
        self._shown: dict[
            int, tuple[int, GameArrays]
        ] = {}  # the turn in which each was shown last, and its map's state
        self._observed = WeakSet[GameArrays]()  # the states of maps whose views call sensors in contexts

    def forget(self, numbers: Iterable[int]) -> None:
        """Forget games that begin again."""
        for number in numbers:
            if number in self._shown:
                self._shown.pop(number)[1].apart.pop(number, None)

    def observe(self, numbers: Iterable[int]) -> None:
        """Write the observations of agents of some games into the columns.

        Raises:
            BadValue: an agent is at or next to a node that is not in the columns.
        """
        for number in numbers:
            ((state, _),) = self._engine.group_by_map(np.array([number]))
            if number in self._shown and self._shown[number][0] == state.turn[number]:
                continue
            if state not in self._observed:
                self._observed.add(state)
                note_sensors(state, with_nodes=True)
                state.shared.clear()
            state.apart[number] = partial(self._engine.show, number)
            self._shown[number] = -1, state  # until it is
            try:
                note_game(state, self._engine.show(number), number)
            except UnknownName as error:
                raise BadValue(
                    f"Game {number} cannot be observed, nor be given actions: {error} A rule has added it to the map "
                    "of this game, and arrays have the nodes that are there at the start. Have it there."
                ) from None
            self._shown[number] = int(state.turn[number]), state


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
