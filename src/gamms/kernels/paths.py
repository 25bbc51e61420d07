"""Distances along edges."""

from heapq import heappop, heappush

import numpy as np

from gamms.ir.graph import FloatArray, GraphColumns, IntArray
from gamms.kernels.csr import group_rows


def distances_to(graph: GraphColumns, rows: IntArray) -> FloatArray:
    """The length of the shortest way from every node to the nearest of some nodes.

    Dijkstra's algorithm (1959) with a binary heap, on the reversed edges.

    Args:
        graph: the columns of a graph; its lengths are not negative.
        rows: of the nodes to go to.

    Returns:
        (nodes,) map units; infinite where there is no way.
    """
    offsets, edges = (column.tolist() for column in group_rows(graph.targets, len(graph.node_ids)))
    sources, lengths = graph.sources.tolist(), graph.lengths.tolist()
    distances = [float("inf")] * len(graph.node_ids)
    heap = [(0.0, row) for row in sorted(rows.tolist())]
    for _, row in heap:
        distances[row] = 0.0
    while heap:
        distance, node = heappop(heap)
        if distance > distances[node]:
            continue
        for edge in edges[offsets[node] : offsets[node + 1]]:
            source, far = sources[edge], distance + lengths[edge]
            if far < distances[source]:
                distances[source] = far
                heappush(heap, (far, source))
    return np.array(distances)
