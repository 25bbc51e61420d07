"""The part of a graph that answers questions about ways and places on the map."""

from typing import TYPE_CHECKING, Any, cast

from gamms.graph import coordinates, positions
from gamms.graph.routes import Routes
from gamms.graph.tables import NodeTable
from gamms.ir.graph import FloatArray
from gamms.typing.graph_engine import IGraph, NodeIds, Numbers

if TYPE_CHECKING:
    from numpy.random import Generator

    from gamms.graph.graph import Graph


class Ways(IGraph):
    """Ways by the index of routes, places by the index of nodes and the projection of the map."""

    _routes: Routes
    _nodes: NodeTable
    _changes: list[int]
    _crs: str | None

    def shortest_path(self, source: int, target: int, weight: str | None = "length") -> list[int]:
        """Ids of the nodes on the shortest way from one node to another, both included."""
        return self._routes.shortest_path(source, target, weight)

    def distance(self, source: int, target: int, weight: str | None = "length") -> float:
        """How far it is from one node to another; infinite where there is no way."""
        # NOTE: many strategies ask this in each turn, of targets they asked for before (benchmarks/README.md, Paths).
        cache = self._routes.cache
        if cache.revision == self._changes[0] and type(source) is int and type(target) is int:
            try:
                known = cache.kept.get((weight, target))
            except TypeError:  # a weight that is not hashable
                known = None
            if known is not None and (row := self._nodes.index.row(source)) >= 0:
                far: float = known[0][row]
                return far
        return self._routes.distance(source, target, weight)

    def distances(
        self,
        source: NodeIds | None = None,
        target: NodeIds | None = None,
        weight: str | None = "length",
        cutoff: float | None = None,
    ) -> dict[int, float]:
        """How far it is from a node to every other, or from every other to a node."""
        return self._routes.distances(source, target, weight, cutoff)

    def distance_matrix(self, sources: NodeIds, targets: NodeIds, weight: str | None = "length") -> FloatArray:
        """How far it is from each of some nodes to each of others, (sources, targets)."""
        return self._routes.distance_matrix(sources, targets, weight)

    def to_latlon(self, x: Numbers, y: Numbers) -> tuple[Any, Any]:
        """Degrees of latitude and longitude of (x, y)."""
        return coordinates.to_latlon(self._crs, x, y)

    def from_latlon(self, *, lat: Numbers, lon: Numbers) -> tuple[Any, Any]:
        """(x, y) of degrees of latitude and longitude."""
        return coordinates.from_latlon(self._crs, lat, lon)

    def nearest_node(
        self,
        x: Numbers | None = None,
        y: Numbers | None = None,
        *,
        lat: Numbers | None = None,
        lon: Numbers | None = None,
    ) -> Any:
        """The id of the node nearest to a place, or the ids (places,) of those nearest to several."""
        return positions.nearest_node(cast("Graph", self), (x, y), (lat, lon))

    def place(
        self,
        n: int,
        near: int | tuple[float, float] | None = None,
        radius: float | None = None,
        apart: float = 0.0,
        rng: "Generator | int | None" = None,
    ) -> list[int]:
        """Ids of `n` different nodes, drawn at random."""
        return positions.place(cast("Graph", self), n, near, radius, apart, rng)
