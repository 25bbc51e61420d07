"""What was seen from a place: remembered as long as the graph stays as it is, and shared by all sensors."""

from math import inf, pi
from typing import Any

from gamms.typing import IContext
from gamms.typing.graph_engine import Surroundings

_MOST_WORDS = 1 << 24  # of 8 bytes: what may be remembered in all
_WORDS_PER_NODE = 12  # of a dict entry
_WORDS_PER_VIEW = 100  # of its key and its empty containers


class Views:
    """Surroundings by place, radius and field of view."""

    def __init__(self, ctx: IContext) -> None:
        self._ctx = ctx
        self._revision: int | None = None
        self._seen: dict[Any, Surroundings] = {}
        self._words = 0

    def look(self, node_id: int, radius: float, fov: float, heading: tuple[float, float]) -> dict[str, Any]:
        """What a map sensor sees: fresh `{'nodes': {id: Node}, 'edges': [OSMEdge, …]}`."""
        graph = self._ctx.graph.graph
        is_cone = fov != 2.0 * pi and heading != (0.0, 0.0)
        if graph.revision != self._revision or self._revision is None:
            self._forget(graph.revision)
        key = (node_id if is_cone or radius != inf else None, radius, fov, heading if is_cone else None)
        seen = self._seen.get(key)
        if seen is None or (key[0] is None and not graph.has_node(node_id)):
            seen = graph.within(node_id, radius, fov, heading)
            if self._revision is not None:
                self._keep(key, seen)
        return {"nodes": seen.nodes.copy(), "edges": seen.edges.copy()}

    def _forget(self, revision: int | None) -> None:
        self._revision = revision
        self._seen.clear()
        self._words = 0

    def _keep(self, key: Any, seen: Surroundings) -> None:
        self._words += _words(seen)
        self._seen[key] = seen
        while self._words > _MOST_WORDS:  # the oldest goes first
            self._words -= _words(self._seen.pop(next(iter(self._seen))))


def _words(seen: Surroundings) -> int:
    return _WORDS_PER_VIEW + _WORDS_PER_NODE * len(seen.nodes) + len(seen.edges)
