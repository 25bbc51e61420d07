"""What `gamms.core.contacts` is asked: the columns of agents that it takes, and the contacts that it finds.

`met_in_game` asks it about the game of a context, `met_in_turn` about a turn of many games.
"""

from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from itertools import accumulate, chain
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
from gamms.rules.near_nodes import NearNodes, Reach
from gamms.rules.visits import EdgesGoneAlong, tracks_of
from gamms.typing import IAgent
from gamms.typing.game import Track

_FIRST_ROOM = 64  # contacts
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


class Paths(NamedTuple):
    """The nodes that agents pass, as `core.Tracks` has them; arrays (rows, most) and (rows,).

    Attributes:
        agents: how many a game has.
        num_nodes: how many numbers of nodes there are.
    """

    agents: int
    num_nodes: int
    nodes: IntArray
    times: FloatArray
    lengths: IntArray
    sides: IntArray


class Legs(NamedTuple):
    """The parts of edges that agents cover, as `core.Legs` has them; arrays (rows, most) and (rows,)."""

    num_streets: int
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
    def most(self) -> int:
        """How many legs a row has room for."""
        return int(self.sources.shape[-1])


def no_legs(rows: int) -> Legs:
    """Return those of games that count edges."""
    none = np.zeros((rows, 0), np.int64)
    nothing = np.zeros((rows, 0))
    counts = np.zeros(rows, np.int64)
    return Legs(0, counts, none, none, none, none, nothing, nothing, nothing, nothing, nothing)


class Lines(NamedTuple):
    """The straight parts of ways, as `core.Lines` has them; arrays (rows + 1,), (parts,) and (parts, 3)."""

    offsets: IntArray
    since: FloatArray
    until: FloatArray
    begins: FloatArray
    ends: FloatArray


class Draws(NamedTuple):
    """What the draws follow from: (agents,) the keys of names; (games,) keys of purposes, and turns."""

    names: BitArray
    purposes: BitArray
    turns: IntArray


def find(
    paths: Paths, legs: Legs, draws: Draws, nearness: Nearness, near: Lines | Reach | None, *, by_metres: bool
) -> Met:
    """Return the contacts of a turn.

    Args:
        paths: of all agents.
        legs: likewise.
        draws: what decides between equals.
        nearness: what counts as a contact.
        near: what says how far places are from each other; None: agents meet on nodes.
        by_metres: whether the games are by metres.
    """
    # Per agent at most: visits and legs, each with two entries.
    parts = 0 if not isinstance(near, Lines) else len(near.since)
    pieces = max(parts, paths.agents * 2 * (paths.nodes.shape[-1] + 2 * legs.most + 2))
    tracks = core.Tracks(paths.agents, paths.nodes.shape[-1], *_flat(paths[2:]), at_end=not nearness.passing)
    covered = core.Legs(legs.most, *_flat(legs[1:]))
    scratch = _pieces(pieces, max(paths.num_nodes, legs.num_streets, 1))
    nearby = None if near is None else (core.Lines if isinstance(near, Lines) else core.Reach)(*_flat(near))
    room = _FIRST_ROOM
    while True:
        met = _room_for(room)
        order = np.empty(room, np.int64)
        columns = _flat((*draws, *met, order))
        found = core.Contacts(tracks, covered, scratch, *columns, crossing=nearness.crossing, by_metres=by_metres)
        if nearby is None:
            count = found.find_on_nodes()
        elif isinstance(nearby, core.Lines):
            count = found.find_straight(nearby, nearness.limit)
        else:
            count = found.find_by_paths(nearby, nearness.limit, by_metres and nearness.unit == "metres")
        if count <= room:
            rows = order[: found.kept]
            return met.those(rows)
        room = 2 * count


def _flat(columns: Iterable[np.ndarray[Any, Any]]) -> list[Any]:  # of memoryviews, which are not subscriptable
    """Return columns as the core takes them."""
    return [np.ascontiguousarray(column).reshape(-1).data for column in columns]


def _pieces(room: int, keys: int) -> core.Pieces:
    ints = np.empty((6, room), np.int64)
    floats = np.empty((4, room))
    first = np.full(keys, -1)
    columns = (*ints[:3], *floats, *ints[3:5], first, ints[5])
    return core.Pieces(*_flat(columns))


def _room_for(contacts: int) -> Met:
    games, a, b, a_nodes, b_nodes, on_edges = np.empty((6, contacts), np.int64)
    times, distances = np.empty((2, contacts))
    return Met(games, a, b, a_nodes, b_nodes, times, distances, np.empty(contacts, np.uint64), on_edges)


# -- in the game of a context ------------------------------------------------------------------------------------------


class MetInGame(NamedTuple):
    """The contacts of one game.

    Attributes:
        agents: those that they number.
        node_ids: of the nodes that they number.
        met: the contacts.
        tracks: of the agents, in games by metres.
        in_air: agent -> where it is, of those that fly where straight lines count.
    """

    agents: Sequence[IAgent]
    node_ids: Sequence[int]
    met: Met
    tracks: Sequence[Track]
    in_air: Mapping[str, Position]


def met_in_game(
    ctx: Context, agents: Sequence[IAgent], sides: Sequence[int], nearness: Nearness, in_air: Mapping[str, Position]
) -> MetInGame:
    """Return the contacts of the turn.

    Args:
        ctx: the context.
        agents: of either side.
        sides: of each, as `core.Tracks` has it.
        nearness: what counts as a contact.
        in_air: agent -> where it is, of those that fly where straight lines count.
    """
    by_metres = ctx.game.speed_unit != "edges"
    # Where agents pass each other at the end of a turn that counts edges, how they came there counts.
    tracks = tracks_of(ctx, agents, passing=nearness.passing or not by_metres)
    edges = EdgesGoneAlong(ctx)
    numbers = _numbers(tracks)
    paths = _paths(tracks, numbers, sides)
    legs = _legs(edges, tracks, numbers) if by_metres else no_legs(len(agents))
    near: Lines | Reach | None = None
    if nearness.unit == "euclid":
        places = [in_air.get(agent.name) for agent in agents]
        near = _lines(edges, tracks, places) if by_metres else _places(ctx.graph.graph, paths, numbers, places)
    elif nearness.unit is not None:
        near = _reach(ctx.graph.graph, numbers, nearness)
    names = kernels.name_keys(agent.name for agent in agents)
    purpose = np.array([kernels.purpose_key(ctx.seed, "contacts")], np.uint64)
    met = find(paths, legs, Draws(names, purpose, np.array([ctx.game.turn])), nearness, near, by_metres=by_metres)
    return MetInGame(agents, list(numbers), met, tracks, in_air)


def _numbers(tracks: Sequence[Track]) -> dict[int, int]:
    """Return node id -> its number, of all nodes on the ways of agents."""
    nodes = dict.fromkeys(chain.from_iterable(track.path for track in tracks))
    for track in tracks:
        for leg in track.legs:
            nodes[leg.source] = nodes[leg.target] = None
    return {node: number for number, node in enumerate(nodes)}


def _paths(tracks: Sequence[Track], numbers: Mapping[int, int], sides: Sequence[int]) -> Paths:
    lengths = [len(track.path) for track in tracks]
    most = max(lengths)
    nodes = np.zeros((len(tracks), most), np.int64)
    times = np.ones((len(tracks), most))
    counts = np.array(lengths)
    is_there = np.arange(most) < counts[:, None]
    nodes[is_there] = [numbers[node] for track in tracks for node in track.path]
    times[is_there] = [time for track in tracks for time in track.times]
    return Paths(len(tracks), len(numbers), nodes, times, counts, np.array(sides, np.int64))


def _legs(edges: EdgesGoneAlong, tracks: Sequence[Track], numbers: Mapping[int, int]) -> Legs:
    rows = [(row, place, leg) for row, track in enumerate(tracks) for place, leg in enumerate(track.legs)]
    most = max(len(track.legs) for track in tracks)
    streets: dict[int, int] = {}
    ints = np.zeros((4, len(tracks), most), np.int64)
    floats = np.zeros((5, len(tracks), most))
    for row, place, leg in rows:
        length = edges.length_of(leg)
        flags = _BACKWARDS * (leg.street != leg.edge) + _TURNS * (leg.back is not None) + _REMOVED * (length is None)
        street = streets.setdefault(leg.street, len(streets))
        ints[:, row, place] = numbers[leg.source], numbers[leg.target], street, flags
        floats[:, row, place] = leg.begin, leg.end, leg.since, leg.until, length or 0.0
    counts = np.array([len(track.legs) for track in tracks])
    return Legs(len(streets), counts, *ints, *floats)


def _reach(graph: Graph, numbers: Mapping[int, int], nearness: Nearness) -> Reach:
    search = partial(nodes_within, graph) if nearness.unit == "hops" else _by_length(graph)
    rows = []
    for node in numbers:
        far = search(node, nearness.limit)
        rows.append(sorted((numbers[end], far[end]) for end in far.keys() & numbers.keys()))
    counts = [len(row) for row in rows]
    ends = [number for row in rows for number, _ in row]
    far = [metres for row in rows for _, metres in row]
    offsets = [0, *accumulate(counts)][:-1]
    return Reach(np.array(offsets), np.array(counts), np.array(ends, np.int64), np.array(far, np.float64))


def _by_length(graph: Graph) -> Any:
    return lambda node, limit: graph.distances(source=node, cutoff=limit)


def nodes_within(graph: Graph, node: int, limit: float) -> dict[int, float]:
    """Return the nodes at most so many edges ahead of a node, each with the number of edges."""
    # NOTE: 5 us for what lies 3 edges around a node of Helsinki, where a search of the whole graph takes 170 us.
    near, hops, ring, far = graph.neighborhoods, {node: 0.0}, [node], 0.0
    while ring and far + 1.0 <= limit:
        far += 1.0
        ring = [end for end in dict.fromkeys(end for start in ring for end in near[start]) if end not in hops]
        hops.update(dict.fromkeys(ring, far))
    return hops


def _places(graph: Graph, paths: Paths, numbers: Mapping[int, int], in_air: Sequence[Position | None]) -> Lines:
    """Return where agents are on the nodes that they pass, in games that count edges."""
    rows, most = paths.nodes.shape
    xyz = np.zeros((len(numbers), 3))
    xyz[:, :2] = graph.positions([*numbers])
    begins = xyz[paths.nodes]
    for row, place in enumerate(in_air):
        if place is not None:
            begins[row] = place
    nothing = np.zeros(rows * most)
    return Lines(np.arange(rows + 1) * most, nothing, nothing, begins, begins)


def _lines(edges: EdgesGoneAlong, tracks: Sequence[Track], in_air: Sequence[Position | None]) -> Lines:
    rows = [list(edges.lines_of(track, at)) for track, at in zip(tracks, in_air, strict=True)]
    lines = [line for row in rows for line in row]
    offsets = np.array([0, *accumulate(len(row) for row in rows)])
    since = np.array([line[0] for line in lines])
    until = np.array([line[1] for line in lines])
    begins = np.array([line[2] for line in lines], np.float64)
    ends = np.array([line[3] for line in lines], np.float64)
    return Lines(offsets, since, until, begins, ends)


# -- in many games -----------------------------------------------------------------------------------------------------


def met_in_turn(turn: ArrayTurn, ours: IntArray, theirs: IntArray, nearness: Nearness) -> Met:
    """Return the contacts of a turn of many games; nodes are numbered by their rows.

    Args:
        turn: of the games.
        ours: (agents,) the numbers of one side in the roster.
        theirs: likewise.
        nearness: what counts as a contact.
    """
    sides = np.zeros(turn.node.shape, np.int64)
    sides[:, ours] += 1
    sides[:, theirs] += 2
    sides[~turn.alive] = 0
    by_move = turn.is_there_by_move
    nodes, times, lengths = _steps_of(turn, by_move)
    by_metres = turn.paths is not None and turn.paths.legs is not None
    legs = no_legs(turn.node.size)
    if turn.paths is not None and turn.paths.legs is not None:
        legs = _legs_of(turn, turn.paths.legs, by_move)
    most = nodes.shape[-1]
    paths = Paths(
        turn.node.shape[1],
        turn.streets.num_nodes,
        nodes.reshape(-1, most),
        times.reshape(-1, most),
        lengths.reshape(-1),
        sides.reshape(-1),
    )
    near: Lines | Reach | None = None
    if nearness.unit == "euclid":
        in_air = turn.in_air() if nearness.air else None
        near = _places_of(turn, nodes, in_air)
        if turn.paths is not None and turn.paths.legs is not None:
            near = _lines_of(turn, legs, turn.paths.legs.edge, in_air, passing=nearness.passing)
    elif nearness.unit is not None:
        near = _near_nodes(turn, nearness).around(
            np.concatenate([column.ravel() for column in (nodes, legs.sources, legs.targets)])
        )
    draws = Draws(turn.roster.keys, purposes_in(turn, "contacts"), turn.turn)
    return find(paths, legs, draws, nearness, near, by_metres=by_metres)


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


def _legs_of(turn: ArrayTurn, legs: LegsOfTurn, by_move: BoolArray) -> Legs:
    columns, edge, back = movement_in(turn).columns, legs.edge, legs.back
    ids = columns.edge_ids
    counts = np.where(by_move, (edge >= 0).sum(axis=-1), 0)
    streets = np.where((back >= 0) & (ids[back] < ids[edge]), back, edge)
    at = np.nonzero(edge >= 0)
    flags = _BACKWARDS * (streets != edge) + _TURNS * (back >= 0)
    flags[at] += _REMOVED * (movement_in(turn).all_roads.states(edge[at], turn.games[at[0]]) == REMOVED)
    ends = (columns.sources[edge], columns.targets[edge], streets, flags)
    spans = (legs.begin, legs.end, legs.since, legs.until, columns.lengths[edge])
    parts: list[Any] = [column.reshape(counts.size, edge.shape[-1]) for column in (*ends, *spans)]
    return Legs(len(ids), counts.reshape(-1), *parts)


def _near_nodes(turn: ArrayTurn, nearness: Nearness) -> NearNodes:
    unit, limit = nearness.unit, nearness.limit
    return turn.shared(("near", unit, limit), lambda: NearNodes(turn.streets, limit, by_length=unit == "metres"))


def _places_of(turn: ArrayTurn, nodes: IntArray, in_air: tuple[IntArray, FloatArray] | None) -> Lines:
    """Return where agents are on the nodes that they pass, in games that count edges."""
    begins = np.zeros((*nodes.shape, 3))
    for axis, places in enumerate(turn.streets.axes):
        begins[..., axis] = places[nodes]
    if in_air is not None:
        begins[:, in_air[0]] = in_air[1][:, :, None]
    nothing = np.zeros(nodes.size)
    return Lines(np.arange(turn.node.size + 1) * nodes.shape[-1], nothing, nothing, begins, begins)


def _lines_of(
    turn: ArrayTurn, legs: Legs, edges: IntArray, in_air: tuple[IntArray, FloatArray] | None, *, passing: bool
) -> Lines:
    """Return the straight parts of the ways of agents, by the lines on the map, in games by metres."""
    agents = turn.node.shape[1]
    visits = turn.visits(turn.alive, passing=passing)
    here = np.zeros((len(visits.at), 3))
    for axis, places in enumerate(turn.streets.axes):
        here[:, axis] = places[visits.nodes]
    if in_air is not None:
        some = np.flatnonzero(np.isin(visits.agents, in_air[0]))
        here[some] = in_air[1][visits.at[some], np.searchsorted(in_air[0], visits.agents[some])]
    edge = edges.reshape(legs.sources.shape)
    counts = (np.arange(legs.most) < legs.counts[:, None]) & (legs.flags & _REMOVED == 0)
    counts &= turn.alive.reshape(-1, 1)
    begins, since, until = legs.begins, legs.since, legs.until
    if not passing:  # those that are on an edge at the end
        is_last = np.arange(legs.most) == legs.counts[:, None] - 1
        counts &= is_last & (legs.ends > 0.0) & (legs.ends < 1.0)
        begins = legs.ends
        since = until = np.ones(begins.shape)
    rows, places = np.nonzero(counts)
    at = rows, places
    which, share, x, y = movement_in(turn).lines.corners(edge[at], begins[at], legs.ends[at])
    is_last, is_first = np.diff(which, append=-1) != 0, np.diff(which, prepend=-1) != 0
    begin, end, start, stop = begins[at], legs.ends[at], since[at], until[at]
    with np.errstate(divide="ignore", invalid="ignore"):
        pace = np.where(end != begin, (stop - start) / (end - begin), 0.0)
    time = start[which] + (share - begin[which]) * pace[which]
    time[is_first], time[is_last] = start, stop
    first, last = np.flatnonzero(~is_last), np.flatnonzero(~is_first)
    corners = np.stack((x, y, np.zeros(len(x))), axis=-1)
    keys = np.concatenate((visits.at * agents + visits.agents, rows[which[first]]))
    order = np.argsort(keys, kind="stable")
    offsets = np.searchsorted(keys[order], np.arange(turn.node.size + 1))
    columns = (
        (visits.begin, time[first]),
        (visits.end, time[last]),
        (here, corners[first]),
        (here, corners[last]),
    )
    return Lines(offsets, *(np.concatenate(parts)[order] for parts in columns))
