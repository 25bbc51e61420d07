"""When an agent is where in a turn, the time from 0 to 1."""

from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise


@dataclass
class Stay:
    """That an agent is on a node from one time of the turn to another."""

    begin: Fraction
    end: Fraction
    node: int


@dataclass
class Ride:
    """That an agent goes along an edge, from `x0` to `x1` metres of it, between two times of the turn."""

    begin: Fraction
    end: Fraction
    source: int
    target: int
    x0: Fraction = Fraction(0)
    x1: Fraction = Fraction(1)


def track_along(nodes, begin, end):
    """Return when an agent is where: of n edges it is at the k-th node after k/n of its part of the turn."""
    if len(nodes) == 1:
        return [Stay(Fraction(0), Fraction(1), nodes[0])]
    # One that waits for its part of the turn reaches its node once more when this begins.
    track = [Stay(Fraction(0), begin, nodes[0]), Stay(begin, begin, nodes[0])] if begin else []
    each, now = (end - begin) / (len(nodes) - 1), begin
    for source, target in pairwise(nodes):
        if source == target:
            track.append(Stay(now, now + each, source))
        else:
            track += [Ride(now, now + each, source, target), Stay(now + each, now + each, target)]
        now += each
    return [*track, Stay(end, Fraction(1), nodes[-1])]
