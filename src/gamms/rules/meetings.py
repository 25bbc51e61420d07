"""One game in the core: the columns of its agents in a turn, the contacts between them, and its shipped rules.

`get_contacts` returns the columns and finds contacts; `get_rule` returns a rule, which the core plays.
"""

from array import array
from collections.abc import Callable, Collection, Hashable, Iterable, Mapping, Sequence
from functools import cache, lru_cache
from itertools import chain
from math import nan
from typing import Annotated, Any, cast

import numpy as np

from gamms import kernels
from gamms.context import Context
from gamms.core import contacts as core
from gamms.core import rules
from gamms.core.agents import NodeNumbers
from gamms.core.rules import Flags, Tagging
from gamms.core.turn import GamePlayer, MovesForRules, RuleMoves, RuleOfGame
from gamms.deciding import get_phase
from gamms.errors import IllegalMutation, UnknownName
from gamms.game.block.columns import AgentTable
from gamms.game.block.in_core import (
    SCORING,
    ContactOptions,
    ContactSearch,
    Ground,
    Near,
    NumberArray,
    RuleBuilder,
    make_motion_intervals,
)
from gamms.game.block.state import NAMED, Arrays, Purpose
from gamms.game.deeds import list_lasting
from gamms.game.movement.moves import TurnMoves
from gamms.game.movement.travel import GamePaths, ReachableNodes, RoadIds
from gamms.game.order import TurnOrder
from gamms.game.roles import Role, has_attributes
from gamms.game.turn import TurnEngine
from gamms.graph import Graph
from gamms.ir.agents import AgentBlock, Position
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.kernels.draws import BitArray
from gamms.typing import AgentType, IAgent
from gamms.typing.game import TEAMS, Leg, Track
from gamms.typing.graph_values import OSMEdge
from gamms.typing.on_edges import Line, LineColumns, find_point_along

_MOST_DISTANCES = 8  # contact distances whose near nodes are cached per game
_MOST_RULES = 32  # rules that are kept per game
_MORE_AGENTS = 8  # for which columns have room at least
_CALL = rules.KINDS.index("call")
_NOWHERE = 0.0, 0.0, 0.0
UNKNOWN_PLACE = 4  # a flag of legs, see `core.Legs`


Side = Annotated[Hashable | Mapping[str, object] | Callable[[IAgent], object], TEAMS]
"""A team, a role, or a function of an agent."""
Form = Callable[[RuleBuilder], object]  # returns a `Rule` of the core, or a `Tagging` for contacts alone


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


def make_buffer(kind: str, values: Iterable[float] = ()) -> Any:  # Any: memoryviews are not subscriptable
    """Return numbers as a buffer: "q" and "Q" for signed and unsigned integers, "d" for floats."""
    return memoryview(array(kind, values))


def _make_zeros(kind: str, number: int) -> Any:  # Any: memoryviews are not subscriptable
    """Return a buffer of zeros; see `make_buffer`."""
    return make_buffer(kind, bytes(8 * number))


_NO_INTS = make_buffer("q")
_NO_FLOATS = make_buffer("d")
_NO_REACH = core.NearNodes(make_buffer("q", [0]), make_buffer("q"), make_buffer("d"), 0.0, ReachableNodes(0).core)
_NO_PLACES = core.NodePositions(make_buffer("q"), make_buffer("d"))
_NO_LINES = core.PathSegments(0, core.Polylines(), make_buffer("d"))
_ON_NODES = core.SEARCHES["on nodes"]


# -- in the game of a context ------------------------------------------------------------------------------------------


class Roster:
    """All agents of a game, dead or alive, ordered by name, and their columns, with room for more agents.

    Rules read nodes and lives in the block, so the columns of the roster, too, are by the row of an agent there.

    Args:
        block: the agents.
        gone: the teams of deleted agents.
        get_agent: returns the agent of a name.

    Attributes:
        room: the number of agents for which the columns have room.
        names, teams: the names and teams of the agents.
        number: name -> number of the agent.
        rows: (agents,) the row of each agent in the block; another array when agents have come or left.
        flies: (agents,) whether each agent flies.
        table: these agents in the form of a batch.
        games: the columns of agents, for one game; `bind` them before they are read.
        turn: (1,) the number of turns played.
        placed: (room,) whether each agent was relocated after its move, in `games`.
        stops, no_stops: (room,) how often the rule that is played has stopped the agents, and zeros.
        home: (room,) the start nodes of agents, as far as rules read them.
    """

    flies: BoolArray
    table: AgentTable

    def __init__(self, block: AgentBlock, gone: Collection[Hashable], get_agent: Callable[[str], IAgent]) -> None:
        agents = len(block) - len(block.removed)
        self._get_agent = get_agent
        self.room = agents + agents // 8 + _MORE_AGENTS
        self.names: list[str] = []
        self.teams: list[Hashable] = []
        self.number: dict[str, int] = {}
        self.rows = np.zeros(0, np.int64)
        self._keys: BitArray = np.zeros(0, np.uint64)  # the hashes of the names
        start, stops, home, team = np.zeros((4, self.room), np.int64)
        self._team = team
        self.stops: Any = stops.data
        self.no_stops: Any = stops.copy().data
        self.home: Any = home.data
        self.turn = make_buffer("q", [0])
        self.placed: Any = memoryview(bytearray(self.room))
        rows, names, teams = _sort_by_name(block)
        self._all_teams = tuple(dict.fromkeys([*teams, *gone]))
        self._score = make_buffer("d", [0.0] * len(self._all_teams))
        self.games = rules.GameColumns(
            agents,
            len(self._all_teams),
            node=_NO_INTS,
            start=start.data,
            previous=_NO_INTS,
            alive=memoryview(bytearray()),
            placed=self.placed,
            stops=self.stops,
            home=self.home,
            turn=self.turn,
            over=memoryview(bytearray(1)),
            score=self._score,
            team=team.data,
            plays=memoryview(bytes([1]) * len(self._all_teams)),
            first_node=make_buffer("q", [0]),
            nobody=self._all_teams.index(None) if None in self._all_teams else -1,
            applies_effects=False,
        )
        self._take(block, rows, names, teams)

    def follow(self, block: AgentBlock, gone: Collection[Hashable]) -> bool:
        """Take the present agents of a block; return False if they have other teams, or there is no room for them."""
        rows, names, teams = _sort_by_name(block)
        if len(rows) > self.room or {*self._all_teams} != {*teams, *gone}:
            return False
        self._take(block, rows, names, teams)
        return True

    def _take(self, block: AgentBlock, rows: list[int], names: list[str], teams: list[Hashable]) -> None:
        """Take agents, given by their rows, names and teams in the order of names."""
        agents = len(rows)
        known = dict(zip(self.names, self._keys.tolist(), strict=True))
        new = [name for name in names if name not in known]
        known.update(zip(new, kernels.compute_name_keys(new).tolist(), strict=True))
        self._keys = np.fromiter(map(known.__getitem__, names), np.uint64, agents)
        self.rows = np.array(rows, np.int64)
        self.names = names
        self.teams = teams
        self.number = {name: i for i, name in enumerate(names)}
        self.flies = np.asarray(block.kind)[self.rows] != 0
        number = {team: i for i, team in enumerate(self._all_teams)}
        team_of = self._team[:agents]
        team_of[:] = [number[team] for team in teams]
        everyone = np.ones(agents, np.bool_)
        by_number = _AgentsByNumber(names, self._get_agent)
        masks = everyone, everyone, self.flies
        self.table = AgentTable(tuple(names), self._all_teams, team_of, self._keys, by_number, *masks)
        self.games.agents = agents
        self.games.order = self.rows.data

    def bind(self, block: AgentBlock) -> None:
        """Let rules read the memory that the block uses now."""
        self.games.bind(block.node, block.previous, block.alive.cast("B"))

    def take_scores(self, scores: Mapping[Any, float]) -> None:
        """Take the scores of the teams."""
        for number, team in enumerate(self._all_teams):
            self._score[number] = scores[team]

    def take_starts(self, ctx: Context, numbers: NodeNumbers, agents: Sequence[int]) -> None:
        """Take the start nodes of agents on the ground."""
        for agent in agents:
            self.home[self.rows[agent]] = numbers.number(cast("int", ctx.game.start_node(self.names[agent])))

    def find_members(self, ctx: Context, side: Side, takes_part: BoolArray) -> BoolArray:
        """Return which of the agents that take part are on a side, (agents,)."""
        if not callable(side):
            return self.table.find_players([side]) & takes_part
        found = np.zeros(len(self.names), np.bool_)
        for agent in ctx.game.agents:
            number = self.number[agent.name]
            found[number] = takes_part[number] and bool(side(agent))
        return found


class _AgentsByNumber(Sequence[Any]):
    """Agents by their numbers, each made when it is read."""

    def __init__(self, names: Sequence[str], get_agent: Callable[[str], IAgent]) -> None:
        self._names = names
        self._get_agent = get_agent

    def __len__(self) -> int:
        return len(self._names)

    def __getitem__(self, number: int) -> IAgent:  # type: ignore[override] # slices are not needed
        return self._get_agent(self._names[number])


def _sort_by_name(block: AgentBlock) -> tuple[list[int], list[str], list[Hashable]]:
    """Return the rows, the names and the teams of the agents of a block, in the order of names."""
    removed = {*block.removed}
    rows = sorted((row for row in range(len(block)) if row not in removed), key=block.names.__getitem__)
    return rows, [block.names[row] for row in rows], [block.teams[row] for row in rows]


class GameRules(RuleBuilder):
    """The data from which the shipped rules of one game are built, and these rules.

    Args:
        turn: the columns of the agents.
        pieces: working memory.

    Attributes:
        most_numbers: the number of nodes for which tables of the rules have room.
        kept: key -> rule; see `get_rule`.
    """

    def __init__(self, turn: "TurnContacts", pieces: core.MotionIntervals) -> None:
        self.turn = turn
        self.room = turn.roster.room
        self.games = turn.roster.games
        self.events = rules.Events(16)
        self.steps = turn.steps
        self.columns = turn.columns
        self.most = turn.most
        self.legs = turn.legs
        self.by_metres = turn.by_metres
        self.pieces = pieces
        self.rules = []
        self.most_numbers = turn.game.keys
        self.kept: dict[Hashable, GameRule] = {}
        self._making: GameRule | None = None
        self._purposes: list[tuple[tuple[Purpose, ...], Any]] = []
        self._owners: dict[int, tuple[Any, Any, list[Role]]] = {}  # id of a territory -> it, the owners, the roles

    @property
    def roster(self) -> AgentTable:
        """The present agents."""
        return self.turn.roster.table

    def make(self, form: Form, key: Hashable) -> "GameRule":
        """Make the rule of a form, and keep it; `key`: see `get_rule`."""
        if len(self.kept) == _MOST_RULES:
            self.kept.clear()
        known = GameRule(self, form)
        self._making = known
        known.rule = form(self)
        if key is not None:
            self.kept[key] = known
        return known

    def follow_agents(self) -> None:
        """Take agents that have come or left, in all rules that are kept."""
        for known in self.kept.values():
            known.read = None
            for function in known.on_changed_agents:
                function()

    def list_by_agent(
        self,
        values: Callable[[], NumberArray],
        kind: type[np.generic] = np.int64,
        *,
        absent: int = 0,
        width: int = 1,
        members: Iterable[Hashable] = (),
    ) -> Any:
        """Return an array (room * width,) of values that depend on the agents, kept up to date; see `follow_agents`."""
        found = np.zeros(self.room * width, kind)

        def take() -> None:
            present = values()
            found[: len(present)] = present
            found[len(present) :] = absent

        self._call_on_changed_agents(take)
        if has_attributes(members):
            self._call_in_each_turn(lambda _: take())
        return found.data

    def _call_on_changed_agents(self, function: Callable[[], None]) -> None:
        """Call a function now, and whenever agents have come or left."""
        assert self._making is not None  # noqa: S101 - a rule is made
        self._making.on_changed_agents.append(function)
        function()

    def make_tracks(self, sides: memoryview, *, at_end: bool) -> core.Tracks:
        """Return the tracks of the agents, with these sides."""
        found = super().make_tracks(sides, at_end=at_end)
        self._call_on_changed_agents(lambda: setattr(found, "agents", len(self.roster.names)))
        return found

    def draw_by(self, seed: int) -> None:
        """Use the random draws of another seed."""
        for several, keys in self._purposes:
            for place, purpose in enumerate(several):
                keys[place] = kernels.compute_purpose_key(seed, *purpose)

    @property
    def num_nodes(self) -> int:
        """The number of nodes in tables by node, with room for nodes that are numbered later."""
        count = 2 * self.turn.numbers.count
        self.most_numbers = min(self.most_numbers, count)
        return count

    def find_rows(self, nodes: Sequence[int]) -> IntArray:
        """Return the numbers of nodes, given their ids."""
        return np.array([*map(self.turn.numbers.number, nodes)], np.int64)

    def keep(self, key: Hashable, make: Callable[[int], Arrays]) -> Arrays:  # noqa: ARG002 - as for batches
        """Return new memory of a rule, which takes it from `ctx.game.data` in each turn."""
        assert self._making is not None  # noqa: S101 - a rule is made
        self._making.kept = make(1)
        return self._making.kept

    def make_keys(self, *several: Purpose) -> Any:
        """Return the keys of draws for several purposes, (purposes,)."""
        keys = make_buffer("Q", [kernels.compute_purpose_key(self.turn.seed, *purpose) for purpose in several])
        self._purposes.append((several, keys))
        return keys

    def mark_sides(self, ours: Side, theirs: Side, *, air: bool) -> Any:
        """Return the sides of agents, (agents,); functions are called in each turn."""
        if not (callable(ours) or callable(theirs)):
            return super().mark_sides(ours, theirs, air=air)
        roster = self.turn.roster
        game = self.turn.game
        found = np.zeros(self.room, np.int64)

        def call(ctx: Context) -> None:
            is_alive = np.asarray(game.block.alive)[roster.rows]
            takes_part = is_alive if air else is_alive & ~roster.flies
            of_agents = found[: len(takes_part)]
            of_agents[:] = roster.find_members(ctx, ours, takes_part)
            of_agents += 2 * roster.find_members(ctx, theirs, takes_part)
            if game.bound is not game.block.node:
                raise IllegalMutation(
                    "A function that says which agents are on a side has created or deleted agents, or set a new team. "
                    "Such changes belong in a rule of their own: ctx.game.add(rule)."
                )

        self._call_in_each_turn(call)
        return found.data

    def make_territory(self, ground: Ground | None) -> rules.Territory:
        """Return the owners of nodes; empty without a territory (None)."""
        if ground is None:
            return rules.Territory(make_buffer("q"), make_buffer("q"), 0)
        facts = self.turn.game.state.facts
        territory = ground.get_owners(facts)
        known = self._owners.get(id(territory))
        if known is None:
            nodes, numbers, roles = ground.number_owners(facts, self.roster.teams)
            rows = self.find_rows(nodes)
            owners = np.full(self.num_nodes, -1)
            owners[rows] = numbers
            known = territory, owners.data, roles
            self._owners[id(territory)] = known
        return rules.Territory(known[1], self.find_holders(known[2]), self.room)

    def make_near(self, nearness: ContactOptions) -> Near:
        """Return the distances between agents that count as contacts; `follow_places` sets straight lines."""
        unit, limit, *_ = nearness
        if unit is None:
            return None
        if unit == "euclid":
            return (
                core.PathSegments(self.room, self.turn.game.lines, make_buffer("d")) if self.by_metres else _NO_PLACES
            )
        count = self.turn.game.number_all()
        self.most_numbers = min(self.most_numbers, count)
        return self.turn.game.near(unit, limit, count)

    def read_starts(self, agents: Callable[[], BoolArray]) -> None:
        """Take the start nodes of some agents, (agents,), in each turn."""
        turn = self.turn
        numbers: list[int] = []

        def choose() -> None:
            numbers[:] = np.flatnonzero(agents()).tolist()

        self._call_on_changed_agents(choose)
        self._call_in_each_turn(lambda ctx: turn.roster.take_starts(ctx, turn.numbers, numbers))

    def read_scores(self) -> None:
        """Take the scores of the teams in each turn."""
        self._call_in_each_turn(lambda ctx: self.turn.roster.take_scores(ctx.game.scores))

    def follow(self, rule: Flags | Tagging, ground: Ground | None) -> None:
        """Keep the owners of nodes in a rule up to date, if the territory is a fact, or owners are roles."""
        if ground is not None and (isinstance(ground.given, str) or ground.roles):
            self._call_in_each_turn(lambda _: setattr(rule, "ground", self.make_territory(ground)))

    def follow_places(
        self, tagging: Tagging, nearness: ContactOptions, near: Near, sides: tuple[Any, Any], search: ContactSearch
    ) -> None:
        """Set the positions of agents in a tagging in each turn."""
        turn = self.turn

        def find(ctx: Context) -> None:
            if isinstance(near, core.PathSegments):
                turn.give_places(ctx, near, nearness)
                return
            rules.fill_steps(self.steps, self.games, 0)
            rules.fill_sides(self.games, 0, *sides)
            search(turn.find_near(ctx, sides[1], nearness), tagging.contacts)

        self._call_in_each_turn(find)

    def _call_in_each_turn(self, function: Callable[[Context], object]) -> None:
        assert self._making is not None  # noqa: S101 - a rule is made
        self._making.in_each_turn.append(function)


class GameRule(RuleOfGame):
    """A shipped rule in one game.

    Args:
        makes: the data from which it is built.
        form: builds it.

    Attributes:
        kept: its memory: name -> array (1, …); the caller fills it before each turn.
        carriers: the names of agents that carried a flag and were deleted, by the number of the flag.
        read: the state of the rule that `kept` holds.
        on_changed_agents: functions that are called when agents have come or left.
    """

    def __init__(self, makes: GameRules, form: Form) -> None:
        super().__init__(makes.events)
        self.makes = makes
        self.form = form  # its id must not be used again
        self.kept: Arrays = {}
        self.carriers: Sequence[Any] = ()
        self.read: object = None
        self.on_changed_agents: list[Callable[[], None]] = []

    def tell(self, ctx: Context) -> list[tuple[str, str, int]]:
        """Do in the context what the core has done; return the kind, the agent and the flag of each event."""
        turn = self.makes.turn
        turn.game.forget()
        turn.roster.stops[:] = turn.roster.no_stops
        return self._tell(ctx, self.makes.events.take_all())

    def _tell(self, ctx: Context, events: list[tuple[int, int, int, int, int, float]]) -> list[tuple[str, str, int]]:
        """Do in the context what the core has done."""
        game = ctx.game
        graph = ctx.graph.graph
        block = ctx.agent.block
        internals = game.internals
        state = internals.state
        turn = state.turn + game.is_moving
        ids = self.makes.turn.numbers.ids
        roster = self.makes.turn.roster
        names = roster.names
        flies = roster.flies  # functions that are called may change the agents of the roster
        agent_of = ctx.agent.get_agent
        calls = [event for event in events if event[0] == _CALL]
        pairs = iter([(agent_of(names[agent]), agent_of(names[other])) for _, _, agent, other, *_ in calls])
        told = []
        reached: list[Hashable] = []
        for number, rule, agent, other, node, time in events:
            kind = rules.KINDS[number]
            played = self.makes.rules[rule]
            if kind == "respawned":
                one = agent_of(names[agent])
                home: Any = internals.find_start(one)
                if flies[agent] or not graph.has_node(home):
                    game.respawn(one)
                else:  # NOTE: as `respawn` does, but without its checks (benchmarks: peers)
                    block.put_back(block.find_row(names[agent]), home)
                    state.events.append({"turn": turn, "kind": kind, "agent": names[agent], "node": home})
            elif kind == "eliminated":
                game.eliminate(names[agent])
            elif kind == "call":
                played.then(ctx, *next(pairs))  # type: ignore[misc] # it has a function
            elif kind == "end":
                game.end(**played.end(agent, reached, roster.table.teams))
            else:
                name = names[agent] if agent >= 0 else self.carriers[other]
                event = {"turn": turn, "kind": kind, "agent": name}
                if kind in NAMED:
                    event[NAMED[kind]] = names[other] if kind == "tag" else played.flags[other]
                state.events.append(_add_time({**event, "node": ids[node]}, turn - 1 + time, game.deeds))
                told.append((kind, name, other))
                if kind in SCORING:
                    team = roster.teams[agent]
                    is_again = kind == "reach" and team in reached  # a team scores once
                    reached.append(team)
                    if played.points is not None and not is_again:
                        state.scores[team] += played.points
        return told


def _add_time(event: dict[str, Any], time: float, deeds: Mapping[str, Any]) -> dict[str, Any]:
    """Return an event; with its time, if it is a tag in a game with deeds that last."""
    if event["kind"] == "tag" and deeds and list_lasting(deeds):
        event["time"] = time
    return event


class TurnContacts(RuleMoves):
    """The paths of the agents of one game in a turn, contacts between them, and the rules that the core plays.

    Args:
        game: cached data of the game and its map.
        roster: the agents.
        are_steps: whether every agent moves along at most one edge.

    Attributes:
        game, roster, are_steps: see the arguments.
        by_metres: whether positions are in metres along edges.
        most, columns: capacity and columns of tracks, for `core.Tracks`: nodes, times and lengths.
        steps: the paths in these columns.
        most_legs, legs: capacity and columns of legs, for `core.Tracks`.
        seed: the present seed; see `draw_by`.
        purpose: purpose key of the draws.
    """

    game: "GameContacts"

    def __init__(self, game: "GameContacts", roster: Roster, *, are_steps: bool) -> None:
        super().__init__(game, roster.games, make_buffer("q"))
        self.roster = roster
        self.are_steps = are_steps
        self.by_metres: bool = not are_steps and game.by_metres
        self.purpose = make_buffer("Q", [0])
        self.seed: int | None = None
        self._where: dict[int, Track | int] = {}  # the track of each living agent, or its slot in `_moves`
        self._slot_of: dict[int, Track | int] = {}  # agent -> its slot
        self._taken: tuple[list[str], bytes] | None = None  # the agents of `_slot_of`, and which took part
        self._slots_and_agents = make_buffer("q"), make_buffer("q")  # of `_slot_of`
        self._moves: TurnMoves | None = None
        self._make_room(2, 0)

    def _make_room(self, most: int, most_legs: int) -> None:
        """Make columns with room for `most` nodes and `most_legs` legs of each agent."""
        size = self.roster.room
        self.most = 0  # if Ctrl-C comes in between, they are made again
        self.most_legs = most_legs
        self.columns = _make_zeros("q", size * most), _make_zeros("d", size * most), _make_zeros("q", size)
        self.steps = (rules.AgentPaths if self.are_steps else rules.GivenPaths)(*self.columns)
        self._counts = _make_zeros("q", size)
        self._no_legs = _make_zeros("q", size)
        self._one_node = make_buffer("q", [1] * size)
        self._of_all = core.Tracks(size, most, *self.columns, self.columns[2], at_end=False)
        numbers = [_make_zeros("q", size * most_legs) if most_legs else _NO_INTS for _ in range(5)]
        self._edges = numbers[2]
        self._flags = numbers[-1]
        shares = [_make_zeros("d", size * most_legs) if most_legs else _NO_FLOATS for _ in range(5)]
        self.legs = core.Legs(most_legs, self._counts, *numbers, *shares)
        self.rules = None
        self.most = most

    def draw_by(self, ctx: Context, seeds: int) -> None:
        """Use the random draws of the present seed, which has changed `seeds` times."""
        self.seeds = seeds
        self.seed = ctx.seed
        self.purpose[0] = kernels.compute_purpose_key(ctx.seed, "contacts")
        if self.rules is not None:
            self.rules.draw_by(ctx.seed)

    def renew_rules(self) -> None:
        """Make the rules again, with more room."""
        self.rules = GameRules(self, self.make_scratch())

    def follow_agents(self) -> None:
        """Take agents that have come or left."""
        self.order = None
        self._taken = None
        if self.rules is not None:
            self.rules.follow_agents()

    def find_slots(self, order: TurnOrder, block: AgentBlock) -> Any:
        """Return the slot of each agent in an order, (agents,); -1: it has none."""
        rows, slots = order.in_rules
        if rows is not self.roster.rows:
            of_rows = np.full(len(block), -1)
            of_rows[order.selection.array] = np.arange(len(order.slots))
            slots = of_rows[self.roster.rows].data
            order.in_rules = self.roster.rows, slots
        return slots

    def note_placed(self, block: AgentBlock) -> None:
        """Note the agents that were relocated after their moves."""
        for row in block.placed:
            self.roster.placed[row] = 1

    def follow(self, ctx: Context) -> None:
        """Take the tracks of agents that may have moved along several edges, or parts of edges."""
        moves: TurnMoves | None = self.game.state.moves
        block = ctx.agent.block
        paths = None if moves is None else moves.paths
        self._moves = moves
        if moves is not None and moves.are_latest(block):
            self._where = self._find_latest_slots(moves)
        else:
            self._where = {self.roster.number[agent.name]: _find_slot(moves, agent) for agent in ctx.game.agents}
        tracks: dict[int, Track] = {}
        if self._where is not self._slot_of:
            tracks = {agent: where for agent, where in self._where.items() if isinstance(where, Track)}
        most_legs, most = (0, 2) if paths is None else paths.most
        most = max([2, most, *[len(track.path) for track in tracks.values()]])
        if most > self.most or most_legs > self.most_legs:
            self._make_room(max(most, self.most), max(most_legs, self.most_legs))
        self._counts[:] = self._no_legs
        self.columns[2][:] = self._one_node
        for agent, track in tracks.items():
            self._put_track(agent, track)
        if paths is None or len(tracks) == len(self._where):
            return
        if self._where is self._slot_of:
            slots, agents = self._slots_and_agents
            self._put_paths(paths, paths.maps[slots[0]], slots, agents)
            return
        by_roads: dict[RoadIds, tuple[list[int], list[int]]] = {}
        for agent, i in self._where.items():
            if not isinstance(i, Track):
                slots, agents = by_roads.setdefault(cast("RoadIds", paths.maps[i]), ([], []))
                slots.append(i)
                agents.append(agent)
        for roads, (slots, agents) in by_roads.items():
            self._put_paths(paths, roads, make_buffer("q", slots), make_buffer("q", agents))

    def _find_latest_slots(self, moves: TurnMoves) -> dict[int, Track | int]:
        """Return the slot or the track of each agent, for moves that are the latest."""
        names = moves.order.names
        if (names, moves.took_part) != self._taken:
            number = self.roster.number
            self._slot_of = {number[names[i]]: i for i in moves.select_taking_part(range(len(names)))}
            self._slots_and_agents = (
                make_buffer("q", moves.select_taking_part(range(len(names)))),
                make_buffer("q", self._slot_of),
            )
            self._taken = names, moves.took_part
        maps = moves.paths.maps
        slots, _ = self._slots_and_agents
        if len(slots) and moves.paths.is_on_roads(slots[0]) and maps.count(maps[slots[0]]) == len(slots):
            return self._slot_of
        return {agent: _find_path(moves, i) for i, agent in zip(*self._slots_and_agents, strict=True)}

    def _put_paths(self, paths: GamePaths, roads: Any, slots: memoryview, agents: memoryview) -> None:
        """Write the paths by metres of agents along these roads."""
        to = self.numbers, self.game.edge_numbers, self._of_all, self.legs
        core.put_paths(paths.core, slots, roads.map, roads.edges, *to, agents)
        if roads.revision != self.game.revision:
            for i, agent in zip(slots, agents, strict=True):
                self._mark_removed(agent, paths.list_legs(i))

    def _put_track(self, agent: int, track: Track) -> None:
        """Write a track along no edges."""
        nodes, times, lengths = self.columns
        path, at, _ = track
        first = agent * self.most
        more = self.most - len(path)
        nodes[first : first + self.most] = make_buffer("q", map(self.numbers.number, path + path[-1:] * more))
        times[first : first + self.most] = make_buffer("d", at + (1.0,) * more)
        lengths[agent] = len(path)

    def _mark_removed(self, agent: int, legs: Sequence[Leg]) -> None:
        """Mark legs on edges that were removed since."""
        for place, leg in enumerate(legs):
            if self.game.edges.get_length(leg) is None:
                self._flags[agent * self.most_legs + place] |= UNKNOWN_PLACE

    def get_track(self, agent: int) -> Track:
        """Return the track of an agent, by its number."""
        where = self._where[agent]
        return where if isinstance(where, Track) else cast("TurnMoves", self._moves).get_track(where)

    def make_scratch(self) -> core.MotionIntervals:
        """Return buffers large enough for the moves of these agents."""
        entries = 2 * self.roster.room * (self.most + 2 * self.most_legs + 1)  # of visits and legs, each with two ends
        return self.game.make_scratch(entries, max(self.numbers.count, self.game.edge_numbers.count))

    def find_xy(self, agent: int, time: float, node: int, nearness: ContactOptions, at: Position | None) -> Any:
        """Return the map position (x, y) of an agent in a contact of a game by metres."""
        track = self.get_track(agent)
        # If agents pass each other at the end of a turn counted in edges, the way they came decides.
        return self.game.edges.find_xy(track if nearness.passing else cut_to_end(track), time, node, at)

    def find_near(self, ctx: Context, sides: memoryview, nearness: ContactOptions) -> Near:
        """Return the positions of agents on a side, in a game that counts edges."""
        flying = list_in_air(ctx, nearness)
        ids = self.numbers.ids
        nodes = self.columns[0]
        xyz = []
        for agent, (side, name) in enumerate(zip(sides, self.roster.names, strict=False)):  # there is room for more
            at = flying.get(name)
            path = nodes[self.most * agent : self.most * (agent + 1)] if side and at is None else ()
            xyz += [self.game.place(ids[node]) for node in path] or [at or _NOWHERE] * self.most
        return core.NodePositions(make_buffer("q", range(len(xyz))), make_buffer("d", chain.from_iterable(xyz)))

    def give_places(self, ctx: Context, segments: core.PathSegments, nearness: ContactOptions) -> None:
        """Set the positions of nodes, of edges that agents move along, and of agents in the air."""
        flying = list_in_air(ctx, nearness)
        on_ground = nan, nan, nan
        places = [flying.get(name, on_ground) for name in self.roster.names] if flying else []
        segments.flights = make_buffer("d", chain.from_iterable(places))
        segments.places = self.game.list_places()
        has_leg = np.arange(self.most_legs) < np.asarray(self._counts)[:, None]
        self.game.add_lines(np.asarray(self._edges).reshape(has_leg.shape)[has_leg])


def _find_slot(moves: TurnMoves | None, agent: IAgent) -> Track | int:
    """Return the slot of an agent that has a path in `moves`; its track otherwise."""
    i = None if moves is None else moves.find_slot(agent)
    if moves is None or i is None:
        return Track((agent.current_node_id,), (1.0,))
    return _find_path(moves, i)


def _find_path(moves: TurnMoves, i: int) -> Track | int:
    """Return a slot that has a path by metres; else the track of its agent."""
    return i if moves.paths is not None and moves.paths.is_on_roads(i) else moves.get_track(i)


def list_in_air(ctx: Context, nearness: ContactOptions) -> dict[str, Position]:
    """Return agent -> position of flying agents, for straight-line distances."""
    if nearness.unit != "euclid" or not (nearness.air and ctx.agent.block.flyers):
        return {}
    return {agent.name: agent.position for agent in ctx.game.agents if agent.type is AgentType.AERIAL}


def search_for(near: Near, nearness: ContactOptions, *, by_metres: bool) -> int:
    """Return the code of the search method of the core."""
    if near is None:
        return _ON_NODES
    if isinstance(near, core.NearNodes):
        return core.SEARCHES["on ways" if by_metres and nearness.unit == "metres" else "by paths"]
    return core.SEARCHES["near places" if isinstance(near, core.NodePositions) else "on lines"]


class GameContacts(MovesForRules):
    """Cached data about contacts in one game: its map, the last turn, and buffers.

    The buffers are as large as the largest turn so far has needed.

    Args:
        ctx: the context with the present map.

    Attributes:
        edges: edges that agents have moved along.
        graph: the map.
        by_metres: whether positions are in metres along edges.
        place: node id -> position of the node on the ground.
        lines: the polylines of edges, by their numbers; see `add_lines`.
        near: unit and limit of a `ContactOptions` -> nodes near each node.
    """

    block: AgentBlock
    pieces: core.MotionIntervals
    turns: TurnEngine

    def __init__(self, ctx: Context) -> None:
        self.edges = TraveledEdges(ctx)
        graph = self.edges.graph
        parts = ctx.game.internals.parts
        revised = getattr(graph, "revised", graph)
        block = ctx.agent.block
        super().__init__(get_phase(ctx), parts.state, parts.turns, block.numbers, revised, graph.revision)
        self.pieces = make_motion_intervals(0, 0)
        self._most = 0
        self.graph = graph
        self._changes = _count_changes(ctx)
        self.place = cache(self._locate_node)
        self.lines = core.Polylines()
        self._known_lines = LineColumns.from_lines(())
        self._places: FloatArray = np.zeros((0, 2))  # see `list_places`
        self._ctx = ctx
        self._costs: dict[str, RoadCosts] = {}  # by unit
        self.near = lru_cache(_MOST_DISTANCES)(self._make_near_search)
        self._columns: Any = None  # columns of the map, whose nodes have these numbers
        self._numbers = np.zeros(0, np.int64)
        self.by_metres = ctx.game.speed_unit != "edges"
        self.edge_numbers = block.edge_numbers if self.by_metres else NodeNumbers()
        self._agents: tuple[AgentBlock, int] | None = None  # the block of the agents, and the version of their set
        self._roster: Roster | None = None

    def make_scratch(self, pieces: int, keys: int) -> core.MotionIntervals:
        """Return buffers with room for this many pieces and keys."""
        if pieces > self._most or keys > self.keys:
            self.pieces = make_motion_intervals(2 * pieces, 2 * keys)  # first: Ctrl-C may come in between
            self._most = 2 * pieces
            self.keys = 2 * keys
        return self.pieces

    def _locate_node(self, node: int) -> Position:
        _, x, y = self.graph.get_node(node)
        return x, y, 0.0

    def list_places(self) -> Any:
        """Return the positions of all nodes, (nodes * 2,); NaN for nodes that are not on the map."""
        count = self.number_all()
        if len(self._places) != count:
            self._places = np.full((count, 2), nan)
            self._places[self._numbers] = self._columns.xy
        return self._places.reshape(-1).data

    def add_lines(self, edges: IntArray) -> None:
        """Add the polylines of edges of these numbers that have none yet; removed edges have no length."""
        known = self._known_lines
        numbers = self.edge_numbers
        if len(known.firsts) < numbers.count:
            known = known.reserve(numbers.room)
            self._known_lines = known
        new = sorted({*edges[known.firsts[edges] < 0].tolist()})
        if new:
            self._known_lines = known.add_lines(new, [self._get_line(numbers.ids[number]) for number in new])
            self._known_lines.give(self.lines)

    def _get_line(self, id: int) -> Line:
        try:
            return Line.from_flat(self.edges[id].points)
        except UnknownName:
            return Line([(nan, nan)], [])

    def _make_near_search(self, unit: str, limit: float, count: int) -> core.NearNodes:
        """Return a search for nodes within a distance, for this number of nodes."""
        costs = self._costs.get(unit)
        if costs is None or len(costs.arcs) != count + 1:
            costs = RoadCosts.from_context(self._ctx, self.numbers, count, is_plain=unit == "hops")
            self._costs[unit] = costs
        return costs.search(limit)

    def follow_roads(self) -> bool:
        """Take the roads that were closed, opened or removed since the last call; return False if more has changed."""
        if self.revision == self.graph.revision:
            return True
        changed = self._ctx.graph.storage.find_changed_roads(self._changes)
        if changed is None:
            return False
        for costs in self._costs.values():
            if not costs.set_open(changed):
                return False
        self._changes = _count_changes(self._ctx)
        self.revision = self.graph.revision
        self.edges = TraveledEdges(self._ctx)
        self.forget()
        return True

    def number_all(self) -> int:
        """Number all nodes of the map; return how many numbers there are."""
        if self._columns is None:
            columns = self.graph.columns()
            self._columns = columns
            self._numbers = np.empty(len(columns.node_ids), np.int64)
            self.numbers.write(columns.node_ids.data, self._numbers.data)
        return self.numbers.count

    def take_agents(self, ctx: Context) -> None:
        """Take the present agents."""
        block = ctx.agent.block
        epoch = self.phase.epoch
        agents = block, block.structure.entries
        if self._agents == agents:
            self.epoch = epoch
            return
        roster = self._roster
        self._agents = None  # if Ctrl-C comes in between, they are taken again
        self._roster = None
        self.turns.note_departed()
        gone = [team for team, number in self.turns.departed_teams.items() if number]
        if roster is not None and roster.follow(block, gone):
            self.steps.follow_agents()
            if self.tracks is not None:
                self.tracks.follow_agents()
        else:
            roster = Roster(block, gone, ctx.agent.get_agent)
            self.steps = TurnContacts(self, roster, are_steps=True)
            self.tracks = None
            self.turn_number = roster.turn
            self.bound = None
        self.block = block
        self.forget()
        self._roster = roster
        self._agents = agents
        self.epoch = epoch

    def bind_columns(self) -> None:
        """Let rules read the memory that the block of agents uses now."""
        assert self._roster is not None  # noqa: S101 - the agents are taken
        self._roster.bind(self.block)
        self.bound = self.block.node

    def make_tracks(self) -> TurnContacts:
        """Return new columns for moves of the present agents along several edges, or parts of edges."""
        assert self._roster is not None  # noqa: S101 - the agents are taken
        return TurnContacts(self, self._roster, are_steps=False)

    def forget(self) -> None:
        """Take the moves of the turn again when they are read."""
        self.now = None


def _count_changes(ctx: Context) -> tuple[int, int]:
    """Return the numbers of changes of the map, and of its roads only."""
    revision, roads, *_ = ctx.graph.storage.count_changes()
    return revision, roads


class RoadCosts:
    """The costs of all roads, open or closed, for searches of nodes within a distance; those of closed roads are NaN.

    Args:
        ids: (roads,) the ids of the roads.
        ends: (2, roads) the numbers of the nodes where they begin and end.
        costs: (roads,) their costs when they are open.
        is_open: (roads,) whether they are.
        count: the number of nodes.

    Attributes:
        arcs, heads, costs: as in `core.NearNodes`; costs change in place.
    """

    def __init__(self, ids: IntArray, ends: IntArray, costs: FloatArray, is_open: BoolArray, count: int) -> None:
        starts, heads = ends
        self.arcs, order = kernels.group_rows(starts, count)
        self.heads = np.ascontiguousarray(heads[order])
        self._open_costs = costs[order]
        self.costs = np.where(is_open[order], self._open_costs, nan)
        self._place_of = dict(zip(ids[order].tolist(), range(len(order)), strict=True))
        self._searches: dict[float, core.NearNodes] = {}

    @classmethod
    def from_context(cls, ctx: Context, numbers: NodeNumbers, count: int, *, is_plain: bool) -> "RoadCosts":
        """Return the costs of the roads of a context: their lengths, or 1 if `is_plain`."""
        columns = ctx.graph.graph.columns()
        _, closed = ctx.graph.storage.list_roads()
        number = np.empty(len(columns.node_ids), np.int64)
        numbers.write(columns.node_ids.data, number.data)
        known = set(columns.edge_ids.tolist() if closed else ())
        more = [edge for id, edge in closed.items() if id not in known]
        of_closed = [[numbers.number(edge[end]) for edge in more] for end in ("source", "target")]
        ends = np.concatenate((number[[columns.sources, columns.targets]], np.array(of_closed, np.int64)), axis=1)
        ids = np.append(columns.edge_ids, [edge["id"] for edge in more]).astype(np.int64)
        lengths = np.append(columns.lengths, [edge["length"] for edge in more])
        is_open = np.arange(len(ids)) < len(columns.edge_ids)
        return cls(ids, ends, np.ones(len(ids)) if is_plain else lengths, is_open, count)

    def search(self, limit: float) -> core.NearNodes:
        """Return a search for nodes up to this distance."""
        found = self._searches.get(limit)
        if found is None:
            costs: Any = self.costs.data  # of floats, which NumPy's types do not say
            memory = ReachableNodes(len(self.arcs) - 1).core
            found = core.NearNodes(self.arcs.data, self.heads.data, costs, limit, memory)
            self._searches[limit] = found
        return found

    def set_open(self, are_open: Mapping[int, bool]) -> bool:
        """Close and open roads; return False if one of them is unknown."""
        if not self._place_of.keys() >= are_open.keys():
            return False
        for id, is_open in are_open.items():
            place = self._place_of[id]
            self.costs[place] = self._open_costs[place] if is_open else nan
        for search in self._searches.values():
            search.forget()
        return True


def get_contacts(ctx: Context) -> TurnContacts:
    """Return the contact queries of a context for this turn; valid until agents are moved or the next call."""
    turn: TurnContacts = _get_game(ctx).get_turn_moves(ctx)
    return turn


def get_rule(ctx: Context, form: Form, key: Hashable = None, *, follows: bool = True) -> GameRule:
    """Return a rule of the core, ready to be played in the game of a context.

    Args:
        ctx: the context.
        form: builds the rule.
        key: a key under which the rule is kept; None: the form itself.
        follows: whether the rule depends on how agents have moved.
    """
    game = _get_game(ctx)
    turn: Any = game.get_turn_moves(ctx) if follows else game.get_any_moves(ctx)
    found: GameRule = turn.get_rule(ctx, form, id(form) if key is None else key)
    return found


def make_player(
    ctx: Context,
    form: Form,
    play: Callable[[GameRule, Context], object] | None = None,
    *,
    follows: bool = True,
) -> GamePlayer:
    """Return a function without arguments that plays a shipped rule in the game of a context.

    Args:
        ctx: the context.
        form: builds the rule.
        play: called with the rule of the core and the context; None: the rule is played as it is.
        follows: whether the rule depends on how agents have moved.
    """
    return GamePlayer(ctx, _get_game, form, play, follows=follows)


def _get_game(ctx: Context) -> GameContacts:
    internals = ctx.game.internals
    known: GameContacts | None = internals.kept.get("contacts")
    if known is None or not known.is_of_map():
        graph = ctx.graph.graph
        by_metres = ctx.game.speed_unit != "edges"
        is_same = known is not None and known.graph is graph and known.numbers is ctx.agent.block.numbers
        if known is not None and is_same and known.by_metres == by_metres and known.follow_roads():
            return known
        known = GameContacts(ctx)
        internals.kept["contacts"] = known
    return known


def find_nodes_within(graph: Graph, node: int, limit: float) -> dict[int, float]:
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


# -- where agents are in a turn, which is the time from 0 to 1 --------------------------------------------------------


def cut_to_end(track: Track) -> Track:
    """Return a track that keeps only the position at the end of the turn."""
    last = track.legs[-1]._replace(begin=track.legs[-1].end, since=1.0, until=1.0) if track.legs else None
    is_on_edge = last is not None and 0.0 < last.end < 1.0
    return Track(track.path[-1:], (1.0,), (last,) if last is not None and is_on_edge else ())


class TraveledEdges(dict[int, OSMEdge]):
    """A mapping id -> edge of the edges that agents move along, including edges that rules have closed since.

    Raises:
        UnknownName (KeyError): on access to an edge that was removed.
    """

    def __init__(self, ctx: Context) -> None:
        super().__init__()
        self._ctx = ctx
        self.graph = ctx.graph.graph

    def __missing__(self, id: int) -> OSMEdge:
        """Look up an edge."""
        try:
            found = self.graph.get_edge(id)
        except UnknownName:
            _, closed = self._ctx.graph.storage.list_roads()
            if id not in closed:
                raise
            edge = closed[id]
            line = edge.get("linestring")
            line = self.graph.positions([edge["source"], edge["target"]]) if line is None else line
            found = OSMEdge(id, edge["source"], edge["target"], edge["length"], line)
        self[id] = found
        return found

    def get_length(self, leg: Leg) -> float | None:
        """Return the length of the edge of a leg; None if the edge was removed."""
        try:
            return self[leg.edge].length
        except UnknownName:
            return None

    def find_xy(self, track: Track, time: float, node: int, at: Position | None) -> tuple[float, float] | None:
        """Return the map position of an agent; None if its edge or node was removed.

        Args:
            track: the moves of the agent.
            time: time within the turn.
            node: the last node that it passed.
            at: position of a flying agent, which is on no node.
        """
        try:
            if at is not None:
                return at[:2]
            for leg in track.legs:
                if leg.since <= time <= leg.until:
                    return find_point_along(self[leg.edge].points, leg.share_at(time))[:2]
            found = self.graph.get_node(node)
        except UnknownName:
            return None
        return found.x, found.y
