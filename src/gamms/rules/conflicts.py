"""Who has to stay where moves get in each other's way: too many on a node, or two that exchange nodes."""

from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import compress
from operator import attrgetter
from typing import Any

from gamms.arguments import as_text
from gamms.errors import BadType, BadValue, nearest
from gamms.rules.capacity import UNLIMITED, Capacity, ILimits, as_limits
from gamms.rules.resolvers import Contest, Resolver, as_resolver, at_random, winners_of
from gamms.text import shown
from gamms.typing.game import IConflicts, Move

_AMONG = ("all", "team")


class Conflicts(IConflicts):
    """The conflicts of a game, and who wins them; set as `ctx.game.conflicts`.

    How many may end a turn on a node counts those who stay there and those who come. Who stays put keeps its place, so
    there are as many places for those who come as the capacity leaves; where more want to come, there is a contest,
    and the losers stay where they are. Who leaves makes room in the same turn: a chain of agents moves up, a full
    circle turns. A node that more agents stay on than it takes is entered by nobody until fewer stay than it takes.

    Args:
        capacity: how many; for each node by a mapping from node ids, or by the name of a node attribute that is read
            in every turn. None, a node that is not in the mapping, or one without the attribute: any number.
            0 closes a single node to those who are not on it.
        among: "all" agents on the ground count, or only those of one "team", each by itself (None is a team, too).
        allow_swaps: whether two agents may exchange nodes. If not, the winner of the contest decides: those who go
            its way may, those who come towards it stay (and may then be in the way). Only start and end matter, not
            where paths of several edges cross; a path that ends where it began counts as staying. With `among="team"`,
            members of different teams may exchange nodes.
        resolve: who wins: `by_priority(…)`, `at_random()`, `nobody()`, or a function `(contest, ctx) -> winners` that
            gives names or moves of at most `contest.places` of `contest.movers`.

    Raises:
        BadType, BadValue: an argument that is none of these.
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
        self._limits = as_limits(capacity)
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

    def resolve(self, moves: Mapping[str, Move], ctx: Any) -> set[str]:
        """The names of the agents that must stay; of those who stay anyway, none.

        First the exchanges of nodes, if they are forbidden, are decided, all at once: a mover goes one way only, so
        that it takes part in one of them, and no new one can arise. Then, in rounds, the nodes with too many: all
        contests of a round are found before one is decided, and no mover is in two, because it has one end. So the
        answer depends on the moves and the context alone, in whatever order they come.

        It ends: every contest has fewer places than movers, so each round but the last turns at least one mover into
        one who stays, nobody who stays is ever made to move, and there are no more movers than agents. The last round
        has no contest left: no node takes in more than its capacity leaves.

        Raises:
            BadType, BadValue: what the resolver gave, or the capacity a node attribute says, is wrong.
            UnknownName (KeyError): no node has the attribute with the capacities.
        """
        stopped = set() if self._allow_swaps else self._stop_swaps(moves.values(), ctx)
        if self._limits is not None:
            self._stop_crowds(moves.values(), stopped, self._limits, ctx)
        return stopped

    def involved(self, starts: Sequence[int], ends: Sequence[int]) -> list[int]:
        """Which of the moves, by their number, can decide who has to stay; `resolve` answers the same for these alone.

        They are those to a node that too many end on, and those to a node that one of these may have to stay on after
        all, and so forth; where exchanges are forbidden, those to any node that somebody leaves. None if nobody is in
        anybody's way. Whoever has starts and ends as lists need not make the other moves at all.
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

    def _stop_swaps(self, moves: Iterable[Move], ctx: Any) -> set[str]:
        """Who has to stay so that no two exchange nodes."""
        by_way: dict[Any, list[Move]] = defaultdict(list)
        for move in moves:
            by_way[self._way_of(move)].append(move)
        contests = []
        for way, ahead in by_way.items():
            start, end, *team = way
            if start < end and (oncoming := by_way.get((end, start, *team))):
                contests.append(Contest((start, end), 1, tuple(sorted((*ahead, *oncoming), key=_name_of))))
        return {loser.agent for contest in sorted(contests, key=_rank_of) for loser in self._turned_back(contest, ctx)}

    def _turned_back(self, contest: Contest, ctx: Any) -> list[Move]:
        """Those who do not go the winner's way."""
        winners = winners_of(contest, self._resolve, ctx)
        ways = {mover.start for mover in contest.movers if mover.agent in winners}
        return [mover for mover in contest.movers if mover.start not in ways]

    def _stop_crowds(self, moves: Iterable[Move], stopped: set[str], limits: ILimits, ctx: Any) -> None:
        """Add to `stopped` who has to stay so that no node takes in more than it has places for."""
        crowd = _Crowd(moves, stopped, self._place_of, self._home_of)
        limit_of = limits.on(ctx.graph.graph)
        places = crowd.wanted_by_more_than(limits.least)
        while places:
            losers, contests = crowd.too_many(places, limit_of)
            for place, contest in contests:
                winners = winners_of(contest, self._resolve, ctx)
                crowd.coming[place] = [mover for mover in contest.movers if mover.agent in winners]
                losers += [mover for mover in contest.movers if mover.agent not in winners]
            stopped.update(loser.agent for loser in losers)
            places = crowd.settle(losers)


class _Crowd:
    """Who comes to each place, and how many stay there; a place is a node, or a node and a team."""

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
        """The places that somebody comes to and that more than `number` agents would end on."""
        staying = self.staying
        return [place for place, movers in self.coming.items() if len(movers) + staying.get(place, 0) > number]

    def too_many(
        self, places: Iterable[Any], limit_of: Callable[[int], int]
    ) -> tuple[list[Move], list[tuple[Any, Contest]]]:
        """Of those who come to these places: who finds no room at all, and the contests, in the order of the nodes."""
        turned_away, contests = [], []
        for place in places:
            movers = self.coming.get(place)
            if movers:
                node = movers[0].end
                free = limit_of(node) - self.staying.get(place, 0)
                if free <= 0:  # there is nothing to win, so nobody is asked
                    turned_away += movers
                    self.coming[place] = []
                elif len(movers) > free:
                    contests.append((place, Contest(node, free, tuple(sorted(movers, key=_name_of)))))
        return turned_away, sorted(contests, key=_rank_of_pair)

    def settle(self, losers: Iterable[Move]) -> list[Any]:
        """Let losers stay where they are; the places that this may make too full."""
        homes = list(map(self._home_of, losers))
        self.staying.update(homes)
        return list(dict.fromkeys(homes))


def _in_the_way(full: set[int], numbers: Counter[int], starts: Sequence[int], ends: Sequence[int]) -> list[int]:
    """Which moves end on a full node, or on one that such a move leaves, and so forth; by their number, ascending.

    `numbers` tells how many moves end on a node.
    """
    nodes, more, found = set[int](), full, []
    while more:
        nodes |= more
        found = _to(nodes, ends)
        more = numbers.keys() & {starts[i] for i in found} - nodes
    return found


def _to(nodes: set[int], ends: Sequence[int]) -> list[int]:
    """Which moves end on one of the nodes, by their number."""
    return list(compress(range(len(ends)), map(nodes.__contains__, ends)))


def _some_exchange(starts: Sequence[int], ends: Sequence[int], left: set[int]) -> bool:
    """Whether two exchange nodes; only who goes where somebody left can."""
    ways = {(start, end) for start, end in zip(starts, ends, strict=True) if end in left and start != end}
    return any((end, start) in ways for start, end in ways)


_name_of = attrgetter("agent")


def _rank_of(contest: Contest) -> tuple[Any, str]:
    """Contests are decided in this order, so that a resolver that draws by itself draws the same every time."""
    return (contest.node, contest.movers[0].agent)


def _rank_of_pair(pair: tuple[Any, Contest]) -> tuple[Any, str]:
    return _rank_of(pair[1])
