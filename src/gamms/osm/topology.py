"""Join roads from junction to junction, merge the nodes of a junction, and cut roads into equal pieces."""

import re
from collections.abc import Mapping
from dataclasses import replace
from itertools import chain, combinations, product
from typing import Any, NamedTuple, TypeVar

import numpy as np

from gamms import kernels
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.ir.projection import WGS84, project
from gamms.limits import refuse_above
from gamms.osm import turns
from gamms.osm.network import (
    RoadNetwork,
    compute_offsets,
    find_components,
    find_segment_starts,
    find_ways_back,
    is_upright,
    measure_along,
    move_ends,
    reverse_points,
    select_roads,
)
from gamms.osm.objects import split_words

_NO_TUNNELS = {"building_passage", "avalanche_protector"}  # open to the side, or above the ground
_BELOW = re.compile(r"-[0-9]{1,3}")  # layers
_REACH = 2.0  # tolerances: circles of this radius around two nodes touch, as in OSMnx
_MOST_FLOORS = 62  # pairs of layer and level that are distinguished on one map
_FURTHER = 5e-6  # degrees, half a meter: by which a road that cuts a building on the map may cut it further
_ACROSS = 3.0  # tolerances: wide enough for the four corners where two dual carriageways cross, and no wider


def simplify(network: RoadNetwork) -> RoadNetwork:
    """Remove every node that merely continues a road.

    At such a node two roads meet with equal tags and directions, and the node has no requested tag of its own. The
    total length stays, and the removed nodes become vertices of polylines. Roads joined from several ways carry a list
    of `osmid`. A ring without a junction becomes one road that leads back to its first node.
    """
    steps, begins = _find_chain_steps(_find_partners(network).tolist())
    order = steps >> 1
    backward = (steps & 1).astype(np.bool_)
    walked = select_roads(network, order)
    chain_of = np.repeat(np.arange(len(begins)), np.diff(np.append(begins, len(order))))
    mirrored = np.repeat(backward, np.diff(walked.offsets))
    points = walked.points[np.where(mirrored, reverse_points(walked.offsets), np.arange(len(walked.points)))]
    inner = np.setdiff1d(walked.offsets[:-1], walked.offsets[:-1][begins])  # a joint is in both roads: keep one
    sizes = np.bincount(chain_of, weights=np.diff(walked.offsets) - 1).astype(np.int64) + 1
    ends = np.append(begins[1:], len(order)) - 1
    joined = replace(
        network,
        sources=np.where(backward, walked.targets, walked.sources)[begins],
        targets=np.where(backward, walked.sources, walked.targets)[ends],
        offsets=compute_offsets(sizes),
        points=np.delete(points, inner, axis=0),
        lengths=np.add.reduceat(walked.lengths, begins),
        two_way=walked.two_way[begins],
        turns=turns.join(walked.turns, chain_of, backward, begins),
    )
    there = walked.ways
    back = None
    if walked.back_ways is not None:
        there = np.where(backward, walked.back_ways, walked.ways)
        back = np.where(backward, walked.ways, walked.back_ways)
    return remove_unused_nodes(_add_joined_tags(joined, there, back, begins))


def number_tunnels(network: RoadNetwork) -> IntArray:
    """Return for each node the number of its tunnel, from 1; 0 for nodes with a road on the surface.

    Tunnels are roads with `tunnel` or a negative `layer`, without passages through buildings; tunnels that meet
    underground have one number.
    """
    is_under = np.array([_is_underground(tags) for tags in network.tags], np.bool_)[network.ways]
    ends = np.column_stack((network.sources, network.targets))
    inside = np.zeros(len(network.xy), np.bool_)
    inside[ends[is_under]] = True
    inside[ends[~is_under]] = False
    a, b = ends[is_under & inside[ends].all(axis=1)].T
    label = find_components(a, b, len(network.xy))
    numbers = np.zeros(len(network.xy), np.int64)
    numbers[inside] = kernels.number_by_appearance(label[inside])[0] + 1
    return numbers


def _is_underground(tags: Mapping[str, Any]) -> bool:
    tunnels = {*split_words(tags.get("tunnel"))} - {"no"}
    layers = split_words(tags.get("layer"))
    if tunnels:
        return not tunnels <= _NO_TUNNELS
    return bool(layers) and all(_BELOW.fullmatch(layer) for layer in layers)


def remove_unused_nodes(network: RoadNetwork) -> RoadNetwork:
    """Return the network with only the nodes at the ends of its roads."""
    used, rows = np.unique(np.concatenate((network.sources, network.targets)), return_inverse=True)
    half = len(network.sources)
    refs = None if network.refs is None else network.refs[used]
    return replace(network, xy=network.xy[used], sources=rows[:half], targets=rows[half:], refs=refs)


def _find_partners(network: RoadNetwork) -> IntArray:
    """Return for each road end the road end that continues it, or -1.

    Ends are numbered 2 * road (source) and 2 * road + 1 (target).
    """
    nodes = np.column_stack((network.sources, network.targets)).ravel()
    offsets, ends = kernels.group_rows(nodes, len(network.xy))
    through = np.diff(offsets) == 2
    if network.turns:
        through[turns.find_joints_to_keep(network.turns, nodes, np.diff(offsets))] = False
    if network.refs is not None and network.nodes.staying:
        through &= ~np.isin(network.refs, np.array([*network.nodes.staying], np.int64))
    pair = offsets[:-1][through]
    a = ends[pair]
    b = ends[pair + 1]
    # Ways that differ only in their id have equal numbers.
    tags = ([(name, value) for name, value in of_way.items() if name != "osmid"] for of_way in network.tags)
    known: dict[str, int] = {}
    kind = np.array([known.setdefault(repr(sorted(one)), len(known)) for one in tags], np.int64)
    there = kind[network.ways]
    back = kind[find_ways_back(network)]
    leaving = np.column_stack((back, there)).ravel()  # (ends,) of the traffic that leaves the road at this end
    entering = np.column_stack((there, back)).ravel()
    alike = (leaving[a] == entering[b]) & (entering[a] == leaving[b])
    alike &= network.two_way[a >> 1] == network.two_way[b >> 1]
    onward = network.two_way[a >> 1] | ((a & 1) != (b & 1))
    joined = alike & onward & (a >> 1 != b >> 1)
    partners = np.full(len(nodes), -1)
    partners[a[joined]] = b[joined]
    partners[b[joined]] = a[joined]
    return partners


def _find_chain_steps(partners: list[int]) -> tuple[IntArray, IntArray]:
    """Return all chains of joined roads, one after the other, and the index at which each chain begins.

    A step is 2 * road, or 2 * road + 1 if the chain runs through the road backward; `partners` has, for each end of a
    road, the end that continues it, or -1.
    """
    steps: list[int] = []
    begins: list[int] = []
    seen = bytearray(len(partners) // 2)
    ends = range(len(partners))
    for start in [*(end for end in ends if partners[end] < 0), *ends[::2]]:  # rings have no open end: they come last
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


def _add_joined_tags(network: RoadNetwork, there: IntArray, back: IntArray | None, begins: IntArray) -> RoadNetwork:
    """Give roads that were joined from several ways tags of their own: the tags of the first, the ids of all.

    Args:
        network: the joined roads.
        there: (pieces,) rows of the tags of the pieces of road, in the direction of the joined road.
        back: (pieces,) in the other direction; None: as `there`.
        begins: (roads,) the first piece of each.
    """
    tags = [*network.tags]
    ways = _find_joined_rows(tags, there, begins)
    return replace(
        network, ways=ways, back_ways=None if back is None else _find_joined_rows(tags, back, begins), tags=tags
    )


def _find_joined_rows(tags: list[Mapping[str, Any]], ways: IntArray, begins: IntArray) -> IntArray:
    """Return the row of the tags of each road, after adding rows for roads that were joined from several ways."""
    of_road = ways[begins]
    if not len(begins):
        return of_road
    ends = np.append(begins[1:], len(ways))
    for road in np.flatnonzero(np.minimum.reduceat(ways, begins) != np.maximum.reduceat(ways, begins)).tolist():
        given = [tags[way].get("osmid") for way in ways[begins[road] : ends[road]].tolist()]
        ids = list(dict.fromkeys(id for one in given for id in (one if isinstance(one, list) else [one])))
        if len(ids) > 1:
            tags.append({**tags[of_road[road]], "osmid": ids})
            of_road[road] = len(tags) - 1
    return of_road


class RoadChains(NamedTuple):
    """Roads joined from junction to junction, through nodes that merely continue them."""

    of_road: IntArray  # (roads,)  chain rows
    ends: IntArray  # (chains, 2)  node rows; -1 for a ring without a junction
    lengths: FloatArray  # (chains,)  meters


def consolidate(network: RoadNetwork, tolerance: float) -> RoadNetwork:
    """Merge junctions joined by a road of at most twice the tolerance; no junction grows wider than three tolerances.

    A junction is a node where at least three roads end; vertices between junctions and dead ends stay. The new node is
    the mean of the old junctions. Roads inside it disappear; other roads end at the new node, with their drawn length.
    `merged` of the result counts the removed meters. Merged junctions share a `layer` and `level`, and have no stairs,
    elevator, bridge or tunnel between them, so that a bridge and the road below it stay apart. No building of the map
    may be between them, or block a road that ends there. Vertices at one place with a road of length zero between them
    always become one.
    """
    network = _remove_empty_roads(network)
    chains = find_chains(network)
    is_flat = np.ones(len(chains.lengths), np.bool_)
    is_flat[chains.of_road[_find_roads_elsewhere(network)]] = False
    label = _label_junctions(network, chains, is_flat, tolerance)
    if network.buildings is not None:
        _split_junctions(label, _find_behind_buildings(network, label))
    while True:
        a, b = label[chains.ends].T
        one = (a == b) & (chains.ends[:, 0] != chains.ends[:, 1]) & (chains.lengths <= _ACROSS * tolerance) & is_flat
        inner = one[chains.of_road]
        if not inner.any():
            return network
        # The vertices of an inner road disappear with it: they have no other road.
        ends = np.concatenate((network.sources[inner], network.targets[inner]))
        owners = label.copy()
        owners[ends] = np.tile(label[chains.ends[chains.of_road[inner], 0]], 2)
        result = _contract(network, owners, inner, count_road_ends(network) > 2)
        blocked = _find_led_into_buildings(network, result, inner)
        if not len(blocked):
            return result
        _split_junctions(label, blocked)


def _split_junctions(label: IntArray, nodes: IntArray) -> None:
    """Split the junctions of these nodes into nodes with labels of their own."""
    apart = np.isin(label, label[nodes])
    label[apart] = np.flatnonzero(apart)


def _find_led_into_buildings(network: RoadNetwork, merged: RoadNetwork, inner: BoolArray) -> IntArray:
    """Return the nodes whose roads lead through a building only because their junction was merged."""
    rest = select_roads(network, np.flatnonzero(~inner))
    first = find_segment_starts(rest.offsets)
    moved = (rest.points[first] != merged.points[first]) | (rest.points[first + 1] != merged.points[first + 1])
    first = first[moved.any(axis=1)]
    before, after = (
        _find_crossings(network, points[first], points[first + 1]) for points in (rest.points, merged.points)
    )
    known = {(line, building): far for line, building, far in zip(*(one.tolist() for one in before), strict=True)}
    found = zip(*(one.tolist() for one in after), strict=True)
    worse = {line for line, building, far in found if far > known.get((line, building), -np.inf) + _FURTHER}
    rows = first[sorted(worse)]
    roads = np.searchsorted(rest.offsets, rows, side="right") - 1
    return np.concatenate((rest.sources[roads], rest.targets[roads]))


def _find_behind_buildings(network: RoadNetwork, label: IntArray) -> IntArray:
    """Return the nodes of junctions with a building between two nodes; adjacent nodes were checked before."""
    offsets, nodes = kernels.group_rows(label, len(network.xy))
    large = np.flatnonzero(np.diff(offsets) > 2)
    members = (nodes[offsets[one] : offsets[one + 1]].tolist() for one in large.tolist())
    pairs = np.array(list(chain.from_iterable(combinations(some, 2) for some in members)), np.int64).reshape(-1, 2)
    return np.unique(pairs[_find_crossings(network, *network.xy[pairs.T])[0]])


def _find_crossings(network: RoadNetwork, start: FloatArray, end: FloatArray) -> tuple[IntArray, IntArray, FloatArray]:
    """Return for straight lines (lines, 2) their crossings with buildings: rows of lines, of buildings, and lengths."""
    if network.buildings is None or network.crs is None or not len(start):
        return np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0)
    return network.buildings.find_crossings(*(project(xy, network.crs, WGS84) for xy in (start, end)))


def find_chains(network: RoadNetwork, joints: BoolArray | None = None) -> RoadChains:
    """Return the chains of a network, whatever the tags and directions of its roads.

    Args:
        network: the roads.
        joints: (nodes,) which nodes may continue a road; default: all where exactly two roads end.
    """
    count = len(network.sources)
    nodes = np.column_stack((network.sources, network.targets)).ravel()  # ends 2 * road, and 2 * road + 1
    offsets, ends = kernels.group_rows(nodes, len(network.xy))
    through = (np.diff(offsets) == 2) & (True if joints is None else joints)
    joint = offsets[:-1][through]
    first = find_components(ends[joint] >> 1, ends[joint + 1] >> 1, count)
    names, of_road = np.unique(first, return_inverse=True)
    outer = np.flatnonzero(~through[nodes])
    outer = outer[np.argsort(of_road[outer >> 1], kind="stable")]
    ends_of = np.full((len(names), 2), -1)
    ends_of[of_road[outer[::2] >> 1]] = nodes[outer].reshape(-1, 2)
    lengths = np.bincount(of_road, weights=network.lengths, minlength=len(names))
    return RoadChains(of_road, ends_of, lengths.astype(np.float64))


def _remove_empty_loops(network: RoadNetwork) -> RoadNetwork:
    is_empty = (network.sources == network.targets) & (network.lengths <= 0.0)
    return select_roads(network, np.flatnonzero(~is_empty)) if is_empty.any() else network


def _remove_empty_roads(network: RoadNetwork) -> RoadNetwork:
    network = _remove_empty_loops(network)
    same = (network.xy[network.sources] == network.xy[network.targets]).all(axis=1)
    empty = same & (network.sources != network.targets) & (network.lengths <= 0.0)
    if not empty.any():
        return network
    label = find_components(network.sources[empty], network.targets[empty], len(network.xy))
    if network.modes:
        empty &= ~_is_closed_to_some(network, label, empty)
        label = find_components(network.sources[empty], network.targets[empty], len(network.xy))
    return _contract(network, label, empty, np.ones(len(network.xy), np.bool_))


def _is_closed_to_some(network: RoadNetwork, label: IntArray, empty: BoolArray) -> BoolArray:
    """Return a mask of roads at places of one label where a mode of travel cannot use all roads of length zero."""
    ends = np.column_stack((network.sources, network.targets))
    of_chains, of_nodes = _find_modes(network, RoadChains(np.arange(len(network.ways)), ends, network.lengths))
    meeting = np.zeros(len(label), np.int64)
    passing = np.full(len(label), -1)
    np.bitwise_or.at(meeting, label, of_nodes)
    np.bitwise_and.at(passing, label[network.sources[empty]], of_chains[empty])
    return np.asarray((meeting & ~passing)[label[network.sources]] != 0)


def count_road_ends(network: RoadNetwork) -> IntArray:
    """Return the number of road ends at each node."""
    return np.bincount(np.concatenate((network.sources, network.targets)), minlength=len(network.xy))


def _find_roads_elsewhere(network: RoadNetwork) -> BoolArray:
    """Return a mask of roads that are stairs, elevators, bridges or tunnels, passages through buildings included."""
    ways = [
        is_upright(tags) or any({*split_words(tags.get(name))} - {"no"} for name in ("bridge", "tunnel"))
        for tags in network.tags
    ]
    return np.array(ways, np.bool_)[network.ways]


def _find_floors(network: RoadNetwork) -> IntArray:
    """Return the layers and levels of each node, as the bits of a number; -1 for all.

    A node is on the floors on which at least two roads continue, or else on the floors of its roads; so the end of a
    bridge is on the ground. Stairs and elevators do not count.
    """
    ways_on: dict[tuple[str, ...], list[int]] = {}
    for way, tags in enumerate(network.tags):
        if not is_upright(tags):
            for floor in product(*(str(tags.get(name, 0)).split(";") for name in ("layer", "level"))):
                ways_on.setdefault(floor, []).append(way)
    once = np.zeros(len(network.xy), np.int64)
    twice = np.zeros(len(network.xy), np.int64)
    for number, ways in enumerate(ways_on.values()):
        roads = np.isin(network.ways, ways)
        ends = np.bincount(np.concatenate((network.sources[roads], network.targets[roads])), minlength=len(once))
        bit = 1 << min(number, _MOST_FLOORS - 1)
        once[ends > 0] |= bit
        twice[ends > 1] |= bit
    floors = np.where(twice > 0, twice, once)
    return np.where(floors > 0, floors, -1)


def _label_junctions(network: RoadNetwork, chains: RoadChains, is_flat: BoolArray, tolerance: float) -> IntArray:
    """Return one label per node, equal for the nodes of one junction.

    Shortest roads first, as in Kruskal's algorithm (1956), unless the junction would become too wide or have no layer
    and level in common.
    """
    degree = count_road_ends(network)
    a, b = chains.ends.T
    short = (
        is_flat & (a != b) & (chains.lengths <= _REACH * tolerance) & (np.minimum(degree[a], degree[b]) > 2) & (a >= 0)
    )
    rows = np.flatnonzero(short)
    rows = np.delete(rows, _find_crossings(network, *network.xy[chains.ends[rows].T])[0])
    places = np.sort(network.xy[chains.ends[rows]] @ (1.0, 1.0j), axis=1)  # so that the numbers of nodes do not matter
    rows = rows[np.lexsort((places[:, 1], places[:, 0], chains.lengths[rows]))]
    label = np.arange(len(network.xy))
    nodes = np.unique(chains.ends[rows])
    box = dict(zip(nodes.tolist(), map(tuple, np.tile(network.xy[nodes], 2).tolist()), strict=True))
    floors = dict(zip(nodes.tolist(), _find_floors(network)[nodes].tolist(), strict=True)) if len(nodes) else {}
    leader = {node: node for node in box}
    of_chains, of_nodes = _find_modes(network, chains)
    modes = dict(zip(nodes.tolist(), of_nodes[nodes].tolist(), strict=True))
    for (first, second), open_to in zip(chains.ends[rows].tolist(), of_chains[rows].tolist(), strict=True):
        one = _find_leader(first, leader)
        other = _find_leader(second, leader)
        west, south, east, north = box[one]
        w, s, e, n = box[other]
        union = min(west, w), min(south, s), max(east, e), max(north, n)
        common = floors[one] & floors[other]
        if modes[one] & modes[other] & ~open_to:
            continue  # a mode would pass from one to the other, though the road is closed to it
        if one != other and common and np.hypot(union[2] - union[0], union[3] - union[1]) <= _ACROSS * tolerance:
            low = min(one, other)
            high = max(one, other)
            leader[high] = low
            box[low] = union
            floors[low] = common
            modes[low] = modes[one] | modes[other]
    for node in leader:
        label[node] = _find_leader(node, leader)
    return label


def _find_modes(network: RoadNetwork, chains: RoadChains) -> tuple[IntArray, IntArray]:
    """Return the modes of travel that may use each whole chain, and a road at each node, as the bits of numbers.

    Without several modes all bits are set.
    """
    of_chains = np.full(len(chains.lengths), -1)
    of_nodes = np.zeros(len(network.xy), np.int64)
    if not network.modes:
        return of_chains, of_nodes - 1
    of_tags = np.array(
        [sum((of_way[name] > 0.0) << bit for bit, name in enumerate(network.modes)) for of_way in network.tags]
    )
    of_roads = of_tags[network.ways] | of_tags[find_ways_back(network)]
    np.bitwise_and.at(of_chains, chains.of_road, of_roads)
    np.bitwise_or.at(of_nodes, network.sources, of_roads)
    np.bitwise_or.at(of_nodes, network.targets, of_roads)
    return of_chains, of_nodes


def _find_leader(node: int, leader: dict[int, int]) -> int:
    while leader[node] != node:
        leader[node] = node = leader[leader[node]]
    return node


def _contract(network: RoadNetwork, label: IntArray, inner: BoolArray, weighty: BoolArray) -> RoadNetwork:
    """Return the network without its inner roads, one node per label, at the mean of the label's weighty nodes."""
    names, row, members = np.unique(label, return_inverse=True, return_counts=True)
    weight = np.where(members[row] > 1, weighty, 1.0)
    network = replace(network, turns=_find_turns_across(network, row, inner))
    shift = network.xy[names][row]  # the mean of differences: equal positions give exactly that position
    sums = [np.bincount(row, weights=weight * values) for values in (network.xy - shift).T]
    xy = network.xy[names] + np.column_stack(sums) / np.bincount(row, weights=weight)[:, None]
    rest = select_roads(network, np.flatnonzero(~inner))
    sources = row[rest.sources]
    targets = row[rest.targets]
    points, growth = move_ends(rest.offsets, rest.points, xy[sources], xy[targets])
    lengths = rest.lengths * growth
    gone = float(network.lengths.sum() - lengths.sum())
    before = network.merged
    merged = before._replace(nodes=before.nodes + len(network.xy) - len(xy), length_m=before.length_m + gone)
    rest = replace(rest, xy=xy, sources=sources, targets=targets, points=points, lengths=lengths, merged=merged)
    if network.refs is None:
        return rest
    nodes = network.nodes._replace(of=_join_node_tags(network, network.refs[label]))
    return replace(rest, refs=network.refs[names], nodes=nodes)


def _find_turns_across(network: RoadNetwork, owners: IntArray, inner: BoolArray) -> turns.ForbiddenTurns:
    """Return the forbidden turns without the roads within merged junctions; `owners` (nodes,) are the junctions."""
    tails = np.column_stack((network.sources, network.targets)).ravel()
    found: dict[str, turns.Paths] = {}
    for mode, paths in network.turns.items():
        is_open = np.column_stack((np.ones_like(network.two_way), network.two_way)).ravel()
        if mode in network.modes:
            speeds = np.array([of_way[mode] for of_way in network.tags], np.float64)
            is_open &= speeds[np.column_stack((network.ways, find_ways_back(network))).ravel()] > 0.0
        found[mode] = turns.merge(paths, turns.MergedRoads(tails, owners, inner, is_open, network.lengths))
    return found


def _join_node_tags(network: RoadNetwork, owners: IntArray) -> dict[int, Mapping[str, str]]:
    """Return the tags of nodes; a merged node also gets the tags of the nodes that became part of it."""
    joined = dict(network.nodes.of)
    refs = network.refs if network.refs is not None else owners
    for ref, owner in zip(*(ids[refs != owners].tolist() for ids in (refs, owners)), strict=True):
        if ref in network.nodes.of:
            joined[owner] = {**network.nodes.of[ref], **joined.get(owner, {})}
    return joined


Values = TypeVar("Values", FloatArray, IntArray)
_PIECE_BYTES = 1_200  # with its node, measured: 200 when cut, and 800 attached
_SAME = 1e-9  # of a piece: a vertex this near to a cut is the cut


def resample(network: RoadNetwork, resolution: float) -> RoadNetwork:
    """Cut every road of length L into round(L / resolution) equal pieces.

    A road shorter than 1.5 times the resolution stays whole. New nodes follow the old ones. So that no piece is lost in
    a graph with one edge per pair of nodes, a road that leads back to its own node is cut into at least three, and all
    but the first of several whole roads between two nodes are cut in the middle. A road of length zero that leads back
    to its own node is no road: two nodes of the map are at one place.

    Raises:
        TooLarge (BadValue): the pieces would take more memory than allowed.
    """
    network = _remove_empty_loops(network)
    counts = count_pieces(network.lengths, resolution)
    loop = network.sources == network.targets
    counts[loop] = np.maximum(counts[loop], 3)
    uncut = np.flatnonzero(counts == 1)
    counts[uncut[_find_repeated(network, uncut)]] = 2
    cuts, offsets, points = cut_polylines(network.offsets, network.points, counts)
    new = len(network.xy) + np.arange(len(cuts))
    sources, targets = _find_ends_of_pieces(counts, new, network.sources, network.targets)
    return replace(
        network,
        xy=np.concatenate((network.xy, cuts)),
        refs=None if network.refs is None else np.concatenate((network.refs, np.zeros(len(cuts), np.int64))),
        sources=sources,
        targets=targets,
        offsets=offsets,
        points=points,
        lengths=np.repeat(network.lengths / counts, counts),
        two_way=np.repeat(network.two_way, counts),
        ways=np.repeat(network.ways, counts),
        back_ways=None if network.back_ways is None else np.repeat(network.back_ways, counts),
        turns=turns.cut(network.turns, counts),
    )


def count_pieces(lengths: FloatArray, resolution: float) -> IntArray:
    """Return the number of pieces for roads of these lengths; halves are rounded to the even number.

    Raises:
        TooLarge (BadValue): they would take more memory than allowed.
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
        The cut points (sum of counts - 1, 2); offsets and points of the pieces, which keep the vertices inside them.
    """
    lines = np.repeat(np.arange(len(counts)), np.diff(offsets))
    position = measure_along(offsets, points)
    total = position[offsets[1:] - 1]
    cuts = _cut_points(offsets, points, position, counts)
    # The piece of each vertex: `place` counts pieces from the start of its own line.
    place = position / np.where(total > 0.0, total, 1.0)[lines] * counts[lines]
    kept = np.abs(place - np.rint(place)) > _SAME
    first_piece = compute_offsets(counts)
    piece = first_piece[lines[kept]] + place[kept].astype(np.int64)
    inside = np.bincount(piece, minlength=first_piece[-1])
    cut_offsets = compute_offsets(inside + 2)
    result = np.empty((cut_offsets[-1], 2))
    result[np.arange(len(piece)) + 2 * piece + 1] = points[kept]
    starts, ends = _find_ends_of_pieces(counts, cuts, points[offsets[:-1]], points[offsets[1:] - 1])
    result[cut_offsets[:-1]] = starts
    result[cut_offsets[1:] - 1] = ends
    return cuts, cut_offsets, result


def _cut_points(offsets: IntArray, points: FloatArray, position: FloatArray, counts: IntArray) -> FloatArray:
    """Return the points at k / n of each line, 0 < k < n."""
    line = np.repeat(np.arange(len(counts)), counts - 1)
    rank = np.arange(len(line)) - np.repeat(compute_offsets(counts - 1)[:-1], counts - 1) + 1
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


def _find_ends_of_pieces(counts: IntArray, cuts: Values, begins: Values, ends: Values) -> tuple[Values, Values]:
    """Return the values at both ends of every piece, which are ends of its line or cuts."""
    inner = compute_offsets(counts - 1)
    return np.insert(cuts, inner[:-1], begins, axis=0), np.insert(cuts, inner[1:], ends, axis=0)


def _find_repeated(network: RoadNetwork, roads: IntArray) -> BoolArray:
    """Return a mask of these roads that lead from one node to another like an earlier one."""
    nodes = len(network.xy)
    source = network.sources[roads]
    target = network.targets[roads]
    back = np.where(network.two_way[roads], target * nodes + source, -1 - roads)  # no way back: a key of its own
    keys = np.column_stack((source * nodes + target, back)).ravel()
    new = np.zeros(len(keys), np.bool_)
    new[np.unique(keys, return_index=True)[1]] = True
    return np.asarray(~np.all(new.reshape(-1, 2), axis=1))
