"""Contacts: pairs of agents that meet on a node, pass on an edge, or come within some distance during a turn.

A turn is the time from 0 to 1; `gamms.core.contacts` finds the contacts.
"""

from collections.abc import Iterable
from typing import Any, NamedTuple

from gamms.arguments import as_context, as_flag, as_items, as_range, explain_call_errors
from gamms.context import Context
from gamms.core.contacts import Contacts
from gamms.core.rules import Tagging, fill_steps
from gamms.errors import BadType, BadValue, UnknownName, nearest
from gamms.game.block.in_core import ContactOptions, RuleBuilder
from gamms.game.roles import as_team_or_role, get_team
from gamms.rules.in_core import tagging
from gamms.rules.meetings import Side, get_contacts, get_rule, list_in_air
from gamms.text import shown


class Contact(NamedTuple):
    """Two agents that meet, by name, one of each side."""

    a: str  # the agent of the first side
    b: str  # that of the second
    distance: float  # 0 on the same node or when passing; else in the unit of the query
    time: float = 1.0  # of the turn, from 0 to 1
    a_node: int = -1  # node of `a`; on an edge, the last node that it passed
    b_node: int = -1  # node of `b`; on an edge, the last node that it passed
    a_xy: tuple[float, float] | None = None  # in games by metres: the exact position of `a`
    b_xy: tuple[float, float] | None = None  # in games by metres: the exact position of `b`


@explain_call_errors
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
    """Return all pairs of living agents, one of each side, that are in contact; earliest first, then nearest.

    Ties are ordered by keyed draws. Times within a turn are numbers from 0 to 1: an agent that moves along n edges is
    at the k-th node at time k/n, or, with speeds, when it has moved that many metres; an agent that stays is at its
    node from time 0.

    Args:
        ctx: the context.
        a: one side: a team, a role such as `{"team": "red", "names": ["truck"]}` or `{"team": "red", "where": {"kind":
            "drone"}}`, or a function that returns whether an agent is on this side.
        b: the other side, given in the same way. No agent meets itself.
        hops: maximum number of edges between agents, by the shortest path in either direction.
        metres: maximum length of this path.
        euclid: maximum straight-line distance in map units; agents on the ground have height 0. Without any of these
            three, agents must be on the same node.
        crossing: whether agents that move along one edge in opposite directions meet; None: only if no distance is
            given.
        air: whether aerial agents take part; each counts as on its nearest node, except with `euclid`. An agent that
            flew arrives at the end of the turn.
        passing: whether agents also meet on their way; False: only where they are at the end of the turn, or when they
            pass each other on an edge. An agent that was relocated since meets no agent on its way. With a distance,
            agents are compared whenever one of the two reaches a node; an agent between two nodes counts as on the last
            node that it passed.

    Raises:
        BadType, BadValue: a distance is invalid, or there are several.
        UnknownName (KeyError): a team that no agent has or had resembles that of others.
    """
    nearness = as_nearness(hops, metres, euclid, crossing=crossing, air=air, passing=passing)
    _refuse_misspelled(ctx, a)
    _refuse_misspelled(ctx, b)
    first: dict[tuple[str, str], Contact] = {}
    for contact in find_contacts(as_context(ctx, "contacts"), as_side(a), as_side(b), nearness):
        first.setdefault(contact[:2], contact)
    return list(first.values())


def _refuse_misspelled(ctx: Context, side: Side) -> None:
    """Refuse a team that no agent has or had, and that resembles another one; see `contacts`."""
    if callable(side):
        return
    team = get_team(as_side(side))
    block = ctx.agent.block
    if team is None or team in block.teams or team in block.team_rows:
        return
    teams = sorted({*block.teams, *block.team_rows} - {None}, key=str)
    gone = {team for team, _ in ctx.game.internals.state.departed.values()}
    if team not in gone and nearest(team, teams):
        raise UnknownName("team", team, teams)


def one_to_one(met: Iterable[Contact]) -> list[Contact]:
    """Return the contacts, selected in order, whose agents are in no contact that was selected before."""
    taken: set[str] = set()
    pairs = []
    for contact in as_items(met, "met", "contacts"):
        if not isinstance(contact, Contact):
            raise BadType(f"one_to_one takes contacts from gamms.rules.contacts, not {shown(contact)}.")
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
) -> ContactOptions:
    """Check the distance options passed by a caller.

    Raises:
        BadType, BadValue: a distance is invalid, or there are several.
    """
    distances = {"hops": hops, "metres": metres, "euclid": euclid}
    given = {unit: distance for unit, distance in distances.items() if distance is not None}
    if len(given) > 1:
        several = " and ".join(f"{unit}={shown(distance)}" for unit, distance in given.items())
        raise BadValue(f"Give one distance, not {several}.")
    on_edges = not given if crossing is None else as_flag(crossing, "crossing")
    unit, limit = next(((unit, as_range(distance, unit)) for unit, distance in given.items()), (None, 0.0))
    return ContactOptions(unit, limit, on_edges, as_flag(air, "air"), as_flag(passing, "passing"))


def as_side(side: Side) -> Side:
    """Return a side: a team, a `Role`, or a function of an agent.

    Raises:
        BadType, BadValue, UnknownName (KeyError): a team or role is invalid.
    """
    return side if callable(side) else as_team_or_role(side)


def find_contacts(ctx: Context, a: Side, b: Side, nearness: ContactOptions) -> list[Contact]:
    """Return all contacts of a turn, in the order of `contacts`; two agents may have several."""

    def form(making: RuleBuilder) -> Tagging:
        turn = get_contacts(ctx)
        return tagging(making, (a, b), turn.purpose, turn.roster.turn, nearness=nearness)

    key = None if callable(a) or callable(b) else (a, b, nearness)
    made = get_rule(ctx, form, key)
    turn = made.makes.turn
    names = turn.roster.names
    ids = turn.numbers.ids
    fill_steps(turn.steps, turn.roster.games, 0)
    if not made.rule.find(turn.roster.games, 0):
        return []
    met: Contacts = made.rule.contacts
    agents = (met.a, met.b)
    nodes = (met.a_nodes, met.b_nodes)
    distances = met.distances
    times = met.times
    flying = list_in_air(ctx, nearness)
    found = []
    for row in met.order[: met.kept]:
        pair = [column[row] for column in agents]
        at: list[Any] = [ids[column[row]] for column in nodes]
        places: list[Any] = []
        if turn.by_metres:
            for agent, node in zip(pair, at, strict=True):
                places.append(turn.find_xy(agent, times[row], node, nearness, flying.get(names[agent])))
        found.append(Contact(names[pair[0]], names[pair[1]], distances[row], times[row], *at, *places))
    return found
