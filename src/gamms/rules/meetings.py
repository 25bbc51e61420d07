"""What `gamms.core.contacts` is asked: the columns of agents that it takes, and the contacts that it finds.

`turn_of` asks it about the game of a context, `met_in_turn` about a turn of many games.
"""

from array import array
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from functools import cache, lru_cache, partial
from itertools import accumulate, chain, compress
from operator import gt
from typing import Any, NamedTuple

import numpy as np

from gamms import kernels
from gamms.context import Context
from gamms.core import contacts as core
from gamms.game.batch.columns import some_rows
from gamms.game.batch.movement import Legs as LegsOfTurn
from gamms.game.batch.roads import REMOVED
from gamms.game.batch.turn import ArrayTurn, movement_in, purposes_in
from gamms.graph import Graph
from gamms.ir.agents import Position
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.kernels.draws import BitArray
from gamms.rules.near_nodes import NearNodes, Reached, reached
from gamms.rules.visits import EdgesGoneAlong, at_end
from gamms.typing import IAgent
from gamms.typing.game import Track

_FIRST_ROOM = 64  # contacts
_MOST_DISTANCES = 8  # for which a game keeps what is near nodes
_MOST_NEAR_IN_GAME, _MOST_NEAR_IN_BATCH = 1 << 20, 1 << 25  # pairs of nodes, for each distance
_NOWHERE = 0.0, 0.0, 0.0
_BACKWARDS, _TURNS, _REMOVED = 1, 2, 4  # flags of legs, see `core.Legs`


class Nearness(NamedTuple):
    """What counts as a contact; see `contacts`."""

    unit: str | None  # "hops", "metres" or "euclid"; None: on one node
    limit: float
    crossing: bool
    air: bool
    passing: bool


class Met(NamedTuple):
    """Contacts in the order of the games, in each in that which `contacts` promises.

    Arrays (contacts,): the numbers of the game and of both agents, the numbers of the nodes where both were, times,
    distances, the draws that decide between equals, and 1 where they met on an edge.
    """

    games: IntArray
    a: IntArray
    b: IntArray
    a_nodes: IntArray
    b_nodes: IntArray
    times: FloatArray
    distances: FloatArray
    draws: BitArray
    on_edges: IntArray

    def those(self, rows: IntArray | BoolArray) -> "Met":
        """Return some of them."""
        return some_rows(self, rows)


Near = core.Reach | core.Places | core.Lines | None


class Finder:
    """Finds the contacts of turns of one game or batch, with room for the largest turn so far."""

    def __init__(self) -> None:
        self._make_room(0, 0, _FIRST_ROOM)

    def _make_room(self, pieces: int, keys: int, contacts: int) -> None:
        self._sizes = pieces, keys, contacts
        self._met, self._order = _columns(contacts), np.empty(contacts, np.int64)
        ints, floats, first = np.empty((6, pieces), np.int64), np.empty((4, pieces)), np.full(keys, -1)
        scratch = core.Pieces(*_flat((*ints[:3], *floats, *ints[3:5], first, ints[5])))
        self._core = core.Contacts(scratch, *_flat((*self._met, self._order)))

    def find(
        self, nearness: Nearness, near: Near, *columns: Any, pieces: int, keys: int, by_metres: bool
    ) -> tuple[Met, IntArray]:
        """Find the contacts of a turn.

        Args:
            nearness: what counts as a contact.
            near: what says how far places are from each other; None: agents meet on nodes.
            columns: of agents and games, as `core.Contacts.ask` takes them.
            pieces: the most that the agents of one game do in a turn, one after the other.
            keys: how many numbers of nodes and of streets there are at most.
            by_metres: whether the games are by metres.

        Returns:
            Room for contacts, and the rows of those that were found, in their order; valid until the next call.
        """
        contacts, parts = 0, near.parts if isinstance(near, core.Lines) else 0
        while True:
            sizes = max(pieces, parts), keys, contacts
            if any(map(gt, sizes, self._sizes)):
                self._make_room(*map(max, sizes, self._sizes))
            self._core.ask(
                *columns,
                reach=near if isinstance(near, core.Reach) else _NO_REACH,
                places=near if isinstance(near, core.Places) else _NO_PLACES,
                lines=near if isinstance(near, core.Lines) else _NO_LINES,
                crossing=nearness.crossing,
                by_metres=by_metres,
            )
            if isinstance(near, core.Reach):
                is_exact = by_metres and nearness.unit == "metres"
                contacts = self._core.find_by_paths(nearness.limit, is_exact)
            elif isinstance(near, core.Places):
                contacts = self._core.find_near_places(nearness.limit)
            elif isinstance(near, core.Lines):
                contacts = self._core.find_on_lines(nearness.limit)
            else:
                contacts = self._core.find_on_nodes()
            if contacts <= len(self._order):
                return self._met, self._order[: self._core.kept]


def _columns(contacts: int) -> Met:
    games, a, b, a_nodes, b_nodes, on_edges = np.empty((6, contacts), np.int64)
    times, distances = np.empty((2, contacts))
    return Met(games, a, b, a_nodes, b_nodes, times, distances, np.empty(contacts, np.uint64), on_edges)


def _flat(columns: Iterable[np.ndarray[Any, Any]]) -> list[Any]:  # of memoryviews, which are not subscriptable
    """Return columns as the core takes them."""
    return [np.ascontiguousarray(column).reshape(-1).data for column in columns]


def _column(kind: str, values: Iterable[float] = ()) -> Any:  # a memoryview, which is not subscriptable
    """Return numbers as the core takes them: "q" and "Q" for integers with and without sign, "d" for floats."""
    return memoryview(array(kind, values))


def _most_pieces(agents: int, most: int, most_legs: int) -> int:
    """Return how many pieces there are at most: visits and legs, each with two entries."""
    return 2 * agents * (most + 2 * most_legs + 1)


_NO_REACH = core.Reach(_column("q"), _column("q"), _column("q"), _column("d"))
_NO_PLACES = core.Places(_column("q"), _column("d"))
_NO_LINES = core.Lines(_column("q"), *[_column("d")] * 4)
_NO_LEGS = core.Legs(0, *[_column("q")] * 5, *[_column("d")] * 5)  # in games that count edges


# -- in the game of a context ------------------------------------------------------------------------------------------


class InTurn:
    """Where the agents of one game are in a turn.

    Args:
        ctx: the context.
        agents: whose contacts are found.
        game: what is known of the game and its map.
        before: the same for an earlier turn.

    Attributes:
        agents: as given.
        tracks: of these.
        edges: those that they go along.
        by_metres: whether the game is by metres.
        node_ids: of the nodes that contacts number.
        names: (agents,) keys of their names.
        found: the contacts of those that were asked for, by what was asked.
    """

    def __init__(self, ctx: Context, agents: Sequence[IAgent], game: "InGame", before: "InTurn | None") -> None:
        self.agents = agents
        self.tracks = ctx.game.tracks(agents)
        self.edges = EdgesGoneAlong(ctx)
        self.by_metres = ctx.game.speed_unit != "edges"
        self.found: dict[Hashable, Any] = {}
        self._game = game
        self.node_ids = game.ids
        self._most = most = max([len(track.path) for track in self.tracks])
        self._paths = [track.path + track.path[-1:] * (most - len(track.path)) for track in self.tracks]
        self._columns = (
            _column("q", map(game.number, chain.from_iterable(self._paths))),
            _column("d", chain.from_iterable([at + (1.0,) * (most - len(at)) for _, at, _ in self.tracks])),
            _column("q", [len(track.path) for track in self.tracks]),
        )
        self._most_legs = max([len(track.legs) for track in self.tracks]) if self.by_metres else 0
        self._legs = _legs(self.edges, self.tracks, self._most_legs, game.number) if self.by_metres else _NO_LEGS
        self.names: memoryview = (
            before.names
            if before is not None and before.agents == agents
            else _column("Q", [kernels.name_key(agent.name) for agent in agents])
        )
        self._purpose = _column("Q", [kernels.purpose_key(ctx.seed, "contacts")])
        self._turn = _column("q", [ctx.game.turn])

    def tracks_for(self, nearness: Nearness) -> Sequence[Track]:
        """Return how agents came to where they are, as far as that counts."""
        # Where agents pass each other at the end of a turn that counts edges, how they came there counts.
        return self.tracks if nearness.passing or not self.by_metres else [at_end(track) for track in self.tracks]

    def find(self, sides: Sequence[int], nearness: Nearness, in_air: Mapping[str, Position]) -> list[list[Any]]:
        """Find contacts: what `Met` has of each.

        Args:
            sides: of each agent, as `core.Tracks` has it.
            nearness: what counts as a contact.
            in_air: agent -> where it is, of those that fly where straight lines count.
        """
        near = self._near(sides, nearness, in_air)
        met, rows = self._game.finder.find(
            nearness,
            near,
            core.Tracks(len(sides), self._most, *self._columns, _column("q", sides), at_end=not nearness.passing),
            self._legs,
            self.names,
            self._purpose,
            self._turn,
            pieces=_most_pieces(len(sides), self._most, self._most_legs),
            keys=len(self._game.ids) + self._most_legs * len(sides),
            by_metres=self.by_metres,
        )
        columns = [column.data for column in met] if len(rows) else []
        return [[column[row] for column in columns] for row in rows.tolist()]

    def _near(self, sides: Sequence[int], nearness: Nearness, in_air: Mapping[str, Position]) -> Near:
        if nearness.unit is None:
            return None
        if nearness.unit != "euclid":
            return self._game.near(nearness.unit, nearness.limit).around(self._asked(sides), len(self._game.ids))
        if self.by_metres:
            places = [in_air.get(agent.name) for agent in self.agents]
            return _lines(self.edges, self.tracks_for(nearness), places, sides)
        place, most = self._game.place, self._most
        rows = [
            [in_air[agent.name]] * most if agent.name in in_air else map(place, path) if side else [_NOWHERE] * most
            for agent, path, side in zip(self.agents, self._paths, sides, strict=True)
        ]
        xyz = chain.from_iterable(chain.from_iterable(rows))
        return core.Places(_column("q", range(most * len(rows))), _column("d", xyz))

    def _asked(self, sides: Sequence[int]) -> IntArray:
        """Return the nodes, by number, around which agents of a side may be near others."""
        # Where none passes a node, those that agents have left do not count.
        first = 0 if self.by_metres or self._most > 2 else self._most - 1
        nodes = [node for path in compress(self._paths, sides) for node in path[first:]]
        if self.by_metres:
            legs = chain.from_iterable([track.legs for track in compress(self.tracks, sides)])
            nodes += [node for leg in legs for node in (leg.source, leg.target)]
        return np.array([*map(self._game.number, nodes)])


class InGame:
    """What finding contacts in one game has learned of its map, and of the last turn.

    Args:
        graph: the map, as it is now.

    Attributes:
        map: the graph, and its revision.
        finder: finds contacts.
        number: node id -> a number of the node.
        ids: of nodes, by number.
        place: node id -> where the node is, on the ground.
        near: unit and limit of a `Nearness` -> what is so near nodes.
    """

    def __init__(self, graph: Graph) -> None:
        self.finder = Finder()
        self.ids: list[int] = []
        self.number = cache(self._number)
        self.place = cache(self._place)
        self.near = lru_cache(_MOST_DISTANCES)(self._near)
        self._graph, self.map = graph, (graph, graph.revision)
        self._turn: InTurn | None = None
        self._key: tuple[Any, ...] = ()

    def _number(self, node: int) -> int:
        self.ids.append(node)
        return len(self.ids) - 1

    def _place(self, node: int) -> Position:
        _, x, y = self._graph.get_node(node)
        return x, y, 0.0

    def _near(self, unit: str, limit: float) -> NearNodes:
        search = nodes_within if unit == "hops" else _by_length

        def found(rows: IntArray) -> Reached:
            near = [search(self._graph, self.ids[row], limit) for row in rows.tolist()]
            pairs = [sorted([(self.number(node), far) for node, far in one.items()]) for one in near]
            ends, far = np.array([*chain.from_iterable(pairs)]).T
            return np.array([len(one) for one in near]), ends, far

        return NearNodes(found, _MOST_NEAR_IN_GAME)

    def turn(self, ctx: Context, agents: Sequence[IAgent]) -> InTurn:
        """Return where agents are in this turn; they are looked at again if anything may have changed."""
        block, internals = ctx.agent.block, ctx.game.internals
        versions = internals.state.moves, block, block.version, block.structure.version
        key = *versions, ctx.game.speed_unit, ctx.game.turn, ctx.seed, agents
        # NOTE: before agents are moved, rules may take their moves back, which no version says.
        if self._turn is None or key != self._key or internals.parts.turns.is_moving:
            self._key, self._turn = key, InTurn(ctx, agents, self, self._turn)
        return self._turn


def turn_of(ctx: Context, agents: Sequence[IAgent]) -> InTurn:
    """Return where agents of a game are in this turn, for all rules that ask."""
    kept, graph = ctx.game.internals.kept, ctx.graph.graph
    known: InGame | None = kept.get("contacts")
    if known is None or known.map != (graph, graph.revision):
        known = kept["contacts"] = InGame(graph)
    return known.turn(ctx, agents)


def _legs(edges: EdgesGoneAlong, tracks: Sequence[Track], most: int, number: Callable[[int], int]) -> core.Legs:
    streets: dict[int, int] = {}
    ints = np.zeros((4, len(tracks), most), np.int64)
    floats = np.zeros((5, len(tracks), most))
    for row, track in enumerate(tracks):
        for place, leg in enumerate(track.legs):
            length = edges.length_of(leg)
            flags = (
                _BACKWARDS * (leg.street != leg.edge) + _TURNS * (leg.back is not None) + _REMOVED * (length is None)
            )
            street = streets.setdefault(leg.street, len(streets))
            ints[:, row, place] = number(leg.source), number(leg.target), street, flags
            floats[:, row, place] = leg.begin, leg.end, leg.since, leg.until, length or 0.0
    counts = np.array([len(track.legs) for track in tracks])
    return core.Legs(most, *_flat((counts, *ints, *floats)))


def _by_length(graph: Graph, node: int, limit: float) -> dict[int, float]:
    return graph.distances(source=node, cutoff=limit)


def nodes_within(graph: Graph, node: int, limit: float) -> dict[int, float]:
    """Return the nodes at most so many edges ahead of a node, each with the number of edges."""
    # NOTE: 5 us for what lies 3 edges around a node of Helsinki, where a search of the whole graph takes 170 us.
    near, hops, ring, far = graph.neighborhoods, {node: 0.0}, [node], 0.0
    while ring and far + 1.0 <= limit:
        far += 1.0
        ring = [end for end in dict.fromkeys(end for start in ring for end in near[start]) if end not in hops]
        hops.update(dict.fromkeys(ring, far))
    return hops


def _lines(
    edges: EdgesGoneAlong, tracks: Sequence[Track], in_air: Sequence[Position | None], sides: Sequence[int]
) -> core.Lines:
    each = zip(tracks, in_air, sides, strict=True)
    rows = [list(edges.lines_of(track, at)) if side else [] for track, at, side in each]
    lines = [line for row in rows for line in row]
    offsets = _column("q", [0, *accumulate(map(len, rows))])
    since = _column("d", [since for since, _, _, _ in lines])
    until = _column("d", [until for _, until, _, _ in lines])
    begins = _column("d", chain.from_iterable([begin for _, _, begin, _ in lines]))
    ends = _column("d", chain.from_iterable([end for _, _, _, end in lines]))
    return core.Lines(offsets, since, until, begins, ends)


# -- in many games -----------------------------------------------------------------------------------------------------


def met_in_turn(turn: ArrayTurn, ours: IntArray, theirs: IntArray, nearness: Nearness) -> Met:
    """Return the contacts of a turn of many games; nodes are numbered by their rows.

    Args:
        turn: of the games.
        ours: (agents,) the numbers of one side in the roster.
        theirs: (agents,) the numbers of the other side.
        nearness: what counts as a contact.
    """
    side = np.zeros(turn.node.shape[1], np.int64)
    side[ours] += 1
    side[theirs] += 2
    sides = side * turn.alive
    by_move = turn.is_there_by_move
    nodes, times, lengths = _steps_of(turn, by_move)
    agents, most = nodes.shape[1:]
    legs = None if turn.paths is None or turn.paths.legs is None else _legs_of(turn, turn.paths.legs, by_move)
    near: Near = None
    if nearness.unit == "euclid":
        in_air = turn.in_air() if nearness.air else None
        near = _places_of(turn, nodes, in_air) if legs is None else _lines_of(turn, legs, in_air, nearness)
    elif nearness.unit is not None:
        asked = nodes if legs is None else np.concatenate((nodes, legs.sources, legs.targets), axis=-1)
        near = _near_nodes(turn, nearness).around(asked, turn.streets.num_nodes)
    most_legs = 0 if legs is None else legs.sources.shape[-1]
    met, rows = turn.shared("contacts", Finder).find(
        nearness,
        near,
        core.Tracks(agents, most, *_flat((nodes, times, lengths, sides)), at_end=not nearness.passing),
        _NO_LEGS if legs is None else core.Legs(most_legs, *_flat(legs[1:])),
        *_flat((turn.roster.keys, purposes_in(turn, "contacts"), turn.turn)),
        pieces=_most_pieces(agents, most, most_legs),
        keys=max(turn.streets.num_nodes, 0 if legs is None else len(movement_in(turn).columns.edge_ids)),
        by_metres=legs is not None,
    )
    return met.those(rows)


def one_to_one_of_games(games: IntArray, a: IntArray, b: IntArray, agents: int) -> IntArray:
    """Return the rows of the contacts of games, in their order, that `one_to_one` takes.

    `agents` is how many a game has.
    """
    made = np.empty(len(games), np.int64)
    core.match(*_flat((games, a, b, np.full(agents, -1), made)))
    return np.flatnonzero(made)


def _steps_of(turn: ArrayTurn, by_move: BoolArray) -> tuple[IntArray, FloatArray, IntArray]:
    """Return the nodes that agents pass, when, and how many, (games, agents, most) and (games, agents)."""
    if turn.paths is not None:
        nodes = np.where(by_move[..., None], turn.paths.nodes, turn.node[..., None])
        times = np.where(by_move[..., None], turn.paths.times, 1.0)
        return nodes, times, np.where(by_move, turn.paths.lengths, 1)
    has_moved = by_move & (turn.starts != turn.node)
    nodes = np.stack((np.where(has_moved, turn.starts, turn.node), turn.node), axis=-1)
    times = np.ones(nodes.shape)
    times[by_move, 0] = 0.0
    return nodes, times, 1 + has_moved


class _Legs(NamedTuple):
    """The legs of a turn of many games, (games, agents, most).

    Attributes:
        edges: rows of edges.
        counts: (games, agents) how many an agent has; the others see `core.Legs`.
    """

    edges: IntArray
    counts: IntArray
    sources: IntArray
    targets: IntArray
    streets: IntArray
    flags: IntArray
    begins: FloatArray
    ends: FloatArray
    since: FloatArray
    until: FloatArray
    lengths: FloatArray

    @property
    def are_there(self) -> BoolArray:
        """Which there are, (games, agents, most)."""
        return np.arange(self.edges.shape[-1]) < self.counts[..., None]


def _legs_of(turn: ArrayTurn, legs: LegsOfTurn, by_move: BoolArray) -> _Legs:
    columns, edge, back = movement_in(turn).columns, legs.edge, legs.back
    ids = columns.edge_ids
    counts = np.where(by_move, (edge >= 0).sum(axis=-1), 0)
    streets = np.where((back >= 0) & (ids[back] < ids[edge]), back, edge)
    flags = _BACKWARDS * (streets != edge) + _TURNS * (back >= 0)
    at = np.nonzero(edge >= 0)
    flags[at] += _REMOVED * (movement_in(turn).all_roads.states(edge[at], turn.games[at[0]]) == REMOVED)
    ends, lengths = (columns.sources[edge], columns.targets[edge]), columns.lengths[edge]
    return _Legs(edge, counts, *ends, streets, flags, legs.begin, legs.end, legs.since, legs.until, lengths)


def _near_nodes(turn: ArrayTurn, nearness: Nearness) -> NearNodes:
    unit, limit = nearness[:2]

    def make() -> NearNodes:
        streets = turn.streets
        columns = streets.columns
        weights = columns.lengths if unit == "metres" else np.ones(len(columns.lengths))
        arcs = kernels.make_arcs(columns.sources, columns.targets, weights, streets.num_nodes)
        return NearNodes(partial(reached, arcs, limit), _MOST_NEAR_IN_BATCH)

    return turn.shared(("near", unit, limit), make)


def _places_of(turn: ArrayTurn, nodes: IntArray, in_air: tuple[IntArray, FloatArray] | None) -> core.Places:
    """Return where agents are on the nodes that they pass, in games that count edges."""
    x, y = turn.streets.axes
    xyz: FloatArray = turn.shared("places of nodes", lambda: np.stack((x, y, np.zeros(len(x))), axis=-1))
    if in_air is not None:
        agents, places = in_air
        nodes = nodes.copy()
        nodes[:, agents] = len(xyz) + np.arange(places[..., 0].size).reshape(*places.shape[:2], 1)
        xyz = np.concatenate((xyz, places.reshape(-1, 3)))
    return core.Places(*_flat((nodes, xyz)))


def _lines_of(
    turn: ArrayTurn, legs: _Legs, in_air: tuple[IntArray, FloatArray] | None, nearness: Nearness
) -> core.Lines:
    """Return the straight parts of the ways of agents, by the lines on the map, in games by metres."""
    agents = turn.node.shape[1]
    visits = turn.visits(turn.alive, passing=nearness.passing)
    here = np.zeros((len(visits.at), 3))
    for axis, places in enumerate(turn.streets.axes):
        here[:, axis] = places[visits.nodes]
    if in_air is not None:
        some = np.flatnonzero(np.isin(visits.agents, in_air[0]))
        here[some] = in_air[1][visits.at[some], np.searchsorted(in_air[0], visits.agents[some])]
    counts = legs.are_there & (legs.flags & _REMOVED == 0) & turn.alive[..., None]
    if not nearness.passing:  # those that are on an edge at the end
        is_last = np.arange(legs.edges.shape[-1]) == legs.counts[..., None] - 1
        counts &= is_last & (legs.ends > 0.0) & (legs.ends < 1.0)
    at = np.nonzero(counts)
    begin, end, since, until = (column[at] for column in (legs.begins, legs.ends, legs.since, legs.until))
    if not nearness.passing:
        begin, since, until = end, np.ones(len(end)), np.ones(len(end))
    which, share, x, y = movement_in(turn).lines.corners(legs.edges[at], begin, end)
    is_last, is_first = np.diff(which, append=-1) != 0, np.diff(which, prepend=-1) != 0
    with np.errstate(divide="ignore", invalid="ignore"):
        pace = np.where(end != begin, (until - since) / (end - begin), 0.0)
    time = since[which] + (share - begin[which]) * pace[which]
    time[is_first], time[is_last] = since, until
    first, last = np.flatnonzero(~is_last), np.flatnonzero(~is_first)
    corners = np.stack((x, y, np.zeros(len(x))), axis=-1)
    rows = at[0] * agents + at[1]
    keys = np.concatenate((visits.at * agents + visits.agents, rows[which[first]]))
    order = np.argsort(keys, kind="stable")
    offsets = np.searchsorted(keys[order], np.arange(turn.node.size + 1))
    parts = (visits.begin, time[first]), (visits.end, time[last]), (here, corners[first]), (here, corners[last])
    return core.Lines(*_flat((offsets, *(np.concatenate(both)[order] for both in parts))))
