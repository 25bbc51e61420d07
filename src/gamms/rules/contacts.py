"""Contacts: pairs of agents on one node, past each other on an edge, or within some distance, and when in a turn.

A turn is the time from 0 to 1; `gamms.core.contacts` says what contacts are.
"""

from collections.abc import Iterable
from typing import Any, NamedTuple

from gamms.arguments import as_context, as_flag, as_items, as_key, as_range
from gamms.context import Context
from gamms.errors import BadType, BadValue
from gamms.rules.meetings import Nearness, Side, in_air, turn_of
from gamms.text import shown


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
        passing: whether agents meet on their way, too; False: where they are at the end, and if they passed each other
            on an edge. An agent that was put elsewhere since has met no agent on its way.
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
    turn = turn_of(ctx)
    met = turn.find(ctx, a, b, nearness)
    if met is None:
        return []
    names, ids = turn.roster.names, turn.game.numbers.ids
    agents, nodes, distances, times = (met.a, met.b), (met.a_nodes, met.b_nodes), met.distances, met.times
    flying = in_air(ctx, nearness)
    found = []
    for row in met.order[: met.kept]:
        pair = [column[row] for column in agents]
        at: list[Any] = [ids[column[row]] for column in nodes]
        places: list[Any] = []
        if turn.by_metres:
            for agent, node in zip(pair, at, strict=True):
                places.append(turn.xy_of(agent, times[row], node, nearness, flying.get(names[agent])))
        found.append(Contact(names[pair[0]], names[pair[1]], distances[row], times[row], *at, *places))
    return found
