"""How many agents may end a turn on a node: the same number everywhere, one per node, or an attribute of the node."""

from collections.abc import Callable, Mapping
from sys import maxsize
from typing import Any, Protocol

from gamms.arguments import as_int
from gamms.errors import BadType, BadValue, UnknownName
from gamms.graph import Graph
from gamms.text import shown

UNLIMITED = maxsize  # no graph has room for more agents

Capacity = int | Mapping[int, int | None] | str | None  # as a caller gives it


class ILimits(Protocol):
    """The capacity of nodes.

    Attributes:
        least: no node has a smaller one, so that where fewer agents meet nothing has to be asked.
    """

    least: int

    def on(self, graph: Graph) -> Callable[[int], int]:
        """The function from a node id to its capacity, for this turn; `UNLIMITED` where there is none."""


class Everywhere:
    """The same capacity on every node."""

    def __init__(self, capacity: int) -> None:
        self.least = capacity

    def on(self, _: Graph) -> Callable[[int], int]:
        """The one number."""
        return lambda _: self.least


class PerNode:
    """Capacities of some nodes; the others are unlimited."""

    def __init__(self, capacities: Mapping[int, int]) -> None:
        self.least = min(capacities.values(), default=UNLIMITED)
        self._capacities = capacities

    def on(self, _: Graph) -> Callable[[int], int]:
        """What was given for the node."""
        known = self._capacities
        return lambda node: known.get(node, UNLIMITED)


class PerAttribute:
    """Capacities in an attribute of the nodes, read anew in each turn: a door may close."""

    least = 0

    def __init__(self, name: str) -> None:
        self._name = name
        self._is_known = False

    def on(self, graph: Graph) -> Callable[[int], int]:
        """What the node says now."""
        if not self._is_known:
            self._look_for_it(graph)
            self._is_known = True
        name, attributes = self._name, graph.node_attributes
        return lambda node: _as_limit(attributes(node).get(name), f"Attribute {name!r} of node {node}")

    def _look_for_it(self, graph: Graph) -> None:
        """Find it on at least one node: a misspelt attribute would silently let everybody everywhere."""
        seen: dict[str, None] = {}
        for node in graph.get_nodes():
            attributes = graph.node_attributes(node)
            if self._name in attributes:
                return
            seen.update(dict.fromkeys(attributes))
        raise UnknownName("node attribute", self._name, seen)


def as_limits(capacity: Any) -> ILimits | None:
    """What a caller gave as capacity, checked; None if there is none.

    Raises:
        BadType: neither a number, nor a mapping from nodes to numbers, nor the name of an attribute, nor None.
        BadValue: a number too small: below 1 everywhere, below 0 on one node.
    """
    if capacity is None:
        return None
    if isinstance(capacity, str):
        if not capacity:
            raise BadValue("capacity must be the name of a node attribute, not an empty string.")
        return PerAttribute(capacity)
    if isinstance(capacity, Mapping):
        pairs = ((as_int(node, "A node in capacity"), value) for node, value in capacity.items())
        return PerNode({node: _as_limit(value, f"capacity of node {node}") for node, value in pairs})
    try:
        number = as_int(capacity, "capacity")
    except BadType:
        raise BadType(
            "capacity must be an integer, a mapping from node ids to integers, the name of a node attribute, or None, "
            f"not {shown(capacity)} ({type(capacity).__name__})."
        ) from None
    if number < 1:
        raise BadValue(f"capacity must be at least 1, not {number}: nobody could move. Use None for no limit.")
    return Everywhere(number)


def _as_limit(value: Any, name: str) -> int:
    if value is None:
        return UNLIMITED
    # NOTE: the plain int is checked in line: this is asked for every agent that moves (an attribute, 1,000 agents).
    number = value if type(value) is int else as_int(value, name)
    if number < 0:
        raise BadValue(f"{name} must not be negative, not {number}. 0 closes a node, None opens it to any number.")
    return number
