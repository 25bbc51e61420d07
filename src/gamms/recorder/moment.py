"""How things were at one moment of a recording, as arrays."""

from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from gamms.ir.tables import table_of
from gamms.recorder import state
from gamms.recorder.errors import Damaged
from gamms.text import reason
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


def roster_of(folded: state.State) -> dict[str, np.ndarray[Any, Any]]:
    """The columns that seldom change."""
    lists = {"name": "names", "team": "teams", "speed": "speed", "strategy": "strategies"}
    columns = table_of({name: folded[key] for name, key in lists.items()})
    return {name: _frozen(column) for name, column in columns.items()}


def state_of(
    folded: state.State, turn: int, roster: dict[str, np.ndarray[Any, Any]], map_then: Callable[[], IPackedGraph]
) -> State:
    """A state for the caller to keep.

    Raises:
        Damaged: scores are not what they should be.
    """
    agents = {name: roster[name] for name in ("name", "team")}
    agents["kind"] = _frozen(_KINDS[(folded["kind"] != 0).astype(np.int64)])
    agents["alive"] = _frozen(folded["alive"] != 0)
    agents["node"] = _frozen(folded["node"].copy())
    agents["previous"] = _frozen(folded["previous"].copy())
    agents |= {name: roster[name] for name in ("speed", "strategy")}
    for key, names in _PARTS.items():
        columns = _frozen(folded[key].T.copy())
        agents.update(zip(names, columns, strict=True))
    try:
        scores = dict(folded["scores"])
    except (TypeError, ValueError) as error:
        raise Damaged(f"its scores are none ({reason(error)})") from error
    data, over, components = (deepcopy(folded[name]) for name in ("data", "over", "components"))
    return State(turn, agents, scores, data, over, components, map_then)


def _frozen(column: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    column.setflags(write=False)
    return column
