"""How agents have moved in the last turn of a game, taken from the turn engine; for games that go on in arrays."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from gamms.game.batch.columns import Roster
from gamms.game.batch.movement import Legs, Movement, Paths
from gamms.game.batch.travel import ByMetres
from gamms.game.moves import TurnMoves
from gamms.ir.graph import IntArray
from gamms.ir.obstacles import BoolArray
from gamms.ir.progress import Motion
from gamms.typing.game import Track

_SHORT = {1: (0.0,), 2: (0.0, 1.0)}  # when agents are at their nodes that stay, or go along one edge in the turn


class LastTurn(NamedTuple):
    """How agents have moved in one game, (1, agents) each; see `LastMoves` and `ArrayTurn`."""

    starts: IntArray
    ends: IntArray
    took_part: BoolArray
    paths: Paths | None

    @classmethod
    def of(cls, moves: TurnMoves, roster: Roster, movement: Movement, node: IntArray) -> "LastTurn":
        """Return the moves of a game whose agents are on these nodes now, (1, agents).

        Raises:
            UnknownName (KeyError): one led along a node or an edge that is not on the map any more.
        """
        number = {name: i for i, name in enumerate(roster.names)}
        pairs = [(i, number[name]) for name, i in moves.order.index_of.items() if name in number]
        slots, numbers = [i for i, _ in pairs], np.array([number for _, number in pairs], np.int64)
        starts, ends, took_part, rows = node.copy(), node.copy(), np.zeros(node.shape, np.bool_), movement.streets.rows
        starts[0, numbers] = rows([int(moves.starts[i]) for i in slots])
        ends[0, numbers] = rows([int(moves.ends[i]) for i in slots])
        took_part[0, numbers] = True
        paths = None
        if isinstance(movement, ByMetres):
            paths = _paths_by_metres(moves, slots, numbers, movement, starts)
        elif moves.actions:
            tracks = [moves.track(i) for i in slots]
            if any(_SHORT.get(len(track.path)) != track.times or _waits(track) for track in tracks):
                paths = _paths(tracks, numbers, movement, starts)
        return cls(starts, ends, took_part, paths)


def _paths(tracks: Sequence[Track], numbers: IntArray, movement: Movement, starts: IntArray) -> Paths:
    """Return the paths of agents by their numbers; the others are where they start."""
    shape = (*starts.shape, max((len(track.path) for track in tracks), default=1))
    nodes, times = np.repeat(starts[..., None], shape[-1], axis=-1), np.full(shape, np.inf)
    times[..., 0], lengths, waits = 0.0, np.ones(starts.shape, np.int64), np.zeros(starts.shape, np.bool_)
    rows = movement.streets.rows
    for number, track in zip(numbers.tolist(), tracks, strict=True):
        length = lengths[0, number] = len(track.path)
        nodes[0, number, :length], nodes[0, number, length:] = rows(list(track.path)), rows(track.path[-1])
        times[0, number, : len(track.times)] = track.times
        waits[0, number] = _waits(track)
    return Paths(nodes, times, lengths, lengths == 1, waits, np.ones_like(waits))


def _paths_by_metres(
    moves: TurnMoves, slots: Sequence[int], numbers: IntArray, movement: ByMetres, starts: IntArray
) -> Paths:
    """Return the paths of agents by metres, with the edges that they were on, those that came back to a node too."""
    tracks = [moves.track(i) for i in slots]
    arrived = [_arrivals(track) for track in tracks]
    paths = _paths(arrived, numbers, movement, starts)
    shape = (*starts.shape, max((len(track.legs) for track in tracks), default=0))
    row_of = {edge: row for row, edge in enumerate(movement.columns.edge_ids.tolist())}
    legs = Legs(np.full(shape, -1), np.full(shape, -1), *(np.zeros(shape) for _ in range(4)))
    waits = np.zeros_like(paths.waits)
    for number, track in zip(numbers.tolist(), tracks, strict=True):
        waits[0, number] = _waits(track)
        for place, leg in enumerate(track.legs):
            back = -1 if leg.back is None else row_of[leg.back]
            for column, value in zip(legs, (row_of[leg.edge], back, *leg[3:7]), strict=True):
                column[0, number, place] = value
    edge, motion = np.full(starts.shape, -1), np.full(starts.shape, Motion.STOPPED)
    for number, i in zip(numbers.tolist(), slots, strict=True):
        progress = moves.actions[i].progress if i in moves.actions else None
        if progress is not None:
            edge[0, number], motion[0, number] = row_of[progress.edge], progress.motion
    stays = np.asarray((legs.edge < 0).all(axis=-1))
    return paths._replace(legs=legs, edge=edge, motion=motion, stays=stays, waits=waits, rests=edge < 0)


def _waits(track: Track) -> bool:
    """Whether an agent is on its first node until it leaves."""
    return len(track.path) > 1 and track.path[0] == track.path[1]


def _arrivals(track: Track) -> Track:
    """Return the nodes that an agent has come to by its legs, the one where it began first, and again if it waited."""
    if not track.legs:
        return track
    waits = _waits(track)
    ends = [leg for leg in track.legs if leg.end in (0.0, 1.0)]
    nodes = [leg.target if leg.end else leg.source for leg in ends]
    return Track((*track.path[: 1 + waits], *nodes), (*track.times[: 1 + waits], *(leg.until for leg in ends)))
