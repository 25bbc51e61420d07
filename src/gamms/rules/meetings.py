"""What `gamms.core.contacts` is asked: the columns of agents that it takes, and the contacts that it finds.

`met_in_game` asks it about the game of a context, `met_in_turn` about a turn of many games.
"""

from array import array
from collections.abc import Iterable, Iterator, Mapping, Sequence
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
from gamms.rules.near_nodes import NearNodes
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


Near = core.Reach | core.Places | core.Lines | None


class Question(NamedTuple):
    """What the core is asked.

    Attributes:
        tracks, legs: of all agents.
        near: what says how far places are from each other; None: agents meet on nodes.
        names: (agents,) the keys of their names.
        purposes, turns: (games,) the keys of the purpose for which lots decide between equals, and turns.
        pieces: the most that the agents of one game do in a turn, one after the other.
        keys: how many numbers of nodes and of streets there are at most.
        by_metres: whether the games are by metres.
    """

    tracks: core.Tracks
    legs: core.Legs
    near: Near
    names: memoryview
    purposes: memoryview
    turns: memoryview
    pieces: int
    keys: int
    by_metres: bool


class _Room(NamedTuple):
    """What the core writes into: of so many pieces, keys and contacts."""

    pieces: int
    keys: int
    met: Met
    order: IntArray
    core: core.Contacts


_IDLE: list[_Room] = []  # which is used again, as making one takes longer than to find the contacts of a few agents


def find(question: Question, nearness: Nearness) -> Met:
    """Return the contacts of a turn."""
    contacts = _FIRST_ROOM
    while True:
        room = _room_for(question, contacts)
        near = question.near
        room.core.ask(
            question.tracks,
            question.legs,
            question.names,
            question.purposes,
            question.turns,
            reach=near if isinstance(near, core.Reach) else _NO_REACH,
            places=near if isinstance(near, core.Places) else _NO_PLACES,
            lines=near if isinstance(near, core.Lines) else _NO_LINES,
            crossing=nearness.crossing,
            by_metres=question.by_metres,
        )
        if isinstance(near, core.Reach):
            is_exact = question.by_metres and nearness.unit == "metres"
            contacts = room.core.find_by_paths(nearness.limit, is_exact)
        elif isinstance(near, core.Places):
            contacts = room.core.find_near_places(nearness.limit)
        elif isinstance(near, core.Lines):
            contacts = room.core.find_on_lines(nearness.limit)
        else:
            contacts = room.core.find_on_nodes()
        if contacts <= len(room.order):
            found = _NONE if not room.core.kept else room.met.those(room.order[: room.core.kept])
            _IDLE.append(room)
            return found


def _room_for(question: Question, contacts: int) -> _Room:
    try:
        idle = _IDLE.pop()
    except IndexError:
        idle = None
    if idle is not None:
        if question.pieces <= idle.pieces and question.keys <= idle.keys and contacts <= len(idle.order):
            return idle
        # What is once used is often used again, by a game and a batch in turn.
        contacts = max(contacts, len(idle.order))
    pieces = max(question.pieces, 0 if idle is None else idle.pieces)
    keys = max(question.keys, 0 if idle is None else idle.keys)
    met, order = _columns(contacts), np.empty(contacts, np.int64)
    ints, floats, first = np.empty((6, pieces), np.int64), np.empty((4, pieces)), np.full(keys, -1)
    scratch = core.Pieces(*_flat((*ints[:3], *floats, *ints[3:5], first, ints[5])))
    return _Room(pieces, keys, met, order, core.Contacts(scratch, *_flat((*met, order))))


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


def _most_pieces(agents: int, most: int, most_legs: int | None) -> int:
    """Return how many pieces there are at most: visits, and in games by metres legs, each with two entries."""
    return agents * (most if most_legs is None else 2 * (most + 2 * most_legs + 1))


_NONE = _columns(0)
_NO_REACH = core.Reach(_column("q"), _column("q"), _column("q"), _column("d"))
_NO_PLACES = core.Places(_column("q"), _column("d"))
_NO_LINES = core.Lines(_column("q"), *[_column("d")] * 4)
_NO_LEGS = core.Legs(0, *[_column("q")] * 5, *[_column("d")] * 5)  # in games that count edges


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
    paths = [track.path for track in tracks]
    most = max(map(len, paths))
    most_legs = max(len(track.legs) for track in tracks) if by_metres else 0
    near: Near = None
    if nearness.unit == "euclid":
        places = [in_air.get(agent.name) for agent in agents]
        near = _lines(edges, tracks, places) if by_metres else _places(ctx.graph.graph, paths, most, numbers, places)
    elif nearness.unit is not None:
        # Where none passes a node, those that agents have left do not count.
        asked = numbers if by_metres or most > 2 else dict.fromkeys(path[-1] for path in paths)
        near = _reach(ctx.graph.graph, asked, numbers, nearness)
    question = Question(
        core.Tracks(len(tracks), most, *_nodes_and_times(tracks, most, numbers, sides), at_end=not nearness.passing),
        _legs(edges, tracks, most_legs, numbers) if by_metres else _NO_LEGS,
        near,
        _column("Q", [kernels.name_key(agent.name) for agent in agents]),
        _column("Q", [kernels.purpose_key(ctx.seed, "contacts")]),
        _column("q", [ctx.game.turn]),
        max(
            _most_pieces(len(tracks), most, most_legs if by_metres else None),
            near.parts if isinstance(near, core.Lines) else 0,
        ),
        len(numbers) + most_legs * len(tracks),
        by_metres,
    )
    return MetInGame(agents, list(numbers), find(question, nearness), tracks, in_air)


def _numbers(tracks: Sequence[Track]) -> dict[int, int]:
    """Return node id -> its number, of all nodes on the ways of agents."""
    nodes = dict.fromkeys(chain.from_iterable([track.path for track in tracks]))
    for track in tracks:
        for leg in track.legs:
            nodes[leg.source] = nodes[leg.target] = None
    return dict(zip(nodes, range(len(nodes)), strict=True))


def _nodes_and_times(
    tracks: Sequence[Track], most: int, numbers: Mapping[int, int], sides: Sequence[int]
) -> Iterator[Any]:
    """Yield the columns of `core.Tracks`."""
    nodes, times = list[int](), list[float]()
    for track in tracks:
        path = track.path
        nodes += path
        times += track.times
        if len(path) < most:
            nodes += path[-1:] * (most - len(path))
            times += (1.0,) * (most - len(path))
    yield _column("q", map(numbers.__getitem__, nodes))
    yield _column("d", times)
    yield _column("q", [len(track.path) for track in tracks])
    yield _column("q", sides)


def _legs(edges: EdgesGoneAlong, tracks: Sequence[Track], most: int, numbers: Mapping[int, int]) -> core.Legs:
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
            ints[:, row, place] = numbers[leg.source], numbers[leg.target], street, flags
            floats[:, row, place] = leg.begin, leg.end, leg.since, leg.until, length or 0.0
    counts = np.array([len(track.legs) for track in tracks])
    return core.Legs(most, *_flat((counts, *ints, *floats)))


def _reach(graph: Graph, asked: Iterable[int], numbers: Mapping[int, int], nearness: Nearness) -> core.Reach:
    """Return how far it is from the nodes that are asked for to those that have numbers."""
    search = partial(nodes_within, graph) if nearness.unit == "hops" else _by_length(graph)
    offsets, counts = [0] * len(numbers), [0] * len(numbers)
    ends, distances = list[int](), list[float]()
    for node in asked:
        far = search(node, nearness.limit)
        row = sorted([(numbers[end], far[end]) for end in far.keys() & numbers.keys()])
        offsets[numbers[node]], counts[numbers[node]] = len(ends), len(row)
        ends += [end for end, _ in row]
        distances += [distance for _, distance in row]
    return core.Reach(_column("q", offsets), _column("q", counts), _column("q", ends), _column("d", distances))


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


def _places(
    graph: Graph,
    paths: Sequence[Sequence[int]],
    most: int,
    numbers: Mapping[int, int],
    in_air: Sequence[Position | None],
) -> core.Places:
    places = [(x, y, 0.0) for x, y in graph.positions([*numbers]).tolist()]
    found: list[int] = []
    for path, place in zip(paths, in_air, strict=True):
        if place is None:
            found += [numbers[node] for node in path]
            found += [0] * (most - len(path))
        else:
            found += [len(places)] * most
            places.append(place)
    return core.Places(_column("q", found), _column("d", chain.from_iterable(places)))


def _lines(edges: EdgesGoneAlong, tracks: Sequence[Track], in_air: Sequence[Position | None]) -> core.Lines:
    rows = [list(edges.lines_of(track, at)) for track, at in zip(tracks, in_air, strict=True)]
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
        theirs: likewise.
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
        near = core.Reach(*_flat(_near_nodes(turn, nearness).around(asked)))
    most_legs = 0 if legs is None else legs.sources.shape[-1]
    parts = near.parts if isinstance(near, core.Lines) else 0
    names, purposes, turns = _flat((turn.roster.keys, purposes_in(turn, "contacts"), turn.turn))
    question = Question(
        core.Tracks(agents, most, *_flat((nodes, times, lengths, sides)), at_end=not nearness.passing),
        _NO_LEGS if legs is None else core.Legs(most_legs, *_flat(legs[1:])),
        near,
        names,
        purposes,
        turns,
        max(parts, _most_pieces(agents, most, None if legs is None else most_legs)),
        max(turn.streets.num_nodes, 0 if legs is None else len(movement_in(turn).columns.edge_ids)),
        legs is not None,
    )
    return find(question, nearness)


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
    unit, limit = nearness.unit, nearness.limit
    return turn.shared(("near", unit, limit), lambda: NearNodes(turn.streets, limit, by_length=unit == "metres"))


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
