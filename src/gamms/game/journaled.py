"""The one writer of moves, while somebody reads the journal."""

from typing import Any

from gamms.game.moves import Moves
from gamms.ir import journal
from gamms.ir.agents import UNTURNED, AgentColumns, Position, Quat, Selection
from gamms.typing.graph_engine import IGraph


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
        self._note(columns, row, journal.AGENT_CURRENT_NODE, node_id=columns.node[row])

    def place_previous(self, columns: AgentColumns, row: int, node_id: Any) -> None:
        """Say on which node an agent was before, and note it."""
        super().place_previous(columns, row, node_id)
        self._note(columns, row, journal.AGENT_PREV_NODE, node_id=columns.previous[row])

    def turn(self, columns: AgentColumns, row: int, heading: Any) -> None:
        """Face a direction, and note it."""
        super().turn(columns, row, heading)
        faced = columns.heading[row]
        self._note(columns, row, journal.AGENT_ORIENTATION, orientation=None if faced is None else list(faced))

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
