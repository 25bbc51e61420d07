"""Contract of visibility tables: which nodes can be seen from which."""

from abc import ABC, abstractmethod
from collections.abc import Sized
from typing import TYPE_CHECKING, Any

from gamms.ir.graph import IntArray
from gamms.ir.obstacles import BoolArray

if TYPE_CHECKING:
    from gamms.typing.graph_engine import NodeIds


class IVisibility(ABC, Sized):
    """For every node, which nodes within a radius no wall hides, both ends of the sight line equally high.

    A table answers as `ctx.graph.visible` does. It is directed: what a node sees is worked out from that node. Its
    length is the number of nodes. All ids come in insertion order, in fresh arrays.

    Every question raises UnknownName (KeyError) for an id that is no node, and Outdated (RuntimeError) once nodes or
    obstacles are others than those that the table is of.
    """

    @property
    @abstractmethod
    def radius(self) -> float:
        """How far it reaches on the plan, map units, the rim included; may be infinite."""

    @property
    @abstractmethod
    def observer_height(self) -> float:
        """The z of both ends of every sight line, map units."""

    @abstractmethod
    def sees(self, observer: int, target: int) -> bool:
        """Whether a node within the radius of another is visible from there."""

    @abstractmethod
    def mask(self, observer_id: int, ids: Any) -> BoolArray:
        """Whether each of some nodes is within the radius and visible from a node; `ids` is (nodes,) of integers."""

    @abstractmethod
    def from_node(self, node_id: int) -> IntArray:
        """Ids of the nodes that are visible from a node, itself included."""

    @abstractmethod
    def watchers(self, node_id: int) -> IntArray:
        """Ids of the nodes that a node is visible from, itself included."""

    @abstractmethod
    def coverage(self, node_ids: "NodeIds") -> IntArray:
        """Ids of the nodes that are visible from at least one of some nodes."""

    @abstractmethod
    def hidden(self, watchers: "NodeIds") -> IntArray:
        """Ids of the nodes that are visible from none of some nodes."""

    @abstractmethod
    def nearest_hidden(self, node_id: int, watchers: "NodeIds", weight: str | None = "length") -> int | None:
        """The id of the node hidden from all watchers that is nearest by path from a node; itself if it is hidden.

        Of equally near ones by `distances(node_id, weight=weight)`, the first in insertion order; None where no way
        leads to any.
        """
