"""Resolvers of conflicts between moves: which agents win if there is not enough room for all.

A resolver is a function `(contest, ctx) -> winners`, or a `Ranking`, which the core evaluates without calling Python.
Both work in `ctx.game` and in batches. `Conflicts` itself is in `game/conflicts.py`.
"""

from collections.abc import Callable, Hashable, Sequence
from functools import partial
from typing import Any

from gamms.agent import BaseAgent
from gamms.arguments import show_as_call
from gamms.context import Context
from gamms.errors import BadType, BadValue, MissingKey
from gamms.game.conflicts import Contest, Rank, Ranking, Resolver
from gamms.game.roles import Role, as_team_or_role, get_team, has_attributes, is_among
from gamms.text import shown
from gamms.typing.game import Member, Move


@show_as_call
def by_rank(rank: Rank) -> Resolver:
    """Make a resolver that lets the agents with the smallest ranks win; ties go to the first name.

    This is the fastest custom resolver: agents are ranked once for a game, not in each contest.

    Args:
        rank: `(name, team) -> rank`, called with the name and the team of an agent. Ranks are numbers or other
            comparable values. An agent whose rank is None never wins.

    Raises:
        BadType: not a function. When a game begins: ranks that cannot be compared.
    """
    if not callable(rank):
        raise BadType(f"by_rank needs a function (name, team) -> rank, not {shown(rank)}.")
    return Ranking(rank)


@show_as_call
def by_priority(teams_or_key: Sequence[Member] | Callable[[BaseAgent], Any]) -> Resolver:
    """Make a resolver that lets agents win in order of priority; ties go to the first name.

    Args:
        teams_or_key: the teams and roles in order of priority; the first one counts that an agent belongs to. Or a
            function that is called with an agent: the smallest values win.

    Raises:
        BadType: neither a list of teams nor a function. During resolution: values that cannot be compared.
        BadValue: the list is empty, or has a team or role twice.
        MissingKey (KeyError): when a turn begins, the team of a living agent on the ground is not in the list. With
            roles, when an agent is in a conflict that has none of them.
    """
    if callable(teams_or_key):
        return _resolve_by_key(teams_or_key)
    if isinstance(teams_or_key, (str, bytes)) or not isinstance(teams_or_key, Sequence):
        raise BadType(
            "by_priority needs a list of teams, the first to win first, or a function of an agent, "
            f"not {shown(teams_or_key)} ({type(teams_or_key).__name__})."
        )
    return _resolve_by_member(list(teams_or_key))


@show_as_call
def nobody() -> Resolver:
    """Make a resolver that lets no agent win: if there is not enough room, all stay."""
    return Ranking(lambda _name, _team: None, of_team=True)


def _resolve_by_key(key: Callable[[BaseAgent], Any]) -> Resolver:
    """Return a resolver that calls a function with each agent of a contest; its values may change every turn."""

    def by_priority(contest: Contest, ctx: Context) -> list[Move]:
        ranks = [key(ctx.agent.get_agent(mover.agent)) for mover in contest.movers]
        try:
            order = sorted(range(len(ranks)), key=ranks.__getitem__)  # ties keep the order of names
        except TypeError:
            ranked = ", ".join(f"{one.agent}: {shown(rank)}" for one, rank in zip(contest.movers, ranks, strict=True))
            raise BadType(f"by_priority cannot compare the values of its key for {ranked}.") from None
        return [contest.movers[number] for number in order[: contest.places]]

    return by_priority


def _resolve_by_member(given: list[Any]) -> Resolver:
    """Return a resolver by teams and roles; one by attributes, which may change, looks at the agents each time."""
    members = [as_team_or_role(one) for one in given]
    for number, member in enumerate(members):
        if member in members[:number]:
            raise BadValue(f"by_priority lists {_name_member(member)} twice: {shown(given)}.")
    if not members:
        raise BadValue("by_priority needs at least one team.")

    def rank(name: str, team: Hashable, belongs: Callable[[Hashable], bool]) -> int:
        for number, member in enumerate(members):
            if belongs(member):
                return number
        raise MissingKey(
            f"by_priority does not list team {shown(team)} of agent {name!r}. Put it into the list {shown(given)}."
        )

    if has_attributes(members):
        return _resolve_by_key(lambda agent: rank(agent.name, agent.team, lambda member: is_among(agent, [member])))
    return Ranking(
        lambda name, team: rank(name, team, partial(_is_named, name, team)),
        of_team=not any(isinstance(member, Role) for member in members),
    )


def _is_named(name: str, team: Hashable, member: Hashable) -> bool:
    """Return whether an agent is in a team, or in a role by its name."""
    return get_team(member) == team and (not isinstance(member, Role) or name in (member.names or ()))


def _name_member(member: Hashable) -> str:
    """Return what an error calls a team or a role."""
    return f"the role {member}" if isinstance(member, Role) else f"team {shown(member)}"
