"""Which agents are near a place: worked out once per change, and shared by all sensors that look for agents."""

from math import inf
from typing import NamedTuple

import numpy as np

from gamms.arguments import as_int
from gamms.errors import UnknownName
from gamms.ir.graph import FloatArray
from gamms.ir.obstacles import BoolArray
from gamms.ir.positions import Positions
from gamms.sensor.views import Place, Views, coordinates
from gamms.typing import IContext
from gamms.typing.graph_engine import IGraph

_MOST_IDS = 1 << 22  # of nodes: what may be remembered in all
_WIDE = 4096  # nodes: a disc with more is compared with the places of all agents instead


class Coordinates(NamedTuple):
    """Where all agents are on the map, in the order of their creation."""

    xyz: FloatArray  # (agents, 3)  of the node, at height 0, or of an agent that flies
    xy: FloatArray  # (agents, 2)  of the node
    is_flying: BoolArray  # (agents,)


class NearbyAgents:
    """The agents of one context, as sensors find them."""

    def __init__(self, ctx: IContext, views: Views) -> None:
        self._ctx = ctx
        self._views = views
        self._graph: IGraph | None = None
        self._key: tuple[Positions | None, int, int | None] = (None, 0, None)
        self._coordinates: Coordinates | None = None
        self._nodes_by_name: dict[str, int] | None = None
        self._revision: int | None = None  # of the graph that the discs are of
        self._discs: dict[float, dict[Place, tuple[int, ...] | None]] = {}
        self._ids: dict[int, int] = {}  # one object per id
        self._kept = 0

    def coordinates(self) -> Coordinates:
        """Return where all agents are on the map.

        Raises:
            UnknownName (KeyError): an agent stands on a node that was removed.
        """
        positions, graph = self._ctx.agent.positions, self._ctx.graph.graph
        key = (positions, positions.version, graph.revision)
        if self._coordinates is None or key != self._key or key[2] is None:
            xy = self._xy_of(positions)
            xyz, is_flying = np.column_stack([xy, np.zeros(len(xy))]), np.zeros(len(xy), np.bool_)
            xyz[positions.flyers], is_flying[positions.flyers] = positions.flyer_xyz, True
            self._coordinates = Coordinates(xyz, xy, is_flying)
            self._key, self._nodes_by_name = key, None
        return self._coordinates

    def nodes_by_name(self) -> dict[str, int]:
        """Return a fresh dict of all living agents: name -> id of the node."""
        self.coordinates()
        if self._nodes_by_name is None:
            positions = self._ctx.agent.positions
            names, nodes = positions.names, positions.nodes
            self._nodes_by_name = {names[row]: nodes[row] for row in positions.living.tolist()}
        return self._nodes_by_name.copy()

    def within(self, place: Place, radius: float) -> tuple[Positions, list[int]]:
        """Return where agents are, and the rows of those within `radius` of a place, the rim included.

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
        positions = self._ctx.agent.positions
        return positions, self._compared(place, radius) if disc is None else positions.rows_on(disc)

    def _forget(self, revision: int | None) -> None:
        self.coordinates()  # which finds agents on removed nodes
        self._revision, self._kept = revision, 0
        self._discs.clear()
        self._ids.clear()

    def _disc(self, place: Place, radius: float) -> tuple[int, ...] | None:
        """Return the ids of the nodes in a disc; None where there are too many to remember."""
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
        xy, living = self.coordinates().xy, self._ctx.agent.positions.living
        dx, dy = (xy[living] - coordinates(self._ctx, place)).T
        with np.errstate(over="ignore"):  # infinitely far away is far away
            rows: list[int] = living[dx * dx + dy * dy <= radius * radius].tolist()
        return rows

    def _xy_of(self, positions: Positions) -> FloatArray:
        graph, nodes = self._ctx.graph.graph, positions.node_ids
        try:
            return graph.positions(nodes)
        except UnknownName:
            lost = next(i for i, node in enumerate(nodes.tolist()) if not graph.has_node(node))
            raise UnknownName(f"node under agent {positions.names[lost]!r}:", int(nodes[lost])) from None
