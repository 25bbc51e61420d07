"""Resolvers: which agents win a contest, by priority, at random, none, or by a function of the caller."""

from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple, cast

from gamms import kernels
from gamms.agent import BaseAgent
from gamms.arguments import as_key
from gamms.context import Context
from gamms.errors import BadType, BadValue, MissingKey, nearest
from gamms.text import shown
from gamms.typing.game import Move


class Contest(NamedTuple):
    """More agents than places: what a resolver decides."""

    node: int | tuple[int, int]  # the node they all want to end on; for an exchange its two nodes, the smaller first
    places: int  # how many of them may win, at least 1 and fewer than there are
    movers: tuple[Move, ...]  # by name


Resolver = Callable[[Contest, Any], Iterable[str | Move]]  # called with the contest and the `gamms.Context`


def by_priority(teams_or_key: Sequence[Hashable] | Callable[[BaseAgent], Any]) -> Resolver:
    """Make a resolver by which those that come first win; the names decide between equals.

    Args:
        teams_or_key: the teams, the first to win first. Or a function that is called with an agent: those with the
            smallest values win.

    Raises:
        BadType: neither a list of teams nor a function. While resolving: values that cannot be compared.
        BadValue: no team at all, or one twice.
        MissingKey (KeyError): while resolving, an agent of a team that is not in the list.
    """
    if callable(teams_or_key):
        return _by_key(teams_or_key)
    if isinstance(teams_or_key, (str, bytes)) or not isinstance(teams_or_key, Sequence):
        raise BadType(
            "by_priority needs a list of teams, the first to win first, or a function of an agent, "
            f"not {shown(teams_or_key)} ({type(teams_or_key).__name__})."
        )
    return _by_team(tuple(teams_or_key))


def at_random() -> Resolver:
    """Make a resolver that draws a number for each agent in every turn; the smallest win.

    The draw follows from the seed of the context, the turn and the agent's name alone. So neither other agents, other
    draws nor the order of contests change it, and an agent in two contests of a turn keeps its number.
    """

    def at_random(contest: Contest, ctx: Context) -> list[Move]:
        movers = contest.movers
        purpose = kernels.purpose_key(ctx.seed, "conflicts")
        lots = kernels.lots(purpose, (mover.agent for mover in movers), ctx.game.turn)
        order = sorted(range(len(movers)), key=lots.__getitem__)
        return [movers[number] for number in order[: contest.places]]

    return at_random


def nobody() -> Resolver:
    """Make a resolver by which no agent wins: where too many want to go, all stay."""

    def nobody(_contest: Contest, _ctx: Context) -> tuple[Move, ...]:
        return ()

    return nobody


FACTORIES = (by_priority, at_random, nobody)


def as_resolver(resolve: object) -> Resolver:
    """Check what a caller gave as resolver.

    Raises:
        BadType: it cannot be called, or is a maker of resolvers that has not been called yet.
    """
    for factory in FACTORIES:
        if resolve is factory:
            raise BadType(f"resolve={factory.__name__} only makes a resolver: call it, as in {factory.__name__}(…).")
    if not callable(resolve):
        raise BadType(f"resolve must be a function (contest, ctx) -> winners, not {shown(resolve)}.")
    return cast("Resolver", resolve)  # what it takes and gives shows when it is called


def winners_of(contest: Contest, resolve: Resolver, ctx: Context) -> set[str]:
    """Return the names of the winners by a resolver, checked.

    Raises:
        BadType: it gave something else than names or moves.
        BadValue: it named an agent that takes no part, or too many.
    """
    answer: object = resolve(contest, ctx)
    if isinstance(answer, (str, Move)) or not isinstance(answer, Iterable):
        raise BadType(
            f"{_asked(resolve, contest)} must give a list of the winners, names or moves, not {shown(answer)}."
        )
    winners = {winner.agent if isinstance(winner, Move) else _as_name(winner, resolve, contest) for winner in answer}
    names = [mover.agent for mover in contest.movers]
    for winner in sorted(winners.difference(names)):
        raise BadValue(
            f"{_asked(resolve, contest)} let {shown(winner)} win, not one of {names}.{nearest(winner, names)}"
        )
    if len(winners) > contest.places:
        few = f"contest.places is {contest.places}"
        raise BadValue(f"{_asked(resolve, contest)} let {len(winners)} win, {sorted(winners)}, but {few}.")
    return winners


def _as_name(winner: object, resolve: Resolver, contest: Contest) -> str:
    if isinstance(winner, str):
        return winner
    raise BadType(f"{_asked(resolve, contest)} must name winners or give their moves, not {shown(winner)}.")


def _asked(resolve: Resolver, contest: Contest) -> str:
    what = "the exchange of nodes" if isinstance(contest.node, tuple) else "node"
    return f"The resolver {getattr(resolve, '__name__', repr(resolve))!r}, asked about {what} {contest.node},"


def _by_key(key: Callable[[BaseAgent], Any]) -> Resolver:
    def by_priority(contest: Contest, ctx: Context) -> list[Move]:
        agent_of = ctx.agent.get_agent
        ranks = [key(agent_of(mover.agent)) for mover in contest.movers]
        return _first(contest, ranks)

    return by_priority


def _by_team(teams: tuple[Hashable, ...]) -> Resolver:
    rank_of = _ranks(teams)

    def by_priority(contest: Contest, _ctx: Context) -> list[Move]:
        for mover in contest.movers:
            if mover.team not in rank_of:
                raise MissingKey(
                    f"by_priority has no place for team {shown(mover.team)} of agent {mover.agent!r}. "
                    f"Put it into the list {shown(list(teams))}."
                )
        return _first(contest, [rank_of[mover.team] for mover in contest.movers])

    return by_priority


def _ranks(teams: tuple[Hashable, ...]) -> Mapping[Any, int]:
    ranks: dict[Hashable, int] = {}
    for rank, team in enumerate(teams):
        if as_key(team, "A team") in ranks:
            raise BadValue(f"by_priority lists team {shown(team)} twice: {shown(list(teams))}.")
        ranks[team] = rank
    if not ranks:
        raise BadValue("by_priority needs at least one team.")
    return ranks


def _first(contest: Contest, ranks: list[Any]) -> list[Move]:
    """Return those with the smallest ranks; of equals those that come first, which is by name."""
    try:
        order = sorted(range(len(ranks)), key=ranks.__getitem__)
    except TypeError:
        ranked = ", ".join(f"{mover.agent}: {shown(rank)}" for mover, rank in zip(contest.movers, ranks, strict=True))
        raise BadType(f"by_priority cannot compare what its key gave for {ranked}.") from None
    return [contest.movers[number] for number in order[: contest.places]]
