"""What is observed of games of which the turn engine plays some, because they have left the arrays."""

from collections.abc import Callable, Iterator, Sequence
from typing import Any, TypeVar

import numpy as np

from gamms.game.batch.columns import joined_rows, some_rows
from gamms.game.batch.movement import Index, Places
from gamms.game.batch.sight import Seen
from gamms.game.batch.state import GameArrays
from gamms.game.batch.surroundings import SeenNodes
from gamms.game.batch.vectors import Vectors
from gamms.game.batch.view import ArrayView
from gamms.ir.graph import FloatArray, IntArray
from gamms.ir.obstacles import BoolArray

T = TypeVar("T")
A = TypeVar("A", bound=np.ndarray[Any, Any])
P = TypeVar("P", Seen, SeenNodes)


class JoinedView(ArrayView):
    """A view of games of which the turn engine plays some.

    What is legal, where on edges agents are and what sensors show is that of each game where it is played: `parts` are
    games, and the state in which they are.
    """

    def __init__(
        self,
        state: GameArrays,
        agents: IntArray,
        parts: Sequence[tuple[IntArray, GameArrays]],
    ) -> None:
        super().__init__(state, np.arange(len(state)), agents)
        self._parts = parts

    def _each(self, asked: Callable[[ArrayView], T]) -> Iterator[tuple[IntArray, T]]:
        """Yield the games of each part, and what a view of them gives."""
        for games, state in self._parts:
            yield games, asked(ArrayView(state, games, self.agents))

    def _joined(self, asked: Callable[[ArrayView], A], fill: float) -> A:
        """Return what views of the parts give, one value or several for each agent."""
        parts: list[Any] = list(self._each(asked))
        most = np.max([part.shape[2:] for _, part in parts], axis=0).astype(int)
        found: Any = np.full((*self.node.shape, *most), fill)
        for games, part in parts:
            found[np.ix_(games, *map(np.arange, part.shape[1:]))] = part
        joined: A = found
        return joined

    @property
    def counts(self) -> IntArray:
        """How many nodes are legal for each agent, its own included."""
        return self._joined(lambda view: view.counts, 1)

    def legal_rows(self, which: Index = np.s_[:, :]) -> tuple[IntArray, BoolArray]:
        """Return the rows of the legal nodes of each agent, (games, agents, most), and which of these count."""
        rows = self._joined(lambda view: view.legal_rows()[0], 0)
        return rows[which], self._joined(lambda view: view.legal_rows()[1], 0)[which] > 0

    def _heights(self) -> FloatArray:
        return self._joined(lambda view: view._heights(), 0.0)

    def _places(self) -> Places:
        """Return where the agents are: in games by metres some may be on edges."""
        return Places(
            self._joined(lambda view: view._places().edge, -1),
            self._joined(lambda view: view._places().offset_m, 0.0),
            self._joined(lambda view: view._places().xy, 0.0),
        )

    def action_to(self, nodes: Any) -> IntArray:
        """Return the actions that lead to these nodes, (games, agents); -1 where one is not legal."""
        wanted = np.broadcast_to(nodes, self.node.shape)
        return self._joined(lambda view: view.action_to(wanted[view.games]), -1)

    def _looked(self, names: tuple[str, ...]) -> Seen:
        """Return what sensors of these names show to all agents of the view, or all sensors; see `seen`."""
        return self._pairs(lambda view: view._looked(names))

    def seen_nodes(self, *names: str) -> SeenNodes:
        """Return which nodes the sensors show to those in the mask."""
        return self._pairs(lambda view: view.seen_nodes(*names))

    def _pairs(self, asked: Callable[[ArrayView], P]) -> P:
        """Return the pairs that views of the parts give, by game."""
        whole = joined_rows([found._replace(at=games[found.at]) for games, found in self._each(asked)])
        in_order = some_rows(whole, np.argsort(whole.at, kind="stable"))
        return in_order._replace(shape=(*self.node.shape, whole.shape[2]))

    def _encoded(self, others: int, actions: int | None) -> Vectors:
        """Return vectors of a number of actions; None: of the most that are legal anywhere while all roads are open."""
        most = self._movement.width if actions is None else actions
        whole = super()._encoded(others, most)
        for games, part in self._each(lambda view: view._encoded(others, most)):
            whole.values[games], whole.legal[games] = part.values, part.legal
        return whole
