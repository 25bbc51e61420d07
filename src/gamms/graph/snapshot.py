"""The tables of a graph as columns that stay as they are."""

from copy import deepcopy
from typing import Any, Self

from gamms import kernels
from gamms.deciding import DecidePhase
from gamms.graph.tables import EdgeTable, NodeTable
from gamms.ir.graph import GraphColumns


def snapshot(nodes: NodeTable, edges: EdgeTable, revision: int, crs: str | None) -> GraphColumns:
    """One revision of a graph whose tables have no dead rows."""
    offsets, out_edges = kernels.group_rows(edges.array("sources"), nodes.count)
    offsets.setflags(write=False)
    out_edges.setflags(write=False)
    return GraphColumns(
        node_ids=nodes.frozen("ids"),
        xy=nodes.frozen("xy"),
        edge_ids=edges.frozen("ids"),
        sources=edges.frozen("sources"),
        targets=edges.frozen("targets"),
        lengths=edges.frozen("lengths"),
        offsets=offsets,
        out_edges=out_edges,
        bends=dict(edges.bends),
        node_attributes={name: dict(values) for name, values in nodes.attributes.items() if values},
        edge_attributes={name: dict(values) for name, values in edges.attributes.items() if values},
        revision=revision,
        crs=crs,
    )


class Copied:
    """Copies and pickles a graph by what it holds; its indexes are made anew."""

    _snapshot: Any
    replace: Any
    attribution: str | None
    _phase: DecidePhase

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle."""
        return _rebuilt, (type(self), self._snapshot(), self.attribution)

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        """Copy, for a look ahead into a game that goes on elsewhere."""
        copied = memo[id(self)] = type(self)()
        copied._phase = deepcopy(self._phase, memo)
        copied.replace(deepcopy(self._snapshot(), memo))
        copied.attribution = self.attribution
        return copied


def _rebuilt(kind: Any, columns: GraphColumns, attribution: str | None) -> Any:
    graph = kind()
    graph.replace(columns)
    graph.attribution = attribution
    return graph
