"""One network for several modes of travel, whose roads say in each direction which modes may use them, and how fast.

`unite` joins the roads of each mode, as they are read for that mode alone: a piece of road that several modes may use
is there once. Where a barrier stops some of its modes and lets others pass, it is there twice, because the stopped
modes end at a node of their own; so the roads of each mode are exactly those of its own graph.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from gamms import kernels
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.osm.areas import ACROSS
from gamms.osm.network import (
    CoverageGaps,
    OsmRoads,
    RoadNetwork,
    RoadSegments,
    find_components,
    find_nodes_in_largest,
    find_one_way_segments,
    find_strong_components,
    find_ways_back,
    make_network_in_degrees,
    reverse_points,
    select_roads,
    split_directions,
)
from gamms.osm.objects import NodeTags
from gamms.osm.topology import remove_unused_nodes
from gamms.osm.turns import ForbiddenTurns, Paths, renumber

_ACROSS_ID = -1  # of lines across squares, which are no ways


class ModeRoads(NamedTuple):
    """The roads of one mode of travel."""

    name: str
    ways: OsmRoads
    segments: RoadSegments

    def are_in_largest(self, *, strong: bool) -> BoolArray:
        """Return a mask of the segments in the largest part; see `largest_part`."""
        one_way = find_one_way_segments(self.segments, self.ways.tags) if strong else None
        inside = find_nodes_in_largest(self.segments, one_way)
        return np.asarray(inside[self.segments.sources] & inside[self.segments.targets])

    def get_refs(self) -> IntArray:
        """Return the ids (segments, 2) of the nodes at both ends of each segment, in the direction of traffic."""
        refs = self.segments.refs
        if refs is None:
            raise ValueError("Roads of several modes need the ids of their nodes.")
        return refs[self.get_ends()]

    def get_ends(self) -> IntArray:
        """Return the rows (segments, 2) of the nodes at both ends of each segment."""
        return np.column_stack((self.segments.sources, self.segments.targets))


class UnitedRoads(NamedTuple):
    """The roads of several modes of travel in one network."""

    network: RoadNetwork  # in degrees, with `modes`
    of_modes: tuple[IntArray, ...]  # the roads of the segments of each mode

    def keep(self, kept: Sequence[BoolArray]) -> RoadNetwork:
        """Return the network in which each mode may use only these of its segments."""
        is_kept = np.zeros((len(self.network.sources), len(kept)), np.bool_)
        for mode, (roads, of_mode) in enumerate(zip(self.of_modes, kept, strict=True)):
            is_kept[roads[of_mode], mode] = True
        return keep_uses(self.network, is_kept)


def unite(parts: Sequence[ModeRoads], *, both_ways: bool) -> UnitedRoads:
    """Join the roads of several modes.

    Args:
        parts: the roads of each mode, read from one map.
        both_ways: let all modes go against one-way traffic.
    """
    keys = np.concatenate([_make_keys(part) for part in parts])
    roads, firsts = kernels.number_by_appearance(np.unique(keys, axis=0, return_inverse=True)[1].ravel())
    bounds = np.cumsum([len(part.segments.ways) for part in parts])
    of_modes = tuple(np.split(roads, bounds[:-1]))
    refs = np.concatenate([part.get_refs() for part in parts])[firsts]
    lonlat = np.concatenate([part.segments.lonlat[part.get_ends()] for part in parts])[firsts]
    nodes, seen = kernels.number_by_appearance(_make_node_keys(refs, keys[firsts]))
    uses = [_find_uses(part, of_mode, refs) for part, of_mode in zip(parts, of_modes, strict=True)]
    speeds = np.stack([use.speeds for use in uses], axis=2)
    two_way = np.asarray((speeds[:, 1] > 0.0).any(axis=1))
    starts = np.cumsum([0, *(len(use.tags) for use in uses)])
    rows = np.stack([use.rows + start for use, start in zip(uses, starts[:-1], strict=True)], axis=2)
    first = (speeds > 0.0).argmax(axis=2)
    row = np.take_along_axis(rows, first[:, :, None], axis=2)[:, :, 0]
    names = tuple(part.name for part in parts)
    tags, row = _add_speeds([tags for use in uses for tags in use.tags], row, speeds, names, ~two_way)
    segments = RoadSegments(lonlat.reshape(-1, 2)[seen], nodes[0::2], nodes[1::2], row[:, 0], refs.ravel()[seen])
    segments = replace(
        segments,
        turns=_join_turns(parts, of_modes, refs),
        turn_restrictions=max(part.segments.turn_restrictions for part in parts),
    )
    network = make_network_in_degrees(segments, two_way=two_way, tags=tags, back_ways=row[:, 1])
    barriers = {ref for part in parts for ref in part.ways.barriers}
    is_across = np.array([ACROSS in of_way for of_way in tags], np.bool_)[network.ways]
    is_again = np.ones(len(network.ways), np.bool_)
    is_again[np.unique(keys[firsts][:, (0, 1, 2, 5)], axis=0, return_index=True)[1]] = False
    network = replace(
        network,
        modes=names,
        left_out=CoverageGaps(
            barriers=len(barriers),
            across_m=float(network.lengths[is_across].sum()),
            doubled_m=float(network.lengths[is_again & ~is_across].sum()),
        ),
        attribution=parts[0].ways.attribution,
        buildings=parts[0].ways.buildings,
        nodes=_join_node_tags(parts),
    )
    return UnitedRoads(open_both_ways(network) if both_ways else network, of_modes)


def _join_turns(parts: Sequence[ModeRoads], of_modes: Sequence[IntArray], refs: IntArray) -> ForbiddenTurns:
    """Return the forbidden turns of all modes on the roads with nodes of these ids (roads, 2)."""
    found: dict[str, Paths] = {}
    for part, roads in zip(parts, of_modes, strict=True):
        is_turned = part.get_refs()[:, 0] != refs[roads, 0]
        numbers = np.column_stack((2 * roads + is_turned, 2 * roads + ~is_turned)).ravel()
        found.update(renumber(part.segments.turns, numbers))
    return found


def _join_node_tags(parts: Sequence[ModeRoads]) -> NodeTags:
    marked = [part.ways.nodes for part in parts if part.ways.nodes is not None]
    of = {ref: tags for one in marked for ref, tags in one.of.items()}
    return NodeTags(of, frozenset(ref for one in marked for ref in one.staying))


def _make_keys(part: ModeRoads) -> IntArray:
    """Return numbers (segments, 6) that are equal for one piece of road in two modes, and for no other piece.

    They are the id of the way, the ids of both nodes in ascending order, whether each of them is a barrier to the mode,
    and how many equal pieces come before.
    """
    ids = np.full(len(part.ways.tags), _ACROSS_ID)
    ids[: len(part.ways.ids)] = part.ways.ids
    refs = np.sort(part.get_refs(), axis=1)
    is_barrier = np.isin(refs, np.array([*part.ways.barriers], np.int64))
    keys = np.column_stack((ids[part.segments.ways], refs, is_barrier))
    group = np.unique(keys, axis=0, return_inverse=True)[1].ravel()
    order = np.argsort(group, kind="stable")
    before = np.empty(len(group), np.int64)
    before[order] = np.arange(len(group)) - np.searchsorted(group[order], group[order])
    return np.column_stack((keys, before))


def _make_node_keys(refs: IntArray, keys: IntArray) -> IntArray:
    """Return numbers that are equal for ends of roads at one node; an end at a barrier is a node of its own.

    Args:
        refs: (roads, 2) of the nodes at the ends.
        keys: (roads, 6) as of `_make_keys`.
    """
    is_low = refs == keys[:, 1:2]
    is_barrier = np.where(is_low, keys[:, 3:4], keys[:, 4:5]).ravel() > 0
    numbers = np.unique(refs, return_inverse=True)[1].ravel()
    numbers[is_barrier] = len(numbers) + np.flatnonzero(is_barrier)
    return numbers


class _RoadUses(NamedTuple):
    """The use of roads by one mode: along the roads, and back."""

    speeds: FloatArray  # (roads, 2)  km/h; 0: closed
    rows: IntArray  # (roads, 2)  of `tags`; 0 where the mode has no such road
    tags: Sequence[Mapping[str, Any]]


def _find_uses(part: ModeRoads, roads: IntArray, refs: IntArray) -> _RoadUses:
    """Return the use of all roads by a mode; `roads` are those of its segments, `refs` (roads, 2) the nodes of all."""
    tags, back = split_directions(part.ways.tags)
    ways = part.segments.ways
    rows = np.column_stack((ways, ways if back is None else back[ways]))
    speeds = np.array([of_way["speed_kph"] for of_way in tags], np.float64)[rows]
    speeds[find_one_way_segments(part.segments, part.ways.tags), 1] = 0.0
    is_turned = part.get_refs()[:, 0] != refs[roads, 0]
    speeds[is_turned] = speeds[is_turned, ::-1]
    rows[is_turned] = rows[is_turned, ::-1]
    every = _RoadUses(np.zeros((len(refs), 2)), np.zeros((len(refs), 2), np.int64), tags)
    every.speeds[roads] = speeds
    every.rows[roads] = rows
    return every


def _add_speeds(
    tags: Sequence[Mapping[str, Any]], rows: IntArray, speeds: FloatArray, names: Sequence[str], one_way: BoolArray
) -> tuple[list[Mapping[str, Any]], IntArray]:
    """Return the tags of both directions of roads with the speeds of modes, and their rows (roads, 2).

    A direction that no mode may use has the tags of the other.

    Args:
        tags: the tags without these speeds.
        rows: (roads, 2) of `tags`.
        speeds: (roads, 2, modes) km/h; 0: closed.
        names: (modes,)
        one_way: (roads,) the attribute `oneway`.
    """
    is_open = (speeds > 0.0).any(axis=2)
    table = np.concatenate(
        (rows[:, :, None], np.broadcast_to(one_way[:, None, None], (*rows.shape, 1)), speeds), axis=2
    )
    kinds, of_open = np.unique(table[is_open], axis=0, return_inverse=True)
    found = np.zeros(rows.shape, np.int64)
    found[is_open] = of_open.ravel()
    found = np.where(is_open, found, found[:, ::-1])
    result: list[Mapping[str, Any]] = []
    for row, is_one_way, *of_modes in kinds.tolist():
        own = dict(zip(names, of_modes, strict=True))
        speed = next(kph for kph in of_modes if kph > 0.0)
        result.append({**tags[int(row)], "oneway": bool(is_one_way), "speed_kph": speed, **own})
    return result, found


def find_speeds(network: RoadNetwork) -> FloatArray:
    """Return the speeds (roads, 2, modes) of modes along roads and back, in km/h; 0: closed."""
    shape = (len(network.tags), len(network.modes))
    of_tags = np.array([[of_way[name] for name in network.modes] for of_way in network.tags], np.float64).reshape(shape)
    speeds = of_tags[np.column_stack((network.ways, find_ways_back(network)))]
    speeds[~network.two_way, 1] = 0.0
    return speeds


def choose_modes(network: RoadNetwork, names: Sequence[str]) -> RoadNetwork:
    """Return the roads that one of these modes may use; the first that may gives their speed."""
    others = {*network.modes} - {*names}
    tags = [{name: value for name, value in of_way.items() if name not in others} for of_way in network.tags]
    chosen = replace(network, modes=tuple(names), tags=tags)
    return keep_uses(chosen, np.ones((len(network.sources), len(names)), np.bool_))


def open_both_ways(network: RoadNetwork) -> RoadNetwork:
    """Return the network in which each mode may use its roads in both directions, at the speed along its traffic."""
    speeds = find_speeds(network)
    speeds = np.where(speeds > 0.0, speeds, speeds[:, ::-1])
    rows = np.column_stack((network.ways, find_ways_back(network)))
    one_way = np.array([bool(of_way["oneway"]) for of_way in network.tags], np.bool_)[network.ways]
    tags, rows = _add_speeds(network.tags, rows, speeds, network.modes, one_way)
    two_way = np.ones(len(rows), np.bool_)
    return replace(network, tags=tags, ways=rows[:, 0], back_ways=rows[:, 1], two_way=two_way)


def keep_uses(network: RoadNetwork, kept: BoolArray) -> RoadNetwork:
    """Return the network without other uses of roads, and without the roads that no mode uses then.

    `left_out` of the result counts the removed roads.

    Args:
        network: roads of several modes.
        kept: (roads, modes) the uses to keep.
    """
    speeds: FloatArray = find_speeds(network) * kept[:, None, :]
    is_open = np.asarray((speeds > 0.0).any(axis=2))
    are_two_way = np.asarray(is_open.all(axis=1))
    one_way = np.array([bool(of_way["oneway"]) for of_way in network.tags], np.bool_)[network.ways]
    rows = np.column_stack((network.ways, find_ways_back(network)))
    tags, rows = _add_speeds(network.tags, rows, speeds, network.modes, one_way | ~are_two_way)
    turned = ~is_open[:, 0] & is_open[:, 1]
    mirrored = np.repeat(turned, np.diff(network.offsets))
    points = network.points[np.where(mirrored, reverse_points(network.offsets), np.arange(len(network.points)))]
    rows_of = np.arange(len(turned))
    numbers = np.column_stack((2 * rows_of + turned, 2 * rows_of + ~turned)).ravel()
    result = replace(
        network,
        turns=renumber(network.turns, numbers),
        sources=np.where(turned, network.targets, network.sources),
        targets=np.where(turned, network.sources, network.targets),
        points=points,
        two_way=are_two_way,
        tags=tags,
        ways=np.where(turned, rows[:, 1], rows[:, 0]),
        back_ways=np.where(turned, rows[:, 0], rows[:, 1]),
    )
    is_left = np.asarray(is_open.any(axis=1))
    label = find_components(network.sources, network.targets, len(network.xy))
    near = np.isin(label[network.sources], label[network.sources[is_left]])
    gaps = network.left_out._replace(
        other_parts_m=network.left_out.other_parts_m + float(network.lengths[~is_left & ~near].sum()),
        no_way_back_m=network.left_out.no_way_back_m + float(network.lengths[~is_left & near].sum()),
    )
    return replace(remove_unused_nodes(select_roads(result, np.flatnonzero(is_left))), left_out=gaps)


def find_uses_in_largest_parts(network: RoadNetwork, *, strong: bool) -> BoolArray:
    """Return a mask (roads, modes) of the uses in the largest part of each mode.

    Args:
        network: roads of several modes.
        strong: whether every node of a part has to be reachable from every other, in the directions of the mode.
    """
    is_open = find_speeds(network) > 0.0
    kept = np.zeros(is_open[:, 0].shape, np.bool_)
    count = len(network.xy)
    for mode in range(len(network.modes)):
        there, back = is_open[:, :, mode].T
        sources = np.concatenate((network.sources[there], network.targets[back]))
        targets = np.concatenate((network.targets[there], network.sources[back]))
        label = find_strong_components(sources, targets, count) if strong else find_components(sources, targets, count)
        inside = label == np.bincount(label).argmax()
        kept[:, mode] = (there | back) & inside[network.sources] & inside[network.targets]
    return kept
