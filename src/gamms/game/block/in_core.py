"""Plays the games of a batch in the core.

`StrategySpec.core_steps` are the steps that `gamms.core.strategies` tries for an agent.
`RuleSpec.core_form` is a function that makes the rule that `gamms.core.rules` plays.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import groupby
from typing import Any, NamedTuple, Protocol, Self

import numpy as np

from gamms import kernels
from gamms.core import arrivals, conflicts, contacts, draws, moves, rules, turn
from gamms.core.rules import Flags, Tagging, Territory, Visitors
from gamms.errors import BadValue, NoPath
from gamms.game.block.columns import AgentTable, PlayedGame, find_decider, get_mode, get_or_make
from gamms.game.block.state import Arrays, CoreEvents, GameArrays, GameRow, Purpose, is_exact_float
from gamms.game.block.strategy_steps import (
    LOOKING,
    StepPaths,
    StrategySteps,
    can_read,
    has_plain_looks,
    is_always_acting,
    list_memories,
)
from gamms.game.block.travelers import NO_LEGS, ThreadTravel, TravelColumns, make_thread_in_parts
from gamms.game.conflicts import Conflicts, ConflictTable, flatten, make_ranking_for_all, make_tables
from gamms.game.movement.arrivals import NO_DEEDS, WAITS
from gamms.game.movement.courses import Courses, Paths, make_paths_in_parts
from gamms.game.movement.roads import OpenRoads, RoadTables
from gamms.game.movement.travel import ReachableNodes, make_no_path_error
from gamms.game.roles import Role, find_roles, get_team, has_attributes
from gamms.game.settings import NamedRule, as_called, declared, get_rule_spec
from gamms.game.strategy_specs import CoreStep, get_strategy_spec
from gamms.ir.agents import Position
from gamms.ir.columns import Failure
from gamms.ir.game_state import join_ends
from gamms.ir.graph import FloatArray, GraphColumns, IntArray, split_mode
from gamms.ir.obstacles import BoolArray
from gamms.kernels.draws import BitArray
from gamms.text import shown
from gamms.typing.agent_engine import IAgent
from gamms.typing.context import HostContext
from gamms.typing.game import EdgePlace

ONE_THAT_SHOWS = "a winner that the core finds"
_REACH, _END = (rules.KINDS.index(kind) for kind in ("reach", "end"))
_ILLEGAL, _WAITS, _LATE_DEED = (rules.KINDS.index(kind) for kind in ("illegal", "waits", "late deed"))
SCORING = ("tag", "capture", "reach", "arrive")  # kinds of events of rules that score
_SCORING = np.isin(rules.KINDS, SCORING)  # (kinds,)
_FIRST_ROOM = 1024  # events
_SINGLE_STEPS = {(CoreStep("stay"),): moves.STAY, (CoreStep("walk"),): moves.RANDOM_WALK}


HELD = 1
REPLACED = 2


class CompiledRule(NamedTuple):
    """The data of a rule of the core that its events refer to.

    Attributes:
        points: the points of each of its events for the team of the agent; None: its events do not score.
        flags: the teams that own its flags, by number.
        reason, winner, truncated: the end of a game; the winner may be `ONE_THAT_SHOWS`. Without a reason, the reason
            names the teams that have reached their goals.
        then: in one game, the function that is called with the context and both agents of an event `call`.
    """

    points: float | None = None
    flags: tuple[Hashable, ...] = ()
    reason: str = ""
    winner: object = ONE_THAT_SHOWS
    truncated: bool = False
    then: Callable[[Any, Any, Any], object] | None = None

    def end(self, winner: int, reached: Iterable[Hashable], teams: Sequence[Hashable]) -> dict[str, Any]:
        """Return the reason, the winner and the truncation of an end.

        Args:
            winner: the number of the winning team that the core has found; -1: none.
            reached: the teams that have reached their goals.
            teams: the teams of the game.
        """
        who = self.winner
        if who is ONE_THAT_SHOWS:
            who = None if winner < 0 else teams[winner]
        reason = self.reason or f"{' and '.join(map(str, dict.fromkeys(reached)))} reached the goal"
        return {"reason": reason, "winner": who, "truncated": self.truncated}


class ContactOptions(NamedTuple):
    """The distance and options that define a contact; see `gamms.rules.contacts`."""

    unit: str | None  # "hops", "metres" or "euclid"; None: on the same node
    limit: float
    crossing: bool
    air: bool
    passing: bool


NumberArray = IntArray | BitArray | BoolArray
Near = contacts.NearNodes | contacts.NodePositions | contacts.PathSegments | None
"""The distances between agents that count as contacts; None: agents must be on the same node."""
ContactSearch = Callable[[Near, contacts.Contacts], None]
"""Sets the distances of a search for contacts."""


class Ground(Protocol):
    """A territory; see `gamms.rules.territory.TerritorySource`."""

    @property
    def given(self) -> Mapping[int, object] | str:
        """The territory, or the name of a fact."""

    @property
    def roles(self) -> list[Role]:
        """The roles that own nodes of a territory that is no fact."""

    def get_owners(self, facts: Mapping[str, Any]) -> Mapping[int, object]:
        """Return the territory."""

    def number_owners(
        self, facts: Mapping[str, Any], teams: Sequence[Hashable]
    ) -> tuple[list[int], list[int], list[Role]]:
        """Return the ids of nodes with owners, the numbers of these, as in `core.rules.Territory`, and the roles."""


class RuleBuilder(ABC):
    """The data from which rules of the core are built: those of a batch (`BatchRules`) or of one game.

    Attributes:
        room: the number of agents for which arrays by agent have room.
        games, events, steps, pieces: see `gamms.core.rules`.
        columns: the nodes, times and lengths of the tracks of one game's agents.
        most: the room for nodes of each agent in `columns`.
        legs: the legs of these agents; empty in games that count edges.
        by_metres: whether the games are by metres.
        rules: the rule of each rule number in events.
    """

    room: int
    games: rules.GameColumns
    events: rules.Events
    steps: rules.AgentPaths
    columns: tuple[Any, Any, Any]
    most: int
    legs: contacts.Legs
    by_metres: bool
    pieces: contacts.MotionIntervals
    rules: list[CompiledRule]

    @property
    @abstractmethod
    def roster(self) -> AgentTable:
        """The agents."""

    @abstractmethod
    def list_by_agent(
        self,
        values: Callable[[], NumberArray],
        kind: type[np.generic] = np.int64,
        *,
        absent: int = 0,
        width: int = 1,
        members: Iterable[Hashable] = (),
    ) -> Any:
        """Return an array (room * width,) of values that depend on the agents.

        Args:
            values: returns the values, (agents * width,).
            kind: their type.
            absent: the value behind the last agent.
            width: the number of values of an agent.
            members: teams and roles on which the values depend; attributes that roles ask for may change.
        """

    def number(self, *played: CompiledRule) -> int:
        """Number the parts of a rule; return the first number."""
        self.rules += played
        return len(self.rules) - len(played)

    def make_tracks(self, sides: memoryview, *, at_end: bool) -> contacts.Tracks:
        """Return the tracks of the agents of a game, with these sides."""
        return contacts.Tracks(len(self.roster.names), self.most, *self.columns, sides, at_end=at_end)

    def make_visitors(self, members: Collection[Hashable] | None = None, *, at_end: bool) -> Visitors:
        """Return the agents on the ground, or those of some teams and roles, with the nodes that they visit."""
        sides = make_int_buffer(self.room)
        tracks = self.make_tracks(sides, at_end=at_end)
        return Visitors(self.steps, tracks, self.legs, self.pieces, self.mark_players(members, air=False), sides)

    def mark_players(self, members: Collection[Hashable] | None, *, air: bool = True) -> Any:
        """Return 1 for each agent of these teams and roles, else 0; None: all. `air` includes flying agents."""

        def values() -> BoolArray:
            return self.roster.find_players(members) & (air | ~self.roster.flies)

        return self.list_by_agent(values, members=members or ())

    def mark_sides(self, ours: object, theirs: object, *, air: bool) -> Any:
        """Return the sides of agents, (agents,), for `contacts.Tracks`."""

        def values() -> IntArray:
            both = [self.roster.find_players([team]) & (air | ~self.roster.flies) for team in (ours, theirs)]
            return both[0] + 2 * both[1]

        return self.list_by_agent(values, members=(ours, theirs))

    def get_team_number(self, member: Hashable) -> int:
        """Return the number of a team, or of the team of a role; -1: no agent plays for it."""
        team = get_team(member)
        teams = self.roster.teams
        return teams.index(team) if team in teams else -1

    @property
    @abstractmethod
    def num_nodes(self) -> int:
        """The number of nodes in tables by node; get it after `find_rows`."""

    @abstractmethod
    def find_rows(self, nodes: Sequence[int]) -> IntArray:
        """Return the numbers of nodes, given their ids."""

    @abstractmethod
    def keep(self, key: Hashable, make: Callable[[int], Arrays]) -> Arrays:
        """Return the memory of a rule in all games, made by `make(games)`."""

    @abstractmethod
    def make_keys(self, *several: Purpose) -> Any:
        """Return the keys of draws for several purposes, (games * purposes,)."""

    @abstractmethod
    def make_territory(self, ground: Ground | None) -> Territory:
        """Return the owners of nodes; empty without a territory (None)."""

    def find_holders(self, roles: Sequence[Role]) -> Any:
        """Return whether each agent has each role, (roles * room,)."""
        found = np.zeros((len(roles), self.room), np.int64)
        for number, role in enumerate(roles):
            has_role = self.roster.find_players([role])
            found[number, : len(has_role)] = has_role
        return flatten(found, np.int64)

    @abstractmethod
    def make_near(self, nearness: ContactOptions) -> Near:
        """Return the distances between agents that count as contacts."""

    def publish(self, fact: str, value: object) -> None:  # noqa: B027 - one game has published it
        """Publish a fact, unless it is published."""

    # The following methods do nothing for batches, whose columns hold what the rules read.

    def read_starts(self, agents: Callable[[], BoolArray]) -> None:  # noqa: B027
        """Note that a rule reads the start nodes of some agents, (agents,), in `games`; see `list_by_agent`."""

    def read_scores(self) -> None:  # noqa: B027
        """Note that a rule reads the scores of the teams."""

    def follow(self, rule: Flags | Tagging, ground: Ground | None) -> None:  # noqa: B027
        """Keep the owners of nodes in a rule up to date, if the territory is a fact that changes."""

    def follow_places(  # noqa: B027
        self, tagging: Tagging, nearness: ContactOptions, near: Near, sides: tuple[Any, Any], search: ContactSearch
    ) -> None:
        """Keep straight-line distances in a tagging up to date, if agents may be beside nodes."""


class BatchRules(RuleBuilder):
    """The data from which the rules of one thread and one map of a batch are built.

    Attributes:
        state: the state of all games.
        thread: the number of the thread.
    """

    def __init__(
        self,
        state: GameArrays,
        games: rules.GameColumns,
        events: rules.Events,
        travel: ThreadTravel | None,
        known: list[CompiledRule],
        thread: int,
    ) -> None:
        agents = len(state.roster.names)
        streets = state.streets
        self.state = state
        self.room = agents
        self.thread = thread
        self.games = games
        self.events = events
        self.by_metres = travel is not None and travel.most_legs > 0
        self.legs = NO_LEGS
        if travel is None:
            self.most = 2
            most_legs = 0
            keys = streets.num_nodes
            self.columns = make_int_buffer(2 * agents), make_floats(2 * agents), make_int_buffer(agents)
            self.steps = rules.AgentPaths(*self.columns)
        else:
            self.most = travel.most
            most_legs = travel.most_legs
            keys = max(streets.num_nodes, len(state.movement.columns.edge_ids))
            self.columns = travel.tracks
            self.steps = travel.course
            self.legs = travel.legs
        self._room_of_pieces = 2 * agents * (self.most + 2 * most_legs + 1), keys  # visits and legs, two entries each
        self.rules = known
        self._count = 0  # the parts of rules that are numbered
        self._agents_in: list[IntArray] = []  # stored columns of agent numbers, which may have been loaded

    @cached_property
    def pieces(self) -> contacts.MotionIntervals:  # type: ignore[override] # made when a rule needs it
        """Working memory for contacts."""
        return make_motion_intervals(*self._room_of_pieces)

    @property
    def roster(self) -> AgentTable:
        """The agents."""
        return self.state.roster

    def number(self, *played: CompiledRule) -> int:
        """Number the parts of a rule; equal ones have the same numbers on all maps and in all threads."""
        first = self._count
        self._count += len(played)
        known = self.rules[first : self._count]
        kinds = [[type(one.points) for one in parts] for parts in (played, known)]
        if known == [*played] and kinds[0] == kinds[1]:
            return first
        return super().number(*played)

    def list_by_agent(
        self,
        values: Callable[[], NumberArray],
        kind: type[np.generic] = np.int64,
        *,
        absent: int = 0,  # noqa: ARG002 - there is room for these agents only
        width: int = 1,  # noqa: ARG002 - as above
        members: Iterable[Hashable] = (),  # noqa: ARG002 - nothing changes attributes in the games that the core plays
    ) -> Any:
        """Return an array (agents * width,) of values that depend on the agents."""
        return flatten(values(), kind)

    @property
    def num_nodes(self) -> int:
        """The number of nodes of the map."""
        return self.state.streets.num_nodes

    def find_rows(self, nodes: Sequence[int]) -> IntArray:
        """Return the rows of nodes, given their ids."""
        return self.state.streets.rows(nodes)

    def keep(self, key: Hashable, make: Callable[[int], Arrays]) -> Arrays:
        """Return the memory of a rule in all games."""
        kept = self.state.keep(key, make)
        self.state.of_core.add(key)
        if "carriers" in kept:
            self._agents_in.append(kept["carriers"])
        return kept

    def refuse_unknown_agents(self) -> None:
        """Refuse stored or loaded agent numbers without an agent."""
        agents = len(self.state.roster.names)
        for column in self._agents_in:
            if column.min(initial=-1) < -1 or column.max(initial=-1) >= agents:
                raise BadValue(f"A rule keeps numbers of agents from -1 to {agents - 1}, not {shown(column)}.")

    def publish(self, fact: str, value: object) -> None:
        """Publish a fact, unless it is published."""
        self.state.facts.setdefault(fact, value)

    def make_keys(self, *several: Purpose) -> Any:
        """Return the keys of draws for several purposes, (games * purposes,)."""
        return get_memory(self.state.compute_several_purpose_keys(*several))

    def make_territory(self, ground: Ground | None) -> Territory:
        """Return the owners of nodes; empty without a territory (None)."""
        state = self.state
        if ground is None:
            return Territory(make_int_buffer(0), make_int_buffer(0), 0)
        territory = ground.get_owners(state.facts)

        def make() -> tuple[object, IntArray, list[Role]]:
            nodes, numbers, roles = ground.number_owners(state.facts, state.roster.teams)
            columns = state.streets.columns
            rows = kernels.find_rows(columns.node_ids, np.array(nodes, np.int64), columns.node_order)
            owners = np.full(len(columns.node_ids), -1)
            owners[rows[rows >= 0]] = np.array(numbers, np.int64)[rows >= 0]
            return territory, owners, roles

        _, owners, roles = get_or_make(state.shared, ("territory", id(territory)), make)
        return Territory(flatten(owners, np.int64), self.find_holders(roles), self.room)

    def make_near(self, nearness: ContactOptions) -> Near:
        """Return the distances between agents that count as contacts."""
        state = self.state
        unit, limit, *_ = nearness
        if unit is None:
            return None
        if unit == "euclid" and self.by_metres:
            return contacts.PathSegments(
                len(self.roster.names), self._make_polylines(), flatten(state.streets.columns.xy, np.float64)
            )
        if unit == "euclid":
            xyz = np.insert(state.streets.columns.xy, 2, 0.0, axis=1)
            return contacts.NodePositions(self.columns[0], flatten(xyz, np.float64))
        weight = None if unit == "hops" else "length"

        def make() -> contacts.NearNodes:
            near = make_near_nodes(state.streets.get_ways(weight), limit)
            state.roads.searches.append((weight, near))
            return near

        return get_or_make(state.shared, ("reach", unit, limit, self.thread), make)

    def _make_polylines(self) -> contacts.Polylines:
        """Return the polylines of the edges, with working memory of their own."""
        found = contacts.Polylines()
        self.state.movement.lines.polylines.give(found)
        return found


class NamedEdges:
    """The edges that given actions name in the last turn.

    Args:
        shape: the numbers of games and agents.

    Attributes:
        rows: (games, agents) the rows of the edges; see `moves.OneEdgeMovers`. While agents decide on arrival, those
            that are named there.
        are_any: (1,) whether there are any; else all rows are `moves.NO_EDGE`.
    """

    def __init__(self, shape: tuple[int, int]) -> None:
        self.rows = np.full(shape, moves.NO_EDGE)
        self.are_any = np.zeros(1, np.bool_)
        self._first: IntArray | None = None  # the rows with which agents have set out; None: `rows`

    def put(self, where: tuple[Any, ...], edges: IntArray, columns: GraphColumns) -> None:
        """Set edges, by their ids, or `NO_EDGE` or `STOP`.

        Args:
            where: an index of games and agents.
            edges: the edges.
            columns: the map of the games.
        """
        rows = kernels.find_rows(columns.edge_ids, edges, columns.edge_order)
        self.rows[where] = np.where(edges >= 0, rows, edges)
        self.are_any[0] = True

    def forget(self) -> None:
        """Forget all edges."""
        if self.are_any[0]:
            self.rows.fill(moves.NO_EDGE)
            self.are_any[0] = False

    def begin_arrival(self) -> None:
        """Keep the edges with which agents have set out, and forget those that were named on arrival."""
        if self._first is None:
            self._first = self.rows.copy()
        self.forget()

    def end_arrivals(self) -> None:
        """Return to the edges with which agents have set out."""
        if self._first is not None:
            self.rows[:] = self._first
            self.are_any[0] = (self._first != moves.NO_EDGE).any()
            self._first = None

    def find(self, game: int, agents: IntArray, columns: GraphColumns) -> IntArray:
        """Return the ids of the edges with which agents of a game have set out, -1 for none; agent -1 is none."""
        first = self.rows if self._first is None else self._first
        rows = np.where(agents >= 0, first[game, agents], moves.NO_EDGE)
        return np.where(rows >= 0, columns.edge_ids[rows], moves.NO_EDGE)


class CoreColumns:
    """The columns that the core writes for the games on all maps, with a row for each game.

    Args:
        states: the state of the games on each map; they share all columns that do not depend on the map.
        map_of: see below.

    Attributes:
        map_of: (games,) the number of the map that each game is on; it may change.
        plan_of: (games,) the number of the plan that each game follows: that of its map, or of another plan on it.
        others: the states of games that follow other plans than those with which games begin on their maps.
        given: (games, agents) the given actions, as numbers of legal nodes; -1: the agent follows a route.
        edges: the edges that given actions name.
        start, went, takes_part: (games, agents) the nodes before and after the moves, and whether the agent took part.
        here: (games, agents) the nodes of agents that are about to move.
        ends: (games, agents) the end nodes of the moves in the current part of a turn.
        wanted: (games, agents) the places that agents stopped by conflicts wanted to reach, as numbered in conflicts.
        held: (games, agents) whether the agent's decision is cancelled: `HELD`, or `REPLACED` for an agent that was
            created under the name of another, whose move is shown until the agents move.
        until: (games,) the number of parts of turns after which each game stops; 0: it is not played.
        part: (games,) the number of parts played in the current turn.
        over: (games,) whether each game has ended.
        score: (games, teams)
        rules: the rule of each rule number in events.
        events: the events of each thread.
        illegal: decisions of the last phase that the core could not execute, by game and agent.
        waiting: the agents, by game, that have arrived too often in the last phase.
        noted: the events of the last phase, without ends; None: there were none.
    """

    def __init__(self, states: Sequence[GameArrays], map_of: IntArray) -> None:
        state = states[0]
        self._state = state
        self.map_of = map_of
        self.plan_of = map_of.copy()
        self.others: list[GameArrays] = []
        shape = state.node.shape
        self.given, self.start, self.ends, self.went, self.wanted = np.zeros((5, *shape), np.int64)
        self.here = state.node
        self.edges = NamedEdges(shape)
        self.takes_part, self.held = np.zeros((2, *shape), np.uint8)
        self.until = np.zeros(shape[0], np.int64)
        self.part = np.zeros(shape[0], np.int64)
        self.over = np.zeros(shape[0], np.uint8)
        self.score = np.zeros((shape[0], len(state.roster.teams)))
        self.rules: list[CompiledRule] = []
        self.events: list[rules.Events] = []
        self.illegal: list[Failure] = []
        self.waiting: set[tuple[int, int]] = set()
        self.noted: CoreEvents | None = None
        self.take_states(states)
        self.begin()

    def take_states(self, states: Sequence[GameArrays]) -> None:
        """Set the state of the games on each map; see above."""
        self._states = states
        self._ids = np.concatenate([one.streets.columns.node_ids for one in states])
        self._first = np.cumsum([0, *(one.streets.num_nodes for one in states)])  # the place of each map in `_ids`

    def select_followers(self, plan: int, games: IntArray) -> IntArray:
        """Return those of some games that follow the plan with a number."""
        found: IntArray = games[self.plan_of[games] == plan]
        return found

    def take_moves(self, other: "CoreColumns", game: int, pairs: IntArray) -> None:
        """Take the moves of the present or last turn of a game; see `CoreGames.take_moves`."""
        mine, theirs = pairs
        place = find_places_on_map(self._state, other.state_of(game))
        self.here = self._state.node.copy()
        for name in ("start", "went", "ends", "here"):
            column = getattr(self, name)
            column[0, mine] = place.find_nodes(getattr(other, name)[game, theirs], column[0, mine])
        for name in ("takes_part", "held"):
            getattr(self, name)[0, mine] = getattr(other, name)[game, theirs]
        self.wanted[0, mine] = place.find_places(other.wanted[game, theirs])
        self.part[0] = other.part[game]
        self.edges.rows[0, mine] = place.find_edges(other.edges.rows[game, theirs])
        self.edges.are_any[0] = other.edges.are_any[0]
        self._state.take_moves(other.state_of(game), game, pairs)

    def state_of(self, game: int) -> GameArrays:
        """Return the state of the games on the map of a game."""
        found: GameArrays = self._states[self.map_of[game]]
        return found

    def begin(self) -> None:
        """Begin all games, whose agents have not moved."""
        self.start[:] = self._state.node
        self.went[:] = self._state.node
        self.takes_part[:] = 0
        self.held[:] = 0
        self.part[:] = 0

    @property
    def begun_columns(self) -> list[np.ndarray[Any, Any]]:
        """The columns with whose rows games begin."""
        return [self.start, self.went, self.takes_part, self.held, self.part, self.over, self.score]

    def get_events(self, thread: int) -> rules.Events:
        """Return the events of a thread."""
        while len(self.events) <= thread:
            self.events.append(rules.Events(_FIRST_ROOM))
        return self.events[thread]

    def give(self) -> None:
        """Write which games are over, and the scores, for the core."""
        np.logical_not(self._state.is_going, out=self.over)
        put_scores(self._state, self.score)

    def take_in(self) -> None:
        """Copy the results of the core to the state of the batch."""
        np.equal(self.over, 0, out=self._state.is_going)
        wrong: list[tuple[Failure, int]] = []
        self.illegal = []
        self.waiting = set()
        self.noted = None
        for noted in [self._read(events) for events in self.events if events.count]:
            self.noted = noted
            is_wrong = noted.kinds >= _ILLEGAL
            for row in np.flatnonzero(is_wrong).tolist():
                failure = self._make_failure(noted, row)
                wrong.append((failure, int(noted.turns[row])))
                if noted.kinds[row] == _ILLEGAL:
                    self.illegal.append(failure)
                elif noted.kinds[row] == _WAITS:
                    self.waiting.add((failure.game, failure.agent))
            self._state.events.take(noted.select(~is_wrong) if is_wrong.any() else noted)
        self._note_wrong(wrong)
        for state in self._states:
            if state.movement.depends_on_speeds:
                state.movement.take_out(*np.nonzero(~state.alive))
        for state in (*self._states, *self.others):
            state.now.clear()

    def _read(self, events: rules.Events) -> CoreEvents:
        """Take the scores, and the ends of games that rules have noted; return the other events."""
        count = events.count
        columns = events.games, events.turns, events.rules, events.kinds, events.agents, events.others, events.nodes
        games, turns, numbers, kinds, agents, others, nodes = (np.array(column[:count]) for column in columns)
        times = np.array(events.times[:count])
        has_times = bool(self._states[0].deeds.lasting)
        flags = tuple(one.flags for one in self.rules)
        noted = CoreEvents(games, turns, numbers, kinds, agents, others, nodes, flags, times, has_times)
        if (games[1:] < games[:-1]).any():  # those of one map come behind those of another
            noted = noted.select(np.argsort(games, kind="stable"))
        events.count = 0
        is_end = noted.kinds == _END
        self._end_games(noted, np.flatnonzero(is_end))
        noted = noted.select(~is_end)
        self._note_scores(noted)
        return noted._replace(nodes=self._ids[self._first[self.map_of[noted.games]] + noted.nodes])

    def _end_games(self, noted: CoreEvents, rows: IntArray) -> None:
        """End games by the events in these rows."""
        over = self._state.over
        teams = self._state.roster.teams
        kinds = noted.rules[rows] * (len(teams) + 1) + noted.agents[rows] + 1
        for kind in np.flatnonzero(np.bincount(kinds)).tolist():  # a rule and a winner
            number, winner = divmod(kind, len(teams) + 1)
            played = self.rules[number]
            those = rows[kinds == kind]
            ends = [played.end(winner - 1, (), teams)] * len(those)
            if not played.reason:
                ends = [played.end(winner - 1, self._find_teams_at_goals(noted, row), teams) for row in those.tolist()]
            for game, end in zip(noted.games[those].tolist(), ends, strict=True):
                known = over[game]
                over[game] = end if known is None else join_ends(known, end)

    def _find_teams_at_goals(self, noted: CoreEvents, end: int) -> list[Hashable]:
        """Return the teams of agents that have reached goals: events of the same rule and turn before an end."""
        teams = self._state.roster.teams
        first = end
        while first and noted.kinds[first - 1] == _REACH and noted.rules[first - 1] == noted.rules[end]:
            first -= 1
        members = self._state.roster.team_of[noted.agents[first:end]].tolist()
        return [teams[number] for number in members]

    def _note_scores(self, noted: CoreEvents) -> None:
        """Take the scores, and the order in which they were first set."""
        score = self.score
        teams = self._state.roster.teams
        is_scored = np.array([one.points is not None for one in self.rules], np.bool_)
        has_floats = np.array([isinstance(one.points, float) for one in self.rules], np.bool_)
        rows = np.flatnonzero(noted.rules >= 0)
        rows = rows[is_scored[noted.rules[rows]]]
        rows = rows[_SCORING[noted.kinds[rows]]]
        if not len(rows):
            return
        which = noted.games[rows] * len(teams) + self._state.roster.team_of[noted.agents[rows]]
        first = np.full(score.size, -1)
        first[which[::-1]] = rows[::-1]
        are_floats = np.zeros(score.size, np.bool_)
        are_floats[which[has_floats[noted.rules[rows]]]] = True
        self._state.scores.take(teams, score, first.reshape(score.shape), are_floats.reshape(score.shape))

    def _note_wrong(self, wrong: list[tuple[Failure, int]]) -> None:
        """Note the invalid decisions that the core has found in turns of these numbers."""
        decided = self._state.failures
        for failure, _ in wrong:
            self._states[self.map_of[failure.game]].tell(failure)
        if decided:  # by functions, in the same part of a turn
            wrong = sorted([*decided, *wrong], key=_make_sort_key)
            decided.clear()
        for failure, when in wrong:
            self._state.note_failure(failure, when)

    def _make_failure(self, noted: CoreEvents, row: int) -> Failure:
        """Return the error: an agent arrived too often, did a deed too late, or has no path to a node."""
        edge, target, game, agent, kind = (
            int(column[row]) for column in (noted.others, noted.nodes, noted.games, noted.agents, noted.kinds)
        )
        if kind != _ILLEGAL:
            return Failure.make_illegal(game, agent, WAITS if kind == _WAITS else NO_DEEDS)
        by = self._states[self.map_of[game]].movement
        if edge < 0:  # it is on a node
            why = f"BadValue: {NoPath(int(by.columns.node_ids[-2 - edge]), target)}"
            return Failure.make_illegal(game, agent, why)
        node, end = by.columns.node_ids[[by.columns.sources[edge], by.columns.targets[edge]]].tolist()
        modes = by.mode_of[noted.agents[[row]]]
        may_turn = by.by_metres and by.find_reverse_edges(noted.others[[row]], noted.games[[row]], modes)[0] >= 0
        error = make_no_path_error(node, end, target, is_paced=True, may_turn=bool(may_turn))
        return Failure.make_illegal(game, agent, f"BadValue: {error}")


class PlacesOnMap(NamedTuple):
    """The numbers of nodes and edges of one map on another.

    Attributes:
        nodes, edges: for each row there, the row here; -1: it is not here.
    """

    nodes: IntArray
    edges: IntArray

    def find_nodes(self, rows: IntArray, others: IntArray) -> IntArray:
        """Return the rows of nodes here; `others`: those in place of nodes that are not here."""
        found = self.nodes[rows]
        return np.where(found >= 0, found, others)

    def find_edges(self, rows: IntArray) -> IntArray:
        """Return the rows of edges here; numbers below 0 stay."""
        return np.where(rows >= 0, self.edges[np.maximum(rows, 0)], rows) if len(self.edges) else rows

    def find_places(self, places: IntArray) -> IntArray:
        """Return the numbers of nodes and edges, as conflicts count them; see `CoreGames.get_wanted_place`."""
        count = len(self.nodes)
        nodes = self.nodes[np.minimum(places, count - 1)]
        edges = self.find_edges(np.maximum(places - count, -1))
        return np.where(places < count, np.maximum(nodes, 0), len(self.nodes) + np.maximum(edges, 0))


def find_places_on_map(state: GameArrays, other: GameArrays) -> PlacesOnMap:
    """Return where the nodes and edges of the map of other games are on the map of these."""
    mine, theirs = state.movement.columns, other.movement.columns
    nodes = kernels.find_rows(mine.node_ids, theirs.node_ids, mine.node_order)
    return PlacesOnMap(nodes, kernels.find_rows(mine.edge_ids, theirs.edge_ids, mine.edge_order))


def _make_sort_key(pair: tuple[Failure, int]) -> tuple[int, int]:
    return pair[0].game, pair[0].agent


def put_scores(state: GameArrays, score: FloatArray) -> None:
    """Write the scores of all games to the columns of the core, (games, teams); 0 for one that the core cannot hold."""
    for number, team in enumerate(state.roster.teams):
        column: Any = state.scores.get(team, 0.0)
        are_exact = np.asarray(column).dtype != object
        score[:, number] = column if are_exact else [one if is_exact_float(one) else 0.0 for one in column]


def make_near_nodes(arcs: kernels.Arcs, limit: float) -> contacts.NearNodes:
    """Return a search for the nodes within a distance of a node, along the edges of a map."""
    ends = flatten(arcs.offsets, np.int64), flatten(arcs.ends, np.int64)
    return contacts.NearNodes(
        *ends, flatten(arcs.weights, np.float64), limit, ReachableNodes(len(arcs.offsets) - 1).core
    )


def make_int_buffer(number: int) -> Any:  # memoryviews are not subscriptable
    """Return integers as a buffer for the core."""
    return np.zeros(number, np.int64).data


def make_floats(number: int) -> Any:
    """Return floats as a buffer for the core."""
    return np.zeros(number).data


def make_motion_intervals(room: int, keys: int) -> contacts.MotionIntervals:
    """Return working memory for this many intervals and keys."""
    whole: list[Any] = [row.data for row in np.zeros((6, room), np.int64)]
    parts: list[Any] = [row.data for row in np.zeros((4, room))]
    first: Any = np.full(keys, -1).data
    columns: Any = *whole[:3], *parts, *whole[3:5], first, whole[5]
    return contacts.MotionIntervals(*columns)


def get_memory(column: np.ndarray[Any, Any]) -> Any:
    """Return the memory of a column of the batch, which the core writes to."""
    assert column.flags.c_contiguous  # noqa: S101 - the state of a batch is in one piece
    return (column.view(np.uint8) if column.dtype == np.bool_ else column).reshape(-1).data


def find_core_forms(game: PlayedGame, roster: AgentTable) -> list[int | None]:
    """Return the core's number for the strategy or plan of each agent; None: the core does not play it.

    Args:
        game: the game at its start.
        roster: the agents; an agent without a strategy stays.
    """
    settings = game.internals.parts.settings.settings_now()
    plans = settings["plans"]
    some_fly = bool(roster.flies.any())
    single: dict[int, int | None] = {}  # by the id of the decider
    forms: list[int | None] = []
    drives = roster.find_driving(settings["speed_unit"])
    is_possible = (roster.is_first & ~roster.flies & ~drives).tolist()
    for agent, is_first, may_be in zip(roster.agents, roster.is_first.tolist(), is_possible, strict=True):
        decider = find_decider(agent, plans)
        form = None
        if decider is None and is_first:
            form = moves.STAY
        elif may_be:
            if id(decider) not in single:
                steps: Any = get_strategy_spec(decider).core_steps or ()
                single[id(decider)] = _SINGLE_STEPS.get(steps)
            form = single[id(decider)]
            if form is None:
                form = _find_form(game, settings, agent, decider, some_fly=some_fly)
        forms.append(form)
    return forms


def _find_form(
    game: PlayedGame, settings: Mapping[str, Any], agent: IAgent, decider: object, *, some_fly: bool
) -> int | None:
    """Return the core's number for a strategy or a plan of several steps; see `find_core_forms`."""
    steps = get_strategy_spec(decider).core_steps or ()
    kinds = {step.kind for step in steps}
    mode = get_mode(agent)
    if mode is not None and split_mode(mode)[1]:  # its routes follow from the edges that it has driven
        return None
    by_edges = settings["speed_unit"] == "edges"
    goes_on = agent.speed is not None and "follow" in kinds  # beyond its stops
    may_look = by_edges and not some_fly and has_plain_looks(agent)
    may_err = settings["on_illegal"] == "raise" and not (by_edges and agent.speed is None)
    is_played = is_always_acting(steps) and not (goes_on or may_err) and settings["legal"] == "edges"
    memory = game.internals.state.memories.get(agent.name, {})
    is_played = is_played and can_read(steps, memory, game.ctx.graph.graph.get_node)
    return moves.BY_STEPS if is_played and (may_look or kinds.isdisjoint(LOOKING)) else None


def find_conflicts_in_core(game: PlayedGame, roster: AgentTable) -> Conflicts | None:
    """Return the conflicts of a game that the core resolves; None: there are none, or a function resolves them."""
    return make_ranking_for_all(game.settings()["conflicts"], roster.names, roster.list_teams())


def is_function(rule: NamedRule) -> bool:
    """Return whether a rule is called as a function of arrays or of the context, not played by the core."""
    return rule.spec.is_array_function or rule.spec.core_form is None


def _find_owners(game: PlayedGame, rule: NamedRule) -> list[Role]:
    """Return the roles that own nodes in facts that a rule reads."""
    facts = [game.facts.get(name) for name in rule.spec.reads_owners]
    return [role for fact in facts if isinstance(fact, Mapping) for role in find_roles(fact.values())]


def list_called_rules(
    game: PlayedGame, roster: AgentTable, rules: Iterable[NamedRule] | None = None
) -> list[NamedRule]:
    """Return rules of a game as a batch calls them; some have no core form where agents fly, or may change.

    Args:
        game: the game.
        roster: its agents.
        rules: the rules; None: all of the game.
    """
    called = as_called(game.rules if rules is None else rules)
    some_fly = bool(roster.flies.any())
    are_exact = all(map(is_exact_float, game.scores.values()))  # else no rule in the core may add to scores
    are_exact = are_exact and not game.internals.calls_rules
    are_fixed = not any(one.spec.may_create_agents for one in game.rules)  # and no rule sets attributes of agents
    without = [
        one.spec.core_form is not None
        and (
            not are_exact
            or (some_fly and one.spec.needs_ground)
            or not (are_fixed or not has_attributes([*one.spec.teams, *_find_owners(game, one)]))
        )
        for one in called
    ]
    return [
        one._replace(rule=_exclude_core(one.rule)) if is_function else one
        for one, is_function in zip(called, without, strict=True)
    ]


def _exclude_core(rule: Callable[[Any], object]) -> Callable[[Any], object]:
    """Return a rule that the core does not have."""

    def call(ctx: HostContext) -> None:
        rule(ctx)

    return declared(call, replace(get_rule_spec(rule), core_form=None, player=None))


class PastPlaces(NamedTuple):
    """The places of the agents of a single game after its last turns, (turns, agents) each.

    Attributes:
        node: the rows of nodes.
        edge, share, motion: the positions on edges, as in `Movement`; (0, agents) where agents are on nodes only.
    """

    node: IntArray
    edge: IntArray
    share: FloatArray
    motion: IntArray

    @classmethod
    def allocate(cls, turns: int, state: GameArrays) -> "PastPlaces":
        """Return room for a number of turns."""
        shape = turns, len(state.roster.names)
        on_edges = shape if state.movement.by_metres else (0, shape[1])
        node = np.zeros(shape, np.int64)
        return cls(node, np.full(on_edges, -1), np.zeros(on_edges), np.zeros(on_edges, np.int64))

    def get_core_places(self, state: GameArrays) -> turn.PastPlaces:
        """Return the same for the core."""
        by = state.movement
        motions = get_memory(by.motion) if by.by_metres and len(self.edge) else make_int_buffer(0)
        columns = [*map(get_memory, self), motions]
        return turn.PastPlaces(len(self.node), *columns)


class CoreGames:
    """The games of a batch on one map, in the core.

    Args:
        game: the game at its start.
        state: the state of all games, which turns change.
        block: the columns that the games on all maps share.
        number: the number of the plan, see `CoreColumns.plan_of`.
        is_apart: whether rules run after all games have moved, because functions are called between them.
        decides: whether these games just decide: no rules and no conflicts are made; see `deciders`.
        past_turns: in a single game, the number of turns after which the places of agents are kept; see `past`.
        asked: the numbers of the agents whose strategies are called, though the core may know them.

    Attributes:
        numbers: rule of the core -> the least number of later rules in events.
        past: the places of the agents after turn t, in row t modulo `past_turns`.
        has_functions: whether functions are called between its phases.
        part_of: (agents,) the part of the turn in which each agent decides and moves, in the order of play.
        num_parts: the number of parts of a turn.
        edges: the edges that given actions name.
        deciders: the columns of the games, and the agents that decide in them.
        arrival: the number of arrivals in this part of the turn, if functions are called on arrival; else None.
        drawn: (games, agents) how often each agent has drawn in it.
    """

    arrival: int | None = None
    drawn: IntArray

    def __init__(
        self,
        game: PlayedGame,
        state: GameArrays,
        block: CoreColumns,
        number: int = 0,
        *,
        is_apart: bool,
        decides: bool = False,
        past_turns: int = 0,
        asked: Sequence[int] = (),
    ) -> None:
        settings = game.settings()
        self.numbers: dict[str, int] = {}
        self.past = PastPlaces.allocate(past_turns, state)
        self._state = state
        self._block = block
        self.edges = block.edges
        called = [] if decides else list_called_rules(game, state.roster)
        self._rules = [one for one in called if one.phase == "after"]
        self.has_functions = is_apart or any(map(is_function, self._rules))
        self._keeps_courses = is_apart or any(map(is_function, called))
        self._conflicts = None if decides else find_conflicts_in_core(game, state.roster)
        self._has_conflicts = settings["conflicts"] is not None
        deciders = [find_decider(agent, settings["plans"]) for agent in state.roster.agents]
        forms = [moves.STAY if one is None else one for one in find_core_forms(game, state.roster)]
        for agent in asked:
            forms[agent] = moves.STAY
        self._decides_by = np.array(forms, np.uint8)
        pairs = zip(forms, deciders, strict=True)
        self._steps = [
            (get_strategy_spec(one).core_steps or ()) if form == moves.BY_STEPS else () for form, one in pairs
        ]
        of_agents = zip(state.roster.names, deciders, state.roster.is_first.tolist(), strict=True)
        self._deciders = [name for name, one, is_first in of_agents if one is not None and is_first]
        self._by_steps: StrategySteps | None = None
        self._deciding = self._decides_by.copy()
        self._given: BoolArray | None = None  # the agents whose actions were in the block last; see `prepare`
        streets = state.streets
        self._streets = streets.core_with_all_legal if state.movement.are_all_legal else streets.core
        self._first_node = np.zeros(len(state), np.int64)  # see `rules.GameColumns`
        have_modes = bool(state.movement.mode_of.any())
        self._mode_first = np.zeros(len(state.roster.names) if have_modes else 0, np.int64)  # see `rules.GameColumns`
        self._tables: RoadTables | None = None  # of the games, once a rule has closed roads, or with modes
        self._number = number
        self._last: tuple[IntArray, IntArray, BoolArray] | None = None  # see `get_moves`, while agents arrive
        self._games = np.zeros(0, np.int64)  # that are played
        self.part_of = state.roster.find_parts(settings["order"])
        self.num_parts = len(settings["order"] or [()])
        self._made: list[tuple[turn.Player, BatchRules]] = []  # of each thread
        self._movers: list[moves.OneEdgeMovers] = []  # one for each thread
        self._parts: list[Any] = []  # `NamedRule` and `rules.Rule`, where there are functions
        self._alone: dict[str, rules.Rule] = {}  # rules that no other follows, by name; see `play_rule`
        self._columns: TravelColumns | None = None  # in games that do not go along one edge a turn
        self._counts = make_int_buffer(state.node.size)  # that threads share
        self._has_come = np.zeros(state.node.shape, np.bool_)  # since the rules after the last moves began
        self.deciders: tuple[rules.GameColumns, moves.OneEdgeMovers]

    def begin(self, before: "CoreGames | None" = None) -> Self:
        """Make what plays the games, and return this.

        Args:
            before: plays them by the plan with which they have begun; None: it is this one.
        """
        if before is not None:
            self._counts = before._counts
            self._has_come = before._has_come
        self._columns = self._make_columns(None if before is None else before._columns)
        self._made.append(self._make_player())
        return self

    def get_moves(self, games: IntArray, part: int | None) -> tuple[IntArray, IntArray, BoolArray]:
        """Return the nodes before and after moves in some games, and a mask of the agents that took part.

        They are those of agents that are about to move in a part of the turn; None: the last moves.
        """
        block = self._block
        if part is None:
            start, went, takes_part = self._last or (block.start, block.went, block.takes_part)
            return start[games], went[games], takes_part[games] > 0
        here = block.here[games]
        goes = (self.part_of == part) & (block.held[games] != HELD)
        return here, np.where(goes, block.ends[games], here), block.takes_part[games] > 0

    def enter(self, game: int, agent: int, start: int | Position, node: int, part: int | None) -> None:
        """Add an agent to a game; the move of a deleted agent of its name stays.

        Args:
            game: the game.
            agent: the agent.
            start: where it was created: a node, or (x, y, z).
            node: where it is now.
            part: the part of the turn in which agents are about to move; None: they are not.
        """
        state = self._state
        row = int(state.streets.rows(node))
        state.is_there[game, agent] = True
        state.plays[game, state.roster.team_of[agent]] = True
        state.start[game, agent] = row if isinstance(start, tuple) else state.streets.rows(start)
        self._put_new(game, agent, row, part)
        if state.flights is not None:
            state.flights.enter(agent, game, start if isinstance(start, tuple) else None)

    def _put_new(self, game: int, agent: int, node: int, part: int | None) -> None:
        """Let an agent stay at the row of the node where it was created; see `enter`."""
        is_replacing = self._block.takes_part[game, agent] > 0
        self._has_come[game, agent] = True
        if not is_replacing:
            self._stand(game, agent, node, is_moving=part is not None)
        if part is not None:
            self._block.held[game, agent] = REPLACED if is_replacing else HELD

    def put_replacing(self, games: IntArray) -> None:
        """Let agents stay that were created under the names of others, in some games."""
        at, agents = np.nonzero(self._block.held[games] == REPLACED)
        for game, agent in zip(games[at].tolist(), agents.tolist(), strict=True):
            self._block.held[game, agent] = HELD
            self._stand(game, agent, int(self._state.node[game, agent]), is_moving=True)

    def _stand(self, game: int, agent: int, node: int, *, is_moving: bool) -> None:
        """Let an agent stay at a node for the whole turn; `is_moving`: agents are about to move."""
        block = self._block
        places = () if self._columns is None or self._columns.ends is None else self._columns.ends
        for column in (block.start, block.went, block.ends, block.here, *places):
            column[game, agent] = node
        if self.courses is not None and is_moving:
            self.courses.stand(game, agent, node)

    def leave(self, game: int, agent: int, node: int) -> None:
        """Remove a deleted agent from a game, and store its last node."""
        state = self._state
        state.is_there[game, agent] = False
        state.alive[game, agent] = False
        state.start[game, agent] = -1
        state.node[game, agent] = state.streets.rows(node)
        state.movement.clear(game, agent)

    def hold(self, game: int, agent: int) -> None:
        """Cancel the decision of an agent."""
        self._block.held[game, agent] = HELD

    def note_conflict(self, game: int, agent: int, place: int | EdgePlace) -> None:
        """Note that a conflict has stopped an agent on the way to a node or an edge."""
        columns = self._state.movement.columns
        streets = self._state.streets
        if isinstance(place, EdgePlace):
            row = len(columns.node_ids) + int(np.flatnonzero(columns.edge_ids == place.edge)[0])
        else:
            row = int(streets.rows(place))
        self._block.wanted[game, agent] = row
        self._state.blocked[game, agent] = True

    # -- arrivals -----------------------------------------------------------------------------------------------------

    def begin_arrivals(self, games: IntArray) -> None:
        """Begin a part of the turn of some games in which functions are called where agents arrive."""
        block = self._block
        columns = self._columns
        assert columns is not None and columns.arrivals is not None and columns.ends is not None  # noqa: S101, PT018
        columns.begin_arrivals()
        self._arrivals = columns.arrivals
        self._ends = columns.ends
        self.drawn = columns.drawn
        self._arrivals.now[games] = arrivals.UNBEGUN
        self._before = [one.copy() for one in self._on_edges]
        self._last = block.start.copy(), block.went.copy(), block.takes_part.copy()
        self.arrival = 0

    @property
    def _on_edges(self) -> tuple[np.ndarray[Any, Any], ...]:
        """The columns that say where agents are, by metres."""
        state = self._state
        return state.node, state.edge, state.share, state.motion

    def select_arriving(self, games: IntArray) -> IntArray:
        """Return the given games in which agents arrive or set out; views then show the time."""
        now = self._arrivals.now
        goes_on = games[now[games] < np.inf]
        self._state.time[goes_on] = now[goes_on]
        return goes_on

    def find_deciding(self, games: IntArray) -> BoolArray:
        """Return a mask of the agents that decide now, (games, agents)."""
        is_before_end = self._arrivals.now[games] < 1.0
        found: BoolArray = (self._arrivals.comes[games] == arrivals.ASKED) & is_before_end[:, None]
        return found

    def find_losers(self, games: IntArray) -> BoolArray:
        """Return a mask of the agents that have lost conflicts now, (games, agents)."""
        found: BoolArray = self._arrivals.loses[games] > 0
        return found

    def list_places(self, game: int) -> tuple[list[int | EdgePlace], list[int | EdgePlace]]:
        """Return the current start and end places of all moves of a game."""
        found = [[self._get_place(row) for row in rows[game].tolist()] for rows in self._ends]
        return found[0], found[1]

    def note_late_deeds(self, games: IntArray, agents: IntArray, *, are_wanted: bool = True) -> None:
        """Record whether agents want to do deeds on arrival, one for each of these games."""
        self._arrivals.late[games, agents] = are_wanted

    def end_arrivals(self, *, is_played: bool) -> None:
        """Put agents back to where the part of the turn began; if it was played, they move at its end."""
        block = self._block
        for column, before in zip(self._on_edges, self._before, strict=True):
            column[:] = before
        if self._last is not None and not is_played:
            block.start[:], block.went[:], block.takes_part[:] = self._last
        if self._columns is not None:
            self._columns.end_arrivals()
        self._arrivals.now.fill(np.inf)
        self._state.time.fill(0.0)
        self._last = None
        self.arrival = None
        self._state.now.clear()

    @property
    def parts_played(self) -> IntArray:
        """The number of parts of the current turn that were played in each game, (games,)."""
        return self._block.part

    def take_moves(self, other: "CoreGames", game: int, pairs: IntArray, new: Sequence[int], part: int | None) -> None:
        """Take the moves of the present or last turn of a game from other columns to those of this only game.

        Args:
            other: plays it in the other columns.
            game: its number there.
            pairs: (2, agents) the numbers of its agents here, and there.
            new: the numbers of agents that the function has created which is called.
            part: the part of the turn in which agents are about to move; None: they are not.
        """
        self._block.take_moves(other._block, game, pairs)
        self._has_come[0, pairs[0]] = other._has_come[game, pairs[1]]
        self._take_courses(other, game, pairs, is_moving=part is not None)
        for agent in new:
            self._put_new(0, agent, int(self._state.node[0, agent]), part)
        if new and part is None and self._block.takes_part.any():
            self.place_newcomers(np.zeros(1, np.int64))

    def _take_courses(self, other: "CoreGames", game: int, pairs: IntArray, *, is_moving: bool) -> None:
        """Take the paths of a game; see `take_moves`."""
        if self.courses is None:
            return
        if other.courses is None:
            block = self._block
            starts, ends = (block.here, block.ends) if is_moving else (block.start, block.went)
            self.courses.take_steps(starts, ends, block.takes_part)
            return
        place = find_places_on_map(self._state, other._state)
        columns, others = self._columns, other._columns
        if columns is not None and others is not None and columns.ends is not None and others.ends is not None:
            for mine, theirs in zip(columns.ends, others.ends, strict=True):
                mine[0, pairs[0]] = place.find_places(theirs[game, pairs[1]])
            columns.drawn[0, pairs[0]] = others.drawn[game, pairs[1]]
        self.courses.take(other.courses, game, pairs, place.find_nodes, place.find_edges)

    @property
    def moves(self) -> tuple[np.ndarray[Any, Any], ...]:
        """The columns of the last moves and parts, the places that agents wanted to reach, and the named edges."""
        block = self._block
        courses = () if self.courses is None else self.courses.list_columns()
        edges = self.edges.rows, self.edges.are_any
        return block.start, block.went, block.takes_part, block.part, block.wanted, block.plan_of, *edges, *courses

    @property
    def courses(self) -> Courses | None:
        """The paths of agents that do not move along one edge per turn, if functions are called; else None."""
        return None if self._columns is None else self._columns.courses

    @property
    def knows_paths(self) -> bool:
        """Whether the last paths of agents are known: they are kept, or follow from the nodes before and after."""
        return self._columns is None or self.courses is not None

    def get_paths(self, games: IntArray) -> Paths | None:
        """Return the paths of the last turns of some games; None: all agents moved along at most one edge, at once."""
        starts, ends, took_part = self.get_moves(games, None)
        if self.courses is not None:
            return self.courses.get_paths(games, starts, took_part)
        return None if self.num_parts == 1 else make_paths_in_parts(starts, ends, self.part_of, self.num_parts)

    def get_wanted_place(self, game: int, agent: int) -> int | EdgePlace:
        """Return the node or edge that an agent stopped by a conflict wanted to reach."""
        return self._get_place(int(self._block.wanted[game, agent]))

    def _get_place(self, row: int) -> int | EdgePlace:
        """Return a node or an edge, as conflicts compare them, by its id."""
        columns = self._state.movement.columns
        beyond = row - len(columns.node_ids)
        return int(columns.node_ids[row]) if beyond < 0 else EdgePlace(int(columns.edge_ids[beyond]))

    def prepare(self, is_given: BoolArray | None, threads: int) -> None:
        """Prepare to play the games that `CoreColumns.until` selects.

        Args:
            is_given: (agents,) a mask of the agents whose actions are in the block, which stays as it is; the others
                decide. None: all decide.
            threads: how many play.
        """
        while len(self._made) < threads:
            self._made.append(self._make_player())
        self._take_roads()
        if is_given is not self._given:
            self._given = is_given
            self._deciding[:] = self._decides_by
            if is_given is not None:
                self._deciding[is_given] = moves.GIVEN
            for movers in self._movers:
                movers.sort_kinds()
        self._made[0][1].refuse_unknown_agents()
        if self._by_steps is not None:
            self._games = self._block.select_followers(self._number, np.flatnonzero(self._block.until > 0))
            self._by_steps.take_memories(self._games)

    def _take_roads(self) -> None:
        """Set the open roads of each game for moves, paths and contacts."""
        roads = self._state.roads
        if (self._tables is not None or roads.differ) and self._tables is not roads.tables:
            self._tables = roads.tables
            self._give_roads(roads, self._tables)

    def _give_roads(self, roads: OpenRoads, tables: RoadTables) -> None:
        """Set the maps of these tables for all threads."""
        self._first_node[:] = tables.first
        if len(self._mode_first):
            self._mode_first[:] = self._state.movement.mode_of * tables.stride
        for weight, search in roads.searches:
            search.take(*roads.join_arcs(tables.maps, weight, reverse=False))
        if self._streets.are_all_legal:
            return
        streets = moves.LegalMoves(flatten(tables.offsets, np.int32), flatten(tables.targets, np.int32))
        for movers in self._movers:
            movers.take(streets)
        if self._by_steps is not None:
            self._by_steps.take_roads(tables)
        if self._columns is not None:
            self._columns.take_roads(tables, streets)

    def get_player(self, thread: int) -> turn.Player:
        """Return what plays the games in a thread."""
        return self._made[thread][0]

    def play_part(self, thread: int, begin: int, end: int, phase: int | None) -> None:
        """Play the games `begin` to `end - 1` that are on this map, in one phase; None: all phases."""
        player = self.get_player(thread)
        if phase is None:
            turn.play_aside(player, begin, end)
        else:
            turn.play_phases_aside(player, phase, begin, end)

    def finish(self) -> None:
        """Copy the memories of agents in the played games to the state of the batch."""
        if self._by_steps is not None:
            self._by_steps.give_memories(self._games)

    @property
    def memory(self) -> IntArray:
        """The present memories of agents, (columns, games, agents)."""
        return np.zeros((0, *self._state.node.shape), np.int64) if self._by_steps is None else self._by_steps.memory

    def get_memories(self, game: int) -> dict[str, dict[str, Any]]:
        """Return what strategies of the core remember in a game, for the agents of the start for which any decides."""
        number_of = self._state.roster.names.index
        found: dict[str, dict[str, Any]] = {
            name: {} for name in self._deciders if self._state.is_there[game, number_of(name)]
        }
        for name, key, value in list_memories(GameRow.from_game(self._state, game), self.steps):
            found.setdefault(name, {})[key] = value
        return found

    @property
    def steps(self) -> list[CoreStep]:
        """The steps of strategies that remember something."""
        return [step for several in self._steps for step in several if step.key]

    def play_rules(self, games: IntArray) -> Iterator[NamedRule]:
        """Apply the rules of some games that have moved; yield each rule function when it is due."""
        if not self.has_functions:
            return
        self._has_come[games] = False  # who came before the moves takes part in the turn
        for part in self._parts:
            if isinstance(part, NamedRule):
                yield part
            else:
                self._play_chain(part, self._block.select_followers(self._number, games))

    def play_rule(self, rule: NamedRule, games: IntArray) -> None:
        """Apply a rule of the core to some games that have moved, without the rules that follow it."""
        assert rule.spec.core_form is not None  # noqa: S101 - it is of the core
        if rule.name not in self._alone:
            self._alone[rule.name] = rules.link_rules([rule.spec.core_form(self._made[0][1])])
        self._play_chain(self._alone[rule.name], games)

    def _play_chain(self, first: rules.Rule, games: IntArray) -> None:
        """Apply a rule of the core, and those that are linked to it, to some games that have moved."""
        self.place_newcomers(games)
        before = self._state.node.copy(), self._state.stops.copy()
        self._block.give()
        self._take_roads()
        rules.play_games(first, flatten(games, np.int64))
        self._block.take_in()
        if self._state.flights is not None:
            self._follow(games, *before)

    def place_newcomers(self, games: IntArray) -> None:
        """Mark living agents that took no part in the turn as placed: they are on their nodes at its end only."""
        state = self._state
        takes_part = (self._block.takes_part[games] > 0) & ~self._has_come[games]
        state.placed[games] |= state.alive[games] & ~takes_part

    def _follow(self, games: IntArray, node: IntArray, stops: IntArray) -> None:
        """Place flying agents that rules of the core have respawned at their starts."""
        state = self._state
        flights = self._state.flights
        assert flights is not None  # noqa: S101 - some fly
        rows = np.ix_(games, state.flyers)
        at, which = np.nonzero((state.stops[rows] != stops[rows]) & state.alive[rows])
        back = games[at], state.flyers[which]
        flights.put_back(flatten(back[0], np.int64), flatten(back[1], np.int64))
        state.previous[back] = node[back]

    def _make_player(self) -> tuple[turn.Player, BatchRules]:
        """Make the data for one more thread."""
        state = self._state
        roster = self._state.roster
        block = self._block
        columns = self._columns
        games = rules.GameColumns(
            len(roster.names),
            len(roster.teams),
            node=get_memory(state.node),
            start=get_memory(block.start),
            previous=get_memory(state.previous),
            alive=get_memory(state.alive),
            placed=get_memory(state.placed),
            stops=get_memory(state.stops),
            home=get_memory(state.start),
            turn=get_memory(state.turn),
            over=block.over.data,
            score=get_memory(block.score),
            team=flatten(roster.team_of, np.int64),
            plays=get_memory(state.plays),
            first_node=self._first_node.data,
            mode_first=self._mode_first.data,
            nobody=roster.nobody,
            **({} if columns is None else columns.on_edges),
        )
        shared = {
            "edges": get_memory(block.edges.rows),
            "ends": get_memory(block.ends),
            "went": get_memory(block.went),
            "takes_part": get_memory(block.takes_part),
            "counts": self._counts,
            "moves": get_memory(state.counts["moves"]),
            "blocks": get_memory(state.counts["blocked"]),
            "blocked": get_memory(state.blocked),
            "wanted": get_memory(block.wanted),
            "held": get_memory(block.held),
            "part_of": flatten(self.part_of, np.int64),
            "part": block.part.data,
            "parts": self.num_parts,
        }
        walks = draws.RandomChoices(flatten(state.draw_keys(), np.uint64), shared["counts"], shared["ends"])
        given = get_memory(block.given)
        contests, requests = self._make_contests()
        if self._by_steps is None and any(self._steps):
            self._by_steps = StrategySteps(state, self._steps, StepPaths(state))
        by_steps = None if self._by_steps is None else self._by_steps.get_strategies(games, len(self._made))
        routes = None if self.courses is None else self.courses.routes.core
        of_movers = {**shared, "by_steps": by_steps, "routes": routes}
        args = self._streets, self._deciding.data, walks, given, contests, requests
        events = block.get_events(len(self._made))
        if columns is None:
            movers = moves.OneEdgeMovers(*args, **of_movers)
            travel = None if self.num_parts == 1 else make_thread_in_parts(movers, len(roster.names))
        else:
            travel = columns.get_thread(args, of_movers, events)
            movers = travel.movers
        self._movers.append(movers)
        self.deciders = games, movers
        making = BatchRules(state, games, events, travel, block.rules, len(self._made))
        parts = self._make_rules(making)
        first = None
        if self.has_functions:
            self._parts = parts
        elif parts:
            (first,) = parts
        if self._tables is not None:
            self._give_roads(state.roads, self._tables)
        at_arrivals = None if travel is None else travel.arrivals
        which = block.until.data, get_memory(block.plan_of), self._number, state.stop.data
        return turn.Player(games, movers, at_arrivals, first, *which, self.past.get_core_places(state)), making

    def _make_rules(self, making: RuleBuilder) -> list[Any]:
        """Return the rule functions, and between them the first rule of each chain of core rules."""
        parts: list[Any] = []
        for are_functions, several in groupby(self._rules, is_function):
            if are_functions:
                parts += several
            else:
                made = []
                for one in several:
                    assert one.spec.core_form is not None  # noqa: S101 - it is no function
                    made.append(one.spec.core_form(making))
                    self.numbers[one.name] = len(making.rules)
                parts.append(rules.link_rules(made))
        return parts

    def _make_columns(self, before: TravelColumns | None) -> TravelColumns | None:
        """Return the shared columns of games whose agents do not move along one edge per turn; see `begin`."""
        if not self._state.movement.depends_on_speeds:
            return None
        return TravelColumns(
            self._state,
            self.part_of,
            go_by_steps=any(self._steps),
            keeps_courses=self._keeps_courses or self.num_parts > 1,
            has_conflicts=self._has_conflicts,
            before=before,
        )

    def _make_contests(self) -> tuple[conflicts.Contests | None, conflicts.MoveRequests | None]:
        """Return the contests that find the losers of conflicts; None: there are no conflicts."""
        if self._conflicts is None:
            return None, None
        state = self._state
        roster = self._state.roster
        columns = self._columns
        graph = state.movement.columns
        limits = self._conflicts.limits(graph, has_edges=state.movement.by_metres)
        teams = [roster.teams[team] for team in roster.team_of.tolist()]
        num_nodes = len(graph.node_ids)
        table = ConflictTable(self._conflicts, roster.names, teams, roster.flies, limits, num_nodes, make_tables)
        ranks = state.draw_keys(table.purpose) if table.ranks is None else table.ranks
        ends = (columns and columns.ends) or (state.node, self._block.ends)
        where = get_memory(ends[0]), get_memory(ends[1]), get_memory(self._block.takes_part)
        return table.contests, table.make_requests(*where, ranks)
