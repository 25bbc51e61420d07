"""What a fidelity report measures, on arrays: roads counted once, distances, spacing, true lengths."""

from itertools import product
from typing import Any, NamedTuple

import numpy as np

from gamms import kernels
from gamms.ir.graph import FloatArray, IntArray
from gamms.osm.junctions import chains_of
from gamms.osm.network import BoolArray, RoadNetwork, chosen_roads
from gamms.osm.polylines import along

_Places = np.ndarray[Any, np.dtype[np.complex128]]
_EXACT = 1e-6  # metres, and relative: what rounding may change
_STEP = 20.0  # metres
_MOST_STEPS = 2_000_000
_REACH = 1.5  # steps: a nearer one cannot be beaten by one whose middle is more than two steps away
LEAST_PIECE, MOST_PIECE, MOST_UNCUT = 0.75, 1.25, 1.5  # of the resolution


class _Steps(NamedTuple):
    """Straight steps of at most `length` metres."""

    begin: FloatArray  # (steps, 2)
    run: FloatArray  # (steps, 2)
    middle: FloatArray  # (steps, 2)
    length: float


class Pieces(NamedTuple):
    """How the roads of a graph were cut."""

    cut: BoolArray  # (roads,)  a piece of a longer road
    parted: BoolArray  # (roads,)  a piece of a short road that was cut only so that no road is lost


def roads_once(edges: RoadNetwork) -> RoadNetwork:
    """Count the edges there and back between two nodes as one road if they have exactly the same length."""
    low, high = np.minimum(edges.sources, edges.targets), np.maximum(edges.sources, edges.targets)
    order = np.lexsort((edges.lengths, high, low))
    keys = np.column_stack((low, high, edges.lengths))[order]
    new = np.ones(len(order), np.bool_)
    new[1:] = (keys[1:] != keys[:-1]).any(axis=1)
    group = np.cumsum(new) - 1
    there = np.bincount(group, weights=(edges.sources <= edges.targets)[order], minlength=int(new.sum()))
    back = np.bincount(group, minlength=int(new.sum())) - there
    copies = np.maximum(there, back).astype(np.int64)
    rows = np.repeat(order[new], copies)
    return chosen_roads(edges, rows)


def pieces_of(roads: RoadNetwork, source: RoadNetwork, resolution: float) -> Pieces:
    """Recognise cut roads: at a cut two pieces of exactly equal length meet where the source has no vertex."""
    nodes = np.concatenate((roads.sources, roads.targets))
    lengths = np.tile(roads.lengths, 2)
    longest, shortest = np.full(len(roads.xy), -np.inf), np.full(len(roads.xy), np.inf)
    np.maximum.at(longest, nodes, lengths)
    np.minimum.at(shortest, nodes, lengths)
    chains = chains_of(roads, (longest == shortest) & ~np.isin(_complex(roads.xy), _complex(source.points)))
    number = np.bincount(chains.of_road, minlength=len(chains.lengths))
    short_pair = (number == 2) & (chains.lengths < MOST_UNCUT * resolution)
    small_loop = (number == 3) & (chains.ends[:, 0] == chains.ends[:, 1]) & (chains.lengths < 2.5 * resolution)
    parted = (short_pair | small_loop)[chains.of_road]
    return Pieces((number > 1)[chains.of_road], parted)


def deviations(source: RoadNetwork, roads: RoadNetwork) -> FloatArray:
    """The distance of every vertex of the source from the nearest of these roads, exactly, in metres.

    Given the other way round it is how far the roads lead off the map.
    """
    vertices = np.unique(_complex(np.concatenate((source.xy[_used(source)], source.points))))
    away = np.flatnonzero(~np.isin(vertices, _complex(roads.points)))
    result = np.zeros(len(vertices))
    if not len(away) or not len(roads.points):
        result[away] = np.inf
        return result
    steps = _steps(roads)
    places = np.column_stack((vertices[away].real, vertices[away].imag))
    near = _near_distances(places, steps)
    far = np.flatnonzero(near > _REACH * steps.length)
    cells = kernels.build_cells(steps.middle)
    near[far] = [_nearest(place, steps, cells) for place in places[far].tolist()]
    result[away] = near
    return result


def untrue_lengths(roads: RoadNetwork, rows: IntArray, source: RoadNetwork) -> int:
    """How many of these uncut roads are not as long as the pieces of the source that they follow.

    Roads that run where the source has none, because they lead on to a merged junction, are not judged.
    """
    chosen = chosen_roads(roads, rows)
    a, b, _, line = _segments(chosen)
    from_a, from_b, source_share, source_line = _segments(source)
    places, numbers = np.unique(np.concatenate((a, b, from_a, from_b)), return_inverse=True)
    ours, known = _pair_keys(numbers, len(a), len(places))
    keys, firsts = np.unique(known, return_index=True)
    if not len(keys) or not len(ours):
        return 0
    at = np.minimum(np.searchsorted(keys, ours), len(keys) - 1)
    there = keys[at] == ours
    true = (source.lengths[source_line] * source_share)[firsts][at]
    expected = np.bincount(line, weights=np.where(there, true, 0.0), minlength=len(rows))
    judged = np.bincount(line, weights=~there, minlength=len(rows)) == 0
    wrong = np.abs(chosen.lengths - expected) > _EXACT * (1.0 + expected)
    return int((judged & wrong).sum())


def _steps(roads: RoadNetwork) -> _Steps:
    """The roads as short straight steps: then the nearest one has its middle nearby."""
    inner = np.ones(len(roads.points), np.bool_)
    inner[roads.offsets[1:] - 1] = False
    start = np.flatnonzero(inner)
    a, run = roads.points[start], roads.points[start + 1] - roads.points[start]
    length = np.hypot(*run.T)
    longest = max(_STEP, float(length.sum()) / _MOST_STEPS)
    counts = np.maximum(np.ceil(length / longest), 1).astype(np.int64)
    line = np.repeat(np.arange(len(start)), counts)
    rank = np.arange(len(line)) - np.repeat(np.cumsum(counts) - counts, counts)
    step = run[line] / counts[line, None]
    begin = a[line] + step * rank[:, None]
    return _Steps(begin, step, begin + step / 2.0, longest)


def _near_distances(places: FloatArray, steps: _Steps) -> FloatArray:
    """The distance from each place to the nearest step, exact up to one and a half steps; more where it is more.

    Each place looks at the steps whose middle is in its cell of a grid or in one of the eight around it.
    """
    low, side = np.minimum(places.min(axis=0), steps.middle.min(axis=0)), 2.0 * steps.length
    of_step, of_place = (((xy - low) // side).astype(np.int64) + 1 for xy in (steps.middle, places))
    cells, group = np.unique((of_step[:, 0] << 32) | of_step[:, 1], return_inverse=True)
    offsets, rows = kernels.group_rows(group, len(cells))
    best = np.full(len(places), np.inf)
    for dx, dy in product((-1, 0, 1), repeat=2):
        wanted = ((of_place[:, 0] + dx) << 32) | (of_place[:, 1] + dy)
        at = np.minimum(np.searchsorted(cells, wanted), len(cells) - 1)
        asking = np.flatnonzero(cells[at] == wanted)
        asker = np.repeat(asking, np.diff(offsets)[at[asking]])
        found = kernels.ragged_rows(offsets, rows, at[asking])
        np.minimum.at(best, asker, _distances(places[asker], steps.begin[found], steps.run[found]))
    return best


def _nearest(place: list[float], steps: _Steps, cells: kernels.CellIndex) -> float:
    reach = 4.0 * steps.length
    while True:
        rows = kernels.candidate_rows(cells, place[0], place[1], reach)
        begin, run = (column if rows is None else column[rows] for column in (steps.begin, steps.run))
        best = float(_distances(np.array([place]), begin, run).min(initial=np.inf))
        if rows is None or best <= reach - steps.length:  # a step whose middle is farther cannot be nearer
            return best
        reach *= 4.0


def _distances(place: FloatArray, begin: FloatArray, run: FloatArray) -> FloatArray:
    """From places to straight steps, one each."""
    squared = (run * run).sum(axis=1)
    part = ((place - begin) * run).sum(axis=1) / np.where(squared > 0.0, squared, 1.0)
    return np.asarray(np.hypot(*(begin + np.clip(part, 0.0, 1.0)[:, None] * run - place).T))


def _segments(network: RoadNetwork) -> tuple[_Places, _Places, FloatArray, IntArray]:
    """Both ends of every straight piece of the polylines, its share of its road, and the road."""
    inner = np.ones(len(network.points), np.bool_)
    inner[network.offsets[1:] - 1] = False
    start = np.flatnonzero(inner)
    line = np.repeat(np.arange(len(network.sources)), np.diff(network.offsets) - 1)
    position = along(network.offsets, network.points)
    total = position[network.offsets[1:] - 1][line]
    share = (position[start + 1] - position[start]) / np.where(total > 0.0, total, 1.0)
    places = _complex(network.points)
    return places[start], places[start + 1], share, line


def _pair_keys(numbers: IntArray, ours: int, places: int) -> tuple[IntArray, IntArray]:
    """One number per pair of places, whatever its order: for our segments, and for those of the source."""
    a, b, from_a, from_b = np.split(numbers, np.cumsum([ours, ours, (len(numbers) - 2 * ours) // 2]))
    keys = [np.minimum(p, q) * places + np.maximum(p, q) for p, q in ((a, b), (from_a, from_b))]
    return keys[0], keys[1]


def _used(network: RoadNetwork) -> IntArray:
    return np.unique(np.concatenate((network.sources, network.targets)))


def _complex(xy: FloatArray) -> _Places:
    return np.ascontiguousarray(xy).view(np.complex128)[:, 0]
