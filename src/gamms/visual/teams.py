"""Colours of teams, and the events of the turn that is shown."""

from collections.abc import Iterable
from typing import Any

from gamms.typing import IContext
from gamms.visual.color import Rgb, team_colors


def side_of(agent: Any) -> Any:
    """Whose colour an agent has: its team's, or its own."""
    team = getattr(agent, "team", None)
    return agent.name if team is None else team


def side_colors(ctx: IContext, more: Iterable[Any] = ()) -> dict[str, Rgb]:
    """A colour for each side there is, and for more teams, by text; the same in every picture of a game."""
    return team_colors([*map(side_of, ctx.agent.create_iter()), *more])


class TurnEvents:
    """The events of `ctx.game`, or of its replay, in the turn that is shown."""

    def __init__(self, ctx: IContext) -> None:
        self._ctx = ctx
        self._begin = self._end = 0
        self._eliminated: frozenset[str] | None = None  # of the last turn, once they are asked for

    def end_turn(self) -> None:
        """A turn is over: its events are those that came since the one before."""
        self._begin, self._end = self._end, len(self._events())
        self._eliminated = None

    def of_kind(self, kind: str) -> list[dict[str, Any]]:
        """The events of that kind in the last turn."""
        return [event for event in self._events()[self._begin : self._end] if event.get("kind") == kind]

    def eliminated(self) -> frozenset[str]:
        """The names of the agents that went out of the game in the last turn."""
        if self._eliminated is None:
            names = (event.get("agent") for event in self.of_kind("eliminated"))
            self._eliminated = frozenset(name for name in names if isinstance(name, str))
        return self._eliminated

    def _events(self) -> list[dict[str, Any]]:
        game = getattr(self._ctx, "_game", None)
        events: list[dict[str, Any]] = [] if game is None else game.events
        if len(events) < self._end:  # the game has begun anew
            self._begin = self._end = 0
            self._eliminated = None
        return events
