"""Where all agents are: worked out once per change and shared by all sensors that look for agents."""

from math import inf
from typing import Any, NamedTuple

import numpy as np

from gamms.arguments import as_int
from gamms.errors import UnknownName
from gamms.ir.graph import FloatArray, IntArray
from gamms.sensor.views import Place, Views, coordinates
from gamms.typing import IContext
from gamms.typing.agent_engine import Roll, Standing
from gamms.typing.graph_engine import IGraph

_MOST_IDS = 1 << 22  # of nodes: what may be remembered in all
_WIDE = 4096  # nodes: a disc with more is compared with the places of all agents instead


class Snapshot(NamedTuple):
    """All agents at one moment, in the order of their creation."""

    names: list[str]
    teams: list[Any]
    nodes: IntArray  # (agents,)  ids
    xyz: FloatArray  # (agents, 3)  of the node, at height 0, or of an agent that flies
    xy: FloatArray  # (agents, 2)  of the node
    is_flying: "np.ndarray[tuple[int, ...], np.dtype[np.bool_]]"  # (agents,)
    living: IntArray  # rows of those who are alive


class Crowd:
    """The agents of one context."""

    def __init__(self, ctx: IContext, views: Views) -> None:
        self._ctx = ctx
        self._views = views
        self._graph: IGraph | None = None
        self._key: tuple[int | None, int | None] = (None, None)
        self._now: Snapshot | None = None
        self._everyone: dict[str, int] | None = None
        self._revision: int | None = None  # of the graph that the discs are of
        self._discs: dict[float, dict[Place, tuple[int, ...] | None]] = {}
        self._ids: dict[int, int] = {}  # one object per id
        self._kept = 0

    def now(self) -> Snapshot:
        """Where everybody is.

        Raises:
            UnknownName (KeyError): an agent stands on a node that was removed.
        """
        roll, graph = self._ctx.agent.roll(), self._ctx.graph.graph
        key = (roll.moves, graph.revision)
        if self._now is None or key != self._key or None in key:
            xy = self._positions(roll.names, roll.nodes)
            xyz, is_flying = np.column_stack([xy, np.zeros(len(xy))]), np.zeros(len(xy), np.bool_)
            xyz[roll.flying], is_flying[roll.flying] = roll.places, True
            self._now = Snapshot(list(roll.names), list(roll.teams), roll.nodes, xyz, xy, is_flying, _living(roll))
            self._key, self._everyone = key, None
        return self._now

    def everyone(self) -> dict[str, int]:
        """A fresh dict of all agents: name -> id of the node."""
        now = self.now()
        if self._everyone is None:
            rows = now.living.tolist()
            self._everyone = {
                now.names[row]: node for row, node in zip(rows, now.nodes[now.living].tolist(), strict=True)
            }
        return self._everyone.copy()

    def within(self, place: Place, radius: float) -> tuple[Standing, list[int]]:
        """Who is where, and the rows of those within `radius` of a place, the rim included.

        Raises:
            UnknownName (KeyError): there is no such node, or an agent stands on one that was removed.
        """
        graph = self._graph = self._graph or self._ctx.graph.graph
        revision = graph.revision
        if revision != self._revision or revision is None:
            self._forget(revision)
        try:
            disc = self._discs[radius][place]
        except (KeyError, TypeError):  # not known, or not hashable
            disc = self._disc(place if isinstance(place, tuple) else as_int(place, "The id of a node"), radius)
        standing = self._ctx.agent.standing()
        if disc is None:
            return standing, self._compared(place, radius)
        rows_at = standing.rows_at
        return standing, sorted([row for node in standing.taken.intersection(disc) for row in rows_at[node]])

    def _forget(self, revision: int | None) -> None:
        self.now()  # which finds agents on removed nodes
        self._revision, self._kept = revision, 0
        self._discs.clear()
        self._ids.clear()

    def _disc(self, place: Place, radius: float) -> tuple[int, ...] | None:
        """The ids of the nodes in a disc; None where there are too many to remember."""
        ids = None if radius == inf else self._views.known_ids(place, radius)
        if ids is None:
            x, y = coordinates(self._ctx, place)
            ids = [] if radius == inf else self._ctx.graph.graph.nodes_near(x, y, radius).ids.tolist()
        # NOTE: a tuple of shared ints is a sixth of a set, and what counts is how much memory a look touches
        # (benchmarks/README.md, 1,000 agents in Helsinki).
        disc = tuple([self._ids.setdefault(id, id) for id in ids])
        kept = disc if radius != inf and len(disc) <= _WIDE else None
        if self._kept > _MOST_IDS:
            self._discs.clear()
            self._kept = 0
        self._discs.setdefault(radius, {})[place] = kept
        self._kept += 16 + len(kept or ())
        return kept

    def _compared(self, place: Place, radius: float) -> list[int]:
        now = self.now()
        dx, dy = (now.xy[now.living] - coordinates(self._ctx, place)).T
        with np.errstate(over="ignore"):  # infinitely far away is far away
            rows: list[int] = now.living[dx * dx + dy * dy <= radius * radius].tolist()
        return rows

    def _positions(self, names: list[str], nodes: IntArray) -> FloatArray:
        graph = self._ctx.graph.graph
        try:
            return graph.positions(nodes)
        except UnknownName:
            lost = next(i for i, node in enumerate(nodes.tolist()) if not graph.has_node(node))
            raise UnknownName(f"node under agent {names[lost]!r}:", int(nodes[lost])) from None


def _living(roll: Roll) -> IntArray:
    rows = np.arange(len(roll.names))
    return np.delete(rows, list(roll.out)) if roll.out else rows
