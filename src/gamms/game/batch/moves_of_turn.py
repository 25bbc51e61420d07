"""How agents move in one turn of all games: what rules and resolvers in arrays read of it, and how it is played."""

from collections.abc import Sequence
from copy import copy
from operator import itemgetter
from typing import Any, NamedTuple, Self

import numpy as np

from gamms.arguments import as_array
from gamms.game.batch.columns import lock, places_of, some_rows
from gamms.game.batch.deeds import ArrayDeeds, joined
from gamms.game.batch.flights import Flights
from gamms.game.batch.movement import Anywhere, Illegal, Moves, Paths
from gamms.game.batch.state import Failure, GameArrays
from gamms.ir.graph import FloatArray, GraphColumns, IntArray
from gamms.ir.obstacles import BoolArray

_READ_ONLY = ("games", "turn", "seeds", "starts", "ends", "took_part", "node", "alive")


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
        return some_rows(self, which)


class MovesOfTurn:
    """How agents move in one turn of all games that are being played, and what the engine does with that.

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
        flights: what those do that fly, which `starts` and `ends` have on their nodes; None: none flies.
        places: in games by metres, where moves begin, for conflicts: nodes and behind them edges; None: on `node`.
        movement: how they go.
        node: where they are now; `respawn` writes it.
        alive: which are alive now; `eliminate` and `respawn` write it.
        failures: what agents did wrong that were asked, until `note_failures` notes it.

    Rules and checks read these arrays and cannot write into them.
    """

    _dropped: BoolArray | np.bool = np.False_  # agents that went out before they could move
    places: IntArray | None = None
    _is_moving = False  # whether agents have decided and not moved

    def __init__(self, state: GameArrays, games: IntArray) -> None:
        self._state, self.games, self.roster = state, games, state.roster
        self.find_roads()
        self.turn, self.seeds = state.turn[games], state.seeds_of(games)
        self.paths: Paths | None = None
        self._played: Paths | None = None  # of the parts of the turn that have moved
        self.flights: Flights | None = None
        self._flown: Flights | None = None  # likewise
        self._deeds: list[ArrayDeeds] = []  # of those that have moved, or of those that are about to
        self._done: list[ArrayDeeds] = []  # of the parts before
        self._refused: dict[tuple[int, int, str], set[str]] = {}
        self.failures: list[Failure] = []
        self._find_agents()

    @property
    def columns(self) -> GraphColumns:
        """The graph with all edges that agents may be on in a game."""
        return self._state.movement.columns

    def find_roads(self) -> None:
        """Take the maps of the games, of which rules may have closed roads."""
        self.streets, self.movement, self._shared = self._state.world(self.games)

    @property
    def _rows(self) -> Any:
        """What finds the games in the columns of the batch, faster where they are all."""
        return np.s_[:] if len(self.games) == len(self._state) else self.games

    def _find_agents(self) -> None:
        """Take where the agents are."""
        state, games = self._state, self.games
        self._place_agents(state.chosen(state.node, games), state.chosen(state.alive, games))

    def _place_agents(self, node: IntArray, alive: BoolArray) -> None:
        self.node, self.alive = self.starts, self.took_part = node, alive
        self.ends = node
        self._earlier = node, node  # starts and ends of the parts of the turn that have moved

    def lock(self) -> None:
        """Let rules read where agents are, and change it by verbs alone."""
        known = vars(self)  # on a device some are not read yet
        lock([known[name] for name in _READ_ONLY if name in known])

    # -- how the engine plays it --------------------------------------------------------------------------------

    def resume(self) -> None:
        """Take the moves of the last turn, for rules of the phase "before"."""
        state, games, last = self._state, self.games, self._state.last_moves
        self.starts, self.ends, self.took_part = last.starts[games], last.ends[games], last.took_part[games]
        self._dropped, self.paths = last.dropped[games], state.last_paths and state.last_paths.of(games)
        self.flights = state.last_flights and state.last_flights.of(games)
        number = places_of(games, len(state))
        self._deeds = [deeds._replace(at=number[deeds.at]).those(number[deeds.at] >= 0) for deeds in state.last_deeds]

    def keep_moves(self) -> None:
        """Keep the moves of this turn, for rules of the phase "before"."""
        state, games = self._state, self.games
        values = self.starts, self.ends, self.took_part, self._dropped
        for column, value in zip(state.last_moves, values, strict=True):
            column[games] = value
        state.last_paths = self.paths and self.paths.spread(games, len(state))
        if state.flyers is not None and self.flights is not None:
            state.last_flights = self.flights.noted(games, state.last_flights or state.flyers.hovering(len(state)))
        state.last_deeds += [deeds._replace(at=games[deeds.at]) for deeds in self._deeds]

    def begin_part(self, moves: Moves, deeds: list[ArrayDeeds]) -> None:
        """Take what agents have decided, before rules check it and carry out deeds."""
        self._earlier, self._is_moving = (self.starts, self.ends), True
        self._done, self._deeds = self._done + self._deeds, deeds
        self.starts, self.ends, self.paths, self.flights = self.node, moves.ends, moves.paths, moves.flights
        self.node, self.alive = self.node.copy(), self.alive.copy()

    def refused(self, moves: Moves, stopped: BoolArray) -> Moves:
        """Take back moves and deeds that rules have refused, note the deeds that remain, and return the moves."""
        state, games, refused = self._state, self.games, self._refused
        for at, agent, kind in sorted(refused):
            self.note_error(at, agent, f"{kind}: {'; '.join(sorted(refused[at, agent, kind]))}")
        if refused:
            self._deeds = [
                one.without({(at, agent) for at, agent, kind in refused if kind == one.kind}) for one in self._deeds
            ]
            self._refused = {}
        state.deeds.add(self.turn + 1, games, self._deeds)
        state.counts["blocked"][games] += stopped
        left = moves.without(stopped)
        self.ends, self.paths, self.flights = left.ends, left.paths, left.flights
        return left

    def left_of(self, moves: Moves, changes: IntArray) -> Moves:
        """Return the moves of agents that rules have not put elsewhere or out of the game, on open roads; others stay.

        Args:
            moves: of all agents.
            changes: (games,) how often roads were closed or opened before these rules.
        """
        was_put, edge = self.node != self.starts, self._state.movement.edge
        if len(edge):  # by metres: of those that were put on the node they had passed last, too
            begun, share = moves.before
            has_left = (begun >= 0) & (edge[self.games] < 0)
            moves = moves._replace(before=(np.where(has_left, -1, begun), np.where(has_left, 0.0, share)))
            was_put = was_put | has_left
        flights = moves.flights and moves.flights.of_living(self.alive)
        moves = moves._replace(starts=self.node, flights=flights).without(~self.alive | was_put)
        state, games = self._state, self.games
        is_other = state.roads.changes[games] != changes
        if not is_other.any():
            return moves
        stopped = self._are_closed(moves) & moves.goes & is_other[:, None]
        state.counts["blocked"][games] += stopped
        if state.note_blocked is not None:
            for at, agent in np.argwhere(stopped).tolist():
                state.note_blocked(int(games[at]), agent, "its way was closed")
        return moves.without(stopped)

    def _are_closed(self, moves: Moves) -> BoolArray:
        """Return which agents, (games, agents), go along roads that are not open any more."""
        roads, found, paths = self._state.roads, np.zeros(moves.ends.shape, np.bool_), moves.as_paths()
        if paths.legs is not None:
            np.any(roads.states(paths.legs.edge, self.games[:, None, None]) > 0, axis=-1, out=found)
        elif not isinstance(self._state.movement, Anywhere):
            nodes = paths.nodes
            at = np.nonzero(nodes[..., :-1] != nodes[..., 1:])
            is_closed = ~roads.are_next(nodes[at], nodes[..., 1:][at], self.games[at[0]])
            found[at[0][is_closed], at[1][is_closed]] = True
        return found

    def move(self, moves: Moves, in_conflict: BoolArray | None, part: TurnPart | None = None) -> None:
        """Move agents, of a part of the turn or all, and note which, (games, agents), conflicts have stopped."""
        state, games = self._state, self.games
        state.counts["moves"][self._rows] += moves.ends != self.node
        if in_conflict is None:
            in_conflict = np.broadcast_to(np.False_, moves.ends.shape)
        else:
            state.counts["blocked"][self._rows] += in_conflict
        if state.headings is not None:
            members = np.s_[:] if part is None else part.members
            moves_now = np.zeros(self.node.shape, np.bool_)
            moves_now[:, members] = self.alive[:, members]
            if moves.flights is not None:
                moves_now[:, moves.flights.agents] = moves.flights.goes
            state.headings.moved(games, self.node, moves_now)
        node, flights = moves.ends.copy(), moves.flights
        if state.flyers is not None and flights is not None:
            flights = state.flyers.fly(games, flights, node)
            state.counts["moves"][np.ix_(games, flights.agents)] += flights.flew
        if part is None:
            self.starts, self.ends, self._played = self.node, moves.ends, moves.paths
            state.blocked[self._rows] = in_conflict
            state.movement.keep(moves, games)
        else:
            self._join(moves, part)
            flights = flights if self._flown is None else flights and self._flown.joined(flights, part.members)
            state.blocked[np.ix_(games, part.members)] = in_conflict[:, part.members]
            state.movement.keep(moves, games, part.members)
            state.node[games], state.alive[games] = node, self.alive  # those after them see it
            state.now.clear()
        if self._is_moving:
            self._drop_the_dead()
        self._is_moving, self.node, self._flown = False, node, flights

    def _join(self, moves: Moves, part: TurnPart) -> None:
        """Add the moves of a part to those of the parts before."""
        paths, went = moves.as_paths().between(part.number, part.of), moves.ends != self.node
        if self._played is None:
            self.starts, self.ends, self._played = self.node, moves.ends, paths
            return
        starts, ends = self._earlier if self._is_moving else (self.starts, self.ends)
        if moves.paths is not None and moves.paths.legs is not None:
            went |= moves.goes  # along an edge
        has_jumped = went & (self.node != ends)  # it was put elsewhere before it left
        paths = paths.without_starts(has_jumped) if has_jumped.any() else paths
        for deeds in self._deeds if self._is_moving else ():
            went[deeds.at, deeds.agents] = True
        if moves.flights is not None:
            went[:, moves.flights.agents] |= moves.flights.goes
        self.starts, self.ends = np.where(went, self.node, starts), np.where(went, moves.ends, ends)
        self._played = self._played.joined(paths, part.members)

    def _drop_the_dead(self) -> None:
        """Forget the moves and deeds of agents that rules put out before they moved; those that came back stay."""
        if self.took_part is self.alive or (self.took_part == self.alive).all():
            return
        self._dropped = self._dropped | (self.took_part & ~self.alive)
        has_come = self.alive & ~self.took_part
        self.starts, self.ends = (
            np.where(has_come | ~self.alive, self.node, nodes) for nodes in (self.starts, self.ends)
        )
        self._played = self._played and self._played.staying(has_come, self.node)
        self.took_part = self.alive
        self._done, self._deeds = (
            [deeds.those(self.alive[deeds.at, deeds.agents]) for deeds in several]
            for several in (self._done, self._deeds)
        )

    def of(self, which: BoolArray) -> Self:
        """Return the turn of some of its games, (games,)."""
        part, games, number = copy(self), np.flatnonzero(which), np.cumsum(which) - 1
        for name, value in vars(self).items():
            if isinstance(value, np.ndarray):
                setattr(part, name, value[games])
            elif isinstance(value, Paths | Flights):
                setattr(part, name, value.of(games))
        for name in ("_deeds", "_done"):
            kept = [deeds.those(which[deeds.at]) for deeds in getattr(self, name)]
            setattr(part, name, [deeds._replace(at=number[deeds.at]) for deeds in kept])
        part._refused = {}
        part.find_roads()
        return part

    def take_refusals(self, part: "MovesOfTurn", games: IntArray) -> None:
        """Refuse what was refused in the turn of some of the games, by their places."""
        self._refused |= {(int(games[at]), agent, kind): why for (at, agent, kind), why in part._refused.items()}

    def note_failures(self, illegal: Sequence[Illegal]) -> None:
        """Note what agents did wrong that were asked, and whose actions could not be done: these send nothing."""
        senders = {(int(self.games[one.at]), one.agent) for one in illegal}
        self.failures[:] = [one for one in self.failures if not one.is_unsent or (one.game, one.agent) not in senders]
        self.failures += [Failure.illegal(int(self.games[i]), j, why) for i, j, why in illegal if self.alive[i, j]]
        for one in sorted(self.failures, key=itemgetter(0, 1, 2)):
            self._state.note_failure(one)
        self.failures.clear()

    def note_error(self, at: int, agent: int, message: str) -> None:
        """Note that what an agent does is not legal, and why."""
        self._state.note_failure(Failure.illegal(int(self.games[at]), agent, message))

    def end_moves(self) -> None:
        """Let the turn be played: what follows are its rules."""
        self.alive, self.turn, self.paths, self.flights = (
            self.alive.copy(),
            self.turn + 1,
            self._played,
            self._flown,
        )
        self._deeds = self._done + self._deeds

    def close(self) -> None:
        """Write what has changed into the state of the batch."""
        state, rows = self._state, self._rows
        state.node[rows], state.alive[rows], state.turn[rows] = self.node, self.alive, self.turn
        state.now.clear()

    @property
    def is_there_by_move(self) -> BoolArray:
        """Which agents are where their moves have led them, rather than put there since: (games, agents)."""
        by_move: BoolArray = self.took_part & (self.node == self.ends)
        if self.paths is not None and self.paths.edge is not None:
            by_move &= self._state.movement.edge[self.games] == self.paths.edge
        if self._state.flyers is not None and self.flights is not None:
            by_move[:, self.flights.agents] &= ~self._state.flyers.are_put(self.games, self.flights)
        return by_move

    def visits(self, which: BoolArray, *, passing: bool = True) -> Visits:
        """Return at which nodes agents were in the turn; those that were put elsewhere are there at the end of it.

        Args:
            which: (games, agents) of them, or (nodes,) of the nodes.
            passing: whether those count that they have passed; False: those where they are at the end of the turn.
        """
        is_of_nodes, paths = np.ndim(which) == 1, self.paths
        which = as_array(which, "which", "booleans", (self.streets.num_nodes,) if is_of_nodes else self.node.shape)
        if paths is None or not passing:
            counts = self.alive & (which[self.node] if is_of_nodes else which)
            if paths is not None and paths.edge is not None:
                counts &= self._state.movement.edge[self.games] < 0
            at, agents = np.nonzero(counts)
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
        if paths.legs is not None:  # who waits on a node is not there again when it leaves
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
        """Which agents are in the game, or were when the turn began, (games, agents)."""
        return np.asarray(self.alive | self.took_part | self._dropped)

    @property
    def is_out(self) -> BoolArray:
        """Which agents are out of the game, (games, agents); those that may come are not in it yet."""
        return self._state.is_there[self.games] & ~self.alive

    def performed(self, kind: str) -> ArrayDeeds:
        """Return what agents do in this turn besides moving.

        Raises:
            UnknownName (KeyError): there is no such deed.
        """
        found = [deeds for deeds in self._deeds if deeds.kind == kind]
        deeds = joined(found) if found else self._state.deeds.nothing(kind)
        return deeds._replace(nodes=self.starts[deeds.at, deeds.agents])  # rules may have put agents elsewhere
