"""What sensors saw, as columns: of many looks at once, and of the last look as a drawer needs it."""

from collections.abc import Callable, Hashable, Sequence, Sized
from dataclasses import dataclass, field
from itertools import accumulate
from math import inf
from typing import Any, NamedTuple

import numpy as np

from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray


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
    """How a sensor shows agents, in a form that is computed for many games at once; equal if two show the same.

    Attributes:
        radius: map units, of one that looks from the air in space; may be infinite.
        place: (x, y) to look from, in the air (x, y, z), or None: from where the agent is that carries it.
        cone: heading (cos, sin) and full opening angle; None: all around.
        teams: the teams whose agents alone it shows; None: all.
        others: the teams whose agents it does not show.
        chances: pairs (distance, probability) of noticing an agent; None: always.
        draws: the names of the sensor and of its owner, which what is drawn follows from; None: nothing is drawn.
        height: of its sight lines above the ground; None: obstacles hide nothing.
        hides: returns which nodes (ids of nodes,) obstacles hide from a node, or from `place`.
        hides_pairs: returns which agents obstacles hide from others, (pairs,), where some are on edges: called with the
            ids of the nodes that those who look have passed last, where they are (pairs, 2), which of them are on
            edges, and likewise the ids of nodes and the places of those that they look at.
        chance: returns probabilities of noticing agents at distances, (agents,); None: `chances` says them.
        noise: the standard deviation of the error of a reported place along each axis, map units; 0.0: no error.
        nearest: returns the ids of the nodes that are nearest to places x and y.
        turns: whether the cone turns with the agent that carries it.
        false_alarms: how many agents are to be expected in a look that are reported falsely.
        covers: returns the ids of the nodes that are in view from a node, or from `place`, all around if it turns.
        delay: how many turns old the look is that is reported.
        quat: how one that looks from the air is turned, `(w, x, y, z)`, relative to the agent that carries it, at a
            fixed place by itself; None: it looks along the ground.
        fov: the full opening angle of its cone, radians.
        in_line: returns between which points, (pairs, 3) both, no obstacle is; None: obstacles hide nothing in the air.
    """

    radius: float
    place: tuple[float, ...] | None = None
    cone: tuple[tuple[float, float], float] | None = None
    teams: tuple[Hashable, ...] | None = None
    others: tuple[Hashable, ...] = ()
    chances: tuple[tuple[float, float], ...] | None = None
    draws: tuple[str, str] | None = None
    height: float | None = None
    hides: "Callable[[int, IntArray], BoolArray] | None" = None
    hides_pairs: "Callable[[IntArray, FloatArray, BoolArray, IntArray, FloatArray], BoolArray] | None" = None
    chance: "Callable[[FloatArray], FloatArray] | None" = None
    noise: float = 0.0
    nearest: "Callable[[FloatArray, FloatArray], IntArray] | None" = None
    turns: bool = False
    false_alarms: float = 0.0
    covers: "Callable[[int], IntArray] | None" = None
    delay: int = 0
    quat: tuple[float, float, float, float] | None = None
    fov: float = inf
    in_line: "Callable[[FloatArray, FloatArray], BoolArray] | None" = None

    @property
    def errs(self) -> bool:
        """Whether agents may be reported where they are not."""
        return bool(self.noise or self.false_alarms or self.delay)

    @property
    def what(self) -> "AgentLook":
        """The same without what is others for each sensor though they look alike."""
        return self._replace(hides=None, hides_pairs=None, draws=None, nearest=None, covers=None, in_line=None)

    def shows(self, team: Hashable) -> bool:
        """Whether it shows agents of a team where they are in view."""
        return (self.teams is None or team in self.teams) and team not in self.others


class NodeLook(NamedTuple):
    """How a sensor shows nodes, in a form that is computed for many games at once; equal if two show the same.

    Attributes:
        radius: map units; may be infinite; None: it shows the nodes that edges lead to, itself first.
        place: (x, y) to look from, or None: from the node of the agent that carries it; in the air as for `AgentLook`.
        cone: heading (cos, sin) and full opening angle; None: all around.
        height: of its sight lines above the ground; None: obstacles hide nothing.
        from_node: returns the ids of the nodes that it shows from a node, or from `place`, and all around if the cone
            turns; None: what the rest says.
        turns: whether the cone turns with the agent that carries it.
        quat, fov, in_line: of one that looks from the air; see `AgentLook`.
    """

    radius: float | None
    place: tuple[float, ...] | None = None
    cone: tuple[tuple[float, float], float] | None = None
    height: float | None = None
    from_node: "Callable[[int], IntArray] | None" = None
    turns: bool = False
    quat: tuple[float, float, float, float] | None = None
    fov: float = inf
    in_line: "Callable[[FloatArray, FloatArray], BoolArray] | None" = None


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
