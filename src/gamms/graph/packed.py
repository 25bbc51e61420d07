"""A map as bytes, looked at on its own: read-only, without a context."""

from collections.abc import Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from gamms.errors import BadFile, BadValue
from gamms.graph.contents import Contents
from gamms.graph.graph import Graph
from gamms.graph.obstacles import Obstacles
from gamms.ir.graph import GraphColumns
from gamms.ir.obstacles import ObstacleColumns
from gamms.typing.packed_graph import IPackedGraph, packed_graphs

if TYPE_CHECKING:
    import networkx as nx


@packed_graphs.register("gamms")
class PackedGraph(IPackedGraph):
    """A graph and its obstacles in the bytes that `ctx.graph.packed` gave; they are opened when first asked for.

    Every call raises BadFile (ValueError) where the bytes are damaged.

    Args:
        packed: the bytes.
    """

    def __init__(self, packed: bytes) -> None:
        if not isinstance(packed, bytes):
            raise BadFile(f"A packed graph is bytes, not {type(packed).__name__}")
        self.packed = packed

    def __repr__(self) -> str:
        """Say how large it is."""
        columns = self.columns()
        return f"{type(self).__name__}({len(columns.node_ids)} nodes, {len(columns.edge_ids)} edges)"

    def columns(self) -> GraphColumns:
        """The graph as read-only arrays."""
        return self._graph.columns()

    def obstacle_columns(self) -> ObstacleColumns:
        """The obstacles as read-only arrays."""
        obstacles = Obstacles()
        obstacles.replace(self._contents.faces)
        return obstacles.columns()

    def to_networkx(self) -> "nx.MultiDiGraph[int] | nx.DiGraph[int]":
        """The graph as a networkx graph: a DiGraph, or a MultiDiGraph where edges are parallel."""
        return self._graph.to_networkx()

    @property
    def crs(self) -> str | None:
        """The coordinate reference system of x and y, such as 'EPSG:32635'."""
        return self._contents.columns.crs

    @property
    def attribution(self) -> str | None:
        """Whom the data is by."""
        return self._contents.attribution

    @cached_property
    def _contents(self) -> Contents:
        from gamms.graph import file

        return file.decode(self.packed)

    @cached_property
    def _graph(self) -> Graph:
        graph = Graph()
        graph.replace(self._contents.columns)
        graph.attribution = self._contents.attribution
        return graph


def attach(graph: Graph, packed: PackedGraph) -> None:
    """Add the nodes and edges of a packed graph to `graph`, with their ids and in their order, all or nothing.

    Raises:
        BadValue (ValueError): the bytes are damaged, an id is there already, or the CRS is another.
    """
    try:
        columns = packed.columns()
        if len(graph) and None not in (columns.crs, graph.crs) and columns.crs != graph.crs:
            raise BadValue(f"its CRS is {columns.crs}, that of the graph is {graph.crs}; project it first")
        graph._nodes.index.refuse_duplicates(columns.node_ids, graph._nodes.kind)
        graph._edges.index.refuse_duplicates(columns.edge_ids, graph._edges.kind)
    except (ValueError, KeyError) as error:
        raise BadValue(f"Failed to attach the graph: {error}") from error
    nodes, edges = graph._nodes, graph._edges
    first = nodes.extend(columns.node_ids, xy=columns.xy)
    _add_attributes(nodes.attributes, first, columns.node_attributes)
    # The new rows lie side by side, so what were rows among them is now rows behind the first.
    ends = {"sources": columns.sources + np.int64(first), "targets": columns.targets + np.int64(first)}
    first = edges.extend(columns.edge_ids, lengths=columns.lengths, **ends)
    edges.bends.update({first + row: bend for row, bend in columns.bends.items()})
    _add_attributes(edges.attributes, first, columns.edge_attributes)
    graph.crs = columns.crs or graph.crs
    graph.attribution = packed.attribution or graph.attribution
    graph._forget_indexes()


def _add_attributes(columns: dict[str, dict[int, Any]], first: int, given: Mapping[str, Mapping[int, Any]]) -> None:
    for name, values in given.items():
        columns.setdefault(name, {}).update({first + row: value for row, value in values.items()})
