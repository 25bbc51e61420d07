"""Conflicts of moves: too many agents on a node, or two that exchange nodes, and which of them have to stay."""

from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import compress
from operator import attrgetter
from sys import maxsize
from typing import Any, Protocol

from gamms.arguments import as_int, as_text
from gamms.context import Context
from gamms.errors import BadType, BadValue, UnknownName, nearest
from gamms.graph import Graph
from gamms.rules.resolvers import Contest, Resolver, as_resolver, at_random, winners_of
from gamms.text import shown
from gamms.typing.game import Move

UNLIMITED = maxsize  # no graph has so many agents

Capacity = int | Mapping[int, int | None] | str | None  # as a caller gives it

_AMONG = ("all", "team")


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
        allow_swaps: whether two agents may exchange nodes. If not, the winner of the contest decides: those that go
            its way may, those that come towards it stay (and may then be in the way). Only start and end matter, not
            where paths of several edges cross; a path that ends where it began counts as staying. With `among="team"`,
            members of different teams may exchange nodes.
        resolve: which agents win: `by_priority(…)`, `at_random()`, `nobody()`, or a function
            `(contest, ctx) -> winners` that gives names or moves of at most `contest.places` of `contest.movers`.

    Raises:
        BadType, BadValue: an argument that is not one of these.
    """

    def __init__(
        self,
        capacity: Capacity = 1,
        among: str = "all",
        *,
        allow_swaps: bool = True,
        resolve: Resolver | None = None,
    ) -> None:
        if as_text(among, "among") not in _AMONG:
            raise BadValue(f"among must be 'all' or 'team', not {shown(among)}.{nearest(among, _AMONG)}")
        if not isinstance(allow_swaps, bool):
            raise BadType(f"allow_swaps must be True or False, not {shown(allow_swaps)}.")
        self._limits = _as_limits(capacity)
        name = "at_random" if resolve is None else getattr(resolve, "__name__", shown(resolve))
        self._given = {"capacity": repr(capacity), "among": repr(among), "allow_swaps": allow_swaps, "resolve": name}
        self._resolve = at_random() if resolve is None else as_resolver(resolve)
        self._allow_swaps = allow_swaps
        per_team = among == "team"
        self._place_of = attrgetter("end", "team") if per_team else attrgetter("end")  # where it counts if it moves
        self._home_of = attrgetter("start", "team") if per_team else attrgetter("start")  # and where if it stays
        self._way_of = attrgetter("start", "end", "team") if per_team else attrgetter("start", "end")

    def __repr__(self) -> str:
        """Show the arguments."""
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
        stopped = set() if self._allow_swaps else self._stop_swaps(moves.values(), ctx)
        if self._limits is not None:
            self._stop_overflow(moves.values(), stopped, self._limits, ctx)
        return stopped

    def involved(self, starts: Sequence[int], ends: Sequence[int]) -> list[int]:
        """Return which moves, by index, can decide which agents stay; `resolve` answers the same for these alone.

        They are those to a node that too many end on, and those to a node that one of these may have to stay on after
        all, and so forth; where exchanges are forbidden, those to any node that an agent leaves. None if no agent is
        in the way of another. With starts and ends as lists, the other moves need not be made at all.
        """
        # NOTE: whole lists at once and in C: most turns of 1,000 agents cost no more than this.
        least = UNLIMITED if self._limits is None else self._limits.least
        numbers = Counter(ends) if least < len(ends) else Counter()
        full = {node for node, number in numbers.items() if number > least}
        if self._allow_swaps:
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
            if start < end and (oncoming := by_way.get((end, start, *team))):
                contests.append(Contest((start, end), 1, tuple(sorted((*ahead, *oncoming), key=_name_of))))
        return {loser.agent for contest in sorted(contests, key=_rank_of) for loser in self._turned_back(contest, ctx)}

    def _turned_back(self, contest: Contest, ctx: Context) -> list[Move]:
        """Return those that do not go the winner's way."""
        winners = winners_of(contest, self._resolve, ctx)
        ways = {mover.start for mover in contest.movers if mover.agent in winners}
        return [mover for mover in contest.movers if mover.start not in ways]

    def _stop_overflow(self, moves: Iterable[Move], stopped: set[str], limits: "_Limits", ctx: Context) -> None:
        """Add to `stopped` the agents that have to stay so that no node takes in more than it has places for."""
        demand = _Demand(moves, stopped, self._place_of, self._home_of)
        limit_of = limits.on(ctx.graph.graph)
        places = demand.wanted_by_more_than(limits.least)
        while places:
            losers, contests = demand.too_many(places, limit_of)
            for place, contest in contests:
                winners = winners_of(contest, self._resolve, ctx)
                demand.coming[place] = [mover for mover in contest.movers if mover.agent in winners]
                losers += [mover for mover in contest.movers if mover.agent not in winners]
            stopped.update(loser.agent for loser in losers)
            places = demand.settle(losers)


class _Demand:
    """The moves to each place, and how many agents stay there; a place is a node, or a node and a team."""

    def __init__(
        self,
        moves: Iterable[Move],
        stopped: set[str],
        place_of: Callable[[Move], Any],
        home_of: Callable[[Move], Any],
    ) -> None:
        self._home_of = home_of
        self.coming: dict[Any, list[Move]] = defaultdict(list)
        self.staying: Counter[Any] = Counter()
        for move in moves:
            if move.start == move.end or move.agent in stopped:
                self.staying[home_of(move)] += 1
            else:
                self.coming[place_of(move)].append(move)

    def wanted_by_more_than(self, number: int) -> list[Any]:
        """Return the places that an agent comes to and that more than `number` agents would end on."""
        staying = self.staying
        return [place for place, movers in self.coming.items() if len(movers) + staying.get(place, 0) > number]

    def too_many(
        self, places: Iterable[Any], limit_of: Callable[[int], int]
    ) -> tuple[list[Move], list[tuple[Any, Contest]]]:
        """Return the moves to these places that find no room at all, and the contests, in the order of the nodes."""
        turned_away, contests = [], []
        for place in places:
            movers = self.coming.get(place)
            if movers:
                node = movers[0].end
                free = limit_of(node) - self.staying.get(place, 0)
                if free <= 0:  # there is nothing to win
                    turned_away += movers
                    self.coming[place] = []
                elif len(movers) > free:
                    contests.append((place, Contest(node, free, tuple(sorted(movers, key=_name_of)))))
        return turned_away, sorted(contests, key=_rank_of_pair)

    def settle(self, losers: Iterable[Move]) -> list[Any]:
        """Let losers stay where they are; return the places that this may make too full."""
        homes = list(map(self._home_of, losers))
        self.staying.update(homes)
        return list(dict.fromkeys(homes))


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


def _rank_of(contest: Contest) -> tuple[Any, str]:
    """Return the rank by which contests are decided, so that a resolver with draws of its own repeats them."""
    return (contest.node, contest.movers[0].agent)


def _rank_of_pair(pair: tuple[Any, Contest]) -> tuple[Any, str]:
    return _rank_of(pair[1])


# -- the capacity of nodes ---------------------------------------------------------------------------------------------


class _Limits(Protocol):
    """The capacity of nodes.

    Attributes:
        least: no node has a smaller one, so that for fewer agents no node is looked at.
    """

    least: int

    def on(self, graph: Graph) -> Callable[[int], int]:
        """Return the function from a node id to its capacity in this turn; `UNLIMITED` where there is none."""


class _Everywhere:
    """The same capacity on every node."""

    def __init__(self, capacity: int) -> None:
        self.least = capacity

    def on(self, _: Graph) -> Callable[[int], int]:
        """Return a function that gives the one number."""
        return lambda _: self.least


class _PerNode:
    """Capacities of some nodes; the others are unlimited."""

    def __init__(self, capacities: Mapping[int, int]) -> None:
        self.least = min(capacities.values(), default=UNLIMITED)
        self._capacities = capacities

    def on(self, _: Graph) -> Callable[[int], int]:
        """Return a function that gives the number of each node."""
        known = self._capacities
        return lambda node: known.get(node, UNLIMITED)


class _PerAttribute:
    """Capacities in an attribute of the nodes, read in each turn: it may change."""

    least = 0

    def __init__(self, name: str) -> None:
        self._name = name
        self._is_known = False

    def on(self, graph: Graph) -> Callable[[int], int]:
        """Return a function that reads the attribute."""
        if not self._is_known:
            self._look_for_it(graph)
            self._is_known = True
        name, attributes = self._name, graph.node_attributes
        return lambda node: _as_limit(attributes(node).get(name), f"Attribute {name!r} of node {node}")

    def _look_for_it(self, graph: Graph) -> None:
        """Find it on at least one node: a misspelt attribute would mean no limit anywhere, without a word."""
        seen: dict[str, None] = {}
        for node in graph.get_nodes():
            attributes = graph.node_attributes(node)
            if self._name in attributes:
                return
            seen.update(dict.fromkeys(attributes))
        raise UnknownName("node attribute", self._name, seen)


def _as_limits(capacity: object) -> _Limits | None:
    """Check what a caller gave as capacity; None if there is none.

    Raises:
        BadType: neither a number, nor a mapping from nodes to numbers, nor the name of an attribute, nor None.
        BadValue: a number too small: below 1 everywhere, below 0 on one node.
    """
    if capacity is None:
        return None
    if isinstance(capacity, str):
        if not capacity:
            raise BadValue("capacity must be the name of a node attribute, not an empty string.")
        return _PerAttribute(capacity)
    if isinstance(capacity, Mapping):
        pairs = ((as_int(node, "A node in capacity"), value) for node, value in capacity.items())
        return _PerNode({node: _as_limit(value, f"capacity of node {node}") for node, value in pairs})
    try:
        number = as_int(capacity, "capacity")
    except BadType:
        raise BadType(
            "capacity must be an integer, a mapping from node ids to integers, the name of a node attribute, or None, "
            f"not {shown(capacity)} ({type(capacity).__name__})."
        ) from None
    if number < 1:
        raise BadValue(f"capacity must be at least 1, not {number}: no agent could move. Use None for no limit.")
    return _Everywhere(number)


def _as_limit(value: object, name: str) -> int:
    if value is None:
        return UNLIMITED
    # NOTE: the plain int is checked in line: this is asked for every agent that moves (an attribute, 1,000 agents).
    number = value if type(value) is int else as_int(value, name)
    if number < 0:
        raise BadValue(f"{name} must not be negative, not {number}. 0 closes a node, None opens it to any number.")
    return number
