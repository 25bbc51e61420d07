"""Rules about nodes: teams hold them for some turns, discover them with sensors, or patrol them."""

from collections.abc import Hashable, Iterable, Mapping
from typing import Annotated, Any, NamedTuple

import numpy as np

from gamms.arguments import as_context, as_count, as_flag, as_float, as_name, as_range, show_as_call
from gamms.context import Context
from gamms.errors import BadType, NotOffered, UnknownName
from gamms.game.movement.travel import find_usable_graph
from gamms.game.roles import as_teams_and_roles, is_among
from gamms.game.settings import Rank, RuleSpec, declared
from gamms.ir.graph import FloatArray, IntArray
from gamms.knowledge.fields import find_coverage
from gamms.plain import describe_flaw, to_plain
from gamms.rules.endings import as_nodes, disclose_to_all, get_state, refuse_unknown
from gamms.rules.meetings import find_nodes_within
from gamms.text import shown
from gamms.typing import AgentType, IAgent, NodeId, Rule
from gamms.typing.game import TEAMS, Move, Visit
from gamms.visual.drawers.rules import as_text
from gamms.visual.drawers.standings import DISCOVERED, HELD, render_discovered, render_held


@show_as_call
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
        teams: teams or roles that may hold the place, one or several; None: all. Other teams can only contest it.
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
        as_teams_and_roles(teams),
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
            disclose=disclose_to_all(HELD, place.key),
        ),
    )


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
        self._get_state(ctx)

    def _get_state(self, ctx: Context) -> dict[str, Any]:
        nodes = as_text(np.array(sorted(self.nodes), np.int64))
        return get_state(ctx, HELD, self.key, {"nodes": nodes, "team": None, "turns": 0, "of": self.turns})

    def play(self, ctx: Context) -> None:
        """Count a turn."""
        state = self._get_state(ctx)
        there = _find_teams(ctx, self.nodes, None)
        holding = there if self.teams is None else _find_teams(ctx, self.nodes, self.teams)
        able = [team for team, on in holding.items() if on == self.nodes or not self.every]
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


def _find_teams(ctx: Context, place: frozenset[int], members: frozenset[Any] | None) -> dict[Any, set[int]]:
    """Return team -> the nodes of a place on which it has living agents of these teams and roles; None: of all."""
    block = ctx.agent.block
    there: dict[Any, set[int]] = {}
    numbers = {block.numbers.number(node) for node in place}
    for row in [row for row, number in enumerate(block.node) if number in numbers]:
        counts = block.alive[row] and not block.kind[row] and row not in block.removed
        counts = counts and block.teams[row] is not None
        if counts and (members is None or is_among(ctx.agent.get_agent(block.names[row]), members)):
            there.setdefault(block.teams[row], set()).add(block.get_node(row))
    return there


@show_as_call
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
    ahead, along edges that its mode may use. Discovered nodes stay known. Each discovery is an event `discover` with
    `agent` (the first by name), `team`, `node`, and `first`: whether no other team has discovered it in an earlier
    turn. `state["facts"][key]` has the discoveries of the agent's team: node -> contents.

    Args:
        nodes: one node, several, or node -> contents, for example "flag" or "decoy": any plain value.
        hops: number of edges that an agent on the ground sees ahead without sensors.
        score: points for each team that is the first to discover a node; two teams in the same turn both get them.
        teams: teams or roles that discover nodes, one or several; None: all.
        key: key of the rule's state and facts; a second `discover` rule needs another key.

    Raises:
        BadType, BadValue: an argument is invalid.
        UnknownName (KeyError): when the rule is added to a game, a node is not on the map.
    """
    hidden = sorted(as_nodes(nodes, "A node to discover"))
    what = {node: nodes[node] for node in hidden} if isinstance(nodes, Mapping) else dict.fromkeys(hidden, True)
    flaw = describe_flaw(what)
    if flaw:
        raise BadType(f"The contents of a node must be a plain value, for example 'decoy', not {shown(what)}: {flaw}.")
    state_key = as_name(key, "the state of the rule")
    points = as_float(score, "score")
    radius = as_range(hops, "hops")
    game = _DiscoveryRule(what, as_teams_and_roles(teams), points, radius, state_key)

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
            disclose=disclose_to_all(DISCOVERED, game.key),
        ),
    )


class _DiscoveryRule(NamedTuple):
    """The checked arguments of `discover`. The state of a game is in `ctx.game.data`."""

    what: dict[int, Any]
    teams: frozenset[Hashable] | None
    score: float
    hops: float
    key: str

    def prepare(self, ctx: Context) -> None:
        """Check the nodes against the map, and publish that nothing is discovered."""
        refuse_unknown(ctx, self.what)
        self._find_found_nodes(ctx)
        ctx.game.publish(**{self.key: {}})

    def play(self, ctx: Context) -> None:
        """Update the discoveries of all agents."""
        by = self._find_found_nodes(ctx)
        known = dict[Any, set[int]]()
        grown = dict[Any, None]()
        before = {node for found in by.values() for node in found}
        hidden = _NodeIndex(np.array([*self.what], np.int64), ctx.graph.graph.positions([*self.what]))
        for agent in ctx.game.agents:
            team = agent.team
            if team is None or not is_among(agent, self.teams):
                continue
            if team not in known:
                known[team] = set(by.get(team, ()))
            if len(known[team]) == len(self.what):
                continue
            new = sorted(_find_nodes_in_view(ctx, agent, hidden, self.hops) - known[team])
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

    def _find_found_nodes(self, ctx: Context) -> dict[Any, list[int]]:
        start = {"nodes": as_text(np.array(list(self.what), np.int64)), "by": {}}
        found: dict[Any, list[int]] = get_state(ctx, DISCOVERED, self.key, start)["by"]
        return found


@show_as_call
def idleness(
    nodes: NodeId | Iterable[NodeId] | None = None,
    *,
    teams: Annotated[Iterable[Hashable] | None, TEAMS] = None,
    key: str = "idleness",
) -> Rule:
    """Make a rule that measures how long nodes are left alone by a patrol; `idleness_table` returns the result.

    The idleness of a node is the time since an agent was there last, or since the rule was added (Machado et al.,
    Multi-agent patrolling, 2003). Times are exact: an agent that passes a node between two turns visits it, see
    `ctx.game.visits`. The last move of an agent that is eliminated does not count. The rule changes nothing.

    Args:
        nodes: the nodes to patrol; None: all nodes that the map has when the rule is added.
        teams: the patrolling teams or roles, one or several; None: all agents. Agents that were deleted in the turn
            count for whole teams only.
        key: key of the rule's state; a second `idleness` rule needs another key.

    Raises:
        BadType, BadValue: an argument is invalid.
        UnknownName (KeyError): when the rule is added to a game, a node is not on the map.
    """
    patrol = _IdlenessRule(
        None if nodes is None else as_nodes(nodes, "A node to patrol"),
        as_teams_and_roles(teams),
        as_name(key, "the state of the rule"),
    )

    def idleness(ctx: Context) -> None:
        patrol.play(ctx)

    return declared(
        idleness,
        RuleSpec(
            prepare=patrol.prepare,
            teams=sorted(patrol.teams or (), key=str),
            rank=Rank.PLACES,
            key=patrol.key,
        ),
    )


_IDLENESS = "idleness"
_SAME = 1e-9  # turns: visits of several agents with less between them are one


class _IdlenessRule(NamedTuple):
    """The checked arguments of `idleness`. The state of a game is in `ctx.game.data`."""

    nodes: frozenset[int] | None
    teams: frozenset[Hashable] | None
    key: str

    def prepare(self, ctx: Context) -> None:
        """Check the nodes against the map, and begin to count."""
        refuse_unknown(ctx, self.nodes or ())
        self._get_state(ctx)

    def _get_state(self, ctx: Context) -> dict[str, Any]:
        known = ctx.game.data.get(_IDLENESS, {}).get(self.key)
        if known is not None:
            return known  # type: ignore[no-any-return] # it is a dict
        nodes = sorted(ctx.graph.graph.get_nodes() if self.nodes is None else self.nodes)
        begun = float(ctx.game.turn)
        zeros = [0.0] * len(nodes)
        start = {"begun": begun, "nodes": nodes, "visits": [0] * len(nodes), "left": [begun] * len(nodes)}
        return get_state(ctx, _IDLENESS, self.key, {**start, "idle": zeros, "worst": [*zeros]})

    def play(self, ctx: Context) -> None:
        """Note the visits of a turn."""
        state = self._get_state(ctx)
        row_of = {node: row for row, node in enumerate(state["nodes"])}
        began = ctx.game.turn - 1.0
        for move in ctx.game.moves.values():
            place = move.places[0]  # where the agent was before, also if it has just come
            if place in row_of and self._is_counted(ctx, move):
                _note(state, row_of[place], began, began)
        for visit in ctx.game.visits():
            if visit.node in row_of and self._is_counted(ctx, visit):
                _note(state, row_of[visit.node], visit.time, visit.until)

    def _is_counted(self, ctx: Context, one: Move | Visit) -> bool:
        if self.teams is None or one.team in self.teams:
            return True
        agent = ctx.agent.agents.get(one.agent)
        return agent is not None and is_among(agent, self.teams)


def _note(state: dict[str, Any], row: int, time: float, until: float) -> None:
    """Note that an agent is on a node from one time to another."""
    idle = time - state["left"][row]
    is_first = state["visits"][row] == 0
    if is_first or idle > _SAME:
        state["visits"][row] += 1
        state["worst"][row] = max(state["worst"][row], idle)
    if not is_first:
        state["idle"][row] += max(idle, 0.0)
    state["left"][row] = max(state["left"][row], until)


def idleness_table(ctx: Context, key: str = "idleness") -> dict[str, Any]:
    """Return what the rule `idleness` has measured so far: a dict of columns, (nodes,).

    Columns: `node` (its id); `visits`: how often it was visited after it was left alone; `average`: mean time between
    two visits, NaN before the second (of a fleet of k agents that follow one cycle of length T at a speed v, evenly
    spaced, T / kv: Chevaleyre, 2004); `worst`: the longest time without an agent, with the time before the first visit
    and since the last. Times are in turns. `numpy.nanmean(table["average"])` and `table["worst"].max()` are those of
    the whole patrol.

    Args:
        ctx: the context.
        key: the key of the rule.

    Raises:
        UnknownName (KeyError): the game has no rule `idleness` with this key.
    """
    rules: dict[str, Any] = as_context(ctx, "idleness_table").game.data.get(_IDLENESS, {})
    if key not in rules:
        raise UnknownName("rule idleness with the key", key, rules)
    state = rules[key]
    visits = np.array(state["visits"], np.int64)
    gaps = np.where(visits > 1, visits - 1, 1)
    average = np.where(visits > 1, np.array(state["idle"], float) / gaps, np.nan)
    since = np.maximum(ctx.game.turn - np.array(state["left"], float), 0.0)
    worst = np.maximum(np.array(state["worst"], float), since)
    return {"node": np.array(state["nodes"], np.int64), "visits": visits, "average": average, "worst": worst}


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


def _find_shown_nodes(agent: IAgent, places: _NodeIndex) -> set[int]:
    """Return the ids of the nodes that the sensors of an agent show from its node."""
    shown_ids = set[int]()
    for sensor in agent.sensors.values():
        coverage = find_coverage(sensor, agent, None)
        if coverage is not None:
            shown_ids.update(coverage.node_ids.tolist())
            continue
        try:
            seen = sensor.view_from(agent.current_node_id, agent.name).nodes
        except NotOffered:
            continue
        shown_ids.update(*(places.at.get((x, y), ()) for x, y in seen.tolist()))
    return shown_ids & places.ids


def _find_nodes_in_view(ctx: Context, agent: IAgent, places: _NodeIndex, hops: float) -> set[int]:
    """Return the nodes that an agent has in view, or at most `hops` edges ahead."""
    here = agent.current_node_id
    around: Iterable[int] = ()
    if agent.type is not AgentType.AERIAL:
        around = find_nodes_within(find_usable_graph(ctx, getattr(agent, "mode", None)), here, hops)
    return _find_shown_nodes(agent, places) | places.ids.intersection(around)
