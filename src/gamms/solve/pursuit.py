"""Pursuit in turns with full sight: exact play on large maps, as a table over the places of all agents.

A position is a *formation* of the pursuers, the place of the evader, and the side to move. A place is a node, and for
agents that obey turn restrictions a state of traffic, the edge by which they came. Pursuers on the same roads are
interchangeable, so that a formation is a multiset of places; else it has a place of each. `PursuitTable` has an
outcome for each position, which `gamms.core.pursuit` finds backward from captures and escapes. `pursuit` makes it for a
graph, `recognize_pursuit` for a scenario with these rules, which `solve` then need not explore.
"""

from collections.abc import Hashable, Iterable, Mapping, Sequence
from functools import cached_property, partial
from math import comb, inf, prod
from typing import Any, Literal, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from gamms import kernels
from gamms.arguments import as_choice, as_count, as_known, as_mapping, explain_call_errors
from gamms.context import Context
from gamms.core import pursuit as core
from gamms.errors import BadType, BadValue, TooLarge, UnknownName
from gamms.game import Game
from gamms.game.array_functions.declarations import array_strategy
from gamms.game.array_functions.view import ArrayView, find_driven_edges
from gamms.game.block.columns import get_mode
from gamms.game.block.in_core import ONE_THAT_SHOWS, ContactOptions
from gamms.ir.graph import (
    FloatArray,
    GraphColumns,
    IntArray,
    as_node_ids,
    find_usable_edges,
    list_forbidden_paths,
    list_labels,
    split_mode,
)
from gamms.ir.obstacles import BoolArray
from gamms.ir.sensor_results import AgentLook
from gamms.limits import refuse_above
from gamms.solve.solution import Choice, Reward, Solution, solve_table
from gamms.solve.stages import Bound
from gamms.solve.table import Table, explore
from gamms.solve.worlds import GameSetup, TurnTerms, name_shipped_rule
from gamms.strategies import stay
from gamms.text import shown
from gamms.typing import SensorType
from gamms.typing.game import Strategy
from gamms.typing.routes import TurnRoutes

PURSUERS, EVADER = core.SIDES
CAUGHT, ESCAPED = core.ENDS
ROLES = ("pursuers", "evader")
_MOST_POSITIONS = 1 << 31  # numbers of positions are 32-bit integers
_CHUNK = 1 << 20  # moves of formations that are listed at once

Node = Hashable  # an id, or a label of a networkx graph


class Traffic(NamedTuple):
    """The edges by which agents that obey turn restrictions come to their places.

    Attributes:
        columns: the map of their mode.
        routes: the states of traffic, which are the places.
        edges: (places,) the ids of the edges; -1: an agent begins there.
    """

    columns: GraphColumns
    routes: TurnRoutes
    edges: IntArray

    def find_place(self, row: int, driven: Sequence[int]) -> int:
        """Return the place of an agent on a node, given the ids of the edges by which it has come."""
        ids = np.array(driven, np.int64)
        rows: list[int] = kernels.find_rows(self.columns.edge_ids, ids, self.columns.edge_order).tolist()
        return self.routes.find_vertex(row, rows)


class Roads(NamedTuple):
    """A graph for pursuit.

    Attributes:
        labels: (nodes,) the ids or labels of the nodes.
        offsets: (places + 1,) where the moves from each place begin in `ends`.
        ends: (moves,) places, ascending from each place; staying is a move, too.
        nodes: (places,) the rows of their nodes. Without turn restrictions, the places are the nodes.
        traffic: the edges by which agents come, if they obey turn restrictions.
    """

    labels: list[Any]
    offsets: IntArray
    ends: IntArray
    nodes: IntArray
    traffic: Traffic | None = None


def find_roads(graph: object) -> Roads:
    """Return the roads of a networkx graph or of `ctx.graph`.

    Raises:
        BadType: it is neither.
        BadValue: it has no nodes.
    """
    columns: Any = getattr(graph, "columns", None)
    edges: Any = getattr(graph, "edges", None)
    if callable(columns):
        return _read_roads(columns())
    if callable(edges) and hasattr(graph, "is_directed"):
        known: Any = graph
        names = list(known)
        row_of = {name: row for row, name in enumerate(names)}
        ends = np.array([(row_of[source], row_of[target]) for source, target in edges()], np.int64).reshape(-1, 2)
        both = ends if known.is_directed() else np.concatenate((ends, ends[:, ::-1]))
        return _make_roads(names, both[:, 0], both[:, 1], np.arange(len(names)))
    raise BadType(f"A pursuit needs a networkx graph or ctx.graph, not {shown(graph)}.")


def _read_roads(columns: GraphColumns) -> Roads:
    """Return the roads of a map."""
    names = columns.node_ids.tolist()
    return _make_roads(names, columns.sources, columns.targets, np.arange(len(names)))


def _roads_of_mode(columns: GraphColumns, mode: str | None) -> Roads:
    """Return the roads of agents of a mode on its map; None: agents without a mode."""
    attribute, obeys_turns = (mode, False) if mode is None else split_mode(mode)
    if attribute is None or not obeys_turns:
        return _read_roads(columns)
    paths = list_forbidden_paths(columns).get(attribute, [])
    routes = TurnRoutes(columns, columns.lengths, find_usable_edges(columns, attribute), paths)
    begins, ends, rows, nodes = routes.list_arcs()
    edges = np.full(len(nodes), -1)
    edges[ends] = columns.edge_ids[rows]
    return _make_roads(columns.node_ids.tolist(), begins, ends, nodes)._replace(traffic=Traffic(columns, routes, edges))


def _make_roads(names: list[Any], begins: IntArray, ends: IntArray, nodes: IntArray) -> Roads:
    """Return the roads of a graph with these moves between places, whose nodes are given by row."""
    if not names:
        raise BadValue("The graph has no nodes: a pursuit needs one at least.")
    places = len(nodes)
    own = np.arange(places)
    keys = np.unique(np.concatenate((begins * places + ends, own * places + own)))
    starts, finishes = np.divmod(keys, places)
    offsets, _ = kernels.group_rows(starts, places)
    return Roads(names, offsets, finishes, nodes)


class PursuitTable:
    """How each position ends under exact play, and after how many moves.

    A turn is a move of both sides. The evader is caught as soon as it shares a node with a pursuer. It escapes if it is
    on an exit at the end of a turn, and not caught.

    Args:
        roads: the graph of each pursuer, then that of the evader, all with the same nodes; equal ones are one object.
        exits: rows of nodes.
        first: the side that moves first in a turn.

    Attributes:
        fleet: the graph of each pursuer.
        roads: that of the evader.
        exits: (nodes,) whether the evader escapes there.
        codes: (2, formations, places of the evader) by side to move; see `core.pursuit.Positions`.

    Raises:
        TooLarge: the positions would take too much memory.
    """

    def __init__(self, roads: Sequence[Roads], exits: Sequence[int], first: int) -> None:
        *self.fleet, self.roads = roads
        self.pursuers = len(self.fleet)
        self._are_alike = all(one is self.fleet[0] for one in self.fleet)
        self.first = first
        self.exits = np.zeros(len(self.roads.labels), np.bool_)
        self.exits[[*exits]] = True
        self._sizes = [len(one.nodes) for one in self.fleet]
        self._row_of = {label: row for row, label in enumerate(self.roads.labels)}
        self._refuse_large()
        ranks = [
            [self._compute_rank(place, number) for place in range(size)] for number, size in enumerate(self._sizes)
        ]
        self._ranks = [np.array(own, np.int64) for own in ranks]  # of each pursuer: (places,), see `_number_formations`
        self.codes = self._find(self.list_formations())

    def list_formations(self) -> IntArray:
        """Return all formations, (formations, pursuers), as places, in the order of their numbers."""
        return _list_formations(self._sizes[0], self.pursuers) if self._are_alike else _list_sequences(self._sizes)

    def _compute_rank(self, place: int, number: int) -> int:
        """Return what a pursuer at a place, the `number`-th, adds to the number of a formation."""
        if self._are_alike:
            return comb(place + number, number + 1)
        return place * prod(self._sizes[:number])

    def _sort(self, places: Any) -> IntArray:
        """Return the places of formations, (…, pursuers), in the order in which formations list them."""
        found: IntArray = np.sort(places, axis=-1) if self._are_alike else np.asarray(places)
        return found

    def __len__(self) -> int:
        return self.codes.size

    def _refuse_large(self) -> None:
        size = self._sizes[0]
        formations = comb(size + self.pursuers - 1, self.pursuers) if self._are_alike else prod(self._sizes)
        positions = 2 * formations * len(self.roads.nodes)
        degrees = [np.diff(one.offsets) for one in self.fleet]
        moves = self._count_moves(degrees[0].tolist()) if self._are_alike else prod(len(one.ends) for one in self.fleet)
        most = min(moves, formations**2) + prod(int(each.max()) for each in degrees)
        what = f"A pursuit of {self.pursuers} pursuers on {len(self.exits):,} nodes, {positions:,} positions,"
        refuse_above(10.0 * positions + 48.0 * most, what)
        if positions >= _MOST_POSITIONS:
            raise TooLarge(
                f"{what} is too large: {_MOST_POSITIONS:,} are allowed. Take fewer pursuers or a smaller map."
            )

    def _count_moves(self, degrees: Sequence[int]) -> int:
        """Return the number of moves of all formations of pursuers that are alike, given those from each node."""
        moves = [1, *[0] * self.pursuers]  # of all formations with so many pursuers on the nodes so far
        for degree in degrees:
            for number in range(1, self.pursuers + 1):
                moves[number] += degree * moves[number - 1]
        return moves[-1]

    def _find(self, formations: IntArray) -> "np.ndarray[Any, np.dtype[np.int32]]":
        places = len(self.roads.nodes)
        shape = (2, len(formations), places)
        codes = np.zeros(shape, np.int32)
        codes[self.first][:, self.exits[self.roads.nodes]] = ESCAPED
        first, on_node = kernels.group_rows(self.roads.nodes, len(self.exits))  # the places of the evader on each node
        for number, one in enumerate(self.fleet):
            nodes = one.nodes[formations[:, number]]
            rows, met = kernels.expand_ranges(first[nodes], first[nodes + 1])
            codes[:, rows, on_node[met]] = CAUGHT
        begins = np.repeat(np.arange(places), np.diff(self.roads.offsets))
        positions = core.Positions(
            _group_moves(*self._list_team_moves(formations), len(formations)),
            _group_moves(begins, self.roads.ends, places),
            codes.reshape(-1).data,
            np.zeros(codes.size, np.int32).data,
            np.zeros(codes.size // 2, np.int32).data,
        )
        core.find_forced(positions, CAUGHT)
        if self.exits.any():
            core.find_forced(positions, ESCAPED)
        return codes

    def _list_team_moves(self, formations: IntArray) -> tuple[IntArray, IntArray]:
        """Return the formations before and after each joint move, each pair once."""
        degrees = [np.diff(one.offsets)[formations[:, number]] for number, one in enumerate(self.fleet)]
        counts = np.multiply.reduce(degrees)
        parts = np.cumsum(counts) // _CHUNK
        keys = []
        for chunk in np.split(np.arange(len(formations)), np.flatnonzero(np.diff(parts)) + 1):
            before = chunk
            after = np.zeros((len(chunk), 0), np.int64)
            for pursuer, roads in enumerate(self.fleet):
                places = formations[before, pursuer]
                rows, moves = kernels.expand_ranges(roads.offsets[places], roads.offsets[places + 1])
                before = before[rows]
                after = np.column_stack((after[rows], roads.ends[moves]))
            keys.append(np.unique(before * len(formations) + self._number_formations(self._sort(after).T)))
        return np.divmod(np.concatenate(keys), len(formations))

    # -- single positions ---------------------------------------------------------------------------------------

    def find_row(self, node: Node) -> int:
        """Return the row of a node.

        Raises:
            UnknownName (KeyError): it is not on the map.
        """
        try:
            return self._row_of[node]
        except (KeyError, TypeError):
            raise UnknownName("node", node, self._row_of) from None

    def encode_position(self, places: Sequence[int], place: int) -> int:
        """Return the code of a position at the start of a turn.

        Args:
            places: the places of the pursuers.
            place: the place of the evader.
        """
        node = self.roads.nodes[place]
        is_met = any(one.nodes[own] == node for one, own in zip(self.fleet, places, strict=True))
        if is_met or not self.exits[node]:
            return int(self.codes[self.first, self._number_formations(self._sort(places)), place])
        _, [after] = self.find_best(
            self.first, np.array([places]), np.array([place])
        )  # a game begins here, and has not ended
        return int(after) + int(np.sign(after))

    def _get_codes(self, side: int, places: IntArray, place: IntArray) -> IntArray:
        """Return the codes of positions: `places` (…, pursuers), `place` (…)."""
        found: IntArray = self.codes[side, self._number_formations(np.moveaxis(self._sort(places), -1, 0)), place]
        return found

    def _number_formations(self, places: Iterable[Any]) -> Any:  # Any: integers or arrays
        """Return the numbers of formations.

        Args:
            places: the place of each pursuer, sorted: integers, or arrays of one shape; see `_sort`.
        """
        return sum(rank[place] for rank, place in zip(self._ranks, places, strict=True))

    def find_best(self, side: int, places: IntArray, place: IntArray) -> tuple[IntArray, IntArray]:
        """Return the places to which the agents of a side move in exact play, and the codes of the positions after it.

        Pursuers catch the evader as soon as possible, or delay its escape; the evader does the opposite. Among equal
        moves, pursuers take one with the smallest sum of distances to the evader, and the evader one with the largest.
        Further ties go to staying, then to the order of the places.

        Args:
            side: the side to move.
            places: (games, pursuers) the places of the pursuers.
            place: (games,) the place of the evader.

        Returns:
            (games, agents of the side) and (games,).
        """
        sign = 1 if side == PURSUERS else -1
        own = places if side == PURSUERS else place[:, None]
        roads = self.fleet if side == PURSUERS else [self.roads]
        ways = [self._make_table(one)[0] for one in roads]
        choices = np.indices([one.shape[1] for one in ways]).reshape(len(ways), -1)
        each = [one[own[:, None, i], choices[i]] for i, one in enumerate(ways)]
        ends = np.stack(each, axis=2)  # (games, choices, agents)
        is_move: BoolArray = np.logical_and.reduce(ends >= 0, axis=2)
        if side == PURSUERS:
            pursuers, evader = ends, np.broadcast_to(place[:, None], is_move.shape)
        else:
            pursuers, evader = np.broadcast_to(places[:, None, :], (*is_move.shape, places.shape[1])), ends[:, :, 0]
        codes = self._get_codes(1 - side, np.where(is_move[:, :, None], pursuers, 0), np.where(is_move, evader, 0))
        worth = np.where(is_move, sign * _rank_codes(codes), -inf)
        nodes = self.roads.nodes[evader]
        distances = [self._make_table(one)[1][pursuers[:, :, i], nodes] for i, one in enumerate(self.fleet)]
        far = sign * np.add.reduce(distances)
        is_best = worth == worth.max(axis=1, keepdims=True)
        best = np.where(is_best, far, inf).argmin(axis=1)
        games = np.arange(len(best))
        return ends[games, best], codes[games, best]

    def _make_table(self, roads: Roads) -> tuple[IntArray, FloatArray]:
        """Return the moves and the distances on a graph; see `_list_ways` and `_compute_distances`."""
        if id(roads) not in self._check_agent:
            self._check_agent[id(roads)] = _list_ways(roads), _compute_distances(roads)
        return self._check_agent[id(roads)]

    @cached_property
    def _check_agent(self) -> dict[int, tuple[IntArray, FloatArray]]:
        return {}


def _list_ways(roads: Roads) -> IntArray:
    """Return the places to which an agent can move from each place, (places, most), its own first, padded with -1."""
    offsets, ends = roads.offsets, roads.ends
    counts = np.diff(offsets)
    begins = np.repeat(np.arange(len(counts)), counts)
    order = np.lexsort((ends, ends != begins, begins))
    found = np.full((len(counts), int(counts.max())), -1)
    found[begins, np.arange(len(ends)) - offsets[begins]] = ends[order]
    return found


def _compute_distances(roads: Roads) -> FloatArray:
    """Return the number of edges from each place to each node, (places, nodes); without a path the number of places."""
    places = len(roads.nodes)
    reached = np.zeros((places, len(roads.labels)), np.bool_)
    reached[np.arange(places), roads.nodes] = True
    far = np.full(reached.shape, float(places))
    steps = 0
    while True:
        new = reached & (far == places)
        if not new.any():
            return far
        far[new] = steps
        steps += 1
        reached = np.logical_or.reduceat(reached[roads.ends], roads.offsets[:-1], axis=0)


def _rank_codes(codes: IntArray) -> FloatArray:
    """Return numbers that order codes as pursuers do: early captures, late ones, neither, late and early escapes."""
    return np.divide(1.0, codes, out=np.zeros(codes.shape), where=codes != 0)


def _count_turns(code: int) -> int:
    """Return the number of turns after which a position ends that is at the start of a turn."""
    return abs(code) // 2


def _group_moves(begins: IntArray, ends: IntArray, places: int) -> core.Moves:
    """Group moves by the place where they end."""
    offsets, order = kernels.group_rows(ends, places)
    counts = np.bincount(begins, minlength=places)
    return core.Moves(offsets.data, kernels.as_buffer(begins[order]), counts.data)


def _list_formations(places: int, pursuers: int) -> IntArray:
    """Return all multisets of places, (formations, pursuers), each ascending, ordered by their numbers."""
    found = np.zeros((1, 0), np.int64)
    for number in range(pursuers):
        counts = np.array([comb(place + number, number) for place in range(places)], np.int64)
        last = np.repeat(np.arange(places), counts)
        smaller = np.arange(len(last)) - np.repeat(np.cumsum(counts) - counts, counts)
        found = np.column_stack((found[smaller], last))
    return found


def _list_sequences(sizes: Sequence[int]) -> IntArray:
    """Return all sequences of a place of each pursuer, (formations, pursuers), ordered by their numbers.

    Args:
        sizes: the number of places of each pursuer.
    """
    numbers = np.arange(prod(sizes))
    return np.stack([numbers // prod(sizes[:number]) % size for number, size in enumerate(sizes)], axis=1)


class PursuitTerms(NamedTuple):
    """The teams, rewards and length of a pursuit.

    Attributes:
        teams: the teams of the pursuers and of the evader.
        pursuers: the names of the pursuers.
        evader: the name of the evader.
        gains: what the pursuers gain by a capture, and lose by an escape.
        discount: the weight of a reward one turn later.
        last_turn: the turn after which the game ends; None: there is none.
    """

    teams: tuple[str, str]
    pursuers: tuple[str, ...]
    evader: str
    gains: tuple[float, float] = (1.0, 1.0)
    discount: float = 1.0
    last_turn: int | None = None


class PursuitStrategy:
    """The exact play of one side of a pursuit; made by `PursuitSolution.strategy`.

    It reads the positions of all agents from the context, whatever their sensors show.

    Args:
        table: the outcomes.
        side: the side that plays it.
    """

    def __init__(self, table: PursuitTable, side: int) -> None:
        self._table = table
        self._side = side
        self._check_agent: tuple[GraphColumns, IntArray] | None = None  # the latest map, and the rows of its nodes

    def __repr__(self) -> str:
        return f"{type(self).__name__}({ROLES[self._side]!r}, pursuers={self._table.pursuers})"

    def __call__(self, ctx: Context) -> Strategy:
        """Return the strategy of an agent in a game, whose order of play is set before."""
        decide = partial(self._decide, tuple(map(tuple, ctx.game.order or ())))
        decide.__name__ = repr(self)  # type: ignore[attr-defined] # for errors
        return array_strategy(decide)(ctx)

    def _decide(self, order: tuple[tuple[Hashable, ...], ...], view: ArrayView) -> IntArray:
        """Return the actions of the agents of a view, in games with this order of play."""
        return self.choose(order, view, self._find_rows_on_map(view.streets.columns))

    def choose(self, order: tuple[tuple[Hashable, ...], ...], view: ArrayView, rows: IntArray) -> IntArray:
        """Return the actions of the agents of a view, in games with an order of play.

        Args:
            order: the order.
            view: the view.
            rows: (nodes,) the row in the table of each node of the map.
        """
        roster = view.roster
        pursuers, evaders = _find_sides(view, self._side)
        own = pursuers if self._side == PURSUERS else evaders
        living = view.living
        nodes = rows[view.of(np.arange(len(roster.names))).node]
        edges = np.full(nodes.shape, -1)
        playing = np.flatnonzero(living[:, evaders].any(axis=1) & living[:, pursuers].any(axis=1))
        if len(playing):
            counts = [living[playing[:, None], agents].sum(axis=1) for agents in (pursuers, evaders)]
            self._check(order, roster.teams[roster.team_of[view.agents[0]]], *counts)
            roads = [*self._table.fleet, self._table.roads]
            agents = [*pursuers.tolist(), int(evaders[0])]
            now = np.stack(
                [_find_places(view, nodes, *pair)[playing] for pair in zip(agents, roads, strict=True)], axis=1
            )
            ends, _ = self._table.find_best(self._side, now[:, :-1], now[:, -1])
            moving = slice(None, -1) if self._side == PURSUERS else slice(-1, None)
            for agent, one, before, after in zip(own, roads[moving], now[:, moving].T, ends.T, strict=True):
                nodes[playing, agent] = one.nodes[after]
                if one.traffic is not None:
                    edges[playing, agent] = np.where(after == before, -1, one.traffic.edges[after])
        if (edges >= 0).any():
            view.take_edges(edges[:, view.agents])
        ids = view.streets.columns.node_ids[np.argsort(rows)]
        return view.action_to(ids[nodes[:, view.agents]])

    def _find_rows_on_map(self, columns: GraphColumns) -> IntArray:
        """Return the row in the table of each row of the map of a game."""
        if self._check_agent is not None and self._check_agent[0] is columns:
            return self._check_agent[1]
        roads = self._table.roads
        id_of = list_labels(columns)
        row_of = {id_of.get(label, label): row for row, label in enumerate(roads.labels)}
        there = columns.node_ids.tolist()
        if {*row_of} == {*there}:
            rows = np.array([row_of[node] for node in there])
            every = rows * len(rows) + rows
            keys = np.concatenate((rows[columns.sources] * len(rows) + rows[columns.targets], every))
            own = np.repeat(np.arange(len(rows)), np.diff(roads.offsets)) * len(rows) + roads.ends
            if np.array_equal(np.unique(keys), own):
                self._check_agent = columns, rows
                return rows
        raise BadValue(
            f"{self!r} was solved for another map, of {len(row_of)} nodes; that of this game has {len(there)}. "
            "Solve the pursuit on ctx.graph of this game."
        )

    def _check(
        self, order: tuple[tuple[Hashable, ...], ...], team: Hashable, pursuers: IntArray, evaders: IntArray
    ) -> None:
        """Refuse games with other agents or another order of play."""
        table = self._table
        is_other = (pursuers != table.pursuers) | (evaders != 1)
        if is_other.any():
            game = int(is_other.argmax())
            raise BadValue(
                f"{self!r} is for {table.pursuers} pursuers and 1 evader, and the game of team {shown(team)} has "
                f"{pursuers[game]} and {evaders[game]}: use pursuit(…, pursuers={pursuers[game]}) in a game with one "
                "evader."
            )
        turn = 0 if self._side == table.first else 1
        if len(order) != 2 or team not in order[turn]:
            raise BadValue(
                f"{self!r} was solved with moves_first={ROLES[table.first]!r}, and ctx.game.order is {shown(order)}: "
                "it needs two lists of teams, such as [['cops'], ['robbers']], with the first to move in the first one."
            )


def _find_places(view: ArrayView, nodes: IntArray, agent: int, roads: Roads) -> IntArray:
    """Return the place of an agent in each game of a view, (games,); `nodes` (games, all agents) are rows of nodes."""
    own: IntArray = nodes[:, agent]
    traffic = roads.traffic
    if traffic is None:
        return own
    driven = find_driven_edges(view, agent)
    return np.array([traffic.find_place(row, edges) for row, edges in zip(own.tolist(), driven, strict=True)])


def exact_pursuers(ctx: Context, *, exits: Iterable[int] = ()) -> Strategy:
    """Make a strategy by which the pursuers of a pursuit in turns play exactly, on any map.

    The pursuit is solved on the map of a game when the strategy first decides there; see `pursuit` for its rules. All
    agents of other teams are evaders, of which there may be one. It reads the positions of all agents.

    Args:
        ctx: the context of the game, whose order of play is set before.
        exits: ids of nodes where the evader escapes.

    Raises:
        BadType: an exit is not an integer.
        BadValue: in the first turn, if the game has several evaders or another order of play.
        UnknownName (KeyError): in the first turn, if an exit is not on the map.
        TooLarge: in the first turn, see `pursuit`.
    """
    return _find_exact_strategy(ctx, PURSUERS, exits)


def exact_evader(ctx: Context, *, exits: Iterable[int] = ()) -> Strategy:
    """Make a strategy by which the evader of a pursuit in turns plays exactly, on any map; see `exact_pursuers`.

    Args:
        ctx: see `exact_pursuers`.
        exits: see `exact_pursuers`.

    Raises:
        BadType, BadValue, UnknownName, TooLarge: see `exact_pursuers`.
    """
    return _find_exact_strategy(ctx, EVADER, exits)


def _find_exact_strategy(ctx: Context, side: int, exits: Iterable[int]) -> Strategy:
    nodes = tuple(sorted({*as_node_ids(exits, "exits", ctx.graph)}))
    decide = partial(_decide_exactly, side, nodes, tuple(map(tuple, ctx.game.order or ())))
    decide.__name__ = f"exact_{ROLES[side]}"  # type: ignore[attr-defined] # for errors
    return array_strategy(decide)(ctx)


def _decide_exactly(
    side: int, exits: tuple[int, ...], order: tuple[tuple[Hashable, ...], ...], view: ArrayView
) -> IntArray:
    """Return the actions of the agents of a view; solve the pursuit on a map that is new."""
    pursuers, evaders = _find_sides(view, side)
    agents = [*pursuers.tolist(), *evaders.tolist()[:1]]
    modes = tuple(get_mode(view.roster.agents[agent]) for agent in agents)
    maps = _find_maps(view, agents)
    is_first = len(order) == 2 and view.roster.teams[view.roster.team_of[view.agents[0]]] in order[0]
    first = side if is_first else 1 - side
    tables = _TABLES.setdefault(maps[-1], {})
    key = tuple(map(id, maps)), modes, exits, first
    if key not in tables:
        roads = {mode: _roads_of_mode(one, mode) for mode, one in zip(modes, maps, strict=True)}
        rows = _find_exit_rows(roads[modes[-1]], exits)
        tables[key] = PursuitTable([roads[mode] for mode in modes], rows, first), maps[:-1]
    table, _ = tables[key]
    return PursuitStrategy(table, side).choose(order, view, np.arange(len(table.exits)))


def _find_maps(view: ArrayView, agents: Sequence[int]) -> list[GraphColumns]:
    """Return the map of each of several agents, by their numbers: the same object if they have the same mode."""
    roster = view.roster
    modes = [get_mode(roster.agents[agent]) for agent in agents]
    of_mode = {mode: view.of(np.array([agent])).streets.columns for mode, agent in zip(modes, agents, strict=True)}
    return [of_mode[mode] for mode in modes]


_Key = tuple[tuple[int, ...], tuple[str | None, ...], tuple[int, ...], int]
_TABLES: WeakKeyDictionary[GraphColumns, dict[_Key, tuple[PursuitTable, list[GraphColumns]]]] = WeakKeyDictionary()
"""Map of the evader -> ids of maps, modes, exits, first side -> the outcomes, and the maps of the pursuers."""


def _find_sides(view: ArrayView, side: int) -> tuple[IntArray, IntArray]:
    """Return the numbers of the pursuers and of the evaders, if the agents of a view are on a side."""
    team_of = view.roster.team_of
    is_own = team_of == team_of[view.agents[0]]
    own, others = np.flatnonzero(is_own), np.flatnonzero(~is_own)
    return (own, others) if side == PURSUERS else (others, own)


class PursuitSolution(Solution):
    """The values of a pursuit in turns, and exact play; made by `pursuit`, and by `solve` if it recognizes the game.

    Agents are named as in the scenario; on a graph alone "pursuer_0", "pursuer_1", … and "evader", and teams "pursuers"
    and "evader". Then a game starts with the best formation of the pursuers, and the best answer of the evader to it,
    which is no exit.

    Args:
        outcomes: how positions end.
        terms: teams, rewards and length.
        team: the team whose values these are.
        start: agent -> its node.
        setup: the game to solve; None: a graph alone.
        reward: the reward of the team.

    Attributes:
        outcomes: how positions end.
        start: agent -> its node in the start.
    """

    error = 0.0

    def __init__(
        self,
        outcomes: PursuitTable,
        terms: PursuitTerms,
        team: str,
        start: Mapping[str, Any] | None = None,
        setup: GameSetup | None = None,
        reward: Reward = "win",
    ) -> None:
        self.outcomes = outcomes
        self.team = team
        self._terms = terms
        self._setup = setup
        self._reward = reward
        self._sign = 1.0 if team == terms.teams[PURSUERS] else -1.0
        self.teams = terms.teams if team == terms.teams[0] else terms.teams[::-1]
        self.start: dict[str, Any] = dict(self._find_best_start() if start is None else start)
        self.value = self.value_at({})

    def __repr__(self) -> str:
        return f"{type(self).__name__}(value={self.value:.6g}, team={self.team!r}, {len(self.outcomes)} positions)"

    @property
    def sees(self) -> dict[str, str]:
        """The word "full" for both teams, because positions are known to all; see `Solution.sees`."""
        return dict.fromkeys(self.teams, "full")

    @property
    def bound(self) -> Bound:
        """The word "exact"; see `Solution.bound`."""
        return "exact"

    @cached_property
    def table(self) -> Table:
        """The states and transitions of the scenario, explored by its rules when this is first read.

        Raises:
            BadValue: the pursuit was solved on a graph, without a scenario.
            TooLarge: see `solve`.
        """
        return explore(self._find_setup("table"), by_winner=True, merges=True)

    def _find_setup(self, name: str) -> GameSetup:
        if self._setup is None:
            raise BadValue(f"A pursuit on a graph has no {name}, because it has no rules: solve a scenario.")
        return self._setup

    # -- values -------------------------------------------------------------------------------------------------

    def value_at(self, places: Mapping[str, Any], turn: int = 0) -> float:
        """Return the value of a position at the start of a turn for the team; see `Solution.value_at`."""
        played = as_count(turn, "turn", 0)
        return self._compute_value(self.outcomes.encode_position(*self._find_rows(places)), played)

    def values(self, agent: str, places: Mapping[str, Any] | None = None, turn: int = 0) -> dict[Any, float]:
        """Return the values by the position of an agent, for all nodes; see `Solution.values`."""
        self._check_agent(agent)
        return {node: self.value_at({**(places or {}), agent: node}, turn) for node in self.outcomes.roads.labels}

    def captures(self, start: Mapping[str, Any] | None = None) -> int | None:
        """Return the number of turns in which the evader is caught under exact play; None: it is not caught.

        It is 0 if the evader is on the node of a pursuer. A limit on turns does not count.

        Args:
            start: agent -> its node. Missing agents are at their starting nodes.

        Raises:
            UnknownName (KeyError): an agent or a node does not exist.
        """
        code = self.outcomes.encode_position(*self._find_rows(start or {}))
        return _count_turns(code) if code > 0 else None

    def escapes(self, start: Mapping[str, Any] | None = None) -> int | None:
        """Return the number of turns in which the evader is on an exit under exact play; None: it does not escape.

        Args:
            start: see `captures`.

        Raises:
            UnknownName (KeyError): see `captures`.
        """
        code = self.outcomes.encode_position(*self._find_rows(start or {}))
        return _count_turns(code) if code < 0 else None

    def policy(self, team: str, places: Mapping[str, Any] | None = None, turn: int = 0) -> list[Choice]:
        """Return the move of a team in a position; see `Solution.policy`."""
        as_count(turn, "turn", 0)
        side = self._find_side(team)
        rows, row = self._find_rows(places or {})
        pursuers = np.array([rows])
        evader = np.array([row])
        if side != self.outcomes.first:
            moved, _ = self.outcomes.find_best(self.outcomes.first, pursuers, evader)
            pursuers, evader = (moved, evader) if side == EVADER else (pursuers, moved[:, 0])
        ends, _ = self.outcomes.find_best(side, pursuers, evader)
        nodes = self.outcomes.roads.labels
        names = self._terms.pursuers if side == PURSUERS else (self._terms.evader,)
        return [Choice(1.0, {name: nodes[end] for name, end in zip(names, ends[0].tolist(), strict=True)})]

    def strategy(self, team: str | None = None) -> PursuitStrategy:
        """Return the exact play of a team, for any game on this map with these numbers of agents and order of play.

            scenario.play(strategies={"cops": solution.strategy("pursuers")})

        Args:
            team: one of the two teams; None: the team whose values these are.

        Raises:
            UnknownName (KeyError): the team does not exist.
        """
        return PursuitStrategy(self.outcomes, self._find_side(self.team if team is None else team))

    def nash_conv(self, strategies: Mapping[str, Any] | None = None) -> float:
        """Return the gain of both teams together from best responses in the scenario; see `Solution.nash_conv`.

        All turns are played by the rules of the scenario, which takes long on large maps.

        Raises:
            BadValue: the pursuit was solved on a graph, without a scenario.
            TooLarge: see `solve`.
        """
        setup = self._find_setup("best responses")
        teams = self._terms.teams
        given = {team: self.strategy(team) for team in teams} | dict(as_mapping(strategies or {}, "strategies"))
        games = [
            (team, setup._replace(teams=(team,), others={other: given[other]})) for team, other in (teams, teams[::-1])
        ]
        found = [solve_table(game, self._reward, self._terms.discount, self.team).value for _, game in games]
        return sum(found)

    # -- inside -------------------------------------------------------------------------------------------------

    def _compute_value(self, code: int, played: int) -> float:
        turns = max(1, _count_turns(code))
        last = self._terms.last_turn
        if code == 0 or (last is not None and turns > last - played):
            return 0.0
        gain = self._terms.gains[0] if code > 0 else -self._terms.gains[1]
        return self._sign * gain * float(self._terms.discount ** (turns - 1)) + 0.0

    def _find_best_start(self) -> dict[str, Any]:
        """Return the start if the pursuers choose their nodes first, and then the evader."""
        table = self.outcomes
        if table.exits.all():
            raise BadValue("All nodes are exits, so that the evader has none to start from: give fewer exits=.")
        nodes = np.flatnonzero(~table.exits)
        worth = _rank_codes(table.codes[table.first][:, nodes])
        formation = int(worth.min(axis=1).argmax())
        places = table.list_formations()[formation].tolist()
        place = int(nodes[worth[formation].argmin()])
        names = (*self._terms.pursuers, self._terms.evader)
        return {name: table.roads.labels[row] for name, row in zip(names, [*places, place], strict=True)}

    def _find_rows(self, places: Mapping[str, Any]) -> tuple[list[int], int]:
        """Return the rows of the pursuers and of the evader."""
        now = {**self.start, **as_mapping(places, "places")}
        for name, node in now.items():
            if node is None or name not in self.start:
                raise BadValue(
                    f"places[{shown(self._check_agent(name))}] is None: the pursuit is over without this agent."
                )
        row = self.outcomes.find_row
        return [row(now[name]) for name in self._terms.pursuers], row(now[self._terms.evader])

    def _check_agent(self, agent: str) -> str:
        return as_known(agent, "agent", (*self._terms.pursuers, self._terms.evader))

    def _find_side(self, team: str) -> int:
        return self._terms.teams.index(as_known(team, "team of the solution", self._terms.teams))


@explain_call_errors
def pursuit(
    graph: object,
    *,
    pursuers: int = 1,
    exits: Iterable[Node] = (),
    moves_first: Literal["pursuers", "evader"] = "pursuers",
) -> PursuitSolution:
    """Return the values of a pursuit in turns with full sight on a graph, and exact play of both sides.

        solution = gamms.solve.pursuit(ctx.graph, pursuers=2)
        print(solution.captures({"pursuer_0": 3, "pursuer_1": 4, "evader": 12}))

    A turn is a move of all pursuers and one of the evader, each along one edge or none. Without exits, this is the game
    of cops and robbers. The value is 1 if the pursuers can force a capture, -1 if the evader can force an escape, and 0
    if neither can.

    Args:
        graph: a networkx graph, directed or not, or `ctx.graph`.
        pursuers: the number of pursuers, which are interchangeable.
        exits: nodes on which the evader escapes if it is there at the end of a turn and not caught.
        moves_first: the side that moves first in a turn.

    Raises:
        BadType, BadValue: an argument is impossible.
        UnknownName (KeyError): an exit is not on the map.
        TooLarge: the positions would take more memory than `gamms.limits.max_memory`.
    """
    number = as_count(pursuers, "pursuers")
    first = ROLES.index(as_choice(moves_first, "moves_first", ROLES))
    roads = find_roads(graph)
    outcomes = PursuitTable([roads] * (number + 1), _find_exit_rows(roads, exits), first)
    names = tuple(f"pursuer_{place}" for place in range(number))
    return PursuitSolution(outcomes, PursuitTerms(("pursuers", "evader"), names, "evader"), "pursuers")


def _find_exit_rows(roads: Roads, exits: Iterable[Node]) -> list[int]:
    if isinstance(exits, str) or not isinstance(exits, Iterable):
        raise BadType(f"exits must be several nodes, such as [0, 5], not {shown(exits)}.")
    row_of = {label: row for row, label in enumerate(roads.labels)}
    wanted = list(exits)
    for node in wanted:
        if node not in row_of:
            raise UnknownName("node", node, row_of)
    return [row_of[node] for node in wanted]


@explain_call_errors
def cop_number(graph: object, *, most: int = 3) -> int | None:
    """Return the cop number of a graph: the fewest pursuers that can force a capture wherever the evader starts.

    The pursuers choose their nodes first, then the evader; then the pursuers move first.

    Args:
        graph: see `pursuit`.
        most: the most pursuers to try.

    Returns:
        The number; None if it is larger than `most`.

    Raises:
        BadType, BadValue, TooLarge: see `pursuit`.
    """
    limit = as_count(most, "most")
    roads = find_roads(graph)
    for number in range(1, limit + 1):
        outcomes = PursuitTable([roads] * (number + 1), (), PURSUERS)
        if (outcomes.codes[PURSUERS] > 0).all(axis=1).any():
            return number
    return None


# -- scenarios ----------------------------------------------------------------------------------------------------


def recognize_pursuit(setup: GameSetup, reward: Reward, discount: float) -> PursuitSolution | None:
    """Return the solution of a scenario that is a pursuit in turns with full sight; None: it is another game.

    Its rules are `tag(…, then="eliminate")`, then perhaps `reach` for the evader, and `last_team` or `none_left`. One
    team has a single agent, the evader; all move along one edge in a turn, and all see all.
    """
    if reward not in ("win", "score"):
        return None
    ctx = setup.scenario.build(setup.seed, dict.fromkeys(setup.teams, stay))
    with ctx:
        rules = _PursuitRules.from_game(ctx)
        if rules is None or {*rules.teams} != {*setup.teams}:
            return None
        gains = (1.0, 1.0) if reward == "win" else rules.points
        if gains[0] <= 0 or (rules.exits and gains[1] <= 0):
            return None
        sides = [sorted(one.name for one in ctx.game.agents if one.team == team) for team in rules.teams]
        last = TurnTerms.from_game(ctx.game, setup.last_turn).last_turn
        terms = PursuitTerms(rules.teams, tuple(sides[0]), sides[1][0], gains, discount, last)
        roads = find_roads(ctx.graph)
        outcomes = PursuitTable([roads] * (len(sides[0]) + 1), _find_exit_rows(roads, rules.exits), rules.first)
        start = {one.name: one.current_node_id for one in ctx.game.agents}
        return PursuitSolution(outcomes, terms, setup.teams[0], start, setup, reward)


class _PursuitRules(NamedTuple):
    """What the rules of a pursuit say.

    Attributes:
        teams: the teams of the pursuers and of the evader.
        exits: the nodes where the evader escapes.
        points: what the pursuers get for a capture, and the evader for an escape.
        first: the side that moves first.
    """

    teams: tuple[str, str]
    exits: frozenset[int]
    points: tuple[float, float]
    first: int

    @classmethod
    def from_game(cls, ctx: Context) -> "_PursuitRules | None":
        """Return the rules of a game; None: it is not a pursuit in turns with full sight."""
        game: Game = ctx.game
        named = [(name_shipped_rule(rule), rule) for rule in game.rules]
        names = [name for name, _ in named]
        if (
            names[:1] != ["tag"]
            or not {*names[1:]} <= {"reach", "last_team", "none_left"}
            or len({*names}) < len(names)
        ):
            return None
        parts = game.rules[0].spec.parts
        if len(parts) != 1 or not _is_capture(parts[0]):
            return None
        teams = parts[0].taggers, parts[0].tagged
        arguments = {name: rule.spec.core_form.args for name, rule in named if isinstance(rule.spec.core_form, partial)}
        exits, bounty, is_won = _find_exits(arguments.get("reach"), teams[EVADER])
        ends = _is_ended_by_capture(arguments.get("none_left"), teams, parts[0].score)
        ends = ends and ("last_team" in names or "none_left" in names)
        first = _find_first_side(game, teams)
        if not (is_won and ends and first is not None and _has_usual_agents(game, teams) and _is_fully_observed(game)):
            return None
        return cls(teams, exits, (float(parts[0].score), bounty), first)


def _is_capture(part: Any) -> bool:  # Any: what `tag` was called with
    """Return whether a tag takes out each agent that shares a node with a tagger."""
    usual = ContactOptions(None, 0.0, crossing=part.nearness.crossing, air=part.nearness.air, passing=True)
    is_simple = part.nearness == usual and part.ground is None and not (part.mutual or part.ends)
    return is_simple and part.then == "eliminate" and not any(map(callable, (part.taggers, part.tagged)))


def _find_exits(reach: tuple[Any, ...] | None, evaders: Hashable) -> tuple[frozenset[int], float, bool]:
    """Return the exits, the points for reaching them, and whether the evader alone wins there."""
    if reach is None:
        return frozenset(), 0.0, True
    goals, winner, score, _ = reach
    if [*goals] != [evaders] or isinstance(goals[evaders], str):
        return frozenset(), 0.0, False
    return goals[evaders], float(score), winner in (ONE_THAT_SHOWS, evaders)


def _is_ended_by_capture(none_left: tuple[Any, ...] | None, teams: tuple[Any, Any], score: float) -> bool:
    """Return whether `none_left` lets the pursuers win when the evader is out, or is not there."""
    if none_left is None:
        return True
    team, _, winner = none_left
    return team == teams[EVADER] and (winner == teams[PURSUERS] or (winner == ONE_THAT_SHOWS and score > 0))


def _find_first_side(game: Game, teams: tuple[Any, Any]) -> int | None:
    """Return the side that moves first; None: the sides do not move one after the other."""
    order = game.settings()["order"] or ()
    parts = [{*part} for part in order]
    if parts == [{teams[PURSUERS]}, {teams[EVADER]}]:
        return PURSUERS
    return EVADER if parts == [{teams[EVADER]}, {teams[PURSUERS]}] else None


def _has_usual_agents(game: Game, teams: tuple[Any, Any]) -> bool:
    """Return whether there is one evader, and all agents move freely along one edge in a turn."""
    settings = game.settings()
    is_usual = settings["legal"] == "edges" and settings["speed_unit"] == "edges" and settings["conflicts"] is None
    is_usual = is_usual and not settings["channels"] and not settings["deeds"] and settings["time_budget"] is None
    agents = game.agents
    sizes = [sum(one.team == team for one in agents) for team in teams]
    is_whole = sum(sizes) == len(agents) == len(game.ctx.agent.agents) and not game.scores
    is_slow = all(one.speed in (None, 1) and getattr(one, "mode", None) is None for one in agents)
    return is_usual and is_whole and is_slow and sizes[PURSUERS] > 0 and sizes[EVADER] == 1


def _is_fully_observed(game: Game) -> bool:
    """Return whether each agent knows where all others are."""
    if game.settings()["information"] == "full":
        return True
    return all(any(map(_is_showing_all, one.sensors.values())) for one in game.agents)


def _is_showing_all(sensor: Any) -> bool:  # Any: `in_arrays` is no part of the contract of sensors
    look = sensor.in_arrays() if sensor.type is SensorType.AGENT else None
    return bool(look == AgentLook(inf, is_plain=True))
