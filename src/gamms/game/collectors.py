"""Values that are collected while a game is played."""

from collections.abc import Callable
from copy import deepcopy
from typing import TYPE_CHECKING, Any, NamedTuple

from gamms.errors import BadType, BadValue, Duplicate
from gamms.text import shown

if TYPE_CHECKING:
    from gamms.game.game import Game


class _Collector(NamedTuple):
    fn: Callable[[Any], Any]
    every: int
    per: str
    columns: dict[str, list[Any]]


class Collectors:
    """All collectors of one game, by name."""

    def __init__(self) -> None:
        self._all: dict[str, _Collector] = {}

    def add(self, name: str, fn: Callable[[Any], Any], every: int, per: str) -> None:
        """Add one; see `Game.collect`."""
        if name in self._all:
            raise Duplicate("a collector", name)
        if not callable(fn):
            raise BadType(f"Collector {shown(name)} needs a function, not {shown(fn)}.")
        if every < 1:
            raise BadValue(f"every must be at least 1, not {every}.")
        if per not in ("game", "agent"):
            raise BadValue(f"per must be 'game' or 'agent', not {shown(per)}.")
        names = ("turn", "value") if per == "game" else ("turn", "agent", "value")
        self._all[name] = _Collector(fn, every, per, {column: [] for column in names})

    def collect(self, game: "Game") -> None:
        """Take the values of this turn."""
        for fn, every, per, columns in self._all.values():
            if game.turn % every:
                continue
            for agent in game.agents if per == "agent" else (None,):
                columns["turn"].append(game.turn)
                if agent is not None:
                    columns["agent"].append(agent.name)
                columns["value"].append(deepcopy(fn(game.ctx if agent is None else agent)))

    def tables(self) -> dict[str, dict[str, list[Any]]]:
        """What was collected so far, by name."""
        return {name: {key: list(values) for key, values in one.columns.items()} for name, one in self._all.items()}

    def kept(self) -> dict[str, _Collector]:
        """Return the collectors there are, for `restore`."""
        return dict(self._all)

    def restore(self, before: dict[str, _Collector]) -> None:
        """Keep these collectors and no others, without values."""
        self._all = dict(before)
        for one in self._all.values():
            for values in one.columns.values():
                values.clear()
