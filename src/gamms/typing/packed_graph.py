"""Contract of a graph that is looked at on its own, from its bytes, without a context."""

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING

from gamms.ir.graph import GraphColumns
from gamms.ir.obstacles import ObstacleColumns
from gamms.plugins import Registry

if TYPE_CHECKING:
    import networkx as nx


class IPackedGraph(ABC):
    """A graph and its obstacles, read-only.

    `ctx.graph.attach_networkx_graph` takes one, and keeps ids and order; `ctx.graph.unpack(one.packed)` takes the
    obstacles, too.

    Attributes:
        packed: the bytes that `ctx.graph.packed` gave.
    """

    packed: bytes

    @abstractmethod
    def columns(self) -> GraphColumns:
        """The graph as read-only arrays."""

    @abstractmethod
    def obstacle_columns(self) -> ObstacleColumns:
        """The obstacles as read-only arrays."""

    @abstractmethod
    def to_networkx(self) -> "nx.MultiDiGraph[int] | nx.DiGraph[int]":
        """The graph as a networkx graph: a DiGraph, or a MultiDiGraph where edges are parallel."""

    @property
    @abstractmethod
    def crs(self) -> str | None:
        """The coordinate reference system of x and y, such as 'EPSG:32635'."""

    @property
    @abstractmethod
    def attribution(self) -> str | None:
        """Whom the data is by."""


packed_graphs: Registry[IPackedGraph] = Registry("form of packed graphs", "gamms.packed_graphs")
"""What opens the bytes of a graph. The graph room answers to "gamms"; others ask here, for rooms do not know it."""
