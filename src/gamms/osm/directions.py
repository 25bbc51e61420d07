"""Recognise the two directions of one road where a graph holds them as two edges."""

from dataclasses import replace

import numpy as np

from gamms.osm.network import RoadNetwork, chosen_roads

_SAME = 1e-6  # metres between vertices, and the relative difference of lengths


def joined_directions(network: RoadNetwork) -> RoadNetwork:
    """Make one two-way road of every one-way road and its exact reverse.

    Cutting both apart would leave two rows of nearly equal nodes along every street.
    """
    waiting: dict[tuple[int, int], list[int]] = {}
    two_way = network.two_way.copy()
    kept: list[int] = []
    for road, ends in enumerate(zip(network.sources.tolist(), network.targets.tolist(), strict=True)):
        back = waiting.get(ends[::-1], [])
        twin = next((other for other in back if _is_reverse(network, road, other)), None)
        if twin is None:
            waiting.setdefault(ends, []).append(road)
            kept.append(road)
        else:
            back.remove(twin)
            two_way[twin] = True
    return chosen_roads(replace(network, two_way=two_way), np.array(kept, np.int64))


def _is_reverse(network: RoadNetwork, road: int, other: int) -> bool:
    here = network.points[network.offsets[road] : network.offsets[road + 1]]
    there = network.points[network.offsets[other] : network.offsets[other + 1]]
    length, length_there = float(network.lengths[road]), float(network.lengths[other])
    return (
        len(here) == len(there)
        and abs(length - length_there) <= _SAME * max(length, length_there)
        and bool((np.abs(here - there[::-1]) <= _SAME).all())
    )
