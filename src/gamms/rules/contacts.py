"""Who meets whom: pairs of agents on one node, that passed each other on an edge, or within some distance."""

from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple

from gamms import kernels
from gamms.arguments import as_range
from gamms.errors import BadType, BadValue
from gamms.rules.measures import MEASURES, Distances
from gamms.typing import AgentType, IContext


class Contact(NamedTuple):
    """Two agents that meet, by name; one of each side."""

    a: str
    b: str
    distance: float  # 0 on one node, or past each other; else edges, metres or map units, as was asked for


class Nearness(NamedTuple):
    """What counts as a contact; see `contacts`."""

    unit: str | None  # "hops", "metres" or "euclid"; None: on one node
    limit: float
    crossing: bool
    air: bool


Side = Callable[[Any], bool]


def contacts(
    ctx: IContext,
    a: Any,
    b: Any,
    *,
    hops: float | None = None,
    metres: float | None = None,
    euclid: float | None = None,
    crossing: bool | None = None,
    air: bool = False,
) -> list[Contact]:
    """All pairs of living agents, one of each side, that are in contact: nearest first, equals in an order by lot.

    Args:
        ctx: the context.
        a: one side: a team, or a function of an agent that says whether it is on that side.
        b: the other side, likewise. Nobody meets itself.
        hops: at most so many edges apart, by the way from the one to the other or back, whichever is shorter.
        metres: the same by the lengths of the edges.
        euclid: at most so many map units apart in a straight line; an agent on the ground is at height 0.
            Without any of the three, agents meet on one node.
        crossing: whether those who went along one edge in opposite directions in this turn have met, too; None: where
            no distance is given. Who was put elsewhere since has met nobody on its way.
        air: whether aerial agents take part; each is at the node nearest to it, except for `euclid`.

    Raises:
        BadType, BadValue: a distance is none, or there are several.
    """
    return found(ctx, as_side(a), as_side(b), as_nearness(hops, metres, euclid, crossing=crossing, air=air))


def one_to_one(met: Iterable[Contact]) -> list[Contact]:
    """Of contacts in this order, those that leave everybody one at most: each pair whose agents are still free."""
    taken: set[str] = set()
    pairs = []
    for contact in met:
        if contact.a not in taken and contact.b not in taken:
            taken.update(contact[:2])
            pairs.append(contact)
    return pairs


def as_nearness(hops: Any, metres: Any, euclid: Any, *, crossing: bool | None = None, air: bool = False) -> Nearness:
    """What a caller gave, checked.

    Raises:
        BadType, BadValue: a distance is none, or there are several.
    """
    given = {
        name: value for name, value in (("hops", hops), ("metres", metres), ("euclid", euclid)) if value is not None
    }
    if len(given) > 1:
        raise BadValue(f"Give one distance, not {' and '.join(f'{name}={value!r}' for name, value in given.items())}.")
    for name, value in (("crossing", crossing), ("air", air)):
        if not isinstance(value, bool) and (name, value) != ("crossing", None):
            raise BadType(f"{name} must be True or False, not {value!r}.")
    for unit, value in given.items():
        return Nearness(unit, as_range(value, unit), bool(crossing), air)
    return Nearness(None, 0.0, crossing is not False, air)


def as_side(side: Any) -> Side:
    """Whether an agent is on a side: of a team, or one for which a function says so."""
    return side if callable(side) else lambda agent: bool(agent.team == side)


def found(ctx: Any, is_a: Side, is_b: Side, nearness: Nearness) -> list[Contact]:
    """What `contacts` promises."""
    agents = [agent for agent in ctx.game.agents if nearness.air or agent.type is not AgentType.AERIAL]
    ours, theirs = [agent for agent in agents if is_a(agent)], [agent for agent in agents if is_b(agent)]
    if not ours or not theirs:
        return []
    distances = MEASURES[nearness.unit](ctx, ours, theirs, nearness.limit)
    if nearness.crossing:
        distances.update(_crossed(ctx.game.moves, ours, theirs))
    pairs = [pair for pair in distances if pair[0] != pair[1]]
    # By name, so that who else meets never changes the order of two.
    lots = kernels.lots_by_name(ctx.seed, ("contacts", ctx.game.turn), list(map(repr, pairs)))
    ranked = sorted((distances[pair], lot, pair) for pair, lot in zip(pairs, lots, strict=True))
    return [Contact(*pair, distance) for distance, _, pair in ranked]


def _crossed(moves: Mapping[str, Any], ours: list[Any], theirs: list[Any]) -> Distances:
    """Who went along an edge that the other went along the other way round."""
    by_way: dict[tuple[int, int], list[str]] = defaultdict(list)
    for agent in ours:
        for way in _ways_of(moves, agent):
            by_way[way].append(agent.name)
    steps = ((start, end, agent.name) for agent in theirs for start, end in _ways_of(moves, agent))
    return {(name, other): 0.0 for start, end, other in steps for name in by_way.get((end, start), ())}


def _ways_of(moves: Mapping[str, Any], agent: Any) -> list[tuple[int, int]]:
    """The edges an agent went along in this turn, as pairs of nodes."""
    move = moves.get(agent.name)
    if move is None or move.end != agent.current_node_id:
        return []
    return [(start, end) for start, end in zip(move.path, move.path[1:], strict=False) if start != end]
