"""Contracts of the storage of maps (graph and obstacles) as bytes and as snapshots; for engines, not for programs."""

from abc import ABC, abstractmethod
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from gamms.ir.graph import ClosedEdges, GraphColumns, IntArray
from gamms.ir.obstacles import ObstacleColumns
from gamms.plugins import Registry
from gamms.typing.routes import RouteQueries

if TYPE_CHECKING:
    import networkx as nx


class IGraphSource(ABC):
    """A graph that provides its columns, for `ctx.graph.attach_networkx_graph`."""

    @abstractmethod
    def as_columns(self) -> tuple[GraphColumns, str | None]:
        """Return the graph as read-only arrays, and the authors of the data."""


class IPackedGraph(IGraphSource):
    """A read-only map in packed bytes, without a context.

    `ctx.graph.attach_networkx_graph` adds its graph, with its ids and order; `ctx.graph.storage.unpack(one.packed)`
    also loads the obstacles.

    Attributes:
        packed: the bytes from `IMapStorage.pack`.
    """

    packed: bytes

    @abstractmethod
    def columns(self) -> GraphColumns:
        """Return the graph as read-only arrays."""

    def as_columns(self) -> tuple[GraphColumns, str | None]:
        """Return the graph as read-only arrays, and the authors of the data."""
        return self.columns(), self.attribution

    @abstractmethod
    def obstacle_columns(self) -> ObstacleColumns:
        """Return the obstacles as read-only arrays."""

    @abstractmethod
    def to_networkx(self) -> "nx.MultiDiGraph[int] | nx.DiGraph[int]":
        """Return the graph as a networkx graph: a DiGraph, or a MultiDiGraph if there are parallel edges."""

    @property
    @abstractmethod
    def crs(self) -> str | None:
        """The coordinate reference system of x and y, for example 'EPSG:32635'."""

    @property
    @abstractmethod
    def attribution(self) -> str | None:
        """The authors of the data."""


LeftOut = dict[tuple[str, str], list[int]]  # ("node" or "edge", attribute name) -> ids whose value was left out


class IMapStorage(ABC):
    """Packs, unpacks, snapshots and restores the graph and the obstacles of a context: `ctx.graph.storage`."""

    @abstractmethod
    def pack(self) -> bytes:
        """Return graph, obstacles, CRS and attributes as the bytes that `save` writes.

        Raises:
            BadValue: an attribute is not a plain value.
        """

    @abstractmethod
    def pack_savable(self) -> tuple[bytes, LeftOut]:
        """Pack the map without attributes that are not plain values; also return the names of these attributes."""

    @abstractmethod
    def unpack(self, data: bytes) -> None:
        """Replace the graph and the obstacles by a map packed by `pack`.

        Raises:
            BadFile (ValueError): the bytes are damaged or foreign; nothing has changed.
            BadType (TypeError): not bytes.
        """

    @abstractmethod
    def snapshot(self) -> Any:
        """Return the present graph and obstacles, for `restore` and `copy_from`."""

    @abstractmethod
    def restore(self, before: Any) -> None:
        """Restore a snapshot of this context; unchanged parts keep their indexes."""

    @abstractmethod
    def copy_from(self, snapshot: Any) -> None:
        """Share the graph and the obstacles of another context's snapshot, until one of the contexts changes them."""

    @abstractmethod
    def note_mode(self, mode: str) -> None:
        """Let a mode of agents be known, although no edge may have its attribute any more."""

    @abstractmethod
    def list_roads(self) -> tuple[IntArray, ClosedEdges]:
        """Return the ids of all edges in insertion order, and the closed edges."""

    @abstractmethod
    def count_changes(self) -> tuple[int, int, int, bool]:
        """Return four values that tell whether the map was changed.

        They are the revision of the graph, the number of changes that only closed, opened or removed edges, the
        revision of the obstacles, and whether `ctx.graph.place` has drawn random numbers.
        """

    @abstractmethod
    def detach_graph(self) -> tuple[GraphColumns, RouteQueries]:
        """Return the present graph and its routes; both stay the same when this graph changes."""

    @abstractmethod
    def get_edges_as_given(self, ids: Iterable[int]) -> ClosedEdges:
        """Return edges in the form of `add_edge`, by id."""

    @abstractmethod
    def extend_graph(self, edges: ClosedEdges) -> tuple[GraphColumns, RouteQueries]:
        """Return the graph with more edges, after all others, and its routes; edges with known ids are left out."""

    @abstractmethod
    def restart_stream(self) -> None:
        """Restart the random stream of `ctx.graph.place`."""


packed_graphs: Registry[IPackedGraph] = Registry("form of packed graphs", "gamms.packed_graphs", "gamms.graph")
"""Registered readers of packed maps: other engines use the class of `gamms.graph`, named "gamms"."""
