"""Turn restrictions of a map: read from relations, and kept as forbidden paths while roads are joined, merged and cut.

A forbidden path is a tuple of directed roads that traffic must not follow from the first to the last. A directed road
is a number: `2 * road` from source to target, and `2 * road + 1` back.
"""

import heapq
import re
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

from gamms import kernels
from gamms.errors import BadFile
from gamms.ir.graph import FloatArray, IntArray, read_forbidden_turns
from gamms.ir.obstacles import BoolArray
from gamms.osm.objects import Member, normalize_tags, split_words

Paths = tuple[tuple[int, ...], ...]
"""Forbidden paths, each once."""
ForbiddenTurns = Mapping[str, Paths]
"""Name of a mode of travel -> the paths that are forbidden to it."""

KIND = "restriction"  # value of `type` of the relations, and the key of the sign
CONDITIONAL = "conditional"  # holds at some times only
OTHERS = "others"  # holds for other vehicles only
UNCLEAR = "unclear"  # the sign or the members are not understood
_PERIODS = frozenset(("day_on", "day_off", "hour_on", "hour_off"))  # keys of an old way to say when
_MOST_MEMBERS = 100  # of a restriction; real ones have a few
_MOST_IN_ANY_ORDER = 6  # ways between
_MOST_BY_ROAD = 8  # forbidden paths; a real map has fewer paths than roads
_MOST_ON_FEW_ROADS = 10_000
_SIGN = re.compile("(no|only)_[a-z]")
_AT_SIGNALS = "_on_red"  # end of signs that hold while a signal is red


class TurnRestriction(NamedTuple):
    """A turn restriction that holds for a mode of travel.

    Attributes:
        is_only: whether the turn is the only one that is allowed, not forbidden.
        is_u_turn: whether it leads back.
        starts: ids of ways.
        through: kind and id of the nodes or ways between.
        ends: ids of ways.
    """

    is_only: bool
    is_u_turn: bool
    starts: tuple[int, ...]
    through: tuple[tuple[str, int], ...]
    ends: tuple[int, ...]

    def list_ways(self) -> list[int]:
        """Return the ids of all ways."""
        return [*self.starts, *(id for kind, id in self.through if kind == "w"), *self.ends]

    def list_nodes(self) -> list[int]:
        """Return the ids of the nodes between."""
        return [id for kind, id in self.through if kind == "n"]


class RestrictionCounts(NamedTuple):
    """The numbers of turn restrictions of a map, by what they mean for a mode of travel."""

    held: int = 0  # hold for it
    conditional: int = 0  # hold at some times only
    others: int = 0  # hold for other vehicles only
    unclear: int = 0  # not understood


def is_restriction(tags: Mapping[str, str]) -> bool:
    """Return whether a relation with these tags is a turn restriction."""
    return tags.get("type", "").partition(":")[0] == KIND


def read_restriction(
    tags: Mapping[str, str], members: Sequence[Member], vehicles: Sequence[str]
) -> TurnRestriction | str:
    """Return the restriction of a relation for a mode of travel; or `CONDITIONAL`, `OTHERS` or `UNCLEAR`.

    Args:
        tags: of the relation.
        members: of the relation.
        vehicles: the names of the mode in keys, the most specific first.
    """
    plain = normalize_tags(tags)
    if not vehicles:
        return OTHERS
    named = plain.get("type", "").partition(":")[2]  # an old form: type=restriction:hgv
    keys = [*(f"{KIND}:{vehicle}" for vehicle in vehicles), KIND]
    if named:
        keys = [f"{KIND}:{named}", KIND] if named in vehicles else keys[:-1]
    signs = [plain[key] for key in keys if key in plain]
    if not signs:
        is_timed = any(f"{key}:{CONDITIONAL}" in plain for key in keys)
        if is_timed:
            return CONDITIONAL
        return OTHERS if any(key.partition(":")[0] == KIND for key in plain) else UNCLEAR
    if not set(split_words(plain.get("except"))).isdisjoint(vehicles):
        return OTHERS
    if not _PERIODS.isdisjoint(plain):
        return CONDITIONAL
    return _parse_restriction(split_words(signs[0]), members)


def _parse_restriction(signs: Sequence[str], members: Sequence[Member]) -> TurnRestriction | str:
    """Return the restriction with these signs, of which the first that is known counts."""
    known = (sign for sign in signs if _SIGN.match(sign) and not sign.endswith(_AT_SIGNALS))
    sign = next(known, "")
    ways = {role: tuple(ref for kind, ref, of in members if kind[0] == "w" and of == role) for role in ("from", "to")}
    through = tuple((kind[0], ref) for kind, ref, role in members if role == "via" and kind[0] in "nw")
    is_clear = bool(len(members) <= _MOST_MEMBERS and sign and ways["from"] and ways["to"] and through)
    if not is_clear or (len(through) > 1 and any(kind == "n" for kind, _ in through)):
        return UNCLEAR
    return TurnRestriction(sign.startswith("only_"), sign.endswith("_u_turn"), ways["from"], through, ways["to"])


TurnRelation = tuple[Mapping[str, str], Sequence[Member]]
"""The tags and the members of a turn restriction."""


def parse_restrictions(
    relations: Sequence[TurnRelation], vehicles: Mapping[str, Sequence[str]]
) -> dict[str, list[TurnRestriction]]:
    """Return mode of travel -> the restrictions that hold for it; `vehicles` has the names of each mode."""
    found: dict[str, list[TurnRestriction]] = {}
    for mode, names in vehicles.items():
        read = (read_restriction(tags, members, names) for tags, members in relations)
        found[mode] = [one for one in read if isinstance(one, TurnRestriction)]
    return found


def count_restrictions(relations: Iterable[TurnRelation], vehicles: Sequence[str]) -> RestrictionCounts:
    """Return the numbers of restrictions, by what they mean for a mode with these names."""
    read = (read_restriction(tags, members, vehicles) for tags, members in relations)
    counts = Counter("held" if isinstance(one, TurnRestriction) else one for one in read)
    return RestrictionCounts(**counts)


class RoadPieces:
    """The pieces of the ways of a map, to find the paths of restrictions.

    Args:
        sources: (pieces,) node rows.
        targets: (pieces,) node rows.
        nodes: the number of nodes.
        of_way: id of a way -> the rows of its pieces that signs may be about.
        places: id of a node of the map -> its rows.
        is_one_way: (pieces,)
    """

    def __init__(
        self,
        sources: IntArray,
        targets: IntArray,
        nodes: int,
        of_way: Mapping[int, Sequence[int]],
        places: Mapping[int, Sequence[int]],
        is_one_way: BoolArray,
    ) -> None:
        tails = np.column_stack((sources, targets)).ravel()
        self._tails: list[int] = tails.tolist()
        self._offsets, self._leaving = kernels.group_rows(tails, nodes)
        self._of_way = of_way
        self._places = places
        self._is_one_way = is_one_way

    def find_forbidden(self, restrictions: Iterable[TurnRestriction]) -> tuple[Paths, int]:
        """Return the paths that restrictions forbid, and the number of restrictions whose roads are on the map.

        Raises:
            BadFile: they forbid absurdly many.
        """
        found: dict[tuple[int, ...], None] = {}
        only: dict[tuple[int, ...], set[int]] = {}  # part of a path that is the only one allowed -> the next roads
        count = 0
        for one in restrictions:
            paths = [*self._find_paths(one)]
            if one.is_only:
                paths = [path for path in paths if self._is_open(path)]
                for path in paths:
                    for end in range(1, len(path)):
                        only.setdefault(path[:end], set()).add(path[end])
            else:
                found.update(dict.fromkeys(paths))
                self._refuse_above_most(found)
            count += bool(paths)
        for begin, allowed in only.items():
            at = self._tails[begin[-1] ^ 1]
            leaving = self._leaving[self._offsets[at] : self._offsets[at + 1]].tolist()
            others = (road for road in leaving if road not in allowed and road ^ 1 != begin[-1])
            found.update(((*begin, road), None) for road in others)
            self._refuse_above_most(found)
        return tuple(found), count

    def _refuse_above_most(self, found: Collection[tuple[int, ...]]) -> None:
        pieces = len(self._is_one_way)
        most = _MOST_ON_FEW_ROADS + _MOST_BY_ROAD * pieces
        if len(found) > most:
            raise BadFile(
                f"The turn restrictions of the map forbid more than {most} ways to go on {pieces} pieces of road, "
                "which no real map does. Remove its relations with type=restriction, or load it without a mode."
            )

    def _is_open(self, path: Sequence[int]) -> bool:
        """Return whether traffic may follow these directed roads by their one-way signs."""
        return not any(road & 1 and self._is_one_way[road >> 1] for road in path)

    def _find_paths(self, one: TurnRestriction) -> Iterator[tuple[int, ...]]:
        """Yield the paths from the first to the last roads of a restriction."""
        for start, end in product(one.starts, one.ends):
            for way_through in self._find_ways_through(one, start, end):
                leaving = [road for road in self._list_directed(end) if self._tails[road] == way_through.end]
                entering = [road for road in self._list_directed(start) if self._tails[road ^ 1] == way_through.begin]
                for first, last in product(entering, leaving):
                    is_meant = one.is_u_turn if first ^ 1 == last else not (one.is_u_turn and start == end)
                    if way_through.roads or is_meant:
                        yield (first, *way_through.roads, last)

    def _list_directed(self, way: int) -> list[int]:
        return [road for row in self._of_way.get(way, ()) for road in (2 * row, 2 * row + 1)]

    def _list_nodes(self, way: int) -> set[int]:
        return {self._tails[road] for road in self._list_directed(way)}

    def _find_ways_through(self, one: TurnRestriction, start: int, end: int) -> "Iterator[_WayThrough]":
        kind, id = one.through[0]
        if kind == "n":
            yield from (_WayThrough(place, place, ()) for place in self._places.get(id, ()))
            return
        ways = [way for _, way in one.through]
        for begin in sorted(self._list_nodes(start)):
            for found in self._chain_ways(begin, ways):
                if found.end in self._list_nodes(end):
                    yield found

    def _chain_ways(self, begin: int, ways: list[int]) -> "Iterator[_WayThrough]":
        """Yield the paths from a node along all of these ways, each once.

        They may be listed in any order; of many, the first ones join as they are listed, because orders are many more.
        """
        if not ways:
            yield _WayThrough(begin, begin, ())
        for way in ways if len(ways) <= _MOST_IN_ANY_ORDER else ways[:1]:
            rest = [other for other in ways if other != way]
            ends = self._list_nodes(way)
            if begin not in ends:
                continue
            for back in (0, 1):
                roads = {self._tails[road]: road for road in self._list_directed(way) if road & 1 == back}
                path: list[int] = []
                at = begin
                while at in roads and len(path) < len(roads):
                    path.append(roads[at])
                    at = self._tails[roads[at] ^ 1]
                    for found in self._chain_ways(at, rest):
                        yield _WayThrough(begin, found.end, (*path, *found.roads))


class _WayThrough(NamedTuple):
    """Directed roads between two nodes."""

    begin: int
    end: int
    roads: tuple[int, ...]


def read_turns_of_edges(ids: Sequence[object], signs: Mapping[int, object]) -> ForbiddenTurns:
    """Return the forbidden paths on edges with these ids, whose rows are one-way roads; `signs` is by row.

    Raises:
        BadValue: a sign has another form; see `gamms.ir.graph.FORBIDDEN_TURNS`.
    """
    road_of = {id: 2 * row for row, id in enumerate(ids)}
    found: dict[str, list[tuple[int, ...]]] = {}
    for row, value in signs.items():
        for mode, rests in read_forbidden_turns(value, ids[row]).items():
            known = (rest for rest in rests if road_of.keys() >= {*rest})
            found.setdefault(mode, []).extend((2 * row, *(road_of[id] for id in rest)) for rest in known)
    return {mode: tuple(paths) for mode, paths in found.items()}


# -- while roads are changed ------------------------------------------------------------------------------------------


def renumber(turns: ForbiddenTurns, numbers: IntArray) -> ForbiddenTurns:
    """Return the paths with `numbers[road]` for each directed road; -1 drops the paths that use it."""
    found: dict[str, Paths] = {}
    for mode, paths in turns.items():
        renumbered = (tuple(numbers[list(path)].tolist()) for path in paths)
        found[mode] = tuple(dict.fromkeys(path for path in renumbered if min(path) >= 0))
    return found


def choose(turns: ForbiddenTurns, roads: IntArray, count: int) -> ForbiddenTurns:
    """Return the paths on a selection of `count` roads, in their new order."""
    if not turns:
        return turns
    numbers = np.full(2 * count, -1)
    numbers[2 * roads] = 2 * np.arange(len(roads))
    numbers[2 * roads + 1] = 2 * np.arange(len(roads)) + 1
    return renumber(turns, numbers)


def find_joints_to_keep(turns: ForbiddenTurns, tails: IntArray, degrees: IntArray) -> IntArray:
    """Return the nodes that merely continue a road, but at which a path is forbidden that has no other joint.

    Args:
        turns: the forbidden paths.
        tails: (2 * roads,) the node at which each directed road begins.
        degrees: (nodes,) the number of road ends at each node.
    """
    found = set[int]()
    for path in {path for paths in turns.values() for path in paths}:
        joints = tails[list(path[1:])]
        if (degrees[joints] == 2).all():
            found.add(int(joints[-1]))
    return np.array(sorted(found), np.int64)


def join(turns: ForbiddenTurns, chain_of: IntArray, is_backward: BoolArray, begins: IntArray) -> ForbiddenTurns:
    """Return the paths along chains of roads.

    Args:
        turns: paths along the roads.
        chain_of: (roads,) the chain of each road; the roads of a chain follow each other.
        is_backward: (roads,) whether the chain runs through the road backward.
        begins: (chains,) the first road of each.
    """
    ends = np.append(begins[1:], len(chain_of)) - 1

    def along(path: tuple[int, ...]) -> tuple[int, ...]:
        found: list[int] = []
        left = 0  # roads of the chain behind the last one
        for road in path:
            step = road >> 1
            back = (road & 1) ^ int(is_backward[step])
            chain = int(chain_of[step])
            place = int(ends[chain] - step if back else step - begins[chain])
            rest = int(ends[chain] - begins[chain]) - place
            is_same = bool(found) and found[-1] == 2 * chain + back and left == rest + 1
            if not is_same:
                if found and (left or place):
                    return ()  # it turns back within a chain
                found.append(2 * chain + back)
            left = rest
        return tuple(found)

    joined = {mode: [along(path) for path in paths] for mode, paths in turns.items()}
    return {mode: tuple(dict.fromkeys(path for path in paths if len(path) > 1)) for mode, paths in joined.items()}


def cut(turns: ForbiddenTurns, counts: IntArray) -> ForbiddenTurns:
    """Return the paths along pieces of roads: from the last piece of the first road to the first one of the last.

    Args:
        turns: paths along the roads.
        counts: (roads,) the number of pieces of each road.
    """
    if not turns:
        return turns
    firsts = np.cumsum(counts) - counts

    def pieces(road: int) -> list[int]:
        row = road >> 1
        along = range(int(firsts[row]), int(firsts[row] + counts[row]))
        return [2 * piece + 1 for piece in reversed(along)] if road & 1 else [2 * piece for piece in along]

    return {
        mode: tuple(
            (pieces(path[0])[-1], *(piece for road in path[1:-1] for piece in pieces(road)), pieces(path[-1])[0])
            for path in paths
        )
        for mode, paths in turns.items()
    }


class MergedRoads(NamedTuple):
    """Roads whose junctions are merged."""

    tails: IntArray  # (2 * roads,)  the node at which each directed road begins, before
    owners: IntArray  # (nodes,)  the number of the junction of each node
    inner: BoolArray  # (roads,)  whether the road lies within a junction, and disappears
    is_open: BoolArray  # (2 * roads,)  whether traffic may use the directed road
    lengths: FloatArray  # (roads,)  meters


def merge(paths: Paths, merged: MergedRoads) -> Paths:
    """Return the paths of one mode without the roads that disappear within merged junctions.

    Across a junction with restrictions, a path is forbidden for which the roads within have no legal way that comes to
    no node twice. Traffic that takes another way leaves the junction on roads that stay, and returns to it.
    """
    return _PathsAcross(paths, merged).find() if merged.inner.any() else paths


class _PathsAcross:
    """Finds the paths of one mode that are forbidden across merged junctions."""

    def __init__(self, paths: Paths, merged: MergedRoads) -> None:
        self._find_paths = paths
        self._forbidden = kernels.ForbiddenPaths(paths)
        self._tails: list[int] = merged.tails.tolist()
        self._owners: list[int] = merged.owners.tolist()
        self._inner: list[bool] = merged.inner.tolist()
        self._lengths: list[float] = merged.lengths.tolist()
        self._is_open: list[bool] = merged.is_open.tolist()
        merged_ones = {self._owners[self._tails[2 * int(road)]] for road in np.flatnonzero(merged.inner)}
        junctions = {self._owners[self._tails[road]] for path in paths for road in path[1:]} & merged_ones
        self._around: dict[int, list[int]] = {}  # junction -> roads that leave it
        self._within: dict[int, list[int]] = {}  # node -> roads within its junction on which traffic leaves it
        for road in np.flatnonzero(np.isin(merged.owners[merged.tails], [*junctions])).tolist():
            node = self._tails[road]
            if not self._inner[road >> 1]:
                self._around.setdefault(self._owners[node], []).append(road)
            elif self._is_open[road]:
                self._within.setdefault(node, []).append(road)

    def find(self) -> Paths:
        found: dict[tuple[int, ...], None] = {}
        for path in self._find_paths:
            if not any(self._inner[road >> 1] for road in path):
                found[path] = None
                continue
            for outer in self._find_outer_paths(path):
                if outer not in found and not self._is_leading_along(outer):
                    found[outer] = None
        for around in self._around.values():
            for begin, end in product(around, around):
                if begin != end and self._is_open[begin ^ 1] and self._is_open[end]:
                    turn = (begin ^ 1, end)
                    if turn not in found and not self._is_leading_along(turn):
                        found[turn] = None
        return tuple(found)

    def _find_outer_paths(self, path: tuple[int, ...]) -> Iterator[tuple[int, ...]]:
        """Yield the paths along roads that stay and contain a path, which may begin or end inside of a junction."""
        kept = [road for road in path if not self._inner[road >> 1]]
        if not kept:
            return
        begins: list[tuple[int, ...]] = [()]
        ends: list[tuple[int, ...]] = [()]
        if self._inner[path[0] >> 1]:
            around = self._around.get(self._owners[self._tails[path[0]]], [])
            begins = [(road ^ 1,) for road in around if self._is_open[road ^ 1]]
        if self._inner[path[-1] >> 1]:
            around = self._around.get(self._owners[self._tails[path[-1] ^ 1]], [])
            ends = [(road,) for road in around if self._is_open[road]]
        for begin, end in product(begins, ends):
            outer = (*begin, *kept, *end)
            if len(outer) > 1:
                yield outer

    def _is_leading_along(self, outer: tuple[int, ...]) -> bool:
        """Return whether there is a legal way along roads that stay."""
        states: list[tuple[int, ...]] = [(outer[0],)]
        for road in outer[1:]:
            states = [*dict.fromkeys(after for state in states for after in self._find_states_across(state, road))]
        return bool(states)

    def _find_states_across(self, state: tuple[int, ...], goal: int) -> Iterator[tuple[int, ...]]:
        """Yield the states of traffic that has come through a junction to a road that leaves it."""
        begin = self._tails[state[-1] ^ 1]
        end = self._tails[goal]
        passed = set[tuple[int, ...]]()
        waiting: list[tuple[float, tuple[int, ...], tuple[int, ...]]] = [(0.0, (begin,), state)]
        while waiting:
            far, nodes, here = heapq.heappop(waiting)
            if here in passed:
                continue
            passed.add(here)
            if nodes[-1] == end and (after := self._forbidden.step(here, goal)) is not None:
                yield after
            for road in self._within.get(nodes[-1], ()):
                onward = self._tails[road ^ 1]
                then = self._forbidden.step(here, road)
                if then is not None and onward not in nodes:
                    heapq.heappush(waiting, (far + self._lengths[road >> 1], (*nodes, onward), then))
