"""Lets the core play rules in a turn of games that arrays play: tags, flags, goals, agents that come back, ends."""

from collections.abc import Callable
from functools import partial
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from gamms import kernels
from gamms.core import contacts, rules
from gamms.game.batch.columns import places_of
from gamms.game.batch.in_core import Making, Near, floats, ints, memory_of, put_scores
from gamms.game.batch.movement import Legs as LegsOfTurn
from gamms.game.batch.roads import REMOVED
from gamms.game.batch.state import GameArrays
from gamms.game.batch.turn import ArrayRule, ArrayTurn, movement_in, note_in, state_in
from gamms.game.conflicts import flat
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.rules.meetings import BACKWARDS, NO_LEGS, TURNS, UNKNOWN_PLACE, Room, most_pieces
from gamms.rules.near_nodes import NearNodes, reached

_FIRST_ROOM = 64  # events
_MOST_NEAR = 1 << 25  # pairs of nodes, for each distance


def array_form_of(core_form: Callable[[Making], rules.Rule] | None) -> ArrayRule | None:
    """Return the array form of a rule that is a function of the core; None: it is none."""
    return None if core_form is None else partial(_play, core_form)


def _play(core_form: Callable[[Making], rules.Rule], turn: ArrayTurn) -> None:
    making = MakingOfTurn(turn)
    rule = core_form(making)
    making.refuse_unknown_agents()
    rules.play_games(rule, flat(turn.games, np.int64))
    making.end()


class _Columns:
    """The columns of all games of a batch that the core works on in turns of arrays.

    Args:
        state: of the batch.

    Attributes:
        starts, node: (games, agents)
        alive, placed: (games, agents) 0 or 1.
        turn, over: (games,)
        home: (games, agents) see `rules.Games`.
        score: (games, teams)
        games: the same for the core.
    """

    def __init__(self, state: GameArrays) -> None:
        roster, (games, agents) = state.roster, state.node.shape
        self.starts, self.node = np.zeros((2, games, agents), np.int64)
        self.home = state.start if roster.is_first.all() else np.zeros_like(state.start)
        self.alive, self.placed = np.zeros((2, games, agents), np.uint8)
        self.turn, self.over = np.zeros(games, np.int64), np.zeros(games, np.uint8)
        self.score = np.zeros((games, len(roster.teams)))
        self.games = rules.Games(
            agents,
            len(roster.teams),
            node=memory_of(self.node),
            start=memory_of(self.starts),
            previous=np.zeros(games * agents, np.int64).data,
            alive=memory_of(self.alive),
            placed=memory_of(self.placed),
            stops=memory_of(state.stops),
            home=memory_of(self.home),
            turn=self.turn.data,
            over=self.over.data,
            score=memory_of(self.score),
            team=flat(roster.team_of, np.int64),
            nobody=roster.teams.index(None) if None in roster.teams else -1,
        )

    def begin(self, state: GameArrays, turn: ArrayTurn) -> None:
        """Take where a turn is."""
        self.node[turn.games], self.alive[turn.games], self.turn[turn.games] = turn.node, turn.alive, turn.turn
        self.over[:] = 0
        if self.home is not state.start:  # those that have come since began where they are
            self.home[turn.games] = turn.start_of(np.arange(self.home.shape[1]))
        put_scores(state, self.score)


class MakingOfTurn(Making):
    """What the rules of one turn of games in arrays are made with; the columns of the core have all games of the batch.

    Args:
        turn: of the games.
    """

    def __init__(self, turn: ArrayTurn) -> None:
        state = state_in(turn)
        self.state = state
        self._turn = turn
        self._columns = columns = turn.shared("columns of the core", partial(_Columns, state))
        columns.begin(state, turn)
        self.games = columns.games
        self.home = columns.home
        self.events = rules.Events(_FIRST_ROOM)
        self.rules = []
        self.agents_in = []
        self._has_followed = False
        self._filled: rules.Steps | None = None  # what fills columns of one game so far

    def tracks(self, sides: memoryview, *, at_end: bool) -> contacts.Tracks:
        """Return the tracks of the agents of a game, of these sides."""
        self._follow()
        return super().tracks(sides, at_end=at_end)

    def near(self, nearness: tuple[str | None, float, bool, bool, bool]) -> Near:
        """Return the distances between agents that count as contacts; None: they meet on nodes."""
        turn, (unit, limit, _, air, passing) = self._turn, nearness
        if unit is None:
            return None
        self._follow()
        legs, nodes = self._legs, _steps_of(turn, self._by_move)[0]
        if unit != "euclid":
            asked = nodes if legs is None else np.concatenate((nodes, legs.sources, legs.targets), axis=-1)
            return _near_nodes(turn, unit, limit).around(asked, turn.streets.num_nodes)
        in_air = turn.in_air() if air else None
        if legs is None:
            numbers, xyz = _places_of(turn, nodes, in_air)
            return contacts.Places(self._window([numbers], [])[0][0], flat(xyz, np.float64))
        offsets, *lines = _lines_of(turn, legs, in_air, passing=passing)
        agents = nodes.shape[1]
        rows = offsets[np.arange(len(nodes))[:, None] * agents + np.arange(agents + 1)]
        self._make_room(int((rows[:, -1] - rows[:, 0]).max(initial=0)))
        return contacts.Lines(self._window([rows], [])[0][0], *[flat(one, np.float64) for one in lines])

    def end(self) -> None:
        """Let the turn have what has happened."""
        noted = self.read(self._columns.score)
        self.state.is_going[self._columns.over > 0] = False
        if noted is not None:
            note_in(self._turn, noted)

    def _follow(self) -> None:
        """Take how agents have moved, once."""
        if self._has_followed:
            return
        turn, columns, agents = self._turn, self._columns, len(self._turn.roster.names)
        self._has_followed = True
        self._by_move = by_move = turn.is_there_by_move
        legs = None if turn.paths is None or turn.paths.legs is None else _legs_of(turn, turn.paths.legs, by_move)
        self._legs, self._most_nodes, self.by_metres, self.legs = legs, 2, legs is not None, NO_LEGS
        if turn.paths is None:
            columns.starts[turn.games], columns.placed[turn.games] = turn.starts, ~by_move
            self._tracks = ints(2 * agents), floats(2 * agents), ints(agents)
            self.steps = self._filled = rules.Steps(*self._tracks)
        else:
            self._take_paths(legs)
        self._make_room(0)

    def _take_paths(self, legs: "_Legs | None") -> None:
        """Take the tracks of agents, and parts of edges."""
        nodes, times, lengths = _steps_of(self._turn, self._by_move)
        numbers, shares = (list[IntArray](), list[FloatArray]()) if legs is None else ([*legs[1:6]], [*legs[6:]])
        (path, counts, *whole), (moments, *parts) = self._window([nodes, lengths, *numbers], [times, *shares])
        self._tracks, self._most_nodes = (path, moments, counts), nodes.shape[-1]
        if legs is not None:
            self.legs = contacts.Legs(legs.sources.shape[-1], *whole, *parts)

    def _make_room(self, parts: int) -> None:
        """Make room for what the agents of a game do, and so many parts of lines."""
        legs, turn = self._legs, self._turn
        most_legs, edges = (0, 0) if legs is None else (legs.sources.shape[-1], len(movement_in(turn).columns.edge_ids))
        pieces = most_pieces(len(turn.roster.names), self._most_nodes, most_legs)
        room = turn.shared("contacts", Room)
        self.pieces = room.scratch(max(pieces, parts), max(turn.streets.num_nodes, edges))

    def _window(self, whole: list[IntArray], parts: list[FloatArray]) -> tuple[list[Any], list[Any]]:
        """Return columns of one game, which get what columns of all, (games of the turn, …), have of it."""
        all_of, own = list[Any](), list[list[Any]]()
        for columns, kind in ((whole, np.int64), (parts, np.float64)):
            rows = [one.reshape(len(one), -1).astype(kind, copy=False) for one in columns]
            joined = np.concatenate(rows, axis=1) if rows else np.zeros(0, kind)
            column = np.zeros(joined.shape[-1], kind)
            all_of += [joined.reshape(-1).data, column.data]
            bounds = np.cumsum([0, *[one.shape[1] for one in rows]]).tolist()
            own.append([column[begin:end].data for begin, end in pairwise(bounds)])
        all_ints, own_ints, all_floats, own_floats = all_of
        places = places_of(self._turn.games, len(self.state)).data
        self.steps = self._filled = rules.Courses(places, all_ints, all_floats, own_ints, own_floats, self._filled)
        return own[0], own[1]


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
        counts: (games, agents) how many an agent has; the others see `contacts.Legs`.
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
    columns, at = movement_in(turn).columns, np.nonzero(legs.edge >= 0)
    edge, back, ids = legs.edge[at], legs.back[at], columns.edge_ids
    counts = np.where(by_move, (legs.edge >= 0).sum(axis=-1), 0)
    streets = np.where((back >= 0) & (ids[back] < ids[edge]), back, edge)
    removed = movement_in(turn).all_roads.states(edge, turn.games[at[0]]) == REMOVED
    flags = BACKWARDS * (streets != edge) + TURNS * (back >= 0) + UNKNOWN_PLACE * removed
    # NOTE: few agents go along as many edges as those that go along most (benchmarks: travel).
    ints, lengths = np.zeros((4, *legs.edge.shape), np.int64), np.zeros(legs.edge.shape)
    for column, values in zip(ints, (columns.sources[edge], columns.targets[edge], streets, flags), strict=True):
        column[at] = values
    lengths[at] = columns.lengths[edge]
    return _Legs(*[legs.edge, counts, *ints, legs.begin, legs.end, legs.since, legs.until, lengths])


def _near_nodes(turn: ArrayTurn, unit: str, limit: float) -> NearNodes:
    def make() -> NearNodes:
        streets = turn.streets
        columns = streets.columns
        weights = columns.lengths if unit == "metres" else np.ones(len(columns.lengths))
        arcs = kernels.make_arcs(columns.sources, columns.targets, weights, streets.num_nodes)
        return NearNodes(partial(reached, arcs, limit), _MOST_NEAR)

    return turn.shared(("near", unit, limit), make)


def _places_of(
    turn: ArrayTurn, nodes: IntArray, in_air: tuple[IntArray, FloatArray] | None
) -> tuple[IntArray, FloatArray]:
    """Return the numbers of places of agents on the nodes that they pass, in games that count edges, and the places."""
    x, y = turn.streets.axes
    xyz: FloatArray = turn.shared("places of nodes", lambda: np.stack((x, y, np.zeros(len(x))), axis=-1))
    if in_air is not None:
        agents, places = in_air
        nodes = nodes.copy()
        nodes[:, agents] = len(xyz) + np.arange(places[..., 0].size).reshape(*places.shape[:2], 1)
        xyz = np.concatenate((xyz, places.reshape(-1, 3)))
    return nodes, xyz


def _lines_of(turn: ArrayTurn, legs: _Legs, in_air: tuple[IntArray, FloatArray] | None, *, passing: bool) -> list[Any]:
    """Return the columns of `contacts.Lines` of all agents, by the lines on the map, in games by metres."""
    agents = turn.node.shape[1]
    visits = turn.visits(turn.alive, passing=passing)
    here = np.zeros((len(visits.at), 3))
    for axis, places in enumerate(turn.streets.axes):
        here[:, axis] = places[visits.nodes]
    if in_air is not None:
        some = np.flatnonzero(np.isin(visits.agents, in_air[0]))
        here[some] = in_air[1][visits.at[some], np.searchsorted(in_air[0], visits.agents[some])]
    counts = legs.are_there & (legs.flags & UNKNOWN_PLACE == 0) & turn.alive[..., None]
    if not passing:  # those that are on an edge at the end
        is_last = np.arange(legs.edges.shape[-1]) == legs.counts[..., None] - 1
        counts &= is_last & (legs.ends > 0.0) & (legs.ends < 1.0)
    at = np.nonzero(counts)
    begin, end, since, until = (column[at] for column in (legs.begins, legs.ends, legs.since, legs.until))
    if not passing:
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
    return [offsets, *(np.concatenate(both)[order] for both in parts)]
