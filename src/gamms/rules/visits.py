"""Where agents were in the course of a turn: at which nodes and along which edges, and when, from 0 to 1."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

from gamms.typing.game import Track

Visit = tuple[int, float, float]  # node id; from when until when
Leg = tuple[int, int, float, float]  # ids of the nodes that an edge leads from and to; from when until when


def tracks_of(ctx: Any, agents: Sequence[Any], *, passing: bool) -> list[Track]:
    """How agents came to where they are; not `passing`: only that they are there at the end of the turn."""
    if passing:
        tracks: list[Track] = ctx.game.tracks(agents)
        return tracks
    return [((agent.current_node_id,), (1.0,)) for agent in agents]


def visits_of(track: Track) -> Sequence[Visit]:
    """The nodes an agent was at; the one that it left at once belongs to the turn before."""
    path, times = track
    # NOTE: one edge or none is the usual case, and there are as many as agents (benchmarks/README.md, turns).
    if len(path) == 1:
        return ((path[0], times[0], 1.0),)
    if len(path) == 2 and path[0] != path[1]:
        return ((path[1], times[1], 1.0),)
    left = [
        after if end == start else now
        for (start, end), (now, after) in zip(pairwise(path), pairwise(times), strict=True)
    ]
    visits = list(zip(path, times, (*left, 1.0), strict=True))
    return visits if path[1] == path[0] else visits[1:]


def legs_of(track: Track) -> Sequence[Leg]:
    """The edges an agent went along."""
    path, times = track
    if len(path) == 1:
        return ()
    if len(path) == 2 and path[0] != path[1]:  # as above
        return ((path[0], path[1], times[0], times[1]),)
    ends = zip(pairwise(path), pairwise(times), strict=True)
    return [(*edge, *span) for edge, span in ends if edge[0] != edge[1]]
