"""Contacts: pairs of agents on one node, past each other on an edge, or within some distance, and when in a turn.

A turn is the time from 0 to 1; `visits_of` and `legs_of` say where agents are in it.
"""

from collections import defaultdict
from collections.abc import Callable, Collection, Hashable, Iterable, Iterator, Mapping, Sequence
from functools import cache
from itertools import pairwise
from math import inf, sqrt
from operator import sub
from typing import Annotated, Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from gamms import kernels
from gamms.arguments import as_context, as_flag, as_items, as_key, as_range
from gamms.context import Context
from gamms.errors import BadType, BadValue
from gamms.game.moves import TurnMoves
from gamms.graph import Graph
from gamms.ir.agents import Position
from gamms.rules import meetings
from gamms.rules.meetings import Meeting, visits_of
from gamms.text import shown
from gamms.typing import AgentType, IAgent
from gamms.typing.game import TEAMS, Track


class Contact(NamedTuple):
    """Two agents that meet, by name; one of each side."""

    a: str  # the agent of the first side
    b: str  # that of the second
    distance: float  # 0 on one node, or past each other; else edges, metres or map units, as was asked for
    time: float = 1.0  # of the turn, from 0 to 1
    a_node: int = -1  # where `a` was; on an edge, the node that it had passed last
    b_node: int = -1  # where `b` was, likewise
    a_xy: tuple[float, float] | None = None  # in games by metres: where exactly `a` was
    b_xy: tuple[float, float] | None = None  # and `b`


class Nearness(NamedTuple):
    """What counts as a contact; see `contacts`."""

    unit: str | None  # "hops", "metres" or "euclid"; None: on one node
    limit: float
    crossing: bool
    air: bool
    passing: bool


Side = Annotated[Hashable | Callable[[IAgent], object], TEAMS]  # a team, or a function of an agent
Place = int | Position  # where an agent counts as being: a node id; (x, y, z) of one that flies, where that is measured
Leg = tuple[int, int, float, float]  # ids of the nodes that an edge leads from and to; from when until when
_Distances = dict[tuple[Place, Place], float]
_Measure = Callable[[Collection[Place], Collection[Place]], _Distances]  # of all pairs that are near enough
_Aerial = Mapping[str, Place]  # name -> its position, where that is measured
_FEW_PAIRS, _FEW_NODES = 64, 16  # which are compared and looked up without arrays
_MOST_POINTS = 1 << 16  # of nodes, which are remembered of each graph
_POINTS: WeakKeyDictionary[Graph, tuple[int | None, dict[Place, Position]]] = WeakKeyDictionary()
_Tracked = tuple[str, Track]  # an agent of a side: its name, and how it came to where it is


def contacts(  # noqa: PLR0913 - all that makes a contact, in one call
    ctx: Context,
    a: Side,
    b: Side,
    *,
    hops: float | None = None,
    metres: float | None = None,
    euclid: float | None = None,
    crossing: bool | None = None,
    air: bool = False,
    passing: bool = True,
) -> list[Contact]:
    """Return all pairs of living agents, one of each side, that are in contact: first the earliest, then the nearest.

    Ties are ordered by keyed draws. The moments of a turn are numbers from 0 to 1: an agent that goes n edges is at the
    k-th node at k/n, with speeds in metres when it has gone as far; one that stays is at its node from 0 on.

    Args:
        ctx: the context.
        a: one side: a team, or a function of an agent that says whether it is on that side.
        b: the other side, likewise. No agent meets itself.
        hops: at most so many edges apart, by the shortest path from the one to the other or back, whichever is shorter.
        metres: the same by the lengths of the edges.
        euclid: at most so many map units apart in a straight line; an agent on the ground is at height 0.
            Without any of the three, agents meet on one node.
        crossing: whether agents that are on one edge in opposite directions meet, too; None: where no distance is
            given.
        air: whether aerial agents take part; each is at the node nearest to it, except for `euclid`. One that flew is
            there at the end of the turn.
        passing: whether agents meet on their way, too; False: where they are at the end, and if they went along one
            edge in opposite directions at any time. An agent that was put elsewhere since has met no agent on its way.
            With a distance, agents are compared whenever one of the two reaches a node; one between two nodes counts as
            on the one that it has passed.

    Raises:
        BadType, BadValue: a distance is not one, or there are several.
    """
    nearness = as_nearness(hops, metres, euclid, crossing=crossing, air=air, passing=passing)
    first: dict[tuple[str, str], Contact] = {}
    for contact in found(as_context(ctx, "contacts"), as_side(a), as_side(b), nearness):
        first.setdefault(contact[:2], contact)
    return list(first.values())


def one_to_one(met: Iterable[Contact]) -> list[Contact]:
    """Return those contacts, taken in this order, whose agents are in no earlier one that was taken."""
    taken: set[str] = set()
    pairs = []
    for contact in as_items(met, "met", "contacts"):
        if not isinstance(contact, Contact):
            raise BadType(f"one_to_one takes what gamms.rules.contacts gives, not {shown(contact)}.")
        if contact.a not in taken and contact.b not in taken:
            taken.update(contact[:2])
            pairs.append(contact)
    return pairs


def as_nearness(
    hops: float | None,
    metres: float | None,
    euclid: float | None,
    *,
    crossing: bool | None = None,
    air: bool = False,
    passing: bool = True,
) -> Nearness:
    """Check what a caller gave.

    Raises:
        BadType, BadValue: a distance is not one, or there are several.
    """
    distances = {"hops": hops, "metres": metres, "euclid": euclid}
    given = {unit: distance for unit, distance in distances.items() if distance is not None}
    if len(given) > 1:
        several = " and ".join(f"{unit}={shown(distance)}" for unit, distance in given.items())
        raise BadValue(f"Give one distance, not {several}.")
    on_edges = not given if crossing is None else as_flag(crossing, "crossing")
    unit, limit = next(((unit, as_range(distance, unit)) for unit, distance in given.items()), (None, 0.0))
    return Nearness(unit, limit, on_edges, as_flag(air, "air"), as_flag(passing, "passing"))


def as_side(side: Side) -> Side:
    """Check that a side is a team, or a function of an agent.

    Raises:
        BadType: a team is no key.
    """
    return side if callable(side) else as_key(side, "A team")


def found(ctx: Context, a: Side, b: Side, nearness: Nearness) -> list[Contact]:
    """Return all contacts of a turn in the order that `contacts` promises; two agents may have several."""
    if _are_apart(ctx, a, b, nearness):
        return []
    agents: list[IAgent] = ctx.game.agents
    if ctx.agent.block.flyers and not nearness.air:
        agents = [agent for agent in agents if agent.type is not AgentType.AERIAL]
    ours, theirs = (_playing_for(side, agents) for side in (a, b))
    if not ours or not theirs:
        return []
    sides = _tracked(ctx, ours, passing=nearness.passing), _tracked(ctx, theirs, passing=nearness.passing)
    in_space = agents if nearness.unit == "euclid" and nearness.air else ()
    aerial = {agent.name: agent.position for agent in in_space if agent.type is AgentType.AERIAL}
    if ctx.game.speed_unit != "edges":
        return _met_on_travels(ctx, sides, nearness, aerial)
    if nearness.unit is None:
        met = list(_on_nodes(*sides))
    else:
        met = list(_near(_MEASURES[nearness.unit](ctx.graph.graph, nearness.limit), *sides, aerial))
    if nearness.crossing:
        met += _on_edges(*sides) if nearness.passing else _crossed(ctx, ours, theirs)
    return [Contact(a, b, distance, time, *nodes) for time, distance, _, a, b, *nodes in _ranked(ctx, met)]


def _playing_for(side: Side, agents: list[IAgent]) -> list[IAgent]:
    # NOTE: without a call for each agent (benchmarks: contacts).
    return [*filter(side, agents)] if callable(side) else [agent for agent in agents if agent.team == side]


def _are_apart(ctx: Context, a: Side, b: Side, nearness: Nearness) -> bool:
    """Whether all went one edge or none, to nodes that are not near each other, and no two passed: then none met."""
    # NOTE: most turns are like that; tracks of all agents take a quarter of a small game (benchmarks).
    moves: TurnMoves | None = ctx.game.internals.state.moves
    if moves is None or not moves.are_single_steps(ctx.agent.block, a, b):
        return False
    if nearness.unit is None:
        return not moves.may_meet(a, b, crossing=nearness.crossing)
    order, ends = moves.order, moves.ends
    measure = _MEASURES[nearness.unit](ctx.graph.graph, nearness.limit)
    if measure(order.of_side(a).of(ends), order.of_side(b).of(ends)):
        return False
    return not (nearness.crossing and moves.may_meet(a, b, crossing=True))


def _met_on_travels(
    ctx: Context, sides: tuple[list[_Tracked], list[_Tracked]], nearness: Nearness, aerial: _Aerial
) -> list[Contact]:
    """Return the contacts of a turn in a game by metres: exact in time and place, but for those by hops."""
    graph, limit, edges = ctx.graph.graph, nearness.limit, meetings.EdgesGoneAlong(ctx)
    journeys = {name: meetings.Journey(name, track, _position(aerial, name)) for side in sides for name, track in side}
    ours, theirs = ([journeys[name] for name, _ in side] for side in sides)
    if nearness.unit is None:
        met = list(_on_nodes(*sides, meetings.TIME_SLACK))
    elif nearness.unit == "hops":
        met = list(_near(_MEASURES["hops"](graph, limit), *sides, aerial))
    elif nearness.unit == "euclid":
        met = list(meetings.within_euclid(edges, ours, theirs, limit))
    else:
        reached = cache(lambda node: graph.distances(source=node, cutoff=limit))
        met = list(meetings.within_metres(edges, reached, ours, theirs, limit))
    if nearness.crossing:
        met += meetings.on_edges(ours, theirs)
    found: list[Contact] = []
    last: dict[tuple[str, str], float] = {}
    for time, distance, _, a, b, *nodes in _ranked(ctx, met):
        if time - last.get((a, b), -inf) > meetings.TIME_SLACK:  # else it was found on the node or the next edge, too
            places = (journeys[name].xy_at(edges, time) for name in (a, b))
            found.append(Contact(a, b, distance, time, *nodes, *places))
        last[a, b] = time
    return found


def _position(aerial: _Aerial, name: str) -> Position | None:
    place = aerial.get(name)
    return place if isinstance(place, tuple) else None


def _ranked(ctx: Context, met: list[Meeting]) -> list[tuple[Any, ...]]:
    """Return meetings in the order that `contacts` promises, without the draws that decide between equals."""
    if not met:
        return []
    pairs = list({(one[3], one[4]): None for one in met})
    # By name, so that other agents that meet never change the order of two.
    draws = kernels.draw_bits_each(kernels.purpose_key(ctx.seed, "contacts"), map(repr, pairs), ctx.game.turn)
    draw_of = dict(zip(pairs, draws, strict=True))
    ranked = sorted((*one[:2], draw_of[one[3], one[4]], *one[2:]) for one in met if one[3] != one[4])
    return [(*one[:2], *one[3:]) for one in ranked]


def _tracked(ctx: Context, agents: list[IAgent], *, passing: bool) -> list[_Tracked]:
    tracks = tracks_of(ctx, agents, passing=passing)
    return [(agent.name, track) for agent, track in zip(agents, tracks, strict=True)]


def _on_nodes(ours: list[_Tracked], theirs: list[_Tracked], slack: float = 0.0) -> Iterator[Meeting]:
    """Yield the pairs that were at one node at one time."""
    at: dict[int, list[tuple[str, float, float]]] = defaultdict(list)
    for name, track in ours:
        for node, begin, end in visits_of(track):
            at[node].append((name, begin, end))
    for other, track in theirs:
        for node, came, left in visits_of(track):
            for name, begin, end in at.get(node, ()):
                if begin <= left + slack and came <= end + slack:
                    yield max(begin, came), 0.0, False, name, other, node, node


def _opposite(ours: list[_Tracked], theirs: list[_Tracked]) -> Iterator[tuple[str, Leg, str, Leg]]:
    """Yield the pairs that went along one edge in opposite directions, each with its leg."""
    on: dict[tuple[int, int], list[tuple[str, Leg]]] = defaultdict(list)
    for name, track in ours:
        for leg in legs_of(track):
            on[leg[:2]].append((name, leg))
    for other, track in theirs:
        for back in legs_of(track):
            for name, leg in on.get((back[1], back[0]), ()):
                yield name, leg, other, back


def _on_edges(ours: list[_Tracked], theirs: list[_Tracked]) -> Iterator[Meeting]:
    """Yield the pairs that were on one edge at one time, in opposite directions."""
    for name, (node, _, begin, end), other, (other_node, _, came, left) in _opposite(ours, theirs):
        if begin < left and came < end:  # else one enters the edge when the other leaves it: they meet on the node
            yield max(begin, came), 0.0, True, name, other, node, other_node


def _crossed(ctx: Context, ours: list[IAgent], theirs: list[IAgent]) -> Iterator[Meeting]:
    """Yield the pairs that went along one edge in opposite directions, at any time of the turn."""
    sides = _tracked(ctx, ours, passing=True), _tracked(ctx, theirs, passing=True)
    node_of = {agent.name: agent.current_node_id for agent in (*ours, *theirs)}
    for name, _, other, _ in _opposite(*sides):
        yield 1.0, 0.0, True, name, other, node_of[name], node_of[other]


def _near(measure: _Measure, ours: list[_Tracked], theirs: list[_Tracked], aerial: _Aerial) -> Iterator[Meeting]:
    """Yield the pairs that were near enough, at each moment at which one of two agents reached a node."""
    tracks = dict((*ours, *theirs))
    inner = _inner_moments(tracks)
    if not inner:  # NOTE: and then no two are near in most turns (benchmarks: turns)
        ends_of_sides = ({aerial.get(name, track.path[-1]) for name, track in side} for side in (ours, theirs))
        if not measure(*ends_of_sides):
            return
    a, b = _Places(ours, aerial), _Places(theirs, aerial)
    if inner:
        begins = {name: path[0] for name, (path, times, _) in tracks.items() if times[0] == 0.0}
        a.put(begins)
        b.put(begins)
    for now, came in sorted(inner.items()):
        new_a, new_b = a.put(came), b.put(came)
        for near in (measure(new_a, b.at), measure(a.at, new_b)):
            for name, other, distance in _pairs(near, a, b):
                if name in came or other in came:
                    yield now, distance, False, name, other, a.node_of[name], b.node_of[other]
    ends = {name: path[-1] for name, (path, _, _) in tracks.items()}
    a.put(ends)
    b.put(ends)
    for name, other, distance in _pairs(measure(a.at, b.at), a, b):
        since = max(tracks[name][1][-1], tracks[other][1][-1])
        if since not in inner:  # else it was found then
            yield since, distance, False, name, other, a.node_of[name], b.node_of[other]


def _inner_moments(tracks: dict[str, Track]) -> dict[float, dict[str, int]]:
    """Return when nodes are reached before the end of the turn, with the names of the agents and their nodes."""
    inner: dict[float, dict[str, int]] = defaultdict(dict)
    for name, (path, times, _) in tracks.items():
        for node, now in zip(path[1:], times[1:], strict=True) if len(path) > 1 and times[1] < 1.0 else ():
            inner[now][name] = node
    inner.pop(1.0, None)
    return inner


class _Places:
    """Where the agents of one side count as being during a turn: on the nodes that they have passed last.

    Attributes:
        at: place -> the names of the agents there, as keys.
        node_of: name -> node id.
    """

    def __init__(self, side: list[_Tracked], aerial: _Aerial) -> None:
        self._names, self._aerial = {name for name, _ in side}, aerial
        self.at: dict[Place, dict[str, None]] = {}
        self.node_of: dict[str, int] = {}

    def put(self, came: Mapping[str, int]) -> list[Place]:
        """Put those agents that are of this side on nodes; return the places."""
        places = []
        for name in came.keys() & self._names:
            if name in self.node_of:
                before = self._aerial.get(name, self.node_of[name])
                del self.at[before][name]
                if not self.at[before]:
                    del self.at[before]
            self.node_of[name] = node = came[name]
            place = self._aerial.get(name, node)
            self.at.setdefault(place, {})[name] = None
            places.append(place)
        return places


def _pairs(near: _Distances, a: _Places, b: _Places) -> Iterator[tuple[str, str, float]]:
    """Yield the names of agents at places that are near each other."""
    for (one, other), distance in near.items():
        for name in a.at[one]:
            for other_name in b.at[other]:
                yield name, other_name, distance


# -- where agents were in the course of a turn ------------------------------------------------------------------------


def tracks_of(ctx: Context, agents: Sequence[IAgent], *, passing: bool) -> list[Track]:
    """Return how agents came to where they are; not `passing`: only that they are there at the end of the turn."""
    if passing:
        return ctx.game.tracks(agents)
    return [_at_end(track) for track in ctx.game.tracks(agents)]


def _at_end(track: Track) -> Track:
    """Return that an agent is where it is at the end of the turn, and nothing of how it got there."""
    last = track.legs[-1]._replace(begin=track.legs[-1].end, since=1.0, until=1.0) if track.legs else None
    is_on_edge = last is not None and 0.0 < last.end < 1.0
    return Track(track.path[-1:], (1.0,), (last,) if last is not None and is_on_edge else ())


def legs_of(track: Track) -> Sequence[Leg]:
    """Return the edges that an agent went along."""
    path, times, _ = track
    if len(path) == 1:
        return ()
    if len(path) == 2 and path[0] != path[1]:  # as above
        return ((path[0], path[1], times[0], times[1]),)
    ends = zip(pairwise(path), pairwise(times), strict=True)
    return [(*edge, *span) for edge, span in ends if edge[0] != edge[1]]


# -- how far apart agents are -----------------------------------------------------------------------------------------


def nodes_within(graph: Graph, node: int, limit: float) -> dict[int, float]:
    """Return the nodes at most so many edges ahead of a node, each with the number of edges."""
    # NOTE: 5 us for what lies 3 edges around a node of Helsinki, where a search of the whole graph takes 170 us.
    near, hops, ring, far = graph.neighborhoods, {node: 0.0}, [node], 0.0
    while ring and far + 1.0 <= limit:
        far += 1.0
        ring = [end for end in dict.fromkeys(end for start in ring for end in near[start]) if end not in hops]
        hops.update(dict.fromkeys(ring, far))
    return hops


def _by_path(search: Callable[[int], Mapping[int, float]]) -> _Measure:
    """Measure by the shorter of the paths there and back, where `search` finds one of them."""
    known: dict[int, Mapping[int, float]] = {}

    def reached(node: int) -> Mapping[int, float]:
        if node not in known:
            known[node] = search(node)
        return known[node]

    def measure(ours: Collection[Any], theirs: Collection[Any]) -> _Distances:
        ours, theirs = dict.fromkeys(ours).keys(), dict.fromkeys(theirs).keys()
        apart: _Distances = {}
        for node in ours if theirs else ():
            far = reached(node)
            apart.update(((node, other), far[other]) for other in far.keys() & theirs)
        for node in theirs if ours else ():
            far = reached(node)
            for other in far.keys() & ours:
                apart[other, node] = min(far[other], apart.get((other, node), inf))
        return apart

    return measure


def _points_of(graph: Graph) -> dict[Place, Position]:
    """Return where those nodes of a graph are that were asked for, by id; to be added to."""
    # NOTE: a look-up in the graph takes 1.3 us, and agents are compared in every turn (benchmarks: turns).
    revision, known = _POINTS.get(graph, (None, {}))
    if revision is None or revision != graph.revision or len(known) > _MOST_POINTS:
        known = {}
        _POINTS[graph] = graph.revision, known
    return known


def _located(graph: Graph, known: dict[Place, Position], places: Collection[Place]) -> list[Position]:
    try:
        return [known[place] for place in places]
    except KeyError:  # some fly, or are on nodes that were not asked for before
        nodes = {place for place in places if not (place in known or isinstance(place, tuple))}
    if len(nodes) <= _FEW_NODES:
        known.update((node, (x, y, 0.0)) for node, x, y in map(graph.get_node, nodes))
    else:
        xy = graph.positions([*nodes]).tolist()
        known.update((node, (x, y, 0.0)) for node, (x, y) in zip(nodes, xy, strict=True))
    return [place if isinstance(place, tuple) else known[place] for place in places]


def _straight(graph: Graph, limit: float) -> _Measure:
    known = _points_of(graph)

    def measure(ours: Collection[Place], theirs: Collection[Place]) -> _Distances:
        if not ours or not theirs:
            return {}
        one, other = list(ours), list(theirs)
        a, b = (_located(graph, known, places) for places in (one, other))
        if len(a) * len(b) > _FEW_PAIRS:
            rows, columns, far = kernels.pairs_within(np.array(a), np.array(b), limit)
            pairs = zip(rows.tolist(), columns.tolist(), far.tolist(), strict=True)
            return {(one[i], other[k]): distance for i, k, distance in pairs}
        # NOTE: the same numbers, without the calls of NumPy. In most turns no two agents are near each other from west
        # to east, which takes half the time to see (benchmarks: 5 against 5).
        square, near = limit * limit, _Distances()
        xs = sorted([x for x, _, _ in (*a, *b)])
        gap = min(map(sub, xs[1:], xs))
        if gap * gap > square:
            return near
        ends = list(zip(other, b, strict=True))
        for place, (x, y, z) in zip(one, a, strict=True):
            for there, (end_x, end_y, end_z) in ends:
                dx = x - end_x
                if (apart := dx * dx) <= square:  # else the rest is not worked out
                    dy, dz = y - end_y, z - end_z
                    if (apart := apart + dy * dy + dz * dz) <= square:
                        near[place, there] = sqrt(apart)
        return near

    return measure


_MEASURES: dict[str, Callable[[Graph, float], _Measure]] = {
    "hops": lambda graph, limit: _by_path(lambda node: nodes_within(graph, node, limit)),
    "metres": lambda graph, limit: _by_path(lambda node: graph.distances(source=node, cutoff=limit)),
    "euclid": _straight,
}
