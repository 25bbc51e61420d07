"""Join the roads between junctions into one road each: the same map with far fewer nodes."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from gamms import kernels
from gamms.ir.graph import IntArray
from gamms.osm.network import RoadNetwork, chosen_roads, without_unused_nodes
from gamms.osm.polylines import offsets_of, reversed_points


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
    """The road end that continues each road end, or -1.

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
