"""The state after a turn of a recording."""

from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from gamms.ir.graph import FloatArray, read_only
from gamms.ir.schema import RECORDED_NUMBERS
from gamms.recorder.detached import DetachedState
from gamms.typing.map_storage import IPackedGraph

_KINDS = np.array(["BASIC", "AERIAL"])  # the names of AgentType
_PARTS = {
    "position": ("x", "y", "z"),
    "heading": ("heading_x", "heading_y"),
    "quat": ("quat_w", "quat_x", "quat_y", "quat_z"),
}


@dataclass(frozen=True, eq=False)
class State:
    """The state after a turn.

    Attributes:
        turn: number of turns before.
        agents: read-only columns (agents,), one row per agent in order of creation: name, team, kind ("BASIC" or
            "AERIAL"), alive, node, previous (node), speed, strategy; x, y and z of flying agents; heading_x and
            heading_y, the headings set for agents on the ground; quat_w, quat_x, quat_y and quat_z, the rotations of
            flying agents. Missing values are NaN or None. In games by metres also edge_source, edge_target (nodes),
            edge (id) and edge_share of agents on an edge; for others the share is NaN, and the ids are -1.
        scores: scores by the keys of the rules.
        data: plain values of `ctx.game.data`.
        over: the reason, the winner, and whether time was up; None while the game continued.
        components: name -> values by field; None for fields that were not set.
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
        """The read-only map of that time; while the recording is open."""
        return self._map()

    def xy(self) -> FloatArray:
        """Return the positions of the agents, (agents, 2), map units; NaN for agents without a position."""
        from gamms.recorder import tracks  # which few need

        return tracks.make_positions(self.agents, self._map().columns())[:, :2]


class MapOfState:
    """The map of a state, which is read from its recording when it is needed; a pickled one has been read.

    Args:
        read: reads the map.
    """

    def __init__(self, read: Callable[[], IPackedGraph]) -> None:
        self._read = read

    def __call__(self) -> IPackedGraph:
        """Return the map."""
        return self._read()

    def __deepcopy__(self, _: object) -> "MapOfState":
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        return _make_known_map, (self._read(),)


def _make_known_map(graph: IPackedGraph) -> MapOfState:
    return MapOfState(lambda: graph)


def copy_state(
    state: DetachedState, turn: int, named: dict[str, np.ndarray[Any, Any]], map_then: Callable[[], IPackedGraph]
) -> State:
    """Return an independent state for the caller."""
    columns = state.agents.columns
    agents = {name: named[name] for name in ("name", "team")}
    agents["kind"] = read_only(_KINDS[(columns["kind"] != 0).astype(np.int64)])
    agents["alive"] = read_only(columns["alive"] != 0)
    agents |= {name: read_only(columns[name].copy()) for name in ("node", "previous")}
    agents |= {name: named[name] for name in ("speed", "strategy")}
    agents |= {one.name: read_only(columns[one.name].astype(one.kind)) for one in RECORDED_NUMBERS}
    for key, names in _PARTS.items():
        agents.update(zip(names, read_only(columns[key].T.copy()), strict=True))
    is_on_edge = columns["edge_motion"] != 0
    if is_on_edge.any():
        for name, key in {"edge_source": "edge_source", "edge_target": "edge_target", "edge": "edge_id"}.items():
            agents[name] = read_only(np.where(is_on_edge, columns[key], -1))
        agents["edge_share"] = read_only(np.where(is_on_edge, columns["edge_share"], np.nan))
    game = deepcopy((state.game.data, state.game.over))
    return State(turn, agents, dict(state.game.scores), *game, deepcopy(state.components), MapOfState(map_then))
