"""The initial state of a batch, copied from its game, which may have been played for some turns.

`InitialState` writes it to a block of one game. `NextStarts` has what differs between the games of a batch. The core
begins games with rows of both: `core.block.begin_game`.
"""

from collections import Counter
from collections.abc import Sequence
from itertools import chain
from math import nan
from typing import Any, NamedTuple

import numpy as np

from gamms.core.block import AT_START, GameStarts, StartColumn
from gamms.errors import BadValue
from gamms.game.block.columns import AgentTable, PlayedGame, find_decider, find_starts, get_mode
from gamms.game.block.in_core import CoreColumns, get_memory
from gamms.game.block.state import STOPPED, Drawn, GameArrays
from gamms.game.block.strategy_steps import begin_steps
from gamms.game.movement.courses import Legs, Paths, make_paths_along, make_paths_over
from gamms.game.movement.legal_moves import Movement, TravelTerms
from gamms.game.movement.moves import TurnMoves
from gamms.game.movement.streets import StreetGraph
from gamms.game.settings import as_called
from gamms.game.slots import COUNTED, refuse_modes, refuse_speeds, refuse_turns
from gamms.game.strategy_specs import get_strategy_spec
from gamms.game.turn import describe_closed_edge
from gamms.ir.agents import UNTURNED, get_speed, read_vector
from gamms.ir.game_state import KEPT, GameState
from gamms.ir.graph import ClosedEdges, IntArray, lock_columns
from gamms.ir.obstacles import BoolArray
from gamms.ir.progress import Motion
from gamms.ir.schema import NUMBERS
from gamms.text import shown
from gamms.typing import AgentType
from gamms.typing.game import Track

_NOWHERE = (nan, nan, nan)  # where agents in the air begin that come later


def make_movement(
    game: PlayedGame,
    roster: AgentTable,
    *,
    may_reopen: bool = False,
    is_detached: bool = False,
    more_edges: ClosedEdges | None = None,
) -> Movement:
    """Return the movement of the agents of a game.

    Args:
        game: the game.
        roster: its agents.
        may_reopen: whether closed roads may be opened later.
        is_detached: whether the movement stays the same when the map of the game changes.
        more_edges: edges that are neither open nor closed, but may be open in other games.
    """
    settings = game.settings()
    graph = game.ctx.graph
    columns, routes = graph.storage.detach_graph() if is_detached else (graph.columns(), graph.routes)
    streets = StreetGraph(lock_columns(columns), routes)
    closed = graph.storage.list_roads()[1] if may_reopen else {}
    whole = StreetGraph(*graph.storage.extend_graph({**closed, **(more_edges or {})})) if closed or more_edges else None
    speeds = [None if agent.type is AgentType.AERIAL else agent.speed for agent in roster.agents]
    modes = [get_mode(agent) for agent in roster.agents]
    have_modes = any(mode is not None for mode in modes)
    if have_modes:
        refuse_modes(settings["legal"], [(agent.name, mode) for agent, mode in zip(roster.agents, modes, strict=True)])
        if settings["decide"] == "arrival":
            refuse_turns([(agent.name, mode) for agent, mode in zip(roster.agents, modes, strict=True)])
        if settings["speed_unit"] == "edges":
            refuse_speeds(zip(roster.names, modes, speeds, strict=True))
    if settings["legal"] == "any":
        return Movement(streets, whole, closed, are_all_legal=True)
    if settings["speed_unit"] != "edges":
        terms = TravelTerms.from_game(game)
        return Movement(streets, whole, closed, speeds=speeds, terms=terms, modes=modes)
    depends = have_modes or any(speed is not None for speed in speeds)
    weight = settings["weight"]
    return Movement(streets, whole, closed, speeds=speeds if depends else None, modes=modes, weight=weight)


class NextStarts:
    """What the next starts of the games of a batch have by their seeds: some rows for each game, used in turn.

    Args:
        states: the state of the games on each map, which have begun.
        streets: (games,) the number of the map of each game.
        start: (games, agents) the ids of the start nodes.

    Attributes:
        ahead: the number of rows of each game.
        seeds: the seed of each row.
        streets: (rows,) the number of its map, whatever the strategies on it.
        nodes: (rows, agents) the rows of the start nodes.
        drawn: rows of `BatchColumns.drawn`.
        next: (games,) the row with which each game begins next.
        now: (games,) the row with which it has begun.
    """

    def __init__(self, states: Sequence[GameArrays], streets: IntArray, start: IntArray) -> None:
        self._states = states
        self.ahead = 1
        self.seeds = list(states[0].seeds)
        self.streets = np.zeros_like(streets)
        self.nodes = np.zeros(start.shape, np.int64)
        self.drawn: dict[Drawn, np.ndarray[Any, Any]] = {}
        self.next = np.arange(len(start))
        self.now = np.arange(len(start))
        self._put_nodes(self.next, streets, start)

    def get_seeds(self, rows: IntArray) -> list[int]:
        """Return the seeds of rows."""
        return [self.seeds[row] for row in rows.tolist()]

    def make_room(self, ahead: int) -> None:
        """Reserve memory for `ahead` rows of each game, which all are as the one with which it has begun."""
        rows = np.repeat(self.now, ahead)
        self.ahead = ahead
        self.seeds = [self.seeds[row] for row in rows.tolist()]
        self.streets = self.streets[rows]
        self.nodes = self.nodes[rows]
        self.drawn = {key: one[rows] for key, one in self.drawn.items()}
        self.now = np.arange(len(self.now)) * ahead
        self.next = self.now.copy()

    def prepare(self, rows: IntArray, seeds: Sequence[int], streets: IntArray, start: IntArray) -> None:
        """Set the seeds of rows, their maps and start nodes, as above, and draw the rest."""
        self._draw_new()
        for row, seed in zip(rows.tolist(), seeds, strict=True):
            self.seeds[row] = seed
        for key, drawn in self._states[0].draw_rows(seeds).items():
            self.drawn[key][rows] = drawn
        self._put_nodes(rows, streets, start)

    def _put_nodes(self, rows: IntArray, streets: IntArray, start: IntArray) -> None:
        self.streets[rows] = streets
        for number, state in enumerate(self._states):
            which = np.flatnonzero(streets == number)
            self.nodes[rows[which]] = state.streets.rows(start[which])

    def list_drawn(self) -> list[tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]]:
        """Return the columns of games that seeds draw, each with its rows."""
        self._draw_new()
        return [(column, self.drawn[key]) for key, column in self._states[0].drawn.items()]

    def _draw_new(self) -> None:
        """Draw what games have drawn by their seeds since the last call."""
        state = self._states[0]
        if len(self.drawn) < len(state.drawn):
            found = state.drawn if self.seeds == state.seeds else state.draw_rows(self.seeds)
            self.drawn |= {key: found[key].copy() for key in found if key not in self.drawn}


class BeginningGames:
    """The games on a map that begin: each with the row of a block of one game, and with rows of its own.

    Args:
        state: the state of all games.
        columns: the columns of all games that the core writes.
        first: the state of the block of one game, whose nodes are `AT_START` where games draw them.
        first_columns: its columns that the core writes.
        starts: what games have by their seeds.
    """

    def __init__(
        self,
        state: GameArrays,
        columns: CoreColumns,
        first: GameArrays,
        first_columns: CoreColumns,
        starts: NextStarts,
    ) -> None:
        self._state = state
        self._starts = starts
        mine = state.begun_columns + columns.begun_columns
        theirs = first.begun_columns + first_columns.begun_columns
        self._columns = [pair for pair in zip(mine, theirs, strict=True) if pair[1].size]
        self._core: tuple[tuple[int, int], GameStarts] | None = None  # with the numbers of rows and drawn columns

    @property
    def core(self) -> GameStarts:
        """The same for the core."""
        starts = self._starts
        form = starts.ahead, len(self._state.drawn)
        if self._core is None or self._core[0] != form:
            behind: StartColumn | None = None
            for column, row in self._columns:
                behind = _start_column(column, row, behind, is_shared=True)
            for column, rows in starts.list_drawn():
                behind = _start_column(column, rows, behind, is_shared=False)
            assert behind is not None  # noqa: S101 - games have columns
            made = GameStarts(
                behind,
                get_memory(starts.nodes),
                len(self._state.roster.names),
                get_memory(starts.streets),
                get_memory(starts.next),
                get_memory(starts.now),
                starts.ahead,
            )
            self._core = form, made
        return self._core[1]


class InitialState:
    """The initial state of the games on one map of a batch.

    Args:
        game: the game at the start of the batch; its context is not played in.
        state: the state of a block of one game, which gets this state; with agents and channels already set.
        columns: its columns that the core writes.

    Attributes:
        turn: the number of turns played before the batch.
        last_turn: the moves of the last turn, if an array rule reads them; None: no rule does, or no turn was played.

    Raises:
        BadValue: a node where an agent was is no longer on the map.
        UnknownName (KeyError): an agent moved over a node that is no longer on the map.
    """

    def __init__(self, game: PlayedGame, state: GameArrays, columns: CoreColumns) -> None:
        if game.turn:
            _take_places(game, state.movement)
        values = game.internals.state
        self.turn = game.turn
        self._parts_played = values.parts_played
        self._over = game.over
        self._scores = dict(values.scores)
        self._errors = [*values.errors]
        self._events = [*values.events]
        self._messages = [*values.messages]
        self._deeds = [*values.deeds]
        self._last_deeds = [] if values.parts_played else values.deed_log.list_last(values.row)
        self.last_turn: LastTurn | None = None
        self._write_agents(game, state)
        self._write_departed(game, state)
        if state.flights is not None:
            self._take_flights(game, state)
        self._write_counts(values, state)
        state.turn[:] = self.turn
        state.is_going[:] = self._over is None
        columns.begin()
        if self._parts_played:
            columns.part[:] = self._parts_played
            columns.takes_part[:] = state.alive
        self._take_memories(game, state)

    def _write_agents(self, game: PlayedGame, state: GameArrays) -> None:
        """Write which agents live, and where they are; read the moves of the last turn."""
        block = game.ctx.agent.block
        names = state.roster.names
        known = game.ctx.agent.agents
        agents = np.array([number for number, name in enumerate(names) if name in known], np.int64)
        own = block.rows.find_rows([names[number] for number in agents.tolist()])
        rows = state.streets.rows
        node, previous = (rows(np.asarray(block.get_ids(column))[own]) for column in (block.node, block.previous))
        moves = game.internals.state.moves
        is_read = any(one.spec.is_array_function and one.phase == "before" for one in as_called(game.rules))
        if moves is not None and is_read:
            self.last_turn = LastTurn.from_moves(moves, state.roster, state.movement, node[None])
        places = [block.get_progress(row) for row in own]
        is_on_edge = np.array([place is not None for place in places], np.bool_)
        goes_on = self.turn > 0 or game.internals.state.has_begun
        has_node = is_on_edge | goes_on  # at the start, other agents are where their games begin
        has_left = (node != previous) | goes_on
        state.alive[0, agents] = np.asarray(block.alive)[own]
        state.node[0, agents[has_node]] = node[has_node]
        state.previous[0, agents[has_left]] = previous[has_left]
        for number, place in zip(agents.tolist(), places, strict=True):
            if place is not None:
                state.movement.put_on(number, place)
        if state.movement.traffic is not None:
            state.movement.traffic.put_driven(names, game.internals.state.driven)
        for one in NUMBERS:
            numbers = state.numbers[one.name]
            numbers[:] = one.initial
            numbers[0, agents] = [getattr(block, one.name)[row] for row in own]
        placed = {block.names[row] for row in block.placed}
        state.placed[0] = [name in placed for name in names]

    def _write_counts(self, values: GameState, state: GameArrays) -> None:
        """Write who was blocked, the counts of agents, and how often rules have stopped them."""
        names = state.roster.names
        blocked = dict(values.blocked)
        state.blocked[0] = ["in conflict" in blocked.get(name, "") for name in names]
        nothing = dict.fromkeys(COUNTED, 0)
        counts = [values.counts.get(name, nothing) for name in names]
        for kind in COUNTED:
            state.counts[kind][0] = [of_agent[kind] for of_agent in counts]
        events = [event.get(STOPPED.get(event["kind"], "")) for event in values.events]
        stopped = Counter(name for name in events if isinstance(name, str))
        state.stops[0] = [stopped[name] for name in names]

    def _take_memories(self, game: PlayedGame, state: GameArrays) -> None:
        """Copy the memory of rules, strategies and array functions into `state.first`."""
        state.first |= game.internals.state.data.get(KEPT, {})
        for rule in game.rules:
            if rule.spec.begin_arrays is not None:
                state.first |= rule.spec.begin_arrays(game.ctx, state)
        plans = game.settings()["plans"]
        deciders = [find_decider(agent, plans) for agent in state.roster.agents]
        steps = [step for one in deciders for step in get_strategy_spec(one).core_steps or ()]
        state.first |= begin_steps(steps, game.ctx, state)
        state.of_core.update(state.first.keys() - game.internals.state.data.get(KEPT, {}).keys())

    def select_not_under_way(self, state: GameArrays, games: IntArray) -> IntArray:
        """Return the games that are not in a turn of which some parts were played before the batch."""
        return games if self._parts_played is None else games[state.turn[games] > self.turn]

    def put_values(self, state: GameArrays, games: IntArray) -> None:
        """Write the scores, ends, logs and flights of games that have begun with these columns."""
        self._put_flights(state, games)
        state.scores.put(games, self._scores)
        if self._over is not None:
            for game in games.tolist():
                state.over[game] = dict(self._over)
        self._put_logs(state, games)

    def _write_departed(self, game: PlayedGame, state: GameArrays) -> None:
        """Write where agents were deleted."""
        has_node = game.ctx.graph.graph.has_node
        departed = game.internals.state.departed
        gone = {name: node for name, (_, node) in departed.items() if name not in game.ctx.agent.agents}
        gone = {name: node for name, node in gone.items() if has_node(node)}
        numbers = np.array([state.roster.names.index(name) for name in gone], np.int64)
        state.node[0, numbers] = state.streets.rows([*gone.values()])
        teams = state.roster.teams
        state.plays[0, [teams.index(team) for team, _ in departed.values() if team in teams]] = True

    def _take_flights(self, game: PlayedGame, state: GameArrays) -> None:
        """Write the rotations of the flying agents; store their positions, which depend on where games begin."""
        block = game.ctx.agent.block
        numbers = state.flyers
        moves = game.internals.state.moves
        names = [state.roster.names[number] for number in numbers.tolist()]
        known = game.ctx.agent.agents
        starts: list[Any] = [game.internals.find_start(known[name]) if name in known else _NOWHERE for name in names]
        nearest = game.ctx.graph.graph.nearest_node
        below = state.streets.rows([nearest(*(0.0, 0.0) if one is _NOWHERE else one[:2]) for one in starts])
        self._starts_in_air = np.array(starts)
        self._below = state.streets.columns.xy[below]
        rows = [block.find_row(name) if name in known else None for name in names]
        columns = ("position", "previous_position", "quat")
        poses = [[None if row is None else read_vector(block, name, row) for row in rows] for name in columns]
        state.quat[0] = [quat or UNTURNED for quat in poses[2]]
        each = zip(*poses[:2], starts, strict=True)  # an agent at its start is there in all games
        self._places_in_air = np.array(
            [[_NOWHERE if place in (None, start) else place for place in both] for *both, start in each]
        )
        places = [None if moves is None else moves.find_index(name) for name in names]
        put = np.array([place is not None and moves is not None and moves.is_displaced(place) for place in places])
        state.has_flown[0] = put & ~state.placed[0, numbers]
        state.placed[0, numbers] |= state.has_flown[0]

    def _put_flights(self, state: GameArrays, games: IntArray) -> None:
        if state.flights is not None:
            below = state.streets.columns.xy[state.start[np.ix_(games, state.flyers)]]
            starts = np.tile(self._starts_in_air, (len(games), 1, 1))
            is_elsewhere = (below != self._below).any(axis=-1)
            starts[is_elsewhere, :2] = below[is_elsewhere]  # at the same heights in all games
            state.start_position[games] = starts
            state.position[games], state.previous_position[games] = np.moveaxis(
                np.where(np.isnan(self._places_in_air), starts[:, :, None], self._places_in_air), 2, 0
            )

    def _put_logs(self, state: GameArrays, games: IntArray) -> None:
        state.errors.begin(games, self._errors)
        state.events.begin(games, self._events)
        if state.radio is not None:
            state.radio.go_on(games, self._messages, self.turn)
        state.deed_log.begin(games, self._deeds, self._last_deeds)


def _take_places(game: PlayedGame, movement: Movement) -> None:
    """Refuse agents whose nodes were removed, and put agents on nodes whose edges are gone, as their turn would.

    Raises:
        BadValue: a node was removed.
    """
    block = game.ctx.agent.block
    graph = game.ctx.graph
    by_metres = movement.by_metres
    edges = movement.columns.edge_ids  # those that are open, or that a function may open
    starts = find_starts(game)
    previous = block.get_ids(block.previous)
    on_ground = [row for row in map(block.find_row, sorted(block.names)) if not block.kind[row]]
    nodes_of = {row: (starts[block.names[row]], previous[row]) for row in on_ground}
    has_node = {node: graph.graph.has_node(node) for node in {*chain.from_iterable(nodes_of.values())}}
    for row in on_ground:
        for node in nodes_of[row]:
            if not has_node[node]:
                raise BadValue(
                    f"Node {node}, where agent {shown(block.names[row])} started or was before, was removed from the "
                    "map: a batch that continues the game needs it. Close its roads instead, or set "
                    "agent.prev_node_id."
                )
        place = block.get_edge_position(row) if by_metres else block.get_progress(row)
        if place is None and block.get_progress(row) is None:
            continue
        if by_metres and place is not None and place.edge not in edges:
            name = block.names[row]
            game.internals.state.blocked.add(name, describe_closed_edge(place.source, place.target))
            game.internals.state.counts.setdefault(name, dict.fromkeys(COUNTED, 0))["blocked"] += 1
            place = None
        if (
            not by_metres
            and place is not None
            and (get_speed(block, row) is None or place.source != block.get_node(row))
        ):
            place = None
        block.set_progress(row, place)


def _start_column(
    column: np.ndarray[Any, Any], rows: np.ndarray[Any, Any], behind: StartColumn | None, *, is_shared: bool
) -> StartColumn:
    """Return a column of games for the core, and the rows with which they begin; `is_shared`: one for all."""
    draws_nodes = is_shared and rows.dtype == np.int64 and bool((rows == AT_START).any())
    nodes: Any = column.reshape(-1).data if draws_nodes else np.zeros(0, np.int64).data
    size = rows[:1].nbytes
    return StartColumn(_get_bytes(column), _get_bytes(rows), nodes, size, 0 if is_shared else size, behind)


def _get_bytes(column: np.ndarray[Any, Any]) -> Any:  # memoryviews are not subscriptable
    """Return the memory of a column, which is in one piece and has no objects."""
    memory: Any = column.data
    return memory.cast("B") if column.size else np.zeros(0, np.uint8).data


# -- the last turn before the batch ----------------------------------------------------------------------------------

_SHORT = {1: (0.0,), 2: (0.0, 1.0)}  # length of a path -> times at its nodes, if the agent stays or takes one edge


class LastTurn(NamedTuple):
    """The moves of the last turn of one game; arrays are (1, agents). See `ArrayTurn`."""

    starts: IntArray
    ends: IntArray
    took_part: BoolArray
    paths: Paths | None

    @classmethod
    def from_moves(cls, moves: TurnMoves, roster: AgentTable, movement: Movement, node: IntArray) -> "LastTurn":
        """Return the last moves of a game; `node` are the rows of the agents' current nodes, (1, agents).

        Raises:
            UnknownName (KeyError): a move used a node or an edge that is no longer on the map.
        """
        number = {name: i for i, name in enumerate(roster.names)}
        places = moves.select_taking_part(range(len(moves.slots)))
        pairs = [(i, number[moves.order.names[i]]) for i in places if moves.order.names[i] in number]
        slots = [i for i, _ in pairs]
        numbers = np.array([number for _, number in pairs], np.int64)
        starts = node.copy()
        ends = node.copy()
        took_part = np.zeros(node.shape, np.bool_)
        rows = movement.streets.rows
        starts[0, numbers] = rows([int(moves.starts[i]) for i in slots])
        ends[0, numbers] = rows([int(moves.ends[i]) for i in slots])
        took_part[0, numbers] = True
        paths = None
        if movement.by_metres:
            paths = _make_paths_by_metres(moves, slots, numbers, movement, starts)
        elif moves.paths is not None:
            tracks = [moves.get_track(i) for i in slots]
            if any(_SHORT.get(len(track.path)) != track.times or _is_waiting(track) for track in tracks):
                paths = _make_paths(tracks, numbers, movement, starts)
        return cls(starts, ends, took_part, paths)


def _make_paths(tracks: Sequence[Track], numbers: IntArray, movement: Movement, starts: IntArray) -> Paths:
    """Return the paths of all agents, (1, agents): the tracks of `numbers`; other agents stay at `starts`."""
    shape = (*starts.shape, max((len(track.path) for track in tracks), default=1))
    nodes = np.repeat(starts[..., None], shape[-1], axis=-1)
    times = np.zeros(shape)
    lengths = np.ones(starts.shape, np.int64)
    for number, track in zip(numbers.tolist(), tracks, strict=True):
        length = len(track.path)
        lengths[0, number] = length
        nodes[0, number, :length] = movement.streets.rows(list(track.path))
        times[0, number, :length] = track.times
    return make_paths_over(nodes, times, lengths, starts)


def _make_paths_by_metres(
    moves: TurnMoves, slots: Sequence[int], numbers: IntArray, movement: Movement, starts: IntArray
) -> Paths:
    """Return the paths of agents that move by meters, including the legs along edges."""
    tracks = [moves.get_track(i) for i in slots]
    shape = (*starts.shape, max((len(track.legs) for track in tracks), default=0))
    row_of = {edge: row for row, edge in enumerate(movement.columns.edge_ids.tolist())}
    legs = Legs(np.full(shape, -1), np.full(shape, -1), *(np.zeros(shape) for _ in range(4)))
    waits = np.zeros(starts.shape, np.bool_)
    edge = np.full(starts.shape, -1)
    motion = np.full(starts.shape, Motion.STOPPED)
    for number, i, track in zip(numbers.tolist(), slots, tracks, strict=True):
        waits[0, number] = _is_waiting(track)
        for place, leg in enumerate(track.legs):
            back = -1 if leg.back is None else row_of[leg.back]
            for column, value in zip(legs, (row_of[leg.edge], back, *leg[3:7]), strict=True):
                column[0, number, place] = value
        progress = moves.get_progress(i)
        if progress is not None:
            edge[0, number] = row_of[progress.edge]
            motion[0, number] = progress.motion
    return make_paths_along(legs, movement.columns, starts, waits)._replace(edge=edge, motion=motion, rests=edge < 0)


def _is_waiting(track: Track) -> bool:
    """Return whether an agent waits on its first node before it leaves."""
    return len(track.path) > 1 and track.path[0] == track.path[1]
