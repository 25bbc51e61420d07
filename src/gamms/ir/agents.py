"""All agents of a context, one row each, in the order of their creation."""

from typing import Any

import numpy as np

from gamms.ir.graph import IntArray


class AgentColumns:
    """Row `i` is agent `i`.

    The columns are lists, because the paper's loop reads and writes them one by one, and arrays are made of them
    when asked for (benchmarks/README.md, w2).

    Attributes:
        names, teams: of each agent; a team is whatever the caller calls one.
        node, previous: ids of nodes.
        heading: `(cos, sin)` where it was set; None where it follows from the last move.
        touched: rows whose node may have changed since `nodes` was asked last; whoever writes `node` adds to it.
    """

    __slots__ = ("_moves", "_nodes", "heading", "names", "node", "previous", "teams", "touched")

    def __init__(self) -> None:
        self.names: list[str] = []
        self.teams: list[Any] = []
        self.node: list[int] = []
        self.previous: list[int] = []
        self.heading: list[tuple[float, float] | None] = []
        self.touched: set[int] = set()
        self._nodes: IntArray = np.zeros(0, np.int64)
        self._moves = 0

    def __len__(self) -> int:
        return len(self.names)

    def append(self, name: str, node: int, team: Any) -> int:
        """Add an agent that stands on `node`; returns its row."""
        row = len(self.names)
        self.names.append(name)
        self.teams.append(team)
        self.node.append(node)
        self.previous.append(node)
        self.heading.append(None)
        self.touched.add(row)
        return row

    def copy_row(self, source: "AgentColumns", row: int) -> int:
        """Add the agent in a row of other columns; returns its row here."""
        new = self.append(source.names[row], source.node[row], source.teams[row])
        self.previous[new], self.heading[new] = source.previous[row], source.heading[row]
        return new

    def keep(self, rows: list[int]) -> None:
        """Forget every row but `rows`, which become rows 0, 1, … in the order given."""
        for name in ("names", "teams", "node", "previous", "heading"):
            column = getattr(self, name)
            setattr(self, name, [column[row] for row in rows])
        self._nodes = np.zeros(0, np.int64)
        self.touched = set(range(len(rows)))
        self._moves += 1

    def nodes(self) -> tuple[IntArray, int]:
        """The node ids (agents,) as an array not to be written to, and a number that changes whenever it does."""
        touched, node = self.touched, self.node
        if touched:
            if len(self._nodes) == len(node) and len(touched) < len(node) // 8:
                self._nodes = self._nodes.copy()
                for row in touched:
                    self._nodes[row] = node[row]
            else:
                self._nodes = np.array(node, np.int64)
            self._nodes.setflags(write=False)
            touched.clear()
            self._moves += 1
        return self._nodes, self._moves
