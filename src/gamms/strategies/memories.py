"""What agents remember, in arrays: what forms keep from turn to turn, and of games that have begun."""

from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np

from gamms.context import Context
from gamms.game.batch.begun import Begins
from gamms.game.batch.state import Arrays, GameArrays, NotTakenUp
from gamms.game.batch.view import ArrayView
from gamms.ir.graph import IntArray
from gamms.text import shown


class Kept(NamedTuple):
    """What an array form keeps of what agents remember.

    Attributes:
        begins: returns it of a game that has begun; see `gamms.array_strategy`.
        board: the key under which it writes into the memory of the team; None: it does not. No other part may do so: it
            would read what was written in the same turn.
    """

    begins: Begins
    board: str | None = None


def remembered(view: ArrayView, key: str, **first: int) -> dict[str, IntArray]:
    """Return what agents remember under a key of `state["memory"]`: name -> (games, agents), at first these numbers."""
    agents = len(view.roster.names)
    kept = view.keep(("memory", key), lambda games: {name: np.full((games, agents), n) for name, n in first.items()})
    return {name: column[np.ix_(view.games, view.agents)] for name, column in kept.items()}


def remember(view: ArrayView, key: str, **values: IntArray) -> None:
    """Keep what those agents remember from now on that are in the mask of a view."""
    kept = view.keep(("memory", key), lambda _: {})
    at, agents = np.nonzero(view.mask)
    for name, column in values.items():
        kept[name][view.games[at], view.agents[agents]] = column[at, agents]


def memories_in_arrays(
    ctx: Context,
    arrays: GameArrays,
    key: str,
    first: Mapping[str, int],
    read: Callable[[dict[Any, Any]], Sequence[int]],
) -> dict[Hashable, Arrays]:
    """Return what agents of a game remember under a key, as `remembered` has it of one game.

    Args:
        ctx: of the game.
        arrays: of the batch.
        key: as for `remembered`.
        first: the numbers of those that remember nothing, by name.
        read: returns such numbers, in this order, of a memory; none of one that has nothing of them.

    Raises:
        NotTakenUp: a memory has something else there, or a node that is not on the map any more.
    """
    found, memories = {name: np.full((1, len(arrays.roster.names)), n) for name, n in first.items()}, ctx.game.memories
    for number, name in enumerate(arrays.roster.names):
        with reading(f"the memory of agent {shown(name)}"):
            values = read(memories.get(name, {}))
            for column, value in zip(found.values() if values else (), values, strict=True):
                column[0, number] = value
    return {("memory", key): found}


def boards_in_arrays(ctx: Context, arrays: GameArrays, key: str) -> Iterator[tuple[int, dict[Any, Any]]]:
    """Yield the number of each memory, see `ArrayView.memory_of`, and what it has under a key of `shared_memory`."""
    roster, game = arrays.roster, ctx.game
    for number, agent in enumerate(np.unique(arrays.memory_of, return_index=True)[1].tolist()):
        team = roster.teams[roster.team_of[agent]]
        is_shared = team is not None and game.team_memory
        memory = game.team_memories.get(team, {}) if is_shared else game.memories.get(roster.names[agent], {})
        yield number, memory.get(key, {})


@contextmanager
def reading(what: str) -> Iterator[None]:
    """Let games leave the arrays that begin with something in a memory which no strategy of GAMMS has written so."""
    try:
        yield
    except (TypeError, ValueError, AttributeError, LookupError) as error:
        raise NotTakenUp(f"{what} has what no array form takes up: {error}") from error
