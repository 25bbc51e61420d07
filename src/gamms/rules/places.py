"""Rules about nodes: teams hold them for some turns, or discover them with sensors."""

from collections.abc import Hashable, Iterable, Mapping
from typing import Annotated, Any, NamedTuple

import numpy as np

from gamms.arguments import as_count, as_flag, as_float, as_name, as_range, shown_as_called
from gamms.context import Context
from gamms.errors import BadType, NotOffered
from gamms.game.settings import Rank, RuleSpec, declared
from gamms.ir.graph import FloatArray, IntArray
from gamms.plain import (
    NAME,
    TEXT,
    Shape,
    among,
    at,
    dict_of,
    list_of,
    optional,
    record,
    to_plain,
    whole,
    why_not_plain,
)
from gamms.rules.endings import all_know, as_nodes, as_teams, refuse_unknown, state_of
from gamms.rules.meetings import nodes_within
from gamms.text import shown
from gamms.typing import AgentType, IAgent, ISensor, NodeId, Rule
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
    """Make a rule that lets a team win when it holds a place for a number of turns in a row.

    Only the ends of turns count. A team holds the place while one of its living agents is there on the ground and no
    agent of another team is. While several teams are there, the count of the holding team stops; once that team has
    left, its count returns to 0. A full count is an event `hold` with `team` and `turns`. Agents without a team neither
    hold nor contest a place.

    Args:
        nodes: the place: one node, or several.
        turns: the number of turns.
        every: whether a team needs an agent on every node; False: on one of the nodes.
        score: points for a team whose count is full.
        ends: whether the team then wins and the game ends; False: the count starts again, so `turns=1` gives points for
            every turn.
        teams: teams that may hold the place, one or several; None: all. Other teams can only contest it.
        key: key of the rule's state; a second `hold` rule needs another key.

    Raises:
        BadType, BadValue: an argument is invalid.
        UnknownName (KeyError): when the rule is added to a game, a node is not on the map.
    """
    place = _HoldRule(
        as_nodes(nodes, "A node to hold"),
        as_count(turns, "turns"),
        as_flag(every, "every"),
        as_float(score, "score"),
        as_flag(ends, "ends"),
        as_teams(teams),
        as_name(key, "the state of the rule"),
    )

    def hold(ctx: Context) -> None:
        place.play(ctx)

    return declared(
        hold,
        RuleSpec(
            prepare=place.prepare,
            drawer=render_held,
            teams=sorted(place.teams or (), key=str),
            rank=Rank.PLACES,
            key=place.key,
            disclose=all_know(HELD, place.key),
            keeps=at((HELD, place.key), _HOLDING),
        ),
    )


_HOLDING = record({"team": optional(NAME), "turns": whole()}, {"nodes": TEXT, "of": whole()})


class _HoldRule(NamedTuple):
    """The checked arguments of `hold`. The state of a game is in `ctx.game.data`."""

    nodes: frozenset[int]
    turns: int
    every: bool
    score: float
    ends: bool
    teams: frozenset[Hashable] | None
    key: str

    def prepare(self, ctx: Context) -> None:
        """Check the nodes against the map."""
        refuse_unknown(ctx, self.nodes)
        self._state(ctx)

    def _state(self, ctx: Context) -> dict[str, Any]:
        nodes = as_text(np.array(sorted(self.nodes), np.int64))
        return state_of(ctx, HELD, self.key, {"nodes": nodes, "team": None, "turns": 0, "of": self.turns})

    def play(self, ctx: Context) -> None:
        """Count a turn."""
        state = self._state(ctx)
        there = _teams_on(ctx, self.nodes)
        able = [
            team for team, on in there.items() if (on == self.nodes or not self.every) and team in (self.teams or there)
        ]
        if state["team"] not in able:
            state["team"] = None
            state["turns"] = 0
        if len(able) != 1 or len(there) != 1:
            return
        team = able[0]
        state["team"] = team
        state["turns"] += 1
        if state["turns"] < self.turns:
            return
        ctx.game.emit("hold", team=team, turns=self.turns)
        if self.score:
            ctx.game.scores[team] += self.score
        if self.ends:
            ctx.game.end(f"{team} held its place", winner=team)
        else:
            state["turns"] = 0


def _teams_on(ctx: Context, place: frozenset[int]) -> dict[Any, set[int]]:
    """Return team -> the nodes of a place on which it has living agents."""
    block = ctx.agent.block
    there: dict[Any, set[int]] = {}
    numbers = {block.numbers.number(node) for node in place}
    for row in [row for row, number in enumerate(block.node) if number in numbers]:
        counts = block.alive[row] and not block.kind[row] and row not in block.removed
        if counts and block.teams[row] is not None:
            there.setdefault(block.teams[row], set()).add(block.node_of(row))
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
    """Make a rule that lets teams discover nodes and their contents when a sensor of a living agent has them in view.

    Only the ends of turns count. An agent on the ground also sees its own node and the nodes at most `hops` edges
    ahead. Discovered nodes stay known. Each discovery is an event `discover` with `agent` (the first by name), `team`,
    `node`, and `first`: whether no other team has discovered it in an earlier turn. `state["facts"][key]` has the
    discoveries of the agent's team: node -> contents.

    Args:
        nodes: one node, several, or node -> contents, for example "flag" or "decoy": any plain value.
        hops: number of edges that an agent on the ground sees ahead without sensors.
        score: points for each team that is the first to discover a node; two teams in the same turn both get them.
        teams: teams that discover nodes, one or several; None: all.
        key: key of the rule's state and facts; a second `discover` rule needs another key.

    Raises:
        BadType, BadValue: an argument is invalid.
        UnknownName (KeyError): when the rule is added to a game, a node is not on the map.
    """
    hidden = sorted(as_nodes(nodes, "A node to discover"))
    what = {node: nodes[node] for node in hidden} if isinstance(nodes, Mapping) else dict.fromkeys(hidden, True)
    flaw = why_not_plain(what)
    if flaw:
        raise BadType(f"The contents of a node must be a plain value, for example 'decoy', not {shown(what)}: {flaw}.")
    state_key = as_name(key, "the state of the rule")
    points = as_float(score, "score")
    radius = as_range(hops, "hops")
    game = _DiscoveryRule(what, as_teams(teams), points, radius, state_key)

    def discover(ctx: Context) -> None:
        game.play(ctx)

    named = sorted(game.teams or (), key=str)
    return declared(
        discover,
        RuleSpec(
            prepare=game.prepare,
            drawer=render_discovered,
            teams=named,
            rank=Rank.PLACES,
            key=game.key,
            disclose=all_know(DISCOVERED, game.key),
            keeps=at((DISCOVERED, game.key), game.shape),
        ),
    )


class _DiscoveryRule(NamedTuple):
    """The checked arguments of `discover`. The state of a game is in `ctx.game.data`."""

    what: dict[int, Any]
    teams: frozenset[Hashable] | None
    score: float
    hops: float
    key: str

    @property
    def shape(self) -> Shape:
        """The shape of the rule's state."""
        nodes = list_of(among(self.what, f"one of the nodes to discover ({', '.join(map(str, self.what))})"))
        return record({"by": dict_of(NAME, nodes)}, {"nodes": TEXT})

    def prepare(self, ctx: Context) -> None:
        """Check the nodes against the map, and publish that nothing is discovered."""
        refuse_unknown(ctx, self.what)
        self._found_by(ctx)
        ctx.game.publish(**{self.key: {}})

    def play(self, ctx: Context) -> None:
        """Update the discoveries of all agents."""
        by = self._found_by(ctx)
        known = dict[Any, set[int]]()
        grown = dict[Any, None]()
        before = {node for found in by.values() for node in found}
        hidden = _NodeIndex(np.array([*self.what], np.int64), ctx.graph.graph.positions([*self.what]))
        for agent in ctx.game.agents:
            team = agent.team
            if team is None or not (self.teams is None or team in self.teams):
                continue
            if team not in known:
                known[team] = set(by.get(team, ()))
            if len(known[team]) == len(self.what):
                continue
            new = sorted(_in_view(ctx, agent, hidden, self.hops) - known[team])
            for node in new:
                is_first = node not in before
                ctx.game.emit("discover", agent=agent.name, team=team, node=node, first=is_first)
                if self.score and is_first:
                    ctx.game.scores[team] += self.score
            if new:
                known[team].update(new)
                grown[team] = None
        for team in grown:
            by[team] = sorted(known[team])
            ctx.game.publish(to=team, **{self.key: {node: to_plain(self.what[node]) for node in by[team]}})

    def _found_by(self, ctx: Context) -> dict[Any, list[int]]:
        start = {"nodes": as_text(np.array(list(self.what), np.int64)), "by": {}}
        found: dict[Any, list[int]] = state_of(ctx, DISCOVERED, self.key, start)["by"]
        return found


class _NodeIndex:
    """A set of nodes, indexed by id and by position.

    Attributes:
        ids: ids of the nodes.
        at: (x, y) -> ids of the nodes at this position.
    """

    def __init__(self, ids: IntArray, xy: FloatArray) -> None:
        self.ids = set[int](ids.tolist())
        self.at = dict[tuple[float, float], list[int]]()
        for node, x, y in zip(ids.tolist(), *xy.T.tolist(), strict=True):
            self.at.setdefault((x, y), []).append(node)


def _shown(sensors: Iterable[ISensor], name: str, here: int, places: _NodeIndex) -> set[int]:
    """Return the ids of the nodes that the sensors of the named agent show from a node."""
    shown_ids = set[int]()
    for sensor in sensors:
        try:
            shown_ids.update(sensor.coverage(here, name).node_ids.tolist())
        except NotOffered:  # the sensor does not show agents
            try:
                seen = sensor.view_from(here, name).nodes
            except NotOffered:
                continue
            shown_ids.update(*(places.at.get((x, y), ()) for x, y in seen.tolist()))
    return shown_ids & places.ids


def _in_view(ctx: Context, agent: IAgent, places: _NodeIndex, hops: float) -> set[int]:
    """Return the nodes that an agent has in view, or at most `hops` edges ahead."""
    here = agent.current_node_id
    around = () if agent.type is AgentType.AERIAL else nodes_within(ctx.graph.graph, here, hops)
    return _shown(agent.sensors.values(), agent.name, here, places) | places.ids.intersection(around)
