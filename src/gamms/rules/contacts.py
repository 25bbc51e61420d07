"""Who meets whom, and when: pairs of agents on one node, past each other on an edge, or within some distance.

A turn is the time from 0 to 1; `gamms.rules.visits` says where agents are in it.
"""

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, NamedTuple

from gamms import kernels
from gamms.arguments import as_context, as_items, as_key, as_range
from gamms.errors import BadType, BadValue
from gamms.rules.measures import MEASURES, Distances, Measure, Place
from gamms.rules.visits import legs_of, tracks_of, visits_of
from gamms.text import shown
from gamms.typing import AgentType, IContext
from gamms.typing.game import Track


class Contact(NamedTuple):
    """Two agents that meet, by name; one of each side."""

    a: str
    b: str
    distance: float  # 0 on one node, or past each other; else edges, metres or map units, as was asked for
    time: float = 1.0  # of the turn, from 0 to 1
    a_node: int = -1  # where `a` was; on an edge, the node that it had passed last
    b_node: int = -1


class Nearness(NamedTuple):
    """What counts as a contact; see `contacts`."""

    unit: str | None  # "hops", "metres" or "euclid"; None: on one node
    limit: float
    crossing: bool
    air: bool
    passing: bool


Side = Callable[[Any], bool]
_Flyers = Mapping[str, Place]  # name -> its position, where that is measured
_Member = tuple[str, Track]  # of a side: the name, and how it came to where it is
_Meeting = tuple[float, float, bool, str, str, int, int]  # time, distance, on an edge?, a, b, where a was, where b was


def contacts(  # noqa: PLR0913 - all that makes a contact, in one call
    ctx: IContext,
    a: Any,
    b: Any,
    *,
    hops: float | None = None,
    metres: float | None = None,
    euclid: float | None = None,
    crossing: bool | None = None,
    air: bool = False,
    passing: bool = True,
) -> list[Contact]:
    """All pairs of living agents, one of each side, that are in contact: first the earliest, then the nearest.

    Equals are in an order by lot. The moments of a turn are numbers from 0 to 1: an agent that goes n edges is at the
    k-th node at k/n, with speeds in metres when it has gone as far; one that stays is at its node from 0 on.

    Args:
        ctx: the context.
        a: one side: a team, or a function of an agent that says whether it is on that side.
        b: the other side, likewise. Nobody meets itself.
        hops: at most so many edges apart, by the way from the one to the other or back, whichever is shorter.
        metres: the same by the lengths of the edges.
        euclid: at most so many map units apart in a straight line; an agent on the ground is at height 0.
            Without any of the three, agents meet on one node.
        crossing: whether agents that are on one edge in opposite directions meet, too; None: where no distance is
            given.
        air: whether aerial agents take part; each is at the node nearest to it, except for `euclid`. One that flew is
            there at the end of the turn.
        passing: whether agents meet on their way, too; False: where they are at the end, and if they went along one
            edge in opposite directions at any time. An agent that was put elsewhere since has met nobody on its way.
            With a distance, agents are compared whenever one of the two reaches a node; one between two nodes counts as
            on the one that it has passed.

    Raises:
        BadType, BadValue: a distance is none, or there are several.
    """
    nearness = as_nearness(hops, metres, euclid, crossing=crossing, air=air, passing=passing)
    first: dict[tuple[str, str], Contact] = {}
    for contact in found(as_context(ctx, "contacts"), as_side(a), as_side(b), nearness):
        first.setdefault(contact[:2], contact)
    return list(first.values())


def one_to_one(met: Iterable[Contact]) -> list[Contact]:
    """Of contacts in this order, those that leave everybody one at most: each pair whose agents are still free."""
    taken: set[str] = set()
    pairs = []
    for contact in _as_contacts(met):
        if contact.a not in taken and contact.b not in taken:
            taken.update(contact[:2])
            pairs.append(contact)
    return pairs


def _as_contacts(met: Any) -> list[Contact]:
    contacts = as_items(met, "met", "contacts")
    for one in contacts:
        if not isinstance(one, Contact):
            raise BadType(f"one_to_one takes what gamms.rules.contacts gives, not {shown(one)}.")
    return contacts


def as_nearness(
    hops: Any, metres: Any, euclid: Any, *, crossing: bool | None = None, air: bool = False, passing: bool = True
) -> Nearness:
    """What a caller gave, checked.

    Raises:
        BadType, BadValue: a distance is none, or there are several.
    """
    given = {
        name: value for name, value in (("hops", hops), ("metres", metres), ("euclid", euclid)) if value is not None
    }
    if len(given) > 1:
        raise BadValue(
            f"Give one distance, not {' and '.join(f'{name}={shown(value)}' for name, value in given.items())}."
        )
    for name, value in (("crossing", crossing), ("air", air), ("passing", passing)):
        if not isinstance(value, bool) and not (name == "crossing" and value is None):
            raise BadType(f"{name} must be True or False, not {shown(value)}.")
    for unit, value in given.items():
        return Nearness(unit, as_range(value, unit), bool(crossing), air, passing)
    return Nearness(None, 0.0, crossing is not False, air, passing)


def as_side(side: Any) -> Side:
    """Whether an agent is on a side: of a team, or one for which a function says so."""
    if callable(side):
        return side  # type: ignore[no-any-return] # what it answers, its caller knows
    team = as_key(side, "A team")
    return lambda agent: bool(agent.team == team)


def found(ctx: Any, is_a: Side, is_b: Side, nearness: Nearness) -> list[Contact]:
    """All contacts of a turn in the order that `contacts` promises; two agents may have several."""
    agents = [agent for agent in ctx.game.agents if nearness.air or agent.type is not AgentType.AERIAL]
    ours, theirs = [agent for agent in agents if is_a(agent)], [agent for agent in agents if is_b(agent)]
    if not ours or not theirs:
        return []
    sides = _members(ctx, ours, passing=nearness.passing), _members(ctx, theirs, passing=nearness.passing)
    if nearness.unit is None:
        met = list(_on_nodes(*sides))
    else:
        in_space = agents if nearness.unit == "euclid" and nearness.air else ()
        flyers = {agent.name: agent.position for agent in in_space if agent.type is AgentType.AERIAL}
        met = list(_near(MEASURES[nearness.unit](ctx.graph.graph, nearness.limit), *sides, flyers))
    if nearness.crossing:
        met += _on_edges(*sides) if nearness.passing else _crossed(ctx, ours, theirs)
    pairs = list({(one[3], one[4]): None for one in met})
    # By name, so that who else meets never changes the order of two.
    lots = kernels.lots(kernels.purpose_key(ctx.seed, "contacts"), map(repr, pairs), ctx.game.turn)
    lot_of = dict(zip(pairs, lots, strict=True))
    ranked = sorted((*one[:2], lot_of[one[3], one[4]], *one[2:]) for one in met if one[3] != one[4])
    return [Contact(a, b, distance, time, *nodes) for time, distance, _, _, a, b, *nodes in ranked]


def _members(ctx: Any, agents: list[Any], *, passing: bool) -> list[_Member]:
    tracks = tracks_of(ctx, agents, passing=passing)
    return [(agent.name, track) for agent, track in zip(agents, tracks, strict=True)]


def _on_nodes(ours: list[_Member], theirs: list[_Member]) -> Iterator[_Meeting]:
    """Who was at one node at one time."""
    at: dict[int, list[tuple[str, float, float]]] = defaultdict(list)
    for name, track in ours:
        for node, begin, end in visits_of(track):
            at[node].append((name, begin, end))
    for other, track in theirs:
        for node, came, left in visits_of(track):
            for name, begin, end in at.get(node, ()):
                if begin <= left and came <= end:
                    yield max(begin, came), 0.0, False, name, other, node, node


def _on_edges(ours: list[_Member], theirs: list[_Member]) -> Iterator[_Meeting]:
    """Who was on one edge at one time, in opposite directions."""
    on: dict[tuple[int, int], list[tuple[str, float, float]]] = defaultdict(list)
    for name, track in ours:
        for source, target, begin, end in legs_of(track):
            on[source, target].append((name, begin, end))
    for other, track in theirs:
        for source, target, came, left in legs_of(track):
            for name, begin, end in on.get((target, source), ()):
                if begin <= left and came <= end:
                    yield max(begin, came), 0.0, True, name, other, target, source


def _crossed(ctx: Any, ours: list[Any], theirs: list[Any]) -> Iterator[_Meeting]:
    """Who went along one edge in opposite directions, whenever that was."""
    sides = _members(ctx, ours, passing=True), _members(ctx, theirs, passing=True)
    whenever = ([(name, (path, (1.0,) * len(path))) for name, (path, _) in side] for side in sides)
    node_of = {agent.name: agent.current_node_id for agent in (*ours, *theirs)}
    for time, *_, name, other, _, _ in _on_edges(*whenever):
        yield time, 0.0, True, name, other, node_of[name], node_of[other]


def _near(measure: Measure, ours: list[_Member], theirs: list[_Member], flyers: _Flyers) -> Iterator[_Meeting]:
    """Who was near enough, at each moment at which one of two agents reached a node."""
    tracks, (a, b) = dict((*ours, *theirs)), (_Standing(ours, flyers), _Standing(theirs, flyers))
    inner: dict[float, dict[str, int]] = defaultdict(dict)  # moment -> name -> the node that is reached
    for name, (path, times) in tracks.items():
        for node, now in zip(path[1:], times[1:], strict=True) if len(path) > 1 else ():
            inner[now][name] = node
    ends = inner.pop(1.0, {}) | {name: path[-1] for name, (path, times) in tracks.items() if times[0] == 1.0}
    for now, came in sorted(inner.items()):
        new_a, new_b = a.put(came), b.put(came)
        for near in (measure(new_a, b.at), measure(a.at, new_b)):
            for name, other, distance in _pairs(near, a, b):
                if name in came or other in came:
                    yield now, distance, False, name, other, a.node_of[name], b.node_of[other]
    a.put(ends)
    b.put(ends)
    for name, other, distance in _pairs(measure(a.at, b.at), a, b):
        since = max(tracks[name][1][-1], tracks[other][1][-1])
        if since not in inner:  # else it was found then
            yield since, distance, False, name, other, a.node_of[name], b.node_of[other]


class _Standing:
    """Where the agents of one side count as being while a turn goes on: on the nodes that they have passed last.

    Attributes:
        at: place -> the names of those that are there, as keys.
        node_of: name -> node id.
    """

    def __init__(self, side: list[_Member], flyers: _Flyers) -> None:
        self._names, self._flyers = {name for name, _ in side}, flyers
        self.at: dict[Place, dict[str, None]] = {}
        self.node_of: dict[str, int] = {}
        self.put({name: path[0] for name, (path, times) in side if times[0] == 0.0})

    def put(self, came: Mapping[str, int]) -> list[Place]:
        """Put those that are of this side on nodes; gives the places."""
        places = []
        for name in came.keys() & self._names:
            if name in self.node_of:
                before = self._flyers.get(name, self.node_of[name])
                del self.at[before][name]
                if not self.at[before]:
                    del self.at[before]
            self.node_of[name] = node = came[name]
            place = self._flyers.get(name, node)
            self.at.setdefault(place, {})[name] = None
            places.append(place)
        return places


def _pairs(near: Distances, a: _Standing, b: _Standing) -> Iterator[tuple[str, str, float]]:
    """The names of agents at places that are near each other."""
    for (one, other), distance in near.items():
        for name in a.at[one]:
            for other_name in b.at[other]:
                yield name, other_name, distance
