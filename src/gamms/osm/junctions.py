"""Merge the vertices that make up one junction: a crossing of two dual carriageways, a small roundabout."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from gamms import kernels
from gamms.ir.graph import FloatArray, IntArray
from gamms.osm.labels import components
from gamms.osm.network import BoolArray, Merged, RoadNetwork, chosen_roads
from gamms.osm.polylines import moved_ends

_REACH = 2.0  # tolerances: two circles of this radius around two nodes touch, which is how OSMnx says it
_ACROSS = 3.0  # tolerances: wide enough for the four corners where two dual carriageways cross, and no wider


class Chains(NamedTuple):
    """Roads from junction to junction, over nodes that merely continue them."""

    of_road: IntArray  # (roads,)  chain rows
    ends: IntArray  # (chains, 2)  node rows; -1 for a ring without a junction
    lengths: FloatArray  # (chains,)  metres


def consolidate(network: RoadNetwork, tolerance: float) -> RoadNetwork:
    """Merge junctions that a road of at most twice the tolerance joins; no junction grows wider than three.

    A junction is where three or more roads end: bends and dead ends stay where they are. The new node is the
    mean of the old junctions. Roads inside it disappear; the others end at the new node instead of the old one,
    and are as long as they are drawn. `merged` of the result says how many metres are gone in all. A bridge and
    the road below it are near each other and not joined: they stay apart. Vertices at one place with a road of
    no length between them always become one.
    """
    network = _without_empty_roads(network)
    chains = chains_of(network)
    label = _junctions(network, chains, tolerance)
    a, b = label[chains.ends].T
    one = (a == b) & (chains.ends[:, 0] != chains.ends[:, 1]) & (chains.lengths <= _ACROSS * tolerance)
    inner = one[chains.of_road]
    if not inner.any():
        return network
    # The bends of an inner road go with it: they have no other road.
    ends = np.concatenate((network.sources[inner], network.targets[inner]))
    label[ends] = np.tile(label[chains.ends[chains.of_road[inner], 0]], 2)
    return _contracted(network, label, inner, degrees(network) > 2)


def chains_of(network: RoadNetwork, joints: BoolArray | None = None) -> Chains:
    """The chains of a network, whatever the tags and directions of its roads.

    Args:
        network: the roads.
        joints: (nodes,) which nodes may continue a road; by default all where exactly two roads end.
    """
    count = len(network.sources)
    nodes = np.column_stack((network.sources, network.targets)).ravel()  # end 2 * road, and 2 * road + 1
    offsets, ends = kernels.group_rows(nodes, len(network.xy))
    through = (np.diff(offsets) == 2) & (True if joints is None else joints)
    joint = offsets[:-1][through]
    first = components(ends[joint] >> 1, ends[joint + 1] >> 1, count)
    names, of_road = np.unique(first, return_inverse=True)
    outer = np.flatnonzero(~through[nodes])
    outer = outer[np.argsort(of_road[outer >> 1], kind="stable")]
    ends_of = np.full((len(names), 2), -1)
    ends_of[of_road[outer[::2] >> 1]] = nodes[outer].reshape(-1, 2)
    return Chains(
        of_road, ends_of, np.bincount(of_road, weights=network.lengths, minlength=len(names)).astype(np.float64)
    )


def _without_empty_roads(network: RoadNetwork) -> RoadNetwork:
    same = (network.xy[network.sources] == network.xy[network.targets]).all(axis=1)
    empty = same & (network.sources != network.targets) & (network.lengths <= 0.0)
    if not empty.any():
        return network
    label = components(network.sources[empty], network.targets[empty], len(network.xy))
    return _contracted(network, label, empty, np.ones(len(network.xy), np.bool_))


def degrees(network: RoadNetwork) -> IntArray:
    """How many road ends meet at each node."""
    return np.bincount(np.concatenate((network.sources, network.targets)), minlength=len(network.xy))


def _junctions(network: RoadNetwork, chains: Chains, tolerance: float) -> IntArray:
    """One label per node, equal for the nodes of one junction.

    Shortest roads first, as in Kruskal's algorithm (1956), unless the junction would become too wide.
    """
    degree = degrees(network)
    a, b = chains.ends.T
    short = (a != b) & (chains.lengths <= _REACH * tolerance) & (np.minimum(degree[a], degree[b]) > 2) & (a >= 0)
    rows = _shortest_first(network, chains, np.flatnonzero(short))
    label = np.arange(len(network.xy))
    box = {node: (x, y, x, y) for node, (x, y) in _places(network.xy, np.unique(chains.ends[rows]))}
    leader = {node: node for node in box}
    for first, second in chains.ends[rows].tolist():
        one, other = _leader_of(first, leader), _leader_of(second, leader)
        (west, south, east, north), (w, s, e, n) = box[one], box[other]
        union = min(west, w), min(south, s), max(east, e), max(north, n)
        if one != other and np.hypot(union[2] - union[0], union[3] - union[1]) <= _ACROSS * tolerance:
            low, high = min(one, other), max(one, other)
            leader[high], box[low] = low, union
    for node in leader:
        label[node] = _leader_of(node, leader)
    return label


def _shortest_first(network: RoadNetwork, chains: Chains, rows: IntArray) -> IntArray:
    """In the order of length, then of place: the numbers of the nodes play no part."""
    places = np.sort(network.xy[chains.ends[rows]] @ (1.0, 1.0j), axis=1)
    return rows[
        np.lexsort((places[:, 1].imag, places[:, 1].real, places[:, 0].imag, places[:, 0].real, chains.lengths[rows]))
    ]


def _places(xy: FloatArray, nodes: IntArray) -> "zip[tuple[int, tuple[float, float]]]":
    return zip(nodes.tolist(), map(tuple, xy[nodes].tolist()), strict=True)


def _leader_of(node: int, leader: dict[int, int]) -> int:
    while leader[node] != node:
        leader[node] = node = leader[leader[node]]
    return node


def _contracted(network: RoadNetwork, label: IntArray, inner: BoolArray, weighty: BoolArray) -> RoadNetwork:
    """The network without its inner roads, one node per label, at the mean of the label's weighty nodes."""
    names, row, members = np.unique(label, return_inverse=True, return_counts=True)
    weight = np.where(members[row] > 1, weighty, 1.0)
    shift = network.xy[names][row]  # the mean of differences: equal places give that very place
    sums = [np.bincount(row, weights=weight * values) for values in (network.xy - shift).T]
    xy = network.xy[names] + np.column_stack(sums) / np.bincount(row, weights=weight)[:, None]
    rest = chosen_roads(network, np.flatnonzero(~inner))
    sources, targets = row[rest.sources], row[rest.targets]
    points, growth = moved_ends(rest.offsets, rest.points, xy[sources], xy[targets])
    lengths = rest.lengths * growth
    gone = float(network.lengths.sum() - lengths.sum())
    merged = Merged(network.merged.nodes + len(network.xy) - len(xy), network.merged.length_m + gone)
    return replace(
        rest,
        xy=xy,
        sources=sources,
        targets=targets,
        points=points,
        lengths=lengths,
        merged=merged,
    )
