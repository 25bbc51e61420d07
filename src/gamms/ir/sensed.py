"""What sensors saw, as columns: of many looks at once, and of the last look as a drawer needs it."""

from collections.abc import Callable, Hashable, Sequence, Sized
from dataclasses import dataclass, field
from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np

from gamms.ir.graph import FloatArray, IntArray


@dataclass(slots=True, frozen=True, eq=False)
class Sensed:
    """The results of many looks: look `i` saw `values[offsets[i]:offsets[i + 1]]`.

    What the values are depends on the kind of sensor: ids of nodes (and `edges`, ids of edges, likewise ragged); or
    positions in `names`, of agents; or, for a sensor that looks one by one, the `data` of each look, one per look.
    """

    offsets: IntArray  # (looks + 1,)
    values: "np.ndarray[Any, Any]"  # (values,)
    _edges: "Sensed | Callable[[], Sensed] | None" = None
    names: tuple[str, ...] = ()  # of agents
    places: "IntArray | FloatArray | None" = (
        None  # (values,) ids of the nodes, or (values, 3): where agents are reported
    )

    @property
    def edges(self) -> "Sensed | None":
        """The edges that were seen, of looks at the map; put together when asked for."""
        if callable(self._edges):
            object.__setattr__(self, "_edges", self._edges())
        return self._edges  # type: ignore[return-value] # it is called by now

    def __len__(self) -> int:
        return len(self.offsets) - 1

    def __getitem__(self, look: int) -> "np.ndarray[Any, Any]":
        """What one look saw."""
        look = range(len(self))[look]
        return self.values[self.offsets[look] : self.offsets[look + 1]]


@dataclass(slots=True, frozen=True, eq=False)
class Coverage:
    """Where a sensor would show agents at this moment: what follows from not seeing one."""

    node_ids: IntArray  # (nodes,) in insertion order
    detection: FloatArray  # (nodes,)  how probable it is that an agent on the node is noticed
    not_shown: tuple[str, ...]  # names of the agents that it does not show wherever they are: of other teams, dead
    is_exact: bool = True  # whether the agents that it shows are where it shows them at this moment
    is_convex: bool = False  # whether it covers all that lies in a straight line between nodes that it covers


class AgentLook(NamedTuple):
    """How a sensor shows agents, so that others may look in its place.

    Attributes:
        radius: map units; may be infinite.
        teams: the teams whose agents alone it shows; None: all.
        others: the teams whose agents it does not show.
        is_plain: whether it shows all these agents that are within the radius of its own one, where they are.
        is_late: whether it reports what it saw in earlier turns.
    """

    radius: float
    teams: tuple[Hashable, ...] | None = None
    others: tuple[Hashable, ...] = ()
    is_plain: bool = False
    is_late: bool = False

    def shows(self, team: Hashable) -> bool:
        """Whether it shows agents of a team where they are in view."""
        return (self.teams is None or team in self.teams) and team not in self.others


def _no_points() -> FloatArray:
    return np.zeros((0, 2))


@dataclass(slots=True, frozen=True, eq=False)
class SensorView:
    """What a sensor saw last, in map units: all that a drawer needs to know of it."""

    nodes: FloatArray = field(default_factory=_no_points)  # (nodes, 2)
    lines: FloatArray = field(default_factory=_no_points)  # (points, 2)  polylines of edges
    offsets: IntArray = field(default_factory=lambda: np.zeros(1, np.int64))  # (lines + 1,)  into `lines`
    agents: FloatArray = field(default_factory=_no_points)  # (agents, 2)
    names: tuple[
        str, ...
    ] = ()  # (agents,) of them, so that they can be found again; or none, where they may not be there
    outline: FloatArray = field(default_factory=_no_points)  # (corners, 2)  of the field of view; none: no bounds


def ragged(rows: list[list[int]]) -> tuple[IntArray, IntArray]:
    """Return offsets (rows + 1,) and values of lists of different lengths."""
    offsets = _offsets(rows)
    return offsets, np.fromiter((value for row in rows for value in row), np.int64, int(offsets[-1]))


def sensed_arrays(looks: Sequence[IntArray], edges: Callable[[], Sensed] | None = None) -> Sensed:
    """Return what looks saw, given as arrays."""
    return Sensed(_offsets(looks), np.concatenate(looks) if looks else np.zeros(0, np.int64), edges)


def _offsets(rows: Sequence[Sized]) -> IntArray:
    return np.fromiter(accumulate(map(len, rows), initial=0), np.int64, len(rows) + 1)
