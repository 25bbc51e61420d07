"""Sensor results as columns: of many looks at once, and of the last look for drawing."""

from collections.abc import Callable, Hashable, Sequence, Sized
from dataclasses import dataclass, field
from itertools import accumulate, chain
from typing import Any, NamedTuple

import numpy as np

from gamms.ir.graph import FloatArray, IntArray


@dataclass(slots=True, frozen=True, eq=False)
class LookResults:
    """The results of many looks: look `i` has `values[offsets[i]:offsets[i + 1]]`.

    The values depend on the type of sensor: node ids (with edge ids in `edges`, also ragged); or, for agents, indices
    in `names`; or, for a sensor that looks one by one, the `data` of each look, one per look.
    """

    offsets: IntArray  # (looks + 1,)
    values: "np.ndarray[Any, Any]"  # (values,)
    _edges: "LookResults | Callable[[], LookResults] | None" = None
    names: tuple[str, ...] = ()  # of agents
    places: "IntArray | FloatArray | None" = None  # (values,) node ids, or (values, 3): reported positions of agents

    @property
    def edges(self) -> "LookResults | None":
        """The seen edges, for sensors of the map; computed on access."""
        if callable(self._edges):
            object.__setattr__(self, "_edges", self._edges())
        return self._edges  # type: ignore[return-value] # it is called by now

    def __len__(self) -> int:
        return len(self.offsets) - 1

    def __getitem__(self, look: int) -> "np.ndarray[Any, Any]":
        """Return the values of one look."""
        look = range(len(self))[look]
        return self.values[self.offsets[look] : self.offsets[look + 1]]


@dataclass(slots=True, frozen=True, eq=False)
class Coverage:
    """The nodes on which a sensor would show agents at this moment, to infer from not seeing them."""

    node_ids: IntArray  # (nodes,) in insertion order
    detection: FloatArray  # (nodes,)  probability that an agent on the node is detected
    not_shown: tuple[str, ...]  # names of agents that it never shows: of other teams, or dead
    is_exact: bool = True  # whether the shown positions are exact and up to date
    is_convex: bool = False  # whether it covers the straight line between any two covered nodes


class AgentLook(NamedTuple):
    """A description of how a sensor shows agents, for shared looks.

    Attributes:
        radius: map units; may be infinite.
        teams: the only teams that it shows; None: all.
        others: teams that it does not show.
        is_plain: whether it shows all these agents within the radius, at their exact positions.
        is_late: whether it reports earlier turns.
    """

    radius: float
    teams: tuple[Hashable, ...] | None = None
    others: tuple[Hashable, ...] = ()
    is_plain: bool = False
    is_late: bool = False

    def is_showing(self, team: Hashable) -> bool:
        """Return whether it shows agents of a team."""
        return (self.teams is None or team in self.teams) and team not in self.others


def _make_no_points() -> FloatArray:
    return np.zeros((0, 2))


@dataclass(slots=True, frozen=True, eq=False)
class SensorView:
    """The last view of a sensor, in map units, for drawing."""

    nodes: FloatArray = field(default_factory=_make_no_points)  # (nodes, 2)
    lines: FloatArray = field(default_factory=_make_no_points)  # (points, 2)  polylines of edges
    offsets: IntArray = field(default_factory=lambda: np.zeros(1, np.int64))  # (lines + 1,)  into `lines`
    agents: FloatArray = field(default_factory=_make_no_points)  # (agents, 2)
    names: tuple[str, ...] = ()  # (agents,) their names, to find them again; or empty, if they may be elsewhere
    outline: FloatArray = field(default_factory=_make_no_points)  # (corners, 2)  of the field of view; empty: unlimited
    carrier: str | None = None  # the agent with which the field of view moves in pictures; None: it stays
    reach: FloatArray = field(default_factory=_make_no_points)  # (corners, 2)  the field of view if nothing blocked it
    is_early: bool = False  # whether it was reported before the carrier's last move: its field of view stays there

    @property
    def dashed(self) -> FloatArray:
        """The corners (corners, 2) of the reach if the outline of the visible part is unknown; else empty."""
        return self.reach[:0] if len(self.outline) else self.reach


def flatten_lists(rows: list[list[int]]) -> tuple[IntArray, IntArray]:
    """Return offsets (rows + 1,) and values of lists of different lengths."""
    offsets = _compute_offsets(rows)
    return offsets, np.fromiter(chain.from_iterable(rows), np.int64, int(offsets[-1]))


def make_results(looks: Sequence[IntArray], edges: Callable[[], LookResults] | None = None) -> LookResults:
    """Return the results of looks, given as arrays."""
    return LookResults(_compute_offsets(looks), np.concatenate(looks) if looks else np.zeros(0, np.int64), edges)


def _compute_offsets(rows: Sequence[Sized]) -> IntArray:
    return np.fromiter(accumulate(map(len, rows), initial=0), np.int64, len(rows) + 1)
