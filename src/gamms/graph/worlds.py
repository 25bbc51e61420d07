"""What a visibility table is of: the nodes and faces of one moment, and whether they are still the same."""

from hashlib import sha256
from struct import pack

import numpy as np

from gamms.graph.graph import Graph
from gamms.graph.obstacles import Obstacles
from gamms.ir.graph import FloatArray, IntArray


class World:
    """The nodes and faces that there are now.

    Other changes of the graph, such as a closed road, leave a world current.
    """

    def __init__(self, graph: Graph, obstacles: Obstacles) -> None:
        self.graph = graph
        self._obstacles = obstacles
        self._revisions = self._revisions_now()
        self._is_current = True
        self.node_ids, self.xy = _nodes_of(graph)
        self.corners: FloatArray = obstacles.columns().corners  # (faces, 4, 3)
        self._nodes, self._faces = _digest(self.node_ids, self.xy), _digest(self.corners)

    @property
    def is_current(self) -> bool:
        """Whether nodes and faces are still these."""
        now = self._revisions_now()
        if now != self._revisions:
            is_same = _digest(*_nodes_of(self.graph)) == self._nodes
            if is_same and now[1] != self._revisions[1]:
                is_same = _digest(self._obstacles.columns().corners) == self._faces
            self._revisions, self._is_current = now, is_same
        return self._is_current

    def key(self, radius: float, observer_height: float) -> bytes:
        """32 bytes that are others for another world, radius or height."""
        parts = b"gamms sight 2", self._nodes, self._faces, pack("<dd", radius, observer_height)
        return sha256(b"".join(parts)).digest()

    def _revisions_now(self) -> tuple[int, int]:
        return self.graph.revision, self._obstacles.revision


def _nodes_of(graph: Graph) -> tuple[IntArray, FloatArray]:
    """Ids (nodes,) and coordinates (nodes, 2), in insertion order."""
    rows = graph._nodes.living()
    return graph._nodes.array("ids")[rows], graph._nodes.array("xy")[rows]


def _digest(*arrays: "np.ndarray[tuple[int, ...], np.dtype[np.generic]]") -> bytes:
    digest = sha256()
    for array in arrays:
        digest.update(pack("<Q", len(array)))
        digest.update(array.astype(array.dtype.newbyteorder("<"), copy=False).tobytes())
    return digest.digest()
