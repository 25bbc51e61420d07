"""The road network as columns: what every kernel and every drawer reads."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

IntArray = np.ndarray[Any, np.dtype[np.int64]]
FloatArray = np.ndarray[Any, np.dtype[np.float64]]


@dataclass(slots=True, frozen=True, eq=False)
class GraphColumns:
    """One revision of a graph; all arrays are read-only.

    Rows are in insertion order. The edges leaving node row `i` are the edge rows
    `out_edges[offsets[i]:offsets[i + 1]]`, in insertion order.
    """

    node_ids: IntArray  # (nodes,)
    xy: FloatArray  # (nodes, 2)  map units, metres for road networks
    edge_ids: IntArray  # (edges,)
    sources: IntArray  # (edges,)  node rows
    targets: IntArray  # (edges,)  node rows
    lengths: FloatArray  # (edges,)
    offsets: IntArray  # (nodes + 1,)
    out_edges: IntArray  # (edges,)  edge rows, grouped by source
    polylines: Mapping[int, FloatArray]  # edge row -> (points, 2), for the edges that are not straight
    node_attributes: Mapping[str, Mapping[int, Any]]  # name -> node row -> value
    edge_attributes: Mapping[str, Mapping[int, Any]]  # name -> edge row -> value
    revision: int
    crs: str | None


def shortest_edges(columns: GraphColumns) -> dict[tuple[int, int], float]:
    """Return (source id, target id) -> the length of the shortest edge from the one to the other."""
    lengths: dict[tuple[int, int], float] = {}
    ends = columns.node_ids[columns.sources].tolist(), columns.node_ids[columns.targets].tolist()
    for source, target, length in zip(*ends, columns.lengths.tolist(), strict=True):
        known = lengths.get((source, target))
        lengths[source, target] = length if known is None else min(known, length)
    return lengths
