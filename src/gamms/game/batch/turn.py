"""What a batch remembers of its games, and what array forms of rules get of one turn of all that are played."""

from collections.abc import Callable, Hashable, Mapping, Sequence
from itertools import compress
from typing import Any, NamedTuple, TypeVar

import numpy as np

from gamms import kernels
from gamms.game.batch.columns import Roster
from gamms.game.batch.movement import Movement, Moves, Paths
from gamms.ir.game_state import joined_end
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.kernels.draws import BitArray

T = TypeVar("T")
Arrays = dict[str, Any]  # name -> an array whose first axis is the games
ArrayRule = Callable[["ArrayTurn"], None]
"""The array form of a rule, in its attribute `array_form`; see docs/batches.md."""


class Emitted(NamedTuple):
    """Events of one kind that were emitted together.

    Attributes:
        kind: of all.
        games: (events,)
        turns: (events,)
        fields: name -> (events,) values.
    """

    kind: str
    games: IntArray
    turns: IntArray
    fields: Mapping[str, list[Any]]

    def those(self, which: BoolArray) -> "Emitted":
        """Return some of the events."""
        fields = {name: list(compress(values, which.tolist())) for name, values in self.fields.items()}
        return Emitted(self.kind, self.games[which], self.turns[which], fields)


class EventLog:
    """The events of all games, as they were emitted."""

    def __init__(self, num_games: int) -> None:
        self._pending: list[Emitted] = []
        self._of_game: list[list[dict[str, Any]]] = [[] for _ in range(num_games)]
        self._unread: dict[Hashable, list[Emitted]] = {}  # reader -> what it has not read yet

    def add(self, kind: str, games: IntArray, turns: IntArray, fields: Mapping[str, list[Any]]) -> None:
        """Note events, one for each of these games; of one game they are in their order."""
        emitted = Emitted(kind, games, turns, fields)
        for unread in (self._pending, *self._unread.values()):
            unread.append(emitted)

    def new(self, reader: Hashable) -> list[Emitted]:
        """Return the events since the last call for a reader, at first none."""
        found = self._unread.get(reader, [])
        self._unread[reader] = []
        return found

    def of(self, game: int) -> list[dict[str, Any]]:
        """Return the events of a game, in their order."""
        for kind, games, turns, fields in self._pending:
            for number, turn, *values in zip(games.tolist(), turns.tolist(), *fields.values(), strict=True):
                event = {"turn": turn, "kind": kind, **dict(zip(fields, values, strict=True))}
                self._of_game[number].append(event)
        self._pending.clear()
        return self._of_game[game]

    def forget(self, games: IntArray) -> None:
        """Forget the events of some games."""
        self.of(0)
        for game in games.tolist():
            self._of_game[game] = []
        for unread in self._unread.values():
            unread[:] = [emitted.those(~np.isin(emitted.games, games)) for emitted in unread]


class Places(NamedTuple):
    """Where agents are that may be on edges; arrays begin with the games and the agents."""

    edge: IntArray  # (games, agents, 3)  ids of the nodes that it leads from and to, and its own; -1 on a node
    offset_m: FloatArray  # (games, agents)  metres along it
    xy: FloatArray  # (games, agents, 2)  map units


class TurnPart(NamedTuple):
    """One of the parts of a turn, by the order of play: the agents that move in it, by their numbers in the roster."""

    number: int
    of: int  # how many parts there are
    members: IntArray


class Visits(NamedTuple):
    """The nodes that agents are at in a turn, (visits,): by game, agent and time.

    Attributes:
        at: the game in the turn.
        agents: numbers in the roster.
        nodes: rows of nodes.
        begin, end: from when until when, from 0 to 1.
    """

    at: IntArray
    agents: IntArray
    nodes: IntArray
    begin: FloatArray
    end: FloatArray

    def those(self, which: BoolArray | IntArray) -> "Visits":
        """Return some of them."""
        return Visits(self.at[which], self.agents[which], self.nodes[which], self.begin[which], self.end[which])


class GameArrays:
    """The state of all games of a batch.

    Attributes:
        roster: the agents of each game.
        movement: how they go.
        streets: where they go.
        seeds: of the games.
        node, start: (games, agents) rows of nodes: where agents are, and where they began.
        alive: (games, agents)
        last_moves: starts, ends and which agents took part in the last turn, (games, agents) each, where rules of the
            phase "before" need them; and `last_paths` of all games.
        turn: (games,) how many turns were played.
        scores: key -> (games,) numbers.
        has_score: key -> (games,) whether the score was set.
        counts: of moves and of conflicts, (games, agents) each.
        over: of each game how it ended: reason, winner, truncated; None while it goes on.
        is_going: (games,) which have not ended.
        stops: (games, agents) how often an agent was tagged, put back or eliminated.
        kept: what rules and strategies remember: key -> name -> an array whose first axis is the games.
        facts: what rules have published, by name, in a form that each says.
        events: of all games.
        blocked: (games, agents) whether conflicts have stopped an agent in the last turn.
        shared: what was worked out once for all games, from what does not change, by what it is.
        places: where agents on edges are, in games by metres; None: all are on their nodes.
        now: what was worked out of how the games are now, by what it is; emptied when they change.
    """

    def __init__(self, roster: Roster, movement: Movement, seeds: Sequence[int], start: IntArray) -> None:
        self.roster, self.movement, self.streets, self.seeds = roster, movement, movement.streets, list(seeds)
        games, shape = len(seeds), (len(seeds), len(roster.names))
        movement.begin(shape)
        self.start = start
        self.node = start.copy()
        self.alive: BoolArray = np.ones(shape, np.bool_)
        self.last_moves = start.copy(), start.copy(), np.zeros(shape, np.bool_)
        self.last_paths: Paths | None = None
        self.turn = np.zeros(games, np.int64)
        self.scores: dict[Hashable, FloatArray] = {}
        self.has_score: dict[Hashable, BoolArray] = {}
        self._has_fractions: set[Hashable] = set()  # keys of scores to which numbers were added that are no integers
        self.counts = {name: np.zeros(shape, np.int64) for name in ("moves", "blocked")}
        self.over: list[dict[str, Any] | None] = [None] * games
        self.is_going = np.ones(games, np.bool_)
        self.stops, self.blocked = np.zeros(shape, np.int64), np.zeros(shape, np.bool_)
        self.kept: dict[Hashable, Arrays] = {}
        self.facts: dict[str, Any] = {}
        self.events = EventLog(games)
        self.shared: dict[Hashable, Any] = {}
        self.places: Places | None = None
        self.now: dict[Hashable, Any] = {}
        self._makers: dict[Hashable, Callable[[int], Arrays]] = {}
        self._purposes: dict[tuple[str | int, ...], BitArray] = {}
        self._draw_keys: BitArray | None = None

    def __len__(self) -> int:
        return len(self.seeds)

    def reset(self, games: IntArray, seeds: Sequence[int], start: IntArray) -> None:
        """Begin some games again."""
        for game, seed in zip(games.tolist(), seeds, strict=True):
            self.seeds[game], self.over[game] = seed, None
        self.start[games] = self.node[games] = start
        self.alive[games], self.is_going[games], self.turn[games], self.stops[games] = True, True, 0, 0
        self.blocked[games] = False
        self.movement.clear(games)
        self.last_moves[2][games] = False
        for numbers in (*self.counts.values(), *self.scores.values(), *self.has_score.values()):
            numbers[games] = 0
        for key, make in self._makers.items():
            for name, column in make(len(games)).items():
                self.kept[key][name][games] = column
        for purpose, keys in self._purposes.items():
            keys[games] = [kernels.purpose_key(seed, *purpose) for seed in seeds]
        self._draw_keys = None
        self.now.clear()
        self.events.forget(games)

    def keep(self, key: Hashable, make: Callable[[int], Arrays]) -> Arrays:
        """Return what a rule or a strategy remembers of all games; at first what `make(games)` gives."""
        known = self.kept.get(key)
        if known is None:
            known, self._makers[key] = make(len(self)), make
            self.kept[key] = known
        return known

    def purposes(self, *purpose: str | int) -> BitArray:
        """Return the hash of the seed and a purpose of each game, (games,); see `kernels.purpose_key`."""
        keys = self._purposes.get(purpose)
        if keys is None:
            keys = np.array([kernels.purpose_key(seed, *purpose) for seed in self.seeds], np.uint64)
            self._purposes[purpose] = keys
        return keys

    def draw_keys(self) -> BitArray:
        """Return the keys of what agents draw, (games, agents); see `kernels.first_key_rows`."""
        if self._draw_keys is None:
            self._draw_keys = kernels.first_key_rows(self.purposes("agent")[:, None], self.roster.keys[None])
        return self._draw_keys

    def add_score(self, key: Hashable, games: IntArray, points: float | FloatArray) -> None:
        """Add points to the score of a key, in each of these games; one may be there several times."""
        if key not in self.scores:
            self.scores[key] = np.zeros(len(self), np.float64)
            self.has_score[key] = np.zeros(len(self), np.bool_)
        if not isinstance(points, int):
            self._has_fractions.add(key)
        np.add.at(self.scores[key], games, points)
        self.has_score[key][games] = True

    def scores_of(self, game: int) -> dict[Any, Any]:
        """Return the scores of a game that were set."""
        found = {key: numbers[game].item() for key, numbers in self.scores.items() if self.has_score[key][game]}
        return {key: number if key in self._has_fractions else int(number) for key, number in found.items()}


class ArrayTurn:
    """One turn of all games that are being played: what the array form of a rule gets.

    Arrays have the axes (games, agents); `at` numbers the games of this turn from 0. Nodes are rows of
    `streets.columns`; `streets.ids(rows)` gives their ids.

    Attributes:
        games: (games,) the numbers in the batch of the games of this turn.
        turn: (games,) how many turns were played, as `ctx.game.turn` is for a rule.
        seeds: (games,)
        roster: the agents, in the order of their names.
        streets: the graph.
        starts: where the agents were before they moved; before a turn, in the last one.
        ends: where they went, conflicts included.
        took_part: which of them were alive then.
        paths: how they go there; None: along one edge at most. `visits` says where they were.
        node: where they are now; `respawn` writes it.
        alive: which are alive now; `eliminate` and `respawn` write it.
    """

    def __init__(self, state: GameArrays, games: IntArray) -> None:
        self._state, self.games = state, games
        self.roster, self.streets = state.roster, state.streets
        self.turn, self.seeds = state.turn[games], np.array(state.seeds)[games]
        self.node, self.alive = state.node[games], state.alive[games]
        self.starts = self.ends = self.node
        self.took_part = self.alive
        self.paths: Paths | None = None
        self._played: Paths | None = None  # of the parts of the turn that have moved

    def move(self, moves: Moves, in_conflict: BoolArray, part: TurnPart | None = None) -> None:
        """Move agents, and note which of them conflicts have stopped.

        Args:
            moves: of all agents; those that do not move now stay.
            in_conflict: which agents conflicts have stopped.
            part: of the turn, by the order of play; None: all move at once.
        """
        state, games = self._state, self.games
        state.counts["moves"][games] += moves.ends != self.node
        if part is None:
            self.starts, self.ends, self.took_part, self._played = self.node, moves.ends, self.alive, moves.paths
            state.blocked[games] = in_conflict
            state.movement.keep(moves, games)
        else:
            state.blocked[np.ix_(games, part.members)] = in_conflict[:, part.members]
            went = moves.ends != self.node
            self.starts, self.ends = np.where(went, self.node, self.starts), np.where(went, moves.ends, self.ends)
            state.movement.keep(moves, games, part.members)
            paths = moves.as_paths().between(part.number, part.of)
            self._played = paths if self._played is None else self._played.joined(paths, part.members)
            state.node[games] = moves.ends  # those after them see it
            state.now.clear()
        self.node = moves.ends.copy()

    def end_moves(self) -> None:
        """Let the turn be played: what follows are its rules."""
        self.alive, self.turn, self.paths = self.alive.copy(), self.turn + 1, self._played

    def close(self) -> None:
        """Write what has changed into the state of the batch."""
        state, games = self._state, self.games
        state.node[games], state.alive[games], state.turn[games] = self.node, self.alive, self.turn
        state.now.clear()

    @property
    def is_there_by_move(self) -> BoolArray:
        """Which agents are where their moves have led them, rather than put there since: (games, agents)."""
        by_move: BoolArray = self.took_part & (self.node == self.ends)
        return by_move

    def visits(self, which: BoolArray, *, passing: bool = True) -> Visits:
        """Return at which nodes agents were in the turn; those that were put elsewhere are there at the end of it.

        Args:
            which: (games, agents) of them, or (nodes,) of the nodes.
            passing: whether those count that they have passed; False: those where they are at the end of the turn.
        """
        is_of_nodes, paths = which.ndim == 1, self.paths
        if paths is None or not passing:
            at, agents = np.nonzero(self.alive & (which[self.node] if is_of_nodes else which))
            node = self.node[at, agents]
            begin = np.ones(len(at))
            if passing:
                begin = np.where(self.is_there_by_move[at, agents] & (self.starts[at, agents] == node), 0.0, 1.0)
            return Visits(at, agents, node, begin, np.ones(len(at)))
        by_move, living = self.is_there_by_move, self.alive if is_of_nodes else self.alive & which
        lengths = np.where(by_move, paths.lengths, 1)
        nodes = np.where(by_move[..., None], paths.nodes, self.node[..., None])
        number, skips_first = np.arange(nodes.shape[-1]), by_move & ~paths.stays & ~paths.waits
        counts = living[..., None] & (number >= skips_first[..., None]) & (number < lengths[..., None])
        at, agents, number = np.nonzero(counts & which[nodes] if is_of_nodes else counts)
        has_moved = by_move[at, agents]
        begin = np.where(has_moved, paths.times[at, agents, number], 1.0)
        is_last = (number == lengths[at, agents] - 1) & (paths.rests[at, agents] | ~has_moved)
        end = np.where(is_last, 1.0, begin)
        waiting = np.flatnonzero((number == 0) & (lengths[at, agents] > 1))
        end[waiting] = paths.times[at[waiting], agents[waiting], 1]
        return Visits(at, agents, nodes[at, agents, number], begin, end)

    # -- what rules do ------------------------------------------------------------------------------------------

    def emit(
        self,
        kind: str,
        at: IntArray,
        *,
        agents: Mapping[str, IntArray] | None = None,
        nodes: Mapping[str, IntArray] | None = None,
        values: Mapping[str, list[Any]] | None = None,
    ) -> None:
        """Note that something happened, once for each of `at`; of one game in their order.

        Args:
            kind: of the events.
            at: (events,) the games of this turn.
            agents: fields that name agents, by their numbers in the roster.
            nodes: fields that are nodes, by their rows.
            values: other fields.
        """
        if not len(at):
            return
        fields: dict[str, list[Any]] = {}
        for name, numbers in (agents or {}).items():
            fields[name] = [self.roster.names[number] for number in numbers.tolist()]
        for name, rows in (nodes or {}).items():
            fields[name] = self.streets.ids(rows).tolist()
        fields.update(values or {})
        self._state.events.add(kind, self.games[at], self.turn[at], fields)
        stopped = {"tag": "other", "respawned": "agent", "eliminated": "agent"}.get(kind)
        if stopped is not None and agents is not None and stopped in agents:
            np.add.at(self._state.stops, (self.games[at], agents[stopped]), 1)

    def new_events(self, reader: Hashable) -> list[Emitted]:
        """Return the events of the games of this turn since the last call for a reader, at first none.

        Their `games` are numbers in this turn.
        """
        number = np.full(len(self._state), -1)
        number[self.games] = np.arange(len(self.games))
        found = [emitted._replace(games=number[emitted.games]) for emitted in self._state.events.new(reader)]
        return [one if (one.games >= 0).all() else one.those(one.games >= 0) for one in found]

    def add_score(self, key: Hashable, at: IntArray, points: float | FloatArray) -> None:
        """Add points to the score of a key, once for each of `at`, in their order."""
        if len(at):
            self._state.add_score(key, self.games[at], points)

    def add_scores(self, at: IntArray, agents: IntArray, points: float) -> None:
        """Add points to the scores of the teams of agents."""
        for number, team in enumerate(self.roster.teams):
            self.add_score(team, at[self.roster.team_of[agents] == number], points)

    def scores(self, key: Hashable) -> FloatArray:
        """Return the scores of a key, (games,); 0 where there is none."""
        numbers = self._state.scores.get(key)
        return np.zeros(len(self.games)) if numbers is None else numbers[self.games]

    def end(self, at: IntArray, reason: str | Sequence[str], winner: Sequence[Any], truncated: bool = False) -> None:
        """End games after this turn, as `ctx.game.end` does.

        Args:
            at: (games,) which.
            reason: of all, or of each.
            winner: of each; None: no one has won.
            truncated: whether the time was up.
        """
        reasons = [reason] * len(at) if isinstance(reason, str) else reason
        for game, why, who in zip(self.games[at].tolist(), reasons, winner, strict=True):
            over = self._state.over
            over[game] = joined_end(over[game], {"reason": why, "winner": who, "truncated": truncated})
        self._state.is_going[self.games[at]] = False

    def eliminate(self, at: IntArray, agents: IntArray) -> None:
        """Take agents out of the game, those that are in it, each with an event."""
        living = self.alive[at, agents]
        at, agents = _once(at[living], agents[living])
        if len(at):
            self.alive[at, agents] = False
            self._state.movement.take_out(self.games[at], agents)
            self.emit("eliminated", at, agents={"agent": agents}, nodes={"node": self.node[at, agents]})

    def respawn(self, at: IntArray, agents: IntArray) -> None:
        """Put agents, dead or alive, where they began, each with an event."""
        if len(at):
            self.node[at, agents] = self._state.start[self.games[at], agents]
            self.alive[at, agents] = True
            self._state.movement.clear(self.games[at], agents)
            self.emit("respawned", at, agents={"agent": agents}, nodes={"node": self.node[at, agents]})

    def start_of(self, agents: IntArray) -> IntArray:
        """Return where agents began, (games, agents)."""
        return self._state.start[np.ix_(self.games, agents)]

    def stops(self, at: IntArray, agents: IntArray) -> IntArray:
        """Return how often agents were tagged, put back or eliminated so far."""
        return self._state.stops[self.games[at], agents]

    def keep(self, key: Hashable, make: Callable[[int], Arrays]) -> Arrays:
        """Return what a rule remembers of all games of the batch, at first what `make(games)` gives.

        Index its arrays with `games`.
        """
        return self._state.keep(key, make)

    def shared(self, key: Hashable, make: Callable[[], T]) -> T:
        """Return what is the same in all games and turns of the batch: what `make()` gives at the first call."""
        known = self._state.shared
        if key not in known:
            known[key] = make()
        found: T = known[key]
        return found

    @property
    def facts(self) -> Mapping[str, Any]:
        """What was published to all, in the form that each rule says."""
        return self._state.facts

    def publish(self, name: str, value: object) -> None:
        """Publish a fact of all games of the batch, which strategies find in `view["facts"]`."""
        self._state.facts[name] = value

    def draw_bits(self, at: IntArray, names: BitArray, *purpose: str | int) -> BitArray:
        """Return 64 random bits for a purpose, names and this turn, one for each of `at`; see `kernels.draw_bits`."""
        purposes = self._state.purposes(*purpose)[self.games[at]]
        return kernels.draw_bits_rows(purposes, names, self.turn[at])


def _once(at: IntArray, agents: IntArray) -> tuple[IntArray, IntArray]:
    """Return each agent once, in the order of the first time."""
    if len(at) < 2:
        return at, agents
    _, first = np.unique(np.column_stack((at, agents)), axis=0, return_index=True)
    kept = np.sort(first)
    return at[kept], agents[kept]
