"""Sees to it that nobody changes the world while strategies decide."""

from typing import TYPE_CHECKING, Any

from gamms.game.errors import Meddling

if TYPE_CHECKING:
    from gamms.game.game import Game


class Watch:
    """Knows how the agents and the world were before anybody decided.

    Attributes:
        rows: those of the agents that were changed since.
    """

    def __init__(self, game: "Game") -> None:
        columns = game.columns
        game.ctx.agent.settle()  # so that what is touched from now on is new
        self._game, self._columns = game, columns
        self._own, self.rows = columns.touched, set[int]()
        columns.touched = self.rows
        self._before = {name: list(getattr(columns, name)) for name in ("node", "position", "quat", "teams", "alive")}
        self._world = self._seen()

    def undone(self, name: str) -> Meddling:
        """Put everything back that a strategy has changed; the error to tell it by."""
        for column, values in self._before.items():
            getattr(self._columns, column)[:] = values
        self._columns.out.clear()
        self._columns.out.update(row for row, alive in enumerate(self._columns.alive) if not alive)
        self.rows.clear()
        return Meddling(f"The strategy of agent {name!r} changed the agents; it may only set state['action'].")

    def restore(self) -> None:
        """Let changes be noted by the columns again."""
        self._columns.touched = self._own
        self._own |= self.rows

    def check_world(self) -> None:
        """Raise Meddling if the graph, the obstacles or who is there have changed."""
        if self._seen() != self._world:
            raise Meddling("A strategy changed the graph, the obstacles or the agents while others were deciding.")

    def _seen(self) -> tuple[Any, ...]:
        room = self._game.ctx.graph
        return room.graph.revision, room.obstacle_revision, tuple(self._game.ctx.agent.agents)
