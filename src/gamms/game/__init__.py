"""The game engine: `ctx.game`, which plays turns in which all agents move at once.

Read `game.py` first, then `turn.py`; the state is `gamms.ir.game_state`. A rule is a plain function; a new one needs
nothing here. May import: typing, kernels, ir and below, never another engine.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from gamms.typing.game import Move

if TYPE_CHECKING:
    from gamms.errors import IllegalMutation
    from gamms.game.deciders import Plan, TeamArrays
    from gamms.game.game import Game
    from gamms.game.legality import IllegalAction
    from gamms.game.result import Result
    from gamms.game.settings import Settings
    from gamms.game.snapshots import Snapshot, SnapshotError

__all__ = [
    "Game",
    "IllegalAction",
    "IllegalMutation",
    "Move",
    "Plan",
    "Result",
    "Settings",
    "Snapshot",
    "SnapshotError",
    "TeamArrays",
]

_HOMES = {
    "Game": "game.game",
    "IllegalAction": "game.legality",
    "IllegalMutation": "errors",
    "Plan": "game.deciders",
    "Result": "game.result",
    "Settings": "game.settings",
    "Snapshot": "game.snapshots",
    "SnapshotError": "game.snapshots",
    "TeamArrays": "game.deciders",
}


def __getattr__(name: str) -> Any:
    if name in _HOMES:  # loaded on first use: the paper's own loop needs none of them
        return getattr(import_module(f"gamms.{_HOMES[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
