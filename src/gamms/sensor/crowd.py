"""Where all agents are, as arrays: worked out once per change and shared by all sensors that look for agents."""

from typing import NamedTuple

import numpy as np

from gamms.errors import UnknownName
from gamms.ir.graph import FloatArray, IntArray
from gamms.typing import IContext


class Snapshot(NamedTuple):
    """All agents at one moment, in the order of their creation."""

    names: list[str]
    nodes: IntArray  # (agents,)  ids
    x: FloatArray  # (agents,)
    y: FloatArray  # (agents,)


class Crowd:
    """The agents of one context."""

    def __init__(self, ctx: IContext) -> None:
        self._ctx = ctx
        self._key: tuple[int | None, int | None] = (None, None)
        self._now: Snapshot | None = None
        self._everyone: dict[str, int] | None = None

    def now(self) -> Snapshot:
        """Where everybody is.

        Raises:
            UnknownName (KeyError): an agent stands on a node that was removed.
        """
        roll, graph = self._ctx.agent.roll(), self._ctx.graph.graph
        key = (roll.moves, graph.revision)
        if self._now is None or key != self._key or None in key:
            try:
                xy = graph.positions(roll.nodes)
            except UnknownName:
                lost = next(i for i, node in enumerate(roll.nodes.tolist()) if not graph.has_node(node))
                raise UnknownName(f"node under agent {roll.names[lost]!r}:", int(roll.nodes[lost])) from None
            columns = np.ascontiguousarray(xy.T)
            self._now = Snapshot(list(roll.names), roll.nodes, columns[0], columns[1])
            self._key, self._everyone = key, None
        return self._now

    def everyone(self) -> dict[str, int]:
        """A fresh dict of all agents: name -> id of the node."""
        now = self.now()
        if self._everyone is None:
            self._everyone = dict(zip(now.names, now.nodes.tolist(), strict=True))
        return self._everyone.copy()
