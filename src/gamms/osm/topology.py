"""Join the roads between junctions into one road each, and merge the vertices of one junction into one node."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from gamms import kernels
from gamms.ir.graph import FloatArray, IntArray
from gamms.osm.network import (
    BoolArray,
    Merged,
    RoadNetwork,
    chosen_roads,
    moved_ends,
    offsets_of,
    reversed_points,
    without_unused_nodes,
)
from gamms.osm.ways import components

_REACH = 2.0  # tolerances: two circles of this radius around two nodes touch, which is how OSMnx says it
_ACROSS = 3.0  # tolerances: wide enough for the four corners where two dual carriageways cross, and no wider


def simplify(network: RoadNetwork) -> RoadNetwork:
    """Remove every node that merely continues a road.

    Two roads meet there, with equal tags and the same direction of traffic. The total length stays, the
    removed nodes become vertices of polylines. Roads joined from several ways carry a list of `osmid`. A ring
    without a junction becomes one road that leads back to its first node.
    """
    steps, begins = _walks(_partners(network).tolist())
    order, backward = steps >> 1, (steps & 1).astype(np.bool_)
    walked = chosen_roads(network, order)
    chain = np.repeat(np.arange(len(begins)), np.diff(np.append(begins, len(order))))
    mirrored = np.repeat(backward, np.diff(walked.offsets))
    points = walked.points[np.where(mirrored, reversed_points(walked.offsets), np.arange(len(walked.points)))]
    inner = np.setdiff1d(walked.offsets[:-1], walked.offsets[:-1][begins])  # a joint is in both roads: keep one
    sizes = np.bincount(chain, weights=np.diff(walked.offsets) - 1).astype(np.int64) + 1
    ends = np.append(begins[1:], len(order)) - 1
    ways, tags = _joined_tags(np.split(walked.ways, begins[1:]), network.tags)
    joined = replace(
        network,
        sources=np.where(backward, walked.targets, walked.sources)[begins],
        targets=np.where(backward, walked.sources, walked.targets)[ends],
        offsets=offsets_of(sizes),
        points=np.delete(points, inner, axis=0),
        lengths=np.add.reduceat(walked.lengths, begins),
        two_way=walked.two_way[begins],
        ways=ways,
        tags=tags,
    )
    return without_unused_nodes(joined)


def _partners(network: RoadNetwork) -> IntArray:
    """Return the road end that continues each road end, or -1.

    Ends are numbered 2 * road (source) and 2 * road + 1 (target).
    """
    nodes = np.column_stack((network.sources, network.targets)).ravel()
    offsets, ends = kernels.group_rows(nodes, len(network.xy))
    pair = offsets[:-1][np.diff(offsets) == 2]
    a, b = ends[pair], ends[pair + 1]
    kind = _kinds(network.tags)[network.ways]
    alike = (kind[a >> 1] == kind[b >> 1]) & (network.two_way[a >> 1] == network.two_way[b >> 1])
    onward = network.two_way[a >> 1] | ((a & 1) != (b & 1))
    joined = alike & onward & (a >> 1 != b >> 1)
    partners = np.full(len(nodes), -1)
    partners[a[joined]], partners[b[joined]] = b[joined], a[joined]
    return partners


def _kinds(tags: Sequence[Mapping[str, Any]]) -> IntArray:
    """Equal numbers for ways that differ in nothing but their id."""
    known: dict[str, int] = {}
    texts = (repr(sorted((name, value) for name, value in of_way.items() if name != "osmid")) for of_way in tags)
    return np.array([known.setdefault(text, len(known)) for text in texts], np.int64)


def _walks(partners: list[int]) -> tuple[IntArray, IntArray]:
    """Chains of roads, as the end at which each road is entered, and where in that list each chain begins."""
    steps: list[int] = []
    begins: list[int] = []
    seen = bytearray(len(partners) // 2)
    ends = range(len(partners))
    for start in [
        *(end for end in ends if partners[end] < 0),
        *ends[::2],
    ]:  # rings have no open end: they come last
        if seen[start >> 1]:
            continue
        walk = _walk(start, partners, seen)
        begins.append(len(steps))
        # The first road gives the direction, so that one-way roads keep theirs.
        steps += [end ^ 1 for end in reversed(walk)] if walk[0] & 1 else walk
    return np.array(steps, np.int64), np.array(begins, np.int64)


def _walk(end: int, partners: list[int], seen: bytearray) -> list[int]:
    walk = []
    while end >= 0 and not seen[end >> 1]:
        seen[end >> 1] = True
        walk.append(end)
        end = partners[end ^ 1]
    return walk


def _joined_tags(
    chains: Iterable[IntArray], tags: Sequence[Mapping[str, Any]]
) -> tuple[IntArray, list[Mapping[str, Any]]]:
    joined: list[Mapping[str, Any]] = []
    for chain in chains:
        first = tags[chain[0]]
        ids = list(dict.fromkeys(tags[way].get("osmid") for way in chain.tolist()))
        joined.append(first if len(ids) == 1 else {**first, "osmid": ids})
    return np.arange(len(joined)), joined


class Chains(NamedTuple):
    """Roads from junction to junction, over nodes that merely continue them."""

    of_road: IntArray  # (roads,)  chain rows
    ends: IntArray  # (chains, 2)  node rows; -1 for a ring without a junction
    lengths: FloatArray  # (chains,)  metres


def consolidate(network: RoadNetwork, tolerance: float) -> RoadNetwork:
    """Merge junctions that a road of at most twice the tolerance joins; no junction grows wider than three.

    A junction is where three or more roads end: vertices between and dead ends stay where they are. The new node is the
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
    # The vertices of an inner road go with it: they have no other road.
    ends = np.concatenate((network.sources[inner], network.targets[inner]))
    label[ends] = np.tile(label[chains.ends[chains.of_road[inner], 0]], 2)
    return _contracted(network, label, inner, degrees(network) > 2)


def chains_of(network: RoadNetwork, joints: BoolArray | None = None) -> Chains:
    """Return the chains of a network, whatever the tags and directions of its roads.

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
    """Return how many road ends meet at each node."""
    return np.bincount(np.concatenate((network.sources, network.targets)), minlength=len(network.xy))


def _junctions(network: RoadNetwork, chains: Chains, tolerance: float) -> IntArray:
    """Return one label per node, equal for the nodes of one junction.

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
    """Return the network without its inner roads, one node per label, at the mean of the label's weighty nodes."""
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
