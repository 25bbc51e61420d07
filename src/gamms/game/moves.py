"""The one writer of where agents are: check an action, then write it into the columns."""

from typing import Any

from gamms.errors import BadValue, UnknownName
from gamms.game.checks import as_heading, as_node
from gamms.game.flights import Flights
from gamms.ir.agents import AgentColumns, Selection
from gamms.typing.agent_engine import IMoves
from gamms.typing.graph_engine import IGraph


class Moves(Flights):
    """Writes moves of agents on `graph`. A move need not follow an edge: programs put agents back that way."""

    def __init__(self, graph: IGraph) -> None:
        super().__init__(graph)
        self._near = graph.neighborhoods

    def journaled(self, columns: AgentColumns) -> IMoves:
        """The same, noting in the journal of `columns` what happens to the agents in it."""
        from gamms.game.journaled import JournaledMoves

        return JournaledMoves(self._graph, columns)

    def plain(self) -> IMoves:
        """The same, noting nothing."""
        return Moves(self._graph)

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

    def _act_in_detail(self, columns: AgentColumns, row: int, action: dict[str, Any]) -> None:
        if "node_id" not in action:
            raise BadValue(f"An action dict needs 'node_id'; got only {sorted(map(str, action))}.")
        node_id = self._checked(action["node_id"])
        if action.get("orientation") is not None:
            as_heading(action["orientation"])
        self.act(columns, row, node_id)
        if "orientation" in action:
            self.turn(columns, row, action["orientation"])
