"""Conflicts of moves: declare them with `Conflicts`, and resolve them turn by turn.

A conflict is a node with too many agents, or two agents that exchange nodes. `gamms.core.conflicts` finds and decides
conflicts; this module holds the public classes, and converts turns to numbers.
"""

from array import array
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from functools import partial
from inspect import signature
from itertools import count, repeat
from operator import attrgetter
from types import FunctionType
from typing import Any, NamedTuple, cast

import numpy as np

from gamms import kernels
from gamms.arguments import DescribedFunction, as_choice, as_flag, as_int, as_text, show_as_call
from gamms.core import conflicts as core
from gamms.core.agents import MoveColumns, NodeNumbers
from gamms.core.turn import NodeConflicts
from gamms.errors import BadType, BadValue, UnknownName, nearest
from gamms.game.order import ConflictingAgents, TurnOrder
from gamms.ir.graph import GraphColumns, IntArray, as_node_id
from gamms.ir.obstacles import BoolArray
from gamms.kernels.draws import BitArray
from gamms.text import as_code, shown
from gamms.typing.context import HostContext
from gamms.typing.game import EdgePlace, IConflicts, Move

Capacity = int | Mapping[int, int | None] | str | None  # the type of the argument
UNLIMITED = (1 << 63) - 1  # more agents than any game has
_PURPOSE = "conflicts"  # of draws
_FIRST_EDGE = 1 << 62  # less than this, numbers of edges before they follow those of nodes
_NOBODY = memoryview(array("q"))
_MISSING = object()  # the rank of an agent that the ranking does not know


class Contest(NamedTuple):
    """A place that more agents want to enter than it has room for; a resolver decides it.

    Attributes:
        node: the node or edge that all of them want to end on; for an exchange, its two nodes, the smaller id first.
        places: the maximum number of winners, at least 1 and less than the number of movers.
        movers: their moves, in the order of names.
    """

    node: int | EdgePlace | tuple[int, int]
    places: int
    movers: tuple[Move, ...]


Resolver = Callable[[Contest, Any], Iterable[str | Move]]  # called with the contest and the `gamms.Context`
Rank = Callable[[str, Hashable], Any]  # called with the name and the team of an agent
MovesOf = Callable[[list[int]], Mapping[str, Move]]  # the moves of agents by their numbers, in order
TableArray = np.ndarray[Any, np.dtype[np.int32]]
MovePlaces = MoveColumns | tuple[list[Any], list[Any]]  # starts and ends: node ids, or lists that may have edges


class Ranking:
    """A resolver by which the agents with the smallest ranks win; ties go to the first names.

    The core decides all such contests, in single games and in batches, without calling the resolver again.

    Args:
        rank: `(name, team) -> rank`, the same in all turns; the rank None never wins. A `LookupError` is raised again
            when the agent is in a contest. None: ranks are drawn at random in every turn.
        of_team: whether the rank depends on the team only; then teams without a rank are refused before they play.
    """

    def __init__(self, rank: Rank | None, *, of_team: bool = False) -> None:
        self.rank = rank
        self.of_team = of_team
        self.__module__ = getattr(rank, "__module__", __name__)  # scenario files look up the module of the function

    def __call__(self, contest: Contest, ctx: HostContext) -> list[Move]:
        """Return the moves of the winners."""
        movers = contest.movers
        if self.rank is None:
            purpose = kernels.compute_purpose_key(ctx.seed, _PURPOSE)
            ranks = kernels.draw_bits_each(purpose, (mover.agent for mover in movers), ctx.game.turn)
        else:
            ranks = self.compute_ranks([mover.agent for mover in movers], [mover.team for mover in movers]).tolist()
        order = sorted(range(len(movers)), key=ranks.__getitem__)
        for i in order:
            self.check(ranks[i], movers[i].agent, movers[i].team)
        return [movers[i] for i in order[: contest.places] if self.rank is None or ranks[i] < core.RANK_OF_NONE]

    def compute_ranks(self, names: Sequence[str], teams: Sequence[Hashable]) -> BitArray:
        """Return the ranks of agents: numbers from 0, `core.RANK_OF_NONE` or `core.RANK_MISSING`, (agents,)."""
        if self.of_team:
            of_team = {team: self._call_rank(name, team) for team, name in dict(zip(teams, names, strict=True)).items()}
            given = [of_team[team] for team in teams]
        else:
            given = list(map(self._call_rank, names, teams))
        try:
            order = sorted(set(given) - {None, _MISSING})
        except TypeError:
            raise BadType(f"The ranks of agents cannot be compared: {shown(given)}.") from None
        number: dict[Any, int] = dict(zip(order, count()))
        number[None] = core.RANK_OF_NONE
        number[_MISSING] = core.RANK_MISSING
        return np.array([number[rank] for rank in given], np.uint64)

    def check(self, rank: int, name: str, team: Hashable) -> None:
        """Raise the error of the rank function if an agent in a contest has no rank."""
        if self.rank is not None and rank == core.RANK_MISSING:
            self.rank(name, team)

    def _call_rank(self, name: str, team: Hashable) -> Any:
        try:
            return cast("Rank", self.rank)(name, team)
        except LookupError:
            return _MISSING


class Conflicts:
    """The conflicts of a game and their resolution; set as `ctx.game.conflicts`.

    The capacity of a node limits the number of agents that stay there or enter. Agents that stay keep their places; if
    more agents want to enter than there is room for, there is a contest, and the losers stay on their nodes. An agent
    that leaves makes room in the same turn, so a chain of agents can move up, and a full circle can rotate. A node on
    which more agents stay than its capacity cannot be entered until enough of them have left.

    Args:
        capacity: the capacity of every node; or a mapping from node ids to capacities; or the name of a node attribute,
            read in every turn. None, a node outside the mapping, or a node without the attribute: no limit. 0 closes a
            single node to agents from elsewhere.
        among: "all": all agents on the ground count; "team": each team counts by itself (None is a team, too).
        edge_capacity: in games by metres, the number of agents that may end a turn on an edge, or be on it at any time
            if agents decide at arrivals: a number, or by edge ids or an edge attribute, as for nodes. Each direction of
            a street is an edge of its own. An agent that is already on the edge keeps its place.
        allow_swaps: whether two agents may exchange nodes. If not, the winner of the contest decides: agents in its
            direction move, and agents in the opposite direction stay (and may then be in the way). Only start and end
            nodes count, not nodes along a path; a path that ends at its start counts as staying. With `among="team"`,
            members of different teams may exchange nodes.
        resolve: chooses the winners: `by_priority(…)`, `by_rank(…)`, `at_random()`, `nobody()`, or a function
            `(contest, ctx) -> winners` that returns names or moves of at most `contest.places` of `contest.movers`.

    Attributes:
        allow_swaps: see the argument.

    Raises:
        BadType, BadValue: an argument is invalid.
    """

    def __init__(
        self,
        capacity: Capacity = 1,
        among: str = "all",
        *,
        edge_capacity: Capacity = None,
        allow_swaps: bool = True,
        resolve: Resolver | None = None,
    ) -> None:
        as_choice(as_text(among, "among"), "among", ("all", "team"))
        self._limits = _Capacities(_as_limits(capacity, "node"), _as_limits(edge_capacity, "edge"))
        self._resolver = at_random() if resolve is None else _as_resolver(resolve)
        given = {"capacity": capacity, "among": among, "allow_swaps": allow_swaps, "resolve": self._resolver}
        if edge_capacity is not None:
            given["edge_capacity"] = edge_capacity
        self._given = {name: as_code(value) for name, value in given.items()}
        self.allow_swaps = as_flag(allow_swaps, "allow_swaps")
        self._per_team = among == "team"

    @property
    def has_state(self) -> bool:
        """Whether it resolves contests by an object of the user's, which may change."""
        return type(self._resolver) not in (FunctionType, DescribedFunction, Ranking)

    def __repr__(self) -> str:
        return f"Conflicts({', '.join(f'{name}={value}' for name, value in self._given.items())})"

    def resolve(self, moves: Mapping[str, Move], ctx: HostContext) -> set[str]:
        """Return the names of the agents that must stay, among agents that want to move.

        If exchanges are forbidden, they are decided first, all at once: each agent moves in one direction, so it is in
        at most one exchange, and no new exchange can arise. Then follow rounds for full nodes: all contests of a round
        are found before one is decided, and no agent is in two, because it has one end. Thus the result depends only on
        the moves and the context, not on their order.

        The procedure ends: in each round with a contest, at least one agent loses and stays from then on, and there are
        finitely many agents. After the last round, no node exceeds its capacity by agents that entered.

        Raises:
            BadType, BadValue: the answer of the resolver, or a capacity in a node attribute, is invalid.
            UnknownName (KeyError): no node has the attribute with the capacities.
        """
        listed = sorted(moves.values(), key=_name_of)
        starts, ends = [[move.places[which] for move in listed] for which in (0, 1)]
        agents = _Agents(self, [move.agent for move in listed], [move.team for move in listed], (), ctx)
        agents.let_take_part(bytes([1]) * len(listed))
        found = agents.find_losers(
            (starts, ends), ctx.game.turn, lambda rows: {listed[i].agent: listed[i] for i in rows}, ctx
        )
        return {listed[i].agent for i in found}

    def limits(self, columns: GraphColumns, *, has_edges: bool) -> IntArray:
        """Return the capacities of all nodes of a map, followed by those of all edges if these are places."""
        return self._limits.list_capacities(columns, has_edges=has_edges)


_name_of = attrgetter("agent")


def make_ranking(conflicts: object) -> Conflicts | None:
    """Return conflicts that the core can resolve by ranks; None for all others."""
    known = _find_core_conflicts(conflicts)
    return None if known is None or _find_ranking(known._resolver) is None else known


def make_ranking_for_all(conflicts: object, names: Sequence[str], teams: Sequence[Hashable]) -> Conflicts | None:
    """Return conflicts that the core can resolve by ranks, which all agents of these names and teams have."""
    known = make_ranking(conflicts)
    ranking = None if known is None else _find_ranking(known._resolver)
    if ranking is None or ranking.rank is None:
        return known
    return None if (ranking.compute_ranks(names, teams) == core.RANK_MISSING).any() else known


def find_unranked(conflicts: object, names: Sequence[str], teams: Sequence[Hashable]) -> BoolArray:
    """Return whether a ranking of teams leaves out the team of each agent, (agents,); None is no team."""
    ranking = _find_team_ranking(conflicts)
    if ranking is None:
        return np.zeros(len(names), np.bool_)
    is_missing: BoolArray = ranking.compute_ranks(names, teams) == core.RANK_MISSING
    return is_missing & np.array([team is not None for team in teams], np.bool_)


def refuse_unranked(conflicts: object, name: str, team: Hashable) -> None:
    """Raise the error of a ranking of teams for an agent whose team it leaves out.

    Raises:
        LookupError: of the rank function.
    """
    ranking = _find_team_ranking(conflicts)
    if ranking is not None:
        ranking.check(core.RANK_MISSING, name, team)


def _find_team_ranking(conflicts: object) -> Ranking | None:
    """Return the ranking by which teams win conflicts; None: other ranks, a function or another class decides."""
    known = _find_core_conflicts(conflicts)
    ranking = None if known is None else _find_ranking(known._resolver)
    return ranking if ranking is not None and ranking.rank is not None and ranking.of_team else None


def _find_core_conflicts(conflicts: object) -> Conflicts | None:
    """Return conflicts whose contests the core finds; None: a subclass or another class decides who stays."""
    is_own = isinstance(conflicts, Conflicts) and type(conflicts).resolve is Conflicts.resolve
    return cast("Conflicts", conflicts) if is_own else None


def _find_ranking(resolver: Resolver) -> Ranking | None:
    inner = resolver.func if isinstance(resolver, DescribedFunction) else resolver
    return inner if isinstance(inner, Ranking) else None


@show_as_call
def at_random() -> Resolver:
    """Make a resolver that draws a number for each agent in every turn; the smallest numbers win.

    The draw depends only on the seed of the context, the turn and the agent's name. Therefore other agents, other draws
    and the order of contests do not change it, and an agent in two contests of a turn keeps its number.
    """
    return Ranking(None)


# -- turns of one game ---------------------------------------------------------------------------------------------


class TurnConflicts:
    """Finds the agents that stay in each turn of a game; its working memory is reused while the agents are the same."""

    def __init__(self) -> None:
        self._agents: _Agents | None = None
        self._order: TurnOrder | None = None  # `_agents` was made for these
        self._conflicts: IConflicts | None = None
        self._allows_swaps: object = None  # as it was then
        self._forgotten = 0  # how often the seed has changed

    def forget(self) -> None:
        """Forget the order of agents that was drawn by an earlier seed of the context."""
        self._order = None
        self._forgotten += 1

    def check_teams(self, conflicts: IConflicts, order: TurnOrder) -> None:
        """Refuse agents on the ground that take part, and whose team has no rank; call it before each turn.

        Raises:
            LookupError: of the rank function, such as `MissingKey` of `by_priority`.
        """
        if order.ranked_by is not conflicts:
            flying = set(order.slots.flying)
            found = np.flatnonzero(find_unranked(conflicts, order.names, order.list_teams())).tolist()
            order.unranked = [i for i in found if i not in flying]
            order.ranked_by = conflicts
        for i in order.moving.select_present(order.unranked):
            refuse_unranked(conflicts, order.names[i], order.list_teams()[i])

    def find_losers(
        self,
        conflicts: IConflicts,
        order: TurnOrder,
        turn: int,
        places: MovePlaces,
        took_part: bytes,
        moves_of: MovesOf,
        ctx: HostContext,
    ) -> memoryview:
        """Return the slots of the agents that stay, as integers.

        Args:
            conflicts: the conflicts of the game.
            order: the agents.
            turn: the number of turns played.
            took_part: (agents,) whether each takes part.
            places: the start and the end of each move, by slot: columns of node ids, or lists that may have edges.
            moves_of: returns the moves of slots, by name and in order.
            ctx: the context.
        """
        allows_swaps = getattr(conflicts, "allow_swaps", None)
        if order is not self._order or conflicts is not self._conflicts or allows_swaps != self._allows_swaps:
            made_for = order.in_conflict
            if made_for.conflicts is not conflicts or made_for.key != (allows_swaps, self._forgotten):
                agents = self._find_agents(conflicts, order, ctx)
                made_for = ConflictingAgents(conflicts, (allows_swaps, self._forgotten), agents)
                order.in_conflict = made_for
            self._agents = made_for.agents
            self._order = order
            self._conflicts = conflicts
            self._allows_swaps = allows_swaps
        if self._agents is not None:
            self._agents.let_take_part(took_part)
            return self._agents.find_losers(places, turn, moves_of, ctx)
        ground = order.whole.on_ground
        movers = [i for i in (range(len(order.slots)) if ground is None else ground) if took_part[i]]
        stay = conflicts.resolve(moves_of([*movers]), ctx)
        return memoryview(array("q", [i for i in movers if order.names[i] in stay]))

    def _find_agents(self, conflicts: IConflicts, order: TurnOrder, ctx: HostContext) -> "_Agents | None":
        """Return the agents for conflicts that the core finds; None for all others."""
        known = _find_core_conflicts(conflicts)
        if known is None:
            return None
        before = self._agents if conflicts is self._conflicts else None
        places = None if before is None else before.places
        agents = _Agents(known, order.names, order.list_teams(), order.slots.flying, ctx, places)
        agents.order = order
        return agents

    @property
    def in_core(self) -> NodeConflicts | None:
        """The agents of the last turn, if the core alone resolves their conflicts on nodes; None: it does not."""
        agents = self._agents
        return agents if agents is not None and agents.is_by_ranks else None


class MoveRows:
    """The starts and the ends of moves as numbers of places.

    Attributes:
        both: (2, agents) the starts and the ends.
        columns: the form of the core.
    """

    def __init__(self, agents: int) -> None:
        self.both = np.zeros((2, agents), np.int64)
        self.columns = MoveColumns(self.both[0].data, self.both[1].data)


class PlaceNumbers:
    """The places of one game as numbers, nodes before edges, and their capacities.

    Args:
        capacities: the capacities of all places.
        ctx: the context of the game.
    """

    def __init__(self, capacities: "_Capacities", ctx: HostContext) -> None:
        self.nodes: NodeNumbers = ctx.agent.block.numbers
        by_metres = ctx.game.speed_unit != "edges"  # otherwise no agent is on an edge
        self._edges: NodeNumbers = ctx.agent.block.edge_numbers if by_metres else NodeNumbers()
        self._capacities = capacities
        self.depend_on_map = capacities.depend_on_map
        self._columns: GraphColumns | None = None  # the map of `_limits`
        self._limits: IntArray = np.zeros(0, np.int64)
        self._tables = make_tables(0)

    @property
    def num_nodes(self) -> int:
        """The number of the first edge."""
        return self.nodes.room

    def write(self, places: MovePlaces, rows: MoveRows, ctx: HostContext) -> IntArray:
        """Write the numbers of the starts and the ends of moves; return the capacities of all numbers.

        The array of capacities is the same until they change.
        """
        if self._columns is None or self._capacities.depend_on_map:
            columns = ctx.graph.graph.columns()
            if columns is not self._columns:
                self._columns = columns
                self._read_limits(columns)
        if isinstance(places, MoveColumns):
            self.nodes.write_moves(places, rows.columns)
        else:
            for several, row in zip(places, rows.both, strict=True):
                row[:] = [self._get_number(place) for place in several]
        if len(self._limits) != self.nodes.room + self._edges.room:
            self._read_limits(self._columns)
        if not isinstance(places, MoveColumns):
            rows.both[rows.both < 0] += self.nodes.room + _FIRST_EDGE
        return self._limits

    def make_tables(self, places: int) -> TableArray:
        """Return the tables of a `ConflictTable`, which are the same as long as there are as many places."""
        if self._tables.shape[1] != places:
            self._tables = make_tables(places)
        return self._tables

    def _get_number(self, place: int | EdgePlace) -> int:
        """Return the number of a node; of an edge, its number among edges, less than 0."""
        if isinstance(place, EdgePlace):
            return self._edges.number(place.edge) - _FIRST_EDGE
        return self.nodes.number(place)

    def _read_limits(self, columns: GraphColumns) -> None:
        nodes = columns.node_ids, columns.node_attributes
        edges = columns.edge_ids, columns.edge_attributes
        known = self._capacities
        self._limits = np.concatenate(
            (known.nodes.compute_limits(self.nodes, *nodes), known.edges.compute_limits(self._edges, *edges))
        )


class _Agents(NodeConflicts):
    """The agents of a game with conflicts, in the order of their names.

    Args:
        conflicts: the conflicts.
        names, teams: the names and teams of the agents.
        flying: the indices of agents that fly.
        ctx: the context.
        places: the places of the game; None: they are new.

    Attributes:
        places: the places of the game.
        is_by_ranks: whether ranks decide, and capacities do not depend on the map.
    """

    def __init__(
        self,
        conflicts: Conflicts,
        names: Sequence[str],
        teams: Sequence[Hashable],
        flying: Sequence[int],
        ctx: HostContext,
        places: PlaceNumbers | None = None,
    ) -> None:
        self.places = PlaceNumbers(conflicts._limits, ctx) if places is None else places
        self._rows = MoveRows(len(names))
        self._losers = np.zeros(len(names), np.int64)
        losers: Any = self._losers.data
        super().__init__(self.places.nodes, self._rows.columns, losers)
        self.conflicts = conflicts
        self.allow_swaps = conflicts.allow_swaps
        self.is_by_ranks = _find_ranking(conflicts._resolver) is not None and not self.places.depend_on_map
        self._names = names
        self._teams = teams
        self._flies = np.zeros(len(names), np.bool_)
        self._flies[[*flying]] = True
        self._purpose = kernels.compute_purpose_key(ctx.seed, _PURPOSE)
        self._limits: IntArray | None = None  # those of `_table`

    def _take_limits(self, limits: IntArray) -> None:
        """Make working memory for places with these capacities."""
        self._table = ConflictTable(
            self.conflicts,
            self._names,
            self._teams,
            self._flies,
            limits,
            self.places.num_nodes,
            self.places.make_tables,
        )
        ranks = self._table.ranks
        if ranks is None:
            ranks = kernels.compute_first_key_rows(
                np.array([self._purpose], np.uint64), kernels.compute_name_keys(self._names)
            )
        rows = self._rows.both
        self.requests = self._table.make_requests(rows[0].data, rows[1].data, memoryview(self.takes_part), ranks)
        self.contests = self._table.contests
        self.room = self.numbers.room
        self._limits = limits  # after what a key of ranks may raise

    def find_losers(self, places: MovePlaces, turn: int, moves_of: MovesOf, ctx: HostContext) -> memoryview:
        """Return the numbers of the agents that stay.

        Args:
            places: the start and the end of each move.
            turn: the number of turns played.
            moves_of: returns the moves of agents, by name and in order.
            ctx: the context.
        """
        is_written = isinstance(places, MoveColumns) and not self.places.depend_on_map and self.write(places)
        if not is_written:
            limits = self.places.write(places, self._rows, ctx)
            if limits is not self._limits:
                self._take_limits(limits)
        table = self._table
        ranking = table.ranking
        found = 0
        if ranking is not None:
            found = self.resolve(turn)
        else:
            self._ask_each(moves_of, ctx)
            found = core.find_losers(self.contests, self._losers.data)
        if found and ranking is not None and ranking.rank is not None:
            for i in np.flatnonzero(table.stays == core.LOSES_UNRANKED).tolist():
                ranking.check(core.RANK_MISSING, self._names[i], self._teams[i])
        return self._losers[:found].data if found else _NOBODY

    def _ask_each(self, moves_of: MovesOf, ctx: HostContext) -> None:
        """Decide each contest by the resolver function."""
        c = self._table.contests
        requests = self.requests
        core.begin(c, requests, 0)
        try:
            if not self.conflicts.allow_swaps:
                found = core.find_exchanges(c)
                self._ask(found, moves_of, ctx, is_exchange=True)
                core.end_exchanges(c, found)
            if self.conflicts._limits.least < len(self._names):
                found = core.find_contests(c, requests)
                while found:
                    self._ask(found, moves_of, ctx, is_exchange=False)
                    found = core.find_more_contests(c, requests, found)
        finally:
            core.clear(c)

    def _ask(self, found: int, moves_of: MovesOf, ctx: HostContext, *, is_exchange: bool) -> None:
        """Call the resolver for the contests of a round, in the order of their nodes."""
        table = self._table
        resolver = self.conflicts._resolver
        contests = []
        first = table.first[: found + 1].tolist()
        for k in range(found):
            rows = table.members[first[k] : first[k + 1]].tolist()
            table.stays[rows] = core.LOSES
            free = int(table.free[k])
            if free:
                movers = tuple(map(_convert_move, moves_of(rows).values()))
                start = movers[0].start
                end = movers[0].end
                node = (min(start, end), max(start, end)) if is_exchange else end
                contests.append((Contest(node, free, movers), rows))
        for contest, rows in sorted(contests, key=lambda pair: _make_sort_key(pair[0])):
            winners = _find_winners(contest, resolver, ctx)
            table.stays[[i for i, mover in zip(rows, contest.movers, strict=True) if mover.agent in winners]] = (
                core.WINS
            )


def _convert_move(move: Move) -> Move:
    """Return a move whose start and end are places, which may be edges."""
    start, end = move.places
    return move._replace(start=cast("int", start), end=cast("int", end)) if move.legs else move


def _make_sort_key(contest: Contest) -> tuple[bool, Any, str]:
    """Return the sort key of a contest; a fixed order makes resolvers with random draws repeatable."""
    return (isinstance(contest.node, EdgePlace), contest.node, contest.movers[0].agent)


# -- working memory --------------------------------------------------------------------------------------------------


class ConflictTable:
    """Constant data and working memory for the conflicts of some agents, in one game at a time; see `core.conflicts`.

    Args:
        conflicts: the conflicts.
        names, teams: (agents,) the names and teams of the agents.
        flies: (agents,) whether each agent flies.
        limits: (places,) the capacities of all places.
        num_nodes: the number of nodes, which are the first places.
        make: returns tables by place; see `make_tables`.

    Attributes:
        ranking: the ranks that decide; None: a function decides.
        contests: the form of the core, with the arrays `members`, `free`, `first` and `stays`.
        ranks: (agents,) the ranks of the agents; None: ranks are drawn for `purpose`, or a function decides.
    """

    purpose = _PURPOSE

    def __init__(
        self,
        conflicts: Conflicts,
        names: Sequence[str],
        teams: Sequence[Hashable],
        flies: BoolArray,
        limits: IntArray,
        num_nodes: int,
        make: Callable[[int], TableArray],
    ) -> None:
        agents = len(names)
        ranking = _find_ranking(conflicts._resolver)
        self.ranking = ranking
        is_ranked = ranking is not None and ranking.rank is not None
        self.ranks = ranking.compute_ranks(names, teams) if ranking is not None and is_ranked else None
        number = {team: i for i, team in enumerate(dict.fromkeys(teams if conflicts._per_team else ()))}
        first = np.array([len(limits) * number.get(team, 0) for team in teams], np.int64)
        self._first = np.where(flies, -1, first).data
        self._limits = limits.data
        tables = make(len(limits) * max(1, len(number)))
        self.members = np.zeros(agents, np.int32)
        self.free = np.zeros(agents, np.int32)
        self.first = np.zeros(agents + 1, np.int32)
        self.stays = np.zeros(agents, np.uint8)
        self.contests = core.Contests(
            agents,
            num_nodes,
            len(limits),
            conflicts._limits.least,
            conflicts.allow_swaps,
            ranking is not None and not is_ranked,
            tables.reshape(-1).data,
            np.zeros(7 * agents, np.int32).data,
            self.members.data,
            self.free.data,
            self.first.data,
            np.zeros(agents, np.uint64).data,
            self.stays.data,
        )

    def make_requests(
        self, starts: memoryview, ends: memoryview, counts: memoryview, ranks: BitArray
    ) -> core.MoveRequests:
        """Return the moves of games for the core; if ranks are drawn, `ranks` holds `first_key`s."""
        return core.MoveRequests(starts, ends, counts, self._first, self._limits, flatten(ranks, np.uint64))


def make_tables(places: int) -> TableArray:
    """Return empty tables by place, (2, places): the first agent in a list, and the number of agents that are there.

    They are empty again after each turn, so that the agents of the next one can use them.
    """
    tables = np.zeros((2, places), np.int32)
    tables[0] = -1
    return tables


def flatten(column: np.ndarray[Any, Any], kind: type[np.generic]) -> Any:  # memoryviews are not subscriptable
    """Return a column as a flat, read-only buffer for the core."""
    return np.ascontiguousarray(column, kind).reshape(-1).data


# -- resolvers -------------------------------------------------------------------------------------------------------


def _as_resolver(resolve: object) -> Resolver:
    """Return the resolver argument, checked."""
    if not callable(resolve):
        raise BadType(f"resolve must be a function (contest, ctx) -> winners, not {shown(resolve)}.")
    try:
        signature(resolve).bind(None, None)
    except ValueError:  # it has no signature
        pass
    except TypeError:
        name = as_code(resolve)
        raise BadType(
            f"resolve={name} does not take (contest, ctx). If it makes a resolver, call it, as in {name}(…)."
        ) from None
    return cast("Resolver", resolve)  # its arguments and result are checked at each call


def _find_winners(contest: Contest, resolve: Resolver, ctx: HostContext) -> set[str]:
    """Call a resolver; return the names of the winners, checked."""
    answer: object = resolve(contest, ctx)
    if isinstance(answer, (str, Move)) or not isinstance(answer, Iterable):
        form = "must give a list of the winners, names or moves, not"
        raise BadType(f"{_describe_resolver(resolve, contest)} {form} {shown(answer)}.")
    winners = set[str]()
    names = [mover.agent for mover in contest.movers]
    for one in answer:
        winner = one.agent if isinstance(one, Move) else one
        if not isinstance(winner, str):
            raise BadType(
                f"{_describe_resolver(resolve, contest)} must name winners or give their moves, not {shown(winner)}."
            )
        winners.add(winner)
    for winner in sorted(winners.difference(names)):
        hint = nearest(winner, names)
        raise BadValue(f"{_describe_resolver(resolve, contest)} let {shown(winner)} win, not one of {names}.{hint}")
    if len(winners) > contest.places:
        few = f"contest.places is {contest.places}"
        raise BadValue(f"{_describe_resolver(resolve, contest)} let {len(winners)} win, {sorted(winners)}, but {few}.")
    return winners


def _describe_resolver(resolve: Resolver, contest: Contest) -> str:
    what = "the exchange of nodes" if isinstance(contest.node, tuple) else "node"
    what = "the place" if isinstance(contest.node, EdgePlace) else what
    return f"The resolver {getattr(resolve, '__name__', repr(resolve))!r}, asked about {what} {contest.node},"


# -- capacities ------------------------------------------------------------------------------------------------------


_Attributes = Mapping[str, Mapping[int, Any]]  # name -> row -> value


class _CapacityLimits(NamedTuple):
    """The capacities of nodes or of edges.

    Attributes:
        least: a lower bound of all capacities; with fewer agents, no capacity is looked up.
        rows: returns the capacities of all nodes or edges of a map, from their ids and attributes; `UNLIMITED` for no
            limit.
        number: the common capacity; None: capacities may differ.
    """

    least: int
    rows: Callable[[IntArray, _Attributes], IntArray]
    number: int | None = None

    def compute_limits(self, numbers: NodeNumbers, ids: IntArray, attributes: _Attributes) -> IntArray:
        """Return the capacities of all numbers, (room,), for a map with these ids and attributes."""
        if self.number is not None:
            return np.full(numbers.room, self.number)
        found = np.zeros(len(ids), np.int64)
        numbers.write(np.ascontiguousarray(ids).data, found.data)
        limits = np.full(numbers.room, UNLIMITED)
        limits[found] = self.rows(ids, attributes)
        return limits


class _Capacities:
    """The capacities of nodes and edges.

    Attributes:
        nodes, edges: the capacities of each kind.
        least: a lower bound of all capacities.
        depend_on_map: whether places of a kind may differ.
    """

    def __init__(self, nodes: _CapacityLimits | None, edges: _CapacityLimits | None) -> None:
        self.nodes = nodes or _limit_all_places(UNLIMITED)
        self.edges = edges or _limit_all_places(UNLIMITED)
        self.least = min(self.nodes.least, self.edges.least)
        self.depend_on_map = self.nodes.number is None or self.edges.number is None

    def list_capacities(self, columns: GraphColumns, *, has_edges: bool) -> IntArray:
        """Return the capacities of all nodes of a map, followed by those of all edges if these are places."""
        rows = self.nodes.rows(columns.node_ids, columns.node_attributes)
        if not has_edges:
            return rows
        return np.concatenate((rows, self.edges.rows(columns.edge_ids, columns.edge_attributes)))


def _limit_all_places(number: int) -> _CapacityLimits:
    return _CapacityLimits(number, partial(_repeat_number, number), number)


def _repeat_number(number: int, ids: IntArray, _: _Attributes) -> IntArray:
    return np.full(len(ids), number)


def _read_attribute_limits(name: str, kind: str) -> _CapacityLimits:
    """Return capacities that are read from an attribute of nodes or edges."""
    return _CapacityLimits(0, partial(_look_up_attribute, name, kind))


def _look_up_attribute(name: str, kind: str, ids: IntArray, attributes: _Attributes) -> IntArray:
    if name not in attributes:
        forms = f" The capacity may also be a number, or a mapping from {kind} ids to numbers."
        raise UnknownName(f"{kind} attribute", name, attributes, forms)
    limits = np.full(len(ids), UNLIMITED)
    for row, value in attributes[name].items():
        limits[row] = _as_limit(value, f"Attribute {name!r} of {kind} {ids[row]}")
    return limits


def _as_limits(capacity: object, kind: str) -> _CapacityLimits | None:
    """Check the capacity argument for a "node" or "edge"; return None if there is no limit."""
    what = "capacity" if kind == "node" else "edge_capacity"
    if capacity is None:
        return None
    if isinstance(capacity, str):
        if not capacity:
            raise BadValue(f"{what} must be the name of an attribute of {kind}s, not an empty string.")
        return _read_attribute_limits(capacity, kind)
    if isinstance(capacity, Mapping):
        pairs = ((as_node_id(node, f"The id of a {kind} in {what}"), value) for node, value in capacity.items())
        known = {node: _as_limit(value, f"{what} of {kind} {node}") for node, value in pairs}
        least = min(known.values(), default=UNLIMITED)
        return _CapacityLimits(least, partial(_look_up_ids, known))
    try:
        number = as_int(capacity, what)
    except BadType:
        raise BadType(
            f"{what} must be an integer, a mapping from {kind} ids to integers, the name of an attribute of {kind}s, "
            f"or None, not {shown(capacity)} ({type(capacity).__name__})."
        ) from None
    if number < 1:
        raise BadValue(f"{what} must be at least 1, not {number}: no agent could move. Use None for no limit.")
    return _limit_all_places(min(number, UNLIMITED))


def _look_up_ids(known: Mapping[int, int], ids: IntArray, _: _Attributes) -> IntArray:
    return np.array(list(map(known.get, ids.tolist(), repeat(UNLIMITED))), np.int64)


_LIMIT_FORM = "Give a number of agents: 0 closes the place to others, and None means no limit."


def _as_limit(value: object, name: str) -> int:
    if value is None:
        return UNLIMITED
    # NOTE: the plain int is checked in line: this is asked for every agent that moves (an attribute, 1,000 agents).
    try:
        number = value if type(value) is int else as_int(value, name)
    except BadType as error:
        raise BadType(f"{error} {_LIMIT_FORM}") from None
    if number < 0:
        raise BadValue(f"{name} must not be negative, not {number}. {_LIMIT_FORM}")
    return min(number, UNLIMITED)
