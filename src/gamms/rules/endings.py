"""How games end: an agent reaches its goal, time is up, or one team is left."""

from collections.abc import Callable, Collection, Hashable, Iterable, Mapping
from functools import lru_cache
from typing import Annotated, Any, overload

import numpy as np

from gamms.arguments import as_count, as_flag, as_float, as_int, as_key
from gamms.context import Context
from gamms.core import rules as core
from gamms.errors import BadValue, UnknownName
from gamms.game.batch.in_core import ONE_THAT_SHOWS, reason_of_goals
from gamms.game.settings import Rank, RuleSpec, declared
from gamms.rules.in_core import fits_core, in_core
from gamms.rules.meetings import column, living_teams, turn_of
from gamms.text import shown, shown_as_called
from gamms.typing import NodeId, Rule
from gamms.typing.game import TEAMS, Team
from gamms.visual.drawers.rules import GOALS, as_text, render_goals

_STARTS = "starts of "
_MOST_GOALS = 64  # of which it is kept whose they are

Nodes = NodeId | Iterable[NodeId] | str  # a node, several, or "starts of X"


class _Winner:
    """Stands for a team that shows only at the end."""

    def __init__(self, name: str) -> None:
        self._name = name

    def __repr__(self) -> str:
        return self._name


ITS_TEAM, LEADER = _Winner("ITS_TEAM"), _Winner("LEADER")  # that reached its goal, with the highest score


@overload
def reach(team: Mapping[Any, Nodes], *, score: float = 0, passing: bool = True) -> Rule: ...
@overload
def reach(
    team: Hashable, nodes: Nodes, *, winner: Hashable = ITS_TEAM, score: float = 0, passing: bool = True
) -> Rule: ...
@shown_as_called
def reach(
    team: Annotated[object, TEAMS],
    nodes: object = None,
    *,
    winner: Team = ITS_TEAM,
    score: float = 0,
    passing: bool = True,
) -> Rule:
    """Make a rule by which the game ends when an agent on the ground reaches a goal of its team.

    The first moment of the turn counts at which one is there: each agent that is there then is an event `reach` with
    `agent` and `node`, and teams that get there at the same moment draw: there is no winner. See `contacts` for
    the moments of a turn.

    Args:
        team: the team of the agents; or a mapping from teams to their `nodes`, where several compete.
        nodes: a node, several, or the text "starts of X": where the agents of team X began.
        winner: the team that wins, None for no team; by default the one that reached its goal.
        score: points for each team that reached its goal.
        passing: whether agents get to the nodes that they pass, too; False: only to those where they are at the end of
            the turn, and all that are there are there at once.

    Raises:
        BadType, BadValue: an argument is not one of these, or a winner is given for several teams.
        UnknownName (KeyError): when it is added to a game, a node is not on the map.
    """
    given = team if isinstance(team, Mapping) else {as_key(team, "team"): nodes}
    if isinstance(team, Mapping) and nodes is not None:
        raise BadValue(f"nodes={shown(nodes)} is too much: {shown(team)} says already which team is to reach what.")
    if winner is not ITS_TEAM and len(given) > 1:
        raise BadValue(f"winner={shown(winner)} is for one team, and {list(given)} compete: the first to arrive wins.")
    teams = sorted((as_key(one, "A team") for one in given), key=str)
    goals = {one: _as_goal(given[one], one) for one in teams}
    named = [*goals, *_named_winner(winner)]
    as_float(score, "score")
    as_flag(passing, "passing")

    def prepare(ctx: Context) -> None:
        refuse_unknown(ctx, {node for goal in goals.values() if not isinstance(goal, str) for node in goal})
        _publish(ctx, goals)

    def reach(ctx: Context) -> None:
        if ctx.game.turn == 1:  # now starts are known
            _publish(ctx, goals)
        there = _arrive(ctx, goals, passing=passing)
        for one in there if score else ():
            ctx.game.scores[one] += score
        if there:
            reason, won = _end_of(there, winner)
            ctx.game.end(reason, winner=won)

    shown_winner = ONE_THAT_SHOWS if winner is ITS_TEAM else winner
    core_form = in_core("reach", goals, shown_winner, score, passing) if fits_core(score) else None
    return declared(
        reach,
        RuleSpec(
            prepare=prepare,
            drawer=render_goals,
            teams=named,
            core_form=core_form,
        ),
    )


@shown_as_called
def arrive(team: Team, nodes: Nodes, *, score: float = 1, passing: bool = True) -> Rule:
    """Make a rule by which each agent on the ground that reaches a goal of its team scores and is out.

    Each is an event `arrive` with `agent` and `node`. The game goes on; `none_left(team)` ends it when no agent of
    the team is left.

    Args:
        team: the team of the agents.
        nodes: a node, several, or the text "starts of X": where the agents of team X began.
        score: points for the team, for each agent.
        passing: whether nodes count that agents pass, too; False: only those where they are at the end of the turn.

    Raises:
        BadType, BadValue: an argument is not one of these.
        UnknownName (KeyError): when it is added to a game, a node is not on the map.
    """
    goals: dict[Any, frozenset[int] | str] = {as_key(team, "team"): _as_goal(nodes, team)}
    goal, points, counts_passing = goals[team], as_float(score, "score"), as_flag(passing, "passing")

    def prepare(ctx: Context) -> None:
        refuse_unknown(ctx, () if isinstance(goal, str) else goal)
        _publish(ctx, goals)

    def arrive(ctx: Context) -> None:
        if ctx.game.turn == 1:  # now starts are known
            _publish(ctx, goals)
        there = _at_goal(ctx, team, goal, passing=counts_passing)
        for _, node, name, _ in there:
            ctx.game.emit("arrive", agent=name, node=node)
        for _, _, name, _ in there:
            ctx.game.scores[team] += points
            ctx.game.eliminate(name)

    core_form = in_core("arrive", team, goal, points, counts_passing) if fits_core(points) else None
    return declared(
        arrive,
        RuleSpec(
            prepare=prepare,
            drawer=render_goals,
            teams=list(goals),
            core_form=core_form,
        ),
    )


@shown_as_called
def time_limit(turns: int, winner: Team = LEADER) -> Rule:
    """Make a rule that ends the game after so many turns.

    Args:
        turns: how many.
        winner: the team that wins if the game lasts so long, None for no team; by default the one with the highest
            score, if it is one alone. Teams are those that agents play for, dead ones included; where there is only
            one, there is no winner by the score.

    Raises:
        BadType, BadValue: the number is not an integer, or less than 1; or the winner cannot be a team.
    """
    last = as_count(turns, "turns")
    named = _named_winner(winner)

    def time_limit(ctx: Context) -> None:
        if ctx.game.turn >= last:
            ctx.game.end("time limit", winner=_leader(ctx) if winner is LEADER else winner, truncated=True)

    core_form = in_core("time_limit", last, ONE_THAT_SHOWS if winner is LEADER else winner)
    return declared(
        time_limit,
        RuleSpec(
            teams=named,
            last_turn=last,
            rank=Rank.END,
            core_form=core_form,
        ),
    )


@shown_as_called
def none_left(team: Team, winner: Team = LEADER) -> Rule:
    """Make a rule that ends the game when no agent of a team is alive, those in the air included.

    Args:
        team: the team; it is not over before the team has had an agent.
        winner: the team that wins then, None for no team; by default the one with the highest score, if it is one
            alone.

    Raises:
        BadType: one of them cannot be a team.
    """
    named = [as_key(team, "team"), *_named_winner(winner)]

    def none_left(ctx: Context) -> None:
        if team not in living_teams(ctx) and team in ctx.agent.teams:
            ctx.game.end(_none_in_play(team), winner=_leader(ctx) if winner is LEADER else winner)

    core_form = in_core("none_left", team, _none_in_play(team), ONE_THAT_SHOWS if winner is LEADER else winner)
    return declared(
        none_left,
        RuleSpec(
            teams=named,
            rank=Rank.END,
            core_form=core_form,
        ),
    )


def _none_in_play(team: Team) -> str:
    """Return the reason of an end that is as true of agents that arrived as of agents that were tagged."""
    return f"no agent of {team} is in play"


@shown_as_called
def last_team() -> Rule:
    """Make a rule that ends the game when the living agents are of one team, which wins, or of none.

    Agents of no team (`team=None`) do not count; those in the air do.
    """

    def last_team(ctx: Context) -> None:
        left = living_teams(ctx) - {None}
        if len(left) <= 1:
            ctx.game.end("last team", winner=next(iter(left), None))

    core_form = in_core("last_team")
    return declared(last_team, RuleSpec(rank=Rank.END, core_form=core_form))


def _named_winner(winner: Team) -> list[Hashable]:
    """Return the team that a rule says wins, checked; none for a default, and for None, which is no team."""
    return [] if winner is None or isinstance(winner, _Winner) else [as_key(winner, "winner")]


def as_nodes(given: object, name: str) -> frozenset[int]:
    """Return the ids of a node, or of several.

    Raises:
        BadType, BadValue: there is none, or one is no integer.
    """
    nodes = frozenset(as_int(node, name) for node in (given if isinstance(given, Iterable) else [given]))
    if not nodes:
        raise BadValue(f"{name} is missing: give the id of a node, or several.")
    return nodes


def as_teams(given: object) -> frozenset[Hashable] | None:
    """Return several teams, or one, as a set; None: all."""
    if given is None:
        return None
    several = given if isinstance(given, Iterable) and not isinstance(given, str) else [given]
    return frozenset(as_key(team, "A team") for team in several)


def state_of(ctx: Context, group: str, key: str, start: dict[str, Any]) -> dict[str, Any]:
    """Return what a rule remembers, in `ctx.game.data[group][key]`; the start if that is new."""
    state: dict[str, Any] = ctx.game.data.setdefault(group, {}).setdefault(key, start)
    return state


def all_know(group: str, key: str | None = None) -> Callable[[Mapping[str, Any], Collection[str]], dict[str, Any]]:
    """Return a hook `disclose` by which all know what is in `ctx.game.data[group][key]`, or all of the group."""

    def disclose(data: Mapping[str, Any], _: Collection[str]) -> dict[str, Any]:
        known = data.get(group, {})
        if key is not None:
            known = {key: known[key]} if key in known else {}
        return {group: known}

    return disclose


def refuse_unknown(ctx: Context, nodes: Iterable[int]) -> None:
    """Raise UnknownName for the first node that the map does not have."""
    for node in sorted(nodes):
        if not ctx.graph.graph.has_node(node):
            raise UnknownName("node", node, ctx.graph.graph.get_nodes())


def _arrive(ctx: Context, goals: Mapping[Any, frozenset[int] | str], *, passing: bool) -> list[Hashable]:
    """Return the teams of the agents that are first at a goal of their team; each agent is an event."""
    arrived = []
    for team, goal in goals.items():
        arrived += _at_goal(ctx, team, goal, passing=passing)
    earliest = min((one[0] for one in arrived), default=None)
    first = [one for one in arrived if one[0] == earliest]
    for _, node, name, _ in first:
        ctx.game.emit("reach", agent=name, node=node)
    return list(dict.fromkeys(team for *_, team in first))


def _at_goal(
    ctx: Context, team: Hashable, goal: frozenset[int] | str, *, passing: bool
) -> list[tuple[float, int, str, Hashable]]:
    """Return moment, node, name and team of the agents of a team that get to its goal, each the first time."""
    turn = turn_of(ctx)
    roster, pieces = turn.roster, turn.scratch()
    if team not in roster.teams:
        return []
    owners = roster.owners(_goal_of(_starts(ctx, goal) if isinstance(goal, str) else goal, team), turn.numbers)
    tracks = turn.visits(passing=passing)
    count = core.find_arrivals(tracks, turn.legs, pieces, roster.team, owners, roster.teams[team])
    found = []
    for piece in pieces.order[:count] if count else ():
        node, name = turn.numbers.ids[pieces.nodes[piece]], roster.names[pieces.agents[piece]]
        found.append((pieces.since[piece], node, name, team))
    return found


@lru_cache(_MOST_GOALS)
def _goal_of(nodes: frozenset[int], team: Hashable) -> Mapping[int, Hashable]:
    """Return nodes as a territory of a team; the same object for the same nodes."""
    return dict.fromkeys(nodes, team)


def _end_of(there: list[Hashable], winner: Team) -> tuple[str, Hashable]:
    """Return the reason of the end when these teams have reached their goals, and the winner."""
    won = there[0] if winner is ITS_TEAM else winner
    return reason_of_goals(there), won if len(there) == 1 else None


def _publish(ctx: Context, goals: Mapping[Any, frozenset[int] | str]) -> None:
    """Say where the goals are, for those who draw the game."""
    known: dict[Any, str] = ctx.game.data.setdefault(GOALS, {})
    for team, goal in goals.items():
        nodes = _starts(ctx, goal) if isinstance(goal, str) else goal
        parts = [*known.get(team, "").split(), *as_text(np.array(sorted(nodes), np.int64)).split()]
        known[team] = " ".join(dict.fromkeys(parts))  # another rule may have goals of the team, too


def _leader(ctx: Context) -> Hashable:
    """Return the team with the highest score; None if there are several, or no other team."""
    teams = [team for team in ctx.agent.teams if team is not None]
    best = core.leader(column("d", [ctx.game.scores[team] for team in teams]))
    return None if best < 0 else teams[best]


def _as_goal(goal: object, team: Hashable) -> frozenset[int] | str:
    """Return nodes, or the text of the team whose starts are the goal."""
    if isinstance(goal, str):
        if not goal.startswith(_STARTS) or goal == _STARTS:
            raise BadValue(
                f"Team {shown(team)} is to reach {shown(goal)}: give nodes, or a text such as 'starts of blue'."
            )
        return goal.removeprefix(_STARTS)
    return as_nodes(goal, f"A node for team {shown(team)} to reach")


def _starts(ctx: Context, team: str) -> frozenset[int]:
    """Return where the agents on the ground of the team of that text began."""
    agents = [agent for one, agents in ctx.agent.teams.items() if str(one) == team for agent in agents]
    return frozenset([node for node in map(ctx.game.start_node, agents) if isinstance(node, int)])
