"""How things were at one moment of a recording, as arrays."""

from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from gamms.ir.tables import table_of
from gamms.recorder.detached import DetachedState
from gamms.recorder.keyframes import Columns
from gamms.typing.map_storage import IPackedGraph

_KINDS = np.array(["BASIC", "AERIAL"])  # the names of AgentType
_PARTS = {
    "position": ("x", "y", "z"),
    "heading": ("heading_x", "heading_y"),
    "quat": ("quat_w", "quat_x", "quat_y", "quat_z"),
}


@dataclass(frozen=True, eq=False)
class State:
    """How things were after a turn.

    Attributes:
        turn: how many turns were over.
        agents: read-only columns (agents,), one row for each agent in the order of their creation: name, team, kind
            ("BASIC" or "AERIAL"), alive, node, previous (node), speed, strategy; x, y and z of those who fly;
            heading_x and heading_y, which is where those on the ground were told to look; quat_w, quat_x, quat_y and
            quat_z, how those who fly are turned. What an agent does not have is NaN, or None.
        scores: by whatever the rules keep scores for.
        data: what rules had kept in `ctx.game.data`, as far as it was plain.
        over: why the game was over, who had won, whether time was up; None while it went on.
        components: by name, the fields of each with their values; None where one was not set.
    """

    turn: int
    agents: dict[str, np.ndarray[Any, Any]]
    scores: dict[Any, Any]
    data: dict[str, Any]
    over: dict[str, Any] | None
    components: dict[Any, dict[str, Any]]
    _map: Callable[[], IPackedGraph] = field(repr=False)

    @property
    def graph(self) -> IPackedGraph:
        """The map as it was then, read-only; while the recording is open."""
        return self._map()


def named_columns(columns: Columns) -> dict[str, np.ndarray[Any, Any]]:
    """Return the columns that seldom change."""
    lists = {"name": "names", "team": "teams", "speed": "speed", "strategy": "strategies"}
    table = table_of({name: columns[key] for name, key in lists.items()})
    return {name: _frozen(column) for name, column in table.items()}


def state_of(
    state: DetachedState, turn: int, named: dict[str, np.ndarray[Any, Any]], map_then: Callable[[], IPackedGraph]
) -> State:
    """Return a state for the caller to keep."""
    columns = state.agents.columns
    agents = {name: named[name] for name in ("name", "team")}
    agents["kind"] = _frozen(_KINDS[(columns["kind"] != 0).astype(np.int64)])
    agents["alive"] = _frozen(columns["alive"] != 0)
    agents |= {name: _frozen(columns[name].copy()) for name in ("node", "previous")}
    agents |= {name: named[name] for name in ("speed", "strategy")}
    for key, names in _PARTS.items():
        agents.update(zip(names, _frozen(columns[key].T.copy()), strict=True))
    game = deepcopy((state.game.data, state.game.over))
    return State(turn, agents, dict(state.game.scores), *game, deepcopy(state.components), map_then)


def _frozen(column: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    column.setflags(write=False)
    return column
