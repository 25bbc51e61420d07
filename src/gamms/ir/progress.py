"""Where along an edge an agent is."""

from enum import IntEnum
from typing import NamedTuple


class Motion(IntEnum):
    """How an agent that has covered part of an edge counts."""

    NONE = 0  # as on the node that the edge leads from: games that count edges know no places between nodes
    FORWARD = 1  # as on the edge, on its way to the end of it
    BACK = 2  # as on the edge, on its way back
    STOPPED = 3  # as on the edge


class Progress(NamedTuple):
    """How much of an edge an agent on the ground has covered, short of its end."""

    source: int  # node id; the last one that the agent has passed
    target: int  # node id
    share: float  # of the edge; more than 0, less than 1
    edge: int = 0  # id of the edge that it is on, unless its motion is NONE
    motion: int = Motion.NONE
