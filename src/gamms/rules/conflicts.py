"""Conflicts of moves: too many agents on a node, or two that exchange nodes, and which of them have to stay."""

from collections import Counter, defaultdict
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from functools import partial
from itertools import compress
from operator import attrgetter
from typing import Any, NamedTuple, cast

import numpy as np

from gamms import kernels
from gamms.agent import BaseAgent
from gamms.arguments import as_array, as_choice, as_flag, as_int, as_key, as_known, as_text
from gamms.context import Context
from gamms.errors import BadType, BadValue, MissingKey, UnknownName, nearest
from gamms.graph import Graph
from gamms.ir.graph import IntArray
from gamms.ir.obstacles import BoolArray
from gamms.kernels.draws import BitArray
from gamms.rules.conflicts_in_arrays import UNLIMITED, ArrayResolver, MovesInArrays, MovesTurn
from gamms.text import as_code, shown, shown_as_called
from gamms.typing.game import EdgePlace, Move

Capacity = int | Mapping[int, int | None] | str | None  # as a caller gives it


class Contest(NamedTuple):
    """More agents than places: what a resolver decides.

    Attributes:
        node: the node or edge that all of them want to end on; for an exchange its two nodes, the smaller first.
        places: how many of them may win, at least 1 and fewer than there are.
        movers: their moves, by name.
    """

    node: int | EdgePlace | tuple[int, int]
    places: int
    movers: tuple[Move, ...]


Resolver = Callable[[Contest, Any], Iterable[str | Move]]  # called with the contest and the `gamms.Context`


class Conflicts:
    """The conflicts of a game, and how they are resolved; set as `ctx.game.conflicts`.

    The capacity of a node counts the agents that stay there and those that come. An agent that stays keeps its place,
    so there are as many places for those that come as the capacity leaves; where more want to come, there is a contest,
    and the losers stay where they are. An agent that leaves makes room in the same turn: a chain of agents moves up, a
    full circle turns. A node that more agents stay on than it takes is closed until fewer stay than it takes.

    Args:
        capacity: how many; for each node by a mapping from node ids, or by the name of a node attribute that is read
            in every turn. None, a node that is not in the mapping, or one without the attribute: any number.
            0 closes a single node to agents that are not on it.
        among: "all" agents on the ground count, or only those of one "team", each by itself (None is a team, too).
        edge_capacity: how many agents may end a turn on an edge, in games by metres, or be on it at any time where they
            decide at arrivals: a number, or by edge ids or an attribute of edges, as for nodes. Each direction of a
            street is an edge of its own. An agent that is on the edge already keeps its place.
        allow_swaps: whether two agents may exchange nodes. If not, the winner of the contest decides: those that go
            its way may, those that come towards it stay (and may then be in the way). Only start and end matter, not
            where paths of several edges cross; a path that ends where it began counts as staying. With `among="team"`,
            members of different teams may exchange nodes.
        resolve: which agents win: `by_priority(…)`, `at_random()`, `nobody()`, or a function
            `(contest, ctx) -> winners` that gives names or moves of at most `contest.places` of `contest.movers`.

    Attributes:
        allow_swaps: as given.

    Raises:
        BadType, BadValue: an argument that is not one of these.
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
        of_nodes, self._of_edges = _as_limits(capacity, "node"), _as_limits(edge_capacity, "edge")
        self._limits = _both(of_nodes, self._of_edges)
        self._resolve = at_random() if resolve is None else _as_resolver(resolve)
        given = {"capacity": capacity, "among": among, "allow_swaps": allow_swaps, "resolve": self._resolve}
        if edge_capacity is not None:
            given["edge_capacity"] = edge_capacity
        self._given = {name: as_code(value) for name, value in given.items()}
        self.allow_swaps = as_flag(allow_swaps, "allow_swaps")
        self._per_team = per_team = among == "team"
        self._place_of = attrgetter("end", "team") if per_team else attrgetter("end")  # where it counts if it moves
        self._home_of = attrgetter("start", "team") if per_team else attrgetter("start")  # and where if it stays
        self._way_of = attrgetter("start", "end", "team") if per_team else attrgetter("start", "end")

    def __repr__(self) -> str:
        return f"Conflicts({', '.join(f'{name}={value}' for name, value in self._given.items())})"

    def resolve(self, moves: Mapping[str, Move], ctx: Context) -> set[str]:
        """Return the names of the agents that must stay; of those that stay anyway, none.

        First the exchanges of nodes, if they are forbidden, are decided, all at once: a mover goes one way only, so
        that it takes part in one of them, and no new one can arise. Then, in rounds, the nodes with too many: all
        contests of a round are found before one is decided, and no mover is in two, because it has one end. So the
        answer depends on the moves and the context alone, in whatever order they come.

        It ends: every contest has fewer places than movers, so each round but the last turns at least one mover into
        one that stays, none that stays is ever made to move, and there are no more movers than agents. The last round
        has no contest left: no node takes in more than its capacity leaves.

        Raises:
            BadType, BadValue: what the resolver gave, or the capacity in a node attribute, is wrong.
            UnknownName (KeyError): no node has the attribute with the capacities.
        """
        if any(move.legs for move in moves.values()):
            moves = {name: _between_places(move) for name, move in moves.items()}
        stopped = set() if self.allow_swaps else self._stop_swaps(moves.values(), ctx)
        if self._limits is not None:
            self._stop_overflow(moves.values(), stopped, self._limits, ctx)
        return stopped

    @property
    def array_form(self) -> Callable[[MovesTurn, IntArray], BoolArray] | None:
        """The same in arrays, for many games or agents: which have to stay; None: the resolver has no such form."""
        rank: ArrayResolver | None = getattr(self._resolve, "array_form", None)
        is_own = type(self).resolve is not Conflicts.resolve
        return None if rank is None or is_own else partial(self._resolve_in_arrays, partial(self._ranks, rank))

    def _ranks(self, rank: ArrayResolver, turn: MovesTurn, at: IntArray, agents: IntArray) -> IntArray | None:
        """Return the ranks that a resolver has given, one for each of these agents."""
        ranks = rank(turn, at, agents)
        named = f"What the array form of {as_code(self._resolve)} returns, the ranks of agents,"
        return None if ranks is None else as_array(ranks, named, "numbers", agents.shape)

    def _resolve_in_arrays(self, rank: ArrayResolver, turn: MovesTurn, ends: IntArray) -> BoolArray:
        moves, known = MovesInArrays(turn, ends, rank, per_team=self._per_team), self._limits
        if not self.allow_swaps:
            moves.stop_swaps()
        if known is not None:
            limits, least, _ = turn.shared(("capacity", id(known)), lambda: (*self._rows(turn, known), known))
            moves.stop_overflow(limits, least)
        return moves.stays

    def _rows(self, turn: MovesTurn, limits: "_Limits") -> tuple[IntArray | BoolArray, int]:
        """Return the capacities of all nodes, in games by metres of all edges behind them, and the least of these.

        Where none is larger than 1 they are booleans.
        """
        graph, on_edges = turn.columns, self._of_edges
        rows = limits.rows(graph.node_ids, graph.node_attributes)
        if turn.places is not None:
            of_edges = np.full(len(graph.edge_ids), UNLIMITED)
            if on_edges is not None:
                of_edges = on_edges.rows(graph.edge_ids, graph.edge_attributes)
            rows = np.concatenate((rows, of_edges))
        return rows.astype(np.bool_) if rows.max(initial=0) <= 1 else rows, int(rows.min(initial=UNLIMITED))

    def involved(self, starts: Sequence[int], ends: Sequence[int]) -> list[int]:
        """Return which moves, by index, can decide which agents stay; `resolve` answers the same for these alone.

        They are those to a node that too many end on, and those to a node that one of these may have to stay on after
        all, and so forth; where exchanges are forbidden, those to any node that an agent leaves. None if no agent is
        in the way of another. With starts and ends as lists, the other moves need not be made at all.
        """
        # NOTE: whole lists at once and in C: most turns of 1,000 agents cost no more than this.
        least = UNLIMITED if self._limits is None else self._limits.least
        numbers = Counter(ends) if least < len(ends) else Counter()
        if self.allow_swaps and least and len(numbers) in (0, len(ends)):
            return []
        full = {node for node, number in numbers.items() if number > least}
        if self.allow_swaps:
            return _in_the_way(full, numbers, starts, ends)
        left = {start for start, end in zip(starts, ends, strict=True) if start != end}
        if not full and not _some_exchange(starts, ends, left):
            return []
        return _to(full | left, ends)

    def _stop_swaps(self, moves: Iterable[Move], ctx: Context) -> set[str]:
        """Return the agents that have to stay so that no two exchange nodes."""
        by_way: dict[Any, list[Move]] = defaultdict(list)
        for move in moves:
            by_way[self._way_of(move)].append(move)
        contests = []
        for way, ahead in by_way.items():
            start, end, *team = way
            if (
                isinstance(start, int)
                and isinstance(end, int)
                and start < end
                and (oncoming := by_way.get((end, start, *team)))
            ):
                contests.append(Contest((start, end), 1, tuple(sorted((*ahead, *oncoming), key=_name_of))))
        stopped = set()
        for contest in sorted(contests, key=_rank_of):
            winners = _winners_of(contest, self._resolve, ctx)
            ways = {mover.start for mover in contest.movers if mover.agent in winners}
            stopped |= {mover.agent for mover in contest.movers if mover.start not in ways}  # those the other way
        return stopped

    def _stop_overflow(self, moves: Iterable[Move], stopped: set[str], limits: "_Limits", ctx: Context) -> None:
        """Add to `stopped` the agents that have to stay so that no node takes in more than it has places for."""
        coming: dict[Any, list[Move]] = defaultdict(list)  # place -> the moves to it; a node, or a node and a team
        staying: Counter[Any] = Counter()  # place -> how many agents stay there
        for move in moves:
            if move.start == move.end or move.agent in stopped:
                staying[self._home_of(move)] += 1
            else:
                coming[self._place_of(move)].append(move)
        limit_of = limits.on(ctx.graph.graph)
        places = [place for place, movers in coming.items() if len(movers) + staying.get(place, 0) > limits.least]
        while places:
            losers, contests = _too_many(places, coming, staying, limit_of)
            for place, contest in contests:
                winners = _winners_of(contest, self._resolve, ctx)
                coming[place] = [mover for mover in contest.movers if mover.agent in winners]
                losers += [mover for mover in contest.movers if mover.agent not in winners]
            stopped.update(loser.agent for loser in losers)
            homes = list(map(self._home_of, losers))  # which this may make too full
            staying.update(homes)
            places = list(dict.fromkeys(homes))


def _between_places(move: Move) -> Move:
    """Return a move from where it begins to where it ends, which may be edges, as conflicts compare it."""
    start, end = move.places
    return move._replace(start=cast("int", start), end=cast("int", end))


def _too_many(
    places: Iterable[Any], coming: dict[Any, list[Move]], staying: Counter[Any], limit_of: Callable[[int], int]
) -> tuple[list[Move], list[tuple[Any, Contest]]]:
    """Return the moves to these places that are full, and the contests, in the order of the nodes."""
    turned_away, contests = [], []
    for place in places:
        movers = coming.get(place)
        if movers:
            node = movers[0].end
            free = limit_of(node) - staying.get(place, 0)
            if free <= 0:  # there is nothing to win
                turned_away += movers
                coming[place] = []
            elif len(movers) > free:
                contests.append((place, Contest(node, free, tuple(sorted(movers, key=_name_of)))))
    return turned_away, sorted(contests, key=lambda pair: _rank_of(pair[1]))


def _in_the_way(full: set[int], numbers: Counter[int], starts: Sequence[int], ends: Sequence[int]) -> list[int]:
    """Return which moves end on a full node, or on one that such a move leaves, and so forth; by index, ascending.

    `numbers` has how many moves end on a node.
    """
    nodes, more, found = set[int](), full, []
    while more:
        nodes |= more
        found = _to(nodes, ends)
        more = numbers.keys() & {starts[i] for i in found} - nodes
    return found


def _to(nodes: set[int], ends: Sequence[int]) -> list[int]:
    """Return which moves end on one of the nodes, by index."""
    return list(compress(range(len(ends)), map(nodes.__contains__, ends)))


def _some_exchange(starts: Sequence[int], ends: Sequence[int], left: set[int]) -> bool:
    """Whether two exchange nodes; only an agent that goes to a node that another leaves can."""
    ways = {(start, end) for start, end in zip(starts, ends, strict=True) if end in left and start != end}
    return any((end, start) in ways for start, end in ways)


_name_of = attrgetter("agent")


def _rank_of(contest: Contest) -> tuple[bool, Any, str]:
    """Return the rank by which contests are decided, so that a resolver with draws of its own repeats them."""
    return (isinstance(contest.node, EdgePlace), contest.node, contest.movers[0].agent)


# -- resolvers ---------------------------------------------------------------------------------------------------------


@shown_as_called
def by_priority(teams_or_key: Sequence[Hashable] | Callable[[BaseAgent], Any]) -> Resolver:
    """Make a resolver by which those that come first win; the names decide between equals.

    Args:
        teams_or_key: the teams, the first to win first. Or a function that is called with an agent: those with the
            smallest values win.

    Raises:
        BadType: neither a list of teams nor a function. While resolving: values that cannot be compared.
        BadValue: no team at all, or one twice.
        MissingKey (KeyError): while resolving, an agent of a team that is not in the list.
    """
    if callable(teams_or_key):
        rank_of, in_arrays = _by_key(teams_or_key), None
    elif isinstance(teams_or_key, (str, bytes)) or not isinstance(teams_or_key, Sequence):
        raise BadType(
            "by_priority needs a list of teams, the first to win first, or a function of an agent, "
            f"not {shown(teams_or_key)} ({type(teams_or_key).__name__})."
        )
    else:
        rank_of = _by_team(list(teams_or_key))
        in_arrays = _by_team_in_arrays(list(teams_or_key))

    def by_priority(contest: Contest, ctx: Context) -> list[Move]:
        ranks = [rank_of(mover, ctx) for mover in contest.movers]
        try:
            order = sorted(range(len(ranks)), key=ranks.__getitem__)  # of equals those that come first: by name
        except TypeError:
            ranked = ", ".join(f"{one.agent}: {shown(rank)}" for one, rank in zip(contest.movers, ranks, strict=True))
            raise BadType(f"by_priority cannot compare what its key gave for {ranked}.") from None
        return [contest.movers[number] for number in order[: contest.places]]

    return _with_form(by_priority, in_arrays)


@shown_as_called
def at_random() -> Resolver:
    """Make a resolver that draws a number for each agent in every turn; the smallest win.

    The draw follows from the seed of the context, the turn and the agent's name alone. So neither other agents, other
    draws nor the order of contests change it, and an agent in two contests of a turn keeps its number.
    """

    def at_random(contest: Contest, ctx: Context) -> list[Move]:
        movers = contest.movers
        purpose = kernels.purpose_key(ctx.seed, "conflicts")
        draws = kernels.draw_bits_each(purpose, (mover.agent for mover in movers), ctx.game.turn)
        order = sorted(range(len(movers)), key=draws.__getitem__)
        return [movers[number] for number in order[: contest.places]]

    def in_arrays(turn: MovesTurn, at: IntArray, agents: IntArray) -> BitArray:
        return turn.draw_bits(at, turn.roster.keys[agents], "conflicts")

    return _with_form(at_random, in_arrays)


@shown_as_called
def nobody() -> Resolver:
    """Make a resolver by which no agent wins: where too many want to go, all stay."""

    def nobody(_contest: Contest, _ctx: Context) -> tuple[Move, ...]:
        return ()

    return _with_form(nobody, lambda *_: None)


def _with_form(resolver: Resolver, form: ArrayResolver | None) -> Resolver:
    resolver.__dict__["array_form"] = form
    return resolver


_FACTORIES = (by_priority, at_random, nobody)


def _as_resolver(resolve: object) -> Resolver:
    """Check what a caller gave as resolver."""
    for factory in _FACTORIES:
        if resolve is factory:
            raise BadType(f"resolve={factory.__name__} only makes a resolver: call it, as in {factory.__name__}(…).")
    if not callable(resolve):
        raise BadType(f"resolve must be a function (contest, ctx) -> winners, not {shown(resolve)}.")
    return cast("Resolver", resolve)  # what it takes and gives shows when it is called


def _winners_of(contest: Contest, resolve: Resolver, ctx: Context) -> set[str]:
    """Return the names of the winners by a resolver, checked."""
    answer: object = resolve(contest, ctx)
    if isinstance(answer, (str, Move)) or not isinstance(answer, Iterable):
        form = "must give a list of the winners, names or moves, not"
        raise BadType(f"{_asked(resolve, contest)} {form} {shown(answer)}.")
    winners, names = set[str](), [mover.agent for mover in contest.movers]
    for one in answer:
        winner = one.agent if isinstance(one, Move) else one
        if not isinstance(winner, str):
            raise BadType(f"{_asked(resolve, contest)} must name winners or give their moves, not {shown(winner)}.")
        winners.add(winner)
    for winner in sorted(winners.difference(names)):
        hint = nearest(winner, names)
        raise BadValue(f"{_asked(resolve, contest)} let {shown(winner)} win, not one of {names}.{hint}")
    if len(winners) > contest.places:
        few = f"contest.places is {contest.places}"
        raise BadValue(f"{_asked(resolve, contest)} let {len(winners)} win, {sorted(winners)}, but {few}.")
    return winners


def _asked(resolve: Resolver, contest: Contest) -> str:
    what = "the exchange of nodes" if isinstance(contest.node, tuple) else "node"
    what = "the place" if isinstance(contest.node, EdgePlace) else what
    return f"The resolver {getattr(resolve, '__name__', repr(resolve))!r}, asked about {what} {contest.node},"


def _by_key(key: Callable[[BaseAgent], Any]) -> Callable[[Move, Context], Any]:
    return lambda mover, ctx: key(ctx.agent.get_agent(mover.agent))


def _by_team(teams: list[Hashable]) -> Callable[[Move, Context], Any]:
    """Return the function that ranks a move by its team."""
    ranks: dict[Any, int] = {as_key(team, "A team"): rank for rank, team in enumerate(teams)}
    for team in ranks:
        if teams.count(team) > 1:
            raise BadValue(f"by_priority lists team {shown(team)} twice: {shown(teams)}.")
    if not ranks:
        raise BadValue("by_priority needs at least one team.")

    def rank_of(mover: Move, _: Context) -> int:
        if mover.team not in ranks:
            raise _no_place_for(mover.agent, mover.team, teams)
        return ranks[mover.team]

    return rank_of


def _by_team_in_arrays(teams: list[Hashable]) -> ArrayResolver:
    def rank(turn: MovesTurn, _: IntArray, agents: IntArray) -> IntArray:
        roster = turn.roster
        ranks = np.array([teams.index(team) if team in teams else -1 for team in roster.teams])
        found: IntArray = ranks[roster.team_of[agents]]
        for agent in agents[found < 0].tolist():
            raise _no_place_for(roster.names[agent], roster.teams[roster.team_of[agent]], teams)
        return found

    return rank


def _no_place_for(agent: str, team: Hashable, teams: list[Hashable]) -> MissingKey:
    return MissingKey(
        f"by_priority has no place for team {shown(team)} of agent {agent!r}. Put it into the list {shown(teams)}."
    )


# -- the capacity of nodes ---------------------------------------------------------------------------------------------


_Attributes = Mapping[str, Mapping[int, Any]]  # name -> row -> value


class _Limits(NamedTuple):
    """The capacity of nodes, of edges, or of both.

    Attributes:
        least: none has a smaller one, so that for fewer agents none is looked at.
        on: gives the function from an id to its capacity in this turn; `UNLIMITED` where there is none.
        rows: gives the capacities of all nodes, or edges, of a graph that stays as it is, by ids and attributes.
    """

    least: int
    on: Callable[[Graph], Callable[[Any], int]]
    rows: Callable[[IntArray, _Attributes], IntArray]


def _both(nodes: _Limits | None, edges: _Limits | None) -> _Limits | None:
    """Return the limits of nodes by their ids, and of edges by their `EdgePlace`."""
    if nodes is None and edges is None:
        return None
    unlimited = _Limits(UNLIMITED, lambda _: lambda _: UNLIMITED, partial(_rows_of_ids, {}))
    of_nodes, of_edges = nodes or unlimited, edges or unlimited

    def on(graph: Graph) -> Callable[[Any], int]:
        of_node, of_edge = of_nodes.on(graph), of_edges.on(graph)
        return lambda place: of_edge(place.edge) if isinstance(place, EdgePlace) else of_node(place)

    return _Limits(min(of_nodes.least, of_edges.least), on, of_nodes.rows)


def _in_attribute(name: str, kind: str) -> _Limits:
    """Return capacities in an attribute of the nodes or edges, read in each turn: it may change."""
    is_known = False

    def on(graph: Graph) -> Callable[[Any], int]:
        nonlocal is_known
        attributes = graph.node_attributes if kind == "node" else graph.edge_attributes
        ids = graph.get_nodes if kind == "node" else graph.get_edges
        if not is_known and not any(name in attributes(id) for id in ids()):
            # A misspelt attribute would mean no limit anywhere, without a word.
            raise UnknownName(f"{kind} attribute", name, {one: None for id in ids() for one in attributes(id)})
        is_known = True
        return lambda one: _as_limit(attributes(one).get(name), f"Attribute {name!r} of {kind} {one}")

    def rows(ids: IntArray, attributes: _Attributes) -> IntArray:
        as_known(name, f"{kind} attribute", attributes)
        limits = np.full(len(ids), UNLIMITED)
        for row, value in attributes[name].items():
            limits[row] = _as_limit(value, f"Attribute {name!r} of {kind} {ids[row]}")
        return limits

    return _Limits(0, on, rows)


def _as_limits(capacity: object, kind: str) -> _Limits | None:
    """Check what a caller gave as the capacity of each "node" or "edge"; None if there is none."""
    what = "capacity" if kind == "node" else "edge_capacity"
    if capacity is None:
        return None
    if isinstance(capacity, str):
        if not capacity:
            raise BadValue(f"{what} must be the name of an attribute of {kind}s, not an empty string.")
        return _in_attribute(capacity, kind)
    if isinstance(capacity, Mapping):
        pairs = ((as_int(node, f"The id of a {kind} in {what}"), value) for node, value in capacity.items())
        known = {node: _as_limit(value, f"{what} of {kind} {node}") for node, value in pairs}
        least = min(known.values(), default=UNLIMITED)
        return _Limits(least, lambda _: lambda node: known.get(node, UNLIMITED), partial(_rows_of_ids, known))
    try:
        number = as_int(capacity, what)
    except BadType:
        raise BadType(
            f"{what} must be an integer, a mapping from {kind} ids to integers, the name of an attribute of {kind}s, "
            f"or None, not {shown(capacity)} ({type(capacity).__name__})."
        ) from None
    if number < 1:
        raise BadValue(f"{what} must be at least 1, not {number}: no agent could move. Use None for no limit.")
    return _Limits(number, lambda _: lambda _: number, lambda ids, _: np.full(len(ids), number))


def _rows_of_ids(known: Mapping[int, int], ids: IntArray, _: _Attributes) -> IntArray:
    return np.array([known.get(one, UNLIMITED) for one in ids.tolist()], np.int64)


def _as_limit(value: object, name: str) -> int:
    if value is None:
        return UNLIMITED
    # NOTE: the plain int is checked in line: this is asked for every agent that moves (an attribute, 1,000 agents).
    number = value if type(value) is int else as_int(value, name)
    if number < 0:
        raise BadValue(f"{name} must not be negative, not {number}. 0 closes a node, None opens it to any number.")
    return number
