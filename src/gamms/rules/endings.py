"""Rules that end games: an agent reaches its goal, time is up, or one team is left."""

from collections.abc import Callable, Collection, Hashable, Iterable, Mapping
from functools import partial
from typing import Annotated, Any, cast, overload

import numpy as np

from gamms.arguments import as_count, as_flag, as_float, as_key, show_as_call
from gamms.context import Context
from gamms.errors import BadValue, UnknownName
from gamms.game.block.in_core import ONE_THAT_SHOWS
from gamms.game.roles import as_team_or_role, get_team, is_role
from gamms.game.settings import Rank, RuleSpec, declared
from gamms.ir.graph import as_node_id, label_hint
from gamms.rules.in_core import in_core, is_exact_in_core
from gamms.rules.meetings import GameRule, make_player
from gamms.text import shown
from gamms.typing import NodeId, Rule
from gamms.typing.game import TEAMS, Member, Team
from gamms.visual.drawers.rules import GOALS, as_text, render_goals

_STARTS = "starts of "

Nodes = NodeId | Iterable[NodeId] | str  # one node, several nodes, or "starts of X"


class _UndecidedWinner:
    """A placeholder for the winner, a team that is known only at the end."""

    def __init__(self, name: str) -> None:
        self._name = name

    def __repr__(self) -> str:
        return self._name


# the team that reached its goal; the team with the highest score
ITS_TEAM = _UndecidedWinner("ITS_TEAM")
LEADER = _UndecidedWinner("LEADER")


@overload
def reach(team: Mapping[Any, Nodes], *, score: float = 0, passing: bool = True) -> Rule: ...
@overload
def reach(
    team: Member, nodes: Nodes, *, winner: Hashable = ITS_TEAM, score: float = 0, passing: bool = True
) -> Rule: ...
@show_as_call
def reach(
    team: Annotated[object, TEAMS],
    nodes: object = None,
    *,
    winner: Team = ITS_TEAM,
    score: float = 0,
    passing: bool = True,
) -> Rule:
    """Make a rule that ends the game when an agent on the ground reaches a goal of its team.

    The first time in a turn at which an agent is at a goal decides: each agent that is at a goal at this time is an
    event `reach` with `agent` and `node`. If agents of several teams are, the game is a draw, without a winner. See
    `contacts` for the times within a turn.

    Args:
        team: the team or role of the agents; or a mapping from teams to `nodes`, if several teams compete.
        nodes: one node, several, or the text "starts of X": the nodes on which the agents of team X began.
        winner: the team that wins, None for no team; by default the team that reached its goal.
        score: points for each team that reached its goal.
        passing: whether nodes that agents only pass count; False: only the nodes at the end of the turn, which all
            agents reach at the same time.

    Raises:
        BadType, BadValue: an argument is invalid, or a winner is given for several teams.
        UnknownName (KeyError): when the rule is added to a game, a node is not on the map.
    """
    is_one = not isinstance(team, Mapping) or (nodes is not None and is_role(team))
    given: Mapping[Any, object] = (
        {as_team_or_role(team, "team"): nodes} if is_one else cast("Mapping[Any, object]", team)
    )
    if nodes is not None and not is_one:
        raise BadValue(f"nodes={shown(nodes)} is not allowed here: {shown(team)} already has the nodes of each team.")
    if winner is not ITS_TEAM and len(given) > 1:
        raise BadValue(f"winner={shown(winner)} is for one team, but {list(given)} compete: the first to arrive wins.")
    teams = sorted((as_key(one, "A team") for one in given), key=str)
    goals = {one: _as_goal(given[one], get_team(one)) for one in teams}
    named = [*goals, *_check_winner(winner)]
    shown_goals = {get_team(one): goal for one, goal in goals.items()}
    as_float(score, "score")
    as_flag(passing, "passing")

    def prepare(ctx: Context) -> None:
        refuse_unknown(ctx, {node for goal in goals.values() if not isinstance(goal, str) for node in goal})
        _publish(ctx, shown_goals)

    def reach(ctx: Context) -> None:
        player(ctx)()

    def play(made: GameRule, ctx: Context) -> None:
        if ctx.game.turn == 1:  # now starts are known
            _publish(ctx, shown_goals)
        made.play(ctx)

    form = in_core("reach", goals, ONE_THAT_SHOWS if winner is ITS_TEAM else winner, score, passing)
    player = partial(make_player, form=form, play=play)
    return declared(
        reach,
        RuleSpec(
            prepare=prepare,
            drawer=render_goals,
            uses_scores=True,
            teams=named,
            starts_of=[goal for goal in goals.values() if isinstance(goal, str)],
            core_form=form if is_exact_in_core(score) else None,
            player=player,
        ),
    )


@show_as_call
def arrive(team: Member, nodes: Nodes, *, score: float = 1, passing: bool = True) -> Rule:
    """Make a rule that scores each agent on the ground that reaches a goal of its team, and takes it out of the game.

    Each arrival is an event `arrive` with `agent` and `node`. The game goes on; `none_left(team)` ends it when the team
    has no agents left.

    Args:
        team: the team or role of the agents.
        nodes: one node, several, or the text "starts of X": the nodes on which the agents of team X began.
        score: points for the team for each agent.
        passing: whether nodes that agents only pass count; False: only the nodes at the end of the turn.

    Raises:
        BadType, BadValue: an argument is invalid.
        UnknownName (KeyError): when the rule is added to a game, a node is not on the map.
    """
    member = as_team_or_role(team, "team")
    goal = _as_goal(nodes, get_team(member))
    goals: dict[Any, frozenset[int] | str] = {get_team(member): goal}
    points = as_float(score, "score")
    counts_passing = as_flag(passing, "passing")

    def prepare(ctx: Context) -> None:
        refuse_unknown(ctx, () if isinstance(goal, str) else goal)
        _publish(ctx, goals)

    def arrive(ctx: Context) -> None:
        player(ctx)()

    def play(made: GameRule, ctx: Context) -> None:
        if ctx.game.turn == 1:  # now starts are known
            _publish(ctx, goals)
        made.play(ctx)

    form = in_core("arrive", member, goal, points, counts_passing)
    player = partial(make_player, form=form, play=play)
    return declared(
        arrive,
        RuleSpec(
            prepare=prepare,
            drawer=render_goals,
            uses_scores=True,
            teams=[member],
            starts_of=[goal] if isinstance(goal, str) else [],
            core_form=form if is_exact_in_core(points) else None,
            player=player,
        ),
    )


@show_as_call
def time_limit(turns: int, winner: Team = LEADER) -> Rule:
    """Make a rule that ends the game after a number of turns.

    Args:
        turns: the number of turns.
        winner: the team that wins if the game lasts this long, None for no team; by default the team that alone has the
            highest score. All teams of agents count, including teams of dead agents; if there is only one team, it does
            not win by score.

    Raises:
        BadType, BadValue: the number is not an integer, or less than 1; or the winner is not a valid team.
    """
    last = as_count(turns, "turns")
    named = _check_winner(winner)

    def time_limit(ctx: Context) -> None:
        player(ctx)()

    def player(ctx: Context) -> Callable[[], None]:
        state = ctx.game.internals.state
        end = make_player(ctx, form, follows=False)

        def play() -> None:
            if state.turn >= last:  # NOTE: else the rule takes a twentieth of a turn of two agents (benchmarks: turns)
                end()

        return play

    form = in_core("time_limit", last, ONE_THAT_SHOWS if winner is LEADER else winner)
    return declared(
        time_limit,
        RuleSpec(
            teams=named,
            last_turn=last,
            uses_scores=winner is LEADER,
            rank=Rank.END,
            core_form=form,
            player=player,
        ),
    )


@show_as_call
def none_left(team: Member, winner: Team = LEADER) -> Rule:
    """Make a rule that ends the game when a team has no living agents, on the ground or in the air.

    Args:
        team: the team or role. A team that never had an agent does not end the game; neither does a role that no agent
            has, dead or alive.
        winner: the team that wins, None for no team; by default the team that alone has the highest score.

    Raises:
        BadType: `team` or `winner` is not a valid team.
    """
    member = as_team_or_role(team, "team")
    named = [member, *_check_winner(winner)]
    reason = f"all agents of {member} arrived or were eliminated"

    def none_left(ctx: Context) -> None:
        player(ctx)()

    form = in_core("none_left", member, reason, ONE_THAT_SHOWS if winner is LEADER else winner)
    player = partial(make_player, form=form, follows=False)
    return declared(
        none_left,
        RuleSpec(
            teams=named,
            uses_scores=winner is LEADER,
            rank=Rank.END,
            core_form=form,
            player=player,
        ),
    )


@show_as_call
def last_team() -> Rule:
    """Make a rule that ends the game when all living agents are of one team, which wins, or no agent is alive.

    Agents without a team (`team=None`) do not count; agents in the air do.
    """

    def last_team(ctx: Context) -> None:
        player(ctx)()

    form = in_core("last_team")
    player = partial(make_player, form=form, follows=False)
    return declared(last_team, RuleSpec(rank=Rank.END, core_form=form, player=player))


def _check_winner(winner: Team) -> list[Hashable]:
    """Return the team named as winner, checked, as a list; empty for a default and for None."""
    return [] if winner is None or isinstance(winner, _UndecidedWinner) else [as_key(winner, "winner")]


def as_nodes(given: object, name: str) -> frozenset[int]:
    """Return the ids of one node, or of several.

    Raises:
        BadType, BadValue: no node is given, or an id is not an integer.
    """
    several = given if isinstance(given, Iterable) and not isinstance(given, str) else [given]
    nodes = frozenset(as_node_id(node, name) for node in several)
    if not nodes:
        raise BadValue(f"{name} is missing: give one or more node ids.")
    return nodes


def get_state(ctx: Context, group: str, key: str, start: dict[str, Any]) -> dict[str, Any]:
    """Return the state of a rule, `ctx.game.data[group][key]`; `start` if it is new."""
    state: dict[str, Any] = ctx.game.data.setdefault(group, {}).setdefault(key, start)
    return state


def disclose_to_all(
    group: str, key: str | None = None
) -> Callable[[Mapping[str, Any], Collection[str]], dict[str, Any]]:
    """Return a `disclose` hook that shows everybody `ctx.game.data[group][key]`, or without a key the whole group."""

    def disclose(data: Mapping[str, Any], _: Collection[str]) -> dict[str, Any]:
        known = data.get(group, {})
        if key is not None:
            known = {key: known[key]} if key in known else {}
        return {group: known}

    return disclose


def refuse_unknown(ctx: Context, nodes: Iterable[int]) -> None:
    """Raise UnknownName for the first node that is not on the map."""
    for node in sorted(nodes):
        if not ctx.graph.graph.has_node(node):
            raise UnknownName("node", node, ctx.graph.graph.get_nodes())


def _publish(ctx: Context, goals: Mapping[Any, frozenset[int] | str]) -> None:
    """Publish the goals, for drawers."""
    known: dict[Any, str] = ctx.game.data.setdefault(GOALS, {})
    for team, goal in goals.items():
        nodes = _find_starts(ctx, goal) if isinstance(goal, str) else goal
        parts = [*known.get(team, "").split(), *as_text(np.array(sorted(nodes), np.int64)).split()]
        known[team] = " ".join(dict.fromkeys(parts))  # another rule may have other goals for the team


def _as_goal(goal: object, team: Hashable) -> frozenset[int] | str:
    """Return nodes, or the text that names the team whose starts are the goal."""
    if isinstance(goal, str):
        if not goal.startswith(_STARTS) or goal == _STARTS:
            raise BadValue(
                f"Team {shown(team)} cannot reach {shown(goal)}: give nodes, or a text like 'starts of blue'."
                f"{label_hint(goal)}"
            )
        return goal.removeprefix(_STARTS)
    return as_nodes(goal, f"A node for team {shown(team)} to reach")


def _find_starts(ctx: Context, team: str) -> frozenset[int]:
    """Return the start nodes of the agents on the ground of the team named in a text."""
    agents = [agent for one, agents in ctx.agent.teams.items() if str(one) == team for agent in agents]
    return frozenset([node for node in map(ctx.game.start_node, agents) if isinstance(node, int)])
