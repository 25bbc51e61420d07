"""The one writer of where agents are: check an action, then write it into the columns, and into a journal if any."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from gamms import kernels
from gamms.arguments import as_float, as_int
from gamms.errors import BadValue, UnknownName
from gamms.game.legality import as_heading, as_node, as_position, as_quat, flight, position_of
from gamms.ir import events as kinds
from gamms.ir.agents import UNTURNED, AgentColumns, Position, Quat, Selection
from gamms.typing.agent_engine import IMoves
from gamms.typing.graph_engine import IGraph


class Moves(IMoves):
    """Writes moves of agents on `graph`. A move need not follow an edge: programs put agents back that way."""

    def __init__(self, graph: IGraph) -> None:
        self._graph = graph
        self._has_node = graph.has_node
        self._near = graph.neighborhoods

    def journaled(self, columns: AgentColumns) -> IMoves:
        """The same, noting in the journal of `columns` what happens to the agents in it."""
        return JournaledMoves(self._graph, columns)

    def plain(self) -> IMoves:
        """The same, noting nothing."""
        return Moves(self._graph)

    @contextmanager
    def trusting(self) -> Iterator[None]:
        """Take any integer for a node that is there; for who plays a recording, whose map may have changed since."""
        before, self._has_node = self._has_node, lambda node_id: True  # noqa: ARG005 - named as in the graph
        try:
            yield
        finally:
            self._has_node = before

    def act(self, columns: AgentColumns, row: int, action: Any) -> None:
        """Do what an action says: a node id, or `{'node_id': …, 'orientation': …}`."""
        # NOTE: the plain int comes first and in line: it is every move of most games (benchmarks/README.md, w2).
        if type(action) is int:
            if action not in self._near and not self._has_node(action):
                raise UnknownName("node", action)
            node = columns.node
            columns.previous[row] = node[row]
            node[row] = action
            columns.touched.add(row)
        elif isinstance(action, dict):
            self._act_in_detail(columns, row, action)
        else:
            self.act(columns, row, as_node(action))

    def act_together(self, columns: AgentColumns, who: Selection, ends: list[int]) -> None:
        """Move many agents on the ground at once, to nodes that are there; who stays has come from where it is."""
        who.write(columns.previous, who.of(columns.node))
        who.write(columns.node, ends)
        columns.touched |= who.as_set

    def place(self, columns: AgentColumns, row: int, node_id: Any) -> None:
        """Put an agent on a node."""
        columns.node[row] = self._checked(node_id)
        columns.set_progress(row, None)
        columns.touched.add(row)

    def place_previous(self, columns: AgentColumns, row: int, node_id: Any) -> None:
        """Say on which node an agent was before."""
        columns.previous[row] = self._checked(node_id)

    def turn(self, columns: AgentColumns, row: int, heading: Any) -> None:
        """Face a direction, or follow the moves again."""
        columns.heading[row] = None if heading is None else as_heading(heading)

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

    def _act_in_detail(self, columns: AgentColumns, row: int, action: dict[str, Any]) -> None:
        if "node_id" not in action:
            raise BadValue(f"An action dict needs 'node_id'; got only {sorted(map(str, action))}.")
        node_id = self._checked(action["node_id"])
        if action.get("orientation") is not None:
            as_heading(action["orientation"])
        self.act(columns, row, node_id)
        if "orientation" in action:
            self.turn(columns, row, action["orientation"])

    def _survey(self, columns: AgentColumns) -> None:
        """Mark the nodes below all flyers as out of date if the graph has changed."""
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


class JournaledMoves(Moves):
    """Writes moves, and notes those of the agents in the world in their columns' journal."""

    def __init__(self, graph: IGraph, world: AgentColumns) -> None:
        super().__init__(graph)
        self._world = world

    def act(self, columns: AgentColumns, row: int, action: Any) -> None:
        """Do what an action says, and note it."""
        # NOTE: the plain int in line, as in `Moves.act`: it is every move of most games (benchmarks/README.md, w4).
        if type(action) is int and columns is self._world:
            if action not in self._near and not self._has_node(action):
                super().act(columns, row, action)  # which says what is wrong
            node = columns.node
            columns.previous[row] = node[row]
            node[row] = action
            columns.touched.add(row)
            journal_of = columns.journal
            log = journal_of.log
            log.append(journal_of.ids[row])
            log.append(action)
        else:
            super().act(columns, row, action)

    def act_together(self, columns: AgentColumns, who: Selection, ends: list[int]) -> None:
        """Move many agents at once, and note it."""
        super().act_together(columns, who, ends)
        ids = columns.journal.ids
        columns.journal.log += [number for row, end in zip(who.rows, ends, strict=True) for number in (ids[row], end)]

    def place(self, columns: AgentColumns, row: int, node_id: Any) -> None:
        """Put an agent on a node, and note it."""
        super().place(columns, row, node_id)
        self._note(columns, row, kinds.AGENT_CURRENT_NODE, node_id=columns.node[row])

    def place_previous(self, columns: AgentColumns, row: int, node_id: Any) -> None:
        """Say on which node an agent was before, and note it."""
        super().place_previous(columns, row, node_id)
        self._note(columns, row, kinds.AGENT_PREV_NODE, node_id=columns.previous[row])

    def turn(self, columns: AgentColumns, row: int, heading: Any) -> None:
        """Face a direction, and note it."""
        super().turn(columns, row, heading)
        faced = columns.heading[row]
        self._note(columns, row, kinds.AGENT_ORIENTATION, orientation=None if faced is None else list(faced))

    def land(self, columns: AgentColumns, row: int, position: Position | None, quat: Quat | None) -> None:
        """Write where a flyer goes, and note it."""
        super().land(columns, row, position, quat)
        if quat is not None:
            columns.journal.turned(row, quat)

    def face(self, columns: AgentColumns, row: int, heading: Any) -> None:
        """Turn a flyer about the vertical, and note it."""
        super().face(columns, row, heading)
        columns.journal.turned(row, columns.quat[row] or UNTURNED)

    def turn_in_space(self, columns: AgentColumns, row: int, quat: Any) -> None:
        """Turn a flyer, and note it."""
        super().turn_in_space(columns, row, quat)
        columns.journal.turned(row, columns.quat[row] or UNTURNED)

    def _put(self, columns: AgentColumns, row: int, position: Position) -> None:
        super()._put(columns, row, position)
        if columns is self._world:
            columns.journal.flew(row, self.nearest(columns, row), position)

    def _note(self, columns: AgentColumns, row: int, kind: int, **data: Any) -> None:
        columns.journal.note(kind, {"agent_name": columns.names[row], **data})
