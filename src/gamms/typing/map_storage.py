"""Contracts of maps, which are a graph and its obstacles, as bytes and as snapshots; for engines, not for programs."""

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any

from gamms.ir.graph import ClosedEdges, GraphColumns, IntArray
from gamms.ir.obstacles import ObstacleColumns
from gamms.plugins import Registry
from gamms.typing.routes import RouteQueries

if TYPE_CHECKING:
    import networkx as nx


class IGraphSource(ABC):
    """A graph that has its columns at hand: `ctx.graph.attach_networkx_graph` takes these."""

    @abstractmethod
    def as_columns(self) -> tuple[GraphColumns, str | None]:
        """Return the graph as read-only arrays, and whom the data is by."""


class IPackedGraph(IGraphSource):
    """A map from its bytes, read-only, without a context.

    `ctx.graph.attach_networkx_graph` takes one, and keeps ids and order; `ctx.graph.storage.unpack(one.packed)` takes
    the obstacles, too.

    Attributes:
        packed: the bytes that `IMapStorage.pack` returned.
    """

    packed: bytes

    @abstractmethod
    def columns(self) -> GraphColumns:
        """Return the graph as read-only arrays."""

    def as_columns(self) -> tuple[GraphColumns, str | None]:
        """Return the graph as read-only arrays, and whom the data is by."""
        return self.columns(), self.attribution

    @abstractmethod
    def obstacle_columns(self) -> ObstacleColumns:
        """Return the obstacles as read-only arrays."""

    @abstractmethod
    def to_networkx(self) -> "nx.MultiDiGraph[int] | nx.DiGraph[int]":
        """Return the graph as a networkx graph: a DiGraph, or a MultiDiGraph where edges are parallel."""

    @property
    @abstractmethod
    def crs(self) -> str | None:
        """The coordinate reference system of x and y, such as 'EPSG:32635'."""

    @property
    @abstractmethod
    def attribution(self) -> str | None:
        """Whom the data is by."""


LeftOut = dict[tuple[str, str], list[int]]  # ("node" or "edge", name of an attribute) -> whose was left out


class IMapStorage(ABC):
    """Packs, unpacks, snapshots and restores the graph and the obstacles of a context: `ctx.graph.storage`."""

    @abstractmethod
    def pack(self) -> bytes:
        """Return graph, obstacles, CRS and attributes as the bytes that `save` writes.

        Raises:
            BadValue: an attribute is no plain value.
        """

    @abstractmethod
    def pack_savable(self) -> tuple[bytes, LeftOut]:
        """Return what `pack` returns, without the attributes that are no plain values, and which these are."""

    @abstractmethod
    def unpack(self, data: bytes) -> None:
        """Replace graph and obstacles by those that `pack` has packed.

        Raises:
            BadFile (ValueError): the bytes are damaged or foreign; nothing has changed.
            BadType (TypeError): they are no bytes.
        """

    @abstractmethod
    def snapshot(self) -> Any:
        """Return graph and obstacles as they are now, for `restore` and `copy_from`."""

    @abstractmethod
    def restore(self, before: Any) -> None:
        """Restore a snapshot of this context; what has not changed is left alone, its indexes too."""

    @abstractmethod
    def copy_from(self, snapshot: Any) -> None:
        """Replace graph and obstacles by those of a snapshot of another context, and share them until they change."""

    @abstractmethod
    def roads(self) -> tuple[IntArray, ClosedEdges]:
        """Return the ids of the edges, in their order, and those that are closed."""

    @property
    @abstractmethod
    def road_changes(self) -> int:
        """How many changes of the graph have only closed, opened or removed edges; its revision counts these, too."""

    @abstractmethod
    def detached(self) -> tuple[GraphColumns, RouteQueries]:
        """Return the graph as it is now and its routes, which stay so when this graph changes."""

    @abstractmethod
    def reopened(self) -> tuple[GraphColumns, RouteQueries]:
        """Return the graph on which closed roads are open, behind all other edges, and its routes.

        Edges that are closed and whose ids others have are not there.
        """

    @abstractmethod
    def restart_stream(self) -> None:
        """Restart the random stream that `ctx.graph.place` draws from."""


packed_graphs: Registry[IPackedGraph] = Registry("form of packed graphs", "gamms.packed_graphs", "gamms.graph")
"""What opens the bytes of a map: other engines find the class of `gamms.graph` here, under the name "gamms"."""
