"""The part of the one writer that is for flyers: where they are in space, and which node is below them."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from gamms import kernels
from gamms.arguments import as_float, as_int
from gamms.errors import BadValue, UnknownName
from gamms.game.checks import as_heading, as_position, as_quat, flight, position_of
from gamms.ir.agents import UNTURNED, AgentColumns, Position, Quat
from gamms.typing.agent_engine import IMoves
from gamms.typing.graph_engine import IGraph


class Flights(IMoves):
    """Writes moves of flyers above `graph`; the rest of `IMoves` is left to a subclass."""

    def __init__(self, graph: IGraph) -> None:
        self._graph = graph
        self._has_node = graph.has_node

    @contextmanager
    def trusting(self) -> Iterator[None]:
        """Take any integer for a node that is there; for who plays a recording, whose map may have changed since."""
        before, self._has_node = self._has_node, lambda node_id: True  # noqa: ARG005 - named as in the graph
        try:
            yield
        finally:
            self._has_node = before

    def launch(self, columns: AgentColumns, row: int, node_id: Any, speed: Any, position: Any) -> None:
        """Begin on a node, or at a position near it, as if it had always been there."""
        node = self._checked(node_id)
        units = as_float(speed, f"speed of agent {columns.names[row]!r}")
        if units < 0.0:
            raise BadValue(f"speed of agent {columns.names[row]!r} must not be negative, not {units}.")
        where = self._above(node, 0.0) if position is None else as_position(position)
        columns.node[row] = columns.previous[row] = node
        columns.position[row] = columns.previous_position[row] = where
        columns.speed[row] = units
        columns.adrift.add(row)
        columns.touched.add(row)

    def fly(self, columns: AgentColumns, row: int, action: Any) -> None:
        """Do what a flyer's action says: a direction, or `{'direction': …, 'quat': …}`."""
        self.land(columns, row, *flight(columns, row, action))

    def land(self, columns: AgentColumns, row: int, position: Position | None, quat: Quat | None) -> None:
        """Write what `flight` worked out: a new position and a new turn, where there are any."""
        if position is not None:
            self._put(columns, row, position)
        if quat is not None:
            columns.quat[row] = quat

    def place_at(self, columns: AgentColumns, row: int, position: Any) -> None:
        """Put a flyer somewhere."""
        self._put(columns, row, as_position(position))

    def place_above(self, columns: AgentColumns, row: int, node_id: Any) -> None:
        """Put a flyer above a node, as high as it is."""
        self._put(columns, row, self._above(self._checked(node_id), position_of(columns, row)[2]))

    def face(self, columns: AgentColumns, row: int, heading: Any) -> None:
        """Turn a flyer about the vertical, and level."""
        columns.quat[row] = UNTURNED if heading is None else kernels.about_z(as_heading(heading))

    def turn_in_space(self, columns: AgentColumns, row: int, quat: Any) -> None:
        """Turn a flyer."""
        columns.quat[row] = as_quat(quat)

    def nearest(self, columns: AgentColumns, row: int) -> int:
        """The node nearest to a flyer."""
        self._survey(columns)
        if row in columns.adrift:
            self._find_node(columns, row)
        return columns.node[row]

    def locate(self, columns: AgentColumns) -> None:
        """Bring the nodes of all flyers up to date."""
        self._survey(columns)
        for row in sorted(columns.adrift):
            self._find_node(columns, row)

    def _survey(self, columns: AgentColumns) -> None:
        """Let every flyer's node be worked out anew if the graph has changed."""
        revision = self._graph.revision
        if revision is None or revision != columns.surveyed:
            columns.adrift.update(columns.flying)
            columns.surveyed = revision

    def _find_node(self, columns: AgentColumns, row: int) -> None:
        x, y, _ = position_of(columns, row)
        try:
            node = self._graph.nearest_node(x, y)
        except BadValue:
            if next(iter(self._graph.get_nodes()), None) is not None:
                raise
            node = columns.node[row]  # of the graph, nothing is left
        columns.adrift.discard(row)
        if node != columns.node[row]:
            columns.node[row] = node
            columns.touched.add(row)

    def _put(self, columns: AgentColumns, row: int, position: Position) -> None:
        node, before = self.nearest(columns, row), position_of(columns, row)
        columns.previous[row] = node
        columns.previous_position[row] = before
        columns.position[row] = position
        if position[:2] != before[:2]:
            columns.adrift.add(row)
        columns.touched.add(row)

    def _above(self, node: int, z: float) -> Position:
        if not self._graph.has_node(node):
            return (0.0, 0.0, z)  # trusted: who plays a recording knows the position
        _, x, y = self._graph.get_node(node)
        return (x, y, z)

    def _checked(self, node_id: Any) -> int:
        node = as_int(node_id, "A node id")
        if not self._has_node(node):
            raise UnknownName("node", node)
        return node
