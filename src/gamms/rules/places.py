"""What teams do on nodes: hold them for some turns, and discover them with their sensors."""

from collections.abc import Callable, Hashable, Iterable, Mapping
from typing import Annotated, Any, NamedTuple

import numpy as np

from gamms.arguments import as_count, as_flag, as_float, as_name, as_range
from gamms.context import Context
from gamms.errors import BadType, NotOffered
from gamms.game.batch.reports import Look
from gamms.game.batch.state import Arrays, GameArrays
from gamms.game.batch.turn import ArrayTurn, in_view
from gamms.game.settings import Rank, RuleSpec, declared
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.ir.sensed import AgentLook
from gamms.plain import to_plain, why_not_plain
from gamms.rules.endings import all_know, as_nodes, as_teams, refuse_unknown, state_of
from gamms.rules.meetings import nodes_within
from gamms.text import shown, shown_as_called
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
    place = _Place(
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
            array_form=place.play_in_arrays,
            begin_arrays=place.begin_arrays,
        ),
    )


class _Place(NamedTuple):
    """The arguments of the rule, checked. What happens in a game is in `ctx.game.data`."""

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
        state, there = self._state(ctx), _teams_on(ctx, self.nodes)
        able = [
            team for team, on in there.items() if (on == self.nodes or not self.every) and team in (self.teams or there)
        ]
        if state["team"] not in able:
            state["team"], state["turns"] = None, 0
        if len(able) != 1 or len(there) != 1:
            return
        state["team"] = team = able[0]
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

    def begin_arrays(self, ctx: Context, state: GameArrays) -> dict[Hashable, Arrays]:
        """Return what the rule remembers of a game as arrays."""
        known, first = ctx.game.data.get(HELD, {}).get(self.key, {}), _nothing_held(1)
        if known.get("team") in state.roster.teams and known["team"] is not None:
            first["team"][0], first["turns"][0] = state.roster.teams.index(known["team"]), known["turns"]
        return {("hold", self.key): first}

    def play_in_arrays(self, turn: ArrayTurn) -> None:
        """Count a turn of many games."""
        kept = turn.keep(("hold", self.key), _nothing_held)
        number_on, teams = self._number_on(turn), turn.roster.teams
        may_hold = [self.teams is None or not self.teams or team in self.teams for team in teams]
        able = (number_on >= (len(self.nodes) if self.every else 1)) & np.array(may_hold)
        team, held = kept["team"][turn.games], kept["turns"][turn.games]
        is_lost = (team >= 0) & ~able[np.arange(len(team)), team]
        team[is_lost], held[is_lost] = -1, 0
        at = np.flatnonzero((able.sum(axis=1) == 1) & ((number_on > 0).sum(axis=1) == 1))
        team[at] = able[at].argmax(axis=1)
        held[at] += 1
        at = at[held[at] >= self.turns]
        names = [teams[number] for number in team[at].tolist()]
        turn.emit("hold", at, values={"team": names, "turns": [self.turns] * len(at)})
        if self.score:
            turn.add_team_scores(at, team[at], self.score)
        if self.ends:
            turn.end(at, [f"{name} held its place" for name in names], names)
        else:
            held[at] = 0
        kept["team"][turn.games], kept["turns"][turn.games] = team, held

    def _number_on(self, turn: ArrayTurn) -> IntArray:
        """Return on how many of the nodes the teams have living agents, (games, teams)."""
        is_place = turn.shared(
            ("nodes", self.nodes), lambda: np.isin(turn.streets.columns.node_ids, sorted(self.nodes))
        )
        counts = turn.alive & ~turn.roster.plays_for([None]) & ~turn.roster.flies
        at, agents = np.nonzero(is_place[turn.node] & counts)
        shape = len(turn.games), len(turn.roster.teams)
        nodes, pairs = len(is_place), at * shape[1] + turn.roster.team_of[agents]
        occupied = np.unique(pairs * nodes + turn.node[at, agents]) // nodes
        number: IntArray = np.bincount(occupied, minlength=shape[0] * shape[1])
        return number.reshape(shape)


def _nothing_held(games: int) -> Arrays:
    return {"team": np.full(games, -1), "turns": np.zeros(games, np.int64)}


def _teams_on(ctx: Context, place: frozenset[int]) -> dict[Any, set[int]]:
    """Return team -> the nodes of a place on which it has living agents."""
    block = ctx.agent.block
    there: dict[Any, set[int]] = {}
    for row in [row for row, node in enumerate(block.node) if node in place]:
        counts = block.alive[row] and not block.kind[row] and row not in block.removed
        if counts and block.teams[row] is not None:
            there.setdefault(block.teams[row], set()).add(block.node[row])
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
    return declared(
        discover,
        RuleSpec(
            prepare=game.prepare,
            drawer=render_discovered,
            teams=named,
            rank=Rank.PLACES,
            key=game.key,
            disclose=all_know(DISCOVERED, game.key),
            array_form=game.play_in_arrays,
            prepare_arrays=game.prepare_arrays,
            begin_arrays=game.begin_arrays,
            why_not_in_arrays=_why_not_looked,
        ),
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
        by, known, grown = self._found_by(ctx), dict[Any, set[int]](), dict[Any, None]()
        before = {node for found in by.values() for node in found}
        hidden = _Places(np.array([*self.what], np.int64), ctx.graph.graph.positions([*self.what]))
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

    def prepare_arrays(self, state: GameArrays) -> None:
        """Publish what teams have discovered in many games: team -> (games, nodes), the nodes in their order."""
        roster, by = state.roster, self._kept(state.keep, len(state.roster.teams))
        state.facts[self.key] = {team: by[:, number] for number, team in enumerate(roster.teams) if team is not None}

    def begin_arrays(self, ctx: Context, state: GameArrays) -> dict[Hashable, Arrays]:
        """Return what teams have discovered in a game as arrays; see `_kept`."""
        known, nodes = ctx.game.data.get(DISCOVERED, {}).get(self.key, {}).get("by", {}), np.array(list(self.what))
        by = np.stack([np.isin(nodes, known.get(team, ())) for team in state.roster.teams])
        return {("discover", self.key): {"by": by[None]}}

    def play_in_arrays(self, turn: ArrayTurn) -> None:
        """Let all agents of many games look."""
        roster, hidden = turn.roster, turn.streets.rows(list(self.what))
        kept = self._kept(turn.keep, len(roster.teams))
        by = kept[turn.games]
        before: BoolArray = np.asarray(by.any(axis=1))
        looks = turn.alive & roster.plays_for(self.teams) & ~roster.plays_for([None])
        views = turn.shared(("discover", self.key), lambda: _Views(turn, hidden))
        in_view = views.seen(turn, looks)
        on_ground = ~roster.flies[:, None]
        if self.hops >= 1:
            edges = turn.routes(None).distances(turn.node[..., None], hidden)
            in_view |= np.isfinite(edges) & (edges <= self.hops) & on_ground
        in_view |= (turn.node[..., None] == hidden) & on_ground
        at, agents, nodes = np.nonzero(in_view & looks[..., None] & ~by[:, roster.team_of])
        pairs = (at * len(roster.teams) + roster.team_of[agents]) * len(hidden) + nodes
        those = np.sort(np.unique(pairs, return_index=True)[1])  # of the members of a team the first by name
        at, agents, nodes = at[those], agents[those], nodes[those]
        teams, are_first = roster.team_of[agents], ~before[at, nodes]
        kept[turn.games[at], teams, nodes] = True
        ids, named = turn.streets.ids(hidden[nodes]).tolist(), [roster.teams[number] for number in teams.tolist()]
        values = {"team": named, "node": ids, "first": are_first.tolist()}  # in the order of the plain form
        turn.emit("discover", at, agents={"agent": agents}, values=values)
        if self.score:
            turn.add_scores(at[are_first], agents[are_first], self.score)

    def _kept(self, keep: Callable[[Hashable, Callable[[int], Arrays]], Arrays], teams: int) -> BoolArray:
        """Return which teams have discovered which nodes in all games, (games, teams, nodes)."""
        shape = teams, len(self.what)
        found: BoolArray = keep(("discover", self.key), lambda games: {"by": np.zeros((games, *shape), np.bool_)})["by"]
        return found

    def _found_by(self, ctx: Context) -> dict[Any, list[int]]:
        start = {"nodes": as_text(np.array(list(self.what), np.int64)), "by": {}}
        found: dict[Any, list[int]] = state_of(ctx, DISCOVERED, self.key, start)["by"]
        return found


class _Places:
    """Some nodes, found by their ids and by where they are.

    Attributes:
        ids: of the nodes.
        at: (x, y) -> the ids of the nodes there.
    """

    def __init__(self, ids: IntArray, xy: FloatArray) -> None:
        self.ids, self.at = set[int](ids.tolist()), dict[tuple[float, float], list[int]]()
        for node, x, y in zip(ids.tolist(), *xy.T.tolist(), strict=True):
            self.at.setdefault((x, y), []).append(node)


class _Views:
    """Which of some nodes the sensors of agents show: those that do not move are asked when an agent is first there."""

    def __init__(self, turn: ArrayTurn, hidden: IntArray) -> None:
        self._roster, self._streets = turn.roster, turn.streets
        self._ids = turn.streets.ids(hidden)
        self._places = _Places(self._ids, turn.streets.columns.xy[hidden])
        self._sensors: list[list[ISensor]] = [[] for _ in turn.roster.agents]  # of each agent, that look from nodes
        moving: dict[Hashable, tuple[Look, list[int]]] = {}  # how others look that turn or fly, and who carries them
        for number, agent in enumerate(turn.roster.agents):
            for sensor in getattr(agent, "sensors", {}).values():
                look = _look_of(sensor, agent)
                if not isinstance(look, str) and (look.turns or look.quat is not None):
                    key = type(look), look.radius, look.place, look.cone, look.quat, look.fov, look.height
                    moving.setdefault(key, (look, []))[1].append(number)
                else:
                    self._sensors[number].append(sensor)
        x, y = turn.streets.axes
        is_beside = np.isin(x + 1j * y, (x + 1j * y)[hidden])
        beside = np.flatnonzero(is_beside)  # those that are where these nodes are: a sensor that shows nodes shows both
        are_same = (x[beside, None] == x[hidden]) & (y[beside, None] == y[hidden])
        own = np.eye(len(hidden), dtype=np.bool_)
        self._moving = [
            (look, np.array(carriers), *((hidden, own) if isinstance(look, AgentLook) else (beside, are_same)))
            for look, carriers in moving.values()
        ]
        self._number = np.full((len(turn.roster.names), turn.streets.num_nodes), -1)
        self._seen = np.zeros((1, len(hidden)), np.bool_)  # one row at least, for -1 is looked up, too

    def seen(self, turn: ArrayTurn, looks: BoolArray) -> BoolArray:
        """Return which nodes agents that look have in view, (games, agents, nodes)."""
        found = self._from_nodes(turn.node, looks)
        for look, carriers, rows, are_same in self._moving:
            at, i = np.nonzero(looks[:, carriers])
            seen = in_view(turn, look, (at, carriers[i]), rows)
            found[at, carriers[i]] |= (seen[:, :, None] & are_same).any(axis=1)
        return found

    def _from_nodes(self, node: IntArray, looks: BoolArray) -> BoolArray:
        """Return the same of sensors that show the same from a node."""
        agents = np.broadcast_to(np.arange(node.shape[1]), node.shape)
        new = np.flatnonzero(looks & (self._number[agents, node] < 0))
        pairs = np.unique(agents.ravel()[new] * self._number.shape[1] + node.ravel()[new])
        if len(pairs):
            carriers, rows = np.divmod(pairs, self._number.shape[1])
            ids = self._streets.ids(rows).tolist()
            fresh = [
                np.isin(self._ids, [*_shown(self._sensors[agent], self._roster.names[agent], here, self._places)])
                for agent, here in zip(carriers.tolist(), ids, strict=True)
            ]
            self._number[carriers, rows] = len(self._seen) + np.arange(len(pairs))
            self._seen = np.concatenate((self._seen, np.stack(fresh)))
        return np.asarray(self._seen[self._number[agents, node]] & looks[..., None])


def _why_not_looked(agents: Iterable[IAgent]) -> str | None:
    """Return in words why what agents have in view has no array form; None: it has."""
    for agent in agents:
        for name, sensor in getattr(agent, "sensors", {}).items():
            look = _look_of(sensor, agent)
            if isinstance(look, str):
                return f"the sensor {shown(name)} of agent {shown(agent.name)}, which {look}"
    return None


def _look_of(sensor: ISensor, agent: IAgent) -> Look | str:
    """Return how a sensor shows agents or nodes, to be computed for many games at once; else in words why it cannot."""
    of_agents, of_nodes = getattr(sensor, "in_arrays", None), getattr(sensor, "nodes_in_arrays", None)
    look: Look | str = "is of a class of its own" if of_agents is None else of_agents(agent.name)
    return look if of_nodes is None else of_nodes()


def _shown(sensors: Iterable[ISensor], name: str, here: int, places: _Places) -> set[int]:
    """Return which nodes, by their ids, the sensors of the agent of a name show from a node."""
    shown_ids = set[int]()
    for sensor in sensors:
        try:
            shown_ids.update(sensor.coverage(here, name).node_ids.tolist())
        except NotOffered:  # it is no sensor of agents
            try:
                seen = sensor.view_from(here, name).nodes
            except NotOffered:
                continue
            shown_ids.update(*(places.at.get((x, y), ()) for x, y in seen.tolist()))
    return shown_ids & places.ids


def _in_view(ctx: Context, agent: IAgent, places: _Places, hops: float) -> set[int]:
    """Return which nodes an agent has in view, or so many edges ahead."""
    here = agent.current_node_id
    around = () if agent.type is AgentType.AERIAL else nodes_within(ctx.graph.graph, here, hops)
    return _shown(agent.sensors.values(), agent.name, here, places) | places.ids.intersection(around)
