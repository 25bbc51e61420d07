"""Merge the vertices that make up one junction."""

from dataclasses import replace

import numpy as np

from gamms import kernels
from gamms.ir.graph import FloatArray, IntArray
from gamms.osm.labels import components
from gamms.osm.network import RoadNetwork, chosen_roads
from gamms.osm.polylines import with_ends

_MOST_CELLS = 2**30  # per axis: two cell numbers share one 64-bit key
_NEIGHBOURS = ((0, 0), (1, 0), (-1, 1), (0, 1), (1, 1))  # each pair of adjacent cells once


def consolidate(network: RoadNetwork, tolerance: float) -> RoadNetwork:
    """Merge nodes that are within twice the tolerance of each other and joined by roads among themselves.

    Nearness is passed on from node to node. The new node is the mean of the old ones; roads between them
    disappear, the other roads are led to the new node. A bridge and the road below it are near each other
    and not joined: they stay apart.
    """
    cluster = components(*close_pairs(network.xy, 2.0 * tolerance), len(network.xy))
    inner = (cluster[network.sources] == cluster[network.targets]) & (network.sources != network.targets)
    if not inner.any():
        return network
    group = components(network.sources[inner], network.targets[inner], len(network.xy))
    _, row, members = np.unique(group, return_inverse=True, return_counts=True)
    sums = [np.bincount(row, weights=values) for values in network.xy.T]
    xy = np.column_stack(sums) / members[:, None]
    rest = chosen_roads(network, np.flatnonzero(~inner))
    sources, targets = row[rest.sources], row[rest.targets]
    offsets, points, grown = with_ends(rest.offsets, rest.points, xy[sources], xy[targets])
    return replace(
        rest,
        xy=xy,
        sources=sources,
        targets=targets,
        offsets=offsets,
        points=points,
        lengths=rest.lengths + grown,
    )


def close_pairs(xy: FloatArray, distance: float) -> tuple[IntArray, IntArray]:
    """Pairs of rows that connect all points (points, 2) within `distance` of each other.

    Of points at one place only the first is compared with others: a heap of them costs no more than one.
    """
    order = np.lexsort((xy[:, 1], xy[:, 0]))
    again = np.zeros(len(xy), np.bool_)
    again[1:] = (xy[order[1:]] == xy[order[:-1]]).all(axis=1)
    twins = np.flatnonzero(again)
    places = order[~again]
    a, b = _pairs_of_places(xy[places], distance)
    return np.concatenate((order[twins - 1], places[a])), np.concatenate((order[twins], places[b]))


def _pairs_of_places(xy: FloatArray, distance: float) -> tuple[IntArray, IntArray]:
    low = xy.min(axis=0)
    side = max(distance, float((xy - low).max()) / _MOST_CELLS) or 1.0
    cell = ((xy - low) // side).astype(np.int64) + 1
    key = (cell[:, 1] << 32) | cell[:, 0]
    cells, group = np.unique(key, return_inverse=True)
    offsets, rows = kernels.group_rows(group, len(cells))
    found = [_pairs_between(xy, key + (dy << 32) + dx, (cells, offsets, rows), distance) for dx, dy in _NEIGHBOURS]
    return np.concatenate([a for a, _ in found]), np.concatenate([b for _, b in found])


def _pairs_between(
    xy: FloatArray, wanted: IntArray, grid: tuple[IntArray, IntArray, IntArray], distance: float
) -> tuple[IntArray, IntArray]:
    """Pairs of each point with the points in the cell that it wants."""
    cells, offsets, rows = grid
    group = np.minimum(np.searchsorted(cells, wanted), len(cells) - 1)
    asking = np.flatnonzero(cells[group] == wanted)
    group = group[asking]
    a = np.repeat(asking, np.diff(offsets)[group])
    b = kernels.ragged_rows(offsets, rows, group)
    near = (np.hypot(*(xy[a] - xy[b]).T) <= distance) & (a != b)
    return a[near], b[near]
