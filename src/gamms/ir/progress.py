"""The position of an agent along an edge."""

from enum import IntEnum
from typing import NamedTuple


class Motion(IntEnum):
    """The state of an agent that has covered a part of an edge."""

    NONE = 0  # counts as on the source node: games that count edges have no positions between nodes
    FORWARD = 1  # on the edge, moving to its end
    BACK = 2  # on the edge, moving back
    STOPPED = 3  # as on the edge


class Progress(NamedTuple):
    """The part of an edge that an agent on the ground has covered, before it reaches the end."""

    source: int  # node id; the last node that the agent passed
    target: int  # node id
    share: float  # covered share of the edge, between 0 and 1
    edge: int = 0  # id of the edge, unless the motion is NONE
    motion: int = Motion.NONE
