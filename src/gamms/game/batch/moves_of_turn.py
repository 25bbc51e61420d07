"""How the engine plays one turn of all games: what it does with an `ArrayTurn`, of which rules see how agents move."""

from typing import NamedTuple

import numpy as np

from gamms.game.batch.columns import Failure, places_of
from gamms.game.batch.deeds import ArrayDeeds
from gamms.game.batch.movement import Anywhere, Moves
from gamms.game.batch.turn import ArrayTurn
from gamms.ir.graph import IntArray
from gamms.ir.obstacles import BoolArray


class TurnPart(NamedTuple):
    """One of the parts of a turn, by the order of play: the agents that move in it, by their numbers in the roster."""

    number: int
    of: int  # how many parts there are
    members: IntArray


def resume(turn: ArrayTurn) -> None:
    """Take the moves of the last turn, for rules of the phase "before"."""
    state, games, last = turn._state, turn.games, turn._state.last_moves
    turn.starts, turn.ends, turn.took_part = last.starts[games], last.ends[games], last.took_part[games]
    turn._dropped, turn.paths = last.dropped[games], state.last_paths and state.last_paths.of(games)
    turn.flights = state.last_flights and state.last_flights.of(games)
    number = places_of(games, len(state))
    turn._deeds = [deeds._replace(at=number[deeds.at]).those(number[deeds.at] >= 0) for deeds in state.last_deeds]


def keep_moves(turn: ArrayTurn) -> None:
    """Keep the moves of this turn, for rules of the phase "before"."""
    state, games = turn._state, turn.games
    values = turn.starts, turn.ends, turn.took_part, turn._dropped
    for column, value in zip(state.last_moves, values, strict=True):
        column[games] = value
    state.last_paths = turn.paths and turn.paths.spread(games, len(state))
    if state.flyers is not None and turn.flights is not None:
        state.last_flights = turn.flights.noted(games, state.last_flights or state.flyers.hovering(len(state)))
    state.last_deeds += [deeds._replace(at=games[deeds.at]) for deeds in turn._deeds]


def begin_part(turn: ArrayTurn, moves: Moves, deeds: list[ArrayDeeds]) -> None:
    """Take what agents have decided, before rules check it and carry out deeds."""
    turn._earlier, turn._is_moving = (turn.starts, turn.ends), True
    turn._done, turn._deeds = turn._done + turn._deeds, deeds
    turn.starts, turn.ends, turn.paths, turn.flights = turn.node, moves.ends, moves.paths, moves.flights
    turn.node, turn.alive = turn.node.copy(), turn.alive.copy()


def without_refused(turn: ArrayTurn, moves: Moves, stopped: BoolArray) -> Moves:
    """Take back moves and deeds that rules have refused, note the deeds that remain, and return the moves."""
    state, games, refused = turn._state, turn.games, turn._refused
    for at, agent, kind in sorted(refused):
        why = f"{kind}: {'; '.join(sorted(refused[at, agent, kind]))}"
        state.note_failure(Failure.illegal(int(games[at]), agent, why))
    if refused:
        turn._deeds = [
            one.without({(at, agent) for at, agent, kind in refused if kind == one.kind}) for one in turn._deeds
        ]
        turn._refused = {}
    state.deeds.add(turn.turn + 1, games, turn._deeds)
    state.counts["blocked"][games] += stopped
    left = moves.without(stopped)
    turn.ends, turn.paths, turn.flights = left.ends, left.paths, left.flights
    return left


def left_of(turn: ArrayTurn, moves: Moves, changes: IntArray) -> Moves:
    """Return the moves of agents that rules have not put elsewhere or out of the game, on open roads; others stay.

    Args:
        turn: of the games.
        moves: of all agents.
        changes: (games,) how often roads were closed or opened before these rules.
    """
    state, games, was_put = turn._state, turn.games, turn.node != turn.starts
    edge = state.movement.edge
    if len(edge):  # by metres: of those that were put on the node they had passed last, too
        begun, share = moves.before
        has_left = (begun >= 0) & (edge[games] < 0)
        moves = moves._replace(before=(np.where(has_left, -1, begun), np.where(has_left, 0.0, share)))
        was_put = was_put | has_left
    flights = moves.flights and moves.flights.of_living(turn.alive)
    moves = moves._replace(starts=turn.node, flights=flights).without(~turn.alive | was_put)
    is_other = state.roads.changes[games] != changes
    if not is_other.any():
        return moves
    stopped = _are_closed(turn, moves) & moves.goes & is_other[:, None]
    state.counts["blocked"][games] += stopped
    return moves.without(stopped)


def _are_closed(turn: ArrayTurn, moves: Moves) -> BoolArray:
    """Return which agents, (games, agents), go along roads that are not open any more."""
    roads, found, paths = turn._state.roads, np.zeros(moves.ends.shape, np.bool_), moves.as_paths()
    if paths.legs is not None:
        np.any(roads.states(paths.legs.edge, turn.games[:, None, None]) > 0, axis=-1, out=found)
    elif not isinstance(turn._state.movement, Anywhere):
        nodes = paths.nodes
        at = np.nonzero(nodes[..., :-1] != nodes[..., 1:])
        is_closed = ~roads.are_next(nodes[at], nodes[..., 1:][at], turn.games[at[0]])
        found[at[0][is_closed], at[1][is_closed]] = True
    return found


def move(turn: ArrayTurn, moves: Moves, in_conflict: BoolArray | None, part: TurnPart | None = None) -> None:
    """Move agents, of a part of the turn or all, and note which, (games, agents), conflicts have stopped."""
    state, games = turn._state, turn.games
    state.placed[games if part is None else np.ix_(games, part.members)] = False
    state.counts["moves"][turn._rows] += moves.ends != turn.node
    if in_conflict is None:
        in_conflict = np.broadcast_to(np.False_, moves.ends.shape)
    else:
        state.counts["blocked"][turn._rows] += in_conflict
    if state.headings is not None:
        members = np.s_[:] if part is None else part.members
        moves_now = np.zeros(turn.node.shape, np.bool_)
        moves_now[:, members] = (turn.alive & (moves.ends != turn.node))[:, members]
        if moves.flights is not None:
            moves_now[:, moves.flights.agents] = moves.flights.goes
        state.headings.moved(games, turn.node, moves_now)
    node, flights = moves.ends.copy(), moves.flights
    if state.flyers is not None and flights is not None:
        flights = state.flyers.fly(games, flights, node)
        state.counts["moves"][np.ix_(games, flights.agents)] += flights.flew
    if part is None:
        turn.starts, turn.ends, turn._played = turn.node, moves.ends, moves.paths
        state.blocked[turn._rows] = np.where(turn.took_part, in_conflict, state.blocked[turn._rows])
        state.movement.keep(moves, games)
    else:
        _join(turn, moves, part)
        flights = flights if turn._flown is None else flights and turn._flown.joined(flights, part.members)
        at, members = np.nonzero(turn.took_part[:, part.members])  # the others did not decide: they stay blocked
        agents = part.members[members]
        state.blocked[games[at], agents] = in_conflict[at, agents]
        state.movement.keep(moves, games, part.members)
        state.node[games], state.alive[games] = node, turn.alive  # those after them see it
        state.now.clear()
    if turn._is_moving:
        _drop_the_dead(turn)
    turn._is_moving, turn.node, turn._flown = False, node, flights


def _join(turn: ArrayTurn, moves: Moves, part: TurnPart) -> None:
    """Add the moves of a part to those of the parts before."""
    paths, went = moves.as_paths().between(part.number, part.of), moves.ends != turn.node
    if turn._played is None:
        turn.starts, turn.ends, turn._played = turn.node, moves.ends, paths
        return
    starts, ends = turn._earlier if turn._is_moving else (turn.starts, turn.ends)
    if moves.paths is not None and moves.paths.legs is not None:
        went |= moves.goes  # along an edge
    has_jumped = went & (turn.node != ends)  # it was put elsewhere before it left
    paths = paths.without_starts(has_jumped) if has_jumped.any() else paths
    for deeds in turn._deeds if turn._is_moving else ():
        went[deeds.at, deeds.agents] = True
    if moves.flights is not None:
        went[:, moves.flights.agents] |= moves.flights.goes
    turn.starts, turn.ends = np.where(went, turn.node, starts), np.where(went, moves.ends, ends)
    turn._played = turn._played.joined(paths, part.members)


def _drop_the_dead(turn: ArrayTurn) -> None:
    """Forget the moves and deeds of agents that rules put out before they moved; those that came back stay."""
    if turn.took_part is turn.alive or (turn.took_part == turn.alive).all():
        return
    turn._dropped = turn._dropped | (turn.took_part & ~turn.alive)
    has_come = turn.alive & ~turn.took_part
    turn.starts, turn.ends = (np.where(has_come | ~turn.alive, turn.node, nodes) for nodes in (turn.starts, turn.ends))
    turn._played = turn._played and turn._played.staying(has_come, turn.node)
    turn.took_part = turn.alive
    turn._done, turn._deeds = (
        [deeds.those(turn.alive[deeds.at, deeds.agents]) for deeds in several] for several in (turn._done, turn._deeds)
    )


def end_moves(turn: ArrayTurn) -> None:
    """Let the turn be played: what follows are its rules."""
    turn.alive, turn.turn, turn._deeds = turn.alive.copy(), turn.turn + 1, turn._done + turn._deeds
    turn.paths, turn.flights = turn._played, turn._flown


def close(turn: ArrayTurn) -> None:
    """Write what has changed into the state of the batch."""
    state, rows = turn._state, turn._rows
    state.node[rows], state.alive[rows], state.turn[rows] = turn.node, turn.alive, turn.turn
    state.now.clear()
