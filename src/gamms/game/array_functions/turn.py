"""The argument of array rules: one turn of all games that are being played."""

from collections.abc import Callable, Hashable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple, TypeVar

import numpy as np

from gamms import kernels
from gamms.arguments import as_array, as_name, as_numbers_of, as_one_shape
from gamms.errors import BadValue
from gamms.game.block.columns import find_unique_pairs, get_or_make, lock, put_locked
from gamms.game.block.state import STOPPED, Arrays, EmittedEvents, GameArrays, MapViewMixin
from gamms.game.conflicts import flatten
from gamms.game.movement.courses import Paths
from gamms.game.movement.routes import RouteTable
from gamms.ir.columns import find_places, select_rows
from gamms.ir.deeds import ArrayDeeds, join_deeds
from gamms.ir.game_state import READ, join_ends
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.kernels.draws import BitArray
from gamms.readonly import ShallowCopyMixin
from gamms.text import shown

T = TypeVar("T")
ArrayRule = Callable[["ArrayTurn"], None]
"""The array form of a rule; `gamms.array_rule` declares it."""

_READ_ONLY = ("games", "turn", "seeds", "starts", "ends", "took_part", "node", "alive")


class Visits(NamedTuple):
    """The nodes that agents visit in a turn, (visits,): by game, agent and time.

    Attributes:
        at: the game, as an index in the turn.
        agents: the numbers of the agents in the roster.
        nodes: the rows of the nodes.
        begin, end: the times of arrival and departure, from 0 to 1.
    """

    at: IntArray
    agents: IntArray
    nodes: IntArray
    begin: FloatArray
    end: FloatArray

    def select(self, which: BoolArray | IntArray) -> "Visits":
        """Return the visits selected by a mask or by indices."""
        return select_rows(self, which)


class ArrayTurn(MapViewMixin, ShallowCopyMixin):
    """One turn of all games that are being played, with the verbs of rules: the argument of array rules.

    Arrays have the axes (games, agents); `at` numbers the games of this turn from 0. Nodes are rows of
    `streets.columns`; `streets.ids(rows)` gives their ids.

    Attributes:
        games: (games,) the number of each game in the batch.
        turn: (games,) the number of turns played, like `ctx.game.turn` in a rule.
        seeds: (games,) the seed of each game.
        roster: the agents, in the order of their names.
        streets: the graph.
        starts: the row of each agent's node before its move; in the phase "before", before the move of the last turn.
        ends: the row of each agent's node after its move, with conflicts resolved.
        took_part: whether the agent was alive at that move.
        paths: the paths of the agents; None: all moved along at most one edge. `visits` returns the visited nodes.
        node: the current node of each agent; `respawn` changes it.
        alive: whether the agent is alive now; `eliminate` and `respawn` change it.

    These arrays are read-only for rules and checks.
    """

    _not_pickled = (
        "A turn of array rules can neither be pickled nor copied deeply, because it acts on its games. Copy the arrays "
        "that you need, such as turn.node.copy()."
    )

    paths: Paths | None = None
    _is_moving = False  # whether agents have decided and not moved

    def __init__(self, state: GameArrays, games: IntArray) -> None:
        self._state = state
        self.games = games
        self.roster = state.roster
        self._find_roads()
        self.turn = state.turn[games]
        self.seeds = state.get_seeds(games)
        self._rows_in_log = games  # the numbers of the games in the log of deeds
        self.node: IntArray = state.select_values(state.node, games)
        self.alive: BoolArray = state.select_values(state.alive, games)
        self.starts = self.node
        self.ends = self.starts
        self.took_part = self.alive

    def _find_roads(self) -> None:
        """Find the maps of the games, because rules may have closed roads."""
        self.streets, self._movement, self._shared = self._state.make_map_data(self.games)

    @property
    def _rows(self) -> Any:
        """An index of the games in the columns of the batch; a slice if it contains all games."""
        return np.s_[:] if len(self.games) == len(self._state) else self.games

    def _lock(self) -> None:
        """Make the arrays read-only for rules."""
        lock([getattr(self, name) for name in _READ_ONLY])

    def _close(self) -> None:
        """Write changes to the state of the batch."""
        state = self._state
        state.node[self._rows] = self.node
        state.alive[self._rows] = self.alive
        state.now.clear()

    @property
    def is_there_by_move(self) -> BoolArray:
        """Whether each agent got to its node by its move, rather than by a rule, (games, agents)."""
        by_move: BoolArray = self.took_part & (self.node == self.ends) & ~self._state.placed[self.games]
        if self.paths is not None and self.paths.edge is not None:
            by_move &= self._state.edge[self.games] == self.paths.edge
            if self._is_moving and self.paths.legs is not None and self.paths.legs.edge.size:  # they have not moved yet
                legs = self.paths.legs
                share = self._state.share[self.games]
                number = (legs.edge >= 0).sum(axis=-1)
                end = np.take_along_axis(legs.end, np.maximum(number - 1, 0)[..., None], -1)[..., 0]
                by_move &= (self.paths.edge < 0) | (number == 0) | (end == share)
        return by_move

    def visits(self, which: BoolArray, *, passing: bool = True) -> Visits:
        """Return the nodes that agents visited in the turn; agents that a rule has placed visit their node at the end.

        Args:
            which: a mask of agents, (games, agents), or of nodes, (nodes,).
            passing: whether to include nodes passed on the way; False: only nodes at the end of the turn.
        """
        is_of_nodes = np.ndim(which) == 1
        paths = self.paths
        which = as_array(which, "which", "booleans", (self.streets.num_nodes,) if is_of_nodes else self.node.shape)
        if paths is None or not passing:
            counts = self.alive & (which[self.node] if is_of_nodes else which)
            if paths is not None and paths.edge is not None:
                counts &= (self._state.edge[self.games] < 0) | ~self.is_there_by_move
            at, agents = np.nonzero(counts)
            node = self.node[at, agents]
            begin = np.ones(len(at))
            if passing:
                begin = np.where(self.is_there_by_move[at, agents] & (self.starts[at, agents] == node), 0.0, 1.0)
            return Visits(at, agents, node, begin, np.ones(len(at)))
        by_move = self.is_there_by_move
        living = self.alive if is_of_nodes else self.alive & which
        lengths = np.where(by_move, paths.lengths, 1)
        nodes = np.where(by_move[..., None], paths.nodes, self.node[..., None])
        number = np.arange(nodes.shape[-1])
        skips_first = by_move & ~paths.stays & ~paths.waits
        counts = living[..., None] & (number >= skips_first[..., None]) & (number < lengths[..., None])
        if paths.legs is not None and paths.legs.edge.size:  # waiting on the first node is one visit, not two
            counts[..., 1:2] &= ~(by_move & paths.waits)[..., None]
        at, agents, number = np.nonzero(counts & which[nodes] if is_of_nodes else counts)
        has_moved = by_move[at, agents]
        begin = np.where(has_moved, paths.times[at, agents, number], 1.0)
        is_last = (number == lengths[at, agents] - 1) & (paths.rests[at, agents] | ~has_moved)
        end = np.where(is_last, 1.0, begin)
        waiting = np.flatnonzero((number == 0) & (lengths[at, agents] > 1))
        if len(waiting):
            end[waiting] = paths.times[at[waiting], agents[waiting], 1]
        return Visits(at, agents, nodes[at, agents, number], begin, end)

    @property
    def is_playing(self) -> BoolArray:
        """Whether each agent is alive, or was at the start of the turn, (games, agents)."""
        return np.asarray(self.alive | self.took_part | self._state.fell[self.games])

    @property
    def is_out(self) -> BoolArray:
        """Whether each agent is eliminated, (games, agents); agents that have not entered the game are not."""
        is_out: BoolArray = self._state.is_there[self.games] & ~self.alive
        return is_out

    def performed(self, kind: str) -> ArrayDeeds:
        """Return the deeds of this turn of one kind.

        Raises:
            UnknownName (KeyError): there is no such deed.
        """
        declared = self._state.deeds
        is_moving = self._is_moving
        turn = self.turn + is_moving
        as_arrays = partial(declared.make_arrays, kind)
        found = self._state.deed_log.list_in_turn(self._rows_in_log, turn, kind, as_arrays, is_moving=is_moving)
        deeds = join_deeds(found or [declared.make_empty(kind)])
        deeds = deeds.select(self.took_part[deeds.at, deeds.agents])
        return deeds._replace(nodes=self.starts[deeds.at, deeds.agents])  # rules may have put agents elsewhere

    def emit(
        self,
        kind: str,
        at: IntArray,
        *,
        agents: Mapping[str, IntArray] | None = None,
        nodes: Mapping[str, IntArray] | None = None,
        values: Mapping[str, list[Any]] | None = None,
    ) -> None:
        """Emit one event for each item of `at`; the events of a game keep this order.

        Args:
            kind: the kind of the events.
            at: (events,) games, as indices in this turn.
            agents: field -> (events,) numbers of agents in the roster.
            nodes: field -> (events,) rows of nodes.
            values: field -> a list with a value for each event.

        Raises:
            BadType, BadValue: a game, agent or node does not exist, or a field does not have one value for each event.
        """
        if not len(at):
            return
        at = self._check_indices(at)
        for name in {"turn", "kind"} & {*(agents or ()), *(nodes or ()), *(values or ())}:
            raise BadValue(f"An event has its {name}: give {name}= another name, such as until=.")
        fields: dict[str, list[Any]] = {}
        for name, given in (agents or {}).items():
            numbers = self._list_values(name, as_numbers_of(given, name, len(self.roster.names), "agents").tolist(), at)
            fields[name] = [self.roster.names[number] for number in numbers]
            if STOPPED.get(kind) == name:
                np.add.at(self._state.stops, (self.games[at], numbers), 1)
        for name, rows in (nodes or {}).items():
            fields[name] = self._list_values(name, self.streets.ids(rows).tolist(), at)
        for name, those in (values or {}).items():
            fields[name] = self._list_values(name, those, at)
        self._note(as_name(kind, "a kind of event"), at, fields)

    def _check_indices(self, at: object) -> IntArray:
        return as_numbers_of(at, "at", len(self.games), "games of this turn")

    def _check_pairs(self, at: object, agents: object) -> tuple[IntArray, IntArray]:
        """Return the arguments of a verb, checked and broadcast: games of this turn and agents."""
        numbers = as_numbers_of(agents, "agents", len(self.roster.names), "agents")
        places = self._check_indices(at)
        if places.shape != numbers.shape:
            places, numbers = as_one_shape({"at": places, "agents": numbers})
        return places, numbers

    def _list_values(self, name: str, values: object, at: IntArray) -> list[Any]:
        """Return the values of a field as a list, one for each item of `at`."""
        listed = values.tolist() if isinstance(values, np.ndarray) else values
        if not isinstance(listed, list | tuple) or len(listed) != len(at):
            raise BadValue(f"{name} has a value for each of {len(at)} in `at`, not {shown(values)}.")
        return list(listed)

    def _note(self, kind: str, at: IntArray, fields: Mapping[str, list[Any]]) -> None:
        """Add events to the logs of their games."""
        when = self.games[at], self.turn[at] + self._is_moving
        self._state.events.add(kind, *when, fields)

    def _note_place(self, kind: str, at: IntArray, agents: IntArray) -> None:
        """Add an event with the current node for each agent that is eliminated or respawns."""
        names = self.roster.names
        nodes = self.streets.ids(self.node[at, agents]).tolist()
        self._note(kind, at, {"agent": [names[number] for number in agents.tolist()], "node": nodes})
        np.add.at(self._state.stops, (self.games[at], agents), 1)

    def new_events(self, reader: Hashable) -> list[EmittedEvents]:
        """Return the events of these games since the last call for a reader; in the first call, all events.

        Their `games` are indices in this turn.
        """
        number = find_places(self.games, len(self._state))
        read = self._state.keep((READ, reader), lambda games: {"number": np.zeros(games, np.int64)})["number"]
        new = self._state.events.take_new(read, self.games)
        return [emitted._replace(games=number[emitted.games]) for emitted in new]

    def add_score(self, key: Hashable, at: IntArray, points: float | FloatArray) -> None:
        """Add points to the score of a key, once for each item of `at`; `points` is one number, or one per item.

        Raises:
            BadType, BadValue: a game does not exist, or the points are invalid.
        """
        if len(at):
            at = self._check_indices(at)
            if not isinstance(points, int):
                points = as_array(points, "points", "numbers", at.shape)
            self._state.scores.add(key, self.games[at], points)

    def add_scores(self, at: IntArray, agents: IntArray, points: float | FloatArray) -> None:
        """Add points to the scores of the agents' teams, in order; `points` is one number, or one per agent.

        Raises:
            BadType, BadValue: a game or agent does not exist, or the points are invalid.
        """
        at, agents = self._check_pairs(at, agents)
        self.add_team_scores(at, self.roster.team_of[agents], points)

    def add_team_scores(self, at: IntArray, teams: IntArray, points: float | FloatArray) -> None:
        """Add points to the scores of teams, given by numbers in `roster.teams`; `points` is a number, or one per team.

        Raises:
            BadType, BadValue: a game or team does not exist, or the points are invalid.
        """
        at = self._check_indices(at)
        teams = as_numbers_of(teams, "teams", len(self.roster.teams), "teams")
        if not isinstance(points, int):
            points = as_array(points, "points", "numbers", at.shape)
        self._state.scores.add_several(self.roster.teams, self.games[at], teams, points)

    def scores(self, key: Hashable) -> FloatArray:
        """Return the score of a key in each game, (games,); a missing score is 0."""
        numbers = self._state.scores.get(key)
        return np.zeros(len(self.games)) if numbers is None else numbers[self.games]

    def end(self, at: IntArray, reason: str | Sequence[str], winner: Sequence[Any], truncated: bool = False) -> None:
        """End games after this turn, like `ctx.game.end`.

        Args:
            at: (games,) games, as indices in this turn.
            reason: one reason for all games, or one per game.
            winner: the winner of each game; None: no winner.
            truncated: whether time was up.

        Raises:
            BadType, BadValue: a game does not exist, or reasons or winners are missing.
        """
        at = self._check_indices(at)
        reasons = [reason] * len(at) if isinstance(reason, str) else self._list_values("reason", reason, at)
        for game, why, who in zip(
            self.games[at].tolist(), reasons, self._list_values("winner", winner, at), strict=True
        ):
            self._end(game, {"reason": why, "winner": who, "truncated": truncated})
        self._state.is_going[self.games[at]] = False

    def _end(self, game: int, how: dict[str, Any]) -> None:
        self._state.over[game] = join_ends(self._state.over[game], how)

    def eliminate(self, at: IntArray, agents: IntArray) -> None:
        """Eliminate the given agents that are alive, with an event for each.

        Raises:
            BadType, BadValue: a game or agent does not exist.
        """
        at, agents = self._check_pairs(at, agents)
        living = self.alive[at, agents]
        at, agents = find_unique_pairs(at[living], agents[living])
        if len(at):
            self._take_out(at, agents)
            self._note_place("eliminated", at, agents)

    def _take_out(self, at: IntArray, agents: IntArray) -> None:
        """Eliminate agents without events."""
        put_locked(self.alive, (at, agents), values=False)
        self._state.movement.take_out(self.games[at], agents)

    def respawn(self, at: IntArray, agents: IntArray) -> None:
        """Place agents, dead or alive, on their start nodes, with an event for each.

        Raises:
            BadType, BadValue: a game or agent does not exist.
        """
        at, agents = self._check_pairs(at, agents)
        if len(at):
            self._put_back(at, agents)
            self._note_place("respawned", at, agents)

    def _put_back(self, at: IntArray, agents: IntArray) -> None:
        """Place agents on their start nodes, without events."""
        games = self.games[at]
        before = self.node[at, agents]
        start = self._state.start[games, agents]
        begun = np.where(start >= 0, start, before)  # agents that entered later stay on their current nodes
        put_locked(self.node, (at, agents), begun)
        put_locked(self.alive, (at, agents), values=True)
        self._state.previous[games, agents] = np.where(self.roster.flies[agents], before, begun)
        self._state.placed[games, agents] = True
        if self._state.flights is not None:
            self._state.flights.put_back(flatten(games, np.int64), flatten(agents, np.int64))
        self._state.movement.clear(games, agents)

    def close_roads(self, at: IntArray, edges: Sequence[int]) -> None:
        """Close roads, given by edge ids, in each of these games, like `ctx.graph.close_roads`.

        Raises:
            UnknownName (KeyError): an edge does not exist in a game.
        """
        self._change_roads("close_roads", at, edges)

    def open_roads(self, at: IntArray, edges: Sequence[int]) -> None:
        """Reopen closed roads in each of these games; see `close_roads`."""
        self._change_roads("open_roads", at, edges)

    def _change_roads(self, verb: str, at: IntArray, edges: Sequence[int]) -> None:
        games = self.games[np.unique(self._check_indices(at))]
        if len(games) and len(edges) and self._state.change_roads is not None:
            self._close()
            self._state.change_roads(games, verb, tuple(edges))
            self._find_roads()

    def in_air(self) -> tuple[IntArray, FloatArray]:
        """Return the numbers of the agents that fly, ascending, and their positions, (games, flying agents, 3)."""
        return self._state.flyers.copy(), self._state.position[self.games]

    def start_of(self, agents: IntArray) -> IntArray:
        """Return the start node of each agent, (games, agents); -1 if it has not entered the game."""
        agents = as_numbers_of(agents, "agents", len(self.roster.names), "agents").reshape(-1)
        rows = np.ix_(self.games, agents)
        come = np.where(self._state.is_there[rows], self.node[:, agents], -1)
        start = self._state.start[rows]
        return np.where(start >= 0, start, come)

    def stops(self, at: IntArray, agents: IntArray) -> IntArray:
        """Return how often agents were tagged, respawned or eliminated so far."""
        at, agents = self._check_pairs(at, agents)
        return self._state.stops[self.games[at], agents]

    def keep(self, key: Hashable, make: Callable[[int], Arrays]) -> Arrays:
        """Return the stored arrays of a rule for all games of the batch; the first call stores `make(games)`.

        Index the arrays with `games`.
        """
        return self._state.keep(key, make)

    def shared(self, key: Hashable, make: Callable[[], T]) -> T:
        """Return an object that is the same in all games and turns of the batch; the first call stores `make()`."""
        return get_or_make(self._shared, key, make)

    def routes(self, weight: str | None = "length") -> RouteTable:
        """Return a table of distances between rows of nodes; `weight` is as in `graph.distance`."""
        return self._movement.get_routes(weight)

    @property
    def facts(self) -> Mapping[str, Any]:
        """The facts published to everybody, in the form that each rule defines."""
        return self._state.facts

    def publish(self, name: str, value: object) -> None:  # noqa: ARG002 - as `ctx.game.publish`
        """Raise BadValue: only rules that are functions of the context can publish facts.

        Raises:
            BadValue: always.
        """
        raise BadValue(
            f"turn.publish of {shown(name)} is not for array rules: write the rule as a function of ctx, which "
            "calls ctx.game.publish and plays in batches, too."
        )

    def draw_bits(self, at: IntArray, names: BitArray, *purpose: str | int) -> BitArray:
        """Return 64 random bits for each item of `at`, from a purpose, names and this turn; see `kernels.draw_bits`."""
        purposes = self._state.compute_purpose_keys(*purpose)[self.games[at]]
        return kernels.draw_bits_rows(purposes, names, self.turn[at])
