"""The position of an agent along an edge."""

from collections.abc import Mapping
from enum import IntEnum
from typing import Any, NamedTuple


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


def find_steps_along(steps: Mapping[str, tuple[Any, Any]], named: Mapping[str, int]) -> dict[str, tuple[Any, Progress]]:
    """Return the steps of agents from node to node along the edges that their actions have named, for pictures.

    Args:
        steps: agent -> the place before and after its move.
        named: agent -> the id of the edge.
    """
    moved = {name: ends for name, ends in steps.items() if name in named and ends[0] != ends[1]}
    on_nodes = {name: ends for name, ends in moved.items() if isinstance(ends[0], int) and isinstance(ends[1], int)}
    return {name: (a, Progress(a, b, 1.0, named[name], Motion.FORWARD)) for name, (a, b) in on_nodes.items()}
