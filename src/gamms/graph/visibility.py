"""A visibility table in memory: which nodes see which, and the questions that it answers."""

from collections.abc import Iterable
from typing import Any, ClassVar

import numpy as np

from gamms import kernels
from gamms.errors import Outdated, UnknownName
from gamms.graph import records
from gamms.graph.sights import RowArray, Seen
from gamms.graph.tables import RowIndex
from gamms.graph.worlds import World
from gamms.ir.graph import IntArray
from gamms.ir.obstacles import BoolArray
from gamms.typing.graph_engine import NodeIds
from gamms.typing.visibility import IVisibility


class Visibility(IVisibility):
    """Compressed rows: one for each node, in insertion order, of the nodes that it sees.

    Args:
        world: what the table is of.
        radius: see `IVisibility`.
        observer_height: see `IVisibility`.
        seen: the rows of the nodes that each node sees.
    """

    _strategies_cannot_change: ClassVar = True  # see `readonly.frozen`

    def __init__(self, world: World, radius: float, observer_height: float, seen: Seen) -> None:
        self._world = world
        self._radius, self._observer_height = radius, observer_height
        self._ids = world.node_ids
        self._index = RowIndex()
        self._index.extend(self._ids, 0, "a node")
        self.seen = seen
        self._offsets = np.concatenate((np.zeros(1, np.int64), np.cumsum(seen.counts, dtype=np.int64)))
        self._rows = seen.rows
        self._by_target: tuple[IntArray, RowArray] | None = None

    @property
    def radius(self) -> float:
        """How far it reaches, map units."""
        return self._radius

    @property
    def observer_height(self) -> float:
        """The z of both ends of every sight line, map units."""
        return self._observer_height

    @property
    def nbytes(self) -> int:
        """How much memory it takes."""
        return sum(array.nbytes for array in (self._ids, self._offsets, *self.seen, *(self._by_target or ())))

    @property
    def is_current(self) -> bool:
        """Whether nodes and obstacles are still those that it is of."""
        return self._world.is_current

    def __len__(self) -> int:
        return len(self._ids)

    def sees(self, observer: int, target: int) -> bool:
        """Whether a node within the radius of another is visible from there."""
        seen, row = self._seen(self._row(observer)), self._row(target)
        place = int(seen.searchsorted(row))
        return place < len(seen) and int(seen[place]) == row

    def mask(self, observer_id: int, ids: Any) -> BoolArray:
        """Whether each of some nodes (nodes,) is within the radius and visible from a node."""
        is_seen = np.zeros(len(self._ids), np.bool_)
        is_seen[self._seen(self._row(observer_id))] = True
        asked = ids if isinstance(ids, np.ndarray) else list(ids)
        found: BoolArray = is_seen[self._index.rows(records.id_array(asked, "ids"), "node")]
        return found

    def from_node(self, node_id: int) -> IntArray:
        """Ids of the nodes that are visible from a node, itself included."""
        return self._ids[self._seen(self._row(node_id))]

    def watchers(self, node_id: int) -> IntArray:
        """Ids of the nodes that a node is visible from, itself included."""
        row = self._row(node_id)
        if self._by_target is None:
            offsets, order = kernels.group_rows(self._rows.astype(np.int64), len(self))
            observers: RowArray = np.repeat(np.arange(len(self), dtype=np.int32), self.seen.counts)
            self._by_target = offsets, observers[order]
        offsets, observers = self._by_target
        return self._ids[observers[offsets[row] : offsets[row + 1]]]

    def coverage(self, node_ids: NodeIds) -> IntArray:
        """Ids of the nodes that are visible from at least one of some nodes."""
        return self._ids[self._is_covered(node_ids)]

    def hidden(self, watchers: NodeIds) -> IntArray:
        """Ids of the nodes that are visible from none of some nodes."""
        return self._ids[~self._is_covered(watchers)]

    def nearest_hidden(self, node_id: int, watchers: NodeIds, weight: str | None = "length") -> int | None:
        """The id of the node hidden from all watchers that is nearest by path from a node; itself if it is hidden."""
        row, is_covered = self._row(node_id), self._is_covered(watchers)
        if not is_covered[row]:
            return int(self._ids[row])
        distances = self._world.graph.distances(source=node_id, weight=weight)
        ids = np.fromiter(distances, np.int64, len(distances))
        far = np.fromiter(distances.values(), np.float64, len(distances))
        is_hidden = ~is_covered[self._index.rows(ids, "node")]
        return int(ids[is_hidden][far[is_hidden].argmin()]) if is_hidden.any() else None

    # -- rows ---------------------------------------------------------------------------------------------------

    def _row(self, node_id: int) -> int:
        self._refuse_outdated()
        row = self._index.row(records.as_id(node_id, "a node"))
        if row < 0:
            raise UnknownName("node", node_id)
        return row

    def _seen(self, row: int) -> RowArray:
        return self._rows[self._offsets[row] : self._offsets[row + 1]]

    def _is_covered(self, node_ids: NodeIds) -> BoolArray:
        self._refuse_outdated()
        asked = list(node_ids) if isinstance(node_ids, Iterable) else [node_ids]
        ids = np.array([records.as_id(id, "a node") for id in asked], np.int64)
        is_covered = np.zeros(len(self), np.bool_)
        for row in self._index.rows(ids, "node").tolist():
            is_covered[self._seen(row)] = True
        return is_covered

    def _refuse_outdated(self) -> None:
        if not self._world.is_current:
            raise Outdated("nodes or obstacles have changed since this table was made", "ctx.graph.visibility(…)")
