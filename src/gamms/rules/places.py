"""What teams do on nodes: hold them for some turns, and discover them with their sensors."""

from collections.abc import Hashable, Iterable, Mapping
from typing import Annotated, Any, NamedTuple

import numpy as np

from gamms.arguments import as_count, as_flag, as_float, as_name, as_range
from gamms.context import Context
from gamms.errors import BadType, NotOffered
from gamms.ir.graph import FloatArray
from gamms.plain import to_plain, why_not_plain
from gamms.rules.contacts import nodes_within
from gamms.rules.endings import Rank, as_nodes, as_teams, refuse_unknown, state_of, with_hooks
from gamms.text import shown, shown_as_called
from gamms.typing import AgentType, IAgent, NodeId, Rule
from gamms.typing.game import TEAMS
from gamms.visual.drawers.rules import as_text
from gamms.visual.drawers.standings import DISCOVERED, HELD, render_discovered, render_held


@shown_as_called
def hold(
    nodes: NodeId | Iterable[NodeId],
    turns: int,
    *,
    every: bool = False,
    score: float = 0,
    ends: bool = True,
    teams: Annotated[Iterable[Hashable] | None, TEAMS] = None,
    key: str = "hold",
) -> Rule:
    """Make a rule by which a team wins that holds a place for so many turns in a row.

    Only ends of turns count. A team holds the place while one of its living agents is there on the ground and none of
    another team is. While several teams are there, the count of the one that holds it stops; once that team is gone,
    the count is back at 0. When it is full, there is an event `hold` with `team` and `turns`. Agents of no team neither
    hold a place nor contest it.

    Args:
        nodes: the place: a node, or several.
        turns: how many.
        every: whether a team needs an agent on each of the nodes; False: on one of them.
        score: points for a team whose count is full.
        ends: whether it wins then, and the game ends; False: the count begins again, so that `turns=1` gives points for
            every turn.
        teams: those that may hold the place, one or several; None: all. The others contest it.
        key: of its state; a second rule of this kind needs another one.

    Raises:
        BadType, BadValue: an argument is not one of these.
        UnknownName (KeyError): when it is added to a game, a node is not on the map.
    """
    place, full, may_hold = as_nodes(nodes, "A node to hold"), as_count(turns, "turns"), as_teams(teams)
    needs_all, wins, points = as_flag(every, "every"), as_flag(ends, "ends"), as_float(score, "score")
    state_key = as_name(key, "the state of the rule")
    start = {"nodes": as_text(np.array(sorted(place), np.int64)), "team": None, "turns": 0, "of": full}

    def prepare(ctx: Context) -> None:
        refuse_unknown(ctx, place)
        state_of(ctx, HELD, state_key, dict(start))

    def hold(ctx: Context) -> None:
        state = state_of(ctx, HELD, state_key, dict(start))
        there = _teams_on(ctx, place)
        able = [team for team, on in there.items() if (on == place or not needs_all) and team in (may_hold or there)]
        if state["team"] not in able:
            state["team"], state["turns"] = None, 0
        if len(able) != 1 or len(there) != 1:
            return
        state["team"] = team = able[0]
        state["turns"] += 1
        if state["turns"] < full:
            return
        ctx.game.emit("hold", team=team, turns=full)
        if points:
            ctx.game.scores[team] += points
        if wins:
            ctx.game.end(f"{team} held its place", winner=team)
        else:
            state["turns"] = 0

    named = sorted(may_hold or (), key=str)
    return with_hooks(hold, prepare=prepare, drawer=render_held, teams=named, rank=Rank.PLACES, key=state_key)


def _teams_on(ctx: Context, place: frozenset[int]) -> dict[Any, set[int]]:
    """Return team -> the nodes of a place on which it has living agents."""
    there: dict[Any, set[int]] = {}
    for agent in ctx.game.agents:
        if agent.current_node_id in place and agent.team is not None and agent.type is not AgentType.AERIAL:
            there.setdefault(agent.team, set()).add(agent.current_node_id)
    return there


@shown_as_called
def discover(
    nodes: NodeId | Iterable[NodeId] | Mapping[Any, Any],
    *,
    hops: float = 0,
    score: float = 0,
    teams: Annotated[Iterable[Hashable] | None, TEAMS] = None,
    key: str = "discovered",
) -> Rule:
    """Make a rule by which teams discover nodes, and what is there, when a sensor of a living agent has them in view.

    Ends of turns count. An agent on the ground also sees the node that it is on, and those at most `hops` edges ahead.
    What is discovered stays known. Each discovery is an event `discover` with `agent` (of several the first by name),
    `team`, `node`, and `first`: whether no other team has discovered it in an earlier turn. A team knows what it has
    discovered: its `state["facts"][key]` is node -> what is there.

    Args:
        nodes: a node, several, or node -> what is there, such as "flag" or "decoy": any plain value.
        hops: how many edges far an agent on the ground sees without sensors.
        score: points for each team that is the first to discover a node; two in one turn both get them.
        teams: those that discover nodes, one or several; None: all.
        key: of its state and its facts; a second rule of this kind needs another one.

    Raises:
        BadType, BadValue: an argument is not one of these.
        UnknownName (KeyError): when it is added to a game, a node is not on the map.
    """
    hidden = sorted(as_nodes(nodes, "A node to discover"))
    what = {node: nodes[node] for node in hidden} if isinstance(nodes, Mapping) else dict.fromkeys(hidden, True)
    flaw = why_not_plain(what)
    if flaw:
        raise BadType(f"What is on a node must be a plain value, such as 'decoy', not {shown(what)}: {flaw}.")
    state_key, points, radius = as_name(key, "the state of the rule"), as_float(score, "score"), as_range(hops, "hops")
    game = _Discovery(what, as_teams(teams), points, radius, state_key)

    def discover(ctx: Context) -> None:
        game.play(ctx)

    named = sorted(game.teams or (), key=str)
    return with_hooks(
        discover, prepare=game.prepare, drawer=render_discovered, teams=named, rank=Rank.PLACES, key=game.key
    )


class _Discovery(NamedTuple):
    """The arguments of the rule, checked. What happens in a game is in `ctx.game.data`."""

    what: dict[int, Any]
    teams: frozenset[Hashable] | None
    score: float
    hops: float
    key: str

    def prepare(self, ctx: Context) -> None:
        """Check the nodes against the map, and publish that nothing is known."""
        refuse_unknown(ctx, self.what)
        self._found_by(ctx)
        ctx.game.publish(**{self.key: {}})

    def play(self, ctx: Context) -> None:
        """Let all agents look."""
        by = self._found_by(ctx)
        before = {node for found in by.values() for node in found}
        for agent in ctx.game.agents:
            team = agent.team
            if team is None or not (self.teams is None or team in self.teams):
                continue
            new = _in_view(ctx, agent, [node for node in self.what if node not in by.get(team, ())], self.hops)
            for node in new:
                by[team] = sorted([*by.get(team, ()), node])
                is_first = node not in before
                ctx.game.emit("discover", agent=agent.name, team=team, node=node, first=is_first)
                if self.score and is_first:
                    ctx.game.scores[team] += self.score
            if new:
                ctx.game.publish(to=team, **{self.key: {node: to_plain(self.what[node]) for node in by[team]}})

    def _found_by(self, ctx: Context) -> dict[Any, list[int]]:
        start = {"nodes": as_text(np.array(list(self.what), np.int64)), "by": {}}
        found: dict[Any, list[int]] = state_of(ctx, DISCOVERED, self.key, start)["by"]
        return found


def _in_view(ctx: Context, agent: IAgent, nodes: list[int], hops: float) -> list[int]:
    """Return which of these nodes an agent has in view, or so many edges ahead."""
    if not nodes:
        return []
    here, name, ids = agent.current_node_id, agent.name, np.array(nodes, np.int64)
    around = () if agent.type is AgentType.AERIAL else nodes_within(ctx.graph.graph, here, hops)
    is_seen = np.array([node in around for node in nodes])
    places: FloatArray = ctx.graph.graph.positions(nodes)
    for sensor in agent.sensors.values():
        try:
            is_seen |= np.isin(ids, sensor.coverage(here, name).node_ids)
        except NotOffered:  # it is no sensor of agents
            try:
                seen = sensor.view_from(here, name).nodes
            except NotOffered:
                continue
            is_seen |= (places[:, None] == seen[None]).all(axis=2).any(axis=1)
    seen_ids: list[int] = ids[is_seen].tolist()
    return seen_ids
