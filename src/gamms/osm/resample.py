"""Cut roads into pieces of about one length, all roads at once; no piece is lost."""

from dataclasses import replace

import numpy as np

from gamms.ir.graph import FloatArray, IntArray
from gamms.limits import refuse_above
from gamms.osm.network import BoolArray, RoadNetwork, along, offsets_of

_PIECE_BYTES = 5_000  # with its node, measured: 2,400 in networkx, and 2,200 as they are attached
_SAME = 1e-9  # of a piece: a vertex this near to a cut is the cut


def resample(network: RoadNetwork, resolution: float) -> RoadNetwork:
    """Cut every road of length L into round(L / resolution) equal pieces.

    A road shorter than 1.5 times the resolution stays whole. New nodes follow the old ones. So that no piece
    is lost in a graph that has one edge per pair of nodes, a road that leads back to its own node is cut into
    three at least, and of whole roads between the same two nodes all but the first are cut in the middle.

    Raises:
        TooLarge (BadValue): the pieces would take more memory than is allowed.
    """
    counts = piece_counts(network.lengths, resolution)
    loop = network.sources == network.targets
    counts[loop] = np.maximum(counts[loop], 3)
    uncut = np.flatnonzero(counts == 1)
    counts[uncut[_repeated(network, uncut)]] = 2
    cuts, offsets, points = cut_polylines(network.offsets, network.points, counts)
    sources, targets = _ends_of_pieces(network, counts)
    return replace(
        network,
        xy=np.concatenate((network.xy, cuts)),
        sources=sources,
        targets=targets,
        offsets=offsets,
        points=points,
        lengths=np.repeat(network.lengths / counts, counts),
        two_way=np.repeat(network.two_way, counts),
        ways=np.repeat(network.ways, counts),
    )


def piece_counts(lengths: FloatArray, resolution: float) -> IntArray:
    """Return into how many pieces roads of these lengths are cut; halves are rounded to the even number.

    Raises:
        TooLarge (BadValue): they would take more memory than is allowed.
    """
    with np.errstate(over="ignore"):
        ratio = lengths / resolution
    refuse_above(
        np.maximum(ratio, 1.0).sum() * _PIECE_BYTES,
        f"{lengths.sum():.0f} m of road in pieces of resolution={resolution} m",
    )
    return np.where(ratio < 1.5, 1, np.rint(ratio)).astype(np.int64)


def cut_polylines(offsets: IntArray, points: FloatArray, counts: IntArray) -> tuple[FloatArray, IntArray, FloatArray]:
    """Cut each polyline into `counts` pieces of equal length along itself.

    Returns:
        the cut points (sum of counts - 1, 2); offsets and points of the pieces, which keep the vertices
        inside them.
    """
    lines = np.repeat(np.arange(len(counts)), np.diff(offsets))
    position = along(offsets, points)
    total = position[offsets[1:] - 1]
    cuts = _cut_points(offsets, points, position, counts)
    # Which piece a vertex falls into: `place` counts pieces from the start of its own line.
    place = position / np.where(total > 0.0, total, 1.0)[lines] * counts[lines]
    kept = np.abs(place - np.rint(place)) > _SAME
    first_piece = offsets_of(counts)
    piece = first_piece[lines[kept]] + place[kept].astype(np.int64)
    inside = np.bincount(piece, minlength=first_piece[-1])
    cut_offsets = offsets_of(inside + 2)
    result = np.empty((cut_offsets[-1], 2))
    result[np.arange(len(piece)) + 2 * piece + 1] = points[kept]
    starts, ends = _end_points(offsets, points, counts, cuts)
    result[cut_offsets[:-1]], result[cut_offsets[1:] - 1] = starts, ends
    return cuts, cut_offsets, result


def _cut_points(offsets: IntArray, points: FloatArray, position: FloatArray, counts: IntArray) -> FloatArray:
    """Return the points at k / n of each line, 0 < k < n."""
    line = np.repeat(np.arange(len(counts)), counts - 1)
    rank = np.arange(len(line)) - np.repeat(offsets_of(counts - 1)[:-1], counts - 1) + 1
    share = rank / counts[line]
    total = position[offsets[1:] - 1]
    lines = np.repeat(np.arange(len(counts)), np.diff(offsets))
    # Line number plus share of the line: one ascending key finds the segment of every cut in one search.
    key = lines + position / np.where(total > 0.0, total, 1.0)[lines]
    segment = np.searchsorted(key, line + share, side="right") - 1
    segment = np.clip(segment, offsets[line], offsets[line + 1] - 2)
    run = position[segment + 1] - position[segment]
    part = (share * total[line] - position[segment]) / np.where(run > 0.0, run, 1.0)
    part = np.clip(part, 0.0, 1.0)[:, None]
    return np.asarray(points[segment] * (1.0 - part) + points[segment + 1] * part)


def _end_points(
    offsets: IntArray, points: FloatArray, counts: IntArray, cuts: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return where every piece starts and ends: at the ends of its line, at cuts otherwise."""
    pieces = offsets_of(counts)
    starts, ends = np.empty((pieces[-1], 2)), np.empty((pieces[-1], 2))
    first, last = _first_and_last(pieces)
    starts[first], starts[~first] = points[offsets[:-1]], cuts
    ends[last], ends[~last] = points[offsets[1:] - 1], cuts
    return starts, ends


def _ends_of_pieces(network: RoadNetwork, counts: IntArray) -> tuple[IntArray, IntArray]:
    pieces = offsets_of(counts)
    sources, targets = np.empty(pieces[-1], np.int64), np.empty(pieces[-1], np.int64)
    first, last = _first_and_last(pieces)
    new = len(network.xy) + np.arange(pieces[-1] - len(counts))
    sources[first], sources[~first] = network.sources, new
    targets[last], targets[~last] = network.targets, new
    return sources, targets


def _first_and_last(pieces: IntArray) -> tuple[BoolArray, BoolArray]:
    first, last = np.zeros(pieces[-1], np.bool_), np.zeros(pieces[-1], np.bool_)
    first[pieces[:-1]] = True
    last[pieces[1:] - 1] = True
    return first, last


def _repeated(network: RoadNetwork, roads: IntArray) -> BoolArray:
    """Return which of these roads lead from one node to another as an earlier one does."""
    nodes = len(network.xy)
    source, target = network.sources[roads], network.targets[roads]
    back = np.where(network.two_way[roads], target * nodes + source, -1 - roads)  # no way back: a key of its own
    keys = np.column_stack((source * nodes + target, back)).ravel()
    new = np.zeros(len(keys), np.bool_)
    new[np.unique(keys, return_index=True)[1]] = True
    return np.asarray(~np.all(new.reshape(-1, 2), axis=1))
