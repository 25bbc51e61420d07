"""Which way agents look, in all games of a batch."""

import numpy as np

from gamms.game.batch.flights import Flyers
from gamms.game.batch.movement import Movement
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray
from gamms.ir.progress import Motion


class Headings:
    """Which way agents look in all games: where that was set, else along their edges, or as they have moved last.

    Args:
        movement: how the agents go.
        fixed: (agents, 2) `(cos, sin)` where the heading was set; NaN: it follows the moves.
        flyers: the agents whose headings follow from how they are turned; None: none flies.
        before: (agents,) rows of the nodes on which agents were before they began; -1: where they began.
        start: (games, agents) rows, where they began.

    Attributes:
        previous: (games, agents) rows of the nodes on which they were before they moved last.
    """

    def __init__(
        self, movement: Movement, fixed: FloatArray, before: IntArray, start: IntArray, flyers: Flyers | None
    ) -> None:
        self._movement, self._axes, self._fixed = movement, movement.streets.axes, fixed
        self._before, self._flyers = before, flyers
        self.previous = np.where(before < 0, start, before)

    def begin(self, games: IntArray, start: IntArray) -> None:
        """Begin games again, on these nodes."""
        self.previous[games] = np.where(self._before < 0, start, self._before)

    def moved(self, games: IntArray, node: IntArray, which: BoolArray) -> None:
        """Note that some agents, (games, agents), have moved from nodes."""
        self.previous[games] = np.where(which, node, self.previous[games])

    def put(self, games: IntArray, agents: IntArray, node: IntArray) -> None:
        """Note that agents are on nodes as if they had always been there."""
        self.previous[games, agents] = node

    def of(self, games: IntArray, agents: IntArray, node: IntArray) -> tuple[FloatArray, FloatArray]:
        """Return cos and sin of the headings of agents that have passed nodes last, (looks,) each; both 0.0: none."""
        (x, y), before = self._axes, self.previous[games, agents]
        dx, dy = x[node] - x[before], y[node] - y[before]
        far = np.hypot(dx, dy)
        goes, fixed = far > 0.0, self._fixed[agents]
        far = np.where(goes, far, 1.0)
        follows, by, which = np.isnan(fixed[:, 0]), self._movement, (games, agents)
        cos, sin = np.where(follows, dx / far, fixed[:, 0]), np.where(follows, dy / far, fixed[:, 1])
        on = np.flatnonzero(follows & (by.on_edge(which) >= 0))
        if len(on):
            sign = np.where(by.motion[which][on] == Motion.BACK, -1.0, 1.0)
            _, _, x, y = by.lines.at(by.edge[which][on], by.share[which][on])
            cos[on], sin[on] = sign * x, sign * y
        if self._flyers is not None:
            some = np.flatnonzero(np.isin(agents, self._flyers.agents))
            cos[some], sin[some] = self._flyers.headings(games[some], agents[some])
        return cos, sin
