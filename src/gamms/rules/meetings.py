"""Queries to `gamms.core.contacts`: the columns of agents that it needs, and the contacts that it finds.

`turn_of` returns the query object for the game of a context.
"""

from array import array
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from functools import cache, lru_cache
from itertools import accumulate, chain
from typing import Annotated, Any, NamedTuple, cast

import numpy as np

from gamms import kernels
from gamms.context import Context
from gamms.core import contacts as core
from gamms.core import rules
from gamms.game.block.in_core import motion_intervals
from gamms.game.block.travelers import NO_LEGS
from gamms.game.conflicts import flat, node_numbers
from gamms.game.movement.moves import TurnMoves
from gamms.game.movement.travel import ReachableNodes, RoadIds
from gamms.graph import Graph
from gamms.ir.agents import AgentBlock, Position
from gamms.kernels.draws import BitArray
from gamms.rules.visits import Line, TraveledEdges, at_end
from gamms.typing import AgentType, IAgent
from gamms.typing.game import TEAMS, Leg, Track

_MOST_DISTANCES = 8  # contact distances whose near nodes are cached per game
_MOST_TERRITORIES = 8  # territories whose owners are cached per game
_NOWHERE = 0.0, 0.0, 0.0
UNKNOWN_PLACE = 4  # a flag of legs, see `core.Legs`


Side = Annotated[Hashable | Callable[[IAgent], object], TEAMS]  # a team, or a function of an agent


class ContactOptions(NamedTuple):
    """The distance and options that define a contact; see `contacts`."""

    unit: str | None  # "hops", "metres" or "euclid"; None: on the same node
    limit: float
    crossing: bool
    air: bool
    passing: bool


Near = core.NearNodes | core.NodePositions | core.PathSegments | None


def ask(found: core.Contacts, nearness: ContactOptions, near: Near, *columns: Any, by_metres: bool) -> None:
    """Configure a contact search in the core.

    Args:
        found: the search.
        nearness: the distance and options that define a contact.
        near: distances between places; None: agents must be on the same node.
        columns: columns of agents and games, in the order of `core.Contacts.ask`.
        by_metres: whether positions in these games are in metres along edges.
    """
    found.ask(
        *columns,
        reach=near if isinstance(near, core.NearNodes) else _NO_REACH,
        places=near if isinstance(near, core.NodePositions) else _NO_PLACES,
        lines=near if isinstance(near, core.PathSegments) else _NO_LINES,
        crossing=nearness.crossing,
        by_metres=by_metres,
    )


def column(kind: str, values: Iterable[float] = ()) -> Any:  # Any: memoryviews are not subscriptable
    """Return numbers as a buffer: "q" and "Q" for signed and unsigned integers, "d" for floats."""
    return memoryview(array(kind, values))


def _zeros(kind: str, number: int) -> Any:  # Any: memoryviews are not subscriptable
    """Return a buffer of zeros; see `column`."""
    return column(kind, bytes(8 * number))


_NO_REACH = core.NearNodes(column("q", [0]), column("q"), column("d"), 0.0, ReachableNodes(0).core)
_NO_PLACES = core.NodePositions(column("q"), column("d"))
_NO_LINES = core.PathSegments(column("q"), *[column("d")] * 4)
_ON_NODES = core.SEARCHES["on nodes"]


# -- in the game of a context ------------------------------------------------------------------------------------------


class NodeOwners:
    """The teams that own nodes, as numbers of nodes and teams.

    Args:
        territory: node -> team.
        teams: team -> number.
    """

    def __init__(self, territory: Mapping[int, Hashable], teams: Mapping[Hashable, int]) -> None:
        self._territory = territory
        self._teams = teams
        self._count = 0
        self._owners = np.zeros(0, np.int64)

    def of(self, numbers: core.NodeNumbers) -> Any:
        """Return the number of the team that owns each node, (nodes,); -1 if it is none of these teams."""
        count = numbers.count
        if self._count < count:
            ids = numbers.ids[self._count : count]
            territory = self._territory
            new = [self._teams.get(territory[id], -1) if id in territory else -1 for id in ids]
            if count > len(self._owners):
                self._owners = np.concatenate(
                    (self._owners[: self._count], np.empty(2 * count - self._count, np.int64))
                )
            self._owners[self._count : count] = new
            self._count = count
        return self._owners.data


class Roster:
    """The living agents of a game, and maybe eliminated ones, ordered by name, and their columns.

    Args:
        names: names of the agents.
        teams: team of each agent.
        keys: keys of the names, for draws.
        fly: whether each agent flies; None: no agent does.
        out: whether each agent is eliminated and takes no part; None: all are living.

    Attributes:
        names: the argument `names`.
        team_of: the argument `teams`.
        number: name -> index of the agent.
        teams: team -> index of the team, in the order of their first agents.
        fly, out: the arguments `fly` and `out`.
        keys: (agents,) the argument `keys`.
        team: (agents,) indices of teams.
        games: the columns of agents, for one game.
        turn: (1,) the number of turns played.
        placed: (agents,) whether each agent was relocated after its move, in `games`.
        columns: columns of the tracks of agents that move along at most one edge per turn; filled by `steps`.
        tags: reusable buffer.
        kept: data of rules about these agents, by rule.
    """

    def __init__(
        self,
        names: Sequence[str],
        teams: Sequence[Hashable],
        keys: BitArray,
        *,
        fly: Sequence[bool] | None = None,
        out: Sequence[bool] | None = None,
    ) -> None:
        agents = len(names)
        self.names = names
        self.number = {name: i for i, name in enumerate(names)}
        self.teams = {team: i for i, team in enumerate(dict.fromkeys(teams))}
        self.fly = fly
        self.team_of = teams
        self.out = out
        self.keys: Any = keys.data
        self.team = column("q", [self.teams[team] for team in teams])
        ints = np.zeros((8, agents), np.int64)
        floats = np.zeros((2, agents))
        self.turn = column("q", [0])
        self.placed: Any = bytearray(agents)
        self.games = rules.GameColumns(
            agents,
            len(self.teams),
            node=ints[0].data,
            start=ints[1].data,
            previous=ints[2].data,
            alive=memoryview(bytearray(b"\1" * agents)),
            placed=memoryview(self.placed),
            stops=ints[3].data,
            home=ints[4].data,
            turn=self.turn,
            over=memoryview(bytearray(1)),
            score=column("d", [0.0] * len(self.teams)),
            team=self.team,
            first_node=column("q", [0]),
        )
        columns: Any = ints[5:7].reshape(-1).data, floats.reshape(-1).data, ints[7].data
        self.columns: list[Any] = [*columns]
        self.steps = rules.AgentPaths(*columns)
        self.tags = rules.Tags(column("q", [0] * agents))
        self.kept: dict[Hashable, Any] = {}
        self._sides: dict[Hashable, Any] = {}
        self._owners: dict[int, NodeOwners] = {}  # by id of the territory

    def sides(self, ctx: Context, a: Side, b: Side, *, air: bool) -> Any:
        """Return the side of each agent, for `core.Tracks`; None if one side has no agents.

        Args:
            ctx: the context.
            a: the first side.
            b: the second side.
            air: whether flying agents take part.
        """
        if callable(a) or callable(b):
            return self._of_sides(ctx, a, b, air=air)
        key = a, b, air
        if key not in self._sides:
            self._sides[key] = self._of_sides(ctx, a, b, air=air)
        return self._sides[key]

    def _of_sides(self, ctx: Context, a: Side, b: Side, *, air: bool) -> Any:
        ours = self._members(ctx, a, air=air)
        theirs = self._members(ctx, b, air=air)
        if not (any(ours) and any(theirs)):
            return None
        return column("q", [one + 2 * other for one, other in zip(ours, theirs, strict=True)])

    def _members(self, ctx: Context, side: Side, *, air: bool) -> list[bool]:
        """Return for each agent whether it is on a side and takes part."""
        fly = None if air else self.fly
        if not callable(side):
            return self._of_those([team == side for team in self.team_of], fly)
        agents: Sequence[IAgent | None] = ctx.game.agents
        if self.out is not None:
            living = iter(agents)
            agents = [None if is_out else next(living) for is_out in self.out]
        absent = fly or [False] * len(agents)
        return [
            agent is not None and not is_absent and bool(side(agent))
            for agent, is_absent in zip(agents, absent, strict=True)
        ]

    def _of_those(self, members: list[bool], fly: Sequence[bool] | None) -> list[bool]:
        """Return the members without agents that fly or are eliminated."""
        for absent in (fly, self.out):
            if absent is not None:
                members = [one and not is_absent for one, is_absent in zip(members, absent, strict=True)]
        return members

    def owners(self, territory: Mapping[int, Hashable], numbers: core.NodeNumbers) -> Any:
        """Return the number of the team that owns each node, (nodes,); -1 if none of these agents is on the team."""
        if id(territory) not in self._owners:
            if len(self._owners) == _MOST_TERRITORIES:
                self._owners.clear()
            self._owners[id(territory)] = NodeOwners(territory, self.teams)
        return self._owners[id(territory)].of(numbers)

    def ground(self) -> Any:
        """Return 1 for each agent that is on the ground and not eliminated, else 0."""
        if "ground" not in self._sides:
            self._sides["ground"] = column("q", self._of_those([True] * len(self.names), self.fly))
        return self._sides["ground"]


class TurnContacts:
    """Contact queries for one turn of one game.

    Args:
        game: cached data of the game and its map.
        roster: the agents.
        seed: seed of the context.

    Attributes:
        game, roster: the arguments of these names.
        numbers: numbers of the nodes of the map.
        are_steps: whether every agent moved along at most one edge.
        by_metres: whether positions are in metres along edges.
        most, columns: capacity and columns of tracks, for `core.Tracks`: nodes, times and lengths.
        most_legs, legs: capacity and columns of legs, for `core.Tracks`.
        edges: edges that the agents move along.
        seed: the present seed; see `draw_by`.
        purpose: purpose key of the draws.
    """

    def __init__(self, game: "GameContacts", roster: Roster, seed: int) -> None:
        self.game = game
        self.numbers = game.numbers
        self.roster = roster
        self.are_steps = True
        self.by_metres = False
        self.most = 2
        self.columns = roster.columns
        self.most_legs = 0
        self.legs = NO_LEGS
        self._where: Sequence[Track | int] = ()  # the track of each agent, or its slot in `_moves`
        self._moves: TurnMoves | None = None
        self.edges: TraveledEdges | None = None
        self.purpose = column("Q", [0])
        self.draw_by(seed)
        self._ready: dict[Hashable, core.Contacts] = {}  # configured searches for contacts on nodes
        self._visits: dict[bool, core.Tracks] = {}

    def draw_by(self, seed: int) -> None:
        """Use the random draws of another seed."""
        self.seed = seed
        self.purpose[0] = kernels.purpose_key(seed, "contacts")

    def follow(self, ctx: Context, agents: Sequence[IAgent]) -> None:
        """Take the tracks of agents that may have moved along several edges, or parts of edges."""
        moves: TurnMoves | None = self.game.state.moves
        paths = None if moves is None else moves.paths
        self._moves = moves
        self._where = [_where(moves, agent) for agent in agents]
        self.are_steps = False
        self.by_metres = ctx.game.speed_unit != "edges"
        self.edges = self.game.edges
        most_legs, most = (0, 2) if paths is None else paths.most
        self.most = max([2, most, *[len(where.path) for where in self._where if isinstance(where, Track)]])
        self.most_legs = most_legs
        size = len(agents)
        self.columns = [_zeros("q", size * self.most), _zeros("d", size * self.most), _zeros("q", size)]
        flags = _zeros("q", size * most_legs)
        ints = [_zeros("q", size), *[_zeros("q", size * most_legs) for _ in range(3)], flags]
        self.legs = core.Legs(most_legs, *ints, *[_zeros("d", size * most_legs) for _ in range(5)])
        columns = self._tracks(self.columns[2], at_end=False)
        for agent, where in enumerate(self._where):
            if isinstance(where, Track):
                self._put_track(agent, where)
            elif paths is not None:
                roads = cast("RoadIds", paths.maps[where])
                numbers = self.numbers, self.game.streets
                core.put_path(paths.core, where, roads.map, roads.edges, *numbers, columns, self.legs, agent)
                if roads.revision != self.game.revision:
                    self._mark_removed(flags, agent, paths.legs_of(where))

    def _put_track(self, agent: int, track: Track) -> None:
        """Write a track along no edges."""
        nodes, times, lengths = self.columns
        path, at, _ = track
        first = agent * self.most
        more = self.most - len(path)
        nodes[first : first + self.most] = column("q", map(self.numbers.number, path + path[-1:] * more))
        times[first : first + self.most] = column("d", at + (1.0,) * more)
        lengths[agent] = len(path)

    def _mark_removed(self, flags: memoryview, agent: int, legs: Sequence[Leg]) -> None:
        """Mark legs on edges that were removed since."""
        for place, leg in enumerate(legs):
            if self.game.edges.length_of(leg) is None:
                flags[agent * self.most_legs + place] |= UNKNOWN_PLACE

    def track(self, agent: int) -> Track:
        """Return the track of an agent, by its number."""
        where = self._where[agent]
        return where if isinstance(where, Track) else cast("TurnMoves", self._moves).track(where)

    def find(self, ctx: Context, a: Side, b: Side, nearness: ContactOptions) -> core.Contacts | None:
        """Find the contacts between two sides; return None if there are none."""
        # NOTE: searches for contacts on nodes are reused in each turn (benchmarks: turns).
        key = a, b, nearness
        found = self._ready.get(key)
        game = self.game
        if found is not None and found.pieces is game.pieces and self.numbers.count <= game.keys:
            return found if found.find(_ON_NODES, 0.0) else None
        sides = self.roster.sides(ctx, a, b, air=nearness.air)
        if sides is None:
            return None
        near: Near = None
        if nearness.unit is not None:
            near = self._near(sides, nearness, in_air(ctx, nearness))
        pieces = self.scratch(near.parts if isinstance(near, core.PathSegments) else 0)
        if near is None and self.are_steps and not (callable(a) or callable(b)):
            found = core.Contacts(pieces)
            self._ready[key] = found
        else:
            found = self.game.contacts(pieces)
        self._ask(found, sides, nearness, near)
        return found if found.find(search_for(near, nearness, by_metres=self.by_metres), nearness.limit) else None

    def scratch(self, parts: int = 0) -> core.MotionIntervals:
        """Return buffers large enough for the moves of these agents, and for `parts` straight lines."""
        agents = len(self.roster.names)
        entries = 2 * agents * (self.most + 2 * self.most_legs + 1)  # of visits and legs, each with two ends
        pieces = max(parts, entries)
        return self.game.scratch(pieces, max(self.numbers.count, self.game.streets.count))

    def _tracks(self, sides: memoryview, *, at_end: bool) -> core.Tracks:
        nodes, times, lengths = self.columns
        return core.Tracks(len(sides), self.most, nodes, times, lengths, sides, at_end=at_end)

    def _ask(self, found: core.Contacts, sides: memoryview, nearness: ContactOptions, near: Near) -> None:
        columns = self.legs, self.roster.keys, self.purpose, self.roster.turn
        tracks = self._tracks(sides, at_end=not nearness.passing)
        ask(found, nearness, near, tracks, *columns, by_metres=self.by_metres)

    def visits(self, *, passing: bool) -> core.Tracks:
        """Return the tracks of the agents on the ground, to find visits of nodes."""
        if passing not in self._visits:
            sides = self.roster.ground()
            self._visits[passing] = self._tracks(sides, at_end=not passing)
        return self._visits[passing]

    def xy_of(self, agent: int, time: float, node: int, nearness: ContactOptions, at: Position | None) -> Any:
        """Return the map position (x, y) of an agent in a contact of a game by metres."""
        track = self.track(agent)
        # If agents pass each other at the end of a turn counted in edges, the way they came decides.
        return cast("TraveledEdges", self.edges).xy_at(track if nearness.passing else at_end(track), time, node, at)

    def _near(self, sides: memoryview, nearness: ContactOptions, flying: Mapping[str, Position]) -> Near:
        game = self.game
        unit = nearness.unit
        if unit != "euclid":
            return game.near(unit, nearness.limit, game.number_all())
        places = [flying.get(name) for name in self.roster.names]
        if self.by_metres:
            return self._segments(sides, places, passing=nearness.passing)
        ids = self.numbers.ids
        nodes = self.columns[0]
        xyz = []
        for agent, (side, at) in enumerate(zip(sides, places, strict=True)):
            path = nodes[self.most * agent : self.most * (agent + 1)] if side and at is None else ()
            xyz += [game.place(ids[node]) for node in path] or [at or _NOWHERE] * self.most
        return core.NodePositions(column("q", range(len(xyz))), column("d", chain.from_iterable(xyz)))

    def _segments(self, sides: memoryview, flying: Sequence[Position | None], *, passing: bool) -> core.PathSegments:
        """Return the straight parts of the paths of agents on a side: stays on nodes, then parts of edges."""
        edges = cast("TraveledEdges", self.edges)
        pieces = self.scratch()
        core.put_visits(self._tracks(sides, at_end=not passing), self.legs, pieces)
        columns = [column[: pieces.count] for column in (pieces.agents, pieces.nodes, pieces.since, pieces.until)]
        parts: list[list[Line]] = [[] for _ in flying]
        for agent, node, since, until in zip(*columns, strict=True):
            place = self.game.place(self.numbers.ids[node])
            parts[agent].append((since, until, place, place))
        for agent, at in enumerate(flying):
            track = self.track(agent) if passing else at_end(self.track(agent))
            if sides[agent] and at is not None:
                parts[agent] = [(track.times[0], 1.0, at, at)]
            elif sides[agent]:
                parts[agent] += edges.lines_of(track)
        lines = list(chain.from_iterable(parts))
        return core.PathSegments(
            column("q", [0, *accumulate(map(len, parts))]),
            column("d", [line[0] for line in lines]),
            column("d", [line[1] for line in lines]),
            column("d", chain.from_iterable([line[2] for line in lines])),
            column("d", chain.from_iterable([line[3] for line in lines])),
        )


def _where(moves: TurnMoves | None, agent: IAgent) -> Track | int:
    """Return the slot of an agent that has a path in `moves`; its track otherwise."""
    i = None if moves is None else moves.slot_of(agent)
    if moves is None or i is None:
        return Track((agent.current_node_id,), (1.0,))
    return i if moves.paths is not None and moves.paths.num_legs(i) else moves.track(i)


def in_air(ctx: Context, nearness: ContactOptions) -> dict[str, Position]:
    """Return agent -> position of flying agents, for straight-line distances."""
    if nearness.unit != "euclid" or not (nearness.air and ctx.agent.block.flyers):
        return {}
    return {agent.name: agent.position for agent in ctx.game.agents if agent.type is AgentType.AERIAL}


def reach_of(arcs: kernels.Arcs, limit: float) -> core.NearNodes:
    """Return a search for the nodes within a distance of a node, along the edges of a map."""
    ends = flat(arcs.offsets, np.int64), flat(arcs.ends, np.int64)
    return core.NearNodes(*ends, flat(arcs.weights, np.float64), limit, ReachableNodes(len(arcs.offsets) - 1).core)


def search_for(near: Near, nearness: ContactOptions, *, by_metres: bool) -> int:
    """Return the code of the search method of the core."""
    if near is None:
        return _ON_NODES
    if isinstance(near, core.NearNodes):
        return core.SEARCHES["on ways" if by_metres and nearness.unit == "metres" else "by paths"]
    return core.SEARCHES["near places" if isinstance(near, core.NodePositions) else "on lines"]


class GameContacts:
    """Cached data about contacts in one game: its map, the last turn, and buffers.

    The buffers are as large as the largest turn so far has needed.

    Args:
        ctx: the context with the present map.
        numbers: numbers of the nodes.

    Attributes:
        edges: edges that agents have moved along.
        graph, revision: the map and its revision.
        state: state of the game.
        numbers: the argument `numbers`.
        place: node id -> position of the node on the ground.
        near: unit and limit of a `ContactOptions` -> nodes near each node.
        pieces: the present buffers.
        keys: number of keys that fit in the buffers.
    """

    def __init__(self, ctx: Context, numbers: core.NodeNumbers) -> None:
        self.pieces = motion_intervals(0, 0)
        self.keys = 0
        self._most = 0
        self._contacts: core.Contacts | None = None
        self.numbers = numbers
        self.streets = core.NodeNumbers()
        self.state = ctx.game.internals.state
        self._turns = ctx.game.internals.parts.turns
        self.edges = TraveledEdges(ctx)
        graph = self.edges.graph
        self.graph = graph
        self.revision = graph.revision
        self.place = cache(self._place)
        self.near = lru_cache(_MOST_DISTANCES)(self._near)
        self._columns: Any = None  # columns of the map, whose nodes have these numbers
        self._numbers = np.zeros(0, np.int64)
        self._steps: TurnContacts | None = None
        self._steps_of: tuple[Any, ...] = ()
        self._seeds = -1  # how often the seed had changed when draws were last derived from it
        self._turn: TurnContacts | None = None
        self._moves: TurnMoves | None = None  # the moves, block and versions of the present turn
        self._block: AgentBlock | None = None
        self._versions = 0, 0, 0, 0

    def scratch(self, pieces: int, keys: int) -> core.MotionIntervals:
        """Return buffers with room for this many pieces and keys."""
        if pieces > self._most or keys > self.keys:
            self._most = 2 * pieces
            self.keys = 2 * keys
            self.pieces = motion_intervals(self._most, self.keys)
        return self.pieces

    def contacts(self, pieces: core.MotionIntervals) -> core.Contacts:
        """Return a new contact search."""
        if self._contacts is None or self._contacts.pieces is not pieces:
            self._contacts = core.Contacts(pieces)
        return self._contacts

    def _place(self, node: int) -> Position:
        _, x, y = self.graph.get_node(node)
        return x, y, 0.0

    def _near(self, unit: str, limit: float, _: int) -> core.NearNodes:
        """Return a search for nodes within a distance, for the present number of nodes."""
        columns = self._columns
        numbers = self._numbers
        costs = np.ones(len(columns.lengths)) if unit == "hops" else columns.lengths
        ends = numbers[columns.sources], numbers[columns.targets]
        return reach_of(kernels.make_arcs(*ends, costs, self.numbers.count), limit)

    def number_all(self) -> int:
        """Number all nodes of the map; return how many numbers there are."""
        if self._columns is None:
            columns = self.graph.columns()
            self._columns = columns
            self._numbers = np.empty(len(columns.node_ids), np.int64)
            self.numbers.write(columns.node_ids.data, self._numbers.data)
        return self.numbers.count

    def turn(self, ctx: Context) -> TurnContacts:
        """Return the contact queries for this turn."""
        state = self.state
        block = ctx.agent.block
        turns = self._turns
        moves: TurnMoves | None = state.moves
        versions = block.version, block.structure.version, state.turn, turns.seed_changes
        # NOTE: before agents are moved, rules may undo their moves without changing a version.
        is_known = moves is self._moves and block is self._block and versions == self._versions and not turns.is_moving
        if self._turn is None or not is_known:
            self._moves = moves
            self._block = block
            self._versions = versions
            if moves is not None and moves.are_steps(block):
                self._turn = self._of_steps(ctx, moves, block, versions)
            else:
                self._turn = self._of_tracks(ctx, state.turn)
        return self._turn

    def _of_steps(self, ctx: Context, moves: TurnMoves, block: AgentBlock, versions: tuple[int, ...]) -> TurnContacts:
        order = moves.order
        _, structure, turn, seeds = versions
        key = order, structure
        if self._steps is None or self._steps_of != key:
            self._steps_of = key
            out = [not alive for alive in order.selection.of(block.alive)]
            roster = Roster(order.names, order.all_teams(), order.keys, out=out if any(out) else None)
            self._steps = TurnContacts(self, roster, ctx.seed)
        if self._seeds != seeds:
            self._seeds = seeds
            self._steps.draw_by(ctx.seed)
        roster = self._steps.roster
        rules.take_moves(roster.games, self.numbers, moves.in_core(), block, order.moving, turn)
        for row in block.placed:
            agent = roster.number.get(block.names[row])
            if agent is not None:
                roster.placed[agent] = 1
        rules.fill_steps(roster.steps, roster.games, 0)
        return self._steps

    def _of_tracks(self, ctx: Context, turn: int) -> TurnContacts:
        agents = ctx.game.agents
        names = [agent.name for agent in agents]
        teams = [agent.team for agent in agents]
        fly = [agent.type is AgentType.AERIAL for agent in agents] if ctx.agent.block.flyers else None
        roster = None if self._turn is None else self._turn.roster
        if roster is None or (roster.names, roster.team_of, roster.fly, roster.out) != (names, teams, fly, None):
            roster = Roster(names, teams, kernels.name_keys(names), fly=fly)
        roster.turn[0] = turn
        found = TurnContacts(self, roster, ctx.seed)
        found.follow(ctx, agents)
        return found


def living_teams(ctx: Context) -> frozenset[Hashable]:
    """Return the teams that have living agents."""
    kept = ctx.game.internals.kept
    block = ctx.agent.block
    key = block, block.structure.version
    known = kept.get("living teams")
    if known is None or known[0] != key:
        known = key, frozenset([agent.team for agent in ctx.game.agents])
        kept["living teams"] = known
    teams: frozenset[Hashable] = known[1]
    return teams


def turn_of(ctx: Context) -> TurnContacts:
    """Return the contact queries of a context for this turn; valid until agents are moved or the next call."""
    internals = ctx.game.internals
    graph = ctx.graph.graph
    known: GameContacts | None = internals.kept.get("contacts")
    if known is None or known.graph is not graph or known.revision != graph.revision:
        numbers = node_numbers(graph.columns()) if known is None else known.numbers
        known = GameContacts(ctx, numbers)
        internals.kept["contacts"] = known
    return known.turn(ctx)


def nodes_within(graph: Graph, node: int, limit: float) -> dict[int, float]:
    """Return the nodes at most `limit` edges ahead of a node, each with its number of edges."""
    # NOTE: 5 us for 3 edges around a node of Helsinki, where a search of the whole graph takes 170 us.
    near = graph.neighborhoods
    hops = {node: 0.0}
    ring = [node]
    far = 0.0
    while ring and far + 1.0 <= limit:
        far += 1.0
        ring = [end for end in dict.fromkeys(end for start in ring for end in near[start]) if end not in hops]
        hops.update(dict.fromkeys(ring, far))
    return hops
