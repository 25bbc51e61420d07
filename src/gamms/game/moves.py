"""The one writer of where agents are: check an action, then write it into the columns."""

from math import hypot
from typing import Any

from gamms.arguments import as_float, as_int
from gamms.errors import BadType, BadValue, UnknownName
from gamms.ir.agents import AgentColumns
from gamms.typing.agent_engine import IMoves
from gamms.typing.graph_engine import IGraph


class Moves(IMoves):
    """Writes moves of agents on `graph`. A move need not follow an edge: programs put agents back that way."""

    def __init__(self, graph: IGraph) -> None:
        self._has_node = graph.has_node
        self._near = graph.neighborhoods

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
            self.act(columns, row, _as_node(action))

    def place(self, columns: AgentColumns, row: int, node_id: Any) -> None:
        """Put an agent on a node."""
        columns.node[row] = self._checked(node_id)
        columns.touched.add(row)

    def place_previous(self, columns: AgentColumns, row: int, node_id: Any) -> None:
        """Say on which node an agent was before."""
        columns.previous[row] = self._checked(node_id)

    def turn(self, columns: AgentColumns, row: int, heading: Any) -> None:
        """Face a direction, or follow the moves again."""
        columns.heading[row] = None if heading is None else _unit(heading)

    def _act_in_detail(self, columns: AgentColumns, row: int, action: dict[str, Any]) -> None:
        if "node_id" not in action:
            raise BadValue(f"An action dict needs 'node_id'; got only {sorted(map(str, action))}.")
        node_id = self._checked(action["node_id"])
        if action.get("orientation") is not None:
            _unit(action["orientation"])
        self.act(columns, row, node_id)
        if "orientation" in action:
            self.turn(columns, row, action["orientation"])

    def _checked(self, node_id: Any) -> int:
        node = as_int(node_id, "A node id")
        if not self._has_node(node):
            raise UnknownName("node", node)
        return node


def _as_node(value: Any) -> int:
    try:
        return as_int(value, "A node id")
    except BadType:
        raise BadType(
            f"An action must be a node id or a dict with 'node_id', not {value!r} ({type(value).__name__})."
        ) from None


def _unit(heading: Any) -> tuple[float, float]:
    try:
        x, y = heading
    except (TypeError, ValueError):
        raise BadValue(f"An orientation must be a pair (cos, sin), not {heading!r}.") from None
    x, y = as_float(x, "An orientation"), as_float(y, "An orientation")
    scale = max(abs(x), abs(y))  # first, so that no square overflows or vanishes
    if scale == 0.0:
        raise BadValue("An orientation must not be (0, 0). Use None to follow the moves again.")
    x, y = x / scale, y / scale
    length = hypot(x, y)
    return x / length, y / length
